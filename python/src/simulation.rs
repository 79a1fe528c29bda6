//! Forward simulation of robots in Python: the module `condyle.simulation`.

use crate::arrays::{Give, class, found_type, matrix, output, three};
use crate::exceptions::{exception, wrong_word};
use crate::functions::{Argument, Forces, Position, Tangent, positive_speed, regular};
use crate::model::{Model, frame_index, members_of};
use crate::signals::{self, Signals};
use condyle::simulation as rust;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rust::{Ground, Integrator, Settings, State, Status};
use std::sync::Arc;

/// A simulation of a robot: its state, and the scratch memory to advance it.
///
/// A motion is q(t) = q₀ ⊕ ξ(t), with a tangent vector ξ(t). The equations of motion are q̇ = v, with the velocity v in
/// the body's frame, and v̇ = aba(q, v, τ). τ and the external forces are constant during a step.
///
/// model: the robot, which starts at rest at `neutral`, at time 0.
/// integrator: 'semi_implicit_euler', order 1, suitable for damped robots and short horizons; 'runge_kutta_4', order 4,
///     whose energy drifts by O(h⁴) per second; 'variational', order 2, symplectic: the energy does not drift, and
///     momentum is conserved up to rounding.
/// dt: h, the length of a step (s), above 0.
/// passive: the smoothing ε (rad/s, m/s) of `passive_torque`, which is then added to τ: damping, friction, springs and
///     gravity compensation. None leaves the passive torque out.
/// tolerance: for 'variational', Newton's method ends when the imbalance of the momenta is at most this fraction of the
///     sum of the momenta.
/// max_iterations: the maximum number of iterations of Newton's method.
/// ground: a `Ground` on which the robot stands, slides and lands; None for no ground. Requires 'semi_implicit_euler'.
///
/// A simulation can be copied and pickled; the copy continues with bit-identical results.
///
/// Raises `ModelError` if M is singular or the ground is invalid, and `ValueError` if dt is not positive and finite, or
/// the tolerance is negative.
///
/// >>> from condyle.simulation import Simulation
/// >>> quadruped = condyle.robots.quadruped()
/// >>> simulation = Simulation(quadruped, dt=1e-3)
/// >>> def damper(now):
/// ...     now.tau[8] = -0.5 * now.v[8]
/// >>> simulation.run(100, damper)
/// 'done'
/// >>> bool(abs(simulation.q[2] + 0.5 * 9.81 * 0.1**2) < 2e-3)  # it has fallen ½ g t²
/// True
#[pyclass(module = "condyle.simulation")]
pub(crate) struct Simulation {
    inner: rust::Simulation<f64>,
    model: Py<Model>,
}

fn word(status: Status) -> &'static str {
    match status {
        Status::Done => "done",
        Status::NotConverged { .. } => "not_converged",
        Status::ContactsNotConverged { .. } => "contacts_not_converged",
        _ => "not_finite",
    }
}

/// Returns the word for an integrator.
fn name(integrator: Integrator) -> &'static str {
    match integrator {
        Integrator::SemiImplicitEuler => "semi_implicit_euler",
        Integrator::RungeKutta4 => "runge_kutta_4",
        Integrator::Variational => "variational",
        other => unreachable!("{other:?}: an integrator without a word for it"),
    }
}

/// Converts a `Ground` of `condyle._types` to the library's type.
fn read_ground(model: &condyle::Model, given: &Bound<'_, PyAny>) -> PyResult<Ground> {
    if !given.is_instance(class!(given.py(), "Ground")?)? {
        return Err(PyTypeError::new_err(format!("ground: expected a `Ground`, found {}", found_type(given))));
    }
    let mut ground = Ground {
        normal: three("ground.normal", &given.getattr("normal")?)?,
        height: given.getattr("height")?.extract()?,
        friction: given.getattr("friction")?.extract()?,
        restitution: given.getattr("restitution")?.extract()?,
        tolerance: given.getattr("tolerance")?.extract()?,
        max_iterations: given.getattr("max_iterations")?.extract()?,
        ..Ground::default()
    };
    let expected = "frames, or pairs of a frame and corners";
    for point in members_of("ground.points", expected, &given.getattr("points")?)? {
        ground = match point.cast::<PyTuple>() {
            Err(_) => ground.with_sole(frame_index(model, &point)?, &[condyle::Vec3::zero()]),
            Ok(pair) if pair.len() == 2 => {
                let frame = frame_index(model, &pair.get_item(0)?)?;
                let corners = pair.get_item(1)?;
                let rows = matrix("ground.points: corners", &corners, [corners.len()?, 3])?;
                let corners: Vec<_> = rows.chunks_exact(3).map(|p| condyle::Vec3::new(p[0], p[1], p[2])).collect();
                ground.with_sole(frame, &corners)
            }
            Ok(other) => {
                let found = other.len();
                return Err(PyTypeError::new_err(format!(
                    "ground.points: expected a list of {expected}, found a tuple of {found}"
                )));
            }
        };
    }
    Ok(ground)
}

