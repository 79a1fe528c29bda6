//! Table of the functions of a batch. Each row also has the same function for a single state, whose results have the
//! same order.

use crate::common::table::Input;
use condyle_dynamics::{
    Batch, BatchConstraints, ConstraintSet, ContactConstraint, Data, Dense, DenseMatrix, Force, ForwardDynamicsMethod,
    Inertia, Matrices, Model, Motion, Poses, ProximalSettings, ReferenceFrame, RneaSecondDerivatives, Scalar, Se3,
    Vec3, aba, aba_derivatives, aba_hessian, body_jacobian, centroidal_derivatives, centroidal_map,
    centroidal_map_rate, compute_all_terms, constrained_dynamics, constrained_dynamics_derivatives,
    constrained_dynamics_equations, coriolis_derivatives, coriolis_matrix, crba, energy_derivatives,
    forward_accelerations, forward_dynamics, forward_kinematics, forward_velocities, frame_jacobian, gravity,
    impulse_dynamics, impulse_dynamics_derivatives, joint_torque_regressor, kinetic_energy_regressor, minv,
    nonlinear_effects, passive_torque, passive_torque_derivatives, potential_energy_regressor, rnea, rnea_derivatives,
    rnea_hessian, rnea_second_derivatives, static_torque, static_torque_derivative,
};
use condyle_spatial::block::Real;
use nalgebra::DMatrix;

/// Arguments of many states. Each field holds the numbers of all states, one state after the other.
pub(crate) struct States<T> {
    pub(crate) q: Vec<T>,
    pub(crate) v: Vec<T>,
    pub(crate) x: Vec<T>,
    pub(crate) f_ext: Vec<Force<T>>,
}

impl<T: Copy> States<T> {
    pub(crate) fn of(all: &[Input<T>]) -> Self {
        let numbers = |part: fn(&Input<T>) -> &[T]| all.iter().flat_map(part).copied().collect();
        let f_ext = all.iter().flat_map(|i| &i.f_ext).copied().collect();
        Self { q: numbers(|i| &i.q), v: numbers(|i| &i.v), x: numbers(|i| &i.x), f_ext }
    }
}

/// Results of a function. Each entry of `results` holds the numbers of one result for all states.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Found<T> {
    pub(crate) results: Vec<Vec<T>>,
    next: usize,
}

impl<T: Copy> Found<T> {
    /// Appends numbers to the next result: the numbers of all states at once, or the numbers of one more state.
    fn extend(&mut self, numbers: impl Iterator<Item = T>) {
        if self.results.len() == self.next {
            self.results.push(Vec::new());
        }
        self.results[self.next].extend(numbers);
        self.next += 1;
    }

    /// Continues with the first result, to append the numbers of the next state.
    pub(crate) fn again(&mut self) {
        self.next = 0;
    }

    /// Returns empty lists of results with the same capacity.
    pub(crate) fn emptied(&self) -> Self {
        Self { results: self.results.iter().map(|of| Vec::with_capacity(of.len())).collect(), next: 0 }
    }
}

/// Result of a function that can be stored in a `Found`, for one state or for many states.
trait Put<T> {
    fn put(self, to: &mut Found<T>);
}

impl<T: Copy> Put<T> for &[T] {
    fn put(self, to: &mut Found<T>) {
        to.extend(self.iter().copied());
    }
}

/// Stores the matrix by columns.
impl<T: Scalar, Storage: Dense<T>> Put<T> for &DenseMatrix<T, Storage> {
    fn put(self, to: &mut Found<T>) {
        to.extend(self.iter().copied());
    }
}

impl<T: Real> Put<T> for Matrices<'_, T> {
    fn put(self, to: &mut Found<T>) {
        if to.results.len() == to.next {
            to.results.push(Vec::new());
        }
        self.iter().for_each(|matrix| to.results[to.next].extend(matrix.iter()));
        to.next += 1;
    }
}

macro_rules! arrays {
    ($($type:ident),*) => {$(
        impl<T: Scalar> Put<T> for $type<T> {
            fn put(self, to: &mut Found<T>) {
                to.extend(self.to_array().into_iter());
            }
        }
    )*};
}
arrays!(Vec3, Motion, Force);

/// Stores the 6 × 6 matrix [m 1, 0; 0, Ī] by columns.
impl<T: Scalar> Put<T> for Inertia<T> {
    fn put(self, to: &mut Found<T>) {
        let (o, axes) = (T::zero(), self.rotational.full().columns().map(Vec3::to_array));
        to.extend((0..36).map(|k| match (k % 6, k / 6) {
            (i, j) if i < 3 && i == j => self.mass,
            (i, j) if i >= 3 && j >= 3 => axes[j - 3][i - 3],
            _ => o,
        }));
    }
}

