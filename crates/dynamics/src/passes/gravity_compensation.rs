//! Gravity compensation: efforts that carry a given fraction of the weight of selected bodies.
//!
//! For each compensated body, a force −m g acts at a point c, where m is the carried mass. The joint efforts of these
//! forces are the gradient of the potential energy of the carried masses. Let a₀ = −g, and let body i be a body on the
//! path to the root, with parent λ and joint column S_i. F is the force −m g with its moment about the origin of body
//! i. d and e are joint columns on the path. In the frame of body i:
//!
//! ```text
//! F = [m a₀; m c × a₀]     τ_i = S_iᵀ F     λF = λXi F
//! ∂τ_d/∂q_e = S_e,ω · ((m S_d,v + S_d,ω × m c) × a₀)     (e on the path from d to the root)
//! ```
//!
//! ∂τ_e/∂q_d equals ∂τ_d/∂q_e, because both are second derivatives of an energy. The cost per body is O(depth), and
//! O(depth²) with derivatives. The algorithm needs no scratch. Source: the equations for weights in `statics.rs`,
//! applied to each body.

use condyle_model::joint::Joint;
use condyle_model::layout::{Layout, Pairs};
use condyle_model::{GravityCompensation, Model};
use condyle_spatial::{Act, Force, Inertia, Mat3, Se3, Vec3};

/// Returns the carried mass and a₀ = −g in the internal frame of the compensated body, which is rotated to the joint
/// axis.
#[inline(always)]
fn carried<L: Layout, R>(l: &L, model: &Model<R>, of: &GravityCompensation, q: &[L::S]) -> (Inertia<L::S>, Vec3<L::S>) {
    let bRz = model.nodes()[of.body].axis_rotation;
    let turned = GravityCompensation { added_mass_com: bRz.transpose_mul(of.added_mass_com), ..*of };
    let (mut i, mut rotation) = (of.body, Mat3::identity());
    while i > 0 {
        rotation = Joint::placement(l, i, q).rotation * rotation; // oRb
        i = model.nodes()[i].parent;
    }
    (turned.carried(l.inertia(of.body)), rotation.transpose_mul(l.minus_gravity())) // a₀ = −oRbᵀ g
}

/// Adds the efforts of gravity compensation to `tau`.
#[inline(always)]
pub(super) fn add_efforts<L: Layout, R>(l: &L, model: &Model<R>, q: &[L::S], tau: &mut [L::S]) {
    for of in model.gravity_compensation() {
        let (mass, a) = carried(l, model, of, q);
        let mut F = Force::new(a.scale(mass.mass), mass.mass_com.cross(a)); // F = [m a₀; m c × a₀]
        let mut i = of.body;
        while i > 0 {
            Joint::project(l, i, F, tau); // τ_i = S_iᵀ F
            F = Joint::placement(l, i, q).act(F); // λF = λXi F
            i = model.nodes()[i].parent;
        }
    }
}

/// Adds ∂τ/∂q of gravity compensation to an nv × nv matrix.
#[inline(always)]
pub(super) fn add_slopes<L: Pairs, R>(l: &L, model: &Model<R>, q: &[L::S], dtau_dq: &mut [L::S]) {
    let identity = Se3::identity();
    for of in model.gravity_compensation() {
        let (mut mass, mut a) = carried(l, model, of, q);
        let mut i = of.body;
        while i > 0 {
            let (support, nv) = (l.support(i), l.joint(i).nv());
            let own = &support[support.len() - nv..];
            for k in 0..nv {
                let S_d = l.joint(i).column(&identity, k);
                let mut moment = (mass * S_d).linear.cross(a); // (m S_v + S_ω × m c) × a₀
                for e in 0..nv {
                    let S_e = l.joint(i).column(&identity, e);
                    l.add_entry(dtau_dq, own[k], own[e], S_e.angular.dot(moment));
                }
                let mut j = i;
                loop {
                    moment = Joint::placement(l, j, q).rotation * moment;
                    j = model.nodes()[j].parent;
                    if j == 0 {
                        break;
                    }
                    let (support, nv) = (l.support(j), l.joint(j).nv());
                    let before = &support[support.len() - nv..];
                    for e in 0..nv {
                        let x = l.joint(j).column(&identity, e).angular.dot(moment); // ∂τ_d/∂q_e = ∂τ_e/∂q_d
                        l.add_entry(dtau_dq, own[k], before[e], x);
                        l.add_entry(dtau_dq, before[e], own[k], x);
                    }
                }
            }
            let X = Joint::placement(l, i, q);
            (mass, a) = (X.act(mass), X.rotation * a);
            i = model.nodes()[i].parent;
        }
    }
}
