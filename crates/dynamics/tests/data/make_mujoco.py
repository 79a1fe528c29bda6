"""Reference numbers for tests/mjcf.rs, from MuJoCo 4.0.0: `pip install mujoco==4.0.0`, then `python make_mujoco.py`.

Quaternions stay w first and a free joint's linear velocity in the world's frame: the test converts.
"""
import json
import pathlib

import mujoco
import numpy as np

assert mujoco.__version__ == "4.0.0"
here = pathlib.Path(__file__).parent
for name in ["arm", "quadruped"]:
    text = (here / f"{name}.xml").read_text()
    # the mesh is not there: MuJoCo would want to read it, and it has no mass
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
        "range": [r.tolist() if l else None for r, l in zip(model.jnt_range, model.jnt_limited)],
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
        out["states"].append({
            "q": data.qpos.tolist(),
            "v": data.qvel.tolist(),
            "M": M.tolist(),
            "bias": data.qfrc_bias.tolist(),
            "bodies": {
                model.body(i).name: {"p": data.xpos[i].tolist(), "R": data.xmat[i].tolist(), "com": data.xipos[i].tolist()}
                for i in range(1, model.nbody) if model.body(i).name
            },
            "sites": {
                model.site(i).name: {"p": data.site_xpos[i].tolist(), "R": data.site_xmat[i].tolist()}
                for i in range(model.nsite)
            },
        })
    (here / f"{name}_mujoco.json").write_text(json.dumps(out) + "\n")
