//! Residuals that look at where the bodies are and how they move, with their Jacobians: of one knot, or of several side
//! by side in the lanes of a vector register.

use super::costs::Costs;
use super::lanes::{WIDEST, places};
use super::limits::Set;
use super::residual::{Part, Residual};
use super::terms::{Plan, Room};
use super::watch::Needs;
use condyle_dynamics::{
    Data, Model, Placements, ReferenceFrame, Velocities, centroidal_derivatives, centroidal_map, forward_kinematics,
    forward_velocities, gravity, rnea, rnea_derivatives, static_torque_derivative,
};
use condyle_spatial::block::{Block, Strided, scatter_matrix, scatter_rows};
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Force, Mat3, Motion, Quaternion, Se3, Vec3, lie};
use nalgebra::DMatrix;

/// The numbers of each such residual stand so far from those of the next one.
const STRIDE: usize = 8;

/// Where a residual stands in what is [`Seen`]: which one it is, and where its rows begin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Seat {
    index: usize,
    rows: usize,
}

/// Gives the residuals of a list that look at kinematics their seats; returns which ones they are.
pub(super) fn seat<'a>(nv: usize, all: impl Iterator<Item = (&'a Residual, &'a mut Plan)>) -> Vec<usize> {
    let (mut looks, mut rows) = (Vec::new(), 0);
    for (k, (residual, plan)) in all.enumerate().filter(|(_, (residual, _))| residual.is_seen()) {
        plan.seat = Seat { index: looks.len(), rows };
        looks.push(k);
        rows += seen_rows(nv, residual, plan.n);
    }
    looks
}

/// How many numbers the rows of such a residual have: with respect to q, or to (v, q).
pub(super) fn seen_rows(nv: usize, residual: &Residual, n: usize) -> usize {
    n * width(nv, residual)
}

fn width(nv: usize, residual: &Residual) -> usize {
    if residual.part() == Part::Positions { nv } else { 2 * nv }
}

/// What the residuals of a knot see.
#[derive(Clone, Debug, Default)]
pub(super) struct Seen {
    r: Vec<f64>,
    rows: Vec<f64>,
    /// M q̈ + h − g at a knot with contacts, else −g.
    surplus: Vec<f64>,
    /// Its derivatives with respect to q, v, q̈; of −g that with respect to q.
    surplus_slopes: [DMatrix<f64>; 3],
}

impl Seen {
    /// Room for the residuals of a robot's knots.
    pub(super) fn make_room(&mut self, nv: usize, Room { seen: [looks, rows], needs, .. }: Room) {
        if self.r.len() < looks * STRIDE {
            self.r.resize(looks * STRIDE, 0.0);
        }
        if self.rows.len() < rows {
            self.rows.resize(rows, 0.0);
        }
        if needs.gravity && self.surplus.is_empty() {
            self.surplus.resize(nv, 0.0);
            self.surplus_slopes.fill(DMatrix::zeros(nv, nv));
        }
    }

    /// All of it.
    pub(super) fn all(&self) -> Sight<'_> {
        let Self { r, rows, surplus, surplus_slopes } = self;
        Sight { r, rows, surplus, surplus_slopes: surplus_slopes.each_ref() }
    }
}

impl AsMut<Self> for Seen {
    fn as_mut(&mut self) -> &mut Self {
        self
    }
}

/// What is known of the kinematics of a knot.
pub(super) enum Known<'a> {
    Nothing,
    /// Scratch whose last call was at its position.
    Placed(&'a mut Data<f64>),
    Seen(&'a Seen),
}

/// What the residuals of a list see.
#[derive(Clone, Copy)]
pub(super) struct Sight<'a> {
    r: &'a [f64],
    rows: &'a [f64],
    pub surplus: &'a [f64],
    pub surplus_slopes: [&'a DMatrix<f64>; 3],
}

impl<'a> Sight<'a> {
    /// Without what comes first in both.
    pub(super) fn after(self, [looks, rows]: [usize; 2]) -> Self {
        Self { r: &self.r[looks * STRIDE..], rows: &self.rows[rows..], ..self }
    }

    /// r of a residual.
    pub(super) fn residual(self, plan: &Plan) -> &'a [f64] {
        &self.r[plan.seat.index * STRIDE..][..plan.n]
    }

    /// Its rows, as wide as they are.
    pub(super) fn rows(self, nv: usize, residual: &Residual, plan: &Plan) -> core::slice::ChunksExact<'a, f64> {
        self.rows[plan.seat.rows..][..seen_rows(nv, residual, plan.n)].chunks_exact(width(nv, residual))
    }
}

