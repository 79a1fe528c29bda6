//! Costs and limits of the change of the controls from knot to knot.

use crate::arrays::{bounds, numbers};
use crate::exceptions::problem_error;
use condyle::optimal as rust;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::ActionModel;
use rust::robot::{ControlBounds, ControlChange};

/// An action of any kind, with a cost of the change of the controls from knot to knot, ½ Σ wᵢ (uᵢ − pᵢ)², where p are
/// the controls of the knot before.
///
/// The state becomes (x, p), so nx and ndx grow by the number of controls; the next p is u. All models of a problem,
/// and its terminal model, need the same number of weights. The initial state contains the controls before the first
/// knot, such as those that the motors execute now. The derivatives are exact. An iteration takes longer than without
/// `ControlRate`, about 1.8 times as long for a quadruped.
///
/// action: the action. If it has controls, it has one for each weight. An action without controls, such as the terminal
///     model, keeps p.
/// weights: the weights w, at least 0. A weight w/Δt is the weight w of the squared rate of the controls.
/// lower, upper: bounds of u − p, infinite for no bound, which `InteriorPoint` and `AugmentedLagrangian` enforce.
///     Without controls, they are ignored.
///
/// >>> from condyle.optimal import ControlRate, Fddp, Lqr, Problem
/// >>> one = np.ones((1, 1))
/// >>> knot = ControlRate(Lqr(one, one, Q=one, R=0.0 * one), [3.0])
/// >>> end = ControlRate(Lqr(one, np.zeros((1, 0)), Q=one), [3.0])
/// >>> problem = Problem([1.0, 0.0], [knot], [0] * 30, end)  # x = 1, and the control before is 0
/// >>> plan = Fddp(problem).solve(np.zeros((31, 2)), np.zeros((30, 1)))
/// >>> bool(-0.5 < plan.us[0, 0] < -0.2) and bool(plan.xs[1, 1] == plan.us[0, 0])
/// True
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ControlRate {
    pub(in crate::optimal) action: Py<PyAny>,
    weights: Vec<f64>,
    bounds: Option<[Vec<f64>; 2]>,
}

#[pymethods]
impl ControlRate {
    #[new]
    #[pyo3(signature = (action, weights, lower=None, upper=None))]
    fn new(
        action: Py<PyAny>,
        weights: &Bound<'_, PyAny>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let weights = numbers("weights", weights)?;
        let bounds = bounds(weights.len(), lower, upper)?;
        Ok(Self { action, weights, bounds })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let action = self.action.bind(py).repr()?;
        Ok(format!("<condyle.optimal.ControlRate of {} controls, {action}>", self.weights.len()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let (lower, upper) = match this.bounds.clone() {
            Some([lower, upper]) => (Some(lower), Some(upper)),
            None => (None, None),
        };
        let arguments = (this.action.clone_ref(py), this.weights.clone(), lower, upper);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.action)
    }
}

impl ControlRate {
    /// Returns the cost and the limits as data.
    pub(in crate::optimal) fn change(&self) -> ControlChange {
        let bounds = self.bounds.clone().map(|[lower, upper]| ControlBounds { lower, upper });
        ControlChange { weights: self.weights.clone(), bounds }
    }

    /// Adds the cost and the limits to a copy of the action.
    pub(in crate::optimal) fn boxed(&self, action: Box<dyn ActionModel>) -> PyResult<Box<dyn ActionModel>> {
        let has_controls = action.nu() > 0;
        let wide = rust::ControlRate::new(action, &self.weights).map_err(problem_error)?;
        Ok(match &self.bounds {
            Some([lower, upper]) if has_controls => Box::new(wide.limited(lower, upper).map_err(problem_error)?),
            _ => Box::new(wide),
        })
    }
}
