"""Tests of `condyle.ik`: arguments, results, messages, and the example for arms with degrees."""

import copy
import importlib.util
import pickle
import threading
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import condyle
from condyle.distances import Geometry, Shape
from condyle.ik import DifferentialIk, DistanceLimits, GlobalIk, JointLimits, Targets, Task

ARM = condyle.robots.arm7()
Q = np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])


def tool(q: np.ndarray) -> np.ndarray:
    """Returns the pose of the tool."""
    return condyle.frame_placement(ARM, condyle.Data(ARM), q, "tool")


def test_steps_reach_the_target_within_limits() -> None:
    ik = DifferentialIk(ARM, [Task.pose("tool"), Task.posture()], dt=0.01)
    targets, q = ik.hold(Q), Q.copy()
    targets.frames[0, :3, 3] += [0.0, 0.1, 0.05]
    for _ in range(200):
        step = ik.step(q, targets)
        assert step.status == "solved"
        assert (np.abs(step.v) <= ARM.limits.velocity + 1e-12).all()
        q = condyle.integrate(ARM, q, 0.01 * step.v)
        assert (ARM.limits.lower <= q).all()
        assert (q <= ARM.limits.upper).all()
    assert np.allclose(tool(q), targets.frames[0], atol=1e-4)
    again, steps, errors = ik.converge(Q, targets)
    assert steps > 1
    assert errors[0, 0] < 1e-4
    assert np.allclose(tool(again), targets.frames[0], atol=2e-3)


def test_every_constructor_of_tasks() -> None:
    names = ARM.names[1:]
    tasks = [
        Task.pose("tool", weight=2.0),
        Task.position("tool", factors=[1, 0, 1], priority=1),
        Task.orientation("tool", gain=0.5, priority=1),
        Task.relative_pose("tool", names[0], priority=2),
        Task.com(damping=0.1, priority=2),
        Task.posture(factors=np.ones(7), priority=2),
        Task.rest(),
        Task.manipulability("tool", priority=2),
        Task.coupling([(names[1], 1.0), (names[2], -1.0)], 0.1, priority=2),
    ]
    ik = DifferentialIk(ARM, tasks, limits=None)
    targets = ik.hold(Q)
    assert targets.frames.shape == (4, 4, 4)
    step = ik.step(Q, targets, v0=np.zeros(7))
    assert step.v.shape == (7,)
    assert step.errors.shape == (9, 2)
    assert pickle.loads(pickle.dumps(tasks)) is not None
    assert np.array_equal(pickle.loads(pickle.dumps(targets)).frames, targets.frames)
    assert np.array_equal(copy.deepcopy(targets).posture, targets.posture)


def test_limits_and_distances_hold_back() -> None:
    slow = JointLimits(velocity=np.full(7, 0.1))
    ik = DifferentialIk(ARM, [Task.pose("tool")], limits=slow)
    targets = ik.hold(Q)
    targets.frames[0, 2, 3] -= 0.3
    step = ik.step(Q, targets)
    assert np.abs(step.v).max() <= 0.1 + 1e-12
    assert "limit of the velocity of joint" in ik.describe(step.held[0])
    ball = Geometry(Shape.sphere([0, 0, 0], 0.05), name="ball")
    pairs = [(Geometry(Shape.sphere([0, 0, 0], 0.05), "tool", name="hand"), ball)]
    ik = DifferentialIk(ARM, [Task.position("tool")], distances=DistanceLimits(pairs))
    targets = ik.hold(Q)
    placement = tool(Q)
    placement[2, 3] -= 0.12
    ik.place("ball", placement)
    targets.frames[0, 2, 3] -= 0.1
    step = ik.step(Q, targets)
    assert ("pair", 0) in step.held
    assert ik.describe(("pair", 0)) == "distance of `hand` and `ball`"
    assert ik.nearest == (0, pytest.approx(0.02))
    with pytest.raises(ValueError, match="no geometry is named 'box'"):
        ik.place("box", placement)


def test_searches_reach_many_targets() -> None:
    seeds = np.array([condyle.random_configuration(ARM, seed) for seed in range(300)])
    poses = np.array([tool(q) for q in seeds])
    search = GlobalIk(ARM, "tool", threads=2)
    answers = search.solve_many(poses)
    assert answers.reached.all()
    assert answers.held == [()] * 300
    assert (answers.error < [1e-4, 1e-3]).all()
    for q, pose in zip(answers.q[:20], poses, strict=False):
        assert np.allclose(tool(q), pose, atol=2e-3)
    one = search.solve(poses[7])
    assert np.array_equal(one.q, answers.q[7])
    assert one.reached is True
    assert np.array_equal(search.solve_many(poses[:, None]).q, answers.q)


