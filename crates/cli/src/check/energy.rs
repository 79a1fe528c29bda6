//! Checks that the integrators conserve the energy of a robot without motor efforts and friction.

use super::ledger::Row;
use crate::error::Error;
use crate::limits;
use crate::states::{normal, source};
use condyle::simulation::{Integrator, Settings, Simulation};
use condyle::{Data, Model, forward_velocities};

/// Step lengths (s), in the order in which they are tried. Light links can oscillate too fast for a long step.
const STEPS: [f64; 4] = [1e-3, 1e-4, 1e-5, 1e-6];
/// Number of steps of the first simulation. Two further simulations cover the same duration with half and a quarter of
/// the step length.
const COUNT: usize = 200;
/// Relative energy error that consists only of rounding. The order of the integrator cannot be measured from smaller
/// errors.
const ROUNDING: f64 = 1e-13;
/// Initial speed of the joints (rad/s, m/s).
const SPEED: f64 = 0.1;
/// Rule for an integrator: name, integrator, bound of the error, and order.
type Rule = (&'static str, Integrator, f64, f64);

/// Rules for each integrator. A check passes if the energy error max |E(t) − E(0)| at the shortest step, relative to
/// the largest kinetic energy, is within the bound. It also passes if the error falls with the step length, at least
/// with the given order. Light links can oscillate too fast for every step length; then only the order is meaningful.
const RULES: [Rule; 3] = [
    ("energy, RK4", Integrator::RungeKutta4, 1e-7, 3.0),
    ("energy, variational", Integrator::Variational, 1e-3, 1.5),
    ("energy, semi-implicit Euler", Integrator::SemiImplicitEuler, 1e-2, 0.7),
];

/// Returns a row for each integrator. If limbs are so light that the motion is unstable at every step length, all
/// joints receive armature, and a note in the row states the armature.
pub(super) fn check(model: &Model, armature: f64) -> Result<Vec<Row>, Error> {
    let mut heavier = model.armature().to_vec();
    for body in model.bodies()[1..].iter().filter(|body| body.joint.nv() == 1) {
        heavier[body.idx_v] += armature;
    }
    let heavier = model.clone().with_armature(&heavier)?;
    let row = |rule| {
        let own = measure(model, rule);
        if own.pass {
            return own;
        }
        let mut other = measure(&heavier, rule);
        other.note += &format!("; limbs too light for any step: {armature} kg m² of armature on each joint");
        if other.pass { other } else { own }
    };
    Ok(RULES.into_iter().map(row).collect())
}

/// Measures the energy error of an integrator with the longest step length for which the check passes.
fn measure(model: &Model, (name, integrator, bound, order): Rule) -> Row {
    let q = limits::start(model);
    let v: Vec<f64> = normal(&mut source(3), model.nv()).into_iter().map(|x| SPEED * x).collect();
    let new = || Row::new(name, "E(t) = E(0) in free motion", "small steps, or falling by the integrator's order");
    let mut row = new();
    for dt in STEPS {
        row = new();
        let drifts = [1, 2, 4].map(|part| drift(model, integrator, dt / part as f64, COUNT * part, &q, &v));
        let [_, Some(before), Some(last)] = drifts else {
            row.see(f64::NAN, bound);
            row.note = format!("a step of {} ms fails", 1e3 * dt);
            continue;
        };
        row.see(last, bound);
        row.note = format!("{} ms in steps of {} ms", 1e3 * dt * COUNT as f64, 0.25e3 * dt);
        let found = (before / last).log2();
        if last > ROUNDING {
            row.note += &format!(", order {found:.1}");
        }
        if !row.pass && found >= order {
            (row.pass, row.bound) = (true, f64::INFINITY);
        }
        if row.pass {
            break;
        }
    }
    row
}

/// Returns max |E(t) − E(0)| / max T, with the energy E and the kinetic energy T. Returns `None` if a step failed.
fn drift(model: &Model, integrator: Integrator, dt: f64, count: usize, q: &[f64], v: &[f64]) -> Option<f64> {
    let mut data = Data::new(model);
    let mut energy = |q: &[f64], v: &[f64]| {
        let velocities = forward_velocities(model, &mut data, q, v);
        (velocities.mechanical_energy(), velocities.kinetic_energy())
    };
    let mut simulation = Simulation::new(model, Settings { integrator, dt, ..Settings::default() });
    simulation.set_state(q, v).ok()?;
    let (start, mut kinetic) = energy(q, v);
    let (efforts, mut error) = (vec![0.0; model.nv()], 0.0_f64);
    for _ in 0..count {
        if !simulation.step(&efforts, &[]).is_done() {
            return None;
        }
        let (now, T) = energy(simulation.q(), simulation.v());
        error = error.max((now - start).abs());
        kinetic = kinetic.max(T);
    }
    Some(error / kinetic.max(f64::MIN_POSITIVE)).filter(|error| error.is_finite())
}
