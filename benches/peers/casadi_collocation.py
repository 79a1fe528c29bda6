#!/usr/bin/env python3
"""Optimises motions with IPOPT. The dynamics functions come from condyle.casadi, or are written as CasADi expressions.

    .venv/pinocchio/bin/python benches/peers/casadi_collocation.py [--rounds N] [--json] [PROBLEM ...]

The problems come from python/examples. With both sources of functions, the transcription is the same: the same
variables, constraints and sparsity. condyle.casadi gives the dynamics of all points as one function (`states=`); the
expressions use `Function.map`. The problems are `swing_up`, `reach` (of Condyle's arm) and `jump`. In `reach_panda` and
`reach_talos` (with a fixed pelvis), robots from example-robot-data reach for a pose. For each problem the program
prints the processor time of a solve (the least of the rounds), and the fraction of this time in the problem's
functions. It also prints the iterations, the cost, and the time to build the expressions. The expressions run in
CasADi's own virtual machine, as pinocchio.casadi's expressions do.

The time outside of the functions belongs to IPOPT and its linear solver, and does not depend on the source of the
functions. So faster functions cannot reduce this time. For an arm of two links (`swing_up`), this time is 0.42 of the
time of a solve with expressions.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import casadi
import numpy as np
from casadi_expressions import Expressions

import condyle
import condyle.casadi

sys.path.append(str(Path(__file__).resolve().parents[2] / "python" / "examples"))
import casadi_jump as jump
import casadi_reach as reach
import casadi_swing_up as swing_up

Transcription = Callable[[], tuple[casadi.Opti, dict[str, casadi.MX]]]
SETTINGS = {"print_level": 0, "sb": "yes", "max_iter": 500}
FUNCTIONS = ("f", "g", "grad_f", "jac_g", "hess_l")


def swing_ups() -> tuple[Transcription, Transcription]:
    arm = swing_up.two_links()
    return (
        lambda: swing_up.transcribe(condyle.casadi.aba(arm, states=swing_up.POINTS)),
        lambda: swing_up.transcribe(Expressions(arm).aba().map(swing_up.POINTS)),
    )


def reaches(
    model: condyle.Model, frame: str, start: np.ndarray, target: np.ndarray
) -> tuple[Transcription, Transcription]:
    def ours() -> tuple[casadi.Opti, dict[str, casadi.MX]]:
        placement = condyle.casadi.forward_kinematics(model, frame)
        return reach.transcribe(model, condyle.casadi.rnea(model, states=reach.KNOTS), placement, start, target)

    def theirs() -> tuple[casadi.Opti, dict[str, casadi.MX]]:
        expressions = Expressions(model)
        dynamics = expressions.rnea().map(reach.KNOTS)
        return reach.transcribe(model, dynamics, expressions.forward_kinematics(frame), start, target)

    return ours, theirs


def reaches_of(name: str, frame: str, locked: list[str]) -> tuple[Transcription, Transcription]:
    """Builds a motion of a robot with a fixed base. The motion begins at the middle of the joints' ranges. Its target
    is the position that a frame has after each joint has moved towards its upper limit."""
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    loader = ROBOTS[name]
    path = os.path.join(loader.path, loader.urdf_subpath, loader.urdf_filename)
    model = condyle.Model.from_urdf(os.path.join(getModelPath(path), path))
    if locked:
        model = model.lock(locked, condyle.neutral(model))
    lower, upper = np.maximum(model.limits.lower, -0.5), np.minimum(model.limits.upper, 0.5)
    start = np.where(lower < upper, (lower + upper) / 2, np.clip(0.0, model.limits.lower, model.limits.upper))
    ranges = np.clip(model.limits.upper - start, 0.0, 0.6)
    target = condyle.frame_placement(model, condyle.Data(model), start + 0.5 * ranges, frame)[:3, 3]
    return reaches(model, frame, start, target)


def jumps() -> tuple[Transcription, Transcription]:
    robot = condyle.robots.quadruped()
    standing, functions = jump.standing_on_the_ground(robot), condyle.casadi

    def ours() -> tuple[casadi.Opti, dict[str, casadi.MX]]:
        stance = functions.constrained_dynamics(robot, jump.contacts())
        feet = [
            (functions.forward_kinematics(robot, foot), functions.frame_velocity(robot, foot)) for foot in jump.FEET
        ]
        return jump.transcribe(robot, standing, stance, functions.aba(robot), feet)

    def theirs() -> tuple[casadi.Opti, dict[str, casadi.MX]]:
        written = Expressions(robot)
        stance = written.constrained_dynamics(list(jump.FEET), jump.contacts()[0].kd)
        feet = [(written.forward_kinematics(foot), written.frame_velocity(foot)) for foot in jump.FEET]
        return jump.transcribe(robot, standing, stance, written.aba(), feet)

    return ours, theirs


PROBLEMS: dict[str, Callable[[], tuple[Transcription, Transcription]]] = {
    "swing_up": swing_ups,
    "reach": lambda: reaches(
        condyle.robots.arm7(), "tool", np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0]), np.array([0.45, -0.3, 0.35])
    ),
    "reach_panda": lambda: reaches_of("panda", "panda_hand_tcp", ["panda_finger_joint1", "panda_finger_joint2"]),
    "reach_talos": lambda: reaches_of("talos", "gripper_left_base_link", []),
    "jump": jumps,
}


def solve(transcription: Transcription, rounds: int) -> dict[str, float]:
    """Returns the figures of a problem, in seconds of processor time; only `build_s` is wall time."""
    begin = time.perf_counter()
    opti, _ = transcription()
    opti.solver("ipopt", {"print_time": False, "record_time": True}, SETTINGS)
    found: dict[str, float] = {}
    for one in range(rounds):
        solution = opti.solve()  # each solve starts from the same initial guess
        stats = solution.stats()
        if one == 0:
            found["build_s"] = time.perf_counter() - begin - stats["t_wall_total"]
        seconds = {"solve_s": stats["t_proc_total"], "functions_s": sum(stats[f"t_proc_nlp_{k}"] for k in FUNCTIONS)}
        found |= {k: min(found.get(k, np.inf), x) for k, x in seconds.items()}
        found |= {"iterations": stats["iter_count"], "cost": float(solution.value(opti.f))}
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("problems", nargs="*", default=list(PROBLEMS), metavar="PROBLEM", help=", ".join(PROBLEMS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    for name in wanted.problems:
        ours, theirs = (solve(one, wanted.rounds) for one in PROBLEMS[name]())
        if wanted.json:
            print(json.dumps({"problem": name, "ours": ours, "expressions": theirs}), flush=True)
            continue
        print(f"{name}: a solve takes {ours['solve_s'] / theirs['solve_s']:.2f} of the expressions' time")
        for who, found in (("ours", ours), ("expressions", theirs)):
            print(
                f"    {who:12} {found['solve_s']:8.3f} s, of which functions {found['functions_s']:8.3f} s; "
                f"{found['iterations']:.0f} iterations, cost {found['cost']:.6f}; built in {found['build_s']:.1f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
