//! Derivatives of a solution with respect to the parameters of its problem.
//!
//! The optimality conditions of a problem determine states, controls and multipliers as functions of the parameters p.
//! Their linearisation at the solution is a linear-quadratic problem. One sweep factorises it; after that, each
//! derivative is a linear pass over the knots.
#![allow(non_snake_case)] // names follow the literature: A, B, Q, …, G, E

mod adjoint;
mod curvature;
mod forward;
mod lanes;
mod many;
mod parameter;
mod parameters;
mod point;
mod report;
mod system;

pub use adjoint::Adjoint;
pub use forward::SolutionJacobian;
pub use many::Sensitivities;
pub use parameter::{Parameter, ParameterValues};
pub use parameters::ParameterJacobian;
pub use report::{Curvature, SensitivityReport, SensitivitySettings, WeakestBound};

use crate::error::Error;
use crate::problem::Problem;
use crate::solvers::{Outcome, Solution, Status};
use point::Point;
use system::System;

/// Derivatives of a converged solution with respect to parameters of its problem.
///
/// At the solution, let λₜ be the multipliers of the dynamics and y the multipliers of the constraints g. The
/// Lagrangian of knot t is Lₜ = ℓₜ + λₜ₊₁ᵀ φₜ + yᵀ g. The derivatives of δx and δu along a change δp of the parameters
/// solve
///
/// ```text
/// minimise   Σₜ ½ δzᵀ ∇²Lₜ δz + δzᵀ ∂(∇Lₜ)/∂p δp          z = (x, u)
/// subject to  δx₀ = ∂x̂₀/∂p δp,    δxₜ₊₁ = A δx + B δu + ∂φₜ/∂p δp,    C δx + D δu + ∂g/∂p δp = 0
/// ```
///
/// where the last rows are the active constraints; controls at a bound move with the bound. [`new`](Self::new)
/// computes the derivatives at the solution, and factorises this problem by one [`Sweep`](crate::Sweep).
/// [`adjoint`](Self::adjoint) solves it for the gradients of a loss L(x, u), and [`forward`](Self::forward) for each
/// entry of a parameter; each takes a pass over the knots with the factors.
///
/// Active constraints are held by a method of multipliers with the same factors, so that they may be redundant.
///
/// # When a sensitivity does not exist
/// A control or constraint may be at a bound with a multiplier of zero. The solution then has a kink there: the
/// derivative differs on both sides. [`SensitivityReport::strict_complementarity`] is then false, and the result is the
/// derivative with the bound held. At a solution that is no strict minimum, [`new`](Self::new) returns an error.
///
/// # Examples
/// ```
/// use condyle_optimal::{Fddp, Lqr, Problem, Sensitivity, SensitivitySettings};
/// # use condyle_optimal::LqKnot;
/// // x⁺ = x + u with the cost ½ (x² + u²): the first control is proportional to the initial state.
/// # let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
/// # (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0, 1.0);
/// # let (knot, end) = (Lqr::new(knot), Lqr::new(end));
/// let mut problem = Problem::new(vec![1.0], vec![Box::new(knot)], vec![0; 30], Box::new(end))?;
/// let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 31], &[0.0; 30])?.clone();
/// let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default())?;
///
/// // the loss L = u₀ has the gradient 1 with respect to u₀
/// let mut by_controls = [0.0; 30];
/// by_controls[0] = 1.0;
/// let adjoint = sensitivity.adjoint(&[0.0; 31], &by_controls)?;
/// assert!((adjoint.x0[0] - solution.u(0)[0]).abs() < 1e-8); // u₀ = K x₀ with x₀ = 1
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sensitivity {
    settings: SensitivitySettings,
    report: SensitivityReport,
    point: Point,
    system: System,
    adjoint: Adjoint,
}

impl Sensitivity {
    /// Computes the derivatives of `problem` at its solution, and factorises the linearised optimality conditions.
    /// `outcome` contains the multipliers of constraints; it may be `None` for a problem without limits. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if
    /// - the solution has not converged, or does not satisfy the optimality conditions of `problem` up to
    ///   [`tolerance`](SensitivitySettings::tolerance), for example because the problem has changed since the solve,
    /// - the problem has constraints and `outcome` is `None` or has other rows, or a soft limit,
    /// - [`Curvature::Dynamics`] is requested and a knot does not have second derivatives of its dynamics,
    /// - the solution is no strict minimum, or the active constraints contradict each other.
    ///
    /// [`Error::Length`] or [`Error::Dimension`] if the solution has other dimensions than the problem.
    pub fn new(
        problem: &mut Problem,
        solution: &Solution,
        outcome: Option<&Outcome>,
        settings: SensitivitySettings,
    ) -> Result<Self, Error> {
        settings.check()?;
        problem.shape().check(solution.shape())?;
        if solution.is_empty() {
            return Err(wrong("the solver has not solved the problem yet"));
        }
        if solution.status != Status::Converged {
            return Err(wrong(format!("the solution {}, expected one that converged", solution.status)));
        }
        let mut report = SensitivityReport::new(settings.curvature);
        let mut point = Point::new(problem, solution, outcome, &settings, &mut report)?;
        match settings.curvature {
            Curvature::GaussNewton => {}
            Curvature::Dynamics => curvature::add_dynamics(problem, &mut point)?,
            Curvature::Exact => curvature::write_exact(problem, &mut point),
        }
        let system = System::new(&point)?;
        let adjoint = Adjoint::new(&point);
        Ok(Self { settings, report, point, system, adjoint })
    }

