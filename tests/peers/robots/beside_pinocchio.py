"""Compares robots from URDFs with Pinocchio. Joints have the same names, order and coordinates in both libraries."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pinocchio as pin
from comparison import STATES, Joint, Quantities, RefusedError, UnlikeError, state_of, there, without_rotors

import condyle

TOLERANCE = 1e-10
LARGEST = np.finfo(float).max


@contextmanager
def written() -> Iterator[list[str]]:
    """Captures the text that Python code and C++ libraries write to the standard error."""
    texts: list[str] = []
    before = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield texts
        finally:
            os.dup2(before, 2)
            os.close(before)
            file.seek(0)
            texts.append(file.read().decode("utf-8", "replace"))


said: list[str] = [""]
"""Errors in the last file that Pinocchio's parser urdfdom reported and ignored."""


def read(path: Path, root_joint: str | None) -> pin.Model:
    """Returns Pinocchio's model for a URDF."""
    root = (pin.JointModelFreeFlyer(),) if root_joint else ()
    try:
        with written() as texts:
            model = pin.buildModelFromUrdf(str(path), *root)
        said[:] = texts
        return model
    except (ValueError, RuntimeError, IndexError) as error:
        raise RefusedError(str(error).strip().splitlines()[0]) from None


def compare(theirs: pin.Model, model: condyle.Model) -> Quantities:
    """Compares all quantities that exist in Condyle and in Pinocchio."""
    rotors, model = model.armature, without_rotors(model)
    found = Quantities(model, TOLERANCE)
    if rotors.any():
        found.leave_out("Pinocchio leaves the inertia of rotors out", "armature")
    if "planar" in model.joint_types:
        raise UnlikeError("planar joints: Pinocchio leaves out their axes")
    if (theirs.nq, theirs.nv) != (model.nq, model.nv):
        found.add("nq, nv", np.inf, f"{model.nq}, {model.nv}, theirs {theirs.nq}, {theirs.nv}")
        return found
    # If the file contains a joint named `root_joint`, Condyle gives the robot's root joint another name.
    own = 2 if model.joint_types[1:2] == ["free_flyer"] else 1
    if list(theirs.names)[own:] != model.names[own:] or list(theirs.parents) != model.parents:
        found.add("joints", np.inf, "names or parents")
        return found
    if "Could not parse inertial element" in said[0]:
        found.leave_out("urdfdom reads a faulty <inertial> as none", "M", "bias", "total mass")
    joints = [Joint(i, theirs.joints[i].idx_q, theirs.joints[i].idx_v) for i in range(1, model.nbodies)]
    found.expect("total mass", model.total_mass, pin.computeTotalMass(theirs) + theirs.inertias[0].mass)
    found.expect("damping", model.damping, theirs.damping, found.coordinate)
    found.expect("friction", model.friction, theirs.upperDryFrictionLimit, found.coordinate)
    found.expect("armature", model.armature, theirs.armature, found.coordinate)
    limits(found, theirs)
    data = theirs.createData()
    moving = [f for f in enumerate(theirs.frames) if f[0]]
    names = {(f.name, kind_of(f.type)): i for i, f in moving}
    for seed in range(STATES):
        q, v = state_of(model, seed)
        state = there("pinocchio", model, joints, q, v, theirs.nq, theirs.nv)
        if theirs.nv:
            M = np.triu(pin.crba(theirs, data, state.q))
            h = pin.nonLinearEffects(theirs, data, state.q, state.v)
            found.inertia(q, v, state, M + np.triu(M, 1).T, h)
        pin.framesForwardKinematics(theirs, data, state.q)
        for i, frame in enumerate(model.frames):
            there_ = names.get((frame.name, frame.kind))
            if there_ is not None:
                pose, name = data.oMf[there_].homogeneous, frame.name
                ours = condyle.frame_placement(model, found.data, q, i)
                found.expect("frames", ours, pose, lambda _, name=name: f"frame `{name}`")
    missing = set(names) - {(f.name, f.kind) for f in model.frames}
    if missing:
        found.add("frames", np.inf, f"{sorted(missing)[0][0]} is missing")
    return found


def kind_of(kind: pin.FrameType) -> str:
    """Converts the type of a frame of Pinocchio to the name of Condyle's frame kind."""
    return {pin.FrameType.BODY: "link", pin.FrameType.OP_FRAME: "user"}.get(kind, "joint")


def limits(found: Quantities, theirs: pin.Model) -> None:
    """Compares limits, except the limits of quaternions, cosines and sines."""
    if any("is above upper limit" in str(warning) for warning in found.model.warnings):
        found.leave_out("a lower limit above the upper one is none here, as a warning says", "limits: position")
    ours = found.model.limits
    one = np.zeros(theirs.nq, bool)
    for joint in list(theirs.joints)[1:]:
        if joint.nq == joint.nv == 1:
            one[joint.idx_q] = True
    lower = np.where(one, unlimited(theirs.lowerPositionLimit), -np.inf)
    upper = np.where(one, unlimited(theirs.upperPositionLimit), np.inf)
    found.expect("limits: position", ours.lower, lower, found.position)
    found.expect("limits: position", ours.upper, upper, found.position)
    found.expect("limits: velocity", ours.velocity, unlimited(theirs.upperVelocityLimit), found.coordinate)
    found.expect("limits: effort", ours.effort, unlimited(theirs.upperEffortLimit), found.coordinate)


def unlimited(numbers: np.ndarray) -> np.ndarray:
    """Returns limits, in which infinity replaces the largest floating-point number."""
    return np.where(np.abs(numbers) == LARGEST, np.sign(numbers) * np.inf, numbers)
