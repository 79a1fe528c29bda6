//! Jacobian of one frame at one position, which visits only the joints between the frame and the world.
//!
//! From the frame f up to the world, with the pose iXf of f in the frame of body i:
//!
//! ```text
//! J_i = iXf⁻¹ S_i     λXf = λXi(q) iXf     at the world, oXf converts J to other reference frames
//! ```
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 2.8 (S in any coordinates) and example 4.1.

use super::frames::ReferenceFrame;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Act, Motion, Scalar, Se3, Vec3, kernel};

/// Number of joints whose sines and cosines are computed at once.
const AT_ONCE: usize = 8;

kernel! {
    /// Computes J of a frame at iXf on a body, in O(depth). The strides are the distance between rows of J, and the
    /// distance between columns.
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
            // Groups of AT_ONCE joints, so that their sines and cosines are computed together.
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
            // Several columns may belong to one coordinate.
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

/// Expresses a column in another frame.
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
