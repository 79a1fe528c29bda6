#!/usr/bin/env python3
"""Solves many variations of a problem: together in lanes, one by one, and by Crocoddyl.

    .venv/crocoddyl/bin/python benches/peers/batches.py [--cpu K] [--rounds N] [--problems V] [--limits] [NAME ...]

Each problem of `ocp_problems.py` is varied in its initial state. All solves start from the trajectory that the problem
names, on one core. Rounds alternate; a time is the median of all rounds. The last column shows in how many problems the
cost of `solve_many` equals the costs of the other two, up to 1e-6. The program needs the environment of `ocp.py`.

With --limits, the problems of `constrained_problems.py` are solved by InteriorPoint and AugmentedLagrangian, and
Crocoddyl is not needed. The last column then counts costs that are equal to the last bit.
"""

import argparse
import os
import time
from statistics import median

os.environ["OMP_NUM_THREADS"] = "1"  # set before Crocoddyl is loaded: on one core, threads would wait for each other

import constrained_problems
import numpy as np

import condyle
from condyle.optimal import AugmentedLagrangian, Fddp, InteriorPoint, Problem, solve_many

NOISE = 0.05
"""Standard deviation of the initial positions (rad, m) and velocities (rad/s, m/s)."""


def varied(problem, count):
    """Returns initial states whose joints and velocities differ from the problem's by normal noise."""
    x0s, rng = np.tile(problem.x0, (count, 1)), np.random.default_rng(0)
    base = 7 if problem.nx > problem.ndx else 0  # the pose of a floating base stays
    x0s[:, base:] += rng.normal(0.0, NOISE, (count, problem.nx - base))
    return x0s


def alternated(calls, rounds):
    """Returns the median of the durations of each call (s), and the results of the last round."""
    times, results = [[] for _ in calls], []
    for _ in range(rounds):
        results = []
        for call, taken in zip(calls, times, strict=True):
            begin = time.perf_counter()
            results.append(call())
            taken.append(time.perf_counter() - begin)
    return [median(taken) for taken in times], results


def one_after_the_other(solver, problem, x0s, start):
    """Returns the costs of single solves."""
    costs = []
    for x0 in x0s:
        problem.set_x0(x0)
        first = start[0].copy()
        first[0] = x0
        costs.append(solver.solve(first, start[1]).cost)
    return np.array(costs)


def limited_row(name, solver, count, rounds):
    """Returns the row of the table for a problem with limits."""
    spec = constrained_problems.PROBLEMS[name]()
    problem, start = Problem.from_json(spec.text), (spec.xs, spec.us)
    x0s, alone = varied(problem, count), solver(problem)
    calls = [
        lambda: solve_many(problem, x0s, start=start, solver=solver).cost,
        lambda: one_after_the_other(alone, problem, x0s, start),
    ]
    medians, costs = alternated(calls, rounds)
    rates = " | ".join(f"{count / seconds:.1f}" for seconds in medians)
    same = int((costs[0] == costs[1]).sum())
    return f"| {name}, {solver.__name__} | {rates} | | {medians[1] / medians[0]:.2f} | | {same} of {count} |"


def row(name, count, rounds):
    """Returns the row of the table for a problem."""
    from ocp_ours import Ours
    from ocp_problems import PROBLEMS
    from ocp_theirs import Theirs

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
        return one_after_the_other(alone, problem, x0s, start)

    def by_crocoddyl():
        costs = []
        for x0 in x0s:
            theirs.problem.x0 = x0
            theirs.run(solver, [x0, *xs[1:]], us)
            costs.append(solver.cost)
        return np.array(costs)

    medians, costs = alternated([together, one_by_one, by_crocoddyl], rounds)
    rates = " | ".join(f"{count / seconds:.0f}" for seconds in medians)
    same = [int(np.isclose(costs[0], other, rtol=1e-6).sum()) for other in costs[1:]]
    gains = f"{medians[1] / medians[0]:.2f} | {medians[2] / medians[0]:.1f}"
    return f"| {name} | {rates} | {gains} | {same[0]}, {same[1]} of {count} |"


def main():
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "names", nargs="*", help="names of problems (default: reach trot, with --limits reach cartpole)"
    )
    parser.add_argument("--limits", action="store_true", help="problems with limits")
    parser.add_argument("--cpu", type=int, default=0, help="index of the core")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--problems", type=int, default=256)
    options = parser.parse_args()
    os.sched_setaffinity(0, {options.cpu})
    print(f"{options.problems} problems, level {condyle.LEVEL}: solves per second on one core")
    print("| problem | together | one by one | Crocoddyl | over one by one | over Crocoddyl | equal costs |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    if options.limits:
        for name in options.names or constrained_problems.PROBLEMS:
            for solver in (InteriorPoint, AugmentedLagrangian):
                print(limited_row(name, solver, options.problems, options.rounds), flush=True)
        return
    for name in options.names or ["reach", "trot"]:
        print(row(name, options.problems, options.rounds), flush=True)


if __name__ == "__main__":
    main()
