//! The backward sweep, and the linear-quadratic problems that it solves.

use super::own::write;
use crate::arrays::{Array, class, matrix, output, vector};
use crate::exceptions::{ProblemError, within};
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;
use rust::{ConstraintRow, LqKnot};

const FIELDS: [&str; 8] = ["A", "B", "f", "Q", "S", "R", "q", "r"];

/// The backward Riccati sweep over a horizon of linear-quadratic knots: an iteration of `Fddp` without derivatives and
/// line search.
///
/// knots: a list of `LqKnot`s, as `Problem.derivatives` returns them; the last knot is the terminal knot, without
/// controls.
///
/// Raises `ProblemError` if the shapes of the knots do not fit together. `run` raises `ProblemError` for a knot with
/// constraint rows, because the sweep does not support them.
///
/// >>> from condyle.optimal import Lqr, Problem, Sweep
/// >>> knot, end = Lqr([[1.0]], B=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[2.0]])
/// >>> problem = Problem([1.0], [knot], [0], end)
/// >>> result = Sweep(problem.derivatives([[1.0], [1.0]], [[0.0]])).run()
/// >>> bool(abs(result.K[0][0, 0] + 2 / 3) < 1e-15)  # δu = −⅔ δx
/// True
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Sweep(Vec<LqKnot>);

#[pymethods]
impl Sweep {
    #[new]
    fn new(knots: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let read = |(t, knot): (usize, &Bound<'_, PyAny>)| {
            let size = |name: &str| knot.getattr(name).and_then(|part| part.len());
            let wrong = |error: PyErr| PyValueError::new_err(format!("knots[{t}]: expected an LqKnot: {error}"));
            let most = LqKnot::MOST_SIZE;
            let ndx = within("ndx", size("q").map_err(wrong)?, 1, most)?;
            let nu = within("nu", size("r").map_err(wrong)?, 0, most)?;
            let mut to = LqKnot::zeros(ndx, nu);
            for name in FIELDS {
                write(&mut to, name, &knot.getattr(name)?)?;
            }
            read_rows(&mut to, &knot.getattr("rows")?)?;
            Ok(to)
        };
        let knots = knots.iter().enumerate().map(read).collect::<PyResult<Vec<_>>>()?;
        let Some(last) = knots.last() else { return Err(ProblemError::new_err("knots: expected at least one")) };
        if last.nu() > 0 {
            let (t, nu) = (knots.len() - 1, last.nu());
            return Err(ProblemError::new_err(format!("knots[{t}]: expected no controls at the end, found {nu}")));
        }
        match knots.iter().position(|knot| knot.ndx() != last.ndx()) {
            Some(t) => {
                let (expected, found) = (last.ndx(), knots[t].ndx());
                Err(ProblemError::new_err(format!("knots[{t}]: expected ndx = {expected}, found {found}")))
            }
            None => Ok(Self(knots)),
        }
    }

    /// Computes the feedback and the value functions, as a `SweepResult`.
    ///
    /// regularisation: the number added to the diagonals of Quu and Vxx, at least 0. Quu is the Hessian of the
    /// cost-to-go with respect to the controls, and Vxx the Hessian of the value function.
    ///
    /// Raises `ProblemError` if Quu of a knot is not positive definite.
    #[pyo3(signature = (regularisation=0.0))]
    fn run<'py>(&self, py: Python<'py>, regularisation: f64) -> PyResult<Bound<'py, PyAny>> {
        let lq_knots = &self.0;
        let mut sweep = rust::Sweep::new(lq_knots);
        let done = py.detach(|| sweep.run(lq_knots, regularisation).map(|_| ()));
        done.map_err(|error| ProblemError::new_err(error.to_string()))?;
        let (feedback, horizon, ndx) = (sweep.feedback(), lq_knots.len() - 1, lq_knots[0].ndx());
        let (gains, feed_forward) = (PyList::empty(py), PyList::empty(py));
        for (feedback, knot) in feedback.iter().zip(&lq_knots[..horizon]) {
            gains.append(output(py, None, &[knot.nu(), ndx], |out| feedback.K.write(out))?)?;
            feed_forward.append(output(py, None, &[knot.nu()], |out| out.copy_from_slice(feedback.k.as_slice()))?)?;
        }
        let slopes = output(py, None, &[horizon + 1, ndx], |out| {
            out.chunks_exact_mut(ndx)
                .zip(feedback)
                .for_each(|(out, feedback)| out.copy_from_slice(feedback.Vx.as_slice()));
        })?;
        let curvatures = output(py, None, &[horizon + 1, ndx, ndx], |out| {
            out.chunks_exact_mut(ndx * ndx).zip(feedback).for_each(|(out, feedback)| feedback.Vxx.write(out));
        })?;
        class!(py, "SweepResult")?.call1((gains, feed_forward, slopes, curvatures))
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Sweep: {} knots, ndx {}>", self.0.len() - 1, self.0[0].ndx())
    }
}

