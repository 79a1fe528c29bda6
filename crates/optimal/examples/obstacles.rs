//! Prints how much longer an iteration of an arm's plan takes with distances to obstacles. The distances are a cost or
//! a limit. Each line has the durations of an iteration without and with distances (µs), and their ratio.
//!
//! ```text
//! cargo run --release -p condyle-optimal --example obstacles [robot.urdf tool_frame]
//! ```

use condyle_dynamics::{Model, UrdfOptions, neutral, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Geometry, GeometryPair, Limit, Residual, Shape};
use condyle_optimal::{Fddp, InteriorPoint, Problem, Status};
use std::sync::Arc;
use std::time::Instant;

const KNOTS: usize = 50;
/// Duration of a knot (s).
const DT: f64 = 0.02;
/// Number of measurements, of which the median is printed.
const RUNS: usize = if cfg!(debug_assertions) { 1 } else { 101 };
/// Largest change of the initial state between two measurements (rad).
const DISTURBANCE: f64 = 1e-3;
/// Distance that costs and limits ask for (m).
const MARGIN: f64 = 0.02;
/// Distances above which pairs have no derivatives (m): none, and a usual one.
const RANGES: [f64; 2] = [f64::INFINITY, 0.2];

/// Kind of term that keeps the pairs apart, and the measured part of a solver.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Cost of distances below the margin, in one iteration of FDDP.
    Cost,
    /// Limit, in one iteration of the interior point.
    Limit,
    /// Limit, in one tick of the interior point with one sweep.
    Tick,
    /// Limit, in one iteration of the interior point for a plan without other limits.
    Alone,
}

/// Returns pairs of shapes on all moving links with three spheres and the floor.
fn pairs(model: &Model, tool: &str) -> Vec<GeometryPair> {
    let link = |body: usize| model.frames().iter().find(|frame| frame.body == body);
    let capsule = Shape::capsule([0.0, 0.0, -0.05], [0.0, 0.0, 0.05], 0.05);
    let mut parts: Vec<_> =
        (1..model.bodies().len()).filter_map(link).map(|frame| Geometry::on(frame, capsule)).collect();
    parts.push(Geometry::on(tool, Shape::sphere([0.0; 3], 0.05)));
    let ball = |k: f64| Geometry::in_world(Shape::sphere([0.5, 0.25 * k, 0.4], 0.06));
    let floor = Geometry::in_world(Shape::HalfSpace { normal: [0.0, 0.0, 1.0].into(), offset: -0.5 });
    let obstacles = [ball(-1.0), ball(0.0), ball(1.0), floor];
    parts.iter().flat_map(|part| obstacles.iter().map(|other| GeometryPair::new(part.clone(), other.clone()))).collect()
}

/// Returns the problem of a reach, initial controls, and the number of pairs. `with` is the range of the distances, or
/// `None` for a plan without them.
fn problem(model: &Arc<Model>, tool: &str, kind: Kind, with: Option<f64>) -> (Problem, Vec<f64>, usize) {
    let mut q = neutral(model);
    for (joint, q) in q.iter_mut().enumerate().take(7) {
        *q = [0.0, -0.3, 0.0, if model.name() == "panda" { -2.4 } else { 1.2 }, 0.0, 0.8, 0.0][joint];
    }
    let nv = model.nv();
    let x0 = [q, vec![0.0; nv]].concat();
    let quadratic = |name: &str, weight, residual| Cost::new(name, weight, residual, Activation::Quadratic);
    let reach = Residual::FrameTranslation { frame: tool.into(), target: [0.45, 0.4, 0.4].into() };
    let mut costs = vec![
        quadratic("reach", 10.0, reach),
        quadratic("state", 1e-2, Residual::State { reference: x0.clone() }),
        quadratic("effort", 1e-4, Residual::Control { reference: vec![0.0; nv] }),
    ];
    let end = FreeDynamics::terminal(model.clone(), costs[..2].to_vec()).expect("the costs fit the robot");
    let pairs = pairs(model, tool);
    let (n, range) = (pairs.len(), with.unwrap_or(f64::INFINITY));
    let distances = Residual::Distances { pairs, range };
    // an arm's plan has limits of positions, velocities and efforts, without obstacles, too
    let mut limits = Vec::new();
    if matches!(kind, Kind::Limit | Kind::Tick) {
        let state = Residual::State { reference: [neutral(model), vec![0.0; nv]].concat() };
        limits.push(Limit::new("state", state, vec![-5.0; 2 * nv], vec![5.0; 2 * nv]));
        let effort = Residual::Control { reference: vec![0.0; nv] };
        limits.push(Limit::new("effort", effort, vec![-100.0; nv], vec![100.0; nv]));
    }
    if with.is_some() && kind == Kind::Cost {
        let activation = Activation::Barrier { lower: vec![MARGIN; n], upper: vec![f64::INFINITY; n] };
        costs.push(Cost::new("apart", 1e3, distances, activation));
    } else if with.is_some() {
        limits.push(Limit::new("apart", distances, vec![MARGIN; n], vec![f64::INFINITY; n]));
    }
    let knot = FreeDynamics::running(model.clone(), DT, costs).expect("the costs fit the robot");
    let mut knot = knot.with_limits(limits).expect("the limits fit the robot");
    let us = knot.quasi_static(&x0).repeat(KNOTS);
    let problem = Problem::new(x0, vec![Box::new(knot)], vec![0; KNOTS], Box::new(end)).expect("all knots are alike");
    (problem, us, n)
}

