//! Values of residuals, and the addition of their Jacobians to the gradient and Hessian of a knot.
#![allow(non_snake_case)] // names follow the literature: D, W

use super::layout::{KinematicData, KnotLayout, Plan};
use super::own::{Inputs, OwnResidual};
use super::residual::{Part, Residual, held};
use super::rows::{Rows, add_control_diagonal, add_state_diagonal};
use crate::lq::{ConstraintRow, Hessian, LARGEST_BLOCK, LqKnot, MOST_FORMS};
use crate::robot::knot_data::{KnotState, Sensitivities, add_matrix_row};
use crate::robot::outputs::Output;
use crate::robot::state::groups;
use condyle_dynamics::{Model, commuting_difference};
use condyle_linalg::{Vector, Vectorized, at_level};
use core::ops::Range;

/// Workspace of the residuals of a knot.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Residual r; the next fields are the gradient and the diagonal of the Hessian of the residual's objective.
    pub r: Vec<f64>,
    pub d: Vec<f64>,
    pub dd: Vec<f64>,
    /// Rows of the Jacobians of all residuals.
    pub rows: Rows,
    /// Coordinates of each group of positions that is not a vector space.
    groups: Vec<Range<usize>>,
    /// Derivatives ∂r/∂x and ∂r/∂u of a user-defined residual, row after row.
    own: [Vec<f64>; 2],
    /// Second derivatives of one user-defined residual, and their sum over all user-defined residuals; `None` without
    /// any.
    hessians: Option<Box<[Hessian; 2]>>,
}

impl Scratch {
    /// Allocates the workspace for a robot with nu controls.
    pub(crate) fn new(model: &Model, nu: usize, layout: KnotLayout) -> Self {
        let (nv, numbers) = (model.nv(), || vec![0.0; layout.longest]);
        let rows = Rows::new(nv, nu, layout.rows);
        let own = [2 * nv, nu].map(|n| vec![0.0; if layout.own { layout.longest * n } else { 0 }]);
        let hessians = layout.curved.then(|| Box::new([(); 2].map(|()| Hessian::zeros(2 * nv, nu))));
        Self { r: numbers(), d: numbers(), dd: numbers(), rows, groups: groups(model), own, hessians }
    }

    /// Removes all rows, and sets the second derivatives to zero.
    pub(crate) fn clear(&mut self) {
        self.rows.clear();
        if let Some(hessians) = &mut self.hessians {
            hessians[1].fill(0.0);
        }
    }

    /// Writes q, r, Q, S and R from all rows and second derivatives.
    pub(crate) fn write(&mut self, knot: &mut LqKnot) {
        self.rows.write(knot);
        if let Some(hessians) = &self.hessians {
            let [_, Hessian { xx, xu, uu }] = &**hessians;
            knot.Q += xx;
            knot.S += xu;
            knot.R += uu;
        }
    }
}

/// Computes r = W x, for a matrix W that is stored row after row.
fn product(r: &mut [f64], W: &[f64], x: &[f64]) {
    for (r, row) in r.iter_mut().zip(W.chunks_exact(x.len())) {
        *r = row.iter().zip(x).map(|(w, x)| w * x).sum();
    }
}

/// Residuals of the costs or of the limits of a knot, with all data that they read.
pub(crate) struct ResidualView<'a> {
    pub model: &'a Model,
    /// Index of the knot.
    pub t: usize,
    pub state: KnotState<'a>,
    pub kinematics: &'a KinematicData,
    pub scratch: &'a mut Scratch,
}

