//! Pairs of geometries, prepared for residuals whose states are in SIMD lanes: each lane is another state.
//!
//! Distances are computed in four kernels. [`place_shapes`] moves each different shape to the world once, also if many
//! pairs have it. [`find_near`] compares bounding spheres. [`pair_distances`] computes the pairs that are near in some
//! lane, and [`pair_rows`] their gradients. [`other_results`] computes the pairs that have no kernel.
//!
//! Distances above a range r are replaced by r, with the gradient 0. A result is therefore min(d, r).

use super::pairs::{DistancePairs, PathColumn, add_path};
use super::round::{Round, Witness, capsule_and_sphere, capsules, spheres};
use super::solid::{Solid, distance, is_exact};
use crate::passes::frames::Placements;
use alloc::vec::Vec;
use condyle_model::{Error, Geometry, GeometryPair, Model, Shape};
use condyle_spatial::block::{Block, gather_rows, scatter_rows};
use condyle_spatial::{Act, Force, Mat3, Scalar, Se3, Vec3, kernel, same_layout};

/// Method of computing the distance of a pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Both shapes are spheres.
    Spheres,
    /// Both shapes are spheres or capsules.
    Capsules,
    /// Capsule, followed by a sphere: a special case of capsules that takes a third of the time.
    CapsuleAndSphere,
    /// Sphere or capsule above a half-space.
    Plane,
    /// Another pair, which is computed for one state after another.
    Other,
}

impl Method {
    /// Returns the method for two shapes.
    pub(crate) fn of(first: &Solid, second: &Solid) -> Self {
        match (first, second) {
            (Solid::Sphere(_), Solid::Sphere(_)) => Self::Spheres,
            (Solid::Capsule(_), Solid::Sphere(_)) => Self::CapsuleAndSphere,
            (Solid::Sphere(_) | Solid::Capsule(_), Solid::Capsule(_)) => Self::Capsules,
            (Solid::Sphere(_) | Solid::Capsule(_), Solid::HalfSpace { .. }) => Self::Plane,
            _ => Self::Other,
        }
    }
}

/// Number of numbers of a shape: middle, half vector and radius of a sphere or capsule; normal, zeros and offset of a
/// half-space; centre, zeros and radius of the bounding sphere of other shapes.
pub const NUMBERS: usize = 7;
/// Number of numbers of a result: the distance, the witness point on the first shape, and the normal.
pub const RESULT: usize = 7;

/// Largest number of lanes.
const WIDEST: usize = 8;

/// Geometry on a body.
#[derive(Clone, Debug)]
struct PreparedShape {
    geometry: Geometry,
    /// Shape that is used: the geometry's shape, or the capsule that replaces it.
    shape: Shape,
    /// Index of the body; 0 is the world.
    body: usize,
    /// Pose of the geometry's frame in the internal frame of its body, which is rotated to the joint axis.
    frame: Se3<f64>,
    /// Shape in the internal frame of the body, which is rotated to the joint axis.
    solid: Solid,
}

/// Pair of shapes, as indices.
#[derive(Clone, Copy, Debug)]
struct PreparedPair {
    shapes: [usize; 2],
    method: Method,
    /// First column of the path between both bodies, and the index after the last.
    path: [usize; 2],
}

/// Pairs of geometries with their bodies, and the columns of the joints between them.
#[derive(Clone, Debug, Default)]
pub struct PreparedPairs {
    shapes: Vec<PreparedShape>,
    pairs: Vec<PreparedPair>,
    path: Vec<PathColumn>,
}

same_layout!(PreparedPairs);

