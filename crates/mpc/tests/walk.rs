//! Tests of the controller of walking robots, in simulations on the ground.

#[path = "../../../tests/common/counting.rs"]
mod counting;

use condyle_dynamics::simulation::{Ground, GroundPoint, Settings as SimulationSettings, Simulation};
use condyle_dynamics::{Data, Model, Vec3, forward_kinematics, robots};
use condyle_mpc::{Command, EffortSource, Error, Foot, Gait, Pattern, Settings, TickStatus, WholeBodyMpc};
use counting::allocated;
use std::sync::Arc;

const FEET: [&str; 4] = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
/// Time step of simulations (s), and steps between two ticks.
const STEP: f64 = 1e-3;
const PERIOD: usize = 20;

fn stand() -> Vec<f64> {
    let legs = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4];
    [&[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0], &legs[..], &legs, &[0.0; 18]].concat()
}

fn feet() -> [Foot; 4] {
    FEET.map(|name| Foot::point(name, 0.6, 0.0))
}

fn trot() -> Gait {
    Gait::in_turn(Pattern::Trot, 0.24, 0.04)
}

fn controller(gait: Gait, settings: Settings) -> WholeBodyMpc {
    WholeBodyMpc::new(Arc::new(robots::quadruped()), &feet(), gait, settings).unwrap()
}

/// Simulates the quadruped under a controller for some seconds, with `period` steps between two ticks. Calls `before`
/// before each tick with the time and the controller. Returns the states, one for each time step.
fn simulate(
    mpc: &mut WholeBodyMpc,
    seconds: f64,
    period: usize,
    mut before: impl FnMut(f64, &mut WholeBodyMpc, &mut Vec<f64>),
) -> Vec<Vec<f64>> {
    let model: Arc<Model> = mpc.model().clone();
    let mut simulation = Simulation::new(model.clone(), SimulationSettings { dt: STEP, ..Default::default() });
    let frames = FEET.map(|name| model.frame(name).unwrap());
    simulation.set_ground(Ground { friction: 0.7, ..Ground::at_frames(frames) }).unwrap();
    let x = stand();
    simulation.set_state(&x[..19], &x[19..]).unwrap();
    mpc.reset(0.0, &x).unwrap();
    let (mut policy, mut tau, mut states) = (mpc.policy(), vec![0.0; 18], Vec::new());
    for step in 0..(seconds / STEP).round() as usize {
        let t = step as f64 * STEP;
        let mut x = [simulation.q(), simulation.v()].concat();
        if step % period == 0 && step > 0 {
            before(t, mpc, &mut x);
            mpc.update(t, &x).unwrap();
        }
        policy.control(t, &x, &mut tau[6..]);
        for (k, limit) in model.limits().effort().iter().enumerate().skip(6) {
            assert!(tau[k].abs() <= *limit, "effort {k} is {} at {t} s", tau[k]);
        }
        states.push([simulation.q(), simulation.v()].concat());
        assert!(simulation.step(&tau, &[]).is_taken());
    }
    states
}

/// Returns the mean of an entry of the state since a time step.
fn mean(states: &[Vec<f64>], entry: usize, since: usize) -> f64 {
    states[since..].iter().map(|x| x[entry]).sum::<f64>() / (states.len() - since) as f64
}

#[test]
fn the_quadruped_follows_its_command_at_each_rate() {
    for period in [5, 8, 20] {
        let mut mpc = controller(trot(), Settings::default());
        let states = simulate(&mut mpc, 2.5, period, |t, mpc, _| {
            let vx = if t < 0.2 { 0.0 } else { 0.4 };
            mpc.command(Command { vx, ..Command::default() }).unwrap();
        });
        let speed = mean(&states, 19, 1500);
        assert!((speed - 0.4).abs() < 0.012, "{period} ms: {speed} m/s");
        assert!(states.iter().all(|x| x[2] > 0.5 && x[3].abs() < 0.1 && x[4].abs() < 0.1));
    }
}

