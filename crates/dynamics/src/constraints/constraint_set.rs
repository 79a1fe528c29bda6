//! Set of constraints of one model: the plans of the constraints, and all memory for computations with them.

use crate::constraints::constraint::{ContactConstraint, Target, wrong_gains};
use crate::constraints::constraint_lanes::ConstraintLanes;
use crate::constraints::delassus::Delassus;
use crate::constraints::islands::Island;
use crate::constraints::plan::{Plan, ProximalSettings, nonzero_rows, touching};
use crate::workspace::{filled, zero_matrix};
use alloc::borrow::ToOwned;
use alloc::boxed::Box;
use alloc::vec::Vec;
use condyle_linalg::check_index;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_model::Error;
use condyle_model::Model;
use condyle_spatial::{Array, Dense, DenseMatrix, Matrix, Scalar, same_layout};
use core::ops::Range;

/// Constraints (contacts and loops) of one model, with the scratch and the results of [`constrained_dynamics`] and
/// similar functions.
///
/// [`new`](Self::new) allocates all memory. Make one set for each combination of contacts, and change targets with
/// [`set_target`](Self::set_target). All sets can share one [`Data`](crate::Data).
///
/// A model may contain several robots that no constraint connects. If the constraints of each robot are adjacent in the
/// list, the computation for each robot costs as much as in a model of its own. An additional cost is writing the zero
/// blocks of the matrices, one for each pair of robots.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, robots};
/// let quadruped = robots::quadruped();
/// let feet = ["LF_foot", "RH_foot"].map(|name| quadruped.frame(name).unwrap());
/// let trot = ConstraintSet::<f64>::new(&quadruped, &feet.map(ContactConstraint::point))?;
/// assert_eq!((trot.rows(), trot.range(1)), (6, 3..6));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// [`constrained_dynamics`]: crate::constrained_dynamics()
#[derive(Clone, Debug)]
#[repr(C)]
pub struct ConstraintSet<S> {
    /// Settings that decide how redundant constraints share their forces. They may be changed between calls.
    pub proximal: ProximalSettings,
    pub(crate) plans: Vec<Plan>,
    pub(crate) islands: Vec<Island>,
    pub(crate) targets: Array<Target<S>>,
    pub(crate) nv: usize,
    /// Geometry hash of the model for which the set was made. It covers the frames and the axes of the joints.
    geometry: u64,
    /// Rows in which each column of ∂(M q̈ + h − Jᵀλ)/∂q may be nonzero; one list per coordinate.
    pub(crate) nonzero_rows: Vec<NonzeroRows>,
    /// Rows in which each column of J may be nonzero; one list per coordinate.
    pub(crate) touching: Vec<Vec<usize>>,
    /// Rows of J, each in the slots of its constraint. Shape: number of entries of all rows. Written by: `jacobian` of
    /// `constraint_motion.rs`.
    pub(crate) J: Array<S>,
    /// Accelerations γ of the constraints for q̈ = 0, including the corrections by kp and kd. For impacts with the
    /// restitution ε, γ is (1 + ε) J v. Shape: rows. Written by: `constrained_dynamics`, `impulse_dynamics`.
    pub(crate) gamma: Array<S>,
    pub(crate) delassus: Delassus<S>,
    /// Forces λ, or impulses, of the constraints. Shape: rows. Written by: the algorithms.
    pub(crate) lambda: Array<S>,
    /// Error J q̈ + γ of the constraints. Shape: rows. Written by: the algorithms.
    pub(crate) error: Array<S>,
    /// Derivatives of the accelerations (for impacts: velocities) of the constraints. Shape: rows × nv. Written by: the
    /// algorithms' derivatives.
    pub(crate) dgamma_dq: Matrix<S>,
    pub(crate) dgamma_dv: Matrix<S>,
    /// Matrices U = M⁻¹ Jᵀ and J̄ = M⁻¹ Jᵀ Λ, with Λ = (J M⁻¹ Jᵀ)⁻¹. Shape: nv × rows. Written by: the algorithms'
    /// derivatives.
    pub(crate) U: Matrix<S>,
    pub(crate) Jbar: Matrix<S>,
    /// Derivatives of the forces λ with respect to q, v and τ. Shape: rows × nv. Written by: the algorithms'
    /// derivatives.
    pub(crate) dlambda_dq: Matrix<S>,
    pub(crate) dlambda_dv: Matrix<S>,
    pub(crate) dlambda_dtau: Matrix<S>,
    /// Scratch of calls with limbs in parallel lanes; `None` if the robot or the constraints do not allow this.
    pub(crate) limbs: Option<Box<ConstraintLanes>>,
}

same_layout!(ConstraintSet {
    targets, J, gamma, delassus, lambda, error, dgamma_dq, dgamma_dv, U, Jbar, dlambda_dq, dlambda_dv, dlambda_dtau,
} same { proximal, plans, islands, nv, geometry, nonzero_rows, touching, limbs });

