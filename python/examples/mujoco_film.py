"""Films of `mujoco_world.World`, drawn by MuJoCo."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np
from mujoco_world import FRAME, Array, World

PIXELS = (480, 320)
"""Width and height of a picture."""


def draw(world: World, poses: Sequence[Array]) -> Iterator[np.ndarray]:
    """Yields the picture of each pose of MuJoCo's coordinates. The camera follows the trunk."""
    data, camera, height = mujoco.MjData(world.mj), mujoco.MjvCamera(), float(world.poses[0][2])
    camera.distance, camera.azimuth, camera.elevation = 1.2 + 1.4 * height, 130.0, -15.0
    with mujoco.Renderer(world.mj, PIXELS[1], PIXELS[0]) as renderer:
        for pose in poses:
            data.qpos[:] = pose
            mujoco.mj_forward(world.mj, data)
            camera.lookat = [*pose[:2], 0.8 * height]
            renderer.update_scene(data, camera)
            yield renderer.render()


def film(world: World, file: str | Path | None = None) -> None:
    """Draws the motion since the state was set, if a file is given. Writes a moving picture, if the file's name ends
    with `.webp` or `.gif`. Otherwise writes three pictures side by side, at equal intervals of time."""
    if file is None:
        return
    from PIL import Image

    if Path(file).suffix in (".webp", ".gif"):
        first, *others = map(Image.fromarray, draw(world, world.poses))
        first.save(file, save_all=True, append_images=others, duration=round(1e3 * FRAME), loop=0)
    else:
        chosen = [world.poses[len(world.poses) * k // 3 - 1] for k in (1, 2, 3)]
        Image.fromarray(np.hstack(list(draw(world, chosen)))).save(file)
