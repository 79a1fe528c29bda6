//! Optimal control problem of a robot as data, for example in a file.

use super::actuation::Actuation;
use super::contact::Contact;
use super::continuous::ContinuousModel;
use super::costs::Cost;
use super::dynamics::acceleration::{RobotAcceleration, RobotKind};
use super::dynamics::contact::ContactAcceleration;
use super::dynamics::free::{FreeAcceleration, FreeDynamics};
use super::dynamics::impulse::ImpulseDynamics;
use super::dynamics::inverse::ControlledAcceleration;
use super::dynamics::inverse_contact::ControlledContactAcceleration;
use super::integrators::{ControlPolynomial, Integrated, Integrator};
use super::limits::Limit;
use crate::{ActionModel, ControlRate, Error, Problem};
use condyle_dynamics::Model;
use nalgebra::DMatrix;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Optimal control problem of a robot as data, including the robot. The data can be stored in a file, sent, and solved
/// again. [`build`](Self::build) checks the data and creates the [`Problem`].
///
/// All formats of serde are supported. In JSON an infinite bound is `null`.
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
///     knot_models: vec![0; 20],
///     terminal: Knot::new(Dynamics::Terminal, vec![rest]),
/// };
/// let text = serde_json::to_string(&data)?;
/// let problem = serde_json::from_str::<RobotProblem>(&text)?.build()?;
/// assert_eq!(problem.horizon(), 20);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct RobotProblem {
    /// Robot of the problem.
    pub model: Model,
    /// Initial state (q, v).
    pub x0: Vec<f64>,
    /// Kinds of knots that the horizon uses.
    pub knots: Vec<Knot>,
    /// Index into `knots` for each knot of the horizon.
    #[cfg_attr(feature = "serde", serde(alias = "stages"))]
    pub knot_models: Vec<usize>,
    /// Terminal knot, which may be an impact.
    pub terminal: Knot,
}

/// Description of a knot as data.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Knot {
    /// Dynamics, which give the next state.
    pub dynamics: Dynamics,
    /// Common costs at all indices of the horizon.
    pub costs: Vec<Cost>,
    /// Costs that replace `costs` at single knots. The key is the index of the knot in the horizon.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub costs_at: BTreeMap<usize, Vec<Cost>>,
    /// Common limits at all indices of the horizon.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Vec::is_empty"))]
    pub limits: Vec<Limit>,
    /// Limits that replace `limits` at single knots. The key is the index of the knot in the horizon.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BTreeMap::is_empty"))]
    pub limits_at: BTreeMap<usize, Vec<Limit>>,
    /// Bounds on the controls; `None` without bounds.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub bounds: Option<ControlBounds>,
    /// Polynomial of the controls in time. It must be constant at an impact and at the terminal knot, which have no
    /// controls.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "ControlPolynomial::is_constant"))]
    pub controls: ControlPolynomial,
    /// Cost of the change of the controls since the knot before; `None` without such a cost.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub change: Option<ControlChange>,
}

/// Cost, and limits, of the change u − p of the controls since the knot before, as in [`ControlRate`]. All knots of a
/// problem need the same weights, and the initial state of the problem is (q, v, p).
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::{ControlChange, Dynamics, Integrator, Knot, RobotProblem};
/// let step = Dynamics::Free { actuation: None, integrator: Integrator::SemiImplicitEuler, dt: 0.05 };
/// let [knot, terminal] = [step, Dynamics::Terminal].map(|dynamics| Knot {
///     change: Some(ControlChange { weights: vec![1e-2; 7], bounds: None }),
///     ..Knot::new(dynamics, vec![])
/// });
/// let (x0, knot_models) = (vec![0.0; 21], vec![0; 20]);
/// let data = RobotProblem { model: robots::arm7(), x0, knots: vec![knot], knot_models, terminal };
/// assert_eq!(data.build()?.nx(), 21);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ControlChange {
    /// Weight of each control, at least 0.
    pub weights: Vec<f64>,
    /// Bounds on u − p; `None` without bounds. A knot without controls ignores them.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub bounds: Option<ControlBounds>,
}

/// Bounds on the controls of a knot, nu entries each, infinite for an unbounded control. If the controls follow a
/// polynomial in time, the bounds apply at each node of the polynomial.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ControlBounds {
    /// Lower bounds of the controls.
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
    pub lower: Vec<f64>,
    /// Upper bounds of the controls.
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub upper: Vec<f64>,
}

