//! Poses and motions of bodies and frames: one Python function for each function of the library.

use crate::arrays::Computed;
use crate::functions::{any, functions};
use pyo3::prelude::*;

/// Declares functions of a frame or of a body. Each function makes a pass over the bodies and calls the method with the
/// function's name on the result. The method returns a motion, or fills matrices of shape (6, nv), which the function
/// returns.
macro_rules! motions {
    (@call $model:ident, $motion:expr, $name:ident($of:ident, $reference:ident)) => { $motion.$name($of, $reference) };
    (@call $model:ident, $motion:expr, $name:ident($of:ident, $reference:ident) $($matrix:ident)+) => {{
        $(let mut $matrix = nalgebra::DMatrix::from_element(6, $model.nv(), condyle::Scalar::zero());)+
        $motion.$name($of, $reference, $(&mut $matrix),+);
        ($($matrix),+)
    }};
    ($(
        $(#[$doc:meta])*
        fn $name:ident($of:ident: $Of:ident) after $pass:ident($($arg:ident: $kind:ident),*)
            $(fills ($($matrix:ident),+))? -> $Kind:ident;
    )*) => {
        $crate::functions::functions! {$(
            $(#[$doc])*
            fn $name(model, data; $($arg: $kind,)* $of: $Of, reference: Reference = "local"; out) {
                let motion = condyle::dynamics::$pass(model, data, $(&$arg),*);
                $crate::kinematics::motions!(@call model, motion, $name($of, reference) $($($matrix)+)?)
            }
            batch b: any($($arg: $kind),*; $of: $Of, reference: Reference) -> $Kind {
                b.$name(model, $($arg,)* $of, reference)
            }
        )*}
    };
}
pub(crate) use motions;

functions! {
/// Computes the pose of each body in the world as a homogeneous matrix: (nbodies, 4, 4); O(n).
///
/// q: position, nq numbers. Joint i carries body i; the frame of a body is the frame of its link in the URDF. Body 0 is
/// the world. The pose of a frame f is the pose of its body times the placement of the frame: `poses[f.body] @
/// f.placement`. See also `frame_placement`.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data = condyle.Data(quadruped)
/// >>> condyle.forward_kinematics(quadruped, data, condyle.neutral(quadruped)).shape
/// (14, 4, 4)
fn forward_kinematics(model, data; q: Position; out) {
    let placements = condyle::forward_kinematics(model, data, &q);
    (0..model.bodies().len()).map(|body| placements.body(body)).collect::<Vec<_>>()
}
batch b: any(q: Position) -> One { b.forward_kinematics(model, q) }

/// Computes the pose oXf of a frame in the world: a homogeneous matrix (4, 4) that maps coordinates in the frame to
/// coordinates in the world; O(n).
///
/// q: position, nq numbers; frame: the frame's name or index.
///
/// >>> arm = condyle.robots.arm7()
/// >>> tool = condyle.frame_placement(arm, condyle.Data(arm), [0.0] * 7, "tool")
/// >>> bool(tool[2, 3] > 0.5)  # stretched upwards
/// True
fn frame_placement(model, data; q: Position, frame: FrameOf; out) {
    condyle::forward_kinematics(model, data, &q).frame(frame)
}
batch b: any(q: Position; frame: FrameOf) -> One { b.frame_placement(model, q, frame) }
}

functions! {
/// Computes the Jacobian J of a frame, (6, nv), linear rows first: the velocity of the frame is J v.
///
/// q: position, nq numbers; frame: the frame's name or index. reference: 'local', the velocity of the frame's origin,
/// along the frame's axes; 'world', the velocity of the body's point at the world's origin, along the world's axes; or
/// 'local_world_aligned', the velocity of the frame's origin, along the world's axes.
///
/// >>> arm = condyle.robots.arm7()
/// >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.0] * 7, "tool", "local_world_aligned").shape
/// (6, 7)
fn frame_jacobian(model, data; q: Position, frame: FrameOf, reference: Reference = "local"; out) {
    let _ = data; // only the joints between the frame and the world are needed
    Computed::new([6, model.nv()], |J| {
        condyle::dynamics::frame_jacobian_strided(model, &q, frame, reference, J, [model.nv(), 1]);
    })
}
batch b: any(q: Position; frame: FrameOf, reference: Reference) -> One {
    b.frame_jacobian(model, q, frame, reference)
}

/// Computes the Jacobian J of a body, (6, nv), linear rows first: the velocity of the body is J v.
///
/// q: position, nq numbers; body: the index of the body, or the name of its joint; index 0 is the world; reference: as
/// for `frame_jacobian`, for the body's own frame.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q = condyle.Data(arm), [0.3] * 7
/// >>> J = condyle.frame_jacobian(arm, data, q, "link7")
/// >>> np.array_equal(condyle.body_jacobian(arm, data, q, "joint7"), J)
/// True
fn body_jacobian(model, data; q: Position, body: BodyOf, reference: Reference = "local"; out) {
    let _ = data;
    Computed::new([6, model.nv()], |J| {
        condyle::dynamics::body_jacobian_strided(model, &q, body, reference, J, [model.nv(), 1]);
    })
}
batch b: any(q: Position; body: BodyOf, reference: Reference) -> One {
    b.body_jacobian(model, q, body, reference)
}
}

functions! {
/// Computes the Jacobian J of a point of a frame, (3, nv): the point's velocity along the axes of the world is J v
/// (m/s).
///
/// q: position, nq numbers; frame: the frame's name or index; point: position in the frame, 3 numbers (m). J = S_v +
/// S_ω × p, where p is the point in the world's frame and S has a column (S_v, S_ω) for each joint between the world
/// and the frame.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, tip = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.0, 0.02, 0.1]
/// >>> J = condyle.frame_point_jacobian(arm, data, q, "tool", tip)
/// >>> np.allclose(J @ v, condyle.frame_point_velocity(arm, data, q, v, "tool", tip))
/// True
fn frame_point_jacobian(model, data; q: Position, frame: FrameOf, point: Point; out) {
    let mut J = nalgebra::DMatrix::from_element(3, model.nv(), condyle::Scalar::zero());
    condyle::forward_kinematics(model, data, &q).frame_point_jacobian(frame, point.lift(), &mut J);
    J
}

/// Computes the Jacobian J of a point of a body, (3, nv): `frame_point_jacobian` of the body's own frame.
///
/// q: position, nq numbers; body: as for `body_jacobian`; point: position in the frame of the body, 3 numbers (m).
fn body_point_jacobian(model, data; q: Position, body: BodyOf, point: Point; out) {
    let mut J = nalgebra::DMatrix::from_element(3, model.nv(), condyle::Scalar::zero());
    condyle::forward_kinematics(model, data, &q).body_point_jacobian(body, point.lift(), &mut J);
    J
}

/// Computes the velocity of a point of a frame along the axes of the world, 3 numbers (m/s).
///
/// q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; point: position in the frame, 3
/// numbers (m).
fn frame_point_velocity(model, data; q: Position, v: Tangent, frame: FrameOf, point: Point; out) {
    condyle::forward_velocities(model, data, &q, &v).frame_point_velocity(frame, point.lift()).to_array()
}

/// Computes the velocity of a point of a body along the axes of the world, 3 numbers (m/s): `frame_point_velocity` of
/// the body's own frame.
///
/// q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; point: position in the frame of the
/// body, 3 numbers (m).
fn body_point_velocity(model, data; q: Position, v: Tangent, body: BodyOf, point: Point; out) {
    condyle::forward_velocities(model, data, &q, &v).body_point_velocity(body, point.lift()).to_array()
}
}

motions! {
/// Computes the velocity of a frame, 6 numbers: the velocity of the body's point at the origin of the reference (m/s),
/// then the angular velocity (rad/s); O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
/// `frame_jacobian`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.5] * 7
/// >>> J = condyle.frame_jacobian(arm, data, q, "tool")
/// >>> np.allclose(condyle.frame_velocity(arm, data, q, v, "tool"), J @ v)
/// True
fn frame_velocity(frame: FrameOf) after forward_velocities(q: Position, v: Tangent) -> One;

/// Computes the spatial acceleration of a frame, 6 numbers (m/s², then rad/s²); O(n). The spatial acceleration is the
/// rate of the frame's spatial velocity as seen from the world, expressed in the reference. Gravity is not subtracted.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
/// reference: as for `frame_jacobian`.
fn frame_acceleration(frame: FrameOf) after forward_accelerations(q: Position, v: Tangent, a: Tangent) -> One;

/// Computes the classical acceleration of a frame, 6 numbers; O(n). The linear part v̇ + ω × v (m/s²) belongs to the
/// body's point at the origin of the reference; the angular acceleration follows (rad/s²). In 'local_world_aligned' the
/// linear part is p̈ of the frame's origin p.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
/// reference: as for `frame_jacobian`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.2] * 7
/// >>> J = condyle.frame_jacobian(arm, data, q, "tool", "local_world_aligned")
/// >>> dJ = condyle.frame_jacobian_rate(arm, data, q, v, "tool", "local_world_aligned")
/// >>> acceleration = condyle.frame_classical_acceleration(arm, data, q, v, a, "tool", "local_world_aligned")
/// >>> np.allclose(acceleration, J @ a + dJ @ v)
/// True
fn frame_classical_acceleration(frame: FrameOf) after forward_accelerations(q: Position, v: Tangent, a: Tangent) -> One;

/// Computes the rate dJ/dt of a frame's Jacobian along v, (6, nv), linear rows first.
///
/// q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
/// `frame_jacobian`. dJ v + J a is the spatial acceleration for 'local' and 'world'. For 'local_world_aligned', whose
/// origin moves with the frame, this sum is the classical acceleration.
fn frame_jacobian_rate(frame: FrameOf) after forward_velocities(q: Position, v: Tangent) fills (dJ) -> One;

/// Computes the velocity of a body, 6 numbers (m/s, then rad/s): `frame_velocity` of the body's own frame; O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
fn body_velocity(body: BodyOf) after forward_velocities(q: Position, v: Tangent) -> One;

/// Computes the spatial acceleration of a body, 6 numbers (m/s², then rad/s²): `frame_acceleration` of the body's own
/// frame; O(n).
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
/// as for `frame_jacobian`.
fn body_acceleration(body: BodyOf) after forward_accelerations(q: Position, v: Tangent, a: Tangent) -> One;

/// Computes the classical acceleration of a body, 6 numbers (m/s², then rad/s²): `frame_classical_acceleration` of the
/// body's own frame; O(n).
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
/// as for `frame_jacobian`.
fn body_classical_acceleration(body: BodyOf) after forward_accelerations(q: Position, v: Tangent, a: Tangent) -> One;

/// Computes the rate dJ/dt of a body's Jacobian along v, (6, nv): `frame_jacobian_rate` of the body's own frame.
///
/// q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
fn body_jacobian_rate(body: BodyOf) after forward_velocities(q: Position, v: Tangent) fills (dJ) -> One;
}
