//! Problems with one action per knot. Models of a robot that differ only in costs, references and weights are computed
//! as one group, and the results are bit-identical.

use condyle_dynamics::{ContactConstraint, Model, Vec3, neutral, robots};
use condyle_optimal::robot::{
    Activation, Contact, ContactDynamics, Cost, FreeDynamics, ImpulseDynamics, Knot, Limit, Residual, RobotProblem,
};
use condyle_optimal::{ActionModel, AugmentedLagrangian, Error, Fddp, LqKnot, Problem, Solution};
use std::sync::Arc;

const KNOTS: usize = 13;

fn x0(model: &Model) -> Vec<f64> {
    let mut q = neutral(model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // bends the knees
    [q, vec![0.0; 18]].concat()
}

fn quadratic(name: &str, weight: f64, residual: Residual) -> Cost {
    Cost::new(name, weight, residual, Activation::Quadratic)
}

/// Returns the costs of knot t. References and weights differ between knots, and every third knot has a cost for an
/// additional foot.
fn costs(model: &Model, t: usize) -> Vec<Cost> {
    let time = t as f64;
    let com = Residual::CenterOfMass { target: Vec3::new(0.01 * time, 0.0, 0.35) };
    let mut costs = vec![
        quadratic("state", 1e-1, Residual::State { reference: x0(model) }),
        quadratic("effort", 1e-3 * (1.0 + time), Residual::Control { reference: vec![0.0; 12] }),
        quadratic("com", 1e1, com),
    ];
    if t.is_multiple_of(3) {
        let frame = "RF_foot".into();
        let target = Vec3::new(0.2 + 0.01 * time, -0.1, 0.1);
        costs.push(quadratic("foot", 1e2, Residual::FrameTranslation { frame, target }));
    }
    costs
}

fn limits(t: usize) -> Vec<Limit> {
    let effort = Residual::Control { reference: vec![0.0; 12] };
    vec![Limit::new("effort", effort, vec![-40.0 - t as f64; 12], vec![40.0 + t as f64; 12])]
}

fn contacts(model: &Model, names: &[&str]) -> Vec<Contact> {
    let foot = |name: &str| ContactConstraint { kd: 20.0, ..ContactConstraint::point(model.frame(name).unwrap()) };
    names.iter().map(|name| Contact::new(name, foot(name))).collect()
}

/// Creates six knots on two feet, an impact, and six knots on four feet. If `apart`, each knot has its own action;
/// otherwise each phase has one action.
fn gait(apart: bool, limited: bool) -> (Problem, Vec<f64>, Vec<f64>) {
    let model = Arc::new(robots::quadruped());
    let x0 = x0(&model);
    let (two, four) = (contacts(&model, &["LF_foot", "RH_foot"]), ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]);
    let phases = [(0..6, two), (7..KNOTS, contacts(&model, &four))];
    let stance = |contacts: &[Contact], t: usize| {
        let knot = ContactDynamics::running(model.clone(), contacts, 0.02, costs(&model, t)).unwrap();
        if limited { knot.with_limits(limits(t)).unwrap() } else { knot }
    };
    let (mut models, mut knot_models): (Vec<Box<dyn ActionModel>>, Vec<usize>) = (vec![], vec![0; KNOTS]);
    for (phase, contacts) in &phases {
        if apart {
            for t in phase.clone() {
                knot_models[t] = models.len();
                models.push(Box::new(stance(contacts, t)));
            }
        } else {
            knot_models[phase.clone()].fill(models.len());
            let mut knot = stance(contacts, phase.start);
            for t in phase.clone() {
                knot.set_costs(t, costs(&model, t)).unwrap();
                if limited {
                    knot.set_limits(t, limits(t)).unwrap();
                }
            }
            models.push(Box::new(knot));
        }
    }
    knot_models[6] = models.len();
    let landing = vec![quadratic("state", 1.0, Residual::State { reference: x0.clone() })];
    models.push(Box::new(ImpulseDynamics::instant(model.clone(), &phases[1].1, 0.0, 1e-9, landing.clone()).unwrap()));
    let end = FreeDynamics::terminal(model.clone(), landing).unwrap();
    let mut problem = Problem::new(x0.clone(), models, knot_models, Box::new(end)).unwrap();
    let xs = x0.repeat(KNOTS + 1);
    let us = problem.quasi_static(&xs).unwrap();
    (problem, xs, us)
}

