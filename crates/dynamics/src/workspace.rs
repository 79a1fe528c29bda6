//! The arrays of which the workspaces of passes are made.
//!
//! Each pass keeps a workspace of its own, defined in its file by `workspace!`, in which each field says frame, shape and
//! writer. It is made of arrays and matrices that are read under both names of `f64`, as the compiler checks.

use condyle_model::Model;
use condyle_spatial::gate::{self, Witness};
use condyle_spatial::{Array, Matrix, Scalar, matrix};

/// The promise of this crate, by which it names vectors.
pub(crate) struct Gate;

// SAFETY: vectors are made and used in kernels that are entered through their door, and in functions that choose the vectors
// of the level in use.
#[allow(unsafe_code)]
unsafe impl Witness for Gate {}

/// Four numbers at once, with AVX2, NEON or SIMD128.
pub(crate) type Short = gate::Short<Gate>;
/// Eight numbers at once, with AVX-512; elsewhere the same as `Short`.
pub(crate) type Long = gate::Long<Gate>;

/// The sizes of the arrays of a workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Bodies, the world included.
    pub bodies: usize,
    /// Degrees of freedom of all joints.
    pub columns: usize,
    /// Columns on the longest way from the root.
    pub depth: usize,
    /// Bodies on the longest way from the root, the world included.
    pub levels: usize,
    /// Coordinates.
    pub nv: usize,
}

impl Size {
    /// The sizes for a model.
    pub(crate) fn new<R>(model: &Model<R>) -> Self {
        Self {
            bodies: model.nodes().len(),
            columns: model.columns().len(),
            depth: model.columns().iter().map(|c| c.depth + 1).max().unwrap_or(0),
            levels: model.nodes().iter().map(|n| n.level + 1).max().unwrap_or(1),
            nv: model.nv(),
        }
    }
}

/// An array of n equal entries. It is not inlined, and makes the entry itself, as a workspace has dozens of arrays; entries are
/// copied whole, where `vec!` would clone them number by number.
#[inline(never)]
pub(crate) fn filled<T: Copy>(entry: impl Fn() -> T, n: usize) -> Array<T> {
    let entry = entry();
    (0..n).map(|_| entry).collect()
}

/// A matrix of zeros.
#[inline(never)]
pub(crate) fn zero_matrix<S: Scalar>(rows: usize, columns: usize) -> Matrix<S> {
    matrix(rows, columns, S::zero())
}

/// A workspace: of each field what it is, and what it is made with, from the sizes of a model and from what stands above it;
/// behind `same`, those that do not depend on the scalar. Makes the struct, its `new`, and the check that it may be read
/// under both names of `f64` ([`alike!`](condyle_spatial::alike)).
macro_rules! workspace {
    (
        $(#[$doc:meta])*
        $vis:vis struct $Workspace:ident<$S:ident>($size:ident $(, $model:ident: &Model<$R:ident>)?) {
            $($(#[$field_doc:meta])* $field_vis:vis $field:ident: $Type:ty = $value:expr,)*
        } $(same {
            $($(#[$same_doc:meta])* $same_vis:vis $same:ident: $Same:ty = $same_value:expr,)*
        })?
    ) => {
        $(#[$doc])*
        #[derive(Clone, Debug)]
        #[repr(C)]
        $vis struct $Workspace<$S> {
            $($(#[$field_doc])* $field_vis $field: $Type,)*
            $($($(#[$same_doc])* $same_vis $same: $Same,)*)?
        }

        condyle_spatial::alike!($Workspace { $($field),* } $(same { $($same),* })?);

        impl<$S: condyle_spatial::Scalar> $Workspace<$S> {
            pub(crate) fn new$(<$R>)?($size: crate::workspace::Size $(, $model: &Model<$R>)?) -> Self {
                $(let $field: $Type = $value;)*
                $($(let $same: $Same = $same_value;)*)?
                Self { $($field,)* $($($same,)*)? }
            }
        }
    };
}
pub(crate) use workspace;
