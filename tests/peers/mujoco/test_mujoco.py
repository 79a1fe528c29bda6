"""Tests whole-body control of robots in MuJoCo for several seconds: the conversion of states, a stand, a push, and a
trot."""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from scenes import BALL, FRICTION, SOLE, SOLES, Disturbance, Humanoid, Quadruped, trot, urdf
from world import Array, World

import condyle

SAME = 1e-9
"""Tolerance of accelerations, relative to the largest acceleration."""
SWAY = 1e-3
"""Maximum motion of the centre of mass of a standing robot (m). It is not 0, because the ground is compliant and joints
have friction."""
RETURNED = 5e-3
"""Maximum distance of the centre of mass from its reference 3 s after a push (m)."""
ASTRAY = 0.05
"""Maximum distance of the centre of mass from the planned motion in a trot (m)."""
QUADRUPED_FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]


def somewhere(model: condyle.Model) -> tuple[Array, Array, Array]:
    """Returns a random state of a robot in the air, with rotation and velocity, and random efforts of the joints."""
    rng = np.random.default_rng(0)
    q, v, tau = condyle.random_configuration(model, seed=1), *rng.standard_normal((2, model.nv))
    q[:3] = 1.0, 2.0, 5.0
    lower, upper = (np.clip(limit[7:], -1.0, 1.0) for limit in (model.limits.lower, model.limits.upper))
    q[7:] = rng.uniform(lower, upper)
    tau[:6] = 0.0
    return q, v, tau


@pytest.mark.parametrize(
    ("text", "feet", "size"), [(urdf("talos"), SOLES, SOLE), (condyle.robots.QUADRUPED, QUADRUPED_FEET, BALL)]
)
def test_one_robot_in_both(text: str, feet: Sequence[str], size: tuple[float, float] | float) -> None:
    """Tests the conversion of states and efforts. A state is unchanged after conversion to MuJoCo and back. In the air,
    both libraries compute the same motion of the robot."""
    world = World(text, feet, size)
    q, v, tau = somewhere(world.model)
    world.set_state(q, v)
    for found, given in zip(world.state(), (q, v), strict=True):
        np.testing.assert_allclose(found, given, atol=1e-12)
    # a simulation in Condyle includes damping and friction only if requested
    world.mj.dof_damping[:] = world.mj.dof_frictionloss[:] = 0.0
    world.data.qfrc_applied[:] = world.generalized(tau)
    mujoco.mj_forward(world.mj, world.data)
    assert world.data.ncon == 0
    a = condyle.aba(world.model, condyle.Data(world.model), q, v, tau)
    R = condyle.forward_kinematics(world.model, condyle.Data(world.model), q)[1][:3, :3]
    expected = world.generalized(a)
    expected[:3], expected[3:6] = R @ (a[:3] + np.cross(v[3:6], v[:3])), a[3:6]
    np.testing.assert_allclose(world.data.qacc, expected, atol=SAME * np.abs(expected).max())


@pytest.mark.parametrize("disturbance", [Disturbance(), Disturbance(0.01, 1, 1.2)])
def test_a_humanoid_stands(disturbance: Disturbance) -> None:
    humanoid = Humanoid(disturbance)
    record = humanoid.run(humanoid.control(), 1.0)
    assert record.stands and humanoid.unsolved == 0
    assert np.abs(record.com - record.wanted).max() < SWAY
    weight = 9.81 * humanoid.world.model.total_mass
    assert record.loads[-20:].sum(1).mean() == pytest.approx(weight, rel=0.01)


@pytest.mark.parametrize("push", [(20.0, 10.0, 0.0), (-15.0, 15.0, 0.0), (0.0, -30.0, 0.0)])
def test_a_humanoid_is_pushed(push: tuple[float, float, float]) -> None:
    humanoid = Humanoid()
    record = humanoid.run(humanoid.control(), 3.5, push)
    assert record.stands
    away = np.linalg.norm((record.com - record.wanted)[:, :2], axis=1)
    assert away.max() > 3.0 * RETURNED and away[-1] < RETURNED


def test_a_quadruped_trots() -> None:
    plan = trot(condyle.robots.QUADRUPED, QUADRUPED_FEET, [0.0, 0.7, -1.4] * 4, 2.0)
    quadruped = Quadruped(condyle.robots.QUADRUPED, QUADRUPED_FEET, plan, friction=FRICTION)
    record = quadruped.run(plan.span[1])
    assert record.stands and quadruped.unsolved == 0
    assert np.linalg.norm((record.com - record.wanted)[:, :2], axis=1).max() < ASTRAY
    assert record.com[-1, 0] - record.com[0, 0] > 0.3
