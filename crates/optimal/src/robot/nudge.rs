//! Small changes of named parameters of a robot's problem, for derivatives by differences.

use super::cost_access::CostMut;
use super::residuals::residual::Residual;
use super::residuals::target::Target;
use super::robot_numbers::RobotNumbers;
use crate::{Error, Problem};
use condyle_dynamics::{Model, Motion, Se3, integrate, lie};
use std::sync::Arc;

/// Step of central differences, where truncation and rounding errors of a function of size 1 are about equal.
const STEP: f64 = 6e-6;

/// Parameter of a problem with its values, from which each entry can be changed by a step.
#[derive(Debug)]
pub(crate) struct Nudge {
    name: String,
    kind: Kind,
    /// Values of each cost term or knot that has the parameter, in the order of visits.
    values: Vec<Vec<f64>>,
    /// Placements of each contact, in the order of visits.
    placements: Vec<Se3<f64>>,
    /// Robots, in the order of visits.
    robots: Vec<Arc<Model>>,
    size: usize,
}

/// Kind of a parameter.
#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Target,
    Weight,
    EntryWeights,
    Contact,
    Duration,
    /// Lower bounds on controls, or the upper ones if set.
    Bounds(bool),
    Friction,
    Robot(RobotNumbers),
}

impl Nudge {
    /// Reads the targets of a cost; `None` if the cost does not exist.
    pub(crate) fn target(problem: &mut Problem, name: &str) -> Result<Option<Self>, Error> {
        Self::of_costs(problem, name, &Kind::Target, |cost| {
            let target = cost.target().ok_or_else(|| lacks(cost, "target"))?;
            let mut numbers = vec![0.0; target.size()];
            target.write(&mut numbers);
            let is_state = matches!(cost.get().residual, Residual::State { .. });
            Ok((numbers, if is_state { 2 * cost.model().nv() } else { change_size(&target) }))
        })
    }

    /// Reads the weights of a cost; `None` if the cost does not exist.
    pub(crate) fn weight(problem: &mut Problem, name: &str) -> Result<Option<Self>, Error> {
        Self::of_costs(problem, name, &Kind::Weight, |cost| Ok((vec![cost.get().weight], 1)))
    }

    /// Reads the weights of the entries of a cost; `None` if the cost does not exist.
    pub(crate) fn entry_weights(problem: &mut Problem, name: &str) -> Result<Option<Self>, Error> {
        Self::of_costs(problem, name, &Kind::EntryWeights, |cost| {
            let weights = cost.get().activation.weights().ok_or_else(|| lacks(cost, "weights of entries"))?;
            Ok((weights.to_vec(), weights.len()))
        })
    }

    /// Reads the placements of a contact; `None` if the contact does not exist.
    pub(crate) fn contact(problem: &mut Problem, name: &str) -> Result<Option<Self>, Error> {
        let mut placements = Vec::new();
        problem.change_contacts(name, |contact| placements.push(contact.target.placement))?;
        let found = !placements.is_empty();
        Ok(found.then_some(Self { placements, ..Self::new(name, Kind::Contact, Vec::new(), 6) }))
    }

    /// Reads the durations of the knots; `None` if no knot has a duration.
    pub(crate) fn duration(problem: &mut Problem) -> Result<Option<Self>, Error> {
        let seconds = |t| problem.duration(t).unwrap_or(0.0);
        let values: Vec<Vec<f64>> = (0..problem.horizon()).map(|t| vec![seconds(t)]).collect();
        let found = values.iter().any(|dt| dt[0] > 0.0);
        Ok(found.then_some(Self::new("", Kind::Duration, values, 1)))
    }

