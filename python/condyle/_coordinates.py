"""The maps between changes of the nq numbers of a position and tangent vectors of nv numbers, for many states at once.

A position q may contain quaternions and pairs (cos θ, sin θ). A function f of a position is extended to all q by
f(q̂), where q̂ is q with each quaternion and each pair divided by its length s. Let d(q) = q̂ ⊖ q̂₀ at the fixed q₀.
Then ∂f/∂q = (∂f/∂δ) P with P = ∂d/∂q, and the second derivative of d adds to the Hessian. For a quaternion with the
matrix L(q̂), whose columns are orthonormal, orthogonal to q̂ and belong to the axes of the body:

    d = 2 Lᵀq / q̂₀ᵀq + O(|Lᵀq|³),    P = 2 Lᵀ / s,    ∂²d/∂q∂q = −2 (Lᵀ q̂ᵀ + q̂ᵀ Lᵀ) / s²

For a pair, 1 replaces the factor 2. A position p of a free or planar joint has d = V(ω)⁻¹ Rᵀ(p − p₀), with the
logarithm's matrix V⁻¹ = 1 − ½ ω× + O(ω²).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Model

_Array = NDArray[np.float64]


class Rotation(NamedTuple):
    """A joint whose position contains a quaternion or a pair (cos θ, sin θ)."""

    lines: slice
    """The position's lengths in q; empty for a joint that only rotates."""
    numbers: slice
    """The quaternion or the pair in q."""
    linear: slice
    """The linear velocity in v."""
    angular: slice
    """The angular velocity in v, three numbers or one."""


class Coordinates:
    """The coordinates of one robot. All arrays have one row for each state."""

    def __init__(self, model: Model) -> None:
        self.nq, self.nv = model.nq, model.nv
        self.rotations: list[Rotation] = []
        pairs: list[tuple[int, int]] = []
        for kind, iq, iv, nq in zip(model.joint_types, model.idx_qs, model.idx_vs, model.nqs, strict=True):
            lines = {"free_flyer": 3, "planar": 2}.get(kind, 0)
            if kind in ("free_flyer", "planar", "spherical", "continuous") and nq:
                angles = 3 if kind in ("free_flyer", "spherical") else 1
                at, to = iq + lines, iv + lines
                self.rotations.append(
                    Rotation(slice(iq, at), slice(at, iq + nq), slice(iv, to), slice(to, to + angles))
                )
            else:
                pairs += [(iq + k, iv + k) for k in range(nq)]
        self.plain_q = np.array([q for q, _ in pairs], int)
        self.plain_v = np.array([v for _, v in pairs], int)

    @property
    def flat(self) -> bool:
        """Whether q contains no quaternion and no pair, so that q ⊕ v = q + v."""
        return not self.rotations

    def lengths(self, q: _Array) -> Iterator[tuple[Rotation, _Array, _Array]]:
        """Yields each rotation with its numbers, divided by their length, and the length s, (N, 1)."""
        for rotation in self.rotations:
            numbers = q[:, rotation.numbers]
            s = np.linalg.norm(numbers, axis=1, keepdims=True)
            with np.errstate(invalid="ignore", divide="ignore"):
                yield rotation, numbers / s, s  # NaN for the length 0

    def normalized(self, q: _Array) -> _Array:
        """Returns q̂. Quaternions and pairs of length 0 become NaN."""
        if self.flat:
            return q
        result = q.copy()
        for rotation, numbers, _ in self.lengths(q):
            result[:, rotation.numbers] = numbers
        return result

    def push(self, q: _Array, dq: _Array) -> _Array:
        """Returns the tangent vector P dq, (N, nv)."""
        if self.flat:
            return dq
        result = np.zeros((len(q), self.nv))
        result[:, self.plain_v] = dq[:, self.plain_q]
        for rotation, n, s in self.lengths(q):
            result[:, rotation.angular] = _factor(n) * _transposed(n, dq[:, rotation.numbers]) / s
            result[:, rotation.linear] = _turned(n, dq[:, rotation.lines], back=True)
        return result

    def pull(self, q: _Array, g: _Array) -> _Array:
        """Returns Pᵀ g, (N, nq), for a cotangent g of the tangent vector."""
        if self.flat:
            return g
        result = np.zeros((len(q), self.nq))
        result[:, self.plain_q] = g[:, self.plain_v]
        for rotation, n, s in self.lengths(q):
            result[:, rotation.numbers] = _factor(n) * _times(n, g[:, rotation.angular]) / s
            result[:, rotation.lines] = _turned(n, g[:, rotation.linear])
        return result

    def bend(self, q: _Array, g: _Array, dq: _Array) -> _Array:
        """Returns Σᵢ gᵢ (∂²dᵢ/∂q∂q) dq, (N, nq)."""
        result = np.zeros((len(q), self.nq))
        for rotation, n, s in self.lengths(q):
            change, slope, kappa = dq[:, rotation.numbers], g[:, rotation.angular], _factor(n)
            across, along = _transposed(n, change), (n * change).sum(1, keepdims=True)
            both = _times(n, slope) * along + n * (slope * across).sum(1, keepdims=True)
            result[:, rotation.numbers] = -kappa / s**2 * both
            if rotation.lines.stop > rotation.lines.start:  # −½ gᵀ (ω₁ × u₂ + ω₂ × u₁), u = Rᵀ dp
                u, omega = _turned(n, dq[:, rotation.lines], back=True), kappa * across / s
                force = g[:, rotation.linear]
                result[:, rotation.numbers] -= 0.5 * kappa / s * _times(n, _cross_angular(u, force))
                result[:, rotation.lines] -= 0.5 * _turned(n, _cross_linear(force, omega))
        return result

    def lift(self, q: _Array, d: _Array) -> _Array:
        """Returns the change T d of the unit position q along the tangent vector d, (N, nq), with T = ∂(q ⊕ d)/∂d."""
        if self.flat:
            return d
        result = np.zeros((len(q), self.nq))
        result[:, self.plain_q] = d[:, self.plain_v]
        for rotation, n, _ in self.lengths(q):
            result[:, rotation.numbers] = _times(n, d[:, rotation.angular]) / _factor(n)
            result[:, rotation.lines] = _turned(n, d[:, rotation.linear])
        return result

    def drop(self, q: _Array, g: _Array) -> _Array:
        """Returns Tᵀ g, (N, nv), for a cotangent g of the unit position q."""
        if self.flat:
            return g
        result = np.zeros((len(q), self.nv))
        result[:, self.plain_v] = g[:, self.plain_q]
        for rotation, n, _ in self.lengths(q):
            result[:, rotation.angular] = _transposed(n, g[:, rotation.numbers]) / _factor(n)
            result[:, rotation.linear] = _turned(n, g[:, rotation.lines], back=True)
        return result


