//! Access by name to the costs of a problem, and copies of problems.

use super::*;
use condyle_dynamics::Se3;
use condyle_optimal::robot::{ContactInverseDynamics, CostMut, GenericResidual, OwnResidual, RobotState, Target};
use condyle_optimal::{AugmentedLagrangian, AutoDiffConstraint, Constrained, GenericConstraint, Solution};
use condyle_spatial::Scalar;

fn reach(x: f64) -> Residual {
    Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(x, 0.2, 0.5) }
}

fn plain(name: &str, residual: Residual) -> Cost {
    Cost::new(name, 1.0, residual, Activation::Quadratic)
}

/// Constraint that limits the second joint's speed to 3.
#[derive(Clone)]
struct Slow;

impl GenericConstraint for Slow {
    fn size(&self) -> usize {
        1
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&[-3.0], &[3.0])
    }
    fn calc<S: Scalar>(&self, _: usize, x: &[S], _: &[S], g: &mut [S]) {
        g[0] = x[8];
    }
}

/// Creates a problem of an arm with four models: two models that one action represents, one with a constraint, and one
/// with accelerations as controls.
fn mixed() -> Problem {
    let arm = Arc::new(robots::arm7());
    let costs = |x: f64| {
        let rest = Residual::State { reference: vec![0.1; 14] };
        vec![
            plain("reach", reach(x)),
            plain("rest", rest),
            plain("effort", Residual::Control { reference: vec![0.0; 7] }),
        ]
    };
    let free = |x| FreeDynamics::running(arm.clone(), DT, costs(x)).unwrap();
    let mut second = free(0.2);
    second.set_costs(3, vec![plain("reach", reach(0.9))]).unwrap();
    let models: Vec<Box<dyn ActionModel>> = vec![
        Box::new(free(0.1)),
        Box::new(second),
        Box::new(Constrained::new(Box::new(free(0.3)), Box::new(AutoDiffConstraint::new(Slow)))),
        Box::new(FreeInverseDynamics::running(arm.clone(), DT, costs(0.4)).unwrap()),
        Box::new(condyle_optimal::NumDiff(free(0.5))),
    ];
    let end = FreeDynamics::terminal(arm, vec![plain("reach", reach(0.6))]).unwrap();
    Problem::new(vec![0.1; 14], models, vec![0, 0, 1, 1, 2, 3, 3], Box::new(end)).unwrap()
}

fn costs_of(problem: &mut Problem) -> Vec<f64> {
    let (xs, us) = (vec![0.15; 8 * 14], vec![0.3; 7 * 7]);
    let (mut next, mut costs) = (vec![0.0; 7 * 14], vec![0.0; 8]);
    problem.calc(&xs, &us, &mut next, &mut costs);
    costs
}

