//! Dynamics under constraints of a robot with limbs, without M.
//!
//! Source: Wensing, Featherstone, Orin, *A reduced-order recursive algorithm for the computation of the operational-space
//! inertia matrix* (2012), on Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1. With U = Iᴬ S and D of the
//! articulated bodies, a force f on a body is felt at column d of its joint as Y_d = S_dᵀ f, and beyond it remains
//! f − U_d D_d⁻¹ Y_d. Taken to the root so, the unit forces of the rows of J give
//!
//! ```text
//! J M⁻¹ Jᵀ = Σ Y_d D_d⁻¹ Y_dᵀ,           J q̈ + γ = Σ Y_d D_d⁻¹ u_d + Σ f_iᵀ c_i + f₀ᵀ a₀ + γ'       for λ = 0,
//! ```
//!
//! u and c being those of the articulated-body algorithm, f_i what remains beyond body i, a₀ the world's acceleration, and γ'
//! what in γ is not the acceleration of a body. That algorithm's last pass then gives q̈ = M⁻¹ (τ − h + Jᵀ λ) with
//! u + Yᵀ λ in place of u. It has limbs in its lanes; the forces have rows: those of one constraint as far as the root, from
//! there on all of them.
#![allow(unsafe_code)]

use super::forces::{Left, six};
use super::held::{All, Held, WIDE};
use super::lanes::{Four, Limbs, numbers, numbers_mut};
use super::pass::{Arguments, load, ready, scatter};
use super::{LANES, Plan, Scratch};
use crate::aba;
use crate::constrained_dynamics::Inputs;
use crate::constraint::ConstraintKind;
use crate::constraint_motion::Ends;
use crate::constraint_set::{ConstraintSet, Plan as Constraint};
use crate::data::Data;
use crate::kinematics::{Placed, place};
use condyle_model::Model;
use condyle_spatial::block::Block;
use condyle_spatial::gate::{Long, Short, renamed};
use condyle_spatial::lanes::{Fused, Kernel};
use condyle_spatial::level::{Level, level};
use condyle_spatial::{Constant, Scalar, moves};
use core::marker::PhantomData;

/// xᵀ y of N vectors, in every lane.
#[inline(always)]
fn product<const N: usize>(x: &[f64], y: &[f64]) -> Four {
    let mut sum = Four::load(x) * Four::load(y);
    for n in 1..N {
        sum = Four::load(&x[n * LANES..]).mul_add(Four::load(&y[n * LANES..]), sum);
    }
    moves::sum(sum)
}

impl Held {
    /// J, J M⁻¹ Jᵀ, and J q̈ + γ for λ = 0.
    #[inline(always)]
    fn carry<V: Block<Number = f64>, const N: usize>(&mut self, left: Left<'_>, set: &mut ConstraintSet<Fused>) {
        let Self { rows, Y, YD, all } = self;
        all.end::<V, N>(set.lambda.len());
        for (k, of) in rows.iter_mut().enumerate() {
            let (plan, target) = (&set.plans[k], &set.targets[k]);
            let [one, other] = plan.bodies;
            let mut ends = Ends::between(plan, target, [left.pose(one), left.pose(other)]);
            ends.v = [left.velocity(one), left.velocity(other)];
            of.begin(plan, &ends, ends.acceleration(plan, target).to_array());
            match plan.kind {
                ConstraintKind::Point => of.carry::<Four, 1>(plan, left, [Y, YD], all, &mut set.J),
                ConstraintKind::Rigid => of.carry::<V, N>(plan, left, [Y, YD], all, &mut set.J),
            }
        }
        all.carry_on::<V, N>(&set.plans, left, &mut set.J);
        // SAFETY: `Fused` is a transparent wrapper of `f64`.
        let (G, stride): (&mut [f64], _) = (unsafe { renamed(&mut set.delassus.CE[..]) }, set.delassus.stride);
        all.multiply::<V, N>(set.lambda.len(), G, stride);
        for (of, plan) in rows.iter().zip(&set.plans) {
            for (j, runs) in &of.beside {
                let other = &set.plans[*j];
                for r in (0..other.rows()).step_by(3) {
                    let (columns, G) = ((&rows[*j], r), &mut G[(other.row + r) * stride + plan.row..]);
                    match plan.kind {
                        ConstraintKind::Point => of.multiply::<Four, 1>(columns, runs, [Y, YD], G, stride),
                        ConstraintKind::Rigid => of.multiply::<V, N>(columns, runs, [Y, YD], G, stride),
                    }
                }
            }
        }
    }

