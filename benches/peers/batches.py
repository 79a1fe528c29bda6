#!/usr/bin/env python3
"""Solves many variations of a problem: together in lanes, one by one, and by Crocoddyl.

    .venv/crocoddyl/bin/python benches/peers/batches.py [--cpu K] [--rounds N] [--problems V] [NAME ...]

Each problem of `ocp_problems.py` is varied in its initial state. All solves start from the trajectory that the problem
names, on one core. Rounds alternate; a time is the median of all rounds. The last column shows in how many problems the
cost of `solve_many` equals the costs of the other two, up to 1e-6. The program needs the environment of `ocp.py`.
"""

import argparse
import os
import time
from statistics import median

os.environ["OMP_NUM_THREADS"] = "1"  # set before Crocoddyl is loaded: on one core, threads would wait for each other

import numpy as np
from ocp_ours import Ours
from ocp_problems import PROBLEMS
from ocp_theirs import Theirs

import condyle
from condyle.optimal import Fddp, solve_many

NOISE = 0.05
"""Standard deviation of the initial positions (rad, m) and velocities (rad/s, m/s)."""


def varied(problem, count):
    """Returns initial states whose joints and velocities differ from the problem's by normal noise."""
    x0s, rng = np.tile(problem.x0, (count, 1)), np.random.default_rng(0)
    base = 7 if problem.nx > problem.ndx else 0  # the pose of a floating base stays
    x0s[:, base:] += rng.normal(0.0, NOISE, (count, problem.nx - base))
    return x0s


def row(name, count, rounds):
    """Returns the row of the table for a problem."""
    spec, robot = PROBLEMS[name]()
    ours, theirs = Ours(spec, robot, "fddp"), Theirs(spec, robot, "fddp")
    problem, settings = ours.made(robot, "fddp"), ours.settings("fddp")
    alone = Fddp(problem, **settings)
    xs, us = theirs.warm_start()
    start = np.array(xs), np.array(us) if len({len(u) for u in us}) == 1 else us
    x0s, solver = varied(problem, count), theirs.solver()

    def together():
        return solve_many(problem, x0s, start=start, settings=settings).cost

    def one_by_one():
        costs = []
        for x0 in x0s:
            problem.set_x0(x0)
            first = start[0].copy()
            first[0] = x0
            costs.append(alone.solve(first, start[1]).cost)
        return np.array(costs)

    def by_crocoddyl():
        costs = []
        for x0 in x0s:
            theirs.problem.x0 = x0
            theirs.run(solver, [x0, *xs[1:]], us)
            costs.append(solver.cost)
        return np.array(costs)

    calls = [together, one_by_one, by_crocoddyl]
    times, costs = [[] for _ in calls], []
    for _ in range(rounds):
        costs = []
        for call, taken in zip(calls, times, strict=True):
            begin = time.perf_counter()
            costs.append(call())
            taken.append(time.perf_counter() - begin)
    medians = [median(taken) for taken in times]
    rates = " | ".join(f"{count / seconds:.0f}" for seconds in medians)
    same = [int(np.isclose(costs[0], other, rtol=1e-6).sum()) for other in costs[1:]]
    gains = f"{medians[1] / medians[0]:.2f} | {medians[2] / medians[0]:.1f}"
    return f"| {name} | {rates} | {gains} | {same[0]}, {same[1]} of {count} |"


def main():
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=["reach", "trot"], help="names of problems (default: reach trot)")
    parser.add_argument("--cpu", type=int, default=0, help="index of the core")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--problems", type=int, default=256)
    options = parser.parse_args()
    os.sched_setaffinity(0, {options.cpu})
    print(f"{options.problems} problems, level {condyle.LEVEL}: solves per second on one core")
    print("| problem | together | one by one | Crocoddyl | over one by one | over Crocoddyl | equal costs |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in options.names:
        print(row(name, options.problems, options.rounds), flush=True)


if __name__ == "__main__":
    main()