    /// Reads the lower bounds on controls, or the upper ones if `upper` is set; `None` without bounds.
    pub(crate) fn bounds(problem: &mut Problem, upper: bool) -> Result<Option<Self>, Error> {
        let mut values: Vec<Vec<f64>> = Vec::new();
        let found = problem.change_bounds(&mut |bounds| values.push(bounds[usize::from(upper)].to_vec()));
        let size = values.first().map_or(0, Vec::len);
        if let Some(other) = values.iter().find(|other| other.len() != size) {
            let what = format!("knots have bounds on {size} and on {} controls, expected the same number", other.len());
            return Err(Error::Parameter {
                name: if upper { "bounds/upper" } else { "bounds/lower" }.to_owned(),
                what,
            });
        }
        Ok(found.then(|| Self::new("", Kind::Bounds(upper), values, size)))
    }

    /// Reads the coefficient of friction of cones; `None` if no limit and no cost with this name is a cone.
    pub(crate) fn friction(problem: &mut Problem, name: &str) -> Result<Option<Self>, Error> {
        let mut values = Vec::new();
        let found = problem.change_friction(name, &mut |cone| values.push(vec![cone.mu]));
        Ok(found.then(|| Self::new(name, Kind::Friction, values, 1)))
    }

    /// Reads numbers of the robots; `None` without a robot that has them.
    pub(crate) fn robot(problem: &mut Problem, numbers: RobotNumbers) -> Result<Option<Self>, Error> {
        let (mut values, mut robots) = (Vec::new(), Vec::new());
        problem.change_robots(&mut |model| {
            values.extend(numbers.of(model));
            robots.push(model.clone());
            Ok(model.clone())
        })?;
        let found =
            !values.is_empty() && values.len() == robots.len() && values.iter().all(|v| v.len() == values[0].len());
        let size = values.first().map_or(0, Vec::len);
        Ok(found.then(|| Self { robots, ..Self::new("", Kind::Robot(numbers), values, size) }))
    }

    fn new(name: &str, kind: Kind, values: Vec<Vec<f64>>, size: usize) -> Self {
        Self { name: name.to_owned(), kind, values, placements: Vec::new(), robots: Vec::new(), size }
    }

