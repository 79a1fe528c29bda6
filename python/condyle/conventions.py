"""Conversion of numbers to the conventions of other libraries and back: orders, frames and signs.

Condyle has the same conventions as Pinocchio. Spatial vectors have their linear part first, quaternions are x, y, z, w,
and the velocity of a body is along the body's axes. An external force acts at the body's origin, along the body's axes.
Each function of this module takes arrays with any number of additional axes in front, so batches need no loop.

>>> import condyle, numpy as np
>>> from condyle import conventions
>>> conventions.swap_halves([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])  # angular first, as Featherstone, RBDL and Drake have it
array([4., 5., 6., 1., 2., 3.])
>>> conventions.wxyz([0.0, 0.0, 0.6, 0.8])  # as MuJoCo and Drake have it
array([0.8, 0. , 0. , 0.6])

`MujocoRobot` reads states from a simulation in MuJoCo, and writes efforts to its actuators; it finds joints and
actuators by their names. `Coordinates` converts states of a robot to another library's coordinates:

>>> quadruped = condyle.robots.quadruped()
>>> mujoco = conventions.Coordinates(quadruped, "mujoco")
>>> q, v = condyle.random_configuration(quadruped, seed=1), np.arange(18.0)
>>> qpos, qvel = mujoco.position(q), mujoco.velocity(q, v)
>>> np.allclose(mujoco.position_from(qpos), q) and np.allclose(mujoco.velocity_from(qpos, qvel), v)
True
"""

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Model
from ._mujoco_robot import MujocoRobot

__all__ = [
    "LIBRARIES",
    "Coordinates",
    "FreeJoint",
    "MujocoRobot",
    "classical_acceleration",
    "rotation",
    "spatial_acceleration",
    "swap_blocks",
    "swap_halves",
    "twist_to_body",
    "twist_to_world",
    "wrench_to_body",
    "wrench_to_world",
    "wxyz",
    "xyzw",
]

_Array = NDArray[np.float64]


def swap_halves(x: ArrayLike, axis: int = -1) -> _Array:
    """Exchanges the linear and angular halves of spatial vectors along an axis of length 6. A second call restores the
    vectors.

    A Jacobian of shape (6, nv) is swapped along axis -2. Raises a ValueError if the axis has another length.
    """
    x = np.asarray(x, float)
    if x.shape[axis] != 6:
        raise ValueError(f"x: expected 6 along axis {axis}, found shape {x.shape}")
    return np.roll(x, 3, axis)


def swap_blocks(X: ArrayLike) -> _Array:
    """Exchanges the linear and angular halves of the rows and of the columns of matrices (…, 6, 6), which map spatial
    vectors to spatial vectors.
    """
    return swap_halves(swap_halves(X, -1), -2)


def wxyz(quaternion: ArrayLike) -> _Array:
    """Converts quaternions (…, 4) from x, y, z, w to w, x, y, z."""
    return np.roll(_last(quaternion, "quaternion", 4), 1, -1)


def xyzw(quaternion: ArrayLike) -> _Array:
    """Converts quaternions (…, 4) from w, x, y, z to x, y, z, w."""
    return np.roll(_last(quaternion, "quaternion", 4), -1, -1)


def rotation(quaternion: ArrayLike) -> _Array:
    """Returns the rotation matrices R, (…, 3, 3), of unit quaternions x, y, z, w. R maps coordinates in the body to
    coordinates in the parent.
    """
    Q = _last(quaternion, "quaternion", 4)
    xyz, w = Q[..., :3], Q[..., 3]
    outer = xyz[..., :, None] * xyz[..., None, :]
    square = (w**2 - (xyz**2).sum(-1))[..., None, None]
    R: _Array = square * np.eye(3) + 2.0 * outer + 2.0 * w[..., None, None] * _hat(xyz)
    return R


def wrench_to_body(oXb: ArrayLike, wrench: ArrayLike, point: ArrayLike = (0.0, 0.0, 0.0)) -> _Array:
    """Converts forces and moments (linear, angular), in the world's axes about `point`, to the form of `f_ext`.

    A force f_w and a moment n_w become f = Rᵀ f_w and n = Rᵀ (n_w + (point − p) × f_w), where (R, p) is the body's pose
    `oXb`, (…, 4, 4), in the world. For a wrench about the world's origin, omit `point`. Drake's forces and MuJoCo's
    `xfrc_applied` act at a point of the body: give the position of this point in the world.
    """
    R, p = _pose(oXb)
    f, n = _halves(wrench, "wrench")
    n = n + np.cross(np.asarray(point, float) - p, f)
    return np.concatenate([_turn_back(R, f), _turn_back(R, n)], -1)


