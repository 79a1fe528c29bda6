//! Known elements and attributes of SDF 1.2 to 1.12, after the conversion of older versions, and those that a model
//! cannot represent.

use crate::io::known::LeftOut;

/// Known elements and attributes, by parent; see [`Known`](crate::io::known::Known).
pub(super) const KNOWN: &str = "
sdf: version ; world model include actor* light*
world: name ; model include joint frame gravity magnetic_field* physics* scene* light* gui* actor* plugin* state* model_state* \
  population* wind* atmosphere* spherical_coordinates* road* audio*
model: name canonical_link placement_frame namespace ; static self_collide allow_auto_disable enable_wind pose link joint frame \
  model include plugin* gripper* model_state*
include: merge ; uri pose name namespace static placement_frame plugin* model_state*
link: name ; gravity enable_wind self_collide kinematic must_be_base_link velocity_decay pose inertial collision* visual* sensor* \
  projector* audio_sink* audio_source* battery* light* particle_emitter*
velocity_decay: ; linear angular
pose: relative_to rotation_format degrees
inertial: auto ; mass density pose inertia fluid_added_mass* auto_inertia_params*
inertia: ; ixx ixy ixz iyy iyz izz
joint: name type ; parent child pose axis axis2=axis gearbox_ratio gearbox_reference_body thread_pitch screw_thread_pitch \
  physics=joint_physics sensor*
axis: ; xyz dynamics limit mimic initial_position
xyz: expressed_in
dynamics: ; damping friction spring_reference spring_stiffness
limit: ; lower upper effort velocity stiffness dissipation
mimic: joint axis ; multiplier offset reference
joint_physics: ; simbody* ode=joint_ode provide_feedback
joint_ode: ; provide_feedback cfm_damping implicit_spring_damper fudge_factor cfm erp bounce max_force velocity \
  limit=joint_softness suspension=joint_softness
joint_softness: ; cfm erp
frame: name attached_to ; pose
";

/// Features of SDF that a model cannot represent.
pub(super) const LEFT_OUT: &LeftOut = &[
    ("world", "population", "the models of a population are left out"),
    ("world", "state", "the positions of a saved state are left out: models stand where their <pose> puts them"),
    ("world", "model_state", STATE),
    ("model", "model_state", STATE),
    ("include", "model_state", STATE),
    ("include", "experimental:params", "parameters are not passed: the included model is read as it is"),
    ("inertial", "fluid_added_mass", "fluid_added_mass is left out: the link moves as in a vacuum"),
    ("axis", "initial_position", "initial_position is left out: a model has no position of its own"),
    ("joint_ode", "suspension", "the suspension is left out: the joint is rigid along it"),
    ("limit", "drake:acceleration", "the limit of acceleration is left out"),
    ("model", "drake:linear_bushing_rpy", FORCE),
    ("model", "drake:linear_spring_damper", FORCE),
    ("model", "drake:ball_constraint", FORCE),
    ("model", "drake:distance_constraint", FORCE),
    ("model", "drake:tendon_constraint", FORCE),
    ("link", "drake:deformable_properties", "the link is read as a rigid one"),
];

const STATE: &str = "model_state is left out: joints have no initial position";
const FORCE: &str = "a force or constraint of Drake's own is left out";
