//! From an optimal control problem's solution to what the whole-body controller tracks.

use condyle_dynamics::Model;
use condyle_optimal::Solution;
use condyle_wholebody::{Error, Plan, PlanData};

/// The plan of a solution, for [`WholeBodyController::track`](condyle_wholebody::WholeBodyController::track).
///
/// times: of the N + 1 knots (s); an impact's two knots share theirs. touches: whether each of the controller's contacts
/// touches from each knot to the next, flat: N·contacts. fade: over how long contacts are loaded and unloaded (s). Controls
/// and gains are taken over from knots that have one control for each actuated coordinate; impacts have none.
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
