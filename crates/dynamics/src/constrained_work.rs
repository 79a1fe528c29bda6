//! Where the algorithms on constraints are compiled for the vector instructions of this processor, as `kernel!` of
//! `dispatch.rs` does for those without.
#![allow(unsafe_code)]

use crate::constraint_set::ConstraintSet;
use crate::data::{Data, check_forces};
use crate::dispatch::{Kernel, fused, is_f64, same, short, slice};
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::lanes::Fused;
use condyle_spatial::{Constant, Force, Scalar};

/// What an algorithm reads.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a, S> {
    pub q: &'a [S],
    pub v: &'a [S],
    /// Of an impact the restitution alone.
    pub tau: &'a [S],
    pub f_ext: &'a [Force<S>],
}

/// An algorithm on constraints; inlined throughout.
pub(crate) trait Algorithm {
    fn run<S: Scalar, R: Constant<S>>(
        model: &Model<R>,
        data: &mut Data<S>,
        constraints: &mut ConstraintSet<S>,
        inputs: Inputs<'_, S>,
    );
}

struct Work<'a, A, S, R> {
    algorithm: A,
    model: &'a Model<R>,
    data: &'a mut Data<S>,
    constraints: &'a mut ConstraintSet<S>,
    inputs: Inputs<'a, S>,
}

impl<A: Algorithm, S: Scalar, R: Constant<S>> Kernel for Work<'_, A, S, R> {
    #[inline(always)]
    fn run(self) {
        A::run(self.model, self.data, self.constraints, self.inputs);
    }

    #[inline(always)]
    fn run_fused(self) {
        if !is_f64::<S, R>() {
            return self.run();
        }
        let Inputs { q, v, tau, f_ext } = self.inputs;
        // SAFETY: S and R are f64, and by contract the processor has the level.
        unsafe {
            let model: &Model<f64> = same(self.model);
            let (data, constraints) = (fused(self.data), fused_set(self.constraints));
            let inputs = Inputs { q: slice(q), v: slice(v), tau: slice(tau), f_ext: slice(f_ext) };
            short(Work { algorithm: self.algorithm, model, data, constraints, inputs });
        }
    }
}

/// Constraints whose numbers are looked at as [`Fused`].
///
/// # Safety
/// `S` is `f64`.
#[inline(always)]
pub(crate) unsafe fn fused_set<S>(constraints: &mut ConstraintSet<S>) -> &mut ConstraintSet<Fused> {
    assert!(size_of::<ConstraintSet<S>>() == size_of::<ConstraintSet<Fused>>());
    // SAFETY: `ConstraintSet` and what is in it are `repr(C)`, as `Data` is: see `fused`.
    unsafe { &mut *core::ptr::from_mut(constraints).cast() }
}

/// Panics unless the arguments of forward dynamics fit.
#[inline]
#[track_caller]
pub(crate) fn check_arguments<S, R>(model: &Model<R>, data: &Data<S>, constraints: &ConstraintSet<S>, x: &Inputs<'_, S>)
where
    S: Scalar,
{
    data.check(model);
    constraints.check(model);
    model.check_regular();
    check("q", x.q.len(), model.nq());
    check("v", x.v.len(), model.nv());
    check("tau", x.tau.len(), model.nv());
    check_forces(x.f_ext.len(), model.nodes().len());
}

/// Runs an algorithm, compiled for the level of its scalar.
#[inline(always)]
pub(crate) fn run<A: Algorithm, S: Scalar, R: Constant<S>>(
    algorithm: A,
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    inputs: Inputs<'_, S>,
) {
    S::enter(Work { algorithm, model, data, constraints, inputs });
}
