//! Momentum of the whole robot about its centre of mass, and the matrix that maps joint velocities to this momentum.
//!
//! The momentum about the world's origin is Σ I_i v_i = Σ Iᶜ_k S_k q̇_k, where Iᶜ_k is the inertia of all bodies that
//! joint k carries. So column k of the map is Iᶜ_k S_k, and the rate of the column is İᶜ_k S_k + Iᶜ_k Ṡ_k. Finally the
//! map and its rate are shifted to the centre of mass.
//!
//! Source: Orin, Goswami, Lee, *Centroidal dynamics of a humanoid robot* (2013); Wensing and Orin, *Improved
//! computation of the humanoid centroidal dynamics* (2016). All quantities are expressed in the axes of the world;
//! linear rows come first.

use crate::passes::answers::answers;
use crate::passes::coriolis::Coriolis;
use crate::passes::frames::{Accelerations, Velocities};
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::gate::{FusedF64, Rename};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Matrix, Scalar, Se3, Vec3};

workspace! {
    /// Scratch of the centroidal map, in the world's frame. Moments are about the world's origin unless a field says
    /// "about the centre of mass".
    pub(crate) struct Workspace<S>(size) {
        /// Composite inertia Iᶜ of all bodies that a joint carries. Index 0 holds the sum over all moving bodies.
        /// Written by: `map`, `map_rate`, all terms.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Momentum and rate of inertia İᶜ of all bodies that a joint carries. Index 0 holds the sum over all moving
        /// bodies. Written by: `map_rate`, all terms.
        pub BC: Array<Coriolis<S>> = filled(Coriolis::zero, size.bodies),
        /// Momentum Iᶜ S of each column S, with the composite inertia Iᶜ. Written by: `map`, `map_rate`, all terms.
        pub F: Array<Force<S>> = filled(Force::zero, size.columns),
        /// Rate İᶜ S + Iᶜ Ṡ of `F`. Written by: `map_rate`, all terms.
        pub dF: Array<Force<S>> = filled(Force::zero, size.columns),
        /// Centroidal map Ag about the centre of mass. Written by: `shift_map`.
        pub Ag: Matrix<S> = zero_matrix(6, size.nv),
        /// Rate dAg/dt of the centroidal map about the centre of mass. Written by: `shift_rate`.
        pub dAg: Matrix<S> = zero_matrix(6, size.nv),
        /// Jacobian of the centre of mass. Written by: `shift_map`.
        pub Jcom: Matrix<S> = zero_matrix(3, size.nv),
        /// Quantities of the whole robot as one body. Written by: `shift_map`, `shift_rate`.
        pub whole: Whole<S> = Whole::new(size),
    }
}

workspace! {
    /// Quantities of the whole robot as one body. `hg` and `com_velocity` are written only if the rate of the map is
    /// computed.
    pub(crate) struct Whole<S>(_size) {
        pub Ig: Inertia<S> = Inertia::zero(),
        pub com: Vec3<S> = Vec3::zero(),
        pub hg: Force<S> = Force::zero(),
        pub com_velocity: Vec3<S> = Vec3::zero(),
    }
}

impl<S: Scalar> Workspace<S> {
    /// Returns the results of `run_map`.
    pub(crate) fn map(&self) -> CentroidalMap<'_, S> {
        let Self { Ag, Jcom, whole: Whole { Ig, com, .. }, .. } = self;
        CentroidalMap { Ag, Ig: *Ig, com: *com, Jcom }
    }

    /// Returns the results of `run_map_rate`.
    pub(crate) fn map_rate(&self) -> CentroidalMapRate<'_, S> {
        let Self { Ag, dAg, Jcom, whole: Whole { Ig, com, hg, com_velocity }, .. } = self;
        CentroidalMapRate { Ag, dAg, hg: *hg, Ig: *Ig, com: *com, com_velocity: *com_velocity, Jcom }
    }
}

/// Computes the momentum Iᶜ S of each column S, with the composite inertia Iᶜ. The placements of the bodies must
/// already be computed.
#[inline(always)]
fn map<L: Layout>(l: &L, World { oX, S, .. }: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IC, F, .. } = d;
    IC[0] = Inertia::zero();
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
    }
    for i in l.bodies().rev() {
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            F[c] = IC[i] * S[c]; // Iᶜ S
        }
        let IC_i = IC[i];
        l.add_to_parent(IC, i, IC_i); // Iᶜ_λ += Iᶜ_i
    }
}

