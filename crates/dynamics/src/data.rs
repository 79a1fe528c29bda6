//! All that algorithms write: scratch and results.

use crate::kinematics::{Moving, World};
use crate::{
    aba, aba_derivatives, aba_hessian, all_terms, centroidal, centroidal_derivatives, constrained_derivatives,
    constrained_dynamics, coriolis, crba, energy, forward_dynamics, impulse_dynamics, minv, regressor, rnea,
    rnea_derivatives, rnea_hessian, statics,
};
use condyle_model::Model;
use condyle_spatial::Scalar;

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
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Data<S> {
    size: Size,
    /// Of the tree that it was made for.
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
    pub(crate) forward_dynamics: forward_dynamics::Workspace<S>,
    pub(crate) regressor: regressor::Workspace<S>,
    /// Of single calls on robots with limbs.
    pub(crate) limbs: Option<Box<crate::limbs::Scratch>>,
}

/// How large the arrays of a workspace are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Size {
    /// Bodies, the world included.
    pub bodies: usize,
    /// Degrees of freedom of all joints.
    pub columns: usize,
    /// Columns on the longest way from the root.
    pub depth: usize,
    /// Bodies on the longest way from the root, the world included.
    pub levels: usize,
    /// Coordinates.
    pub nv: usize,
}

impl<S: Scalar> Data<S> {
    /// Allocates everything for a model.
    pub fn new<R>(model: &Model<R>) -> Self {
        let size = Size {
            bodies: model.nodes().len(),
            columns: model.columns().len(),
            depth: model.columns().iter().map(|c| c.depth + 1).max().unwrap_or(0),
            levels: model.nodes().iter().map(|n| n.level + 1).max().unwrap_or(1),
            nv: model.nv(),
        };
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
            forward_dynamics: forward_dynamics::Workspace::new(model),
            regressor: regressor::Workspace::new(size),
            limbs: crate::limbs::Scratch::new::<S, R>(model),
        }
    }
}

impl<S> Data<S> {
    /// Panics unless this was made for a model of the same tree.
    #[inline]
    #[track_caller]
    pub(crate) fn check<R>(&self, model: &Model<R>) {
        let made_for = (self.size.bodies, self.size.columns, self.size.nv);
        let given = (model.nodes().len(), model.columns().len(), model.nv());
        let other = if made_for == given { " in another tree" } else { "" };
        assert!(
            self.tree == model.tree_hash(),
            "data: made for a model of {made_for:?} bodies, joint axes and coordinates, found {given:?}{other}"
        );
    }
}

/// Panics unless there is a force for each body, the world included, or none at all.
#[inline]
#[track_caller]
pub(crate) fn check_forces(found: usize, bodies: usize) {
    assert!(found == 0 || found == bodies, "f_ext: expected no force or {bodies} (one for each body), found {found}");
}
