"""Tests of `solve_many`: rows equal single solves, whichever problems are solved together."""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    Problem,
    ProblemError,
    Residual,
    solve_many,
)

ARM = condyle.robots.arm7()
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
N = 12


def reach() -> Problem:
    rest, effort = Cost("rest", 0.1, Residual.state(REST)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))
    point = Cost("reach", 100.0, Residual.frame_translation(ARM, "tool", [0.35, 0.2, 0.6]))
    knot = FreeDynamics(ARM, 0.02, [rest, effort])
    return Problem(REST, [knot], [0] * N, FreeDynamics(ARM, None, [rest, point]))


def held() -> tuple[np.ndarray, np.ndarray]:
    xs = np.tile(REST, (N + 1, 1))
    return xs, reach().quasi_static(xs)


@pytest.mark.parametrize("threads", [1, 3])
def test_rows_are_single_solves(threads: int) -> None:
    rng, start = np.random.default_rng(3), held()
    x0s, goals = rng.normal(REST, 0.2, (11, 14)), rng.normal([0.35, 0.2, 0.6], 0.1, (11, 3))
    scales = rng.uniform(0.05, 0.2, (11, N + 1))
    found = solve_many(
        reach(),
        x0s,
        references={"reach": goals},
        weights={"rest": scales},
        start=start,
        keep=["xs", "us", "K", "k"],
        threads=threads,
    )
    for i in range(11):
        problem = reach()
        problem.set_x0(x0s[i])
        problem.set_references("reach", np.tile(goals[i], (N + 1, 1)))
        problem.set_weight("rest", scales[i])
        xs = start[0].copy()
        xs[0] = x0s[i]
        alone = Fddp(problem).solve(xs, start[1])
        assert (found.status[i], found.iterations[i], found.cost[i]) == (alone.status, len(alone.trace), alone.cost)
        for name in ("xs", "us", "K", "k"):
            assert np.array_equal(getattr(found, name)[i], getattr(alone, name)), name


def test_the_problem_is_not_changed() -> None:
    problem = reach()
    text = problem.to_json()
    solve_many(problem, weights={"rest": [0.1, 0.2]}, start=held())
    assert problem.to_json() == text


def test_one_target_is_a_target_for_all_knots() -> None:
    goals = np.array([[0.3, 0.2, 0.6], [0.4, 0.1, 0.5]])
    one = solve_many(reach(), references={"reach": goals}, start=held())
    all_knots = solve_many(reach(), references={"reach": np.repeat(goals[:, None], N + 1, axis=1)}, start=held())
    assert np.array_equal(one.xs, all_knots.xs)
    assert one.cost[0] != one.cost[1]


def test_contacts() -> None:
    robot = condyle.robots.quadruped()
    x0 = np.r_[condyle.neutral(robot), np.zeros(18)]
    x0[7:19] = np.tile([0.0, 0.7, -1.4], 4)
    names = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
    feet = {name: condyle.ContactConstraint(name, "point", kd=20.0) for name in names}
    rest, effort = Cost("rest", 0.1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))
    com = Cost("com", 10.0, Residual.center_of_mass([0.0, 0.0, 0.35]))
    knot = ContactDynamics(robot, feet, 0.02, [rest, effort, com])
    problem = Problem(x0, [knot], [0] * 10, FreeDynamics(robot, None, [rest, com]))
    x0s = np.tile(x0, (9, 1))
    x0s[:, 19:] = np.random.default_rng(0).normal(0.0, 0.3, (9, 18))
    found, again = (solve_many(problem, x0s[: 9 - k]) for k in range(2))
    assert np.array_equal(found.xs[:8], again.xs)
    xs, us = (np.tile(x0, (11, 1)),) * 2
    nominal = Fddp(problem).solve(xs, problem.quasi_static(xs))
    for i, state in enumerate(x0s):
        problem.set_x0(state)
        xs, us = nominal.xs.copy(), nominal.us
        xs[0] = state
        alone = Fddp(problem).solve(xs, us)
        assert found.status[i] == alone.status
        assert np.allclose(found.xs[i], alone.xs, rtol=0.0, atol=1e-9)


def test_wrong_problems_fail_alone() -> None:
    x0s = np.tile(REST, (4, 1))
    x0s[2, 3] = np.nan
    found = solve_many(reach(), x0s, start=held())
    assert found.status.tolist() == ["converged", "converged", "error", "converged"]
    assert found.error[2].startswith("variation 2: ProblemError: ")
    assert np.isnan(found.cost[2]) and np.isnan(found.xs[2]).all()
    found = solve_many(reach(), weights={"rest": [0.1, -1.0]}, start=held())
    assert found.status.tolist() == ["converged", "error"]


def test_time_ends_a_call() -> None:
    x0s = np.tile(REST, (2000, 1))
    found = solve_many(reach(), x0s, start=held(), settings={"time_budget": 0.01, "tolerance": 0.0})
    assert found.status[-1] == "not_started"
    assert np.isnan(found.cost[-1])


def test_progress_and_its_exceptions() -> None:
    told: list[tuple[int, int]] = []
    solve_many(reach(), np.tile(REST, (50, 1)), start=held(), progress=lambda *now: told.append(now))
    assert told[-1] == (50, 50)

    def fail(_: int, __: int) -> None:
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        solve_many(reach(), np.tile(REST, (50, 1)), start=held(), progress=fail)


@pytest.mark.parametrize(
    ("match", "arguments"),
    [
        (r"x0: expected states, \(V, 14\), found the shape \(3, 7\)", {"x0": np.zeros((3, 7))}),
        ("x0: expected the states of several problems", {"x0": np.zeros(14)}),
        (
            "expected one number of problems, found reach: 2, x0: 3",
            {"x0": np.zeros((3, 14)), "references": {"reach": np.zeros((2, 3))}},
        ),
        (
            r"references: expected \(V, 3\) or \(V, 13, 3\) numbers of 'reach'",
            {"references": {"reach": np.zeros((2, 4))}},
        ),
        (r"weights: expected \(V,\) or \(V, 13\) numbers of 'rest'", {"weights": {"rest": np.zeros((2, 4))}}),
        ("keep: expected some of", {"x0": np.zeros((2, 14)), "keep": ["x"]}),
        ("threads: expected at least 1, found 0", {"x0": np.zeros((2, 14)), "threads": 0}),
    ],
)
def test_wrong_arguments_are_named(match: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=match):
        solve_many(reach(), start=held(), **arguments)


def test_unknown_costs_and_actions_without_copies() -> None:
    with pytest.raises(KeyError, match="no knot has a cost 'goal'"):
        solve_many(reach(), references={"goal": np.zeros((2, 3))}, start=held())
    with pytest.raises(KeyError, match="no knot has a cost 'goal'"):
        solve_many(reach(), weights={"goal": np.ones(2)}, start=held())
    with pytest.raises(TypeError, match="x0: expected real numbers, found complex ones"):
        solve_many(reach(), np.ones((2, 14)) * 1j, start=held())

    def integrate(_: int, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
        return x + u.sum(), 0.5 * float(x @ x + u @ u)

    problem = Problem([1.0], [Action(1, 1, integrate)], [0] * 3, Action(1, 0, integrate))
    with pytest.raises(ProblemError, match="copied"):
        solve_many(problem, [[1.0], [2.0]], start=(np.ones((4, 1)), np.zeros((3, 1))))
