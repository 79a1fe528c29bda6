//! Solution at which sensitivities are computed: derivatives, multipliers, and active bounds.
//!
//! The multipliers λ of the dynamics follow from the costs and from the multipliers y of the constraints,
//!
//! ```text
//! Lᵤ = r + Bᵀλ⁺ + Dᵀy,      λ = q + Aᵀλ⁺ + Cᵀy + KᵀLᵤ
//! ```
//!
//! where the last term vanishes at a solution. With it, errors of the solution decay in the recursion as they do in the
//! closed loop with the gains K; the rows of K of controls at a bound are left out.

use super::report::{SensitivityReport, SensitivitySettings, WeakestBound};
use super::wrong;
use crate::error::Error;
use crate::lq::LqKnot;
use crate::problem::{Evaluation, Problem, Shape};
use crate::solvers::{Outcome, Solution, ViolationKind};
use nalgebra::{DMatrix, DVector};

/// Largest relative difference of gradients of an unchanged problem: rounding errors of values that were set back.
const UNCHANGED: f64 = 1e-9;

/// Bound that is active: an index of a control or of a row, and whether the bound is the upper one.
pub(super) type Active = (usize, bool);

/// Constraints of a knot.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// Active rows, in ascending order.
    pub active: Vec<Active>,
    /// Matrices of the active rows, rows × ndx and rows × nu.
    pub C: DMatrix<f64>,
    pub D: DMatrix<f64>,
    /// Multipliers of all rows; zero for rows that are not active.
    pub y: DVector<f64>,
}

/// Solution with its derivatives, multipliers and active bounds.
#[derive(Debug, Clone)]
pub(super) struct Point {
    pub shape: Shape,
    pub xs: Vec<f64>,
    pub us: Vec<f64>,
    /// Derivatives of each knot, without rows. Their Hessians are replaced by the requested ones.
    pub knots: Vec<LqKnot>,
    /// Multipliers λ₀ … λ_N of the dynamics.
    pub lambda: Vec<DVector<f64>>,
    pub rows: Vec<Rows>,
    /// Controls at a bound, for each knot in ascending order.
    pub controls: Vec<Vec<Active>>,
    /// Gradients ∇Lₜ of the problem for which the solution was computed, its gaps, and its costs.
    gradients: Vec<DVector<f64>>,
    gaps: Vec<DVector<f64>>,
    costs: Vec<f64>,
}

impl Point {
    /// Evaluates the problem at its solution and completes the report.
    pub(super) fn new(
        problem: &mut Problem,
        solution: &Solution,
        outcome: Option<&Outcome>,
        settings: &SensitivitySettings,
        report: &mut SensitivityReport,
    ) -> Result<Self, Error> {
        problem.check_bounds()?;
        let (shape, mut knots) = (problem.shape().clone(), problem.lq_knots());
        let horizon = shape.horizon();
        problem.calc_diff_as(Evaluation::Rows, &solution.xs, &solution.us, &mut knots);
        let multipliers = (0..=horizon)
            .map(|t| multipliers_of(problem, t, knots[t].rows.len(), outcome))
            .collect::<Result<Vec<_>, _>>()?;
        let mut point = Self {
            lambda: vec![DVector::zeros(shape.ndx); horizon + 1],
            rows: Vec::with_capacity(horizon + 1),
            controls: vec![Vec::new(); horizon + 1],
            xs: solution.xs.clone(),
            us: solution.us.clone(),
            gradients: Vec::new(),
            gaps: Vec::new(),
            costs: Vec::new(),
            shape,
            knots,
        };
        for (t, y) in multipliers.into_iter().enumerate() {
            point.select_rows(t, y, report);
        }
        for t in (0..=horizon).rev() {
            let L_u = point.control_gradient(t, problem, report);
            let Self { knots, lambda, rows, .. } = &mut point;
            let (knot, Rows { C, y, .. }) = (&knots[t], &rows[t]);
            let mut costate = knot.q.clone();
            if t < horizon {
                costate.gemv_tr(1.0, &knot.A, &lambda[t + 1], 1.0);
                costate.gemv_tr(1.0, &solution.K[t], &L_u, 1.0);
            }
            let active: Vec<f64> = rows[t].active.iter().map(|(row, _)| y[*row]).collect();
            costate.gemv_tr(1.0, C, &DVector::from_vec(active), 1.0);
            lambda[t] = costate;
        }
        point.gradients = point.gradients_of(&point.knots);
        point.knots.iter_mut().for_each(|knot| knot.rows.clear());
        (point.gaps, point.costs) = point.values(problem);
        report.primal = point.gaps.iter().fold(report.primal, |largest, gap| larger(largest, gap.amax()));
        report.active_controls = point.controls.iter().map(Vec::len).sum();
        report.active_rows = point.rows.iter().map(|rows| rows.active.len()).sum();
        report.strict_complementarity = report.margin >= settings.strictness;
        for (what, residual) in [("gradient of the Lagrangian", report.stationarity), ("gap", report.primal)] {
            if residual.is_nan() || residual > settings.tolerance {
                return Err(wrong(format!(
                    "the largest {what} is {residual:.3e}, expected at most {:.3e}: the solution is inexact, or the \
                     problem has changed since the solve",
                    settings.tolerance
                )));
            }
        }
        Ok(point)
    }

