//! Warm starts outside the bounds, or far from any solution. The result must be within the bounds, or the status must
//! report a failure.

use super::{ARM, quadratic};
use condyle_dynamics::{ContactConstraint as Held, Model, ReferenceFrame, Vec3, neutral, robots};
use condyle_optimal::robot::{Contact, ContactDynamics, FreeDynamics, Limit, Residual};
use condyle_optimal::{AugmentedLagrangian, Fddp, Problem, Solution, Status, ViolationKind};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Maximum effort of each joint (N m). To hold the initial posture, the second joint needs 29.6 N m.
pub(super) const WEAK: f64 = 20.0;
pub(super) const HORIZON: usize = 15;
/// Cost of the optimum, computed with IPOPT; the next constant is the accuracy of this cost.
const IPOPT: f64 = 0.7869;
const DIGITS: f64 = 2e-4;

pub(super) fn control() -> Residual {
    Residual::Control { reference: vec![0.0; 7] }
}

/// Creates the problem of an arm with the terminal action `end`. Efforts are bounded by limits if `limits` is set, else
/// by control bounds. Also returns the efforts that hold the arm still.
pub(super) fn arm(limits: bool, end: FreeDynamics) -> (Problem, Vec<f64>) {
    let costs =
        vec![quadratic("rest", 0.1, Residual::State { reference: ARM.to_vec() }), quadratic("effort", 1e-3, control())];
    let mut knot = FreeDynamics::running(Arc::new(robots::arm7()), 0.05, costs).unwrap();
    let still = knot.quasi_static(&ARM).repeat(HORIZON);
    let (lower, upper) = (vec![-WEAK; 7], vec![WEAK; 7]);
    let knot = match limits {
        true => knot.with_limits(vec![Limit::new("weak", control(), lower, upper)]).unwrap(),
        false => knot.with_bounds(lower, upper),
    };
    (Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end)).unwrap(), still)
}

fn point() -> Residual {
    Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.35, 0.2, 0.6) }
}

/// Returns a terminal action with two exact constraints: the tool is at a point, and the arm is at rest.
pub(super) fn exact() -> FreeDynamics {
    let infinite = f64::INFINITY;
    let [lower, upper] = [-infinite, infinite].map(|q| [vec![q; 7], vec![0.0; 7]].concat());
    let stop = Limit::new("stop", Residual::State { reference: ARM.to_vec() }, lower, upper);
    let end = FreeDynamics::terminal(Arc::new(robots::arm7()), vec![]).unwrap();
    end.with_limits(vec![Limit::equality("reach", point()), stop]).unwrap()
}

pub(super) fn clipped(us: &[f64], bound: f64) -> Vec<f64> {
    us.iter().map(|u| u.clamp(-bound, bound)).collect()
}

fn most(us: &[f64]) -> f64 {
    us.iter().fold(0.0, |most, u| most.max(u.abs()))
}

/// Returns random controls between −`size` and `size`; if `saturated`, each control is ±`size`.
fn random(n: usize, size: f64, seed: u64, saturated: bool) -> Vec<f64> {
    let mut random = StdRng::seed_from_u64(seed);
    let mut one = || 2.0 * random.random::<f64>() - 1.0;
    (0..n).map(|_| one()).map(|u| if saturated { size * u.signum() } else { size * u }).collect()
}

#[test]
fn a_start_outside_of_the_bounds_is_moved_into_them() {
    let (_, still) = arm(false, exact());
    assert!(most(&still) > 29.0);
    for (limits, start) in [(false, still.clone()), (false, clipped(&still, WEAK)), (true, still.clone())] {
        let (mut problem, _) = arm(limits, exact());
        let mut solver = AugmentedLagrangian::new(&problem);
        solver.inner.project_warm_start = false; // the augmented Lagrangian projects the start with either value
        let solution = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &start).unwrap();
        assert!(solution.status == Status::Converged && most(&solution.us) <= WEAK + 1e-6);
        let cost = solver.outcome().cost;
        assert!((cost - IPOPT).abs() < DIGITS, "{cost}");
    }
    let reach = vec![quadratic("reach", 100.0, point())];
    let end = || FreeDynamics::terminal(Arc::new(robots::arm7()), reach.clone()).unwrap();
    let (mut problem, _) = arm(false, end());
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
    assert!(solution.status == Status::MaxIterations || solution.status == Status::Converged);
    assert!(most(&solution.us) <= WEAK);
    // as in Crocoddyl, the start is not moved, no step from this start is accepted, and the status reports this
    solver.settings.project_warm_start = false;
    let kept = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
    assert!(kept.status != Status::Converged && kept.us == still);
    // the setting then also applies to resumed and shifted trajectories
    solver.settings.project_warm_start = true;
    solver.settings.max_iterations = 0;
    assert!(most(&solver.resume(&mut problem).unwrap().us) <= WEAK);
    solver.settings.project_warm_start = false;
    solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
    solver.settings.project_warm_start = true;
    problem.shift(0).unwrap();
    solver.shift(&mut problem).unwrap();
    assert!(most(solver.solution().u(HORIZON - 1)) <= WEAK && most(solver.solution().u(0)) > WEAK);
}

