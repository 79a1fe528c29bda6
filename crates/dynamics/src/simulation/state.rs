//! State of a simulation, which can be stored and restored.

use super::Simulation;
use alloc::vec::Vec;
use condyle_model::Error;
use condyle_spatial::{Constant, Scalar};

/// State of a [`Simulation`]. Together with the robot, the settings and the ground, it determines the next steps.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct State<S = f64> {
    /// Time since the state was set (s).
    pub time: f64,
    /// Position, nq numbers.
    pub q: Vec<S>,
    /// Velocity, nv numbers.
    pub v: Vec<S>,
    /// Impulses of the ground in the last step, 3 numbers for each point of the ground (N s). The contact solver uses
    /// these impulses as its initial guess in the next step.
    pub impulses: Vec<f64>,
}

impl<S: Scalar, R: Constant<S>> Simulation<S, R> {
    /// Returns a copy of the state. A simulation that continues from the copy, after [`restore`](Self::restore),
    /// computes bit-identical results.
    ///
    /// ```
    /// use condyle_dynamics::{robots, simulation::{Settings, Simulation}};
    /// let mut simulation = Simulation::new(robots::arm7(), Settings::default());
    /// assert!(simulation.step(&[0.1; 7], &[]).is_done());
    /// let state = simulation.state();
    /// let mut twin = Simulation::<f64>::new(robots::arm7(), Settings::default());
    /// twin.restore(&state)?;
    /// assert_eq!((twin.q(), twin.time()), (simulation.q(), simulation.time()));
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    pub fn state(&self) -> State<S> {
        let impulses = self.ground.as_ref().map_or_else(Vec::new, |ground| ground.impulses.clone());
        State { time: self.time, q: self.q.clone(), v: self.v.clone(), impulses }
    }

    /// Sets the simulation to a stored state, which must come from a simulation of the same robot on the same ground.
    ///
    /// # Errors
    /// Returns [`Error::Length`] if a list is too short or too long; [`Error::Ground`] if an impulse is not finite;
    /// other errors as for [`set_state`](Self::set_state).
    pub fn restore(&mut self, state: &State<S>) -> Result<(), Error> {
        let impulses = self.ground.as_ref().map_or(0, |ground| ground.impulses.len());
        for (name, expected, found) in [
            ("state.q", self.model.nq(), state.q.len()),
            ("state.v", self.model.nv(), state.v.len()),
            ("state.impulses", impulses, state.impulses.len()),
        ] {
            if expected != found {
                return Err(Error::Length { name, expected, found });
            }
        }
        if let Some(k) = state.impulses.iter().position(|impulse| !impulse.is_finite()) {
            let what = format!("impulses[{k}] is {}, which is not finite", state.impulses[k]);
            return Err(Error::Ground { what });
        }
        self.set_state(&state.q, &state.v)?;
        self.time = state.time;
        if let Some(ground) = &mut self.ground {
            ground.impulses.copy_from_slice(&state.impulses);
        }
        Ok(())
    }
}
