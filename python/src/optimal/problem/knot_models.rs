//! Models of a problem's knots with their descriptions, and the errors of Python functions in them.

use super::{Problem, lock};
use crate::exceptions::{ProblemError, problem_error};
use crate::optimal::own::{Fault, faults};
use crate::optimal::recorder::Recorder;
use crate::optimal::references;
use crate::optimal::residuals::take_written;
use crate::optimal::robot_action::{Boxed, Described, change};
use condyle::optimal as rust;
use pyo3::prelude::*;
use rust::record::Call;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

impl Problem {
    /// Creates a problem from models, the terminal model last.
    pub(super) fn make(
        x0: Vec<f64>,
        all: Vec<Boxed>,
        knot_models: Vec<usize>,
        (objects, written): (Vec<Option<Py<PyAny>>>, Vec<Py<PyAny>>),
        fault: Fault,
    ) -> PyResult<Self> {
        let (mut actions, described): (Vec<_>, _) = all.into_iter().map(|b| (b.action, b.described)).unzip();
        let end = actions.pop().expect("the terminal one is there");
        let mut problem = rust::Problem::new(x0, actions, knot_models, end).map_err(problem_error)?;
        let described: Vec<Option<Arc<Described>>> = described;
        let of_robot = change!(&mut problem, None, |_robot| ()).is_some();
        let space = if of_robot { rust::StateSpace::new(&problem).ok() } else { None };
        let faults = described.iter().flatten().flat_map(|described| faults(&described.knot)).collect();
        let (inner, described) = (Mutex::new(problem), Mutex::new(described));
        let (objects, written, faults) = (Mutex::new(objects), Mutex::new(written), Mutex::new(faults));
        Ok(Self {
            inner,
            described,
            objects,
            written,
            fault,
            faults,
            moved: AtomicUsize::new(0),
            space,
            is_outdated: AtomicBool::new(false),
            recorder: Recorder::default(),
        })
    }

    /// Creates a robot's problem from its data.
    pub(in crate::optimal) fn from_data(data: rust::robot::RobotProblem) -> PyResult<Self> {
        let robot = Arc::new(data.model);
        let knots = data.knots.into_iter().chain([data.terminal]);
        let all = knots.map(|knot| Described { robot: robot.clone(), knot }.boxed()).collect::<PyResult<Vec<_>>>()?;
        let objects = all.iter().map(|_| None).collect();
        Self::make(data.x0, all, data.knot_models, (objects, vec![]), Fault::default())
    }

    /// Returns the data of a robot's problem, with the current initial state, weights and models of its knots.
    pub(in crate::optimal) fn data(&self) -> PyResult<rust::robot::RobotProblem> {
        self.describe()?;
        let problem = lock("problem", &self.inner)?;
        let described = lock("problem", &self.described)?;
        let models = described.len() - 1;
        let wrong = |k: usize, what: &str| {
            let name = if k < models { format!("models[{k}]") } else { "terminal".to_owned() };
            ProblemError::new_err(format!("{name}: {what}"))
        };
        let bytes = |robot: &condyle::Model| {
            postcard::to_allocvec(robot).map_err(|error| ProblemError::new_err(error.to_string()))
        };
        let mut knots = Vec::new();
        let mut first: Option<&Arc<condyle::Model>> = None;
        let (knot_models, added) = Self::separate_durations(&problem, &described);
        for (k, described) in described.iter().enumerate() {
            let Some(Described { robot, knot }) = described.as_deref() else {
                return Err(wrong(k, "expected an action of a robot, which alone can be JSON"));
            };
            let other = first.get_or_insert(robot);
            if !Arc::ptr_eq(other, robot) && bytes(other)? != bytes(robot)? {
                return Err(wrong(k, "expected the robot of the first model, found another one"));
            }
            if !take_written(&mut knot.clone()).is_empty() {
                return Err(wrong(k, "it has a residual that is written in Python, which JSON cannot contain"));
            }
            knots.push(knot.clone());
        }
        let terminal = knots.pop().expect("the terminal one is there");
        for (k, dt) in added {
            let mut knot: rust::robot::Knot = knots[k].clone();
            knot.dynamics.set_dt(dt);
            knots.push(knot);
        }
        let model = first.expect("the terminal one is there");
        let x0 = problem.x0().to_vec();
        Ok(rust::robot::RobotProblem { model: (**model).clone(), x0, knots, knot_models, terminal })
    }

