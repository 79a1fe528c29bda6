//! Step of a robot in contact with the ground. The step computes the gaps, the Jacobians and the Delassus matrix of the
//! points that may touch, the impulses of these points, and the correction of penetration. [`Ground`] documents the
//! model and the equations; `contact_solver.rs` computes the impulses.

use super::Status;
use super::contact_solver::{ContactSolver, Outcome};
use super::ground::{Ground, GroundContact};
use crate::calls::inertia::crba;
use crate::calls::kinematics::forward_kinematics;
use crate::data::Data;
use alloc::vec::Vec;
use condyle_linalg::{Ltdl, dot};
use condyle_model::{Error, Model};
use condyle_spatial::{Act, Matrix, Vec3, matrix};

/// Maximum distance between a point and the plane at which the point counts as touching (m). A resting point moves by
/// less than this distance, because of the solver's tolerance (1e-12 m per step). If such small distances counted as
/// gaps, the load would jump between the corners of a sole.
const RESTING: f64 = 1e-7;
/// Fraction of the penetration depth that is corrected in each step.
const OUT: f64 = 0.2;
/// Maximum speed at which the correction moves a penetrating point towards the surface (m/s).
const OUT_SPEED: f64 = 0.5;
/// Minimum impact speed at which a point bounces, as a multiple of the speed that gravity produces in a step. Without
/// this minimum, a resting point with restitution would bounce in every step.
const REST: f64 = 2.0;

/// Function that computes a step on the ground: [`Contacts::advance`].
type Step = fn(&mut Contacts, &Model, &mut Data<f64>, f64, (&[f64], &[f64]), &mut [f64]) -> Status;

/// Memory for the contacts between one robot and the ground. P is the number of points.
#[derive(Clone, Debug)]
pub(super) struct Contacts {
    pub ground: Ground,
    /// Pointer to [`advance`](Self::advance). Because the function is called through a pointer, the linker can omit the
    /// code of contacts from programs that never set a ground.
    pub step: Step,
    /// Axes of the contact forces: two unit vectors along the plane, and the normal of the plane.
    axes: [Vec3<f64>; 3],
    /// Impulses of all points in the last step, along `axes` (N s). Shape: 3P. Written by: `advance`.
    pub impulses: Vec<f64>,
    /// Contact of each point in the last step. Shape: P. Written by: `advance`.
    pub results: Vec<GroundContact>,
    /// Velocity w that corrects penetration. It is added to the velocity only for the displacement of the step. Shape:
    /// nv. Written by: `advance`.
    pub correction: Vec<f64>,
    /// Jacobian J of one point along the axes of the world. Shape: 3 × nv.
    jacobian: Matrix<f64>,
    /// Jacobians of all points along `axes`, stored by rows. Shape: 3P × nv.
    J: Vec<f64>,
    /// Rows of J M⁻¹ of the active points, in the order of `active`, stored like `J`.
    Y: Vec<f64>,
    /// Gaps φ, the distances of the points to the plane (m); 0 if a distance is less than `RESTING`. Shape: P.
    gaps: Vec<f64>,
    positions: Vec<Vec3<f64>>,
    /// Indices of the active points, in the order of activation. The solver computes impulses for these points only.
    /// Shape: up to P.
    active: Vec<usize>,
    factor: Ltdl<f64>,
    solver: ContactSolver,
}

impl Contacts {
    /// Allocates memory for the contacts with a ground.
    pub(super) fn new(model: &Model, ground: Ground) -> Result<Self, Error> {
        let ground = ground.checked(model)?;
        let (points, nv) = (ground.points.len(), model.nv());
        let nothing = GroundContact { position: Vec3::zero(), force: Vec3::zero(), touches: false };
        Ok(Self {
            axes: axes(ground.normal),
            impulses: vec![0.0; 3 * points],
            results: vec![nothing; points],
            correction: vec![0.0; nv],
            jacobian: matrix(3, nv, 0.0),
            J: vec![0.0; 3 * points * nv],
            Y: vec![0.0; 3 * points * nv],
            gaps: vec![0.0; points],
            positions: vec![Vec3::zero(); points],
            active: Vec::with_capacity(points),
            factor: Ltdl::new(model),
            solver: ContactSolver::new(points),
            step: Self::advance,
            ground,
        })
    }

