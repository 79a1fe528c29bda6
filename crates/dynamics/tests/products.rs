//! Tests of products with every matrix that a call or a batch returns. The other factors are vectors and matrices. The
//! results are compared with plain loops.
//!
//! nalgebra multiplies without checking bounds, so it must support the layout of each matrix. (In nalgebra's issue
//! 1616, a product with a view whose rows are not adjacent writes out of bounds.) This program is small, because
//! `tests/products.sh` compiles it with AddressSanitizer. The script then runs it at every SIMD level of the machine.
#![allow(non_snake_case)]

use condyle_dynamics::level::level;
use condyle_dynamics::*;
use nalgebra::{DMatrix, DVector, DVectorView, Dim, Dyn, Matrix, Storage};
use std::collections::BTreeSet;

/// Tolerance relative to the largest product: a few rounding errors in sums of few terms.
const ROUNDING: f64 = 1e-12;

/// Number of states of a batch. The states fill several groups of lanes, but not the last group.
const STATES: usize = 19;

/// Returns pseudo-random numbers between −1 and 1.
fn numbers(n: usize, seed: usize) -> Vec<f64> {
    (0..n).map(|k| ((k + 1) as f64 * 12.9898 + seed as f64 * 78.233).sin()).collect()
}

fn vector(n: usize) -> DVector<f64> {
    DVector::from_vec(numbers(n, 1))
}

fn matrix(rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_vec(rows, columns, numbers(rows * columns, 2))
}

/// Computes A B by three nested loops.
fn plain(A: &DMatrix<f64>, B: &DMatrix<f64>) -> DMatrix<f64> {
    let mut C = DMatrix::zeros(A.nrows(), B.ncols());
    for i in 0..A.nrows() {
        for j in 0..B.ncols() {
            for k in 0..A.ncols() {
                C[(i, j)] += A[(i, k)] * B[(k, j)];
            }
        }
    }
    C
}

/// Returns a vector as a matrix of one column.
fn column(x: &DVector<f64>) -> DMatrix<f64> {
    DMatrix::from_column_slice(x.len(), 1, x.as_slice())
}

fn equal<R: Dim, C: Dim>(found: &Matrix<f64, R, C, impl Storage<f64, R, C>>, expected: &DMatrix<f64>, what: &str) {
    assert_eq!(found.shape(), expected.shape(), "{what}");
    let scale = 1.0 + expected.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    for i in 0..expected.nrows() {
        for j in 0..expected.ncols() {
            let (x, y) = (found[(i, j)], expected[(i, j)]);
            assert!((x - y).abs() <= ROUNDING * scale, "{what}: ({i}, {j}) is {x}, expected {y}");
        }
    }
}

/// Multiplies a matrix of nalgebra with all types of factors for which nalgebra has separate code.
fn multiply(what: &str, M: &Matrix<f64, Dyn, Dyn, impl Storage<f64, Dyn, Dyn>>) {
    let (m, n) = M.shape();
    let copy = DMatrix::from_fn(m, n, |i, j| M[(i, j)]);
    assert!(copy.iter().all(|x| x.is_finite()), "{what} is not finite");
    let (x, y, few, many) = (vector(n), vector(m), matrix(n, 2), matrix(n, 9));
    let expected = plain(&copy, &column(&x));
    equal(&(M * &x), &expected, what);
    equal(&(M * DVectorView::from_slice(x.as_slice(), n)), &expected, what);
    let mut out = y.clone();
    out.gemv(1.0, M, &x, 0.0);
    equal(&out, &expected, what);
    let transposed = plain(&copy.transpose(), &column(&y));
    equal(&M.tr_mul(&y), &transposed, what);
    equal(&(M.transpose() * &y), &transposed, what);
    let mut out = x.clone();
    out.gemv_tr(1.0, M, &y, 0.0);
    equal(&out, &transposed, what);
    equal(&(M * &few), &plain(&copy, &few), what); // nalgebra has separate code for small and large products
    equal(&(M * &many), &plain(&copy, &many), what);
    equal(&(M * many.columns(1, 7)), &plain(&copy, &many.columns(1, 7).into_owned()), what);
    let left = matrix(8, m);
    equal(&(&left * M), &plain(&left, &copy), what);
    equal(&(M + M), &(&copy * 2.0), what);
    if m > 1 && n > 0 {
        equal(&(M.rows(1, m - 1) * &x), &plain(&copy.rows(1, m - 1).into_owned(), &column(&x)), what);
        equal(&(M.row(m - 1) * &x), &plain(&copy.rows(m - 1, 1).into_owned(), &column(&x)), what);
        let mut sum = y.clone();
        sum.axpy(2.0, &M.column(n - 1), 1.0);
        equal(&sum, &(column(&y) + copy.columns(n - 1, 1) * 2.0), what);
    }
}