/// The costs and the limits of a knot.
#[derive(Clone, Copy)]
pub(super) struct Stack<'a> {
    pub costs: &'a Costs,
    pub limits: &'a Set,
}

impl<'a> Stack<'a> {
    /// What its residuals look at.
    pub(super) fn needs(self) -> Needs {
        self.costs.room().needs | self.limits.room().needs
    }

    /// The residuals that look at kinematics, with their weights and where their numbers and rows begin.
    fn looks(self) -> impl Iterator<Item = (&'a Residual, f64, [usize; 2])> {
        let at = |plan: &Plan, [looks, rows]: [usize; 2]| [(looks + plan.seat.index) * STRIDE, rows + plan.seat.rows];
        let first = self.costs.room().seen;
        let costs = self.costs.looks().map(move |(term, plan)| (&term.residual, term.weight, at(plan, [0, 0])));
        costs.chain(self.limits.looks().map(move |(limit, plan)| (&limit.residual, 1.0, at(plan, first))))
    }

    /// Whether another knot looks at the same with its own targets.
    pub(super) fn is_alike(self, other: Self) -> bool {
        let same = core::ptr::eq(self.costs, other.costs) && core::ptr::eq(self.limits, other.limits);
        same || {
            let (ours, theirs) = (self.looks().map(|look| look.0), other.looks().map(|look| look.0));
            self.needs() == other.needs()
                && self.costs.room().seen == other.costs.room().seen
                && self.limits.room().seen == other.limits.room().seen
                && ours.zip(theirs).all(|(a, b)| a.looks_like(b))
        }
    }
}

/// Scratch of those who look.
#[derive(Clone, Debug)]
pub(super) struct Eyes<S> {
    /// ∂r/∂q and ∂r/∂v. Shape: 6 × nv.
    J: DMatrix<S>,
    Jv: DMatrix<S>,
    /// Zeros. Shape: nv.
    zero: Vec<S>,
    /// ∂c/∂q. Shape: 3 × nv.
    com: DMatrix<S>,
    /// ∂h_G/∂q, ∂h_G/∂v. Shape: 6 × nv.
    momentum: [DMatrix<S>; 2],
    /// M q̈ + h − g, or −g. Shape: nv.
    surplus: Vec<S>,
    /// Its derivative with respect to q. Shape: nv × nv.
    by_q: DMatrix<S>,
}

impl<S: Block<Number = f64>> Eyes<S> {
    pub(super) fn new(model: &Model) -> Self {
        let wide = |rows| DMatrix::from_element(rows, model.nv(), S::zero());
        let zero = vec![S::zero(); model.nv()];
        let (surplus, by_q) = (zero.clone(), wide(model.nv()));
        Self { J: wide(6), Jv: wide(6), zero, com: wide(3), momentum: [wide(6), wide(6)], surplus, by_q }
    }

    /// Computes what some knots see, whose stacks are alike, at a state (q, v) and q̈ with a lane for each of them; with the
    /// rows of Jacobians if slopes are asked for. The last call on `data` was at q.
    pub(super) fn look(
        &mut self,
        model: &Model,
        data: &mut Data<S>,
        x: [&[S]; 3],
        slopes: bool,
        stacks: &[Stack<'_>],
        to: &mut [impl AsMut<Seen>],
    ) {
        if stacks[0].needs().eyes() {
            S::enter(Look { eyes: self, model, data, x, slopes, stacks, to });
        }
    }
}

struct Look<'a, S, T> {
    eyes: &'a mut Eyes<S>,
    model: &'a Model,
    data: &'a mut Data<S>,
    /// q, v and q̈.
    x: [&'a [S]; 3],
    slopes: bool,
    stacks: &'a [Stack<'a>],
    to: &'a mut [T],
}

