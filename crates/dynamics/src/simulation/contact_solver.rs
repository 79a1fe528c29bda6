//! Solver for the impulses λ of m unilateral contacts with Coulomb friction. The equations are formulated with
//! velocities u:
//!
//! ```text
//! u = G λ + b        0 ≤ λ_n ⊥ u_n ≥ 0        ‖λ_t‖ ≤ μ λ_n,  and λ_t = −μ λ_n u_t/‖u_t‖ where u_t ≠ 0
//! ```
//!
//! G is the Delassus matrix J M⁻¹ Jᵀ. b is the velocity of the points without contact, plus terms for the gaps in the
//! normal rows. Each point has three rows: two rows along the ground, and the third row along the normal. Friction is
//! limited by Coulomb's disc exactly, without a pyramid or a convex relaxation. λ is a solution if and only if λ is a
//! fixed point of
//!
//! ```text
//! λ_n ← max(0, λ_n − u_n/g_n)        λ_t ← P(λ_t − u_t/g_t),  P the projection on the disc of radius μ λ_n
//! ```
//!
//! for any g_n, g_t > 0 (Alart and Curnier 1991). The residual is the difference between λ and its image under this
//! map, times g_n or g_t. So the residual has the unit of a velocity. The solver alternates between two methods:
//!
//! - Newton's method for the fixed-point equation. When the state of each point (sticking, sliding or open) is correct,
//!   each step squares the error. A burst of several steps is discarded if it does not reduce the residual.
//! - Gauss–Seidel sweeps over the points (Jourdan, Alart and Jean 1998). The sweeps determine from any initial guess
//!   which points stick, slide or are open.
//!
//! If contacts are redundant, the Delassus matrix G is singular and the impulses are not unique. Newton's method then
//! adds ε to the diagonal of G in the slope matrix, but not in the equation for u. So each step changes the impulses as
//! little as possible, and the fixed point is not changed (the proximal point algorithm, Rockafellar 1976). The
//! impulses of the last time step are the initial guess. This keeps the forces on a robot at rest constant.

use alloc::vec::Vec;
use condyle_spatial::Scalar;

/// Minimum and maximum of ε, which Newton's method adds to the diagonal of the Delassus matrix G. Both are fractions of
/// the largest diagonal entry of G. The minimum is small compared with the entries that couple contacts, and large
/// compared with rounding errors.
const PROXIMAL: [f64; 2] = [1e-8, 1.0];
/// Minimum of the factors g_n and g_t of the fixed-point equation, as a fraction of the largest diagonal entry of the
/// Delassus matrix G. The minimum is needed if the joints prevent the motion of a point in a direction: the row of G
/// for this direction is then 0.
const LEAST: f64 = 1e-12;
/// Factor by which ε, the regularisation of Newton's method, grows after discarded steps and shrinks after accepted
/// steps.
const DAMPING: f64 = 30.0;
/// Maximum number of steps in a burst of Newton's method. The residual must shrink within these steps. It may grow
/// during the first two or three steps, which determine the points that stick, slide or are open. With random contacts,
/// bursts of 4 steps fail four times less often than bursts of 1 step.
const BURST: usize = 4;
/// Maximum ratio of the residual after a burst to the residual before. A burst with a larger ratio is discarded.
const PROGRESS: f64 = 0.7;
/// Number of Gauss–Seidel sweeps after a discarded burst. With 8 points, these sweeps together cost about as much as
/// one step of Newton's method.
const SWEEPS: usize = 12;
/// Number of projected iterations for the impulse of a sliding point in one sweep.
const ALONE: usize = 4;
/// Fraction of the tolerance. An initial guess is accepted without iterations only if its residual is below this
/// fraction of the tolerance. Otherwise, the errors of the guesses would make the forces fluctuate from step to step.
const POLISHED: f64 = 1e-4;

/// Outcome of a call of the contact solver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Outcome {
    /// Solution with a residual within the tolerance.
    Solved,
    /// Failure to reach the tolerance, with the residual (m/s) after the last iteration.
    NotSolved(f64),
}

