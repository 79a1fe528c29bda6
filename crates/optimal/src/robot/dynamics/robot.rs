//! Dynamics of a robot: what its knots of all kinds share.
#![allow(non_snake_case)] // J

use super::batch::{DynamicsKind, KnotBatch, Pass};
use super::kkt_elimination::{KktElimination, Tableau};
use super::limb_elimination::LimbElimination;
use super::sensitivities::DynamicsSensitivities;
use crate::Error;
use crate::error::assert_length;
use crate::lq::{Hessian, LqKnot};
use crate::robot::actuation::Actuation;
use crate::robot::capabilities::{Capabilities, Output};
use crate::robot::contact::{Contact, SHARED, check_contacts, constraint_set, moved_by};
use crate::robot::continuous::{Derivatives, Evaluation, KnotInput};
use crate::robot::costs::Cost;
use crate::robot::horizon_terms::HorizonTerms;
use crate::robot::knot::{KnotData, KnotState};
use crate::robot::on_demand::OnDemand;
use crate::robot::state::{GroupHessian, groups};
use condyle_dynamics::level::{Level, level};
use condyle_dynamics::{
    Data, IntegrateArgument, Model, aba_hessian, constrained_inverse_dynamics, gravity, integrate,
    integrate_jacobian_groups, neutral,
};
use condyle_spatial::Scalar;
use condyle_spatial::block::{Real, Witness};
use core::ops::Range;
use nalgebra::DMatrix;
use std::sync::Arc;

/// The promise of this crate, by which it names vectors.
struct Gate;

// SAFETY: vectors are used by the kernels of `condyle_dynamics`, and by what enters through their door.
#[allow(unsafe_code)]
unsafe impl Witness for Gate {}

type Short = <f64 as Real>::Short<Gate>;
type Long = <f64 as Real>::Long<Gate>;

/// So many postures are tried to find one that is not singular.
const POSTURES: usize = 8;
/// Fewer knots than this are computed one by one.
const WORTHWHILE: usize = 3;

/// A robot with its drives, the law of its accelerations, and the terms of its knots.
#[derive(Clone, Debug)]
pub(crate) struct RobotDynamics {
    pub model: Arc<Model>,
    pub actuation: Actuation,
    pub terms: HorizonTerms,
    kind: DynamicsKind,
    /// The output that the controls drive.
    given: Output,
    capabilities: Capabilities,
    /// The coordinates of each group of positions that is no vector space.
    pub groups: Vec<Range<usize>>,
    work: OnDemand<Work>,
}

/// What [`RobotDynamics`] consists of when knots are computed.
pub(crate) struct Parts<'a> {
    pub model: &'a Arc<Model>,
    pub actuation: &'a Actuation,
    pub terms: &'a mut HorizonTerms,
    capabilities: &'a Capabilities,
    groups: &'a [Range<usize>],
    pub work: &'a mut Work,
}

/// The memory in which the dynamics of knots are computed.
#[derive(Debug)]
pub(crate) struct Work {
    /// The dynamics of one knot.
    pub single: KnotBatch<f64>,
    vectors: Option<VectorBatches>,
    /// The knots of the group that was prepared, and what was computed of them.
    pub data: Vec<KnotData>,
    prepared: Evaluation,
    elimination: Option<KktElimination>,
    group_hessian: GroupHessian,
    /// ∂q̈/∂u. Shape: nv × nu, nothing if S selects.
    da_du: Vec<f64>,
}

/// The dynamics of as many knots as this processor has lanes. Few trials take few lanes, which are faster; for derivatives
/// they are not: too rarely used to stay in the caches.
#[derive(Debug)]
struct VectorBatches {
    short: KnotBatch<Short>,
    long: Option<KnotBatch<Long>>,
}

/// The number of knots that are computed side by side.
fn lanes(kind: &DynamicsKind) -> usize {
    match (kind, level()) {
        (DynamicsKind::None, _) | (_, Level::Baseline) => 1,
        (_, Level::Simd128 | Level::Neon | Level::Avx2) => Short::LANES,
        (_, Level::Avx512) => Long::LANES,
    }
}

impl VectorBatches {
    /// Makes room for the equations of knots in inverse-dynamics form, in the widest lanes: they are for derivatives.
    fn reserve(&mut self, tableau: Tableau, eliminations: Vec<Arc<LimbElimination>>) {
        match &mut self.long {
            Some(long) => long.reserve(tableau, eliminations),
            None => self.short.reserve(tableau, eliminations),
        }
    }

