"""Named tuples: results of functions that return more than one array, and some arguments."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from typing_extensions import Self, disjoint_base
else:

    def disjoint_base(cls: type) -> type:
        """Marks a class for type checkers as a disjoint base, so that no class can derive from this class and another
        disjoint base.
        """
        return cls


_Array: TypeAlias = NDArray[np.float64]


class ReadOnly(np.ndarray[Any, np.dtype[np.float64]]):
    """An array of a model's numbers. The array is read-only, since a model never changes. An attempt to write raises an
    error that names the method of `Model` that returns a changed model.

    Results of arithmetic and copies are plain NumPy arrays, which can be changed.
    """

    _instead: str

    @classmethod
    def of(cls, numbers: _Array, instead: str) -> "ReadOnly":
        """Returns these numbers as a read-only array. `instead` is the method of `Model` that makes a model with other
        numbers, if such a method exists.
        """
        array = numbers.view(cls)
        array._instead = instead
        array.flags.writeable = False
        return array

    def __array_finalize__(self, other: Any) -> None:
        self._instead = getattr(other, "_instead", "")

    def _refuse(self) -> NoReturn:
        other = f"model.{self._instead}(...) makes another one" if self._instead else "a ModelBuilder makes another one"
        raise ValueError(f"read-only: a model never changes; {other}, and array.copy() is an array of your own")

    def __setitem__(self, key: Any, value: Any) -> None:
        if not self.flags.writeable:
            self._refuse()
        super().__setitem__(key, value)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, out: Any = None, **options: Any) -> Any:
        if out is not None:
            for array in out:
                if isinstance(array, ReadOnly) and not array.flags.writeable:
                    array._refuse()
            options["out"] = out
        plain = (x.view(np.ndarray) if isinstance(x, ReadOnly) else x for x in inputs)
        return getattr(ufunc, method)(*plain, **options)

    def copy(self, order: Literal["K", "A", "C", "F"] | None = "C") -> _Array:  # type: ignore[override]
        """Returns a plain NumPy array with the same numbers."""
        return np.array(self, order=order)

    def __reduce__(self) -> Any:
        return self.view(np.ndarray).__reduce__()

    def __repr__(self) -> str:
        return repr(self.view(np.ndarray))


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


class Frame(NamedTuple):
    """A frame fixed to a body."""

    name: str
    """The name of the frame: the name of its link or joint, or the user's name."""
    kind: Literal["link", "joint", "user", "constraint"]
    """The source of the frame: a link, a joint, the user, or a constraint."""
    body: int
    """The body to which the frame is fixed; 0 is the world."""
    placement: _Array
    """The pose of the frame in the body's frame, a homogeneous (4, 4) matrix."""


class AssemblySize(NamedTuple):
    """The numbers of bodies, runs, operations and steps of a `DivideConquer`, which determine its cost."""

    bodies: int
    """The number of moving bodies; each body is eliminated once."""
    runs: int
    """The number of runs, within which bodies are eliminated one after the other."""
    longest_run: int
    """The number of bodies in the largest run."""
    joins: int
    """The number of joins: each join connects two parts of the tree, where one part is attached to the last body of the
    other part."""
    gathers: int
    """The number of sums of two parts of the tree that are attached to the same body."""
    depth: int
    """The number of steps that must be computed one after the other: the number of parts on the longest path from a run
    to the whole robot.
    """


class Limits(NamedTuple):
    """Limits of position, velocity and effort; infinite where a limit is missing."""

    lower: _Array
    """Minimum position (rad, m), nq numbers."""
    upper: _Array
    """Maximum position (rad, m), nq numbers."""
    velocity: _Array
    """Maximum speed (rad/s, m/s), nv numbers."""
    effort: _Array
    """Maximum magnitude of the effort (N m, N), nv numbers."""
    effort_lower: _Array
    """Minimum effort (N m, N), nv numbers, usually negative."""
    effort_upper: _Array
    """Maximum effort (N m, N), nv numbers."""


