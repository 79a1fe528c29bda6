//! Positions in CasADi: vectors of nq numbers, which contain quaternions and points of a circle.
//!
//! A function f of a robot's position is defined only for quaternions and points of circles of length 1. For an
//! arbitrary vector q, f is evaluated at q̂: q with quaternions and points of circles divided by their lengths. The
//! derivatives of f with respect to q follow from its derivatives with respect to the tangent vector δ = q' ⊖ q̂, where
//! q' is the normalised q + dq. T contains the first derivatives of δ with respect to q, and C_k the second derivatives
//! of entry k of δ; e_k is the unit vector of entry k:
//!
//! ```text
//! δ = T dq + ½ Σ dqᵀ C_k dq e_k + …      ∂f/∂q = ∂f/∂δ T      ∂²f/∂q² = Tᵀ ∂²f/∂δ² T + Σ_k ∂f/∂δ_k C_k
//! ```

use condyle::{Joint, Model, Vec3, spatial::Mat3};
use core::ops::Range;
use nalgebra::{DMatrix, SMatrix};

/// The matrix T of one joint, in the leading rows and columns.
type Block = SMatrix<f64, 6, 7>;

/// The coordinates of a joint: the ranges of indices in q and in v.
#[derive(Clone, Debug)]
struct Group {
    joint: Joint,
    q: Range<usize>,
    v: Range<usize>,
}

impl Group {
    /// Returns the range of the coordinates that are a quaternion or a point of a circle.
    fn unit(&self) -> Option<Range<usize>> {
        let Range { start, end } = self.q;
        match self.joint {
            Joint::Continuous { .. } | Joint::Spherical => Some(start..end),
            Joint::Planar => Some(start + 2..end),
            Joint::FreeFlyer => Some(start + 3..end),
            _ => None,
        }
    }
}

/// The maps between a robot's position coordinates and its tangent coordinates, joint by joint.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    groups: Vec<Group>,
    pub(super) nq: usize,
    pub(super) nv: usize,
}

/// A position, and the matrix T at this position.
#[derive(Clone, Debug)]
pub(super) struct Position {
    /// The normalised position q̂, nq numbers.
    pub(super) q: Vec<f64>,
    /// For each group, the matrix T, which maps changes of the group's numbers in q to tangent vectors. T is set only
    /// for groups with a quaternion or a point of a circle.
    T: Vec<Block>,
    /// For each group, the length by which the group's quaternion or point of a circle was divided.
    lengths: Vec<f64>,
}

impl Chart {
    pub(super) fn new(model: &Model) -> Self {
        let own = model.bodies().iter().skip(1).filter(|body| body.mimic.is_none());
        let group = |body: &condyle::tree::Body| {
            let (q, v) = (body.idx_q..body.idx_q + body.joint.nq(), body.idx_v..body.idx_v + body.joint.nv());
            Group { joint: body.joint, q, v }
        };
        Self { groups: own.map(group).collect(), nq: model.nq(), nv: model.nv() }
    }

    /// Returns the chart of an argument that contains no position.
    pub(super) fn none() -> Self {
        Self { groups: Vec::new(), nq: 0, nv: 0 }
    }

    /// Returns whether positions contain neither quaternions nor points of circles. Then the map T from changes of q to
    /// tangent vectors is the identity, and q needs no normalisation.
    pub(super) fn is_flat(&self) -> bool {
        self.curved().next().is_none()
    }

    pub(super) fn position(&self) -> Position {
        let groups = self.groups.len();
        Position { q: vec![0.0; self.nq], T: vec![Block::zeros(); groups], lengths: vec![1.0; groups] }
    }

    /// Returns the indices of the tangent coordinates that depend on the coordinate with index `q`. The index counts
    /// the numbers of the position, then the numbers that follow the position.
    pub(super) fn moved_by(&self, q: usize) -> Range<usize> {
        if q >= self.nq {
            let own = q - self.nq + self.nv;
            return own..own + 1;
        }
        let group = self.groups.iter().find(|group| group.q.contains(&q)).expect("each coordinate is a joint's");
        match group.unit() {
            None => group.v.start + (q - group.q.start)..group.v.start + (q - group.q.start) + 1,
            Some(_) => group.v.clone(),
        }
    }

    /// Computes the normalised position q̂ and the matrix T at q.
    pub(super) fn update(&self, q: &[f64], at: &mut Position) {
        at.q.copy_from_slice(q);
        for (k, group) in self.groups.iter().enumerate() {
            let Some(unit) = group.unit() else { continue };
            let unit = &mut at.q[unit];
            let length = unit.iter().map(|x| x * x).sum::<f64>().sqrt();
            unit.iter_mut().for_each(|x| *x /= length);
            at.lengths[k] = length;
            at.T[k] = tangent_map(group.joint, &at.q[group.q.clone()], length);
        }
    }

