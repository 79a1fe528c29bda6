//! Arrays of a record, stored with all their bits.

use core::ops::Deref;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Array of numbers, which is stored as text: the bytes of its numbers (IEEE 754, least significant byte first) in
/// base64. Two arrays are equal if their bits are equal.
#[derive(Debug, Clone, Default)]
pub struct Numbers(Vec<f64>);

impl From<Vec<f64>> for Numbers {
    fn from(numbers: Vec<f64>) -> Self {
        Self(numbers)
    }
}

impl Deref for Numbers {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl PartialEq for Numbers {
    fn eq(&self, other: &Self) -> bool {
        self.len() == other.len() && self.iter().zip(&**other).all(|(a, b)| a.to_bits() == b.to_bits())
    }
}

/// Digits of base64.
const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = self.iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
        for three in bytes.chunks(3) {
            let bits = three.iter().fold(0, |bits, byte| bits << 8 | usize::from(*byte)) << (8 * (3 - three.len()));
            for k in 0..4 {
                let digit = DIGITS[bits >> (18 - 6 * k) & 63];
                text.push(if k <= three.len() { char::from(digit) } else { '=' });
            }
        }
        to.serialize_str(&text)
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let digits = text.trim_end_matches('=').as_bytes();
        let mut bytes = Vec::with_capacity(digits.len() * 3 / 4);
        for four in digits.chunks(4) {
            let mut bits = 0;
            for digit in four {
                let value = DIGITS.iter().position(|known| known == digit);
                bits = bits << 6 | value.ok_or_else(|| D::Error::custom("an array is not base64"))?;
            }
            let three = (bits << (6 * (4 - four.len()))).to_be_bytes();
            bytes.extend_from_slice(&three[three.len() - 3..][..four.len() * 3 / 4]);
        }
        let (numbers, rest) = bytes.as_chunks();
        if !rest.is_empty() {
            return Err(D::Error::custom(format!("an array has {} bytes, expected 8 for each number", bytes.len())));
        }
        Ok(Self(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect()))
    }
}
