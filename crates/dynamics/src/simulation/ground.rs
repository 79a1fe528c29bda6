//! Ground on which a simulated robot stands: a plane, and the points of the robot that may touch it.

use condyle_model::{Error, Model};
use condyle_spatial::Vec3;

use alloc::string::String;
use alloc::vec::Vec;

/// Tolerance of the normal's length. It covers the rounding errors of a normalised vector. If the length is 1 within
/// this tolerance, the normal is not normalised again and keeps its exact bits.
const UNIT: f64 = 1e-15;

/// Point of a robot that may touch the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GroundPoint {
    /// Index of the frame to which the point is fixed.
    pub frame: usize,
    /// Position of the point in the frame `frame` (m).
    pub position: Vec3<f64>,
}

/// Plane on which a robot stands, slides and lands, and the points of the robot that may touch it.
///
/// The model combines rigid bodies with Coulomb friction, formulated with velocities (Moreau 1988; Stewart and Trinkle
/// 1996; Anitescu and Potra 1997), and uses the steps of [`SemiImplicitEuler`](super::Integrator::SemiImplicitEuler).
/// Each point has a gap φ to the plane and an impulse λ. The velocity of a point after the step, u⁺ = J v⁺, has a
/// component u_n⁺ along the normal and a component u_t⁺ along the plane:
///
/// ```text
/// v⁺ = v + h aba(q, v, τ) + M⁻¹ Jᵀ λ
/// 0 ≤ λ_n ⊥ u_n⁺ + max(φ, 0)/h ≥ 0                                  landing, standing, lift-off
/// ‖λ_t‖ ≤ μ λ_n,  and λ_t = −μ λ_n u_t⁺/‖u_t⁺‖ where u_t⁺ ≠ 0       Coulomb's disc: no pyramid
/// ```
///
/// A point that approaches the plane is slowed down, so that it arrives at the plane exactly at the end of a step. To
/// first order in h, the point does not penetrate the plane. With a restitution e, a point that would hit the plane
/// faster than 2 h ‖g‖ leaves the plane with e times its impact speed instead (Newton's law). A point may be below the
/// plane, in the initial state or because its path is curved. Then the displacement of a step is corrected by w: q⁺ = q
/// ⊕ h (v⁺ + w). The correction reduces the depth by a fifth per step, at no more than 0.5 m/s. The velocity v⁺ does
/// not include w, so the correction adds no kinetic energy.
///
/// Limits of the model:
///
/// - Errors are O(h), because contact and sliding begin and end only at the ends of steps.
/// - Contacts do not store energy, and λ never increases the kinetic energy. The exception is restitution (e > 0) at
///   several contacts with friction: there, Newton's law can increase the energy.
/// - Only the given points touch the plane. Contacts of edges or other bodies, contacts between bodies, rolling
///   resistance and torsional friction are not modelled. A sole resists turning by the friction at its corners.
/// - Impulses of redundant contacts are not unique, but the sum of these impulses is.
/// - Forces are mean values over a step.
///
/// ```
/// use condyle_dynamics::{Vec3, neutral, robots};
/// use condyle_dynamics::simulation::{Ground, Settings, Simulation};
/// let quadruped = robots::quadruped();
/// let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(|name| quadruped.frame(name).unwrap());
/// let weight = 9.81 * quadruped.total_mass();
/// let mut simulation = Simulation::new(&quadruped, Settings::default());
/// let mut q = neutral(&quadruped);
/// q[2] = 0.7; // above the ground
/// simulation.set_state(&q, &[0.0; 18])?;
/// simulation.set_ground(Ground { friction: 0.8, ..Ground::at_frames(feet) })?;
/// let stiff = |now: &mut condyle_dynamics::simulation::Control<'_, f64>| {
///     (6..18).for_each(|k| now.tau[k] = -80.0 * now.q[k + 1] - 2.0 * now.v[k]);
/// };
/// assert!(simulation.run(2000, stiff).is_done());
/// let lifted: f64 = simulation.contacts().iter().map(|contact| contact.force.z).sum();
/// assert!((lifted / weight - 1.0).abs() < 1e-2); // it has landed and stands
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Ground {
    /// Normal n of the plane, pointing out of the ground, in the world's frame.
    /// [`set_ground`](super::Simulation::set_ground) normalises it.
    pub normal: Vec3<f64>,
    /// Height of the plane along n (m): n · p for each point p of the plane.
    pub height: f64,
    /// Coulomb's coefficient of friction μ, at least 0.
    pub friction: f64,
    /// Restitution e, from 0 to 1: the ratio of a point's normal speed after an impact to the normal speed before the
    /// impact.
    pub restitution: f64,
    /// Points of the robot that may touch the plane.
    pub points: Vec<GroundPoint>,
    /// Maximum error of the contact conditions (m/s). A resting point moves at most at this speed. The error of most
    /// steps is far smaller, because the last step of Newton's method squares the error.
    pub tolerance: f64,
    /// Maximum number of iterations of the contact solver in a step. An iteration consists of a few steps of Newton's
    /// method, and of Gauss–Seidel sweeps if these steps do not reduce the error.
    pub max_iterations: usize,
}

