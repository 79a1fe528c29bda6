"""Tests of user-defined actions: derivatives of calc, spaces of states, and calls for a whole horizon at once."""

import pickle
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    DifferentialAction,
    Fddp,
    Lqr,
    Problem,
    ProblemError,
    ode_action,
    thrusters,
)

# Exact derivatives agree with given derivatives up to rounding. Central differences agree up to a relative error of
# 1e-6.
EXACT = 1e-12
DIFFERENCES = 1e-5
ARM = condyle.robots.arm7()
QUADRUPED = condyle.robots.quadruped()


def unicycle(t: Any, x: Any, u: Any) -> Any:
    cost = 0.5 * (10.0 * (x @ x) + u @ u)
    if len(u) == 0:
        return None, cost
    return np.array([x[0] + 0.1 * np.cos(x[2]) * u[0], x[1] + 0.1 * np.sin(x[2]) * u[0], x[2] + 0.1 * u[1]]), cost


def unicycle_diff(t: Any, x: Any, u: Any) -> Any:
    d = {"q": 10.0 * x, "Q": 10.0 * np.eye(3)}
    if len(u):
        A, B = np.eye(3), np.zeros((3, 2))
        A[0, 2], A[1, 2] = -0.1 * np.sin(x[2]) * u[0], 0.1 * np.cos(x[2]) * u[0]
        B[0, 0], B[1, 0], B[2, 1] = 0.1 * np.cos(x[2]), 0.1 * np.sin(x[2]), 0.1
        d |= {"A": A, "B": B, "r": u, "R": np.eye(2)}
    return d


def solved(knot: Action, end: Action) -> Any:
    problem = Problem([-1.0, -1.0, 1.0], [knot], [0] * 20, end)
    return Fddp(problem).solve(np.zeros((21, 3)), np.zeros((20, 2)))


def nodes(knot: Any, xs: Any, us: Any, end: Any) -> Any:
    return Problem(xs[0], [knot], [0] * len(us), end).derivatives(xs, us)


def assert_same(ours: Any, expected: Any, tolerance: float) -> None:
    for one, other in zip(ours, expected, strict=True):
        for name in ("A", "B", "q", "r", "Q", "S", "R"):
            a, b = np.array(getattr(one, name)), np.array(getattr(other, name))
            np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * (1.0 + abs(b).max(initial=0.0)), err_msg=name)


def test_derivatives_of_calc_are_those_that_were_written() -> None:
    one = solved(Action(3, 2, unicycle), Action(3, 0, unicycle))
    other = solved(Action(3, 2, unicycle, unicycle_diff), Action(3, 0, unicycle, unicycle_diff))
    assert one.status == other.status == "converged" and len(one.trace) == len(other.trace) > 3
    np.testing.assert_allclose(one.xs, other.xs, rtol=0, atol=1e-10)


FUNCTIONS = [
    "sin cos tan arcsin arccos arctan sinh cosh tanh arcsinh arctanh exp exp2 expm1 sqrt cbrt log log2 log10 log1p",
    "square absolute negative",
]


@pytest.mark.parametrize("name", " ".join(FUNCTIONS).split())
def test_elementary_functions(name: str) -> None:
    f = getattr(np, name)

    def calc(t: Any, x: Any, u: Any) -> Any:
        y = f(0.3 + 0.4 * x[0] * u[0]) * x[1] + f(0.5 * x[1])
        return np.array([y, x[0]]), y / (2.0 + x[0]) - u[0] ** 3 + x[1] ** u[0] + 2.0 ** x[0] + 1.0 / u[0]

    check(calc)


