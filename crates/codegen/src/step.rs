//! Steps of a function. One line of code computes each step.

use crate::graph::{Id, Node};

/// Step of a function.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Step {
    /// A value, computed by the operation of the graph.
    Plain(Id, Node),
    /// a b + c.
    MulAdd(Id, [Id; 3]),
    /// a b − c.
    MulSub(Id, [Id; 3]),
    /// c − a b.
    SubMul(Id, [Id; 3]),
    /// The sine and the cosine of an angle.
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

/// An angle, with its sine and its cosine if they are needed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle {
    pub angle: Id,
    pub sin: Option<Id>,
    pub cos: Option<Id>,
}

/// Sums Σ ± `each`ₖ · `common` over the terms, one sum for each k.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entries {
    /// The sums. No other value uses them.
    pub ids: Vec<Id>,
    /// Index of the first sum among all results. The other sums follow directly.
    pub first: usize,
    /// Terms of each sum. The first term is added, not subtracted.
    pub terms: Vec<Term>,
}

/// Term of each sum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    /// Whether the term is subtracted.
    pub minus: bool,
    /// Value of the term in each sum. These values are adjacent in the work space.
    pub each: Vec<Id>,
    /// Common factor of the term in all sums. The first term may have no common factor.
    pub common: Option<Id>,
}
