"""Tests of the interior point from Python: conditions of optimality by differences for all robots, infeasible
problems, receding horizons, and invalid arguments.
"""

import pickle
import signal
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from optimality import Case, conditions, constraints, violation

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ConstrainedAction,
    ContactDynamics,
    ContactInverseDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    FrictionCone,
    ImpulseDynamics,
    InteriorPoint,
    Limit,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    Unicycle,
    WrenchCone,
)

ARM, QUADRUPED, HUMANOID = condyle.robots.arm7(), condyle.robots.quadruped(), condyle.robots.humanoid()
X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
DT = 0.05
FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
SOLES = ["left_sole", "right_sole"]
NONE, UNBOUNDED = np.zeros(0), np.full(7, np.inf)
SETTINGS = [
    *("tolerance", "max_iterations", "barrier_start", "tick_barrier", "second_order"),
    *("inverse_dynamics_form", "time_budget", "threads", "regularisation_min", "regularisation_max"),
]
# Tolerance of the gradient and of complementarity, and of violations.
DUAL, PRIMAL = 1e-6, 1e-7


def tool(x: np.ndarray) -> np.ndarray:
    return condyle.frame_placement(ARM, condyle.Data(ARM), x[:7], "tool")[:3, 3]


def arm() -> Case:
    """Returns an arm that reaches a point and stops there, with limits on efforts and velocities."""
    target, knots, weak, fast = np.array([0.35, 0.2, 0.6]), 12, np.full(7, 30.0), np.r_[UNBOUNDED, np.full(7, 1.5)]
    costs = [Cost("rest", 1e-1, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    limits = [
        Limit("weak", Residual.control(np.zeros(7)), -weak, weak),
        Limit("fast", Residual.state(np.zeros(14)), -fast, fast),
    ]
    stop = np.r_[UNBOUNDED, np.zeros(7)]
    ends = [
        Limit("reach", Residual.frame_translation(ARM, "tool", target)),
        Limit("stop", Residual.state(np.zeros(14)), -stop, stop),
    ]

    def make(limits: list[Limit], ends: list[Limit]) -> Problem:
        knot = FreeDynamics(ARM, DT, costs, limits=limits)
        return Problem(X0, [knot], [0] * knots, FreeDynamics(ARM, None, [], limits=ends))

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        return np.r_[u, x] if t < knots else np.r_[tool(x) - target, x]

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        upper = np.r_[weak, fast] if t < knots else np.r_[np.zeros(3), stop]
        return -upper, upper

    still = FreeDynamics(ARM, DT, []).quasi_static(X0)
    return Case(
        make(limits, ends), np.tile(X0, (knots + 1, 1)), np.tile(still, (knots, 1)), make([], []), ARM, rows, bounds
    )


def standing() -> np.ndarray:
    q = condyle.neutral(QUADRUPED)
    q[8::3], q[9::3] = 0.7, -1.4  # joint angles with bent knees
    return np.r_[q, np.zeros(18)]


def feet() -> dict[str, condyle.ContactConstraint]:
    return {f: condyle.ContactConstraint(f, "point", reference="local_world_aligned", kd=20.0) for f in FEET}


def center(model: condyle.Model, x: np.ndarray) -> np.ndarray:
    return condyle.centroidal_map(model, condyle.Data(model), x[: model.nq]).com


CONE = FrictionCone(0.25, least=5.0)
PYRAMID = np.array([[1.0, 0, -0.25], [-1.0, 0, -0.25], [0, 1.0, -0.25], [0, -1.0, -0.25], [0, 0, 1.0]])
STRONG = 25.0


def quadruped() -> Case:
    """Returns a quadruped that moves its centre of mass, with friction cones and bounds on its controls."""
    x0, knots = standing(), 12
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    goal = center(QUADRUPED, x0) + np.array([0.04, 0.01, -0.01])
    grips = [Limit(foot, Residual.friction_cone(foot, CONE)) for foot in FEET]
    ahead = Limit("ahead", Residual.center_of_mass(goal))

    def make(limits: list[Limit], ends: list[Limit], bound: float) -> Problem:
        upper = np.full(12, bound)
        knot = ContactDynamics(QUADRUPED, feet(), 0.02, costs, lower=-upper, upper=upper, limits=limits)
        return Problem(x0, [knot], [0] * knots, FreeDynamics(QUADRUPED, None, [], limits=ends))

    def rows(t: int, x: np.ndarray, u: np.ndarray, at: Any) -> np.ndarray:
        if t == knots:
            return center(QUADRUPED, x) - goal
        return np.r_[np.ravel([PYRAMID @ at.forces[t][foot] for foot in FEET]), u]

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == knots:
            return np.zeros(3), np.zeros(3)
        lower, upper = np.r_[np.full(4, -np.inf), 5.0], np.r_[np.zeros(4), np.inf]
        return np.r_[np.tile(lower, 4), np.full(12, -STRONG)], np.r_[np.tile(upper, 4), np.full(12, STRONG)]

    still = ContactDynamics(QUADRUPED, feet(), 0.02, []).quasi_static(x0)
    start = np.tile(x0, (knots + 1, 1)), np.tile(still, (knots, 1))
    return Case(make(grips, [ahead], STRONG), *start, make([], [], np.inf), QUADRUPED, rows, bounds)


def humanoid() -> Case:
    """Returns a humanoid on both soles that moves its centre of mass, with wrench cones and limits of joints."""
    q, knots = condyle.neutral(HUMANOID), 8
    for side in ("left", "right"):
        for joint, angle in (("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4)):
            q[7 + HUMANOID.names.index(f"{side}_{joint}") - 2] = angle
    x0 = np.r_[q, np.zeros(38)]
    contacts = {f: condyle.ContactConstraint(f, "rigid", reference="local_world_aligned", kd=20.0) for f in SOLES}
    cone = WrenchCone(FrictionCone(0.5, least=20.0), [0.16, 0.08])
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-4, Residual.control(np.zeros(32)))]
    costs.append(Cost("smooth", 1e-4, Residual.joint_acceleration(np.zeros(38))))
    goal = center(HUMANOID, x0) + np.array([0.01, 0.03, -0.01])
    slow = np.r_[np.full(38, np.inf), np.full(38, 0.6)]
    limits = [Limit(sole, Residual.wrench_cone(sole, cone)) for sole in SOLES]
    limits.append(Limit("slow", Residual.state(x0), -slow, slow))
    aside = Limit("aside", Residual.center_of_mass(goal))

    def make(limits: list[Limit], ends: list[Limit]) -> Problem:
        knot = ContactDynamics(HUMANOID, contacts, 0.03, costs, limits=limits)
        return Problem(x0, [knot], [0] * knots, FreeDynamics(HUMANOID, None, [], limits=ends))

    def rows(t: int, x: np.ndarray, _: np.ndarray, at: Any) -> np.ndarray:
        if t == knots:
            return center(HUMANOID, x) - goal
        turn = condyle.difference(HUMANOID, x0[:39], x[:39])
        return np.r_[np.ravel([cone.rows() @ at.forces[t][sole] for sole in SOLES]), turn, x[39:]]

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == knots:
            return np.zeros(3), np.zeros(3)
        lower, upper = cone.bounds()
        return np.r_[lower, lower, -slow], np.r_[upper, upper, slow]

    still = ContactDynamics(HUMANOID, contacts, 0.03, []).quasi_static(x0)
    start = np.tile(x0, (knots + 1, 1)), np.tile(still, (knots, 1))
    return Case(make(limits, [aside]), *start, make([], []), HUMANOID, rows, bounds)


def cartpole() -> Case:
    """Returns a cart on a short rail that swings its pole up, from a file."""
    builder = condyle.ModelBuilder("cartpole")
    cart = condyle.Inertia.from_com(1.0, [0.0, 0.0, 0.0], 0.01 * np.eye(3))
    rod = condyle.Inertia.from_com(0.2, [0.0, 0.0, -0.4], 0.01 * np.eye(3))
    body = builder.body("cart", condyle.WORLD, condyle.Joint.prismatic([1.0, 0.0, 0.0]), inertia=cart)
    builder.body("pole", body, condyle.Joint.revolute([0.0, 1.0, 0.0]), inertia=rod)
    model, x0, knots = builder.build(), np.zeros(4), 50
    rail, force = np.r_[1.0, np.full(3, np.inf)], 10.0
    limit = Limit("rail", Residual.state(x0), -rail, rail)
    upright = Limit("upright", Residual.state([0.0, np.pi, 0.0, 0.0]))

    def make(limits: list[Limit], ends: list[Limit], bound: float) -> Problem:
        costs = [Cost("effort", 1e-1, Residual.control([0.0]))]
        push = {"actuation": np.array([[1.0], [0.0]]), "lower": [-bound], "upper": [bound]}
        knot = FreeDynamics(model, 0.04, costs, limits=limits, **push)
        problem = Problem(x0, [knot], [0] * knots, FreeDynamics(model, None, [], limits=ends))
        return Problem.from_json(problem.to_json())

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        return np.r_[x, u] if t < knots else x - np.array([0.0, np.pi, 0.0, 0.0])

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        upper = np.r_[rail, force] if t < knots else np.zeros(4)
        return -upper, upper

    xs = np.linspace(x0, [0.0, np.pi, 0.0, 0.0], knots + 1)  # breaks the dynamics
    free = make([], [], np.inf)
    return Case(make([limit], [upright], force), xs, np.zeros((knots, 1)), free, None, rows, bounds)


def accelerations() -> Case:
    """Returns an arm whose controls are accelerations, with limits on its efforts."""
    target, knots, weak = np.array([0.35, 0.2, 0.6]), 12, np.array([30.0] * 4 + [8.0] * 3)
    costs = [Cost("rest", 1e-1, Residual.state(X0)), Cost("effort", 1e-3, Residual.joint_effort(np.zeros(7)))]
    costs.append(Cost("smooth", 1e-4, Residual.joint_acceleration(np.zeros(7))))
    limit = Limit("weak", Residual.joint_effort(np.zeros(7)), -weak, weak)
    reach = Limit("reach", Residual.frame_translation(ARM, "tool", target))

    def make(limits: list[Limit], ends: list[Limit]) -> Problem:
        knot = FreeInverseDynamics(ARM, DT, costs, limits=limits)
        return Problem(X0, [knot], [0] * knots, FreeDynamics(ARM, None, [], limits=ends))

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        return condyle.rnea(ARM, condyle.Data(ARM), x[:7], x[7:], u) if t < knots else tool(x) - target

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        upper = weak if t < knots else np.zeros(3)
        return -upper, upper

    start = np.tile(X0, (knots + 1, 1)), np.zeros((knots, 7))
    return Case(make([limit], [reach]), *start, make([], []), ARM, rows, bounds)


def forces() -> Case:
    """Returns a quadruped whose controls are accelerations and contact forces, so that dynamics and contacts are
    equations.
    """
    x0, knots, data = standing(), 8, condyle.Data(QUADRUPED)
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.joint_effort(np.zeros(18)))]
    costs.append(Cost("smooth", 1e-4, Residual.control(np.zeros(30))))
    goal = center(QUADRUPED, x0) + np.array([0.02, 0.01, -0.01])
    knot = ContactInverseDynamics(
        QUADRUPED, feet(), 0.02, costs, limits=[Limit(foot, Residual.friction_cone(foot, CONE)) for foot in FEET]
    )
    ahead = Limit("ahead", Residual.center_of_mass(goal))
    problem = Problem(x0, [knot], [0] * knots, FreeDynamics(QUADRUPED, None, [], limits=[ahead]))
    free = Problem(
        x0, [ContactInverseDynamics(QUADRUPED, feet(), 0.02, costs)], [0] * knots, FreeDynamics(QUADRUPED, None, [])
    )

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        if t == knots:
            return center(QUADRUPED, x) - goal
        q, v, a, f = x[:19], x[19:], u[:18], u[18:].reshape(4, 3)
        effort, held = condyle.rnea(QUADRUPED, data, q, v, a), []
        for foot, force in zip(FEET, f, strict=True):
            J = condyle.frame_jacobian(QUADRUPED, data, q, foot, reference="local_world_aligned")[:3]
            effort = effort - J.T @ force
            along = condyle.frame_classical_acceleration(
                QUADRUPED, data, q, v, a, foot, reference="local_world_aligned"
            )
            held.append(along[:3] + 20.0 * (J @ v))
        return np.r_[effort[:6], np.ravel(held), np.ravel(f @ PYRAMID.T)]

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == knots:
            return np.zeros(3), np.zeros(3)
        lower, upper = np.r_[np.full(4, -np.inf), 5.0], np.r_[np.zeros(4), np.inf]
        return np.r_[np.zeros(18), np.tile(lower, 4)], np.r_[np.zeros(18), np.tile(upper, 4)]

    start = np.tile(x0, (knots + 1, 1)), np.tile(knot.quasi_static(x0), (knots, 1))
    return Case(problem, *start, free, QUADRUPED, rows, bounds, kept=18)


