#!/usr/bin/env python3
"""Times the Python package. Compares it with Pinocchio's binding and with Condyle's own library.

    .venv/pinocchio/bin/python benches/peers/python.py [--rounds N] [--cpu K] [--json] [--no-rust] [ROBOT ...]

Without robots, the program takes panda and talos. It needs the packages of tests/peers/pinocchio/requirements.txt and a
release build of condyle (`./test` makes both). Without the option `--no-rust`, it also needs Rust, to build
benches/peers/ours.rs. Everything runs on one core, in turn. A time is the least of all rounds, because other work on
the machine only adds time. The output has five tables:

- single calls: Condyle's time of a call, Pinocchio's time, and the quotient;
- Pinocchio's spelling: the time of a call through `condyle.pinocchio`, of the same call of `condyle`, and the quotient;
- attributes of a model: the time of an access;
- batches of 1000 states, `out` reused: the time per state, the time of a loop of Pinocchio's calls, and a lower limit
  for a batch. The limit is the time of the library's own batch of the same size, plus 1.3 times the time to write the
  results once. The time to write is measured by filling the results with a number. The library's batch stores matrices
  interleaved: one entry of several states, then the next entry. NumPy needs whole matrices, state after state, so the
  Python package must transpose the matrices. The last column is the time to copy one matrix from the cache to all
  states. For panda, this time is 1.7 times the filling time. If the matrices of a batch were only copied, the batch
  would take 1.03 of the limit; the transposition takes additional time;
- overall: the time of `import` minus NumPy's, and the time of a solve by FDDP minus the time that the solver itself
  measures.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import pinocchio as pin
from dynamics import ROBOTS, build_ours, run, times
from example_robot_data.robots_loader import ROBOTS as LOADERS
from example_robot_data.robots_loader import getModelPath

import condyle
import condyle.pinocchio as spelling
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual

STATES = 1000
SECONDS = 0.002  # duration of each round of a call, shorter than the time slices of a shared core
WRITES = 1.3  # factor on the time to write the results; see the documentation of this file
Call = Callable[[], object]


def least(calls: list[Call], rounds: int, seconds: float = SECONDS) -> list[float]:
    """Returns the least time of each call (µs) over rounds in which the calls take turns."""
    repeats = []
    for call in calls:
        call()
        begin = time.perf_counter()
        call()
        repeats.append(max(1, round(seconds / (time.perf_counter() - begin))))
    found = [np.inf] * len(calls)
    for _ in range(rounds):
        for k, (call, n) in enumerate(zip(calls, repeats, strict=True)):
            begin = time.perf_counter()
            for _ in range(n):
                call()
            found[k] = min(found[k], (time.perf_counter() - begin) / n * 1e6)
    return found


class Robot:
    """Robot as a model of both libraries, with random states."""

    def __init__(self, name: str) -> None:
        loader, (_, self.locked) = LOADERS[name], ROBOTS[name]
        path = os.path.join(loader.path, loader.urdf_subpath, loader.urdf_filename)
        self.name, self.path = name, os.path.join(getModelPath(path), path)
        self.root = "free_flyer" if loader.free_flyer else None
        self.model = condyle.Model.from_urdf(self.path, root_joint=self.root)
        if self.locked:
            self.model = self.model.lock(self.locked, condyle.neutral(self.model))
        theirs = pin.buildModelFromUrdf(self.path, *([pin.JointModelFreeFlyer()] if loader.free_flyer else []))
        locked = [theirs.getJointId(joint) for joint in self.locked]
        self.theirs = pin.buildReducedModel(theirs, locked, pin.neutral(theirs)) if locked else theirs
        self.data, self.their_data = condyle.Data(self.model), self.theirs.createData()
        rng = np.random.default_rng(0)
        self.q = np.stack([condyle.random_configuration(self.model, seed=k) for k in range(STATES)])
        self.v, self.a, self.tau = rng.standard_normal((3, STATES, self.model.nv))

    def singles(self) -> dict[str, tuple[Call, Call]]:
        """Returns, for each algorithm, a call of Condyle and a call of Pinocchio for one state."""
        m, d, pm, pd = self.model, self.data, self.theirs, self.their_data
        q, v, a, tau = self.q[0], self.v[0], self.a[0], self.tau[0]
        frame = len(m.frames) - 1
        name = m.frames[frame].name
        frame, theirs, axes = m.frame(name), pm.getFrameId(name, pin.FrameType.BODY), pin.LOCAL_WORLD_ALIGNED
        return {
            "rnea": (lambda: condyle.rnea(m, d, q, v, a), lambda: pin.rnea(pm, pd, q, v, a)),
            "aba": (lambda: condyle.aba(m, d, q, v, tau), lambda: pin.aba(pm, pd, q, v, tau)),
            "crba": (lambda: condyle.crba(m, d, q), lambda: pin.crba(pm, pd, q)),
            "rnea_derivatives": (
                lambda: condyle.rnea_derivatives(m, d, q, v, a),
                lambda: pin.computeRNEADerivatives(pm, pd, q, v, a),
            ),
            "aba_derivatives": (
                lambda: condyle.aba_derivatives(m, d, q, v, tau),
                lambda: pin.computeABADerivatives(pm, pd, q, v, tau),
            ),
            "frame_jacobian": (
                lambda: condyle.frame_jacobian(m, d, q, frame, "local_world_aligned"),
                lambda: pin.computeFrameJacobian(pm, pd, q, theirs, axes),
            ),
            "frame_jacobian, by name": (
                lambda: condyle.frame_jacobian(m, d, q, name, "local_world_aligned"),
                lambda: pin.computeFrameJacobian(pm, pd, q, pm.getFrameId(name, pin.FrameType.BODY), axes),
            ),
            "integrate": (lambda: condyle.integrate(m, q, v), lambda: pin.integrate(pm, q, v)),
            "difference": (
                lambda: condyle.difference(m, q, self.q[1]),
                lambda: pin.difference(pm, q, self.q[1]),
            ),
        }

    def spelled(self) -> dict[str, tuple[Call, Call]]:
        """Returns, for each algorithm, a call in Pinocchio's spelling and the same call of `condyle`, for one state."""
        m, d, sm = self.model, self.data, spelling.Model(self.model)
        sd, q, v, a, tau = sm.createData(), self.q[0], self.v[0], self.a[0], self.tau[0]
        frame = len(m.frames) - 1
        spelling.forwardKinematics(sm, sd, q, v, a)
        axes, aligned = spelling.LOCAL_WORLD_ALIGNED, "local_world_aligned"
        return {
            "rnea": (lambda: spelling.rnea(sm, sd, q, v, a), lambda: condyle.rnea(m, d, q, v, a)),
            "aba": (lambda: spelling.aba(sm, sd, q, v, tau), lambda: condyle.aba(m, d, q, v, tau)),
            "crba": (lambda: spelling.crba(sm, sd, q), lambda: condyle.crba(m, d, q)),
            "computeMinverse": (lambda: spelling.computeMinverse(sm, sd, q), lambda: condyle.minv(m, d, q)),
            "computeRNEADerivatives": (
                lambda: spelling.computeRNEADerivatives(sm, sd, q, v, a),
                lambda: condyle.rnea_derivatives(m, d, q, v, a),
            ),
            "computeABADerivatives": (
                lambda: spelling.computeABADerivatives(sm, sd, q, v, tau),
                lambda: condyle.aba_derivatives(m, d, q, v, tau),
            ),
            "forwardKinematics": (
                lambda: spelling.forwardKinematics(sm, sd, q),
                lambda: condyle.forward_kinematics(m, d, q),
            ),
            "framesForwardKinematics": (
                lambda: spelling.framesForwardKinematics(sm, sd, q),
                lambda: condyle.forward_kinematics(m, d, q),
            ),
            "getFrameVelocity": (
                lambda: spelling.getFrameVelocity(sm, sd, frame + 1, axes),
                lambda: condyle.frame_velocity(m, d, q, v, frame, aligned),
            ),
            "computeFrameJacobian": (
                lambda: spelling.computeFrameJacobian(sm, sd, q, frame + 1, axes),
                lambda: condyle.frame_jacobian(m, d, q, frame, aligned),
            ),
            "centerOfMass": (lambda: spelling.centerOfMass(sm, sd, q), lambda: condyle.com(m, d, q)),
            "computeCentroidalMomentum": (
                lambda: spelling.computeCentroidalMomentum(sm, sd, q, v),
                lambda: condyle.centroidal_momentum(m, d, q, v),
            ),
            "integrate": (lambda: spelling.integrate(sm, q, v), lambda: condyle.integrate(m, q, v)),
        }

    def check(self) -> None:
        """Checks that both libraries give the same numbers."""
        for name, (ours, theirs) in self.singles().items():
            mine, other = ours(), theirs()
            if name == "aba_derivatives":
                mine = mine[1:]
            for x, y in zip(*((z if isinstance(z, tuple) else (z,)) for z in (mine, other)), strict=True):
                scale = 1 + np.abs(y).max()
                assert np.abs(x - y).max() < 1e-6 * scale, f"{self.name}: {name} differs"

    def attributes(self) -> dict[str, Call]:
        m = self.model
        return {name: (lambda name=name: getattr(m, name)) for name in ("frames", "names", "limits", "inertias")}

    def batches(self) -> dict[str, tuple[Call, Call, list[np.ndarray]]]:
        """Returns, for each algorithm, a call for all states, a loop over Pinocchio's calls, and the arrays that
        Condyle's call fills."""
        m, d, pm, pd = self.model, self.data, self.theirs, self.their_data
        q, v, a, tau, n = self.q, self.v, self.a, self.tau, self.model.nv
        empty = {k: [np.zeros((STATES, *[n] * axes)) for axes in shapes] for k, shapes in SHAPES.items()}

        def ours(name: str, *x: np.ndarray) -> Call:
            function, out = getattr(condyle, name), empty[name]
            given = out[0] if len(out) == 1 else out
            return lambda: function(m, d, *x, out=given)

        def loop(function: Callable[..., object], *x: np.ndarray) -> Call:
            return lambda: [function(pm, pd, *one) for one in zip(*x, strict=True)]

        return {
            "rnea": (ours("rnea", q, v, a), loop(pin.rnea, q, v, a), empty["rnea"]),
            "aba": (ours("aba", q, v, tau), loop(pin.aba, q, v, tau), empty["aba"]),
            "crba": (ours("crba", q), loop(pin.crba, q), empty["crba"]),
            "rnea_derivatives": (
                ours("rnea_derivatives", q, v, a),
                loop(pin.computeRNEADerivatives, q, v, a),
                empty["rnea_derivatives"],
            ),
            "aba_derivatives": (
                ours("aba_derivatives", q, v, tau),
                loop(pin.computeABADerivatives, q, v, tau),
                empty["aba_derivatives"],
            ),
        }

    def rust(self, program: Path, rounds: int) -> dict[str, float]:
        """Returns the time per state of the library's own batches (µs), without Python.

        Times differ by a few per cent between processes, because memory addresses differ. So this function returns the
        median over several processes of the library. (The Python process is a single sample.)
        """
        with tempfile.NamedTemporaryFile(suffix=".states") as file:
            for state in zip(self.q, self.v, self.a, self.tau, strict=True):
                file.write(np.concatenate(state).astype("<f8").tobytes())
            file.flush()
            command = (program, self.path, self.root or "fixed", ",".join(self.locked), file.name, "batch")
            runs = [times(run(*command)) for _ in range(max(1, rounds // 10))]
        return {name: median(one[f"batch:{name}"] for one in runs) / 1e3 for name in SHAPES}


SHAPES = {"rnea": [1], "aba": [1], "crba": [2], "rnea_derivatives": [2, 2, 2], "aba_derivatives": [1, 2, 2, 2]}
"""Shapes of the results for one state: 1 for a vector of nv numbers, 2 for an nv × nv matrix."""


def import_seconds(rounds: int) -> tuple[float, float]:
    """Returns the least times of `import numpy` and of `import numpy, condyle`, in fresh interpreters."""
    timed = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
    codes = [timed.format(what) for what in ("numpy", "numpy, condyle")]
    found = [[float(subprocess.check_output([sys.executable, "-c", code])) for code in codes] for _ in range(rounds)]
    alone, both = np.min(found, axis=0)
    return float(alone), float(both)


def solve_seconds(rounds: int) -> tuple[float, float]:
    """Returns the least time of a solve by FDDP, measured by the solver and measured in Python. In the problem, an arm
    reaches for a point."""
    arm, knots = condyle.robots.arm7(), 100
    x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    way = [Cost("state", 1e-2, Residual.state(x0)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))]
    point = Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5])
    knot, last = FreeDynamics(arm, 0.02, way), FreeDynamics(arm, None, [Cost("point", 1e4, point), *way[:1]])
    problem = Problem(x0, [knot], [0] * knots, last)
    xs, us = np.tile(x0, (knots + 1, 1)), np.tile(knot.quasi_static(x0), (knots, 1))
    solver, inside, outside = Fddp(problem), np.inf, np.inf
    for _ in range(rounds):
        begin = time.perf_counter()
        solution = solver.solve(xs, us)
        outside = min(outside, time.perf_counter() - begin)
        inside = min(inside, solution.timings.total)
    return inside, outside


