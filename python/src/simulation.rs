//! Robots that move by themselves, as Python sees them: the module `condyle.simulation`.

use crate::arrays::{Give, class, output};
use crate::exceptions::{exception, wrong_word};
use crate::functions::{Argument, Forces, Position, Tangent, positive_speed, regular};
use crate::model::Model;
use crate::signals::{self, Signals};
use condyle::simulation as rust;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::{Integrator, Settings, Status};

type Steps<'m> = rust::Simulation<'m, f64>;

self_cell::self_cell!(
    /// A simulation together with its model.
    struct Owned {
        owner: Py<Model>,
        #[covariant]
        dependent: Steps,
    }
);

/// A simulation of a robot: its state, and the memory to move it on.
///
/// Along q(t) = q₀ ⊕ ξ(t) the equations of motion are q̇ = v (in the body's frame) and v̇ = aba(q, v, τ). τ and the
/// external forces stay as they are during a step.
///
/// model: the robot; it stands still at `neutral`, at time 0.
/// integrator: 'semi_implicit_euler', order 1: fit for damped robots and short horizons; 'runge_kutta_4', order 4,
///     whose energy drifts by O(h⁴) per second; 'variational', order 2, symplectic: the energy does not drift, momentum
///     is conserved to rounding.
/// dt: h, the length of a step (s), above 0.
/// passive: the smoothing ε of `passive_torque` (rad/s, m/s), if the joints' damping and friction are to act; None for
///     none of either.
/// tolerance: Newton's method ('variational') ends once the momenta balance to within this part of their sum.
/// max_iterations: it gives up after so many iterations.
///
/// Raises `ModelError` if M is singular, `ValueError` if dt is not above 0 or not finite, or tolerance is negative.
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
pub(crate) struct Simulation(Owned);

fn word(status: Status) -> &'static str {
    match status {
        Status::Done => "done",
        Status::NotConverged { .. } => "not_converged",
        _ => "not_finite",
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (
        model, integrator="semi_implicit_euler", dt=1e-3, passive=None, tolerance=1e-9, max_iterations=20
    ))]
    fn new(
        model: &Bound<'_, Model>,
        integrator: &str,
        dt: f64,
        passive: Option<f64>,
        tolerance: f64,
        max_iterations: usize,
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
        let owned = Owned::new(model.clone().unbind(), |model| rust::Simulation::new(&model.get().inner, settings));
        Ok(Self(owned))
    }

    /// The robot's name and the time.
    fn __repr__(&self) -> String {
        let (name, time) = (self.0.borrow_owner().get().inner.name(), self.0.borrow_dependent().time());
        format!("<condyle.simulation.Simulation of '{name}' at {time} s>")
    }

    /// The position, nq numbers.
    #[getter]
    fn q<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.borrow_dependent().q().give(py, None)
    }

    /// The velocity, nv numbers.
    #[getter]
    fn v<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.0.borrow_dependent().v().give(py, None)
    }

    /// The time since the state was set: the sum of the steps (s).
    #[getter]
    fn time(&self) -> f64 {
        self.0.borrow_dependent().time()
    }

    /// Sets the position q (nq numbers) and the velocity v (nv numbers), and the time to 0.
    ///
    /// Raises `ModelError` if a number of q is not finite or a rotation in it has not the length 1 (up to 1e-3),
    /// `ValueError` if one of v is not finite.
    fn set_state(&mut self, q: &Bound<'_, PyAny>, v: &Bound<'_, PyAny>) -> PyResult<()> {
        let model = &self.0.borrow_owner().get().inner;
        let (q, v) = (Position::read("q", q, model)?, Tangent::read("v", v, model)?);
        model.check_position(&q).map_err(exception)?;
        if let Some((k, found)) = v.iter().enumerate().find(|(_, x)| !x.is_finite()) {
            return Err(PyValueError::new_err(format!("v: expected finite numbers, found {found} at {k}")));
        }
        self.0.with_dependent_mut(|_, simulation| simulation.set_state(&q, &v));
        Ok(())
    }

    /// A step under constant efforts and forces. Returns 'done'; 'not_converged' if Newton's method did not reach the
    /// tolerance (a shorter step helps); or 'not_finite', and then the step was not taken.
    ///
    /// tau: nv numbers (N m, N); f_ext: as for `rnea`.
    #[pyo3(signature = (tau, f_ext=None))]
    fn step(&mut self, tau: &Bound<'_, PyAny>, f_ext: Option<&Bound<'_, PyAny>>) -> PyResult<&'static str> {
        let model = &self.0.borrow_owner().get().inner;
        let (tau, f_ext) = (Tangent::read("tau", tau, model)?, Forces::read("f_ext", f_ext, model)?);
        Ok(word(self.0.with_dependent_mut(|_, simulation| simulation.step(&tau, &f_ext))))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(self.0.borrow_owner())
    }

    /// A number of steps, with a control law that is called before each of them. Returns the status of the last step,
    /// and ends early when a step fails.
    ///
    /// control: a function of a `Control`, which sets the numbers of its `tau` and `f_ext` in place; None for no
    ///     efforts, then other threads run meanwhile.
    ///
    /// What a handler of a signal raises, as KeyboardInterrupt, ends the run after a step, whose state is kept.
    #[pyo3(signature = (steps, control=None))]
    fn run(slf: &Bound<'_, Self>, steps: usize, control: Option<&Bound<'_, PyAny>>) -> PyResult<&'static str> {
        let py = slf.py();
        let Some(control) = control else {
            let mut this = slf.try_borrow_mut()?;
            let (owned, mut signals) = (&mut this.0, Signals::new(signals::LONG));
            let status = py.detach(|| {
                owned.with_dependent_mut(|_, simulation| {
                    let mut status = Status::Done;
                    for _ in 0..steps {
                        status = simulation.run(1, |_| {});
                        if !status.is_done() || signals.go_on().is_break() {
                            break;
                        }
                    }
                    status
                })
            });
            signals.finish()?;
            return Ok(word(status));
        };
        let class = class!(py, "Control")?;
        let model = slf.try_borrow()?.0.borrow_owner().clone_ref(py);
        let (nv, bodies) = (model.get().inner.nv(), model.get().inner.bodies().len());
        let mut status = Status::Done;
        for _ in 0..steps {
            let (tau, f_ext) = (output(py, None, &[nv], |_| ())?, output(py, None, &[bodies, 6], |_| ())?);
            let now = {
                let this = slf.try_borrow()?;
                let s = this.0.borrow_dependent();
                class.call1((s.time(), s.q().give(py, None)?, s.v().give(py, None)?, &tau, &f_ext))?
            };
            if !control.call1((now,))?.is_none() {
                let expected = "expected a function that sets the numbers of `tau` and `f_ext` and returns None";
                return Err(PyTypeError::new_err(format!("control: {expected}")));
            }
            let robot = &model.get().inner;
            let (tau, f_ext) = (Tangent::read("tau", &tau, robot)?, Forces::read("f_ext", Some(&f_ext), robot)?);
            let mut this = slf.try_borrow_mut()?;
            status = this.0.with_dependent_mut(|_, simulation| simulation.step(&tau, &f_ext));
            if !status.is_done() {
                break;
            }
        }
        Ok(word(status))
    }
}