impl PreparedPairs {
    /// Prepares pairs for a robot.
    ///
    /// # Errors
    /// Returns the errors of [`DistancePairs::new`](super::DistancePairs::new).
    pub fn new(model: &Model, pairs: &[GeometryPair]) -> Result<Self, Error> {
        let mut all = Self::default();
        for (pair, placed) in pairs.iter().zip(GeometryPair::resolve_all(model, pairs)?) {
            let exact = is_exact(&pair.first.shape, &pair.second.shape);
            let mut shapes = [0; 2];
            for ((geometry, (body, pose)), to) in [&pair.first, &pair.second].into_iter().zip(placed).zip(&mut shapes) {
                let shape = if exact { geometry.shape } else { geometry.shape.containing_capsule() };
                let turned = Se3::new(model.nodes()[body].axis_rotation.transpose(), Vec3::zero());
                *to = all.add(geometry, shape, body, &(turned * pose));
            }
            let method = all.order(&mut shapes);
            let first = all.path.len();
            add_path(model, shapes.map(|k| all.shapes[k].body), &mut all.path);
            all.pairs.push(PreparedPair { shapes, method, path: [first, all.path.len()] });
        }
        Ok(all)
    }

    /// Moves a half-space after a sphere or capsule, and a sphere after a capsule. Returns the method of the pair.
    /// Neither a distance nor its gradient depends on the order of the shapes.
    fn order(&self, shapes: &mut [usize; 2]) -> Method {
        let [a, b] = shapes.map(|k| &self.shapes[k].solid);
        match (Method::of(a, b), Method::of(b, a)) {
            (Method::Other, method @ Method::Plane) | (Method::Capsules, method @ Method::CapsuleAndSphere) => {
                shapes.reverse();
                method
            }
            (method, _) => method,
        }
    }

    /// Adds a shape unless an equal one exists. Returns its index.
    fn add(&mut self, geometry: &Geometry, shape: Shape, body: usize, pose: &Se3<f64>) -> usize {
        let same = |other: &PreparedShape| other.shape == shape && other.geometry == *geometry;
        self.shapes.iter().position(same).unwrap_or_else(|| {
            let (solid, frame) = (Solid::new(&shape, pose), *pose * geometry.placement.inverse());
            self.shapes.push(PreparedShape { geometry: geometry.clone(), shape, body, frame, solid });
            self.shapes.len() - 1
        })
    }

    /// Sets the placement of all geometries with a name. Allocates nothing.
    pub fn place(&mut self, name: &str, placement: Se3<f64>) {
        for shape in self.shapes.iter_mut().filter(|shape| shape.geometry.name == name) {
            shape.geometry.placement = placement;
            shape.solid = Solid::new(&shape.shape, &(shape.frame * placement));
        }
    }

    /// Returns the number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    /// Returns the number of different shapes.
    pub fn shape_count(&self) -> usize {
        self.shapes.len()
    }

    /// Returns whether the pairs of `other` differ only in sizes and poses of their shapes.
    pub fn is_like(&self, other: &Self) -> bool {
        let key = |all: &Self, k: usize| (all.pairs[k].shapes, all.pairs[k].method);
        self.pairs.len() == other.pairs.len()
            && self.shapes.len() == other.shapes.len()
            && self.shapes.iter().zip(&other.shapes).all(|(a, b)| a.body == b.body)
            && (0..self.pairs.len()).all(|k| key(self, k) == key(other, k))
    }

    /// Returns the indices of the pairs that are computed for one state after another.
    pub fn others(&self) -> impl Iterator<Item = usize> {
        self.pairs.iter().enumerate().filter(|(_, pair)| pair.method == Method::Other).map(|(k, _)| k)
    }

    /// Returns the coordinates that change the distance of a pair.
    pub fn coordinates(&self, pair: usize) -> impl Iterator<Item = usize> {
        let [first, end] = self.pairs[pair].path;
        self.path[first..end].iter().map(|path| path.coordinate)
    }

    /// Returns the numbers of a shape in the internal frame of its body.
    pub fn numbers(&self, shape: usize) -> [f64; NUMBERS] {
        let numbers = |a: Vec3<f64>, b: Vec3<f64>, c| [a.x, a.y, a.z, b.x, b.y, b.z, c];
        match self.shapes[shape].solid {
            Solid::Sphere(round) | Solid::Capsule(round) => numbers(round.center, round.half, round.radius),
            Solid::HalfSpace { normal, offset } => numbers(normal, Vec3::zero(), offset),
            _ => {
                let PreparedShape { shape, frame, geometry, .. } = &self.shapes[shape];
                let (center, radius) = shape.bounding_sphere();
                numbers((*frame * geometry.placement).act(center), Vec3::zero(), radius)
            }
        }
    }

