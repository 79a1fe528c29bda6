//! Vector registers for the dense kernels, and selection of the registers that this machine has.

use condyle_spatial::Scalar;
use condyle_spatial::block::{Block, Real, SimdToken};
use condyle_spatial::level::{Level, level};
use condyle_spatial::simd::Kernel;
use core::marker::PhantomData;

/// Register of [`Level::Avx512`]. On other processors, `Wide` is the same type as `Narrow`.
pub(crate) type Wide = <f64 as Real>::Wide<Gate>;
/// Register of [`Level::Avx2`], [`Level::Neon`] or [`Level::Simd128`].
pub(crate) type Narrow = <f64 as Real>::Narrow<Gate>;

/// Token of this crate, with which the crate may name register types.
pub(crate) struct Gate;

// SAFETY: registers are used only in functions that are called at the level of the registers, and in kernels entered
// through `enter`.
#[allow(unsafe_code)]
unsafe impl SimdToken for Gate {}

/// Register of N numbers.
pub trait Vector: Copy {
    /// Number of `f64` numbers in a register.
    const N: usize;

    /// Loads the first N numbers of `x`.
    fn load(x: &[f64]) -> Self;
    /// Writes the first N numbers of `x`.
    fn store(self, x: &mut [f64]);
    /// Returns x in every lane.
    fn splat(x: f64) -> Self;
    /// Returns self · b + c, fused if the processor supports it.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Returns self + b.
    fn add(self, b: Self) -> Self;
    /// Returns self − b.
    fn sub(self, b: Self) -> Self;
    /// Returns self · b.
    fn mul(self, b: Self) -> Self;
    /// Transposes N registers: number i of register k becomes number k of register i.
    fn transpose(rows: &mut [Self]);
}

/// Two numbers, which the compiler keeps in a register that every processor has.
#[derive(Clone, Copy)]
pub(crate) struct Pair([f64; 2]);

impl Vector for Pair {
    const N: usize = 2;

    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        Self([x[0], x[1]])
    }
    #[inline(always)]
    fn store(self, x: &mut [f64]) {
        let x = &mut x[..2];
        (x[0], x[1]) = (self.0[0], self.0[1]); // `copy_from_slice` may call memmove
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 2])
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let fused = |k: usize| Scalar::mul_add(self.0[k], b.0[k], c.0[k]);
        Self([fused(0), fused(1)])
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Self([self.0[0] + b.0[0], self.0[1] + b.0[1]])
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Self([self.0[0] - b.0[0], self.0[1] - b.0[1]])
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Self([self.0[0] * b.0[0], self.0[1] * b.0[1]])
    }
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        let (a, b) = (rows[0].0, rows[1].0);
        (rows[0], rows[1]) = (Self([a[0], b[0]]), Self([a[1], b[1]]));
    }
}

impl<S: Block<Number = f64>> Vector for S {
    const N: usize = S::LANES;

    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        Block::load(x)
    }
    #[inline(always)]
    fn store(self, x: &mut [f64]) {
        Block::store(self, x);
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Scalar::splat(x)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Scalar::mul_add(self, b, c)
    }
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        self + b
    }
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        self - b
    }
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        self * b
    }
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        Block::transpose(rows);
    }
}

/// Function with vector loops, generic over the register type; the value holds its arguments. [`at_level`] runs it.
pub trait Vectorized: Sized {
    /// Runs the loops. `run` must be `#[inline(always)]`, and so must each function that `run` calls with registers.
    /// Then all of this code is compiled for the instructions of the function in which [`at_level`] calls `run`.
    fn run<V: Vector>(self);
}

/// Runs `work` with the vector instructions in use (see [`level`]).
///
/// ```
/// use condyle_linalg::{Vector, Vectorized, at_level};
///
/// /// x ← 2 x on eight numbers.
/// struct Double<'a>(&'a mut [f64; 8]);
///
/// impl Vectorized for Double<'_> {
///     #[inline(always)]
///     fn run<V: Vector>(self) {
///         for part in self.0.chunks_exact_mut(V::N) {
///             V::load(part).mul(V::splat(2.0)).store(part);
///         }
///     }
/// }
///
/// let mut x = [1.5; 8];
/// at_level(Double(&mut x));
/// assert_eq!(x, [3.0; 8]);
/// ```
pub fn at_level(work: impl Vectorized) {
    match level() {
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => Wide::enter(On::<_, Wide>(work, PhantomData)),
        _ => at_narrow_level(work),
    }
}

/// Runs `work` as [`at_level`] does, with registers of at most four numbers. Such registers suit loops that mostly copy
/// rows, because many rows are shorter than eight numbers.
pub fn at_narrow_level(work: impl Vectorized) {
    match level() {
        Level::Baseline => work.run::<Pair>(),
        _ => Narrow::enter(On::<_, Narrow>(work, PhantomData)),
    }
}

/// Adapter that runs a `Vectorized` value on registers of type V as a [`Kernel`].
struct On<W, V>(W, PhantomData<V>);

impl<W: Vectorized, V: Vector> Kernel for On<W, V> {
    #[inline(always)]
    fn run(self) {
        self.0.run::<V>();
    }
}
