"""Robots that MuJoCo simulates, their controllers, and the motions that the controllers perform."""

import sys
from collections import deque
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from example_robot_data.robots_loader import ROBOTS, getModelPath
from world import Array, World

import condyle
from condyle.wholebody import (
    FrictionContact,
    Gains,
    Plan,
    Pyramid,
    References,
    Settings,
    Task,
    WholeBodyController,
    plan_of,
)

sys.path.append(str(Path(__file__).parents[3] / "python" / "examples"))
from gait import Gait

Law = Callable[[float, Array, Array], Array]
"""Function of time, position and velocity that returns efforts."""

SOLES = ["left_sole_link", "right_sole_link"]
SOLE = (0.2, 0.12)
"""Side lengths of TALOS's soles (m)."""
TRUSTED = (0.19, 0.11)
"""Side lengths of the soles that the controller assumes (m). They are smaller than the real side lengths, because a
sole tips if the force acts at its edge."""
FEET = ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"]
BALL = 0.03
"""Radius of ANYmal's feet (m)."""
FRICTION = 0.7
PUSH_TIME = 0.1
"""Duration of a push (s), with constant force."""
FALLEN = 0.75
"""Limits that define a fall: a fraction of the trunk's initial height, and an angle (rad). The robot has fallen if the
trunk is below this height or leans by more than this angle."""


def urdf(name: str) -> str:
    """Returns the text of the URDF of a robot in example-robot-data."""
    loader = ROBOTS[name]
    path = Path(loader.path) / loader.urdf_subpath / loader.urdf_filename
    return (Path(getModelPath(str(path))) / path).read_text()


class Disturbance(NamedTuple):
    """Disturbances of a simulation that the controller does not know."""

    noise: float = 0.0
    """Standard deviation of the noise of each velocity, relative to the velocity."""
    delay: int = 0
    """Delay after which the controller receives a state, in control steps."""
    friction: float = 1.0
    """Friction coefficient that the controller assumes, as a multiple of the real coefficient μ."""


NONE = Disturbance()


class Record(NamedTuple):
    """Record of a simulation. Each array has one entry per `every` time steps."""

    stands: bool
    """Whether the robot stands at the end of the simulation."""
    t: Array
    """Times (s)."""
    q: Array
    """Positions."""
    com: Array
    """Centre of mass (m)."""
    loads: Array
    """Vertical force on each foot (N)."""
    wanted: Array
    """Reference positions of the centre of mass (m)."""


def run(
    world: World,
    law: Law,
    seconds: float,
    push: Callable[[float], Sequence[float]] | None = None,
    disturbance: Disturbance = NONE,
    wanted: Callable[[], Array] | None = None,
    every: int = 10,
) -> Record:
    """Runs a control law on a robot that starts from its current state."""
    rng, data = np.random.default_rng(0), condyle.Data(world.model)
    seen: deque[tuple[Array, Array]] = deque(maxlen=1 + disturbance.delay)
    height, rows = world.state()[0][2] - world.ground, []
    stands = True
    for tick in range(round(seconds / world.dt)):
        t = tick * world.dt
        q, v = world.state()
        seen.append((q, v * (1.0 + disturbance.noise * rng.standard_normal(len(v)))))
        world.step(law(t, *seen[0]), push(t) if push else (0.0, 0.0, 0.0))
        if tick % every == 0:
            c = condyle.com(world.model, data, q)
            rows.append((t, q, c, world.loads()[:, 2], wanted() if wanted else c))
        upright = 1.0 - 2.0 * (q[3] ** 2 + q[4] ** 2)  # z component of the trunk's z axis in world coordinates
        if not (q[2] - world.ground > FALLEN * height and upright > np.cos(FALLEN)):
            stands = False
            break
    return Record(stands, *(np.array(column) for column in zip(*rows, strict=True)))


