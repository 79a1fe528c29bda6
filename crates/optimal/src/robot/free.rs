//! The action of a robot that touches nothing: forward dynamics, one step of time, costs.

use super::costs::{Cost, Costs};
use super::state::{groups, state_difference, state_integrate};
use crate::action::ActionModel;
use crate::error::{Error, assert_length};
use crate::lq::{Hessian, LqNode};
use condyle_dynamics::{
    Data, IntegrateArgument, Joint, Model, aba, aba_derivatives, aba_hessian, gravity, integrate, integrate_jacobian,
};
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// A knot of a robot that moves freely under its joints' efforts, by semi-implicit Euler:
///
/// ```text
/// q̈ = aba(q, v, τ),   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// The state is x = (q, v); the controls are the efforts τ of all joints but a free-flyer at the root, which nothing
/// drives. A terminal knot has no controls and no Δt: ℓ = Σ w a(r). These are Crocoddyl's rules.
#[derive(Clone, Debug)]
pub struct FreeDynamics {
    model: Arc<Model>,
    data: Data<f64>,
    costs: Costs,
    /// Δt; none at a terminal knot.
    dt: Option<f64>,
    /// Degrees of freedom that no control drives, the first ones.
    passive: usize,
    groups: Vec<Range<usize>>,
    /// The least and the greatest controls.
    bounds: Option<[Vec<f64>; 2]>,
    tau: Vec<f64>,
    /// v Δt + q̈ Δt².
    dq: Vec<f64>,
    /// ∂(q ⊕ dq)/∂q and ∂(q ⊕ dq)/∂dq.
    transport: DMatrix<f64>,
    exp: DMatrix<f64>,
}

impl FreeDynamics {
    /// A knot of Δt seconds.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit, [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::TimeStep { dt });
        }
        Self::new(model, Some(dt), costs)
    }

    /// The knot after the last one. Terms of the control must have an empty reference: there is none.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit.
    pub fn terminal(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        Self::new(model, None, costs)
    }

    fn new(model: Arc<Model>, dt: Option<f64>, costs: Vec<Cost>) -> Result<Self, Error> {
        let nv = model.nv();
        let passive = match model.bodies().get(1) {
            Some(root) if root.joint == Joint::FreeFlyer => 6,
            _ => 0,
        };
        let nu = if dt.is_some() { nv - passive } else { 0 };
        Ok(Self {
            data: Data::new(&model),
            costs: Costs::new(model.clone(), nu, costs)?,
            dt,
            passive,
            groups: groups(&model),
            bounds: None,
            tau: vec![0.0; nv],
            dq: vec![0.0; nv],
            transport: DMatrix::zeros(nv, nv),
            exp: DMatrix::zeros(nv, nv),
            model,
        })
    }

    /// The same with bounds on the controls, infinite where there is none.
    ///
    /// # Panics
    /// If there are not nu numbers of each.
    #[must_use]
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        assert_length("lower", lower.len(), self.nu());
        assert_length("upper", upper.len(), self.nu());
        self.bounds = Some([lower, upper]);
        self
    }

    /// The robot.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The costs, to change their weights between solves.
    pub fn costs_mut(&mut self) -> &mut Costs {
        &mut self.costs
    }

    /// The efforts that hold the robot still at a state, of the joints that are driven: u = g(q).
    ///
    /// # Panics
    /// If `x` has not nq + nv numbers.
    pub fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        assert!(x.len() == self.nx(), "x: expected {} numbers, found {}", self.nx(), x.len());
        gravity(&self.model, &mut self.data, &x[..self.model.nq()])[self.passive..].to_vec()
    }

    /// τ = (0, u).
    fn set_tau(&mut self, u: &[f64]) {
        self.tau[..self.passive].fill(0.0);
        self.tau[self.passive..].copy_from_slice(u);
    }
}

impl ActionModel for FreeDynamics {
    fn nx(&self) -> usize {
        self.model.nq() + self.model.nv()
    }

    fn ndx(&self) -> usize {
        2 * self.model.nv()
    }