/// Checks that ticks in two parts, before and after the state, walk as well as whole ticks.
#[test]
fn a_prepared_controller_walks() {
    let mut mpc = controller(trot(), Settings::default());
    let states = simulate(&mut mpc, 2.5, PERIOD, |t, mpc, _| {
        mpc.command(Command { vx: 0.4, ..Command::default() }).unwrap();
        mpc.prepare((t > 1.0).then_some(t)).unwrap(); // the controller knows the period
    });
    let speed = mean(&states, 19, 1500);
    assert!((speed - 0.4).abs() < 0.012, "{speed} m/s");
    assert!(states.iter().all(|x| x[2] > 0.5 && x[3].abs() < 0.1 && x[4].abs() < 0.1));
}

#[test]
fn it_turns_and_walks_sideways() {
    let mut mpc = controller(trot(), Settings::default());
    let states = simulate(&mut mpc, 3.0, PERIOD, |_, mpc, _| {
        mpc.command(Command { vx: 0.0, vy: 0.2, wz: 0.8 }).unwrap();
    });
    assert!((mean(&states, 20, 1800) - 0.2).abs() < 0.02, "{}", mean(&states, 20, 1800));
    assert!((mean(&states, 24, 1800) - 0.8).abs() < 0.03, "{}", mean(&states, 24, 1800));
}

/// Checks that feet which are down stay down after the command to stop, until the robot has stopped.
#[test]
fn a_stop_lifts_no_foot() {
    let mut mpc = controller(trot(), Settings::default());
    let (mut down, mut lifted) = ([true; 4], 0);
    simulate(&mut mpc, 2.0, PERIOD, |t, mpc, _| {
        if (t - 1.0).abs() < 1e-6 {
            mpc.set_gait(Gait::Stand).unwrap();
        }
        let stands = &mpc.report().stands;
        if t > 1.03 {
            lifted += (0..4).filter(|&foot| down[foot] && !stands[foot]).count();
        }
        down.copy_from_slice(stands);
    });
    assert_eq!((lifted, down), (0, [true; 4]));
    // and it starts again, with another gait
    mpc.set_gait(Gait::in_turn(Pattern::Walk, 0.24, 0.04)).unwrap();
    let x = mpc.solver().solution().x(0).to_vec();
    let mut fewest = 4;
    for k in 0..60 {
        let report = mpc.update(2.0 + 0.02 * f64::from(k), &x).unwrap();
        fewest = fewest.min(report.stands.iter().filter(|stands| **stands).count());
    }
    assert_eq!(fewest, 3);
}

/// Ground of another height below a foot that swings: the point of the foot that touches the ground moves.
fn stone(simulation: &Simulation, foot: usize, height: f64) -> GroundPoint {
    let (model, frame) = (simulation.model(), simulation.ground().unwrap().points[foot].frame);
    let mut data = Data::new(&**model);
    let pose = forward_kinematics(model, &mut data, simulation.q()).frame(frame);
    GroundPoint { frame, position: pose.rotation.transpose() * Vec3::new(0.0, 0.0, -height) }
}

/// Result of a walk over ground of another height.
#[derive(Debug)]
struct Uneven {
    /// Lowest height of the trunk above the mean of the feet (m), and its largest tilt (rad).
    lowest: f64,
    tilt: f64,
    /// Largest vertical force on a foot (N).
    force: f64,
    /// Steps (1 ms) in which a foot touched the ground, but the controller let it swing, and in which a foot did not
    /// touch, but the controller let it stand.
    unseen: usize,
    missed: usize,
}

