//! Where the bodies and frames are, and how they move with the joints.

use crate::data::{Data, Size, check};
use crate::joint::Joint;
use crate::layout::{Layout, Single};
use crate::model::Model;
use condyle_spatial::{Act, Constant, Mat3, Motion, Scalar, Se3, Vec3};
use nalgebra::DMatrix;

/// What depends on the position alone, in the world's frame.
#[derive(Clone, Debug)]
pub(crate) struct World<S> {
    /// oXi: the body's turned frame in the world. Shape: bodies. Written by: `place`.
    pub oX: Vec<Se3<S>>,
    /// S: what each degree of freedom moves the body by. Shape: columns. Written by: `place`.
    pub S: Vec<Motion<S>>,
}

impl<S: Scalar> World<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self { oX: vec![Se3::identity(); size.bodies], S: vec![Motion::zero(); size.columns] }
    }
}

/// oXi = oXλ λXi, and the columns of S, for all bodies.
#[inline(always)]
pub(crate) fn place<L: Layout>(l: &L, World { oX, S }: &mut World<L::S>, q: &[L::S]) {
    for i in l.bodies() {
        oX[i] = l.parent(oX, i) * Joint::placement(l, i, q); // oXi = oXλ λXi
        let joint = l.joint(i);
        for k in 0..joint.nv() {
            S[l.slot(i) + k] = joint.column(&oX[i], k); // oXi S, in the world
        }
    }
}

/// In which frame the velocity of a frame is expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceFrame {
    /// In the frame itself.
    Local,
    /// In the world's frame: the velocity of the body's point at the world's origin.
    World,
    /// Of the frame's origin, along the axes of the world.
    LocalWorldAligned,
}

/// The placements of a robot at one position, as [`forward_kinematics`] left them.
#[derive(Clone, Copy, Debug)]
pub struct Placements<'d, S, R = f64> {
    model: &'d Model<R>,
    world: &'d World<S>,
}

/// Places all bodies: oXi = oXλ λXi(q), in O(n).
///
/// q: nq numbers. Allocates nothing. Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 4.1.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let placements = forward_kinematics(&arm, &mut data, &[0.0; 7]);
/// let tool = placements.frame(arm.frame("tool")?);
/// assert!(tool.translation.z > 0.5); // stretched upwards
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If `q` has not nq numbers.
pub fn forward_kinematics<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
) -> Placements<'d, S, R> {
    check("q", q.len(), model.nq);
    place(&Single::new(model), &mut data.world, q);
    Placements { model, world: &data.world }
}

impl<S: Scalar, R: Constant<S>> Placements<'_, S, R> {
    /// oXb: the pose of a body in the world, in the frame that the URDF gives it.
    ///
    /// # Panics
    /// If there is no such body.
    pub fn body(&self, body: usize) -> Se3<S> {
        let zXb = Se3::new(self.model.nodes[body].reframing.transpose(), Vec3::zero());
        self.world.oX[body] * zXb.lift()
    }

    /// oXf: the pose of a frame in the world.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn frame(&self, frame: usize) -> Se3<S> {
        let frame = &self.model.frames[frame];
        self.body(frame.body) * frame.placement.lift()
    }

    /// The Jacobian J of a frame, 6 × nv, linear rows first: its velocity is J v.
    ///
    /// # Panics
    /// If there is no such frame, or `J` is not 6 × nv.
    pub fn frame_jacobian(&self, frame: usize, reference: ReferenceFrame, J: &mut DMatrix<S>) {
        assert!(J.shape() == (6, self.model.nv), "J: expected 6 × {}, found {:?}", self.model.nv, J.shape());
        let pose = self.frame(frame);
        // fXo of the frame whose motions the rows are
        let oXr = match reference {
            ReferenceFrame::Local => pose,
            ReferenceFrame::World => Se3::identity(),
            ReferenceFrame::LocalWorldAligned => Se3::new(Mat3::identity(), pose.translation),
        };
        J.fill(S::zero());
        let l = Single::<S, R>::new(self.model);
        for &c in l.support(self.model.frames[frame].body) {
            let column = &self.model.columns[c];
            let s = oXr.act_inv(self.world.S[c]).scale(S::splat(column.ratio)).to_array();
            for (row, &s) in s.iter().enumerate() {
                J[(row, column.coordinate)] += s;
            }
        }
    }
}
