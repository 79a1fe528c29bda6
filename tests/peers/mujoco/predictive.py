"""Model predictive control of robots with legs: the gait, the references, and a tick with each solver."""

import time
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

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
    Schedule,
    Solution,
    WrenchCone,
)

Solver = Literal["tick2", "feedback2", "fddp1", "full_step"]
"""Rule of a tick: `tick(2)` of `InteriorPoint`, or the same as `prepare(2)` before the state arrives and `feedback`
after it. Or of `Fddp` one iteration, or iterations until a full step (at most 3)."""
INTERIOR_POINT = ("tick2", "feedback2")
"""Rules of `InteriorPoint`."""

Landing = Literal["level", "below", "touch", "spring"]
"""Rule for ground of unknown height. A swing ends at the mean height of the feet on the ground (`level`), or `DEPTH`
below it (`below`). With `touch`, a swinging foot that already bears load is a contact from then on. With `spring`,
contacts that begin later have the gain `STIFFNESS` towards that height."""

DT = 0.02
"""Duration of a knot (s)."""
RATE = 50.0
"""Rate of the ticks (Hz), unless a controller has another one."""
FRICTION = 0.5
"""Friction coefficient of the plan. The coefficient in MuJoCo is larger."""
CAPTURE = 0.1
"""Distance by which a foothold moves for each m/s of deviation from the commanded velocity (s)."""
END = 0.1
"""Weight of the terminal state, relative to the other knots."""
HEIGHT = 0.06
"""Height of a swing (m)."""
DEPTH = 0.02
"""Depth below the ground at which swings end with the rule `below` (m)."""
STIFFNESS = 400.0
"""Gain kp of contacts along the vertical with the rule `spring` (1/s²)."""
LOADED = 0.05
"""Fraction of the robot's weight that a foot on the ground bears at least."""


class Gait(NamedTuple):
    """Gait in which groups of feet swing in turn, after a stand."""

    groups: tuple[tuple[int, ...], ...]
    """Feet that swing together, as indices, in the sequence of their swings."""
    stand: float
    """Duration of the stand before the first swing (s)."""
    swing: float
    """Duration of a swing (s)."""
    both: float
    """Time between two swings, with all feet on the ground (s)."""

    @property
    def step(self) -> float:
        """Time between the beginnings of two swings (s)."""
        return self.swing + self.both

    def swinging(self, t: float) -> tuple[int | None, float]:
        """Returns the group of feet in the air at the time t (s), and the elapsed fraction of its swing."""
        step, since = divmod(t - self.stand + 1e-9, self.step)
        if step < 0 or since >= self.swing:
            return None, 0.0
        return int(step) % len(self.groups), since / self.swing

    def stance(self, t: float) -> int:
        """Returns the index of the stance at the time t (s): 0 with all feet on the ground, else 1 + the group."""
        group, _ = self.swinging(t)
        return 0 if group is None else 1 + group

    def schedule(self, steps: int = 500) -> Schedule:
        """Returns the stances in time, for a number of steps."""
        schedule = Schedule(DT, 0)
        for n in range(steps):
            begin = self.stand + n * self.step
            schedule.switch(begin, 1 + n % len(self.groups))
            schedule.switch(begin + self.swing, 0)
        return schedule


class Joint(NamedTuple):
    """Angle of a joint in the stand, and weights of its deviations."""

    angle: float
    """Angle (rad)."""
    weight: float
    """Weight of the angle's deviation."""
    rate: float
    """Weight of the velocity."""


