//! Conversion between rows of numbers and SIMD vectors: one row per lane, one vector per column.
//!
//! With L lanes, L rows of L numbers are loaded into L vectors and transposed. The transposition takes log₂ L steps. In
//! each step, a vector keeps one half of its numbers and takes the other half from another vector. The exchanged blocks
//! grow from step to step.
#![allow(unsafe_code)]

use crate::algebra::motion::Force;
use crate::scalar::Scalar;
use crate::simd::kernel::Kernel;
use crate::simd::lanes::{self, Element, Lanes};

/// Scalar that consists of several lanes, or of one number.
pub trait Block: Scalar {
    /// Number type of a lane.
    type Number: Scalar;

    /// Loads the first `LANES` numbers of a slice, one per lane.
    fn load(from: &[Self::Number]) -> Self;
    /// Writes the number of each lane.
    fn store(self, to: &mut [Self::Number]);
    /// Loads a slice of at most `LANES` numbers, one per lane; the other lanes are 0.
    fn load_first(from: &[Self::Number]) -> Self;
    /// Writes the numbers of the first lanes to a slice of at most `LANES` numbers.
    fn store_first(self, to: &mut [Self::Number]);
    /// Transposes `LANES` vectors: number i of vector k becomes number k of vector i.
    fn transpose(rows: &mut [Self]);
}

/// Converts rows of numbers to vectors: number i of row k becomes lane k of `to[i]`. The rows are stored one after
/// another in `from`, and each row is as long as `to`. If there are fewer rows than lanes, the last row fills the
/// remaining lanes.
#[inline]
pub fn gather<S: Block>(from: &[S::Number], rows: usize, to: &mut [S]) {
    let (n, mut each) = (to.len(), [&from[..0]; MOST]);
    for (k, row) in each[..rows].iter_mut().enumerate() {
        *row = &from[k * n..][..n];
    }
    gather_rows(&each[..rows], to);
}

/// Converts rows of numbers to vectors as [`gather`] does. The rows may be anywhere in memory, and they may be longer
/// than `to`.
#[inline]
pub fn gather_rows<S: Block>(from: &[&[S::Number]], to: &mut [S]) {
    if S::LANES == 1 {
        let from = &from[0][..to.len()];
        for (i, to) in to.iter_mut().enumerate() {
            *to = S::load(&from[i..]);
        }
        return;
    }
    S::enter(Gather(from, to));
}

/// Converts vectors to rows of numbers: lane k of `from[i]` becomes number i of row k, for the first `rows` lanes.
#[inline]
pub fn scatter<S: Block>(from: &[S], rows: usize, to: &mut [S::Number]) {
    let mut each: [&mut [S::Number]; MOST] = Default::default();
    if !from.is_empty() {
        for (row, to) in each.iter_mut().zip(to.chunks_exact_mut(from.len()).take(rows)) {
            *row = to;
        }
        scatter_rows(from, &mut each[..rows]);
    }
}

/// Converts vectors to rows of numbers as [`scatter`] does. The rows may be anywhere in memory.
#[inline]
pub fn scatter_rows<S: Block>(from: &[S], to: &mut [&mut [S::Number]]) {
    let columns = from.len();
    scatter_matrix(
        &Strided { vectors: from, strides: [columns, 1], shape: [1, columns], negative: false },
        to,
        columns,
    );
}

/// Writes lane k of a matrix of vectors to `to[k]`, as a matrix of numbers, row by row. `stride` is the distance
/// between the starts of consecutive rows.
#[inline]
pub fn scatter_matrix<S: Block>(from: &Strided<'_, S>, to: &mut [&mut [S::Number]], stride: usize) {
    let columns = from.shape[1];
    let is_one_row = stride == columns && from.shape[0] * columns >= S::LANES;
    if size_of::<S>() == MASKED && columns < S::LANES && !is_one_row {
        return S::enter(ScatterShort(*from, to, stride));
    }
    S::enter(Scatter(*from, to, stride));
}

/// Size of the vectors that can store some of their lanes with one instruction (bytes): vectors of AVX-512.
const MASKED: usize = 64;

