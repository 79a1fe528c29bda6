"""Rigid-body dynamics with exact derivatives: the compiled part of `condyle`."""

# Written by python/stubs.py from the extension module. Do not edit.

import os
from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from ._inertia import Inertia
from ._spelling import Force, Motion, ReferenceFrame
from ._types import (
    AbaDerivatives,
    AbaHessian,
    Actuator,
    AllTerms,
    AssemblySize,
    CentroidalDerivatives,
    CentroidalMap,
    CentroidalMapRate,
    Constrained,
    ConstrainedDerivatives,
    ConstrainedEquations,
    ContactConstraint,
    Control,
    CoriolisDerivatives,
    Coupling,
    EnergyDerivatives,
    Evaluation,
    Frame,
    GravityCompensation,
    Ground,
    GroundContacts,
    Impulse,
    ImpulseDerivatives,
    Iteration,
    Limits,
    LqNode,
    Mimic,
    ModelWarning,
    Outcome,
    PassiveDerivatives,
    RneaDerivatives,
    RneaHessian,
    RneaSecondDerivatives,
    Solution,
    Spring,
    SweepResult,
)
from ._wholebody import Command, Gains, Optimality, References, Settings

__all__ = [
    "ARM7",
    "HUMANOID",
    "LEVEL",
    "QUADRUPED",
    "WORLD",
    "Action",
    "Activation",
    "AugmentedLagrangian",
    "BodyId",
    "Cholesky",
    "ConstrainedAction",
    "ConstraintSet",
    "ContactDynamics",
    "ContactInverseDynamics",
    "ControllerError",
    "Cost",
    "Data",
    "DifferentialAction",
    "DivideConquer",
    "Error",
    "Fddp",
    "FreeDynamics",
    "FrictionCone",
    "FrictionContact",
    "HyperDual",
    "ImpulseDynamics",
    "InverseDynamics",
    "Joint",
    "Limit",
    "Lqr",
    "Ltdl",
    "Model",
    "ModelBuilder",
    "ModelError",
    "NotPhysicalError",
    "ParseError",
    "Plan",
    "Problem",
    "ProblemError",
    "Residual",
    "Simulation",
    "Sweep",
    "Task",
    "Unicycle",
    "WholeBodyController",
    "WrenchCone",
    "_SpelledData",
    "_SpelledModel",
    "__version__",
    "_borrowed",
    "_casadi_hold",
    "_casadi_hold_knot",
    "_casadi_release",
    "_check_pose",
    "_check_rotations",
    "_controller_from_numbers",
    "_generate",
    "_lend",
    "_model_from_bytes",
    "_spelled_crba",
    "_spelled_difference",
    "_spelled_integrate",
    "aba",
    "aba_derivatives",
    "aba_hessian",
    "aba_input_derivative",
    "arm7",
    "body_acceleration",
    "body_acceleration_derivatives",
    "body_classical_acceleration",
    "body_jacobian",
    "body_jacobian_rate",
    "body_point_jacobian",
    "body_point_velocity",
    "body_velocity",
    "body_velocity_derivative",
    "centerOfMass",
    "centroidal_derivatives",
    "centroidal_map",
    "centroidal_map_rate",
    "centroidal_momentum",
    "centroidal_momentum_rate",
    "check",
    "com",
    "com_acceleration",
    "com_jacobian",
    "com_velocity",
    "computeCentroidalMomentum",
    "computeCoriolisMatrix",
    "computeFrameJacobian",
    "computeGeneralizedGravity",
    "computeMinverse",
    "compute_all_terms",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "constrained_dynamics_equations",
    "coriolis_derivatives",
    "coriolis_matrix",
    "crba",
    "difference",
    "difference_jacobian",
    "distance",
    "energy_derivatives",
    "forwardKinematics",
    "forward_dynamics",
    "forward_kinematics",
    "frame_acceleration",
    "frame_acceleration_derivatives",
    "frame_classical_acceleration",
    "frame_classical_acceleration_derivatives",
    "frame_jacobian",
    "frame_jacobian_rate",
    "frame_placement",
    "frame_point_jacobian",
    "frame_point_velocity",
    "frame_velocity",
    "frame_velocity_derivative",
    "framesForwardKinematics",
    "from_inertia",
    "from_log_cholesky",
    "getAcceleration",
    "getClassicalAcceleration",
    "getFrameAcceleration",
    "getFrameClassicalAcceleration",
    "getFrameJacobian",
    "getFrameVelocity",
    "getJointJacobian",
    "getVelocity",
    "gravity",
    "humanoid",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
    "integrate",
    "integrate_jacobian",
    "interpolate",
    "jacobianCenterOfMass",
    "joint_torque_regressor",
    "kinetic_energy",
    "kinetic_energy_regressor",
    "log_cholesky",
    "log_cholesky_jacobian",
    "mechanical_energy",
    "minv",
    "neutral",
    "nonLinearEffects",
    "nonlinear_effects",
    "normalize",
    "passive_torque",
    "passive_torque_derivatives",
    "potential_energy",
    "potential_energy_regressor",
    "pseudo_inertia",
    "quadruped",
    "random_configuration",
    "rnea",
    "rnea_derivatives",
    "rnea_hessian",
    "rnea_input_derivative",
    "rnea_second_derivatives",
    "static_torque",
    "static_torque_derivative",
    "to_inertia",
    "transport",
    "updateFramePlacements",
]

_Array: TypeAlias = NDArray[np.float64]
_Number: TypeAlias = HyperDual | float
_Path: TypeAlias = str | os.PathLike[str]
_Size: TypeAlias = tuple[float, float] | Sequence[float]
_Controls: TypeAlias = ArrayLike | Sequence[ArrayLike]
_Joints: TypeAlias = Sequence[tuple[Joint, ArrayLike | None]]
_RootJoint: TypeAlias = Literal["free_flyer", "planar", "spherical", "translation"]
_Kind: TypeAlias = (
    Literal["massless", "negative", "triangle", "singular", "unlikely", "limit"]
    | Literal["unknown", "left_out", "assumed", "mimic"]
)
_Reference: TypeAlias = Literal["local", "world", "local_world_aligned"]
_Input: TypeAlias = (
    Literal["gravity", "armature", "damping"]
    | tuple[Literal["force", "inertia"], str | int]
    | tuple[Literal["friction"], float]
)
_Method: TypeAlias = Literal["aba", "dense", "sparse"]
_Integrator: TypeAlias = Literal["semi_implicit_euler", "runge_kutta_4", "variational"]
_Status: TypeAlias = Literal["done", "not_converged", "contacts_not_converged", "not_finite"]
_OfTwo: TypeAlias = Callable[[NDArray[Any], NDArray[Any]], Any]
_Shapes: TypeAlias = list[tuple[str, int, int]]
_Space: TypeAlias = Model | tuple[int, _OfTwo, _OfTwo]
_Scheme: TypeAlias = Literal["semi_implicit_euler", "runge_kutta_2", "runge_kutta_3", "runge_kutta_4"]
_Polynomial: TypeAlias = Literal["constant", "linear", "quadratic"]
_Axes: TypeAlias = Literal["world", "local"] | tuple[Literal["frame"], str]
_Action: TypeAlias = (
    FreeDynamics
    | ContactDynamics
    | ImpulseDynamics
    | InverseDynamics
    | ContactInverseDynamics
    | Lqr
    | Unicycle
    | Action
    | DifferentialAction
    | ConstrainedAction
)

__version__: str
LEVEL: str
WORLD: BodyId
ARM7: str
QUADRUPED: str
HUMANOID: str

class ControllerError(Error):
    """An error in the description of a whole-body controller or of a plan, or a step that was not solved."""

class Error(Exception):
    """An error of this package: the base of all others."""

class ModelError(Error):
    """An error in a model that is to be built, or a frame or joint that a model does not have."""

class NotPhysicalError(Error):
    """An inertia that no body of positive density has."""

class ParseError(Error):
    """An error of a file that cannot be read, is no XML, or describes no robot."""

class ProblemError(Error):
    """An error in an optimal control problem, a warm start or a setting."""

def aba(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: _Array | None = None,
) -> _Array:
    """Forward dynamics: the acceleration q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i), nv numbers (rad/s², m/s²); O(n).

    q: nq numbers; v, tau: nv; f_ext: as for `rnea`.

    Raises `ModelError` if M is singular wherever the robot is. At a position at which it happens to be, a point of mass on
    the axis about which it turns, the numbers are not finite, or as large as rounding has it.

    >>> quadruped = condyle.robots.quadruped()
    >>> q, zero = condyle.neutral(quadruped), [0.0] * 18
    >>> a = condyle.aba(quadruped, condyle.Data(quadruped), q, zero, zero)
    >>> bool(abs(a[2] + 9.81) < 1e-12)  # it falls
    True
    """

def aba_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> AbaDerivatives:
    """The acceleration of `aba` and its derivatives with respect to q, v and τ, exact, as
    `AbaDerivatives(a, da_dq, da_dv, da_dtau)`: nv numbers and three matrices (nv, nv).

    q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving with the bodies. ∂/∂q is taken in the tangent space: the
    change of q̈ when q moves to `integrate(q, δ)`, per δ. out: four arrays, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> data = condyle.Data(arm)
    >>> d = condyle.aba_derivatives(arm, data, [0.3] * 7, [0.1] * 7, [1.0] * 7)
    >>> np.array_equal(d.da_dtau, condyle.minv(arm, data, [0.3] * 7))
    True
    """