def measure(robot: Robot, program: Path | None, rounds: int) -> list[dict]:
    rows = []
    robot.check()
    for name, calls in robot.singles().items():
        ours, theirs = least(list(calls), rounds)
        rows.append({"table": "single", "robot": robot.name, "name": name, "ours_us": ours, "theirs_us": theirs})
    for name, calls in robot.spelled().items():
        spelled, ours = least(list(calls), rounds)
        rows.append({"table": "spelling", "robot": robot.name, "name": name, "ours_us": spelled, "plain_us": ours})
    for name, call in robot.attributes().items():
        rows.append({"table": "attribute", "robot": robot.name, "name": name, "ours_us": least([call], rounds)[0]})
    rust = robot.rust(program, rounds) if program else {}
    for name, (ours, theirs, out) in robot.batches().items():
        write = lambda out=out: [x.fill(1.0) for x in out]  # noqa: E731
        # Time one function completely, then the next, in the same way as the library is timed. If calls took turns,
        # each would begin with other data in the cache.
        ones = [np.ones(x.shape[1:]) for x in out]
        copy = lambda out=out, ones=ones: [np.copyto(x, one) for x, one in zip(out, ones, strict=True)]  # noqa: E731
        mine, other, writing, copying = (least([call], rounds, 0.0)[0] / STATES for call in (ours, theirs, write, copy))
        row = {"table": "batch", "robot": robot.name, "name": name, "ours_us": mine, "theirs_us": other}
        rows.append(row | {"write_us": writing, "copy_us": copying, "rust_us": rust.get(name, np.nan)})
    return rows


