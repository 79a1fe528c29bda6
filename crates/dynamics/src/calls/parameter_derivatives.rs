//! Derivatives of inverse and forward dynamics with respect to inputs other than q, v, a and τ.
//!
//! Inverse dynamics is linear in external forces, inertial parameters, armature, damping, friction and gravity. So the
//! derivative of τ with respect to such an input is a matrix B. The entries of B follow from quantities that remain in
//! `Data` after the derivatives with respect to q and v are computed:
//!
//! ```text
//! ∂τ/∂f_b = −J_bᵀ                        ∂τ_c/∂π_b = y(S_c, a_b) − y(v_b × S_c, v_b)     (regressor.rs)
//! ∂τ_c/∂g = −(Iᶜ S_c)_linear             ∂τ/∂armature = diag(q̈), + ω × v of a free joint
//! ∂τ/∂damping = diag(q̇)                  ∂τ/∂friction = diag(tanh(q̇/ε))                  (where passive efforts act)
//! ∂τ/∂damping = Rᵀ diag(R v)             ∂τ/∂friction = Rᵀ diag(tanh(R v/ε))             (v of a free joint)
//! ```
//!
//! Here f_b, π_b, v_b and a_b are the external force, inertial parameters, velocity and acceleration of body b, and J_b
//! is the Jacobian of the body. S_c is joint column c, Iᶜ is the inertia of all bodies that the joint carries, and R is
//! the rotation of a free joint. `regressor.rs` defines the form y. ε is the smoothing of friction.
//!
//! For forward dynamics, M q̈ + h = τ gives the derivative −M⁻¹ B of q̈.

use super::derivatives::{AbaDerivatives, RneaDerivatives};
use super::differentiated::State;
use crate::passes::passive::check_smoothing;
use crate::passes::regressor::{PARAMETERS, effort};
use condyle_linalg::check_index;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_spatial::elementary::tanh;
use condyle_spatial::{Act, Constant, Dense, DenseMatrix, Mat3, Matrix, Scalar, Vec3, kernel, same_layout};

/// Input of the dynamics other than position, velocity, acceleration and effort.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Input {
    /// External force on the body with this index: six numbers in the body's frame, linear first, as in `f_ext` (N, N
    /// m).
    Force(usize),
    /// Ten [inertial parameters](crate::inertial_parameters::from_inertia) of the body with this index, in the body's
    /// frame.
    Inertia(usize),
    /// Acceleration of free fall, three numbers in the world's frame (m/s²).
    Gravity,
    /// Armature of each coordinate, nv numbers (kg m², kg).
    Armature,
    /// Viscous damping of each coordinate, nv numbers (N m s/rad, N s/m). The derivative assumes that
    /// [`passive_torque`](crate::passive_torque) acts in addition to τ.
    Damping,
    /// Coulomb friction of each coordinate, nv numbers (N m, N). The derivative assumes that
    /// [`passive_torque`](crate::passive_torque) acts in addition to τ.
    Friction {
        /// Smoothing speed ε of `passive_torque` (rad/s, m/s).
        smoothing: f64,
    },
}

same_layout!(Input);

impl Input {
    /// Returns the number of values in the input. A derivative with respect to the input has this number of columns.
    ///
    /// ```
    /// use condyle_dynamics::{Input, robots};
    /// assert_eq!(Input::Inertia(3).len(&robots::arm7()), 10);
    /// ```
    #[allow(clippy::len_without_is_empty)] // never empty
    pub fn len<R>(self, model: &Model<R>) -> usize {
        match self {
            Self::Force(_) => 6,
            Self::Inertia(_) => PARAMETERS,
            Self::Gravity => 3,
            Self::Armature | Self::Damping | Self::Friction { .. } => model.nv(),
        }
    }
}

/// Destination of the entries of B, the derivative of inverse dynamics with respect to an input. The matrix `out`
/// becomes B, or −M⁻¹ B if `Minv` is given.
struct Entries<'e, S> {
    out: &'e mut [S],
    Minv: Option<&'e Matrix<S>>,
    nv: usize,
}

impl<S: Scalar> Entries<'_, S> {
    /// Adds x to the entry (row, column) of B, the derivative of inverse dynamics. If `Minv` is given, updates the same
    /// column of −M⁻¹ B instead.
    #[inline(always)]
    fn add(&mut self, row: usize, column: usize, x: S) {
        let out = &mut self.out[column * self.nv..(column + 1) * self.nv];
        match self.Minv {
            None => out[row] += x,
            Some(Minv) => {
                let by_row = &Minv.as_slice()[row * self.nv..(row + 1) * self.nv]; // row of M⁻¹: equal to its column
                for i in 0..self.nv {
                    out[i] -= by_row[i] * x; // −M⁻¹ B
                }
            }
        }
    }
}