def test_unreachable_targets_say_what_holds() -> None:
    far = np.eye(4)
    far[:3, 3] = 2.0, 0.0, 0.5
    answer = GlobalIk(ARM, "tool", orientation_weight=0.0, starts=5).solve(far)
    assert not answer.reached
    assert answer.error[0] > 0.5
    tight = GlobalIk(ARM, "tool", lower=Q - 0.05, upper=Q + 0.05, starts=5)
    answer = tight.solve(tool(Q + 0.3), Q)
    assert any("limit of joint" in text for text in answer.held)
    assert (np.abs(answer.q - Q) <= 0.05 + 1e-12).all()


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(condyle.ModelError, match="tol"):
        DifferentialIk(ARM, [Task.pose("tol")])
    with pytest.raises(ValueError, match="task `tool`: gain is 2"):
        DifferentialIk(ARM, [Task.pose("tool", gain=2.0)])
    with pytest.raises(ValueError, match="'pos' is not a kind of task"):
        DifferentialIk(ARM, [Task("pos")])
    with pytest.raises(ValueError, match="frame: expected a name, found None"):
        DifferentialIk(ARM, [Task("pose")])
    with pytest.raises(ValueError, match="setting `dt` is 0"):
        DifferentialIk(ARM, [], dt=0.0)
    with pytest.raises(ValueError, match="limits.velocity"):
        DifferentialIk(ARM, [], limits=JointLimits(velocity=[1.0]))
    ik = DifferentialIk(ARM, [Task.pose("tool")])
    targets = ik.hold(Q)
    with pytest.raises(ValueError, match="q"):
        ik.step(Q[:6], targets)
    with pytest.raises(ValueError, match=r"v0\[0\]` is nan|v0"):
        ik.step(Q, targets, v0=np.full(7, np.nan))
    with pytest.raises(ValueError, match="targets.frames"):
        ik.step(Q, Targets(np.zeros((0, 4, 4)), np.zeros(3), Q))
    with pytest.raises(ValueError, match="no rotation"):
        ik.step(Q, Targets(np.diag([2.0, 1.0, 1.0, 1.0])[None], np.zeros(3), Q))
    with pytest.raises(ValueError, match="'best'"):
        GlobalIk(ARM, "tool", rank="best")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="setting `starts` is 0"):
        GlobalIk(ARM, "tool", starts=0)
    search = GlobalIk(ARM, "tool")
    with pytest.raises(ValueError, match=r"targets: expected shape \(n, 1, 4, 4\), found \(2, 3\)"):
        search.solve_many(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="target: expected 1 poses, found 2"):
        search.solve(np.array([np.eye(4)] * 2))
    with pytest.raises(ValueError, match=r"targets\[.*nan|NaN"):
        search.solve(np.full((4, 4), np.nan))


def test_wrong_placements_are_refused() -> None:
    hand, ball = Geometry(Shape.sphere([0.0] * 3, 0.04), "tool"), Geometry(Shape.sphere([0.0] * 3, 0.05), name="ball")
    ik = DifferentialIk(ARM, [Task.posture()], distances=DistanceLimits([(hand, ball)]))
    search, nowhere = GlobalIk(ARM, "tool", pairs=[(hand, ball)]), np.eye(4)
    nowhere[:3, 3] = np.nan
    for place in (ik.place, search.place):
        for wrong in (nowhere, np.diag([2.0, 2.0, 2.0, 1.0])):
            with pytest.raises(ValueError, match="placement: expected a rotation and a finite translation"):
                place("ball", wrong)
        place("ball", np.eye(4))
    with pytest.raises(ValueError, match="radius of a sphere: expected finite numbers, found nan"):
        DifferentialIk(ARM, [], distances=DistanceLimits([(hand, Geometry(Shape.sphere([0.0] * 3, np.nan)))]))


def test_threads_may_search_at_once() -> None:
    search = GlobalIk(ARM, "tool")
    poses = np.array([tool(condyle.random_configuration(ARM, seed)) for seed in range(50)])
    expected, found = search.solve_many(poses).q, []

    def run() -> None:
        found.append(GlobalIk(ARM, "tool").solve_many(poses).q)

    workers = [threading.Thread(target=run) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(found) == 4
    assert all(np.array_equal(q, expected) for q in found)


def example() -> ModuleType:
    """Imports the example `so_arm.py`."""
    path = Path(__file__).parents[1] / "examples" / "so_arm.py"
    spec = importlib.util.spec_from_file_location("so_arm", path)
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_an_arm_with_five_joints_in_degrees(tmp_path: Path) -> None:
    module = example()
    path = tmp_path / "arm.urdf"
    path.write_text(module.ARM)
    arm = module.Kinematics(path, "gripper_frame")
    assert len(arm.joint_names) == 5
    rng = np.random.default_rng(0)
    for _ in range(20):
        joints, start = (np.append(rng.uniform(-60.0, 60.0, 5), 30.0) for _ in range(2))
        pose = arm.forward_kinematics(joints)
        start[:5] = joints[:5] + rng.uniform(-10.0, 10.0, 5)
        found = arm.inverse_kinematics(start, pose)
        assert found[5] == 30.0  # the gripper
        assert np.allclose(arm.forward_kinematics(found), pose, atol=5e-3)
    # A rotation that five joints cannot reach: the position has the larger weight.
    pose[:3, :3] = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    found = arm.inverse_kinematics(joints, pose, position_weight=1.0, orientation_weight=1e-4)
    assert np.linalg.norm(arm.forward_kinematics(found)[:3, 3] - pose[:3, 3]) < 5e-3
    # Joints in another order have their numbers in that order.
    turned = module.Kinematics(path, "gripper_frame", arm.joint_names[::-1])
    assert np.allclose(turned.forward_kinematics(joints[4::-1]), arm.forward_kinematics(joints))
