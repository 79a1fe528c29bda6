//! Geometries on a robot and in the world, and the pairs of them whose distances a residual contains.

use super::frame_name::FrameName;
use super::target::check_finite;
use condyle_dynamics::{Model, Vec3};

/// Shape of a geometry, in the coordinates of the frame to which the geometry is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
#[non_exhaustive]
pub enum Shape {
    /// Ball; a point if the radius is 0.
    Sphere {
        /// Centre of the sphere (m).
        center: Vec3<f64>,
        /// Radius (m), at least 0.
        radius: f64,
    },
}

/// Shape that is fixed to a frame of the robot, or to the world.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Geometry {
    /// Frame to which the shape is fixed; `None` for the world.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub frame: Option<FrameName>,
    /// Shape in the coordinates of the frame.
    pub shape: Shape,
}

/// Pair of geometries whose distance is one entry of [`Residual::Distances`](crate::robot::Residual::Distances). At
/// least one of the two geometries is fixed to a frame.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GeometryPair {
    /// First geometry.
    pub first: Geometry,
    /// Second geometry: an obstacle in the world, or another geometry of the same robot.
    pub second: Geometry,
}

impl Shape {
    /// Returns a sphere with a centre and a radius (m).
    pub fn sphere(center: impl Into<Vec3<f64>>, radius: f64) -> Self {
        Self::Sphere { center: center.into(), radius }
    }
}

impl Geometry {
    /// Returns the geometry of a shape that is fixed to a frame of the robot.
    pub fn on(frame: impl Into<FrameName>, shape: Shape) -> Self {
        Self { frame: Some(frame.into()), shape }
    }

    /// Returns the geometry of a shape that is fixed to the world.
    pub fn in_world(shape: Shape) -> Self {
        Self { frame: None, shape }
    }

    /// Returns the body of the geometry (0 for the world), the centre of its sphere in the body's coordinates, and the
    /// radius. Returns an error if the geometry is invalid or the robot lacks the frame; the error contains `name`.
    fn resolve(&self, model: &Model, name: &str) -> Result<(usize, Vec3<f64>, f64), String> {
        let Shape::Sphere { center, radius } = self.shape;
        check_finite(&format!("{name}.center"), &center.to_array())?;
        check_finite(&format!("{name}.radius"), &[radius])?;
        if radius < 0.0 {
            return Err(format!("its {name}.radius is {radius}, expected at least 0"));
        }
        let Some(frame) = &self.frame else { return Ok((0, center, radius)) };
        let wrong = |error| format!("its {name}.frame: {error}");
        let frame = &model.frames()[frame.number(model).map_err(wrong)?];
        Ok((frame.body, frame.placement.rotation * center + frame.placement.translation, radius))
    }
}

impl GeometryPair {
    /// Returns the pair of two geometries.
    pub fn new(first: Geometry, second: Geometry) -> Self {
        Self { first, second }
    }
}

/// Pair of geometries, prepared for the computation of its distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PairPlan {
    /// Index of the body of each geometry; 0 is the world.
    pub bodies: [usize; 2],
    /// Centres of both spheres in the coordinates of their bodies, then the sum of the radii.
    pub numbers: [f64; 7],
}

impl PairPlan {
    /// Prepares pairs of geometries for a robot. Returns an error with the index of an invalid pair and the name of the
    /// invalid field.
    pub(crate) fn all(model: &Model, pairs: &[GeometryPair]) -> Result<Vec<Self>, String> {
        let plan = |(k, GeometryPair { first, second }): (usize, &GeometryPair)| {
            if first.frame.is_none() && second.frame.is_none() {
                return Err(format!("its pairs[{k}] has no frame: expected at least one geometry on the robot"));
            }
            let (one, a, radius) = first.resolve(model, &format!("pairs[{k}].first"))?;
            let (other, b, its) = second.resolve(model, &format!("pairs[{k}].second"))?;
            Ok(Self { bodies: [one, other], numbers: [a.x, a.y, a.z, b.x, b.y, b.z, radius + its] })
        };
        pairs.iter().enumerate().map(plan).collect()
    }
}
