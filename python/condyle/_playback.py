"""Playback of a motion in the browser, with viser."""

import threading
import time
from collections.abc import Mapping, Sequence
from importlib import import_module
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Data, Model, forward_kinematics
from ._shapes import Shape, capsules, visuals
from .algebra import SE3, quaternion

_Array = NDArray[np.float64]
_Forces = Sequence[Mapping[str, ArrayLike]]
GREY, ORANGE = (158, 170, 186), (235, 120, 20)


class Player:
    """A motion shown in the browser, with the methods `show`, `play`, `pause` and `close`. In a notebook, the object
    displays the motion in the page.
    """

    def __init__(
        self, model: Model, q: _Array, dt: float, shapes: list[Shape], arrows: list[_Array], server: Any
    ) -> None:
        self.server, self.dt, self.knot = server, dt, 0
        self._poses = forward_kinematics(model, Data(model), q)
        self._arrows = arrows
        self._playing, self._closed = threading.Event(), threading.Event()
        self._moving = threading.Lock()
        scene = server.scene
        scene.set_up_direction("+z")
        scene.add_grid("/ground", width=4.0, height=4.0, cell_size=0.25)
        self.bodies = [scene.add_frame(f"/robot/{k}", show_axes=False) for k in range(model.nbodies)]
        for k, shape in enumerate(shapes):
            name = f"/robot/{shape.body}/{k}"
            X = SE3.from_homogeneous(shape.placement)
            at = {"position": X.translation, "wxyz": _wxyz(X.rotation)}
            if shape.mesh is not None:
                scene.add_mesh_trimesh(name, shape.mesh, **at)
            else:
                scene.add_mesh_simple(name, shape.vertices, shape.faces, color=shape.color or GREY, **at)
        self.arrows = None
        if any(len(points) for points in arrows):
            size = {"shaft_radius": 0.008, "head_radius": 0.02, "head_length": 0.05}
            self.arrows = scene.add_arrows("/forces", _some(arrows[0]), ORANGE, **size)
        last = len(self._poses) - 1
        self.slider = server.gui.add_slider("time (s)", 0.0, max(last, 1) * dt, dt, 0.0)
        self.button = server.gui.add_button("play")
        self.slider.on_update(lambda _: self.show(round(self.slider.value / dt)))
        self.button.on_click(lambda _: self.pause() if self._playing.is_set() else self.play())
        self._look(self._poses)
        self.show(0)
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """The address of the page in the browser."""
        return f"http://localhost:{self.server.get_port()}"

    def show(self, knot: int) -> None:
        """Shows a knot; for an index beyond the last knot, shows the last knot."""
        with self._moving:
            self.knot = min(max(knot, 0), len(self._poses) - 1)
            with self.server.atomic():
                for body, pose in zip(self.bodies, self._poses[self.knot], strict=True):
                    body.position, body.wxyz = pose[:3, 3], _wxyz(pose[:3, :3])
                if self.arrows is not None:
                    points = self._arrows[min(self.knot, len(self._arrows) - 1)]
                    self.arrows.visible = len(points) > 0
                    if len(points):
                        self.arrows.points = points.astype(np.float32)
        if round(self.slider.value / self.dt) != self.knot:
            self.slider.value = self.knot * self.dt

    def play(self) -> None:
        """Plays the motion from the current knot, in a loop, until `pause` is called."""
        self.button.label = "pause"
        self._playing.set()

    def pause(self) -> None:
        """Stops the motion at the current knot."""
        self.button.label = "play"
        self._playing.clear()

    def close(self) -> None:
        """Stops the web server."""
        self._closed.set()
        self._playing.set()
        self._thread.join()
        self.server.stop()

    def _run(self) -> None:
        while True:
            self._playing.wait()
            begin, first = time.perf_counter(), self.knot
            while self._playing.is_set():
                if self._closed.is_set():
                    return
                gone = int((time.perf_counter() - begin) / self.dt)
                knot = (first + gone) % len(self._poses)
                if knot != self.knot:
                    self.show(knot)
                time.sleep(min(self.dt, 1.0 / 60.0))

    def _look(self, poses: _Array) -> None:
        """Sets the initial camera so that the whole motion is visible."""
        points = poses[:, 1:, :3, 3].reshape(-1, 3)
        low, high = points.min(0), points.max(0)
        middle, far = (low + high) / 2.0, 0.6 + 0.9 * np.linalg.norm(high - low)
        self.server.initial_camera.look_at = tuple(middle)
        self.server.initial_camera.position = tuple(middle + far * np.array([0.75, -0.8, 0.35]))

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" width="100%" height="480" style="border:0"></iframe>'

    def __repr__(self) -> str:
        return f"<condyle.viz.Player at {self.url}: {len(self._poses)} knots>"


