"""Tests of model predictive control of a standing quadruped: ticks after pushes, and ticks that go wrong."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    InteriorPoint,
    Limit,
    Policy,
    Problem,
    ProblemError,
    Residual,
)
from condyle.simulation import Ground, Simulation

QUADRUPED = condyle.robots.quadruped()
FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
STAND = np.r_[0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
EFFORT = QUADRUPED.limits.effort[6:]
KNOTS, DT = 25, 0.02
WEIGHTS = np.r_[0, 0, 2000, 400, 400, 100, np.full(12, 2.0), 100, 100, 50, 3, 3, 10, np.full(12, 0.02)]
CONTACTS = {foot: condyle.ContactConstraint(foot, "point", None, "local_world_aligned", kd=1.0 / DT) for foot in FEET}
COSTS = [
    Cost("state", 1.0, Residual.state(STAND), Activation.weighted(WEIGHTS)),
    Cost("effort", 2e-3, Residual.control(np.zeros(12))),
]
END = FreeDynamics(QUADRUPED, None, [Cost("state", 1.0, Residual.state(STAND), Activation.weighted(0.1 * WEIGHTS))])
CONES = {foot: Residual.friction_cone(foot, FrictionCone(0.5, least=5.0)) for foot in FEET}
RULES = ("tick", "full_step", "tick in parts", "full_step in parts")
"""Rules of a tick; "in parts": with `prepare` and `feedback`."""
NEAR = 0.1
"""Largest difference to the efforts of a loop without a fault, 3 ticks after the fault, relative to the limits."""
FAULTS: dict[str, Callable[[Any], Any]] = {
    "stall": lambda x: None,
    "not finite": lambda x: np.full_like(x, np.nan),
    "tenfold velocities": lambda x: np.r_[x[:19], 10.0 * x[19:]],
}
AT, PERIOD = 300, 20
"""Time of the fault and period of the ticks (ms)."""


def standing(effort: bool = False) -> Problem:
    """Returns the problem of a quadruped that stands, with cones and efforts as limits."""
    limits = [Limit(foot, cone) for foot, cone in CONES.items()]
    if effort:
        limits.append(Limit("effort", Residual.control(np.zeros(12)), -EFFORT, EFFORT))
    return Problem(STAND, [ContactDynamics(QUADRUPED, CONTACTS, DT, COSTS, limits=limits)], [0] * KNOTS, END)


def guess(problem: Problem) -> tuple[Any, Any]:
    """Returns states and controls with which the robot stands still."""
    xs = np.tile(STAND, (KNOTS + 1, 1))
    return xs, problem.quasi_static(xs)


@pytest.mark.parametrize("push", [0.2, 0.5, 1.0])
def test_two_linearisations_reach_the_optimum(push: float) -> None:
    """Compares the cost of a plan after a push and two ticks with the cost of the optimum. The dynamics are nonlinear,
    so the plan has gaps, which must be small.
    """
    problem, pushed = standing(), STAND.copy()
    pushed[[20, 22]] += push  # m/s to the left, and rad/s about the axis ahead
    solver = InteriorPoint(problem, regularisation_min=1e-12)
    plan = solver.solve(*guess(problem))
    assert plan.status == "converged"
    problem.set_x0(pushed)
    best = InteriorPoint(problem).solve(plan.xs, plan.us)
    assert best.status == "converged"
    for _ in range(2):
        ticked = solver.tick(8)
    free = Problem(pushed, [ContactDynamics(QUADRUPED, CONTACTS, DT, COSTS)], [0] * KNOTS, END)
    at = free.evaluate(ticked.xs, ticked.us)
    assert at.cost <= 1.01 * best.cost and np.abs(at.gaps).max() < 0.2


class Run(NamedTuple):
    """Record of a loop."""

    efforts: Any
    """Efforts of the joints in each ms, (ms, 12)."""
    plans: dict[int, Any]
    """Plans by the times of the ticks (ms), or the message of a refused state."""
    q: Any
    """Last position of the robot."""


def loop(rule: str, fault: Callable[[Any], Any] | None = None, seconds: float = 1.0) -> Run:
    """Simulates a standing quadruped that is pushed from 0.2 s to 0.3 s. At the tick at 0.3 s, a fault replaces the
    measured state x by fault(x), for one period. If fault(x) is None, the tick does not take place.
    """
    problem = standing(effort=True)
    is_tick, in_parts = rule.startswith("tick"), rule.endswith("in parts")
    solver: Any = InteriorPoint(problem) if is_tick else Fddp(problem, max_iterations=100)
    policy = Policy(problem)
    solver.solve(*guess(problem))
    solver.publish(policy, 0.0)
    efforts: list[Any] = []
    plans: dict[int, Any] = {}
    shifted = 0

    def tick(t: float, x: Any) -> None:
        nonlocal shifted
        period = round(t / DT)
        for _ in range(period - shifted):  # also for ticks that did not take place
            solver.shift(0)
        shifted = period
        if in_parts:
            solver.prepare(*([2] if is_tick else []))
        try:
            if in_parts:
                plan = solver.feedback(x, *([] if is_tick else [3]))
            else:
                problem.set_x0(x)
                plan = solver.tick(2) if is_tick else solver.resume(stop="full_step", most=3)
        except ProblemError as error:
            plans[PERIOD * period] = str(error)
            return
        plans[PERIOD * period] = plan
        solver.publish(policy, t)

    def law(now: Any) -> None:
        ms = round(1000.0 * now.time)
        x = np.r_[now.q, now.v]
        measured = fault(x) if fault is not None and AT <= ms < AT + PERIOD else x
        if measured is None:
            measured = x
        elif ms % PERIOD == 0 and ms > 0:
            tick(now.time, measured)
        efforts.append(np.clip(policy(now.time, measured), -EFFORT, EFFORT))
        now.tau[6:] = efforts[-1]
        if 200 <= ms < 300:
            now.f_ext[1, 1] = 80.0  # N, to the left, at the trunk

    robot = Simulation(QUADRUPED, dt=1e-3, ground=Ground(FEET, friction=0.7))
    robot.set_state(STAND[:19], STAND[19:])
    assert robot.run(round(1000 * seconds), law) == "done"
    return Run(np.array(efforts), plans, robot.q.copy())


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_over_after_three_ticks(rule: str, name: str) -> None:
    """Compares a loop with a fault in one tick with a loop without it. The robot must stand at the end, and the plans
    must be similar again.
    """
    expected, found = loop(rule), loop(rule, FAULTS[name])
    assert np.isfinite(found.efforts).all() and (np.abs(found.efforts) <= EFFORT).all()
    if name == "stall":
        assert AT not in found.plans
    elif name == "not finite":
        assert found.plans[AT] == "`x0[0]` is NaN, which is not finite"
    else:
        effect = np.abs(found.efforts[AT] - expected.efforts[AT]) / EFFORT
        assert effect.max() > NEAR  # so the comparison below can fail
    for ms in range(AT + PERIOD, 1000, PERIOD):
        assert found.plans[ms].status in ("converged", "full_step", "max_iterations")
        assert found.plans[ms].executable
    for ms in range(AT + 3 * PERIOD, 1000, PERIOD):
        difference = np.abs(found.plans[ms].us[0] - expected.plans[ms].us[0]) / EFFORT
        assert difference.max() <= NEAR, ms
    np.testing.assert_allclose(found.q[:7], expected.q[:7], atol=0.01)
    np.testing.assert_allclose(found.q[2], STAND[2], atol=0.01)


def test_feedback_completes_a_preparation() -> None:
    """Checks the errors of `prepare` and `feedback` without a solution, without a preparation, and for wrong states."""
    for rule in ("fddp", "interior point"):
        problem = standing()
        solver: Any = Fddp(problem) if rule == "fddp" else InteriorPoint(problem)
        with pytest.raises(ProblemError, match="no solution to go on from"):
            solver.prepare()
        solver.solve(*guess(problem))
        with pytest.raises(ProblemError, match="nothing is prepared"):
            solver.feedback(STAND)
        solver.shift(0)
        predicted = solver.solution.xs[0]
        solver.prepare()
        np.testing.assert_array_equal(problem.x0, predicted)
        with pytest.raises(ValueError, match="x0"):
            solver.feedback(STAND[:-1])
        with pytest.raises(ProblemError, match="not finite"):
            solver.feedback(np.full_like(STAND, np.nan))
        ours = solver.feedback(predicted)
        assert ours.executable and ours.fallback is None
    with pytest.raises(ValueError, match="most: expected at least 1"):
        Fddp(problem).feedback(STAND, most=0)


@pytest.mark.parametrize("push", [0.0, 0.5])
def test_feedback_of_fddp_equals_a_whole_iteration(push: float) -> None:
    """Compares `prepare` and `feedback` with `resume(stop="full_step")`, for a state that the plan predicts, and for
    another one.
    """
    plans = []
    for in_parts in (False, True):
        problem = standing()
        solver = Fddp(problem)
        solver.solve(*guess(problem))
        solver.shift(0)
        found = solver.solution
        assert found is not None
        x = found.xs[0].copy()
        x[20] += push
        if in_parts:
            solver.prepare()
            plans.append(solver.feedback(x, most=2))
        else:
            problem.set_x0(x)
            plans.append(solver.resume(stop="full_step", most=2))
    np.testing.assert_array_equal(plans[0].xs, plans[1].xs)
    np.testing.assert_array_equal(plans[0].K, plans[1].K)
    assert plans[0].status == plans[1].status and plans[0].cost == plans[1].cost


def test_a_solver_is_configured_and_reset() -> None:
    """Changes settings of a solver, and starts it anew from another state."""
    problem, pushed = standing(), STAND.copy()
    pushed[20] += 0.1
    for solver in (Fddp(problem), InteriorPoint(problem)):
        solver.configure(max_iterations=1, tolerance=1e-3)
        assert solver.settings["max_iterations"] == 1 and solver.settings["tolerance"] == 1e-3
        with pytest.raises(ProblemError):
            solver.configure(tolerance=-1.0)
        with pytest.raises(ValueError, match="there is no setting 'tolerances'"):
            solver.configure(tolerances=1.0)
        assert solver.settings["tolerance"] == 1e-3
        xs, us = guess(problem)
        solver.solve(xs, us + 20.0)
        solver.configure(max_iterations=100)
        solver.reset(pushed)
        begun = solver.solution
        assert begun is not None and begun.executable and begun.fallback == "held_still"
        np.testing.assert_array_equal(problem.x0, pushed)
        np.testing.assert_array_equal(begun.xs, np.tile(pushed, (KNOTS + 1, 1)))
        assert not np.any(begun.K)
        assert solver.resume().status == "converged"
        with pytest.raises(ProblemError, match="not finite"):
            solver.reset(np.full_like(STAND, np.nan))
