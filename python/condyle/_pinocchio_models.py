"""Conversion of models from and to Pinocchio."""

import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._condyle import WORLD, BodyId, Joint, Model, ModelBuilder, ModelError
from ._inertia import Inertia
from ._types import ModelWarning

_Part = tuple[Joint, NDArray[np.float64]]
"""A joint of Condyle, and the joint's placement."""

ALIGNED: dict[str, Callable[..., Joint]] = {
    "JointModelR": Joint.revolute,
    "JointModelRUB": Joint.continuous,
    "JointModelP": Joint.prismatic,
    "JointModelH": Joint.helical,
}
"""Pinocchio's names of joints about or along x, y or z, without the letter of the axis."""
UNALIGNED: dict[str, Callable[..., Joint]] = {
    "JointModelRevoluteUnaligned": Joint.revolute,
    "JointModelPrismaticUnaligned": Joint.prismatic,
    "JointModelHelicalUnaligned": Joint.helical,
}
FREE = {
    "JointModelSpherical": Joint.spherical,
    "JointModelPlanar": Joint.planar,
    "JointModelTranslation": Joint.translation,
    "JointModelFreeFlyer": Joint.free_flyer,
}
NO_LIMIT = 1e30
"""Magnitude from which a limit counts as infinite: Pinocchio uses infinity or the largest number."""


def from_pinocchio(theirs: Any) -> Model:
    """Converts a model from Pinocchio; see `Model.from_pinocchio`."""
    _check_order(theirs)
    builder, bodies = ModelBuilder(theirs.name), [WORLD]
    builder.gravity(theirs.gravity.linear)
    builder.merge(WORLD, None, _inertia(theirs.inertias[0]))
    links = {frame.parentJoint: frame.name for frame in reversed(list(theirs.frames)) if _is_link(frame)}
    followers = []
    for i in range(1, theirs.njoints):
        joint, name, on = theirs.joints[i], theirs.names[i], bodies[theirs.parents[i]]
        place, inertia = theirs.jointPlacements[i].homogeneous, _inertia(theirs.inertias[i])
        kind = joint.shortname()
        if kind == "JointModelMimic":
            followers.append((i, joint))
        parts = _parts(joint, name)
        if len(parts) > 1:
            _check_lossless(theirs, joint, name)
            parts[0] = (parts[0][0], place @ parts[0][1])
            bodies.append(builder.chain(name, on, parts, inertia))
            continue
        options: Any = {} if kind == "JointModelMimic" else _losses(theirs, joint, name)
        link = links.get(i, name)
        bodies.append(builder.body(link, on, parts[0][0], place @ parts[0][1], inertia, joint_name=name, **options))
    for i, joint in followers:
        leader = next(k for k in range(1, theirs.njoints) if theirs.nvs[k] and theirs.idx_vs[k] == joint.idx_v)
        builder.mimic(bodies[i], bodies[leader], joint.extract().scaling, joint.extract().offset)
    _add_frames(builder, bodies, theirs)
    model = builder.build()
    lower, upper = theirs.lowerPositionLimit.copy(), theirs.upperPositionLimit.copy()
    for i in range(1, model.nbodies):
        if model.nqs[i] != model.nvs[i]:
            turn = slice(model.idx_qs[i] + TURNS.get(model.joint_types[i], 0), model.idx_qs[i] + model.nqs[i])
            lower[turn], upper[turn] = -np.inf, np.inf
    model = model.with_limits(
        _limits(lower), _limits(upper), _limits(theirs.upperVelocityLimit), _limits(theirs.upperEffortLimit)
    )
    model = model.with_armature(theirs.armature)
    warn_of_armature(model)
    return model


def warn_of_armature(model: Model) -> None:
    """Warns if the robot has armature that Condyle and Pinocchio apply along different axes."""
    for name, kind, at in zip(model.names, model.joint_types, model.idx_vs, strict=True):
        if kind == "free_flyer" and model.armature[at : at + 3].any():
            text = f"joint `{name}`: its armature {model.armature[at]} is along the axes of its parent in Condyle"
            warnings.warn(f"{text}, along those of its body in Pinocchio", stacklevel=3)


def warn_of_additions(model: Model) -> None:
    """Warns of the contents of a model that a `pinocchio.Model` cannot represent."""
    left_out = {
        "springs of joints": [spring.joint for spring in model.springs],
        "damping that depends on the speed of joints": [
            name
            for name, at, nv in zip(model.names, model.idx_vs, model.nvs, strict=True)
            if model.damping_polynomial[at : at + nv].any()
        ],
        "gravity compensation of bodies": [carried.body for carried in model.gravity_compensation],
        "actuators": [actuator.name or str(k) for k, actuator in enumerate(model.actuators)],
        "keyframes": [*model.keyframes],
        "constraints": [*model.constraints()],
    }
    for what, names in left_out.items():
        if names:
            listed = ", ".join(f"`{name}`" for name in names[:8]) + (", …" if len(names) > 8 else "")
            text = f"{what} {listed}: left out, for a model of Pinocchio has none"
            warnings.warn(ModelWarning(text, "left_out", names[0]), stacklevel=3)


