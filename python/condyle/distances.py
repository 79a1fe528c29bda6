"""Signed distances between shapes on a robot and in the world, with exact gradients.

A `Geometry` is a `Shape` on a frame of the robot or in the world. `DistancePairs` prepares pairs of geometries for one
robot, and `distances` computes their distances at one or many positions:

>>> from condyle.distances import DistancePairs, Geometry, Shape, distances
>>> arm = condyle.robots.arm7()
>>> tool = Geometry(Shape.capsule([0, 0, -0.1], [0, 0, 0.1], 0.03), frame="tool")
>>> floor = Geometry(Shape.half_space([0, 0, 1]), name="floor")
>>> pairs = DistancePairs(arm, [(tool, floor)])
>>> found = distances(pairs, arm, condyle.Data(arm), [0.3] * 7)
>>> found.distance.shape, found.points.shape, found.gradient.shape
((1,), (1, 2, 3), (1, 7))

A distance is negative while the shapes overlap; then it is the shortest translation that separates them. The normal
points from the second to the first shape. Sphere, capsule, box and half-space are exact in all pairs. A cylinder or an
ellipsoid is exact with spheres and half-spaces; otherwise a capsule that contains it takes its place
(`DistancePairs.replacements`). Meshes are not supported, and neither is the detection of collisions between two
positions.

`Collisions` reads the shapes of a robot's file, and lists the pairs that can collide.
"""

import os
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Data, Model, _Collisions, _DistancePairs

__all__ = [
    "Collisions",
    "DistanceLimits",
    "DistancePairs",
    "Distances",
    "Geometry",
    "GeometryPair",
    "Shape",
    "distances",
]


def _three(name: str, value: ArrayLike) -> list[float]:
    array = np.asarray(value, dtype=float)
    if array.shape != (3,):
        raise ValueError(f"{name}: expected shape (3,), found {array.shape}")
    return [float(x) for x in array]


class Shape(NamedTuple):
    """A shape in its own coordinates (m). Use a constructor: `sphere`, `capsule`, `box`, `cylinder`, `ellipsoid` or
    `half_space`.

    >>> from condyle.distances import Shape
    >>> Shape.sphere([0, 0, 0.1], 0.05).kind
    'sphere'
    """

    kind: Literal["sphere", "capsule", "box", "cylinder", "ellipsoid", "half_space"]
    """The kind of the shape."""
    numbers: dict[str, Any]
    """The numbers of the shape, by name."""

    @staticmethod
    def sphere(center: ArrayLike, radius: float) -> "Shape":
        """Returns a sphere; a point if the radius is 0."""
        return Shape("sphere", {"center": _three("center", center), "radius": float(radius)})

    @staticmethod
    def capsule(start: ArrayLike, end: ArrayLike, radius: float) -> "Shape":
        """Returns the points within a radius of the segment from `start` to `end`."""
        return Shape("capsule", {"ends": [_three("start", start), _three("end", end)], "radius": float(radius)})

    @staticmethod
    def box(half_sizes: ArrayLike) -> "Shape":
        """Returns a box with half side lengths along its axes."""
        return Shape("box", {"half_sizes": _three("half_sizes", half_sizes)})

    @staticmethod
    def cylinder(radius: float, half_length: float) -> "Shape":
        """Returns a cylinder about the axis z."""
        return Shape("cylinder", {"radius": float(radius), "half_length": float(half_length)})

    @staticmethod
    def ellipsoid(radii: ArrayLike) -> "Shape":
        """Returns an ellipsoid with semi-axes along x, y and z."""
        return Shape("ellipsoid", {"radii": _three("radii", radii)})

    @staticmethod
    def half_space(normal: ArrayLike, offset: float = 0.0) -> "Shape":
        """Returns all points x with normal · x ≤ offset; the normal is a unit vector."""
        return Shape("half_space", {"normal": _three("normal", normal), "offset": float(offset)})


def _finite(name: str, numbers: Iterable[float]) -> None:
    for number in numbers:
        if not np.isfinite(number):
            raise ValueError(f"{name}: expected finite numbers, found {number}")


def _vector(numbers: Sequence[float]) -> dict[str, float]:
    return dict(zip("xyz", numbers, strict=True))


