"""Tests of actions in continuous time that are written in Python, with the library's integrators."""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import Cost, DifferentialAction, Fddp, FreeDynamics, Problem, ProblemError, Residual

ARM = condyle.robots.arm7()
SCHEMES = ("semi_implicit_euler", "runge_kutta_2", "runge_kutta_3", "runge_kutta_4")
# Tolerance for exact derivatives that are summed in another order.
EXACT = 1e-10
DIFFERENCES = 1e-5


def pendulum(t: Any, x: Any, u: Any) -> Any:
    cost = 1.0 - np.cos(x[0]) + 0.5 * x[1] ** 2 + 0.5 * u @ u
    return np.array([u[0] - np.sin(x[0]) - 0.1 * x[1] ** 3]), cost


def pendulum_diff(t: Any, x: Any, u: Any) -> Any:
    return {
        "da_dq": [[-np.cos(x[0])]],
        "da_dv": [[-0.3 * x[1] ** 2]],
        "da_du": [[1.0]],
        "q": np.array([np.sin(x[0]), x[1]]),
        "Q": np.diag([np.cos(x[0]), 1.0]),
        "r": u,
        "R": [[1.0]],
    }


def as_floats(t: Any, x: Any, u: Any) -> Any:
    a, cost = pendulum(t, x, u)
    return np.asarray(a, dtype=float), float(cost)


def nodes(knot: Any, nx: int = 2) -> Any:
    end = DifferentialAction(nx // 2, 0, lambda t, x, u: (None, 0.5 * (x @ x)), None)
    rng = np.random.default_rng(7)
    xs, us = rng.normal(size=(4, nx)), rng.normal(size=(3, 7 if nx == 14 else 1))
    return Problem(xs[0], [knot], [0] * 3, end).derivatives(xs, us)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(("calc", "tolerance"), [(pendulum, EXACT), (as_floats, DIFFERENCES)])
def test_derivatives_of_calc_are_those_that_were_written(scheme: Any, calc: Any, tolerance: float) -> None:
    ours = nodes(DifferentialAction(1, 1, calc, 0.1, integrator=scheme))
    expected = nodes(DifferentialAction(1, 1, pendulum, 0.1, pendulum_diff, scheme))
    for one, other in zip(ours, expected, strict=True):
        assert one.rows is None and other.rows is None
        for a, b in zip(one[:8], other[:8], strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=tolerance)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_robot_written_in_python_moves_as_the_librarys(scheme: Any) -> None:
    data = condyle.Data(ARM)

    def calc(t: Any, x: Any, u: Any) -> Any:
        return condyle.aba(ARM, data, x[:7], x[7:], u), 0.0

    for model in (ARM, None):
        ours = nodes(DifferentialAction(7, 7, calc, 0.05, integrator=scheme, model=model), 14)
        expected = nodes(FreeDynamics(ARM, 0.05, [], integrator=scheme), 14)
        for one, other in zip(ours[:3], expected[:3], strict=True):
            for name in ("A", "B", "f"):
                a, b = getattr(one, name), getattr(other, name)
                np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * (1.0 + np.abs(b).max()), err_msg=name)


def test_a_free_base_has_its_tangent_space() -> None:
    quadruped = condyle.robots.quadruped()
    nq, nv = quadruped.nq, quadruped.nv
    data = condyle.Data(quadruped)

    def calc(t: Any, x: Any, u: Any) -> Any:
        return condyle.aba(quadruped, data, x[:nq], x[nq:], np.concatenate([np.zeros(6), u])), 0.0

    rng = np.random.default_rng(2)
    x0 = np.r_[condyle.integrate(quadruped, condyle.neutral(quadruped), 0.3 * rng.normal(size=nv)), rng.normal(size=nv)]
    end = FreeDynamics(quadruped, None, [])
    xs, us = np.tile(x0, (2, 1)), rng.normal(size=(1, 12))
    knots = [DifferentialAction(nv, 12, calc, 0.02, model=quadruped), FreeDynamics(quadruped, 0.02, [])]
    one, other = (Problem(x0, [knot], [0], end).derivatives(xs, us)[0] for knot in knots)
    for name in ("A", "B", "f"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-8 * (1.0 + np.abs(b).max()), err_msg=name)