TURNS = {"free_flyer": 3, "planar": 2}
"""Index in a joint's position at which the rotation begins, by kind of joint. For other kinds the index is 0."""


def _check_order(theirs: Any) -> None:
    """Checks that joints are numbered depth first: the parent of each joint must be on the path from the root to the
    joint with the previous number.
    """
    way = [0]
    for i in range(1, theirs.njoints):
        parent = theirs.parents[i]
        while way and way[-1] != parent:
            way.pop()
        if not way:
            raise ModelError(
                f"joint `{theirs.names[i]}` (number {i}) does not stand behind `{theirs.names[parent]}` and what it "
                "carries: joints are expected depth first, as Pinocchio's readers of files number them"
            )
        way.append(i)


def _parts(joint: Any, name: str) -> list[_Part]:
    """Returns the joints that together equal one joint of Pinocchio, each with its placement in the frame of the
    previous joint.
    """
    kind, here = joint.shortname(), np.eye(4)
    if kind in FREE:
        return [(FREE[kind](), here)]
    own = joint.extract() if hasattr(joint, "extract") else joint
    pitch = [own.pitch] if "JointModelH" in kind else []
    if kind == "JointModelRevoluteUnboundedUnaligned":
        return [(Joint.continuous(_motion(joint)[3:]), here)]
    if kind == "JointModelMimic":
        return [(_follower(_motion(joint) * own.scaling, name), here)]
    if kind in UNALIGNED:
        return [(UNALIGNED[kind](own.axis, *pitch), here)]
    if kind[:-1] in ALIGNED:
        return [(ALIGNED[kind[:-1]](np.eye(3)["XYZ".index(kind[-1])], *pitch), here)]
    if kind == "JointModelUniversal":
        return [(Joint.revolute(own.axis1), here), (Joint.revolute(own.axis2), here)]
    if kind == "JointModelSphericalZYX":
        return [(Joint.revolute(axis), here) for axis in np.eye(3)[::-1]]
    if kind == "JointModelComposite":
        parts = []
        for part, X in zip(own.joints, own.jointPlacements, strict=True):
            (first, place), *others = _parts(part, name)
            parts += [(first, X.homogeneous @ place), *others]
        return parts
    raise ModelError(f"joint `{name}`: no joint here is a {kind}")


def _motion(joint: Any) -> NDArray[np.float64]:
    """Returns the constant motion S at unit velocity of a joint with one degree of freedom."""
    data = joint.createData()
    joint.calc(data, np.eye(max(joint.idx_q + 2, 2))[joint.idx_q])
    return np.array(data.S, float).ravel()


def _follower(S: NDArray[np.float64], name: str) -> Joint:
    """Returns the kind of a mimic joint that moves along S. S is the motion without the ratio, multiplied by the square
    of the ratio, so S has the same direction for every sign of the ratio.
    """
    linear, angular = S[:3], S[3:]
    if not S.any():
        raise ModelError(f"joint `{name}`: follows another one with the ratio 0")
    if not angular.any():
        return Joint.prismatic(linear)
    if not linear.any():
        return Joint.revolute(angular)
    return Joint.helical(angular, float(linear @ angular / (angular @ angular)))


def _inertia(theirs: Any) -> Inertia:
    return Inertia.from_com(theirs.mass, theirs.lever, theirs.inertia)


