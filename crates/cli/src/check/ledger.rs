//! Results of a check: for each identity, the case with the largest error relative to its bound.

use serde::Serialize;

/// Result for an identity: the largest error, relative to its bound, in all states.
#[derive(Serialize)]
pub(crate) struct Row {
    /// Name of the check.
    pub name: &'static str,
    /// Equation that is checked.
    pub equation: &'static str,
    /// Measured relative error, as defined in the module that checks the equation; `null` if it is not a number.
    pub error: f64,
    /// Allowed error in the state in which `error` was measured.
    pub bound: f64,
    /// Reason for the size of the bound.
    pub because: &'static str,
    /// Number of checked cases.
    pub cases: usize,
    pub pass: bool,
    /// Additional remarks on the result; may be empty.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

impl Row {
    pub(super) fn new(name: &'static str, equation: &'static str, because: &'static str) -> Self {
        Self { name, equation, because, error: 0.0, bound: 0.0, cases: 0, pass: true, note: String::new() }
    }

    /// Counts a case. Stores the case's error and bound if the quotient error / bound is the largest so far.
    pub(super) fn see(&mut self, error: f64, bound: f64) {
        let (now, before) = (error / bound, if self.cases == 0 { -1.0 } else { self.error / self.bound });
        // Keep an error that is NaN.
        if !before.is_nan() && (now > before || now.is_nan()) {
            (self.error, self.bound) = (error, bound);
        }
        self.cases += 1;
        self.pass &= error <= bound;
    }

    /// Compares the numbers x in `found` with the numbers y in `expected`. The error is max |x − y|, divided by the
    /// larger of 1 + max |y| and 1 + `scale`.
    pub(super) fn compare(&mut self, found: &[f64], expected: &[f64], scale: f64, bound: f64) {
        let largest = expected.iter().fold(1.0 + scale, |most: f64, y| most.max(1.0 + y.abs()));
        // f64::max would ignore NaN.
        let error =
            found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, |a: f64, b| if a > b { a } else { b });
        let error = if found.iter().chain(expected).all(|x| x.is_finite()) { error / largest } else { f64::NAN };
        self.see(error, bound);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_case_is_kept() {
        let mut row = Row::new("", "", "");
        row.compare(&[1.0, 2.0], &[1.0, 2.0 + 3e-12], 0.0, 1e-10);
        assert!(row.pass && row.error > 0.9e-12 && row.error < 1.1e-12);
        row.see(1e-3, 1e-2); // a larger share of its bound
        assert!(row.pass && row.error == 1e-3);
        row.see(2e-10, 1e-10);
        assert!(!row.pass && row.error == 2e-10 && row.cases == 3);
    }

    #[test]
    fn nan_fails_and_stays() {
        let mut row = Row::new("", "", "");
        row.compare(&[f64::NAN, 1.0], &[0.0, 1.0], 0.0, 1e-10);
        row.compare(&[1.0], &[1.0], 0.0, 1e-10);
        assert!(!row.pass && row.error.is_nan());
        let mut row = Row::new("", "", "");
        row.compare(&[1.0], &[f64::INFINITY], 0.0, 1e-10);
        assert!(!row.pass);
    }
}