/// Simulates a trot. While a foot swings, the ground below it changes by a height, once. `reports` tells whether the
/// controller gets to know which feet touch.
fn uneven(height: f64, reports: bool) -> Uneven {
    let mut mpc = controller(trot(), Settings::default());
    let model = mpc.model().clone();
    let mut simulation = Simulation::new(model.clone(), SimulationSettings { dt: STEP, ..Default::default() });
    let ground = Ground { friction: 0.7, ..Ground::at_frames(FEET.map(|name| model.frame(name).unwrap())) };
    simulation.set_ground(ground).unwrap();
    let x = stand();
    simulation.set_state(&x[..19], &x[19..]).unwrap();
    mpc.reset(0.0, &x).unwrap();
    mpc.command(Command { vx: 0.3, ..Command::default() }).unwrap();
    let (mut policy, mut tau, mut swings) = (mpc.policy(), vec![0.0; 18], [0.0; 4]);
    let mut changed = [false; 4];
    let mut result = Uneven { lowest: f64::INFINITY, tilt: 0.0, force: 0.0, unseen: 0, missed: 0 };
    for step in 0..2500 {
        let t = f64::from(step) * STEP;
        let x = [simulation.q(), simulation.v()].concat();
        let touches: Vec<_> = simulation.contacts().iter().map(|contact| contact.touches).collect();
        if step % 10 == 0 && step > 0 {
            if reports {
                mpc.touch(&touches).unwrap();
            }
            mpc.update(t, &x).unwrap();
        }
        let stands = mpc.report().stands.clone();
        for foot in 0..4 {
            swings[foot] = if stands[foot] { 0.0 } else { swings[foot] + STEP };
            if t > 1.0 && swings[foot] > 0.09 && !changed[foot] {
                changed[foot] = true;
                let mut ground = simulation.ground().unwrap().clone();
                ground.points[foot] = stone(&simulation, foot, height);
                simulation.set_ground(ground).unwrap();
            }
            if t > 1.0 && step > 0 {
                let late = swings[foot] > 0.13;
                result.unseen += usize::from(touches[foot] && late);
                result.missed += usize::from(!touches[foot] && stands[foot]);
                result.force = result.force.max(simulation.contacts()[foot].force.z);
            }
        }
        if t > 1.0 {
            result.lowest = result.lowest.min(x[2]);
            result.tilt = result.tilt.max(x[3].hypot(x[4]) * 2.0);
        }
        policy.control(t, &x, &mut tau[6..]);
        assert!(simulation.step(&tau, &[]).is_taken());
    }
    assert!(changed.iter().all(|changed| *changed));
    result
}

#[test]
fn a_foot_that_lands_early_or_late_is_seen() {
    for height in [0.02, 0.0, -0.02] {
        let [blind, seeing] = [false, true].map(|reports| uneven(height, reports));
        assert!(blind.tilt < 0.02 && seeing.tilt < 0.02, "{height} m: {blind:?}, {seeing:?}");
        let expected = 0.5354 + height.min(0.0);
        assert!(seeing.lowest > expected - 5e-3, "{height} m: {seeing:?}");
        // fewer feet stand in the air, and landings are softer
        assert!(2 * seeing.missed <= blind.missed, "{height} m: {blind:?}, {seeing:?}");
        assert!(seeing.force < blind.force, "{height} m: {blind:?}, {seeing:?}");
        if height > 0.0 {
            assert!(seeing.unseen < blind.unseen, "{height} m: {blind:?}, {seeing:?}");
        }
    }
}

/// Checks that a controller without reports has the bits of one whose reports always agree with the schedule, and that
/// a report of a wrong length is refused.
#[test]
fn reports_that_agree_with_the_schedule_change_nothing() {
    let walked = |reports: bool| {
        let mut mpc = controller(trot(), Settings::default());
        if reports {
            mpc.touch(&[true; 4]).unwrap();
        }
        let mut plans = Vec::new();
        let states = simulate(&mut mpc, 1.2, PERIOD, |t, mpc, _| {
            mpc.command(Command { vx: 0.3, ..Command::default() }).unwrap();
            if reports {
                let down = (t - 0.22 + 1e-9).rem_euclid(0.28); // since the last lift-off
                let pair = ((t - 0.22 + 1e-9) / 0.28).floor().rem_euclid(2.0) == 0.0;
                let in_air = |foot: usize| t > 0.219 && down < 0.24 && (foot == 0 || foot == 3) == pair;
                mpc.touch(&[0, 1, 2, 3].map(|foot| !in_air(foot))).unwrap();
            }
            plans.push(mpc.solver().solution().us.clone());
        });
        (states, plans)
    };
    assert!(walked(false) == walked(true));
    let mut mpc = controller(trot(), Settings::default());
    assert_eq!(mpc.touch(&[true; 3]).unwrap_err().to_string(), "`feet`: expected 4 feet, found 3");
    assert_eq!(mpc.touch_named(&["LF_foot", "paw"]).unwrap_err().to_string(), "`feet`: `paw` is not a foot");
}

