//! Safe command for ticks without a solution. In the first ticks after a solution it repeats the torques of that
//! solution. Later it is gravity compensation with damping.

use crate::contact_rows::ContactRows;
use crate::kinematics::Kinematics;
use condyle_dynamics::{Data, gravity};
use nalgebra::{Matrix6, Vector6};

/// Quantities from which the safe command is computed.
pub(crate) struct Safety {
    data: Data<f64>,
    /// Torques of the last solution; 0 before the first solution.
    pub tau: Vec<f64>,
    /// Number of ticks since the last solution; `None` before the first solution.
    pub age: Option<u32>,
    /// Last valid position.
    pub q: Vec<f64>,
    /// Last valid velocity.
    pub v: Vec<f64>,
    /// Whether the last valid state is the current state.
    pub current: bool,
    /// Minimum and maximum effort of each coordinate.
    effort: [Vec<f64>; 2],
    damping: f64,
    hold_ticks: u32,
}

impl Safety {
    pub(crate) fn new(
        kinematics: &Kinematics,
        q: &[f64],
        effort: [Vec<f64>; 2],
        damping: f64,
        hold_ticks: u32,
    ) -> Self {
        let nv = kinematics.model.nv();
        Self {
            data: Data::new(&kinematics.model),
            tau: vec![0.0; nv],
            age: None,
            q: q.to_vec(),
            v: vec![0.0; nv],
            current: false,
            effort,
            damping,
            hold_ticks,
        }
    }

    /// Stores the state of a tick, or stores that the state is invalid (`None`).
    pub(crate) fn see(&mut self, state: Option<(&[f64], &[f64])>) {
        self.current = state.is_some();
        if let Some((q, v)) = state {
            self.q.copy_from_slice(q);
            self.v.copy_from_slice(v);
        }
    }

    /// Stores the torques of a solved tick.
    pub(crate) fn keep(&mut self, tau: &[f64]) {
        self.tau.copy_from_slice(tau);
        self.age = Some(0);
    }

    /// Clips torques to the effort limits.
    pub(crate) fn clip(&self, tau: &mut [f64]) {
        let [least, greatest] = &self.effort;
        for ((tau, &least), &greatest) in tau.iter_mut().zip(least).zip(greatest) {
            *tau = tau.clamp(least, greatest);
        }
    }

    /// Writes the torques of a tick without a solution. Returns whether these are the torques of the last solution.
    pub(crate) fn command(
        &mut self,
        kinematics: &mut Kinematics,
        contacts: &[ContactRows],
        free: &[usize],
        tau: &mut [f64],
    ) -> bool {
        if let Some(age) = self.age.filter(|age| *age < self.hold_ticks) {
            self.age = Some(age + 1);
            tau.copy_from_slice(&self.tau);
            return true;
        }
        self.gravity_compensation(kinematics, contacts, free, tau);
        if self.current {
            for (i, tau) in tau.iter_mut().enumerate() {
                let effort = self.effort[1][i].min(-self.effort[0][i]);
                let scale = if effort.is_finite() { effort } else { 1.0 };
                *tau -= self.damping * scale * self.v[i]; // damping: −D v
            }
        }
        free.iter().for_each(|&i| tau[i] = 0.0);
        self.clip(tau);
        // At positions and velocities of 1e300, torques overflow: replace these torques by 0.
        tau.iter_mut().filter(|tau| !tau.is_finite()).for_each(|tau| *tau = 0.0);
        false
    }

    /// Computes τ = g − Jᵀ f, with the gravity torques g, and the Jacobians J and forces f of the active contacts.
    /// These are the smallest forces that carry the base: S (g − Jᵀ f) = 0, where S selects the base's coordinates.
    fn gravity_compensation(
        &mut self,
        kinematics: &mut Kinematics,
        contacts: &[ContactRows],
        free: &[usize],
        tau: &mut [f64],
    ) {
        let Self { data, q, v, .. } = self;
        tau.copy_from_slice(gravity(&kinematics.model, data, q));
        let Ok(base) = <[usize; 6]>::try_from(free) else { return };
        kinematics.update(q, v);
        let frames = &kinematics.frames;
        let rows = |c: &ContactRows| if c.geometry.motion.len() == 3 { 3 } else { 6 };
        let active = || contacts.iter().filter(|c| c.active);
        // forces f = J_b λ of each contact, where (Σ J_bᵀ J_b) λ = g_b; index b selects the base's coordinates
        let mut gram = Matrix6::identity() * 1e-9;
        for c in active() {
            for r in 0..rows(c) {
                let J = Vector6::from_fn(|i, _| frames[c.frame].J[(r, base[i])]);
                gram += J * J.transpose();
            }
        }
        let Some(factor) = gram.cholesky() else { return };
        let lambda = factor.solve(&Vector6::from_fn(|i, _| tau[base[i]]));
        for c in active() {
            let frame = &frames[c.frame];
            for r in 0..rows(c) {
                let f: f64 = (0..6).map(|i| frame.J[(r, base[i])] * lambda[i]).sum();
                for &i in &frame.support {
                    tau[i] -= frame.J[(r, i)] * f;
                }
            }
        }
    }
}
