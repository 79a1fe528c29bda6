//! Obstacles that move: placements of geometries in the distances of a whole horizon, changed in place.

use super::costs::Costs;
use super::dynamics::robot::robot_of;
use super::horizon::HorizonTerms;
use super::limits::LimitSet;
use super::residuals::layout::Plan;
use super::residuals::residual::Residual;
use super::residuals::terms::{Term, Terms};
use crate::{Error, Problem};
use condyle_dynamics::Se3;

impl Residual {
    /// Sets the placement of the geometry called `name` in all pairs, and in the plan of this residual. Returns whether
    /// a pair has the geometry. Allocates nothing.
    fn place(&mut self, plan: &mut Plan, name: &str, placement: Se3<f64>) -> bool {
        let Self::Distances { pairs, .. } = self else { return false };
        let mut found = false;
        for geometry in pairs.iter_mut().flat_map(|pair| [&mut pair.first, &mut pair.second]) {
            if geometry.name == name {
                (geometry.placement, found) = (placement, true);
            }
        }
        if found {
            plan.pairs.place(name, placement);
        }
        found
    }

    /// Returns whether a pair has the geometry called `name`.
    fn has_geometry(&self, name: &str) -> bool {
        let Self::Distances { pairs, .. } = self else { return false };
        pairs.iter().any(|pair| pair.first.name == name || pair.second.name == name)
    }
}

/// Sets the placement of a geometry in all terms. Returns whether a term has it.
fn place<T: Term>(terms: &mut Terms<T>, name: &str, placement: Se3<f64>) -> bool {
    let place = |(term, plan): (&mut T, &mut Plan)| term.residual_mut().place(plan, name, placement);
    terms.with_plans_mut().fold(false, |found, both| place(both) | found)
}

impl Costs {
    /// Returns whether a pair of geometries has the geometry called `name`.
    fn has_geometry(&self, name: &str) -> bool {
        self.terms().iter().any(|cost| cost.residual.has_geometry(name))
    }
}

impl LimitSet {
    /// Returns whether a pair of geometries has the geometry called `name`.
    fn has_geometry(&self, name: &str) -> bool {
        self.terms.all().iter().any(|limit| limit.residual.has_geometry(name))
    }
}

impl HorizonTerms {
    /// Sets the placement of the geometry called `name` at knot t. If knots share the costs or limits of knot t, it
    /// first gets separate ones, unless `is_alone`. Returns whether the knot has the geometry.
    fn place_at(&mut self, t: usize, is_alone: bool, name: &str, placement: Se3<f64>) -> bool {
        let in_costs = self.costs_mut(Some(t)).has_geometry(name);
        if in_costs {
            let costs = if is_alone { self.costs_mut(Some(t)) } else { self.separate_costs_mut(t) };
            place(costs.all_mut(), name, placement);
        }
        let sets = self.limits.chosen_sets_mut();
        let in_limits = sets.at_mut(Some(t)).has_geometry(name);
        if in_limits {
            let set = if is_alone { sets.at_mut(Some(t)) } else { sets.separate(t, LimitSet::clone_from) };
            place(&mut set.terms, name, placement);
        }
        in_costs | in_limits
    }
}

/// Placements of geometries in the distances of costs and limits ([`Residual::Distances`]).
impl Problem {
    /// Sets the placements of the geometry called `name` at all knots, for example of an obstacle that moves while the
    /// plan is executed. All pairs with this geometry follow, in costs and in limits. Returns whether a knot has the
    /// geometry.
    ///
    /// placements: the poses of the shape in the world, or in the frame of the geometry, at the knots 0 … N. A knot
    /// whose costs or limits are shared with other knots first gets separate ones with the same terms; they move with
    /// the knot when the horizon is [shifted](Problem::shift). A call allocates only for such knots.
    ///
    /// ```
    /// use condyle_dynamics::{Mat3, Se3, Vec3, robots};
    /// use condyle_optimal::Problem;
    /// use condyle_optimal::robot::{FreeDynamics, Geometry, GeometryPair, Limit, Residual, Shape};
    /// use std::sync::Arc;
    /// let arm = Arc::new(robots::arm7());
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let ball = Geometry::in_world(Shape::sphere([0.0; 3], 0.1)).named("ball");
    /// let pairs = vec![GeometryPair::new(tool, ball)];
    /// let clear = Limit::new("clear", Residual::distances(pairs), vec![0.0], vec![f64::INFINITY]);
    /// let knot = FreeDynamics::running(arm.clone(), 0.02, vec![])?.with_limits(vec![clear])?;
    /// let end = FreeDynamics::terminal(arm, vec![])?;
    /// let mut problem = Problem::new(vec![0.0; 14], vec![Box::new(knot)], vec![0; 10], Box::new(end))?;
    /// // the ball moves along y with 0.5 m/s
    /// let at = |t: usize| Se3::new(Mat3::identity(), Vec3::new(0.5, 0.5 * 0.02 * t as f64, 0.4));
    /// assert!(problem.set_placements("ball", &(0..=10).map(at).collect::<Vec<_>>())?);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Length`] if there are not N + 1 placements; [`Error::Placement`] for a placement that is not a rotation
    /// with a finite translation. Then nothing changes.
    pub fn set_placements(&mut self, name: &str, placements: &[Se3<f64>]) -> Result<bool, Error> {
        let horizon = self.horizon();
        Error::check_length("placements", placements.len(), horizon + 1)?;
        for (knot, Se3 { rotation, translation }) in placements.iter().enumerate() {
            let is_finite = translation.to_array().iter().all(|x| x.is_finite());
            if !is_finite || !rotation.is_rotation() {
                return Err(Error::Placement { name: name.to_owned(), knot });
            }
        }
        let mut found = false;
        for (t, &placement) in placements.iter().enumerate() {
            self.each_action_of(t, &mut |action| {
                if let Some(robot) = robot_of(action) {
                    found |= robot.terms.place_at(t, t == horizon, name, placement);
                }
                Ok::<(), Error>(())
            })?;
        }
        Ok(found)
    }
}