impl ResidualView<'_> {
    /// Computes the entries r of a residual in the scratch.
    pub(crate) fn compute(&mut self, residual: &Residual, plan: &Plan) {
        let Self { model, t, state: KnotState { x, u, data }, kinematics, scratch } = self;
        let Scratch { r, groups, .. } = &mut **scratch;
        let r = &mut r[..plan.n];
        let minus = |r: &mut [f64], a: &[f64], b: &[f64]| (0..r.len()).for_each(|i| r[i] = a[i] - b[i]);
        match residual {
            Residual::State { reference } => {
                let (nq, (r_q, r_v)) = (model.nq(), r.split_at_mut(model.nv()));
                commuting_difference(model, &reference[..nq], &x[..nq], r_q); // x ⊖ x_ref
                for group in groups {
                    r_q[group.clone()].copy_from_slice(kinematics.difference(plan, group).0);
                }
                minus(r_v, &x[nq..], &reference[nq..]);
            }
            Residual::Control { reference } => minus(r, u, reference),
            Residual::ControlGravity => {
                r.copy_from_slice(&data.residuals.gravity_residual);
                if !plan.in_contact {
                    r.iter_mut().zip(&data.tau).for_each(|(r, tau)| *r += tau); // τ − g
                }
            }
            Residual::JointEffort { reference } => minus(r, &data.tau, reference),
            Residual::JointAcceleration { reference } => minus(r, &data.a, reference),
            Residual::UndrivenEffort => product(r, &plan.W, &data.tau), // Nᵀ τ
            Residual::ContactAcceleration { .. } => {
                r.copy_from_slice(&data.contact_acceleration[plan.rows.clone()]);
            }
            Residual::ImpulseCenterOfMass => r.copy_from_slice(&data.residuals.com_change),
            Residual::Own(own) => own.calc(*t, x, u, r),
            Residual::ContactForce { target, .. } => {
                let (lambda, target) = (&data.lambda[plan.rows.clone()], target.to_array());
                (0..r.len()).for_each(|k| r[k] = lambda[k] - target[held(lambda.len())[k]]);
            }
            Residual::FrictionCone { .. } | Residual::WrenchCone { .. } | Residual::CenterOfPressure { .. } => {
                product(r, &plan.W, &data.lambda[plan.rows.clone()]); // W f
            }
            _ => r.copy_from_slice(kinematics.residual(plan)),
        }
    }

    /// Appends the rows of the Jacobian of the residual that was computed last, with the derivatives d and dd of its
    /// objective. If the Jacobian is the identity, [`add_diagonal`](Self::add_diagonal) is called instead.
    pub(crate) fn push_rows(&mut self, residual: &Residual, plan: &Plan, sensitivities: &dyn Sensitivities) {
        let (s, nv) = (&mut *self.scratch, self.model.nv());
        let worth = s.d.iter().zip(&s.dd).map(|(d, dd)| [*d, *dd]);
        if let Residual::Own(own) = residual {
            return self.push_own_rows(own, plan.n, sensitivities);
        }
        let active = |worth: &[f64; 2]| *worth != [0.0, 0.0]; // false for an entry inside its bounds
        if residual.part() == Part::Positions {
            let rows = self.kinematics.rows(nv, residual, plan).zip(worth);
            for (row, worth) in rows.filter(|(_, worth)| active(worth)) {
                s.rows.push_positions(row, worth);
            }
            return;
        }
        if residual.is_kinematic() {
            let rows = self.kinematics.rows(nv, residual, plan).zip(worth);
            for (row, worth) in rows.filter(|(_, worth)| active(worth)) {
                let g = s.rows.push(worth);
                g.v.copy_from_slice(&row[..nv]);
                g.q.copy_from_slice(&row[nv..]);
            }
            return;
        }
        for i in 0..plan.n {
            if active(&[self.scratch.d[i], self.scratch.dd[i]]) {
                self.push_row(residual, plan, i, sensitivities);
            }
        }
    }

    /// Appends the rows of the Jacobian of a user-defined residual with n entries.
    fn push_own_rows(&mut self, own: &OwnResidual, n: usize, sensitivities: &dyn Sensitivities) {
        let Scratch { rows, d, dd, own: [by_x, by_u], hessians, .. } = &mut *self.scratch;
        let (KnotState { x, u, .. }, nv) = (self.state, self.model.nv());
        let (by_x, by_u) = (&mut by_x[..n * 2 * nv], &mut by_u[..n * u.len()]);
        by_x.fill(0.0);
        by_u.fill(0.0);
        match hessians.as_deref_mut().filter(|_| own.has_hessian()) {
            Some([hessian, sum]) => {
                hessian.fill(0.0);
                own.calc_hessian(self.t, x, u, &d[..n], [&mut *by_x, &mut *by_u], hessian);
                sum.xx += &hessian.xx;
                sum.xu += &hessian.xu;
                sum.uu += &hessian.uu;
            }
            None => own.calc_diff(self.t, x, u, by_x, by_u),
        }
        let inputs = own.inputs();
        for i in (0..n).filter(|&i| [d[i], dd[i]] != [0.0, 0.0]) {
            if inputs == Inputs::POSITIONS {
                rows.push_positions(&by_x[i * 2 * nv..][..nv], [d[i], dd[i]]);
                continue;
            }
            let g = &mut rows.push([d[i], dd[i]]);
            let (by_q, by_v) = by_x[i * 2 * nv..][..2 * nv].split_at(nv);
            if inputs.positions {
                g.q.copy_from_slice(by_q);
            }
            if inputs.velocities {
                g.v.copy_from_slice(by_v);
            }
            if !inputs.controls {
                continue;
            }
            for (k, slope) in by_u[i * u.len()..][..u.len()].iter().enumerate() {
                sensitivities.add_control(k, *slope, g);
            }
        }
    }

    /// Appends row i of ∂r/∂(u, v, q) of a residual that reads outputs of the dynamics.
    fn push_row(&mut self, residual: &Residual, plan: &Plan, i: usize, sensitivities: &dyn Sensitivities) {
        let (Scratch { rows, d, dd, .. }, data) = (&mut *self.scratch, &self.state.data.residuals);
        let (g, nv) = (&mut rows.push([d[i], dd[i]]), self.model.nv());
        match residual {
            Residual::ControlGravity => {
                let [by_q, by_v, by_a] = &data.dsurplus;
                add_matrix_row(by_q, i, 1.0, g.q);
                if plan.in_contact {
                    add_matrix_row(by_v, i, 1.0, g.v);
                    (0..nv).for_each(|k| sensitivities.add_row(Output::Acceleration, k, by_a[(i, k)], g)); // M ∂q̈
                } else {
                    sensitivities.add_row(Output::Effort, i, 1.0, g);
                }
            }
            Residual::ImpulseCenterOfMass => {
                let [by_q, Jcom] = &data.dcom_change;
                add_matrix_row(by_q, i, 1.0, g.q);
                (0..nv).for_each(|k| sensitivities.add_row(Output::Acceleration, k, Jcom[(i, k)], g)); // J_c ∂(v⁺ − v)
            }
            Residual::JointEffort { .. } => sensitivities.add_row(Output::Effort, i, 1.0, g),
            Residual::JointAcceleration { .. } => sensitivities.add_row(Output::Acceleration, i, 1.0, g),
            Residual::ContactAcceleration { .. } => {
                sensitivities.add_row(Output::ContactAcceleration, plan.rows.start + i, 1.0, g);
            }
            Residual::UndrivenEffort => {
                for (k, w) in plan.W[i * nv..(i + 1) * nv].iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    sensitivities.add_row(Output::Effort, k, *w, g); // Nᵀ ∂τ
                }
            }
            _ => {
                let rows = plan.rows.len();
                for (k, w) in plan.W[i * rows..(i + 1) * rows].iter().enumerate().filter(|(_, w)| **w != 0.0) {
                    sensitivities.add_row(Output::Force, plan.rows.start + k, *w, g); // W ∂λ
                }
            }
        }
    }

    /// Appends the residual that was just computed to the constraint rows of an LQ knot, with the given bounds. At a
    /// knot in inverse-dynamics form, the columns of the unknowns replace the columns of δu, and the columns of δu
    /// follow. The rows of a cone become a group, whose forms are the components of the force.
    pub(crate) fn push_constraint_rows(
        &mut self,
        residual: &Residual,
        plan: &Plan,
        sensitivities: &dyn Sensitivities,
        [lower, upper]: [&[f64]; 2],
        knot: &mut LqKnot,
    ) {
        let (n, nu) = (knot.ndx(), knot.nu());
        let inverse = knot.structure.is_inverse_dynamics();
        let s = &mut *self.scratch;
        let mut push = |first: usize, entries: &[f64], i: usize, c: f64| {
            knot.rows.push(ConstraintRow { first, entries, c, lower: lower[i], upper: upper[i] });
        };
        match residual {
            Residual::State { .. } => {
                for i in 0..plan.n {
                    let mut row = [0.0; LARGEST_BLOCK];
                    match s.groups.iter().find(|group| group.contains(&i)) {
                        Some(group) => {
                            let (_, D) = self.kinematics.difference(plan, group);
                            for (j, entry) in row[..group.len()].iter_mut().enumerate() {
                                *entry = D[j * group.len() + i - group.start];
                            }
                            push(group.start, &row[..group.len()], i, s.r[i]);
                        }
                        None => push(i, &[1.0], i, s.r[i]),
                    }
                }
            }
            _ if residual.part() == Part::Diagonal => {
                let first = n + if inverse { nu } else { 0 };
                (0..plan.n).for_each(|i| push(first + i, &[1.0], i, s.r[i]));
            }
            _ if residual.output() == Some(Output::Force)
                && (1..=MOST_FORMS.min(plan.n - 1)).contains(&plan.rows.len())
                && nu > 0 =>
            {
                s.clear();
                for (k, row) in plan.rows.clone().enumerate() {
                    sensitivities.add_row(Output::Force, row, 1.0, &mut s.rows.push([1.0, 0.0]));
                    knot.rows.push_form(0, s.rows.of_knot(k));
                }
                let numbers = (0..plan.n).map(|i| [s.r[i], lower[i], upper[i]]);
                knot.rows.push_group(&plan.W, numbers);
            }
            _ if residual.part() == Part::Positions && residual.is_kinematic() => {
                let rows = self.kinematics.rows(self.model.nv(), residual, plan);
                rows.enumerate().for_each(|(i, row)| push(0, row, i, s.r[i]));
            }
            _ => {
                s.clear();
                s.d[..plan.n].fill(1.0); // every row is needed, inside its bounds too
                self.push_rows(residual, plan, sensitivities);
                let s = &mut *self.scratch;
                (0..plan.n).for_each(|i| push(0, s.rows.of_knot(i), i, s.r[i]));
            }
        }
    }

    /// Adds the gradient and Hessian of the residual that was computed last, which is a residual of the state or the
    /// controls.
    pub(crate) fn add_diagonal(&mut self, residual: &Residual, plan: &Plan, knot: &mut LqKnot) {
        match residual {
            Residual::State { .. } => self.add_state(plan, knot),
            _ => add_control_diagonal(knot, &self.scratch.d, &self.scratch.dd),
        }
    }

    /// Adds the gradient and Hessian of a residual of the state, whose ∂r/∂x is the identity except in the blocks of
    /// groups.
    fn add_state(&mut self, plan: &Plan, knot: &mut LqKnot) {
        let Self { model, kinematics, scratch: s, .. } = self;
        let nv = model.nv();
        let mut from = 0;
        for group in s.groups.iter().cloned().chain(core::iter::once(2 * nv..2 * nv)) {
            add_state_diagonal(knot, from..group.start, &s.d, &s.dd);
            from = group.end;
        }
        for group in &s.groups {
            let (slopes, (_, D)) = ([&s.d[group.clone()], &s.dd[group.clone()]], kinematics.difference(plan, group));
            let q = &mut knot.q.as_mut_slice()[group.clone()];
            let Q = &mut knot.Q.as_mut_slice()[group.start * (2 * nv + 1)..];
            at_level(AddGroup { D, slopes, q, Q, n: 2 * nv });
        }
    }
}

