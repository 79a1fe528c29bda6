//! The constraints of a batch: for each thread a set, with the targets of all states.

use super::{Batch, InLanes};
use crate::constraints::constraint::{ContactConstraint, Target};
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::plan::Proximal;
use crate::workspace::Gate;
use alloc::borrow::ToOwned;
use alloc::vec::Vec;
use condyle_linalg::check_index;
use condyle_model::{Error, Model};
use condyle_spatial::block::Real;
use core::ops::Range;

/// Constraints of one model, with the scratch of one [`Batch`] for them: see [`ConstraintSet`].
///
/// ```
/// use condyle_dynamics::{Batch, ContactConstraint, Proximal, robots};
/// let arm = robots::arm7();
/// let mut batch = Batch::new(&arm, 10, 1);
/// let touch = [ContactConstraint::point(arm.frame("tool")?)];
/// let mut touch = batch.constraints(&arm, &touch, Proximal::default())?;
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

/// A set for each thread, with as many lanes as the groups of the batch have.
#[derive(Clone, Debug)]
pub(super) enum Sets<T: Real> {
    Single(Vec<ConstraintSet<T>>),
    Short(Vec<ConstraintSet<T::Short<Gate>>>),
    Long(Vec<ConstraintSet<T::Long<Gate>>>),
}

impl<T: Real> Batch<T> {
    /// Plans constraints of a model, for this batch, and allocates everything.
    ///
    /// # Errors
    /// Those of [`ConstraintSet::new`].
    pub fn constraints(
        &self,
        model: &Model,
        constraints: &[ContactConstraint],
        proximal: Proximal,
    ) -> Result<BatchConstraints<T>, Error> {
        ConstraintSet::<T>::check_all(model, constraints)?;
        let sets = match &self.lanes {
            InLanes::Single(group) => Sets::Single(made(model, constraints, group.threads())?),
            InLanes::Short(group) => Sets::Short(made(model, constraints, group.threads())?),
            InLanes::Long(group) => Sets::Long(made(model, constraints, group.threads())?),
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
    /// The number of rows of J, and of numbers of λ of each state.
    pub fn rows(&self) -> usize {
        each!(Sets, &self.sets, sets => sets[0].rows())
    }

    /// The rows of constraint k.
    ///
    /// # Panics
    /// If there is no such constraint.
    #[track_caller]
    pub fn range(&self, k: usize) -> Range<usize> {
        each!(Sets, &self.sets, sets => sets[0].range(k))
    }

    /// Changes how redundant constraints share their forces.
    pub fn set_proximal(&mut self, proximal: Proximal) {
        each!(Sets, &mut self.sets, sets => sets.iter_mut().for_each(|set| set.proximal = proximal));
    }

    /// Changes where constraint k wants its frame to be in all states, between calls. Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Constraint`] for a target that is not finite or whose rotation is none; that of before then stays.
    ///
    /// # Panics
    /// If there is no such constraint.
    #[track_caller]
    pub fn set_target(&mut self, k: usize, target: Target<f64>) -> Result<(), Error> {
        check_index("k", k, each!(Sets, &self.sets, sets => sets[0].len()), "constraints");
        if let Some(what) = target.wrong() {
            return Err(Error::Constraint { constraint: k, what: what.to_owned() });
        }
        each!(Sets, &mut self.sets, sets => sets.iter_mut().try_for_each(|set| set.set_target(k, target.lift())))
    }

    /// Whether a batch can use these: it has as many threads, and as many lanes, as the one that made them.
    pub fn fits(&self, batch: &Batch<T>) -> bool {
        match (&self.sets, &batch.lanes) {
            (Sets::Single(sets), InLanes::Single(group)) => sets.len() == group.threads(),
            (Sets::Short(sets), InLanes::Short(group)) => sets.len() == group.threads(),
            (Sets::Long(sets), InLanes::Long(group)) => sets.len() == group.threads(),
            _ => false,
        }
    }

    /// Panics unless this was made for a model with the same joints and frames in the same places.
    #[track_caller]
    pub(super) fn check(&self, model: &Model) {
        each!(Sets, &self.sets, sets => sets[0].check(model));
    }
}
