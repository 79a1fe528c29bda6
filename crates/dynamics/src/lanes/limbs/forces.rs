//! Propagation of unit forces through the articulated bodies to the root, for the rows of J: see `constrained.rs`.
#![allow(unsafe_code)]

use super::lanes::{Four, numbers};
use super::{LANES, Plan};
use crate::constraints::constraint::ConstraintKind;
use crate::constraints::constraint_lanes::{All, Rows, WIDE};
use crate::constraints::constraint_motion::FramePair;
use crate::constraints::plan::Plan as ConstraintPlan;
use crate::passes::aba;
use crate::passes::kinematics::World;
use condyle_model::Model;
use condyle_spatial::block::Block;
use condyle_spatial::gate::FusedF64;
use condyle_spatial::{Mat3, Motion, Scalar, Se3, Vec3};

/// Results of the articulated-body algorithm that the propagation of forces reads, as slices of numbers.
#[derive(Clone, Copy)]
pub(crate) struct Left<'a> {
    plan: &'a Plan,
    oX: &'a [f64],
    S: &'a [f64],
    U: &'a [f64],
    D_inv: &'a [f64],
    u: &'a [f64],
    v: &'a [f64],
    c: &'a [f64],
    /// Linear acceleration a₀ = −g of the world.
    world: [f64; 3],
}

impl<'a> Left<'a> {
    #[inline(always)]
    pub(crate) fn new(plan: &'a Plan, model: &Model, w: &'a World<Four>, d: &'a aba::Workspace<Four>) -> Self {
        // SAFETY: poses, motions and forces of `Four` are structs of vector registers only.
        let [oX, S, U, v, c] = unsafe { [numbers(&w.oX), numbers(&w.S), numbers(&d.U), numbers(&d.v), numbers(&d.c)] };
        // SAFETY: the elements of both arrays are vector registers.
        let [D_inv, u] = unsafe { [numbers(&d.D_inv), numbers(&d.u)] };
        Self { plan, oX, S, U, D_inv, u, v, c, world: (-*model.gravity()).to_array() }
    }

    /// Returns the pose of a body in the world.
    #[inline(always)]
    pub(crate) fn pose(self, body: usize) -> Se3<FusedF64> {
        let (step, lane) = self.plan.place(body);
        let x = &self.oX[12 * LANES * step + lane..][..11 * LANES + 1];
        let mut columns = [Vec3::zero(); 4];
        for k in 0..4 {
            let at = 3 * LANES * k;
            columns[k] = Vec3::new(FusedF64(x[at]), FusedF64(x[at + LANES]), FusedF64(x[at + 2 * LANES]));
        }
        let [x, y, z, translation] = columns;
        Se3::new(Mat3 { x, y, z }, translation)
    }

    /// Returns the velocity of a body.
    #[inline(always)]
    pub(crate) fn velocity(self, body: usize) -> Motion<FusedF64> {
        let x = six(self.v, self.plan.place(body));
        let mut v = [FusedF64(0.0); 6];
        for k in 0..6 {
            v[k] = FusedF64(x[k * LANES]);
        }
        v.into()
    }
}

/// Returns a slice that begins with the first of the six numbers of a motion or force in one lane. The stride between
/// these numbers is `LANES`.
#[inline(always)]
pub(crate) fn six(of: &[f64], (at, lane): (usize, usize)) -> &[f64] {
    &of[6 * LANES * at + lane..][..5 * LANES + 1]
}

#[inline(always)]
fn read<V: Block<Number = f64>, const N: usize>(from: &[f64]) -> [V; N] {
    let mut x = [V::zero(); N];
    for n in 0..N {
        x[n] = V::load(&from[n * V::LANES..]);
    }
    x
}

#[inline(always)]
fn write<V: Block<Number = f64>, const N: usize>(x: [V; N], to: &mut [f64]) {
    for n in 0..N {
        x[n].store(&mut to[n * V::LANES..]);
    }
}

/// Forces of several rows, one force per row.
type Forces<V, const N: usize> = [[V; N]; 6];