@pytest.mark.parametrize(
    "f",
    [
        lambda x, y: np.arctan2(x, y) + np.arctan2(x, 0.3),
        lambda x, y: np.hypot(x, y) + np.hypot(x, 0.3),
        lambda x, y: np.maximum(x, 2.0 * y) + max(x, 0.1) - abs(x - y),
        lambda x, y: 3 - x + (2.0 - y) / x + y / 3 - x / y + np.float64(2.0) * x + np.arccosh(1.0 + x),
    ],
)
def test_functions_of_two(f: Any) -> None:
    check(lambda t, x, u: (np.array([f(x[0], x[1]), f(x[1], u[0])]), f(x[0], u[0]) * f(u[0], x[1])))


def check(calc: Any) -> None:
    """Compares derivatives of calc with central differences. One call of calc computes the derivatives at several
    knots.
    """

    def counted(t: Any, x: Any, u: Any) -> Any:
        calls.append(x.dtype)
        return calc(t, x, u)

    calls: list[Any] = []
    xs, us = np.array([[0.2, 0.6], [0.25, 0.5], [0.1, 0.7]]), np.array([[0.4], [0.35]])
    end = Lqr(np.zeros((2, 2)))
    ours = nodes(Action(2, 1, counted), xs, us, end)
    assert sum(dtype.kind == "O" for dtype in calls) == 1  # one call for both knots
    # calc converts its results to float, so only differences can be used
    plain = Action(2, 1, lambda t, x, u: tuple(np.asarray(y, float) if np.ndim(y) else float(y) for y in calc(t, x, u)))
    assert_same(ours, nodes(plain, xs, us, end), DIFFERENCES)


def test_what_depends_on_the_knot_is_called_for_each() -> None:
    goals = [0.1, 0.5, 0.9]

    def calc(t: Any, x: Any, u: Any) -> Any:
        return x + u * np.sin(x), (x[0] - goals[t]) ** 3

    xs, us = np.array([[0.2], [0.3], [0.4], [0.5]]), np.array([[0.4], [0.35], [0.3]])
    found = nodes(Action(1, 1, calc), xs, us, Lqr([[1.0]]))
    expected = [3.0 * (x - goal) ** 2 for x, goal in zip(xs[:3, 0], goals, strict=True)]
    np.testing.assert_allclose([node.q[0] for node in found[:3]], expected, rtol=EXACT)

    def branch(t: Any, x: Any, u: Any) -> Any:
        return (x * x if x[0] > 0.35 else x + u), x[0]

    found = nodes(Action(1, 1, branch), xs, us, Lqr([[1.0]]))
    np.testing.assert_allclose([node.A[0, 0] for node in found[:3]], [1.0, 1.0, 0.8], rtol=EXACT)


def test_dynamics_of_a_model_are_differentiated_by_hyper_dual_numbers() -> None:
    data = condyle.Data(ARM)

    def calc(t: Any, x: Any, u: Any) -> Any:
        a = condyle.aba(ARM, data, x[:7], x[7:], u)
        v = x[7:] + 0.05 * a
        return np.concatenate([x[:7] + 0.05 * v, v]), 0.5 * (u @ u)

    knot = condyle.optimal.FreeDynamics(ARM, 0.05, [])
    rng = np.random.default_rng(5)
    xs, us = rng.normal(size=(3, 14)), rng.normal(size=(2, 7))
    end = Lqr(np.zeros((14, 14)))
    for ours, expected in zip(nodes(Action(14, 7, calc), xs, us, end), nodes(knot, xs, us, end), strict=True):
        for name in ("A", "B"):
            np.testing.assert_allclose(getattr(ours, name), getattr(expected, name), rtol=0, atol=1e-10)


def planar(x: Any, dx: Any) -> Any:
    """Moves a point on a circle, (cos, sin), by an angle."""
    c, s = np.cos(dx[0]), np.sin(dx[0])
    return np.array([x[0] * c - x[1] * s, x[1] * c + x[0] * s])


def angle(x0: Any, x1: Any) -> Any:
    return np.array([np.arctan2(x0[0] * x1[1] - x0[1] * x1[0], x0[0] * x1[0] + x0[1] * x1[1])])