    /// Returns `Ok` if the gradients ∇Lₜ of a problem are still the ones of this solution.
    pub(super) fn check_gradients(&self, found: &[DVector<f64>]) -> Result<(), Error> {
        let differs = |(own, found): &(&DVector<f64>, &DVector<f64>)| {
            let scale = 1.0 + own.amax().max(found.amax());
            (*own - *found).iter().any(|d| d.is_nan() || d.abs() > UNCHANGED * scale)
        };
        match self.gradients.iter().zip(found).position(|pair| differs(&pair)) {
            Some(t) => Err(wrong(format!("knot {t} of the problem has changed since the sensitivity was created"))),
            None => Ok(()),
        }
    }

    /// Returns whether a constraint is active.
    pub(super) fn has_rows(&self) -> bool {
        self.rows.iter().any(|rows| !rows.active.is_empty())
    }

    /// Stores the active rows of knot t, from the multipliers of all its rows.
    fn select_rows(&mut self, t: usize, mut y: DVector<f64>, report: &mut SensitivityReport) {
        let knot = &self.knots[t];
        let mut active = Vec::new();
        for (row, [c, lower, upper]) in knot.rows.bounds().enumerate() {
            let at = WeakestBound { kind: ViolationKind::Constraint, knot: t, row };
            if lower == upper {
                report.primal = report.primal.max((c - lower).abs());
                active.push((row, false));
                continue;
            }
            let sides = [(false, c - lower, -y[row]), (true, upper - c, y[row])];
            match active_side(at, sides, report) {
                Some(side) => active.push((row, side)),
                None => y[row] = 0.0,
            }
        }
        let (ndx, nu) = (knot.ndx(), knot.nu());
        let indices: Vec<usize> = active.iter().map(|(row, _)| *row).collect();
        let [C, D] = match indices.is_empty() {
            true => [DMatrix::zeros(0, ndx), DMatrix::zeros(0, nu)],
            false => knot.rows.dense(ndx, nu).map(|all| all.select_rows(&indices)),
        };
        self.rows.push(Rows { active, C, D, y });
    }