/// Computes the momentum Iᶜ S of each column S and the rate of this momentum, with the composite inertia Iᶜ. The
/// velocities of the bodies must already be computed.
#[inline(always)]
fn map_rate<L: Layout>(l: &L, World { oX, S, .. }: &World<L::S>, m: &Moving<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IC, BC, F, dF, .. } = d;
    (IC[0], BC[0]) = (Inertia::zero(), Coriolis::zero());
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
        BC[i] = Coriolis::of(IC[i], m.v[i]);
    }
    for i in l.bodies().rev() {
        let dIC = BC[i].inertia_rate();
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            F[c] = IC[i] * S[c]; // Iᶜ S
            dF[c] = dIC * S[c] + IC[i] * m.dS[c]; // İᶜ S + Iᶜ Ṡ
        }
        let (IC_i, BC_i) = (IC[i], BC[i]);
        l.add_to_parent(IC, i, IC_i); // Iᶜ_λ += Iᶜ_i
        l.add_to_parent(BC, i, BC_i);
    }
}

/// Multiplies `f` by the ratio of joint column c, and adds the product to the matrix column of the coordinate that
/// drives column c.
#[inline(always)]
pub(crate) fn add<S: Scalar, R>(model: &Model<R>, matrix: &mut Matrix<S>, c: usize, f: Force<S>) {
    let column = &model.columns()[c];
    let (f, at) = (f.scale(S::splat(column.ratio)).to_array(), 6 * column.coordinate);
    for (entry, &f) in matrix.as_mut_slice()[at..at + 6].iter_mut().zip(&f) {
        *entry += f;
    }
}

/// Returns the force [f; n − c × f], which is the force [f; n] with its moment about the point c instead of the origin.
#[inline(always)]
pub(crate) fn about<S: Scalar>(c: Vec3<S>, f: Force<S>) -> Force<S> {
    Force::new(f.linear, f.angular - c.cross(f.linear))
}

/// Shifts the centroidal map to the centre of mass. Runs after `map` or `map_rate`.
#[inline(always)]
fn shift_map<S: Scalar, R>(model: &Model<R>, d: &mut Workspace<S>) {
    let I = d.IC[0];
    let per_mass = I.mass.recip();
    let com = I.mass_com.scale(per_mass);
    d.Ag.as_mut_slice().fill(S::zero());
    for (c, &F) in d.F.iter().enumerate() {
        add(model, &mut d.Ag, c, about(com, F));
    }
    for (J, A) in d.Jcom.as_mut_slice().chunks_exact_mut(3).zip(d.Ag.as_slice().chunks_exact(6)) {
        for k in 0..3 {
            J[k] = A[k] * per_mass; // m ċ is the linear momentum
        }
    }
    let Ig = Se3::new(condyle_spatial::Mat3::identity(), -com).act(I);
    d.whole.Ig = Inertia { mass_com: Vec3::zero(), ..Ig }; // zero up to rounding
    d.whole.com = com;
}

/// Shifts the centroidal map and its rate to the centre of mass. Runs after `map_rate`.
#[inline(always)]
pub(crate) fn shift_rate<S: Scalar, R>(model: &Model<R>, d: &mut Workspace<S>) {
    let (I, momentum) = (d.IC[0], d.BC[0].momentum);
    let per_mass = I.mass.recip();
    let (com, com_velocity) = (I.mass_com.scale(per_mass), momentum.linear.scale(per_mass));
    d.dAg.as_mut_slice().fill(S::zero());
    for (c, (&F, &dF)) in d.F.iter().zip(&d.dF).enumerate() {
        let mut dA = about(com, dF); // d/dt [f; n − c × f] = [ḟ; ṅ − c × ḟ − ċ × f]
        dA.angular -= com_velocity.cross(F.linear);
        add(model, &mut d.dAg, c, dA);
    }
    shift_map(model, d);
    d.whole.hg = about(com, momentum);
    d.whole.com_velocity = com_velocity;
}

