//! A pass over steps of four bodies.
#![allow(unsafe_code)]

use super::steps::{Parents, Source};
use super::{LANES, Plan};
use crate::aba;
use crate::data::{Data, Size};
use crate::dispatch::{fused, is_f64, same, slice};
use crate::joint::Joint;
use crate::kinematics::{World, place};
use crate::layout::{Layout, Single};
use crate::model::Model;
use crate::rnea;
use condyle_spatial::block::lanes;
use condyle_spatial::lanes::{Fused, Kernel, Lanes, short};
use condyle_spatial::level::{Level, level};
use condyle_spatial::moves::{Move, sum};
use condyle_spatial::{Act, Constant, Force, Inertia, Scalar, Se3, Vec3};
use core::any::TypeId;
use core::ops::{AddAssign, Range};

type Four = Lanes<f64, LANES>;

/// What passes in lanes write.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// The arguments. Shape: positions, coordinates, coordinates, steps of the plan. Written by: `load`.
    q: Vec<Four>,
    v: Vec<Four>,
    x: Vec<Four>,
    f_ext: Vec<Force<Four>>,
    /// An argument, with a 0 for the lanes that have no joint. Shape: the larger of nq and nv, + 1.
    /// Written by: `gather`.
    padded: Vec<Fused>,
    world: World<Four>,
    rnea: rnea::Workspace<Four>,
    aba: aba::Workspace<Four>,
}

impl Scratch {
    /// For a model with limbs, on a processor that can.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>) -> Option<Box<Self>> {
        let plan =
            model.limbs.as_ref().filter(|_| TypeId::of::<S>() == TypeId::of::<f64>() && level() > Level::Baseline)?;
        let (steps, nv) = (plan.steps.len(), plan.coordinates.len());
        let size = Size { bodies: steps, columns: nv, depth: 0, levels: steps, nv };
        let zeros = vec![Four::zero(); nv];
        Some(Box::new(Self {
            q: vec![Four::zero(); plan.positions.len()],
            v: zeros.clone(),
            x: zeros,
            f_ext: vec![Force::zero(); steps],
            padded: vec![Fused(0.0); model.nq.max(model.nv) + 1],
            world: World::new(size),
            rnea: rnea::Workspace::new(size),
            aba: aba::Workspace::new(size),
        }))
    }

    /// Whether it was made for this plan, or one of the same shape.
    fn fits(&self, plan: &Plan) -> bool {
        (self.q.len(), self.v.len(), self.f_ext.len())
            == (plan.positions.len(), plan.coordinates.len(), plan.steps.len())
    }
}

/// Steps in place of bodies, lanes in place of numbers.
struct Limbs<'a> {
    plan: &'a Plan,
    armature: &'a [f64],
    gravity: Vec3<f64>,
}

/// The vectors that something is made of.
///
/// # Safety
/// `T` is made of nothing else: a struct of spatial algebra or of kinematics, all `repr(C)`.
#[inline(always)]
unsafe fn vectors<T>(x: &mut T) -> &mut [Four] {
    const { assert!(size_of::<T>().is_multiple_of(size_of::<Four>()) && align_of::<T>() == align_of::<Four>()) };
    // SAFETY: by the caller.
    unsafe { core::slice::from_raw_parts_mut(core::ptr::from_mut(x).cast(), size_of::<T>() / size_of::<Four>()) }
}

#[inline(always)]
fn moved<T: Copy>(mut x: T, by: &Move) -> T {
    // SAFETY: passes keep structs of vectors.
    let numbers = unsafe { vectors(&mut x) };
    for k in 0..numbers.len() {
        numbers[k] = by.apply(numbers[k]);
    }
    x
}

