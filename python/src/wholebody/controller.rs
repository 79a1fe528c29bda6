//! The whole-body controller as a Python class.

use super::contacts::FrictionContact;
use super::plan::Plan;
use super::tasks::Task;
use super::{references, settings};
use crate::arrays::{self, Give, class, vector};
use crate::exceptions::{ControllerError, controller_error};
use crate::ik::place;
use crate::model::Model;
use crate::optimal::lock;
use condyle::wholebody as rust;
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rust::{CommandSource, Status};
use std::sync::Mutex;

/// A whole-body controller. At each tick the controller solves a cone program for the accelerations, contact forces and
/// joint efforts that fulfil the tasks best.
///
///     x = (q̈, f)
///     minimise     ½ Σ w ‖J q̈ + J̇ v − a*‖²  +  ½ w_a ‖q̈‖²  +  ½ w_f ‖f − f_ref‖²
///     subject to   Sᵤ (M q̈ + h − Jᵀ f) = 0            no motor acts on a free-flyer
///                  J_c q̈ + J̇_c v = k (X_ref ⊖ X) − d v   contacts are held (k = d = 0 unless set)
///                  ‖(f₁, f₂)‖ ≤ μ f_n                  friction, a second-order cone for each force
///                  f_n p ∈ f_n · polygon, |τ_n| ≤ γ f_n   centre of pressure and yaw moment of a sole's wrench
///                  f_min ≤ Σ f_n ≤ f_max               for each contact, ramped while it fades in or out
///                  −τ̄ ≤ τ ≤ τ̄  with  τ = S (M q̈ + h − Jᵀ f)
///                  bounds on q̈                         from limits of position and velocity: `JointLimits`
///                  ∂d/∂q q̈ ≥ …                         for the distance d of each pair: `DistanceLimits`
///
/// J and J_c are the Jacobians of tasks and contacts; in Jᵀ f, J belongs to the contact forces. a* is the desired
/// acceleration of a task, and w are weights. f are the contact forces: f_n is the normal component of a force, f₁ and
/// f₂ the tangential components. p is the centre of pressure, τ_n the moment about the normal, and X the pose of a
/// contact. Sᵤ selects the coordinates without motors, S the coordinates with motors. Positions, velocities and
/// accelerations of tasks and contacts are in the world's axes; accelerations are classical. All memory is allocated in
/// the constructor.
///
/// model: the robot.
/// contacts: a list of `FrictionContact`, each of a different frame; empty for a robot in free fall.
/// tasks: a list of `Task`.
/// settings: `Settings`; None for the defaults.
///
/// Raises `ModelError` for an unknown frame. Raises `ControllerError` for a frame with two contacts, for a force task
/// without its contact, for a number outside its range, and for an effort limit of 0 in the model or the settings.
///
/// A controller can be copied and pickled; the copy continues with bit-identical results. With the back end 'clarabel',
/// the copy builds its solvers again, so results are equal only up to the tolerance.
///
/// >>> from condyle.wholebody import FrictionContact, Task, WholeBodyController
/// >>> robot = condyle.robots.quadruped()
/// >>> feet = [FrictionContact.point(f"{leg}_foot", 0.7) for leg in ("LF", "LH", "RF", "RH")]
/// >>> controller = WholeBodyController(robot, feet, [Task.com(), Task.orientation("trunk"), Task.posture()])
/// >>> knees = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2  # inwards
/// >>> q = np.r_[0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0, knees]
/// >>> command = controller.step(q, np.zeros(18), controller.hold(q)).solved()
/// >>> lift = command.forces[:, 2].sum()
/// >>> bool(abs(lift - 9.81 * robot.total_mass) < 0.1)  # the feet carry the weight
/// True
#[pyclass(frozen, module = "condyle.wholebody")]
pub(crate) struct WholeBodyController {
    model: Py<Model>,
    settings: rust::Settings,
    contacts: Vec<rust::FrictionContact>,
    tasks: Vec<rust::Task>,
    inner: Mutex<Inner>,
}

struct Inner {
    controller: rust::WholeBodyController,
    /// Scratch memory for the references of a call.
    references: rust::References,
    q: Vec<f64>,
    v: Vec<f64>,
}

