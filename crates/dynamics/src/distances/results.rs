//! Results of distances at one position.

use super::lanes::{Columns, Item, Row};
use super::solid::Solid;
use alloc::vec::Vec;
use condyle_linalg::{check, check_index};
use condyle_spatial::Vec3;
use nalgebra::DMatrix;

/// Distances of pairs of geometries at one position, with witness points, normals and gradients. Allocated once.
#[derive(Clone, Debug)]
pub struct Distances {
    /// Shapes in the world, and the centres of their bounding spheres. Written by: `evaluate`.
    pub(crate) solids: Vec<(Solid, Vec3<f64>)>,
    /// Rows of the spheres and capsules in the world; zeros for other shapes. Written by: `evaluate`.
    pub(crate) rounds: Vec<Row>,
    /// Pairs of spheres within the cutoff from the front, and pairs of capsules from the back. Shape: pairs. Written
    /// by: `evaluate`.
    pub(crate) items: Vec<Item>,
    /// Distance, point on the first shape and normal of each pair. Written by: `evaluate`.
    pub(crate) found: Vec<Row>,
    /// Signed distances (m). Written by: `evaluate`.
    pub(crate) distances: Vec<f64>,
    /// Whether each pair is within the cutoff. Written by: `evaluate`.
    pub(crate) near: Vec<bool>,
    /// Joint columns S in the world, block by block, and component by component in a block. Shape: blocks of columns
    /// × 6. Written by: `gradients`.
    pub(crate) columns: Vec<Columns>,
    /// Gradients with respect to the tangent of q, one row per pair, and padding after the last row. Shape: pairs × nv.
    /// Written by: `gradients`.
    pub(crate) gradients: Vec<f64>,
    pub(crate) nv: usize,
}

impl Distances {
    /// Returns the signed distance of a pair (m); negative while the shapes overlap.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn distance(&self, pair: usize) -> f64 {
        check_index("pair", pair, self.distances.len(), "pairs");
        self.distances[pair]
    }

    /// Returns the signed distances of all pairs (m).
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// Returns the witness points p₁ and p₂ of a pair in the world (m), on the surfaces of the first and the second
    /// shape: p₁ − p₂ = d n.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn points(&self, pair: usize) -> [Vec3<f64>; 2] {
        check_index("pair", pair, self.found.len(), "pairs");
        let [d, x, y, z, ..] = self.found[pair];
        let p = Vec3::new(x, y, z);
        [p, p - self.normal(pair).scale(d)]
    }

    /// Returns the unit vector n in the world from the second to the first shape. If the first shape moves along n, the
    /// distance increases.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn normal(&self, pair: usize) -> Vec3<f64> {
        check_index("pair", pair, self.found.len(), "pairs");
        let [.., x, y, z, _] = self.found[pair];
        Vec3::new(x, y, z)
    }

    /// Returns whether the distance of a pair was computed. Otherwise the bounding spheres of the pair are farther
    /// apart than the [cutoff](super::DistancePairs::set_cutoff), its distance is a lower bound, and its gradient is 0.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn is_near(&self, pair: usize) -> bool {
        check_index("pair", pair, self.near.len(), "pairs");
        self.near[pair]
    }

    /// Returns the gradient of a distance with respect to the tangent of q, nv numbers.
    ///
    /// # Panics
    /// Panics if the pair does not exist.
    #[track_caller]
    pub fn gradient(&self, pair: usize) -> &[f64] {
        check_index("pair", pair, self.distances.len(), "pairs");
        &self.gradients[pair * self.nv..][..self.nv]
    }

    /// Returns all gradients, one row after the other: pairs × nv numbers.
    pub fn gradients(&self) -> &[f64] {
        &self.gradients[..self.distances.len() * self.nv]
    }

    /// Returns the index and the distance (m) of the nearest pair; `None` without pairs.
    pub fn nearest(&self) -> Option<(usize, f64)> {
        self.distances.iter().copied().enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b))
    }

    /// Adds the Gauss-Newton matrix Σ_k w_k g_k g_kᵀ of the gradients g_k to H. For costs ½ w_k d_k², this is the
    /// Hessian without the curvature of the distances. weights: one number per pair. Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
    /// use condyle_dynamics::{Data, forward_kinematics, robots};
    /// use nalgebra::DMatrix;
    /// let arm = robots::arm7();
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let ball = Geometry::in_world(Shape::sphere([0.5, 0.1, 0.4], 0.1));
    /// let pairs = DistancePairs::new(&arm, &[GeometryPair::new(tool, ball)])?;
    /// let (mut data, mut distances) = (Data::new(&arm), Distances::new(&pairs));
    /// pairs.gradients(forward_kinematics(&arm, &mut data, &[0.3; 7]), &mut distances);
    /// let mut H = DMatrix::zeros(7, 7);
    /// distances.add_gauss_newton(&[2.0], &mut H);
    /// assert_eq!(H[(1, 3)], 2.0 * distances.gradient(0)[1] * distances.gradient(0)[3]);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the number of weights differs from the number of pairs, or if H is not nv × nv.
    #[track_caller]
    pub fn add_gauss_newton(&self, weights: &[f64], H: &mut DMatrix<f64>) {
        check("weights", weights.len(), self.distances.len());
        let nv = self.nv;
        assert!(H.shape() == (nv, nv), "H: expected {nv} × {nv}, found {:?}", H.shape());
        for (g, &weight) in self.gradients().chunks_exact(nv.max(1)).zip(weights) {
            for (column, &right) in H.as_mut_slice().chunks_exact_mut(nv.max(1)).zip(g) {
                if right != 0.0 {
                    for (entry, &left) in column.iter_mut().zip(g) {
                        *entry += weight * left * right;
                    }
                }
            }
        }
    }
}