impl Layout for Limbs<'_> {
    type S = Four;

    #[inline(always)]
    fn bodies(&self) -> Range<usize> {
        1..self.plan.steps.len()
    }
    #[inline(always)]
    fn joint(&self, i: usize) -> Joint {
        self.plan.steps[i].joint
    }
    #[inline(always)]
    fn placement(&self, i: usize) -> Se3<Four> {
        self.plan.steps[i].placement.lift()
    }
    #[inline(always)]
    fn inertia(&self, i: usize) -> Inertia<Four> {
        self.plan.steps[i].inertia.lift()
    }
    #[inline(always)]
    fn minus_gravity(&self) -> Vec3<Four> {
        -self.gravity.lift()
    }
    #[inline(always)]
    fn armature(&self, i: usize, k: usize) -> Four {
        let mut armature = [1.0; LANES]; // of a lane without a joint: nothing is divided by 0
        let from = self.plan.coordinates[self.plan.steps[i].idx_v + k].from;
        for lane in 0..LANES {
            if from[lane] < self.armature.len() {
                armature[lane] = self.armature[from[lane]];
            }
        }
        Four::from_array(armature)
    }
    #[inline(always)]
    fn force(&self, f_ext: &[Force<Four>], i: usize) -> Option<Force<Four>> {
        let &f = f_ext.get(i)?; // not by `map`, which would not be inlined
        Some(Se3::new(self.plan.steps[i].reframing.lift(), Vec3::zero()).act_inv(f))
    }

    #[inline(always)]
    fn parent<T: Copy>(&self, of: &[T], i: usize) -> T {
        match &self.plan.steps[i].parents {
            Parents::Below(step) => of[*step],
            Parents::Apart { from, .. } => {
                let mut x = moved(of[from[0].0], &from[0].1);
                for (step, by) in &from[1..] {
                    let mut y = moved(of[*step], by);
                    // SAFETY: passes keep structs of vectors.
                    let (x, y) = unsafe { (vectors(&mut x), vectors(&mut y)) };
                    for k in 0..x.len() {
                        x[k] += y[k];
                    }
                }
                x
            }
        }
    }
    #[inline(always)]
    fn push<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        match &self.plan.steps[i].parents {
            Parents::Below(step) => onto[*step] += x,
            Parents::Apart { to, .. } => {
                for (step, by) in to {
                    onto[*step] += moved(x, by);
                }
            }
        }
    }
    #[inline(always)]
    fn level(&self, i: usize) -> usize {
        i
    }
    /// All of them, when the pass has gone down to the last.
    #[inline(always)]
    fn finished(&self, i: usize) -> &[usize] {
        if i + 1 == self.plan.steps.len() { &self.plan.finished } else { &[] }
    }
    #[inline(always)]
    fn above<T: Copy>(&self, of: &[T], i: usize) -> T {
        self.parent(of, i)
    }
    #[inline(always)]
    fn lift<T: Copy + AddAssign>(&self, onto: &mut [T], i: usize, x: T) {
        self.push(onto, i, x);
    }
    #[inline(always)]
    fn whole<T: Copy>(&self, i: usize, mut x: T) -> T {
        let [first, others @ ..] = &self.plan.steps[i].bodies;
        if others.iter().all(|other| other == first) {
            // SAFETY: passes keep structs of vectors.
            let numbers = unsafe { vectors(&mut x) };
            for k in 0..numbers.len() {
                numbers[k] = sum(numbers[k]);
            }
        }
        x
    }

    #[inline(always)]
    fn position(&self, q: &[Four], i: usize, k: usize) -> Four {
        q[self.plan.steps[i].idx_q + k]
    }
    #[inline(always)]
    fn load(&self, x: &[Four], i: usize, k: usize) -> Four {
        x[self.plan.steps[i].idx_v + k]
    }
    #[inline(always)]
    fn add(&self, x: &mut [Four], i: usize, k: usize, value: Four) {
        x[self.plan.steps[i].idx_v + k] += value;
    }
    #[inline(always)]
    fn slot(&self, i: usize) -> usize {
        self.plan.steps[i].idx_v
    }
    /// That is done where the lanes' efforts are put together.
    #[inline(always)]
    fn add_armature_torque(&self, _: &[Four], _: &mut [Four]) {}
}

/// What a call is given.
#[derive(Clone, Copy)]
struct Arguments<'a> {
    q: &'a [Fused],
    v: &'a [Fused],
    /// An acceleration or an effort.
    x: &'a [Fused],
    f_ext: &'a [Force<Fused>],
}

/// Brings the arguments into lanes.
#[inline(always)]
fn load(plan: &Plan, to: &mut Scratch, from: Arguments<'_>) {
    gather(&plan.positions, &mut to.padded, from.q, &mut to.q);
    gather(&plan.coordinates, &mut to.padded, from.v, &mut to.v);
    gather(&plan.coordinates, &mut to.padded, from.x, &mut to.x);
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
fn scatter(plan: &Plan, from: &[Four], to: &mut [Fused]) {
    let numbers = lanes(from);
    for (to, &at) in to.iter_mut().zip(&plan.leaders) {
        *to = Fused(numbers[at]);
    }
    for &(k, at, ratio) in &plan.followers {
        to[k] += Fused(numbers[at] * ratio);
    }
}

/// A call of `aba` or of `rnea`.
struct Call<'a> {
    forward: bool,
    model: &'a Model,
    plan: &'a Plan,
    data: &'a mut Data<Fused>,
    arguments: Arguments<'a>,
}

impl Kernel for Call<'_> {
    #[inline(always)]
    fn run(self) {
        let Self { forward, model, plan, data, arguments } = self;
        let Data { limbs: Some(scratch), rnea, aba, .. } = data else { return };
        load(plan, scratch, arguments);
        let Scratch { q, v, x, f_ext, world, rnea: limbs_rnea, aba: limbs_aba, .. } = &mut **scratch;
        let f_ext = if arguments.f_ext.is_empty() { &[] } else { &f_ext[..] };
        let l = Limbs { plan, armature: &model.armature, gravity: model.gravity };
        if forward {
            place(&l, world, q);
            aba::pass(&l, world, limbs_aba, v, x, f_ext);
            scatter(plan, &limbs_aba.qdd, &mut aba.qdd);
        } else {
            rnea::pass(&l, &mut world.turns, limbs_rnea, q, v, x, f_ext);
            scatter(plan, &limbs_rnea.tau, &mut rnea.tau);
            Single::<Fused, f64>::new(model).add_armature_torque(arguments.x, &mut rnea.tau);
        }
    }
    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}

/// `aba` if it is `forward`, else `rnea`, with the limbs side by side, where this model and `data` have them; whether they
/// have.
#[inline]
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    forward: bool,
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    x: &[S],
    f_ext: &[Force<S>],
) -> bool {
    let (Some(plan), Some(scratch)) = (&model.limbs, &data.limbs) else { return false };
    if !is_f64::<S, R>() || !scratch.fits(plan) || level() == Level::Baseline {
        return false;
    }
    // SAFETY: S and R are f64, and the processor has the level.
    unsafe {
        let arguments = Arguments { q: slice(q), v: slice(v), x: slice(x), f_ext: slice(f_ext) };
        let (model, data) = (same(model), fused(data));
        short(Call { forward, model, plan, data, arguments });
    }
    true
}
