"""Poses, motions, forces, inertias, and the exponentials of SO(3) and SE(3), with NumPy, also for batches.

The layout is the same as in Pinocchio: linear parts first. An `SE3` is the pose aXb of frame b in frame a. An `SE3`
converts coordinates in b to coordinates in a. Motions and forces are different types. So a change of frame uses the
right rule for each type, and a motion cannot be added to a force. All types and functions of this module take arrays
with any number of additional axes in front, for batches.

>>> import numpy as np
>>> from condyle.algebra import SE3, Force, Motion, exp6, log6
>>> aXb = exp6([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
>>> np.allclose(log6(aXb).vector, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
True
>>> v, f = Motion.from_vector([1, 2, 3, 4, 5, 6]), Force.from_vector([6, 5, 4, 3, 2, 1])
>>> np.allclose((aXb * v).dot(aXb * f), v.dot(f))  # a power is the same in every frame
True
>>> aXb * aXb.inverse() == SE3.identity()
True
"""

from typing import Any, TypeVar, Union, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._inertia import Inertia, parallel_axes

__all__ = [
    "SE3",
    "Force",
    "Inertia",
    "Jexp3",
    "Jexp6",
    "Jlog3",
    "Jlog6",
    "Motion",
    "exp3",
    "exp6",
    "log3",
    "log6",
    "quaternion",
    "skew",
]

_Array = NDArray[np.float64]
_new = object.__new__
_S = TypeVar("_S", bound="_Spatial")
_P = TypeVar("_P", bound="SE3")
_CLOSE = 1e-12  # tolerance of `==` for rounding errors, relative to 1 and to the larger number


