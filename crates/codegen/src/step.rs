//! Steps of a function. One line of code computes each step.

use crate::graph::{Id, Node};

/// Step of a function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Step {
    /// Computation of a value by one operation of the graph.
    Plain(Id, Node),
    /// Computation of a b + c. The array holds the operands a, b and c, in this order.
    MulAdd(Id, [Id; 3]),
    /// Computation of a b − c. The array holds the operands a, b and c, in this order.
    MulSub(Id, [Id; 3]),
    /// Computation of c − a b. The array holds the operands a, b and c, in this order.
    SubMul(Id, [Id; 3]),
    /// Computation of the sine and the cosine of an angle.
    SinCos(Angle),
    /// A loop that computes several entries.
    Entries(Entries),
}

impl Step {
    /// Returns the values that the step computes.
    pub(crate) fn makes(&self) -> impl Iterator<Item = Id> {
        let (few, many) = match *self {
            Self::Plain(id, _) | Self::MulAdd(id, _) | Self::MulSub(id, _) | Self::SubMul(id, _) => {
                ([Some(id), None], &[][..])
            }
            Self::SinCos(Angle { sin, cos, .. }) => ([sin, cos], &[][..]),
            Self::Entries(ref entries) => ([None; 2], &entries.ids[..]),
        };
        few.into_iter().flatten().chain(many.iter().copied())
    }

    /// Returns the values that the step uses.
    pub(crate) fn takes(&self) -> impl Iterator<Item = Id> {
        let (few, many) = match *self {
            Self::Plain(_, node) => {
                let mut operands = node.operands();
                ([operands.next(), operands.next(), operands.next()], &[][..])
            }
            Self::MulAdd(_, abc) | Self::MulSub(_, abc) | Self::SubMul(_, abc) => (abc.map(Some), &[][..]),
            Self::SinCos(Angle { angle, .. }) => ([Some(angle), None, None], &[][..]),
            Self::Entries(ref entries) => ([None; 3], &entries.terms[..]),
        };
        few.into_iter().flatten().chain(many.iter().flat_map(|term| term.each.iter().copied().chain(term.common)))
    }
}

/// Angle, with the values of its sine and its cosine if a step needs them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle {
    pub angle: Id,
    pub sin: Option<Id>,
    pub cos: Option<Id>,
}

/// Loop over an index k. For each k, the loop computes the sum Σ ± `each`ₖ · `common` over all terms.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entries {
    /// Computed sums. No step uses these values.
    pub ids: Vec<Id>,
    /// Index of the first sum among all results. The other sums are the results that follow directly.
    pub first: usize,
    /// Terms of the sums. The first term is added, not subtracted.
    pub terms: Vec<Term>,
}

/// Term of each sum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    /// Whether the term is subtracted.
    pub minus: bool,
    /// Individual factor of the term in each sum. These factors are adjacent in the work space.
    pub each: Vec<Id>,
    /// Factor of the term that all sums have in common. The first term may lack a common factor.
    pub common: Option<Id>,
}