def wrench_to_world(oXb: ArrayLike, wrench: ArrayLike, point: ArrayLike = (0.0, 0.0, 0.0)) -> _Array:
    """Converts forces in the form of `f_ext` to the world's axes about `point`: the inverse of `wrench_to_body`."""
    R, p = _pose(oXb)
    f, n = (_turn(R, half) for half in _halves(wrench, "wrench"))
    return np.concatenate([f, n + np.cross(p - np.asarray(point, float), f)], -1)


def twist_to_body(oXb: ArrayLike, twist: ArrayLike, point: ArrayLike | None = None) -> _Array:
    """Converts velocities (linear, angular), along the world's axes, to the body's frame. The linear part is the
    velocity of the body's point at `point`.

    A velocity (v_w, ω_w) becomes v = Rᵀ (v_w + ω_w × (p − point)) and ω = Rᵀ ω_w, where (R, p) is the body's pose `oXb`
    in the world. Without a point the linear part is the velocity of the body's origin (Pinocchio's
    LOCAL_WORLD_ALIGNED); the world's origin as the point gives Pinocchio's WORLD.
    """
    R, p = _pose(oXb)
    v, omega = _halves(twist, "twist")
    if point is not None:
        v = v + np.cross(omega, p - np.asarray(point, float))
    return np.concatenate([_turn_back(R, v), _turn_back(R, omega)], -1)


def twist_to_world(oXb: ArrayLike, twist: ArrayLike, point: ArrayLike | None = None) -> _Array:
    """Converts velocities in the body's frame to velocities of the body's point at `point`, along the world's axes: the
    inverse of `twist_to_body`.
    """
    R, p = _pose(oXb)
    v, omega = (_turn(R, half) for half in _halves(twist, "twist"))
    if point is not None:
        v = v + np.cross(omega, np.asarray(point, float) - p)
    return np.concatenate([v, omega], -1)


def classical_acceleration(a: ArrayLike, v: ArrayLike) -> _Array:
    """Returns the classical acceleration (r̈, ω̇) of a body's origin, with r̈ = a + ω × v, from the spatial
    acceleration a and the velocity v along the same axes.
    """
    (linear, angular), (velocity, omega) = _halves(a, "a"), _halves(v, "v")
    return np.concatenate([linear + np.cross(omega, velocity), angular + np.zeros_like(omega)], -1)


def spatial_acceleration(a: ArrayLike, v: ArrayLike) -> _Array:
    """Returns the spatial acceleration from the classical acceleration (r̈, ω̇) and the velocity v: the inverse of
    `classical_acceleration`.
    """
    (linear, angular), (velocity, omega) = _halves(a, "a"), _halves(v, "v")
    return np.concatenate([linear - np.cross(omega, velocity), angular + np.zeros_like(omega)], -1)


class FreeJoint(NamedTuple):
    """A library's conventions for the coordinates of a free joint."""

    position_first: bool
    """Whether q is [position, quaternion]. Otherwise q is [quaternion, position]."""
    w_last: bool
    """Whether quaternions are x, y, z, w. Otherwise quaternions are w, x, y, z."""
    linear_first: bool
    """Whether v is [linear, angular]. Otherwise v is [angular, linear]."""
    linear: Literal["body", "world"]
    """The axes along which the linear velocity of a free joint is given."""
    angular: Literal["body", "world"]
    """The axes along which the angular velocity of a free joint is given."""
    angle: bool
    """Whether the position of a revolute joint without limits is the angle. Otherwise the position is cosine and
    sine.
    """


LIBRARIES = {
    "pinocchio": FreeJoint(True, True, True, "body", "body", False),
    "mujoco": FreeJoint(True, False, True, "world", "body", True),
    "drake": FreeJoint(False, False, False, "world", "world", True),
    "rigidbodydynamics.jl": FreeJoint(False, False, False, "body", "body", True),
}
"""The libraries that `Coordinates` knows by name."""


