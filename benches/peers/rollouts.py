#!/usr/bin/env python3
"""Times rollouts of many control sequences, by `condyle.optimal.rollout_many` and by MuJoCo's module `rollout`.

    .venv/pinocchio/bin/python benches/peers/rollouts.py [--cpu K] [--rounds N] [--sequences B]

Both libraries simulate the same random efforts from the same state, on one core. The robots are a panda, which touches
nothing, and a Go2 that stands. Both use semi-implicit Euler steps of 2 ms. In Condyle, the feet of the Go2 are held at
four points of the ground. In MuJoCo, they are balls on a plane with friction, and its default solver finds the forces.
Rollouts of Condyle include the cost of the controls. Rounds alternate; a time is the median of all rounds.
"""

import argparse
import os
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

import condyle
from condyle import ContactConstraint
from condyle.optimal import ContactDynamics, Cost, FreeDynamics, Problem, Residual, rollout_many

sys.path.append(str(Path(__file__).parents[2] / "tests" / "peers" / "mujoco"))
from scenes import urdf
from world import World, bare

DT, KNOTS = 2e-3, 50
"""Duration of a time step (s), and number of steps of a rollout."""
FEET = ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]


def arm() -> tuple[Problem, np.ndarray, Any, np.ndarray]:
    """Returns the problem of a panda, the efforts that hold it, and its model and state in MuJoCo."""
    model = condyle.Model.from_urdf_str(urdf("panda"))
    q = np.array([0.0, -0.3, 0.0, -2.4, 0.0, 2.1, 0.785, 0.02, 0.02])
    effort = Cost("effort", 1e-4, Residual.control(np.zeros(model.nv)))
    knot = FreeDynamics(model, DT, [effort])
    problem = Problem(np.r_[q, np.zeros(9)], [knot], [0] * KNOTS, FreeDynamics(model, None, []))
    spec = mujoco.MjSpec.from_string(bare(urdf("panda"), free=False))
    return problem, knot.quasi_static(problem.x0), compiled(spec, model.names[1:]), np.r_[0.0, problem.x0]


def quadruped() -> tuple[Problem, np.ndarray, Any, np.ndarray]:
    """Returns the problem of a standing Go2, the efforts that hold it, and its model and state in MuJoCo."""
    world = World(urdf("go2"), FEET, 0.022, dt=DT)
    model, q = world.model, world.stand({"thigh": 0.85, "calf": -1.6})
    world.set_state(q, np.zeros(model.nv))
    contacts = {foot: ContactConstraint(foot, "point", None, "local_world_aligned", kd=50.0) for foot in FEET}
    effort = Cost("effort", 1e-4, Residual.control(np.zeros(12)))
    knot = ContactDynamics(model, contacts, DT, [effort])
    problem = Problem(np.r_[q, np.zeros(18)], [knot], [0] * KNOTS, FreeDynamics(model, None, []))
    state = np.r_[0.0, world.data.qpos, world.data.qvel]
    return problem, knot.quasi_static(problem.x0), compiled(world.spec, model.names[2:]), state


def compiled(spec: Any, joints: list[str]) -> Any:
    """Returns a model of MuJoCo whose joints have motors, in the order of Condyle's joints."""
    for joint in joints:
        spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spec.option.timestep, spec.option.integrator = DT, mujoco.mjtIntegrator.mjINT_EULER
    return spec.compile()


def row(name: str, robot: tuple[Problem, np.ndarray, Any, np.ndarray], sequences: int, rounds: int) -> str:
    """Returns the row of the table for a robot."""
    problem, hold, mj, state = robot
    us = hold + np.random.default_rng(0).normal(size=(sequences, KNOTS, len(hold)))
    data = mujoco.MjData(mj)
    calls = [
        lambda: rollout_many(problem, us),
        lambda: rollout_many(problem, us, gradients=True),
        lambda: rollout.rollout(mj, data, state, us),
    ]
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(rounds):
        for call, taken in zip(calls, times, strict=True):
            begin = time.perf_counter()
            call()
            taken.append(time.perf_counter() - begin)
    medians = [median(taken) for taken in times]
    rates = " | ".join(f"{sequences / seconds:.0f}" for seconds in medians)
    return f"| {name} | {rates} | {medians[0] / medians[2]:.2f} |"


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cpu", type=int, default=0, help="index of the core")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--sequences", type=int, default=1024)
    options = parser.parse_args()
    os.sched_setaffinity(0, {options.cpu})
    print(f"{options.sequences} sequences of {KNOTS} steps, level {condyle.LEVEL}")
    print("| robot | Condyle, rollouts/s | with gradients | MuJoCo, rollouts/s | ratio of times |")
    print("| --- | --- | --- | --- | --- |")
    for name, robot in {"panda": arm(), "go2": quadruped()}.items():
        print(row(name, robot, options.sequences, options.rounds), flush=True)


if __name__ == "__main__":
    main()
