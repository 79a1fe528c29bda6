//! Dynamics in continuous time that are written in Python and integrated by the library.

use super::MOST_SIZE;
use super::action::named;
use super::automatic::{Differentiated, Way, next_and_cost};
use super::functions::{Fault, Functions, unless_failed};
use super::lqr::write;
use super::space::Space;
use crate::arrays::{bounds, matrix, vector};
use crate::exceptions::{problem_error, within};
use crate::model::Model;
use condyle::optimal as rust;
use nalgebra::DMatrix;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rust::robot::{ContinuousModel, ControlPolynomial, Derivatives, Integrated, Integrator, KnotInput};
use rust::{ActionModel, Hessian, LqKnot};
use std::ops::Range;

/// An action whose accelerations and cost per second are written in Python. An integrator advances the state by a time
/// step.
///
/// The state is x = (q, v). With semi-implicit Euler, v⁺ = v + q̈ Δt and q⁺ = q ⊕ (v Δt + q̈ Δt²). The cost is Δt ℓ,
/// where ℓ is the cost per second.
///
/// nv, nu: the sizes of a velocity and of a control, at most 4096; nu is 0 at a terminal knot.
/// calc: a function of (t, x, u) that returns the accelerations, nv numbers, and the cost ℓ; at the terminal knot the
///     accelerations may be None.
/// dt: Δt in seconds, or None for a terminal knot, whose cost is ℓ.
/// calc_diff: a function of (t, x, u) that returns a dict of the nonzero matrices among da_dq, da_dv, da_du, the
///     derivatives of the accelerations, and q, r, Q, S, R, the derivatives of ℓ as for `Action`. Without calc_diff,
///     calc is differentiated as for `Action`. The second derivatives of the accelerations, which a solver's
///     `second_order` needs, are always computed from calc. They are zero if calc cannot be called with numbers that
///     carry derivatives. Second derivatives of ⊕ are taken as zero.
/// integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
/// lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
/// model: the robot that defines the positions q and the operation ⊕; None if q is a vector of nv numbers.
/// controls: 'constant', 'linear' or 'quadratic', as for `FreeDynamics`.
///
/// Raises `ProblemError` if dt is not above 0.
///
/// >>> from condyle.optimal import DifferentialAction, Fddp, Problem
/// >>> def spring(t, x, u):
/// ...     return u - x[:1], 0.5 * (x @ x + u @ u)
/// >>> knot = DifferentialAction(1, 1, spring, 0.1, integrator="runge_kutta_4")
/// >>> end = DifferentialAction(1, 0, lambda t, x, u: (None, 5.0 * (x @ x)), None)
/// >>> problem = Problem([1.0, 0.0], [knot], [0] * 30, end)
/// >>> Fddp(problem).solve(np.zeros((31, 2)), np.zeros((30, 1))).status
/// 'converged'
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct DifferentialAction {
    written: Written,
    bounds: Option<[Vec<f64>; 2]>,
    /// Integrator and Δt; `None` at the terminal knot.
    step: Option<(Integrator, f64)>,
    controls: ControlPolynomial,
    model: Option<Py<Model>>,
}

/// The functions and sizes of a `DifferentialAction`. The copies of the action in problems share the functions.
#[derive(Clone)]
struct Written {
    nv: usize,
    nu: usize,
    functions: Functions,
    /// The space of states.
    space: Space,
    way: Way,
}