class Robot(NamedTuple):
    """Robot of example-robot-data, and the settings of its controller."""

    feet: Sequence[str]
    """Frames of the feet."""
    size: float | tuple[float, float]
    """Radius of a foot, or side lengths of a sole (m)."""
    joints: dict[str, Joint]
    """Joints by a part of their name; the first part that fits counts."""
    gait: Gait
    knots: int
    """Number of knots of the horizon."""
    speed: float
    """Commanded speed (m/s)."""
    acceleration: float
    """Acceleration until the commanded speed is reached (m/s²)."""
    sideways: float
    """Weight of the trunk's velocity to the left."""
    effort: float
    """Weight of the efforts."""
    impulses: tuple[float, ...]
    """Impulses of pushes (N s)."""
    trusted: float = 0.85
    """Side lengths of a sole that the plan assumes, relative to the real ones."""

    def joint(self, name: str) -> Joint:
        """Returns the settings of a joint."""
        return next(joint for part, joint in self.joints.items() if part in name)

    def standing(self, model: condyle.Model) -> Array:
        """Returns the posture in which the robot stands, with the feet at height 0."""
        q, data = condyle.neutral(model), condyle.Data(model)
        q[7:] = [self.joint(name).angle for name in model.names[2:]]
        q[2] -= min(condyle.frame_placement(model, data, q, foot)[2, 3] for foot in self.feet)
        return q


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