#[inline(always)]
fn read_forces<V: Block<Number = f64>, const N: usize>(from: &[f64], stride: usize) -> Forces<V, N> {
    let mut f = [[V::zero(); N]; 6];
    for r in 0..6 {
        f[r] = read(&from[r * stride..]);
    }
    f
}

#[inline(always)]
fn add<V: Block<Number = f64>, const N: usize>(f: &Forces<V, N>, to: &mut Forces<V, N>) {
    for r in 0..6 {
        for n in 0..N {
            to[r][n] += f[r][n];
        }
    }
}

/// Returns the product fᵀ m of the force f of each row and the motion m.
#[inline(always)]
fn dot<V: Block<Number = f64>, const N: usize>(f: &Forces<V, N>, m: &[f64]) -> [V; N] {
    let mut sum = [V::zero(); N];
    for n in 0..N {
        let (mut linear, mut angular) = (f[0][n] * V::splat(m[0]), f[3][n] * V::splat(m[3 * LANES]));
        for r in 1..3 {
            linear = f[r][n].mul_add(V::splat(m[r * LANES]), linear);
            angular = f[r + 3][n].mul_add(V::splat(m[(r + 3) * LANES]), angular);
        }
        sum[n] = linear + angular;
    }
    sum
}

/// Computes and returns Y = Sᵀ f and Y D⁻¹ of one joint column S, for the forces f on the body of its joint. Replaces f
/// by f − U D⁻¹ Y, the force that the column transmits. Adds Y D⁻¹ u to x, the partial sum of the constraint
/// accelerations J q̈ + γ. U, D and u are quantities of the articulated-body algorithm.
#[inline(always)]
fn take<V: Block<Number = f64>, const N: usize>(
    left: Left<'_>,
    (slot, lane): (usize, usize),
    f: &mut Forces<V, N>,
    x: &mut [V; N],
) -> [[V; N]; 2] {
    let (U, number) = (six(left.U, (slot, lane)), slot * LANES + lane);
    let (D_inv, u) = (V::splat(left.D_inv[number]), V::splat(left.u[number]));
    let Y = dot(f, six(left.S, (slot, lane))); // Y = Sᵀ f
    let mut YD = Y;
    for n in 0..N {
        YD[n] = Y[n] * D_inv;
        x[n] = YD[n].mul_add(u, x[n]); // Y D⁻¹ u
    }
    for r in 0..6 {
        let U = V::splat(U[r * LANES]);
        for n in 0..N {
            f[r][n] = (-YD[n]).mul_add(U, f[r][n]); // f − U D⁻¹ Y
        }
    }
    [Y, YD]
}

/// Adds the term f_iᵀ c_i of body i to x, the partial sum of the constraint accelerations J q̈ + γ. f_i is the force
/// that the body's joint transmits, and c_i is the body's velocity-dependent acceleration.
#[inline(always)]
fn add_bias<V: Block<Number = f64>, const N: usize>(f: &Forces<V, N>, c: &[f64], x: &mut [V; N]) {
    let by_c = dot(f, c);
    for n in 0..N {
        x[n] += by_c[n];
    }
}

/// Adds the term f₀ᵀ a₀ of the world to x, the partial sum of the constraint accelerations J q̈ + γ. f₀ is the force on
/// the world, and a₀ is the acceleration of the world.
#[inline(always)]
fn add_world<V: Block<Number = f64>, const N: usize>(f: &Forces<V, N>, a: [f64; 3], x: &mut [V; N]) {
    for r in 0..3 {
        for n in 0..N {
            x[n] = f[r][n].mul_add(V::splat(a[r]), x[n]);
        }
    }
}