fn solve(problem: &mut Problem, xs: &[f64], us: &[f64], threads: usize) -> Solution {
    let mut solver = Fddp::new(problem);
    (solver.settings.max_iterations, solver.settings.threads) = (8, threads);
    let mut solution = solver.solve(problem, xs, us).unwrap().clone();
    solution.timings = Default::default();
    solution
}

#[test]
fn an_action_for_each_knot_gives_the_bits_of_one_for_all() {
    let ((mut shared, xs, us), (mut apart, same_xs, same_us)) = (gait(false, false), gait(true, false));
    assert!(xs == same_xs && us == same_us);
    let expected = solve(&mut shared, &xs, &us, 1);
    assert!(expected.trace.len() > 3 && expected.trace[0].accepted);
    for threads in [1, 3] {
        assert!(solve(&mut apart, &xs, &us, threads) == expected, "{threads} threads");
    }
}

#[test]
fn derivatives_of_each_knot_are_those_of_its_own_action() {
    let (mut problem, xs, us) = gait(true, true);
    let mut lq_knots = problem.lq_knots();
    problem.calc_diff(&xs, &us, &mut lq_knots);
    let model = Arc::new(robots::quadruped());
    for t in (0..6).chain(7..KNOTS) {
        let names = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
        let contacts = if t < 6 { contacts(&model, &[names[0], names[3]]) } else { contacts(&model, &names) };
        let alone = ContactDynamics::running(model.clone(), &contacts, 0.02, costs(&model, t)).unwrap();
        let mut expected = LqKnot::zeros(36, 12);
        let u = &us[problem.control_range(t)];
        alone.with_limits(limits(t)).unwrap().calc_diff(t, &xs[..37], u, &mut expected);
        let (q, r) = (&lq_knots[t].q, &lq_knots[t].r);
        assert!((q - &expected.q).amax() <= 1e-9 * (1.0 + expected.q.amax()), "knot {t}");
        assert!((r - &expected.r).amax() <= 1e-9 * (1.0 + expected.r.amax()), "knot {t}");
    }
}

#[test]
fn limits_of_each_knot_are_its_own() {
    let [one, other] = [false, true].map(|apart| {
        let (mut problem, xs, us) = gait(apart, true);
        let mut solver = AugmentedLagrangian::new(&problem);
        solver.settings.max_solves = 6;
        let mut solution = solver.solve(&mut problem, &xs, &us).unwrap().clone();
        solution.timings = Default::default();
        (solution, solver.outcome().multipliers.clone())
    });
    assert!(one == other);
    assert!(one.1.iter().flatten().any(|y| *y != 0.0));
}

/// Checks that a change through one of the models affects only this model, also in the copies of other threads.
#[test]
fn a_model_that_was_merged_is_changed_alone() {
    let (mut apart, xs, us) = gait(true, false);
    let (mut shared, ..) = gait(false, false);
    solve(&mut apart, &xs, &us, 3);
    let knot: &mut ContactDynamics = apart.model_mut(4).unwrap();
    assert!(knot.set_weight("com", 77.0).unwrap());
    assert_eq!(knot.costs_mut().terms().len(), 3);
    let knot: &mut ContactDynamics = apart.model_mut(3).unwrap();
    assert_eq!(knot.costs_mut().terms().len(), 4);
    assert_eq!(knot.costs_mut().terms()[2].weight, 1e1);
    let knot: &mut ContactDynamics = shared.model_mut(0).unwrap();
    let wrong = quadratic("effort", 1.0, Residual::Control { reference: vec![0.0; 3] });
    let text = "cost `effort`: its reference has 3 numbers, expected 12 (knot 5)";
    assert_eq!(knot.set_costs(5, vec![wrong]).unwrap_err().to_string(), text);
    assert!(knot.costs_at_mut(4).set_weight("com", 77.0).unwrap());
    let expected = solve(&mut shared, &xs, &us, 1);
    assert!(solve(&mut apart, &xs, &us, 3) == expected);
    assert!(apart.model_mut::<ImpulseDynamics>(4).is_none() && apart.model_mut::<ContactDynamics>(13).is_none());
}

