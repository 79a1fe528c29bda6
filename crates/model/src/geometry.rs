//! Shapes that are fixed to frames of a robot or to the world, and pairs of them.

use crate::error::Error;
use crate::frame_name::FrameName;
use crate::magnitude::LARGEST;
use crate::model::Model;
use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Scalar, Se3, Vec3};
use core::fmt;

/// Solid shape, in its own coordinates (m).
///
/// ```
/// use condyle_model::{Shape, Vec3};
/// let ball = Shape::sphere([0.0, 0.0, 0.1], 0.05);
/// let floor = Shape::HalfSpace { normal: Vec3::new(0.0, 0.0, 1.0), offset: 0.0 }; // all points with z ≤ 0
/// assert_eq!((ball.kind(), floor.kind()), ("sphere", "half-space"));
/// ```
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
    /// All points within the radius of a segment; a sphere if both ends coincide.
    Capsule {
        /// Ends of the segment (m).
        ends: [Vec3<f64>; 2],
        /// Radius (m), at least 0.
        radius: f64,
    },
    /// Box whose centre is the origin, and whose sides are parallel to the axes.
    Box {
        /// Half side lengths along the axes (m), at least 0.
        half_sizes: Vec3<f64>,
    },
    /// Cylinder whose centre is the origin, and whose axis is z.
    Cylinder {
        /// Radius (m), at least 0.
        radius: f64,
        /// Half of the length along z (m), at least 0.
        half_length: f64,
    },
    /// Ellipsoid whose centre is the origin, and whose principal axes are the coordinate axes.
    Ellipsoid {
        /// Semi-axes (m), larger than 0.
        radii: Vec3<f64>,
    },
    /// All points x with normal · x ≤ offset, such as the ground.
    HalfSpace {
        /// Unit vector that points out of the solid.
        normal: Vec3<f64>,
        /// Distance of the boundary plane from the origin along the normal (m).
        offset: f64,
    },
}

/// Shape that is fixed to a frame of the robot, or to the world.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Geometry {
    /// Name by which messages and callers find the geometry; it may be empty.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "String::is_empty"))]
    pub name: String,
    /// Frame to which the shape is fixed; `None` for the world.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub frame: Option<FrameName>,
    /// Pose of the shape's coordinates in the frame.
    #[cfg_attr(feature = "serde", serde(default = "Se3::identity", skip_serializing_if = "is_identity"))]
    pub placement: Se3<f64>,
    /// Shape in its own coordinates.
    pub shape: Shape,
}

/// Pair of geometries whose distance is computed. At least one of the two geometries is fixed to a frame.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GeometryPair {
    /// First geometry.
    pub first: Geometry,
    /// Second geometry: an obstacle in the world, or another geometry of the same robot.
    pub second: Geometry,
}

/// Returns whether a pose is the identity, which files leave out.
#[cfg(feature = "serde")]
fn is_identity(pose: &Se3<f64>) -> bool {
    *pose == Se3::identity()
}

/// Index of a body, and the pose of a shape in the body's frame.
type BodyPose = (usize, Se3<f64>);

/// Maximum deviation of the square of a normal's length from 1; chosen for numbers with seven digits in files.
const UNIT: f64 = 1e-6;

/// Returns whether a number is finite and not so large that distances overflow.
fn is_allowed(x: f64) -> bool {
    x.is_finite() && x.abs() <= LARGEST
}

impl Shape {
    /// Returns a sphere with a centre and a radius (m).
    pub fn sphere(center: impl Into<Vec3<f64>>, radius: f64) -> Self {
        Self::Sphere { center: center.into(), radius }
    }

    /// Returns a capsule around a segment (m).
    pub fn capsule(from: impl Into<Vec3<f64>>, to: impl Into<Vec3<f64>>, radius: f64) -> Self {
        Self::Capsule { ends: [from.into(), to.into()], radius }
    }

    /// Returns a box with half side lengths (m).
    pub fn cuboid(half_sizes: impl Into<Vec3<f64>>) -> Self {
        Self::Box { half_sizes: half_sizes.into() }
    }