    fn nu(&self) -> usize {
        if self.dt.is_some() { self.model.nv() - self.passive } else { 0 }
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        self.bounds.as_ref().map(|[lower, upper]| (lower.as_slice(), upper.as_slice()))
    }

    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let cost = self.costs.calc(x, u);
        let Some(dt) = self.dt else { return cost };
        self.set_tau(u);
        let (q, v) = x.split_at(self.model.nq());
        let (q_next, v_next) = next.split_at_mut(q.len());
        let a = aba(&self.model, &mut self.data, q, v, &self.tau, &[]);
        for k in 0..v.len() {
            v_next[k] = v[k] + a[k] * dt; // v⁺ = v + q̈ Δt
            self.dq[k] = v[k] * dt + a[k] * dt * dt; // v Δt + q̈ Δt²
        }
        integrate(&self.model, q, &self.dq, q_next);
        dt * cost
    }

    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        self.costs.calc_diff(x, u, self.dt.unwrap_or(1.0), node);
        let Some(dt) = self.dt else { return };
        self.set_tau(u);
        let (nv, nu, passive) = (self.model.nv(), u.len(), self.passive);
        let (q, v) = x.split_at(self.model.nq());
        let d = aba_derivatives(&self.model, &mut self.data, q, v, &self.tau, &[]);
        for k in 0..nv {
            self.dq[k] = v[k] * dt + d.a[k] * dt * dt;
        }
        // A = [T + E ∂q̈/∂q Δt², E (1 Δt + ∂q̈/∂v Δt²); ∂q̈/∂q Δt, 1 + ∂q̈/∂v Δt],  B = [E M⁻¹ Δt²; M⁻¹ Δt],
        // with T = ∂(q ⊕ dq)/∂q and E = ∂(q ⊕ dq)/∂dq, the identity but for the groups' blocks
        for (columns, da) in [(0, d.da_dq), (nv, d.da_dv)] {
            for c in 0..nv {
                for r in 0..nv {
                    let x = da[(r, c)] * dt;
                    node.A[(nv + r, columns + c)] = x;
                    node.A[(r, columns + c)] = x * dt;
                }
            }
        }
        for k in 0..nv {
            node.A[(k, nv + k)] += dt;
            node.A[(nv + k, nv + k)] += 1.0;
        }
        for c in 0..nu {
            for r in 0..nv {
                let x = d.da_dtau[(r, passive + c)] * dt;
                node.B[(nv + r, c)] = x;
                node.B[(r, c)] = x * dt;
            }
        }
        if !self.groups.is_empty() {
            integrate_jacobian(&self.model, &self.dq, IntegrateArgument::Velocity, &mut self.exp);
            integrate_jacobian(&self.model, &self.dq, IntegrateArgument::Position, &mut self.transport);
        }
        let in_group = |k: usize| self.groups.iter().any(|g| g.contains(&k));
        for k in (0..nv).filter(|&k| !in_group(k)) {
            node.A[(k, k)] += 1.0;
        }
        let blocks = node.structure.set_euler(dt, &self.groups);
        for (block, group) in blocks.iter_mut().zip(&self.groups) {
            let (start, size) = ((group.start, group.start), (group.len(), group.len()));
            block.T.copy_from(&self.transport.view(start, size));
            block.E.copy_from(&self.exp.view(start, size));
        }
        for group in &self.groups {
            apply_block(&self.exp, group, &mut node.A);
            apply_block(&self.exp, group, &mut node.B);
            for c in group.clone() {
                for r in group.clone() {
                    node.A[(r, c)] += self.transport[(r, c)];
                }
            }
        }
    }

    /// For a robot whose configurations are a vector space: of λᵀ∂²(q⁺, v⁺) there is left Δt (λ_v + Δt λ_q)ᵀ ∂²q̈.
    fn dynamics_hessian(&mut self, _: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let Some(dt) = self.dt.filter(|_| self.groups.is_empty()) else { return false };
        self.set_tau(u);
        let (nv, passive) = (self.model.nv(), self.passive);
        let (q, v) = x.split_at(self.model.nq());
        for k in 0..nv {
            self.dq[k] = dt * (lambda[nv + k] + dt * lambda[k]);
        }
        let d = aba_hessian(&self.model, &mut self.data, q, v, &self.tau, &[], &self.dq);
        for c in 0..nv {
            for r in 0..nv {
                hessian.xx[(r, c)] = d.dqdq[(r, c)];
                hessian.xx[(nv + r, c)] = d.dvdq[(r, c)];
                hessian.xx[(c, nv + r)] = d.dvdq[(r, c)];
                hessian.xx[(nv + r, nv + c)] = d.dvdv[(r, c)];
            }
            for k in 0..u.len() {
                hessian.xu[(c, k)] = d.dtaudq[(passive + k, c)];
                hessian.xu[(nv + c, k)] = 0.0;
            }
        }
        hessian.uu.fill(0.0);
        true
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        state_integrate(&self.model, x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        state_difference(&self.model, x0, x1, out);
    }
}

/// The rows of a group times its block of E, in place.
fn apply_block(E: &DMatrix<f64>, group: &Range<usize>, X: &mut DMatrix<f64>) {
    let mut rows = [0.0; 6];
    for mut column in X.column_iter_mut() {
        for (k, r) in group.clone().enumerate() {
            rows[k] = group.clone().map(|c| E[(r, c)] * column[c]).sum();
        }
        for (k, r) in group.clone().enumerate() {
            column[r] = rows[k];
        }
    }
}