/// Checks that each knot keeps its model when the horizon moves, and that the last knot gets the specified model.
#[test]
fn models_move_with_their_knots() {
    let model = Arc::new(robots::quadruped());
    let standing = contacts(&model, &["LF_foot", "RF_foot", "LH_foot", "RH_foot"]);
    let x0 = x0(&model);
    let build = |times: &[usize]| {
        let knot = |t: &usize| ContactDynamics::running(model.clone(), &standing, 0.02, costs(&model, *t)).unwrap();
        let models = (0..9).map(|t| Box::new(knot(&t)) as Box<dyn ActionModel>).collect();
        let end = Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
        Problem::new(x0.clone(), models, times.to_vec(), end).unwrap()
    };
    let mut moving = build(&[0, 1, 2, 3, 4]);
    let xs = x0.repeat(6);
    let us = moving.quasi_static(&xs).unwrap();
    solve(&mut moving, &xs, &us, 2);
    for (step, last) in [(1, 5), (2, 8), (3, 0)] {
        moving.shift(last).unwrap();
        let times: Vec<usize> = (step..6).chain([8, 0]).take(5).collect();
        assert_eq!(moving.knot_models(), times);
        let expected = solve(&mut build(&times), &xs, &us, 1);
        for threads in [1, 2] {
            assert!(solve(&mut moving, &xs, &us, threads) == expected, "{threads} threads");
        }
    }
}

/// Checks that models which differ in more than costs are not merged. The results are bit-identical to the results of
/// the single actions.
#[test]
fn other_dynamics_stay_apart() {
    let model = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let knot = |dt: f64, bound: Option<f64>| -> Box<dyn ActionModel> {
        let effort = quadratic("effort", 1e-2, Residual::Control { reference: vec![0.0; 7] });
        let knot = FreeDynamics::running(model.clone(), dt, vec![effort]).unwrap();
        match bound {
            Some(b) => Box::new(knot.with_bounds(vec![-b; 7], vec![b; 7])),
            None => Box::new(knot),
        }
    };
    let kinds = [(0.01, None), (0.02, None), (0.01, Some(3.0)), (0.01, Some(4.0)), (0.01, None)];
    let models = kinds.map(|(dt, bound)| knot(dt, bound)).into();
    let end = Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
    let mut problem = Problem::new(x0.clone(), models, vec![0, 1, 2, 3, 4], end).unwrap();
    let us = vec![0.5; 35];
    let xs = problem.rollout(&us).unwrap();
    let (mut x, mut next) = (x0, vec![0.0; 14]);
    for (t, (dt, bound)) in kinds.into_iter().enumerate() {
        knot(dt, bound).calc(t, &x, &[0.5; 7], &mut next);
        assert_eq!(next, xs[14 * (t + 1)..][..14]);
        x.clone_from(&next);
    }
}

#[test]
fn an_end_serves_no_knot_before() {
    let model = Arc::new(robots::arm7());
    let end = || Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
    let knot = || Box::new(FreeDynamics::running(model.clone(), 0.1, vec![]).unwrap());
    let error = Problem::new(vec![0.0; 14], vec![knot(), end()], vec![0, 0, 1], end()).unwrap_err();
    assert_eq!(error, Error::NoNextState { knot: 2, index: 1 });
    let mut problem = Problem::new(vec![0.0; 14], vec![knot(), end()], vec![0, 0, 0], end()).unwrap();
    assert_eq!(problem.shift(1), Err(Error::NoNextState { knot: 2, index: 1 }));
    let text =
        "knot 2: models[1] has no next state, as an action of the end; a running one has a duration or an impact";
    assert_eq!(error.to_string(), text);
    let data = RobotProblem {
        model: robots::arm7(),
        x0: vec![0.0; 14],
        knots: vec![Knot::new(condyle_optimal::robot::Dynamics::Terminal, vec![])],
        knot_models: vec![0],
        terminal: Knot::new(condyle_optimal::robot::Dynamics::Terminal, vec![]),
    };
    assert_eq!(data.build().unwrap_err(), Error::NoNextState { knot: 0, index: 0 });
}

#[test]
fn without_a_solution_there_is_nothing_to_resume() {
    let (mut problem, xs, us) = gait(true, false);
    let mut solver = Fddp::new(&problem);
    assert_eq!(solver.resume(&mut problem).unwrap_err(), Error::NothingToResume);
    let mut constrained = AugmentedLagrangian::new(&problem);
    assert_eq!(constrained.resume(&mut problem).unwrap_err(), Error::NothingToResume);
    solver.settings.max_iterations = 1;
    solver.solve(&mut problem, &xs, &us).unwrap();
    assert!(solver.resume(&mut problem).is_ok());
}