#[pymethods]
impl DifferentialAction {
    #[new]
    #[pyo3(signature = (
        nv, nu, calc, dt, calc_diff=None, integrator="semi_implicit_euler", lower=None, upper=None, model=None,
        controls="constant"
    ))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        nv: usize,
        nu: usize,
        calc: Py<PyAny>,
        dt: Option<f64>,
        calc_diff: Option<Py<PyAny>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        model: Option<Bound<'_, Model>>,
        controls: &str,
    ) -> PyResult<Self> {
        let (nv, nu) = (within("nv", nv, 0, MOST_SIZE / 2)?, within("nu", nu, 0, MOST_SIZE)?);
        let space = match &model {
            None => Space::Vector(2 * nv),
            Some(model) if model.get().inner.nv() == nv => Space::Robot(model.get().inner.clone()),
            Some(model) => {
                let expected = model.get().inner.nv();
                return Err(PyValueError::new_err(format!("nv: expected {expected}, as of model, found {nv}")));
            }
        };
        if dt.is_none() && nu > 0 {
            return Err(PyValueError::new_err(format!("nu: expected 0 for a terminal knot, without dt, found {nu}")));
        }
        let step =
            dt.map(|dt| Ok::<_, PyErr>((crate::optimal::integrators::integrator(integrator)?, dt))).transpose()?;
        let written = Written { nv, nu, functions: Functions::new(calc, calc_diff)?, space, way: Way::default() };
        let (bounds, controls) = (bounds(nu, lower, upper)?, crate::optimal::integrators::polynomial(controls)?);
        let action = Self { written, bounds, step, controls, model: model.map(Bound::unbind) };
        action.boxed(&Fault::default())?;
        Ok(action)
    }

    fn __repr__(&self) -> String {
        let Written { nv, nu, functions, .. } = &self.written;
        let written = if functions.has(1) { "calc_diff" } else { "derivatives of calc" };
        let time = self.step.map_or_else(|| "the end".to_owned(), |(_, dt)| format!("{dt} s"));
        format!("<condyle.optimal.DifferentialAction nv {nv}, nu {nu}, {time}, {written}>")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let [calc, calc_diff] = this.written.functions.clones(py);
        let integrator = this.step.map_or(Integrator::SemiImplicitEuler, |(integrator, _)| integrator).name();
        let (lower, upper) = this.bounds.clone().map(|[lower, upper]| (lower, upper)).unzip();
        let model = this.model.as_ref().map(|model| model.clone_ref(py));
        let (nv, nu, dt) = (this.written.nv, this.written.nu, this.step.map(|(_, dt)| dt));
        let controls = format!("{:?}", this.controls).to_lowercase();
        let arguments = (nv, nu, calc, dt, calc_diff, integrator, lower, upper, model, controls);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.written.functions.traverse(&visit)
    }

    fn __clear__(&self) {
        self.written.functions.clear();
    }
}

impl DifferentialAction {
    /// Copies the action for a problem. Errors of the copy are stored in `fault`.
    pub(in crate::optimal) fn boxed(&self, fault: &Fault) -> PyResult<Box<dyn ActionModel>> {
        let Written { nv, nu, space, .. } = &self.written;
        let groups = match space {
            Space::Robot(model) => rust::robot::groups(model),
            _ => vec![],
        };
        let zeros = || DMatrix::zeros(*nv, *nv);
        let inner = OwnDynamics {
            written: self.written.clone(),
            terminal: self.step.is_none(),
            fault: fault.clone(),
            groups,
            a: vec![0.0; *nv],
            da_dq: zeros(),
            da_dv: zeros(),
            da_du: vec![0.0; nv * nu],
        };
        let Some((integrator, dt)) = self.step else { return Ok(Box::new(Integrated::without_time(inner))) };
        let action = Integrated::new(inner, integrator, dt).map_err(problem_error)?.with_controls(self.controls);
        Ok(match self.bounds.clone() {
            Some([lower, upper]) => Box::new(action.with_bounds(lower, upper)),
            None => Box::new(action),
        })
    }
}

/// A `DifferentialAction` in the integrators' interface.
struct OwnDynamics {
    written: Written,
    terminal: bool,
    fault: Fault,
    groups: Vec<Range<usize>>,
    a: Vec<f64>,
    da_dq: DMatrix<f64>,
    da_dv: DMatrix<f64>,
    da_du: Vec<f64>,
}

impl OwnDynamics {
    fn try_calc(&mut self, py: Python<'_>, t: usize, x: &[f64], u: &[f64]) -> PyResult<f64> {
        let result = self.written.functions.at(py, 0, t, x, u)?;
        let mut read = || {
            let (a, cost) = next_and_cost(&result)?;
            match a.is_none() {
                false => self.a.copy_from_slice(&vector("the accelerations", &a, self.written.nv)?),
                true if self.terminal => {}
                true => {
                    let what = format!("the accelerations: expected {} numbers, found None", self.written.nv);
                    return Err(PyValueError::new_err(what));
                }
            }
            let found = cost.get_type();
            cost.extract().map_err(|_| PyTypeError::new_err(format!("the cost: expected a number, found {found}")))
        };
        read().map_err(|error| named(py, "calc", &[t], error))
    }