def skew(x: ArrayLike) -> _Array:
    """Returns the skew-symmetric matrix x̂ with x̂ y = x × y, (…, 3, 3)."""
    x = _shaped(x, "x", 3)
    out = np.zeros((*x.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -x[..., 2], x[..., 1], -x[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = x[..., 2], -x[..., 1], x[..., 0]
    return out


class _Spatial:
    """A spatial vector of six numbers: a linear part and an angular part."""

    __slots__ = ("vector",)
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, linear: ArrayLike, angular: ArrayLike) -> None:
        parts = np.broadcast_arrays(_shaped(linear, "linear", 3), _shaped(angular, "angular", 3))
        self.vector: _Array = np.concatenate(parts, -1)

    @classmethod
    def from_vector(cls, vector: ArrayLike) -> Any:
        """Creates a motion or force from six numbers, linear first, (…, 6)."""
        vector = _shaped(vector, "vector", 6)
        return cls(vector[..., :3], vector[..., 3:])

    @classmethod
    def _of(cls: type[_S], vector: _Array) -> _S:
        """Creates a motion or force from six numbers without a copy; the caller must not change the numbers
        afterwards.
        """
        x = _new(cls)
        x.vector = vector
        return x

    @classmethod
    def zero(cls) -> Any:
        """Returns the motion or force that is zero."""
        return cls(np.zeros(3), np.zeros(3))

    @property
    def linear(self) -> _Array:
        """The linear part of the vector, (…, 3)."""
        return self.vector[..., :3]

    @property
    def angular(self) -> _Array:
        """The angular part of the vector, (…, 3)."""
        return self.vector[..., 3:]

    def __add__(self, other: Any) -> Any:
        return self.from_vector(self.vector + other.vector) if type(other) is type(self) else NotImplemented

    def __sub__(self, other: Any) -> Any:
        return self.from_vector(self.vector - other.vector) if type(other) is type(self) else NotImplemented

    def __neg__(self) -> Any:
        return self.from_vector(-self.vector)

    def __mul__(self, factor: float) -> Any:
        return self.from_vector(self.vector * factor) if isinstance(factor, (int, float)) else NotImplemented

    __rmul__ = __mul__

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and _same(self.vector, other.vector)

    def __repr__(self) -> str:
        return f"{type(self).__name__}(linear={self.linear}, angular={self.angular})"


class Motion(_Spatial):
    """A velocity or an acceleration (v, ω). The linear part v belongs to the frame's origin."""

    __slots__ = ()

    def __rmul__(self, factor: Any) -> Any:
        """Returns the momentum I v = (m v + ω × m c, Ī ω + m c × v) if an inertia I is on the left, else the product
        with a number. I has the mass m, the centre of mass c, and the rotational inertia Ī about the origin.
        """
        if not isinstance(factor, Inertia):
            return self * factor
        h = np.asarray(factor.mass)[..., None] * factor.com
        linear = np.asarray(factor.mass)[..., None] * self.linear + np.cross(self.angular, h)
        return Force(linear, _times(factor.rotational, self.angular) + np.cross(h, self.linear))

    def dot(self, force: "Force") -> _Array:
        """Returns the power vᵀ f + ωᵀ n, of shape (…)."""
        if not isinstance(force, Force):
            raise TypeError("the product of a motion is with a force")
        out: _Array = (self.vector * force.vector).sum(-1)
        return out

    @overload
    def cross(self, other: "Motion") -> "Motion": ...
    @overload
    def cross(self, other: "Force") -> "Force": ...
    def cross(self, other: Union["Motion", "Force"]) -> Union["Motion", "Force"]:
        """Returns v × m or v ×* f: the rate of a motion m or a force f that is fixed to a body with velocity v."""
        if isinstance(other, Motion):
            linear = np.cross(self.angular, other.linear) + np.cross(self.linear, other.angular)
            return type(other)(linear, np.cross(self.angular, other.angular))
        if isinstance(other, Force):
            angular = np.cross(self.angular, other.angular) + np.cross(self.linear, other.linear)
            return type(other)(np.cross(self.angular, other.linear), angular)
        raise TypeError("the cross product of a motion is with a motion or a force")

    @property
    def action(self) -> _Array:
        """The matrix v × that acts on motions, (…, 6, 6)."""
        omega = skew(self.angular)
        return _blocks(omega, skew(self.linear), np.zeros_like(omega), omega)

    @property
    def dual_action(self) -> _Array:
        """The matrix v ×* = −(v ×)ᵀ that acts on forces, (…, 6, 6)."""
        return -self.action.swapaxes(-1, -2)


class Force(_Spatial):
    """A force, a momentum or an impulse: (f, n), where n is the moment about the frame's origin."""

    __slots__ = ()

    def dot(self, motion: Motion) -> _Array:
        """Returns the power of this force along a motion, of shape (…)."""
        if not isinstance(motion, Motion):
            raise TypeError("the product of a force is with a motion")
        return motion.dot(self)


class SE3:
    """The pose aXb of a frame b in a frame a: x_a = R x_b + p."""

    __slots__ = ("rotation", "translation")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, rotation: ArrayLike, translation: ArrayLike) -> None:
        """Creates a pose. rotation: R, (…, 3, 3); translation: p (m), (…, 3)."""
        R, p = np.array(rotation, float), _shaped(translation, "translation", 3)
        if R.shape[-2:] != (3, 3):
            raise ValueError(f"rotation: expected shape (…, 3, 3), found {R.shape}")
        self.rotation: _Array = R
        self.translation: _Array = p

    @classmethod
    def _of(cls: type[_P], X: _Array) -> _P:
        """Creates a pose from a homogeneous matrix without a copy; the caller must not change the matrix afterwards."""
        x = _new(cls)
        x.rotation, x.translation = X[..., :3, :3], X[..., :3, 3]
        return x

    @classmethod
    def identity(cls) -> "SE3":
        """Returns the identity pose."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_homogeneous(cls, X: ArrayLike) -> "SE3":
        """Creates a pose from a matrix [R, p; 0, 1], (…, 4, 4). `forward_kinematics` and `frame_placement` return such
        matrices.
        """
        X = np.asarray(X, float)
        if X.shape[-2:] != (4, 4):
            raise ValueError(f"X: expected shape (…, 4, 4), found {X.shape}")
        return cls(X[..., :3, :3], X[..., :3, 3])

    @property
    def homogeneous(self) -> _Array:
        """The matrix [R, p; 0, 1], (…, 4, 4)."""
        R, p = self._broadcast()
        out = np.zeros((*p.shape[:-1], 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = R, p, 1.0
        return out

    @property
    def action(self) -> _Array:
        """The matrix [R, p̂R; 0, R] that converts motions from frame b to frame a, (…, 6, 6)."""
        R, p = self._broadcast()
        return _blocks(R, skew(p) @ R, np.zeros_like(R), R)

    @property
    def dual_action(self) -> _Array:
        """The matrix [R, 0; p̂R, R] that converts forces from frame b to frame a, (…, 6, 6)."""
        R, p = self._broadcast()
        return _blocks(R, np.zeros_like(R), skew(p) @ R, R)

    def inverse(self) -> "SE3":
        """Returns bXa, the pose of frame a in frame b."""
        back = self.rotation.swapaxes(-1, -2)
        return type(self)(back, -_times(back, self.translation))

    @overload
    def act(self, x: "SE3") -> "SE3": ...
    @overload
    def act(self, x: Motion) -> Motion: ...
    @overload
    def act(self, x: Force) -> Force: ...
    @overload
    def act(self, x: Inertia) -> Inertia: ...
    @overload
    def act(self, x: ArrayLike) -> _Array: ...
    def act(self, x: Any) -> Any:
        """Converts a pose, a motion, a force, an inertia, or points (…, 3) from frame b to frame a."""
        R, p = self.rotation, self.translation
        if isinstance(x, Inertia):
            com = _times(R, x.com) + p
            about_com = R @ (x.rotational - parallel_axes(x.mass, x.com)) @ R.swapaxes(-1, -2)
            return Inertia(x.mass, com, about_com, about_com + parallel_axes(x.mass, com))
        if isinstance(x, SE3):
            return type(self)(R @ x.rotation, _times(R, x.translation) + p)
        if isinstance(x, Motion):
            angular = _times(R, x.angular)
            return type(x)(_times(R, x.linear) + np.cross(p, angular), angular)
        if isinstance(x, Force):
            linear = _times(R, x.linear)
            return type(x)(linear, _times(R, x.angular) + np.cross(p, linear))
        return _times(R, _shaped(x, "x", 3)) + p

    __mul__ = act

    def act_inv(self, x: Any) -> Any:
        """Converts x from frame a to frame b; x has one of the types that `act` converts."""
        return self.inverse().act(x)

    def _broadcast(self) -> tuple[_Array, _Array]:
        shape = np.broadcast_shapes(self.rotation.shape[:-2], self.translation.shape[:-1])
        return np.broadcast_to(self.rotation, (*shape, 3, 3)), np.broadcast_to(self.translation, (*shape, 3))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SE3):
            return False
        return _same(self.rotation, other.rotation) and _same(self.translation, other.translation)

    def __repr__(self) -> str:
        return f"SE3(rotation={self.rotation.tolist()}, translation={self.translation.tolist()})"


def exp3(w: ArrayLike) -> _Array:
    """Returns the rotation matrices R = exp ŵ = 1 + sinc θ ŵ + ½ sinc² θ/2 ŵ², (…, 3, 3), for rotation vectors w, (…,
    3), with the angle θ = |w|.
    """
    w = _shaped(w, "w", 3)
    W, theta = skew(w), np.linalg.norm(w, axis=-1)[..., None, None]
    R: _Array = np.eye(3) + np.sinc(theta / np.pi) * W + 0.5 * np.sinc(theta / (2.0 * np.pi)) ** 2 * (W @ W)
    return R


def log3(R: ArrayLike) -> _Array:
    """Returns the rotation vector w, |w| ≤ π, with exp ŵ = R. The vector is computed from the quaternion of R, because
    this method is accurate near 0 and π.
    """
    q = quaternion(R)
    xyz, w = q[..., :3], q[..., 3:]
    n = np.linalg.norm(xyz, axis=-1, keepdims=True)
    small = n < 1e-9
    safe = np.where(small, 1.0, n)
    out: _Array = np.where(small, 2.0 / np.where(small, w, 1.0), 2.0 * np.arctan2(n, w) / safe) * xyz
    return out


def exp6(m: ArrayLike | Motion) -> SE3:
    """Returns the exponential of motions (v, ω): the pose (exp ω̂, V v) with V = 1 + (1 − cos θ)/θ² ω̂ + (θ − sin θ)/θ³
    ω̂² and the angle θ = |ω|."""
    x = m.vector if isinstance(m, Motion) else _shaped(m, "m", 6)
    return SE3(exp3(x[..., 3:]), _times(Jexp3(-x[..., 3:]), x[..., :3]))


def log6(X: SE3 | ArrayLike) -> Motion:
    """Returns the motion m, |ω| ≤ π, with exp m = X."""
    pose = X if isinstance(X, SE3) else SE3.from_homogeneous(X)
    w = log3(pose.rotation)
    return Motion(_times(Jlog3(-w), pose.translation), w)


def Jexp3(w: ArrayLike) -> _Array:
    """Returns the right Jacobian of exp: exp(w + δ) = exp(w) exp(J δ) + O(δ²), (…, 3, 3)."""
    w = _shaped(w, "w", 3)
    W, theta = skew(w), np.linalg.norm(w, axis=-1)[..., None, None]
    t = theta**2
    series = 1.0 / 6.0 - t / 120.0 + t**2 / 5040.0 - t**3 / 362880.0
    safe = np.where(theta < 0.1, 1.0, theta)
    c = np.where(theta < 0.1, series, (safe - np.sin(safe)) / safe**3)
    J: _Array = np.eye(3) - 0.5 * np.sinc(theta / (2.0 * np.pi)) ** 2 * W + c * (W @ W)
    return J


def Jlog3(w: ArrayLike) -> _Array:
    """Returns the inverse of `Jexp3` for a rotation vector w with the angle θ = |w| ≤ π: 1 + ½ ŵ + (1 − ½ θ cot ½ θ)/θ²
    ŵ²."""
    w = _shaped(w, "w", 3)
    W, theta = skew(w), np.linalg.norm(w, axis=-1)[..., None, None]
    t = theta**2
    series = 1.0 / 12.0 + t / 720.0 + t**2 / 30240.0 + t**3 / 1209600.0
    half = 0.5 * np.where(theta < 0.1, 1.0, theta)
    c = np.where(theta < 0.1, series, (1.0 - half * np.cos(half) / np.sin(half)) / (4.0 * half**2))
    J: _Array = np.eye(3) + 0.5 * W + c * (W @ W)
    return J


def Jexp6(m: ArrayLike | Motion) -> _Array:
    """Returns the right Jacobian of `exp6`, Σ (−m×)ᵏ / (k + 1)!, (…, 6, 6): [J, C; 0, J] with J of `Jexp3`.

    The block C couples the linear part to the angular part. It is computed by the closed formula of Barfoot and Furgale
    (2014).
    """
    x = m.vector if isinstance(m, Motion) else _shaped(m, "m", 6)
    A = -Motion.from_vector(x).action
    theta = np.linalg.norm(x[..., 3:], axis=-1)[..., None, None]
    term = np.broadcast_to(np.eye(6), A.shape)
    series = term
    for k in range(1, 20):
        term = term @ A / (k + 1)
        series = series + term
    t = np.where(theta < 1.0, 1.0, theta)
    s, c, A2 = np.sin(t), np.cos(t), A @ A
    closed = np.eye(6) + (4.0 - t * s - 4.0 * c) / (2.0 * t**2) * A + (4.0 * t - 5.0 * s + t * c) / (2.0 * t**3) * A2
    closed = closed + (2.0 - t * s - 2.0 * c) / (2.0 * t**4) * (A2 @ A)
    closed = closed + (2.0 * t - 3.0 * s + t * c) / (2.0 * t**5) * (A2 @ A2)
    out: _Array = np.where(theta < 1.0, series, closed)
    return out


def Jlog6(X: SE3 | ArrayLike) -> _Array:
    """Returns the derivative of log6(X exp δ) with respect to δ at 0, (…, 6, 6): the inverse of `Jexp6` at log6(X)."""
    return np.asarray(np.linalg.inv(Jexp6(log6(X))), float)


def quaternion(R: ArrayLike) -> _Array:
    """Returns the quaternion (x, y, z, w), w ≥ 0, of a rotation. The largest component is computed first (Shepperd
    1978).
    """
    R = np.asarray(R, float)
    if R.shape[-2:] != (3, 3):
        raise ValueError(f"R: expected shape (…, 3, 3), found {R.shape}")
    a, b, c = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    x, y, z = R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]
    xy, xz, yz = R[..., 0, 1] + R[..., 1, 0], R[..., 0, 2] + R[..., 2, 0], R[..., 1, 2] + R[..., 2, 1]
    # each tuple contains 4 times the products of one component with (x, y, z, w), so the tuple is a multiple of the
    # quaternion
    by_x, by_y = (1 + a - b - c, xy, xz, x), (xy, 1 - a + b - c, yz, y)
    by_z, by_w = (xz, yz, 1 - a - b + c, z), (x, y, z, 1 + a + b + c)
    products = np.stack([np.stack(row, -1) for row in (by_x, by_y, by_z, by_w)], -2)
    best = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), -1)
    row: _Array = np.take_along_axis(products, best[..., None, None], -2)[..., 0, :]
    q = row / np.linalg.norm(row, axis=-1, keepdims=True)
    out: _Array = np.where(q[..., 3:] < 0.0, -q, q)
    return out


def _shaped(x: ArrayLike, name: str, length: int) -> _Array:
    x = np.array(x, float)
    if x.ndim == 0 or x.shape[-1] != length:
        raise ValueError(f"{name}: expected shape (…, {length}), found {x.shape}")
    return x


def _times(A: _Array, x: _Array) -> _Array:
    out: _Array = np.einsum("...ij,...j->...i", A, x)
    return out


def _blocks(a: _Array, b: _Array, c: _Array, d: _Array) -> _Array:
    return np.concatenate([np.concatenate([a, b], -1), np.concatenate([c, d], -1)], -2)


def _same(x: _Array, y: _Array) -> bool:
    return bool(np.allclose(x, y, rtol=_CLOSE, atol=_CLOSE))
