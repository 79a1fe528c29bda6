//! Dynamics under constraints with the limbs of a robot side by side.
#![allow(unsafe_code)]

use super::limbs::ready;
use crate::constraints::constrained_dynamics::Inputs;
use crate::constraints::constraint_lanes::WIDE;
use crate::constraints::constraint_set::ConstraintSet;
use crate::data::Data;
use crate::lanes::limbs::Plan;
use crate::lanes::limbs::forces::{Left, six};
use crate::lanes::limbs::lanes::{Limbs, numbers, numbers_mut};
use crate::lanes::limbs::pass::{Arguments, Scratch, load, scatter};
use crate::passes::aba;
use crate::passes::kinematics::{Placed, place};
use condyle_model::Model;
use condyle_spatial::block::Block;
use condyle_spatial::gate::{Fused, Kernel, Level, Long, Short, level, renamed};
use condyle_spatial::{Constant, Scalar};
use core::marker::PhantomData;

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
