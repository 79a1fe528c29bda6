//! One step of differential inverse kinematics: computes tasks and limits, and solves a program for each priority.

use crate::active_set::{ActiveSet, Constraint, Unsolved};
use crate::bounds::Bounds;
use crate::error::{Error, finite, length, poses};
use crate::held::Held;
use crate::rows::{Kinematics, Targets, Tasks, value};
use crate::separation::Separation;
use crate::settings::Settings;
use crate::task::Task;
use condyle_dynamics::distances::DistancePairs;
use condyle_dynamics::{Model, integrate, neutral};
use std::fmt;

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Status {
    /// The velocity solves the programs of all priorities.
    Solved,
    /// The velocity solves the programs, but pairs that are too near do not move apart as fast as their limit asks: the
    /// limits of the joints do not allow it.
    Relaxed,
    /// The velocity solves the programs of the priorities before this one; the next program was not solved, for
    /// numerical reasons. If the priority is 0, the velocity is the nearest to 0 that the limits of the joints allow.
    Stopped {
        /// First priority that was not solved.
        priority: usize,
    },
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Solved => f.write_str("solved"),
            Self::Relaxed => f.write_str("pairs that are too near move apart slower than their limit asks"),
            Self::Stopped { priority } => write!(f, "priority {priority} was not solved, for numerical reasons"),
        }
    }
}

/// Velocity of one step, with the errors of the tasks before the step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// v, nv numbers (rad/s, m/s). q ⊕ T v is within the limits if q is.
    pub v: Vec<f64>,
    /// Whether all priorities were solved.
    pub status: Status,
    /// Error of each task before the step: its linear and its angular part (m, rad). Errors of postures and couplings
    /// are in the second part.
    pub errors: Vec<[f64; 2]>,
    /// Limits that hold the step back: constraints that are active at the solution.
    pub held: Vec<Held>,
}

/// Differential inverse kinematics: the velocity of one step towards targets, under limits.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_ik::{DifferentialIk, Settings, Task};
/// let arm = robots::arm7();
/// let tasks = [Task::pose("tool"), Task::posture()];
/// let mut ik = DifferentialIk::new(&arm, &tasks, Settings::default())?;
/// let mut q = vec![0.3; 7];
/// let mut targets = ik.hold(&q)?;
/// targets.frames[0].translation.z -= 0.05; // 5 cm down
/// let step = ik.step(&q, &[0.0; 7], &targets)?;
/// assert!((step.errors[0][0] - 0.05).abs() < 1e-12);
/// ik.converge(&mut q, &targets, [1e-4, 1e-3], 100)?; // many steps
/// assert!(ik.last().errors[0][0] < 1e-4);
/// # Ok::<(), condyle_ik::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct DifferentialIk {
    model: Model,
    settings: Settings,
    kinematics: Kinematics,
    tasks: Tasks,
    bounds: Bounds,
    separation: Option<Separation>,
    program: ActiveSet,
    step: Step,
    /// Scratch: the solution of the priorities before, nv numbers.
    x: Vec<f64>,
    /// Scratch: a displacement and a position.
    next: [Vec<f64>; 2],
}

impl DifferentialIk {
    /// Checks all arguments and allocates memory.
    ///
    /// # Errors
    /// [`Error`] for an unknown frame or joint, and for a number outside of its range.
    pub fn new(model: &Model, tasks: &[Task], settings: Settings) -> Result<Self, Error> {
        settings.check(model)?;
        let (resolved, frames) = Tasks::new(model, tasks)?;
        let bounds = Bounds::new(model, settings.limits.as_ref())?;
        let nv = model.nv();
        let separation = settings.distances.as_ref().map(|limits| Separation::new(model, limits, settings.dt));
        let separation = separation.transpose()?;
        let pairs = separation.as_ref().map_or(0, |separation| separation.pairs.len());
        let held: usize = resolved.priorities.iter().map(|p| p.r.capacity() + nv).sum();
        Ok(Self {
            kinematics: Kinematics::new(model, &frames, resolved.reads[1]),
            program: ActiveSet::new(nv, held, pairs),
            step: Step {
                v: vec![0.0; nv],
                status: Status::Solved,
                errors: vec![[0.0; 2]; tasks.len()],
                held: Vec::with_capacity(nv + 1),
            },
            x: vec![0.0; nv],
            next: [vec![0.0; nv], neutral(model)],
            tasks: resolved,
            model: model.clone(),
            settings,
            bounds,
            separation,
        })
    }

    /// Returns the model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns targets that keep the present values of all tasks at q: nq numbers.
    ///
    /// # Errors
    /// [`Error`] for a position that is not valid.
    pub fn hold(&mut self, q: &[f64]) -> Result<Targets, Error> {
        length("q", q.len(), self.model.nq())?;
        self.model.check_position(q)?;
        self.kinematics.update(&self.model, q);
        Ok(self.tasks.hold(&self.kinematics, q))
    }

