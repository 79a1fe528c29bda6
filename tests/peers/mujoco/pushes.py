#!/usr/bin/env python3
"""Prints how many pushes a trotting quadruped survives in MuJoCo, with each rule for a tick of its controller.

    .venv/pinocchio/bin/python tests/peers/mujoco/pushes.py [--impulses 12,16,20,24,28] [--solver tick2]

The robot trots at 0.5 m/s. A horizontal force of 0.1 s pushes its trunk in 8 directions, at 2 times of the gait. The
robot survives a push if it does not fall within 1.5 s. Speed, ripple and times belong to a run without a push.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import NamedTuple, get_args

import numpy as np
from scenes import urdf
from trotting import DT, Solver, Trot
from world import Array, World

import condyle


class Robot(NamedTuple):
    """Quadruped of example-robot-data."""

    feet: Sequence[str]
    """Frames of the feet: front left, front right, rear left, rear right."""
    radius: float
    """Radius of the feet (m)."""
    leg: Sequence[float]
    """Angles of a leg's joints in the stand (rad)."""


ROBOTS = {
    name: Robot(("FL_foot", "FR_foot", "RL_foot", "RR_foot"), 0.022, (0.0, 0.85, -1.6)) for name in ("go2", "go1", "a1")
}
SPEED, GAIN = 0.5, 1.0
"""Commanded speed (m/s), and the acceleration until it is reached (m/s²)."""
BEGIN, PUSH_TIME, SURVIVED = (2.0, 2.1), 0.1, 1.5
"""Times at which a push begins, the duration of a push, and the time without a fall after the push (s)."""
ANGLES = range(0, 360, 45)
"""Directions of pushes (degrees): 0 is ahead, 90 is to the left."""
STEADY, END = 1.5, 5.0
"""Times between which a run without a push is evaluated (s)."""
LEAN, LOW = 0.8, 0.55
"""A fall: the trunk leans by more than this angle (rad), or is below this fraction of its height."""


class Push(NamedTuple):
    """Push of the trunk."""

    impulse: float
    """Impulse (N s)."""
    angle: float
    """Direction (degrees)."""
    begin: float
    """Time at which the push begins (s)."""


class Run(NamedTuple):
    """Run of the closed loop."""

    fallen: bool
    velocities: Array
    """Velocities of the trunk in each ms after the time `STEADY` (samples, 6)."""
    ticks: Array
    """Durations of the ticks (s)."""


def standing(model: condyle.Model, robot: Robot) -> Array:
    """Returns the posture in which the robot stands, with the feet at height 0."""
    q, data = condyle.neutral(model), condyle.Data(model)
    q[7:] = [*robot.leg] * 4
    q[2] -= min(condyle.frame_placement(model, data, q, foot)[2, 3] for foot in robot.feet)
    return q


def run(name: str, solver: Solver, seconds: float, push: Push | None = None) -> Run:
    """Simulates a robot that starts from a stand and trots, until it falls or the time is over."""
    robot = ROBOTS[name]
    world = World(urdf(name), robot.feet, robot.radius)
    q = standing(world.model, robot)
    world.set_state(q, np.zeros(world.model.nv))
    control = Trot(world.model, q, robot.feet, solver)
    control.start(np.concatenate(world.state()))
    period, velocities, fallen = round(DT / world.dt), [], False
    for i in range(round(seconds / world.dt)):
        t = i * world.dt
        x = np.concatenate(world.state())
        fallen = 1.0 - 2.0 * (x[3] ** 2 + x[4] ** 2) < np.cos(LEAN) or x[2] < LOW * q[2]
        if fallen or not np.isfinite(x).all():
            fallen = True
            break
        if i % period == 0 and i > 0:
            control.command[0] = np.clip(GAIN * (t - 0.3), 0.0, SPEED)
            control.tick(x, t)
        force = np.zeros(3)
        if push is not None and push.begin <= t < push.begin + PUSH_TIME:
            angle = np.radians(push.angle)
            force = push.impulse / PUSH_TIME * np.array([np.cos(angle), np.sin(angle), 0.0])
        world.step(control.efforts(t, x), force)
        if t > STEADY:
            velocities.append(x[world.model.nq :][:6])
    return Run(fallen, np.array(velocities), np.array(control.seconds))


def survives(name: str, solver: Solver, push: Push) -> bool:
    """Returns whether the robot survives a push."""
    return not run(name, solver, push.begin + PUSH_TIME + SURVIVED, push).fallen


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=list(ROBOTS), default="go2")
    parser.add_argument("--impulses", default="12,16,20,24,28", help="N s, separated by commas")
    parser.add_argument("--solver", choices=get_args(Solver), action="append")
    arguments = parser.parse_args()
    impulses = [float(text) for text in arguments.impulses.split(",")]
    heads = [
        "",
        *(f"{impulse:g} N s" for impulse in impulses),
        "speed (m/s)",
        "ripple (rad/s)",
        "tick (ms)",
        "p99 (ms)",
    ]
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}", flush=True)
    for solver in arguments.solver or get_args(Solver):
        calm = run(arguments.robot, solver, END)
        cells = [solver]
        with ProcessPoolExecutor() as pool:
            for impulse in impulses:
                pushes = [Push(impulse, angle, begin) for begin, angle in product(BEGIN, ANGLES)]
                same = [[value] * len(pushes) for value in (arguments.robot, solver)]
                cells.append(f"{sum(pool.map(survives, *same, pushes))} of {len(pushes)}")
        times = 1e3 * np.percentile(calm.ticks, [50, 99])
        figures = [calm.velocities[:, 0].mean(), calm.velocities[:, 4].std(), *times]
        cells += ["falls"] * 4 if calm.fallen else [f"{figure:.3f}" for figure in figures]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
