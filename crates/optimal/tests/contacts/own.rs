//! User-defined residuals that are generic over the scalar type. They have exact Jacobians and can be costs, limits and
//! path constraints.

use super::*;
use condyle_optimal::robot::{
    ContactInverseDynamics, GenericResidual, Inputs, Limit, OwnConstraint, OwnResidual, RobotState,
};
use condyle_optimal::{AugmentedLagrangian, Constrained, GroupModel, PathConstraint};
use condyle_spatial::Scalar;

/// Tolerance for the same formulas, evaluated in different orders.
const EXACT: f64 = 1e-11;

/// Residual p − p_ref of the position of a frame.
struct Place {
    frame: usize,
    target: Vec3<f64>,
}

impl GenericResidual for Place {
    fn size(&self) -> usize {
        3
    }
    fn inputs(&self) -> Inputs {
        Inputs::POSITIONS
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let p = state.placements().frame(self.frame).translation - self.target.lift();
        r.copy_from_slice(&p.to_array());
    }
}

/// Residual: the velocity of a frame along the axes of the frame.
struct Speed(usize);

impl GenericResidual for Speed {
    fn size(&self) -> usize {
        6
    }
    fn inputs(&self) -> Inputs {
        Inputs::STATE
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        r.copy_from_slice(&state.velocities().frame_velocity(self.0, ReferenceFrame::Local).to_array());
    }
}

/// Residual whose entries are the controls.
struct Drive(usize);

impl GenericResidual for Drive {
    fn size(&self) -> usize {
        self.0
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        r.copy_from_slice(state.u);
    }
}

/// Residual with one entry, (1 + t) z Σ v + z Σ u, which depends on all arguments and on the knot's index t.
struct Mixed(usize);

impl GenericResidual for Mixed {
    fn size(&self) -> usize {
        1
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let (t, mut sum) = (S::splat(1.0 + state.t as f64), S::zero());
        state.v.iter().for_each(|&v| sum += v * t);
        state.u.iter().for_each(|&u| sum += u);
        r[0] = state.placements().frame(self.0).translation.z * sum;
    }
}

fn own(model: &Arc<Model>, function: impl GenericResidual) -> Residual {
    Residual::Own(OwnResidual::autodiff(model.clone(), function))
}

/// Returns costs with built-in residuals, and the same costs with user-defined residuals.
fn both(model: &Arc<Model>, frame: &str, nu: usize) -> [Vec<Cost>; 2] {
    let (number, target) = (model.frame(frame).unwrap(), Vec3::new(0.3, -0.2, 0.7));
    let built_in = [
        Residual::FrameTranslation { frame: frame.into(), target },
        Residual::FrameVelocity { frame: frame.into(), target: Motion::zero(), reference: ReferenceFrame::Local },
        Residual::Control { reference: vec![0.0; nu] },
    ];
    let written = [own(model, Place { frame: number, target }), own(model, Speed(number)), own(model, Drive(nu))];
    [built_in, written].map(|residuals| {
        let mut costs = Vec::new();
        for (k, residual) in residuals.into_iter().enumerate().filter(|(k, _)| nu > 0 || *k < 2) {
            costs.push(Cost::new(&format!("{k}"), 0.5 + k as f64, residual, Activation::Smooth1 { epsilon: 0.3 }));
        }
        costs
    })
}

