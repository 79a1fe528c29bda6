//! Actuation: the linear map from controls to joint efforts.

use crate::Error;
use condyle_dynamics::{Joint, Model};
use nalgebra::{DMatrix, DVector};

/// Length below which a basis vector is only a rounding error, relative to the longest one.
const LEAST: f64 = 1e-9;

/// Linear map τ = S u from controls u to joint efforts τ.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::Actuation;
/// let quadruped = robots::quadruped();
/// assert_eq!(Actuation::joints(&quadruped).nu(), 12); // its trunk is driven by nothing
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Actuation {
    nv: usize,
    map: Map,
}

#[derive(Clone, Debug, PartialEq)]
enum Map {
    /// Number of coordinates without motor, which are the first ones: S = [0; 1]. Each other coordinate has one
    /// control.
    After(usize),
    /// Arbitrary matrix S, nv × nu.
    Matrix(DMatrix<f64>),
}

impl Actuation {
    /// Creates the actuation with one control for each coordinate. A free-flyer at the root has no controls.
    pub fn joints(model: &Model) -> Self {
        let passive = match model.bodies().get(1) {
            Some(root) if root.joint == Joint::FreeFlyer => 6,
            _ => 0,
        };
        Self { nv: model.nv(), map: Map::After(passive) }
    }

    /// Creates the actuation with an arbitrary matrix S, nv × nu, for example for rotors, tendons or joints without
    /// motors.
    ///
    /// # Errors
    /// [`Error::Actuation`] if S does not have nv rows or has an entry that is not finite.
    pub fn matrix(model: &Model, S: DMatrix<f64>) -> Result<Self, Error> {
        let (rows, columns) = S.shape();
        if rows != model.nv() {
            let what = format!("its map is {rows} × {columns}, expected {} rows", model.nv());
            return Err(Error::Actuation { what });
        }
        if S.iter().any(|x| !x.is_finite()) {
            return Err(Error::Actuation { what: "its map holds a number that is not finite".to_owned() });
        }
        Ok(Self { nv: rows, map: Map::Matrix(S) })
    }

    /// Returns an error if the number of coordinates of this actuation differs from the robot's.
    pub(super) fn check(&self, model: &Model) -> Result<(), Error> {
        let (found, nv) = (self.nv, model.nv());
        match found == nv {
            true => Ok(()),
            false => Err(Error::Actuation { what: format!("it drives {found} coordinates, the robot has {nv}") }),
        }
    }

    /// Returns the actuation with one control for each coordinate.
    pub(super) fn all(model: &Model) -> Self {
        Self { nv: model.nv(), map: Map::After(0) }
    }

    /// Returns the actuation without controls.
    pub(super) fn none(model: &Model) -> Self {
        Self { nv: model.nv(), map: Map::After(model.nv()) }
    }

    /// Returns the number of controls.
    pub fn nu(&self) -> usize {
        match &self.map {
            Map::After(passive) => self.nv - passive,
            Map::Matrix(S) => S.ncols(),
        }
    }

    /// Returns the number of coordinates without motor, if these are the first coordinates and each other coordinate
    /// has one control; otherwise `None`.
    pub(super) fn passive(&self) -> Option<usize> {
        match self.map {
            Map::After(passive) => Some(passive),
            Map::Matrix(_) => None,
        }
    }

    /// Computes the joint efforts τ = S u into `tau`.
    pub(super) fn effort(&self, u: &[f64], tau: &mut [f64]) {
        tau.fill(0.0);
        match &self.map {
            Map::After(passive) => tau[*passive..].copy_from_slice(u),
            Map::Matrix(S) => {
                for (column, u) in S.as_slice().chunks_exact(self.nv).zip(u) {
                    tau.iter_mut().zip(column).for_each(|(tau, s)| *tau += s * u);
                }
            }
        }
    }

    /// Returns entry k of Sᵀ τ: the component of the efforts τ along control k.
    pub(super) fn along(&self, k: usize, tau: &[f64]) -> f64 {
        match &self.map {
            Map::After(passive) => tau[passive + k],
            Map::Matrix(S) => S.column(k).iter().zip(tau).map(|(s, tau)| s * tau).sum(),
        }
    }

    /// Computes g_u += c S_row, where S_row is row `row` of S: the gradient of the effort of coordinate `row` with
    /// respect to u.
    pub(super) fn add_row(&self, row: usize, c: f64, g_u: &mut [f64]) {
        match &self.map {
            Map::After(passive) if row < *passive => {}
            Map::After(passive) => g_u[row - passive] += c,
            Map::Matrix(S) => (0..S.ncols()).for_each(|j| g_u[j] += c * S[(row, j)]),
        }
    }

