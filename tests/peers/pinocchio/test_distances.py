"""Compares distances between spheres, and the derivatives of these distances, with Pinocchio's placements of frames."""

import numpy as np
import pinocchio as pin
import pytest

import condyle
from condyle.optimal import Activation, Cost, FreeDynamics, Problem, Residual, Sphere

# Tolerance of sums of a few products of numbers of order one.
SAME = 1e-12
PAIRS = 20
TEXTS = {
    "arm7": condyle.robots.ARM7,
    "quadruped": condyle.robots.QUADRUPED,
    "humanoid": condyle.robots.HUMANOID,
}


def build(name: str) -> tuple[condyle.Model, pin.Model]:
    if name == "arm7":
        return condyle.Model.from_urdf_str(TEXTS[name]), pin.buildModelFromXML(TEXTS[name])
    ours = condyle.Model.from_urdf_str(TEXTS[name], root_joint="free_flyer")
    return ours, pin.buildModelFromXML(TEXTS[name], pin.JointModelFreeFlyer())


@pytest.mark.parametrize("name", TEXTS)
def test_distances_are_those_of_placed_frames(name: str) -> None:
    ours, theirs = build(name)
    rng, data = np.random.default_rng(3), theirs.createData()
    frames = [frame.name for frame in ours.frames if theirs.existBodyName(frame.name)]
    joints = [theirs.frames[theirs.getBodyId(frame)].parentJoint for frame in frames]

    def sphere(frame: str | None) -> Sphere:
        return Sphere(rng.uniform(-0.3, 0.3, 3), float(rng.uniform(0.0, 0.1)), frame)

    for k in range(PAIRS):
        one, other = rng.integers(len(frames), size=2)
        if k % 2 and joints[one] == joints[other]:
            continue  # two geometries of one body have no distance that changes
        first, second = sphere(frames[one]), sphere(frames[other] if k % 2 else None)
        q = pin.integrate(theirs, pin.neutral(theirs), rng.uniform(-1.0, 1.0, theirs.nv))
        pin.computeJointJacobians(theirs, data, q)
        pin.updateFramePlacements(theirs, data)
        points, jacobians = [], []
        for given in (first, second):
            if given.frame is None:
                points.append(given.center)
                jacobians.append(np.zeros((3, theirs.nv)))
                continue
            index = theirs.getBodyId(given.frame)
            pose = data.oMf[index]
            J = pin.getFrameJacobian(theirs, data, index, pin.LOCAL_WORLD_ALIGNED)
            points.append(pose.act(given.center))
            jacobians.append(J[:3] - pin.skew(pose.rotation @ given.center) @ J[3:])
        away = points[0] - points[1]
        distance = np.linalg.norm(away)
        x = np.r_[q, np.zeros(theirs.nv)]
        cost = Cost("distance", 1.0, Residual.distances(ours, [(first, second)]), Activation.sum())
        knot = FreeDynamics(ours, 0.1, [])
        problem = Problem(x, [knot], [0], FreeDynamics(ours, None, [cost]))
        xs, us = np.tile(x, (2, 1)), knot.quasi_static(x)
        assert abs(problem.evaluate(xs, us[None]).cost - (distance - first.radius - second.radius)) < SAME
        row = problem.derivatives(xs, us[None])[1].q
        expected = np.r_[away / distance @ (jacobians[0] - jacobians[1]), np.zeros(theirs.nv)]
        assert np.abs(row - expected).max() < SAME / min(distance, 1.0)
