"""Condyle's own optimal control problems, as the JSON that `ocp.py` reads: an arm, a rotorcraft and legged robots.

A problem names its robot and has the keys `x0`, `stage_models`, `stages`, `terminal`, `warm_start` and `solvers`. A
stage is the action of one or more knots. `stages` has the index of each knot's stage, and `terminal` the index of the
terminal stage. A stage of kind `euler` has a duration, dynamics and costs. A stage of kind `impulse` has the frames
that hit the ground, and costs. The robots come from the package example-robot-data.
"""

import math
from functools import partial

import numpy as np
import pinocchio as pin
from example_robot_data import load

FRICTION = 0.7
SOLE = [0.1, 0.05]
"""Side lengths of a sole along x and y (m)."""


def plain(array):
    """Returns an array as nested lists, with None for an infinite bound."""
    if np.ndim(array):
        return [plain(x) for x in array]
    return float(array) if abs(array) < 1e300 else None


def placement(X):
    return {"R": plain(X.rotation), "p": plain(X.translation)}


def robot_json(name, model):
    """Returns the JSON of a robot that `ocp_robots.py` reads."""

    def joint(k):
        inertia, kind = model.inertias[k], model.joints[k]
        about = {"mass": inertia.mass, "com": plain(inertia.lever), "I_com": plain(inertia.inertia)}
        place = {
            "name": model.names[k],
            "parent": int(model.parents[k]),
            "placement": placement(model.jointPlacements[k]),
        }
        if not k:
            return place | {"inertia": about}
        sizes = {"idx_v": kind.idx_v, "nq": kind.nq, "nv": kind.nv}
        return place | sizes | {"type": kind.shortname(), "S": joint_axes(kind), "inertia": about}

    def joint_axes(kind):
        if kind.nv == 6:
            return plain(np.eye(6))
        data = kind.createData()
        kind.calc(data, pin.neutral(model))
        return plain(np.array(data.S).reshape(6, -1))

    frames = [{"name": f.name, "joint": int(f.parentJoint), "placement": placement(f.placement)} for f in model.frames]
    limits = {
        "lower_position": model.lowerPositionLimit,
        "upper_position": model.upperPositionLimit,
        "velocity_limit": model.velocityLimit,
        "effort_limit": model.effortLimit,
        "armature": model.armature,
    }
    return {
        "name": name,
        "gravity": plain(model.gravity.vector),
        "joints": [joint(k) for k in range(model.njoints)],
        "frames": frames,
    } | {name: plain(numbers) for name, numbers in limits.items()}


def cost(name, weight, residual, activation=None, **numbers):
    return {
        "name": name,
        "weight": weight,
        "residual": {"type": residual} | numbers,
        "activation": activation or {"type": "quad"},
    }


def weighted(w):
    return {"type": "weighted_quad", "w": plain(w)}


def problem(name, robot, actuation, x0, knots, terminal, **more):
    """Returns the JSON of a problem; equal knots share a stage."""
    stages, order = [], []
    for stage in [*knots, terminal]:
        if stage not in stages:
            stages.append(stage)
        order.append(stages.index(stage))
    return {
        "name": name,
        "robot": robot,
        "robot_overrides": {},
        "actuation": actuation,
        "x0": plain(x0),
        "stage_models": stages,
        "stages": order[:-1],
        "terminal": order[-1],
        "warm_start": "x0+quasistatic",
        "solvers": ["fddp"],
        "maxiter": 100,
        "init_reg": None,
        "th_stop": 1e-7,
    } | more


def free(dt, costs, **bounds):
    return {"kind": "euler", "dt": dt, "dynamics": {"type": "free_fwd"}, "costs": costs} | bounds


