//! The controller of walking robots as a Python class.

use super::controller::controller;
use super::feet::{Foot, Gait};
use super::policy::JointPolicy;
use super::settings::{ChangeTime, Limits, give_report, read_weights};
use crate::arrays::{Computed, Give, three, vector};
use crate::exceptions::{controller_error, mpc_error};
use crate::model::Model;
use crate::optimal::lock;
use crate::wholebody::Plan;
use condyle::mpc as rust;
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::Mutex;

/// A model predictive controller of a walking robot. Each tick renews a plan of the whole body's motion and of the
/// contact forces, under the limits of the robot and of friction. A `JointPolicy` follows the plan at a higher rate.
///
/// The plan is an optimal control problem with a knot for each time step, and the schedule of the gait gives the
/// contacts of each knot. Knots begin at times that do not depend on the rate of the ticks. Each tick makes one
/// linearisation and at most `sweeps` sweeps of the interior point.
///
/// model: a robot with a free-flyer at its root.
/// feet: a list of `Foot`.
/// gait: a `Gait`.
/// horizon, knot: the durations of the horizon and of a knot (s).
/// weights: `Weights`; None for the defaults.
/// limits: 'model' for all limits of the model, `PlanLimits` for some of them, or None for none of them.
/// sweeps: the number of sweeps for the quadratic program of each linearisation.
/// iterations: the least and the largest number of linearisations in a tick. Further ones after the least number are
///     made only if the budget has time left for one more.
/// budget: the time budget of a tick (s); None without a budget. One sweep is always made.
/// latency: the time between the measurement of a state and the use of the plan that is computed from it (s).
/// threads: the number of threads of a tick.
/// max_acceleration: the largest accelerations of the command: forwards, to the left (m/s²), and turning (rad/s²).
/// swing_height: the height of a swing (m).
///
/// Raises `ControllerError` for a robot without a free-flyer, a foot or a gait that does not fit the robot, or a number
/// outside its range.
///
/// >>> from condyle.mpc import Foot, Gait, WholeBodyMpc
/// >>> robot = condyle.robots.quadruped()
/// >>> feet = [Foot.point(f"{leg}_foot", 0.6, 0.0) for leg in ("LF", "RF", "LH", "RH")]
/// >>> mpc = WholeBodyMpc(robot, feet, Gait.trot(), threads=1)
/// >>> mpc.report.status
/// 'no_plan'
#[pyclass(frozen, module = "condyle.mpc")]
pub(crate) struct WholeBodyMpc {
    model: Py<Model>,
    inner: Mutex<rust::WholeBodyMpc>,
    nx: usize,
}

