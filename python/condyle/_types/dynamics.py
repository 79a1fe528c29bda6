"""Results of dynamics: derivatives, momentum, and all terms at once."""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

_Array: TypeAlias = NDArray[np.float64]


class RneaDerivatives(NamedTuple):
    """The derivatives of τ = rnea(q, v, a), each (nv, nv)."""

    dtau_dq: _Array
    """The derivative ∂τ/∂q in the tangent space: the derivative of τ at integrate(q, δ) with respect to δ."""
    dtau_dv: _Array
    """The derivative ∂τ/∂v, (nv, nv)."""
    dtau_da: _Array
    """The derivative ∂τ/∂a, which is M(q), armature included."""


class AbaDerivatives(NamedTuple):
    """The acceleration q̈ = aba(q, v, τ), and its derivatives, each (nv, nv)."""

    a: _Array
    """The acceleration q̈, nv numbers."""
    da_dq: _Array
    """The derivative ∂q̈/∂q in the tangent space: the derivative of q̈ at integrate(q, δ) with respect to δ."""
    da_dv: _Array
    """The derivative ∂q̈/∂v, (nv, nv)."""
    da_dtau: _Array
    """The derivative ∂q̈/∂τ, which is M(q)⁻¹."""


class RneaHessian(NamedTuple):
    """The Hessian of λᵀ rnea(q, v, a), each block (nv, nv)."""

    dqdq: _Array
    """The block for the pair (q, q), symmetric."""
    dvdq: _Array
    """The block for v and q: entry [j, k] is the derivative with respect to v_j and q_k."""
    dvdv: _Array
    """The block for the pair (v, v), symmetric."""
    dadq: _Array
    """The block for a and q: entry [j, k] is the derivative with respect to a_j and q_k."""


class AbaHessian(NamedTuple):
    """The Hessian of λᵀ aba(q, v, τ), each block (nv, nv)."""

    dqdq: _Array
    """The block for the pair (q, q), symmetric."""
    dvdq: _Array
    """The block for v and q: entry [j, k] is the derivative with respect to v_j and q_k."""
    dvdv: _Array
    """The block for the pair (v, v), symmetric."""
    dtaudq: _Array
    """The block for τ and q: entry [j, k] is the derivative with respect to τ_j and q_k."""


class RneaSecondDerivatives(NamedTuple):
    """The second derivatives of τ = rnea(q, v, a), each (nv, nv, nv). In each array, element [i] is a block of the
    Hessian of τ_i.
    """

    dqdq: _Array
    """The blocks for the pair (q, q): entry [i, j, k] is the derivative of τ_i with respect to q_j and q_k."""
    dvdq: _Array
    """The blocks for v and q: entry [i, j, k] is the derivative of τ_i with respect to v_j and q_k."""
    dvdv: _Array
    """The blocks for the pair (v, v): entry [i, j, k] is the derivative of τ_i with respect to v_j and v_k."""
    dadq: _Array
    """The blocks for a and q: entry [i, j, k] is the derivative of τ_i with respect to a_j and q_k."""


class CentroidalDerivatives(NamedTuple):
    """The derivatives of the centroidal momentum hg, its rate dhg, and the centre of mass c, along the world's axes."""

    dh_dq: _Array
    """The derivative ∂hg/∂q, (6, nv), linear rows first."""
    dh_dv: _Array
    """The derivative ∂hg/∂v, which is Ag, (6, nv)."""
    drate_dq: _Array
    """The derivative ∂dhg/∂q, (6, nv)."""
    drate_dv: _Array
    """The derivative ∂dhg/∂v, (6, nv)."""
    drate_da: _Array
    """The derivative ∂dhg/∂a, which is Ag, (6, nv)."""
    dcom_dq: _Array
    """The derivative ∂c/∂q, which equals ∂ċ/∂v and ∂c̈/∂a, (3, nv)."""
    dvcom_dq: _Array
    """The derivative ∂ċ/∂q of the centre of mass's velocity, (3, nv)."""
    dacom_dq: _Array
    """The derivative ∂c̈/∂q of the centre of mass's acceleration, (3, nv)."""
    dacom_dv: _Array
    """The derivative ∂c̈/∂v of the centre of mass's acceleration, (3, nv)."""