class Spring(NamedTuple):
    """A spring of a joint: τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ with the displacement Δ = q ⊖ rest. For joints with several
    degrees of freedom, the brackets contain |Δ| instead of Δ."""

    joint: str
    """The name of the joint to which the spring belongs."""
    stiffness: _Array
    """The coefficients k₀ (N m/rad or N/m), k₁ (unit of k₀, per rad or m) and k₂ (unit of k₀, per rad² or m²)."""
    rest: _Array
    """The joint's position at which the spring is at rest, with as many numbers as the joint has in q."""


class GravityCompensation(NamedTuple):
    """A supported fraction of a body's weight: the force −mass g acts at the point mass_com / mass."""

    body: str
    """The name of the supported body."""
    mass: float
    """The mass whose weight is supported (kg)."""
    mass_com: _Array
    """The supported mass times the position of the mass's centre in the body's frame (kg m), 3 numbers."""
    ratio: float
    """The supported fraction of the body's weight, except for parts of the body with another ratio. If the inertia of
    the body changes, `mass` changes by this ratio times the change of the body's mass.
    """


class Actuator(NamedTuple):
    """An actuator of a robot, as its file describes it.

    u is the control, and the length l is the gear times the driven position. The force is f = gain u + bias − kp l − kv
    l̇, and the effort at the joint is gear · f. A motor has the gain 1, and the other coefficients are zero. A position
    servo has the gain kp, a velocity servo the gain kv.
    """

    name: str
    """The name of the actuator, or an empty string."""
    joint: str | None
    """The name of the driven joint; None if the actuator does not drive a joint."""
    tendon: str | None
    """The name of the driven tendon; None if the actuator does not drive a tendon."""
    frame: str | None
    """The name of the frame on which the actuator acts; None if the actuator does not act on a frame."""
    coefficients: dict[str, float]
    """The joints of the tendon by name, each with its coefficient (1, m/rad)."""
    gear: _Array
    """The effort at the joint per unit of force (1, m), 6 numbers. Joints with one degree of freedom and tendons use
    the first number. A ball joint uses three numbers: an axis in the frame of its body. A frame uses six numbers,
    linear first, in the frame's axes. A free joint also uses six numbers: a force in the world's axes and a torque in
    the body's axes.
    """
    gain: float
    """The force of the actuator per unit of control."""
    bias: float
    """The force at zero control, zero length and rest (N, N m)."""
    kp: float
    """The position gain (N/m, N m/rad); 0 for a motor."""
    kv: float
    """The velocity gain (N s/m, N m s/rad); 0 for a motor."""
    control: tuple[float, float]
    """The minimum and maximum control; infinite for no limit."""
    force: tuple[float, float]
    """The minimum and maximum force before the gear (N, N m); infinite for no limit."""


class ModelWarning(str):
    """A warning about a robot or its file: a string with the text of the warning, and the attributes below."""

    kind: str
    """The kind of the warning: 'massless', 'negative', 'triangle', 'singular', 'unlikely', 'limit', 'unknown',
    'left_out', 'assumed' or 'mimic'. A strict reader accepts the kinds in its argument `allow`.
    """
    subject: str
    """The subject of the warning: the name of a body or joint, or the element of the file."""
    file: str | None
    """The path of the file; None if the warning is not about a file."""
    line: int | None
    """The number of the line in the file, counted from 1; None if the warning is not about a file."""

    def __new__(cls, text: str, kind: str, subject: str, file: str | None = None, line: int | None = None) -> "Self":
        """Creates a warning from its text and its attributes."""
        warning = super().__new__(cls, text)
        warning.kind, warning.subject, warning.file, warning.line = kind, subject, file, line
        return warning

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the class and the arguments from which `pickle` makes an equal warning."""
        return type(self), (str(self), self.kind, self.subject, self.file, self.line)


class Mimic(NamedTuple):
    """The rule by which a joint follows another joint. The position of the follower is ratio * q + offset, where q is
    the position of the other joint.
    """

    ratio: float
    """The ratio of the follower's motion to the leader's motion (1, m/rad or rad/m)."""
    offset: float
    """The offset of the follower's position (rad, m)."""


