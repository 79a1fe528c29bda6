//! Arrays that form the workspaces of passes.
//!
//! Each pass defines its own workspace by `workspace!`, in the file of the pass. The comment of each field gives the
//! frame and shape of its numbers, and the functions that write them. A workspace consists of arrays and matrices whose
//! numbers can be read as `f64` or as `FusedF64`; the compiler checks this.

use condyle_model::Model;
use condyle_spatial::gate::{self, SimdToken};
use condyle_spatial::{Array, Matrix, Scalar, matrix};

/// Marker type that gives this crate access to the vector types of `gate`.
pub(crate) struct Gate;

// SAFETY: vectors are created and used only in kernels, which are called through their entry functions, and in
// functions that select the vectors of the current SIMD level.
#[allow(unsafe_code)]
unsafe impl SimdToken for Gate {}

/// Vector of four numbers, for AVX2, NEON or SIMD128.
pub(crate) type Narrow = gate::Narrow<Gate>;
/// Vector of eight numbers, for AVX-512; on other processors the same as `Narrow`.
pub(crate) type Wide = gate::Wide<Gate>;

/// Sizes of the arrays of a workspace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    /// Number of bodies, including the world.
    pub bodies: usize,
    /// Number of degrees of freedom of all joints.
    pub columns: usize,
    /// Number of columns on the longest path from the root.
    pub depth: usize,
    /// Number of bodies on the longest path from the root, including the world.
    pub body_depth: usize,
    /// Number of coordinates.
    pub nv: usize,
}

impl Size {
    /// Returns the sizes for a model.
    pub(crate) fn new<R>(model: &Model<R>) -> Self {
        Self {
            bodies: model.nodes().len(),
            columns: model.columns().len(),
            depth: model.columns().iter().map(|c| c.depth + 1).max().unwrap_or(0),
            body_depth: model.nodes().iter().map(|n| n.body_depth + 1).max().unwrap_or(1),
            nv: model.nv(),
        }
    }
}

/// Returns an array of n equal entries. A workspace has dozens of arrays. Therefore the function is not inlined and
/// calls `entry` itself, which keeps the code of `new` short. The function copies each entry as a whole, whereas `vec!`
/// would clone an entry number by number.
#[inline(never)]
pub(crate) fn filled<T: Copy>(entry: impl Fn() -> T, n: usize) -> Array<T> {
    let entry = entry();
    (0..n).map(|_| entry).collect()
}

/// Returns a matrix of zeros.
#[inline(never)]
pub(crate) fn zero_matrix<S: Scalar>(rows: usize, columns: usize) -> Matrix<S> {
    matrix(rows, columns, S::zero())
}

/// Defines a workspace. Each field has a type and an initial value. The value may use the sizes of a model and earlier
/// fields. Fields after `same` do not depend on the scalar. The macro defines the struct, the function `new`, and the
/// check that numbers may be read as `f64` or as `FusedF64` ([`same_layout!`](condyle_spatial::same_layout)).
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

        condyle_spatial::same_layout!($Workspace { $($field),* } $(same { $($same),* })?);

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
