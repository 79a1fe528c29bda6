"""A Go2 trots in MuJoCo: forwards, then to the left, then in a curve.

python python/examples/mujoco_go2.py [film.webp]
"""

import sys

import numpy as np
from mujoco_film import film
from mujoco_world import World, walk

from condyle.mpc import Foot, Gait, WholeBodyMpc

FEET = ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
COMMANDS = [{"vx": 0.6}, {"vy": 0.4}, {"vx": 0.5, "wz": 1.0}]  # for 2 s each


def main() -> World:
    world = World.of("go2_description/urdf/go2.urdf", FEET, 0.022)
    world.set_state(world.stand({"thigh": 0.85, "calf": -1.6}), np.zeros(world.model.nv))
    feet = [Foot.point(foot, friction=0.5, radius=0.0) for foot in FEET]
    mpc = WholeBodyMpc(world.model, feet, Gait.trot(swing=0.24, double=0.04))
    walk(world, mpc, COMMANDS)
    return world


if __name__ == "__main__":
    film(main(), *sys.argv[1:])
