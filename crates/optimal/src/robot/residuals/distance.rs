//! Pairs of geometries whose distances are the entries of a residual.

use condyle_dynamics::Model;
use condyle_dynamics::distances::GeometryPair;
use condyle_dynamics::distances::prepared::PreparedPairs;

/// Prepares pairs of geometries for a robot. Returns an error with the index of an invalid pair and the name of the
/// invalid field.
pub(crate) fn prepare(model: &Model, pairs: &[GeometryPair]) -> Result<PreparedPairs, String> {
    PreparedPairs::new(model, pairs).map_err(|error| format!("its {error}"))
}