def landing() -> Case:
    """Returns a quadruped that falls, lands on all feet at once, and stands. The impact has no controls."""
    x0, flight, stance = standing(), 4, 4
    data = condyle.Data(QUADRUPED)
    ground = condyle.frame_placement(QUADRUPED, data, x0[:19], "LF_foot")[2, 3]
    x0[2] += 0.01
    knots = flight + 1 + stance
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    landed = [
        Limit(
            f"{foot} down",
            Residual.frame_translation(QUADRUPED, foot, [0.0, 0.0, ground]),
            [-np.inf, -np.inf, 0.0],
            [np.inf, np.inf, 0.0],
        )
        for foot in FEET
    ]
    grips = [Limit(foot, Residual.friction_cone(foot, CONE)) for foot in FEET]

    def make(grips: list[Limit], landed: list[Limit]) -> Problem:
        falls = FreeDynamics(QUADRUPED, 0.0125, costs)
        impact = ImpulseDynamics(QUADRUPED, feet(), [], limits=landed)
        stands = ContactDynamics(QUADRUPED, feet(), 0.02, costs, limits=grips)
        end = FreeDynamics(QUADRUPED, None, costs[:1])
        return Problem(x0, [falls, impact, stands], [0] * flight + [1] + [2] * stance, end)

    def rows(t: int, x: np.ndarray, _: np.ndarray, at: Any) -> np.ndarray:
        if t == flight:
            places = [condyle.frame_placement(QUADRUPED, data, x[:19], foot)[:3, 3] for foot in FEET]
            return np.ravel(np.array(places) - np.array([0.0, 0.0, ground]))
        return np.ravel([PYRAMID @ at.forces[t][foot] for foot in FEET]) if flight < t < knots else NONE

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == flight:
            upper = np.tile([np.inf, np.inf, 0.0], 4)
            return -upper, upper
        if not flight < t < knots:
            return NONE, NONE
        lower, upper = np.r_[np.full(4, -np.inf), 5.0], np.r_[np.zeros(4), np.inf]
        return np.tile(lower, 4), np.tile(upper, 4)

    still = ContactDynamics(QUADRUPED, feet(), 0.02, []).quasi_static(standing())
    us = [np.zeros(12)] * flight + [NONE] + [still] * stance
    xs = np.tile(x0, (knots + 1, 1))
    xs[flight:, 2] -= 0.01
    return Case(make(grips, landed), xs, us, make([], []), QUADRUPED, rows, bounds)