class Iteration(NamedTuple):
    """A record of one iteration of a solver."""

    iteration: int
    """Index of the iteration, which begins at 0."""
    cost: float
    """Cost of the iterate after the step."""
    gap: float
    """Largest gap of the iterate before the step."""
    stop: float
    """The expected decrease of the cost for the full step. The solver compares this decrease with the tolerance."""
    step: float
    """The last step length tried, which is the accepted step length if a step was accepted."""
    regularisation: float
    """Regularisation of the sweep after the iteration."""
    d1: float
    """Slope of the expected decrease: for a step length α, the cost should decrease by α (d1 + ½ α d2)."""
    d2: float
    """Curvature of the expected decrease; see `d1`."""
    feasible: bool
    """Whether the iterate after the step satisfies the dynamics."""
    accepted: bool
    """Whether a step was accepted; if not, the iterate is unchanged."""


class Timings(NamedTuple):
    """The durations of the phases of a solve (s)."""

    calc: float
    """Time for dynamics and cost of the warm start."""
    calc_diff: float
    """Time for the derivatives of dynamics and costs."""
    sweep: float
    """Time for backward sweeps, including repeated sweeps."""
    rollout: float
    """Time for the trial rollouts of the line searches, accepted or not."""
    total: float
    """Time for the whole solve."""
    overrun: float = 0.0
    """The time in excess of `time_budget`. The overrun is above zero if the budget is shorter than an iteration, or if
    the solve was delayed. With a budget of 0 no iteration is made, and the overrun is 0.
    """


class Evaluation(NamedTuple):
    """The cost of states and controls, and the results of the dynamics at each knot."""

    cost: float
    """The sum of the costs of all knots."""
    costs: _Array
    """The cost of each knot, N + 1 numbers, the terminal knot last."""
    next_states: _Array
    """The next states φ(x, u), (N, nx)."""
    gaps: _Array
    """The gaps: first x̂₀ ⊖ x₀ with the problem's initial state x̂₀, then φ(xₜ, uₜ) ⊖ xₜ₊₁ with the next state φ(xₜ,
    uₜ) for each knot t, (N + 1, ndx).
    """
    accelerations: list[_Array]
    """The accelerations of each knot of a robot, nv numbers; empty for other knots and for impacts."""
    efforts: list[_Array]
    """The efforts of all joints at each knot of a robot, nv numbers; empty for other knots and for impacts."""
    forces: list[dict[str, _Array]]
    """For each knot, the contact forces by the contact's name, 1 to 6 numbers along the axes of the contact's rows; for
    impacts, the impulses.
    """


class _Solution(NamedTuple):
    xs: _Array
    """The states of the trajectory, (N + 1, nx)."""
    us: _Array | list[_Array]
    """The controls of the trajectory, (N, nu)."""
    K: _Array | list[_Array]
    """Feedback gains of the last sweep, (N, nu, ndx): u + K (x ⊖ x̄) is the control near the trajectory."""
    k: _Array | list[_Array]
    """The feed-forward terms of the last sweep, (N, nu)."""
    cost: float
    """Cost of the trajectory."""
    gap: float
    """Largest gap of the trajectory."""
    feasible: bool
    """Whether the trajectory satisfies the dynamics."""
    status: Literal[
        "converged",
        "full_step",
        "max_iterations",
        "time_limit",
        "interrupted",
        "regularisation_limit",
        "constraints_violated",
        "infeasible",
        "not_finite",
    ]
    """The reason why the solve ended.

    A controller may execute the solution, with u = ū + K (x ⊖ x̄), after "converged" and "full_step": the trajectory
    then begins at x̂₀ and has no gaps. After "max_iterations", "time_limit", "interrupted" and "regularisation_limit",
    all numbers are finite, but the trajectory may have gaps, and x̄₀ may differ from x̂₀. If `trace` is empty, the gains
    are from the previous solve. After "not_finite", continue with the previous solution. After
    "constraints_violated" and "infeasible", the violation in `outcome.worst` decides.

    "full_step": `resume(stop="full_step")` accepted a step of length 1. "regularisation_limit": no acceptable step was
    found, away from a minimum. "constraints_violated": the penalty reached its maximum, and limits do not hold at a
    minimum; this does not prove that no solution exists. "infeasible": the initial state violates a limit of knot 0
    that no control can change. This proves that no solution exists. `InteriorPoint` also ends with "infeasible" where
    no small change of the trajectory reduces the violation, and with "constraints_violated" if its restoration did not
    reduce the violation enough. Another warm start may then find a solution. `outcome.worst` contains the limit.
    """
    trace: list[Iteration]
    """The records of the iterations, one for each iteration."""
    timings: Timings
    """The durations of the phases of the solve."""
    fallback: Literal["rolled_out", "held_still"] | None = None
    """The trajectory that replaced the trajectory of the last solution; None if that was continued.

    "rolled_out": a rollout of the last plan from x̂₀ with its gains. It replaces a plan with gaps above 10 (rad, m,
    rad/s, m/s), and it is the plan after a tick whose sweep failed. "held_still": x̂₀ at all knots, and the controls
    that hold it still. They replace a plan that is not finite, or that costs far more than the last solution.
    """


