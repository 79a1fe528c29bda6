#!/usr/bin/env python3
"""Measures a problem as a layer of PyTorch and of JAX, against the library's own calls, problem by problem.

    python benches/peers/layer.py              # 32 problems of an arm with 7 joints and 50 knots
    python benches/peers/layer.py --check      # few problems: shows that the script runs

Needs `torch` and `jax`; a missing framework is left out. A batch has targets of its own; some controls are at their
bounds. `solve` is a call from the last solutions after all targets have moved by 2 mm. `gradient` is the derivative of
a loss on all states and controls with respect to the targets, for each curvature. `Library` are the same solves by
`Fddp`, then `Sensitivity` and its gradient. Times are in ms per problem, on one thread, the smallest of several runs.
"""

import argparse
import importlib.util
import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import numpy as np

import condyle
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivity

KNOTS = 50
CURVATURES = ("exact", "dynamics", "gauss_newton")
TIGHT = {
    **{"max_iterations": 300, "tolerance": 1e-20, "tolerance_bounded": 1e-20, "flat": 1e-6},
    **{"second_order": True, "regularisation_start": 1e-3},
}
"""The default settings of a layer."""
Times = tuple[float, list[float]]


def reach() -> Problem:
    """Returns the problem of an arm that reaches for a point with bounded efforts."""
    arm = condyle.robots.arm7()
    x0 = np.r_[0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2, np.zeros(7)]
    rest, effort = Cost("rest", 0.2, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    goal = Cost("reach", 20.0, Residual.frame_translation(arm, "tool", [0.3, 0.3, 0.5]))
    bounds = {"lower": np.full(7, -24.0), "upper": np.full(7, 24.0)}
    knot = FreeDynamics(arm, 0.02, [rest, effort, goal], **bounds)
    return Problem(x0, [knot], [0] * KNOTS, FreeDynamics(arm, None, [rest, goal]))


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = call()
    return time.perf_counter() - start, result


def library(goals: Any) -> Times:
    """Returns the times (s) of the solves, and of the gradients for each curvature."""
    problem = reach()
    first, solver = Fddp(problem, max_iterations=500, flat=1e-6), Fddp(problem, **TIGHT)
    xs = np.tile(problem.x0, (KNOTS + 1, 1))
    solve, gradients = 0.0, [0.0] * len(CURVATURES)
    for goal in goals:
        problem.set_references("reach", np.tile(goal, (KNOTS + 1, 1)))
        near = first.solve(xs, problem.quasi_static(xs))
        last = solver.solve(near.xs, near.us)
        problem.set_references("reach", np.tile(goal + 0.002, (KNOTS + 1, 1)))
        taken, last = timed(lambda last=last: solver.solve(last.xs, last.us))
        solve += taken
        for k, curvature in enumerate(CURVATURES):
            taken, _ = timed(
                lambda c=curvature, s=last: Sensitivity(solver, curvature=c).gradient(
                    "target/reach", 2 * s.xs, 2 * s.us
                )
            )
            gradients[k] += taken
    return solve, gradients


def in_torch(goals: Any) -> Times:
    import torch

    from condyle.torch import ProblemLayer

    torch.set_num_threads(1)
    gradients = []
    for curvature in CURVATURES:
        layer = ProblemLayer(reach(), ["target/reach"], curvature=curvature)
        layer(torch.tensor(goals))
        moved = torch.tensor(goals + 0.002, requires_grad=True)
        solve, (xs, us) = timed(lambda layer=layer, moved=moved: layer(moved))
        loss = xs.square().sum() + us.square().sum()
        gradients.append(timed(loss.backward)[0])
    return solve, gradients


def in_jax(goals: Any) -> Times:
    import jax
    import jax.numpy as jnp

    from condyle.jax import ProblemLayer

    jax.config.update("jax_enable_x64", True)
    gradients = []
    for curvature in CURVATURES:
        layer = ProblemLayer(reach(), ["target/reach"], curvature=curvature)
        jax.block_until_ready(layer(jnp.asarray(goals)))
        moved = jnp.asarray(goals + 0.002)
        solve, (solution, pull) = timed(
            lambda layer=layer, moved=moved: jax.block_until_ready(jax.vjp(lambda goals: layer(goals), moved))
        )
        slopes = tuple(2 * a for a in solution)
        jax.block_until_ready(slopes)
        gradients.append(timed(lambda pull=pull, slopes=slopes: jax.block_until_ready(pull(slopes)))[0])
    return solve, gradients


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="few problems and runs")
    problems, repeats = (2, 1) if parser.parse_args().check else (32, 3)
    goals = np.array([0.3, 0.3, 0.5]) + 0.03 * np.random.default_rng(0).standard_normal((problems, 3))
    calls = {"Library": library}
    for name, package, call in (("PyTorch", "torch", in_torch), ("JAX", "jax", in_jax)):
        if importlib.util.find_spec(package):
            calls[name] = call
    print(f"| {problems} problems, ms per problem | solve | {' | '.join(f'gradient, {c}' for c in CURVATURES)} |")
    print("| --- " * (2 + len(CURVATURES)) + "|")
    for name, call in calls.items():
        runs = [call(goals) for _ in range(repeats)]
        best = [min(run[0] for run in runs)] + [min(run[1][k] for run in runs) for k in range(len(CURVATURES))]
        print(f"| {name} | {' | '.join(f'{1e3 * seconds / problems:.2f}' for seconds in best)} |")


if __name__ == "__main__":
    main()
