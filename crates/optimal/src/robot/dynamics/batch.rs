//! Dynamics of one knot, or of several knots in the lanes of a SIMD register, with the quantities that residuals read.
//!
//! The coordinates of the knots are packed: each scalar has one lane per knot. The passes of the dynamics then run once
//! for all these knots. The results are unpacked into the data of each knot, because costs and the sweep process knot
//! by knot.
#![allow(non_snake_case)] // names follow the literature: J, M

use super::group_kernel::GroupKernel;
use super::kkt_elimination::Tableau;
use super::limb_elimination::{
    LimbElimination, invert_blocks, restore, solve_blocks, write_drift, write_jacobian, write_motion,
};
use super::shared_data::Lent;
use crate::problem::Evaluation;
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, SHARED, constraint_set};
use crate::robot::continuous::KnotInput;
use crate::robot::horizon::HorizonTerms;
use crate::robot::knot_data::{KnotData, WIDEST, unpack};
use crate::robot::residuals::gravity_residual::GravityResidual;
use crate::robot::residuals::kernel::{KnotGroup, ResidualKernel};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Mat3, Model, Motion, Se3, Target, Vec3, aba, aba_derivatives,
    constrained_dynamics, constrained_dynamics_derivatives, constrained_equations_at, constrained_inverse_dynamics,
    constrained_inverse_dynamics_derivatives, rnea, rnea_derivatives,
};
use condyle_spatial::block::{Block, Real, SimdToken, gather_rows, scatter};
use condyle_spatial::{Matrix, matrix};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Token that allows this crate to name SIMD vector types.
pub(crate) struct Gate;

// SAFETY: SIMD vectors are used only by the kernels of `condyle_dynamics`, and by code that is called like these
// kernels.
#[allow(unsafe_code)]
unsafe impl SimdToken for Gate {}

/// Vector with few lanes.
pub(crate) type Short = <f64 as Real>::Narrow<Gate>;
/// Vector with the lanes of the widest registers.
pub(crate) type Long = <f64 as Real>::Wide<Gate>;

/// Kind of dynamics: the equations that determine the accelerations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DynamicsKind {
    /// Terminal knot, without accelerations.
    None,
    /// Free motion, q̈ = M⁻¹ (τ − h).
    Free,
    /// Motion in contact, M q̈ + h = τ + Jᵀλ and J q̈ + γ = 0. Fields: the contacts, and the damping μ.
    Contact(Vec<Contact>, f64),
    /// Impact, v⁺ − v = −M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v.
    Impact {
        contacts: Vec<Contact>,
        /// Coefficient of restitution ε.
        restitution: f64,
        /// Damping μ.
        damping: f64,
    },
    /// Inverse dynamics of free motion: the controls are q̈ = u; the efforts are τ = M q̈ + h.
    Inverse,
    /// Inverse dynamics in contact: the controls are (q̈, λ) = u; the efforts are τ = M q̈ + h − Jᵀλ. Fields: the
    /// contacts, and the actuation.
    ContactInverse(Vec<Contact>, Actuation),
}

impl DynamicsKind {
    /// Returns the contacts of a knot.
    pub(crate) fn contacts(&self) -> &[Contact] {
        match self {
            Self::Contact(contacts, _) | Self::ContactInverse(contacts, _) | Self::Impact { contacts, .. } => contacts,
            Self::None | Self::Free | Self::Inverse => &[],
        }
    }

    /// Returns whether two kinds differ at most in the targets of their contacts.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        let same_contact = |to: &Contact, from: &Contact| {
            let constraint = ContactConstraint { target: from.constraint.target, ..to.constraint };
            to.name == from.name && constraint == from.constraint
        };
        let (own, others) = (self.contacts(), other.contacts());
        let alike = || own.len() == others.len() && own.iter().zip(others).all(|(to, from)| same_contact(to, from));
        match (self, other) {
            (Self::Contact(_, own), Self::Contact(_, other)) => own == other && alike(),
            (Self::ContactInverse(_, own), Self::ContactInverse(_, other)) => own == other && alike(),
            _ => self == other,
        }
    }
}

/// Group of knots with their states and controls, and the kind of quantities to compute for them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group<'a> {
    /// Indices of the knots.
    pub knots: &'a [usize],
    /// States of the knots, one after the other; the next field contains the controls of the knots.
    pub xs: &'a [f64],
    pub us: &'a [f64],
    pub what: Evaluation<'a>,
    /// Whether limits are evaluated, as at the first stage of an integration step.
    pub limited: bool,
    /// Durations of the knots, if the Jacobians of their steps of semi-implicit Euler are computed; empty otherwise.
    pub durations: &'a [f64],
}

