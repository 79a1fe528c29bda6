//! What a whole-body controller is to do.

use super::settings::give_gains;
use crate::arrays::{Give, numbers};
use crate::exceptions::wrong_word;
use condyle::wholebody as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rust::{Axes, TaskKind};

/// A quantity to be controlled: ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖² with a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v).
///
/// What it aims at is in the `References`. Tasks of priority 0 come first; those of priority 1 decide only what they leave
/// open, and so on. Within a priority the weights decide, and only their ratios matter. Numbers are checked when a
/// `WholeBodyController` is made.
///
/// Common arguments:
/// weight: w, at least 0; None is the default of the task.
/// gains: `Gains`, k (1/s²) and d (1/s); None is `Gains.critical(100.0)`.
/// mask: which of its numbers count, as many as it has; None is all.
/// axes: along whose axes these numbers are: 'world'; 'local', the frame's own (of tasks that move no frame, the world's);
///     or ('frame', name), those of another frame.
/// priority: 0 for the first; at most 2.
///
/// >>> from condyle.wholebody import Task
/// >>> Task.orientation("trunk", mask=[True, True, False])  # level, whatever its heading
/// <condyle.wholebody.Task orientation 'trunk', weight 10>
#[pyclass(frozen, eq, module = "condyle.wholebody")]
#[derive(Clone, PartialEq)]
pub(crate) struct Task(pub(super) rust::Task);

impl Task {
    /// A task with what is given in place of its defaults; `size` is that of the mask.
    fn with(
        mut task: rust::Task,
        size: usize,
        weight: Option<f64>,
        gains: Option<&Bound<'_, PyAny>>,
        mask: Option<Vec<bool>>,
        axes: Option<&Bound<'_, PyAny>>,
        priority: usize,
    ) -> PyResult<Self> {
        task.weight = weight.unwrap_or(task.weight);
        if let Some(given) = gains {
            task.gains = super::settings::gains("gains", given)?;
        }
        if let Some(mask) = mask {
            if mask.len() != size {
                return Err(PyValueError::new_err(format!("mask: expected {size} entries, found {}", mask.len())));
            }
            task.mask[..size].copy_from_slice(&mask);
        }
        if let Some(axes) = axes {
            task.axes = self::axes(axes)?;
        }
        task.priority = priority;
        Ok(Self(task))
    }

    /// The name of the frame that it moves, or whose contact's force it sets.
    fn its_frame(&self) -> Option<&str> {
        match &self.0.kind {
            TaskKind::Pose(f)
            | TaskKind::Position(f)
            | TaskKind::Orientation(f)
            | TaskKind::Velocity(f)
            | TaskKind::ContactForce(f) => Some(f),
            _ => None,
        }
    }

    /// How many entries its mask has.
    fn size(&self) -> usize {
        match self.0.kind {
            TaskKind::Posture => 0,
            TaskKind::Pose(_) | TaskKind::Velocity(_) | TaskKind::ContactForce(_) => 6,
            _ => 3,
        }
    }
}

fn axes(given: &Bound<'_, PyAny>) -> PyResult<Axes> {
    let expected = "'world', 'local' or ('frame', name)";
    if let Ok((word, frame)) = given.extract::<(String, String)>()
        && word == "frame"
    {
        return Ok(Axes::Frame(frame));
    }
    match given.extract::<String>().as_deref() {
        Ok("world") => Ok(Axes::World),
        Ok("local") => Ok(Axes::Local),
        Ok(other) => Err(wrong_word("axes", expected, other)),
        Err(_) => Err(PyValueError::new_err(format!("axes: expected {expected}, found {}", given.repr()?))),
    }
}