def test_states_on_a_circle_move_as_angles() -> None:
    def on_circle(t: Any, x: Any, u: Any) -> Any:
        cost = 1.0 - x[0] + 0.5 * (u @ u)
        return (planar(x, 0.1 * x[1:] + 0.1 * u) if len(u) else None), cost

    def by_angle(t: Any, x: Any, u: Any) -> Any:
        cost = 1.0 - np.cos(x[0]) + 0.5 * (u @ u)
        return (x + 0.1 * np.sin(x) + 0.1 * u if len(u) else None), cost

    space = (1, planar, angle)
    angles = np.linspace(2.0, 1.0, 6)[:, None]
    circle = np.hstack([np.cos(angles), np.sin(angles)])
    us = np.linspace(-0.3, 0.2, 5)[:, None]
    ours = nodes(Action(2, 1, on_circle, space=space), circle, us, Action(2, 0, on_circle, space=space))
    expected = nodes(Action(1, 1, by_angle), angles, us, Action(1, 0, by_angle))
    assert_same(ours, expected, 1e-11)
    np.testing.assert_allclose([n.f for n in ours], [n.f for n in expected], atol=1e-12)
    one = Problem(circle[0], [Action(2, 1, on_circle, space=space)], [0] * 5, Action(2, 0, on_circle, space=space))
    other = Problem(angles[0], [Action(1, 1, by_angle)], [0] * 5, Action(1, 0, by_angle))
    one, other = Fddp(one).solve(circle, us), Fddp(other).solve(angles, us)
    np.testing.assert_allclose([i.cost for i in one.trace], [i.cost for i in other.trace], rtol=1e-8)


def test_states_of_a_robot_have_its_tangent_space() -> None:
    """Compares a user-defined action of a free base, controlled by the base's velocity, with a built-in action with the
    same costs.
    """
    nq, nv = QUADRUPED.nq, QUADRUPED.nv
    rest = np.r_[condyle.neutral(QUADRUPED), np.zeros(nv)]
    ours = condyle.optimal.FreeInverseDynamics(QUADRUPED, 0.05, [])

    def calc(t: Any, x: Any, u: Any) -> Any:
        v = x[nq:] + 0.05 * u
        return np.concatenate([condyle.integrate(QUADRUPED, x[:nq], 0.05 * v), v]), 0.0

    rng = np.random.default_rng(3)
    q = condyle.integrate(QUADRUPED, rest[:nq], rng.normal(size=nv))
    xs = np.tile(np.r_[q, rng.normal(size=nv)], (2, 1))
    end = condyle.optimal.FreeDynamics(QUADRUPED, None, [])
    us = rng.normal(size=(1, nv))
    found = nodes(Action(nq + nv, nv, calc, space=QUADRUPED), xs, us, end)
    assert_same(found, nodes(ours, xs, us, end), 1e-10)
    with pytest.raises(ValueError, match="nx: expected 37, as the states of space, found 36"):
        Action(36, 1, calc, space=QUADRUPED)
    with pytest.raises(TypeError, match="space: expected a Model, or a tuple"):
        Action(36, 1, calc, space=3)  # type: ignore[arg-type]


def test_a_whole_horizon_at_once() -> None:
    sizes = []

    def calc(t: Any, x: Any, u: Any) -> Any:
        sizes.append(len(x))
        cost = 0.5 * (10.0 * (x * x).sum(axis=1) + (u * u).sum(axis=1))
        if u.shape[1] == 0:
            return None, cost
        step = [x[:, 0] + 0.1 * np.cos(x[:, 2]) * u[:, 0], x[:, 1] + 0.1 * np.sin(x[:, 2]) * u[:, 0]]
        return np.stack([*step, x[:, 2] + 0.1 * u[:, 1]], axis=1), cost

    def calc_diff(t: Any, x: Any, u: Any) -> Any:
        each = [unicycle_diff(*one) for one in zip(t, x, u, strict=True)]
        return {name: np.stack([one[name] for one in each]) for name in each[0]}

    expected = solved(Action(3, 2, unicycle, unicycle_diff), Action(3, 0, unicycle, unicycle_diff))
    for derivatives in (None, calc_diff):
        sizes.clear()
        found = solved(Action(3, 2, calc, derivatives, batch=True), Action(3, 0, calc, derivatives, batch=True))
        np.testing.assert_allclose(found.xs, expected.xs, rtol=0, atol=1e-10)
        assert 20 in sizes