impl<'a> Group<'a> {
    /// Returns the group that consists of one knot.
    pub(crate) fn one(input: &'a KnotInput<'a>, what: Evaluation<'a>, limited: bool) -> Self {
        Self { knots: core::slice::from_ref(&input.t), xs: input.x, us: input.u, what, limited, durations: &[] }
    }
}

/// Costs and limits of the lanes of a batch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneTerms<'a> {
    /// Costs and limits of the robot that computes the batch.
    pub own: &'a HorizonTerms,
    /// Costs and limits of each lane, where they belong to another robot; empty if all lanes belong to one robot.
    pub each: &'a [Option<&'a HorizonTerms>],
}

impl<'a> LaneTerms<'a> {
    /// Returns the costs and limits of the robot to which a lane belongs.
    fn of(self, lane: usize) -> &'a HorizonTerms {
        self.each.get(lane).copied().flatten().unwrap_or(self.own)
    }
}

/// Workspace of each kind of dynamics.
#[derive(Debug)]
pub(crate) enum Pass<S> {
    None,
    Free,
    /// Constraints of the contacts, and the Jacobian J of these constraints. Shape: rows × nv.
    Contact(Box<ConstraintSet<S>>, Matrix<S>),
    Inverse,
    /// Constraints of the contacts, and the Jacobian J of these constraints. Shape: rows × nv.
    ContactInverse(Box<ConstraintSet<S>>, Matrix<S>),
}

/// Dynamics of as many knots as the scalar `S` has lanes.
#[derive(Debug)]
pub(crate) struct KnotBatch<S> {
    pub data: Lent<S>,
    pub pass: Pass<S>,
    gravity_residual: GravityResidual<S>,
    residuals: ResidualKernel<S>,
    groups: GroupKernel<S>,
    q: Vec<S>,
    v: Vec<S>,
    /// Quantity that the controls drive: the efforts τ, or the accelerations q̈ if accelerations are controls.
    tau: Vec<S>,
    a: Vec<S>,
    lambda: Vec<S>,
    linear: LinearEquations<S>,
    /// Whether the last kinematic pass was computed at the position `q`.
    visited: bool,
}

impl<S: Block<Number = f64>> KnotBatch<S> {
    /// Allocates the workspace for a robot, except the memory `data`. The contacts of `kind` must have been checked
    /// before.
    #[inline(never)]
    pub(crate) fn new(model: &Model, kind: &DynamicsKind, data: Lent<S>) -> Self {
        let (nv, zeros) = (model.nv(), |n| vec![S::zero(); n]);
        let pass = match kind {
            DynamicsKind::None | DynamicsKind::Impact { .. } => Pass::None,
            DynamicsKind::Free => Pass::Free,
            DynamicsKind::Contact(contacts, damping) => {
                let set = Box::new(constraint_set(model, contacts, *damping).expect("was checked when it was given"));
                let J = matrix(set.rows(), nv, S::zero());
                Pass::Contact(set, J)
            }
            DynamicsKind::Inverse => Pass::Inverse,
            DynamicsKind::ContactInverse(contacts, _) => {
                let set = Box::new(constraint_set(model, contacts, SHARED).expect("was checked when it was given"));
                let J = matrix(set.rows(), nv, S::zero());
                Pass::ContactInverse(set, J)
            }
        };
        let (gravity_residual, residuals) = (GravityResidual::new(nv), ResidualKernel::new(nv));
        let groups = GroupKernel::new(model);
        let (q, v, tau, a) = (zeros(model.nq()), zeros(nv), zeros(nv), zeros(nv));
        let rows = if let Pass::Contact(set, _) | Pass::ContactInverse(set, _) = &pass { set.rows() } else { 0 };
        let lambda = zeros(rows);
        let linear = LinearEquations::new();
        Self { data, pass, gravity_residual, residuals, groups, q, v, tau, a, lambda, linear, visited: false }
    }

    /// Sets target and gains of contact k, which must be valid.
    pub(crate) fn set_contact(&mut self, k: usize, contact: &ContactConstraint) {
        if let Pass::Contact(set, _) | Pass::ContactInverse(set, _) = &mut self.pass {
            let ContactConstraint { target, kp, kp_axes, kd, .. } = *contact;
            set.set_target(k, target.lift()).expect("was checked");
            set.set_gains(k, kp, kp_axes, kd).expect("was checked");
        }
    }

