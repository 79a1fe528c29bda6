//! Parameters of a problem, and the derivatives of its optimality conditions with respect to them.

use super::point::{Active, Point};
use super::system::{Vectors, slice};
use super::wrong;
use crate::error::{Error, assert_length};
use crate::problem::{Problem, Shape};
use crate::robot::Nudge;
use core::fmt;
use core::str::FromStr;
use nalgebra::{DMatrix, DVector};

/// Parameter of a problem, which has a name: `x0`, or the kind and the name of a cost or contact, such as
/// `target/reach`. A parameter that several knots share changes at all of them.
///
/// ```
/// use condyle_optimal::Parameter;
/// assert_eq!("target/reach".parse(), Ok(Parameter::Target("reach".into())));
/// assert_eq!(Parameter::Weight("effort".into()).to_string(), "weight/effort");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Initial state x̂₀, `x0`. Its changes are in the tangent space, ndx numbers.
    InitialState,
    /// Target of the cost with this name, `target/NAME`. A reference state changes in its tangent space (2 nv numbers),
    /// a rotation R by R exp(δ) (3 numbers), a placement M by M exp(δ) (6 numbers, linear first).
    Target(String),
    /// Weight of the cost with this name, `weight/NAME`, 1 number.
    Weight(String),
    /// Weights of the entries of the residual of the cost with this name, `entry_weights/NAME`.
    EntryWeights(String),
    /// Placement M at which the contact with this name is held, `contact/NAME`. It changes by M exp(δ), 6 numbers,
    /// linear first. It has an effect only if the contact has a gain of the position error.
    Contact(String),
    /// Duration of all knots of a robot that have one, `duration`, 1 number (s). All change by the same amount.
    Duration,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InitialState => f.write_str("x0"),
            Self::Target(name) => write!(f, "target/{name}"),
            Self::Weight(name) => write!(f, "weight/{name}"),
            Self::EntryWeights(name) => write!(f, "entry_weights/{name}"),
            Self::Contact(name) => write!(f, "contact/{name}"),
            Self::Duration => f.write_str("duration"),
        }
    }
}

impl FromStr for Parameter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let named = |name: &str| name.to_owned();
        match text.split_once('/') {
            None if text == "x0" => Ok(Self::InitialState),
            None if text == "duration" => Ok(Self::Duration),
            Some(("target", name)) => Ok(Self::Target(named(name))),
            Some(("weight", name)) => Ok(Self::Weight(named(name))),
            Some(("entry_weights", name)) => Ok(Self::EntryWeights(named(name))),
            Some(("contact", name)) => Ok(Self::Contact(named(name))),
            _ => Err(wrong(format!(
                "`{text}` is no parameter; expected `x0`, `duration`, `target/NAME`, `weight/NAME`, \
                 `entry_weights/NAME` or `contact/NAME`"
            ))),
        }
    }
}

impl Parameter {
    /// Reads the parameter of a robot's problem; `None` for the initial state.
    fn nudge(&self, problem: &mut Problem) -> Result<Option<Nudge>, Error> {
        let nudge = match self {
            Self::InitialState => return Ok(None),
            Self::Target(name) => Nudge::target(problem, name),
            Self::Weight(name) => Nudge::weight(problem, name),
            Self::EntryWeights(name) => Nudge::entry_weights(problem, name),
            Self::Contact(name) => Nudge::contact(problem, name),
            Self::Duration => Nudge::duration(problem),
        };
        nudge?.map(Some).ok_or_else(|| wrong(format!("the problem does not have the parameter `{self}`")))
    }
}

/// Named parameters as vectors.
impl Problem {
    /// Returns the value of a parameter: the initial state (nx), a target in the form of
    /// [`set_references`](Self::set_references), a weight, the weights of entries, the placement of a contact as a
    /// homogeneous matrix (16 numbers, row by row), or a duration (s). Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the problem does not have the parameter, or if its value differs from knot to knot.
    pub fn parameter(&mut self, parameter: &Parameter) -> Result<Vec<f64>, Error> {
        match parameter.nudge(self)? {
            None => Ok(self.x0().to_vec()),
            Some(nudge) => {
                nudge.value().ok_or_else(|| wrong(format!("the value of `{parameter}` differs from knot to knot")))
            }
        }
    }

