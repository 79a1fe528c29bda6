"""Writes the reference numbers of Pinocchio for tests/suite/mimic.rs.

Usage: `pip install pin==4.1.0`, then `python make_pinocchio.py`.
"""

import json
import pathlib

import numpy as np
import pinocchio as pin

assert pin.__version__ == "4.1.0"
here = pathlib.Path(__file__).parent
model = pin.buildModelFromUrdf(str(here / "mimic.urdf"), mimic=True)
data = model.createData()
rng = np.random.default_rng(0)
pin.seed(0)
out = {
    "shoulder": [model.lowerPositionLimit[0], model.upperPositionLimit[0]],
    "velocity": model.velocityLimit.tolist(),
    "effort": model.upperEffortLimit.tolist(),
    "damping": model.damping.tolist(),
    "friction": model.upperDryFrictionLimit.tolist(),
    "states": [],
}
for _ in range(6):
    q = pin.randomConfiguration(model)  # the continuous joint's angle covers the whole circle
    v, a = rng.standard_normal((2, model.nv))
    pin.framesForwardKinematics(model, data, q)
    links = [i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    out["states"].append(
        {
            "q": q.tolist(),
            "v": v.tolist(),
            "a": a.tolist(),
            "links": {
                model.frames[i].name: [data.oMf[i].translation.tolist(), data.oMf[i].rotation.tolist()] for i in links
            },
            "rnea": pin.rnea(model, data, q, v, a).tolist(),
            "M": pin.crba(model, data, q, pin.Convention.WORLD).tolist(),
        }
    )
(here / "mimic_pinocchio.json").write_text(json.dumps(out) + "\n")
