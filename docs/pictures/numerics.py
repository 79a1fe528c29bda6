#!/usr/bin/env python3
"""Makes docs/pictures/numerics.png: errors of forward dynamics over mass ratio and armature, and for small angles.

.venv/pinocchio/bin/python docs/pictures/numerics.py

The program uses the functions of docs/numerics.md. It measures no times, so the picture is equal on all machines, up to
rounding.
"""

import importlib.util
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

STYLES = {
    "double, bodies": ("C0", "-"),
    "double, factor": ("C1", "-"),
    "single, bodies": ("C0", "--"),
    "single, factor": ("C1", "--"),
}


def page() -> dict[str, Any]:
    """Returns the functions and variables that the blocks of docs/numerics.md define."""
    spec = importlib.util.spec_from_file_location("run", Path(__file__).parents[1] / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    names: dict[str, Any] = module.run("numerics.md")
    return names


def main() -> None:
    book = page()
    figure, axes = plt.subplots(1, 3, figsize=(13.0, 3.9), layout="constrained")
    sweeps = (
        ("An arm of 5 links carries a load", "load / link", np.logspace(0, 7, 15), book["loaded"]),
        ("A light gripper holds 1 kg", "armature (kg m²)", np.logspace(-7, 0, 15), book["gripper"]),
    )
    for axis, (title, label, values, model) in zip(axes, sweeps, strict=False):
        with np.errstate(all="ignore"):  # pivots may be zero in single precision
            found = np.array([book["errors"](model(x))[:4] for x in values])
        for (name, (colour, line)), error in zip(STYLES.items(), found.T, strict=True):
            axis.loglog(values, np.maximum(error, 1e-17), line, color=colour, label=name)
        axis.set(title=title, xlabel=label, ylim=(1e-17, 10))
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("relative error of M⁻¹ τ")
    axes[0].legend(fontsize=8)
    angles = np.logspace(-8, -0.05, 300)
    errors = np.array([np.abs(book["coefficients"](t) / book["series"](t) - 1) for t in angles])
    for name, error in zip(("sin θ / θ", "(1 − cos θ) / θ²", "(θ − sin θ) / θ³"), errors.T, strict=True):
        axes[2].loglog(angles, np.maximum(error, 1e-17), ".", markersize=3, label=name)
    axes[2].set(title="Small angles, as the formulas are written", xlabel="θ (rad)", ylim=(1e-17, 10))
    axes[2].grid(alpha=0.3)
    axes[2].legend(fontsize=8)
    figure.savefig(Path(__file__).with_name("numerics.png"), dpi=100)


if __name__ == "__main__":
    main()