def reach(name="reach", share=None):
    """Returns a problem in which a panda reaches for a pose. `share` is the fraction of the robot's maximum efforts
    that the problem permits; None means that efforts have no limits."""
    model = load("panda").model
    q0, data = model.referenceConfigurations["default"], model.createData()
    pin.framesForwardKinematics(model, data, q0)
    goal = data.oMf[model.getFrameId("panda_hand_tcp")] * pin.SE3(
        pin.exp3(np.array([0.2, 0.0, 0.4])), np.array([0.1, 0.2, 0.1])
    )
    x0, nv = np.r_[q0, np.zeros(model.nv)], model.nv
    pose = partial(cost, residual="frame_placement", frame="panda_hand_tcp", **placement(goal))
    rest = partial(cost, residual="state", ref=plain(x0))
    running = [pose("pose", 1.0), rest("rest", 1e-2), cost("effort", 1e-4, "control", ref=[0.0] * nv)]
    stop = rest("stop", 1e-1, activation=weighted(np.repeat([0.0, 1.0], nv)))
    bounds, solvers = {}, ["fddp", "ddp"]
    if share is not None:
        greatest = share * model.effortLimit
        bounds, solvers = {"u_lb": plain(-greatest), "u_ub": plain(greatest)}, ["boxfddp", "boxddp"]
    knots, end = [free(0.02, running, **bounds)] * 40, free(0.02, [pose("pose", 1e3), stop])
    return problem(name, "panda", {"type": "full"}, x0, knots, end, solvers=solvers), robot_json("panda", model)


def hover():
    """Returns a problem in which a quadrotor flies to a pose."""
    model = load("hector").model
    x0 = np.r_[pin.neutral(model), np.zeros(6)]
    angles = [(0.0, "CCW"), (0.5, "CW"), (1.0, "CCW"), (1.5, "CW")]
    rotors = [
        {
            "R": plain(np.eye(3)),
            "p": [0.15 * math.cos(math.pi * turn), 0.15 * math.sin(math.pi * turn), 0.0],
            "torque_per_thrust": 0.015,
            "spin": spin,
        }
        for turn, spin in angles
    ]
    pose = partial(cost, residual="frame_placement", frame="base_link", R=plain(np.eye(3)), p=[1.0, 0.5, 0.8])
    rest = partial(cost, residual="state", ref=plain(x0), activation=weighted(np.r_[[0.1] * 3, [1e2] * 9]))
    running = [pose("pose", 1e-2), rest("rest", 1e-5), cost("thrust", 1e-5, "control", ref=[0.0] * 4)]
    end = free(0.03, [pose("pose", 1e2), rest("rest", 1e-3)])
    actuation = {"type": "thrusters", "thrusters": rotors}
    spec = problem("hover", "hector", actuation, x0, [free(0.03, running)] * 30, end, warm_start="zero", th_stop=None)
    return spec, robot_json("hector", model)


