//! Tests of robots whose equations of motion are given in textbooks.

use crate::common;

use common::{normal, normal3, random_rotation, relative, rng};
use condyle_dynamics::{
    Data, Inertia, Joint, JointOptions, Mat3, Mimic, Model, ModelBuilder, Quaternion, Se3, Sym3, Vec3, WORLD, aba,
    crba, gravity, nonlinear_effects, rnea,
};
use core::f64::consts::PI;

/// Tolerance of a few hundred operations on numbers of about 10.
const ROUNDING: f64 = 1e-13;
const G: f64 = 9.81;
const Z: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };

/// Link of a planar arm: length, distance from the joint to the centre of mass, mass, and inertia about the centre of
/// mass.
#[derive(Clone, Copy)]
struct Link {
    l: f64,
    c: f64,
    m: f64,
    I: f64,
}

const LINKS: [Link; 3] = [
    Link { l: 0.9, c: 0.4, m: 2.0, I: 0.15 },
    Link { l: 0.7, c: 0.3, m: 1.3, I: 0.08 },
    Link { l: 0.5, c: 0.2, m: 0.6, I: 0.02 },
];

fn along_x(x: f64) -> Se3<f64> {
    Se3::new(Mat3::identity(), Vec3::new(x, 0.0, 0.0))
}

/// Creates a planar arm with hinges about z and gravity along −y. The rotation R turns the arm and gravity together.
fn planar_arm(links: &[Link], R: Mat3<f64>) -> Model {
    let mut builder = ModelBuilder::new("planar arm");
    builder.gravity(R * Vec3::new(0.0, -G, 0.0));
    let (mut parent, mut placement) = (WORLD, Se3::new(R, Vec3::new(0.3, -0.2, 0.1)));
    for (i, link) in links.iter().enumerate() {
        // The arm rotates only about z, so the other moments of inertia have no effect.
        let inertia = Inertia::from_com(link.m, Vec3::new(link.c, 0.0, 0.0), Sym3::diagonal(link.I));
        parent = builder.body(&format!("link{i}"), parent, Joint::Revolute { axis: Z }, placement, inertia);
        placement = along_x(link.l);
    }
    builder.build().unwrap()
}

/// Checks a planar arm with two links against the equations in Spong, Hutchinson, Vidyasagar, *Robot Modeling and
/// Control* (2006), section 7.3.2.
#[test]
fn two_links() {
    let [a, b, _] = LINKS;
    let rng = &mut rng(1);
    for _ in 0..100 {
        let model = planar_arm(&LINKS[..2], random_rotation(rng));
        let (q, v, qdd) = (normal(rng, 2), normal(rng, 2), normal(rng, 2));
        let (cos2, sin2) = (q[1].cos(), q[1].sin());
        let d11 = a.m * a.c * a.c + b.m * (a.l * a.l + b.c * b.c + 2.0 * a.l * b.c * cos2) + a.I + b.I;
        let d12 = b.m * (b.c * b.c + a.l * b.c * cos2) + b.I;
        let d22 = b.m * b.c * b.c + b.I;
        let h = -b.m * a.l * b.c * sin2;
        let phi1 = (a.m * a.c + b.m * a.l) * G * q[0].cos() + b.m * b.c * G * (q[0] + q[1]).cos();
        let phi2 = b.m * b.c * G * (q[0] + q[1]).cos();
        let c1 = 2.0 * h * v[0] * v[1] + h * v[1] * v[1];
        let c2 = -h * v[0] * v[0];
        let tau = [d11 * qdd[0] + d12 * qdd[1] + c1 + phi1, d12 * qdd[0] + d22 * qdd[1] + c2 + phi2];

        let mut data = Data::new(&model);
        assert!(relative(crba(&model, &mut data, &q).as_slice(), &[d11, d12, d12, d22]) < ROUNDING);
        assert!(relative(gravity(&model, &mut data, &q), &[phi1, phi2]) < ROUNDING);
        assert!(relative(nonlinear_effects(&model, &mut data, &q, &v), &[c1 + phi1, c2 + phi2]) < ROUNDING);
        assert!(relative(rnea(&model, &mut data, &q, &v, &qdd, &[]), &tau) < ROUNDING);
        assert!(relative(aba(&model, &mut data, &q, &v, &tau, &[]), &qdd) < 10.0 * ROUNDING);
    }
}

