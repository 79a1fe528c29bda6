//! Tests of a simulation's contacts with the ground: landing, standing, sliding, sticking, lift-off and energy. The
//! results are compared with closed forms.

use crate::common::{normal3, random_rotation, relative, rng};
use crate::counting::allocations;
use condyle_dynamics::simulation::{Control, Ground, GroundContact, Integrator, Settings, Simulation, Status};
use condyle_dynamics::{
    Act, Data, FrameParent, Inertia, Joint, Model, ModelBuilder, Quaternion, Se3, Sym3, Vec3, WORLD, crba,
    forward_kinematics, forward_velocities, gravity, lie, minv, neutral, robots,
};

const G: f64 = 9.81;
/// Time step of all tests (s).
const H: f64 = 1e-3;
/// Half of the box's length, width and height (m). The constant `MASS` is the mass of the box (kg).
const HALF: [f64; 3] = [0.15, 0.1, 0.05];
const MASS: f64 = 2.0;
/// Tolerance for rounding errors and for the errors of the contact solver (1e-9 m/s) over some thousand steps.
const SOLVED: f64 = 1e-7;

/// Creates a box that moves freely, with a frame at the centre of the box.
fn free_box() -> Model {
    let [x, y, z] = HALF.map(|half| 4.0 * half * half * MASS / 12.0);
    let moments = Sym3 { xx: y + z, yy: x + z, zz: x + y, ..Sym3::zero() };
    free("box", Inertia::from_com(MASS, Vec3::zero(), moments))
}

fn free(name: &str, inertia: Inertia<f64>) -> Model {
    let mut builder = ModelBuilder::new(name);
    let body = builder.body(name, WORLD, Joint::FreeFlyer, Se3::identity(), inertia);
    builder.frame(name, body, Se3::identity());
    builder.build().expect("it is well-formed")
}

/// Returns all corners of the box. The first four corners are at the bottom.
fn corners() -> Vec<Vec3<f64>> {
    let [x, y, z] = HALF;
    let around = [(x, y), (x, -y), (-x, -y), (-x, y)];
    [-z, z].into_iter().flat_map(|z| around.map(|(x, y)| Vec3::new(x, y, z))).collect()
}

fn on(model: &Model, ground: Ground, q: &[f64], v: &[f64]) -> Simulation<f64> {
    let mut simulation = Simulation::new(model, Settings { dt: H, ..Settings::default() });
    simulation.set_ground(ground).unwrap();
    simulation.set_state(q, v).unwrap();
    simulation
}

fn push(simulation: &Simulation<f64>) -> Vec3<f64> {
    simulation.contacts().iter().map(|contact| contact.force).sum()
}

fn energy(model: &Model, simulation: &Simulation<f64>) -> f64 {
    forward_velocities(model, &mut Data::new(model), simulation.q(), simulation.v()).mechanical_energy()
}