/// Dynamics of a knot, which give its next state. The actuation is the matrix S, nv × nu; without a matrix,
/// [`Actuation::joints`] is used.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
#[non_exhaustive]
pub enum Dynamics {
    /// Free motion: [`FreeDynamics`].
    Free {
        /// Actuation matrix S, nv × nu.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
        #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::read::optional_matrix"))]
        actuation: Option<DMatrix<f64>>,
        /// Integrator of the knot.
        integrator: Integrator,
        /// Duration Δt of the knot (s).
        dt: f64,
    },
    /// Motion in contact: [`ContactDynamics`](super::ContactDynamics).
    Contact {
        /// Contacts that hold during the knot.
        contacts: Vec<Contact>,
        /// Damping μ of the contacts (1/kg).
        damping: f64,
        /// Actuation matrix S, nv × nu.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
        #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::read::optional_matrix"))]
        actuation: Option<DMatrix<f64>>,
        /// Integrator of the knot.
        integrator: Integrator,
        /// Duration Δt of the knot (s).
        dt: f64,
    },
    /// Impact: [`ImpulseDynamics`].
    Impulse {
        /// Contacts that begin at the impact.
        contacts: Vec<Contact>,
        /// Coefficient of restitution ε, from 0 to 1.
        restitution: f64,
        /// Damping μ of the contacts (1/kg).
        damping: f64,
    },
    /// Free motion, with accelerations as controls: [`FreeInverseDynamics`](super::FreeInverseDynamics).
    Inverse {
        /// Integrator of the knot.
        integrator: Integrator,
        /// Duration Δt of the knot (s).
        dt: f64,
    },
    /// Motion in contact, with accelerations and contact forces as controls:
    /// [`ContactInverseDynamics`](super::ContactInverseDynamics).
    ContactInverse {
        /// Contacts that hold during the knot.
        contacts: Vec<Contact>,
        /// Actuation matrix S, nv × nu.
        #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
        #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::read::optional_matrix"))]
        actuation: Option<DMatrix<f64>>,
        /// Integrator of the knot.
        integrator: Integrator,
        /// Duration Δt of the knot (s).
        dt: f64,
    },
    /// Terminal knot, after the last step of the horizon: [`FreeDynamics::terminal`].
    #[cfg_attr(feature = "serde", serde(alias = "end"))]
    Terminal,
}

impl Dynamics {
    /// Returns the duration Δt (s); `None` for an impact and the terminal knot, which have no duration.
    pub fn dt(&self) -> Option<f64> {
        match *self {
            Self::Free { dt, .. }
            | Self::Contact { dt, .. }
            | Self::Inverse { dt, .. }
            | Self::ContactInverse { dt, .. } => Some(dt),
            Self::Impulse { .. } | Self::Terminal => None,
        }
    }

    /// Sets the duration Δt (s). Has no effect for an impact and the terminal knot, which have no duration.
    pub fn set_dt(&mut self, seconds: f64) {
        match self {
            Self::Free { dt, .. }
            | Self::Contact { dt, .. }
            | Self::Inverse { dt, .. }
            | Self::ContactInverse { dt, .. } => *dt = seconds,
            Self::Impulse { .. } | Self::Terminal => {}
        }
    }
}

impl RobotProblem {
    /// Returns the problem. Allocates.
    ///
    /// # Errors
    /// The errors of the knots' constructors and of [`Problem::new`].
    pub fn build(&self) -> Result<Problem, Error> {
        let model = Arc::new(self.model.clone());
        let knots = self.knots.iter().map(|knot| knot.build(&model)).collect::<Result<_, _>>()?;
        Problem::new(self.x0.clone(), knots, self.knot_models.clone(), self.terminal.build(&model)?)
    }
}

impl Knot {
    /// Returns a knot with constant controls and with the same costs at every index of the horizon. The knot has no
    /// limits, no bounds, and no cost of the change of its controls.
    pub fn new(dynamics: Dynamics, costs: Vec<Cost>) -> Self {
        let (costs_at, limits_at) = (BTreeMap::new(), BTreeMap::new());
        let controls = ControlPolynomial::Constant;
        Self { dynamics, costs, costs_at, limits: vec![], limits_at, bounds: None, controls, change: None }
    }

    /// Returns the contact called `name` of the knot's dynamics, as a mutable reference; `None` if it does not exist.
    pub fn contact_mut(&mut self, name: &str) -> Option<&mut Contact> {
        match &mut self.dynamics {
            Dynamics::Contact { contacts, .. }
            | Dynamics::ContactInverse { contacts, .. }
            | Dynamics::Impulse { contacts, .. } => contacts.iter_mut().find(|contact| contact.name == name),
            _ => None,
        }
    }