    /// Returns the kind of the shape in words, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Sphere { .. } => "sphere",
            Self::Capsule { .. } => "capsule",
            Self::Box { .. } => "box",
            Self::Cylinder { .. } => "cylinder",
            Self::Ellipsoid { .. } => "ellipsoid",
            Self::HalfSpace { .. } => "half-space",
        }
    }

    /// Returns a capsule that contains a cylinder or an ellipsoid. Returns the shape itself for all other shapes.
    ///
    /// The capsule of a cylinder has the same radius and axis, and extends by the radius beyond both ends. The capsule
    /// of an ellipsoid with semi-axes a ≥ b ≥ c has the radius b and the half length a − b. It touches both tips.
    /// The ellipsoid is inside: (x − (a − b))² ≤ b² x²/a² for a − b ≤ x ≤ a.
    ///
    /// ```
    /// use condyle_model::{Shape, Vec3};
    /// let egg = Shape::Ellipsoid { radii: Vec3::new(0.1, 0.3, 0.2) };
    /// let Shape::Capsule { ends, radius } = egg.containing_capsule() else { unreachable!() };
    /// assert!((ends[1].y - 0.1).abs() < 1e-15 && radius == 0.2);
    /// ```
    pub fn containing_capsule(&self) -> Self {
        match *self {
            Self::Cylinder { radius, half_length } => {
                Self::capsule([0.0, 0.0, -half_length], [0.0, 0.0, half_length], radius)
            }
            Self::Ellipsoid { radii } => {
                let r = radii.to_array();
                let axis = (0..3).fold(0, |most, k| if r[k] > r[most] { k } else { most });
                let radius = r[(axis + 1) % 3].max(r[(axis + 2) % 3]);
                let mut end = [0.0; 3];
                end[axis] = r[axis] - radius;
                Self::capsule(end.map(|x| -x), end, radius)
            }
            shape => shape,
        }
    }

    /// Returns the centre and the radius of a sphere that contains the shape; the radius of a half-space is infinite.
    pub fn bounding_sphere(&self) -> (Vec3<f64>, f64) {
        match *self {
            Self::Sphere { center, radius } => (center, radius),
            Self::Capsule { ends: [a, b], radius } => {
                ((a + b).scale(0.5), radius + 0.5 * Scalar::sqrt((b - a).norm_squared()))
            }
            Self::Box { half_sizes } => (Vec3::zero(), Scalar::sqrt(half_sizes.norm_squared())),
            Self::Cylinder { radius, half_length } => {
                (Vec3::zero(), Scalar::sqrt(radius * radius + half_length * half_length))
            }
            Self::Ellipsoid { radii } => (Vec3::zero(), radii.x.max(radii.y).max(radii.z)),
            Self::HalfSpace { .. } => (Vec3::zero(), f64::INFINITY),
        }
    }

    /// Checks the numbers of the shape. The text of an error begins with the name of the field.
    pub(crate) fn check(&self) -> Result<(), String> {
        let finite = |field: &str, numbers: &[f64]| match numbers.iter().find(|x| !is_allowed(**x)) {
            None => Ok(()),
            Some(x) if x.is_nan() => Err(format!("{field} holds a NaN")),
            Some(x) if x.is_infinite() => Err(format!("{field} holds an infinite number")),
            Some(x) => Err(format!("{field} holds {x:e}, expected at most {LARGEST:e}")),
        };
        let positive = |field: &str, numbers: &[f64]| match numbers.iter().find(|&&x| x < 0.0) {
            Some(x) => Err(format!("{field} is {x}, expected at least 0")),
            None => finite(field, numbers),
        };
        match self {
            Self::Sphere { center, radius } => {
                finite("center", &center.to_array()).and_then(|()| positive("radius", &[*radius]))
            }
            Self::Capsule { ends: [a, b], radius } => {
                finite("ends", &[a.to_array(), b.to_array()].concat()).and_then(|()| positive("radius", &[*radius]))
            }
            Self::Box { half_sizes } => positive("half_sizes", &half_sizes.to_array()),
            Self::Cylinder { radius, half_length } => {
                positive("radius", &[*radius]).and_then(|()| positive("half_length", &[*half_length]))
            }
            Self::Ellipsoid { radii } => match radii.to_array().iter().find(|&&r| r <= 0.0) {
                Some(r) => Err(format!("radii holds {r}, expected more than 0")),
                None => finite("radii", &radii.to_array()),
            },
            Self::HalfSpace { normal, offset } => {
                finite("normal", &normal.to_array())?;
                finite("offset", &[*offset])?;
                let square = normal.norm_squared();
                if (square - 1.0).abs() > UNIT {
                    let length = Scalar::sqrt(square);
                    return Err(format!("normal has the length {length}, expected a unit vector"));
                }
                Ok(())
            }
        }
    }
}

