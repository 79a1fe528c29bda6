//! Table of every function that a control loop calls. Tests apply the same checks to all functions of the table.
//!
//! The table does not contain [`DivideConquer`](condyle_dynamics::DivideConquer), because rayon allocates when threads
//! synchronise.

use super::{State, lift, lift_forces};
use condyle_dynamics::inertial_parameters::{self, from_log_cholesky, log_cholesky_jacobian};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    Cholesky, ConstraintSet, ContactConstraint, Data, DifferenceArgument, Force, ForwardDynamicsMethod,
    IntegrateArgument, Ltdl, Model, ProximalSettings, ReferenceFrame, RneaSecondDerivatives, Scalar, Se3, Vec3, aba,
    aba_derivatives, aba_hessian, body_jacobian, centroidal_derivatives, centroidal_map, centroidal_map_rate,
    compute_all_terms, constrained_dynamics, constrained_dynamics_derivatives, constrained_inverse_dynamics,
    constrained_inverse_dynamics_derivatives, coriolis_derivatives, coriolis_matrix, crba, difference,
    difference_jacobian, distance, energy_derivatives, forward_accelerations, forward_dynamics, forward_kinematics,
    forward_velocities, frame_jacobian, gravity, impulse_dynamics, impulse_dynamics_derivatives, integrate,
    integrate_jacobian, interpolate, joint_torque_regressor, kinetic_energy_regressor, minv, nonlinear_effects,
    normalize, passive_torque, passive_torque_derivatives, potential_energy_regressor, random_configuration, rnea,
    rnea_derivatives, rnea_hessian, rnea_second_derivatives, static_torque, static_torque_derivative, transport,
};
use nalgebra::DMatrix;
use rand::rngs::StdRng;

/// Arguments of the functions in this file's table.
#[derive(Clone, Debug)]
pub(crate) struct Input<S> {
    pub(crate) q: Vec<S>,
    pub(crate) q1: Vec<S>,
    pub(crate) v: Vec<S>,
    /// Accelerations q̈, or joint efforts τ.
    pub(crate) x: Vec<S>,
    pub(crate) f_ext: Vec<Force<S>>,
}

impl<S: Scalar> Input<S> {
    pub(crate) fn random(model: &Model, rng: &mut StdRng) -> Self {
        let State { q, v, a, f_ext, .. } = State::random(model, rng);
        let q1 = random_configuration(model, rng);
        Self { q: lift(&q), q1: lift(&q1), v: lift(&v), x: lift(&a), f_ext: lift_forces(&f_ext) }
    }

    pub(crate) fn map<T: Scalar>(&self, f: impl Fn(S) -> T) -> Input<T> {
        let all = |x: &[S]| x.iter().map(|&x| f(x)).collect();
        let force = |x: &Force<S>| Force::from(x.to_array().map(&f));
        Input {
            q: all(&self.q),
            q1: all(&self.q1),
            v: all(&self.v),
            x: all(&self.x),
            f_ext: self.f_ext.iter().map(force).collect(),
        }
    }
}

/// Results of the functions in this file's table, and scratch memory that is not part of a `Data`.
pub(crate) struct Output<S: Scalar> {
    pub(crate) numbers: Vec<S>,
    q: Vec<S>,
    v: Vec<S>,
    square: DMatrix<S>,
    square2: DMatrix<S>,
    three: DMatrix<S>,
    six: DMatrix<S>,
    six2: DMatrix<S>,
    by_inputs: [DMatrix<S>; 6],
    tensors: RneaSecondDerivatives<S>,
    simulation: Simulation<S>,
    ltdl: Ltdl<S>,
    cholesky: Cholesky<S>,
    constraints: ConstraintSet<S>,
}

impl<S: Scalar> Output<S> {
    pub(crate) fn new(model: &Model) -> Self {
        let (nv, o) = (model.nv(), S::splat(f64::NAN));
        Self {
            numbers: Vec::with_capacity(
                6 * nv * nv + 40 * nv + 100 * model.frames().len() + nv * 54 * model.frames().len(),
            ),
            q: vec![o; model.nq()],
            v: vec![o; nv],
            square: DMatrix::from_element(nv, nv, o),
            square2: DMatrix::from_element(nv, nv, o),
            three: DMatrix::from_element(3, nv, o),
            six: DMatrix::from_element(6, nv, o),
            six2: DMatrix::from_element(6, nv, o),
            by_inputs: other_inputs(model).map(|input| DMatrix::from_element(nv, input.len(model), o)),
            tensors: RneaSecondDerivatives::new(model),
            simulation: Simulation::new(model, Settings { max_iterations: ITERATIONS, ..Settings::default() }),
            ltdl: Ltdl::new(model),
            cholesky: Cholesky::new(nv),
            constraints: constraints(model),
        }
    }