    /// Sets a parameter to a value, in the form that [`parameter`](Self::parameter) returns, at all knots that have it.
    /// The problem is not built again, and solvers continue with it.
    ///
    /// ```
    /// # use condyle_dynamics::{Vec3, robots};
    /// # use condyle_optimal::Problem;
    /// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// # let arm = std::sync::Arc::new(robots::arm7());
    /// # let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    /// # let costs = vec![Cost::new("reach", 1.0, reach, Activation::Quadratic)];
    /// # let knot = FreeDynamics::running(arm.clone(), 0.02, costs.clone())?;
    /// # let end = FreeDynamics::terminal(arm, costs)?;
    /// # let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
    /// problem.set_parameter(&"target/reach".parse()?, &[0.3, 0.2, 0.5])?;
    /// assert_eq!(problem.parameter(&"target/reach".parse()?)?, [0.3, 0.2, 0.5]);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the problem does not have the parameter, [`Error::Length`] for another number of
    /// entries, and the errors of the setter of the parameter.
    pub fn set_parameter(&mut self, parameter: &Parameter, numbers: &[f64]) -> Result<(), Error> {
        let Some(nudge) = parameter.nudge(self)? else { return self.set_x0(numbers) };
        let expected = nudge.value_size();
        Error::check("numbers", numbers, expected)?;
        nudge.set(self, numbers)
    }
}

/// Derivatives of the optimality conditions of all knots with respect to one parameter.
#[derive(Debug, Clone)]
pub struct ParameterJacobian {
    size: usize,
    /// Derivatives ∂x̂₀/∂p, ndx × size.
    initial: DMatrix<f64>,
    /// Derivatives of each knot; `None` for knots that do not depend on the parameter.
    knots: Vec<Option<KnotJacobian>>,
}

/// Derivatives of one knot with respect to a parameter, with a column for each entry; `None` for zeros.
#[derive(Debug, Clone)]
struct KnotJacobian {
    /// Derivatives of ∇Lₜ, ndx + nu rows.
    gradient: Option<DMatrix<f64>>,
    /// Derivatives of φₜ, ndx rows; empty at the terminal knot.
    next: Option<DMatrix<f64>>,
    /// Derivatives of the active rows minus their bounds.
    rows: Option<DMatrix<f64>>,
    /// Derivatives of the active bounds on controls.
    bounds: Option<DMatrix<f64>>,
    /// Number of active rows, and of active bounds on controls.
    active: [usize; 2],
}

impl ParameterJacobian {
    /// Returns the number of entries of the parameter.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns the number N of knots before the terminal one.
    pub(super) fn horizon(&self) -> usize {
        self.knots.len() - 1
    }

    /// Subtracts ζᵀ ∂(∇L)/∂p + η⁺ᵀ ∂φ/∂p + γᵀ ∂g/∂p + κᵀ ∂b/∂p of knot t from `to`, and η₀ᵀ ∂x̂₀/∂p at knot 0.
    #[track_caller]
    pub(super) fn subtract_products(&self, shape: &Shape, t: usize, adjoint: &Vectors, kappa: &[f64], to: &mut [f64]) {
        let Vectors { x, u, dynamics: eta, rows } = adjoint;
        assert_length("knots of the parameter's Jacobian", self.knots.len(), shape.horizon() + 1);
        let mut subtract = |J: Option<&DMatrix<f64>>, first: usize, numbers: &[f64]| {
            for (to, column) in to.iter_mut().zip(J.iter().flat_map(|J| J.column_iter())) {
                *to -= column.rows(first, numbers.len()).dot(&slice(numbers));
            }
        };
        if t == 0 {
            subtract(Some(&self.initial), 0, &eta[shape.dx(0)]);
        }
        let Some(knot) = &self.knots[t] else { return };
        assert_length("active rows of the parameter's Jacobian", knot.active[0], rows[t].len());
        assert_length("active bounds of the parameter's Jacobian", knot.active[1], kappa.len());
        subtract(knot.gradient.as_ref(), 0, &x[shape.dx(t)]);
        subtract(knot.gradient.as_ref(), shape.ndx, &u[shape.u(t)]);
        if t < shape.horizon() {
            subtract(knot.next.as_ref(), 0, &eta[shape.dx(t + 1)]);
        }
        subtract(knot.rows.as_ref(), 0, rows[t].as_slice());
        subtract(knot.bounds.as_ref(), 0, kappa);
    }

