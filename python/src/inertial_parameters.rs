//! The ten inertial parameters of a body in Python: the module `condyle.inertial_parameters`.

use crate::arrays::{Give, array, class, matrix, read_only, three};
use crate::exceptions::NotPhysicalError;
use condyle::{Inertia, Sym3, Vec3, regressors::inertial_parameters as rust, spatial::Mat3};
use pyo3::prelude::*;

/// Converts an inertia to a Python object.
fn give_inertia<'py>(py: Python<'py>, I: Inertia<f64>) -> PyResult<Bound<'py, PyAny>> {
    inertia_of(py, I, |x| x.give(py, None), |X| X.give(py, None))
}

/// Converts the inertia of a model's body to a Python object with read-only arrays.
pub(crate) fn model_inertia<'py>(py: Python<'py>, I: Inertia<f64>) -> PyResult<Bound<'py, PyAny>> {
    let instead = "with_inertias";
    inertia_of(py, I, |x| read_only(py, &x, instead), |X| read_only(py, &X, instead))
}

fn inertia_of<'py>(
    py: Python<'py>,
    I: Inertia<f64>,
    vector: impl Fn(Vec3<f64>) -> PyResult<Bound<'py, PyAny>>,
    matrix: impl Fn(Mat3<f64>) -> PyResult<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let com = if I.mass > 0.0 { I.mass_com.scale(1.0 / I.mass) } else { Vec3::zero() };
    // about the centre of mass c: I_c = Ī − (−m [c]ₓ[c]ₓ), the inertia Ī about the origin less the inertia of a point
    // mass m at c
    let point_mass = Inertia::from_com(I.mass, com, Sym3::zero());
    let about_com = I.rotational - point_mass.rotational;
    let class = class!(py, "condyle._inertia", "Inertia")?;
    class.call1((I.mass, vector(com)?, matrix(about_com.full())?, matrix(I.rotational.full())?))
}

/// Reads an inertia from Python: mass, centre of mass, and the lower triangle of the rotational inertia about the
/// origin.
pub(crate) fn read_inertia(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Inertia<f64>> {
    let get = |name: &str| Ok::<_, PyErr>((format!("{argument}.{name}"), value.getattr(name)?));
    let mass: f64 = value.getattr("mass")?.extract()?;
    let ((name, com), (names, rotational)) = (get("com")?, get("rotational")?);
    let (com, J) = (three(&name, &com)?, matrix(&names, &rotational, [3, 3])?);
    let rotational = Sym3 { xx: J[0], xy: J[3], yy: J[4], xz: J[6], yz: J[7], zz: J[8] };
    Ok(Inertia { mass, mass_com: com.scale(mass), rotational })
}

fn refused(error: rust::NotPhysical) -> PyErr {
    NotPhysicalError::new_err(error.to_string())
}

/// Returns the ten parameters π of an `Inertia`, 10 numbers: mass, mass times centre of mass, and xx, xy, yy, xz, yz,
/// zz of the rotational inertia about the origin.
///
/// >>> from condyle import inertial_parameters
/// >>> I = condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))
/// >>> inertial_parameters.from_inertia(I)
/// array([2. , 0. , 0. , 1. , 0.6, 0. , 0.6, 0. , 0. , 0.1])
#[pyfunction]
pub(crate) fn from_inertia<'py>(inertia: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::from_inertia(read_inertia("inertia", inertia)?).give(inertia.py(), None)
}

/// Returns the `Inertia` with the ten parameters π; the inverse of `from_inertia`.
///
/// pi: the ten parameters π.
#[pyfunction]
pub(crate) fn to_inertia<'py>(pi: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    give_inertia(pi.py(), rust::to_inertia(array("pi", pi)?))
}

/// Returns the pseudo-inertia J = [Σ, m c; m cᵀ, m], (4, 4), in kg m², kg m and kg, with the mass m and the centre of
/// mass c. J is the integral of the products of (x, y, z, 1) over the mass; Σ contains the products of x, y and z.
///
/// J is linear in the parameters. J is positive definite if and only if a body of positive density can have this
/// inertia. Source: Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter
/// identification (2018).
///
/// >>> from condyle import inertial_parameters
/// >>> J = inertial_parameters.pseudo_inertia(condyle.robots.arm7().inertias[3])
/// >>> bool(np.linalg.eigvalsh(J).min() > 0.0)
/// True
#[pyfunction]
pub(crate) fn pseudo_inertia<'py>(inertia: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::pseudo_inertia(read_inertia("inertia", inertia)?).give(inertia.py(), None)
}

/// Checks that a body of positive density can have this inertia: its pseudo-inertia J must be positive definite. Raises
/// `NotPhysicalError` otherwise.
///
/// Point masses, rods and plates have no volume. The J of such bodies is singular, so this function rejects them.
///
/// >>> from condyle import inertial_parameters
/// >>> inertial_parameters.check(condyle.Inertia.from_com(0.0, np.zeros(3), np.eye(3)))
/// Traceback (most recent call last):
///     ...
/// condyle.NotPhysicalError: mass is 0 kg
#[pyfunction]
pub(crate) fn check(inertia: &Bound<'_, PyAny>) -> PyResult<()> {
    rust::check(read_inertia("inertia", inertia)?).map_err(refused)
}

/// Returns the log-Cholesky parameters θ = (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃) of a physical inertia. Every
/// vector of ten numbers belongs to exactly one physical inertia.
///
/// α = ½ ln m with the mass m; dᵢ: logarithms of lengths in metres; s: lengths (m); t: the centre of mass (m). With
/// these parameters, identification is an unconstrained problem. Source: Rucker and Wensing, Smooth parameterization of
/// rigid-body inertia (2022).
///
/// Raises `NotPhysicalError` for an inertia that is not physical.
///
/// >>> from condyle import inertial_parameters
/// >>> pi = condyle.robots.arm7().inertial_parameters[:10]
/// >>> theta = inertial_parameters.log_cholesky(inertial_parameters.to_inertia(pi))
/// >>> np.allclose(inertial_parameters.from_inertia(inertial_parameters.from_log_cholesky(theta)), pi)
/// True
#[pyfunction]
pub(crate) fn log_cholesky<'py>(inertia: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::log_cholesky(read_inertia("inertia", inertia)?).map_err(refused)?.give(inertia.py(), None)
}

/// Returns the `Inertia` with the log-Cholesky parameters θ. The inertia is physical for all values of θ. This function
/// is the inverse of `log_cholesky`.
///
/// theta: 10 numbers; α within ±32 and dᵢ within ±64.
#[pyfunction]
pub(crate) fn from_log_cholesky<'py>(theta: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    give_inertia(theta.py(), rust::from_log_cholesky(array("theta", theta)?))
}

/// Returns the Jacobian ∂π/∂θ of the ten parameters with respect to the log-Cholesky parameters, (10, 10), never
/// singular.
///
/// theta: 10 numbers. If Y is a regressor, Y ∂π/∂θ is the derivative of the efforts with respect to θ.
///
/// >>> from condyle import inertial_parameters
/// >>> inertial_parameters.log_cholesky_jacobian(np.zeros(10))[0, 0].item()  # m = e²ᵅ
/// 2.0
#[pyfunction]
pub(crate) fn log_cholesky_jacobian<'py>(theta: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::log_cholesky_jacobian(array("theta", theta)?).give(theta.py(), None)
}
