//! Calls with the limbs of a robot side by side.
#![allow(unsafe_code)]

use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::lanes::limbs::lanes::{Limbs, numbers};
use crate::lanes::limbs::pass::{Arguments, Scratch, load, scatter};
use crate::lanes::limbs::{LANES, Plan};
use crate::passes::kinematics::{Placed, World, place};
use crate::passes::{aba, crba, rnea};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_spatial::block::Block;
use condyle_spatial::gate::{Fused, Kernel, Level, Long, Short, is, level, renamed};
use condyle_spatial::{Constant, Force, Mat3, Motion, Scalar, Se3, Vec3};
use core::marker::PhantomData;

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Task {
    Rnea,
    Aba,
    Crba,
    Minv,
    RneaDerivatives,
    AbaDerivatives,
}

/// A call of an algorithm.
struct Call<'a, V> {
    task: Task,
    model: &'a Model,
    plan: &'a Plan,
    data: &'a mut Data<f64>,
    arguments: Arguments<'a>,
    /// The largest vector that there is.
    vector: PhantomData<V>,
}

impl<V: Block<Number = f64>> Kernel for Call<'_, V> {
    #[inline(always)]
    fn run(self) {
        let Self { task, model, plan, data, arguments, .. } = self;
        let Some(scratch) = &mut data.limbs else { return };
        load(plan, scratch, arguments);
        let Scratch { q, v, x, f_ext, world, rnea, aba, IC, bodies, inverted, .. } = &mut **scratch;
        let f_ext = if arguments.f_ext.is_empty() { &[] } else { &f_ext[..] };
        let l = Limbs::new(plan, model);
        if let Task::Rnea = task {
            data.world.placed = Placed::Nowhere;
            rnea::pass(&l, &mut world.sin_cos, rnea, q, v, x, f_ext);
            let tau = Fused::of_mut(&mut data.rnea.tau);
            scatter(plan, &rnea.tau, tau);
            Single::<Fused, f64>::new(model).add_armature_torque(arguments.x, tau);
            return;
        }
        place(&l, world, q);
        data.world.placed = Placed::Limbs;
        l.broadcast(&mut world.S);
        if let Task::Crba = task {
            crba::pass(&l, world, IC, Fused::of_mut(data.crba.M.as_mut_slice()));
        }
        if let Task::Minv = task {
            aba::factorize(&l, world, aba);
        }
        if let Task::Aba | Task::AbaDerivatives = task {
            aba::pass(&l, world, aba, v, x, f_ext);
            scatter(plan, &aba.qdd, Fused::of_mut(&mut data.aba.qdd));
        }
        if let Task::Minv | Task::AbaDerivatives = task {
            l.broadcast(&mut aba.D_inv);
            let Minv = Fused::of_mut(data.minv.Minv.as_mut_slice());
            inverted.inverse::<V>(&l, world, aba, &plan.columns.blocks, Minv);
        }
        if let Task::RneaDerivatives | Task::AbaDerivatives = task {
            let matrices = data.rnea_derivatives.parts().1.map(Fused::of_mut);
            let a = if let Task::AbaDerivatives = task { &aba.qdd } else { x };
            rnea_derivatives::pass(&l, world, (bodies, matrices), v, a, f_ext, l.minus_gravity(), false);
        }
    }
}

/// The plan, where this model and `data` have limbs side by side, and the processor can.
#[inline]
pub(crate) fn ready<'m, S: Scalar, R: Constant<S>>(model: &'m Model<R>, data: &Data<S>) -> Option<&'m Plan> {
    let (Some(plan), Some(scratch)) = (&model.limbs(), &data.limbs) else { return None };
    (is::<(S, R), (f64, f64)>() && scratch.fits(plan) && level() > Level::Baseline).then_some(plan)
}

/// An algorithm with the limbs side by side, where this model and `data` have them; whether they have. Arguments that it
/// does not take are empty.
#[inline]
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    task: Task,
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    x: &[S],
    f_ext: &[Force<S>],
) -> bool {
    let Some(plan) = ready(model, data) else { return false };
    if model.has_mimic() && !matches!(task, Task::Rnea) {
        return false; // joints that share a coordinate
    }
    // SAFETY: S and R are f64.
    unsafe { enter(task, renamed(model), plan, renamed(data), Arguments::new(q, v, x, f_ext)) }
    true
}

/// A task, compiled for the level.
fn enter(task: Task, model: &Model, plan: &Plan, data: &mut Data<f64>, arguments: Arguments<'_>) {
    if level() >= Level::Avx512 {
        Long::enter(Call::<Long> { task, model, plan, data, arguments, vector: PhantomData }); // and twice the registers
    } else {
        Short::enter(Call::<Short> { task, model, plan, data, arguments, vector: PhantomData });
    }
}

/// Takes the placements that a call left in lanes to where those of single bodies stand.
pub(crate) fn spread<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let Some(plan) = ready(model, data) else { return };
    let Data { limbs: Some(scratch), world: World { oX, S: columns, placed, .. }, .. } = data else { return };
    // SAFETY: poses and motions are made of vectors.
    let (poses, motions) = unsafe { (numbers(&scratch.world.oX), numbers(&scratch.world.S)) };
    for i in 1..oX.len() {
        let ((step, lane), column) = (plan.place(i), model.nodes()[i].column);
        let pose = |k: usize| S::splat(poses[(12 * step + k) * LANES + lane]);
        let axis = |k: usize| Vec3::new(pose(k), pose(k + 1), pose(k + 2));
        oX[i] = Se3::new(Mat3 { x: axis(0), y: axis(3), z: axis(6) }, axis(9));
        for k in 0..model.nodes()[i].joint.nv() {
            let slot = plan.steps[step].idx_v + k;
            let number = |r: usize| S::splat(motions[(6 * slot + r) * LANES + lane]);
            columns[column + k] = Motion::from([0, 1, 2, 3, 4, 5].map(number));
        }
    }
    *placed = Placed::Bodies;
}
