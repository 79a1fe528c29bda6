//! Residuals of costs and limits.

use super::cones::{FrictionCone, WrenchCone, pressure_rows, wrong_size};
use super::distance::prepare;
use super::own::{Inputs, OwnResidual};
use super::target::check_rotation;
use crate::robot::outputs::{Capabilities, Output};
use condyle_dynamics::distances::{FrameName, GeometryPair};
use condyle_dynamics::{Force, Mat3, Model, Motion, ReferenceFrame, Se3, Vec3};

/// Residual: a vector r(x, u) that a cost makes small or a limit bounds.
///
/// Names of frames are names in the robot. Names of contacts are names in the action.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
#[non_exhaustive]
pub enum Residual {
    /// State error x ⊖ x_ref, 2 nv entries.
    State {
        /// Reference state x_ref = (q, v).
        reference: Vec<f64>,
    },
    /// Control error u − u_ref, nu entries.
    Control {
        /// Reference controls u_ref.
        reference: Vec<f64>,
    },
    /// Efforts and contact forces minus the efforts that hold the robot still: τ − g(q) + Jᵀλ, nv entries.
    ControlGravity,
    /// Effort error τ − τ_ref of all joints, nv entries.
    JointEffort {
        /// Reference efforts τ_ref.
        reference: Vec<f64>,
    },
    /// Efforts Nᵀτ without motor, from inverse dynamics. The rows of Nᵀ are orthonormal and satisfy Nᵀ S = 0. These
    /// efforts are 0 in each motion that the controls can produce. For a floating base they have 6 entries: the force
    /// and the moment on the base.
    UndrivenEffort,
    /// Acceleration J q̈ + γ of a contact along the axes of its rows, if joint accelerations are controls. It has 1, 2,
    /// 3 or 6 entries, which are 0 while the contact holds.
    ContactAcceleration {
        /// Name of the contact.
        contact: String,
    },
    /// Acceleration error q̈ − a_ref of all joints, nv entries.
    JointAcceleration {
        /// Reference accelerations a_ref.
        reference: Vec<f64>,
    },
    /// Error c − c_ref of the centre of mass, 3 entries along the world's axes.
    CenterOfMass {
        /// Desired centre of mass in the world (m).
        target: Vec3<f64>,
    },
    /// Error h_G − h_ref of the momentum about the centre of mass: 6 entries along the world's axes, linear first.
    CentroidalMomentum {
        /// Desired momentum (kg m/s, kg m²/s).
        target: Force<f64>,
    },
    /// Twist log(refXo oXf) from the target to the frame, expressed in the target's frame: 6 entries, linear first.
    FramePlacement {
        /// Frame whose pose or velocity the residual reads.
        frame: FrameName,
        /// Desired pose of the frame in the world.
        target: Se3<f64>,
    },
    /// Error p − p_ref of a frame's position, 3 entries along the world's axes.
    FrameTranslation {
        /// Frame whose pose or velocity the residual reads.
        frame: FrameName,
        /// Desired position of the frame's origin in the world (m).
        target: Vec3<f64>,
    },
    /// Rotation error log(R_refᵀ R) of a frame, 3 entries along the target's axes.
    FrameRotation {
        /// Frame whose pose or velocity the residual reads.
        frame: FrameName,
        /// Desired rotation of the frame in the world.
        target: Mat3<f64>,
    },
    /// Velocity error v − v_ref of a frame, 6 entries, linear first.
    FrameVelocity {
        /// Frame whose pose or velocity the residual reads.
        frame: FrameName,
        /// Desired velocity (m/s, rad/s).
        target: Motion<f64>,
        /// Frame in which the velocity and its target are expressed.
        reference: ReferenceFrame,
    },
    /// Velocity error Rz(ψ)ᵀ v − v_ref of a frame in its heading frame, 6 entries, linear first. v is the velocity of
    /// the frame's origin along the world's axes, and ψ = atan2(a_y, a_x) is the heading of the frame's x axis a. The
    /// z axis of the heading frame is vertical, so the entries are forwards, to the left, up, and the rates about these
    /// axes. If a is vertical, ψ is 0 and its derivative is left out.
    ///
    /// A [`FrameTranslation`](Self::FrameTranslation) with the weights (0, 0, w) is the height of a base, which with
    /// [`Tilt`](Self::Tilt) and this velocity describes a walk that does not care about its place.
    HeadingVelocity {
        /// Frame whose velocity the residual reads.
        frame: FrameName,
        /// Desired velocity along the axes of the heading frame (m/s, rad/s).
        target: Motion<f64>,
    },
    /// Tilt Rᵀ e_z − up of a frame, 3 entries: the vertical of the world along the axes of the frame, minus its desired
    /// value. It does not depend on the heading. With up = e_z, the first two entries are the sines of the tilts, and
    /// are 0 if the frame is upright.
    Tilt {
        /// Frame whose rotation the residual reads.
        frame: FrameName,
        /// Desired vertical along the axes of the frame, a unit vector.
        up: Vec3<f64>,
    },
    /// Signed distances between geometries on the robot and obstacles in the world, or other geometries of the same
    /// robot (m). Each pair has one entry r = n·(p₁ − p₂), which is negative while the geometries overlap.
    /// The points p₁ and p₂ on the surfaces and the unit normal n are defined in
    /// [`distances`](condyle_dynamics::distances), with the shapes of which the distance is exact.
    ///
    /// The Jacobian of an entry is nᵀ (∂p₁/∂q − ∂p₂/∂q), for points that are fixed to their bodies. If the centres of
    /// two spheres coincide, n is the world's z axis, so that the derivatives stay finite and move the spheres apart.
    ///
    /// A [`Limit`](crate::robot::Limit) with lower bounds and infinite upper bounds keeps the geometries apart. It
    /// applies only at knots, so a short Δt or a margin must exclude collisions between two knots.
    ///
    /// ```
    /// use condyle_dynamics::{Data, Vec3, forward_kinematics, robots};
    /// use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Geometry, GeometryPair, Limit, Residual, Shape};
    /// use condyle_optimal::{AugmentedLagrangian, Problem, Status};
    /// use std::sync::Arc;
    /// # let (arm, x0) = (Arc::new(robots::arm7()), [vec![-0.6, 0.9, 0.0, 1.2, 0.0, 0.4, 0.0], vec![0.0; 7]].concat());
    /// // the arm turns about its vertical axis; its tool must pass a ball of radius 0.1 m with a margin of 0.01 m
    /// let tool = arm.frame("tool")?;
    /// let place = |q: &[f64]| forward_kinematics(&arm, &mut Data::new(&arm), q).frame(tool).translation;
    /// let goal = [vec![0.6], x0[1..].to_vec()].concat();
    /// let ball = Shape::sphere(place(&[vec![0.0], x0[1..7].to_vec()].concat()), 0.1);
    /// let pair = GeometryPair::new(Geometry::on("tool", Shape::sphere(Vec3::zero(), 0.05)), Geometry::in_world(ball));
    /// let clear = Residual::distances(vec![pair]);
    /// let cost = |name, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    /// let costs = vec![
    ///     cost("rest", 1e-1, Residual::State { reference: goal.clone() }),
    ///     cost("effort", 1e-4, Residual::Control { reference: vec![0.0; 7] }),
    /// ];
    /// let limit = Limit::new("clear", clear, vec![0.01], vec![f64::INFINITY]);
    /// let mut knot = FreeDynamics::running(arm.clone(), 0.05, costs)?.with_limits(vec![limit])?;
    /// let us = knot.quasi_static(&x0).repeat(20);
    /// let end = FreeDynamics::terminal(arm.clone(), vec![cost("goal", 1e2, Residual::State { reference: goal })])?;
    /// let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
    /// let mut solver = AugmentedLagrangian::new(&problem);
    /// let solution = solver.solve(&mut problem, &x0.repeat(21), &us)?;
    /// assert_eq!(solution.status, Status::Converged);
    /// let Shape::Sphere { center, .. } = ball else { unreachable!() };
    /// let nearest = solution.xs.chunks(14).map(|x| (place(&x[..7]) - center).norm_squared().sqrt() - 0.15);
    /// let nearest = nearest.fold(f64::INFINITY, f64::min);
    /// assert!(nearest > 0.01 - 1e-6 && nearest < 0.02);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    Distances {
        /// Pairs of geometries, one for each entry.
        pairs: Vec<GeometryPair>,
        /// Range r (m), above 0: an entry is min(d, r). Pairs that are farther away cost only a comparison of bounding
        /// spheres, and have no derivatives. Infinite for the distances of all pairs. A limit needs a range well above
        /// its bounds.
        #[cfg_attr(feature = "serde", serde(default = "everywhere", with = "condyle_spatial::finite::greatest"))]
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "is_everywhere"))]
        range: f64,
    },
    /// Error λ − λ_ref of a contact's force or impulse along the axes of the contact's rows: 1, 2, 3 or 6 entries,
    /// linear first.
    ContactForce {
        /// Name of the contact.
        contact: String,
        /// Desired force along the contact's axes. Only the components that the contact constrains are read: no moment
        /// for a point, only z for a line, only x and z for a plane.
        target: Force<f64>,
    },
    /// Rows of a friction cone times the contact's force f: one entry for each side of the cone, then the normal force.
    /// The force is f = (0, 0, λ) for a line contact, and f = (λ₁, 0, λ₂) for a plane contact. See
    /// [`FrictionCone::bounds`].
    FrictionCone {
        /// Name of the contact.
        contact: String,
        /// Cone that defines the rows.
        cone: FrictionCone,
    },
    /// Rows of a wrench cone times the wrench w of a rigid contact. See [`WrenchCone::bounds`].
    WrenchCone {
        /// Name of the contact.
        contact: String,
        /// Cone that defines the rows.
        cone: WrenchCone,
    },
    /// Limits ±τ_x − ½ size_y f_z and ±τ_y − ½ size_x f_z of a rigid contact. They are at most 0 while the centre of
    /// pressure is inside the rectangle.
    CenterOfPressure {
        /// Name of the contact.
        contact: String,
        /// Rotation from the axes of the surface to the axes of the contact.
        rotation: Mat3<f64>,
        /// Side lengths of the rectangle along the axes x and y of the surface (m).
        size: [f64; 2],
    },
    /// Velocity change J_c (v⁺ − v) of the centre of mass at an impact (m/s), 3 entries along the world's axes.
    ImpulseCenterOfMass,
    /// User-defined function, which cannot be written to a file.
    #[cfg_attr(feature = "serde", serde(skip))]
    Own(OwnResidual),
}