    /// The equations of a knot at some posture in which the limbs can be solved.
    fn some_equations(&mut self, model: &Model, at: &KnotData) -> Option<Vec<f64>> {
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
    ) -> Self {
        let (nv, lanes) = (model.nv(), lanes(kind));
        let mut vectors = (lanes > 1).then(|| {
            let long = (lanes > Short::LANES).then(|| KnotBatch::new(model, kind));
            VectorBatches { short: KnotBatch::new(model, kind), long }
        });
        let moved_by = match kind {
            DynamicsKind::Free => Some(Vec::new()),
            DynamicsKind::Contact(contacts, _) => Some(moved_by(model, contacts)),
            _ => None,
        };
        // in inverse-dynamics form knots come in lanes only, and drives must not mix coordinates
        let form = moved_by.filter(|_| vectors.is_some()).zip(actuation.passive());
        let mut data = KnotData::new(nv, capabilities, given);
        let elimination = form.zip(vectors.as_mut()).map(|((moved_by, passive), vectors)| {
            let damped = matches!(kind, DynamicsKind::Contact(_, damping) if *damping != 0.0);
            let tableau = Tableau { nv, rows: capabilities.rows() };
            data.equations.resize(tableau.len(), 0.0);
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
            single: KnotBatch::new(model, kind),
            vectors,
            data: vec![data; lanes],
            prepared: Evaluation::Motion,
            elimination,
            group_hessian: GroupHessian::new(nv, groups),
            da_du: actuation.scratch(),
        }
    }

    /// Writes a knot of Δt = `scale` seconds in inverse-dynamics form; says whether there is one.
    fn write_inverse_dynamics_form(
        &mut self,
        terms: &mut HorizonTerms,
        KnotInput { lane, t, x, u }: KnotInput<'_>,
        scale: f64,
        knot: &mut LqKnot,
    ) -> bool {
        let Self { data, elimination: Some(elimination), .. } = self else { return false };
        let form = &mut knot.inverse_dynamics;
        let KnotData { equations, eliminations, .. } = &mut data[lane];
        if !elimination.run(equations, *eliminations, scale, form) {
            return false;
        }
        form.active = true;
        let lent = form.lend();
        let state = KnotState { x, u, data: &data[lane] };
        terms.calc_diff(t, state, &elimination.sensitivities(&lent, scale), scale, knot);
        knot.inverse_dynamics.take_back(lent);
        true
    }
}

impl RobotDynamics {
    /// A robot with some drives whose accelerations obey a law.
    ///
    /// # Errors
    /// [`Error::Contact`] for contacts that do not fit, [`Error::Actuation`] for drives of another robot, [`Error::Cost`]
    /// for a term that does not fit, [`Error::Actuation`] for a robot of which forward dynamics has no solution.
    pub(crate) fn new(
        model: Arc<Model>,
        actuation: Actuation,
        capabilities: Capabilities,
        kind: DynamicsKind,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        match &kind {
            DynamicsKind::Contact(contacts, damping) => check_contacts(&model, contacts, *damping)?,
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
        Ok(Self { model, actuation, terms, kind, given, capabilities, groups, work: OnDemand::default() })
    }

    /// The contacts of its law, in the order of their forces.
    pub(crate) fn contacts(&self) -> &[Contact] {
        match &self.kind {
            DynamicsKind::Contact(contacts, _) | DynamicsKind::ContactInverse(contacts, _) => contacts,
            _ => &[],
        }
    }

    /// Whether its knots are impacts.
    pub(crate) fn is_impact(&self) -> bool {
        self.capabilities.impulse
    }

    /// The number of controls.
    pub(crate) fn nu(&self) -> usize {
        self.capabilities.nu
    }

    /// Makes the memory in which knots are computed, unless it is there.
    pub(crate) fn reserve(&mut self) {
        self.parts();
    }

    /// The robot, its drives, the terms of its knots, and the memory in which they are computed.
    pub(crate) fn parts(&mut self) -> Parts<'_> {
        let Self { model, actuation, terms, kind, given, capabilities, groups, work } = self;
        terms.reserve();
        let work = work.get(|| Work::new(model, actuation, kind, *given, capabilities, groups));
        Parts { model, actuation, terms, capabilities, groups, work }
    }

    /// As [`ActionModel::merge`](crate::ActionModel::merge).
    pub(crate) fn merge(&mut self, other: &mut Self) -> bool {
        let same = Arc::ptr_eq(&self.model, &other.model)
            && (&self.kind, &self.actuation, &self.capabilities)
                == (&other.kind, &other.actuation, &other.capabilities);
        if same {
            self.terms.append(&mut other.terms);
        }
        same
    }

    /// As [`ContinuousModel::lanes`](crate::robot::ContinuousModel::lanes).
    pub(crate) fn lanes(&self) -> usize {
        lanes(&self.kind)
    }

