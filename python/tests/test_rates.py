"""Tests of horizons at other times: schedules, knots that change in place, and warm starts at any rate."""

import json
import pickle
from typing import Any

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
    Problem,
    ProblemError,
    Residual,
    Schedule,
)
from condyle.simulation import Ground, Simulation

QUADRUPED = condyle.robots.quadruped()
FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
STAND = np.r_[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
DT, KNOTS = 0.02, 10
ARM = condyle.robots.arm7()
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, np.zeros(8)]


def arm_problem() -> Problem:
    """Returns the problem of an arm with two models."""
    models = [
        FreeDynamics(ARM, DT, [Cost("rest", 1.0, Residual.state(k * REST)), effort(7)], limits=[limit(7)])
        for k in range(2)
    ]
    return Problem(REST, models, [0] * KNOTS, FreeDynamics(ARM, None, [Cost("rest", 1.0, Residual.state(REST))]))


def effort(nu: int) -> Cost:
    return Cost("effort", 1e-3, Residual.control(np.zeros(nu)))


def limit(nu: int) -> Limit:
    return Limit("effort", Residual.control(np.zeros(nu)), np.full(nu, -80.0), np.full(nu, 80.0))


def solved(problem: Problem, solver: Any) -> Any:
    """Solves a problem from its initial state, and returns the solution."""
    xs = np.tile(problem.x0, (KNOTS + 1, 1))
    return solver.solve(xs, problem.quasi_static(xs))


def test_knots_of_a_schedule() -> None:
    """Checks the knots of a trot's schedule."""
    schedule = Schedule(DT, 3)
    for t, model in [(0.1, 0), (0.15, 1), (0.4, 2)]:
        schedule.switch(t, model)
    models, durations = schedule.knots(0.093, 6)
    assert models == [3, 0, 0, 1, 1, 1]  # 50 ms are two knots of 25 ms; 250 ms are 13 knots, or 12
    assert durations[:3] == pytest.approx([0.007, 0.025, 0.025])
    assert durations[3] in (pytest.approx(0.25 / 12), pytest.approx(0.25 / 13))
    assert [schedule.model(t) for t in (0.0, 0.1, 0.2, 1.0)] == [3, 0, 1, 2]
    copy = pickle.loads(pickle.dumps(schedule))
    schedule.forget(0.2)
    assert schedule.switches == [(0.4, 2)] and copy.switches == [(0.1, 0), (0.15, 1), (0.4, 2)]
    assert schedule.knots(0.2, 3)[1] == pytest.approx(copy.knots(0.2, 3)[1])
    assert schedule.spacing == DT and "1 switches" in repr(schedule)
    for wrong in (lambda: Schedule(0.0), lambda: schedule.knots(np.nan, 3), lambda: schedule.switch(np.inf, 0)):
        with pytest.raises(ProblemError):
            wrong()


@pytest.mark.parametrize("kind", [Fddp, InteriorPoint])
def test_a_retiming_by_one_knot_is_a_shift(kind: Any) -> None:
    problems = [arm_problem() for _ in range(2)]
    solvers = [kind(problem) for problem in problems]
    for problem, solver in zip(problems, solvers, strict=True):
        solved(problem, solver)
    solvers[0].shift(1)
    assert solvers[1].retime(DT, [0] * (KNOTS - 1) + [1], np.full(KNOTS, DT)) == 1
    for problem in problems:
        problem.set_x0(1.1 * REST)
    plans = [solver.resume() for solver in solvers]
    assert plans[0].status == "converged" and plans[0].us == pytest.approx(plans[1].us, abs=1e-6)


def test_a_plan_at_other_times() -> None:
    """Compares states with the plan at the same times, and controls with the same knots of the plan."""
    problem = arm_problem()
    solver = Fddp(problem, max_iterations=20)
    plan = solved(problem, solver)
    durations = np.r_[0.008, np.full(KNOTS - 1, DT)]
    assert solver.retime(0.012, [0] * KNOTS, durations) == 0
    moved = solver.solution
    assert moved is not None
    assert moved.us == pytest.approx(plan.us, abs=0) and moved.xs[1:] == pytest.approx(plan.xs[1:], abs=0)
    assert moved.xs[0] == pytest.approx(plan.at(0.012).x)
    assert moved.at(0.009).knot == 1
    with pytest.raises(ProblemError, match="moved on"):
        _ = plan.efforts