    /// Returns the action of this knot. Allocates.
    ///
    /// # Errors
    /// The errors of the action's constructor; [`Error::Length`] for bounds with a length other than nu;
    /// [`Error::Actuation`] for a control polynomial at a knot without controls; the errors of [`ControlRate::new`].
    pub fn build(&self, model: &Arc<Model>) -> Result<Box<dyn ActionModel>, Error> {
        let action = self.build_bare(model)?;
        let Some(change) = &self.change else { return Ok(action) };
        let has_controls = action.nu() > 0;
        let action = ControlRate::new(action, &change.weights)?;
        Ok(match &change.bounds {
            Some(ControlBounds { lower, upper }) if has_controls => Box::new(action.limited(lower, upper)?),
            _ => Box::new(action),
        })
    }

    /// Returns the action without the cost of the change of its controls.
    fn build_bare(&self, model: &Arc<Model>) -> Result<Box<dyn ActionModel>, Error> {
        let (model, costs) = (model.clone(), self.costs.clone());
        let drives = |actuation: &Option<DMatrix<f64>>| match actuation {
            None => Ok(Actuation::joints(&model)),
            Some(S) => Actuation::matrix(&model, S.clone()),
        };
        match &self.dynamics {
            Dynamics::Free { actuation, integrator, dt } => {
                let inner = FreeAcceleration::new(model.clone(), drives(actuation)?, costs)?;
                self.bounded(Integrated::new(inner, *integrator, *dt)?)
            }
            Dynamics::Contact { contacts, damping, actuation, integrator, dt } => {
                let inner = ContactAcceleration::new(model.clone(), drives(actuation)?, contacts, *damping, costs)?;
                self.bounded(Integrated::new(inner, *integrator, *dt)?)
            }
            Dynamics::Inverse { integrator, dt } => {
                let inner = ControlledAcceleration::new(model.clone(), costs)?;
                self.bounded(Integrated::new(inner, *integrator, *dt)?)
            }
            Dynamics::ContactInverse { contacts, actuation, integrator, dt } => {
                let inner = ControlledContactAcceleration::new(model.clone(), drives(actuation)?, contacts, costs)?;
                self.bounded(Integrated::new(inner, *integrator, *dt)?)
            }
            Dynamics::Impulse { contacts, restitution, damping } => {
                let action = ImpulseDynamics::instant(model.clone(), contacts, *restitution, *damping, costs)?;
                self.check_bounds(0)?;
                self.check_no_controls()?;
                Ok(Box::new(self.complete(action)?))
            }
            Dynamics::Terminal => {
                self.check_bounds(0)?;
                self.check_no_controls()?;
                Ok(Box::new(self.complete(FreeDynamics::terminal(model, costs)?)?))
            }
        }
    }

    /// Adds the limits of a knot, and the costs and limits of single knots, to an action.
    fn complete<K: RobotKind>(
        &self,
        mut action: Integrated<RobotAcceleration<K>>,
    ) -> Result<Integrated<RobotAcceleration<K>>, Error> {
        let terms = action.terms_mut();
        terms.set_limits(None, self.limits.clone())?;
        for (&t, costs) in &self.costs_at {
            terms.set_costs(t, costs.clone())?;
        }
        for (&t, limits) in &self.limits_at {
            terms.set_limits(Some(t), limits.clone())?;
        }
        Ok(action)
    }

    fn check_bounds(&self, nu: usize) -> Result<(), Error> {
        for (name, bounds) in self.bounds.iter().flat_map(|b| [("lower", &b.lower), ("upper", &b.upper)]) {
            if bounds.len() != nu {
                return Err(Error::Length { name, expected: nu, found: bounds.len() });
            }
        }
        Ok(())
    }

    fn check_no_controls(&self) -> Result<(), Error> {
        match self.controls.is_constant() {
            true => Ok(()),
            false => {
                Err(Error::Actuation { what: "controls: a knot without duration has none to be a polynomial".into() })
            }
        }
    }

    fn bounded<K: RobotKind>(&self, action: Integrated<RobotAcceleration<K>>) -> Result<Box<dyn ActionModel>, Error> {
        let action = self.complete(action)?.with_controls(self.controls);
        self.check_bounds(action.inner().nu())?;
        Ok(match &self.bounds {
            Some(ControlBounds { lower, upper }) => Box::new(action.with_bounds(lower.clone(), upper.clone())),
            None => Box::new(action),
        })
    }
}
