//! Conversion of the solution of an optimal control problem into a plan for the whole-body controller.

use condyle_dynamics::Model;
use condyle_optimal::Solution;
use condyle_wholebody::{Error, Plan, PlanData};

/// Converts a solution of an optimal control problem to a plan for
/// [`WholeBodyController::track`](condyle_wholebody::WholeBodyController::track).
///
/// - `times`: times of the N + 1 knots (s); the two knots of an impact have the same time.
/// - `touches`: for each interval between two knots, whether each contact of the controller touches the ground. Length:
///   N · number of contacts.
/// - `fade`: duration over which contacts are loaded and unloaded (s).
///
/// Controls and gains are copied from the solution. An impact has no controls, so the plan contains zeros for the
/// impact.
///
/// ```
/// use condyle::optimal::robot::{Activation, Cost, FreeDynamics, Residual};
/// use condyle::optimal::{Fddp, Problem};
/// use condyle::{plan_of, robots};
/// use std::sync::Arc;
/// let arm = Arc::new(robots::arm7());
/// let x0 = vec![0.1; 14];
/// let rest = Cost::new("rest", 1.0, Residual::State { reference: vec![0.0; 14] }, Activation::Quadratic);
/// let mut step = FreeDynamics::running(arm.clone(), 0.05, vec![rest.clone()])?;
/// let us = step.quasi_static(&x0).repeat(10);
/// let end = FreeDynamics::terminal(arm.clone(), vec![rest])?;
/// let mut problem = Problem::new(x0.clone(), vec![Box::new(step)], vec![0; 10], Box::new(end))?;
/// let mut solver = Fddp::new(&problem);
/// let solution = solver.solve(&mut problem, &x0.repeat(11), &us)?;
///
/// let times: Vec<f64> = (0..=10).map(|k| 0.05 * f64::from(k)).collect();
/// let plan = plan_of(&arm, solution, &times, &[], 0.0)?; // an arm without contacts
/// let mut tau = [0.0; 7];
/// plan.feedback(0.0, &x0[..7], &x0[7..], &mut tau)?;
/// assert_eq!(tau[..], *solution.u(0)); // on the plan, the plan's control
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`Error`] for arrays of the wrong length.
pub fn plan_of(model: &Model, solution: &Solution, times: &[f64], touches: &[bool], fade: f64) -> Result<Plan, Error> {
    let (nv, steps) = (model.nv(), solution.K.len());
    let nu = (0..steps).map(|k| solution.u(k).len()).max().unwrap_or(0);
    let (mut controls, mut gains) = (vec![0.0; steps * nu], vec![0.0; steps * nu * 2 * nv]);
    for k in (0..steps).filter(|&k| solution.u(k).len() == nu) {
        controls[k * nu..][..nu].copy_from_slice(solution.u(k));
        for i in 0..nu {
            for j in 0..2 * nv {
                gains[(k * nu + i) * 2 * nv + j] = solution.K[k][(i, j)];
            }
        }
    }
    let contacts = touches.len() / steps.max(1);
    let (times, touches) = (times.to_vec(), touches.to_vec());
    Plan::new(model, contacts, PlanData { times, states: solution.xs.clone(), controls, gains, touches, fade })
}
