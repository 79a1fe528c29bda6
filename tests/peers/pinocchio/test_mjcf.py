"""Compares random robots with Pinocchio 4.1; both libraries read the same MJCF."""

from pathlib import Path

import checks
import numpy as np
import pinocchio as pin
import pytest
from comparison import Pair
from random_mjcf import RandomMjcf

import condyle

ROBOTS = 30
STATES = 2


@pytest.mark.parametrize("seed", range(ROBOTS))
def test_random_robot(seed: int, tmp_path: Path) -> None:
    """Compares random robots. Several joints on one body are one composite joint in Pinocchio, and a chain of bodies in
    Condyle."""
    path = tmp_path / "robot.xml"
    path.write_text(RandomMjcf(seed).text, encoding="utf-8")
    theirs, ours = pin.buildModelFromMJCF(str(path)), condyle.Model.from_mjcf(path)
    assert ours.warnings == []
    chains, first = [[0]], 1
    for joint in list(theirs.joints)[1:]:
        length = 2 if joint.shortname() == "JointModelComposite" else 1
        chains.append(list(range(first, first + length)))
        first += length
    pair = Pair(f"mjcf robot {seed}", theirs, ours, chains=chains)
    pair.record_size()
    assert ours.name == theirs.name
    assert (ours.nq, ours.nv, ours.nbodies) == (theirs.nq, theirs.nv, first)
    assert [ours.idx_qs[chain[0]] for chain in chains[1:]] == list(theirs.idx_qs)[1:]
    pair.expect("mjcf: armature", ours.armature, theirs.armature)
    pair.expect("mjcf: damping", ours.damping, theirs.damping)
    pair.expect("mjcf: friction", ours.friction, theirs.upperDryFrictionLimit)
    limited = np.isfinite(ours.limits.lower)
    pair.expect("mjcf: limits, lower", ours.limits.lower[limited], theirs.lowerPositionLimit[limited])
    pair.expect("mjcf: limits, upper", ours.limits.upper[limited], theirs.upperPositionLimit[limited])
    masses = [ours.inertias[body].mass for body in pair.bodies[1:]]
    pair.expect("mjcf: masses", masses, [inertia.mass for inertia in theirs.inertias[1:]])
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
