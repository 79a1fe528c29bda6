//! Measures the time of an FDDP iteration as in MPC: each iteration starts from the last solution, with a new initial
//! state.

use super::clock::{Effort, Times, timed};
use crate::error::Error;
use crate::states::{normal, source};
use condyle::optimal::robot::{
    Activation, Actuation, Contact, ContactAcceleration, ContactDynamics, Cost, FreeDynamics, FrictionCone, Integrated,
    Integrator, Residual,
};
use condyle::optimal::{ActionModel, Fddp, Problem, Status};
use condyle::{Model, constraints::ConstraintKind, integrate};
use rayon::ThreadPool;
use serde::Serialize;
use std::sync::Arc;
use std::time::Instant;

/// Times of one iteration.
#[derive(Serialize)]
pub(crate) struct Row {
    /// Name of the horizon's dynamics: `free` or `in contact`.
    pub name: &'static str,
    pub knots: usize,
    /// Times on one thread.
    pub one: Times,
    /// Times on all threads; `None` if there is only one thread.
    pub threads: Option<Times>,
    /// Whether the numbers of all solves remained finite.
    pub finite: bool,
}

impl Row {
    /// Returns the times with one thread or with all threads, whichever has the smaller p99.
    pub(crate) fn best(&self) -> Times {
        match self.threads {
            Some(threads) if threads.p99 < self.one.p99 => threads,
            _ => self.one,
        }
    }
}

/// Minimum number of threads for which a backward sweep in segments can be faster than a single sweep.
const SEGMENTS_FROM: usize = 4;
/// Time between knots (s).
const DT: f64 = 0.01;
/// Standard deviation of the random change of the initial state (rad and m; rad/s and m/s for velocities).
const DISTURBANCE: f64 = 1e-3;
/// Rate at which the slip of a contact decays (1/s).
const HOLD: f64 = 40.0;
/// Damping of the contact dynamics (1/kg), for redundant contacts.
const DAMPING: f64 = 1e-6;
const FRICTION: f64 = 0.7;

/// Robot, posture and contacts for which iterations are measured.
pub(crate) struct Bench<'a> {
    pub model: Arc<Model>,
    pub q: Vec<f64>,
    pub contacts: Vec<Contact>,
    pub pool: &'a ThreadPool,
    pub effort: Effort,
}

impl Bench<'_> {
    /// Measures an iteration of a horizon with the given number of knots.
    pub(crate) fn iteration(&self, knots: usize, in_contact: bool) -> Result<Row, Error> {
        let cores = self.pool.current_num_threads();
        let mut damping = 0.0;
        let mut one = self.times(knots, [1, 1], in_contact, damping);
        if in_contact && !matches!(one, Ok((_, true))) {
            damping = DAMPING;
            one = self.times(knots, [1, 1], in_contact, damping);
        }
        let (one, finite) = one?;
        let mut threads: Option<Times> = None;
        // Measure two variants: a backward sweep that runs at the same time as the derivatives, and a sweep in
        // segments.
        let segments = [(2, 1), (SEGMENTS_FROM, cores)];
        for (_, segments) in segments.into_iter().filter(|(least, _)| cores >= *least) {
            let (times, _) = self.pool.install(|| self.times(knots, [cores, segments], in_contact, damping))?;
            threads = threads.filter(|best| best.p99 <= times.p99).or(Some(times));
        }
        Ok(Row { name: if in_contact { "in contact" } else { "free" }, knots, one, threads, finite })
    }

    fn times(
        &self,
        knots: usize,
        [threads, segments]: [usize; 2],
        in_contact: bool,
        damping: f64,
    ) -> Result<(Times, bool), Error> {
        let (mut problem, us) = self.problem(knots, in_contact, damping)?;
        let (x0, nq) = (problem.x0().to_vec(), self.model.nq());
        let mut solver = Fddp::new(&problem);
        solver.settings.tolerance = 0.0; // makes the solver use the maximum number of iterations
        (solver.settings.threads, solver.settings.segments) = (threads, segments);
        solver.settings.max_iterations = 3;
        solver.solve(&mut problem, &x0.repeat(knots + 1), &us)?;
        solver.settings.max_iterations = 1;
        let (mut random, mut finite, mut failed) = (source(1), true, None);
        let times = timed(self.effort, || {
            let mut x = x0.clone();
            let mut push = || normal(&mut random, self.model.nv()).into_iter().map(|x| DISTURBANCE * x);
            let dq: Vec<f64> = push().collect();
            integrate(&self.model, &x0[..nq], &dq, &mut x[..nq]);
            x[nq..].iter_mut().zip(push()).for_each(|(v, d)| *v += d);
            let begin = Instant::now();
            match problem.set_x0(&x).and_then(|()| solver.resume(&mut problem)) {
                Ok(solution) => finite &= solution.status != Status::NotFinite,
                Err(error) => failed = Some(error),
            }
            begin.elapsed()
        });
        failed.map_or(Ok((times, finite)), |error| Err(error.into()))
    }

    /// Returns initial controls, and the problem of holding the posture with little effort. In contact, the feet must
    /// not slip.
    fn problem(&self, knots: usize, in_contact: bool, damping: f64) -> Result<(Problem, Vec<f64>), Error> {
        let (model, nv) = (&self.model, self.model.nv());
        let x0 = [&self.q[..], &vec![0.0; nv]].concat();
        let state = || Residual::State { reference: x0.clone() };
        let actuation = Actuation::joints(model);
        let effort = Residual::Control { reference: vec![0.0; actuation.nu()] };
        let mut costs = vec![
            Cost::new("state", 1e0, state(), Activation::Quadratic),
            Cost::new("effort", 1e-3, effort, Activation::Quadratic),
        ];
        let end = FreeDynamics::terminal(model.clone(), vec![Cost::new("state", 1e1, state(), Activation::Quadratic)])?;
        let (knot, us): (Box<dyn ActionModel>, _) = if in_contact {
            for contact in self.contacts.iter().filter(|c| c.constraint.kind == ConstraintKind::Point) {
                let cone = FrictionCone::new(FRICTION);
                let (lower, upper) = cone.bounds();
                let residual = Residual::FrictionCone { contact: contact.name.clone(), cone };
                let name = format!("{} grips", contact.name);
                costs.push(Cost::new(&name, 1e-2, residual, Activation::Barrier { lower, upper }));
            }
            let law = ContactAcceleration::new(model.clone(), actuation, &self.contacts, damping, costs)?;
            let mut knot: ContactDynamics = Integrated::new(law, Integrator::SemiImplicitEuler, DT)?;
            let us = knot.quasi_static(&x0);
            (Box::new(knot), us)
        } else {
            let mut knot = FreeDynamics::running(model.clone(), DT, costs)?;
            let us = knot.quasi_static(&x0);
            (Box::new(knot), us)
        };
        Ok((Problem::new(x0, vec![knot], vec![0; knots], Box::new(end))?, us.repeat(knots)))
    }
}

/// Returns the contact with the reference frame and the damping gain that measurements and plans use.
pub(crate) fn held(constraint: condyle::ContactConstraint) -> condyle::ContactConstraint {
    condyle::ContactConstraint { kd: HOLD, reference: condyle::ReferenceFrame::LocalWorldAligned, ..constraint }
}