fn of_pose<T: Scalar>(X: Se3<T>) -> impl Iterator<Item = T> {
    X.rotation.columns().into_iter().chain([X.translation]).flat_map(Vec3::to_array)
}

/// Stores `each` poses for each of `states` states.
fn put_poses<T: Real>(poses: Poses<'_, T>, [states, each]: [usize; 2], to: &mut Found<T>) {
    to.extend((0..states).flat_map(|k| (0..each).flat_map(move |i| of_pose(poses.at(k, i)))));
}

/// Returns the number of states, computed from the length of q. If the robot has no coordinates, returns the capacity
/// of the batch.
fn count<T: Real>(m: &Model, b: &Batch<T>, s: &States<T>) -> usize {
    s.q.len().checked_div(m.nq()).unwrap_or(b.capacity())
}

type Many<T> = fn(&Model, &mut Batch<T>, &mut BatchConstraints<T>, &States<T>, &mut Found<T>);
type One<T> = fn(&Model, &mut Data<T>, &mut ConstraintSet<T>, &Input<T>, &mut Found<T>);

/// Row of this file's table: a function for all states by a batch, and the same function for one state.
pub(crate) struct Row<T: Real> {
    pub(crate) name: &'static str,
    pub(crate) many: Many<T>,
    pub(crate) one: One<T>,
}

macro_rules! argument {
    ($from:ident, $c:ident, constraints) => {
        $c
    };
    ($from:ident, $c:ident, a) => {
        &$from.x
    };
    ($from:ident, $c:ident, tau) => {
        &$from.x
    };
    ($from:ident, $c:ident, lambda) => {
        &$from.v
    };
    ($from:ident, $c:ident, $name:ident) => {
        &$from.$name
    };
}

/// Creates a row for each function. An entry lists the arguments and the fields of the result. Fields after the
/// semicolon are plain numbers for a single state.
macro_rules! rows {
    ($($name:ident($($argument:ident),*) $({ $($($member:ident).+),+ $(; $($number:ident),+)? })?;)*) => { vec![$(Row {
        name: stringify!($name),
        many: |m, b, _c, s, to| {
            let r = b.$name(m, $(argument!(s, _c, $argument)),*);
            rows!(@put r, to $(, [$($($member).+),+])?);
            $($($(r.$number.put(to);)+)?)?
        },
        one: |m, d, _c, i, to| {
            let r = rows!(@one $name, m, d, _c, i, $($argument),*);
            rows!(@put r, to $(, [$($($member).+),+])?);
            $($($([r.$number][..].put(to);)+)?)?
        },
    }),*] };
    (@put $r:ident, $to:ident) => { $r.put($to) };
    (@put $r:ident, $to:ident, [$($($member:ident).+),+]) => { $($r.$($member).+.put($to);)+ };
    (@one $name:ident, $m:ident, $d:ident, $c:ident, $i:ident, $($argument:ident),*) => {
        $name($m, $d, $(argument!($i, $c, $argument)),*)
    };
}

/// Creates a row for each function of a frame or a body. The row calls the function for the last frame or body, in each
/// reference frame. Names after `fills` are matrices that the function fills.
macro_rules! questions {
    ($T:ident; $($name:ident($of:ident) after $pass:ident($($argument:ident),*) $(fills [$($member:ident),+])?;)*) => {
        vec![$(Row {
            name: stringify!($name),
            many: |m, b, _c, s, to| {
                for reference in REFERENCES {
                    let r = b.$name(m, $(argument!(s, _c, $argument),)* $of(m), reference);
                    questions!(@many r, to $(, [$($member),+])?);
                }
            },
            one: |m, d, _c, i, to| {
                for reference in REFERENCES {
                    let motion = $pass(m, d, $(argument!(i, _c, $argument)),*);
                    questions!(@one $T, m, motion, $name, $of, reference, to $(, [$($member),+])?);
                }
            },
        }),*]
    };
    (@many $r:ident, $to:ident $(, [$one:ident])?) => { $r.put($to) };
    (@many $r:ident, $to:ident, [$($member:ident),+]) => { $($r.$member.put($to);)+ };
    (@one $T:ident, $m:ident, $motion:ident, $name:ident, $of:ident, $reference:ident, $to:ident) => {
        $motion.$name($of($m), $reference).put($to)
    };
    (
        @one $T:ident, $m:ident, $motion:ident, $name:ident, $of:ident, $reference:ident, $to:ident,
        [$($member:ident),+]
    ) => {
        $(let mut $member = DMatrix::from_element(6, $m.nv(), $T::zero());)+
        $motion.$name($of($m), $reference, $(&mut $member),+);
        $((&$member).put($to);)+
    };
}