impl<S: Block<Number = f64>, T: AsMut<Seen>> Kernel for Look<'_, S, T> {
    #[inline(always)]
    fn run(self) {
        let Self { eyes, model, data, x: [q, v, a], slopes, stacks, to } = self;
        let needs = stacks[0].needs();
        if needs.gravity {
            eyes.weigh(model, data, [q, v, a], slopes, needs.inertia, to);
        }
        if !needs.placements && !needs.velocities {
            return;
        }
        if slopes && needs.com {
            eyes.com.as_mut_slice().copy_from_slice(centroidal_map(model, data, q).Jcom.as_slice());
        }
        if slopes && needs.momentum {
            let d = centroidal_derivatives(model, data, q, v, &eyes.zero);
            eyes.momentum[0].as_mut_slice().copy_from_slice(d.dh_dq.as_slice());
            eyes.momentum[1].as_mut_slice().copy_from_slice(d.dh_dv.as_slice());
        }
        let (placed, motion) = if needs.velocities {
            let motion = forward_velocities(model, data, q, v);
            (*motion, Some(motion))
        } else {
            if needs.gravity || data.placements(model).is_none() {
                forward_kinematics(model, data, q);
            }
            (data.placements(model).expect("kinematics place the bodies"), None)
        };
        let mut lanes: [_; WIDEST] = core::array::from_fn(|k| stacks[k.min(stacks.len() - 1)].looks());
        loop {
            let mut targets = [[0.0; WIDEST]; 12];
            let mut first = None;
            let mut weighty = false;
            for (k, looks) in lanes[..stacks.len()].iter_mut().enumerate() {
                let Some((residual, weight, at)) = looks.next() else { return };
                residual.write_target(k, &mut targets);
                weighty |= weight != 0.0;
                first.get_or_insert((residual, at));
            }
            let Some((residual, at)) = first.filter(|_| weighty) else { continue };
            let target = targets.map(|target| S::load(&target));
            let (n, r, slopes_of) = eyes.see(residual, target, &placed, motion.as_ref(), slopes);
            write(r, at[0], to);
            if slopes {
                let width = width(model.nv(), residual);
                for (J, first) in slopes_of.into_iter().flatten().zip([width - model.nv(), 0]) {
                    write_rows(J, n, width, at[1] + first, to);
                }
            }
        }
    }

    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}

/// r of a residual, its number of rows, and ∂r/∂q, ∂r/∂v.
type Looked<'a, S> = (usize, [S; 6], [Option<&'a DMatrix<S>>; 2]);

impl<S: Block<Number = f64>> Eyes<S> {
    /// M q̈ + h − g or, without `inertia`, −g, and its slopes.
    #[inline(always)]
    fn weigh(
        &mut self,
        model: &Model,
        data: &mut Data<S>,
        [q, v, a]: [&[S]; 3],
        slopes: bool,
        inertia: bool,
        to: &mut [impl AsMut<Seen>],
    ) {
        let Self { zero, surplus, by_q, .. } = self;
        surplus.copy_from_slice(if inertia { rnea(model, data, q, v, a, &[]) } else { zero });
        for (surplus, g) in surplus.iter_mut().zip(gravity(model, data, q)) {
            *surplus -= *g; // M q̈ + h − g
        }
        write_all(surplus, to, |seen| &mut seen.surplus);
        if !slopes {
            return;
        }
        by_q.as_mut_slice().fill(S::zero());
        if inertia {
            let d = rnea_derivatives(model, data, q, v, a, &[]);
            by_q.as_mut_slice().copy_from_slice(d.dtau_dq.as_slice());
            write_all(d.dtau_dv.as_slice(), to, |seen| seen.surplus_slopes[1].as_mut_slice());
            write_all(d.dtau_da.as_slice(), to, |seen| seen.surplus_slopes[2].as_mut_slice());
        }
        let dg = static_torque_derivative(model, data, q, &[]);
        for (by_q, dg) in by_q.as_mut_slice().iter_mut().zip(dg.as_slice()) {
            *by_q -= *dg; // ∂τ/∂q − ∂g/∂q
        }
        write_all(by_q.as_slice(), to, |seen| seen.surplus_slopes[0].as_mut_slice());
    }