/// Length of a row of a block, padded with zeros to a whole register.
const PADDED: usize = 8;

/// Sum q += Dᵀ a′ and Q += Dᵀ a″ D for a group with the Jacobian D, which is stored column after column. The
/// derivatives of the activation are a′ and a″, and n is the number of rows of Q.
struct AddGroup<'a> {
    D: &'a [f64],
    slopes: [&'a [f64]; 2],
    q: &'a mut [f64],
    Q: &'a mut [f64],
    n: usize,
}

impl Vectorized for AddGroup<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { D, slopes: [d, dd], q, Q, n } = self;
        let size = d.len();
        let mut rows = [[0.0; PADDED]; LARGEST_BLOCK];
        for a in 0..size {
            for i in 0..size {
                rows[i][a] = D[a * size + i];
            }
        }
        let (mut g, mut H) = ([0.0; PADDED], [[0.0; PADDED]; LARGEST_BLOCK]);
        for i in 0..size {
            let row = rows[i];
            for b in 0..PADDED {
                g[b] += row[b] * d[i];
            }
            for a in 0..LARGEST_BLOCK {
                let weighted = dd[i] * row[a];
                for b in 0..PADDED {
                    H[a][b] += weighted * row[b];
                }
            }
        }
        for a in 0..size {
            q[a] += g[a];
            let column = &mut Q[a * n..][..size];
            for b in 0..size {
                column[b] += H[a][b];
            }
        }
    }
}
