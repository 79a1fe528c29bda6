"""Tests of `solve_many`: rows equal single solves, whichever problems are solved together."""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    InteriorPoint,
    Limit,
    Problem,
    ProblemError,
    Residual,
    solve_many,
)

ARM = condyle.robots.arm7()
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
N = 12


def reach(limits: list[Limit] | None = None) -> Problem:
    rest, effort = Cost("rest", 0.1, Residual.state(REST)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))
    point = Cost("reach", 100.0, Residual.frame_translation(ARM, "tool", [0.35, 0.2, 0.6]))
    knot = FreeDynamics(ARM, 0.02, [rest, effort], limits=limits)
    return Problem(REST, [knot], [0] * N, FreeDynamics(ARM, None, [rest, point]))


def held() -> tuple[np.ndarray, np.ndarray]:
    xs = np.tile(REST, (N + 1, 1))
    return xs, reach().quasi_static(xs)


def assert_near(found: Any, expected: Any, name: str) -> None:
    """Asserts that two results of `Fddp` differ by rounding at most: together, sweeps have another order of sums."""
    assert np.abs(found - expected).max() <= 1e-11 * (1.0 + np.abs(expected).max()), name


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
        assert (found.status[i], found.iterations[i]) == (alone.status, len(alone.trace))
        assert_near(found.cost[i], alone.cost, "cost")
        for name in ("xs", "us", "K", "k"):
            assert_near(getattr(found, name)[i], getattr(alone, name), name)


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


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("solver", [InteriorPoint, AugmentedLagrangian])
def test_rows_of_solvers_with_limits_are_single_solves(solver: Any, threads: int) -> None:
    limits = [Limit("weak", Residual.control(np.zeros(7)), [-25.0] * 7, [25.0] * 7)]
    rng, start = np.random.default_rng(3), held()
    x0s, goals = rng.normal(REST, 0.1, (5, 14)), rng.normal([0.35, 0.2, 0.6], 0.1, (5, 3))
    x0s[1, 2] = np.nan
    found = solve_many(
        reach(limits),
        x0s,
        references={"reach": goals},
        start=start,
        solver=solver,
        settings={"tolerance": 1e-5},
        keep=["xs", "us", "K", "k"],
        threads=threads,
    )
    assert found.status[1] == "error" and found.error[1].startswith("variation 1: ProblemError")
    for i in (0, 2, 3, 4):
        problem = reach(limits)
        problem.set_x0(x0s[i])
        problem.set_references("reach", np.tile(goals[i], (N + 1, 1)))
        xs = start[0].copy()
        xs[0] = x0s[i]
        alone = solver(problem, tolerance=1e-5).solve(xs, start[1])
        assert alone.status == "converged"
        assert (found.status[i], found.iterations[i], found.cost[i]) == (alone.status, len(alone.trace), alone.cost)
        for name in ("xs", "us", "K", "k"):
            assert np.array_equal(getattr(found, name)[i], getattr(alone, name)), name
    assert found.us is not None and np.nanmax(abs(found.us)) < 25.0 + 1e-3


def test_a_time_budget_of_inner_solves_ends_a_call() -> None:
    found = solve_many(
        reach(),
        np.tile(REST, (2000, 1)),
        start=held(),
        solver=AugmentedLagrangian,
        settings={"inner": {"time_budget": 0.01}},
    )
    assert found.status[-1] == "not_started"


def trot(kp: float = 0.0) -> Problem:
    robot = condyle.robots.quadruped()
    x0 = np.r_[condyle.neutral(robot), np.zeros(18)]
    x0[7:19] = np.tile([0.0, 0.7, -1.4], 4)
    data = condyle.Data(robot)
    names = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
    feet = {
        name: condyle.ContactConstraint(
            name, "point", kp=kp, kd=20.0, placement=condyle.frame_placement(robot, data, x0[:19], name)
        )
        for name in names
    }
    rest, effort = Cost("rest", 0.1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))
    com = Cost("com", 10.0, Residual.center_of_mass([0.0, 0.0, 0.35]))
    knot = ContactDynamics(robot, feet, 0.02, [rest, effort, com])
    return Problem(x0, [knot], [0] * 10, FreeDynamics(robot, None, [rest, com]))


def test_contacts() -> None:
    problem = trot()
    x0 = problem.x0
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


@pytest.mark.parametrize("whole", [False, True])
def test_targets_of_contacts(whole: bool) -> None:
    problem = trot(kp=50.0)
    xs = np.tile(problem.x0, (11, 1))
    start = xs, problem.quasi_static(xs)
    robot = condyle.robots.quadruped()
    places = np.tile(condyle.frame_placement(robot, condyle.Data(robot), problem.x0[:19], "LF_foot"), (9, 1, 1))
    places[:, :3, 3] += np.random.default_rng(1).normal(0.0, 0.02, (9, 3))
    found = solve_many(problem, contacts={"LF_foot": places if whole else places[:, :3, 3]}, start=start)
    costs = []
    for i, place in enumerate(places):
        problem.set_contact("LF_foot", placement=place)
        alone = Fddp(problem).solve(*start)
        costs.append(alone.cost)
        assert found.status[i] == alone.status
        assert np.allclose(found.xs[i], alone.xs, rtol=0.0, atol=1e-8)
    assert np.ptp(costs) > 1e-6  # the targets have an effect
    with pytest.raises(KeyError, match="no knot has a contact 'foot'"):
        solve_many(problem, contacts={"foot": places}, start=start)


