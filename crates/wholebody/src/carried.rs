//! State of a controller that lasts from one tick to the next, as a list of numbers. The list is needed to clone or to
//! save a controller.
//!
//! All other numbers follow from the description (model, contacts, tasks, settings) and from the arguments of a step. A
//! second controller with the same description can be given this list. With [`Backend::InteriorPoint`], the commands of
//! both controllers then have the same bits. With clarabel, whose solvers are built again, their solutions are the same
//! up to clarabel's tolerance.
//!
//! [`Backend::InteriorPoint`]: crate::Backend::InteriorPoint

use crate::command::{Command, CommandSource};
use crate::controller::WholeBodyController;
use crate::error::{InvalidRotation, Status};
use crate::numbers::{Reader, flag};
use crate::safety::Safety;
use crate::task_hierarchy::TaskHierarchy;
use crate::warm_start::WarmStart;
use condyle_spatial::{Force, Vec3};

/// Names of arguments and references in a [`Status`]. A name is stored as its index in this list.
const NAMES: [&str; 8] = ["q", "v", "com", "frames", "posture", "momentum", "contacts", "posture.q"];

/// Sources of a command. A source is stored as its index in this list.
const SOURCES: [CommandSource; 3] =
    [CommandSource::Solution, CommandSource::LastSolution, CommandSource::GravityCompensation];

impl Clone for WholeBodyController {
    /// Returns a copy of the controller with its own memory. The copy's next commands have the same bits as the
    /// original's. With clarabel, whose solvers are built again, the solutions are the same up to clarabel's tolerance.
    fn clone(&self) -> Self {
        let contacts: Vec<_> = self.equations.contacts.iter().map(|contact| contact.description.clone()).collect();
        let tasks: Vec<_> = self.objective.tasks.iter().map(|task| task.task.clone()).collect();
        let mut clone = Self::new(self.equations.model(), &contacts, &tasks, self.settings.clone())
            .expect("the description was accepted before");
        assert!(clone.restore(&self.carried()), "numbers of a controller of the same description");
        clone
    }
}

impl WholeBodyController {
    /// Returns the numbers that the controller carries from one tick to the next.
    #[doc(hidden)]
    pub fn carried(&self) -> Vec<f64> {
        let mut numbers = Vec::new();
        numbers.extend(self.equations.contacts.iter().map(|contact| flag(contact.active)));
        self.safety.write(&mut numbers);
        self.hierarchy.write(&mut numbers);
        write_command(&self.command, &mut numbers);
        numbers
    }

    /// Restores the numbers carried by a controller with the same description; returns whether the numbers were valid.
    #[doc(hidden)]
    pub fn restore(&mut self, numbers: &[f64]) -> bool {
        let mut from = Reader::new(numbers);
        let read = self.read(&mut from);
        read.is_some() && from.is_empty()
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Option<()> {
        self.equations.contacts.iter_mut().try_for_each(|contact| from.flag().map(|active| contact.active = active))?;
        self.safety.read(from)?;
        self.hierarchy.read(from)?;
        read_command(&mut self.command, from)
    }
}

impl Safety {
    fn write(&self, out: &mut Vec<f64>) {
        for numbers in [&self.tau, &self.q, &self.v] {
            out.extend(numbers);
        }
        out.push(flag(self.current));
        out.push(self.age.map_or(0.0, |age| f64::from(age) + 1.0)); // the age plus 1, or 0 if there is no solution
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Option<()> {
        for numbers in [&mut self.tau, &mut self.q, &mut self.v] {
            from.fill(numbers)?;
        }
        self.current = from.flag()?;
        self.age = u32::try_from(from.index(1 << 33)?).ok()?.checked_sub(1);
        Some(())
    }
}

impl TaskHierarchy {
    fn write(&self, out: &mut Vec<f64>) {
        for (warm_start, given) in self.warm_starts.iter().zip(&self.given) {
            warm_start.write(out);
            if let Some(elimination) = given.elimination() {
                elimination.write(out);
            }
        }
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Option<()> {
        for (warm_start, given) in self.warm_starts.iter_mut().zip(&mut self.given) {
            warm_start.read(from)?;
            given.read_elimination(from)?;
        }
        Some(())
    }
}

impl WarmStart {
    fn write(&self, out: &mut Vec<f64>) {
        out.push(flag(self.known));
        self.all.parts().into_iter().for_each(|part| out.extend(part));
    }

    fn read(&mut self, from: &mut Reader<'_>) -> Option<()> {
        self.known = from.flag()?;
        self.all.parts_mut().into_iter().try_for_each(|part| from.fill(part))
    }
}

fn write_command(command: &Command, out: &mut Vec<f64>) {
    let Command { status, source, tau, a, forces, com_acceleration, violation, .. } = command;
    out.extend(SOURCES.iter().position(|s| s == source).map(|k| k as f64));
    out.extend(tau.iter().chain(a));
    out.extend(forces.iter().flat_map(|force| force.to_array()));
    out.extend(com_acceleration.to_array());
    out.extend([*violation, f64::from(command.iterations)]);
    out.extend([flag(command.reduced_accuracy), flag(command.limits_relaxed)]);
    let name = |name: &str| NAMES.iter().position(|n| *n == name).unwrap_or(NAMES.len()) as f64;
    match *status {
        Status::Solved => out.push(0.0),
        Status::Infeasible => out.push(1.0),
        Status::IterationLimit => out.push(2.0),
        Status::TimeLimit => out.push(3.0),
        Status::NumericalError => out.push(4.0),
        Status::NotFinite { name: n, index, value } => out.extend([5.0, name(n), index as f64, value]),
        Status::InvalidState(InvalidRotation::Joint { name: n, body, first, end, length }) => {
            out.extend([6.0, name(n), body as f64, first as f64, end as f64, length]);
        }
        Status::InvalidState(InvalidRotation::Pose { name: n, index, error }) => {
            out.extend([7.0, name(n), index as f64, error]);
        }
        Status::NotStarted => out.push(8.0),
    }
}

fn read_command(command: &mut Command, from: &mut Reader<'_>) -> Option<()> {
    command.source = SOURCES[from.index(SOURCES.len())?];
    from.fill(&mut command.tau)?;
    from.fill(&mut command.a)?;
    command.forces.iter_mut().try_for_each(|force| from.array::<6>().map(|f| *force = Force::from(f)))?;
    command.com_acceleration = Vec3::from(from.array::<3>()?);
    command.violation = from.number()?;
    command.iterations = from.index(1 << 32)? as u32;
    (command.reduced_accuracy, command.limits_relaxed) = (from.flag()?, from.flag()?);
    command.status = read_status(from)?;
    Some(())
}

fn read_status(from: &mut Reader<'_>) -> Option<Status> {
    let kind = from.index(9)?;
    let mut name = || from.index(NAMES.len()).map(|k| NAMES[k]);
    Some(match kind {
        0 => Status::Solved,
        1 => Status::Infeasible,
        2 => Status::IterationLimit,
        3 => Status::TimeLimit,
        4 => Status::NumericalError,
        5 => Status::NotFinite { name: name()?, index: from.index(usize::MAX)?, value: from.any()? },
        6 => {
            let (name, mut index) = (name()?, || from.index(usize::MAX));
            let (body, first, end) = (index()?, index()?, index()?);
            Status::InvalidState(InvalidRotation::Joint { name, body, first, end, length: from.any()? })
        }
        7 => {
            let (name, index) = (name()?, from.index(usize::MAX)?);
            Status::InvalidState(InvalidRotation::Pose { name, index, error: from.any()? })
        }
        _ => Status::NotStarted,
    })
}