/// Creates a row for each quantity that is a sum over the bodies. The marker `[number]` is for sums that are single
/// numbers.
macro_rules! sums {
    ($($name:ident after $pass:ident($($argument:ident),*) $([$number:ident])?;)*) => { vec![$(Row {
        name: stringify!($name),
        many: |m, b, _c, s, to| b.$name(m, $(argument!(s, _c, $argument)),*).put(to),
        one: |m, d, _c, i, to| {
            let r = $pass(m, d, $(argument!(i, _c, $argument)),*).$name();
            sums!(@put r, to $(, $number)?);
        },
    }),*] };
    (@put $r:ident, $to:ident) => { $r.put($to) };
    (@put $r:ident, $to:ident, number) => { [$r][..].put($to) };
}

const REFERENCES: [ReferenceFrame; 3] =
    [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned];

fn last_frame(model: &Model) -> usize {
    model.frames().len() - 1
}

fn last_body(model: &Model) -> usize {
    model.bodies().len() - 1
}

const SMOOTHING: f64 = 0.1;
const RESTITUTION: f64 = 0.3;

/// Returns the inputs for which a robot has derivatives. Only robots with moving bodies have derivatives with respect
/// to an inertia.
fn inputs(model: &Model) -> impl Iterator<Item = condyle_dynamics::Input> {
    use condyle_dynamics::Input::*;
    let last = last_body(model);
    [Force(last), Gravity, Armature, Damping, Friction { smoothing: SMOOTHING }]
        .into_iter()
        .chain((last > 0).then_some(Inertia(last)))
}

/// Returns a contact and a loop constraint, with two proximal iterations, one more than needed. The list is empty for a
/// robot that cannot move.
pub(crate) fn constraints(model: &Model) -> (Vec<ContactConstraint>, ProximalSettings) {
    let (bodies, proximal) = (model.bodies().len(), ProximalSettings { mu: 1e-6, iterations: 2 });
    if bodies == 1 {
        return (Vec::new(), proximal);
    }
    let frame = |body: usize| model.frames().iter().position(|f| f.body == body).expect("each body has a frame");
    let (reference, other) = (ReferenceFrame::LocalWorldAligned, Some(frame(bodies / 2)));
    let contact = ContactConstraint { reference, kp: 2.0, kd: 3.0, ..ContactConstraint::point(frame(bodies - 1)) };
    let closure = ContactConstraint { other, kp: 2.0, kd: 3.0, ..ContactConstraint::rigid(frame(bodies - 1)) };
    (vec![contact, closure], proximal)
}

/// Returns the rows of all functions.
pub(crate) fn table<T: Real>() -> Vec<Row<T>> {
    dynamics().into_iter().chain(of_frames()).chain(of_bodies()).chain(others()).chain(impulses()).collect()
}

fn dynamics<T: Real>() -> Vec<Row<T>> {
    rows! {
        rnea(q, v, a, f_ext);
        nonlinear_effects(q, v);
        gravity(q);
        static_torque(q, f_ext);
        coriolis_matrix(q, v);
        aba(q, v, tau, f_ext);
        crba(q);
        minv(q);
        joint_torque_regressor(q, v, a);
        kinetic_energy_regressor(q, v);
        potential_energy_regressor(q);
        rnea_derivatives(q, v, a, f_ext) { dtau_dq, dtau_dv, dtau_da };
        aba_derivatives(q, v, tau, f_ext) { a, da_dq, da_dv, da_dtau };
        static_torque_derivative(q, f_ext);
        coriolis_derivatives(q, v) { dq, dv };
        energy_derivatives(q, v) { dT_dq, dT_dv, dV_dq };
        centroidal_derivatives(q, v, a)
            { dh_dq, dh_dv, drate_dq, drate_dv, drate_da, dcom_dq, dvcom_dq, dacom_dq, dacom_dv };
        rnea_hessian(q, v, a, f_ext, lambda) { dqdq, dvdq, dvdv, dadq };
        aba_hessian(q, v, tau, f_ext, lambda) { dqdq, dvdq, dvdv, dtaudq };
        centroidal_map(q) { Ag, Ig, com, Jcom };
        centroidal_map_rate(q, v) { Ag, dAg, hg, Ig, com, com_velocity, Jcom };
        compute_all_terms(q, v) { M, h, centroidal.Ag, centroidal.dAg, centroidal.hg, centroidal.Ig, centroidal.com,
            centroidal.com_velocity, centroidal.Jcom; kinetic_energy, potential_energy };
        constrained_dynamics(constraints, q, v, tau, f_ext) { a, lambda; residual, redundant };
        constrained_dynamics_derivatives(constraints, q, v, tau, f_ext) { a, lambda, da_dq, da_dv, da_dtau, dlambda_dq,
            dlambda_dv, dlambda_dtau, inertia; residual, redundant };
        constrained_dynamics_equations(constraints, q, v, tau, f_ext) { a, lambda, M, dtau_dq, dtau_dv, dgamma_dq,
            dgamma_dv; residual, redundant };
    }
}

