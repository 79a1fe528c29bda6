#!/usr/bin/env python3
"""Solves problems with limits by Condyle's InteriorPoint and AugmentedLagrangian, and by IPOPT, FATROP and CSQP.

    .venv/pinocchio/bin/python benches/peers/constrained.py [--problems FOLDER] [--rounds N] [--cpu N] [--json] [NAME …]

All solvers begin with the same states and controls and have the tolerance 1e-6. The problems are an arm's reach and a
cartpole, and those in FOLDER: NAME.json (from `Problem.to_json`) with NAME.npz (the arrays `xs` and `us`).

IPOPT and FATROP (both in CasADi) solve the problem as a nonlinear program by multiple shooting. Its functions come from
condyle.casadi, and so are computed without Python. CSQP (mim_solvers) solves the problem with Crocoddyl, if the robot
has a fixed base; its quadratic programs have their default tolerances. The drives of a cartpole are then written in
Python, so CSQP's time for it does not count. mim_solvers 0.3.0 needs crocoddyl 3.2.1 and pin 4.0.0; a solver that is
not installed is not run.

For each solver the program prints the iterations, the processor time of a solve in ms (the median of the rounds, in
which the solvers take turns), the cost, and the largest violation of a limit or of the dynamics. One program computes
costs and violations of all solutions. AugmentedLagrangian counts the iterations of all its inner solves. IPOPT and
FATROP also have the part of the time that is spent in functions. `second_order` is InteriorPoint with the exact
Hessians of the dynamics, which IPOPT and FATROP use. Solves of more than 10 s are run once. The last column is 'yes'
for a solver that converged, and otherwise 'no' with the solver's status.
"""

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

os.environ["OMP_NUM_THREADS"] = "1"  # set before libraries are loaded: on one core, threads would wait for each other

import numpy as np
from constrained_problems import PROBLEMS, Start
from constrained_program import Program

from condyle.optimal import AugmentedLagrangian, InteriorPoint

TOLERANCE, ITERATIONS, SLOW = 1e-6, 300, 10.0
FUNCTIONS = ("f", "g", "grad_f", "jac_g", "hess_l")


class Found(NamedTuple):
    """Result of a solve: states and controls as variables of the program."""

    z: Any
    iterations: int
    converged: bool
    status: str
    functions: float | None = None
    """Time in the functions of the program (s)."""


Solve = Callable[[], Found]


def interior_point(program: Program, start: Start, second_order: bool = False) -> Solve:
    settings = {"max_iterations": ITERATIONS, "second_order": second_order}
    solver = InteriorPoint(program.problem, tolerance=TOLERANCE, **settings)

    def solve() -> Found:
        s = solver.solve(start.xs, start.us)
        return Found(program.pack(s.xs, s.us), solver.outcome.iterations, s.status == "converged", s.status)

    return solve


def second_order(program: Program, start: Start) -> Solve:
    return interior_point(program, start, second_order=True)


def augmented_lagrangian(program: Program, start: Start) -> Solve:
    inner = {"max_iterations": ITERATIONS}
    solver = AugmentedLagrangian(program.problem, inner=inner, tolerance=TOLERANCE, tolerance_dual=10 * TOLERANCE)

    def solve() -> Found:
        s = solver.solve(start.xs, start.us)
        return Found(program.pack(s.xs, s.us), solver.outcome.iterations, s.status == "converged", s.status)

    return solve


def casadi_solver(plugin: str, settings: dict[str, Any], program: Program, start: Start) -> Solve:
    options = {"print_level": 0, "tol": TOLERANCE, "max_iter": ITERATIONS, **settings}
    solver, z = program.solver(plugin, {plugin: options, "record_time": True}), program.pack(start.xs, start.us)

    def solve() -> Found:
        after = np.array(program.solve(solver, z)["x"]).ravel()
        s = solver.stats()
        functions = sum(s.get(f"t_proc_nlp_{k}", 0.0) for k in FUNCTIONS)
        return Found(after, s["iter_count"], s["success"], str(s["return_status"]), functions)

    return solve


