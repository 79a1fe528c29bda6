//! Signed distances between shapes on a robot and in the world, with exact derivatives.
//!
//! A [`GeometryPair`] names two shapes. [`DistancePairs`] prepares many pairs for one robot, and [`Distances`] holds
//! their results at one position. For witness points p₁ and p₂ and the unit normal n from the second to the first shape
//!
//! ```text
//! d = n·(p₁ − p₂)     ∂d/∂q = nᵀ (J₁ − J₂)     J_i = ∂p_i/∂q for p_i fixed to its body
//! ```
//!
//! d is negative while the shapes overlap. Then d is the shortest translation that separates them, with a minus sign.
//! The derivative is exact wherever d is differentiable, because small movements of the witness points on the surfaces
//! do not change d. It is not differentiable where several pairs of points are nearest, for example for parallel faces.
//! Then one of these pairs gives the derivative.
//!
//! ```
//! use condyle_dynamics::distances::{DistancePairs, Distances, Geometry, GeometryPair, Shape};
//! use condyle_dynamics::{Data, forward_kinematics, robots};
//! let arm = robots::arm7();
//! let tool = Geometry::on("tool", Shape::capsule([0.0, 0.0, -0.1], [0.0, 0.0, 0.1], 0.03)).named("tool");
//! let table = Geometry::in_world(Shape::HalfSpace { normal: [0.0, 0.0, 1.0].into(), offset: 0.0 });
//! let pairs = DistancePairs::new(&arm, &[GeometryPair::new(tool, table)])?;
//! let (mut data, mut distances) = (Data::new(&arm), Distances::new(&pairs));
//! let q = [0.1, 0.7, 0.2, 1.1, -0.3, 0.4, 0.2];
//! pairs.gradients(forward_kinematics(&arm, &mut data, &q), &mut distances);
//! let (d, gradient) = (distances.distance(0), distances.gradient(0).to_vec());
//! let mut moved = q;
//! moved[1] += 1e-6;
//! pairs.values(forward_kinematics(&arm, &mut data, &moved), &mut distances);
//! assert!(((distances.distance(0) - d) / 1e-6 - gradient[1]).abs() < 1e-5);
//! # Ok::<(), condyle_dynamics::Error>(())
//! ```
//!
//! | | sphere | capsule | box | cylinder | ellipsoid | half-space |
//! | --- | --- | --- | --- | --- | --- | --- |
//! | sphere | exact | exact | exact | exact | exact | exact |
//! | capsule | | exact | exact | capsule | capsule | exact |
//! | box | | | exact | capsule | capsule | exact |
//! | cylinder, ellipsoid | | | | capsule | capsule | exact |
//!
//! "capsule" means that a capsule that contains the cylinder or ellipsoid takes its place. So the distance is a lower
//! bound. [`DistancePairs::replacements`] lists these pairs.
//!
//! Source of the derivative: Danskin, *The Theory of Max-Min* (1967), for the derivative of a minimum.

mod box_pair;
mod boxes;
mod curved;
mod lanes;
mod limits;
mod pairs;
#[doc(hidden)]
pub mod prepared;
mod results;
mod round;
mod solid;

#[cfg(feature = "meshes")]
pub use condyle_model::Fit;
#[cfg(feature = "loaders")]
pub use condyle_model::{CollisionMesh, Collisions};
pub use condyle_model::{FrameName, Geometry, GeometryPair, Shape};
pub use limits::DistanceLimits;
pub use pairs::{DistancePairs, Replacement};
pub use results::Distances;
