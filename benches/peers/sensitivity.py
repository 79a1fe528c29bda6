#!/usr/bin/env python3
"""Compares gradients through optimal control problems with CasADi's parametric sensitivities: values and times.

    python benches/peers/sensitivity.py [--rounds N] [--json]

Needs the package, numpy and casadi. The problems are a chain of masses and the swing-up of a cart-pole. Both libraries
use the same CasADi expressions. The loss is a linear function of all states and controls, with random coefficients.
Its gradient is taken with respect to the initial state and to the goal. CasADi solves the problem with IPOPT by
multiple shooting, and differentiates with `nlpsol(...).reverse(1)`. Condyle solves the problem with `Fddp`.

For an arm of Condyle, the program prints times only: of one problem, and of the gradients of 256 problems, one by one
and in lanes (`Sensitivities`).

The program prints the largest relative difference of the gradients, and these times (the least of the rounds): an
iteration of the solver, the creation of a `Sensitivity`, a gradient with it, and a gradient by CasADi. CasADi's
gradient evaluates and factorises the optimality conditions each time, as the creation of a `Sensitivity` does.
"""

import argparse
import itertools
import json
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import casadi
import numpy as np

import condyle
import condyle.casadi
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivities, Sensitivity

TOLERANCE = 1e-6
MANY = 256


class Case(NamedTuple):
    """An optimal control problem as CasADi expressions."""

    name: str
    x: Any
    u: Any
    goal: Any
    next_state: Any
    cost: Any
    terminal_cost: Any
    x0: np.ndarray
    goal_value: np.ndarray
    horizon: int
    u0: np.ndarray


def cartpole() -> Case:
    x, u, goal = casadi.SX.sym("x", 4), casadi.SX.sym("u", 1), casadi.SX.sym("goal", 1)
    cart, pole, length, g, h = 1.0, 0.1, 0.5, 9.81, 0.03
    s, c, rate = casadi.sin(x[1]), casadi.cos(x[1]), x[3]
    mu = cart + pole * s * s
    y_dd = (u + pole * c * s * g - pole * length * s * rate**2) / mu
    theta_dd = (c * u / length + (cart + pole) * g * s / length - pole * c * s * rate**2) / mu
    v = x[2:] + h * casadi.vertcat(y_dd, theta_dd)
    after = casadi.vertcat(x[:2] + h * v, v)
    error = casadi.vertcat(x[0] - goal, x[1:])
    cost = 0.5 * h * (casadi.sumsqr(error * casadi.DM([0.1, 1.0, 0.1, 0.1])) + 0.09 * u**2)
    terminal = 0.5 * casadi.sumsqr(error * casadi.DM([10.0, 100.0, 10.0, 10.0]))
    start = np.array([0.0, 3.0, 0.0, 0.0])
    return Case("cart-pole", x, u, goal, after, cost, terminal, start, np.zeros(1), 50, np.zeros(1))


def chain(masses: int = 4) -> Case:
    """Masses in space on springs, the first one held, and the last one moved by a controlled velocity."""
    n = 3 * masses
    x, u, goal = casadi.SX.sym("x", 2 * n + 3), casadi.SX.sym("u", 3), casadi.SX.sym("goal", 3)
    p, v, end = x[:n], x[n : 2 * n], x[2 * n :]
    stiffness, rest, mass, h = 10.0, 0.05, 0.1, 0.05
    points = [casadi.DM.zeros(3), *(p[3 * k : 3 * k + 3] for k in range(masses)), end]
    forces = []
    for a, b in itertools.pairwise(points):
        d = b - a
        forces.append(stiffness * (1.0 - rest / casadi.sqrt(casadi.sumsqr(d) + 1e-6)) * d)
    gravity = casadi.DM([0.0, 0.0, -9.81])
    a = casadi.vertcat(*((forces[k + 1] - forces[k]) / mass + gravity for k in range(masses)))
    v_next = v + h * (a - 0.2 * v)
    after = casadi.vertcat(p + h * v_next, v_next, end + h * u)
    cost = 0.5 * h * (25.0 * casadi.sumsqr(end - goal) + casadi.sumsqr(v) + 0.1 * casadi.sumsqr(u))
    # CasADi takes an equation with the multiplier 0 for an inactive one, so the cost depends on all final states
    terminal = 0.5 * (25.0 * casadi.sumsqr(end - goal) + 10.0 * casadi.sumsqr(v) + 0.1 * casadi.sumsqr(p))
    line = np.linspace(0.0, 1.0, masses + 2)[1:-1]
    start = np.concatenate([np.outer(line, [1.0, 0.0, 0.0]).ravel(), np.zeros(n), [1.0, 0.0, 0.0]])
    goal_value = np.array([0.8, 0.4, 0.2])
    return Case("chain of masses", x, u, goal, after, cost, terminal, start, goal_value, 40, np.zeros(3))