    /// u + Yᵀ λ in place of u.
    #[inline(always)]
    fn push(&self, plan: &Plan, constraints: &[Constraint], u: &mut [f64]) {
        let All { root, nv, stride, Y, x: lambda, .. } = &self.all;
        for (of, constraint) in self.rows.iter().zip(constraints) {
            let lambda = &lambda[constraint.row..];
            for link in of.ways.iter().flatten() {
                let (step, lane) = plan.place(link.body);
                for k in 0..link.nv {
                    let Y = &self.Y[of.start + (link.at + k) * of.wide..];
                    let sum = if of.wide == LANES { product::<1>(Y, lambda) } else { product::<2>(Y, lambda) };
                    u[(plan.steps[step].idx_v + k) * LANES + lane] += sum.to_array()[0];
                }
            }
        }
        for k in 0..*nv {
            let u = &mut u[(plan.steps[plan.place(*root).0].idx_v + k) * LANES..]; // in all lanes
            let mut sum = Four::load(u);
            for first in (0..stride - WIDE).step_by(WIDE) {
                sum += product::<2>(&Y[k * stride + first..], &lambda[first..]);
            }
            sum.store(u);
        }
    }
}

/// A call of the algorithm.
struct Call<'a, V> {
    model: &'a Model,
    plan: &'a Plan,
    data: &'a mut Data<f64>,
    set: &'a mut ConstraintSet<Fused>,
    arguments: Arguments<'a>,
    /// The largest vector that there is.
    vector: PhantomData<V>,
}

impl<V: Block<Number = f64>> Call<'_, V> {
    /// With `WIDE` rows in N vectors.
    #[inline(always)]
    fn by<const N: usize>(self) {
        let Self { model, plan, data, set, arguments, .. } = self;
        let (Some(scratch), Some(mut held)) = (&mut data.limbs, set.limbs.take()) else { return };
        load(plan, scratch, arguments);
        let Scratch { q, v, x, f_ext, world, aba, .. } = &mut **scratch;
        let f_ext = if arguments.f_ext.is_empty() { &[] } else { &f_ext[..] };
        let l = Limbs::new(plan, model);
        place(&l, world, q);
        data.world.placed = Placed::Limbs;
        aba::inward(&l, world, aba, v, x, f_ext);
        held.carry::<V, N>(Left::new(plan, model, world, aba), set);
        for r in 0..set.lambda.len() {
            set.lambda[r] = Fused(-held.all.x[r]);
        }
        set.delassus.decompose(set.proximal, &mut set.lambda);
        for r in 0..set.lambda.len() {
            held.all.x[r] = set.lambda[r].0;
        }
        // SAFETY: these are vectors.
        held.push(plan, &set.plans, unsafe { numbers_mut(&mut aba.u) });
        aba::outward(&l, world, aba);
        scatter(plan, &aba.qdd, Fused::of_mut(&mut data.constrained_dynamics.qdd));
        // SAFETY: motions are made of vectors.
        let a = unsafe { numbers(&aba.a) };
        for (of, constraint) in held.rows.iter().zip(&set.plans) {
            let [one, other] = constraint.bodies;
            let error = of.error([six(a, plan.place(one)), six(a, plan.place(other))]);
            for r in 0..constraint.rows() {
                set.error[constraint.row + r] = Fused(error[r]);
            }
        }
        set.limbs = Some(held);
    }
}

impl<V: Block<Number = f64>> Kernel for Call<'_, V> {
    #[inline(always)]
    fn run(self) {
        if V::LANES == WIDE { self.by::<1>() } else { self.by::<2>() }
    }
}

/// Constrained dynamics with the limbs side by side, where this model, `data` and `constraints` have them; whether they
/// have.
#[inline]
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    Inputs { q, v, tau, f_ext }: Inputs<'_, S>,
) -> bool {
    let Some(plan) = ready(model, data).filter(|_| constraints.limbs.is_some()) else { return false };
    // SAFETY: S and R are f64, and `Fused` is the same.
    unsafe { enter(renamed(model), plan, renamed(data), renamed(constraints), Arguments::new(q, v, tau, f_ext)) }
    true
}

/// The call, compiled for the level.
fn enter(model: &Model, plan: &Plan, data: &mut Data<f64>, set: &mut ConstraintSet<Fused>, arguments: Arguments<'_>) {
    if level() >= Level::Avx512 {
        Long::enter(Call::<Long> { model, plan, data, set, arguments, vector: PhantomData }); // and twice the registers
    } else {
        Short::enter(Call::<Short> { model, plan, data, set, arguments, vector: PhantomData });
    }
}