impl Geometry {
    /// Returns the geometry of a shape that is fixed to a frame of the robot.
    pub fn on(frame: impl Into<FrameName>, shape: Shape) -> Self {
        Self { name: String::new(), frame: Some(frame.into()), placement: Se3::identity(), shape }
    }

    /// Returns the geometry of a shape that is fixed to the world.
    pub fn in_world(shape: Shape) -> Self {
        Self { name: String::new(), frame: None, placement: Se3::identity(), shape }
    }

    /// Returns the geometry with a name.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        Self { name: name.into(), ..self }
    }

    /// Returns the geometry with a pose of its shape in the frame or the world.
    #[must_use]
    pub fn at(self, placement: Se3<f64>) -> Self {
        Self { placement, ..self }
    }

    /// Returns the index of the geometry's body (0 for the world), and the pose of the shape in the body's frame.
    ///
    /// ```
    /// use condyle_model::{Geometry, Shape, robots};
    /// let arm = robots::arm7();
    /// let ball = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let (body, pose) = ball.resolve(&arm)?;
    /// let frame = &arm.frames()[arm.frame("tool")?];
    /// assert_eq!((body, pose), (frame.body, frame.placement));
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Geometry`] if the robot lacks the frame, if a number is not finite or has the wrong sign, or if
    /// the placement is not a rotation with a translation.
    pub fn resolve(&self, model: &Model) -> Result<(usize, Se3<f64>), Error> {
        self.checked(model).map_err(|what| Error::Geometry { geometry: format!("geometry `{}`", self.name), what })
    }

    fn checked(&self, model: &Model) -> Result<(usize, Se3<f64>), String> {
        self.shape.check()?;
        let Se3 { rotation, translation } = self.placement;
        if let Some(x) = translation.to_array().iter().find(|x| !is_allowed(**x)) {
            return Err(match x.is_finite() {
                true => format!("placement.translation holds {x:e}, expected at most {LARGEST:e}"),
                false => "placement.translation holds a number that is not finite".to_owned(),
            });
        }
        if !rotation.is_rotation() {
            return Err("placement.rotation is not a rotation matrix".to_owned());
        }
        let Some(frame) = &self.frame else { return Ok((0, self.placement)) };
        let number = frame.number(model).map_err(|error| format!("frame: {error}"))?;
        let frame = &model.frames()[number];
        Ok((frame.body, frame.placement * self.placement))
    }
}

impl Geometry {
    /// Returns the first field in which two geometries of one name differ, for messages.
    fn difference(&self, other: &Self) -> &'static str {
        match (self.shape == other.shape, self.frame == other.frame) {
            (false, _) => "shape",
            (true, false) => "frame",
            (true, true) => "placement",
        }
    }
}

impl fmt::Display for Geometry {
    /// Writes the name of the geometry, or its shape and frame if it has no name.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&*self.name, &self.frame) {
            ("", Some(frame)) => write!(f, "{} on `{}`", self.shape.kind(), frame.name),
            ("", None) => write!(f, "{} in the world", self.shape.kind()),
            (name, _) => write!(f, "`{name}`"),
        }
    }
}

impl fmt::Display for GeometryPair {
    /// Writes both geometries.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} and {}", self.first, self.second)
    }
}

impl GeometryPair {
    /// Returns the pair of two geometries.
    pub fn new(first: Geometry, second: Geometry) -> Self {
        Self { first, second }
    }

    /// Returns body and pose of both geometries, as [`Geometry::resolve`] does.
    ///
    /// # Errors
    /// Returns [`Error::Geometry`] for an invalid geometry, and for a pair without a meaningful distance: two
    /// geometries without a frame, a geometry with itself, two geometries of one moving body, two half-spaces. `index`
    /// is the index of the pair in the caller's list; the message contains it.
    pub fn resolve(&self, model: &Model, index: usize) -> Result<[(usize, Se3<f64>); 2], Error> {
        let wrong = |geometry: String, what: String| Error::Geometry { geometry, what };
        let named = |side: usize, geometry: &Geometry| format!("pairs[{index}].{} ({geometry})", SIDES[side]);
        if self.first.frame.is_none() && self.second.frame.is_none() {
            let what = "has no frame: expected at least one geometry on the robot".to_owned();
            return Err(wrong(format!("pairs[{index}] ({self})"), what));
        }
        let first = self.first.checked(model).map_err(|what| wrong(named(0, &self.first), what))?;
        let second = self.second.checked(model).map_err(|what| wrong(named(1, &self.second), what))?;
        let body = first.0;
        let what = if self.first == self.second {
            "is a geometry with itself: expected two different geometries".to_owned()
        } else if let (Shape::HalfSpace { .. }, Shape::HalfSpace { .. }) = (self.first.shape, self.second.shape) {
            "has two half-spaces, whose distance is not defined".to_owned()
        } else if body > 0 && body == second.0 {
            format!("has two geometries of the body `{}`, whose distance never changes", model.bodies()[body].name)
        } else {
            return Ok([first, second]);
        };
        Err(wrong(format!("pairs[{index}] ({self})"), what))
    }

    /// Returns bodies and poses of a list of pairs, as [`resolve`](Self::resolve) does for each pair.
    ///
    /// ```
    /// use condyle_model::{Geometry, GeometryPair, Shape, robots};
    /// let ball = |radius| Geometry::in_world(Shape::sphere([0.5, 0.0, 0.4], radius)).named("ball");
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let pairs = [0.1, 0.2].map(|radius| GeometryPair::new(tool.clone(), ball(radius)));
    /// let error = GeometryPair::resolve_all(&robots::arm7(), &pairs).unwrap_err();
    /// let text = "pairs[1].second (`ball`): has the name of pairs[0].second, but another shape";
    /// assert_eq!(error.to_string(), text);
    /// ```
    ///
    /// # Errors
    /// Returns the errors of [`resolve`](Self::resolve). Returns [`Error::Geometry`] too if two different geometries
    /// have one name, or if a pair is in the list twice, in either order.
    pub fn resolve_all(model: &Model, pairs: &[Self]) -> Result<Vec<[BodyPose; 2]>, Error> {
        // the different geometries, with the pair and the side that have them first
        let mut all: Vec<(&Geometry, usize, usize)> = Vec::new();
        let mut seen = BTreeMap::new();
        let mut placed = Vec::with_capacity(pairs.len());
        for (index, pair) in pairs.iter().enumerate() {
            placed.push(pair.resolve(model, index)?);
            let mut both = [0; 2];
            for (side, geometry) in [&pair.first, &pair.second].into_iter().enumerate() {
                if let Some(known) = all.iter().position(|(other, ..)| *other == geometry) {
                    both[side] = known;
                    continue;
                }
                let same_name = |(other, ..): &&(&Geometry, usize, usize)| other.name == geometry.name;
                if let Some((other, k, at)) = all.iter().find(same_name).filter(|_| !geometry.name.is_empty()) {
                    let what = format!(
                        "has the name of pairs[{k}].{}, but another {}",
                        SIDES[*at],
                        geometry.difference(other)
                    );
                    let geometry = format!("pairs[{index}].{} ({geometry})", SIDES[side]);
                    return Err(Error::Geometry { geometry, what });
                }
                both[side] = all.len();
                all.push((geometry, index, side));
            }
            both.sort_unstable();
            if let Some(first) = seen.insert(both, index) {
                let what = format!("is the same pair as pairs[{first}]");
                return Err(Error::Geometry { geometry: format!("pairs[{index}] ({pair})"), what });
            }
        }
        Ok(placed)
    }
}

/// Names of both geometries of a pair, for messages.
const SIDES: [&str; 2] = ["first", "second"];