def _limits(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    out: NDArray[np.float64] = np.where(np.abs(numbers) < NO_LIMIT, numbers, np.copysign(np.inf, numbers))
    return out


def _losses(theirs: Any, joint: Any, name: str) -> dict[str, float]:
    """Returns damping and friction of a joint. In Condyle, damping and friction each have a single value for the whole
    joint.
    """
    out = {}
    for what, numbers in ("damping", theirs.damping), ("friction", theirs.upperDryFrictionLimit):
        own = np.array(numbers[joint.idx_v : joint.idx_v + joint.nv])
        if np.ptp(own) > 0.0:
            raise ModelError(f"joint `{name}`: expected one {what} for all its degrees of freedom, found {own}")
        out[what] = float(own[0])
    return out


def _check_lossless(theirs: Any, joint: Any, name: str) -> None:
    """Checks that a joint has neither damping nor friction, because the joint is converted to a chain of joints."""
    if any(_losses(theirs, joint, name).values()):
        raise ModelError(f"joint `{name}`: damping and friction of a {joint.shortname()} have no place here")


def _is_link(frame: Any) -> bool:
    """Returns whether a frame is the link frame that coincides with the frame of a joint."""
    return str(frame.type) == "BODY" and np.array_equal(frame.placement.homogeneous, np.eye(4))


def _add_frames(builder: ModelBuilder, bodies: Sequence[BodyId], theirs: Any) -> None:
    kinds = {"BODY": "link", "JOINT": "joint", "FIXED_JOINT": "joint"}
    for frame in list(theirs.frames)[1:]:
        kind: Any = kinds.get(str(frame.type), "user")
        builder.frame(frame.name, bodies[frame.parentJoint], frame.placement.homogeneous, kind)


def to_pinocchio(ours: Model) -> Any:
    """Converts a model to Pinocchio; see `Model.to_pinocchio`."""
    pin: Any = import_module("pinocchio")
    theirs = pin.Model()
    theirs.name = ours.name
    theirs.gravity.linear = ours.gravity
    for i in range(ours.nbodies):
        if i:
            place = pin.SE3(ours.joint_placements[i])
            theirs.addJoint(
                ours.parents[i], _their_joint(pin, ours.joints[i], ours.joint_types[i]), place, ours.names[i]
            )
        inertia, own = pin.Inertia.Zero(), ours.inertias[i]  # the constructor refuses some inertias of files
        inertia.mass, inertia.lever, inertia.inertia = own.mass, own.com, own.about_com
        theirs.inertias[i] = inertia
    for i, mimic in enumerate(ours.mimics):
        if mimic:
            leader = next(k for k in range(1, ours.nbodies) if ours.nvs[k] and ours.idx_vs[k] == ours.idx_vs[i])
            if "continuous" in (ours.joint_types[i], ours.joint_types[leader]):
                raise ModelError(f"joint `{ours.names[i]}`: follows a joint, and one of them turns without limits")
            theirs = pin.transformJointIntoMimic(theirs, leader, i, mimic.ratio, mimic.offset)
    moving: dict[int, int] = {}
    for f in sorted(ours.frames, key=lambda f: f.kind != "joint"):
        moves = f.kind == "joint" and f.name == ours.names[f.body] and f.body > 0
        kind = {"link": "BODY", "joint": "JOINT" if moves else "FIXED_JOINT"}.get(f.kind, "OP_FRAME")
        place = pin.SE3(np.array(f.placement))
        number = theirs.addFrame(pin.Frame(f.name, f.body, moving.get(f.body, 0), place, getattr(pin.FrameType, kind)))
        if moves:
            moving[f.body] = number
    limits = ours.limits
    theirs.lowerPositionLimit, theirs.upperPositionLimit = np.array(limits.lower), np.array(limits.upper)
    theirs.upperVelocityLimit, theirs.lowerVelocityLimit = np.array(limits.velocity), -np.array(limits.velocity)
    theirs.upperEffortLimit = np.array(limits.effort_upper)
    theirs.lowerEffortLimit = np.array(limits.effort_lower)
    theirs.damping, theirs.armature = np.array(ours.damping), np.array(ours.armature)
    warn_of_armature(ours)
    warn_of_additions(ours)
    theirs.upperDryFrictionLimit, theirs.lowerDryFrictionLimit = np.array(ours.friction), -np.array(ours.friction)
    return theirs


def _their_joint(pin: Any, joint: Joint | None, kind: str) -> Any:
    """Returns Pinocchio's joint of this kind. If the axis is x, y or z, the joint has Pinocchio's class for this
    axis.
    """
    assert joint is not None
    free = {"spherical": "Spherical", "planar": "Planar", "translation": "Translation", "free_flyer": "FreeFlyer"}
    if kind in free:
        return getattr(pin, f"JointModel{free[kind]}")()
    assert joint.axis is not None
    pitch = [joint.pitch] if kind == "helical" else []
    for letter, axis in zip("XYZ", np.eye(3), strict=True):
        if np.array_equal(joint.axis, axis):
            name = {"revolute": "R", "continuous": "RUB", "prismatic": "P", "helical": "H"}[kind]
            return getattr(pin, f"JointModel{name}{letter}")(*pitch)
    if kind == "continuous":
        return _unbounded(pin, joint.axis)
    make: Callable[..., Any] = getattr(pin, f"JointModel{kind.capitalize()}Unaligned")
    return make(joint.axis, *pitch)


def _unbounded(pin: Any, axis: NDArray[np.float64]) -> Any:
    """Returns a joint that turns without limits about an axis. In Python, only Pinocchio's URDF reader can make such a
    joint.
    """
    xyz = " ".join(repr(float(x)) for x in axis)
    inertia = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    ends = f'<parent link="a"/><child link="b"/><axis xyz="{xyz}"/>'
    joint = f'<joint name="joint" type="continuous">{ends}</joint>'
    return pin.buildModelFromXML(
        f'<robot name="joint"><link name="a"/><link name="b">{inertia}</link>{joint}</robot>'
    ).joints[1]