#[pymethods]
impl WholeBodyController {
    #[new]
    #[pyo3(signature = (model, contacts, tasks, settings=None))]
    fn new(
        model: &Bound<'_, Model>,
        contacts: Vec<PyRef<'_, FrictionContact>>,
        tasks: Vec<PyRef<'_, Task>>,
        settings: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let settings = settings.map_or_else(|| Ok(rust::Settings::default()), |given| settings::read(model, given))?;
        let contacts: Vec<_> = contacts.iter().map(|contact| contact.0.clone()).collect();
        let tasks: Vec<_> = tasks.iter().map(|task| task.0.clone()).collect();
        let robot = &model.get().inner;
        let mut controller =
            rust::WholeBodyController::new(robot, &contacts, &tasks, settings.clone()).map_err(controller_error)?;
        let q = condyle::neutral(robot);
        let references = controller.hold(&q).map_err(controller_error)?;
        let inner = Mutex::new(Inner { controller, references, q, v: vec![0.0; robot.nv()] });
        Ok(Self { model: model.clone().unbind(), settings, contacts, tasks, inner })
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.model)
    }

    /// All settings of the controller: `Settings`.
    #[getter]
    fn settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        settings::give(py, &self.settings)
    }

    /// Returns the `References` that keep the robot at rest at a position: all tasks keep their current values, all
    /// contacts touch and are held, and the contacts share the weight equally.
    ///
    /// q: position, nq numbers.
    ///
    /// Raises `ModelError` for numbers that are not finite, and for quaternions and pairs (cos, sin) whose length is
    /// not 1.
    fn hold<'py>(&self, py: Python<'py>, q: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut inner = lock("controller", &self.inner)?;
        let q = vector("q", q, inner.q.len())?;
        references::give(py, &self.model.get().inner, &inner.controller.hold(&q).map_err(controller_error)?)
    }

    /// Sets references to the state of a plan at a time: the joints, and the resulting centre of mass, momentum and
    /// frames. Contacts get the plan's activation, and are held at the poses of the plan. The contacts share the force
    /// that the plan's acceleration c̈ of the centre of mass requires.
    ///
    /// plan: a `Plan` of the same robot with the same number of contacts.
    /// t: the time (s); before the first knot, the plan rests at the first knot; after the last knot, at the last knot.
    /// references: `References` of this controller, which are changed.
    fn track(&self, plan: &Bound<'_, Plan>, t: f64, references: &Bound<'_, PyAny>) -> PyResult<()> {
        let plan = plan.get();
        plan.made_for.check("plan", self.model.get())?;
        if plan.contacts != self.contacts.len() {
            let (expected, found) = (self.contacts.len(), plan.contacts);
            return Err(PyValueError::new_err(format!("plan: expected {expected} contacts, found {found}")));
        }
        let mut inner = lock("controller", &self.inner)?;
        let Inner { controller, references: numbers, .. } = &mut *inner;
        references::read(references, numbers)?;
        controller.track(&plan.inner, t, numbers);
        references::write(numbers, references)
    }

    /// Sets the placement of the geometry with a name in the pairs of `DistanceLimits`, for example of an obstacle
    /// that moves.
    ///
    /// name: the name of the `Geometry`.
    /// placement: the pose (4, 4) in the world, or in the frame of the geometry.
    /// velocity: the velocity of an obstacle in the world, [linear, angular], six numbers along the world's axes: the
    ///     velocity of the origin of its placement (m/s), and its angular velocity (rad/s); None for an obstacle at
    ///     rest.
    ///
    /// Raises `ValueError` if no geometry has this name, or if a number is not finite.
    #[pyo3(signature = (name, placement, velocity=None))]
    fn place(&self, name: &str, placement: &Bound<'_, PyAny>, velocity: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        match place(lock("controller", &self.inner)?.controller.pairs_mut(), name, placement, velocity)? {
            true => Ok(()),
            false => Err(PyValueError::new_err(format!("name: no geometry is named '{name}'"))),
        }
    }

    /// Computes the `Command` at a state. The method always returns a command. If no solution is found, this is a safe
    /// command whose status shows the cause. The status is 'not_finite' for a number that is not finite. The status is
    /// 'invalid_state' for an invalid quaternion, pair (cos, sin) or rotation of a reference; then `reason` names the
    /// joint or the frame. Other Python threads can run meanwhile.
    ///
    /// q: position, nq numbers; v: velocity, nv numbers.
    /// references: `References` of this controller.
    fn step<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        references: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut inner = lock("controller", &self.inner)?;
        let Inner { controller, references: numbers, q: position, v: velocity } = &mut *inner;
        let (q, v) = (vector("q", q, position.len())?, vector("v", v, velocity.len())?);
        position.copy_from_slice(&q);
        velocity.copy_from_slice(&v);
        references::read(references, numbers)?;
        py.detach(|| _ = controller.step(position, velocity, numbers));
        give(py, controller)
    }

    /// Returns the distance of the last step from the optimum of its first-priority program, as `KktResiduals`: the
    /// errors of the Karush–Kuhn–Tucker conditions, below 1e-5 at the default tolerance. Pass the state and references
    /// of the last step again. Use this method only in tests, because the method assembles the program anew.
    ///
    /// q: position, nq numbers; v: velocity, nv numbers.
    /// references: `References` of this controller.
    fn kkt_residuals<'py>(
        &self,
        py: Python<'py>,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        references: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut inner = lock("controller", &self.inner)?;
        let Inner { controller, references: numbers, q: position, v: velocity } = &mut *inner;
        let (q, v) = (vector("q", q, position.len())?, vector("v", v, velocity.len())?);
        position.copy_from_slice(&q);
        velocity.copy_from_slice(&v);
        references::read(references, numbers)?;
        let errors = py.detach(|| controller.kkt_residuals(position, velocity, numbers));
        let rust::KktResiduals { stationarity, primal, dual, complementarity } = errors;
        class!(py, "condyle._wholebody", "KktResiduals")?.call1((stationarity, primal, dual, complementarity))
    }

    /// The last `Command`; zeros before the first step.
    #[getter]
    fn command<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give(py, &lock("controller", &self.inner)?.controller)
    }

    /// Returns the function and the arguments from which `pickle` makes an equal controller. The arguments include the
    /// numbers that the controller keeps from one tick to the next.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let contacts: Vec<_> = self.contacts.iter().cloned().map(FrictionContact).collect();
        let tasks: Vec<_> = self.tasks.iter().cloned().map(Task).collect();
        let numbers = lock("controller", &self.inner)?.controller.carried().give(py, None)?;
        let make = py.import("condyle._condyle")?.getattr("_controller_from_numbers")?;
        let arguments = (self.model.clone_ref(py), contacts, tasks, settings::give(py, &self.settings)?, numbers);
        Ok((make, arguments.into_pyobject(py)?.into_any()))
    }

    fn __repr__(&self) -> String {
        let name = self.model.get().inner.name();
        format!("<condyle.wholebody.WholeBodyController of '{name}', {} contacts>", self.contacts.len())
    }
}

