"""Times other solvers for the programs that benches/peers/wholebody.rs exports. The script wholebody.py runs this
program.

    python wholebody_theirs.py FOLDER REPLAYS EIQUADPROG_LIBRARY

All solvers solve the same program with pyramids to the same objective, in full and in condensed form, with warm starts
if available. Each time includes the solve and copying the program's numbers into the solver, but not computing these
numbers.
"""

import ctypes
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import daqp
import numpy as np
import proxsuite
import quadprog
from wholebody_programs import Program, read

AGREEMENT = 1e-6
"""Maximum difference between the objectives of another solver and of Condyle, relative to 1 + |objective|. With a
larger difference, a tick counts as not solved."""
ACCURACY = 1e-9
"""Tolerance for solvers that have a tolerance. Condyle's solver has the same tolerance."""
ITERATIONS = 500, 50
"""Maximum numbers of outer and inner iterations of ProxQP. With ProxQP's default maximum, a tick takes seconds if
ProxQP does not converge. With these numbers, ProxQP stops earlier, and the tick counts as solved only if the objective
is near enough to Condyle's objective."""
Solver = Callable[[Program], np.ndarray]


def by_quadprog() -> Solver:
    def solve(p: Program) -> np.ndarray:
        return quadprog.solve_qp(p.P, -p.c, p.normals, p.offsets, len(p.b))[0]

    return solve


def by_proxqp() -> Solver:
    kept: dict[tuple[int, int, int], proxsuite.proxqp.dense.QP] = {}

    def solve(p: Program) -> np.ndarray:
        shape = p.shape()
        qp = kept.get(shape)
        arguments = {"H": p.P, "g": p.c, "A": p.A, "b": p.b, "C": p.G, "l": p.lower, "u": p.upper}
        if qp is None:
            qp = kept[shape] = proxsuite.proxqp.dense.QP(*shape)
            qp.settings.eps_abs = ACCURACY
            qp.settings.max_iter, qp.settings.max_iter_in = ITERATIONS
            qp.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
            qp.init(*arguments.values())
        else:
            qp.update(**arguments)
        qp.solve()
        return qp.results.x

    return solve


def by_daqp() -> Solver:
    kept: dict[tuple[int, int, int], daqp.Model] = {}

    def solve(p: Program) -> np.ndarray:
        shape = p.shape()
        model = kept.get(shape)
        if model is None:
            model = kept[shape] = daqp.Model()
            model.settings = {"primal_tol": ACCURACY, "dual_tol": ACCURACY}
            model.setup(p.P, p.c, p.all_rows, p.all_upper, p.all_lower, p.sense)
        else:
            model.update(H=p.P, f=p.c, A=p.all_rows, bupper=p.all_upper, blower=p.all_lower)
        return model.solve()[0]

    return solve


def by_eiquadprog(library: str) -> Callable[[], Solver]:
    function = ctypes.CDLL(library).solve
    pointer = ctypes.POINTER(ctypes.c_double)

    def make() -> Solver:
        def solve(p: Program) -> np.ndarray:
            n, e, _ = p.shape()
            x = np.empty(n)
            arrays = (p.P, p.c, p.A, p.minus_b, p.C, p.d, x)
            if function(n, e, len(p.d), *(a.ctypes.data_as(pointer) for a in arrays)) != 0:
                raise ValueError("not solved")
            return x

        return solve

    return make


def times(ticks: list, form: str, make: Callable[[], Solver], replays: int) -> tuple[np.ndarray, int]:
    """Returns the milliseconds of each solve in each replay, and the number of ticks that were not solved."""
    found, unsolved = np.empty((replays, len(ticks))), 0
    for replay in range(replays):
        solver = make()
        for k, (programs, ours) in enumerate(ticks):
            program = programs[form]
            start = time.perf_counter()
            try:
                x = solver(program)
            except ValueError:
                x = np.full(len(program.c), np.nan)
            found[replay, k] = 1e3 * (time.perf_counter() - start)
            if replay == 0:
                best = program.objective(ours[form])
                near = abs(program.objective(x) - best) <= AGREEMENT * (1 + abs(best))
                unsolved += not near
    return found, unsolved


def main() -> None:
    folder, replays, library = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    solvers = {"proxqp": by_proxqp, "quadprog": by_quadprog, "daqp": by_daqp}
    if library:
        solvers["eiquadprog"] = by_eiquadprog(library)
    for path in sorted(folder.glob("*.sizes")):
        robot, workload = path.stem.rsplit("-", 1)
        ticks = read(path)
        for name, make in solvers.items():
            for form in ("full", "condensed"):
                taken, unsolved = times(ticks, form, make, replays)
                least = taken.min(axis=0)
                record = {
                    "robot": robot,
                    "workload": workload,
                    "ticks": len(ticks),
                    "replays": replays,
                    "ours": False,
                    "backend": name,
                    "part": "solve",
                    "friction": "pyramid",
                    "form": form,
                    "unsolved": unsolved,
                    "p50_ms": float(np.quantile(least, 0.5)),
                    "p99_ms": float(np.quantile(least, 0.99)),
                    "max_ms": float(least.max()),
                    "raw_p99_ms": float(np.quantile(taken, 0.99)),
                }
                print(json.dumps(record), flush=True)


if __name__ == "__main__":
    main()
