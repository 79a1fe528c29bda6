//! Checks of states that come from a caller: numbers must be finite, and rotations must have length 1.

use crate::error::Error;
use crate::model::Model;
use alloc::string::{String, ToString};
use condyle_linalg::check;
use condyle_spatial::Scalar;
use core::fmt;
use core::ops::Range;

/// Maximum difference between 1 and the length of a quaternion, or of a pair (cos, sin), in a position. This maximum
/// allows numbers with three digits: if √½ is written as 0.707, the difference is 1.5e-4. Integration in single
/// precision causes a smaller difference.
const UNIT_ROUNDING: f64 = 1e-3;

/// Maximum [`rotation_error`](condyle_spatial::Mat3::rotation_error) of a rotation matrix that is computed from a valid
/// position. If a quaternion (u, w) has the length 1 + e, the error of R = 1 + 2 (w [u] + [u]²) is up to 8 e.
#[doc(hidden)]
pub const ROTATION_ROUNDING: f64 = 10.0 * UNIT_ROUNDING;

/// Invalid part of a position: a number that is not finite, or a rotation that does not have length 1.
#[doc(hidden)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionFault {
    /// Index of the body that the joint moves.
    pub body: usize,
    /// Index in q of the first number of the invalid part.
    pub first: usize,
    /// Index in q after the last number of the invalid part.
    pub end: usize,
    /// Value of the number, or length of the rotation.
    pub value: f64,
}

impl fmt::Display for PositionFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { first, end, value, .. } = *self;
        if end == first + 1 {
            return NotFinite("q", first, value).fmt(f);
        }
        write!(f, "its rotation, q[{first}..{end}], has the length {value}, expected 1")
    }
}

/// Fault of one number: the name of the argument, the index of the number in this argument, and the value.
struct NotFinite(&'static str, usize, f64);

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(argument, index, value) = self;
        write!(f, "{argument}[{index}] is {value}, which is not finite")
    }
}

impl Model {
    /// Checks that a position is valid for the robot. Numbers must be finite, and quaternions and pairs (cos, sin) must
    /// have length 1, up to 1e-3. Algorithms accept any numbers without a check.
    ///
    /// ```
    /// use condyle_model::{neutral, robots};
    /// let quadruped = robots::quadruped();
    /// let mut q = neutral(&quadruped);
    /// quadruped.check_position(&q)?;
    /// q[6] = 0.0;
    /// let error = quadruped.check_position(&q).unwrap_err().to_string();
    /// assert_eq!(error, "joint `root_joint`: its rotation, q[3..7], has the length 0, expected 1");
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Position`] if the position is invalid.
    ///
    /// # Panics
    /// If `q` does not have nq numbers.
    #[track_caller]
    pub fn check_position(&self, q: &[f64]) -> Result<(), Error> {
        check("q", q.len(), self.nq());
        match self.position_fault(q) {
            Some(fault) => Err(Error::Position { joint: self.joint_of(fault.body), what: fault.to_string() }),
            None => Ok(()),
        }
    }

    /// Checks that a state is valid for the robot. The position must be valid (see
    /// [`check_position`](Self::check_position)), and velocities must be finite.
    ///
    /// ```
    /// use condyle_model::{neutral, robots};
    /// let quadruped = robots::quadruped();
    /// let (q, mut v) = (neutral(&quadruped), [0.0; 18]);
    /// quadruped.check_state(&q, &v)?;
    /// v[6] = f64::INFINITY;
    /// let error = quadruped.check_state(&q, &v).unwrap_err().to_string();
    /// assert_eq!(error, "joint `LF_HAA`: v[6] is inf, which is not finite");
    /// # Ok::<(), condyle_model::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns [`Error::Position`] or [`Error::Velocity`] if the state is invalid.
    ///
    /// # Panics
    /// If `q` does not have nq numbers or `v` does not have nv numbers.
    #[track_caller]
    pub fn check_state(&self, q: &[f64], v: &[f64]) -> Result<(), Error> {
        check("v", v.len(), self.nv());
        self.check_position(q)?;
        let Some(k) = v.iter().position(|x| !x.is_finite()) else { return Ok(()) };
        let moves = |&i: &usize| {
            let (body, nv) = (&self.bodies[i], self.bodies[i].joint.nv());
            body.mimic.is_none() && (body.idx_v..body.idx_v + nv).contains(&k)
        };
        let joint = (1..self.bodies.len()).find(moves).map_or_else(String::new, |i| self.joint_of(i));
        Err(Error::Velocity { joint, what: NotFinite("v", k, v[k]).to_string() })
    }

