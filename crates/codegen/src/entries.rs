//! Loops for adjacent entries of a result. The entries must be sums of products with the same structure, and
//! corresponding products must have a common factor. For example, a column of a matrix product consists of such
//! entries. Compilers vectorise the loop, and the loop's code is much shorter than one line for each product.

use crate::graph::{Id, Node};
use crate::step::{Entries, Step, Term};

/// Minimum number of entries that a loop computes.
const FEWEST: usize = 4;

/// Term of one sum: whether the term is subtracted, and the term's two factors. If the term is a single value, the
/// second factor is `None`.
type Of = (bool, [Option<Id>; 2]);

/// Replaces steps by a loop wherever adjacent results have the same structure.
///
/// `places` contains, for each result, the index of the result's array and the index within this array.
pub(crate) fn gather(steps: &mut Vec<Step>, results: &[Id], places: &[(usize, usize)]) {
    let mut gatherer = Gatherer::new(steps, results);
    let (mut loops, mut start) = (Vec::new(), 0);
    for run in places.chunk_by(|&(array, place), &next| next == (array, place + 1)) {
        let end = start + run.len();
        while start < end {
            let found = gatherer.alike(&results[start..end], start);
            start += found.as_ref().map_or(1, |found| found.ids.len());
            loops.extend(found);
        }
    }
    let mut replaced: Vec<Option<Step>> = steps.drain(..).map(Some).collect();
    for entries in loops {
        let mut last = 0;
        for &id in &entries.ids {
            let mut sum = Some(id);
            for _ in entries.terms.iter().filter(|term| term.common.is_some()) {
                let Some(k) = sum.map(|id| gatherer.maker[id as usize]) else { break };
                last = last.max(k);
                sum = replaced[k].take().and_then(|step| rest(&step));
            }
        }
        replaced[last] = Some(Step::Entries(entries));
    }
    steps.extend(replaced.into_iter().flatten());
}

/// Returns the product in a step: whether the product is subtracted, and its factors.
fn product(step: &Step) -> Option<Of> {
    match *step {
        Step::MulAdd(_, [a, b, _]) | Step::Plain(_, Node::Mul(a, b)) => Some((false, [Some(a), Some(b)])),
        Step::SubMul(_, [a, b, _]) => Some((true, [Some(a), Some(b)])),
        _ => None,
    }
}

/// Returns the value to which a step adds a product, or from which a step subtracts a product.
fn rest(step: &Step) -> Option<Id> {
    match *step {
        Step::MulAdd(_, [.., c]) | Step::SubMul(_, [.., c]) => Some(c),
        _ => None,
    }
}

/// Properties of each value that the search for loops needs.
struct Gatherer {
    /// Index of the step that computes each value; `usize::MAX` if no step computes the value.
    maker: Vec<usize>,
    /// Terms of each value that is a sum of products, the last term first. At most one term is a single value.
    sums: Vec<Option<Vec<Of>>>,
    /// Whether each value is free: no step uses it, and no loop computes it yet.
    is_free: Vec<bool>,
    /// For each value, the value that must directly follow it in the work space.
    next: Vec<Option<Id>>,
    /// Whether each value must directly follow another value in the work space.
    has_place: Vec<bool>,
}

impl Gatherer {
    fn new(steps: &[Step], results: &[Id]) -> Self {
        let values = steps.iter().flat_map(|step| step.makes().chain(step.takes())).chain(results.iter().copied());
        let n = values.max().map_or(0, |id| id as usize + 1);
        let (mut maker, mut uses) = (vec![usize::MAX; n], vec![0; n]);
        for (k, step) in steps.iter().enumerate() {
            step.makes().for_each(|id| maker[id as usize] = k);
            step.takes().for_each(|id| uses[id as usize] += 1);
        }
        let is_free: Vec<bool> = uses.iter().map(|&uses| uses == 0).collect();
        results.iter().for_each(|&id| uses[id as usize] += 1);
        let mut sums: Vec<Option<Vec<Of>>> = vec![None; n];
        for step in steps {
            let (Some(product), Some(id)) = (product(step), step.makes().next()) else { continue };
            let rest = rest(step).map(|rest| {
                let part = sums[rest as usize].take_if(|_| uses[rest as usize] == 1);
                part.unwrap_or_else(|| vec![(false, [Some(rest), None])])
            });
            sums[id as usize] = Some([&[product], &rest.unwrap_or_default()[..]].concat());
        }
        Self { maker, sums, is_free, next: vec![None; n], has_place: vec![false; n] }
    }

    /// Returns a loop for the longest run of entries with the same structure. The run begins with `entries[0]`, which
    /// is the result with index `place`.
    fn alike(&mut self, entries: &[Id], place: usize) -> Option<Entries> {
        let sum = |of: &Self, id: Id| of.sums[id as usize].clone().filter(|_| of.is_free[id as usize]);
        let first = sum(self, entries[0]).filter(|sum| sum.len() > 1)?;
        let second = sum(self, *entries.get(1)?)?;
        let common = |(one, other): (&Of, &Of)| {
            let mut both = one.1.into_iter().filter(|factor| other.1.contains(factor));
            both.next().filter(|_| both.next().is_none())
        };
        let common: Vec<Option<Id>> = first.iter().zip(&second).map(common).collect::<Option<_>>()?;
        let mut terms: Vec<Term> = Vec::new();
        for (&(minus, factors), &common) in first.iter().zip(&common) {
            terms.push(Term { minus, each: vec![other(factors, common)?], common });
        }
        if terms.iter().any(|term| self.maker[term.each[0] as usize] == usize::MAX) {
            return None;
        }
        terms.iter().for_each(|term| self.has_place[term.each[0] as usize] = true);
        let mut ids = vec![entries[0]];
        'entries: for &id in &entries[1..] {
            let Some(sum) = sum(self, id).filter(|sum| sum.len() == first.len() && !ids.contains(&id)) else { break };
            let mut values = Vec::new();
            for (term, (minus, factors)) in terms.iter().zip(sum) {
                let value = other(factors, term.common).filter(|_| minus == term.minus);
                match (term.each.last(), value) {
                    (Some(&last), Some(value)) if self.follows(last, value) => values.push(value),
                    _ => break 'entries,
                }
            }
            terms.iter_mut().zip(values).for_each(|(term, value)| term.each.push(value));
            ids.push(id);
        }
        if ids.len() < FEWEST {
            return None;
        }
        ids.iter().for_each(|&id| self.is_free[id as usize] = false);
        terms.reverse();
        Some(Entries { ids, first: place, terms })
    }

    /// Requires that value `id` directly follows value `last` in the work space, if this is possible. Returns whether
    /// `id` follows `last`.
    fn follows(&mut self, last: Id, id: Id) -> bool {
        match self.next[last as usize] {
            Some(next) => next == id,
            None if self.has_place[id as usize] || self.maker[id as usize] == usize::MAX => false,
            None => {
                self.next[last as usize] = Some(id);
                self.has_place[id as usize] = true;
                true
            }
        }
    }
}

/// Returns the factor of a product besides the common factor; `None` if the product does not have such a factor.
fn other([a, b]: [Option<Id>; 2], common: Option<Id>) -> Option<Id> {
    match (a == common, b == common) {
        (true, false) => b,
        (false, true) => a,
        _ => None,
    }
}
