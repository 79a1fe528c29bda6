"""Tests of knots of optimal control as `casadi.Function`s: values, first and second derivatives, and sparsity. Optima
are compared with optima that FDDP finds.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

casadi = pytest.importorskip("casadi")
sys.path.append(str(Path(__file__).parents[1] / "examples"))

from gait import Gait  # noqa: E402

import condyle  # noqa: E402
import condyle.casadi  # noqa: E402
from condyle import ContactConstraint, Joint, ModelBuilder  # noqa: E402
from condyle.optimal import (  # noqa: E402
    Action,
    Activation,
    ConstrainedAction,
    ContactDynamics,
    ContactInverseDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    ImpulseDynamics,
    Limit,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    Unicycle,
)

# Tolerance for numbers up to some hundreds that two methods compute.
ROUNDING = 1e-9
# Step and tolerance of central differences, also of second derivatives of some thousands. See test_casadi.py.
STEP = 1e-5
DIFFERENCES = 1e-6
# Tolerance for optima. IPOPT's tolerance is 1e-8 for scaled equations, FDDP's is 1e-9 for the expected change of cost.
OPTIMUM = 1e-6
# Tolerance for motions: the relative error of the cost is 1e-8, so controls are less accurate where the cost is flat.
MOTION = 1e-3

ARM, QUADRUPED = condyle.robots.arm7(), condyle.robots.quadruped()
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
STANDING = np.r_[condyle.neutral(QUADRUPED), np.zeros(QUADRUPED.nv)]


def groups() -> condyle.Model:
    """Returns a chain with one joint of each kind that has a quaternion or a pair (cos, sin) in its position."""
    builder, body = ModelBuilder("groups"), condyle.WORLD
    at = np.eye(4)
    at[:3, 3] = [0.1, -0.2, 0.3]
    for name, joint in {
        "base": Joint.free_flyer(),
        "wheel": Joint.continuous([0.0, 0.6, 0.8]),
        "table": Joint.planar(),
        "ball": Joint.spherical(),
        "hinge": Joint.revolute([1.0, 0.0, 0.0]),
    }.items():
        inertia = condyle.Inertia.from_com(1.5, [0.1, 0.2, -0.1], np.diag([0.2, 0.3, 0.4]))
        body = builder.body(name, body, joint, at, inertia)
    return builder.build()


GROUPS = groups()


def costs(model: condyle.Model, rest: np.ndarray, frame: str | None = None) -> list[Cost]:
    moves = [] if frame is None else [Cost("tip", 3.0, Residual.frame_translation(model, frame, [0.3, 0.2, 0.4]))]
    return [Cost("rest", 0.7, Residual.state(rest)), *moves]


def effort(nu: int) -> Cost:
    return Cost("effort", 1e-2, Residual.control(np.ones(nu)))


FEET = {foot: ContactConstraint(foot, "point", None, "local_world_aligned", kd=4.0) for foot in ("LF_foot", "RH_foot")}
OF_ARM, OF_QUADRUPED = costs(ARM, REST, "tool"), costs(QUADRUPED, STANDING, "LF_foot")
OF_GROUPS = costs(GROUPS, np.r_[condyle.neutral(GROUPS), np.zeros(GROUPS.nv)])
DRIVEN = QUADRUPED.nv - 6
STANCE = [*OF_QUADRUPED, effort(DRIVEN), Cost("force", 1e-3, Residual.contact_force("LF_foot"))]
KNOTS: dict[str, tuple[Any, condyle.Model | None]] = {
    "arm": (FreeDynamics(ARM, 0.05, [*OF_ARM, effort(7)]), ARM),
    "arm, Runge-Kutta": (FreeDynamics(ARM, 0.05, OF_ARM, integrator="runge_kutta_4"), ARM),
    "arm, accelerations": (FreeInverseDynamics(ARM, 0.05, OF_ARM), ARM),
    "quadruped flies": (FreeDynamics(QUADRUPED, 0.02, OF_QUADRUPED), QUADRUPED),
    "quadruped stands": (ContactDynamics(QUADRUPED, FEET, 0.02, STANCE), QUADRUPED),
    "quadruped stands, forces are controls": (ContactInverseDynamics(QUADRUPED, FEET, 0.02, OF_QUADRUPED), QUADRUPED),
    "quadruped lands": (ImpulseDynamics(QUADRUPED, FEET, OF_QUADRUPED), QUADRUPED),
    "groups": (FreeDynamics(GROUPS, 0.05, OF_GROUPS), GROUPS),
    "unicycle": (Unicycle(0.1), None),
    "lqr": (Lqr([[1.0, 0.1], [0.0, 1.0]], [[0.0], [0.1]], Q=np.eye(2), R=[[0.3]], q=[0.1, 0.2]), None),
}
# Knots for which Condyle provides all second derivatives of the next state.
CURVED = ["arm", "arm, accelerations", "quadruped flies", "groups", "unicycle", "lqr"]


def sizes(name: str) -> tuple[int, int]:
    f = condyle.casadi.knot(KNOTS[name][0])
    return f.numel_in(0), f.numel_in(1) if f.n_in() > 1 else 0


def arguments(name: str, stretch: float = 1.0) -> list[np.ndarray]:
    """Returns the arguments of a knot's function: a random state, and controls. Quaternions and pairs (cos, sin) have
    the length `stretch`.
    """
    (nx, nu), robot, rng = sizes(name), KNOTS[name][1], np.random.default_rng(7)
    x, u = rng.standard_normal(nx), rng.standard_normal(nu)
    if robot is not None:
        x[: robot.nq] = condyle.random_configuration(robot, seed=3) * stretch
    return [x, u] if nu else [x]


def stacked(f: Any) -> tuple[Any, Any, Any]:
    """Returns a vector of all arguments, a vector of all results, and a vector of multipliers."""
    x = casadi.MX.sym("x", sum(f.numel_in(k) for k in range(f.n_in())))
    parts = casadi.vertsplit(x, np.cumsum([0, *(f.numel_in(k) for k in range(f.n_in()))]).tolist())
    y = casadi.vertcat(*f.call(parts))
    return x, y, casadi.MX.sym("l", y.numel())


def central(f: Callable[[np.ndarray], Any], x: np.ndarray) -> np.ndarray:
    columns = [(np.array(f(x + step)) - np.array(f(x - step))).ravel() / (2 * STEP) for step in STEP * np.eye(len(x))]
    return np.stack(columns, axis=1)


def close(found: Any, expected: Any, tolerance: float) -> bool:
    found, expected = np.array(casadi.densify(casadi.DM(found))), np.array(expected)
    return bool(np.abs(found.ravel() - expected.ravel()).max() <= tolerance * (1 + np.abs(expected).max()))


def end(name: str) -> Any:
    robot = KNOTS[name][1]
    if robot is not None:
        return FreeDynamics(robot, None, [])
    return Unicycle(terminal=True) if name == "unicycle" else Lqr(np.eye(2), Q=np.eye(2))


each = pytest.mark.parametrize("name", KNOTS)


@each
def test_values_are_those_of_a_problem(name: str) -> None:
    model, (x, *u) = KNOTS[name][0], arguments(name)
    expected = Problem(x, [model], [0], end(name)).evaluate([x, x], [u[0] if u else []])
    found, cost = condyle.casadi.knot(model)(x, *u)
    assert close(found, expected.next_states[0], ROUNDING)
    assert close(cost, expected.costs[0], ROUNDING)


@each
@pytest.mark.parametrize("stretch", [1.0, 1.1])
def test_first_derivatives(name: str, stretch: float) -> None:
    x, y, multipliers = stacked(condyle.casadi.knot(KNOTS[name][0]))
    value = casadi.Function("value", [x], [y])
    jacobian = casadi.Function("jacobian", [x], [casadi.jacobian(y, x)])
    point, rng = np.concatenate(arguments(name, stretch)), np.random.default_rng(5)
    J = np.array(casadi.densify(jacobian(point)))
    assert close(J, central(value, point), DIFFERENCES)
    direction, weights = rng.standard_normal(len(point)), rng.standard_normal(y.numel())
    d = casadi.MX.sym("d", x.numel())
    forward = casadi.Function("forward", [x, d], [casadi.jtimes(y, x, d)])
    reverse = casadi.Function("reverse", [x, multipliers], [casadi.jtimes(y, x, multipliers, True)])
    assert close(forward(point, direction), J @ direction, ROUNDING)
    assert close(reverse(point, weights), J.T @ weights, ROUNDING)


@pytest.mark.parametrize("name", ["arm", "arm, accelerations", "unicycle"])
def test_first_derivatives_are_those_of_a_problem(name: str) -> None:
    """Checks that the function's first derivatives equal A, B, q and r of the problem's `LqKnot`, and that the Hessian
    of the cost consists of the knot's Q, S and R. The test uses only robots without quaternions.
    """
    model, (x, u) = KNOTS[name][0], arguments(name)
    node = Problem(x, [model], [0], end(name)).derivatives([x, x], [u])[0]
    f = condyle.casadi.knot(model)
    z, y, multipliers = stacked(f)
    J = np.array(casadi.densify(casadi.Function("J", [z], [casadi.jacobian(y, z)])(np.r_[x, u])))
    assert close(J[:-1], np.hstack([node.A, node.B]), ROUNDING)
    assert close(J[-1], np.r_[node.q, node.r], ROUNDING)
    hessian = casadi.Function("H", [z, multipliers], [casadi.hessian(casadi.dot(multipliers, y), z)[0]])
    last = np.r_[np.zeros(len(J) - 1), 2.0]
    assert close(hessian(np.r_[x, u], last), 2.0 * np.block([[node.Q, node.S], [node.S.T, node.R]]), ROUNDING)


@pytest.mark.parametrize("name", CURVED)
def test_second_derivatives_of_the_next_state(name: str) -> None:
    x, y, multipliers = stacked(condyle.casadi.knot(KNOTS[name][0]))
    hessian, gradient = casadi.hessian(casadi.dot(multipliers, y), x)
    hessian = casadi.Function("hessian", [x, multipliers], [hessian])
    gradient = casadi.Function("gradient", [x, multipliers], [gradient])
    weights = np.random.default_rng(4).standard_normal(y.numel())
    weights[-1] = weights[-1] if KNOTS[name][1] is None else 0.0  # not compared for a robot: its Hessian is approximate
    for stretch in (1.0, 1.1):
        point = np.concatenate(arguments(name, stretch))
        found = np.array(casadi.densify(hessian(point, weights)))
        assert close(found, central(lambda x: gradient(x, weights), point), DIFFERENCES)
        assert close(found, found.T, ROUNDING)


def test_ends_have_a_cost_only() -> None:
    f = condyle.casadi.knot(FreeDynamics(ARM, None, OF_ARM))
    x = arguments("arm")[0]
    assert (f.n_in(), f.n_out()) == (1, 1)
    expected = Problem(x, [KNOTS["arm"][0]], [0], FreeDynamics(ARM, None, OF_ARM)).evaluate([x, x], [np.zeros(7)])
    assert close(f(x), expected.costs[1], ROUNDING)
    z = casadi.MX.sym("x", 14)
    slope = casadi.Function("slope", [z], [casadi.gradient(f(z), z)])
    assert close(slope(x), central(f, x), DIFFERENCES)


def test_zeros_of_a_knot() -> None:
    lands = condyle.casadi.knot(KNOTS["quadruped lands"][0]).jacobian()
    nq, nv = QUADRUPED.nq, QUADRUPED.nv
    # q⁺ = q: each number depends on itself, and each number of the quaternion on all four numbers of the quaternion
    # v⁺ depends on the whole state except the position of the trunk
    assert lands.nnz_out(0) <= (nq - 4) + 16 + nv * (nq + nv - 3)
    given = condyle.casadi.knot(KNOTS["arm, accelerations"][0]).jacobian()
    assert given.nnz_out(0) == 3 * 7  # nonzeros: 1 and Δt for q⁺, 1 for v⁺
    assert given.nnz_out(1) == 2 * 7  # nonzeros: Δt² for q⁺, Δt for v⁺


def test_a_knot_is_that_of_its_number() -> None:
    x, u = arguments("arm")
    targets = {t: [Cost("tool", 1.0, Residual.frame_translation(ARM, "tool", [0.1 * t, 0.2, 0.5]))] for t in range(4)}
    step, last = FreeDynamics(ARM, 0.05, [], costs_at=targets), FreeDynamics(ARM, None, OF_ARM)
    problem = Problem(x, [step], [0] * 4, last)
    costs = problem.evaluate(np.tile(x, (5, 1)), np.tile(u, (4, 1))).costs
    for t in range(4):
        assert close(condyle.casadi.knot(problem, t)(x, u)[1], costs[t], ROUNDING)
        assert close(condyle.casadi.knot(step, t)(x, u)[1], costs[t], ROUNDING)
    assert close(condyle.casadi.knot(problem, 4)(x), costs[4], ROUNDING)
    each = condyle.casadi.knot(step, None)
    assert close(each.map(4)(np.tile(x[:, None], 4), np.tile(u[:, None], 4), np.arange(4))[1], costs[:4], ROUNDING)
    assert each.jacobian().nnz_out(2) == each.jacobian().nnz_out(5) == 0  # the derivatives with respect to t are zero
    with pytest.raises(ProblemError, match="t: expected 0 to 4, found 5"):
        condyle.casadi.knot(problem, 5)
    with pytest.raises(ProblemError, match="t: expected the number of a knot of the problem, found None"):
        condyle.casadi.knot(problem, None)


def test_one_knot_is_one_slot() -> None:
    step = KNOTS["arm"][0]
    problem = Problem(REST, [step], [0] * 3, FreeDynamics(ARM, None, []))
    first, second, end = (condyle.casadi.knot(problem, t) for t in (0, 2, 3))
    assert first.name() == second.name() == condyle.casadi.knot(step).name() != end.name()


def test_limits_and_constraints_are_the_optimisers() -> None:
    x, u = arguments("arm")
    limit = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -1e-3), upper=np.full(7, 1e-3))
    plain, limited = (FreeDynamics(ARM, 0.05, OF_ARM, limits=limits) for limits in (None, [limit]))
    around = ConstrainedAction(plain, 1, lambda t, x, u: x[:1] - 9.0)
    expected = [np.array(part) for part in condyle.casadi.knot(plain)(x, u)]
    for action in (limited, around):
        for found, value in zip(condyle.casadi.knot(action)(x, u), expected, strict=True):
            assert np.array_equal(np.array(found), value)


def test_what_is_no_knot() -> None:
    own = Cost("own", 1.0, Residual.own(1, lambda t, x, u: x[:1]))
    for action in (Action(1, 1, lambda t, x, u: (x + u, x @ x)), FreeDynamics(ARM, 0.05, [own])):
        with pytest.raises(ProblemError, match="written in Python, which CasADi does not call"):
            condyle.casadi.knot(action)
    with pytest.raises(TypeError, match="action: expected an action or a Problem, found 'float'"):
        condyle.casadi.knot(1.0)  # type: ignore[arg-type]


def test_many_threads() -> None:
    f, states = condyle.casadi.knot(KNOTS["quadruped stands"][0]), 32
    rng = np.random.default_rng(6)
    q = np.stack([condyle.random_configuration(QUADRUPED, seed=k) for k in range(states)], axis=1)
    x, u = np.vstack([q, rng.standard_normal((QUADRUPED.nv, states))]), rng.standard_normal((DRIVEN, states))
    for serial, parallel in zip(f.map(states)(x, u), f.map(states, "thread", 4)(x, u), strict=True):
        assert np.array_equal(np.array(serial), np.array(parallel))


def shot(problem: Problem, xs: np.ndarray, us: list[np.ndarray]) -> tuple[float, np.ndarray]:
    """Returns the cost and the states of a problem's optimum, found by multiple shooting with IPOPT."""
    opti, x = casadi.Opti(), []
    total, following = casadi.MX(0), casadi.MX(xs[0])
    for t in range(problem.horizon):
        f = condyle.casadi.knot(problem, t)
        x.append(opti.variable(f.numel_in(0)))
        opti.set_initial(x[t], xs[t])
        controls = [opti.variable(f.numel_in(1))] if f.n_in() > 1 else []
        for u in controls:
            opti.set_initial(u, us[t])
        opti.subject_to(x[t] == following)
        following, cost = f(x[t], *controls)
        total += cost
    last = condyle.casadi.knot(problem, problem.horizon)
    x.append(opti.variable(last.numel_in(0)))
    opti.set_initial(x[-1], xs[-1])
    opti.subject_to(x[-1] == following)
    opti.minimize(total + last(x[-1]))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 300})
    solution = opti.solve()
    return float(solution.value(opti.f)), np.array([solution.value(state) for state in x])


