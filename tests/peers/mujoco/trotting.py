"""Model predictive control of a trotting quadruped: the gait, the references, and a tick with each solver."""

import time
from collections.abc import Sequence
from typing import Literal

import numpy as np
from world import Array

import condyle
from condyle import ContactConstraint
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    InteriorPoint,
    Limit,
    Policy,
    Problem,
    Residual,
    Solution,
)

Solver = Literal["tick2", "fddp1", "full_step"]
"""Rule of a tick: `tick(2)` of `InteriorPoint`, or of `Fddp` one iteration, or iterations until a full step (at most
3)."""

KNOTS, DT = 25, 0.02
"""Number of knots of the horizon, and their duration (s). A tick follows after each DT."""
STAND, SWING, BOTH = 0.2, 0.24, 0.04
"""Durations (s): the stand before the first step, a swing, and the time with all feet on the ground between swings."""
STEP = SWING + BOTH
PAIRS = ((0, 3), (1, 2))
"""Feet that swing together, as indices of the sequence front left, front right, rear left, rear right."""
STANCES = ((0, 1, 2, 3), (1, 2), (0, 3))
"""Feet on the ground: always all of them, or while one of the pairs swings."""
HEIGHT = 0.06
"""Height of a swing (m)."""
CAPTURE = 0.1
"""Distance by which a foothold moves for each m/s of deviation from the commanded velocity (s)."""
FRICTION, LEAST = 0.5, 5.0
"""Friction coefficient and smallest normal force (N) of the plan. The coefficient in MuJoCo is larger."""
END = 0.1
"""Weight of the terminal state, relative to the other knots."""


def swinging(t: float) -> tuple[int | None, float]:
    """Returns the pair of feet in the air at the time t (s), and the elapsed fraction of its swing."""
    step, since = divmod(t - STAND + 1e-9, STEP)
    if step < 0 or since >= SWING:
        return None, 0.0
    return int(step) % 2, since / SWING


def stance(t: float) -> int:
    """Returns the index of the stance at the time t (s)."""
    pair, _ = swinging(t)
    return 0 if pair is None else 1 + pair


def heading(q: Array) -> float:
    """Returns the heading of the trunk (rad) at a position or state."""
    x, y, z, w = q[3:7]
    return float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def rotated(quaternion: Array, vector: Array) -> Array:
    """Returns a vector along the axes of the world, given along the axes of a body."""
    axis, w = quaternion[:3], quaternion[3]
    return vector + 2.0 * np.cross(axis, np.cross(axis, vector) + w * vector)


