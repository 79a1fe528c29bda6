//! Residuals: what a cost reads.

use super::cones::{FrictionCone, WrenchCone, pressure_rows, wrong_size};
use super::frame_name::FrameName;
use super::own::{Inputs, OwnResidual};
use super::target::check_rotation;
use crate::robot::outputs::{Capabilities, Output};
use condyle_dynamics::{Force, Mat3, Model, Motion, ReferenceFrame, Se3, Vec3};

/// Residual: a vector r(x, u) that should be small.
///
/// Frames are called by their names in the robot, contacts and impulses by those that the action gives them.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
#[non_exhaustive]
pub enum Residual {
    /// x ⊖ x_ref, 2 nv numbers.
    State {
        /// x_ref = (q, v).
        reference: Vec<f64>,
    },
    /// u − u_ref, nu numbers.
    Control {
        /// u_ref.
        reference: Vec<f64>,
    },
    /// τ − g(q) + Jᵀλ, nv numbers: the efforts and forces beyond those that hold the robot still.
    ControlGravity,
    /// τ − τ_ref, the efforts of all joints, nv numbers.
    JointEffort {
        /// τ_ref.
        reference: Vec<f64>,
    },
    /// Nᵀτ, the efforts that inverse dynamics finds where nothing drives the robot, which must vanish in a motion that
    /// is possible: of a floating base 6 numbers, the force and the moment on it. Nᵀ S = 0, orthonormal.
    UndrivenEffort,
    /// J q̈ + γ of a contact, along the axes of its rows, where accelerations are controls: 1, 2, 3 or 6 numbers that
    /// must vanish while the contact holds.
    ContactAcceleration {
        /// Contact's name.
        contact: String,
    },
    /// q̈ − a_ref, nv numbers.
    JointAcceleration {
        /// a_ref.
        reference: Vec<f64>,
    },
    /// c − c_ref, 3 numbers in the world.
    CenterOfMass {
        /// Wanted centre of mass (m).
        target: Vec3<f64>,
    },
    /// h_G − h_ref, 6 numbers along the world's axes, linear first: the momentum about the centre of mass.
    CentroidalMomentum {
        /// Wanted momentum (kg m/s, kg m²/s).
        target: Force<f64>,
    },
    /// log(refXo oXf), the twist from the target to the frame, in the target's frame: 6 numbers, linear first.
    FramePlacement {
        /// Frame.
        frame: FrameName,
        /// Frame's wanted pose in the world.
        target: Se3<f64>,
    },
    /// p − p_ref, 3 numbers, in the world.
    FrameTranslation {
        /// Frame.
        frame: FrameName,
        /// Wanted position of its origin in the world (m).
        target: Vec3<f64>,
    },
    /// log(R_refᵀ R), 3 numbers, in the target's axes.
    FrameRotation {
        /// Frame.
        frame: FrameName,
        /// Frame's wanted axes in the world.
        target: Mat3<f64>,
    },
    /// v − v_ref, 6 numbers, linear first.
    FrameVelocity {
        /// Frame.
        frame: FrameName,
        /// Wanted velocity (m/s, rad/s).
        target: Motion<f64>,
        /// Frame in which both are expressed.
        reference: ReferenceFrame,
    },
    /// λ − λ_ref, the force or impulse of a contact along the axes of its rows: 1, 2, 3 or 6 numbers, linear first.
    ContactForce {
        /// Contact's name.
        contact: String,
        /// Wanted force along the contact's axes; only what its rows hold is read, of a point no moment, of a line z,
        /// of a plane x and z.
        target: Force<f64>,
    },
    /// F, for a contact's force f along its axes (of a line (0, 0, λ), of a plane (λ₁, 0, λ₂)): a number for each side
    /// of the cone, and the normal force. See [`FrictionCone::bounds`].
    FrictionCone {
        /// Contact's name.
        contact: String,
        /// Cone.
        cone: FrictionCone,
    },
    /// W, for a rigid contact's wrench w. See [`WrenchCone::bounds`].
    WrenchCone {
        /// Contact's name.
        contact: String,
        /// Cone.
        cone: WrenchCone,
    },
    /// ±τ_x − ½ size_y f_z, ±τ_y − ½ size_x f_z of a rigid contact: not above 0 while the centre of pressure is inside.
    CenterOfPressure {
        /// Contact's name.
        contact: String,
        /// Surface's axes along the contact's.
        rotation: Mat3<f64>,
        /// Rectangle's sides along the surface's x and y (m).
        size: [f64; 2],
    },
    /// J_c (v⁺ − v), 3 numbers in the world: by how much an impact changes the velocity of the centre of mass (m/s).
    ImpulseCenterOfMass,
    /// Function of one's own. It cannot be put into a file.
    #[cfg_attr(feature = "serde", serde(skip))]
    Own(OwnResidual),
}

