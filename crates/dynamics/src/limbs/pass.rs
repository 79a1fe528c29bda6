//! A pass over steps of four bodies.
#![allow(unsafe_code)]

use super::lanes::{Four, Limbs, numbers};
use super::{LANES, Plan, inverse};
use crate::data::Data;
use crate::kinematics::{Placed, World, place};
use crate::workspace::{Size, filled};
use crate::{aba, crba, rnea, rnea_derivatives};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_model::limbs::steps::Source;
use condyle_spatial::block::{Block, lanes};
use condyle_spatial::gate::{Long, Short, is, renamed};
use condyle_spatial::lanes::{Fused, Kernel};
use condyle_spatial::level::{Level, level};
use condyle_spatial::{Constant, Force, Inertia, Mat3, Motion, Scalar, Se3, Vec3};
use core::marker::PhantomData;

/// What passes in lanes write.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// The arguments. Shape: positions, coordinates, coordinates, steps of the plan. Written by: `load`.
    pub q: Vec<Four>,
    pub v: Vec<Four>,
    pub x: Vec<Four>,
    pub f_ext: Vec<Force<Four>>,
    /// An argument, with a 0 for the lanes that have no joint. Shape: the larger of nq and nv, + 1.
    /// Written by: `gather`.
    padded: Vec<Fused>,
    pub world: World<Four>,
    rnea: rnea::Workspace<Four>,
    pub aba: aba::Workspace<Four>,
    /// Composite inertias. Shape: steps. Written by: `crba::pass`.
    IC: Vec<Inertia<Four>>,
    pub bodies: rnea_derivatives::Bodies<Four>,
    inverted: inverse::Scratch,
}

impl Scratch {
    /// For a model with limbs, on a processor that can.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>) -> Option<Box<Self>> {
        let plan = model.limbs().filter(|_| is::<S, f64>() && level() > Level::Baseline)?;
        let (steps, nv) = (plan.steps.len(), plan.state.coordinates.len());
        let size = Size { bodies: steps, columns: nv + plan.columns.copies.len(), depth: 0, levels: steps, nv };
        let zeros = filled(Four::zero(), nv);
        Some(Box::new(Self {
            q: filled(Four::zero(), plan.state.positions.len()),
            v: zeros.clone(),
            x: zeros,
            f_ext: filled(Force::zero(), steps),
            padded: vec![Fused(0.0); model.nq().max(model.nv()) + 1],
            world: World::new(size),
            rnea: rnea::Workspace::new(size),
            aba: aba::Workspace::new(size),
            IC: filled(Inertia::zero(), steps),
            bodies: rnea_derivatives::Bodies::new(size),
            inverted: inverse::Scratch::new(model.nv(), plan),
        }))
    }

    /// Whether it was made for this plan, or one of the same shape.
    fn fits(&self, plan: &Plan) -> bool {
        (self.q.len(), self.v.len(), self.f_ext.len(), self.world.S.len())
            == (
                plan.state.positions.len(),
                plan.state.coordinates.len(),
                plan.steps.len(),
                self.v.len() + plan.columns.copies.len(),
            )
            && self.inverted.fits(plan)
    }
}

/// What a call is given.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a> {
    pub q: &'a [Fused],
    pub v: &'a [Fused],
    /// An acceleration or an effort.
    pub x: &'a [Fused],
    pub f_ext: &'a [Force<Fused>],
}

impl<'a> Arguments<'a> {
    /// The arguments of a call.
    ///
    /// # Safety
    /// `S` is `f64`.
    pub(super) unsafe fn new<S>(q: &'a [S], v: &'a [S], x: &'a [S], f_ext: &'a [Force<S>]) -> Self {
        // SAFETY: `Fused` is a transparent wrapper, and a force is `repr(C)`.
        unsafe { Self { q: renamed(q), v: renamed(v), x: renamed(x), f_ext: renamed(f_ext) } }
    }
}

/// Brings the arguments into lanes.
#[inline(always)]
pub(super) fn load(plan: &Plan, to: &mut Scratch, from: Arguments<'_>) {
    gather(&plan.state.positions, &mut to.padded, from.q, &mut to.q);
    if !from.v.is_empty() {
        gather(&plan.state.coordinates, &mut to.padded, from.v, &mut to.v);
        gather(&plan.state.coordinates, &mut to.padded, from.x, &mut to.x);
    }
    if from.f_ext.is_empty() {
        return;
    }
    for (s, step) in plan.steps.iter().enumerate() {
        let mut numbers = [[0.0; LANES]; 6];
        for lane in 0..if plan.in_all_lanes(s) { 1 } else { LANES } {
            if step.bodies[lane] > 0 {
                let f = from.f_ext[step.bodies[lane]].to_array();
                for r in 0..6 {
                    numbers[r][lane] = f[r].0;
                }
            }
        }
        let mut six = [Four::zero(); 6];
        for r in 0..6 {
            six[r] = Four::from_array(numbers[r]);
        }
        to.f_ext[s] = six.into();
    }
}

/// A vector of the robot's, lane by lane.
#[inline(always)]
fn gather(sources: &[Source], padded: &mut [Fused], x: &[Fused], to: &mut [Four]) {
    padded[..x.len()].copy_from_slice(x);
    padded[x.len()] = Fused(0.0);
    for (Source { from: [i, j, k, l], ratio, offset }, to) in sources.iter().zip(to) {
        let x = Four::from_array([padded[*i].0, padded[*j].0, padded[*k].0, padded[*l].0]);
        *to = x.mul_add(Four::from_array(*ratio), Four::from_array(*offset));
    }
}

/// Takes a vector in coordinates out of the lanes: the transpose of `gather`.
#[inline(always)]
pub(super) fn scatter(plan: &Plan, from: &[Four], to: &mut [Fused]) {
    let numbers = lanes(from);
    for (to, &at) in to.iter_mut().zip(&plan.state.leaders) {
        *to = Fused(numbers[at]);
    }
    for &(k, at, ratio) in &plan.state.followers {
        to[k] += Fused(numbers[at] * ratio);
    }
}

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
pub(super) fn ready<'m, S: Scalar, R: Constant<S>>(model: &'m Model<R>, data: &Data<S>) -> Option<&'m Plan> {
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