def unicycle() -> Case:
    """Returns a unicycle that passes a disc, with constraints that are written in Python."""
    x0, knots, disc, radius = np.array([-1.0, -0.5, 0.3]), 20, np.array([-0.5, -0.2]), 0.25

    def far(t: int, x: Any, u: Any) -> np.ndarray:
        d = x[:2] - disc
        return np.r_[d @ d]

    def make(limited: bool) -> Problem:
        knot: Any = Unicycle(0.1, (1.0, 0.5))
        if limited:
            knot = ConstrainedAction(knot, 1, far, lower=[radius**2])
            knot = ConstrainedAction(knot, 2, lambda t, x, u: u, lower=[-0.2, -1.5], upper=[1.2, 1.5])
        end: Any = Unicycle(terminal=True)
        end = ConstrainedAction(end, 2, lambda t, x, u: x[:2]) if limited else end
        return Problem(x0, [knot], [0] * knots, end)

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        return np.r_[far(t, x, u), u] if t < knots else x[:2]

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == knots:
            return np.zeros(2), np.zeros(2)
        return np.array([radius**2, -0.2, -1.5]), np.array([np.inf, 1.2, 1.5])

    xs = np.linspace(x0, np.zeros(3), knots + 1)
    return Case(make(True), xs, np.tile([0.5, 0.0], (knots, 1)), make(False), None, rows, bounds)


def own() -> Case:
    """Returns an `Action` that is written in Python, with an inequality of states and controls, and bounds of `Lqr`
    knots.
    """
    A, B = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.0], [0.1]])
    x0, knots = np.array([1.0, 0.5]), 30

    def calc(t: int, x: Any, u: Any) -> tuple[Any, Any]:
        return np.array([x[0] + 0.1 * x[1], x[1] + 0.1 * u[0]]), 0.05 * (x @ x) + 0.005 * (u @ u)

    def make(limited: bool) -> Problem:
        knot: Any = Action(2, 1, calc)
        bound = 3.0 if limited else np.inf
        late: Any = Lqr(A, B=B, Q=0.1 * np.eye(2), R=[[0.01]], lower=[-bound], upper=[bound])
        if limited:
            knot = ConstrainedAction(knot, 2, lambda t, x, u: np.array([x[1], u[0] + 2.0 * x[0]]), lower=[-0.6, -1.8])
        return Problem(x0, [knot, late], [0] * 25 + [1] * 5, Lqr(np.eye(2), Q=np.eye(2)))

    def rows(t: int, x: np.ndarray, u: np.ndarray, _: Any) -> np.ndarray:
        return NONE if t == knots else np.array([x[1], u[0] + 2.0 * x[0]]) if t < 25 else u

    def bounds(t: int) -> tuple[np.ndarray, np.ndarray]:
        if t == knots:
            return NONE, NONE
        return (np.array([-0.6, -1.8]), np.full(2, np.inf)) if t < 25 else (np.array([-3.0]), np.array([3.0]))

    return Case(make(True), np.tile(x0, (knots + 1, 1)), np.zeros((knots, 1)), make(False), None, rows, bounds)


