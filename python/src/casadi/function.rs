//! Functions of a robot and their derivatives with respect to tangent vectors; this file does not depend on CasADi.

use super::computation::Output;
use crate::hyper_dual::Hyper;
use condyle::{
    ConstraintSet, ContactConstraint, Data, Model, ModelError as Error, ReferenceFrame, Scalar, Vec3,
    derivatives::RneaSecondDerivatives,
    spatial::{Dense, DenseMatrix, Matrix},
};
use nalgebra::DMatrix;

/// The quantity that a function computes.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    /// Inverse dynamics: τ = rnea(q, v, a).
    Rnea,
    /// Forward dynamics: a = aba(q, v, τ).
    Aba,
    /// The inertia matrix: M = crba(q).
    Crba,
    /// The position and the rotation of a frame.
    FramePlacement { frame: usize },
    /// The velocity of a frame.
    FrameVelocity { frame: usize, reference: ReferenceFrame },
    /// The centre of mass.
    Com,
    /// The centroidal momentum.
    CentroidalMomentum,
    /// Acceleration a and forces λ of the dynamics under constraints.
    ConstrainedDynamics { constraints: Vec<ContactConstraint> },
}

/// The second derivatives that may differ from zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Pattern {
    /// All second derivatives are zero.
    Zero,
    /// A second derivative may differ from zero only if its two coordinates move a common body.
    Related,
    /// Any second derivative may differ from zero.
    Full,
}

/// Work space of a computation, for one type of scalar.
pub(super) struct Scratch<S> {
    data: Data<S>,
    constraints: Option<ConstraintSet<S>>,
    tensors: Option<Box<RneaSecondDerivatives<S>>>,
    /// The Jacobian of a frame, 6 × nv, and a vector of nv zeros.
    J: DMatrix<S>,
    zeros: Vec<S>,
}

/// Writes a block of derivatives to J. The block begins at row `row`, and its columns belong to one argument.
fn place<S: Scalar>(J: &mut DMatrix<S>, row: usize, argument: usize, block: &DenseMatrix<S, impl Dense<S>>) {
    J.view_mut((row, argument * block.ncols()), block.shape()).copy_from(block);
}

