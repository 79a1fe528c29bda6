"""Tests of solvers from Python: shifted horizons, time budgets, bounds and methods."""

import pickle
import threading
import time

import numpy as np
import pytest

import condyle
from condyle.optimal import Activation, Cost, Fddp, FreeDynamics, Policy, Problem, ProblemError, Residual

KNOTS = 12


def reach():
    arm = condyle.robots.arm7()
    x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    rest = Cost("rest", 1e-1, Residual.state(x0))
    running = FreeDynamics(arm, 0.05, [rest, Cost("effort", 1e-4, Residual.control(np.zeros(7)))])
    terminal = FreeDynamics(
        arm, None, [rest, Cost("reach", 1e3, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))]
    )
    problem = Problem(x0, [running], [0] * KNOTS, terminal)
    return problem, np.tile(x0, (KNOTS + 1, 1)), np.tile(running.quasi_static(x0), (KNOTS, 1))


def test_a_horizon_moves_on_with_its_solution() -> None:
    problem, xs, us = reach()
    solver = Fddp(problem, max_iterations=3, tolerance=0)
    first = solver.solve(xs, us)
    solver.shift(0)
    problem.set_x0(first.xs[1] + 1e-3)
    second = solver.resume()
    assert second.status == "max_iterations" and len(second.trace) == 3
    np.testing.assert_allclose(second.xs[0], first.xs[1] + 1e-3, atol=1e-12)
    with pytest.raises(ProblemError, match="there is no action model 4"):
        solver.shift(4)


def test_without_time_a_solve_returns_what_it_has() -> None:
    problem, xs, us = reach()
    solution = Fddp(problem, time_budget=0.0).solve(xs, us)
    assert solution.status == "time_limit" and not solution.trace
    np.testing.assert_array_equal(solution.us, us)
    assert solution.timings.overrun == 0.0  # no iteration was requested
    late = Fddp(problem, time_budget=1e-9, tolerance=0.0).solve(xs, us)
    assert late.status == "time_limit" and len(late.trace) == 1
    assert 0.0 < late.timings.overrun <= late.timings.total
    with pytest.raises(ValueError, match="time_budget: expected at least 0 seconds"):
        Fddp(problem, time_budget=-1.0)


def test_bounds_and_method() -> None:
    problem, xs, us = reach()
    optimum = Fddp(problem).solve(xs, us)
    again = Fddp(problem, method="ddp").solve(optimum.xs, optimum.us)
    assert again.status == "converged" and abs(again.cost - optimum.cost) < 1e-9
    with pytest.raises(ValueError, match="method: expected 'fddp' or 'ddp', found 'newton'"):
        Fddp(problem, method="newton")
    arm = condyle.robots.arm7()
    wrong = FreeDynamics(arm, 0.05, [], lower=np.ones(7), upper=np.zeros(7))
    problem = Problem(xs[0], [wrong], [0], FreeDynamics(arm, None, []))
    with pytest.raises(ProblemError, match="control 0 must be at least 1 and at most 0"):
        Fddp(problem).solve(xs[:2], us[:1])


def test_segments_and_threads_change_no_iterate() -> None:
    problem, xs, us = reach()
    one = Fddp(problem).solve(xs, us)
    threaded = Fddp(problem, threads=2).solve(xs, us)
    np.testing.assert_array_equal(threaded.xs, one.xs)
    segments = Fddp(problem, segments=3, threads=2).solve(xs, us)
    assert segments.status == one.status
    # if the results of segments differ by more than 1e-9 of the value functions, the horizon is swept as one segment
    np.testing.assert_allclose([i.cost for i in segments.trace], [i.cost for i in one.trace], rtol=1e-8)
    np.testing.assert_allclose(segments.xs, one.xs, atol=1e-9)
    assert (segments.xs != one.xs).any()
    for name in ("segments", "threads"):
        with pytest.raises(ProblemError, match=f"setting `{name}` is 0, but it must be at least 1"):
            Fddp(problem, **{name: 0}).solve(xs, us)


def test_a_tick_ends_with_the_first_full_step() -> None:
    problem, xs, us = reach()
    solver = Fddp(problem)
    plan = solver.solve(xs, us)
    solver.shift(0)
    moved = plan.xs[1].copy()
    moved[7:] += 0.5
    problem.set_x0(moved)
    seen = []
    tick = solver.resume(lambda iteration: seen.append(iteration.step), stop="full_step", most=3)
    assert tick.status == "full_step" and tick.gap == 0.0
    assert seen[-1] == 1.0 and all(step < 1.0 for step in seen[:-1])
    np.testing.assert_array_equal(tick.xs[0], moved)
    assert solver.resume(stop="full_step").status in ("full_step", "converged")
    for arguments, message in (
        ({"stop": "half_step"}, "stop: expected 'full_step' or None, found 'half_step'"),
        ({"most": 3}, "most: expected only with stop='full_step'"),
        ({"stop": "full_step", "most": 0}, "most: expected at least 1, found 0"),
    ):
        with pytest.raises(ValueError, match=message):
            solver.resume(**arguments)