/// Reads the constraint rows of a knot from a `ConstraintRows` or None.
#[allow(non_snake_case)]
fn read_rows(to: &mut LqKnot, given: &Bound<'_, PyAny>) -> PyResult<()> {
    if given.is_none() {
        return Ok(());
    }
    let part = |name: &str| given.getattr(name);
    let (ndx, nu) = (to.ndx(), to.nu());
    let count = within("rows.c", part("c")?.len()?, 0, LqKnot::MOST_SIZE)?;
    let (C, D) = (part("C")?, part("D")?);
    let (C, D) = (matrix("rows.C", &C, [count, ndx])?.to_matrix(), matrix("rows.D", &D, [count, nu])?.to_matrix());
    let (c, lower, upper) = (part("c")?, part("lower")?, part("upper")?);
    let c = vector("rows.c", &c, count)?;
    let (lower, upper) = (vector("rows.lower", &lower, count)?, vector("rows.upper", &upper, count)?);
    for i in 0..count {
        let entries: Vec<f64> = C.row(i).iter().chain(D.row(i).iter()).copied().collect();
        let (c, lower, upper) = (c[i], lower[i], upper[i]);
        to.rows.push(ConstraintRow { first: 0, entries: &entries, c, lower, upper });
    }
    Ok(())
}

/// Converts the constraint rows of a knot to a `ConstraintRows`, or to None if the knot has no constraint rows.
#[allow(non_snake_case)]
fn give_rows<'py>(py: Python<'py>, knot: &LqKnot) -> PyResult<Option<Bound<'py, PyAny>>> {
    let (rows, ndx, nu) = (&knot.rows, knot.ndx(), knot.nu());
    if rows.is_empty() {
        return Ok(None);
    }
    let [C, D] = rows.dense(ndx, nu);
    let column = |k: usize| {
        output(py, None, &[rows.len()], |out| out.iter_mut().zip(rows.bounds()).for_each(|(out, row)| *out = row[k]))
    };
    let given = (
        output(py, None, &[rows.len(), ndx], |out| C.write(out))?,
        output(py, None, &[rows.len(), nu], |out| D.write(out))?,
        column(0)?,
        column(1)?,
        column(2)?,
    );
    class!(py, "ConstraintRows")?.call1(given).map(Some)
}

/// Converts knots to `LqKnot`s.
pub(super) fn give<'py>(py: Python<'py>, lq_knots: &[LqKnot]) -> PyResult<Bound<'py, PyList>> {
    let class = class!(py, "LqKnot")?;
    let all = PyList::empty(py);
    for knot in lq_knots {
        let (ndx, nu) = (knot.ndx(), knot.nu());
        let matrix = |rows: usize, columns: usize, of: &nalgebra::DMatrix<f64>| {
            output(py, None, &[rows, columns], |out| of.write(out))
        };
        let vector = |of: &[f64]| output(py, None, &[of.len()], |out| out.copy_from_slice(of));
        all.append(class.call1((
            matrix(ndx, ndx, &knot.A)?,
            matrix(ndx, nu, &knot.B)?,
            vector(knot.f.as_slice())?,
            matrix(ndx, ndx, &knot.Q)?,
            matrix(ndx, nu, &knot.S)?,
            matrix(nu, nu, &knot.R)?,
            vector(knot.q.as_slice())?,
            vector(knot.r.as_slice())?,
            give_rows(py, knot)?,
        ))?)?;
    }
    Ok(all)
}
