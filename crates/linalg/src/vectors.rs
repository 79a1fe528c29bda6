//! Operations on vectors, and products of a matrix and a vector.
#![allow(unsafe_code)]

use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::{SLACK, View, holds};

compiled! {
    /// Computes y += α A x.
    pub fn add_scaled_product<V, COLUMNS>(y: &mut [f64], alpha: f64, a: View<'_>, x: &[f64]) {
        let rows = y.len();
        if rows == 0 || x.is_empty() {
            return;
        }
        assert!(holds(a.data, a.stride, [rows, x.len()]), "a matrix ends before the last of its entries");
        if rows < V::N {
            for (k, x) in x.iter().enumerate() {
                let (factor, column) = (alpha * x, &a.data[k * a.stride..][..rows]);
                for i in 0..rows {
                    y[i] += column[i] * factor;
                }
            }
            return;
        }
        // SAFETY: the last register begins N rows before the end, and the other registers begin before the last
        // register.
        let sum = |y: &[f64], i: usize| unsafe { scaled_rows::<V>(y, alpha, a, x, i) };
        let (last, mut i) = (rows - V::N, 0);
        let end = sum(y, last); // computed first, because other registers overwrite shared rows
        while i < last {
            sum(y, i).store(&mut y[i..]);
            i += V::N;
        }
        end.store(&mut y[last..]);
    }
}

/// Returns y + α A x for one register of rows, which starts at row i.
///
/// # Safety
/// y and the columns of A have a register of numbers from row i on. A has as many columns as x has numbers.
#[inline(always)]
unsafe fn scaled_rows<V: Vector>(y: &[f64], alpha: f64, a: View<'_>, x: &[f64], i: usize) -> V {
    debug_assert!(i + V::N <= y.len() && (x.len() - 1) * a.stride + i + V::N <= a.data.len());
    let (alpha, mut at) = (V::splat(alpha), i);
    // SAFETY: guaranteed by the caller.
    let mut sum = V::load(unsafe { y.get_unchecked(i..i + V::N) });
    for x in x {
        // SAFETY: guaranteed by the caller.
        let column = V::load(unsafe { a.data.get_unchecked(at..at + V::N) });
        sum = sum.add(column.mul(alpha.mul(V::splat(*x)))); // rounds as if the terms were added one by one
        at += a.stride;
    }
    sum
}

compiled! {
    /// Computes y += A x for an A with `rows` rows. y has `rows` numbers, followed by padding.
    pub fn add_product_vector<V, COLUMNS>(y: &mut [f64], rows: usize, a: View<'_>, x: &[f64]) {
        let mut i = 0;
        while i < rows {
            // Computes up to four registers of rows at a time. The last register may extend into the padding.
            if rows - i > 3 * V::N {
                strip::<V, 4>(&mut y[i..], a, i, x);
            } else if rows - i > 2 * V::N {
                strip::<V, 3>(&mut y[i..], a, i, x);
            } else if rows - i > V::N {
                strip::<V, 2>(&mut y[i..], a, i, x);
            } else {
                strip::<V, 1>(&mut y[i..], a, i, x);
            }
            i += 4 * V::N;
        }
    }

    /// Computes y = Aᵀ x for an A with `rows` rows. Products of padding rows of A with padding of x, up to the end of a
    /// register, must be zero. A has as many columns as y has numbers, and padding columns.
    pub fn transposed_product_vector<V, COLUMNS>(y: &mut [f64], rows: usize, a: View<'_>, x: &[f64]) {
        let mut k = 0;
        while k < y.len() {
            let mut sums = [V::splat(0.0); SLACK];
            let mut i = 0;
            while i < rows {
                let x = V::load(&x[i..]);
                for kk in 0..V::N {
                    sums[kk] = V::load(&a.data[(k + kk) * a.stride + i..]).mul_add(x, sums[kk]);
                }
                i += V::N;
            }
            V::transpose(&mut sums[..V::N]);
            let mut sum = sums[0];
            for kk in 1..V::N {
                sum = sum.add(sums[kk]);
            }
            if k + V::N <= y.len() {
                sum.store(&mut y[k..]);
            } else {
                let mut numbers = [0.0; SLACK];
                sum.store(&mut numbers);
                for (y, number) in y[k..].iter_mut().zip(numbers) {
                    *y = number;
                }
            }
            k += V::N;
        }
    }
}

