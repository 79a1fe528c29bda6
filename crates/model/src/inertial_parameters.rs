//! The ten inertial parameters of a body, a test whether they are physical, and a parametrisation in which all values
//! are physical.
//!
//! The parameters are relative to the origin and the axes of the body's frame, in Pinocchio's order:
//!
//! ```text
//! π = (m, m c_x, m c_y, m c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz)
//! ```
//!
//! A mass distribution with positive density can have these parameters if and only if its pseudo-inertia J is positive
//! definite. The pseudo-inertia contains the second moments of the points (x, y, z, 1). Source: Wensing, Kim, Slotine,
//! *Linear matrix inequalities for physically consistent inertial parameter identification*, 2018.
//!
//! ```text
//! J = [Σ, m c; m cᵀ, m],   Σ = ½ tr(Ī) 1 − Ī
//! ```
//!
//! The log-Cholesky parameters θ are the Cholesky factor U of J, with the logarithms of its diagonal. They are a smooth
//! one-to-one map between ℝ¹⁰ and the physical inertias, so an identification with these parameters needs no
//! constraints. Source: Rucker and Wensing, *Smooth parameterization of rigid-body inertia*, 2022.
//!
//! ```text
//! θ = (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃),   J = U Uᵀ,   U = eᵅ [e^d₁ s₁₂  s₁₃  t₁]
//!                                                                      [ 0   e^d₂ s₂₃  t₂]
//!                                                                      [ 0    0   e^d₃ t₃]
//!                                                                      [ 0    0    0   1 ]
//! ```
//!
//! Therefore the mass is m = e²ᵅ, and t is the centre of mass.

use condyle_spatial::elementary::{exp, ln};
use condyle_spatial::{Inertia, Scalar, Sym3, Vec3};
use nalgebra::{SMatrix, SVector};

/// Reason why an inertia is not physical, so that no body of positive density has this inertia.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotPhysical {
    /// The mass is not positive.
    #[error("mass is {mass} kg")]
    Mass {
        /// Mass m (kg).
        mass: f64,
    },
    /// The second moment of mass along one axis is not positive: a principal moment about the centre of mass is not
    /// smaller than the sum of the other two principal moments.
    #[error(
        "along some axis the second moment of mass about the centre of mass is {moment} kg m²: \
         a principal moment of inertia is not below the sum of the other two"
    )]
    Spread {
        /// First pivot of the second moments Σ about the centre of mass that is not positive (kg m²).
        moment: f64,
    },
}

/// Returns the ten parameters π: mass, mass times centre of mass, and inertia about the origin.
///
/// ```
/// use condyle_model::{Inertia, Sym3, Vec3, inertial_parameters};
/// let I = Inertia::from_com(2.0, Vec3::new(0.0, 0.0, 0.5), Sym3::diagonal(0.1));
/// let pi = inertial_parameters::from_inertia(I);
/// assert_eq!(pi, [2.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.6, 0.0, 0.0, 0.1]);
/// assert_eq!(inertial_parameters::to_inertia(pi), I);
/// ```
pub fn from_inertia<S: Scalar>(I: Inertia<S>) -> [S; 10] {
    let (h, J) = (I.mass_com, I.rotational);
    [I.mass, h.x, h.y, h.z, J.xx, J.xy, J.yy, J.xz, J.yz, J.zz]
}

/// Returns the inertia with the ten parameters π. This function is the inverse of [`from_inertia`].
pub fn to_inertia<S: Scalar>([m, hx, hy, hz, xx, xy, yy, xz, yz, zz]: [S; 10]) -> Inertia<S> {
    Inertia { mass: m, mass_com: Vec3::new(hx, hy, hz), rotational: Sym3 { xx, xy, yy, xz, yz, zz } }
}

/// Returns Σ = ½ tr(Ī) 1 − Ī: the second moments ∫ x xᵀ dm of the mass about the origin (kg m²).
fn second_moments<S: Scalar>(J: Sym3<S>) -> Sym3<S> {
    let half_trace = (J.xx + J.yy + J.zz) * S::splat(0.5);
    (-J).add_diagonal(half_trace)
}