    /// Clears the results of the last step. The next step then depends only on the state.
    pub(super) fn reset(&mut self) {
        self.impulses.fill(0.0);
        let nothing = GroundContact { position: Vec3::zero(), force: Vec3::zero(), touches: false };
        self.results.fill(nothing);
    }

    /// Replaces v_next, the velocity after a step without contacts, by the velocity after a step with contacts. q and v
    /// are the state before the step.
    fn advance(
        &mut self,
        model: &Model,
        data: &mut Data<f64>,
        h: f64,
        (q, v): (&[f64], &[f64]),
        v_next: &mut [f64],
    ) -> Status {
        self.correction.fill(0.0);
        if !v_next.iter().all(|v| v.is_finite()) {
            return Status::Done; // the caller reports numbers that are not finite
        }
        self.place(model, data, q);
        self.factor.factorize(crba(model, data, q));
        self.active.clear();
        for i in 0..self.gaps.len() {
            // Activate a point that would be below the plane, or that had an impulse in the last step.
            let reached = self.gaps[i] + h * self.normal_speed(i, v_next);
            if reached < 0.0 || self.impulses[3 * i + 2] > 0.0 {
                self.add(i);
            }
        }
        let rest = REST * h * model.gravity().norm();
        let outcome = loop {
            let outcome = self.solve(h, v, v_next, rest);
            // Activate further points that the impulses of the active points would push below the plane.
            let before = self.active.len();
            for i in 0..self.gaps.len() {
                let reached = self.gaps[i] + h * self.speed_after(i, v_next);
                if reached < -h * self.ground.tolerance && !self.active.contains(&i) {
                    self.add(i);
                }
            }
            if self.active.len() == before {
                break outcome;
            }
        };
        self.record(h, v_next);
        self.correct(h, v_next);
        match outcome {
            Outcome::Solved => Status::Done,
            Outcome::NotSolved(error) => Status::ContactsNotConverged { error },
        }
    }

    /// Computes positions, gaps and Jacobians of all points.
    fn place(&mut self, model: &Model, data: &mut Data<f64>, q: &[f64]) {
        let nv = model.nv();
        let placements = forward_kinematics(model, data, q);
        for (i, point) in self.ground.points.iter().enumerate() {
            let p = placements.frame(point.frame).act(point.position);
            self.positions[i] = p;
            let gap = self.ground.normal.dot(p) - self.ground.height; // φ = n · p − height
            self.gaps[i] = if gap.abs() <= RESTING { 0.0 } else { gap };
            placements.frame_point_jacobian(point.frame, point.position, &mut self.jacobian);
            for (k, axis) in self.axes.iter().enumerate() {
                let row = &mut self.J[(3 * i + k) * nv..][..nv];
                for (J, column) in row.iter_mut().zip(self.jacobian.as_slice().chunks_exact(3)) {
                    *J = axis.dot(Vec3::new(column[0], column[1], column[2]));
                }
            }
        }
    }

    /// Returns row k of the Jacobian J of point i.
    fn row(&self, i: usize, k: usize) -> &[f64] {
        let nv = self.correction.len();
        &self.J[(3 * i + k) * nv..][..nv]
    }

    /// Activates point i and computes the point's rows of J M⁻¹, with the Jacobian J of all points.
    fn add(&mut self, i: usize) {
        let (nv, at) = (self.correction.len(), 3 * self.active.len());
        for k in 0..3 {
            let (from, to) = ((3 * i + k) * nv, (at + k) * nv);
            self.Y[to..to + nv].copy_from_slice(&self.J[from..from + nv]);
            self.factor.solve(&mut self.Y[to..to + nv]);
        }
        self.active.push(i);
    }

    /// Returns J_n v, the normal speed of point i at the velocity v.
    fn normal_speed(&self, i: usize, v: &[f64]) -> f64 {
        dot(self.row(i, 2), v)
    }

    /// Returns J_n (v + M⁻¹ Jᵀ λ), the normal speed of point i after the impulses λ of the active points.
    fn speed_after(&self, i: usize, v: &[f64]) -> f64 {
        let (nv, row) = (v.len(), self.row(i, 2));
        let pushes = self.Y.chunks_exact(nv.max(1)).zip(&self.solver.impulses).take(3 * self.active.len());
        pushes.fold(dot(row, v), |sum, (Y, &impulse)| sum + impulse * dot(row, Y))
    }

