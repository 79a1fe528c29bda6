"""Tests of `condyle.mpc.WholeBodyMpc` in MuJoCo: commands, pushes, slopes, rates, and errors of the model."""

import os
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np
import pytest
from pushes import ANGLES, BEGIN, Push
from walking import COMMANDS, CONDITIONS, LEAST, RATES, WALKERS, Conditions, Walk, at_rate, survives, walk
from world import Array

full = pytest.mark.skipif("CONDYLE_FULL" not in os.environ, reason="takes minutes: ./test full")
SHORT, LONG = 4.0, 10.0
"""Durations of a short and of a long walk (s)."""
SINCE = 2.0
"""Time since which velocities count (s)."""


def check(walked: Walk, command: tuple[float, float, float], relative: float, least: float = 0.012) -> None:
    """Checks that the robot has not fallen, and that its mean velocity is the command, with a relative error."""
    assert not walked.fallen, f"fallen at {walked.times[-1]:.2f} s"
    found = walked.velocity(SINCE)[[0, 1, 5]]
    assert np.abs(found - command).max() <= max(relative * np.abs(command).max(), least), found


@pytest.mark.parametrize("name", ["go2", "anymal", "g1", "talos"])
def test_a_robot_walks(name: str) -> None:
    command = COMMANDS[name][0]
    check(walk(name, SHORT, lambda _: command), command, 0.05)


@full
@pytest.mark.parametrize(("name", "command"), [(name, c) for name, commands in COMMANDS.items() for c in commands])
def test_a_command_is_followed(name: str, command: tuple[float, float, float]) -> None:
    seconds = 60.0 if name == "g1" else 30.0 if name == "talos" else LONG
    check(walk(name, seconds, lambda _: command), command, 0.05 if name in ("go2", "anymal") else 0.1)


def test_a_jump_of_the_command_is_followed() -> None:
    walked = walk("go2", SHORT, lambda t: (0.5 if t < 2.0 else 1.0, 0.0, 0.0))
    assert walked.velocity(3.0)[0] == pytest.approx(1.0, rel=0.03)


@pytest.mark.parametrize("period", [0.01, 1.0 / 130.0, 0.005])
def test_the_speed_does_not_depend_on_the_rate(period: float) -> None:
    check(walk("go2", SHORT, lambda _: (0.5, 0.0, 0.0), conditions=Conditions(period=period)), (0.5, 0.0, 0.0), 0.02)


@full
@pytest.mark.parametrize("conditions", CONDITIONS["go2"])
def test_errors_of_the_model_are_survived(conditions: Conditions) -> None:
    walked = walk("go2", LONG, lambda _: (0.5, 0.0, 0.0), conditions=conditions, latency=conditions.late)
    check(walked, (0.5, 0.0, 0.0), 0.05)


def test_a_push_is_survived() -> None:
    assert survives("go2", Push(24.0, 90.0, BEGIN[0]))


@full
@pytest.mark.parametrize("name", LEAST)
def test_pushes_are_survived(name: str) -> None:
    with ProcessPoolExecutor() as pool:
        for impulse, least in LEAST[name].items():
            pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
            assert sum(pool.map(survives, [name] * len(pushes), pushes)) >= least, impulse


@full
@pytest.mark.parametrize(("name", "impulses"), [("go2", (12.0, 16.0, 20.0, 24.0)), ("g1", (6.0, 9.0))])
def test_pushes_are_survived_at_the_highest_rate(name: str, impulses: tuple[float, ...]) -> None:
    with ProcessPoolExecutor() as pool:
        for impulse in impulses:
            pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
            survived = pool.map(survives, [name] * len(pushes), pushes, [at_rate(RATES[name])] * len(pushes))
            assert sum(survived) >= 15, impulse


@full
@pytest.mark.parametrize("seed", range(10))
def test_random_commands_are_survived(seed: int) -> None:
    random = np.random.default_rng(seed)
    commands = random.uniform(-1.0, 1.0, (30, 3)) * [0.8, 0.4, 1.2]
    pushes = [Push(15.0, random.uniform(0.0, 360.0), begin) for begin in np.arange(3.0, 58.0, 5.0)]
    walked = walk("go2", 60.0, lambda t: tuple(commands[int(t // 2.0)]), pushes)
    assert not walked.fallen, f"fallen at {walked.times[-1]:.2f} s"


def test_planned_forces_stay_in_their_cones() -> None:
    """Checks ‖f_t‖ − μ f_n, by which planned forces leave the friction cone (N)."""
    first, others = [], []

    def observe(forces: Array) -> None:
        beyond = np.hypot(forces[..., 0], forces[..., 1]) - WALKERS["go2"].friction * forces[..., 2]
        first.append(beyond[0].max())
        others.append(beyond.max())

    walked = walk("go2", SHORT, lambda _: (1.0, 0.0, 0.0), observe=observe)
    assert not walked.fallen
    assert max(first) < 0.5 and max(others) < 2.0
