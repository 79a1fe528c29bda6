//! Residuals as they are computed, with the rows of their Jacobians; costs and limits say what these are worth.

use super::quadratic::{add_control_diagonal, add_state_diagonal};
use super::residual::{Part, Residual};
use super::sight::{Seat, Sight, seen_rows};
use super::state::state_difference;
use super::watch::{Needs, Offer, Scene, Scratch, Signal, Slopes, add_matrix_row};
use crate::lq::LqNode;
use condyle_dynamics::{DifferenceArgument, Model, difference_jacobian};
use core::ops::Range;

/// A residual as it is computed.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// How many numbers it has.
    pub n: usize,
    /// Its seat among those that look at kinematics.
    pub seat: Seat,
    /// Where its contact's rows stand in λ.
    rows: Range<usize>,
    /// Whether its knot has contacts.
    touching: bool,
    /// W of a residual W f.
    W: Vec<f64>,
}

impl Plan {
    /// Of a residual, or what does not fit the robot and what its action offers.
    pub(super) fn new(model: &Model, offer: &Offer, residual: &Residual) -> Result<Self, String> {
        let n = residual.check(model, offer)?;
        let rows = residual.contact().map_or(Ok(0..0), |name| offer.contact(name))?;
        let touching = !offer.contacts.is_empty();
        Ok(Self { n, seat: Seat::default(), touching, W: residual.force_rows(rows.len()), rows })
    }
}

/// What the residuals of a knot take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Room {
    /// The most numbers that one of them has.
    pub longest: usize,
    /// How many rows there may be of Jacobians with respect to (u, v, q), and to q alone.
    pub rows: [usize; 2],
    /// How many look at kinematics, and how many numbers their rows have.
    pub seen: [usize; 2],
    /// Whether one looks at forces.
    pub forces: bool,
    pub needs: Needs,
}

impl Room {
    /// Of one.
    pub(super) fn of(nv: usize, residual: &Residual, plan: &Plan) -> Self {
        let rows = match residual.part() {
            Part::All => [plan.n, 0],
            Part::Positions => [0, plan.n],
            Part::Diagonal => [0, 0],
        };
        let forces = residual.signal() == Some(Signal::Force);
        let seen = if residual.is_seen() { [1, seen_rows(nv, residual, plan.n)] } else { [0, 0] };
        Self { longest: plan.n, rows, seen, forces, needs: needs_of(residual, plan.touching) }
    }

    /// Of knots of either kind.
    pub(super) fn or(self, other: Self) -> Self {
        let most = |a: [usize; 2], b: [usize; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        Self { rows: most(self.rows, other.rows), seen: most(self.seen, other.seen), ..self + other }
    }
}

impl core::ops::Add for Room {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sum = |a: [usize; 2], b: [usize; 2]| [a[0] + b[0], a[1] + b[1]];
        Self {
            longest: self.longest.max(other.longest),
            rows: sum(self.rows, other.rows),
            seen: sum(self.seen, other.seen),
            forces: self.forces | other.forces,
            needs: self.needs | other.needs,
        }
    }
}

impl core::iter::Sum for Room {
    fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
        all.fold(Self::default(), |a, b| a + b)
    }
}

fn needs_of(residual: &Residual, touching: bool) -> Needs {
    let mut needs = Needs::default();
    match residual {
        Residual::ControlGravity => (needs.gravity, needs.inertia) = (true, touching),
        Residual::CenterOfMass { .. } => (needs.com, needs.placements) = (true, true),
        Residual::CentroidalMomentum { .. } => (needs.momentum, needs.velocities) = (true, true),
        Residual::FrameVelocity { .. } => needs.velocities = true,
        Residual::ImpulseCenterOfMass => needs.impulse_com = true,
        _ => needs.placements = residual.frame().is_some(),
    }
    needs
}

/// A knot as its residuals look at it.
pub(super) struct View<'a> {
    pub model: &'a Model,
    pub scene: &'a Scene<'a>,
    /// What those see that look at kinematics.
    pub sight: Sight<'a>,
    pub scratch: &'a mut Scratch,
}

