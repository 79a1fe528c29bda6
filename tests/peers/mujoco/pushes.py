#!/usr/bin/env python3
"""Prints how many pushes a walking robot survives in MuJoCo, with each rule for a tick of its controller.

    .venv/pinocchio/bin/python tests/peers/mujoco/pushes.py [--robot g1] [--impulses 12,16] [--solver tick2]

A quadruped trots at 0.5 m/s, or a humanoid walks at 0.3 m/s. A horizontal force of 0.1 s pushes its trunk in 8
directions, at 2 times of the gait. The robot survives a push if it does not fall within 1.5 s. Speed, ripple of the
pitch rate and times belong to a run without a push.
"""

import argparse
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from typing import NamedTuple, get_args

import numpy as np
from predictive import RATE, Gait, Joint, Predictive, Robot, Solver
from scenes import urdf
from world import Array, World

import condyle

QUADRUPED = Robot(
    feet=("FL_foot", "FR_foot", "RL_foot", "RR_foot"),
    size=0.022,
    joints={"hip": Joint(0.0, 10.0, 0.02), "thigh": Joint(0.85, 2.0, 0.02), "calf": Joint(-1.6, 2.0, 0.02)},
    gait=Gait(groups=((0, 3), (1, 2)), stand=0.2, swing=0.24, both=0.04),
    knots=25,
    speed=0.5,
    acceleration=1.0,
    sideways=100.0,
    effort=2e-3,
    impulses=(12.0, 16.0, 20.0, 24.0, 28.0),
)
HUMANOID = Robot(
    feet=("left_sole", "right_sole"),
    size=(0.17, 0.055),
    joints={
        "hip_pitch": Joint(-0.35, 2.0, 0.02),
        "hip": Joint(0.0, 5.0, 0.02),
        "knee": Joint(0.7, 0.5, 0.02),
        "ankle_pitch": Joint(-0.35, 0.5, 0.02),
        "ankle": Joint(0.0, 0.5, 0.02),
        "waist": Joint(0.0, 100.0, 0.5),
        "left_shoulder_roll": Joint(0.2, 10.0, 0.2),
        "right_shoulder_roll": Joint(-0.2, 10.0, 0.2),
        "shoulder_pitch": Joint(0.2, 10.0, 0.2),
        "elbow": Joint(0.6, 10.0, 0.2),
        "": Joint(0.0, 10.0, 0.2),
    },
    gait=Gait(groups=((0,), (1,)), stand=0.5, swing=0.36, both=0.08),
    knots=40,
    speed=0.3,
    acceleration=0.3,
    sideways=30.0,
    effort=1e-3,
    impulses=(3.0, 6.0, 9.0, 12.0, 18.0),
)
ROBOTS = {"go2": QUADRUPED, "go1": QUADRUPED, "a1": QUADRUPED, "g1": HUMANOID}
SOLE = (0.035, 0.0, -0.035)
"""Middle of the sole in the frame of the G1's ankle (m)."""
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


def text_of(name: str) -> str:
    """Returns the URDF of a robot. The G1 gets frames in the middle of its soles."""
    text, added = urdf(name), ""
    for side in ("left", "right") if name == "g1" else ():
        origin = f'<origin xyz="{SOLE[0]} {SOLE[1]} {SOLE[2]}"/>'
        ends = f'<parent link="{side}_ankle_roll_link"/><child link="{side}_sole"/>'
        added += f'<link name="{side}_sole"/><joint name="{side}_sole" type="fixed">{ends}{origin}</joint>'
    return text.replace("</robot>", f"{added}</robot>")


def run(
    name: str,
    solver: Solver,
    seconds: float,
    push: Push | None = None,
    rate: float | None = None,
    gait: Gait | None = None,
    make: Callable[[condyle.Model, Robot, Solver, float | None], Predictive] = Predictive,
) -> Run:
    """Simulates a robot that starts from a stand and walks, until it falls or the time is over.

    rate: rate of the ticks (Hz); with None, a tick for each knot.
    gait: gait of the robot; with None, its own.
    make: function that makes the controller.
    """
    robot = ROBOTS[name] if gait is None else ROBOTS[name]._replace(gait=gait)
    world = World(text_of(name), robot.feet, robot.size)
    q = robot.standing(world.model)
    world.set_state(q, np.zeros(world.model.nv))
    control = make(world.model, robot, solver, rate)
    control.start(np.concatenate(world.state()))
    velocities, fallen, ticks, rate = [], False, 0, rate or RATE
    for i in range(round(seconds / world.dt)):
        t = i * world.dt
        x = np.concatenate(world.state())
        fallen = 1.0 - 2.0 * (x[3] ** 2 + x[4] ** 2) < np.cos(LEAN) or x[2] < LOW * q[2]
        if fallen or not np.isfinite(x).all():
            fallen = True
            break
        if int(t * rate + 1e-6) > ticks:
            ticks = int(t * rate + 1e-6)
            control.command[0] = np.clip(robot.acceleration * (t - robot.gait.stand - 0.1), 0.0, robot.speed)
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
    parser.add_argument("--impulses", help="N s, separated by commas")
    parser.add_argument("--solver", choices=get_args(Solver), action="append")
    arguments = parser.parse_args()
    impulses: Sequence[float] = ROBOTS[arguments.robot].impulses
    if arguments.impulses is not None:
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