CASES = [arm, quadruped, humanoid, cartpole, accelerations, forces, landing, unicycle, own]


@pytest.mark.parametrize("make", CASES)
def test_a_solution_satisfies_the_conditions_of_optimality(make: Callable[[], Case]) -> None:
    case = make()
    solver = InteriorPoint(case.problem, tolerance=DUAL)
    solution = solver.solve(case.xs, case.us)
    outcome = solver.outcome
    assert solution.status == "converged"
    found = conditions(case, solution, outcome)
    assert found.gradient <= found.scale * DUAL
    assert found.complementarity <= found.scale * DUAL
    assert found.violation <= PRIMAL and found.gap <= DUAL
    # the outcome and the solution report the same numbers
    assert outcome.primal == pytest.approx(max(found.violation, found.gap), abs=1e-9)
    assert solution.gap == pytest.approx(found.gap, abs=1e-12)
    assert outcome.cost == solution.cost == pytest.approx(case.free.evaluate(solution.xs, solution.us).cost, rel=1e-9)
    assert outcome.iterations == len(solution.trace) > 0 and outcome.penalty == 0.0 < outcome.barrier <= 1e-6
    # the case is worth solving: some limits are active, some are not
    y = np.concatenate(outcome.multipliers)
    assert (np.abs(y) > 1e-4).any() and (np.abs(y) < 1e-4).any()


@pytest.mark.parametrize("make", [arm, cartpole, unicycle])
def test_the_outcome_reports_the_gradient(make: Callable[[], Case]) -> None:
    case = make()
    solver = InteriorPoint(case.problem, tolerance=1e-3)
    solution = solver.solve(case.xs, case.us)
    found = conditions(case, solution, solver.outcome)
    assert solution.status == "converged" and 1e-6 < found.gradient <= 1e-3 * found.scale
    assert solver.outcome.dual == pytest.approx(found.gradient, rel=1e-2)


# The augmented Lagrangian method needs more than a thousand iterations for the other cases.
@pytest.mark.parametrize("make", [arm, cartpole, accelerations, forces, landing, unicycle, own])
def test_the_cost_is_that_of_the_augmented_lagrangian(make: Callable[[], Case]) -> None:
    case = make()
    other = AugmentedLagrangian(case.problem, tolerance=1e-7, tolerance_dual=1e-6, inner={"max_iterations": 200})
    expected = other.solve(case.xs, case.us)
    assert expected.status == "converged"
    # the start is near this minimum, because a problem may have several
    ours = InteriorPoint(case.problem, tolerance=1e-7)
    assert ours.solve(expected.xs, expected.us).status == "converged"
    assert ours.outcome.cost == pytest.approx(other.outcome.cost, rel=1e-6)
    np.testing.assert_allclose(ours.solution.xs, expected.xs, atol=1e-2)


@pytest.mark.parametrize("make", CASES)
def test_threads_change_no_bit(make: Callable[[], Case]) -> None:
    case = make()
    one, two = (InteriorPoint(case.problem, threads=threads) for threads in (1, 2))
    a, b = one.solve(case.xs, case.us), two.solve(case.xs, case.us)
    assert a.status == b.status and a.trace == b.trace
    np.testing.assert_array_equal(a.xs, b.xs)
    for name in ("us", "K", "k"):
        for left, right in zip(getattr(a, name), getattr(b, name), strict=True):
            np.testing.assert_array_equal(left, right)
    for left, right in zip(one.outcome.multipliers, two.outcome.multipliers, strict=True):
        np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("settings", [{"second_order": True}, {"inverse_dynamics_form": False}, {"barrier_start": 1.0}])
@pytest.mark.parametrize("make", [arm, quadruped, cartpole])
def test_settings_change_the_way_and_not_the_solution(make: Callable[[], Case], settings: dict[str, Any]) -> None:
    case = make()
    usual = InteriorPoint(case.problem)
    usual.solve(case.xs, case.us)
    solver = InteriorPoint(case.problem, **settings)
    solution = solver.solve(usual.solution.xs, usual.solution.us)
    assert solution.status == "converged" and violation(case, solution.xs, solution.us) <= PRIMAL
    assert solution.cost == pytest.approx(usual.solution.cost, rel=1e-5)


def test_settings_change_between_solves() -> None:
    problem = tracking()
    xs = np.tile(X0, (problem.horizon + 1, 1))
    us = problem.quasi_static(xs)
    solver = InteriorPoint(problem, max_iterations=2)
    assert solver.solve(xs, us).status == "max_iterations" and len(solver.solution.trace) == 2
    solver.settings = {"max_iterations": 100, "time_budget": 60.0}
    assert solver.resume().status == "converged"
    assert list(solver.settings) == SETTINGS and solver.settings["time_budget"] == 60.0
    assert solver.settings["barrier_start"] is None and solver.settings["inverse_dynamics_form"] is True
    with pytest.raises(TypeError):
        solver.settings["tolerance"] = 1e-3  # type: ignore[index]
    wrong: list[tuple[dict[str, Any], type[Exception], str]] = [
        ({"tolerance": 1e-3, "barrier_start": 0.0}, ProblemError, "^setting `barrier_start` is "),
        ({"tolerance": 1e-3, "penalty": 1.0}, ValueError, "there is no setting 'penalty'"),
        ({"tolerance": 1e-3, "threads": "all"}, ValueError, "^settings: threads: expected a whole number"),
    ]
    for mapping, error, text in wrong:
        with pytest.raises(error, match=text):
            solver.settings = mapping
    assert solver.settings["tolerance"] == 1e-6
    again = pickle.loads(pickle.dumps(solver))
    assert dict(again.settings) == dict(solver.settings) and repr(again) == repr(solver)
    saved = solver.settings
    solver.settings = {"barrier_start": 1.0, "time_budget": None, "max_iterations": 1}
    assert len(solver.solve(xs, us).trace) == 1 and solver.settings["time_budget"] is None
    solver.settings = saved
    assert dict(solver.settings) == dict(saved)
    solver.settings = {"time_budget": 1e-9}
    assert solver.tick(5).status == "time_limit"


