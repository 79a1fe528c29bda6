"""Contacts and couplings, and results of dynamics with constraints."""

from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array: TypeAlias = NDArray[np.float64]


class Constrained(NamedTuple):
    """The result of `constrained_dynamics`."""

    a: _Array
    """The acceleration q̈, nv numbers (rad/s², m/s²)."""
    lambda_: _Array
    """The force λ of each constraint on the body of the constrained frame, along the axes of the constraint's rows (N,
    N m).
    """
    residual: float
    """The largest magnitude in J q̈ + γ (m/s², rad/s²), the error of the constraints' accelerations. It is zero if the
    constraints are satisfied."""
    redundant: float
    """The number of rows of J that depend linearly on earlier rows, up to rounding. These rows have no force."""


class ConstrainedDerivatives(NamedTuple):
    """The result of `constrained_dynamics_derivatives`: the result of `constrained_dynamics` and its derivatives.

    Derivatives with respect to q are taken in the tangent space.
    """

    a: _Array
    lambda_: _Array
    residual: float
    redundant: float
    da_dq: _Array
    """The derivative ∂q̈/∂q, (nv, nv)."""
    da_dv: _Array
    """The derivative ∂q̈/∂v, (nv, nv)."""
    da_dtau: _Array
    """The derivative ∂q̈/∂τ, (nv, nv), symmetric."""
    dlambda_dq: _Array
    """The derivative ∂λ/∂q of the constraint forces, (rows, nv)."""
    dlambda_dv: _Array
    """The derivative ∂λ/∂v of the constraint forces, (rows, nv)."""
    dlambda_dtau: _Array
    """The derivative ∂λ/∂τ of the constraint forces, (rows, nv)."""
    inertia: _Array
    """The inertia (J M⁻¹ Jᵀ)⁻¹ of the robot along the rows of the constraints, (rows, rows)."""


class ConstrainedEquations(NamedTuple):
    """The result of `constrained_dynamics_equations`: the result of `constrained_dynamics`, and linear equations for
    the changes of this result.

    Derivatives with respect to q are taken in the tangent space.
    """

    a: _Array
    lambda_: _Array
    residual: float
    redundant: float
    M: _Array
    """The inertia matrix M, (nv, nv), armature included."""
    dtau_dq: _Array
    """The derivative ∂(M q̈ + h − Jᵀ λ)/∂q, (nv, nv)."""
    dtau_dv: _Array
    """The derivative ∂h/∂v of the nonlinear effects, (nv, nv)."""
    dgamma_dq: _Array
    """The derivative ∂(J q̈ + γ)/∂q of the constraints' acceleration, (rows, nv)."""
    dgamma_dv: _Array
    """The derivative ∂γ/∂v of the constraints' velocity-dependent acceleration, (rows, nv)."""


class Impulse(NamedTuple):
    """The result of `impulse_dynamics`."""

    v: _Array
    """The velocity v⁺ after the impact, nv numbers (rad/s, m/s)."""
    lambda_: _Array
    """The impulse Λ of each constraint on the body of the constrained frame, along the axes of the constraint's rows (N
    s, N m s).
    """
    residual: float
    """The largest magnitude in J (v⁺ + ε v) (m/s, rad/s)."""
    redundant: float
    """The number of rows of J that depend linearly on earlier rows, up to rounding. These rows have no impulse."""


class ImpulseDerivatives(NamedTuple):
    """The result of `impulse_dynamics_derivatives`: the result of `impulse_dynamics` and its derivatives.

    Derivatives with respect to q are taken in the tangent space.
    """

    v: _Array
    lambda_: _Array
    residual: float
    redundant: float
    dv_dq: _Array
    """The derivative ∂v⁺/∂q, (nv, nv)."""
    dv_dv: _Array
    """The derivative ∂v⁺/∂v, (nv, nv)."""
    dlambda_dq: _Array
    """The derivative ∂Λ/∂q of the impulses, (rows, nv)."""
    dlambda_dv: _Array
    """The derivative ∂Λ/∂v of the impulses, (rows, nv)."""
    inertia: _Array
    """The inertia (J M⁻¹ Jᵀ)⁻¹ of the robot along the rows of the constraints, (rows, rows)."""


class ContactConstraint(NamedTuple):
    """A contact of a frame with the world, or the connection of two frames that closes a loop.

    Let v and a be the velocity and acceleration of the frame relative to the other body, and X the pose of the frame
    relative to its target in the other frame. The constraint is a − a* + kd (v − v*) + kp e = 0. Here e is log X
    ('rigid') or the difference of the frames' origins ('point'), in the axes of `reference` at the frame's origin.
    Pinocchio's RigidConstraintModel and Crocoddyl's contacts have the same equation. For 'point', a is the classical
    acceleration; for 'rigid', the spatial acceleration. A 'line' has only the row along the third of `axes`, like
    Crocoddyl's ContactModel1D. A 'plane' has the rows along the first and the third of these axes, like ContactModel2D.
    A ContactModel1D with rotation R and reference x has axes=R.T and a placement at R @ (0, 0, x).
    """

    frame: str | int
    """The constrained frame, by name or index."""
    kind: Literal["point", "line", "plane", "rigid"]
    """The constrained motion: of the frame's origin, 3 rows ('point'); of the origin along one axis or two ('line',
    'plane'); or of the whole frame, 6 rows, linear first ('rigid').
    """
    other: str | int | None = None
    """The other frame of the constraint; None is the world."""
    reference: Literal["local", "local_world_aligned"] = "local"
    """The axes of rows and forces: the axes of the frame or of the world."""
    kp: ArrayLike = 0.0
    """The gain of the position error (1/s²): a number, or 3 or 6 numbers for the axes of `reference` (linear, then
    angular). For example, (0, 0, kp) in "local_world_aligned" corrects only the height of a foot.
    """
    kd: float = 0.0
    """The gain of the velocity error (1/s)."""
    placement: ArrayLike | None = None
    """The target pose of the frame in the other frame, (4, 4). For 'rigid' the whole pose is used, else only the
    translation of the pose.
    """
    velocity: ArrayLike | None = None
    """The target velocity v*, six numbers in the axes of `reference` (m/s, rad/s)."""
    acceleration: ArrayLike | None = None
    """The target acceleration a*, six numbers in the axes of `reference` (m/s², rad/s²)."""
    axes: ArrayLike | None = None
    """The axes of a line or a plane, in the axes of `reference`: a rotation (3, 3) with an axis in each column. None is
    the identity.
    """


class Coupling(NamedTuple):
    """Two coupled joints of a robot's file: the follower's position is Σ cᵢ qⁱ, where q is the position of the leader.
    No function enforces the coupling. A linear coupling becomes a part of the tree if the file is read with
    `mimic=True`.
    """

    follower: str
    """The name of the joint that follows."""
    leader: str | None
    """The name of the joint that leads; None keeps the follower at c₀."""
    coefficients: tuple[float, ...]
    """The coefficients c₀ to c₄ of the polynomial."""
