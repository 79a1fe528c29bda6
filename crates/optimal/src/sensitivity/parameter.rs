//! Parameters of a problem: vectors with names, which are read and set without building the problem again.

use super::wrong;
use crate::error::Error;
use crate::problem::Problem;
use crate::robot::{Nudge, RobotNumbers, parameter_names};
use condyle_dynamics::Model;
use core::fmt;
use core::str::FromStr;
#[cfg(feature = "serde")]
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;

/// Parameter of a problem, which has a name: `x0`, or the kind and the name of a cost or contact, such as
/// `target/reach`. A parameter that several knots share changes at all of them.
///
/// ```
/// use condyle_optimal::Parameter;
/// assert_eq!("target/reach".parse(), Ok(Parameter::Target("reach".into())));
/// assert_eq!(Parameter::Weight("effort".into()).to_string(), "weight/effort");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Initial state x̂₀, `x0`. Its changes are in the tangent space, ndx numbers.
    InitialState,
    /// Target of the cost with this name, `target/NAME`. A reference state changes in its tangent space (2 nv numbers),
    /// a rotation R by R exp(δ) (3 numbers), a placement M by M exp(δ) (6 numbers, linear first).
    Target(String),
    /// Weight of the cost with this name, `weight/NAME`, 1 number.
    Weight(String),
    /// Weights of the entries of the residual of the cost with this name, `entry_weights/NAME`.
    EntryWeights(String),
    /// Placement M at which the contact with this name is held, `contact/NAME`. It changes by M exp(δ), 6 numbers,
    /// linear first. It has an effect only if the contact has a gain of the position error.
    Contact(String),
    /// Duration of all knots of a robot that have one, `duration`, 1 number (s). All change by the same amount.
    Duration,
    /// Lower bounds on the controls of all knots of a robot that have bounds, `bounds/lower`, nu numbers.
    LowerBounds,
    /// Upper bounds on these controls, `bounds/upper`, nu numbers.
    UpperBounds,
    /// Coefficient of friction of the cones that are a limit or a cost with this name, `friction/NAME`, 1 number.
    Friction(String),
    /// Inertial parameters of the link with this name, `inertia/LINK`, 10 numbers in the order of
    /// [`inertial_parameters`](condyle_dynamics::inertial_parameters): mass, mass times centre of mass, and xx, xy, yy,
    /// xz, yz, zz of the inertia about the origin of the link. They belong to the problem's copy of the robot.
    Inertia(String),
    /// Acceleration of gravity of the robot in the world's frame, `gravity`, 3 numbers (m/s²).
    Gravity,
    /// Armature of the robot's degrees of freedom, `armature`, nv numbers (kg m², kg).
    Armature,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InitialState => f.write_str("x0"),
            Self::Target(name) => write!(f, "target/{name}"),
            Self::Weight(name) => write!(f, "weight/{name}"),
            Self::EntryWeights(name) => write!(f, "entry_weights/{name}"),
            Self::Contact(name) => write!(f, "contact/{name}"),
            Self::Duration => f.write_str("duration"),
            Self::LowerBounds => f.write_str("bounds/lower"),
            Self::UpperBounds => f.write_str("bounds/upper"),
            Self::Friction(name) => write!(f, "friction/{name}"),
            Self::Inertia(link) => write!(f, "inertia/{link}"),
            Self::Gravity => f.write_str("gravity"),
            Self::Armature => f.write_str("armature"),
        }
    }
}

impl FromStr for Parameter {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let named = |name: &str| name.to_owned();
        match text.split_once('/') {
            None if text == "x0" => Ok(Self::InitialState),
            None if text == "duration" => Ok(Self::Duration),
            None if text == "gravity" => Ok(Self::Gravity),
            None if text == "armature" => Ok(Self::Armature),
            Some(("bounds", "lower")) => Ok(Self::LowerBounds),
            Some(("bounds", "upper")) => Ok(Self::UpperBounds),
            Some(("friction", name)) => Ok(Self::Friction(named(name))),
            Some(("inertia", link)) => Ok(Self::Inertia(named(link))),
            Some(("target", name)) => Ok(Self::Target(named(name))),
            Some(("weight", name)) => Ok(Self::Weight(named(name))),
            Some(("entry_weights", name)) => Ok(Self::EntryWeights(named(name))),
            Some(("contact", name)) => Ok(Self::Contact(named(name))),
            _ => Err(wrong(format!(
                "`{text}` is no parameter; expected `x0`, `duration`, `target/NAME`, `weight/NAME`, \
                 `entry_weights/NAME`, `contact/NAME`, `bounds/lower`, `bounds/upper`, `friction/NAME`, \
                 `inertia/LINK`, `gravity` or `armature`"
            ))),
        }
    }
}

