"""Tests of soft limits: conditions of optimality by differences for all robots, problems that hard limits make
infeasible, a closed form, receding horizons, files and pickles, and invalid arguments.
"""

import functools
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import test_interior_point as hard
from optimality import Case, conditions, constraints
from test_interior_point import ARM, DT, DUAL, PRIMAL, X0

from condyle.optimal import (
    AugmentedLagrangian,
    Cost,
    FreeDynamics,
    InteriorPoint,
    Limit,
    Outcome,
    Problem,
    ProblemError,
    Residual,
)

CASES = [hard.arm, hard.quadruped, hard.humanoid, hard.cartpole, hard.accelerations, hard.landing]
WEIGHTS = [(0.05, 0.0), (0.0, 0.5), (0.02, 0.1)]


def soften(make: Callable[[], Case], soft: tuple[float, float], patch: pytest.MonkeyPatch) -> Case:
    """Returns a case with soft limits only, equations included."""
    with patch.context() as inside:
        inside.setattr(hard, "Limit", functools.partial(Limit, soft=soft))
        return make()


def distances(case: Case, solution: Any) -> list[np.ndarray]:
    """Returns the signed distances of all rows from their bounds, 0 within them."""
    us = [np.array(u) for u in solution.us]
    found = []
    for t, g in enumerate(constraints(case, np.array(solution.xs), us)):
        lower, upper = case.bounds(t)
        found.append(np.maximum(g - upper, 0.0) - np.maximum(lower - g, 0.0))
    return found


def check_multipliers(case: Case, solution: Any, outcome: Outcome, soft: tuple[float, float], bounds: int) -> None:
    """Checks that each multiplier is a derivative of the cost linear · e + ½ quadratic · e² of its row, and that the
    outcome reports this cost and the rows that gave way. `bounds` is the number of bounds on the controls of a knot.
    """
    linear, quadratic = soft
    total, rows = 0.0, []
    fixed = fixed_rows(case, solution)
    for t, (e, y) in enumerate(zip(distances(case, solution), outcome.multipliers, strict=True)):
        first, end = (case.kept, len(y) - bounds) if t < len(solution.us) else (0, len(y))
        e[:first], e[end:] = 0.0, 0.0  # equations of inverse dynamics and bounds on controls are always hard
        total += float((linear * np.abs(e) + 0.5 * quadratic * e**2).sum())
        rows += [(t, row) for row in np.flatnonzero(np.abs(e) > 1e-4)]
        for row in range(first, end):
            if t == 0 and row in fixed:
                assert y[row] == 0.0
            elif abs(e[row]) > 1e-4:
                assert y[row] == pytest.approx(
                    np.sign(e[row]) * (linear + quadratic * abs(e[row])), abs=5e-5 + 2e-3 * linear
                )
            else:
                assert abs(y[row]) <= linear + quadratic * 1e-4 + 5e-5
    assert outcome.soft_cost == pytest.approx(total, rel=1e-6, abs=1e-6)
    assert [(row.knot, row.row) for row in outcome.gave_way] == rows
    assert all(row.kind == "constraint" and row.name is not None for row in outcome.gave_way)


def fixed_rows(case: Case, solution: Any) -> set[int]:
    """Returns the rows of knot 0 that do not depend on controls."""
    us = [np.array(u) for u in solution.us]
    before = constraints(case, np.array(solution.xs), us)[0]
    after = constraints(case, np.array(solution.xs), [u + 0.1 + 0.01 * np.arange(len(u)) for u in us])[0]
    return set(np.flatnonzero(before == after))