def coriolis_matrix(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The Coriolis matrix C(q, v) by Christoffel symbols: (nv, nv), with C v = h − g and Ṁ = C + Cᵀ; O(n depth).

    q: nq numbers; v: nv.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
    >>> h, g = condyle.nonlinear_effects(arm, data, q, v), condyle.gravity(arm, data, q)
    >>> np.allclose(condyle.coriolis_matrix(arm, data, q, v) @ v, h - g)
    True
    """

def crba(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The joint-space inertia matrix M(q): (nv, nv), symmetric, both triangles filled, armature included; O(n depth).

    q: nq numbers. τ = M a + h; the kinetic energy is ½ vᵀ M v.

    >>> arm = condyle.robots.arm7()
    >>> M = condyle.crba(arm, condyle.Data(arm), [0.3] * 7)
    >>> bool(np.linalg.eigvalsh(M).min() > 0.0)
    True
    """

def forward_dynamics(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    method: _Method | None = None,
    out: _Array | None = None,
) -> _Array:
    """Forward dynamics by a method of choice: the acceleration of `aba`, nv numbers (rad/s², m/s²).

    q: nq numbers; v, tau: nv; f_ext: as for `rnea`. method: 'aba', the articulated-body algorithm, O(n); 'dense', by a
    dense factor of M, O(n³); 'sparse', by one with the zeros of the tree, O(n d²) for depth d; None, the fastest:
    'aba', or 'sparse' for a robot with mimic joints. All give the same numbers, up to rounding.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, tau = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [1.0] * 7
    >>> a = condyle.forward_dynamics(arm, data, q, v, tau, method="sparse")
    >>> np.allclose(a, condyle.aba(arm, data, q, v, tau))
    True
    """

def gravity(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The gravity efforts g(q), nv numbers, which hold the robot still: the efforts of `rnea` with v = a = 0.

    q: nq numbers.

    >>> quadruped = condyle.robots.quadruped()
    >>> g = condyle.gravity(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(g[2] - 9.81 * quadruped.total_mass) < 1e-9)  # the base carries the weight
    True
    """

def minv(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The inverse M(q)⁻¹ of the inertia matrix: (nv, nv), symmetric, both triangles filled; computed without M.

    q: nq numbers.

    >>> arm = condyle.robots.arm7()
    >>> data, q = condyle.Data(arm), [0.3] * 7
    >>> np.allclose(condyle.minv(arm, data, q) @ condyle.crba(arm, data, q), np.eye(7))
    True
    """

def nonlinear_effects(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The nonlinear effects h(q, v) = C(q, v) v + g(q), nv numbers: the efforts of `rnea` with a = 0.

    q: nq numbers; v: nv.
    """

def rnea(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: _Array | None = None,
) -> _Array:
    """Inverse dynamics: the joint efforts τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i that produce the acceleration a, nv numbers
    (N m, N); O(n).

    q: nq numbers; v, a: nv; f_ext: (nbodies, 6), a force on each body (N, then N m), acting at the body's origin and
    expressed in its frame, row 0 being the world's.

    >>> arm = condyle.robots.arm7()
    >>> tau = condyle.rnea(arm, condyle.Data(arm), [0.3] * 7, [0.0] * 7, [0.0] * 7)
    >>> bool(abs(tau[0]) < 1e-9)  # gravity does not turn a vertical axis
    True
    """

def rnea_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: tuple[_Array, _Array, _Array] | list[_Array] | None = None,
) -> RneaDerivatives:
    """The derivatives of `rnea` with respect to q, v and a, exact, in O(n depth), as
    `RneaDerivatives(dtau_dq, dtau_dv, dtau_da)`, each (nv, nv).

    q: nq numbers; v, a: nv; f_ext: as for `rnea`, moving with the bodies. ∂/∂q is taken in the tangent space: the
    change of τ when q moves to `integrate(q, δ)`, per δ. out: three arrays, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> dtau_dq, dtau_dv, dtau_da = condyle.rnea_derivatives(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7)
    >>> dtau_dq.shape
    (7, 7)
    """

def static_torque(
    model: Model, data: Data, q: ArrayLike, f_ext: ArrayLike | None = None, out: _Array | None = None
) -> _Array:
    """The efforts τ = g(q) − Σ Jᵢᵀ f_ext,i that hold the robot still under external forces, nv numbers (N m, N); O(n).

    q: nq numbers; f_ext: as for `rnea`. It is `rnea` with v = a = 0.
    """

@final
class BodyId:
    """The identity of a body in a builder, as `ModelBuilder.body` and others return it. `WORLD` is always there."""

@final
class ModelBuilder:
    """A builder that makes a `Model` body by body, parents first.

    Placements are homogeneous (4, 4) matrices, None being the identity; inertias are `Inertia`, None being no mass. A
    joint of several, such as Pinocchio's composite, universal and spherical ZYX joints, is a `chain` of bodies here: q
    and v are laid out alike, but there is a body without mass for each joint but the last, so `nbodies`, `names` and
    the rows of f_ext count them.

    name: the robot's.

    >>> from condyle import Inertia, Joint, ModelBuilder, WORLD
    >>> rod = Inertia.from_com(1.0, [0.0, 0.0, -0.5], 0.08 * np.eye(3))
    >>> elbow = np.eye(4)
    >>> elbow[2, 3] = -1.0
    >>> robot = ModelBuilder("double pendulum")
    >>> upper = robot.body("upper", WORLD, Joint.revolute([0.0, 1.0, 0.0]), inertia=rod)
    >>> lower = robot.body("lower", upper, Joint.revolute([0.0, 1.0, 0.0]), elbow, rod, damping=0.1)
    >>> robot.frame("tip", lower, elbow)
    >>> robot.build()
    <condyle.Model 'double pendulum': 2 bodies, nq = 2, nv = 2>
    """

    def __new__(cls, name: str) -> ModelBuilder: ...
    def actuator(
        self,
        name: str,
        joint: BodyId | Sequence[tuple[BodyId, float]],
        *,
        tendon: str | None = None,
        gear: ArrayLike | None = None,
        gain: float | None = None,
        bias: float = 0.0,
        kp: float = 0.0,
        kv: float = 0.0,
        control: tuple[float, float] | None = None,
        force: tuple[float, float] | None = None,
    ) -> None:
        """Adds an actuator that drives a joint, or a tendon over several joints; see `Actuator`. It does not change limits,
        armature and damping: these are the joints'.

        joint: the body that the joint carries; or, for a tendon, a list of (body, coefficient).
        tendon: the name of the tendon, if it drives one.
        gear: a number, or up to six; None is 1. gain: the force for each unit of control; None is kp, or kv where kp is 0, or
        1 for a motor without both. control, force: least and greatest; None for no limits.
        """

    def append(self, parent: BodyId, placement: ArrayLike | None, model: Model, prefix: str = "") -> None:
        """Adds a whole robot, its world at `placement` in the frame of `parent`; `prefix` is put before all its names.

        >>> from condyle import ModelBuilder, WORLD
        >>> two = ModelBuilder("two arms")
        >>> for side, y in ("left_", 0.4), ("right_", -0.4):
        ...     at = np.eye(4)
        ...     at[1, 3] = y
        ...     two.append(WORLD, at, condyle.robots.arm7(), side)
        >>> two.build().nv
        14
        """

    def body(
        self,
        name: str,
        parent: BodyId,
        joint: Joint,
        placement: ArrayLike | None = None,
        inertia: Inertia | None = None,
        *,
        joint_name: str | None = None,
        position: tuple[float, float] | None = None,
        velocity: float | None = None,
        effort: float | tuple[float, float] | None = None,
        damping: float = 0.0,
        friction: float = 0.0,
        armature: float = 0.0,
        damping_polynomial: tuple[float, float] = ...,
    ) -> BodyId:
        """Adds a body and its joint.

        name: the body's, and the joint's unless it has a `joint_name` of its own.
        parent: the body on which the joint sits.
        placement: the joint's frame at position zero in the parent's frame.
        inertia: in the body's frame, which is the joint's at position zero.
        position: (least, greatest) position (rad, m), for joints with one coordinate; None for no limits.
        velocity: greatest speed (rad/s, m/s); None for no limit.
        effort: greatest effort (N m, N), or the least and the greatest one; None for no limits.
        damping, friction: viscous (N m s/rad, N s/m) and Coulomb (N m, N).
        damping_polynomial: (d₁, d₂) of damping that grows with the speed, d₀ + d₁|v| + d₂v², with d₀ = damping.
        armature: inertia of the rotor as seen at the joint (kg m², kg).
        """

    def build(self) -> Model:
        """Builds the model: checks everything and numbers the bodies depth first, siblings in the order in which they were
        added. The builder cannot be used any more.

        Raises `ModelError`: names, axes, masses, limits, numbers that are not finite, what a mimic joint follows.
        """

    def chain(self, name: str, parent: BodyId, joints: _Joints, inertia: Inertia | None = None) -> BodyId:
        """Adds a body behind several joints, each at a placement in the frame of the one before: a composite joint.

        Its coordinates are those of the joints, one after the other. Between them are bodies without mass, `name#1`,
        `name#2`, …. Returns the last body, which carries `inertia`. A universal joint about unit vectors a and b is
        `[(Joint.revolute(a), placement), (Joint.revolute(b), None)]`.

        joints: a list of (joint, placement).
        """

    def compensate_gravity(
        self, body: BodyId, inertia: Inertia, factor: float = 1.0, placement: ArrayLike | None = None
    ) -> None:
        """Carries a part of a body's weight, as MuJoCo's `gravcomp` does: the force −factor m g acts at the part's centre of
        mass.

        inertia: the part's, in a frame that is at `placement` in the body's frame. factor: the share that is carried.
        """

    def frame(
        self,
        name: str,
        body: BodyId,
        placement: ArrayLike | None = None,
        kind: Literal["link", "joint", "user"] = "user",
    ) -> None:
        """Adds a frame at `placement` in the body's frame; kind: 'link', 'joint' or 'user', of which each may have the same name."""

    def gravity(self, gravity: ArrayLike) -> None:
        """Sets the acceleration of free fall, 3 numbers in the world's frame (m/s²). Without this it is (0, 0, −9.81)."""

    def merge(self, body: BodyId, placement: ArrayLike | None, inertia: Inertia) -> None:
        """Adds inertia to a body, given in a frame that is at `placement` in the body's frame."""

    def mimic(self, follower: BodyId, leader: BodyId, ratio: float = 1.0, offset: float = 0.0) -> None:
        """Makes a joint follow another one, instead of having a coordinate of its own: its position is ratio q + offset.

        follower, leader: the bodies that the joints carry.
        """

    def spherical_zyx(
        self, name: str, parent: BodyId, placement: ArrayLike | None = None, inertia: Inertia | None = None
    ) -> BodyId:
        """Adds a body on a ball joint that turns by q₀ about z, then q₁ about the new y, then q₂ about the new x; v = q̇.

        M is singular where q₁ = ±π/2. `Joint.spherical` has no such place.
        """

    def spring(self, body: BodyId, stiffness: ArrayLike, rest: ArrayLike) -> None:
        """Adds a spring to a joint: τ = −(k₀ + k₁ |Δ| + k₂ |Δ|²) Δ with the displacement Δ = q ⊖ rest.

        body: the body that the joint carries. stiffness: k₀, or k₀, k₁ and k₂. rest: the position of the joint at which the
        spring is at rest, as many numbers as q has for the joint.

        >>> from condyle import Inertia, Joint, ModelBuilder, WORLD
        >>> robot = ModelBuilder("door")
        >>> door = robot.body("door", WORLD, Joint.revolute([0.0, 0.0, 1.0]), inertia=Inertia.from_sphere(5.0, 0.5))
        >>> robot.spring(door, 2.0, rest=[0.1])
        >>> robot.build().springs
        [Spring(joint='door', stiffness=[2., 0., 0.], rest=[0.1])]
        """

def _casadi_hold(
    model: Model,
    function: str,
    *,
    states: int,
    frame: str | int | None = None,
    reference: _Reference | None = None,
    constraints: Sequence[ContactConstraint] | None = None,
) -> str:
    """A slot of CasADi's interface that computes a function of a robot, held for the caller until `_casadi_release`.

    function: 'rnea', 'aba', 'crba', 'forward_kinematics', 'frame_velocity', 'com', 'centroidal_momentum' or
    'constrained_dynamics'.
    states: how many at a time; arguments and results have the columns of each, one after the other.

    Returns the name of its symbols.
    """

def _casadi_hold_knot(of: Any, t: int | None) -> str:
    """A slot that computes the next state and the cost of knot t of an action or of a problem, likewise; without t, of the knot
    whose number is an argument.
    """

def _casadi_release(name: str) -> None:
    """The end of a hold: the slot lives on as long as CasADi has functions of it."""

def centroidal_map(
    model: Model, data: Data, q: ArrayLike, out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None
) -> CentroidalMap:
    """The centroidal momentum matrix Ag(q), hg = Ag v, and the quantities it is made of, in O(n), as
    `CentroidalMap(Ag, Ig, com, Jcom)`.

    q: nq numbers. Bodies fixed to the world do not count. The results are not numbers if no moving body has a mass. out:
    four arrays, such as an earlier result.

    >>> quadruped = condyle.robots.quadruped()
    >>> map = condyle.centroidal_map(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(map.Ag[0, 0] - quadruped.total_mass) < 1e-9)  # pushed forwards, all goes forwards
    True
    """

def centroidal_map_rate(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    out: tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> CentroidalMapRate:
    """The centroidal momentum matrix Ag(q), its rate along v, and the momentum hg = Ag v, in O(n), as
    `CentroidalMapRate(Ag, dAg, hg, Ig, com, com_velocity, Jcom)`. The rate of hg is Ag a + dAg v.

    q: nq numbers; v: nv. Bodies fixed to the world do not count. The results are not numbers if no moving body has a
    mass. out: seven arrays, such as an earlier result.
    """

def centroidal_momentum(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The centroidal momentum hg of the moving bodies, about their centre of mass and along the world's axes: 6 numbers
    (kg m/s, then kg m²/s); O(n).

    q: nq numbers; v: nv.
    """

def centroidal_momentum_rate(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """The rate of the centroidal momentum hg, along the world's axes: 6 numbers (N, then N m). It equals the weight and
    the external forces about the centre of mass; O(n).

    q: nq numbers; v, a: nv.
    """

def com(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The centre of mass c of the moving bodies in the world's frame, 3 numbers (m); O(n).

    q: nq numbers. Bodies fixed to the world do not count. The result is not a number if no moving body has a mass.

    >>> quadruped = condyle.robots.quadruped()
    >>> com = condyle.com(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(com[1]) < 1e-12)  # left and right weigh the same
    True
    """

def com_acceleration(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """The acceleration c̈ of the centre of mass of the moving bodies in the world's frame, without gravity, 3 numbers
    (m/s²); O(n).

    q: nq numbers; v, a: nv.
    """

def com_jacobian(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The Jacobian Jcom(q) of the centre of mass, (3, nv), with ċ = Jcom v; O(n).

    q: nq numbers. It is a part of `centroidal_map`.
    """

def com_velocity(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The velocity ċ of the centre of mass of the moving bodies in the world's frame, 3 numbers (m/s); O(n).

    q: nq numbers; v: nv.
    """

def compute_all_terms(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> AllTerms:
    """All terms of the equations of motion, from one pass to the tips and one back, in O(n depth), as
    `AllTerms(M, h, centroidal, kinetic_energy, potential_energy)`.

    q: nq numbers; v: nv. The numbers are those of `crba`, `nonlinear_effects`, `centroidal_map_rate`,
    `kinetic_energy` and `potential_energy`, up to rounding.

    >>> arm = condyle.robots.arm7()
    >>> terms = condyle.compute_all_terms(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7)
    >>> terms.M.shape, terms.h.shape, terms.centroidal.Ag.shape
    ((7, 7), (7,), (6, 7))
    """

def kinetic_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """The kinetic energy T = ½ vᵀ M(q) v of the moving bodies and the rotors (J); O(n).

    q: nq numbers; v: nv.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, np.full(7, 0.5)
    >>> np.isclose(condyle.kinetic_energy(arm, data, q, v), 0.5 * v @ condyle.crba(arm, data, q) @ v).item()
    True
    """

def mechanical_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """The mechanical energy E = T + V (J); O(n).

    q: nq numbers; v: nv. Its rate is the power of the efforts and the external forces.
    """

def potential_energy(model: Model, data: Data, q: ArrayLike) -> float:
    """The potential energy V = −m gᵀ c(q) of the moving bodies under gravity (J), 0 at the world's origin; O(n).

    q: nq numbers.
    """

def _generate(
    model: Model,
    names: list[str],
    language: str,
    *,
    frames: list[str] = ...,
    constraints: list[ContactConstraint] = ...,
    external_forces: bool = False,
    inputs: list[str] = ...,
    shares: int | None = None,
) -> tuple[str, list[tuple[str, str]], list[tuple[str, _Shapes, _Shapes, int, int]]]:
    """The code of functions of a robot: its name, its files, and its functions with their arguments and results."""

def difference(model: Model, q0: ArrayLike, q1: ArrayLike, out: _Array | None = None) -> _Array:
    """The tangent vector v = q₁ ⊖ q₀ with q₀ ⊕ v = q₁, nv numbers; of rotations the shortest one.

    q0, q1: nq numbers.
    """

def difference_jacobian(
    model: Model, d: ArrayLike, argument: Literal["from", "to"], out: _Array | None = None
) -> _Array:
    """The Jacobian ∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁ between tangent spaces: (nv, nv), block-diagonal. Of the positions it
    needs only their difference.

    d: q₁ ⊖ q₀, nv numbers; argument: 'from' for q₀ or 'to' for q₁.
    """

def distance(model: Model, q0: ArrayLike, q1: ArrayLike) -> float:
    """The distance ‖q₁ ⊖ q₀‖, in which lengths (m) and angles (rad) count alike.

    q0, q1: nq numbers.
    """

def integrate(model: Model, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The position q ⊕ v that is reached from q with the velocity v after one unit of time, nq numbers.

    q: nq numbers; v: nv.

    >>> quadruped = condyle.robots.quadruped()
    >>> q0 = condyle.neutral(quadruped)
    >>> q1 = condyle.integrate(quadruped, q0, np.full(18, 0.1))
    >>> np.allclose(condyle.difference(quadruped, q0, q1), 0.1)
    True
    """

def integrate_jacobian(
    model: Model, v: ArrayLike, argument: Literal["position", "velocity"], out: _Array | None = None
) -> _Array:
    """The Jacobian ∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v between tangent spaces: (nv, nv), block-diagonal. It does not depend on q.

    v: nv numbers; argument: 'position' for q or 'velocity' for v.
    """

def interpolate(model: Model, q0: ArrayLike, q1: ArrayLike, t: float, out: _Array | None = None) -> _Array:
    """The position q₀ ⊕ t (q₁ ⊖ q₀) on the way from q₀ (t = 0) to q₁ (t = 1) at a constant velocity, nq numbers.

    q0, q1: nq numbers; t: a number, beyond 0 and 1 too.

    >>> condyle.interpolate(condyle.robots.arm7(), [0.0] * 7, [1.0] * 7, 0.25)
    array([0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25])
    """

def neutral(model: Model) -> _Array:
    """The neutral position, nq numbers: zeros, and the identity for rotations.

    >>> condyle.neutral(condyle.robots.quadruped())[:7]
    array([0., 0., 0., 0., 0., 0., 1.])
    """

def normalize(model: Model, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The position q with its quaternions and its pairs (cos, sin) scaled to length 1, nq numbers. The argument itself
    stays as it is unless it is `out`.

    q: nq numbers.

    Raises `ModelError` for a quaternion or a pair whose length is 0 or not finite.

    >>> quadruped = condyle.robots.quadruped()
    >>> q = condyle.neutral(quadruped)
    >>> q[6] = 2.0
    >>> np.array_equal(condyle.normalize(quadruped, q), condyle.neutral(quadruped))
    True
    """

def random_configuration(model: Model, seed: int | None = None) -> _Array:
    """A random position, nq numbers: uniform between its limits, within ±3 (rad, m) where a coordinate has no limits, and
    over the whole group for rotations.

    seed: a number below 2⁶⁴; the same one gives the same position. None draws afresh.
    """

def transport(model: Model, v: ArrayLike, X: ArrayLike, out: _Array | None = None) -> _Array:
    """The columns of X, tangent vectors at q ⊕ v, moved to the tangent space at q: (∂(q ⊕ v)/∂q)⁻¹ X.

    v: nv numbers; X: a matrix of nv rows. Pinocchio's `dIntegrateTransport` multiplies with ∂(q ⊕ v)/∂q itself: it is
    `transport` with −v.

    >>> quadruped = condyle.robots.quadruped()
    >>> v = np.full(18, 0.1)
    >>> J = condyle.integrate_jacobian(quadruped, v, "position")
    >>> np.allclose(condyle.transport(quadruped, v, J), np.eye(18))
    True
    """

@final
class ConstraintSet:
    """Constraints of one model: contacts and loops, and the scratch of `constrained_dynamics` and its like.

    Make one set for each combination of contacts; the `Data` can be the same for all sets. As a `Data`, a set serves
    one thread at a time.

    With μ > 0 the forces solve (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ', first with λ' = 0, then again with the λ just found, so
    that redundant constraints share the smallest forces; μ is small beside J M⁻¹ Jᵀ, as 1e-8. With μ = 0 one iteration
    is exact, and rows that depend on earlier ones get no force. Source: Carpentier, Budhiraja, Mansard, Proximal and
    sparse resolution of constrained dynamic equations (2021).

    model: the robot; constraints: a list of `ContactConstraint`s; mu: μ (1/kg); iterations: how many there are, always, 1 to
    10000.

    Raises `ModelError` if a frame does not exist, two frames do not move relative to each other, a reference frame is
    'world', a gain is negative or not finite, a target is not finite or no placement, or two constraints are the same.

    >>> quadruped = condyle.robots.quadruped()
    >>> feet = [condyle.ContactConstraint(foot, "point") for foot in ("LF_foot", "RH_foot")]
    >>> trot = condyle.ConstraintSet(quadruped, feet)
    >>> len(trot), trot.rows, trot.range(1)
    (2, 6, slice(3, 6, 1))
    """

    def __new__(
        cls, model: Model, constraints: Sequence[ContactConstraint], mu: float = 0.0, iterations: int = 1
    ) -> ConstraintSet: ...
    @property
    def rows(self) -> int:
        """The number of rows of J, and of numbers in λ."""

    def __len__(self, /) -> int: ...
    @staticmethod
    def _from_json(model: Model, text: str, mu: float, iterations: int) -> ConstraintSet: ...
    def jacobian(self, out: _Array | None = None) -> _Array:
        """The Jacobian J of the constraints, (rows, nv), at the state of the last call for a single one."""

    def range(self, k: int) -> slice:
        """The rows of constraint k, as a slice."""

    def set_target(
        self,
        k: int,
        placement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Changes the target of constraint k: where its frame should be and how it should move there. What is not given
        stays as it is.

        Raises `ModelError` for numbers that are not finite and a placement that is none; the old target then stays.
        """

def constrained_dynamics(
    model: Model,
    data: Data,
    constraints: ConstraintSet,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: Constrained | Sequence[_Array] | None = None,
) -> Constrained:
    """Forward dynamics under constraints: the acceleration q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i) with the forces λ that
    make J q̈ + γ = 0, as `Constrained(a, lambda_, residual, redundant)`.

    constraints: a `ConstraintSet`; q: nq numbers; v, tau: nv; f_ext: as for `rnea`. Constraints that contradict each
    other, or themselves at a singular posture, give finite numbers and a residual.

    >>> quadruped = condyle.robots.quadruped()
    >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), np.zeros(18)
    >>> feet = [condyle.ContactConstraint(foot, "point", kd=10.0) for foot in ("LF_foot", "RH_foot")]
    >>> stance = condyle.ConstraintSet(quadruped, feet)
    >>> a, forces, residual, redundant = condyle.constrained_dynamics(quadruped, data, stance, q, zero, zero)
    >>> bool(residual < 1e-9), redundant, np.allclose(stance.jacobian() @ a, 0.0)
    (True, 0.0, True)
    """

def constrained_dynamics_derivatives(
    model: Model,
    data: Data,
    constraints: ConstraintSet,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: ConstrainedDerivatives | Sequence[_Array] | None = None,
) -> ConstrainedDerivatives:
    """The result of `constrained_dynamics` and its derivatives with respect to q, v and τ, exact, as
    `ConstrainedDerivatives`.

    constraints: a `ConstraintSet`, whose targets are fixed; q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving
    with the bodies. ∂/∂q is taken in the tangent space. out: as many arrays as there are members, such as an earlier
    result.

    >>> arm = condyle.robots.arm7()
    >>> touch = condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
    >>> d = condyle.constrained_dynamics_derivatives(arm, condyle.Data(arm), touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
    >>> np.allclose(touch.jacobian() @ d.da_dtau, 0.0)  # no effort moves the point
    True
    """

def constrained_dynamics_equations(
    model: Model,
    data: Data,
    constraints: ConstraintSet,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: ConstrainedEquations | Sequence[_Array] | None = None,
) -> ConstrainedEquations:
    """The result of `constrained_dynamics` and the linear equations between changes of q, v, τ and the changes of q̈ and λ
    that follow, as `ConstrainedEquations`:

        M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,    J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0

    These are the equations that `constrained_dynamics_derivatives` solves; nothing is inverted here. constraints: a
    `ConstraintSet`, whose targets are fixed and whose `jacobian` is J; q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving with the
    bodies. ∂/∂q is taken in the tangent space. out: as many arrays as there are members, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> data, touch = condyle.Data(arm), condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
    >>> d = condyle.constrained_dynamics_equations(arm, data, touch, [0.3] * 7, [0.1] * 7, [1.0] * 7)
    >>> np.allclose(d.M, condyle.crba(arm, data, [0.3] * 7))
    True
    """

def impulse_dynamics(
    model: Model,
    data: Data,
    constraints: ConstraintSet,
    q: ArrayLike,
    v: ArrayLike,
    restitution: float = 0.0,
    out: Impulse | Sequence[_Array] | None = None,
) -> Impulse:
    """The velocity v⁺ = v + M⁻¹ Jᵀ Λ after an impact, with the impulses Λ that make J v⁺ = −ε J v, as
    `Impulse(v, lambda_, residual, redundant)`.

    constraints: a `ConstraintSet`, of which gains, velocities and accelerations do not count; q: nq numbers; v: nv;
    restitution: ε, 0 for frames that stick, 1 for an impact that loses no energy.

    >>> quadruped = condyle.robots.quadruped()
    >>> touchdown = condyle.ConstraintSet(quadruped, [condyle.ContactConstraint("LF_foot", "point")])
    >>> q, falling = condyle.neutral(quadruped), np.eye(18)[2] * -1.0
    >>> after = condyle.impulse_dynamics(quadruped, condyle.Data(quadruped), touchdown, q, falling)
    >>> bool(after.lambda_[2] > 0.0)  # the ground pushes upwards
    True
    """

def impulse_dynamics_derivatives(
    model: Model,
    data: Data,
    constraints: ConstraintSet,
    q: ArrayLike,
    v: ArrayLike,
    restitution: float = 0.0,
    out: ImpulseDerivatives | Sequence[_Array] | None = None,
) -> ImpulseDerivatives:
    """The result of `impulse_dynamics` and its derivatives with respect to q and the velocity before the impact, exact, as
    `ImpulseDerivatives`.

    constraints, q, v, restitution: as for `impulse_dynamics`. ∂/∂q is taken in the tangent space. out: as many arrays
    as there are members, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> hit = condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
    >>> d = condyle.impulse_dynamics_derivatives(arm, condyle.Data(arm), hit, [0.3] * 7, [0.1] * 7)
    >>> np.allclose(d.dv_dv @ d.dv_dv, d.dv_dv)  # an impact that sticks is a projection
    True
    """

@final
class Data:
    """The memory that algorithms compute in, for one model: made once, and used by one thread at a time.

    It serves all models of the same bodies and joints, whatever their gravity, armature or inertias. No algorithm reads
    what another left behind, so calls may come in any order. To use one from two threads at once is a `RuntimeError`;
    with another robot's model, a `ValueError`.

    model: the robot; threads: the number of threads for calls with many states, q of shape (N, nq), which also compute
    several states side by side in vector registers, and release the interpreter's lock; at most 1024.

    >>> arm = condyle.robots.arm7()
    >>> condyle.Data(arm)
    <condyle.Data of 'arm7'>
    """

    def __new__(cls, model: Model, threads: int = 1) -> Data: ...

def aba_hessian(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    lambda_: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> AbaHessian:
    """The Hessian of λᵀ q̈(q, v, τ), q̈ of `aba`, exact, as `AbaHessian(dqdq, dvdq, dvdv, dtaudq)`, each (nv, nv); the
    other blocks are zero.

    q: nq numbers; v, tau, lambda_: nv; f_ext: as for `rnea`, moving with the bodies. Entry [j, k] of dvdq is the
    derivative by v_j and q_k, of dtaudq by τ_j and q_k. It is the Hessian with respect to δ at `integrate(q, δ)`.
    """

def aba_input_derivative(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    wrt: _Input,
    f_ext: ArrayLike | None = None,
    out: _Array | None = None,
) -> _Array:
    """The derivative ∂q̈/∂(input) of `aba`, (nv, k), for an input of k numbers that is neither q nor v nor τ; exact, at
    most O(n²) a column.

    q: nq numbers; v, tau: nv; wrt: as for `rnea_input_derivative`; f_ext: as for `rnea`.

    >>> quadruped = condyle.robots.quadruped()
    >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), [0.0] * 18
    >>> da_df = condyle.aba_input_derivative(quadruped, data, q, zero, zero, ("force", "root_joint"))
    >>> np.allclose(da_df, condyle.minv(quadruped, data, q)[:, :6])  # a force on the trunk is an effort of its joint
    True
    """

def body_acceleration_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: tuple[_Array, _Array] | list[_Array] | None = None,
) -> tuple[_Array, _Array]:
    """The derivatives ∂a/∂q and ∂a/∂v of a body's spatial acceleration, `(da_dq, da_dv)`, each (6, nv):
    `frame_acceleration_derivatives` of its own frame.

    q: nq numbers; v, a: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def body_velocity_derivative(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The derivative ∂v/∂q of a body's velocity, (6, nv): `frame_velocity_derivative` of its own frame.

    q: nq numbers; v: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def centroidal_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    out: tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> CentroidalDerivatives:
    """The derivatives of the centroidal momentum, its rate and the centre of mass with respect to q, v and a, exact, in
    O(n), as `CentroidalDerivatives`.

    q: nq numbers; v, a: nv. Gravity is not among the accelerations.

    >>> quadruped = condyle.robots.quadruped()
    >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), [0.0] * 18
    >>> d = condyle.centroidal_derivatives(quadruped, data, q, zero, zero)
    >>> np.allclose(d.drate_da, condyle.centroidal_map(quadruped, data, q).Ag)
    True
    """

def coriolis_derivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: tuple[_Array, _Array] | list[_Array] | None = None
) -> CoriolisDerivatives:
    """The derivatives of C(q, v) v, the Coriolis and centrifugal efforts, exact, in O(n depth), as
    `CoriolisDerivatives(dq, dv)`, each (nv, nv).

    q: nq numbers; v: nv.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
    >>> d = condyle.coriolis_derivatives(arm, data, q, v)
    >>> np.allclose(d.dv, 2.0 * condyle.coriolis_matrix(arm, data, q, v))  # C v is quadratic in v
    True
    """

def energy_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    out: tuple[_Array, _Array, _Array] | list[_Array] | None = None,
) -> EnergyDerivatives:
    """The derivatives of kinetic energy T and potential energy V, exact, in O(n), as
    `EnergyDerivatives(dT_dq, dT_dv, dV_dq)`, nv numbers each.

    q: nq numbers; v: nv.
    """

def frame_acceleration_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: tuple[_Array, _Array] | list[_Array] | None = None,
) -> tuple[_Array, _Array]:
    """The derivatives ∂a/∂q and ∂a/∂v of a frame's spatial acceleration, `(da_dq, da_dv)`, each (6, nv). Its derivative by
    the joint accelerations is the frame's Jacobian.

    q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.
    """

def frame_classical_acceleration_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: tuple[_Array, _Array] | list[_Array] | None = None,
) -> tuple[_Array, _Array]:
    """The derivatives ∂a/∂q and ∂a/∂v of a frame's classical acceleration, `(da_dq, da_dv)`, each (6, nv). Its derivative
    by the joint accelerations is the frame's Jacobian.

    q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.
    """

def frame_velocity_derivative(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The derivative ∂v/∂q of a frame's velocity, (6, nv), linear rows first. Its derivative by v is the frame's Jacobian.

    q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> dv_dq = condyle.frame_velocity_derivative(arm, condyle.Data(arm), [0.3] * 7, [0.5] * 7, "tool")
    >>> bool((dv_dq[:, 0] == 0.0).all())  # turned as a whole, the arm moves as before
    True
    """

def rnea_hessian(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    lambda_: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> RneaHessian:
    """The Hessian of λᵀ τ(q, v, a), τ of `rnea`, exact, in O(n depth), as `RneaHessian(dqdq, dvdq, dvdv, dadq)`, each
    (nv, nv); the other blocks are zero.

    q: nq numbers; v, a, lambda_: nv; f_ext: as for `rnea`, moving with the bodies. Entry [j, k] of dvdq is the
    derivative by v_j and q_k, of dadq by a_j and q_k. It is the Hessian with respect to δ at `integrate(q, δ)`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
    >>> hessian = condyle.rnea_hessian(arm, data, q, v, a, np.ones(7))
    >>> np.allclose(hessian.dqdq, hessian.dqdq.T)
    True
    """

def rnea_input_derivative(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    wrt: _Input,
    f_ext: ArrayLike | None = None,
    out: _Array | None = None,
) -> _Array:
    """The derivative ∂τ/∂(input) of `rnea`, (nv, k), for an input of k numbers that is neither q nor v nor a; exact, at
    most O(n) a column.

    q: nq numbers; v, a: nv; wrt: 'gravity', the acceleration of free fall, 3 numbers; 'armature', 'damping', nv each
    (the latter as where `passive_torque` is added to τ); ('force', body), the external force on a body, 6, in its
    frame; ('inertia', body), its 10 inertial parameters; or ('friction', smoothing), nv, for the smoothing of
    `passive_torque`; f_ext: as for `rnea`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, zero = condyle.Data(arm), [0.3] * 7, [0.0] * 7
    >>> dtau_dg = condyle.rnea_input_derivative(arm, data, q, zero, zero, "gravity")
    >>> np.allclose(dtau_dg @ [0.0, 0.0, -9.81], condyle.gravity(arm, data, q))  # τ is linear in g
    True
    """

def rnea_second_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> RneaSecondDerivatives:
    """The second derivatives of `rnea` as full tensors, exact, in O(n² depth), as
    `RneaSecondDerivatives(dqdq, dvdq, dvdv, dadq)`, each (nv, nv, nv): member[i] is the Hessian of τ_i.

    q: nq numbers; v, a: nv; f_ext: as for `rnea`. The order within each is that of `rnea_hessian`, which gives them
    contracted with a vector, many times faster.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a, weights = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7, np.arange(7.0)
    >>> tensors = condyle.rnea_second_derivatives(arm, data, q, v, a)
    >>> hessian = condyle.rnea_hessian(arm, data, q, v, a, weights)
    >>> np.allclose(np.einsum("i,ijk->jk", weights, tensors.dqdq), hessian.dqdq)
    True
    """

def static_torque_derivative(
    model: Model, data: Data, q: ArrayLike, f_ext: ArrayLike | None = None, out: _Array | None = None
) -> _Array:
    """The derivative ∂τ/∂q of `static_torque`, (nv, nv), and without forces that of `gravity`; exact, in O(n depth).

    q: nq numbers; f_ext: as for `rnea`, moving with the bodies.
    """

def _borrowed(capsule: Any) -> tuple[int, tuple[int, int, int], list[int], list[int] | None, tuple[int, int], int]:
    """The array that a capsule of DLPack lends, for as long as the capsule is there: it is not taken over."""

def _lend(
    owner: Any, address: int, bits: int, shape: list[int], strides: list[int], device: int, versioned: bool
) -> Any:
    """A capsule of DLPack that lends floating-point numbers on a CUDA device, whose owner stays until they are given back."""

@final
class Cholesky:
    """The factor M = L Lᵀ of any symmetric positive definite matrix.

    `factorize` and `inverse` cost O(n³), `solve` O(n²). For the inertia matrix of a robot, `Ltdl` has the same verbs
    and uses the zeros. Source: Golub and Van Loan, Matrix Computations (4th edition), algorithm 4.2.1.

    n: the rows of M, at most 4096.

    >>> factor = condyle.Cholesky(2)
    >>> factor.factorize([[4.0, 2.0], [2.0, 5.0]])
    >>> factor.solve([8.0, 12.0])
    array([1., 2.])
    """

    def __new__(cls, n: int) -> Cholesky: ...
    @property
    def lower(self) -> _Array:
        """The factor L, lower triangular."""

    def factorize(self, M: ArrayLike) -> None:
        """Computes the factor of M, a symmetric positive definite matrix; the class says at which cost.

        Nothing is checked: if M is not positive definite, solutions are wrong or not finite. What a handler of a
        signal raises, as KeyboardInterrupt, ends it between rows; there is then no factor.
        """

    def inverse(self, out: _Array | None = None) -> _Array:
        """The inverse M⁻¹, both triangles filled."""

    def solve(self, b: ArrayLike, out: _Array | None = None) -> _Array:
        """The solution x of M x = b, as many numbers as M has rows.

        b: as many numbers.
        """

    def solve_matrix(self, B: ArrayLike, out: _Array | None = None) -> _Array:
        """The solution X of M X = B, column by column.

        B: a matrix of as many rows as M has.
        """

@final
class DivideConquer:
    """Forward dynamics by the divide-and-conquer articulated-body algorithm: the plan for one model, and its memory.

    The robot is assembled from runs of at most `grain` bodies. With `grain` = 1 the algorithm takes O(log n) steps; but
    a join of two pieces costs some six times as much as the elimination of a body. With two threads, and as many runs
    as threads, it is faster than `aba` from some 200 bodies on; with one thread it never is. With joints that share
    coordinates (mimic) the passes run once for the robot with all joints free, and once more for each of those joints.
    The bits are the same for any number of threads. Source: Featherstone, A divide-and-conquer articulated-body
    algorithm for parallel O(log(n)) calculation of rigid-body dynamics (1999).

    model: the robot; grain: the greatest number of bodies in a run.

    >>> arm = condyle.robots.arm7()
    >>> divided = condyle.DivideConquer(arm, grain=1)
    >>> q, v, tau = [0.3] * 7, [0.1] * 7, [1.0] * 7
    >>> np.allclose(divided.aba(arm, q, v, tau), condyle.aba(arm, condyle.Data(arm), q, v, tau))
    True
    >>> divided.size
    AssemblySize(bodies=7, runs=7, longest_run=1, joins=6, gathers=0, levels=4)
    """

    def __new__(cls, model: Model, grain: int) -> DivideConquer: ...
    @property
    def size(self) -> AssemblySize:
        """The work of the assembly, and its number of levels that wait for one another, as `AssemblySize`."""

    def aba(
        self,
        model: Model,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        f_ext: ArrayLike | None = None,
        out: _Array | None = None,
    ) -> _Array:
        """The acceleration q̈ of `aba`, up to rounding, nv numbers, in O(n) work and O(log n + grain) steps.

        model: the one that was planned for, or another one of the same bodies and joints; q: nq numbers; v, tau: nv;
        f_ext: as for `rnea`.
        """

@final
class Ltdl:
    """The factor M = Lᵀ D L of a robot's inertia matrix: L is unit lower triangular with the zeros of the tree, D is
    diagonal.

    With depth d of the tree (columns on the way to the root) and n = nv, `factorize` costs O(n d²), `solve` O(n d),
    `inverse` O(n² d); a chain has d = n. Source: Featherstone, Efficient factorization of the joint-space inertia
    matrix for branched kinematic trees (2005).

    model: the robot whose zeros M has.

    >>> quadruped = condyle.robots.quadruped()
    >>> M = condyle.crba(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> factor = condyle.Ltdl(quadruped)
    >>> factor.factorize(M)
    >>> np.allclose(M @ factor.solve(np.ones(18)), 1.0)
    True
    >>> factor.nonzeros  # the base, and three joints of each leg: not 171
    117
    """

    def __new__(cls, model: Model) -> Ltdl: ...
    @property
    def diagonal(self) -> _Array:
        """The diagonal D, in the `order` of the places."""

    @property
    def nonzeros(self) -> int:
        """The number of entries of L and D that may differ from zero, without the ones on L's diagonal."""

    @property
    def order(self) -> list[int]:
        """The coordinates in their order from the root to the tips: they are eliminated last to first.

        It is 0, 1, 2, … unless joints share coordinates.
        """

    def factorize(self, M: ArrayLike) -> None:
        """Computes the factor of M, a symmetric positive definite matrix; the class says at which cost.

        Nothing is checked: if M is not positive definite, solutions are wrong or not finite. What a handler of a
        signal raises, as KeyboardInterrupt, ends it between rows; there is then no factor.
        """

    def inverse(self, out: _Array | None = None) -> _Array:
        """The inverse M⁻¹, both triangles filled."""

    def row(self, k: int) -> list[tuple[int, float]]:
        """Row k of L in the `order`, entry by entry from the diagonal's left to the root: (place, value)."""

    def solve(self, b: ArrayLike, out: _Array | None = None) -> _Array:
        """The solution x of M x = b, as many numbers as M has rows.

        b: as many numbers.
        """

    def solve_matrix(self, B: ArrayLike, out: _Array | None = None) -> _Array:
        """The solution X of M X = B, column by column.

        B: a matrix of as many rows as M has.
        """

@final
class HyperDual:
    """A hyper-dual number re + eps1 ε₁ + eps2 ε₂ + eps1eps2 ε₁ε₂ with ε₁² = ε₂² = 0: it knows its derivatives in two
    directions, and the second derivative by both.

    Arrays of them are NumPy arrays of objects; arithmetic and NumPy's elementary functions work on these, and so do
    all functions of a model and a state, which then return such arrays. Comparisons look at `re`. `condyle.jacobian`,
    `gradient` and `hessian` make them and read the derivatives.

    Source: Fike and Alonso, The development of hyper-dual numbers for exact second-derivative calculations (2011).

    >>> x = np.array([condyle.HyperDual(0.5, eps1=1.0), condyle.HyperDual(2.0, eps2=1.0)])
    >>> y = np.sin(x[0]) * x[1] ** 2
    >>> bool(abs(y.eps1eps2 - 2.0 * np.cos(0.5) * 2.0) < 1e-15)  # ∂²y/∂x₀∂x₁
    True
    """

    def __new__(cls, re: float, eps1: float = 0.0, eps2: float = 0.0, eps1eps2: float = 0.0) -> HyperDual: ...
    @property
    def eps1(self) -> float:
        """The derivative in the first direction."""

    @property
    def eps1eps2(self) -> float:
        """The second derivative by both."""

    @property
    def eps2(self) -> float:
        """The derivative in the second direction."""

    @property
    def re(self) -> float:
        """The value."""

    def __abs__(self, /) -> HyperDual: ...
    def __add__(self, value: _Number, /) -> HyperDual: ...
    def __bool__(self, /) -> bool: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ge__(self, value: _Number, /) -> bool: ...
    def __gt__(self, value: _Number, /) -> bool: ...
    def __le__(self, value: _Number, /) -> bool: ...
    def __lt__(self, value: _Number, /) -> bool: ...
    def __mul__(self, value: _Number, /) -> HyperDual: ...
    def __ne__(self, value: object, /) -> bool: ...
    def __neg__(self, /) -> HyperDual: ...
    def __pos__(self, /) -> HyperDual: ...
    def __pow__(self, value: _Number, mod: None = None, /) -> HyperDual: ...
    def __radd__(self, value: _Number, /) -> HyperDual: ...
    def __reduce__(self) -> tuple[Any, ...]:
        """The parts of a pickle."""

    def __rmul__(self, value: _Number, /) -> HyperDual: ...
    def __rpow__(self, value: _Number, mod: None = None, /) -> HyperDual: ...
    def __rsub__(self, value: _Number, /) -> HyperDual: ...
    def __rtruediv__(self, value: _Number, /) -> HyperDual: ...
    def __sub__(self, value: _Number, /) -> HyperDual: ...
    def __truediv__(self, value: _Number, /) -> HyperDual: ...
    def arccos(self) -> HyperDual:
        """The angle whose cosine is self."""

    def arccosh(self) -> HyperDual:
        """The number whose hyperbolic cosine is self."""

    def arcsin(self) -> HyperDual:
        """The angle whose sine is self."""

    def arcsinh(self) -> HyperDual:
        """The number whose hyperbolic sine is self."""

    def arctan(self) -> HyperDual:
        """The angle whose tangent is self."""

    def arctan2(self, x: _Number) -> HyperDual:
        """The angle of the point (x, self) in the plane."""

    def arctanh(self) -> HyperDual:
        """The number whose hyperbolic tangent is self."""

    def cbrt(self) -> HyperDual:
        """The cubic root of self."""

    def cos(self) -> HyperDual:
        """The cosine of self."""

    def cosh(self) -> HyperDual:
        """The hyperbolic cosine of self."""

    def exp(self) -> HyperDual:
        """The exponential of self, e to the power of self."""

    def exp2(self) -> HyperDual:
        """The power of 2 with exponent self."""

    def expm1(self) -> HyperDual:
        """The exponential of self, minus 1."""

    def fabs(self) -> HyperDual:
        """The absolute value of self."""

    def hypot(self, other: _Number) -> HyperDual:
        """The hypotenuse √(self² + other²)."""

    def log(self) -> HyperDual:
        """The natural logarithm of self."""

    def log10(self) -> HyperDual:
        """The logarithm of self to the base 10."""

    def log1p(self) -> HyperDual:
        """The natural logarithm of 1 + self."""

    def log2(self) -> HyperDual:
        """The logarithm of self to the base 2."""

    def sin(self) -> HyperDual:
        """The sine of self."""

    def sinh(self) -> HyperDual:
        """The hyperbolic sine of self."""

    def sqrt(self) -> HyperDual:
        """The square root of self."""

    def tan(self) -> HyperDual:
        """The tangent of self."""

    def tanh(self) -> HyperDual:
        """The hyperbolic tangent of self."""

def check(inertia: Inertia) -> None:
    """A check that a body of positive density can have this inertia, J ≻ 0; raises `NotPhysicalError` otherwise.

    Point masses, rods and plates are at the border, without volume, and are refused.

    >>> from condyle import inertial_parameters
    >>> inertial_parameters.check(condyle.Inertia.from_com(0.0, np.zeros(3), np.eye(3)))
    Traceback (most recent call last):
        ...
    condyle.NotPhysicalError: mass is 0 kg
    """

def from_inertia(inertia: Inertia) -> _Array:
    """The ten parameters π of an `Inertia`: mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the rotational
    inertia about the origin, 10 numbers.

    >>> from condyle import inertial_parameters
    >>> I = condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))
    >>> inertial_parameters.from_inertia(I)
    array([2. , 0. , 0. , 1. , 0.6, 0. , 0.6, 0. , 0. , 0.1])
    """

def from_log_cholesky(theta: ArrayLike) -> Inertia:
    """The `Inertia` with the log-Cholesky parameters θ, physical for all values of θ; the inverse of `log_cholesky`.

    theta: 10 numbers; α within ±32 and dᵢ within ±64.
    """

def log_cholesky(inertia: Inertia) -> _Array:
    """The log-Cholesky parameters θ = (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃) of a physical inertia. Any ten numbers
    are those of exactly one physical inertia.

    α = ½ ln m; dᵢ: logarithms (of m); s: m; t: the centre of mass (m). With them an identification needs no
    constraints. Source: Rucker and Wensing, Smooth parameterization of rigid-body inertia (2022).

    Raises `NotPhysicalError`.

    >>> from condyle import inertial_parameters
    >>> pi = condyle.robots.arm7().inertial_parameters[:10]
    >>> theta = inertial_parameters.log_cholesky(inertial_parameters.to_inertia(pi))
    >>> np.allclose(inertial_parameters.from_inertia(inertial_parameters.from_log_cholesky(theta)), pi)
    True
    """

def log_cholesky_jacobian(theta: ArrayLike) -> _Array:
    """The Jacobian ∂π/∂θ of the ten parameters by the log-Cholesky parameters, (10, 10), never singular.

    theta: 10 numbers. With a regressor Y, Y ∂π/∂θ is the slope of the efforts in θ.

    >>> from condyle import inertial_parameters
    >>> inertial_parameters.log_cholesky_jacobian(np.zeros(10))[0, 0].item()  # m = e²ᵅ
    2.0
    """

def pseudo_inertia(inertia: Inertia) -> _Array:
    """The pseudo-inertia J = [Σ, m c; m cᵀ, m], the second moments of the points (x, y, z, 1): (4, 4), in kg m², kg m and
    kg.

    Linear in the parameters; positive definite if and only if a body of positive density can have this inertia. Source:
    Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter identification
    (2018).

    >>> from condyle import inertial_parameters
    >>> J = inertial_parameters.pseudo_inertia(condyle.robots.arm7().inertias[3])
    >>> bool(np.linalg.eigvalsh(J).min() > 0.0)
    True
    """

def to_inertia(pi: ArrayLike) -> Inertia:
    """The `Inertia` with the ten parameters π; the inverse of `from_inertia`.

    pi: 10 numbers.
    """

@final
class Joint:
    """The kind of a joint, with its axis and pitch where it has them.

    | | q | v |
    | --- | --- | --- |
    | `revolute`, `prismatic`, `helical` | 1 | 1: about, along the axis |
    | `continuous` | 2: cos θ, sin θ | 1 |
    | `spherical` | 4: quaternion x, y, z, w | 3: angular, in the body |
    | `planar` | 4: x, y, cos θ, sin θ | 3: ẋ, ẏ in the body, θ̇ |
    | `translation` | 3 | 3 |
    | `free_flyer` | 7: position, quaternion | 6: linear, angular, in the body |

    An axis is a vector in the body's frame, of any length but 0.

    >>> condyle.Joint.helical([0.0, 0.0, 1.0], pitch=0.1).nv
    1
    """

    @property
    def axis(self) -> _Array | None:
        """The axis, 3 numbers in the body's frame; a unit vector in a model. None if the joint has no axis."""

    @property
    def nq(self) -> int:
        """The number of coordinates of its position."""

    @property
    def nv(self) -> int:
        """The number of its degrees of freedom: of the numbers in its velocity."""

    @property
    def pitch(self) -> float | None:
        """The metres along the axis for each radian about it; None if the joint is no screw."""

    @staticmethod
    def continuous(axis: ArrayLike) -> Joint:
        """A joint with one angle about an axis, without limits: q = [cos θ, sin θ], v = [θ̇]."""

    @staticmethod
    def free_flyer() -> Joint:
        """A joint that leaves its body free: q = [position, quaternion (x, y, z, w)], v = [linear, angular] in the body's
        frame.
        """

    @staticmethod
    def helical(axis: ArrayLike, pitch: float) -> Joint:
        """A screw joint: q = [θ], v = [θ̇], with `pitch` metres along the axis for each radian about it."""

    @staticmethod
    def planar() -> Joint:
        """A joint that moves in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇]."""

    @staticmethod
    def prismatic(axis: ArrayLike) -> Joint:
        """A joint with one length along an axis: q = [d], v = [ḋ]."""

    @staticmethod
    def revolute(axis: ArrayLike) -> Joint:
        """A joint with one angle about an axis: q = [θ], v = [θ̇]."""

    @staticmethod
    def spherical() -> Joint:
        """A ball joint: q = quaternion (x, y, z, w), v = angular velocity in the body's frame."""

    @staticmethod
    def translation() -> Joint:
        """A joint with three lengths: q = [x, y, z], v = q̇."""

def body_acceleration(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The spatial acceleration of a body, 6 numbers (m/s², then rad/s²), without gravity: `frame_acceleration` of its
    own frame; O(n).

    q: nq numbers; v, a: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def body_classical_acceleration(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The classical acceleration of a body, 6 numbers (m/s², then rad/s²): `frame_classical_acceleration` of its own
    frame; O(n).

    q: nq numbers; v, a: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def body_jacobian(
    model: Model, data: Data, q: ArrayLike, body: str | int, reference: _Reference = "local", out: _Array | None = None
) -> _Array:
    """The Jacobian J of a body, (6, nv), linear rows first: the velocity of the body is J v.

    q: nq numbers; body: its number or its joint's name, 0 being the world; reference: as for `frame_jacobian`, of the
    body's own frame.

    >>> arm = condyle.robots.arm7()
    >>> data, q = condyle.Data(arm), [0.3] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "link7")
    >>> np.array_equal(condyle.body_jacobian(arm, data, q, "joint7"), J)
    True
    """

def body_jacobian_rate(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The rate dJ/dt of a body's Jacobian along v, (6, nv): `frame_jacobian_rate` of its own frame.

    q: nq numbers; v: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def body_point_jacobian(
    model: Model, data: Data, q: ArrayLike, body: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """The Jacobian J of a point of a body, (3, nv): `frame_point_jacobian` of the body's own frame.

    q: nq numbers; body: as for `body_jacobian`; point: in the frame of the body, 3 numbers (m).
    """

def body_point_velocity(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, body: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """The velocity of a point of a body along the axes of the world, 3 numbers (m/s): `frame_point_velocity` of the body's own
    frame.

    q: nq numbers; v: nv; body: as for `body_jacobian`; point: in the frame of the body, 3 numbers (m).
    """

def body_velocity(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    body: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The velocity of a body, 6 numbers (m/s, then rad/s): `frame_velocity` of its own frame; O(n).

    q: nq numbers; v: nv; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def forward_kinematics(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The pose of each body in the world as a homogeneous matrix: (nbodies, 4, 4); O(n).

    q: nq numbers. Body i is the one that joint i carries, in the frame that the URDF gives it; body 0 is the world.
    A frame's pose is that of its body times its placement: `poses[f.body] @ f.placement`; or see `frame_placement`.

    >>> quadruped = condyle.robots.quadruped()
    >>> data = condyle.Data(quadruped)
    >>> condyle.forward_kinematics(quadruped, data, condyle.neutral(quadruped)).shape
    (14, 4, 4)
    """

def frame_acceleration(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The spatial acceleration of a frame, 6 numbers (m/s², then rad/s²), without gravity: the rate of its spatial
    velocity as seen from the world, expressed in the reference; O(n).

    q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.
    """

def frame_classical_acceleration(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The classical acceleration of a frame, 6 numbers: v̇ + ω × v of the body's point at the origin of the reference
    (m/s²), then the angular acceleration (rad/s²). In 'local_world_aligned' its linear part is p̈ of the frame's
    origin; O(n).

    q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.2] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "tool", "local_world_aligned")
    >>> dJ = condyle.frame_jacobian_rate(arm, data, q, v, "tool", "local_world_aligned")
    >>> acceleration = condyle.frame_classical_acceleration(arm, data, q, v, a, "tool", "local_world_aligned")
    >>> np.allclose(acceleration, J @ a + dJ @ v)
    True
    """

def frame_jacobian(
    model: Model, data: Data, q: ArrayLike, frame: str | int, reference: _Reference = "local", out: _Array | None = None
) -> _Array:
    """The Jacobian J of a frame, (6, nv), linear rows first: the velocity of the frame is J v.

    q: nq numbers; frame: its name or number. reference: 'local', the velocity in the frame itself; 'world', that of
    the body's point at the world's origin, along the world's axes; or 'local_world_aligned', that of the frame's
    origin, along the world's axes.

    >>> arm = condyle.robots.arm7()
    >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.0] * 7, "tool", "local_world_aligned").shape
    (6, 7)
    """

def frame_jacobian_rate(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The rate dJ/dt of a frame's Jacobian along v, (6, nv), linear rows first.

    q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`. dJ v + J a is the spatial
    acceleration in 'local' and 'world', and the classical one in 'local_world_aligned', whose origin moves with the
    frame.
    """

def frame_placement(model: Model, data: Data, q: ArrayLike, frame: str | int, out: _Array | None = None) -> _Array:
    """The pose oXf of a frame in the world: a homogeneous matrix (4, 4) that takes coordinates in the frame to coordinates
    in the world; O(n).

    q: nq numbers; frame: its name or number.

    >>> arm = condyle.robots.arm7()
    >>> tool = condyle.frame_placement(arm, condyle.Data(arm), [0.0] * 7, "tool")
    >>> bool(tool[2, 3] > 0.5)  # stretched upwards
    True
    """

def frame_point_jacobian(
    model: Model, data: Data, q: ArrayLike, frame: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """The Jacobian J of a point of a frame, (3, nv): its velocity along the axes of the world is J v (m/s).

    q: nq numbers; frame: its name or number; point: in the frame, 3 numbers (m). J = S_v + S_ω × p, with the point p in
    the world and S the columns of the joints before it.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, tip = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.0, 0.02, 0.1]
    >>> J = condyle.frame_point_jacobian(arm, data, q, "tool", tip)
    >>> np.allclose(J @ v, condyle.frame_point_velocity(arm, data, q, v, "tool", tip))
    True
    """

def frame_point_velocity(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, frame: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """The velocity of a point of a frame along the axes of the world, 3 numbers (m/s): v + ω × p.

    q: nq numbers; v: nv; frame: its name or number; point: in the frame, 3 numbers (m).
    """

def frame_velocity(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The velocity of a frame, 6 numbers: that of the body's point at the origin of the reference (m/s), then the angular
    velocity (rad/s); O(n).

    q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.5] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "tool")
    >>> np.allclose(condyle.frame_velocity(arm, data, q, v, "tool"), J @ v)
    True
    """

@final
class Model:
    """A robot: bodies, joints, frames, inertias, limits. It never changes and may be shared between threads.

    Body 0 is the world. The others stand parents first, depth first, siblings in the order of their joints' names, as
    Pinocchio numbers them. A model is read from a file, made by a `ModelBuilder`, or one of `condyle.robots`; it can be
    pickled.

    >>> arm = condyle.robots.arm7()
    >>> arm.nq, arm.nv, arm.names[:3]
    (7, 7, ['universe', 'joint1', 'joint2'])
    """

    @property
    def actuators(self) -> list[Actuator]:
        """The actuators of the file, as `Actuator`, in its order. Their ranges are part of `limits` already, their armature
        and damping of the joints'.
        """

    @property
    def armature(self) -> _Array:
        """The inertia of the rotor as seen at each joint, nv numbers (kg m², kg): a part of M in every algorithm."""

    @property
    def body_names(self) -> list[str]:
        """The names of the links that the joints carry; 'universe' for the world."""

    @property
    def damping(self) -> _Array:
        """The viscous damping of each degree of freedom, nv numbers (N m s/rad, N s/m). It acts only in `passive_torque`
        and where a `Simulation` is asked for it.
        """

    @property
    def damping_polynomial(self) -> _Array:
        """The coefficients d₁ and d₂ of damping that grows with the speed, (nv, 2): the damping is d₀ + d₁|v| + d₂v², with
        d₀ in `damping`. It acts where `damping` does.
        """

    @property
    def frames(self) -> list[Frame]:
        """The frames, as `Frame(name, kind, body, placement)`: two for each joint of the URDF, fixed ones too, the joint's
        and the link's.
        """

    @property
    def friction(self) -> _Array:
        """The Coulomb friction of each degree of freedom, nv numbers (N m, N). It acts only in `passive_torque` and where
        a `Simulation` is asked for it.
        """

    @property
    def gravity(self) -> _Array:
        """The acceleration of free fall, in the world's frame (m/s²), 3 numbers."""

    @property
    def gravity_compensation(self) -> list[GravityCompensation]:
        """The weights that are carried by an unseen hand, as `GravityCompensation(body, mass, mass_com)`: MuJoCo's
        `gravcomp`. They act in `passive_torque` and where a `Simulation` is asked for them.
        """

    @property
    def idx_qs(self) -> list[int]:
        """The index in q at which each joint's position begins; for a joint that mimics another, that of the other."""

    @property
    def idx_vs(self) -> list[int]:
        """The index in v at which each joint's velocity begins; for a joint that mimics another, that of the other."""

    @property
    def inertial_parameters(self) -> _Array:
        """The inertial parameters π, which regressors are multiplied with: ten numbers for each body but the world, 10
        (nbodies − 1) in all. They are mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the rotational
        inertia about the origin of the body's frame.
        """

    @property
    def inertias(self) -> list[Inertia]:
        """The inertia of each body in the body's frame, with all that fixed joints merge into it, as `Inertia`."""

    @property
    def joint_placements(self) -> _Array:
        """The pose of each joint's frame, at position zero, in its parent body: (nbodies, 4, 4)."""

    @property
    def joint_types(self) -> list[str]:
        """The kind of each joint: 'revolute', 'continuous', 'prismatic', 'helical', 'spherical', 'planar',
        'translation' or 'free_flyer'; 'universe' for the world.
        """

    @property
    def joints(self) -> list[Joint | None]:
        """The joints, as `Joint`; None for the world."""

    @property
    def keyframe_controls(self) -> dict[str, _Array]:
        """The controls of the `keyframes`: a dictionary by name, with a number for each of `actuators`."""

    @property
    def keyframe_velocities(self) -> dict[str, _Array]:
        """The velocities of the `keyframes`: a dictionary of v by name, nv numbers each."""

    @property
    def keyframes(self) -> dict[str, _Array]:
        """The named positions of the file: a dictionary of q by name, nq numbers each."""

    @property
    def limits(self) -> Limits:
        """The limits of position, velocity and effort, as `Limits`; infinite where there are none. `effort` is the greatest
        magnitude of `effort_lower` and `effort_upper`.
        """

    @property
    def mimics(self) -> list[Mimic | None]:
        """The rule by which each joint follows another one, as `Mimic(ratio, offset)`; None for a joint that does not."""

    @property
    def name(self) -> str:
        """The robot's name."""

    @property
    def names(self) -> list[str]:
        """The names of the joints, one for each body; 'universe' for the world."""

    @property
    def nbodies(self) -> int:
        """The number of bodies, the world included: of the rows of f_ext and of the result of `forward_kinematics`."""

    @property
    def nq(self) -> int:
        """The number of coordinates of a position q."""

    @property
    def nqs(self) -> list[int]:
        """The number of coordinates that each joint has of its own: 0 if it mimics another joint, and 0 for the world."""

    @property
    def nv(self) -> int:
        """The number of degrees of freedom: of the numbers in v, a, τ and in a tangent vector."""

    @property
    def nvs(self) -> list[int]:
        """The number of degrees of freedom that each joint has of its own: 0 if it mimics another joint, and 0 for the
        world.
        """

    @property
    def parents(self) -> list[int]:
        """The body on which each joint sits; 0 is the world."""

    @property
    def singular_joints(self) -> list[int]:
        """The bodies whose joints make M singular: `aba`, `minv` and `aba_derivatives` raise `ModelError`."""

    @property
    def springs(self) -> list[Spring]:
        """The springs of joints, as `Spring(joint, stiffness, rest)`. They act in `passive_torque` and where a
        `Simulation` is asked for them.
        """

    @property
    def total_mass(self) -> float:
        """The mass of all bodies, with that of what is fixed to the world (kg)."""

    @property
    def warnings(self) -> list[ModelWarning]:
        """The warnings about the robot and its file, as `ModelWarning`: text that also has `kind`, `file` and `line`.

        They tell of inertias and limits that cannot be meant, joints along which the inertia matrix is singular, names in
        the file that are unknown, and what a model cannot hold.
        """

    def __copy__(self) -> Model:
        """The model itself: it never changes."""

    def __deepcopy__(self, memo: object) -> Model:
        """The model itself: it never changes."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the parts of a pickle."""

    def append(
        self, frame: str | int | None, model: Model, placement: ArrayLike | None | None = None, prefix: str = ""
    ) -> Model:
        """This robot with another one on a frame of it, as a new model.

        Its bodies are numbered behind all that the body which carries them has carried before, as Pinocchio's `appendModel` does;
        name and gravity are this one's.

        frame: the name or number of a frame; None is the world.
        model: the other robot.
        placement: its world in the frame, a homogeneous (4, 4) matrix; None is the identity.
        prefix: put before all its names.

        >>> quadruped, arm = condyle.robots.quadruped(), condyle.robots.arm7()
        >>> quadruped.append("trunk", arm, prefix="arm_").names[13:16]
        ['RH_KFE', 'arm_joint1', 'arm_joint2']

        Raises `ModelError`: two bodies, joints or frames of one name.
        """

    def constraints(self) -> dict[str, ContactConstraint | Coupling]:
        """The constraints of the robot's file beside its tree, by name: loops as `ContactConstraint`, without stabilisation, and
        coupled joints as `Coupling`.

        The algorithms of a tree leave loops open. `constrained_dynamics` closes those that a `ConstraintSet` has:

        >>> robot = condyle.robots.quadruped()
        >>> loops = [c for c in robot.constraints().values() if isinstance(c, condyle.ContactConstraint)]
        >>> stiff = [c._replace(kp=400.0, kd=40.0) for c in loops]  # an error of position decays within 0.1 s
        >>> condyle.ConstraintSet(robot, stiff, mu=1e-8, iterations=5)
        <condyle.ConstraintSet of 'quadruped': 0 constraints, 0 rows>
        """

    def frame(self, name: str) -> int:
        """The number of the frame with this name: a link's, else the user's, else a joint's.

        Raises `ModelError`, with the nearest name.
        """

    @staticmethod
    def from_json(text: str) -> Model:
        """A model from the JSON that `to_json` gives.

        Raises `ParseError`, with line and column.
        """

    @staticmethod
    def from_mjcf(
        path: _Path,
        mimic: bool = False,
        strict: bool = False,
        weightless_meshes: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
    ) -> Model:
        """A model from an MJCF file (MuJoCo) and the files that it includes.

        q and v read as MuJoCo's `qpos` and `qvel`, but that quaternions are x, y, z, w and a free joint's velocity is
        in the body's frame (MuJoCo: linear velocity in the world's). Several joints on one body become a chain, with
        bodies without mass, `name#1`, `name#2`, …, between them. A thing that a model cannot hold is left out and
        reported in `warnings`.

        path: a path, as text or `os.PathLike`.
        mimic: whether a `<joint>` of `<equality>` lets joint1 follow joint2, instead of being a constraint beside the
            model; its `polycoef` must be linear.
        strict: whether a warning (`warnings`) is an error.
        weightless_meshes: whether a mesh with mass that cannot be read weighs nothing and is reported in `warnings`,
            instead of being an error.
        packages, allow: as for `from_urdf`.

        Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
        """

    @staticmethod
    def from_mjcf_str(
        text: str,
        mimic: bool = False,
        strict: bool = False,
        weightless_meshes: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
    ) -> Model:
        """A model from an MJCF in a string, which may not include files; see `from_mjcf`.

        >>> body = '<body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/></body>'
        >>> condyle.Model.from_mjcf_str(f"<mujoco><worldbody>{body}</worldbody></mujoco>").total_mass
        2.0
        """

    @staticmethod
    def from_mujoco(
        model: Any, mimic: bool = False, strict: bool = False, *, allow: Sequence[_Kind] | None = None
    ) -> Model:
        """A model from MuJoCo's, a `mujoco.MjModel`: the robot that MuJoCo has compiled, number for number.

        The names, q and v are those of `from_mjcf`. All that MuJoCo's compiler does is done already: meshes, `replicate`,
        `attach`, composites, `settotalmass`. Numbers that were changed after compiling count too. What a model cannot hold
        is reported in `warnings` or refused as by `from_mjcf`. MuJoCo itself is not imported.

        mimic, strict, allow: as for `from_mjcf`.

        Raises `ParseError` or `ModelError`; `ValueError` for an unknown kind.
        """

    @staticmethod
    def from_pinocchio(model: Any) -> Model:
        """A model from Pinocchio's, a `pinocchio.Model`: the same joints, bodies, frames, limits and losses, so that numbers are
        equal; `to_pinocchio` is the way back.

        Composite, universal and spherical ZYX joints become several ones, with bodies without mass between them. Limits of
        quaternions, cosines and sines are left out, and so are geometry and reference configurations.

        Raises `ModelError` if its joints do not stand depth first, as Pinocchio's readers of files number them, or are of a
        kind that is not here.
        """

    @staticmethod
    def from_sdf(
        path: _Path,
        root_joint: _RootJoint | None = None,
        mimic: bool = False,
        strict: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
        model: str | None = None,
    ) -> Model:
        """A model from an SDF file (Gazebo), with the models that it includes.

        All models of a file, or of its first world, become one robot, whose names then begin with the model's:
        `robot::arm`. Joints are walked breadth first from the root, in the order of the file; one that would give a link a
        second parent closes a loop. Universal joints become two revolute ones.

        path: a path, as text or `os.PathLike`.
        root_joint: as for `from_urdf`.
        mimic: whether an axis with a `<mimic>` follows another one, instead of being free.
        strict: whether a warning (`warnings`) is an error.
        packages, allow: as for `from_urdf`; `model://` addresses are looked for in `packages` too.
        model: the name of the one model to read; None reads all models of the file.

        Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
        """

    @staticmethod
    def from_sdf_str(
        text: str,
        root_joint: _RootJoint | None = None,
        mimic: bool = False,
        strict: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
        model: str | None = None,
    ) -> Model:
        """A model from an SDF in a string; see `from_sdf`.

        >>> link = '<link name="ball"><inertial><mass>2</mass></inertial></link>'
        >>> text = f'<sdf version="1.7"><model name="ball">{link}</model></sdf>'
        >>> condyle.Model.from_sdf_str(text, root_joint="free_flyer").nv
        6
        """

    @staticmethod
    def from_urdf(
        path: _Path,
        root_joint: _RootJoint | None = None,
        mimic: bool = False,
        strict: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
        arguments: dict[str, str | float | bool] | None = None,
    ) -> Model:
        """A model from a URDF file.

        Fixed joints are merged into the body that they sit on and stay as frames. Meshes are never looked at. A file whose
        name ends in `.xacro` is expanded by the installed program `xacro` or `xacrodoc`, which evaluates expressions of
        the file: expand files of people that you trust only.

        path: a path, as text or `os.PathLike`, or `package://name/path/in/the/package`.
        root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
            'spherical' or 'translation'; None fixes the root link to the world.
        mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow, instead of having
            their own.
        strict: whether a warning (`warnings`) is an error.
        packages: folders that contain packages, or are packages; before those that the environment names in
            `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
        allow: kinds of warnings that are no errors, though `strict` is set: 'massless', 'negative', 'triangle',
            'singular', 'unlikely', 'limit', 'unknown', 'left_out', 'assumed' or 'mimic'.
        arguments: values of xacro's `<xacro:arg>`s by name, for files that end in `.xacro`.

        Raises `ParseError`, with file, line and element, or `ModelError`; `ValueError` for an unknown kind.
        """

    @staticmethod
    def from_urdf_str(
        text: str,
        root_joint: _RootJoint | None = None,
        mimic: bool = False,
        strict: bool = False,
        packages: Sequence[_Path] | None = None,
        *,
        allow: Sequence[_Kind] | None = None,
    ) -> Model:
        """A model from a URDF in a string; see `from_urdf`.

        >>> text = condyle.robots.QUADRUPED
        >>> condyle.Model.from_urdf_str(text, root_joint="free_flyer").nv
        18
        """

    def joint(self, name: str) -> int:
        """The number of the body that the joint with this name carries.

        Raises `ModelError`, with the nearest name.
        """

    def lock(self, joints: Sequence[str | int], q: ArrayLike) -> Model:
        """The same robot with some joints locked where they are at q.

        Their bodies are merged into those that carry them and stay as frames. A joint that follows a locked one is
        locked with it.

        joints: a list of names or numbers of bodies.
        q: nq numbers.

        >>> condyle.robots.arm7().lock(["joint4", 6], [0.0] * 7).names
        ['universe', 'joint1', 'joint2', 'joint3', 'joint5', 'joint7']

        Raises `ModelError`, also for a `q` that is not finite or in which a rotation has not the length 1 (up to 1e-3).
        """

    def reference_configurations(self, path: _Path, strict: bool = False) -> dict[str, _Array]:
        """The named positions of an SRDF file, its `<group_state>`s: a dictionary of q by name, nq numbers each.

        Joints that a state does not mention stay as in `neutral`; a joint that turns without limits may have its angle. States
        of one name, of several groups, are one position. All else in the file is ignored.

        path: a path, as text or `os.PathLike`.
        strict: whether joints that the robot does not have are errors; SRDFs are often shared by robots with fewer joints.

        Raises `ParseError`, with file, line and element.
        """

    def reference_configurations_str(self, text: str, strict: bool = False) -> dict[str, _Array]:
        """The named positions of an SRDF in a string; see `reference_configurations`.

        >>> joint = '<joint name="joint4" value="-1.2"/>'
        >>> srdf = f'<robot name="arm7"><group_state name="bent" group="arm">{joint}</group_state></robot>'
        >>> condyle.robots.arm7().reference_configurations_str(srdf)
        {'bent': array([ 0. ,  0. ,  0. , -1.2,  0. ,  0. ,  0. ])}
        """

    def to_json(self) -> str:
        """The model as JSON, with all digits; `from_json` gives an equal one. `null` stands for a limit that is infinite.

        The text may be edited: what it says is checked when it is read.

        >>> arm = condyle.robots.arm7()
        >>> condyle.Model.from_json(arm.to_json()).to_json() == arm.to_json()
        True
        """

    def to_pinocchio(self) -> Any:
        """The same robot as a `pinocchio.Model`, which needs Pinocchio 3 or later.

        Joints that follow others do so there too, unless they turn without limits.
        """

    def tree(self, frames: bool = False) -> str:
        """The tree of bodies as text: each joint with its kind and where its coordinates stand in q and v, and the body that it
        carries; frames: whether the names of other frames stand with the bodies.

        >>> print(condyle.robots.quadruped().lock(range(2, 14), condyle.neutral(condyle.robots.quadruped())).tree())
        universe
        └─ root_joint: free_flyer, q[0:7], v[0:6] → trunk, 30.000 kg
        """

    def with_armature(self, armature: ArrayLike) -> Model:
        """The same robot with another armature, nv numbers (kg m², kg).

        Raises `ModelError` if one is negative or not finite.
        """

    def with_frame(self, name: str, parent: str | int | None, placement: ArrayLike | None = None) -> Model:
        """The same robot with one more frame of the user's, the last one of `frames`. All other numbers stay as they are.

        name: the new frame's name; parent: the name or number of the frame on which it is put, or the name of a body; None is
        the world; placement: the new frame in the parent's, a homogeneous (4, 4) matrix; None is the identity.

        Raises `ModelError` if the parent does not exist, the placement is no rotation and translation, or the user has a frame
        of this name already.

        >>> tip = np.eye(4)
        >>> tip[2, 3] = 0.1
        >>> arm = condyle.robots.arm7().with_frame("tip", "tool", tip)
        >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.3] * 7, "tip").shape
        (6, 7)
        """

    def with_gravity(self, gravity: ArrayLike) -> Model:
        """The same robot under another gravity (m/s², 3 numbers, in the world's frame).

        Raises `ModelError` if it is not finite.
        """

    def with_inertias(self, inertias: Sequence[Inertia]) -> Model:
        """The same robot with other inertias, one for each body as `inertias` gives them, the world's first. What is odd about
        them is in its `warnings` and `singular_joints`.

        Raises `ModelError` if a mass is negative or a number is not finite.

        >>> arm = condyle.robots.arm7()
        >>> twice = [I._replace(mass=2.0 * I.mass, rotational=2.0 * I.rotational) for I in arm.inertias]
        >>> heavier = arm.with_inertias(twice)
        >>> heavier.total_mass == 2.0 * arm.total_mass
        True
        """

    def with_limits(
        self,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None,
        *,
        effort_lower: ArrayLike | None = None,
        effort_upper: ArrayLike | None = None,
    ) -> Model:
        """The same robot with other limits of position (nq numbers), velocity and effort (nv each); None leaves them as they
        are, and infinite numbers are none.

        effort: greatest magnitude; sets both `effort_lower` and `effort_upper`, and goes with neither of them.

        Raises `ModelError` if a lower limit is above an upper one, or a limit of velocity is negative.

        >>> arm = condyle.robots.arm7()
        >>> arm.with_limits(effort=0.5 * arm.limits.effort).limits.effort[0].item()
        43.5
        """

    def with_mimic(self, follower: str | int, leader: str | int, ratio: float = 1.0, offset: float = 0.0) -> Model:
        """The same robot with one more joint that follows another one, its position being ratio q + offset, in place of a
        coordinate of its own. Its limits are those of the one that it follows.

        follower, leader: the joints' names, or the numbers of their bodies.

        >>> arm = condyle.robots.arm7()
        >>> arm.with_mimic("joint4", "joint2", ratio=-2.0).nv
        6

        Raises `ModelError` if they are not of one degree of freedom, or a joint would follow one that follows.
        """

    def write_mjcf(self, path: _Path, original: _Path) -> None:
        """Writes the same into a copy of the MJCF `original`; see `write_urdf`.

        Bodies and joints that differ must be in the file itself, not in one that it includes. Limits of effort are written
        as `actuatorfrcrange` of the joint.

        path: the new file. original: the file that the robot was read from.

        Raises `ParseError` as `write_urdf` does.
        """

    def write_urdf(self, path: _Path, original: _Path) -> None:
        """Writes inertias, limits, damping, friction and armature into a copy of the URDF `original`, and all else as it is
        there.

        Only what differs from the original is edited, so an unchanged robot gives the same bytes. Reading the new file
        gives this model back, up to rounding. `original` may be `path`. Of several links that fixed joints merge, the one
        that the joint carries takes the difference. An armature becomes the rotor inertia of a `<transmission>`.

        path: the new file. original: the file that the robot was read from.

        Raises `ParseError` with the thing and both numbers if the file cannot say it, as an infinite limit, or is that of
        another robot.
        """

def _model_from_bytes(data: bytes) -> Model:
    """The model that a pickle holds."""

@final
class Action:
    """An action written in Python.

    nx, nu: the numbers of a state and of a control, at most 4096; nu is 0 at a terminal knot.
    calc: a function of (t, x, u) that returns the next state and the cost; of the terminal knot, and of no other, the next
        state may be None.
    calc_diff: a function of (t, x, u) that returns a dict of what is not zero among A = ∂x⁺/∂x, B = ∂x⁺/∂u,
        q = ∂ℓ/∂x, r = ∂ℓ/∂u, Q = ∂²ℓ/∂x², S = ∂²ℓ/∂x∂u, R = ∂²ℓ/∂u². Without it calc is called with arrays of numbers
        that know their derivatives, exact ones; once for all knots, if it leaves t alone and takes no branch that differs
        from knot to knot. So make its results of its arguments (`np.array([...])`, `np.concatenate`), and do not write
        them into arrays of floats. What cannot be called so is differentiated by hyper-dual numbers, else by differences.
    lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
    space: where states live: None for vectors; a model, for its states (q, v); or a tuple (ndx, integrate, difference), where
        integrate(x, dx) is x ⊕ dx, difference(x0, x1) the dx with x0 ⊕ dx = x1, and dx has ndx numbers. Derivatives are taken
        by dx.
    batch: whether calc and calc_diff take all knots at once: t of shape (N,), x (N, nx), u (N, nu), and arrays with N rows
        as results.

    >>> from condyle.optimal import Action, Fddp, Problem
    >>> knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * (x @ x + u @ u)))
    >>> end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
    >>> problem = Problem([1.0], [knot], [0] * 30, end)
    >>> round(Fddp(problem).solve(np.zeros((31, 1)), np.zeros((30, 1))).cost, 6)
    0.809017
    """

    def __new__(
        cls,
        nx: int,
        nu: int,
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], tuple[Any, Any]],
        calc_diff: Callable[[Any, _Array, _Array], dict[str, ArrayLike]] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        space: _Space | None = None,
        batch: bool = False,
    ) -> Action: ...

@final
class Activation:
    """The cost a(r) of a residual r.

    >>> condyle.optimal.Activation.weighted([1.0, 0.0])
    Weighted([1.0, 0.0])
    """

    @staticmethod
    def _from_json(text: str) -> Activation: ...
    @staticmethod
    def barrier(lower: ArrayLike, upper: ArrayLike) -> Activation:
        """The quadratic barrier ½ Σ (excess of rᵢ over its bounds)²; an infinite bound is no bound."""

    @staticmethod
    def quadratic() -> Activation:
        """The quadratic cost ½ Σ rᵢ²."""

    @staticmethod
    def smooth1(epsilon: float = 1.0) -> Activation:
        """The smooth cost Σ √(ε + rᵢ²), nearly Σ |rᵢ|."""

    @staticmethod
    def smooth2(epsilon: float = 1.0) -> Activation:
        """The smooth cost √(ε + ‖r‖²), nearly ‖r‖. Its Hessian is taken to be ε/a³ times the identity, the least
        eigenvalue of the exact one.
        """

    @staticmethod
    def sum() -> Activation:
        """The sum Σ rᵢ, for residuals that are costs by themselves: see `Residual.own_cost`."""

    @staticmethod
    def weighted(w: ArrayLike) -> Activation:
        """The weighted quadratic cost ½ Σ wᵢ rᵢ²."""

    @staticmethod
    def weighted_barrier(lower: ArrayLike, upper: ArrayLike, w: ArrayLike) -> Activation:
        """The weighted quadratic barrier ½ Σ wᵢ (excess of rᵢ over its bounds)². Crocoddyl has the square of wᵢ in its
        value.
        """

@final
class AugmentedLagrangian:
    """The augmented Lagrangian method around `Fddp`, as ProxDDP's: for robots with `Limit`s and for `ConstrainedAction`s.

    It repeats: minimise Σ ℓ + (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖², z = g + μ y, by FDDP; if the limits hold well enough,
    y ← (z − Π z) / μ, else μ falls; until limits and the gradient of ℓ + yᵀg vanish to the tolerances.

    `solve` begins with multipliers of zero. `resume` begins with those of the last solve and its penalty, unless that
    ended as "not_finite" or with violated limits at the largest penalty; `shift` moves them on. A solution is "converged"
    when the residuals of `outcome` are below the tolerances. It is "constraints_violated" if the penalty reached its limit
    and the limits do not hold, which proves nothing: another warm start may find a solution. It is "infeasible" if the
    initial state itself violates a limit of knot 0 that no control can change. `outcome.worst` names the knot, the limit
    and the amount. The cost of the solution contains the terms of the limits, that of `outcome` does not; its trace and
    gains are those of the last inner solve, and its timings those of the whole solve. Controls of a warm start that are outside of their bounds are moved into them.

    problem: the problem to solve; all memory is made for its shape, once.
    inner: a dict of settings of `Fddp` for the inner solves. The solver chooses their tolerances; `time_budget` is that
        of the whole solve.
    settings: any of these, by name.
        `tolerance`: the largest distance of a limit from its bounds that is accepted.
        `tolerance_dual`: the largest entry of the gradient of the Lagrangian that is accepted.
        `max_solves`: the number of inner solves at most.
        `penalty_start`, `penalty_max`, `penalty_factor`: 1/μ of the first inner solve, its greatest value, and the
        factor by which it rises.
        `restart`: whether a `solve` with limits or bounds that is not finite, or violates limits at the largest penalty, begins
        once more, from the initial state held still at all knots (default: yes). The better result counts.

    >>> from condyle.optimal import AugmentedLagrangian, Cost, FreeDynamics, Limit, Problem, Residual
    >>> arm = condyle.robots.arm7()
    >>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    >>> costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    >>> weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
    >>> knot = FreeDynamics(arm, 0.05, costs, limits=[weak])
    >>> reach = Limit("reach", Residual.frame_translation(arm, "tool", [0.5, 0.1, 0.6]))  # exactly
    >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [], limits=[reach]))
    >>> solver = AugmentedLagrangian(problem)
    >>> solution = solver.solve(np.tile(x0, (11, 1)), np.tile(knot.quasi_static(x0), (10, 1)))
    >>> solution.status, bool(np.abs(solution.us).max() < 30.0 + 1e-6), solver.outcome.primal < 1e-6
    ('converged', True, True)
    """

    def __new__(
        cls, problem: Problem, inner: dict[str, Any] | None = None, **settings: float
    ) -> AugmentedLagrangian: ...
    @property
    def outcome(self) -> Outcome:
        """The state of the limits after the last solve, an `Outcome`."""

    @property
    def solution(self) -> Solution | None:
        """The `Solution` of the last solve, also of one that a signal or an error of an `Action` has ended
        ("interrupted"); None before the first.
        """

    @staticmethod
    def _make(problem: Problem, inner: dict[str, Any] | None, settings: dict[str, Any]) -> AugmentedLagrangian: ...
    def resume(
        self, callback: Callable[[Iteration], object] | None = None, verbose: bool = False, progress: bool = False
    ) -> Solution:
        """Solves the problem from the last solution: with a new initial state, or shifted. Returns a `Solution`.

        With a `time_budget`, one delayed solve does not shorten those after it: each makes an iteration at least.

        callback, verbose, progress: as of `solve`.

        Raises `ProblemError` as `solve`, and if there is no solution yet.
        """

    def shift(self, last: int) -> None:
        """Moves the horizon of the problem on by a knot, as an MPC does after each step, and the last solution
        with it.

        `resume` then starts from there. Knot t becomes knot t − 1, with the costs and limits of its own; the
        last one is served by a model of the problem, with those that it has for all knots. The last state follows
        from the last control, which is repeated. At a second shift without a step of a solve in between the last
        state is repeated too, as a rollout by repeated controls would diverge.

        last: the index of that model.

        Raises `ProblemError` if there is no such model.
        """

    def solve(
        self,
        xs: ArrayLike,
        us: _Controls,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
    ) -> Solution:
        """Solves the problem from a warm start, and returns a `Solution`, whose status says how the solve ended.

        Other threads run meanwhile. Signals are looked at some forty times a second, between the phases of an
        iteration: what a handler raises, as KeyboardInterrupt, is raised here, and `solution` then is the best
        iterate, from which `resume` goes on.

        xs: states, (N + 1, nx); they need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays where knots differ in nu.
        callback: a function that is called with the `Iteration` after each; where it returns False the solve ends
            ("interrupted"). What it raises is raised here.
        verbose: whether to print a line for each iteration.
        progress: whether to show the progress, by tqdm where that is installed, else as lines.

        Raises `ProblemError` for numbers or settings that make no sense, and what an `Action` raises.
        """

@final
class ConstrainedAction:
    """An action of any kind under a constraint lower ≤ g(x, u) ≤ upper, which `AugmentedLagrangian` holds.

    To `Fddp` alone it is a cost for leaving the bounds. For a robot's residuals see `Limit`, which is faster.

    action: the action.
    size: the number of entries of g, at most 4096.
    calc: a function of (t, x, u) that returns g; at a terminal knot u is empty.
    calc_diff: a function of (t, x, u) that returns (∂g/∂x, ∂g/∂u) of shapes (size, ndx) and (size, nu), in the tangent
        space of the state. Without it, central differences of calc.
    lower, upper: least and greatest values, infinite where there is none; g = 0 if both are None.

    >>> from condyle.optimal import Action, AugmentedLagrangian, ConstrainedAction, Problem
    >>> knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * u @ u))
    >>> end = ConstrainedAction(Action(1, 0, lambda t, x, u: (None, 0.0)), 1, lambda t, x, u: x - 3.0)  # x = 3
    >>> problem = Problem([0.0], [knot], [0] * 6, end)
    >>> solver = AugmentedLagrangian(problem)
    >>> solver.solve(np.zeros((7, 1)), np.zeros((6, 1))).us.round(6).ravel().tolist()
    [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]
    """

    def __new__(
        cls,
        action: _Action,
        size: int,
        calc: Callable[[int, _Array, _Array], ArrayLike],
        calc_diff: Callable[[int, _Array, _Array], tuple[ArrayLike, ArrayLike]] | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> ConstrainedAction: ...

@final
class ContactDynamics:
    """A knot of a robot in contact: M q̈ + h = S u + Jᵀλ, J q̈ + γ = 0; otherwise as `FreeDynamics`.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name; residuals call them by these names. May be empty.
    dt: Δt in seconds.
    costs: a list of `Cost`.
    damping: μ of J M⁻¹ Jᵀ + μ 1 (1/kg), for redundant contacts.
    costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as of `FreeDynamics`.

    Raises `ProblemError` for a contact, cost, limit or drives that do not fit, and two contacts on one body without
    damping.

    >>> from condyle.optimal import ContactDynamics
    >>> quadruped = condyle.robots.quadruped()
    >>> feet = {foot: condyle.ContactConstraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
    >>> trot = ContactDynamics(quadruped, feet, 0.02, [])
    """

    def __new__(
        cls,
        model: Model,
        contacts: dict[str, ContactConstraint],
        dt: float,
        costs: Sequence[Cost],
        damping: float = 0.0,
        costs_at: dict[int, Sequence[Cost]] | None = None,
        actuation: ArrayLike | None = None,
        integrator: _Scheme = "semi_implicit_euler",
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        limits: Sequence[Limit] | None = None,
        limits_at: dict[int, Sequence[Limit]] | None = None,
        controls: _Polynomial = "constant",
    ) -> ContactDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> ContactDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """The controls among the smallest controls and forces that hold the robot still at the state x, nu numbers."""

@final
class ContactInverseDynamics:
    """A knot of a robot in contact whose controls are its nv accelerations and the forces of its contacts: u = (q̈, λ), τ = M q̈
    + h − Jᵀλ; otherwise as `FreeDynamics`.

    Of itself it has a `Limit` to zero on the efforts that nothing drives, Nᵀτ = 0 with Nᵀ S = 0 (`undriven efforts`; of a
    floating base the first 6), and on each contact's J q̈ + γ = 0 (`contact …`): `AugmentedLagrangian` holds them, to `Fddp`
    alone they are costs. Nothing is inverted: contacts may be redundant. These are the rules of Crocoddyl's
    `DifferentialActionModelContactInvDynamics`, and without contacts of `DifferentialActionModelFreeInvDynamics`.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name, the order of which is that of λ. May be empty.
    dt: Δt in seconds.
    costs: a list of `Cost`; `Residual.joint_effort` looks at τ, `Residual.contact_force` at λ.
    costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as of `FreeDynamics`; the actuation says
        which efforts there are, bounds are of all nv + rows controls.

    Raises `ProblemError` for a contact, cost, limit or drives that do not fit.

    >>> from condyle.optimal import ContactInverseDynamics
    >>> quadruped = condyle.robots.quadruped()
    >>> feet = {foot: condyle.ContactConstraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
    >>> ContactInverseDynamics(quadruped, feet, 0.02, [])
    <condyle.optimal.ContactInverseDynamics of 'quadruped', 0.02 s, nu 24, contacts LF_foot RH_foot>
    """

    def __new__(
        cls,
        model: Model,
        contacts: dict[str, ContactConstraint],
        dt: float,
        costs: Sequence[Cost],
        costs_at: dict[int, Sequence[Cost]] | None = None,
        actuation: ArrayLike | None = None,
        integrator: _Scheme = "semi_implicit_euler",
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        limits: Sequence[Limit] | None = None,
        limits_at: dict[int, Sequence[Limit]] | None = None,
        controls: _Polynomial = "constant",
    ) -> ContactInverseDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> ContactInverseDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """No accelerations, and the forces among the smallest efforts and forces that hold the robot still at the state x:
        nv zeros and λ.
        """

@final
class Cost:
    """A term of a cost: weight times an activation of a residual.

    name: what `Problem.set_weight` and errors call it.
    weight: finite and at least 0; a term whose weight is 0 is not computed.
    residual: a `Residual`.
    activation: an `Activation`; None is the barrier of the bounds of a cone or of a centre of pressure, the sum for
        `Residual.own_cost`, and quadratic for other residuals.

    >>> from condyle.optimal import Cost, Residual
    >>> Cost("effort", 1e-3, Residual.control([0.0] * 7))
    <condyle.optimal.Cost 'effort', weight 0.001>
    """

    def __new__(cls, name: str, weight: float, residual: Residual, activation: Activation | None = None) -> Cost: ...

@final
class DifferentialAction:
    """An action of accelerations and a cost per second that are written in Python, in steps of a time.

    The state is x = (q, v); by semi-implicit Euler v⁺ = v + q̈ Δt, q⁺ = q ⊕ (v Δt + q̈ Δt²), and the cost is Δt ℓ.

    nv, nu: the numbers of a velocity and of a control, at most 4096; nu is 0 at a terminal knot.
    calc: a function of (t, x, u) that returns the accelerations, nv numbers, and the cost ℓ; of the terminal knot the
        accelerations may be None.
    dt: Δt in seconds, or None for a terminal knot, whose cost is ℓ.
    calc_diff: a function of (t, x, u) that returns a dict of what is not zero among da_dq, da_dv, da_du, the derivatives of
        the accelerations, and q, r, Q, S, R, those of ℓ as of `Action`. Without it, those of calc as for `Action`. Second
        derivatives of the accelerations, for a solver's `second_order`, are always those of calc, and zero where it cannot
        be differentiated by numbers; those of ⊕ are zero.
    integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
    lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
    model: a robot whose positions q are, with its ⊕; None for vectors of nv numbers.
    controls: 'constant', 'linear' or 'quadratic', as of `FreeDynamics`.

    Raises `ProblemError` if dt is not above 0.

    >>> from condyle.optimal import DifferentialAction, Fddp, Problem
    >>> def spring(t, x, u):
    ...     return u - x[:1], 0.5 * (x @ x + u @ u)
    >>> knot = DifferentialAction(1, 1, spring, 0.1, integrator="runge_kutta_4")
    >>> end = DifferentialAction(1, 0, lambda t, x, u: (None, 5.0 * (x @ x)), None)
    >>> problem = Problem([1.0, 0.0], [knot], [0] * 30, end)
    >>> Fddp(problem).solve(np.zeros((31, 2)), np.zeros((30, 1))).status
    'converged'
    """

    def __new__(
        cls,
        nv: int,
        nu: int,
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], tuple[Any, Any]],
        dt: float | None,
        calc_diff: Callable[[Any, _Array, _Array], dict[str, ArrayLike]] | None = None,
        integrator: _Scheme = "semi_implicit_euler",
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        model: Model | None = None,
        controls: _Polynomial = "constant",
    ) -> DifferentialAction: ...

@final
class Fddp:
    """The solver FDDP or DDP: differential dynamic programming, feasibility-driven or not, with the rules and constants of
    Crocoddyl.

    Where controls are bounded, these are the rules of its box solvers.

    problem: the problem to solve; all memory is made for its shape, once.
    settings: any of these, by name.
        `method`: "fddp" (default), whose trials keep a part of the gaps, or "ddp", whose trials are plain rollouts.
        `second_order`: whether the curvature of the dynamics counts, where the models give it (full DDP).
        `inverse_dynamics_form`: whether knots of robots come to the sweep as equations of inverse dynamics where that is possible
        (default: yes): the same steps in less time.
        `project_warm_start`: whether controls of a warm start that are outside of their bounds are moved into them, in `solve`
        and in `resume` (default: yes). Crocoddyl keeps them, so its iterates need False.
        `time_budget` (s): a solve that has used it up returns what it has, with the status "time_limit". The first iteration
        always runs, unless the budget is 0. A later phase runs if the median of its last five durations fits. A solve that
        takes longer tells by how much in `timings.overrun`.
        `segments`: the number of parts of the horizon on which a sweep works at the same time, on as many threads as
        there are; 1 unless given, at most 1024. The results differ by rounding, and not at all with the number of threads.
        `threads`: the number of threads that share an iteration on a robot (derivatives and gains, with the sweep beside
        them), 1 unless given, at most 1024. The results are the same to the last bit.
        `max_iterations`, `tolerance`, `tolerance_bounded` (where controls are bounded), `step_lengths`, `accept`,
        `accept_ascent`, `flat`, `regularisation_start`, `regularisation_min`, `regularisation_max`,
        `regularisation_factor`, `regularisation_decrease_above`, `regularisation_increase_below`: the thresholds of
        the method.
    """

    def __new__(cls, problem: Problem, **settings: float | str | None) -> Fddp: ...
    @property
    def solution(self) -> Solution | None:
        """The `Solution` of the last solve, also of one that a signal or an error of an `Action` has ended
        ("interrupted"); None before the first.
        """

    @staticmethod
    def _make(problem: Problem, inner: dict[str, Any] | None, settings: dict[str, Any]) -> Fddp: ...
    def resume(
        self, callback: Callable[[Iteration], object] | None = None, verbose: bool = False, progress: bool = False
    ) -> Solution:
        """Solves the problem from the last solution: with a new initial state, or shifted. Returns a `Solution`.

        With a `time_budget`, one delayed solve does not shorten those after it: each makes an iteration at least.

        callback, verbose, progress: as of `solve`.

        Raises `ProblemError` as `solve`, and if there is no solution yet.
        """

    def shift(self, last: int) -> None:
        """Moves the horizon of the problem on by a knot, as an MPC does after each step, and the last solution
        with it.

        `resume` then starts from there. Knot t becomes knot t − 1, with the costs and limits of its own; the
        last one is served by a model of the problem, with those that it has for all knots. The last state follows
        from the last control, which is repeated. At a second shift without a step of a solve in between the last
        state is repeated too, as a rollout by repeated controls would diverge.

        last: the index of that model.

        Raises `ProblemError` if there is no such model.
        """

    def solve(
        self,
        xs: ArrayLike,
        us: _Controls,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
    ) -> Solution:
        """Solves the problem from a warm start, and returns a `Solution`, whose status says how the solve ended.

        Other threads run meanwhile. Signals are looked at some forty times a second, between the phases of an
        iteration: what a handler raises, as KeyboardInterrupt, is raised here, and `solution` then is the best
        iterate, from which `resume` goes on.

        xs: states, (N + 1, nx); they need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays where knots differ in nu.
        callback: a function that is called with the `Iteration` after each; where it returns False the solve ends
            ("interrupted"). What it raises is raised here.
        verbose: whether to print a line for each iteration.
        progress: whether to show the progress, by tqdm where that is installed, else as lines.

        Raises `ProblemError` for numbers or settings that make no sense, and what an `Action` raises.
        """

@final
class FreeDynamics:
    """A knot of a robot that moves freely under its joints' efforts.

    q̈ = aba(q, v, S u); by semi-implicit Euler v⁺ = v + q̈ Δt, q⁺ = q ⊕ (v Δt + q̈ Δt²), cost Δt Σ w a(r); the state is
    x = (q, v).

    model: the robot.
    dt: Δt in seconds, or None for a terminal knot: no controls, cost Σ w a(r).
    costs: a list of `Cost`.
    costs_at: lists of `Cost` by the number of a knot, for knots with costs of their own; so one action serves a phase.
    actuation: S, (nv, nu); by default each joint but a free-flyer at the root has a control.
    integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
    lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
    limits: a list of `Limit`, or None; `AugmentedLagrangian` holds them.
    limits_at: lists of `Limit` by the number of a knot, for knots with limits of their own.
    controls: how they go through the knot's time: 'constant', 'linear' or 'quadratic'. The knot then has 1, 2 or 3 times nu
        controls, the values u at the times 0 and Δt/2, or at 0, Δt/2 and Δt (by 'runge_kutta_3' 0, Δt/3 and 2 Δt/3);
        bounds hold at each of them.

    Raises `ProblemError` for a cost, a limit or drives that do not fit.
    """

    def __new__(
        cls,
        model: Model,
        dt: float | None,
        costs: Sequence[Cost],
        costs_at: dict[int, Sequence[Cost]] | None = None,
        actuation: ArrayLike | None = None,
        integrator: _Scheme = "semi_implicit_euler",
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        limits: Sequence[Limit] | None = None,
        limits_at: dict[int, Sequence[Limit]] | None = None,
        controls: _Polynomial = "constant",
    ) -> FreeDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> FreeDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """The efforts that hold the robot still at the state x, nu numbers."""

@final
class FrictionCone:
    """Coulomb's friction cone ‖f_t‖ ≤ μ f_n as a pyramid, with bounds on the normal force: lower ≤ A f ≤ upper.

    mu: μ; facets: the number of the pyramid's sides, even, 4 to 1000; inner: whether the pyramid lies inside of the cone;
    rotation: the surface's axes (its normal is z) along the contact's, (3, 3); least, greatest: bounds on the normal force
    (N), by default 0 and infinite.

    Raises `ProblemError` if μ is negative or not finite, facets is odd or not from 4 to 1000, or rotation is none.

    >>> condyle.optimal.FrictionCone(0.5).rows()[0]
    array([ 1. ,  0. , -0.5])
    """

    def __new__(
        cls,
        mu: float,
        facets: int = 4,
        inner: bool = False,
        rotation: ArrayLike | None = None,
        least: float = 0.0,
        greatest: float = ...,
    ) -> FrictionCone: ...
    @staticmethod
    def _from_json(text: str) -> FrictionCone: ...
    def bounds(self) -> tuple[_Array, _Array]:
        """The least and greatest values of A f."""

    def rows(self) -> _Array:
        """The matrix A, (facets + 1, 3)."""

@final
class ImpulseDynamics:
    """A knot at which contacts set in: q⁺ = q, v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v, cost Σ w a(r).

    There are no controls.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name.
    costs: a list of `Cost`; they look at the state before the impact.
    restitution: ε, 0 to 1.
    damping: μ (1/kg).
    limits: a list of `Limit`, or None; they too look at the state before the impact.

    Raises `ProblemError` as `ContactDynamics` does.
    """

    def __new__(
        cls,
        model: Model,
        contacts: dict[str, ContactConstraint],
        costs: Sequence[Cost],
        restitution: float = 0.0,
        damping: float = 0.0,
        limits: Sequence[Limit] | None = None,
    ) -> ImpulseDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> ImpulseDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """No controls: an impact has none."""

@final
class InverseDynamics:
    """A knot of a robot whose nv controls are its accelerations: q̈ = u, τ = rnea(q, v, u); otherwise as `FreeDynamics`.

    model: the robot.
    dt: Δt in seconds.
    costs: a list of `Cost`; `Residual.joint_effort` looks at τ, `Residual.undriven_effort` at its part that nothing drives.
    integrator, lower, upper, limits, controls: as of `FreeDynamics`.

    Raises `ProblemError` for a cost or a limit that does not fit.
    """

    def __new__(
        cls,
        model: Model,
        dt: float,
        costs: Sequence[Cost],
        integrator: _Scheme = "semi_implicit_euler",
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        limits: Sequence[Limit] | None = None,
        controls: _Polynomial = "constant",
    ) -> InverseDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> InverseDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """The accelerations that hold the robot still: nv zeros."""

@final
class Limit:
    """Bounds on a residual r of a robot, lower ≤ r ≤ upper, which `AugmentedLagrangian` holds.

    Limits hold at the beginning of a knot. To `Fddp` alone they are costs for leaving the bounds.

    name: what errors call it.
    residual: a `Residual`.
    lower, upper: as many numbers as r has, infinite where there is no bound; None is no bound. If both are None, a cone
        or a centre of pressure has its own bounds, and any other r is 0. Entries where both are equal are equalities.

    >>> from condyle.optimal import Limit, Residual
    >>> Limit("effort", Residual.control([0.0] * 7), lower=[-30.0] * 7, upper=[30.0] * 7)
    <condyle.optimal.Limit 'effort'>
    """

    def __new__(
        cls, name: str, residual: Residual, lower: ArrayLike | None = None, upper: ArrayLike | None = None
    ) -> Limit: ...

@final
class Lqr:
    """An action with linear dynamics and a quadratic cost: x⁺ = A x + B u + f, ½ xᵀQx + xᵀSu + ½ uᵀRu + qᵀx + rᵀu, lower ≤
    u ≤ upper.

    A, Q: (nx, nx); B, S: (nx, nu); R: (nu, nu); f, q: nx numbers; r, lower, upper: nu. What is None is zero, or no
    bound; without R and B it has no controls, as at a terminal knot. nx and nu are at most 4096.

    >>> from condyle.optimal import Lqr
    >>> knot, end = Lqr([[1.0]], B=[[1.0]], Q=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[1.0]])
    """

    def __new__(
        cls,
        A: ArrayLike,
        B: ArrayLike | None = None,
        f: ArrayLike | None = None,
        Q: ArrayLike | None = None,
        S: ArrayLike | None = None,
        R: ArrayLike | None = None,
        q: ArrayLike | None = None,
        r: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Lqr: ...

@final
class Problem:
    """An optimal control problem: knots from x0, each served by one of some models, and a terminal one.

    x0: the initial state, nx numbers.
    models: a list of `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`, `InverseDynamics`, `ContactInverseDynamics`,
        `Action`, `DifferentialAction`, `ConstrainedAction`, `Lqr`, `Unicycle`.
    stages: for each knot the index of its model; None for an action for each knot, in their order. Consecutive knots of one
        model are computed as a group, and so are those of models of a robot that differ in their costs and limits only.
    terminal: the model of the end, without controls.

    Raises `ProblemError` if they do not fit together, if x0 is not finite or a rotation in it has not the length 1 (up to
    1e-3), and for more than 2²⁰ knots, 4096 numbers in a state or in the controls of a knot, or 2²⁸ in the matrices [A B] of
    all knots.
    """

    def __new__(
        cls, x0: ArrayLike, models: Sequence[_Action], stages: Sequence[int] | None, terminal: _Action
    ) -> Problem: ...
    @property
    def horizon(self) -> int:
        """The number of knots before the terminal one, N."""

    @property
    def ndx(self) -> int:
        """The number of numbers of a change of a state."""

    @property
    def nx(self) -> int:
        """The number of numbers of a state."""

    @property
    def x0(self) -> _Array:
        """The initial state, nx numbers; `set_x0` sets it."""

    def _evaluate(self, xs: ArrayLike, us: _Controls, moved: int) -> Evaluation:
        """The evaluation of a solution, unless the horizon has moved on since."""

    @staticmethod
    def _from_parts(x0: ArrayLike, parts: Sequence[Any], stages: Sequence[int] | None) -> Problem: ...
    def derivatives(self, xs: ArrayLike, us: _Controls) -> list[LqNode]:
        """The linear-quadratic problem around states and controls, a list of N + 1 `LqNode`s, which a `Sweep` solves.

        xs, us: as of `evaluate`.
        """

    def evaluate(self, xs: ArrayLike, us: _Controls) -> Evaluation:
        """The cost of states and controls, and what the dynamics compute there, as an `Evaluation`.

        xs: states, (N + 1, nx); they need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays where knots differ in nu.
        """

    @staticmethod
    def from_json(text: str) -> Problem:
        """A problem of a robot from the text that `to_json` gave.

        Raises `ProblemError` for a text that is none, for what does not fit together in it, and for sizes beyond the limits
        that `Problem` has.
        """

    def quasi_static(self, xs: ArrayLike) -> _Array | list[_Array]:
        """The controls of all knots that hold their states still, each by itself, as far as they can: (N, nu), or a list of N
        arrays where knots differ in nu. A robot's come from statics, others from steps of Newton.

        xs: states, (N + 1, nx).
        """

    def rollout(self, us: _Controls) -> _Array:
        """The states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).

        us: (N, nu), or a list of N arrays where knots differ in nu.

        Other threads run meanwhile; what a handler of a signal raises, as KeyboardInterrupt, ends it between knots.
        """

    def set_costs(self, knot: int, costs: Sequence[Cost]) -> None:
        """Gives a knot costs of its own, between solves: an MPC's new targets. They move with their knot at a `shift`.

        knot: its number, 0 to N; N is the terminal one.
        costs: a list of `Cost`.

        Raises `ProblemError` for a term that does not fit, and if the knot's action is not of a robot.
        """

    def set_weight(self, name: str, weight: float) -> None:
        """Changes the weight of the terms called `name`, between solves: of all knots, the terminal one included.

        Raises `KeyError` if there is no such term, `ProblemError` if the weight is negative or not finite.
        """

    def set_x0(self, x0: ArrayLike) -> None:
        """Sets the initial state, nx numbers, as an MPC does before each solve.

        Raises `ProblemError` for a number that is not finite, and for a rotation whose length is not 1 (up to 1e-3).
        """

    def to_json(self) -> str:
        """The problem and its robot as JSON, with the present initial state, weights and stages. An infinite bound is
        null.

        Raises `ProblemError` if an action is an `Lqr`, an `Action` or a `ConstrainedAction`, or knots are of different
        robots.
        """

@final
class Residual:
    """A residual: a vector r(x, u) of a robot, which a `Cost` makes small or a `Limit` bounds.

    A frame is given by its name or number in a model, a contact by the name that it has in `ContactDynamics`,
    `ContactInverseDynamics` or `ImpulseDynamics`. A residual keeps the name of its frame: in a problem of another robot it
    looks at the frame of that name, or is refused.
    A target that is not given is zero, a rotation the identity.

    >>> from condyle.optimal import Residual
    >>> Residual.center_of_mass([0.4, 0.2, 0.5])
    <condyle.optimal.Residual {"center_of_mass":{"target":{"x":0.4,"y":0.2,"z":0.5}}}>
    """

    @staticmethod
    def _from_json(text: str) -> Residual: ...
    @staticmethod
    def center_of_mass(target: ArrayLike) -> Residual:
        """The deviation of the centre of mass from a target, r = c − target, 3 numbers in the world (m)."""

    @staticmethod
    def center_of_pressure(contact: str, size: _Size, rotation: ArrayLike | None = None) -> Residual:
        """The centre of pressure of a rigid contact in a rectangle: four numbers, none above 0 while it is inside.

        size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes along the contact's,
        (3, 3).
        """

    @staticmethod
    def centroidal_momentum(target: ArrayLike | None = None) -> Residual:
        """The deviation of the momentum about the centre of mass from a target, r = h − target, 6 numbers along the
        world's axes, linear first.
        """

    @staticmethod
    def contact_acceleration(contact: str) -> Residual:
        """The acceleration of a contact where accelerations are controls, r = J q̈ + γ along the axes of its rows: 1, 2, 3 or 6
        numbers, 0 while it holds.
        """

    @staticmethod
    def contact_force(contact: str, target: ArrayLike | None = None) -> Residual:
        """The deviation of a contact's force or impulse from a target, r = λ − target, along the axes of its rows: 1, 2, 3 or 6
        numbers; target has 6.
        """

    @staticmethod
    def control(reference: ArrayLike) -> Residual:
        """The deviation of the controls from a reference, r = u − reference, nu numbers."""

    @staticmethod
    def control_gravity() -> Residual:
        """The efforts and forces beyond those that hold the robot still, r = τ − g(q) + Jᵀλ, nv numbers."""

    @staticmethod
    def frame_placement(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """The deviation of a frame's pose from a target, r = log(target⁻¹ oMf), 6 numbers, linear first; target is a
        homogeneous 4 × 4 matrix.
        """

    @staticmethod
    def frame_rotation(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """The deviation of a frame's axes from a target, r = log(targetᵀ R), 3 numbers; target is a 3 × 3 matrix."""

    @staticmethod
    def frame_translation(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """The deviation of a frame's origin from a target, r = p − target, 3 numbers in the world (m)."""

    @staticmethod
    def frame_velocity(
        model: Model, frame: str | int, target: ArrayLike | None = None, reference: ArrayLike = "local"
    ) -> Residual:
        """The deviation of a frame's velocity from a target, r = v − target, 6 numbers, linear first; reference: 'local',
        'world' or 'local_world_aligned'.
        """

    @staticmethod
    def friction_cone(contact: str, cone: FrictionCone) -> Residual:
        """The rows r = A f of a friction cone, for a contact's force f."""

    @staticmethod
    def impulse_center_of_mass() -> Residual:
        """The jump of the centre of mass's velocity at an impact, r = J_c (v⁺ − v), 3 numbers (m/s)."""

    @staticmethod
    def joint_acceleration(reference: ArrayLike) -> Residual:
        """The deviation of the joint accelerations from a reference, r = q̈ − reference, nv numbers."""

    @staticmethod
    def joint_effort(reference: ArrayLike) -> Residual:
        """The deviation of the efforts of all joints from a reference, r = τ − reference, nv numbers."""

    @staticmethod
    def own(
        size: int,
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], Any],
        calc_diff: Callable[[int, _Array, _Array], tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> Residual:
        """A residual that is written in Python, r(t, x, u) of a knot t, size numbers.

        size: the number of entries, at most 4096.
        calc: a function of (t, x, u) that returns them; x = (q, v), and at the end u is empty.
        calc_diff: a function of (t, x, u) that returns (∂r/∂x, ∂r/∂u) of shapes (size, 2 nv) and (size, nu), in the tangent
            space of the state. Without it, those of calc, as for `Action`.

        >>> from condyle.optimal import Residual
        >>> power = Residual.own(7, lambda t, x, u: x[7:] * u)
        """

    @staticmethod
    def own_cost(
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], Any],
        calc_diff: Callable[[Any, _Array, _Array], dict[str, ArrayLike]] | None = None,
    ) -> Residual:
        """A cost that is written in Python, a number ℓ(t, x, u) of a knot t with a Hessian of its own, as a residual of one
        entry; a `Cost` of it is weight · ℓ, by `Activation.sum()`, which it has by default.

        calc: a function of (t, x, u) that returns ℓ; x = (q, v), and at the end u is empty.
        calc_diff: a function of (t, x, u) that returns a dict of what is not zero among q, r, Q, S, R: the gradient and the
            Hessian of ℓ by x, in the tangent space of the state, and by u. Without it, those of calc, as for `Action`.

        Knots with such a cost are solved by their controls, not in inverse-dynamics form.

        >>> from condyle.optimal import Cost, Residual
        >>> swing = Cost("swing", 2.0, Residual.own_cost(lambda t, x, u: 1.0 - np.cos(x[0])))
        """

    @staticmethod
    def state(reference: ArrayLike) -> Residual:
        """The deviation of the state from a reference, r = x ⊖ reference, 2 nv numbers; reference = (q, v)."""

    @staticmethod
    def undriven_effort() -> Residual:
        """The efforts that inverse dynamics finds where nothing drives the robot, r = Nᵀτ with Nᵀ S = 0; of a floating base the 6
        numbers of the force on it. They are 0 in a motion that is possible.
        """

    @staticmethod
    def wrench_cone(contact: str, cone: WrenchCone) -> Residual:
        """The rows r = A w of a wrench cone, for a rigid contact's wrench w."""

@final
class Sweep:
    """The backward Riccati sweep over a horizon of linear-quadratic knots: a step of `Fddp` without its line search.

    nodes: a list of `LqNode`s, as `Problem.derivatives` gives them; the last is the terminal one, without controls.

    Raises `ProblemError` if their shapes do not fit together.

    >>> from condyle.optimal import Lqr, Problem, Sweep
    >>> knot, end = Lqr([[1.0]], B=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[2.0]])
    >>> problem = Problem([1.0], [knot], [0], end)
    >>> result = Sweep(problem.derivatives([[1.0], [1.0]], [[0.0]])).run()
    >>> bool(abs(result.K[0][0, 0] + 2 / 3) < 1e-15)  # δu = −⅔ δx
    True
    """

    def __new__(cls, nodes: Sequence[LqNode]) -> Sweep: ...
    def run(self, regularisation: float = 0.0) -> SweepResult:
        """The feedback and the value functions, as a `SweepResult`.

        regularisation: what is added to the diagonals of Quu and Vxx, at least 0.

        Raises `ProblemError` if Quu of a knot is not positive definite.
        """

@final
class Unicycle:
    """The action of a unicycle: x = (x, y, θ), u = (v, ω), x⁺ = x + Δt (v cos θ, v sin θ, ω).

    The cost is ½ (w₁² ‖x‖² + w₂² ‖u‖²); these are the rules of Crocoddyl's `ActionModelUnicycle`.

    dt: Δt (s), above 0.
    weights: w₁ and w₂.
    terminal: whether it is an action of the end, without controls.

    >>> from condyle.optimal import Fddp, Problem, Unicycle
    >>> problem = Problem([-1.0, -1.0, 1.0], [Unicycle()], [0] * 20, Unicycle(terminal=True))
    >>> Fddp(problem).solve(np.zeros((21, 3)), np.zeros((20, 2))).status
    'converged'
    """

    def __new__(cls, dt: float = 0.1, weights: tuple[float, float] = ..., terminal: bool = False) -> Unicycle: ...

@final
class WrenchCone:
    """The wrench cone of a rectangular sole: friction, centre of pressure within the rectangle, and yaw moment, lower ≤ A
    w ≤ upper.

    friction: a `FrictionCone`; size: the rectangle's sides along the surface's x and y (m).

    Raises `ProblemError` if a side is negative or not finite.

    >>> from condyle.optimal import FrictionCone, WrenchCone
    >>> WrenchCone(FrictionCone(0.7), [0.2, 0.1]).rows().shape
    (17, 6)
    """

    def __new__(cls, friction: FrictionCone, size: _Size) -> WrenchCone: ...
    @staticmethod
    def _from_json(text: str) -> WrenchCone: ...
    def bounds(self) -> tuple[_Array, _Array]:
        """The least and greatest values of A w."""

    def rows(self) -> _Array:
        """The matrix A, (facets + 13, 6)."""

def joint_torque_regressor(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """The joint torque regressor Y(q, v, a), (nv, 10 (nbodies − 1)), with τ = Y π: `rnea` as a linear function of
    `Model.inertial_parameters`; O(n depth).

    q: nq numbers; v, a: nv. Ten columns for each body but the world. With the rotors τ = Y π + armature a, and for the
    linear coordinates of a free joint armature (a + ω × v) in place of armature a.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
    >>> Y = condyle.joint_torque_regressor(arm, data, q, v, a)
    >>> np.allclose(Y @ arm.inertial_parameters, condyle.rnea(arm, data, q, v, a))
    True
    """

def kinetic_energy_regressor(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """The kinetic energy regressor y(q, v), 10 (nbodies − 1) numbers, with T = y · π: `kinetic_energy`, without the
    rotors, as a linear function of `Model.inertial_parameters`; O(n).

    q: nq numbers; v: nv.
    """

def passive_torque(model: Model, q: ArrayLike, v: ArrayLike, smoothing: float, out: _Array | None = None) -> _Array:
    """The passive torque τ = −d v − f tanh(v/ε) + springs + gravity compensation, nv numbers (N m, N): damping d, which may be
    d₀ + d₁ |v| + d₂ v², smoothed friction f, and what acts by itself in the robot; O(n).

    q: nq numbers; v: nv; smoothing: ε > 0, the speed (rad/s, m/s) at which friction is 76 % of f. A spring acts with
    −(k₀ + k₁ Δ + k₂ Δ²) Δ against the displacement Δ from its rest (joints of several degrees of freedom: |Δ| in the brackets). The laws are those of MuJoCo's `qfrc_passive`. No other
    function adds them: add them to τ where they should act.

    >>> arm = condyle.robots.arm7()
    >>> q, v = np.zeros(7), np.ones(7)
    >>> np.allclose(condyle.passive_torque(arm, q, v, 1e-3), -arm.damping - arm.friction)
    True
    """

def passive_torque_derivatives(
    model: Model, q: ArrayLike, v: ArrayLike, smoothing: float, out: tuple[_Array, _Array] | list[_Array] | None = None
) -> PassiveDerivatives:
    """The derivatives of `passive_torque`, exact, as `PassiveDerivatives(dtau_dq, dtau_dv)`, each (nv, nv).

    q: nq numbers; v: nv; smoothing: ε > 0 (rad/s, m/s). ∂τ/∂v is diagonal but for free joints with friction or polynomial
    damping; ∂τ/∂q has a block for each spring, and couples joints where gravity is compensated.

    >>> arm = condyle.robots.arm7()
    >>> d = condyle.passive_torque_derivatives(arm, np.zeros(7), np.ones(7), 1e-3)
    >>> np.allclose(d.dtau_dv, -np.diag(arm.damping)), not d.dtau_dq.any()  # it has no springs
    (True, True)
    """

def potential_energy_regressor(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """The potential energy regressor y(q), 10 (nbodies − 1) numbers, with V = y · π: `potential_energy` as a linear
    function of `Model.inertial_parameters`; O(n).

    q: nq numbers.
    """

def arm7() -> Model:
    """A seven-axis arm with a fixed base, nq = nv = 7; its last frame is `tool`.

    >>> condyle.robots.arm7()
    <condyle.Model 'arm7': 7 bodies, nq = 7, nv = 7>
    """

def humanoid() -> Model:
    """A humanoid of thirty-two joints on a free-flyer, nq = 39, nv = 38, with soles `left_sole`, `right_sole`.

    >>> condyle.robots.humanoid()
    <condyle.Model 'humanoid': 33 bodies, nq = 39, nv = 38>
    """

def quadruped() -> Model:
    """A quadruped of twelve joints on a free-flyer, nq = 19, nv = 18, with point feet `LF_foot`, `LH_foot`, `RF_foot`,
    `RH_foot`.

    >>> condyle.robots.quadruped()
    <condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>
    """

@final
class Simulation:
    """A simulation of a robot: its state, and the memory to move it on.

    Along q(t) = q₀ ⊕ ξ(t) the equations of motion are q̇ = v (in the body's frame) and v̇ = aba(q, v, τ). τ and the
    external forces stay as they are during a step.

    model: the robot; it stands still at `neutral`, at time 0.
    integrator: 'semi_implicit_euler', order 1: fit for damped robots and short horizons; 'runge_kutta_4', order 4,
        whose energy drifts by O(h⁴) per second; 'variational', order 2, symplectic: the energy does not drift, momentum
        is conserved to rounding.
    dt: h, the length of a step (s), above 0.
    passive: the smoothing ε of `passive_torque` (rad/s, m/s), if damping, friction, springs and gravity compensation are to
        act; None for none of these.
    tolerance: Newton's method ('variational') ends once the momenta balance to within this part of their sum.
    max_iterations: Newton's method gives up after this number of iterations.
    ground: a `Ground` on which the robot stands, slides and lands, with 'semi_implicit_euler' only; None for none.

    A simulation can be copied and pickled, and the copy goes on with the same bits.

    Raises `ModelError` if M is singular or the ground cannot be, `ValueError` if dt is not above 0 or not finite, or
    tolerance is negative.

    >>> from condyle.simulation import Simulation
    >>> quadruped = condyle.robots.quadruped()
    >>> simulation = Simulation(quadruped, dt=1e-3)
    >>> def damper(now):
    ...     now.tau[8] = -0.5 * now.v[8]
    >>> simulation.run(100, damper)
    'done'
    >>> bool(abs(simulation.q[2] + 0.5 * 9.81 * 0.1**2) < 2e-3)  # it has fallen ½ g t²
    True
    """

    def __new__(
        cls,
        model: Model,
        integrator: _Integrator = "semi_implicit_euler",
        dt: float = 0.001,
        passive: float | None = None,
        tolerance: float = 1e-09,
        max_iterations: int = 20,
        ground: Ground | None = None,
    ) -> Simulation: ...
    @property
    def contacts(self) -> GroundContacts:
        """The contacts of the ground's points in the last step, as `GroundContacts`."""

    @property
    def ground(self) -> Ground | None:
        """The ground on which the robot stands, as a `Ground` of single points; None if there is none."""

    @property
    def q(self) -> _Array:
        """The position, nq numbers."""

    @property
    def time(self) -> float:
        """The time since the state was set: the sum of the steps (s)."""

    @property
    def v(self) -> _Array:
        """The velocity, nv numbers."""

    def __reduce__(self) -> tuple[Any, ...]:
        """The parts of a pickle: what the constructor takes, and the state."""

    def __setstate__(self, state: tuple[float, list[float], list[float], list[float]]) -> None:
        """The state of a pickle."""

    def run(self, steps: int, control: Callable[[Control], None] | None = None) -> _Status:
        """A number of steps, with a control law that is called before each of them. Ends early when a step is not taken, and
        returns its status; else 'contacts_not_converged' if a step had it, or 'done'.

        control: a function of a `Control`, which sets the numbers of its `tau` and `f_ext` in place; None for no
            efforts, then other threads run meanwhile.

        What a handler of a signal raises, as KeyboardInterrupt, ends the run after a step, whose state is kept.
        """

    def set_state(self, q: ArrayLike, v: ArrayLike) -> None:
        """Sets the position q (nq numbers) and the velocity v (nv numbers), and the time to 0.

        Raises `ModelError` if a number of q is not finite or a rotation in it does not have the length 1 (up to 1e-3),
        `ValueError` if one of v is not finite.
        """

    def step(self, tau: ArrayLike, f_ext: ArrayLike | None = None) -> _Status:
        """A step under constant efforts and forces. Returns 'done'; 'not_converged' if Newton's method did not reach the
        tolerance (a shorter step helps); 'contacts_not_converged' if the ground's impulses break the laws of contact by
        more than the ground's tolerance, and then the step was taken; or 'not_finite', and then it was not.

        tau: nv numbers (N m, N); f_ext: as for `rnea`.
        """

@disjoint_base
class _SpelledData:
    """The scratch of a model under another spelling, and the state that the functions of a joint or a frame are for."""

    def __new__(cls, model: _SpelledModel) -> _SpelledData: ...
    @property
    def _frame_poses(self) -> _Array:
        """The poses of the bodies that frames are seen at: those of the last `updateFramePlacements`, (njoints, 4, 4)."""

    @property
    def _given(self) -> int:
        """How many of q, v and a the last `forwardKinematics` was given."""

    @property
    def _ours(self) -> Data:
        """The `condyle.Data`."""

    @property
    def _poses(self) -> _Array:
        """The poses of the bodies at the last `forwardKinematics`, (njoints, 4, 4)."""

    @property
    def _state(self) -> tuple[_Array, _Array, _Array]:
        """q, v and a of the last `forwardKinematics`, with zeros for what it was not given."""

    @property
    def com(self) -> list[_Array]:
        """The centre of mass, in a list."""

    @property
    def hg(self) -> Force:
        """The centroidal momentum."""

    def _leave(self, com: _Array, hg: Force) -> None:
        """Leaves a centre of mass and a centroidal momentum here."""

@disjoint_base
class _SpelledModel:
    """A `condyle.Model` under another spelling."""

    def __new__(cls, model: Model) -> _SpelledModel: ...
    @property
    def ours(self) -> Model:
        """The `condyle.Model`."""

def centerOfMass(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> _Array:
    """c, also data.com[0]; with v and a also data.vcom[0] and data.acom[0]."""

def computeCentroidalMomentum(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> Force:
    """hg, also data.hg."""

def computeCoriolisMatrix(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> _Array:
    """C with C v + g = h and Ṁ − 2 C skew-symmetric, also data.C."""

def computeFrameJacobian(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, frame_id: int, frame: ReferenceFrame | None = None
) -> _Array:
    """The Jacobian of a frame, (6, nv)."""

def computeGeneralizedGravity(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """g, also data.g."""

def computeMinverse(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """M⁻¹, also data.Minv."""

def _spelled_crba(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """M, both triangles, also data.M."""

def _spelled_difference(model: _SpelledModel, q0: ArrayLike, q1: ArrayLike) -> _Array:
    """q₁ ⊖ q₀."""

def forwardKinematics(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> None:
    """data.oMi; with v and a also data.v and data.a, in the bodies' frames."""

def framesForwardKinematics(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> None:
    """data.oMi and data.oMf."""

def getAcceleration(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """The spatial acceleration of a joint's body at the last forwardKinematics."""

def getClassicalAcceleration(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """r̈ and ω̇ of a joint's body at the last forwardKinematics."""

def getFrameAcceleration(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """The spatial acceleration of a frame at the last forwardKinematics."""

def getFrameClassicalAcceleration(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """r̈ and ω̇ of a frame at the last forwardKinematics."""

def getFrameJacobian(model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame) -> _Array:
    """The Jacobian of a frame at the last computeJointJacobians, (6, nv)."""

def getFrameVelocity(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """The velocity of a frame at the last forwardKinematics."""

def getJointJacobian(model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame) -> _Array:
    """The Jacobian of a joint's body at the last computeJointJacobians, (6, nv)."""

def getVelocity(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """The velocity of a joint's body at the last forwardKinematics."""

def _spelled_integrate(model: _SpelledModel, q: ArrayLike, v: ArrayLike) -> _Array:
    """q ⊕ v."""

def jacobianCenterOfMass(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """∂c/∂q, (3, nv), also data.Jcom."""

def nonLinearEffects(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> _Array:
    """C v + g, also data.nle."""

def updateFramePlacements(model: _SpelledModel, data: _SpelledData) -> None:
    """data.oMf of the last forwardKinematics."""

@final
class FrictionContact:
    """A contact with friction: what touches is held, and each force lies in the cone ‖f_t‖ ≤ μ f_n.

    Whether it touches at a tick, and how strongly, is said by `ContactTarget.activation`. Numbers are checked when a
    `WholeBodyController` is made.

    Common arguments:
    frame: the name of a frame of the robot.
    friction: μ, Coulomb's coefficient; above 0.
    min_force, max_force: least and greatest normal force of the whole contact (N).

    >>> from condyle.wholebody import FrictionContact
    >>> FrictionContact.sole("left_sole", 0.7, [0.2, 0.1]).corners.shape
    (4, 3)
    """

    @property
    def axes(self) -> Literal["world", "frame"]:
        """The axes along which the normal is given: 'world' or 'frame'."""

    @property
    def corners(self) -> _Array | None:
        """The corners of a surface in the frame (m), (n, 3); None of a point."""

    @property
    def forces(self) -> Literal["wrench", "corners"] | None:
        """What describes the force on a surface: 'wrench' or 'corners'; None of a point."""

    @property
    def frame(self) -> str:
        """The name of its frame."""

    @property
    def friction(self) -> float:
        """μ."""

    @property
    def max_force(self) -> float:
        """The greatest normal force (N)."""

    @property
    def min_force(self) -> float:
        """The least normal force (N)."""

    @property
    def normal(self) -> _Array:
        """The direction in which the environment pushes, 3 numbers."""

    @property
    def yaw_friction(self) -> float | None:
        """γ (m); None for the default."""

    @staticmethod
    def point(
        frame: str,
        friction: float,
        normal: ArrayLike | None = None,
        axes: Literal["world", "frame"] = "world",
        min_force: float = 0.0,
        max_force: float = ...,
    ) -> FrictionContact:
        """A point: the frame's origin is held, the frame may turn about it.

        normal: the direction in which the environment pushes, 3 numbers of any length but 0; None is z, level ground.
        axes: 'world', along which the normal is given and stays, or 'frame', with which it turns.
        """

    @staticmethod
    def sole(
        frame: str,
        friction: float,
        size: ArrayLike,
        forces: Literal["wrench", "corners"] = "wrench",
        yaw_friction: float | None = None,
        min_force: float = 0.0,
        max_force: float = ...,
    ) -> FrictionContact:
        """A rectangular sole about the frame's origin, whose normal is the frame's z.

        size: its sides along the frame's x and y (m); forces, yaw_friction: as of `surface`.
        """

    @staticmethod
    def surface(
        frame: str,
        friction: float,
        corners: ArrayLike,
        forces: Literal["wrench", "corners"] = "wrench",
        normal: ArrayLike | None = None,
        yaw_friction: float | None = None,
        min_force: float = 0.0,
        max_force: float = ...,
    ) -> FrictionContact:
        """An edge (two corners: the frame may turn about it) or a convex polygon (three or more: the frame is held).

        corners: in the frame, in their order around the polygon, in one plane across the normal (m), (n, 3).
        forces: 'wrench', a force with one friction cone, a centre of pressure within the polygon and a bounded moment about
            the normal; or 'corners', a force with a friction cone at each corner.
        normal: the direction in which the environment pushes, along the frame's axes, 3 numbers of any length but 0; None
            is z.
        yaw_friction: γ (m): the moment about the normal of a wrench is at most γ f_n. None is ⅔ μ r, r being the radius of
            the greatest disc about the corners' mean within the polygon; ½ μ l on an edge of length 2 l.
        """

@final
class Plan:
    """A planned motion with N + 1 knots: states at some times, efforts and gains between them, and which contacts touch when.

    `WholeBodyController.track` makes references of it. Between knots q runs along the joints' own groups, v and a = Δv / Δt
    are interpolated. Knots may share a time: then the velocity jumps there (an impact).

    model: the robot.
    times: N + 1 times, none smaller than the one before (s).
    states: (q, v) of the knots, (N + 1, nq + nv).
    touches: whether each of the controller's contacts touches from each knot to the next, (N, contacts).
    controls: efforts of the actuated coordinates (all but those of free-flyers) from each knot to the next, (N, nu); None
        if there are none.
    gains: K of u = ū + K (x ⊖ x̄), (N, nu, 2 nv); None if there are none.
    fade: the time over which a contact is loaded after it has begun to touch, and unloaded before it ends (s).

    Raises `ControllerError` for numbers that are not finite, for times that run backwards, and for states whose quaternions or
    pairs (cos, sin) do not have length 1.

    >>> from condyle.wholebody import Plan
    >>> robot = condyle.robots.quadruped()
    >>> x = np.r_[condyle.neutral(robot), np.zeros(18)]
    >>> plan = Plan(robot, [0.0, 0.5], [x, x], touches=np.ones((1, 4)))  # half a second on all feet
    >>> plan.span, plan.activation(0, 0.2)
    ((0.0, 0.5), 1.0)
    """

    def __new__(
        cls,
        model: Model,
        times: ArrayLike,
        states: ArrayLike,
        touches: ArrayLike,
        controls: ArrayLike | None = None,
        gains: ArrayLike | None = None,
        fade: float = 0.0,
    ) -> Plan: ...
    @property
    def span(self) -> tuple[float, float]:
        """The times of the first knot and of the last (s)."""

    def activation(self, contact: int, t: float) -> float:
        """The activation of a contact, by its number, at a time: 0 where it does not touch, ramped where it begins and ends
        to, else 1.
        """

    def feedback(self, t: float, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
        """The plan's own control at a state, τ = ū + K (x ⊖ x̄), nv numbers, 0 at a free-flyer.

        t: the time (s); q: nq numbers; v: nv.

        Raises `ValueError` if the plan has no controls, and `ModelError` for a state that is not finite or whose quaternions or pairs
        (cos, sin) do not have length 1.
        """

@final
class Task:
    """A quantity to be controlled: ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖² with a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v).

    What it aims at is in the `References`. Tasks of priority 0 come first; those of priority 1 decide only what they leave
    open, and so on. Within a priority the weights decide, and only their ratios matter. Numbers are checked when a
    `WholeBodyController` is made.

    Common arguments:
    weight: w, at least 0; None is the default of the task.
    gains: `Gains`, k (1/s²) and d (1/s); None is `Gains.critical(100.0)`.
    mask: which of its numbers count, as many as it has; None is all.
    axes: along whose axes these numbers are: 'world'; 'local', the frame's own (of tasks that move no frame, the world's);
        or ('frame', name), those of another frame.
    priority: 0 for the first; at most 2.

    >>> from condyle.wholebody import Task
    >>> Task.orientation("trunk", mask=[True, True, False])  # level, whatever its heading
    <condyle.wholebody.Task orientation 'trunk', weight 10>
    """

    @property
    def axes(self) -> _Axes:
        """Along whose axes its numbers are: 'world', 'local' or ('frame', name)."""

    @property
    def frame(self) -> str | None:
        """The name of its frame; None if it has none."""

    @property
    def gains(self) -> Gains:
        """k and d, `Gains`."""

    @property
    def joints(self) -> _Array:
        """Factors of the posture's weight, nv numbers; empty for all 1."""

    @property
    def kind(self) -> str:
        """The quantity: the name of what made it."""

    @property
    def mask(self) -> list[bool]:
        """Which of its numbers count."""

    @property
    def priority(self) -> int:
        """Its priority: 0 for the first."""

    @property
    def weight(self) -> float:
        """w."""

    @staticmethod
    def angular_momentum(
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """The rate of the angular momentum about the centre of mass (only the gain d acts): 3 numbers; weight 0.1."""

    @staticmethod
    def com(
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """The centre of mass, c̈: 3 numbers; weight 10."""

    @staticmethod
    def contact_force(
        frame: str, weight: float | None = None, mask: Sequence[bool] | None = None, priority: int = 0
    ) -> Task:
        """The force of the contact of this frame: 6 numbers, force and moment at the contact's centre along its axes (t₁, t₂,
        n), of which a point has 3; weight 1e-3. It has no gains, and does not act while the contact is off.
        """

    @staticmethod
    def orientation(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """A frame's rotation, ω̇: 3 numbers; weight 10."""

    @staticmethod
    def pose(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """A frame's origin and rotation, (p̈, ω̇): 6 numbers, linear first; weight 10."""

    @staticmethod
    def position(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """A frame's origin, p̈: 3 numbers; weight 10."""

    @staticmethod
    def posture(
        weight: float | None = None, gains: Gains | None = None, joints: ArrayLike | None = None, priority: int = 0
    ) -> Task:
        """The actuated joints, q̈; weight 0.1.

        joints: factors of the weight, one for each coordinate, nv numbers; None is all 1.
        """

    @staticmethod
    def velocity(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """The velocity of a frame's origin and rotation, whatever its pose (only the gain d acts): 6 numbers, linear first;
        weight 10.
        """

@final
class WholeBodyController:
    """A whole-body controller: at each tick a cone program gives the accelerations, contact forces and joint efforts that best
    do what the tasks ask.

        x = (q̈, f)
        minimise     ½ Σ w ‖J q̈ + J̇ v − a*‖²  +  ½ w_a ‖q̈‖²  +  ½ w_f ‖f − f_ref‖²
        subject to   Sᵤ (M q̈ + h − Jᵀ f) = 0            no motor acts on a free-flyer
                     J_c q̈ + J̇_c v = k (X_ref ⊖ X) − d v   contacts are held (k = d = 0 unless set)
                     ‖(f₁, f₂)‖ ≤ μ f_n                  friction, a second-order cone for each force
                     f_n p ∈ f_n · polygon, |τ_n| ≤ γ f_n   centre of pressure and yaw moment of a sole's wrench
                     f_min ≤ Σ f_n ≤ f_max               for each contact, ramped while it fades in or out
                     −τ̄ ≤ τ ≤ τ̄  with  τ = S (M q̈ + h − Jᵀ f)
                     bounds on q̈                         from limits of position and velocity: `JointLimits`

    Positions, velocities and accelerations of tasks and contacts are along the world's axes, accelerations classical. Memory
    is fixed here.

    model: the robot.
    contacts: a list of `FrictionContact`, each of another frame; empty for a robot in free fall.
    tasks: a list of `Task`.
    settings: `Settings`; None for the default ones.

    Raises `ModelError` for an unknown frame, and `ControllerError` for a frame that is a contact twice, for a force task
    without its contact, for any number outside of its range, and for an effort limit that is 0, of the model or the settings.

    A controller can be copied and pickled: the copy continues with the same bits; with the back end 'clarabel', whose solvers are
    built again, with the same solution up to its tolerance.

    >>> from condyle.wholebody import FrictionContact, Task, WholeBodyController
    >>> robot = condyle.robots.quadruped()
    >>> feet = [FrictionContact.point(f"{leg}_foot", 0.7) for leg in ("LF", "LH", "RF", "RH")]
    >>> controller = WholeBodyController(robot, feet, [Task.com(), Task.orientation("trunk"), Task.posture()])
    >>> knees = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2  # inwards
    >>> q = np.r_[0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0, knees]
    >>> command = controller.step(q, np.zeros(18), controller.hold(q)).solved()
    >>> lift = command.forces[:, 2].sum()
    >>> bool(abs(lift - 9.81 * robot.total_mass) < 0.1)  # the feet carry the weight
    True
    """

    def __new__(
        cls, model: Model, contacts: Sequence[FrictionContact], tasks: Sequence[Task], settings: Settings | None = None
    ) -> WholeBodyController: ...
    @property
    def command(self) -> Command:
        """The last `Command`; before the first step zeros."""

    @property
    def settings(self) -> Settings:
        """The settings, all of them: `Settings`."""

    def hold(self, q: ArrayLike) -> References:
        """The `References` that keep a position at rest: all tasks where they are, each contact held where it is and touching,
        the weight shared by the contacts in equal parts.

        q: nq numbers.

        Raises `ModelError` for numbers that are not finite, and for quaternions and pairs (cos, sin) that do not have length 1.
        """

    def optimality(self, q: ArrayLike, v: ArrayLike, references: References) -> Optimality:
        """How far the step at this state, for these references, is from the optimum of its program of the first priority:
        errors of the conditions of Karush, Kuhn and Tucker, below 1e-5 at the default tolerance, as `Optimality`. It must be the
        last step. For tests: it assembles the program anew.

        q: nq numbers; v: nv.
        references: `References` of this controller.
        """

    def step(self, q: ArrayLike, v: ArrayLike, references: References) -> Command:
        """The `Command` at a state. There always is one: without a solution it is a safe one, and its status says why.
        A number that is not finite is the status 'not_finite'; a quaternion, a pair (cos, sin) or a reference's rotation that is none
        is 'invalid_state', with the joint or the frame in the reason. Other threads run meanwhile.

        q: nq numbers; v: nv.
        references: `References` of this controller.
        """

    def track(self, plan: Plan, t: float, references: References) -> None:
        """Sets references to those of a plan at a time: joints, and where they bring centre of mass, momentum and frames;
        contacts by their activation, held where the plan has them, with shares of the force that the plan's c̈ takes.

        plan: a `Plan` of the same robot with as many contacts.
        t: the time (s); before the first and after the last knot the plan rests in it.
        references: `References` of this controller, which are changed.
        """

def _check_pose(name: str, pose: ArrayLike) -> None:
    """Raises `ValueError` unless the rotation of a pose, a (4, 4) matrix, is one."""

def _check_rotations(name: str, q: ArrayLike, rotations: Sequence[tuple[str, int, int]]) -> None:
    """Raises `ValueError` unless all rotations of a position have length 1; each is given by its joint and its range."""

def _controller_from_numbers(
    model: Model, contacts: Sequence[FrictionContact], tasks: Sequence[Task], settings: Settings, numbers: ArrayLike
) -> WholeBodyController:
    """The controller that a pickle holds. The model, which is one of its parts, checks the version."""
