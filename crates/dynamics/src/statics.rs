//! The efforts that hold a robot still: weights and external forces, summed from the tips to the root.

use crate::data::{Data, Size, check, check_forces};
use crate::kinematics::{World, place};
use crate::layout::{Layout, Single};
use crate::model::Model;
use condyle_spatial::{Act, Constant, Force, Scalar};

/// In the world's frame.
#[derive(Clone, Debug)]
pub(crate) struct Workspace<S> {
    /// Weight and external force of all that a joint carries. Shape: bodies. Written by: `pass`.
    F: Vec<Force<S>>,
    /// Joint efforts. Shape: nv. Written by: `pass`.
    tau: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self { F: vec![Force::zero(); size.bodies], tau: vec![S::zero(); size.nv] }
    }
}

/// The whole algorithm, for bodies that are placed.
#[inline(always)]
fn pass<L: Layout>(l: &L, World { oX, S }: &World<L::S>, d: &mut Workspace<L::S>, f_ext: &[Force<L::S>]) {
    let Workspace { F, tau } = d;
    let g = -l.minus_gravity();
    for i in l.bodies() {
        let I = l.inertia(i);
        let moment = oX[i].rotation * I.mass_com + oX[i].translation.scale(I.mass); // m c, from the world's origin
        F[i] = Force::new(g.scale(I.mass), moment.cross(g)); // weight: [m g; c × m g]
        if let Some(external) = l.force(f_ext, i) {
            F[i] += oX[i].act(external);
        }
    }
    tau.fill(L::S::zero());
    for i in l.bodies().rev() {
        for k in 0..l.joint(i).nv() {
            l.add(tau, i, k, -S[l.slot(i) + k].dot(F[i])); // τ = −Sᵀ F
        }
        let F_i = F[i];
        l.push(F, i, F_i); // F_λ += F_i
    }
}

/// τ = g(q) − Σ Jᵢᵀ f_ext,i: the efforts that hold the robot still under external forces, in O(n). It is
/// [`rnea`](crate::rnea) with v = a = 0, at a lower price.
///
/// q: nq numbers; f_ext: a force on each body (N, N m), acting at the body's origin and expressed in its frame, number 0
/// being the world's; or empty for none. Returns nv numbers (N m, N). Allocates nothing.
/// Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 5.3.
///
/// ```
/// use condyle_dynamics::{Data, Force, Vec3, robots, static_torque};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let q = condyle_dynamics::neutral(&quadruped);
/// let mut f_ext = vec![Force::zero(); quadruped.bodies().len()];
/// f_ext[1].linear.z = 9.81 * quadruped.total_mass(); // hung up by its trunk
/// let tau = static_torque(&quadruped, &mut data, &q, &f_ext);
/// assert!(f64::abs(tau[2]) < 1e-9); // nothing else need carry it
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another size.
pub fn static_torque<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq);
    check_forces(f_ext.len(), model.nodes.len());
    let l = Single::new(model);
    place(&l, &mut data.world, q);
    pass(&l, &data.world, &mut data.statics, f_ext);
    &data.statics.tau
}