/// Returns the indices of the wrench entries that a contact with this number of rows constrains: z for a line, x and z
/// for a plane.
pub(super) fn held(rows: usize) -> &'static [usize] {
    match rows {
        1 => &[2],
        2 => &[0, 2],
        3 => &[0, 1, 2],
        _ => &[0, 1, 2, 3, 4, 5],
    }
}

/// Block of the Hessian in which a residual's term has nonzero entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// Diagonal of Q or R, and the blocks of groups that are not a vector space.
    Diagonal,
    /// Block of Q for the positions.
    Positions,
    /// All blocks of the Hessian.
    All,
}

/// Returns the range of distances without a limit.
#[cfg(feature = "serde")]
fn everywhere() -> f64 {
    f64::INFINITY
}

/// Returns whether a range has no limit.
#[cfg(feature = "serde")]
#[allow(clippy::trivially_copy_pass_by_ref)] // serde passes a reference
fn is_everywhere(range: &f64) -> bool {
    *range == f64::INFINITY
}

impl Residual {
    /// Returns the distances of all pairs, without a range.
    pub fn distances(pairs: Vec<GeometryPair>) -> Self {
        Self::Distances { pairs, range: f64::INFINITY }
    }

    /// Returns which block of the Hessian has nonzero entries.
    pub(crate) fn part(&self) -> Part {
        match self {
            Self::State { .. } | Self::Control { .. } => Part::Diagonal,
            Self::CenterOfMass { .. }
            | Self::FramePlacement { .. }
            | Self::FrameTranslation { .. }
            | Self::FrameRotation { .. }
            | Self::Tilt { .. }
            | Self::Distances { .. } => Part::Positions,
            Self::Own(own) if own.inputs() == Inputs::POSITIONS => Part::Positions,
            _ => Part::All,
        }
    }