impl Kind {
    /// Returns the names of the arguments: q first, then vectors of nv numbers.
    pub(super) fn arguments(&self) -> &'static [&'static str] {
        match self {
            Self::Rnea => &["q", "v", "a"],
            Self::Aba | Self::ConstrainedDynamics { .. } => &["q", "v", "tau"],
            Self::Crba | Self::FramePlacement { .. } | Self::Com => &["q"],
            Self::FrameVelocity { .. } | Self::CentroidalMomentum => &["q", "v"],
        }
    }

    /// Returns the names and shapes of the results; `rows` is the number of rows of the constraints.
    pub(super) fn outputs(&self, nv: usize, rows: usize) -> Vec<Output> {
        let output = |name, rows, columns| Output { name, rows, columns };
        match self {
            Self::Rnea => vec![output("tau", nv, 1)],
            Self::Aba => vec![output("a", nv, 1)],
            Self::Crba => vec![output("M", nv, nv)],
            Self::FramePlacement { .. } => vec![output("position", 3, 1), output("rotation", 3, 3)],
            Self::FrameVelocity { .. } => vec![output("velocity", 6, 1)],
            Self::Com => vec![output("com", 3, 1)],
            Self::CentroidalMomentum => vec![output("momentum", 6, 1)],
            Self::ConstrainedDynamics { .. } => vec![output("a", nv, 1), output("forces", rows, 1)],
        }
    }

    /// Returns whether a first derivative may differ from zero: the derivative of the number with index `row` among the
    /// numbers of all results, with respect to tangent coordinate j. `related` returns whether two coordinates move a
    /// common body.
    pub(super) fn depends(&self, row: usize, j: usize, nv: usize, related: impl Fn(usize, usize) -> bool) -> bool {
        match self {
            Self::Rnea => related(row, j),
            Self::Crba => related(row % nv, j) && related(row / nv, j),
            _ => true,
        }
    }

    /// Returns the pattern of the second derivatives of λᵀf with respect to arguments i and k, for results f and
    /// multipliers λ.
    pub(super) fn second_derivatives(&self, i: usize, k: usize) -> Pattern {
        match (self, i.min(k), i.max(k)) {
            (Self::Rnea, 0, _) | (Self::Rnea, 1, 1) | (Self::Crba, ..) => Pattern::Related,
            (Self::Rnea, ..) => Pattern::Zero,
            (Self::Aba | Self::ConstrainedDynamics { .. }, 1 | 2, 2) => Pattern::Zero, // the result is affine in τ
            // the velocity of a frame and the centroidal momentum are linear in v
            (Self::FrameVelocity { .. } | Self::CentroidalMomentum, 1, 1) => Pattern::Zero,
            _ => Pattern::Full,
        }
    }

    pub(super) fn scratch<S: Scalar>(&self, model: &Model) -> Result<Scratch<S>, Error> {
        let constraints = match self {
            Self::ConstrainedDynamics { constraints } => Some(ConstraintSet::new(model, constraints)?),
            _ => None,
        };
        let tensors = matches!(self, Self::Crba).then(|| Box::new(RneaSecondDerivatives::new(model)));
        let (nv, zero) = (model.nv(), S::zero());
        let data = Data::new(model);
        Ok(Scratch { data, constraints, tensors, J: DMatrix::from_element(6, nv, zero), zeros: vec![zero; nv] })
    }

    /// Computes all results. Writes the results to `y` one after the other, each result column by column.
    pub(super) fn value(&self, model: &Model, s: &mut Scratch<f64>, x: &[Vec<f64>], y: &mut [f64]) {
        let data = &mut s.data;
        match self {
            Self::Rnea => y.copy_from_slice(condyle::rnea(model, data, &x[0], &x[1], &x[2], &[])),
            Self::Aba => y.copy_from_slice(condyle::aba(model, data, &x[0], &x[1], &x[2], &[])),
            Self::Crba => y.copy_from_slice(condyle::crba(model, data, &x[0]).as_slice()),
            Self::FramePlacement { frame } => {
                let placement = condyle::forward_kinematics(model, data, &x[0]).frame(*frame);
                y[..3].copy_from_slice(&placement.translation.to_array());
                for (column, y) in placement.rotation.columns().into_iter().zip(y[3..].chunks_exact_mut(3)) {
                    y.copy_from_slice(&column.to_array());
                }
            }
            Self::FrameVelocity { frame, reference } => {
                let velocity =
                    condyle::forward_velocities(model, data, &x[0], &x[1]).frame_velocity(*frame, *reference);
                y.copy_from_slice(&velocity.to_array());
            }
            Self::Com => y.copy_from_slice(&condyle::forward_kinematics(model, data, &x[0]).com().to_array()),
            Self::CentroidalMomentum => {
                let momentum = condyle::forward_velocities(model, data, &x[0], &x[1]).centroidal_momentum();
                y.copy_from_slice(&momentum.to_array());
            }
            Self::ConstrainedDynamics { .. } => {
                let constraints = s.constraints.as_mut().expect("made with the scratch");
                let d = condyle::constrained_dynamics(model, data, constraints, &x[0], &x[1], &x[2], &[]);
                y[..d.a.len()].copy_from_slice(d.a);
                y[d.a.len()..].copy_from_slice(d.lambda);
            }
        }
    }

    /// Computes the first derivatives of all results with respect to all tangent coordinates.
    pub(super) fn jacobian<S: Scalar>(
        &self,
        model: &Model,
        Scratch { data, constraints, tensors, J: frame_jacobian, zeros }: &mut Scratch<S>,
        x: &[Vec<S>],
        J: &mut DMatrix<S>,
    ) {
        let nv = model.nv();
        match self {
            Self::Rnea => {
                let d = condyle::rnea_derivatives(model, data, &x[0], &x[1], &x[2], &[]);
                place(J, 0, 0, d.dtau_dq);
                place(J, 0, 1, d.dtau_dv);
                place(J, 0, 2, d.dtau_da);
            }
            Self::Aba => {
                let d = condyle::aba_derivatives(model, data, &x[0], &x[1], &x[2], &[]);
                place(J, 0, 0, d.da_dq);
                place(J, 0, 1, d.da_dv);
                place(J, 0, 2, d.da_dtau);
            }
            Self::Crba => {
                let tensors = tensors.as_mut().expect("made with the scratch");
                condyle::derivatives::rnea_second_derivatives(model, data, &x[0], zeros, zeros, &[], tensors);
                for (i, dM_i) in tensors.dadq.iter().enumerate() {
                    place(J, i * nv, 0, dM_i); // ∂M_ij/∂q_k; M is symmetric
                }
            }
            Self::FramePlacement { frame } => {
                let placements = condyle::forward_kinematics(model, data, &x[0]);
                placements.frame_jacobian(*frame, ReferenceFrame::LocalWorldAligned, frame_jacobian);
                let rotation = placements.frame(*frame).rotation.columns();
                for (k, from) in frame_jacobian.column_iter().enumerate() {
                    let mut to = J.column_mut(k);
                    to.rows_mut(0, 3).copy_from(&from.rows(0, 3));
                    let omega = Vec3::new(from[3], from[4], from[5]);
                    for (c, column) in rotation.into_iter().enumerate() {
                        to.as_mut_slice()[3 + 3 * c..][..3].copy_from_slice(&omega.cross(column).to_array()); // ω × R
                    }
                }
            }
            Self::FrameVelocity { frame, reference } => {
                let velocities = condyle::forward_velocities(model, data, &x[0], &x[1]);
                velocities.frame_velocity_derivative(*frame, *reference, frame_jacobian);
                place(J, 0, 0, frame_jacobian);
                velocities.frame_jacobian(*frame, *reference, frame_jacobian);
                place(J, 0, 1, frame_jacobian);
            }
            Self::Com => {
                let d = condyle::centroidal::centroidal_derivatives(model, data, &x[0], zeros, zeros);
                place(J, 0, 0, d.dcom_dq);
            }
            Self::CentroidalMomentum => {
                let d = condyle::centroidal::centroidal_derivatives(model, data, &x[0], &x[1], zeros);
                place(J, 0, 0, d.dh_dq);
                place(J, 0, 1, d.dh_dv);
            }
            Self::ConstrainedDynamics { .. } => {
                let constraints = constraints.as_mut().expect("made with the scratch");
                let d = condyle::constrained_dynamics_derivatives(model, data, constraints, &x[0], &x[1], &x[2], &[]);
                place(J, 0, 0, d.da_dq);
                place(J, 0, 1, d.da_dv);
                place(J, 0, 2, d.da_dtau);
                place(J, nv, 0, d.dlambda_dq);
                place(J, nv, 1, d.dlambda_dv);
                place(J, nv, 2, d.dlambda_dtau);
            }
        }
    }

    /// If the library has closed formulas for the second derivatives, computes the Hessian of λᵀf with respect to all
    /// tangent coordinates, for results f and multipliers λ. Then also computes the Jacobian if J is given. Returns
    /// whether the library has such formulas.
    pub(super) fn closed_hessian(
        &self,
        model: &Model,
        s: &mut Scratch<f64>,
        x: &[Vec<f64>],
        lambda: &[f64],
        J: Option<&mut DMatrix<f64>>,
        H: &mut DMatrix<f64>,
    ) -> bool {
        let n = model.nv();
        let mut write = |dqdq: &Matrix<f64>, dvdq: &Matrix<f64>, dvdv: &Matrix<f64>, dudq: &Matrix<f64>| {
            H.fill(0.0);
            H.view_mut((0, 0), (n, n)).copy_from(dqdq);
            H.view_mut((n, 0), (n, n)).copy_from(dvdq);
            H.view_mut((0, n), (n, n)).tr_copy_from(dvdq);
            H.view_mut((n, n), (n, n)).copy_from(dvdv);
            H.view_mut((2 * n, 0), (n, n)).copy_from(dudq);
            H.view_mut((0, 2 * n), (n, n)).tr_copy_from(dudq);
        };
        let first = |blocks: [&Matrix<f64>; 3]| {
            if let Some(J) = J {
                blocks.into_iter().enumerate().for_each(|(k, block)| place(J, 0, k, block));
            }
        };
        match self {
            Self::Rnea => {
                let h = condyle::derivatives::rnea_hessian(model, &mut s.data, &x[0], &x[1], &x[2], &[], lambda);
                write(h.dqdq, h.dvdq, h.dvdv, h.dadq);
                first([h.first.dtau_dq, h.first.dtau_dv, h.first.dtau_da]);
                true
            }
            Self::Aba => {
                let h = condyle::derivatives::aba_hessian(model, &mut s.data, &x[0], &x[1], &x[2], &[], lambda);
                write(h.dqdq, h.dvdq, h.dvdv, h.dtaudq);
                first([h.first.da_dq, h.first.da_dv, h.first.da_dtau]);
                true
            }
            _ => false,
        }
    }

    /// Computes the Hessian of λᵀf with respect to all tangent coordinates, for results f with the Jacobian J and
    /// multipliers λ. Hyper-dual numbers give the derivatives of Jᵀλ in two directions at a time. At q ⊕ δ, J is taken
    /// in the tangent space at q ⊕ δ, not in the tangent space at q. Therefore the matrix of these derivatives is not
    /// symmetric; the Hessian is its symmetric part.
    pub(super) fn hessian(
        &self,
        model: &Model,
        s: &mut DualScratch,
        x: &[Vec<f64>],
        lambda: &[f64],
        H: &mut DMatrix<f64>,
    ) {
        let (n, count) = (model.nv(), H.ncols());
        for first in (0..count).step_by(2) {
            let seed = |k: usize| match k {
                k if k == first => Hyper::first(0.0),
                k if k == first + 1 => Hyper::second(0.0),
                _ => Hyper::zero(),
            };
            for (k, (given, dual)) in x.iter().zip(&mut s.x).enumerate() {
                if k == 0 {
                    s.q.iter_mut().zip(given).for_each(|(dual, &x)| *dual = Hyper::splat(x));
                    s.tangent.iter_mut().enumerate().for_each(|(j, dual)| *dual = seed(j));
                    condyle::integrate(model, &s.q, &s.tangent, dual);
                } else {
                    let numbers = dual.iter_mut().zip(given).enumerate();
                    numbers.for_each(|(j, (dual, &x))| *dual = Hyper::splat(x) + seed(k * n + j));
                }
            }
            self.jacobian(model, &mut s.scratch, &s.x, &mut s.J);
            for (j, column) in s.J.column_iter().enumerate() {
                let slope = column.iter().zip(lambda).fold([0.0; 2], |[a, b], (x, l)| {
                    let [first, second] = x.slopes();
                    [a + first * l, b + second * l]
                });
                H[(j, first)] = slope[0];
                if first + 1 < count {
                    H[(j, first + 1)] = slope[1];
                }
            }
        }
        for j in 0..count {
            for i in 0..j {
                let mean = 0.5 * (H[(i, j)] + H[(j, i)]);
                (H[(i, j)], H[(j, i)]) = (mean, mean);
            }
        }
    }

    /// Creates the work space of [`hessian`](Self::hessian) for this number of results.
    pub(super) fn dual_scratch(&self, model: &Model, results: usize) -> Result<DualScratch, Error> {
        let zero = Hyper::zero();
        let (nq, nv, arguments) = (model.nq(), model.nv(), self.arguments().len());
        Ok(DualScratch {
            scratch: self.scratch(model)?,
            x: (0..arguments).map(|k| vec![zero; if k == 0 { nq } else { nv }]).collect(),
            q: vec![zero; nq],
            tangent: vec![zero; nv],
            J: DMatrix::from_element(results, arguments * nv, zero),
        })
    }
}

/// Work space of a Hessian by hyper-dual numbers.
pub(super) struct DualScratch {
    scratch: Scratch<Hyper>,
    x: Vec<Vec<Hyper>>,
    q: Vec<Hyper>,
    tangent: Vec<Hyper>,
    J: DMatrix<Hyper>,
}