impl Parameter {
    /// Returns the robot with other numbers, if this parameter belongs to a robot that has it.
    ///
    /// # Errors
    /// [`Error::Parameter`] for invalid numbers.
    #[doc(hidden)]
    pub fn changed_robot(&self, robot: &Model, numbers: &[f64]) -> Result<Option<Model>, Error> {
        let Some(kind) = self.robot_numbers().filter(|kind| kind.of(robot).is_some()) else { return Ok(None) };
        let wrong =
            |error: condyle_dynamics::Error| Error::Parameter { name: self.to_string(), what: error.to_string() };
        kind.with(robot, numbers).map(Some).map_err(wrong)
    }

    /// Returns whether the numbers are bounds on controls.
    fn is_bound(&self) -> bool {
        matches!(self, Self::LowerBounds | Self::UpperBounds)
    }

    /// Returns the numbers of a robot that are this parameter.
    fn robot_numbers(&self) -> Option<RobotNumbers> {
        match self {
            Self::Inertia(link) => Some(RobotNumbers::Inertia(link.clone())),
            Self::Gravity => Some(RobotNumbers::Gravity),
            Self::Armature => Some(RobotNumbers::Armature),
            _ => None,
        }
    }

    /// Reads the parameter of a robot's problem; `None` for the initial state.
    pub(super) fn nudge(&self, problem: &mut Problem) -> Result<Option<Nudge>, Error> {
        let nudge = match self {
            Self::InitialState => return Ok(None),
            Self::Target(name) => Nudge::target(problem, name),
            Self::Weight(name) => Nudge::weight(problem, name),
            Self::EntryWeights(name) => Nudge::entry_weights(problem, name),
            Self::Contact(name) => Nudge::contact(problem, name),
            Self::Duration => Nudge::duration(problem),
            Self::LowerBounds => Nudge::bounds(problem, false),
            Self::UpperBounds => Nudge::bounds(problem, true),
            Self::Friction(name) => Nudge::friction(problem, name),
            Self::Inertia(_) | Self::Gravity | Self::Armature => {
                self.robot_numbers().map_or(Ok(None), |numbers| Nudge::robot(problem, numbers))
            }
        };
        nudge?.map(Some).ok_or_else(|| wrong(format!("the problem does not have the parameter `{self}`")))
    }
}

/// Named parameters as vectors.
impl Problem {
    /// Returns the value of a parameter: the initial state (nx), a target in the form of
    /// [`set_references`](Self::set_references), a weight, the weights of entries, the placement of a contact as a
    /// homogeneous matrix (16 numbers, row by row), a duration (s), and the other numbers that [`Parameter`] describes.
    /// Allocates.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the problem does not have the parameter, or if its value differs from knot to knot.
    pub fn parameter(&mut self, parameter: &Parameter) -> Result<Vec<f64>, Error> {
        match parameter.nudge(self)? {
            None => Ok(self.x0().to_vec()),
            Some(nudge) => {
                nudge.value().ok_or_else(|| wrong(format!("the value of `{parameter}` differs from knot to knot")))
            }
        }
    }

    /// Returns the parameters of the problem, with the numbers of entries of their values. Allocates.
    ///
    /// # Errors
    /// [`Error::Cost`] or [`Error::Parameter`] if a parameter has another size at some knots than at others.
    pub fn parameters(&mut self) -> Result<Vec<(Parameter, usize)>, Error> {
        let mut all = vec![(Parameter::InitialState, self.nx())];
        for name in parameter_names(self) {
            let parameter: Parameter = name.parse()?;
            if let Some(nudge) = parameter.nudge(self)? {
                all.push((parameter, nudge.value_size()));
            }
        }
        Ok(all)
    }

    /// Returns the values of several parameters, as [`parameter`](Self::parameter) returns them. Allocates.
    ///
    /// # Errors
    /// The errors of [`parameter`](Self::parameter).
    pub fn parameter_values(&mut self, parameters: &[Parameter]) -> Result<ParameterValues, Error> {
        let pairs = parameters.iter().map(|parameter| Ok((parameter.to_string(), self.parameter(parameter)?)));
        pairs.collect::<Result<_, _>>().map(ParameterValues)
    }