    /// Sets a target of contact k for each lane. The targets must be valid.
    pub(crate) fn set_targets(&mut self, k: usize, targets: &[Target<f64>]) {
        let (Pass::Contact(set, _) | Pass::ContactInverse(set, _)) = &mut self.pass else { return };
        let numbers = |target: &Target<f64>| -> [Vec3<f64>; 8] {
            let Target { placement: Se3 { rotation: Mat3 { x, y, z }, translation }, velocity, acceleration } = *target;
            let (v, a) = (velocity, acceleration);
            [x, y, z, translation, v.linear, v.angular, a.linear, a.angular]
        };
        let mut each = [[0.0; 24]; WIDEST];
        for (each, target) in each.iter_mut().zip(targets) {
            for (to, from) in each.chunks_exact_mut(3).zip(numbers(target)) {
                to.copy_from_slice(&from.to_array());
            }
        }
        let mut lanes = [S::zero(); 24];
        pack(targets.len(), |lane| &each[lane][..], &mut lanes);
        let vector = |i: usize| Vec3::new(lanes[3 * i], lanes[3 * i + 1], lanes[3 * i + 2]);
        let [x, y, z, translation] = [0, 1, 2, 3].map(vector);
        let [velocity, acceleration] = [4, 6].map(|i| Motion::new(vector(i), vector(i + 1)));
        let placement = Se3::new(Mat3 { x, y, z }, translation);
        set.set_target(k, Target { placement, velocity, acceleration }).expect("was checked");
    }

    /// Allocates the workspace for the equations of knots in inverse-dynamics form.
    pub(crate) fn reserve(&mut self, tableau: Tableau, eliminations: Vec<Arc<LimbElimination>>) {
        self.linear.reserve(tableau, eliminations);
    }

    /// Computes the dynamics of the knots of `group`, from the efforts or accelerations in the data of each knot. Also
    /// computes the quantities that residuals read. This is limited to knots whose residuals differ only in their
    /// targets from the residuals of the first knot.
    pub(crate) fn run(&mut self, model: &Model, group: Group<'_>, terms: LaneTerms<'_>, to: &mut [KnotData]) {
        self.pack(model, group.xs, to);
        pack(to.len(), |k| &to[k].tau, &mut self.tau);
        match group.what {
            Evaluation::Equations { .. } => self.run_equations(model, to),
            what => self.run_pass(model, what == Evaluation::Derivatives, terms.own.layout().forces, to),
        }
        if group.what != Evaluation::Values {
            self.groups.run_steps(model, [&self.v, &self.a], group.durations, to);
        }
        self.run_residuals(model, group, terms, to);
    }

    /// Copies the states of the knots into the lanes of q and v.
    fn pack(&mut self, model: &Model, xs: &[f64], of: &[KnotData]) {
        let (nq, nx) = (model.nq(), model.nq() + model.nv());
        pack(of.len(), |k| &xs[k * nx..][..nq], &mut self.q);
        pack(of.len(), |k| &xs[k * nx + nq..][..nx - nq], &mut self.v);
        self.visited = false;
    }