/// Multiplies the matrix of one state of a batch with operands of all types.
fn multiply_state(what: &str, M: StateMatrix<'_, f64>) {
    let (m, n) = M.shape();
    let copy = DMatrix::from_fn(m, n, |i, j| M[(i, j)]);
    assert!(copy.iter().all(|x| x.is_finite()), "{what} is not finite");
    let (x, y, B, borrowed) = (vector(n), vector(m), matrix(n, 9), &M);
    let expected = plain(&copy, &column(&x));
    equal(&(M * &x), &expected, what);
    equal(&(borrowed * x.clone()), &expected, what);
    equal(&(M * DVectorView::from_slice(x.as_slice(), n)), &expected, what);
    equal(&(M * x.as_slice()), &expected, what);
    let mut out = y.clone();
    M.mul_to(&x, &mut out);
    equal(&out, &expected, what);
    M.mul_vector_to(x.as_slice(), out.as_mut_slice());
    equal(&out, &expected, what);
    equal(&(M.transpose() * &y), &plain(&copy.transpose(), &column(&y)), what);
    equal(&(M * &B), &plain(&copy, &B), what);
    let mut out = matrix(m, 9);
    M.mul_to(&B, &mut out);
    equal(&out, &plain(&copy, &B), what);
    let left = matrix(8, m);
    equal(&(&left * M), &plain(&left, &copy), what);
    equal(&(M.transpose() * M), &plain(&copy.transpose(), &copy), what);
    equal(&(M + copy.clone()), &(&copy * 2.0), what);
    equal(&(&copy - M), &DMatrix::zeros(m, n), what);
    equal(&DMatrix::from(M), &copy, what);
    multiply(what, &M.to_owned());
    let mut whole = DMatrix::zeros(m + 1, n + 1);
    M.copy_to(&mut whole.view_mut((1, 1), (m, n)));
    equal(&whole.view((1, 1), (m, n)), &copy, what);
    let mut rows = vec![f64::NAN; m * n];
    M.write_rows(&mut rows);
    assert!(rows.iter().eq(&M.transpose()) && copy.iter().eq(&M), "{what}");
    if m > 1 && n > 0 {
        equal(&(M.rows(1, m - 1) * &x), &plain(&copy.rows(1, m - 1).into_owned(), &column(&x)), what);
        equal(&(M.row(m - 1) * &x), &plain(&copy.rows(m - 1, 1).into_owned(), &column(&x)), what);
        equal(&M.column(n - 1).to_owned(), &copy.columns(n - 1, 1).into_owned(), what);
    }
}

/// Multiplies the first, a middle and the last matrix of a batch.
fn multiply_all(what: &str, matrices: Matrices<'_, f64>) {
    assert_eq!(matrices.len(), STATES, "{what}");
    [0, STATES / 2, STATES - 1].into_iter().for_each(|k| multiply_state(what, matrices.at(k)));
}

fn rod() -> Inertia<f64> {
    Inertia::from_com(1.0, Vec3::new(0.02, 0.01, -0.2), Sym3::diagonal(0.05))
}

fn below() -> Se3<f64> {
    Se3 { translation: Vec3::new(0.0, 0.1, -0.4), ..Se3::identity() }
}

fn axis(k: usize) -> Vec3<f64> {
    Vec3::from(core::array::from_fn(|i| f64::from(u8::from(i == k % 3))))
}

/// Creates a chain of n joints.
fn chain(n: usize) -> Model {
    let (mut builder, mut at) = (ModelBuilder::new("chain"), WORLD);
    for k in 0..n {
        at = builder.body(&format!("link{k}"), at, Joint::Revolute { axis: axis(k) }, below(), rod());
    }
    builder.frame("tip", at, below());
    builder.build().unwrap()
}

/// Creates a floating trunk with four legs of three joints. Single calls compute the four legs in parallel lanes.
fn walker() -> Model {
    let mut builder = ModelBuilder::new("walker");
    let trunk = builder.body("trunk", WORLD, Joint::FreeFlyer, Se3::identity(), rod());
    for leg in 0..4 {
        let hip = Vec3::new(if leg < 2 { 0.3 } else { -0.3 }, if leg % 2 == 0 { 0.2 } else { -0.2 }, 0.0);
        let mut at = trunk;
        for k in 0..3 {
            let placement = if k == 0 { Se3 { translation: hip, ..Se3::identity() } } else { below() };
            at = builder.body(&format!("leg{leg}_{k}"), at, Joint::Revolute { axis: axis(k) }, placement, rod());
        }
        builder.frame(&format!("foot{leg}"), at, below());
    }
    builder.build().unwrap()
}

