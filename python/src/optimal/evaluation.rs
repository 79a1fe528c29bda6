//! Evaluations and solutions of a problem, converted to Python.

use super::problem::Problem;
use crate::arrays::{Array, Give, class, matrix, output, vector};
use crate::signals;
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

/// Returns the number of controls of a knot, if all knots have the same number.
pub(super) fn common_nu(problem: &rust::Problem) -> Option<usize> {
    let nu = problem.nu(0);
    (0..problem.horizon()).all(|t| problem.nu(t) == nu).then_some(nu)
}

/// Reads the controls of all knots, knot by knot, from an array (N, nu) or a list of arrays.
pub(super) fn controls(problem: &rust::Problem, us: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    named_controls("us", problem, us)
}

/// Reads numbers of the controls of all knots, as [`controls`] does, from the argument `name`.
pub(super) fn named_controls(name: &str, problem: &rust::Problem, us: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    if let Some(nu) = common_nu(problem) {
        return Ok(matrix(name, us, [problem.horizon(), nu])?.to_vec());
    }
    let (found, expected) = (us.len()?, problem.horizon());
    if found != expected {
        return Err(PyValueError::new_err(format!("{name}: expected {expected} arrays, found {found}")));
    }
    let mut flat = Vec::new();
    for t in 0..expected {
        flat.extend_from_slice(&vector(&format!("{name}[{t}]"), &us.get_item(t)?, problem.nu(t))?);
    }
    Ok(flat)
}

/// Returns one array for all knots if they have the same number of controls, otherwise a list of arrays; `numbers`
/// writes the numbers of one knot.
pub(super) fn by_knot<'py>(
    py: Python<'py>,
    problem: &rust::Problem,
    inner: &[usize],
    numbers: impl Fn(usize, &mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    let horizon = problem.horizon();
    let shape = |nu: usize| [&[nu], inner].concat();
    if let Some(nu) = common_nu(problem) {
        let each = nu * inner.iter().product::<usize>();
        return output(py, None, &[&[horizon], &shape(nu)[..]].concat(), |out| {
            (0..horizon).for_each(|t| numbers(t, &mut out[t * each..(t + 1) * each]));
        });
    }
    let arrays = (0..horizon).map(|t| output(py, None, &shape(problem.nu(t)), |out| numbers(t, out)));
    Ok(PyList::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?.into_any())
}

/// Computes an `Evaluation` of a trajectory.
pub(super) fn evaluate<'py>(
    py: Python<'py>,
    problem: &mut rust::Problem,
    xs: &[f64],
    us: &[f64],
) -> PyResult<Bound<'py, PyAny>> {
    let (horizon, nx, ndx) = (problem.horizon(), problem.nx(), problem.ndx());
    let (mut next, mut costs) = (vec![0.0; horizon * nx], vec![0.0; horizon + 1]);
    problem.calc(xs, us, &mut next, &mut costs);
    let gaps = self::gaps(problem, xs, &next);
    let lists = [PyList::empty(py), PyList::empty(py), PyList::empty(py)];
    for t in 0..horizon {
        let (mut accelerations, mut efforts, mut forces) = (vec![], vec![], vec![]);
        let (x, u) = (&xs[t * nx..][..nx], &us[problem.control_range(t)]);
        problem.outputs(t, x, u, &mut |name, numbers| match name {
            "acceleration" => accelerations.extend_from_slice(numbers),
            "effort" => efforts.extend_from_slice(numbers),
            name => {
                let contact = name.strip_prefix("force/").unwrap_or(name);
                forces.push((contact.to_owned(), numbers.to_vec()));
            }
        });
        let by_name = PyDict::new(py);
        for (contact, force) in forces {
            by_name.set_item(contact, force.give(py, None)?)?;
        }
        lists[0].append(accelerations.give(py, None)?)?;
        lists[1].append(efforts.give(py, None)?)?;
        lists[2].append(by_name)?;
    }
    let [accelerations, efforts, forces] = lists;
    class!(py, "Evaluation")?.call1((
        costs.iter().sum::<f64>(),
        costs.give(py, None)?,
        output(py, None, &[horizon, nx], |out| out.copy_from_slice(&next))?,
        output(py, None, &[horizon + 1, ndx], |out| out.copy_from_slice(&gaps))?,
        accelerations,
        efforts,
        forces,
    ))
}

/// Returns the gaps: first x̂₀ ⊖ x₀ with the problem's initial state x̂₀, then φ(xₜ, uₜ) ⊖ xₜ₊₁ for each knot t. `next`
/// contains the next states φ(xₜ, uₜ).
pub(super) fn gaps(problem: &rust::Problem, xs: &[f64], next: &[f64]) -> Vec<f64> {
    let (nx, ndx) = (problem.nx(), problem.ndx());
    let mut gaps = vec![0.0; (problem.horizon() + 1) * ndx];
    let predicted = std::iter::once(problem.x0()).chain(next.chunks_exact(nx));
    for ((gap, x), predicted) in gaps.chunks_exact_mut(ndx).zip(xs.chunks_exact(nx)).zip(predicted) {
        problem.difference(x, predicted, gap);
    }
    gaps
}

/// Converts a solution to a Python object.
pub(super) fn solution<'py>(
    py: Python<'py>,
    of: &Py<Problem>,
    problem: &rust::Problem,
    s: &rust::Solution,
) -> PyResult<Bound<'py, PyAny>> {
    let (horizon, nx, ndx) = (problem.horizon(), problem.nx(), problem.ndx());
    let trace = s.trace.iter().map(|i| signals::record(py, i)).collect::<PyResult<Vec<_>>>()?;
    let t = &s.timings;
    let timings = [t.calc, t.calc_diff, t.sweep, t.rollout, t.total, t.overrun].map(|phase| phase.as_secs_f64());
    let timings = class!(py, "Timings")?.call1(PyTuple::new(py, timings)?)?;
    let solution = class!(py, "Solution")?.call1((
        output(py, None, &[horizon + 1, nx], |out| out.copy_from_slice(&s.xs))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.u(t)))?,
        by_knot(py, problem, &[ndx], |t, out| s.K[t].write(out))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.k[t].as_slice()))?,
        s.cost,
        s.gap,
        s.feasible,
        s.status.name(),
        trace,
        timings,
        s.fallback.map(rust::Fallback::name),
    ))?;
    // the solution computes accelerations, efforts and forces on request, from this problem and this number of shifts
    solution.setattr("_source", (of.clone_ref(py), of.get().moved()))?;
    // the times at which knots begin, if all knots have a duration
    let mut time = 0.0;
    let mut times = vec![0.0];
    for knot in 0..horizon {
        let Some(duration) = problem.duration(knot) else { return Ok(solution) };
        time += duration;
        times.push(time);
    }
    solution.setattr("_times", times.give(py, None)?)?;
    Ok(solution)
}