@pytest.mark.parametrize("make", CASES)
@pytest.mark.parametrize("soft", WEIGHTS)
def test_a_solution_satisfies_the_conditions_of_optimality(
    make: Callable[[], Case], soft: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    if make is hard.cartpole and soft == WEIGHTS[0]:
        soft = (0.1, 0.0)  # for less, this start leads to a saddle point
    case = soften(make, soft, monkeypatch)
    solver = InteriorPoint(case.problem, tolerance=DUAL)
    solution = solver.solve(case.xs, case.us)
    outcome = solver.outcome
    assert solution.status == "converged" and outcome.primal <= DUAL
    found = conditions(case, solution, outcome)
    assert found.gradient <= found.scale * DUAL and found.gap <= DUAL
    check_multipliers(case, solution, outcome, soft, bounds=int(make is hard.cartpole))
    assert outcome.cost == solution.cost == pytest.approx(case.free.evaluate(solution.xs, solution.us).cost, rel=1e-9)


@pytest.mark.parametrize("make", [hard.arm, hard.cartpole, hard.accelerations])
@pytest.mark.parametrize("soft", WEIGHTS)
def test_the_augmented_lagrangian_finds_the_same_cost(
    make: Callable[[], Case], soft: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    if make is hard.cartpole and soft == WEIGHTS[0]:
        soft = (0.1, 0.0)  # for less, this start leads to a saddle point
    case = soften(make, soft, monkeypatch)
    ours = InteriorPoint(case.problem, tolerance=1e-7)
    solution = ours.solve(case.xs, case.us)
    other = AugmentedLagrangian(case.problem, tolerance=1e-7, tolerance_dual=1e-6, inner={"max_iterations": 200})
    again = other.solve(solution.xs, solution.us)  # a problem may have several minima
    assert solution.status == again.status == "converged"
    total = [outcome.cost + outcome.soft_cost for outcome in (ours.outcome, other.outcome)]
    assert total[0] == pytest.approx(total[1], rel=1e-6)


def held(weak: float, soft: tuple[float, float] | None) -> tuple[Problem, np.ndarray, np.ndarray]:
    """Returns an arm that must stay near a posture, with limits on its efforts. It needs 30 N m."""
    control, near = Residual.control(np.zeros(7)), np.full(14, 0.1)
    limits = [
        Limit("weak", control, np.full(7, -weak), np.full(7, weak), soft=soft),
        Limit("near", Residual.state(X0), -near, near),
    ]
    knot = FreeDynamics(ARM, DT, [Cost("effort", 1e-3, control)], limits=limits)
    problem = Problem(X0, [knot], [0] * 10, FreeDynamics(ARM, None, []))
    return problem, np.tile(X0, (11, 1)), np.tile(knot.quasi_static(X0), (10, 1))


def test_efforts_that_are_too_weak_give_way() -> None:
    problem, xs, us = held(10.0, None)
    assert InteriorPoint(problem).solve(xs, us).status != "converged"
    problem, xs, us = held(10.0, (0.1, 0.01))
    solver = InteriorPoint(problem)
    solution = solver.solve(xs, us)
    assert solution.status == "converged" and solver.outcome.primal <= DUAL
    assert np.abs(np.array(solution.xs[:-1]) - X0).max() <= 0.1 + PRIMAL
    assert {row.name for row in solver.outcome.gave_way} == {"weak"}
    e = np.maximum(np.abs(np.array(solution.us)) - 10.0, 0.0)
    assert solver.outcome.soft_cost == pytest.approx((0.1 * e + 0.005 * e**2).sum(), rel=1e-9)
    largest = max(solver.outcome.gave_way, key=lambda row: row.amount)
    assert largest.amount == pytest.approx(e.max()) and largest.amount > 1.0


def test_receding_horizons_carry_soft_limits() -> None:
    problem, xs, us = held(25.0, (0.01, 0.01))
    solver = InteriorPoint(problem)
    x = np.array(solver.solve(xs, us).xs[1])
    for _ in range(10):
        solver.shift(0)
        problem.set_x0(x)
        plan = solver.tick(3)
        assert np.isfinite(plan.xs).all() and np.isfinite(plan.us).all()
        x = np.array(plan.xs[1])
    problem.set_x0(X0)  # ticks leave the state a little beyond the hard limit
    assert solver.resume().status == "converged" and solver.outcome.gave_way


def test_weights_are_checked_and_copied() -> None:
    limit = Limit("far", Residual.frame_translation(ARM, "tool", [3.0, 0.0, 0.0]), soft=(1.0, 0.5))
    assert repr(limit) == "<condyle.optimal.Limit 'far', soft (1.0, 0.5)>"
    assert repr(pickle.loads(pickle.dumps(limit))) == repr(limit)
    problem, xs, us = held(10.0, (0.1, 0.01))
    expected = InteriorPoint(problem)
    expected.solve(xs, us)
    copy = InteriorPoint(pickle.loads(pickle.dumps(problem)))
    copy.solve(xs, us)
    assert copy.outcome.soft_cost == expected.outcome.soft_cost > 0.1
    for wrong in [(-1.0, 0.0), (0.0, 0.0), (np.inf, 0.0), (0.0, np.nan)]:
        with pytest.raises(ProblemError, match=r"weak.*soft weights"):
            held(10.0, wrong)
    with pytest.raises(TypeError):
        Limit("far", Residual.control(np.zeros(7)), soft=1.0)  # type: ignore[arg-type]