/// Positions, velocities, accelerations or efforts, and forces of several states.
struct States {
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
    f_ext: Vec<Force<f64>>,
}

impl States {
    fn new(model: &Model, count: usize) -> Self {
        let (nq, nv, bodies) = (model.nq(), model.nv(), model.bodies().len());
        let mut q = numbers(count * nq, 3);
        q.chunks_exact_mut(nq.max(1)).for_each(|q| condyle_dynamics::normalize(model, q));
        let f_ext = numbers(6 * count * bodies, 6).as_chunks::<6>().0.iter().map(|&f| f.into()).collect();
        Self { q, v: numbers(count * nv, 4), x: numbers(count * nv, 5), f_ext }
    }
}

/// Returns contacts at the last two frames, if the robot has enough degrees of freedom for them.
fn contacts(model: &Model) -> Vec<ContactConstraint> {
    let frames = (0..model.frames().len()).rev().take(2);
    if model.nv() < 6 { Vec::new() } else { frames.map(ContactConstraint::point).collect() }
}

/// Calls a function that multiplies matrices, for each of the given fields of a result.
macro_rules! multiply {
    ($name:literal, $result:expr, $multiply:ident: $($($member:ident).+),+) => {{
        let r = $result;
        $($multiply(concat!($name, ", ", stringify!($($member).+)), r.$($member).+);)+
    }};
}

/// Checks the matrices of every single call that returns a matrix.
fn single_calls(model: &Model) {
    let States { q, v, x, f_ext } = &States::new(model, 1);
    let (m, d, nv) = (model, &mut Data::<f64>::new(model), model.nv());
    let c = &mut ConstraintSet::<f64>::new(model, &contacts(model)).unwrap();
    let lambda = &numbers(nv, 7);

    multiply("crba", crba(m, d, q));
    multiply("minv", minv(m, d, q));
    multiply("coriolis_matrix", coriolis_matrix(m, d, q, v));
    multiply("static_torque_derivative", static_torque_derivative(m, d, q, f_ext));
    multiply("joint_torque_regressor", joint_torque_regressor(m, d, q, v, x));
    multiply!("rnea_derivatives", rnea_derivatives(m, d, q, v, x, f_ext), multiply: dtau_dq, dtau_dv, dtau_da);
    multiply!("aba_derivatives", aba_derivatives(m, d, q, v, x, f_ext), multiply: da_dq, da_dv, da_dtau);
    multiply!("coriolis_derivatives", coriolis_derivatives(m, d, q, v), multiply: dq, dv);
    multiply!("rnea_hessian", rnea_hessian(m, d, q, v, x, f_ext, lambda), multiply: dqdq, dvdq, dvdv, dadq);
    multiply!("aba_hessian", aba_hessian(m, d, q, v, x, f_ext, lambda), multiply: dqdq, dvdq, dvdv, dtaudq);
    multiply!("centroidal_map", centroidal_map(m, d, q), multiply: Ag, Jcom);
    multiply!("centroidal_map_rate", centroidal_map_rate(m, d, q, v), multiply: Ag, dAg, Jcom);
    multiply!("compute_all_terms", compute_all_terms(m, d, q, v), multiply:
        M, centroidal.Ag, centroidal.dAg, centroidal.Jcom);
    multiply!("centroidal_derivatives", centroidal_derivatives(m, d, q, v, x), multiply:
        dh_dq, dh_dv, drate_dq, drate_dv, drate_da, dcom_dq, dvcom_dq, dacom_dq, dacom_dv);
    multiply!("constrained_dynamics_derivatives", constrained_dynamics_derivatives(m, d, c, q, v, x, f_ext), multiply:
        da_dq, da_dv, da_dtau, dlambda_dq, dlambda_dv, dlambda_dtau, inertia);
    multiply!("constrained_dynamics_equations", constrained_dynamics_equations(m, d, c, q, v, x, f_ext), multiply:
        M, dtau_dq, dtau_dv, dgamma_dq, dgamma_dv);
    multiply!("impulse_dynamics_derivatives", impulse_dynamics_derivatives(m, d, c, q, v, 0.3), multiply:
        dv_dq, dv_dv, dlambda_dq, dlambda_dv, inertia);
    let forces = &numbers(c.rows(), 8);
    let inverse = constrained_inverse_dynamics_derivatives(m, d, c, q, v, x, forces, f_ext);
    multiply!("constrained_inverse_dynamics_derivatives", inverse, multiply:
        M, dtau_dq, dtau_dv, dacceleration_dq, dacceleration_dv);

    // The following functions write to matrices of the caller.
    let mut J = DMatrix::zeros(c.rows(), nv);
    c.jacobian(&mut J);
    multiply("jacobian of constraints", &J);
    let mut tensors = RneaSecondDerivatives::new(m);
    rnea_second_derivatives(m, d, q, v, x, f_ext, &mut tensors);
    tensors.dqdq.iter().chain(&tensors.dadq).take(3).for_each(|T| multiply("rnea_second_derivatives", T));
    let (mut J, mut other, axes) = (DMatrix::zeros(6, nv), DMatrix::zeros(6, nv), ReferenceFrame::LocalWorldAligned);
    let last = m.frames().len() - 1;
    frame_jacobian(m, q, last, axes, &mut J);
    multiply("frame_jacobian", &J);
    let motion = forward_accelerations(m, d, q, v, x);
    motion.frame_jacobian(last, axes, &mut J);
    multiply("frame_jacobian of placements", &J);
    motion.frame_jacobian_rate(last, axes, &mut J);
    multiply("frame_jacobian_rate", &J);
    let mut of_point = DMatrix::zeros(3, nv);
    motion.frame_point_jacobian(last, Vec3::new(0.1, 0.2, 0.3), &mut of_point);
    multiply("frame_point_jacobian", &of_point);
    motion.frame_acceleration_derivatives(last, axes, &mut J, &mut other);
    multiply("frame_acceleration_derivatives", &J);
    multiply("frame_acceleration_derivatives", &other);
    let mut by_gravity = DMatrix::zeros(nv, 3);
    aba_derivatives(m, d, q, v, x, f_ext).with_respect_to(Input::Gravity, &mut by_gravity);
    multiply("aba_derivatives by gravity", &by_gravity);
    let mut square = DMatrix::zeros(nv, nv);
    integrate_jacobian(m, v, IntegrateArgument::Velocity, &mut square);
    multiply("integrate_jacobian", &square);
    let mut sparse = Ltdl::new(m);
    sparse.factorize(crba(m, d, q));
    sparse.inverse(&mut square);
    multiply("inverse by Ltdl", &square);
    let mut by_v = DMatrix::zeros(nv, nv);
    passive_torque_derivatives(m, q, v, 0.1, &mut square, &mut by_v);
    multiply("passive_torque_derivatives by q", &square);
    multiply("passive_torque_derivatives by v", &by_v);
    let mut dense = Cholesky::new(nv);
    dense.factorize(crba(m, d, q));
    multiply("factor of Cholesky", dense.lower());
}

