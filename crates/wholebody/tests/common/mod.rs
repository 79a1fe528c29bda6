//! A standing quadruped, a humanoid, and checks of commands. The checks do not use the controller's own formulas.
#![allow(dead_code, non_snake_case, unreachable_pub)] // each test file uses only some of the functions

use condyle_dynamics::{Act, Data, Force, Model, Se3, Vec3, forward_kinematics, integrate, rnea};
use condyle_wholebody::{
    Command, FrictionContact, Normal, References, Settings, Shape, Status, SurfaceForces, Task, WholeBodyController,
};
use num_dual::Dual2_64;
use rand::{RngExt, SeedableRng, rngs::StdRng};

pub const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];

/// Tolerance of equalities (N, m/s²). Contact forces are about 100 N, and the solver's relative tolerance is 1e-9.
pub const EQUALITY: f64 = 1e-6;

/// Returns a position of the quadruped with knees inwards and feet on the ground.
pub fn stance() -> Vec<f64> {
    let mut q = vec![0.0, 0.0, 0.7 * 0.7f64.cos(), 0.0, 0.0, 0.0, 1.0];
    q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);
    q
}

pub fn feet(friction: f64) -> Vec<FrictionContact> {
    FEET.iter().map(|foot| FrictionContact::point(foot, friction)).collect()
}

pub fn tasks() -> Vec<Task> {
    vec![Task::com(), Task::orientation("trunk"), Task::posture()]
}

pub fn controller(model: &Model, contacts: &[FrictionContact]) -> WholeBodyController {
    WholeBodyController::new(model, contacts, &tasks(), Settings::default()).unwrap()
}

/// Returns a position of the humanoid with bent knees, and with level soles under the hips.
pub fn squat(model: &Model) -> Vec<f64> {
    let mut q = condyle_dynamics::neutral(model);
    for side in ["left", "right"] {
        for (joint, angle) in [("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4)] {
            let name = format!("{side}_{joint}");
            let body = model.bodies().iter().find(|body| body.joint_name == name).unwrap();
            q[body.idx_q] = angle;
        }
    }
    q
}

/// Returns contacts of the humanoid's two soles, each 20 cm by 10 cm.
pub fn soles(friction: f64) -> Vec<FrictionContact> {
    ["left_sole", "right_sole"].map(|sole| FrictionContact::sole(sole, friction, [0.2, 0.1])).to_vec()
}

pub fn humanoid_tasks() -> Vec<Task> {
    vec![Task::com(), Task::orientation("pelvis"), Task::angular_momentum(), Task::posture()]
}

/// Returns a random position near the quadruped's stance, and a random velocity. `distance` and `speed` are their
/// maximum sizes.
pub fn state(model: &Model, seed: u64, distance: f64, speed: f64) -> (Vec<f64>, Vec<f64>) {
    near(model, &stance(), seed, distance, speed)
}

/// Returns a random position near `centre`, and a random velocity. `distance` and `speed` are their maximum sizes.
pub fn near(model: &Model, centre: &[f64], seed: u64, distance: f64, speed: f64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut draw = |scale: f64| (0..model.nv()).map(|_| scale * (2.0 * rng.random::<f64>() - 1.0)).collect::<Vec<_>>();
    let (offset, v) = (draw(distance), draw(speed));
    let mut q = vec![0.0; model.nq()];
    integrate(model, centre, &offset, &mut q);
    (q, v)
}

/// Returns the acceleration ẍ of each contact and of the centre of mass, along the path q(t) = q ⊕ (t v + ½ t² a).
pub fn accelerations(
    model: &Model,
    contacts: &[FrictionContact],
    q: &[f64],
    v: &[f64],
    a: &[f64],
) -> (Vec<Vec3<f64>>, Vec3<f64>) {
    let lifted: Vec<_> = q.iter().map(|&q| Dual2_64::from(q)).collect();
    let moved: Vec<_> = v.iter().zip(a).map(|(&v, &a)| Dual2_64::new(0.0, v, a)).collect();
    let mut path = lifted.clone();
    integrate(model, &lifted, &moved, &mut path);
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, &path);
    let second = |p: Vec3<Dual2_64>| Vec3::new(p.x.v2, p.y.v2, p.z.v2);
    let feet = contacts.iter().map(|c| second(placements.frame(model.frame(&c.frame).unwrap()).translation)).collect();
    let mut com = Vec3::zero();
    for (i, body) in model.bodies().iter().enumerate().skip(1) {
        let X: Se3<Dual2_64> = placements.body(i);
        let momentum = X.rotation * body.inertia.mass_com.lift() + X.translation.scale(body.inertia.mass.into());
        com += second(momentum).scale(1.0 / model.total_mass());
    }
    (feet, com)
}

/// Computes the efforts M q̈ + h − Jᵀ f by one pass of inverse dynamics. The contact forces f are the external forces
/// of this pass.
pub fn inverse_dynamics(
    model: &Model,
    contacts: &[FrictionContact],
    q: &[f64],
    v: &[f64],
    command: &Command,
) -> Vec<f64> {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let mut f_ext = vec![Force::zero(); model.bodies().len()];
    for (contact, &f) in contacts.iter().zip(&command.forces) {
        let frame = model.frame(&contact.frame).unwrap();
        let body = model.frames()[frame].body;
        let point = placements.frame(frame).translation;
        let about_origin = Force::new(f.linear, f.angular + point.cross(f.linear)); // moment about the world's origin
        f_ext[body] += placements.body(body).act_inv(about_origin);
    }
    rnea(model, &mut data, q, v, &command.a, &f_ext).to_vec()
}

