#!/usr/bin/env python3
"""Times inverse kinematics of Condyle, Pink and a damped least-squares loop on Pinocchio, in one run.

    python3 benches/peers/ik.py [--targets N] [--json]

Needs an environment with condyle, pin-pink, pin, quadprog and example-robot-data, on one core. Two parts:

- a step: velocities of a Panda and of a G1 for poses of frames, the centre of mass and a posture, under limits of
  positions and velocities. Condyle and Pink solve the same programs, and the script prints their largest difference.
  Condyle is also timed with 50 pairs of capsules of the G1. Pink cannot take these pairs, because it reads meshes.
- targets: poses of random configurations of a Panda within its limits and without self-collision. Condyle searches
  postures that keep the links apart. Pink and the loop on Pinocchio make steps from the neutral posture and then from
  random postures, up to the same number of starts; they run on fewer targets, and their links may collide.

Each time is the median of rounds.
"""

import argparse
import json
import statistics
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pink
import pinocchio as pin
from pink.limits import ConfigurationLimit, VelocityLimit
from pink.tasks import ComTask, DampingTask, FrameTask, PostureTask

import condyle
from condyle import wholebody
from condyle.distances import Geometry, Shape
from condyle.ik import DifferentialIk, DistanceLimits, GlobalIk, Task

DT, DAMPING, STARTS = 0.01, 1e-8, 20
TOLERANCE = (1e-4, 1e-3)
LINKS = [f"panda_link{k}" for k in range(8)] + ["panda_hand"]
LIMBS = {
    "left": ["hip_yaw_link", "knee_link", "ankle_roll_link", "elbow_link", "wrist_roll_link", "rubber_hand"],
    "right": ["hip_yaw_link", "knee_link", "ankle_roll_link", "elbow_link", "wrist_roll_link", "rubber_hand"],
}


def robots() -> Path:
    """Returns the folder of the robots of example-robot-data."""
    folders = [Path(place) / "cmeel.prefix" / "share" / "example-robot-data" / "robots" for place in sys.path]
    found = [folder for folder in folders if folder.is_dir()]
    if not found:
        raise SystemExit("the package example-robot-data is not installed")
    return found[0]


def median_time(run: Callable[[], Any], rounds: int = 7) -> float:
    """Returns the median duration of a call in several rounds (s)."""
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def near(model: condyle.Model, seed: int, way: float) -> Any:
    """Returns a position on the way to a random position, from neutral or, outside of the limits, from mid-range."""
    start, (lower, upper) = condyle.neutral(model), (model.limits.lower, model.limits.upper)
    outside = (start < lower) | (start > upper)
    start[outside] = 0.5 * (lower + upper)[outside]
    return condyle.interpolate(model, start, condyle.random_configuration(model, seed), way)


def capsules(frames: list[str], end: tuple[float, float, float]) -> list[Geometry]:
    """Returns a capsule on each frame."""
    shape = Shape.capsule([0.0, 0.0, 0.0], end, 0.05)
    return [Geometry(shape, frame, name=frame) for frame in frames]


