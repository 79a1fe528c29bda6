//! Graph of a recording. The graph contains each value once. Each value is simplified when it is recorded.
//!
//! Two formulas for the same value often become one entry of the graph, because the graph uses a normal form. Operands
//! of sums and products are sorted, and a minus sign moves from a product to the sum that uses the product. Operations
//! on constants are computed during recording. A product with 0 is 0, even if the other factor is infinite or NaN.

use rustc_hash::FxHashMap;
use std::collections::hash_map::Entry;

/// Index of a value in the graph, in recording order.
pub(crate) type Id = u32;

/// Index of the number 0, the first value of every graph; as a mask, false.
pub(crate) const ZERO: Id = 0;
/// Index of the number 1, the second value of every graph; as a mask, true.
pub(crate) const ONE: Id = 1;

/// Operation that computes a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Node {
    /// Constant, stored as the bits of the `f64`.
    Constant(u64),
    /// Input, stored as its index among the numbers of all arguments.
    Input(u32),
    Add(Id, Id),
    Sub(Id, Id),
    Mul(Id, Id),
    Div(Id, Id),
    Neg(Id),
    /// Negated value −a whose minus sign must not move to a later operation.
    Minus(Id),
    Sqrt(Id),
    Sin(Id),
    Cos(Id),
    /// Angle of the point (x, y). The first operand is y, the second is x.
    Atan2(Id, Id),
    Abs(Id),
    /// Mask that is true if the first operand is less than the second.
    Less(Id, Id),
    And(Id, Id),
    Or(Id, Id),
    /// Second operand if the mask (first operand) is true, otherwise the third operand.
    Select(Id, Id, Id),
}

impl Node {
    pub(crate) fn constant(x: f64) -> Self {
        Self::Constant(x.to_bits())
    }

    /// Returns the values from which this value is computed.
    pub(crate) fn operands(self) -> impl DoubleEndedIterator<Item = Id> {
        let (n, all) = match self {
            Self::Constant(_) | Self::Input(_) => (0, [0; 3]),
            Self::Neg(a) | Self::Minus(a) | Self::Sqrt(a) | Self::Sin(a) | Self::Cos(a) | Self::Abs(a) => {
                (1, [a, 0, 0])
            }
            Self::Select(m, a, b) => (3, [m, a, b]),
            Self::Add(a, b) | Self::Sub(a, b) | Self::Mul(a, b) | Self::Div(a, b) => (2, [a, b, 0]),
            Self::Atan2(a, b) | Self::Less(a, b) | Self::And(a, b) | Self::Or(a, b) => (2, [a, b, 0]),
        };
        all.into_iter().take(n)
    }

    /// Returns the same operation with other operands.
    pub(crate) fn renamed(self, to: impl Fn(Id) -> Id) -> Self {
        match self {
            Self::Constant(_) | Self::Input(_) => self,
            Self::Add(a, b) => Self::Add(to(a), to(b)),
            Self::Sub(a, b) => Self::Sub(to(a), to(b)),
            Self::Mul(a, b) => Self::Mul(to(a), to(b)),
            Self::Div(a, b) => Self::Div(to(a), to(b)),
            Self::Neg(a) => Self::Neg(to(a)),
            Self::Minus(a) => Self::Minus(to(a)),
            Self::Sqrt(a) => Self::Sqrt(to(a)),
            Self::Sin(a) => Self::Sin(to(a)),
            Self::Cos(a) => Self::Cos(to(a)),
            Self::Atan2(a, b) => Self::Atan2(to(a), to(b)),
            Self::Abs(a) => Self::Abs(to(a)),
            Self::Less(a, b) => Self::Less(to(a), to(b)),
            Self::And(a, b) => Self::And(to(a), to(b)),
            Self::Or(a, b) => Self::Or(to(a), to(b)),
            Self::Select(m, a, b) => Self::Select(to(m), to(a), to(b)),
        }
    }

    /// Returns whether the value is a mask.
    pub(crate) fn is_mask(self) -> bool {
        matches!(self, Self::Less(..) | Self::And(..) | Self::Or(..))
    }
}

/// Values of a recording, in recording order.
#[derive(Debug)]
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    /// Index of each value that has been recorded. A fast hash suffices, because no caller chooses the values.
    known: FxHashMap<Node, Id>,
}

impl Graph {
    pub(crate) fn new() -> Self {
        let mut graph = Self { nodes: Vec::new(), known: FxHashMap::default() };
        graph.constant(0.0);
        graph.constant(1.0);
        graph
    }

    /// Returns the value that this operation computes. Adds the value to the graph if it is new.
    fn find(&mut self, node: Node) -> Id {
        match self.known.entry(node) {
            Entry::Occupied(found) => *found.get(),
            Entry::Vacant(place) => {
                let id = Id::try_from(self.nodes.len()).expect("a recording has at most 2³² values");
                self.nodes.push(node);
                *place.insert(id)
            }
        }
    }

