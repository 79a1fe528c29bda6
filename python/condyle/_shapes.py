"""Shapes of a robot's bodies: shapes of the robot's URDF, or capsules from joint to joint."""

import os
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Model
from .algebra import exp3

_Array = NDArray[np.float64]


class Shape(NamedTuple):
    """A shape on a body: a mesh of the package trimesh, or triangles."""

    body: int
    placement: _Array
    vertices: _Array
    faces: NDArray[np.int64]
    color: tuple[int, int, int] | None = None
    mesh: Any = None


def capsules(model: Model, only: set[int] | None = None) -> list[Shape]:
    """Returns capsules from the origin of a body to each joint and link frame on this body, for all bodies or the
    bodies in `only`.
    """
    ends: list[list[_Array]] = [[] for _ in range(model.nbodies)]
    for body in range(1, model.nbodies):
        ends[model.parents[body]].append(model.joint_placements[body][:3, 3])
    for frame in model.frames:
        if not (ends[frame.body] and frame.kind != "link"):
            ends[frame.body].append(frame.placement[:3, 3])
    lengths = [float(np.linalg.norm(end)) for of in ends[1:] for end in of]
    radius = min(max(0.15 * float(np.median(lengths or [0.2])), 0.01), 0.06)
    out = []
    for body in range(1, model.nbodies):
        if only is not None and body not in only:
            continue
        drawn = [np.zeros(3)]
        for end in ends[body]:
            if all(np.linalg.norm(end - other) > radius for other in drawn):
                drawn.append(end)
                out.append(Shape(body, _along(end), *capsule(radius, float(np.linalg.norm(end)))))
    return out


def capsule(radius: float, length: float, sides: int = 16, rings: int = 4) -> tuple[_Array, NDArray[np.int64]]:
    """Returns the triangles of a cylinder along z, from z = 0 to z = `length`, with half a ball on each end."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, 2 * rings + 2)
    profile = np.stack([radius * np.cos(angles), radius * np.sin(angles)], -1)
    profile[rings + 1 :, 1] += length
    return _turned(profile, sides)


def _turned(profile: _Array, sides: int) -> tuple[_Array, NDArray[np.int64]]:
    """Returns the triangles of the surface that a profile (r, z) forms when the profile rotates about z."""
    turn = 2.0 * np.pi * np.arange(sides) / sides
    r, z = profile[:, :1], profile[:, 1:]
    vertices = np.stack([r * np.cos(turn), r * np.sin(turn), np.broadcast_to(z, (len(profile), sides))], -1)
    ring, side = (grid.ravel() for grid in np.mgrid[: len(profile) - 1, :sides])
    a, b = ring * sides + side, ring * sides + (side + 1) % sides
    faces = np.concatenate([np.stack([a, b, b + sides], -1), np.stack([a, b + sides, a + sides], -1)])
    return vertices.reshape(-1, 3), faces


def _along(end: _Array) -> _Array:
    """Returns a pose at the origin whose z axis points to `end`."""
    X, length = np.eye(4), np.linalg.norm(end)
    if length > 0.0:
        z = end / length
        axis = np.cross([0.0, 0.0, 1.0], z)
        sine = np.linalg.norm(axis)
        angle = np.arctan2(sine, z[2])
        X[:3, :3] = exp3(axis / sine * angle) if sine > 1e-12 else np.diag([1.0, z[2], z[2]])
    return X


def visuals(model: Model, urdf: str | os.PathLike[str], packages: Sequence[str | os.PathLike[str]]) -> list[Shape]:
    """Returns the shapes of a URDF's `<visual>`s, and capsules for bodies without a readable shape."""
    path = Path(urdf)
    root = import_module("xml.etree.ElementTree").parse(path).getroot()
    links = {frame.name: frame for frame in model.frames if frame.kind == "link"}
    out: list[Shape] = []
    for link in root.iter("link"):
        frame = links.get(link.get("name", ""))
        for visual in link.iter("visual") if frame else ():
            shape = _triangles(visual, path, [Path(folder) for folder in packages])
            if frame is not None and shape is not None:
                placement = frame.placement @ _origin(visual.find("origin"))
                out.append(shape._replace(body=frame.body, placement=placement, color=_color(visual, root)))
    missing = set(range(1, model.nbodies)) - {shape.body for shape in out}
    return out + capsules(model, missing)


def _triangles(visual: Any, path: Path, packages: list[Path]) -> Shape | None:
    """Returns the shape of a `<visual>` at the origin of its body; None if the mesh is missing or cannot be read."""
    geometry = visual.find("geometry")
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        return None
    if shape.tag == "box":
        return _simple(*_box(np.array(shape.get("size").split(), float) / 2.0))
    if shape.tag == "cylinder":
        r, half = float(shape.get("radius")), float(shape.get("length")) / 2.0
        return _simple(*_turned(np.array([[0.0, -half], [r, -half], [r, half], [0.0, half]]), 32))
    if shape.tag == "sphere":
        return _simple(*capsule(float(shape.get("radius")), 0.0, 24, 8))
    if shape.tag != "mesh":
        return None
    file = mesh_path(shape.get("filename", ""), path, packages)
    if file is None:
        return None
    try:
        mesh = import_module("trimesh").load(file, force="mesh")
    except Exception:  # no reader for this format is installed, or the file is invalid
        return None
    mesh.apply_scale(np.array((shape.get("scale") or "1 1 1").split(), float))
    return Shape(0, np.eye(4), np.zeros((0, 3)), np.zeros((0, 3), int), mesh=mesh)


def _simple(vertices: _Array, faces: NDArray[np.int64]) -> Shape:
    return Shape(0, np.eye(4), vertices, faces)


def _box(half: _Array) -> tuple[_Array, NDArray[np.int64]]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])


def mesh_path(name: str, urdf: Path, packages: Sequence[Path]) -> Path | None:
    """Returns the file of a mesh, given by its path. A path with `package://` is searched in the given folders, in the
    folders above the URDF, and in the folders of ROS's packages.
    """
    if not name.startswith("package://"):
        file = urdf.parent / name.removeprefix("file://")
        return file if file.is_file() else None
    package, _, rest = name.removeprefix("package://").partition("/")
    ros = [Path(folder) for folder in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if folder]
    for folder in (*packages, *urdf.resolve().parents, *ros):
        for file in (folder / package / rest, folder / rest if folder.name == package else folder / package / rest):
            if file.is_file():
                return file
    return None


def _origin(origin: Any) -> _Array:
    """Returns the pose of an `<origin>`: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    X = np.eye(4)
    if origin is not None:
        roll, pitch, yaw = np.array((origin.get("rpy") or "0 0 0").split(), float)
        about = np.eye(3)
        X[:3, :3] = exp3(yaw * about[2]) @ exp3(pitch * about[1]) @ exp3(roll * about[0])
        X[:3, 3] = np.array((origin.get("xyz") or "0 0 0").split(), float)
    return X


def _color(visual: Any, root: Any) -> tuple[int, int, int] | None:
    """Returns the colour of a `<visual>`: the colour in the element, or the colour of the robot's material that the
    element names.
    """
    material = visual.find("material")
    if material is None:
        return None
    named = {m.get("name"): m for m in root.findall("material")}
    color = material.find("color")
    if color is None and material.get("name") in named:
        color = named[material.get("name")].find("color")
    if color is None:
        return None
    r, g, b = (round(255.0 * float(x)) for x in color.get("rgba").split()[:3])
    return r, g, b