    /// Returns the first invalid part of a position, without allocating. `q` must have nq numbers.
    #[doc(hidden)]
    pub fn position_fault(&self, q: &[f64]) -> Option<PositionFault> {
        self.position_parts().find_map(|(body, mut range, unit)| {
            let infinite = range.find(|&k| !q[k].is_finite());
            let number = infinite.map(|k| PositionFault { body, first: k, end: k + 1, value: q[k] });
            number.or_else(|| unit_fault(body, unit?, q))
        })
    }

    /// Returns the first quaternion or pair (cos, sin) of a position that does not have length 1. `q` must have nq
    /// numbers.
    #[doc(hidden)]
    pub fn rotation_fault(&self, q: &[f64]) -> Option<PositionFault> {
        self.position_parts().find_map(|(body, _, unit)| unit_fault(body, unit?, q))
    }

    /// Checks that [`normalize`](crate::normalize) can scale all rotations of a position to length 1. The square of
    /// each length must be finite, not 0, and not subnormal.
    ///
    /// # Errors
    /// Returns [`Error::Position`] if a rotation cannot be scaled.
    #[doc(hidden)]
    pub fn check_normalizable(&self, q: &[f64]) -> Result<(), Error> {
        for (body, _, unit) in self.position_parts() {
            let Some(unit) = unit else { continue };
            let (first, end) = (unit.start, unit.end);
            let squares = q[unit].iter().map(|x| x * x).sum::<f64>();
            if !squares.is_normal() {
                let length = Scalar::sqrt(squares);
                let what = format!("its rotation, q[{first}..{end}], has the length {length} and cannot be normalized");
                return Err(Error::Position { joint: self.joint_of(body), what });
            }
        }
        Ok(())
    }

    /// Returns the name of the joint and the range in q of each rotation that must have length 1.
    #[doc(hidden)]
    pub fn rotations(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        self.position_parts().filter_map(|(body, _, unit)| Some((self.bodies[body].joint_name.as_str(), unit?)))
    }

    /// Returns the name of the joint that moves a body.
    fn joint_of(&self, body: usize) -> String {
        self.bodies[body].joint_name.clone()
    }

    /// Returns the body and the range in q of each joint that has its own coordinates. Also returns the part of this
    /// range that must have length 1.
    fn position_parts(&self) -> impl Iterator<Item = (usize, Range<usize>, Option<Range<usize>>)> {
        let own = self.bodies.iter().enumerate().skip(1).filter(|(_, body)| body.mimic.is_none());
        own.map(|(i, body)| {
            let unit = body.joint.unit_part().map(|unit| body.idx_q + unit.start..body.idx_q + unit.end);
            (i, body.idx_q..body.idx_q + body.joint.nq(), unit)
        })
    }
}

/// Returns the fault of a rotation in a range of q; `None` if the rotation has length 1.
#[doc(hidden)]
pub fn unit_fault(body: usize, unit: Range<usize>, q: &[f64]) -> Option<PositionFault> {
    let value = Scalar::sqrt(q[unit.clone()].iter().map(|x| x * x).sum::<f64>());
    // A NaN is also a fault.
    let valid = (value - 1.0).abs() <= UNIT_ROUNDING;
    (!valid).then_some(PositionFault { body, first: unit.start, end: unit.end, value })
}
