//! Feet and gaits of walking robots as Python classes.

use crate::exceptions::mpc_error;
use condyle::mpc as rust;
use pyo3::prelude::*;
use rust::{Gait as RustGait, Pattern};

/// A foot of a walking robot: `Foot.point` or `Foot.sole`.
///
/// >>> condyle.mpc.Foot.point("LF_foot", friction=0.6, radius=0.02).frame
/// 'LF_foot'
#[pyclass(frozen, module = "condyle.mpc")]
pub(crate) struct Foot(pub(super) rust::Foot);

#[pymethods]
impl Foot {
    /// Returns a foot that is a ball around the origin of a frame.
    ///
    /// frame: the name of the frame; friction: the coefficient of friction that the controller may use; radius: the
    /// radius of the ball (m).
    ///
    /// Raises `ControllerError` for a number outside its range.
    #[staticmethod]
    #[pyo3(signature = (frame, friction, radius))]
    fn point(frame: &str, friction: f64, radius: f64) -> PyResult<Self> {
        Self::checked(rust::Foot::point(frame, friction, radius))
    }

    /// Returns a foot that is a rectangle in the plane z = 0 of a frame.
    ///
    /// frame: the name of the frame, whose origin is in the middle of the sole; friction: the coefficient of friction
    /// that the controller may use; size: the side lengths along the axes x and y of the frame (m).
    ///
    /// Raises `ControllerError` for a number outside its range.
    #[staticmethod]
    #[pyo3(signature = (frame, friction, size))]
    fn sole(frame: &str, friction: f64, size: [f64; 2]) -> PyResult<Self> {
        Self::checked(rust::Foot::sole(frame, friction, size))
    }

    /// The name of the frame.
    #[getter]
    fn frame(&self) -> &str {
        &self.0.frame
    }

    fn __repr__(&self) -> String {
        let rust::Foot { frame, friction, shape } = &self.0;
        match shape {
            rust::FootShape::Point { radius } => format!("Foot.point('{frame}', {friction:?}, {radius:?})"),
            rust::FootShape::Sole { size: [x, y] } => format!("Foot.sole('{frame}', {friction:?}, ({x:?}, {y:?}))"),
        }
    }
}

impl Foot {
    fn checked(foot: rust::Foot) -> PyResult<Self> {
        foot.check().map_err(mpc_error)?;
        Ok(Self(foot))
    }
}

/// A gait of a walking robot: which feet are in the air, and when. The swings repeat after a period.
///
/// The positions of the feet in the stand tell which feet are in front and which are on the left.
///
/// >>> condyle.mpc.Gait.trot(swing=0.24, double=0.04)
/// Gait.trot(swing=0.24, double=0.04)
#[pyclass(frozen, module = "condyle.mpc")]
pub(crate) struct Gait(pub(super) RustGait);

#[pymethods]
impl Gait {
    /// Returns the gait in which all feet stay on the ground.
    #[staticmethod]
    fn stand() -> Self {
        Self(RustGait::Stand)
    }

    /// Returns the gait in which diagonal pairs of four feet swing in turn.
    ///
    /// swing: the duration of a swing (s); double: the time between two swings, with all feet on the ground (s).
    #[staticmethod]
    #[pyo3(signature = (swing=0.24, double=0.04))]
    fn trot(swing: f64, double: f64) -> Self {
        Self(RustGait::in_turn(Pattern::Trot, swing, double))
    }

    /// Returns the gait in which the left and the right pair of four feet swing in turn; for the arguments see `trot`.
    #[staticmethod]
    #[pyo3(signature = (swing=0.2, double=0.06))]
    fn pace(swing: f64, double: f64) -> Self {
        Self(RustGait::in_turn(Pattern::Pace, swing, double))
    }

    /// Returns the gait in which the front and the rear pair of four feet swing in turn; for the arguments see `trot`.
    #[staticmethod]
    #[pyo3(signature = (swing=0.2, double=0.06))]
    fn bound(swing: f64, double: f64) -> Self {
        Self(RustGait::in_turn(Pattern::Bound, swing, double))
    }

    /// Returns the gait in which four feet swing one by one: rear left, front left, rear right, front right; for
    /// the arguments see `trot`.
    #[staticmethod]
    #[pyo3(signature = (swing=0.24, double=0.04))]
    fn walk(swing: f64, double: f64) -> Self {
        Self(RustGait::in_turn(Pattern::Walk, swing, double))
    }

    /// Returns the gait in which the feet swing one by one from left to right, as a biped steps; for the arguments see
    /// `trot`.
    #[staticmethod]
    #[pyo3(signature = (swing=0.36, double=0.08))]
    fn step(swing: f64, double: f64) -> Self {
        Self(RustGait::in_turn(Pattern::Step, swing, double))
    }

    /// Returns a gait from a table.
    ///
    /// period: the time after which the swings repeat (s); swings: tuples (frame, begin, end) with the name of a foot's
    /// frame, and the times at which the foot leaves the ground and lands (s), both within the period.
    #[staticmethod]
    fn table(period: f64, swings: Vec<(String, f64, f64)>) -> Self {
        Self(RustGait::Table { period, swings })
    }

    fn __repr__(&self) -> String {
        match &self.0 {
            RustGait::Stand => "Gait.stand()".to_owned(),
            RustGait::InTurn { pattern, swing, double } => {
                let name = format!("{pattern:?}").to_lowercase();
                format!("Gait.{name}(swing={swing:?}, double={double:?})")
            }
            RustGait::Table { period, swings } => format!("Gait.table({period:?}, {} swings)", swings.len()),
        }
    }
}
