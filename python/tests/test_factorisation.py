"""Tests of the factors of M and of divide and conquer: solutions and errors."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sample import Robot
from test_model import PENDULUM

import condyle

SOLVED = {"rtol": 1e-8, "atol": 1e-8}
"""Tolerance for rounding errors after a solve with M, whose condition number is up to 1e4."""


def factors(robot: Robot) -> tuple[list[Any], NDArray[np.float64]]:
    """Returns an `Ltdl` and a `Cholesky` of M, for which `factorize` was called, and M itself."""
    M = condyle.crba(robot.model, robot.data, robot.q)
    made: list[Any] = [condyle.Ltdl(robot.model), condyle.Cholesky(robot.model.nv)]
    for factor in made:
        factor.factorize(M)
    return made, M


def test_solves(robot: Robot) -> None:
    (sparse, dense), M = factors(robot)
    B = np.random.default_rng(0).standard_normal((robot.model.nv, 3))
    for factor in (sparse, dense):
        np.testing.assert_allclose(M @ factor.solve(robot.tau), robot.tau, **SOLVED)
        np.testing.assert_allclose(M @ factor.solve_matrix(B), B, **SOLVED)
        np.testing.assert_allclose(factor.inverse(), condyle.minv(robot.model, robot.data, robot.q), **SOLVED)
        out = np.empty(robot.model.nv)
        assert factor.solve(robot.tau, out=out) is out
        assert np.array_equal(out, factor.solve(robot.tau))
        b = robot.tau.copy()
        assert np.array_equal(factor.solve(b, out=b), out)


def test_the_factors_themselves(robot: Robot) -> None:
    (sparse, dense), M = factors(robot)
    np.testing.assert_allclose(dense.lower @ dense.lower.T, M, **SOLVED)
    assert np.array_equal(dense.lower, np.tril(dense.lower))
    n = robot.model.nv
    assert sparse.order == list(range(n))
    L = np.eye(n)
    for k in range(n):
        for place, number in sparse.row(k):
            L[k, place] = number
    np.testing.assert_allclose(L.T @ np.diag(sparse.diagonal) @ L, M, **SOLVED)
    assert sparse.nonzeros == n + sum(len(sparse.row(k)) for k in range(n))


def test_wrong_use(quadruped: Robot) -> None:
    made: tuple[Any, Any] = (condyle.Ltdl(quadruped.model), condyle.Cholesky(18))
    for factor in made:
        for call in (lambda f: f.solve(np.ones(18)), lambda f: f.inverse(), lambda f: f.solve_matrix(np.eye(18))):
            with pytest.raises(RuntimeError, match="^nothing to solve with: call `factorize` first$"):
                call(factor)
        with pytest.raises(ValueError, match=r"^M: expected shape \(18, 18\), found \(17, 17\)$"):
            factor.factorize(np.eye(17))
        factor.factorize(np.eye(18))
        with pytest.raises(ValueError, match=r"^b: expected shape \(18,\), found \(17,\)$"):
            factor.solve(np.ones(17))
        with pytest.raises(ValueError, match=r"^B: expected shape \(18, 2\), found \(17, 2\)$"):
            factor.solve_matrix(np.ones((17, 2)))
    with pytest.raises(IndexError, match="^k: expected less than 18, found 18$"):
        made[0].row(18)


@pytest.mark.parametrize("grain", [0, 1, 3, 100])
def test_divide_and_conquer(robot: Robot, grain: int) -> None:
    model, data, q, v, _, tau, f_ext = robot
    divided = condyle.DivideConquer(model, grain)
    size = divided.size
    assert size.bodies == model.nbodies - 1
    assert size.longest_run <= max(grain, 1)
    expected = condyle.aba(model, data, q, v, tau, f_ext)
    np.testing.assert_allclose(divided.aba(model, q, v, tau, f_ext), expected, **SOLVED)
    out = np.empty(model.nv)
    assert divided.aba(model, q, v, tau, out=out) is out
    weightless = model.with_gravity([0, 0, 0])
    expected = condyle.aba(weightless, data, q, v, tau)
    np.testing.assert_allclose(divided.aba(weightless, q, v, tau), expected, **SOLVED)


def test_divide_and_conquer_refuses(quadruped: Robot) -> None:
    model, _, q, v, _, tau, _ = quadruped
    with pytest.raises(
        ValueError, match=r"^DivideConquer: made for another model \('arm7'\), not for this 'quadruped'$"
    ):
        condyle.DivideConquer(condyle.robots.arm7(), 1).aba(model, q, v, tau)
    with pytest.raises(ValueError, match=r"^tau: expected shape \(18,\), found \(17,\)$"):
        condyle.DivideConquer(model, 1).aba(model, q, v, tau[1:])
    singular = condyle.Model.from_urdf_str(PENDULUM)
    with pytest.raises(condyle.ModelError, match="singular$"):
        condyle.DivideConquer(singular, 1).aba(singular, [0, 0], [0, 0], [0, 0])


def test_divide_and_conquer_with_followers() -> None:
    model = condyle.Model.from_urdf_str(PENDULUM, mimic=True)
    assert model.nv == 1
    expected = condyle.aba(model, condyle.Data(model), [0.3], [0.2], [1.0])
    np.testing.assert_allclose(condyle.DivideConquer(model, 1).aba(model, [0.3], [0.2], [1.0]), expected, **SOLVED)


@pytest.mark.parametrize("method", [None, "aba", "dense", "sparse"])
def test_methods_of_forward_dynamics(robot: Robot, method: Any) -> None:
    model, data, q, v, _, tau, f_ext = robot
    a = condyle.forward_dynamics(model, data, q, v, tau, f_ext, method)
    np.testing.assert_allclose(a, condyle.aba(model, data, q, v, tau, f_ext), **SOLVED)


def test_no_such_method(quadruped: Robot) -> None:
    model, data, q, v, _, tau, _ = quadruped
    with pytest.raises(ValueError, match="^method: expected None, 'aba', 'dense' or 'sparse', found 'crba'$"):
        condyle.forward_dynamics(model, data, q, v, tau, method="crba")  # type: ignore[arg-type]