def ramp(t: float, begin: float, end: float) -> Array:
    """Returns value, rate and second derivative of a smooth transition from 0 at `begin` to 1 at `end`."""
    s, w = np.clip((t - begin) / (end - begin), 0.0, 1.0), 1.0 / (end - begin)
    value = s**3 * (10.0 + s * (6.0 * s - 15.0))
    return np.array([value, 30.0 * w * (s * (1.0 - s)) ** 2, 60.0 * w**2 * s * (1.0 - s) * (1.0 - 2.0 * s)])


class Humanoid:
    """Robot TALOS in MuJoCo, standing on two soles."""

    def __init__(
        self,
        disturbance: Disturbance = NONE,
        friction: float = FRICTION,
        cone: Literal["cone"] | Pyramid = "cone",
    ) -> None:
        self.world, self.disturbance = World(urdf("talos"), SOLES, SOLE, friction), disturbance
        model = self.world.model
        contacts = [FrictionContact.sole(sole, friction * disturbance.friction, TRUSTED) for sole in SOLES]
        tasks = [
            Task.com(weight=100.0, gains=Gains.critical(30.0)),
            Task.orientation("base_link", weight=20.0, gains=Gains.critical(50.0)),
            Task.pose(SOLES[1], weight=1000.0, gains=Gains.critical(400.0)),
            Task.posture(gains=Gains.critical(30.0)),
        ]
        settings = Settings(contact_gains=Gains(0.0, 10.0), friction=cone)
        self.controller = WholeBodyController(model, contacts, tasks, settings)
        q = condyle.neutral(model)
        posture = {"leg_*_3": -0.41, "leg_*_4": 0.86, "leg_*_5": -0.45, "arm_*_4": -0.53, "arm_*_7": 0.1}
        for side, sign in (("left", 1.0), ("right", -1.0)):
            for name, angle in (posture | {"arm_*_1": sign * 0.26, "arm_*_2": sign * 0.17}).items():
                q[model.idx_qs[model.joint(name.replace("*", side) + "_joint")]] = angle
        q[2] -= self.controller.hold(q).contacts[0].pose[2, 3]  # at this height of the trunk, the soles are at height 0
        self.q, self.start = q, self.controller.hold(q)
        self.references = self.start.copy()
        self.unsolved = 0
        self.world.set_state(q, np.zeros(model.nv))

    def control(self, aim: Callable[[float, References], None] | None = None) -> Law:
        """Returns the whole-body controller as a function of time and state. `aim` changes the controller's references
        over time."""

        def law(t: float, q: Array, v: Array) -> Array:
            if aim:
                aim(t, self.references)
            command = self.controller.step(q, v, self.references)
            self.unsolved += command.status != "solved"
            return command.tau

        return law

    def hold(self, stiffness: float) -> Law:
        """Returns PD control that holds the joints at the posture, with efforts that compensate gravity. The law uses
        no whole-body controller.

        stiffness: a fraction of the joint's maximum effort, per rad. The damping is a tenth of the stiffness, per
        rad/s. Stiffness and damping act without delay and limit, as in a motor's own control loop: MuJoCo includes both
        in its implicit time step.
        """
        most = np.where(np.isfinite(limit := self.world.model.limits.effort), limit, 0.0)
        tau0 = self.controller.step(self.q, np.zeros(len(most)), self.start).solved().tau
        self.world.mj.dof_damping += self.world.generalized(0.1 * stiffness * most)

        def law(t: float, q: Array, v: Array) -> Array:
            error = condyle.difference(self.world.model, q, self.q)
            return np.clip(tau0 + stiffness * most * error, -most, most)

        return law

    def run(self, law: Law, seconds: float, push: Sequence[float] | None = None, begin: float = 0.5) -> Record:
        """Runs a control law for some seconds. The force of a `push` (N s) is constant for PUSH_TIME."""

        def force(t: float) -> Sequence[float]:
            pushed = push is not None and begin <= t < begin + PUSH_TIME
            return np.array(push) / PUSH_TIME if pushed else (0.0, 0.0, 0.0)

        def wanted() -> Array:
            return self.references.com.position.copy()

        return run(self.world, law, seconds, force, self.disturbance, wanted)

    def shift(self, t: float, references: References) -> None:
        """Shifts the weight to the left sole and to the right sole, by 6 cm each, in 8 s."""
        w, (b, db, ddb) = 0.5 * np.pi, ramp(t, 0.0, 1.0)
        s, ds, dds = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
        y, v, a = 0.06 * np.array([b * s, db * s + b * ds, ddb * s + 2.0 * db * ds + b * dds])
        references.com.position[1] = self.start.com.position[1] + y
        references.com.velocity[1], references.com.acceleration[1] = v, a

    def lift(self, t: float, references: References) -> None:
        """Shifts the weight to the left sole, lifts the right foot by 10 cm, sets it down, and shifts the weight back,
        in 7 s."""
        start = self.start
        to, back = ramp(t, 0.2, 1.4), ramp(t, 5.2, 6.4)
        aside = start.contacts[0].pose[:2, 3] - start.com.position[:2]
        references.com.position[:2] = start.com.position[:2] + aside * (to - back)[0]
        references.com.velocity[:2], references.com.acceleration[:2] = np.outer((to - back)[1:], aside)
        up = 0.1 * (ramp(t, 1.9, 2.9) - ramp(t, 3.4, 4.4))
        references.frames[1].pose[2, 3] = start.frames[1].pose[2, 3] + up[0]
        references.frames[1].velocity[2], references.frames[1].acceleration[2] = up[1:]
        references.contacts[1].activation = 1.0 - ramp(t, 1.6, 1.9)[0] + ramp(t, 4.5, 4.8)[0]