/// Checks a planar arm with three links against the kinetic energy T = ½ Σ A_ij cos(θ_i − θ_j) θ̇_i θ̇_j, with the
/// absolute angles θ_i = q_1 + … + q_i. A_ij is I_i δ_ij + Σ_k m_k r_ki r_kj, with the inertia I_i and the mass m_i of
/// link i. r_ki is the length of link i if link k is after link i. r_ii is the distance from the joint to the centre of
/// mass of link i, and all other r_ki are 0. A torque that turns link i also acts on all links before it.
#[test]
fn three_links() {
    let arm = |k: usize, i: usize| match k.cmp(&i) {
        core::cmp::Ordering::Less => 0.0, // link k is before link i
        core::cmp::Ordering::Equal => LINKS[i].c,
        core::cmp::Ordering::Greater => LINKS[i].l,
    };
    let A = |i: usize, j: usize| {
        let points: f64 = (0..3).map(|k| LINKS[k].m * arm(k, i) * arm(k, j)).sum();
        points + if i == j { LINKS[i].I } else { 0.0 }
    };
    let rng = &mut rng(2);
    for _ in 0..100 {
        let model = planar_arm(&LINKS, random_rotation(rng));
        let (q, v, qdd) = (normal(rng, 3), normal(rng, 3), normal(rng, 3));
        let sum = |x: &[f64]| [x[0], x[0] + x[1], x[0] + x[1] + x[2]];
        let (t, dt, ddt) = (sum(&q), sum(&v), sum(&qdd));
        let mut turning = [0.0; 3];
        for i in 0..3 {
            turning[i] = (0..3).map(|k| LINKS[k].m * arm(k, i)).sum::<f64>() * G * t[i].cos();
            for j in 0..3 {
                turning[i] += A(i, j) * ((t[i] - t[j]).cos() * ddt[j] + (t[i] - t[j]).sin() * dt[j] * dt[j]);
            }
        }
        let tau = [turning[0] + turning[1] + turning[2], turning[1] + turning[2], turning[2]];
        let mut M = [0.0; 9];
        for i in 0..3 {
            for j in 0..3 {
                for a in i..3 {
                    for b in j..3 {
                        M[i + 3 * j] += A(a, b) * (t[a] - t[b]).cos();
                    }
                }
            }
        }
        let mut data = Data::new(&model);
        assert!(relative(crba(&model, &mut data, &q).as_slice(), &M) < ROUNDING);
        assert!(relative(rnea(&model, &mut data, &q, &v, &qdd, &[]), &tau) < ROUNDING);
        assert!(relative(aba(&model, &mut data, &q, &v, &tau, &[]), &qdd) < 10.0 * ROUNDING);
    }
}

/// Checks a rod that hangs at θ = 0 on a horizontal hinge: (I + m c² + rotor) θ̈ = τ − m g c sin θ. m is the mass of
/// the rod, I the inertia about its centre of mass, and c the distance from the hinge to the centre of mass.
#[test]
fn pendulum() {
    let (m, c, I, rotor) = (1.7, 0.6, 0.09, 0.05);
    let inertia = Inertia::from_com(m, Vec3::new(0.0, 0.0, -c), Sym3::diagonal(I));
    let axis = Vec3::new(0.0, 3.0, 0.0); // an axis may have any length
    for joint in [Joint::Revolute { axis }, Joint::Continuous { axis }] {
        let mut builder = ModelBuilder::new("pendulum");
        let options = JointOptions { armature: rotor, ..JointOptions::default() };
        builder.body_with(("rod", "pivot"), WORLD, joint, Se3::identity(), inertia, options);
        let model = builder.build().unwrap();
        let mut data = Data::new(&model);
        for k in -20..=20 {
            let (theta, tau): (f64, f64) = (0.3 * f64::from(k), 0.7);
            let q = if model.nq() == 1 { vec![theta] } else { vec![theta.cos(), theta.sin()] };
            let expected = (tau - m * G * c * theta.sin()) / (I + m * c * c + rotor);
            let found = aba(&model, &mut data, &q, &[1.3], &[tau], &[])[0];
            assert!((found - expected).abs() < ROUNDING * 10.0, "{theta}: {found}, expected {expected}");
        }
    }
}