def test_a_barrier_keeps_controls_inside_their_bounds() -> None:
    problem, xs, us = reach()
    free = Fddp(problem).solve(xs, us)
    bound = 0.8 * np.abs(free.us).max()
    effort = Residual.control(np.zeros(7))
    barrier = Activation.relaxed_barrier(np.full(7, -bound), np.full(7, bound), 1e-3, 1e-2)
    terms = [
        Cost("rest", 1e-1, Residual.state(xs[0])),
        Cost("effort", 1e-4, effort),
        Cost("most", 1.0, effort, barrier),
    ]
    arm = condyle.robots.arm7()
    end = [terms[0], Cost("reach", 1e3, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))]
    knot = FreeDynamics(arm, 0.05, terms)
    limited = Problem(xs[0], [knot], [0] * KNOTS, FreeDynamics(arm, None, end))
    solution = Fddp(limited).solve(xs, us)
    assert solution.status == "converged" and np.abs(solution.us).max() < bound < np.abs(free.us).max()
    again = Fddp(Problem.from_json(limited.to_json())).solve(xs, us)
    np.testing.assert_array_equal(again.us, solution.us)
    with pytest.raises(ProblemError, match="its μ is 0, but it must be above 0"):
        FreeDynamics(arm, 0.05, [Cost("c", 1.0, effort, Activation.relaxed_barrier([0] * 7, [1] * 7, 0.0, 1.0))])


def test_a_policy_is_called_while_a_solve_runs() -> None:
    problem, xs, us = reach()
    solver, policy = Fddp(problem), Policy(problem)
    with pytest.raises(ProblemError, match="no solution was published yet"):
        policy(0.0, xs[0])
    assert policy.end is None
    plan = solver.solve(xs, us)
    solver.publish(policy, 3.0)
    assert policy.end == pytest.approx(3.0 + KNOTS * 0.05)
    x = xs[0] + 0.01
    for t in (0.0, 0.02, 0.125, 5.0):
        point = plan.at(t)
        np.testing.assert_allclose(policy(3.0 + t, x), point.u + point.K @ (x - point.x), atol=1e-9)
    point = plan.at(0.125)
    assert point.knot == 2
    np.testing.assert_allclose(point.x, 0.5 * (plan.xs[2] + plan.xs[3]), atol=1e-12)
    np.testing.assert_array_equal(plan.at(-1.0).x, plan.xs[0])
    np.testing.assert_array_equal(plan.at(9.0).x, plan.xs[-1])
    assert np.array_equal(policy(3.0, np.full(14, np.nan)), plan.us[0])
    with pytest.raises(ValueError, match=r"x: expected shape \(14,\), found \(13,\)"):
        policy(3.0, x[1:])
    # another thread calls both while solves run
    ended, calls, errors = threading.Event(), [], []

    def control() -> None:
        try:
            while not ended.is_set():
                begin = time.perf_counter()
                policy(3.01, x)
                calls.append(time.perf_counter() - begin)
                plan.at(0.01)
        except Exception as error:
            errors.append(error)

    reader = threading.Thread(target=control)
    reader.start()
    slow = Fddp(problem, max_iterations=300, tolerance=0.0)
    for _ in range(5):
        slow.solve(xs, us)
        slow.publish(policy, 3.0)
    ended.set()
    reader.join()
    assert not errors and len(calls) > 10
    np.testing.assert_allclose(policy(3.0, slow.solution.xs[0]), slow.solution.us[0], atol=1e-9)


def test_the_base_of_a_plan_is_interpolated_along_a_screw() -> None:
    model = condyle.robots.quadruped()
    first = np.r_[condyle.neutral(model), np.zeros(18)]
    last = first.copy()
    last[:7] = [0.0, 0.0, 0.4, 0.0, 0.0, np.sin(0.6), np.cos(0.6)]
    problem = Problem(first, [FreeDynamics(model, 0.5, [])], [0], FreeDynamics(model, None, []))
    solution = Fddp(problem, max_iterations=0).solve([first, last], np.zeros((1, 12)))
    half = solution.at(0.25)
    np.testing.assert_allclose(half.x[:7], [0.0, 0.0, 0.2, 0.0, 0.0, np.sin(0.3), np.cos(0.3)], atol=1e-12)
    assert half.u.shape == (12,) and half.K.shape == (12, 36)
    with pytest.raises(AttributeError, match="was copied from its problem"):
        pickle.loads(pickle.dumps(solution)).at(0.0)
