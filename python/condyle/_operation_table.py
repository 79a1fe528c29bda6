"""The table of differentiable operations: for each function its arguments, results, Jacobians and Hessian.

Jacobians and Hessians are in tangent spaces, as the library computes them. A Jacobian has the shape (N, m, n) for
results and arguments of m and n numbers.
"""

import threading
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from . import _condyle as c
from ._condyle import ConstraintSet
from ._operations import Operation, Pool, Scratch, Slot

_Array = NDArray[np.float64]
_Row = list["_Array | float | None"]


def rnea(pool: Pool, forces: bool) -> Operation:
    """Returns τ = rnea(q, v, a), with external forces as an additional argument if `forces`."""
    model, nv = pool.model, pool.model.nv
    function: Any = c.rnea

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        return (function(model, scratch.data, *x),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], *x: _Array) -> list[_Row]:
        return [_inverse_dynamics(pool, scratch, needed, *x)]

    def hessian(scratch: Scratch, x: list[_Array], cotangents: list[_Array]) -> dict[tuple[int, int], _Array]:
        q, v, a, *f_ext = x
        found = c.rnea_hessian(model, scratch.data, q, v, a, cotangents[0], f_ext[0] if f_ext else None)
        blocks = dict(zip(_BLOCKS, found, strict=True))
        if forces:  # the derivative with respect to fᵢ is −Jᵢ(q) λ
            blocks[3, 0] = -_body_slopes(pool, scratch, q, cotangents[0])
        return blocks

    def slopes(scratch: Scratch, x: list[_Array], r: _Array) -> list[_Array | None]:
        q, v, a = x
        return [*c._rnea_pull(model, scratch.data, q, v, a, r, 3)]

    inputs, pulled = [*_motion(pool, 3), *_forces(pool, forces)], None if forces else slopes
    return Operation("rnea", pool, inputs, [Slot("tau", (nv,))], value, jacobians, hessian, slopes=pulled)


def aba(pool: Pool, forces: bool) -> Operation:
    """Returns q̈ = aba(q, v, τ), with external forces as an additional argument if `forces`.

    rnea(q, v, q̈) = τ, so that ∂q̈ = −M⁻¹ (∂rnea − ∂τ). The product with −M⁻¹ is a call of `aba` at rest and without
    gravity. This takes less time than `aba_derivatives`, which multiplies matrices by M⁻¹.
    """
    model, nv = pool.model, pool.model.nv
    falling = model.with_gravity([0.0, 0.0, 0.0])
    function: Any = c.aba

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        return (function(model, scratch.data, *x),)

    def jacobians(
        scratch: Scratch, needed: Sequence[bool], q: _Array, v: _Array, tau: _Array, *f: _Array, y: _Array | None = None
    ) -> list[_Row]:
        a = function(model, scratch.data, q, v, tau, *f) if y is None else y
        row = _inverse_dynamics(pool, scratch, needed, q, v, a, *f)
        return [[*row[:2], -1.0, *row[3:]]]

    def solve(scratch: Scratch, x: list[_Array], r: _Array) -> _Array:
        solution: _Array = c.aba(falling, scratch.data, x[0], np.zeros_like(r), r)
        return np.negative(solution, out=solution)

    def hessian(scratch: Scratch, x: list[_Array], cotangents: list[_Array]) -> dict[tuple[int, int], _Array]:
        q, v, tau, *f_ext = x
        found = c.aba_hessian(model, scratch.data, q, v, tau, cotangents[0], f_ext[0] if f_ext else None)
        blocks = dict(zip(_BLOCKS, found, strict=True))
        if forces:  # the derivative with respect to fᵢ is Jᵢ(q) μ with μ = M⁻¹ λ, and the last block is ∂μ/∂q
            mu = -solve(scratch, x, cotangents[0])
            blocks[3, 0] = _body_slopes(pool, scratch, q, mu) + np.matmul(_body_jacobians(pool, scratch, q), found[3])
        return blocks

    def slopes(scratch: Scratch, x: list[_Array], r: _Array, y: _Array | None = None) -> list[_Array | None]:
        a = function(model, scratch.data, *x) if y is None else y
        by_q, by_v = c._rnea_pull(model, scratch.data, x[0], x[1], a, r, 2)
        return [by_q, by_v, np.negative(r, out=r)]

    inputs = [*_motion(pool, 2), Slot("tau", (nv,)), *_forces(pool, forces)]
    pulled = None if forces else slopes
    return Operation("aba", pool, inputs, [Slot("a", (nv,))], value, jacobians, hessian, solve, pulled)


