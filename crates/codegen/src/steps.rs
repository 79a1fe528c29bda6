//! Steps of a function, made from its graph. Products are fused into the sums that use them. Sine and cosine of an
//! angle are computed together. A loop computes similar entries of a result.

use crate::entries;
use crate::function::{Function, Operations};
use crate::graph::{Id, Node};
use crate::step::{Angle, Step};
use crate::sums::Sums;
use std::collections::HashMap;

/// Steps of a function. Each step is after the steps whose values it uses.
#[derive(Debug)]
pub(crate) struct Steps<'f> {
    pub nodes: &'f [Node],
    /// Number of values.
    pub values: usize,
    pub all: Vec<Step>,
    /// Early angles: angles whose sines and cosines a loop computes before all other steps. An example is a joint
    /// angle.
    pub angles: Vec<Angle>,
    /// Values of all outputs.
    pub results: &'f [Id],
}

/// Maximum number of operations that compute an early angle from inputs. (The sine and cosine of an early angle are
/// computed before all other steps.)
const AT_ONCE: usize = 4;

/// Returns the number of operations that compute a value from inputs and constants. Returns `None` if the number
/// exceeds the maximum, or if an operation is neither a sum nor a product.
fn operations_from_inputs(nodes: &[Node], id: Id) -> Option<usize> {
    let node = nodes[id as usize];
    match node {
        Node::Constant(_) | Node::Input(_) => Some(0),
        Node::Add(..) | Node::Sub(..) | Node::Mul(..) | Node::Neg(_) => {
            let mut sum = 1;
            for operand in node.operands() {
                sum += operations_from_inputs(nodes, operand)?;
                if sum > AT_ONCE {
                    return None;
                }
            }
            Some(sum)
        }
        _ => None,
    }
}

impl<'f> Steps<'f> {
    /// Returns the steps of a function, in recording order.
    pub(crate) fn new(function: &'f Function) -> Self {
        let nodes = &function.nodes[..];
        let mut all = Sums::new(nodes, &function.results).steps();
        let mut halves: HashMap<Id, Angle> = HashMap::new();
        for node in nodes.iter().enumerate() {
            if let (id, &(Node::Sin(angle) | Node::Cos(angle))) = node {
                let both = halves.entry(angle).or_insert(Angle { angle, sin: None, cos: None });
                let half = if matches!(nodes[id], Node::Sin(_)) { &mut both.sin } else { &mut both.cos };
                *half = Some(id as Id);
            }
        }
        // Compute the sine and cosine of an angle in one step, at the index where the first of the two was recorded.
        all.retain_mut(|step| match *step {
            Step::Plain(_, Node::Sin(angle) | Node::Cos(angle)) => match halves.remove(&angle) {
                Some(both) => {
                    *step = Step::SinCos(both);
                    true
                }
                None => false,
            },
            _ => true,
        });
        let mut angles = Vec::new();
        all.retain(|step| match *step {
            Step::SinCos(angle) if operations_from_inputs(nodes, angle.angle).is_some() => {
                angles.push(angle);
                false
            }
            _ => true,
        });
        let mut steps = Self { nodes, values: nodes.len(), all, angles, results: &function.results };
        steps.drop_unused();
        entries::gather(&mut steps.all, &function.results, &function.places);
        steps
    }

    /// Removes steps whose values are not used, such as the steps that compute early angles.
    fn drop_unused(&mut self) {
        let mut used = vec![false; self.values];
        self.results.iter().for_each(|&id| used[id as usize] = true);
        let mut kept = vec![false; self.all.len()];
        for (k, step) in self.all.iter().enumerate().rev() {
            kept[k] = step.makes().any(|id| used[id as usize]);
            if kept[k] {
                step.takes().for_each(|id| used[id as usize] = true);
            }
        }
        let mut kept = kept.into_iter();
        self.all.retain(|_| kept.next() == Some(true));
    }

    /// Returns the number of operations of all steps together, for each type of operation.
    pub(crate) fn operations(&self) -> Operations {
        let mut n = Operations { angles: self.angles.len(), ..Operations::default() };
        for step in &self.all {
            match *step {
                Step::MulAdd(..) | Step::MulSub(..) | Step::SubMul(..) => n.fused += 1,
                Step::SinCos(_) | Step::Plain(_, Node::Atan2(..)) => n.angles += 1,
                Step::Plain(_, Node::Add(..) | Node::Sub(..)) => n.sums += 1,
                Step::Plain(_, Node::Mul(..)) => n.products += 1,
                Step::Plain(_, Node::Div(..) | Node::Sqrt(_)) => n.quotients += 1,
                Step::Plain(..) => n.others += 1,
                Step::Entries(ref entries) => {
                    n.products += if entries.terms[0].common.is_some() { entries.ids.len() } else { 0 };
                    n.fused += entries.ids.len() * (entries.terms.len() - 1);
                }
            }
        }
        n
    }
}

impl Function {
    /// Returns the number of operations of the function, for each type of operation.
    ///
    /// ```
    /// use condyle_codegen::record;
    /// let f = record("f", "a b + c.", |r| {
    ///     let x = r.input("x", 3, "three numbers");
    ///     r.output("y", &[x[0] * x[1] + x[2]], "their value");
    /// });
    /// assert_eq!((f.operations().fused, f.operations().total()), (1, 1));
    /// ```
    pub fn operations(&self) -> Operations {
        Steps::new(self).operations()
    }
}
