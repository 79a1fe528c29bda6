"""Tests of inertial parameters of bodies: conversions in both directions, physical values, and the Jacobian."""

import numpy as np
import pytest
from sample import Robot
from test_algorithms import DIFFERENCES, central

import condyle
from condyle import Inertia, inertial_parameters

CLOSE = {"rtol": 1e-10, "atol": 1e-12}


def test_there_and_back(robot: Robot) -> None:
    model = robot.model
    for inertia, pi in zip(model.inertias[1:], model.inertial_parameters.reshape(-1, 10), strict=True):
        np.testing.assert_allclose(inertial_parameters.from_inertia(inertia), pi, **CLOSE)
        again = inertial_parameters.to_inertia(pi)
        assert type(again) is Inertia
        for ours, given in zip(again, inertia, strict=True):
            np.testing.assert_allclose(ours, given, **CLOSE)
        inertial_parameters.check(inertia)
        theta = inertial_parameters.log_cholesky(inertia)
        back = inertial_parameters.from_log_cholesky(theta)
        np.testing.assert_allclose(inertial_parameters.from_inertia(back), pi, **CLOSE)
        assert np.isclose(np.exp(2 * theta[0]), inertia.mass)
        np.testing.assert_allclose(theta[7:], inertia.com, **CLOSE)


def test_pseudo_inertia() -> None:
    """Compares the pseudo-inertia with a sum over point masses m at x: Σ m (x, 1) (x, 1)ᵀ."""
    rng = np.random.default_rng(0)
    points, masses = rng.standard_normal((5, 3)), rng.uniform(0.1, 1, 5)
    pi = np.zeros(10)
    expected = np.zeros((4, 4))
    for x, m in zip(points, masses, strict=True):
        pi += inertial_parameters.from_inertia(Inertia.from_com(m, x, np.zeros((3, 3))))
        expected += m * np.outer(np.r_[x, 1], np.r_[x, 1])
    J = inertial_parameters.pseudo_inertia(inertial_parameters.to_inertia(pi))
    np.testing.assert_allclose(J, expected, **CLOSE)


def test_jacobian() -> None:
    theta = np.random.default_rng(0).standard_normal(10)

    def pi(step: np.ndarray) -> np.ndarray:
        return inertial_parameters.from_inertia(inertial_parameters.from_log_cholesky(theta + step))

    np.testing.assert_allclose(inertial_parameters.log_cholesky_jacobian(theta), central(pi, 10), **DIFFERENCES)


def test_what_is_refused() -> None:
    flat = Inertia.from_com(1.0, [0, 0, 0], np.diag([0.1, 0.1, 0.3]))
    assert issubclass(condyle.NotPhysicalError, condyle.Error)
    for function in (inertial_parameters.check, inertial_parameters.log_cholesky):
        with pytest.raises(condyle.NotPhysicalError, match="a principal moment of inertia is not below the sum"):
            function(flat)
        with pytest.raises(condyle.NotPhysicalError, match="^mass is -1 kg$"):
            function(flat._replace(mass=-1.0))
    with pytest.raises(ValueError, match=r"^pi: expected shape \(10,\), found \(9,\)$"):
        inertial_parameters.to_inertia(np.zeros(9))
    with pytest.raises(ValueError, match=r"^inertia.rotational: expected shape \(3, 3\), found \(3,\)$"):
        inertial_parameters.check(flat._replace(rotational=np.zeros(3)))
