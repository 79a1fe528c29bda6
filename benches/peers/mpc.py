#!/usr/bin/env python3
"""Measures the ticks of model predictive control with Condyle and with Crocoddyl 3.2, and compares their iterates.

    .venv/crocoddyl/bin/python benches/peers/mpc.py [OPTION ...] [go2] [g1]

`mpc_record.py` first records 200 ticks of a robot that walks in MuJoCo: a Go2 that trots (25 knots of 20 ms), and a G1
(40 knots). It runs in another environment, because MuJoCo and Crocoddyl are not in the same one. Then the ticks are
replayed on one core, as often as `--ticks` asks. A tick consists of the shift, the references, the initial state, the
solve, and the publication of the plan. All of them are called from Python. The rule `tick2` is `InteriorPoint.tick(2)`.
The rule `fddp1` is one iteration of `Fddp`, where all limits are costs. For this rule, Crocoddyl makes an iteration
from the same warm start with the same references. Only its `solve` is timed, not the change of its references.

The program compares states, controls and gains of both libraries after each tick. Errors are relative to 1 + the
largest number of the tick. They are as large as an error of Pinocchio: at a rotation of 0.001 rad in a knot, its
`Jexp6` is wrong by 1e-9 (at 0.0001 rad by 4e-7), and Condyle's Jacobian by 1e-16. The time of `policy(t, x)` is
measured while ticks are solved: another thread calls it at 1 kHz on another core.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # set before Crocoddyl is loaded: on one core, threads would wait for each other

import numpy as np
from mpc_ours import Ours, Times
from mpc_theirs import START, Theirs

from condyle.optimal import Record

HERE = Path(__file__).parent
RECORDER = HERE.parents[1] / ".venv" / "pinocchio" / "bin" / "python"
SAME = (1e-8, 1e-8, 1e-6)
"""Tolerances of the median errors of states, controls and gains. The gains have numbers of several hundred."""
LARGEST = 1e-6
"""Tolerance of all errors."""


def error(ours, theirs):
    """Returns the largest difference, relative to 1 + the largest number."""
    return float(np.abs(ours - theirs).max() / (1.0 + np.abs(theirs).max()))


def resumed(plan):
    """Returns the regularisation at which `resume` starts after a plan."""
    last = plan.trace[-1] if plan.trace else None
    return START if last is None or last.accepted else max(last.regularisation, START)


def compare(ours, theirs):
    """Makes all ticks in both libraries. Returns the errors of states, controls and gains, the warm starts with their
    regularisations, and the number of ticks whose step differs. The errors are medians and largest errors."""
    ours.begin()
    errors, starts, steps = [], [], 0
    for k in range(1, len(ours.ticks)):
        regularisation = resumed(ours.solver.solution)
        solve, arguments = ours.give(k)
        for name, given in ours.ticks[k][:-1]:
            getattr(theirs, name)(**given)
        start = ours.solver.solution
        xs, us = list(start.xs), list(start.us)
        plan = solve(**arguments)
        theirs.iterate(xs, us, regularisation)
        starts.append((xs, us, regularisation))
        steps += plan.trace[0].step != theirs.solver.stepLength
        both = [(plan.xs, theirs.solver.xs), (plan.us, theirs.solver.us), (plan.K, [-K for K in theirs.solver.K])]
        errors.append([error(a, np.array(list(b))) for a, b in both])
    return [np.median(errors, axis=0).tolist(), np.max(errors, axis=0).tolist()], starts, steps


def time_theirs(theirs, ours, starts):
    """Makes all ticks with Crocoddyl, from the warm starts of the comparison. Returns the durations of its solves."""
    durations = []
    for calls, (xs, us, regularisation) in zip(ours.ticks[1:], starts, strict=True):
        for name, given in calls[:-1]:
            getattr(theirs, name)(**given)
        durations.append(theirs.iterate(xs, us, regularisation))
    return durations


def agrees(result):
    """Returns whether the replay has the same bits, and the iterates of both libraries agree."""
    medians, largest = result.get("errors", [[0.0], [0.0]])
    near = all(error <= most for error, most in zip(medians, SAME, strict=False)) and max(largest) <= LARGEST
    return result["difference"] is None and near and not result.get("steps", 0)


def milliseconds(durations):
    """Returns the median and the 99th percentile (ms)."""
    return [round(1e3 * x, 4) for x in np.percentile(durations, [50, 99])]


def measure(robot, rule, folder, options):
    """Replays a record. Returns the errors and the times."""
    file = folder / f"{robot}_{rule}.json"
    if not file.exists():
        recorder = [str(options.recorder), str(HERE / "mpc_record.py"), robot, rule, str(file)]
        subprocess.run(recorder, check=True, stdout=sys.stderr)
    record = Record.load(file)
    clock = time.thread_time if options.busy else time.perf_counter
    ours, result = Ours(record, clock), {"robot": robot, "rule": rule, "difference": record.replay()}
    start = json.loads(record.start()[0].to_json())
    result |= {"knots": len(start["knot_models"]), "recorded": len(record)}
    rounds, times = max(1, round(options.ticks / (len(record) - 1))), []
    theirs, peer = None, []
    if rule == "fddp1":
        urdf = file.with_suffix(".urdf").read_text(encoding="utf-8")
        theirs = Theirs(start, urdf, clock)
        result["errors"], starts, result["steps"] = compare(ours, theirs)
    for k in range(rounds if options.ticks else 0):
        times += ours.run()
        if theirs is not None and k < max(1, rounds // 5):
            peer += time_theirs(Theirs(start, urdf, clock), ours, starts)
    if times:
        parts = np.array(times)
        result["ticks"] = len(times)
        result["ms"] = {name: milliseconds(parts[:, i]) for i, name in enumerate(Times._fields)}
        result["ms"]["total"] = milliseconds(parts.sum(axis=1))
    if peer:
        result["theirs_ms"] = milliseconds(peer)
        result["ratio"] = round(result["ms"]["total"][0] / result["theirs_ms"][0], 4)
        result["solve_ratio"] = round(result["ms"]["after"][0] / result["theirs_ms"][0], 4)
    if rule == "tick2" and options.ticks:
        others = os.sched_getaffinity(0) if options.cpu is None else set(range(os.cpu_count() or 1)) - {options.cpu}
        calls = ours.call_policy(options.seconds, min(others, default=None))
        result["policy_us"] = [round(1e6 * x, 2) for x in np.percentile(calls, [50, 99])]
        result["policy_calls"] = len(calls)
    return result


def line(result):
    """Returns a result as a line of text."""
    text = f"{result['robot']} {result['rule']}: "
    text += "same bits" if result["difference"] is None else f"DIFFERENT {result['difference']}"
    if "errors" in result:
        medians, largest = result["errors"]
        verdict = "same" if agrees(result) else "DIFFERENT"
        text += ", iterates {}: median xs {:.1e}, us {:.1e}, K {:.1e}".format(verdict, *medians)
        text += ", largest {:.1e}, {:.1e}, {:.1e}".format(*largest)
    if "ms" in result:
        cells = (f"{name} {median:.3f} (p99 {p99:.3f})" for name, (median, p99) in result["ms"].items() if p99 > 0.001)
        text += f"; ms of {result['ticks']} ticks: " + ", ".join(cells)
    if "theirs_ms" in result:
        text += ", Crocoddyl {:.3f} (p99 {:.3f})".format(*result["theirs_ms"])
        text += f", ratio {result['ratio']:.3f} (solve {result['solve_ratio']:.3f})"
    if "policy_us" in result:
        text += "; µs of a policy's call: {:.1f} (p99 {:.1f})".format(*result["policy_us"])
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--ticks", type=int, default=10_000, help="number of timed ticks; 0 for none")
    parser.add_argument("--seconds", type=float, default=10.0, help="duration of the calls of a policy (s)")
    parser.add_argument("--rule", choices=["tick2", "fddp1"], help="one rule of a tick; both unless given")
    parser.add_argument(
        "--busy", action="store_true", help="count only the time of this thread, if others use the core"
    )
    parser.add_argument("--records", type=Path, help="a folder for the records, which are kept and used again")
    parser.add_argument("--recorder", type=Path, default=RECORDER, help="the interpreter that has MuJoCo")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each result")
    parser.add_argument("--cpu", type=int, help="the core to run on")
    parser.add_argument("robots", nargs="*")
    options = parser.parse_args()
    if options.cpu is not None:
        os.sched_setaffinity(0, {options.cpu})
    good = True
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.records or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for robot in options.robots or ["go2", "g1"]:
            for rule in [options.rule] if options.rule else ["tick2", "fddp1"]:
                result = measure(robot, rule, folder, options)
                good &= agrees(result)
                print(json.dumps(result) if options.json else line(result), flush=True)
    sys.exit(not good)


if __name__ == "__main__":
    main()