    /// Writes the derivatives of the accelerations and of the cost. Returns false if only differences can compute them.
    fn try_calc_diff(&mut self, py: Python<'_>, t: usize, [x, u]: [&[f64]; 2], knot: &mut LqKnot) -> PyResult<bool> {
        let Written { nv, nu, functions, space, way } = &self.written;
        if !functions.has(1) {
            let all = Differentiated { functions, space, nu: *nu, batch: false, terminal: self.terminal };
            let mut slopes = vec![0.0; nv * (2 * nv + nu)];
            let done = all.dynamics(py, way, t, [x, u], &mut slopes, knot)?;
            let n = 2 * nv + nu;
            self.set_slopes(|i, k| slopes[i * n + k]);
            return Ok(done);
        }
        let result = functions.at(py, 1, t, x, u)?;
        let mut read = || {
            let given = result.cast::<PyDict>().map_err(|_| {
                let found = result.get_type();
                PyTypeError::new_err(format!("expected a dict, found {found}"))
            })?;
            for (name, entry) in given.iter() {
                let name: String = name.extract()?;
                match name.as_str() {
                    "da_dq" => self.da_dq.copy_from(&matrix("da_dq", &entry, [*nv, *nv])?.to_matrix()),
                    "da_dv" => self.da_dv.copy_from(&matrix("da_dv", &entry, [*nv, *nv])?.to_matrix()),
                    "da_du" => {
                        let given = matrix("da_du", &entry, [*nv, *nu])?.to_matrix();
                        self.da_du.copy_from_slice(given.as_slice());
                    }
                    "q" | "r" | "Q" | "S" | "R" => write(knot, &name, &entry)?,
                    other => {
                        let expected = "da_dq, da_dv, da_du, q, r, Q, S or R";
                        return Err(PyValueError::new_err(format!("expected {expected}, found '{other}'")));
                    }
                }
            }
            Ok(true)
        };
        read().map_err(|error| named(py, "calc_diff", &[t], error))
    }

    /// Writes the derivatives of the accelerations, nv × (2 nv + nu), row by row.
    fn set_slopes(&mut self, slope: impl Fn(usize, usize) -> f64) {
        let (nv, nu) = (self.written.nv, self.written.nu);
        for i in 0..nv {
            (0..nv).for_each(|k| (self.da_dq[(i, k)], self.da_dv[(i, k)]) = (slope(i, k), slope(i, nv + k)));
            (0..nu).for_each(|k| self.da_du[k * nv + i] = slope(i, 2 * nv + k));
        }
    }

    /// Computes the derivatives by central differences.
    fn differ(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let Written { nv, nu, .. } = self.written;
        let mut full = LqKnot::zeros(2 * nv, nu);
        rust::NumDiff(Probe(self.copy())).calc_diff(t, x, u, &mut full);
        self.set_slopes(|i, k| if k < 2 * nv { full.A[(i, k)] } else { full.B[(i, k - 2 * nv)] });
        (knot.Q, knot.S, knot.R, knot.q, knot.r) = (full.Q, full.S, full.R, full.q, full.r);
    }

    fn copy(&self) -> Self {
        let Self { written, terminal, fault, groups, a, da_dq, da_dv, da_du } = self;
        Self {
            written: written.clone(),
            terminal: *terminal,
            fault: fault.clone(),
            groups: groups.clone(),
            a: a.clone(),
            da_dq: da_dq.clone(),
            da_dv: da_dv.clone(),
            da_du: da_du.clone(),
        }
    }

    /// Computes the cost ℓ at a state, and the accelerations in `a`. All these numbers are NaN if the function fails.
    fn value(&mut self, t: usize, x: &[f64], u: &[f64]) -> f64 {
        let fault = self.fault.clone();
        unless_failed(&fault, |py| self.try_calc(py, t, x, u)).unwrap_or_else(|| {
            self.a.fill(f64::NAN);
            f64::NAN
        })
    }
}

