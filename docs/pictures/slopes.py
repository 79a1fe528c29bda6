#!/usr/bin/env python3
"""Makes docs/pictures/slopes.png: the time of algorithms over the number of joints, and the times of three methods of
forward dynamics.

.venv/pinocchio/bin/python docs/pictures/slopes.py [FILE.json] [--quick]

Prints the numbers of the picture and writes them to FILE.json. Takes about a minute on an idle core.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import condyle

SIZES = (4, 8, 16, 32, 64, 128, 256)
STATES = 8
"""Number of states of a batch: one vector of eight lanes, or two vectors of four lanes."""
METHODS = {"aba": "ABA", "dense": "M, dense factor", "sparse": "M, sparse factor"}


def chain(n: int) -> condyle.Model:
    """Returns the model of a chain of n hinges. The axes of successive hinges differ."""
    rng, builder, body = np.random.default_rng(7), condyle.ModelBuilder("chain"), condyle.WORLD
    for i in range(n):
        place = np.eye(4)
        place[:3, 3] = [*rng.uniform(-0.1, 0.1, 2), 0.2]
        link = condyle.Inertia.from_com(1.0, rng.uniform(-0.1, 0.1, 3), 0.01 * np.eye(3))
        body = builder.body(f"b{i}", body, condyle.Joint.revolute(np.eye(3)[i % 3]), place, link)
    return builder.build()


def least(call: Callable[[], object], seconds: float) -> float:
    """Calls a function for a number of seconds, at least 20 times, and returns the shortest time of a call (s)."""
    times: list[float] = []
    end = time.perf_counter() + seconds
    while len(times) < 20 or time.perf_counter() < end:
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def calls_of(model: condyle.Model) -> dict[str, Callable[[], object]]:
    """Returns, for each algorithm, a function that calls it on a batch of states."""
    n, data = model.nv, condyle.Data(model)
    q, v, a = np.random.default_rng(1).uniform(-1, 1, (3, STATES, n))
    M, x = np.zeros((STATES, n, n)), np.zeros((STATES, n))
    return {
        "rnea": lambda: condyle.rnea(model, data, q, v, a, out=x),
        "aba": lambda: condyle.aba(model, data, q, v, a, out=x),
        "crba": lambda: condyle.crba(model, data, q, out=M),
        "minv": lambda: condyle.minv(model, data, q, out=M),
    }


def growth(seconds: float) -> dict[str, dict[str, Any]]:
    """Returns the time per state of a batch at each size (µs), and the slope of log time over log size for the upper
    half of the sizes."""
    times: dict[str, list[float]] = {}
    for n in SIZES:
        for name, call in calls_of(chain(n)).items():
            times.setdefault(name, []).append(1e6 * least(call, seconds) / STATES)
    upper = slice(len(SIZES) // 2, None)
    slopes = {name: np.polyfit(np.log(SIZES[upper]), np.log(t[upper]), 1)[0] for name, t in times.items()}
    return {name: {"us": t, "slope": float(slopes[name])} for name, t in times.items()}


def spread(model: condyle.Model, calls: int) -> dict[str, dict[str, Any]]:
    """Returns mean, standard deviation, median and 95th percentile (µs) of single calls at random states.

    The methods are called alternately. Two groups of calls are left out: the first tenth, and the slowest thousandth,
    which the operating system has interrupted.
    """
    rng, data, out = np.random.default_rng(2), condyle.Data(model), np.zeros(model.nv)
    q = [condyle.random_configuration(model, seed=k) for k in range(256)]
    v, tau = rng.standard_normal((2, 256, model.nv))
    times: dict[str, list[float]] = {method: [] for method in METHODS}
    for k in range(calls):
        state = q[k % 256], v[k % 256], tau[k % 256]
        for method, found in times.items():
            begin = time.perf_counter_ns()
            condyle.forward_dynamics(model, data, *state, method=method, out=out)
            found.append((time.perf_counter_ns() - begin) / 1e3)
    report: dict[str, dict[str, Any]] = {}
    for method, all_times in times.items():
        t = np.array(all_times)[calls // 10 :]
        t = t[t <= np.quantile(t, 0.999)]
        figures = {"mean": t.mean(), "sigma": t.std(), "median": np.median(t), "p95": np.quantile(t, 0.95)}
        report[method] = {name: round(float(x), 3) for name, x in figures.items()} | {"times": t}
    return report


def draw(slopes: dict[str, dict[str, Any]], spreads: dict[str, dict[str, dict[str, Any]]], path: Path) -> None:
    figure, axes = plt.subplots(1, 1 + len(spreads), figsize=(4.2 * (1 + len(spreads)), 3.8), layout="constrained")
    for name, of in slopes.items():
        axes[0].loglog(SIZES, of["us"], "o-", label=f"{name}, slope {of['slope']:.2f}")
    axes[0].set(xlabel="joints of a chain", ylabel="µs for a state of a batch", title="Growth")
    axes[0].legend(fontsize=8)
    for axis, (robot, methods) in zip(axes[1:], spreads.items(), strict=True):
        top = max(of["p95"] for of in methods.values()) * 1.5
        for method, of in methods.items():
            label = f"{METHODS[method]}: {of['mean']:.2f} ± {of['sigma']:.2f}, p95 {of['p95']:.2f}"
            axis.hist(of["times"], bins=120, range=(0.0, top), histtype="step", label=label)
        axis.set(xlabel="µs of a call", title=f"Forward dynamics, {robot}", yticks=[])
        axis.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("file", nargs="?", type=Path, help="JSON file for the numbers")
    parser.add_argument("--quick", action="store_true", help="few calls, for tests")
    parser.add_argument("--picture", type=Path, default=Path(__file__).with_name("slopes.png"))
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    slopes = growth(0.01 if wanted.quick else 0.5)
    robots = {"arm of 7": condyle.robots.arm7(), "humanoid of 38": condyle.robots.humanoid()}
    spreads = {name: spread(model, 200 if wanted.quick else 20_000) for name, model in robots.items()}
    draw(slopes, spreads, wanted.picture)
    for of in (of for methods in spreads.values() for of in methods.values()):
        del of["times"]
    text = json.dumps({"sizes": SIZES, "growth": slopes, "forward_dynamics": spreads}, indent=1) + "\n"
    print(text, end="")
    if wanted.file:
        wanted.file.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