/// Matrix whose entries are vectors, stored with strides and with a sign.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a, S> {
    /// Slice of vectors that contains all entries.
    pub vectors: &'a [S],
    /// Distance from one row to the next, and distance from one column to the next.
    pub strides: [usize; 2],
    /// Number of rows and number of columns.
    pub shape: [usize; 2],
    /// Whether the value of the matrix is minus the stored matrix.
    pub negative: bool,
}

struct Gather<'a, S: Block>(&'a [&'a [S::Number]], &'a mut [S]);

impl<S: Block> Kernel for Gather<'_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(from, to) = self;
        let n = to.len();
        let row = |k: usize| from[k.min(from.len() - 1)];
        if n < S::LANES {
            let mut block = [S::zero(); MOST];
            for k in 0..S::LANES {
                block[k] = S::load_first(&row(k)[..n]);
            }
            S::transpose(&mut block[..S::LANES]);
            to.copy_from_slice(&block[..n]);
            return;
        }
        let mut i = 0;
        loop {
            for k in 0..S::LANES {
                to[i + k] = S::load(&row(k)[i..][..S::LANES]);
            }
            S::transpose(&mut to[i..i + S::LANES]);
            if i + S::LANES >= n {
                return;
            }
            i = (i + S::LANES).min(n - S::LANES); // the last tile overlaps the tile before it
        }
    }
}

/// Writes lane k of the `LANES` vectors of a tile to `to[k][at..]`; if `negative` is set, with the opposite sign.
///
/// # Safety
/// Each slice in `to` has at least `LANES` numbers from index `at` on.
#[inline(always)]
unsafe fn write_tile<S: Block>(mut tile: [S; MOST], negative: bool, to: &mut [&mut [S::Number]], at: usize) {
    if negative {
        for k in 0..S::LANES {
            tile[k] = -tile[k];
        }
    }
    S::transpose(&mut tile[..S::LANES]);
    let write = |to: &mut &mut [S::Number], x: S| {
        debug_assert!(at + S::LANES <= to.len());
        // SAFETY: the caller guarantees that the slice has `LANES` numbers from index `at` on.
        x.store(unsafe { to.get_unchecked_mut(at..at + S::LANES) });
    };
    if to.len() == S::LANES {
        for k in 0..S::LANES {
            write(&mut to[k], tile[k]); // writes the vector from its register
        }
    } else {
        let in_memory = tile;
        to.iter_mut().zip(in_memory).for_each(|(to, x)| write(to, x));
    }
}

struct Scatter<'a, 'b, S: Block>(Strided<'a, S>, &'a mut [&'b mut [S::Number]], usize);

impl<S: Block> Kernel for Scatter<'_, '_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(Strided { vectors: from, strides: [down, along], shape: [rows, columns], negative }, to, stride) =
            self;
        if rows == 0 || columns == 0 || to.is_empty() {
            return;
        }
        if S::LANES == 1 && along == 1 && !negative {
            for i in 0..rows {
                to[0][i * stride..][..columns].copy_from_slice(lanes(&from[i * down..][..columns]));
            }
            return;
        }
        let mut block = [S::zero(); MOST];
        let last = |down: usize, along: usize| {
            let (down, along) = ((rows - 1).checked_mul(down)?, (columns - 1).checked_mul(along)?);
            down.checked_add(along)
        };
        let fits = |last: Option<usize>, length: usize| last.is_some_and(|last| last < length);
        let (entry, place) = (last(down, along), last(stride, 1));
        assert!(fits(entry, from.len()), "a matrix ends before its last entry");
        assert!(
            to.len() <= S::LANES && to.iter().all(|to| fits(place, to.len())),
            "a target ends before the last entry"
        );
        let mut offsets = [0; MOST]; // offsets of the vectors of a tile
        if columns < S::LANES && stride == columns && rows * columns >= S::LANES {
            // Rows that are short and have no gaps between them are treated as one long row. Each tile except the last
            // begins at the start of a row.
            let mut walk = |mut i: usize, mut j: usize| {
                for k in 0..S::LANES {
                    offsets[k] = i * down + j * along;
                    j += 1;
                    if j == columns {
                        (i, j) = (i + 1, 0);
                    }
                }
                offsets
            };
            let (n, mut tile) = (rows * columns, walk(0, 0));
            let (mut i, mut first) = (0, 0);
            loop {
                for k in 0..S::LANES {
                    // SAFETY: the tile does not reach beyond the last entry, and the last entry exists.
                    block[k] = *unsafe { from.get_unchecked(i * down + tile[k]) };
                }
                // SAFETY: the tile does not reach beyond the last entry, which has a slot in each slice of `to`.
                unsafe { write_tile(block, negative, to, first) };
                if first + S::LANES >= n {
                    return;
                }
                i += S::LANES / columns;
                first = i * columns;
                if first + S::LANES > n {
                    first = n - S::LANES; // the last tile overlaps the tile before it
                    (i, tile) = (0, walk(first / columns, first % columns));
                }
            }
        }
        if columns < S::LANES {
            let mut numbers = [S::Number::zero(); MOST];
            for i in 0..rows {
                for j in 0..columns {
                    let x = from[i * down + j * along];
                    let x = if negative { -x } else { x };
                    x.store(&mut numbers);
                    for (k, to) in to.iter_mut().enumerate() {
                        to[i * stride + j] = numbers[k];
                    }
                }
            }
            return;
        }
        // SAFETY: the last entry exists and has a slot in `to`, and there are at least as many columns as lanes.
        unsafe {
            match along {
                1 => write_rows::<S, true>(self.0, to, stride),
                _ => write_rows::<S, false>(self.0, to, stride),
            }
        }
    }
}

