//! Rollouts of many control sequences.

use super::trot::trot;
use condyle_dynamics::{Model, integrate, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle_optimal::{Error, Problem, RolloutResults, Rollouts};
use rand::RngExt;
use rand::SeedableRng;
use rand::rngs::StdRng;
use std::sync::Arc;

/// Number of sequences: no multiple of a number of lanes.
const COUNT: usize = 21;

/// Returns a problem of an arm without contacts, and controls that hold the arm.
fn arm() -> (Problem, Vec<f64>) {
    let model = Arc::new(robots::arm7());
    let costs = || {
        let frame = Residual::FrameTranslation { frame: "tool".into(), target: [0.3, 0.2, 0.4].into() };
        let effort = Residual::Control { reference: vec![0.0; 7] };
        vec![
            Cost::new("tool", 10.0, frame, Activation::Quadratic),
            Cost::new("effort", 1e-3, effort, Activation::Quadratic),
        ]
    };
    let dynamics = |dt| FreeDynamics::running(model.clone(), dt, costs()).unwrap();
    let end = FreeDynamics::terminal(model.clone(), costs().into_iter().take(1).collect()).unwrap();
    let x0 = [[0.3, -0.4, 0.5, 0.6, -0.2, 0.7, 0.1], [0.0; 7]].concat();
    let mut problem = Problem::new(
        x0.clone(),
        vec![Box::new(dynamics(0.02)), Box::new(dynamics(0.01))],
        vec![0, 0, 1, 1, 0],
        Box::new(end),
    )
    .unwrap();
    let us = problem.quasi_static(&x0.repeat(6)).unwrap();
    (problem, us)
}

/// Calls a test for the arm, and for a quadruped whose contacts change.
fn each(mut test: impl FnMut(&Model, Problem, Vec<f64>)) {
    for (model, (problem, us)) in [(robots::arm7(), arm()), (robots::quadruped(), trot())] {
        test(&model, problem, us);
    }
}

/// Returns COUNT sequences in the neighbourhood of `us`.
fn around(us: &[f64]) -> Vec<f64> {
    let mut random = StdRng::seed_from_u64(1);
    (0..COUNT).flat_map(|_| us.iter().map(|u| u + random.random_range(-1.0..1.0)).collect::<Vec<_>>()).collect()
}

/// Storage for all results.
struct Found {
    costs: Vec<f64>,
    xs: Vec<f64>,
    du: Vec<f64>,
    dx0: Vec<f64>,
}

fn run(rollouts: &mut Rollouts, problem: &Problem, x0: &[f64], us: &[f64]) -> Result<Found, Error> {
    let size = COUNT * (problem.horizon() + 1) * problem.nx();
    let mut found = Found {
        costs: vec![0.0; COUNT],
        xs: vec![0.0; size],
        du: vec![0.0; us.len()],
        dx0: vec![0.0; COUNT * problem.ndx()],
    };
    let Found { costs, xs, du, dx0 } = &mut found;
    rollouts.run(x0, us, RolloutResults { costs, xs, du, dx0 })?;
    Ok(found)
}

/// Returns the cost of a trajectory, added in the order of the knots.
fn cost(problem: &mut Problem, us: &[f64]) -> (Vec<f64>, f64) {
    let xs = problem.rollout(us).unwrap();
    let (mut next, mut costs) = (vec![0.0; xs.len() - problem.nx()], vec![0.0; problem.horizon() + 1]);
    problem.calc(&xs, us, &mut next, &mut costs);
    (xs, costs.iter().fold(0.0, |sum, cost| sum + cost))
}

#[test]
fn each_sequence_is_simulated_as_if_it_were_alone() {
    each(|_, mut problem, us| {
        let (x0, all) = (problem.x0().to_vec(), around(&us));
        let mut rollouts = Rollouts::new(&problem, 1).unwrap();
        let found = run(&mut rollouts, &problem, &x0, &all).unwrap();
        for (i, us) in all.chunks_exact(us.len()).enumerate() {
            let (xs, cost) = cost(&mut problem, us);
            assert!((found.costs[i] - cost).abs() < 1e-12 * cost, "{i}: {} {cost}", found.costs[i]);
            for (found, x) in found.xs[i * xs.len()..][..xs.len()].iter().zip(&xs) {
                assert!((found - x).abs() < 1e-10, "{i}: {found} {x}");
            }
        }
    });
}

#[test]
fn results_do_not_depend_on_the_other_sequences() {
    each(|_, problem, us| {
        let (x0, all) = (problem.x0().to_vec(), around(&us));
        let found = run(&mut Rollouts::new(&problem, 1).unwrap(), &problem, &x0, &all).unwrap();
        let again = run(&mut Rollouts::new(&problem, 3).unwrap(), &problem, &x0, &all).unwrap();
        assert!(found.costs == again.costs && found.xs == again.xs && found.du == again.du && found.dx0 == again.dx0);
        let (mut rollouts, mut alone) = (Rollouts::new(&problem, 1).unwrap(), vec![0.0; us.len()]);
        for (i, us) in all.chunks_exact(us.len()).enumerate() {
            let mut cost = [0.0];
            let results = RolloutResults { costs: &mut cost, du: &mut alone, ..Default::default() };
            rollouts.run(&x0, us, results).unwrap();
            assert!(cost[0] == found.costs[i] && alone == found.du[i * us.len()..][..us.len()], "{i}");
        }
    });
}

#[test]
fn gradients_agree_with_differences() {
    each(|model, mut problem, us| {
        let (x0, all, step) = (problem.x0().to_vec(), around(&us), 1e-6);
        let mut rollouts = Rollouts::new(&problem, 1).unwrap();
        let found = run(&mut rollouts, &problem, &x0, &all).unwrap();
        let scale = found.du.iter().chain(&found.dx0).fold(1.0_f64, |most, x| most.max(x.abs()));
        let i = COUNT - 1; // a sequence of the last group, which is not full
        let mut own = all[i * us.len()..].to_vec();
        for k in 0..own.len() {
            let mut shifted = |by: f64| {
                own[k] += by;
                let cost = cost(&mut problem, &own).1;
                own[k] -= by;
                cost
            };
            let expected = (shifted(step) - shifted(-step)) / (2.0 * step);
            let error = (found.du[i * us.len() + k] - expected).abs();
            assert!(error < 1e-6 * scale, "u {k}: {} {expected}", found.du[i * us.len() + k]);
        }
        let (ndx, own) = (problem.ndx(), all[i * us.len()..].to_vec());
        for k in 0..ndx {
            let mut moved = |by: f64| {
                let (mut dx, (q, v)) = (vec![0.0; ndx], x0.split_at(model.nq()));
                dx[k] = by;
                let (dq, dv) = dx.split_at(model.nv());
                let mut x = x0.clone();
                integrate(model, q, dq, &mut x[..q.len()]);
                x[q.len()..].iter_mut().zip(v.iter().zip(dv)).for_each(|(x, (v, dv))| *x = v + dv);
                problem.set_x0(&x).unwrap();
                cost(&mut problem, &own).1
            };
            let expected = (moved(step) - moved(-step)) / (2.0 * step);
            let error = (found.dx0[i * ndx + k] - expected).abs();
            assert!(error < 1e-6 * scale, "x {k}: {} {expected}", found.dx0[i * ndx + k]);
        }
    });
}

#[test]
fn a_sequence_may_have_its_own_initial_state() {
    let (mut problem, us) = arm();
    let all = around(&us);
    let starts: Vec<f64> = (0..COUNT).flat_map(|i| vec![0.01 * i as f64; 14]).collect();
    let found = run(&mut Rollouts::new(&problem, 2).unwrap(), &problem, &starts, &all).unwrap();
    for (i, us) in all.chunks_exact(us.len()).enumerate() {
        problem.set_x0(&starts[i * 14..][..14]).unwrap();
        let cost = cost(&mut problem, us).1;
        assert!((found.costs[i] - cost).abs() < 1e-12 * cost, "{i}");
    }
}

#[test]
fn a_sequence_that_diverges_fails_alone() {
    each(|_, problem, us| {
        let (x0, mut all, nx) = (problem.x0().to_vec(), around(&us), problem.nx());
        let mut rollouts = Rollouts::new(&problem, 1).unwrap();
        let good = run(&mut rollouts, &problem, &x0, &all).unwrap();
        let (bad, size) = (5, (problem.horizon() + 1) * nx);
        all[bad * us.len() + problem.nu(0) + 1] = f64::NAN; // a control of knot 1
        let found = run(&mut rollouts, &problem, &x0, &all).unwrap();
        assert_eq!(found.costs[bad], f64::INFINITY);
        let xs = &found.xs[bad * size..][..size];
        assert!(xs[..2 * nx].iter().all(|x| x.is_finite()) && xs[2 * nx..].iter().all(|x| x.is_nan()));
        assert!(found.du[bad * us.len()..][..us.len()].iter().all(|x| x.is_nan()));
        for i in (0..COUNT).filter(|i| *i != bad) {
            assert_eq!(found.costs[i], good.costs[i]);
            assert_eq!(found.du[i * us.len()..][..us.len()], good.du[i * us.len()..][..us.len()]);
        }
    });
}

#[test]
fn wrong_arguments_are_named() {
    let (problem, us) = arm();
    let (x0, all) = (problem.x0().to_vec(), around(&us));
    let mut rollouts = Rollouts::new(&problem, 1).unwrap();
    let mut fails = |x0: &[f64], us: &[f64]| match run(&mut rollouts, &problem, x0, us) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("expected an error"),
    };
    assert!(fails(&x0[1..], &all).contains("x0"));
    assert!(fails(&x0, &all[1..]).contains("us"));
    assert!(fails(&[f64::NAN; 14], &all).contains("x0"));
    let (problem, us) = trot();
    let mut x0 = problem.x0().to_vec();
    x0[6] = 2.0; // a quaternion
    let error = run(&mut Rollouts::new(&problem, 1).unwrap(), &problem, &x0, &around(&us)).err().unwrap();
    assert!(error.to_string().contains("x0"), "{error}");
}
