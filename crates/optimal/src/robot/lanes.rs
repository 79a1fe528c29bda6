//! The dynamics of several knots side by side, in the lanes of a vector register, and their results one by one.
//!
//! A robot's coordinates are packed so that each number has a lane for each knot; the algorithms of dynamics then run
//! once for all of them. What they give is unpacked in blocks, since the costs and the sweep look at one knot after the
//! other.

use super::common::Schedule;
use super::contact::Contact;
use super::elimination::Tableau;
use super::integrated::Wanted;
use super::sight::{Eyes, Known, Seen};
use condyle_dynamics::level::{Level, level};
use condyle_dynamics::{
    ConstraintSet, Data, Model, Proximal, aba, aba_derivatives, constrained_dynamics, constrained_dynamics_derivatives,
    constrained_dynamics_equations, rnea_derivatives,
};
use condyle_spatial::Scalar;
use condyle_spatial::block::{Block, Real, Strided, gather_rows, scatter_matrix, scatter_rows};
use nalgebra::DMatrix;

type Short = <f64 as Real>::Short;
type Long = <f64 as Real>::Long;

/// Most lanes that there are.
pub(super) const WIDEST: usize = 8;

/// What the dynamics of one knot give.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub a: Vec<f64>,
    pub lambda: Vec<f64>,
    /// ∂q̈/∂q, ∂q̈/∂v, ∂q̈/∂τ. Shape: nv × nv.
    pub da: [DMatrix<f64>; 3],
    /// ∂λ/∂q, ∂λ/∂v, ∂λ/∂τ. Shape: rows × nv.
    pub dlambda: [DMatrix<f64>; 3],
    /// The equations differentiated, row by row. Shape: that of the [`Tableau`].
    pub equations: Vec<f64>,
    /// What its residuals see, if that was computed too.
    seen: Seen,
    has_seen: bool,
}

impl Outcome {
    /// What its residuals see, if that was computed too.
    pub(super) fn known(&self) -> Known<'_> {
        if self.has_seen { Known::Seen(&self.seen) } else { Known::Nothing }
    }
}

impl AsMut<Seen> for Outcome {
    fn as_mut(&mut self) -> &mut Seen {
        &mut self.seen
    }
}

#[derive(Clone, Debug)]
struct Group<S: Block<Number = f64>> {
    data: Data<S>,
    eyes: Eyes<S>,
    /// None of a robot that touches nothing.
    set: Option<ConstraintSet<S>>,
    q: Vec<S>,
    v: Vec<S>,
    tau: Vec<S>,
    /// q̈. Shape: nv.
    a: Vec<S>,
    /// Shape: rows × nv.
    J: DMatrix<S>,
}

/// The part of each of some things that is to be written.
#[inline(always)]
pub(super) fn places<T>(of: &mut [T], part: impl Fn(&mut T) -> &mut [f64]) -> [&mut [f64]; WIDEST] {
    let mut places: [&mut [f64]; WIDEST] = Default::default();
    for (place, of) in places.iter_mut().zip(of) {
        *place = part(of);
    }
    places
}

/// Writes numbers that lie knot after knot side by side.
fn pack<S: Block<Number = f64>>(from: &[f64], stride: usize, count: usize, to: &mut [S]) {
    let rows: [&[f64]; WIDEST] = core::array::from_fn(|k| &from[k.min(count - 1) * stride..][..to.len()]);
    gather_rows(&rows[..count], to);
}

/// Unpacks a block of the equations: `at` is its first row and column there.
fn unpack_rows<S: Block<Number = f64>>(
    from: &[S],
    strides: [usize; 2],
    shape: [usize; 2],
    negative: bool,
    to: &mut [Outcome],
    at: [usize; 2],
    tableau: Tableau,
) {
    let (stride, count) = (tableau.stride(), to.len());
    let mut places = places(to, |outcome| &mut outcome.equations[at[0] * stride + at[1]..]);
    scatter_matrix(&Strided { vectors: from, strides, shape, negative }, &mut places[..count], stride);
}

/// Unpacks to the part of each outcome that `part` names.
fn unpack<S: Block<Number = f64>>(from: &[S], to: &mut [Outcome], part: impl Fn(&mut Outcome) -> &mut [f64]) {
    let count = to.len();
    let mut places = places(to, part);
    scatter_rows(from, &mut places[..count]);
}