fn place(cost: &CostMut<'_>) -> f64 {
    match cost.target() {
        Some(Target::Position(p)) => p.x,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_cost_is_found_by_its_name_whatever_the_dynamics() {
    let mut problem = mixed();
    for (k, x) in [0.1, 0.2, 0.3, 0.4, 0.5].into_iter().enumerate() {
        assert_eq!(place(&problem.cost_mut(k, "reach").unwrap()), x);
    }
    for (t, x) in [0.1, 0.1, 0.2, 0.9, 0.3, 0.4, 0.4, 0.6].into_iter().enumerate() {
        assert_eq!(place(&problem.cost_at_mut(t, "reach").unwrap()), x);
    }
    assert!(problem.cost_mut(0, "grasp").is_none() && problem.cost_mut(5, "reach").is_none());
    assert!(problem.cost_at_mut(3, "rest").is_none()); // knot 3 has separate costs
    let unicycle = condyle_optimal::Unicycle::default();
    let end = Box::new(unicycle.clone().terminal());
    let mut other = Problem::new(vec![0.0; 3], vec![Box::new(unicycle)], vec![0; 2], end).unwrap();
    assert!(other.cost_mut(0, "reach").is_none() && !other.change_costs("reach", |_| Ok(())).unwrap());
}

#[test]
fn a_change_is_that_of_its_knots_alone() {
    let before = costs_of(&mut mixed());
    let changed = |change: &dyn Fn(&mut Problem)| {
        let mut problem = mixed();
        change(&mut problem);
        let after = costs_of(&mut problem);
        (0..8).filter(|&t| before[t] != after[t]).collect::<Vec<_>>()
    };
    let target = Vec3::new(-0.4, 0.1, 0.3);
    assert_eq!(changed(&|p| p.cost_mut(1, "reach").unwrap().set_target(target).unwrap()), [2]);
    assert_eq!(changed(&|p| p.cost_at_mut(3, "reach").unwrap().set_target(target).unwrap()), [3]);
    assert_eq!(changed(&|p| p.cost_mut(2, "rest").unwrap().set_weight(2.0).unwrap()), [4]);
    assert_eq!(changed(&|p| p.cost_at_mut(7, "reach").unwrap().set_weight(2.0).unwrap()), [7]);
    let huber = || Activation::Smooth1 { epsilon: 1.0 };
    assert_eq!(changed(&|p| p.cost_mut(3, "effort").unwrap().set_activation(huber()).unwrap()), [5, 6]);
    let all = |p: &mut Problem| assert!(p.change_costs("reach", |cost| cost.set_target(target)).unwrap());
    assert_eq!(changed(&all), [0, 1, 2, 3, 4, 5, 6, 7]);
    let some = |p: &mut Problem| assert!(p.change_costs("rest", |cost| cost.set_target(&[0.3; 14])).unwrap());
    assert_eq!(changed(&some), [0, 1, 2, 4, 5, 6]);
    // a problem whose target was changed equals a problem created with that target
    let mut problem = mixed();
    problem.cost_mut(0, "reach").unwrap().set_target(Vec3::new(0.2, 0.2, 0.5)).unwrap();
    problem.cost_mut(1, "reach").unwrap().set_target(Vec3::new(0.1, 0.2, 0.5)).unwrap();
    let after = costs_of(&mut problem);
    assert_eq!((after[0], after[2]), (before[2], before[0]));
}

#[test]
fn what_is_no_target_is_refused_and_changes_nothing() {
    let (model, mut rng) = (Arc::new(robots::quadruped()), StdRng::seed_from_u64(51));
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let (frame, reference) = (|| FrameName::from("LF_foot"), ReferenceFrame::Local);
    struct Small;
    impl GenericResidual for Small {
        fn size(&self) -> usize {
            1
        }
        fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
            r[0] = state.v[0];
        }
    }
    let own = Residual::Own(OwnResidual::autodiff(model.clone(), Small));
    let costs = vec![
        plain("state", Residual::State { reference: random_state(&model, &mut rng) }),
        plain("control", Residual::Control { reference: vec![0.0; 12] }),
        plain("effort", Residual::JointEffort { reference: vec![0.0; 18] }),
        plain("com", Residual::CenterOfMass { target: Vec3::zero() }),
        plain("pose", Residual::FramePlacement { frame: frame(), target: Se3::identity() }),
        plain("turn", Residual::FrameRotation { frame: frame(), target: Mat3::identity() }),
        plain("speed", Residual::FrameVelocity { frame: frame(), target: Motion::zero(), reference }),
        plain("force", Residual::ContactForce { contact: contacts[0].name.clone(), target: Force::zero() }),
        plain("own", own),
    ];
    let knot = ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
    let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
    let x0 = random_state(&model, &mut rng);
    let mut problem = Problem::new(x0, vec![Box::new(knot)], vec![0; 2], Box::new(end)).unwrap();
    let mut said = |name: &str, target: Target<'_>| {
        let mut cost = problem.cost_mut(0, name).unwrap();
        let before = cost.get().clone();
        let error = cost.set_target(target).unwrap_err().to_string();
        assert_eq!(*cost.get(), before);
        error.strip_prefix(&format!("cost `{name}`: ")).unwrap().to_owned()
    };
    assert_eq!(said("state", Target::Numbers(&[0.0; 36])), "its reference has 36 numbers, expected 37");
    assert_eq!(said("control", Target::Numbers(&[0.0; 7])), "its reference has 7 numbers, expected 12");
    assert_eq!(said("effort", Target::Numbers(&[f64::NAN; 18])), "its reference holds a NaN");
    let mut long = random_state(&model, &mut rng);
    long[3..7].iter_mut().for_each(|x| *x *= 2.0);
    assert!(said("state", (&long).into()).contains("its rotation, q[3..7], has the length 2"));
    let infinite = Vec3::new(0.0, f64::INFINITY, 0.0);
    assert_eq!(said("com", infinite.into()), "its target holds an infinite number");
    let stretched = Mat3 { x: Vec3::new(2.0, 0.0, 0.0), ..Mat3::identity() };
    let none = "its target is no rotation: expected three unit vectors at right angles";
    assert_eq!(said("turn", stretched.into()), none);
    assert_eq!(said("pose", Se3::new(stretched, Vec3::zero()).into()), none);
    assert_eq!(said("pose", Vec3::zero().into()), "its target is a placement, found a position");
    assert_eq!(said("speed", Force::zero().into()), "its target is a velocity, found a force");
    assert_eq!(said("com", Target::Numbers(&[0.0; 3])), "its target is a position, found 3 numbers");
    assert_eq!(said("own", Vec3::zero().into()), "its residual has no target");
    let mut cost = problem.cost_mut(0, "com").unwrap();
    assert!(cost.set_weight(-1.0).is_err() && cost.set_weight(f64::NAN).is_err());
    let error = cost.set_activation(Activation::Weighted(vec![1.0; 2])).unwrap_err().to_string();
    assert_eq!(error, "cost `com`: its weighting has 2 numbers, expected 3");
    assert_eq!(*cost.get(), plain("com", Residual::CenterOfMass { target: Vec3::zero() }));
    // targets of all kinds can be changed
    let turned = rotation(&mut rng);
    problem.cost_mut(0, "turn").unwrap().set_target(turned).unwrap();
    problem.cost_mut(0, "pose").unwrap().set_target(Se3::new(turned, Vec3::zero())).unwrap();
    problem.cost_mut(0, "speed").unwrap().set_target(Motion::from([1.0; 6])).unwrap();
    problem.cost_mut(0, "force").unwrap().set_target(Force::from([2.0; 6])).unwrap();
    assert_eq!(problem.cost_mut(0, "force").unwrap().target(), Some(Target::Force(Force::from([2.0; 6]))));
    assert_eq!(problem.cost_mut(0, "turn").unwrap().target(), Some(Target::Rotation(turned)));
}