fn of_frames<T: Real>() -> Vec<Row<T>> {
    questions! { T;
        frame_velocity(last_frame) after forward_velocities(q, v);
        body_velocity(last_body) after forward_velocities(q, v);
        frame_acceleration(last_frame) after forward_accelerations(q, v, a);
        body_acceleration(last_body) after forward_accelerations(q, v, a);
        frame_classical_acceleration(last_frame) after forward_accelerations(q, v, a);
        body_classical_acceleration(last_body) after forward_accelerations(q, v, a);
        frame_jacobian_rate(last_frame) after forward_velocities(q, v) fills [dJ];
        body_jacobian_rate(last_body) after forward_velocities(q, v) fills [dJ];
        frame_velocity_derivative(last_frame) after forward_velocities(q, v) fills [dv_dq];
        body_velocity_derivative(last_body) after forward_velocities(q, v) fills [dv_dq];
        frame_acceleration_derivatives(last_frame) after forward_accelerations(q, v, a) fills [da_dq, da_dv];
        body_acceleration_derivatives(last_body) after forward_accelerations(q, v, a) fills [da_dq, da_dv];
        frame_classical_acceleration_derivatives(last_frame) after forward_accelerations(q, v, a) fills [da_dq, da_dv];
    }
}

fn of_bodies<T: Real>() -> Vec<Row<T>> {
    sums! {
        com after forward_kinematics(q);
        com_velocity after forward_velocities(q, v);
        com_acceleration after forward_accelerations(q, v, a);
        centroidal_momentum after forward_velocities(q, v);
        centroidal_momentum_rate after forward_accelerations(q, v, a);
        kinetic_energy after forward_velocities(q, v) [number];
        potential_energy after forward_kinematics(q) [number];
        mechanical_energy after forward_velocities(q, v) [number];
    }
}

