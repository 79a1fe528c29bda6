//! Dynamics of a robot, for all kinds of dynamics: accelerations, costs and limits for a group of knots.
#![allow(non_snake_case)] // names follow the literature: J

mod across;
mod curvature;

use self::across::with_targets;
use super::batch::{DynamicsKind, Group, KnotBatch, LaneTerms, Long, Short};
use super::group_kernel::BLOCK;
use super::impact::Impact;
use super::kkt_elimination::{KktElimination, Tableau};
use super::limb_elimination::LimbElimination;
use super::sensitivities::DynamicsSensitivities;
use super::shared_data::SharedData;
use super::still::Still;
use crate::error::assert_length;
use crate::lq::LqKnot;
use crate::problem::{Evaluation, innermost};
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, SHARED, check_contacts, constraint_set, moved_by};
use crate::robot::continuous::{Derivatives, KnotInput};
use crate::robot::costs::Cost;
use crate::robot::horizon::HorizonTerms;
use crate::robot::knot_data::{KnotData, KnotState, OnDemand, WIDEST};
use crate::robot::outputs::{Capabilities, Output};
use crate::robot::state::{GroupHessian, groups};
use crate::{ActionModel, Error};
use condyle_dynamics::level::{Level, level};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, IntegrateArgument, Model, constrained_inverse_dynamics, gravity, integrate,
    integrate_jacobian_groups, neutral,
};
use condyle_linalg::Aligned;
use condyle_spatial::Scalar;
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// Maximum number of postures that are tried in the search for a regular posture.
const POSTURES: usize = 8;
/// Smallest number of knots that are computed in one batch; fewer knots are computed one by one.
const WORTHWHILE: usize = 3;

/// Robot with its actuation, the kind of its dynamics, and the costs and limits of its knots.
#[derive(Clone, Debug)]
pub(crate) struct RobotDynamics {
    pub(crate) model: Arc<Model>,
    pub(crate) actuation: Actuation,
    pub(crate) terms: HorizonTerms,
    kind: DynamicsKind,
    /// Output of the dynamics that the controls drive.
    given: Output,
    capabilities: Capabilities,
    /// Coordinates of each group of positions that is not a vector space.
    pub(crate) groups: Vec<Range<usize>>,
    shared: SharedData,
    work: OnDemand<Work>,
}

/// Returns the robot of an action. For an action that wraps another action, this is the robot of the wrapped action.
pub(crate) fn robot_of(action: &mut dyn ActionModel) -> Option<&mut RobotDynamics> {
    innermost(action)?.dynamics()?.downcast_mut()
}

/// References to the fields of [`RobotDynamics`], with a workspace that has been allocated.
struct Parts<'a> {
    model: &'a Arc<Model>,
    actuation: &'a Actuation,
    terms: &'a mut HorizonTerms,
    kind: &'a DynamicsKind,
    capabilities: &'a Capabilities,
    groups: &'a [Range<usize>],
    work: &'a mut Work,
}

/// Workspace for the dynamics of knots.
#[derive(Debug)]
struct Work {
    /// Dynamics of one knot.
    single: KnotBatch<f64>,
    vectors: Option<VectorBatches>,
    impact: Option<Impact>,
    /// Data of each knot of a group.
    data: Vec<KnotData>,
    elimination: Option<KktElimination>,
    still: Option<Still>,
    group_hessian: GroupHessian,
    /// Derivatives ∂q̈/∂u. Shape: nv × nu; empty if each control drives one coordinate.
    da_du: Vec<f64>,
}

/// Dynamics of as many knots as the processor's SIMD registers have lanes. For a few trial steps, registers with few
/// lanes are used, because they are faster. Derivatives always use the widest registers: code for short registers would
/// run too rarely to stay in the caches.
#[derive(Debug)]
struct VectorBatches {
    short: KnotBatch<Short>,
    long: Option<KnotBatch<Long>>,
}

/// Returns the number of knots that are computed in one batch.
fn lanes(kind: &DynamicsKind) -> usize {
    match (kind, level()) {
        (DynamicsKind::None | DynamicsKind::Impact { .. }, _) | (_, Level::Baseline) => 1,
        (_, Level::Simd128 | Level::Neon | Level::Avx2) => Short::LANES,
        (_, Level::Avx512) => Long::LANES,
    }
}