def turned(angle: Array | float, vector: Array) -> Array:
    """Returns a vector in the plane, turned by angles (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]], -1)


class Trot:
    """Controller of a trot: a plan for the next half second, which a tick renews, and the plan's feedback."""

    def __init__(self, model: condyle.Model, q: Array, feet: Sequence[str], solver: Solver = "tick2") -> None:
        """q: the posture in which the robot stands on the ground. feet: frames of the feet, front left, front right,
        rear left, rear right."""
        self.model, self.feet, self.rule = model, list(feet), solver
        self.command = np.zeros(3)
        """Velocity forwards and to the left (m/s), and rate of turning (rad/s)."""
        self.seconds: list[float] = []
        """Durations of the ticks, with references (s)."""
        self._data, self._x = condyle.Data(model), np.r_[q, np.zeros(model.nv)]
        self._lifted = self._placed = self._places(q)
        """Positions at which the feet left the ground, and at which they were last on the ground."""
        self._hips = self._placed[:, :2] - q[:2]
        self._height = q[2] - self._placed[:, 2].mean()
        self._stance = 0
        self._effort = model.limits.effort[6:]
        self._knots = [self._knot(touching) for touching in STANCES]

    def _places(self, q: Array) -> Array:
        places = [condyle.frame_placement(self.model, self._data, q, foot)[:3, 3] for foot in self.feet]
        return np.array(places)

    def _state(self, weight: float) -> Cost:
        joints = self.model.nv - 6
        posture = np.r_[0.0, 0.0, 2000.0, 400.0, 400.0, 100.0, [10.0, 2.0, 2.0] * (joints // 3)]
        rates = np.r_[100.0, 100.0, 50.0, 3.0, 3.0, 10.0, np.full(joints, 0.02)]
        return Cost("state", weight, Residual.state(self._x), Activation.weighted(np.r_[posture, rates]))

    def _knot(self, touching: Sequence[int]) -> ContactDynamics:
        """Returns the model of the knots of a stance. Cones and efforts are limits for `InteriorPoint`, or costs and
        bounds for `Fddp`."""
        grips = [self.feet[k] for k in touching]
        contacts = {foot: ContactConstraint(foot, "point", None, "local_world_aligned", kd=1.0 / DT) for foot in grips}
        still = ContactDynamics(self.model, contacts, DT, []).quasi_static(self._x)
        costs = [self._state(1.0), Cost("effort", 2e-3, Residual.control(still))]
        weights = Activation.weighted([300.0, 300.0, 3e4])
        for k in set(range(4)) - set(touching):
            swing = Residual.frame_translation(self.model, self.feet[k], self._placed[k])
            costs.append(Cost(f"{self.feet[k]} swings", 1.0, swing, weights))
        cones = {foot: Residual.friction_cone(foot, FrictionCone(FRICTION, least=LEAST)) for foot in grips}
        if self.rule == "tick2":
            limits = [Limit(foot, cone) for foot, cone in cones.items()]
            limits.append(Limit("effort", Residual.control(np.zeros(len(still))), -self._effort, self._effort))
            return ContactDynamics(self.model, contacts, DT, costs, limits=limits)
        costs += [Cost(f"{foot} grips", 0.05, cone) for foot, cone in cones.items()]
        return ContactDynamics(self.model, contacts, DT, costs, lower=-self._effort, upper=self._effort)

    def _observe(self, x: Array, t: float) -> None:
        """Records where the feet touch the ground, and where they left it."""
        places, now = self._places(x[: self.model.nq]), stance(t)
        touches = np.isin(range(4), STANCES[now])[:, None]
        left = np.isin(range(4), STANCES[self._stance])[:, None] & ~touches
        self._placed = np.where(touches, places, self._placed)
        self._lifted = np.where(left, places, self._lifted)
        self._stance = now

    def _refer(self, x: Array, t: float) -> None:
        """Writes the references of all knots: the path of the trunk from x at the command, and the swings."""
        nq, (vx, vy, wz) = self.model.nq, self.command
        yaw, level = heading(x), self._placed[:, 2].mean()
        velocity = rotated(x[3:7], x[nq : nq + 3])[:2]

        def path(s: Array) -> Array:
            return x[:2] + s[:, None] * turned(yaw + 0.5 * wz * s, np.array([vx, vy]))

        def foothold(k: int, s: Array) -> Array:
            """Returns the positions at which foot k lands if it lands at the times s after now."""
            hip = self._hips[k]
            along = yaw + wz * s
            ahead = hip + 0.5 * STEP * np.array([vx - wz * hip[1], vy + wz * hip[0]])
            late = CAPTURE * (velocity - turned(along, np.array([vx, vy])))
            return np.c_[path(s) + turned(along, ahead) + late, np.full(len(s), level)]

        s = DT * np.arange(KNOTS + 1)
        states = np.tile(self._x, (KNOTS + 1, 1))
        states[:, :2], states[:, 2] = path(s), level + self._height
        half = 0.5 * (yaw + wz * s)
        states[:, 3:7] = np.c_[0.0 * s, 0.0 * s, np.sin(half), np.cos(half)]
        states[:, nq : nq + 6] = vx, vy, 0.0, 0.0, 0.0, wz
        self.problem.set_references("state", states)
        phases = [swinging(t + ahead) for ahead in s]
        for k, foot in enumerate(self.feet):
            airborne = np.array([pair is not None and k in PAIRS[pair] for pair, _ in phases[:-1]])
            if airborne.any():
                done = np.array([phase for _, phase in phases])
                begun = s - done * SWING
                start = np.where(begun[:, None] <= 1e-9, self._lifted[k], foothold(k, begun - STEP))
                end = foothold(k, begun + SWING)
                forward = (done - np.sin(2.0 * np.pi * done) / (2.0 * np.pi))[:, None]
                target = start + forward * (end - start)
                target[:, 2] += HEIGHT * np.sin(np.pi * done) ** 2
                self.problem.set_references(f"{foot} swings", target)

    def start(self, x: Array) -> Solution:
        """Solves the first problem, from the state x at the time 0."""
        stages = [stance(k * DT) for k in range(KNOTS)]
        self.problem = Problem(x, self._knots, stages, FreeDynamics(self.model, None, [self._state(END)]))
        self.policy = Policy(self.problem)
        xs = np.tile(x, (KNOTS + 1, 1))
        us = self.problem.quasi_static(xs)
        self._observe(x, 0.0)
        self._refer(x, 0.0)
        if self.rule == "tick2":
            self.solver = InteriorPoint(self.problem, tolerance=1e-4)
        else:
            self.solver = Fddp(self.problem, max_iterations=100, tolerance=1e-3)
        plan = self.solver.solve(xs, us)
        if self.rule == "fddp1":
            self.solver = Fddp(self.problem, max_iterations=1, tolerance=0.0)
            plan = self.solver.solve(plan.xs, plan.us)
        self.solver.publish(self.policy, 0.0)
        return plan

    def tick(self, x: Array, t: float) -> Solution:
        """Renews the plan at the time t (s), for the measured state x."""
        begin = time.perf_counter()
        self._observe(x, t)
        self.solver.shift(stance(t + (KNOTS - 1) * DT))
        self._refer(x, t)
        self.problem.set_x0(x)
        if isinstance(self.solver, InteriorPoint):
            plan = self.solver.tick(2)
        elif self.rule == "full_step":
            plan = self.solver.resume(stop="full_step", most=3)
        else:
            plan = self.solver.resume()
        self.solver.publish(self.policy, t)
        self.seconds.append(time.perf_counter() - begin)
        return plan

    def efforts(self, t: float, x: Array) -> Array:
        """Returns the efforts of all joints at the time t (s) and the state x, within the robot's limits. The efforts
        of the free-flyer are 0."""
        return np.r_[np.zeros(6), np.clip(self.policy(t, x), -self._effort, self._effort)]
