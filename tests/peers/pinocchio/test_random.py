"""Compares random robots with Pinocchio 4.1. The robots have every kind of joint of URDF and every kind of root
joint."""

from pathlib import Path

import checks
import numpy as np
import pytest
from comparison import ROOT_JOINTS, from_urdf
from random_urdf import RandomUrdf

ROBOTS = 60
STATES = 2


@pytest.mark.parametrize("seed", range(ROBOTS))
def test_random_robot(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(RandomUrdf(seed).text, encoding="utf-8")
    root_joint = (None, *ROOT_JOINTS)[seed % (1 + len(ROOT_JOINTS))]
    pair = from_urdf(f"robot {seed}", str(path), root_joint)
    checks.check_model(pair)
    armature = np.random.default_rng(seed).random(pair.ours.nv)
    for state in pair.states(STATES, seed):
        checks.check_energy(state)
        checks.check_lock(state)
    for state in pair.states(STATES, seed) + pair.with_armature(armature).states(STATES, seed):
        checks.check_kinematics(state)
        checks.check_motion(state)
        checks.check_centroidal(state)
        checks.check_equations_of_motion(state)
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)
        checks.check_gravity(state)
        checks.check_rnea_derivatives(state)
        checks.check_motion_derivatives(state)
        checks.check_effort_derivatives(state)
        assert checks.check_forward_dynamics(state)
        checks.check_configuration(state)