fn passive(_: &mut Control<'_, f64>) {}

/// Checks a sliding box with the friction μ and the initial speed v, along different directions. The box must
/// decelerate with exactly μ g. It must stop after a distance of v²/(2 μ g), minus half the distance of the first step.
#[test]
fn a_box_slides_to_a_stop() {
    let model = free_box();
    for (mu, angle) in [(0.1, 0.0), (0.4, 0.7), (0.8, -2.0)] {
        let ground = Ground { friction: mu, ..Ground::default() }.with_sole(0, &corners()[..4]);
        let (speed, along) = (1.0, Vec3::new(f64::cos(angle), f64::sin(angle), 0.0));
        let v = [speed * along.x, speed * along.y, 0.0, 0.0, 0.0, 0.0];
        let mut simulation = on(&model, ground, &[0.0, 0.0, HALF[2], 0.0, 0.0, 0.0, 1.0], &v);
        let steps = (speed / (mu * G * H)) as usize; // number of steps in which the box slides
        for k in 1..=steps {
            assert_eq!(simulation.run(1, passive), Status::Done);
            let found = Vec3::new(simulation.v()[0], simulation.v()[1], 0.0);
            let expected = along * (speed - k as f64 * mu * G * H);
            assert!((found - expected).norm() < SOLVED, "{found:?} {expected:?}");
            let (force, cone) = (push(&simulation), mu * MASS * G);
            assert!((force - Vec3::new(-cone * along.x, -cone * along.y, MASS * G)).norm() < 1e-4, "{force:?}");
        }
        assert!(simulation.run(500, passive).is_done());
        let way = simulation.q()[0].hypot(simulation.q()[1]);
        let expected = speed * speed / (2.0 * mu * G) - speed * H / 2.0; // sum of h v⁺ over the steps
        let rest = mu * G * H * H; // additional distance of the last step, which is shorter
        println!("μ = {mu}: stops after {way:.6} m, expected {expected:.6}");
        assert!((way - expected).abs() < rest, "{way} {expected}");
        assert!(simulation.v().iter().all(|v| v.abs() < SOLVED), "{:?}", simulation.v());
    }
}

/// Checks that the forces on a standing robot are the same in each step, and that their sum is the weight. The robot
/// must neither drift nor vibrate.
#[test]
fn standing_is_still() {
    let model = free_box();
    let (four, sixteen): (Vec<_>, Vec<_>) = (
        corners()[..4].to_vec(),
        (0..4)
            .flat_map(|k| corners()[..4].iter().map(move |&c| c * (1.0 - 0.1 * k as f64)).collect::<Vec<_>>())
            .collect(),
    );
    let sixteen: Vec<_> = sixteen.into_iter().map(|p| Vec3::new(p.x, p.y, -HALF[2])).collect(); // points in one plane
    for (sole, speed) in [(four, 0.0), (sixteen, 0.3)] {
        let points = sole.len();
        let ground = Ground::default().with_sole(0, &sole);
        let v = [speed, 0.0, 0.0, 0.0, 0.0, speed];
        let mut simulation = on(&model, ground, &[0.0, 0.0, HALF[2], 0.0, 0.0, 0.0, 1.0], &v);
        assert!(simulation.run(500, passive).is_done()); // until the box is at rest
        let (q, mut forces, mut shaken) = (simulation.q().to_vec(), simulation.contacts().to_vec(), 0);
        for _ in 0..5000 {
            assert!(simulation.run(1, passive).is_done());
            let change = |(a, b): (&GroundContact, &GroundContact)| (a.force - b.force).norm();
            let largest = simulation.contacts().iter().zip(&forces).map(change).fold(0.0, f64::max);
            shaken += usize::from(largest > 1e-6);
            forces = simulation.contacts().to_vec();
        }
        assert_eq!(shaken, 0, "forces change in some steps");
        let drift = relative(simulation.q(), &q);
        let sum = push(&simulation).z;
        println!("{points} points: drift {drift:.1e} m in 5 s, {sum} N of {}", MASS * G);
        assert!(drift < SOLVED && (sum - MASS * G).abs() < 1e-4);
        assert!(simulation.v().iter().all(|v| v.abs() < SOLVED));
    }
}

/// Checks a box on a slope of angle α, with the friction μ. Below the friction angle the box sticks. On a steeper slope
/// it slides with the acceleration g (sin α − μ cos α).
#[test]
fn sticks_or_slides_on_a_slope() {
    let model = free_box();
    let mu = 0.5; // atan 0.5 is 26.6°
    for (degrees, turn) in [(20.0f64, 0.0), (26.0, 1.0), (27.0, 0.0), (35.0, 2.5)] {
        let slope = degrees.to_radians();
        let normal = Vec3::new(slope.sin() * f64::cos(turn), slope.sin() * f64::sin(turn), slope.cos());
        let axis = Vec3::new(0.0, 0.0, 1.0).cross(normal);
        let R = lie::exp3(axis * (slope / axis.norm()));
        let place = normal * (HALF[2] + 0.3);
        let u = R.vector;
        let q = [place.x, place.y, place.z, u.x, u.y, u.z, R.scalar];
        let ground = Ground { normal: 3.0 * normal, height: 0.3, friction: mu, ..Ground::default() };
        let mut simulation = on(&model, ground.with_sole(0, &corners()[..4]), &q, &[0.0; 6]);
        let steps = 500;
        assert!(simulation.run(steps, passive).is_done());
        let speed = Vec3::new(simulation.v()[0], simulation.v()[1], simulation.v()[2]).norm();
        let a = (G * (slope.sin() - mu * slope.cos())).max(0.0);
        let expected = a * H * steps as f64;
        println!("{degrees}°: {speed} m/s, expected {expected}");
        assert!((speed - expected).abs() < SOLVED, "{speed} {expected}");
        let turned = Quaternion::new(simulation.q()[3], simulation.q()[4], simulation.q()[5], simulation.q()[6]);
        assert!((turned.to_rotation().z - normal).norm() < SOLVED); // the box lies flat
    }
}

/// Checks a point that falls from a height H, for a time of √(2 H/g). It must land without penetration, stay, and lift
/// off when pulled up by more than its weight.
#[test]
fn falls_lands_and_lifts_off() {
    let model = free("ball", Inertia::from_com(MASS, Vec3::zero(), Sym3::diagonal(0.01)));
    let height = 0.8;
    let mut simulation = on(&model, Ground::at_frames([0]), &[0.0, 0.0, height, 0.0, 0.0, 0.0, 1.0], &[0.0; 6]);
    let mut landed = None;
    for _ in 0..1000 {
        assert!(simulation.run(1, passive).is_done());
        assert!(simulation.q()[2] > -1e-9, "{}", simulation.q()[2]);
        if simulation.contacts()[0].touches {
            landed = landed.or(Some(simulation.time()));
        }
    }
    let expected = f64::sqrt(2.0 * height / G);
    assert!((landed.unwrap() - expected).abs() < 2.0 * H, "{landed:?} {expected}");
    assert!(simulation.q()[2].abs() < 1e-9 && simulation.v()[2].abs() < 1e-9);
    assert!((push(&simulation).z - MASS * G).abs() < 1e-6);
    for (pull, rises) in [(0.99, false), (1.5, true)] {
        let before = simulation.q()[2];
        assert!(simulation.run(200, |now| now.f_ext[1].linear.z = pull * MASS * G).is_done());
        let expected = if rises { (pull - 1.0) * G * 0.2 } else { 0.0 };
        assert!((simulation.v()[2] - expected).abs() < SOLVED && (simulation.q()[2] > before + 0.05) == rises);
        assert_eq!(simulation.contacts()[0].touches, !rises);
    }
}

/// Checks points whose motion is constrained by joints, on a vertical rail and on a pendulum. They must land and stand
/// like a free point.
#[test]
fn joints_may_hold_directions() {
    let z = Vec3::new(0.0, 0.0, 1.0);
    let weight = Inertia::from_com(MASS, Vec3::zero(), Sym3::diagonal(0.01));
    let mut builder = ModelBuilder::new("lift");
    let cage = builder.body("cage", WORLD, Joint::Prismatic { axis: z }, Se3::identity(), weight);
    builder.frame("floor", cage, Se3::identity());
    let lift = builder.build().unwrap();
    let mut simulation = on(&lift, Ground::at_frames([0]), &[0.3], &[0.0]);
    assert!(simulation.run(1000, passive).is_done());
    assert!(simulation.q()[0].abs() < 1e-7 && simulation.v()[0].abs() < 1e-9);
    assert!((push(&simulation) - z * (MASS * G)).norm() < 1e-6);

    let mut builder = ModelBuilder::new("pendulum");
    let hinge = Se3 { translation: z, ..Se3::identity() };
    let rod = builder.body("rod", WORLD, Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) }, hinge, weight);
    builder.frame("tip", rod, Se3 { translation: Vec3::new(2.0, 0.0, 0.0), ..Se3::identity() });
    let pendulum = builder.build().unwrap();
    let mut heavy = on(&pendulum, Ground { friction: 0.3, ..Ground::at_frames([0]) }, &[0.0], &[0.0]);
    assert!(heavy.run(500, |now| now.tau[0] = 3.0).is_done()); // the pendulum turns down until its tip touches at 30°
    assert!((heavy.q()[0] - f64::asin(0.5)).abs() < 1e-6 && heavy.v()[0].abs() < 1e-9);
    assert!(heavy.contacts()[0].touches);
    // On a rail along the ground, the point can only slide, and the ground exerts no force.
    let mut builder = ModelBuilder::new("cart");
    let cart =
        builder.body("cart", WORLD, Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) }, Se3::identity(), weight);
    builder.frame("wheel", cart, Se3::identity());
    let cart = builder.build().unwrap();
    let mut simulation = on(&cart, Ground::at_frames([0]), &[0.0], &[1.0]);
    assert!(simulation.run(100, passive).is_done());
    assert_eq!(simulation.v()[0], 1.0);
}

