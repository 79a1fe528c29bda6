"""Compares robots that are assembled from other robots with Pinocchio's appendModel."""

import checks
import numpy as np
import pinocchio as pin
import pytest
import test_robots
from comparison import Pair, from_urdf

import condyle
from condyle import Inertia, Joint, ModelBuilder

STATES = 3
PARTS = [("panda", "ur5"), ("double_pendulum", "panda"), ("kinova", "xarm7")]
"""Pairs of robots with fixed bases that are mounted on one platform. The joints of the two robots have different
names."""


def together(names: tuple[str, str], seed: int) -> Pair:
    """Returns a robot that consists of two robots on one platform. The platform slides and rotates."""
    pin.seed(seed)
    theirs, builder = pin.Model(), ModelBuilder("together")
    theirs.name = "together"
    placement, inertia = pin.SE3.Random(), pin.Inertia.Random()
    platform = theirs.addJoint(0, pin.JointModelPlanar(), placement, "platform")
    theirs.addJointFrame(platform)
    theirs.appendBodyToJoint(platform, inertia, pin.SE3.Identity())
    theirs.addBodyFrame("plate", platform, pin.SE3.Identity(), 1)
    body = builder.body(
        "platform",
        condyle.WORLD,
        Joint.planar(),
        placement.homogeneous,
        Inertia.from_com(inertia.mass, inertia.lever, inertia.inertia),
    )
    for name in names:
        part, X = from_urdf(name, test_robots.urdf_path(name), None), pin.SE3.Random()
        theirs = pin.appendModel(theirs, part.theirs, theirs.getFrameId("plate"), X)
        builder.append(body, X.homogeneous, part.ours)
    return Pair(" + ".join(names), theirs, builder.build())


@pytest.mark.parametrize("names", PARTS, ids="+".join)
def test_append(names: tuple[str, str]) -> None:
    pair = together(names, 0)
    assert pair.ours.names == list(pair.theirs.names)
    pair.expect(
        "append: joint placements", pair.ours.joint_placements[1:], checks.poses(pair.theirs.jointPlacements)[1:]
    )
    for name, ours, theirs in (
        ("limits, lower", pair.ours.limits.lower, pair.theirs.lowerPositionLimit),
        ("limits, upper", pair.ours.limits.upper, pair.theirs.upperPositionLimit),
    ):
        limited = np.isfinite(ours)
        pair.expect(f"append: {name}", ours[limited], theirs[limited])
    for state in pair.states(STATES):
        q, v, a = state.q, state.v, state.a
        ours, theirs = (pair.ours, pair.data), (pair.theirs, pair.their_data)
        pair.expect(
            "append: rnea, f_ext",
            condyle.rnea(*ours, q, v, a, state.f_ext),
            pin.rnea(*theirs, q, v, a, state.their_forces),
        )
        pair.expect("append: crba", condyle.crba(*ours, q), pin.crba(*theirs, q))
        pin.framesForwardKinematics(*theirs, q)
        for i, frame in enumerate(pair.ours.frames):
            key = (frame.name, frame.kind)
            j = next(j for j, f in enumerate(pair.theirs.frames) if (f.name, checks.KINDS[f.type]) == key)
            pair.expect(
                "append: frame_placement", condyle.frame_placement(*ours, q, i), pair.their_data.oMf[j].homogeneous
            )
