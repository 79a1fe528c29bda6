"""What functions return when it is more than an array: named tuples."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


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


class RneaHessian(NamedTuple):
    """The Hessian of λᵀ rnea(q, v, a), each block (nv, nv)."""

    dqdq: NDArray[np.float64]
    """By q and q, symmetric."""
    dvdq: NDArray[np.float64]
    """By v and q: entry [j, k] by v_j and q_k."""
    dvdv: NDArray[np.float64]
    """By v and v, symmetric."""
    dadq: NDArray[np.float64]
    """By a and q: entry [j, k] by a_j and q_k."""


class AbaHessian(NamedTuple):
    """The Hessian of λᵀ aba(q, v, τ), each block (nv, nv)."""

    dqdq: NDArray[np.float64]
    """By q and q, symmetric."""
    dvdq: NDArray[np.float64]
    """By v and q: entry [j, k] by v_j and q_k."""
    dvdv: NDArray[np.float64]
    """By v and v, symmetric."""
    dtaudq: NDArray[np.float64]
    """By τ and q: entry [j, k] by τ_j and q_k."""


class RneaSecondDerivatives(NamedTuple):
    """The second derivatives of τ = rnea(q, v, a), each (nv, nv, nv): member[i] is a block of the Hessian of τ_i."""

    dqdq: NDArray[np.float64]
    """By q and q."""
    dvdq: NDArray[np.float64]
    """By v and q: entry [i, j, k] by v_j and q_k."""
    dvdv: NDArray[np.float64]
    """By v and v."""
    dadq: NDArray[np.float64]
    """By a and q: entry [i, j, k] by a_j and q_k."""


class CentroidalDerivatives(NamedTuple):
    """The derivatives of the centroidal momentum hg, its rate dhg, and the centre of mass c; axes of the world."""

    dh_dq: NDArray[np.float64]
    """∂hg/∂q, (6, nv), linear rows first."""
    dh_dv: NDArray[np.float64]
    """∂hg/∂v = Ag, (6, nv)."""
    drate_dq: NDArray[np.float64]
    """∂dhg/∂q, (6, nv)."""
    drate_dv: NDArray[np.float64]
    """∂dhg/∂v, (6, nv)."""
    drate_da: NDArray[np.float64]
    """∂dhg/∂a = Ag, (6, nv)."""
    dcom_dq: NDArray[np.float64]
    """∂c/∂q = ∂ċ/∂v = ∂c̈/∂a, (3, nv)."""
    dvcom_dq: NDArray[np.float64]
    """∂ċ/∂q, (3, nv)."""
    dacom_dq: NDArray[np.float64]
    """∂c̈/∂q, (3, nv)."""
    dacom_dv: NDArray[np.float64]
    """∂c̈/∂v, (3, nv)."""


class EnergyDerivatives(NamedTuple):
    """The derivatives of kinetic energy T and potential energy V, nv numbers each."""

    dT_dq: NDArray[np.float64]  # noqa: N815
    """∂T/∂q."""
    dT_dv: NDArray[np.float64]  # noqa: N815
    """∂T/∂v = M v, the generalised momentum."""
    dV_dq: NDArray[np.float64]  # noqa: N815
    """∂V/∂q = g(q)."""


class CoriolisDerivatives(NamedTuple):
    """The derivatives of C(q, v) v, each (nv, nv)."""

    dq: NDArray[np.float64]
    """By q."""
    dv: NDArray[np.float64]
    """By v."""


class Constrained(NamedTuple):
    """What `constrained_dynamics` gives."""

    a: NDArray[np.float64]
    """q̈, nv numbers (rad/s², m/s²)."""
    lambda_: NDArray[np.float64]
    """λ, the force of each constraint on the body of its frame, along the axes of its rows (N, N m)."""
    residual: float
    """The largest number in J q̈ + γ (m/s², rad/s²): how well the constraints are satisfied."""
    redundant: float
    """How many rows of J depend on rows before them, up to rounding: they have no force of their own."""


class ConstrainedDerivatives(NamedTuple):
    """What `constrained_dynamics_derivatives` gives; ∂/∂q is taken in the tangent space."""

    a: NDArray[np.float64]
    """q̈ itself, nv numbers."""
    lambda_: NDArray[np.float64]
    """λ, the force of each constraint on the body of its frame, along the axes of its rows (N, N m)."""
    residual: float
    """The largest number in J q̈ + γ (m/s², rad/s²): how well the constraints are satisfied."""
    redundant: float
    """How many rows of J depend on rows before them, up to rounding: they have no force of their own."""
    da_dq: NDArray[np.float64]
    """∂q̈/∂q, (nv, nv)."""
    da_dv: NDArray[np.float64]
    """∂q̈/∂v, (nv, nv)."""
    da_dtau: NDArray[np.float64]
    """∂q̈/∂τ, (nv, nv), symmetric."""
    dlambda_dq: NDArray[np.float64]
    """∂λ/∂q, (rows, nv)."""
    dlambda_dv: NDArray[np.float64]
    """∂λ/∂v, (rows, nv)."""
    dlambda_dtau: NDArray[np.float64]
    """∂λ/∂τ, (rows, nv)."""
    inertia: NDArray[np.float64]
    """(J M⁻¹ Jᵀ)⁻¹, (rows, rows): the inertia that the robot shows to its constraints."""


class ConstrainedEquations(NamedTuple):
    """What `constrained_dynamics_equations` gives; ∂/∂q is taken in the tangent space."""

    a: NDArray[np.float64]
    """q̈ itself, nv numbers."""
    lambda_: NDArray[np.float64]
    """λ, the force of each constraint on the body of its frame, along the axes of its rows (N, N m)."""
    residual: float
    """The largest number in J q̈ + γ (m/s², rad/s²): how well the constraints are satisfied."""
    redundant: float
    """How many rows of J depend on rows before them, up to rounding: they have no force of their own."""
    M: NDArray[np.float64]
    """M, (nv, nv), armature included."""
    dtau_dq: NDArray[np.float64]
    """∂(M q̈ + h − Jᵀ λ)/∂q, (nv, nv)."""
    dtau_dv: NDArray[np.float64]
    """∂h/∂v, (nv, nv)."""
    dgamma_dq: NDArray[np.float64]
    """∂(J q̈ + γ)/∂q, (rows, nv)."""
    dgamma_dv: NDArray[np.float64]
    """∂γ/∂v, (rows, nv)."""


class Impulse(NamedTuple):
    """What `impulse_dynamics` gives."""

    v: NDArray[np.float64]
    """v⁺, the velocity after the impact, nv numbers (rad/s, m/s)."""
    lambda_: NDArray[np.float64]
    """Λ, the impulse of each constraint on the body of its frame, along the axes of its rows (N s, N m s)."""
    residual: float
    """The largest number in J (v⁺ + ε v) (m/s, rad/s)."""
    redundant: float
    """How many rows of J depend on rows before them, up to rounding: they have no force of their own."""


class ImpulseDerivatives(NamedTuple):
    """What `impulse_dynamics_derivatives` gives; ∂/∂q is taken in the tangent space."""

    v: NDArray[np.float64]
    """v⁺ itself, nv numbers."""
    lambda_: NDArray[np.float64]
    """Λ, the impulse of each constraint on the body of its frame, along the axes of its rows (N s, N m s)."""
    residual: float
    """The largest number in J (v⁺ + ε v) (m/s, rad/s)."""
    redundant: float
    """How many rows of J depend on rows before them, up to rounding: they have no force of their own."""
    dv_dq: NDArray[np.float64]
    """∂v⁺/∂q, (nv, nv)."""
    dv_dv: NDArray[np.float64]
    """∂v⁺/∂v, (nv, nv)."""
    dlambda_dq: NDArray[np.float64]
    """∂Λ/∂q, (rows, nv)."""
    dlambda_dv: NDArray[np.float64]
    """∂Λ/∂v, (rows, nv)."""
    inertia: NDArray[np.float64]
    """(J M⁻¹ Jᵀ)⁻¹, (rows, rows): the inertia that the robot shows to its constraints."""


class Constraint(NamedTuple):
    """A contact of a frame with the world, or a loop that two frames close.

    With velocity v and acceleration a of the frame relative to the other body, and its pose X in the other frame moved
    to the target, it asks for a − a* + kd (v − v*) + kp e = 0 with e = log X ('rigid'), or the difference of the
    frames' origins ('point'), along the axes of `reference` at the frame's origin: Pinocchio's RigidConstraintModel and
    Crocoddyl's contacts. A point's acceleration is the classical one, a rigid frame's the spatial one.
    """

    frame: str | int
    """The frame that is held."""
    kind: Literal["point", "rigid"]
    """Its origin, three rows; or the whole frame, six rows, linear first."""
    other: str | int | None = None
    """The frame that it is held to; the world if there is none."""
    reference: Literal["local", "local_world_aligned"] = "local"
    """Along which axes rows and forces are: the frame's or the world's."""
    kp: float = 0.0
    """How fast an error of position decays (1/s²)."""
    kd: float = 0.0
    """How fast an error of velocity decays (1/s)."""
    placement: ArrayLike | None = None
    """The wanted pose of the frame in the other frame, (4, 4); of a point, the translation alone."""
    velocity: ArrayLike | None = None
    """v*, six numbers along the axes of `reference` (m/s, rad/s)."""
    acceleration: ArrayLike | None = None
    """a*, six numbers along the axes of `reference` (m/s², rad/s²)."""


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
    """Rotational inertia about the origin of the body's frame (kg m²), (3, 3): of the two, the one that is read."""

    @classmethod
    def from_com(cls, mass: float, com: ArrayLike, about_com: ArrayLike) -> "Inertia":
        """The inertia of a body with this mass (kg), centre of mass (m), and rotational inertia about it (kg m²).

        >>> condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3)).rotational[0, 0].item()
        0.6
        """
        com, about_com = np.array(com, np.float64), np.array(about_com, np.float64)
        if com.shape != (3,):
            raise ValueError(f"com: expected shape (3,), found {com.shape}")
        if about_com.shape != (3, 3):
            raise ValueError(f"about_com: expected shape (3, 3), found {about_com.shape}")
        # Ī = I_c + m (c·c 1 − c cᵀ)
        return cls(mass, com, about_com, about_com + mass * (com @ com * np.eye(3) - np.outer(com, com)))