    /// Computes accelerations and forces, and if requested their derivatives. Derivatives of forces are computed only
    /// if `forces` is set.
    fn run_pass(&mut self, model: &Model, derivatives: bool, forces: bool, to: &mut [KnotData]) {
        let Self { data, pass, q, v, tau, a, lambda, .. } = self;
        let data = &mut *data.get();
        match pass {
            Pass::None => return,
            Pass::Free if !derivatives => a.copy_from_slice(aba(model, data, q, v, tau, &[])),
            Pass::Free => {
                let d = aba_derivatives(model, data, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack_matrices([d.da_dq, d.da_dv, d.da_dtau], to, |to| &mut to.da);
            }
            Pass::Contact(set, _) if !derivatives => {
                let d = constrained_dynamics(model, data, set, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack(d.lambda, to, |to| &mut to.lambda);
            }
            Pass::Contact(set, _) => {
                let d = constrained_dynamics_derivatives(model, data, set, q, v, tau, &[]);
                a.copy_from_slice(d.a);
                unpack(d.lambda, to, |to| &mut to.lambda);
                unpack_matrices([d.da_dq, d.da_dv, d.da_dtau], to, |to| &mut to.da);
                if forces {
                    unpack_matrices([d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau], to, |to| &mut to.dlambda);
                }
            }
            Pass::Inverse => {
                a.copy_from_slice(tau);
                unpack(rnea(model, data, q, v, a, &[]), to, |to| &mut to.tau);
                if derivatives {
                    let d = rnea_derivatives(model, data, q, v, a, &[]);
                    unpack_matrices([d.dtau_dq, d.dtau_dv, d.dtau_da], to, |to| &mut to.dtau);
                }
            }
            Pass::ContactInverse(set, _) if !derivatives => {
                a.copy_from_slice(tau);
                pack(to.len(), |k| &to[k].lambda, lambda);
                let d = constrained_inverse_dynamics(model, data, set, q, v, a, lambda, &[]);
                unpack(d.tau, to, |to| &mut to.tau);
                unpack(d.acceleration, to, |to| &mut to.contact_acceleration);
            }
            Pass::ContactInverse(set, J) => {
                a.copy_from_slice(tau);
                pack(to.len(), |k| &to[k].lambda, lambda);
                let d = constrained_inverse_dynamics_derivatives(model, data, set, q, v, a, lambda, &[]);
                unpack(d.tau, to, |to| &mut to.tau);
                unpack(d.acceleration, to, |to| &mut to.contact_acceleration);
                unpack_matrices([d.dtau_dq, d.dtau_dv, d.M], to, |to| &mut to.dtau);
                for (k, from) in [d.dacceleration_dq, d.dacceleration_dv].into_iter().enumerate() {
                    unpack(from.as_slice(), to, |to| to.dcontact_acceleration[k].as_mut_slice());
                }
                set.jacobian(J);
                unpack(J.as_slice(), to, |to| to.dcontact_acceleration[2].as_mut_slice());
            }
        }
        unpack(a, to, |to| &mut to.a);
        self.visited = true;
    }

    /// Computes the equations of motion of the knots at the states `xs`. The accelerations and forces are in the data
    /// of each knot.
    pub(crate) fn run_equations_at(&mut self, model: &Model, xs: &[f64], to: &mut [KnotData]) {
        self.pack(model, xs, to);
        self.run_equations(model, to);
    }

    /// Computes the equations of motion at the known accelerations and forces, and eliminates the limbs and the base
    /// from the equations.
    fn run_equations(&mut self, model: &Model, to: &mut [KnotData]) {
        let Self { data, pass, q, v, a, lambda, linear, .. } = self;
        let data = &mut *data.get();
        pack(to.len(), |k| &to[k].a, a);
        match pass {
            Pass::Contact(set, J) => {
                pack(to.len(), |k| &to[k].lambda, lambda);
                let mu = set.proximal.mu;
                let d = constrained_equations_at(model, data, set, q, v, a, lambda);
                let LinearEquations { size, tableau, .. } = linear;
                write_motion(*size, d.M, d.dtau_dv, d.dtau_dq, tableau);
                write_drift(*size, d.dgamma_dv, d.dgamma_dq, mu, tableau);
                set.jacobian(J);
                write_jacobian(*size, J, tableau);
            }
            _ => {
                let d = rnea_derivatives(model, data, q, v, a, &[]);
                write_motion(linear.size, d.dtau_da, d.dtau_dv, d.dtau_dq, &mut linear.tableau);
            }
        }
        linear.solve(to);
        self.visited = true;
    }

    /// Computes the quantities that residuals read, at a knot whose accelerations are known.
    pub(crate) fn run_residuals_at(
        &mut self,
        model: &Model,
        group: Group<'_>,
        terms: LaneTerms<'_>,
        to: &mut KnotData,
    ) {
        let to = core::slice::from_mut(to);
        self.pack(model, group.xs, to);
        pack(1, |_| &to[0].a, &mut self.a);
        self.run_residuals(model, group, terms, to);
    }

    /// Computes the quantities that residuals read, at the knots whose residuals differ only in their targets from the
    /// residuals of the first knot.
    fn run_residuals(
        &mut self,
        model: &Model,
        Group { knots, what, limited, .. }: Group<'_>,
        terms: LaneTerms<'_>,
        to: &mut [KnotData],
    ) {
        let first = terms.of(0).at(knots[0], limited);
        let mut each = [first; WIDEST];
        for (k, to) in to.iter_mut().enumerate() {
            to.residuals.reserve(model.nv(), terms.of(k).layouts());
            let own = terms.of(k).at(knots[k], limited);
            to.residuals.is_written = own.is_alike(first);
            if to.residuals.is_written {
                each[k] = own;
            }
        }
        let Self { data, gravity_residual, residuals, groups, q, v, a, visited, .. } = self;
        let (data, requirements) = (&mut *data.get(), first.layout().requirements);
        let mut group =
            KnotGroup { terms: &each[..to.len()], data: to, slopes: what != Evaluation::Values, visited: *visited };
        groups.run_states(model, q, &mut group);
        if requirements.gravity {
            gravity_residual.run(model, data, [q, v, a], requirements.inertia, &mut group);
            group.visited = true;
        }
        if requirements.placements || requirements.velocities {
            residuals.run(model, data, [q, v], &mut group);
        }
    }
}

/// Linear equations of motion of several knots, with one lane for each knot.
#[derive(Debug)]
struct LinearEquations<S> {
    size: Tableau,
    /// Eliminations in their order: of the limbs, then of the base.
    eliminations: Vec<Arc<LimbElimination>>,
    tableau: Vec<S>,
    /// Copy of the tableau before an elimination.
    before: Vec<S>,
    /// Inverses B⁻¹ of all blocks of an elimination; the next field is the matrix Y = B⁻¹ J of one block.
    inverses: Vec<S>,
    Y: Vec<S>,
}

impl<S: Block<Number = f64>> LinearEquations<S> {
    /// Creates equations without memory.
    fn new() -> Self {
        let [tableau, before, inverses, Y] = [(); 4].map(|()| Vec::new());
        Self { size: Tableau { nv: 0, rows: 0 }, eliminations: Vec::new(), tableau, before, inverses, Y }
    }

    /// Allocates memory for equations of the given size and for their eliminations.
    fn reserve(&mut self, size: Tableau, eliminations: Vec<Arc<LimbElimination>>) {
        let most = |room: fn(&LimbElimination) -> usize| {
            eliminations.iter().map(|elimination| room(elimination)).max().unwrap_or(0)
        };
        self.tableau.resize(size.len(), S::zero());
        self.before.resize(size.len(), S::zero());
        self.inverses.resize(most(LimbElimination::room), S::zero());
        self.Y.resize(most(LimbElimination::columns), S::zero());
        (self.size, self.eliminations) = (size, eliminations);
    }

    /// Eliminates the limbs and the base of each knot where the pivots are large enough, and writes the equations to
    /// the knot's data.
    fn solve(&mut self, to: &mut [KnotData]) {
        let Self { size, eliminations, tableau, before, inverses, Y } = self;
        let mut singular = S::zero();
        to.iter_mut().for_each(|to| to.eliminations = 0);
        for elimination in eliminations {
            let mut each = [0.0; WIDEST];
            invert_blocks(elimination, *size, tableau, inverses, &mut singular);
            scatter(core::slice::from_ref(&singular), to.len(), &mut each);
            let each = &each[..to.len()];
            to.iter_mut().zip(each).for_each(|(to, singular)| to.eliminations += usize::from(*singular == 0.0));
            let all = each.iter().all(|singular| *singular == 0.0);
            if !all {
                before.copy_from_slice(tableau);
            }
            solve_blocks(elimination, *size, tableau, inverses, Y);
            if !all {
                restore(singular, before, tableau);
            }
        }
        unpack(tableau, to, |to| &mut to.equations);
    }
}

/// Copies the slices of `count` knots into the lanes of `to`, one lane for each knot.
fn pack<'a, S: Block<Number = f64>>(count: usize, of: impl Fn(usize) -> &'a [f64], to: &mut [S]) {
    if S::LANES == 1 {
        return gather_rows(&[of(0)], to);
    }
    let rows: [&[f64]; WIDEST] = core::array::from_fn(|k| of(k.min(count - 1)));
    gather_rows(&rows[..count], to);
}

/// Copies each lane of three matrices to the data of one knot.
fn unpack_matrices<S: Block<Number = f64>>(
    from: [&Matrix<S>; 3],
    to: &mut [KnotData],
    part: impl Fn(&mut KnotData) -> &mut [DMatrix<f64>; 3],
) {
    for (k, from) in from.into_iter().enumerate() {
        unpack(from.as_slice(), to, |to| part(to)[k].as_mut_slice());
    }
}
