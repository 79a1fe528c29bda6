"""A G1 walks in MuJoCo: it steps in place, walks ahead, then turns.

python python/examples/mujoco_g1.py [film.webp]
"""

import sys

import numpy as np
from mujoco_film import film
from mujoco_world import World, walk

from condyle.mpc import Foot, Gait, WholeBodyMpc

FEET, SOLE = ["left_sole", "right_sole"], (0.17, 0.055)
FRAMES = {foot: (foot.replace("sole", "ankle_roll_link"), (0.035, 0.0, -0.035)) for foot in FEET}
ANGLES = {"hip_pitch": -0.35, "knee": 0.7, "ankle_pitch": -0.35, "elbow": 0.6}  # by parts of joints' names (rad)
COMMANDS = [{}, {"vx": 0.3}, {"wz": 0.4}]  # for 2 s each


def main() -> World:
    world = World.of("g1_description/urdf/g1_29dof_rev_1_0.urdf", FEET, SOLE, frames=FRAMES)
    world.set_state(world.stand(ANGLES), np.zeros(world.model.nv))
    feet = [Foot.sole(foot, friction=0.5, size=SOLE) for foot in FEET]
    mpc = WholeBodyMpc(world.model, feet, Gait.step(swing=0.36, double=0.08), horizon=0.8)
    walk(world, mpc, COMMANDS)
    return world


if __name__ == "__main__":
    film(main(), *sys.argv[1:])