/// User-defined action that wraps another action.
struct Wrapper(Box<dyn ActionModel>);

impl ActionModel for Wrapper {
    fn nx(&self) -> usize {
        self.0.nx()
    }
    fn ndx(&self) -> usize {
        self.0.ndx()
    }
    fn nu(&self) -> usize {
        self.0.nu()
    }
    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        Some(&mut *self.0)
    }
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.0.calc(t, x, u, next)
    }
}

#[test]
fn an_action_of_a_users_own_shows_the_robot_that_it_wraps() {
    let model = Arc::new(robots::quadruped());
    let contacts = feet(&model, ReferenceFrame::Local);
    let rest = plain("rest", Residual::State { reference: inverse::standing(&model) });
    let knot = ContactDynamics::running(model.clone(), &contacts, DT, vec![rest]).unwrap();
    let end = Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
    let (x0, wrapped) = (inverse::standing(&model), Box::new(Wrapper(Box::new(knot.clone()))));
    let mut problem = Problem::new(x0.clone(), vec![wrapped], vec![0; 2], end.clone()).unwrap();
    let mut plain = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 2], end).unwrap();
    assert_eq!(problem.motion_at(1, &x0, &[1.0; 12]), plain.motion_at(1, &x0, &[1.0; 12]));
    assert_eq!(problem.cost_mut(0, "rest").unwrap().get().weight, 1.0);
    assert_eq!(problem.try_clone().unwrap_err(), Error::NoCopy { model: Some(0) });
}

fn solve(problem: &mut Problem) -> Solution {
    let xs = problem.x0().repeat(problem.horizon() + 1);
    let us = problem.quasi_static(&xs).unwrap();
    AugmentedLagrangian::new(problem).solve(problem, &xs, &us).unwrap().clone()
}

#[test]
fn a_copy_solves_as_the_original_and_changes_alone() {
    let arm = Arc::new(robots::arm7());
    let mut problem = copied(&arm);
    problem.cost_mut(0, "reach").unwrap().set_target(Vec3::new(0.4, 0.3, 0.5)).unwrap();
    let first = solve(&mut problem);
    let mut copy = problem.try_clone().unwrap();
    let other = std::thread::spawn(move || (solve(&mut copy), copy));
    let (second, mut copy) = other.join().unwrap();
    assert_eq!((&first.xs, &first.us, &first.K), (&second.xs, &second.us, &second.K));
    copy.cost_mut(0, "reach").unwrap().set_target(Vec3::new(0.2, -0.3, 0.5)).unwrap();
    copy.set_x0(&[0.2; 14]).unwrap();
    copy.shift(0).unwrap();
    assert_ne!(solve(&mut copy).xs, first.xs);
    assert_eq!(solve(&mut problem).xs, first.xs);
}