/// Checks that bounds which become narrower between two solves also apply to the resumed trajectory.
#[test]
fn bounds_may_change_between_solves() {
    let (mut problem, still) = arm(false, exact());
    let mut solver = AugmentedLagrangian::new(&problem);
    solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
    let knot: &mut FreeDynamics = problem.model_mut(0).unwrap();
    *knot = knot.clone().with_bounds(vec![-19.0; 7], vec![19.0; 7]);
    let solution = solver.resume(&mut problem).unwrap();
    assert!(solution.status == Status::Converged && most(&solution.us) <= 19.0);
}

/// Asserts two properties of any solution: a solution that violates a bound or a constraint is not converged, and a
/// feasible problem is never reported as infeasible.
fn assert_honest(solution: &Solution, primal: f64, bound: f64, case: &str) {
    assert_ne!(solution.status, Status::Infeasible, "{case}");
    assert!(solution.xs.iter().chain(&solution.us).all(|x| x.is_finite()), "{case}");
    if solution.status == Status::Converged {
        assert!(primal <= 1e-6 && most(&solution.us) <= bound + 1e-6, "{case}: {primal:e}");
    }
}

/// Checks starts with controls of ±1 to ±200. Their states all equal the initial state, or are the rollout of the
/// controls. Many of these starts exceed all bounds or diverge.
#[test]
fn any_start_leads_somewhere() {
    let (mut solved, mut count) = (0, 0);
    for (i, size) in [1.0, 20.0, 60.0, 200.0].into_iter().enumerate() {
        for (limits, saturated) in [(false, true), (false, false), (true, true), (true, false)] {
            for rolled in [false, true] {
                let (mut problem, _) = arm(limits, exact());
                let us = random(7 * HORIZON, size, i as u64, saturated);
                let us = if i % 2 == 0 { us } else { clipped(&us, WEAK) };
                let xs = if rolled { problem.rollout(&us).ok() } else { Some(ARM.repeat(HORIZON + 1)) };
                let Some(xs) = xs else { continue };
                let mut solver = AugmentedLagrangian::new(&problem);
                let solution = solver.solve(&mut problem, &xs, &us).unwrap();
                let case = format!("±{size}, limits {limits}, saturated {saturated}, rolled {rolled}");
                println!("{case}: {:?}", solution.status);
                let solution = solution.clone();
                assert_honest(&solution, solver.outcome().primal, WEAK, &case);
                (solved, count) = (solved + usize::from(solution.status == Status::Converged), count + 1);
            }
        }
    }
    assert!(count >= 16 && 4 * solved >= 3 * count, "{solved} of {count}");
}

/// Checks many starts of a quadruped that stands on four feet and moves its trunk forwards with bounded efforts.
#[test]
fn a_stance_starts_anywhere() {
    let model: Arc<Model> = Arc::new(robots::quadruped());
    let mut q = neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    let x0 = [q, vec![0.0; 18]].concat();
    let (bound, horizon) = (80.0, 8);
    let contacts = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(|foot| {
        let reference = ReferenceFrame::LocalWorldAligned;
        Contact::new(foot, Held { reference, kd: 20.0, ..Held::point(model.frame(foot).unwrap()) })
    });
    let com = condyle_dynamics::centroidal_map(&model, &mut condyle_dynamics::Data::new(&model), &x0[..19]).com;
    let mut costs = Vec::new();
    for saturated in [false, true] {
        for size in [0.0, 60.0, 200.0] {
            let cost = vec![
                quadratic("state", 1e-1, Residual::State { reference: x0.clone() }),
                quadratic("effort", 1e-3, Residual::Control { reference: vec![0.0; 12] }),
            ];
            let knot = ContactDynamics::running(model.clone(), &contacts, 0.02, cost).unwrap();
            let mut knot = knot.with_bounds(vec![-bound; 12], vec![bound; 12]);
            let mut us = knot.quasi_static(&x0).repeat(horizon);
            us.iter_mut().zip(random(12 * horizon, size, 3, saturated)).for_each(|(u, add)| *u += add);
            let ahead = Limit::equality("ahead", Residual::CenterOfMass { target: com + Vec3::new(0.02, 0.0, 0.0) });
            let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap().with_limits(vec![ahead]).unwrap();
            let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; horizon], Box::new(end)).unwrap();
            let mut solver = AugmentedLagrangian::new(&problem);
            let solution = solver.solve(&mut problem, &x0.repeat(horizon + 1), &us).unwrap().clone();
            let case = format!("±{size}, saturated {saturated}");
            println!("{case}: {:?} {}", solution.status, solver.outcome().cost);
            assert_honest(&solution, solver.outcome().primal, bound, &case);
            if solution.status == Status::Converged {
                costs.push(solver.outcome().cost);
            }
        }
    }
    assert!(costs.len() >= 4, "{costs:?}");
    assert!(costs.iter().all(|cost| (cost - costs[0]).abs() < 1e-4 * costs[0]), "{costs:?}");
}