class PlanPoint(NamedTuple):
    """A plan at one time, as `Solution.at` returns it."""

    knot: int
    """The index of the knot."""
    x: _Array
    """The state x̄, interpolated between the states of this knot and of the next one, nx numbers."""
    u: _Array
    """The controls ū of the knot, nu numbers."""
    K: _Array
    """The feedback gains of the knot, (nu, ndx)."""


class RecordedTick(NamedTuple):
    """A tick of a `Record`: the calls since the tick before it, and the result of the last call."""

    calls: list[tuple[str, dict[str, Any]]]
    """The calls in their sequence: the name of the method of `Problem` or of the solver, and its arguments by name.
    The last call is `solve`, `resume` or `tick`. "settings" contains settings that were assigned. The costs of
    `set_costs` and the model of `set_knot` are JSON.
    """
    status: str
    """The status of the solution."""
    xs: _Array
    """The states of the solution, (N + 1, nx)."""
    us: _Array
    """The controls of the solution, (N, nu), or the numbers of all knots in one array if models differ in nu."""


class Difference(NamedTuple):
    """The first difference between a `Record` and its replay."""

    tick: int
    """The index of the tick."""
    array: str
    """The array that differs: "status", "xs", "us" or "K"."""
    largest: float
    """The largest difference of two numbers; NaN for the status and for K, of which a record has only a checksum."""