/// Checks that several linearisations are made if the budget allows them, and the least number without time.
#[test]
fn the_budget_limits_the_linearisations() {
    let x = stand();
    for (iterations, budget, expected) in [([1, 3], 10.0, 3), ([2, 3], 1e-9, 2), ([1, 1], f64::INFINITY, 1)] {
        let mut mpc = controller(trot(), Settings { iterations, budget, ..Settings::default() });
        mpc.reset(0.0, &x).unwrap();
        mpc.update(0.02, &x).unwrap();
        assert_eq!(mpc.report().iterations, expected, "{iterations:?} within {budget} s");
    }
    let wrong = WholeBodyMpc::new(
        Arc::new(robots::quadruped()),
        &feet(),
        trot(),
        Settings { iterations: [2, 1], ..Settings::default() },
    );
    let said = wrong.unwrap_err().to_string();
    assert_eq!(said, "setting `iterations` is 1, but it must be at least the least number");
}

/// Checks that a gait changes at a given time: until then the feet swing as before, and from then on none begins a
/// swing.
#[test]
fn a_gait_changes_at_a_given_time() {
    let mut mpc = controller(trot(), Settings::default());
    let x = stand();
    let early = mpc.set_gait_at(Gait::Stand, 0.9).unwrap_err();
    assert_eq!(early.to_string(), "`t`: there is no plan yet: call `reset` first, or give no time");
    mpc.reset(0.0, &x).unwrap();
    mpc.set_gait_at(Gait::Stand, 0.9).unwrap();
    let swings: Vec<bool> = (1..80)
        .map(|k| {
            let report = mpc.update(0.02 * f64::from(k), &x).unwrap();
            report.stands.iter().any(|stands| !stands)
        })
        .collect();
    // the swings are from 0.22, 0.50 and 0.78 s on, each for 0.24 s; the last one has begun before 0.9 s
    let at = |t: f64| swings[(t / 0.02).round() as usize - 1];
    assert!(!at(0.2) && at(0.3) && !at(0.48) && at(0.6) && at(0.8) && at(1.0) && !at(1.04), "{swings:?}");
    assert!(!swings[51..].iter().any(|swings| *swings));
    let late = mpc.set_gait_at(trot(), 100.0).unwrap_err();
    assert_eq!(late.to_string(), "`t`: the time 100 s is not before 61.58 s");
}

