#!/usr/bin/env python3
"""Compares Condyle with CasADi in one run: functions, derivatives, and a motion by IPOPT and by FDDP. Writes JSON.

    .venv/pinocchio/bin/python benches/peers/casadi_comparison.py [FILE.json] [--quick]

The functions are RNEA and ABA, their Jacobian, and the Hessian of λᵀf (a sum of the results f with the weights λ), for
the built-in robots. Each function is timed in three forms: Condyle's call from Python, Condyle's function in CasADi,
and the same recursion written as CasADi expressions.

In the motion, an arm goes to a point and comes to rest there. FDDP solves the problem directly. IPOPT solves it by
multiple shooting with exact Hessians, once with Condyle's ABA and once with an ABA of expressions. All three solutions
must have the same cost.
"""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from typing import Any

import casadi
import numpy as np
from casadi_expressions import Expressions
from casadi_functions import call, derived, microseconds

import condyle
import condyle.casadi
from condyle.optimal import Activation, Cost, Fddp, FreeDynamics, Problem, Residual

KNOTS, DT = 50, 0.02
SAME = 1e-6
"""Maximum relative difference between the costs of the three solutions."""


def own(model: condyle.Model, name: str, x: list[np.ndarray]) -> dict[str, Callable[[], object]]:
    """Returns functions that call Condyle from Python. Each call writes its results into existing arrays."""
    data, value = condyle.Data(model), np.zeros(model.nv)
    function, derivatives = getattr(condyle, name), getattr(condyle, f"{name}_derivatives")
    return {
        "value": lambda: function(model, data, *x, out=value),
        "Jacobian": lambda: derivatives(model, data, *x),
    }


def functions(model: condyle.Model) -> list[dict[str, Any]]:
    """Returns the times of a robot's functions, in µs."""
    rng, rows = np.random.default_rng(1), []
    x = [condyle.random_configuration(model, seed=1), *rng.standard_normal((2, model.nv))]
    for name in ("rnea", "aba"):
        ours, theirs = getattr(condyle.casadi, name)(model), getattr(Expressions(model), name)()
        difference = float(casadi.norm_inf(ours(*x) - theirs(*x)))
        assert difference < 1e-8 * (1 + float(casadi.norm_inf(ours(*x)))), f"{name} differs by {difference}"
        direct = own(model, name, x)
        for kind in ("value", "Jacobian", "Hessian"):
            calls = [call(derived(f)[kind], x) for f in (ours, theirs)]
            calls += [direct[kind]] if kind in direct else []
            times = microseconds(calls)
            row = {"robot": model.name, "function": name, "kind": kind}
            row |= dict(zip(("casadi_with_ours_us", "casadi_expressions_us", "ours_us"), times, strict=False))
            rows.append(row)
    return rows