kernel! {
    /// Computes the derivative B of inverse dynamics, or the derivative −M⁻¹ B of forward dynamics if `Minv` is given.
    fn write<S, R>(state: State<'_, S, R>, input: Input, Minv: Option<&Matrix<S>>, out: &mut [S]) {
        out.fill(S::zero());
        let nv = state.model.nv();
        state.entries(input, &mut Entries { out, Minv, nv });
    }
}

impl<S: Scalar, R: Constant<S>> State<'_, S, R> {
    /// Adds each nonzero entry of B, the derivative of inverse dynamics with respect to `input`, to `to`. An entry may
    /// be the sum of several additions.
    #[inline(always)]
    fn entries(&self, input: Input, to: &mut Entries<'_, S>) {
        let (model, pass) = (self.model, self.pass);
        match input {
            Input::Force(b) => {
                let oXb = self.pose(b);
                for (i, k) in self.columns(b) {
                    let column = &model.columns()[model.nodes()[i].column + k];
                    let S_b = oXb.act_inv(self.column(i, k)).scale(S::splat(-column.ratio)).to_array(); // −J_bᵀ
                    for k in 0..6 {
                        to.add(column.coordinate, k, S_b[k]);
                    }
                }
            }
            Input::Inertia(b) => {
                let (oXb, (v, a)) = (self.pose(b), self.moving(b));
                let (v_b, a_b) = (oXb.act_inv(v), oXb.act_inv(a));
                for (i, k) in self.columns(b) {
                    let column = &model.columns()[model.nodes()[i].column + k];
                    let y = effort(oXb.act_inv(self.column(i, k)).scale(S::splat(column.ratio)), v_b, a_b);
                    for k in 0..PARAMETERS {
                        to.add(column.coordinate, k, y[k]);
                    }
                }
            }
            Input::Gravity => {
                for i in 1..model.nodes().len() {
                    for k in 0..model.nodes()[i].joint.nv() {
                        let column = &model.columns()[model.nodes()[i].column + k];
                        let weight = (self.carried(i) * self.column(i, k)).linear.scale(S::splat(-column.ratio));
                        let weight = weight.to_array();
                        for k in 0..3 {
                            to.add(column.coordinate, k, weight[k]);
                        }
                    }
                }
            }
            Input::Armature => {
                for k in 0..model.nv() {
                    to.add(k, k, self.qdd[k]);
                }
                for node in model.nodes()[1..].iter().filter(|node| node.joint == Joint::FreeFlyer) {
                    let part = |k: usize| Vec3::new(pass.qd[k], pass.qd[k + 1], pass.qd[k + 2]);
                    let turned = part(node.idx_v + 3).cross(part(node.idx_v)).to_array(); // ω × v of a free joint
                    for k in 0..3 {
                        to.add(node.idx_v + k, node.idx_v + k, turned[k]);
                    }
                }
            }
            Input::Damping => self.losses(None, to),
            Input::Friction { smoothing } => self.losses(Some(smoothing), to),
        }
    }
}

impl<S: Scalar, R: Constant<S>> State<'_, S, R> {
    /// Adds the entries of B, the derivative of inverse dynamics with respect to damping, to `to`. If a smoothing ε is
    /// given, B is the derivative with respect to friction instead. The effort x(v) of one unit is v for damping, and
    /// tanh(v/ε) for friction. For a free joint, this effort acts along the axes of the joint's parent. So along the
    /// body's axes, B is Rᵀ diag(x(R v)), with the rotation R of the joint.
    #[inline(always)]
    fn losses(&self, smoothing: Option<f64>, to: &mut Entries<'_, S>) {
        let (model, qd) = (self.model, &self.pass.qd[..]);
        let lost = |v: S| match smoothing {
            None => v,
            Some(smoothing) => tanh(v * S::splat(1.0 / smoothing)),
        };
        for (i, node) in model.nodes().iter().enumerate().skip(1) {
            if node.mimic.is_some() {
                continue; // the coordinate belongs to the leader
            }
            let (first, nv) = (node.idx_v, node.joint.nv());
            let turned = if node.joint == Joint::FreeFlyer { 3 } else { 0 };
            if turned > 0 {
                let rotation = self.free_rotation(i);
                let u = rotation * Vec3::new(qd[first], qd[first + 1], qd[first + 2]);
                let rows = rotation.transpose().columns();
                for (c, u) in u.to_array().into_iter().enumerate() {
                    let column = rows[c].scale(lost(u)).to_array(); // Rᵀ e_c x(u_c)
                    for k in 0..turned {
                        to.add(first + k, first + c, column[k]);
                    }
                }
            }
            for k in first + turned..first + nv {
                to.add(k, k, lost(qd[k]));
            }
        }
    }

    /// Returns the rotation of a free joint, from the axes of its body to the axes of its parent.
    #[inline(always)]
    fn free_rotation(&self, i: usize) -> Mat3<S> {
        let body = &self.model.bodies()[i];
        let mut rotation: Mat3<S> = body.placement.rotation.lift();
        if body.parent > 0 {
            rotation = self.pose(body.parent).rotation * rotation;
        }
        rotation.transpose() * self.pose(i).rotation
    }
}