    /// r of a residual with a target, and its Jacobians.
    #[inline(always)]
    fn see(
        &mut self,
        residual: &Residual,
        t: [S; 12],
        placed: &Placements<'_, S>,
        motion: Option<&Velocities<'_, S>>,
        slopes: bool,
    ) -> Looked<'_, S> {
        let motion = || motion.expect("velocities are computed where a residual needs them");
        let Self { J, Jv, com, momentum, .. } = self;
        let position = Vec3::new(t[0], t[1], t[2]);
        let rotation =
            Mat3 { x: Vec3::new(t[3], t[4], t[5]), y: Vec3::new(t[6], t[7], t[8]), z: Vec3::new(t[9], t[10], t[11]) };
        let six = [t[0], t[1], t[2], t[3], t[4], t[5]];
        let long = |x: Vec3<S>| [x.x, x.y, x.z, S::zero(), S::zero(), S::zero()];
        match *residual {
            // c − c_ref
            Residual::CenterOfMass { .. } => (3, long(placed.com() - position), [Some(com), None]),
            Residual::CentroidalMomentum { .. } => {
                let r = motion().centroidal_momentum() - Force::from(six); // h_G − h_ref
                (6, r.to_array(), [Some(&momentum[0]), Some(&momentum[1])])
            }
            Residual::FramePlacement { frame, .. } => {
                let X = Se3::new(rotation, position).inverse() * placed.frame(frame);
                let r = lie::log6(Quaternion::from_rotation(X.rotation), X.translation); // log(refXo oXf)
                if slopes {
                    placed.frame_jacobian(frame, ReferenceFrame::Local, J);
                    let Jlog = lie::jlog6(r);
                    for column in J.as_mut_slice().chunks_exact_mut(6) {
                        let m = Motion::from([column[0], column[1], column[2], column[3], column[4], column[5]]);
                        column.copy_from_slice(&(Jlog * m).to_array()); // Jlog J
                    }
                }
                (6, r.to_array(), [Some(J), None])
            }
            Residual::FrameTranslation { frame, .. } => {
                if slopes {
                    placed.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, J);
                }
                let r = placed.frame(frame).translation - position; // p − p_ref
                (3, long(r), [Some(J), None])
            }
            Residual::FrameRotation { frame, .. } => {
                let R = rotation.transpose() * placed.frame(frame).rotation;
                let r = lie::log3(Quaternion::from_rotation(R)); // log(R_refᵀ R)
                if slopes {
                    placed.frame_jacobian(frame, ReferenceFrame::Local, J);
                    let Jlog = lie::jlog3(r);
                    for column in J.as_mut_slice().chunks_exact_mut(6) {
                        let turned = Jlog * Vec3::new(column[3], column[4], column[5]);
                        column[..3].copy_from_slice(&turned.to_array()); // Jlog J
                    }
                }
                (3, long(r), [Some(J), None])
            }
            Residual::FrameVelocity { frame, reference, .. } => {
                let r = motion().frame_velocity(frame, reference) - Motion::from(six); // v − v_ref
                if slopes {
                    motion().frame_velocity_derivative(frame, reference, J); // ∂v/∂q
                    placed.frame_jacobian(frame, reference, Jv); // ∂v/∂q̇
                }
                (6, r.to_array(), [Some(J), Some(Jv)])
            }
            _ => unreachable!("it does not look at kinematics"),
        }
    }
}

/// Writes r, a lane for each knot.
#[inline(always)]
fn write<S: Block<Number = f64>>(r: [S; 6], at: usize, to: &mut [impl AsMut<Seen>]) {
    let mut numbers = [S::zero(); STRIDE];
    numbers[..6].copy_from_slice(&r);
    for (i, block) in numbers.chunks_exact_mut(S::LANES).enumerate() {
        S::transpose(block);
        for (to, lane) in to.iter_mut().zip(block) {
            lane.store(&mut to.as_mut().r[at + i * S::LANES..]);
        }
    }
}

/// Writes numbers with a lane for each knot to where each knot has them.
#[inline(always)]
fn write_all<S: Block<Number = f64>>(from: &[S], to: &mut [impl AsMut<Seen>], place: impl Fn(&mut Seen) -> &mut [f64]) {
    let count = to.len();
    scatter_rows(from, &mut places(to, |to| place(to.as_mut()))[..count]);
}

/// Writes the first n rows of a Jacobian, each to the beginning of one of `width` numbers.
#[inline(always)]
fn write_rows<S: Block<Number = f64>>(J: &DMatrix<S>, n: usize, width: usize, at: usize, to: &mut [impl AsMut<Seen>]) {
    let (strides, shape, count) = ([1, J.nrows()], [n, J.ncols()], to.len());
    let to = &mut places(to, |to| &mut to.as_mut().rows[at..])[..count];
    scatter_matrix(&Strided { vectors: J.as_slice(), strides, shape, negative: false }, to, width);
}
