//! The backward sweep, and the linear-quadratic problems that it solves.

use super::own::write;
use crate::arrays::{Array, class, output};
use crate::exceptions::{ProblemError, within};
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyList;
use rust::LqNode;

const FIELDS: [&str; 8] = ["A", "B", "f", "Q", "S", "R", "q", "r"];

/// The backward Riccati sweep over a horizon of linear-quadratic knots: an iteration of `Fddp` without derivatives and
/// line search.
///
/// nodes: a list of `LqNode`s, as `Problem.derivatives` returns them; the last node is the terminal one, without
/// controls.
///
/// Raises `ProblemError` if the shapes of the nodes do not fit together.
///
/// >>> from condyle.optimal import Lqr, Problem, Sweep
/// >>> knot, end = Lqr([[1.0]], B=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[2.0]])
/// >>> problem = Problem([1.0], [knot], [0], end)
/// >>> result = Sweep(problem.derivatives([[1.0], [1.0]], [[0.0]])).run()
/// >>> bool(abs(result.K[0][0, 0] + 2 / 3) < 1e-15)  # δu = −⅔ δx
/// True
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Sweep(Vec<LqNode>);

#[pymethods]
impl Sweep {
    #[new]
    fn new(nodes: Vec<Bound<'_, PyAny>>) -> PyResult<Self> {
        let read = |(t, node): (usize, &Bound<'_, PyAny>)| {
            let size = |name: &str| node.getattr(name).and_then(|part| part.len());
            let wrong = |error: PyErr| PyValueError::new_err(format!("nodes[{t}]: expected an LqNode: {error}"));
            let most = LqNode::MOST_SIZE;
            let ndx = within("ndx", size("q").map_err(wrong)?, 1, most)?;
            let nu = within("nu", size("r").map_err(wrong)?, 0, most)?;
            let mut to = LqNode::zeros(ndx, nu);
            for name in FIELDS {
                write(&mut to, name, &node.getattr(name)?)?;
            }
            Ok(to)
        };
        let nodes = nodes.iter().enumerate().map(read).collect::<PyResult<Vec<_>>>()?;
        let Some(last) = nodes.last() else { return Err(ProblemError::new_err("nodes: expected at least one")) };
        if last.nu() > 0 {
            let (t, nu) = (nodes.len() - 1, last.nu());
            return Err(ProblemError::new_err(format!("nodes[{t}]: expected no controls at the end, found {nu}")));
        }
        match nodes.iter().position(|node| node.ndx() != last.ndx()) {
            Some(t) => {
                let (expected, found) = (last.ndx(), nodes[t].ndx());
                Err(ProblemError::new_err(format!("nodes[{t}]: expected ndx = {expected}, found {found}")))
            }
            None => Ok(Self(nodes)),
        }
    }

    /// Computes the feedback and the value functions, as a `SweepResult`.
    ///
    /// regularisation: the number added to the diagonals of Quu and Vxx, at least 0.
    ///
    /// Raises `ProblemError` if Quu of a knot is not positive definite.
    #[pyo3(signature = (regularisation=0.0))]
    fn run<'py>(&self, py: Python<'py>, regularisation: f64) -> PyResult<Bound<'py, PyAny>> {
        let nodes = &self.0;
        let mut sweep = rust::Sweep::new(nodes);
        let done = py.detach(|| sweep.run(nodes, regularisation).map(|_| ()));
        done.map_err(|error| ProblemError::new_err(error.to_string()))?;
        let (knots, horizon, ndx) = (sweep.knots(), nodes.len() - 1, nodes[0].ndx());
        let (gains, feed_forward) = (PyList::empty(py), PyList::empty(py));
        for (knot, node) in knots.iter().zip(&nodes[..horizon]) {
            gains.append(output(py, None, &[node.nu(), ndx], |out| knot.K.write(out))?)?;
            feed_forward.append(output(py, None, &[node.nu()], |out| out.copy_from_slice(knot.k.as_slice()))?)?;
        }
        let slopes = output(py, None, &[horizon + 1, ndx], |out| {
            out.chunks_exact_mut(ndx).zip(knots).for_each(|(out, knot)| out.copy_from_slice(knot.Vx.as_slice()));
        })?;
        let curvatures = output(py, None, &[horizon + 1, ndx, ndx], |out| {
            out.chunks_exact_mut(ndx * ndx).zip(knots).for_each(|(out, knot)| knot.Vxx.write(out));
        })?;
        class!(py, "SweepResult")?.call1((gains, feed_forward, slopes, curvatures))
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Sweep: {} knots, ndx {}>", self.0.len() - 1, self.0[0].ndx())
    }
}

/// Converts nodes to `LqNode`s.
pub(super) fn give<'py>(py: Python<'py>, nodes: &[LqNode]) -> PyResult<Bound<'py, PyList>> {
    let class = class!(py, "LqNode")?;
    let all = PyList::empty(py);
    for node in nodes {
        let (ndx, nu) = (node.ndx(), node.nu());
        let matrix = |rows: usize, columns: usize, of: &nalgebra::DMatrix<f64>| {
            output(py, None, &[rows, columns], |out| of.write(out))
        };
        let vector = |of: &[f64]| output(py, None, &[of.len()], |out| out.copy_from_slice(of));
        all.append(class.call1((
            matrix(ndx, ndx, &node.A)?,
            matrix(ndx, nu, &node.B)?,
            vector(node.f.as_slice())?,
            matrix(ndx, ndx, &node.Q)?,
            matrix(ndx, nu, &node.S)?,
            matrix(nu, nu, &node.R)?,
            vector(node.q.as_slice())?,
            vector(node.r.as_slice())?,
        ))?)?;
    }
    Ok(all)
}