/// Checks that statics and Newton steps give the same controls that hold a state still. The accelerations at that state
/// vanish.
#[test]
fn what_holds_a_state_still_is_found() {
    let arm = Arc::new(robots::arm7());
    let x = [vec![0.3, 0.4, -0.2, 1.2, 0.1, 0.8, 0.5], vec![0.0; 7]].concat();
    let mut knot = FreeDynamics::running(arm.clone(), 0.1, vec![]).unwrap();
    let held = ActionModel::quasi_static(&mut knot, 0, &x);
    assert_eq!(held, knot.quasi_static(&x));
    let by_newton = condyle_optimal::NumDiff(knot.clone()).quasi_static(0, &x);
    assert!(held.iter().zip(&by_newton).all(|(a, b)| (a - b).abs() < 1e-6), "{held:?} {by_newton:?}");
    let mut seen = vec![];
    knot.outputs(0, &x, &held, &mut |name, numbers| seen.push((name.to_owned(), numbers.to_vec())));
    assert_eq!(seen.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["acceleration", "effort"]);
    assert!(seen[0].1.iter().all(|a| a.abs() < 1e-10) && seen[1].1 == held);
}

/// Checks that the first and second derivatives of the unicycle equal differences.
/// `tests/peers/crocoddyl/test_actions.py` compares the iterations with Crocoddyl.
#[test]
fn a_unicycle_has_the_derivatives_of_differences() {
    use condyle_optimal::{Hessian, NumDiff, Unicycle};
    let (x, u, lambda) = ([0.3, -0.2, 0.7], [0.9, -0.4], [0.5, -1.5, 2.0]);
    let action = Unicycle::new(0.2, [3.0, 0.7]);
    for action in [action.clone(), action.terminal()] {
        let nu = action.nu();
        let (mut ours, mut theirs) = (LqKnot::zeros(3, nu), LqKnot::zeros(3, nu));
        let (mut one, mut other) = (Hessian::zeros(3, nu), Hessian::zeros(3, nu));
        action.clone().calc_diff(0, &x, &u[..nu], &mut ours);
        NumDiff(action.clone()).calc_diff(0, &x, &u[..nu], &mut theirs);
        let pairs = [(&ours.Q, &theirs.Q), (&ours.S, &theirs.S), (&ours.R, &theirs.R), (&ours.B, &theirs.B)];
        assert!(pairs.iter().all(|(a, b)| (*a - *b).iter().all(|x| x.abs() < 1e-6)));
        assert!((&ours.q - &theirs.q).amax() < 1e-7 && (&ours.r - &theirs.r).iter().all(|x| x.abs() < 1e-7));
        if nu > 0 {
            assert!((&ours.A - &theirs.A).amax() < 1e-8);
            assert!(action.clone().dynamics_hessian(0, &x, &u, &lambda, &mut one));
            NumDiff(action.clone()).dynamics_hessian(0, &x, &u, &lambda, &mut other);
            assert!((&one.xx - &other.xx).amax() < 1e-6 && (&one.xu - &other.xu).amax() < 1e-6);
        }
    }
}

/// Checks that the forces at the feet carry the weight of a standing robot.
#[test]
fn outputs_of_a_stance_bear_its_weight() {
    let (mut problem, xs, us) = gait(true, false);
    let model = robots::quadruped();
    let u = us[problem.control_range(9)].to_vec();
    let (mut norms, mut names) = (0.0, vec![]);
    problem.outputs(9, &xs[..37], &u, &mut |name, numbers| {
        names.push(name.to_owned());
        norms += if name.starts_with("force/") { numbers.iter().map(|f| f * f).sum::<f64>().sqrt() } else { 0.0 };
    });
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(|foot| format!("force/{foot}"));
    assert_eq!(names[2..], feet);
    // the axes of a foot turn with its leg, so only norms of forces are compared; the forces sum to the weight, so the
    // sum of their norms is at least the weight
    assert!(norms >= 9.81 * model.total_mass() - 1e-6 && norms < 2.0 * 9.81 * model.total_mass(), "{norms}");
    let mut accelerations = vec![];
    problem.outputs(9, &xs[..37], &u, &mut |name, numbers| {
        if name == "acceleration" {
            accelerations = numbers.to_vec();
        }
    });
    assert!(accelerations.iter().all(|a| a.abs() < 1e-8), "{accelerations:?}");
}