@pytest.mark.parametrize(
    ("calc", "error", "text"),
    [
        (lambda t, x, u: None, TypeError, r"calc of knot 0: expected a pair \(next state, cost\), found None"),
        (lambda t, x, u: (x, "low"), TypeError, "calc of knot 0: the cost: expected a number, found <class 'str'>"),
        (lambda t, x, u: (np.zeros(3), 0.0), ValueError, r"calc of knot 0: the next state: expected shape \(1,\)"),
        (lambda t, x, u: (None, 0.0), ValueError, "calc of knot 0: the next state: expected 1 numbers, found None"),
    ],
)
def test_wrong_results_are_named(calc: Any, error: type[Exception], text: str) -> None:
    problem = Problem([1.0], [Action(1, 1, calc)], [0] * 3, Lqr([[1.0]], Q=[[1.0]]))
    with pytest.raises(error, match=text):
        Fddp(problem).solve(np.zeros((4, 1)), np.zeros((3, 1)))


@pytest.mark.parametrize(
    ("calc_diff", "error", "text"),
    [
        (lambda t, x, u: 3, TypeError, "calc_diff of knot 0: expected a dict, found <class 'int'>"),
        (lambda t, x, u: {"C": 1}, ValueError, "calc_diff of knot 0: expected A, B, Q, S, R, q or r, found 'C'"),
        (lambda t, x, u: {"A": [1.0]}, ValueError, r"calc_diff of knot 0: A: expected shape \(1, 1\), found \(1,\)"),
    ],
)
def test_wrong_derivatives_are_named(calc_diff: Any, error: type[Exception], text: str) -> None:
    knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * (u @ u)), calc_diff)
    problem = Problem([1.0], [knot], [0] * 3, Lqr([[1.0]], Q=[[1.0]]))
    with pytest.raises(error, match=text):
        Fddp(problem).solve(np.zeros((4, 1)), np.zeros((3, 1)))


def test_an_interrupt_in_a_derivative_is_no_reason_for_differences() -> None:
    def calc(t: Any, x: Any, u: Any) -> Any:
        if x.dtype.kind == "O":
            raise KeyboardInterrupt
        return x + u, 0.5 * (u @ u)

    problem = Problem([1.0], [Action(1, 1, calc)], [0] * 3, Lqr([[1.0]], Q=[[1.0]]))
    with pytest.raises(KeyboardInterrupt):
        Fddp(problem).solve(np.zeros((4, 1)), np.zeros((3, 1)))


def test_an_action_has_a_repr_and_a_pickle() -> None:
    knot = Action(3, 2, unicycle, unicycle_diff, lower=[-1.0, -1.0])
    again = pickle.loads(pickle.dumps(knot))
    assert repr(again) == repr(knot) == "<condyle.optimal.Action nx 3, nu 2, calc_diff>"
    end = Action(3, 0, unicycle)
    one, other = solved(knot, end), solved(again, pickle.loads(pickle.dumps(end)))
    np.testing.assert_array_equal(one.xs, other.xs)
    robot = Action(37, 1, unicycle, space=QUADRUPED, batch=True)
    text = "<condyle.optimal.Action nx 37, ndx 36, nu 1, derivatives of calc, all knots at once>"
    assert repr(pickle.loads(pickle.dumps(robot))) == repr(robot) == text
    assert repr(pickle.loads(pickle.dumps(Action(2, 1, unicycle, space=(1, planar, angle))))).startswith("<condyle")


