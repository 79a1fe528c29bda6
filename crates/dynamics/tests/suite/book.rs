//! Inverse dynamics, the inertia matrix and forward dynamics in the formulation of Featherstone's book. The results are
//! compared with the results of this library.

use crate::common;

use common::{State, Worst, all_models, armature_torque, rng};
use condyle_dynamics::ReferenceFrame::Local;
use condyle_dynamics::{
    Act, Cross, Data, Force, Model, Motion, Se3, Vec3, aba, crba, forward_dynamics, forward_kinematics, rnea,
};
use nalgebra::{DMatrix, DVector, Matrix6, Matrix6xX, Vector6};

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-11;
/// Tolerance of results with M⁻¹: sums over all bodies, times the condition number of M.
const INVERTED: f64 = 1e-10;
const TREES: u64 = 20;

fn motion(x: &[f64]) -> Motion<f64> {
    Motion::from(core::array::from_fn(|k| x[k]))
}

/// Returns the 6 × 6 matrix of a linear map, given as a function from motions to motions or forces.
fn matrix(map: impl Fn(Motion<f64>) -> [f64; 6]) -> Matrix6<f64> {
    Matrix6::from_columns(&core::array::from_fn::<_, 6, _>(|k| {
        let unit = core::array::from_fn(|i| if i == k { 1.0 } else { 0.0 });
        Vector6::from(map(Motion::from(unit)))
    }))
}

/// Robot at a position q in body coordinates, as described in Featherstone, *Rigid Body Dynamics Algorithms* (2008).
struct Book<'a> {
    model: &'a Model,
    /// Placement of each body i in its parent λ.
    X: Vec<Se3<f64>>,
    /// Motion subspaces, 6 × nv each. The column of a joint that follows another joint is at the index of the leader's
    /// coordinate.
    S: Vec<Matrix6xX<f64>>,
}

impl<'a> Book<'a> {
    fn new(model: &'a Model, q: &[f64]) -> Self {
        let (bodies, nv) = (model.bodies().len(), model.nv());
        let mut data = Data::new(model);
        let placements = forward_kinematics(model, &mut data, q);
        let mut S = vec![Matrix6xX::zeros(nv); bodies];
        let mut X = vec![Se3::identity(); bodies];
        for i in 1..bodies {
            let parent = model.bodies()[i].parent;
            X[i] = placements.body(parent).inverse() * placements.body(i);
            let mut J = [DMatrix::zeros(6, nv), DMatrix::zeros(6, nv)];
            placements.body_jacobian(i, Local, &mut J[0]);
            placements.body_jacobian(parent, Local, &mut J[1]);
            for k in 0..nv {
                let before = X[i].act_inv(motion(J[1].column(k).as_slice()));
                let own = (motion(J[0].column(k).as_slice()) - before).to_array();
                S[i].column_mut(k).copy_from_slice(&own); // S_i = J_i − iXλ J_λ
            }
        }
        Self { model, X, S }
    }

    fn parent(&self, i: usize) -> usize {
        self.model.bodies()[i].parent
    }

    /// Returns the transform iXλ of motions from the parent λ to body i. The transpose of iXλ transforms forces from i
    /// to λ.
    fn up(&self, i: usize) -> Matrix6<f64> {
        matrix(|x| self.X[i].act_inv(x).to_array())
    }

    fn inertias(&self) -> Vec<Matrix6<f64>> {
        self.model.bodies().iter().map(|body| matrix(|x| (body.inertia * x).to_array())).collect()
    }

    /// Returns the velocity v_i and the joint velocity v_J of each body.
    fn velocities(&self, v: &[f64]) -> [Vec<Motion<f64>>; 2] {
        let mut vel = [vec![Motion::zero(); self.X.len()], vec![Motion::zero(); self.X.len()]];
        for i in 1..self.X.len() {
            vel[1][i] = motion((&self.S[i] * DVector::from_column_slice(v)).as_slice()); // v_J = S q̇
            vel[0][i] = self.X[i].act_inv(vel[0][self.parent(i)]) + vel[1][i]; // v_i = iXλ v_λ + v_J
        }
        vel
    }