    /// Returns the value that this operation computes, after simplification.
    pub(crate) fn simplified(&mut self, node: Node) -> Id {
        match node {
            Node::Constant(_) | Node::Input(_) => self.find(node),
            Node::Add(a, b) => self.add(a, b),
            Node::Sub(a, b) => self.sub(a, b),
            Node::Mul(a, b) => self.mul(a, b),
            Node::Div(a, b) => self.div(a, b),
            Node::Neg(a) => self.neg(a),
            Node::Minus(a) => {
                let minus = self.neg(a);
                self.kept(minus)
            }
            Node::Sqrt(a) => self.sqrt(a),
            Node::Sin(a) => self.sin_cos(a).0,
            Node::Cos(a) => self.sin_cos(a).1,
            Node::Atan2(y, x) => self.atan2(y, x),
            Node::Abs(a) => self.abs(a),
            Node::Less(a, b) => self.less(a, b),
            Node::And(a, b) => self.and(a, b),
            Node::Or(a, b) => self.or(a, b),
            Node::Select(mask, a, b) => self.select(mask, a, b),
        }
    }

    pub(crate) fn constant(&mut self, x: f64) -> Id {
        self.find(Node::constant(if x == 0.0 { 0.0 } else { x })) // −0 is 0
    }

    pub(crate) fn input(&mut self, place: u32) -> Id {
        self.find(Node::Input(place))
    }

    /// Returns the number if the value is a constant, otherwise `None`.
    fn value(&self, a: Id) -> Option<f64> {
        match self.nodes[a as usize] {
            Node::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// Returns x if the value is −x, otherwise `None`.
    fn negated(&self, a: Id) -> Option<Id> {
        match self.nodes[a as usize] {
            Node::Neg(x) => Some(x),
            _ => None,
        }
    }

    /// Returns a value without its minus sign, and whether the value had a minus sign.
    fn unsigned(&mut self, a: Id) -> (Id, bool) {
        match (self.negated(a), self.value(a)) {
            (Some(x), _) => (x, true),
            (None, Some(x)) if x < 0.0 => (self.constant(-x), true),
            _ => (a, false),
        }
    }

    fn signed(&mut self, a: Id, minus: bool) -> Id {
        if minus { self.neg(a) } else { a }
    }

    pub(crate) fn neg(&mut self, a: Id) -> Id {
        match (self.negated(a), self.value(a)) {
            (Some(x), _) => x,
            (None, Some(x)) => self.constant(-x),
            _ => self.find(Node::Neg(a)),
        }
    }

    /// Returns an equal value whose minus sign must not move to a later operation.
    pub(crate) fn kept(&mut self, a: Id) -> Id {
        self.negated(a).map_or(a, |x| self.find(Node::Minus(x)))
    }

    pub(crate) fn add(&mut self, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.value(a), self.value(b)) {
            return self.constant(x + y);
        }
        if let Some(rest) = self.rest_of_sum(a, b).or_else(|| self.rest_of_sum(b, a)) {
            return rest;
        }
        match (self.negated(a), self.negated(b)) {
            _ if a == ZERO => b,
            _ if b == ZERO => a,
            (Some(a), Some(b)) => {
                let sum = self.add(a, b);
                self.neg(sum)
            }
            (None, Some(b)) => self.sub(a, b),
            (Some(a), None) => self.sub(b, a),
            (None, None) if a == b => {
                let two = self.constant(2.0);
                self.mul(two, a)
            }
            (None, None) => self.find(Node::Add(a.min(b), a.max(b))),
        }
    }

    /// Simplifies a + (b − a) to b.
    fn rest_of_sum(&self, a: Id, difference: Id) -> Option<Id> {
        match self.nodes[difference as usize] {
            Node::Sub(b, c) if c == a => Some(b),
            _ => None,
        }
    }

    /// Simplifies a − (a − b) and (b + a) − a to b.
    fn rest_of_difference(&self, a: Id, b: Id) -> Option<Id> {
        match (self.nodes[a as usize], self.nodes[b as usize]) {
            (_, Node::Sub(c, rest)) if c == a => Some(rest),
            (Node::Add(c, rest), _) | (Node::Add(rest, c), _) if c == b => Some(rest),
            _ => None,
        }
    }

    pub(crate) fn sub(&mut self, a: Id, b: Id) -> Id {
        if let (Some(x), Some(y)) = (self.value(a), self.value(b)) {
            return self.constant(x - y);
        }
        if let Some(rest) = self.rest_of_difference(a, b) {
            return rest;
        }
        match (self.negated(a), self.negated(b)) {
            _ if a == b => ZERO,
            _ if b == ZERO => a,
            _ if a == ZERO => self.neg(b),
            (None, Some(b)) => self.add(a, b),
            (Some(a), None) => {
                let sum = self.add(a, b);
                self.neg(sum)
            }
            (Some(a), Some(b)) => self.sub(b, a),
            (None, None) if a > b => {
                let difference = self.find(Node::Sub(b, a));
                self.neg(difference)
            }
            (None, None) => self.find(Node::Sub(a, b)),
        }
    }

    pub(crate) fn mul(&mut self, a: Id, b: Id) -> Id {
        if a == ZERO || b == ZERO {
            return ZERO;
        }
        let ((a, minus_a), (b, minus_b)) = (self.unsigned(a), self.unsigned(b));
        let product = match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => self.constant(x * y),
            (Some(x), None) => self.scale(x, a, b),
            (None, Some(y)) => self.scale(y, b, a),
            (None, None) => match self.dividend(a, b).or_else(|| self.dividend(b, a)) {
                Some(x) => x,
                None => self.find(Node::Mul(a.min(b), a.max(b))),
            },
        };
        self.signed(product, minus_a != minus_b)
    }

