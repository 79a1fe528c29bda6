//! Residuals as they are computed, with the rows of their Jacobians; costs and limits say what these are worth.

use super::contact::coordinates_of;
use super::quadratic::{add_control_diagonal, add_state_diagonal};
use super::residual::{Part, Residual};
use super::state::state_difference;
use super::watch::{Needs, Offer, Scene, Scratch, Signal, Slopes, add_matrix_row};
use crate::lq::LqNode;
use condyle_dynamics::{
    DifferenceArgument, Model, Motion, Placements, Quaternion, ReferenceFrame, Vec3, Velocities, difference_jacobian,
    lie,
};
use core::ops::Range;

/// A residual as it is computed.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// How many numbers it has.
    pub n: usize,
    /// The coordinates that move its frame, in order.
    columns: Vec<usize>,
    /// Where its contact's rows stand in λ.
    rows: Range<usize>,
    /// W of a residual W f.
    W: Vec<f64>,
}

impl Plan {
    /// Of a residual, or what does not fit the robot and what its action offers.
    pub(super) fn new(model: &Model, offer: &Offer, residual: &Residual) -> Result<Self, String> {
        let n = residual.check(model, offer)?;
        let columns = coordinates_of(model, residual.frame());
        let rows = residual.contact().map_or(Ok(0..0), |name| offer.contact(name))?;
        Ok(Self { n, columns, W: residual.force_rows(rows.len()), rows })
    }
}

/// What the residuals of a knot take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Room {
    /// The most numbers that one of them has.
    pub longest: usize,
    /// How many rows there may be of Jacobians with respect to (u, v, q), and to q alone.
    pub rows: [usize; 2],
    /// Whether one looks at forces.
    pub forces: bool,
    pub needs: Needs,
}

impl Room {
    /// Of one.
    pub(super) fn of(residual: &Residual, plan: &Plan) -> Self {
        let rows = match residual.part() {
            Part::All => [plan.n, 0],
            Part::Positions => [0, plan.n],
            Part::Diagonal => [0, 0],
        };
        let forces = residual.signal() == Some(Signal::Force);
        Self { longest: plan.n, rows, forces, needs: needs_of(residual) }
    }

    /// Of knots of either kind.
    pub(super) fn or(self, other: Self) -> Self {
        let [a, b] = [self.rows, other.rows];
        Self { rows: [a[0].max(b[0]), a[1].max(b[1])], ..self + other }
    }
}

impl core::ops::Add for Room {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let [a, b] = [self.rows, other.rows];
        Self {
            longest: self.longest.max(other.longest),
            rows: [a[0] + b[0], a[1] + b[1]],
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

fn needs_of(residual: &Residual) -> Needs {
    let mut needs = Needs::default();
    match residual {
        Residual::ControlGravity => needs.surplus = true,
        Residual::CenterOfMass { .. } => (needs.com, needs.placements) = (true, true),
        Residual::CentroidalMomentum { .. } => (needs.momentum, needs.velocities) = (true, true),
        Residual::FrameVelocity { .. } => needs.velocities = true,
        Residual::ImpulseCenterOfMass => needs.impulse_com = true,
        _ => needs.placements = residual.frame().is_some(),
    }
    needs
}

/// A knot and its kinematics, as its residuals look at them.
pub(super) struct View<'a> {
    pub model: &'a Model,
    pub scene: &'a Scene<'a>,
    pub placements: Option<Placements<'a, f64>>,
    pub velocities: Option<Velocities<'a, f64>>,
    pub scratch: &'a mut Scratch,
}

impl View<'_> {
    /// r of one residual, in the scratch.
    pub(super) fn residual(&mut self, residual: &Residual, plan: &Plan) {
        let Self { model, scene, placements, velocities, scratch: s } = self;
        let r = &mut s.r[..plan.n];
        let minus = |r: &mut [f64], a: &[f64], b: &[f64]| (0..r.len()).for_each(|i| r[i] = a[i] - b[i]);
        match (residual, placements) {
            (Residual::State { reference }, _) => state_difference(model, reference, scene.x, r), // x ⊖ x_ref
            (Residual::Control { reference }, _) => minus(r, scene.u, reference),
            (Residual::ControlGravity, _) => r.copy_from_slice(&s.surplus),
            (Residual::JointEffort { reference }, _) => minus(r, scene.tau, reference),
            (Residual::JointAcceleration { reference }, _) => minus(r, scene.a, reference),
            (Residual::ImpulseCenterOfMass, _) => r.copy_from_slice(&s.com_change),
            (Residual::ContactForce { target, .. }, _) => {
                minus(r, &scene.lambda[plan.rows.clone()], &target.to_array());
            }
            (Residual::FrictionCone { .. } | Residual::WrenchCone { .. } | Residual::CenterOfPressure { .. }, _) => {
                let f = &scene.lambda[plan.rows.clone()];
                for (r, row) in r.iter_mut().zip(plan.W.chunks_exact(f.len())) {
                    *r = row.iter().zip(f).map(|(w, f)| w * f).sum(); // W f
                }
            }
            (Residual::CenterOfMass { target }, Some(placed)) => {
                r.copy_from_slice(&(placed.com() - *target).to_array());
            }
            (Residual::FramePlacement { frame, target }, Some(placed)) => {
                let X = target.inverse() * placed.frame(*frame);
                let log = lie::log6(Quaternion::from_rotation(X.rotation), X.translation); // log(refXo oXf)
                r.copy_from_slice(&log.to_array());
            }
            (Residual::FrameTranslation { frame, target }, Some(placed)) => {
                r.copy_from_slice(&(placed.frame(*frame).translation - *target).to_array());
            }
            (Residual::FrameRotation { frame, target }, Some(placed)) => {
                let R = target.transpose() * placed.frame(*frame).rotation;
                r.copy_from_slice(&lie::log3(Quaternion::from_rotation(R)).to_array()); // log(R_refᵀ R)
            }
            (Residual::FrameVelocity { frame, target, reference }, _) => {
                let motion = velocities.expect("velocities are computed where a residual needs them");
                r.copy_from_slice(&(motion.frame_velocity(*frame, *reference) - *target).to_array());
            }
            (Residual::CentroidalMomentum { target }, _) => {
                let motion = velocities.expect("velocities are computed where a residual needs them");
                r.copy_from_slice(&(motion.centroidal_momentum() - *target).to_array());
            }
            (_, None) => unreachable!("placements are computed where a residual needs them"),
        }
    }

