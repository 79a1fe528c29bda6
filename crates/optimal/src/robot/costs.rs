//! Costs of a robot's state and control: weighted sums of activations of residuals.

use super::activation::Activation;
use super::contact::coordinates_of;
use super::quadratic::add_diagonal;
use super::residual::{Part, Residual};
use super::state::{groups, state_difference};
use super::watch::{Needs, Offer, Scene, Scratch, Signal, Slopes, Watch, add_matrix_row};
use crate::Error;
use crate::lq::LqNode;
use condyle_dynamics::{
    DifferenceArgument, Model, Motion, Placements, Quaternion, ReferenceFrame, Vec3, Velocities, difference_jacobian,
    lie,
};
use core::ops::Range;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A term w · a(r(x, u)) of a cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cost {
    /// How it is called.
    pub name: String,
    /// w; a term whose weight is 0 is not computed.
    pub weight: f64,
    /// r.
    pub residual: Residual,
    /// a.
    pub activation: Activation,
}

impl Cost {
    /// The term `weight` · activation(residual), called `name`.
    pub fn new(name: &str, weight: f64, residual: Residual, activation: Activation) -> Self {
        Self { name: name.to_owned(), weight, residual, activation }
    }
}

/// A sum of terms, called by their names.
///
/// Derivatives are exact; second derivatives are Gauss–Newton's, w (∂r)ᵀ a″ ∂r. Kinematics that several terms look at
/// are computed once for a knot, and only where a Jacobian is not zero is anything added.
#[derive(Clone, Debug)]
pub struct Costs {
    model: Arc<Model>,
    offer: Offer,
    terms: Vec<Cost>,
    plans: Vec<Plan>,
    groups: Vec<Range<usize>>,
    /// All coordinates.
    all: Vec<usize>,
}

/// A term as it is computed.
#[derive(Clone, Debug)]
struct Plan {
    /// How many numbers its residual has.
    n: usize,
    /// The coordinates that move its frame, in order.
    columns: Vec<usize>,
    /// Where its contact's rows stand in λ.
    rows: Range<usize>,
    /// W of a residual W f.
    W: Vec<f64>,
}

impl Plan {
    fn new(model: &Model, offer: &Offer, term: &Cost) -> Result<Self, Error> {
        let wrong = |what: String| Error::Cost { name: term.name.clone(), what };
        let n = term.residual.check(model, offer).map_err(wrong)?;
        if !term.weight.is_finite() {
            return Err(wrong(format!("its weight is {}", term.weight)));
        }
        if let Some(what) = term.activation.wrong(n) {
            return Err(wrong(what));
        }
        let columns = coordinates_of(model, term.residual.frame());
        let rows = term.residual.contact().map_or(Ok(0..0), |name| offer.contact(name)).map_err(wrong)?;
        Ok(Self { n, columns, W: term.residual.force_rows(rows.len()), rows })
    }
}

impl Costs {
    /// The sum of some terms for a robot whose dynamics offer some signals.
    pub(super) fn new(model: Arc<Model>, offer: Offer, terms: Vec<Cost>) -> Result<Self, Error> {
        for (k, term) in terms.iter().enumerate() {
            if terms[..k].iter().any(|t| t.name == term.name) {
                let what = "another term has this name".to_owned();
                return Err(Error::Cost { name: term.name.clone(), what });
            }
        }
        let plans = terms.iter().map(|term| Plan::new(&model, &offer, term)).collect::<Result<_, _>>()?;
        Ok(Self { groups: groups(&model), all: (0..model.nv()).collect(), model, offer, terms, plans })
    }

    /// The terms.
    pub fn terms(&self) -> &[Cost] {
        &self.terms
    }

    /// Changes the weight of the term called `name`, between solves; says whether there is one.
    pub fn set_weight(&mut self, name: &str, weight: f64) -> bool {
        let term = self.terms.iter_mut().find(|t| t.name == name);
        term.map(|t| t.weight = weight).is_some()
    }

    /// Changes what the term called `name` looks at, between solves: its target, for example. Allocates.
    ///
    /// # Errors
    /// [`Error::Cost`] if there is no such term, the residual does not fit the robot, or it has another number of
    /// entries than the one before.
    pub fn set_residual(&mut self, name: &str, residual: Residual) -> Result<(), Error> {
        let wrong = |what: &str| Error::Cost { name: name.to_owned(), what: what.to_owned() };
        let k = self.terms.iter().position(|t| t.name == name).ok_or_else(|| wrong("there is no such term"))?;
        let term = Cost { residual, ..self.terms[k].clone() };
        let plan = Plan::new(&self.model, &self.offer, &term)?;
        let kind = |term: &Cost| (Self::needs_of(term), term.residual.part());
        if plan.n != self.plans[k].n || kind(&term) != kind(&self.terms[k]) {
            return Err(wrong("its residual is of another kind than before"));
        }
        (self.terms[k], self.plans[k]) = (term, plan);
        Ok(())
    }

    /// The most numbers that one of its residuals has.
    pub(super) fn longest(&self) -> usize {
        self.plans.iter().map(|plan| plan.n).max().unwrap_or(0)
    }

    /// How many rows there may be of Jacobians with respect to (u, v, q), and to q alone.
    pub(super) fn rows(&self) -> [usize; 2] {
        let rows = |part| {
            let of = |(term, plan): (&Cost, &Plan)| if term.residual.part() == part { plan.n } else { 0 };
            self.terms.iter().zip(&self.plans).map(of).sum()
        };
        [rows(Part::All), rows(Part::Positions)]
    }

    /// Whether a residual looks at forces.
    pub(super) fn look_at_forces(&self) -> bool {
        self.terms.iter().any(|term| term.residual.signal() == Some(Signal::Force))
    }