impl VectorBatches {
    /// Allocates the workspace for the equations of knots in inverse-dynamics form. Only derivatives use these
    /// equations, and derivatives are computed in the widest registers, so only that batch needs the workspace.
    fn reserve(&mut self, tableau: Tableau, eliminations: Vec<Arc<LimbElimination>>) {
        match &mut self.long {
            Some(long) => long.reserve(tableau, eliminations),
            None => self.short.reserve(tableau, eliminations),
        }
    }

    /// Returns the equations of a knot at a posture at which the limbs can be eliminated. Returns `None` if the search
    /// finds no such posture.
    fn some_equations(&mut self, model: &Model, at: &KnotData) -> Option<Aligned> {
        (0..POSTURES).find_map(|posture| {
            let bend: Vec<f64> = (0..model.nv()).map(|k| 0.5 * ((1 + posture + k) as f64).sin()).collect();
            let (mut at, mut x) = (at.clone(), vec![0.0; model.nq() + model.nv()]);
            integrate(model, &neutral(model), &bend, &mut x[..model.nq()]);
            let to = core::slice::from_mut(&mut at);
            match &mut self.long {
                Some(long) => long.run_equations_at(model, &x, to),
                None => self.short.run_equations_at(model, &x, to),
            }
            (at.eliminations > 0).then_some(at.equations)
        })
    }
}

impl Work {
    #[inline(never)]
    fn new(
        model: &Model,
        actuation: &Actuation,
        kind: &DynamicsKind,
        given: Output,
        capabilities: &Capabilities,
        groups: &[Range<usize>],
        shared: &SharedData,
    ) -> Self {
        let (nv, lanes) = (model.nv(), lanes(kind));
        let mut vectors = (lanes > 1).then(|| {
            let long = (lanes > Short::LANES).then(|| KnotBatch::new(model, kind, shared.long(model)));
            VectorBatches { short: KnotBatch::new(model, kind, shared.short(model)), long }
        });
        let moved_by = match kind {
            DynamicsKind::Free => Some(Vec::new()),
            DynamicsKind::Contact(contacts, _) => Some(moved_by(model, contacts)),
            _ => None,
        };
        // inverse-dynamics form needs SIMD registers, and an actuation in which each control drives one coordinate
        let form = moved_by.filter(|_| vectors.is_some()).zip(actuation.passive());
        let mut data = KnotData::new(nv, capabilities, given);
        data.steps.resize(2 * BLOCK * groups.len(), 0.0);
        let elimination = form.zip(vectors.as_mut()).map(|((moved_by, passive), vectors)| {
            let damped = matches!(kind, DynamicsKind::Contact(_, damping) if *damping != 0.0);
            let tableau = Tableau { nv, rows: capabilities.rows() };
            data.equations.resize(tableau.len());
            let mut elimination = KktElimination::new(nv, passive, &moved_by);
            let eliminations = LimbElimination::new(model, passive, &moved_by, damped, |limbs| {
                elimination.follow(vec![limbs.solved()]);
                vectors.reserve(tableau, vec![limbs.clone()]);
                elimination.base_pivots(&mut vectors.some_equations(model, &data)?)
            });
            elimination.follow(eliminations.iter().map(|elimination| elimination.solved()).collect());
            vectors.reserve(tableau, eliminations);
            elimination
        });
        Self {
            single: KnotBatch::new(model, kind, shared.single(model)),
            vectors,
            impact: Impact::new(model, kind),
            data: vec![data; lanes],
            elimination,
            still: Still::new(model, actuation, kind),
            group_hessian: GroupHessian::new(nv, groups),
            da_du: actuation.scratch(),
        }
    }

    /// Writes a knot of duration Δt = `scale` (s) as equations of inverse dynamics. Returns whether this was possible.
    fn write_equations(
        &mut self,
        terms: &mut HorizonTerms,
        lane: usize,
        KnotInput { t, x, u }: KnotInput<'_>,
        scale: f64,
        knot: &mut LqKnot,
    ) -> bool {
        let Self { data, elimination: Some(elimination), .. } = self else { return false };
        let form = &mut knot.inverse_dynamics;
        let KnotData { equations, eliminations, .. } = &mut data[lane];
        if !elimination.run(equations, *eliminations, scale, form) {
            return false;
        }
        knot.structure.set_inverse_dynamics();
        let lent = form.lend();
        let state = KnotState { x, u, data: &data[lane] };
        terms.calc_diff(t, state, &elimination.sensitivities(&lent, scale), scale, true, knot);
        knot.inverse_dynamics.take_back(lent);
        true
    }
}

