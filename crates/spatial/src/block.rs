//! From rows of numbers, one row for each lane, to vectors, one for each place in a row, and back.
//!
//! L rows of L numbers are L vectors, and what is wanted is their transpose: log₂ L exchanges of ever larger parts, each
//! of which keeps one half of a vector and takes the other from its partner.
#![allow(unsafe_code)]

use crate::lanes::{Element, Kernel, Lanes};
use crate::motion::Force;
use crate::scalar::Scalar;

/// A scalar that is made of numbers side by side, or is one of them.
pub trait Block: Scalar {
    /// One of the numbers.
    type Number: Scalar;

    /// The first numbers of a slice, one for each lane.
    fn load(from: &[Self::Number]) -> Self;
    /// Writes the number of each lane.
    fn store(self, to: &mut [Self::Number]);
    /// Of as many vectors as there are lanes, number i of vector k becomes number k of vector i.
    fn transpose(rows: &mut [Self]);
}

/// Number i of row k becomes lane k of `to[i]`, for rows of as many numbers as `to` has, one after the other in `from`. If
/// there are fewer of them than lanes, the last one fills up.
#[inline]
pub fn gather<S: Block>(from: &[S::Number], rows: usize, to: &mut [S]) {
    S::enter(Gather(from, rows, to));
}

/// Lane k of `from[i]` becomes number i of row k, for the first `rows` lanes.
#[inline]
pub fn scatter<S: Block>(from: &[S], rows: usize, to: &mut [S::Number]) {
    S::enter(Scatter(from, rows, to));
}

struct Gather<'a, S: Block>(&'a [S::Number], usize, &'a mut [S]);

impl<S: Block> Kernel for Gather<'_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(from, rows, to) = self;
        let (n, mut i) = (to.len(), 0);
        let row = |k: usize| k.min(rows - 1) * n;
        while i + S::LANES <= n {
            for k in 0..S::LANES {
                to[i + k] = S::load(&from[row(k) + i..][..S::LANES]);
            }
            S::transpose(&mut to[i..i + S::LANES]);
            i += S::LANES;
        }
        let mut lanes = [S::Number::zero(); MOST];
        while i < n {
            for k in 0..S::LANES {
                lanes[k] = from[row(k) + i];
            }
            to[i] = S::load(&lanes);
            i += 1;
        }
    }
    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}

struct Scatter<'a, S: Block>(&'a [S], usize, &'a mut [S::Number]);

impl<S: Block> Kernel for Scatter<'_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(from, rows, to) = self;
        let (n, mut i) = (from.len(), 0);
        let mut block = [S::zero(); MOST];
        while i + S::LANES <= n {
            block[..S::LANES].copy_from_slice(&from[i..i + S::LANES]);
            S::transpose(&mut block[..S::LANES]);
            for k in 0..rows {
                block[k].store(&mut to[k * n + i..][..S::LANES]);
            }
            i += S::LANES;
        }
        let mut lanes = [S::Number::zero(); MOST];
        while i < n {
            from[i].store(&mut lanes);
            for k in 0..rows {
                to[k * n + i] = lanes[k];
            }
            i += 1;
        }
    }
    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}

/// The numbers in the lanes of some vectors.
pub fn lanes<S: Block>(of: &[S]) -> &[S::Number] {
    assert!(size_of::<S>() == S::LANES * size_of::<S::Number>());
    // SAFETY: a vector is its numbers side by side, as the assertion says too, and is aligned at least as they are.
    unsafe { core::slice::from_raw_parts(of.as_ptr().cast(), of.len() * S::LANES) }
}

/// The numbers of some forces, six of each.
pub fn flat<S>(forces: &[Force<S>]) -> &[S] {
    // SAFETY: a force is `repr(C)`, of two vectors that are `repr(C)`, of three numbers each: six numbers and nothing else.
    unsafe { core::slice::from_raw_parts(forces.as_ptr().cast(), 6 * forces.len()) }
}

/// The numbers of some forces, to be written.
pub fn flat_mut<S>(forces: &mut [Force<S>]) -> &mut [S] {
    // SAFETY: as for `flat`.
    unsafe { core::slice::from_raw_parts_mut(forces.as_mut_ptr().cast(), 6 * forces.len()) }
}

/// More lanes than this no vector has.
const MOST: usize = 16;

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
        *to.first_chunk_mut().expect("a place for each lane") = self.to_array();
    }
    #[inline(always)]
    fn transpose(rows: &mut [Self]) {
        Self::transpose(rows.try_into().expect("a row for each lane"));
    }
}

/// A number with its vectors.
pub trait Real: Block<Number = Self> {
    /// Those of [`Level::Avx2`](crate::level::Level::Avx2), or of [`Level::Neon`](crate::level::Level::Neon).
    type Short: Block<Number = Self>;
    /// Those of [`Level::Avx512`](crate::level::Level::Avx512), or the same as short ones where there is none.
    type Long: Block<Number = Self>;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::level::{Level, Unsupported};

    /// Rows there and back, with some rows and numbers over.
    struct Back<S>(core::marker::PhantomData<S>);

    impl<S: Block<Number: From<u16> + PartialEq>> Kernel for Back<S> {
        fn run(self) {
            let n = 3 * S::LANES + 2;
            let rows: Vec<S::Number> = (0..(n * S::LANES) as u16).map(From::from).collect();
            let mut vectors = vec![S::zero(); n];
            gather(&rows, S::LANES, &mut vectors);
            for (i, x) in vectors.iter().enumerate() {
                let mut lanes = [S::Number::zero(); MOST];
                x.store(&mut lanes);
                (0..S::LANES).for_each(|k| assert!(lanes[k] == rows[k * n + i]));
            }
            for some in 0..=S::LANES {
                let mut back = vec![S::Number::zero(); rows.len()];
                scatter(&vectors, some, &mut back);
                assert!(back[..some * n] == rows[..some * n]);
                assert!(back[some * n..].iter().all(|&x| x == S::Number::zero()));
            }
        }
        fn run_fused(self) {
            self.run();
        }
    }

    #[test]
    fn there_and_back() {
        fn kernel<S>() -> Back<S> {
            Back(core::marker::PhantomData)
        }
        for level in Level::ALL {
            match level {
                _ if !level.is_supported() => eprintln!("NOT RUN: {}", Unsupported(level)),
                Level::Baseline => {
                    f64::enter(kernel::<f64>());
                    f32::enter(kernel::<f32>());
                }
                Level::Neon | Level::Avx2 => {
                    <f64 as Real>::Short::enter(kernel::<<f64 as Real>::Short>());
                    <f32 as Real>::Short::enter(kernel::<<f32 as Real>::Short>());
                }
                Level::Avx512 => {
                    <f64 as Real>::Long::enter(kernel::<<f64 as Real>::Long>());
                    <f32 as Real>::Long::enter(kernel::<<f32 as Real>::Long>());
                }
            }
        }
    }
}