    /// Finds the controls of knot t that are at a bound. Returns the gradient Lᵤ, with zeros for these controls.
    fn control_gradient(&mut self, t: usize, problem: &Problem, report: &mut SensitivityReport) -> DVector<f64> {
        let (knot, Rows { active, D, y, .. }) = (&self.knots[t], &self.rows[t]);
        let nu = knot.nu();
        if nu == 0 {
            return DVector::zeros(0);
        }
        let y = DVector::from_iterator(active.len(), active.iter().map(|(row, _)| y[*row]));
        let terms = [knot.r.clone(), knot.B.tr_mul(&self.lambda[t + 1]), D.tr_mul(&y)];
        let mut L_u = &terms[0] + &terms[1] + &terms[2];
        let (u, bounds) = (&self.us[self.shape.u(t)], problem.action(t).bounds(t));
        for i in 0..nu {
            if let Some((lower, upper)) = bounds.map(|(lower, upper)| (lower[i], upper[i])) {
                let at = WeakestBound { kind: ViolationKind::ControlBound, knot: t, row: i };
                let sides = [(false, u[i] - lower, L_u[i]), (true, upper - u[i], -L_u[i])];
                let side = if lower == upper { Some(false) } else { active_side(at, sides, report) };
                if let Some(side) = side {
                    self.controls[t].push((i, side));
                    L_u[i] = 0.0;
                    continue;
                }
            }
            let scale = 1.0 + terms.iter().map(|term| term[i].abs()).sum::<f64>();
            report.stationarity = larger(report.stationarity, L_u[i].abs() / scale);
        }
        L_u
    }

    /// Returns `Ok` if a problem is the one of this solution: its initial state, gradients and equations.
    pub(super) fn check_problem(&self, problem: &mut Problem) -> Result<(), Error> {
        problem.shape().check(&self.shape)?;
        let mut knots = problem.lq_knots();
        let found = self.gradients(problem, [&self.xs, &self.us], &mut knots);
        self.check_gradients(&found)?;
        self.check_values(problem, UNCHANGED, &mut |what| {
            wrong(format!("{what}: the problem has changed since the sensitivity was created"))
        })
    }

    /// Returns `Ok` if gaps and costs of a problem are the ones of this solution, up to a relative error.
    pub(super) fn check_values(
        &self,
        problem: &mut Problem,
        tolerance: f64,
        error: &mut dyn FnMut(String) -> Error,
    ) -> Result<(), Error> {
        let (gaps, costs) = self.values(problem);
        for (t, (own, found)) in self.costs.iter().zip(&costs).enumerate() {
            let distance = (own - found).abs();
            if distance.is_nan() || distance > tolerance * (1.0 + own.abs()) {
                return Err(error(format!("the cost of knot {t} is {found:.9e}, expected {own:.9e}")));
            }
        }
        for (t, (own, found)) in self.gaps.iter().zip(&gaps).enumerate() {
            let (scale, distance) = (1.0 + own.amax(), (own - found).amax());
            if distance.is_nan() || distance > tolerance * scale {
                let what = if t == 0 { "initial state".to_owned() } else { format!("next state of knot {}", t - 1) };
                return Err(error(format!("the {what} differs by {distance:.3e}")));
            }
        }
        Ok(())
    }

    /// Returns the gaps x̂₀ ⊖ x₀ and φₜ(xₜ, uₜ) ⊖ xₜ₊₁ of all knots, and the costs.
    pub(super) fn values(&self, problem: &mut Problem) -> (Vec<DVector<f64>>, Vec<f64>) {
        let (nx, ndx, horizon) = (self.shape.nx, self.shape.ndx, self.shape.horizon());
        let (mut next, mut costs) = (vec![0.0; horizon * nx], vec![0.0; horizon + 1]);
        problem.calc(&self.xs, &self.us, &mut next, &mut costs);
        let predicted = [problem.x0(), &next].concat();
        let pairs = predicted.chunks_exact(nx).zip(self.xs.chunks_exact(nx));
        let gap = |(predicted, x): (&[f64], &[f64])| {
            let mut gap = DVector::zeros(ndx);
            problem.difference(x, predicted, gap.as_mut_slice());
            gap
        };
        (pairs.map(gap).collect(), costs)
    }