class Coordinates:
    """Conversion of a robot's q, v, a and τ to another library's coordinates, and back.

    library: a name in `LIBRARIES`, or a `FreeJoint` that describes a library. Joints keep Condyle's order; if the other
        library numbers joints differently, permute them by name. Spherical joints have their quaternion in the
        library's order, and their angular velocity along the axes of the child body, as in MuJoCo and
        RigidBodyDynamics.jl. Some libraries represent some joints in another form: this holds for planar and spherical
        joints of Drake, and for planar joints of all libraries except Pinocchio. For such a joint, a ValueError with
        the joint's name is raised.

    Efforts follow from power: τᵀ v is the same number in both libraries. Accelerations are time derivatives of
    velocities. So if a library has velocities along the world's axes, the library's accelerations are classical.
    """

    def __init__(self, model: Model, library: str | FreeJoint) -> None:
        if isinstance(library, str):
            if library.lower() not in LIBRARIES:
                raise ValueError(f"unknown library `{library}`; there are {', '.join(sorted(LIBRARIES))}")
            name, means = library.lower(), LIBRARIES[library.lower()]
        else:
            name, means = "", library
        self.model, self.convention = model, means
        other: dict[str, list[str]] = {"pinocchio": [], "drake": ["planar", "spherical"]}
        refused = other.get(name, ["planar"])
        for joint, kind in zip(model.names, model.joint_types, strict=True):
            if kind in refused:
                raise ValueError(f"joint `{joint}`: a {kind} joint has other coordinates there")
        if any(model.mimics):
            raise ValueError("a robot whose joints follow others has fewer coordinates than there")
        self._joints: list[tuple[str, slice, slice, slice]] = []
        """For each joint: the kind, the slices of the joint's positions in Condyle's q and in the library's q, and the
        slice of its velocities, which is the same in both.
        """
        nq = 0
        columns = zip(model.joint_types, model.idx_qs, model.nqs, model.idx_vs, model.nvs, strict=True)
        for kind, at_q, nq_here, at_v, nv_here in columns:
            there = 1 if kind == "continuous" and self.convention.angle else nq_here
            self._joints.append((kind, _run(at_q, nq_here), _run(nq, there), _run(at_v, nv_here)))
            nq += there
        self.nq = nq
        """The number of positions in the library's coordinates."""

    def position(self, q: ArrayLike) -> _Array:
        """Returns the library's positions, (…, `self.nq`), from Condyle's positions, (…, nq)."""
        q = _last(q, "q", self.model.nq)
        theirs = np.empty((*q.shape[:-1], self.nq))
        for kind, mine, its, _ in self._joints:
            x = q[..., mine]
            if kind == "free_flyer":
                quaternion = x[..., 3:] if self.convention.w_last else wxyz(x[..., 3:])
                parts = [x[..., :3], quaternion]
                x = np.concatenate(parts if self.convention.position_first else parts[::-1], -1)
            elif kind == "spherical" and not self.convention.w_last:
                x = wxyz(x)
            elif kind == "continuous" and self.convention.angle:
                x = np.arctan2(x[..., 1], x[..., 0])[..., None]
            theirs[..., its] = x
        return theirs

    def position_from(self, q: ArrayLike) -> _Array:
        """Returns Condyle's positions from the library's positions."""
        q = _last(q, "q", self.nq)
        ours = np.empty((*q.shape[:-1], self.model.nq))
        for kind, mine, its, _ in self._joints:
            x = q[..., its]
            if kind == "free_flyer":
                place, quaternion = (
                    (x[..., :3], x[..., 3:]) if self.convention.position_first else (x[..., 4:], x[..., :4])
                )
                x = np.concatenate([place, quaternion if self.convention.w_last else xyzw(quaternion)], -1)
            elif kind == "spherical" and not self.convention.w_last:
                x = xyzw(x)
            elif kind == "continuous" and self.convention.angle:
                x = np.concatenate([np.cos(x), np.sin(x)], -1)
            ours[..., mine] = x
        return ours

    def velocity(self, q: ArrayLike, v: ArrayLike) -> _Array:
        """Returns the library's velocities from Condyle's q and v."""
        return self._out(_last(q, "q", self.model.nq), _last(v, "v", self.model.nv))

    def velocity_from(self, q: ArrayLike, v: ArrayLike) -> _Array:
        """Returns Condyle's velocities from the library's positions and velocities."""
        return self._back(self.position_from(q), _last(v, "v", self.model.nv))

    def acceleration(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> _Array:
        """Returns the library's accelerations from Condyle's q, v and a: d(R v)/dt = R (v̇ + ω × v)."""
        q, v, a = _last(q, "q", self.model.nq), _last(v, "v", self.model.nv), _last(a, "a", self.model.nv)
        return self._out(q, self._shifted(v, a, 1.0))

    def acceleration_from(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> _Array:
        """Returns Condyle's accelerations from the library's positions, velocities and accelerations."""
        ours = self.position_from(q)
        v, a = self._back(ours, _last(v, "v", self.model.nv)), self._back(ours, _last(a, "a", self.model.nv))
        return self._shifted(v, a, -1.0)

    def effort(self, q: ArrayLike, tau: ArrayLike) -> _Array:
        """Returns the library's efforts from Condyle's q and τ: τᵀ v is the same in both libraries, so only the axes
        change.
        """
        return self._out(_last(q, "q", self.model.nq), _last(tau, "tau", self.model.nv))

    def effort_from(self, q: ArrayLike, tau: ArrayLike) -> _Array:
        """Returns Condyle's efforts from the library's positions and efforts."""
        return self._back(self.position_from(q), _last(tau, "tau", self.model.nv))

    def _free(self) -> Iterator[tuple[slice, slice]]:
        for kind, mine, _, at in self._joints:
            if kind == "free_flyer":
                yield mine, at

    def _out(self, q: _Array, x: _Array) -> _Array:
        out = np.array(np.broadcast_to(x, (*np.broadcast_shapes(q.shape[:-1], x.shape[:-1]), x.shape[-1])))
        for mine, at in self._free():
            R = rotation(q[..., mine][..., 3:])
            linear, angular = x[..., at][..., :3], x[..., at][..., 3:]
            linear = _turn(R, linear) if self.convention.linear == "world" else linear
            angular = _turn(R, angular) if self.convention.angular == "world" else angular
            parts = np.broadcast_arrays(linear, angular)
            out[..., at] = np.concatenate(parts if self.convention.linear_first else parts[::-1], -1)
        return out

    def _back(self, q: _Array, x: _Array) -> _Array:
        out = np.array(np.broadcast_to(x, (*np.broadcast_shapes(q.shape[:-1], x.shape[:-1]), x.shape[-1])))
        for mine, at in self._free():
            R = rotation(q[..., mine][..., 3:])
            first, second = x[..., at][..., :3], x[..., at][..., 3:]
            linear, angular = (first, second) if self.convention.linear_first else (second, first)
            linear = _turn_back(R, linear) if self.convention.linear == "world" else linear
            angular = _turn_back(R, angular) if self.convention.angular == "world" else angular
            out[..., at] = np.concatenate(np.broadcast_arrays(linear, angular), -1)
        return out

    def _shifted(self, v: _Array, a: _Array, sign: float) -> _Array:
        """Adds ± ω × v to accelerations of free joints if the library has linear velocities in the world's axes."""
        a = np.array(np.broadcast_to(a, np.broadcast_shapes(v.shape, a.shape)))
        for _, at in self._free():
            if self.convention.linear == "world":
                linear, omega = v[..., at][..., :3], v[..., at][..., 3:]
                a[..., at.start : at.start + 3] += sign * np.cross(omega, linear)
        return a


def _run(start: int, length: int) -> slice:
    return slice(start, start + length)


def _last(x: ArrayLike, name: str, length: int) -> _Array:
    x = np.asarray(x, float)
    if x.ndim == 0 or x.shape[-1] != length:
        raise ValueError(f"{name}: expected shape (…, {length}), found {x.shape}")
    return x


def _halves(x: ArrayLike, name: str) -> tuple[_Array, _Array]:
    x = _last(x, name, 6)
    return x[..., :3], x[..., 3:]


def _pose(oXb: ArrayLike) -> tuple[_Array, _Array]:
    X = np.asarray(oXb, float)
    if X.shape[-2:] != (4, 4):
        raise ValueError(f"oXb: expected shape (…, 4, 4), found {X.shape}")
    return X[..., :3, :3], X[..., :3, 3]


def _turn(R: _Array, x: _Array) -> _Array:
    out: _Array = np.einsum("...ij,...j->...i", R, x)
    return out


def _turn_back(R: _Array, x: _Array) -> _Array:
    out: _Array = np.einsum("...ji,...j->...i", R, x)
    return out


def _hat(x: _Array) -> _Array:
    out = np.zeros((*x.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -x[..., 2], x[..., 1], -x[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = x[..., 2], -x[..., 1], x[..., 0]
    return out