/// Returns the entries of a wrench along a contact's axes that are its rows, by their number: a line has z, a plane x
/// and z.
pub(super) fn held(rows: usize) -> &'static [usize] {
    match rows {
        1 => &[2],
        2 => &[0, 2],
        3 => &[0, 1, 2],
        _ => &[0, 1, 2, 3, 4, 5],
    }
}

/// Part of the Hessian of a residual that has entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    /// Diagonal of Q or R, and the blocks of groups.
    Diagonal,
    /// Block of positions with positions.
    Positions,
    /// Whole Hessian.
    All,
}

impl Residual {
    /// Returns the part of the Hessian that has entries.
    pub(crate) fn part(&self) -> Part {
        match self {
            Self::State { .. } | Self::Control { .. } => Part::Diagonal,
            Self::CenterOfMass { .. }
            | Self::FramePlacement { .. }
            | Self::FrameTranslation { .. }
            | Self::FrameRotation { .. } => Part::Positions,
            Self::Own(own) if own.inputs() == Inputs::POSITIONS => Part::Positions,
            _ => Part::All,
        }
    }

    /// Returns the output of the dynamics that it depends on, besides x and u.
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

    /// Returns whether it reads kinematics alone.
    pub(crate) fn is_kinematic(&self) -> bool {
        self.frame().is_some() || matches!(self, Self::CenterOfMass { .. } | Self::CentroidalMomentum { .. })
    }

    /// Returns whether another residual, of the same frame if it has one, reads the same, with a target of its own.
    pub(crate) fn differs_in_target(&self, other: &Self) -> bool {
        core::mem::discriminant(self) == core::mem::discriminant(other) && self.reference() == other.reference()
    }

    /// Returns the numbers of its target: a position, a twist or a wrench, then a rotation by columns, padded with
    /// zeros.
    pub(crate) fn target_numbers(&self) -> [f64; 12] {
        let mut to = [0.0; 12];
        let mut write = |from: usize, numbers: &[f64]| to[from..][..numbers.len()].copy_from_slice(numbers);
        match self {
            Self::CenterOfMass { target } | Self::FrameTranslation { target, .. } => write(0, &target.to_array()),
            Self::CentroidalMomentum { target } | Self::ContactForce { target, .. } => write(0, &target.to_array()),
            Self::FrameVelocity { target, .. } => write(0, &target.to_array()),
            Self::FramePlacement { target, .. } => {
                write(0, &target.translation.to_array());
                write(3, target.rotation.columns().map(Vec3::to_array).as_flattened());
            }
            Self::FrameRotation { target, .. } => write(3, target.columns().map(Vec3::to_array).as_flattened()),
            _ => {}
        }
        to
    }

    /// Returns the frame that it reads.
    pub(crate) fn frame(&self) -> Option<&FrameName> {
        match self {
            Self::FramePlacement { frame, .. }
            | Self::FrameTranslation { frame, .. }
            | Self::FrameRotation { frame, .. }
            | Self::FrameVelocity { frame, .. } => Some(frame),
            _ => None,
        }
    }

    /// Returns the frame in which it is expressed, of those that leave a choice.
    pub(crate) fn reference(&self) -> Option<ReferenceFrame> {
        match self {
            Self::FrameVelocity { reference, .. } => Some(*reference),
            _ => None,
        }
    }

    /// Returns the contact that it reads.
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

    /// Returns the number of its entries, or what does not fit the robot and the capabilities of its dynamics.
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
            Self::CenterOfMass { .. } | Self::FrameTranslation { .. } | Self::FrameRotation { .. } => 3,
            Self::CentroidalMomentum { .. } | Self::FramePlacement { .. } | Self::FrameVelocity { .. } => 6,
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

    /// W of a residual r = W f of a contact's force, row after row; its rows have as many numbers as the contact.
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
