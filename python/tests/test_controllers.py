"""Tests of `condyle.mpc`: a quadruped that walks, an arm that follows a path, and bad input."""

import threading
import time
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.distances import Geometry, Shape
from condyle.mpc import ArmMpc, ArmWeights, Foot, Gait, PlanLimits, Weights, WholeBodyMpc
from condyle.simulation import Ground, Simulation
from condyle.wholebody import ControllerError, FrictionContact, Gains, Settings, Task, WholeBodyController

QUADRUPED, ARM = condyle.robots.quadruped(), condyle.robots.arm7()
FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
STAND = np.r_[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]


def controller(gait: Gait | None = None, **settings: Any) -> WholeBodyMpc:
    feet = [Foot.point(foot, 0.6, 0.0) for foot in FEET]
    return WholeBodyMpc(QUADRUPED, feet, gait or Gait.trot(), **settings)


def pose() -> Any:
    return condyle.frame_placement(ARM, condyle.Data(ARM), REST[:7], "tool")


@pytest.mark.parametrize(("gait", "vx"), [(Gait.trot(), 0.4), (Gait.pace(), 0.2), (Gait.walk(), 0.15)])
def test_a_quadruped_walks(gait: Gait, vx: float) -> None:
    mpc = controller(gait, latency=0.01)
    mpc.reset(STAND)
    policy, speeds = mpc.policy(), []

    def law(now: Any) -> None:
        x = np.r_[now.q, now.v]
        if round(1e3 * now.time) % 20 == 0 and now.time > 0.0:
            mpc.command(vx=vx)
            mpc.update(now.time, x)
            assert mpc.report.is_new and mpc.report.status == "planned"
        now.tau[6:] = policy(now.time, x)
        assert policy.source == "plan" and (np.abs(now.tau) <= QUADRUPED.limits.effort).all()
        speeds.append(now.v[0])

    simulation = Simulation(QUADRUPED, dt=1e-3, ground=Ground(FEET, friction=0.7))
    simulation.set_state(STAND[:19], STAND[19:])
    assert simulation.run(3000, law) == "done"
    assert np.mean(speeds[1500:]) == pytest.approx(vx, abs=0.02)


def test_planned_forces_carry_the_robot() -> None:
    mpc = controller(Gait.stand())
    mpc.reset(STAND)
    forces = mpc.forces()
    assert forces.shape == (25, 4, 3)
    assert forces[..., 2].sum(axis=1) == pytest.approx(9.81 * QUADRUPED.total_mass, rel=1e-2)


def test_a_reported_contact_ends_a_swing() -> None:
    stands = []
    for report in (None, ["LF_foot", "RH_foot"], [True, False, False, True], np.zeros(4, bool)):
        mpc = controller()
        mpc.reset(STAND)
        for k in range(1, 20):  # the first swing is from 0.22 to 0.46 s
            if report is not None and k == 18:
                mpc.touch(report)
            mpc.update(0.02 * k, STAND)
        stands.append(mpc.report.stands)
    swing, stand = (False, True, True, False), (True,) * 4
    assert stands == [swing, stand, stand, swing]
    with pytest.raises(ControllerError, match="`feet`: `paw` is not a foot"):
        mpc.touch(["paw"])
    with pytest.raises(ControllerError, match="`feet`: expected 4 feet, found 3"):
        mpc.touch([True] * 3)