/// Checks the period of a pendulum released at 2 rad: 4 K(sin 1) / ω₀ = 2π / (ω₀ agm(1, cos 1)). K is the complete
/// elliptic integral, agm is the arithmetic-geometric mean, and ω₀ is the angular frequency of small oscillations.
#[test]
fn period_of_a_pendulum() {
    /// Number of steps. The error of the Runge–Kutta method is about (0.001)⁴ times a fifth derivative, with steps of
    /// about 0.001 s. The tolerance follows from this error.
    const STEPS: u32 = 2000;
    const INTEGRATION: f64 = 1e-10;
    let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -1.0), Sym3::zero());
    let mut builder = ModelBuilder::new("pendulum");
    builder.body("rod", WORLD, Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) }, Se3::identity(), rod);
    let model = builder.build().unwrap();
    let mut data = Data::new(&model);
    let (mut a, mut g) = (1.0, f64::cos(1.0));
    for _ in 0..8 {
        (a, g) = (0.5 * (a + g), f64::sqrt(a * g));
    }
    let dt = 2.0 * PI / (G.sqrt() * a) / f64::from(STEPS);
    let mut acceleration = |q: f64| aba(&model, &mut data, &[q], &[0.0], &[0.0], &[])[0];
    let (mut q, mut v) = (2.0, 0.0);
    for _ in 0..STEPS {
        let k1 = (v, acceleration(q));
        let k2 = (v + 0.5 * dt * k1.1, acceleration(q + 0.5 * dt * k1.0));
        let k3 = (v + 0.5 * dt * k2.1, acceleration(q + 0.5 * dt * k2.0));
        let k4 = (v + dt * k3.1, acceleration(q + dt * k3.0));
        q += dt / 6.0 * (k1.0 + 2.0 * k2.0 + 2.0 * k3.0 + k4.0);
        v += dt / 6.0 * (k1.1 + 2.0 * k2.1 + 2.0 * k3.1 + k4.1);
    }
    assert!((q - 2.0).abs() < INTEGRATION && v.abs() < INTEGRATION, "after a period: {q} {v}");
}

/// Checks a cart on rails that carries a pole, which is upright at θ = 0: (M + m) ẍ + m l (θ̈ cos θ − θ̇² sin θ) = F, l
/// θ̈ + ẍ cos θ = g sin θ. M and x are the mass and position of the cart, F is the force on it, m is the mass of the
/// pole, and l the distance from the hinge to this mass.
#[test]
fn cart_and_pole() {
    let (M, m, l) = (1.5, 0.4, 0.8);
    let mut builder = ModelBuilder::new("cart and pole");
    let cart = Inertia::from_com(M, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.5));
    let cart = builder.body("cart", WORLD, Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) }, Se3::identity(), cart);
    let pole = Inertia::from_com(m, Vec3::new(0.0, 0.0, l), Sym3::zero());
    builder.body("pole", cart, Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) }, Se3::identity(), pole);
    let model = builder.build().unwrap();
    let mut data = Data::new(&model);
    for k in -20..=20 {
        let (theta, omega, F) = (0.3 * f64::from(k), 0.1 * f64::from(k), 2.0);
        let (sin, cos) = f64::sin_cos(theta);
        let x = (F + m * l * omega * omega * sin - m * G * sin * cos) / (M + m * sin * sin);
        let found = aba(&model, &mut data, &[0.4, theta], &[0.3, omega], &[F, 0.0], &[]);
        assert!(relative(found, &[x, (G * sin - x * cos) / l]) < 10.0 * ROUNDING);
    }
}

/// Checks Euler's equations of a free body, J ω̇ = n − ω × J ω, with the inertia J about the centre of mass and the
/// torque n. The centre of mass must fall freely, however the body rotates.
#[test]
fn free_body() {
    let rng = &mut rng(3);
    let J = Sym3 { xx: 0.3, yy: 0.5, zz: 0.7, ..Sym3::zero() };
    let m = 2.5;
    for c in [Vec3::zero(), Vec3::new(0.2, -0.1, 0.3)] {
        let mut builder = ModelBuilder::new("free body");
        builder.body("body", WORLD, Joint::FreeFlyer, Se3::identity(), Inertia::from_com(m, c, J));
        let model = builder.build().unwrap();
        let mut data = Data::new(&model);
        for _ in 0..100 {
            let (v, w, n, p) = (normal3(rng), normal3(rng), normal3(rng), normal3(rng));
            let r = normal(rng, 4);
            let r = Quaternion::new(r[0], r[1], r[2], r[3]).normalize();
            let q = [p.x, p.y, p.z, r.vector.x, r.vector.y, r.vector.z, r.scalar];
            let twist: Vec<f64> = v.to_array().into_iter().chain(w.to_array()).collect();
            // The effort is a torque n about the centre of mass. Apart from the weight, no force acts.
            let tau = [0.0, 0.0, 0.0, n.x, n.y, n.z];
            let free = n - w.cross(J * w);
            let w_dot = Vec3::new(free.x / J.xx, free.y / J.yy, free.z / J.zz);
            // The acceleration of the origin is gravity minus the contribution of the rotation about the centre of
            // mass. Subtract ω × v to get the spatial acceleration.
            let fall = r.to_rotation().transpose_mul(Vec3::new(0.0, 0.0, -G));
            let v_dot = fall - w_dot.cross(c) - w.cross(w.cross(c)) - w.cross(v);
            let expected: Vec<f64> = v_dot.to_array().into_iter().chain(w_dot.to_array()).collect();
            let found = aba(&model, &mut data, &q, &twist, &tau, &[]);
            assert!(relative(found, &expected) < 10.0 * ROUNDING, "{found:?}, expected {expected:?}");
        }
    }
}