def step(name: str, urdf: Path, frames: list[str], floating: bool) -> dict[str, float]:
    """Times one step of a robot."""
    base = pin.JointModelFreeFlyer() if floating else None
    theirs = pin.buildModelFromUrdf(str(urdf), base) if floating else pin.buildModelFromUrdf(str(urdf))
    ours = condyle.Model.from_urdf(urdf, root_joint="free_flyer" if floating else None)
    data = theirs.createData()
    # Pink's costs are roots of weights.
    tasks = [Task.pose(frame, weight=1.0, damping=1e-3) for frame in frames]
    peers: list[Any] = [FrameTask(frame, 1.0, 1.0, lm_damping=1e-3) for frame in frames]
    if floating:
        tasks, peers = [*tasks, Task.com()], [*peers, ComTask(cost=1.0)]
    tasks += [Task.posture(weight=1e-4), Task.rest(weight=1e-6)]
    peers += [PostureTask(cost=1e-2), DampingTask(cost=1e-3)]
    ik = DifferentialIk(ours, tasks, dt=DT, damping=DAMPING)
    limits = [ConfigurationLimit(theirs), VelocityLimit(theirs)]
    cases = []
    for seed in range(20):
        q, goal = near(ours, 2 * seed, 0.2), near(ours, 2 * seed + 1, 0.2)
        targets = ik.hold(goal)
        targets.posture = q
        cases.append((q, targets))
    difference = 0.0
    spent = []
    for q, targets in cases:
        configuration = pink.Configuration(theirs, data, q)
        for task, pose in zip(peers, targets.frames, strict=False):
            task.set_target(pin.SE3(pose))
        for task in peers:
            if isinstance(task, ComTask):
                task.set_target(targets.com)
            elif isinstance(task, PostureTask) and not isinstance(task, DampingTask):
                task.set_target(targets.posture)
        begin = time.perf_counter()
        # An update is part of the step: Condyle computes the kinematics in its step too.
        configuration.update(q)
        v = pink.solve_ik(configuration, peers, DT, "quadprog", damping=DAMPING, limits=limits, safety_break=False)
        spent.append(time.perf_counter() - begin)
        difference = max(difference, float(np.abs(ik.step(q, targets).v - v).max() / (1.0 + np.abs(v).max())))

    def all_cases(solver: DifferentialIk) -> Callable[[], None]:
        def run() -> None:
            for q, targets in cases:
                solver.step(q, targets)

        return run

    found = {
        "condyle_us": 1e6 * median_time(all_cases(ik), 50) / len(cases),
        "pink_us": 1e6 * statistics.median(spent),
        "largest_difference": difference,
    }
    if floating:
        limbs = {side: capsules([f"{side}_{link}" for link in links], (0, 0, -0.12)) for side, links in LIMBS.items()}
        pairs = [(a, b) for a in limbs["left"] for b in limbs["right"]]
        torso = capsules(["torso_link"], (0, 0, 0.12))[0]
        pairs += [(torso, b) for b in (*limbs["left"], *limbs["right"])] + [
            (limbs[side][-1], limbs[side][1]) for side in limbs
        ]
        with_pairs = DifferentialIk(ours, tasks, dt=DT, damping=DAMPING, distances=DistanceLimits(pairs))
        found["pairs"] = len(pairs)
        found["condyle_with_pairs_us"] = 1e6 * median_time(all_cases(with_pairs), 50) / len(cases)
    return found


def two_solvers() -> dict[str, float]:
    """Times the same tasks of an arm as a step with limits that hold it, and as a tick of whole-body control."""
    arm, q = condyle.robots.arm7(), np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])
    ik = DifferentialIk(arm, [Task.pose("tool"), Task.posture()])
    tasks = [wholebody.Task.pose("tool"), wholebody.Task.posture()]
    controller = wholebody.WholeBodyController(arm, [], tasks)
    targets, references = ik.hold(q), controller.hold(q)
    targets.frames[0, :3, 3] += [0.0, 0.2, 0.1]
    references.frames[0].pose = targets.frames[0]
    return {
        "step_us": 1e6 * median_time(lambda: ik.step(q, targets), 2000),
        "tick_us": 1e6 * median_time(lambda: controller.step(q, np.zeros(7), references), 2000),
        "active_limits": len(ik.step(q, targets).held),
    }


def self_pairs() -> list[tuple[Geometry, Geometry]]:
    """Returns pairs of spheres on the links of a Panda that are not neighbours."""
    balls = [Geometry(Shape.sphere([0.0, 0.0, 0.0], 0.07), link, name=link) for link in LINKS]
    return [(balls[i], balls[j]) for i in range(len(balls)) for j in range(i + 4, len(balls))]