def ipopt(program: Program, start: Start) -> Solve:
    return casadi_solver("ipopt", {"sb": "yes", "constr_viol_tol": TOLERANCE}, program, start)


def fatrop(program: Program, start: Start) -> Solve:
    return casadi_solver("fatrop", {}, program, start)


def csqp(program: Program, start: Start) -> Solve:
    from constrained_csqp import Csqp

    if program.shift:
        raise NotImplementedError("robots with a free base are not written for Crocoddyl")
    theirs = Csqp(program)

    def solve() -> Found:
        xs, us, iterations, status = theirs.solve(start.xs, start.us, TOLERANCE, ITERATIONS)
        return Found(program.pack(xs, us), iterations, status == "converged", status)

    return solve


SOLVERS = {f.__name__: f for f in (interior_point, second_order, augmented_lagrangian, ipopt, fatrop, csqp)}


def attempt(run: Callable[[], Any]) -> tuple[Any, str | None]:
    """Returns the result of a function, or the text of its error."""
    try:
        return run(), None
    except Exception as error:  # a peer that fails must not end the comparison
        return None, f"{type(error).__name__}: {error}".splitlines()[0]


def compare(start: Start, names: list[str], rounds: int) -> list[dict[str, Any]]:
    """Returns a row for each solver."""
    program, solves, rows, times = Program(start.text), {}, {}, {name: [] for name in names}
    for name in names:
        solves[name], missing = attempt(lambda name=name: SOLVERS[name](program, start))
        rows[name] = {"solver": name, "converged": False, "status": missing}
    for k in range(rounds):
        for name, solve in solves.items():
            if solve is None or (k and times[name][0][0] > SLOW):
                continue
            begin = time.process_time()
            found, failure = attempt(solve)
            took = time.process_time() - begin
            if failure:
                rows[name]["status"], solves[name] = failure, None
                continue
            times[name].append((took, found.functions))
            cost, violation = program.measure(found.z)
            rows[name] |= {"iterations": found.iterations, "cost": cost, "violation": violation}
            rows[name] |= {"converged": found.converged, "status": found.status}
    for name, taken in times.items():
        if taken:
            rows[name]["ms"] = 1e3 * statistics.median(took for took, _ in taken)
        if taken and taken[0][1] is not None:
            rows[name]["functions_ms"] = 1e3 * statistics.median(functions for _, functions in taken)
    return list(rows.values())


def line(row: dict[str, Any]) -> str:
    """Returns a row as a line of text."""
    if "cost" not in row:
        return f"    {row['solver']:21} no: {row['status']}"
    functions = f" ({row['functions_ms']:9.1f} in functions)" if "functions_ms" in row else ""
    verdict = "yes" if row["converged"] else f"no: {row['status']}"
    return (
        f"    {row['solver']:21}{row['iterations']:5} iterations {row['ms']:10.1f} ms{functions:27}"
        f"  cost {row['cost']:.7f}  violation {row['violation']:.1e}  {verdict}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=Path, metavar="FOLDER", help="a folder with further problems")
    parser.add_argument("--solvers", nargs="+", choices=list(SOLVERS), default=list(SOLVERS))
    parser.add_argument("--rounds", type=int, default=5, help="how often each problem is solved")
    parser.add_argument("--cpu", type=int, help="the core to run on")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each problem")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these problems")
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0)) if wanted.cpu is None else wanted.cpu})
    problems: dict[str, Callable[[], Start]] = dict(PROBLEMS)
    for path in sorted(wanted.problems.glob("*.json")) if wanted.problems else []:
        name = path.stem if path.stem not in PROBLEMS else f"{path.stem} of {wanted.problems.name}"

        def load(path: Path = path) -> Start:
            arrays = np.load(path.with_suffix(".npz"))
            return Start(path.read_text(encoding="utf-8"), arrays["xs"], arrays["us"])

        problems[name] = load
    for name in wanted.names or problems:
        rows = compare(problems[name](), wanted.solvers, wanted.rounds)
        if wanted.json:
            print(json.dumps({"problem": name, "solvers": rows}), flush=True)
            continue
        print(name)
        for row in rows:
            print(line(row), flush=True)


if __name__ == "__main__":
    main()
