//! Settings of a controller.

use crate::error::Error;
use crate::task::Gains;
use condyle_dynamics::distances::DistanceLimits;
use condyle_dynamics::{Joint, Model};
use std::fmt;

/// Model of friction: cones or pyramids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Friction {
    /// Second-order cone ‖f_t‖ ≤ μ f_n, with the tangential force f_t, the normal force f_n and the friction
    /// coefficient μ.
    Cone,
    /// A pyramid instead of the cone, for comparisons.
    Pyramid {
        /// Number of faces; at least 3.
        sides: usize,
        /// Whether the pyramid lies inside the cone (its edges touch the cone) or around it (its faces touch the cone).
        inscribed: bool,
    },
}

/// Solver of the cone programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Backend {
    /// Clarabel, the reference solver. Needs the feature `clarabel`, which is off by default.
    #[cfg(feature = "clarabel")]
    Clarabel,
    /// Condyle's own dense interior-point method, warm-started from the last tick.
    InteriorPoint,
}

impl fmt::Display for Backend {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            #[cfg(feature = "clarabel")]
            Self::Clarabel => "clarabel",
            Self::InteriorPoint => "interior point",
        })
    }
}

/// Unknowns of the program that the solver receives. The solution does not depend on them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Formulation {
    /// The equalities of the base and of the contacts are eliminated first.
    Condensed,
    /// All unknowns (q̈, f), with equalities. This form is slower and serves for comparisons. With clarabel, this form
    /// has additional unknowns for limited torques and for residuals of tasks. These unknowns make the matrices sparse.
    /// Priorities after the first are always condensed.
    Full,
}

/// Limits of the joints' positions and velocities, as bounds on their accelerations.
///
/// ```text
/// velocity   (v_min − v) / T ≤ q̈ ≤ (v_max − v) / T
/// position   (q_min − q) / T² − 2 v / T ≤ q̈ ≤ (q_max − q) / T² − 2 v / T
///            (the distance d obeys d̈ ≥ −(2 / T) ḋ − d / T²)
/// ```
///
/// A lower bound is at most a_max, and an upper bound is at least −a_max. So a joint beyond its limit, or too fast
/// towards its limit, is led back with at most a_max. If the bounds of position and velocity contradict each other, the
/// bound of the position holds. A joint approaches its limit no faster than a critically damped spring with time
/// constant T would, and does not pass the limit (an exponential control barrier function: Nguyen and Sreenath, 2016).
/// If dynamics, contacts and torques allow no acceleration within these bounds, the bounds become tasks of large weight
/// at that tick.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimits {
    /// Look-ahead time T (s); at least the duration of several ticks.
    pub look_ahead: f64,
    /// a_max (rad/s², m/s²).
    pub max_acceleration: f64,
    /// Minimum position, nq numbers; `None` takes the limits of the model.
    pub lower: Option<Vec<f64>>,
    /// Maximum position, nq numbers; `None` takes the limits of the model.
    pub upper: Option<Vec<f64>>,
    /// Maximum speed, nv numbers; `None` takes the limits of the model.
    pub velocity: Option<Vec<f64>>,
}

impl Default for JointLimits {
    fn default() -> Self {
        Self { look_ahead: 0.05, max_acceleration: 200.0, lower: None, upper: None, velocity: None }
    }
}

