//! One pair of geometries, prepared for a residual whose states are in SIMD lanes.

use super::round::{Round, Witness, capsules, spheres};
use super::solid::{Solid, distance, is_exact};
use condyle_model::{Error, GeometryPair, Model};
use condyle_spatial::{Act, Scalar, Se3, Vec3, same_layout};

/// Method of computing the distance of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Both shapes are spheres.
    Spheres,
    /// Both shapes are spheres or capsules.
    Capsules,
    /// Another pair, which is computed for one state after another.
    Other,
}

same_layout!(Method);

/// Pair of geometries with their bodies, and their shapes in the coordinates of the bodies.
#[derive(Clone, Copy, Debug)]
pub struct PreparedPair {
    bodies: [usize; 2],
    solids: [Solid; 2],
}

/// Number of entries of [`PreparedPair::numbers`].
pub const NUMBERS: usize = 14;

impl PreparedPair {
    /// Prepares a pair for a robot; `index` is the index of the pair in the caller's list.
    ///
    /// # Errors
    /// Returns the errors of [`DistancePairs::new`](super::DistancePairs::new).
    pub fn new(model: &Model, pair: &GeometryPair, index: usize) -> Result<Self, Error> {
        let [first, second] = pair.resolve(model, index)?;
        let mut shapes = [pair.first.shape, pair.second.shape];
        if !is_exact(&shapes[0], &shapes[1]) {
            shapes = shapes.map(|shape| shape.containing_capsule());
        }
        let solids = [Solid::new(&shapes[0], &first.1), Solid::new(&shapes[1], &second.1)];
        Ok(Self { bodies: [first.0, second.0], solids })
    }

    /// Returns the indices of both bodies; 0 is the world.
    pub fn bodies(&self) -> [usize; 2] {
        self.bodies
    }

    /// Returns how the distance is computed.
    pub fn method(&self) -> Method {
        match self.solids {
            [Solid::Sphere(_), Solid::Sphere(_)] => Method::Spheres,
            [Solid::Sphere(_) | Solid::Capsule(_), Solid::Sphere(_) | Solid::Capsule(_)] => Method::Capsules,
            _ => Method::Other,
        }
    }

    /// Returns the numbers of two spheres or capsules in the coordinates of their bodies: middle, half vector and
    /// radius of each. All numbers of other shapes are 0.
    pub fn numbers(&self) -> [f64; NUMBERS] {
        let mut all = [0.0; NUMBERS];
        for (solid, to) in self.solids.iter().zip(all.chunks_exact_mut(NUMBERS / 2)) {
            if let Solid::Sphere(round) | Solid::Capsule(round) = solid {
                to[..3].copy_from_slice(&round.center.to_array());
                to[3..6].copy_from_slice(&round.half.to_array());
                to[6] = round.radius;
            }
        }
        all
    }

    /// Returns the distance, the witness point on the first shape and the normal, for given poses of both bodies.
    pub fn distance(&self, poses: &[Se3<f64>; 2]) -> (f64, Vec3<f64>, Vec3<f64>) {
        let [a, b] = [0, 1].map(|k| self.solids[k].moved(&poses[k]));
        let Witness { distance, points, normal } = distance(&a, &b);
        (distance, points[0], normal)
    }
}

/// Returns the sphere or capsule from [`PreparedPair::numbers`], for a pose of its body.
#[inline(always)]
fn round<S: Scalar>(numbers: &[S], pose: &Se3<S>) -> Round<S> {
    let vector = |k: usize| Vec3::new(numbers[k], numbers[k + 1], numbers[k + 2]);
    Round { center: pose.act(vector(0)), half: pose.rotation * vector(3), radius: numbers[6] }
}

/// Returns the distance of two spheres or capsules with the `numbers` of a pair, the witness point on the first shape
/// and the normal, for given poses of both bodies.
#[inline(always)]
pub fn round_distance<S: Scalar>(method: Method, numbers: &[S; NUMBERS], poses: [Se3<S>; 2]) -> (S, Vec3<S>, Vec3<S>) {
    let [a, b] = [round(&numbers[..7], &poses[0]), round(&numbers[7..], &poses[1])];
    let witness = if method == Method::Spheres { spheres(&a, &b) } else { capsules(&a, &b) };
    (witness.distance, witness.points[0], witness.normal)
}