/// Memory of the solver for up to a given number of points. Matrices are stored by columns.
#[derive(Clone, Debug)]
pub(super) struct ContactSolver {
    /// Delassus matrix G of m points. Shape: 3m × 3m. Written by: the caller.
    pub G: Vec<f64>,
    /// Velocities b of the points for λ = 0, plus the terms of the gaps (m/s). Shape: 3m. Written by: the caller.
    pub b: Vec<f64>,
    /// Impulses λ (N s): on entry the initial guess, on exit the solution. Shape: 3m.
    pub impulses: Vec<f64>,
    /// Velocities u = G λ + b (m/s) for the last computed λ. Shape: 3m. Written by: `solve`.
    pub velocities: Vec<f64>,
    /// Impulses after a step of Newton's method, and the velocities u for these impulses.
    candidate: Vec<f64>,
    candidate_velocities: Vec<f64>,
    /// Matrix (`slope`) and right-hand side (`step`) of the linear equations of Newton's method. The solution
    /// overwrites the right-hand side. Shape: 3m × 3m (`slope`), 3m (`step`).
    slope: Vec<f64>,
    step: Vec<f64>,
}

impl ContactSolver {
    /// Allocates memory for `points` points.
    pub(super) fn new(points: usize) -> Self {
        let (matrix, vector) = (vec![0.0; 9 * points * points], vec![0.0; 3 * points]);
        Self {
            G: matrix.clone(),
            b: vector.clone(),
            impulses: vector.clone(),
            velocities: vector.clone(),
            candidate: vector.clone(),
            candidate_velocities: vector.clone(),
            slope: matrix,
            step: vector,
        }
    }

    /// Solves for λ of the first `points` points, with friction μ, to a residual of `tolerance` (m/s). An iteration
    /// consists of a burst of steps of Newton's method, and of sweeps if the burst is discarded. λ is inside the
    /// friction cones even if the tolerance is not reached.
    pub(super) fn solve(&mut self, points: usize, friction: f64, tolerance: f64, max_iterations: usize) -> Outcome {
        let n = 3 * points;
        let Self { G, b, impulses, velocities, candidate, candidate_velocities, slope, step } = self;
        let problem = Problem::new(&G[..n * n], &b[..n], friction);
        let (x, u, y, w) =
            (&mut impulses[..n], &mut velocities[..n], &mut candidate[..n], &mut candidate_velocities[..n]);
        problem.project(x);
        problem.multiply(x, u);
        let mut residual = problem.residual(x, u);
        let (mut proximal, mut polished) = (PROXIMAL[0], residual <= POLISHED * tolerance);
        for _ in 0..max_iterations {
            if residual <= tolerance && polished {
                break;
            }
            polished = residual <= tolerance; // if true, the next burst is the last one: it squares the error
            y.copy_from_slice(x);
            w.copy_from_slice(u);
            let smaller = (0..BURST).any(|_| {
                problem.newton(proximal, y, w, &mut slope[..n * n], &mut step[..n]);
                y.iter_mut().zip(&step[..n]).for_each(|(y, d)| *y += d);
                problem.project(y);
                problem.multiply(y, w);
                let reached = problem.residual(y, w);
                let better = reached <= PROGRESS * residual;
                if better {
                    residual = reached;
                }
                better
            });
            if smaller {
                x.copy_from_slice(y);
                u.copy_from_slice(w);
                proximal = (proximal / DAMPING).max(PROXIMAL[0]);
                continue;
            }
            if polished {
                break;
            }
            proximal = (proximal * DAMPING).min(PROXIMAL[1]);
            for _ in 0..SWEEPS {
                problem.sweep(x);
            }
            problem.multiply(x, u);
            residual = problem.residual(x, u);
        }
        if residual <= tolerance { Outcome::Solved } else { Outcome::NotSolved(residual) }
    }
}

/// Contact problem of one time step.
struct Problem<'a> {
    G: &'a [f64],
    b: &'a [f64],
    n: usize,
    friction: f64,
    /// Largest diagonal entry of the Delassus matrix G, or 1 if G is zero because no point can move.
    scale: f64,
}

impl<'a> Problem<'a> {
    fn new(G: &'a [f64], b: &'a [f64], friction: f64) -> Self {
        let n = b.len();
        let largest = (0..n).fold(0.0, |largest: f64, i| largest.max(G[i * n + i]));
        Self { G, b, n, friction, scale: if largest > 0.0 { largest } else { 1.0 } }
    }

    fn entry(&self, i: usize, j: usize) -> f64 {
        self.G[j * self.n + i]
    }

    /// Returns the factors g_t and g_n of the fixed-point equation for the point whose rows begin at r. g_t and g_n are
    /// upper bounds of the eigenvalues of the point's tangential and normal blocks of the Delassus matrix G.
    fn stiffness(&self, r: usize) -> (f64, f64) {
        let least = LEAST * self.scale;
        ((self.entry(r, r) + self.entry(r + 1, r + 1)).max(least), self.entry(r + 2, r + 2).max(least))
    }

