"""Compares robots that URDF cannot describe with Pinocchio 4.1. Calls of each library build the robots."""

import checks
import numpy as np
import pinocchio as pin
import pytest
from comparison import Pair
from random_robot import COMPOSITES, ONE, OTHERS, RandomRobot

import condyle

ROBOTS = 20
STATES = 2
SINGLE = (*ONE, *ONE, *OTHERS)
"""Kinds of joints of the random robots. Kinds with an axis occur twice in the list, so most robots have axes along x, y
or z and other axes."""
STEP = 1e-6
DIFFERENCES = 1e-6
"""Tolerance of central differences with the step STEP, relative to 1 + the largest number of Pinocchio's result."""


def check(pair: Pair, seed: int) -> None:
    for state in pair.states(STATES, seed):
        checks.check_kinematics(state)
        checks.check_motion(state)
        checks.check_centroidal(state)
        checks.check_equations_of_motion(state)
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)
        checks.check_gravity(state)
        checks.check_rnea_derivatives(state)
        assert checks.check_forward_dynamics(state)
        checks.check_configuration(state)


@pytest.mark.parametrize("seed", range(ROBOTS))
def test_single_joints(seed: int) -> None:
    robot = RandomRobot(f"built robot {seed}", seed, SINGLE, composites=False)
    robot.pair.record_size()
    checks.check_bodies(robot.pair)
    checks.check_losses(robot.pair)
    checks.check_limits(robot.pair)
    for state in robot.pair.states(STATES, seed):
        checks.check_energy(state)
        checks.check_lock(state)
    check(robot.pair, seed)
    check(robot.geared, seed)


@pytest.mark.parametrize("seed", range(ROBOTS))
def test_chains_of_joints(seed: int) -> None:
    """Compares every function for universal, spherical ZYX and composite joints, if these are chains of simple joints
    in both libraries."""
    robot = RandomRobot(f"built robot {100 + seed}", 100 + seed, (*SINGLE, *COMPOSITES), composites=False)
    robot.pair.record_size()
    checks.check_bodies(robot.pair)
    checks.check_losses(robot.pair)
    for state in robot.pair.states(STATES, seed):
        checks.check_energy(state)
    check(robot.pair, seed)
    check(robot.geared, seed)


@pytest.mark.parametrize("seed", range(ROBOTS))
def test_composite_joints(seed: int) -> None:
    """Compares robots whose universal, spherical ZYX and composite joints are single joints in Pinocchio, and chains of
    simple joints in Condyle. All functions are compared, except rates and derivatives."""
    robot = RandomRobot(f"built robot {100 + seed}", 100 + seed, (*SINGLE, *COMPOSITES), composites=True)
    ours, theirs = robot.pair.ours, robot.pair.theirs
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    firsts = [chain[0] for chain in robot.pair.chains[1:]]
    assert [ours.idx_qs[first] for first in firsts] == list(theirs.idx_qs)[1:]
    assert [ours.idx_vs[first] for first in firsts] == list(theirs.idx_vs)[1:]
    for state in robot.pair.states(STATES, seed):
        checks.check_energy(state)
        checks.check_lock(state)
    check(robot.pair, seed)
    check(robot.geared, seed)


def test_derivatives_through_composite_joints() -> None:
    """Tests that for composite joints, Condyle's ∂τ/∂q equals finite differences of Pinocchio's rnea, and that
    Pinocchio's own ∂τ/∂q does not.

    If a later version of Pinocchio has correct derivatives, `test_composite_joints` can compare derivatives, too.
    """
    pair = RandomRobot("built", 0, (*ONE, *COMPOSITES), composites=True).pair
    state = pair.states(1)[0]
    theirs, data, q, v, a = pair.theirs, pair.their_data, state.q, state.v, state.a

    def rnea(step: np.ndarray) -> np.ndarray:
        return pin.rnea(theirs, data, pin.integrate(theirs, q, step), v, a).copy()

    steps = STEP * np.eye(theirs.nv)
    dtau_dq = np.stack([(rnea(step) - rnea(-step)) / (2 * STEP) for step in steps], axis=1)
    allowed = DIFFERENCES * (1 + np.abs(dtau_dq).max())
    ours = condyle.rnea_derivatives(pair.ours, pair.data, q, v, a).dtau_dq
    assert np.abs(ours - dtau_dq).max() < allowed
    assert np.abs(pin.computeRNEADerivatives(theirs, data, q, v, a)[0] - dtau_dq).max() > allowed