impl View<'_> {
    /// r of one residual, in the scratch.
    pub(super) fn residual(&mut self, residual: &Residual, plan: &Plan) {
        let Self { model, scene, sight, scratch: s } = self;
        let r = &mut s.r[..plan.n];
        let minus = |r: &mut [f64], a: &[f64], b: &[f64]| (0..r.len()).for_each(|i| r[i] = a[i] - b[i]);
        match residual {
            Residual::State { reference } => state_difference(model, reference, scene.x, r), // x ⊖ x_ref
            Residual::Control { reference } => minus(r, scene.u, reference),
            Residual::ControlGravity => {
                r.copy_from_slice(sight.surplus);
                if !plan.touching {
                    r.iter_mut().zip(scene.tau).for_each(|(r, tau)| *r += tau); // τ − g
                }
            }
            Residual::JointEffort { reference } => minus(r, scene.tau, reference),
            Residual::JointAcceleration { reference } => minus(r, scene.a, reference),
            Residual::ImpulseCenterOfMass => r.copy_from_slice(&s.com_change),
            Residual::ContactForce { target, .. } => {
                minus(r, &scene.lambda[plan.rows.clone()], &target.to_array());
            }
            Residual::FrictionCone { .. } | Residual::WrenchCone { .. } | Residual::CenterOfPressure { .. } => {
                let f = &scene.lambda[plan.rows.clone()];
                for (r, row) in r.iter_mut().zip(plan.W.chunks_exact(f.len())) {
                    *r = row.iter().zip(f).map(|(w, f)| w * f).sum(); // W f
                }
            }
            _ => r.copy_from_slice(sight.residual(plan)),
        }
    }

    /// The rows of the Jacobian of a residual that was just computed, with its worth's slopes d and curvatures dd; unless
    /// it is the identity: then see [`add_diagonal`](Self::add_diagonal).
    pub(super) fn push_rows(&mut self, residual: &Residual, plan: &Plan, slopes: &dyn Slopes) {
        let (s, nv) = (&mut *self.scratch, self.model.nv());
        let worth = s.d.iter().zip(&s.dd).map(|(d, dd)| [*d, *dd]);
        if residual.part() == Part::Positions {
            for (row, worth) in self.sight.rows(nv, residual, plan).zip(worth) {
                s.rows.push_positions(row, worth);
            }
            return;
        }
        let active = |worth: &[f64; 2]| *worth != [0.0, 0.0]; // not so a cone's row inside
        if residual.is_seen() {
            let rows = self.sight.rows(nv, residual, plan).zip(worth);
            for (row, worth) in rows.filter(|(_, worth)| active(worth)) {
                let g = s.rows.push(worth);
                g.v.copy_from_slice(&row[..nv]);
                g.q.copy_from_slice(&row[nv..]);
            }
            return;
        }
        for i in 0..plan.n {
            if active(&[s.d[i], s.dd[i]]) {
                add_slope_row(residual, plan, i, slopes, self.sight, nv, s);
            }
        }
    }

    /// Gradient and Hessian of a state's or a control's residual that was just computed.
    pub(super) fn add_diagonal(&mut self, residual: &Residual, node: &mut LqNode) {
        match residual {
            Residual::State { .. } => self.add_state(node),
            _ => {
                let Scratch { d, dd, .. } = &*self.scratch;
                add_control_diagonal(node, d, dd);
            }
        }
    }

    /// Gradient and Hessian of a state's term: ∂r/∂x is the identity but for the groups' blocks of q.
    fn add_state(&mut self, node: &mut LqNode) {
        let Self { model, scratch: s, .. } = self;
        let nv = model.nv();
        let mut from = 0;
        for group in s.groups.iter().cloned().chain(core::iter::once(2 * nv..2 * nv)) {
            add_state_diagonal(node, from..group.start, &s.d, &s.dd);
            from = group.end;
        }
        if s.groups.is_empty() {
            return;
        }
        difference_jacobian(model, &s.r[..nv], DifferenceArgument::To, &mut s.D);
        for group in &s.groups {
            let (start, size) = (group.start, group.len());
            let mut D = [[0.0; 6]; 6]; // row by row
            for i in 0..size {
                for a in 0..size {
                    D[i][a] = s.D[(start + i, start + a)];
                }
            }
            for i in 0..size {
                let (d, dd) = (s.d[start + i], s.dd[start + i]);
                for a in 0..size {
                    node.q[start + a] += D[i][a] * d; // Dᵀ a′
                    let column = &mut node.Q.as_mut_slice()[(start + a) * 2 * nv + start..][..size];
                    for b in 0..size {
                        column[b] += dd * (D[i][a] * D[i][b]); // Dᵀ a″ D
                    }
                }
            }
        }
    }
}

/// Row i of ∂r/∂(u, v, q) of a residual that depends on more than q, to the others.
fn add_slope_row(
    residual: &Residual,
    plan: &Plan,
    i: usize,
    slopes: &dyn Slopes,
    sight: Sight<'_>,
    nv: usize,
    s: &mut Scratch,
) {
    let Scratch { rows, d, dd, com, .. } = s;
    let g = &mut rows.push([d[i], dd[i]]);
    match residual {
        Residual::ControlGravity => {
            let [by_q, by_v, by_a] = sight.surplus_slopes;
            add_matrix_row(by_q, i, 1.0, g.q);
            if plan.touching {
                add_matrix_row(by_v, i, 1.0, g.v);
                (0..nv).for_each(|k| slopes.add_row(Signal::Acceleration, k, by_a[(i, k)], g)); // M ∂q̈
            } else {
                slopes.add_row(Signal::Effort, i, 1.0, g);
            }
        }
        Residual::ImpulseCenterOfMass => {
            add_matrix_row(&com[1], i, 1.0, g.q);
            (0..nv).for_each(|k| slopes.add_row(Signal::Acceleration, k, com[0][(i, k)], g)); // J_c ∂(v⁺ − v)
        }
        Residual::JointEffort { .. } => slopes.add_row(Signal::Effort, i, 1.0, g),
        Residual::JointAcceleration { .. } => slopes.add_row(Signal::Acceleration, i, 1.0, g),
        _ => {
            let rows = plan.rows.len();
            for (k, w) in plan.W[i * rows..(i + 1) * rows].iter().enumerate().filter(|(_, w)| **w != 0.0) {
                slopes.add_row(Signal::Force, plan.rows.start + k, *w, g); // W ∂λ
            }
        }
    }
}
