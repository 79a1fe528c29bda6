//! Steps that compute sums of any length, with products fused into the sums.
//!
//! If a sum is used only once, as an operand of a larger sum, its terms become terms of the larger sum. So a sum is a
//! list of terms; each term is a value or a product of two values. A product is fused with the addition that follows
//! it. So a sum that begins with a value takes one step for each other term, independent of brackets. For example, x −
//! (a b + c d) takes two steps. Terms are added in recording order, as soon as they are available.

use crate::graph::{Graph, Id, Node};
use crate::step::Step;

/// Term of a sum: a value, and whether it is subtracted.
#[derive(Clone, Copy, Debug)]
struct Term {
    id: Id,
    minus: bool,
}

/// Combines the constants of each sum into one constant. Returns all values, including values that are no longer
/// needed, and the results.
pub(crate) fn with_constants_gathered(nodes: &[Node], results: &[Id]) -> (Vec<Node>, Vec<Id>) {
    let sums = Sums::new(nodes, results);
    let mut graph = Graph::new();
    let mut new: Vec<Id> = Vec::with_capacity(nodes.len());
    for (k, &node) in nodes.iter().enumerate() {
        let id = k as Id;
        let (terms, _) = if is_sum(node) && !sums.is_part(id) { sums.terms(id) } else { (Vec::new(), Vec::new()) };
        let constants = terms.iter().filter_map(|term| match nodes[term.id as usize] {
            Node::Constant(bits) if term.minus => Some(-f64::from_bits(bits)),
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        });
        let renamed = if constants.clone().count() > 1 {
            let start = graph.constant(constants.sum());
            let others = terms.iter().filter(|term| !matches!(nodes[term.id as usize], Node::Constant(_)));
            others.fold(start, |sum, term| {
                let id = new[term.id as usize];
                if term.minus { graph.sub(sum, id) } else { graph.add(sum, id) }
            })
        } else {
            graph.simplified(node.renamed(|id| new[id as usize]))
        };
        new.push(renamed);
    }
    (graph.nodes, results.iter().map(|&id| new[id as usize]).collect())
}

/// Sums among the values of a function.
pub(crate) struct Sums<'f> {
    nodes: &'f [Node],
    /// Number of uses of each value.
    uses: Vec<u32>,
    /// Number of uses of each value by sums.
    by_sums: Vec<u32>,
    /// Whether each value has a step of its own if it is a product.
    has_step: Vec<bool>,
}

impl<'f> Sums<'f> {
    pub(crate) fn new(nodes: &'f [Node], results: &[Id]) -> Self {
        let (mut uses, mut by_sums) = (vec![0; nodes.len()], vec![0; nodes.len()]);
        for node in nodes {
            node.operands().for_each(|id| uses[id as usize] += 1);
            if is_sum(*node) {
                node.operands().for_each(|id| by_sums[id as usize] += 1);
            }
        }
        results.iter().for_each(|&id| uses[id as usize] += 1);
        let has_step = (0..nodes.len()).map(|id| uses[id] > by_sums[id]).collect();
        Self { nodes, uses, by_sums, has_step }
    }

    /// Returns whether a value is a sum that is used only once, in a larger sum. The terms of such a sum become terms
    /// of the larger sum.
    fn is_part(&self, id: Id) -> bool {
        let id = id as usize;
        is_sum(self.nodes[id]) && self.uses[id] == 1 && self.by_sums[id] == 1
    }

    /// Returns whether a value is a product that is fused into the sums that use it. Such a product has no step of its
    /// own.
    fn is_fused(&self, id: Id) -> bool {
        matches!(self.nodes[id as usize], Node::Mul(..)) && !self.has_step[id as usize]
    }

    /// Returns all steps in order: each step follows the last recorded value on which it depends.
    pub(crate) fn steps(mut self) -> Vec<Step> {
        let mut of_sums = Vec::new();
        for (k, &node) in self.nodes.iter().enumerate() {
            let id = k as Id;
            if is_sum(node) && !self.is_part(id) {
                self.sum(id, &mut of_sums);
            }
        }
        let mut steps: Vec<(Id, Step)> = Vec::new();
        for (k, &node) in self.nodes.iter().enumerate() {
            let id = k as Id;
            match node {
                Node::Constant(_) | Node::Input(_) | Node::Add(..) | Node::Sub(..) => {}
                Node::Mul(..) if self.is_fused(id) => {}
                _ => steps.push((id, Step::Plain(id, node))),
            }
        }
        steps.extend(of_sums);
        // The sort is stable: a value comes before the steps of the sums that use it.
        steps.sort_by_key(|&(place, _)| place);
        steps.into_iter().map(|(_, step)| step).collect()
    }

    /// Returns the terms of a sum, and the smaller sums that became parts of it.
    fn terms(&self, root: Id) -> (Vec<Term>, Vec<Id>) {
        let (mut terms, mut parts) = (Vec::new(), Vec::new());
        let mut stack = vec![Term { id: root, minus: false }];
        while let Some(Term { id, minus }) = stack.pop() {
            if id != root && !self.is_part(id) {
                terms.push(Term { id, minus });
                continue;
            }
            if id != root {
                parts.push(id);
            }
            match self.nodes[id as usize] {
                Node::Sub(a, b) => stack.extend([Term { id: a, minus }, Term { id: b, minus: !minus }]),
                node => stack.extend(node.operands().map(|id| Term { id, minus })),
            }
        }
        terms.sort_by_key(|term| term.id);
        parts.sort_unstable();
        (terms, parts)
    }

    /// Adds the steps of a sum. Partial results get the ids of the smaller sums that became parts of it.
    fn sum(&mut self, root: Id, steps: &mut Vec<(Id, Step)>) {
        let (mut terms, parts) = self.terms(root);
        // Begin with a value. If all terms are products, begin with a product that only this sum uses, or else with any
        // product.
        let is_single = |term: &Term| self.uses[term.id as usize] == 1;
        let first = terms.iter().position(|term| !self.is_fused(term.id));
        let first = first.or_else(|| terms.iter().position(is_single)).unwrap_or(0);
        let Term { id: mut sum, minus: mut is_negative } = terms.remove(first);
        self.has_step[sum as usize] = true;
        let mut place = sum;
        let mut names = parts.into_iter().chain([root]);
        for Term { id, minus } in terms {
            let Some(name) = names.next() else { break }; // there is one name for each term except the first
            place = place.max(id);
            let step = match self.nodes[id as usize] {
                Node::Mul(a, b) if self.is_fused(id) => match (is_negative, minus) {
                    (false, true) => Step::SubMul(name, [a, b, sum]),
                    (true, false) => Step::MulSub(name, [a, b, sum]),
                    _ => Step::MulAdd(name, [a, b, sum]),
                },
                _ => Step::Plain(
                    name,
                    match (is_negative, minus) {
                        (false, true) => Node::Sub(sum, id),
                        (true, false) => Node::Sub(id, sum),
                        _ => Node::Add(sum, id),
                    },
                ),
            };
            is_negative &= minus;
            steps.push((place, step));
            sum = name;
        }
        debug_assert!(!is_negative, "signs are taken out of sums when they are recorded");
    }
}

fn is_sum(node: Node) -> bool {
    matches!(node, Node::Add(..) | Node::Sub(..))
}
