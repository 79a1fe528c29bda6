//! Kinematic residuals and their Jacobians, for one knot or for several knots in the lanes of a SIMD register. Each
//! kind of residual has its own function, compiled for the SIMD level of the scalar.
#![allow(non_snake_case)] // names follow the literature: J, R, X

use super::layout::{Plan, ROWS, STRIDE, row_width};
use super::residual::Residual;
use super::terms::KnotTerms;
use crate::robot::knot_data::{KnotData, WIDEST, unpack, unpack_matrix};
use condyle_dynamics::distances::prepared::{
    NUMBERS, Near, PreparedPairs, RESULT, find_near, other_results, pair_distances, pair_rows, place_shapes,
};
use condyle_dynamics::{
    Data, Model, Placements, ReferenceFrame, Velocities, centroidal_derivatives, centroidal_map, forward_kinematics,
    forward_velocities,
};
use condyle_spatial::block::{Block, Strided, gather_rows};
use condyle_spatial::{Force, Mat3, Matrix, Motion, Quaternion, Scalar, Se3, Vec3, kernel, lie, matrix};

/// Group of knots whose residuals read the same quantities.
pub(crate) struct KnotGroup<'a> {
    /// Terms of each knot.
    pub terms: &'a [KnotTerms<'a>],
    /// Data of each knot.
    pub data: &'a mut [KnotData],
    /// Whether Jacobians are computed.
    pub slopes: bool,
    /// Whether the last kinematic pass was computed at the positions of these knots.
    pub visited: bool,
}

impl KnotGroup<'_> {
    /// Calls `visit` for each kinematic residual that has a weight above 0 at one or more knots. The two numbers are
    /// the index of the list (costs or limits), and the index of the residual in this list.
    fn each(&mut self, mut visit: impl FnMut(&mut Self, [usize; 2], &Residual, &Plan)) {
        let (first, terms) = (self.terms[0], self.terms);
        for list in 0..2 {
            let weight = |k: &KnotTerms<'_>, i| k.0[list].kinematic(i).map_or(0.0, |(_, weight, _)| weight);
            let mut i = 0;
            while let Some((residual, _, plan)) = first.0[list].kinematic(i) {
                if terms.iter().any(|knot| weight(knot, i) != 0.0) {
                    visit(self, [list, i], residual, plan);
                }
                i += 1;
            }
        }
    }

    /// Writes the Jacobian of a residual: the first rows of ∂r/∂v, if the residual depends on v, and of ∂r/∂q.
    fn write_rows<S: Block<Number = f64>>(
        &mut self,
        list: usize,
        residual: &Residual,
        plan: &Plan,
        [by_v, by_q]: [&Matrix<S>; 2],
    ) {
        let (nv, width) = (by_q.ncols(), row_width(by_q.ncols(), residual));
        for (J, column) in [(by_v, 0), (by_q, width - nv)].into_iter().skip(usize::from(width == nv)) {
            let (strides, shape) = ([1, J.nrows()], [plan.n, nv]);
            let from = Strided { vectors: J.as_slice(), strides, shape, negative: false };
            let at = plan.slot * ROWS * nv + column;
            unpack_matrix(&from, self.data, width, |data| &mut data.residuals.kinematic[list].rows[at..]);
        }
    }
}

/// Workspace of kinematic residuals.
#[derive(Debug)]
pub(crate) struct ResidualKernel<S> {
    /// Entries of the residuals' targets, one lane per knot.
    t: [S; 12],
    r: [S; STRIDE],
    /// Jacobians ∂r/∂v and ∂r/∂q. Shape: 6 × nv.
    J: [Matrix<S>; 2],
    /// Jacobian ∂c/∂q of the centre of mass. Shape: 3 × nv.
    Jcom: Matrix<S>,
    /// Vector of zeros. Shape: nv.
    zero: Vec<S>,
    distances: DistanceBuffers<S>,
}