class AssemblySize(NamedTuple):
    """What the assembly of a `DivideConquer` costs, counted."""

    bodies: int
    """Moving bodies: each is eliminated once."""
    runs: int
    """Pieces within which bodies are eliminated one after the other."""
    longest_run: int
    """Bodies in the largest of them."""
    joins: int
    """Pairs of pieces that are joined, one below the other."""
    gathers: int
    """Pairs of pieces that are added up, both on one body."""
    levels: int
    """How many pieces, from a run to the whole, wait for one another."""


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
    AssemblySize,
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


class Timings(NamedTuple):
    """Where the time of a solve went (s)."""

    calc: float
    """Dynamics and cost of the warm start."""
    calc_diff: float
    """Derivatives."""
    sweep: float
    """Backward sweeps, repeated ones included."""
    rollout: float
    """Trial rollouts of the line searches, accepted or not."""
    total: float
    """The whole solve."""


class Solution(NamedTuple):
    """The result of a solve: the best iterate, whatever the status says.

    Where knots differ in nu, what belongs to controls is a list of N arrays instead of one array.
    """

    xs: NDArray[np.float64]
    """States, (N + 1, nx)."""
    us: NDArray[np.float64] | list[NDArray[np.float64]]
    """Controls, (N, nu)."""
    K: NDArray[np.float64] | list[NDArray[np.float64]]
    """Feedback gains of the last sweep, (N, nu, ndx): u + K (x ⊖ x̄) is the control near the trajectory."""
    k: NDArray[np.float64] | list[NDArray[np.float64]]
    """Feed-forward of the last sweep, (N, nu)."""
    cost: float
    """Cost of the trajectory."""
    gap: float
    """Largest gap of the trajectory."""
    feasible: bool
    """Whether the trajectory satisfies the dynamics."""
    status: Literal["converged", "max_iterations", "time_limit", "regularisation_limit", "infeasible", "not_finite"]
    """How the solve ended."""
    trace: list[Iteration]
    """A record per iteration."""
    timings: Timings
    """Where the time went."""


class Outcome(NamedTuple):
    """What a solve of `AugmentedLagrangian` says beside its `Solution`."""

    cost: float
    """The cost without the terms of the limits."""
    primal: float
    """The largest distance of a limit's number from its bounds, or gap of the dynamics."""
    dual: float
    """The largest entry of the gradient of the Lagrangian by the controls, projected on their bounds."""
    multipliers: list[NDArray[np.float64]]
    """The multipliers of each knot, limit after limit: positive at an upper bound, negative at a lower one."""
    penalty: float
    """1/μ at the end."""
    solves: int
    """Inner solves."""
    iterations: int
    """Iterations of all of them."""


class Control(NamedTuple):
    """What a control law sees before a step of a `Simulation`, and what it sets."""

    time: float
    """The time at which the step begins (s)."""
    q: NDArray[np.float64]
    """The position, nq numbers."""
    v: NDArray[np.float64]
    """The velocity, nv numbers."""
    tau: NDArray[np.float64]
    """The joint efforts during the step, nv numbers (N m, N); 0 when the law is called, which sets them in place."""
    f_ext: NDArray[np.float64]
    """The force on each body during the step, (nbodies, 6), at its origin and in its frame; likewise."""
