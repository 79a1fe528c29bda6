"""Pictures: plots of a solution and of the zeros of a matrix with matplotlib, and playback of a motion in the browser
with viser.

    pip install condyle[viz]

>>> from condyle import viz
>>> arm = condyle.robots.arm7()
>>> viz.pattern(arm).all()  # one chain: no zeros
np.True_
>>> viz.pattern(condyle.robots.quadruped()).sum()  # of 324: the legs do not see each other
np.int64(180)

`play` shows a motion in the browser, also in a notebook. `plot` and `spy` return figures of matplotlib:
`matplotlib.pyplot.show()` displays them, and `figure.savefig(path)` saves a figure to a file. matplotlib and viser are
imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Model
from ._playback import Player, play
from ._types import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Player", "pattern", "play", "plot", "spy"]

_Array = NDArray[np.float64]
_NAMES = 14  # maximum number of labels in a plot: more lines cannot be distinguished


def pattern(model: Model) -> NDArray[np.bool_]:
    """Returns for each entry of M(q) whether the structure of the tree allows the entry to differ from zero, (nv, nv).

    M_ij = 0 unless joint i carries joint j, or joint j carries joint i (Featherstone 2008, section 8.5). With mimic
    joints, M = Gᵀ M' G. M' is the inertia matrix of the tree with all joints free, and G maps the velocities v to the
    velocities of all joints.
    """
    widths = [joint.nv if joint else 0 for joint in model.joints]
    related = np.eye(model.nbodies, dtype=bool)
    for body, parent in enumerate(model.parents[1:], start=1):
        related[body] |= related[parent]  # the row of a body contains the body and all its ancestors
    related |= related.T
    G = np.zeros((model.nv, model.nbodies), bool)  # G[k, b]: whether coordinate k moves the joint of body b
    for body in range(1, model.nbodies):
        G[model.idx_vs[body] : model.idx_vs[body] + widths[body], body] = True
    out: NDArray[np.bool_] = G @ related @ G.T
    return out


def spy(M: ArrayLike, model: Model, tolerance: float = 1e-12) -> "Figure":
    """Plots the entries of M that are not zero, together with the entries that the tree allows to be nonzero.

    M: a matrix (nv, nv), as returned by `crba`, `minv` or a derivative. An inverse has fewer zeros than M if joints
        share a moving base.
    tolerance: magnitude up to which an entry counts as zero, relative to the largest entry.
    """
    M = np.asarray(M, float)
    if M.shape != (model.nv, model.nv):
        raise ValueError(f"M: expected shape ({model.nv}, {model.nv}), found {M.shape}")
    figure: Figure
    figure, axes = _pyplot().subplots(1, 2, figsize=(9.0, 4.6), sharex=True, sharey=True, layout="constrained")
    there = np.abs(M) > tolerance * np.abs(M).max(initial=0.0)
    predicted = pattern(model)
    for plot, entries, title in ((axes[0], there, "not zero"), (axes[1], predicted, "by the tree")):
        plot.imshow(entries, cmap="Blues", vmin=0.0, vmax=1.3, interpolation="nearest")
        plot.set_title(f"{title}: {int(entries.sum())} of {entries.size}")
        plot.set_xticks(range(model.nv), minor=True)
    beyond = np.argwhere(there & ~predicted)
    axes[0].plot(beyond[:, 1], beyond[:, 0], "rx", markersize=4, label="outside of the tree's")
    if len(beyond):
        axes[0].legend(loc="upper right")
    return figure


def plot(solution: Solution, model: Model, dt: float | None = None) -> "Figure":
    """Plots the positions, velocities and controls of a solution over time, and the convergence of the solver.

    dt: the time between two knots (s), if this time is the same for all knots; None plots over the index of the knot.
    """
    xs = np.asarray(solution.xs, float)
    if xs.ndim != 2 or xs.shape[1] != model.nq + model.nv:
        raise ValueError(f"solution.xs: expected states of {model.nq + model.nv} numbers, found shape {xs.shape}")
    figure: Figure
    figure, axes = _pyplot().subplots(4, 1, figsize=(9.0, 11.0), layout="constrained")
    time = np.arange(len(xs)) * (1.0 if dt is None else dt)
    velocities = _labels(model, model.idx_vs, model.nvs)
    _lines(axes[0], time, xs[:, : model.nq], _labels(model, model.idx_qs, model.nqs), "q")
    _lines(axes[1], time, xs[:, model.nq :], velocities, "v")
    controls = [np.asarray(u, float) for u in solution.us]
    width = max(map(len, controls), default=0)
    us = np.array([np.r_[u, np.full(width - len(u), np.nan)] for u in controls]).reshape(len(controls), width)
    named = velocities[-width:] if 0 < width <= model.nv else [str(k) for k in range(width)]
    _lines(axes[2], time[:-1], us, named, "u", steps=True)
    axes[0].sharex(axes[1])
    axes[2].sharex(axes[1])
    axes[2].set_xlabel("knot" if dt is None else "time (s)")
    iterations = [one.iteration for one in solution.trace]
    for name, label in (("cost", "cost"), ("stop", "expected decrease"), ("gap", "largest gap")):
        axes[3].plot(iterations, _positive([getattr(one, name) for one in solution.trace]), ".-", label=label)
    axes[3].set_yscale("log")
    axes[3].xaxis.get_major_locator().set_params(integer=True)
    axes[3].set_xlabel("iteration")
    axes[3].legend(loc="upper right", fontsize="small")
    axes[3].set_title(f"{solution.status}: cost {solution.cost:.6g}", fontsize="medium")
    return figure


def _lines(axes: Any, time: Any, values: _Array, labels: list[str], name: str, steps: bool = False) -> None:
    axes.set_prop_cycle(color=_pyplot().get_cmap("tab20").colors)
    draw = axes.step if steps else axes.plot
    draw(time, values, label=labels, **({"where": "post"} if steps else {}))
    axes.set_ylabel(name)
    axes.grid(alpha=0.3)
    if len(labels) <= _NAMES:
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize="x-small")


def _labels(model: Model, first: list[int], count: list[int]) -> list[str]:
    """Returns a label for each coordinate: the name of its joint, with a number if the joint has several
    coordinates.
    """
    labels = [""] * sum(count)
    for name, at, n in zip(model.names, first, count, strict=True):
        for k in range(n):
            labels[at + k] = name if n == 1 else f"{name}[{k}]"
    return labels


def _positive(numbers: list[float]) -> _Array:
    """Replaces numbers that a logarithmic axis cannot show by NaN."""
    x = np.array(numbers, float)
    return np.where(x > 0.0, x, np.nan)


def _pyplot() -> Any:
    try:
        return import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ImportError("plots need matplotlib: pip install condyle[viz]") from error