/// Workspace of distances. Grows to the largest number of pairs.
#[derive(Debug)]
struct DistanceBuffers<S> {
    /// Numbers of all shapes, first in their bodies, then in the world. Shape: shapes × [`NUMBERS`].
    shapes: Vec<S>,
    /// Distance, witness point and normal of each pair. Shape: pairs × [`RESULT`].
    results: Vec<S>,
    /// Pairs within the range in some lane.
    near: Near,
    /// Distances. Shape: pairs.
    r: Vec<S>,
    /// Rows of the Jacobian. Shape: pairs × nv.
    rows: Vec<S>,
}

impl<S: Scalar> DistanceBuffers<S> {
    /// Makes the workspace large enough for pairs. Allocates only if there were never as many pairs or shapes.
    fn reserve(&mut self, pairs: &PreparedPairs, nv: usize) {
        let (n, shapes) = (pairs.len(), pairs.shape_count());
        let sizes = [shapes * NUMBERS, n * RESULT, n, n * nv];
        for (numbers, size) in [&mut self.shapes, &mut self.results, &mut self.r, &mut self.rows].into_iter().zip(sizes)
        {
            if numbers.len() < size {
                numbers.resize(size, S::zero());
            }
        }
    }
}

impl<S: Block<Number = f64>> ResidualKernel<S> {
    /// Allocates the workspace for a robot with nv coordinates.
    pub(crate) fn new(nv: usize) -> Self {
        let wide = |rows| matrix(rows, nv, S::zero());
        Self {
            t: [S::zero(); 12],
            r: [S::zero(); STRIDE],
            J: [wide(6), wide(6)],
            Jcom: wide(3),
            zero: vec![S::zero(); nv],
            distances: DistanceBuffers {
                shapes: vec![],
                results: vec![],
                near: Near::default(),
                r: vec![],
                rows: vec![],
            },
        }
    }

    /// Computes the kinematic residuals of the knots of `group` at (q, v), and the rows of their Jacobians.
    pub(crate) fn run(&mut self, model: &Model, data: &mut Data<S>, [q, v]: [&[S]; 2], group: &mut KnotGroup<'_>) {
        let Self { t, r, J, Jcom, zero, distances } = self;
        let requirements = group.terms[0].layout().requirements;
        if group.slopes && requirements.com {
            center_of_mass_jacobian(model, data, q, Jcom);
            group.visited = true;
            group.each(|group, [list, _], residual, plan| {
                if matches!(residual, Residual::CenterOfMass { .. }) {
                    group.write_rows(list, residual, plan, [Jcom, Jcom]);
                }
            });
        }
        if group.slopes && requirements.momentum {
            centroidal_momentum_derivatives(model, data, q, v, zero, J);
            group.each(|group, [list, _], residual, plan| {
                if matches!(residual, Residual::CentroidalMomentum { .. }) {
                    group.write_rows(list, residual, plan, [&J[0], &J[1]]);
                }
            });
        }
        let (placements, velocities) = if requirements.velocities {
            let velocities = forward_velocities(model, data, q, v);
            (*velocities, Some(velocities))
        } else {
            if !group.visited || data.placements(model).is_none() {
                forward_kinematics(model, data, q);
            }
            (data.placements(model).expect("kinematics place the bodies"), None)
        };
        group.each(|group, [list, i], residual, plan| {
            if let Residual::Distances { .. } = residual {
                return write_distances(model, placements, group, [list, i], plan, distances);
            }
            if S::LANES == 1 {
                gather_rows(&[&residual.target_numbers()], t);
            } else {
                let target = |k: usize| group.terms.get(k).and_then(|terms| terms.0[list].kinematic(i));
                let numbers: [_; WIDEST] =
                    core::array::from_fn(|k| target(k).map_or([0.0; 12], |(residual, ..)| residual.target_numbers()));
                gather_rows(&numbers.each_ref().map(<[f64; 12]>::as_slice)[..group.terms.len()], t);
            }
            let (frame, slopes) = (plan.frame, group.slopes);
            let velocities = || velocities.expect("velocities are computed where a residual needs them");
            match *residual {
                Residual::CenterOfMass { .. } => center_of_mass(placements, t, r),
                Residual::CentroidalMomentum { .. } => centroidal_momentum(velocities(), t, r),
                Residual::FramePlacement { .. } => frame_placement(placements, frame, t, r, slopes, J),
                Residual::FrameTranslation { .. } => frame_translation(placements, frame, t, r, slopes, J),
                Residual::FrameRotation { .. } => frame_rotation(placements, frame, t, r, slopes, J),
                Residual::FrameVelocity { reference, .. } => {
                    frame_velocity(velocities(), frame, reference, t, r, slopes, J);
                }
                Residual::HeadingVelocity { .. } => heading_velocity(velocities(), frame, t, r, slopes, J),
                Residual::Tilt { .. } => tilt(placements, frame, t, r, slopes, J),
                _ => unreachable!("it does not look at kinematics"),
            }
            let at = plan.slot * STRIDE;
            unpack(r, group.data, |data| &mut data.residuals.kinematic[list].r[at..]);
            if group.slopes && residual.frame().is_some() {
                group.write_rows(list, residual, plan, [&J[0], &J[1]]);
            }
        });
    }
}

