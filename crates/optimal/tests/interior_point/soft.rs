//! Soft limits: closed forms, optima of the augmented Lagrangian, exact limits, and problems that hard limits make
//! infeasible.

use crate::common::random;
use crate::{COST, Case, LIMIT, hop_with, quadratic, reach, reach_with, solve, without_times};
use condyle_dynamics::{Inertia, Joint, ModelBuilder, Se3, Sym3, Vec3, WORLD};
use condyle_optimal::robot::{FreeDynamics, Limit, Residual, Soft};
use condyle_optimal::{AugmentedLagrangian, Fddp, InteriorPoint, Problem, Solution, Status};
use rand::RngExt;
use std::sync::Arc;

/// Number of knots of the slider, and their duration.
const KNOTS: usize = 20;
const DT: f64 = 0.1;

/// Creates a slider of 1 kg that moves at 1 m/s along an axis, for 2 s. Only its efforts have a cost. `limit` applies
/// to the position at the end, which is 2 m without efforts.
fn slider(direction: f64, limit: impl Fn(Limit) -> Limit, lower: f64, upper: f64) -> Case {
    let mut builder = ModelBuilder::new("slider");
    let axis = Vec3::new(1.0, 0.0, 0.0);
    let body = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(1e-2));
    builder.body("slider", WORLD, Joint::Prismatic { axis }, Se3::identity(), body);
    let model = Arc::new(builder.build().unwrap());
    let free = f64::INFINITY;
    let wall = Limit::new("wall", Residual::State { reference: vec![0.0; 2] }, vec![lower, -free], vec![upper, free]);
    let effort = quadratic("effort", 1.0, Residual::Control { reference: vec![0.0] });
    let knot = FreeDynamics::running(model.clone(), DT, vec![effort]).unwrap();
    let end = FreeDynamics::terminal(model, vec![]).unwrap().with_limits(vec![limit(wall)]).unwrap();
    let x0 = vec![0.0, direction];
    let problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; KNOTS], Box::new(end)).unwrap();
    Case { name: "slider", problem, xs: x0.repeat(KNOTS + 1), us: vec![0.0; KNOTS] }
}

/// Uses the curvature of the dynamics, which matters where limits give way far.
fn curved(solver: &mut InteriorPoint) {
    solver.settings.second_order = true;
}

/// Solves by the augmented Lagrangian.
fn solve_by_penalties(case: &mut Case) -> AugmentedLagrangian {
    let mut solver = AugmentedLagrangian::new(&case.problem);
    solver.inner.max_iterations = 300;
    (solver.settings.tolerance, solver.settings.tolerance_dual) = (1e-8, 1e-7);
    solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    solver
}