/// Checks that the planned forces on a slope lie in the friction cones about the normal of the slope, also where the
/// robot needs friction up to the limit.
#[test]
fn friction_cones_follow_the_slope() {
    let (angle, mu) = (15.0_f64.to_radians(), 0.4);
    let model = Arc::new(robots::quadruped());
    let feet = FEET.map(|name| Foot::point(name, mu, 0.0));
    let settings = Settings { accelerations: [4.0, 4.0, 2.0], ..Settings::default() };
    let mut mpc = WholeBodyMpc::new(model.clone(), &feet, trot(), settings).unwrap();
    let normal = Vec3::new(-angle.sin(), 0.0, angle.cos()); // the ground rises ahead
    let mut x = stand();
    let place = normal.scale(0.5354);
    x[..7].copy_from_slice(&[place.x, place.y, place.z, 0.0, -(0.5 * angle).sin(), 0.0, (0.5 * angle).cos()]);
    let mut simulation = Simulation::new(model.clone(), SimulationSettings { dt: STEP, ..Default::default() });
    let frames = FEET.map(|name| model.frame(name).unwrap());
    simulation.set_ground(Ground { friction: mu, normal, ..Ground::at_frames(frames) }).unwrap();
    simulation.set_state(&x[..19], &x[19..]).unwrap();
    mpc.reset(0.0, &x).unwrap();
    let (mut policy, mut tau, mut ratio) = (mpc.policy(), vec![0.0; 18], 0.0_f64);
    let mut worst = [0.0_f64; 2]; // outside the cone (N): at knot 0, and anywhere
    for step in 0..2000 {
        let t = step as f64 * STEP;
        let x = [simulation.q(), simulation.v()].concat();
        if step % PERIOD == 0 && step > 0 {
            mpc.command(Command { vx: if t < 1.0 { 0.5 } else { -0.3 }, ..Command::default() }).unwrap();
            mpc.update(t, &x).unwrap();
            for (k, force) in mpc.forces().unwrap().chunks_exact(3).enumerate() {
                let force = Vec3::new(force[0], force[1], force[2]);
                let along = force.dot(normal);
                let across = (force - normal.scale(along)).norm();
                let outside = across - mu * along;
                worst[usize::from(k >= 4)] = worst[usize::from(k >= 4)].max(outside);
                if along > 20.0 {
                    ratio = ratio.max(across / (mu * along));
                }
            }
        }
        policy.control(t, &x, &mut tau[6..]);
        assert!(simulation.step(&tau, &[]).is_taken());
    }
    let up = mpc.terrain().normal();
    assert!((up - normal).norm() < 0.02, "{up:?}");
    assert!(worst[0] < 0.5 && worst[1] < 2.0, "{worst:?}");
    assert!(ratio > 0.9, "no force needs the friction: {ratio}");
}

#[test]
fn a_tick_allocates_nothing() {
    let mut mpc = controller(trot(), Settings::default());
    let x = stand();
    mpc.reset(0.0, &x).unwrap();
    mpc.command(Command { vx: 0.2, ..Command::default() }).unwrap();
    let (mut policy, mut tau, mut grown) = (mpc.policy(), [0.0; 12], 0);
    for tick in 1..120 {
        let t = 0.013 * f64::from(tick);
        let before = allocated();
        mpc.touch(&[true; 4]).unwrap(); // each swing ends early
        mpc.update(t, &x).unwrap();
        policy.control(t, &x, &mut tau);
        if tick > 60 {
            grown += allocated() - before; // the first two periods of the gait allocate memory for knots
        }
    }
    assert_eq!(grown, 0);
}

#[test]
fn bad_states_leave_a_safe_policy() {
    let mut mpc = controller(trot(), Settings::default());
    let (mut policy, mut tau) = (mpc.policy(), [1.0; 12]);
    let x = stand();
    assert_eq!(policy.control(0.0, &x, &mut tau), EffortSource::Damping);
    assert_eq!(tau, [0.0; 12]);
    mpc.reset(0.0, &x).unwrap();
    assert_eq!(policy.control(0.01, &x, &mut tau), EffortSource::Plan);
    let mut broken = x.clone();
    broken[30] = f64::NAN;
    assert_eq!(mpc.update(0.02, &broken).unwrap().status, TickStatus::InvalidState);
    assert_eq!(policy.control(0.02, &broken, &mut tau), EffortSource::OpenLoop);
    assert!(tau.iter().all(|tau| tau.is_finite()));
    let far = [&[1e16, 0.0, 0.0][..], &x[3..]].concat();
    assert_eq!(mpc.update(0.03, &far).unwrap().status, TickStatus::InvalidState);
    assert_eq!(mpc.update(0.04, &x).unwrap().status, TickStatus::Planned);
    assert_eq!(mpc.update(0.03, &x).unwrap_err(), Error::Time { t: 0.03, last: 0.04 });
    assert_eq!(mpc.update(0.06, &x[1..]).unwrap_err().to_string(), "`x`: expected 37 numbers, found 36");
    let wrong = Command { vx: f64::INFINITY, ..Command::default() };
    assert_eq!(mpc.command(wrong).unwrap_err().to_string(), "`command`: entry 0 is inf");
    // tenfold velocities for one tick: the plan is finite, and the next plans are again as before
    let fast = [&x[..19], &[3.0; 18]].concat();
    mpc.update(0.06, &fast).unwrap();
    policy.control(0.061, &fast, &mut tau);
    let limits = mpc.model().limits().effort();
    assert!(tau.iter().zip(&limits[6..]).all(|(tau, limit)| tau.abs() <= *limit));
    for tick in 4..7 {
        mpc.update(0.02 * f64::from(tick), &x).unwrap();
    }
    assert!(mpc.report().status.is_new() && mpc.report().gap < 1.0, "{:?}", mpc.report());
    // after the end of the plan, and after a stop, the joints are damped
    assert_eq!(policy.control(5.0, &fast, &mut tau), EffortSource::Damping);
    assert!(tau.iter().all(|tau| *tau < 0.0));
    policy.stop();
    assert_eq!(policy.control(0.125, &x, &mut tau), EffortSource::Damping);
    policy.release();
    assert_eq!(policy.control(0.125, &x, &mut tau), EffortSource::Plan);
}

