//! Numbers of a robot, its bounds and its friction, which are changed in the actions of a problem.

use super::cost_access::terms_of;
use super::dynamics::robot::robot_of;
use super::residuals::cones::FrictionCone;
use super::residuals::residual::Residual;
use crate::problem::innermost;
use crate::{ActionModel, Error, Problem};
use condyle_dynamics::inertial_parameters::{from_inertia, to_inertia};
use condyle_dynamics::{Body, Inertia, Joint, Model, Vec3, Warning, WarningKind};
use std::sync::Arc;

/// Numbers of a robot's model that are a parameter.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum RobotNumbers {
    /// Inertial parameters of the link with this name: mass, mass times centre of mass, and inertia about the origin of
    /// the link's frame.
    Inertia(String),
    /// Acceleration of gravity.
    Gravity,
    /// Armature of each degree of freedom.
    Armature,
}

impl RobotNumbers {
    /// Returns the numbers; `None` if the robot does not have the link.
    pub(crate) fn of(&self, model: &Model) -> Option<Vec<f64>> {
        match self {
            Self::Inertia(link) => Some(from_inertia(model.bodies()[body(model, link)?].inertia).to_vec()),
            Self::Gravity => Some(model.gravity().to_array().to_vec()),
            Self::Armature => Some(model.armature().to_vec()),
        }
    }

    /// Returns a size of each number, to which the step of a difference is proportional. For inertial parameters it
    /// follows from the mass and the inertia of the link. The sizes have lower bounds, because rounding errors are
    /// relative to the inertia matrix of the robot.
    pub(crate) fn scales(&self, numbers: &[f64]) -> Vec<f64> {
        match (self, numbers) {
            (Self::Inertia(_), [m, hx, hy, hz, xx, _, yy, _, _, zz]) => {
                let (mass, inertia) = (m.max(0.1), (xx + yy + zz).max(1e-3));
                let moment = (mass * inertia).sqrt().max(hx.abs()).max(hy.abs()).max(hz.abs());
                let scale = |k: usize| [mass, moment, inertia][usize::from(k > 0) + usize::from(k > 3)];
                (0..10).map(scale).collect()
            }
            (Self::Armature, _) => numbers.iter().map(|x| x.max(1e-3)).collect(),
            _ => vec![1.0; numbers.len()],
        }
    }

    /// Moves one of the numbers of a robot by a step of a difference. A mass or an armature near zero moves from
    /// |step|, because it must not be negative. The three equal armatures of a free joint along its linear coordinates
    /// move together, each by a third of the step.
    pub(crate) fn move_by(&self, model: &Model, numbers: &mut [f64], entry: usize, step: f64) {
        let free = |body: &&Body| body.joint == Joint::FreeFlyer && (body.idx_v..body.idx_v + 3).contains(&entry);
        match (self, model.bodies()[1..].iter().find(free)) {
            (Self::Armature, Some(body)) => {
                for x in &mut numbers[body.idx_v..body.idx_v + 3] {
                    *x = x.max(step.abs()) + step / 3.0;
                }
            }
            (Self::Armature, None) => numbers[entry] = numbers[entry].max(step.abs()) + step,
            (Self::Inertia(_), _) if entry == 0 => numbers[0] = numbers[0].max(step.abs()) + step,
            _ => numbers[entry] += step,
        }
    }

    /// Returns the robot with other numbers, as [`with`](Self::with) does. The error says why the numbers are
    /// impossible: a body has negative moments of inertia, or moments that break the triangle inequality, or a first
    /// moment without mass, or the inertia matrix is singular. A robot that has this fault already may keep it.
    pub(crate) fn checked(&self, model: &Model, numbers: &[f64]) -> Result<Model, String> {
        if let (Self::Inertia(link), [0.0, h @ .., _, _, _, _, _, _]) = (self, numbers)
            && h.iter().any(|h| *h != 0.0)
        {
            return Err(format!("body `{link}` has no mass and a first moment of mass"));
        }
        let new = self.with(model, numbers).map_err(|error| error.to_string())?;
        let is_impossible = |warning: &&Warning| {
            matches!(warning.kind(), WarningKind::Negative | WarningKind::Triangle | WarningKind::Singular)
        };
        let is_new = |warning: &&Warning| {
            let same = |old: &Warning| old.kind() == warning.kind() && old.subject() == warning.subject();
            !model.warnings().iter().any(same)
        };
        match new.warnings().iter().filter(is_impossible).find(is_new) {
            Some(warning) => Err(warning.to_string()),
            None => Ok(new),
        }
    }

    /// Returns the robot with other numbers, which are checked as by a builder.
    pub(crate) fn with(&self, model: &Model, numbers: &[f64]) -> Result<Model, condyle_dynamics::Error> {
        match self {
            Self::Inertia(link) => {
                let of = body(model, link);
                let new: Inertia<f64> = to_inertia(core::array::from_fn(|k| numbers[k]));
                model.with_inertias(|i, old| if Some(i) == of { new } else { old })
            }
            Self::Gravity => model.clone().with_gravity(Vec3::new(numbers[0], numbers[1], numbers[2])),
            Self::Armature => model.clone().with_armature(numbers),
        }
    }
}