    /// Returns `Ok` if a problem is still the one of this solution. One evaluation of the problem. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the initial state, a cost or the dynamics have changed; [`Error::Length`] or
    /// [`Error::Dimension`] for a problem with other dimensions.
    pub fn check_problem(&self, problem: &mut Problem) -> Result<(), Error> {
        self.point.check_problem(problem)
    }

    /// Returns the report: residuals of the optimality conditions, active bounds, and strict complementarity.
    pub fn report(&self) -> &SensitivityReport {
        &self.report
    }

    /// Returns the settings.
    pub fn settings(&self) -> &SensitivitySettings {
        &self.settings
    }

    /// Solves the adjoint problem for a loss L. `by_states` contains the gradients ∂L/∂xₜ in the tangent space, (N + 1)
    /// · ndx numbers, and `by_controls` the gradients ∂L/∂uₜ, all controls one after the other. Knots after the last
    /// gradient that is not zero take no backward pass. Allocates nothing without active constraints.
    ///
    /// # Errors
    /// [`Error::Length`] or [`Error::NotFinite`] for a wrong argument.
    pub fn adjoint(&mut self, by_states: &[f64], by_controls: &[f64]) -> Result<&Adjoint, Error> {
        let shape = &self.point.shape;
        Error::check("by_states", by_states, (shape.horizon() + 1) * shape.ndx)?;
        Error::check("by_controls", by_controls, shape.offsets[shape.horizon()])?;
        self.adjoint.run(&self.point, &mut self.system, [by_states, by_controls])?;
        Ok(&self.adjoint)
    }

    /// Returns the derivatives of the optimality conditions with respect to a parameter, for
    /// [`Adjoint::gradient`] and [`forward`](Self::forward). One evaluation of the problem detects changes since this
    /// object was created. A weight takes one further evaluation for each entry; another parameter takes two. The
    /// problem has its old values afterwards. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the problem does not have the parameter, or has changed since this sensitivity was
    /// created; the errors of the setter that changes the parameter.
    pub fn jacobian(&self, problem: &mut Problem, parameter: &Parameter) -> Result<ParameterJacobian, Error> {
        problem.shape().check(&self.point.shape)?;
        parameters::jacobian(&self.point, problem, parameter)
    }

    /// Returns the derivatives of the optimality conditions with respect to `size` parameters of one's own. `build`
    /// returns the problem for a change of these parameters from `problem`. Any number may thus be a parameter, such as
    /// the inertia of a body. `build` is called without a change first, and then twice for each parameter, with a
    /// change of ±`step`. The derivatives are central differences. Allocates.
    ///
    /// # Errors
    /// The errors of `build`; [`Error::Sensitivity`] if the problem without a change has other costs or other next
    /// states at the solution than the solved one; [`Error::Dimension`] or [`Error::Length`] if a problem has other
    /// dimensions.
    pub fn jacobian_of(
        &self,
        problem: &Problem,
        size: usize,
        step: f64,
        mut build: impl FnMut(&[f64]) -> Result<Problem, Error>,
    ) -> Result<ParameterJacobian, Error> {
        self.jacobian_with(problem, size, step, |change, evaluate| evaluate(&mut build(change)?))
    }

    /// Computes [`jacobian_of`](Self::jacobian_of) with problems that `build` lends to its second argument.
    ///
    /// # Errors
    /// The same errors as [`jacobian_of`](Self::jacobian_of).
    #[doc(hidden)]
    pub fn jacobian_with(
        &self,
        problem: &Problem,
        size: usize,
        step: f64,
        build: impl FnMut(&[f64], parameters::Evaluate<'_>) -> Result<(), Error>,
    ) -> Result<ParameterJacobian, Error> {
        parameters::jacobian_with(&self.point, problem, size, step, build)
    }

    /// Returns the derivatives of all states and controls with respect to a parameter. One pass over the knots for each
    /// entry; for many parameters and one loss, [`adjoint`](Self::adjoint) is cheaper. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if active constraints contradict each other.
    pub fn forward(&mut self, parameter: &ParameterJacobian) -> Result<SolutionJacobian, Error> {
        forward::run(&self.point, &mut self.system, parameter)
    }

    /// Returns the derivative ∂u₀/∂x̂₀ of the first control, nu × ndx, which is the gradient of the policy that a
    /// controller executes. Without active constraints it is the gain K₀ of the factorisation, and takes no further
    /// computation. Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if active constraints contradict each other.
    pub fn first_control_by_x0(&mut self) -> Result<nalgebra::DMatrix<f64>, Error> {
        if !self.point.has_rows() {
            return Ok(self.system.first_gain().clone());
        }
        let shape = &self.point.shape;
        let (nu, ndx) = (shape.nu(0), shape.ndx);
        let (by_states, mut by_controls) = (vec![0.0; (shape.horizon() + 1) * ndx], vec![0.0; self.point.us.len()]);
        let mut K = nalgebra::DMatrix::zeros(nu, ndx);
        for i in 0..nu {
            by_controls[i] = 1.0;
            K.row_mut(i).copy_from_slice(&self.adjoint(&by_states, &by_controls)?.x0);
            by_controls[i] = 0.0;
        }
        Ok(K)
    }
}

/// Returns the error of a sensitivity.
fn wrong(what: impl Into<String>) -> Error {
    Error::Sensitivity { what: what.into() }
}