class Predictive:
    """Controller of a walk or a trot: a plan, which a tick renews, and the plan's feedback."""

    def __init__(
        self,
        model: condyle.Model,
        robot: Robot,
        solver: Solver = "tick2",
        rate: float | None = None,
        landing: Landing = "level",
    ) -> None:
        """rate: rate of the ticks (Hz), which is independent of the knots. With None, each tick shifts the horizon by a
        knot."""
        self.model, self.robot, self.rule, self.landing, self.feet = model, robot, solver, landing, list(robot.feet)
        self._schedule = None if rate is None else robot.gait.schedule()
        self._times = DT * np.arange(robot.knots + 1)
        """Times at which the knots begin, after the beginning of the horizon (s)."""
        self._begin = 0.0
        q = robot.standing(model)
        self.command = np.zeros(3)
        """Velocity forwards and to the left (m/s), and rate of turning (rad/s)."""
        self.seconds: list[float] = []
        """Durations of the ticks, with references (s); with `feedback2`, from the state to the new plan."""
        self.before_solve: Callable[[Fddp | InteriorPoint], object] = lambda solver: None
        """Function that is called with each new solver before its first solve."""
        self._data, self._x = condyle.Data(model), np.r_[q, np.zeros(model.nv)]
        self._lifted = self._placed = self._places(q)
        """Positions at which the feet left the ground, and at which they were last on the ground."""
        self._hips = self._placed[:, :2] - q[:2]
        self._height = q[2] - self._placed[:, 2].mean()
        self._stance = 0
        self._effort = model.limits.effort[6:]
        every = range(len(self.feet))
        self._stances = [tuple(every), *(tuple(k for k in every if k not in group) for group in robot.gait.groups)]
        """Feet on the ground: all of them, or while one of the groups swings."""
        self._knots = [self._knot(touching) for touching in self._stances]
        self._touching: dict[tuple[int, ...], ContactDynamics] = {}
        """Models of stances that the gait does not plan."""
        self._least = LOADED * 9.81 * model.total_mass

    def _places(self, q: Array) -> Array:
        places = [condyle.frame_placement(self.model, self._data, q, foot)[:3, 3] for foot in self.feet]
        return np.array(places)

    def _state(self, weight: float) -> Cost:
        joints = [self.robot.joint(name) for name in self.model.names[2:]]
        posture = np.r_[0.0, 0.0, 2000.0, 400.0, 400.0, 100.0, [joint.weight for joint in joints]]
        rates = np.r_[100.0, self.robot.sideways, 50.0, 3.0, 3.0, 10.0, [joint.rate for joint in joints]]
        return Cost("state", weight, Residual.state(self._x), Activation.weighted(np.r_[posture, rates]))

    def _swing(self, k: int) -> list[Cost]:
        """Returns the costs of a foot that swings. A sole remains level."""
        foot = self.feet[k]
        place = Residual.frame_translation(self.model, foot, self._placed[k])
        costs = [Cost(f"{foot} swings", 1.0, place, Activation.weighted([300.0, 300.0, 3e4]))]
        if not isinstance(self.robot.size, float):
            costs.append(Cost(f"{foot} tilts", 1e3, Residual.tilt(self.model, foot)))
        return costs

    def _cone(self, foot: str) -> Residual:
        """Returns the cone of the force of a foot, or of the wrench of a sole."""
        friction = FrictionCone(FRICTION, least=5.0)
        if isinstance(self.robot.size, float):
            return Residual.friction_cone(foot, friction)
        return Residual.wrench_cone(foot, WrenchCone(friction, [self.robot.trusted * side for side in self.robot.size]))

    def _knot(self, touching: Sequence[int]) -> ContactDynamics:
        """Returns the model of the knots of a stance. Cones and efforts are limits for `InteriorPoint`, or costs and
        bounds for `Fddp`."""
        kind: Literal["point", "rigid"] = "point" if isinstance(self.robot.size, float) else "rigid"
        grips = [self.feet[k] for k in touching]
        contacts = {foot: ContactConstraint(foot, kind, None, "local_world_aligned", kd=1.0 / DT) for foot in grips}
        still = ContactDynamics(self.model, contacts, DT, []).quasi_static(self._x)
        costs = [self._state(1.0), Cost("effort", self.robot.effort, Residual.control(still))]
        costs += [cost for k in range(len(self.feet)) if k not in touching for cost in self._swing(k)]
        cones = {foot: self._cone(foot) for foot in grips}
        if self.rule in INTERIOR_POINT:
            limits = [Limit(foot, cone) for foot, cone in cones.items()]
            limits.append(Limit("effort", Residual.control(np.zeros(len(still))), -self._effort, self._effort))
            return ContactDynamics(self.model, contacts, DT, costs, limits=limits)
        costs += [Cost(f"{foot} grips", 0.05, cone) for foot, cone in cones.items()]
        return self._bounded(contacts, costs)

    def _bounded(self, contacts: dict[str, ContactConstraint], costs: list[Cost]) -> ContactDynamics:
        """Returns a model of knots for `Fddp`, with bounds on the efforts."""
        return ContactDynamics(self.model, contacts, DT, costs, lower=-self._effort, upper=self._effort)

    def _observe(self, x: Array, t: float) -> None:
        """Records where the feet touch the ground, and where they left it."""
        places, now = self._places(x[: self.model.nq]), self.robot.gait.stance(t)
        touches = np.isin(range(len(self.feet)), self._stances[now])[:, None]
        left = np.isin(range(len(self.feet)), self._stances[self._stance])[:, None] & ~touches
        self._placed = np.where(touches, places, self._placed)
        self._lifted = np.where(left, places, self._lifted)
        self._stance = now

    def _refer(self, x: Array, t: float) -> None:
        """Writes the references of all knots: the path of the trunk from x at the command, and the swings."""
        nq, gait, knots, (vx, vy, wz) = self.model.nq, self.robot.gait, self.robot.knots, self.command
        yaw, level = heading(x), self._placed[:, 2].mean()
        velocity = rotated(x[3:7], x[nq : nq + 3])[:2]

        def path(s: Array) -> Array:
            return x[:2] + s[:, None] * turned(yaw + 0.5 * wz * s, np.array([vx, vy]))

        def foothold(k: int, s: Array) -> Array:
            """Returns the positions at which foot k lands if it lands at the times s after now."""
            hip = self._hips[k]
            along = yaw + wz * s
            ahead = hip + 0.5 * gait.step * np.array([vx - wz * hip[1], vy + wz * hip[0]])
            late = CAPTURE * (velocity - turned(along, np.array([vx, vy])))
            return np.c_[path(s) + turned(along, ahead) + late, np.full(len(s), level)]

        s = self._times
        states = np.tile(self._x, (knots + 1, 1))
        states[:, :2], states[:, 2] = path(s), level + self._height
        half = 0.5 * (yaw + wz * s)
        states[:, 3:7] = np.c_[0.0 * s, 0.0 * s, np.sin(half), np.cos(half)]
        states[:, nq : nq + 6] = vx, vy, 0.0, 0.0, 0.0, wz
        self.problem.set_references("state", states)
        if self.landing == "spring":
            places = self._places(x[:nq])
            for k, foot in enumerate(self.feet):
                target = np.eye(4)
                target[2, 3] = places[k, 2] if k in self._stances[gait.stance(t)] else level
                self.problem.set_contact(foot, placement=target, kp=[0.0, 0.0, STIFFNESS, 0.0, 0.0, 0.0])
        phases = [gait.swinging(t + ahead) for ahead in s]
        for k, foot in enumerate(self.feet):
            airborne = np.array([group is not None and k in gait.groups[group] for group, _ in phases[:-1]])
            if airborne.any():
                done = np.array([phase for _, phase in phases])
                begun = s - done * gait.swing
                start = np.where(begun[:, None] <= 1e-9, self._lifted[k], foothold(k, begun - gait.step))
                end = foothold(k, begun + gait.swing)
                forward = (done - np.sin(2.0 * np.pi * done) / (2.0 * np.pi))[:, None]
                target = start + forward * (end - start)
                target[:, 2] += HEIGHT * np.sin(np.pi * done) ** 2
                if self.landing == "below":
                    target[:, 2] -= DEPTH * np.maximum(2.0 * done - 1.0, 0.0)
                self.problem.set_references(f"{foot} swings", target)

    def _touch(self, loads: Array, t: float) -> None:
        """Plans contact until the end of the swing for feet that bear load in its second half."""
        group, done = self.robot.gait.swinging(t)
        early = (
            [] if group is None or done < 0.5 else [k for k in self.robot.gait.groups[group] if loads[k] > self._least]
        )
        if group is None or not early:
            return
        stance = tuple(sorted([*self._stances[1 + group], *early]))
        if stance not in self._touching:
            self._touching[stance] = self._knot(stance)
        for k in range(round((1.0 - done) * self.robot.gait.swing / DT)):
            self.problem.set_knot(k, self._touching[stance])

    def start(self, x: Array) -> Solution:
        """Solves the first problem, from the state x at the time 0."""
        stages = [self.robot.gait.stance(k * DT) for k in range(self.robot.knots)]
        self.problem = Problem(x, self._knots, stages, FreeDynamics(self.model, None, [self._state(END)]))
        self.policy = Policy(self.problem)
        if self._schedule is not None:
            stages, durations = self._schedule.knots(0.0, self.robot.knots)
            self.problem.set_knots(stages, durations)
            self._times = np.r_[0.0, np.cumsum(durations)]
        xs = np.tile(x, (self.robot.knots + 1, 1))
        us = self.problem.quasi_static(xs)
        self._observe(x, 0.0)
        self._refer(x, 0.0)
        if self.rule in INTERIOR_POINT:
            self.solver = InteriorPoint(self.problem, tolerance=1e-4)
        else:
            self.solver = Fddp(self.problem, max_iterations=100, tolerance=1e-3)
        self.before_solve(self.solver)
        plan = self.solver.solve(xs, us)
        if self.rule == "fddp1":
            self.solver = Fddp(self.problem, max_iterations=1, tolerance=0.0)
            self.before_solve(self.solver)
            plan = self.solver.solve(plan.xs, plan.us)
        self.solver.publish(self.policy, 0.0)
        return plan

    def tick(self, x: Array, t: float, loads: Array | None = None) -> Solution:
        """Renews the plan at the time t (s), for the measured state x and the vertical forces on the feet (N)."""
        begin = time.perf_counter()
        if self._schedule is None:
            self.solver.shift(self.robot.gait.stance(t + (self.robot.knots - 1) * DT))
        else:
            stances, durations = self._schedule.knots(t, self.robot.knots)
            self.solver.retime(t - self._begin, stances, durations)
            self._begin, self._times = t, np.r_[0.0, np.cumsum(durations)]
        if self.rule == "feedback2":  # the references belong to the predicted state
            predicted = self.solver.solution.xs[0]
            self._observe(predicted, t)
            self._refer(predicted, t)
            self.solver.prepare(2)
            begin = time.perf_counter()
            plan = self.solver.feedback(x)
            self.solver.publish(self.policy, t)
            self.seconds.append(time.perf_counter() - begin)
            return plan
        self._observe(x, t)
        if self.landing == "touch" and loads is not None:
            self._touch(loads, t)
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
