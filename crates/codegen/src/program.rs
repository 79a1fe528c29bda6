//! A function as a program: its steps in order, in parts of bounded size, with the places of what one part leaves to others.

use crate::function::Function;
use crate::graph::Id;
use crate::order::order;
use crate::step::{Angle, Step, Term};
use crate::steps::Steps;
use core::iter::successors;
use core::ops::Range;

/// The steps that a part may have: compilers take more than twice as long for twice as many.
const LONGEST: usize = 2000;
/// The steps that a part has at least, but for the last one.
const SHORTEST: usize = 1000;

/// Where a part finds a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// It is an input or a constant.
    Given,
    /// A variable of the part that computes it, and of no other.
    Local,
    /// In the work space, and in the part that computes it a variable too.
    Work(usize),
}

/// A function's steps in order, in parts.
#[derive(Debug)]
pub(crate) struct Program<'f> {
    pub function: &'f Function,
    pub steps: Steps<'f>,
    /// The steps of each part.
    pub parts: Vec<Range<usize>>,
    /// The part that computes each value; `usize::MAX` if none does.
    pub part_of: Vec<usize>,
    pub places: Vec<Place>,
    /// Whether a step takes each value.
    pub taken: Vec<bool>,
    /// The most values that are under way at a time.
    pub most_alive: usize,
    /// The numbers in the work space: the sines of all angles that are known at once, their cosines, then the rest.
    pub work: usize,
}

impl<'f> Program<'f> {
    pub(crate) fn new(function: &'f Function) -> Self {
        let mut steps = Steps::new(function);
        order(&mut steps);
        let alive = alive(&steps);
        let parts = cut(&alive);
        let mut part_of = vec![usize::MAX; steps.values];
        for (p, part) in parts.iter().enumerate() {
            steps.all[part.clone()].iter().flat_map(Step::makes).for_each(|id| part_of[id as usize] = p);
        }
        let (places, work) = place(&steps, &parts, &part_of);
        let mut taken = vec![false; steps.values];
        steps.all.iter().flat_map(Step::takes).for_each(|id| taken[id as usize] = true);
        let most_alive = alive.into_iter().max().unwrap_or(0);
        Self { function, steps, parts, part_of, places, taken, most_alive, work }
    }

    /// The angles that are known at once.
    pub(crate) fn angles(&self) -> &[Angle] {
        &self.steps.angles
    }
}

/// Where values are used for the last time: the step, or behind the last one for nothing but a result.
fn last_uses(steps: &Steps) -> Vec<usize> {
    let mut last = vec![0; steps.values];
    for (k, step) in steps.all.iter().enumerate() {
        step.takes().for_each(|id| last[id as usize] = k);
    }
    last
}

/// How many values come from before each step and are needed by it or after it; last, behind the last step.
fn alive(steps: &Steps) -> Vec<usize> {
    let n = steps.all.len();
    let last = last_uses(steps);
    let mut change = vec![0_isize; n + 1];
    for (k, step) in steps.all.iter().enumerate() {
        for id in step.makes().map(|id| id as usize) {
            if last[id] > k {
                change[k + 1] += 1;
                change[last[id]] -= 1;
            }
        }
    }
    let mut now = 0_usize;
    let next = |change| {
        now = now.wrapping_add_signed(change);
        now
    };
    change.into_iter().map(next).collect()
}

/// The parts: each ends where, within its bounds, the fewest values go on, which is where a limb ends.
fn cut(alive: &[usize]) -> Vec<Range<usize>> {
    let n = alive.len() - 1;
    let (mut parts, mut first) = (Vec::new(), 0);
    while n - first > LONGEST {
        let end = (first + SHORTEST..=first + LONGEST).min_by_key(|&k| (alive[k], usize::MAX - k)).unwrap_or(n);
        parts.push(first..end);
        first = end;
    }
    parts.push(first..n);
    parts
}

/// The values from which loops compute entries, each behind the one of the entry before.
fn side_by_side(steps: &Steps) -> Vec<Id> {
    let (mut next, mut is_first) = (vec![None; steps.values], vec![true; steps.values]);
    let mut all = Vec::new();
    for step in &steps.all {
        let Step::Entries(entries) = step else { continue };
        for Term { each, .. } in &entries.terms {
            all.extend(each);
            for pair in each.windows(2) {
                next[pair[0] as usize] = Some(pair[1]);
                is_first[pair[1] as usize] = false;
            }
        }
    }
    let mut placed = Vec::new();
    for id in all {
        if core::mem::take(&mut is_first[id as usize]) {
            placed.extend(successors(Some(id), |&id| next[id as usize]));
        }
    }
    placed
}

/// The places of all values, and the size of the work space.
fn place(steps: &Steps, parts: &[Range<usize>], part_of: &[usize]) -> (Vec<Place>, usize) {
    let mut places = vec![Place::Given; steps.values];
    let n = steps.angles.len();
    for (k, angle) in steps.angles.iter().enumerate() {
        angle.sin.iter().for_each(|&id| places[id as usize] = Place::Work(k));
        angle.cos.iter().for_each(|&id| places[id as usize] = Place::Work(n + k));
    }
    let mut last_part = part_of.to_vec();
    for (p, part) in parts.iter().enumerate() {
        steps.all[part.clone()].iter().flat_map(Step::takes).for_each(|id| last_part[id as usize] = p);
    }
    let (mut size, mut free) = (2 * n, Vec::new());
    let side_by_side = side_by_side(steps);
    for (k, &id) in side_by_side.iter().enumerate() {
        places[id as usize] = Place::Work(size + k);
    }
    size += side_by_side.len();
    let mut to_free: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
    for (p, part) in parts.iter().enumerate() {
        if p > 0 {
            free.append(&mut to_free[p - 1]);
        }
        for id in steps.all[part.clone()].iter().flat_map(Step::makes) {
            let id: Id = id;
            if let Place::Work(_) = places[id as usize] {
                continue;
            }
            let last = last_part[id as usize];
            places[id as usize] = if last > p {
                let slot = free.pop().unwrap_or_else(|| {
                    size += 1;
                    size - 1
                });
                to_free[last].push(slot);
                Place::Work(slot)
            } else {
                Place::Local
            };
        }
    }
    (places, size)
}