def test_a_swing_up() -> None:
    knot = DifferentialAction(1, 1, pendulum, 0.1, lower=[-2.0], upper=[2.0])
    end = DifferentialAction(1, 0, lambda t, x, u: (None, 10.0 * ((x[0] - np.pi) ** 2 + x[1] ** 2)), None)
    problem = Problem([0.0, 0.0], [knot], [0] * 60, end)
    solution = Fddp(problem).solve(np.zeros((61, 2)), np.zeros((60, 1)))
    assert solution.status == "converged" and abs(solution.us).max() <= 2.0
    np.testing.assert_allclose(problem.rollout(solution.us), solution.xs, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "error", "text"),
    [
        (lambda: DifferentialAction(1, 1, pendulum, -0.1), ProblemError, "its duration must be above 0"),
        (lambda: DifferentialAction(1, 1, pendulum, None), ValueError, "nu: expected 0 for a terminal knot"),
        (
            lambda: DifferentialAction(6, 1, pendulum, 0.1, model=ARM),
            ValueError,
            "nv: expected 7, as of model, found 6",
        ),
        (lambda: DifferentialAction(1, 1, pendulum, 0.1, integrator="euler"), ValueError, "integrator: expected"),
    ],
)
def test_what_does_not_fit_is_refused(make: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        make()


@pytest.mark.parametrize(
    ("calc", "calc_diff", "text"),
    [
        (lambda t, x, u: x, None, r"calc of knot 0: expected a pair|calc of knot 0: the cost"),
        (lambda t, x, u: (x, 0.0), None, r"calc of knot 0: the accelerations: expected shape \(1,\), found \(2,\)"),
        (lambda t, x, u: (None, 0.0), None, "calc of knot 0: the accelerations: expected 1 numbers, found None"),
        (pendulum, lambda t, x, u: {"Fx": x}, "calc_diff of knot 0: expected da_dq, da_dv, .*found 'Fx'"),
        (pendulum, lambda t, x, u: {"da_dq": x}, r"calc_diff of knot 0: da_dq: expected shape \(1, 1\)"),
    ],
)
def test_wrong_results_are_named(calc: Any, calc_diff: Any, text: str) -> None:
    knot = DifferentialAction(1, 1, calc, 0.1, calc_diff)
    end = DifferentialAction(1, 0, lambda t, x, u: (None, 0.0), None)
    problem = Problem([1.0, 0.0], [knot], [0] * 3, end)
    with pytest.raises((ValueError, TypeError), match=text):
        Fddp(problem).solve(np.zeros((4, 2)), np.zeros((3, 1)))


def test_second_order_of_accelerations_written_in_python() -> None:
    data = condyle.Data(ARM)

    def arm(t: Any, x: Any, u: Any) -> Any:
        return condyle.aba(ARM, data, x[:7], x[7:], u), 0.5 * (0.1 * x @ x + 1e-2 * u @ u)

    rest = [Cost("x", 0.1, Residual.state(np.zeros(14))), Cost("u", 1e-2, Residual.control(np.zeros(7)))]
    last = FreeDynamics(ARM, None, [Cost("x", 1.0, Residual.state(np.full(14, 0.1)))])
    x0 = np.r_[0.3 * np.ones(7), np.zeros(7)]
    traces = []
    for knot in (DifferentialAction(7, 7, arm, 0.05), FreeDynamics(ARM, 0.05, rest)):
        problem = Problem(x0, [knot], [0] * 4, last)
        solver = Fddp(problem, max_iterations=4, second_order=True, inverse_dynamics_form=False)
        traces.append(solver.solve(np.tile(x0, (5, 1)), np.zeros((4, 7))).trace)
    np.testing.assert_allclose([i.cost for i in traces[0]], [i.cost for i in traces[1]], rtol=1e-9)
    np.testing.assert_array_equal([i.step for i in traces[0]], [i.step for i in traces[1]])


@pytest.mark.parametrize("controls", ["linear", "quadratic"])
def test_controls_that_are_a_polynomial(controls: Any) -> None:
    ours = DifferentialAction(1, 1, pendulum, 0.1, integrator="runge_kutta_4", upper=[2.0], controls=controls)
    end = DifferentialAction(1, 0, lambda t, x, u: (None, 0.5 * (x @ x)), None)
    problem, n = Problem([1.0, 0.0], [ours], [0] * 3, end), {"linear": 2, "quadratic": 3}[controls]
    at = problem.derivatives(np.ones((4, 2)), np.ones((3, n)))[0]
    assert at.B.shape == (2, n) and at.R.shape == (n, n)
    constant = DifferentialAction(1, 1, pendulum, 0.1, integrator="runge_kutta_4")
    same = Problem([1.0, 0.0], [constant], [0] * 3, end).derivatives(np.ones((4, 2)), np.ones((3, 1)))[0]
    np.testing.assert_allclose(at.B.sum(axis=1), same.B[:, 0], atol=1e-14)
    np.testing.assert_allclose(at.R.sum(), same.R[0, 0], atol=1e-14)
