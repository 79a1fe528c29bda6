"""A TALOS walks in MuJoCo: it steps in place, walks ahead, then turns.

python python/examples/mujoco_talos.py [film.webp]
"""

import sys

import numpy as np
from mujoco_film import film
from mujoco_world import World, walk

from condyle.mpc import Foot, Gait, WholeBodyMpc

FEET, SOLE = ["left_sole_link", "right_sole_link"], (0.2, 0.12)
LEG = {"_3_joint": -0.4, "_4_joint": 0.8, "_5_joint": -0.4}  # rad
ANGLES = {f"leg_{side}{joint}": angle for side in ("left", "right") for joint, angle in LEG.items()}
COMMANDS = [{}, {"vx": 0.2}, {"wz": 0.2}]  # for 2 s each


def main() -> World:
    world = World.of("talos_data/robots/talos_reduced.urdf", FEET, SOLE)
    world.set_state(world.stand(ANGLES), np.zeros(world.model.nv))
    feet = [Foot.sole(foot, friction=0.5, size=SOLE) for foot in FEET]
    mpc = WholeBodyMpc(world.model, feet, Gait.step(swing=0.6, double=0.2), horizon=1.0)
    walk(world, mpc, COMMANDS)
    return world


if __name__ == "__main__":
    film(main(), *sys.argv[1:])
