//! Friction cones, wrench cones and the support of the centre of pressure, as rows of inequalities.
//!
//! A contact's force is expressed along the axes of the contact's rows. The rotation R of a cone maps the axes of the
//! surface, whose z axis is the normal, to the axes of the contact's rows. The rows are in Crocoddyl's order, so
//! residuals have the same values as in Crocoddyl.

use crate::Error;
use crate::problem::leave_a_value;
use condyle_dynamics::{Mat3, Vec3};

/// Coulomb's friction cone ‖f_t‖ ≤ μ f_n as a pyramid, and bounds on the normal force. The rows of a matrix A limit the
/// force f: lower ≤ A f ≤ upper.
///
/// ```
/// use condyle_optimal::robot::FrictionCone;
/// let cone = FrictionCone::new(0.5);
/// let rows = cone.rows();
/// assert_eq!(rows.len(), 5); // ±x, ±y, and the normal force
/// assert_eq!(rows[0], [1.0, 0.0, -0.5]); // f_x ≤ 0.5 f_z
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct FrictionCone {
    /// Rotation R from the axes of the surface to the axes of the contact's rows.
    pub rotation: Mat3<f64>,
    /// Coefficient of friction μ.
    pub mu: f64,
    /// Number of sides of the pyramid: an even number from 4 to [`MOST_FACETS`](Self::MOST_FACETS).
    pub facets: usize,
    /// Whether the pyramid is inside the cone. If not, the cone is inside the pyramid.
    pub inner: bool,
    /// Least normal force (N).
    pub least: f64,
    /// Greatest normal force (N).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::greatest"))]
    pub greatest: f64,
}

/// Limits of the wrench w (force first) of a rectangular sole, as rows of a matrix A with lower ≤ A w ≤ upper. The rows
/// limit friction, the centre of pressure (inside the rectangle), and the yaw moment that friction can produce.
///
/// Source: Caron, Pham, Nakamura, *Stability of surface contacts for humanoid robots* (2015).
///
/// ```
/// use condyle_dynamics::Mat3;
/// use condyle_optimal::robot::{FrictionCone, WrenchCone};
/// let cone = WrenchCone { friction: FrictionCone::new(0.7), size: [0.2, 0.1] };
/// assert_eq!(cone.rows().len(), 17);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct WrenchCone {
    /// Friction cone of the force.
    pub friction: FrictionCone,
    /// Side lengths of the rectangle along the axes x and y of the surface (m).
    pub size: [f64; 2],
}

impl FrictionCone {
    /// Maximum number of sides of a pyramid. A pyramid with 1000 sides is within 5e-6 of the round cone.
    pub const MOST_FACETS: usize = 1000;

    /// Returns a pyramid with four sides around the cone, on a surface with the normal z. Any normal force that pushes
    /// is allowed.
    pub fn new(mu: f64) -> Self {
        Self { rotation: Mat3::identity(), mu, facets: 4, inner: false, least: 0.0, greatest: f64::INFINITY }
    }

    /// Returns the coefficient of friction of the pyramid.
    fn slope(&self) -> f64 {
        let half = core::f64::consts::PI / self.facets as f64;
        if self.inner { self.mu * half.cos() } else { self.mu }
    }

    /// Returns the matrix A: a row for each side of the pyramid, then a row for the normal force.
    ///
    /// # Panics
    /// If the number of sides is 0 or above 1000.
    #[track_caller]
    pub fn rows(&self) -> Vec<[f64; 3]> {
        self.assert_facets();
        let mut rows = Vec::new();
        self.each_row(|row| rows.push(row));
        rows
    }

    /// Calls `visit` with each row of the matrix A. Allocates nothing.
    pub(crate) fn each_row(&self, mut visit: impl FnMut([f64; 3])) {
        for side in 0..self.facets / 2 {
            let angle = 2.0 * core::f64::consts::PI * side as f64 / self.facets as f64;
            for sign in [1.0, -1.0] {
                let along = Vec3::new(sign * angle.cos(), sign * angle.sin(), -self.slope());
                visit((self.rotation * along).to_array()); // ±t − μ n
            }
        }
        visit((self.rotation * Vec3::new(0.0, 0.0, 1.0)).to_array());
    }

    #[track_caller]
    fn assert_facets(&self) {
        let (facets, most) = (self.facets, Self::MOST_FACETS);
        assert!((1..=most).contains(&facets), "`facets` is {facets}, expected from 4 to {most}");
    }

