//! Controls and contact forces that hold a robot still, without allocation.
#![allow(non_snake_case)] // names follow the literature: S, J

use super::batch::{DynamicsKind, KnotBatch, Pass};
use crate::robot::actuation::Actuation;
use condyle_dynamics::{Cholesky, Model, constrained_inverse_dynamics, gravity};
use condyle_spatial::{Matrix, matrix};

/// Regularisation of the normal equations, relative to the largest diagonal entry of their matrix. It bounds the result
/// if [S Jᵀ] does not have full rank, as for a robot on two feet that nothing prevents from tipping. The result differs
/// from the pseudo-inverse by about this factor times the norm of the forces.
const REGULARISATION: f64 = 1e-10;

/// Workspace for the controls u and contact forces λ of nearly smallest norm with S u + Jᵀλ = g(q).
#[derive(Debug)]
pub(super) struct Still {
    /// Matrix [S Jᵀ]. Shape: nv × (nu + rows).
    map: Matrix<f64>,
    /// Matrix [S Jᵀ] [S Jᵀ]ᵀ + ε 1 of the normal equations. Shape: nv × nv.
    normal: Matrix<f64>,
    factor: Cholesky<f64>,
    /// Gravity efforts g(q), then the solution y of the normal equations. Shape: nv.
    y: Vec<f64>,
    /// Zeros: the accelerations and contact forces of a robot at rest. Shape: the larger number of nv and rows.
    zeros: Vec<f64>,
}

impl Still {
    /// Allocates the workspace. Returns `None` for a kind of dynamics that no controls hold still: a terminal knot and
    /// an impact.
    pub(super) fn new(model: &Model, actuation: &Actuation, kind: &DynamicsKind) -> Option<Self> {
        let (contacts, nu) = match kind {
            DynamicsKind::None | DynamicsKind::Impact { .. } => return None,
            DynamicsKind::Inverse => (&[][..], 0),
            DynamicsKind::Free => (&[][..], actuation.nu()),
            DynamicsKind::Contact(contacts, _) => (&contacts[..], actuation.nu()),
            DynamicsKind::ContactInverse(contacts, drives) => (&contacts[..], drives.nu()),
        };
        let (nv, rows) = (model.nv(), contacts.iter().map(|contact| contact.constraint.kind.rows()).sum::<usize>());
        Some(Self {
            map: matrix(nv, nu + rows, 0.0),
            normal: matrix(nv, nv, 0.0),
            factor: Cholesky::new(nv),
            y: vec![0.0; nv],
            zeros: vec![0.0; nv.max(rows)],
        })
    }

    /// Computes the controls that hold the robot still at x, as nearly as possible, into `u`: the controls of
    /// [`quasi_static`](super::robot::RobotDynamics::quasi_static), up to the regularisation. Allocates nothing.
    ///
    /// ```text
    /// (u, λ) = [S Jᵀ]ᵀ y,   ([S Jᵀ] [S Jᵀ]ᵀ + ε 1) y = g(q)
    /// ```
    pub(super) fn run(
        &mut self,
        model: &Model,
        (actuation, kind): (&Actuation, &DynamicsKind),
        batch: &mut KnotBatch<f64>,
        x: &[f64],
        u: &mut [f64],
    ) {
        let Self { map, normal, factor, y, zeros } = self;
        let (nv, (q, v)) = (model.nv(), x.split_at(model.nq()));
        let (drives, inverse) = match kind {
            DynamicsKind::Inverse => return u.fill(0.0), // q̈ = u
            DynamicsKind::ContactInverse(_, drives) => (drives, true),
            _ => (actuation, false),
        };
        map.as_mut_slice().fill(0.0);
        drives.write_columns(map.as_mut_slice());
        let KnotBatch { data, pass, .. } = batch;
        let data = &mut *data.get();
        if let Pass::Contact(set, J) | Pass::ContactInverse(set, J) = pass {
            let rows = set.rows();
            constrained_inverse_dynamics(model, data, set, q, v, &zeros[..nv], &zeros[..rows], &[]);
            set.jacobian(J);
            for (row, column) in map.as_mut_slice()[drives.nu() * nv..].chunks_exact_mut(nv).enumerate() {
                (0..nv).for_each(|i| column[i] = J[(row, i)]);
            }
        }
        y.copy_from_slice(gravity(model, data, q));
        let normals = normal.as_mut_slice();
        normals.fill(0.0);
        for column in map.as_slice().chunks_exact(nv) {
            for (j, b) in column.iter().enumerate().filter(|(_, b)| **b != 0.0) {
                (j..nv).for_each(|i| normals[j * nv + i] += column[i] * b); // the lower triangle
            }
        }
        let largest = (0..nv).fold(0.0, |most: f64, i| most.max(normals[i * nv + i]));
        (0..nv).for_each(|i| normals[i * nv + i] += REGULARISATION * largest);
        factor.factorize(normal);
        factor.solve(y);
        let along = |column: &[f64]| column.iter().zip(&*y).map(|(a, y)| a * y).sum::<f64>();
        let (first, skipped) = if inverse { (nv, drives.nu()) } else { (0, 0) }; // (q̈, λ), or u
        u[..first].fill(0.0);
        for (u, column) in u[first..].iter_mut().zip(map.as_slice().chunks_exact(nv).skip(skipped)) {
            *u = along(column);
        }
    }
}
