"""Tests of sizes that are given as arguments: if a size is too large, an error with the size and the limit is raised
before memory is allocated.
"""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ConstrainedAction,
    ContactDynamics,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
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
    """Checks that the maximum number of knots depends on the size of the knots, since a solver has matrices for each
    knot.
    """
    with pytest.raises(
        ProblemError, match="^numbers in the matrices of all knots: .* more than the limit of 268435456$"
    ):
        problem(nx=2000, knots=1000)
    problem(nx=20, knots=1000)


def test_numbers_without_memory_are_free() -> None:
    """Checks that arguments that do not determine a size of memory, such as numbers of iterations, have no upper
    limit.
    """
    xs, us = np.zeros((4, 1)), np.zeros((3, 1))
    solution = Fddp(problem(), max_iterations=2**63, time_budget=1e18).solve(xs, us)
    assert solution.status == "converged"
    solution = AugmentedLagrangian(problem(), {"time_budget": 1e18}, max_solves=2**63).solve(xs, us)
    assert solution.status == "converged"
    assert condyle.DivideConquer(ARM, grain=2**63).size.runs == 1


def test_more_states_than_memory() -> None:
    """Checks that NumPy raises an error for arguments and results that are too large for the memory."""
    q = np.broadcast_to(np.zeros(7), (10**13, 7))
    with pytest.raises(MemoryError):
        condyle.gravity(ARM, condyle.Data(ARM), q)


FIXED = """<robot name="fixed">
  <link name="base"/>
  <link name="arm"><inertial>
    <mass value="2"/><origin xyz="0 0 1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
  </inertial></link>
  <joint name="bolt" type="fixed"><origin xyz="1 0 0"/><parent link="base"/><child link="arm"/></joint>
</robot>"""


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "runge_kutta_4", "variational"])
def test_nothing_to_simulate(integrator: Any) -> None:
    simulation = condyle.simulation.Simulation(condyle.Model.from_urdf_str(FIXED), integrator)
    assert simulation.run(10) == simulation.step([]) == simulation.run(3, lambda now: None) == "done"
    assert simulation.time == pytest.approx(14e-3)
    assert simulation.q.shape == simulation.v.shape == (0,)


def test_nothing_to_control() -> None:
    """Checks that a problem of a robot without coordinates is an error, but that knots of such a robot can be
    created.
    """
    robot = condyle.Model.from_urdf_str(FIXED)
    knot = FreeDynamics(robot, 0.1, [])
    assert knot.quasi_static([]).shape == (0,)
    for other in (knot, FreeInverseDynamics(robot, 0.1, []), ContactDynamics(robot, {}, 0.1, [])):
        with pytest.raises(ProblemError, match="the states have no numbers: a problem needs at least one"):
            Problem([], [other], [0] * 3, FreeDynamics(robot, None, []))
    with pytest.raises(ProblemError, match="the states have no numbers"):
        Problem([], [Lqr(np.zeros((0, 0)))], [0], Lqr(np.zeros((0, 0))))


def test_nothing_to_factor() -> None:
    robot, nothing = condyle.Model.from_urdf_str(FIXED), np.zeros((0, 0))
    for factor in (condyle.Cholesky(0), condyle.Ltdl(robot)):
        factor.factorize(nothing)
        assert factor.solve([]).shape == (0,)
        assert factor.inverse().shape == factor.solve_matrix(nothing).shape == (0, 0)
    assert condyle.DivideConquer(robot, 1).aba(robot, [], [], []).shape == (0,)


def test_nothing_to_differentiate() -> None:
    robot = condyle.Model.from_urdf_str(FIXED)
    value, slope = condyle.gradient(robot, np.zeros(0), lambda x: 2.0)
    assert value == 2.0
    assert slope.shape == (0,)
    assert condyle.jacobian(robot, np.zeros(0), lambda x: np.ones(3))[1].shape == (3, 0)
    assert condyle.hessian(robot, np.zeros(0), lambda x: 2.0)[2].shape == (0, 0)
