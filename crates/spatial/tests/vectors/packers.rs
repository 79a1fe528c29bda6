//! Tests of the conversion of rows of numbers to vectors and back.

use crate::Here;
use condyle_spatial::Scalar;
use condyle_spatial::block::{Block, Real, Strided, gather, scatter, scatter_matrix};
use condyle_spatial::level::{Level, Unsupported};
use condyle_spatial::simd::Kernel;
use core::marker::PhantomData;

/// Maximum number of lanes of a vector.
const MOST: usize = 16;

/// Check that converts rows to vectors and back, with incomplete groups of rows and of numbers.
struct Back<S>(PhantomData<S>);

impl<S: Block<Number: From<u16> + PartialEq>> Kernel for Back<S> {
    fn run(self) {
        for n in [3 * S::LANES + 2, S::LANES.max(2) - 1, S::LANES.div_ceil(2)] {
            Self::of(n);
        }
    }
}

impl<S: Block<Number: From<u16> + PartialEq>> Back<S> {
    #[inline(always)]
    fn of(n: usize) {
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
            if some == 0 {
                continue;
            }
            let mut again = vec![S::zero(); n];
            gather(&rows[..some * n], some, &mut again);
            scatter(&again, S::LANES, &mut back);
            (0..S::LANES).for_each(|k| assert!(back[k * n..][..n] == rows[k.min(some - 1) * n..][..n]));
        }
        // the vectors are written as a matrix and as minus its transpose, with fewer or more columns than lanes
        for (columns, more) in [(n, 3), (1, 3), (n, 0), (1, 0), (2, 0), (2, 3)] {
            if !n.is_multiple_of(columns) {
                continue;
            }
            let shape = [n / columns, columns];
            let upright = Strided { vectors: &vectors, strides: [columns, 1], shape, negative: false };
            let turned = Strided { strides: [1, shape[1]], shape: [shape[1], shape[0]], negative: true, ..upright };
            for (matrix, sign) in [(upright, 1.0), (turned, -1.0)] {
                let ([m, n], stride) = (matrix.shape, matrix.shape[1] + more);
                let mut back = vec![S::Number::zero(); S::LANES * m * stride];
                let mut places: Vec<_> = back.chunks_exact_mut(m * stride).collect();
                scatter_matrix(&matrix, &mut places, stride);
                for (k, place) in places.iter().enumerate() {
                    for (i, j) in (0..m).flat_map(|i| (0..stride).map(move |j| (i, j))) {
                        let at = i * matrix.strides[0] + j * matrix.strides[1];
                        let there = if j < n { rows[k * m * n + at] } else { S::Number::zero() };
                        assert!(place[i * stride + j] == S::Number::splat(sign) * there);
                    }
                }
            }
        }
    }
}

#[test]
fn rows_to_vectors_and_back() {
    fn back<S: Block<Number: From<u16> + PartialEq>>() {
        S::enter(Back::<S>(PhantomData));
    }
    for level in Level::ALL {
        match level {
            _ if !level.is_supported() => eprintln!("NOT RUN: {}", Unsupported(level)),
            Level::Baseline => {
                back::<f64>();
                back::<f32>();
            }
            Level::Simd128 | Level::Neon | Level::Avx2 => {
                back::<<f64 as Real>::Narrow<Here>>();
                back::<<f32 as Real>::Narrow<Here>>();
            }
            Level::Avx512 => {
                back::<<f64 as Real>::Wide<Here>>();
                back::<<f32 as Real>::Wide<Here>>();
            }
        }
    }
}
