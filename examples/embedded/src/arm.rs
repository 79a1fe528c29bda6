//! Model of an arm with six joints. The arm is described in code, because the board has no file system.

use condyle_dynamics::{Inertia, Joint, JointOptions, Mat3, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD};

/// Number of joints of the arm.
pub(crate) const JOINTS: usize = 6;

/// Link, and the joint that moves the link.
struct Link {
    name: &'static str,
    /// Axis of the joint, in the link's frame.
    axis: [f64; 3],
    /// Position of the joint in the frame of the previous link (m).
    at: [f64; 3],
    /// Mass (kg). The next fields are the centre of mass (m) and the moments of inertia about the centre of mass (kg
    /// m²).
    mass: f64,
    com: [f64; 3],
    moments: [f64; 3],
    /// Inertia of the motor's rotor, referred to the joint (kg m²).
    rotor: f64,
}

const Y: [f64; 3] = [0.0, 1.0, 0.0];
const Z: [f64; 3] = [0.0, 0.0, 1.0];

const LINKS: [Link; JOINTS] = [
    Link {
        name: "base",
        axis: Z,
        at: [0.0, 0.0, 0.16],
        mass: 3.7,
        com: [0.0, -0.02, 0.0],
        moments: [0.015, 0.012, 0.015],
        rotor: 0.1,
    },
    Link {
        name: "shoulder",
        axis: Y,
        at: [0.0, 0.14, 0.0],
        mass: 8.4,
        com: [0.0, 0.0, 0.21],
        moments: [0.13, 0.13, 0.015],
        rotor: 0.1,
    },
    Link {
        name: "elbow",
        axis: Y,
        at: [0.0, -0.12, 0.42],
        mass: 2.3,
        com: [0.0, 0.0, 0.2],
        moments: [0.03, 0.03, 0.004],
        rotor: 0.06,
    },
    Link {
        name: "wrist 1",
        axis: Y,
        at: [0.0, 0.0, 0.39],
        mass: 1.2,
        com: [0.0, 0.1, 0.0],
        moments: [0.003, 0.002, 0.003],
        rotor: 0.02,
    },
    Link {
        name: "wrist 2",
        axis: Z,
        at: [0.0, 0.09, 0.0],
        mass: 1.2,
        com: [0.0, 0.0, 0.08],
        moments: [0.003, 0.003, 0.002],
        rotor: 0.02,
    },
    Link {
        name: "wrist 3",
        axis: Y,
        at: [0.0, 0.0, 0.09],
        mass: 0.3,
        com: [0.0, 0.05, 0.0],
        moments: [2e-4, 1e-4, 2e-4],
        rotor: 0.01,
    },
];

/// Returns the model of the arm.
pub(crate) fn model() -> Model {
    let mut builder = ModelBuilder::new("arm");
    let mut parent = WORLD;
    for Link { name, axis, at, mass, com, moments: [xx, yy, zz], rotor } in LINKS {
        let (joint, placement) = (Joint::Revolute { axis: axis.into() }, Se3::new(Mat3::identity(), at.into()));
        let moments = Sym3 { xx, yy, zz, ..Sym3::diagonal(0.0) };
        let inertia = Inertia::from_com(mass, Vec3::from(com), moments);
        let options = JointOptions { armature: rotor, ..JointOptions::default() };
        parent = builder.body_with((name, name), parent, joint, placement, inertia, options);
    }
    builder.build().expect("the table describes an arm")
}
