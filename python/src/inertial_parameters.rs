//! The ten inertial parameters of a body as Python sees them: the module `condyle.inertial_parameters`.

use crate::arrays::{Give, give_rows, matrix, named_tuple, three, vector};
use crate::exceptions::NotPhysicalError;
use condyle::{Inertia, Sym3, Vec3, inertial_parameters as rust};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// An inertia as Python sees it.
pub(crate) fn give_inertia<'py>(py: Python<'py>, I: Inertia<f64>) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let com = if I.mass > 0.0 { I.mass_com.scale(1.0 / I.mass) } else { Vec3::zero() };
    // Ī = I_c − m [c]ₓ[c]ₓ, so I_c is what is left of Ī when that is taken away
    let point_mass = Inertia::from_com(I.mass, com, Sym3::zero());
    let about_com = I.rotational - point_mass.rotational;
    named_tuple(py, &CLASS, "Inertia")?.call1((
        I.mass,
        com.give(py, None)?,
        give_rows(py, about_com.full().columns())?,
        give_rows(py, I.rotational.full().columns())?,
    ))
}

/// An inertia that Python gives: mass, centre of mass and the rotational inertia about the origin, of which the
/// lower triangle counts.
pub(crate) fn read_inertia(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Inertia<f64>> {
    let get = |name: &str| Ok::<_, PyErr>((format!("{argument}.{name}"), value.getattr(name)?));
    let mass: f64 = value.getattr("mass")?.extract()?;
    let ((name, com), (names, rotational)) = (get("com")?, get("rotational")?);
    let (com, J) = (three(&name, &com)?, matrix(&names, &rotational, [3, 3])?);
    let rotational = Sym3 { xx: J[0], xy: J[3], yy: J[4], xz: J[6], yz: J[7], zz: J[8] };
    Ok(Inertia { mass, mass_com: com.scale(mass), rotational })
}

fn ten(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; 10]> {
    let numbers = vector(argument, value, 10)?;
    Ok(core::array::from_fn(|k| numbers[k]))
}

fn refused(error: rust::NotPhysical) -> PyErr {
    NotPhysicalError::new_err(error.to_string())
}

/// π of an `Inertia`: mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the rotational inertia about
/// the origin, 10 numbers.
///
/// >>> from condyle import inertial_parameters
/// >>> I = condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))
/// >>> inertial_parameters.from_inertia(I)
/// array([2. , 0. , 0. , 1. , 0.6, 0. , 0.6, 0. , 0. , 0.1])
#[pyfunction]
pub(crate) fn from_inertia<'py>(inertia: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::from_inertia(read_inertia("inertia", inertia)?).give(inertia.py(), None)
}

/// The `Inertia` with the ten parameters π; the inverse of `from_inertia`.
///
/// pi: 10 numbers.
#[pyfunction]
pub(crate) fn to_inertia<'py>(pi: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    give_inertia(pi.py(), rust::to_inertia(ten("pi", pi)?))
}

/// J = [Σ, m c; m cᵀ, m], the second moments of the points (x, y, z, 1): (4, 4), in kg m², kg m and kg.
///
/// Linear in the parameters; positive definite if and only if a body of positive density can have this inertia. Source:
/// Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter identification
/// (2018).
///
/// >>> from condyle import inertial_parameters
/// >>> J = inertial_parameters.pseudo_inertia(condyle.robots.arm7().inertias[3])
/// >>> bool(np.linalg.eigvalsh(J).min() > 0.0)
/// True
#[pyfunction]
pub(crate) fn pseudo_inertia<'py>(inertia: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::pseudo_inertia(read_inertia("inertia", inertia)?).give(inertia.py(), None)
}

/// Raises `NotPhysicalError` unless a body of positive density can have this inertia: J ≻ 0.
///
/// Point masses, rods and plates are at the border, without volume, and are refused.
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

/// θ = (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃), the log-Cholesky parameters of a physical inertia: any ten
/// numbers, of which each tuple is another body.
///
/// α = ½ ln m; dᵢ: logarithms (of m); s: m; t: the centre of mass (m). With them an identification needs no
/// constraints. Source: Rucker and Wensing, Smooth parameterization of rigid-body inertia (2022).
///
/// Raises `NotPhysicalError`.
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

/// The `Inertia` with the log-Cholesky parameters θ, physical whatever they are; the inverse of `log_cholesky`.
///
/// theta: 10 numbers; α within ±32 and dᵢ within ±64.
#[pyfunction]
pub(crate) fn from_log_cholesky<'py>(theta: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    give_inertia(theta.py(), rust::from_log_cholesky(ten("theta", theta)?))
}

/// ∂π/∂θ, (10, 10) and never singular: how the ten parameters change with the log-Cholesky parameters.
///
/// theta: 10 numbers. With a regressor Y, Y ∂π/∂θ is the slope of the efforts in θ.
///
/// >>> from condyle import inertial_parameters
/// >>> inertial_parameters.log_cholesky_jacobian(np.zeros(10))[0, 0].item()  # m = e²ᵅ
/// 2.0
#[pyfunction]
pub(crate) fn log_cholesky_jacobian<'py>(theta: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    rust::log_cholesky_jacobian(ten("theta", theta)?).give(theta.py(), None)
}