/// Computes the distances of residual i of a list, and the rows of their Jacobian. All knots of the group have the
/// pairs of bodies and the methods of `plan`, but the geometries may differ.
fn write_distances<S: Block<Number = f64>>(
    model: &Model,
    placements: Placements<'_, S>,
    group: &mut KnotGroup<'_>,
    [list, i]: [usize; 2],
    plan: &Plan,
    buffers: &mut DistanceBuffers<S>,
) {
    let (all, pairs, nv, count) = (group.terms, &plan.pairs, model.nv(), group.terms.len());
    let of = |knot: usize| {
        let terms = all.get(knot).unwrap_or(&all[0]);
        terms.0[list].kinematic(i).map_or(pairs, |(.., plan)| &plan.pairs)
    };
    buffers.reserve(pairs, nv);
    let DistanceBuffers { shapes, results, near, r, rows } = buffers;
    near.reset(plan.range, pairs.len());
    let shapes = &mut shapes[..pairs.shape_count() * NUMBERS];
    let results = &mut results[..pairs.len() * RESULT];
    let is_common = (0..count).all(|knot| core::ptr::eq(of(knot), pairs));
    for (k, shape) in shapes.chunks_exact_mut(NUMBERS).enumerate().take(if is_common { 0 } else { usize::MAX }) {
        let numbers = core::array::from_fn::<_, WIDEST, _>(|knot| of(knot).numbers(k));
        gather_rows(&numbers.each_ref().map(<[f64; NUMBERS]>::as_slice)[..count], shape);
    }
    place_shapes(placements, pairs, is_common, shapes);
    find_near(pairs, shapes, near);
    pair_distances(pairs, shapes, near, results);
    other_results(placements, &of, count, near, results);
    for (r, result) in r.iter_mut().zip(results.chunks_exact(RESULT)) {
        *r = result[0];
    }
    let at = plan.slot * STRIDE;
    unpack(&r[..pairs.len()], group.data, |data| &mut data.residuals.kinematic[list].r[at..]);
    if group.slopes {
        let rows = &mut rows[..pairs.len() * nv];
        pair_rows(placements, pairs, near, results, rows);
        let at = plan.slot * ROWS * nv;
        unpack(rows, group.data, |data| &mut data.residuals.kinematic[list].rows[at..]);
    }
}

kernel! {
    /// Computes the Jacobian ∂c/∂q of the centre of mass c.
    fn center_of_mass_jacobian<S>(model: &Model, data: &mut Data<S>, q: &[S], Jcom: &mut Matrix<S>) {
        Jcom.as_mut_slice().copy_from_slice(centroidal_map(model, data, q).Jcom.as_slice());
    }
}

kernel! {
    /// Computes the derivatives ∂h_G/∂v and ∂h_G/∂q of the centroidal momentum h_G.
    fn centroidal_momentum_derivatives<S>(
        model: &Model, data: &mut Data<S>, q: &[S], v: &[S], zero: &[S], J: &mut [Matrix<S>; 2],
    ) {
        let d = centroidal_derivatives(model, data, q, v, zero);
        J[0].as_mut_slice().copy_from_slice(d.dh_dv.as_slice());
        J[1].as_mut_slice().copy_from_slice(d.dh_dq.as_slice());
    }
}