def _numbers(vector: dict[str, float]) -> list[float]:
    return [vector["x"], vector["y"], vector["z"]]


_VECTORS = {"center", "half_sizes", "radii", "normal"}


def _encoded(shape: Shape) -> dict[str, Any]:
    def value(name: str, x: Any) -> Any:
        _finite(f"{name} of a {shape.kind}", np.ravel(x))
        if name == "ends":
            return [_vector(end) for end in x]
        return _vector(x) if name in _VECTORS else x

    return {shape.kind: {name: value(name, x) for name, x in shape.numbers.items()}}


def _decoded(shape: dict[str, Any]) -> Shape:
    def value(name: str, x: Any) -> Any:
        if name == "ends":
            return [_numbers(end) for end in x]
        return _numbers(x) if name in _VECTORS else x

    kind: Any
    ((kind, numbers),) = shape.items()
    return Shape(kind, {name: value(name, x) for name, x in numbers.items()})


class Geometry(NamedTuple):
    """A shape that is fixed to a frame of the robot, or to the world."""

    shape: Shape
    """The shape in its own coordinates."""
    frame: str | int | None = None
    """The frame, by name or by index in the model; None for the world."""
    placement: ArrayLike | None = None
    """The pose of the shape in the frame or the world, a matrix (4, 4); None for the identity."""
    name: str = ""
    """The name of the geometry, for `DistancePairs.place` and for messages."""


GeometryPair = tuple[Geometry, Geometry]
"""Two geometries whose distance is computed. At least one is fixed to a frame of the robot."""


def _geometry(model: Model, geometry: Geometry) -> dict[str, Any]:
    found: dict[str, Any] = {"name": geometry.name, "shape": _encoded(geometry.shape)}
    if geometry.frame is not None:
        frame = geometry.frame
        index = frame if isinstance(frame, int) else model.frame(frame)
        if not 0 <= index < len(model.frames):
            raise IndexError(f"frame: expected an index below {len(model.frames)}, found {index}")
        found["frame"] = {"name": model.frames[index].name, "kind": model.frames[index].kind.title()}
    if geometry.placement is not None:
        pose = np.asarray(geometry.placement, dtype=float)
        if pose.shape != (4, 4):
            raise ValueError(f"placement: expected shape (4, 4), found {pose.shape}")
        _finite("placement", pose.ravel())
        if not np.allclose(pose[3], [0.0, 0.0, 0.0, 1.0], rtol=0.0, atol=1e-9):
            raise ValueError(f"placement: expected the last row (0, 0, 0, 1), found {pose[3].tolist()}")
        columns = {axis: _vector([float(x) for x in pose[:3, k]]) for k, axis in enumerate("xyz")}
        found["placement"] = {"rotation": columns, "translation": _vector([float(x) for x in pose[:3, 3]])}
    return found


def _text(model: Model, geometry: Geometry) -> str:
    """Returns a geometry in JSON, for the compiled part of the package."""
    import json

    return json.dumps(_geometry(model, geometry))


def _read(geometry: dict[str, Any]) -> Geometry:
    placement = None
    if "placement" in geometry:
        placement = np.eye(4)
        for k, axis in enumerate("xyz"):
            placement[:3, k] = _numbers(geometry["placement"]["rotation"][axis])
        placement[:3, 3] = _numbers(geometry["placement"]["translation"])
    frame = geometry.get("frame")
    return Geometry(_decoded(geometry["shape"]), frame and frame["name"], placement, geometry.get("name", ""))


def _read_pairs(text: str) -> list[GeometryPair]:
    """Returns the pairs in a text in JSON, from the compiled part of the package."""
    import json

    return [(_read(pair["first"]), _read(pair["second"])) for pair in json.loads(text)]


