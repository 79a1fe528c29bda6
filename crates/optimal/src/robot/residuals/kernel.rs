//! Residuals of kinematics with their Jacobians, for several knots side by side in the lanes of a vector register, or for
//! one. Each kind of residual is a function of its own, compiled for the level of its scalar.
#![allow(non_snake_case)] // J, R, X

use super::layout::{Plan, ROWS, STRIDE, row_width};
use super::residual::Residual;
use super::terms::KnotTerms;
use crate::robot::knot::{KnotData, WIDEST, unpack, unpack_matrix};
use condyle_dynamics::{
    Data, Model, Placements, ReferenceFrame, Velocities, centroidal_derivatives, centroidal_map, forward_kinematics,
    forward_velocities,
};
use condyle_spatial::block::{Block, Strided};
use condyle_spatial::block_kernel;
use condyle_spatial::{Force, Mat3, Motion, Quaternion, Se3, Vec3, lie};
use nalgebra::DMatrix;

/// Some knots whose residuals look at the same.
pub(crate) struct KnotGroup<'a> {
    /// The terms of each knot.
    pub terms: &'a [KnotTerms<'a>],
    /// The data of each knot.
    pub data: &'a mut [KnotData],
    /// Whether Jacobians are asked for.
    pub slopes: bool,
    /// Whether the last pass was at the positions of these knots.
    pub visited: bool,
}

impl KnotGroup<'_> {
    /// Calls a function for each residual of kinematics that has a weight at some knot: with its list and its number there.
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

    /// Writes the Jacobian of a residual: the first rows of ∂r/∂v, if it depends on v, and of ∂r/∂q.
    fn write_rows<S: Block<Number = f64>>(
        &mut self,
        list: usize,
        residual: &Residual,
        plan: &Plan,
        [by_v, by_q]: [&DMatrix<S>; 2],
    ) {
        let (nv, width) = (by_q.ncols(), row_width(by_q.ncols(), residual));
        for (J, column) in [(by_v, 0), (by_q, width - nv)].into_iter().skip(usize::from(width == nv)) {
            let (strides, shape) = ([1, J.nrows()], [plan.n, nv]);
            let from = Strided { vectors: J.as_slice(), strides, shape, negative: false };
            let at = plan.index * ROWS * nv + column;
            unpack_matrix(&from, self.data, width, |data| &mut data.residuals.kinematic[list].rows[at..]);
        }
    }
}

/// Scratch of residuals of kinematics.
#[derive(Clone, Debug)]
pub(crate) struct ResidualKernel<S> {
    r: [S; STRIDE],
    /// ∂r/∂v and ∂r/∂q. Shape: 6 × nv.
    J: [DMatrix<S>; 2],
    /// ∂c/∂q. Shape: 3 × nv.
    Jcom: DMatrix<S>,
    /// Zeros. Shape: nv.
    zero: Vec<S>,
}

impl<S: Block<Number = f64>> ResidualKernel<S> {
    /// Scratch for a robot with nv coordinates.
    pub(crate) fn new(nv: usize) -> Self {
        let wide = |rows| DMatrix::from_element(rows, nv, S::zero());
        Self { r: [S::zero(); STRIDE], J: [wide(6), wide(6)], Jcom: wide(3), zero: vec![S::zero(); nv] }
    }

    /// Computes the residuals of kinematics of some knots at (q, v), and the rows of their Jacobians.
    pub(crate) fn run(&mut self, model: &Model, data: &mut Data<S>, [q, v]: [&[S]; 2], group: &mut KnotGroup<'_>) {
        let Self { r, J, Jcom, zero } = self;
        let requirements = group.terms[0].layout().requirements;
        if group.slopes && requirements.com {
            center_of_mass_jacobian((model, data, q, Jcom));
            group.visited = true;
            group.each(|group, [list, _], residual, plan| {
                if matches!(residual, Residual::CenterOfMass { .. }) {
                    group.write_rows(list, residual, plan, [Jcom, Jcom]);
                }
            });
        }
        if group.slopes && requirements.momentum {
            centroidal_momentum_derivatives((model, data, [q, v, zero], J));
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
        let jacobians = J;
        group.each(|group, [list, i], residual, plan| {
            let mut targets = [[0.0; WIDEST]; 12];
            for (k, terms) in group.terms.iter().enumerate() {
                let target = terms.0[list].kinematic(i).map_or([0.0; 12], |(residual, ..)| residual.target());
                targets.iter_mut().zip(target).for_each(|(to, x)| to[k] = x);
            }
            let (targets, frame) = (&targets, residual.frame().unwrap_or(0));
            let J = group.slopes.then_some(&mut *jacobians);
            let reference = residual.reference().unwrap_or(ReferenceFrame::Local);
            let question = Question { placements, velocities, frame, reference, targets, r: &mut *r, J };
            match residual {
                Residual::CenterOfMass { .. } => center_of_mass(question),
                Residual::CentroidalMomentum { .. } => centroidal_momentum(question),
                Residual::FramePlacement { .. } => frame_placement(question),
                Residual::FrameTranslation { .. } => frame_translation(question),
                Residual::FrameRotation { .. } => frame_rotation(question),
                Residual::FrameVelocity { .. } => frame_velocity(question),
                _ => unreachable!("it does not look at kinematics"),
            }
            let at = plan.index * STRIDE;
            unpack(r, group.data, |data| &mut data.residuals.kinematic[list].r[at..]);
            if group.slopes && residual.frame().is_some() {
                group.write_rows(list, residual, plan, [&jacobians[0], &jacobians[1]]);
            }
        });
    }
}

/// A question about the kinematics of some knots.
struct Question<'a, S> {
    placements: Placements<'a, S>,
    /// Computed where a residual needs them.
    velocities: Option<Velocities<'a, S>>,
    frame: usize,
    reference: ReferenceFrame,
    /// The numbers of the targets, with a lane for each knot: a position or a twist, then a rotation by columns.
    targets: &'a [[f64; WIDEST]; 12],
    /// The answer.
    r: &'a mut [S; STRIDE],
    /// ∂r/∂v and ∂r/∂q, if they are asked for.
    J: Option<&'a mut [DMatrix<S>; 2]>,
}