/// Settings of [`WholeBodyController`](crate::WholeBodyController).
///
/// ```
/// use condyle_wholebody::{Gains, Settings};
/// // Feet that drifted come back, motors of 40 N m.
/// let settings =
///     Settings { contact_gains: Gains::critical(400.0), effort: Some(vec![40.0; 18]), ..Settings::default() };
/// # let _ = settings;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Weight of ½ ‖q̈‖², which determines the motion that the tasks leave open; above 0.
    pub acceleration_weight: f64,
    /// Weight of ½ Σ ‖f − f_ref‖² (1/N²), with the contact forces f and their references f_ref. It distributes the
    /// forces; above 0. A moment of a sole's wrench costs as much as the corner forces that cause it. This cost keeps
    /// the centre of pressure away from the edges of the sole.
    pub force_weight: f64,
    /// Baumgarte gains k and d. The required acceleration of a contact with the pose X, the reference pose X_ref and
    /// the velocity v is k (X_ref ⊖ X) − d v instead of 0.
    pub contact_gains: Gains,
    /// Maximum acceleration that `contact_gains` may cause (m/s², rad/s²): a foot that lands fast is stopped over
    /// several ticks.
    pub max_correction: f64,
    /// Model of friction: cones or pyramids.
    pub friction: Friction,
    /// Maximum effort of each coordinate, nv numbers (N m, N); infinite for no limit. `None` takes the limits of the
    /// model. The effort of each actuated coordinate is above 0.
    pub effort: Option<Vec<f64>>,
    /// Limits of the joints' positions and velocities; `None` for no limits.
    pub joint_limits: Option<JointLimits>,
    /// Limits of distances between bodies and obstacles; `None` for no limits.
    pub distances: Option<DistanceLimits>,
    /// Maximum number of ticks after the last solution in which the solution's torques serve as the safe command.
    pub hold_ticks: u32,
    /// Damping of the safe command after `hold_ticks`: the effort −D v at the velocity v, where D is this factor
    /// (s/rad) times the maximum effort.
    pub damping: f64,
    /// Solver of the programs.
    pub backend: Backend,
    /// Unknowns of the program that the solver receives.
    pub formulation: Formulation,
    /// Whether the solver starts from the last tick's solution, if possible.
    pub warm_start: bool,
    /// Tolerance of the solver for feasibility and for the duality gap, absolute and relative.
    pub tolerance: f64,
    /// Number of iterations after which a step fails.
    pub max_iterations: u32,
    /// Time after which a step fails (s); may be infinite. With a finite limit, results depend on the machine's load.
    pub time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            acceleration_weight: 1e-6,
            force_weight: 1e-7,
            contact_gains: Gains { stiffness: 0.0, damping: 0.0 },
            max_correction: 50.0,
            friction: Friction::Cone,
            effort: None,
            joint_limits: Some(JointLimits::default()),
            distances: None,
            hold_ticks: 5,
            damping: 0.02,
            backend: Backend::InteriorPoint,
            formulation: Formulation::Condensed,
            warm_start: true,
            tolerance: 1e-9,
            max_iterations: 50,
            time_limit: f64::INFINITY,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self, model: &Model) -> Result<(), Error> {
        let from_zero = |x: f64| x >= 0.0 && x.is_finite();
        let above_zero = |x: f64| x > 0.0 && x.is_finite();
        let Gains { stiffness, damping } = self.contact_gains;
        let default = JointLimits::default();
        let limits = self.joint_limits.as_ref().unwrap_or(&default);
        let sides = if let Friction::Pyramid { sides, .. } = self.friction { sides } else { 3 };
        let (T, a) = (limits.look_ahead, limits.max_acceleration);
        for (name, value, good, allowed) in [
            ("acceleration_weight", self.acceleration_weight, above_zero(self.acceleration_weight), "above 0"),
            ("force_weight", self.force_weight, above_zero(self.force_weight), "above 0"),
            ("contact_gains.stiffness", stiffness, from_zero(stiffness), "at least 0"),
            ("contact_gains.damping", damping, from_zero(damping), "at least 0"),
            ("max_correction", self.max_correction, above_zero(self.max_correction), "above 0"),
            ("friction.sides", sides as f64, sides >= 3, "at least 3"),
            ("joint_limits.look_ahead", T, above_zero(T), "above 0"),
            ("joint_limits.max_acceleration", a, above_zero(a), "above 0"),
            ("damping", self.damping, from_zero(self.damping), "at least 0"),
            ("tolerance", self.tolerance, self.tolerance > 0.0 && self.tolerance < 1.0, "between 0 and 1"),
            ("max_iterations", f64::from(self.max_iterations), self.max_iterations > 0, "at least 1"),
            ("time_limit", self.time_limit, self.time_limit > 0.0, "above 0"),
        ] {
            if !good {
                return Err(Error::Setting { name, value, allowed });
            }
        }
        if let Some((name, value, allowed)) = self.distances.as_ref().and_then(DistanceLimits::wrong) {
            return Err(Error::Setting { name, value, allowed });
        }
        let (nq, nv) = (model.nq(), model.nv());
        for (name, numbers, expected, least) in [
            ("effort", &self.effort, nv, None), // `check_effort` checks the numbers
            ("joint_limits.lower", &limits.lower, nq, Some(f64::NEG_INFINITY)),
            ("joint_limits.upper", &limits.upper, nq, Some(f64::NEG_INFINITY)),
            ("joint_limits.velocity", &limits.velocity, nv, Some(0.0)),
        ] {
            let Some(numbers) = numbers else { continue };
            if numbers.len() != expected {
                return Err(Error::Length { name, expected, found: numbers.len() });
            }
            let wrong = |least: f64| numbers.iter().find(move |&&x| x.is_nan() || x < least);
            if let Some(&value) = least.and_then(wrong) {
                return Err(Error::Setting { name, value, allowed: "at least 0, or any number for a position" });
            }
        }
        Ok(())
    }

    /// Rejects efforts of actuated coordinates that are not above 0; the error names the joint.
    pub(crate) fn check_effort(&self, model: &Model) -> Result<(), Error> {
        let [least, greatest] = self.effort(model);
        let origin = match self.effort {
            Some(_) => "setting `effort`",
            None => "the model's limit of effort (the setting `effort` replaces it)",
        };
        for body in model.bodies().iter().skip(1).filter(|body| body.mimic.is_none()) {
            let coordinates = body.idx_v..body.idx_v + body.joint.nv();
            let mut limits = coordinates.flat_map(|i| [-least[i], greatest[i]]);
            if body.joint == Joint::FreeFlyer {
                // Find an invalid limit of a coordinate on which no motor acts.
                let wrong = limits.find(|&x| x.is_nan() || x < 0.0);
                let error = |value: f64| Error::Setting { name: "effort", value, allowed: "at least 0" };
                wrong.map_or(Ok(()), |value| Err(error(value)))?;
            } else if let Some(value) = limits.find(|&x| x.is_nan() || x <= 0.0) {
                return Err(Error::Effort { joint: body.joint_name.clone(), value, origin });
            }
        }
        Ok(())
    }

    /// Returns the minimum and the maximum effort of each coordinate.
    pub(crate) fn effort(&self, model: &Model) -> [Vec<f64>; 2] {
        let limits = model.limits();
        match &self.effort {
            Some(effort) => [effort.iter().map(|x| -x).collect(), effort.clone()],
            None => [limits.effort_lower.clone(), limits.effort_upper.clone()],
        }
    }
}