    /// Writes the right-hand sides of the linearised optimality conditions for entry j. Returns the derivatives of the
    /// active bounds on controls, for each knot.
    pub(super) fn write_column(&self, j: usize, shape: &Shape, given: &mut Vectors) -> Vec<Vec<f64>> {
        let ndx = shape.ndx;
        given.dynamics[..ndx].copy_from_slice(self.initial.column(j).as_slice());
        let write = |(t, knot): (usize, &Option<KnotJacobian>)| {
            let Some(knot) = knot else { return Vec::new() };
            if let Some(gradient) = &knot.gradient {
                let column = gradient.column(j);
                let (by_x, by_u) = column.as_slice().split_at(ndx);
                let negate = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to = -from);
                negate(&mut given.x[shape.dx(t)], by_x);
                negate(&mut given.u[shape.u(t)], by_u);
            }
            if let Some(next) = &knot.next {
                given.dynamics[shape.dx(t + 1)].copy_from_slice(next.column(j).as_slice());
            }
            if let Some(rows) = &knot.rows {
                given.rows[t].copy_from(&rows.column(j));
            }
            match &knot.bounds {
                Some(bounds) => bounds.column(j).iter().copied().collect(),
                None => vec![0.0; knot.active[1]],
            }
        };
        self.knots.iter().enumerate().map(write).collect()
    }
}

/// Optimality conditions of all knots of a problem, at a solution of another problem.
struct Conditions {
    gradients: Vec<DVector<f64>>,
    /// Gaps x̂₀ ⊖ x₀ and φₜ ⊖ xₜ₊₁.
    gaps: Vec<DVector<f64>>,
    /// Active rows minus their bounds, and active bounds on controls.
    rows: Vec<DVector<f64>>,
    bounds: Vec<DVector<f64>>,
}

impl Conditions {
    fn new(point: &Point, problem: &mut Problem) -> Self {
        let mut knots = problem.lq_knots();
        let gradients = point.gradients(problem, [&point.xs, &point.us], &mut knots);
        let (gaps, _) = point.values(problem);
        let row = |[c, lower, upper]: [f64; 3], side: bool| c - if side { upper } else { lower };
        let rows = point.rows.iter().zip(&knots).map(|(rows, knot)| {
            let all: Vec<[f64; 3]> = knot.rows.bounds().collect();
            from_active(&rows.active, |i, side| row(all[i], side))
        });
        let bounds = point.controls.iter().enumerate().map(|(t, active)| match problem.action(t).bounds(t) {
            Some((lower, upper)) => from_active(active, |i, side| if side { upper[i] } else { lower[i] }),
            None => DVector::zeros(active.len()),
        });
        Self { gradients, rows: rows.collect(), bounds: bounds.collect(), gaps }
    }
}

/// Returns a number for each active bound.
fn from_active(active: &[Active], number: impl Fn(usize, bool) -> f64) -> DVector<f64> {
    DVector::from_iterator(active.len(), active.iter().map(|&(i, side)| number(i, side)))
}

/// Differences of the optimality conditions, which are collected column by column.
struct Differences<'a> {
    point: &'a Point,
    jacobian: ParameterJacobian,
    /// Whether the states are a vector space.
    is_flat: bool,
}

/// Step of mixed differences of ⊕ and ⊖, whose truncation error is about its fourth power.
const BRACKET_STEP: f64 = 3e-3;

