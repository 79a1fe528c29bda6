//! References of a whole horizon: targets and weights of one cost term at all knots, changed in place.

use super::cost_access::{CostMut, terms_of};
use super::dynamics::robot::robot_of;
use super::residuals::target::Target;
use crate::{Error, Problem};
use condyle_dynamics::{ContactConstraint, Force, Mat3, Motion, Se3, Vec3};

impl Target<'_> {
    /// Returns the number of entries in which [`Problem::set_references`] gives a target of this kind.
    ///
    /// | target | entries |
    /// | --- | --- |
    /// | reference of a state, of controls, efforts or accelerations | its numbers |
    /// | position | 3: x, y, z |
    /// | rotation | 9: the matrix, row by row |
    /// | placement | 16: the homogeneous matrix, row by row |
    /// | velocity, force or momentum | 6: linear, then angular |
    pub fn size(&self) -> usize {
        match self {
            Self::Numbers(numbers) => numbers.len(),
            Self::Position(_) => 3,
            Self::Rotation(_) => 9,
            Self::Placement(_) => 16,
            Self::Velocity(_) | Self::Force(_) => 6,
        }
    }

    /// Writes the target as [`size`](Self::size) numbers.
    ///
    /// # Panics
    /// If `to` has another length.
    #[track_caller]
    pub fn write(&self, to: &mut [f64]) {
        let rows = |R: &Mat3<f64>, row: usize| [R.x, R.y, R.z].map(|column| column.to_array()[row]);
        match self {
            Self::Numbers(numbers) => to.copy_from_slice(numbers),
            Self::Position(p) => to.copy_from_slice(&p.to_array()),
            Self::Rotation(R) => to.copy_from_slice([0, 1, 2].map(|row| rows(R, row)).as_flattened()),
            Self::Placement(Se3 { rotation, translation }) => {
                let p = translation.to_array();
                let row = |i: usize| {
                    let [x, y, z] = rows(rotation, i);
                    [x, y, z, p[i]]
                };
                to.copy_from_slice([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]].as_flattened());
            }
            Self::Velocity(v) => to.copy_from_slice(&v.to_array()),
            Self::Force(f) => to.copy_from_slice(&f.to_array()),
        }
    }

    /// Returns the target of the same kind with the given [`size`](Self::size) numbers.
    pub(super) fn of_numbers<'n>(&self, numbers: &'n [f64]) -> Target<'n> {
        let rotation = |stride: usize| {
            let column = |j: usize| Vec3::new(numbers[j], numbers[stride + j], numbers[2 * stride + j]);
            Mat3 { x: column(0), y: column(1), z: column(2) }
        };
        let six = || -> [f64; 6] { core::array::from_fn(|k| numbers[k]) };
        match self {
            Self::Numbers(_) => Target::Numbers(numbers),
            Self::Position(_) => Target::Position(Vec3::new(numbers[0], numbers[1], numbers[2])),
            Self::Rotation(_) => Target::Rotation(rotation(3)),
            Self::Placement(_) => {
                let translation = Vec3::new(numbers[3], numbers[7], numbers[11]);
                Target::Placement(Se3 { rotation: rotation(4), translation })
            }
            Self::Velocity(_) => Target::Velocity(Motion::from(six())),
            Self::Force(_) => Target::Force(Force::from(six())),
        }
    }
}

impl CostMut<'_> {
    /// Sets the target from [`Target::size`] numbers. Allocates nothing.
    ///
    /// # Errors
    /// The errors of [`set_target`](Self::set_target), and [`Error::Cost`] for another number of entries. The last row
    /// of a placement must be (0, 0, 0, 1).
    pub fn set_target_numbers(&mut self, numbers: &[f64]) -> Result<(), Error> {
        let wrong = |cost: &Self, what: String| Err(Error::Cost { name: cost.get().name.clone(), what });
        let Some(target) = self.target() else {
            return wrong(self, "its residual has no target".to_owned());
        };
        if numbers.len() != target.size() {
            return wrong(self, format!("its target has {} numbers, found {}", target.size(), numbers.len()));
        }
        if matches!(target, Target::Placement(_)) && numbers[12..] != [0.0, 0.0, 0.0, 1.0] {
            return wrong(self, format!("the last row of its target is {:?}, expected 0, 0, 0, 1", &numbers[12..]));
        }
        let target = target.of_numbers(numbers);
        self.set_target(target)
    }
}

