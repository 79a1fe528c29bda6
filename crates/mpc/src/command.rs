//! Commanded motion of the trunk.

use crate::Error;

/// Commanded velocity of the trunk, along its heading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Velocity forwards (m/s).
    pub vx: f64,
    /// Velocity to the left (m/s).
    pub vy: f64,
    /// Rate of turning to the left (rad/s).
    pub wz: f64,
}

impl Command {
    /// Returns the three numbers of the command.
    pub fn to_array(self) -> [f64; 3] {
        [self.vx, self.vy, self.wz]
    }

    /// Checks that all numbers are finite.
    pub(crate) fn check(self) -> Result<(), Error> {
        Error::check_array("command", &self.to_array(), 3)
    }

    /// Returns the command that has moved towards `goal` for `seconds`, with at most the given accelerations (m/s²,
    /// m/s², rad/s²).
    pub(crate) fn towards(self, goal: Self, accelerations: [f64; 3], seconds: f64) -> Self {
        let (from, to) = (self.to_array(), goal.to_array());
        let step = |k: usize| {
            let most = accelerations[k] * seconds.max(0.0);
            from[k] + (to[k] - from[k]).clamp(-most, most)
        };
        Self { vx: step(0), vy: step(1), wz: step(2) }
    }
}
