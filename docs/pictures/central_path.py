#!/usr/bin/env python3
"""Makes docs/pictures/central_path.png: the central path of a cart-pole, and the residuals of the iterations of an
interior point. Then prints two tables: one compares solvers, the other compares ticks with converged solves.

.venv/pinocchio/bin/python docs/pictures/central_path.py [--no-table]

The picture uses the functions and results of docs/interior_point.md. It contains no times, so it is equal on all
machines, up to rounding. The tables have times of one thread: run the program on an idle core.
"""

import argparse
import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import condyle
from condyle.optimal import (
    AugmentedLagrangian,
    ContactDynamics,
    Cost,
    FreeDynamics,
    FrictionCone,
    InteriorPoint,
    Limit,
    Problem,
    Residual,
    Solution,
)

Case = tuple[Problem, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Problem, its warm start (states and controls), and the standard deviations by which both are perturbed."""
STARTS, ROUNDS = 20, 5
"""Number of perturbed starts, and number of solves from each start, of which the fastest counts."""
FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]


def page() -> dict[str, Any]:
    """Returns the functions and variables that the blocks of docs/interior_point.md define."""
    spec = importlib.util.spec_from_file_location("run", Path(__file__).parents[1] / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    names: dict[str, Any] = module.run("interior_point.md")
    return names


def draw(book: dict[str, Any]) -> None:
    """Writes the picture."""
    dt, force, rail = book["dt"], book["force"], book["rail"]
    figure, axes = plt.subplots(1, 4, figsize=(15.0, 3.6), layout="constrained")
    colours = plt.get_cmap("viridis")(np.linspace(0.85, 0.0, len(book["path"])))
    for (mu, (xs, us)), colour in zip(sorted(book["path"].items(), reverse=True), colours, strict=True):
        times = dt * np.arange(len(xs))
        axes[0].step(times[:-1], us[:, 0], where="post", color=colour, label=f"μ = {mu:.0e}")
        axes[1].plot(times, xs[:, 0], color=colour)
        axes[2].plot(times, xs[:, 1], color=colour)
    for axis, bound in ((axes[0], force), (axes[1], rail)):
        for sign in (-1.0, 1.0):
            axis.axhline(sign * bound, color="C3", linestyle="--", linewidth=1)
    axes[2].axhline(np.pi, color="C3", linestyle="--", linewidth=1)
    axes[0].legend(fontsize=7)
    for second_order, kind in ((False, "Gauss–Newton"), (True, "second_order")):
        solver = InteriorPoint(book["swing_up"]([book["effort"]], book["limits"]), second_order=second_order)
        axes[3].semilogy([step.stop for step in solver.solve(*book["start"]).trace], label=kind)
    axes[3].legend(fontsize=7)
    titles = ["Force (N)", "Position of the cart (m)", "Angle of the pole (rad)", "Largest residual of the solver"]
    for axis, title in zip(axes, titles, strict=True):
        axis.set(title=title, xlabel="iteration" if axis is axes[3] else "time (s)")
        axis.grid(alpha=0.3)
    figure.savefig(Path(__file__).with_name("central_path.png"), dpi=100)


def arm() -> Case:
    """Returns an arm that reaches a point and stops there, with limits on efforts and velocities."""
    robot, x0 = condyle.robots.arm7(), np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    weak, fast = np.full(7, 30.0), np.r_[np.full(7, np.inf), np.full(7, 1.5)]
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    limits = [
        Limit("weak", Residual.control(np.zeros(7)), -weak, weak),
        Limit("fast", Residual.state(np.zeros(14)), -fast, fast),
    ]
    stop = np.r_[np.full(7, np.inf), np.zeros(7)]
    ends = [
        Limit("reach", Residual.frame_translation(robot, "tool", [0.35, 0.2, 0.6])),
        Limit("stop", Residual.state(np.zeros(14)), -stop, stop),
    ]
    knot = FreeDynamics(robot, 0.02, costs, limits=limits)
    problem = Problem(x0, [knot], [0] * 30, FreeDynamics(robot, None, [], limits=ends))
    us = np.tile(knot.quasi_static(x0), (30, 1))
    return problem, np.tile(x0, (31, 1)), us, np.full(14, 0.05), np.full(7, 2.0)


def quadruped() -> Case:
    """Returns a quadruped that moves its centre of mass over four feet, with friction cones and limits on efforts."""
    robot = condyle.robots.quadruped()
    q = condyle.neutral(robot)
    q[8::3], q[9::3] = 0.7, -1.4
    x0 = np.r_[q, np.zeros(18)]
    feet = {f: condyle.ContactConstraint(f, "point", reference="local_world_aligned", kd=20.0) for f in FEET}
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(12)))]
    grips = [Limit(foot, Residual.friction_cone(foot, FrictionCone(0.25, least=5.0))) for foot in FEET]
    grips.append(Limit("weak", Residual.control(np.zeros(12)), np.full(12, -25.0), np.full(12, 25.0)))
    goal = condyle.centroidal_map(robot, condyle.Data(robot), q).com + np.array([0.06, 0.01, -0.01])
    knot = ContactDynamics(robot, feet, 0.02, costs, limits=grips)
    ahead = Limit("ahead", Residual.center_of_mass(goal))
    problem = Problem(x0, [knot], [0] * 20, FreeDynamics(robot, None, [], limits=[ahead]))
    spread = np.r_[np.full(3, 0.02), np.zeros(4), np.full(30, 0.02)]
    return problem, np.tile(x0, (21, 1)), np.tile(knot.quasi_static(x0), (20, 1)), spread, np.full(12, 0.5)


def measure(name: str, case: Case) -> None:
    """Prints the row of a problem: solves that converge, median iterations, and median times (ms)."""
    problem, start, controls, spread_x, spread_u = case
    columns = [name]
    for make in (
        lambda: InteriorPoint(problem),
        lambda: AugmentedLagrangian(problem, inner={"max_iterations": 200}),
    ):
        iterations, times = [], []
        for seed in range(STARTS + 1):
            random, factor = np.random.default_rng(seed), float(seed > 0)
            xs, us = start.copy(), controls + factor * spread_u * random.normal(size=controls.shape)
            xs[1:] += factor * spread_x * random.normal(size=xs[1:].shape)
            fastest = np.inf
            for _ in range(ROUNDS):
                solver = make()
                begin = time.thread_time()
                solution = solver.solve(xs, us)
                fastest = min(fastest, time.thread_time() - begin)
            if solution.status == "converged":
                iterations.append(solver.outcome.iterations)
                times.append(1e3 * fastest)
        columns += [f"{len(times)} of {STARTS + 1}", f"{np.median(iterations):.0f}", f"{np.median(times):.1f}"]
    print("| " + " | ".join(columns) + " |")


def measure_ticks(book: dict[str, Any]) -> None:
    """Prints, for ticks and for converged solves: the cost of the forces, and the median time of a period (ms)."""
    replans: dict[str, Callable[[InteriorPoint], Solution]] = {
        "`tick(1)`": lambda solver: solver.tick(1),
        "`tick(2)`": lambda solver: solver.tick(2),
        "`resume`": lambda solver: solver.resume(),
    }
    for name, replan in replans.items():
        times: list[float] = []

        def timed(solver: InteriorPoint, replan: Callable = replan, times: list[float] = times) -> Solution:
            begin = time.thread_time()
            plan = replan(solver)
            times.append(1e3 * (time.thread_time() - begin))
            return plan

        forces, _ = book["control"](timed)
        cost = book["dt"] * 0.5e-2 * np.sum(forces**2)
        print(f"| {name} | {cost:.3f} | {np.median(times):.2f} | {np.max(times):.2f} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--no-table", action="store_true", help="make only the picture")
    arguments = parser.parse_args()
    book = page()
    draw(book)
    if not arguments.no_table:
        measure("arm", arm())
        problem = book["swing_up"]([book["effort"]], book["limits"])
        measure("cart-pole", (problem, *book["start"], np.full(4, 0.2), np.full(1, 1.8)))
        measure("quadruped", quadruped())
        measure_ticks(book)


if __name__ == "__main__":
    main()
