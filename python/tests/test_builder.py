"""Tests of models that are built body by body or from other models. The tests in tests/peers compare the numbers with
other libraries.
"""

import gc
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import condyle
from condyle import WORLD, Inertia, Joint, ModelBuilder

ROD = Inertia.from_com(1.0, [0.0, 0.0, -0.5], np.diag([0.08, 0.08, 0.01]))
CLOSE = {"rtol": 1e-12, "atol": 1e-12}


def at(x: float, y: float, z: float) -> NDArray[np.float64]:
    """Returns a placement at (x, y, z) without rotation, as a homogeneous matrix."""
    X = np.eye(4)
    X[:3, 3] = x, y, z
    return X


def turned(angle: float, axis: int) -> NDArray[np.float64]:
    """Returns a placement that is a rotation about an axis of the frame."""
    X, (j, k) = np.eye(4), ((axis + 1) % 3, (axis + 2) % 3)
    X[j, j] = X[k, k] = np.cos(angle)
    X[k, j], X[j, k] = np.sin(angle), -np.sin(angle)
    return X


@pytest.mark.parametrize(
    ("joint", "kind", "nq", "nv"),
    [
        (Joint.revolute([0, 0, 2]), "revolute", 1, 1),
        (Joint.continuous([0, 0, 1]), "continuous", 2, 1),
        (Joint.prismatic([0, 1, 0]), "prismatic", 1, 1),
        (Joint.helical([0, 0, 1], 0.1), "helical", 1, 1),
        (Joint.spherical(), "spherical", 4, 3),
        (Joint.planar(), "planar", 4, 3),
        (Joint.translation(), "translation", 3, 3),
        (Joint.free_flyer(), "free_flyer", 7, 6),
    ],
)
def test_joints(joint: Joint, kind: str, nq: int, nv: int) -> None:
    assert (joint.nq, joint.nv) == (nq, nv)
    assert repr(joint).startswith(f"<condyle.Joint {kind}")
    builder = ModelBuilder("one")
    builder.body("rod", WORLD, joint, inertia=ROD)
    model = builder.build()
    assert (model.nq, model.nv, model.joint_types) == (nq, nv, ["universe", kind])
    world, own = model.joints
    assert world is None
    assert own is not None
    assert (own.axis is None) == (joint.axis is None)
    if own.axis is not None:
        assert np.isclose(np.linalg.norm(own.axis), 1.0)


def test_a_screw_moves_along_its_axis_as_it_turns() -> None:
    builder = ModelBuilder("screw")
    builder.body("nut", WORLD, Joint.helical([0, 0, 3], 0.2), at(1, 0, 0), ROD)
    model = builder.build()
    pose = condyle.forward_kinematics(model, condyle.Data(model), [0.5])[1]
    np.testing.assert_allclose(pose, at(1, 0, 0.1) @ turned(0.5, 2), **CLOSE)


def test_chains() -> None:
    builder = ModelBuilder("chains")
    universal = [(Joint.revolute([1, 0, 0]), at(1, 0, 0)), (Joint.revolute([0, 1, 0]), None)]
    fork = builder.chain("fork", WORLD, universal, ROD)
    builder.spherical_zyx("ball", fork, at(0, 0, 2), ROD)
    model = builder.build()
    assert model.names == ["universe", "fork#1", "fork", "ball#1", "ball#2", "ball"]
    assert model.warnings == []
    poses = condyle.forward_kinematics(model, condyle.Data(model), [0.1, 0.2, 0.3, 0.4, 0.5])
    expected = at(1, 0, 0) @ turned(0.1, 0) @ turned(0.2, 1)
    np.testing.assert_allclose(poses[2], expected, **CLOSE)
    expected = expected @ at(0, 0, 2) @ turned(0.3, 2) @ turned(0.4, 1) @ turned(0.5, 0)
    np.testing.assert_allclose(poses[5], expected, **CLOSE)
    with pytest.raises(ValueError, match="^joints: expected at least one$"):
        ModelBuilder("none").chain("none", WORLD, [])


def test_all_that_a_joint_may_have() -> None:
    builder = ModelBuilder("full")
    axis = Joint.revolute([0, 1, 0])
    options = {"velocity": 3.0, "effort": 4.0, "damping": 0.1, "friction": 0.2, "armature": 0.3}
    builder.body("rod", WORLD, axis, inertia=ROD, joint_name="pivot", position=(-1.0, 2.0), **options)  # type: ignore[arg-type]
    builder.gravity([0, 0, -1.6])
    model = builder.build()
    assert (model.names[1], model.body_names[1]) == ("pivot", "rod")
    limits = model.limits
    assert (limits.lower, limits.upper, limits.velocity, limits.effort) == (-1, 2, 3, 4)
    assert (model.damping, model.friction, model.armature) == (0.1, 0.2, 0.3)
    assert np.array_equal(model.gravity, [0, 0, -1.6])