impl<'a> Differences<'a> {
    fn new(point: &'a Point, size: usize, problem: &Problem) -> Self {
        let Shape { nx, ndx, .. } = point.shape;
        let initial = DMatrix::zeros(ndx, size);
        let knots = (0..=point.shape.horizon()).map(|_| None).collect();
        let (x, change, mut sum) = (&point.xs[..nx], vec![0.1; ndx], vec![0.0; nx]);
        problem.action(0).integrate(x, &change, &mut sum);
        let is_flat = nx == ndx && sum.iter().zip(x).all(|(sum, x)| (sum - x - 0.1).abs() < 1e-9);
        Self { point, jacobian: ParameterJacobian { size, initial, knots }, is_flat }
    }

    /// Returns the derivatives ∂²/∂s∂τ λᵀ(((x ⊕ s e) ⊕ τ ε) ⊖ x) at zero for all unit vectors ε, where x and λ belong
    /// to knot t + 1. A and B of knot t are expressed in the tangent space at φ = x ⊕ s e, and λ in the one at x; the
    /// derivatives are half the Lie bracket λᵀ[e, ε]. Central differences have no terms of the third and fourth order.
    fn brackets(&self, problem: &Problem, t: usize, e: &[f64]) -> DVector<f64> {
        let (point, ndx, h) = (self.point, e.len(), BRACKET_STEP);
        let (x, lambda) = (&point.xs[point.shape.x(t + 1)], &point.lambda[t + 1]);
        let (action, length) = (problem.action(t), slice(e).norm());
        if self.is_flat || length == 0.0 {
            return DVector::zeros(ndx);
        }
        let (mut moved, mut twice, mut change) = (x.to_vec(), x.to_vec(), DVector::zeros(ndx));
        let mut corner = |i: usize, s: f64, tau: f64| {
            let along: Vec<f64> = e.iter().map(|e| e * s / length).collect();
            action.integrate(x, &along, &mut moved);
            let mut unit = vec![0.0; ndx];
            unit[i] = tau;
            action.integrate(&moved, &unit, &mut twice);
            action.difference(x, &twice, change.as_mut_slice());
            lambda.dot(&change)
        };
        let mixed = |i: usize| corner(i, h, h) - corner(i, h, -h) - corner(i, -h, h) + corner(i, -h, -h);
        DVector::from_iterator(ndx, (0..ndx).map(mixed)) * (length / (4.0 * h * h))
    }

    /// Writes column j from the conditions at two values of the parameter, which are `span` apart.
    fn write(&mut self, j: usize, above: &Conditions, below: &Conditions, span: f64, problem: &Problem) {
        let brackets: Vec<DVector<f64>> = (0..self.point.shape.horizon())
            .map(|t| self.brackets(problem, t, ((&above.gaps[t + 1] - &below.gaps[t + 1]) / span).as_slice()))
            .collect();
        let Self { point, jacobian: ParameterJacobian { size, initial, knots }, .. } = self;
        let zeros = |rows: usize| DMatrix::zeros(rows, *size);
        let slope = |a: &[DVector<f64>], b: &[DVector<f64>], t: usize| match (a.get(t), b.get(t)) {
            (Some(a), Some(b)) => (a - b) / span,
            _ => DVector::zeros(0),
        };
        initial.column_mut(j).copy_from(&slope(&above.gaps, &below.gaps, 0));
        for (t, knot) in knots.iter_mut().enumerate() {
            let mut gradient = slope(&above.gradients, &below.gradients, t);
            if let Some(bracket) = brackets.get(t) {
                let lq = &point.knots[t];
                gradient.rows_mut(0, lq.ndx()).gemv_tr(1.0, &lq.A, bracket, 1.0);
                gradient.rows_mut(lq.ndx(), lq.nu()).gemv_tr(1.0, &lq.B, bracket, 1.0);
            }
            let next = slope(&above.gaps, &below.gaps, t + 1);
            let (rows, bounds) = (slope(&above.rows, &below.rows, t), slope(&above.bounds, &below.bounds, t));
            let is_zero = |column: &DVector<f64>| column.iter().all(|x| *x == 0.0);
            let all = [&gradient, &next, &rows, &bounds];
            if knot.is_none() && all.into_iter().all(is_zero) {
                continue;
            }
            let active = [rows.len(), bounds.len()];
            let knot = knot.get_or_insert_with(|| KnotJacobian {
                gradient: None,
                next: None,
                rows: None,
                bounds: None,
                active,
            });
            let KnotJacobian { gradient: G, next: N, rows: R, bounds: B, .. } = knot;
            for (matrix, column) in [G, N, R, B].into_iter().zip(all) {
                if matrix.is_some() || !is_zero(column) {
                    matrix.get_or_insert_with(|| zeros(column.len())).column_mut(j).copy_from(column);
                }
            }
        }
    }
}

