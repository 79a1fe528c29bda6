//! Where matrices with the zeros of a tree have entries.

/// The rows in which a column of such a matrix may differ from zero.
#[derive(Clone, Debug)]
pub struct NonzeroRows {
    /// The rows, in the order in which products go through them.
    pub rows: Vec<usize>,
    /// How many columns one after the other, from this one on, have the same rows.
    pub same_pattern: usize,
}

impl NonzeroRows {
    /// For all columns of a matrix, given the rows of each.
    pub fn of_columns(rows: Vec<Vec<usize>>) -> Vec<Self> {
        let same = |c: usize| rows[c..].iter().take_while(|other| **other == rows[c]).count();
        (0..rows.len()).map(|c| Self { rows: rows[c].clone(), same_pattern: same(c) }).collect()
    }
}

impl AsRef<[usize]> for NonzeroRows {
    fn as_ref(&self) -> &[usize] {
        &self.rows
    }
}
