//! Serialization of limits for JSON, which has no infinity: an infinite limit is written as `null`.
//!
//! ```
//! use serde::{Deserialize, Serialize};
//!
//! #[derive(Serialize, Deserialize)]
//! struct Bounds {
//!     #[serde(with = "condyle_spatial::finite::lower")]
//!     least: Vec<f64>,
//! }
//!
//! let text = serde_json::to_string(&Bounds { least: vec![-1.0, f64::NEG_INFINITY] })?;
//! assert_eq!(text, r#"{"least":[-1.0,null]}"#);
//! assert_eq!(serde_json::from_str::<Bounds>(&text)?.least[1], f64::NEG_INFINITY);
//! # Ok::<(), serde_json::Error>(())
//! ```

use alloc::vec::Vec;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

fn vector_or<'de, D: Deserializer<'de>>(from: D, otherwise: f64) -> Result<Vec<f64>, D::Error> {
    let limits = Vec::<Option<f64>>::deserialize(from)?;
    Ok(limits.into_iter().map(|x| x.unwrap_or(otherwise)).collect())
}

/// Serialization of lower limits; `null` stands for −∞.
pub mod lower {
    use super::*;

    /// Writes non-finite values as `null`.
    ///
    /// # Errors
    /// Returns the errors of the serializer.
    pub fn serialize<S: Serializer>(limits: &[f64], to: S) -> Result<S::Ok, S::Error> {
        to.collect_seq(limits.iter().map(|x| x.is_finite().then_some(*x)))
    }

    /// Reads `null` as −∞.
    ///
    /// # Errors
    /// Returns the errors of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        vector_or(from, f64::NEG_INFINITY)
    }
}

/// Serialization of upper limits; `null` stands for ∞.
pub mod upper {
    pub use super::lower::serialize;
    use super::*;

    /// Reads `null` as ∞.
    ///
    /// # Errors
    /// Returns the errors of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<f64>, D::Error> {
        vector_or(from, f64::INFINITY)
    }
}

/// Serialization of a single upper limit; `null` stands for ∞.
pub mod greatest {
    use super::*;

    /// Writes a non-finite value as `null`.
    ///
    /// # Errors
    /// Returns the errors of the serializer.
    pub fn serialize<S: Serializer>(limit: &f64, to: S) -> Result<S::Ok, S::Error> {
        limit.is_finite().then_some(*limit).serialize(to)
    }

    /// Reads `null` as ∞.
    ///
    /// # Errors
    /// Returns the errors of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}
