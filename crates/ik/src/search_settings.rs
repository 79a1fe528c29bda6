//! Settings of a global search.

use crate::error::{Error, length};
use crate::settings::positive;
use condyle_dynamics::Model;
use condyle_dynamics::distances::GeometryPair;

/// Order by which a search chooses among the postures that reach a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Rank {
    /// The first that was found.
    First,
    /// The nearest to the given posture: least ‖q ⊖ posture‖.
    Nearest,
    /// The largest manipulability √det(J Jᵀ) of the first frame.
    Manipulability,
}

/// Settings of [`GlobalIk`](crate::GlobalIk).
///
/// ```
/// use condyle_ik::{Rank, SearchSettings};
/// // The nearest of eight postures.
/// let near = SearchSettings { rank: Rank::Nearest, solutions: 8, ..SearchSettings::default() };
/// # let _ = near;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SearchSettings {
    /// Maximum position error (m) and rotation error (rad) of a posture that reaches its target; above 0.
    pub tolerance: [f64; 2],
    /// Weight of squared rotation errors (rad²), relative to squared position errors (m²); at least 0. With 0, only the
    /// positions of the targets count.
    pub orientation_weight: f64,
    /// Maximum number of starts for a target; at least 1.
    pub starts: usize,
    /// Maximum number of iterations of a start; at least 1. A start that then pushes pairs apart may make as many more.
    pub iterations: usize,
    /// Number of postures from which `rank` chooses; at least 1. A search ends when this many starts reached the
    /// target.
    pub solutions: usize,
    /// Order by which a search chooses among these postures.
    pub rank: Rank,
    /// Number of random configurations in the table of starts; may be 0.
    pub table: usize,
    /// Seed of the random configurations.
    pub seed: u64,
    /// Number of threads that share many targets; at least 1.
    pub threads: usize,
    /// Minimum position, nq numbers; `None` takes the limits of the model.
    pub lower: Option<Vec<f64>>,
    /// Maximum position, nq numbers; `None` takes the limits of the model.
    pub upper: Option<Vec<f64>>,
    /// Pairs of geometries that must be apart; empty for none.
    pub pairs: Vec<GeometryPair>,
    /// Minimum distance of each pair (m).
    pub minimum_distance: f64,
}

impl Default for SearchSettings {
    fn default() -> Self {
        Self {
            tolerance: [1e-4, 1e-3],
            orientation_weight: 0.1,
            starts: 100,
            iterations: 40,
            solutions: 1,
            rank: Rank::First,
            table: 512,
            seed: 0,
            threads: 1,
            lower: None,
            upper: None,
            pairs: Vec::new(),
            minimum_distance: 0.0,
        }
    }
}

impl SearchSettings {
    pub(crate) fn check(&self, model: &Model) -> Result<(), Error> {
        positive("tolerance", self.tolerance[0])?;
        positive("tolerance", self.tolerance[1])?;
        if !(self.orientation_weight >= 0.0 && self.orientation_weight.is_finite()) {
            let value = self.orientation_weight;
            return Err(Error::Setting { name: "orientation_weight", value, allowed: "at least 0" });
        }
        for (name, value) in [
            ("starts", self.starts),
            ("iterations", self.iterations),
            ("solutions", self.solutions),
            ("threads", self.threads),
        ] {
            if value == 0 {
                return Err(Error::Setting { name, value: 0.0, allowed: "at least 1" });
            }
        }
        if !self.minimum_distance.is_finite() {
            let value = self.minimum_distance;
            return Err(Error::Setting { name: "minimum_distance", value, allowed: "finite" });
        }
        for (name, list) in [("lower", &self.lower), ("upper", &self.upper)] {
            let Some(list) = list else { continue };
            length(name, list.len(), model.nq())?;
            if let Some(&value) = list.iter().find(|x| x.is_nan()) {
                return Err(Error::Setting { name, value, allowed: "a number" });
            }
        }
        Ok(())
    }
}
