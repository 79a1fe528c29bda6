//! One Levenberg–Marquardt step towards target poses, for several configurations in the lanes of a SIMD register.
//!
//! ```text
//! e = (p_t − p, log(R_t Rᵀ))         error of each frame, along the axes of the world
//! E = ½ Σ eᵀ W e
//! Δq = (Jᵀ W J + (E + ε) 1)⁻¹ Jᵀ W e     q ← clip(q ⊕ Δq)
//! ```
//!
//! A coordinate at a limit whose gradient points out of the limit is left out of the step.
//!
//! In lanes that push, each pair whose distance d is below a margin m has the error m − d, too. Its row of J is ∂d/∂q.
//!
//! Source: Sugihara, *Solvability-unconcerned inverse kinematics by the Levenberg–Marquardt method* (2011), equation
//! 21.

use condyle_dynamics::distances::prepared::{
    NUMBERS, Near, PreparedPairs, RESULT, find_near, other_results, pair_distances, place_shapes, write_row,
};
use condyle_dynamics::{
    Data, Model, Placements, Quaternion, ReferenceFrame, Se3, Vec3, forward_kinematics, integrate, lie,
};
use condyle_spatial::block::{Block, Real, SimdToken, gather, lanes, scatter};
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Mat3, Matrix, Scalar, matrix};

/// Token that allows this crate to name SIMD vector types.
pub(crate) struct Gate;

// SAFETY: SIMD vectors are used only by the kernels of other crates, and in kernels that are entered through
// `Scalar::enter`.
#[allow(unsafe_code)]
unsafe impl SimdToken for Gate {}

/// Vector with few lanes.
pub(crate) type Narrow = <f64 as Real>::Narrow<Gate>;
/// Vector with the lanes of the widest registers.
pub(crate) type Wide = <f64 as Real>::Wide<Gate>;

/// Damping ε that remains near the target. It limits steps along directions that do not change the error, and it is
/// small enough for quadratic convergence.
const LEAST_DAMPING: f64 = 1e-6;

/// Number of numbers of a target: the columns of its rotation, and its translation.
pub(crate) const TARGET: usize = 12;

/// Coordinate with limits: its index in q and in v, and the limits.
pub(crate) type Limited = (usize, usize, f64, f64);

/// Frames and weights of a search.
#[derive(Clone, Debug)]
pub(crate) struct Aim {
    /// Indices of the frames in the model.
    pub frames: Vec<usize>,
    /// Coordinates that move each frame.
    pub supports: Vec<Vec<usize>>,
    /// Weight of the squared position error (1/m²), and of the squared rotation error (1/rad²).
    pub weights: [f64; 2],
    pub limits: Vec<Limited>,
}

/// Memory of a step.
pub(crate) struct Descent<S> {
    data: Data<S>,
    q: Vec<S>,
    next: Vec<S>,
    targets: Vec<S>,
    J: Matrix<S>,
    /// Jᵀ W J + λ, lower triangle, column by column.
    A: Vec<S>,
    step: Vec<S>,
    /// 1 for coordinates that may move, 0 for the others.
    free: Vec<S>,
    /// Square of the position error, and of the rotation error, of each frame.
    squares: Vec<S>,
    push: Option<Push<S>>,
}

/// Pairs that a step pushes apart.
struct Push<S> {
    pairs: PreparedPairs,
    /// Distance below which a pair is pushed (m).
    margin: f64,
    /// 1 for lanes that push, 0 for the others.
    chosen: Vec<f64>,
    weight: [S; 1],
    /// Sum of the squares of all errors m − d, before the last step.
    excess: [S; 1],
    shapes: Vec<S>,
    /// Pairs that may be below the margin in some lane.
    near: Near,
    results: Vec<S>,
    row: Vec<S>,
}

impl<S: Block<Number = f64>> Push<S> {
    fn new(pairs: PreparedPairs, margin: f64, nv: usize) -> Self {
        let (zeros, mut near) = (|n| vec![S::zero(); n], Near::default());
        near.reset(margin, pairs.len());
        Self {
            margin,
            chosen: vec![0.0; S::LANES],
            weight: [S::zero()],
            excess: [S::zero()],
            shapes: zeros(pairs.shape_count() * NUMBERS),
            near,
            results: zeros(pairs.len() * RESULT),
            row: zeros(nv),
            pairs,
        }
    }