/// Converts the library's ground to a `Ground` of `condyle._types`.
fn give_ground<'py>(py: Python<'py>, ground: &Ground) -> PyResult<Bound<'py, PyAny>> {
    let point = |point: &rust::GroundPoint| {
        let corner = output(py, None, &[1, 3], |x| x.copy_from_slice(&point.position.to_array()))?;
        Ok((point.frame, corner))
    };
    let points = ground.points.iter().map(point).collect::<PyResult<Vec<_>>>()?;
    let normal = ground.normal.to_array()[..].give(py, None)?;
    let Ground { height, friction, restitution, tolerance, max_iterations, .. } = *ground;
    class!(py, "Ground")?.call1((points, normal, height, friction, restitution, tolerance, max_iterations))
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (
        model, integrator="semi_implicit_euler", dt=1e-3, passive=None, tolerance=1e-9, max_iterations=20, ground=None
    ))]
    fn new(
        model: &Bound<'_, Model>,
        integrator: &str,
        dt: f64,
        passive: Option<f64>,
        tolerance: f64,
        max_iterations: usize,
        ground: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let integrator = match integrator {
            "semi_implicit_euler" => Integrator::SemiImplicitEuler,
            "runge_kutta_4" => Integrator::RungeKutta4,
            "variational" => Integrator::Variational,
            other => {
                let expected = "'semi_implicit_euler', 'runge_kutta_4' or 'variational'";
                return Err(wrong_word("integrator", expected, other));
            }
        };
        let passive = passive.map(|smoothing| positive_speed("passive", smoothing)).transpose()?;
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(PyValueError::new_err(format!("dt: expected a finite number above 0, found {dt}")));
        }
        if !(tolerance >= 0.0 && tolerance.is_finite()) {
            return Err(PyValueError::new_err(format!(
                "tolerance: expected a finite number of at least 0, found {tolerance}"
            )));
        }
        regular(&model.get().inner)?;
        let settings = Settings { integrator, dt, passive, tolerance, max_iterations };
        let mut inner = rust::Simulation::new(Arc::clone(&model.get().inner), settings);
        if let Some(ground) = ground {
            inner.set_ground(read_ground(&model.get().inner, ground)?).map_err(exception)?;
        }
        Ok(Self { inner, model: model.clone().unbind() })
    }

    /// Returns the robot's name and the time.
    fn __repr__(&self) -> String {
        format!("<condyle.simulation.Simulation of '{}' at {} s>", self.inner.model().name(), self.inner.time())
    }

    /// The position of the robot, nq numbers.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.inner.q().give(py, None)
    }

    /// The velocity of the robot, nv numbers.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.inner.v().give(py, None)
    }

    /// The time since the state was set: the sum of the steps (s).
    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    /// The ground on which the robot stands, as a `Ground` of single points; None without ground.
    #[getter]
    fn ground<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        self.inner.ground().map(|ground| give_ground(py, ground)).transpose()
    }

    /// The contacts between the ground and the points of the robot in the last step, as `GroundContacts`.
    #[getter]
    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let contacts = self.inner.contacts();
        let rows = |of: fn(&rust::GroundContact) -> [f64; 3]| {
            let numbers = contacts.iter().flat_map(of).collect::<Vec<_>>();
            output(py, None, &[contacts.len(), 3], |x| x.copy_from_slice(&numbers))
        };
        let (position, force) = (rows(|c| c.position.to_array())?, rows(|c| c.force.to_array())?);
        let touches: Vec<bool> = contacts.iter().map(|c| c.touches).collect();
        let touches = py.import("numpy")?.call_method1("array", (touches, "bool"))?;
        class!(py, "GroundContacts")?.call1((position, force, touches))
    }

    /// Sets the position q (nq numbers) and the velocity v (nv numbers), and the time to 0.
    ///
    /// Raises `ModelError` if q is not finite or contains a rotation whose length is not 1 (up to 1e-3), `ValueError`
    /// if v is not finite.
    fn set_state(&mut self, q: &Bound<'_, PyAny>, v: &Bound<'_, PyAny>) -> PyResult<()> {
        let model = &self.model.get().inner;
        let (q, v) = (Position::read("q", q, model)?, Tangent::read("v", v, model)?);
        model.check_position(&q).map_err(exception)?;
        if let Some((k, found)) = v.iter().enumerate().find(|(_, x)| !x.is_finite()) {
            return Err(PyValueError::new_err(format!("v: expected finite numbers, found {found} at {k}")));
        }
        self.inner.set_state(&q, &v).map_err(exception)
    }

    /// Makes a step with constant efforts and forces, and returns its status: 'done'; 'not_converged' if Newton's
    /// method did not reach the tolerance (a shorter step helps); 'contacts_not_converged' if the ground's impulses
    /// violate the laws of contact by more than the ground's tolerance; or 'not_finite'. The state advances only for
    /// 'done' and 'contacts_not_converged'.
    ///
    /// tau: nv numbers (N m, N); f_ext: as for `rnea`.
    #[pyo3(signature = (tau, f_ext=None))]
    fn step(&mut self, tau: &Bound<'_, PyAny>, f_ext: Option<&Bound<'_, PyAny>>) -> PyResult<&'static str> {
        let model = &self.model.get().inner;
        let (tau, f_ext) = (Tangent::read("tau", tau, model)?, Forces::read("f_ext", f_ext, model)?);
        Ok(word(self.inner.step(&tau, &f_ext)))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.model)
    }

    /// Returns the class, the constructor's arguments, and the state, from which `pickle` makes an equal simulation.
    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.try_borrow()?);
        let Settings { integrator, dt, passive, tolerance, max_iterations } = this.inner.settings;
        let ground = this.ground(py)?;
        let made = (&this.model, name(integrator), dt, passive, tolerance, max_iterations, ground).into_pyobject(py)?;
        let State { time, q, v, impulses } = this.inner.state();
        Ok((slf.get_type().into_any(), made, (time, q, v, impulses).into_pyobject(py)?.into_any()))
    }

    /// Restores the state that a pickle contains.
    fn __setstate__(&mut self, state: (f64, Vec<f64>, Vec<f64>, Vec<f64>)) -> PyResult<()> {
        let (time, q, v, impulses) = state;
        self.inner.restore(&State { time, q, v, impulses }).map_err(exception)
    }

    /// Makes a number of steps, and calls a control law before each step. If a step fails, ends early and returns the
    /// status of this step. Otherwise returns 'contacts_not_converged' if a step had this status, else 'done'.
    ///
    /// control: a function that takes a `Control` and sets the numbers of `tau` and `f_ext` of this `Control` in place.
    ///     None means zero efforts. Other Python threads can run during the steps if control is None.
    ///
    /// An exception of a signal handler, such as KeyboardInterrupt, ends the run after a step; the state after this
    /// step is kept.
    #[pyo3(signature = (steps, control=None))]
    fn run(slf: &Bound<'_, Self>, steps: usize, control: Option<&Bound<'_, PyAny>>) -> PyResult<&'static str> {
        let py = slf.py();
        let Some(control) = control else {
            let mut this = slf.try_borrow_mut()?;
            let (simulation, mut signals) = (&mut this.inner, Signals::new(signals::LONG));
            let status = py.detach(|| {
                let mut status = Status::Done;
                for _ in 0..steps {
                    status = status.and(simulation.run(1, |_| {}));
                    if !status.is_taken() || signals.go_on().is_break() {
                        break;
                    }
                }
                status
            });
            signals.finish()?;
            return Ok(word(status));
        };
        let class = class!(py, "Control")?;
        let model = slf.try_borrow()?.model.clone_ref(py);
        let (nv, bodies) = (model.get().inner.nv(), model.get().inner.bodies().len());
        let mut status = Status::Done;
        for _ in 0..steps {
            let (tau, f_ext) = (output(py, None, &[nv], |_| ())?, output(py, None, &[bodies, 6], |_| ())?);
            let now = {
                let this = slf.try_borrow()?;
                let s = &this.inner;
                class.call1((s.time(), s.q().give(py, None)?, s.v().give(py, None)?, &tau, &f_ext))?
            };
            if !control.call1((now,))?.is_none() {
                let expected = "expected a function that sets the numbers of `tau` and `f_ext` and returns None";
                return Err(PyTypeError::new_err(format!("control: {expected}")));
            }
            let robot = &model.get().inner;
            let (tau, f_ext) = (Tangent::read("tau", &tau, robot)?, Forces::read("f_ext", Some(&f_ext), robot)?);
            let mut this = slf.try_borrow_mut()?;
            status = status.and(this.inner.step(&tau, &f_ext));
            if !status.is_taken() {
                break;
            }
        }
        Ok(word(status))
    }
}