def targets_of_panda(urdf: Path, count: int) -> dict[str, Any]:
    """Searches postures for many targets."""
    ours, theirs = condyle.Model.from_urdf(urdf), pin.buildModelFromUrdf(str(urdf))
    frame, pairs = "panda_hand_tcp", self_pairs()
    prepared, data = condyle.distances.DistancePairs(ours, pairs), condyle.Data(ours)
    seeds = np.array([condyle.random_configuration(ours, seed) for seed in range(2 * count)])
    apart = condyle.distances.distances(prepared, ours, data, seeds, gradient=False).distance.min(axis=1) > 0.0
    seeds = seeds[apart][:count]
    poses = np.array([condyle.frame_placement(ours, data, q, frame) for q in seeds])
    ik = GlobalIk(ours, frame, pairs=pairs)
    begin = time.perf_counter()
    answers = ik.solve_many(poses)
    found: dict[str, Any] = {
        "targets": len(poses),
        "condyle_s": time.perf_counter() - begin,
        "condyle_reached": float(answers.reached.mean()),
    }
    some = poses[: min(len(poses), 200)]
    for name, solve in (("pinocchio_loop", least_squares(theirs, frame)), ("pink", pink_loop(theirs, frame))):
        begin = time.perf_counter()
        reached = [solve(pose, seed) for seed, pose in enumerate(some)]
        spent = time.perf_counter() - begin
        found[f"{name}_s_for_all"] = spent * len(poses) / len(some)
        found[f"{name}_reached"] = float(np.mean(reached))
    return found


def starts(model: Any, seed: int) -> Any:
    """Yields the neutral posture and random postures."""
    rng = np.random.default_rng(seed)
    yield pin.neutral(model).clip(model.lowerPositionLimit, model.upperPositionLimit)
    for _ in range(STARTS - 1):
        yield rng.uniform(model.lowerPositionLimit, model.upperPositionLimit)


def near_enough(error: Any) -> bool:
    """Returns whether an error (linear, angular) is within the tolerance."""
    return np.linalg.norm(error[:3]) < TOLERANCE[0] and np.linalg.norm(error[3:]) < TOLERANCE[1]


def least_squares(model: Any, name: str) -> Callable[[Any, int], bool]:
    """Returns a damped least-squares loop on Pinocchio, as in its documentation, with clipped positions."""
    data, frame = model.createData(), model.getFrameId(name)

    def solve(target: Any, seed: int) -> bool:
        goal = pin.SE3(target)
        for q in starts(model, seed):
            for _ in range(100):
                pin.framesForwardKinematics(model, data, q)
                error = pin.log(data.oMf[frame].actInv(goal)).vector
                if near_enough(error):
                    return True
                J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL)
                v = J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
                q = pin.integrate(model, q, v).clip(model.lowerPositionLimit, model.upperPositionLimit)
        return False

    return solve


def pink_loop(model: Any, name: str) -> Callable[[Any, int], bool]:
    """Returns a loop of Pink's steps."""
    data, task = model.createData(), FrameTask(name, 1.0, 1.0, lm_damping=0.01)
    limits = [ConfigurationLimit(model, config_limit_gain=1.0)]

    def solve(target: Any, seed: int) -> bool:
        task.set_target(pin.SE3(target))
        for q in starts(model, seed):
            configuration = pink.Configuration(model, data, q)
            for _ in range(50):
                if near_enough(task.compute_error(configuration)):
                    return True
                try:
                    v = pink.solve_ik(
                        configuration, [task], 1.0, "quadprog", damping=1e-6, limits=limits, safety_break=False
                    )
                except (pink.exceptions.PinkError, ValueError):
                    break
                configuration.integrate_inplace(v, 1.0)
        return False

    return solve


def main() -> None:
    """Runs both parts, and prints a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--targets", type=int, default=10_000)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    folder = robots()
    panda = folder / "panda_description" / "urdf" / "panda.urdf"
    g1 = folder / "g1_description" / "urdf" / "g1_29dof_rev_1_0.urdf"
    feet_and_hands = [f"{side}_{link}" for link in ("ankle_roll_link", "rubber_hand") for side in ("left", "right")]
    found = {
        "panda step": step("panda", panda, ["panda_hand_tcp"], False),
        "g1 step": step("g1", g1, [*feet_and_hands, "torso_link"], True),
        "two solvers": two_solvers(),
        "panda targets": targets_of_panda(panda, arguments.targets),
    }
    if arguments.json:
        print(json.dumps(found, indent=2))
        return
    for part, numbers in found.items():
        print(part)
        for key, value in numbers.items():
            print(f"  {key:26} {value:.4g}")


if __name__ == "__main__":
    main()
