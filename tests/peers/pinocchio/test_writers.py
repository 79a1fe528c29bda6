"""Tests writing random inertias, limits and armature into copies of all URDFs of example-robot-data. Condyle and
Pinocchio must read the same robots from the copies."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from example_robot_data.robots_loader import getModelPath

import condyle

FOLDER = Path(getModelPath("a1_description"))
FILES = sorted(file.relative_to(FOLDER).as_posix() for file in FOLDER.rglob("*.urdf"))
SAME = 1e-11
"""Tolerance of M and inertias, relative to the largest entry. Rounding errors arise when inertias are transformed
between the frames of merged links."""


def other(inertia: condyle.Inertia, rng: np.random.Generator) -> condyle.Inertia:
    """Returns a random valid inertia, of about the size of a limb."""
    del inertia
    spread = 0.1 * rng.standard_normal((3, 3))
    moments = spread @ spread.T + 1e-3 * np.eye(3)
    about_com = np.trace(moments) * np.eye(3) - moments
    return condyle.Inertia.from_com(rng.uniform(0.5, 3.0), rng.uniform(-0.1, 0.1, 3), about_com)


@pytest.mark.parametrize("root_joint", [None, "free_flyer"])
@pytest.mark.parametrize("name", FILES)
def test_inertias_come_back(name: str, root_joint: str | None, tmp_path: Path) -> None:
    original, new = FOLDER / name, tmp_path / "new.urdf"
    try:
        robot = condyle.Model.from_urdf(original, root_joint)  # type: ignore[arg-type]
    except condyle.ParseError:
        pytest.skip("refused by the reader")
    robot.write_urdf(new, original)
    assert new.read_bytes() == original.read_bytes()
    rng = np.random.default_rng(len(name))
    effort, armature = robot.limits.effort.copy(), robot.armature.copy()
    limited = np.isfinite(effort) & (effort > 0.0)
    effort[limited] *= 0.75
    for i, (kind, v) in enumerate(zip(robot.joint_types, robot.idx_vs, strict=True)):
        if kind in ("revolute", "prismatic", "continuous") and robot.names[i] != "root_joint":
            armature[v] += rng.uniform(0.1, 0.5)
    inertias = [robot.inertias[0], *(other(inertia, rng) for inertia in robot.inertias[1:])]
    changed = robot.with_inertias(inertias).with_armature(armature)
    if limited.any():
        changed = changed.with_limits(effort=effort)
    changed.write_urdf(new, original)
    again = condyle.Model.from_urdf(new, root_joint)  # type: ignore[arg-type]
    scale = SAME * (1.0 + np.abs(changed.inertial_parameters).max(initial=0.0))
    np.testing.assert_allclose(again.inertial_parameters, changed.inertial_parameters, rtol=0.0, atol=scale)
    np.testing.assert_allclose(again.armature, changed.armature, rtol=1e-14)
    np.testing.assert_array_equal(again.limits.effort, changed.limits.effort)

    theirs = pin.buildModelFromUrdf(str(new), *([pin.JointModelFreeFlyer()] if root_joint else []))
    if theirs.nq != changed.nq or not changed.nv or "planar" in changed.joint_types:
        return
    M = pin.crba(theirs, theirs.createData(), q := condyle.random_configuration(changed, seed=1))
    M = np.triu(M) + np.triu(M, 1).T
    ours = condyle.crba(changed, condyle.Data(changed), q) - np.diag(changed.armature)  # Pinocchio ignores armature
    np.testing.assert_allclose(ours, M, rtol=0.0, atol=SAME * (1.0 + np.abs(M).max()))
