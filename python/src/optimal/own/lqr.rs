//! Actions that are defined by numbers: matrices, or the parameters of a unicycle.

use super::MOST_SIZE;
use crate::arrays::{Array, matrix, output, vector};
use crate::exceptions::{problem_error, within};
use condyle::optimal as rust;
use nalgebra::DMatrix;
use pyo3::prelude::*;
use rust::{ActionModel, LqKnot};

/// An action with linear dynamics x⁺ = A x + B u + f, the quadratic cost ½ xᵀQx + xᵀSu + ½ uᵀRu + qᵀx + rᵀu, and bounds
/// lower ≤ u ≤ upper.
///
/// A, Q: (nx, nx); B, S: (nx, nu); R: (nu, nu); f, q: nx numbers; r, lower, upper: nu numbers. None means zero, or no
/// bounds. Without R and B the action has no controls, as at a terminal knot. nx and nu are at most 4096.
///
/// >>> from condyle.optimal import Lqr
/// >>> knot, end = Lqr([[1.0]], B=[[1.0]], Q=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[1.0]])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Lqr(pub(in crate::optimal) rust::Lqr);

#[pymethods]
impl Lqr {
    #[new]
    #[pyo3(signature = (A, B=None, f=None, Q=None, S=None, R=None, q=None, r=None, lower=None, upper=None))]
    #[allow(non_snake_case, clippy::too_many_arguments)]
    fn new(
        A: &Bound<'_, PyAny>,
        B: Option<&Bound<'_, PyAny>>,
        f: Option<&Bound<'_, PyAny>>,
        Q: Option<&Bound<'_, PyAny>>,
        S: Option<&Bound<'_, PyAny>>,
        R: Option<&Bound<'_, PyAny>>,
        q: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let nx = within("A, rows", A.len()?, 0, MOST_SIZE)?;
        let nu = match (R, B) {
            (Some(R), _) => R.len()?,
            (None, Some(B)) if nx > 0 => B.get_item(0)?.len()?,
            _ => 0,
        };
        within("R, rows, or B, columns", nu, 0, MOST_SIZE)?;
        let mut knot = LqKnot::zeros(nx, nu);
        let parts = [("B", B), ("f", f), ("Q", Q), ("S", S), ("R", R), ("q", q), ("r", r)];
        for (name, given) in [("A", Some(A)), ("lower", lower), ("upper", upper)].into_iter().chain(parts) {
            given.map_or(Ok(()), |given| write(&mut knot, name, given))?;
        }
        Ok(Self(rust::Lqr::new(knot)))
    }

    fn __repr__(&self) -> String {
        let knot = self.0.knot();
        format!("<condyle.optimal.Lqr nx {}, nu {}>", knot.ndx(), knot.nu())
    }

    #[allow(non_snake_case)]
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, knot) = (slf.py(), slf.get().0.knot());
        let array = |of: &DMatrix<f64>| output(py, None, &[of.nrows(), of.ncols()], |out| of.write(out));
        let (A, B, Q, S, R) = (array(&knot.A)?, array(&knot.B)?, array(&knot.Q)?, array(&knot.S)?, array(&knot.R)?);
        let vector = |of: &[f64]| of.to_vec();
        let (f, q, r) = (vector(knot.f.as_slice()), vector(knot.q.as_slice()), vector(knot.r.as_slice()));
        let (lower, upper) = (vector(knot.lower.as_slice()), vector(knot.upper.as_slice()));
        Ok((slf.get_type(), (A, B, f, Q, S, R, q, r, lower, upper)).into_pyobject(py)?.into_any())
    }
}

/// The action of a unicycle: x = (x, y, θ), u = (v, ω), x⁺ = x + Δt (v cos θ, v sin θ, ω).
///
/// The cost is ½ (w₁² ‖x‖² + w₂² ‖u‖²), as in Crocoddyl's `ActionModelUnicycle`.
///
/// dt: Δt (s), above 0.
/// weights: w₁ and w₂.
/// terminal: whether the action is for the terminal knot, without controls.
///
/// >>> from condyle.optimal import Fddp, Problem, Unicycle
/// >>> problem = Problem([-1.0, -1.0, 1.0], [Unicycle()], [0] * 20, Unicycle(terminal=True))
/// >>> Fddp(problem).solve(np.zeros((21, 3)), np.zeros((20, 2))).status
/// 'converged'
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Unicycle(pub(in crate::optimal) rust::Unicycle);

#[pymethods]
impl Unicycle {
    #[new]
    #[pyo3(signature = (dt=0.1, weights=[10.0, 1.0], terminal=false))]
    fn new(dt: f64, weights: [f64; 2], terminal: bool) -> PyResult<Self> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(problem_error(rust::Error::TimeStep { dt }));
        }
        let action = rust::Unicycle::new(dt, weights);
        Ok(Self(if terminal { action.terminal() } else { action }))
    }

    fn __repr__(&self) -> String {
        let (dt, [x, u]) = (self.0.dt, self.0.weights);
        let end = if self.0.is_terminal() { ", the end" } else { "" };
        format!("<condyle.optimal.Unicycle {dt} s, weights {x} {u}{end}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let action = &slf.get().0;
        Ok((slf.get_type(), (action.dt, action.weights, action.is_terminal())).into_pyobject(slf.py())?.into_any())
    }
}

/// Writes the matrix or vector `name` of a knot.
pub(in crate::optimal) fn write(knot: &mut LqKnot, name: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let LqKnot { A, B, Q, S, R, f, q, r, lower, upper, .. } = knot;
    let vectors = [("f", f), ("q", q), ("r", r), ("lower", lower), ("upper", upper)];
    let matrices = [("A", A), ("B", B), ("Q", Q), ("S", S), ("R", R)];
    if let Some((_, to)) = vectors.into_iter().find(|(known, _)| *known == name) {
        let length = to.len();
        to.copy_from_slice(&vector(name, given, length)?);
    } else if let Some((_, to)) = matrices.into_iter().find(|(known, _)| *known == name) {
        to.copy_from(&matrix(name, given, to.shape().into())?.to_matrix());
    }
    Ok(())
}