/// Checks the matrices of every function of a batch that returns matrices. Returns the names of these functions.
fn batches(model: &Model) -> BTreeSet<&'static str> {
    let States { q, v, x, f_ext } = &States::new(model, STATES);
    let (m, b) = (model, &mut Batch::new(model, STATES, 1));
    let c: &mut BatchConstraints = &mut b.constraints(model, &contacts(model), ProximalSettings::default()).unwrap();
    let (lambda, axes) = (&numbers(STATES * m.nv(), 7), ReferenceFrame::LocalWorldAligned);
    let (body, frame) = (m.bodies().len() - 1, m.frames().len().wrapping_sub(1));
    let mut called = BTreeSet::new();
    macro_rules! all {
        ($($name:ident($($argument:expr),*) $([$($($member:ident).+),+])?;)*) => {$(
            let r = b.$name(m, $($argument),*);
            let mut multiplied = 0;
            all!(@multiply $name, r, multiplied $(, [$($($member).+),+])?);
            let matrices = b.last_shapes().filter(|shape| shape.len() > 1).count();
            assert_eq!(multiplied, matrices, "{} returns more matrices", stringify!($name));
            called.insert(stringify!($name));
        )*};
        (@multiply $name:ident, $r:ident, $count:ident) => {
            multiply_all(stringify!($name), $r);
            $count += 1;
        };
        (@multiply $name:ident, $r:ident, $count:ident, [$($($member:ident).+),+]) => {$(
            multiply_all(concat!(stringify!($name), ", ", stringify!($($member).+)), $r.$($member).+);
            $count += 1;
        )+};
    }
    all! {
        crba(q);
        minv(q);
        coriolis_matrix(q, v);
        rnea_derivatives(q, v, x, f_ext) [dtau_dq, dtau_dv, dtau_da];
        aba_derivatives(q, v, x, f_ext) [da_dq, da_dv, da_dtau];
        static_torque_derivative(q, f_ext);
        coriolis_derivatives(q, v) [dq, dv];
        passive_torque_derivatives(q, v, 0.1) [dtau_dq, dtau_dv];
        rnea_hessian(q, v, x, f_ext, lambda) [dqdq, dvdq, dvdv, dadq];
        aba_hessian(q, v, x, f_ext, lambda) [dqdq, dvdq, dvdv, dtaudq];
        rnea_second_derivatives(q, v, x, f_ext) [dqdq, dvdq, dvdv, dadq];
        rnea_input_derivative(q, v, x, f_ext, Input::Gravity);
        aba_input_derivative(q, v, x, f_ext, Input::Force(body));
        centroidal_map(q) [Ag, Ig, Jcom];
        centroidal_map_rate(q, v) [Ag, dAg, Ig, Jcom];
        com_jacobian(q);
        compute_all_terms(q, v) [M, centroidal.Ag, centroidal.dAg, centroidal.Ig, centroidal.Jcom];
        centroidal_derivatives(q, v, x)
            [dh_dq, dh_dv, drate_dq, drate_dv, drate_da, dcom_dq, dvcom_dq, dacom_dq, dacom_dv];
        joint_torque_regressor(q, v, x);
        constrained_dynamics_derivatives(c, q, v, x, f_ext)
            [da_dq, da_dv, da_dtau, dlambda_dq, dlambda_dv, dlambda_dtau, inertia];
        constrained_dynamics_equations(c, q, v, x, f_ext) [M, dtau_dq, dtau_dv, dgamma_dq, dgamma_dv];
        impulse_dynamics_derivatives(c, q, v, 0.3) [dv_dq, dv_dv, dlambda_dq, dlambda_dv, inertia];
        body_jacobian(q, body, axes);
        body_jacobian_rate(q, v, body, axes);
        body_velocity_derivative(q, v, body, axes);
        body_acceleration_derivatives(q, v, x, body, axes) [da_dq, da_dv];
    }
    if frame < m.frames().len() {
        all! {
            frame_jacobian(q, frame, axes);
            frame_jacobian_rate(q, v, frame, axes);
            frame_velocity_derivative(q, v, frame, axes);
            frame_acceleration_derivatives(q, v, x, frame, axes) [da_dq, da_dv];
            frame_classical_acceleration_derivatives(q, v, x, frame, axes) [da_dq, da_dv];
        }
    }
    called
}

