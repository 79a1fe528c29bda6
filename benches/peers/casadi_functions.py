#!/usr/bin/env python3
"""Times functions of a robot in CasADi: the functions of condyle.casadi, and the same recursions written as CasADi
expressions.

    .venv/pinocchio/bin/python benches/peers/casadi_functions.py [URDF …] [--free-flyer] [--json]

Without a URDF, the robots are the built-in arm and humanoid. For RNEA and ABA, the program prints times in microseconds
and the speed-up by condyle.casadi. It prints these for the function, for its Jacobian with respect to all arguments,
and for the Hessian of λᵀf, a sum of the results f with the weights λ. Times are medians of alternating rounds on one
core. The expressions run in CasADi's own virtual machine, as pinocchio.casadi's expressions do.
"""

import argparse
import json
import os
import time
from collections.abc import Callable

import casadi
import numpy as np
from casadi_expressions import Expressions

import condyle
import condyle.casadi

ROUNDS = 21
SECONDS = 0.02  # duration of each round


def derived(f: casadi.Function) -> dict[str, casadi.Function]:
    """Returns the function, its Jacobian, and the blocks of the Hessian of λᵀf that an optimisation needs. λᵀf is a sum
    of the results f with the weights λ."""
    return {"value": f, "Jacobian": f.jacobian(), "Hessian": f.reverse(1).jacobian()}


def call(f: casadi.Function, x: list[np.ndarray]) -> Callable[[], None]:
    """Returns a call of a CasADi function through CasADi's buffers, which avoids Python's conversions. All entries of
    inputs that are missing in x are 1."""
    buffer, trigger = f.buffer()
    given = [*x, *(np.ones(f.nnz_in(k)) for k in range(len(x), f.n_in()))]
    results = [np.zeros(f.nnz_out(k)) for k in range(f.n_out())]
    for k, part in enumerate(given):
        if f.nnz_in(k):
            buffer.set_arg(k, memoryview(part))
    for k, result in enumerate(results):
        if f.nnz_out(k):
            buffer.set_res(k, memoryview(result))
    return lambda keep=(buffer, given, results): trigger()


def microseconds(calls: list[Callable[[], None]]) -> list[float]:
    """Returns the median time of each call, over rounds in which the calls take turns."""
    repeats = []
    for one in calls:
        begin, n = time.perf_counter(), 0
        while time.perf_counter() - begin < SECONDS:
            one()
            n += 1
        repeats.append(n)
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(ROUNDS):
        for k, (one, n) in enumerate(zip(calls, repeats, strict=True)):
            begin = time.perf_counter()
            for _ in range(n):
                one()
            times[k].append((time.perf_counter() - begin) / n * 1e6)
    return [float(np.median(t)) for t in times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("robots", nargs="*", metavar="URDF")
    parser.add_argument("--free-flyer", action="store_true", help="the robots' roots move freely")
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    root = "free_flyer" if wanted.free_flyer else None
    models = [condyle.Model.from_urdf(path, root_joint=root) for path in wanted.robots]
    for model in models or [condyle.robots.arm7(), condyle.robots.humanoid()]:
        rng, expressions = np.random.default_rng(1), Expressions(model)
        x = [condyle.random_configuration(model, seed=1), *rng.standard_normal((2, model.nv))]
        for name in ("rnea", "aba"):
            ours, theirs = getattr(condyle.casadi, name)(model), getattr(expressions, name)()
            difference = float(casadi.norm_inf(ours(*x) - theirs(*x)))
            assert difference < 1e-8 * (1 + float(casadi.norm_inf(ours(*x)))), f"{name} differs by {difference}"
            for kind in ("value", "Jacobian", "Hessian"):
                pair = [derived(f)[kind] for f in (ours, theirs)]
                mine, other = microseconds([call(f, x) for f in pair])
                row = {"robot": model.name, "function": name, "kind": kind, "ours_us": mine, "expressions_us": other}
                if wanted.json:
                    print(json.dumps(row), flush=True)
                else:
                    print(
                        f"{model.name:20} {name:5} {kind:9} {mine:9.2f} {other:9.2f} {other / mine:6.1f} ×", flush=True
                    )


if __name__ == "__main__":
    main()