impl<'a, S: Block<Number = f64>> Question<'a, S> {
    /// The numbers of the target from the k-th on.
    #[inline(always)]
    fn target<const N: usize>(&self, k: usize) -> [S; N] {
        let mut target = [S::zero(); N];
        for i in 0..N {
            target[i] = S::load(&self.targets[k + i]);
        }
        target
    }

    #[inline(always)]
    fn position(&self) -> Vec3<S> {
        self.target::<3>(0).into()
    }

    #[inline(always)]
    fn rotation(&self) -> Mat3<S> {
        Mat3 { x: self.target::<3>(3).into(), y: self.target::<3>(6).into(), z: self.target::<3>(9).into() }
    }

    #[inline(always)]
    fn velocities(&self) -> Velocities<'a, S> {
        self.velocities.expect("velocities are computed where a residual needs them")
    }
}

/// A robot, its data, q, and where the Jacobian of the centre of mass goes.
type CenterOfMassJacobian<'a, S> = (&'a Model, &'a mut Data<S>, &'a [S], &'a mut DMatrix<S>);

/// A robot, its data, q, v and zeros, and where the derivatives of the momentum by v and q go.
type MomentumDerivatives<'a, S> = (&'a Model, &'a mut Data<S>, [&'a [S]; 3], &'a mut [DMatrix<S>; 2]);

block_kernel! {
    /// ∂c/∂q.
    fn center_of_mass_jacobian<S>(arguments: CenterOfMassJacobian<'_, S>) {
        let (model, data, q, J) = arguments;
        J.as_mut_slice().copy_from_slice(centroidal_map(model, data, q).Jcom.as_slice());
    }
}

block_kernel! {
    /// ∂h_G/∂v and ∂h_G/∂q.
    fn centroidal_momentum_derivatives<S>(arguments: MomentumDerivatives<'_, S>) {
        let (model, data, [q, v, zero], [by_v, by_q]) = arguments;
        let d = centroidal_derivatives(model, data, q, v, zero);
        by_v.as_mut_slice().copy_from_slice(d.dh_dv.as_slice());
        by_q.as_mut_slice().copy_from_slice(d.dh_dq.as_slice());
    }
}

block_kernel! {
    /// c − c_ref.
    fn center_of_mass<S>(question: Question<'_, S>) {
        let r = question.placements.com() - question.position();
        question.r[..3].copy_from_slice(&r.to_array());
    }
}

block_kernel! {
    /// h_G − h_ref.
    fn centroidal_momentum<S>(question: Question<'_, S>) {
        let r = question.velocities().centroidal_momentum() - Force::from(question.target::<6>(0));
        question.r[..6].copy_from_slice(&r.to_array());
    }
}

block_kernel! {
    /// log(refXo oXf), with the Jacobian Jlog J.
    fn frame_placement<S>(question: Question<'_, S>) {
        let X = Se3::new(question.rotation(), question.position()).inverse() * question.placements.frame(question.frame);
        let r = lie::log6(Quaternion::from_rotation(X.rotation), X.translation);
        question.r[..6].copy_from_slice(&r.to_array());
        if let Some([_, J]) = question.J {
            question.placements.frame_jacobian(question.frame, ReferenceFrame::Local, J);
            let Jlog = lie::jlog6(r);
            for column in J.as_mut_slice().chunks_exact_mut(6) {
                let m = Motion::from([column[0], column[1], column[2], column[3], column[4], column[5]]);
                column.copy_from_slice(&(Jlog * m).to_array());
            }
        }
    }
}

block_kernel! {
    /// p − p_ref.
    fn frame_translation<S>(question: Question<'_, S>) {
        let r = question.placements.frame(question.frame).translation - question.position();
        question.r[..3].copy_from_slice(&r.to_array());
        if let Some([_, J]) = question.J {
            question.placements.frame_jacobian(question.frame, ReferenceFrame::LocalWorldAligned, J);
        }
    }
}

block_kernel! {
    /// log(R_refᵀ R), with the Jacobian Jlog J.
    fn frame_rotation<S>(question: Question<'_, S>) {
        let R = question.rotation().transpose() * question.placements.frame(question.frame).rotation;
        let r = lie::log3(Quaternion::from_rotation(R));
        question.r[..3].copy_from_slice(&r.to_array());
        if let Some([_, J]) = question.J {
            question.placements.frame_jacobian(question.frame, ReferenceFrame::Local, J);
            let Jlog = lie::jlog3(r);
            for column in J.as_mut_slice().chunks_exact_mut(6) {
                let turned = Jlog * Vec3::new(column[3], column[4], column[5]);
                column[..3].copy_from_slice(&turned.to_array());
            }
        }
    }
}

block_kernel! {
    /// v − v_ref.
    fn frame_velocity<S>(question: Question<'_, S>) {
        let (velocities, frame, reference) = (question.velocities(), question.frame, question.reference);
        let r = velocities.frame_velocity(frame, reference) - Motion::from(question.target::<6>(0));
        question.r[..6].copy_from_slice(&r.to_array());
        if let Some([by_v, by_q]) = question.J {
            question.placements.frame_jacobian(frame, reference, by_v);
            velocities.frame_velocity_derivative(frame, reference, by_q);
        }
    }
}
