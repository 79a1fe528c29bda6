//! Terms of costs (a residual with a weight) and limits (a residual with bounds).

use super::residuals::Residual;
use crate::arrays::numbers;
use crate::exceptions::ProblemError;
use condyle::optimal::robot;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::Arc;

/// The cost a(r) of a residual r.
///
/// >>> condyle.optimal.Activation.weighted([1.0, 0.0])
/// Weighted([1.0, 0.0])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Activation(robot::Activation);

#[pymethods]
impl Activation {
    /// Returns the quadratic cost ½ Σ rᵢ².
    #[staticmethod]
    fn quadratic() -> Self {
        Self(robot::Activation::Quadratic)
    }

    /// Returns the weighted quadratic cost ½ Σ wᵢ rᵢ².
    #[staticmethod]
    fn weighted(w: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Activation::Weighted(numbers("w", w)?)))
    }

    /// Returns the quadratic barrier ½ Σ (excess of rᵢ over its bounds)²; an infinite bound is ignored.
    #[staticmethod]
    fn barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lower, upper) = (numbers("lower", lower)?, numbers("upper", upper)?);
        Ok(Self(robot::Activation::Barrier { lower, upper }))
    }

    /// Returns the weighted quadratic barrier ½ Σ wᵢ (excess of rᵢ over its bounds)². Crocoddyl has wᵢ² instead of wᵢ
    /// in the value of this activation.
    #[staticmethod]
    fn weighted_barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>, w: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lower, upper, weights) = (numbers("lower", lower)?, numbers("upper", upper)?, numbers("w", w)?);
        Ok(Self(robot::Activation::WeightedBarrier { lower, upper, weights }))
    }

    /// Returns the relaxed logarithmic barrier Σ β(d) of the distances d = rᵢ − lowerᵢ and d = upperᵢ − rᵢ to all
    /// finite bounds. β(d) = −μ log(d/δ) for d ≥ δ, and ½ μ (((d − 2δ)/δ)² − 1) for d < δ, where a bound is near or
    /// violated.
    ///
    /// β is convex and twice continuously differentiable. It has curvature inside the bounds too, so a step towards a
    /// bound that is not yet reached becomes more expensive; `barrier` has none there. β(δ) = 0, so the value does not
    /// depend on the unit of r. Source: Feller and Ebenbauer, 2017.
    ///
    /// lower, upper: the bounds, infinite for no bound; `cone.bounds()` for a cone.
    /// mu: μ > 0, in the unit of the cost; at the distance d ≥ δ the slope is μ/d.
    /// delta: δ > 0, in the unit of r.
    #[staticmethod]
    fn relaxed_barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>, mu: f64, delta: f64) -> PyResult<Self> {
        let (lower, upper) = (numbers("lower", lower)?, numbers("upper", upper)?);
        Ok(Self(robot::Activation::RelaxedBarrier { lower, upper, mu, delta }))
    }

    /// Returns the sum Σ rᵢ, for residuals that are costs themselves: see `Residual.own_cost`.
    #[staticmethod]
    fn sum() -> Self {
        Self(robot::Activation::Sum)
    }

    /// Returns the smooth cost Σ √(ε + rᵢ²), approximately Σ |rᵢ|.
    #[staticmethod]
    #[pyo3(signature = (epsilon=1.0))]
    fn smooth1(epsilon: f64) -> Self {
        Self(robot::Activation::Smooth1 { epsilon })
    }

    /// Returns the smooth cost √(ε + ‖r‖²), approximately ‖r‖. With the cost a, the Hessian is approximated by ε/a³
    /// times the identity; ε/a³ is the least eigenvalue of the exact Hessian.
    #[staticmethod]
    #[pyo3(signature = (epsilon=1.0))]
    fn smooth2(epsilon: f64) -> Self {
        Self(robot::Activation::Smooth2 { epsilon })
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = serde_json::to_string(&slf.get().0).expect("is made of numbers and words");
        Ok((slf.get_type().getattr("_from_json")?, (text,)))
    }

    #[staticmethod]
    fn _from_json(text: &str) -> PyResult<Self> {
        let wrong = |error| ProblemError::new_err(format!("no activation: {error}"));
        serde_json::from_str(text).map(Self).map_err(wrong)
    }
}

/// A term of a cost: weight times an activation of a residual.
///
/// name: the name of the term for `Problem.set_weight` and in error messages.
/// weight: finite and at least 0; a term whose weight is 0 is not computed.
/// residual: a `Residual`.
/// activation: an `Activation`. None chooses the barrier with the residual's bounds for a cone, a centre of pressure or
///     distances, the sum for `Residual.own_cost`, and the quadratic cost for other residuals.
///
/// >>> from condyle.optimal import Cost, Residual
/// >>> Cost("effort", 1e-3, Residual.control([0.0] * 7))
/// <condyle.optimal.Cost 'effort', weight 0.001>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Cost {
    name: String,
    weight: f64,
    residual: Py<Residual>,
    activation: robot::Activation,
}

