//! Constraints with names that a robot's file has beside its tree: loops that two bodies close, and coupled joints.

use alloc::string::String;

/// Constraint beside the tree of a model. The algorithms of a tree do not know it; constrained dynamics takes it where a caller
/// asks for it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModelConstraint {
    /// Name.
    pub name: String,
    /// Motion that it holds.
    pub kind: ModelConstraintKind,
}

/// Motion that a [`ModelConstraint`] holds.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ModelConstraintKind {
    /// The origins of two frames coincide: three rows.
    Point {
        /// Indices of the frames.
        frames: [usize; 2],
    },
    /// Two frames coincide: six rows.
    Rigid {
        /// Indices of the frames.
        frames: [usize; 2],
    },
    /// The position of a joint is a polynomial of another one's, q_f = Σ cᵢ q_lⁱ; without a leader it is c₀.
    Coupling {
        /// Index of the body whose joint follows.
        follower: usize,
        /// Index of the body whose joint leads.
        leader: Option<usize>,
        /// Coefficients c₀ to c₄.
        coefficients: [f64; 5],
    },
}