/// Changes of a cost term at all knots of a horizon. Row t of the numbers belongs to knot t, and row N to the terminal
/// knot. Rows of knots without the term are ignored. A knot whose costs are shared with other knots first gets
/// separate costs with the same terms; they move with the knot when the horizon is [shifted](Problem::shift).
///
/// A call allocates only for knots that get separate costs for the first time. In a loop that shifts the horizon, the
/// new last knot takes the memory of the knot that has left, if both had the same terms.
impl Problem {
    /// Sets the targets of the cost called `name` at all knots, from N + 1 rows of [`Target::size`] numbers. Returns
    /// whether a knot has this cost.
    ///
    /// ```
    /// use condyle_dynamics::{Vec3, robots};
    /// use condyle_optimal::Problem;
    /// use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual, Target};
    /// use std::sync::Arc;
    /// let arm = Arc::new(robots::arm7());
    /// let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    /// let costs = vec![Cost::new("reach", 1.0, reach, Activation::Quadratic)];
    /// let knot = FreeDynamics::running(arm.clone(), 0.02, costs.clone())?;
    /// let end = FreeDynamics::terminal(arm, costs)?;
    /// let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 2], Box::new(end))?;
    /// problem.set_references("reach", &[0.4, 0.2, 0.5, 0.4, 0.2, 0.6, 0.4, 0.2, 0.7])?;
    /// let second = problem.cost_at_mut(1, "reach").unwrap();
    /// assert_eq!(second.target(), Some(Target::Position(Vec3::new(0.4, 0.2, 0.6))));
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Length`] if the numbers are not N + 1 rows; the errors of
    /// [`CostMut::set_target_numbers`], which then name the knot. Knots before this knot have their new targets.
    pub fn set_references(&mut self, name: &str, numbers: &[f64]) -> Result<bool, Error> {
        let rows = self.horizon() + 1;
        let n = numbers.len() / rows;
        Error::check_length("references", numbers.len(), n.max(1) * rows)?;
        self.change_rows(name, |t, cost| cost.set_target_numbers(&numbers[t * n..][..n]))
    }

    /// Sets the weights w of the cost called `name` at all knots, from N + 1 numbers. Returns whether a knot has this
    /// cost.
    ///
    /// # Errors
    /// [`Error::Length`] if there are not N + 1 weights; [`Error::Cost`] if a weight is negative or not finite. Knots
    /// before this knot have their new weights.
    pub fn set_weights(&mut self, name: &str, weights: &[f64]) -> Result<bool, Error> {
        Error::check_length("weights", weights.len(), self.horizon() + 1)?;
        self.change_rows(name, |t, cost| cost.set_weight(weights[t]))
    }

    /// Sets the weights wᵢ of the entries of the cost called `name` at all knots, from N + 1 rows with one weight for
    /// each entry of the residual. The activation must have weights. Returns whether a knot has this cost.
    ///
    /// # Errors
    /// [`Error::Length`] if the numbers are not N + 1 rows; the errors of
    /// [`CostMut::set_entry_weights`], which then name the knot. Knots before this knot have their new weights.
    pub fn set_entry_weights(&mut self, name: &str, weights: &[f64]) -> Result<bool, Error> {
        let rows = self.horizon() + 1;
        let n = weights.len() / rows;
        Error::check_length("weights", weights.len(), n.max(1) * rows)?;
        self.change_rows(name, |t, cost| cost.set_entry_weights(&weights[t * n..][..n]))
    }

    /// Changes targets and gains of the contact called `name` at all knots that have it. Returns whether a knot has it.
    /// Allocates nothing.
    ///
    /// Contacts belong to the dynamics, which the knots of a stance share. Give knots with other targets, such as the
    /// next foothold, a model of their own.
    ///
    /// ```
    /// # use condyle_dynamics::{ContactConstraint, Vec3, robots};
    /// # use condyle_optimal::Problem;
    /// # use condyle_optimal::robot::{Contact, ContactDynamics, FreeDynamics};
    /// # let model = std::sync::Arc::new(robots::quadruped());
    /// # let x0 = [vec![0.0; 6], vec![1.0], vec![0.0; 30]].concat();
    /// # let foot = Contact::new("LF_foot", ContactConstraint::point(model.frame("LF_foot")?));
    /// # let knot = Box::new(ContactDynamics::running(model.clone(), &[foot], 0.02, vec![])?);
    /// # let end = Box::new(FreeDynamics::terminal(model, vec![])?);
    /// # let mut problem = Problem::new(x0, vec![knot], vec![0; 5], end)?;
    /// problem.change_contacts("LF_foot", |contact| {
    ///     contact.target.placement.translation = Vec3::new(0.3, 0.2, 0.0);
    ///     contact.kp_axes = Some([0.0, 0.0, 100.0, 0.0, 0.0, 0.0]); // only the height is corrected
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Contact`] if a target or gain is invalid, or if anything else than target and gains changed. The
    /// contact then stays as it was.
    pub fn change_contacts(
        &mut self,
        name: &str,
        mut change: impl FnMut(&mut ContactConstraint),
    ) -> Result<bool, Error> {
        let mut found = false;
        self.each_action(&mut |action| {
            if let Some(robot) = robot_of(action) {
                found |= robot.change_contact(name, &mut change)?;
            }
            Ok(())
        })?;
        Ok(found)
    }

    /// Turns the friction cone of the limit called `name` at all knots that have it: `rotation` maps the axes of the
    /// surface, whose z axis is the normal, to the axes of the contact's rows. Returns whether a knot has the limit.
    /// Allocates nothing.
    ///
    /// ```
    /// # use condyle_dynamics::{ContactConstraint, Mat3, robots};
    /// # use condyle_optimal::Problem;
    /// # use condyle_optimal::robot::{Contact, ContactDynamics, FreeDynamics, FrictionCone, Limit, Residual};
    /// # let model = std::sync::Arc::new(robots::quadruped());
    /// # let x0 = [vec![0.0; 6], vec![1.0], vec![0.0; 30]].concat();
    /// # let foot = Contact::new("foot", ContactConstraint::point(model.frame("LF_foot")?));
    /// let cone = FrictionCone::new(0.5);
    /// let (lower, upper) = cone.bounds();
    /// let grip = Limit::new("grip", Residual::FrictionCone { contact: "foot".into(), cone }, lower, upper);
    /// # let knot = ContactDynamics::running(model.clone(), &[foot], 0.02, vec![])?;
    /// let knot = Box::new(knot.with_limits(vec![grip])?);
    /// # let end = Box::new(FreeDynamics::terminal(model, vec![])?);
    /// let mut problem = Problem::new(x0, vec![knot], vec![0; 5], end)?;
    /// assert!(problem.turn_cones("grip", Mat3::identity())?);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Limit`] if the matrix is no rotation, or the limit is no friction cone of a force.
    pub fn turn_cones(&mut self, name: &str, rotation: Mat3<f64>) -> Result<bool, Error> {
        if !rotation.is_rotation() {
            let what = "the rotation is none: expected three unit vectors at right angles".to_owned();
            return Err(Error::Limit { name: name.to_owned(), knot: None, what });
        }
        let mut found = false;
        self.each_action(&mut |action| {
            if let Some(robot) = robot_of(action) {
                found |= robot.terms.limits.turn_cone(name, rotation)?;
            }
            Ok(())
        })?;
        Ok(found)
    }