class Quadruped:
    """Robot ANYmal in MuJoCo, which trots along a plan made by FDDP."""

    def __init__(
        self,
        urdf: str,
        feet: Sequence[str],
        plan: Plan,
        disturbance: Disturbance = NONE,
        friction: float = FRICTION,
    ) -> None:
        self.world, self.plan, self.disturbance = World(urdf, feet, BALL, friction), plan, disturbance
        self.feet = list(feet)
        contacts = [FrictionContact.point(foot, friction * disturbance.friction) for foot in feet]
        swing = [Task.position(foot, weight=100.0, gains=Gains.critical(900.0)) for foot in feet]
        tasks = [Task.com(weight=100.0), Task.orientation(self.world.model.body_names[1]), Task.posture(), *swing]
        settings = Settings(contact_gains=Gains(0.0, 40.0))
        self.controller = WholeBodyController(self.world.model, contacts, tasks, settings)
        self.references = self.controller.hold(condyle.neutral(self.world.model))
        self.controller.track(plan, plan.span[0], self.references)
        self.unsolved = 0
        self.world.set_state(self.references.posture.q.copy(), np.zeros(self.world.model.nv))

    def law(self, t: float, q: Array, v: Array) -> Array:
        """Returns the efforts with which the controller tracks the plan."""
        self.controller.track(self.plan, t, self.references)
        command = self.controller.step(q, v, self.references)
        self.unsolved += command.status != "solved"
        return command.tau

    def run(self, seconds: float) -> Record:
        """Simulates the first seconds of the plan."""
        return run(self.world, self.law, seconds, None, self.disturbance, lambda: self.references.com.position.copy())


def trot(urdf: str, feet: Sequence[str], knees: Sequence[float], seconds: float) -> Plan:
    """Plans a trot by FDDP. Diagonal pairs of feet alternately step 16 cm ahead, four times a second. Between the
    steps, all feet stand for 50 ms."""
    model = condyle.Model.from_urdf_str(urdf, root_joint="free_flyer")
    q = condyle.neutral(model)
    q[7:] = knees
    gait, turn = Gait(model, q, feet, 0.01), 0
    gait.stand(30)
    while gait.times[-1] < seconds - 0.55:
        gait.step([[1, 2], [0, 3]][turn % 2], 0.16 if turn else 0.08, 0.06, 20)
        gait.stand(5)
        turn += 1
    gait.stand(30)
    return plan_of(model, gait.solve(), gait.times, gait.touches, fade=0.02)


@cache
def anymal() -> Plan:
    """Returns the plan of ANYmal's trot of 20 s."""
    return trot(urdf("anymal"), FEET, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, 20.0)