    /// Adds the errors of all pairs that are too near to Jᵀ e and to the lower triangle of Jᵀ J. Returns the sum of
    /// their squares.
    #[inline(always)]
    fn add(&mut self, placements: Placements<'_, S>, step: &mut [S], A: &mut [S]) -> S {
        let Self { pairs, margin, weight: [weight], excess: [excess], shapes, near, results, row, .. } = self;
        place_shapes(placements, pairs, true, shapes);
        find_near(pairs, shapes, near);
        pair_distances(pairs, shapes, near, results);
        other_results(placements, &|_| pairs, S::LANES, near, results);
        let (n, zero) = (step.len(), S::zero());
        *excess = zero;
        for k in (0..pairs.len()).filter(|&k| near.is_near(k)) {
            let result = &results[k * RESULT..][..RESULT];
            let e = (S::splat(*margin) - result[0]) * *weight; // m − d
            let near = zero.lt(e);
            if !S::any(near) {
                continue;
            }
            let e = S::select(near, e, zero);
            let one = S::select(near, S::one(), zero);
            *excess += e * e;
            write_row(placements, pairs, k, result, row); // ∂d/∂q
            for i in 0..n {
                step[i] += row[i] * e;
                let scaled = row[i] * one;
                for j in i..n {
                    A[i * n + j] += scaled * row[j];
                }
            }
        }
        *excess
    }
}

impl<S: Block<Number = f64>> Descent<S> {
    /// Allocates the memory for a number of frames, and for pairs that steps push apart up to a margin (m).
    pub(crate) fn new(model: &Model, frames: usize, pairs: Option<(PreparedPairs, f64)>) -> Self {
        let (nq, nv, zeros) = (model.nq(), model.nv(), |n| vec![S::zero(); n]);
        Self {
            data: Data::new(model),
            q: zeros(nq),
            next: zeros(nq),
            targets: zeros(TARGET * frames),
            J: matrix(6, nv, S::zero()),
            A: zeros(nv * nv),
            step: zeros(nv),
            free: zeros(nv),
            squares: zeros(2 * frames),
            push: pairs.map(|(pairs, margin)| Push::new(pairs, margin, nv)),
        }
    }

    /// Chooses whether steps of a lane push pairs apart.
    pub(crate) fn set_push(&mut self, lane: usize, on: bool) {
        if let Some(push) = &mut self.push {
            push.chosen[lane] = f64::from(u8::from(on));
            gather(&push.chosen, S::LANES, &mut push.weight);
        }
    }

    /// Returns the sum of the squares of m − d over the pairs that a lane pushes (m²), before the last step.
    pub(crate) fn excess(&self, lane: usize) -> f64 {
        let pushing = self.push.as_ref().filter(|push| push.chosen[lane] != 0.0);
        pushing.map_or(0.0, |push| lanes(&push.excess)[lane])
    }

    /// Reads the targets of all lanes: `LANES` rows, one after the other.
    pub(crate) fn set_targets(&mut self, rows: &[f64]) {
        gather(rows, S::LANES, &mut self.targets);
    }

    /// Makes one step from the positions in `q`, `LANES` rows, and writes the next positions to `next`.
    pub(crate) fn step(&mut self, model: &Model, aim: &Aim, q: &[f64], next: &mut [f64]) {
        gather(q, S::LANES, &mut self.q);
        S::enter(Iterate { model, aim, descent: self });
        scatter(&self.next, S::LANES, next);
    }

    /// Returns the largest position error and the largest rotation error of the frames in a lane (m, rad), before the
    /// last step.
    pub(crate) fn errors(&self, lane: usize) -> [f64; 2] {
        let squares = lanes(&self.squares);
        let mut most = [0.0_f64; 2];
        for (i, square) in squares.iter().skip(lane).step_by(S::LANES).enumerate() {
            // NaN, from a position that is not finite, becomes infinity.
            let error = if square.is_nan() { f64::INFINITY } else { square.sqrt() };
            most[i % 2] = most[i % 2].max(error);
        }
        most
    }
}

struct Iterate<'a, S> {
    model: &'a Model,
    aim: &'a Aim,
    descent: &'a mut Descent<S>,
}

