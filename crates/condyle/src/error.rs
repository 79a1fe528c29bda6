//! Error type of this crate. The errors of all re-exported crates convert to this type.

/// Error of this library. The errors of all re-exported crates convert to this type, so that one function can apply `?`
/// to the results of all crates.
///
/// Each re-exported crate keeps its own error type: [`ModelError`](crate::ModelError) for models and dynamics,
/// `optimal::Error`, `wholebody::Error` and `wholebody::Status`. The message and the source of an error are passed on
/// unchanged.
///
#[cfg_attr(all(feature = "loaders", feature = "optimal", feature = "wholebody"), doc = "```")]
#[cfg_attr(not(all(feature = "loaders", feature = "optimal", feature = "wholebody")), doc = "```ignore")]
/// use condyle::optimal::robot::{Activation, Cost, FreeDynamics, Residual};
/// use condyle::optimal::{Fddp, Problem};
/// use condyle::wholebody::{Settings, Task, WholeBodyController};
/// use condyle::{Model, UrdfOptions, robots};
/// use std::sync::Arc;
///
/// /// Plans from the position q and computes the first effort.
/// fn first_effort(urdf: &str, q: &[f64]) -> Result<f64, condyle::Error> {
///     let arm = Arc::new(Model::from_urdf_str(urdf, &UrdfOptions::default())?); // a ModelError
///     let x0 = [q, &vec![0.0; arm.nv()]].concat();
///     let rest = Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic);
///     let knot = FreeDynamics::running(arm.clone(), 0.05, vec![rest.clone()])?; // an optimal::Error
///     let end = FreeDynamics::terminal(arm.clone(), vec![rest])?;
///     let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 5], Box::new(end))?;
///     Fddp::new(&problem).solve(&mut problem, &x0.repeat(6), &vec![0.0; 5 * arm.nv()])?;
///     let mut controller = WholeBodyController::new(&arm, &[], &[Task::posture()], Settings::default())?;
///     let references = controller.hold(q)?; // a wholebody::Error
///     let command = controller.step(q, &vec![0.0; arm.nv()], &references).solved()?; // a wholebody::Status
///     Ok(command.tau[0])
/// }
///
/// assert!(first_effort(robots::ARM7, &[0.3; 7])?.is_finite());
/// let error = first_effort(robots::ARM7, &[f64::NAN; 7]).unwrap_err().to_string();
/// assert_eq!(error, "cost `rest`: its reference holds a NaN");
/// assert!(matches!(first_effort("no XML", &[]), Err(condyle::Error::Model(_))));
/// # Ok::<(), condyle::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Error in a robot's description, in a state, or in the name of an element of the robot.
    #[error(transparent)]
    Model(#[from] condyle_dynamics::Error),
    /// Inertia that no body of positive density can have.
    #[error(transparent)]
    NotPhysical(#[from] condyle_dynamics::inertial_parameters::NotPhysical),
    /// SIMD level that the processor does not support.
    #[error(transparent)]
    Level(#[from] condyle_dynamics::level::Unsupported),
    /// Error in a problem, in a warm start or in the settings of a solver.
    #[cfg(feature = "optimal")]
    #[error(transparent)]
    Optimal(#[from] condyle_optimal::Error),
    /// Backward sweep of a solver that stopped before it reached the first knot.
    #[cfg(feature = "optimal")]
    #[error(transparent)]
    Sweep(#[from] condyle_optimal::SweepError),
    /// Error in the description of a whole-body controller or of a plan.
    #[cfg(feature = "wholebody")]
    #[error(transparent)]
    WholeBody(#[from] condyle_wholebody::Error),
    /// Unsolved quadratic program in a step of a whole-body controller.
    #[cfg(feature = "wholebody")]
    #[error(transparent)]
    Step(#[from] condyle_wholebody::Status),
}
