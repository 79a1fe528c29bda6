//! Named constraints that a robot's file has in addition to its tree: loops, which connect two bodies, and coupled
//! joints.

use alloc::string::String;

/// Constraint in addition to the tree of a model. Algorithms for trees ignore constraints. Constrained dynamics
/// enforces the loops that the caller passes to it, but not couplings.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ModelConstraint {
    /// Name of the constraint.
    pub name: String,
    /// Motion that the constraint prevents.
    pub kind: ModelConstraintKind,
}

/// Motion that a [`ModelConstraint`] prevents.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum ModelConstraintKind {
    /// The origins of two frames coincide: three rows of the constraint Jacobian.
    Point {
        /// Indices of the frames.
        frames: [usize; 2],
    },
    /// Two frames coincide: six rows of the constraint Jacobian.
    Rigid {
        /// Indices of the frames.
        frames: [usize; 2],
    },
    /// The position q_f of a joint is a polynomial in the position q_l of another joint, q_f = Σ cᵢ q_lⁱ. Without a
    /// leader, q_f is c₀.
    Coupling {
        /// Index of the body that the following joint carries.
        follower: usize,
        /// Index of the body that the leading joint carries.
        leader: Option<usize>,
        /// Coefficients c₀ to c₄.
        coefficients: [f64; 5],
    },
}
