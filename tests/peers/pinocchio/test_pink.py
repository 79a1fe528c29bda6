"""Tests that velocities of `condyle.ik` equal Pink's on robots of example-robot-data.

The tests need pin-pink, quadprog and example-robot-data, and are skipped without them.
"""

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pink = pytest.importorskip("pink")
pytest.importorskip("quadprog")
pin = pytest.importorskip("pinocchio")

from pink.limits import AccelerationLimit, ConfigurationLimit, VelocityLimit  # noqa: E402
from pink.tasks import ComTask, DampingTask, FrameTask, PostureTask, RelativeFrameTask  # noqa: E402

import condyle  # noqa: E402
from condyle.ik import DifferentialIk, JointLimits, Task  # noqa: E402

EQUAL = 1e-6
"""Maximum difference of velocities, relative to 1 + the largest velocity: the accuracy of Pink's solvers."""

DT, DAMPING = 0.01, 1e-8

CASES: dict[str, dict[str, Any]] = {
    "panda": {"urdf": "panda_description/urdf/panda.urdf", "frames": ["panda_hand_tcp"]},
    "panda, damped": {
        "urdf": "panda_description/urdf/panda.urdf",
        "frames": ["panda_hand_tcp"],
        "lm": 1e-2,
        "gain": 0.4,
    },
    "panda, accelerations": {
        "urdf": "panda_description/urdf/panda.urdf",
        "frames": ["panda_hand_tcp"],
        "acceleration": 50.0,
    },
    "ur5": {"urdf": "ur_description/urdf/ur5_robot.urdf", "frames": ["tool0"], "lm": 1e-3},
    "allegro": {
        "urdf": "allegro_hand_description/urdf/allegro_right_hand.urdf",
        "frames": ["link_3.0_tip", "link_15.0_tip"],
    },
    "anymal": {
        "urdf": "anymal_b_simple_description/robots/anymal.urdf",
        "free": True,
        "frames": ["LF_FOOT", "RH_FOOT"],
        "com": True,
    },
    "talos": {
        "urdf": "talos_data/robots/talos_reduced.urdf",
        "free": True,
        "com": True,
        "lm": 1e-4,
        "frames": ["left_sole_link", "right_sole_link", "gripper_left_base_link"],
        "relative": ("gripper_right_base_link", "torso_2_link"),
    },
    "g1": {
        "urdf": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
        "free": True,
        "com": True,
        "gain": 0.5,
        "frames": ["left_ankle_roll_link", "right_ankle_roll_link", "left_rubber_hand"],
        "relative": ("right_rubber_hand", "torso_link"),
    },
}


def find(urdf: str) -> Path:
    """Returns the path of a robot's file."""
    folders = [Path(place) / "cmeel.prefix" / "share" / "example-robot-data" / "robots" for place in sys.path]
    for folder in folders:
        if (folder / urdf).is_file():
            return folder / urdf
    pytest.skip("example-robot-data is not installed")


@pytest.mark.parametrize("name", CASES)
def test_velocities_are_equal(name: str) -> None:
    warnings.simplefilter("ignore")
    case = CASES[name]
    path, free, lm, gain = find(case["urdf"]), case.get("free", False), case.get("lm", 0.0), case.get("gain", 1.0)
    theirs = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer()) if free else pin.buildModelFromUrdf(str(path))
    ours = condyle.Model.from_urdf(path, root_joint="free_flyer" if free else None)
    common = {"gain": gain, "damping": lm}
    tasks = [Task.pose(frame, factors=[1.0] * 3 + [0.25] * 3, **common) for frame in case["frames"]]
    peers: list[Any] = [FrameTask(frame, 1.0, 0.5, lm_damping=lm, gain=gain) for frame in case["frames"]]
    if relative := case.get("relative"):
        tasks.append(Task.relative_pose(*relative, factors=[0.49] * 3 + [0.09] * 3, **common))
        peers.append(RelativeFrameTask(*relative, 0.7, 0.3, lm_damping=lm, gain=gain))
    if case.get("com"):
        tasks.append(Task.com(weight=4.0, **common))
        peers.append(ComTask(cost=2.0, gain=gain, lm_damping=lm))
    tasks += [Task.posture(weight=1e-4, **common), Task.rest(weight=1e-6)]
    peers += [PostureTask(cost=1e-2, gain=gain, lm_damping=lm), DampingTask(cost=1e-3)]
    limits: list[Any] = [ConfigurationLimit(theirs), VelocityLimit(theirs)]
    most = case.get("acceleration")
    if most:
        limits.append(AccelerationLimit(theirs, np.full(theirs.nv, most)))
    accelerations = None if most is None else np.full(ours.nv, most)
    ik = DifferentialIk(ours, tasks, dt=DT, damping=DAMPING, limits=JointLimits(acceleration=accelerations))
    data = theirs.createData()
    for seed in range(20):
        q, goal = (condyle.random_configuration(ours, 2 * seed + k) for k in range(2))
        targets = ik.hold(condyle.interpolate(ours, q, goal, 0.1))
        targets.posture = goal
        poses = iter(targets.frames)
        for task in peers:
            if isinstance(task, FrameTask | RelativeFrameTask):
                task.set_target(pin.SE3(next(poses)))
            elif isinstance(task, ComTask):
                task.set_target(targets.com)
            elif not isinstance(task, DampingTask):
                task.set_target(targets.posture)
        configuration = pink.Configuration(theirs, data, q)
        v0 = np.zeros(ours.nv)
        if most:
            limits[2].set_last_integration(v0, DT)
        v = pink.solve_ik(configuration, peers, DT, "quadprog", damping=DAMPING, limits=limits, safety_break=False)
        found = ik.step(q, targets, v0).v
        assert np.abs(found - v).max() <= EQUAL * (1.0 + np.abs(v).max()), seed