impl ContinuousModel for OwnDynamics {
    fn nq(&self) -> usize {
        self.written.space.nx() - self.written.nv
    }

    fn nv(&self) -> usize {
        self.written.nv
    }

    fn nu(&self) -> usize {
        self.written.nu
    }

    fn calc(&mut self, KnotInput { t, x, u, .. }: KnotInput<'_>) -> (&[f64], f64) {
        let cost = self.value(t, x, u);
        (&self.a, cost)
    }

    fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
        let KnotInput { t, x, u, .. } = input;
        for field in [&mut knot.Q, &mut knot.S, &mut knot.R, &mut self.da_dq, &mut self.da_dv] {
            field.fill(0.0);
        }
        self.da_du.fill(0.0);
        knot.q.fill(0.0);
        knot.r.fill(0.0);
        self.value(t, x, u);
        let fault = self.fault.clone();
        match unless_failed(&fault, |py| self.try_calc_diff(py, t, [x, u], knot)) {
            Some(true) => {}
            Some(false) => self.differ(t, x, u, knot),
            None => knot.q.fill(f64::NAN),
        }
        for field in [&mut knot.Q, &mut knot.S, &mut knot.R] {
            *field *= scale;
        }
        knot.q *= scale;
        knot.r *= scale;
        Derivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_du: &self.da_du }
    }

    fn hessian(&mut self, input: KnotInput<'_>, mu: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
        let (KnotInput { t, x, u, .. }, fault) = (input, self.fault.clone());
        self.value(t, x, u);
        let Written { nv, nu, functions, space, way } = &self.written;
        let all = Differentiated { functions, space, nu: *nu, batch: false, terminal: false };
        let (n, mut knot) = (2 * nv + nu, LqKnot::zeros(2 * nv, *nu));
        let mut slopes = vec![0.0; nv * n];
        unless_failed(&fault, |py| all.curvature(py, way, t, [x, u], mu, &mut slopes, &mut knot))
            .filter(|done| *done)?;
        self.set_slopes(|i, k| slopes[i * n + k]);
        (hessian.xx, hessian.xu, hessian.uu) = (knot.Q, knot.S, knot.R);
        Some(Derivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_du: &self.da_du })
    }

    fn groups(&self) -> &[Range<usize>] {
        &self.groups
    }

    fn check_position(&self, q: &[f64]) -> Result<(), String> {
        match &self.written.space {
            Space::Robot(model) => model.check_position(q).map_err(|error| error.to_string()),
            _ => Ok(()),
        }
    }

    fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
        match &self.written.space {
            Space::Robot(model) => condyle::integrate(model, q, dq, out),
            _ => (0..out.len()).for_each(|k| out[k] = q[k] + dq[k]),
        }
    }

    fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
        match &self.written.space {
            Space::Robot(model) => condyle::difference(model, q0, q1, out),
            _ => (0..out.len()).for_each(|k| out[k] = q1[k] - q0[k]),
        }
    }

    fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        if let Space::Robot(model) = &self.written.space {
            condyle::configuration::integrate_jacobian(
                model,
                dq,
                condyle::configuration::IntegrateArgument::Position,
                by_q,
            );
            condyle::configuration::integrate_jacobian(
                model,
                dq,
                condyle::configuration::IntegrateArgument::Velocity,
                by_dq,
            );
        }
    }
}

/// An action that returns the accelerations as the first numbers of its next state. The library's differences of
/// actions then differentiate the accelerations.
struct Probe(OwnDynamics);

impl ActionModel for Probe {
    fn nx(&self) -> usize {
        self.0.written.space.nx()
    }

    fn ndx(&self) -> usize {
        2 * self.0.written.nv
    }

    fn nu(&self) -> usize {
        self.0.written.nu
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let cost = self.0.value(t, x, u);
        next[..self.0.written.nv].copy_from_slice(&self.0.a);
        cost
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.0.written.space.integrate(x, dx, out, &self.0.fault);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        let nv = self.0.written.nv;
        out.fill(0.0);
        (0..nv).for_each(|k| out[k] = x1[k] - x0[k]);
    }
}