    /// Reads the values of all costs with a name, and the size of their changes, which must be the same.
    fn of_costs(
        problem: &mut Problem,
        name: &str,
        kind: &Kind,
        read: impl Fn(&CostMut<'_>) -> Result<(Vec<f64>, usize), Error>,
    ) -> Result<Option<Self>, Error> {
        let (mut values, mut sizes) = (Vec::new(), Vec::new());
        let found = problem.change_costs(name, |cost| {
            let (numbers, size) = read(cost)?;
            if let Some(first) = sizes.first().filter(|first| **first != size) {
                let what = format!("its terms have {first} and {size} numbers, expected the same number everywhere");
                return Err(Error::Cost { name: name.to_owned(), what });
            }
            values.push(numbers);
            sizes.push(size);
            Ok(())
        })?;
        Ok(found.then(|| Self::new(name, kind.clone(), values, sizes[0])))
    }

    /// Returns the value, if it is the same everywhere; `None` if it differs.
    pub(crate) fn value(&self) -> Option<Vec<f64>> {
        let matrices = self.placements.iter().map(|placement| {
            let mut numbers = vec![0.0; 16];
            Target::Placement(*placement).write(&mut numbers);
            numbers
        });
        let is_timed = |value: &Vec<f64>| self.kind != Kind::Duration || value[0] > 0.0; // an impact takes no time
        let all: Vec<Vec<f64>> = self.values.iter().filter(|value| is_timed(value)).cloned().chain(matrices).collect();
        all.iter().all(|value| *value == all[0]).then(|| all[0].clone())
    }

    /// Returns the number of entries of a value.
    pub(crate) fn value_size(&self) -> usize {
        self.values.first().map_or(16, Vec::len)
    }

    /// Sets the parameter to the same value everywhere.
    pub(crate) fn set(&self, problem: &mut Problem, numbers: &[f64]) -> Result<(), Error> {
        match &self.kind {
            Kind::Target => problem.change_costs(&self.name, |cost| cost.set_target_numbers(numbers))?,
            Kind::Weight => problem.change_costs(&self.name, |cost| cost.set_weight(numbers[0]))?,
            Kind::EntryWeights => problem.change_costs(&self.name, |cost| cost.set_entry_weights(numbers))?,
            Kind::Contact => {
                let Target::Placement(placement) = Target::Placement(Se3::identity()).of_numbers(numbers) else {
                    unreachable!("the kind of a target does not change")
                };
                problem.change_contacts(&self.name, |contact| contact.target.placement = placement)?
            }
            Kind::Duration => {
                for t in 0..problem.horizon() {
                    if problem.duration(t).is_some_and(|dt| dt > 0.0) {
                        problem.set_duration(t, numbers[0])?;
                    }
                }
                true
            }
            Kind::Bounds(upper) => {
                let side = usize::from(*upper);
                let mut fits = !numbers.iter().any(|x| x.is_nan());
                problem.change_bounds(&mut |bounds| {
                    let pair = |(i, x): (usize, &f64)| if *upper { bounds[0][i] <= *x } else { *x <= bounds[1][i] };
                    fits &= numbers.iter().enumerate().all(pair);
                });
                if !fits {
                    let name = if *upper { "bounds/upper" } else { "bounds/lower" }.to_owned();
                    let what = "expected numbers with each lower bound at most the upper one".to_owned();
                    return Err(Error::Parameter { name, what });
                }
                problem.change_bounds(&mut |bounds| bounds[side].copy_from_slice(numbers))
            }
            Kind::Friction => {
                let mu = numbers[0];
                if !(mu >= 0.0 && mu.is_finite()) {
                    let what = format!("expected a finite coefficient of at least 0, found {mu}");
                    return Err(Error::Parameter { name: format!("friction/{}", self.name), what });
                }
                problem.change_friction(&self.name, &mut |cone| cone.mu = mu)
            }
            Kind::Robot(kind) => problem.change_robots(&mut |model| {
                kind.checked(model, numbers).map(Arc::new).map_err(|what| wrong(kind, what))
            })?,
        };
        Ok(())
    }

    /// Returns the number of entries of a change.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Returns whether costs and dynamics are linear in the parameter.
    pub(crate) fn is_linear(&self) -> bool {
        matches!(self.kind, Kind::Weight | Kind::EntryWeights)
    }

    /// Returns the step of differences of an entry: of the size of the weights, as they are linear, or a small one.
    pub(crate) fn step(&self, entry: usize) -> f64 {
        match &self.kind {
            Kind::Weight | Kind::EntryWeights => 1.0 + self.values.iter().flatten().fold(0.0_f64, |a, w| a.max(*w)),
            Kind::Duration => {
                self.values.iter().flatten().filter(|dt| **dt > 0.0).fold(1.0_f64, |a, dt| a.min(*dt)) * STEP
            }
            Kind::Target | Kind::Contact | Kind::Bounds(_) | Kind::Friction => STEP,
            Kind::Robot(numbers) => {
                let scales = self.values.iter().map(|values| numbers.scales(values)[entry]);
                scales.fold(f64::INFINITY, f64::min) * STEP
            }
        }
    }

    /// Sets the parameter to its value plus a change of one entry.
    pub(crate) fn apply(&self, problem: &mut Problem, entry: usize, step: f64) -> Result<(), Error> {
        let mut visits = self.values.iter();
        let mut next = || visits.next().expect("the visits are the same as at the beginning");
        match &self.kind {
            Kind::Target => problem.change_costs(&self.name, |cost| {
                let moved = moved_target(cost, next(), entry, step);
                cost.set_target_numbers(&moved)
            })?,
            Kind::Weight => problem.change_costs(&self.name, |cost| cost.set_weight(next()[0] + step))?,
            Kind::EntryWeights => problem.change_costs(&self.name, |cost| {
                let mut weights = next().clone();
                weights[entry] += step;
                cost.set_entry_weights(&weights)
            })?,
            Kind::Contact => {
                let mut placements = self.placements.iter();
                let change = exponential(entry, step);
                problem.change_contacts(&self.name, |contact| {
                    let placement = *placements.next().expect("the visits are the same as at the beginning");
                    contact.target.placement = if step == 0.0 { placement } else { placement * change };
                })?
            }
            Kind::Duration => {
                for t in 0..problem.horizon() {
                    let dt = next()[0];
                    if dt > 0.0 {
                        problem.set_duration(t, dt + step)?;
                    }
                }
                true
            }
            Kind::Bounds(upper) => problem.change_bounds(&mut |mut bounds| {
                let to = &mut bounds[usize::from(*upper)];
                to.copy_from_slice(next());
                to[entry] += step;
            }),
            Kind::Friction => problem.change_friction(&self.name, &mut |cone| cone.mu = next()[0] + step),
            Kind::Robot(kind) => {
                let mut robots = self.robots.iter();
                problem.change_robots(&mut |_| {
                    let (own, mut numbers) = (robots.next().expect("the visits are the same"), next().clone());
                    if step == 0.0 {
                        return Ok(own.clone());
                    }
                    kind.move_by(own, &mut numbers, entry, step);
                    kind.with(own, &numbers).map(Arc::new).map_err(|error| wrong(kind, error.to_string()))
                })?
            }
        };
        Ok(())
    }

    /// Sets the parameter to its value.
    pub(crate) fn restore(&self, problem: &mut Problem) -> Result<(), Error> {
        self.apply(problem, 0, 0.0)
    }
}

/// Returns the error for numbers of a robot that are not valid.
fn wrong(kind: &RobotNumbers, what: String) -> Error {
    let name = match kind {
        RobotNumbers::Inertia(link) => format!("inertia/{link}"),
        RobotNumbers::Gravity => "gravity".to_owned(),
        RobotNumbers::Armature => "armature".to_owned(),
    };
    Error::Parameter { name, what }
}

/// Returns the error for a cost without the given property.
fn lacks(cost: &CostMut<'_>, what: &str) -> Error {
    Error::Cost { name: cost.get().name.clone(), what: format!("it has no {what}") }
}

/// Returns the number of entries of a change of a target.
fn change_size(target: &Target<'_>) -> usize {
    match target {
        Target::Rotation(_) => 3,
        Target::Placement(_) => 6,
        other => other.size(),
    }
}

/// Returns exp(δ), where δ has one entry `step`, linear entries first.
fn exponential(entry: usize, step: f64) -> Se3<f64> {
    let mut delta = [0.0; 6];
    delta[entry] = step;
    let (rotation, translation) = lie::exp6(Motion::from(delta));
    Se3 { rotation: rotation.to_rotation(), translation }
}

/// Returns the numbers of a target that has been moved along one entry of its change.
fn moved_target(cost: &CostMut<'_>, numbers: &[f64], entry: usize, step: f64) -> Vec<f64> {
    let mut moved = numbers.to_vec();
    if step == 0.0 {
        return moved;
    }
    match (&cost.get().residual, cost.target()) {
        (Residual::State { .. }, _) => move_state(cost.model(), &mut moved, entry, step),
        (_, Some(target @ (Target::Rotation(_) | Target::Placement(_)))) => {
            let change = exponential(if target.size() == 9 { entry + 3 } else { entry }, step);
            match target.of_numbers(numbers) {
                Target::Rotation(R) => Target::Rotation(R * change.rotation).write(&mut moved),
                Target::Placement(M) => Target::Placement(M * change).write(&mut moved),
                _ => unreachable!("the kind of a target does not change"),
            }
        }
        _ => moved[entry] += step,
    }
    moved
}

/// Moves a state along one entry of its tangent space.
fn move_state(model: &Model, x: &mut [f64], entry: usize, step: f64) {
    let (nq, nv) = (model.nq(), model.nv());
    if entry >= nv {
        x[nq + entry - nv] += step;
        return;
    }
    let (q, mut change) = (x[..nq].to_vec(), vec![0.0; nv]);
    change[entry] = step;
    integrate(model, &q, &change, &mut x[..nq]);
}