    /// Computes τ by table 5.1 of the book.
    fn rnea(&self, State { v, a, f_ext, .. }: &State) -> Vec<f64> {
        let (model, qdd) = (self.model, DVector::from_column_slice(a));
        let [vel, vJ] = self.velocities(v);
        let mut acc = vec![Motion::new(-*model.gravity(), Vec3::zero())]; // a₀ = −g
        let mut f = vec![Force::zero()];
        for i in 1..self.X.len() {
            let own = motion((&self.S[i] * &qdd).as_slice());
            // a_i = iXλ a_λ + S q̈ + v_i × v_J
            acc.push(self.X[i].act_inv(acc[self.parent(i)]) + own + vel[i].cross(vJ[i]));
            let I = model.bodies()[i].inertia;
            f.push(I * acc[i] + vel[i].cross(I * vel[i])); // f_i = I a_i + v_i ×* I v_i − f_x
            if let Some(external) = f_ext.get(i) {
                f[i] -= *external;
            }
        }
        let mut tau = DVector::from(armature_torque(model, v, a));
        for i in (1..self.X.len()).rev() {
            tau += self.S[i].transpose() * Vector6::from(f[i].to_array()); // τ_i = S_iᵀ f_i
            let up = self.X[i].act(f[i]);
            f[self.parent(i)] += up; // f_λ += λX*_i f_i
        }
        tau.as_slice().to_vec()
    }

    /// Computes M by table 6.2 of the book. If joints share a coordinate, several pairs of joints contribute to an
    /// entry of M. So the products of pairs are added.
    fn crba(&self) -> DMatrix<f64> {
        let mut Ic = self.inertias();
        let mut M = DMatrix::from_diagonal(&DVector::from_column_slice(self.model.armature()));
        for i in (1..self.X.len()).rev() {
            let carried = self.up(i).transpose() * Ic[i] * self.up(i);
            Ic[self.parent(i)] += carried; // Ic_λ += λX*_i Ic_i iXλ
            let mut F = Ic[i] * &self.S[i]; // F = Ic_i S_i
            M += self.S[i].transpose() * &F; // H_ii = S_iᵀ F
            let mut j = i;
            while self.parent(j) > 0 {
                F = self.up(j).transpose() * F; // F = λX*_j F
                j = self.parent(j);
                let H = self.S[j].transpose() * &F; // H_ji = S_jᵀ F = H_ijᵀ
                M += &H + H.transpose();
            }
        }
        M
    }

