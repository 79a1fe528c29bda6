//! Tasks of a whole-body controller.

use super::settings::give_gains;
use crate::arrays::{Give, numbers};
use crate::exceptions::wrong_word;
use condyle::wholebody as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rust::{Axes, TaskKind};

/// A quantity to be controlled: ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖² with a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v), where
/// J is the Jacobian of the quantity x.
///
/// The `References` contain the target of the task. Tasks of priority 0 come first. Tasks of priority 1 only use the
/// freedom that tasks of priority 0 leave, and so on. Within a priority, only the ratios of the weights matter. The
/// constructor of `WholeBodyController` checks the numbers.
///
/// Common arguments: weight: w, at least 0; None is the default of the task. gains: `Gains`, k (1/s²) and d (1/s); None
/// is `Gains.critical(100.0)`. mask: for each number of the task, whether the number is controlled; None controls all
/// numbers. axes: the axes of these numbers: 'world'; 'local', the axes of the task's frame (for tasks without a frame,
/// of the world); or ('frame', name), the axes of another frame.
/// priority: 0 is the first priority; at most 2.
///
/// >>> from condyle.wholebody import Task
/// >>> Task.orientation("trunk", mask=[True, True, False])  # level, whatever its heading
/// <condyle.wholebody.Task orientation 'trunk', weight 10>
#[pyclass(frozen, eq, module = "condyle.wholebody")]
#[derive(Clone, PartialEq)]
pub(crate) struct Task(pub(super) rust::Task);

impl Task {
    /// Replaces the defaults of a task by the given arguments; `size` is the length of the mask.
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

    /// Returns the name of the frame that the task moves, or of the frame whose contact force the task controls.
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

    /// Returns the length of the mask.
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

/// Defines the methods of tasks: the constructors of tasks with a mask and axes, for tasks with and without a frame,
/// and all other methods.
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
/// Returns a task for the centre of mass, c̈: 3 numbers; weight 10.
com(): 3;
/// Returns a task for a frame's origin and rotation, (p̈, ω̇): 6 numbers, linear first; weight 10.
pose(frame): 6;
/// Returns a task for a frame's origin, p̈: 3 numbers; weight 10.
position(frame): 3;
/// Returns a task for a frame's rotation, ω̇: 3 numbers; weight 10.
orientation(frame): 3;
/// Returns a task for the velocity of a frame's origin and rotation: 6 numbers, linear first; weight 10. The pose has
/// no effect: only the gain d is used.
velocity(frame): 6;
/// Returns a task for the rate of the angular momentum about the centre of mass: 3 numbers; weight 0.1. Only the gain d
/// is used.
angular_momentum(): 3;
{
    /// Returns a task for the actuated joints, q̈; weight 0.1.
    ///
    /// joints: factors of the weight, one for each coordinate, nv numbers; None is 1 for all.
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

    /// Returns a task for the force of this frame's contact; weight 1e-3. The task has 6 numbers: force and moment at
    /// the contact's centre, along the contact's axes (t₁, t₂, n); for a point contact, only the 3 numbers of the
    /// force. The task has no gains, and does not act while the contact is off.
    #[staticmethod]
    #[pyo3(signature = (frame, weight=None, mask=None, priority=0))]
    fn contact_force(frame: &str, weight: Option<f64>, mask: Option<Vec<bool>>, priority: usize) -> PyResult<Self> {
        Self::with(rust::Task::contact_force(frame), 6, weight, None, mask, None, priority)
    }

    /// The controlled quantity, as the name of the constructor that made the task.
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

    /// The name of the task's frame; None for a task without a frame.
    #[getter]
    fn frame(&self) -> Option<&str> {
        self.its_frame()
    }

    /// The weight w of the task.
    #[getter]
    fn weight(&self) -> f64 {
        self.0.weight
    }

    /// The gains k and d of the task, as `Gains`.
    #[getter]
    fn gains<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_gains(py, self.0.gains)
    }

    /// The mask: for each number of the task, whether the number is controlled.
    #[getter]
    fn mask(&self) -> Vec<bool> {
        self.0.mask[..self.size()].to_vec()
    }

    /// The axes of the task's numbers: 'world', 'local' or ('frame', name).
    #[getter]
    fn axes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(match &self.0.axes {
            Axes::Local => "local".into_pyobject(py)?.into_any(),
            Axes::Frame(name) => ("frame", name).into_pyobject(py)?.into_any(),
            _ => "world".into_pyobject(py)?.into_any(),
        })
    }

    /// The priority of the task; 0 is the first.
    #[getter]
    fn priority(&self) -> usize {
        self.0.priority
    }

    /// Factors of the weight for the coordinates of a posture task, nv numbers; empty if all factors are 1.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.joints.give(py, None)
    }

    /// Returns the constructor and the arguments from which `pickle` makes an equal task.
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