    /// Computes Y = X T, where T maps changes of q to tangent vectors. X is the nv columns of the matrix `X` that begin
    /// at column `from`. The result is written to the nq columns of `Y` that begin at column `first`.
    pub(super) fn multiply(&self, at: &Position, X: &DMatrix<f64>, from: usize, Y: &mut DMatrix<f64>, first: usize) {
        for (group, T) in self.groups.iter().zip(&at.T) {
            if group.unit().is_none() {
                for (q, v) in group.q.clone().zip(group.v.clone()) {
                    Y.column_mut(first + q).copy_from(&X.column(from + v));
                }
                continue;
            }
            for (j, q) in group.q.clone().enumerate() {
                let mut column = Y.column_mut(first + q);
                column.fill(0.0);
                for (i, v) in group.v.clone().enumerate() {
                    column.axpy(T[(i, j)], &X.column(from + v), 1.0);
                }
            }
        }
    }

    /// Adds Σ_k g_k C_k to the nq rows and columns of H that begin at index `first`. g is a gradient with respect to
    /// tangent coordinates. C_k is the matrix of second derivatives of tangent coordinate k with respect to q.
    pub(super) fn add_curvature(&self, at: &Position, g: &[f64], H: &mut DMatrix<f64>, first: usize) {
        for (k, group) in self.groups.iter().enumerate() {
            let Some(unit) = group.unit() else { continue };
            let (T, q, start) = (&at.T[k], &at.q[unit.clone()], unit.start - group.q.start);
            let turns = group.v.len() - if q.len() == 4 { 3 } else { 1 }; // index of the first rotation in δ
            // for a rotation, δ = T dq (1 − q̂ᵀ dq / length) to second order, so its second derivatives are C = −(q̂ Tᵀ
            // + T q̂ᵀ) / length
            for i in 0..unit.len() {
                for j in 0..unit.len() {
                    let mut sum = 0.0;
                    for r in turns..group.v.len() {
                        let slope = g[group.v.start + r];
                        sum -= slope * (q[i] * T[(r, start + j)] + q[j] * T[(r, start + i)]);
                    }
                    H[(first + unit.start + i, first + unit.start + j)] += sum / at.lengths[k];
                }
            }
            // for translations δ_v = (1 − ½ δ_ω×) Rᵀ dp
            for a in 0..start {
                for j in 0..unit.len() {
                    let (p, w) = (T.column(a), T.column(start + j));
                    let half = if q.len() == 4 {
                        let (p, w) = (Vec3::new(p[0], p[1], p[2]), Vec3::new(w[3], w[4], w[5]));
                        w.cross(p).to_array()
                    } else {
                        [-w[2] * p[1], w[2] * p[0], 0.0]
                    };
                    let slopes = &g[group.v.start..][..turns];
                    let sum: f64 = slopes.iter().zip(half).map(|(g, half)| -0.5 * g * half).sum();
                    H[(first + group.q.start + a, first + unit.start + j)] += sum;
                    H[(first + unit.start + j, first + group.q.start + a)] += sum;
                }
            }
        }
    }
}

impl Chart {
    /// Iterates over the groups that have a quaternion or a point of a circle.
    fn curved(&self) -> impl Iterator<Item = &Group> {
        self.groups.iter().filter(|group| group.unit().is_some())
    }

    /// Computes the change E δ of the coordinates of q ⊕ δ, to first order in δ; E = ∂(q ⊕ δ)/∂δ at δ = 0.
    pub(super) fn push(&self, q: &[f64], delta: &[f64], out: &mut [f64]) {
        for group in self.groups.iter().filter(|group| group.unit().is_none()) {
            out[group.q.clone()].copy_from_slice(&delta[group.v.clone()]);
        }
        for group in self.curved() {
            let E = group.retraction(q);
            for (i, k) in group.q.clone().enumerate() {
                out[k] = group.v.clone().enumerate().map(|(j, v)| E[(j, i)] * delta[v]).sum();
            }
        }
    }

    /// Computes Eᵀ λ, with E = ∂(q ⊕ δ)/∂δ at δ = 0.
    pub(super) fn pull(&self, q: &[f64], lambda: &[f64], out: &mut [f64]) {
        for group in self.groups.iter().filter(|group| group.unit().is_none()) {
            out[group.v.clone()].copy_from_slice(&lambda[group.q.clone()]);
        }
        for group in self.curved() {
            let E = group.retraction(q);
            for (j, v) in group.v.clone().enumerate() {
                out[v] = group.q.clone().enumerate().map(|(i, k)| E[(j, i)] * lambda[k]).sum();
            }
        }
    }