/// Returns J = [Σ, m c; m cᵀ, m]: the second moments of the points (x, y, z, 1). J is symmetric, 4 × 4, with entries in
/// kg m², kg m and kg.
///
/// J is linear in the parameters, and positive definite if and only if the inertia is physical. Source: Wensing, Kim,
/// Slotine (2018).
///
/// ```
/// use condyle_model::{inertial_parameters::pseudo_inertia, robots};
/// let arm = robots::arm7();
/// assert!(pseudo_inertia(arm.bodies()[3].inertia).symmetric_eigenvalues().min() > 0.0);
/// ```
pub fn pseudo_inertia<S: Scalar>(I: Inertia<S>) -> SMatrix<S, 4, 4> {
    let (s, h) = (second_moments(I.rotational), I.mass_com);
    SMatrix::<S, 4, 4>::new(
        s.xx, s.xy, s.xz, h.x, //
        s.xy, s.yy, s.yz, h.y, //
        s.xz, s.yz, s.zz, h.z, //
        h.x, h.y, h.z, I.mass,
    )
}

/// Cholesky factor U of the pseudo-inertia J = U Uᵀ.
struct Factor {
    /// Scale eᵅ.
    scale: f64,
    /// First three diagonal entries of U: eᵅ (e^d₁, e^d₂, e^d₃).
    diagonal: Vec3<f64>,
    /// Entries of U above the diagonal: eᵅ (s₁₂, s₂₃, s₁₃).
    above: Vec3<f64>,
    /// Centre of mass.
    t: Vec3<f64>,
}

/// Computes the Cholesky factor of the pseudo-inertia, from the last column to the first column. The factor exists if
/// all pivots are positive.
fn factor(I: Inertia<f64>) -> Result<Factor, NotPhysical> {
    let positive = |moment: f64| if moment > 0.0 { Ok(moment.sqrt()) } else { Err(NotPhysical::Spread { moment }) };
    let mass = I.mass;
    if !(mass > 0.0 && mass.is_finite()) {
        return Err(NotPhysical::Mass { mass });
    }
    let t = I.mass_com.scale(1.0 / mass);
    let s = second_moments(I.rotational) - Sym3::outer(t).scale(mass); // moments about the centre of mass
    let z = positive(s.zz)?;
    let (yz, xz) = (s.yz / z, s.xz / z);
    let y = positive(s.yy - yz * yz)?;
    let xy = (s.xy - xz * yz) / y;
    let x = positive(s.xx - xy * xy - xz * xz)?;
    Ok(Factor { scale: mass.sqrt(), diagonal: Vec3::new(x, y, z), above: Vec3::new(xy, yz, xz), t })
}

/// Checks whether a body of positive density can have this inertia: all pivots of the Cholesky factor of J must be
/// positive.
///
/// Point masses, rods and plates have no volume. They are limit cases and are refused.
///
/// # Errors
/// Returns [`NotPhysical`] with the mass if the mass is not positive or not finite. Otherwise, returns [`NotPhysical`]
/// with the first pivot that is not positive.
///
/// ```
/// use condyle_model::{Inertia, Sym3, Vec3, inertial_parameters::check};
/// let mut J = Sym3::diagonal(0.1);
/// assert!(check(Inertia::from_com(1.0, Vec3::zero(), J)).is_ok());
/// J.zz = 0.3; // more than 0.1 + 0.1
/// assert!(check(Inertia::from_com(1.0, Vec3::zero(), J)).is_err());
/// ```
pub fn check(I: Inertia<f64>) -> Result<(), NotPhysical> {
    factor(I).map(|_| ())
}

/// Returns the log-Cholesky parameters θ of a physical inertia. Any ten numbers are valid, and different θ give
/// different inertias.
///
/// In θ, α is ½ ln m. Each dᵢ is the logarithm of a length in metres. Each s is a length (m), and t is the centre of
/// mass (m). Source: Rucker and Wensing (2022).
///
/// ```
/// use condyle_model::{inertial_parameters::{from_log_cholesky, log_cholesky}, robots};
/// let I = robots::arm7().bodies()[3].inertia;
/// let theta = log_cholesky(I)?;
/// assert!((from_log_cholesky(theta).mass - I.mass).abs() < 1e-14 * I.mass);
/// # Ok::<(), condyle_model::inertial_parameters::NotPhysical>(())
/// ```
///
/// # Errors
/// Returns [`NotPhysical`] if [`check`] refuses the inertia.
pub fn log_cholesky(I: Inertia<f64>) -> Result<[f64; 10], NotPhysical> {
    let Factor { scale, diagonal, above, t } = factor(I)?;
    let d = diagonal.to_array().map(|x| ln(x / scale));
    let s = above.scale(1.0 / scale);
    Ok([ln(scale), d[0], d[1], d[2], s.x, s.y, s.z, t.x, t.y, t.z])
}