def test_whole_body_control_tracks_the_plan() -> None:
    """A quadruped trots under a whole-body controller at 1 kHz, which tracks the plans of 50 Hz."""
    contacts = [FrictionContact.point(foot, 0.6) for foot in FEET]
    swings = [Task.position(foot, weight=100.0, gains=Gains.critical(900.0)) for foot in FEET]
    tasks = [Task.com(), Task.orientation("trunk"), Task.posture(), *swings]
    tracker = WholeBodyController(QUADRUPED, contacts, tasks, Settings(contact_gains=Gains(0.0, 40.0)))
    mpc = controller()
    mpc.reset(STAND)
    references, plans, speeds = tracker.hold(STAND[:19]), [mpc.plan()], []

    def law(now: Any) -> None:
        if round(1e3 * now.time) % 20 == 0 and now.time > 0.0:
            mpc.command(vx=0.4)
            mpc.update(now.time, np.r_[now.q, now.v])
            plans.append(mpc.plan())
            assert plans[-1].span[0] == pytest.approx(now.time)
        tracker.track(plans[-1], now.time, references)
        now.tau[:] = tracker.step(now.q, now.v, references).tau
        speeds.append(now.v[0])

    simulation = Simulation(QUADRUPED, dt=1e-3, ground=Ground(FEET, friction=0.7))
    simulation.set_state(STAND[:19], STAND[19:])
    assert simulation.run(2500, law) == "done"
    assert np.mean(speeds[1500:]) == pytest.approx(0.4, abs=0.03)
    # the same feet touch in the plan and in the report
    stands = [plans[-1].activation(foot, plans[-1].span[0]) == 1.0 for foot in range(4)]
    assert tuple(stands) == mpc.report.stands


def test_settings_have_the_forms_of_the_documentation() -> None:
    for limits in ("model", None, PlanLimits(positions=False)):
        mpc = controller(limits=limits, iterations=(1, 3), budget=10.0)
        mpc.reset(STAND)
        mpc.update(0.02, STAND)
        assert mpc.report.iterations == 3
    mpc.set_gait(Gait.stand(), at="next")
    mpc.set_gait(Gait.trot(), at=1.0)
    with pytest.raises(ValueError, match="at: expected 'next' or a time, found 'soon'"):
        mpc.set_gait(Gait.trot(), at="soon")  # type: ignore[arg-type]
    with pytest.raises(ControllerError, match="`t`: the time 1000 s is not before 60.02 s"):
        mpc.set_gait(Gait.trot(), at=1000.0)
    with pytest.raises(ValueError, match="limits: expected 'model', PlanLimits or None, found 'all'"):
        controller(limits="all")


def test_another_thread_follows_the_plan() -> None:
    mpc = controller()
    mpc.reset(STAND)
    policy, done, sent = mpc.policy(), threading.Event(), []

    def motors() -> None:
        while not done.is_set():
            sent.append(policy(0.1, STAND))
            time.sleep(1e-3)

    thread = threading.Thread(target=motors)
    thread.start()
    try:
        for k in range(1, 20):
            mpc.prepare()
            mpc.update(0.02 * k, STAND)
    finally:
        done.set()
        thread.join()
    assert len(sent) > 0 and np.isfinite(sent).all()


def test_an_arm_follows_a_path() -> None:
    begin = pose()

    def path(t: float) -> Any:
        there = begin.copy()
        there[1, 3] += 0.1 * np.sin(t)
        return there

    mpc, worst = ArmMpc(ARM, "tool", weights=ArmWeights(position=1e4), limits=PlanLimits()), [0.0]
    mpc.reset(REST, path)
    policy = mpc.policy()

    def law(now: Any) -> None:
        x = np.r_[now.q, now.v]
        if round(1e3 * now.time) % 10 == 0 and now.time > 0.0:
            mpc.update(now.time, x, path)
        now.tau[:] = policy(now.time, x)
        tool = condyle.frame_placement(ARM, condyle.Data(ARM), now.q, "tool")
        worst.append(float(np.abs(tool - path(now.time)).max()))

    simulation = Simulation(ARM, dt=1e-3)
    simulation.set_state(REST[:7], REST[7:])
    assert simulation.run(2000, law) == "done"
    assert 0.0 < max(worst) < 3e-3


