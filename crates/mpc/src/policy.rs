//! Policy of a controller at a high rate: the plan's feedback, within limits, and a stop without a plan.

use crate::knots::effort_limits;
use condyle_dynamics::{Data, Model, minv};
use condyle_optimal::PolicyPublisher;

/// Time step for which the damping is stable (s).
const STEP: f64 = 1e-3;
/// Largest change of a velocity by the damping in one step, relative to the velocity.
const STRONGEST: f64 = 0.2;
/// Velocity at which the damping reaches the limit of the effort (rad/s or m/s).
const FASTEST: f64 = 20.0;

/// Efforts of the joints as a function of time and state: the feedback of the latest plan, within the robot's limits.
/// It never waits for the planner. Each thread needs its own clone.
///
/// After the end of the plan, after [`stop`](Self::stop) or without a plan, the policy damps the joints: τ = −D v
/// within the limits. For a state that is not finite, it returns the efforts of the plan without feedback, or 0 without
/// a plan.
#[derive(Clone, Debug)]
pub struct Policy {
    plan: condyle_optimal::Policy,
    limits: Vec<f64>,
    damping: Vec<f64>,
    u: Vec<f64>,
    nq: usize,
    stopped: bool,
}

/// Source of the efforts that a policy returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum EffortSource {
    /// The plan with its feedback.
    Plan,
    /// The plan without feedback, because the state is not finite.
    OpenLoop,
    /// The damping, because there is no plan, the plan has ended, or the policy was stopped.
    Damping,
}

impl Policy {
    /// Creates a policy without a plan. `posture` (nq) is a typical position of the robot.
    /// The first `root` coordinates of v have no motors.
    pub(crate) fn new(publisher: &PolicyPublisher, model: &Model, posture: &[f64], root: usize) -> Self {
        let limits = effort_limits(model, root);
        let mut data = Data::new(model);
        let inverse = minv(model, &mut data, posture);
        let damping = limits.iter().enumerate().map(|(k, limit)| {
            let inertia = 1.0 / inverse[(root + k, root + k)];
            (STRONGEST * inertia / STEP).min(limit / FASTEST)
        });
        let damping: Vec<f64> = damping.collect();
        let u = vec![0.0; limits.len()];
        Self { plan: publisher.policy(), limits, damping, u, nq: model.nq() + root, stopped: false }
    }

    /// Computes the efforts of the joints at the time t (s) and the state x = (q, v) into `tau`. The free-flyer has no
    /// efforts. All efforts are finite and within the limits of the robot. Allocates nothing after the first call.
    ///
    /// # Panics
    /// If x or `tau` has another length than the robot needs.
    #[track_caller]
    pub fn control(&mut self, t: f64, x: &[f64], tau: &mut [f64]) -> EffortSource {
        let n = self.limits.len();
        assert_eq!(x.len(), self.nq + n, "`x` has {} numbers, expected {}", x.len(), self.nq + n);
        assert_eq!(tau.len(), n, "`tau` has {} numbers, expected {n}", tau.len());
        let point = if t.is_finite() { self.plan.control_into(t, x, &mut self.u) } else { None };
        let source = match point {
            Some(point) if !self.stopped && !point.is_late => {
                tau.copy_from_slice(&self.u);
                if point.has_feedback { EffortSource::Plan } else { EffortSource::OpenLoop }
            }
            _ => {
                let rates = x[self.nq..].iter().zip(&self.damping);
                tau.iter_mut().zip(rates).for_each(|(tau, (v, d))| *tau = -d * v);
                EffortSource::Damping
            }
        };
        for (tau, limit) in tau.iter_mut().zip(&self.limits) {
            *tau = if tau.is_finite() { tau.clamp(-limit, *limit) } else { 0.0 };
        }
        source
    }

    /// Makes this policy damp the joints from now on, as an emergency stop, until [`release`](Self::release).
    pub fn stop(&mut self) {
        self.stopped = true;
    }

    /// Makes this policy follow the plan again after [`stop`](Self::stop).
    pub fn release(&mut self) {
        self.stopped = false;
    }

    /// Returns the time (s) of the end of the latest plan; `None` before the first plan.
    pub fn end(&self) -> Option<f64> {
        self.plan.end()
    }
}