def _factor(n: _Array) -> float:
    """Returns the factor of ∂d/∂q: 2 for a quaternion, and 1 for a pair."""
    return 2.0 if n.shape[1] == 4 else 1.0


def _times(n: _Array, d: _Array) -> _Array:
    """Returns L(n) d: a quaternion or a pair, for three angular numbers or one."""
    if n.shape[1] == 2:
        return np.hstack([-n[:, 1:] * d, n[:, :1] * d])
    vector, w = n[:, :3], n[:, 3:]
    return np.hstack([w * d + np.cross(vector, d), -(vector * d).sum(1, keepdims=True)])


def _transposed(n: _Array, x: _Array) -> _Array:
    """Returns L(n)ᵀ x."""
    if n.shape[1] == 2:
        return n[:, :1] * x[:, 1:] - n[:, 1:] * x[:, :1]
    vector, w = n[:, :3], n[:, 3:]
    return w * x[:, :3] - np.cross(vector, x[:, :3]) - vector * x[:, 3:]


def _turned(n: _Array, x: _Array, back: bool = False) -> _Array:
    """Returns R(n) x, or Rᵀ x if `back`, for vectors of three or two numbers. Vectors without numbers remain."""
    if not x.shape[1]:
        return x
    if n.shape[1] == 2:
        c, s = n[:, :1], -n[:, 1:] if back else n[:, 1:]
        return np.hstack([c * x[:, :1] - s * x[:, 1:], s * x[:, :1] + c * x[:, 1:]])
    vector, w = -n[:, :3] if back else n[:, :3], n[:, 3:]
    twice = 2.0 * np.cross(vector, x)
    return x + w * twice + np.cross(vector, twice)  # x + 2 w (n × x) + 2 n × (n × x)


def _cross_linear(force: _Array, omega: _Array) -> _Array:
    """Returns force × ω, in the plane if ω is one number."""
    if omega.shape[1] == 1:
        return np.hstack([force[:, 1:] * omega, -force[:, :1] * omega])
    return np.cross(force, omega)


def _cross_angular(u: _Array, force: _Array) -> _Array:
    """Returns u × force, one number in the plane."""
    if u.shape[1] == 2:
        return u[:, :1] * force[:, 1:] - u[:, 1:] * force[:, :1]
    return np.cross(u, force)