def test_a_constraint_may_be_constant() -> None:
    end = Lqr([[1.0]], Q=[[1.0]])
    knot = ConstrainedAction(Lqr([[1.0]], B=[[1.0]], R=[[1.0]]), 2, lambda t, x, u: np.r_[1.0, u], lower=[0.5, -0.1])
    problem = Problem([1.0], [knot], [0] * 5, end)
    solution = InteriorPoint(problem).solve(np.ones((6, 1)), np.zeros((5, 1)))
    assert solution.status == "converged"
    np.testing.assert_allclose(solution.us, -0.1, atol=1e-5)


def test_solvers_keep_what_they_are_given() -> None:
    case = arm()
    solver = InteriorPoint(case.problem, tolerance=1e-5, max_iterations=7, barrier_start=None, time_budget=None)
    assert repr(solver) == (
        f"<condyle.optimal.InteriorPoint of {case.problem!r}, tolerance 1e-05, max_iterations 7, "
        "barrier_start None, time_budget None>"
    )
    assert solver.solution is None
    again = pickle.loads(pickle.dumps(solver))
    assert repr(again) == repr(solver)
    one, other = solver.solve(case.xs, case.us), again.solve(case.xs, case.us)
    assert len(one.trace) == len(other.trace) <= 7
    np.testing.assert_array_equal(one.xs, other.xs)


@pytest.mark.parametrize("make", [arm, quadruped, humanoid, cartpole])
def test_a_limit_of_the_initial_state_cannot_be_changed(make: Callable[[], Case]) -> None:
    case = make()
    solver = InteriorPoint(case.problem)
    x0 = case.problem.x0.copy()
    lower, upper = case.bounds(0)
    entry = {"arm": 9, "humanoid": 38 + 9, "cartpole": 0}.get(make.__name__)
    if entry is None:  # no limit of the quadruped depends on the state alone
        assert solver.solve(case.xs, case.us).status == "converged"
        return
    name = {"arm": "fast", "humanoid": "slow", "cartpole": "rail"}[make.__name__]
    first = len(lower) - len(case.us[0]) * (make is cartpole) - case.problem.ndx
    excess = 0.005 if make is cartpole else 0.125  # the limit must hold at knot 1 again
    nq = len(x0) - case.problem.ndx // 2
    index = entry if entry < case.problem.ndx // 2 else nq + entry - case.problem.ndx // 2
    x0[index] = upper[first + entry] + excess
    case.problem.set_x0(x0)
    solution = solver.solve(case.xs, case.us)
    worst = solver.outcome.worst
    assert solution.status == "infeasible" and worst is not None
    assert (worst.kind, worst.knot, worst.name, worst.entry) == ("constraint", 0, name, entry)
    assert worst.row == first + entry and worst.amount == pytest.approx(excess, abs=1e-12)
    # all other limits hold
    g = constraints(case, np.array(solution.xs), [np.array(u) for u in solution.us])
    rest = max(np.max(np.maximum(case.bounds(t)[0] - g[t], g[t] - case.bounds(t)[1])) for t in range(1, len(g)))
    assert rest <= 1e-6


def beyond_reach() -> Problem:
    """Returns a problem whose arm must reach farther than it is long."""
    far = Limit("far", Residual.frame_translation(ARM, "tool", [3.0, 0.0, 0.0]))
    knot = FreeDynamics(ARM, DT, [Cost("effort", 1e-3, Residual.control(np.zeros(7)))])
    rest = Cost("rest", 1.0, Residual.state(X0))
    return Problem(X0, [knot], [0] * 5, FreeDynamics(ARM, None, [rest], limits=[far]))