class Walker:
    """Builds the knots of a legged robot. A foot whose contact has 3 rows is a point, and a foot whose contact has 6
    rows is a sole."""

    def __init__(self, name, feet, rows, posture):
        self.name, self.feet, self.rows = name, feet, rows
        self.model = load(name).model
        q0, data = self.model.referenceConfigurations[posture], self.model.createData()
        pin.framesForwardKinematics(self.model, data, q0)
        self.x0 = np.r_[q0, np.zeros(self.model.nv)]
        self.at = {foot: data.oMf[self.model.getFrameId(foot)].translation.copy() for foot in feet}
        self.com = pin.centerOfMass(self.model, data, q0).copy()

    def contact(self, foot):
        target = {"R": plain(np.eye(3)), "p": [0.0] * 3}
        return {"name": f"{foot} stands", "frame": foot, "dim": self.rows, "ref": target, "kp": 0.0, "kd": 40.0,
                "frame_type": "LOCAL_WORLD_ALIGNED"}  # fmt: skip

    def rest(self, weights):
        w = np.concatenate([np.full(n, w) for w, n in zip(weights, [3, 3, self.model.nv - 6] * 2, strict=True)])
        return cost("rest", 1e1, "state", weighted(w), ref=plain(self.x0))

    def track(self, foot, p, weight):
        if self.rows == 3:
            return cost(f"{foot} moves", weight, "frame_translation", frame=foot, p=plain(p))
        return cost(f"{foot} moves", weight, "frame_placement", frame=foot, R=plain(np.eye(3)), p=plain(p))

    def stand(self, dt, support, moving=(), com=None):
        """Returns a knot in which the robot stands on the feet `support`, while other feet move to points."""
        size = {} if self.rows == 3 else {"box": SOLE}
        kind, inner = ("friction_cone", False) if self.rows == 3 else ("wrench_cone", True)
        costs = [
            cost(
                f"{foot} grips", 1e1, kind, {"type": "cone_barrier"}, frame=foot, mu=FRICTION, nf=4, inner=inner, **size
            )
            for foot in support
        ]
        costs += [self.track(foot, p, 1e6) for foot, p in moving]
        if com is not None:
            costs.append(cost("com", 1e6, "com", p=plain(com)))
        costs += [
            self.rest([0.0, 1e5, 1e-4, 1e2, 1e2, 1e1]),
            cost("effort", 1e-1, "control", ref=[0.0] * (self.model.nv - 6)),
        ]
        contacts = [self.contact(foot) for foot in support]
        dynamics = {"type": "contact_fwd", "damping": 0.0, "enable_force": True, "contacts": contacts}
        return {"kind": "euler", "dt": dt, "dynamics": dynamics, "costs": costs}

    def step(self, dt, swinging, length, height, knots):
        """Returns the knots of a step, and the impact at the step's end."""
        support = [foot for foot in self.feet if foot not in swinging]
        share = len(swinging) / len(self.feet)
        stages = []
        for k in range(1, knots + 1):
            s = k / knots
            ahead = np.array([length * s, 0.0, height * math.sin(math.pi * s)])
            moving = [(foot, self.at[foot] + ahead) for foot in swinging]
            stages.append(self.stand(dt, support, moving, self.com + share * np.array([length * s, 0.0, 0.0])))
        for foot in swinging:
            self.at[foot] = self.at[foot] + np.array([length, 0.0, 0.0])
        self.com = self.com + share * np.array([length, 0.0, 0.0])
        impulses = [{"frame": foot, "dim": self.rows, "frame_type": "LOCAL_WORLD_ALIGNED"} for foot in swinging]
        costs = [self.track(foot, self.at[foot], 1e7) for foot in swinging]
        costs.append(self.rest([1.0, 1.0, 1e1, 1e2, 1e2, 1e2]))
        stages.append({"kind": "impulse", "impulses": impulses, "damping": 1e-12, "restitution": 0.0, "costs": costs})
        return stages

    def problem(self, name, knots, **more):
        floating = {"type": "floating_base"}
        return problem(name, self.name, floating, self.x0, knots[:-1], knots[-1], **more), robot_json(
            self.name, self.model
        )


def trot():
    """Returns a problem in which an anymal makes two steps of a trot."""
    w = Walker("anymal", ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"], 3, "standing")
    still = [w.stand(0.02, w.feet)] * 2
    knots = still + w.step(0.02, ["RF_FOOT", "LH_FOOT"], 0.1, 0.1, 10)
    knots += still + w.step(0.02, ["LF_FOOT", "RH_FOOT"], 0.2, 0.1, 10) + still
    return w.problem("trot", knots)


def walk(name="walk", robot="talos_legs", knots=10):
    """Returns a problem in which Talos makes two steps."""
    w = Walker(robot, ["right_sole_link", "left_sole_link"], 6, "half_sitting")
    still = [w.stand(0.03, w.feet)] * 3
    stages = still + w.step(0.03, ["right_sole_link"], 0.2, 0.1, knots) + still
    return w.problem(name, stages + w.step(0.03, ["left_sole_link"], 0.4, 0.1, knots) + still)


PROBLEMS = {
    "reach": reach,
    "weak_reach": partial(reach, "weak_reach", 0.4),
    "hover": hover,
    "trot": trot,
    "walk": walk,
    "humanoid": partial(walk, "humanoid", "talos"),
}
