//! Layout of the residuals of a knot: the method of computing each residual, the quantities that it reads, and the
//! offset of its entries.
#![allow(non_snake_case)] // names follow the literature: W

use super::distance::prepare;
use super::residual::{Part, Residual};
use crate::lq::LARGEST_BLOCK;
use crate::robot::outputs::{Capabilities, Output};
use condyle_dynamics::Model;
use condyle_dynamics::distances::prepared::PreparedPairs;
use core::ops::{Add, BitOr, Range};
use nalgebra::DMatrix;

/// Plan for the computation of a residual, created once for a robot.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Number of entries of the residual.
    pub n: usize,
    /// Offset of the residual's entries: the number of entries of all terms before this one.
    pub first: usize,
    /// Index of the first slot of a kinematic residual among the slots of the knot's kinematic residuals. For a
    /// residual of the state, the offset of its data in [`KinematicData::states`].
    pub slot: usize,
    /// Index of the residual's frame in the robot; 0 if the residual reads no frame.
    pub frame: usize,
    /// Pairs of geometries whose distances are the entries of the residual; empty for other residuals.
    pub pairs: PreparedPairs,
    /// Range of these distances (m).
    pub range: f64,
    /// Range in λ of the rows of the residual's contact.
    pub rows: Range<usize>,
    /// Whether the knot has contacts.
    pub in_contact: bool,
    /// Matrix W, row after row, of a residual W f or W τ. Here f is a contact's force and τ the efforts.
    pub W: Vec<f64>,
}

impl Plan {
    /// Returns the plan of a residual, or a text that describes why the residual does not fit the robot or its
    /// dynamics.
    pub(crate) fn new(model: &Model, capabilities: &Capabilities, residual: &Residual) -> Result<Self, String> {
        let n = residual.check(model, capabilities)?;
        let frame = residual.frame().map_or(Ok(0), |name| name.number(model)).map_err(|error| error.to_string())?;
        let rows = residual.contact().map_or(Ok(0..0), |name| capabilities.contact(name))?;
        let W = match residual {
            Residual::UndrivenEffort => capabilities.undriven.clone(),
            _ => residual.force_rows(rows.len()),
        };
        let pairs = match residual {
            Residual::Distances { pairs, .. } => prepare(model, pairs)?,
            _ => PreparedPairs::default(),
        };
        let range = if let Residual::Distances { range, .. } = residual { *range } else { f64::INFINITY };
        let in_contact = !capabilities.contacts.is_empty();
        Ok(Self { n, first: 0, slot: 0, frame, pairs, range, rows, in_contact, W })
    }

    /// Returns the number of slots that a kinematic residual occupies. Slots are consecutive, so a residual with many
    /// entries is stored without gaps.
    pub(crate) fn slots(&self) -> usize {
        self.n.div_ceil(STRIDE)
    }

    /// Returns whether two kinematic residuals of the same kind read the same frame, and the same pairs of shapes up to
    /// sizes and poses.
    pub(crate) fn reads_the_bodies_of(&self, other: &Self) -> bool {
        self.frame == other.frame && self.range == other.range && self.pairs.is_like(&other.pairs)
    }
}

/// Returns the length of a row of a kinematic residual's Jacobian. The Jacobian is with respect to only q, or to (v,
/// q).
pub(crate) fn row_width(nv: usize, residual: &Residual) -> usize {
    if residual.part() == Part::Positions { nv } else { 2 * nv }
}

/// Memory sizes for the residuals of a knot, and flags for the quantities that these residuals read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct KnotLayout {
    /// Largest number of entries of one residual.
    pub longest: usize,
    /// Number of Jacobian rows with respect to (u, v, q), and number of Jacobian rows with respect to only q.
    pub rows: [usize; 2],
    /// Number of kinematic residuals, and number of their slots.
    pub kinematic: usize,
    pub slots: usize,
    /// Number of residuals of the state.
    pub states: usize,
    /// Whether a residual reads contact forces.
    pub forces: bool,
    /// Whether a residual is user-defined; the next field tells whether a user-defined residual has second derivatives.
    pub own: bool,
    pub curved: bool,
    pub requirements: Requirements,
}

