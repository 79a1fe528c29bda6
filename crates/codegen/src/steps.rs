//! The steps of a function: its graph with products fused into the sums that they go into, and both parts of an angle computed
//! together.

use crate::function::{Function, Operations};
use crate::graph::{Id, Node};

/// A step.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Step {
    /// A value as the graph computes it.
    Plain(Id, Node),
    /// a b + c.
    MulAdd(Id, [Id; 3]),
    /// a b − c.
    MulSub(Id, [Id; 3]),
    /// c − a b.
    SubMul(Id, [Id; 3]),
    /// The sine and the cosine of an angle.
    SinCos(Angle),
}

impl Step {
    /// The values that it computes.
    pub(crate) fn makes(&self) -> impl Iterator<Item = Id> {
        match *self {
            Self::Plain(id, _) | Self::MulAdd(id, _) | Self::MulSub(id, _) | Self::SubMul(id, _) => [Some(id), None],
            Self::SinCos(Angle { sin, cos, .. }) => [sin, cos],
        }
        .into_iter()
        .flatten()
    }

    /// The values from which it computes them.
    pub(crate) fn takes(&self) -> impl Iterator<Item = Id> {
        match *self {
            Self::Plain(_, node) => {
                let mut operands = node.operands();
                [operands.next(), operands.next(), operands.next()]
            }
            Self::MulAdd(_, abc) | Self::MulSub(_, abc) | Self::SubMul(_, abc) => abc.map(Some),
            Self::SinCos(Angle { angle, .. }) => [Some(angle), None, None],
        }
        .into_iter()
        .flatten()
    }
}

/// All steps of a function, each after those from which it takes values.
#[derive(Debug)]
pub(crate) struct Steps<'f> {
    pub nodes: &'f [Node],
    /// The number of values.
    pub values: usize,
    pub all: Vec<Step>,
    /// The angles that are known at once: those of the joints. Their sines and cosines are computed in a loop before all else.
    pub angles: Vec<Angle>,
    /// The values of all outputs.
    pub results: &'f [Id],
}

/// An angle, with its sine and its cosine where they are needed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle {
    pub angle: Id,
    pub sin: Option<Id>,
    pub cos: Option<Id>,
}

/// The operations that an angle may take to be known at once.
const AT_ONCE: usize = 4;

/// How many operations it takes to compute a value from inputs and constants, if they are sums and products, and few.
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
    /// The steps of a function, in the order in which they were recorded.
    pub(crate) fn new(function: &'f Function) -> Self {
        let nodes = &function.nodes[..];
        let mut uses = vec![0_u32; nodes.len()];
        nodes.iter().flat_map(|node| node.operands()).for_each(|id| uses[id as usize] += 1);
        function.results.iter().for_each(|&id| uses[id as usize] += 1);
        let product = |id: Id| match nodes[id as usize] {
            Node::Mul(a, b) if uses[id as usize] == 1 => Some((a, b)),
            _ => None,
        };
        let mut fused = vec![false; nodes.len()];
        let mut other_half = vec![None; nodes.len()];
        let mut angle_seen = vec![usize::MAX; nodes.len()];
        let mut all: Vec<Step> = Vec::new();
        for (k, &node) in nodes.iter().enumerate() {
            let id = k as Id;
            let step = match node {
                Node::Constant(_) | Node::Input(_) => continue,
                // of two products the later one: the other has been computed by then
                Node::Add(a, b) => match (product(a), product(b)) {
                    (_, Some((x, y))) if product(a).is_none() || b > a => {
                        fuse(&mut fused, b, Step::MulAdd(id, [x, y, a]))
                    }
                    (Some((x, y)), _) => fuse(&mut fused, a, Step::MulAdd(id, [x, y, b])),
                    _ => Step::Plain(id, node),
                },
                Node::Sub(a, b) => match (product(a), product(b)) {
                    (_, Some((x, y))) if product(a).is_none() || b > a => {
                        fuse(&mut fused, b, Step::SubMul(id, [x, y, a]))
                    }
                    (Some((x, y)), _) => fuse(&mut fused, a, Step::MulSub(id, [x, y, b])),
                    _ => Step::Plain(id, node),
                },
                Node::Sin(angle) | Node::Cos(angle) => {
                    let before: usize = angle_seen[angle as usize];
                    if before != usize::MAX {
                        other_half[before] = Some(id);
                        continue;
                    }
                    angle_seen[angle as usize] = k;
                    Step::Plain(id, node)
                }
                _ => Step::Plain(id, node),
            };
            all.push(step);
        }
        all.retain(|step| !matches!(*step, Step::Plain(id, Node::Mul(..)) if fused[id as usize]));
        for step in &mut all {
            match *step {
                Step::Plain(id, Node::Sin(angle)) => {
                    *step = Step::SinCos(Angle { angle, sin: Some(id), cos: other_half[id as usize] });
                }
                Step::Plain(id, Node::Cos(angle)) => {
                    *step = Step::SinCos(Angle { angle, sin: other_half[id as usize], cos: Some(id) });
                }
                _ => {}
            }
        }
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
        steps
    }

    /// Drops the steps to angles that are known at once.
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

    /// What there is to compute.
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
            }
        }
        n
    }
}

/// Marks a product as part of a step.
fn fuse(fused: &mut [bool], product: Id, step: Step) -> Step {
    fused[product as usize] = true;
    step
}

impl Function {
    /// What it computes with.
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
