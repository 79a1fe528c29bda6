//! A step of a function: what a line of code computes.

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
    /// A loop.
    Entries(Entries),
}

impl Step {
    /// The values that it computes.
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

    /// The values from which it computes them.
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

/// An angle, with its sine and its cosine where they are needed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Angle {
    pub angle: Id,
    pub sin: Option<Id>,
    pub cos: Option<Id>,
}

/// Sums Σ ± eachₖ common for each k.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entries {
    /// The sums, from which nothing is computed.
    pub ids: Vec<Id>,
    /// The place of the first one among all results; the others follow.
    pub first: usize,
    /// The first one is added.
    pub terms: Vec<Term>,
}

/// A term of each sum.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Term {
    /// Whether it is subtracted.
    pub minus: bool,
    /// The value in each sum. These values follow one another in the work space.
    pub each: Vec<Id>,
    /// What it is multiplied by in all sums. The first term may be values alone.
    pub common: Option<Id>,
}