controller! { WholeBodyMpc, 6 {
    #[new]
    #[pyo3(signature = (model, feet, gait, *, horizon=0.5, knot=0.02, weights=None, limits=Limits::MODEL, sweeps=2,
        iterations=[1, 1], budget=None, latency=0.0, threads=1, max_acceleration=[1.0, 1.0, 2.0], swing_height=0.06),
        text_signature = "(model, feet, gait, *, horizon=0.5, knot=0.02, weights=None, limits='model', sweeps=2,
        iterations=(1, 1), budget=None, latency=0.0, threads=1, max_acceleration=(1.0, 1.0, 2.0), swing_height=0.06)")]
    fn new(
        model: &Bound<'_, Model>,
        feet: Vec<PyRef<'_, Foot>>,
        gait: &Bound<'_, Gait>,
        horizon: f64,
        knot: f64,
        weights: Option<&Bound<'_, PyAny>>,
        limits: Limits,
        sweeps: usize,
        iterations: [usize; 2],
        budget: Option<f64>,
        latency: f64,
        threads: usize,
        max_acceleration: [f64; 3],
        swing_height: f64,
    ) -> PyResult<Self> {
        let feet: Vec<_> = feet.iter().map(|foot| foot.0.clone()).collect();
        let settings = rust::Settings {
            horizon,
            knot,
            weights: weights.map_or_else(|| Ok(rust::Weights::default()), read_weights)?,
            limits: limits.0,
            sweeps,
            iterations,
            budget: budget.unwrap_or(f64::INFINITY),
            latency,
            threads,
            accelerations: max_acceleration,
            swing_height,
            ..rust::Settings::default()
        };
        let robot = model.get().inner.clone();
        let nx = robot.nq() + robot.nv();
        let inner = rust::WholeBodyMpc::new(robot, &feet, gait.get().0.clone(), settings).map_err(mpc_error)?;
        Ok(Self { model: model.clone().unbind(), inner: Mutex::new(inner), nx })
    }

    /// Begins anew with a robot that stands: its joints are the posture to which the robot returns, and its feet are
    /// on the ground. Solves the first problem.
    ///
    /// x: the state (q, v); t: the time (s).
    ///
    /// Raises `ControllerError` for a number that is not finite, or if the gait does not fit the feet.
    #[pyo3(signature = (x, t=0.0))]
    fn reset(&self, py: Python<'_>, x: &Bound<'_, PyAny>, t: f64) -> PyResult<()> {
        let x = vector("x", x, self.nx)?.to_vec();
        let mut inner = lock("controller", &self.inner)?;
        let mpc = &mut *inner;
        py.detach(|| mpc.reset(t, &x).map(|_| ())).map_err(mpc_error)
    }

    /// Renews the plan for a measured state, and returns a new `JointPolicy` that follows the latest plan. The first
    /// call is a `reset`. A state that is not finite leaves the plan as it is: see `report`.
    ///
    /// t: the time of the measurement (s); x: the state (q, v).
    ///
    /// Raises `ControllerError` if t is before the last call.
    fn update(&self, py: Python<'_>, t: f64, x: &Bound<'_, PyAny>) -> PyResult<JointPolicy> {
        let x = vector("x", x, self.nx)?.to_vec();
        let mut inner = lock("controller", &self.inner)?;
        let mpc = &mut *inner;
        py.detach(|| mpc.update(t, &x).map(|_| ())).map_err(mpc_error)?;
        drop(inner);
        self.policy()
    }

    /// Makes the part of the next `update` that does not depend on the measured state, before the state arrives.
    ///
    /// t: the time of the next measurement (s); with None, it follows after the last period. An update at another time
    ///     makes the whole tick again.
    ///
    /// Raises `ControllerError` before the first plan, and if t is before the last call.
    #[pyo3(signature = (t=None))]
    fn prepare(&self, py: Python<'_>, t: Option<f64>) -> PyResult<()> {
        let mut inner = lock("controller", &self.inner)?;
        let mpc = &mut *inner;
        py.detach(|| mpc.prepare(t)).map_err(mpc_error)
    }

    /// Sets the commanded velocity of the trunk, along its heading.
    ///
    /// vx, vy: velocities forwards and to the left (m/s); wz: rate of turning to the left (rad/s); height: height of
    /// the trunk relative to the stand (m), None to keep it.
    ///
    /// Raises `ControllerError` for a number that is not finite.
    #[pyo3(signature = (vx=0.0, vy=0.0, wz=0.0, height=None))]
    fn command(&self, vx: f64, vy: f64, wz: f64, height: Option<f64>) -> PyResult<()> {
        let mut inner = lock("controller", &self.inner)?;
        if let Some(height) = height {
            inner.set_height(height).map_err(mpc_error)?;
        }
        inner.command(rust::Command { vx, vy, wz }).map_err(mpc_error)
    }

    /// Changes the gait as soon as all feet that are in the air have landed. No other foot leaves the ground before.
    ///
    /// gait: the new `Gait`.
    /// at: 'next' for now, or the time before which the present gait goes on (s), at most 60 s ahead.
    ///
    /// Raises `ControllerError` for a gait that does not fit the feet, and for a time that is too late.
    #[pyo3(signature = (gait, at=ChangeTime(None)), text_signature = "($self, gait, at='next')")]
    fn set_gait(&self, gait: &Bound<'_, Gait>, at: ChangeTime) -> PyResult<()> {
        let mut inner = lock("controller", &self.inner)?;
        inner.set_gait_at(gait.get().0.clone(), at.0.unwrap_or(f64::NEG_INFINITY)).map_err(mpc_error)
    }

    /// Reports which feet touch the ground, as measured at the time of the next `update`. Later updates need reports of
    /// their own. Without reports, feet land when the schedule says so.
    ///
    /// - A foot that touches after half of its swing has landed: it stands from then on, where it is.
    /// - A foot that does not touch at the end of its swing swings on, and its foothold is lowered at 0.8 m/s, by at
    ///   most 0.06 m. The foot counts as standing at once if fewer than two other feet
    ///   stand, or if these are no stance of the gait.
    ///
    /// Other swings stay as the schedule has them.
    ///
    /// feet: the names of the frames of the feet that touch, one name, or a bool for each foot.
    ///
    /// Raises `ControllerError` for a name that is not a foot, or another number of bools.
    fn touch(&self, feet: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut inner = lock("controller", &self.inner)?;
        if let Ok(name) = feet.extract::<String>() {
            return inner.touch_named(&[name]).map_err(mpc_error);
        }
        if let Ok(names) = feet.extract::<Vec<String>>() {
            return inner.touch_named(&names).map_err(mpc_error);
        }
        let flags: Vec<bool> = feet.try_iter()?.map(|flag| flag?.is_truthy()).collect::<PyResult<_>>()?;
        inner.touch(&flags).map_err(mpc_error)
    }

    /// Sets the plane of the ground. Without arguments, it is the plane through the last footholds.
    ///
    /// normal: the normal of the plane, which points upwards; height: the height of the plane at the origin of the
    /// world (m).
    #[pyo3(signature = (normal=None, height=0.0))]
    fn terrain(&self, normal: Option<&Bound<'_, PyAny>>, height: f64) -> PyResult<()> {
        let terrain = match normal {
            None => None,
            Some(normal) => {
                let wrong = || PyValueError::new_err("normal: expected a vector that points upwards");
                Some(rust::Terrain::new(three("normal", normal)?, height).ok_or_else(wrong)?)
            }
        };
        lock("controller", &self.inner)?.set_terrain(terrain);
        Ok(())
    }

    /// Returns the plan of the last tick for `condyle.wholebody`: a `Plan` with the states, efforts and gains of the
    /// horizon, and the feet that touch. A `WholeBodyController` with a contact for each foot, in the same order,
    /// tracks it: `controller.track(mpc.plan(), t, references)`.
    ///
    /// fade: the time (s) during which a contact is loaded and unloaded.
    ///
    /// Raises `ControllerError` without a plan.
    #[pyo3(signature = (fade=0.0))]
    fn plan(&self, py: Python<'_>, fade: f64) -> PyResult<Plan> {
        let inner = lock("controller", &self.inner)?;
        let touches = inner.touches().map_err(mpc_error)?;
        let contacts = inner.report().stands.len();
        let model = self.model.bind(py);
        let plan = condyle::plan_of(inner.model(), inner.solver().solution(), inner.times(), &touches, fade);
        Ok(Plan::from_rust(model, plan.map_err(controller_error)?, contacts))
    }

    /// Returns the planned forces of the ground on the feet, along the world's axes: (knots, feet, 3) (N). The force of
    /// a foot in the air is 0.
    ///
    /// Raises `ControllerError` without a plan.
    fn forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut inner = lock("controller", &self.inner)?;
        let (forces, feet) = (inner.forces().map_err(mpc_error)?, inner.report().stands.len());
        let shape = [forces.len() / (3 * feet), feet, 3];
        Computed::new(shape, |numbers: &mut [f64]| numbers.copy_from_slice(&forces)).give(py, None)
    }
}
}
