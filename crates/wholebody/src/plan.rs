//! Planned motion, given as plain arrays. A controller computes its references at each time from the plan.

use crate::error::Error;
use condyle_dynamics::{Joint, Model, difference, interpolate};
use condyle_linalg::check;

/// Planned motion: states at given times (knots), efforts and gains between these times, and the intervals in which
/// contacts touch.
///
/// [`WholeBodyController::track`](crate::WholeBodyController::track) computes references from a plan. Between knots,
/// the position of each joint is interpolated in the joint's Lie group (for example along a rotation). The velocity v
/// is interpolated linearly, and a = Δv / Δt. Two knots may have the same time: the velocity then jumps at this time
/// (an impact).
///
/// ```
/// use condyle_dynamics::{neutral, robots};
/// use condyle_wholebody::{Plan, PlanData};
/// let robot = robots::quadruped();
/// let x = [neutral(&robot), vec![0.0; 18]].concat();
/// // Two knots half a second apart, all four feet on the ground.
/// let data = PlanData { times: vec![0.0, 0.5], states: x.repeat(2), touches: vec![true; 4], ..PlanData::default() };
/// let plan = Plan::new(&robot, 4, data)?;
/// assert_eq!(plan.activation(0, 0.2), 1.0);
/// # Ok::<(), condyle_wholebody::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Plan {
    model: Model,
    contacts: usize,
    data: PlanData,
    /// Number of actuated coordinates (nv without free-flyers).
    controls: usize,
}

/// Arrays of a [`Plan`] with N + 1 knots.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanData {
    /// N + 1 times (s) in ascending order; equal times are allowed.
    pub times: Vec<f64>,
    /// States (q, v) of the knots, flat: (N + 1)·(nq + nv).
    pub states: Vec<f64>,
    /// Efforts of the actuated coordinates from each knot to the next: nu numbers for each of N intervals; or empty.
    pub controls: Vec<f64>,
    /// Gains K of the control u = ū + K (x ⊖ x̄) from each knot to the next: a matrix of nu × 2 nv numbers, row by row,
    /// for each of N intervals; or empty. x is the state, and the plan has the control ū and the state x̄.
    pub gains: Vec<f64>,
    /// Whether each contact touches from each knot to the next, flat: N·contacts.
    pub touches: Vec<bool>,
    /// Time (s) over which a contact is loaded after its beginning, and unloaded before its end; at least 0.
    pub fade: f64,
}

/// State of a plan at one time.
#[derive(Clone, Debug)]
pub(crate) struct PlannedState {
    pub q: Vec<f64>,
    pub v: Vec<f64>,
    pub a: Vec<f64>,
}

impl Plan {
    /// Creates a plan for a robot with this number of contacts.
    ///
    /// # Errors
    /// [`Error`] for arrays of the wrong length, numbers that are not finite, and times that decrease. [`Error::Knot`]
    /// for a state in which a quaternion or a pair (cos, sin) does not have length 1; it names the knot and the joint.
    pub fn new(model: &Model, contacts: usize, data: PlanData) -> Result<Self, Error> {
        let (nx, nv) = (model.nq() + model.nv(), model.nv());
        let free = model.bodies().iter().skip(1).filter(|b| b.joint == Joint::FreeFlyer).count();
        let (controls, knots) = (nv - 6 * free, data.times.len());
        let steps = knots.saturating_sub(1);
        for (name, found, expected, may_be_empty) in [
            ("times", knots, knots.max(2), false),
            ("states", data.states.len(), knots * nx, false),
            ("controls", data.controls.len(), steps * controls, true),
            ("gains", data.gains.len(), steps * controls * 2 * nv, true),
            ("touches", data.touches.len(), steps * contacts, false),
        ] {
            if found != expected && !(may_be_empty && found == 0) {
                return Err(Error::Length { name, expected, found });
            }
        }
        let wrong = |name, value| Err(Error::Setting { name, value, allowed: "finite, and times in their order" });
        if let Some(k) = (0..knots).find(|&k| !data.times[k].is_finite() || k > 0 && data.times[k] < data.times[k - 1])
        {
            return wrong("times", data.times[k]);
        }
        for (knot, x) in data.states.chunks_exact(nx.max(1)).enumerate() {
            let (q, v) = x.split_at(model.nq());
            model.check_state(q, v).map_err(|error| Error::Knot { knot, error })?;
        }
        for (name, numbers) in [("controls", &data.controls), ("gains", &data.gains)] {
            if let Some(&x) = numbers.iter().find(|x| !x.is_finite()) {
                return wrong(name, x);
            }
        }
        if !(data.fade >= 0.0 && data.fade.is_finite()) {
            return Err(Error::Setting { name: "fade", value: data.fade, allowed: "at least 0" });
        }
        Ok(Self { model: model.clone(), contacts, data, controls })
    }

    /// Returns the arrays from which the plan was made.
    pub fn data(&self) -> &PlanData {
        &self.data
    }

    /// Returns the number of controls: all coordinates but the free-flyers'.
    pub fn controls(&self) -> usize {
        self.controls
    }

