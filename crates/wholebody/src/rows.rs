//! The rows of A, in the order of their cones, and which entries may differ from zero.

use crate::task::FrictionContact;
use clarabel::solver::SupportedConeT;
use condyle_dynamics::{Joint, Model};
use condyle_spatial::Vec3;

/// A bound on the normal force of a contact: sign · f_n ≤ sign · bound.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ForceBound {
    pub contact: usize,
    pub sign: f64,
    pub bound: f64,
}

/// Row by row: what the constraints are about. x = (q̈, f₁ … f_k) has nv + 3 k entries.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    /// Coordinates of free-flyers, on which no motor acts: M q̈ + h − Jᵀ f = 0.
    pub free: Vec<usize>,
    /// The other coordinates.
    pub actuated: Vec<usize>,
    /// Coordinates of a limited motor and the limit: two rows for each.
    pub limited: Vec<(usize, f64)>,
    pub force_bounds: Vec<ForceBound>,
    /// (t₁, t₂, n) of each contact.
    pub axes: Vec<[Vec3<f64>; 3]>,
    nv: usize,
}

impl Rows {
    pub(crate) fn new(model: &Model, contacts: &[FrictionContact], effort: &[f64]) -> Self {
        let free_flyers = model.bodies().iter().skip(1).filter(|b| b.joint == Joint::FreeFlyer);
        let free: Vec<usize> = free_flyers.flat_map(|b| b.idx_v..b.idx_v + 6).collect();
        let actuated: Vec<usize> = (0..model.nv()).filter(|i| !free.contains(i)).collect();
        let limited = actuated.iter().map(|&i| (i, effort[i])).filter(|l| l.1.is_finite()).collect();
        let mut force_bounds = Vec::new();
        for (contact, c) in contacts.iter().enumerate() {
            if c.min_force > 0.0 {
                force_bounds.push(ForceBound { contact, sign: -1.0, bound: c.min_force });
            }
            if c.max_force.is_finite() {
                force_bounds.push(ForceBound { contact, sign: 1.0, bound: c.max_force });
            }
        }
        let axes = contacts.iter().map(FrictionContact::axes).collect();
        Self { free, actuated, limited, force_bounds, axes, nv: model.nv() }
    }

    /// The first row that holds contact k.
    pub(crate) fn held(&self, k: usize) -> usize {
        self.free.len() + 3 * k
    }

    /// The first of the two rows of torque limit l.
    pub(crate) fn limit(&self, l: usize) -> usize {
        self.held(self.axes.len()) + 2 * l
    }

    /// The row of force bound b.
    pub(crate) fn force_bound(&self, b: usize) -> usize {
        self.limit(self.limited.len()) + b
    }

    /// The first of the three rows of the friction cone of contact k.
    pub(crate) fn cone(&self, k: usize) -> usize {
        self.force_bound(self.force_bounds.len()) + 3 * k
    }

    /// The number of rows.
    pub(crate) fn count(&self) -> usize {
        self.cone(self.axes.len())
    }

    /// The column of the force of contact k.
    pub(crate) fn force(&self, k: usize) -> usize {
        self.nv + 3 * k
    }

    /// The cones of the slack, row by row.
    pub(crate) fn cones(&self) -> Vec<SupportedConeT<f64>> {
        let (equalities, cone) = (self.limit(0), self.cone(0));
        let mut cones =
            vec![SupportedConeT::ZeroConeT(equalities), SupportedConeT::NonnegativeConeT(cone - equalities)];
        cones.extend(self.axes.iter().map(|_| SupportedConeT::SecondOrderConeT(3)));
        cones.retain(|cone| !matches!(cone, SupportedConeT::NonnegativeConeT(0)));
        cones
    }

    /// Which entries of A may differ from zero, for contacts on these bodies.
    pub(crate) fn pattern(&self, model: &Model, bodies: &[usize]) -> Vec<Vec<bool>> {
        let supports: Vec<Vec<bool>> = (0..model.bodies().len()).map(|body| support(model, body)).collect();
        // M_ij: both move some body. (Jᵀ)_ik: coordinate i moves the contact.
        let effort = |i: usize| {
            let M = (0..self.nv).map(|j| supports.iter().any(|s| s[i] && s[j]));
            let Jt = bodies.iter().flat_map(|&body| [supports[body][i]; 3]);
            M.chain(Jt).collect::<Vec<bool>>()
        };
        let columns = self.nv + 3 * bodies.len();
        let of_force = |k: usize| (0..columns).map(|j| (self.force(k)..self.force(k) + 3).contains(&j)).collect();
        let mut pattern: Vec<Vec<bool>> = self.free.iter().map(|&i| effort(i)).collect();
        for &body in bodies {
            let row: Vec<bool> = (0..columns).map(|j| j < self.nv && supports[body][j]).collect();
            pattern.extend([row.clone(), row.clone(), row]);
        }
        pattern.extend(self.limited.iter().flat_map(|&(i, _)| [effort(i), effort(i)]));
        pattern.extend(self.force_bounds.iter().map(|b| of_force(b.contact)));
        pattern.extend((0..bodies.len()).flat_map(|k| [of_force(k), of_force(k), of_force(k)]));
        pattern
    }
}

/// Which coordinates move a body.
fn support(model: &Model, mut body: usize) -> Vec<bool> {
    let mut moves = vec![false; model.nv()];
    while body != 0 {
        let b = &model.bodies()[body];
        moves[b.idx_v..b.idx_v + b.joint.nv()].fill(true);
        body = b.parent;
    }
    moves
}