def test_each_problem_has_a_start() -> None:
    x0s = np.random.default_rng(5).normal(REST, 0.2, (6, 14))
    first = solve_many(reach(), x0s, start=held(), settings={"max_iterations": 2})
    for start in (first, (first.xs, first.us)):
        found = solve_many(reach(), x0s, start=start)
        for i, x0 in enumerate(x0s):
            problem = reach()
            problem.set_x0(x0)
            assert first.xs is not None and first.us is not None
            alone = Fddp(problem).solve(first.xs[i], first.us[i])
            assert_near(found.xs[i], alone.xs, "xs")
            assert found.iterations[i] == len(alone.trace)
    assert len(solve_many(reach(), start=first).cost) == 6  # the starts alone determine the number of problems


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


@pytest.mark.parametrize("solver", [Fddp, InteriorPoint, AugmentedLagrangian])
def test_progress_and_its_exceptions(solver: Any) -> None:
    told: list[tuple[int, int]] = []
    solve_many(reach(), np.tile(REST, (20, 1)), start=held(), solver=solver, progress=lambda *now: told.append(now))
    assert told[-1] == (20, 20)
    calls: list[int] = []

    def fail(done: int, _: int) -> None:
        calls.append(done)
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError, match="no more"):
        solve_many(reach(), np.tile(REST, (5000, 1)), start=held(), solver=solver, progress=fail)
    assert len(calls) == 1 and calls[0] < 5000  # the call ends before all problems are solved


@pytest.mark.parametrize(
    ("kind", "match", "arguments"),
    [
        (ValueError, r"x0: expected states, \(V, 14\), found the shape \(3, 7\)", {"x0": np.zeros((3, 7))}),
        (ValueError, "x0: expected the states of several problems", {"x0": np.zeros(14)}),
        (ValueError, "x0: expected the states of several problems", {}),
        (TypeError, r"x0: expected states, .*, found 'rest'", {"x0": "rest"}),
        (
            ValueError,
            "references: expected None with an iterator x0, whose items may be dicts of data",
            {"x0": iter([REST]), "references": {"reach": np.zeros((1, 3))}},
        ),
        (
            ValueError,
            r"settings\['time_budget'\]: expected None with an iterator x0",
            {"x0": iter([REST]), "settings": {"time_budget": 1.0}},
        ),
        (ValueError, "x0: expected states, .*, found rows of different shapes", {"x0": [REST, REST[:3]]}),
        (TypeError, "x0: expected real numbers, found complex ones", {"x0": np.ones((2, 14)) * 1j}),
        (TypeError, "x0: expected states, .*, found entries of the type <U1", {"x0": [["a"] * 14]}),
        (
            ValueError,
            r"expected one number of problems, found references\['reach'\]: 2, x0: 3",
            {"x0": np.zeros((3, 14)), "references": {"reach": np.zeros((2, 3))}},
        ),
        (
            ValueError,
            r"found references\['rest'\]: 2, weights\['rest'\]: 3",
            {"references": {"rest": np.zeros((2, 14))}, "weights": {"rest": np.zeros(3)}},
        ),
        (
            ValueError,
            r"references\['reach'\]: expected \(V, 3\) or \(V, 13, 3\) numbers, found the shape \(2, 4\)",
            {"references": {"reach": np.zeros((2, 4))}},
        ),
        (TypeError, "references: expected a dict from names to targets, found an array", {"references": np.ones(3)}),
        (TypeError, r"references\['reach'\]: expected .* numbers, found None", {"references": {"reach": None}}),
        (TypeError, "weights: expected names as keys, found 3", {"weights": {3: np.ones(2)}}),
        (
            ValueError,
            r"weights\['rest'\]: expected \(V,\) or \(V, 13\) numbers, found the shape \(2, 4\)",
            {"weights": {"rest": np.zeros((2, 4))}},
        ),
        (ValueError, r"weights\['rest'\]: expected .* numbers, found the shape \(\)", {"weights": {"rest": 2.0}}),
        (
            ValueError,
            r"contacts\['foot'\]: expected \(V, 3\) positions or \(V, 4, 4\) placements, found the shape \(2, 6\)",
            {"contacts": {"foot": np.zeros((2, 6))}},
        ),
        (ValueError, "keep: expected some of 'xs', 'us', 'K' and 'k', found", {"x0": np.zeros((2, 14)), "keep": ["x"]}),
        (TypeError, "keep: expected a list of some of .*, found 'xs'", {"x0": np.zeros((2, 14)), "keep": "xs"}),
        (TypeError, "keep: expected a list of some of .*, found None", {"x0": np.zeros((2, 14)), "keep": None}),
        (ValueError, "threads: expected at least 1, found 0", {"x0": np.zeros((2, 14)), "threads": 0}),
        (ValueError, "threads: expected at least 1, found -3", {"x0": np.zeros((2, 14)), "threads": -3}),
        (TypeError, "threads: expected an integer, found '2'", {"x0": np.zeros((2, 14)), "threads": "2"}),
        (TypeError, "threads: expected an integer, found 1.5", {"x0": np.zeros((2, 14)), "threads": 1.5}),
        (TypeError, "settings: expected a dict from names to values, found", {"x0": np.zeros((2, 14)), "settings": 3}),
        (
            TypeError,
            "progress: expected a bool or a function, found 'yes'",
            {"x0": np.zeros((2, 14)), "progress": "yes"},
        ),
        (TypeError, "solver: expected the class Fddp, .*, found 'fddp'", {"x0": np.zeros((2, 14)), "solver": "fddp"}),
        (TypeError, "solver: expected the class .*, found a Fddp", {"x0": np.zeros((2, 14)), "solver": Fddp(reach())}),
        (
            TypeError,
            r"start: expected a Solution, or states and controls \(xs, us\), found 3",
            {"x0": np.zeros((2, 14)), "start": 3},
        ),
        (
            ValueError,
            r"start: expected states of the shape \(13, 14\), found an array of the shape \(5, 14\)",
            {"x0": np.zeros((2, 14)), "start": (np.zeros((5, 14)), np.zeros((12, 7)))},
        ),
        (
            ValueError,
            r"start: us: expected shape \(12, 7\), found \(12, 6\)",
            {"x0": np.zeros((2, 14)), "start": (np.zeros((13, 14)), np.zeros((12, 6)))},
        ),
        (
            ValueError,
            r"start: expected states of the shape \('V', 13, 14\), found an array of the shape \(2, 5, 14\)",
            {"x0": np.zeros((2, 14)), "start": (np.zeros((2, 5, 14)), np.zeros((2, 12, 7)))},
        ),
        (
            ValueError,
            "start: expected controls of 2 problems",
            {"x0": np.zeros((2, 14)), "start": (np.zeros((2, 13, 14)), np.zeros((12, 7)))},
        ),
        (
            ValueError,
            "expected one number of problems, found x0: 3, start: 2",
            {"x0": np.zeros((3, 14)), "start": (np.zeros((2, 13, 14)), np.zeros((2, 12, 7)))},
        ),
    ],
)
def test_wrong_arguments_are_named(kind: type[Exception], match: str, arguments: dict[str, Any]) -> None:
    with pytest.raises(kind, match=match):
        solve_many(reach(), **{"start": held(), **arguments})


