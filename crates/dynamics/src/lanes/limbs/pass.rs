//! Scratch of passes in lanes, and conversion of arguments to lanes.
#![allow(unsafe_code)]

use super::lanes::Four;
use super::{LANES, Plan, inverse};
use crate::derivatives::rnea_derivatives;
use crate::passes::aba;
use crate::passes::kinematics::World;
use crate::passes::rnea;
use crate::selection;
use crate::workspace::{Size, filled};
use alloc::boxed::Box;
use condyle_model::Model;
use condyle_model::limbs::steps::Source;
use condyle_spatial::block::lanes;
use condyle_spatial::gate::{FusedF64, Rename, same};
use condyle_spatial::{Array, Force, Inertia, Scalar};

/// Scratch and results of passes in lanes.
#[derive(Clone, Debug)]
pub(crate) struct Scratch {
    /// Arguments q, v, x and f_ext in lanes. Shapes: q has one vector for each position of the plan, v and x have one
    /// vector for each coordinate, and f_ext has one force for each step. Written by: `load`.
    pub q: Array<Four>,
    pub v: Array<Four>,
    pub x: Array<Four>,
    pub f_ext: Array<Force<Four>>,
    /// Copy of an argument, followed by a 0, which lanes without a joint read. Shape: max(nq, nv) + 1. Written by:
    /// `gather`.
    padded: Array<FusedF64>,
    pub world: World<Four>,
    pub rnea: rnea::Workspace<Four>,
    pub aba: aba::Workspace<Four>,
    /// Composite inertias. Shape: number of steps. Written by: `crba::pass`.
    pub IC: Array<Inertia<Four>>,
    pub bodies: rnea_derivatives::Bodies<Four>,
    pub inverted: inverse::Scratch,
}

impl Scratch {
    /// Allocates the scratch. Returns `None` if the model has no limbs or the processor does not support lanes.
    pub(crate) fn new<S: 'static, R>(model: &Model<R>) -> Option<Box<Self>> {
        let plan = selection::limbs::<S, R>(model)?;
        let (steps, nv) = (plan.steps.len(), plan.state.coordinates.len());
        let size = Size { bodies: steps, columns: nv + plan.columns.copies.len(), depth: 0, body_depth: steps, nv };
        let zeros = filled(Four::zero, nv);
        Some(Box::new(Self {
            q: filled(Four::zero, plan.state.positions.len()),
            v: zeros.clone(),
            x: zeros,
            f_ext: filled(Force::zero, steps),
            padded: filled(|| FusedF64(0.0), model.nq().max(model.nv()) + 1),
            world: World::new(size),
            rnea: rnea::Workspace::new(size),
            aba: aba::Workspace::new(size),
            IC: filled(Inertia::zero, steps),
            bodies: rnea_derivatives::Bodies::new(size),
            inverted: inverse::Scratch::new(model.nv(), plan),
        }))
    }

    /// Returns whether the scratch was made for this plan, or for a plan with the same sizes.
    pub(crate) fn fits(&self, plan: &Plan) -> bool {
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

/// Arguments of inverse or forward dynamics.
#[derive(Clone, Copy)]
pub(crate) struct Arguments<'a, S = FusedF64> {
    pub q: &'a [S],
    pub v: &'a [S],
    /// Joint accelerations for inverse dynamics, or joint efforts for forward dynamics.
    pub x: &'a [S],
    pub f_ext: &'a [Force<S>],
}

impl<'a, S> Arguments<'a, S> {
    /// Returns the arguments of an algorithm that depends only on the position.
    pub(crate) fn position(q: &'a [S]) -> Self {
        Self { q, v: &[], x: &[], f_ext: &[] }
    }

    /// Returns the same arguments with the number type `FusedF64`.
    ///
    /// # Safety
    /// `S` must be `f64`.
    pub(crate) unsafe fn fused(self) -> Arguments<'a> {
        // SAFETY: the caller guarantees that `S` is `f64`.
        let [q, v, x]: [&[f64]; 3] = unsafe { [same(self.q), same(self.v), same(self.x)] };
        // SAFETY: `S` is `f64`, as for the other arguments.
        let f_ext: &[Force<f64>] = unsafe { same(self.f_ext) };
        Arguments { q: q.renamed(), v: v.renamed(), x: x.renamed(), f_ext: f_ext.renamed() }
    }
}

/// Loads the arguments into lanes.
#[inline(always)]
pub(crate) fn load(plan: &Plan, to: &mut Scratch, from: Arguments<'_>) {
    gather(&plan.state.positions, &mut to.padded, from.q, &mut to.q);
    if !from.v.is_empty() {
        let nv = plan.state.leaders.len();
        assert!(from.v.len() == nv && from.x.len() == nv, "vectors of another robot");
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

/// Copies the numbers of x, a vector of positions or coordinates of the robot, to the lanes of `to`.
#[inline(always)]
fn gather(sources: &[Source], padded: &mut [FusedF64], x: &[FusedF64], to: &mut [Four]) {
    padded[..x.len()].copy_from_slice(x);
    padded[x.len()] = FusedF64(0.0);
    let padded = &padded[..=x.len()];
    for (Source { from: [i, j, k, l], ratio, offset }, to) in sources.iter().zip(to) {
        let number = |at: &usize| {
            debug_assert!(*at < padded.len());
            // SAFETY: each source of a plan is an index of a number in x, or x.len(). `padded` is longer than x by one.
            unsafe { padded.get_unchecked(*at) }.0
        };
        let x = Four::from_array([number(i), number(j), number(k), number(l)]);
        *to = x.mul_add(Four::from_array(*ratio), Four::from_array(*offset));
    }
}

/// Copies a vector of coordinates from lanes to an array in the robot's order, the inverse of `gather`.
#[inline(always)]
pub(crate) fn scatter(plan: &Plan, from: &[Four], to: &mut [FusedF64]) {
    let numbers = lanes(from);
    assert!(numbers.len() == LANES * plan.state.coordinates.len(), "lanes of another robot");
    for (to, &at) in to.iter_mut().zip(&plan.state.leaders) {
        debug_assert!(at < numbers.len());
        // SAFETY: the plan's indices are below the number of lanes of all coordinates. This number is checked above.
        *to = FusedF64(unsafe { *numbers.get_unchecked(at) });
    }
    for &(k, at, ratio) in &plan.state.followers {
        to[k] += FusedF64(numbers[at] * ratio);
    }
}
