//! Ties between joints that share a coordinate (mimic). The accelerations of the robot follow from the accelerations
//! that it would have if all of its joints were free.
//!
//! Let Z be the joints that share coordinates. G maps the shared coordinates y to Z (1 for a leader, the ratio for a
//! mimic joint). Let w be the efforts at Z that tie the joints, and σ a rotor that each of them has in the free robot
//! only. M_σ is the inertia matrix of the free robot, A = (M_σ⁻¹)_ZZ, and a its accelerations without w. Then:
//!
//! ```text
//! a_Z + A w = G ÿ                          joints that share a coordinate move with it
//! Gᵀ (w − σ G ÿ) = 0                       the tying efforts, except those of the rotors, do no work
//! (Gᵀ A⁻¹ G − Gᵀ σ G) ÿ = Gᵀ A⁻¹ a_Z       hence
//! q̈ = a + (M_σ⁻¹)_Z w,    w = A⁻¹ (G ÿ − a_Z)
//! ```
//!
//! The columns of M_σ⁻¹ are the accelerations, at rest and without gravity, for a unit effort at one joint of Z. With
//! the rotors, M_σ is regular wherever M of the tied robot is: a motion that M_σ does not resist has no velocity in Z,
//! so M would not resist it either. Without rotors M_σ may be singular, because a mimic joint may have no inertia of
//! its own.

use crate::calls::inertia::crba;
use crate::data::Data;
use crate::divide_conquer::assembly::Link;
use crate::divide_conquer::scratch::Dof;
use alloc::vec::Vec;
use condyle_linalg::Cholesky;
use condyle_linalg::axpy::{axpy, dot};
use condyle_model::Model;
use condyle_model::random_configuration;
use condyle_spatial::{Constant, Scalar};
use nalgebra::DMatrix;
use rand::{SeedableRng, rngs::StdRng};

/// Joint that shares its coordinate with others.
#[derive(Clone, Debug)]
struct Member {
    body: usize,
    /// Index of its degree of freedom, in the order of the assembly.
    dof: usize,
    /// Index of its shared coordinate.
    shared: usize,
}

/// Shared coordinates of a robot, and quantities that tie the joints that share them.
#[derive(Clone, Debug)]
pub(crate) struct Ties<S> {
    /// Joints Z, in the order of the assembly.
    members: Vec<Member>,
    /// σ. Shape: Z. Written by: `choose_rotors`.
    rotors: Vec<S>,
    /// G. Shape: Z × y. Written by: `prepare`.
    G: DMatrix<S>,
    /// a. Shape: degrees of freedom. Written by: `keep_free` and `solve`.
    free: Vec<S>,
    /// (M_σ⁻¹)_Z, stored by columns. Shape: degrees of freedom × Z. Written by: `keep_response`.
    response: DMatrix<S>,
    /// A. Shape: Z × Z. Written by: `solve`.
    A: DMatrix<S>,
    /// A⁻¹ G. Shape: Z × y. Written by: `solve`.
    X: DMatrix<S>,
    /// Gᵀ A⁻¹ G − Gᵀ σ G. Shape: y × y. Written by: `solve`.
    H: DMatrix<S>,
    factor_A: Cholesky<S>,
    factor_H: Cholesky<S>,
    /// ÿ. Shape: y. Written by: `solve`.
    ydd: Vec<S>,
    /// G ÿ − a_Z, then w. Shape: Z. Written by: `solve`.
    w: Vec<S>,
}

impl<S: Scalar> Ties<S> {
    /// Returns the ties of a model whose degrees of freedom are in the order of `links`.
    pub(crate) fn new<R: Constant<S>>(model: &Model<R>, links: &[Link]) -> Self {
        let mut joints = vec![0; model.nv()];
        model.columns().iter().for_each(|column| joints[column.coordinate] += 1);
        let shared: Vec<usize> = (0..model.nv()).filter(|&k| joints[k] > 1).collect();
        let (mut members, mut dofs) = (Vec::new(), 0);
        for &Link { body, .. } in links {
            let node = &model.nodes()[body];
            if let Ok(shared) = shared.binary_search(&node.idx_v) {
                members.push(Member { body, dof: dofs, shared });
            }
            dofs += node.joint.nv();
        }
        let (z, y, zeros) =
            (members.len(), shared.len(), |rows, columns| DMatrix::from_element(rows, columns, S::zero()));
        let mut ties = Self {
            members,
            rotors: vec![S::zero(); z],
            G: zeros(z, y),
            free: vec![S::zero(); dofs],
            response: zeros(dofs, z),
            A: zeros(z, z),
            X: zeros(z, y),
            H: zeros(y, y),
            factor_A: Cholesky::new(z),
            factor_H: Cholesky::new(y),
            ydd: vec![S::zero(); y],
            w: vec![S::zero(); z],
        };
        ties.choose_rotors(model, &shared);
        ties
    }