/// Checks the messages for feet, gaits and settings that do not fit the robot.
#[test]
fn wrong_descriptions_are_refused() {
    let quadruped = Arc::new(robots::quadruped());
    let refused = |feet: &[Foot], gait: Gait, settings: Settings| {
        let mpc = WholeBodyMpc::new(quadruped.clone(), feet, gait, settings);
        mpc.and_then(|mut mpc| mpc.reset(0.0, &stand()).map(|_| ())).unwrap_err().to_string()
    };
    let four = feet();
    let arm = WholeBodyMpc::new(Arc::new(robots::arm7()), &four, trot(), Settings::default()).unwrap_err();
    assert_eq!(arm.to_string(), "robot: `arm7` has no free-flyer at its root: read it with a floating base");
    let unknown = refused(&[Foot::point("paw", 0.6, 0.0)], Gait::Stand, Settings::default());
    assert!(unknown.starts_with("foot `paw`: the robot has no frame of this name; it has `"), "{unknown}");
    let twice = refused(&[four[0].clone(), four[0].clone()], Gait::Stand, Settings::default());
    assert_eq!(twice, "foot `LF_foot`: it is listed twice");
    let slippery = refused(&[Foot::point("LF_foot", 0.0, 0.0)], Gait::Stand, Settings::default());
    assert_eq!(slippery, "foot `LF_foot`: its friction is 0");
    let two = refused(&four[..2], trot(), Settings::default());
    assert_eq!(two, "gait: Trot needs four feet, one at each corner; there are 2");
    let jump = Gait::Table { period: 1.0, swings: FEET.map(|name| (name.into(), 0.2, 0.5)).to_vec() };
    let fall = refused(&four, jump, Settings::default());
    assert_eq!(fall, "gait: at 0.2 s no foot is on the ground, so nothing supports the robot");
    let late = Gait::Table { period: 1.0, swings: vec![("LF_foot".into(), 0.8, 1.2)] };
    let late = refused(&four, late, Settings::default());
    assert_eq!(late, "gait: `LF_foot` swings from 0.8 to 1.2 s; the period has 1 s");
    let short = refused(&four, trot(), Settings { horizon: 0.01, ..Settings::default() });
    assert_eq!(short, "setting `horizon` is 0.01, but it must be at least a knot, and at most 1000 knots");
    let tiny = Gait::Table { period: 1e-5, swings: vec![("LF_foot".into(), 1e-6, 3e-6)] };
    let tiny = refused(&four, tiny, Settings::default());
    assert!(tiny.ends_with("expected at least 0.01 s"), "{tiny}");
    let backwards = refused(&four, Gait::in_turn(Pattern::Trot, -0.2, 0.0), Settings::default());
    assert_eq!(backwards, "gait: the swing's duration is -0.2 s");
}
