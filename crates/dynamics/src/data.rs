//! Memory to which the algorithms write: scratch and results.
#![allow(unsafe_code)]

use crate::constraints::{constrained_derivatives, constrained_dynamics, impulse_dynamics};
use crate::derivatives::{aba_derivatives, aba_hessian, centroidal_derivatives, rnea_derivatives, rnea_hessian};
use crate::lanes::limbs::pass::Scratch;
use crate::passes::kinematics::{Moving, World};
use crate::passes::{
    aba, all_terms, centroidal, coriolis, crba, energy, factored_dynamics, minv, regressor, rnea, statics,
};
use crate::selection::Methods;
use crate::workspace::{Narrow, Size, Wide};
use alloc::boxed::Box;
use condyle_model::Model;
use condyle_spatial::gate::{is, same};
use condyle_spatial::{Scalar, same_layout};

/// Defines [`Data`] from a list of workspaces and their constructor arguments. The macro generates the struct, the
/// constructor and the copy function. It also checks that the numbers may be read as `f64` or as `FusedF64`
/// ([`same_layout!`]).
macro_rules! data {
    (
        $(#[$doc:meta])* ($size:ident, $model:ident, $minv:ident)
        $($name:ident: $Workspace:ident $(:: $Inner:ident)? = ($($from:ident),*),)*
    ) => {
        $(#[$doc])*
        #[derive(Debug)]
        #[repr(C)]
        pub struct Data<S = f64> {
            size: Size,
            /// Hash of the tree for which the data was made.
            tree: u64,
            $(pub(crate) $name: $Workspace $(:: $Inner)? <S>,)*
            /// Scratch of calls that compute limbs in parallel lanes; `None` if the model or the scalar does not allow
            /// this.
            pub(crate) limbs: Option<Box<Scratch>>,
            pub(crate) methods: Methods,
        }

        same_layout!(Data { $($name),* } same { size, tree, limbs, methods });

        impl<S: Scalar> Data<S> {
            fn allocate<R>($model: &Model<R>) -> Self {
                let $size = Size::new($model);
                $(let $name = $Workspace $(:: $Inner)? ::new($($from),*);)*
                let methods = Methods::new::<S, R>($model, $minv.factor.nonzeros());
                let limbs = Scratch::new::<S, R>($model);
                Self { size: $size, tree: $model.tree_hash(), $($name,)* limbs, methods }
            }

            fn copy(&self) -> Self {
                let Self { size, tree, $($name,)* limbs, methods } = self;
                Self { size: *size, tree: *tree, $($name: copied($name),)* limbs: copied(limbs), methods: *methods }
            }
        }
    };
}

data! {
    /// Scratch and results of every algorithm, for one model and one type of scalar.
    ///
    /// Each algorithm has its own workspace, defined in the file of the algorithm, and does not read results of other
    /// algorithms. So the order of calls does not matter. A `Data` allocates all memory when it is made. Use one `Data`
    /// per thread.
    ///
    /// ```
    /// use condyle_dynamics::{Data, robots};
    /// let arm = robots::arm7();
    /// let data = Data::<f64>::new(&arm);
    /// # let _ = data;
    /// ```
    (size, model, minv)
    world: World = (size),
    moving: Moving = (size),
    rnea: rnea::Workspace = (size),
    crba: crba::Workspace = (size),
    aba: aba::Workspace = (size),
    minv: minv::Workspace = (size, model),
    rnea_derivatives: rnea_derivatives::Workspace = (size),
    aba_derivatives: aba_derivatives::Workspace = (size, model),
    rnea_hessian: rnea_hessian::Workspace = (size),
    aba_hessian: aba_hessian::Workspace = (size),
    constrained_dynamics: constrained_dynamics::Workspace = (size, model),
    constrained_derivatives: constrained_derivatives::Workspace = (size),
    impulse_dynamics: impulse_dynamics::Workspace = (size),
    statics: statics::Workspace = (size),
    coriolis: coriolis::Workspace = (size),
    centroidal: centroidal::Workspace = (size),
    centroidal_derivatives: centroidal_derivatives::Workspace = (size),
    energy: energy::Workspace = (size),
    all_terms: all_terms::Workspace = (size),
    forward_dynamics: factored_dynamics::Workspace = (size, model),
    regressor: regressor::Workspace = (size),
}

impl<S: Scalar> Data<S> {
    /// Allocates all memory for a model.
    pub fn new<R: 'static>(model: &Model<R>) -> Self {
        if !is::<R, f64>() || !(S::COMPILED || is::<S, f32>()) {
            return Self::allocate(model);
        }
        // SAFETY: R is f64, and S is the scalar of the returned data.
        unsafe {
            if is::<S, f64>() {
                same(new_single(same(model)))
            } else if is::<S, f32>() {
                same(new_single_f32(same(model)))
            } else if is::<S, Narrow>() {
                same(new_narrow(same(model)))
            } else {
                same(new_wide(same(model)))
            }
        }
    }
}

/// Functions that create and clone a [`Data`], compiled in this crate for common scalars.
fn new_single(model: &Model) -> Data<f64> {
    Data::allocate(model)
}
fn new_single_f32(model: &Model) -> Data<f32> {
    Data::allocate(model)
}
fn new_narrow(model: &Model) -> Data<Narrow> {
    Data::allocate(model)
}
fn new_wide(model: &Model) -> Data<Wide> {
    Data::allocate(model)
}
fn clone_single(data: &Data<f64>) -> Data<f64> {
    data.copy()
}
fn clone_single_f32(data: &Data<f32>) -> Data<f32> {
    data.copy()
}
fn clone_narrow(data: &Data<Narrow>) -> Data<Narrow> {
    data.copy()
}
fn clone_wide(data: &Data<Wide>) -> Data<Wide> {
    data.copy()
}

/// Clones a workspace. This function is compiled separately for each workspace type. Inlined into the clone of `Data`,
/// the copies would form the largest function of the library.
#[inline(never)]
fn copied<W: Clone>(workspace: &W) -> W {
    workspace.clone()
}

impl<S: Scalar> Clone for Data<S> {
    fn clone(&self) -> Self {
        if !(S::COMPILED || is::<S, f32>()) {
            return self.copy();
        }
        // SAFETY: S is the scalar of the returned data.
        unsafe {
            if is::<S, f64>() {
                same(clone_single(same(self)))
            } else if is::<S, f32>() {
                same(clone_single_f32(same(self)))
            } else if is::<S, Narrow>() {
                same(clone_narrow(same(self)))
            } else {
                same(clone_wide(same(self)))
            }
        }
    }
}

impl<S> Data<S> {
    /// Panics unless the data was made for a model with the same tree.
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
    /// Panics with the message of [`Data::check`]. The function is not inlined, because `Data::check` is inlined into
    /// every algorithm.
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

/// Panics unless there is one force per body, including the world, or no force at all.
#[inline]
#[track_caller]
pub(crate) fn check_forces(found: usize, bodies: usize) {
    if found != 0 && found != bodies {
        wrong_forces(found, bodies);
    }
}

/// Panics with the message of [`check_forces`].
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_forces(found: usize, bodies: usize) -> ! {
    panic!("f_ext: expected no force or {bodies} (one for each body), found {found}");
}
