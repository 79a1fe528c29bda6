#!/usr/bin/env python3
"""Draws the pictures of docs/wholebody.md from simulations in MuJoCo, and from the table of the largest pushes in
docs/wholebody.md.

.venv/pinocchio/bin/python tests/peers/mujoco/plots.py
"""

import re
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from scenes import FEET, Humanoid, Quadruped, anymal, urdf

DOCUMENT = Path(__file__).parents[3] / "docs" / "wholebody.md"
PICTURES = DOCUMENT.parent / "pictures"
PUSHES = (10.0, 20.0, 30.0, 40.0)  # impulses of the forward pushes (N s)


def save(figure: plt.Figure, name: str) -> None:
    """Writes a picture to a compressed file."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    figure.savefig(PICTURES / name, dpi=90, metadata={"Software": None})
    plt.close(figure)


def push() -> None:
    """Plots the motion of TALOS after forward pushes of several sizes."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained", sharey=True)
    for axes, title in ((left, "whole-body control, cones"), (right, "PD hold of the joints")):
        for size in PUSHES:
            humanoid = Humanoid()
            law = humanoid.control() if axes is left else humanoid.hold(20.0)
            record = humanoid.run(law, 4.0, (size, 0.0, 0.0))
            moved = 1e3 * (record.com - record.wanted)[:, 0]
            label = f"{size:.0f} N s" + ("" if record.stands else ": falls")
            axes.plot(record.t, moved, label=label)
        axes.set(title=title, xlabel="t (s)", ylim=(-120, 220))
        axes.legend(loc="upper right")
    left.set_ylabel("centre of mass, ahead (mm)")
    save(figure, "wholebody_push.png")


def pushes() -> None:
    """Plots the largest pushes in all directions, from the table that closed_loop.py wrote."""
    text = DOCUMENT.read_text(encoding="utf-8")
    head, _, *rows = re.search(r"<!-- pushes -->\n(.*?)<!-- end -->", text, re.S)[1].strip().splitlines()
    laws = [cell.strip() for cell in head.strip("|").split("|")][1:]
    found = np.array([[float(cell.strip(" °")) for cell in row.strip("|").split("|")] for row in rows])
    figure, axes = plt.subplots(figsize=(5.4, 4.8), layout="constrained", subplot_kw={"projection": "polar"})
    around = np.radians(np.r_[found[:, 0], found[0, 0] + 360.0])
    for k, (law, line) in enumerate(zip(laws, ("-", "--", ":"), strict=True), 1):
        axes.plot(around, np.r_[found[:, k], found[0, k]], line, marker="o", markersize=4, label=law)
    axes.set_theta_zero_location("N")  # in the plot, ahead is up, and left is left
    axes.set_thetagrids(range(0, 360, 90), ["ahead", "left", "back", "right"])
    axes.set_rlim(0.0, 10.0 * np.ceil(found[:, 1:].max() / 10.0))
    axes.set_title("largest push that is survived (N s)")
    figure.legend(loc="outside lower center", ncols=3)
    save(figure, "wholebody_pushes.png")


def lift() -> None:
    """Plots the motion of TALOS that lifts a foot."""
    humanoid = Humanoid()
    record = humanoid.run(humanoid.control(humanoid.lift), 7.0)
    figure, (above, below) = plt.subplots(2, 1, figsize=(7.5, 4.6), layout="constrained", sharex=True)
    above.plot(record.t, 1e3 * record.wanted[:, 1], "k--", label="wanted")
    above.plot(record.t, 1e3 * record.com[:, 1], label="MuJoCo")
    above.set(ylabel="centre of mass, y (mm)")
    above.legend()
    for k, sole in enumerate(("left sole", "right sole")):
        below.plot(record.t, record.loads[:, k], label=sole)
    below.set(xlabel="t (s)", ylabel="vertical force (N)")
    below.legend()
    save(figure, "wholebody_lift.png")


def trot() -> None:
    """Plots the motion of ANYmal that trots for 20 s."""
    quadruped = Quadruped(urdf("anymal"), FEET, anymal())
    record = quadruped.run(20.0)
    figure, (above, below) = plt.subplots(2, 1, figsize=(7.5, 4.6), layout="constrained")
    error = 1e3 * (record.com - record.wanted)
    for axis, name in enumerate("xyz"):
        above.plot(record.t, error[:, axis], label=name, linewidth=0.9)
    above.set(xlabel="t (s)", ylabel="centre of mass,\noff the plan (mm)")
    above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    part = (record.t >= 5.0) & (record.t < 6.0)
    for k, foot in enumerate(FEET):
        below.plot(record.t[part], record.loads[part, k], label=foot)
    below.set(xlabel="t (s)", ylabel="vertical force (N)")
    below.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)
    save(figure, "wholebody_trot.png")
    ahead = record.com[-1, 0] - record.com[0, 0]
    print(f"{ahead:.2f} m in {record.t[-1]:.1f} s, at most {np.abs(error).max():.1f} mm off the plan")


if __name__ == "__main__":
    push()
    pushes()
    lift()
    trot()
