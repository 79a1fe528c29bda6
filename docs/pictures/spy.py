#!/usr/bin/env python3
"""Makes docs/pictures/spy.png: the nonzero entries of the inertia matrix M of real robots, and the entries that are
zero because of the tree.

.venv/pinocchio/bin/python docs/pictures/spy.py
"""

import os
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from example_robot_data.robots_loader import ROBOTS, getModelPath

import condyle

ROUNDING = 1e-14
"""Maximum magnitude of an entry that counts as zero because of the robot's geometry, relative to the largest entry.
Such an entry consists of rounding errors."""
SHOWN = {"panda": "Panda, an arm", "anymal": "ANYmal", "talos": "TALOS", "allegro_right_hand": "Allegro hand"}


def main() -> None:
    figure, axes = plt.subplots(1, len(SHOWN), figsize=(3.2 * len(SHOWN), 3.6), layout="constrained")
    for axis, (name, title) in zip(axes, SHOWN.items(), strict=True):
        loader = ROBOTS[name]
        path = os.path.join(loader.path, loader.urdf_subpath, loader.urdf_filename)
        root = "free_flyer" if loader.free_flyer else None
        model = condyle.Model.from_urdf(os.path.join(getModelPath(path), path), root_joint=root)
        M = np.abs(condyle.crba(model, condyle.Data(model), condyle.random_configuration(model, seed=1)))
        happens = (M > 0.0) & (ROUNDING * M.max() > M)
        shown = np.where((M > 0.0) & ~happens, np.log10(np.where(M > 0.0, M, 1.0)), np.nan)
        axis.imshow(np.where(happens, 0.25, np.nan), cmap="gray_r", vmin=0.0, vmax=1.0, interpolation="nearest")
        image = axis.imshow(shown, cmap="viridis", interpolation="nearest")
        axis.set_title(f"{title}\nnv = {model.nv}, {100 * (M == 0.0).mean():.0f} % zeros", fontsize=10)
        figure.colorbar(image, ax=axis, shrink=0.7, label="log₁₀ |M|" if axis is axes[-1] else None)
    figure.savefig(Path(__file__).with_name("spy.png"), dpi=110)


if __name__ == "__main__":
    main()
