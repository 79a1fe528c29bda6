"""Tests the conversion of Pinocchio's models to Condyle's and back, for all robots of example-robot-data. Joints,
frames and numbers must remain the same.

The tests also compare named positions of SRDFs, appended robots and mimic joints with Pinocchio's results.
"""

import os
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest
import test_mimic
import test_robots
from comparison import TOLERANCE, Pair, State, from_urdf
from example_robot_data.robots_loader import ROBOTS, getModelPath
from random_robot import COMPOSITES, FREE, ONE, RandomRobot
from random_urdf import RandomUrdf

import condyle
from condyle import Model

KINDS = {"BODY": "link", "JOINT": "joint", "FIXED_JOINT": "joint"}
URDFS = [name for name in ROBOTS if name not in test_robots.NO_URDF]
MIMICS = [n for n in test_mimic.ROBOTS if n not in test_mimic.BROKEN | test_mimic.REFUSED]


def close(what: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Checks that two arrays are equal within TOLERANCE, relative to 1 + the largest number."""
    bound = TOLERANCE * (1.0 + np.abs(theirs).max(initial=0.0))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=bound, err_msg=what)


def check_same(ours: Model, theirs: pin.Model, bodies: list[int] | None = None, states: int = 2) -> None:
    """Compares names, limits, damping, friction, rnea, crba and frames. `bodies` contains the index of Condyle's body
    for each joint of Pinocchio."""
    pair = Pair(theirs.name, theirs, ours, chains=None if bodies is None else [[body] for body in bodies])
    bodies = bodies or list(range(ours.nbodies))
    assert (ours.name, ours.nq, ours.nv) == (theirs.name, theirs.nq, theirs.nv)
    assert [ours.names[body] for body in bodies] == list(theirs.names)
    for name, our, their in (
        ("velocity limits", ours.limits.velocity, theirs.upperVelocityLimit),
        ("effort limits", ours.limits.effort, theirs.upperEffortLimit),
    ):
        assert np.array_equal(our, np.where(their > 1e30, np.inf, their)), name
    finite = np.isfinite(ours.limits.lower)
    assert np.array_equal(ours.limits.lower[finite], theirs.lowerPositionLimit[finite])
    assert np.array_equal(ours.limits.upper[finite], theirs.upperPositionLimit[finite])
    simple = [j for j in list(theirs.joints)[1:] if j.nq == j.nv == 1]
    assert all(finite[j.idx_q] == (abs(theirs.lowerPositionLimit[j.idx_q]) < 1e30) for j in simple)
    for our, their in (
        (ours.damping, theirs.damping),
        (ours.friction, theirs.upperDryFrictionLimit),
        (ours.armature, theirs.armature),
        (ours.gravity, theirs.gravity.linear),
    ):
        close("losses, armature, gravity", our, their)
    frames = {(f.name, f.kind): k for k, f in enumerate(ours.frames)}
    others = {(f.name, KINDS.get(str(f.type), "user")): k for k, f in list(enumerate(theirs.frames))[1:]}
    assert frames.keys() == others.keys()
    data, their_data = condyle.Data(ours), theirs.createData()
    for seed in range(states):
        state = State(pair, seed)
        q, v, a = state.q, state.v, state.a
        close("rnea", condyle.rnea(ours, data, q, v, a), pin.rnea(theirs, their_data, q, v, a))
        close("crba", condyle.crba(ours, data, q), pin.crba(theirs, their_data, q))
        poses = condyle.forward_kinematics(ours, data, q)
        pin.framesForwardKinematics(theirs, their_data, q)
        for key, number in frames.items():
            frame = ours.frames[number]
            close(f"{key}", poses[frame.body] @ frame.placement, their_data.oMf[others[key]].homogeneous)


@pytest.mark.parametrize("name", URDFS)
def test_there_and_back(name: str) -> None:
    pair = test_robots.load(name)
    ours = Model.from_pinocchio(pair.theirs)
    assert ours.names == pair.ours.names and ours.parents == pair.ours.parents
    assert ours.joint_types == pair.ours.joint_types
    check_same(ours, pair.theirs)
    theirs = pair.ours.to_pinocchio()
    check_same(pair.ours, theirs)
    if not name.startswith("icub"):  # icub's axes differ by 6e-17 from x, y and z
        assert [j.shortname() for j in theirs.joints] == [j.shortname() for j in pair.theirs.joints]
    kinds = {(f.name, str(f.type)) for f in theirs.frames}
    assert kinds == {(f.name, str(f.type)) for f in pair.theirs.frames}


@pytest.mark.parametrize("composites", [False, True], ids=["plain", "composites"])
@pytest.mark.parametrize("seed", range(5))
def test_every_kind_of_joint(seed: int, composites: bool) -> None:
    robot = RandomRobot(f"robot {seed}", seed, (*ONE, *FREE, *ONE, *(COMPOSITES if composites else ())), composites)
    ours = Model.from_pinocchio(robot.geared.theirs)
    assert ours.names == robot.geared.ours.names
    check_same(ours, robot.geared.theirs, robot.geared.bodies)
    check_same(ours, ours.to_pinocchio())


@pytest.mark.parametrize("seed", range(10))
def test_random_urdfs(seed: int, tmp_path: Path) -> None:
    """Tests continuous joints about any axis. In Pinocchio, only the reader of URDFs creates such joints."""
    path = tmp_path / "robot.urdf"
    path.write_text(RandomUrdf(seed).text, encoding="utf-8")
    pair = from_urdf(f"robot {seed}", str(path), "free_flyer")
    check_same(Model.from_pinocchio(pair.theirs), pair.theirs)
    check_same(pair.ours, pair.ours.to_pinocchio())


@pytest.mark.parametrize("name", MIMICS)
def test_joints_that_follow(name: str) -> None:
    pair = from_urdf(name, test_robots.urdf_path(name), test_robots.root_joint(name), mimic=True)
    ours = Model.from_pinocchio(pair.theirs)
    assert ours.mimics == pair.ours.mimics
    for model, theirs in (ours, pair.theirs), (pair.ours, pair.ours.to_pinocchio()):
        data, their_data = condyle.Data(model), theirs.createData()
        q = condyle.random_configuration(model, seed=1)
        v, a = np.random.default_rng(1).standard_normal((2, model.nv))
        close("rnea", condyle.rnea(model, data, q, v, a), pin.rnea(theirs, their_data, q, v, a))
        close("crba", condyle.crba(model, data, q), pin.crba(theirs, their_data, q))


def test_what_cannot_be_ours() -> None:
    theirs = pin.Model()
    first = theirs.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "first")
    theirs.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "second")
    theirs.addJoint(first, pin.JointModelRX(), pin.SE3.Identity(), "third")
    with pytest.raises(condyle.ModelError, match=r"joint `third` \(number 3\) does not stand behind `first`"):
        Model.from_pinocchio(theirs)
    theirs = pin.Model()
    planar = theirs.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "base")
    theirs.appendBodyToJoint(planar, pin.Inertia.Random(), pin.SE3.Identity())
    theirs.damping = np.array([1.0, 1.0, 2.0])
    with pytest.raises(condyle.ModelError, match="joint `base`: expected one damping for all its degrees of freedom"):
        Model.from_pinocchio(theirs)


def srdf(name: str) -> str:
    loader = ROBOTS[name]
    path = os.path.join(loader.path, loader.srdf_subpath, loader.srdf_filename)
    return os.path.join(getModelPath(path), path)


@pytest.mark.parametrize("name", [name for name in URDFS if ROBOTS[name].srdf_filename])
def test_named_positions(name: str) -> None:
    pair = test_robots.load(name)
    pin.loadReferenceConfigurations(pair.theirs, srdf(name), False)
    ours = pair.ours.reference_configurations(srdf(name))
    theirs = pair.theirs.referenceConfigurations
    assert set(ours) == {entry.key() for entry in theirs}
    for entry in theirs:
        close(entry.key(), ours[entry.key()], entry.data())


@pytest.mark.parametrize(
    ("name", "frame"), [("talos", "gripper_left_base_link"), ("anymal", "base"), ("ur5", "ee_link")]
)
def test_append_at_a_frame(name: str, frame: str) -> None:
    on, arm = test_robots.load(name), test_robots.load("panda")
    pin.seed(1)
    place = pin.SE3.Random()
    number = on.theirs.getFrameId(frame, pin.FrameType.BODY)
    theirs = pin.appendModel(on.theirs, arm.theirs, number, place)
    ours = on.ours.append(frame, arm.ours, place.homogeneous)
    assert ours.names == list(theirs.names)
    data, their_data = condyle.Data(ours), theirs.createData()
    q = condyle.random_configuration(ours, seed=2)
    v, a = np.random.default_rng(2).standard_normal((2, ours.nv))
    close("rnea", condyle.rnea(ours, data, q, v, a), pin.rnea(theirs, their_data, q, v, a))
    close("crba", condyle.crba(ours, data, q), pin.crba(theirs, their_data, q))
    assert np.array_equal(ours.limits.effort, np.where(theirs.upperEffortLimit > 1e30, np.inf, theirs.upperEffortLimit))
    prefixed = on.ours.append(None, arm.ours, prefix="tool_")
    assert prefixed.names[on.ours.nbodies] == "tool_" + arm.ours.names[1]  # appended bodies come last
    with pytest.raises(condyle.ModelError, match="unknown frame"):
        on.ours.append("no such frame", arm.ours)


def test_a_joint_that_follows_on_a_loaded_model() -> None:
    pair = test_robots.load("panda")
    names = ("panda_joint2", "panda_joint4")
    leader, follower = (pair.theirs.getJointId(name) for name in names)
    theirs = pin.transformJointIntoMimic(pair.theirs, leader, follower, -1.5, 0.2)
    ours = pair.ours.with_mimic(names[1], names[0], -1.5, 0.2)
    assert ours.nv == theirs.nv == pair.ours.nv - 1
    data, their_data = condyle.Data(ours), theirs.createData()
    q = condyle.random_configuration(ours, seed=2)
    v, a = np.random.default_rng(2).standard_normal((2, ours.nv))
    close("rnea", condyle.rnea(ours, data, q, v, a), pin.rnea(theirs, their_data, q, v, a))
    close("crba", condyle.crba(ours, data, q), pin.crba(theirs, their_data, q))
    with pytest.raises(condyle.ModelError, match="mimics itself"):
        ours.with_mimic(names[0], names[1])


@pytest.mark.parametrize("name", ["talos", "talos_legs", "human", "ur5"])
def test_by_name(name: str) -> None:
    theirs = ROBOTS[name]().robot.model
    ours = condyle.load(name)
    assert ours.names == list(theirs.names)
    assert np.array_equal(ours.armature, theirs.armature)
    q = condyle.random_configuration(ours, seed=1)
    close("crba", condyle.crba(ours, condyle.Data(ours), q), pin.crba(theirs, theirs.createData(), q))


def test_by_name_of_robot_descriptions(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Tests loading a robot by its name in robot_descriptions, a package whose modules download robot files. The test
    replaces the package by its own modules."""
    folder = tmp_path / "robot_descriptions"
    folder.mkdir()
    (tmp_path / "arm7.urdf").write_text(condyle.robots.ARM7, encoding="utf-8")
    body = '<body><freejoint/><geom type="sphere" size="0.1" mass="2"/></body>'
    (tmp_path / "ball.xml").write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>", encoding="utf-8")
    (folder / "__init__.py").touch()
    paths = f"REPOSITORY_PATH = {str(tmp_path)!r}\nURDF_PATH = {str(tmp_path / 'arm7.urdf')!r}\n"
    (folder / "seven_description.py").write_text(paths, encoding="utf-8")
    (folder / "ball_mj_description.py").write_text(f"MJCF_PATH = {str(tmp_path / 'ball.xml')!r}\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert condyle.load("seven").nv == 7
    assert condyle.load("seven_description", root_joint="free_flyer").nv == 13
    assert condyle.load("ball_mj", package="robot_descriptions").nv == 6
    with pytest.raises(ValueError, match="root_joint: is for URDFs"):
        condyle.load("ball_mj", root_joint="free_flyer")
    with pytest.raises(ValueError, match="no robot 'nobody' in example_robot_data or robot_descriptions"):
        condyle.load("nobody")
    for module in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        monkeypatch.delitem(sys.modules, module)


def test_by_name_what_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(
        ValueError, match="package: expected None, 'example_robot_data' or 'robot_descriptions', found 'x'"
    ):
        condyle.load("talos", package="x")
    with pytest.raises(ValueError, match="root_joint: robots of example_robot_data have theirs already"):
        condyle.load("talos", root_joint="free_flyer")
    load: ModuleType = sys.modules["condyle._load"]
    monkeypatch.setattr(load, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match="example_robot_data or robot_descriptions, which is not installed"):
        condyle.load("talos")


def test_parts_that_pinocchio_does_not_have() -> None:
    body = '<body name="a" gravcomp="1"><joint name="j" axis="0 1 0" stiffness="2" damping="1 2"/><geom size="0.1"/>'
    text = f"""<mujoco><worldbody>{body}</body></worldbody><actuator><motor name="m" joint="j"/></actuator>
      <equality><connect name="loop" body1="a" anchor="1 0 0"/></equality>
      <keyframe><key name="up" qpos="1"/></keyframe></mujoco>"""
    with pytest.warns(UserWarning, match="left out, for a model of Pinocchio has none") as found:
        Model.from_mjcf_str(text).to_pinocchio()
    said = [warning.message.args[0] for warning in found]  # type: ignore[union-attr]
    assert {(warning.kind, warning.subject) for warning in said} == {
        ("left_out", name) for name in ("j", "a", "m", "up", "loop")
    }
    assert [warning.split(" `")[0] for warning in said] == [
        "springs of joints", "damping that depends on the speed of joints", "gravity compensation of bodies",
        "actuators", "keyframes", "constraints",
    ]  # fmt: skip
