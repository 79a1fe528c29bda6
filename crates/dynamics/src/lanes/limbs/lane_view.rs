//! Results of a pass in lanes, with functions that return the results of one body.

use super::Plan;
use super::lanes::Four;
use super::pass::Scratch;
use condyle_spatial::block::lanes;
use condyle_spatial::{Inertia, Mat3, Motion, Scalar, Se3, Sym3, Vec3};

/// View of the results in lanes that the derivatives of inverse dynamics read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneView<'d> {
    plan: &'d Plan,
    scratch: &'d Scratch,
}

impl<'d> LaneView<'d> {
    pub(crate) fn new(plan: &'d Plan, scratch: &'d Scratch) -> Self {
        Self { plan, scratch }
    }

    /// Returns the placement oX of body b.
    pub(crate) fn pose<S: Scalar>(self, b: usize) -> Se3<S> {
        let (step, lane) = self.plan.place(b);
        let Se3 { rotation: Mat3 { x, y, z }, translation } = &self.scratch.world.oX[step];
        let rotation = Mat3 { x: vector(x, lane), y: vector(y, lane), z: vector(z, lane) };
        Se3::new(rotation, vector(translation, lane))
    }

    /// Returns column k of S, the motion subspace of body b's joint.
    pub(crate) fn column<S: Scalar>(self, b: usize, k: usize) -> Motion<S> {
        let (step, lane) = self.plan.place(b);
        motion(&self.scratch.world.S[self.plan.steps[step].idx_v + k], lane)
    }

    /// Returns the velocity and the acceleration of body b. The accelerations are computed with the acceleration −g of
    /// the world, which accounts for gravity.
    pub(crate) fn moving<S: Scalar>(self, b: usize) -> (Motion<S>, Motion<S>) {
        let (step, lane) = self.plan.place(b);
        (motion(&self.scratch.bodies.v[step], lane), motion(&self.scratch.bodies.a[step], lane))
    }

    /// Returns the composite inertia Iᶜ of body b.
    pub(crate) fn carried<S: Scalar>(self, b: usize) -> Inertia<S> {
        let (step, lane) = self.plan.place(b);
        let Inertia { mass, mass_com, rotational: r } = &self.scratch.bodies.IC[step];
        let n = |x| number(x, lane);
        let rotational = Sym3 { xx: n(&r.xx), xy: n(&r.xy), yy: n(&r.yy), xz: n(&r.xz), yz: n(&r.yz), zz: n(&r.zz) };
        Inertia { mass: n(mass), mass_com: vector(mass_com, lane), rotational }
    }
}

fn number<S: Scalar>(x: &Four, lane: usize) -> S {
    // read from memory, because this code must also run on processors without vectors
    S::splat(lanes(core::slice::from_ref(x))[lane])
}

fn vector<S: Scalar>(v: &Vec3<Four>, lane: usize) -> Vec3<S> {
    Vec3::new(number(&v.x, lane), number(&v.y, lane), number(&v.z, lane))
}

fn motion<S: Scalar>(m: &Motion<Four>, lane: usize) -> Motion<S> {
    Motion::new(vector(&m.linear, lane), vector(&m.angular, lane))
}
