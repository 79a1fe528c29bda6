//! Known elements and attributes of SDF 1.2 to 1.12, and features that a model cannot represent. Files of older
//! versions are converted before they are checked.

use crate::io::known::LeftOut;

/// Known elements and attributes, by parent; see [`Known`](crate::io::known::Known).
pub(super) const KNOWN: &str = "
sdf: version ; world model include actor** light*
world: name ; model include joint frame gravity magnetic_field* physics scene* light* gui** actor** plugin** state** model_state** \
  population** wind* atmosphere* spherical_coordinates* road* audio*
*: ; world model include link joint inertial mass inertia axis axis2 limit dynamics mimic drake:joint drake:mimic \
  drake:rotor_inertia drake:gear_ratio
physics: name default type update_rate ; dt gravity max_step_size real_time_factor real_time_update_rate update_rate max_contacts \
  magnetic_field* ode* bullet* simbody* dart*
model: name canonical_link placement_frame namespace ; static self_collide allow_auto_disable enable_wind pose link joint frame \
  model include plugin** gripper* model_state** drake:joint** drake:linear_bushing_rpy** drake:linear_spring_damper** \
  drake:ball_constraint** drake:distance_constraint** drake:tendon_constraint** drake:collision_filter_group**
include: merge ; uri pose name namespace static placement_frame plugin** model_state**
link: name ; gravity enable_wind self_collide kinematic must_be_base_link velocity_decay pose inertial collision** visual* sensor* \
  projector* audio_sink* audio_source* battery* light* particle_emitter* drake:visual* drake:deformable_properties** \
  drake:surface_velocity_axis*
velocity_decay: ; linear angular
pose: relative_to rotation_format degrees
inertial: auto ; mass density pose inertia fluid_added_mass* auto_inertia_params**
inertia: ; ixx ixy ixz iyy iyz izz
heavy_collision: name ; pose density geometry surface* laser_retro max_contacts auto_inertia_params** drake:proximity_properties*
geometry: ; box sphere ellipsoid cylinder cone capsule empty mesh* plane* heightmap* image* polyline* drake:capsule* \
  drake:ellipsoid*
box: ; size
sphere: ; radius
ellipsoid: ; radii
cylinder: ; radius length
cone: ; radius length
capsule: ; radius length
joint: name type ; parent child pose axis axis2=axis gearbox_ratio gearbox_reference_body thread_pitch screw_thread_pitch \
  physics=joint_physics sensor* drake:rotor_inertia drake:gear_ratio drake:mimic drake:controller_gains*
drake:mimic: joint multiplier offset
axis: ; xyz dynamics limit mimic initial_position
xyz: expressed_in
dynamics: ; damping friction spring_reference spring_stiffness
limit: ; lower upper effort velocity stiffness dissipation drake:acceleration
mimic: joint axis ; multiplier offset reference
joint_physics: ; simbody* ode=joint_ode provide_feedback
joint_ode: ; provide_feedback cfm_damping implicit_spring_damper fudge_factor cfm erp bounce max_force velocity \
  limit=joint_softness suspension=joint_softness
joint_softness: ; cfm erp
frame: name attached_to ; pose
";

/// Type of a collision from which the inertia of its link is computed.
pub(super) const HEAVY: &str = "heavy_collision";

/// Features of SDF that a model cannot represent, and the consequence of each omission.
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
