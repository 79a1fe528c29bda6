"""An arm follows a target that is dragged in the browser.

    python python/examples/drag_target.py [--stay]

The example needs `pip install condyle[viz]`. With --stay, drag the target in the page until Ctrl-C; without it, the
target moves on a circle for two seconds.
"""

import sys
import time
from pathlib import Path

import numpy as np

import condyle
from condyle import viz
from condyle.algebra import quaternion
from condyle.distances import Geometry, Shape
from condyle.ik import DifferentialIk, DistanceLimits, Task

DT = 0.02  # duration of a step (s)

arm = condyle.robots.arm7()
q = np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])

# The hand stays 2 cm above the ground.
hand = Geometry(Shape.sphere([0.0, 0.0, 0.0], 0.05), "tool", name="hand")
ground = Geometry(Shape.half_space([0.0, 0.0, 1.0]), name="ground")
distances = DistanceLimits([(hand, ground)], minimum=0.02)
# The damping keeps the arm calm while the target is out of reach.
ik = DifferentialIk(arm, [Task.pose("tool", damping=0.1, gain=0.3), Task.posture()], dt=DT, distances=distances)
targets = ik.hold(q)

Path("arm7.urdf").write_text(condyle.robots.ARM7)
player = viz.play(arm, q[None], DT, None, "arm7.urdf")
start = targets.frames[0].copy()
control = player.server.scene.add_transform_controls("/target", scale=0.2)


def wxyz(rotation: np.ndarray) -> np.ndarray:
    """Returns a rotation as viser's quaternion."""
    return np.roll(quaternion(rotation), 1)


def rotation(wxyz: np.ndarray) -> np.ndarray:
    """Returns the rotation of viser's quaternion."""
    w, v = wxyz[0], np.asarray(wxyz[1:])
    cross = np.cross(np.eye(3), v)
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def follow(q: np.ndarray) -> np.ndarray:
    """Makes a step from q towards the target, shows the arm, and returns its position."""
    targets.frames[0, :3, :3], targets.frames[0, :3, 3] = rotation(control.wxyz), control.position
    q = condyle.integrate(arm, q, DT * ik.step(q, targets).v)
    poses = condyle.forward_kinematics(arm, condyle.Data(arm), q)
    for body, pose in zip(player.bodies, poses, strict=True):
        body.position, body.wxyz = pose[:3, 3], wxyz(pose[:3, :3])
    return q


control.position, control.wxyz = start[:3, 3], wxyz(start[:3, :3])
if "--stay" in sys.argv:
    print(f"Open {player.url} and drag the target; Ctrl-C ends it.")
    try:
        while True:
            q = follow(q)
            time.sleep(DT)
    except KeyboardInterrupt:
        pass
else:
    for k in range(100):
        angle = 2.0 * np.pi * k / 100
        control.position = start[:3, 3] + 0.1 * np.array([0.0, np.sin(angle), np.cos(angle) - 1.0])
        q = follow(q)
    tool = condyle.frame_placement(arm, condyle.Data(arm), q, "tool")[:3, 3]
    print(f"the tool follows the target, {1000 * np.linalg.norm(tool - control.position):.0f} mm behind")
player.close()
