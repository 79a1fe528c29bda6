//! The joint-space inertia matrix by the composite-rigid-body algorithm, in the bodies' own frames.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 6.2, line by line. This form is used only for
//! code that is recorded for one robot. In a body's frame, placements and inertias have many constants and zeros, which
//! the recording simplifies. In addition, the product of a joint axis S_e and a force F is just a component of F. In
//! the world's frame (`crba.rs` of `dynamics`), every number depends on all joints between the body and the world.
//! Tests compare generated code with `crba.rs`.

use super::joint_placement::{Carried, JointPlacement};
use condyle_model::joint::Joint;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::layout::Columns;
use condyle_spatial::{Act, Inertia, Se3};

/// Computes M with the complete algorithm. The function allocates vectors: a recording also allocates memory.
pub(super) fn pass<L: Columns>(l: &L, q: &[L::S], M: &mut [L::Number]) {
    let n = l.bodies().end;
    let mut angles = JointSinCos::new(n);
    Joint::sin_cos(l, q, &mut angles);
    let identity = Se3::<L::S>::identity();
    let numbers: Vec<usize> = (0..n).collect();
    let mut IC = vec![Inertia::zero(); n];
    let mut X = vec![(identity, JointPlacement::General(identity)); n]; // X_T and X_J of each body
    for i in l.bodies() {
        IC[i] = l.inertia(i);
        X[i] = (l.placement(i), JointPlacement::of(l, i, q, angles.sin[i], angles.cos[i])); // λXi = X_T X_J
    }
    l.clear(M);
    for i in l.bodies().rev() {
        let support = l.support(i);
        for k in 0..l.joint(i).nv() {
            let column = l.own_column(i, k);
            let mut F = IC[i] * l.joint(i).column(&identity, k); // F = Iᶜ S
            let mut j = i;
            while j != 0 {
                // M_ej = S_eᵀ F for every column e from the root to column j
                let (first, own) = (l.support(j).len() - l.joint(j).nv(), if j == i { k } else { l.joint(j).nv() });
                for e in 0..own {
                    let x = l.joint(j).column(&identity, e).dot(F);
                    l.set_column(M, column, support[first + e], x);
                    l.set_row(M, column, support[first + e], x);
                }
                if j == i {
                    l.set_row(M, column, support[first + k], l.joint(i).column(&identity, k).dot(F));
                }
                let (X_T, X_J) = &X[j];
                F = X_T.act(F.carried_by(X_J)); // F = λX*_j F
                j = l.parent(&numbers, j);
            }
        }
        let (X_T, X_J) = &X[i];
        let carried = X_T.act(IC[i].carried_by(X_J));
        l.add_to_parent(&mut IC, i, carried); // Iᶜ_λ += λX*_i Iᶜ_i iXλ
    }
    l.add_armature(M);
}