impl<S: Scalar> ConstraintSet<S> {
    /// Makes the plans of the constraints in a model and allocates all memory.
    ///
    /// # Errors
    /// Returns [`Error::Constraint`] if a frame does not exist, two frames do not move relative to each other, a
    /// reference frame is `World`, or a gain is negative or not finite. The same error is returned if a target or its
    /// rotation is invalid, `axes` are invalid for the kind, or one constraint
    /// [repeats](ContactConstraint::repeats) another.
    pub fn new<R>(model: &Model<R>, constraints: &[ContactConstraint]) -> Result<Self, Error> {
        let plans = Plan::of_constraints(model, constraints)?;
        let (rows, entries) = plans.last().map_or((0, 0), |last| (last.row + last.rows(), last.end()));
        let nv = model.nv();
        let (o, wide, tall) = (S::zero(), zero_matrix(rows, nv), (nv, rows));
        Ok(Self {
            proximal: ProximalSettings::default(),
            targets: constraints.iter().map(|c| c.target.lift()).collect(),
            islands: Island::of(model, &plans),
            nv,
            geometry: model.geometry_hash(),
            nonzero_rows: nonzero_rows(model, &plans),
            touching: (0..nv).map(|k| touching(&plans, k)).collect(),
            J: filled(|| o, entries),
            gamma: filled(|| o, rows),
            delassus: Delassus::new(rows, entries),
            lambda: filled(|| o, rows),
            error: filled(|| o, rows),
            dgamma_dq: wide.clone(),
            dgamma_dv: wide.clone(),
            U: zero_matrix(tall.0, tall.1),
            Jbar: zero_matrix(tall.0, tall.1),
            dlambda_dq: wide.clone(),
            dlambda_dv: wide.clone(),
            dlambda_dtau: wide,
            limbs: ConstraintLanes::new::<S, R>(model, &plans),
            plans,
        })
    }

    /// Checks the constraints of a model as [`new`](Self::new) does, without allocating a set.
    ///
    /// # Errors
    /// Returns the same errors as [`new`](Self::new).
    pub fn check_all<R>(model: &Model<R>, constraints: &[ContactConstraint]) -> Result<(), Error> {
        constraints.iter().enumerate().try_for_each(|(i, one)| one.bodies(model, &constraints[..i]).map(drop))
    }

    /// Returns the number of constraints.
    pub fn len(&self) -> usize {
        self.plans.len()
    }

    /// Returns whether the set has no constraints.
    pub fn is_empty(&self) -> bool {
        self.plans.is_empty()
    }

    /// Returns the number of rows of the constraint Jacobian J, which is also the number of constraint forces λ.
    pub fn rows(&self) -> usize {
        self.lambda.len()
    }

    /// Returns the range of the rows of constraint k in the constraint Jacobian J and in the constraint forces λ.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn range(&self, k: usize) -> Range<usize> {
        check_index("k", k, self.len(), "constraints");
        self.plans[k].row..self.plans[k].row + self.plans[k].rows()
    }

    /// Returns the islands: groups of trees and constraints that are independent of each other. Each island is a pair
    /// of a range of coordinates and a range of rows. Constraints on different trees are in different islands, unless
    /// other constraints connect the trees. Islands with overlapping ranges are merged. The ranges of coordinates are
    /// sorted and cover all coordinates of the model. A tree without constraints is an island without rows.
    pub fn islands(&self) -> impl Iterator<Item = (Range<usize>, Range<usize>)> {
        self.islands.iter().map(|island| (island.coordinates.clone(), island.rows.clone()))
    }

    /// Returns the target of constraint k. If the scalars have lanes, each lane has its own target.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn target(&self, k: usize) -> Target<S> {
        check_index("k", k, self.len(), "constraints");
        self.targets[k]
    }

    /// Changes the target of constraint k between calls. Allocates nothing.
    ///
    /// # Errors
    /// Returns [`Error::Constraint`] if the target's scalars are `f64` and the target is not finite or its rotation is
    /// invalid. In this case, the old target is kept.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn set_target(&mut self, k: usize, target: Target<S>) -> Result<(), Error> {
        check_index("k", k, self.len(), "constraints");
        let to = &mut self.targets[k];
        if let Some(what) = target.wrong() {
            return Err(Error::Constraint { constraint: k, what: what.to_owned() });
        }
        *to = target;
        Ok(())
    }

    /// Changes the gains of constraint k between calls: kp of the position error, the gains of each axis that replace
    /// it, and kd of the velocity error. Allocates nothing.
    ///
    /// # Errors
    /// Returns [`Error::Constraint`] if a gain is negative or not finite. In this case, the old gains are kept.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn set_gains(&mut self, k: usize, kp: f64, kp_axes: Option<[f64; 6]>, kd: f64) -> Result<(), Error> {
        check_index("k", k, self.len(), "constraints");
        if let Some(what) = wrong_gains(kp, kp_axes.as_ref(), kd) {
            return Err(Error::Constraint { constraint: k, what });
        }
        self.plans[k].set_gains(kp, kp_axes, kd);
        Ok(())
    }

    /// Writes the Jacobian J of the last call, rows × nv. Overwrites J.
    ///
    /// # Panics
    /// Panics if `J` is not rows × nv.
    #[track_caller]
    pub fn jacobian(&self, J: &mut DenseMatrix<S, impl Dense<S>>) {
        let shape = (self.rows(), self.nv);
        assert!(J.shape() == shape, "J: expected {} × {}, found {:?}", shape.0, shape.1, J.shape());
        J.fill(S::zero());
        for plan in &self.plans {
            for r in 0..plan.rows() {
                let row = &self.J[plan.range(r)];
                for (k, &coordinate) in plan.coordinates.iter().enumerate() {
                    J[(plan.row + r, coordinate)] = row[k];
                }
            }
        }
    }

    /// Panics unless the set was made for a model with the same joints and frames at the same placements.
    #[inline]
    #[track_caller]
    pub(crate) fn check<R>(&self, model: &Model<R>) {
        if self.geometry != model.geometry_hash() {
            wrong_model(model.name());
        }
    }
}

/// Panics because [`ConstraintSet::check`] found another model.
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_model(name: &str) -> ! {
    panic!("constraints: made for another model than `{name}`");
}
