#!/usr/bin/env python3
"""Walking robots in MuJoCo under `condyle.mpc.WholeBodyMpc`: robots, conditions and results.

    .venv/pinocchio/bin/python tests/peers/mujoco/walking.py [ROBOT …]

The program prints the mean velocities for commands, for slopes and errors of the model, and the number of survived
pushes. A tick contains the references and the solver's work.
"""

import argparse
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from pushes import ANGLES, BEGIN, LEAN, LOW, PUSH_TIME, SURVIVED, Push, text_of
from world import Array, World

import condyle
from condyle.mpc import Foot, Gait, Weights, WholeBodyMpc

Command = Callable[[float], tuple[float, float, float]]
"""Commanded velocity as a function of time: forwards, to the left (m/s), turning (rad/s)."""


SECONDS, SINCE = 6.0, 3.0
"""Duration of a walk in the tables, and the time since which velocities count (s)."""


class Walker(NamedTuple):
    """Robot of example-robot-data, and how it walks."""

    feet: tuple[str, ...]
    """Frames of the feet."""
    size: float | tuple[float, float]
    """Radius of a foot, or side lengths of a sole (m)."""
    joints: dict[str, float]
    """Angles of joints in the stand, by a part of their name; the first part that fits counts (rad)."""
    gait: Gait
    horizon: float = 0.5
    """Duration of the horizon (s)."""
    weights: Weights = Weights()
    """Weights of the costs."""
    friction: float = 0.5
    """Coefficient of friction that the controller assumes. The coefficient in MuJoCo is 0.7."""

    def foot_list(self) -> list[Foot]:
        """Returns the feet for the controller. The centres of balls are at height 0, so their radius does not count."""
        if isinstance(self.size, float):
            return [Foot.point(foot, self.friction, 0.0) for foot in self.feet]
        return [Foot.sole(foot, self.friction, self.size) for foot in self.feet]

    def settings(self) -> dict[str, Any]:
        """Returns the settings of the controller."""
        return {"horizon": self.horizon, "weights": self.weights}


