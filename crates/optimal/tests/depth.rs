//! Depth of the call stack between a solve and the dynamics that it evaluates.
#![allow(non_snake_case)]

use condyle_optimal::robot::{ContinuousModel, Derivatives, Integrated, Integrator, KnotInput};
use condyle_optimal::{Fddp, LqKnot, Problem};
use nalgebra::DMatrix;
use std::backtrace::Backtrace;
use std::sync::Mutex;

/// Maximum number of nested calls. The limit keeps the call chain readable.
const MOST: usize = 10;

/// Names of the nested calls, from the solve to the last evaluation of the dynamics.
static CALLS: Mutex<String> = Mutex::new(String::new());

/// Dynamics with the accelerations q̈ = u and a cost, which record the call stack.
struct Probe {
    controls: usize,
    zero: DMatrix<f64>,
    a: [f64; 1],
}

impl Probe {
    fn new(controls: usize) -> Self {
        Self { controls, zero: DMatrix::zeros(1, 1), a: [0.0] }
    }
}

impl ContinuousModel for Probe {
    fn nq(&self) -> usize {
        1
    }
    fn nv(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        self.controls
    }
    #[inline(never)]
    fn calc(&mut self, KnotInput { x, u, .. }: KnotInput<'_>) -> (&[f64], f64) {
        self.a = [u.iter().sum()];
        (&self.a, 0.5 * (x[0] * x[0] + self.a[0] * self.a[0]))
    }
    #[inline(never)]
    fn calc_diff(&mut self, input: KnotInput<'_>, scale: f64, knot: &mut LqKnot) -> Derivatives<'_> {
        *CALLS.lock().unwrap() = Backtrace::force_capture().to_string();
        self.a = [input.u.iter().sum()];
        knot.Q.copy_from_slice(&[scale, 0.0, 0.0, 0.0]);
        knot.q.copy_from_slice(&[scale * input.x[0], 0.0]);
        knot.S.fill(0.0);
        knot.R.fill(scale);
        knot.r.copy_from_slice(&[scale * self.a[0]][..self.controls]);
        let da_du: &[f64] = if self.controls > 0 { &[1.0] } else { &[] };
        Derivatives { a: &self.a, da_dq: &self.zero, da_dv: &self.zero, da_du }
    }
}

#[test]
fn few_calls_lie_between_a_solve_and_the_dynamics() {
    let knot = Integrated::new(Probe::new(1), Integrator::SemiImplicitEuler, 0.1).unwrap();
    let end = Integrated::without_time(Probe::new(0));
    let mut problem = Problem::new(vec![1.0, 0.0], vec![Box::new(knot)], vec![0; 3], Box::new(end)).unwrap();
    Fddp::new(&problem).solve(&mut problem, &[0.0; 8], &[0.0; 3]).unwrap();
    let calls = CALLS.lock().unwrap();
    let names = calls.lines().map(str::trim).filter(|line| !line.starts_with("at "));
    let names: Vec<_> = names.skip_while(|name| !name.contains("Probe")).collect();
    let count = names.iter().position(|name| name.ends_with("::solve")).expect("the solve is in the backtrace");
    println!("{}", names[..=count].join("\n"));
    assert!(count >= 1 && count - 1 <= MOST, "{} calls lie between them", count - 1);
}