def show(rows: list[dict]) -> None:
    for row in rows:
        head = f"{row['robot']:7} {row['name']:24} {row['ours_us']:9.3f} µs"
        match row["table"]:
            case "single":
                print(
                    f"{head}   beside {row['theirs_us']:9.3f} µs of Pinocchio: {row['ours_us'] / row['theirs_us']:.2f}"
                )
            case "spelling":
                print(f"{head}   beside {row['plain_us']:9.3f} µs of condyle: {row['ours_us'] / row['plain_us']:.2f}")
            case "attribute":
                print(f"{head}   an access")
            case "batch":
                budget = row["rust_us"] + WRITES * row["write_us"]
                parts = f"{row['rust_us']:.3f} + {WRITES} · {row['write_us']:.3f}"
                print(
                    f"{head}   a state, of a loop of Pinocchio's {row['ours_us'] / row['theirs_us']:.2f}; "
                    f"of {parts} = {budget:.3f}: {row['ours_us'] / budget:.2f}; a copy {row['copy_us']:.3f}"
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("robots", nargs="*", default=["panda", "talos"], metavar="ROBOT")
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--cpu", type=int, default=0, help="the core on which everything runs")
    parser.add_argument("--json", action="store_true", help="print a list of records in place of the tables")
    parser.add_argument("--no-rust", action="store_true", help="do not build and time the library without Python")
    wanted = parser.parse_args()
    program = None if wanted.no_rust else build_ours()
    os.sched_setaffinity(0, {wanted.cpu})
    rows = []
    for name in wanted.robots:
        rows += measure(Robot(name), program, wanted.rounds)
    alone, both = import_seconds(max(3, wanted.rounds // 5))
    inside, outside = solve_seconds(wanted.rounds)
    if wanted.json:
        whole = {"import_numpy_s": alone, "import_s": both, "solve_inside_s": inside, "solve_s": outside}
        print(json.dumps([*rows, {"table": "whole"} | whole], indent=1))
        return
    show(rows)
    print(f"import: {both:.3f} s, {both - alone:.3f} s beyond NumPy's {alone:.3f} s")
    print(
        f"FDDP: {1e3 * outside:.3f} ms, {100 * (outside / inside - 1):.1f} % beyond the solver's {1e3 * inside:.3f} ms"
    )


if __name__ == "__main__":
    main()
