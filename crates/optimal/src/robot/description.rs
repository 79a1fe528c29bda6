//! A robot's problem as data: what a file has of it.

use super::{
    Actuation, Contact, Contacts, ContinuousModel, Cost, Free, FreeDynamics, ImpulseDynamics, Integrated, Integrator,
    Inverse, Limit,
};
use crate::{ActionModel, Error, Problem};
use condyle_dynamics::Model;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// An optimal control problem of a robot as data, with the robot in it: to keep it in a file, to send it, to solve it
/// again. [`build`](Self::build) makes the [`Problem`]; what is wrong in it is found there.
///
/// Any format of serde serves. In JSON a bound that is infinite is `null`.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::{Activation, Cost, Dynamics, Integrator, Knot, Residual, RobotProblem};
/// let rest = Cost::new("rest", 1.0, Residual::State { reference: vec![0.0; 14] }, Activation::Quadratic);
/// let step = Dynamics::Free { actuation: None, integrator: Integrator::SemiImplicitEuler, dt: 0.05 };
/// let data = RobotProblem {
///     model: robots::arm7(),
///     x0: vec![0.1; 14],
///     knots: vec![Knot::new(step, vec![rest.clone()])],
///     stages: vec![0; 20],
///     terminal: Knot::new(Dynamics::End, vec![rest]),
/// };
/// let text = serde_json::to_string(&data)?;
/// let problem = serde_json::from_str::<RobotProblem>(&text)?.build()?;
/// assert_eq!(problem.horizon(), 20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotProblem {
    /// The robot.
    pub model: Model,
    /// The initial state (q, v).
    pub x0: Vec<f64>,
    /// The knots that there are.
    pub knots: Vec<Knot>,
    /// For each knot of the horizon the index of one of them.
    pub stages: Vec<usize>,
    /// What comes after the last one: the end, or an impact.
    pub terminal: Knot,
}

/// A knot as data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knot {
    /// How the state goes on.
    pub dynamics: Dynamics,
    /// Its costs.
    pub costs: Vec<Cost>,
    /// Other costs in their place, by the number of a knot of the horizon.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub costs_at: BTreeMap<usize, Vec<Cost>>,
    /// Its limits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<Limit>,
    /// Other limits in their place, by the number of a knot of the horizon.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub limits_at: BTreeMap<usize, Vec<Limit>>,
    /// Bounds on its controls, if there are any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounds: Option<ControlBounds>,
}

/// Bounds on the controls of a knot, nu numbers each, infinite where there is none.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlBounds {
    /// Least values.
    #[serde(with = "condyle_spatial::finite::lower")]
    pub lower: Vec<f64>,
    /// Greatest values.
    #[serde(with = "condyle_spatial::finite::upper")]
    pub upper: Vec<f64>,
}

/// How the state of a knot goes on. The actuation is S, nv × nu; without one, [`Actuation::joints`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Dynamics {
    /// [`FreeDynamics`].
    Free {
        /// S.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        actuation: Option<DMatrix<f64>>,
        /// How it steps.
        integrator: Integrator,
        /// Δt (s).
        dt: f64,
    },
    /// [`ContactDynamics`](super::ContactDynamics).
    Contact {
        /// What is held.
        contacts: Vec<Contact>,
        /// μ (1/kg).
        damping: f64,
        /// S.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        actuation: Option<DMatrix<f64>>,
        /// How it steps.
        integrator: Integrator,
        /// Δt (s).
        dt: f64,
    },
    /// [`ImpulseDynamics`].
    Impulse {
        /// What sets in.
        contacts: Vec<Contact>,
        /// ε, from 0 to 1.
        restitution: f64,
        /// μ (1/kg).
        damping: f64,
    },
    /// [`InverseDynamics`](super::InverseDynamics).
    Inverse {
        /// How it steps.
        integrator: Integrator,
        /// Δt (s).
        dt: f64,
    },
    /// [`FreeDynamics::terminal`], after the last knot.
    End,
}