    /// As [`ContinuousModel::prepare`](crate::robot::ContinuousModel::prepare): side by side where that is worthwhile.
    pub(crate) fn prepare(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation) {
        let Parts { model, actuation, terms, capabilities, work, .. } = self.parts();
        let Work { single, vectors, data, prepared, .. } = work;
        let (nu, nx, count) = (capabilities.nu, model.nq() + model.nv(), knots.len());
        let data = &mut data[..count];
        for (k, data) in data.iter_mut().enumerate() {
            let (drives, forces) = us[k * nu..][..nu].split_at(actuation.nu());
            actuation.effort(drives, &mut data.tau); // τ = S u, or q̈
            if !forces.is_empty() {
                data.lambda.copy_from_slice(forces);
            }
        }
        match vectors.as_mut().filter(|_| count >= WORTHWHILE || what == Evaluation::Equations) {
            Some(VectorBatches { long: Some(long), .. }) if count > Short::LANES || what != Evaluation::Motion => {
                long.run(model, knots, xs, terms, what, data);
            }
            Some(VectorBatches { short, .. }) => short.run(model, knots, xs, terms, what, data),
            None => {
                for (k, data) in data.chunks_exact_mut(1).enumerate() {
                    single.run(model, &knots[k..=k], &xs[k * nx..][..nx], terms, what, data);
                }
            }
        }
        for (k, data) in data.iter_mut().enumerate().filter(|(_, data)| !data.residuals.is_written) {
            let slopes = what != Evaluation::Motion;
            single.run_residuals_at(model, knots[k], &xs[k * nx..][..nx], terms, slopes, data);
        }
        *prepared = what;
    }

    /// As [`ContinuousModel::calc`](crate::robot::ContinuousModel::calc).
    pub(crate) fn calc(&mut self, KnotInput { lane, t, x, u }: KnotInput<'_>) -> (&[f64], f64) {
        let Parts { terms, work: Work { data, .. }, .. } = self.parts();
        let data = &data[lane];
        (&data.a, terms.calc(t, KnotState { x, u, data }))
    }

    /// As [`ContinuousModel::calc_diff`](crate::robot::ContinuousModel::calc_diff).
    pub(crate) fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
        let given = self.given;
        let Parts { model, actuation, terms, work, .. } = self.parts();
        let in_equations = work.prepared == Evaluation::Equations;
        let inverse = in_equations && work.write_inverse_dynamics_form(terms, input, scale, knot);
        let Work { single, data, da_du, .. } = work;
        if in_equations && !inverse {
            let data = &mut data[input.lane..=input.lane];
            single.run(model, &[input.t], input.x, terms, Evaluation::Derivatives, data);
        }
        let KnotInput { lane, t, x, u } = input;
        let data = &data[lane];
        let [da_dq, da_dv, da_dtau] = &data.da;
        if !inverse {
            let sensitivities = DynamicsSensitivities { given, data, actuation };
            terms.calc_diff(t, KnotState { x, u, data }, &sensitivities, scale, knot);
        }
        Derivatives { a: &data.a, da_dq, da_dv, da_du: actuation.columns(da_dtau, da_du) } // ∂q̈/∂τ S
    }