    /// Makes a step of 1 ms. Appends the state after the step, and then 1 if the step was taken, otherwise 0.
    fn step(&mut self, integrator: Integrator, i: &Input<S>) {
        self.simulation.settings.integrator = integrator;
        self.simulation.settings.passive = Some(0.1);
        if self.simulation.set_state(&i.q, &i.v).is_err() {
            return; // the state is NaN in the test of hidden order
        }
        let taken = self.simulation.step(&i.x, &i.f_ext).is_done();
        self.numbers.extend_from_slice(self.simulation.q());
        self.numbers.extend_from_slice(self.simulation.v());
        self.numbers.push(if taken { S::one() } else { S::zero() });
    }

    fn pose(&mut self, X: Se3<S>) {
        for column in X.rotation.columns().into_iter().chain([X.translation]) {
            self.numbers.extend_from_slice(&column.to_array());
        }
    }
}

/// Returns a contact and a loop constraint, with two proximal iterations, one more than needed. The set is empty if the
/// robot cannot move, or if its bodies have no frames for these constraints.
fn constraints<S: Scalar>(model: &Model) -> ConstraintSet<S> {
    let last = model.bodies().len() - 1;
    let frame = |body: usize| model.frames().iter().position(|f| f.body == body).filter(|_| last > 0);
    let (Some(end), Some(middle)) = (frame(last), frame(last.div_ceil(2))) else {
        return ConstraintSet::new(model, &[]).expect("no constraint is wrong");
    };
    let (reference, other) = (ReferenceFrame::LocalWorldAligned, Some(middle));
    let contact = ContactConstraint { reference, kp: 2.0, kd: 3.0, ..ContactConstraint::point(end) };
    let closure = ContactConstraint { other, kp: 2.0, kd: 3.0, ..ContactConstraint::rigid(end) };
    let mut set = ConstraintSet::new(model, &[contact, closure]).expect("the frames are on different bodies");
    set.proximal = ProximalSettings { mu: 1e-6, iterations: 2 };
    set
}

/// Returns the inputs of inverse and forward dynamics other than q, v, q̈ and τ.
fn other_inputs(model: &Model) -> [condyle_dynamics::Input; 6] {
    use condyle_dynamics::Input::*;
    let last = model.bodies().len() - 1;
    let inertia = if last > 0 { Inertia(last) } else { Gravity }; // the world has no inertia
    [Force(last), inertia, Gravity, Armature, Damping, Friction { smoothing: 0.1 }]
}

/// Names of the functions that need no `Data`, or that create a `Data` themselves.
const WITHOUT_DATA: [&str; 10] = [
    "integrate",
    "difference",
    "interpolate",
    "distance",
    "normalize",
    "transport",
    "frame_jacobian_alone",
    "passive_torque",
    "log-Cholesky",
    "simulation",
];

pub(crate) fn has_data(name: &str) -> bool {
    !WITHOUT_DATA.iter().any(|f| name.starts_with(f))
}

/// Maximum number of Newton iterations in a simulated step. Three iterations are enough from random states.
const ITERATIONS: usize = 5;

/// Returns whether the result in one lane depends on the other lanes. In a simulation, all lanes take a step or no lane
/// does, and Newton's method iterates until all lanes have converged.
pub(crate) fn in_step(name: &str) -> bool {
    name.starts_with("simulation")
}

pub(crate) type Function<S> = fn(&Model, &mut Data<S>, &Input<S>, &mut Output<S>);

