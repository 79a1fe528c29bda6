//! Reading of matrices from files. The format is the one that nalgebra writes with serde: the entries column after
//! column, then the numbers of rows and columns. The number of entries must equal rows × columns.

use crate::lq::LqKnot;
use nalgebra::DMatrix;
use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Matrix as stored in a file.
#[derive(Deserialize)]
struct Written(Vec<f64>, usize, usize);

impl Written {
    fn matrix<E: Error>(self) -> Result<DMatrix<f64>, E> {
        let (Self(numbers, rows, columns), most) = (self, LqKnot::MOST_SIZE);
        if rows.max(columns) > most || rows * columns != numbers.len() {
            let found = numbers.len();
            return Err(E::custom(format!("a matrix of {rows} × {columns} with {found} numbers, at most {most} rows")));
        }
        Ok(DMatrix::from_vec(rows, columns, numbers))
    }
}

/// Reads a matrix, if it is present.
pub(crate) fn optional_matrix<'de, D: Deserializer<'de>>(from: D) -> Result<Option<DMatrix<f64>>, D::Error> {
    Option::<Written>::deserialize(from)?.map(Written::matrix).transpose()
}

/// Reads a list of matrices.
pub(crate) fn matrices<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<DMatrix<f64>>, D::Error> {
    Vec::<Written>::deserialize(from)?.into_iter().map(Written::matrix).collect()
}