/// Centroidal map Ag of the momentum hg = Ag(q) v, and other centroidal quantities that depend only on the position.
/// All quantities are expressed in the axes of the world.
#[derive(Clone, Copy, Debug)]
pub struct CentroidalMap<'d, S> {
    /// Centroidal momentum matrix, 6 × nv, linear rows first: hg = Ag v.
    pub Ag: &'d Matrix<S>,
    /// Inertia of all moving bodies about their centre of mass, as if they were one body.
    pub Ig: Inertia<S>,
    /// Centre of mass c in the world's frame (m).
    pub com: Vec3<S>,
    /// Jacobian of the centre of mass c, 3 × nv: ċ = Jcom v.
    pub Jcom: &'d Matrix<S>,
}

/// Centroidal momentum hg = Ag(q) v, and the terms of its rate dhg = Ag a + dAg v. All quantities are expressed in the
/// axes of the world.
#[derive(Clone, Copy, Debug)]
pub struct CentroidalMapRate<'d, S> {
    /// Centroidal momentum matrix, 6 × nv, linear rows first: hg = Ag v.
    pub Ag: &'d Matrix<S>,
    /// Time derivative dAg/dt of the centroidal momentum matrix for the velocity v, 6 × nv.
    pub dAg: &'d Matrix<S>,
    /// Momentum about the centre of mass (kg m/s, kg m²/s).
    pub hg: Force<S>,
    /// Inertia of all moving bodies about their centre of mass, as if they were one body.
    pub Ig: Inertia<S>,
    /// Centre of mass c in the world's frame (m).
    pub com: Vec3<S>,
    /// Velocity ċ of the centre of mass (m/s).
    pub com_velocity: Vec3<S>,
    /// Jacobian of the centre of mass c, 3 × nv: ċ = Jcom v.
    pub Jcom: &'d Matrix<S>,
}

#[doc(hidden)]
impl<'d> Rename<CentroidalMapRate<'d, FusedF64>> for CentroidalMapRate<'d, f64> {
    #[inline(always)]
    fn renamed(self) -> CentroidalMapRate<'d, FusedF64> {
        CentroidalMapRate {
            Ag: self.Ag.renamed(),
            dAg: self.dAg.renamed(),
            hg: self.hg.renamed(),
            Ig: self.Ig.renamed(),
            com: self.com.renamed(),
            com_velocity: self.com_velocity.renamed(),
            Jcom: self.Jcom.renamed(),
        }
    }
}

kernel! {
    /// Computes the centroidal map. The placements of the bodies must already be computed.
    pub(crate) fn run_map<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        map(&Single::new(model), world, d);
        shift_map(model, d);
    }
}

kernel! {
    /// Computes the centroidal map and its rate. The velocities of the bodies must already be computed.
    pub(crate) fn run_map_rate<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        map_rate(&Single::new(model), world, moving, d);
        shift_rate(model, d);
    }
}

answers! {
    /// Returns hg = Σ I_i v_i, the momentum of the moving bodies about their centre of mass, in the axes of the world
    /// (kg m/s, kg m²/s). Costs O(n) for n bodies.
    ///
    /// Returns NaN if no moving body has mass. Allocates nothing.
    fn centroidal_momentum(of: Velocities) -> Force = Force::zero(); {
        let l = Single::<S, R>::new(of.model);
        let mut momentum = Force::zero();
        for i in l.bodies() {
            let oX = &of.world.oX[i];
            momentum += oX.act(l.inertia(i) * oX.act_inv(of.moving.v[i])); // I v
        }
        about(of.com(), momentum)
    }

    /// Returns dhg = Σ (I_i a_i + v_i ×* I_i v_i), the rate of the centroidal momentum, in the axes of the world (N, N
    /// m). Costs O(n) for n bodies. The rate equals the sum of the weight and the external forces, with moments about
    /// the centre of mass.
    ///
    /// Returns NaN if no moving body has mass. Allocates nothing.
    fn centroidal_momentum_rate(of: Accelerations) -> Force = Force::zero(); {
        let l = Single::<S, R>::new(of.model);
        let mut rate = Force::zero();
        for i in l.bodies() {
            let (oX, I) = (&of.world.oX[i], l.inertia(i));
            let (v, a) = (oX.act_inv(of.moving.v[i]), oX.act_inv(of.moving.a[i]));
            rate += oX.act(I * a + v.cross(I * v)); // I a + v ×* I v
        }
        about(of.com(), rate) // the term ċ × m ċ of the shift is 0
    }
}