    /// As [`ContinuousModel::inverse_dynamics_form`](crate::robot::ContinuousModel::inverse_dynamics_form).
    pub(crate) fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
        let layout = self.terms.layout(); // Hessians that are no rows stand in Q, S and R, by the controls
        let elimination = self.work.made()?.elimination.as_ref()?;
        (!layout.curved).then_some([elimination.most_dependent(), layout.rows[0]])
    }

    /// As [`ContinuousModel::motion_size`](crate::robot::ContinuousModel::motion_size).
    pub(crate) fn motion_size(&self) -> usize {
        match self.inverse_dynamics_form() {
            Some(_) => self.model.nv() + self.capabilities.rows(),
            None => 0,
        }
    }

    /// As [`ContinuousModel::motion`](crate::robot::ContinuousModel::motion).
    pub(crate) fn motion(&self, lane: usize, to: &mut [f64]) {
        let Some(work) = self.work.made() else { return };
        let KnotData { a, lambda, .. } = &work.data[lane];
        let (to_a, to_lambda) = to.split_at_mut(a.len());
        to_a.copy_from_slice(a);
        to_lambda[..lambda.len()].copy_from_slice(lambda);
    }

    /// As [`ContinuousModel::set_motion`](crate::robot::ContinuousModel::set_motion).
    pub(crate) fn set_motion(&mut self, lane: usize, from: &[f64]) {
        let KnotData { a, lambda, .. } = &mut self.parts().work.data[lane];
        let (from_a, from_lambda) = from.split_at(a.len());
        a.copy_from_slice(from_a);
        let rows = lambda.len();
        lambda.copy_from_slice(&from_lambda[..rows]);
    }

    /// As [`ActionModel::outputs`](crate::ActionModel::outputs), of a knot that was prepared.
    pub(crate) fn outputs(&mut self, lane: usize, show: &mut dyn FnMut(&str, &[f64])) {
        let Parts { capabilities, work, .. } = self.parts();
        let data = &work.data[lane];
        if capabilities.effort {
            show("acceleration", &data.a);
            show("effort", &data.tau);
        }
        for (contact, rows) in &capabilities.contacts {
            show(&format!("force/{contact}"), &data.lambda[rows.clone()]);
        }
    }

    /// The smallest controls, and forces of contacts, that come nearest to holding the robot still: (u, λ) = [S Jᵀ]⁺ g(q); and
    /// where accelerations are controls, none of these.
    #[track_caller]
    pub(crate) fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        assert_length("x", x.len(), nq + nv);
        // one state does not need the memory of many knots, which may not be there
        let Self { model, actuation, kind, .. } = &*self;
        let (data, zero, mut J) = (&mut Data::new(model), vec![0.0; nv], DMatrix::zeros(0, nv));
        let (contacts, drives): (&[Contact], _) = match kind {
            DynamicsKind::Inverse => return zero, // q̈ = u
            DynamicsKind::Contact(contacts, _) => (contacts, actuation),
            DynamicsKind::ContactInverse(contacts, drives) => (contacts, drives),
            DynamicsKind::None | DynamicsKind::Free => (&[], actuation),
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
        if matches!(kind, DynamicsKind::ContactInverse(..)) { [zero, forces].concat() } else { both } // (q̈, λ) = u, or τ = S u
    }

    /// As [`ContinuousModel::hessian`](crate::robot::ContinuousModel::hessian).
    pub(crate) fn hessian(
        &mut self,
        KnotInput { x, u, .. }: KnotInput<'_>,
        mu: &[f64],
        hessian: &mut Hessian,
    ) -> Option<Derivatives<'_>> {
        let Parts { model, actuation, work, .. } = self.parts();
        let Work { single: KnotBatch { data, pass, .. }, data: knots, da_du, .. } = work;
        let knot = &mut knots[0];
        match pass {
            Pass::Free => {
                actuation.effort(u, &mut knot.tau);
                let (nv, (q, v)) = (model.nv(), x.split_at(model.nq()));
                let d = aba_hessian(model, data, q, v, &knot.tau, &[], mu);
                for c in 0..nv {
                    for r in 0..nv {
                        hessian.xx[(r, c)] = d.dqdq[(r, c)];
                        hessian.xx[(nv + r, c)] = d.dvdq[(r, c)];
                        hessian.xx[(c, nv + r)] = d.dvdq[(r, c)];
                        hessian.xx[(nv + r, nv + c)] = d.dvdv[(r, c)];
                    }
                    let column = &d.dtaudq.as_slice()[c * nv..][..nv];
                    for k in 0..u.len() {
                        hessian.xu[(c, k)] = actuation.along(k, column); // Sᵀ ∂²ψ/∂τ∂q
                        hessian.xu[(nv + c, k)] = 0.0;
                    }
                }
                hessian.uu.fill(0.0);
                let [da_dq, da_dv, da_dtau] = &mut knot.da;
                da_dq.copy_from(d.first.da_dq);
                da_dv.copy_from(d.first.da_dv);
                da_dtau.copy_from(d.first.da_dtau);
                Some(Derivatives { a: d.first.a, da_dq, da_dv, da_du: actuation.columns(da_dtau, da_du) })
            }
            Pass::Inverse | Pass::ContactInverse(..) => {
                knot.a.copy_from_slice(&u[..model.nv()]);
                for part in [&mut hessian.xx, &mut hessian.xu, &mut hessian.uu] {
                    part.fill(0.0); // accelerations that are given do not curve
                }
                let [da_dq, da_dv, da_du] = &knot.da;
                Some(Derivatives { a: &knot.a, da_dq, da_dv, da_du: da_du.as_slice() })
            }
            _ => None,
        }
    }

    /// ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq, the blocks of groups.
    pub(crate) fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        integrate_jacobian_groups(&self.model, dq, IntegrateArgument::Position, by_q);
        integrate_jacobian_groups(&self.model, dq, IntegrateArgument::Velocity, by_dq);
    }

    /// The second derivatives of λᵀ(q ⊕ δq) by q and δq.
    pub(crate) fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) {
        let Parts { model, groups, work, .. } = self.parts();
        work.group_hessian.run(model, groups, dq, lambda, hessian);
    }
}