    /// The rows of the Jacobian of a residual that was just computed, with its worth's slopes d and curvatures dd; unless
    /// it is the identity: then see [`add_diagonal`](Self::add_diagonal).
    pub(super) fn push_rows(&mut self, residual: &Residual, plan: &Plan, slopes: &dyn Slopes) {
        let n = plan.n;
        match residual {
            Residual::CenterOfMass { .. } => {
                let s = &mut *self.scratch;
                s.rows.push_positions(s.com[0].as_slice(), 3, &s.all, &s.d[..n], &s.dd[..n]);
            }
            Residual::FramePlacement { .. } | Residual::FrameTranslation { .. } | Residual::FrameRotation { .. } => {
                self.frame_jacobian(residual, plan);
                let s = &mut *self.scratch;
                s.rows.push_positions(s.J.as_slice(), 6, &plan.columns, &s.d[..n], &s.dd[..n]);
            }
            residual => {
                let s = &mut *self.scratch;
                if let (Residual::FrameVelocity { frame, reference, .. }, Some(motion)) = (residual, &self.velocities) {
                    motion.frame_velocity_derivative(*frame, *reference, &mut s.J);
                    motion.frame_jacobian(*frame, *reference, &mut s.Jv);
                }
                for i in 0..n {
                    if s.d[i] == 0.0 && s.dd[i] == 0.0 {
                        continue; // a cone's row that is not active
                    }
                    add_slope_row(residual, plan, i, slopes, self.model.nv(), s);
                }
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

    /// ∂r/∂q of a frame's term, whose r was just computed, in `s.J`.
    fn frame_jacobian(&mut self, residual: &Residual, plan: &Plan) {
        let s = &mut *self.scratch;
        let placed = self.placements.as_ref().expect("placements are computed where a residual needs them");
        let J = &mut s.J;
        match *residual {
            Residual::FramePlacement { frame, .. } => {
                placed.frame_jacobian(frame, ReferenceFrame::Local, J);
                let Jlog = lie::jlog6(Motion::from([s.r[0], s.r[1], s.r[2], s.r[3], s.r[4], s.r[5]]));
                for &c in &plan.columns {
                    let column = &mut J.as_mut_slice()[6 * c..6 * c + 6];
                    let m = [column[0], column[1], column[2], column[3], column[4], column[5]];
                    column.copy_from_slice(&(Jlog * Motion::from(m)).to_array()); // Jlog J
                }
            }
            Residual::FrameRotation { frame, .. } => {
                placed.frame_jacobian(frame, ReferenceFrame::Local, J);
                let Jlog = lie::jlog3(Vec3::new(s.r[0], s.r[1], s.r[2]));
                for &c in &plan.columns {
                    let column = &mut J.as_mut_slice()[6 * c..6 * c + 6];
                    let turned = Jlog * Vec3::new(column[3], column[4], column[5]);
                    column[..3].copy_from_slice(&turned.to_array());
                }
            }
            Residual::FrameTranslation { frame, .. } => {
                placed.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, J);
            }
            _ => unreachable!("not a frame's pose"),
        }
    }
}

/// Row i of ∂r/∂(u, v, q) of a residual that depends on more than q, to the others.
fn add_slope_row(residual: &Residual, plan: &Plan, i: usize, slopes: &dyn Slopes, nv: usize, s: &mut Scratch) {
    let Scratch { rows, d, dd, J, Jv, momentum, com, surplus_slopes, .. } = s;
    let g = &mut rows.push(d[i], dd[i]);
    match residual {
        Residual::FrameVelocity { .. } => {
            add_matrix_row(J, i, 1.0, g.q);
            add_matrix_row(Jv, i, 1.0, g.v);
        }
        Residual::CentroidalMomentum { .. } => {
            add_matrix_row(&momentum[0], i, 1.0, g.q);
            add_matrix_row(&momentum[1], i, 1.0, g.v);
        }
        Residual::ControlGravity => {
            add_matrix_row(&surplus_slopes[0], i, 1.0, g.q);
            add_matrix_row(&surplus_slopes[1], i, 1.0, g.v);
            (0..nv).for_each(|k| slopes.add_row(Signal::Acceleration, k, surplus_slopes[2][(i, k)], g)); // M ∂q̈
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