    /// Computes g_u += c (X S)_row, where (X S)_row is row `row` of the product X S. X is a derivative with respect to
    /// τ and has nv columns.
    pub(super) fn add_product_row(&self, X: &DMatrix<f64>, row: usize, c: f64, g_u: &mut [f64]) {
        let (rows, X) = (X.nrows(), X.as_slice());
        match &self.map {
            Map::After(passive) => {
                for (g, column) in g_u.iter_mut().zip(X[passive * rows..].chunks_exact(rows)) {
                    *g += c * column[row];
                }
            }
            Map::Matrix(S) => {
                for (g, s) in g_u.iter_mut().zip(S.as_slice().chunks_exact(self.nv)) {
                    let product: f64 = s.iter().zip(X.chunks_exact(rows)).map(|(s, column)| s * column[row]).sum();
                    *g += c * product;
                }
            }
        }
    }

    /// Returns X S (rows × nu, column after column) for a matrix X with nv columns. The product is written to
    /// `scratch`. If each control drives one coordinate, the result is a slice of X instead.
    pub(super) fn columns<'a>(&self, X: &'a DMatrix<f64>, scratch: &'a mut [f64]) -> &'a [f64] {
        let (rows, X) = (X.nrows(), X.as_slice());
        match &self.map {
            Map::After(passive) => &X[passive * rows..],
            Map::Matrix(S) => {
                scratch.fill(0.0);
                for (out, s) in scratch.chunks_exact_mut(rows).zip(S.as_slice().chunks_exact(self.nv)) {
                    for (column, s) in X.chunks_exact(rows).zip(s).filter(|(_, s)| **s != 0.0) {
                        out.iter_mut().zip(column).for_each(|(out, x)| *out += s * x);
                    }
                }
                scratch
            }
        }
    }

    /// Returns the scratch that `columns` needs for a matrix X with nv rows.
    pub(super) fn scratch(&self) -> Vec<f64> {
        match &self.map {
            Map::After(_) => Vec::new(),
            Map::Matrix(S) => vec![0.0; S.len()],
        }
    }

    /// Returns an orthonormal basis of the joint efforts that no control can produce: the rows of Nᵀ with Nᵀ S = 0, one
    /// after the other. The rows are unit vectors if each control drives one coordinate.
    pub(super) fn undriven(&self) -> Vec<f64> {
        let nv = self.nv;
        let mut left = DMatrix::identity(nv, nv);
        match &self.map {
            Map::After(passive) => left.columns_mut(*passive, nv - passive).fill(0.0),
            Map::Matrix(S) if S.ncols() > 0 => {
                let inverse = S.clone().pseudo_inverse(LEAST * S.amax()).expect("the bound is not negative");
                left -= S * inverse; // 1 − S S⁺
            }
            Map::Matrix(_) => {}
        }
        // Gram–Schmidt orthonormalisation, the longest column first; ends when only rounding errors are left
        let mut basis = Vec::new();
        loop {
            let squares: Vec<_> = left.column_iter().map(|column| column.norm_squared()).collect();
            let longest = (0..nv).reduce(|a, b| if squares[b] > squares[a] { b } else { a });
            let Some(k) = longest.filter(|&k| squares[k] > LEAST) else { return basis };
            let unit = left.column(k).normalize();
            basis.extend_from_slice(unit.as_slice());
            left -= &unit * (unit.transpose() * &left);
        }
    }

    /// Writes S to the first columns of a matrix of zeros with nv rows, which is stored column after column.
    pub(super) fn write_columns(&self, to: &mut [f64]) {
        let nv = self.nv;
        match &self.map {
            Map::After(passive) => (0..nv - passive).for_each(|j| to[j * nv + passive + j] = 1.0),
            Map::Matrix(S) => to[..S.len()].copy_from_slice(S.as_slice()),
        }
    }

    /// Returns the least-squares solution (u, λ) of S u + Jᵀλ = τ that has the smallest norm.
    pub(super) fn quasi_static(&self, tau: &[f64], J: &DMatrix<f64>) -> Vec<f64> {
        let nu = self.nu();
        let mut map = DMatrix::zeros(self.nv, nu + J.nrows());
        self.write_columns(map.as_mut_slice());
        if map.is_empty() {
            return vec![0.0; nu + J.nrows()];
        }
        map.columns_mut(nu, J.nrows()).copy_from(&J.transpose());
        let singular = map.svd(true, true);
        let least = f64::EPSILON * self.nv.max(nu + J.nrows()) as f64 * singular.singular_values.max();
        let tau = DVector::from_column_slice(tau);
        let both = singular.solve(&tau, least).expect("both factors were asked for");
        both.as_slice().to_vec()
    }
}