    fn needs_of(term: &Cost) -> Needs {
        let mut needs = Needs::default();
        match term.residual {
            Residual::ControlGravity => needs.surplus = true,
            Residual::CenterOfMass { .. } => (needs.com, needs.placements) = (true, true),
            Residual::CentroidalMomentum { .. } => (needs.momentum, needs.velocities) = (true, true),
            Residual::FrameVelocity { .. } => needs.velocities = true,
            Residual::ImpulseCenterOfMass => needs.impulse_com = true,
            _ => needs.placements = term.residual.frame().is_some(),
        }
        needs
    }

    /// What its residuals look at, whatever their weights.
    pub(super) fn needs(&self) -> Needs {
        self.terms.iter().map(Self::needs_of).fold(Needs::default(), |a, b| a | b)
    }

    /// Σ w a(r(x, u)).
    pub(super) fn calc(&self, watch: &mut Watch, scene: &Scene<'_>) -> f64 {
        let (placements, velocities, s) = watch.look(&self.model, self.needs(), scene, false);
        let mut sum = 0.0;
        for (term, plan) in self.terms.iter().zip(&self.plans).filter(|(term, _)| term.weight != 0.0) {
            self.residual(term, plan, scene, placements, velocities, s);
            sum += term.weight * term.activation.value(&s.r[..plan.n]);
        }
        sum
    }

    /// Writes gradient and Hessian of `scale` · Σ w a(r(x, u)) into q, r, Q, S, R of the node.
    pub(super) fn calc_diff(
        &self,
        watch: &mut Watch,
        scene: &Scene<'_>,
        slopes: &dyn Slopes,
        scale: f64,
        node: &mut LqNode,
    ) {
        let (placements, velocities, s) = watch.look(&self.model, self.needs(), scene, true);
        s.rows.clear();
        let terms = || self.terms.iter().zip(&self.plans).filter(|(term, _)| term.weight != 0.0);
        for (term, plan) in terms().filter(|(term, _)| term.residual.part() != Part::Diagonal) {
            self.slopes_of(term, plan, scene, placements, velocities, scale, s);
            let n = plan.n;
            match &term.residual {
                Residual::CenterOfMass { .. } => {
                    s.rows.push_positions(s.com[0].as_slice(), 3, &self.all, &s.d[..n], &s.dd[..n]);
                }
                Residual::FramePlacement { .. }
                | Residual::FrameTranslation { .. }
                | Residual::FrameRotation { .. } => {
                    self.frame_jacobian(term, plan, placements, s);
                    s.rows.push_positions(s.J.as_slice(), 6, &plan.columns, &s.d[..n], &s.dd[..n]);
                }
                residual => {
                    if let (Residual::FrameVelocity { frame, reference, .. }, Some(motion)) = (residual, velocities) {
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
        s.rows.write(node);
        for (term, plan) in terms().filter(|(term, _)| term.residual.part() == Part::Diagonal) {
            self.slopes_of(term, plan, scene, placements, velocities, scale, s);
            match term.residual {
                Residual::State { .. } => self.add_state(s, node),
                _ => add_diagonal(node.r.as_mut_slice(), node.R.as_mut_slice(), 0..plan.n, &s.d, &s.dd),
            }
        }
    }

    /// The residual of a term and `scale` · w times the derivatives of its activation, in `s.r`, `s.d`, `s.dd`.
    fn slopes_of(
        &self,
        term: &Cost,
        plan: &Plan,
        scene: &Scene<'_>,
        placements: Option<Placements<'_, f64>>,
        velocities: Option<Velocities<'_, f64>>,
        scale: f64,
        s: &mut Scratch,
    ) {
        self.residual(term, plan, scene, placements, velocities, s);
        term.activation.derivatives(&s.r[..plan.n], &mut s.d, &mut s.dd);
        let weight = scale * term.weight;
        s.d[..plan.n].iter_mut().chain(&mut s.dd[..plan.n]).for_each(|d| *d *= weight);
    }

    /// r of one term, in `s.r`.
    fn residual(
        &self,
        term: &Cost,
        plan: &Plan,
        scene: &Scene<'_>,
        placements: Option<Placements<'_, f64>>,
        velocities: Option<Velocities<'_, f64>>,
        s: &mut Scratch,
    ) {
        let r = &mut s.r[..plan.n];
        let minus = |r: &mut [f64], a: &[f64], b: &[f64]| (0..r.len()).for_each(|i| r[i] = a[i] - b[i]);
        match (&term.residual, placements) {
            (Residual::State { reference }, _) => state_difference(&self.model, reference, scene.x, r), // x ⊖ x_ref
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

    /// Gradient and Hessian of a state's term: ∂r/∂x is the identity but for the groups' blocks of q.
    fn add_state(&self, s: &mut Scratch, node: &mut LqNode) {
        let nv = self.model.nv();
        let mut from = 0;
        for group in self.groups.iter().cloned().chain(core::iter::once(2 * nv..2 * nv)) {
            add_diagonal(node.q.as_mut_slice(), node.Q.as_mut_slice(), from..group.start, &s.d, &s.dd);
            from = group.end;
        }
        if self.groups.is_empty() {
            return;
        }
        difference_jacobian(&self.model, &s.r[..nv], DifferenceArgument::To, &mut s.D);
        for group in &self.groups {
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
    fn frame_jacobian(&self, term: &Cost, plan: &Plan, placements: Option<Placements<'_, f64>>, s: &mut Scratch) {
        let placed = placements.expect("placements are computed where a residual needs them");
        let J = &mut s.J;
        match term.residual {
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
