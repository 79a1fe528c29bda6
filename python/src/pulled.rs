//! Products of transposed Jacobians with vectors, for the gradients of `condyle.torch` and `condyle.jax`.

use crate::arrays::{matrix, place, writable};
use crate::batch;
use crate::data::{Data, take};
use crate::exceptions::within;
use crate::model::Model;
use crate::signals::{self, Signals};
use numpy::PyArrayDyn;
use pyo3::prelude::*;

/// Maximum size of the Jacobians of a part in numbers (256 KB), so that they stay in the cache of a core until they are
/// multiplied.
const NUMBERS: usize = 1 << 15;

/// Number of entries of a product that are summed at the same time, in registers. Rows of matrices are read in tiles of
/// this size, also beyond their end.
const TILE: usize = 8;

/// Computes Jᵀ λ of `rnea` for many states, with respect to q, v and a, in parts that stay in the cache.
///
/// q: positions, (N, nq); v, a, lambda_: velocities, accelerations and λ, (N, nv); count: the number of results, 3 or
/// 2, without a. Returns arrays (N, nv); the first one belongs to the tangent space.
#[pyfunction(name = "_rnea_pull")]
pub(crate) fn rnea_pull<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    lambda_: &Bound<'py, PyAny>,
    count: usize,
) -> PyResult<Vec<Bound<'py, PyArrayDyn<f64>>>> {
    let (model, count) = (model.get(), within("count", count, 2, 3)?);
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let states = q.len()?;
    let q = matrix("q", q, [states, nq])?;
    let [v, a, lambda] = [("v", v), ("a", a), ("lambda_", lambda_)].map(|(name, x)| matrix(name, x, [states, nv]));
    let (v, a, lambda) = (v?, a?, lambda?);
    let results = (0..count).map(|_| place(py, None, &[states, nv])).collect::<PyResult<Vec<_>>>()?;
    let mut borrowed = results.iter().map(writable).collect::<PyResult<Vec<_>>>()?;
    let mut slopes = borrowed.iter_mut().map(|array| Ok(array.as_slice_mut()?)).collect::<PyResult<Vec<_>>>()?;
    let mut data = take(model, data)?;
    let batch = data.batch(&model.inner, states);
    let size = nv * nv;
    let step = ((NUMBERS / (3 * size).max(1)).next_multiple_of(16) * batch.threads()).min(batch.capacity());
    let mut jacobians = vec![0.0; 3 * size * step.min(states) + TILE];
    let mut signals = Signals::new(signals::SHORT);
    let (q, v, a, lambda) = (&q[..], &v[..], &a[..], &lambda[..]);
    py.detach(|| {
        for from in (0..states).step_by(step) {
            let some = from..states.min(from + step);
            let part_size = size * some.len();
            let (first, rest) = jacobians.split_at_mut(part_size);
            let (second, rest) = rest.split_at_mut(part_size);
            let [q, v, a, lambda] = [q, v, a, lambda].map(|x| batch::part(x, &some, states));
            let mut places = [first, second, &mut rest[..part_size]];
            batch.writer(&mut places).rnea_derivatives(&model.inner, q, v, a, &[]);
            for (k, slopes) in slopes.iter_mut().enumerate() {
                multiply(&mut slopes[some.start * nv..some.end * nv], &jacobians[k * part_size..], lambda, nv);
            }
            if signals.go_on().is_break() {
                return;
            }
        }
    });
    signals.finish()?;
    drop(borrowed);
    Ok(results)
}

/// Computes Jᵀ λ of each state, with n × n matrices J, row by row. At least `TILE` numbers follow the last matrix.
fn multiply(to: &mut [f64], jacobians: &[f64], lambda: &[f64], n: usize) {
    if n == 0 {
        return;
    }
    for (state, (to, lambda)) in to.chunks_exact_mut(n).zip(lambda.chunks_exact(n)).enumerate() {
        let J = &jacobians[state * n * n..];
        for (tile, to) in to.chunks_mut(TILE).enumerate() {
            let mut sums = [0.0; TILE];
            for (row, factor) in lambda.iter().enumerate() {
                let row: &[f64; TILE] =
                    J[row * n + tile * TILE..].first_chunk().expect("padding after the last matrix");
                for k in 0..TILE {
                    // adapters of iterators are not inlined here, which takes eight times as long
                    sums[k] += factor * row[k];
                }
            }
            to.copy_from_slice(&sums[..to.len()]);
        }
    }
}