    /// Simplifies (x / b) b and (1 / b) x b to x.
    fn dividend(&self, a: Id, b: Id) -> Option<Id> {
        let inverse = Node::Div(ONE, b);
        match self.nodes[a as usize] {
            Node::Div(x, c) if c == b => Some(x),
            Node::Mul(x, y) if self.nodes[y as usize] == inverse => Some(x),
            Node::Mul(x, y) if self.nodes[x as usize] == inverse => Some(y),
            _ => None,
        }
    }

    /// Returns the product of the value a and the constant x, whose index in the graph is c.
    fn scale(&mut self, x: f64, c: Id, a: Id) -> Id {
        if c == ONE {
            return a;
        }
        if let Node::Mul(d, b) = self.nodes[a as usize]
            && let Some(y) = self.value(d)
        {
            let both = self.constant(x * y);
            return self.mul(both, b);
        }
        self.find(Node::Mul(c, a))
    }

    pub(crate) fn div(&mut self, a: Id, b: Id) -> Id {
        if let Some(y) = self.value(b) {
            if let Some(x) = self.value(a) {
                return self.constant(x / y);
            }
            let inverse = self.constant(1.0 / y);
            return self.mul(a, inverse);
        }
        if a == ZERO {
            return ZERO;
        }
        let ((a, minus_a), (b, minus_b)) = (self.unsigned(a), self.unsigned(b));
        let quotient = self.find(Node::Div(a, b));
        self.signed(quotient, minus_a != minus_b)
    }

    pub(crate) fn sqrt(&mut self, a: Id) -> Id {
        match self.value(a) {
            Some(x) => self.constant(x.sqrt()),
            None => self.find(Node::Sqrt(a)),
        }
    }

    pub(crate) fn sin_cos(&mut self, a: Id) -> (Id, Id) {
        let (a, minus) = self.unsigned(a);
        let (sin, cos) = match self.value(a) {
            Some(x) => (self.constant(x.sin()), self.constant(x.cos())),
            None => (self.find(Node::Sin(a)), self.find(Node::Cos(a))),
        };
        (self.signed(sin, minus), cos)
    }

    pub(crate) fn atan2(&mut self, y: Id, x: Id) -> Id {
        match (self.value(y), self.value(x)) {
            (Some(y), Some(x)) => self.constant(y.atan2(x)),
            _ => self.find(Node::Atan2(y, x)),
        }
    }

    pub(crate) fn abs(&mut self, a: Id) -> Id {
        let (a, _) = self.unsigned(a);
        match self.nodes[a as usize] {
            Node::Constant(_) | Node::Abs(_) => a,
            _ => self.find(Node::Abs(a)),
        }
    }

    pub(crate) fn less(&mut self, a: Id, b: Id) -> Id {
        match (self.value(a), self.value(b)) {
            (Some(x), Some(y)) => Id::from(x < y),
            _ if a == b => ZERO,
            _ => self.find(Node::Less(a, b)),
        }
    }

    pub(crate) fn and(&mut self, a: Id, b: Id) -> Id {
        match (a.min(b), a.max(b)) {
            (ZERO, _) => ZERO,
            (ONE, b) => b,
            (a, b) if a == b => a,
            (a, b) => self.find(Node::And(a, b)),
        }
    }

    pub(crate) fn or(&mut self, a: Id, b: Id) -> Id {
        match (a.min(b), a.max(b)) {
            (ZERO, b) => b,
            (ONE, _) => ONE,
            (a, b) if a == b => a,
            (a, b) => self.find(Node::Or(a, b)),
        }
    }

    pub(crate) fn select(&mut self, mask: Id, a: Id, b: Id) -> Id {
        match mask {
            ZERO => b,
            ONE => a,
            _ if a == b => a,
            _ => self.find(Node::Select(mask, a, b)),
        }
    }
}