def test_an_arm_moves_around_an_obstacle() -> None:
    goal = pose()
    goal[1, 3] += 0.3
    ball = pose()[:3, 3] + [0.0, 0.15, 0.03]
    tip, obstacle = Geometry(Shape.sphere([0.0] * 3, 0.03), "tool"), Geometry(Shape.sphere(ball, 0.08))
    mpc, distances = ArmMpc(ARM, "tool", obstacles=[(tip, obstacle)], clearance=0.02), []
    mpc.reset(REST, pose())
    policy = mpc.policy()

    def law(now: Any) -> None:
        x = np.r_[now.q, now.v]
        if round(1e3 * now.time) % 10 == 0 and now.time > 0.0:
            mpc.update(now.time, x, goal)
        now.tau[:] = policy(now.time, x)
        tool = condyle.frame_placement(ARM, condyle.Data(ARM), now.q, "tool")[:3, 3]
        distances.append((np.linalg.norm(tool - ball) - 0.11, np.linalg.norm(tool - goal[:3, 3])))

    simulation = Simulation(ARM, dt=1e-3)
    simulation.set_state(REST[:7], REST[7:])
    assert simulation.run(2500, law) == "done"
    nearest, _ = np.min(distances, axis=0)
    assert nearest > 0.01 and distances[-1][1] < 5e-3
    with pytest.raises(condyle.Error, match="pairs"):
        ArmMpc(ARM, "tool", obstacles=[(obstacle, obstacle)])


def test_exceptions_of_a_path_are_raised() -> None:
    def path(t: float) -> Any:
        raise KeyError(t)

    mpc = ArmMpc(ARM, "tool")
    with pytest.raises(KeyError):
        mpc.reset(REST, path)
    mpc.reset(REST, pose())
    with pytest.raises(ValueError, match="path"):
        mpc.update(0.02, REST, np.eye(3))
    with pytest.raises(condyle.Error, match="paw"):
        ArmMpc(ARM, "paw")


def test_bad_input_is_refused() -> None:
    with pytest.raises(ControllerError, match="friction is -1"):
        Foot.point("LF_foot", -1.0, 0.0)
    with pytest.raises(ControllerError, match="`weights` is -1"):
        controller(weights=Weights(height=-1.0))
    with pytest.raises(ControllerError, match="no frame of this name"):
        WholeBodyMpc(QUADRUPED, [Foot.sole("paw", 0.6, (0.1, 0.1))], Gait.stand())
    with pytest.raises(ControllerError, match="floating base"):
        WholeBodyMpc(ARM, [Foot.point("tool", 0.6, 0.0)], Gait.stand())
    mpc = controller()
    with pytest.raises(ControllerError, match="no plan yet"):
        mpc.forces()
    with pytest.raises(ControllerError, match="no plan yet"):
        mpc.prepare()
    mpc.reset(STAND)
    with pytest.raises(ControllerError, match="nothing supports the robot"):
        mpc.set_gait(Gait.table(1.0, [(foot, 0.1, 0.4) for foot in FEET]))
    with pytest.raises(ControllerError, match="is inf"):
        mpc.command(vx=np.inf)
    broken = STAND.copy()
    broken[0] = np.nan
    policy = mpc.update(0.02, broken)
    assert mpc.report.status == "invalid_state" and np.isfinite(policy(0.02, broken)).all()
    mpc.update(0.04, STAND)
    with pytest.raises(ControllerError, match="time runs backwards"):
        mpc.update(0.03, STAND)
    policy.stop()
    assert (policy(0.05, STAND) == 0.0).all() and policy.source == "damping"
    policy.release()
    policy(0.05, STAND)
    assert policy.source == "plan" and policy.end is not None and policy.end > 0.4


def test_classes_show_what_they_are() -> None:
    assert repr(Gait.step()) == "Gait.step(swing=0.36, double=0.08)"
    assert repr(Foot.point("a", 0.5, 0.02)) == "Foot.point('a', 0.5, 0.02)"
    assert repr(Foot.sole("a", 0.5, (0.2, 0.1))) == "Foot.sole('a', 0.5, (0.2, 0.1))"