impl Input {
    /// Panics if the input does not exist in the model, or the matrix `name` does not have the shape of the derivative.
    #[track_caller]
    pub(crate) fn check<R>(self, model: &Model<R>, name: &str, found: (usize, usize)) {
        let shape = (model.nv(), self.len(model));
        assert!(found == shape, "{name}: expected {} × {}, found {found:?}", shape.0, shape.1);
        let bodies = model.nodes().len();
        match self {
            Self::Force(body) => check_index("input", body, bodies, "bodies"),
            Self::Inertia(body) => {
                assert!(body > 0, "input: the world has no inertia");
                check_index("input", body, bodies, "bodies");
            }
            Self::Friction { smoothing } => check_smoothing(smoothing),
            _ => {}
        }
    }
}

impl<S: Scalar, R: Constant<S>> RneaDerivatives<'_, S, R> {
    /// Computes the derivative of τ with respect to an input other than q, v and a, nv × [`Input::len`], in at most
    /// O(n) operations per column. Overwrites dtau.
    ///
    /// ```
    /// use condyle_dynamics::{Data, Input, rnea, rnea_derivatives, robots};
    /// use nalgebra::{DMatrix, dvector};
    /// let arm = robots::arm7();
    /// let mut data = Data::new(&arm);
    /// let (q, o) = ([0.3; 7], [0.0; 7]);
    /// let mut dtau_dg = DMatrix::zeros(7, 3);
    /// rnea_derivatives(&arm, &mut data, &q, &o, &o, &[]).with_respect_to(Input::Gravity, &mut dtau_dg);
    /// let weight = rnea(&arm, &mut data, &q, &o, &o, &[])[1];
    /// assert!(f64::abs((dtau_dg * dvector![0.0, 0.0, -9.81])[1] - weight) < 1e-12); // τ is linear in g
    /// ```
    ///
    /// # Panics
    /// Panics if `dtau` is not nv × [`Input::len`], the input's body does not exist, the input is the inertia of the
    /// world, or the input's smoothing is not positive.
    #[track_caller]
    pub fn with_respect_to(&self, input: Input, dtau: &mut DenseMatrix<S, impl Dense<S>>) {
        input.check(self.state.model, "dtau", dtau.shape());
        self.write_input(input, dtau.as_mut_slice());
    }

    /// Computes the derivative of τ with respect to an input other than q, v and a, stored by columns.
    pub(crate) fn write_input(&self, input: Input, dtau: &mut [S]) {
        let model = self.state.model;
        input.check(model, "dtau", (model.nv(), input.len(model)));
        write(self.state, input, None, dtau);
    }
}

impl<S: Scalar, R: Constant<S>> AbaDerivatives<'_, S, R> {
    /// Computes the derivative of q̈ with respect to an input other than q, v and τ, nv × [`Input::len`], in at most
    /// O(n²) operations per column. Overwrites da.
    ///
    /// ```
    /// use condyle_dynamics::{Data, Input, aba_derivatives, neutral, robots};
    /// use nalgebra::DMatrix;
    /// let quadruped = robots::quadruped();
    /// let (mut data, o) = (Data::new(&quadruped), [0.0; 18]);
    /// let mut da_df = DMatrix::zeros(18, 6);
    /// let d = aba_derivatives(&quadruped, &mut data, &neutral(&quadruped), &o, &o, &[]);
    /// d.with_respect_to(Input::Force(1), &mut da_df);
    /// assert!((da_df - d.da_dtau.columns(0, 6)).amax() < 1e-12); // a force on the trunk is an effort of its joint
    /// ```
    ///
    /// # Panics
    /// Panics if `da` is not nv × [`Input::len`], the input's body does not exist, the input is the inertia of the
    /// world, or the input's smoothing is not positive.
    #[track_caller]
    pub fn with_respect_to(&self, input: Input, da: &mut DenseMatrix<S, impl Dense<S>>) {
        input.check(self.state.model, "da", da.shape());
        self.write_input(input, da.as_mut_slice());
    }

    /// Computes the derivative of q̈ with respect to an input other than q, v and τ, stored by columns.
    pub(crate) fn write_input(&self, input: Input, da: &mut [S]) {
        let model = self.state.model;
        input.check(model, "da", (model.nv(), input.len(model)));
        write(self.state, input, Some(self.da_dtau), da);
    }
}