/// Returns the index of the body with the name of a link.
fn body(model: &Model, link: &str) -> Option<usize> {
    (1..model.bodies().len()).find(|&i| model.bodies()[i].name == link)
}

/// Function that returns the robot that replaces a robot.
pub(crate) type ChangeRobot<'a> = &'a mut dyn FnMut(&Arc<Model>) -> Result<Arc<Model>, Error>;

/// Function that changes the lower and upper bounds of the controls of one action.
pub(crate) type ChangeBounds<'a> = &'a mut dyn FnMut([&mut [f64]; 2]);

impl Problem {
    /// Calls `visit` with the robot of each action, and replaces the robot by the result. Actions that share a robot
    /// share the new one. Returns whether an action has a robot. Allocates.
    pub(crate) fn change_robots(&mut self, visit: ChangeRobot<'_>) -> Result<bool, Error> {
        let mut pairs: Vec<[Arc<Model>; 2]> = Vec::new();
        // all new robots exist before the first one replaces an old one
        self.each_own_action(&mut |action| {
            let Some(robot) = robot_of(action) else { return Ok(()) };
            if !pairs.iter().any(|[old, _]| Arc::ptr_eq(old, &robot.model)) {
                pairs.push([robot.model.clone(), visit(&robot.model)?]);
            }
            Ok(())
        })?;
        if pairs.iter().all(|[old, new]| Arc::ptr_eq(old, new)) {
            return Ok(!pairs.is_empty());
        }
        self.each_own_action(&mut |action| {
            let Some(robot) = robot_of(action) else { return Ok(()) };
            if let Some([_, new]) = pairs.iter().find(|[old, _]| Arc::ptr_eq(old, &robot.model)) {
                robot.set_model(new);
            }
            Ok::<(), Error>(())
        })?;
        self.share_scratch();
        Ok(!pairs.is_empty())
    }

    /// Calls `change` with the bounds on the controls of each action that has bounds. Returns whether one has.
    pub(crate) fn change_bounds(&mut self, change: ChangeBounds<'_>) -> bool {
        let mut found = false;
        let visited = self.each_own_action(&mut |action| {
            if let Some((bounds, count)) = innermost(action).and_then(|group| group.bounds_mut()) {
                found = true;
                let [lower, upper] = bounds;
                change([&mut lower[..count], &mut upper[..count]]);
                for all in [lower, upper] {
                    // the bounds apply at each node of a polynomial in time
                    for node in 1..all.len() / count.max(1) {
                        all.copy_within(..count, node * count);
                    }
                }
            }
            Ok::<(), core::convert::Infallible>(())
        });
        let Ok(()) = visited;
        found
    }

    /// Calls `change` with the friction cone of each limit and cost called `name`. Returns whether one exists.
    pub(crate) fn change_friction(&mut self, name: &str, change: &mut dyn FnMut(&mut FrictionCone)) -> bool {
        let mut found = false;
        let visited = self.each_own_action(&mut |action: &mut dyn ActionModel| {
            if let Some(terms) = terms_of(action) {
                found |= terms.change_friction(name, change);
            }
            Ok::<(), core::convert::Infallible>(())
        });
        let Ok(()) = visited;
        found
    }
}

/// Returns the names of the parameters of a problem's costs, limits, contacts, bounds and robots.
pub(crate) fn parameter_names(problem: &mut Problem) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    let mut add = |name: String| {
        if !all.contains(&name) {
            all.push(name);
        }
    };
    if (0..problem.horizon()).any(|t| problem.duration(t).is_some_and(|dt| dt > 0.0)) {
        add("duration".to_owned());
    }
    let visited = problem.each_own_action(&mut |action| {
        if innermost(action).is_some_and(|group| group.bounds_mut().is_some()) {
            ["lower", "upper"].into_iter().for_each(|side| add(format!("bounds/{side}")));
        }
        let Some(robot) = robot_of(action) else { return Ok::<(), core::convert::Infallible>(()) };
        robot.terms.visit_terms(&mut |name, residual, cost| {
            if let Some(cost) = cost {
                add(format!("weight/{name}"));
                if residual.target().is_some() {
                    add(format!("target/{name}"));
                }
                if cost.activation.weights().is_some() {
                    add(format!("entry_weights/{name}"));
                }
            }
            if matches!(residual, Residual::FrictionCone { .. } | Residual::WrenchCone { .. }) {
                add(format!("friction/{name}"));
            }
        });
        robot.contacts().iter().for_each(|contact| add(format!("contact/{}", contact.name)));
        robot.model.bodies()[1..].iter().for_each(|body| add(format!("inertia/{}", body.name)));
        ["gravity", "armature"].into_iter().for_each(|name| add(name.to_owned()));
        Ok(())
    });
    let Ok(()) = visited;
    all
}
