//! Copies of matrices: whole ones, triangles and transposes.
#![allow(unsafe_code)]

use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::{SLACK, View, holds};
use crate::vectors::copy;

compiled! {
    /// OUT = A, on `rows` rows and `columns` columns.
    pub fn copy_matrix<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        copy_block::<V>(out, ldo, a, shape);
    }

    /// The lower triangle of OUT = that of A, both square of `size` rows.
    pub fn copy_lower<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
        lower::<V>(out, ldo, a, size);
    }

    /// OUT = the symmetric matrix whose lower triangle is that of A, of `size` rows.
    pub fn copy_symmetric<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
        // What lies below the diagonal to the right of it, in blocks of columns; with them comes what lies above.
        let (width, mut j) = (V::N.min(size), 0);
        while j < size {
            let from = j.min(size - width);
            let block = View { data: &a.data[from * a.stride + from..], ..a };
            transposed::<V, false>(&mut out[from * ldo + from..], ldo, block, [size - from, width]);
            j += V::N;
        }
        lower::<V>(out, ldo, a, size);
    }

    /// OUT = Aᵀ, for an A of `rows` rows and `columns` columns.
    pub fn transpose<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        transposed::<V, false>(out, ldo, a, shape);
    }

    /// OUT = −Aᵀ, for an A of `rows` rows and `columns` columns.
    pub fn transpose_negated<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        transposed::<V, true>(out, ldo, a, shape);
    }
}

/// OUT = A, on `rows` rows and `columns` columns, without a function call.
#[inline(always)]
pub fn copy_block<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
    let [rows, columns] = shape;
    if columns == 0 {
        return;
    }
    assert!(holds(a.data, a.stride, shape) && holds(out, ldo, shape), "a matrix ends before the last of its entries");
    for j in 0..columns {
        let (at, from) = (j * ldo, j * a.stride);
        // SAFETY: column j of those that were found to be inside.
        let (to, x) = unsafe { (out.get_unchecked_mut(at..at + rows), a.data.get_unchecked(from..from + rows)) };
        copy::<V>(to, x);
    }
}

#[inline(always)]
fn lower<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
    if size == 0 {
        return;
    }
    let inside = holds(a.data, a.stride, [size; 2]) && holds(out, ldo, [size; 2]);
    assert!(inside, "a matrix ends before the last of its entries");
    for j in 0..size {
        let (at, from, rows) = (j * ldo + j, j * a.stride + j, size - j);
        // SAFETY: column j of those that were found to be inside, from its diagonal on.
        let (to, x) = unsafe { (out.get_unchecked_mut(at..at + rows), a.data.get_unchecked(from..from + rows)) };
        copy::<V>(to, x);
    }
}

/// OUT = Aᵀ, or −Aᵀ.
#[inline(always)]
fn transposed<V: Vector, const NEGATED: bool>(out: &mut [f64], ldo: usize, a: View<'_>, [rows, columns]: [usize; 2]) {
    if columns == 0 {
        return;
    }
    if rows < V::N || columns < V::N {
        for j in 0..columns {
            for i in 0..rows {
                let x = a.data[j * a.stride + i];
                out[i * ldo + j] = if NEGATED { -x } else { x };
            }
        }
        return;
    }
    let inside = holds(a.data, a.stride, [rows, columns]) && holds(out, ldo, [columns, rows]);
    assert!(inside, "a matrix ends before the last of its entries");
    // In square blocks, of which the last ones overlap those before.
    let mut j = 0;
    loop {
        let mut i = 0;
        loop {
            let mut block = [V::splat(0.0); SLACK];
            for k in 0..V::N {
                let at = (j + k) * a.stride + i;
                debug_assert!(at + V::N <= a.data.len());
                // SAFETY: a block's rows and columns are among those of the matrix, which is inside.
                let x = V::load(unsafe { a.data.get_unchecked(at..at + V::N) });
                block[k] = if NEGATED { x.mul(V::splat(-1.0)) } else { x };
            }
            V::transpose(&mut block[..V::N]);
            for k in 0..V::N {
                let at = (i + k) * ldo + j;
                debug_assert!(at + V::N <= out.len());
                // SAFETY: as above.
                block[k].store(unsafe { out.get_unchecked_mut(at..at + V::N) });
            }
            if i + V::N >= rows {
                break;
            }
            i = (i + V::N).min(rows - V::N);
        }
        if j + V::N >= columns {
            break;
        }
        j = (j + V::N).min(columns - V::N);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::tests::at_each_level;
    use nalgebra::DMatrix;

    #[test]
    fn copies_are_exact_for_every_edge() {
        at_each_level(|| {
            for n in 1..19 {
                let ld = n + SLACK;
                let a = DMatrix::from_fn(n, n, |i, j| ((i * 31 + j * 34 + 5) % 23) as f64 / 23.0 - 0.4);
                let view = View::new(a.as_slice(), n);
                let mut out = vec![0.0; ld * n];
                copy_symmetric(&mut out, ld, view, n);
                for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                    assert!(out[j * ld + i] == a[(i, j)] && out[i * ld + j] == a[(i, j)]);
                }
                for m in 1..=n {
                    let mut out = vec![0.0; ld * n];
                    let from_second_row = View { data: &view.data[1..], ..view };
                    transpose(&mut out[2..], ld, from_second_row, [n - 1, m]);
                    for (i, j) in (1..n).flat_map(|i| (0..m).map(move |j| (i, j))) {
                        assert_eq!(out[(i - 1) * ld + 2 + j], a[(i, j)]);
                    }
                    transpose_negated(&mut out, ld, view, [m, n]);
                    for (i, j) in (0..m).flat_map(|i| (0..n).map(move |j| (i, j))) {
                        assert_eq!(out[i * ld + j], -a[(i, j)]);
                    }
                    let mut out = vec![0.0; ld * n];
                    copy_matrix(&mut out, ld, view, [m, n]);
                    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                        assert_eq!(out[j * ld + i], if i < m { a[(i, j)] } else { 0.0 });
                    }
                }
                let mut out = vec![0.0; ld * n];
                copy_lower(&mut out, ld, view, n);
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    assert_eq!(out[j * ld + i], if i >= j { a[(i, j)] } else { 0.0 });
                }
            }
        });
    }
}