/// Copy of a matrix whose rows are shorter than a vector.
struct ScatterShort<'a, 'b, S: Block>(Strided<'a, S>, &'a mut [&'b mut [S::Number]], usize);

impl<S: Block> Kernel for ScatterShort<'_, '_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(Strided { vectors: from, strides: [down, along], shape: [rows, columns], negative }, to, stride) =
            self;
        for i in 0..rows {
            let mut tile = [S::zero(); MOST];
            for j in 0..columns {
                let x = from[i * down + j * along];
                tile[j] = if negative { -x } else { x };
            }
            S::transpose(&mut tile[..S::LANES]);
            for (to, x) in to.iter_mut().zip(tile) {
                x.store_first(&mut to[i * stride..][..columns]);
            }
        }
    }
}

/// Writes a matrix. `BESIDE` says whether consecutive columns are adjacent in memory.
///
/// # Safety
/// The matrix has at least as many columns as a vector has lanes. Its last entry exists and has a slot in each slice of
/// `to`.
#[inline(always)]
unsafe fn write_rows<S: Block, const BESIDE: bool>(of: Strided<'_, S>, to: &mut [&mut [S::Number]], stride: usize) {
    let Strided { vectors, strides: [down, along], shape: [rows, columns], negative } = of;
    let (mut block, mut offsets) = ([S::zero(); MOST], [0; MOST]);
    for k in 0..S::LANES {
        offsets[k] = k * along;
    }
    // Tiles of a long row begin at a cache line, because a store across two cache lines takes longer. Only the first
    // tile may begin elsewhere and overlap the next tile. A matrix of several rows has no such alignment.
    let beyond_line = to[0].as_ptr().addr() / size_of::<S::Number>() % S::LANES;
    let mut shared = if rows == 1 && columns >= 2 * S::LANES { beyond_line } else { 0 };
    for i in 0..rows {
        let mut j = 0;
        loop {
            let first = i * down + j * if BESIDE { 1 } else { along };
            for k in 0..S::LANES {
                // SAFETY: row i < rows, and column j + k < columns.
                block[k] = *unsafe { vectors.get_unchecked(first + if BESIDE { k } else { offsets[k] }) };
            }
            // SAFETY: entries (i, j) to (i, j + LANES − 1) exist and have slots in each slice of `to`.
            unsafe { write_tile(block, negative, to, i * stride + j) };
            if j + S::LANES >= columns {
                break;
            }
            j = (j + S::LANES - shared).min(columns - S::LANES); // the last tile overlaps the tile before it
            shared = 0;
        }
    }
}

/// Returns the numbers in the lanes of vectors, one vector after another.
pub fn lanes<S: Block>(of: &[S]) -> &[S::Number] {
    assert!(size_of::<S>() == S::LANES * size_of::<S::Number>());
    // SAFETY: a vector consists only of its numbers, as the assertion checks, and is aligned at least as strictly as a
    // number.
    unsafe { core::slice::from_raw_parts(of.as_ptr().cast(), of.len() * S::LANES) }
}