def too_weak() -> Problem:
    """Returns a problem whose arm cannot hold its own weight, and must stay."""
    weak = Limit("weak", Residual.control(np.zeros(7)), np.full(7, -2.0), np.full(7, 2.0))
    near = np.r_[np.full(7, 0.01), UNBOUNDED]
    stay = Limit("stay", Residual.state(X0), -near, near)
    costs = [Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    knot = FreeDynamics(ARM, DT, costs, limits=[weak, stay])
    return Problem(X0, [knot], [0] * 8, FreeDynamics(ARM, None, [], limits=[stay]))


def against_each_other() -> Problem:
    """Returns a problem whose quadruped must jump, while its feet must push with little force."""
    x0 = standing()
    gentle = FrictionCone(0.25, greatest=20.0)
    limits = [Limit(foot, Residual.friction_cone(foot, gentle)) for foot in FEET]
    high = Limit("high", Residual.center_of_mass(center(QUADRUPED, x0)))
    costs = [Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    knot = ContactDynamics(QUADRUPED, feet(), 0.02, costs, limits=limits)
    return Problem(x0, [knot], [0] * 6, FreeDynamics(QUADRUPED, None, [], limits=[high]))


@pytest.mark.parametrize("make", [beyond_reach, too_weak, against_each_other])
def test_limits_that_contradict_each_other_are_never_satisfied(make: Callable[[], Problem]) -> None:
    problem = make()
    solver = InteriorPoint(problem)
    xs = np.tile(problem.x0, (problem.horizon + 1, 1))
    solution = solver.solve(xs, problem.quasi_static(xs))
    assert solution.status in ("infeasible", "constraints_violated", "regularisation_limit", "max_iterations")
    worst = solver.outcome.worst
    assert worst is not None and worst.amount == solver.outcome.primal > 1e-3
    assert worst.kind in ("constraint", "gap") and 0 <= worst.knot <= problem.horizon
    assert np.isfinite(solution.xs).all() and np.isfinite(solution.us).all() and np.isfinite(solution.cost)
    # the solver is not spoilt by the failure
    assert solver.resume().status != "converged"


def test_bounds_that_exclude_each_other_are_refused() -> None:
    knot = Action(1, 1, lambda t, x, u: (x + u, float(u @ u)))
    end = ConstrainedAction(Action(1, 0, lambda t, x, u: (None, 0.0)), 1, lambda t, x, u: x, lower=[2.0], upper=[1.0])
    problem = Problem([1.0], [knot], [0], end)
    with pytest.raises(ProblemError, match="knot 1: constraint 0 must be at least 2 and at most 1"):
        InteriorPoint(problem).solve(np.zeros((2, 1)), np.zeros((1, 1)))
    wrong = FreeDynamics(ARM, DT, [], lower=np.ones(7), upper=np.zeros(7))
    problem = Problem(X0, [wrong], [0], FreeDynamics(ARM, None, []))
    with pytest.raises(ProblemError, match="control 0 must be at least 1 and at most 0"):
        InteriorPoint(problem).solve(np.tile(X0, (2, 1)), np.zeros((1, 7)))


WEAK = np.array([15.0, 35.0, 10.0, 15.0, 1.2, 1.0, 0.5])


def tracking(limited: bool = True, knots: int = 15) -> Problem:
    """Returns an arm that moves to a point, with limits on its efforts and joints that can always be satisfied."""
    costs = [Cost("rest", 1.0, Residual.state(X0)), Cost("effort", 1e-2, Residual.control(np.zeros(7)))]
    costs.append(Cost("reach", 1e3, Residual.frame_translation(ARM, "tool", [0.4, 0.25, 0.55])))
    weak = [Limit("weak", Residual.control(np.zeros(7)), -WEAK, WEAK)] if limited else []
    knot, end = FreeDynamics(ARM, DT, costs, limits=weak), FreeDynamics(ARM, None, costs[::2])
    return Problem(X0, [knot], [0] * knots, end)


def loop(step: Callable[[InteriorPoint], Any], ticks: int = 40) -> tuple[float, float, list[Any]]:
    """Moves an arm for 40 ticks, with two kicks. Returns the cost, the largest violation by a control, and the
    solutions.
    """
    problem, plant = tracking(), tracking(limited=False, knots=1)
    solver = InteriorPoint(problem)
    xs = np.tile(X0, (problem.horizon + 1, 1))
    solution = solver.solve(xs, problem.quasi_static(xs))
    assert solution.status == "converged"
    x, cost, worst, solutions, rng = X0.copy(), 0.0, 0.0, [], np.random.default_rng(3)
    kicks = {t: 0.5 * rng.standard_normal(7) for t in (8, 22)}
    for t in range(ticks):
        u = np.array(solution.us[0])
        worst = max(worst, float(np.max(np.abs(u) - WEAK)))
        plant.set_x0(x)
        cost += plant.evaluate(np.vstack([x, x]), u[None]).costs[0]
        x = plant.rollout(u[None])[1]
        x[7:] += kicks.get(t, 0.0)
        solver.shift(0)
        problem.set_x0(x)
        solution = step(solver)
        solutions.append(solution)
    return cost, worst, solutions


def test_a_receding_horizon_stays_within_its_limits() -> None:
    cost, worst, solutions = loop(lambda solver: solver.resume())
    assert {solution.status for solution in solutions} == {"converged"}
    assert worst <= 1e-6 and np.isfinite(cost)
    for solution in solutions:
        assert (np.abs(np.array(solution.us)) - WEAK).max() <= 1e-6 and solution.gap <= 1e-6


@pytest.mark.parametrize("sweeps", [1, 2])
def test_ticks_follow_the_optimum(sweeps: int) -> None:
    best, _, converged = loop(lambda solver: solver.resume())
    assert sum((np.abs(np.array(solution.us)) > 0.999 * WEAK).sum() for solution in converged) > 20
    cost, worst, solutions = loop(lambda solver: solver.tick(sweeps))
    assert worst <= 1e-3
    assert cost == pytest.approx(best, rel=0.02)
    for solution in solutions:
        for numbers in (solution.xs, solution.us, solution.K, solution.k):
            assert np.isfinite(np.array(numbers)).all()
        assert solution.status in ("max_iterations", "converged") and np.isfinite(solution.cost)


def test_ticks_of_a_quadruped_do_not_slip() -> None:
    case = quadruped()
    x0, problem = case.problem.x0.copy(), case.problem
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    goal = Cost("ahead", 1e3, Residual.center_of_mass(center(QUADRUPED, x0) + np.array([0.03, 0.01, 0.0])))
    grips = [Limit(foot, Residual.friction_cone(foot, CONE)) for foot in FEET]
    knot = ContactDynamics(QUADRUPED, feet(), 0.02, [*costs, goal], limits=grips)
    plain = ContactDynamics(QUADRUPED, feet(), 0.02, costs)
    end = FreeDynamics(QUADRUPED, None, [costs[0], goal])
    problem, plant = Problem(x0, [knot], [0] * 10, end), Problem(x0, [plain], [0], FreeDynamics(QUADRUPED, None, []))
    solver = InteriorPoint(problem)
    xs = np.tile(x0, (11, 1))
    assert solver.solve(xs, problem.quasi_static(xs)).status == "converged"
    x, rng, worst = x0.copy(), np.random.default_rng(4), -np.inf
    for t in range(25):
        u = np.array(solver.solution.us[0])
        plant.set_x0(x)
        at = plant.evaluate(np.vstack([x, x]), u[None])
        rows = np.array([PYRAMID @ at.forces[0][foot] for foot in FEET])
        worst = max(worst, rows[:, :4].max(), (5.0 - rows[:, 4]).max())
        x = at.next_states[0]
        if t == 10:
            x[19:25] += 0.05 * rng.standard_normal(6)
        solver.shift(0)
        problem.set_x0(x)
        solver.tick(2)
    assert worst <= 1e-1  # N, of weights of 294 N
    ahead = center(QUADRUPED, x) - center(QUADRUPED, x0)
    np.testing.assert_allclose(ahead, [0.03, 0.01, 0.0], atol=5e-3)


def test_a_tick_needs_a_solution_and_a_step() -> None:
    case = arm()
    solver = InteriorPoint(case.problem)
    with pytest.raises(ProblemError):
        solver.tick()
    with pytest.raises(ProblemError):
        solver.resume()
    solver.solve(case.xs, case.us)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(solver.tick(0))).us.shape, (12, 7))
    with pytest.raises(OverflowError):
        solver.tick(-1)
    with pytest.raises(TypeError):
        solver.tick(1.5)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="there is no action model 4"):
        solver.shift(4)


