//! The Jacobian of one frame at one position: only the joints between it and the world are looked at.
//!
//! From the frame f up to the world, with its pose iXf in the frame of body i:
//!
//! ```text
//! J_i = iXf⁻¹ S_i     λXf = λXi(q) iXf     and at the world oXf, by which J turns to other references
//! ```
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 2.8 (S in any coordinates) and example 4.1.

use super::frames::{ReferenceFrame, add, clear};
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Act, Motion, Scalar, Se3, Vec3, kernel};
use nalgebra::DMatrix;

kernel! {
    /// J of a frame at iXf on a body, in O(depth).
    pub(crate) fn path_jacobian<S, R>(
        model: &Model<R>,
        q: &[S],
        body: usize,
        iXf: Se3<S>,
        reference: ReferenceFrame,
        J: &mut DMatrix<S>,
    ) {
        clear("J", J, model.nv());
        let l = Single::new(model);
        let (mut i, mut X) = (body, iXf);
        while i > 0 {
            let joint = l.joint(i);
            for k in 0..joint.nv() {
                add(model, J, l.column(i) + k, X.act_inv(joint.column(&Se3::identity(), k))); // J = iXf⁻¹ S
            }
            X = Joint::placement(&l, i, q) * X; // λXf = λXi iXf
            i = model.nodes()[i].parent;
        }
        let turn = match reference {
            ReferenceFrame::Local => return,
            ReferenceFrame::World => X,
            ReferenceFrame::LocalWorldAligned => Se3::new(X.rotation, Vec3::zero()),
        };
        if model.has_mimic() {
            // several columns may follow one coordinate
            for coordinate in 0..model.nv() {
                act(turn, J, coordinate);
            }
        } else {
            for &column in model.support(&model.nodes()[body]) {
                act(turn, J, model.columns()[column].coordinate);
            }
        }
    }
}

/// Expresses a column in another frame.
#[inline(always)]
fn act<S: Scalar>(X: Se3<S>, J: &mut DMatrix<S>, coordinate: usize) {
    let column = &mut J.as_mut_slice()[6 * coordinate..6 * coordinate + 6];
    let motion = Motion::from([column[0], column[1], column[2], column[3], column[4], column[5]]);
    column.copy_from_slice(&X.act(motion).to_array());
}