/// Reads from the source files the names of the functions of a batch whose results contain matrices.
fn functions_with_matrices() -> BTreeSet<String> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/batch");
    let mut names = BTreeSet::new();
    for file in ["centroidal", "constrained", "derivatives", "dynamics", "kinematics"] {
        let text = std::fs::read_to_string(format!("{folder}/{file}.rs")).unwrap();
        for entry in text.split("\n    fn ").skip(1) {
            let (name, rest) = entry.split_once("(model, data").expect("an entry of the table");
            let result = rest.split_once("-> ").expect("a result").1;
            let numbers_alone = ["BatchConstrained<", "BatchImpulse<", "BatchEnergyDerivatives<", "&[T]", "Poses<"];
            if !numbers_alone.iter().any(|kind| result.starts_with(kind)) {
                names.insert(name.to_owned());
            }
        }
    }
    names
}

#[test]
fn products() {
    let level = level().name();
    if let Ok(wanted) = std::env::var("CONDYLE_LEVEL")
        && wanted != level
    {
        return println!("NOT RUN: this processor does not have {wanted}");
    }
    println!("at level {level}");
    for model in [chain(1), chain(7), walker()] {
        single_calls(&model);
        batches(&model);
    }
    let called: BTreeSet<String> = batches(&walker()).into_iter().map(str::to_owned).collect();
    assert_eq!(called, functions_with_matrices());
}

/// Checks that a robot without coordinates has matrices without entries, and products of the right sizes.
#[test]
fn empty_products() {
    let model = ModelBuilder::new("nothing").build().unwrap();
    let mut batch = Batch::new(&model, 2, 1);
    let M = batch.crba(&model, &[]).at(1);
    assert_eq!((M.shape(), M.is_empty(), M.amax(), M.norm()), ((0, 0), true, 0.0, 0.0));
    assert_eq!((M * &DVector::zeros(0)).len(), 0);
    assert_eq!((M * &DMatrix::zeros(0, 3)).shape(), (0, 3));
    assert_eq!((DMatrix::<f64>::zeros(3, 0) * M).shape(), (3, 0));
    assert_eq!(M.iter().len() + M.row_iter().len() + M.column_iter().len(), 0);
    assert_eq!(M, M.to_owned());
}