/// Returns the first three rows of U / eᵅ, and e²ᵅ.
fn rows<S: Scalar>(theta: &[S; 10]) -> ([[S; 4]; 3], S) {
    let &[alpha, d1, d2, d3, s12, s23, s13, t1, t2, t3] = theta;
    let o = S::zero();
    ([[exp(d1), s12, s13, t1], [o, exp(d2), s23, t2], [o, o, exp(d3), t3]], exp(alpha + alpha))
}

fn dot<S: Scalar>(a: [S; 4], b: [S; 4]) -> S {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2].mul_add(b[2], a[3] * b[3])))
}

/// Returns the inertia with the log-Cholesky parameters θ. The inertia is physical for all θ. This function is the
/// inverse of [`log_cholesky`].
///
/// Ī = tr(Σ) 1 − Σ, where Σ is the upper left block of U Uᵀ. Source: Rucker and Wensing (2022). The result is valid for
/// α within ±32 and dᵢ within ±64, up to a rounding error that grows with their magnitude.
pub fn from_log_cholesky<S: Scalar>(theta: [S; 10]) -> Inertia<S> {
    let ([x, y, z], mass) = rows(&theta);
    let moments = Sym3 { xx: dot(x, x), xy: dot(x, y), yy: dot(y, y), xz: dot(x, z), yz: dot(y, z), zz: dot(z, z) };
    let trace = moments.xx + moments.yy + moments.zz;
    let rotational = (-moments).add_diagonal(trace); // Ī = tr(Σ) 1 − Σ
    Inertia { mass, mass_com: Vec3::new(x[3], y[3], z[3]).scale(mass), rotational: rotational.scale(mass) }
}

/// Returns ∂π/∂θ, 10 × 10 and always invertible: the derivative of the ten parameters with respect to the log-Cholesky
/// parameters.
///
/// Source: Rucker and Wensing (2022). With Y from `joint_torque_regressor`, Y ∂π/∂θ is the derivative of the torques
/// with respect to θ.
///
/// ```
/// use condyle_model::inertial_parameters::log_cholesky_jacobian;
/// let J = log_cholesky_jacobian([0.0; 10]);
/// assert_eq!(J[(0, 0)], 2.0); // m = e²ᵅ
/// ```
pub fn log_cholesky_jacobian<S: Scalar>(theta: [S; 10]) -> SMatrix<S, 10, 10> {
    let (u, mass) = rows(&theta);
    let mut J = SMatrix::<S, 10, 10>::from_element(S::zero());
    // e²ᵅ is a factor of all parameters, so ∂π/∂α = 2 π.
    let pi = from_inertia(from_log_cholesky(theta));
    J.set_column(0, &SVector::<S, 10>::from_fn(|k, _| pi[k] + pi[k]));
    // Each component of θ except α is an entry (row, column) of U / eᵅ, or the logarithm of a diagonal entry.
    const ENTRIES: [(usize, usize); 9] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)];
    for (k, &(row, column)) in ENTRIES.iter().enumerate() {
        let rate = if row == column { u[row][column] } else { S::one() } * mass;
        // The derivative of Σ is dΣ = e²ᵅ (e_row u_columnᵀ + u_column e_rowᵀ), with unit vectors e and the columns u of
        // U / eᵅ.
        let change = Vec3::new(u[0][column], u[1][column], u[2][column]).scale(rate);
        let unit = Vec3::from(core::array::from_fn(|r| if r == row { S::one() } else { S::zero() }));
        let moments = Sym3::outer_sum(unit, change);
        let trace = moments.xx + moments.yy + moments.zz;
        let first = if column == 3 { unit.scale(rate) } else { Vec3::zero() };
        let d = Inertia { mass: S::zero(), mass_com: first, rotational: (-moments).add_diagonal(trace) };
        J.set_column(k + 1, &from_inertia(d).into());
    }
    J
}