    /// Returns entry i of the velocities G x + b, for the impulses x.
    fn velocity(&self, i: usize, x: &[f64]) -> f64 {
        let row = &self.G[i * self.n..][..self.n]; // G is symmetric
        row.iter().zip(x).fold(self.b[i], |sum, (g, x)| sum + g * x)
    }

    /// Computes the velocities u = G x + b, for the impulses x.
    fn multiply(&self, x: &[f64], u: &mut [f64]) {
        for (i, u) in u.iter_mut().enumerate() {
            *u = self.velocity(i, x);
        }
    }

    /// Projects the impulse of each point into the friction cone: first to λ_n ≥ 0, and then to ‖λ_t‖ ≤ μ λ_n.
    fn project(&self, x: &mut [f64]) {
        for x in x.chunks_exact_mut(3) {
            x[2] = x[2].max(0.0);
            [x[0], x[1]] = disc([x[0], x[1]], self.friction * x[2]);
        }
    }

    /// Returns the residual of the impulses x (m/s): the largest difference between an impulse and its image in the
    /// fixed-point equation, times g_n or g_t. The result is NaN if an impulse is NaN.
    fn residual(&self, x: &[f64], u: &[f64]) -> f64 {
        (0..self.n).step_by(3).fold(0.0, |largest: f64, r| {
            let (g_t, g_n) = self.stiffness(r);
            let z_n = (x[r + 2] - u[r + 2] / g_n).max(0.0);
            let z = disc([x[r] - u[r] / g_t, x[r + 1] - u[r + 1] / g_t], self.friction * x[r + 2]);
            let e_n = (x[r + 2] - z_n).abs() * g_n;
            let e_t = length([x[r] - z[0], x[r + 1] - z[1]]) * g_t;
            let error = e_n.max(e_t);
            if error > largest || error.is_nan() { error } else { largest }
        })
    }

    /// Runs one Gauss–Seidel sweep. The sweep visits each point and solves the contact conditions of this point for its
    /// impulse, with all other impulses fixed. For a sliding point, the solution is only approximate.
    fn sweep(&self, x: &mut [f64]) {
        for r in (0..self.n).step_by(3) {
            let mut block = [0, 1, 2].map(|i| [0, 1, 2].map(|j| self.entry(r + i, r + j)));
            (0..3).for_each(|i| block[i][i] += LEAST * self.scale);
            let own = [x[r], x[r + 1], x[r + 2]];
            let w = [0, 1, 2].map(|i| self.velocity(r + i, x) - dot(block[i], own)); // u without this impulse
            x[r..r + 3].copy_from_slice(&self.alone(block, w, own, self.stiffness(r)));
        }
    }

    /// Returns the impulse that satisfies the contact conditions of one point. G is the point's block of the Delassus
    /// matrix, and w is the point's velocity without the impulse.
    fn alone(&self, G: [[f64; 3]; 3], w: [f64; 3], mut x: [f64; 3], (g_t, g_n): (f64, f64)) -> [f64; 3] {
        if w[2] >= 0.0 {
            return [0.0; 3]; // open: λ = 0, so u = w
        }
        let stuck = solve3(G, w.map(|w| -w)); // sticking: u = 0
        if length([stuck[0], stuck[1]]) <= self.friction * stuck[2] {
            return stuck;
        }
        for _ in 0..ALONE {
            let u = |i: usize, x: [f64; 3]| w[i] + dot(G[i], x);
            x[2] = (x[2] - u(2, x) / g_n).max(0.0);
            let u = [u(0, x), u(1, x)];
            [x[0], x[1]] = disc([x[0] - u[0] / g_t, x[1] - u[1] / g_t], self.friction * x[2]);
        }
        x
    }