class DistancePairs:
    """Pairs of geometries, prepared for one robot.

    model: the robot; pairs: a list of pairs of `Geometry`.

    Raises `ModelError` for an unknown frame, a negative size and a pair without a frame. Other causes are two
    half-spaces, a geometry with itself, two geometries of one moving body, a pair that is listed twice, and two
    different geometries of one name.
    """

    def __init__(self, model: Model, pairs: Iterable[GeometryPair]) -> None:
        import json

        self.pairs: list[GeometryPair] = [(first, second) for first, second in pairs]
        """The pairs, as they were given."""
        encoded = [{"first": _geometry(model, a), "second": _geometry(model, b)} for a, b in self.pairs]
        self._prepared = _DistancePairs(model, json.dumps(encoded))

    def __len__(self) -> int:
        """Returns the number of pairs."""
        return len(self.pairs)

    @property
    def replacements(self) -> list[tuple[int, int, str]]:
        """The geometries that a capsule replaces: index of the pair, index in the pair (0 or 1) and kind of shape."""
        return self._prepared._replacements()

    @property
    def cutoff(self) -> float:
        """The largest distance of interest (m), infinite at first. If the bounding spheres of a pair are farther apart,
        its distance is a lower bound, and its gradient is 0."""
        return self._prepared.cutoff

    @cutoff.setter
    def cutoff(self, distance: float) -> None:
        self._prepared.cutoff = distance

    def place(self, name: str, placement: ArrayLike) -> None:
        """Sets the placement of the geometry with a name, for example of a moving obstacle.

        placement: the pose (4, 4) in the geometry's frame, or in the world.

        Raises `ValueError` if no geometry has this name, or if the placement is not a pose.
        """
        index = self._prepared._find(name)
        if index is None:
            raise ValueError(f"name: no geometry is named {name!r}")
        self._prepared._place(index, placement)


class DistanceLimits(NamedTuple):
    """Limits of the distances d of pairs of geometries, which approach a minimum over a look-ahead time T. Inverse
    kinematics limits the rate of d, and whole-body control its acceleration:

        ḋ ≥ −(d − d_min) / T                            `condyle.ik`
        d̈ ≥ −(2 / T) ḋ − (d − d_min) / T²               `condyle.wholebody`
        ḋ = ∂d/∂q v + ∂d/∂t

    ∂d/∂t follows from the velocities of obstacles, which `place` of a controller takes. A pair that is too near moves
    apart. If the limits of the joints do not allow this for all pairs at once, a step of inverse kinematics keeps the
    pairs from coming nearer, and its status is 'relaxed'. In whole-body control, the bounds become tasks of large
    weight at such a tick.
    """

    pairs: Sequence[GeometryPair]
    """The pairs of geometries."""
    minimum: float = 0.01
    """The minimum distance d_min (m)."""
    look_ahead: float = 0.1
    """The look-ahead time T (s), which should be at least some ticks."""
    max_acceleration: float = 50.0
    """The largest acceleration that a bound of whole-body control asks for (m/s²)."""
    range: float = 0.2
    """The distance above d_min beyond which a pair has no limit (m)."""


class Distances(NamedTuple):
    """The distances of n pairs. For N positions, each array has a first axis N."""

    distance: NDArray[np.float64]
    """The signed distances (m), shape (n,)."""
    points: NDArray[np.float64]
    """The nearest points on the first and the second shape, in the world (m), shape (n, 2, 3)."""
    normal: NDArray[np.float64]
    """The unit vectors from the second to the first shape, in the world, shape (n, 3)."""
    gradient: NDArray[np.float64] | None
    """The gradients with respect to the tangent of q, shape (n, nv); None if they were not asked for."""


def distances(pairs: DistancePairs, model: Model, data: Data, q: ArrayLike, *, gradient: bool = True) -> Distances:
    """Computes the signed distances of all pairs at one or many positions.

    pairs: the prepared pairs; q: a position (nq,), or many positions (N, nq); gradient: whether gradients are computed.

    >>> from condyle.distances import DistancePairs, Geometry, Shape, distances
    >>> arm = condyle.robots.arm7()
    >>> tool, ball = Geometry(Shape.sphere([0, 0, 0], 0.05), "tool"), Geometry(Shape.sphere([0.5, 0, 0.5], 0.1))
    >>> pairs = DistancePairs(arm, [(tool, ball)])
    >>> found = distances(pairs, arm, condyle.Data(arm), np.zeros((20, 7)))
    >>> found.distance.shape, found.gradient.shape
    ((20, 1), (20, 1, 7))
    """
    positions = np.asarray(q, dtype=float)
    if positions.ndim not in (1, 2) or positions.shape[-1] != model.nq:
        raise ValueError(f"q: expected shape ({model.nq},) or (N, {model.nq}), found {positions.shape}")
    many = np.atleast_2d(positions)
    found = pairs._prepared._evaluate(model, data, many, len(many), gradient)
    arrays = [array if positions.ndim == 2 else array[0] for array in found]
    return Distances(arrays[0], arrays[1], arrays[2], arrays[3] if gradient else None)