/// Returns the rows of functions with special arguments or results.
fn others<T: Real>() -> Vec<Row<T>> {
    vec![
        Row {
            name: "rnea without forces",
            many: |m, b, _, s, to| b.rnea(m, &s.q, &s.v, &s.x, &[]).put(to),
            one: |m, d, _, i, to| rnea(m, d, &i.q, &i.v, &i.x, &[]).put(to),
        },
        Row {
            name: "forward_dynamics, dense",
            many: |m, b, _, s, to| {
                b.forward_dynamics(m, &s.q, &s.v, &s.x, &s.f_ext, Some(ForwardDynamicsMethod::Dense)).put(to);
            },
            one: |m, d, _, i, to| {
                forward_dynamics(m, d, &i.q, &i.v, &i.x, &i.f_ext, Some(ForwardDynamicsMethod::Dense)).put(to);
            },
        },
        Row {
            name: "forward_kinematics",
            many: |m, b, _, s, to| {
                let states = count(m, b, s);
                put_poses(b.forward_kinematics(m, &s.q), [states, m.bodies().len()], to);
            },
            one: |m, d, _, i, to| {
                let placements = forward_kinematics(m, d, &i.q);
                to.extend((0..m.bodies().len()).flat_map(|body| of_pose(placements.body(body))));
            },
        },
        Row {
            name: "frame_placement",
            many: |m, b, _, s, to| {
                let states = count(m, b, s);
                put_poses(b.frame_placement(m, &s.q, last_frame(m)), [states, 1], to);
            },
            one: |m, d, _, i, to| to.extend(of_pose(forward_kinematics(m, d, &i.q).frame(last_frame(m)))),
        },
        Row {
            name: "frame_jacobian",
            many: |m, b, _, s, to| {
                for reference in REFERENCES {
                    b.frame_jacobian(m, &s.q, last_frame(m), reference).put(to);
                    b.body_jacobian(m, &s.q, last_body(m), reference).put(to);
                }
            },
            one: |m, _, _, i, to| {
                let mut J = DMatrix::from_element(6, m.nv(), T::zero());
                for reference in REFERENCES {
                    frame_jacobian(m, &i.q, last_frame(m), reference, &mut J);
                    (&J).put(to);
                    body_jacobian(m, &i.q, last_body(m), reference, &mut J);
                    (&J).put(to);
                }
            },
        },
        Row {
            name: "com_jacobian",
            many: |m, b, _, s, to| b.com_jacobian(m, &s.q).put(to),
            one: |m, d, _, i, to| centroidal_map(m, d, &i.q).Jcom.put(to),
        },
        Row {
            name: "passive_torque",
            many: |m, b, _, s, to| {
                b.passive_torque(m, &s.q, &s.v, SMOOTHING).put(to);
                let d = b.passive_torque_derivatives(m, &s.q, &s.v, SMOOTHING);
                d.dtau_dq.put(to);
                d.dtau_dv.put(to);
            },
            one: |m, _, _, i, to| {
                let mut tau = vec![T::zero(); m.nv()];
                passive_torque(m, &i.q, &i.v, SMOOTHING, &mut tau);
                tau[..].put(to);
                let [mut dq, mut dv] = [(); 2].map(|()| DMatrix::from_element(m.nv(), m.nv(), T::zero()));
                passive_torque_derivatives(m, &i.q, &i.v, SMOOTHING, &mut dq, &mut dv);
                dq.put(to);
                dv.put(to);
            },
        },
        Row {
            name: "rnea_input_derivative and aba_input_derivative",
            many: |m, b, _, s, to| {
                for input in inputs(m) {
                    b.rnea_input_derivative(m, &s.q, &s.v, &s.x, &s.f_ext, input).put(to);
                    b.aba_input_derivative(m, &s.q, &s.v, &s.x, &s.f_ext, input).put(to);
                }
            },
            one: |m, d, _, i, to| {
                for input in inputs(m) {
                    let mut by_input = DMatrix::from_element(m.nv(), input.len(m), T::zero());
                    rnea_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext).with_respect_to(input, &mut by_input);
                    (&by_input).put(to);
                    aba_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext).with_respect_to(input, &mut by_input);
                    (&by_input).put(to);
                }
            },
        },
        Row {
            name: "rnea_second_derivatives",
            many: |m, b, _, s, to| {
                let r = b.rnea_second_derivatives(m, &s.q, &s.v, &s.x, &s.f_ext);
                [r.dqdq, r.dvdq, r.dvdv, r.dadq].into_iter().for_each(|matrices| matrices.put(to));
            },
            one: |m, d, _, i, to| {
                let (mut r, n) = (RneaSecondDerivatives::new(m), m.nv());
                rnea_second_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext, &mut r);
                for of_all in [r.dqdq, r.dvdq, r.dvdv, r.dadq] {
                    (&DMatrix::from_fn(n * n, n, |row, column| of_all[row / n][(row % n, column)])).put(to);
                }
            },
        },
    ]
}

fn impulses<T: Real>() -> Vec<Row<T>> {
    vec![
        Row {
            name: "impulse_dynamics",
            many: |m, b, c, s, to| {
                let r = b.impulse_dynamics(m, c, &s.q, &s.v, RESTITUTION);
                [r.v, r.lambda, r.residual, r.redundant].into_iter().for_each(|x| x.put(to));
            },
            one: |m, d, c, i, to| {
                let r = impulse_dynamics(m, d, c, &i.q, &i.v, T::splat(RESTITUTION));
                [r.v, r.lambda, &[r.residual], &[r.redundant]].into_iter().for_each(|x| x.put(to));
            },
        },
        Row {
            name: "impulse_dynamics_derivatives",
            many: |m, b, c, s, to| {
                let r = b.impulse_dynamics_derivatives(m, c, &s.q, &s.v, RESTITUTION);
                [r.v, r.lambda, r.residual, r.redundant].into_iter().for_each(|x| x.put(to));
                [r.dv_dq, r.dv_dv, r.dlambda_dq, r.dlambda_dv, r.inertia].into_iter().for_each(|x| x.put(to));
            },
            one: |m, d, c, i, to| {
                let r = impulse_dynamics_derivatives(m, d, c, &i.q, &i.v, T::splat(RESTITUTION));
                [r.v, r.lambda, &[r.residual], &[r.redundant]].into_iter().for_each(|x| x.put(to));
                [r.dv_dq, r.dv_dv, r.dlambda_dq, r.dlambda_dv, r.inertia].into_iter().for_each(|x| x.put(to));
            },
        },
    ]
}
