"""An ANYmal trots in MuJoCo: forwards, then to the left, then in a curve.

python python/examples/mujoco_anymal.py [film.webp]
"""

import sys

import numpy as np
from mujoco_film import film
from mujoco_world import World, walk

from condyle.mpc import Foot, Gait, WholeBodyMpc

FEET = ["LF_FOOT", "RF_FOOT", "LH_FOOT", "RH_FOOT"]
ANGLES = {"F_HFE": 0.7, "H_HFE": -0.7, "F_KFE": -1.4, "H_KFE": 1.4}  # by parts of joints' names (rad)
COMMANDS = [{"vx": 0.8}, {"vy": 0.4}, {"vx": 0.5, "wz": 1.0}]  # for 2 s each


def main() -> World:
    world = World.of("anymal_b_simple_description/robots/anymal.urdf", FEET, 0.03)
    world.set_state(world.stand(ANGLES), np.zeros(world.model.nv))
    feet = [Foot.point(foot, friction=0.5, radius=0.0) for foot in FEET]
    mpc = WholeBodyMpc(world.model, feet, Gait.trot(swing=0.28, double=0.06))
    walk(world, mpc, COMMANDS)
    return world


if __name__ == "__main__":
    film(main(), *sys.argv[1:])
