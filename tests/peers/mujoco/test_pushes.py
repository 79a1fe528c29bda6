"""Tests model predictive control of a quadruped and a humanoid in MuJoCo: a steady walk, and survived pushes."""

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import pytest
from predictive import Solver
from pushes import ANGLES, BEGIN, ROBOTS, Push, run, survives

LEAST: dict[tuple[str, Solver], dict[float, int]] = {
    ("go2", "tick2"): {12.0: 16, 16.0: 16, 20.0: 16, 24.0: 15, 28.0: 9},
    ("go2", "feedback2"): {12.0: 16, 16.0: 16, 20.0: 16, 24.0: 15, 28.0: 12},
    ("go2", "full_step"): {12.0: 16, 16.0: 16, 20.0: 14},
    ("g1", "tick2"): {6.0: 15, 12.0: 12},
}
"""Smallest number of survived pushes of 16, by their impulse (N s)."""
RIPPLE = 0.05
"""Largest standard deviation of the pitch rate in a steady walk (rad/s)."""


@pytest.mark.parametrize(("name", "solver"), LEAST)
def test_the_walk_is_steady(name: str, solver: Solver) -> None:
    calm = run(name, solver, 3.5)
    assert not calm.fallen and calm.velocities[:, 0].mean() == pytest.approx(ROBOTS[name].speed, abs=0.03)
    assert calm.velocities[:, 4].std() < RIPPLE


@pytest.mark.parametrize("rate", [50.0, 100.0, 130.0, 200.0])
def test_a_trot_is_steady_at_any_rate(rate: float) -> None:
    """Compares the trot with the trot of a controller that ticks once in each knot. The commanded speed is 0.5 m/s."""
    calm = run("go2", "tick2", 3.5, rate=rate)
    assert not calm.fallen and calm.velocities[:, 0].mean() == pytest.approx(ROBOTS["go2"].speed, rel=0.02)
    assert calm.velocities[:, 4].std() < RIPPLE


def test_steps_may_take_any_time() -> None:
    """Checks steps of 275 ms, no multiple of the knots or of the period."""
    gait = ROBOTS["go2"].gait._replace(swing=0.23, both=0.045)
    calm = run("go2", "tick2", 3.5, rate=130.0, gait=gait)
    assert not calm.fallen and calm.velocities[:, 0].mean() == pytest.approx(ROBOTS["go2"].speed, rel=0.02)
    assert calm.velocities[:, 4].std() < RIPPLE


def test_a_push_is_survived() -> None:
    """Pushes the robot so hard that it falls with one iteration of FDDP in each tick."""
    assert survives("go2", "tick2", Push(20.0, 90.0, BEGIN[0]))


@pytest.mark.skipif("CONDYLE_FULL" not in os.environ, reason="takes minutes: ./test full")
@pytest.mark.parametrize(("name", "solver"), LEAST)
def test_pushes_are_survived(name: str, solver: Solver) -> None:
    with ProcessPoolExecutor() as pool:
        for impulse, least in LEAST[name, solver].items():
            pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
            same = [[value] * len(pushes) for value in (name, solver)]
            assert sum(pool.map(survives, *same, pushes)) >= least, impulse
