//! Constraints of a batch: one constraint set per thread. All sets have the same targets, which apply to all states.

use super::{Batch, InLanes};
use crate::constraints::constraint::{ContactConstraint, Target};
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::plan::ProximalSettings;
use crate::workspace::Gate;
use alloc::borrow::ToOwned;
use alloc::vec::Vec;
use condyle_linalg::check_index;
use condyle_model::{Error, Model};
use condyle_spatial::block::Real;
use core::ops::Range;

/// Constraints of one model, with the scratch for one [`Batch`]: see [`ConstraintSet`].
///
/// ```
/// use condyle_dynamics::{Batch, ContactConstraint, ProximalSettings, robots};
/// let arm = robots::arm7();
/// let mut batch = Batch::new(&arm, 10, 1);
/// let touch = [ContactConstraint::point(arm.frame("tool")?)];
/// let mut touch = batch.constraints(&arm, &touch, ProximalSettings::default())?;
/// let (q, v, tau) = (vec![0.3; 70], vec![0.1; 70], vec![1.0; 70]);
/// let d = batch.constrained_dynamics(&arm, &mut touch, &q, &v, &tau, &[]);
/// assert_eq!((d.a.len(), d.lambda.len(), d.residual.len()), (70, 30, 10));
/// assert!(d.residual.iter().all(|&x| x < 1e-9));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct BatchConstraints<T: Real = f64> {
    pub(super) sets: Sets<T>,
}

/// Constraint sets, one per thread. Their scalars have as many lanes as the scalars of the batch.
#[derive(Clone, Debug)]
pub(super) enum Sets<T: Real> {
    Single(Vec<ConstraintSet<T>>),
    Narrow(Vec<ConstraintSet<T::Narrow<Gate>>>),
    Wide(Vec<ConstraintSet<T::Wide<Gate>>>),
}

impl<T: Real> Batch<T> {
    /// Prepares constraints of a model for use with this batch, and allocates all memory.
    ///
    /// # Errors
    /// Returns the same errors as [`ConstraintSet::new`].
    pub fn constraints(
        &self,
        model: &Model,
        constraints: &[ContactConstraint],
        proximal: ProximalSettings,
    ) -> Result<BatchConstraints<T>, Error> {
        ConstraintSet::<T>::check_all(model, constraints)?;
        let sets = match &self.lanes {
            InLanes::Single(group) => Sets::Single(made(model, constraints, group.threads())?),
            InLanes::Narrow(group) => Sets::Narrow(made(model, constraints, group.threads())?),
            InLanes::Wide(group) => Sets::Wide(made(model, constraints, group.threads())?),
        };
        let mut constraints = BatchConstraints { sets };
        constraints.set_proximal(proximal);
        Ok(constraints)
    }
}

fn made<S: condyle_spatial::Scalar>(
    model: &Model,
    constraints: &[ContactConstraint],
    threads: usize,
) -> Result<Vec<ConstraintSet<S>>, Error> {
    (0..threads).map(|_| ConstraintSet::new(model, constraints)).collect()
}

impl<T: Real> BatchConstraints<T> {
    /// Returns the number of rows of the constraint Jacobian J. Each state has this number of constraint forces λ.
    pub fn rows(&self) -> usize {
        each!(Sets, &self.sets, sets => sets[0].rows())
    }

    /// Returns the range of rows of the constraint Jacobian J that belong to constraint k.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn range(&self, k: usize) -> Range<usize> {
        each!(Sets, &self.sets, sets => sets[0].range(k))
    }

    /// Changes the settings that determine how redundant constraints share the constraint forces.
    pub fn set_proximal(&mut self, proximal: ProximalSettings) {
        each!(Sets, &mut self.sets, sets => sets.iter_mut().for_each(|set| set.proximal = proximal));
    }

    /// Changes the target of constraint k for all states, from the next call on. Allocates nothing.
    ///
    /// # Errors
    /// Returns [`Error::Constraint`] if the target is not finite or has an invalid rotation. In this case, the old
    /// target is kept.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[track_caller]
    pub fn set_target(&mut self, k: usize, target: Target<f64>) -> Result<(), Error> {
        check_index("k", k, each!(Sets, &self.sets, sets => sets[0].len()), "constraints");
        if let Some(what) = target.wrong() {
            return Err(Error::Constraint { constraint: k, what: what.to_owned() });
        }
        each!(Sets, &mut self.sets, sets => sets.iter_mut().try_for_each(|set| set.set_target(k, target.lift())))
    }

    /// Returns whether a batch can use these constraints. The batch must have the same number of threads and lanes as
    /// the batch that made the constraints.
    pub fn fits(&self, batch: &Batch<T>) -> bool {
        match (&self.sets, &batch.lanes) {
            (Sets::Single(sets), InLanes::Single(group)) => sets.len() == group.threads(),
            (Sets::Narrow(sets), InLanes::Narrow(group)) => sets.len() == group.threads(),
            (Sets::Wide(sets), InLanes::Wide(group)) => sets.len() == group.threads(),
            _ => false,
        }
    }

    /// Panics unless the constraints were made for a model with the same joints and frames at the same placements.
    #[track_caller]
    pub(super) fn check(&self, model: &Model) {
        each!(Sets, &self.sets, sets => sets[0].check(model));
    }
}