def test_a_reach_by_shooting_is_that_of_fddp() -> None:
    tool = Cost("tool", 1e2, Residual.frame_translation(ARM, "tool", [0.4, -0.2, 0.4]))
    step = FreeDynamics(ARM, 0.05, [tool, Cost("rest", 1e-1, Residual.state(REST)), effort(7)])
    problem = Problem(REST, [step], [0] * 15, FreeDynamics(ARM, None, [tool, Cost("end", 1.0, Residual.state(REST))]))
    xs, us = np.tile(REST, (16, 1)), np.tile(step.quasi_static(REST), (15, 1))
    found = Fddp(problem).solve(xs, us)
    assert found.status == "converged"
    cost, states = shot(problem, xs, list(us))
    assert abs(cost - found.cost) < OPTIMUM * found.cost
    assert np.abs(states - found.xs).max() < MOTION


def test_a_step_of_a_quadruped_by_shooting_is_that_of_fddp() -> None:
    """Compares a motion with contacts, an impact and a free-flyer: stance on four feet, a step of two feet, their
    impact, and stance again.
    """
    q = condyle.neutral(QUADRUPED)
    q[7:] = np.tile([0.0, 0.6, -1.2], 4)
    gait = Gait(QUADRUPED, q, ["LF_foot", "LH_foot", "RF_foot", "RH_foot"], 0.03)
    gait.stand(2)
    gait.step([0, 3], 0.05, 0.03, 5)
    gait.stand(2)
    rest = Cost("rest", 1e2, Residual.state(gait.x0), Activation.weighted(np.full(36, 1.0)))
    problem = Problem(gait.x0, gait.models, gait.knot_models, FreeDynamics(QUADRUPED, None, [rest]))
    xs = np.tile(gait.x0, (len(gait.knot_models) + 1, 1))
    found = Fddp(problem, tolerance=1e-8).solve(xs, gait.us)
    assert found.status == "converged"
    cost, states = shot(problem, xs, gait.us)
    assert abs(cost - found.cost) < OPTIMUM * found.cost
    assert np.abs(np.linalg.norm(states[:, 3:7], axis=1) - 1.0).max() < 1e-6  # knots keep the length at 1
    assert np.abs(states - found.xs).max() < MOTION