def problem_of(case: Case, goal: np.ndarray) -> Problem:
    def at(expression: Any) -> Any:
        return casadi.substitute(expression, case.goal, casadi.DM(goal))

    knot = condyle.casadi.action(case.x, case.u, case.next_state, at(case.cost))
    end = condyle.casadi.action(case.x, None, None, at(case.terminal_cost))
    return Problem(case.x0, [knot], [0] * case.horizon, end)


def nlp_of(case: Case) -> tuple[Any, Any]:
    """Returns the problem by multiple shooting: its solver, and the solver's derivatives."""
    nx, nu, n = case.x.numel(), case.u.numel(), case.horizon
    step = casadi.Function("step", [case.x, case.u, case.goal], [case.next_state, case.cost])
    final = casadi.Function("final", [case.x, case.goal], [case.terminal_cost])
    xs, us = casadi.MX.sym("xs", nx, n + 1), casadi.MX.sym("us", nu, n)
    parameters = casadi.MX.sym("p", nx + case.goal.numel())
    x0, goal = parameters[:nx], parameters[nx:]
    after, costs = step.map(n)(xs[:, :-1], us, casadi.repmat(goal, 1, n))
    objective = casadi.sum2(costs) + final(xs[:, -1], goal)
    gaps = casadi.vertcat(xs[:, 0] - x0, casadi.vec(after - xs[:, 1:]))
    z = casadi.vertcat(casadi.vec(xs), casadi.vec(us))
    nlp = {"x": z, "p": parameters, "f": objective, "g": gaps}
    settings = {"print_level": 0, "sb": "yes", "tol": 1e-12, "max_iter": 1000}
    solver = casadi.nlpsol("solver", "ipopt", nlp, {"ipopt": settings, "print_time": False})
    return solver, solver.reverse(1)


def least(rounds: int, call: Callable[[], object]) -> float:
    """Returns the shortest time of a call (s)."""
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def compare(case: Case, rounds: int) -> dict[str, Any]:
    nx, nu, n = case.x.numel(), case.u.numel(), case.horizon
    problem = problem_of(case, case.goal_value)
    solver = Fddp(problem, max_iterations=1000, tolerance=1e-20, flat=1e-6)
    solution = solver.solve(np.tile(case.x0, (n + 1, 1)), np.tile(case.u0, (n, 1)))
    if solution.status != "converged":
        raise RuntimeError(f"{case.name}: the solution has the status {solution.status}")
    generator = np.random.default_rng(1)
    by_xs, by_us = generator.standard_normal((n + 1, nx)), generator.standard_normal((n, nu))

    sensitivity = Sensitivity(solver)
    sensitivity.define("goal", len(case.goal_value), lambda change: problem_of(case, case.goal_value + change))
    ours = np.r_[sensitivity.gradient("x0", by_xs, by_us), sensitivity.gradient("goal", by_xs, by_us)]

    nlp, reverse = nlp_of(case)
    z0, p = np.r_[solution.xs.ravel(), solution.us.ravel()], np.r_[case.x0, case.goal_value]
    found = nlp(x0=z0, p=p, lbg=0.0, ubg=0.0)
    given = {"x0": z0, "p": p, "lbx": -np.inf, "ubx": np.inf, "lbg": 0.0, "ubg": 0.0, "lam_x0": 0.0, "lam_g0": 0.0}
    outputs = {f"out_{name}": found[name] for name in ("x", "f", "g", "lam_x", "lam_g", "lam_p")}
    seeds = {"adj_x": np.r_[by_xs.ravel(), by_us.ravel()]}

    def theirs() -> Any:
        return reverse(**given, **outputs, **seeds)["adj_p"]

    expected = np.asarray(theirs()).ravel()
    error = float(np.abs(ours - expected).max() / np.abs(expected).max())
    timed = Fddp(problem, max_iterations=20)
    first = timed.solve(np.tile(case.x0, (n + 1, 1)), np.tile(case.u0, (n, 1)))
    times = {
        "iteration": first.timings.total / len(first.trace),
        "create, exact": least(rounds, lambda: Sensitivity(solver)),
        "create, Gauss-Newton": least(rounds, lambda: Sensitivity(solver, curvature="gauss_newton")),
        "gradient by x0": least(10 * rounds, lambda: sensitivity.gradient("x0", by_xs, by_us)),
        "gradient by goal": least(10 * rounds, lambda: sensitivity.gradient("goal", by_xs, by_us)),
        "CasADi's gradient": least(rounds, theirs),
    }
    return {"problem": case.name, "error": error, "times": times}