_BLOCKS = ((0, 0), (1, 0), (1, 1), (2, 0))
"""The pairs of arguments for the members of `rnea_hessian` and `aba_hessian`."""


def _inverse_dynamics(
    pool: Pool, scratch: Scratch, needed: Sequence[bool], q: _Array, v: _Array, a: _Array, *f: _Array
) -> _Row:
    """Returns the Jacobians of `rnea` with respect to q, v and a, and with respect to external forces if given."""
    out: Any = scratch.out("rnea", len(q), *[(pool.model.nv, pool.model.nv)] * 3)
    row: _Row = [*c.rnea_derivatives(pool.model, scratch.data, q, v, a, f[0] if f else None, out)]
    if f:  # τ = … − Σ Jᵢᵀ fᵢ
        row.append(-_body_jacobians(pool, scratch, q).swapaxes(1, 2) if needed[3] else None)
    return row


def _body_jacobians(pool: Pool, scratch: Scratch, q: _Array) -> _Array:
    """Returns the Jacobians of all bodies in their frames, (N, 6 nbodies, nv)."""
    return np.concatenate([c.body_jacobian(pool.model, scratch.data, q, b) for b in range(pool.model.nbodies)], 1)


def _body_slopes(pool: Pool, scratch: Scratch, q: _Array, v: _Array) -> _Array:
    """Returns the derivatives ∂(Jᵢ(q) v)/∂q of all bodies' velocities, (N, 6 nbodies, nv)."""
    bodies = range(pool.model.nbodies)
    return np.concatenate([c.body_velocity_derivative(pool.model, scratch.data, q, v, b) for b in bodies], 1)


def _forces(pool: Pool, forces: bool) -> list[Slot]:
    return [Slot("f_ext", (pool.model.nbodies, 6))] if forces else []


def inertia(pool: Pool, name: Literal["crba", "minv"]) -> Operation:
    """Returns the inertia matrix M(q) or its inverse. ∂M/∂q is the second derivative of `rnea` for a and q."""
    model, nv = pool.model, pool.model.nv
    function = c.crba if name == "crba" else c.minv

    def value(scratch: Scratch, q: _Array) -> tuple[_Array, ...]:
        return (function(model, scratch.data, q),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], q: _Array) -> list[_Row]:
        rest = np.zeros((len(q), nv))
        slopes = c.rnea_second_derivatives(model, scratch.data, q, rest, rest).dadq  # [i, j, k]: ∂Mᵢⱼ/∂qₖ
        if name == "minv":  # ∂M⁻¹ = −M⁻¹ ∂M M⁻¹
            inverse = c.minv(model, scratch.data, q)
            slopes = -np.einsum("nai,nijk,njb->nabk", inverse, slopes, inverse, optimize=True)
        return [[slopes.reshape(len(q), nv * nv, nv)]]

    output = Slot("M" if name == "crba" else "Minv", (nv, nv))
    return Operation(name, pool, [Slot("q", (model.nq,), True)], [output], value, jacobians)


def centroidal(pool: Pool, name: str) -> Operation:
    """Returns the centre of mass, its velocity or acceleration, or the centroidal momentum or its rate."""
    model, nv = pool.model, pool.model.nv
    size, members = {
        "com": (3, ("dcom_dq",)),
        "com_velocity": (3, ("dvcom_dq", "dcom_dq")),
        "com_acceleration": (3, ("dacom_dq", "dacom_dv", "dcom_dq")),
        "centroidal_momentum": (6, ("dh_dq", "dh_dv")),
        "centroidal_momentum_rate": (6, ("drate_dq", "drate_dv", "drate_da")),
    }[name]

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        return (getattr(c, name)(model, scratch.data, *x),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], *x: _Array) -> list[_Row]:
        rest = np.zeros((len(x[0]), nv))
        q, v, a = (*x, rest, rest)[:3]
        found = c.centroidal_derivatives(model, scratch.data, q, v, a)
        return [[getattr(found, member) for member in members]]

    return Operation(name, pool, _motion(pool, len(members)), [Slot(name, (size,))], value, jacobians)