def test_wrong_problems_and_settings_are_named() -> None:
    with pytest.raises(TypeError, match="problem: expected a Problem, found None"):
        solve_many(None)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="settings: there is no setting 'tolerances'"):
        solve_many(reach(), np.zeros((2, 14)), start=held(), settings={"tolerances": 1.0})
    no_states = solve_many(reach(), np.tile(REST, (2, 1)), start=held(), keep=["us"])
    with pytest.raises(ValueError, match="start: expected Variations with xs and us"):
        solve_many(reach(), start=no_states)


def test_problems_of_an_iterator() -> None:
    x0s = np.random.default_rng(4).normal(REST, 0.1, (70, 14))
    found = solve_many(reach(), x0s, start=held())
    for items in (iter(x0s), ({"x0": x0, "weights": {"rest": 0.1}} for x0 in x0s)):
        again = solve_many(reach(), items, start=held(), threads=2)
        assert np.array_equal(again.xs, found.xs)
        assert again.error.tolist() == [""] * 70


def test_no_problems() -> None:
    found = solve_many(reach(), np.zeros((0, 14)), start=held())
    assert found.status.shape == found.error.shape == (0,)
    assert found.xs is not None and found.xs.shape == (0, N + 1, 14)


def test_unknown_costs_and_actions_without_copies() -> None:
    with pytest.raises(KeyError, match="no knot has a cost 'goal'"):
        solve_many(reach(), references={"goal": np.zeros((2, 3))}, start=held())
    with pytest.raises(KeyError, match="no knot has a cost 'goal'"):
        solve_many(reach(), weights={"goal": np.ones(2)}, start=held())

    def integrate(_: int, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
        return x + u.sum(), 0.5 * float(x @ x + u @ u)

    problem = Problem([1.0], [Action(1, 1, integrate)], [0] * 3, Action(1, 0, integrate))
    with pytest.raises(ProblemError, match="copied"):
        solve_many(problem, [[1.0], [2.0]], start=(np.ones((4, 1)), np.zeros((3, 1))))
