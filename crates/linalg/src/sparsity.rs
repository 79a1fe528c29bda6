//! Nonzero entries of matrices whose zeros follow a tree.

use alloc::vec::Vec;

/// Rows in which one column of a matrix may differ from zero; the zeros of the matrix follow a tree.
#[derive(Clone, Debug)]
pub struct NonzeroRows {
    /// Row indices, in the order in which products use the rows.
    pub rows: Vec<usize>,
    /// Number of consecutive columns with the same rows, counted from this column on.
    pub same_pattern: usize,
}

condyle_spatial::same_layout!(NonzeroRows);

impl NonzeroRows {
    /// Returns the `NonzeroRows` of each column of a matrix, given the rows of each column.
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
