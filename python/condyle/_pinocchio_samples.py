"""The sample robots of Pinocchio: an arm with six joints, a humanoid whose limbs are such arms, and a random
humanoid.
"""

import numpy as np

from ._condyle import WORLD, BodyId, Joint, Model, ModelBuilder
from ._inertia import Inertia
from .algebra import SE3, Motion, exp3, exp6

_LIGHT = Inertia.from_com(0.1, np.zeros(3), 0.01 * np.eye(3))
_ROD = Inertia.from_com(1.0, [0.0, 0.0, 0.5], np.eye(3))
_HERE, _UP = np.zeros(3), np.array([0.0, 0.0, 1.0])
_DOWN = [np.pi, 0.0, 0.0]  # rotation vector of half a turn about x
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
    robot: ModelBuilder,
    name: str,
    on: BodyId,
    joint: Joint,
    at: SE3,
    inertia: Inertia,
    limits: tuple[float, float, float, float] | None = (-3.14, 3.14, 10.0, 10.0),
) -> BodyId:
    """Adds a body on a joint, and a frame for the joint and for the body. limits: minimum and maximum position,
    velocity, and effort.
    """
    least, most, velocity, effort = limits or (None,) * 4
    position = None if least is None or most is None else (least, most)
    names = f"{name}_body", f"{name}_joint"
    body = robot.body(
        names[0],
        on,
        joint,
        at.homogeneous,
        inertia,
        joint_name=names[1],
        position=position,
        velocity=velocity,
        effort=effort,
    )
    robot.frame(names[1], body, kind="joint")
    robot.frame(names[0], body, kind="link")
    return body


def _limb(robot: ModelBuilder, prefix: str, on: BodyId, begin: SE3, foot: bool = False) -> None:
    for name, axis, offset, inertia, links in _LIMB:
        at = SE3(np.eye(3), offset)
        if name == "shoulder1":
            at = begin
        elif name == "wrist2" and foot:  # turns the foot by a quarter turn about y
            at = exp6(Motion(np.zeros(3), [0.0, np.pi / 2.0, 0.0])) * at
        on = _link(robot, f"{prefix}{name}", on, Joint.revolute(axis), at, inertia)
        for link in links:
            robot.frame(f"{prefix}{link}_body", on, kind="link")


def manipulator() -> Model:
    """Returns Pinocchio's sample arm."""
    robot = ModelBuilder("")
    _limb(robot, "", WORLD, SE3.identity())
    return robot.build()


def humanoid() -> Model:
    """Returns Pinocchio's sample humanoid, on a free-flyer."""
    robot = ModelBuilder("")
    base = robot.body("root_body", WORLD, Joint.free_flyer(), None, _LIGHT, joint_name="root_joint")
    robot.frame("root_joint", base, kind="joint")

    def at(y: float, z: float) -> SE3:
        return SE3(exp6(Motion(np.zeros(3), _DOWN)).rotation, [0.0, y, z])

    _limb(robot, "rleg_", base, at(-0.2, -0.1), foot=True)
    _limb(robot, "lleg_", base, at(0.2, -0.1), foot=True)
    chest = _link(robot, "chest1", base, Joint.revolute(_X), SE3.identity(), _LIGHT)
    chest = _link(robot, "chest2", chest, Joint.revolute(_Y), SE3.identity(), _ROD)
    head = _link(robot, "head1", chest, Joint.revolute(_X), SE3(np.eye(3), _UP), _LIGHT)
    _link(robot, "head2", head, Joint.revolute(_Y), SE3.identity(), _ROD)
    _limb(robot, "rarm_", chest, at(-0.3, 1.0))
    _limb(robot, "larm_", chest, at(0.3, 1.0))
    return robot.build()


def random_humanoid() -> Model:
    """Returns a humanoid with 26 joints on a free-flyer, with placements, inertias and limits drawn by NumPy's
    generator.
    """
    robot, draw = ModelBuilder(""), np.random.random

    def link(name: str, on: BodyId, axis: list[float]) -> BodyId:
        at = SE3(exp3(np.pi * (2.0 * draw(3) - 1.0)), 2.0 * draw(3) - 1.0)
        least, *others = 2.0 * draw(4)
        return _link(robot, name, on, Joint.revolute(axis), at, inertia(), (-least, *others))

    def inertia() -> Inertia:
        mass, size, turned = 0.1 + 2.0 * draw(), 0.1 + draw(3), exp3(np.pi * (2.0 * draw(3) - 1.0))
        about = turned @ Inertia.from_box(mass, size).rotational @ turned.T
        return Inertia.from_com(mass, 2.0 * draw(3) - 1.0, about)

    def limb(name: str, on: BodyId) -> None:
        for k, axis in enumerate((_X, _Y, _Z, _Y, _Y, _X), 1):
            on = link(f"{name}{k}", on, axis)

    base = _link(robot, "root", WORLD, Joint.free_flyer(), SE3.identity(), inertia(), None)
    limb("lleg", base)
    limb("rleg", base)
    chest = link("chest", link("torso1", base, _Y), _Z)
    limb("rarm", chest)
    limb("larm", chest)
    return robot.build()
