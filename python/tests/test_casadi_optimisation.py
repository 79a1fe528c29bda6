"""Tests of optimisations by IPOPT with functions of `condyle.casadi`. For comparison, the same problems are solved with
CasADi expressions.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("casadi")
sys.path.append(str(Path(__file__).parents[2] / "benches" / "peers"))

import casadi_collocation
import casadi_jump as jump
from casadi_expressions import Expressions

import condyle
import condyle.casadi

# Tolerances: the iterates agree up to rounding, and IPOPT stops at an error of 1e-8 in its scaled equations.
SAME = 1e-6
ROUNDING = 1e-10


def solved(transcription: Callable[[], Any]) -> tuple[float, int]:
    opti, _ = transcription()
    opti.solver("ipopt", {"print_time": False}, casadi_collocation.SETTINGS)
    solution = opti.solve()
    return float(solution.value(opti.f)), solution.stats()["iter_count"]


@pytest.mark.parametrize("problem", ["swing_up", "reach"])
def test_the_same_motion_as_by_expressions(problem: str) -> None:
    (cost, iterations), (expected, as_many) = map(solved, casadi_collocation.PROBLEMS[problem]())
    assert abs(cost - expected) < SAME * abs(expected)
    assert iterations == as_many


def test_the_functions_of_a_jump_are_those_of_the_expressions() -> None:
    robot = condyle.robots.quadruped()
    q, (v, tau) = condyle.random_configuration(robot, seed=2), np.random.default_rng(0).standard_normal((2, robot.nv))
    ours = condyle.casadi.constrained_dynamics(robot, jump.contacts())
    theirs = Expressions(robot).constrained_dynamics(list(jump.FEET), jump.contacts()[0].kd)
    for x, y in zip(ours(q, v, tau), theirs(q, v, tau), strict=True):
        assert np.abs(np.array(x - y)).max() < ROUNDING * (1 + np.abs(np.array(y)).max())