/// Creates a problem whose actions can all be copied.
fn copied(arm: &Arc<Model>) -> Problem {
    let rest = Residual::State { reference: vec![0.1; 14] };
    let costs = vec![
        plain("reach", reach(0.4)),
        plain("rest", rest),
        plain("effort", Residual::JointEffort { reference: vec![0.0; 7] }),
    ];
    let free = FreeDynamics::running(arm.clone(), DT, costs.clone()).unwrap();
    let slow = Constrained::new(Box::new(free.clone()), Box::new(AutoDiffConstraint::new(Slow)));
    let inverse = FreeInverseDynamics::running(arm.clone(), DT, costs.clone()).unwrap();
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(free), Box::new(slow), Box::new(inverse)];
    let end = FreeDynamics::terminal(arm.clone(), costs[..2].to_vec()).unwrap();
    Problem::new(vec![0.1; 14], models, vec![0, 0, 0, 1, 1, 2, 2], Box::new(end)).unwrap()
}

#[test]
fn an_action_without_a_copy_is_named() {
    let error = mixed().try_clone().unwrap_err();
    assert_eq!(error, Error::NoCopy { model: Some(4) });
    assert_eq!(error.to_string(), "models[4]: cannot be copied, as its `try_clone` returns `None`");
    let arm = Arc::new(robots::arm7());
    let end = condyle_optimal::NumDiff(FreeDynamics::terminal(arm.clone(), vec![]).unwrap());
    let knot = FreeDynamics::running(arm, DT, vec![]).unwrap();
    let problem = Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 2], Box::new(end)).unwrap();
    assert_eq!(problem.try_clone().unwrap_err(), Error::NoCopy { model: None });
}

/// Checks that problems of quadrupeds with impacts, and with contact forces as controls, can be copied too.
#[test]
fn a_copy_of_a_quadrupeds_problem_has_the_same_derivatives() {
    let (model, mut rng) = (Arc::new(robots::quadruped()), StdRng::seed_from_u64(52));
    let contacts = feet(&model, ReferenceFrame::Local);
    let stand = ContactDynamics::running(model.clone(), &contacts, DT, contact_costs(&model, &contacts, 12, &mut rng));
    let inverse = ContactInverseDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap();
    let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, vec![]).unwrap();
    let models: Vec<Box<dyn ActionModel>> = vec![Box::new(stand.unwrap()), Box::new(inverse), Box::new(impact)];
    let end = Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
    let mut problem = Problem::new(random_state(&model, &mut rng), models, vec![0, 0, 2, 1], end).unwrap();
    let mut copy = problem.try_clone().unwrap();
    let xs: Vec<_> = (0..5).flat_map(|_| random_state(&model, &mut rng)).collect();
    let us = random(12 + 12 + 18 + 6, 1.0, &mut rng);
    let (mut lq_knots, mut same) = (problem.lq_knots(), problem.lq_knots());
    problem.calc_diff(&xs, &us, &mut lq_knots);
    copy.calc_diff(&xs, &us, &mut same);
    assert_eq!(lq_knots, same);
}

/// Checks that rows of references reach their knots, whether these share their costs with other knots or not, and also
/// after the horizon has moved.
#[test]
fn references_of_all_knots_are_written_at_once() {
    let mut problem = mixed();
    let row = |x: f64| [x, 0.2, 0.5];
    let numbers: Vec<f64> = (0..8).flat_map(|t| row(t as f64)).collect();
    let before = costs_of(&mut problem);
    assert!(problem.set_references("reach", &numbers).unwrap());
    assert!(!problem.set_references("grasp", &numbers).unwrap());
    assert_eq!(problem.references("reach").unwrap(), (numbers.clone(), 3));
    assert!(problem.references("grasp").is_none());
    // the shared costs of the models are unchanged, and each row acts at its own knot
    assert_eq!(place(&problem.cost_mut(0, "reach").unwrap()), 0.1);
    let after = costs_of(&mut problem);
    for t in 0..8 {
        let quarter = if t == 7 { 1.0 } else { DT };
        let reach = |x: f64, tool: f64| 0.5 * quarter * (tool - x).powi(2);
        let old = [0.1, 0.1, 0.2, 0.9, 0.3, 0.4, 0.4, 0.6][t];
        let tool = {
            let (arm, mut data) = (robots::arm7(), Data::new(&robots::arm7()));
            let placements = forward_kinematics(&arm, &mut data, &[0.15; 7]);
            placements.frame(arm.frame("tool").unwrap()).translation.x
        };
        let expected = before[t] - reach(old, tool) + reach(t as f64, tool);
        assert!((after[t] - expected).abs() < 1e-12 * (1.0 + expected.abs()), "knot {t}: {} {expected}", after[t]);
    }
    // knots keep their references when the horizon moves; the new knot has the common costs of its model
    problem.shift(0).unwrap();
    let moved = problem.references("reach").unwrap().0;
    let expected = [&numbers[3..21], &row(0.1), &numbers[21..]].concat();
    assert_eq!(moved, expected);
    problem.set_references("reach", &numbers).unwrap();
    assert_eq!(problem.references("reach").unwrap().0, numbers);
}

