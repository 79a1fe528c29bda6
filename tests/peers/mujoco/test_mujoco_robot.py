"""Tests `condyle.conventions.MujocoRobot`: states and efforts by names, in a scene whose joints and actuators have
another order than the robot's."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from world import bare

import condyle
from condyle.conventions import Coordinates, MujocoRobot

pytestmark = pytest.mark.filterwarnings("ignore:Attaching a spec with an empty prefix")

SAME = 1e-9
"""Tolerance of accelerations, relative to the largest number."""
QUADRUPED = condyle.robots.quadruped()
JOINTS = QUADRUPED.names[2:]
GEARS = {name: 0.5 + 0.25 * k for k, name in enumerate(JOINTS)}
Change = Callable[[mujoco.MjSpec], object]


def scene(change: Change = lambda spec: None, motors: bool = True) -> mujoco.MjModel:
    """Returns a scene: a box, then the quadruped, whose motors are in the reverse order of its joints."""
    text = bare(condyle.robots.QUADRUPED)
    robot = mujoco.MjSpec.from_string(text)
    spec = mujoco.MjSpec()
    box = spec.worldbody.add_body(name="box", pos=[3.0, 0.0, 0.0])
    box.add_freejoint(name="box moves")
    box.add_geom(size=[0.1, 0.1, 0.1], type=mujoco.mjtGeom.mjGEOM_BOX, contype=0, conaffinity=0)
    box.add_body(name="lid").add_joint(name="hinge")
    spec.body("lid").add_geom(size=[0.1, 0.1, 0.1], type=mujoco.mjtGeom.mjGEOM_BOX, contype=0, conaffinity=0)
    spec.attach(robot, frame=spec.worldbody.add_frame(), prefix="", suffix="")
    for name in reversed(JOINTS) if motors else ():
        motor = spec.add_actuator(name=f"motor of {name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.gear[0] = GEARS[name]
    if motors:
        lid = spec.add_actuator(name="lid", target="hinge", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        lid.set_to_position(kp=10.0)
    change(spec)
    return spec.compile()


def test_states_and_efforts_are_found_by_names() -> None:
    mj = scene()
    data, robot = mujoco.MjData(mj), MujocoRobot(mj, QUADRUPED)
    rng = np.random.default_rng(1)
    q, v = condyle.random_configuration(QUADRUPED, seed=1), rng.standard_normal(18)
    tau = rng.standard_normal(12)
    data.ctrl[:] = 7.0
    box = data.qpos[:7].copy()
    robot.set_state(data, np.r_[q, v])
    np.testing.assert_array_equal(data.qpos[:7], box)
    np.testing.assert_allclose(robot.state(data), np.r_[q, v], atol=1e-12)
    for name, angle, rate in zip(JOINTS, q[7:], v[6:], strict=True):
        assert (data.joint(name).qpos[0], data.joint(name).qvel[0]) == (angle, rate)

    robot.apply(data, tau)
    assert data.ctrl[-1] == 7.0
    controls = robot.control(tau)
    np.testing.assert_array_equal(np.r_[controls[:-1], 7.0], data.ctrl)
    assert controls[-1] == 0.0
    for name, effort in zip(JOINTS, tau, strict=True):
        assert data.actuator(f"motor of {name}").ctrl[0] == pytest.approx(effort / GEARS[name])
    mj.dof_damping[:] = mj.dof_frictionloss[:] = 0.0
    mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    mujoco.mj_forward(mj, data)
    a = condyle.aba(QUADRUPED, condyle.Data(QUADRUPED), q, v, np.r_[np.zeros(6), tau])
    expected = Coordinates(QUADRUPED, "mujoco").acceleration(q, v, a)
    trunk = mj.body(QUADRUPED.body_names[1])
    first = mj.jnt_dofadr[mj.body_jntadr[trunk.id]]
    found = np.r_[data.qacc[first : first + 6], [data.joint(name).qacc[0] for name in JOINTS]]
    np.testing.assert_allclose(found, expected, atol=SAME * np.abs(expected).max())


def test_a_robot_read_from_mujoco_itself() -> None:
    mj = scene()
    both = condyle.Model.from_mujoco(mj)  # the box and the quadruped
    assert both.nv == mj.nv
    data = mujoco.MjData(scene(motors=False))
    robot = MujocoRobot(data.model, both)
    data.qvel[:] = np.arange(mj.nv)
    x = robot.state(data)
    again = mujoco.MjData(data.model)
    robot.set_state(again, x)
    np.testing.assert_allclose(again.qpos, data.qpos, atol=1e-12)
    np.testing.assert_allclose(again.qvel, data.qvel, atol=1e-12)
    with pytest.raises(ValueError, match="MuJoCo's model has no actuators"):
        robot.control(np.zeros(both.nv - 12))


def renamed(spec: mujoco.MjSpec) -> None:
    spec.delete(spec.actuator("motor of LF_HAA"))
    spec.joint("LF_HAA").name = "other"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (renamed, "joint `LF_HAA`: MuJoCo's model has no joint of this name; it has `box moves`, `hinge`, "),
        (lambda spec: spec.delete(spec.actuator("motor of RH_KFE")), r"joint `RH_KFE` has 0 actuators .* \(none\)"),
        (
            lambda spec: spec.actuator("motor of RH_KFE").set_to_position(kp=50.0),
            "actuator `motor of RH_KFE` of joint `RH_KFE` is no motor: its force depends on position or velocity",
        ),
        (
            lambda spec: spec.add_actuator(name="b", target="LF_HFE", trntype=mujoco.mjtTrn.mjTRN_JOINT),
            r"joint `LF_HFE` has 2 actuators in MuJoCo's model \(`motor of LF_HFE`, `b`\): expected one motor",
        ),
        (
            lambda spec: setattr(spec.joint("LF_HFE"), "type", mujoco.mjtJoint.mjJNT_SLIDE),
            "joint `LF_HFE`: expected a hinge joint, found a slide joint",
        ),
    ],
)
def test_what_does_not_fit_is_named(change: Change, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        MujocoRobot(scene(change), QUADRUPED)


def test_wrong_lengths_are_refused() -> None:
    mj = scene()
    robot = MujocoRobot(mj, QUADRUPED)
    with pytest.raises(ValueError, match=r"tau: expected shape \(12,\), found \(18,\)"):
        robot.control(np.zeros(18))
    with pytest.raises(ValueError, match=r"x: expected shape \(37,\), found \(36,\)"):
        robot.set_state(mujoco.MjData(mj), np.zeros(36))