/// Checks solutions of FDDP alone. If the status is converged, the solution is within the bounds, with and without
/// projection of the start.
#[test]
fn fddp_never_converges_outside_of_the_bounds() {
    let reach = vec![quadratic("reach", 100.0, point())];
    for project in [true, false] {
        for size in [1.0, 20.0, 60.0, 200.0] {
            for seed in 0..4 {
                let end = FreeDynamics::terminal(Arc::new(robots::arm7()), reach.clone()).unwrap();
                let (mut problem, _) = arm(false, end);
                let us = random(7 * HORIZON, size, seed, seed % 2 == 0);
                let mut solver = Fddp::new(&problem);
                solver.settings.project_warm_start = project;
                let solution = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &us).unwrap();
                let case = format!("±{size}, seed {seed}, projected {project}");
                assert_honest(solution, 0.0, WEAK, &case);
                assert!(!project || most(&solution.us) <= WEAK, "{case}");
                // an iterate within the bounds is better than a start outside the bounds
                let stepped = solution.trace.iter().any(|iteration| iteration.accepted);
                if stepped && solution.status != Status::NotFinite {
                    assert!(most(&solution.us) <= WEAK, "{case}: {:?}", solution.status);
                }
            }
        }
    }
}

/// Checks that a limit which the initial state x̂₀ violates proves infeasibility. All other constraints are still
/// satisfied.
#[test]
fn a_proof_names_the_limit() {
    let mut lower = vec![f64::NEG_INFINITY; 14];
    lower[3] = 0.5;
    let bent = Limit::new("bent", Residual::State { reference: ARM.to_vec() }, lower, vec![f64::INFINITY; 14]);
    let weak = Limit::new("weak", control(), vec![-WEAK; 7], vec![WEAK; 7]);
    let costs =
        vec![quadratic("rest", 0.1, Residual::State { reference: ARM.to_vec() }), quadratic("effort", 1e-3, control())];
    let mut knot = FreeDynamics::running(Arc::new(robots::arm7()), 0.05, costs).unwrap();
    let still = clipped(&knot.quasi_static(&ARM), WEAK).repeat(HORIZON);
    knot.set_limits(0, vec![weak, bent]).unwrap();
    let reach = FreeDynamics::terminal(Arc::new(robots::arm7()), vec![]).unwrap();
    let reach = reach.with_limits(vec![Limit::equality("reach", point())]).unwrap();
    let mut problem = Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(reach)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let solution = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
    assert_eq!(solution.status, Status::Infeasible);
    let worst = solver.outcome().worst.clone().unwrap();
    // the 7 rows of `weak` precede the rows of `bent`
    assert_eq!((worst.kind, worst.knot, worst.row, worst.entry), (ViolationKind::Constraint, 0, 10, 3));
    assert_eq!((worst.name.as_deref(), worst.amount), (Some("bent"), 0.5));
    // the tool reaches its target, and the solve was not repeated from another start
    assert!(solver.outcome().penalty < 1e8);
    let mut placements = condyle_dynamics::Data::new(&robots::arm7());
    let arm = robots::arm7();
    let q = &solver.solution().x(HORIZON)[..7];
    let tool = condyle_dynamics::forward_kinematics(&arm, &mut placements, q).frame(arm.frame("tool").unwrap());
    assert!((tool.translation - Vec3::new(0.35, 0.2, 0.6)).norm_squared().sqrt() < 1e-5);
}

/// Checks that the reported violation can be a gap, in a solve without iterations.
#[test]
fn a_gap_is_named() {
    let (mut problem, still) = arm(true, exact());
    let mut solver = AugmentedLagrangian::new(&problem);
    solver.inner.time_budget = Some(std::time::Duration::ZERO);
    let mut xs = ARM.repeat(HORIZON + 1);
    xs[14 * 4 + 9] = 30.0; // velocity of the third joint at knot 4
    let status = solver.solve(&mut problem, &xs, &clipped(&still, WEAK)).unwrap().status;
    assert_eq!(status, Status::TimeLimit);
    let outcome = solver.outcome();
    let worst = outcome.worst.as_ref().unwrap();
    assert_eq!((worst.kind, worst.amount, &worst.name), (ViolationKind::Gap, outcome.primal, &None));
    assert!(worst.knot == 4 || worst.knot == 5, "{worst}");
}
