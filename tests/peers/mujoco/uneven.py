#!/usr/bin/env python3
"""Prints how a walking robot meets ground of unknown height in MuJoCo, with each rule for its landings.

    .venv/pinocchio/bin/python tests/peers/mujoco/uneven.py [--robot g1] [--landing touch] [--seeds 8]

The controller plans as if the ground were level. The ground below each foot changes its height while the foot swings:
once, as a step that all later footholds share, or for each foothold anew, uniformly between two bounds. The rows `mpc`
and `mpc_touch` are walks under `condyle.mpc.WholeBodyMpc`.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Literal, NamedTuple, get_args

import numpy as np
from predictive import DT, LOADED, Landing, Predictive
from pushes import LEAN, LOW, ROBOTS, text_of
from walking import WALKERS
from world import World

from condyle.mpc import WholeBodyMpc

Pattern = Literal["step", "random"]
"""Ground: a step of a height, or footholds at random heights up to it."""
CASES: dict[str, list[tuple[Pattern, float]]] = {
    "go2": [("step", 0.02), ("step", -0.02), ("random", 0.02), ("random", 0.04)],
    "g1": [("step", 0.02), ("step", -0.02), ("random", 0.02), ("random", 0.03)],
}
"""Grounds of each robot, with heights (m)."""
BEGIN, SECONDS = 1.5, 5.0
"""Time after which the ground changes, and duration of a run (s)."""
Rule = Literal["mpc", "mpc_touch"]
"""Use of `condyle.mpc.WholeBodyMpc`: without reports of contacts, or with a report before each update."""
RAISED = 0.1
"""Time after the beginning of a swing at which the ground below the foot changes under `WholeBodyMpc` (s)."""
HIGH = 0.4
"""Fraction of a swing at which the ground below the foot changes; the foot is then far above it."""


class Walk(NamedTuple):
    """Result of a walk."""

    fallen: bool
    ripple: float
    """Standard deviation of the trunk's pitch rate on the changed ground (rad/s)."""
    force: float
    """Largest vertical force on a foot (N)."""


def walk(name: str, landing: Landing, pattern: Pattern, height: float, seed: int) -> Walk:
    """Simulates a walk over ground of unknown height, until the robot falls or the time is over."""
    robot, rng = ROBOTS[name], np.random.default_rng(seed)
    world = World(text_of(name), robot.feet, robot.size)
    q, nq = robot.standing(world.model), world.model.nq
    world.set_state(q, np.zeros(world.model.nv))
    control = Predictive(world.model, robot, "tick2", landing=landing)
    control.start(np.concatenate(world.state()))
    gait, period, begin = robot.gait, round(DT / world.dt), BEGIN + rng.uniform(0.0, robot.gait.step)
    changed, rates, force, fallen = -1, [], 0.0, False
    for i in range(round(SECONDS / world.dt)):
        t, x, loads = i * world.dt, np.concatenate(world.state()), world.loads()[:, 2]
        upright = 1.0 - 2.0 * (x[3] ** 2 + x[4] ** 2)
        if not np.isfinite(x).all() or upright < np.cos(LEAN) or x[2] < LOW * q[2]:
            fallen = True
            break
        group, done = gait.swinging(t)
        swing = int((t - gait.stand) / gait.step)
        if group is not None and done > HIGH and t > begin and swing > changed:
            changed = swing
            for k in gait.groups[group]:
                world.set_ground(robot.feet[k], height if pattern == "step" else rng.uniform(-height, height))
        if i % period == 0 and i > 0:
            control.command[0] = np.clip(robot.acceleration * (t - gait.stand - 0.1), 0.0, robot.speed)
            control.tick(x, t, loads)
        world.step(control.efforts(t, x))
        if t > begin:
            rates.append(x[nq + 4])
            force = max(force, loads.max())
    return Walk(fallen, float(np.std(rates)) if rates else np.nan, force)


def library_walk(name: str, rule: Rule, pattern: Pattern, height: float, seed: int) -> Walk:
    """Simulates a walk under `condyle.mpc.WholeBodyMpc` over ground of unknown height, as `walk` does."""
    walker, rng = WALKERS[name], np.random.default_rng(seed)
    world = World(text_of(name), walker.feet, walker.size)
    q, nq = walker.stand(world.model), world.model.nq
    world.set_state(q, np.zeros(world.model.nv))
    mpc = WholeBodyMpc(world.model, walker.foot_list(), walker.gait, **walker.settings())
    mpc.reset(np.concatenate(world.state()))
    policy, period, begin = mpc.policy(), round(DT / world.dt), BEGIN + rng.uniform(0.0, 0.5)
    least, speed = LOADED * 9.81 * world.model.total_mass, ROBOTS[name].speed
    swings, changed = np.zeros(len(walker.feet)), np.zeros(len(walker.feet), bool)
    rates, force, fallen = [], 0.0, False
    for i in range(round(SECONDS / world.dt)):
        t, x, loads = i * world.dt, np.concatenate(world.state()), world.loads()[:, 2]
        if not np.isfinite(x).all() or 1.0 - 2.0 * (x[3] ** 2 + x[4] ** 2) < np.cos(LEAN) or x[2] < LOW * q[2]:
            fallen = True
            break
        if i % period == 0 and i > 0:
            mpc.command(vx=speed)
            if rule == "mpc_touch":
                mpc.touch(loads > least)
            mpc.update(t, x)
        stands = np.array(mpc.report.stands)
        swings = np.where(stands, 0.0, swings + world.dt)
        changed &= ~stands
        for k in np.flatnonzero((swings > RAISED) & ~changed):
            changed[k] = True
            if t > begin:
                world.set_ground(walker.feet[k], height if pattern == "step" else rng.uniform(-height, height))
        world.step(np.r_[np.zeros(6), policy(t, x)])
        if t > begin:
            rates.append(x[nq + 4])
            force = max(force, loads.max())
    return Walk(fallen, float(np.std(rates)) if rates else np.nan, force)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", choices=list(ROBOTS), default="g1")
    parser.add_argument("--landing", choices=[*get_args(Landing), *get_args(Rule)], action="append")
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    cases = CASES[arguments.robot if arguments.robot in CASES else "go2"]
    heads = [
        "",
        *(
            f"{pattern} {1e3 * height:+g} mm" if pattern == "step" else f"±{1e3 * height:g} mm"
            for pattern, height in cases
        ),
    ]
    print(f"| {' | '.join(heads)} |\n|{' --- |' * len(heads)}", flush=True)
    for landing in arguments.landing or [*get_args(Landing), *get_args(Rule)]:
        cells = [landing]
        with ProcessPoolExecutor() as pool:
            for case in cases:
                seeds: Sequence[int] = range(arguments.seeds)
                same = [[value] * len(seeds) for value in (arguments.robot, landing, *case)]
                simulate = library_walk if landing in get_args(Rule) else walk
                walks = list(pool.map(simulate, *same, seeds))
                survived = [result for result in walks if not result.fallen]
                ripple, force = (np.median([result[k] for result in survived or walks]) for k in (1, 2))
                cells.append(f"{len(survived)} of {len(walks)}; {ripple:.3f} rad/s; {force:.0f} N")
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
