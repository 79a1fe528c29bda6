//! Prints results of dynamics and of optimal control, one line each, and the duration of one iteration of FDDP. The
//! output is used to compare processors and SIMD levels.
//!
//! ```text
//! CONDYLE_LEVEL=baseline cargo run --release -p condyle-optimal --example numbers
//! WASM_PROFILE=release tests/wasm.sh    # the same in a browser, next to this machine
//! ```

use condyle_dynamics::{
    Batch, ConstraintSet, ContactConstraint, Data, Model, ReferenceFrame, Vec3, aba, aba_derivatives,
    constrained_dynamics, crba, forward_kinematics, integrate, minv, neutral, rnea, rnea_derivatives, robots,
};
use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FreeDynamics, Residual};
use condyle_optimal::{Fddp, Problem, Status};
use std::error::Error;
use std::fmt::Write;
use std::sync::Arc;

/// Feet of the quadruped.
const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
/// Number of solves, of which the fastest gives the reported time. A browser needs many solves, because it recompiles
/// code that runs often.
const SOLVES: usize = if cfg!(debug_assertions) { 1 } else { 300 };

fn main() {
    #[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
    page::begin();
    let numbers = report().expect("problems are right, and converge");
    #[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
    page::print(&numbers);
    #[cfg(not(all(target_arch = "wasm32", target_os = "unknown")))]
    print!("{numbers}");
}

/// Functions of the web page that runs the program: the page selects whether SIMD is used, provides a clock, and
/// receives the output.
#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
#[allow(unsafe_code)]
mod page {
    use condyle_dynamics::level::{Level, pin};
    use std::time::Duration;

    #[link(wasm_import_module = "page")]
    unsafe extern "C" {
        /// Returns whether SIMD instructions are used.
        safe fn vectors() -> bool;
        /// Returns the current time (ms).
        safe fn now() -> f64;
        /// Receives a piece of the output, as UTF-8 text of `length` bytes.
        safe fn take(text: *const u8, length: usize);
    }

    pub(crate) fn begin() {
        std::panic::set_hook(Box::new(|panic| print(&panic.to_string())));
        condyle_optimal::set_clock(|| Duration::from_secs_f64(1e-3 * now()));
        pin(if vectors() { Level::Simd128 } else { Level::Baseline }).expect("it is compiled with SIMD128");
    }

    pub(crate) fn print(text: &str) {
        take(text.as_ptr(), text.len());
    }
}

/// Computes all lines of the output.
fn report() -> Result<String, Box<dyn Error>> {
    let mut text = String::new();
    for model in [robots::arm7(), robots::quadruped()] {
        calls(&model, &mut text)?;
        batch(&model, &mut text)?;
    }
    contacts(&mut text)?;
    solve("reach", reach()?, &mut text)?;
    solve("rise", rise()?, &mut text)?;
    Ok(text)
}

/// Returns n numbers between −1 and 1, which depend on the seed.
fn numbers(seed: usize, n: usize) -> Vec<f64> {
    (0..n).map(|k| ((seed * 131 + k * 29 + 17) % 101) as f64 / 50.0 - 1.0).collect()
}

/// Returns a position of the robot away from its neutral position.
fn position(model: &Model, seed: usize) -> Vec<f64> {
    let mut q = neutral(model);
    integrate(model, &q.clone(), &numbers(seed, model.nv()), &mut q);
    q
}

/// Prints the results of single calls of dynamics algorithms.
fn calls(model: &Model, text: &mut String) -> std::fmt::Result {
    let (name, nv, mut data) = (model.name(), model.nv(), Data::new(model));
    for seed in 0..4 {
        let (q, v, a) = (position(model, seed), numbers(seed + 10, nv), numbers(seed + 20, nv));
        writeln!(text, "{name} q {q:?}")?;
        writeln!(text, "{name} rnea {:?}", rnea(model, &mut data, &q, &v, &a, &[]))?;
        writeln!(text, "{name} aba {:?}", aba(model, &mut data, &q, &v, &a, &[]))?;
        writeln!(text, "{name} crba {:?}", crba(model, &mut data, &q).as_slice())?;
        writeln!(text, "{name} minv {:?}", minv(model, &mut data, &q).as_slice())?;
        let inverse = rnea_derivatives(model, &mut data, &q, &v, &a, &[]);
        writeln!(text, "{name} dtau_dq {:?}", inverse.dtau_dq.as_slice())?;
        writeln!(text, "{name} dtau_dv {:?}", inverse.dtau_dv.as_slice())?;
        let forward = aba_derivatives(model, &mut data, &q, &v, &a, &[]);
        writeln!(text, "{name} da_dq {:?}", forward.da_dq.as_slice())?;
        writeln!(text, "{name} da_dv {:?}", forward.da_dv.as_slice())?;
    }
    Ok(())
}

/// Prints the results of a batch with one state more than the number of SIMD lanes.
fn batch(model: &Model, text: &mut String) -> std::fmt::Result {
    const STATES: usize = 9;
    let all = |of: &dyn Fn(usize) -> Vec<f64>| (0..STATES).flat_map(of).collect::<Vec<f64>>();
    let (q, nv) = (all(&|seed| position(model, seed)), model.nv());
    let (v, a) = (all(&|seed| numbers(seed + 10, nv)), all(&|seed| numbers(seed + 20, nv)));
    let mut batch = Batch::new(model, STATES, 1);
    writeln!(text, "{} batch rnea {:?}", model.name(), batch.rnea(model, &q, &v, &a, &[]))?;
    writeln!(text, "{} batch aba {:?}", model.name(), batch.aba(model, &q, &v, &a, &[]))
}