impl<S: Block<Number = f64>> Kernel for Iterate<'_, S> {
    #[inline(always)]
    fn run(self) {
        let Self { model, aim, descent } = self;
        let Descent { data, q, next, targets, J, A, step, free, squares, push } = descent;
        let n = step.len();
        A.fill(S::zero());
        step.fill(S::zero());
        let [linear, angular] = aim.weights.map(S::splat);
        let mut energy = S::zero();
        let placements = forward_kinematics(model, data, q);
        for (k, (&frame, support)) in aim.frames.iter().zip(&aim.supports).enumerate() {
            let oXf = placements.frame(frame);
            placements.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, J);
            let oXt = target(&targets[TARGET * k..][..TARGET]);
            let p = oXt.translation - oXf.translation; // p_t − p
            let w = lie::log3(Quaternion::from_rotation(oXt.rotation * oXf.rotation.transpose())); // log(R_t Rᵀ)
            squares[2 * k] = p.norm_squared();
            squares[2 * k + 1] = w.norm_squared();
            let (p, w) = (p.scale(linear), w.scale(angular)); // W e
            energy += p.dot(oXt.translation - oXf.translation) + squares[2 * k + 1] * angular;
            let J = J.as_slice();
            let column = |c: usize| {
                let J = &J[6 * c..6 * c + 6];
                (Vec3::new(J[0], J[1], J[2]), Vec3::new(J[3], J[4], J[5]))
            };
            for (a, &i) in support.iter().enumerate() {
                let (v, u) = column(i);
                step[i] += v.dot(p) + u.dot(w); // Jᵀ W e
                let (v, u) = (v.scale(linear), u.scale(angular));
                for &j in &support[a..] {
                    let (x, y) = column(j);
                    A[i * n + j] += v.dot(x) + u.dot(y); // Jᵀ W J
                }
            }
        }
        if let Some(push) = push.as_mut().filter(|push| push.chosen.iter().any(|x| *x != 0.0)) {
            energy += push.add(placements, step, A);
        }
        // λ = E + ε
        let lambda = energy * S::splat(0.5) + S::splat(LEAST_DAMPING);
        free.fill(S::one());
        for &(iq, i, lower, upper) in &aim.limits {
            let (x, g) = (q[iq], step[i]);
            let below = S::and(x.lt(S::splat(lower + AT_LIMIT)), g.lt(S::zero()));
            let above = S::and(S::splat(upper - AT_LIMIT).lt(x), S::zero().lt(g));
            free[i] = S::select(S::or(below, above), S::zero(), S::one());
        }
        for i in 0..n {
            step[i] = step[i] * free[i];
            for j in i + 1..n {
                A[i * n + j] = A[i * n + j] * free[i] * free[j];
            }
            A[i * n + i] = A[i * n + i] * free[i] + lambda + (S::one() - free[i]);
        }
        solve(A, step);
        integrate(model, q, step, next);
        for &(iq, _, lower, upper) in &aim.limits {
            let (x, lower, upper) = (next[iq], S::splat(lower), S::splat(upper));
            let x = S::select(x.lt(lower), lower, x);
            next[iq] = S::select(upper.lt(x), upper, x);
        }
    }
}

/// Distance from a limit within which a coordinate counts as at the limit (rad, m).
const AT_LIMIT: f64 = 1e-9;

/// Returns a pose from its numbers.
#[inline(always)]
fn target<S: Scalar>(t: &[S]) -> Se3<S> {
    let vector = |i: usize| Vec3::new(t[i], t[i + 1], t[i + 2]);
    Se3::new(Mat3 { x: vector(0), y: vector(3), z: vector(6) }, vector(9))
}

/// Writes the numbers of a pose.
pub(crate) fn write_target(pose: &Se3<f64>, to: &mut [f64]) {
    let [x, y, z] = pose.rotation.columns();
    for (part, to) in [x, y, z, pose.translation].into_iter().zip(to.chunks_exact_mut(3)) {
        to.copy_from_slice(&part.to_array());
    }
}

/// Solves A x = b in place by the factorization A = L Lᵀ of the lower triangle. A is overwritten with L, with the
/// reciprocals of its diagonal.
#[inline(always)]
fn solve<S: Scalar>(A: &mut [S], b: &mut [S]) {
    let n = b.len();
    for j in 0..n {
        let r = A[j * n + j].sqrt().recip();
        A[j * n + j] = r;
        for i in j + 1..n {
            A[j * n + i] = A[j * n + i] * r;
        }
        let x = b[j] * r;
        b[j] = x;
        for k in j + 1..n {
            let l = -A[j * n + k];
            b[k] = l.mul_add(x, b[k]);
            for i in k..n {
                A[k * n + i] = l.mul_add(A[j * n + i], A[k * n + i]);
            }
        }
    }
    for j in (0..n).rev() {
        let mut x = b[j];
        for i in j + 1..n {
            x = (-A[j * n + i]).mul_add(b[i], x);
        }
        b[j] = x * A[j * n + j];
    }
}