class Collisions:
    """The collision shapes of a robot's file: spheres, capsules, boxes, cylinders, ellipsoids and half-spaces.

    Use a constructor: `from_file` or `from_text`.

    >>> from condyle.distances import Collisions
    >>> urdf = '''<robot name="two"><link name="base"/><link name="arm"><collision><geometry>
    ...   <sphere radius="0.1"/></geometry></collision></link>
    ...   <joint name="a" type="continuous"><parent link="base"/><child link="arm"/></joint></robot>'''
    >>> [geometry.name for geometry in Collisions.from_text(urdf).geometries]
    ['arm_0']
    """

    def __init__(self, inner: _Collisions) -> None:
        self._inner = inner

    @staticmethod
    def from_file(path: str | os.PathLike[str], packages: Sequence[str | os.PathLike[str]] = ()) -> "Collisions":
        """Reads the collision shapes of a URDF (also `.xacro`), MJCF or SDF file. The root element of the file tells
        the format.

        packages: folders that contain packages, for `package://` addresses.

        Raises `ParseError`, with file, line and element.
        """
        with open(path, encoding="utf-8", errors="replace") as file:
            kind = _format(file.read())
        return Collisions(_Collisions(kind, os.fspath(path), None, [os.fspath(folder) for folder in packages]))

    @staticmethod
    def from_text(text: str) -> "Collisions":
        """Reads the collision shapes of a URDF, MJCF or SDF in a string."""
        return Collisions(_Collisions(_format(text), None, text, []))

    @property
    def geometries(self) -> list[Geometry]:
        """The shapes, in the order of the file, with different names. A shape without a name, or with the name of an
        earlier shape, is named `link_k`."""
        import json

        return [_read(geometry) for geometry in json.loads(self._inner._geometries())]

    @property
    def meshes(self) -> list[tuple[str, str, str]]:
        """The meshes that no shape replaces: name, link and file."""
        return self._inner._meshes()

    @property
    def warnings(self) -> list[str]:
        """A message for each shape of the file that is left out, with the reason."""
        return self._inner._warnings()

    def fit_meshes(self, shape: Literal["capsule", "sphere"] = "capsule") -> int:
        """Replaces each mesh that can be read (STL, OBJ) by a shape that contains it. Returns the number of these
        meshes."""
        return self._inner._fit(shape)

    def disable(self, first: str, second: str) -> None:
        """Removes all pairs of geometries on two links; `world` is the link of the world.

        Raises `ModelError` for a link without collision shapes.
        """
        self._inner._disable(first, second)

    def read_srdf(self, path: str | os.PathLike[str]) -> None:
        """Removes the pairs of links that an SRDF file lists as `<disable_collisions>`."""
        self._inner._srdf(os.fspath(path), None)

    def pairs(self, model: Model) -> list[GeometryPair]:
        """Returns all pairs that can collide. Pairs of one body and of bodies that a joint connects are left out, and
        so are disabled pairs, `<exclude>`s and masks (`contype`, `conaffinity`) of an MJCF."""
        import json

        both = json.loads(self._inner._pairs(model))
        return [(_read(pair["first"]), _read(pair["second"])) for pair in both]


def _format(text: str) -> str:
    """Returns the format of a robot's file from its root element."""
    found = [(text.find(f"<{tag}"), kind) for tag, kind in _ROOTS.items() if f"<{tag}" in text]
    if not found:
        raise ValueError("expected a <robot> (URDF), <mujoco> (MJCF) or <sdf>")
    return min(found)[1]


_ROOTS = {"robot": "urdf", "mujoco": "mjcf", "mujocoinclude": "mjcf", "sdf": "sdf"}
