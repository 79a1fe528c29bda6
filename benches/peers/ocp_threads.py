#!/usr/bin/env python3
"""Times an iteration of FDDP on one thread and on several threads.

    .venv/crocoddyl/bin/python benches/peers/ocp_threads.py [--json] [--threads 2] [--rounds 15] [NAME ...]

The program times three modes in turn, round after round, on the problems of `ocp_problems.py`. The first mode uses one
thread. In the second mode, several threads run the backward sweep at the same time as the derivatives. In the third
mode, the sweep is divided into segments, one per thread. Times are medians over the rounds, in milliseconds per
iteration. Brackets contain the medians of the quotients of the time and the time with one thread. Segments change the
iterates only by rounding errors. The iterations of each mode are counted separately. The program needs as many cores as
threads.
"""

import argparse
import json
import statistics

import numpy as np
from ocp_ours import Ours
from ocp_problems import PROBLEMS

from condyle import optimal

PHASES = ("total", "derivatives", "sweep", "rollout")


def ways(threads):
    yield "one thread", {}
    yield f"{threads} threads", {"threads": threads}
    yield f"{threads} segments", {"threads": threads, "segments": threads}


def solver(spec, robot, settings):
    """Returns the solver of a problem with the problem's settings, and an initial guess: the robot at rest, with
    quasi-static controls."""
    ours = Ours(spec, robot, "fddp")
    problem = ours.made(robot, "fddp")
    ours.solver = optimal.Fddp(problem, **ours.settings("fddp"), **settings)
    xs = np.tile(spec["x0"], (len(spec["stages"]) + 1, 1))
    return ours, xs, problem.quasi_static(xs)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print a record a line")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("names", nargs="*", default=["reach", "trot", "walk", "humanoid"])
    options = parser.parse_args()
    if not options.json:
        print("ms in an iteration (of one thread's)")
    for name in options.names:
        spec, robot = PROBLEMS[name]()
        named = list(ways(options.threads))
        solvers = [solver(spec, robot, settings) for _, settings in named]
        times = []
        for _ in range(options.rounds):
            row = []
            for ours, *start in solvers:
                ours.solve(*start)
                solved = ours.solve(*start)
                row.append({phase: 1e3 * solved.phases[phase] / len(solved.rows) for phase in PHASES})
            times.append(row)
        for i, (way, _) in enumerate(named):
            figures, record = [], {"name": name, "way": way}
            for phase in PHASES:
                ms = statistics.median(row[i][phase] for row in times)
                share = statistics.median(row[i][phase] / row[0][phase] for row in times)
                figures.append(f"{phase} {ms:.3f} ({share:.2f})")
                record[phase] = {"ms": ms, "ratio": share}
            if options.json:
                print(json.dumps(record), flush=True)
                continue
            print(f"{name:9} {way:20} {'  '.join(figures)}", flush=True)


if __name__ == "__main__":
    main()
