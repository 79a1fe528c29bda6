//! Filter of a line search (Wächter and Biegler, 2006): a trial is acceptable if it improves the infeasibility θ or the
//! barrier function φ, compared with the iterate and with all entries of the filter.

/// Required relative decrease of θ, and required decrease of φ relative to θ.
const MARGIN: f64 = 1e-5;
/// Exponents of the switching condition, and factor of Armijo's condition.
const EXPONENT_OF_THETA: f64 = 1.1;
const EXPONENT_OF_SLOPE: f64 = 2.3;
const ARMIJO: f64 = 1e-4;
/// Rounding error of φ, relative to its absolute value.
const ROUNDING: f64 = 1e-13;
/// Maximum number of entries; a new entry then replaces the oldest one.
const MOST: usize = 256;

/// Infeasibility and barrier function of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measure {
    /// Infeasibility θ: the sum of all gaps, of |g − s| and of |h|.
    pub(super) theta: f64,
    /// Cost of the trajectory and of soft limits.
    pub(super) cost: f64,
    /// Sum −Σ log of all distances of slack variables from their bounds.
    pub(super) logarithms: f64,
}

impl Measure {
    /// Returns the barrier function φ.
    pub(super) fn phi(&self, mu: f64) -> f64 {
        self.cost + mu * self.logarithms
    }
}

/// Measures that no trial may be dominated by.
#[derive(Debug, Clone, Default)]
pub(super) struct Filter {
    entries: Vec<Measure>,
    /// Index of the entry that the next one replaces, once the filter is full.
    oldest: usize,
    /// Price of θ: a step that raises θ must lower φ by this multiple of the rise.
    penalty: f64,
    /// Largest acceptable θ.
    limit: f64,
    /// Infeasibility θ below which φ must decrease.
    small: f64,
}

impl Filter {
    /// Begins a solve at a trajectory with the infeasibility θ.
    pub(super) fn start(&mut self, theta: f64) {
        self.clear();
        self.entries.reserve(MOST);
        self.penalty = 0.0;
        (self.limit, self.small) = (1e4 * theta.max(1.0), 1e-4 * theta.max(1.0));
    }

    /// Sets the price of θ.
    pub(super) fn set_penalty(&mut self, penalty: f64) {
        self.penalty = penalty;
    }

    /// Removes all entries, because μ has changed.
    pub(super) fn clear(&mut self) {
        self.entries.clear();
        self.oldest = 0;
    }

    /// Returns whether a step of length α from `now` to `trial` is acceptable. `slope` is the derivative of φ along the
    /// step. Adds `now` to the filter, unless the step is accepted for its decrease of φ.
    pub(super) fn accepts(&mut self, now: Measure, trial: Measure, alpha: f64, slope: f64, mu: f64) -> bool {
        let (phi, trial_phi) = (now.phi(mu), trial.phi(mu));
        let rounding = ROUNDING * phi.abs();
        let dominates = |entry: &Measure| {
            trial.theta >= (1.0 - MARGIN) * entry.theta && trial_phi >= entry.phi(mu) - MARGIN * entry.theta + rounding
        };
        let finite = trial.theta.is_finite() && trial_phi.is_finite();
        if !finite || trial.theta > self.limit || self.entries.iter().any(dominates) {
            return false;
        }
        let switches = slope < 0.0 && alpha * (-slope).powf(EXPONENT_OF_SLOPE) > now.theta.powf(EXPONENT_OF_THETA);
        if switches && now.theta <= self.small {
            return trial_phi <= phi + ARMIJO * alpha * slope + rounding;
        }
        let costs_no_more = trial_phi + self.penalty * (trial.theta - now.theta).max(0.0) <= phi;
        let improves = !dominates(&now) && (trial.theta <= now.theta || costs_no_more);
        if improves {
            self.add(now);
        }
        improves
    }

    fn add(&mut self, entry: Measure) {
        if self.entries.len() < MOST {
            self.entries.push(entry);
        } else {
            self.entries[self.oldest] = entry;
            self.oldest = (self.oldest + 1) % MOST;
        }
    }
}