class Reach:
    """Problem of an arm that goes to a point within a second, and rests there."""

    def __init__(self) -> None:
        self.arm = condyle.robots.arm7()
        self.target = np.array([0.4, 0.2, 0.5])
        self.x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]

    def by_fddp(self) -> Callable[[], tuple[float, float, int]]:
        """Returns a function. This function solves the problem by FDDP, and returns the time (s), the cost and the
        number of iterations."""
        arm, x0 = self.arm, self.x0
        speed = Activation.weighted(np.r_[np.zeros(7), np.ones(7)])
        running = [
            Cost("speed", 1e-1, Residual.state(x0), speed),
            Cost("effort", 1e-3, Residual.control(np.zeros(7))),
        ]
        point = Residual.frame_translation(arm, "tool", self.target)
        end = [Cost("point", 1e3, point), Cost("rest", 1e1, Residual.state(x0), speed)]
        knot = FreeDynamics(arm, DT, running)
        problem = Problem(x0, [knot], [0] * KNOTS, FreeDynamics(arm, None, end))
        xs, us = np.tile(x0, (KNOTS + 1, 1)), np.tile(knot.quasi_static(x0), (KNOTS, 1))
        solver = Fddp(problem, tolerance=1e-12, max_iterations=200)

        def solve() -> tuple[float, float, int]:
            begin = time.perf_counter()
            solution = solver.solve(xs, us)
            return time.perf_counter() - begin, solution.cost, len(solution.trace)

        return solve

    def by_ipopt(self, dynamics: casadi.Function, placement: casadi.Function) -> Callable[[], tuple[float, float, int]]:
        """Returns a function that solves the problem by IPOPT, as a nonlinear program. `dynamics` maps (q, v, τ) to q̈
        for all knots; `placement` maps q to a tuple that begins with the position."""
        n, opti = 7, casadi.Opti()
        q, v, u = opti.variable(n, KNOTS + 1), opti.variable(n, KNOTS + 1), opti.variable(n, KNOTS)
        after = v[:, :-1] + DT * dynamics(q[:, :-1], v[:, :-1], u)  # v⁺ = v + Δt q̈
        opti.subject_to(v[:, 1:] == after)
        opti.subject_to(q[:, 1:] == q[:, :-1] + DT * v[:, 1:])  # q⁺ = q + Δt v⁺
        opti.subject_to(q[:, 0] == self.x0[:n])
        opti.subject_to(v[:, 0] == self.x0[n:])
        miss = placement(q[:, -1])[0] - self.target
        running = DT * (0.5e-1 * casadi.sumsqr(v[:, :-1]) + 0.5e-3 * casadi.sumsqr(u))
        opti.minimize(running + 0.5e3 * casadi.sumsqr(miss) + 0.5e1 * casadi.sumsqr(v[:, -1]))
        opti.set_initial(q, np.tile(self.x0[:n, None], KNOTS + 1))
        hold = condyle.gravity(self.arm, condyle.Data(self.arm), self.x0[:n])
        opti.set_initial(u, np.tile(hold[:, None], KNOTS))
        opti.solver("ipopt", {"print_time": False, "record_time": True}, {"print_level": 0, "sb": "yes", "tol": 1e-9})

        def solve() -> tuple[float, float, int]:
            begin = time.perf_counter()
            solution = opti.solve()  # each solve starts from the same guess
            return time.perf_counter() - begin, float(solution.value(opti.f)), solution.stats()["iter_count"]

        return solve

    def solves(self) -> dict[str, Callable[[], tuple[float, float, int]]]:
        expressions = Expressions(self.arm)
        ours = condyle.casadi.aba(self.arm, states=KNOTS), condyle.casadi.forward_kinematics(self.arm, "tool")
        theirs = expressions.aba().map(KNOTS), expressions.forward_kinematics("tool")
        return {
            "fddp": self.by_fddp(),
            "ipopt_with_ours": self.by_ipopt(*ours),
            "ipopt_expressions": self.by_ipopt(*theirs),
        }


def motion(rounds: int) -> dict[str, Any]:
    """Returns the least time of a solve by each method, in ms."""
    solves, found = Reach().solves(), {}
    for _ in range(rounds):
        for name, solve in solves.items():
            seconds, cost, iterations = solve()
            before = found.get(name, {"ms": np.inf})["ms"]
            found[name] = {"ms": min(before, 1e3 * seconds), "cost": cost, "iterations": iterations}
    costs = [way["cost"] for way in found.values()]
    assert max(costs) - min(costs) < SAME * max(costs), f"the solutions differ: {costs}"
    return {"knots": KNOTS, **found}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("file", nargs="?", help="where the JSON goes; to standard output without it")
    parser.add_argument("--quick", action="store_true", help="the arm alone, and one solve of each kind")
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    models = [condyle.robots.arm7()]
    models += [] if wanted.quick else [condyle.robots.quadruped(), condyle.robots.humanoid()]
    report = {
        "processor": platform.processor() or platform.machine(),
        "casadi": casadi.__version__,
        "condyle": condyle.__version__,
        "functions": [row for model in models for row in functions(model)],
        "reach": motion(1 if wanted.quick else 11),
    }
    text = json.dumps(report, indent=1) + "\n"
    if wanted.file:
        with open(wanted.file, "w", encoding="utf-8") as file:
            file.write(text)
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