/// The methods of tasks: the constructors of those whose numbers have a mask and axes, some of a frame; and all others.
macro_rules! methods {
    ($($(#[$doc:meta])* $name:ident($($frame:ident)?): $size:literal;)* { $($other:tt)* }) => {
        #[pymethods]
        impl Task {
            $(
                $(#[$doc])*
                #[staticmethod]
                #[pyo3(signature = ($($frame,)? weight=None, gains=None, mask=None, axes=None, priority=0))]
                fn $name(
                    $($frame: &str,)?
                    weight: Option<f64>,
                    gains: Option<&Bound<'_, PyAny>>,
                    mask: Option<Vec<bool>>,
                    axes: Option<&Bound<'_, PyAny>>,
                    priority: usize,
                ) -> PyResult<Self> {
                    Self::with(rust::Task::$name($($frame)?), $size, weight, gains, mask, axes, priority)
                }
            )*

            $($other)*
        }
    };
}

methods! {
/// The centre of mass, c̈: 3 numbers; weight 10.
com(): 3;
/// A frame's origin and rotation, (p̈, ω̇): 6 numbers, linear first; weight 10.
pose(frame): 6;
/// A frame's origin, p̈: 3 numbers; weight 10.
position(frame): 3;
/// A frame's rotation, ω̇: 3 numbers; weight 10.
orientation(frame): 3;
/// The velocity of a frame's origin and rotation, whatever its pose (only the gain d acts): 6 numbers, linear first;
/// weight 10.
velocity(frame): 6;
/// The rate of the angular momentum about the centre of mass (only the gain d acts): 3 numbers; weight 0.1.
angular_momentum(): 3;
{
    /// The actuated joints, q̈; weight 0.1.
    ///
    /// joints: factors of the weight, one for each coordinate, nv numbers; None is all 1.
    #[staticmethod]
    #[pyo3(signature = (weight=None, gains=None, joints=None, priority=0))]
    fn posture(
        weight: Option<f64>,
        gains: Option<&Bound<'_, PyAny>>,
        joints: Option<&Bound<'_, PyAny>>,
        priority: usize,
    ) -> PyResult<Self> {
        let joints = joints.map_or_else(|| Ok(Vec::new()), |joints| numbers("joints", joints))?;
        Self::with(rust::Task { joints, ..rust::Task::posture() }, 0, weight, gains, None, None, priority)
    }

    /// The force of the contact of this frame: 6 numbers, force and moment at the contact's centre along its axes (t₁, t₂,
    /// n), of which a point has 3; weight 1e-3. It has no gains, and does not act while the contact is off.
    #[staticmethod]
    #[pyo3(signature = (frame, weight=None, mask=None, priority=0))]
    fn contact_force(frame: &str, weight: Option<f64>, mask: Option<Vec<bool>>, priority: usize) -> PyResult<Self> {
        Self::with(rust::Task::contact_force(frame), 6, weight, None, mask, None, priority)
    }

    /// The quantity: the name of what made it.
    #[getter]
    fn kind(&self) -> &'static str {
        match self.0.kind {
            TaskKind::Com => "com",
            TaskKind::Pose(_) => "pose",
            TaskKind::Position(_) => "position",
            TaskKind::Orientation(_) => "orientation",
            TaskKind::Velocity(_) => "velocity",
            TaskKind::Posture => "posture",
            TaskKind::AngularMomentum => "angular_momentum",
            TaskKind::ContactForce(_) => "contact_force",
            _ => "other",
        }
    }

    /// The name of its frame; None if it has none.
    #[getter]
    fn frame(&self) -> Option<&str> {
        self.its_frame()
    }

    /// w.
    #[getter]
    fn weight(&self) -> f64 {
        self.0.weight
    }

    /// k and d, `Gains`.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_gains(py, self.0.gains)
    }

    /// Which of its numbers count.
    #[getter]
    fn mask(&self) -> Vec<bool> {
        self.0.mask[..self.size()].to_vec()
    }

    /// Along whose axes its numbers are: 'world', 'local' or ('frame', name).
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match &self.0.axes {
            Axes::Local => "local".into_pyobject(py)?.into_any(),
            Axes::Frame(name) => ("frame", name).into_pyobject(py)?.into_any(),
            _ => "world".into_pyobject(py)?.into_any(),
        })
    }

    /// Its priority: 0 for the first.
    #[getter]
    fn priority(&self) -> usize {
        self.0.priority
    }

    /// Factors of the posture's weight, nv numbers; empty for all 1.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.joints.give(py, None)
    }

    /// The parts of a pickle: what makes one like it.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let rust::Task { weight, priority, joints, .. } = &this.0;
        let (gains, mask, axes) = (this.gains(py)?, this.mask(), this.axes(py)?);
        let arguments = match (&this.0.kind, this.its_frame()) {
            (TaskKind::Posture, _) => {
                let joints = (!joints.is_empty()).then(|| joints.give(py, None)).transpose()?;
                (weight, gains, joints, priority).into_pyobject(py)?.into_any()
            }
            (TaskKind::ContactForce(frame), _) => (frame, weight, mask, priority).into_pyobject(py)?.into_any(),
            (_, Some(frame)) => (frame, weight, gains, mask, axes, priority).into_pyobject(py)?.into_any(),
            (_, None) => (weight, gains, mask, axes, priority).into_pyobject(py)?.into_any(),
        };
        Ok((slf.get_type().getattr(this.kind())?, arguments))
    }

    fn __repr__(&self) -> String {
        let frame = self.its_frame().map_or(String::new(), |frame| format!(" '{frame}'"));
        format!("<condyle.wholebody.Task {}{frame}, weight {}>", self.kind(), self.0.weight)
    }
}
}