impl Cost {
    /// Converts the term to the library's type, for a robot.
    pub(super) fn of(&self, model: &Arc<condyle::Model>) -> robot::Cost {
        robot::Cost::new(&self.name, self.weight, self.residual.get().of(model), self.activation.clone())
    }

    /// Returns the residual if it is written in Python.
    pub(super) fn own(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.residual.get().is_own().then(|| self.residual.clone_ref(py).into_any())
    }
}

#[pymethods]
impl Cost {
    #[new]
    #[pyo3(signature = (name, weight, residual, activation=None))]
    fn new(
        name: String,
        weight: f64,
        residual: &Bound<'_, Residual>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> Self {
        let activation = match (activation, residual.get().bounds()) {
            (Some(activation), _) => activation.get().0.clone(),
            (None, Some((lower, upper))) => robot::Activation::Barrier { lower, upper },
            (None, None) if residual.get().is_number() => robot::Activation::Sum,
            (None, None) => robot::Activation::Quadratic,
        };
        Self { name, weight, residual: residual.clone().unbind(), activation }
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Cost '{}', weight {}>", self.name, self.weight)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, Self { name, weight, residual, activation }) = (slf.py(), slf.get());
        let activation = Bound::new(py, Activation(activation.clone()))?;
        let arguments = (name.clone(), *weight, residual.clone_ref(py), activation);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.residual)
    }
}

/// Bounds on a residual r of a robot, lower ≤ r ≤ upper, which `InteriorPoint` and `AugmentedLagrangian` enforce.
///
/// Limits apply at the beginning of a knot. `Fddp` without `AugmentedLagrangian` treats limits as costs of values
/// outside the bounds.
///
/// name: the name of the limit in error messages.
/// residual: a `Residual`.
/// lower, upper: as many numbers as r has, infinite for no bound; None is no bound. If both are None, a cone, a centre
///     of pressure and distances have their own bounds, and every other r must be 0. An entry with equal lower and
///     upper bounds is an equality.
/// soft: two weights, linear and quadratic, with which the limit gives way: a number that is outside its bounds by e
///     costs linear · e + ½ quadratic · e². The weights must be at least 0, and one of them must be above 0. None is a
///     hard limit. A soft limit never makes a problem infeasible. `outcome.gave_way` lists the rows that gave way.
///
/// >>> from condyle.optimal import Limit, Residual
/// >>> Limit("effort", Residual.control([0.0] * 7), lower=[-30.0] * 7, upper=[30.0] * 7)
/// <condyle.optimal.Limit 'effort'>
/// >>> Limit("effort", Residual.control([0.0] * 7), upper=[30.0] * 7, soft=(1.0, 0.0))
/// <condyle.optimal.Limit 'effort', soft (1.0, 0.0)>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Limit {
    name: String,
    residual: Py<Residual>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Linear and quadratic weight of a soft limit.
    soft: Option<(f64, f64)>,
}

impl Limit {
    /// Converts the limit to the library's type, for a robot.
    pub(super) fn of(&self, model: &Arc<condyle::Model>) -> robot::Limit {
        let residual = self.residual.get().of(model);
        let limit = robot::Limit::new(&self.name, residual, self.lower.clone(), self.upper.clone());
        match self.soft {
            Some((linear, quadratic)) => limit.softened(linear, quadratic),
            None => limit,
        }
    }

    /// Returns the residual if it is written in Python.
    pub(super) fn own(&self, py: Python<'_>) -> Option<Py<PyAny>> {
        self.residual.get().is_own().then(|| self.residual.clone_ref(py).into_any())
    }
}

#[pymethods]
impl Limit {
    #[new]
    #[pyo3(signature = (name, residual, lower=None, upper=None, soft=None))]
    fn new(
        name: String,
        residual: &Bound<'_, Residual>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        soft: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let lower = lower.map(|lower| numbers("lower", lower)).transpose()?;
        let upper = upper.map(|upper| numbers("upper", upper)).transpose()?;
        let (lower, upper) = match (lower, upper) {
            (Some(lower), Some(upper)) => (lower, upper),
            (Some(lower), None) => (lower.clone(), vec![f64::INFINITY; lower.len()]),
            (None, Some(upper)) => (vec![f64::NEG_INFINITY; upper.len()], upper),
            (None, None) => residual.get().bounds().unwrap_or_default(), // a limit without bounds means r = 0
        };
        Ok(Self { name, residual: residual.clone().unbind(), lower, upper, soft })
    }

    fn __repr__(&self) -> String {
        match self.soft {
            Some((linear, quadratic)) => {
                format!("<condyle.optimal.Limit '{}', soft ({linear:?}, {quadratic:?})>", self.name)
            }
            None => format!("<condyle.optimal.Limit '{}'>", self.name),
        }
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, Self { name, residual, lower, upper, soft }) = (slf.py(), slf.get());
        let (lower, upper) = (!lower.is_empty()).then(|| (lower.clone(), upper.clone())).unzip(); // None means r = 0
        let arguments = (name.clone(), residual.clone_ref(py), lower, upper, *soft);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.residual)
    }
}
