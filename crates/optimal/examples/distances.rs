//! Prints how long the derivatives of a horizon take with distances between spheres: built-in, differentiated by dual
//! numbers, and user-defined with a hand-written Jacobian. The output is one line for each robot and number of pairs,
//! with medians in µs for 50 knots.
//!
//! ```text
//! cargo run --release -p condyle-optimal --example distances
//! ```
#![allow(non_snake_case)] // names follow the literature: J

use condyle_dynamics::{Act, Data, Model, ReferenceFrame, Vec3, forward_kinematics, neutral, robots};
use condyle_optimal::robot::{
    Activation, Cost, FreeDynamics, GenericResidual, Geometry, GeometryPair, Inputs, OwnResidual, Residual,
    ResidualFunction, RobotState, Shape,
};
use condyle_optimal::{Error, Problem};
use condyle_spatial::Scalar;
use nalgebra::DMatrix;
use std::sync::{Arc, Mutex};
use std::time::Instant;

const KNOTS: usize = 50;
/// Number of measurements, of which the median is printed.
const RUNS: usize = if cfg!(debug_assertions) { 1 } else { 201 };
const RADIUS: f64 = 0.05;

/// Pair of a point of a frame and an obstacle in the world. Both are spheres.
#[derive(Clone, Copy)]
struct Pair {
    frame: usize,
    point: Vec3<f64>,
    obstacle: Vec3<f64>,
}

/// Distances that dual numbers differentiate.
struct ByDuals(Vec<Pair>);

impl GenericResidual for ByDuals {
    fn size(&self) -> usize {
        self.0.len()
    }
    fn inputs(&self) -> Inputs {
        Inputs::POSITIONS
    }
    #[inline(always)]
    fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
        let placements = state.placements();
        for (r, pair) in r.iter_mut().zip(&self.0) {
            let d = placements.frame(pair.frame).act(pair.point.lift()) - pair.obstacle.lift();
            *r = d.norm_squared().sqrt() - S::splat(2.0 * RADIUS);
        }
    }
}

/// Distances with a hand-written Jacobian.
struct ByHand {
    model: Arc<Model>,
    pairs: Vec<Pair>,
    /// Workspace of the kinematics, and the Jacobian of a frame. Shape: 6 × nv.
    scratch: Mutex<(Data<f64>, DMatrix<f64>)>,
}

impl ResidualFunction for ByHand {
    fn size(&self) -> usize {
        self.pairs.len()
    }
    fn inputs(&self) -> Inputs {
        Inputs::POSITIONS
    }
    fn calc(&self, _: usize, x: &[f64], _: &[f64], r: &mut [f64]) {
        let (data, _) = &mut *self.scratch.lock().expect("no thread panics");
        let placements = forward_kinematics(&self.model, data, &x[..self.model.nq()]);
        for (r, pair) in r.iter_mut().zip(&self.pairs) {
            let d = placements.frame(pair.frame).act(pair.point) - pair.obstacle;
            *r = d.norm_squared().sqrt() - 2.0 * RADIUS;
        }
    }
    fn calc_diff(&self, _: usize, x: &[f64], _: &[f64], by_x: &mut [f64], _: &mut [f64]) {
        let (data, J) = &mut *self.scratch.lock().expect("no thread panics");
        let nv = self.model.nv();
        let placements = forward_kinematics(&self.model, data, &x[..self.model.nq()]);
        for (row, pair) in by_x.chunks_exact_mut(2 * nv).zip(&self.pairs) {
            let p = placements.frame(pair.frame).act(pair.point);
            let d = p - pair.obstacle;
            let n = d.scale(1.0 / d.norm_squared().sqrt());
            let arm = (p - placements.frame(pair.frame).translation).cross(n);
            placements.frame_jacobian(pair.frame, ReferenceFrame::LocalWorldAligned, J);
            for (entry, s) in row.iter_mut().zip(J.as_slice().chunks_exact(6)) {
                *entry = n.dot(Vec3::new(s[0], s[1], s[2])) + arm.dot(Vec3::new(s[3], s[4], s[5]));
            }
        }
    }
}

/// Returns the median duration (µs) of the derivatives of a horizon of a robot, and the gradient of the last knot.
fn measure(model: &Arc<Model>, distances: Option<Residual>) -> Result<(f64, Vec<f64>), Error> {
    let x0 = [neutral(model), vec![0.0; model.nv()]].concat();
    let rest = Residual::State { reference: x0.clone() };
    let mut costs = vec![Cost::new("rest", 1.0, rest, Activation::Quadratic)];
    costs.extend(distances.map(|residual| Cost::new("distances", 1.0, residual, Activation::Quadratic)));
    let knot = FreeDynamics::running(model.clone(), 0.02, costs.clone())?;
    let end = FreeDynamics::terminal(model.clone(), costs)?;
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; KNOTS], Box::new(end))?;
    let xs = x0.repeat(KNOTS + 1);
    let us = vec![0.1; problem.control_range(KNOTS).end];
    let mut lq_knots = problem.lq_knots();
    let mut times = [(); RUNS].map(|()| {
        let start = Instant::now();
        problem.calc_diff(&xs, &us, &mut lq_knots);
        start.elapsed().as_secs_f64() * 1e6
    });
    times.sort_by(f64::total_cmp);
    Ok((times[RUNS / 2], lq_knots[KNOTS].q.as_slice().to_vec()))
}

fn main() -> Result<(), Error> {
    println!("robot, pairs: without distances, built-in, dual numbers, by hand (µs for {KNOTS} knots)");
    for model in [robots::arm7(), robots::quadruped(), robots::humanoid()].map(Arc::new) {
        for count in [1, 3, 10, 30] {
            let frames = model.frames().len();
            let pair = |k: usize| {
                let s = k as f64;
                let (point, obstacle) = (Vec3::new(0.05, 0.01 * s, 0.0), Vec3::new(0.5, 0.1 * s.sin(), 0.1 * s.cos()));
                Pair { frame: frames - 1 - k % frames, point, obstacle }
            };
            let pairs: Vec<Pair> = (0..count).map(pair).collect();
            let geometries = |pair: &Pair| {
                let on_robot = Geometry::on(&model.frames()[pair.frame], Shape::sphere(pair.point, RADIUS));
                GeometryPair::new(on_robot, Geometry::in_world(Shape::sphere(pair.obstacle, RADIUS)))
            };
            let scratch = Mutex::new((Data::new(&model), DMatrix::zeros(6, model.nv())));
            let by_hand = ByHand { model: model.clone(), pairs: pairs.clone(), scratch };
            let kinds = [
                Residual::distances(pairs.iter().map(geometries).collect()),
                Residual::Own(OwnResidual::autodiff(model.clone(), ByDuals(pairs))),
                Residual::Own(OwnResidual::new(by_hand)),
            ];
            let (without, _) = measure(&model, None)?;
            let [built_in, by_duals, by_hand] = kinds.map(|kind| measure(&model, Some(kind)));
            let ((built_in, expected), (by_duals, same), (by_hand, too)) = (built_in?, by_duals?, by_hand?);
            let differs = |q: &[f64]| q.iter().zip(&expected).any(|(a, b)| (a - b).abs() > 1e-9 * (1.0 + b.abs()));
            assert!(!differs(&same) && !differs(&too), "the three residuals have different gradients");
            println!("{}, {count}: {without:.0}, {built_in:.0}, {by_duals:.0}, {by_hand:.0}", model.name());
        }
    }
    Ok(())
}