def robot(name: str, model: condyle.Model, posture: np.ndarray, rounds: int) -> dict[str, Any]:
    """Returns times for a robot that moves to a posture, without a peer."""
    x0, n = np.r_[posture, np.zeros(model.nv)], 50
    rest = Cost("rest", 1.0, Residual.state(x0))
    knot = FreeDynamics(model, 0.02, [rest, Cost("effort", 1e-3, Residual.control(np.zeros(model.nv)))])
    moved = np.r_[posture + 0.3, np.zeros(model.nv)]
    problem = Problem(moved, [knot], [0] * n, FreeDynamics(model, None, [rest]))
    solver = Fddp(problem, max_iterations=200)
    xs = np.tile(moved, (n + 1, 1))
    solution = solver.solve(xs, problem.quasi_static(xs))
    if solution.status != "converged":
        raise RuntimeError(f"{name}: the solution has the status {solution.status}")
    by_xs, by_us = np.ones((n + 1, 2 * model.nv)), np.ones((n, model.nv))
    kinds = {kind: Sensitivity(solver, curvature=kind) for kind in ("exact", "dynamics", "gauss_newton")}
    times = {"iteration": solution.timings.total / len(solution.trace)}
    for kind, sensitivity in kinds.items():
        times[f"create, {kind}"] = least(rounds, lambda kind=kind: Sensitivity(solver, curvature=kind))
        times["gradient by x0"] = least(10 * rounds, lambda of=sensitivity: of.gradient("x0", by_xs, by_us))
    sensitivity = kinds["exact"]
    sensitivity.gradient("target/rest", by_xs, by_us)
    times["gradient by target"] = least(10 * rounds, lambda: sensitivity.gradient("target/rest", by_xs, by_us))
    return {"problem": name, "error": 0.0, "times": times}


def many(name: str, model: condyle.Model, posture: np.ndarray, rounds: int) -> dict[str, Any]:
    """Returns times of the gradients of many problems of a robot, for each problem, and their largest difference."""
    x0, n, nv = np.r_[posture, np.zeros(model.nv)], 50, model.nv
    rest = Cost("rest", 1.0, Residual.state(x0))
    effort, end = Cost("effort", 1e-3, Residual.control(np.zeros(nv))), FreeDynamics(model, None, [rest])
    names, generator, each = ["x0", "target/rest"], np.random.default_rng(1), []
    for _ in range(MANY):
        moved = np.r_[posture + generator.uniform(-0.3, 0.3, nv), np.zeros(nv)]
        problem = Problem(moved, [FreeDynamics(model, 0.02, [rest, effort])], [0] * n, end)
        solver, xs = Fddp(problem, max_iterations=200), np.tile(moved, (n + 1, 1))
        status = solver.solve(xs, problem.quasi_static(xs)).status
        if status != "converged":
            raise RuntimeError(f"{name}: a solution has the status {status}")
        each.append(Sensitivity(solver, curvature="gauss_newton").prepare(names))
    by_xs, by_us = generator.standard_normal((MANY, n + 1, 2 * nv)), generator.standard_normal((MANY, n, nv))
    together = Sensitivities(each)

    def one_by_one(names: list[str]) -> list[Any]:
        return [of.gradients(names, x, u) for of, x, u in zip(each, by_xs, by_us, strict=True)]

    found = zip(together.gradients(names, by_xs, by_us), zip(*one_by_one(names), strict=True), strict=True)
    error = max(float(np.abs(ours - np.vstack(alone)).max() / np.abs(ours).max()) for ours, alone in found)
    times = {"create in lanes": least(rounds, lambda: Sensitivities(each)) / MANY}
    for label, some in (("x0", names[:1]), ("x0 and target", names)):
        times[f"one by one, {label}"] = least(rounds, lambda some=some: one_by_one(some)) / MANY
        times[f"in lanes, {label}"] = least(rounds, lambda some=some: together.gradients(some, by_xs, by_us)) / MANY
    return {"problem": f"{MANY} problems of an {name}", "error": error, "times": times}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20, help="number of measurements of each time")
    parser.add_argument("--json", action="store_true", help="prints JSON")
    arguments = parser.parse_args()
    results = [compare(case, arguments.rounds) for case in (cartpole(), chain())]
    arm = condyle.robots.arm7()
    posture = np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])
    results += [kind("arm of 7 joints", arm, posture, arguments.rounds) for kind in (robot, many)]
    if arguments.json:
        print(json.dumps(results, indent=1))
        return
    for result in results:
        print(result["problem"] + (f": gradients differ by {result['error']:.1e}" if result["error"] else ""))
        for name, seconds in result["times"].items():
            print(f"  {name:22} {1e6 * seconds:10.1f} us")
    if any(result["error"] > TOLERANCE for result in results):
        raise SystemExit(f"expected gradients that differ by at most {TOLERANCE}")


if __name__ == "__main__":
    main()