impl RobotDynamics {
    /// Creates the dynamics of a robot with an actuation and a kind of dynamics.
    ///
    /// # Errors
    /// [`Error::Contact`] for contacts that do not fit the robot; [`Error::Cost`] for a cost term that does not fit the
    /// robot; [`Error::Actuation`] for the actuation of another robot, and for a robot whose forward dynamics have no
    /// solution.
    pub(crate) fn new(
        model: Arc<Model>,
        actuation: Actuation,
        capabilities: Capabilities,
        kind: DynamicsKind,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        match &kind {
            DynamicsKind::Contact(contacts, damping) | DynamicsKind::Impact { contacts, damping, .. } => {
                check_contacts(&model, contacts, *damping)?;
            }
            DynamicsKind::ContactInverse(contacts, _) => check_contacts(&model, contacts, SHARED)?,
            _ => {}
        }
        actuation.check(&model)?;
        let terms = HorizonTerms::new(model.clone(), capabilities.clone(), costs)?;
        let singular = model.singular_joints();
        if !singular.is_empty()
            && (capabilities.impulse || matches!(kind, DynamicsKind::Free | DynamicsKind::Contact(..)))
        {
            let why = "nothing with a mass moves with the joints";
            let names: Vec<_> = singular.iter().map(|&i| format!("`{}`", model.bodies()[i].joint_name)).collect();
            let what = format!("{why} {}: their accelerations are undefined", names.join(", "));
            return Err(Error::Actuation { what });
        }
        let given = if capabilities.inverse { Output::Acceleration } else { Output::Effort };
        let groups = groups(&model);
        let (shared, work) = (SharedData::default(), OnDemand::default());
        Ok(Self { model, actuation, terms, kind, given, capabilities, groups, shared, work })
    }

    /// Replaces the robot by one that differs only in its numbers. The workspace is allocated again at its next use.
    pub(crate) fn set_model(&mut self, model: &Arc<Model>) {
        self.model = model.clone();
        self.terms.set_model(model);
        (self.shared, self.work) = (SharedData::default(), OnDemand::default());
    }

    /// Returns the contacts, in the order of their forces in λ.
    pub(crate) fn contacts(&self) -> &[Contact] {
        match &self.kind {
            DynamicsKind::Contact(contacts, _)
            | DynamicsKind::ContactInverse(contacts, _)
            | DynamicsKind::Impact { contacts, .. } => contacts,
            _ => &[],
        }
    }

    /// Changes target and gains of the contact called `name` by `change`, in the contacts and in the workspace. Returns
    /// whether the contact exists. Allocates nothing.
    pub(crate) fn change_contact(
        &mut self,
        name: &str,
        change: &mut dyn FnMut(&mut ContactConstraint),
    ) -> Result<bool, Error> {
        let Self { model, kind, work, .. } = self;
        let contacts = match kind {
            DynamicsKind::Contact(contacts, _)
            | DynamicsKind::ContactInverse(contacts, _)
            | DynamicsKind::Impact { contacts, .. } => contacts,
            _ => return Ok(false),
        };
        let Some(k) = contacts.iter().position(|contact| contact.name == name) else { return Ok(false) };
        let wrong = |what| Err(Error::Contact { name: name.to_owned(), what });
        let (old, mut new) = (contacts[k].constraint, contacts[k].constraint);
        change(&mut new);
        let ContactConstraint { kp, kp_axes, kd, target, .. } = new;
        if new != (ContactConstraint { kp, kp_axes, kd, target, ..old }) {
            return wrong("only its target and its gains may be changed".to_owned());
        }
        if let Err(error) = ConstraintSet::<f64>::check_all(model, &[new]) {
            return match error {
                condyle_dynamics::Error::Constraint { what, .. } => wrong(what),
                other => wrong(other.to_string()),
            };
        }
        contacts[k].constraint = new;
        if let Some(Work { single, vectors, .. }) = work.made_mut() {
            single.set_contact(k, &new);
            if let Some(VectorBatches { short, long }) = vectors {
                short.set_contact(k, &new);
                long.iter_mut().for_each(|long| long.set_contact(k, &new));
            }
        }
        Ok(true)
    }

    /// Returns whether the knots are impacts.
    pub(crate) fn is_impact(&self) -> bool {
        self.capabilities.impulse
    }

    /// Returns the number of controls.
    pub(crate) fn nu(&self) -> usize {
        self.capabilities.nu
    }

