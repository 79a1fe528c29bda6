//! The computation of a slot for a knot of an optimal control problem: next state and cost as functions of state and
//! controls.
//!
//! Let φ(x, u) be the next state, and ψ(z) = φ(x ⊕ δx, u + δu) ⊖ φ(x, u) its change with z = (δx, δu). A problem's
//! actions provide ∂ψ = [A B] and ∂²(μᵀψ) for multipliers μ. The next state at x ⊕ δx and u + δu is x⁺ = φ ⊕ ψ. With E
//! = ∂(φ ⊕ δ)/∂δ and multipliers λ of x⁺:
//!
//! ```text
//! ∂x⁺ = E [A B]      ∂²(λᵀx⁺) = ∂²(μᵀψ) + [A B]ᵀ ∂²(λᵀ(φ ⊕ δ)) [A B],   μ = Eᵀ λ
//! ```

use super::chart::Chart;
use super::computation::{Calls, Computation, Output};
use condyle::optimal::{ActionModel, Hessian, LqKnot};
use condyle::{Model, ModelError as Error};
use nalgebra::DMatrix;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::sync::{Mutex, PoisonError};

/// Number of random states at which the derivatives of the next state are evaluated. A derivative that is zero at all
/// of these states is taken as zero everywhere. Derivatives are analytic functions: a derivative that is not zero
/// everywhere is zero at a random state with probability 0. So one state would suffice.
const STATES: u64 = 3;

/// A knot of an optimal control problem.
pub(super) struct KnotFunction {
    /// The action; each call works on a copy.
    action: Mutex<Box<dyn ActionModel>>,
    /// Index of the knot; `None` if the index is an argument.
    t: Option<usize>,
    chart: Chart,
    nx: usize,
    nu: usize,
    /// Whether the knot is the terminal knot, which has no next state.
    end: bool,
    /// For each tangent coordinate and each of the nx numbers of the next state, whether the derivative may differ from
    /// zero.
    slopes: Vec<bool>,
}

impl KnotFunction {
    /// Creates the function of an action at knot t, or at all knots if t is `None`. `robot` is the robot of the action,
    /// if the action has one. Returns `None` if the action cannot be copied.
    pub(super) fn new(
        action: Box<dyn ActionModel>,
        robot: Option<&Model>,
        t: Option<usize>,
        end: bool,
    ) -> Option<Self> {
        let (nx, nu) = (action.nx(), action.nu());
        let chart = robot.map_or_else(Chart::none, Chart::new);
        let mut calls = KnotCalls::new(action.try_clone()?, chart.clone(), t, end);
        let action = Mutex::new(action);
        let mut slopes = Vec::new();
        if !end {
            let tangents = nx - chart.nq + chart.nv + nu;
            let mut J = DMatrix::zeros(nx + 1, tangents);
            slopes.resize(nx * tangents, false);
            for seed in 0..STATES {
                let mut rng = StdRng::seed_from_u64(seed);
                let mut x = robot.map_or_else(Vec::new, |robot| condyle::random_configuration(robot, &mut rng));
                let numbers = nx - x.len();
                x.extend((0..numbers).map(|_| rng.random_range(-1.0..1.0)));
                let u = (0..nu).map(|_| rng.random_range(-1.0..1.0)).collect();
                calls.jacobian(&[x, u, vec![0.0]], core::slice::from_mut(&mut J));
                for (slopes, column) in slopes.chunks_exact_mut(nx.max(1)).zip(J.column_iter()) {
                    slopes.iter_mut().zip(column.iter()).for_each(|(slope, x)| *slope |= *x != 0.0);
                }
            }
        }
        Some(Self { action, t, chart, nx, nu, end, slopes })
    }
}

impl KnotFunction {
    /// Returns the number of entries of (δx, δu).
    fn tangents(&self) -> usize {
        self.nx - self.chart.nq + self.chart.nv + self.nu
    }
}

impl Computation for KnotFunction {
    fn arguments(&self) -> Vec<(&'static str, usize)> {
        let mut arguments = vec![("x", self.nx)];
        if self.nu > 0 {
            arguments.push(("u", self.nu));
        }
        if self.t.is_none() {
            arguments.push(("t", 1));
        }
        arguments
    }

    fn outputs(&self) -> Vec<Output> {
        let output = |name, rows| Output { name, rows, columns: 1 };
        let cost = output("cost", 1);
        if self.end { vec![cost] } else { vec![output("next", self.nx), cost] }
    }

    fn chart(&self) -> Chart {
        self.chart.clone()
    }

    fn depends(&self, row: usize, j: usize) -> bool {
        j < self.tangents() && (self.end || row == self.nx || self.slopes[j * self.nx + row])
    }

    fn curves(&self, i: usize, j: usize) -> bool {
        i.max(j) < self.tangents()
    }

    fn calls(&self, _: usize) -> Result<Box<dyn Calls>, Error> {
        let action = self.action.lock().unwrap_or_else(PoisonError::into_inner);
        let copy = action.try_clone().expect("was copied before");
        Ok(Box::new(KnotCalls::new(copy, self.chart.clone(), self.t, self.end)))
    }
}

