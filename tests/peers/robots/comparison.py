"""Compares one robot in Condyle and in a peer library: converts coordinates and compares quantities.

In formulas, a prime marks quantities of the peer library. Velocities are related by v' = T v, accelerations by a' = T
a + Ṫ v, and efforts by τ = Tᵀ τ'. So M = Tᵀ M' T and h = Tᵀ (h' + M' Ṫ v).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle import conventions

Array = NDArray[np.float64]
UNLIMITED = 2.0
"""Bound of random positions without limits: they are between −2 and 2."""
STATES = 2


class RefusedError(Exception):
    """Error: the peer library does not read the robot."""


class UnlikeError(Exception):
    """Error: the peer library reads the robot, but a comparison is impossible for the given reason."""


class Joint(NamedTuple):
    """Joint of Condyle, with the indices of its coordinates in the peer library."""

    body: int
    q: int
    """Index of the joint's first number in the peer's position."""
    v: int
    """Index of the joint's first number in the peer's velocity."""


class There(NamedTuple):
    """State in the coordinates of a peer library."""

    q: Array
    v: Array
    T: Array
    """Matrix T from Condyle's velocities to the peer's velocities, (nv', nv)."""
    drift: Array
    """Product Ṫ v (nv' numbers), with the time derivative of T."""


class Difference(NamedTuple):
    """Quantity that differs between Condyle and a peer library, with the size of the difference."""

    quantity: str
    size: float
    """Difference, relative to 1 + the largest number of the peer's result."""
    detail: str


def without_rotors(model: condyle.Model) -> condyle.Model:
    """Returns the model without armature, because only Drake reads armature from a URDF."""
    return model.with_armature(np.zeros(model.nv)) if model.armature.any() else model


def state_of(model: condyle.Model, seed: int) -> tuple[Array, Array]:
    """Returns a random state, with positions within their limits."""
    rng = np.random.default_rng(seed)
    q = np.array(condyle.random_configuration(model, seed=seed))
    for kind, at, n in zip(model.joint_types, model.idx_qs, model.nqs, strict=True):
        if n == 1 and kind in ("revolute", "prismatic", "helical"):
            lower, upper = model.limits.lower[at], model.limits.upper[at]
            lower = lower if abs(lower) < 1e3 else -UNLIMITED
            upper = upper if abs(upper) < 1e3 else UNLIMITED
            q[at] = rng.uniform(min(lower, upper), max(lower, upper))
    return q, rng.standard_normal(model.nv)


def turned(angle: float) -> Array:
    """Returns the 2 × 2 matrix of a rotation by an angle."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def block(library: str, kind: str, q: Array, v: Array) -> tuple[Array, Array, Array]:
    """Returns position, T and Ṫ v of one joint in the coordinates of a peer library."""
    same = np.eye(len(v)), np.zeros(len(v))
    if library == "pinocchio":
        return q, *same
    if kind == "continuous":
        return np.array([np.arctan2(q[1], q[0])]), *same
    if kind == "free_flyer":
        R = conventions.rotation(q[3:])
        quaternion, moved = conventions.wxyz(q[3:]), R @ np.cross(v[3:], v[:3])
        T, zero = np.zeros((6, 6)), np.zeros(3)
        if library == "mujoco":
            T[:3, :3], T[3:, 3:] = R, np.eye(3)
            return np.concatenate([q[:3], quaternion]), T, np.concatenate([moved, zero])
        T[:3, 3:] = T[3:, :3] = R
        return np.concatenate([quaternion, q[:3]]), T, np.concatenate([zero, moved])
    if kind == "spherical":
        if library == "mujoco":
            return conventions.wxyz(q), *same
        R = conventions.rotation(q)
        pitch = np.arctan2(-R[2, 0], np.hypot(R[2, 1], R[2, 2]))
        return np.array([np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])]), R, np.zeros(3)
    if kind == "planar":
        if library == "mujoco":
            raise UnlikeError("planar joints are other joints in MuJoCo")
        angle = np.arctan2(q[3], q[2])
        T = np.eye(3)
        T[:2, :2] = turned(angle)
        moved = T[:2, :2] @ (v[2] * np.array([-v[1], v[0]]))
        return np.array([q[0], q[1], angle]), T, np.append(moved, 0.0)
    return q, *same


def there(library: str, model: condyle.Model, joints: list[Joint], q: Array, v: Array, nq: int, nv: int) -> There:
    """Returns a state of Condyle in the peer's coordinates."""
    state = There(np.zeros(nq), np.zeros(nv), np.zeros((nv, model.nv)), np.zeros(nv))
    for joint in joints:
        at, n = model.idx_vs[joint.body], model.nvs[joint.body]
        position = q[model.idx_qs[joint.body] :][: model.nqs[joint.body]]
        theirs, T, drift = block(library, model.joint_types[joint.body], position, v[at : at + n])
        state.q[joint.q : joint.q + len(theirs)] = theirs
        state.T[joint.v : joint.v + n, at : at + n] = T
        state.drift[joint.v : joint.v + n] = drift
    state.v[:] = state.T @ v
    return state


class Quantities:
    """Differences between Condyle and one peer library for one robot."""

    def __init__(self, model: condyle.Model, tolerance: float) -> None:
        self.model, self.tolerance = model, tolerance
        self.data = condyle.Data(model)
        self.differences: dict[str, Difference] = {}
        self.compared: set[str] = set()
        self.left_out: dict[str, str] = {}
        """Map from the names of quantities to the reasons why they are not compared."""

    def leave_out(self, why: str, *quantities: str) -> None:
        """Excludes quantities from the comparison. The table of results shows the reason."""
        self.left_out |= dict.fromkeys(quantities, why)

    def expect(self, quantity: str, ours: Any, theirs: Any, where: Callable[[int], str] | None = None) -> None:
        """Compares two arrays. Infinite numbers must be equal, and other numbers must agree within the tolerance."""
        if quantity in self.left_out:
            return
        a, b = np.atleast_1d(np.asarray(ours, float)), np.atleast_1d(np.asarray(theirs, float))
        self.compared.add(quantity)
        if a.shape != b.shape:
            self.add(quantity, np.inf, f"shape {a.shape}, theirs {b.shape}")
            return
        if not a.size:
            return
        finite = np.isfinite(a) & np.isfinite(b)
        scale = 1.0 + (np.abs(b[finite]).max() if finite.any() else 0.0)
        with np.errstate(invalid="ignore"):
            error = np.where(finite, np.abs(a - b) / scale, np.where(a == b, 0.0, np.inf))
        error = np.where(np.isnan(a) & np.isnan(b), 0.0, error)
        worst = int(np.argmax(error))
        if error.flat[worst] > self.tolerance:
            row = int(np.unravel_index(worst, a.shape)[0])
            name = where(row) + ": " if where else ""
            self.add(quantity, float(error.flat[worst]), f"{name}{a.flat[worst]:.9g}, theirs {b.flat[worst]:.9g}")

    def spoken(self, *words: str, held: bool = False) -> None:
        """Records a difference for a feature, unless `held` is true (the model contains the feature) or a warning
        contains one of the words."""
        warnings = " ".join(map(str, self.model.warnings))
        self.compared.add(f"{words[0]}: held or said")
        if not held and not any(word in warnings for word in words):
            self.add(f"{words[0]}: dropped in silence", np.inf, "no warning")

    def add(self, quantity: str, size: float, detail: str) -> None:
        """Records a difference. For each quantity, only the largest difference is kept."""
        if quantity in self.left_out:
            return
        if quantity not in self.differences or self.differences[quantity].size < size:
            self.differences[quantity] = Difference(quantity, size, detail)

    def coordinate(self, i: int) -> str:
        """Returns the name of the joint to which velocity coordinate i belongs."""
        for name, at, n in zip(self.model.names, self.model.idx_vs, self.model.nvs, strict=True):
            if n and at <= i < at + n:
                return f"joint `{name}`" + (f"[{i - at}]" if n > 1 else "")
        return f"coordinate {i}"

    def position(self, i: int) -> str:
        """Returns the name of the joint to which position coordinate i belongs."""
        for name, at, n in zip(self.model.names, self.model.idx_qs, self.model.nqs, strict=True):
            if n and at <= i < at + n:
                return f"joint `{name}`"
        return f"coordinate {i}"

    def inertia(self, q: Array, v: Array, state: There, M: Array, h: Array) -> None:
        """Compares M and the bias efforts h with the peer library's M and h."""
        model, T = self.model, state.T
        self.expect("M", condyle.crba(model, self.data, q), T.T @ M @ T, self.coordinate)
        bias = T.T @ (h + M @ state.drift)
        self.expect("bias", condyle.nonlinear_effects(model, self.data, q, v), bias, self.coordinate)