    /// Allocates the workspace if it does not exist yet, and allocates memory for the residuals of all terms.
    pub(crate) fn reserve(&mut self) {
        let Parts { model, terms, work, .. } = self.parts();
        work.data.iter_mut().for_each(|data| data.residuals.reserve(model.nv(), terms.layouts()));
    }

    /// Returns references to all fields. Allocates the workspace if it does not exist.
    fn parts(&mut self) -> Parts<'_> {
        let Self { model, actuation, terms, kind, given, capabilities, groups, shared, work } = self;
        terms.reserve();
        let work = work.get(|| Work::new(model, actuation, kind, *given, capabilities, groups, shared));
        Parts { model, actuation, terms, kind, capabilities, groups, work }
    }

    /// Uses the memory of `other` for the algorithms of the dynamics, if both robots have the same model and this robot
    /// has no workspace yet.
    pub(crate) fn share(&mut self, other: &Self) {
        if Arc::ptr_eq(&self.model, &other.model) && self.work.made().is_none() {
            self.shared.share(&other.shared);
        }
    }

    /// Moves the costs and limits of `other` to this robot if both have the same dynamics. Returns whether the dynamics
    /// are the same.
    pub(crate) fn merge(&mut self, other: &mut Self, place: Option<usize>) -> bool {
        let same = Arc::ptr_eq(&self.model, &other.model)
            && (&self.kind, &self.actuation, &self.capabilities)
                == (&other.kind, &other.actuation, &other.capabilities);
        if same {
            self.terms.append(&mut other.terms, place);
        }
        same
    }

    /// Returns whether the controls of this robot have the same meaning as the controls of `other`: both robots have
    /// the same kind of dynamics, the same actuation, and contacts of the same frames.
    pub(crate) fn has_controls_of(&self, other: &Self) -> bool {
        let place = |contact: &Contact| {
            let constraint = &contact.constraint;
            (constraint.frame, constraint.other, constraint.kind.rows())
        };
        let (contacts, others) = (self.contacts().iter().map(place), other.contacts().iter().map(place));
        core::mem::discriminant(&self.kind) == core::mem::discriminant(&other.kind)
            && self.actuation == other.actuation
            && contacts.eq(others)
    }

    /// Computes the controls that hold the robot still at x, as nearly as possible, into `u`. Returns whether such
    /// controls exist: not at an impact or a terminal knot. Allocates nothing if the workspace exists.
    pub(crate) fn hold_still(&mut self, x: &[f64], u: &mut [f64]) -> bool {
        self.reserve();
        let Self { model, actuation, kind, work, .. } = self;
        let Some(Work { single, still: Some(still), .. }) = work.made_mut() else { return false };
        still.run(model, (actuation, kind), single, x, u);
        true
    }

    /// Returns the number of knots that are computed in one batch.
    pub(crate) fn lanes(&self) -> usize {
        lanes(&self.kind)
    }

    /// Computes the dynamics of at most [`lanes`](Self::lanes) knots into the workspace, in one batch if that is
    /// faster. [`values`](Self::values) and [`slopes`](Self::slopes) then return the results of each knot.
    pub(crate) fn solve(&mut self, group: Group<'_>) {
        self.solve_across(group, &[]);
    }

    /// Computes the dynamics of a group, in one batch if its lanes belong to several robots. `each` has the robot of
    /// each lane, with its costs, limits and contact targets; `None` stands for this robot. If all lanes belong to this
    /// robot, `each` is empty.
    pub(crate) fn solve_across(&mut self, group: Group<'_>, each: &[Option<&Self>]) {
        let Group { knots, xs, us, what, durations, .. } = group;
        if let Evaluation::Equations { motions, .. } = what {
            match motions.is_empty() {
                true => self.solve(Group { what: Evaluation::Values, ..group }),
                false => self.set_motions(knots.len(), motions),
            }
        }
        let Parts { model, actuation, terms, kind, capabilities, work, .. } = self.parts();
        let mut each_terms: [Option<&HorizonTerms>; WIDEST] = [None; WIDEST];
        each_terms.iter_mut().zip(each).for_each(|(to, robot)| *to = robot.map(|robot| &robot.terms));
        let terms = LaneTerms { own: terms, each: &each_terms[..each.len()] };
        let Work { single, vectors, impact, data, .. } = work;
        let (nu, nx, count) = (capabilities.nu, model.nq() + model.nv(), knots.len());
        let alone = |k: usize| {
            let durations = durations.get(k..=k).unwrap_or_default();
            Group { knots: &knots[k..=k], xs: &xs[k * nx..][..nx], durations, ..group }
        };
        let data = &mut data[..count];
        if let Some(impact) = impact {
            let terms_at = terms.own.at(knots[0], group.limited);
            data[0].residuals.reserve(model.nv(), terms.own.layouts());
            impact.run(model, &mut single.data.get(), xs, terms_at, what != Evaluation::Values, &mut data[0]);
            return single.run_residuals_at(model, group, terms, &mut data[0]);
        }
        for (k, data) in data.iter_mut().enumerate() {
            let (drives, forces) = us[k * nu..][..nu].split_at(actuation.nu());
            actuation.effort(drives, &mut data.tau); // τ = S u, or q̈
            if !forces.is_empty() {
                data.lambda.copy_from_slice(forces);
            }
        }
        let equations = matches!(what, Evaluation::Equations { .. });
        let (several, across) = (count > Short::LANES || what != Evaluation::Values, !each.is_empty());
        match vectors.as_mut().filter(|_| count >= WORTHWHILE || equations || across) {
            Some(VectorBatches { long: Some(long), .. }) if several || across => {
                with_targets(long, kind, each, |long| long.run(model, group, terms, data));
            }
            Some(VectorBatches { short, .. }) => {
                with_targets(short, kind, each, |short| short.run(model, group, terms, data));
            }
            None => {
                for (k, data) in data.chunks_exact_mut(1).enumerate() {
                    single.run(model, alone(k), terms, data);
                }
            }
        }
        for (k, data) in data.iter_mut().enumerate().filter(|(_, data)| !data.residuals.is_written) {
            single.run_residuals_at(model, alone(k), terms, data);
        }
    }

    /// Returns the accelerations, the cost ℓ and the limit term at one knot of the last group in
    /// [`solve`](Self::solve).
    pub(crate) fn values(&mut self, lane: usize, input: KnotInput<'_>, limited: bool) -> (&[f64], f64, f64) {
        let (KnotInput { t, x, u }, Parts { terms, work: Work { data, .. }, .. }) = (input, self.parts());
        let data = &data[lane];
        let (cost, term) = terms.calc(t, KnotState { x, u, data }, limited);
        (&data.a, cost, term)
    }

    /// Writes the residuals of the limits at one knot of the last group in [`solve`](Self::solve).
    pub(crate) fn write_limits(&mut self, lane: usize, KnotInput { t, x, u }: KnotInput<'_>, to: &mut [f64]) {
        let Parts { terms, work: Work { data, .. }, .. } = self.parts();
        terms.write_limits(t, KnotState { x, u, data: &data[lane] }, to);
    }

    /// Returns the derivatives of the accelerations at one knot of the last group in [`solve`](Self::solve). Writes the
    /// derivatives of `scale` · ℓ and of the limit term to the LQ knot. If [`solve`](Self::solve) computed equations of
    /// inverse dynamics, the LQ knot is written in inverse-dynamics form if possible.
    pub(crate) fn slopes(
        &mut self,
        lane: usize,
        input: KnotInput<'_>,
        scale: f64,
        Group { what, limited, .. }: Group<'_>,
        knot: &mut LqKnot,
    ) -> Derivatives<'_> {
        let (given, KnotInput { t, x, u }) = (self.given, input);
        let Parts { model, actuation, terms, work, .. } = self.parts();
        let equations = matches!(what, Evaluation::Equations { .. });
        let inverse = equations && work.write_equations(terms, lane, input, scale, knot);
        let Work { single, data, da_du, .. } = work;
        if equations && !inverse {
            let group = Group { knots: &[t], xs: x, us: u, what: Evaluation::Derivatives, limited, durations: &[] };
            single.run(model, group, LaneTerms { own: terms, each: &[] }, &mut data[lane..=lane]);
        }
        let data = &data[lane];
        let [da_dq, da_dv, da_dtau] = &data.da;
        if !inverse {
            let sensitivities = DynamicsSensitivities { given, data, actuation };
            terms.calc_diff(t, KnotState { x, u, data }, &sensitivities, scale, limited, knot);
        }
        Derivatives { a: &data.a, da_dq, da_dv, da_du: actuation.columns(da_dtau, da_du) } // ∂q̈/∂τ S
    }

    /// Returns sizes for the equations of inverse dynamics: the number of accelerations and forces of a knot, the
    /// maximum number of dependent coordinates, and the maximum number of residual rows. Returns `None` without such
    /// equations.
    pub(crate) fn inverse_dynamics(&self) -> Option<(usize, [usize; 2])> {
        let layout = self.terms.layout(); // Hessians without rows are added to Q, S and R, whose controls are u
        let elimination = self.work.made()?.elimination.as_ref()?;
        let motion = self.model.nv() + self.capabilities.rows();
        (!layout.curved).then_some((motion, [elimination.most_dependent(), layout.rows[0]]))
    }

    /// Copies the accelerations and forces of one knot of the last group in [`solve`](Self::solve).
    pub(crate) fn copy_motion(&mut self, lane: usize, to: &mut [f64]) {
        let KnotData { a, lambda, .. } = &self.parts().work.data[lane];
        let (to_a, to_lambda) = to.split_at_mut(a.len());
        to_a.copy_from_slice(a);
        to_lambda[..lambda.len()].copy_from_slice(lambda);
    }

    /// Sets the accelerations and forces of `count` knots. `motions` has a block of equal length for each knot; the
    /// block begins with the knot's accelerations and forces.
    fn set_motions(&mut self, count: usize, motions: &[f64]) {
        let size = motions.len() / count;
        for (KnotData { a, lambda, .. }, from) in self.parts().work.data.iter_mut().zip(motions.chunks_exact(size)) {
            let (from_a, from_lambda) = from.split_at(a.len());
            a.copy_from_slice(from_a);
            let rows = lambda.len();
            lambda.copy_from_slice(&from_lambda[..rows]);
        }
    }

    /// Calls `show` for each output at the first knot of the last group in [`solve`](Self::solve): see
    /// [`Problem::outputs`](crate::Problem::outputs).
    pub(crate) fn outputs(&mut self, show: &mut dyn FnMut(&str, &[f64])) {
        let Parts { capabilities, work, .. } = self.parts();
        let data = &work.data[0];
        if capabilities.effort {
            show("acceleration", &data.a);
            show("effort", &data.tau);
        }
        for (contact, rows) in &capabilities.contacts {
            show(&format!("force/{contact}"), &data.lambda[rows.clone()]);
        }
    }

    /// Returns the controls and contact forces of smallest norm that hold the robot still, as nearly as possible: (u,
    /// λ) = [S Jᵀ]⁺ g(q). If accelerations are controls, they are zero.
    #[track_caller]
    pub(crate) fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        assert_length("x", x.len(), nq + nv);
        // allocates data for one state, because the workspace for groups of knots may not exist yet
        let Self { model, actuation, kind, .. } = &*self;
        let (data, zero, mut J) = (&mut Data::new(model), vec![0.0; nv], DMatrix::zeros(0, nv));
        let (contacts, drives): (&[Contact], _) = match kind {
            DynamicsKind::Inverse => return zero, // q̈ = u
            DynamicsKind::Contact(contacts, _) => (contacts, actuation),
            DynamicsKind::ContactInverse(contacts, drives) => (contacts, drives),
            DynamicsKind::None | DynamicsKind::Free | DynamicsKind::Impact { .. } => (&[], actuation),
        };
        if !contacts.is_empty() {
            let mut set = constraint_set(model, contacts, SHARED).expect("was checked when it was given");
            let forces = vec![0.0; set.rows()];
            constrained_inverse_dynamics(model, data, &mut set, &x[..nq], &x[nq..], &zero, &forces, &[]);
            J = DMatrix::zeros(set.rows(), nv);
            set.jacobian(&mut J);
        }
        let mut both = drives.quasi_static(gravity(model, data, &x[..nq]), &J);
        let forces = both.split_off(drives.nu());
        if matches!(kind, DynamicsKind::ContactInverse(..)) { [zero, forces].concat() } else { both } // (q̈, λ), or u
    }

    /// Computes the blocks of groups in the Jacobians ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq.
    pub(crate) fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        integrate_jacobian_groups(&self.model, dq, IntegrateArgument::Position, by_q);
        integrate_jacobian_groups(&self.model, dq, IntegrateArgument::Velocity, by_dq);
    }

    /// Returns the Jacobians of the step at one knot of the last group in [`solve`](Self::solve) with durations: see
    /// [`KnotData::steps`].
    pub(crate) fn steps(&self, lane: usize) -> Option<&[f64]> {
        self.work.made().map(|work| &work.data[lane].steps[..])
    }
}