/// Work space for calls of a knot.
struct KnotCalls {
    action: Box<dyn ActionModel>,
    chart: Chart,
    t: Option<usize>,
    end: bool,
    next: Vec<f64>,
    /// The vector μ = Eᵀ λ: the multipliers λ of the next state, mapped to its tangent space.
    mu: Vec<f64>,
    knot: LqKnot,
    hessian: Hessian,
}

impl KnotCalls {
    fn new(action: Box<dyn ActionModel>, chart: Chart, t: Option<usize>, end: bool) -> Self {
        let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
        let (next, mu) = (vec![0.0; nx], vec![0.0; ndx]);
        let (knot, hessian) = (LqKnot::zeros(ndx, nu), Hessian::zeros(ndx, nu));
        Self { action, chart, t, end, next, mu, knot, hessian }
    }

    /// Returns the index, the state and the controls of the knot, from the arguments.
    fn read<'a>(&self, x: &'a [Vec<f64>]) -> (usize, &'a [f64], &'a [f64]) {
        let last = || x.last().map_or(0.0, |t| t[0]);
        let u: &[f64] = if self.action.nu() > 0 { &x[1] } else { &[] };
        (self.t.unwrap_or_else(|| last() as usize), &x[0], u)
    }
}

/// Returns column j of the matrix [A B] of a knot.
fn slope(knot: &LqKnot, j: usize) -> &[f64] {
    let n = knot.ndx();
    match j.checked_sub(n) {
        None => &knot.A.as_slice()[j * n..][..n],
        Some(k) => &knot.B.as_slice()[k * n..][..n],
    }
}

impl KnotCalls {
    /// Computes the next state, and stores its derivatives in `knot`.
    fn differentiate(&mut self, x: &[Vec<f64>]) {
        let (t, x, u) = self.read(x);
        if !self.end {
            self.action.calc(t, x, u, &mut self.next);
        }
        self.action.calc_diff(t, x, u, &mut self.knot);
    }
}

impl Calls for KnotCalls {
    fn value(&mut self, x: &[Vec<f64>], y: &mut [f64]) {
        let (t, x, u) = self.read(x);
        let cost = self.action.calc(t, x, u, &mut self.next);
        let (last, next) = y.split_last_mut().expect("the cost is there");
        *last = cost;
        if !self.end {
            next.copy_from_slice(&self.next);
        }
    }

    fn jacobian(&mut self, x: &[Vec<f64>], J: &mut [DMatrix<f64>]) {
        self.differentiate(x);
        let Self { chart, end, next, knot, .. } = self;
        let (ndx, nq, nv) = (knot.ndx(), chart.nq, chart.nv);
        for (j, mut column) in J[0].columns_mut(0, ndx + knot.nu()).column_iter_mut().enumerate() {
            let (cost, rows) = column.as_mut_slice().split_last_mut().expect("the cost is there");
            *cost = if j < ndx { knot.q[j] } else { knot.r[j - ndx] };
            if !*end {
                let slope = slope(knot, j);
                chart.push(&next[..nq], &slope[..nv], &mut rows[..nq]);
                rows[nq..].copy_from_slice(&slope[nv..]);
            }
        }
    }

    fn hessian(
        &mut self,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut [DMatrix<f64>]>,
        H: &mut [DMatrix<f64>],
    ) -> Result<(), Error> {
        match J {
            Some(J) => self.jacobian(x, J),
            None => self.differentiate(x),
        }
        let H = &mut H[0];
        let (t, x, u) = self.read(x);
        let Self { action, chart, end, next, mu, knot, hessian, .. } = self;
        let n = knot.ndx() + knot.nu(); // if t is an argument, its coordinate follows these n
        let (weight, lambda) = lambda.split_last().expect("the cost is there");
        H.fill(0.0);
        add(H, *weight, [&knot.Q, &knot.S, &knot.R]);
        if *end {
            return Ok(());
        }
        let Chart { nq, nv, .. } = *chart;
        chart.pull(&next[..nq], &lambda[..nq], &mut mu[..nv]);
        mu[nv..].copy_from_slice(&lambda[nq..]);
        if action.dynamics_hessian(t, x, u, mu, hessian) {
            add(H, 1.0, [&hessian.xx, &hessian.xu, &hessian.uu]);
        }
        chart.each_curvature(&next[..nq], &lambda[..nq], |group, C| {
            for j in 0..n {
                let by_j = &slope(knot, j)[group.clone()];
                let along: Vec<f64> =
                    (0..by_j.len()).map(|r| (0..by_j.len()).map(|c| C[(r, c)] * by_j[c]).sum()).collect();
                for i in 0..n {
                    let by_i = &slope(knot, i)[group.clone()];
                    H[(i, j)] += by_i.iter().zip(&along).map(|(x, y)| x * y).sum::<f64>();
                }
            }
        });
        Ok(())
    }
}

/// Adds the block matrix [xx xu; xuᵀ uu], multiplied by `factor`, to H.
fn add(H: &mut DMatrix<f64>, factor: f64, [xx, xu, uu]: [&DMatrix<f64>; 3]) {
    let (n, all) = (xx.nrows(), xx.nrows() + uu.nrows());
    for j in 0..all {
        for i in 0..all {
            H[(i, j)] += factor
                * match (i < n, j < n) {
                    (true, true) => xx[(i, j)],
                    (true, false) => xu[(i, j - n)],
                    (false, true) => xu[(j, i - n)],
                    (false, false) => uu[(i - n, j - n)],
                };
        }
    }
}