def test_frames_and_merged_bodies() -> None:
    builder = ModelBuilder("frames")
    rod = builder.body("rod", WORLD, Joint.revolute([0, 1, 0]), inertia=ROD)
    builder.merge(rod, at(0, 0, -1), Inertia.from_com(2.0, np.zeros(3), np.zeros((3, 3))))
    builder.merge(WORLD, None, ROD)
    builder.frame("tip", rod, at(0, 0, -1))
    builder.frame("here", rod)
    model = builder.build()
    assert [(f.name, f.kind, f.body) for f in model.frames] == [("tip", "user", 1), ("here", "user", 1)]
    assert np.array_equal(model.frames[0].placement, at(0, 0, -1))
    np.testing.assert_allclose(model.inertias[1].com, [0, 0, -2.5 / 3], **CLOSE)
    assert model.total_mass == 4.0


def test_inertias_are_read_as_they_are_given() -> None:
    for given in condyle.robots.humanoid().inertias[1:]:
        builder = ModelBuilder("body")
        builder.body("body", WORLD, Joint.free_flyer(), inertia=given)
        (_, got) = builder.build().inertias
        np.testing.assert_allclose(got.rotational, given.rotational, **CLOSE)
        np.testing.assert_allclose(got.com, given.com, **CLOSE)
        made = Inertia.from_com(given.mass, given.com, given.about_com)
        np.testing.assert_allclose(made.rotational, given.rotational, **CLOSE)
    with pytest.raises(ValueError, match=r"^com: expected shape \(3,\), found \(2,\)$"):
        Inertia.from_com(1.0, [0, 0], np.eye(3))
    with pytest.raises(ValueError, match=r"^about_com: expected shape \(3, 3\), found \(3,\)$"):
        Inertia.from_com(1.0, [0, 0, 0], [1, 1, 1])
    with pytest.raises(ValueError, match=r"^inertia.com: expected shape \(3,\), found \(2,\)$"):
        ModelBuilder("x").body("x", WORLD, Joint.planar(), inertia=ROD._replace(com=np.zeros(2)))


def test_mimic() -> None:
    builder = ModelBuilder("pair")
    leader = builder.body("a", WORLD, Joint.revolute([0, 0, 1]), inertia=ROD)
    follower = builder.body("b", leader, Joint.prismatic([0, 0, 1]), inertia=ROD)
    builder.mimic(follower, leader, ratio=2.0, offset=0.5)
    model = builder.build()
    assert (model.nq, model.nv, model.mimics) == (1, 1, [None, None, condyle.Mimic(2.0, 0.5)])
    pose = condyle.forward_kinematics(model, condyle.Data(model), [0.3])[2]
    np.testing.assert_allclose(pose, at(0, 0, 2 * 0.3 + 0.5) @ turned(0.3, 2), **CLOSE)


def test_append() -> None:
    arm = condyle.robots.arm7()
    builder = ModelBuilder("two arms")
    body = builder.body("torso", WORLD, Joint.prismatic([0, 0, 1]), at(0, 0, 1), ROD)
    builder.append(body, at(0, 0.4, 0), arm, "left_")
    builder.append(body, at(0, -0.4, 0), arm, prefix="right_")
    model = builder.build()
    assert (model.nv, model.names[2]) == (15, "left_joint1")
    q = np.random.default_rng(0).standard_normal(15)
    data, own = condyle.Data(model), condyle.Data(arm)
    for side, part, y in (("left_", q[1:8], 0.4), ("right_", q[8:], -0.4)):
        tool = condyle.frame_placement(model, data, q, f"{side}tool")
        expected = at(0, y, 1 + q[0]) @ condyle.frame_placement(arm, own, part, "tool")
        np.testing.assert_allclose(tool, expected, **CLOSE)
    twins = ModelBuilder("same names")
    twins.append(WORLD, None, arm)
    twins.append(WORLD, None, arm)
    with pytest.raises(condyle.ModelError, match="^two bodies are named `link1`$"):
        twins.build()


def test_what_is_refused() -> None:
    def wrong(**options: Any) -> condyle.Model:
        builder = ModelBuilder("wrong")
        builder.body("rod", WORLD, Joint.revolute(options.pop("axis", [0, 0, 1])), inertia=ROD, **options)
        return builder.build()

    with pytest.raises(condyle.ModelError, match="`rod`: axis .* is no direction"):
        wrong(axis=[0, 0, 0])
    with pytest.raises(condyle.ModelError, match="`rod`: lower limit 1 is above upper limit 0"):
        wrong(position=(1.0, 0.0))
    with pytest.raises(ValueError, match=r"^placement: expected shape \(4, 4\), found \(3, 4\)$"):
        wrong(placement=np.zeros((3, 4)))
    with pytest.raises(ValueError, match=r"^axis: expected shape \(3,\), found \(2,\)$"):
        Joint.revolute([0, 1])


def test_bodies_belong_to_their_builder() -> None:
    one, other = ModelBuilder("one"), ModelBuilder("other")
    body = one.body("a", WORLD, Joint.planar(), inertia=ROD)
    with pytest.raises(ValueError, match="^parent: a body of another builder$"):
        other.body("b", body, Joint.planar(), inertia=ROD)
    with pytest.raises(ValueError, match="^leader: a body of another builder$"):
        other.mimic(WORLD, body)
    assert one.build().nv == 3
    with pytest.raises(RuntimeError, match="^the model is built; make another builder$"):
        one.build()
    del one
    gc.collect()
    with pytest.raises(ValueError, match="^body: a body of another builder$"):
        other.frame("f", body)