/// Checks that a ball with restitution e rebounds to e² times its initial height. Finally the ball must rest without
/// vibration.
#[test]
fn restitution_rebounds() {
    let model = free("ball", Inertia::from_com(MASS, Vec3::zero(), Sym3::diagonal(0.01)));
    for e in [0.0, 0.5, 0.8, 1.0] {
        let ground = Ground { restitution: e, ..Ground::at_frames([0]) };
        let mut simulation = on(&model, ground, &[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], &[0.0; 6]);
        let (mut highest, mut hit) = (0.0f64, false);
        for _ in 0..950 {
            assert!(simulation.run(1, passive).is_done());
            hit |= simulation.contacts()[0].touches;
            if hit {
                highest = highest.max(simulation.q()[2]);
            }
        }
        println!("e = {e}: rebounds to {highest:.4} m");
        assert!((highest - e * e).abs() < 1e-2, "{highest}");
        if e < 1.0 {
            assert!(simulation.run(8000, passive).is_done());
            assert!(simulation.v()[2].abs() < 1e-9 && simulation.q()[2].abs() < 1e-6, "{:?}", simulation.q());
        }
    }
}

/// Checks the energy of cubes that tumble over their eight corners. Contacts may only reduce the energy, and all cubes
/// with friction must come to rest.
#[test]
fn energy_never_grows() {
    // Without contacts, the rotational energy of a cube is constant. The energy of the linear velocity has a relative
    // error of h² ω² (step length h, angular velocity ω), because this velocity is expressed in the axes of the turning
    // cube.
    let model = free("cube", Inertia::from_com(MASS, Vec3::zero(), Sym3::diagonal(0.02)));
    let cube: Vec<_> =
        corners().into_iter().map(|c| Vec3::from([c.x / HALF[0], c.y / HALF[1], c.z / HALF[2]]) * 0.1).collect();
    for (seed, mu) in [0.0, 0.3, 0.9].into_iter().cycle().take(12).enumerate() {
        let mut random = rng(seed as u64);
        let R = Quaternion::from_rotation(random_rotation(&mut random));
        let (u, v, w) = (R.vector, normal3(&mut random), 3.0 * normal3(&mut random));
        let q = [0.0, 0.0, 0.4, u.x, u.y, u.z, R.scalar];
        let ground = Ground { friction: mu, ..Ground::default() }.with_sole(0, &cube);
        let mut simulation = on(&model, ground, &q, &[v.x, v.y, v.z, w.x, w.y, w.z]);
        let mut before = energy(&model, &simulation);
        for _ in 0..3000 {
            assert_eq!(simulation.run(1, passive), Status::Done, "cube {seed}");
            let (v, now) = (simulation.v(), energy(&model, &simulation));
            let spin = Vec3::new(v[3], v[4], v[5]).norm_squared();
            let turned = H * H * spin * MASS * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
            // A corner moves along a curve, so it may enter the plane. Pushing the corner out adds potential energy.
            let depth = H * H * (spin * 0.2 + G) * MASS * G;
            assert!(now <= before + turned + depth + 1e-9, "cube {seed}: {before} to {now} J");
            before = now;
            let lowest = cube.iter().map(|&c| placed(&model, simulation.q()).act(c).z).fold(f64::MAX, f64::min);
            assert!(lowest > -2e-4, "cube {seed} is {lowest} m deep");
        }
        if mu > 0.0 {
            assert!(simulation.v().iter().all(|v| v.abs() < 1e-6), "cube {seed}: {:?}", simulation.v());
        }
    }
}