/// Returns the median of numbers.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}

/// Solver that has solved a problem, and resumes with other initial states.
enum Solver {
    Fddp(Fddp),
    InteriorPoint(InteriorPoint),
    Tick(InteriorPoint),
}

impl Solver {
    /// Solves a problem.
    fn new(problem: &mut Problem, us: &[f64], kind: Kind) -> Self {
        let xs = problem.x0().repeat(KNOTS + 1);
        if kind == Kind::Cost {
            let mut solver = Fddp::new(problem);
            solver.solve(problem, &xs, us).expect("states and controls fit");
            (solver.settings.tolerance, solver.settings.max_iterations) = (0.0, 1);
            return Self::Fddp(solver);
        }
        let mut solver = InteriorPoint::new(problem);
        let status = solver.solve(problem, &xs, us).expect("states and controls fit").status;
        assert!(status == Status::Converged || cfg!(debug_assertions), "{status}");
        (solver.settings.tolerance, solver.settings.max_iterations) = (0.0, 1);
        if kind == Kind::Tick { Self::Tick(solver) } else { Self::InteriorPoint(solver) }
    }

    /// Returns the duration of an iteration (µs) from the state x0.
    fn iteration(&mut self, problem: &mut Problem, x0: &[f64]) -> f64 {
        problem.set_x0(x0).expect("x0 is a state");
        let start = Instant::now();
        let plan = match self {
            Self::Fddp(solver) => solver.resume(problem),
            Self::InteriorPoint(solver) => solver.resume(problem),
            Self::Tick(solver) => solver.tick(problem, 1),
        };
        plan.expect("the problem is the solver's");
        start.elapsed().as_secs_f64() * 1e6
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let (model, tool) = match (arguments.next(), arguments.next()) {
        (Some(path), Some(tool)) => (Model::from_urdf(&path, &UrdfOptions::default()).expect("a URDF"), tool),
        _ => (robots::arm7(), "tool".to_owned()),
    };
    let model = Arc::new(model);
    println!("{}, {KNOTS} knots: pairs, without and with distances (µs an iteration), ratio", model.name());
    for (name, kind) in
        [("cost", Kind::Cost), ("limit", Kind::Limit), ("limit in a tick", Kind::Tick), ("only limit", Kind::Alone)]
    {
        let mut all = [None, Some(RANGES[0]), Some(RANGES[1])].map(|with| {
            let (mut problem, us, n) = problem(&model, &tool, kind, with);
            let solver = Solver::new(&mut problem, &us, kind);
            (problem, solver, n)
        });
        let mut times = [vec![], vec![], vec![]];
        let x0 = all[0].0.x0().to_vec();
        for run in 0..RUNS {
            let mut x = x0.clone();
            x[run % model.nq()] += if run % 2 == 0 { DISTURBANCE } else { -DISTURBANCE };
            for ((problem, solver, _), times) in all.iter_mut().zip(&mut times) {
                times.push(solver.iteration(problem, &x));
            }
        }
        let [without, with @ ..] = times.map(median);
        for (range, with) in RANGES.into_iter().zip(with) {
            println!("{name}, {} pairs within {range} m: {without:.0}, {with:.0}, {:.2}", all[1].2, with / without);
        }
    }
}
