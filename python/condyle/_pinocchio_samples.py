"""The two robots that are built into Pinocchio: an arm of six joints, and a humanoid of five such limbs."""

import numpy as np

from ._condyle import WORLD, BodyId, Joint, Model, ModelBuilder
from ._inertia import Inertia
from .algebra import SE3, Motion, exp6

_LIGHT = Inertia.from_com(0.1, np.zeros(3), 0.01 * np.eye(3))
_ROD = Inertia.from_com(1.0, [0.0, 0.0, 0.5], np.eye(3))
_HERE, _UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
_DOWN = [np.pi, 0.0, 0.0]  # half a turn about x
_X, _Y, _Z = ([float(k == axis) for k in range(3)] for axis in range(3))
_LIMB = (
    ("shoulder1", _X, _HERE, _LIGHT, ()),
    ("shoulder2", _Y, _HERE, _LIGHT, ()),
    ("shoulder3", _Z, _HERE, _ROD, ("upperarm",)),
    ("elbow", _Y, _UP, _ROD, ("lowerarm",)),
    ("wrist1", _X, _UP, _LIGHT, ()),
    ("wrist2", _Y, _HERE, _ROD, ("effector",)),
)


def _link(
    robot: ModelBuilder, prefix: str, name: str, on: BodyId, axis: list[float], at: SE3, inertia: Inertia
) -> BodyId:
    """A body on a revolute joint, with the limits that all joints of these robots have."""
    body = robot.body(
        f"{prefix}{name}_body",
        on,
        Joint.revolute(axis),
        at.homogeneous,
        inertia,
        joint_name=f"{prefix}{name}_joint",
        position=(-3.14, 3.14),
        velocity=10.0,
        effort=10.0,
    )
    robot.frame(f"{prefix}{name}_joint", body, kind="joint")
    robot.frame(f"{prefix}{name}_body", body, kind="link")
    return body


def _limb(robot: ModelBuilder, prefix: str, on: BodyId, begin: SE3, foot: bool = False) -> None:
    for name, axis, offset, inertia, links in _LIMB:
        at = SE3(np.eye(3), offset)
        if name == "shoulder1":
            at = begin
        elif name == "wrist2" and foot:  # a quarter of a turn about y
            at = exp6(Motion(np.zeros(3), [0.0, np.pi / 2.0, 0.0])) * at
        on = _link(robot, prefix, name, on, axis, at, inertia)
        for link in links:
            robot.frame(f"{prefix}{link}_body", on, kind="link")


def manipulator() -> Model:
    """The arm."""
    robot = ModelBuilder("")
    _limb(robot, "", WORLD, SE3.identity())
    return robot.build()


def humanoid() -> Model:
    """The humanoid, on a free-flyer."""
    robot = ModelBuilder("")
    base = robot.body("root_body", WORLD, Joint.free_flyer(), None, _LIGHT, joint_name="root_joint")
    robot.frame("root_joint", base, kind="joint")

    def at(y: float, z: float) -> SE3:
        return SE3(exp6(Motion(np.zeros(3), _DOWN)).rotation, [0.0, y, z])

    _limb(robot, "rleg_", base, at(-0.2, -0.1), foot=True)
    _limb(robot, "lleg_", base, at(0.2, -0.1), foot=True)
    chest = _link(robot, "", "chest1", base, _X, SE3.identity(), _LIGHT)
    chest = _link(robot, "", "chest2", chest, _Y, SE3.identity(), _ROD)
    head = _link(robot, "", "head1", chest, _X, SE3(np.eye(3), _UP), _LIGHT)
    _link(robot, "", "head2", head, _Y, SE3.identity(), _ROD)
    _limb(robot, "rarm_", chest, at(-0.3, 1.0))
    _limb(robot, "larm_", chest, at(0.3, 1.0))
    return robot.build()