/// Returns the derivatives of the optimality conditions with respect to a named parameter.
pub(super) fn jacobian(
    point: &Point,
    problem: &mut Problem,
    parameter: &Parameter,
) -> Result<ParameterJacobian, Error> {
    let Some(nudge) = parameter.nudge(problem)? else {
        let mut differences = Differences::new(point, point.shape.ndx, problem);
        differences.jacobian.initial.fill_with_identity();
        return Ok(differences.jacobian);
    };
    let mut differences = Differences::new(point, nudge.size(), problem);
    let result = write_all(&nudge, problem, &mut differences);
    nudge.restore(problem)?;
    result.map(|()| differences.jacobian)
}

/// Writes the differences of all entries of a parameter. The problem then has other values.
fn write_all(nudge: &Nudge, problem: &mut Problem, differences: &mut Differences<'_>) -> Result<(), Error> {
    let point = differences.point;
    let base = Conditions::new(point, problem);
    point.check_gradients(&base.gradients)?;
    for j in 0..nudge.size() {
        let step = nudge.step();
        nudge.apply(problem, j, step)?;
        let above = Conditions::new(point, problem);
        match nudge.is_linear() {
            true => differences.write(j, &above, &base, step, problem),
            false => {
                nudge.apply(problem, j, -step)?;
                let below = Conditions::new(point, problem);
                differences.write(j, &above, &below, 2.0 * step, problem);
            }
        }
    }
    Ok(())
}

/// Largest relative difference of costs and states of a problem that is built again: rounding errors.
const SAME: f64 = 1e-6;

/// Function that evaluates a problem.
pub(super) type Evaluate<'a> = &'a mut dyn FnMut(&mut Problem) -> Result<(), Error>;

/// Returns the derivatives of the optimality conditions with respect to parameters of which problems are built. `build`
/// receives a change of the parameters, and calls its second argument with the problem.
pub(super) fn jacobian_with(
    point: &Point,
    problem: &Problem,
    size: usize,
    step: f64,
    mut build: impl FnMut(&[f64], Evaluate<'_>) -> Result<(), Error>,
) -> Result<ParameterJacobian, Error> {
    if !(step > 0.0 && step.is_finite()) {
        return Err(Error::Setting { name: "step", value: step, allowed: "finite and above 0" });
    }
    problem.shape().check(&point.shape)?;
    let mut differences = Differences::new(point, size, problem);
    let mut change = vec![0.0; size];
    build(&change, &mut |problem| {
        problem.shape().check(&point.shape)?;
        point.check_values(problem, SAME, &mut |what| {
            wrong(format!("the problem that is built without a change is another one than the solved problem: {what}"))
        })
    })?;
    for j in 0..size {
        let mut conditions = |h: f64| {
            let mut found = None;
            change[j] = h;
            let result = build(&change, &mut |problem| {
                problem.shape().check(&point.shape)?;
                problem.check_bounds()?;
                found = Some(Conditions::new(point, problem));
                Ok(())
            });
            change[j] = 0.0;
            result?;
            found.ok_or_else(|| wrong("a parameter's problem was not evaluated"))
        };
        let (above, below) = (conditions(step)?, conditions(-step)?);
        differences.write(j, &above, &below, 2.0 * step, problem);
    }
    Ok(differences.jacobian)
}
