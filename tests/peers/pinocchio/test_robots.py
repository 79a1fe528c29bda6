"""Compares all robots of example-robot-data with Pinocchio 4.1; both libraries read the same URDF."""

import os

import checks
import numpy as np
import pytest
from comparison import Pair, from_urdf
from example_robot_data.robots_loader import ROBOTS, getModelPath

STATES = 3
NO_URDF = {"cassie": "is an SDF file: see test_cassie.py"}
SINGULAR = {"bravo7_gripper", "falcon_bravo7_gripper", "bluevolta_bravo7_gripper", "romeo"}
"""Names of robots with massless bodies at the end of a limb; their M has no inverse."""


def urdf_path(name: str) -> str:
    loader = ROBOTS[name]
    path = os.path.join(loader.path, loader.urdf_subpath, loader.urdf_filename)
    return os.path.join(getModelPath(path), path)


def text(name: str) -> str:
    with open(urdf_path(name), encoding="utf-8") as file:
        return file.read()


def root_joint(name: str) -> str | None:
    return "free_flyer" if ROBOTS[name].free_flyer else None


def load(name: str, mimic: bool = False) -> Pair:
    return from_urdf(name, urdf_path(name), root_joint(name), mimic)


@pytest.fixture(scope="module", params=[name for name in ROBOTS if name not in NO_URDF])
def pair(request: pytest.FixtureRequest) -> Pair:
    return load(request.param)


def test_model(pair: Pair) -> None:
    checks.check_model(pair)


def test_kinematics(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_kinematics(state)
        checks.check_motion(state)


def test_inverse_dynamics(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)
        checks.check_gravity(state)
        checks.check_rnea_derivatives(state)


def test_centroidal(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_centroidal(state)
        checks.check_energy(state)


def test_equations_of_motion(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_equations_of_motion(state)
        checks.check_lock(state)


def test_derivatives(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_motion_derivatives(state)
        checks.check_effort_derivatives(state)


def test_forward_dynamics(pair: Pair) -> None:
    for state in pair.states(STATES):
        assert checks.check_forward_dynamics(state) == (pair.name not in SINGULAR)


def test_batches(pair: Pair) -> None:
    """Tests every function with a batch of states, which are computed in SIMD lanes."""
    (state,) = pair.states(1, seed=50)
    state.in_batch = True
    checks.check_kinematics(state)
    checks.check_motion(state)
    checks.check_inverse_dynamics(state)
    checks.check_crba(state)
    checks.check_gravity(state)
    checks.check_rnea_derivatives(state)
    checks.check_centroidal(state)
    checks.check_energy(state)
    checks.check_equations_of_motion(state)
    checks.check_motion_derivatives(state)
    checks.check_effort_derivatives(state)
    checks.check_forward_dynamics(state)


def test_configuration(pair: Pair) -> None:
    for state in pair.states(STATES):
        checks.check_configuration(state)


def test_armature(pair: Pair) -> None:
    """Tests robots with armature, which makes M invertible even if a body has no mass."""
    armature = 0.1 + np.random.default_rng(0).random(pair.ours.nv)
    for state in pair.with_armature(armature).states(STATES):
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)
        checks.check_rnea_derivatives(state)
        checks.check_equations_of_motion(state)
        assert checks.check_forward_dynamics(state)
