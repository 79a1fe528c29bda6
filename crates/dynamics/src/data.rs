//! All that algorithms write: scratch and results.
#![allow(unsafe_code)]

use crate::constraints::constrained_derivatives;
use crate::constraints::constrained_dynamics;
use crate::constraints::impulse_dynamics;
use crate::derivatives::aba_derivatives;
use crate::derivatives::aba_hessian;
use crate::derivatives::centroidal_derivatives;
use crate::derivatives::rnea_derivatives;
use crate::derivatives::rnea_hessian;
use crate::lanes::limbs::pass::Scratch;
use crate::passes::aba;
use crate::passes::all_terms;
use crate::passes::centroidal;
use crate::passes::coriolis;
use crate::passes::crba;
use crate::passes::energy;
use crate::passes::factored_dynamics;
use crate::passes::kinematics::{Moving, World};
use crate::passes::minv;
use crate::passes::regressor;
use crate::passes::rnea;
use crate::passes::statics;
use crate::workspace::{Long, Short, Size};
use alloc::boxed::Box;
use condyle_model::Model;
use condyle_spatial::gate::{is, same};
use condyle_spatial::{Scalar, alike};

/// Scratch and results of every algorithm, for one model and one kind of scalar.
///
/// Each algorithm keeps its own workspace, which its file defines, and reads nothing that another left behind, so calls
/// may come in any order. All memory is allocated here, none later. One `Data` for each thread.
///
/// ```
/// use condyle_dynamics::{Data, robots};
/// let arm = robots::arm7();
/// let data = Data::<f64>::new(&arm);
/// # let _ = data;
/// ```
#[derive(Debug)]
#[repr(C)]
pub struct Data<S> {
    size: Size,
    /// The hash of the tree that it was made for.
    tree: u64,
    pub(crate) world: World<S>,
    pub(crate) moving: Moving<S>,
    pub(crate) rnea: rnea::Workspace<S>,
    pub(crate) crba: crba::Workspace<S>,
    pub(crate) aba: aba::Workspace<S>,
    pub(crate) minv: minv::Workspace<S>,
    pub(crate) rnea_derivatives: rnea_derivatives::Workspace<S>,
    pub(crate) aba_derivatives: aba_derivatives::Workspace<S>,
    pub(crate) rnea_hessian: rnea_hessian::Workspace<S>,
    pub(crate) aba_hessian: aba_hessian::Workspace<S>,
    pub(crate) constrained_dynamics: constrained_dynamics::Workspace<S>,
    pub(crate) constrained_derivatives: constrained_derivatives::Workspace<S>,
    pub(crate) impulse_dynamics: impulse_dynamics::Workspace<S>,
    pub(crate) statics: statics::Workspace<S>,
    pub(crate) coriolis: coriolis::Workspace<S>,
    pub(crate) centroidal: centroidal::Workspace<S>,
    pub(crate) centroidal_derivatives: centroidal_derivatives::Workspace<S>,
    pub(crate) energy: energy::Workspace<S>,
    pub(crate) all_terms: all_terms::Workspace<S>,
    pub(crate) forward_dynamics: factored_dynamics::Workspace<S>,
    pub(crate) regressor: regressor::Workspace<S>,
    /// The scratch of single calls on robots with limbs.
    pub(crate) limbs: Option<Box<Scratch>>,
}

alike!(Data {
    world, moving, rnea, crba, aba, minv, rnea_derivatives, aba_derivatives, rnea_hessian, aba_hessian,
    constrained_dynamics, constrained_derivatives, impulse_dynamics, statics, coriolis, centroidal,
    centroidal_derivatives, energy, all_terms, forward_dynamics, regressor,
} same { size, tree, limbs });

impl<S: Scalar> Data<S> {
    /// Allocates everything for a model.
    pub fn new<R: 'static>(model: &Model<R>) -> Self {
        if !S::COMPILED || !is::<R, f64>() {
            return Self::allocate(model);
        }
        // SAFETY: R is f64, and S is the scalar of the data that is given back.
        unsafe {
            if is::<S, f64>() {
                same(new_single(same(model)))
            } else if is::<S, Short>() {
                same(new_short(same(model)))
            } else {
                same(new_long(same(model)))
            }
        }
    }

    fn allocate<R>(model: &Model<R>) -> Self {
        let size = Size::new(model);
        Self {
            size,
            tree: model.tree_hash(),
            world: World::new(size),
            moving: Moving::new(size),
            rnea: rnea::Workspace::new(size),
            crba: crba::Workspace::new(size),
            aba: aba::Workspace::new(size),
            minv: minv::Workspace::new(size, model),
            rnea_derivatives: rnea_derivatives::Workspace::new(size),
            aba_derivatives: aba_derivatives::Workspace::new(size, model),
            rnea_hessian: rnea_hessian::Workspace::new(size),
            aba_hessian: aba_hessian::Workspace::new(size),
            constrained_dynamics: constrained_dynamics::Workspace::new(size, model),
            constrained_derivatives: constrained_derivatives::Workspace::new(size),
            impulse_dynamics: impulse_dynamics::Workspace::new(size),
            statics: statics::Workspace::new(size),
            coriolis: coriolis::Workspace::new(size),
            centroidal: centroidal::Workspace::new(size),
            centroidal_derivatives: centroidal_derivatives::Workspace::new(size),
            energy: energy::Workspace::new(size),
            all_terms: all_terms::Workspace::new(size),
            forward_dynamics: factored_dynamics::Workspace::new(model),
            regressor: regressor::Workspace::new(size),
            limbs: Scratch::new::<S, R>(model),
        }
    }
}

