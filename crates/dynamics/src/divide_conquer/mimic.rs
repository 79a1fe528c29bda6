//! Ties between joints that share a coordinate (mimic joints and their leaders). In the free robot, all joints move
//! independently. The accelerations of the free robot are computed first, and the accelerations of the tied robot
//! follow from these.
//!
//! Let Z be the joints that share coordinates. G maps the shared coordinates y to positions of the joints Z (1 for a
//! leader, the ratio for a mimic joint). w are the efforts at the joints Z that enforce the ties. In the free robot
//! only, each joint of Z has a rotor with inertia σ. Let M_σ be the inertia matrix of the free robot, A = (M_σ⁻¹)_ZZ,
//! and a the accelerations of the free robot without w. Then:
//!
//! ```text
//! a_Z + A w = G ÿ                          joints that share a coordinate move with it
//! Gᵀ (w − σ G ÿ) = 0                       the tying efforts, except those of the rotors, do no work
//! (Gᵀ A⁻¹ G − Gᵀ σ G) ÿ = Gᵀ A⁻¹ a_Z       hence
//! q̈ = a + (M_σ⁻¹)_Z w,    w = A⁻¹ (G ÿ − a_Z)
//! ```
//!
//! Column z of (M_σ⁻¹)_Z contains the accelerations of the free robot, at rest and without gravity, for a unit effort
//! at joint z, one of the joints Z that share coordinates. M_σ, the inertia matrix of the free robot with its rotors,
//! is regular if the inertia matrix M of the tied robot is regular. The reason: a motion in the null space of M_σ has
//! no kinetic energy, so no rotor turns, and the joints Z have no velocity. Such a motion satisfies the ties, so it
//! would be in the null space of M, too. Without rotors, M_σ may be singular, because the bodies that a mimic joint
//! moves may have no inertia.

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

/// Joint that shares its coordinate with other joints.
#[derive(Clone, Debug)]
struct Member {
    body: usize,
    /// Index of the joint's degree of freedom among the degrees of freedom in the order of the assembly.
    dof: usize,
    /// Index of the joint's coordinate among the shared coordinates.
    shared: usize,
}

/// Joints that share coordinates, and the quantities that tie these joints.
#[derive(Clone, Debug)]
pub(crate) struct Ties<S> {
    /// Joints Z that share coordinates, in the order of the assembly.
    members: Vec<Member>,
    /// Inertias σ of the rotors, one per joint of Z. Shape: Z. Written by: `choose_rotors`.
    rotors: Vec<S>,
    /// Matrix G of the ratios, which maps the shared coordinates y to positions of the joints Z. Shape: Z × y. Written
    /// by: `prepare`.
    G: DMatrix<S>,
    /// Accelerations a of the free robot, which the accelerations of the tied robot overwrite. Shape: degrees of
    /// freedom. Written by: `keep_free` and `solve`.
    free: Vec<S>,
    /// Columns (M_σ⁻¹)_Z of the inverse inertia matrix of the free robot, one per joint of Z. Shape: degrees of freedom
    /// × Z. Written by: `keep_response`.
    response: DMatrix<S>,
    /// Matrix A = (M_σ⁻¹)_ZZ: the rows and columns of the joints Z in the inverse inertia matrix of the free robot.
    /// Shape: Z × Z. Written by: `solve`.
    A: DMatrix<S>,
    /// Matrix A⁻¹ G, with the matrix G of the ratios. Shape: Z × y. Written by: `solve`.
    X: DMatrix<S>,
    /// Matrix Gᵀ A⁻¹ G − Gᵀ σ G of the equation for the accelerations ÿ of the shared coordinates. Shape: y × y.
    /// Written by: `solve`.
    H: DMatrix<S>,
    factor_A: Cholesky<S>,
    factor_H: Cholesky<S>,
    /// Accelerations ÿ of the shared coordinates y. Shape: number of shared coordinates. Written by: `solve`.
    ydd: Vec<S>,
    /// Difference G ÿ − a_Z between the accelerations of the joints Z in the tied robot and in the free robot. The
    /// tying efforts w overwrite this difference. Shape: Z. Written by: `solve`.
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

    /// Chooses the inertias σ of the rotors. They are about as large as the inertias that the joints move, so neither
    /// inertia is lost in the rounding errors of the other. For each shared coordinate, the total inertia Gᵀ σ G of the
    /// rotors equals the diagonal entry of M at a random position.
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

    /// Copies the ratios of the mimic joints to G.
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

    /// Returns the index of joint z among the degrees of freedom. z counts only the joints that share coordinates.
    pub(crate) fn dof(&self, z: usize) -> usize {
        self.members[z].dof
    }

    /// Adds the rotors' inertias σ to the degrees of freedom of the joints that share coordinates.
    pub(crate) fn add_rotors(&self, dofs: &mut [Dof<S>]) {
        for (member, &rotor) in self.members.iter().zip(&self.rotors) {
            dofs[member.dof].rotor += rotor;
        }
    }

    /// Stores the accelerations of the free robot.
    pub(crate) fn keep_free(&mut self, dofs: &[Dof<S>]) {
        self.free.iter_mut().zip(dofs).for_each(|(a, dof)| *a = dof.qdd);
    }

    /// Stores the accelerations of the free robot for a unit effort at joint z. z counts only the joints that share
    /// coordinates.
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
            dofs[member.dof].qdd = G[(k, member.shared)] * ydd[member.shared]; // so that the ties hold exactly
        }
    }
}
