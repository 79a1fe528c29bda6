//! Jacobian of one frame at one position. The computation visits only the joints between the frame and the world.
//!
//! The recursion goes from the frame f to the world. iXf is the pose of f in the frame of body i, and λ is the parent
//! of i:
//!
//! ```text
//! J_i = iXf⁻¹ S_i     λXf = λXi(q) iXf     at the world, oXf converts J to other reference frames
//! ```
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 2.8 (the joint's columns S in any
//! coordinates) and example 4.1.

use super::frames::ReferenceFrame;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Act, Motion, Scalar, Se3, Vec3, kernel};

/// Number of joints whose sines and cosines are computed together.
const AT_ONCE: usize = 8;

kernel! {
    /// Computes the Jacobian J of a frame that is fixed to `body`, in O(depth). iXf is the pose of the frame in the
    /// body's frame. `strides` are the distances in `J` between rows and between columns.
    pub(crate) fn path_jacobian<S, R>(
        model: &Model<R>,
        q: &[S],
        body: usize,
        iXf: Se3<S>,
        reference: ReferenceFrame,
        J: &mut [S],
        strides: [usize; 2],
    ) {
        J.fill(S::zero());
        let l = Single::new(model);
        let (mut i, mut X) = (body, iXf);
        while i > 0 {
            // Joints are visited in groups of AT_ONCE, so that the sines and cosines of a group are computed together.
            let (mut some, mut n) = ([0; AT_ONCE], 0);
            while i > 0 && n < AT_ONCE {
                some[n] = i;
                n += 1;
                i = model.nodes()[i].parent;
            }
            let (mut sin, mut cos) = ([S::zero(); AT_ONCE], [S::one(); AT_ONCE]);
            let of = ..n.next_multiple_of(JointSinCos::<S>::STEP);
            Joint::sin_cos_of(&l, &some[..n], q, &mut sin[of], &mut cos[of]);
            for (k, &i) in some[..n].iter().enumerate() {
                let joint = l.joint(i);
                for k in 0..joint.nv() {
                    let column = &model.columns()[l.column(i) + k];
                    let S = X.act_inv(joint.column(&Se3::identity(), k)).scale(S::splat(column.ratio)); // J = iXf⁻¹ S
                    for (row, S) in S.to_array().into_iter().enumerate() {
                        J[row * strides[0] + column.coordinate * strides[1]] += S;
                    }
                }
                X = Joint::placement_with(&l, i, q, sin[k], cos[k]) * X; // λXf = λXi iXf
            }
        }
        let turn = match reference {
            ReferenceFrame::Local => return,
            ReferenceFrame::World => X,
            ReferenceFrame::LocalWorldAligned => Se3::new(X.rotation, Vec3::zero()),
        };
        if model.has_mimic() {
            // With mimic joints, several joint columns may belong to one coordinate. Each column of J is converted only
            // once.
            for coordinate in 0..model.nv() {
                act(turn, J, coordinate, strides);
            }
        } else {
            for &column in model.support(&model.nodes()[body]) {
                act(turn, J, model.columns()[column].coordinate, strides);
            }
        }
    }
}

/// Converts the column of J for one coordinate to another frame by the transformation X.
#[inline(always)]
fn act<S: Scalar>(X: Se3<S>, J: &mut [S], coordinate: usize, [down, along]: [usize; 2]) {
    let mut column = [S::zero(); 6];
    for row in 0..6 {
        column[row] = J[row * down + coordinate * along];
    }
    column = X.act(Motion::from(column)).to_array();
    for row in 0..6 {
        J[row * down + coordinate * along] = column[row];
    }
}