def test_differential_equations_of_first_order() -> None:
    """Compares the step of a linear equation with a power series, and the step of an equation of motion with
    `DifferentialAction`.
    """

    def decay(t: Any, x: Any, u: Any) -> Any:
        return u - x, 0.0

    orders = {"euler": 1, "runge_kutta_2": 2, "runge_kutta_3": 3, "runge_kutta_4": 4}
    for scheme, order in orders.items():
        knot = ode_action(1, 1, decay, 0.3, scheme)  # type: ignore[arg-type]
        found = Problem([1.0], [knot], [0], Lqr([[1.0]])).rollout([[0.0]])[1, 0]
        series = sum((-0.3) ** k / np.prod(np.arange(1, k + 1, dtype=float)) for k in range(order + 1))
        np.testing.assert_allclose(found, series, rtol=1e-14)

    def acceleration(t: Any, x: Any, u: Any) -> Any:
        return np.array([u[0] - np.sin(x[0])]), 0.5 * (x @ x) + 0.5 * (u @ u)

    def rate(t: Any, x: Any, u: Any) -> Any:
        a, cost = acceleration(t, x, u)
        return np.concatenate([x[1:], a]), cost

    xs, us = np.array([[0.4, 0.2], [0.3, 0.1], [0.2, 0.0]]), np.array([[0.5], [0.1]])
    end = Lqr(np.eye(2))
    for scheme in list(orders)[1:]:
        ours = nodes(ode_action(2, 1, rate, 0.1, scheme), xs, us, end)  # type: ignore[arg-type]
        knot = DifferentialAction(1, 1, acceleration, 0.1, integrator=scheme)  # type: ignore[arg-type]
        expected = nodes(knot, xs, us, end)
        for one, other in zip(ours[:2], expected[:2], strict=True):
            for name in ("A", "B", "f", "q", "r"):
                np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-12)
    with pytest.raises(ProblemError, match="dt: expected more than 0 seconds, found 0.0"):
        ode_action(1, 1, decay, 0.0)
    with pytest.raises(ValueError, match="integrator: expected one of 'euler', .*, found 'heun'"):
        ode_action(1, 1, decay, 0.1, "heun")  # type: ignore[arg-type]


def test_thrusters_push_and_turn() -> None:
    place = np.eye(4)
    place[:3, :3] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]  # the thrust axis is the base's x axis
    place[:3, 3] = [0.1, 0.2, 0.3]
    S = thrusters(QUADRUPED, [place, np.eye(4)], [0.5, -0.25])
    np.testing.assert_allclose(S[:6, 0], [1.0, 0.0, 0.0, 0.5, 0.3, -0.2], atol=1e-15)
    np.testing.assert_allclose(S[:6, 1], [0.0, 0.0, 1.0, 0.0, 0.0, -0.25], atol=1e-15)
    np.testing.assert_array_equal(S[6:, 2:], np.eye(12))
    fly = condyle.optimal.FreeDynamics(QUADRUPED, 0.1, [], actuation=thrusters(QUADRUPED, [np.eye(4)], joints=False))
    rest = np.r_[condyle.neutral(QUADRUPED), np.zeros(18)]
    end = condyle.optimal.FreeDynamics(QUADRUPED, None, [])
    lift = Problem(rest, [fly], [0], end).evaluate(np.tile(rest, (2, 1)), [[9.81 * QUADRUPED.total_mass]])
    assert abs(lift.efforts[0][2] - 9.81 * QUADRUPED.total_mass) < 1e-9
    with pytest.raises(ProblemError, match="expected a robot whose root joint is a free-flyer"):
        thrusters(ARM, [place])
    with pytest.raises(ProblemError, match=r"placements\[1\]: expected a homogeneous matrix"):
        thrusters(QUADRUPED, [place, np.ones((3, 3))])