#[test]
fn references_of_every_kind_are_rows_of_numbers() {
    let mut rng = StdRng::seed_from_u64(5);
    let arm = Arc::new(robots::arm7());
    let (turned, p) = (rotation(&mut rng), Vec3::new(0.1, 0.2, 0.3));
    let frame = || FrameName::from("tool");
    let velocity = Motion::from([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let residuals = [
        ("state", Residual::State { reference: vec![0.1; 14] }, Target::Numbers(&[0.3; 14])),
        ("com", Residual::CenterOfMass { target: Vec3::zero() }, Target::Position(p)),
        ("turn", Residual::FrameRotation { frame: frame(), target: Mat3::identity() }, Target::Rotation(turned)),
        (
            "pose",
            Residual::FramePlacement { frame: frame(), target: Se3::identity() },
            Target::Placement(Se3::new(turned, p)),
        ),
        (
            "speed",
            Residual::FrameVelocity { frame: frame(), target: Motion::zero(), reference: ReferenceFrame::Local },
            Target::Velocity(velocity),
        ),
        (
            "momentum",
            Residual::CentroidalMomentum { target: Force::zero() },
            Target::Force(Force::from(velocity.to_array())),
        ),
    ];
    let costs: Vec<_> = residuals.iter().map(|(name, residual, _)| plain(name, residual.clone())).collect();
    let knot = FreeDynamics::running(arm.clone(), DT, costs).unwrap();
    let end = FreeDynamics::terminal(arm, vec![]).unwrap();
    let mut problem = Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 2], Box::new(end)).unwrap();
    for (name, _, target) in &residuals {
        let (mut rows, size) = problem.references(name).unwrap();
        target.write(&mut rows[size..2 * size]);
        assert!(problem.set_references(name, &rows).unwrap()); // the terminal knot has no such cost, its row is NaN
        assert_eq!(problem.cost_at_mut(1, name).unwrap().target().unwrap(), *target, "{name}");
        assert_eq!(problem.references(name).unwrap().0[..2 * size], rows[..2 * size], "{name}");
    }
    // the placement is the homogeneous matrix, row by row
    let rows = problem.references("pose").unwrap().0;
    let matrix = nalgebra::Matrix4::from_row_slice(&rows[16..32]);
    let columns = turned.columns().map(Vec3::to_array);
    assert!((0..3).all(|i| (0..3).all(|j| matrix[(i, j)] == columns[j][i]) && matrix[(i, 3)] == p.to_array()[i]));
}

#[test]
fn wrong_references_are_refused_with_their_knot() {
    let mut problem = mixed();
    let said = |result: Result<bool, Error>| result.unwrap_err().to_string();
    assert_eq!(said(problem.set_references("reach", &[0.0; 23])), "`references`: expected length 16, found 23");
    assert_eq!(
        said(problem.set_references("reach", &[0.0; 16])),
        "cost `reach`: its target has 3 numbers, found 2 (knot 0)"
    );
    let mut numbers = [0.0; 24];
    numbers[7] = f64::NAN;
    assert_eq!(said(problem.set_references("reach", &numbers)), "cost `reach`: its target holds a NaN (knot 2)");
    assert_eq!(said(problem.set_weights("rest", &[1.0; 7])), "`weights`: expected length 8, found 7");
    let message = "cost `rest`: its weight is -1, expected a finite number of at least 0 (knot 1)";
    assert_eq!(said(problem.set_weights("rest", &[1.0, -1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])), message);
    let message = "cost `rest`: its activation has no weights (knot 0)";
    assert_eq!(said(problem.set_entry_weights("rest", &[1.0; 8 * 14])), message);
    let message = "cost `rest`: its weighting has 13 numbers, expected 14 (knot 0)";
    assert_eq!(said(problem.set_entry_weights("rest", &[1.0; 8 * 13])), message);
}

