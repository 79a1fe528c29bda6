"""Builds the robots of the optimal control problems from JSON, in Condyle and in Pinocchio."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import condyle

FRAMES = {
    "LOCAL": (pin.LOCAL, "local"),
    "WORLD": (pin.WORLD, "local_world_aligned"),
    "LOCAL_WORLD_ALIGNED": (pin.LOCAL_WORLD_ALIGNED, "local_world_aligned"),
}


class NotRunError(Exception):
    """Error for a problem that is not run, because a library lacks a feature or because the results cannot be
    compared."""


def bounds(numbers, infinite):
    """Returns the numbers as an array, with `infinite` in place of None."""
    return np.array([infinite if x is None else x for x in numbers], dtype=float)


def homogeneous(placement):
    """Returns a pose as a (4, 4) matrix."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = placement["R"], placement["p"]
    return X


@dataclass
class Solve:
    """Result of a solve: for each iteration a row (cost, step length, regularisation, stopping value), and the time (s)
    of each phase: derivatives, backward sweep, rollout."""

    rows: np.ndarray
    cost: float
    xs: np.ndarray
    phases: dict


def our_robot(spec):
    """Returns the `condyle.Model` for the JSON of a robot."""
    builder = condyle.ModelBuilder(spec["name"])
    builder.gravity(spec["gravity"][:3])
    bodies, names = [condyle.WORLD], set()
    for joint in spec["joints"][1:]:
        S = np.array(joint["S"], dtype=float)
        if joint["nv"] == 6:
            kind = condyle.Joint.free_flyer()
        elif joint["nv"] == 1 and not S[3:].any():
            kind = condyle.Joint.prismatic(S[:3, 0])
        elif joint["nv"] == 1:
            kind = (condyle.Joint.continuous if joint["nq"] == 2 else condyle.Joint.revolute)(S[3:, 0])
        else:
            raise NotRunError(f"joint type {joint['type']}")
        inertia = joint["inertia"]
        bodies.append(
            builder.body(
                f"body of {joint['name']}",
                bodies[joint["parent"]],
                kind,
                homogeneous(joint["placement"]),
                condyle.Inertia.from_com(inertia["mass"], inertia["com"], inertia["I_com"]),
                joint_name=joint["name"],
                armature=spec["armature"][joint["idx_v"]],
            )
        )
    for frame in spec["frames"]:
        if frame["name"] not in names:
            names.add(frame["name"])
            builder.frame(frame["name"], bodies[frame["joint"]], homogeneous(frame["placement"]))
    return builder.build()


def their_robot(spec):
    """Returns the `pinocchio.Model` for the JSON of a robot."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array(spec["gravity"], dtype=float))

    def pose(placement):
        return pin.SE3(homogeneous(placement))

    for joint in spec["joints"][1:]:
        kind = getattr(pin, joint["type"], None)
        if joint["type"].endswith("Unaligned"):
            S = np.array(joint["S"], dtype=float)[:, 0]
            made = kind(S[:3] if "Prismatic" in joint["type"] else S[3:])
        else:
            made = kind()
        index = model.addJoint(joint["parent"], made, pose(joint["placement"]), joint["name"])
        model.addJointFrame(index)
        inertia = joint["inertia"]
        body = pin.Inertia(inertia["mass"], np.array(inertia["com"]), np.array(inertia["I_com"]))
        model.appendBodyToJoint(index, body, pin.SE3.Identity())
    for frame in spec["frames"]:
        if not model.existFrame(frame["name"]):
            at = pose(frame["placement"])
            model.addFrame(pin.Frame(frame["name"], frame["joint"], 0, at, pin.FrameType.OP_FRAME))
    model.armature = np.array(spec["armature"], dtype=float)
    model.lowerPositionLimit = bounds(spec["lower_position"], -np.finfo(float).max)
    model.upperPositionLimit = bounds(spec["upper_position"], np.finfo(float).max)
    model.velocityLimit = bounds(spec["velocity_limit"], np.finfo(float).max)
    model.effortLimit = bounds(spec["effort_limit"], np.finfo(float).max)
    return model


def actuation_matrix(spec, nv):
    """Returns the matrix S of τ = S u. Returns None if each joint, except a free-flyer at the root, has a control."""
    kind = spec["actuation"]["type"]
    if kind in ("full", "floating_base"):
        return None
    if kind == "first_joint_only":
        return np.eye(nv)[:, :1]
    assert kind == "thrusters", kind
    S = np.zeros((nv, len(spec["actuation"]["thrusters"])))
    for j, rotor in enumerate(spec["actuation"]["thrusters"]):
        thrust = np.array(rotor["R"], dtype=float)[:, 2]  # along the z axis of the rotor's frame
        turn = (-1.0 if rotor["spin"] == "CW" else 1.0) * rotor["torque_per_thrust"] * thrust
        S[:3, j], S[3:6, j] = thrust, np.cross(rotor["p"], thrust) + turn
    return S