kernel! {
    /// Computes the error c − c_ref of the centre of mass.
    fn center_of_mass<S>(placements: Placements<'_, S>, t: &[S; 12], r: &mut [S; STRIDE]) {
        r[..3].copy_from_slice(&(placements.com() - vector(t, 0)).to_array());
    }
}

kernel! {
    /// Computes the error h_G − h_ref of the centroidal momentum.
    fn centroidal_momentum<S>(velocities: Velocities<'_, S>, t: &[S; 12], r: &mut [S; STRIDE]) {
        let momentum = velocities.centroidal_momentum() - Force::new(vector(t, 0), vector(t, 3));
        r[..6].copy_from_slice(&momentum.to_array());
    }
}

kernel! {
    /// Computes the error log(refXo oXf) of a frame's placement, and its Jacobian Jlog J.
    fn frame_placement<S>(
        placements: Placements<'_, S>, frame: usize, t: &[S; 12], r: &mut [S; STRIDE], slopes: bool,
        J: &mut [Matrix<S>; 2],
    ) {
        let X = Se3::new(rotation(t), vector(t, 0)).inverse() * placements.frame(frame);
        let twist = lie::log6(Quaternion::from_rotation(X.rotation), X.translation);
        r[..6].copy_from_slice(&twist.to_array());
        if slopes {
            placements.frame_jacobian(frame, ReferenceFrame::Local, &mut J[1]);
            let Jlog = lie::jlog6(twist);
            for column in J[1].as_mut_slice().chunks_exact_mut(6) {
                let m = Motion::from([column[0], column[1], column[2], column[3], column[4], column[5]]);
                column.copy_from_slice(&(Jlog * m).to_array());
            }
        }
    }
}

kernel! {
    /// Computes the error p − p_ref of a frame's position, and its Jacobian.
    fn frame_translation<S>(
        placements: Placements<'_, S>, frame: usize, t: &[S; 12], r: &mut [S; STRIDE], slopes: bool,
        J: &mut [Matrix<S>; 2],
    ) {
        r[..3].copy_from_slice(&(placements.frame(frame).translation - vector(t, 0)).to_array());
        if slopes {
            placements.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, &mut J[1]);
        }
    }
}

kernel! {
    /// Computes the error log(R_refᵀ R) of a frame's rotation, and its Jacobian Jlog J.
    fn frame_rotation<S>(
        placements: Placements<'_, S>, frame: usize, t: &[S; 12], r: &mut [S; STRIDE], slopes: bool,
        J: &mut [Matrix<S>; 2],
    ) {
        let R = rotation(t).transpose() * placements.frame(frame).rotation;
        let angles = lie::log3(Quaternion::from_rotation(R));
        r[..3].copy_from_slice(&angles.to_array());
        if slopes {
            placements.frame_jacobian(frame, ReferenceFrame::Local, &mut J[1]);
            let Jlog = lie::jlog3(angles);
            for column in J[1].as_mut_slice().chunks_exact_mut(6) {
                let turned = Jlog * Vec3::new(column[3], column[4], column[5]);
                column[..3].copy_from_slice(&turned.to_array());
            }
        }
    }
}

kernel! {
    /// Computes the error v − v_ref of a frame's velocity, and its Jacobians ∂v/∂q̇ and ∂v/∂q.
    fn frame_velocity<S>(
        velocities: Velocities<'_, S>, frame: usize, reference: ReferenceFrame, t: &[S; 12], r: &mut [S; STRIDE],
        slopes: bool, J: &mut [Matrix<S>; 2],
    ) {
        let v = velocities.frame_velocity(frame, reference) - Motion::new(vector(t, 0), vector(t, 3));
        r[..6].copy_from_slice(&v.to_array());
        if slopes {
            velocities.frame_jacobian(frame, reference, &mut J[0]);
            velocities.frame_velocity_derivative(frame, reference, &mut J[1]);
        }
    }
}

/// Square of the horizontal part of a unit vector below which it counts as vertical, without a heading.
const VERTICAL: f64 = 1e-24;