    /// Computes the impulses of the active points, with G = J M⁻¹ Jᵀ and b = J v_next plus terms for gaps and
    /// restitution.
    fn solve(&mut self, h: f64, v: &[f64], v_next: &[f64], rest: f64) -> Outcome {
        let (nv, points) = (v.len(), self.active.len());
        let n = 3 * points;
        for a in 0..n {
            let (i, k) = (self.active[a / 3], a % 3);
            let mut b = dot(self.row(i, k), v_next);
            if k == 2 {
                let (gap, speed) = (self.gaps[i].max(0.0), -self.normal_speed(i, v));
                let back = self.ground.restitution * speed;
                let hits = self.ground.restitution > 0.0 && speed > rest && self.gaps[i] + h * b < 0.0;
                b += if hits { -back } else { gap / h }; // u_n⁺ ≥ e s, or u_n⁺ + max(φ, 0)/h ≥ 0
            }
            for c in 0..=a {
                let g = dot(self.row(i, k), &self.Y[c * nv..][..nv]);
                self.solver.G[c * n + a] = g;
                self.solver.G[a * n + c] = g;
            }
            self.solver.b[a] = b;
            self.solver.impulses[a] = self.impulses[3 * i + k]; // initial guess
        }
        let Ground { friction, tolerance, max_iterations, .. } = self.ground;
        self.solver.solve(points, friction, tolerance, max_iterations)
    }

    /// Computes the velocity after the contacts, v⁺ = v_next + M⁻¹ Jᵀ λ, and stores the mean forces λ/h, where h is the
    /// step length.
    fn record(&mut self, h: f64, v_next: &mut [f64]) {
        let nv = v_next.len();
        self.impulses.fill(0.0);
        for (contact, &position) in self.results.iter_mut().zip(&self.positions) {
            *contact = GroundContact { position, force: Vec3::zero(), touches: false };
        }
        for (at, &i) in self.active.iter().enumerate() {
            let mut force = Vec3::zero();
            for k in 0..3 {
                let impulse = self.solver.impulses[3 * at + k];
                self.impulses[3 * i + k] = impulse;
                force = self.axes[k].scale_add(impulse / h, force);
                let Y = &self.Y[(3 * at + k) * nv..][..nv];
                v_next.iter_mut().zip(Y).for_each(|(v, y)| *v += impulse * y);
            }
            self.results[i].force = force;
            self.results[i].touches = self.impulses[3 * i + 2] > 0.0;
        }
    }

    /// Computes the correction w = M⁻¹ J_nᵀ π. The impulses π solve a contact problem without friction: 0 ≤ π ⊥ J_n (v⁺
    /// + w) − (corrected fraction of the depth)/h ≥ 0.
    fn correct(&mut self, h: f64, v_next: &[f64]) {
        let (nv, points) = (v_next.len(), self.active.len());
        let mut deep = false;
        for (at, &i) in self.active.iter().enumerate() {
            let out = (OUT * (-self.gaps[i]).max(0.0) / h).min(OUT_SPEED);
            let speed = dot(&self.J[(3 * i + 2) * nv..][..nv], v_next) + self.gaps[i].max(0.0) / h;
            deep |= speed < out - self.ground.tolerance;
            self.solver.b[3 * at..][..3].copy_from_slice(&[0.0, 0.0, speed - out]);
            self.solver.impulses[3 * at..][..3].fill(0.0);
        }
        if !deep {
            return;
        }
        let Ground { tolerance, max_iterations, .. } = self.ground;
        self.solver.solve(points, 0.0, tolerance, max_iterations);
        for (Y, &push) in self.Y.chunks_exact(nv).zip(&self.solver.impulses).take(3 * points) {
            self.correction.iter_mut().zip(Y).for_each(|(w, y)| *w += push * y);
        }
    }
}

/// Returns three axes: two orthogonal unit vectors perpendicular to n, and n. For n = z, the first two axes are x and
/// y.
fn axes(n: Vec3<f64>) -> [Vec3<f64>; 3] {
    // The method of Duff et al. (2017) avoids cancellation for every n.
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let first = Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    [first, Vec3::new(b, sign + n.y * n.y * a, -n.y), n]
}
