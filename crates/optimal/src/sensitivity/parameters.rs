//! Derivatives of the optimality conditions of a problem with respect to its parameters.

use super::parameter::Parameter;
use super::point::{Active, Point};
use super::system::{Vectors, slice};
use super::wrong;
use crate::error::{Error, assert_length};
use crate::problem::{Problem, Shape};
use crate::robot::Nudge;
use core::ops::Range;
use nalgebra::{DMatrix, DVector};

/// Derivatives of the optimality conditions of all knots with respect to one parameter.
#[derive(Debug, Clone)]
pub struct ParameterJacobian {
    size: usize,
    /// Derivatives ∂x̂₀/∂p, ndx × size.
    initial: DMatrix<f64>,
    /// Derivatives of each knot; `None` for knots that do not depend on the parameter.
    knots: Vec<Option<KnotJacobian>>,
}

/// Derivatives of one knot with respect to a parameter, with a column for each entry.
#[derive(Debug, Clone)]
struct KnotJacobian {
    /// Derivatives of ∇Lₜ, ndx + nu rows.
    gradient: Columns,
    /// Derivatives of φₜ, ndx rows; empty at the terminal knot.
    next: Columns,
    /// Derivatives of the active rows minus their bounds.
    rows: Columns,
    /// Derivatives of the active bounds on controls.
    bounds: Columns,
    /// Number of active rows, and of active bounds on controls.
    active: [usize; 2],
}

/// Matrix whose columns often have few entries that are not zero, such as the derivatives with respect to a target.
#[derive(Debug, Clone, Default)]
struct Columns {
    /// Range of the rows of each column outside which all entries are zero.
    ranges: Vec<Range<usize>>,
    /// Entries in these ranges, column after column.
    entries: Vec<f64>,
    /// Offset of each column in the entries.
    starts: Vec<usize>,
}

impl KnotJacobian {
    /// Creates derivatives whose first `zeros` columns are zero.
    fn new(active: [usize; 2], zeros: usize) -> Self {
        let empty = || Columns { ranges: vec![0..0; zeros], entries: Vec::new(), starts: vec![0; zeros] };
        Self { gradient: empty(), next: empty(), rows: empty(), bounds: empty(), active }
    }
}

impl Columns {
    /// Appends a column.
    fn push(&mut self, column: &DVector<f64>) {
        let first = column.iter().position(|x| *x != 0.0).unwrap_or(0);
        let end = column.iter().rposition(|x| *x != 0.0).map_or(first, |last| last + 1);
        self.starts.push(self.entries.len());
        self.ranges.push(first..end);
        self.entries.extend_from_slice(&column.as_slice()[first..end]);
    }

    /// Returns column j: the range of its rows, and its entries there. A column that does not exist is zero.
    fn column(&self, j: usize) -> (Range<usize>, &[f64]) {
        let Some(range) = self.ranges.get(j) else { return (0..0, &[]) };
        (range.clone(), &self.entries[self.starts[j]..][..range.len()])
    }

    /// Returns column j as `rows` numbers.
    fn dense(&self, j: usize, rows: usize) -> Vec<f64> {
        let (mut all, (range, entries)) = (vec![0.0; rows], self.column(j));
        all[range].copy_from_slice(entries);
        all
    }

    /// Subtracts the products of all columns with the numbers of the rows from `first` on.
    fn subtract_products(&self, first: usize, numbers: &[f64], to: &mut [f64]) {
        for (j, to) in to.iter_mut().enumerate().take(self.ranges.len()) {
            let (Range { start, end }, entries) = self.column(j);
            let (from, until) = (start.max(first), end.min(first + numbers.len()));
            if from < until {
                let pairs = entries[from - start..until - start].iter().zip(&numbers[from - first..until - first]);
                *to -= pairs.map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
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
        if t == 0 {
            for (to, column) in to.iter_mut().zip(self.initial.column_iter()) {
                *to -= column.dot(&slice(&eta[shape.dx(0)]));
            }
        }
        let Some(knot) = &self.knots[t] else { return };
        assert_length("active rows of the parameter's Jacobian", knot.active[0], rows[t].len());
        assert_length("active bounds of the parameter's Jacobian", knot.active[1], kappa.len());
        knot.gradient.subtract_products(0, &x[shape.dx(t)], to);
        knot.gradient.subtract_products(shape.ndx, &u[shape.u(t)], to);
        if t < shape.horizon() {
            knot.next.subtract_products(0, &eta[shape.dx(t + 1)], to);
        }
        knot.rows.subtract_products(0, rows[t].as_slice(), to);
        knot.bounds.subtract_products(0, kappa, to);
    }

    /// Writes the right-hand sides of the linearised optimality conditions for entry j. Returns the derivatives of the
    /// active bounds on controls, for each knot.
    pub(super) fn write_column(&self, j: usize, shape: &Shape, given: &mut Vectors) -> Vec<Vec<f64>> {
        let ndx = shape.ndx;
        given.dynamics[..ndx].copy_from_slice(self.initial.column(j).as_slice());
        let write = |(t, knot): (usize, &Option<KnotJacobian>)| {
            let Some(knot) = knot else { return Vec::new() };
            let column = knot.gradient.dense(j, ndx + shape.nu(t));
            let (by_x, by_u) = column.split_at(ndx);
            let negate = |to: &mut [f64], from: &[f64]| to.iter_mut().zip(from).for_each(|(to, from)| *to = -from);
            negate(&mut given.x[shape.dx(t)], by_x);
            negate(&mut given.u[shape.u(t)], by_u);
            if t < shape.horizon() {
                given.dynamics[shape.dx(t + 1)].copy_from_slice(&knot.next.dense(j, ndx));
            }
            given.rows[t].copy_from_slice(&knot.rows.dense(j, knot.active[0]));
            knot.bounds.dense(j, knot.active[1])
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
        let Self { point, jacobian: ParameterJacobian { initial, knots, .. }, .. } = self;
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
            let all = [&gradient, &next, &rows, &bounds];
            if knot.is_none() && all.into_iter().all(|column| column.iter().all(|x| *x == 0.0)) {
                continue;
            }
            let active = [rows.len(), bounds.len()];
            let knot = knot.get_or_insert_with(|| KnotJacobian::new(active, j));
            let KnotJacobian { gradient: G, next: N, rows: R, bounds: B, .. } = knot;
            [G, N, R, B].into_iter().zip(all).for_each(|(matrix, column)| matrix.push(column));
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
        let step = nudge.step(j);
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
