//! Nonzero entries of matrices whose zeros follow a tree.

use alloc::vec::Vec;

/// Rows in which a column of such a matrix may differ from zero.
#[derive(Clone, Debug)]
pub struct NonzeroRows {
    /// Row indices, in the order in which products use them.
    pub rows: Vec<usize>,
    /// Number of consecutive columns, from this one on, with the same rows.
    pub same_pattern: usize,
}

condyle_spatial::same_layout!(NonzeroRows);

impl NonzeroRows {
    /// Returns the value for each column of a matrix, given the rows of each column.
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
