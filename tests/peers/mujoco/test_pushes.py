"""Tests model predictive control of a trotting quadruped in MuJoCo: speed and ripple, and pushes that it survives."""

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import pytest
from pushes import ANGLES, BEGIN, SPEED, Push, run, survives
from trotting import Solver

EXPECTED: dict[Solver, dict[float, int]] = {
    "tick2": {12.0: 16, 16.0: 16, 20.0: 16, 24.0: 15, 28.0: 9},
    "full_step": {12.0: 16, 16.0: 16, 20.0: 14},
}
"""Smallest number of survived pushes of 16, by their impulse (N s)."""
RIPPLE = 0.05
"""Largest standard deviation of the pitch rate in a steady trot (rad/s)."""


@pytest.mark.parametrize("solver", EXPECTED)
def test_the_trot_is_steady(solver: Solver) -> None:
    calm = run("go2", solver, 3.0)
    assert not calm.fallen and calm.velocities[:, 0].mean() == pytest.approx(SPEED, abs=0.02)
    assert calm.velocities[:, 4].std() < RIPPLE


def test_a_push_is_survived() -> None:
    """Compares one linearisation in each tick with limits as rows, and one iteration of FDDP with limits as costs."""
    push = Push(20.0, 90.0, BEGIN[0])
    assert survives("go2", "tick2", push)
    assert not survives("go2", "fddp1", push)


@pytest.mark.skipif("CONDYLE_FULL" not in os.environ, reason="takes minutes: ./test full")
@pytest.mark.parametrize("solver", EXPECTED)
def test_pushes_are_survived(solver: Solver) -> None:
    with ProcessPoolExecutor() as pool:
        for impulse, least in EXPECTED[solver].items():
            pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
            same = [[value] * len(pushes) for value in ("go2", solver)]
            assert sum(pool.map(survives, *same, pushes)) >= least, impulse