/// Creates the controller of a pickle. The pickle contains the model, whose own pickle checks the version.
#[pyfunction]
#[pyo3(name = "_controller_from_numbers")]
pub(crate) fn controller_from_numbers(
    model: &Bound<'_, Model>,
    contacts: Vec<PyRef<'_, FrictionContact>>,
    tasks: Vec<PyRef<'_, Task>>,
    settings: &Bound<'_, PyAny>,
    numbers: &Bound<'_, PyAny>,
) -> PyResult<WholeBodyController> {
    let made = WholeBodyController::new(model, contacts, tasks, Some(settings))?;
    let numbers = arrays::numbers("numbers", numbers)?;
    if !lock("controller", &made.inner)?.controller.restore(&numbers) {
        return Err(ControllerError::new_err("the pickle is damaged: its numbers are not those of such a controller"));
    }
    Ok(made)
}

/// Converts the command of a controller to a Python object.
fn give<'py>(py: Python<'py>, controller: &rust::WholeBodyController) -> PyResult<Bound<'py, PyAny>> {
    let command = controller.command();
    let status = match command.status {
        Status::Solved => "solved",
        Status::Infeasible => "infeasible",
        Status::IterationLimit => "iteration_limit",
        Status::TimeLimit => "time_limit",
        Status::NotFinite { .. } => "not_finite",
        Status::InvalidState(_) => "invalid_state",
        _ => "numerical_error",
    };
    let source = match command.source {
        CommandSource::Solution => "solution",
        CommandSource::LastSolution => "last_solution",
        _ => "gravity_compensation",
    };
    let forces: Vec<[f64; 6]> = command.forces.iter().map(|force| force.to_array()).collect();
    let members = [
        status.into_pyobject(py)?.into_any(),
        controller.reason().into_pyobject(py)?.into_any(),
        source.into_pyobject(py)?.into_any(),
        command.tau.give(py, None)?,
        command.a.give(py, None)?,
        forces.give(py, None)?,
        command.com_acceleration.give(py, None)?,
        command.violation.give(py, None)?,
        command.iterations.into_pyobject(py)?.into_any(),
        command.reduced_accuracy.into_pyobject(py)?.to_owned().into_any(),
        command.limits_relaxed.into_pyobject(py)?.to_owned().into_any(),
    ];
    class!(py, "condyle._wholebody", "Command")?.call1(PyTuple::new(py, members)?)
}