    /// Replaces the model of a knot, and its description.
    pub(super) fn replace(
        &self,
        py: Python<'_>,
        knot: usize,
        Boxed { action, described: new }: Boxed,
        object: Option<Py<PyAny>>,
        written: Vec<Py<PyAny>>,
    ) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let horizon = problem.horizon();
        if knot >= horizon {
            return Err(ProblemError::new_err(format!("knot {knot}: expected 0 to {}", horizon - 1)));
        }
        if let Some(new) = &new {
            self.recorder.note(|| Call::SetKnot { knot, model: Box::new(new.knot.clone()) });
        }
        problem.set_knot(knot, action).map_err(problem_error)?;
        let (k, mut described) = (problem.knot_models()[knot], lock("problem", &self.described)?);
        let mut objects = lock("problem", &self.objects)?;
        if k == described.len() - 1 {
            described.insert(k, None); // inserted before the terminal model
            objects.insert(k, None);
        }
        if let Some(new) = &new {
            lock("problem", &self.faults)?.extend(faults(&new.knot));
        }
        described[k] = new;
        let old = std::mem::replace(&mut objects[k], object);
        drop((problem, described, objects));
        if let Some(old) = old {
            old.drop_ref(py); // the object's destructor may run Python code
        }
        lock("problem", &self.written)?.extend(written);
        Ok(())
    }

    /// Copies costs that were changed in place to the descriptions of the models.
    pub(super) fn describe(&self) -> PyResult<()> {
        if self.is_outdated.swap(false, Ordering::Relaxed) {
            let mut problem = lock("problem", &self.inner)?;
            references::describe(&mut problem, &mut lock("problem", &self.described)?);
        }
        Ok(())
    }

    /// Shifts the descriptions of the models by one knot.
    pub(in crate::optimal) fn describe_shift(&self) -> PyResult<()> {
        let mut described = lock("problem", &self.described)?;
        let models = described.len() - 1;
        let all = described[..models].iter_mut().flatten().filter(|described| described.moves());
        all.for_each(|described| Arc::make_mut(described).shift());
        self.moved.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Returns an error for a duration that differs from the present one, at a knot whose model has no description.
    pub(in crate::optimal) fn check_durations(
        &self,
        problem: &rust::Problem,
        knot_models: &[usize],
        durations: &[f64],
    ) -> PyResult<()> {
        let described = lock("problem", &self.described)?;
        let models = described.len() - 1;
        for (t, (&k, &dt)) in knot_models.iter().zip(durations).enumerate() {
            let is_robot = k >= models || described[k].is_some(); // unknown models are errors of the problem
            if !is_robot && (t >= problem.horizon() || problem.duration(t) != Some(dt)) {
                return Err(ProblemError::new_err(format!("knot {t}: expected an action of a robot with a duration")));
            }
        }
        Ok(())
    }

    /// Moves the descriptions of the models by the knots that have passed, and removes the costs and limits of single
    /// knots whose models have changed from `before` to `after`.
    pub(in crate::optimal) fn describe_knots(&self, passed: usize, before: &[usize], after: &[usize]) -> PyResult<()> {
        for _ in 0..passed {
            self.describe_shift()?;
        }
        let mut described = lock("problem", &self.described)?;
        for (t, (before, after)) in before[passed..].iter().zip(after).enumerate() {
            if before != after
                && let Some(described) = &mut described[*before]
                && described.moves()
            {
                Arc::make_mut(described).release(t);
            }
        }
        self.moved.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Returns the index of each knot's model, where a knot whose duration differs from the duration of its model has a
    /// new model. Also returns the new models, as the index of a model and a duration.
    pub(super) fn separate_durations(
        problem: &rust::Problem,
        described: &[Option<Arc<Described>>],
    ) -> (Vec<usize>, Vec<(usize, f64)>) {
        let mut added: Vec<(usize, f64)> = Vec::new();
        let models = described.len() - 1;
        let knot_models = problem.knot_models().iter().enumerate().map(|(t, &k)| {
            let own = described[k].as_ref().and_then(|described| described.knot.dynamics.dt());
            let (Some(own), Some(dt)) = (own, problem.duration(t)) else { return k };
            if own == dt {
                return k;
            }
            let known = added.iter().position(|other| *other == (k, dt));
            models
                + known.unwrap_or_else(|| {
                    added.push((k, dt));
                    added.len() - 1
                })
        });
        (knot_models.collect(), added)
    }

    /// Returns the number of times that the horizon was shifted.
    pub(in crate::optimal) fn moved(&self) -> usize {
        self.moved.load(Ordering::Relaxed)
    }

    /// Calls a function with each variable that stores errors of Python functions, until the function returns a value.
    pub(super) fn each_fault<T>(&self, mut f: impl FnMut(&mut Option<PyErr>) -> Option<T>) -> Option<T> {
        let faults = self.faults.lock().unwrap_or_else(PoisonError::into_inner);
        let mut found = None;
        for fault in std::iter::once(&self.fault).chain(&*faults) {
            let this = f(&mut fault.lock().unwrap_or_else(PoisonError::into_inner));
            found = found.or(this);
        }
        found
    }

    /// Raises the stored error of the problem's Python functions, if there is one.
    pub(in crate::optimal) fn raise(&self) -> PyResult<()> {
        self.each_fault(Option::take).map_or(Ok(()), Err)
    }

    /// Returns whether a Python function of the problem has raised an error, which is then stored.
    pub(in crate::optimal) fn has_failed(&self) -> bool {
        self.each_fault(|error| error.is_some().then_some(())).is_some()
    }
}