/// Compares the slider with its closed form. An effort u of knot k moves the end by Δt² (N − k) u, so that a change δ
/// of the end costs at least ½ κ δ² with κ = Δt / Σ (Δt² (N − k))². The wall at 1 m changes the end by 1 − e:
///
/// ```text
/// κ ≤ linear:   e = 0, y = κ        κ > linear:   e = (κ − linear) / (κ + quadratic), y = linear + quadratic · e
/// ```
#[test]
fn a_slider_yields_to_a_wall_as_its_closed_form() {
    let kappa = DT / (0..KNOTS).map(|k| (DT * DT * (KNOTS - k) as f64).powi(2)).sum::<f64>();
    for (linear, quadratic) in [(0.5, 0.0), (0.0, 0.4), (0.1, 0.7), (0.35 * kappa, 5.0), (1.5, 0.0), (2.0, 3.0)] {
        let (linear, quadratic) = (linear * kappa, quadratic * kappa);
        let e = if kappa <= linear { 0.0 } else { (kappa - linear) / (kappa + quadratic) };
        let y = if kappa <= linear { kappa } else { linear + quadratic * e };
        let (effort, soft) = (0.5 * kappa * (1.0 - e).powi(2), linear * e + 0.5 * quadratic * e * e);
        let soften = |limit: Limit| limit.softened(linear, quadratic);
        for (sign, lower, upper) in
            [(1.0, f64::NEG_INFINITY, 1.0), (-1.0, -1.0, f64::INFINITY), (1.0, 1.0, 1.0), (-1.0, -1.0, -1.0)]
        {
            let mut case = slider(sign, soften, lower, upper);
            let (solution, interior_point) = solve(&mut case, |solver| solver.settings.tolerance = 1e-8);
            assert_eq!(solution.status, Status::Converged);
            let penalties = solve_by_penalties(&mut case);
            assert_eq!(penalties.solution().status, Status::Converged);
            for (solution, outcome) in
                [(&solution, interior_point.outcome()), (penalties.solution(), penalties.outcome())]
            {
                let end = sign * solution.x(KNOTS)[0];
                let what = format!("{linear} {quadratic} [{lower}, {upper}]: {end} {:?}", outcome);
                assert!((end - 1.0 - e).abs() < 1e-5, "{what}");
                assert!((outcome.multipliers[KNOTS][0] - sign * y).abs() < 1e-5, "{what}");
                assert!((outcome.cost - effort).abs() < 1e-5, "{what}");
                assert!((outcome.soft_cost - soft).abs() < 1e-5, "{what}");
                assert!(outcome.primal < 1e-6, "{what}");
                assert_eq!(outcome.gave_way.len(), usize::from(e > 0.0), "{what}");
                if let [row] = &outcome.gave_way[..] {
                    assert_eq!((row.knot, row.name.as_deref(), row.entry), (KNOTS, Some("wall"), 0));
                    assert!((row.amount - e).abs() < 1e-5, "{what}");
                }
            }
        }
    }
}

/// Compares optima with the optima of the augmented Lagrangian, which starts there because there are several: soft
/// efforts and speeds of an arm, hard efforts with soft speeds, and soft cones and efforts of a quadruped.
#[test]
fn optima_are_those_of_the_augmented_lagrangian() {
    let only = |name: &'static str, linear, quadratic| {
        move |limit: Limit| if limit.name == name { limit.softened(linear, quadratic) } else { limit }
    };
    let cones = |limit: Limit| if limit.name == "weak" { limit } else { limit.softened(1e-3, 1e-4) };
    let cases = [
        reach_with(20.0, |limit| limit.softened(1e-2, 1e-2)),
        reach_with(34.0, only("state", 1e-3, 0.0)),
        reach_with(34.0, only("effort", 0.0, 1e-2)),
        hop_with(true, |limit| limit.softened(1e-3, 1e-3)),
        hop_with(true, cones),
    ];
    for (k, mut case) in cases.into_iter().enumerate() {
        let (solution, solver) = solve(&mut case, curved);
        (case.xs, case.us) = (solution.xs.clone(), solution.us.clone());
        let penalties = solve_by_penalties(&mut case);
        let (ours, theirs) = (solver.outcome(), penalties.outcome());
        assert_eq!(solution.status, Status::Converged, "{k}");
        assert_eq!(penalties.solution().status, Status::Converged, "{k}");
        assert!(ours.primal <= LIMIT && theirs.primal <= LIMIT, "{k}: {:e} {:e}", ours.primal, theirs.primal);
        assert!(!ours.gave_way.is_empty(), "{k}: nothing gave way");
        let [a, b] = [ours, theirs].map(|outcome| outcome.cost + outcome.soft_cost);
        assert!((a - b).abs() < 1e-6 * (1.0 + b.abs()), "{k}: {a} {b}");
        assert!((ours.soft_cost - theirs.soft_cost).abs() < COST * (1.0 + b.abs()), "{k}: {ours:?}");
    }
}