fn placed(model: &Model, q: &[f64]) -> Se3<f64> {
    forward_kinematics(model, &mut Data::new(model), q).body(1)
}

/// Returns a controller that holds a posture and compensates the weight. The stiffness at each joint is the maximum
/// that an explicit integrator allows for the inertia at this joint. For a joint that carries a light limb, the inertia
/// is M_kk. With `heavy`, for joints with heavy bodies on both sides, the inertia is 1/(M⁻¹)_kk.
fn posture(model: &Model, q0: &[f64], heavy: bool) -> impl FnMut(&mut Control<'_, f64>) + use<> {
    let (mut data, q0) = (Data::new(model), q0.to_vec());
    let inertia: Vec<f64> = if heavy {
        minv(model, &mut data, &q0).diagonal().iter().map(|x| 1.0 / x).collect()
    } else {
        crba(model, &mut data, &q0).diagonal().iter().copied().collect()
    };
    let weight = gravity(model, &mut data, &q0).to_vec();
    move |now| {
        for k in 6..now.tau.len() {
            let error = now.q[k + 1] - q0[k + 1];
            now.tau[k] = weight[k] - inertia[k] * (4000.0 * error + 100.0 * now.v[k]);
        }
    }
}

fn quadruped() -> (Model, Vec<f64>, Ground) {
    let model = robots::quadruped();
    let mut q = neutral(&model);
    for (joint, angle) in [("HFE", 0.6), ("KFE", -1.2)] {
        for leg in ["LF", "RF", "LH", "RH"] {
            let sign = if leg.ends_with('F') { 1.0 } else { -1.0 };
            q[model.bodies()[model.joint(&format!("{leg}_{joint}")).unwrap()].idx_q] = sign * angle;
        }
    }
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(|name| model.frame(name).unwrap());
    let lowest = forward_kinematics(&model, &mut Data::new(&model), &q).frame(feet[0]).translation.z;
    q[2] -= lowest;
    (model, q, Ground::at_frames(feet))
}