def test_wrong_retimings_change_nothing() -> None:
    problem = arm_problem()
    solver = Fddp(problem)
    models, durations = [0] * KNOTS, np.full(KNOTS, DT)
    with pytest.raises(ProblemError, match="call solve first"):
        solver.retime(0.01, models, durations)
    plan = solved(problem, solver)
    wrong: list[tuple[float, list[int], Any]] = [
        (-0.01, models, durations),
        (np.nan, models, durations),
        (0.01, [2] * KNOTS, durations),
        (0.01, models, 0.0 * durations),
        (0.01, models[1:], durations[1:]),
    ]
    for arguments in wrong:
        with pytest.raises(ProblemError):
            solver.retime(*arguments)
    with pytest.raises(ValueError, match="durations"):
        solver.retime(0.01, models, durations[1:])
    assert solver.solution is not None and solver.solution.us == pytest.approx(plan.us, abs=0)
    assert plan.efforts[0] == pytest.approx(plan.us[0])  # the knots are the same


def test_durations_survive_files() -> None:
    """Checks durations of single knots in JSON and in a pickle."""
    problem = arm_problem()
    solver = Fddp(problem)
    solved(problem, solver)
    durations = np.r_[0.005, np.full(KNOTS - 2, DT), 0.03]
    solver.retime(0.015, [0] * (KNOTS - 1) + [1], durations)
    plan = solver.resume()
    for copy in (Problem.from_json(problem.to_json()), pickle.loads(pickle.dumps(problem))):
        again = solved(copy, Fddp(copy))
        assert again.status == "converged" and again.us == pytest.approx(plan.us, abs=1e-5)
        assert again.at(0.0051).knot == 1 and again.at(1.0).knot == KNOTS - 1
    data = json.loads(problem.to_json())
    assert len(data["knots"]) == 4 and data["knot_models"] == [2] + [0] * (KNOTS - 2) + [3]
    problem.set_duration(3, 0.01)
    assert len(json.loads(problem.to_json())["knots"]) == 5


def test_references_move_with_their_knots() -> None:
    problem = arm_problem()
    solver = Fddp(problem)
    solved(problem, solver)
    problem.set_references("rest", np.arange(KNOTS + 1.0)[:, None] * np.ones(14))
    models = [0, 0, 1, *[0] * (KNOTS - 3)]
    assert solver.retime(2.2 * DT, models, np.full(KNOTS, DT)) == 2
    rows = problem.references("rest")[:, 1]
    assert rows[[0, 1, 3]] == pytest.approx([2.0, 3.0, 5.0]) and rows[2] == pytest.approx(REST[1])
    data = json.loads(problem.to_json())
    assert sorted(data["knots"][0]["costs_at"]) == sorted(str(t) for t in range(KNOTS - 2) if t != 2)


def test_a_predicted_state() -> None:
    """Compares the prediction with a simulation of the same dynamics, whose controls follow the policy."""
    problem = arm_problem()
    solver = Fddp(problem)
    plan = solved(problem, solver)
    policy = condyle.optimal.Policy(problem)
    solver.publish(policy)
    x = plan.xs[1] + 0.05
    simulation = Simulation(ARM, dt=2e-4)
    simulation.set_state(x[:7], x[7:])

    def law(now: Any) -> None:
        now.tau[:] = policy(DT + now.time, np.r_[now.q, now.v])

    assert simulation.run(150, law) == "done"
    then = np.r_[simulation.q, simulation.v]
    predicted = solver.predict(x, DT, DT + 0.03)
    # the plan itself changes by another amount
    other = x + plan.at(DT + 0.03).x - plan.xs[1]
    errors = [np.abs(state - then).max() for state in (predicted, other)]
    assert errors[0] < 0.1 * errors[1], errors
    assert solver.predict(x, DT, DT) == pytest.approx(x, abs=0)
    for wrong in ((np.full(14, np.nan), 0.0, DT), (x, 0.0, np.inf)):
        with pytest.raises(ProblemError, match="not finite"):
            solver.predict(*wrong)


