//! Every function that a control loop calls, in one table: what holds for all of them is tested over it.

use super::{State, lift, lift_forces};
use condyle_dynamics::{
    Data, DifferenceArgument, Force, IntegrateArgument, Method, Model, ReferenceFrame, Scalar, Se3, aba,
    aba_derivatives, centroidal_map, centroidal_map_rate, compute_all_terms, coriolis_matrix, crba, difference,
    difference_jacobian, forward_accelerations, forward_dynamics, forward_kinematics, forward_velocities, gravity,
    integrate, integrate_jacobian, minv, nonlinear_effects, random_configuration, rnea, rnea_derivatives,
    static_torque,
};
use nalgebra::DMatrix;
use rand::rngs::StdRng;

/// What the functions of the table are called with.
#[derive(Clone, Debug)]
pub(crate) struct Input<S> {
    pub(crate) q: Vec<S>,
    pub(crate) q1: Vec<S>,
    pub(crate) v: Vec<S>,
    /// An acceleration or an effort.
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

/// Where the functions of the table put what they return.
pub(crate) struct Output<S> {
    pub(crate) numbers: Vec<S>,
    q: Vec<S>,
    v: Vec<S>,
    square: DMatrix<S>,
    six: DMatrix<S>,
}

impl<S: Scalar> Output<S> {
    pub(crate) fn new(model: &Model) -> Self {
        let (nv, o) = (model.nv(), S::splat(f64::NAN));
        Self {
            numbers: Vec::with_capacity(6 * nv * nv + 100 * model.frames().len() + nv * 18 * model.frames().len()),
            q: vec![o; model.nq()],
            v: vec![o; nv],
            square: DMatrix::from_element(nv, nv, o),
            six: DMatrix::from_element(6, nv, o),
        }
    }

    fn pose(&mut self, X: Se3<S>) {
        for column in X.rotation.columns().into_iter().chain([X.translation]) {
            self.numbers.extend_from_slice(&column.to_array());
        }
    }
}

pub(crate) type Function<S> = fn(&Model, &mut Data<S>, &Input<S>, &mut Output<S>);

/// Name and call of each function. A call allocates only if the function does.
pub(crate) fn functions<S: Scalar>() -> [(&'static str, Function<S>); 26] {
    [
        ("rnea", |m, d, i, o| o.numbers.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &i.f_ext))),
        ("rnea without forces", |m, d, i, o| o.numbers.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &[]))),
        ("nonlinear_effects", |m, d, i, o| o.numbers.extend_from_slice(nonlinear_effects(m, d, &i.q, &i.v))),
        ("gravity", |m, d, i, o| o.numbers.extend_from_slice(gravity(m, d, &i.q))),
        ("crba", |m, d, i, o| o.numbers.extend_from_slice(crba(m, d, &i.q).as_slice())),
        ("aba", |m, d, i, o| o.numbers.extend_from_slice(aba(m, d, &i.q, &i.v, &i.x, &i.f_ext))),
        ("forward_dynamics, dense", |m, d, i, o| {
            let method = Some(Method::Dense);
            o.numbers.extend_from_slice(forward_dynamics(m, d, &i.q, &i.v, &i.x, &i.f_ext, method));
        }),
        ("forward_dynamics, sparse", |m, d, i, o| {
            let method = Some(Method::Sparse);
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
        ("static_torque", |m, d, i, o| o.numbers.extend_from_slice(static_torque(m, d, &i.q, &i.f_ext))),
        ("coriolis_matrix", |m, d, i, o| o.numbers.extend_from_slice(coriolis_matrix(m, d, &i.q, &i.v).as_slice())),
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
    ]
}
