//! Program of a function: the function's ordered steps, cut into parts of bounded size. Values that several parts use
//! are stored in an array, the work space.

use crate::function::Function;
use crate::graph::Id;
use crate::order::order;
use crate::step::{Angle, Step, Term};
use crate::steps::Steps;
use core::iter::successors;
use core::ops::Range;

/// Maximum number of steps in a part. If this number is doubled, compilers need more than twice the time.
const LONGEST: usize = 2000;
/// Minimum number of steps in a part. The last part may be shorter.
const SHORTEST: usize = 1000;

/// Storage of a value in the generated code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Place {
    /// Input or constant, which needs no storage.
    Given,
    /// Local variable. One part computes the value, and no other part uses it.
    Local,
    /// Slot of the work space, given by its index. In the part that computes the value, it is also a variable.
    Work(usize),
}

/// Ordered steps of a function, cut into parts.
#[derive(Debug)]
pub(crate) struct Program<'f> {
    pub function: &'f Function,
    pub steps: Steps<'f>,
    /// Range of the steps of each part.
    pub parts: Vec<Range<usize>>,
    /// Index of the part that computes each value; `usize::MAX` if no part computes the value.
    pub part_of: Vec<usize>,
    pub places: Vec<Place>,
    /// Whether any step uses each value.
    pub taken: Vec<bool>,
    /// Maximum number of values that are needed at the same time.
    pub most_alive: usize,
    /// Size of the work space, the array for intermediate values. It holds the sines of all early angles, then the
    /// cosines, then other values.
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

    /// Returns the early angles, whose sines and cosines are computed before all steps.
    pub(crate) fn angles(&self) -> &[Angle] {
        &self.steps.angles
    }
}

/// Returns the last step that uses each value; `steps.all.len()` if only a result uses the value.
fn last_uses(steps: &Steps) -> Vec<usize> {
    let mut last = vec![0; steps.values];
    for (k, step) in steps.all.iter().enumerate() {
        step.takes().for_each(|id| last[id as usize] = k);
    }
    last
}

/// Returns, for each step, how many values were computed before it and are used by it or by later steps. The last entry
/// is the number after all steps.
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

/// Cuts the steps into parts. Within the bounds of its size, each part ends where the fewest values are still needed,
/// for example at the end of a limb.
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

/// Returns the values from which loops compute entries, in the order in which the work space stores the values. The
/// values that a loop reads one after the other are adjacent.
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

/// Returns the storage of each value, and the size of the work space.
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
