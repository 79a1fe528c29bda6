//! State at which inverse dynamics was differentiated. It includes all quantities of the bodies that the computation of
//! the derivatives has left in `Data`.

use crate::derivatives::rnea_derivatives::Workspace;
use crate::lanes::limbs::LaneView;
use crate::passes::frames::Placements;
use crate::passes::kinematics::World;
use condyle_model::Model;
use condyle_spatial::gate::{FusedF64, Rename};
use condyle_spatial::{Constant, Inertia, Motion, Scalar, Se3, Vec3};

/// State at which inverse dynamics was differentiated, with the quantities of all bodies in this state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State<'d, S, R> {
    pub model: &'d Model<R>,
    pub world: &'d World<S>,
    pub pass: &'d Workspace<S>,
    /// Joint accelerations q̈ in this state.
    pub qdd: &'d [S],
    /// Lanes that contain the quantities of the bodies. `None` if the bodies were computed one by one.
    pub limbs: Option<LaneView<'d>>,
}

impl<'d> Rename<State<'d, FusedF64, f64>> for State<'d, f64, f64> {
    #[inline(always)]
    fn renamed(self) -> State<'d, FusedF64, f64> {
        let Self { model, world, pass, qdd, limbs } = self;
        State { model, world: world.renamed(), pass: pass.renamed(), qdd: qdd.renamed(), limbs }
    }
}

impl<S: Scalar, R: Constant<S>> State<'_, S, R> {
    /// Returns oXb, the pose of body b in the world. The body's frame is the link's frame in the URDF.
    #[inline(always)]
    pub(crate) fn pose(&self, b: usize) -> Se3<S> {
        if let Some(limbs) = self.limbs {
            return limbs.pose(b) * Se3::new(self.model.nodes()[b].axis_rotation.transpose(), Vec3::zero()).lift();
        }
        Placements { model: self.model, world: self.world }.body(b)
    }

    /// Returns column k of the motion subspace S of joint i, in the world's frame.
    #[inline(always)]
    pub(crate) fn column(&self, i: usize, k: usize) -> Motion<S> {
        if let Some(limbs) = self.limbs {
            return limbs.column(i, k);
        }
        self.world.S[self.model.nodes()[i].column + k]
    }

    /// Returns the velocity and the acceleration of a body. The world's acceleration is −g, so the acceleration
    /// includes gravity.
    #[inline(always)]
    pub(crate) fn moving(&self, b: usize) -> (Motion<S>, Motion<S>) {
        if let Some(limbs) = self.limbs {
            return limbs.moving(b);
        }
        (self.pass.bodies.v[b], self.pass.bodies.a[b])
    }

    /// Returns the composite inertia Iᶜ of all bodies that joint i carries.
    #[inline(always)]
    pub(crate) fn carried(&self, i: usize) -> Inertia<S> {
        if let Some(limbs) = self.limbs {
            return limbs.carried(i);
        }
        self.pass.bodies.IC[i]
    }

    /// Returns all joint columns on the path from body b to the root, as pairs (body, index of the column in the body's
    /// joint).
    pub(crate) fn columns(&self, b: usize) -> impl Iterator<Item = (usize, usize)> {
        let nodes = &self.model.nodes();
        let way = core::iter::successors(Some(b), |&i| Some(nodes[i].parent)).take_while(|&i| i > 0);
        way.flat_map(|i| (0..nodes[i].joint.nv()).map(move |k| (i, k)))
    }
}