/// Returns each function that is compiled as a whole for every SIMD level: its name and a closure that calls it. The
/// closure allocates only if the function allocates.
pub(crate) fn kernels<S: Scalar>() -> [(&'static str, Function<S>); 16] {
    [
        ("rnea", |m, d, i, o| o.numbers.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &i.f_ext))),
        ("rnea without forces", |m, d, i, o| o.numbers.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &[]))),
        ("nonlinear_effects", |m, d, i, o| o.numbers.extend_from_slice(nonlinear_effects(m, d, &i.q, &i.v))),
        ("gravity", |m, d, i, o| o.numbers.extend_from_slice(gravity(m, d, &i.q))),
        ("crba", |m, d, i, o| o.numbers.extend_from_slice(crba(m, d, &i.q).as_slice())),
        ("aba", |m, d, i, o| o.numbers.extend_from_slice(aba(m, d, &i.q, &i.v, &i.x, &i.f_ext))),
        ("forward_dynamics, dense", |m, d, i, o| {
            let method = Some(ForwardDynamicsMethod::Dense);
            o.numbers.extend_from_slice(forward_dynamics(m, d, &i.q, &i.v, &i.x, &i.f_ext, method));
        }),
        ("forward_dynamics, sparse", |m, d, i, o| {
            let method = Some(ForwardDynamicsMethod::Sparse);
            o.numbers.extend_from_slice(forward_dynamics(m, d, &i.q, &i.v, &i.x, &i.f_ext, method));
        }),
        ("aba without forces", |m, d, i, o| o.numbers.extend_from_slice(aba(m, d, &i.q, &i.v, &i.x, &[]))),
        ("minv", |m, d, i, o| o.numbers.extend_from_slice(minv(m, d, &i.q).as_slice())),
        ("rnea_derivatives", |m, d, i, o| {
            let r = rnea_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            [r.dtau_dq, r.dtau_dv, r.dtau_da].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("aba_derivatives", |m, d, i, o| {
            let r = aba_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            o.numbers.extend_from_slice(r.a);
            [r.da_dq, r.da_dv, r.da_dtau].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("rnea_hessian", |m, d, i, o| {
            let r = rnea_hessian(m, d, &i.q, &i.v, &i.x, &i.f_ext, &i.v);
            [r.dqdq, r.dvdq, r.dvdv, r.dadq].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("static_torque_derivative", |m, d, i, o| {
            o.numbers.extend_from_slice(static_torque_derivative(m, d, &i.q, &i.f_ext).as_slice());
        }),
        ("static_torque", |m, d, i, o| o.numbers.extend_from_slice(static_torque(m, d, &i.q, &i.f_ext))),
        ("coriolis_matrix", |m, d, i, o| o.numbers.extend_from_slice(coriolis_matrix(m, d, &i.q, &i.v).as_slice())),
    ]
}

/// Returns each function of the table: its name and a closure that calls it. The closure allocates only if the function
/// allocates.
pub(crate) fn functions<S: Scalar>() -> Vec<(&'static str, Function<S>)> {
    let others: [(&'static str, Function<S>); 42] = [
        ("rnea_derivatives by all other inputs", |m, d, i, o| {
            let r = rnea_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            other_inputs(m).into_iter().zip(&mut o.by_inputs).for_each(|(input, out)| r.with_respect_to(input, out));
            o.by_inputs.iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("aba_derivatives by all other inputs", |m, d, i, o| {
            let r = aba_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            other_inputs(m).into_iter().zip(&mut o.by_inputs).for_each(|(input, out)| r.with_respect_to(input, out));
            o.by_inputs.iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("aba_hessian", |m, d, i, o| {
            let r = aba_hessian(m, d, &i.q, &i.v, &i.x, &i.f_ext, &i.v);
            [r.dqdq, r.dvdq, r.dvdv, r.dtaudq].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("rnea_second_derivatives", |m, d, i, o| {
            rnea_second_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext, &mut o.tensors);
            let t = &o.tensors;
            let Some(last) = m.nv().checked_sub(1) else { return };
            let some = [&t.dqdq[0], &t.dvdq[last], &t.dvdv[0], &t.dadq[last]];
            some.into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("frame derivatives", |m, d, i, o| {
            let k = forward_accelerations(m, d, &i.q, &i.v, &i.x);
            for reference in [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned] {
                for f in 0..m.frames().len() {
                    k.frame_velocity_derivative(f, reference, &mut o.six);
                    o.numbers.extend_from_slice(o.six.as_slice());
                    k.frame_acceleration_derivatives(f, reference, &mut o.six, &mut o.six2);
                    o.numbers.extend_from_slice(o.six.as_slice());
                    k.frame_classical_acceleration_derivatives(f, reference, &mut o.six, &mut o.six2);
                    o.numbers.extend_from_slice(o.six2.as_slice());
                }
            }
        }),
        ("centroidal_derivatives", |m, d, i, o| {
            let r = centroidal_derivatives(m, d, &i.q, &i.v, &i.x);
            let all = [r.dh_dq, r.drate_dq, r.drate_dv, r.drate_da, r.dcom_dq, r.dvcom_dq, r.dacom_dq, r.dacom_dv];
            all.into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("energy_derivatives", |m, d, i, o| {
            let r = energy_derivatives(m, d, &i.q, &i.v);
            [r.dT_dq, r.dT_dv, r.dV_dq].into_iter().for_each(|x| o.numbers.extend_from_slice(x));
        }),
        ("coriolis_derivatives", |m, d, i, o| {
            let r = coriolis_derivatives(m, d, &i.q, &i.v);
            [r.dq, r.dv].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("forward_kinematics", |m, d, i, o| {
            let placements = forward_kinematics(m, d, &i.q);
            (0..m.bodies().len()).for_each(|b| o.pose(placements.body(b)));
            (0..m.frames().len()).for_each(|f| o.pose(placements.frame(f)));
        }),
        ("frame_jacobian", |m, d, i, o| {
            let placements = forward_kinematics(m, d, &i.q);
            for reference in [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned] {
                for f in 0..m.frames().len() {
                    placements.frame_jacobian(f, reference, &mut o.six);
                    o.numbers.extend_from_slice(o.six.as_slice());
                }
            }
        }),
        ("points", |m, d, i, o| {
            let k = forward_velocities(m, d, &i.q, &i.v);
            let point = Vec3::new(0.1, -0.2, 0.3).lift();
            for f in 0..m.frames().len() {
                k.frame_point_jacobian(f, point, &mut o.three);
                o.numbers.extend_from_slice(o.three.as_slice());
                o.numbers.extend_from_slice(&k.frame_point_velocity(f, point).to_array());
            }
            for b in 0..m.bodies().len() {
                k.body_point_jacobian(b, point, &mut o.three);
                o.numbers.extend_from_slice(o.three.as_slice());
                o.numbers.extend_from_slice(&k.body_point_velocity(b, point).to_array());
                o.numbers.extend_from_slice(&k.force_on_body(b, point, point).to_array());
                o.v.fill(S::zero());
                k.add_body_efforts(b, Force::at_point(point, point + point.cross(k.body(b).translation)), &mut o.v);
                o.numbers.extend_from_slice(&o.v);
            }
        }),
        ("frame_jacobian_alone", |m, _, i, o| {
            for reference in [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned] {
                for f in 0..m.frames().len() {
                    frame_jacobian(m, &i.q, f, reference, &mut o.six);
                    o.numbers.extend_from_slice(o.six.as_slice());
                }
                for b in 0..m.bodies().len() {
                    body_jacobian(m, &i.q, b, reference, &mut o.six);
                    o.numbers.extend_from_slice(o.six.as_slice());
                }
            }
        }),
        ("forward_velocities", |m, d, i, o| {
            let k = forward_velocities(m, d, &i.q, &i.v);
            for reference in [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned] {
                for f in 0..m.frames().len() {
                    o.numbers.extend_from_slice(&k.frame_velocity(f, reference).to_array());
                    k.frame_jacobian_rate(f, reference, &mut o.six);
                    o.numbers.extend_from_slice(o.six.as_slice());
                }
            }
            o.numbers.extend_from_slice(&k.com_velocity().to_array());
            o.numbers.extend_from_slice(&k.centroidal_momentum().to_array());
            o.numbers.push(k.mechanical_energy());
        }),
        ("forward_accelerations", |m, d, i, o| {
            let k = forward_accelerations(m, d, &i.q, &i.v, &i.x);
            for reference in [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned] {
                for f in 0..m.frames().len() {
                    o.numbers.extend_from_slice(&k.frame_acceleration(f, reference).to_array());
                    o.numbers.extend_from_slice(&k.frame_classical_acceleration(f, reference).to_array());
                }
            }
            o.numbers.extend_from_slice(&k.com_acceleration().to_array());
            o.numbers.extend_from_slice(&k.centroidal_momentum_rate().to_array());
        }),
        ("centroidal_map", |m, d, i, o| {
            let r = centroidal_map(m, d, &i.q);
            [r.Ag, r.Jcom].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
            o.numbers.extend_from_slice(&r.com.to_array());
        }),
        ("centroidal_map_rate", |m, d, i, o| {
            let r = centroidal_map_rate(m, d, &i.q, &i.v);
            [r.Ag, r.dAg, r.Jcom].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
            o.numbers.extend_from_slice(&r.hg.to_array());
            o.numbers.extend_from_slice(&r.com_velocity.to_array());
        }),
        ("compute_all_terms", |m, d, i, o| {
            let r = compute_all_terms(m, d, &i.q, &i.v);
            let c = r.centroidal;
            [r.M, c.Ag, c.dAg, c.Jcom].into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
            o.numbers.extend_from_slice(r.h);
            o.numbers.extend_from_slice(&c.hg.to_array());
            o.numbers.extend_from_slice(&[r.kinetic_energy, r.potential_energy]);
        }),
        ("integrate", |m, _, i, o| {
            integrate(m, &i.q, &i.v, &mut o.q);
            o.numbers.extend_from_slice(&o.q);
        }),
        ("difference", |m, _, i, o| {
            difference(m, &i.q, &i.q1, &mut o.v);
            o.numbers.extend_from_slice(&o.v);
        }),
        ("integrate_jacobian by position", |m, _, i, o| {
            integrate_jacobian(m, &i.v, IntegrateArgument::Position, &mut o.square);
            o.numbers.extend_from_slice(o.square.as_slice());
        }),
        ("integrate_jacobian by velocity", |m, _, i, o| {
            integrate_jacobian(m, &i.v, IntegrateArgument::Velocity, &mut o.square);
            o.numbers.extend_from_slice(o.square.as_slice());
        }),
        ("difference_jacobian", |m, _, i, o| {
            difference(m, &i.q, &i.q1, &mut o.v);
            for argument in [DifferenceArgument::From, DifferenceArgument::To] {
                difference_jacobian(m, &o.v, argument, &mut o.square);
                o.numbers.extend_from_slice(o.square.as_slice());
            }
        }),
        ("interpolate", |m, _, i, o| {
            interpolate(m, &i.q, &i.q1, S::splat(0.3), &mut o.v, &mut o.q);
            o.numbers.extend_from_slice(&o.q);
        }),
        ("distance", |m, _, i, o| {
            let distance = distance(m, &i.q, &i.q1, &mut o.v);
            o.numbers.push(distance);
        }),
        ("normalize", |m, _, i, o| {
            o.q.copy_from_slice(&i.q);
            o.q.iter_mut().for_each(|x| *x = *x * S::splat(1.5));
            normalize(m, &mut o.q);
            o.numbers.extend_from_slice(&o.q);
        }),
        ("transport", |m, _, i, o| {
            o.square.column_iter_mut().for_each(|mut to| to.iter_mut().zip(&i.x).for_each(|(to, &x)| *to = x));
            transport(m, &i.v, &mut o.square);
            o.numbers.extend_from_slice(o.square.as_slice());
        }),
        ("joint_torque_regressor", |m, d, i, o| {
            o.numbers.extend_from_slice(joint_torque_regressor(m, d, &i.q, &i.v, &i.x).as_slice());
        }),
        ("kinetic_energy_regressor", |m, d, i, o| {
            o.numbers.extend_from_slice(kinetic_energy_regressor(m, d, &i.q, &i.v));
        }),
        ("potential_energy_regressor", |m, d, i, o| {
            o.numbers.extend_from_slice(potential_energy_regressor(m, d, &i.q));
        }),
        ("passive_torque", |m, _, i, o| {
            passive_torque(m, &i.q, &i.v, 0.1, &mut o.v);
            o.numbers.extend_from_slice(&o.v);
            passive_torque_derivatives(m, &i.q, &i.v, 0.1, &mut o.square, &mut o.square2);
            o.numbers.extend_from_slice(o.square.as_slice());
            o.numbers.extend_from_slice(o.square2.as_slice());
        }),
        ("log-Cholesky parameters", |_, _, i, o| {
            let theta = core::array::from_fn(|k| i.v.get(k % i.v.len().max(1)).copied().unwrap_or(S::zero()));
            o.numbers.extend_from_slice(&inertial_parameters::from_inertia(from_log_cholesky(theta)));
            o.numbers.extend_from_slice(log_cholesky_jacobian(theta).as_slice());
        }),
        ("Ltdl", |m, d, i, o| {
            o.ltdl.factorize(crba(m, d, &i.q));
            o.v.copy_from_slice(&i.x);
            o.ltdl.solve(&mut o.v);
            o.numbers.extend_from_slice(&o.v);
            o.ltdl.inverse(&mut o.square);
            o.numbers.extend_from_slice(o.square.as_slice());
        }),
        ("Cholesky", |m, d, i, o| {
            o.cholesky.factorize(crba(m, d, &i.q));
            o.v.copy_from_slice(&i.x);
            o.cholesky.solve(&mut o.v);
            o.numbers.extend_from_slice(&o.v);
            o.cholesky.inverse(&mut o.square);
            o.numbers.extend_from_slice(o.square.as_slice());
        }),
        ("simulation, Euler", |_, _, i, o| o.step(Integrator::SemiImplicitEuler, i)),
        ("simulation, Runge-Kutta", |_, _, i, o| o.step(Integrator::RungeKutta4, i)),
        ("simulation, variational", |_, _, i, o| o.step(Integrator::Variational, i)),
        ("constrained_dynamics", |m, d, i, o| {
            let r = constrained_dynamics(m, d, &mut o.constraints, &i.q, &i.v, &i.x, &i.f_ext);
            [r.a, r.lambda, &[r.residual, r.redundant]].into_iter().for_each(|x| o.numbers.extend_from_slice(x));
        }),
        ("constrained_dynamics_derivatives", |m, d, i, o| {
            let r = constrained_dynamics_derivatives(m, d, &mut o.constraints, &i.q, &i.v, &i.x, &i.f_ext);
            o.numbers.extend_from_slice(r.a);
            let matrices = [r.da_dq, r.da_dv, r.da_dtau, r.dlambda_dq, r.dlambda_dv, r.dlambda_dtau, r.inertia];
            matrices.into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("constrained_inverse_dynamics", |m, d, i, o| {
            let lambda = [S::splat(2.0); 64];
            let lambda = &lambda[..o.constraints.rows()];
            let r = constrained_inverse_dynamics(m, d, &mut o.constraints, &i.q, &i.v, &i.x, lambda, &i.f_ext);
            [r.tau, r.acceleration].into_iter().for_each(|x| o.numbers.extend_from_slice(x));
        }),
        ("constrained_inverse_dynamics_derivatives", |m, d, i, o| {
            let lambda = [S::splat(2.0); 64];
            let (lambda, c) = (&lambda[..o.constraints.rows()], &mut o.constraints);
            let r = constrained_inverse_dynamics_derivatives(m, d, c, &i.q, &i.v, &i.x, lambda, &i.f_ext);
            [r.tau, r.acceleration].into_iter().for_each(|x| o.numbers.extend_from_slice(x));
            let matrices = [r.M, r.dtau_dq, r.dtau_dv, r.dacceleration_dq, r.dacceleration_dv];
            matrices.into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
        ("impulse_dynamics", |m, d, i, o| {
            let r = impulse_dynamics(m, d, &mut o.constraints, &i.q, &i.v, S::splat(0.3));
            [r.v, r.lambda, &[r.residual, r.redundant]].into_iter().for_each(|x| o.numbers.extend_from_slice(x));
        }),
        ("impulse_dynamics_derivatives", |m, d, i, o| {
            let r = impulse_dynamics_derivatives(m, d, &mut o.constraints, &i.q, &i.v, S::splat(0.3));
            o.numbers.extend_from_slice(r.v);
            let matrices = [r.dv_dq, r.dv_dv, r.dlambda_dq, r.dlambda_dv, r.inertia];
            matrices.into_iter().for_each(|x| o.numbers.extend_from_slice(x.as_slice()));
        }),
    ];
    kernels().into_iter().chain(others).collect()
}
