"""Compares `condyle.conventions` with MuJoCo. If one state is converted to the convention of each library, both
libraries must compute the same motion."""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from scenes import BALL, SOLE, SOLES, urdf
from world import World

import condyle
from condyle import conventions

SAME = 1e-9
"""Tolerance of accelerations, efforts and poses, relative to the largest number."""
FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]


def close(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, atol=SAME * (1.0 + np.abs(expected).max()))


@pytest.fixture(params=["quadruped", "talos"])
def world(request: pytest.FixtureRequest) -> World:
    """Creates one robot in Condyle and in MuJoCo, without damping or friction."""
    robots: dict[str, tuple[str, Sequence[str], tuple[float, float] | float]] = {
        "quadruped": (condyle.robots.QUADRUPED, FEET, BALL),
        "talos": (urdf("talos"), SOLES, SOLE),
    }
    world = World(*robots[request.param])
    world.mj.dof_damping[:] = world.mj.dof_frictionloss[:] = 0.0
    world.mj.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return world


def orders(world: World) -> tuple[list[int], list[int]]:
    """Returns the indices of Condyle's positions and velocities in MuJoCo's vectors, found by joint names."""
    positions, velocities = [], []
    for name, nq, nv in list(zip(world.model.names, world.model.nqs, world.model.nvs, strict=True))[1:]:
        joint = world.mj.joint(name)
        positions += range(joint.qposadr[0], joint.qposadr[0] + nq)
        velocities += range(joint.dofadr[0], joint.dofadr[0] + nv)
    return positions, velocities


def test_state_acceleration_effort(world: World) -> None:
    model, mj, data = world.model, world.mj, world.data
    there = conventions.Coordinates(model, "mujoco")
    at_q, at_v = orders(world)
    rng = np.random.default_rng(3)
    q = condyle.random_configuration(model, seed=3)
    v, a = rng.standard_normal((2, model.nv))
    data.qpos[at_q], data.qvel[at_v] = there.position(q), there.velocity(q, v)
    data.qacc[at_v] = there.acceleration(q, v, a)
    mujoco.mj_inverse(mj, data)
    scratch = condyle.Data(model)
    tau = condyle.rnea(model, scratch, q, v, a)
    close(data.qfrc_inverse[at_v], there.effort(q, tau))
    close(there.effort_from(there.position(q), data.qfrc_inverse[at_v]), tau)

    poses = condyle.forward_kinematics(model, scratch, q)
    for i, name in list(enumerate(model.body_names))[1:]:
        body = data.body(name)
        close(body.xpos, poses[i][:3, 3])
        close(conventions.rotation(conventions.xyzw(body.xquat)), poses[i][:3, :3])
        # MuJoCo's velocity of a body is [angular, linear] at the centre of mass, along the world's axes.
        theirs = np.zeros(6)
        mujoco.mj_objectVelocity(mj, data, mujoco.mjtObj.mjOBJ_BODY, body.id, theirs, 0)
        ours = condyle.body_velocity(model, scratch, q, v, i)
        close(conventions.twist_to_body(poses[i], conventions.swap_halves(theirs), body.xipos), ours)

    data.qfrc_applied[at_v] = there.effort(q, tau)
    mujoco.mj_forward(mj, data)
    close(there.acceleration_from(there.position(q), there.velocity(q, v), data.qacc[at_v]), a)


def test_external_forces(world: World) -> None:
    """Tests `xfrc_applied`: a force and a moment along the world's axes, about the body's centre of mass."""
    model, mj, data = world.model, world.mj, world.data
    there = conventions.Coordinates(model, "mujoco")
    at_q, at_v = orders(world)
    q = condyle.random_configuration(model, seed=4)
    wrench, v = np.random.default_rng(4).standard_normal((model.nbodies, 6)), np.zeros(model.nv)
    data.qpos[at_q], data.qvel[at_v] = there.position(q), 0.0
    mujoco.mj_forward(mj, data)
    bodies = [data.body(name).id for name in model.body_names[1:]]
    data.xfrc_applied[bodies] = wrench[1:]
    poses = condyle.forward_kinematics(model, condyle.Data(model), q)
    f_ext = np.zeros_like(wrench)
    f_ext[1:] = conventions.wrench_to_body(poses[1:], wrench[1:], data.xipos[bodies])
    mujoco.mj_forward(mj, data)
    a = condyle.aba(model, condyle.Data(model), q, v, np.zeros(model.nv), f_ext)
    close(there.acceleration_from(there.position(q), np.zeros(model.nv), data.qacc[at_v]), a)


def test_spherical_and_continuous() -> None:
    """Tests the conversion of a ball joint's quaternion, and of an angle to its cosine and sine."""
    text = """<mujoco><worldbody><body name="a"><joint name="ball" type="ball"/>
        <inertial pos="0.1 0 -0.3" mass="2" diaginertia="0.1 0.2 0.15"/>
        <body name="b" pos="0 0 -0.5"><joint name="hinge" axis="0 1 0"/>
        <inertial pos="0 0 -0.2" mass="1" diaginertia="0.1 0.1 0.05"/></body></body></worldbody></mujoco>"""
    mj = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(mj)
    builder = condyle.ModelBuilder("the same")
    first = builder.body(
        "ball",
        condyle.WORLD,
        condyle.Joint.spherical(),
        inertia=condyle.Inertia.from_com(2.0, [0.1, 0.0, -0.3], np.diag([0.1, 0.2, 0.15])),
    )
    place = np.eye(4)
    place[2, 3] = -0.5
    builder.body(
        "hinge",
        first,
        condyle.Joint.continuous([0, 1, 0]),
        place,
        condyle.Inertia.from_com(1.0, [0.0, 0.0, -0.2], np.diag([0.1, 0.1, 0.05])),
    )
    model = builder.build()
    there = conventions.Coordinates(model, "mujoco")
    assert (model.nq, there.nq) == (6, mj.nq)
    q, (v, a) = condyle.random_configuration(model, seed=5), np.random.default_rng(5).standard_normal((2, 4))
    data.qpos[:], data.qvel[:], data.qacc[:] = there.position(q), there.velocity(q, v), there.acceleration(q, v, a)
    mujoco.mj_inverse(mj, data)
    close(data.qfrc_inverse, there.effort(q, condyle.rnea(model, condyle.Data(model), q, v, a)))
