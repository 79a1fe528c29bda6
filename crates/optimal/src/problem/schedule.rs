//! Schedule of the models of a horizon in time, for example of a robot's contacts.

use crate::error::Error;

/// Smallest duration of the first knot of a horizon, relative to the spacing. A shorter rest of a knot is added to the
/// next knot, if this knot has the same model. With shorter knots, a closed loop is less smooth: a trot at 200 Hz had
/// 0.0162 rad/s of ripple of the pitch rate instead of 0.0134, and torques changed by 0.38 N m per ms instead of 0.26.
const SHORTEST: f64 = 0.5;
/// Smallest duration of the rest of a knot before a switch, relative to the spacing. A shorter rest is left out.
const LEAST: f64 = 0.01;
/// Rounding errors of times, relative to the spacing.
const ROUNDING: f64 = 1e-6;

/// Models of a horizon in time: from each switching time on, knots have another model. A trot for example switches
/// between models that differ in their contacts. The schedule gives the models and durations of the knots of a horizon
/// that begins at any time.
///
/// Knots begin at times that do not depend on the beginning of the horizon, and no knot contains a switching time. The
/// time between two switches is divided into equal knots, whose duration is as near to the spacing as possible. Only
/// the first knot of a horizon differs: it begins now. It takes the rest of the present knot, together with the next
/// knot if the rest is at most half the spacing and no switch follows. So later knots remain the same when the horizon
/// moves, by a knot or by any time between. The number of knots is constant, and the end of the horizon moves. A knot
/// is at most 1.75 times as long as the spacing.
///
/// ```
/// use condyle_optimal::Schedule;
/// let mut schedule = Schedule::new(0.02, 0)?; // knots of 20 ms
/// schedule.switch(0.05, 1)?;
/// schedule.switch(0.10, 0)?;
/// let (mut models, mut durations) = ([0; 5], [0.0; 5]);
/// schedule.write_knots(0.015, &mut models, &mut durations);
/// assert_eq!(models, [0, 0, 1, 1, 0]);
/// let expected = [0.015, 0.02, 0.025, 0.025, 0.02];
/// assert!(durations.iter().zip(expected).all(|(dt, expected)| (dt - expected).abs() < 1e-12));
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Schedule {
    spacing: f64,
    /// Model before the first switch.
    first: usize,
    /// Time at which the phase before the first switch began; `None` if it has no beginning.
    begin: Option<f64>,
    /// Switching times (s), which rise, each with the model from this time on.
    switches: Vec<(f64, usize)>,
}

impl Schedule {
    /// Creates a schedule of one model, with knots of `spacing` seconds.
    ///
    /// # Errors
    /// [`Error::TimeStep`] if the spacing is not above 0.
    pub fn new(spacing: f64, model: usize) -> Result<Self, Error> {
        match spacing > 0.0 && spacing.is_finite() {
            true => Ok(Self { spacing, first: model, begin: None, switches: Vec::new() }),
            false => Err(Error::TimeStep { dt: spacing }),
        }
    }

    /// Adds a switch: from the time t (s) on, knots have the model `model`. Switches at or after t are removed. So a
    /// contact that occurs earlier than planned is a switch now, followed by the new switches. Allocates only if there
    /// were never as many switches.
    ///
    /// # Errors
    /// [`Error::NotFinite`] if t is not finite.
    pub fn switch(&mut self, t: f64, model: usize) -> Result<(), Error> {
        Error::check_finite("t", &[t])?;
        self.switches.truncate(self.switches.partition_point(|(time, _)| *time < t));
        self.switches.push((t, model));
        Ok(())
    }

    /// Forgets the switches before the present phase, which contains the time t (s). Allocates nothing.
    pub fn forget(&mut self, t: f64) {
        let passed = self.switches.partition_point(|(time, _)| *time <= t);
        if passed > 0 {
            (self.begin, self.first) = (Some(self.switches[passed - 1].0), self.switches[passed - 1].1);
            self.switches.drain(..passed);
        }
    }

    /// Returns the spacing of the knots (s).
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Returns the model at the time t (s).
    pub fn model(&self, t: f64) -> usize {
        self.phase(t).model
    }

    /// Returns the switching times (s) that are not forgotten, each with the model from this time on.
    pub fn switches(&self) -> &[(f64, usize)] {
        &self.switches
    }

    /// Writes the models and durations (s) of the knots of a horizon that begins at the time t (s), for
    /// [`Fddp::retime`](crate::Fddp::retime) and [`Problem::set_knots`](crate::Problem::set_knots). Both slices have
    /// an entry for each knot. Allocates nothing.
    ///
    /// # Panics
    /// If the slices differ in length, or t is not finite.
    #[track_caller]
    pub fn write_knots(&self, t: f64, models: &mut [usize], durations: &mut [f64]) {
        assert!(t.is_finite(), "`t` is {t}, expected a finite time");
        crate::error::assert_length("durations", durations.len(), models.len());
        let mut begin = t;
        for (model, duration) in models.iter_mut().zip(durations) {
            let (mut phase, mut end) = self.knot(begin);
            let (rest, (next, after)) = ((end - begin) / self.spacing, self.knot(end));
            let is_same = next.begin == phase.begin;
            if rest < LEAST || is_same && begin == t && rest < SHORTEST + ROUNDING {
                (phase, end) = (next, after);
            }
            (*model, *duration) = (phase.model, end - begin);
            begin = end;
        }
    }

    /// Returns the phase of the time t, and the end of the knot that contains t.
    fn knot(&self, t: f64) -> (Phase, f64) {
        let phase = self.phase(t);
        let end = match phase {
            Phase { begin: Some(begin), end: Some(end), .. } => {
                let count = ((end - begin) / self.spacing - ROUNDING).round().max(1.0);
                let spacing = (end - begin) / count;
                let knot = ((t - begin) / spacing + ROUNDING).floor() + 1.0;
                if knot >= count { end } else { begin + knot * spacing }
            }
            Phase { begin: None, end: Some(end), .. } => {
                let left = ((end - t) / self.spacing - ROUNDING).ceil() - 1.0;
                end - left.max(0.0) * self.spacing
            }
            Phase { begin, end: None, .. } => {
                let begin = begin.unwrap_or(0.0);
                begin + (((t - begin) / self.spacing + ROUNDING).floor() + 1.0) * self.spacing
            }
        };
        (phase, end)
    }

    /// Returns the phase that contains the time t. A switch at t has already occurred.
    fn phase(&self, t: f64) -> Phase {
        let passed = self.switches.partition_point(|(time, _)| *time <= t + ROUNDING * self.spacing);
        let end = self.switches.get(passed).map(|(time, _)| *time);
        match passed.checked_sub(1).map(|last| self.switches[last]) {
            Some((begin, model)) => Phase { begin: Some(begin), end, model },
            None => Phase { begin: self.begin, end, model: self.first },
        }
    }
}

/// Time between two switches.
#[derive(Debug, Clone, Copy)]
struct Phase {
    /// Beginning and end; `None` without a beginning or an end.
    begin: Option<f64>,
    end: Option<f64>,
    model: usize,
}
