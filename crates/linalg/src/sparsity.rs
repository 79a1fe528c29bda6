//! Entries of matrices with the zeros of a tree.

use alloc::vec::Vec;

/// The rows in which a column of such a matrix may differ from zero.
#[derive(Clone, Debug)]
pub struct NonzeroRows {
    /// The rows, in the order in which products go through them.
    pub rows: Vec<usize>,
    /// The number of columns one after the other, from this one on, that have the same rows.
    pub same_pattern: usize,
}

condyle_spatial::alike!(NonzeroRows);

impl NonzeroRows {
    /// For all columns of a matrix, given the rows of each.
    pub fn of_columns(rows: Vec<Vec<usize>>) -> Vec<Self> {
        let mut same = vec![1; rows.len()];
        for c in (1..rows.len()).rev().filter(|&c| rows[c - 1] == rows[c]) {
            same[c - 1] = same[c] + 1;
        }
        rows.into_iter().zip(same).map(|(rows, same_pattern)| Self { rows, same_pattern }).collect()
    }
}

impl AsRef<[usize]> for NonzeroRows {
    fn as_ref(&self) -> &[usize] {
        &self.rows
    }
}