impl<S: Block<Number = f64>> Group<S> {
    fn new(model: &Model, set: Option<ConstraintSet<S>>) -> Self {
        let o = S::zero();
        let (q, v) = (vec![o; model.nq()], vec![o; model.nv()]);
        let J = DMatrix::from_element(set.as_ref().map_or(0, ConstraintSet::rows), model.nv(), o);
        Self { data: Data::new(model), eyes: Eyes::new(model), set, q, tau: v.clone(), a: v.clone(), v, J }
    }

    fn run(
        &mut self,
        model: &Model,
        knots: &[usize],
        xs: &[f64],
        taus: &[f64],
        schedule: &Schedule,
        wanted: Wanted,
        out: &mut [Outcome],
    ) {
        let (nq, nv, count, forces) = (model.nq(), model.nv(), out.len(), schedule.room().forces);
        let Self { data, set, q, v, tau, a, .. } = self;
        pack(xs, nq + nv, count, q);
        pack(&xs[nq..], nq + nv, count, v);
        pack(taus, nv, count, tau);
        match (set, wanted) {
            (_, Wanted::Equations) => self.equations(model, out),
            (None, Wanted::Motion) => unpack(aba(model, data, q, v, tau, &[]), out, |o| &mut o.a),
            (None, Wanted::Derivatives) => {
                let d = aba_derivatives(model, data, q, v, tau, &[]);
                unpack(d.a, out, |o| &mut o.a);
                for (k, da) in [d.da_dq, d.da_dv, d.da_dtau].into_iter().enumerate() {
                    unpack(da.as_slice(), out, |o| o.da[k].as_mut_slice());
                }
            }
            (Some(set), Wanted::Motion) => {
                let d = constrained_dynamics(model, data, set, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack(d.a, out, |o| &mut o.a);
                unpack(d.lambda, out, |o| &mut o.lambda);
            }
            (Some(set), Wanted::Derivatives) => {
                let d = constrained_dynamics_derivatives(model, data, set, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack(d.a, out, |o| &mut o.a);
                unpack(d.lambda, out, |o| &mut o.lambda);
                for (k, da) in [d.da_dq, d.da_dv, d.da_dtau].into_iter().enumerate() {
                    unpack(da.as_slice(), out, |o| o.da[k].as_mut_slice());
                }
                let dlambda = [d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau];
                for (k, dlambda) in dlambda.into_iter().enumerate().filter(|_| forces) {
                    unpack(dlambda.as_slice(), out, |o| o.dlambda[k].as_mut_slice());
                }
            }
        }
        self.look(model, knots, schedule, wanted != Wanted::Motion, out);
    }

    /// What the residuals see of those knots that look at the same as the first one.
    fn look(&mut self, model: &Model, knots: &[usize], schedule: &Schedule, slopes: bool, out: &mut [Outcome]) {
        let first = schedule.stack(knots[0]);
        let mut stacks = [first; WIDEST];
        for (k, outcome) in out.iter_mut().enumerate() {
            let stack = schedule.stack(knots[k]);
            outcome.has_seen = stack.is_alike(first);
            if outcome.has_seen {
                stacks[k] = stack;
            }
            outcome.seen.make_room(model.nv(), schedule.room());
        }
        let Self { data, eyes, q, v, a, .. } = self;
        eyes.look(model, data, [q, v, a], slopes, &stacks[..out.len()], out);
    }

    /// The tableau [J μ1 c_v c_q; M −Jᵀ r_v r_q].
    fn equations(&mut self, model: &Model, out: &mut [Outcome]) {
        let Self { data, set, q, v, tau, a, J, .. } = self;
        let tableau = Tableau { nv: model.nv(), rows: J.nrows() };
        let Tableau { nv, rows } = tableau;
        let x = nv + rows;
        let dynamics = |out: &mut [Outcome], M: &DMatrix<S>, dtau_dv: &DMatrix<S>, dtau_dq: &DMatrix<S>| {
            unpack_rows(M.as_slice(), [nv, 1], [nv, nv], false, out, [rows, 0], tableau); // M is symmetric
            unpack_rows(dtau_dv.as_slice(), [1, nv], [nv, nv], false, out, [rows, x], tableau);
            unpack_rows(dtau_dq.as_slice(), [1, nv], [nv, nv], false, out, [rows, x + nv], tableau);
        };
        match set {
            None => {
                a.copy_from_slice(aba(model, data, q, v, tau, &[]));
                let d = rnea_derivatives(model, data, q, v, a, &[]);
                unpack(a, out, |o| &mut o.a);
                dynamics(out, d.dtau_da, d.dtau_dv, d.dtau_dq);
            }
            Some(set) => {
                let d = constrained_dynamics_equations(model, data, set, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack(d.a, out, |o| &mut o.a);
                unpack(d.lambda, out, |o| &mut o.lambda);
                unpack_rows(d.dgamma_dv.as_slice(), [1, rows], [rows, nv], false, out, [0, x], tableau);
                unpack_rows(d.dgamma_dq.as_slice(), [1, rows], [rows, nv], false, out, [0, x + nv], tableau);
                dynamics(out, d.M, d.dtau_dv, d.dtau_dq);
                set.jacobian(J);
                unpack_rows(J.as_slice(), [1, rows], [rows, nv], false, out, [0, 0], tableau);
                unpack_rows(J.as_slice(), [rows, 1], [nv, rows], true, out, [rows, nv], tableau);
            }
        }
        let mu = self.set.as_ref().map_or(0.0, |set| set.proximal.mu);
        for outcome in out {
            for r in 0..rows {
                let forces = &mut outcome.equations[r * tableau.stride() + nv..][..rows];
                forces.fill(0.0);
                forces[r] = mu;
            }
        }
    }
}

/// Few trials take few lanes, which are faster. For derivatives they are not: too rarely used to stay in the caches.
#[derive(Clone, Debug)]
struct Groups {
    short: Group<Short>,
    long: Option<Group<Long>>,
}

/// The dynamics of as many knots as this processor has lanes.
#[derive(Clone, Debug)]
pub(super) struct SideBySide {
    groups: Box<Groups>,
    taus: Vec<f64>,
    pub outcomes: Vec<Outcome>,
}

/// Contacts, and how they share their forces.
#[derive(Clone, Copy)]
pub(super) struct Held<'a> {
    pub contacts: &'a [Contact],
    pub proximal: Proximal,
}

/// Fewer knots than this are computed one by one.
pub(super) const WORTHWHILE: usize = 3;

fn group<S: Block<Number = f64>>(model: &Model, held: Option<Held<'_>>) -> Group<S> {
    let set = held.map(|held| {
        let constraints: Vec<_> = held.contacts.iter().map(|contact| contact.constraint).collect();
        let mut set = ConstraintSet::new(model, &constraints).expect("a set of the same was made before");
        set.proximal = held.proximal;
        set
    });
    Group::new(model, set)
}

impl SideBySide {
    /// None at the level without lanes.
    pub(super) fn new(model: &Model, held: Option<Held<'_>>) -> Option<Self> {
        let (lanes, long) = match level() {
            Level::Baseline => return None,
            Level::Neon | Level::Avx2 => (Short::LANES, None),
            Level::Avx512 => (Long::LANES, Some(group(model, held))),
        };
        let groups = Box::new(Groups { short: group(model, held), long });
        let nv = model.nv();
        let rows = held.map_or(0, |held| held.contacts.iter().map(|c| c.constraint.kind.rows()).sum());
        let square = || DMatrix::zeros(nv, nv);
        let wide = || DMatrix::zeros(rows, nv);
        let outcome = Outcome {
            a: vec![0.0; nv],
            lambda: vec![0.0; rows],
            da: [square(), square(), square()],
            dlambda: [wide(), wide(), wide()],
            equations: vec![0.0; Tableau { nv, rows }.len()],
            seen: Seen::default(),
            has_seen: false,
        };
        Some(Self { groups, taus: vec![0.0; lanes * nv], outcomes: vec![outcome; lanes] })
    }

    /// How many knots it takes.
    pub(super) fn lanes(&self) -> usize {
        self.outcomes.len()
    }

    /// The efforts of knot k, to be set before `run`.
    pub(super) fn tau_mut(&mut self, k: usize) -> &mut [f64] {
        let nv = self.taus.len() / self.outcomes.len();
        &mut self.taus[k * nv..(k + 1) * nv]
    }

    /// Computes what is wanted of the states of some knots, and what their residuals see; the slopes of forces only if
    /// these look at them.
    pub(super) fn run(&mut self, model: &Model, knots: &[usize], xs: &[f64], schedule: &Schedule, wanted: Wanted) {
        let Self { groups, taus, outcomes } = self;
        let out = &mut outcomes[..knots.len()];
        match &mut **groups {
            Groups { long: Some(long), .. } if knots.len() > Short::LANES || wanted != Wanted::Motion => {
                long.run(model, knots, xs, taus, schedule, wanted, out);
            }
            Groups { short, .. } => short.run(model, knots, xs, taus, schedule, wanted, out),
        }
    }
}
