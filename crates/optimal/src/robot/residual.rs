//! Residuals: what a cost looks at.

use super::cones::{FrictionCone, WrenchCone};
use super::watch::{Offer, Signal};
use condyle_dynamics::{Force, Mat3, Model, Motion, ReferenceFrame, Se3, Vec3};
use serde::{Deserialize, Serialize};

/// What a cost looks at: a vector r(x, u) that should be small.
///
/// Frames are numbers of the model's frames; contacts and impulses are called by the name that the action gives them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
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
    /// q̈ − a_ref, nv numbers.
    JointAcceleration {
        /// a_ref.
        reference: Vec<f64>,
    },
    /// c − c_ref, 3 numbers in the world.
    CenterOfMass {
        /// The wanted centre of mass (m).
        target: Vec3<f64>,
    },
    /// h_G − h_ref, 6 numbers along the world's axes, linear first: the momentum about the centre of mass.
    CentroidalMomentum {
        /// The wanted momentum (kg m/s, kg m²/s).
        target: Force<f64>,
    },
    /// log(refXo oXf), the twist from the target to the frame, in the target's frame: 6 numbers, linear first.
    FramePlacement {
        /// The frame.
        frame: usize,
        /// Its wanted pose in the world.
        target: Se3<f64>,
    },
    /// p − p_ref, 3 numbers, in the world.
    FrameTranslation {
        /// The frame.
        frame: usize,
        /// The wanted position of its origin in the world (m).
        target: Vec3<f64>,
    },
    /// log(R_refᵀ R), 3 numbers, in the target's axes.
    FrameRotation {
        /// The frame.
        frame: usize,
        /// Its wanted axes in the world.
        target: Mat3<f64>,
    },
    /// v − v_ref, 6 numbers, linear first.
    FrameVelocity {
        /// The frame.
        frame: usize,
        /// The wanted velocity (m/s, rad/s).
        target: Motion<f64>,
        /// In which both are expressed.
        reference: ReferenceFrame,
    },
    /// λ − λ_ref, the force or impulse of a contact along the axes of its rows: 3 or 6 numbers, linear first.
    ContactForce {
        /// The contact's name.
        contact: String,
        /// The wanted force; of a point without moment.
        target: Force<f64>,
    },
    /// A f, for a contact's force f: a number for each side of the cone, and the normal force. See
    /// [`FrictionCone::bounds`].
    FrictionCone {
        /// The contact's name.
        contact: String,
        /// The cone.
        cone: FrictionCone,
    },
    /// A w, for a rigid contact's wrench w. See [`WrenchCone::bounds`].
    WrenchCone {
        /// The contact's name.
        contact: String,
        /// The cone.
        cone: WrenchCone,
    },
    /// ±τ_x − ½ size_y f_z, ±τ_y − ½ size_x f_z of a rigid contact: not above 0 while the centre of pressure is inside.
    CenterOfPressure {
        /// The contact's name.
        contact: String,
        /// The surface's axes along the contact's.
        rotation: Mat3<f64>,
        /// The rectangle's sides along the surface's x and y (m).
        size: [f64; 2],
    },
    /// J_c (v⁺ − v), 3 numbers in the world: by how much an impact changes the velocity of the centre of mass (m/s).
    ImpulseCenterOfMass,
}

/// Where the Hessian of a residual has entries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// On the diagonal of Q or R, and in the blocks of groups.
    Diagonal,
    /// Of positions with positions.
    Positions,
    /// Anywhere.
    All,
}

impl Residual {
    /// Where its Hessian has entries.
    pub(super) fn part(&self) -> Part {
        match self {
            Self::State { .. } | Self::Control { .. } => Part::Diagonal,
            Self::CenterOfMass { .. }
            | Self::FramePlacement { .. }
            | Self::FrameTranslation { .. }
            | Self::FrameRotation { .. } => Part::Positions,
            _ => Part::All,
        }
    }

    /// Which signal of the dynamics it looks at, beside x and u.
    pub(super) fn signal(&self) -> Option<Signal> {
        match self {
            Self::JointEffort { .. } => Some(Signal::Effort),
            Self::ControlGravity | Self::JointAcceleration { .. } | Self::ImpulseCenterOfMass => {
                Some(Signal::Acceleration)
            }
            Self::ContactForce { .. }
            | Self::FrictionCone { .. }
            | Self::WrenchCone { .. }
            | Self::CenterOfPressure { .. } => Some(Signal::Force),
            _ => None,
        }
    }

    /// Whether it looks at kinematics alone.
    pub(super) fn is_seen(&self) -> bool {
        self.frame().is_some() || matches!(self, Self::CenterOfMass { .. } | Self::CentroidalMomentum { .. })
    }

    /// Whether another one looks at the same, with a target of its own.
    pub(super) fn looks_like(&self, other: &Self) -> bool {
        let reference = |residual: &Self| match residual {
            Self::FrameVelocity { reference, .. } => Some(*reference),
            _ => None,
        };
        core::mem::discriminant(self) == core::mem::discriminant(other)
            && (self.frame(), reference(self)) == (other.frame(), reference(other))
    }

    /// Writes the numbers of its target, positions and twists first, to lane k.
    pub(super) fn write_target<const N: usize>(&self, k: usize, to: &mut [[f64; N]; 12]) {
        let mut write = |from: usize, numbers: &[f64]| (0..numbers.len()).for_each(|i| to[from + i][k] = numbers[i]);
        match self {
            Self::CenterOfMass { target } | Self::FrameTranslation { target, .. } => write(0, &target.to_array()),
            Self::CentroidalMomentum { target } => write(0, &target.to_array()),
            Self::FrameVelocity { target, .. } => write(0, &target.to_array()),
            Self::FramePlacement { target, .. } => {
                write(0, &target.translation.to_array());
                write(3, target.rotation.columns().map(Vec3::to_array).as_flattened());
            }
            Self::FrameRotation { target, .. } => write(3, target.columns().map(Vec3::to_array).as_flattened()),
            _ => {}
        }
    }