fn largest_difference(a: &Solution, b: &Solution) -> f64 {
    a.xs.iter().chain(&a.us).zip(b.xs.iter().chain(&b.us)).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

/// Checks that a linear weight above the multipliers of the hard limits gives their solution, and that a weight below
/// them bounds the multipliers.
#[test]
fn a_linear_weight_is_exact() {
    let sharp = |solver: &mut InteriorPoint| solver.settings.tolerance = 1e-8;
    let (hard, solver) = solve(&mut reach(34.0), sharp);
    assert_eq!(hard.status, Status::Converged);
    let largest = solver.outcome().multipliers.iter().flatten().fold(0.0, |most: f64, y| most.max(y.abs()));

    for factor in [1.2, 1e3] {
        let (soft, solver) = solve(&mut reach_with(34.0, |limit| limit.softened(factor * largest, 0.0)), sharp);
        assert_eq!(soft.status, Status::Converged, "{factor}");
        assert!(largest_difference(&soft, &hard) < 1e-4, "{factor}: {}", largest_difference(&soft, &hard));
        assert!((soft.cost - hard.cost).abs() < LIMIT * (1.0 + hard.cost), "{factor}");
        assert!(solver.outcome().gave_way.is_empty(), "{factor}: {:?}", solver.outcome().gave_way);
    }

    let weight = 0.3 * largest;
    let (soft, solver) = solve(&mut reach_with(34.0, |limit| limit.softened(weight, 0.0)), sharp);
    assert_eq!(soft.status, Status::Converged);
    let outcome = solver.outcome();
    assert!(outcome.multipliers.iter().flatten().all(|y| y.abs() < weight + 1e-6));
    assert!(!outcome.gave_way.is_empty() && soft.cost < hard.cost);
    for row in &outcome.gave_way {
        assert!((outcome.multipliers[row.knot][row.row].abs() - weight).abs() < 1e-5, "{row:?}");
    }
    let amounts = outcome.gave_way.iter().map(|row| row.amount).sum::<f64>();
    assert!((outcome.soft_cost - weight * amounts).abs() < 1e-5);
}

/// Checks problems whose limits cannot hold, as hard limits: they are solved, and the rows that gave way are named.
#[test]
fn infeasible_limits_give_way() {
    let soft_effort = |limit: Limit| if limit.name == "effort" { limit.softened(1.0, 0.0) } else { limit };
    let (solution, _) = solve(&mut reach(10.0), |_| {}); // too weak to hold the arm
    assert_ne!(solution.status, Status::Converged);
    let (solution, solver) = solve(&mut reach_with(10.0, soft_effort), |_| {});
    assert_eq!(solution.status, Status::Converged);
    assert!(solver.outcome().primal <= LIMIT && solver.outcome().worst.as_ref().is_none_or(|w| w.amount <= LIMIT));
    assert!(solver.outcome().gave_way.iter().any(|row| row.name.as_deref() == Some("effort") && row.amount > 1.0));
    assert!(solver.outcome().gave_way.is_sorted_by_key(|row| (row.knot, row.row)));

    // x̂₀ is beyond a soft limit of the state, which no control changes
    let mut case = reach_with(30.0, |limit| if limit.name == "state" { limit.softened(10.0, 0.0) } else { limit });
    let mut x0 = case.problem.x0().to_vec();
    x0[9] = 0.9;
    case.problem.set_x0(&x0).unwrap();
    let (solution, solver) = solve(&mut case, |_| {});
    let penalties = solve_by_penalties(&mut case);
    for (status, outcome) in [(solution.status, solver.outcome()), (penalties.solution().status, penalties.outcome())] {
        assert_eq!(status, Status::Converged);
        assert!(outcome.primal <= LIMIT && outcome.multipliers[0].len() == 21);
        let first = outcome.gave_way.first().unwrap();
        assert_eq!((first.knot, first.name.as_deref(), first.entry), (0, Some("state"), 9));
        assert!((first.amount - 0.1).abs() < 1e-12 && outcome.soft_cost > 1.0 - 1e-9);
    }
}

/// Checks a receding horizon whose limits must give way, by resumed solves and by ticks.
#[test]
fn receding_horizons_carry_soft_limits() {
    let soften = |limit: Limit| limit.softened(1e-3, 1e-4);
    let mut case = reach_with(30.0, soften);
    let (solution, solver) = solve(&mut case, curved);
    assert_eq!(solution.status, Status::Converged);
    let (cold, mut random) = (solution.trace.len(), random());
    for ticks in [false, true] {
        let mut case = reach_with(30.0, soften);
        let (_, mut solver) = solve(&mut case, curved);
        for tick in 0..8 {
            let x: Vec<f64> = solver.solution().x(1).iter().map(|x| x + random.random_range(-0.01..0.01)).collect();
            case.problem.shift(0).unwrap();
            solver.shift(&mut case.problem).unwrap();
            case.problem.set_x0(&x).unwrap();
            if ticks {
                solver.tick(&mut case.problem, 3).unwrap();
                let Solution { xs, us, .. } = solver.solution();
                assert!(xs.iter().chain(us).all(|x| x.is_finite()));
            } else {
                let solution = solver.resume(&mut case.problem).unwrap();
                assert_eq!(solution.status, Status::Converged, "{tick}");
                assert!(solution.trace.len() < cold, "{tick}: {} and {cold} iterations", solution.trace.len());
            }
        }
        // after several ticks at one state, the trajectory is nearly the optimum of this state
        if ticks {
            (0..10).for_each(|_| _ = solver.tick(&mut case.problem, 3).unwrap());
            let (now, Solution { xs, us, .. }) = (solver.outcome().clone(), solver.solution().clone());
            assert!(now.primal < 1e-3 && !now.gave_way.is_empty(), "{now:?}");
            let mut again = InteriorPoint::new(&case.problem);
            assert_eq!(again.solve(&mut case.problem, &xs, &us).unwrap().status, Status::Converged);
            let [now, optimum] = [&now, again.outcome()].map(|outcome| outcome.cost + outcome.soft_cost);
            assert!((now - optimum).abs() < 1e-3 * optimum, "{now} {optimum}");
        }
    }
    assert!(!solver.outcome().gave_way.is_empty());
}

#[test]
fn any_number_of_threads_finds_the_same_bits() {
    for mut case in [reach_with(20.0, |limit| limit.softened(0.1, 0.1)), hop_with(true, |l| l.softened(1e-3, 1e-3))] {
        let mut expected = None;
        for threads in [1, 2, 5] {
            let (solution, solver) = solve(&mut case, |solver| {
                solver.settings.max_iterations = 6;
                solver.settings.threads = threads;
            });
            let found = (without_times(solution), solver.outcome().clone());
            assert_eq!(*expected.get_or_insert_with(|| found.clone()), found, "{}: {threads} threads", case.name);
        }
    }
}

/// Checks that [`Fddp`] alone minimises the cost of soft limits where they give way by more than a little.
#[test]
fn fddp_treats_a_soft_limit_as_its_cost() {
    let (linear, quadratic) = (0.02, 0.01);
    let kappa = DT / (0..KNOTS).map(|k| (DT * DT * (KNOTS - k) as f64).powi(2)).sum::<f64>();
    let mut case = slider(1.0, |limit| limit.softened(linear, quadratic), -1.0, 1.0);
    let mut solver = Fddp::new(&case.problem);
    let solution = solver.solve(&mut case.problem, &case.xs, &case.us).unwrap();
    // beyond the rounding, the quadratic weight acts in series with the penalty of 10
    let quadratic = quadratic / (1.0 + quadratic / 10.0);
    let e = (kappa - linear) / (kappa + quadratic);
    assert!((solution.x(KNOTS)[0] - 1.0 - e).abs() < 5e-3, "{} {e}", solution.x(KNOTS)[0]);
}

#[test]
fn weights_are_checked() {
    let make = |linear, quadratic| {
        let limit = Limit::equality("rest", Residual::State { reference: vec![0.0; 14] }).softened(linear, quadratic);
        FreeDynamics::terminal(Arc::new(condyle_dynamics::robots::arm7()), vec![]).unwrap().with_limits(vec![limit])
    };
    for (linear, quadratic) in [(-1.0, 0.0), (0.0, -1.0), (0.0, 0.0), (f64::INFINITY, 0.0), (1.0, f64::NAN)].into_iter()
    {
        let error = make(linear, quadratic).unwrap_err().to_string();
        assert!(error.contains("rest") && error.contains("soft weights"), "{error}");
    }
    assert!(make(1.0, 0.0).is_ok() && make(0.0, 1e-3).is_ok());
    let limit = Limit::equality("rest", Residual::State { reference: vec![] });
    assert_eq!((limit.soft, limit.softened(1.0, 2.0).soft), (None, Some(Soft { linear: 1.0, quadratic: 2.0 })));
}
