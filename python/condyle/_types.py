"""What functions return when it is more than an array: named tuples."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray


class RneaDerivatives(NamedTuple):
    """The derivatives of τ = rnea(q, v, a), each (nv, nv)."""

    dtau_dq: NDArray[np.float64]
    """∂τ/∂q in the tangent space: the change of τ when q moves to integrate(q, δ), per δ."""
    dtau_dv: NDArray[np.float64]
    """∂τ/∂v."""
    dtau_da: NDArray[np.float64]
    """∂τ/∂a = M(q), armature included."""


class AbaDerivatives(NamedTuple):
    """q̈ = aba(q, v, τ) and its derivatives, each (nv, nv)."""

    a: NDArray[np.float64]
    """q̈ itself, nv numbers."""
    da_dq: NDArray[np.float64]
    """∂q̈/∂q in the tangent space: the change of q̈ when q moves to integrate(q, δ), per δ."""
    da_dv: NDArray[np.float64]
    """∂q̈/∂v."""
    da_dtau: NDArray[np.float64]
    """∂q̈/∂τ = M(q)⁻¹."""


class CentroidalMap(NamedTuple):
    """What depends on the position in hg = Ag(q) v; the axes are the world's."""

    Ag: NDArray[np.float64]
    """The centroidal momentum matrix, (6, nv), linear rows first: hg = Ag v."""
    Ig: NDArray[np.float64]
    """The inertia of all moving bodies about their centre of mass, as if they were one, (6, 6): [m 1, 0; 0, Ī]."""
    com: NDArray[np.float64]
    """c, the centre of mass in the world's frame (m), 3 numbers."""
    Jcom: NDArray[np.float64]
    """The Jacobian of c, (3, nv): ċ = Jcom v."""


class CentroidalMapRate(NamedTuple):
    """hg = Ag(q) v, and what its rate Ag a + dAg v depends on; the axes are the world's."""

    Ag: NDArray[np.float64]
    """The centroidal momentum matrix, (6, nv), linear rows first: hg = Ag v."""
    dAg: NDArray[np.float64]  # noqa: N815
    """dAg/dt along the velocity, (6, nv)."""
    hg: NDArray[np.float64]
    """The momentum about the centre of mass, along the axes of the world (kg m/s, kg m²/s), 6 numbers."""
    Ig: NDArray[np.float64]
    """The inertia of all moving bodies about their centre of mass, as if they were one, (6, 6): [m 1, 0; 0, Ī]."""
    com: NDArray[np.float64]
    """c, the centre of mass in the world's frame (m), 3 numbers."""
    com_velocity: NDArray[np.float64]
    """ċ, its velocity (m/s), 3 numbers."""
    Jcom: NDArray[np.float64]
    """The Jacobian of c, (3, nv): ċ = Jcom v."""


class AllTerms(NamedTuple):
    """What the equations of motion M a + h = τ are made of, momentum and energies."""

    M: NDArray[np.float64]
    """M(q), (nv, nv), as of `crba`."""
    h: NDArray[np.float64]
    """h(q, v), nv numbers, as of `nonlinear_effects`."""
    centroidal: CentroidalMapRate
    """Momentum, its map and the map's rate, centre of mass, as of `centroidal_map_rate`."""
    kinetic_energy: float
    """T = ½ vᵀ M v (J)."""
    potential_energy: float
    """V = −m gᵀ c (J)."""


class Frame(NamedTuple):
    """A frame fixed to a body."""

    name: str
    """The name of the link or joint."""
    kind: Literal["link", "joint", "user"]
    """Where it comes from."""
    body: int
    """The body to which it is fixed; 0 is the world."""
    placement: NDArray[np.float64]
    """Its pose in the body's frame, a homogeneous (4, 4) matrix."""


class Inertia(NamedTuple):
    """The inertia of a body, along the axes of its frame."""

    mass: float
    """Mass (kg)."""
    com: NDArray[np.float64]
    """Centre of mass in the body's frame (m), 3 numbers; zeros if there is no mass."""
    about_com: NDArray[np.float64]
    """Rotational inertia about the centre of mass (kg m²), (3, 3): what a URDF gives."""
    rotational: NDArray[np.float64]
    """Rotational inertia about the origin of the body's frame (kg m²), (3, 3)."""


class Limits(NamedTuple):
    """Limits of position, velocity and effort; infinite where there are none."""

    lower: NDArray[np.float64]
    """Least position (rad, m), nq numbers."""
    upper: NDArray[np.float64]
    """Greatest position (rad, m), nq numbers."""
    velocity: NDArray[np.float64]
    """Greatest speed (rad/s, m/s), nv numbers."""
    effort: NDArray[np.float64]
    """Greatest effort (N m, N), nv numbers."""


class Mimic(NamedTuple):
    """How a joint follows another one: its position is ratio * q + offset of the other's coordinate."""

    ratio: float
    """Ratio."""
    offset: float
    """Offset (rad, m)."""


# to users they are members of `condyle`, and are pickled as such
for _class in (
    RneaDerivatives,
    AbaDerivatives,
    CentroidalMap,
    CentroidalMapRate,
    AllTerms,
    Frame,
    Inertia,
    Limits,
    Mimic,
):
    _class.__module__ = "condyle"


class Iteration(NamedTuple):
    """What happened in one iteration of a solver."""

    iteration: int
    """Its number, from 0."""
    cost: float
    """Cost of the iterate after the step."""
    gap: float
    """Largest gap of the iterate before the step."""
    stop: float
    """The decrease of the cost expected of the full step; compared with the tolerance."""
    step: float
    """The step length tried last, which is the accepted one if one was."""
    regularisation: float
    """Regularisation after the iteration."""
    d1: float
    """Slope of the expected change: the cost should fall by α (d1 + ½ α d2)."""
    d2: float
    """Curvature of the expected change."""
    feasible: bool
    """Whether the iterate after the step satisfies the dynamics."""
    accepted: bool
    """Whether a step was accepted; if not, the iterate is as before."""


class Solution(NamedTuple):
    """The result of a solve: the best iterate, whatever the status says."""

    xs: NDArray[np.float64]
    """States, (N + 1, nx)."""
    us: NDArray[np.float64]
    """Controls, (N, nu)."""
    K: NDArray[np.float64]
    """Feedback gains of the last sweep, (N, nu, ndx): u + K (x ⊖ x̄) is the control near the trajectory."""
    k: NDArray[np.float64]
    """Feed-forward of the last sweep, (N, nu)."""
    cost: float
    """Cost of the trajectory."""
    gap: float
    """Largest gap of the trajectory."""
    feasible: bool
    """Whether the trajectory satisfies the dynamics."""
    status: Literal["converged", "max_iterations", "regularisation_limit", "not_finite"]
    """How the solve ended."""
    trace: list[Iteration]
    """A record per iteration."""