impl KnotLayout {
    /// Returns the layout of a single residual.
    pub(crate) fn of(residual: &Residual, plan: &Plan) -> Self {
        let rows = match residual.part() {
            Part::All => [plan.n, 0],
            Part::Positions => [0, plan.n],
            Part::Diagonal => [0, 0],
        };
        let kinematic = usize::from(residual.is_kinematic());
        let slots = kinematic * plan.slots();
        let states = usize::from(matches!(residual, Residual::State { .. }));
        let forces = residual.output() == Some(Output::Force);
        let requirements = Requirements::of(residual, plan.in_contact);
        let own = matches!(residual, Residual::Own(_));
        let curved = matches!(residual, Residual::Own(own) if own.has_hessian());
        Self { longest: plan.n, rows, kinematic, slots, states, forces, own, curved, requirements }
    }

    /// Returns a layout that is large enough for either of two knots.
    pub(crate) fn or(self, other: Self) -> Self {
        let most = |a: [usize; 2], b: [usize; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        let (kinematic, slots) = (self.kinematic.max(other.kinematic), self.slots.max(other.slots));
        let states = self.states.max(other.states);
        Self { rows: most(self.rows, other.rows), kinematic, slots, states, ..self + other }
    }
}

/// Layout of the residuals of two lists in one knot.
impl Add for KnotLayout {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let sum = |a: [usize; 2], b: [usize; 2]| [a[0] + b[0], a[1] + b[1]];
        Self {
            longest: self.longest.max(other.longest),
            rows: sum(self.rows, other.rows),
            kinematic: self.kinematic + other.kinematic,
            slots: self.slots + other.slots,
            states: self.states + other.states,
            forces: self.forces | other.forces,
            own: self.own | other.own,
            curved: self.curved | other.curved,
            requirements: self.requirements | other.requirements,
        }
    }
}

/// Flags for the quantities of the whole robot that the residuals of a knot read. Each quantity is computed once per
/// knot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Requirements {
    pub placements: bool,
    pub velocities: bool,
    /// Whether a residual reads the Jacobian of the centre of mass.
    pub com: bool,
    pub momentum: bool,
    /// Whether a residual reads the efforts g that hold the robot still.
    pub gravity: bool,
    /// Whether a residual reads the efforts M q̈ + h of joints and contacts together.
    pub inertia: bool,
    /// Whether a residual reads the velocity change of the centre of mass at an impact.
    pub impulse_com: bool,
}

impl Requirements {
    fn of(residual: &Residual, in_contact: bool) -> Self {
        let mut all = Self::default();
        match residual {
            Residual::ControlGravity => (all.gravity, all.inertia) = (true, in_contact),
            Residual::CenterOfMass { .. } => (all.com, all.placements) = (true, true),
            Residual::CentroidalMomentum { .. } => (all.momentum, all.velocities) = (true, true),
            Residual::FrameVelocity { .. } | Residual::HeadingVelocity { .. } => all.velocities = true,
            Residual::ImpulseCenterOfMass => all.impulse_com = true,
            Residual::Distances { .. } => all.placements = true,
            _ => all.placements = residual.frame().is_some(),
        }
        all
    }
}

impl BitOr for Requirements {
    type Output = Self;
    fn bitor(self, o: Self) -> Self {
        Self {
            placements: self.placements | o.placements,
            velocities: self.velocities | o.velocities,
            com: self.com | o.com,
            momentum: self.momentum | o.momentum,
            gravity: self.gravity | o.gravity,
            inertia: self.inertia | o.inertia,
            impulse_com: self.impulse_com | o.impulse_com,
        }
    }
}