    /// Returns the result of a pair, for given poses of the internal frames of both bodies.
    fn result(&self, pair: usize, poses: &[Se3<f64>; 2]) -> [f64; RESULT] {
        let PreparedPair { shapes, .. } = self.pairs[pair];
        let [a, b] = [0, 1].map(|k| self.shapes[shapes[k]].solid.moved(&poses[k]));
        let Witness { distance, points: [p, _], normal: n } = distance(&a, &b);
        [distance, p.x, p.y, p.z, n.x, n.y, n.z]
    }
}

impl From<&DistancePairs> for PreparedPairs {
    /// Returns the same pairs, with the latest placements of the geometries.
    fn from(from: &DistancePairs) -> Self {
        let shape = |placed: &super::pairs::Placed| {
            let (geometry, shape, frame) = placed.parts();
            PreparedShape { geometry: geometry.clone(), shape, body: placed.body, frame, solid: placed.solid }
        };
        let mut all =
            Self { shapes: from.geometries.iter().map(shape).collect(), pairs: Vec::new(), path: from.path.clone() };
        for pair in &from.pairs {
            // the signs of a path belong to the order of the shapes, and the gradient does not depend on it
            let mut shapes = pair.geometries;
            let method = all.order(&mut shapes);
            let path = if shapes == pair.geometries { pair.path } else { all.reversed(pair.path) };
            all.pairs.push(PreparedPair { shapes, method, path });
        }
        all
    }
}

impl PreparedPairs {
    /// Appends a part of the path with opposite signs. Returns its range.
    fn reversed(&mut self, [first, end]: [usize; 2]) -> [usize; 2] {
        let begin = self.path.len();
        for k in first..end {
            let path = self.path[k];
            self.path.push(PathColumn { ratio: -path.ratio, ..path });
        }
        [begin, self.path.len()]
    }
}

/// Returns three numbers as a vector.
#[inline(always)]
fn vector<S: Scalar>(numbers: &[S], at: usize) -> Vec3<S> {
    Vec3::new(numbers[at], numbers[at + 1], numbers[at + 2])
}

/// Returns the sphere or capsule with the given numbers.
#[inline(always)]
fn round<S: Scalar>(numbers: &[S]) -> Round<S> {
    Round { center: vector(numbers, 0), half: vector(numbers, 3), radius: numbers[6] }
}

/// Returns the distance of a sphere or capsule from the half-space with the given numbers.
#[inline(always)]
fn above<S: Scalar>(first: &Round<S>, plane: &[S]) -> Witness<S> {
    let (n, offset) = (vector(plane, 0), plane[6]);
    let along = first.half.dot(n);
    let steep = first.half.norm_squared() * S::splat(LEVEL);
    let is_level = (along * along).lt(steep); // then the middle is the nearest point
    let down = S::select(along.lt(S::zero()), S::one(), -S::one());
    let t = S::select(is_level, S::zero(), down);
    let p = first.center + first.half.scale(t) - n.scale(first.radius);
    let distance = n.dot(p) - offset;
    Witness { distance, points: [p, p - n.scale(distance)], normal: n }
}

/// Square of the sine of the angle between a capsule and a half-space below which they count as parallel.
const LEVEL: f64 = super::boxes::PERPENDICULAR * super::boxes::PERPENDICULAR;