def energy(pool: Pool, name: Literal["kinetic_energy", "potential_energy"]) -> Operation:
    """Returns T = ½ vᵀ M(q) v, or V = −m gᵀ c(q)."""
    model, kinetic = pool.model, name == "kinetic_energy"
    function: Any = getattr(c, name)

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        return (np.asarray(function(model, scratch.data, *x)),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], q: _Array, *v: _Array) -> list[_Row]:
        rest = np.zeros((len(q), model.nv))
        by_q, by_v, potential = c.energy_derivatives(model, scratch.data, q, *(v or [rest]))
        return [[by_q[:, None], by_v[:, None]] if kinetic else [potential[:, None]]]

    def hessian(scratch: Scratch, x: list[_Array], cotangents: list[_Array]) -> dict[tuple[int, int], _Array]:
        data, scale, q = scratch.data, cotangents[0][:, :, None], x[0]
        rest = np.zeros((len(q), model.nv))
        if not kinetic:  # the antisymmetric part of ∂g/∂q belongs to the change of the tangent space
            slope = c.static_torque_derivative(model, data, q)
            return {(0, 0): scale * 0.5 * (slope + slope.swapaxes(1, 2))}
        v = x[1]  # rnea(q, 0, v) = M v + g, so that differences of its derivatives belong to M v
        moving, still = (c.rnea_hessian(model, data, q, rest, a, v).dqdq for a in (v, rest))
        by_q, M = (c.rnea_derivatives(model, data, q, rest, v)[k] for k in (0, 2))
        by_q = by_q - c.static_torque_derivative(model, data, q)
        return {(0, 0): scale * 0.5 * (moving - still), (1, 0): scale * by_q, (1, 1): scale * M}

    return Operation(name, pool, _motion(pool, 1 + kinetic), [Slot(name, ())], value, jacobians, hessian)


def poses(pool: Pool, frame: int | None) -> Operation:
    """Returns the pose of a frame in the world, (4, 4), or with None the poses of all bodies, (nbodies, 4, 4)."""
    model = pool.model

    def value(scratch: Scratch, q: _Array) -> tuple[_Array, ...]:
        if frame is None:
            return (c.forward_kinematics(model, scratch.data, q),)
        return (c.frame_placement(model, scratch.data, q, frame),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], q: _Array) -> list[_Row]:
        (pose,), data = value(scratch, q), scratch.data
        aligned: Literal["local_world_aligned"] = "local_world_aligned"
        if frame is not None:
            return [[slopes(pose, c.frame_jacobian(model, data, q, frame, aligned)).reshape(len(q), 16, -1)]]
        bodies = range(model.nbodies)
        found = [slopes(pose[:, body], c.body_jacobian(model, data, q, body, aligned)) for body in bodies]
        return [[np.stack(found, 1).reshape(len(q), 16 * model.nbodies, -1)]]

    def slopes(pose: _Array, J: _Array) -> _Array:
        """Returns the derivative of a pose, (N, 4, 4, nv): ∂p = J_v, and ∂R = J_ω × R, column by column of R."""
        result = np.zeros((len(pose), 4, 4, model.nv))
        turns, columns = J[:, None, 3:].swapaxes(2, 3), pose[:, :3, :3].swapaxes(1, 2)[:, :, None]
        result[:, :3, :3] = np.cross(turns, columns).transpose(0, 3, 1, 2)
        result[:, :3, 3] = J[:, :3]
        return result

    name, shape = ("forward_kinematics", (model.nbodies, 4, 4)) if frame is None else ("frame_placement", (4, 4))
    return Operation(name, pool, _motion(pool, 1), [Slot("pose", shape)], value, jacobians)


def frame_motion(
    pool: Pool, name: str, frame: int, reference: Literal["local", "world", "local_world_aligned"]
) -> Operation:
    """Returns the velocity, the spatial acceleration or the classical acceleration of a frame."""
    model, velocity = pool.model, name == "frame_velocity"
    derivatives: Any = c.frame_velocity_derivative if velocity else getattr(c, f"{name}_derivatives")

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        return (getattr(c, name)(model, scratch.data, *x, frame, reference),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], *x: _Array) -> list[_Row]:
        found = derivatives(model, scratch.data, *x, frame, reference)
        J = c.frame_jacobian(model, scratch.data, x[0], frame, reference)
        return [[found, J] if velocity else [*found, J]]

    return Operation(name, pool, _motion(pool, 2 if velocity else 3), [Slot(name, (6,))], value, jacobians)


