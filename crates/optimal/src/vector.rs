//! Vector registers for the dense kernels, and the choice of those that this machine has.

use condyle_spatial::Scalar;
use condyle_spatial::block::{Block, Real};
use condyle_spatial::lanes::{Element, Lanes};
use condyle_spatial::level::{Level, level};
use condyle_spatial::simd::Kernel;
use core::marker::PhantomData;

/// N numbers in a register.
pub(crate) trait Vector: Copy {
    const N: usize;

    /// The first N numbers of `x`.
    fn load(x: &[f64]) -> Self;
    /// Into the first N numbers of `x`.
    fn store(self, x: &mut [f64]);
    /// x in every lane.
    fn splat(x: f64) -> Self;
    /// self · b + c, fused where the processor can.
    fn mul_add(self, b: Self, c: Self) -> Self;
    fn add(self, b: Self) -> Self;
    fn sub(self, b: Self) -> Self;
    fn mul(self, b: Self) -> Self;
    /// Of N registers, number i of register k becomes number k of register i.
    fn transpose(rows: &mut [Self]);
}

/// Two numbers, which the compiler keeps in a register of the kind that every processor has.
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
        x[..2].copy_from_slice(&self.0);
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

impl<const N: usize> Vector for Lanes<f64, N>
where
    f64: Element<N>,
{
    const N: usize = N;

    #[inline(always)]
    fn load(x: &[f64]) -> Self {
        let mut numbers = [0.0; N];
        numbers.copy_from_slice(&x[..N]);
        Self::from_array(numbers)
    }
    #[inline(always)]
    fn store(self, x: &mut [f64]) {
        x[..N].copy_from_slice(&self.to_array());
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

/// Work on dense matrices, generic over the registers and over the columns of a tile, NR, that suit their number.
pub(crate) trait Dense: Sized {
    fn run<V: Vector, const NR: usize>(self);
}

/// Runs `work` with the vector instructions in use (see [`level`]).
pub(crate) fn at_level(work: impl Dense) {
    struct At<W, V, const NR: usize>(W, PhantomData<V>);
    impl<W: Dense, V: Vector, const NR: usize> Kernel for At<W, V, NR> {
        #[inline(always)]
        fn run(self) {
            self.0.run::<V, NR>();
        }
        #[inline(always)]
        fn run_fused(self) {
            self.run();
        }
    }
    /// On vectors V.
    fn with<V: Vector + Scalar, const NR: usize>(work: impl Dense) {
        V::enter(At::<_, V, NR>(work, PhantomData));
    }
    match level() {
        Level::Avx512 => with::<<f64 as Real>::Long, 8>(work),
        Level::Avx2 | Level::Neon => with::<<f64 as Real>::Short, 4>(work),
        Level::Baseline => work.run::<Pair, 4>(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use condyle_spatial::level::{Level, level, pin};
    use std::sync::Mutex;

    /// The level belongs to the whole process.
    static PINNED: Mutex<()> = Mutex::new(());

    /// Runs `f` at every level of this processor.
    pub(crate) fn at_each_level(f: impl Fn()) {
        let _guard = PINNED.lock();
        let before = level();
        for level in Level::ALL.into_iter().filter(|level| level.is_supported()) {
            pin(level).unwrap();
            f();
        }
        pin(before).unwrap();
    }
}
