//! Operations on vectors, and of a matrix on a vector.

use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::View;

compiled! {
    /// y += α A x.
    pub fn add_scaled_product<V, COLUMNS>(y: &mut [f64], alpha: f64, a: View<'_>, x: &[f64]) {
        for k in 0..x.len() {
            let (factor, column) = (alpha * x[k], &a.data[k * a.stride..][..y.len()]);
            for (y, a) in y.iter_mut().zip(column) {
                *y += a * factor;
            }
        }
    }
}

/// xᵀ y.
#[inline]
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// ‖x‖∞; NaN if an entry is.
#[inline]
pub fn max_abs(x: &[f64]) -> f64 {
    let larger = |most: f64, x: f64| if x.abs() > most || x.is_nan() { x.abs() } else { most };
    let (eights, rest) = x.as_chunks::<8>();
    let mut most = [0.0; 8];
    for x in eights {
        for i in 0..8 {
            most[i] = larger(most[i], x[i]);
        }
    }
    most.iter().chain(rest).fold(0.0, |most, x| larger(most, *x))
}

/// to = x, without the function call that copying a few numbers would be.
#[inline(always)]
#[allow(clippy::manual_memcpy)] // that is the call
pub fn copy<V: Vector>(to: &mut [f64], x: &[f64]) {
    let length = x.len();
    let to = &mut to[..length];
    if length < V::N {
        for i in 0..length {
            to[i] = x[i];
        }
        return;
    }
    let mut i = 0;
    while i + V::N < length {
        V::load(&x[i..]).store(&mut to[i..]);
        i += V::N;
    }
    V::load(&x[length - V::N..]).store(&mut to[length - V::N..]); // may overlap what was copied before
}

/// to = a x, without a function call.
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
    let (a, last, mut i) = (V::splat(a), length - V::N, 0);
    while i < last {
        V::load(&x[i..]).mul(a).store(&mut to[i..]);
        i += V::N;
    }
    V::load(&x[last..]).mul(a).store(&mut to[last..]);
}