/// Compares costs and derivatives of two actions for a group of knots.
pub(super) fn compare(what: &str, mut a: impl GroupModel, mut b: impl GroupModel, model: &Model, rng: &mut StdRng) {
    let (ndx, nx, nu, knots) = (a.ndx(), a.nx(), a.nu(), [0, 1, 2, 3, 4]);
    let xs: Vec<_> = knots.iter().flat_map(|_| random_state(model, rng)).collect();
    let us = random(nu * knots.len(), 1.0, rng);
    let mut lq_knots = [(); 2].map(|()| knots.map(|_| LqKnot::zeros(ndx, nu)));
    let mut next = vec![0.0; nx * knots.len()];
    let mut costs = [[0.0; 5]; 2];
    let [by_a, by_b] = &mut lq_knots;
    a.calc_group(&knots, &xs, &us, &mut next, &mut costs[0]);
    b.calc_group(&knots, &xs, &us, &mut next, &mut costs[1]);
    a.calc_diff_group(&knots, &xs, &us, by_a);
    b.calc_diff_group(&knots, &xs, &us, by_b);
    let error = largest_difference(&costs[0], &costs[1]);
    assert!(error < EXACT, "{what}: costs differ by {error:e}");
    for (a, b) in by_a.iter().zip(&*by_b) {
        for (name, a, b) in [("Q", &a.Q, &b.Q), ("S", &a.S, &b.S), ("R", &a.R, &b.R)] {
            let error = largest_difference(a.as_slice(), b.as_slice());
            assert!(error < EXACT, "{what}: {name} differs by {error:e}");
        }
        let error = largest_difference(a.q.as_slice(), b.q.as_slice());
        assert!(error < EXACT, "{what}: q differs by {error:e}");
        let error = largest_difference(a.r.as_slice(), b.r.as_slice());
        assert!(error < EXACT, "{what}: r differs by {error:e}");
    }
}

#[test]
fn own_residuals_are_the_built_in_ones() {
    let mut rng = StdRng::seed_from_u64(31);
    let arm = Arc::new(robots::arm7());
    let [a, b] = both(&arm, "tool", 7).map(|costs| FreeDynamics::running(arm.clone(), DT, costs).unwrap());
    compare("arm", a, b, &arm, &mut rng);
    let [a, b] = both(&arm, "tool", 0).map(|costs| FreeDynamics::terminal(arm.clone(), costs).unwrap());
    compare("end", a, b, &arm, &mut rng);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let (frame, joints) = (contacts[0].name.clone(), model.nv() - 6);
        let make = |costs| ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
        let [a, b] = both(&model, &frame, joints).map(make);
        compare(model.name(), a, b, &model, &mut rng);
        let rows: usize = contacts.iter().map(|c| c.constraint.kind.rows()).sum();
        let make = |costs| ContactInverseDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
        let [a, b] = both(&model, &frame, model.nv() + rows).map(make);
        compare(model.name(), a, b, &model, &mut rng);
        let make = |costs| ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, costs).unwrap();
        let [a, b] = both(&model, &frame, 0).map(make);
        compare(model.name(), a, b, &model, &mut rng);
    }
}

#[test]
fn derivatives_of_an_own_residual_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(32);
    for (model, frame) in [(robots::arm7(), "tool"), (robots::quadruped(), "LF_foot")] {
        let model = Arc::new(model);
        let mixed = own(&model, Mixed(model.frame(frame).unwrap()));
        let costs = vec![Cost::new("mixed", 0.3, mixed, Activation::Quadratic)];
        let action = FreeDynamics::running(model.clone(), DT, costs).unwrap();
        check_derivatives(frame, action, &model, 1.0, &mut rng);
    }
}

/// Creates the problem of an arm that reaches for a point. If `limit`, the point is a limit of the terminal knot;
/// otherwise it is a cost.
fn reach(residual: Residual, limit: bool) -> Problem {
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let rest = Cost::new("rest", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic);
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let knot = FreeDynamics::running(arm.clone(), 0.05, vec![rest, effort]).unwrap();
    let end = match limit {
        true => {
            let end = FreeDynamics::terminal(arm, vec![]).unwrap();
            end.with_limits(vec![Limit::equality("reach", residual)]).unwrap()
        }
        false => FreeDynamics::terminal(arm, vec![Cost::new("reach", 1e3, residual, Activation::Quadratic)]).unwrap(),
    };
    Problem::new(x0, vec![Box::new(knot)], vec![0; 12], Box::new(end)).unwrap()
}

fn solve(mut problem: Problem, threads: usize) -> Vec<f64> {
    let (x0, mut solver) = (problem.x0().to_vec(), AugmentedLagrangian::new(&problem));
    solver.inner.threads = threads;
    let xs = x0.repeat(13);
    let us = problem.quasi_static(&xs).unwrap();
    let solution = solver.solve(&mut problem, &xs, &us).unwrap();
    assert_eq!(solution.status, Status::Converged);
    solution.xs.clone()
}