@disjoint_base
class Solution(_Solution):
    """The result of a solve: the best iterate, for every status.

    If knots differ in nu, `us`, `K` and `k` are lists of N arrays.
    """

    _source: Any = None
    _evaluation: Evaluation | None = None
    _times: _Array | None = None

    @property
    def executable(self) -> bool:
        """Whether a controller may execute the plan: the status is not "not_finite", and all states, controls and gains
        are finite. The plan may still have gaps (`gap`), or violate limits (`outcome.worst`).

        If the plan is not executable, continue with the last one that was, and `reset` the solver.
        """
        arrays = [self.xs, *self.us, *self.K]
        return self.status != "not_finite" and all(bool(np.isfinite(numbers).all()) for numbers in arrays)

    def at(self, t: float) -> PlanPoint:
        """Returns the plan at the time t (s) after the beginning of knot 0, as a `PlanPoint`.

        The state is x̄ = xₖ ⊕ s (xₖ₊₁ ⊖ xₖ) at the fraction s of knot k. The controls and gains belong to knot k,
        because they are constant during a knot. Times outside the horizon give its first or its last state. An impact
        takes no time. Another thread can call this method while a solve runs.

        Raises `ValueError` if a knot has no duration: a knot of an `Action`.
        """
        if self._source is None:
            raise AttributeError("this solution was copied from its problem, which interpolates states")
        if (times := self._times) is None:
            raise ValueError("a knot has no duration: only knots of robots have durations")
        last = len(times) - 2
        knot = int(np.searchsorted(times[1 : last + 1], t, side="right"))
        span = times[knot + 1] - times[knot]
        s = min(max((t - times[knot]) / span, 0.0), 1.0) if span > 0.0 else 0.0
        while len(self.us[knot]) == 0 and knot > 0:
            knot, s = knot - 1, 1.0
        x = self._source[0]._between(self.xs[knot], self.xs[knot + 1], s)
        return PlanPoint(knot, x, self.us[knot], self.K[knot])

    def _evaluated(self) -> Evaluation:
        if self._evaluation is None:
            if self._source is None:
                raise AttributeError("this solution was copied from its problem: call Problem.evaluate(xs, us)")
            problem, moved = self._source
            self._evaluation = problem._evaluate(self.xs, self.us, moved)
        return self._evaluation

    @property
    def accelerations(self) -> list[_Array]:
        """The accelerations of each knot, as in an `Evaluation`; computed on first access."""
        return self._evaluated().accelerations

    @property
    def efforts(self) -> list[_Array]:
        """The efforts of all joints at each knot, as in an `Evaluation`; computed on first access."""
        return self._evaluated().efforts

    @property
    def forces(self) -> list[dict[str, _Array]]:
        """The forces of each knot's contacts by name, as in an `Evaluation`; computed on first access."""
        return self._evaluated().forces

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the function and the arguments from which `pickle` makes a solution with the same numbers, but
        without the problem.
        """
        return type(self), tuple(self)


class ConstraintRows(NamedTuple):
    """Constraints of an `LqKnot`: lower ≤ C δx + D δu + c ≤ upper, row by row."""

    C: ArrayLike
    """The derivative ∂g/∂x of the constraints g, (rows, ndx)."""
    D: ArrayLike
    """The derivative ∂g/∂u of the constraints g, (rows, nu)."""
    c: ArrayLike
    """The values of the constraints at δx = 0, δu = 0, one for each row."""
    lower: ArrayLike
    """The lower bounds, one for each row; −∞ for no bound."""
    upper: ArrayLike
    """The upper bounds, one for each row; ∞ for no bound."""


class LqKnot(NamedTuple):
    """The linear-quadratic problem of a knot: dynamics δx⁺ = A δx + B δu + f, and cost ½ δxᵀQδx + δxᵀSδu + ½ δuᵀRδu +
    qᵀδx + rᵀδu.
    """

    A: ArrayLike
    """The derivative ∂x⁺/∂x of the next state, (ndx, ndx)."""
    B: ArrayLike
    """The derivative ∂x⁺/∂u of the next state, (ndx, nu)."""
    f: ArrayLike
    """The gap φ(x, u) ⊖ x⁺, ndx numbers."""
    Q: ArrayLike
    """The second derivative ∂²ℓ/∂x² of the cost, (ndx, ndx)."""
    S: ArrayLike
    """The second derivative ∂²ℓ/∂x∂u of the cost, (ndx, nu)."""
    R: ArrayLike
    """The second derivative ∂²ℓ/∂u² of the cost, (nu, nu)."""
    q: ArrayLike
    """The derivative ∂ℓ/∂x of the cost, ndx numbers."""
    r: ArrayLike
    """The derivative ∂ℓ/∂u of the cost, nu numbers."""
    rows: ConstraintRows | None = None
    """The constraints of the knot; None without constraints."""


class ManyRollouts(NamedTuple):
    """The results of `rollout_many` for B control sequences.

    If a sequence diverges, its cost is infinite, its gradients are NaN, and its states are NaN from there on.
    """

    costs: _Array
    """The cost of each sequence, B numbers."""
    xs: _Array | None
    """The states of each sequence, (B, N + 1, nx); None if they were not asked for."""
    du: _Array | None
    """The gradients of the costs with respect to the controls, with the shape of `us`; None if not asked for."""
    dx0: _Array | None
    """The gradients of the costs with respect to the initial states, in the tangent space, (B, ndx)."""


class SweepResult(NamedTuple):
    """The feedback and the value functions of a `Sweep`: V(δx) = ½ δxᵀ Vxx δx + Vxᵀ δx + a constant."""

    K: list[_Array]
    """The gains of each knot, (nu, ndx)."""
    k: list[_Array]
    """The feed-forward of each knot, nu numbers."""
    Vx: _Array
    """The gradients of the value functions, (N + 1, ndx)."""
    Vxx: _Array
    """The Hessians of the value functions, (N + 1, ndx, ndx)."""


class Violation(NamedTuple):
    """A row of a limit, or of the dynamics, that is violated at the end of a solve."""

    kind: Literal["constraint", "control_bound", "gap"]
    """'constraint' for a limit or constraint of a knot, 'control_bound' for a bound on a control, 'gap' for a gap of
    the dynamics.
    """
    knot: int
    """The index of the knot, 0 … N."""
    row: int
    """The index of the row in `multipliers[knot]`; for a bound, the index of the control; for a gap, the index in the
    tangent vector.
    """
    name: str | None
    """The name of the limit; None for a constraint of a `ConstrainedAction` and for a gap."""
    entry: int
    """The index of the row in the limit `name`; without a name, the same number as `row`."""
    amount: float
    """The distance from the bound, or the magnitude of the gap; infinite if this number is NaN."""
    what: str | None = None
    """The two geometries of a limit of distances; None for other rows."""


class SensitivityReport(NamedTuple):
    """The report of a `Sensitivity` on the solution at which it was computed."""

    curvature: Literal["exact", "dynamics", "gauss_newton"]
    """The second derivatives that were used."""
    stationarity: float
    """The largest gradient of the Lagrangian with respect to a free control, relative to its terms."""
    primal: float
    """The largest gap of the dynamics, or distance of an active constraint from its bound."""
    active_controls: int
    """The number of controls at a bound, over all knots."""
    active_rows: int
    """The number of active rows of limits, over all knots. Equalities are always active."""
    strict_complementarity: bool
    """Whether each inequality is clearly active or clearly inactive: `margin` is at least `strictness`. If not, the
    solution has a kink nearby, and the derivative on the other side of the kink differs.
    """
    margin: float
    """The smallest value, over all inequalities, of the larger one of multiplier and distance from the bound."""
    weakest: tuple[Literal["control_bound", "constraint"], int, int] | None
    """The inequality with that value: its kind, its knot, and its control or row; None without inequalities."""


class BoundGradients(NamedTuple):
    """The gradients of a loss with respect to the initial state and to active bounds, from `Sensitivity.bounds`."""

    x0: _Array
    """The gradient with respect to the initial state, ndx numbers in its tangent space."""
    control_bounds: _Array | list[_Array]
    """The gradients with respect to the bounds on controls, (N, nu), or a list of N arrays if knots differ in nu; zero
    for controls that are not at a bound.
    """
    row_bounds: list[_Array]
    """The gradients with respect to the bounds of limits, for the rows of each knot in the order of
    `Outcome.multipliers`; zero for rows that are not active. Both bounds of an equality move.
    """


class Outcome(NamedTuple):
    """The violation of limits and other results of a solve of `AugmentedLagrangian` or `InteriorPoint`, in addition to
    its `Solution`.
    """

    cost: float
    """The cost without the penalties of the limits."""
    primal: float
    """The largest distance of a limited number from its bounds, or the largest gap of the dynamics. Soft limits have no
    part in it.
    """
    dual: float
    """The largest entry of the Lagrangian's gradient. For `AugmentedLagrangian` the gradient is with respect to
    controls and states, projected onto the bounds of the controls. For `InteriorPoint` it is with respect to the
    controls, and infinite after `tick`, which does not measure it.
    """
    multipliers: list[_Array]
    """The multipliers of each knot, limit by limit: positive at an upper bound, negative at a lower bound. For
    `InteriorPoint`, the multipliers of the bounds on controls follow.
    """
    penalty: float
    """The penalty 1/μ at the end of the solve of `AugmentedLagrangian`; 0 for `InteriorPoint`."""
    solves: int
    """The number of inner solves."""
    iterations: int
    """The total number of iterations of the inner solves."""
    worst: Violation | None = None
    """The largest violation; None if all limits hold exactly."""
    barrier: float = 0.0
    """The barrier parameter μ at the end of the solve of `InteriorPoint`; 0 for `AugmentedLagrangian`."""
    soft_cost: float = 0.0
    """The cost of all numbers outside the bounds of soft limits. `cost` does not contain it; the sum is minimal."""
    gave_way: tuple[Violation, ...] = ()
    """The rows of soft limits outside their bounds by more than 100 times the tolerance, knot by knot."""
    limits: dict[str, list[slice]] = {}  # noqa: RUF012 - a named tuple has no mutable attributes of its own
    """The rows of each named limit: for each knot a slice of `multipliers[knot]`, empty at a knot without the limit."""

    def multipliers_of(self, name: str) -> _Array:
        """Returns the multipliers of the limit `name`, (N + 1, rows): positive at an upper bound, negative at a lower
        bound. They are 0 at a knot without this limit. `solver.set_multipliers` accepts the result.

        Raises `ProblemError` if no limit has this name.
        """
        from ._condyle import ProblemError

        if name not in self.limits:
            names = f"; the limits are {', '.join(f'`{known}`' for known in self.limits)}" if self.limits else ""
            raise ProblemError(f"multipliers of `{name}`: no limit has this name{names}")
        found = [y[rows] for y, rows in zip(self.multipliers, self.limits[name], strict=True)]
        result = np.zeros((len(found), max(map(len, found))))
        for row, y in zip(result, found, strict=True):
            row[: len(y)] = y
        return result


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


class Sphere(NamedTuple):
    """A sphere that is fixed to a frame of a robot, or to the world; see `Residual.distances`."""

    center: ArrayLike
    """The centre in the coordinates of the frame (m), three numbers."""
    radius: float = 0.0
    """The radius (m), at least 0; a sphere with the radius 0 is a point."""
    frame: str | int | None = None
    """The frame, by name or by index in the model; None for the world."""


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


_NUMBERS = 12
"""Maximum length of a vector or list that is printed in full when a result is printed. For a longer vector or list,
only the shape is printed.
"""


def _shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        if value.ndim > 1 or value.size > _NUMBERS:
            return f"<array {value.shape}>"
        return np.array2string(value, separator=", ", max_line_width=1000)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{k!r}: {_shown(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list) and len(value) > _NUMBERS:
        return f"<list of {len(value)}>"
    return repr(value)


def _repr(self: Any) -> str:
    """Returns a short text with the members of a named tuple."""
    return f"{type(self).__name__}({', '.join(f'{k}={_shown(v)}' for k, v in self._asdict().items())})"


# public modules of these classes, for users and for pickle
_MODULES = {
    "Iteration": "optimal",
    "Timings": "optimal",
    "PlanPoint": "optimal",
    "RecordedTick": "optimal",
    "Difference": "optimal",
    "Solution": "optimal",
    "Evaluation": "optimal",
    "ManyRollouts": "optimal",
    "SweepResult": "optimal",
    "LqKnot": "optimal",
    "ConstraintRows": "optimal",
    "Outcome": "optimal",
    "Violation": "optimal",
    "Sphere": "optimal",
    "Control": "simulation",
    "Ground": "simulation",
    "GroundContacts": "simulation",
}
for _class in [_item for _item in globals().values() if isinstance(_item, type) and issubclass(_item, tuple)]:
    setattr(_class, "__repr__", _repr)  # noqa: B010 - type checkers do not allow a method to be replaced
    _class.__module__ = f"condyle.{_MODULES[_class.__name__]}" if _class.__name__ in _MODULES else "condyle"
ModelWarning.__module__ = "condyle"