def test_a_tick_reports_the_trajectory_before_it() -> None:
    problem, free = tracking(), tracking(limited=False)
    solver = InteriorPoint(problem)
    xs = np.tile(X0, (problem.horizon + 1, 1))
    before = solver.solve(xs, problem.quasi_static(xs))
    pushed = X0 + np.r_[np.zeros(7), np.full(7, 0.1)]
    problem.set_x0(pushed)
    free.set_x0(pushed)
    ticked = solver.tick()
    at = free.evaluate(np.vstack([pushed, before.xs[1:]]), before.us)
    assert ticked.cost == solver.outcome.cost == pytest.approx(at.cost, rel=1e-12)
    assert ticked.gap == solver.outcome.primal == pytest.approx(np.abs(at.gaps).max(), abs=1e-6)
    assert solver.outcome.dual == np.inf and len(ticked.trace) == solver.outcome.iterations == 0
    np.testing.assert_array_equal(ticked.xs[0], pushed)
    at = free.evaluate(ticked.xs, ticked.us)
    assert np.abs(at.gaps).max() < 0.5 and (np.abs(np.array(ticked.us)) <= WEAK).all()


def test_ticks_from_the_solution_stay_there() -> None:
    for make in (arm, quadruped, humanoid, cartpole):
        case = make()
        solver = InteriorPoint(case.problem, tolerance=1e-7)
        solution = solver.solve(case.xs, case.us)
        assert solution.status == "converged"
        for _ in range(12):
            solver.tick(2)
        at = case.free.evaluate(solver.solution.xs, solver.solution.us)
        assert at.cost == pytest.approx(solution.cost, rel=0.02) and np.abs(at.gaps).max() < 1e-5
        assert violation(case, solver.solution.xs, solver.solution.us) < 1e-5


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_starts_that_are_not_finite_are_refused(bad: float) -> None:
    case = arm()
    solver = InteriorPoint(case.problem)
    for name in ("xs", "us"):
        xs, us = case.xs.copy(), case.us.copy()
        (xs if name == "xs" else us)[3, 2] = bad
        with pytest.raises(ProblemError, match=name):
            solver.solve(xs, us)
    assert solver.solve(case.xs, case.us).status == "converged"


def test_starts_of_other_shapes_are_refused() -> None:
    case = arm()
    solver = InteriorPoint(case.problem)
    for xs, us in [
        (case.xs[1:], case.us),
        (case.xs[:, 1:], case.us),
        (case.xs, case.us[1:]),
        (case.xs, case.us[:, 1:]),
    ]:
        with pytest.raises(ValueError, match="expected"):
            solver.solve(xs, us)
    bad = [("tolerance", -1.0), ("barrier_start", 0.0), ("regularisation_min", 0.0), ("regularisation_max", 1e-30)]
    for name, value in [*bad, ("threads", 0), ("threads", 10**6), ("tolerance", np.nan)]:
        with pytest.raises(ProblemError, match=f"^setting `{name}` is "):
            InteriorPoint(case.problem, **{name: value})
    for name, value in [("tolerance", "small"), ("second_order", 1), ("max_iterations", -1), ("barrier_start", "low")]:
        with pytest.raises(ValueError, match=f"^settings: {name}: expected"):
            InteriorPoint(case.problem, **{name: value})
    with pytest.raises(ValueError, match="there is no setting 'penalty'; there are tolerance, max_iterations"):
        InteriorPoint(case.problem, penalty=1.0)


def test_a_callback_ends_a_solve() -> None:
    case = arm()
    solver, seen = InteriorPoint(case.problem), []

    def third(now: Any) -> bool | None:
        seen.append(now)
        return False if len(seen) == 3 else None

    solution = solver.solve(case.xs, case.us, callback=third)
    assert solution.status == "interrupted" and len(solution.trace) == len(seen) == 3
    assert solver.resume().status == "converged"
    with pytest.raises(ZeroDivisionError):
        solver.solve(case.xs, case.us, callback=lambda now: 1 / 0)
    assert solver.solve(case.xs, case.us).status == "converged"


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers are those of Unix")
def test_a_signal_ends_a_solve() -> None:
    def handler(_signal: int, _frame: Any) -> None:
        raise KeyboardInterrupt

    def calc(t: int, x: Any, u: Any) -> tuple[Any, Any]:
        time.sleep(1e-3)
        return x + u, u @ u

    knot = ConstrainedAction(Action(1, 1, calc), 1, lambda t, x, u: u, lower=[-1.0], upper=[1.0])
    problem = Problem([1.0], [knot], [0] * 30, Lqr([[1.0]], Q=[[1.0]]))
    solver = InteriorPoint(problem, tolerance=0.0, max_iterations=10**6, time_budget=20.0)
    before = signal.signal(signal.SIGALRM, handler)
    try:
        for call in (lambda: solver.solve(np.zeros((31, 1)), np.zeros((30, 1))), lambda: solver.tick(2)):
            signal.setitimer(signal.ITIMER_REAL, 0.02)
            begin = time.perf_counter()
            with pytest.raises(KeyboardInterrupt):
                call()
            assert time.perf_counter() - begin < 5.0
            assert solver.solution is not None and np.isfinite(solver.solution.xs).all()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("make", [arm, humanoid])