kernel! {
    /// Moves the shapes to the world. `shapes` has the numbers of each shape in its body, and gets the numbers in the
    /// world. With `is_common`, all lanes have the numbers of `pairs`, and `shapes` is only written.
    pub fn place_shapes<S>(placements: Placements<'_, S>, pairs: &PreparedPairs, is_common: bool, shapes: &mut [S]) {
        let (mut body, mut X) = (usize::MAX, Se3::identity());
        for (k, shape) in pairs.shapes.iter().enumerate() {
            let numbers = &mut shapes[k * NUMBERS..][..NUMBERS];
            if is_common {
                for (to, x) in numbers.iter_mut().zip(pairs.numbers(k)) {
                    *to = S::splat(x);
                }
            }
            if shape.body == 0 {
                continue;
            }
            if shape.body != body {
                body = shape.body;
                X = placements.world.oX[body];
            }
            let (first, half) = (vector(numbers, 0), vector(numbers, 3));
            match shape.solid {
                Solid::HalfSpace { .. } => {
                    let normal = X.rotation * first;
                    numbers[..3].copy_from_slice(&normal.to_array());
                    numbers[6] += normal.dot(X.translation);
                }
                Solid::Sphere(_) => numbers[..3].copy_from_slice(&X.act(first).to_array()),
                _ => {
                    numbers[..3].copy_from_slice(&X.act(first).to_array());
                    numbers[3..6].copy_from_slice(&(X.rotation * half).to_array());
                }
            }
        }
    }
}

/// Pairs whose bounding spheres are nearer than a range in some lane.
#[derive(Clone, Debug, Default)]
pub struct Near {
    range: f64,
    /// Whether each pair is near; longer than the list of pairs if there were more pairs before.
    pairs: Vec<bool>,
}

same_layout!(Near);

impl Near {
    /// Sets the range (m), and makes the list long enough for a number of pairs. Allocates only if there were never as
    /// many pairs.
    pub fn reset(&mut self, range: f64, count: usize) {
        self.range = range;
        if self.pairs.len() < count {
            self.pairs.resize(count, true);
        }
    }

    /// Returns whether a pair is near in some lane.
    pub fn is_near(&self, pair: usize) -> bool {
        self.pairs[pair]
    }
}

kernel! {
    /// Finds the pairs whose bounding spheres are nearer than the range in some lane.
    pub fn find_near<S>(pairs: &PreparedPairs, shapes: &[S], near: &mut Near) {
        let reach = |numbers: &[S]| vector(numbers, 3).norm_squared().sqrt() + numbers[6];
        let is_flat = |k: usize| matches!(pairs.shapes[k].solid, Solid::HalfSpace { .. });
        let range = S::splat(near.range);
        for (PreparedPair { shapes: [a, b], .. }, is_near) in pairs.pairs.iter().zip(&mut near.pairs) {
            let (first, second) = (&shapes[a * NUMBERS..][..NUMBERS], &shapes[b * NUMBERS..][..NUMBERS]);
            *is_near = if near.range == f64::INFINITY {
                true
            } else if is_flat(*a) || is_flat(*b) {
                let (round, plane) = if is_flat(*b) { (first, second) } else { (second, first) };
                let height = vector(round, 0).dot(vector(plane, 0)) - plane[6]; // n·c − offset
                S::any((height - reach(round)).lt(range))
            } else {
                let limit = reach(first) + reach(second) + range;
                let away = vector(first, 0) - vector(second, 0);
                S::any(away.norm_squared().lt(limit * limit))
            };
        }
    }
}

/// Result of a pair that is farther away than a range.
#[inline(always)]
fn far<S: Scalar>(range: f64) -> [S; RESULT] {
    let o = S::zero();
    [S::splat(range), o, o, o, o, o, o]
}

kernel! {
    /// Computes the results of all pairs except the [others](PreparedPairs::others), from shapes in the world.
    pub fn pair_distances<S>(pairs: &PreparedPairs, shapes: &[S], near: &Near, results: &mut [S]) {
        for (k, PreparedPair { shapes: [a, b], method, .. }) in pairs.pairs.iter().enumerate() {
            let result = &mut results[k * RESULT..][..RESULT];
            if !near.pairs[k] {
                result.copy_from_slice(&far(near.range));
                continue;
            }
            let (first, second) = (&shapes[a * NUMBERS..][..NUMBERS], &shapes[b * NUMBERS..][..NUMBERS]);
            let Witness { distance, points: [p, _], normal: n } = match method {
                Method::Spheres => spheres(&round(first), &round(second)),
                Method::Capsules => capsules(&round(first), &round(second)),
                Method::CapsuleAndSphere => capsule_and_sphere(&round(first), &round(second)),
                Method::Plane => above(&round(first), second),
                Method::Other => continue,
            };
            result.copy_from_slice(&[distance, p.x, p.y, p.z, n.x, n.y, n.z]);
            if near.range < f64::INFINITY {
                limit_result(near.range, result);
            }
        }
    }
}

