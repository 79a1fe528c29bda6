"""Tests of limits of robots and of the solver for limits: optimality by differences, satisfied cones, files, errors."""

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ConstrainedAction,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    FrictionCone,
    ImpulseDynamics,
    InteriorPoint,
    Limit,
    Problem,
    ProblemError,
    Residual,
)

ARM = condyle.robots.arm7()
X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
TARGET = np.array([0.35, 0.2, 0.6])
WEAK, DT, KNOTS = 30.0, 0.05, 12
# Tolerances of the solves, and of central differences of the Lagrangian, whose numbers are of order one.
PRIMAL, DUAL, DIFFERENCES = 1e-7, 1e-6, 1e-5


def reach() -> tuple[Problem, np.ndarray, np.ndarray]:
    costs = [Cost("rest", 1e-1, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    weak = Limit("weak", Residual.control(np.zeros(7)), np.full(7, -WEAK), np.full(7, WEAK))
    knot = FreeDynamics(ARM, DT, costs, limits=[weak], limits_at={KNOTS - 1: []})
    free = np.full(7, np.inf)
    stop = Limit("stop", Residual.state(X0), np.r_[-free, np.zeros(7)], np.r_[free, np.zeros(7)])
    end = FreeDynamics(ARM, None, [], limits=[Limit("reach", Residual.frame_translation(ARM, "tool", TARGET)), stop])
    problem = Problem(X0, [knot], [0] * KNOTS, end)
    return problem, np.tile(X0, (KNOTS + 1, 1)), np.tile(knot.quasi_static(X0), (KNOTS, 1))


def sharp(problem: Problem) -> AugmentedLagrangian:
    return AugmentedLagrangian(problem, tolerance=PRIMAL, tolerance_dual=DUAL)


def tool(x: np.ndarray) -> np.ndarray:
    return condyle.frame_placement(ARM, condyle.Data(ARM), x[:7], "tool")[:3, 3]


def test_a_solution_satisfies_the_conditions_of_optimality() -> None:
    problem, xs, us = reach()
    solver = sharp(problem)
    solution = solver.solve(xs, us)
    outcome = solver.outcome
    assert solution.status == "converged"
    assert outcome.primal <= PRIMAL and outcome.dual <= DUAL
    us = np.array(solution.us)
    np.testing.assert_allclose(tool(solution.xs[-1]), TARGET, atol=2 * PRIMAL)
    assert np.abs(us[:-1]).max() < WEAK + PRIMAL

    def cost(us: np.ndarray) -> float:
        xs = problem.rollout(us)
        return DT * (0.5 * 1e-1 * ((xs[:-1] - X0) ** 2).sum() + 0.5 * 1e-3 * (us**2).sum())

    y = outcome.multipliers
    assert [len(n) for n in y] == [7] * (KNOTS - 1) + [0, 3 + 14]
    assert outcome.cost == pytest.approx(cost(us), rel=1e-9)

    def lagrangian(us: np.ndarray) -> float:
        held = sum(float(n @ u) for n, u in zip(y[: KNOTS - 1], us[:-1], strict=True))
        x = problem.rollout(us)[-1]
        return cost(us) + held + float(y[KNOTS] @ np.r_[tool(x) - TARGET, x - X0])

    for k in range(us.size):
        step = np.zeros(us.size)
        step[k] = 1e-3
        step = step.reshape(us.shape)
        assert abs(lagrangian(us + step) - lagrangian(us - step)) / 2e-3 < DIFFERENCES
    # a multiplier is nonzero only at an active bound, and its sign shows which bound is active
    for n, u in zip(y[: KNOTS - 1], us, strict=False):
        assert ((n == 0) | ((np.abs(u) > WEAK - 1e-6) & (np.sign(n) == np.sign(u)))).all()
    assert any(n.any() for n in y[: KNOTS - 1])


@pytest.mark.parametrize("again", [lambda p: Problem.from_json(p.to_json()), lambda p: pickle.loads(pickle.dumps(p))])
def test_limits_are_in_a_file(again: Callable[[Problem], Problem]) -> None:
    problem, xs, us = reach()
    one, other = sharp(problem), sharp(again(problem))
    np.testing.assert_array_equal(one.solve(xs, us).xs, other.solve(xs, us).xs)
    for a, b in zip(one.outcome.multipliers, other.outcome.multipliers, strict=True):
        np.testing.assert_array_equal(a, b)
    text = problem.to_json()
    assert '"limits_at":{"11":[]}' in text and '"limits":[{"name":"reach"' in text
    with pytest.raises(ProblemError, match="unknown field `limit`"):
        Problem.from_json(text.replace('"limits"', '"limit"'))


def test_settings_reach_both_solvers() -> None:
    problem, xs, us = reach()
    solution = AugmentedLagrangian(problem, max_solves=1, inner={"max_iterations": 2}).solve(xs, us)
    assert solution.status == "max_iterations" and len(solution.trace) == 2
    threaded = AugmentedLagrangian(problem, inner={"threads": 2, "inverse_dynamics_form": True}, penalty_start=100.0)
    assert threaded.solve(xs, us).status == "converged" and threaded.outcome.penalty >= 100.0
    # FDDP without the augmented Lagrangian treats limits as costs for leaving the bounds, even after a solve with
    # limits
    alone = Fddp(problem).solve(xs, us)
    assert alone.status == "converged" and np.abs(tool(alone.xs[-1]) - TARGET).max() > 1e-3
    with pytest.raises(ValueError, match="there is no setting 'penalty'"):
        AugmentedLagrangian(problem, penalty=1.0)
    with pytest.raises(ValueError, match="there is no setting 'tolerence'"):
        AugmentedLagrangian(problem, inner={"tolerence": 1.0})
    with pytest.raises(ProblemError, match="setting `penalty_start` is 0"):
        AugmentedLagrangian(problem, penalty_start=0.0).solve(xs, us)


def test_settings_change_between_solves() -> None:
    problem, xs, us = reach()
    solver = AugmentedLagrangian(problem, max_solves=1, inner={"max_iterations": 2})
    assert solver.solve(xs, us).status == "max_iterations"
    solver.settings = {"max_solves": 50}
    solver.inner = {"max_iterations": 100}
    assert solver.resume().status == "converged"
    assert solver.settings["max_solves"] == 50 and solver.settings["tolerance"] == 1e-6
    assert solver.inner["method"] == "fddp" and solver.inner["time_budget"] is None
    with pytest.raises(TypeError):
        solver.settings["max_solves"] = 3  # type: ignore[index]
    for mapping, error in [({"tolerance": 1e-3, "penalty_max": 1.0}, ProblemError), ({"penalty": 1.0}, ValueError)]:
        with pytest.raises(error, match="penalty"):
            solver.settings = mapping
    assert solver.settings["tolerance"] == 1e-6
    again = pickle.loads(pickle.dumps(solver))
    assert dict(again.settings) == dict(solver.settings) and dict(again.inner) == dict(solver.inner)
    saved = solver.settings
    solver.settings = {"penalty_start": 1e3, "penalty_max": 1e3}
    assert solver.resume().status == "converged" and solver.outcome.penalty == 1e3
    solver.settings = saved
    assert dict(solver.settings) == dict(saved)
    alone = Fddp(problem, max_iterations=1)
    assert len(alone.solve(xs, us).trace) == 1
    alone.settings = {"max_iterations": 3, "tolerance": 0.0, "time_budget": 60.0}
    assert len(alone.resume().trace) == 3 and alone.settings["time_budget"] == 60.0


def test_what_cannot_be_held_is_said() -> None:
    far = Limit("far", Residual.frame_translation(ARM, "tool", [3.0, 0.0, 0.0]))
    knot = FreeDynamics(ARM, DT, [Cost("effort", 1e-3, Residual.control(np.zeros(7)))])
    problem = Problem(
        X0, [knot], [0] * 3, FreeDynamics(ARM, None, [Cost("rest", 1.0, Residual.state(X0))], limits=[far])
    )
    xs, us = np.tile(X0, (4, 1)), np.zeros((3, 7))
    hasty = AugmentedLagrangian(problem, penalty_max=1e3, inner={"max_iterations": 20})
    assert hasty.solve(xs, us).status == "max_iterations"
    solver = AugmentedLagrangian(problem)
    assert solver.solve(xs, us).status == "constraints_violated"
    worst = solver.outcome.worst
    assert worst is not None and solver.outcome.primal == worst.amount > 1.0
    assert (worst.kind, worst.knot, worst.name) == ("constraint", 3, "far") and worst.row == worst.entry < 3


def test_what_is_infeasible_is_proved() -> None:
    lower = np.full(14, -np.inf)
    lower[2] = 0.5
    bent = Limit("bent", Residual.state(X0), lower, np.full(14, np.inf))
    costs = [Cost("rest", 1.0, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    knot = FreeDynamics(ARM, DT, costs, limits_at={0: [bent]})
    problem = Problem(X0, [knot], [0] * 3, FreeDynamics(ARM, None, []))
    solver = AugmentedLagrangian(problem)
    solution = solver.solve(np.tile(X0, (4, 1)), np.tile(knot.quasi_static(X0), (3, 1)))
    assert solution.status == "infeasible"
    assert solver.outcome.worst == ("constraint", 0, 2, "bent", 2, 0.5, None)


def test_a_start_is_moved_into_the_bounds() -> None:
    costs = [Cost("rest", 0.1, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    knot = FreeDynamics(ARM, DT, costs, lower=np.full(7, -20.0), upper=np.full(7, 20.0))
    problem = Problem(X0, [knot], [0] * 5, FreeDynamics(ARM, None, costs[:1]))
    xs, us = np.tile(X0, (6, 1)), np.full((5, 7), 60.0)
    assert np.abs(Fddp(problem, max_iterations=0).solve(xs, us).us).max() == 20.0
    kept = Fddp(problem, max_iterations=0, project_warm_start=False).solve(xs, us)
    assert kept.status == "max_iterations" and np.array_equal(kept.us, us)
    inner = {"max_iterations": 0, "project_warm_start": False}  # the augmented Lagrangian method overrides this setting
    solution = AugmentedLagrangian(problem, inner=inner, max_solves=1, restart=False).solve(xs, us)
    assert solution.status != "converged" and np.abs(solution.us).max() == 20.0


def test_feet_do_not_slip() -> None:
    quadruped = condyle.robots.quadruped()
    q = condyle.neutral(quadruped)
    q[8::3], q[9::3] = 0.7, -1.4  # joint angles with bent knees
    x0 = np.r_[q, np.zeros(18)]
    feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
    contacts = {f: condyle.ContactConstraint(f, "point", reference="local_world_aligned", kd=20.0) for f in feet}
    cone = FrictionCone(0.3, least=5.0)
    grips = [Limit(foot, Residual.friction_cone(foot, cone)) for foot in feet]
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    stance = ContactDynamics(quadruped, contacts, 0.02, costs, limits=grips)
    com = condyle.centroidal_map(quadruped, condyle.Data(quadruped), q).com
    ahead = Limit("ahead", Residual.center_of_mass(com + np.array([0.04, 0.0, 0.0])))
    problem = Problem(x0, [stance], [0] * 12, FreeDynamics(quadruped, None, [], limits=[ahead]))
    solver = sharp(problem)
    solution = solver.solve(np.tile(x0, (13, 1)), np.tile(stance.quasi_static(x0), (12, 1)))
    assert solution.status == "converged"
    held, data, excess = condyle.ConstraintSet(quadruped, list(contacts.values())), condyle.Data(quadruped), []
    lower, upper = cone.bounds()
    for x, u in zip(solution.xs, solution.us, strict=False):
        forces = condyle.constrained_dynamics(quadruped, data, held, x[:19], x[19:], np.r_[np.zeros(6), u]).lambda_
        rows = forces.reshape(4, 3) @ cone.rows().T
        excess.append(np.maximum(rows - upper, lower - rows).max())
    assert max(excess) < 2 * PRIMAL and np.abs(excess).min() < 1e-5


def test_what_does_not_fit_is_refused_by_name() -> None:
    effort = Limit("effort", Residual.joint_effort(np.zeros(7)), upper=np.ones(7))
    with pytest.raises(ProblemError, match="limit `effort`: there is no effort at this knot"):
        FreeDynamics(ARM, None, [], limits=[effort])
    with pytest.raises(ProblemError, match="limit `effort` of knot 3: another limit has this name"):
        FreeDynamics(ARM, DT, [], limits_at={3: [effort, effort]})
    with pytest.raises(ProblemError, match="limit `com`: its lower bound has 2 numbers, expected 3"):
        FreeInverseDynamics(ARM, DT, [], limits=[Limit("com", Residual.center_of_mass(np.zeros(3)), lower=np.zeros(2))])
    turn = Limit("turn", Residual.frame_rotation(ARM, "tool", np.eye(3)), lower=[0, 1, 0], upper=[0, -1, 0])
    with pytest.raises(ProblemError, match="limit `turn`: entry 1 must be at least 1 and at most -1"):
        FreeDynamics(ARM, None, [], limits=[turn])
    feet = {"foot": condyle.ContactConstraint("LF_foot", "point")}
    with pytest.raises(ProblemError, match="limit `push`: there is no contact `hand` at this knot; there is `foot`"):
        ImpulseDynamics(condyle.robots.quadruped(), feet, [], limits=[Limit("push", Residual.contact_force("hand"))])
    assert repr(effort) == "<condyle.optimal.Limit 'effort'>"


def test_constraints_of_ones_own_are_limits() -> None:
    """Checks limits of the arm that are written in Python: with and without derivatives, nested, and at the terminal
    knot.
    """
    problem, xs, us = reach()
    expected = sharp(problem)
    solution = expected.solve(xs, us)
    costs = [Cost("rest", 0.3, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    plain = FreeDynamics(ARM, DT, costs)
    some = {"lower": np.full(3, -WEAK), "upper": np.full(3, WEAK)}

    def diff(t: int, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((3, 14)), np.eye(7)[:3]

    held = ConstrainedAction(plain, 3, lambda t, x, u: u[:3], diff, **some)
    rest = {"lower": np.full(4, -WEAK), "upper": np.full(4, WEAK)}
    held = ConstrainedAction(held, 4, lambda t, x, u: u[3:], **rest)
    last = FreeDynamics(ARM, DT, costs)
    end = ConstrainedAction(FreeDynamics(ARM, None, []), 10, lambda t, x, u: np.r_[tool(x) - TARGET, x[7:]])
    problem = Problem(X0, [held, last], [0] * (KNOTS - 1) + [1], end)
    problem.set_weight("rest", 1e-1)  # also changes the weight in actions inside a constrained action
    ours = sharp(problem)
    found = ours.solve(xs, us)
    assert found.status == "converged"
    np.testing.assert_allclose(np.array(found.us), np.array(solution.us), atol=1e-4)
    assert ours.outcome.cost == pytest.approx(expected.outcome.cost, rel=1e-6)
    with pytest.raises(ProblemError, match=r"models\[0\]: expected an action of a robot"):
        problem.to_json()


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
        AugmentedLagrangian(problem).solve(np.zeros((4, 2)), np.zeros((3, 1)))


def test_bounds_that_exclude_each_other_are_refused() -> None:
    knot = Action(1, 1, lambda t, x, u: (x + u, float(u @ u)))
    end = ConstrainedAction(Action(1, 0, lambda t, x, u: (None, 0.0)), 1, lambda t, x, u: x, lower=[2.0], upper=[1.0])
    problem = Problem([1.0], [knot], [0], end)
    with pytest.raises(ProblemError, match="knot 1: constraint 0 must be at least 2 and at most 1"):
        AugmentedLagrangian(problem).solve(np.zeros((2, 1)), np.zeros((1, 1)))
    with pytest.raises(ValueError, match="lower"):
        ConstrainedAction(knot, 2, lambda t, x, u: x, lower=[0.0])


def test_a_receding_horizon_goes_on_from_its_multipliers() -> None:
    problem, xs, us = reach()
    solver = sharp(problem)
    before = solver.solve(xs, us)
    multipliers, iterations = solver.outcome.multipliers, solver.outcome.iterations
    problem.set_x0(before.xs[1] + 1e-4)
    solver.shift(0)
    for t in range(KNOTS - 2):
        np.testing.assert_array_equal(solver.outcome.multipliers[t], multipliers[t + 1])
    warm = solver.resume()
    assert warm.status == "converged" and 2 * solver.outcome.iterations < iterations
    fresh = sharp(problem).solve(np.array(before.xs), np.array(before.us))
    np.testing.assert_allclose(np.array(warm.us), np.array(fresh.us), atol=1e-4)
    with pytest.raises(ProblemError, match="there is no action model 7"):
        solver.shift(7)


@pytest.mark.parametrize("kind", [InteriorPoint, AugmentedLagrangian])
def test_multipliers_are_read_and_set_by_the_limits_name(kind: Any) -> None:
    problem, xs, us = reach()
    solver = kind(problem)
    solution, outcome = solver.solve(xs, us), solver.outcome
    weak, there = outcome.multipliers_of("weak"), outcome.multipliers_of("reach")
    assert list(outcome.limits) == ["weak", "reach", "stop"]
    assert weak.shape == (KNOTS + 1, 7) and there.shape == (KNOTS + 1, 3) and not there[:KNOTS].any()
    np.testing.assert_array_equal(weak[:-2], outcome.multipliers[:-2])
    np.testing.assert_array_equal(np.r_[there[KNOTS], outcome.multipliers_of("stop")[KNOTS]], outcome.multipliers[-1])
    assert not weak[-2:].any()  # the limits of these two knots are others
    assert pickle.loads(pickle.dumps(outcome)).limits == outcome.limits
    again, fresh = kind(problem), kind(problem)
    for name in outcome.limits:
        again.set_multipliers(name, outcome.multipliers_of(name))
    for other in (again, fresh):
        assert other.solve(solution.xs, solution.us).status == "converged"
        assert other.outcome.cost == pytest.approx(outcome.cost, rel=1e-5)
    assert again.outcome.iterations < fresh.outcome.iterations
    again.set_multipliers("weak", list(weak))
    assert again.resume().status == "converged"
    assert again.outcome.iterations <= 10


@pytest.mark.parametrize("kind", [InteriorPoint, AugmentedLagrangian])
def test_wrong_multipliers_are_refused(kind: Any) -> None:
    problem, xs, us = reach()
    solver = kind(problem)
    nan = np.zeros((KNOTS + 1, 7))
    nan[3, 2] = np.nan
    known = "no limit has this name; the limits are `weak`, `reach`, `stop`"
    with pytest.raises(ProblemError, match=f"multipliers of `weka`: {known}"):
        solver.set_multipliers("weka", nan)
    with pytest.raises(ProblemError, match="multipliers of `weak`: knot 3: entry 2 is NaN, which is not finite"):
        solver.set_multipliers("weak", nan)
    with pytest.raises(ValueError, match=r"multipliers of `weak`: expected shape \(13, 7\), found \(12, 7\)"):
        solver.set_multipliers("weak", np.zeros((KNOTS, 7)))
    solver.solve(xs, us)
    with pytest.raises(ProblemError, match=f"multipliers of `weka`: {known}"):
        solver.outcome.multipliers_of("weka")
    free = Problem(X0, [FreeDynamics(ARM, DT, [])], [0], FreeDynamics(ARM, None, []))
    with pytest.raises(ProblemError, match="no limit has this name"):
        kind(free).set_multipliers("weak", np.zeros((2, 7)))
