"""Writes the reference numbers of MuJoCo 4.0.0 for tests/suite/mjcf.rs and tests/suite/springs.rs.

Usage: `pip install mujoco==4.0.0`, then `python make_mujoco.py`.

The numbers for mjcf.rs follow MuJoCo's conventions: quaternions begin with w, and the linear velocity of a free joint
is in the world's frame. The test converts these numbers.
"""

import json
import pathlib

import mujoco
import numpy as np

assert mujoco.__version__ == "4.0.0"
here = pathlib.Path(__file__).parent
for name in ["arm", "quadruped"]:
    text = (here / f"{name}.xml").read_text()
    # Remove the mesh, which has no mass, because MuJoCo would read its file, and this file does not exist.
    lines = [line for line in text.splitlines() if "mesh" not in line]
    assets = {p.name: p.read_bytes() for p in here.glob("*_defaults.xml")}
    model = mujoco.MjModel.from_xml_string("\n".join(lines), assets)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(1)
    out = {
        "nq": model.nq,
        "nv": model.nv,
        "armature": model.dof_armature.tolist(),
        "damping": model.dof_damping.tolist(),
        "range": [
            r.tolist() if limited else None for r, limited in zip(model.jnt_range, model.jnt_limited, strict=True)
        ],
        "bodies": {model.body(i).name: float(model.body_mass[i]) for i in range(1, model.nbody) if model.body(i).name},
        "states": [],
    }
    for _ in range(3):
        mujoco.mj_resetData(model, data)
        dq = rng.standard_normal(model.nv)
        mujoco.mj_integratePos(model, data.qpos, dq, 1.0)
        data.qvel[:] = rng.standard_normal(model.nv)
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        out["states"].append(
            {
                "q": data.qpos.tolist(),
                "v": data.qvel.tolist(),
                "M": M.tolist(),
                "bias": data.qfrc_bias.tolist(),
                "bodies": {
                    model.body(i).name: {
                        "p": data.xpos[i].tolist(),
                        "R": data.xmat[i].tolist(),
                        "com": data.xipos[i].tolist(),
                    }
                    for i in range(1, model.nbody)
                    if model.body(i).name
                },
                "sites": {
                    model.site(i).name: {"p": data.site_xpos[i].tolist(), "R": data.site_xmat[i].tolist()}
                    for i in range(model.nsite)
                },
            }
        )
    (here / f"{name}_mujoco.json").write_text(json.dumps(out) + "\n")

# The gripper has joints that follow other joints. The positions satisfy MuJoCo's equality constraints.
# All numbers are in the coordinates of the leading joints: v = G v_leaders.
model = mujoco.MjModel.from_xml_path(str(here / "gripper.xml"))
data = mujoco.MjData(model)
rng = np.random.default_rng(1)
follows = {"right": ("left", 0.2, 1.5), "left_tip": ("twist", -0.1, -0.8), "pad": ("left", 0.01, 0.03)}
index = {model.joint(i).name: i for i in range(model.njnt)}
leaders = [i for name, i in index.items() if name not in follows]
G = np.eye(model.nv)[:, leaders]
for name, (leader, _, slope) in follows.items():
    G[index[name], leaders.index(index[leader])] = slope
out = {"armature": np.diag(G.T @ np.diag(model.dof_armature) @ G).tolist(), "states": []}
for _ in range(3):
    q = rng.standard_normal(model.nv)
    for name, (leader, constant, slope) in follows.items():
        follower, leader = index[name], index[leader]
        q[follower] = model.qpos0[follower] + constant + slope * (q[leader] - model.qpos0[leader])
    v = rng.standard_normal(len(leaders))
    data.qpos, data.qvel = q, G @ v
    mujoco.mj_forward(model, data)
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert equality.sum() == len(follows) and abs(data.efc_pos[equality]).max() < 1e-15
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    out["states"].append(
        {
            "q": q[leaders].tolist(),
            "v": v.tolist(),
            "M": (G.T @ M @ G).tolist(),
            "bias": (G.T @ data.qfrc_bias).tolist(),
            "pad": data.body("pad").xpos.tolist(),
            "left_tip": data.body("left_tip").xpos.tolist(),
        }
    )
(here / "gripper_mujoco.json").write_text(json.dumps(out))

# The robot of passive.xml has springs, polynomial damping, gravity compensation and the armature of a free joint.
# The numbers for tests/suite/springs.rs follow Condyle's conventions: quaternions end with w.
# In these numbers, the linear velocity of a free joint is in the body's axes.
model = mujoco.MjModel.from_xml_path(str(here / "passive.xml"))
data = mujoco.MjData(model)
rng = np.random.default_rng(1)
states = []
for _ in range(4):
    mujoco.mj_resetData(model, data)
    mujoco.mj_integratePos(model, data.qpos, rng.standard_normal(model.nv), 1.0)
    data.qvel[:] = rng.standard_normal(model.nv)
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    T = np.eye(model.nv)  # MuJoCo's velocity is T times Condyle's velocity
    T[:3, :3] = data.body("base").xmat.reshape(3, 3)
    v = T.T @ data.qvel
    turned = np.zeros(model.nv)
    turned[:3] = np.cross(v[3:6], v[:3])  # MuJoCo's acceleration is T (a + ω × v), with Condyle's acceleration a
    q = data.qpos.copy()
    for joint in ["float", "ball"]:
        at = model.joint(joint).qposadr[0] + (3 if joint == "float" else 0)
        q[at : at + 4] = np.roll(q[at : at + 4], -1)
    states.append(
        {
            "q": q.tolist(),
            "v": v.tolist(),
            "M": (T.T @ M @ T).tolist(),
            "bias": (T.T @ (data.qfrc_bias + M @ T @ turned)).tolist(),
            "passive": (T.T @ data.qfrc_passive).tolist(),
        }
    )
(here / "passive_mujoco.json").write_text(json.dumps(states) + "\n")