@pytest.mark.parametrize("rate", [50.0, 130.0])
def test_a_quadruped_trots_in_place(rate: float) -> None:
    """Simulates a trot whose steps take 275 ms, no multiple of the period or of the knots, at two rates."""
    effort_limit, weights = QUADRUPED.limits.effort[6:], np.r_[0, 0, 2000, 400, 400, 100, np.full(12, 4.0)]
    rates = np.r_[100, 100, 50, 3, 3, 10, np.full(12, 0.02)]
    state = Activation.weighted(np.r_[weights, rates])
    data, stances = condyle.Data(QUADRUPED), [(), (0, 3), (1, 2)]

    def knot(air: tuple[int, ...]) -> ContactDynamics:
        grips = [foot for k, foot in enumerate(FEET) if k not in air]
        kd = 1.0 / DT
        contacts = {
            foot: condyle.ContactConstraint(foot, "point", None, "local_world_aligned", kd=kd) for foot in grips
        }
        costs = [Cost("state", 1.0, Residual.state(STAND), state), effort(12)]
        for foot in [FEET[k] for k in air]:
            place = condyle.frame_placement(QUADRUPED, data, STAND[:19], foot)[:3, 3]
            swing = Residual.frame_translation(QUADRUPED, foot, place + np.array([0.0, 0.0, 0.04]))
            costs.append(Cost(foot, 1.0, swing, Activation.weighted([300.0, 300.0, 3e3])))
        limits = [Limit(foot, Residual.friction_cone(foot, FrictionCone(0.5, least=5.0))) for foot in grips]
        limits.append(Limit("effort", Residual.control(np.zeros(12)), -effort_limit, effort_limit))
        return ContactDynamics(QUADRUPED, contacts, DT, costs, limits=limits)

    schedule = Schedule(DT)
    for step in range(6):
        schedule.switch(0.1 + 0.275 * step, 1 + step % 2)
        schedule.switch(0.33 + 0.275 * step, 0)
    end = FreeDynamics(QUADRUPED, None, [Cost("state", 0.1, Residual.state(STAND), state)])
    problem = Problem(STAND, [knot(air) for air in stances], [0] * 25, end)
    problem.set_knots(*schedule.knots(0.0, 25))
    solver = InteriorPoint(problem, tolerance=1e-4)
    policy = condyle.optimal.Policy(problem)
    xs = np.tile(STAND, (26, 1))
    solver.solve(xs, problem.quasi_static(xs))
    solver.publish(policy, 0.0)
    begin, count, trace, lifted = 0.0, 0, [], np.zeros(4, bool)

    def law(now: Any) -> None:
        nonlocal begin, count
        t, x = now.time, np.r_[now.q, now.v]
        if int(t * rate + 1e-6) > count:
            count = int(t * rate + 1e-6)
            solver.retime(t - begin, *schedule.knots(t, 25))
            begin = t
            problem.set_x0(x)
            solver.tick(2)
            solver.publish(policy, t)
        now.tau[6:] = np.clip(policy(t, x), -effort_limit, effort_limit)
        heights = [condyle.frame_placement(QUADRUPED, data, now.q, foot)[2, 3] for foot in FEET]
        lifted[:] |= np.array(heights) > 0.02
        trace.append(x)

    trotting = Simulation(QUADRUPED, dt=1e-3, ground=Ground(FEET, friction=0.7))
    trotting.set_state(STAND[:19], np.zeros(18))
    assert trotting.run(1200, law) == "done"
    states = np.array(trace)
    assert lifted.all() and states[:, 2].min() > 0.5
    assert np.abs(states[:, 3:5]).max() < 0.05 and np.abs(states[:, :2]).max() < 0.1
