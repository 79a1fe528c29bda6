"""Tests of `condyle.mpc.ArmMpc` in MuJoCo."""

import mujoco
import numpy as np
from scenes import urdf
from world import Array, bare

import condyle
from condyle.mpc import ArmMpc

TOOL = "panda_hand_tcp"
RADIUS, SPEED = 0.2, 0.25
"""Radius of the circle (m), and speed on it (m/s), which the tool reaches after 1 s."""
START = np.array([0.0, -0.3, 0.0, -2.4, 0.0, 2.1, 0.785, 0.02, 0.02])
"""Position of the panda and its fingers at the top of the circle."""


def test_the_tool_of_a_panda_follows_a_circle() -> None:
    model = condyle.Model.from_urdf_str(urdf("panda"))
    mj = mujoco.MjModel.from_xml_string(bare(urdf("panda"), free=False))
    assert [mj.joint(k).name for k in range(mj.njnt)] == model.names[1:]
    state, data, limits = mujoco.MjData(mj), condyle.Data(model), model.limits
    mj.opt.timestep = 1e-3
    top = condyle.frame_placement(model, data, START, TOOL)

    def circle(t: float) -> Array:
        angle = SPEED / RADIUS * (0.5 * t**2 if t < 1.0 else t - 0.5)
        pose = top.copy()
        pose[:3, 3] += RADIUS * np.array([0.0, np.sin(angle), np.cos(angle) - 1.0])
        return pose

    mpc = ArmMpc(model, TOOL)
    mpc.reset(np.r_[START, np.zeros(model.nv)], circle)
    state.qpos[:], policy, errors = START, mpc.policy(), []
    for i in range(6000):
        t, q, v = 1e-3 * i, state.qpos.copy(), state.qvel.copy()
        if i % 10 == 0 and i > 0:
            mpc.update(t, np.r_[q, v], circle)
            assert mpc.report.status == "planned"
        tau = policy(t, np.r_[q, v])
        assert (np.abs(tau) <= limits.effort).all() and (np.abs(v) <= limits.velocity).all()
        assert (q >= limits.lower).all() and (q <= limits.upper).all()
        errors.append(np.linalg.norm((condyle.frame_placement(model, data, q, TOOL) - circle(t))[:3, 3]))
        state.qfrc_applied[:] = tau
        mujoco.mj_step(mj, state)
    assert max(errors) < 5e-4  # 0.1 mm; the target is 2 mm