    /// Computes the gradients ∇Lₜ = (q + Aᵀλ⁺ + Cᵀy, r + Bᵀλ⁺ + Dᵀy) of all knots of a problem at (`xs`, `us`), with
    /// the multipliers of this solution. `knots` is scratch.
    pub(super) fn gradients(
        &self,
        problem: &mut Problem,
        [xs, us]: [&[f64]; 2],
        knots: &mut [LqKnot],
    ) -> Vec<DVector<f64>> {
        problem.calc_diff_as(Evaluation::Rows, xs, us, knots);
        self.gradients_of(knots)
    }

    /// Returns the gradients ∇Lₜ from the derivatives of all knots, with the multipliers of this solution.
    fn gradients_of(&self, knots: &[LqKnot]) -> Vec<DVector<f64>> {
        let gradient = |(t, knot): (usize, &LqKnot)| {
            let (ndx, nu) = (knot.ndx(), knot.nu());
            let mut all = DVector::zeros(ndx + nu);
            let (mut by_x, mut by_u) = all.rows_range_pair_mut(..ndx, ndx..);
            by_x.copy_from(&knot.q);
            by_u.copy_from(&knot.r);
            if let Some(lambda) = self.lambda.get(t + 1) {
                by_x.gemv_tr(1.0, &knot.A, lambda, 1.0);
                by_u.gemv_tr(1.0, &knot.B, lambda, 1.0);
            }
            let y = &self.rows[t].y;
            if y.iter().any(|y| *y != 0.0) {
                let [C, D] = knot.rows.dense(ndx, nu);
                by_x.gemv_tr(1.0, &C, y, 1.0);
                by_u.gemv_tr(1.0, &D, y, 1.0);
            }
            all
        };
        knots.iter().enumerate().map(gradient).collect()
    }
}

/// Returns the multipliers of the `count` rows of knot t.
fn multipliers_of(
    problem: &mut Problem,
    t: usize,
    count: usize,
    outcome: Option<&Outcome>,
) -> Result<DVector<f64>, Error> {
    if count == 0 {
        return Ok(DVector::zeros(0));
    }
    let mut soft = None;
    problem.constraints(t, &mut |bounded| {
        soft = soft.take().or(bounded.parts.iter().find(|part| part.soft.is_some()).map(|part| part.name.clone()));
    });
    if let Some(name) = soft {
        return Err(wrong(format!("limit `{name}` is soft, and sensitivities need limits that hold exactly")));
    }
    let Some(outcome) = outcome else {
        return Err(wrong(format!("knot {t} has constraints: expected the outcome of a solver that enforces them")));
    };
    let found = outcome.multipliers.get(t).map_or(0, Vec::len);
    // an interior point appends the multipliers of bounds on controls
    match found >= count {
        true => Ok(DVector::from_column_slice(&outcome.multipliers[t][..count])),
        false => Err(wrong(format!("knot {t}: expected multipliers of {count} rows, found {found}"))),
    }
}

/// Returns the side of an inequality that is active, if any: whether it is the upper bound. Each side has its distance
/// from the bound and its multiplier, one of which is zero at a solution with strict complementarity. A side is active
/// if its multiplier is not below its distance.
fn active_side(at: WeakestBound, sides: [(bool, f64, f64); 2], report: &mut SensitivityReport) -> Option<bool> {
    let mut active = None;
    for (side, distance, multiplier) in sides {
        if distance == f64::INFINITY {
            continue;
        }
        report.add(at, multiplier.max(0.0), distance.max(0.0));
        let is_active = distance.max(0.0) <= multiplier;
        // an active bound must hold exactly, an inactive one must have no multiplier and must not be violated
        report.primal = larger(report.primal, if is_active { distance.abs() } else { (-distance).max(0.0) });
        if is_active {
            active = Some(side);
        }
    }
    active
}

/// Returns the larger number; NaN if `x` is NaN.
fn larger(largest: f64, x: f64) -> f64 {
    if x > largest || x.is_nan() { x } else { largest }
}
