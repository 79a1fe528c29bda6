//! The controller of arms as a Python class.

use super::controller::controller;
use super::policy::JointPolicy;
use super::settings::{Limits, give_report, read_arm_weights};
use crate::arrays::{array, pose, vector};
use crate::distances::valid_placement;
use crate::exceptions::mpc_error;
use crate::model::Model;
use crate::optimal::{geometry_pairs, lock};
use condyle::mpc as rust;
use condyle::{Se3, Vec3};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::Mutex;

/// A model predictive controller of an arm with a fixed base. A frame of the arm follows poses in time, and the plan
/// keeps the limits of positions, velocities and efforts. A `JointPolicy` follows the plan at a higher rate.
///
/// `path` is a function that returns the pose of the frame (4, 4) at a time (s), or a pose that does not change. It is
/// called for each knot of the horizon.
///
/// model: the robot.
/// frame: the name of the frame.
/// horizon, knot: the durations of the horizon and of a knot (s).
/// weights: `ArmWeights`; None for the defaults.
/// limits: 'model' for all limits of the model, `PlanLimits` for some of them, or None for none of them.
/// obstacles: pairs of geometries that stay apart, as for `Residual.distances`: the arm and obstacles, or two parts of
///     the arm.
/// clearance: the smallest distance of each pair at each knot (m). It may give way at a high cost, because a measured
///     state can be nearer.
/// sweeps: the number of sweeps for the quadratic program of each linearisation.
/// iterations: the least and the largest number of linearisations in a tick. Further ones after the least number are
///     made only if the budget has time left for one more.
/// budget: the time budget of a tick (s); None without a budget. One sweep is always made.
/// latency: the time between the measurement of a state and the use of the plan that is computed from it (s).
/// threads: the number of threads of a tick.
///
/// Raises `ControllerError` for a number outside its range, and `ProblemError` for a frame that does not exist or an
/// invalid pair.
///
/// >>> from condyle.mpc import ArmMpc
/// >>> arm = condyle.robots.arm7()
/// >>> x = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
/// >>> pose = condyle.frame_placement(arm, condyle.Data(arm), x[:7], "tool")
/// >>> mpc = ArmMpc(arm, "tool")
/// >>> mpc.reset(x, pose)
/// >>> mpc.update(0.02, x, pose)(0.021, x).shape
/// (7,)
#[pyclass(frozen, module = "condyle.mpc")]
pub(crate) struct ArmMpc {
    model: Py<Model>,
    inner: Mutex<rust::ArmMpc>,
    nx: usize,
}