def play(
    model: Model,
    q: ArrayLike,
    dt: float,
    forces: _Forces | None = None,
    urdf: str | PathLike[str] | None = None,
    packages: Sequence[str | PathLike[str]] = (),
    newtons_per_metre: float = 500.0,
    port: int = 8080,
) -> Player:
    """Shows a motion in the browser, at the address of the returned `Player`.

    q: positions, (N, nq), such as `solution.xs[:, :model.nq]`; the positions are shown without checks.
    dt: the time from one knot to the next (s).
    forces: contact forces of each knot, by the name of a frame. The first three numbers of a force, along the world's
        axes, are drawn as an arrow at the frame. `solution.forces` has this form if contacts have the names of their
        frames and the reference 'local_world_aligned'.
    urdf: the file with the robot's shapes and meshes; `packages` are folders for `package://`. Without a URDF, and for
        missing meshes, bodies are shown as capsules from joint to joint.
    port: the page's port; if it is in use, the next free port is taken.

    Raises ImportError without viser (pip install condyle[viz]).
    """
    try:
        viser = import_module("viser")
    except ImportError as error:
        raise ImportError("playback needs viser: pip install condyle[viz]") from error
    q = np.atleast_2d(np.asarray(q, float))
    if q.ndim != 2 or q.shape[1] != model.nq or not len(q):
        raise ValueError(f"q: expected shape (N, {model.nq}) with N ≥ 1, found {q.shape}")
    if not dt > 0.0:
        raise ValueError(f"dt: expected a positive time, found {dt}")
    arrows = _arrows(model, q, forces or [], newtons_per_metre)
    shapes = capsules(model) if urdf is None else visuals(model, urdf, packages)
    return Player(model, q, dt, shapes, arrows, viser.ViserServer(port=port, verbose=False))


def _arrows(model: Model, q: _Array, forces: _Forces, scale: float) -> list[_Array]:
    """Returns the arrows of each knot as pairs of end points, (n, 2, 3)."""
    data, out = Data(model), []
    for position, knot in zip(q, forces, strict=False):
        poses, ends = forward_kinematics(model, data, position), []
        for name, force in knot.items():
            f = np.asarray(force, float)
            if f.ndim != 1 or len(f) < 3:
                raise ValueError(f"forces: expected three numbers or more for `{name}`, found shape {f.shape}")
            frame = model.frames[model.frame(name)]
            at = (poses[frame.body] @ frame.placement)[:3, 3]
            ends.append([at, at + f[:3] / scale])
        out.append(np.array(ends).reshape(-1, 2, 3))
    return out or [np.zeros((0, 2, 3))]


def _some(points: _Array) -> NDArray[np.float32]:
    """Returns the points of arrows, or an invisible arrow if there are no arrows, since viser needs at least one
    arrow.
    """
    return (points if len(points) else np.zeros((1, 2, 3))).astype(np.float32)


def _wxyz(R: _Array) -> _Array:
    return quaternion(R)[..., [3, 0, 1, 2]]
