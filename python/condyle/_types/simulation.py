"""Arguments and results of simulations."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array: TypeAlias = NDArray[np.float64]


class Control(NamedTuple):
    """The argument of a control law, before a step of a `Simulation`: the state, and the efforts and forces that the
    control law sets.
    """

    time: float
    """The time at which the step begins (s)."""
    q: _Array
    """The position of the robot at the beginning of the step, nq numbers."""
    v: _Array
    """The velocity of the robot at the beginning of the step, nv numbers."""
    tau: _Array
    """The joint efforts during the step, nv numbers (N m, N). The efforts are 0 when the control law is called; the
    control law sets them in place.
    """
    f_ext: _Array
    """The force on each body during the step, (nbodies, 6), at the body's origin and in the body's frame. The forces
    are 0 when the control law is called; the control law sets them in place.
    """


class Ground(NamedTuple):
    """A plane on which a simulated robot stands, slides and lands, and the points of the robot that may touch the
    plane.

    Contacts are rigid, with Coulomb friction, as conditions on the velocities v⁺ after a step of length h (Moreau 1988;
    Stewart and Trinkle 1996; Anitescu and Potra 1997): v⁺ = v + h aba(q, v, τ) + M⁻¹ Jᵀ λ. M is the inertia matrix, J
    the Jacobian of the points, and λ are their impulses, with normal parts λ_n and tangential parts λ_t. Each point
    satisfies 0 ≤ λ_n ⊥ u_n⁺ + max(φ, 0)/h ≥ 0 and the exact disc ‖λ_t‖ ≤ μ λ_n. Here u⁺ = J v⁺ is the point's velocity
    after the step, u_n⁺ its normal part, and φ the point's distance from the plane. The forces of redundant contacts
    are not unique, but the sum of these forces is unique. Errors are O(h). Only the points touch the plane: edges of
    soles, other bodies and joint limits are ignored. With a restitution above 0 (Newton's law) and friction, an impact
    of several points may increase the energy. A point below the plane is moved out by a fifth of its depth per step, at
    most 0.5 m/s.
    """

    points: Sequence[str | int | tuple[str | int, ArrayLike]]
    """The points that may touch the plane: a list of frames, whose origins are the points, or of pairs (frame, corners)
    with the corners of a sole in this frame, (n, 3) (m).
    """
    normal: ArrayLike = (0.0, 0.0, 1.0)
    """The direction out of the ground, in the world's frame, as a vector of any nonzero length."""
    height: float = 0.0
    """The height of the plane along the normal (m)."""
    friction: float = 0.7
    """The friction coefficient μ between the ground and the points."""
    restitution: float = 0.0
    """The fraction of the normal speed that a point keeps after an impact, from 0 to 1."""
    tolerance: float = 1e-8
    """The maximum error of the contact laws (m/s)."""
    max_iterations: int = 500
    """The maximum number of iterations of the contact solver in a step."""


class GroundContacts(NamedTuple):
    """The contacts of a `Ground`'s points in the last step of a `Simulation`, in the order of the points."""

    position: _Array
    """The points in the world at the beginning of the step (m), (n, 3)."""
    force: _Array
    """The mean forces on the robot during the step, along the axes of the world (N), (n, 3)."""
    touches: NDArray[np.bool_]
    """Whether the ground pushed each point, (n,)."""