/// Checks a top that stands on its tip: Ī ω̇ = c × m g − ω × Ī ω, with the inertia Ī about the tip, the centre of mass
/// c and the weight m g.
#[test]
fn top() {
    let rng = &mut rng(4);
    let (m, h) = (0.5, 0.2);
    let inertia = Inertia::from_com(m, Vec3::new(0.0, 0.0, h), Sym3 { xx: 0.02, yy: 0.02, zz: 0.01, ..Sym3::zero() });
    let mut builder = ModelBuilder::new("top");
    builder.body("top", WORLD, Joint::Spherical, Se3::identity(), inertia);
    let model = builder.build().unwrap();
    let mut data = Data::new(&model);
    for _ in 0..100 {
        let r = normal(rng, 4);
        let r = Quaternion::new(r[0], r[1], r[2], r[3]).normalize();
        let w = normal3(rng).scale(5.0);
        let I = inertia.rotational;
        let pull = r.to_rotation().transpose_mul(Vec3::new(0.0, 0.0, -m * G));
        let n = Vec3::new(0.0, 0.0, h).cross(pull) - w.cross(I * w);
        let expected = [n.x / I.xx, n.y / I.yy, n.z / I.zz];
        let q = [r.vector.x, r.vector.y, r.vector.z, r.scalar];
        assert!(relative(aba(&model, &mut data, &q, &w.to_array(), &[0.0; 3], &[]), &expected) < 10.0 * ROUNDING);
    }
}

/// Checks a puck on ice, m (v̇ + ω × v) = f in body coordinates, and a point mass in the air, m ẍ = f + m g. m is the
/// mass, and f is the applied force.
#[test]
fn puck_and_point() {
    let rng = &mut rng(5);
    let (m, I) = (0.8, 0.3);
    let body = Inertia::from_com(m, Vec3::zero(), Sym3::diagonal(I));
    let of = |joint: Joint| {
        let mut builder = ModelBuilder::new("body");
        builder.body("body", WORLD, joint, Se3::identity(), body);
        builder.build().unwrap()
    };
    let (puck, point) = (of(Joint::Planar), of(Joint::Translation));
    for _ in 0..100 {
        let (v, f, angle) = (normal(rng, 3), normal(rng, 3), normal(rng, 1)[0]);
        let expected = [f[0] / m + v[2] * v[1], f[1] / m - v[2] * v[0], f[2] / I];
        let q = [0.3, -0.8, angle.cos(), angle.sin()];
        assert!(relative(aba(&puck, &mut Data::new(&puck), &q, &v, &f, &[]), &expected) < ROUNDING);
        let expected = [f[0] / m, f[1] / m, f[2] / m - G];
        assert!(relative(aba(&point, &mut Data::new(&point), &v, &v, &f, &[]), &expected) < ROUNDING);
    }
}

/// Checks a motor that drives a wheel, a second wheel with the gear ratio −3, and a rack on the first wheel:
/// (J₁ + 9 J₂ + r² m) θ̈ = τ. J₁ and J₂ are the inertias of the wheels, m is the mass of the rack, and r the radius of
/// the first wheel.
#[test]
fn gears() {
    let (J1, J2, m, r) = (0.2, 0.05, 1.5, 0.1);
    let wheel = |J: f64| Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(J));
    let mut builder = ModelBuilder::new("gears");
    let first = builder.body("first", WORLD, Joint::Revolute { axis: Z }, Se3::identity(), wheel(J1));
    let second = builder.body("second", WORLD, Joint::Revolute { axis: Z }, along_x(1.0), wheel(J2));
    let rack = Inertia::from_com(m, Vec3::zero(), Sym3::zero());
    let rack = builder.body("rack", WORLD, Joint::Prismatic { axis: Vec3::new(0.0, 1.0, 0.0) }, Se3::identity(), rack);
    builder.mimic(second, first, Mimic { ratio: -3.0, offset: 0.4 });
    builder.mimic(rack, first, Mimic { ratio: r, offset: -0.1 });
    let model = builder.build().unwrap();
    assert_eq!((model.nq(), model.nv()), (1, 1));
    let expected = 2.0 / (J1 + 9.0 * J2 + r * r * m);
    let found = aba(&model, &mut Data::new(&model), &[0.7], &[1.0], &[2.0], &[])[0];
    assert!((found - expected).abs() < ROUNDING * 10.0);
}