/// Computes y += A[i.., :] x on S registers of rows.
#[inline(always)]
fn strip<V: Vector, const S: usize>(y: &mut [f64], a: View<'_>, i: usize, x: &[f64]) {
    let y = &mut y[..S * V::N];
    let mut sums = [V::splat(0.0); S];
    for s in 0..S {
        sums[s] = V::load(&y[s * V::N..]);
    }
    for k in 0..x.len() {
        let (factor, column) = (V::splat(x[k]), &a.data[k * a.stride + i..][..S * V::N]);
        for s in 0..S {
            sums[s] = V::load(&column[s * V::N..]).mul_add(factor, sums[s]);
        }
    }
    for s in 0..S {
        sums[s].store(&mut y[s * V::N..]);
    }
}

/// Returns the dot product xᵀ y.
#[inline]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Returns ‖x‖∞; NaN if an entry is NaN. The absolute values are compared as integers with the same bits. These
/// integers have the same order, and NaN is the largest.
#[inline]
pub fn max_abs(x: &[f64]) -> f64 {
    let abs = |x: f64| x.abs().to_bits() as i64;
    let (eights, rest) = x.as_chunks::<8>();
    let mut most = [0; 8];
    for x in eights {
        for i in 0..8 {
            most[i] = abs(x[i]).max(most[i]);
        }
    }
    let rest = rest.iter().fold(0, |most, x| abs(*x).max(most));
    f64::from_bits(most.into_iter().fold(rest, i64::max) as u64)
}

/// Copies x to `to` with vector registers. For a few numbers, this avoids the function call that the compiler would
/// emit.
#[inline(always)]
pub fn copy<V: Vector>(to: &mut [f64], x: &[f64]) {
    let length = x.len();
    let to = &mut to[..length];
    // Copies the first and the last numbers; these two ranges may overlap.
    match length {
        0 => {}
        1 => to[0] = x[0],
        2..4 => copy_ends::<2>(to, x),
        4..8 if length < V::N => copy_ends::<4>(to, x),
        _ => {
            let (last, mut i) = (length - V::N, 0);
            while i < last {
                // SAFETY: i + `V::N` < length, and both slices have `length` numbers.
                unsafe { V::load(x.get_unchecked(i..i + V::N)).store(to.get_unchecked_mut(i..i + V::N)) };
                i += V::N;
            }
            V::load(&x[last..]).store(&mut to[last..]);
        }
    }
}

/// Copies the first M and the last M numbers.
#[inline(always)]
fn copy_ends<const M: usize>(to: &mut [f64], x: &[f64]) {
    let last = x.len() - M;
    let (first, end): ([f64; M], [f64; M]) = (core::array::from_fn(|k| x[k]), core::array::from_fn(|k| x[last + k]));
    to[..M].copy_from_slice(&first);
    to[last..].copy_from_slice(&end);
}

/// Computes to = a x. This function is inlined.
#[inline(always)]
pub fn copy_scaled<V: Vector>(to: &mut [f64], x: &[f64], a: f64) {
    let length = x.len();
    let to = &mut to[..length];
    if length < V::N {
        for i in 0..length {
            to[i] = a * x[i];
        }
        return;
    }
    // Copies two registers at a time. The last registers may overlap the registers before them.
    let (a, last, mut i) = (V::splat(a), length - V::N, 0);
    loop {
        let k = (i + V::N).min(last);
        // SAFETY: i and k are at least `V::N` before the end, and both slices have `length` numbers.
        unsafe {
            V::load(x.get_unchecked(i..i + V::N)).mul(a).store(to.get_unchecked_mut(i..i + V::N));
            V::load(x.get_unchecked(k..k + V::N)).mul(a).store(to.get_unchecked_mut(k..k + V::N));
        }
        if k == last {
            return;
        }
        i = (k + V::N).min(last);
    }
}