/// Prints the results of a quadruped on its feet.
fn contacts(text: &mut String) -> Result<(), Box<dyn Error>> {
    let robot = robots::quadruped();
    let mut data = Data::new(&robot);
    let feet = FEET.map(|name| robot.frame(name).map(ContactConstraint::point));
    let mut set = ConstraintSet::new(&robot, &feet.into_iter().collect::<Result<Vec<_>, _>>()?)?;
    let (q, v) = (standing(), numbers(3, robot.nv()));
    let found = constrained_dynamics(&robot, &mut data, &mut set, &q, &v, &numbers(5, robot.nv()), &[]);
    writeln!(text, "contacts a {:?}", found.a)?;
    writeln!(text, "contacts lambda {:?}", found.lambda)?;
    Ok(())
}

/// Returns the quadruped's position with bent knees.
fn standing() -> Vec<f64> {
    let mut q = neutral(&robots::quadruped());
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4));
    q
}

/// Optimal control problem with a warm start.
struct Task {
    problem: Problem,
    xs: Vec<f64>,
    us: Vec<f64>,
}

/// Creates the task of an arm that reaches for a point.
fn reach() -> Result<Task, Box<dyn Error>> {
    const KNOTS: usize = 50;
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.3, 0.4, -0.2, 1.2, 0.1, 0.8, 0.2], vec![0.0; 7]].concat();
    let state = || Residual::State { reference: x0.clone() };
    // without these weights, rounding errors would decide the motion in directions that do not move the tool
    let rest = || Activation::Weighted([[0.1; 7], [1.0; 7]].concat());
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let mut data = Data::new(&*arm);
    let tool = forward_kinematics(&arm, &mut data, &x0[..7]).frame(arm.frame("tool")?).translation;
    // the target is near, because rounding errors grow with the distance
    let target = tool + Vec3::new(0.05, -0.04, 0.06);
    let point = Residual::FrameTranslation { frame: "tool".into(), target };
    let running =
        vec![Cost::new("rest", 1e-1, state(), rest()), Cost::new("effort", 1e-3, effort, Activation::Quadratic)];
    let terminal = vec![Cost::new("point", 1e3, point, Activation::Quadratic), Cost::new("rest", 1e0, state(), rest())];
    let mut knot = FreeDynamics::running(arm.clone(), 0.02, running)?;
    let us = knot.quasi_static(&x0).repeat(KNOTS);
    let end = Box::new(FreeDynamics::terminal(arm, terminal)?);
    let xs = x0.repeat(KNOTS + 1);
    Ok(Task { problem: Problem::new(x0, vec![Box::new(knot)], vec![0; KNOTS], end)?, xs, us })
}

/// Creates the task of a quadruped that raises its trunk, on four feet.
fn rise() -> Result<Task, Box<dyn Error>> {
    const KNOTS: usize = 30;
    let robot = Arc::new(robots::quadruped());
    let x0 = [standing(), vec![0.0; 18]].concat();
    let mut data = Data::new(&robot);
    let up = forward_kinematics(&robot, &mut data, &x0[..19]).com() + Vec3::new(0.01, 0.0, 0.05);
    let hold = |name: &&str| -> Result<Contact, condyle_dynamics::Error> {
        let point = ContactConstraint::point(robot.frame(name)?);
        Ok(Contact::new(name, ContactConstraint { kd: 40.0, reference: ReferenceFrame::LocalWorldAligned, ..point }))
    };
    let feet = FEET.iter().map(hold).collect::<Result<Vec<_>, _>>()?;
    let costs = |weight: f64, controls: usize| {
        let rest = Activation::Weighted([[0.1; 18], [1.0; 18]].concat());
        let mut costs = vec![
            Cost::new("up", weight, Residual::CenterOfMass { target: up }, Activation::Quadratic),
            Cost::new("rest", 1e-1 * weight, Residual::State { reference: x0.clone() }, rest),
        ];
        if controls > 0 {
            let effort = Residual::Control { reference: vec![0.0; controls] };
            costs.push(Cost::new("effort", 1e-3, effort, Activation::Quadratic));
        }
        costs
    };
    let mut knot = ContactDynamics::running(robot.clone(), &feet, 0.01, costs(1e1, 12))?;
    let us = knot.quasi_static(&x0).repeat(KNOTS);
    let end = Box::new(FreeDynamics::terminal(robot.clone(), costs(1e3, 0))?);
    let xs = x0.repeat(KNOTS + 1);
    Ok(Task { problem: Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; KNOTS], end)?, xs, us })
}

/// Prints the iterates of FDDP, and the time of one iteration.
fn solve(name: &str, Task { mut problem, xs, us }: Task, text: &mut String) -> Result<(), Box<dyn Error>> {
    let mut solver = Fddp::new(&problem);
    let mut fastest = f64::INFINITY;
    for _ in 0..SOLVES {
        let solution = solver.solve(&mut problem, &xs, &us)?;
        fastest = fastest.min(1e3 * solution.timings.total.as_secs_f64() / solution.trace.len() as f64);
    }
    let solution = solver.solution();
    if solution.status != Status::Converged {
        return Err(format!("{name}: {:?}", solution.status).into());
    }
    for i in &solution.trace {
        writeln!(text, "{name} {} cost {:?} step {:?}", i.iteration, i.cost, i.step)?;
    }
    writeln!(text, "{name} xs {:?}", solution.xs)?;
    writeln!(text, "{name} us {:?}", solution.us)?;
    writeln!(text, "time {name} {fastest:.3} ms per iteration, {} iterations", solution.trace.len())?;
    Ok(())
}