QUADRUPED = Walker(
    ("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
    0.022,
    {"hip": 0.0, "thigh": 0.85, "calf": -1.6},
    Gait.trot(swing=0.24, double=0.04),
)
ANYMAL = Walker(
    ("LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"),
    0.03,
    {"HAA": 0.0, "LF_HFE": 0.7, "RF_HFE": 0.7, "HFE": -0.7, "LF_KFE": -1.4, "RF_KFE": -1.4, "KFE": 1.4},
    Gait.trot(swing=0.28, double=0.06),
)
HUMANOID = Walker(
    ("left_sole", "right_sole"),
    (0.17, 0.055),
    {
        "hip_pitch": -0.35,
        "knee": 0.7,
        "ankle_pitch": -0.35,
        "left_shoulder_roll": 0.2,
        "right_shoulder_roll": -0.2,
        "shoulder_pitch": 0.2,
        "elbow": 0.6,
    },
    Gait.step(swing=0.36, double=0.08),
    horizon=0.8,
    weights=Weights(sideways=30.0),
)
TALOS = Walker(
    ("left_sole_link", "right_sole_link"),
    (0.2, 0.12),
    {
        "leg_left_3": -0.4,
        "leg_right_3": -0.4,
        "leg_left_4": 0.8,
        "leg_right_4": 0.8,
        "leg_left_5": -0.4,
        "leg_right_5": -0.4,
        "arm_left_2": 0.3,
        "arm_right_2": -0.3,
        "arm_left_4": -0.5,
        "arm_right_4": -0.5,
    },
    Gait.step(swing=0.6, double=0.2),
    horizon=1.0,
    weights=Weights(sideways=30.0),
)
WALKERS = {"go2": QUADRUPED, "go1": QUADRUPED, "a1": QUADRUPED, "anymal": ANYMAL, "g1": HUMANOID, "talos": TALOS}


class Conditions(NamedTuple):
    """Conditions of a simulation that the controller does not know, apart from the rate."""

    period: float = 0.02
    """Time between two ticks (s)."""
    slope: float = 0.0
    """Slope of the ground (degrees)."""
    direction: float = 0.0
    """Direction in which the ground rises (degrees): 0 is ahead, 90 is to the left."""
    friction: float = 0.7
    """Coefficient of friction."""
    trunk: float = 1.0
    """Mass of the trunk, relative to the model."""
    late: float = 0.0
    """Time by which a plan is used later than its state was measured (s)."""
    delay: int = 0
    """Time steps by which efforts are applied late (ms)."""


NOMINAL = Conditions()
UNKNOWN = Conditions(trunk=1.22, friction=0.49, late=0.02, delay=2)
"""Errors of the model: a trunk of 1.22 times the mass, a coefficient of friction lower by 30 %, plans that are used one
period late, and efforts that are applied 2 ms late."""
CONDITIONS = {
    "go2": [
        *(NOMINAL._replace(slope=5.0, direction=direction) for direction in (0.0, 90.0, 180.0)),
        *(UNKNOWN._replace(slope=5.0, direction=direction) for direction in (0.0, 90.0, 180.0)),
    ],
    "g1": [NOMINAL._replace(trunk=1.2), NOMINAL._replace(friction=0.35)],
}
COMMANDS: dict[str, list[tuple[float, float, float]]] = {
    "go2": [
        (0.5, 0.0, 0.0),
        (-0.5, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (-1.0, 0.0, 0.0),
        (1.5, 0.0, 0.0),
        (0.0, 0.5, 0.0),
        (0.0, -0.5, 0.0),
        (0.0, 0.0, 1.5),
        (0.0, 0.0, -1.5),
    ],
    "anymal": [(0.5, 0.0, 0.0), (1.0, 0.0, 0.0), (-0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 1.5)],
    "g1": [
        (0.2, 0.0, 0.0),
        (0.4, 0.0, 0.0),
        (-0.15, 0.0, 0.0),
        (0.0, 0.1, 0.0),
        (0.0, -0.1, 0.0),
        (0.0, 0.0, 0.4),
        (0.0, 0.0, 0.0),
    ],
    "talos": [(0.2, 0.0, 0.0)],
}
"""Commands for each robot: velocities forwards and to the left (m/s), rate of turning (rad/s)."""
PUSHED = {"go2": (0.5, 0.0, 0.0), "g1": (0.0, 0.0, 0.0)}
"""Commands while the robots are pushed."""
LEAST = {"go2": {12.0: 16, 16.0: 16, 20.0: 16, 24.0: 15, 28.0: 9}, "g1": {6.0: 16, 9.0: 14}}
"""Smallest number of survived pushes of 16, by their impulse (N s)."""


RATES = {"go2": 500.0, "g1": 150.0}
"""Highest rates of ticks on one core (Hz). A plan is then used one period after its state was measured."""


class Walk(NamedTuple):
    """Result of a simulation."""

    fallen: bool
    times: Array
    """Times (s), in steps of 1 ms."""
    states: Array
    """States (q, v)."""
    efforts: Array
    """Efforts of the joints."""
    ticks: Array
    """Durations of ticks: references, and the solver (s)."""
    gaps: Array
    """Gaps of the plans."""

    def velocity(self, since: float, until: float = np.inf) -> Array:
        """Returns the mean velocity of the trunk between two times, along its axes (m/s, rad/s)."""
        chosen = (self.times >= since) & (self.times < until)
        return self.states[chosen, -len(self.efforts[0]) - 6 :][:, :6].mean(axis=0)


def walk(
    name: str,
    seconds: float,
    command: Command,
    pushes: Sequence[Push] = (),
    conditions: Conditions = NOMINAL,
    observe: Callable[[Array], None] | None = None,
    **settings: Any,
) -> Walk:
    """Simulates a robot that stands and then walks, until it falls or the time is over. `observe` receives the planned
    forces of each tick, (knots, feet, 3) (N)."""
    walker, (angle, tilt) = WALKERS[name], np.radians([conditions.direction, conditions.slope])
    rise = np.tan(tilt) * np.array([np.cos(angle), np.sin(angle)])
    world = World(text_of(name), walker.feet, walker.size, friction=conditions.friction, rise=rise)
    world.mj.body_mass[world.trunk] *= conditions.trunk
    world.mj.body_inertia[world.trunk] *= conditions.trunk
    model = world.model
    q, data = world.stand(walker.joints), condyle.Data(model)
    if tilt != 0.0:  # no foot is below the ground
        q[2] += max(condyle.frame_placement(model, data, q, foot)[:2, 3] @ rise for foot in walker.feet)
        q[2] += walker.size * (1.0 / np.cos(tilt) - 1.0) if isinstance(walker.size, float) else 0.0
    world.set_state(q, np.zeros(model.nv))
    mpc = WholeBodyMpc(model, walker.foot_list(), walker.gait, **{**walker.settings(), **settings})
    mpc.reset(np.concatenate(world.state()))
    policy, queue, waiting = mpc.policy(), deque([np.zeros(model.nv)] * conditions.delay), deque()
    times, states, efforts, ticks, gaps = [], [], [], [], []
    due, fallen = conditions.period, False
    for i in range(round(seconds / world.dt)):
        t, x = i * world.dt, np.concatenate(world.state())
        low = x[2] - rise @ x[:2] < LOW * q[2]
        fallen = bool(low or 1.0 - 2.0 * (x[3] ** 2 + x[4] ** 2) < np.cos(LEAN) or not np.isfinite(x).all())
        if fallen:
            break
        if t >= due - 1e-9:
            waiting.append((t, x))
            due += conditions.period
        if waiting and t >= waiting[0][0] + conditions.late - 1e-9:
            mpc.command(*command(t))
            mpc.update(*waiting.popleft())
            ticks.append((mpc.report.references, mpc.report.solve))
            gaps.append(mpc.report.gap)
            if observe is not None:
                observe(mpc.forces())
        queue.append(np.r_[np.zeros(6), policy(t, x)])
        force = np.zeros(3)
        for push in pushes:
            if push.begin <= t < push.begin + PUSH_TIME:
                toward = np.radians(push.angle)
                force += push.impulse / PUSH_TIME * np.array([np.cos(toward), np.sin(toward), 0.0])
        times.append(t)
        states.append(x)
        efforts.append(queue[-1][6:])
        world.step(queue.popleft(), force)
    return Walk(fallen, *map(np.array, (times, states, efforts, ticks, gaps)))


def at_rate(rate: float) -> Conditions:
    """Returns the conditions of ticks that last as long as the period."""
    return Conditions(period=1.0 / rate, late=1.0 / rate)


def survives(name: str, push: Push, conditions: Conditions = NOMINAL) -> bool:
    """Returns whether the robot survives a push."""
    command, end = PUSHED[name], push.begin + PUSH_TIME + SURVIVED
    return not walk(name, end, lambda _: command, [push], conditions, latency=conditions.late).fallen


def at_highest_rate(name: str) -> str:
    """Returns the times of ticks at the highest rate, and the fraction of ticks that exceed the period."""
    period = 1.0 / RATES[name]
    found = walk(name, 8.0, lambda _: COMMANDS[name][0], conditions=at_rate(RATES[name]), latency=period)
    ticks = found.ticks.sum(axis=1)
    middle, most = 1e3 * np.percentile(ticks, [50, 99])
    late = 100.0 * np.mean(ticks > period)
    return f"{name} at {RATES[name]:g} Hz: {middle:.2f} ms, p99 {most:.2f} ms, {late:.1f} % of {len(ticks)} ticks late"


def walked(name: str, command: tuple[float, float, float], conditions: Conditions) -> str:
    """Returns the row of a table for a walk."""
    found = walk(name, SECONDS, lambda _: command, conditions=conditions, latency=conditions.late)
    mean = found.velocity(SINCE)[[0, 1, 5]] if not found.fallen else np.full(3, np.nan)
    times = 1e3 * np.percentile(found.ticks.sum(axis=1), [50, 99])
    cells = [name, *(f"{number:g}" for number in command), *(f"{number:.3f}" for number in mean)]
    cells.append("falls" if found.fallen else "walks")
    return f"| {' | '.join([*cells, *(f'{time:.2f}' for time in times)])} |"


def main() -> None:
    """Prints tables of commands, of conditions and of pushes."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=list(COMMANDS), help="names of robots")
    names = parser.parse_args().robots
    heads = ["robot", "vx", "vy", "wz", "mean vx", "mean vy", "mean wz", "", "tick (ms)", "p99 (ms)"]
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}", flush=True)
    for name in names:
        for command in COMMANDS[name]:
            print(walked(name, command, NOMINAL), flush=True)
    for name in names:
        for conditions in CONDITIONS.get(name, []):
            print(walked(name, COMMANDS[name][0], conditions), conditions, flush=True)
    for name in [name for name in names if name in RATES]:
        print(at_highest_rate(name), flush=True)
    with ProcessPoolExecutor() as pool:
        for name in [name for name in names if name in LEAST]:
            for impulse in LEAST[name]:
                pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
                survived = sum(pool.map(survives, [name] * len(pushes), pushes))
                print(f"{name}: {survived} of {len(pushes)} pushes of {impulse:g} N s", flush=True)


if __name__ == "__main__":
    main()
