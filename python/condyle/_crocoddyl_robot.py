"""Conversion of Crocoddyl's robots, which are Pinocchio models."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._condyle import WORLD, Joint, ModelBuilder
from ._inertia import Inertia
from ._pinocchio_models import warn_of_armature

_Array = NDArray[np.float64]


class NoCounterpartError(Exception):
    """Raised for an object of Crocoddyl without a counterpart in Condyle; the message names the object."""


_FREE = {
    "JointModelFreeFlyer": Joint.free_flyer,
    "JointModelSpherical": Joint.spherical,
    "JointModelPlanar": Joint.planar,
    "JointModelTranslation": Joint.translation,
}
_ALIGNED = {"JointModelR": Joint.revolute, "JointModelRUB": Joint.continuous, "JointModelP": Joint.prismatic}
"""Names of Pinocchio's joints about or along x, y or z, without the letter of the axis."""
_UNALIGNED = {
    "JointModelRevoluteUnaligned": Joint.revolute,
    "JointModelPrismaticUnaligned": Joint.prismatic,
}


class Robot:
    """A `pinocchio.Model` with additional armature, and the same robot as a `Model`."""

    def __init__(self, theirs: Any, armature: _Array) -> None:
        self.theirs, self.armature = theirs, armature
        builder, bodies = ModelBuilder(theirs.name), [WORLD]
        builder.gravity(theirs.gravity.linear)
        for i in range(1, theirs.njoints):
            own, place, name = theirs.inertias[i], theirs.jointPlacements[i].homogeneous, theirs.names[i]
            inertia = Inertia.from_com(own.mass, own.lever, own.inertia)
            on = bodies[theirs.parents[i]]
            bodies.append(builder.body(f"body of {name}", on, _joint(theirs, i), place, inertia, joint_name=name))
        # frames of a `Model` must have unique names
        self._names: list[str] = []
        for k, frame in enumerate(theirs.frames):
            self._names.append(f"{frame.name} ({k})" if frame.name in self._names else frame.name)
            builder.frame(self._names[k], bodies[frame.parentJoint], frame.placement.homogeneous)
        self.model = builder.build().with_armature(theirs.armature + armature)
        warn_of_armature(self.model)
        users = {frame.name: k for k, frame in enumerate(self.model.frames) if frame.kind == "user"}
        self._numbers = [users[name] for name in self._names]

    def is_of(self, theirs: Any, armature: _Array) -> bool:
        """Returns whether this robot was made from an equal `pinocchio.Model` with the same armature."""
        return np.array_equal(self.armature, armature) and (self.theirs is theirs or bool(self.theirs == theirs))

    def frame(self, number: int) -> int:
        """Returns the index in `model` of a frame. `number` is the frame's index in the Pinocchio model."""
        return self._numbers[number]


def _joint(theirs: Any, i: int) -> Joint:
    """Converts joint i of a Pinocchio model."""
    joint = theirs.joints[i]
    name = joint.shortname()
    own = joint.extract() if hasattr(joint, "extract") else joint
    if name in _FREE:
        return _FREE[name]()
    if name in _UNALIGNED:
        return _UNALIGNED[name](own.axis)
    if name[:-1] in _ALIGNED:
        return _ALIGNED[name[:-1]](np.eye(3)["XYZ".index(name[-1])])
    if name == "JointModelRevoluteUnboundedUnaligned":
        data = joint.createData()
        joint.calc(data, np.eye(joint.idx_q + 2)[joint.idx_q])
        return Joint.continuous(np.ravel(data.S)[3:])
    raise NoCounterpartError(f"{name} of joint `{theirs.names[i]}`")
