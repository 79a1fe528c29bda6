//! Feet of a walking robot.

use crate::Error;
use condyle_dynamics::{ContactConstraint, Model, ReferenceFrame};
use condyle_optimal::robot::{Contact, FrictionCone, Limit, Residual, WrenchCone};

/// Number of sides of the pyramid in the friction cone.
const FACETS: usize = 8;

/// Foot of a walking robot: a frame, and the shape of the foot around this frame.
///
/// ```
/// use condyle_mpc::Foot;
/// let ball = Foot::point("LF_foot", 0.6, 0.02);
/// let sole = Foot::sole("left_sole", 0.6, [0.17, 0.055]);
/// assert!(ball.check().is_ok() && sole.check().is_ok());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Foot {
    /// Name of the frame. The origin of the frame is the centre of the ball, or the middle of the sole.
    pub frame: String,
    /// Coefficient of friction that the controller may use.
    pub friction: f64,
    /// Shape of the foot.
    pub shape: FootShape,
}

/// Shape of a foot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FootShape {
    /// Ball around the origin of the frame. It touches the ground in a point, and can turn about it.
    Point {
        /// Radius of the ball (m).
        radius: f64,
    },
    /// Rectangle in the plane z = 0 of the frame.
    Sole {
        /// Side lengths of the rectangle along the axes x and y of the frame (m).
        size: [f64; 2],
    },
}

impl Foot {
    /// Returns a foot whose shape is a ball.
    pub fn point(frame: &str, friction: f64, radius: f64) -> Self {
        Self { frame: frame.to_owned(), friction, shape: FootShape::Point { radius } }
    }

    /// Returns a foot whose shape is a rectangle.
    pub fn sole(frame: &str, friction: f64, size: [f64; 2]) -> Self {
        Self { frame: frame.to_owned(), friction, shape: FootShape::Sole { size } }
    }

    /// Returns the height of the frame's origin above the ground, while the foot stands (m).
    pub(crate) fn height(&self) -> f64 {
        match self.shape {
            FootShape::Point { radius } => radius,
            FootShape::Sole { .. } => 0.0,
        }
    }

    /// Returns whether the foot is a sole, which must be level before it lands.
    pub(crate) fn is_sole(&self) -> bool {
        matches!(self.shape, FootShape::Sole { .. })
    }

    /// Checks the numbers of the foot. [`WholeBodyMpc::new`](crate::WholeBodyMpc::new) makes this check too.
    ///
    /// # Errors
    /// [`Error::Foot`] if the friction or a length is not above 0, or not finite. The radius of a ball may be 0.
    pub fn check(&self) -> Result<(), Error> {
        let numbers: &[(&'static str, f64, bool)] = match self.shape {
            FootShape::Point { radius } => &[("radius", radius, radius >= 0.0)],
            FootShape::Sole { size: [x, y] } => &[("length", x, x > 0.0), ("width", y, y > 0.0)],
        };
        for &(name, value, is_valid) in numbers.iter().chain(&[("friction", self.friction, self.friction > 0.0)]) {
            if !(is_valid && value.is_finite()) {
                let what = format!("its {name} is {value}");
                return Err(Error::Foot { foot: self.frame.clone(), what });
            }
        }
        Ok(())
    }

    /// Returns the contact of the foot with the ground. Its damping stops the foot within a knot of `dt` seconds. The
    /// wrench of a sole is along the axes of the sole, because its rectangle turns with the robot.
    pub(crate) fn contact(&self, model: &Model, dt: f64) -> Result<Contact, Error> {
        let what = || format!("the robot has no frame of this name; it has {}", names(model));
        let frame = model.frame(&self.frame).map_err(|_| Error::Foot { foot: self.frame.clone(), what: what() })?;
        let (constraint, reference) = match self.shape {
            FootShape::Point { .. } => (ContactConstraint::point(frame), ReferenceFrame::LocalWorldAligned),
            FootShape::Sole { .. } => (ContactConstraint::rigid(frame), ReferenceFrame::Local),
        };
        Ok(Contact::new(&self.frame, ContactConstraint { kd: 1.0 / dt, reference, ..constraint }))
    }

    /// Returns the limits of the force of the foot. `least` is the smallest normal force (N), and `used` is the
    /// fraction of a sole in which the centre of pressure may be.
    pub(crate) fn grip(&self, least: f64, used: f64) -> Limit {
        let contact = self.frame.clone();
        let friction = FrictionCone { least, facets: FACETS, inner: true, ..FrictionCone::new(self.friction) };
        let (residual, (lower, upper)) = match self.shape {
            FootShape::Point { .. } => {
                let bounds = friction.bounds();
                (Residual::FrictionCone { contact, cone: friction }, bounds)
            }
            FootShape::Sole { size } => {
                let cone = WrenchCone { friction, size: size.map(|side| used * side) };
                let bounds = cone.bounds();
                (Residual::WrenchCone { contact, cone }, bounds)
            }
        };
        Limit::new(&self.frame, residual, lower, upper)
    }
}

/// Most frames that an error message lists.
const LISTED: usize = 30;

/// Returns the names of the robot's frames for an error message.
fn names(model: &Model) -> String {
    let names: Vec<_> = model.frames().iter().map(|frame| format!("`{}`", frame.name)).collect();
    match names.len() {
        0..=LISTED => names.join(", "),
        n => format!("{} and {} others", names[n - LISTED..].join(", "), n - LISTED),
    }
}