    /// Chooses rotors with about the same inertia as the bodies that they turn, so that rounding hides neither. Gᵀ σ G
    /// is the diagonal of M at a random position.
    fn choose_rotors<R: Constant<S>>(&mut self, model: &Model<R>, shared: &[usize]) {
        if shared.is_empty() {
            return;
        }
        self.prepare(model);
        let q = random_configuration(model, &mut StdRng::seed_from_u64(0));
        let q: Vec<S> = q.into_iter().map(S::splat).collect();
        let mut data = Data::new(model);
        let M = crba(model, &mut data, &q);
        for (rotor, member) in self.rotors.iter_mut().zip(&self.members) {
            let (k, G) = (shared[member.shared], self.G.column(member.shared));
            *rotor = M[(k, k)] / dot(G.as_slice(), G.as_slice());
        }
    }

    /// Reads the ratios of the mimic joints.
    pub(crate) fn prepare<R>(&mut self, model: &Model<R>) {
        for (z, member) in self.members.iter().enumerate() {
            let ratio = model.nodes()[member.body].mimic.map_or(1.0, |mimic| mimic.ratio);
            self.G[(z, member.shared)] = S::splat(ratio);
        }
    }

    /// Returns the number of joints that share a coordinate with others.
    pub(crate) fn len(&self) -> usize {
        self.members.len()
    }

    /// Returns the index of one of these joints among the degrees of freedom.
    pub(crate) fn dof(&self, z: usize) -> usize {
        self.members[z].dof
    }

    /// Adds the rotors to the joints.
    pub(crate) fn add_rotors(&self, dofs: &mut [Dof<S>]) {
        for (member, &rotor) in self.members.iter().zip(&self.rotors) {
            dofs[member.dof].rotor += rotor;
        }
    }

    /// Stores the accelerations of the free robot.
    pub(crate) fn keep_free(&mut self, dofs: &[Dof<S>]) {
        self.free.iter_mut().zip(dofs).for_each(|(a, dof)| *a = dof.qdd);
    }

    /// Stores the accelerations for a unit effort at one of the joints.
    pub(crate) fn keep_response(&mut self, z: usize, dofs: &[Dof<S>]) {
        self.response.column_mut(z).iter_mut().zip(dofs).for_each(|(a, dof)| *a = dof.qdd);
    }

    /// Computes the acceleration of each degree of freedom in the tied robot.
    pub(crate) fn solve(&mut self, dofs: &mut [Dof<S>]) {
        let Self { members, rotors, G, free, response, A, X, H, factor_A, factor_H, ydd, w } = self;
        let (z, y) = G.shape();
        for i in 0..z {
            for j in 0..z {
                A[(i, j)] = response[(members[i].dof, j)];
            }
        }
        factor_A.factorize(A);
        X.copy_from(G);
        factor_A.solve_matrix(X); // A⁻¹ G
        for j in 0..y {
            let X = &X.as_slice()[j * z..][..z];
            for i in 0..y {
                H[(i, j)] = S::zero();
            }
            ydd[j] = S::zero();
            for (k, member) in members.iter().enumerate() {
                let g = G[(k, member.shared)];
                H[(member.shared, j)] += g * X[k]; // Gᵀ A⁻¹ G
                ydd[j] += X[k] * free[member.dof]; // Gᵀ A⁻¹ a_Z
                if member.shared == j {
                    H[(j, j)] -= g * rotors[k] * g; // − Gᵀ σ G
                }
            }
        }
        factor_H.factorize(H);
        factor_H.solve(ydd);
        for (k, member) in members.iter().enumerate() {
            w[k] = G[(k, member.shared)] * ydd[member.shared] - free[member.dof]; // G ÿ − a_Z
        }
        factor_A.solve(w);
        for (k, response) in response.as_slice().chunks_exact(free.len()).enumerate() {
            axpy(w[k], response, free); // q̈ = a + (M_σ⁻¹)_Z w
        }
        free.iter().zip(&mut *dofs).for_each(|(&a, dof)| dof.qdd = a);
        for (k, member) in members.iter().enumerate() {
            dofs[member.dof].qdd = G[(k, member.shared)] * ydd[member.shared]; // satisfies the ties exactly
        }
    }
}