/// Replaces a distance above a range by the range, with the normal 0.
#[inline(always)]
fn limit_result<S: Scalar>(range: f64, result: &mut [S]) {
    let (range, zero) = (S::splat(range), S::zero());
    let is_far = range.lt(result[0]);
    result[0] = S::select(is_far, range, result[0]);
    for n in &mut result[4..] {
        *n = S::select(is_far, zero, *n);
    }
}

/// Computes the gradient nᵀ (J₁ − J₂) of pair k from its result.
#[inline(always)]
pub fn write_row<S: Scalar>(
    placements: Placements<'_, S>,
    pairs: &PreparedPairs,
    k: usize,
    result: &[S],
    row: &mut [S],
) {
    row.fill(S::zero());
    // the line of the force n contains both witness points, so one moment about the origin serves for both
    let f = Force::at_point(vector(result, 1), vector(result, 4));
    let [first, end] = pairs.pairs[k].path;
    for path in &pairs.path[first..end] {
        row[path.coordinate] += placements.world.S[path.column].dot(f) * S::splat(path.ratio);
    }
}

kernel! {
    /// Computes the gradients nᵀ (J₁ − J₂) of all pairs, one row after the other.
    pub fn pair_rows<S>(
        placements: Placements<'_, S>, pairs: &PreparedPairs, near: &Near, results: &[S], rows: &mut [S],
    ) {
        let nv = placements.model.nv();
        for k in 0..pairs.pairs.len() {
            let row = &mut rows[k * nv..][..nv];
            if !near.pairs[k] {
                row.fill(S::zero());
            } else {
                write_row(placements, pairs, k, &results[k * RESULT..][..RESULT], row);
            }
        }
    }
}

kernel! {
    /// Writes the columns of the rotation and the translation of the internal frames of two bodies.
    fn body_poses<S>(placements: Placements<'_, S>, bodies: [usize; 2], poses: &mut [S; 24]) {
        for k in 0..2 {
            let X = if bodies[k] == 0 { Se3::identity() } else { placements.world.oX[bodies[k]] };
            let columns = [X.rotation.x, X.rotation.y, X.rotation.z, X.translation];
            for i in 0..4 {
                poses[12 * k + 3 * i..][..3].copy_from_slice(&columns[i].to_array());
            }
        }
    }
}

/// Computes the results of the [others](PreparedPairs::others) that are near, for one lane after another. `of` returns
/// the pairs of each of `count` lanes.
pub fn other_results<'a, S: Block<Number = f64>>(
    placements: Placements<'_, S>,
    of: &dyn Fn(usize) -> &'a PreparedPairs,
    count: usize,
    near: &Near,
    results: &mut [S],
) {
    let pairs = of(0);
    for k in pairs.others().filter(|&k| near.pairs[k]) {
        let (mut lanes, mut poses) = ([S::zero(); 24], [[0.0; 24]; WIDEST]);
        body_poses(placements, pairs.pairs[k].shapes.map(|k| pairs.shapes[k].body), &mut lanes);
        scatter_rows(&lanes, &mut poses.each_mut().map(<[f64; 24]>::as_mut_slice)[..count]);
        let mut found = [[0.0; RESULT]; WIDEST];
        for (lane, found) in found[..count].iter_mut().enumerate() {
            let vector = |k: usize| Vec3::new(poses[lane][k], poses[lane][k + 1], poses[lane][k + 2]);
            let pose = |k| Se3::new(Mat3 { x: vector(k), y: vector(k + 3), z: vector(k + 6) }, vector(k + 9));
            *found = of(lane).result(k, &[pose(0), pose(12)]);
            limit_result(near.range, found);
        }
        let found = found.each_ref().map(<[f64; RESULT]>::as_slice);
        gather_rows(&found[..count], &mut results[k * RESULT..][..RESULT]);
    }
}