impl RobotProblem {
    /// The problem. Allocates.
    ///
    /// # Errors
    /// Those of the knots' constructors and of [`Problem::new`]; [`Error::TimeStep`] for an end among the knots.
    pub fn build(&self) -> Result<Problem, Error> {
        let model = Arc::new(self.model.clone());
        if self.knots.iter().any(|knot| knot.dynamics == Dynamics::End) {
            return Err(Error::TimeStep { dt: 0.0 });
        }
        let knots = self.knots.iter().map(|knot| knot.build(&model)).collect::<Result<_, _>>()?;
        Problem::new(self.x0.clone(), knots, self.stages.clone(), self.terminal.build(&model)?)
    }
}

/// An action with its limits, and the costs and limits of single knots.
macro_rules! complete {
    ($knot:expr, $action:expr) => {{
        let mut action = $action.with_limits($knot.limits.clone())?;
        for (&t, costs) in &$knot.costs_at {
            action.set_costs(t, costs.clone())?;
        }
        for (&t, limits) in &$knot.limits_at {
            action.set_limits(t, limits.clone())?;
        }
        action
    }};
}

impl Knot {
    /// With these costs at all knots that it serves, and without limits and bounds.
    pub fn new(dynamics: Dynamics, costs: Vec<Cost>) -> Self {
        let (costs_at, limits_at) = (BTreeMap::new(), BTreeMap::new());
        Self { dynamics, costs, costs_at, limits: vec![], limits_at, bounds: None }
    }

    /// The action. Allocates.
    ///
    /// # Errors
    /// Those of its constructor; [`Error::Length`] for bounds of another length than nu.
    pub fn build(&self, model: &Arc<Model>) -> Result<Box<dyn ActionModel>, Error> {
        let (model, costs) = (model.clone(), self.costs.clone());
        let drives = |actuation: &Option<DMatrix<f64>>| match actuation {
            None => Ok(Actuation::joints(&model)),
            Some(S) => Actuation::matrix(&model, S.clone()),
        };
        match &self.dynamics {
            Dynamics::Free { actuation, integrator, dt } => {
                let inner = Free::new(model.clone(), drives(actuation)?, costs)?;
                self.bounded(complete!(self, Integrated::new(inner, *integrator, *dt)?))
            }
            Dynamics::Contact { contacts, damping, actuation, integrator, dt } => {
                let inner = Contacts::new(model.clone(), drives(actuation)?, contacts, *damping, costs)?;
                self.bounded(complete!(self, Integrated::new(inner, *integrator, *dt)?))
            }
            Dynamics::Inverse { integrator, dt } => {
                let inner = Inverse::new(model.clone(), costs)?;
                self.bounded(complete!(self, Integrated::new(inner, *integrator, *dt)?))
            }
            Dynamics::Impulse { contacts, restitution, damping } => {
                let action = ImpulseDynamics::new(model.clone(), contacts, *restitution, *damping, costs)?;
                self.check_bounds(0)?;
                Ok(Box::new(complete!(self, action)))
            }
            Dynamics::End => {
                self.check_bounds(0)?;
                Ok(Box::new(complete!(self, FreeDynamics::terminal(model, costs)?)))
            }
        }
    }

    fn check_bounds(&self, nu: usize) -> Result<(), Error> {
        for (name, bounds) in self.bounds.iter().flat_map(|b| [("lower", &b.lower), ("upper", &b.upper)]) {
            if bounds.len() != nu {
                return Err(Error::Length { name, expected: nu, found: bounds.len() });
            }
        }
        Ok(())
    }

    fn bounded<M: ContinuousModel>(&self, action: Integrated<M>) -> Result<Box<dyn ActionModel>, Error> {
        self.check_bounds(action.nu())?;
        Ok(match &self.bounds {
            Some(ControlBounds { lower, upper }) => Box::new(action.with_bounds(lower.clone(), upper.clone())),
            None => Box::new(action),
        })
    }
}