/// Reinterprets forces as numbers, six per force.
pub fn flat<S>(forces: &[Force<S>]) -> &[S] {
    // SAFETY: a force is `repr(C)` and consists of two `repr(C)` vectors of three numbers each: six numbers and nothing
    // else.
    unsafe { core::slice::from_raw_parts(forces.as_ptr().cast(), 6 * forces.len()) }
}

/// Reinterprets mutable forces as numbers, six per force.
pub fn flat_mut<S>(forces: &mut [Force<S>]) -> &mut [S] {
    // SAFETY: as for `flat`.
    unsafe { core::slice::from_raw_parts_mut(forces.as_mut_ptr().cast(), 6 * forces.len()) }
}

/// Maximum number of lanes of a vector.
pub const MOST: usize = 16;

macro_rules! single {
    ($($float:ident),*) => {$(
        impl Block for $float {
            type Number = Self;
            #[inline(always)]
            fn load(from: &[Self]) -> Self {
                from[0]
            }
            #[inline(always)]
            fn store(self, to: &mut [Self]) {
                to[0] = self;
            }
            #[inline(always)]
            fn load_first(from: &[Self]) -> Self {
                from.first().copied().unwrap_or_default()
            }
            #[inline(always)]
            fn store_first(self, to: &mut [Self]) {
                if let Some(first) = to.first_mut() {
                    *first = self;
                }
            }
            #[inline(always)]
            fn transpose(_: &mut [Self]) {}
        }
    )*};
}
single!(f64, f32);

impl<T: Element<N>, const N: usize> Block for Lanes<T, N> {
    type Number = T;
    #[inline(always)]
    fn load(from: &[T]) -> Self {
        Self::from_array(*from.first_chunk().expect("a number for each lane"))
    }
    #[inline(always)]
    fn store(self, to: &mut [T]) {
        *to.first_chunk_mut().expect("a slot for each lane") = self.to_array();
    }
    #[inline(always)]
    fn load_first(from: &[T]) -> Self {
        Self::load_first(from)
    }
    #[inline(always)]
    fn store_first(self, to: &mut [T]) {
        Self::store_first(self, to);
    }
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        Self::transpose(rows.try_into().expect("a row for each lane"));
    }
}

/// Unsafe marker trait. Vector types have a type parameter that implements this trait, so code without a type that
/// implements the trait cannot name vector types. A processor may lack the instructions of vector operations, and the
/// operations do not check this. [`Scalar::enter`], which calls code that is generic over the scalar, checks this.
///
/// ```compile_fail
/// use condyle_spatial::{Scalar, block::Real};
/// type Eight = <f64 as Real>::Wide<()>; // the promise was not made
/// let sum = Eight::splat(1.0) + Eight::splat(2.0);
/// ```
///
/// ```compile_fail
/// let four = condyle_spatial::lanes::Lanes::<f64, 4>::from_array([1.0; 4]);
/// ```
///
/// ```compile_fail
/// let four = condyle_spatial::Constant::lift([1.0; 4]); // of no type in particular
/// ```
///
/// ```compile_fail
/// let four = condyle_spatial::moves::sum(condyle_spatial::Scalar::splat(1.0));
/// ```
///
/// # Safety
/// The implementing crate uses vectors only where the processor has their instructions: in kernels that were entered
/// through `Scalar::enter`, and in functions that were called at the SIMD level of the vectors.
pub unsafe trait SimdToken: 'static {}

/// Number type for which vector types exist.
pub trait Real: Block<Number = Self> {
    /// Vector of [`Level::Avx2`](crate::simd::level::Level::Avx2), [`Level::Neon`](crate::simd::level::Level::Neon) or
    /// [`Level::Simd128`](crate::simd::level::Level::Simd128).
    type Narrow<W: SimdToken>: Block<Number = Self>;
    /// Vector of [`Level::Avx512`](crate::simd::level::Level::Avx512), or the same as `Narrow` where this level does
    /// not exist.
    type Wide<W: SimdToken>: Block<Number = Self>;
}

impl Real for f64 {
    type Narrow<W: SimdToken> = Lanes<Self, 4>;
    type Wide<W: SimdToken> = lanes::WideF64;
}
impl Real for f32 {
    type Narrow<W: SimdToken> = Lanes<Self, 8>;
    type Wide<W: SimdToken> = lanes::WideF32;
}