    /// Returns the targets of the cost called `name` at all knots, as [`set_references`](Self::set_references) takes
    /// them, and the number of entries of a row. Rows of knots without this cost are NaN. Returns `None` if no knot has
    /// the cost, or if its residual has no target. Allocates.
    pub fn references(&mut self, name: &str) -> Option<(Vec<f64>, usize)> {
        let size = (0..=self.horizon()).find_map(|t| Some(self.cost_at_mut(t, name)?.target()?.size()))?;
        let mut numbers = vec![f64::NAN; (self.horizon() + 1) * size];
        for (t, row) in numbers.chunks_exact_mut(size).enumerate() {
            let cost = self.cost_at_mut(t, name);
            if let Some(target) = cost.as_ref().and_then(CostMut::target).filter(|target| target.size() == size) {
                target.write(row);
            }
        }
        Some((numbers, size))
    }

    /// Calls `change` for the cost called `name` of each knot that has it, and also for the copies that other threads
    /// use. A knot with shared costs first gets separate costs. Returns whether a knot has the cost.
    fn change_rows(
        &mut self,
        name: &str,
        mut change: impl FnMut(usize, &mut CostMut<'_>) -> Result<(), Error>,
    ) -> Result<bool, Error> {
        let (mut found, horizon) = (false, self.horizon());
        for t in 0..=horizon {
            self.each_action_of(t, &mut |action| {
                let Some(terms) = terms_of(action) else { return Ok(()) };
                let Some(mut cost) = terms.costs_mut(Some(t)).cost_mut(name) else { return Ok(()) };
                found = true;
                if t == horizon {
                    return change(t, &mut cost); // the terminal knot shares its costs with no other knot
                }
                match terms.separate_costs_mut(t).cost_mut(name) {
                    Some(mut cost) => change(t, &mut cost),
                    None => Ok(()),
                }
            })
            .map_err(|error| match error {
                Error::Cost { name, what } => Error::Cost { name, what: format!("{what} (knot {t})") },
                other => other,
            })?;
        }
        Ok(found)
    }
}