class EnergyDerivatives(NamedTuple):
    """The derivatives of kinetic energy T and potential energy V, nv numbers each."""

    dT_dq: _Array  # noqa: N815
    """The derivative ∂T/∂q of the kinetic energy."""
    dT_dv: _Array  # noqa: N815
    """The derivative ∂T/∂v of the kinetic energy, which is the generalised momentum M v."""
    dV_dq: _Array  # noqa: N815
    """The derivative ∂V/∂q of the potential energy, which is g(q)."""


class PassiveDerivatives(NamedTuple):
    """The derivatives of `passive_torque`, each (nv, nv)."""

    dtau_dq: _Array
    """The derivative ∂τ/∂q in the tangent space: the derivative of τ at integrate(q, δ) with respect to δ."""
    dtau_dv: _Array
    """The derivative ∂τ/∂v, (nv, nv)."""


class CoriolisDerivatives(NamedTuple):
    """The derivatives of C(q, v) v, each (nv, nv)."""

    dq: _Array
    """The derivative of C(q, v) v with respect to q."""
    dv: _Array
    """The derivative of C(q, v) v with respect to v."""


class CentroidalMap(NamedTuple):
    """The quantities of the centroidal momentum hg = Ag(q) v that depend on the position, along the axes of the
    world.
    """

    Ag: _Array
    """The centroidal momentum matrix, (6, nv), linear rows first: hg = Ag v."""
    Ig: _Array
    """The inertia of all moving bodies, as one rigid body, about their centre of mass, (6, 6): [m 1, 0; 0, Ī] with
    the mass m and the rotational inertia Ī of all these bodies.
    """
    com: _Array
    """The centre of mass c in the world's frame (m), 3 numbers."""
    Jcom: _Array
    """The Jacobian of the centre of mass c, (3, nv): ċ = Jcom v."""


class CentroidalMapRate(NamedTuple):
    """The centroidal momentum hg = Ag(q) v and the matrices of its rate Ag a + dAg v, along the axes of the world."""

    Ag: _Array
    """The centroidal momentum matrix, (6, nv), linear rows first: hg = Ag v."""
    dAg: _Array  # noqa: N815
    """The rate dAg/dt along the velocity, (6, nv)."""
    hg: _Array
    """The momentum about the centre of mass, in the axes of the world (kg m/s, kg m²/s), 6 numbers."""
    Ig: _Array
    """The inertia of all moving bodies, as one rigid body, about their centre of mass, (6, 6): [m 1, 0; 0, Ī] with
    the mass m and the rotational inertia Ī of all these bodies.
    """
    com: _Array
    """The centre of mass c in the world's frame (m), 3 numbers."""
    com_velocity: _Array
    """The velocity ċ of the centre of mass (m/s), 3 numbers."""
    Jcom: _Array
    """The Jacobian of the centre of mass c, (3, nv): ċ = Jcom v."""


class AllTerms(NamedTuple):
    """The terms of the equations of motion M a + h = τ, momentum and energies."""

    M: _Array
    """The inertia matrix M(q), (nv, nv), as returned by `crba`."""
    h: _Array
    """The nonlinear effects h(q, v), nv numbers, as returned by `nonlinear_effects`."""
    centroidal: CentroidalMapRate
    """Centroidal momentum, its matrix and the rate of this matrix, and the centre of mass, as returned by
    `centroidal_map_rate`.
    """
    kinetic_energy: float
    """The kinetic energy T = ½ vᵀ M v (J)."""
    potential_energy: float
    """The potential energy V = −m gᵀ c (J)."""
