//! Gradient of the manipulability ln m = ½ ln det(J Jᵀ) of a frame.
//!
//! Along the axes of the frame, column j of J changes with a joint k between the joint j and the frame:
//!
//! ```text
//! ∂J_j/∂q_k = J_j × J_k          (0 if joint k is not after joint j)
//! ∂(ln m)/∂q_k = Σ_j (∂J_j/∂q_k)ᵀ (J Jᵀ)⁻¹ J_j
//! ```
//!
//! Source: Yoshikawa, *Manipulability of robotic mechanisms* (1985); the columns' derivative is the Lie bracket of
//! motions, as in Haviland and Corke (2022), equation 25, here along the axes of the frame.

use condyle_dynamics::{Cross, Joint, Model, Motion, Vec3};
use nalgebra::{DMatrix, Matrix6, Vector6};

/// Number added to the diagonal of J Jᵀ, so that the gradient stays finite at singular positions (m², rad²).
const SINGULAR: f64 = 1e-9;

/// Gradient of a frame's manipulability with respect to the joints with one coordinate.
#[derive(Clone, Debug)]
pub(crate) struct Manipulability {
    /// Coordinates between the world and the frame, from the root to the frame.
    pub joints: Vec<usize>,
    /// ∂(ln m)/∂q for each coordinate in `joints`.
    pub gradient: Vec<f64>,
    /// (J Jᵀ)⁻¹ J for each coordinate in `joints`.
    solved: Vec<Vector6<f64>>,
}

impl Manipulability {
    pub(crate) fn new(model: &Model, frame: usize) -> Self {
        let (mut joints, mut body) = (Vec::new(), model.frames()[frame].body);
        while body != 0 {
            let b = &model.bodies()[body];
            if b.joint.nv() == 1 && b.mimic.is_none() && b.joint != Joint::FreeFlyer {
                joints.push(b.idx_v);
            }
            body = b.parent;
        }
        joints.reverse();
        let n = joints.len();
        Self { joints, gradient: vec![0.0; n], solved: vec![Vector6::zeros(); n] }
    }

    /// Computes the gradient from the frame's Jacobian along its own axes. `factors` are the weights of the rows; a row
    /// with factor 0 is left out.
    pub(crate) fn update(&mut self, J: &DMatrix<f64>, factors: &[f64; 6]) {
        let column = |c: usize| Vector6::from_column_slice(&J.as_slice()[6 * c..6 * c + 6]);
        let weights = Vector6::from_fn(|i, _| factors[i]);
        let mut M = Matrix6::zeros();
        for &c in &self.joints {
            let x = column(c).component_mul(&weights.map(f64::sqrt));
            M += x * x.transpose();
        }
        for i in 0..6 {
            M[(i, i)] += if factors[i] > 0.0 { SINGULAR } else { 1.0 };
        }
        self.gradient.fill(0.0);
        let Some(factor) = M.cholesky() else { return };
        for (solved, &c) in self.solved.iter_mut().zip(&self.joints) {
            let roots = weights.map(f64::sqrt);
            *solved = factor.solve(&column(c).component_mul(&roots)).component_mul(&roots);
        }
        for (k, gradient) in self.gradient.iter_mut().enumerate() {
            let Jk = motion(&column(self.joints[k]));
            for j in 0..k {
                let change = motion(&column(self.joints[j])).cross(Jk); // ∂J_j/∂q_k = J_j × J_k
                *gradient += Vector6::from(change.to_array()).dot(&self.solved[j]);
            }
        }
    }
}

fn motion(x: &Vector6<f64>) -> Motion<f64> {
    Motion::new(Vec3::new(x[0], x[1], x[2]), Vec3::new(x[3], x[4], x[5]))
}
