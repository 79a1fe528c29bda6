#!/usr/bin/env python3
"""Draws four robots that walk in MuJoCo under `condyle.mpc.WholeBodyMpc`, as a moving picture and as a still one.

    MUJOCO_GL=egl .venv/pinocchio/bin/python docs/pictures/walking.py

The program runs the examples `python/examples/mujoco_*.py` and writes `walking.webp` and `walking.png`.
"""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
from PIL import Image

sys.path.append(str(Path(__file__).parents[2] / "python" / "examples"))
from mujoco_film import draw

ROBOTS = (("go2", "anymal"), ("g1", "talos"))
"""Robots in the rows of the picture."""
SIZE = (300, 200)
"""Width and height of the moving picture of a robot."""
EVERY = 2
"""Number of recorded poses for each picture; there are 25 poses a second."""


def main() -> None:
    """Writes both pictures."""
    rows = []
    for names in ROBOTS:
        worlds = [import_module(f"mujoco_{name}").main() for name in names]
        films = [np.array(list(draw(world, world.poses[::EVERY]))) for world in worlds]
        rows.append(np.concatenate(films, axis=2))
    pictures = [Image.fromarray(picture) for picture in np.concatenate(rows, axis=1)]
    folder = Path(__file__).parent
    pictures[len(pictures) // 2].save(folder / "walking.png", optimize=True)
    small = [picture.resize((2 * SIZE[0], 2 * SIZE[1]), Image.Resampling.LANCZOS) for picture in pictures]
    small[0].save(
        folder / "walking.webp", save_all=True, append_images=small[1:], duration=40 * EVERY, loop=0, quality=40
    )


if __name__ == "__main__":
    main()
