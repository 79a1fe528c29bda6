//! Pairs of geometries whose distances are the entries of a residual.

use condyle_dynamics::Model;
use condyle_dynamics::distances::GeometryPair;
use condyle_dynamics::distances::prepared::PreparedPair;

/// Prepares pairs of geometries for a robot. Returns an error with the index of an invalid pair and the name of the
/// invalid field.
pub(crate) fn prepare(model: &Model, pairs: &[GeometryPair]) -> Result<Vec<PreparedPair>, String> {
    let plan = |(k, pair)| PreparedPair::new(model, pair, k).map_err(|error| format!("its {error}"));
    pairs.iter().enumerate().map(plan).collect()
}