/// Checks a quadruped that stands on four feet, and a humanoid with locked joints that stands on the eight corners of
/// its soles.
#[test]
fn robots_stand() {
    let (model, q, ground) = quadruped();
    let mut simulation = on(&model, ground, &q, &[0.0; 18]);
    let mut hold = posture(&model, &q, false);
    assert_eq!(simulation.run(3000, &mut hold), Status::Done);
    let (weight, there) = (model.total_mass() * G, simulation.q().to_vec());
    assert!((push(&simulation).z / weight - 1.0).abs() < 1e-6, "{:?}", push(&simulation));
    assert_eq!(simulation.run(1000, &mut hold), Status::Done);
    println!("quadruped: sinks {:.1e} m, drifts {:.1e} in 1 s", q[2] - there[2], relative(simulation.q(), &there));
    assert!(relative(simulation.q(), &there) < 1e-6 && (q[2] - there[2]).abs() < 0.02);
    assert!(simulation.contacts().iter().all(|contact| contact.touches));

    let humanoid = robots::humanoid();
    let joints: Vec<usize> = (2..humanoid.bodies().len()).collect();
    let statue = humanoid.lock(&joints, &neutral(&humanoid)).unwrap();
    let sole = [(0.1, 0.05), (0.1, -0.05), (-0.1, -0.05), (-0.1, 0.05)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let soles = ["left_sole", "right_sole"].map(|name| statue.frame(name).unwrap());
    let ground = soles.into_iter().fold(Ground::default(), |ground, frame| ground.with_sole(frame, &sole));
    let mut q = neutral(&statue);
    q[2] -= forward_kinematics(&statue, &mut Data::new(&statue), &q).frame(soles[0]).translation.z;
    let mut simulation = on(&statue, ground, &q, &[0.0; 6]);
    assert_eq!(simulation.run(2000, passive), Status::Done);
    assert!(relative(simulation.q(), &q) < 1e-6, "{:?} {q:?}", simulation.q());
    assert!((push(&simulation).z / (statue.total_mass() * G) - 1.0).abs() < 1e-6);

    // Now all joints of the humanoid can move, and a controller holds the posture.
    let mut q = neutral(&humanoid);
    let frames = soles.map(|frame| humanoid.frame(&statue.frames()[frame].name).unwrap());
    let ground = frames.into_iter().fold(Ground::default(), |ground, frame| ground.with_sole(frame, &sole));
    q[2] -= forward_kinematics(&humanoid, &mut Data::new(&humanoid), &q).frame(frames[0]).translation.z;
    let mut simulation = on(&humanoid, ground, &q, &vec![0.0; humanoid.nv()]);
    let mut hold = posture(&humanoid, &q, true);
    for _ in 0..1000 {
        assert_eq!(simulation.run(1, &mut hold), Status::Done);
    }
    let (z, lifted) = (simulation.q()[2], push(&simulation).z / (humanoid.total_mass() * G));
    println!("humanoid: sinks {:.1e} m, lifted {lifted}", q[2] - z);
    assert!((lifted - 1.0).abs() < 0.05 && (q[2] - z).abs() < 0.05);
}

/// Checks that points that start below the ground are pushed out slowly, without a velocity afterwards.
#[test]
fn depth_does_not_become_speed() {
    let model = free_box();
    let ground = Ground::default().with_sole(0, &corners());
    let mut simulation = on(&model, ground, &[0.0, 0.0, HALF[2] - 0.02, 0.0, 0.0, 0.0, 1.0], &[0.0; 6]);
    for _ in 0..300 {
        assert!(simulation.run(1, passive).is_done());
        assert!(simulation.v().iter().all(|v| v.abs() < SOLVED), "{:?}", simulation.v());
    }
    assert!((simulation.q()[2] - HALF[2]).abs() < 1e-6, "{}", simulation.q()[2]);
}

/// Checks that a simulation continues from a stored state with the same bits, including the contacts. A simulation that
/// is set to its initial state again must also repeat the same bits.
#[test]
fn contacts_are_part_of_the_state() {
    let (model, q, ground) = quadruped();
    let mut simulation = on(&model, ground.clone(), &q, &[0.1; 18]);
    let mut hold = posture(&model, &q, false);
    assert!(simulation.run(200, &mut hold).is_done());
    let state = simulation.state();
    assert_eq!(state.impulses.len(), 12);
    let mut restored = on(&model, ground, &q, &[0.0; 18]);
    restored.restore(&state).unwrap();
    assert!(simulation.run(100, &mut hold).is_done() && restored.run(100, &mut hold).is_done());
    assert_eq!(simulation.state(), restored.state());
    assert_eq!(simulation.contacts(), restored.contacts());
    let end = simulation.state();
    simulation.set_state(&q, &[0.1; 18]).unwrap();
    assert!(simulation.contacts().iter().all(|contact| !contact.touches));
    assert!(simulation.run(200, &mut hold).is_done());
    assert_eq!(simulation.state(), state);
    assert!(simulation.run(100, &mut hold).is_done());
    assert_eq!(simulation.state(), end);
}

/// Checks that steps do not allocate memory in the air, on landing and at rest.
#[test]
fn steps_do_not_allocate() {
    let (model, mut q, ground) = quadruped();
    q[2] += 0.02;
    let mut simulation = on(&model, ground, &q, &[0.0; 18]);
    let mut hold = posture(&model, &q, false);
    for _ in 0..200 {
        let count = allocations(|| assert!(simulation.run(1, &mut hold).is_done()));
        assert_eq!(count, 0);
    }
    assert!(simulation.contacts().iter().any(|contact| contact.touches));
}

/// Checks a contact solver without iterations. It must report the failure and the error. The impulses must still push,
/// and not pull, and lie within the friction cones.
#[test]
fn a_solver_that_is_stopped_says_so() {
    let model = free_box();
    let ground = Ground { max_iterations: 0, ..Ground::default() }.with_sole(0, &corners()[..4]);
    let mut simulation = on(&model, ground, &[0.0, 0.0, HALF[2], 0.0, 0.0, 0.0, 1.0], &[0.0; 6]);
    let status = simulation.run(1, passive);
    let Status::ContactsNotConverged { error } = status else { panic!("{status}") };
    assert!((error - G * H).abs() < 1e-12, "{error}");
    assert_eq!(simulation.time(), H); // the simulation took the step
    let run = simulation.run(4, passive);
    assert!((simulation.time() - 5.0 * H).abs() < 1e-12); // the run continues, and reports the largest error
    assert!(matches!(run, Status::ContactsNotConverged { error: largest } if largest > error), "{run}");
    assert_eq!(run.and(Status::Done), run);
    assert_eq!(run.and(Status::NotFinite), Status::NotFinite);
    let said = "contacts did not converge: an error of 9.8e-3 m/s is left; the step was taken";
    assert_eq!(status.to_string(), said);
}

#[test]
fn grounds_that_cannot_be() {
    let model = free_box().with_frame("post", FrameParent::Body(0), Se3::identity()).unwrap();
    let said = |ground: Ground, integrator: Integrator| {
        let mut simulation = Simulation::<f64>::new(&model, Settings { integrator, ..Settings::default() });
        simulation.set_ground(ground).unwrap_err().to_string()
    };
    let euler = Integrator::SemiImplicitEuler;
    let plain = || Ground::at_frames([0]);
    let expected = "ground: it acts with the integrator SemiImplicitEuler only, found RungeKutta4";
    assert_eq!(said(plain(), Integrator::RungeKutta4), expected);
    let expected = "ground: point 1: there is no frame 7: the model has 2";
    assert_eq!(said(Ground::at_frames([0, 7]), euler), expected);
    assert_eq!(said(Ground::at_frames([1]), euler), "ground: point 0: frame `post` is fixed to the world");
    let zero = Ground { normal: Vec3::zero(), ..plain() };
    assert_eq!(said(zero, euler), "ground: normal (0, 0, 0) is no direction");
    let negative = Ground { friction: -0.1, ..plain() };
    assert_eq!(said(negative, euler), "ground: friction is -0.1, expected a finite number of at least 0");
    let bouncy = Ground { restitution: 1.5, ..plain() };
    assert_eq!(said(bouncy, euler), "ground: restitution is 1.5, expected a finite number from 0 to 1");
    let endless = Ground { friction: f64::INFINITY, ..plain() };
    assert_eq!(said(endless, euler), "ground: friction is inf, expected a finite number of at least 0");
    let far = Ground::default().with_sole(0, &[Vec3::new(0.0, f64::NAN, 0.0)]);
    assert_eq!(said(far, euler), "ground: point 0: position (0, NaN, 0) in frame `box` is not finite");
    let mut simulation = Simulation::<f64>::new(&model, Settings::default());
    simulation.set_ground(plain()).unwrap();
    simulation.settings.integrator = Integrator::Variational;
    let step = std::panic::catch_unwind(move || simulation.step(&[0.0; 6], &[])).unwrap_err();
    let said = step.downcast::<String>().unwrap();
    assert_eq!(*said, "settings.integrator: the ground acts with SemiImplicitEuler only, found Variational");
}
