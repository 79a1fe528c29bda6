//! Tests a plan with residuals and constraints that a user defines, and a controller that follows the plan.

use condyle::nalgebra::DVector;
use condyle::optimal::robot::{
    Activation, Cost, FreeDynamics, GenericResidual, Inputs, Limit, OwnResidual, Residual, RobotState,
};
use condyle::optimal::{Fddp, Problem, Solution};
use condyle::wholebody::{Settings, Task, WholeBodyController};
use condyle::{Error, Model, Scalar, Vec3};
use std::sync::Arc;

/// Residual: the height of a frame above a slope, z − 0.1 x.
struct Height {
    frame: usize,
}

impl GenericResidual for Height {
    fn size(&self) -> usize {
        1
    }
    fn inputs(&self) -> Inputs {
        Inputs::POSITIONS
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let p = state.placements().frame(self.frame).translation;
        r[0] = p.z - p.x * S::splat(0.1);
    }
}

/// Returns the problem of an arm that reaches for a point. If `above` is given, the arm also stays above a slope.
pub fn reach(arm: &Arc<Model>, x0: &[f64], target: Vec3<f64>, above: Option<f64>) -> Result<Problem, Error> {
    let (tool, n) = (arm.frame("tool")?, arm.nv());
    let place = Residual::FrameTranslation { frame: "tool".into(), target };
    let costs = vec![
        Cost::new("reach", 100.0, place, Activation::Quadratic),
        Cost::new("rest", 1e-2, Residual::State { reference: x0.to_vec() }, Activation::Quadratic),
    ];
    let effort = Cost::new("effort", 1e-4, Residual::Control { reference: vec![0.0; n] }, Activation::Quadratic);
    let mut knot = FreeDynamics::running(arm.clone(), 0.02, [costs.clone(), vec![effort]].concat())?;
    if let Some(height) = above {
        let residual = Residual::Own(OwnResidual::autodiff(arm.clone(), Height { frame: tool }));
        knot = knot.with_limits(vec![Limit::new("slope", residual, vec![height], vec![f64::INFINITY])])?;
    }
    let end = FreeDynamics::terminal(arm.clone(), costs)?;
    Ok(Problem::new(x0.to_vec(), vec![Box::new(knot)], vec![0; 30], Box::new(end))?)
}

/// Solves a problem. In the initial guess, the arm is at rest at all knots.
pub fn solve(problem: &mut Problem) -> Result<Solution, Error> {
    let xs = problem.x0().repeat(problem.horizon() + 1);
    let us = problem.quasi_static(&xs)?;
    Ok(Fddp::new(problem).solve(problem, &xs, &us)?.clone())
}

/// Plans a motion, and returns the efforts of a controller's first step. The operator `?` converts the errors of three
/// crates.
pub fn first_effort(arm: &Arc<Model>, x0: &[f64]) -> Result<DVector<f64>, Error> {
    let mut problem = reach(arm, x0, Vec3::new(0.35, 0.2, 0.6), None)?;
    let solution = solve(&mut problem)?;
    let motion = problem.motion(&solution, 0).expect("a robot's knot has a motion");
    let mut controller = WholeBodyController::new(arm, &[], &[Task::posture()], Settings::default())?;
    let (q, v) = x0.split_at(arm.nq());
    let mut references = controller.hold(q)?;
    references.posture.a.copy_from_slice(&motion.acceleration);
    Ok(DVector::from_vec(controller.step(q, v, &references).solved()?.tau.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use condyle::optimal::{AugmentedLagrangian, Status};
    use condyle::robots;

    fn arm() -> (Arc<Model>, Vec<f64>) {
        (Arc::new(robots::arm7()), [&[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0][..], &[0.0; 7]].concat())
    }

    #[test]
    fn a_plan_reaches_and_its_motion_obeys_the_dynamics() -> Result<(), Error> {
        let (arm, x0) = arm();
        let mut problem = reach(&arm, &x0, Vec3::new(0.35, 0.2, 0.6), None)?;
        let solution = solve(&mut problem)?;
        assert_eq!(solution.status, Status::Converged, "{}", solution.status);
        let motion = problem.motion(&solution, 3).unwrap();
        let (q, v) = solution.x(3).split_at(7);
        let mut data = condyle::Data::new(&arm);
        let tau = DVector::from_column_slice(condyle::rnea(&arm, &mut data, q, v, &motion.acceleration, &[]));
        assert!((tau - DVector::from_vec(motion.effort)).norm() < 1e-9);
        Ok(())
    }

    #[test]
    fn targets_change_in_place_and_problems_are_copied() -> Result<(), Error> {
        let (arm, x0) = arm();
        let (first, second) = (Vec3::new(0.35, 0.2, 0.6), Vec3::new(0.4, -0.1, 0.5));
        let mut moved = reach(&arm, &x0, first, None)?.try_clone()?;
        assert!(moved.change_costs("reach", |cost| cost.set_target(second))?);
        let expected = solve(&mut reach(&arm, &x0, second, None)?)?;
        assert_eq!(solve(&mut moved)?.xs, expected.xs);
        assert!(moved.cost_mut(0, "reach").unwrap().set_target(&[0.0; 2][..]).is_err());
        Ok(())
    }

    #[test]
    fn a_limit_of_ones_own_holds() -> Result<(), Error> {
        let (arm, x0) = arm();
        let mut problem = reach(&arm, &x0, Vec3::new(0.35, 0.2, 0.4), Some(0.5))?;
        let xs = x0.repeat(31);
        let us = problem.quasi_static(&xs)?;
        let mut solver = AugmentedLagrangian::new(&problem);
        let solution = solver.solve(&mut problem, &xs, &us)?;
        assert_eq!(solution.status, Status::Converged, "{}", solution.status);
        let (tool, mut data) = (arm.frame("tool")?, condyle::Data::new(&arm));
        for t in 0..30 {
            let p = condyle::forward_kinematics(&arm, &mut data, &solution.x(t)[..7]).frame(tool).translation;
            assert!(p.z - 0.1 * p.x > 0.5 - 1e-5, "knot {t}");
        }
        Ok(())
    }

    #[test]
    fn errors_of_all_crates_meet_in_one() {
        let (arm, x0) = arm();
        assert!(first_effort(&arm, &x0).unwrap().norm() > 0.0);
        let error = first_effort(&arm, &[f64::NAN; 14]).unwrap_err();
        assert!(matches!(error, Error::Optimal(_)), "{error}");
        let lost = reach(&Arc::new(robots::quadruped()), &[0.0; 37], Vec3::default(), None).err().unwrap();
        assert!(matches!(lost, Error::Model(_)), "{lost}");
    }

    #[test]
    fn solvers_and_controllers_are_shared() {
        fn shared<T: Send + Sync>() {}
        fn copied<T: Clone>() {}
        shared::<Problem>();
        shared::<Fddp>();
        shared::<WholeBodyController>();
        copied::<WholeBodyController>();
        copied::<AugmentedLagrangian>();
    }
}