    /// Returns the lower and upper bounds of A f for a contact's force f.
    ///
    /// # Panics
    /// If the number of sides is 0 or above 1000.
    #[track_caller]
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        self.assert_facets();
        let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; self.facets], vec![0.0; self.facets]);
        lower.push(self.least);
        upper.push(self.greatest);
        (lower, upper)
    }

    /// Checks the parameters of the cone. A problem that contains the cone also makes this check.
    ///
    /// # Errors
    /// [`Error::Cone`] if μ is negative or not finite, or if the number of sides is odd, below 4 or above 1000. Also if
    /// the rotation is invalid, or no normal force satisfies the bounds.
    pub fn check(&self) -> Result<(), Error> {
        self.wrong().map_or(Ok(()), |what| Err(Error::Cone { what }))
    }

    /// Returns an error message if a parameter of the cone is invalid.
    pub(crate) fn wrong(&self) -> Option<String> {
        let Self { least, greatest, .. } = *self;
        if !(self.mu >= 0.0 && self.mu.is_finite()) {
            return Some(format!("its friction is {}, but it must be at least 0", self.mu));
        }
        if !(4..=Self::MOST_FACETS).contains(&self.facets) || self.facets % 2 == 1 {
            let allowed = format!("they must be even, at least 4 and at most {}", Self::MOST_FACETS);
            return Some(format!("its cone has {} sides, but {allowed}", self.facets));
        }
        if !leave_a_value(least, greatest) {
            return Some(format!("its cone's normal force must be at least {least} and at most {greatest}"));
        }
        let turns = self.rotation.is_rotation();
        (!turns).then(|| "its cone's rotation is none: expected three unit vectors at right angles".to_owned())
    }
}

/// Returns an error message if a side length of the rectangle is invalid.
pub(crate) fn wrong_size([length, width]: [f64; 2]) -> Option<String> {
    let good = |side: f64| side >= 0.0 && side.is_finite();
    (!(good(length) && good(width)))
        .then(|| format!("its sides are {length} and {width} m, expected finite numbers of at least 0"))
}

/// Returns the four rows that keep the centre of pressure inside a rectangle: |τ_x| ≤ ½ size_y f_z, |τ_y| ≤ ½ size_x
/// f_z.
pub(crate) fn pressure_rows(R: Mat3<f64>, [length, width]: [f64; 2]) -> [[f64; 6]; 4] {
    let [x, y, z] = R.columns();
    [(width, x), (width, -x), (length, y), (length, -y)].map(|(side, axis)| {
        let ([a, b, c], [d, e, f]) = (z.scale(-0.5 * side).to_array(), axis.to_array());
        [a, b, c, d, e, f]
    })
}

impl WrenchCone {
    /// Checks the parameters of the cone. A problem that contains the cone also makes this check.
    ///
    /// # Errors
    /// [`Error::Cone`] in the cases of [`FrictionCone::check`], and for a side length that is negative or not finite.
    pub fn check(&self) -> Result<(), Error> {
        self.wrong().map_or(Ok(()), |what| Err(Error::Cone { what }))
    }

    /// Returns an error message if a parameter of the cone is invalid.
    pub(crate) fn wrong(&self) -> Option<String> {
        self.friction.wrong().or_else(|| wrong_size(self.size))
    }

    /// Returns the matrix A: the rows of the friction cone, then four rows for the centre of pressure and eight for the
    /// yaw moment.
    ///
    /// # Panics
    /// If the number of sides is 0 or above 1000.
    #[track_caller]
    pub fn rows(&self) -> Vec<[f64; 6]> {
        let (R, mu) = (self.friction.rotation, self.friction.slope());
        let mut rows: Vec<_> = self.friction.rows().iter().map(|&[a, b, c]| [a, b, c, 0.0, 0.0, 0.0]).collect();
        rows.extend(pressure_rows(R, self.size));
        let [length, width] = self.size.map(|side| 0.5 * side);
        for turn in [-1.0, 1.0] {
            for (sx, sy) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                // row of |w f_x ∓ μ τ_x| + |l f_y ∓ μ τ_y| ± τ_z ≤ μ (l + w) f_z, with the length l and the width w of
                // the sole
                let force = R * Vec3::new(sx * width, sy * length, -mu * (length + width));
                let moment = R * Vec3::new(turn * sx * mu, turn * sy * mu, turn);
                let ([a, b, c], [d, e, f]) = (force.to_array(), moment.to_array());
                rows.push([a, b, c, d, e, f]);
            }
        }
        rows
    }

    /// Returns the lower and upper bounds of A w for a wrench w.
    ///
    /// # Panics
    /// If the number of sides is 0 or above 1000.
    #[track_caller]
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut lower, mut upper) = self.friction.bounds();
        lower.extend([f64::NEG_INFINITY; 12]);
        upper.extend([0.0; 12]);
        (lower, upper)
    }
}