kernel! {
    /// Computes the error Rz(ψ)ᵀ v − v_ref of a frame's velocity in its heading frame, and its Jacobians with respect
    /// to q̇ and q:
    ///
    /// ```text
    /// ∂(Rzᵀ v)/∂q = Rzᵀ ∂v/∂q − e_z × (Rzᵀ v) ∂ψ/∂q,   ∂ψ/∂q = ω_z − a_z (a_x ω_x + a_y ω_y) / (a_x² + a_y²)
    /// ```
    ///
    /// a is the frame's x axis, and ω the angular part of its Jacobian.
    fn heading_velocity<S>(
        velocities: Velocities<'_, S>, frame: usize, t: &[S; 12], r: &mut [S; STRIDE], slopes: bool,
        J: &mut [Matrix<S>; 2],
    ) {
        let reference = ReferenceFrame::LocalWorldAligned;
        let a = velocities.frame(frame).rotation.x;
        let square = a.x * a.x + a.y * a.y;
        let vertical = square.lt(S::splat(VERTICAL));
        let inverse = S::select(vertical, S::one(), square).sqrt().recip();
        let c = S::select(vertical, S::one(), a.x * inverse);
        let s = S::select(vertical, S::zero(), a.y * inverse);
        let v = velocities.frame_velocity(frame, reference).to_array();
        let ([x, y], [p, q]) = (turned(c, s, v[0], v[1]), turned(c, s, v[3], v[4]));
        let v = [x, y, v[2], p, q, v[5]];
        for k in 0..6 {
            r[k] = v[k] - t[k];
        }
        if slopes {
            let [by_v, by_q] = J;
            velocities.frame_jacobian(frame, reference, by_v);
            velocities.frame_velocity_derivative(frame, reference, by_q);
            let (by_v, by_q) = (by_v.as_mut_slice(), by_q.as_mut_slice());
            for (by_v, by_q) in by_v.chunks_exact_mut(6).zip(by_q.chunks_exact_mut(6)) {
                let along = a.z * (a.x * by_v[3] + a.y * by_v[4]) * inverse * inverse;
                let dpsi = S::select(vertical, S::zero(), by_v[5] - along);
                for k in [0, 3] {
                    [by_v[k], by_v[k + 1]] = turned(c, s, by_v[k], by_v[k + 1]);
                    [by_q[k], by_q[k + 1]] = turned(c, s, by_q[k], by_q[k + 1]);
                    by_q[k] += v[k + 1] * dpsi; // −e_z × (x, y, z) = (y, −x, 0)
                    by_q[k + 1] -= v[k] * dpsi;
                }
            }
        }
    }
}

kernel! {
    /// Computes the tilt Rᵀ e_z − up of a frame, and its Jacobian (Rᵀ e_z) × ω with the angular velocity ω along the
    /// axes of the frame.
    fn tilt<S>(
        placements: Placements<'_, S>, frame: usize, t: &[S; 12], r: &mut [S; STRIDE], slopes: bool,
        J: &mut [Matrix<S>; 2],
    ) {
        let R = placements.frame(frame).rotation;
        let vertical = Vec3::new(R.x.z, R.y.z, R.z.z);
        r[..3].copy_from_slice(&(vertical - vector(t, 0)).to_array());
        if slopes {
            placements.frame_jacobian(frame, ReferenceFrame::Local, &mut J[1]);
            for column in J[1].as_mut_slice().chunks_exact_mut(6) {
                let turned = vertical.cross(Vec3::new(column[3], column[4], column[5]));
                column[..3].copy_from_slice(&turned.to_array());
            }
        }
    }
}

/// Returns Rz(ψ)ᵀ (x, y) for c = cos ψ and s = sin ψ.
#[inline(always)]
fn turned<S: Scalar>(c: S, s: S, x: S, y: S) -> [S; 2] {
    [c * x + s * y, c * y - s * x]
}

/// Returns three entries of a target, from index k on.
#[inline(always)]
fn vector<S: Scalar>(t: &[S; 12], k: usize) -> Vec3<S> {
    Vec3::new(t[k], t[k + 1], t[k + 2])
}

/// Returns the rotation from the entries of a target.
#[inline(always)]
fn rotation<S: Scalar>(t: &[S; 12]) -> Mat3<S> {
    Mat3 { x: vector(t, 3), y: vector(t, 6), z: vector(t, 9) }
}