#[test]
fn an_own_residual_can_be_a_limit_or_a_path_constraint() {
    let (arm, target) = (Arc::new(robots::arm7()), Vec3::new(0.5, 0.1, 0.6));
    let frame = arm.frame("tool").unwrap();
    let place = || OwnResidual::autodiff(arm.clone(), Place { frame, target });
    let built_in = solve(reach(Residual::FrameTranslation { frame: "tool".into(), target }, true), 1);
    let limit = solve(reach(Residual::Own(place()), true), 1);
    assert!(largest_difference(&limit, &built_in) < OPTIMUM);
    // the same residual as a path constraint gives the same optimum
    let x0 = built_in[..14].to_vec();
    let rest = Cost::new("rest", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic);
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let knot = FreeDynamics::running(arm.clone(), 0.05, vec![rest, effort]).unwrap();
    let end = Box::new(FreeDynamics::terminal(arm.clone(), vec![]).unwrap());
    let end = Constrained::new(end, Box::new(OwnConstraint::equality(place())));
    let problem = Problem::new(x0, vec![Box::new(knot)], vec![0; 12], Box::new(end)).unwrap();
    assert!(largest_difference(&solve(problem, 1), &built_in) < OPTIMUM);
}

#[test]
fn the_jacobian_of_a_path_constraint_is_exact() {
    let (mut rng, model) = (StdRng::seed_from_u64(33), Arc::new(robots::quadruped()));
    let (frame, infinite) = (model.frame("RH_foot").unwrap(), vec![f64::INFINITY]);
    let mixed = OwnResidual::autodiff(model.clone(), Mixed(frame));
    let mut constraint = OwnConstraint::new(mixed, vec![-1.0], infinite).unwrap();
    let (x, u) = (random_state(&model, &mut rng), random(12, 1.0, &mut rng));
    let (mut gx, mut gu) = (DMatrix::from_element(1, 36, 7.0), DMatrix::from_element(1, 12, 7.0));
    assert!(constraint.calc_diff(3, &x, &u, &mut gx, &mut gu));
    let end = FreeDynamics::running(model.clone(), DT, vec![]).unwrap();
    let (h, mut moved, mut g) = (1e-6, x.clone(), [[0.0]; 2]);
    for k in 0..48 {
        for (g, h) in g.iter_mut().zip([h, -h]) {
            let (mut dx, mut u) = ([0.0; 36], u.clone());
            if k < 36 {
                dx[k] = h
            } else {
                u[k - 36] += h
            }
            end.integrate(&x, &dx, &mut moved);
            constraint.calc(3, &moved, &u, g);
        }
        let (exact, numeric) = (if k < 36 { gx[k] } else { gu[k - 36] }, (g[0][0] - g[1][0]) / (2.0 * h));
        assert!((exact - numeric).abs() < DIFFERENCES * (1.0 + numeric.abs()), "{k}: {exact} and {numeric}");
    }
}

#[test]
fn threads_share_an_own_residual() {
    let (arm, target) = (Arc::new(robots::arm7()), Vec3::new(0.5, 0.1, 0.6));
    let frame = arm.frame("tool").unwrap();
    let place = || own(&arm, Place { frame, target });
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
    let alone = solve(reach(place(), false), 1);
    let together = pool.install(|| solve(reach(place(), false), 3));
    assert_eq!(alone, together);
}

#[test]
fn an_own_residual_of_another_robot_is_refused() {
    let (arm, quadruped) = (Arc::new(robots::arm7()), Arc::new(robots::quadruped()));
    let costs = vec![Cost::new("place", 1.0, own(&quadruped, Speed(0)), Activation::Quadratic)];
    let error = FreeDynamics::terminal(arm.clone(), costs).map(|_| ()).unwrap_err().to_string();
    assert_eq!(error, "cost `place`: it is of a robot of nq = 19, nv = 18; this one has nq = 7, nv = 7");
    let speed = || OwnResidual::autodiff(arm.clone(), Speed(0));
    let error = OwnConstraint::new(speed(), vec![0.0; 6], vec![1.0; 5]).unwrap_err();
    assert_eq!(error, Error::Length { name: "upper", expected: 6, found: 5 });
    let error = OwnConstraint::new(speed(), vec![2.0; 6], vec![1.0; 6]).unwrap_err();
    assert_eq!(error, Error::Constraint { knot: 0, row: 0, lower: 2.0, upper: 1.0 });
}