def constrained(pool: Pool, constraints: ConstraintSet, impact: bool, restitution: float) -> Operation:
    """Returns (q̈, λ) of `constrained_dynamics`, or (v⁺, Λ) of `impulse_dynamics`."""
    model, nv, lock = pool.model, pool.model.nv, threading.Lock()  # only one thread may use a `ConstraintSet`
    last = (restitution,) if impact else ()
    function: Any = c.impulse_dynamics if impact else c.constrained_dynamics
    derivatives: Any = c.impulse_dynamics_derivatives if impact else c.constrained_dynamics_derivatives

    def value(scratch: Scratch, *x: _Array) -> tuple[_Array, ...]:
        with lock:
            found = function(model, scratch.data, constraints, *x, *last)
        return found[0], found[1]

    def jacobians(scratch: Scratch, needed: Sequence[bool], *x: _Array) -> list[_Row]:
        with lock:
            found = derivatives(model, scratch.data, constraints, *x, *last)
        count = len(x)
        return [[*found[4 : 4 + count]], [*found[4 + count : 4 + 2 * count]]]

    inputs = _motion(pool, 2) if impact else [*_motion(pool, 2), Slot("tau", (nv,))]
    outputs = [Slot("v" if impact else "a", (nv,)), Slot("lambda_", (constraints.rows,))]
    name = "impulse_dynamics" if impact else "constrained_dynamics"
    return Operation(name, pool, inputs, outputs, value, jacobians)


def passive(pool: Pool, smoothing: float) -> Operation:
    """Returns the passive torque τ(q, v)."""
    model = pool.model

    def value(scratch: Scratch, q: _Array, v: _Array) -> tuple[_Array, ...]:
        return (c.passive_torque(model, q, v, smoothing),)

    def jacobians(scratch: Scratch, needed: Sequence[bool], q: _Array, v: _Array) -> list[_Row]:
        return [[*c.passive_torque_derivatives(model, q, v, smoothing)]]

    return Operation("passive_torque", pool, _motion(pool, 2), [Slot("tau", (model.nv,))], value, jacobians)


def group(pool: Pool, name: Literal["integrate", "difference"]) -> Operation:
    """Returns q ⊕ v or q₁ ⊖ q₀."""
    model, nv = pool.model, pool.model.nv

    def integrate(scratch: Scratch, q: _Array, v: _Array) -> tuple[_Array, ...]:
        return (c.integrate(model, q, v),)

    def integrate_jacobians(scratch: Scratch, needed: Sequence[bool], q: _Array, v: _Array) -> list[_Row]:
        return [[c.integrate_jacobian(model, v, "position"), c.integrate_jacobian(model, v, "velocity")]]

    def difference(scratch: Scratch, q0: _Array, q1: _Array) -> tuple[_Array, ...]:
        return (c.difference(model, q0, q1),)

    def difference_jacobians(scratch: Scratch, needed: Sequence[bool], q0: _Array, q1: _Array) -> list[_Row]:
        d = c.difference(model, q0, q1)
        return [[c.difference_jacobian(model, d, "from"), c.difference_jacobian(model, d, "to")]]

    def linear(scratch: Scratch, x: list[_Array], cotangents: list[_Array]) -> dict[tuple[int, int], _Array]:
        return {}

    hessian = linear if pool.coordinates.flat else None
    position = (model.nq,)
    if name == "integrate":
        inputs, outputs = [Slot("q", position, True), Slot("v", (nv,))], [Slot("q", position, True)]
        return Operation(name, pool, inputs, outputs, integrate, integrate_jacobians, hessian)
    inputs, outputs = [Slot("q0", position, True), Slot("q1", position, True)], [Slot("v", (nv,))]
    return Operation(name, pool, inputs, outputs, difference, difference_jacobians, hessian)


def _motion(pool: Pool, count: int) -> list[Slot]:
    """Returns the first `count` arguments of (q, v, a)."""
    nq, nv = pool.model.nq, pool.model.nv
    return [Slot("q", (nq,), True), Slot("v", (nv,)), Slot("a", (nv,))][:count]
