"""Sizes that an argument gives: an error with the number and the limit, before memory is asked for."""

import re
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ConstrainedAction,
    Fddp,
    FrictionCone,
    Lqr,
    Problem,
    ProblemError,
)


def problem(nx: int = 1, knots: int = 3) -> Problem:
    return Problem(np.zeros(nx), [Action(nx, 1, still)], [0] * knots, Action(nx, 0, end))


def still(_t: int, x: Any, u: Any) -> tuple[Any, float]:
    return x + u, float(u @ u)


def end(_t: int, x: Any, _u: Any) -> tuple[None, float]:
    return None, float(x @ x)


ARM = condyle.robots.arm7()
HUGE: dict[str, tuple[Any, int]] = {
    "threads of a Data": (lambda: condyle.Data(ARM, threads=10**6), 1024),
    "threads of a solver": (lambda: Fddp(problem(), threads=10**7), 1024),
    "segments of a solver": (lambda: Fddp(problem(), segments=10**7), 1024),
    "threads of an inner solver": (lambda: AugmentedLagrangian(problem(), {"threads": 10**7}), 1024),
    "step lengths": (lambda: Fddp(problem(), step_lengths=10**9), 60),
    "a factor": (lambda: condyle.Cholesky(2**20), 4096),
    "facets": (lambda: FrictionCone(0.5, facets=10**9), 1000),
    "rounds of a constraint": (lambda: condyle.ConstraintSet(ARM, [], iterations=10**12), 10_000),
    "states of an action": (lambda: Action(10**9, 1, still), 4096),
    "controls of an action": (lambda: Action(1, 10**9, still), 4096),
    "a constraint": (lambda: ConstrainedAction(Action(1, 1, still), 10**9, still), 4096),
    "A of an LQ knot": (lambda: Lqr(range(10**9)), 4096),
    "R of an LQ knot": (lambda: Lqr([[1.0]], R=range(10**9)), 4096),
    "B of an LQ knot": (lambda: Lqr([[1.0]], B=[range(10**9)]), 4096),
}


@pytest.mark.parametrize("name", HUGE)
def test_sizes_are_limited(name: str) -> None:
    make, most = HUGE[name]
    with pytest.raises((ValueError, ProblemError), match=rf"\b{most}\b"):
        make()


def test_a_horizon_is_limited() -> None:
    """By the size of its knots, as a solver has matrices of them."""
    with pytest.raises(ProblemError, match=re.escape("the horizon: expected matrices of at most 1.1e9 numbers")):
        problem(nx=2000, knots=1000)
    problem(nx=20, knots=1000)


def test_numbers_without_memory_are_free() -> None:
    """Where a number only says when to stop, any is good."""
    xs, us = np.zeros((4, 1)), np.zeros((3, 1))
    solution = Fddp(problem(), max_iterations=2**63, time_budget=1e18).solve(xs, us)
    assert solution.status == "converged"
    solution = AugmentedLagrangian(problem(), {"time_budget": 1e18}, max_solves=2**63).solve(xs, us)
    assert solution.status == "converged"
    assert condyle.DivideConquer(ARM, grain=2**63).size.runs == 1


def test_more_states_than_memory() -> None:
    """NumPy says so, of arguments and of results."""
    q = np.broadcast_to(np.zeros(7), (10**13, 7))
    with pytest.raises(MemoryError):
        condyle.gravity(ARM, condyle.Data(ARM), q)
