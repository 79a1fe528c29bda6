//! Costs of values outside the bounds of a limit that may give way.

/// Weights with which a limit gives way. Each value outside its bounds costs
///
/// ```text
/// linear · e + ½ quadratic · e²,     e ≥ 0: distance from the bounds
/// ```
///
/// Either weight may be 0, but not both. With `linear` alone the limit is exact: if the weight exceeds the multiplier
/// that the limit has as a hard limit, the limit holds. Otherwise the limit gives way, and its multiplier is the
/// weight. With `quadratic` alone a limit that acts gives way a little, always.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Soft {
    /// Cost per unit of distance.
    #[cfg_attr(feature = "serde", serde(default))]
    pub linear: f64,
    /// Twice the cost per squared unit of distance.
    #[cfg_attr(feature = "serde", serde(default))]
    pub quadratic: f64,
}

impl Soft {
    /// Returns the cost of a distance e ≥ 0.
    #[inline(always)]
    pub fn cost(&self, e: f64) -> f64 {
        (self.linear + 0.5 * self.quadratic * e) * e
    }

    /// Returns the derivative of [`cost`](Self::cost).
    #[inline(always)]
    pub(crate) fn slope(&self, e: f64) -> f64 {
        self.linear + self.quadratic * e
    }

    /// Returns whether both weights are finite and at least 0, and one of them is not 0.
    pub(crate) fn is_valid(&self) -> bool {
        let weights = [self.linear, self.quadratic];
        weights.iter().all(|weight| *weight >= 0.0 && weight.is_finite()) && weights != [0.0; 2]
    }
}
