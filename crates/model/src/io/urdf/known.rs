//! Known elements and attributes of a URDF. The names come from the schema of URDF, versions 1.0 to 1.2, and from
//! programs that write or read URDFs (ROS control, Gazebo, Drake, Bullet, MuJoCo). Shapes, sensors, controllers, soft
//! limits and calibrations do not affect a model. They are known, so they cause no warning.

use super::elements::check_repeated;
use crate::io::known::{Known, LeftOut};
use crate::io::xml::Element;
use crate::warning::Warning;
use std::sync::OnceLock;

/// Table of known elements and attributes; see [`Known`].
const KNOWN: &str = "\
robot: name version ; link joint drake:joint=joint transmission gazebo** material* sensor* mujoco** ros2_control** frame \
    loop_joint** collision_filter_group* force_element** cable** bullet* drake:collision_filter_group** \
    drake:linear_bushing_rpy** drake:linear_spring_damper** drake:ball_constraint** drake:distance_constraint** \
    drake:tendon_constraint**
*: ; link joint drake:joint transmission inertial mass inertia limit dynamics mimic
link: name type concave drake_ignore ; inertial visual* collision* sensor* contact verbose* bullet* self_collision_checking* \
    self_filter* collision_checking* audio_source* drake:surface_velocity_axis*
inertial: ; origin mass inertia
mass: value
inertia: ixx ixy ixz iyy iyz izz
contact: ; lateral_friction* rolling_friction* spinning_friction* restitution* stiffness* damping* contact_cfm* contact_erp* \
    friction_anchor* inertia_scaling*
origin: xyz rpy quat_xyzw
joint: name type dont_collapse drake_ignore ; origin parent child axis calibration dynamics limit safety_controller mimic \
    controller_gains* hardwareInterface* drake:screw_thread_pitch=number
parent: link
child: link
axis: xyz
calibration: reference_position rising falling
dynamics: damping friction coulomb_window
limit: lower upper effort velocity acceleration deceleration jerk drake:acceleration
safety_controller: soft_lower_limit soft_upper_limit k_position k_velocity
mimic: joint multiplier offset
frame: name link xyz rpy
transmission: name type ; type joint=driven actuator mechanicalReduction=number mechanical_reduction=number \
    gear_ratio=number gearRatio=number rotorInertia=number rotor_inertia=number motorInertia=number motor_inertia=number \
    leftActuator** rightActuator** flexJoint* rollJoint* gap_joint* passive_joint* use_simulated_gripper_joint* \
    simulated_actuated_joint* compensator* motorTorqueConstant robotNamespace hardwareInterface plugin
driven: name role ; hardwareInterface role offset mechanicalReduction=number mechanical_reduction=number gear_ratio=number \
    gearRatio=number child* saturationLower saturationUpper deadBandUpper deadBandLower ignoreTransmissionAbsoluteEncoder
actuator: name role ; hardwareInterface role mechanicalReduction=number mechanical_reduction=number gear_ratio=number \
    gearRatio=number rotorInertia=number rotor_inertia=number motorInertia=number motor_inertia=number motorTorqueConstant \
    api* node* drake:rotor_inertia=number drake:gear_ratio=number drake:controller_gains*
number: value
";

const FORCE: &str = "Drake applies its force, a model does not";
const COUPLED: &str = "it couples joints, which stay free";
const IGNORED: &str = "Drake leaves the element out; it is read";

const LEFT_OUT: &LeftOut = &[
    ("robot", "loop_joint", "the loop is left open"),
    ("robot", "force_element", FORCE),
    ("robot", "cable", FORCE),
    ("robot", "drake:linear_bushing_rpy", FORCE),
    ("robot", "drake:linear_spring_damper", FORCE),
    ("robot", "drake:distance_constraint", FORCE),
    ("robot", "drake:ball_constraint", "the points stay free"),
    ("robot", "drake:tendon_constraint", COUPLED),
    ("link", "drake_ignore", IGNORED),
    ("joint", "drake_ignore", IGNORED),
    ("contact", "inertia_scaling", "Bullet scales the inertia of the link; it is read as it stands"),
    ("transmission", "leftActuator", COUPLED),
    ("transmission", "gap_joint", COUPLED),
];

/// Adds warnings about unknown, misspelt and misplaced names in a robot, and about features that a model cannot
/// represent.
pub(super) fn check(robot: &Element, warnings: &mut Vec<Warning>) {
    static TABLE: OnceLock<Known> = OnceLock::new();
    TABLE.get_or_init(|| Known::new(KNOWN)).check(robot, LEFT_OUT, warnings);
    check_text(robot, warnings);
    for element in robot.children.iter().filter(|child| matches!(&*child.tag, "link" | "joint" | "drake:joint")) {
        check_repeated(element, element, warnings);
        element.all("inertial").for_each(|inertial| check_repeated(element, inertial, warnings));
    }
    for gazebo in robot.all("gazebo") {
        warnings.extend(gazebo.children.iter().filter_map(changed_by_gazebo));
    }
}

/// Adds warnings about text inside links and joints. In a URDF, all values are attributes, so text has no effect.
fn check_text(element: &Element, warnings: &mut Vec<Warning>) {
    let text = element.text.trim();
    if !text.is_empty() {
        let begin: String = text.chars().take(32).collect();
        warnings.push(element.unknown(format!("text `{begin}` has no effect: values are attributes")));
    }
    let parts = |tag: &str| match &*element.tag {
        "robot" => matches!(tag, "link" | "joint" | "drake:joint"),
        "link" => tag == "inertial",
        "inertial" => true,
        "joint" | "drake:joint" => !matches!(tag, "controller_gains" | "hardwareInterface"),
        _ => false,
    };
    for child in element.children.iter().filter(|child| parts(&child.tag)) {
        check_text(child, warnings);
    }
}

/// Returns a warning about an entry of `<gazebo>` that changes the robot in Gazebo. Other entries only affect contact,
/// appearance and numerics.
fn changed_by_gazebo(entry: &Element) -> Option<Warning> {
    let is_on = matches!(entry.text.trim(), "1" | "true" | "True" | "TRUE");
    let what = match &*entry.tag {
        "gravity" if !is_on => "Gazebo's link has no weight, the model's does",
        "turnGravityOff" if is_on => "Gazebo's link has no weight, the model's does",
        "static" | "kinematic" if is_on => "Gazebo does not move it, in the model it moves",
        "springStiffness" => "Gazebo has a spring at the joint, the model does not",
        "dampingFactor" => "Gazebo damps all motion of the link, the model does not",
        "joint" | "link" | "model" | "inertial" => "Gazebo adds it to the robot, the model does not have it",
        _ => return None,
    };
    Some(entry.left_out(what))
}