def test_without_time_a_solve_returns_what_it_has(make: Callable[[], Case]) -> None:
    case = make()
    solution = InteriorPoint(case.problem, time_budget=0.0).solve(case.xs, case.us)
    assert solution.status == "time_limit" and not solution.trace
    np.testing.assert_array_equal(solution.us, case.us)
    solver = InteriorPoint(case.problem, time_budget=1e-9)
    late = solver.solve(case.xs, case.us)
    assert late.status == "time_limit" and len(late.trace) == 1
    assert np.isfinite(late.xs).all() and np.isfinite(late.us).all() and np.isfinite(late.cost)
    assert 0.0 < late.timings.overrun <= late.timings.total
    ticked = solver.tick(5)
    assert ticked.status == "time_limit" and np.isfinite(ticked.xs).all()
    with pytest.raises(ValueError, match="time_budget: expected at least 0 seconds"):
        InteriorPoint(case.problem, time_budget=-1.0)


def test_bounds_on_controls_hold_and_are_named() -> None:
    case = quadruped()
    solution = InteriorPoint(case.problem).solve(case.xs, case.us)
    us = np.abs(np.array(solution.us))
    assert STRONG - 1e-4 < us.max() <= STRONG + 1e-7
    # the same bounds as limits have the same solution
    limits = [Limit(foot, Residual.friction_cone(foot, CONE)) for foot in FEET]
    limits.append(Limit("strong", Residual.control(np.zeros(12)), np.full(12, -STRONG), np.full(12, STRONG)))
    costs = [Cost("rest", 1e-1, Residual.state(standing())), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    knot = ContactDynamics(QUADRUPED, feet(), 0.02, costs, limits=limits)
    goal = center(QUADRUPED, standing()) + np.array([0.04, 0.01, -0.01])
    end = FreeDynamics(QUADRUPED, None, [], limits=[Limit("ahead", Residual.center_of_mass(goal))])
    other = InteriorPoint(Problem(standing(), [knot], [0] * 12, end)).solve(case.xs, case.us)
    assert other.status == solution.status == "converged"
    assert other.cost == pytest.approx(solution.cost, rel=1e-6)
    np.testing.assert_allclose(np.array(other.us), np.array(solution.us), atol=1e-2)


def test_without_limits_the_solution_is_that_of_fddp() -> None:
    problem = tracking(limited=False)
    xs = np.tile(X0, (problem.horizon + 1, 1))
    us = problem.quasi_static(xs)
    fddp = Fddp(problem, tolerance=1e-12).solve(xs, us)
    solver = InteriorPoint(problem, tolerance=1e-8)
    solution = solver.solve(xs, us)
    assert solution.status == fddp.status == "converged"
    np.testing.assert_allclose(solution.us, fddp.us, atol=1e-4)
    np.testing.assert_allclose(solution.K, fddp.K, rtol=1e-4, atol=1e-3)
    assert solver.outcome.worst is None or solver.outcome.worst.amount <= 1e-8
    assert not any(y.size for y in solver.outcome.multipliers)


@pytest.mark.parametrize("inverse_dynamics_form", [True, False])
@pytest.mark.parametrize("early", [False, True])
def test_the_feedback_keeps_active_limits(inverse_dynamics_form: bool, early: bool) -> None:
    """Checks that no deviation of the state moves a control that is at its bound, even if the solve ended a little
    early.
    """
    problem = tracking()
    xs = np.tile(X0, (problem.horizon + 1, 1))
    us = problem.quasi_static(xs)
    solver = InteriorPoint(problem, inverse_dynamics_form=inverse_dynamics_form)
    solution = solver.solve(xs, us)
    active = np.abs(np.array(solver.outcome.multipliers[:-1])) > 1e-3
    assert active.any() and not active.all()
    if early:
        iterations = len(solution.trace) - 1
        solver = InteriorPoint(problem, inverse_dynamics_form=inverse_dynamics_form, max_iterations=iterations)
        solution = solver.solve(xs, us)
        assert solution.status == "max_iterations"
    K = np.array(solution.K)
    assert np.abs(K[active]).max() < 1e-2
    assert np.abs(K[~active]).max() > 10.0


@pytest.mark.parametrize(
    ("calc", "diff", "error"),
    [
        (lambda t, x, u: 1 / 0, None, ZeroDivisionError),
        (lambda t, x, u: [1.0, 2.0], None, ValueError),
        (lambda t, x, u: x[:1], lambda t, x, u: 1 / 0, ZeroDivisionError),
        (lambda t, x, u: x[:1], lambda t, x, u: (np.zeros((1, 2)), np.zeros((2, 1))), ValueError),
    ],
)
def test_what_a_constraint_raises_is_raised(calc: Any, diff: Any, error: type[Exception]) -> None:
    knot = Action(2, 1, lambda t, x, u: (x + u, float(u @ u)))
    end = Action(2, 0, lambda t, x, u: (None, 0.0))
    problem = Problem([1.0, 0.0], [ConstrainedAction(knot, 1, calc, diff)], [0] * 3, end)
    with pytest.raises(error):
        InteriorPoint(problem).solve(np.zeros((4, 2)), np.zeros((3, 1)))


def test_a_solve_that_blows_up_returns_its_best_iterate() -> None:
    effort = Cost("effort", 1e-6, Residual.control(np.zeros(7)))
    point = Cost("point", 1e2, Residual.frame_translation(ARM, "tool", [0.3, 0.3, 0.6]))
    knot, end = FreeDynamics(ARM, 0.02, [effort]), FreeDynamics(ARM, None, [point])
    solver = InteriorPoint(Problem(X0, [knot], [0] * 50, end))
    solution = solver.solve(np.tile(X0, (51, 1)), np.zeros((50, 7)))
    for numbers in (solution.xs, solution.us, solution.K, solution.k, solution.cost, solution.gap):
        assert np.isfinite(numbers).all()
    assert np.isfinite([solver.outcome.primal, solver.outcome.dual, solver.outcome.cost]).all()