impl Default for Ground {
    /// Returns the plane z = 0 with friction 0.7, no restitution and no points. The tolerance is 1e-8 m/s, and the
    /// maximum number of iterations is 500.
    fn default() -> Self {
        Self {
            normal: Vec3::new(0.0, 0.0, 1.0),
            height: 0.0,
            friction: 0.7,
            restitution: 0.0,
            points: Vec::new(),
            tolerance: 1e-8,
            max_iterations: 500,
        }
    }
}

impl Ground {
    /// Returns the default ground, with the origins of the given frames as points.
    pub fn at_frames(frames: impl IntoIterator<Item = usize>) -> Self {
        frames.into_iter().fold(Self::default(), |ground, frame| ground.with_sole(frame, &[Vec3::zero()]))
    }

    /// Adds a sole and returns the ground. The sole is a polygon, given by its corners in `frame` (m). A sole with one
    /// corner is a point.
    ///
    /// ```
    /// use condyle_dynamics::{Vec3, robots, simulation::Ground};
    /// let humanoid = robots::humanoid();
    /// let corners = [(0.1, 0.05), (0.1, -0.05), (-0.1, -0.05), (-0.1, 0.05)].map(|(x, y)| Vec3::new(x, y, 0.0));
    /// let soles = ["left_sole", "right_sole"].map(|name| humanoid.frame(name).unwrap());
    /// let ground = soles.into_iter().fold(Ground::default(), |ground, sole| ground.with_sole(sole, &corners));
    /// assert_eq!(ground.points.len(), 8);
    /// ```
    #[must_use]
    pub fn with_sole(mut self, frame: usize, corners: &[Vec3<f64>]) -> Self {
        self.points.extend(corners.iter().map(|&position| GroundPoint { frame, position }));
        self
    }

    /// Checks the ground's numbers and frames for a robot, and returns the ground with a normal of length 1.
    pub(super) fn checked(mut self, model: &Model) -> Result<Self, Error> {
        let wrong = |what: String| Err(Error::Ground { what });
        let Vec3 { x, y, z } = self.normal;
        let length = self.normal.norm();
        if !(length.is_normal() && length.is_finite()) {
            return wrong(format!("normal ({x}, {y}, {z}) is no direction"));
        }
        if (length - 1.0).abs() > UNIT {
            self.normal /= length;
        }
        if !self.height.is_finite() {
            return wrong(format!("height is {} m, expected a finite number", self.height));
        }
        for (name, number, most) in [
            ("friction", self.friction, f64::MAX),
            ("restitution", self.restitution, 1.0),
            ("tolerance", self.tolerance, f64::MAX),
        ] {
            if !(0.0..=most).contains(&number) {
                let range = if most == 1.0 { "from 0 to 1" } else { "of at least 0" };
                return wrong(format!("{name} is {number}, expected a finite number {range}"));
            }
        }
        let frames = model.frames().len();
        for (i, point) in self.points.iter().enumerate() {
            let Some(frame) = model.frames().get(point.frame) else {
                return wrong(format!("point {i}: there is no frame {}: the model has {frames}", point.frame));
            };
            if frame.body == 0 {
                return wrong(format!("point {i}: frame `{}` is fixed to the world", frame.name));
            }
            let Vec3 { x, y, z } = point.position;
            if ![x, y, z].into_iter().all(f64::is_finite) {
                let at = format!("position ({x}, {y}, {z}) in frame `{}`", frame.name);
                return wrong(format!("point {i}: {at} is not finite"));
            }
        }
        Ok(self)
    }
}

/// Contact of one point with the ground during the last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundContact {
    /// Position of the point in the world at the beginning of the step (m).
    pub position: Vec3<f64>,
    /// Mean force of the ground on the robot at the point during the step, along the axes of the world (N).
    pub force: Vec3<f64>,
    /// Whether the ground exerted a normal force on the point during the step.
    pub touches: bool,
}