    /// Computes a step d of Newton's method for the contact conditions F(λ) = 0, with the impulses λ and the velocities
    /// u. For each point, F depends on the point's state:
    ///
    /// - open: F = λ, so that F = 0 means no force;
    /// - closed: F_n = u_n, whose slope is the row of G, plus ε on the diagonal;
    /// - sticking: F_t = u_t;
    /// - sliding: F_t = λ_t − μ λ_n e, with e = z/‖z‖ and z = λ_t − u_t/g_t, so that dF_t = dλ_t − μ e dλ_n − μ λ_n/‖z‖
    ///   (1 − e eᵀ)(dλ_t − du_t/g_t).
    fn newton(&self, proximal: f64, x: &[f64], u: &[f64], A: &mut [f64], d: &mut [f64]) {
        let n = self.n;
        let epsilon = proximal * self.scale;
        let G = |i: usize, j: usize| self.entry(i, j) + if i == j { epsilon } else { 0.0 };
        for r in (0..n).step_by(3) {
            let (g_t, g_n) = self.stiffness(r);
            let z_n = x[r + 2] - u[r + 2] / g_n;
            let z = [x[r] - u[r] / g_t, x[r + 1] - u[r + 1] / g_t];
            let (size, radius) = (length(z), self.friction * z_n);
            if z_n <= 0.0 {
                for i in r..r + 3 {
                    (0..n).for_each(|j| A[j * n + i] = f64::from(u8::from(i == j)));
                    d[i] = -x[i];
                }
                continue;
            }
            (0..n).for_each(|j| A[j * n + r + 2] = G(r + 2, j));
            d[r + 2] = -u[r + 2];
            if size <= radius {
                for i in r..r + 2 {
                    (0..n).for_each(|j| A[j * n + i] = G(i, j));
                    d[i] = -u[i];
                }
                continue;
            }
            let (e, share) = ([z[0] / size, z[1] / size], self.friction * x[r + 2] / size);
            let across = [[1.0 - e[0] * e[0], -e[0] * e[1]], [-e[0] * e[1], 1.0 - e[1] * e[1]]];
            for k in 0..2 {
                for j in 0..n {
                    let du = (across[k][0] * G(r, j) + across[k][1] * G(r + 1, j)) / g_t;
                    A[j * n + r + k] = share * du;
                }
                for (j, across) in across[k].into_iter().enumerate() {
                    A[(r + j) * n + r + k] += f64::from(u8::from(j == k)) - share * across;
                }
                A[(r + 2) * n + r + k] -= self.friction * e[k];
                d[r + k] = self.friction * x[r + 2] * e[k] - x[r + k];
            }
        }
        eliminate(A, d);
    }
}

/// Returns the Euclidean norm of x.
fn length([x, y]: [f64; 2]) -> f64 {
    Scalar::sqrt(x * x + y * y)
}

fn dot([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}

/// Returns the solution x of A x = b for a positive definite A, by Cholesky factorisation.
fn solve3(A: [[f64; 3]; 3], b: [f64; 3]) -> [f64; 3] {
    let a = Scalar::sqrt(A[0][0]);
    let (l1, l2) = (A[1][0] / a, A[2][0] / a);
    let c = Scalar::sqrt(A[1][1] - l1 * l1);
    let l3 = (A[2][1] - l2 * l1) / c;
    let d = Scalar::sqrt(A[2][2] - l2 * l2 - l3 * l3);
    let y0 = b[0] / a;
    let y1 = (b[1] - l1 * y0) / c;
    let y2 = (b[2] - l2 * y0 - l3 * y1) / d;
    let x2 = y2 / d;
    let x1 = (y1 - l3 * x2) / c;
    [(y0 - l1 * x1 - l2 * x2) / a, x1, x2]
}

/// Returns the point of the disc that is nearest to z. The disc has the given radius and its centre at 0.
fn disc(z: [f64; 2], radius: f64) -> [f64; 2] {
    let size = length(z);
    if size <= radius { z } else { z.map(|z| z * (radius / size)) }
}

/// Replaces b by the solution x of A x = b, by elimination with row exchanges. A is stored by columns and is
/// overwritten. If A is singular, the solution is not finite.
fn eliminate(A: &mut [f64], b: &mut [f64]) {
    let n = b.len();
    for k in 0..n {
        let larger = |p: usize, i: usize| if A[k * n + i].abs() > A[k * n + p].abs() { i } else { p };
        let pivot = (k + 1..n).fold(k, larger);
        if pivot != k {
            (k..n).for_each(|j| A.swap(j * n + k, j * n + pivot));
            b.swap(k, pivot);
        }
        let (left, right) = A.split_at_mut((k + 1) * n);
        let column = &mut left[k * n + k..];
        let reciprocal = 1.0 / column[0];
        column[1..].iter_mut().for_each(|x| *x *= reciprocal);
        for other in right.chunks_exact_mut(n) {
            let x = other[k];
            if x != 0.0 {
                other[k + 1..].iter_mut().zip(&column[1..]).for_each(|(y, l)| *y -= l * x);
            }
        }
        let x = b[k];
        b[k + 1..].iter_mut().zip(&column[1..]).for_each(|(y, l)| *y -= l * x);
    }
    for k in (0..n).rev() {
        b[k] /= A[k * n + k];
        let x = b[k];
        let (before, column) = (&mut b[..k], &A[k * n..][..k]);
        before.iter_mut().zip(column).for_each(|(y, a)| *y -= a * x);
    }
}