    /// Returns the output of the dynamics that the residual reads, in addition to x and u; `None` without such an
    /// output.
    pub(crate) fn output(&self) -> Option<Output> {
        match self {
            Self::JointEffort { .. } | Self::UndrivenEffort => Some(Output::Effort),
            Self::ContactAcceleration { .. } => Some(Output::ContactAcceleration),
            Self::ControlGravity | Self::JointAcceleration { .. } | Self::ImpulseCenterOfMass => {
                Some(Output::Acceleration)
            }
            Self::ContactForce { .. }
            | Self::FrictionCone { .. }
            | Self::WrenchCone { .. }
            | Self::CenterOfPressure { .. } => Some(Output::Force),
            _ => None,
        }
    }

    /// Returns whether the residual reads only kinematics.
    pub(crate) fn is_kinematic(&self) -> bool {
        let whole =
            matches!(self, Self::CenterOfMass { .. } | Self::CentroidalMomentum { .. } | Self::Distances { .. });
        whole || self.frame().is_some()
    }

    /// Returns whether the residual and `other` differ only in their targets. Callers must compare the frames and the
    /// pairs of bodies of both residuals.
    pub(crate) fn differs_in_target(&self, other: &Self) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other) && self.reference() == other.reference()
    }

    /// Returns the entries of the target, padded with zeros: a position, twist or wrench, then a rotation column by
    /// column.
    pub(crate) fn target_numbers(&self) -> [f64; 12] {
        let mut to = [0.0; 12];
        let mut write = |from: usize, numbers: &[f64]| to[from..][..numbers.len()].copy_from_slice(numbers);
        match self {
            Self::CenterOfMass { target } | Self::FrameTranslation { target, .. } | Self::Tilt { up: target, .. } => {
                write(0, &target.to_array());
            }
            Self::CentroidalMomentum { target } | Self::ContactForce { target, .. } => write(0, &target.to_array()),
            Self::FrameVelocity { target, .. } | Self::HeadingVelocity { target, .. } => write(0, &target.to_array()),
            Self::FramePlacement { target, .. } => {
                write(0, &target.translation.to_array());
                write(3, target.rotation.columns().map(Vec3::to_array).as_flattened());
            }
            Self::FrameRotation { target, .. } => write(3, target.columns().map(Vec3::to_array).as_flattened()),
            _ => {}
        }
        to
    }

    /// Returns the frame that the residual reads.
    pub(crate) fn frame(&self) -> Option<&FrameName> {
        match self {
            Self::FramePlacement { frame, .. }
            | Self::FrameTranslation { frame, .. }
            | Self::FrameRotation { frame, .. }
            | Self::FrameVelocity { frame, .. }
            | Self::HeadingVelocity { frame, .. }
            | Self::Tilt { frame, .. } => Some(frame),
            _ => None,
        }
    }

    /// Returns the reference frame of the residual's axes; `None` if the kind of residual has fixed axes.
    pub(crate) fn reference(&self) -> Option<ReferenceFrame> {
        match self {
            Self::FrameVelocity { reference, .. } => Some(*reference),
            _ => None,
        }
    }

    /// Returns the contact that the residual reads.
    pub(crate) fn contact(&self) -> Option<&str> {
        match self {
            Self::ContactForce { contact, .. }
            | Self::ContactAcceleration { contact }
            | Self::FrictionCone { contact, .. }
            | Self::WrenchCone { contact, .. }
            | Self::CenterOfPressure { contact, .. } => Some(contact),
            _ => None,
        }
    }

    /// Returns the number of entries, or a text that describes why the residual does not fit the robot or its dynamics.
    pub(crate) fn check(&self, model: &Model, capabilities: &Capabilities) -> Result<usize, String> {
        let (nv, nu) = (model.nv(), capabilities.nu);
        let rows = self.contact().map_or(Ok(0), |name| capabilities.contact(name).map(|rows| rows.len()))?;
        let rigid = |what: &str| match rows {
            6 => Ok(()),
            _ => Err(format!("{what} needs a rigid contact, of 6 rows; this one has {rows}")),
        };
        if let Some(target) = self.target() {
            self.check_target(model, nu, target)?;
        }
        let n = match self {
            Self::State { .. } => 2 * nv,
            Self::Control { .. } => nu,
            Self::JointEffort { .. } | Self::JointAcceleration { .. } => nv,
            Self::ControlGravity => nv,
            Self::CenterOfMass { .. }
            | Self::FrameTranslation { .. }
            | Self::FrameRotation { .. }
            | Self::Tilt { .. } => 3,
            Self::CentroidalMomentum { .. }
            | Self::FramePlacement { .. }
            | Self::FrameVelocity { .. }
            | Self::HeadingVelocity { .. } => 6,
            Self::UndrivenEffort if capabilities.effort => capabilities.undriven.len() / nv.max(1),
            Self::UndrivenEffort => 0,
            Self::ContactForce { .. } | Self::ContactAcceleration { .. } => rows,
            Self::FrictionCone { cone, .. } => cone.wrong().map_or(Ok(cone.facets + 1), Err)?,
            Self::WrenchCone { cone, .. } => {
                rigid("a wrench cone")?;
                cone.wrong().map_or(Ok(cone.friction.facets + 13), Err)?
            }
            Self::CenterOfPressure { rotation, size, .. } => {
                rigid("a centre of pressure")?;
                wrong_size(*size).map_or(Ok(()), Err)?;
                check_rotation("rotation", rotation).map(|()| 4)?
            }
            Self::ImpulseCenterOfMass if !capabilities.impulse => {
                return Err("only an impact changes velocities at once".to_owned());
            }
            Self::ImpulseCenterOfMass => 3,
            Self::Distances { range, .. } if range.is_nan() || *range <= 0.0 => {
                return Err(format!("its range is {range}, expected a number above 0"));
            }
            Self::Distances { pairs, .. } => prepare(model, pairs)?.len(),
            Self::Own(own) => own.check(model, nu).map(|()| own.size())?,
        };
        match self.output() {
            Some(Output::ContactAcceleration) if !capabilities.inverse => {
                Err("its contact holds at this knot; contacts accelerate where accelerations are controls".to_owned())
            }
            Some(Output::Effort) if !capabilities.effort => Err("there is no effort at this knot".to_owned()),
            Some(Output::Acceleration) if !(capabilities.effort || capabilities.impulse) => {
                Err("there is no acceleration at this knot".to_owned())
            }
            Some(Output::Acceleration) if capabilities.impulse && *self != Self::ImpulseCenterOfMass => {
                Err("an impact has no acceleration".to_owned())
            }
            Some(Output::Effort) if n == 0 && nv > 0 => Err("all efforts of this knot are those of drives".to_owned()),
            _ => Ok(n),
        }
    }

    /// Turns the friction cone of a contact force to the rotation R, and writes the matrix W of
    /// [`force_rows`](Self::force_rows) again. Returns whether the residual is a friction cone. Allocates nothing.
    pub(crate) fn turn_cone(&mut self, R: Mat3<f64>, rows: usize, W: &mut [f64]) -> bool {
        let Self::FrictionCone { cone, .. } = self else { return false };
        cone.rotation = R;
        let mut entries = W.iter_mut();
        cone.each_row(|row| {
            let held = held(rows).iter().map(|&k| row.get(k).copied().unwrap_or(0.0));
            entries.by_ref().zip(held).for_each(|(to, from)| *to = from);
        });
        true
    }

    /// Calls `change` with the friction cone of a contact force or of a wrench, and writes the matrix W of
    /// [`force_rows`](Self::force_rows) again. Returns whether the residual has a cone. `change` must keep the number
    /// of sides.
    pub(crate) fn change_friction(
        &mut self,
        rows: usize,
        W: &mut [f64],
        change: &mut dyn FnMut(&mut FrictionCone),
    ) -> bool {
        match self {
            Self::FrictionCone { cone, .. } => change(cone),
            Self::WrenchCone { cone, .. } => change(&mut cone.friction),
            _ => return false,
        }
        W.copy_from_slice(&self.force_rows(rows));
        true
    }

    /// Returns the matrix W, row after row, of a residual r = W f, where f is a contact's force. W has as many columns
    /// as the contact has rows.
    pub(crate) fn force_rows(&self, rows: usize) -> Vec<f64> {
        match self {
            Self::ContactForce { .. } => (0..rows * rows).map(|k| f64::from(u8::from(k % rows == k / rows))).collect(),
            Self::FrictionCone { cone, .. } => {
                let pad =
                    |row: &[f64; 3]| held(rows).iter().map(|&k| row.get(k).copied().unwrap_or(0.0)).collect::<Vec<_>>();
                cone.rows().iter().flat_map(pad).collect()
            }
            Self::WrenchCone { cone, .. } => cone.rows().concat(),
            Self::CenterOfPressure { rotation, size, .. } => pressure_rows(*rotation, *size).concat(),
            _ => Vec::new(),
        }
    }
}