    /// Sets several parameters, as [`set_parameter`](Self::set_parameter) does, in the order of their names.
    ///
    /// # Errors
    /// The first error of [`set_parameter`](Self::set_parameter). Parameters before this one have their new values.
    pub fn set_parameter_values(&mut self, values: &ParameterValues) -> Result<(), Error> {
        values.0.iter().try_for_each(|(name, numbers)| self.set_parameter(&name.parse()?, numbers))
    }

    /// Sets a parameter to a value, in the form that [`parameter`](Self::parameter) returns, at all knots that have it.
    /// The problem is not built again, and solvers continue with it. Numbers of a robot are checked as a builder checks
    /// them, and replace the robot of this problem alone; its workspaces are then allocated again.
    ///
    /// ```
    /// # use condyle_dynamics::{Vec3, robots};
    /// # use condyle_optimal::Problem;
    /// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// # let arm = std::sync::Arc::new(robots::arm7());
    /// # let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    /// # let costs = vec![Cost::new("reach", 1.0, reach, Activation::Quadratic)];
    /// # let knot = FreeDynamics::running(arm.clone(), 0.02, costs.clone())?;
    /// # let end = FreeDynamics::terminal(arm, costs)?;
    /// # let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
    /// problem.set_parameter(&"target/reach".parse()?, &[0.3, 0.2, 0.5])?;
    /// assert_eq!(problem.parameter(&"target/reach".parse()?)?, [0.3, 0.2, 0.5]);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the problem does not have the parameter. [`Error::Parameter`] for another number of
    /// entries, for numbers that are not finite, and for invalid bounds, friction or numbers of a robot: an inertia
    /// must be physical, and the inertia matrix must not become singular. The errors of the setter of the parameter.
    pub fn set_parameter(&mut self, parameter: &Parameter, numbers: &[f64]) -> Result<(), Error> {
        let Some(nudge) = parameter.nudge(self)? else { return self.set_x0(numbers) };
        let expected = nudge.value_size();
        let checked = match parameter.is_bound() {
            true => Error::check_length("numbers", numbers.len(), expected), // bounds may be infinite
            false => Error::check("numbers", numbers, expected),
        };
        checked.map_err(|error| Error::Parameter { name: parameter.to_string(), what: error.to_string() })?;
        nudge.set(self, numbers)
    }
}

/// Values of parameters by their names, which can be stored in a file. In JSON, infinite bounds are `null`.
///
/// ```
/// # use condyle_dynamics::robots;
/// # use condyle_optimal::Problem;
/// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
/// # let arm = std::sync::Arc::new(robots::arm7());
/// # let rest = Residual::State { reference: vec![0.0; 14] };
/// # let costs = vec![Cost::new("rest", 1.0, rest, Activation::Quadratic)];
/// # let knot = FreeDynamics::running(arm.clone(), 0.02, costs.clone())?;
/// # let end = FreeDynamics::terminal(arm, costs)?;
/// # let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
/// let names = ["weight/rest".parse()?, "gravity".parse()?];
/// let text = serde_json::to_string(&problem.parameter_values(&names)?)?;
/// assert_eq!(text, r#"{"gravity":[0.0,0.0,-9.81],"weight/rest":[1.0]}"#);
/// problem.set_parameter_values(&serde_json::from_str(&text)?)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ParameterValues(pub BTreeMap<String, Vec<f64>>);

/// Name that the lower bounds have, whose infinite entries are −∞.
#[cfg(feature = "serde")]
const LOWER: &str = "bounds/lower";

#[cfg(feature = "serde")]
impl Serialize for ParameterValues {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let finite = |numbers: &Vec<f64>| numbers.iter().map(|x| x.is_finite().then_some(*x)).collect::<Vec<_>>();
        to.collect_map(self.0.iter().map(|(name, numbers)| (name, finite(numbers))))
    }
}

#[cfg(feature = "serde")]
impl<'de> Deserialize<'de> for ParameterValues {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let all = BTreeMap::<String, Vec<Option<f64>>>::deserialize(from)?;
        let pair = |(name, numbers): (String, Vec<Option<f64>>)| {
            let infinite = if name == LOWER { f64::NEG_INFINITY } else { f64::INFINITY };
            let numbers = numbers.into_iter().map(|x| x.unwrap_or(infinite)).collect();
            (name, numbers)
        };
        Ok(Self(all.into_iter().map(pair).collect()))
    }
}