    /// Calls `show` for each group with nonzero second derivatives λᵀ ∂²(q ⊕ δ)/∂δ². The arguments are the range of the
    /// group in v, and a matrix that has these derivatives in the leading rows and columns.
    pub(super) fn each_curvature(
        &self,
        q: &[f64],
        lambda: &[f64],
        mut show: impl FnMut(Range<usize>, &SMatrix<f64, 6, 6>),
    ) {
        for group in self.curved() {
            show(group.v.clone(), &group.curvature(&q[group.q.clone()], &lambda[group.q.clone()]));
        }
    }
}

impl Group {
    /// Returns Eᵀ at a normalised position, with E = ∂(q ⊕ δ)/∂δ. Let T = ∂δ/∂q, so T E = 1. The rows of T are
    /// orthogonal: they have length 1 for a translation and a circle, and length 2 for a quaternion. So Eᵀ is T with
    /// the rows of a quaternion divided by 4.
    fn retraction(&self, q: &[f64]) -> Block {
        let mut E = tangent_map(self.joint, &q[self.q.clone()], 1.0);
        let turns = self.unit().expect("a group that is none of numbers");
        if turns.len() == 4 {
            E.columns_mut(turns.start - self.q.start, 4).scale_mut(0.25);
        }
        E
    }

    /// Returns λᵀ ∂²(q ⊕ δ)/∂δ² for multipliers λ, where δ has a linear part δ_v and an angular part δ_ω. For a
    /// translation p and the body's rotation R, p ⊕ δ = p + R (δ_v + ½ δ_ω × δ_v + …). For a point of a circle or a
    /// quaternion q, q ⊕ δ_ω = q (1 − ½ (|δ_ω| / n)²) + E δ_ω + …, with n = 1 for the point and n = 2 for the
    /// quaternion.
    fn curvature(&self, q: &[f64], lambda: &[f64]) -> SMatrix<f64, 6, 6> {
        let mut C = SMatrix::zeros();
        let start = self.unit().map_or(0, |unit| unit.start - self.q.start);
        let (turns, along) = (start..self.v.len(), (start..q.len()).map(|k| q[k] * lambda[k]).sum::<f64>());
        let share = if q.len() - start == 4 { 0.25 } else { 1.0 };
        turns.clone().for_each(|k| C[(k, k)] = -share * along);
        if start > 0 {
            let T = tangent_map(self.joint, q, 1.0);
            let at = |i: usize| (0..start).map(|k| T[(i, k)] * lambda[k]).sum::<f64>(); // Rᵀ λ
            let half = match start {
                2 => Vec3::new(at(0), at(1), 0.0),
                _ => Vec3::new(at(0), at(1), at(2)),
            };
            for j in turns {
                let axis = match start {
                    2 => Vec3::new(0.0, 0.0, 1.0),
                    _ => Vec3::new(f64::from(j == 3), f64::from(j == 4), f64::from(j == 5)),
                };
                let column = half.cross(axis).to_array(); // λᵀR (ω × v) = vᵀ (Rᵀλ × ω)
                for i in 0..start {
                    (C[(i, j)], C[(j, i)]) = (0.5 * column[i], 0.5 * column[i]);
                }
            }
        }
        C
    }
}

/// Returns T of a joint at `q`, whose quaternion or point of a circle was divided by `length`.
fn tangent_map(joint: Joint, q: &[f64], length: f64) -> Block {
    let mut T = Block::zeros();
    match joint {
        Joint::Continuous { .. } => circle(&mut T, (0, 0), q[0], q[1], length),
        Joint::Planar => {
            let (c, s) = (q[2], q[3]);
            T[(0, 0)] = c;
            T[(0, 1)] = s;
            T[(1, 0)] = -s;
            T[(1, 1)] = c;
            circle(&mut T, (2, 2), c, s, length);
        }
        Joint::Spherical => quaternion(&mut T, (0, 0), q, length),
        Joint::FreeFlyer => {
            let R: Mat3<f64> = condyle::spatial::Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation();
            for (i, column) in [R.x, R.y, R.z].into_iter().enumerate() {
                for (j, x) in column.to_array().into_iter().enumerate() {
                    T[(i, j)] = x; // Rᵀ
                }
            }
            quaternion(&mut T, (3, 3), &q[3..], length);
        }
        _ => {}
    }
    T
}

/// Writes the row of T for a point (c, s) of a circle: δθ = (c ds − s dc) / length.
fn circle(T: &mut Block, (i, j): (usize, usize), c: f64, s: f64, length: f64) {
    T[(i, j)] = -s / length;
    T[(i, j + 1)] = c / length;
}

/// Writes the three rows of T for a quaternion: δω = 2 vec(q̂* dq) / length.
fn quaternion(T: &mut Block, (i, j): (usize, usize), q: &[f64], length: f64) {
    let [x, y, z, w] = [q[0], q[1], q[2], q[3]].map(|x| 2.0 * x / length);
    let rows = [[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]];
    for (r, row) in rows.into_iter().enumerate() {
        for (c, x) in row.into_iter().enumerate() {
            T[(i + r, j + c)] = x;
        }
    }
}