impl Rows {
    /// Computes the unit forces of a constraint's rows, and γ': the constraint accelerations γ without the terms of the
    /// bodies' accelerations.
    #[inline(always)]
    pub(crate) fn begin(&mut self, plan: &ConstraintPlan, ends: &FramePair<FusedF64>, gamma: [FusedF64; 6]) {
        let rigid = plan.kind == ConstraintKind::Rigid;
        let axes = if plan.aligned() { Mat3::identity() } else { ends.x1.rotation }.columns();
        for (end, (x, sign)) in [(ends.x1, 1.0), (ends.x2, -1.0)].into_iter().enumerate() {
            // A rigid constraint acts on both bodies at the origin of frame 1. A point constraint acts on body 1 at the
            // origin of frame 1, and on body 2 at the origin of frame 2.
            let p = if rigid { ends.x1.translation } else { x.translation };
            for r in 0..3 {
                let n = axes[r].scale(FusedF64(sign));
                let (n, moment) = (n.to_array(), p.cross(n).to_array());
                for k in 0..3 {
                    self.forces[end][k][r] = n[k].0;
                    self.forces[end][k + 3][r] = moment[k].0;
                    if rigid {
                        self.forces[end][k + 3][r + 3] = n[k].0;
                    }
                }
            }
        }
        for r in 0..plan.rows() {
            self.gamma[r] = gamma[r].0;
        }
    }

    /// Propagates the unit forces of a constraint's rows to the root.
    #[inline(always)]
    pub(crate) fn carry<V: Block<Number = f64>, const N: usize>(
        &self,
        plan: &ConstraintPlan,
        left: Left<'_>,
        [Y, YD]: [&mut [f64]; 2],
        all: &mut All,
        J: &mut [FusedF64],
    ) {
        let (mut x, mut whole, mut rest) = (read::<V, N>(&self.gamma), [[V::zero(); N]; 6], [[V::zero(); N]; 6]);
        for (k, way) in self.ways.iter().enumerate() {
            let (mut f_whole, mut f) = (whole, rest); // forces at the junction of both paths
            if k < 2 {
                f_whole = read_forces(self.forces[k].as_flattened(), WIDE);
                f = f_whole;
                if plan.bodies[k] == 0 {
                    add_world(&f, left.world, &mut x);
                    continue;
                }
            }
            for link in way {
                let (step, lane) = left.plan.place(link.body);
                for k in (0..link.nv).rev() {
                    let (slot, place) = (left.plan.steps[step].idx_v + k, link.at + k);
                    let mut numbers = [0.0; WIDE];
                    write(dot(&f_whole, six(left.S, (slot, lane))), &mut numbers);
                    for r in 0..plan.rows() {
                        J[plan.start + r * plan.places.len() + place] = FusedF64(numbers[r]);
                    }
                    let [y, yd] = take(left, (slot, lane), &mut f, &mut x);
                    write(y, &mut Y[self.start + place * self.wide..]);
                    write(yd, &mut YD[self.start + place * self.wide..]);
                }
                add_bias(&f, six(left.c, (step, lane)), &mut x);
            }
            if k < 2 {
                add(&f_whole, &mut whole);
                add(&f, &mut rest);
            } else {
                rest = f;
            }
        }
        for r in 0..6 {
            write(whole[r], &mut all.whole[r * all.stride + plan.row..]);
            write(rest[r], &mut all.rest[r * all.stride + plan.row..]);
        }
        write(x, &mut all.x[plan.row..]);
    }

    /// Adds the products Y D⁻¹ Yᵀ of shared slots to a block of the Delassus matrix J M⁻¹ Jᵀ. The rows of the block
    /// belong to the rows of this constraint. The three columns of the block belong to three rows of the other
    /// constraint, beginning with row r. `runs` are the slots that both constraints share, without the root's slots.
    #[inline(always)]
    pub(crate) fn multiply<V: Block<Number = f64>, const N: usize>(
        &self,
        (other, r): (&Self, usize),
        runs: &[[usize; 3]],
        [Y, YD]: [&[f64]; 2],
        G: &mut [f64],
        stride: usize,
    ) {
        let mut sums = [[V::zero(); N]; 3];
        for e in 0..3 {
            sums[e] = read(&G[e * stride..]);
        }
        for &[here, there, many] in runs {
            for k in 0..many {
                let y = read::<V, N>(&Y[self.start + (here + k) * self.wide..]);
                let yd = &YD[other.start + (there + k) * other.wide + r..][..3];
                for e in 0..3 {
                    for n in 0..N {
                        sums[e][n] = y[n].mul_add(V::splat(yd[e]), sums[e][n]); // Σ Y D⁻¹ Yᵀ
                    }
                }
            }
        }
        for e in 0..3 {
            write(sums[e], &mut G[e * stride..]);
        }
    }