controller! { ArmMpc, 0 {
    #[new]
    #[pyo3(signature = (model, frame, *, horizon=0.5, knot=0.02, weights=None, limits=Limits::MODEL,
        obstacles=None, clearance=0.02, sweeps=2, iterations=[1, 1], budget=None, latency=0.0, threads=1),
        text_signature = "(model, frame, *, horizon=0.5, knot=0.02, weights=None, limits='model', obstacles=(),
        clearance=0.02, sweeps=2, iterations=(1, 1), budget=None, latency=0.0, threads=1)")]
    fn new(
        model: &Bound<'_, Model>,
        frame: &str,
        horizon: f64,
        knot: f64,
        weights: Option<&Bound<'_, PyAny>>,
        limits: Limits,
        obstacles: Option<&Bound<'_, PyAny>>,
        clearance: f64,
        sweeps: usize,
        iterations: [usize; 2],
        budget: Option<f64>,
        latency: f64,
        threads: usize,
    ) -> PyResult<Self> {
        let obstacles = obstacles.map_or_else(|| Ok(Vec::new()), |pairs| geometry_pairs(model, pairs))?;
        let weights = weights.map_or_else(|| Ok(rust::ArmWeights::default()), read_arm_weights)?;
        let (Limits(limits), budget) = (limits, budget.unwrap_or(f64::INFINITY));
        let settings = rust::ArmSettings {
            horizon,
            knot,
            weights,
            limits,
            obstacles,
            clearance,
            sweeps,
            iterations,
            budget,
            latency,
            threads,
        };
        let robot = model.get().inner.clone();
        let nx = robot.nq() + robot.nv();
        let inner = rust::ArmMpc::new(robot, frame, settings).map_err(mpc_error)?;
        Ok(Self { model: model.clone().unbind(), inner: Mutex::new(inner), nx })
    }

    /// Sets the placement of an obstacle and its velocity. Later ticks plan with its motion at constant velocity. A
    /// call for each measurement of the obstacle corrects the motion.
    ///
    /// name: the name of the `Geometry` in `obstacles`; placement: its pose (4, 4) in the world at the time t (s).
    /// velocity: [linear, angular], six numbers along the world's axes: the velocity of the origin of the placement
    ///     (m/s), and the angular velocity (rad/s); None for an obstacle at rest.
    ///
    /// Raises `ControllerError` if no pair has this obstacle, or for a number that is not finite.
    #[pyo3(signature = (name, placement, velocity=None, t=0.0))]
    fn place(
        &self,
        name: &str,
        placement: &Bound<'_, PyAny>,
        velocity: Option<&Bound<'_, PyAny>>,
        t: f64,
    ) -> PyResult<()> {
        let placement = valid_placement(placement)?;
        let velocity = velocity.map(|velocity| array::<6>("velocity", velocity)).transpose()?.unwrap_or_default();
        lock("controller", &self.inner)?.place(name, t, placement, velocity.into()).map_err(mpc_error)
    }

    /// Begins anew in a state, whose joints are the posture from which the arm deviates as little as the path allows.
    ///
    /// x: the state (q, v); path: the pose of the frame as a function of time, or a pose (4, 4); t: the time (s).
    ///
    /// Raises `ControllerError` for a number that is not finite.
    #[pyo3(signature = (x, path, t=0.0))]
    fn reset(&self, py: Python<'_>, x: &Bound<'_, PyAny>, path: &Bound<'_, PyAny>, t: f64) -> PyResult<()> {
        let x = vector("x", x, self.nx)?.to_vec();
        let mut inner = lock("controller", &self.inner)?;
        let (mpc, mut path) = (&mut *inner, Path::new(path)?);
        let done = py.detach(|| mpc.reset(t, &x, |t| path.at(t)).map(|_| ()));
        path.finish(done)
    }

    /// Renews the plan for a measured state, and returns a new `JointPolicy` that follows the latest plan. The first
    /// call is a `reset`. A state that is not finite leaves the plan as it is: see `report`.
    ///
    /// t: the time of the measurement (s); x: the state (q, v); path: the pose of the frame as a function of time, or a
    /// pose (4, 4).
    ///
    /// Raises `ControllerError` if t is before the last call.
    fn update(&self, py: Python<'_>, t: f64, x: &Bound<'_, PyAny>, path: &Bound<'_, PyAny>) -> PyResult<JointPolicy> {
        let x = vector("x", x, self.nx)?.to_vec();
        let mut inner = lock("controller", &self.inner)?;
        let (mpc, mut path) = (&mut *inner, Path::new(path)?);
        let done = py.detach(|| mpc.update(t, &x, |t| path.at(t)).map(|_| ()));
        path.finish(done)?;
        drop(inner);
        self.policy()
    }
}
}

/// Path of a frame: a Python function of time, or a pose.
enum Path {
    Pose(Se3<f64>),
    Function(Py<PyAny>, Option<PyErr>),
}

impl Path {
    fn new(path: &Bound<'_, PyAny>) -> PyResult<Self> {
        match path.is_callable() {
            true => Ok(Self::Function(path.clone().unbind(), None)),
            false => pose("path", path).map(Self::Pose),
        }
    }

    /// Returns the pose at the time t. After an exception, the pose is not finite, so that it is refused.
    fn at(&mut self, t: f64) -> Se3<f64> {
        match self {
            Self::Pose(pose) => *pose,
            Self::Function(function, error) => {
                let found = Python::attach(|py| pose("path(t)", &function.bind(py).call1((t,))?));
                found.unwrap_or_else(|exception| {
                    error.get_or_insert(exception);
                    Se3 { translation: Vec3::new(f64::NAN, f64::NAN, f64::NAN), ..Se3::identity() }
                })
            }
        }
    }

    /// Returns the exception of the function, or the error of the controller.
    fn finish(self, done: Result<(), rust::Error>) -> PyResult<()> {
        match self {
            Self::Function(_, Some(exception)) => Err(exception),
            _ => done.map_err(mpc_error),
        }
    }
}