/// Number of entries of a slot. A residual with more entries occupies several slots.
pub(crate) const STRIDE: usize = 8;
/// Number of Jacobian entries of a slot per coordinate: six rows with respect to v and six with respect to q, or up to
/// `STRIDE` rows with respect to only q.
pub(crate) const ROWS: usize = 12;

/// Quantities that the residuals of a knot read. A quantity is not written if no term of the knot requires it.
#[derive(Clone, Debug, Default)]
pub(crate) struct ResidualData {
    /// Kinematic residuals of the costs, then of the limits.
    pub kinematic: [KinematicData; 2],
    /// Gravity residual without τ: M q̈ + h − g at a knot with contacts, −g at other knots. Shape: nv.
    pub gravity_residual: Vec<f64>,
    /// Derivatives of `gravity_residual` with respect to q, v and q̈; without contacts, only with respect to q. Shape:
    /// nv × nv.
    pub dsurplus: [DMatrix<f64>; 3],
    /// Velocity change J_c (v⁺ − v) of the centre of mass at an impact.
    pub com_change: [f64; 3],
    /// Derivatives of `com_change`: with respect to q at constant v⁺ − v, and with respect to v⁺ − v. Shape: 3 × nv.
    pub dcom_change: [DMatrix<f64>; 2],
    /// Whether these quantities have been written for the terms of the knot.
    pub is_written: bool,
}

/// Kinematic residuals and the rows of their Jacobians. The `slot` of a residual's plan gives its first slot.
#[derive(Clone, Debug, Default)]
pub(crate) struct KinematicData {
    pub r: Vec<f64>,
    pub rows: Vec<f64>,
    /// Differences to the references of state residuals, for joints whose positions are not a vector space, and their
    /// Jacobians. See [`difference`](Self::difference).
    pub states: Vec<f64>,
}

impl ResidualData {
    /// Allocates memory for the residuals of costs and of limits, if the present memory is too small.
    pub(crate) fn reserve(&mut self, nv: usize, layouts: [KnotLayout; 2]) {
        for (data, KnotLayout { slots, states, .. }) in self.kinematic.iter_mut().zip(layouts) {
            if data.states.len() < states * state_size(nv) {
                data.states.resize(states * state_size(nv), 0.0);
            }
            if data.r.len() < slots * STRIDE {
                data.r.resize(slots * STRIDE, 0.0);
                data.rows.resize(slots * ROWS * nv, 0.0);
            }
        }
        let requirements = layouts[0].requirements | layouts[1].requirements;
        if requirements.gravity && self.gravity_residual.is_empty() {
            self.gravity_residual.resize(nv, 0.0);
            self.dsurplus.fill(DMatrix::zeros(nv, nv));
        }
        if requirements.impulse_com && self.dcom_change[0].is_empty() {
            self.dcom_change.fill(DMatrix::zeros(3, nv));
        }
    }
}

/// Returns the number of entries that the data of a state residual occupies: one difference and one row of at most
/// [`LARGEST_BLOCK`] entries for each coordinate.
pub(crate) fn state_size(nv: usize) -> usize {
    (1 + LARGEST_BLOCK) * nv
}

impl KinematicData {
    /// Returns the difference q ⊖ q_ref of the joint with the coordinates `group`, and the block of its derivative with
    /// respect to q, column after column.
    pub(crate) fn difference(&self, plan: &Plan, group: &Range<usize>) -> (&[f64], &[f64]) {
        let n = group.len();
        self.states[plan.slot + (1 + LARGEST_BLOCK) * group.start..][..n + n * n].split_at(n)
    }

    /// Returns the entries of a residual.
    pub(crate) fn residual(&self, plan: &Plan) -> &[f64] {
        &self.r[plan.slot * STRIDE..][..plan.n]
    }

    /// Returns the rows of the Jacobian of a residual.
    pub(crate) fn rows(&self, nv: usize, residual: &Residual, plan: &Plan) -> core::slice::ChunksExact<'_, f64> {
        let width = row_width(nv, residual);
        self.rows[plan.slot * ROWS * nv..][..plan.n * width].chunks_exact(width)
    }
}