/// Returns the margin of friction μ f_n − ‖f_t‖ of a contact on level ground, with the friction coefficient μ, the
/// normal force f_n and the tangential force f_t.
pub fn margin(contact: &FrictionContact, f: Force<f64>) -> f64 {
    contact.friction * f.linear.z - f.linear.x.hypot(f.linear.y)
}

pub fn norm(x: Vec3<f64>) -> f64 {
    x.norm_squared().sqrt()
}

pub fn max_abs(x: impl IntoIterator<Item = f64>) -> f64 {
    x.into_iter().fold(0.0, |m, x| m.max(x.abs()))
}

/// Checks dynamics, held contacts, momentum, cones and centre of pressure up to [`EQUALITY`]. Every command must pass,
/// if contacts are held without gains.
pub fn check(
    model: &Model,
    contacts: &[FrictionContact],
    q: &[f64],
    v: &[f64],
    references: &References,
    command: &Command,
) {
    assert_eq!(command.status, Status::Solved);
    let (feet, _) = accelerations(model, contacts, q, v, &command.a);
    for ((contact, a), target) in contacts.iter().zip(feet).zip(&references.contacts) {
        if target.activation > 0.0 {
            assert!(norm(a) < EQUALITY, "{} accelerates with {:.1e} m/s²", contact.frame, norm(a));
        }
    }
    check_forces(model, contacts, q, v, references, command);
}

/// Checks a command like [`check`], except the accelerations of the contacts.
pub fn check_forces(
    model: &Model,
    contacts: &[FrictionContact],
    q: &[f64],
    v: &[f64],
    references: &References,
    command: &Command,
) {
    assert_eq!(command.status, Status::Solved);
    let tau = inverse_dynamics(model, contacts, q, v, command);
    let residual = max_abs(tau.iter().zip(&command.tau).map(|(a, b)| a - b));
    assert!(residual < EQUALITY, "M q̈ + h − Jᵀ f − τ = {residual:.1e}");
    assert_eq!(command.tau[..6], [0.0; 6]);

    let (_, com) = accelerations(model, contacts, q, v, &command.a);
    assert!(norm(com - command.com_acceleration) < 1e-9 * (1.0 + norm(com)));

    let sum = command.forces.iter().fold(Vec3::zero(), |sum, &f| sum + f.linear);
    let needed = (com - *model.gravity()).scale(model.total_mass());
    assert!(norm(sum - needed) < EQUALITY, "Σ f − m (c̈ − g) = {:.1e}", norm(sum - needed));

    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    for ((contact, &f), target) in contacts.iter().zip(&command.forces).zip(&references.contacts) {
        if target.activation == 0.0 {
            assert_eq!(f, Force::zero());
            continue;
        }
        let R = placements.frame(model.frame(&contact.frame).unwrap()).rotation;
        let n = match contact.normal {
            Normal::World(n) => n,
            Normal::Frame(n) => R * n,
            other => panic!("a normal that these checks do not know: {other:?}"),
        };
        let n = n.scale(1.0 / norm(n));
        let f_n = f.linear.dot(n);
        let slip = norm(f.linear - n.scale(f_n)) - contact.friction * f_n;
        assert!(slip < EQUALITY, "{}: {f:?} leaves the cone by {slip:.1e}", contact.frame);
        if let Shape::Surface { corners, forces } = &contact.shape {
            if let (Some(yaw), SurfaceForces::Wrench) = (contact.yaw_friction, forces) {
                let sum = corners.iter().fold(Vec3::zero(), |sum, &corner| sum + corner);
                let middle = R * sum.scale(1.0 / corners.len() as f64);
                let moment = (f.angular - middle.cross(f.linear)).dot(n);
                assert!(moment.abs() < yaw * f_n + EQUALITY, "{}: it turns, {moment:.1e} N m", contact.frame);
            }
            // At each edge of the polygon, the moment about the edge must not tip the sole over the edge.
            let count = corners.len();
            for k in 0..count {
                let (a, b) = (R * corners[k], R * corners[(k + 1) % count]);
                if count > 2 {
                    let sign = (b - a).cross(R * corners[(k + 2) % count] - b).dot(n).signum();
                    let moment = f.angular - a.cross(f.linear);
                    let tip = sign * moment.dot((b - a).scale(1.0 / norm(b - a)));
                    assert!(tip > -EQUALITY, "{}: the centre of pressure is outside by {tip:.1e}", contact.frame);
                }
            }
        }
    }
}

pub fn orientation(model: &Model, q: &[f64], frame: &str) -> condyle_dynamics::Mat3<f64> {
    forward_kinematics(model, &mut Data::new(model), q).frame(model.frame(frame).unwrap()).rotation
}

pub fn position(model: &Model, q: &[f64], frame: &str) -> Vec3<f64> {
    forward_kinematics(model, &mut Data::new(model), q).frame(model.frame(frame).unwrap()).translation
}
