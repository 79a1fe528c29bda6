//! Steps of a function, each computed by one line of code.

use crate::graph::{Id, Node};

/// Step of a function.
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
    /// A loop that computes several entries.
    Entries(Entries),
}

impl Step {
    /// Returns the values that it computes.
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

    /// Returns the values that it uses.
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

/// Sums Σ ± eachₖ common for each k.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entries {
    /// The sums, which no other value uses.
    pub ids: Vec<Id>,
    /// Index of the first sum among all results; the other sums follow.
    pub first: usize,
    /// Terms; the first one is added, not subtracted.
    pub terms: Vec<Term>,
}

/// Term of each sum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    /// Whether the term is subtracted.
    pub minus: bool,
    /// The term's value in each sum. These values are adjacent in the work space.
    pub each: Vec<Id>,
    /// Factor of the term in all sums. The first term may have none.
    pub common: Option<Id>,
}