    /// Computes q̈ by table 7.1 of the book. Joints must not share coordinates.
    fn aba(&self, State { v, tau, f_ext, .. }: &State) -> Vec<f64> {
        let (model, bodies) = (self.model, self.X.len());
        let at = |i: usize| (model.bodies()[i].idx_v, model.bodies()[i].joint.nv());
        let vector = Vector6::<f64>::from;
        let [vel, vJ] = self.velocities(v);
        let rotors = DVector::from(armature_torque(model, v, &vec![0.0; model.nv()])); // at q̈ = 0
        let mut IA = self.inertias();
        let [mut c, mut pA] = [(); 2].map(|()| vec![Vector6::zeros(); bodies]);
        for i in 1..bodies {
            c[i] = vector(vel[i].cross(vJ[i]).to_array()); // c_i = v_i × v_J
            let force = vel[i].cross(model.bodies()[i].inertia * vel[i]);
            let external = f_ext.get(i).copied().unwrap_or(Force::zero());
            pA[i] = vector((force - external).to_array()); // pA_i = v_i ×* I v_i − f_x
        }
        let mut U = vec![Matrix6xX::zeros(0); bodies];
        let mut D = vec![DMatrix::zeros(0, 0); bodies];
        let mut u = vec![DVector::zeros(0); bodies];
        for i in (1..bodies).rev() {
            let (first, n) = at(i);
            let S = self.S[i].columns(first, n);
            let armature = DVector::from_column_slice(&model.armature()[first..first + n]);
            U[i] = IA[i] * S; // U_i = IA_i S_i
            D[i] = S.transpose() * &U[i] + DMatrix::from_diagonal(&armature); // D_i = S_iᵀ U_i
            u[i] = DVector::from_column_slice(&tau[first..first + n]) - S.transpose() * pA[i]; // u_i = τ_i − S_iᵀ pA_i
            u[i] -= rotors.rows(first, n);
            let D = D[i].clone().cholesky().expect("D is positive definite");
            let Ia = IA[i] - &U[i] * D.solve(&U[i].transpose()); // Ia = IA − U D⁻¹ Uᵀ
            let pa = pA[i] + Ia * c[i] + &U[i] * D.solve(&u[i]); // pa = pA + Ia c + U D⁻¹ u
            let (parent, up) = (self.parent(i), self.up(i));
            IA[parent] += up.transpose() * Ia * up; // IA_λ += λX*_i Ia iXλ
            pA[parent] += up.transpose() * pa; // pA_λ += λX*_i pa
        }
        let mut acc = vec![vector(Motion::new(-*model.gravity(), Vec3::zero()).to_array())]; // a₀ = −g
        let mut qdd = DVector::zeros(model.nv());
        for i in 1..bodies {
            let (first, n) = at(i);
            let before = self.up(i) * acc[self.parent(i)] + c[i]; // a' = iXλ a_λ + c_i
            let D = D[i].clone().cholesky().expect("D is positive definite");
            let own = D.solve(&(&u[i] - U[i].transpose() * before)); // q̈_i = D⁻¹ (u_i − U_iᵀ a')
            qdd.rows_mut(first, n).copy_from(&own);
            acc.push(before + self.S[i].columns(first, n) * own); // a_i = a' + S_i q̈_i
        }
        qdd.as_slice().to_vec()
    }
}

/// Checks that the library gives the results of the book on the embedded robots and on random trees. The trees have
/// every type of joint, armature, and forces on all bodies.
#[test]
fn the_book_gives_the_same() {
    let mut efforts = Worst::new("rnea = table 5.1", ROUNDING);
    let mut inertias = Worst::new("crba = table 6.2", ROUNDING);
    let mut accelerations = Worst::new("aba = table 7.1", INVERTED);
    let mut shared = Worst::new("forward_dynamics = tables 5.1 and 6.2", INVERTED);
    let mut recursions = 0;
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let mut state = State::random(model, &mut rng(seed as u64));
        let (book, mut data) = (Book::new(model, &state.q), Data::new(model));
        let tau = book.rnea(&state);
        efforts.see(model, rnea(model, &mut data, &state.q, &state.v, &state.a, &state.f_ext), &tau);
        let M = book.crba();
        inertias.see(model, crba(model, &mut data, &state.q).as_slice(), M.as_slice());
        let (q, v, effort, f_ext) = (state.q.clone(), state.v.clone(), state.tau.clone(), state.f_ext.clone());
        if model.bodies().iter().all(|body| body.mimic.is_none()) {
            recursions += 1;
            let expected = book.aba(&state);
            accelerations.see(model, aba(model, &mut data, &q, &v, &effort, &f_ext), &expected);
        } else {
            // The book's recursion does not support joints that share a coordinate: solve M q̈ = τ − h instead.
            state.a.fill(0.0);
            let right = DVector::from_column_slice(&effort) - DVector::from_vec(book.rnea(&state));
            let expected = M.cholesky().expect("M is positive definite").solve(&right);
            let found = forward_dynamics(model, &mut data, &q, &v, &effort, &f_ext, None);
            shared.see(model, found, expected.as_slice());
        }
    }
    assert_eq!(recursions, 4 + TREES);
}
