//! Vector registers for the dense kernels, and the choice of those that this machine has.

use condyle_spatial::Scalar;
#[cfg(target_arch = "x86_64")]
use condyle_spatial::block::Block;
#[cfg(target_arch = "x86_64")]
use condyle_spatial::lanes::{Kernel, Lanes};
#[cfg(target_arch = "x86_64")]
use condyle_spatial::level::{Level, level};

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
    fn transpose(rows: &mut [Self]) {
        let (a, b) = (rows[0].0, rows[1].0);
        (rows[0], rows[1]) = (Self([a[0], b[0]]), Self([a[1], b[1]]));
    }
}

#[cfg(target_arch = "x86_64")]
macro_rules! lanes {
    ($($n:literal)*) => {$(
        impl Vector for Lanes<f64, $n> {
            const N: usize = $n;

            #[inline(always)]
            fn load(x: &[f64]) -> Self {
                let mut numbers = [0.0; $n];
                numbers.copy_from_slice(&x[..$n]);
                Self::from_array(numbers)
            }
            #[inline(always)]
            fn store(self, x: &mut [f64]) {
                x[..$n].copy_from_slice(&self.to_array());
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
            fn transpose(rows: &mut [Self]) {
                Block::transpose(rows);
            }
        }
    )*};
}
#[cfg(target_arch = "x86_64")]
lanes!(4 8);

/// Work on dense matrices, generic over the registers and over the columns of a tile, NR, that suit their number.
pub(crate) trait Dense: Sized {
    fn run<V: Vector, const NR: usize>(self);
}

/// Runs `work` with the vector instructions in use (see [`level`]).
#[cfg(target_arch = "x86_64")]
pub(crate) fn at_level(work: impl Dense) {
    struct At<W, const N: usize>(W);
    macro_rules! kernel {
        ($n:literal, $nr:literal) => {
            impl<W: Dense> Kernel for At<W, $n> {
                #[inline(always)]
                fn run(self) {
                    self.0.run::<Lanes<f64, $n>, $nr>();
                }
                #[inline(always)]
                fn run_fused(self) {
                    self.run();
                }
            }
        };
    }
    kernel!(4, 4);
    kernel!(8, 8);
    match level() {
        Level::Avx512 => Lanes::<f64, 8>::enter(At::<_, 8>(work)),
        Level::Avx2 => Lanes::<f64, 4>::enter(At::<_, 4>(work)),
        Level::Baseline => work.run::<Pair, 4>(),
    }
}

/// Runs `work` with the vector instructions that every processor has.
#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn at_level(work: impl Dense) {
    work.run::<Pair, 4>();
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