    /// The frame that it looks at.
    pub(super) fn frame(&self) -> Option<usize> {
        match self {
            Self::FramePlacement { frame, .. }
            | Self::FrameTranslation { frame, .. }
            | Self::FrameRotation { frame, .. }
            | Self::FrameVelocity { frame, .. } => Some(*frame),
            _ => None,
        }
    }

    /// The contact that it looks at.
    pub(super) fn contact(&self) -> Option<&str> {
        match self {
            Self::ContactForce { contact, .. }
            | Self::FrictionCone { contact, .. }
            | Self::WrenchCone { contact, .. }
            | Self::CenterOfPressure { contact, .. } => Some(contact),
            _ => None,
        }
    }

    /// How many numbers it has, or what does not fit the robot and what its action offers.
    pub(super) fn check(&self, model: &Model, offer: &Offer) -> Result<usize, String> {
        let (nx, nv) = (model.nq() + model.nv(), model.nv());
        let length = |name: &str, numbers: &[f64], expected: usize| match numbers.len() == expected {
            true if numbers.iter().any(|x| !x.is_finite()) => {
                let what = if numbers.iter().any(|x| x.is_nan()) { "a NaN" } else { "an infinite number" };
                Err(format!("its {name} holds {what}"))
            }
            true => Ok(expected),
            false => Err(format!("its {name} has {} numbers, expected {expected}", numbers.len())),
        };
        if let Some(frame) = self.frame().filter(|&frame| frame >= model.frames().len()) {
            return Err(format!("there is no frame {frame}; the robot has {}", model.frames().len()));
        }
        let rows = match self.contact() {
            Some(name) => offer.contact(name)?.len(),
            None => 0,
        };
        let rigid = |what: &str| match rows {
            6 => Ok(()),
            _ => Err(format!("{what} needs a rigid contact, of 6 rows; this one has {rows}")),
        };
        match self {
            Self::State { reference } => length("reference", reference, nx).map(|_| 2 * nv),
            Self::Control { reference } => length("reference", reference, offer.nu),
            Self::JointEffort { reference } => length("reference", reference, nv),
            Self::JointAcceleration { reference } => length("reference", reference, nv),
            Self::ControlGravity => Ok(nv),
            Self::CenterOfMass { target } => length("target", &target.to_array(), 3),
            Self::CentroidalMomentum { target } => length("target", &target.to_array(), 6),
            Self::FramePlacement { target, .. } => {
                let R = target.rotation.columns().map(Vec3::to_array).concat();
                length("target", &[&target.translation.to_array()[..], &R].concat(), 12).map(|_| 6)
            }
            Self::FrameTranslation { target, .. } => length("target", &target.to_array(), 3),
            Self::FrameRotation { target, .. } => {
                length("target", &target.columns().map(Vec3::to_array).concat(), 9).map(|_| 3)
            }
            Self::FrameVelocity { target, .. } => length("target", &target.to_array(), 6),
            Self::ContactForce { target, .. } => length("target", &target.to_array(), 6).map(|_| rows),
            Self::FrictionCone { cone, .. } => match cone.wrong() {
                Some(what) => Err(what),
                None => Ok(cone.facets + 1),
            },
            Self::WrenchCone { cone, .. } => {
                rigid("a wrench cone")?;
                length("size", &cone.size, 2)?;
                match cone.friction.wrong() {
                    Some(what) => Err(what),
                    None => Ok(cone.friction.facets + 13),
                }
            }
            Self::CenterOfPressure { rotation, size, .. } => {
                rigid("a centre of pressure")?;
                length("size", size, 2)?;
                length("rotation", &rotation.columns().map(Vec3::to_array).concat(), 9).map(|_| 4)
            }
            Self::ImpulseCenterOfMass if !offer.impulse => Err("only an impact changes velocities at once".to_owned()),
            Self::ImpulseCenterOfMass => Ok(3),
        }
        .and_then(|n| match self.signal() {
            Some(Signal::Effort) if !offer.effort => Err("there is no effort at this knot".to_owned()),
            Some(Signal::Acceleration) if !(offer.effort || offer.impulse) => {
                Err("there is no acceleration at this knot".to_owned())
            }
            Some(Signal::Acceleration) if offer.impulse && *self != Self::ImpulseCenterOfMass => {
                Err("an impact has no acceleration".to_owned())
            }
            _ => Ok(n),
        })
    }

    /// W of a residual r = W f of a contact's force, row after row; its rows have as many numbers as the contact.
    pub(super) fn force_rows(&self, rows: usize) -> Vec<f64> {
        match self {
            Self::ContactForce { .. } => (0..rows * rows).map(|k| f64::from(u8::from(k % rows == k / rows))).collect(),
            Self::FrictionCone { cone, .. } => {
                let pad = |row: &[f64; 3]| (0..rows).map(|k| row.get(k).copied().unwrap_or(0.0)).collect::<Vec<_>>();
                cone.rows().iter().flat_map(pad).collect()
            }
            Self::WrenchCone { cone, .. } => cone.rows().concat(),
            Self::CenterOfPressure { rotation, size, .. } => super::cones::pressure_rows(*rotation, *size).concat(),
            _ => Vec::new(),
        }
    }
}
