//! A pass over steps of four bodies.
#![allow(unsafe_code)]

use super::lanes::{Four, Limbs, numbers};
use super::{LANES, Plan, inverse};
use crate::data::{Data, Size};
use crate::dispatch::{fused, is_f64, same, slice};
use crate::kinematics::{Placed, World, place};
use crate::{aba, crba, rnea, rnea_derivatives};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_model::limbs::schedule::Source;
use condyle_spatial::block::{Block, Real, lanes};
use condyle_spatial::lanes::{Fused, Kernel};
use condyle_spatial::level::{Level, level};
use condyle_spatial::{Constant, Force, Inertia, Mat3, Motion, Scalar, Se3, Vec3};
use core::any::TypeId;
use core::marker::PhantomData;

pub(super) type Eight = <f64 as Real>::Long;

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
        let plan = model.limbs().filter(|_| TypeId::of::<S>() == TypeId::of::<f64>() && level() > Level::Baseline)?;
        let (steps, nv) = (plan.steps.len(), plan.coordinates.len());
        let size = Size { bodies: steps, columns: nv + plan.copies.len(), depth: 0, levels: steps, nv };
        let zeros = vec![Four::zero(); nv];
        Some(Box::new(Self {
            q: vec![Four::zero(); plan.positions.len()],
            v: zeros.clone(),
            x: zeros,
            f_ext: vec![Force::zero(); steps],
            padded: vec![Fused(0.0); model.nq().max(model.nv()) + 1],
            world: World::new(size),
            rnea: rnea::Workspace::new(size),
            aba: aba::Workspace::new(size),
            IC: vec![Inertia::zero(); steps],
            bodies: rnea_derivatives::Bodies::new(size),
            inverted: inverse::Scratch::new(model.nv(), plan),
        }))
    }

    /// Whether it was made for this plan, or one of the same shape.
    fn fits(&self, plan: &Plan) -> bool {
        (self.q.len(), self.v.len(), self.f_ext.len(), self.world.S.len())
            == (plan.positions.len(), plan.coordinates.len(), plan.steps.len(), self.v.len() + plan.copies.len())
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

/// Brings the arguments into lanes.
#[inline(always)]
pub(super) fn load(plan: &Plan, to: &mut Scratch, from: Arguments<'_>) {
    gather(&plan.positions, &mut to.padded, from.q, &mut to.q);
    if !from.v.is_empty() {
        gather(&plan.coordinates, &mut to.padded, from.v, &mut to.v);
        gather(&plan.coordinates, &mut to.padded, from.x, &mut to.x);
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
    for (to, &at) in to.iter_mut().zip(&plan.leaders) {
        *to = Fused(numbers[at]);
    }
    for &(k, at, ratio) in &plan.followers {
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
    data: &'a mut Data<Fused>,
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
            scatter(plan, &rnea.tau, &mut data.rnea.tau);
            Single::<Fused, f64>::new(model).add_armature_torque(arguments.x, &mut data.rnea.tau);
            return;
        }
        place(&l, world, q);
        data.world.placed = Placed::Limbs;
        l.broadcast(&mut world.S);
        if let Task::Crba = task {
            crba::pass(&l, world, IC, data.crba.M.as_mut_slice());
        }
        if let Task::Minv = task {
            aba::factorize(&l, world, aba);
        }
        if let Task::Aba | Task::AbaDerivatives = task {
            aba::pass(&l, world, aba, v, x, f_ext);
            scatter(plan, &aba.qdd, &mut data.aba.qdd);
        }
        if let Task::Minv | Task::AbaDerivatives = task {
            l.broadcast(&mut aba.D_inv);
            inverted.inverse::<V>(&l, world, aba, &plan.blocks, data.minv.Minv.as_mut_slice());
        }
        if let Task::RneaDerivatives | Task::AbaDerivatives = task {
            let (_, matrices) = data.rnea_derivatives.parts();
            let a = if let Task::AbaDerivatives = task { &aba.qdd } else { x };
            rnea_derivatives::pass(&l, world, (bodies, matrices), v, a, f_ext, l.minus_gravity(), false);
        }
    }
    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}

/// The plan, where this model and `data` have limbs side by side, and the processor can.
#[inline]
pub(super) fn ready<'m, S: Scalar, R: Constant<S>>(model: &'m Model<R>, data: &Data<S>) -> Option<&'m Plan> {
    let (Some(plan), Some(scratch)) = (model.limbs(), &data.limbs) else { return None };
    (is_f64::<S, R>() && scratch.fits(plan) && level() > Level::Baseline).then_some(plan)
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
    // SAFETY: S and R are f64, and the processor has the level.
    unsafe {
        let arguments = Arguments { q: slice(q), v: slice(v), x: slice(x), f_ext: slice(f_ext) };
        let (model, data) = (same(model), fused(data));
        if level() >= Level::Avx512 {
            Eight::enter(Call::<Eight> { task, model, plan, data, arguments, vector: PhantomData }); // and twice the registers
        } else {
            Four::enter(Call::<Four> { task, model, plan, data, arguments, vector: PhantomData });
        }
    }
    true
}

/// Takes the placements that a call left in lanes to where those of single bodies stand.
pub(crate) fn spread<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let Some(plan) = ready(model, data) else { return };
    // SAFETY: S is f64.
    let Data { limbs: Some(scratch), world: World { oX, S, placed, .. }, .. } = (unsafe { fused(data) }) else {
        return;
    };
    // SAFETY: poses and motions are made of vectors.
    let (poses, motions) = unsafe { (numbers(&scratch.world.oX), numbers(&scratch.world.S)) };
    for i in 1..oX.len() {
        let ((step, lane), column) = (plan.place[i], model.nodes()[i].column);
        let pose = |k: usize| Fused(poses[(12 * step + k) * LANES + lane]);
        let axis = |k: usize| Vec3::new(pose(k), pose(k + 1), pose(k + 2));
        oX[i] = Se3::new(Mat3 { x: axis(0), y: axis(3), z: axis(6) }, axis(9));
        for k in 0..model.nodes()[i].joint.nv() {
            let slot = plan.steps[step].idx_v + k;
            let number = |r: usize| Fused(motions[(6 * slot + r) * LANES + lane]);
            S[column + k] = Motion::from([0, 1, 2, 3, 4, 5].map(number));
        }
    }
    *placed = Placed::Bodies;
}