    /// Computes the velocity of one step from q, after the velocity `v0` of the step before.
    ///
    /// q: nq numbers; v0: nv numbers, which only limits of acceleration read. Allocates nothing.
    ///
    /// # Errors
    /// [`Error`] for lists of the wrong length, for numbers that are not finite, and for rotations that are not valid.
    pub fn step(&mut self, q: &[f64], v0: &[f64], targets: &Targets) -> Result<&Step, Error> {
        self.check(q, v0, targets)?;
        let Self { model, settings, kinematics, tasks, bounds, separation, program, step, x, .. } = self;
        kinematics.update(model, q);
        tasks.update(model, q, kinematics, targets, settings.damping);
        step.errors.copy_from_slice(&tasks.errors);
        bounds.write(q, v0, settings.dt, &mut program.lower, &mut program.upper);
        program.E.clear();
        program.e.clear();
        program.A.clear();
        program.b.clear();
        if let Some(separation) = separation {
            let placements = kinematics.data.placements(model).expect("computed by the update");
            separation.write(placements, program);
        }
        step.status = Status::Solved;
        step.held.clear();
        let last = tasks.priorities.len() - 1;
        for (priority, objective) in tasks.priorities.iter().enumerate() {
            objective.write(&mut program.H, &mut program.c);
            let mut solved = program.solve();
            if priority == 0 && matches!(solved, Err(Unsolved::Infeasible(_))) && program.relax() {
                step.status = Status::Relaxed;
                objective.write(&mut program.H, &mut program.c);
                solved = program.solve();
            }
            match solved {
                Ok(()) => x.copy_from_slice(&program.x),
                Err(Unsolved::Infeasible(_) | Unsolved::Numerical) => {
                    if priority == 0 {
                        let nearest = |(l, u): (&f64, &f64)| 0.0_f64.max(*l).min(*u);
                        let bounds = program.lower.iter().zip(&program.upper);
                        x.iter_mut().zip(bounds.map(nearest)).for_each(|(x, y)| *x = y);
                    }
                    step.status = Status::Stopped { priority };
                    break;
                }
            }
            step.held.clear();
            for (constraint, _) in program.active() {
                match *constraint {
                    Constraint::Lower(i) => step.held.push(Held::Lower(i)),
                    Constraint::Upper(i) => step.held.push(Held::Upper(i)),
                    Constraint::Row(i) => step.held.extend(separation.as_ref().map(|s| Held::Pair(s.rows[i]))),
                    Constraint::Equality(_) => {}
                }
            }
            if priority < last {
                // Later priorities keep R Δq: all minimisers have the same R Δq.
                for row in objective.R.chunks_exact(x.len().max(1)) {
                    program.e.push(value(row, x));
                    program.E.extend_from_slice(row);
                }
                for (i, _) in objective.single.iter().enumerate().filter(|(_, single)| **single) {
                    let from = program.E.len();
                    program.E.resize(from + x.len(), 0.0);
                    program.E[from + i] = 1.0;
                    program.e.push(x[i]);
                }
            }
        }
        let rate = settings.dt.recip();
        step.v.iter_mut().zip(x.iter()).for_each(|(v, x)| *v = rate * x);
        Ok(step)
    }

    /// Makes steps from q until all errors of tasks of priority 0 are within `tolerance` (m, rad), at most `steps`.
    /// Writes the last position to q, and returns the number of steps made. [`last`](Self::last) has the errors.
    ///
    /// q: nq numbers. Allocates nothing.
    ///
    /// # Errors
    /// In the same cases as [`step`](Self::step), and [`Error::Setting`] for a tolerance that is negative or NaN.
    pub fn converge(
        &mut self,
        q: &mut [f64],
        targets: &Targets,
        tolerance: [f64; 2],
        steps: usize,
    ) -> Result<usize, Error> {
        for tolerance in tolerance {
            if tolerance.is_nan() || tolerance < 0.0 {
                return Err(Error::Setting { name: "tolerance", value: tolerance, allowed: "at least 0" });
            }
        }
        let mut v0 = std::mem::take(&mut self.next[0]);
        v0.fill(0.0);
        let mut made = 0;
        let result = loop {
            if let Err(error) = self.step(q, &v0, targets) {
                break Err(error);
            }
            let first = self.tasks.first_errors();
            if made == steps || first[0] <= tolerance[0] && first[1] <= tolerance[1] {
                break Ok(made);
            }
            v0.copy_from_slice(&self.step.v);
            self.x.iter_mut().zip(&v0).for_each(|(x, v)| *x = self.settings.dt * v);
            integrate(&self.model, q, &self.x, &mut self.next[1]);
            q.copy_from_slice(&self.next[1]);
            made += 1;
        };
        self.next[0] = v0;
        result
    }

    /// Returns the smallest distance of all pairs before the last step, and the index of its pair. Returns `None`
    /// without pairs. The distance of a pair beyond the range of the limits is a lower bound.
    pub fn nearest(&self) -> Option<(usize, f64)> {
        self.separation.as_ref().and_then(Separation::nearest)
    }

    /// Returns the pairs of the limits of distances. [`DistancePairs::place`] moves an obstacle.
    pub fn pairs_mut(&mut self) -> Option<&mut DistancePairs> {
        self.separation.as_mut().map(|separation| &mut separation.pairs)
    }

    /// Returns the last step.
    pub fn last(&self) -> &Step {
        &self.step
    }

    /// Returns a limit of the last step in words, with the name of the joint or of the geometries. A limit of velocity
    /// or acceleration is called so.
    pub fn describe(&self, held: Held) -> String {
        let pairs = self.separation.as_ref().map(|separation| &separation.pairs);
        held.describe(&self.model, pairs, Some(&self.bounds))
    }

    fn check(&self, q: &[f64], v0: &[f64], targets: &Targets) -> Result<(), Error> {
        let model = &self.model;
        length("q", q.len(), model.nq())?;
        length("v0", v0.len(), model.nv())?;
        length("targets.frames", targets.frames.len(), self.tasks.frame_targets)?;
        model.check_position(q)?;
        finite("v0", v0)?;
        poses("targets.frames", &targets.frames)?;
        if self.tasks.reads[0] {
            length("targets.posture", targets.posture.len(), model.nq())?;
            model.check_position(&targets.posture)?;
        }
        if self.tasks.reads[1] {
            finite("targets.com", &targets.com.to_array())?;
        }
        Ok(())
    }
}