    /// Returns the times of the first and the last knot.
    pub fn span(&self) -> [f64; 2] {
        [self.data.times[0], self.data.times[self.data.times.len() - 1]]
    }

    /// Returns the index of the interval between knots that contains time t. Also returns the position of t in this
    /// interval, from 0 at its start to 1 at its end.
    fn step(&self, t: f64) -> (usize, f64) {
        let times = &self.data.times;
        let after = times.partition_point(|&x| x <= t).clamp(1, times.len() - 1);
        let (from, to) = (times[after - 1], times[after]);
        (after - 1, if to > from { ((t - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 })
    }

    /// Panics unless the plan was made for this number of contacts, and for a robot with the same bodies and joints.
    #[track_caller]
    pub(crate) fn check(&self, model: &Model, contacts: usize) {
        let same = self.model.tree_hash() == model.tree_hash();
        assert!(same, "plan: made for another model (`{}`) than `{}`", self.model.name(), model.name());
        assert!(self.contacts == contacts, "plan: expected {contacts} contacts, found {}", self.contacts);
    }

    /// Computes q, v and a at a time. Before the first and after the last knot, the robot is at rest.
    pub(crate) fn read(&self, t: f64, out: &mut PlannedState, tangent: &mut [f64]) {
        let (nq, nx) = (self.model.nq(), self.model.nq() + self.model.nv());
        let (k, s) = self.step(t);
        let (x0, x1) = (&self.data.states[k * nx..][..nx], &self.data.states[(k + 1) * nx..][..nx]);
        let dt = self.data.times[k + 1] - self.data.times[k];
        let [begin, end] = self.span();
        interpolate(&self.model, &x0[..nq], &x1[..nq], s, tangent, &mut out.q);
        for i in 0..out.v.len() {
            let (v0, v1) = (x0[nq + i], x1[nq + i]);
            let moving = (begin..=end).contains(&t) && dt > 0.0;
            out.v[i] = if moving { v0 + s * (v1 - v0) } else { 0.0 };
            out.a[i] = if moving { (v1 - v0) / dt } else { 0.0 };
        }
    }

    /// Returns the activation of a contact at a time: 0 while the contact does not touch, a ramp after the beginning
    /// and before the end of a contact interval, and 1 otherwise.
    ///
    /// # Panics
    /// If the contact's index is out of range.
    #[track_caller]
    pub fn activation(&self, contact: usize, t: f64) -> f64 {
        assert!(contact < self.contacts, "contact: expected one of {}, found {contact}", self.contacts);
        let PlanData { times, touches, fade, .. } = &self.data;
        let touching = |k: usize| touches[k * self.contacts + contact];
        let now = self.step(t).0;
        if !touching(now) {
            return 0.0;
        }
        let ramp = |elapsed: f64| if *fade > 0.0 { (elapsed / fade).clamp(0.0, 1.0) } else { 1.0 };
        let begin = (0..now).rev().find(|&k| !touching(k) && times[k] < times[k + 1]);
        let end = (now..times.len() - 1).find(|&k| !touching(k) && times[k] < times[k + 1]);
        ramp(begin.map_or(f64::INFINITY, |k| t - times[k + 1])).min(ramp(end.map_or(f64::INFINITY, |k| times[k] - t)))
    }

    /// Computes the control u = ū + K (x ⊖ x̄) at time t and state x = (q, v), from the control ū, the gains K and the
    /// state x̄ of the plan. `tau` gets the efforts of all coordinates (nv numbers), 0 at a free-flyer.
    ///
    /// # Errors
    /// [`Error::Model`] for a state that is not finite, or with a quaternion or a pair (cos, sin) that does not have
    /// length 1. `tau` is then unchanged.
    ///
    /// # Panics
    /// If an argument has the wrong length, or the plan has no controls.
    #[track_caller]
    pub fn feedback(&self, t: f64, q: &[f64], v: &[f64], tau: &mut [f64]) -> Result<(), Error> {
        let (nv, nu, k) = (self.model.nv(), self.controls, self.step(t).0);
        check("tau", tau.len(), nv);
        assert!(nu == 0 || !self.data.controls.is_empty(), "controls: the plan has none");
        self.model.check_state(q, v)?;
        let mut planned = PlannedState { q: vec![0.0; q.len()], v: vec![0.0; nv], a: vec![0.0; nv] };
        let mut dx = vec![0.0; 2 * nv];
        self.read(t, &mut planned, &mut dx[..nv]);
        difference(&self.model, &planned.q, q, &mut dx[..nv]);
        (0..nv).for_each(|i| dx[nv + i] = v[i] - planned.v[i]);
        tau[..nv - nu].fill(0.0);
        for (i, tau) in tau[nv - nu..].iter_mut().enumerate() {
            let row = (k * nu + i) * 2 * nv;
            let gain = self.data.gains.get(row..row + 2 * nv).unwrap_or_default();
            *tau = self.data.controls[k * nu + i] + gain.iter().zip(&dx).map(|(k, x)| k * x).sum::<f64>();
        }
        Ok(())
    }
}