#[test]
fn weights_of_all_knots_are_written_at_once() {
    let arm = Arc::new(robots::arm7());
    let rest = || Residual::State { reference: vec![0.3; 14] };
    let cost = |w: f64, each: f64| Cost::new("rest", w, rest(), Activation::Weighted(vec![each; 14]));
    let problem = |costs: [Cost; 3]| {
        let [first, second, last] = costs;
        let mut knot = FreeDynamics::running(arm.clone(), DT, vec![first]).unwrap();
        knot.set_costs(1, vec![second]).unwrap();
        let end = FreeDynamics::terminal(arm.clone(), vec![last]).unwrap();
        Problem::new(vec![0.1; 14], vec![Box::new(knot)], vec![0; 2], Box::new(end)).unwrap()
    };
    let values = |problem: &mut Problem| {
        let mut costs = vec![0.0; 3];
        problem.calc(&[0.2; 42], &[0.1; 14], &mut [0.0; 28], &mut costs);
        costs
    };
    let mut changed = problem([(); 3].map(|()| cost(1.0, 1.0)));
    assert!(changed.set_weights("rest", &[2.0, 3.0, 4.0]).unwrap());
    let each: Vec<f64> = [5.0, 6.0, 7.0].iter().flat_map(|w| [*w; 14]).collect();
    assert!(changed.set_entry_weights("rest", &each).unwrap());
    let expected = values(&mut problem([cost(2.0, 5.0), cost(3.0, 6.0), cost(4.0, 7.0)]));
    assert_eq!(values(&mut changed), expected);
}

/// Checks that a problem whose contacts were changed equals a problem created with these contacts, also in groups.
#[test]
fn contacts_are_changed_in_place() {
    let mut rng = StdRng::seed_from_u64(31);
    let model = Arc::new(robots::quadruped());
    let problem = |kp_axes: Option<[f64; 6]>, place: Vec3<f64>| {
        let mut contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        (contacts[0].constraint.kp_axes, contacts[0].constraint.target.placement.translation) = (kp_axes, place);
        let knot = |effort: f64| {
            let cost = Cost::new("u", effort, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic);
            let knot = ContactDynamics::running(model.clone(), &contacts, DT, vec![cost]).unwrap();
            Box::new(knot) as Box<dyn ActionModel>
        };
        let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
        Problem::new(xs_of(&model), vec![knot(1.0), knot(2.0)], vec![0, 0, 1, 1, 0, 1], Box::new(end)).unwrap()
    };
    let xs: Vec<f64> = (0..7).flat_map(|_| random_state(&model, &mut rng)).collect();
    let us = random(6 * 12, 5.0, &mut rng);
    let run = |problem: &mut Problem| {
        let (mut next, mut costs) = (vec![0.0; 6 * 37], vec![0.0; 7]);
        problem.calc(&xs, &us, &mut next, &mut costs);
        let mut knots = problem.lq_knots();
        problem.calc_diff(&xs, &us, &mut knots);
        let slopes: Vec<_> = knots[..6].iter().flat_map(|knot| [knot.A.clone(), knot.B.clone()]).collect();
        (next, slopes)
    };
    let (gains, place) = ([0.0, 3.0, 90.0, 0.0, 0.0, 0.0], Vec3::new(0.3, 0.2, 0.1));
    let mut changed = problem(None, Vec3::zero());
    let before = run(&mut changed);
    let name = feet(&model, ReferenceFrame::Local)[0].name.clone();
    let found = changed.change_contacts(&name, |contact| {
        (contact.kp_axes, contact.target.placement.translation) = (Some(gains), place);
    });
    assert!(found.unwrap() && !changed.change_contacts("hand", |_| {}).unwrap());
    let after = run(&mut changed);
    assert_eq!(after, run(&mut problem(Some(gains), place)));
    assert_ne!(after.0, before.0);
    let wrong = changed.change_contacts(&name, |contact| contact.kd = -1.0).unwrap_err().to_string();
    assert!(wrong.contains("kd must be a number of at least 0, found -1"), "{wrong}");
    let wrong = changed.change_contacts(&name, |contact| contact.frame = 0).unwrap_err().to_string();
    assert!(wrong.contains("only its target and its gains may be changed"), "{wrong}");
    assert_eq!(run(&mut changed), after);
}

fn xs_of(model: &Model) -> Vec<f64> {
    [neutral(model), vec![0.0; model.nv()]].concat()
}