    /// Returns the acceleration J q̈ + γ of this constraint for the given accelerations of its two bodies.
    #[inline(always)]
    pub(crate) fn error(&self, [one, other]: [&[f64]; 2]) -> [f64; WIDE] {
        let mut error = [0.0; WIDE];
        for first in (0..self.wide).step_by(LANES) {
            let mut x = Four::load(&self.gamma[first..]);
            for r in 0..6 {
                x = Four::load(&self.forces[0][r][first..]).mul_add(Four::splat(one[r * LANES]), x);
                x = Four::load(&self.forces[1][r][first..]).mul_add(Four::splat(other[r * LANES]), x);
            }
            x.store(&mut error[first..]);
        }
        error
    }
}

impl All {
    /// Writes zeros after the last row of each array, as padding of the last vector.
    #[inline(always)]
    pub(crate) fn end<V: Block<Number = f64>, const N: usize>(&mut self, rows: usize) {
        let zeros = [V::zero(); N];
        for r in 0..6 {
            write(zeros, &mut self.whole[r * self.stride + rows..]);
            write(zeros, &mut self.rest[r * self.stride + rows..]);
        }
        write(zeros, &mut self.x[rows..]);
    }

    /// Propagates the forces on the root body through the root's joint to the world.
    #[inline(always)]
    pub(crate) fn carry_on<V: Block<Number = f64>, const N: usize>(
        &mut self,
        plans: &[ConstraintPlan],
        left: Left<'_>,
        J: &mut [FusedF64],
    ) {
        let stride = self.stride;
        let (step, lane) = left.plan.place(self.root);
        for first in (0..stride - WIDE).step_by(WIDE) {
            let whole = read_forces::<V, N>(&self.whole[first..], stride);
            let mut f = read_forces::<V, N>(&self.rest[first..], stride);
            let mut x = read::<V, N>(&self.x[first..]);
            for k in (0..self.nv).rev() {
                let (slot, at) = (left.plan.steps[step].idx_v + k, k * stride + first);
                write(dot(&whole, six(left.S, (slot, lane))), &mut self.J[at..]);
                let [y, yd] = take(left, (slot, lane), &mut f, &mut x);
                write(y, &mut self.Y[at..]);
                write(yd, &mut self.YD[at..]);
            }
            add_bias(&f, six(left.c, (step, lane)), &mut x);
            add_world(&f, left.world, &mut x);
            write(x, &mut self.x[first..]);
        }
        for plan in plans {
            for r in 0..plan.rows() {
                for k in 0..self.nv {
                    J[plan.start + r * plan.places.len() + k] = FusedF64(self.J[k * stride + plan.row + r]);
                }
            }
        }
    }

    /// Sets the Delassus matrix J M⁻¹ Jᵀ to the sum of Y D⁻¹ Yᵀ over the columns of the root's joint. `rows` must be a
    /// multiple of three.
    #[inline(always)]
    pub(crate) fn multiply<V: Block<Number = f64>, const N: usize>(&self, rows: usize, G: &mut [f64], stride: usize) {
        for first in (0..self.stride - WIDE).step_by(WIDE) {
            for j in (0..rows.min(first + WIDE)).step_by(3) {
                let mut sums = [[V::zero(); N]; 3];
                for k in 0..self.nv {
                    let y = read::<V, N>(&self.Y[k * self.stride + first..]);
                    let yd = &self.YD[k * self.stride + j..][..3];
                    for e in 0..3 {
                        for n in 0..N {
                            sums[e][n] = y[n].mul_add(V::splat(yd[e]), sums[e][n]); // Σ Y D⁻¹ Yᵀ
                        }
                    }
                }
                for e in 0..3 {
                    write(sums[e], &mut G[(j + e) * stride + first..]);
                }
            }
        }
    }
}
