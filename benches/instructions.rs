//! Runs each algorithm, so that `instructions.py` can count its instructions: the script runs this program under
//! callgrind, which finds the functions by name. Instruction counts are exact to 0.1 %, while times differ by 10 % from
//! run to run.

use condyle::optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, Integrator, Residual,
};
use condyle::optimal::{ActionModel, Fddp, Problem};
use condyle::{Batch, ContactConstraint, Data, Model, Se3, neutral, random_configuration, robots};
use condyle_benches::{cart_pole, quadrotor};
use nalgebra::DMatrix;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::sync::Arc;

/// Number of states that are used one after the other.
const STATES: usize = 16;

struct States {
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
}

impl States {
    fn random(model: &Model) -> Self {
        let mut rng = StdRng::seed_from_u64(1);
        let q = (0..STATES).flat_map(|_| random_configuration(model, &mut rng)).collect();
        let [v, x] = [(); 2].map(|()| (0..STATES * model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
        Self { q, v, x }
    }

    fn each(&self, model: &Model, mut call: impl FnMut(&[f64], &[f64], &[f64])) {
        let (nq, nv) = (model.nq(), model.nv());
        for k in 0..STATES {
            call(&self.q[k * nq..][..nq], &self.v[k * nv..][..nv], &self.x[k * nv..][..nv]);
        }
    }
}

/// Defines one function for each algorithm. callgrind identifies each function by its name.
macro_rules! measured {
    ($($name:ident($m:ident, $d:ident, $q:ident, $v:ident, $x:ident) $call:expr;)*) => {
        mod measured {
            use super::*;
            $(
                #[inline(never)]
                pub(super) fn $name($m: &Model, $d: &mut Data<f64>, s: &States) {
                    s.each($m, |$q, $v, $x| _ = black_box($call));
                }
            )*
            #[inline(never)]
            pub(super) fn batch_aba_derivatives(m: &Model, b: &mut Batch, s: &States) {
                black_box(b.aba_derivatives(m, &s.q, &s.v, &s.x, &[]));
            }
            #[inline(never)]
            pub(super) fn batch_aba(m: &Model, b: &mut Batch, s: &States) {
                black_box(b.aba(m, &s.q, &s.v, &s.x, &[]));
            }
        }
        fn all(m: &Model, d: &mut Data<f64>, s: &States) {
            $(measured::$name(m, d, s);)*
        }
    };
}
measured! {
    rnea(m, d, q, v, x) condyle::rnea(m, d, q, v, x, &[]);
    aba(m, d, q, v, x) condyle::aba(m, d, q, v, x, &[]);
    crba(m, d, q, _v, _x) condyle::crba(m, d, q);
    minv(m, d, q, _v, _x) condyle::minv(m, d, q);
    rnea_derivatives(m, d, q, v, x) condyle::rnea_derivatives(m, d, q, v, x, &[]);
    aba_derivatives(m, d, q, v, x) condyle::aba_derivatives(m, d, q, v, x, &[]);
}

/// Number of FDDP iterations. (The next constant is the number of knots.)
const ITERATIONS: usize = 5;
const KNOTS: usize = 32;

/// Builds the optimal control problem of a motion, with a warm start. A robot bends its joints and then comes to rest.
/// If the robot has feet, the feet stay on the ground.
fn motion(robot: &Arc<Model>, feet: &[&str], bent: &[(&str, f64)]) -> (Problem, Vec<f64>, Vec<f64>) {
    let (nv, mut q) = (robot.nv(), neutral(robot));
    for (joint, angle) in bent {
        q[robot.bodies()[robot.joint(joint).expect("one of its joints")].idx_q] = *angle;
    }
    let x0 = [q, vec![0.0; nv]].concat();
    let mut there = x0.clone();
    for (i, x) in there[..robot.nq()].iter_mut().enumerate().skip(if feet.is_empty() { 0 } else { 7 }) {
        *x += 0.1 * (i as f64).sin();
    }
    let rest = Cost::new("rest", 1e1, Residual::State { reference: there }, Activation::Quadratic);
    let nu = if feet.is_empty() { nv } else { nv - 6 };
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic);
    let tip = robot.frames().last().expect("a robot has frames");
    let reach = Residual::FrameTranslation { frame: tip.into(), target: [0.4, 0.2, 0.5].into() };
    let reach = Cost::new("reach", 1e0, reach, Activation::Quadratic);
    let running = vec![rest.clone(), effort, reach];
    let (action, u): (Box<dyn ActionModel>, _) = if feet.is_empty() {
        let mut action = FreeDynamics::running(robot.clone(), 0.02, running).expect("costs of an arm");
        let u = action.quasi_static(&x0);
        (Box::new(action), u)
    } else {
        let contact = |foot: &&str| {
            let frame = robot.frame(foot).expect("one of its feet");
            let constraint =
                if feet.len() == 4 { ContactConstraint::point(frame) } else { ContactConstraint::rigid(frame) };
            Contact::new(foot, ContactConstraint { kd: 50.0, ..constraint })
        };
        let contacts: Vec<_> = feet.iter().map(contact).collect();
        let mut action = ContactDynamics::running(robot.clone(), &contacts, 0.02, running).expect("costs on feet");
        let u = action.quasi_static(&x0);
        (Box::new(action), u)
    };
    let end = FreeDynamics::terminal(robot.clone(), vec![rest]).expect("a cost of states");
    let problem = Problem::new(x0.clone(), vec![action], vec![0; KNOTS], Box::new(end)).expect("knots of one robot");
    (problem, x0.repeat(KNOTS + 1), u.repeat(KNOTS))
}

/// Time between two knots of a small robot (s).
const DT: f64 = 0.03;

/// Builds the optimal control problem of a body that flies to a pose, or of a cart with a pole that moves to its
/// target. The rotors, and the force on the cart, act through a map.
fn small(robot: &Arc<Model>) -> (Problem, Vec<f64>, Vec<f64>) {
    let (nv, x0) = (robot.nv(), [neutral(robot), vec![0.0; robot.nv()]].concat());
    let drives = match nv {
        2 => DMatrix::from_column_slice(2, 1, &[1.0, 0.0]),
        _ => DMatrix::from_fn(6, 4, |row, k| match row {
            2 => 1.0,                               // thrust
            3 => [0.0, 0.15, 0.0, -0.15][k],        // y f
            4 => [-0.15, 0.0, 0.15, 0.0][k],        // −x f
            5 => [0.015, -0.015, 0.015, -0.015][k], // drag
            _ => 0.0,
        }),
    };
    let drives = Actuation::matrix(robot, drives).expect("a map of this robot");
    let weighted = Activation::Weighted((0..2 * nv).map(|k| if k < 3 { 0.1 } else { 100.0 }).collect());
    let rest = |weight| Cost::new("rest", weight, Residual::State { reference: x0.clone() }, weighted.clone());
    let effort = Residual::Control { reference: vec![0.0; drives.nu()] };
    let effort = Cost::new("effort", 1e-5, effort, Activation::Quadratic);
    let frame = robot.frames().last().expect("a robot has frames");
    let there = |weight| match nv {
        2 => {
            let point = Residual::FrameTranslation { frame: frame.into(), target: [1.0, 0.0, 0.0].into() };
            Cost::new("there", weight, point, Activation::Quadratic)
        }
        _ => {
            let pose = Se3 { translation: [1.0, 0.5, 0.8].into(), ..Se3::identity() };
            let pose = Residual::FramePlacement { frame: frame.into(), target: pose };
            Cost::new("there", weight, pose, Activation::Quadratic)
        }
    };
    let (nu, running) = (drives.nu(), vec![there(1e-2), rest(1e-5), effort]);
    let model = FreeAcceleration::new(robot.clone(), drives, running).expect("costs of this robot");
    let action = FreeDynamics::new(model, Integrator::SemiImplicitEuler, DT).expect("a step forward in time");
    let end = FreeDynamics::terminal(robot.clone(), vec![there(1e2), rest(1e-3)]).expect("costs of this robot");
    let problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; KNOTS], Box::new(end));
    (problem.expect("knots of one robot"), x0.repeat(KNOTS + 1), vec![0.0; KNOTS * nu])
}