/// What this crate compiles of [`Data::new`] and of `clone`, for whoever uses it.
fn new_single(model: &Model) -> Data<f64> {
    Data::allocate(model)
}
fn new_short(model: &Model) -> Data<Short> {
    Data::allocate(model)
}
fn new_long(model: &Model) -> Data<Long> {
    Data::allocate(model)
}
fn clone_single(data: &Data<f64>) -> Data<f64> {
    data.copy()
}
fn clone_short(data: &Data<Short>) -> Data<Short> {
    data.copy()
}
fn clone_long(data: &Data<Long>) -> Data<Long> {
    data.copy()
}

/// A copy, made in a function of its own for each kind of workspace: in one for all it would be the library's largest.
#[inline(never)]
fn copied<W: Clone>(workspace: &W) -> W {
    workspace.clone()
}

impl<S: Scalar> Data<S> {
    fn copy(&self) -> Self {
        Self {
            size: self.size,
            tree: self.tree,
            world: copied(&self.world),
            moving: copied(&self.moving),
            rnea: copied(&self.rnea),
            crba: copied(&self.crba),
            aba: copied(&self.aba),
            minv: copied(&self.minv),
            rnea_derivatives: copied(&self.rnea_derivatives),
            aba_derivatives: copied(&self.aba_derivatives),
            rnea_hessian: copied(&self.rnea_hessian),
            aba_hessian: copied(&self.aba_hessian),
            constrained_dynamics: copied(&self.constrained_dynamics),
            constrained_derivatives: copied(&self.constrained_derivatives),
            impulse_dynamics: copied(&self.impulse_dynamics),
            statics: copied(&self.statics),
            coriolis: copied(&self.coriolis),
            centroidal: copied(&self.centroidal),
            centroidal_derivatives: copied(&self.centroidal_derivatives),
            energy: copied(&self.energy),
            all_terms: copied(&self.all_terms),
            forward_dynamics: copied(&self.forward_dynamics),
            regressor: copied(&self.regressor),
            limbs: copied(&self.limbs),
        }
    }
}

impl<S: Scalar> Clone for Data<S> {
    fn clone(&self) -> Self {
        if !S::COMPILED {
            return self.copy();
        }
        // SAFETY: S is the scalar of the data that is given back.
        unsafe {
            if is::<S, f64>() {
                same(clone_single(same(self)))
            } else if is::<S, Short>() {
                same(clone_short(same(self)))
            } else {
                same(clone_long(same(self)))
            }
        }
    }
}

impl<S> Data<S> {
    /// Panics unless this was made for a model of the same tree.
    #[inline]
    #[track_caller]
    pub(crate) fn check<R>(&self, model: &Model<R>) {
        if self.tree != model.tree_hash() {
            let given = [model.nodes().len(), model.columns().len(), model.nv()];
            self.size.wrong_tree(given);
        }
    }
}

impl Size {
    /// The panic of [`Data::check`], not inlined: every call checks its data.
    #[cold]
    #[inline(never)]
    #[track_caller]
    fn wrong_tree(&self, given: [usize; 3]) -> ! {
        let made_for = [self.bodies, self.columns, self.nv];
        let other = if made_for == given { " in another tree" } else { "" };
        let [made_for, given] = [made_for, given].map(|[bodies, columns, nv]| (bodies, columns, nv));
        panic!("data: made for a model of {made_for:?} bodies, joint axes and coordinates, found {given:?}{other}");
    }
}

/// Panics unless there is a force for each body, the world included, or none at all.
#[inline]
#[track_caller]
pub(crate) fn check_forces(found: usize, bodies: usize) {
    if found != 0 && found != bodies {
        wrong_forces(found, bodies);
    }
}

/// The panic of [`check_forces`].
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_forces(found: usize, bodies: usize) -> ! {
    panic!("f_ext: expected no force or {bodies} (one for each body), found {found}");
}