fn main() {
    let robots = [
        ("cart_pole", cart_pole()),
        ("quadrotor", quadrotor()),
        ("arm7", robots::arm7()),
        ("quadruped", robots::quadruped()),
        ("humanoid", robots::humanoid()),
    ];
    let Some((_, m)) = std::env::args().nth(1).and_then(|name| robots.into_iter().find(|(robot, _)| *robot == name))
    else {
        println!("python3 benches/instructions.py runs this");
        return;
    };
    let (feet, bent): (&[&str], &[(&str, f64)]) = match m.nv() {
        7 => (&[], &[]),
        18 => (
            &["LF_foot", "LH_foot", "RF_foot", "RH_foot"],
            &[("LF_KFE", -1.4), ("LH_KFE", 1.4), ("RF_KFE", -1.4), ("RH_KFE", 1.4)],
        ),
        _ => (&["left_sole", "right_sole"], &[("left_knee", 0.8), ("right_knee", 0.8)]),
    };
    let robot = Arc::new(m.clone());
    let (mut problem, xs, us) = if m.nv() < 7 { small(&robot) } else { motion(&robot, feet, bent) };
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = ITERATIONS;
    black_box(solver.solve(&mut problem, &xs, &us).expect("a warm start that fits"));

    let (d, b, s) = (&mut Data::new(&m), &mut Batch::new(&m, STATES, 1), &States::random(&m));
    all(&m, d, s);
    // A first call allocates the matrices that it returns, so this call is not counted.
    black_box(b.aba_derivatives(&m, &s.q, &s.v, &s.x, &[]));
    measured::batch_aba(&m, b, s);
    measured::batch_aba_derivatives(&m, b, s);
}
