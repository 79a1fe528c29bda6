"""Rigid-body dynamics with exact derivatives: the compiled part of `condyle`."""

# Written by python/stubs.py from the extension module. Do not edit.

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

from ._inertia import Inertia
from ._mpc import ArmWeights, PlanLimits, Report, Weights
from ._spelling import Force, Motion, ReferenceFrame
from ._types import (
    AbaDerivatives,
    AbaHessian,
    Actuator,
    AllTerms,
    AssemblySize,
    BoundGradients,
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
    Difference,
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
    LqKnot,
    ManyRollouts,
    Mimic,
    ModelWarning,
    Outcome,
    PassiveDerivatives,
    RecordedTick,
    RneaDerivatives,
    RneaHessian,
    RneaSecondDerivatives,
    SensitivityReport,
    Solution,
    Sphere,
    Spring,
    SweepResult,
)
from ._wholebody import Command, Gains, KktResiduals, References, Settings
from .distances import Geometry

__all__ = [
    "ARM7",
    "HUMANOID",
    "LEVEL",
    "QUADRUPED",
    "WORLD",
    "Action",
    "Activation",
    "ArmMpc",
    "AugmentedLagrangian",
    "BodyId",
    "Cholesky",
    "ConstrainedAction",
    "ConstraintSet",
    "ContactDynamics",
    "ContactInverseDynamics",
    "ControlRate",
    "ControllerError",
    "Cost",
    "Data",
    "DifferentialAction",
    "DivideConquer",
    "Error",
    "Fddp",
    "Foot",
    "FreeDynamics",
    "FreeInverseDynamics",
    "FrictionCone",
    "FrictionContact",
    "Gait",
    "HyperDual",
    "ImpulseDynamics",
    "InteriorPoint",
    "Joint",
    "JointPolicy",
    "Limit",
    "Lqr",
    "Ltdl",
    "Model",
    "ModelBuilder",
    "ModelError",
    "NotPhysicalError",
    "ParseError",
    "Plan",
    "Policy",
    "Problem",
    "ProblemError",
    "Record",
    "Residual",
    "Schedule",
    "Sensitivities",
    "Sensitivity",
    "Simulation",
    "Sweep",
    "Task",
    "Unicycle",
    "WholeBodyController",
    "WholeBodyMpc",
    "WrenchCone",
    "_Collisions",
    "_DifferentialIk",
    "_DistancePairs",
    "_GlobalIk",
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
    "_rnea_pull",
    "_solve_many",
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
    "rollout_many",
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
    | FreeInverseDynamics
    | ContactInverseDynamics
    | Lqr
    | Unicycle
    | Action
    | DifferentialAction
    | ConstrainedAction
    | ControlRate
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
    """Computes the acceleration q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i) (forward dynamics), nv numbers (rad/s², m/s²);
    O(n).

    q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`.

    Raises `ModelError` if M is singular at every position. M may also be singular at this position only, for example if
    a point mass lies on the axis of its joint. Then the acceleration is not finite, or is a large number caused by
    rounding errors.

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
    """Computes the acceleration of `aba` and its exact derivatives with respect to q, v and τ, as `AbaDerivatives(a,
    da_dq, da_dv, da_dtau)`: nv numbers and three matrices (nv, nv).

    q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`, constant in the
    bodies' frames. ∂q̈/∂q is taken in the tangent space, as the derivative of q̈ at `integrate(q, δ)` with respect to
    δ, at δ = 0. out: four arrays, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> data = condyle.Data(arm)
    >>> d = condyle.aba_derivatives(arm, data, [0.3] * 7, [0.1] * 7, [1.0] * 7)
    >>> np.array_equal(d.da_dtau, condyle.minv(arm, data, [0.3] * 7))
    True
    """

def coriolis_matrix(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the Coriolis matrix C(q, v) by Christoffel symbols: (nv, nv), with C v = h − g and Ṁ = C + Cᵀ; O(n depth).

    q: position, nq numbers; v: velocity, nv numbers.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
    >>> h, g = condyle.nonlinear_effects(arm, data, q, v), condyle.gravity(arm, data, q)
    >>> np.allclose(condyle.coriolis_matrix(arm, data, q, v) @ v, h - g)
    True
    """

def crba(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the joint-space inertia matrix M(q): (nv, nv), symmetric, both triangles filled, armature included; O(n
    depth).

    q: position, nq numbers. τ = M a + h; the kinetic energy is ½ vᵀ M v.

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
    """Computes forward dynamics, like `aba`, by the method that `method` names: the acceleration q̈, nv numbers (rad/s²,
    m/s²).

    q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`. method: 'aba', the
    articulated-body algorithm, O(n) for n coordinates; 'dense', a dense factor of M, O(n³); 'sparse', a factor of M
    that keeps the zeros of the tree, O(n d²) for depth d of the tree. None selects 'sparse' for a robot with mimic
    joints, and 'aba', the fastest method, for all other robots. All methods give the same numbers, up to rounding.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, tau = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [1.0] * 7
    >>> a = condyle.forward_dynamics(arm, data, q, v, tau, method="sparse")
    >>> np.allclose(a, condyle.aba(arm, data, q, v, tau))
    True
    """

def gravity(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the gravity efforts g(q) that hold the robot still, nv numbers: the efforts of `rnea` with v = a = 0.

    q: position, nq numbers.

    >>> quadruped = condyle.robots.quadruped()
    >>> g = condyle.gravity(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(g[2] - 9.81 * quadruped.total_mass) < 1e-9)  # the base carries the weight
    True
    """

def minv(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the inverse M(q)⁻¹ of the inertia matrix: (nv, nv), symmetric, both triangles filled. M itself is not
    computed.

    q: position, nq numbers.

    >>> arm = condyle.robots.arm7()
    >>> data, q = condyle.Data(arm), [0.3] * 7
    >>> np.allclose(condyle.minv(arm, data, q) @ condyle.crba(arm, data, q), np.eye(7))
    True
    """

def nonlinear_effects(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the nonlinear effects h(q, v) = C(q, v) v + g(q), nv numbers: the efforts of `rnea` with a = 0.

    q: position, nq numbers; v: velocity, nv numbers.
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
    """Computes the joint efforts τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i that produce the acceleration a (inverse dynamics),
    nv numbers (N m, N); O(n).

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: (nbodies, 6), a force on each body
    (N, then N m). Each force acts at the origin of its body and is expressed in the body's frame; row 0 belongs to the
    world.

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
    """Computes the exact derivatives of `rnea` with respect to q, v and a in O(n depth), as `RneaDerivatives(dtau_dq,
    dtau_dv, dtau_da)`, each (nv, nv).

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: as for `rnea`, constant in the
    bodies' frames. ∂τ/∂q is taken in the tangent space, as the derivative of τ at `integrate(q, δ)` with respect to δ,
    at δ = 0. out: three arrays, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> dtau_dq, dtau_dv, dtau_da = condyle.rnea_derivatives(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7)
    >>> dtau_dq.shape
    (7, 7)
    """

def static_torque(
    model: Model, data: Data, q: ArrayLike, f_ext: ArrayLike | None = None, out: _Array | None = None
) -> _Array:
    """Computes the efforts τ = g(q) − Σ Jᵢᵀ f_ext,i that hold the robot still under external forces, nv numbers (N m, N);
    O(n).

    q: position, nq numbers; f_ext: as for `rnea`. The result equals `rnea` with v = a = 0.
    """

@final
class BodyId:
    """The identity of a body in a builder, returned by `ModelBuilder.body` and other methods. `WORLD` is valid in every
    builder.
    """

@final
class ModelBuilder:
    """A builder that makes a `Model` body by body, parents first.

    Placements are homogeneous (4, 4) matrices; None is the identity. Inertias are `Inertia`; None is no mass.
    A builder makes Pinocchio's composite, universal and spherical ZYX joints as a `chain` of bodies. The chain has the
    same q and v, but each joint except the last adds a body without mass. `nbodies`, `names` and the rows of f_ext
    include these bodies.

    name: the name of the robot.

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
        """Adds an actuator that drives a joint, or a tendon over several joints; see `Actuator`. Limits, armature and
        damping belong to the joints; an actuator does not change these values.

        joint: the body that the joint carries; or, for a tendon, a list of (body, coefficient).
        tendon: the tendon's name, if the actuator drives a tendon.
        gear: one to six numbers; None is 1. gain: the force per unit of control. None means kp if kp is not 0, else kv
        if kv is not 0. If both are 0, None means 1, as for a motor. control, force: (minimum, maximum); None for no
        limits.
        """

    def append(self, parent: BodyId, placement: ArrayLike | None, model: Model, prefix: str = "") -> None:
        """Adds all bodies of another robot. The other robot's world has the pose `placement` in the frame of `parent`.
        `prefix` is added before all names of the other robot.

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

        name: the name of the body, and also of the joint unless `joint_name` is given.
        parent: the body to which the joint is attached.
        placement: the joint's frame at position zero, in the parent's frame.
        inertia: in the body's frame, which is the joint's frame at position zero.
        position: (minimum, maximum) position (rad, m), for joints with one coordinate; None for no limits.
        velocity: maximum speed (rad/s, m/s); None for no limit.
        effort: maximum effort (N m, N), or (minimum, maximum); None for no limits.
        damping: viscous friction (N m s/rad, N s/m). friction: Coulomb friction (N m, N).
        damping_polynomial: (d₁, d₂) of the damping coefficient d₀ + d₁|v| + d₂v², with d₀ = damping.
        armature: rotor inertia as seen at the joint (kg m², kg).
        """

    def build(self) -> Model:
        """Builds the model, and checks all data. The bodies are numbered depth first, and siblings in the order of the
        calls that added them. The builder cannot be used afterwards.

        Raises `ModelError` for invalid names, axes, masses or limits, for numbers that are not finite, and for a mimic
        joint with an invalid leader.
        """

    def chain(self, name: str, parent: BodyId, joints: _Joints, inertia: Inertia | None = None) -> BodyId:
        """Adds a body at the end of a chain of joints: a composite joint. The placement of each joint is relative to the
        frame of the previous joint.

        The coordinates of the joints follow one another in q and v. Bodies without mass, named `name#1`, `name#2`, and
        so on, connect the joints. Returns the last body, to which `inertia` belongs. A universal joint about unit
        vectors a and b is `[(Joint.revolute(a), placement), (Joint.revolute(b), None)]`.

        joints: a list of (joint, placement).
        """

    def compensate_gravity(
        self, body: BodyId, ratio: float = 1.0, part: Inertia | None = None, placement: ArrayLike | None = None
    ) -> None:
        """Supports a fraction of a body's weight, as MuJoCo's `gravcomp` does: the force −ratio m g acts at the centre of
        mass. If the inertia of the body changes later, the force changes with the inertia.

        ratio: the supported fraction of the weight; 1 supports the whole weight.
        part: None for the whole body, or the inertia of the part of the body to which `ratio` applies. The inertia of
            the body must include this inertia, which is given in a frame with the pose `placement` in the body's frame.
        """

    def frame(
        self,
        name: str,
        body: BodyId,
        placement: ArrayLike | None = None,
        kind: Literal["link", "joint", "user"] = "user",
    ) -> None:
        """Adds a frame with the pose `placement` in the body's frame. kind: 'link', 'joint' or 'user'. Frames of different
        kinds may have the same name.
        """

    def gravity(self, gravity: ArrayLike) -> None:
        """Sets the acceleration of free fall, 3 numbers in the world's frame (m/s²). The default is (0, 0, −9.81)."""

    def merge(self, body: BodyId, placement: ArrayLike | None, inertia: Inertia) -> None:
        """Adds an inertia to a body. The inertia is given in its own frame, which has the pose `placement` in the body's
        frame.
        """

    def mimic(self, follower: BodyId, leader: BodyId, ratio: float = 1.0, offset: float = 0.0) -> None:
        """Makes a joint follow another joint: the follower's position is ratio q + offset, where q is the leader's
        position. The follower has no coordinate in q.

        follower, leader: the bodies that the joints carry.
        """

    def spherical_zyx(
        self, name: str, parent: BodyId, placement: ArrayLike | None = None, inertia: Inertia | None = None
    ) -> BodyId:
        """Adds a body on a ball joint that turns by q₀ about z, then by q₁ about the new y axis, then by q₂ about the new
        x axis; v = q̇.

        M is singular where q₁ = ±π/2. `Joint.spherical` has no singular position.
        """

    def spring(self, body: BodyId, stiffness: ArrayLike, rest: ArrayLike) -> None:
        """Adds a spring to a joint: τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ with the displacement Δ = q ⊖ rest. For joints with several
        degrees of freedom, the brackets contain |Δ| instead of Δ.

        body: the body that the joint carries. stiffness: k₀, or k₀, k₁ and k₂. rest: the joint's position at which the
        spring is at rest, with as many numbers as the joint has in q.

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
    """Holds a slot of CasADi's interface that computes a function of a robot, until `_casadi_release`.

    function: 'rnea', 'aba', 'crba', 'forward_kinematics', 'frame_velocity', 'com', 'centroidal_momentum' or
    'constrained_dynamics'. states: number of states per call; arguments and results contain the columns of all states,
    one state after the other.

    Returns the name of the slot, from which CasADi derives the names of the symbols.
    """

def _casadi_hold_knot(of: Any, t: int | None) -> str:
    """Holds a slot until `_casadi_release`. The slot computes the next state and the cost of knot t of an action or of a
    problem. Without t, the index of the knot is an argument of the function.
    """

def _casadi_release(name: str) -> None:
    """Ends a hold of a slot; the slot stays in use as long as CasADi has objects for the slot's functions."""

def centroidal_map(
    model: Model, data: Data, q: ArrayLike, out: tuple[_Array, _Array, _Array, _Array] | list[_Array] | None = None
) -> CentroidalMap:
    """Computes the centroidal momentum matrix Ag(q), with hg = Ag v, and the centroidal inertia, the centre of mass and
    its Jacobian, in O(n), as `CentroidalMap(Ag, Ig, com, Jcom)`.

    q: position, nq numbers. Bodies fixed to the world are not included. The results are NaN if no moving body has a
    mass. out: four arrays, such as an earlier result.

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
    """Computes the centroidal momentum matrix Ag(q), its rate along v, and the momentum hg = Ag v, in O(n), as
    `CentroidalMapRate(Ag, dAg, hg, Ig, com, com_velocity, Jcom)`. The rate of hg is Ag a + dAg v.

    q: position, nq numbers; v: velocity, nv numbers. Bodies fixed to the world are not included. The results are NaN if
    no moving body has a mass. out: seven arrays, such as an earlier result.
    """

def centroidal_momentum(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the centroidal momentum hg of the moving bodies, about their centre of mass and along the world's axes: 6
    numbers (kg m/s, then kg m²/s); O(n).

    q: position, nq numbers; v: velocity, nv numbers.
    """

def centroidal_momentum_rate(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the rate of the centroidal momentum hg, along the world's axes: 6 numbers (N, then N m); O(n). The rate
    equals the sum of the weight and the external forces about the centre of mass.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
    """

def com(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the centre of mass c of the moving bodies in the world's frame, 3 numbers (m); O(n).

    q: position, nq numbers. Bodies fixed to the world are not included. The result is NaN if no moving body has a mass.

    >>> quadruped = condyle.robots.quadruped()
    >>> com = condyle.com(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(com[1]) < 1e-12)  # left and right weigh the same
    True
    """

def com_acceleration(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the acceleration c̈ of the centre of mass of the moving bodies in the world's frame, 3 numbers (m/s²);
    O(n). Gravity is not subtracted.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
    """

def com_jacobian(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the Jacobian Jcom(q) of the centre of mass, (3, nv), with ċ = Jcom v; O(n).

    q: position, nq numbers. The result is also a member of `centroidal_map`.
    """

def com_velocity(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the velocity ċ of the centre of mass of the moving bodies in the world's frame, 3 numbers (m/s); O(n).

    q: position, nq numbers; v: velocity, nv numbers.
    """

def compute_all_terms(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> AllTerms:
    """Computes all terms of the equations of motion in O(n depth), with one pass from the root to the tips and one back,
    as `AllTerms(M, h, centroidal, kinetic_energy, potential_energy)`.

    q: position, nq numbers; v: velocity, nv numbers. Up to rounding, the numbers equal `crba`, `nonlinear_effects`,
    `centroidal_map_rate`, `kinetic_energy` and `potential_energy`.

    >>> arm = condyle.robots.arm7()
    >>> terms = condyle.compute_all_terms(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7)
    >>> terms.M.shape, terms.h.shape, terms.centroidal.Ag.shape
    ((7, 7), (7,), (6, 7))
    """

def kinetic_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """Computes the kinetic energy T = ½ vᵀ M(q) v of the moving bodies and the rotors (J); O(n).

    q: position, nq numbers; v: velocity, nv numbers.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, np.full(7, 0.5)
    >>> np.isclose(condyle.kinetic_energy(arm, data, q, v), 0.5 * v @ condyle.crba(arm, data, q) @ v).item()
    True
    """

def mechanical_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """Computes the mechanical energy E = T + V (J); O(n).

    q: position, nq numbers; v: velocity, nv numbers. The rate of E is the power of the efforts and the external forces.
    """

def potential_energy(model: Model, data: Data, q: ArrayLike) -> float:
    """Computes the potential energy V = −m gᵀ c(q) of the moving bodies under gravity (J), 0 at the world's origin; O(n).

    q: position, nq numbers.
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
    partitions: int | None = None,
) -> tuple[str, list[tuple[str, str]], list[tuple[str, _Shapes, _Shapes, int, int]]]:
    """Generates the code of functions of a robot. Returns the name of the code, the files, and the functions with their
    arguments and results.
    """

def difference(model: Model, q0: ArrayLike, q1: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the tangent vector v = q₁ ⊖ q₀ with q₀ ⊕ v = q₁, nv numbers. For rotations, v is the shortest vector with
    this property.

    q0, q1: positions, nq numbers each.
    """

def difference_jacobian(
    model: Model, d: ArrayLike, argument: Literal["from", "to"], out: _Array | None = None
) -> _Array:
    """Computes the Jacobian ∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁ between tangent spaces: (nv, nv), block-diagonal. The
    Jacobian depends only on the difference of the positions.

    d: q₁ ⊖ q₀, nv numbers; argument: 'from' for q₀ or 'to' for q₁.
    """

def distance(model: Model, q0: ArrayLike, q1: ArrayLike) -> float:
    """Computes the distance ‖q₁ ⊖ q₀‖, in which lengths (m) and angles (rad) have equal weight.

    q0, q1: positions, nq numbers each.
    """

def integrate(model: Model, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the position q ⊕ v that is reached from q with the velocity v after one unit of time, nq numbers.

    q: position, nq numbers; v: tangent vector, nv numbers.

    >>> quadruped = condyle.robots.quadruped()
    >>> q0 = condyle.neutral(quadruped)
    >>> q1 = condyle.integrate(quadruped, q0, np.full(18, 0.1))
    >>> np.allclose(condyle.difference(quadruped, q0, q1), 0.1)
    True
    """

def integrate_jacobian(
    model: Model, v: ArrayLike, argument: Literal["position", "velocity"], out: _Array | None = None
) -> _Array:
    """Computes the Jacobian ∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v between tangent spaces: (nv, nv), block-diagonal. The Jacobian does
    not depend on q.

    v: tangent vector, nv numbers; argument: 'position' for q or 'velocity' for v.
    """

def interpolate(model: Model, q0: ArrayLike, q1: ArrayLike, t: float, out: _Array | None = None) -> _Array:
    """Computes the position q₀ ⊕ t (q₁ ⊖ q₀) on the path from q₀ (t = 0) to q₁ (t = 1) at constant velocity, nq numbers.

    q0, q1: positions, nq numbers each; t: a number, which may be below 0 or above 1.

    >>> condyle.interpolate(condyle.robots.arm7(), [0.0] * 7, [1.0] * 7, 0.25)
    array([0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25])
    """

def neutral(model: Model) -> _Array:
    """Returns the neutral position, nq numbers: zeros, and the identity for rotations.

    >>> condyle.neutral(condyle.robots.quadruped())[:7]
    array([0., 0., 0., 0., 0., 0., 1.])
    """

def normalize(model: Model, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Returns the position q with its quaternions and its pairs (cos, sin) scaled to length 1, nq numbers. The argument q
    does not change unless q is also `out`.

    q: position, nq numbers.

    Raises `ModelError` for a quaternion or a pair whose length is 0 or not finite.

    >>> quadruped = condyle.robots.quadruped()
    >>> q = condyle.neutral(quadruped)
    >>> q[6] = 2.0
    >>> np.array_equal(condyle.normalize(quadruped, q), condyle.neutral(quadruped))
    True
    """

def random_configuration(model: Model, seed: int | None = None) -> _Array:
    """Draws a random position, nq numbers: uniform between the limits, within ±3 (rad, m) for a coordinate without limits,
    and uniform over the whole group for rotations.

    seed: a number below 2⁶⁴; the same seed gives the same position. None draws a new seed from the system.
    """

def transport(model: Model, v: ArrayLike, X: ArrayLike, out: _Array | None = None) -> _Array:
    """Transports the columns of X, which are tangent vectors at q ⊕ v, to the tangent space at q: (∂(q ⊕ v)/∂q)⁻¹ X.

    v: tangent vector, nv numbers; X: a matrix of nv rows. Pinocchio's `dIntegrateTransport` multiplies X by ∂(q ⊕ v)/∂q
    instead. Its result equals `transport` with −v.

    >>> quadruped = condyle.robots.quadruped()
    >>> v = np.full(18, 0.1)
    >>> J = condyle.integrate_jacobian(quadruped, v, "position")
    >>> np.allclose(condyle.transport(quadruped, v, J), np.eye(18))
    True
    """

@final
class ConstraintSet:
    """Constraints of one model, contacts and loops, and the scratch memory of `constrained_dynamics` and similar
    functions.

    Make one set for each combination of contacts; all sets may share one `Data`. Only one thread at a time may use a
    set.

    With a regularisation μ > 0, the constraint forces λ solve (J M⁻¹ Jᵀ + μ 1) λ = b + μ λ'. J is the Jacobian of the
    constraints, M the inertia matrix, and b the right-hand side without regularisation. In the first iteration λ' is 0;
    in each later iteration λ' is the previous λ. Redundant constraints then share the forces, with the smallest norm of
    λ. Choose μ small compared with J M⁻¹ Jᵀ, such as 1e-8. With μ = 0 one iteration is exact, and rows that depend on
    earlier rows get no force. Source: Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained
    dynamic equations (2021).

    model: the robot; constraints: a list of `ContactConstraint`s; mu: μ (1/kg); iterations: the number of iterations, 1
    to 10000; all of them are computed.

    Raises `ModelError` if a frame does not exist, two frames do not move relative to each other, or two constraints are
    the same. Also raises `ModelError` if a reference frame is 'world', a gain is negative or not finite, a target is
    not finite, or the placement of a target is not a homogeneous matrix.

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
        """The number of rows of J, which is also the length of λ."""

    def __len__(self, /) -> int: ...
    @staticmethod
    def _from_json(model: Model, text: str, mu: float, iterations: int) -> ConstraintSet: ...
    def jacobian(self, out: _Array | None = None) -> _Array:
        """Returns the Jacobian J of the constraints, (rows, nv), at the state of the last call for a single state."""

    def range(self, k: int) -> slice:
        """Returns the rows of constraint k, as a slice."""

    def set_target(
        self,
        k: int,
        placement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
    ) -> None:
        """Changes the target of constraint k: placement, velocity and acceleration of the constraint's frame. Members that
        are not given do not change.

        Raises `ModelError` for numbers that are not finite and for an invalid placement; then the old target is kept.
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
    """Computes the acceleration q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i) and the forces λ that make J q̈ + γ = 0 (forward
    dynamics under constraints), as `Constrained(a, lambda_, residual, redundant)`. J is the Jacobian of the
    constraints. γ contains J̇ v, the stabilisation, and the constraints' target accelerations with a minus sign.

    constraints: a `ConstraintSet`; q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as
    for `rnea`. If constraints contradict each other, or a constraint cannot be satisfied at a singular posture, the
    results are finite and `residual` is above zero.

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
    """Computes the result of `constrained_dynamics` and its exact derivatives with respect to q, v and τ, as
    `ConstrainedDerivatives`.

    constraints: a `ConstraintSet`, whose targets are fixed; q: position, nq numbers; v, tau: velocity and efforts, nv
    numbers each; f_ext: as for `rnea`, constant in the bodies' frames. ∂/∂q is taken in the tangent space. out: one
    array for each member, such as an earlier result.

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
    """Computes the result of `constrained_dynamics` and the linear equations that relate changes of q, v and τ to the
    changes of q̈ and λ, as `ConstrainedEquations`:

        M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,    J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0

    Symbols are as for `constrained_dynamics`. `constrained_dynamics_derivatives` solves these equations; this function
    does not solve them. constraints: a `ConstraintSet`, whose targets are fixed and whose `jacobian` is J; q: position,
    nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`, constant in the bodies' frames.
    ∂/∂q is taken in the tangent space.
    out: one array for each member, such as an earlier result.

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
    """Computes the velocity v⁺ = v + M⁻¹ Jᵀ Λ after an impact, with the impulses Λ that make J v⁺ = −ε J v, as `Impulse(v,
    lambda_, residual, redundant)`. J is the Jacobian of the constraints, and M the inertia matrix.

    constraints: a `ConstraintSet`, whose gains and targets of velocity and acceleration are ignored; q: position, nq
    numbers; v: velocity, nv numbers; restitution: ε, 0 for frames that stick, 1 for an impact that loses no energy.

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
    """Computes the result of `impulse_dynamics` and its exact derivatives with respect to q and the velocity before the
    impact, as `ImpulseDerivatives`.

    constraints, q, v, restitution: as for `impulse_dynamics`. ∂/∂q is taken in the tangent space. out: one array for
    each member, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> hit = condyle.ConstraintSet(arm, [condyle.ContactConstraint("tool", "point")])
    >>> d = condyle.impulse_dynamics_derivatives(arm, condyle.Data(arm), hit, [0.3] * 7, [0.1] * 7)
    >>> np.allclose(d.dv_dv @ d.dv_dv, d.dv_dv)  # an impact that sticks is a projection
    True
    """

@final
class Data:
    """Scratch memory of the algorithms for one model: made once, and used by one thread at a time.

    A `Data` can be used with all models that have the same bodies and joints. Gravity, armature and inertias may
    differ. No algorithm reads results of an earlier call, so the order of calls does not matter. Use from two threads
    at once is a `RuntimeError`; use with another robot's model is a `ValueError`.

    model: the robot; threads: the number of threads for calls with many states (q of shape (N, nq)), at most 1024. Such
    calls also compute several states at once in SIMD lanes, and release the interpreter's lock.

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
    """Computes the exact Hessian of λᵀ q̈(q, v, τ), with q̈ of `aba`, as `AbaHessian(dqdq, dvdq, dvdv, dtaudq)`, each (nv,
    nv); the other blocks are zero.

    q: position, nq numbers; v, tau, lambda_: velocity, efforts and λ, nv numbers each; f_ext: as for `rnea`, constant
    in the bodies' frames. Entry [j, k] of dvdq is the derivative with respect to v_j and q_k, entry [j, k] of dtaudq
    with respect to τ_j and q_k. Derivatives with respect to q are derivatives with respect to δ at `integrate(q, δ)`.
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
    """Computes the derivative ∂q̈/∂(input) of `aba`, (nv, k), for an input of k numbers other than q, v and τ; exact, at
    most O(n²) per column.

    q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; wrt: as for `rnea_input_derivative`; f_ext:
    as for `rnea`.

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
    """Computes the derivatives ∂a/∂q and ∂a/∂v of a body's spatial acceleration, `(da_dq, da_dv)`, each (6, nv):
    `frame_acceleration_derivatives` of the body's own frame.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
    as for `frame_jacobian`.
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
    """Computes the derivative ∂v/∂q of a body's velocity, (6, nv): `frame_velocity_derivative` of the body's own frame.

    q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def centroidal_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    out: tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array] | list[_Array] | None = None,
) -> CentroidalDerivatives:
    """Computes the exact derivatives of the centroidal momentum, its rate and the centre of mass with respect to q, v and
    a in O(n), as `CentroidalDerivatives`.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each. The accelerations do not include gravity.

    >>> quadruped = condyle.robots.quadruped()
    >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), [0.0] * 18
    >>> d = condyle.centroidal_derivatives(quadruped, data, q, zero, zero)
    >>> np.allclose(d.drate_da, condyle.centroidal_map(quadruped, data, q).Ag)
    True
    """

def coriolis_derivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: tuple[_Array, _Array] | list[_Array] | None = None
) -> CoriolisDerivatives:
    """Computes the exact derivatives of C(q, v) v, the Coriolis and centrifugal efforts, in O(n depth), as
    `CoriolisDerivatives(dq, dv)`, each (nv, nv).

    q: position, nq numbers; v: velocity, nv numbers.

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
    """Computes the exact derivatives of kinetic energy T and potential energy V in O(n), as `EnergyDerivatives(dT_dq,
    dT_dv, dV_dq)`, nv numbers each.

    q: position, nq numbers; v: velocity, nv numbers.
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
    """Computes the derivatives ∂a/∂q and ∂a/∂v of a frame's spatial acceleration, `(da_dq, da_dv)`, each (6, nv). The
    derivative with respect to the joint accelerations is the frame's Jacobian.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
    reference: as for `frame_jacobian`.
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
    """Computes the derivatives ∂a/∂q and ∂a/∂v of a frame's classical acceleration, `(da_dq, da_dv)`, each (6, nv). The
    derivative with respect to the joint accelerations is the frame's Jacobian.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
    reference: as for `frame_jacobian`.
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
    """Computes the derivative ∂v/∂q of a frame's velocity, (6, nv), linear rows first. The derivative with respect to v is
    the frame's Jacobian.

    q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
    `frame_jacobian`.

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
    """Computes the exact Hessian of λᵀ τ(q, v, a), with τ of `rnea`, in O(n depth), as `RneaHessian(dqdq, dvdq, dvdv,
    dadq)`, each (nv, nv); the other blocks are zero.

    q: position, nq numbers; v, a, lambda_: velocity, acceleration and λ, nv numbers each; f_ext: as for `rnea`,
    constant in the bodies' frames. Entry [j, k] of dvdq is the derivative with respect to v_j and q_k, entry [j, k] of
    dadq with respect to a_j and q_k. Derivatives with respect to q are derivatives with respect to δ at `integrate(q,
    δ)`.

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
    """Computes the derivative ∂τ/∂(input) of `rnea`, (nv, k), for an input of k numbers other than q, v and a; exact, at
    most O(n) per column.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; wrt: the input; f_ext: as for `rnea`.
    Values of wrt: 'gravity', the acceleration of free fall, 3 numbers; 'armature', nv numbers; 'damping', nv numbers,
    as if `passive_torque` were added to τ; ('force', body), the external force on a body in the body's frame, 6
    numbers; ('inertia', body), the 10 inertial parameters of a body; or ('friction', smoothing), nv numbers, with the
    smoothing of `passive_torque`.

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
    """Computes the exact second derivatives of `rnea` as full tensors in O(n² depth), as `RneaSecondDerivatives(dqdq,
    dvdq, dvdv, dadq)`, each (nv, nv, nv): member[i] is the Hessian of τ_i.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: as for `rnea`. Each Hessian has
    the index order of `rnea_hessian`. If the product of the tensors with a vector is enough, `rnea_hessian` is many
    times faster.

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
    """Computes the exact derivative ∂τ/∂q of `static_torque`, (nv, nv), in O(n depth). Without external forces, ∂τ/∂q is
    also the derivative of `gravity`.

    q: position, nq numbers; f_ext: as for `rnea`, constant in the bodies' frames.
    """

@final
class _Collisions:
    """Collision shapes of a robot's file; see `condyle.distances.Collisions`.

    kind: 'urdf', 'mjcf' or 'sdf'; path or text: the file, or its text.
    """

    def __new__(cls, kind: str, path: _Path | None, text: str | None, packages: Sequence[_Path]) -> _Collisions: ...
    def _disable(self, first: str, second: str) -> None:
        """Disables the pairs of two links."""

    def _fit(self, kind: str) -> int:
        """Replaces meshes by shapes. Returns their number."""

    def _geometries(self) -> str:
        """Returns the geometries in JSON."""

    def _meshes(self) -> list[tuple[str, str, str]]:
        """Returns name, link and file of each mesh."""

    def _pairs(self, model: Model) -> str:
        """Returns the pairs that can collide, in JSON."""

    def _srdf(self, path: _Path | None, text: str | None) -> None:
        """Disables the pairs of links that an SRDF lists."""

    def _warnings(self) -> list[str]:
        """Returns the warnings as text."""

@final
class _DistancePairs:
    """Pairs of geometries, prepared for one robot; see `condyle.distances.DistancePairs`.

    model: the robot; text: a list of pairs in JSON.
    """

    def __new__(cls, model: Model, text: str) -> _DistancePairs: ...
    @property
    def cutoff(self) -> float:
        """The largest distance of interest (m)."""

    @cutoff.setter
    def cutoff(self, cutoff: float) -> None: ...
    def __len__(self, /) -> int: ...
    def _evaluate(self, model: Model, data: Data, q: ArrayLike, states: int, gradients: bool) -> list[_Array]:
        """Computes distances (N, n), points (N, n, 2, 3), normals (N, n, 3) and, if `gradients`, gradients (N, n, nv) of n
        pairs at N positions.
        """

    def _find(self, name: str) -> int | None:
        """Returns the index of the geometry with a name, or None."""

    def _place(self, geometry: int, placement: ArrayLike) -> None:
        """Sets the placement of a geometry."""

    def _replacements(self) -> list[tuple[int, int, str]]:
        """Returns (pair, side, kind) of each geometry that a capsule replaces."""

def _borrowed(capsule: Any) -> tuple[int, tuple[int, int, int], list[int], list[int] | None, tuple[int, int], int]:
    """Describes the array that a DLPack capsule lends. The caller must keep the capsule alive while it uses the array.
    This function does not take ownership of the array.
    """

def _lend(
    owner: Any, address: int, bits: int, shape: list[int], strides: list[int], device: int, versioned: bool
) -> Any:
    """Makes a DLPack capsule that lends floating-point numbers on a CUDA device. The owner of the numbers is kept alive
    until the borrower returns them.
    """

@final
class Cholesky:
    """The factor M = L Lᵀ of any symmetric positive definite matrix.

    `factorize` and `inverse` cost O(n³), `solve` O(n²). For the inertia matrix of a robot, use `Ltdl`, which has the
    same methods and skips the zeros of the tree. Source: Golub and Van Loan, Matrix Computations (4th edition),
    algorithm 4.2.1.

    n: the number of rows of M, at most 4096.

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
        """Computes the factor of M, a symmetric positive definite matrix. The docstring of the class states the
        cost.

        M is not checked: if M is not positive definite, solutions are wrong or not finite. An exception of a
        signal handler, such as KeyboardInterrupt, stops the computation between rows. After that no factor is
        available.
        """

    def inverse(self, out: _Array | None = None) -> _Array:
        """Returns the inverse M⁻¹, both triangles filled."""

    def solve(self, b: ArrayLike, out: _Array | None = None) -> _Array:
        """Solves M x = b; returns x, one number for each row of M.

        b: one number for each row of M.
        """

    def solve_matrix(self, B: ArrayLike, out: _Array | None = None) -> _Array:
        """Solves M X = B; returns X, column by column.

        B: a matrix with as many rows as M.
        """

@final
class DivideConquer:
    """Forward dynamics by the divide-and-conquer articulated-body algorithm: the plan for one model, and scratch memory.

    The robot is assembled from runs: groups of at most `grain` adjacent bodies, which are eliminated one after the
    other. With `grain` = 1 the algorithm takes O(log n) steps for n bodies. But joining two parts of the robot costs
    about six times as much as eliminating a body. With two threads and two runs, the algorithm is faster than `aba`
    from about 200 bodies on. With one thread it is always slower. For a robot with mimic joints, the passes run once
    with all joints free, and once more for each joint that shares a coordinate. The results are bit-identical for any
    number of threads. Source: Featherstone, A divide-and-conquer articulated-body algorithm for parallel O(log(n))
    calculation of rigid-body dynamics (1999).

    model: the robot; grain: the maximum number of bodies in a run.

    >>> arm = condyle.robots.arm7()
    >>> divided = condyle.DivideConquer(arm, grain=1)
    >>> q, v, tau = [0.3] * 7, [0.1] * 7, [1.0] * 7
    >>> np.allclose(divided.aba(arm, q, v, tau), condyle.aba(arm, condyle.Data(arm), q, v, tau))
    True
    >>> divided.size
    AssemblySize(bodies=7, runs=7, longest_run=1, joins=6, gathers=0, depth=4)
    """

    def __new__(cls, model: Model, grain: int) -> DivideConquer: ...
    @property
    def size(self) -> AssemblySize:
        """The numbers of operations of the assembly, and the number of steps that must be computed one after the other, as
        `AssemblySize`.
        """

    def aba(
        self,
        model: Model,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        f_ext: ArrayLike | None = None,
        out: _Array | None = None,
    ) -> _Array:
        """Computes the acceleration q̈, nv numbers, equal to the result of `aba` up to rounding. For n bodies, the work is
        O(n) and the number of steps O(log n + grain).

        model: the planned model, or another model with the same bodies and joints; q: position, nq numbers; v, tau:
        velocity and efforts, nv numbers each;
        f_ext: as for `rnea`.
        """

@final
class Ltdl:
    """A factor M = Lᵀ D L of a robot's inertia matrix: L is unit lower triangular with the zeros of the tree, D is
    diagonal.

    With n = nv and the depth d of the tree (the largest number of columns on a path to the root), `factorize` costs O(n
    d²), `solve` O(n d), `inverse` O(n² d). For a chain, d = n. Source: Featherstone, Efficient factorization of the
    joint-space inertia matrix for branched kinematic trees (2005).

    model: the robot whose tree defines the zeros of M.

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
        """The diagonal D, in the `order` of the coordinates."""

    @property
    def nonzeros(self) -> int:
        """The number of entries of L and D that may differ from zero. The diagonal of L, which is one, is not counted."""

    @property
    def order(self) -> list[int]:
        """The coordinates in order from the root to the tips; the factorisation eliminates them in reverse order.

        The order is 0, 1, 2, and so on, unless joints share coordinates.
        """

    def factorize(self, M: ArrayLike) -> None:
        """Computes the factor of M, a symmetric positive definite matrix. The docstring of the class states the
        cost.

        M is not checked: if M is not positive definite, solutions are wrong or not finite. An exception of a
        signal handler, such as KeyboardInterrupt, stops the computation between rows. After that no factor is
        available.
        """

    def inverse(self, out: _Array | None = None) -> _Array:
        """Returns the inverse M⁻¹, both triangles filled."""

    def row(self, k: int) -> list[tuple[int, float]]:
        """Returns the off-diagonal entries of row k of L, from the diagonal to the root, as (index, value). Rows and
        columns are numbered as in `order`.
        """

    def solve(self, b: ArrayLike, out: _Array | None = None) -> _Array:
        """Solves M x = b; returns x, one number for each row of M.

        b: one number for each row of M.
        """

    def solve_matrix(self, B: ArrayLike, out: _Array | None = None) -> _Array:
        """Solves M X = B; returns X, column by column.

        B: a matrix with as many rows as M.
        """

@final
class HyperDual:
    """A hyper-dual number re + eps1 ε₁ + eps2 ε₂ + eps1eps2 ε₁ε₂ with ε₁² = ε₂² = 0. The number carries its derivatives in
    two directions, and the mixed second derivative.

    Store these numbers in NumPy arrays of objects. Arithmetic, NumPy's elementary functions, and all functions of a
    model and a state accept such arrays, and then return such arrays. Comparisons use `re`. `condyle.jacobian`,
    `gradient` and `hessian` create these numbers and read the derivatives.

    Source: Fike and Alonso, The development of hyper-dual numbers for exact second-derivative calculations (2011).

    >>> x = np.array([condyle.HyperDual(0.5, eps1=1.0), condyle.HyperDual(2.0, eps2=1.0)])
    >>> y = np.sin(x[0]) * x[1] ** 2
    >>> bool(abs(y.eps1eps2 - 2.0 * np.cos(0.5) * 2.0) < 1e-15)  # ∂²y/∂x₀∂x₁
    True
    """

    def __new__(cls, re: float, eps1: float = 0.0, eps2: float = 0.0, eps1eps2: float = 0.0) -> HyperDual: ...
    @property
    def eps1(self) -> float:
        """The derivative of the number in the first direction."""

    @property
    def eps1eps2(self) -> float:
        """The mixed second derivative of the number in the two directions."""

    @property
    def eps2(self) -> float:
        """The derivative of the number in the second direction."""

    @property
    def re(self) -> float:
        """The value of the number, without derivatives."""

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
        """Returns the class and the arguments from which `pickle` makes an equal number."""

    def __rmul__(self, value: _Number, /) -> HyperDual: ...
    def __rpow__(self, value: _Number, mod: None = None, /) -> HyperDual: ...
    def __rsub__(self, value: _Number, /) -> HyperDual: ...
    def __rtruediv__(self, value: _Number, /) -> HyperDual: ...
    def __sub__(self, value: _Number, /) -> HyperDual: ...
    def __truediv__(self, value: _Number, /) -> HyperDual: ...
    def arccos(self) -> HyperDual:
        """Returns the angle whose cosine is self."""

    def arccosh(self) -> HyperDual:
        """Returns the number whose hyperbolic cosine is self."""

    def arcsin(self) -> HyperDual:
        """Returns the angle whose sine is self."""

    def arcsinh(self) -> HyperDual:
        """Returns the number whose hyperbolic sine is self."""

    def arctan(self) -> HyperDual:
        """Returns the angle whose tangent is self."""

    def arctan2(self, x: _Number) -> HyperDual:
        """Returns the angle of the point (x, self) in the plane."""

    def arctanh(self) -> HyperDual:
        """Returns the number whose hyperbolic tangent is self."""

    def cbrt(self) -> HyperDual:
        """Returns the cubic root of self."""

    def cos(self) -> HyperDual:
        """Returns the cosine of self."""

    def cosh(self) -> HyperDual:
        """Returns the hyperbolic cosine of self."""

    def exp(self) -> HyperDual:
        """Returns the exponential of self, e to the power of self."""

    def exp2(self) -> HyperDual:
        """Returns the power of 2 with exponent self."""

    def expm1(self) -> HyperDual:
        """Returns the exponential of self, minus 1."""

    def fabs(self) -> HyperDual:
        """Returns the absolute value of self."""

    def hypot(self, other: _Number) -> HyperDual:
        """Returns the hypotenuse √(self² + other²)."""

    def log(self) -> HyperDual:
        """Returns the natural logarithm of self."""

    def log10(self) -> HyperDual:
        """Returns the logarithm of self to the base 10."""

    def log1p(self) -> HyperDual:
        """Returns the natural logarithm of 1 + self."""

    def log2(self) -> HyperDual:
        """Returns the logarithm of self to the base 2."""

    def sin(self) -> HyperDual:
        """Returns the sine of self."""

    def sinh(self) -> HyperDual:
        """Returns the hyperbolic sine of self."""

    def sqrt(self) -> HyperDual:
        """Returns the square root of self."""

    def tan(self) -> HyperDual:
        """Returns the tangent of self."""

    def tanh(self) -> HyperDual:
        """Returns the hyperbolic tangent of self."""

@final
class _DifferentialIk:
    """Steps of differential inverse kinematics; see `condyle.ik.DifferentialIk`."""

    def __new__(
        cls,
        model: Model,
        tasks: Sequence[Any],
        dt: float,
        damping: float,
        limits: Any,
        distances: tuple[str, float, float, float, float] | None,
    ) -> _DifferentialIk: ...
    def _converge(
        self, q: ArrayLike, frames: ArrayLike, com: ArrayLike, posture: ArrayLike, tolerance: list[float], steps: int
    ) -> tuple[_Array, int, _Array]:
        """Makes many steps: returns the last position, the number of steps and the errors there."""

    def _describe(self, kind: str, index: int) -> str:
        """Returns a limit in words."""

    def _hold(self, q: ArrayLike) -> tuple[_Array, _Array, _Array]:
        """Returns the poses of all frames, the centre of mass and the posture at q."""

    def _nearest(self) -> tuple[int, float] | None:
        """Returns the nearest pair before the last step, and its distance."""

    def _place(self, name: str, placement: ArrayLike, velocity: ArrayLike | None) -> bool:
        """Sets placement and velocity of the geometry with a name; returns whether it exists."""

    def _step(
        self, q: ArrayLike, v0: ArrayLike | None, frames: ArrayLike, com: ArrayLike, posture: ArrayLike
    ) -> tuple[_Array, Literal["solved", "relaxed", "stopped"], _Array, list[tuple[str, int]]]:
        """Makes a step: returns its velocity, status, errors and the limits that hold it back."""

@final
class _GlobalIk:
    """Search for postures; see `condyle.ik.GlobalIk`."""

    def __new__(
        cls,
        model: Model,
        frames: list[str],
        tolerance: list[float],
        orientation_weight: float,
        counts: list[int],
        rank: str,
        seed: int,
        limits: Any,
        pairs: str,
        minimum: float,
    ) -> _GlobalIk: ...
    def _describe(self, kind: str, index: int) -> str:
        """Returns a limit in words."""

    def _place(self, name: str, placement: ArrayLike) -> bool:
        """Sets the placement of the geometry with a name; returns whether it exists."""

    def _solve(
        self, targets: ArrayLike, count: int, posture: ArrayLike
    ) -> tuple[_Array, list[bool], _Array, list[int], list[list[tuple[str, int]]]]:
        """Searches postures for targets: `count` times one pose for each frame. Returns positions, whether each target is
        reached, errors, numbers of starts, and the limits that hold each posture back.
        """

def check(inertia: Inertia) -> None:
    """Checks that a body of positive density can have this inertia: its pseudo-inertia J must be positive definite. Raises
    `NotPhysicalError` otherwise.

    Point masses, rods and plates have no volume. The J of such bodies is singular, so this function rejects them.

    >>> from condyle import inertial_parameters
    >>> inertial_parameters.check(condyle.Inertia.from_com(0.0, np.zeros(3), np.eye(3)))
    Traceback (most recent call last):
        ...
    condyle.NotPhysicalError: mass is 0 kg
    """

def from_inertia(inertia: Inertia) -> _Array:
    """Returns the ten parameters π of an `Inertia`, 10 numbers: mass, mass times centre of mass, and xx, xy, yy, xz, yz,
    zz of the rotational inertia about the origin.

    >>> from condyle import inertial_parameters
    >>> I = condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))
    >>> inertial_parameters.from_inertia(I)
    array([2. , 0. , 0. , 1. , 0.6, 0. , 0.6, 0. , 0. , 0.1])
    """

def from_log_cholesky(theta: ArrayLike) -> Inertia:
    """Returns the `Inertia` with the log-Cholesky parameters θ. The inertia is physical for all values of θ. This function
    is the inverse of `log_cholesky`.

    theta: 10 numbers; α within ±32 and dᵢ within ±64.
    """

def log_cholesky(inertia: Inertia) -> _Array:
    """Returns the log-Cholesky parameters θ = (α, d₁, d₂, d₃, s₁₂, s₂₃, s₁₃, t₁, t₂, t₃) of a physical inertia. Every
    vector of ten numbers belongs to exactly one physical inertia.

    α = ½ ln m with the mass m; dᵢ: logarithms of lengths in metres; s: lengths (m); t: the centre of mass (m). With
    these parameters, identification is an unconstrained problem. Source: Rucker and Wensing, Smooth parameterization of
    rigid-body inertia (2022).

    Raises `NotPhysicalError` for an inertia that is not physical.

    >>> from condyle import inertial_parameters
    >>> pi = condyle.robots.arm7().inertial_parameters[:10]
    >>> theta = inertial_parameters.log_cholesky(inertial_parameters.to_inertia(pi))
    >>> np.allclose(inertial_parameters.from_inertia(inertial_parameters.from_log_cholesky(theta)), pi)
    True
    """

def log_cholesky_jacobian(theta: ArrayLike) -> _Array:
    """Returns the Jacobian ∂π/∂θ of the ten parameters with respect to the log-Cholesky parameters, (10, 10), never
    singular.

    theta: 10 numbers. If Y is a regressor, Y ∂π/∂θ is the derivative of the efforts with respect to θ.

    >>> from condyle import inertial_parameters
    >>> inertial_parameters.log_cholesky_jacobian(np.zeros(10))[0, 0].item()  # m = e²ᵅ
    2.0
    """

def pseudo_inertia(inertia: Inertia) -> _Array:
    """Returns the pseudo-inertia J = [Σ, m c; m cᵀ, m], (4, 4), in kg m², kg m and kg, with the mass m and the centre of
    mass c. J is the integral of the products of (x, y, z, 1) over the mass; Σ contains the products of x, y and z.

    J is linear in the parameters. J is positive definite if and only if a body of positive density can have this
    inertia. Source: Wensing, Kim, Slotine, Linear matrix inequalities for physically consistent inertial parameter
    identification (2018).

    >>> from condyle import inertial_parameters
    >>> J = inertial_parameters.pseudo_inertia(condyle.robots.arm7().inertias[3])
    >>> bool(np.linalg.eigvalsh(J).min() > 0.0)
    True
    """

def to_inertia(pi: ArrayLike) -> Inertia:
    """Returns the `Inertia` with the ten parameters π; the inverse of `from_inertia`.

    pi: the ten parameters π.
    """

@final
class Joint:
    """The kind of a joint, with its axis and pitch if the joint has these.

    | | q | v |
    | --- | --- | --- |
    | `revolute`, `prismatic`, `helical` | 1 | 1: about, along the axis |
    | `continuous` | 2: cos θ, sin θ | 1 |
    | `spherical` | 4: quaternion x, y, z, w | 3: angular, in the body |
    | `planar` | 4: x, y, cos θ, sin θ | 3: ẋ, ẏ in the body, θ̇ |
    | `translation` | 3 | 3 |
    | `free_flyer` | 7: position, quaternion | 6: linear, angular, in the body |

    An axis is a vector in the body's frame, of any nonzero length.

    >>> condyle.Joint.helical([0.0, 0.0, 1.0], pitch=0.1).nv
    1
    """

    @property
    def axis(self) -> _Array | None:
        """The axis, 3 numbers in the body's frame; a unit vector in a model. None if the joint has no axis."""

    @property
    def nq(self) -> int:
        """The number of coordinates of the joint in q."""

    @property
    def nv(self) -> int:
        """The number of degrees of freedom of the joint, which is the number of its coordinates in v."""

    @property
    def pitch(self) -> float | None:
        """The translation along the axis per rotation about the axis (m/rad); None unless the joint is helical."""

    @staticmethod
    def continuous(axis: ArrayLike) -> Joint:
        """Returns a joint with one angle about an axis, without limits: q = [cos θ, sin θ], v = [θ̇]."""

    @staticmethod
    def free_flyer() -> Joint:
        """Returns a joint that does not restrict the motion of its body: q = [position, quaternion (x, y, z, w)], v =
        [linear, angular] in the body's frame.
        """

    @staticmethod
    def helical(axis: ArrayLike, pitch: float) -> Joint:
        """Returns a screw joint: q = [θ], v = [θ̇], with a translation along the axis of `pitch` metres per radian."""

    @staticmethod
    def planar() -> Joint:
        """Returns a joint that moves in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇]."""

    @staticmethod
    def prismatic(axis: ArrayLike) -> Joint:
        """Returns a joint with one length along an axis: q = [d], v = [ḋ]."""

    @staticmethod
    def revolute(axis: ArrayLike) -> Joint:
        """Returns a joint with one angle about an axis: q = [θ], v = [θ̇]."""

    @staticmethod
    def spherical() -> Joint:
        """Returns a ball joint: q = quaternion (x, y, z, w), v = angular velocity in the body's frame."""

    @staticmethod
    def translation() -> Joint:
        """Returns a joint with three lengths: q = [x, y, z], v = q̇."""

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
    """Computes the spatial acceleration of a body, 6 numbers (m/s², then rad/s²): `frame_acceleration` of the body's own
    frame; O(n).

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
    as for `frame_jacobian`.
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
    """Computes the classical acceleration of a body, 6 numbers (m/s², then rad/s²): `frame_classical_acceleration` of the
    body's own frame; O(n).

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
    as for `frame_jacobian`.
    """

def body_jacobian(
    model: Model, data: Data, q: ArrayLike, body: str | int, reference: _Reference = "local", out: _Array | None = None
) -> _Array:
    """Computes the Jacobian J of a body, (6, nv), linear rows first: the velocity of the body is J v.

    q: position, nq numbers; body: the index of the body, or the name of its joint; index 0 is the world; reference: as
    for `frame_jacobian`, for the body's own frame.

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
    """Computes the rate dJ/dt of a body's Jacobian along v, (6, nv): `frame_jacobian_rate` of the body's own frame.

    q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def body_point_jacobian(
    model: Model, data: Data, q: ArrayLike, body: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the Jacobian J of a point of a body, (3, nv): `frame_point_jacobian` of the body's own frame.

    q: position, nq numbers; body: as for `body_jacobian`; point: position in the frame of the body, 3 numbers (m).
    """

def body_point_velocity(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, body: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the velocity of a point of a body along the axes of the world, 3 numbers (m/s): `frame_point_velocity` of
    the body's own frame.

    q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; point: position in the frame of the
    body, 3 numbers (m).
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
    """Computes the velocity of a body, 6 numbers (m/s, then rad/s): `frame_velocity` of the body's own frame; O(n).

    q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
    """

def forward_kinematics(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the pose of each body in the world as a homogeneous matrix: (nbodies, 4, 4); O(n).

    q: position, nq numbers. Joint i carries body i; the frame of a body is the frame of its link in the URDF. Body 0 is
    the world. The pose of a frame f is the pose of its body times the placement of the frame: `poses[f.body] @
    f.placement`. See also `frame_placement`.

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
    """Computes the spatial acceleration of a frame, 6 numbers (m/s², then rad/s²); O(n). The spatial acceleration is the
    rate of the frame's spatial velocity as seen from the world, expressed in the reference. Gravity is not subtracted.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
    reference: as for `frame_jacobian`.
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
    """Computes the classical acceleration of a frame, 6 numbers; O(n). The linear part v̇ + ω × v (m/s²) belongs to the
    body's point at the origin of the reference; the angular acceleration follows (rad/s²). In 'local_world_aligned' the
    linear part is p̈ of the frame's origin p.

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
    reference: as for `frame_jacobian`.

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
    """Computes the Jacobian J of a frame, (6, nv), linear rows first: the velocity of the frame is J v.

    q: position, nq numbers; frame: the frame's name or index. reference: 'local', the velocity of the frame's origin,
    along the frame's axes; 'world', the velocity of the body's point at the world's origin, along the world's axes; or
    'local_world_aligned', the velocity of the frame's origin, along the world's axes.

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
    """Computes the rate dJ/dt of a frame's Jacobian along v, (6, nv), linear rows first.

    q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
    `frame_jacobian`. dJ v + J a is the spatial acceleration for 'local' and 'world'. For 'local_world_aligned', whose
    origin moves with the frame, this sum is the classical acceleration.
    """

def frame_placement(model: Model, data: Data, q: ArrayLike, frame: str | int, out: _Array | None = None) -> _Array:
    """Computes the pose oXf of a frame in the world: a homogeneous matrix (4, 4) that maps coordinates in the frame to
    coordinates in the world; O(n).

    q: position, nq numbers; frame: the frame's name or index.

    >>> arm = condyle.robots.arm7()
    >>> tool = condyle.frame_placement(arm, condyle.Data(arm), [0.0] * 7, "tool")
    >>> bool(tool[2, 3] > 0.5)  # stretched upwards
    True
    """

def frame_point_jacobian(
    model: Model, data: Data, q: ArrayLike, frame: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the Jacobian J of a point of a frame, (3, nv): the point's velocity along the axes of the world is J v
    (m/s).

    q: position, nq numbers; frame: the frame's name or index; point: position in the frame, 3 numbers (m). J = S_v +
    S_ω × p, where p is the point in the world's frame and S has a column (S_v, S_ω) for each joint between the world
    and the frame.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, tip = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.0, 0.02, 0.1]
    >>> J = condyle.frame_point_jacobian(arm, data, q, "tool", tip)
    >>> np.allclose(J @ v, condyle.frame_point_velocity(arm, data, q, v, "tool", tip))
    True
    """

def frame_point_velocity(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, frame: str | int, point: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the velocity of a point of a frame along the axes of the world, 3 numbers (m/s).

    q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; point: position in the frame, 3
    numbers (m).
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
    """Computes the velocity of a frame, 6 numbers: the velocity of the body's point at the origin of the reference (m/s),
    then the angular velocity (rad/s); O(n).

    q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
    `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.5] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "tool")
    >>> np.allclose(condyle.frame_velocity(arm, data, q, v, "tool"), J @ v)
    True
    """

@final
class Model:
    """A robot: bodies, joints, frames, inertias, limits. A model never changes and may be shared between threads.

    Body 0 is the world. The other bodies are numbered as in Pinocchio: depth first, parents before children, and
    siblings by the names of their joints. A model is read from a file, built by a `ModelBuilder`, or taken from
    `condyle.robots`; a model can be pickled.

    >>> arm = condyle.robots.arm7()
    >>> arm.nq, arm.nv, arm.names[:3]
    (7, 7, ['universe', 'joint1', 'joint2'])
    """

    @property
    def actuators(self) -> list[Actuator]:
        """The actuators of the file, as `Actuator`, in the order of the file. `limits`, `armature` and `damping` of the
        joints already include the ranges, the armature and the damping of actuators.
        """

    @property
    def armature(self) -> _Array:
        """The inertia of the rotor as seen at each joint, nv numbers (kg m², kg). Every algorithm adds the armature to M."""

    @property
    def body_names(self) -> list[str]:
        """The names of the links that the joints carry; 'universe' for the world."""

    @property
    def damping(self) -> _Array:
        """The viscous damping of each degree of freedom, nv numbers (N m s/rad, N s/m). Damping acts only in
        `passive_torque` and in a `Simulation` with passive torques.
        """

    @property
    def damping_polynomial(self) -> _Array:
        """The coefficients d₁ and d₂ of speed-dependent damping, (nv, 2): the damping coefficient is d₀ + d₁|v| + d₂v²,
        with d₀ in `damping`. The functions that use `damping` also use these coefficients.
        """

    @property
    def frames(self) -> list[Frame]:
        """The frames, as `Frame(name, kind, body, placement)`. For each joint of the URDF, also a fixed joint, there are
        two frames: the joint's frame and the frame of its child link.
        """

    @property
    def friction(self) -> _Array:
        """The Coulomb friction of each degree of freedom, nv numbers (N m, N). Friction acts only in `passive_torque` and
        in a `Simulation` with passive torques.
        """

    @property
    def gravity(self) -> _Array:
        """The acceleration of free fall, in the world's frame (m/s²), 3 numbers."""

    @property
    def gravity_compensation(self) -> list[GravityCompensation]:
        """The supported fractions of the weights of bodies, as `GravityCompensation(body, mass, mass_com, ratio)`:
        MuJoCo's `gravcomp`. The supporting forces act only in `passive_torque` and in a `Simulation` with passive
        torques.
        """

    @property
    def idx_qs(self) -> list[int]:
        """The index in q at which each joint's position begins. For a mimic joint this is the index of its leader."""

    @property
    def idx_vs(self) -> list[int]:
        """The index in v at which each joint's velocity begins. For a mimic joint this is the index of its leader."""

    @property
    def inertial_parameters(self) -> _Array:
        """The inertial parameters π, by which regressors are multiplied: ten numbers for each body except the world, 10
        (nbodies − 1) in all. The ten numbers are mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the
        rotational inertia about the origin of the body's frame.
        """

    @property
    def inertias(self) -> list[Inertia]:
        """The inertia of each body in the body's frame, as `Inertia`. The inertia includes the links that fixed joints
        attach to the body.
        """

    @property
    def joint_placements(self) -> _Array:
        """The pose of each joint's frame in the frame of the parent body, at joint position zero: (nbodies, 4, 4)."""

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
        """The controls of the `keyframes`: a dictionary from names to arrays, with one number for each of `actuators`."""

    @property
    def keyframe_velocities(self) -> dict[str, _Array]:
        """The velocities of the `keyframes`: a dictionary from names to v, nv numbers each."""

    @property
    def keyframes(self) -> dict[str, _Array]:
        """The named positions of the file: a dictionary from names to q, nq numbers each."""

    @property
    def limits(self) -> Limits:
        """The limits of position, velocity and effort, as `Limits`; infinite where a limit is missing. `effort` is the
        greatest magnitude of `effort_lower` and `effort_upper`.
        """

    @property
    def mimics(self) -> list[Mimic | None]:
        """The rule by which each mimic joint follows another joint, as `Mimic(ratio, offset)`; None for other joints."""

    @property
    def name(self) -> str:
        """The robot's name."""

    @property
    def names(self) -> list[str]:
        """The names of the joints, one for each body; 'universe' for the world."""

    @property
    def nbodies(self) -> int:
        """The number of bodies, the world included. This is also the number of rows of f_ext and of the result of
        `forward_kinematics`.
        """

    @property
    def nq(self) -> int:
        """The number of coordinates of a position q."""

    @property
    def nqs(self) -> list[int]:
        """The number of coordinates that each joint has in q: 0 for mimic joints and for the world."""

    @property
    def nv(self) -> int:
        """The number of degrees of freedom, which is the length of v, a, τ and tangent vectors."""

    @property
    def nvs(self) -> list[int]:
        """The number of coordinates that each joint has in v: 0 for mimic joints and for the world."""

    @property
    def parents(self) -> list[int]:
        """The parent body of each joint; 0 is the world."""

    @property
    def singular_joints(self) -> list[int]:
        """The bodies whose joints make M singular; for such a model `aba`, `minv` and `aba_derivatives` raise
        `ModelError`.
        """

    @property
    def springs(self) -> list[Spring]:
        """The springs of joints, as `Spring(joint, stiffness, rest)`. Springs act only in `passive_torque` and in a
        `Simulation` with passive torques.
        """

    @property
    def total_mass(self) -> float:
        """The mass of all bodies, including parts fixed to the world (kg)."""

    @property
    def warnings(self) -> list[ModelWarning]:
        """The warnings about the robot and its file, as `ModelWarning`: text with the attributes `kind`, `file` and
        `line`.

        Warnings report implausible inertias and limits, joints that make the inertia matrix singular, unknown names in
        the file, and contents that a model cannot represent.
        """

    def __copy__(self) -> Model:
        """Returns the model itself, since a model never changes."""

    def __deepcopy__(self, memo: object) -> Model:
        """Returns the model itself, since a model never changes."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the function and the bytes from which `pickle` makes an equal model."""

    def append(
        self, frame: str | int | None, model: Model, placement: ArrayLike | None | None = None, prefix: str = ""
    ) -> Model:
        """Returns a new model: this robot with another robot attached to one of its frames.

        The new bodies are numbered as by Pinocchio's `appendModel`: after all existing descendants of the body to which
        they are attached. The result has the name and the gravity of this robot.

        frame: the name or index of a frame; None is the world.
        model: the other robot.
        placement: the pose of the other robot's world in the frame, a homogeneous (4, 4) matrix; None is the identity.
        prefix: text added before all names of the other robot.

        >>> quadruped, arm = condyle.robots.quadruped(), condyle.robots.arm7()
        >>> quadruped.append("trunk", arm, prefix="arm_").names[13:16]
        ['RH_KFE', 'arm_joint1', 'arm_joint2']

        Raises `ModelError` if two bodies, joints or frames have the same name.
        """

    def constraints(self) -> dict[str, ContactConstraint | Coupling]:
        """Returns the constraints in the robot's file that are not part of the tree, by name. Loops are
        `ContactConstraint`s without stabilisation; coupled joints are `Coupling`s. Inactive constraints are left out,
        and so is the `<mimic>` of a URDF or SDF.

        The algorithms for trees ignore loops and couplings. `constrained_dynamics` closes the loops that are in its
        `ConstraintSet`. No function enforces a `Coupling`. A linear coupling becomes a part of the tree if the file is
        read with `mimic=True`.

        >>> robot = condyle.robots.quadruped()
        >>> loops = [c for c in robot.constraints().values() if isinstance(c, condyle.ContactConstraint)]
        >>> stiff = [c._replace(kp=400.0, kd=40.0) for c in loops]  # an error of position decays within 0.1 s
        >>> condyle.ConstraintSet(robot, stiff, mu=1e-8, iterations=5)
        <condyle.ConstraintSet of 'quadruped': 0 constraints, 0 rows>
        """

    def frame(self, name: str) -> int:
        """Returns the index of the frame with this name. If frames of several kinds have the name, a link's frame is
        preferred, then a user's frame, then a joint's frame.

        Raises `ModelError` if the name does not exist; the message suggests the most similar name.
        """

    @staticmethod
    def from_json(text: str) -> Model:
        """Reads a model from the JSON that `to_json` returns.

        Raises `ParseError` for an invalid text; the error contains line and column.
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
        """Reads a model from an MJCF file (MuJoCo) and the files that it includes.

        q and v have the layout of MuJoCo's `qpos` and `qvel`, with two exceptions: quaternions are x, y, z, w, and a
        free joint's velocity is in the body's frame (MuJoCo: linear velocity in the world's frame). Several joints on
        one body become a chain of joints, connected by bodies without mass, `name#1`, `name#2`, and so on. Contents
        that a model cannot represent are left out and reported in `warnings`.

        path: a path, as text or `os.PathLike`.
        mimic: whether a `<joint>` of `<equality>` makes joint1 follow joint2; its `polycoef` must then be linear.
            Otherwise the coupling is one of the `constraints`, which are not part of the tree.
        strict: whether a warning (`warnings`) is an error.
        weightless_meshes: whether a mesh with mass that cannot be read counts as massless and is reported in
            `warnings`. Otherwise it is an error.
        packages, allow: as for `from_urdf`.

        Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
        unknown kind of warning.
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
        """Reads a model from an MJCF in a string, which may not include files; see `from_mjcf`.

        >>> body = '<body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/></body>'
        >>> condyle.Model.from_mjcf_str(f"<mujoco><worldbody>{body}</worldbody></mujoco>").total_mass
        2.0
        """

    @staticmethod
    def from_mujoco(
        model: Any, mimic: bool = False, strict: bool = False, *, allow: Sequence[_Kind] | None = None
    ) -> Model:
        """Converts a `mujoco.MjModel`, which is a robot compiled by MuJoCo. The numbers stay the same.

        The names, q and v are the same as with `from_mjcf`. Named `<frame>`s are missing, because MuJoCo does not keep
        them. The results of MuJoCo's compiler are included: meshes, `replicate`, `attach`, composites, `settotalmass`.
        If numbers were changed after compilation, the changed numbers are used. Contents that a model cannot represent
        are reported in `warnings`, or are an error, in the same cases as for `from_mjcf`. MuJoCo itself is not
        imported.

        mimic, strict, allow: as for `from_mjcf`.

        Raises `TypeError` if the argument is not an `MjModel`, `ParseError` or `ModelError` if its contents are
        invalid, and `ValueError` for an unknown kind of warning.
        """

    @staticmethod
    def from_pinocchio(model: Any) -> Model:
        """Converts a `pinocchio.Model`. The result has the same joints, bodies, frames, limits, damping and friction, so
        algorithms give equal results. `to_pinocchio` is the inverse.

        Composite, universal and spherical ZYX joints become several joints, connected by bodies without mass. Limits of
        quaternions, cosines and sines, geometry, and reference configurations are left out.

        Raises `ModelError` if a joint has an unsupported kind, or if the joints are not in depth-first order.
        Pinocchio's file readers number joints in this order.
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
        """Reads a model from an SDF file (Gazebo), and the models that the file includes.

        All models of a file, or of its first world, become one robot. Each name then begins with the name of its model:
        `robot::arm`. Joints are visited breadth first from the root, in the order of the file. A joint that would give
        a link a second parent closes a loop. A universal joint becomes two revolute joints.

        path: a path, as text or `os.PathLike`.
        root_joint: as for `from_urdf`.
        mimic: whether an axis with a `<mimic>` follows another axis. Otherwise the axis moves freely.
        strict: whether a warning (`warnings`) is an error.
        packages, allow: as for `from_urdf`; `packages` are also searched for `model://` addresses.
        model: the name of the one model to read; None reads all models of the file.

        Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
        unknown kind of warning.
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
        """Reads a model from an SDF in a string; see `from_sdf`.

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
        """Reads a model from a URDF file.

        Fixed joints are merged into their parent body and remain as frames. Meshes are never read. A file whose name
        ends in `.xacro` is expanded by the installed program `xacro` or `xacrodoc`. That program evaluates expressions
        in the file, so read only files from sources that you trust.

        path: a path, as text or `os.PathLike`, or `package://name/path/in/the/package`.
        root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
            'spherical' or 'translation'; None fixes the root link to the world.
        mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow. Otherwise they have
            their own coordinates.
        strict: whether a warning (`warnings`) is an error.
        packages: folders that contain packages, or are packages. They are searched before the folders in the
            environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
        allow: kinds of warnings that are not errors even if `strict` is set: 'massless', 'negative', 'triangle',
            'singular', 'unlikely', 'limit', 'unknown', 'left_out', 'assumed' or 'mimic'.
        arguments: values of xacro's `<xacro:arg>`s by name, for files that end in `.xacro`.

        Raises `ParseError`, with file, line and element, or `ModelError` for an invalid robot, and `ValueError` for an
        unknown kind of warning.
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
        """Reads a model from a URDF in a string; see `from_urdf`.

        >>> text = condyle.robots.QUADRUPED
        >>> condyle.Model.from_urdf_str(text, root_joint="free_flyer").nv
        18
        """

    def joint(self, name: str) -> int:
        """Returns the index of the body that the joint with this name carries.

        Raises `ModelError` if the name does not exist; the message suggests the most similar name.
        """

    def lock(self, joints: Sequence[str | int], q: ArrayLike) -> Model:
        """Returns the same robot with some joints locked at their positions in q.

        The bodies of locked joints are merged into their parent bodies and remain as frames. A mimic joint is locked
        together with the joint that it follows. A locked joint still contributes to the length of a tendon. If a linear
        coupling connects a locked joint to another joint, the other joint is locked, too. Warnings about the file are
        kept.

        joints: a list of names or indices of bodies.
        q: position, nq numbers.

        >>> condyle.robots.arm7().lock(["joint4", 6], [0.0] * 7).names
        ['universe', 'joint1', 'joint2', 'joint3', 'joint5', 'joint7']

        Raises `ModelError` if a joint does not exist, or if `q` is not finite or contains a rotation whose length is
        not 1 (up to 1e-3).
        """

    def reference_configurations(self, path: _Path, strict: bool = False) -> dict[str, _Array]:
        """Reads the named positions of an SRDF file, which are its `<group_state>`s. Returns a dictionary from names to q,
        nq numbers each.

        Joints that a state does not mention stay as in `neutral`. For a joint that turns without limits, the state may
        give the angle. States of several groups with the same name form one position. All other contents of the file
        are ignored.

        path: a path, as text or `os.PathLike`.
        strict: whether a joint that the robot does not have is an error. Without `strict` such a joint is ignored,
        since robots with fewer joints often share an SRDF.

        Raises `ParseError` for an invalid file; the error contains file, line and element.
        """

    def reference_configurations_str(self, text: str, strict: bool = False) -> dict[str, _Array]:
        """Reads the named positions of an SRDF in a string; see `reference_configurations`.

        >>> joint = '<joint name="joint4" value="-1.2"/>'
        >>> srdf = f'<robot name="arm7"><group_state name="bent" group="arm">{joint}</group_state></robot>'
        >>> condyle.robots.arm7().reference_configurations_str(srdf)
        {'bent': array([ 0. ,  0. ,  0. , -1.2,  0. ,  0. ,  0. ])}
        """

    def to_json(self) -> str:
        """Returns the model as JSON, with all digits; `from_json` returns an equal model. An infinite limit is written as
        `null`.

        The text may be edited; `from_json` checks its contents.

        >>> arm = condyle.robots.arm7()
        >>> condyle.Model.from_json(arm.to_json()).to_json() == arm.to_json()
        True
        """

    def to_pinocchio(self) -> Any:
        """Returns the same robot as a `pinocchio.Model`; requires Pinocchio 3 or later.

        Mimic joints remain mimic joints; a mimic joint that turns without limits is an error. Springs, damping that
        depends on the speed, gravity compensation, actuators, keyframes and constraints are left out. Each item that is
        left out causes a `UserWarning`, whose argument is a `ModelWarning`.
        """

    def tree(self, frames: bool = False) -> str:
        """Returns the tree of bodies as text: each joint with its kind, its indices in q and v, and the body that it
        carries. frames: whether to list the other frames of each body, too.

        >>> print(condyle.robots.quadruped().lock(range(2, 14), condyle.neutral(condyle.robots.quadruped())).tree())
        universe
        └─ root_joint: free_flyer, q[0:7], v[0:6] → trunk, 30.000 kg
        """

    def with_armature(self, armature: ArrayLike) -> Model:
        """Returns the same robot with another armature, nv numbers (kg m², kg).

        Raises `ModelError` if a number is negative or not finite.
        """

    def with_damping(self, damping: ArrayLike, polynomial: ArrayLike | None = None) -> Model:
        """Returns the same robot with another viscous damping, nv numbers (N m s/rad, N s/m).

        polynomial: d₁ and d₂ of the damping d(v) = d₀ + d₁|v| + d₂v² of each degree of freedom, (nv, 2). None keeps the
        old coefficients.

        Raises `ModelError` if a number is not finite, or a damping is negative.

        >>> arm = condyle.robots.arm7()
        >>> arm.with_damping([0.1] * 7).damping[0].item()
        0.1
        """

    def with_frame(self, name: str, parent: str | int | None, placement: ArrayLike | None = None) -> Model:
        """Returns the same robot with one more frame of kind 'user', which is the last of `frames`. All other contents are
        unchanged.

        name: the new frame's name; parent: the name or index of the frame to which the new frame is attached, or the
        name of a body; None is the world; placement: the pose of the new frame in the parent's frame, a homogeneous (4,
        4) matrix; None is the identity.

        Raises `ModelError` if the parent does not exist, the placement is not a homogeneous matrix, or another frame of
        kind 'user' has this name.

        >>> tip = np.eye(4)
        >>> tip[2, 3] = 0.1
        >>> arm = condyle.robots.arm7().with_frame("tip", "tool", tip)
        >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.3] * 7, "tip").shape
        (6, 7)
        """

    def with_friction(self, friction: ArrayLike) -> Model:
        """Returns the same robot with another Coulomb friction, nv numbers (N m, N).

        Raises `ModelError` if a number is negative or not finite.
        """

    def with_gravity(self, gravity: ArrayLike) -> Model:
        """Returns the same robot with another gravity (m/s², 3 numbers, in the world's frame).

        Raises `ModelError` if the gravity is not finite.
        """

    def with_inertias(self, inertias: Sequence[Inertia]) -> Model:
        """Returns the same robot with other inertias: a list like `inertias`, with one `Inertia` for each body, beginning
        with the world. Implausible values are reported in the `warnings` and `singular_joints` of the result.

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
        """Returns the same robot with other limits of position (nq numbers), velocity and effort (nv each). None keeps the
        old limits; an infinite number removes a limit.

        effort: maximum magnitude; sets both `effort_lower` and `effort_upper`, and cannot be combined with either.

        Raises `ModelError` if a lower limit is above an upper one, or a limit of velocity is negative.

        >>> arm = condyle.robots.arm7()
        >>> arm.with_limits(effort=0.5 * arm.limits.effort).limits.effort[0].item()
        43.5
        """

    def with_mimic(self, follower: str | int, leader: str | int, ratio: float = 1.0, offset: float = 0.0) -> Model:
        """Returns the same robot with one more mimic joint: the follower's position is ratio q + offset, where q is the
        leader's position. The follower has no coordinate in q. The limits of the leader's coordinate then apply to both
        joints.

        follower, leader: the joints' names, or the indices of their bodies.

        >>> arm = condyle.robots.arm7()
        >>> arm.with_mimic("joint4", "joint2", ratio=-2.0).nv
        6

        Raises `ModelError` if a joint does not have exactly one degree of freedom, the leader is itself a mimic joint,
        or another joint follows the follower.
        """

    def write_mjcf(self, path: _Path, original: _Path) -> None:
        """Writes the numbers that `write_urdf` writes into a copy of the MJCF `original`.

        Changed bodies and joints must be in the file itself, not in an included file. Effort limits are written as
        `actuatorfrcrange` of the joint.

        path: the new file. original: the file from which the robot was read.

        Raises `ParseError` as `write_urdf` does.
        """

    def write_urdf(self, path: _Path, original: _Path) -> None:
        """Writes inertias, limits, damping, friction and armature into a copy of the URDF `original`. All other contents
        stay the same.

        Only values that differ from the original are edited, so an unchanged robot gives the same bytes. Reading the
        new file gives this model again, up to rounding. `original` and `path` may be the same file. If fixed joints
        merge several links into one body, changes of the body's inertia are written to the link that the moving joint
        carries. An armature becomes the rotor inertia of a `<transmission>`.

        path: the new file. original: the file from which the robot was read.

        Raises `ParseError` if the format cannot express a value, such as an infinite limit, or if the file belongs to
        another robot. The message contains the element and both numbers.
        """

def _model_from_bytes(data: bytes) -> Model:
    """Creates the model from the bytes of a pickle."""

@final
class ArmMpc:
    """A model predictive controller of an arm with a fixed base. A frame of the arm follows poses in time, and the plan
    keeps the limits of positions, velocities and efforts. A `JointPolicy` follows the plan at a higher rate.

    `path` is a function that returns the pose of the frame (4, 4) at a time (s), or a pose that does not change. It is
    called for each knot of the horizon.

    model: the robot.
    frame: the name of the frame.
    horizon, knot: the durations of the horizon and of a knot (s).
    weights: `ArmWeights`; None for the defaults.
    limits: 'model' for all limits of the model, `PlanLimits` for some of them, or None for none of them.
    obstacles: pairs of geometries that stay apart, as for `Residual.distances`: the arm and obstacles, or two parts of
        the arm.
    clearance: the smallest distance of each pair at each knot (m). It may give way at a high cost, because a measured
        state can be nearer.
    sweeps: the number of sweeps for the quadratic program of each linearisation.
    iterations: the least and the largest number of linearisations in a tick. Further ones after the least number are
        made only if the budget has time left for one more.
    budget: the time budget of a tick (s); None without a budget. One sweep is always made.
    latency: the time between the measurement of a state and the use of the plan that is computed from it (s).
    threads: the number of threads of a tick.

    Raises `ControllerError` for a number outside its range, and `ProblemError` for a frame that does not exist or an
    invalid pair.

    >>> from condyle.mpc import ArmMpc
    >>> arm = condyle.robots.arm7()
    >>> x = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    >>> pose = condyle.frame_placement(arm, condyle.Data(arm), x[:7], "tool")
    >>> mpc = ArmMpc(arm, "tool")
    >>> mpc.reset(x, pose)
    >>> mpc.update(0.02, x, pose)(0.021, x).shape
    (7,)
    """

    def __new__(
        cls,
        model: Model,
        frame: str,
        *,
        horizon: float = 0.5,
        knot: float = 0.02,
        weights: ArmWeights | None | None = None,
        limits: Literal["model"] | PlanLimits | None = "model",
        obstacles: Sequence[tuple[Sphere | Geometry, Sphere | Geometry]] = (),
        clearance: float = 0.02,
        sweeps: int = 2,
        iterations: tuple[int, int] = (1, 1),
        budget: float | None | None = None,
        latency: float = 0.0,
        threads: int = 1,
    ) -> ArmMpc: ...
    @property
    def model(self) -> Model:
        """The robot."""

    @property
    def report(self) -> Report:
        """The `Report` of the last tick."""

    def place(self, name: str, placement: ArrayLike, velocity: ArrayLike | None = None, t: float = 0.0) -> None:
        """Sets the placement of an obstacle and its velocity. Later ticks plan with its motion at constant velocity. A
        call for each measurement of the obstacle corrects the motion.

        name: the name of the `Geometry` in `obstacles`; placement: its pose (4, 4) in the world at the time t (s).
        velocity: [linear, angular], six numbers along the world's axes: the velocity of the origin of the placement
            (m/s), and the angular velocity (rad/s); None for an obstacle at rest.

        Raises `ControllerError` if no pair has this obstacle, or for a number that is not finite.
        """

    def policy(self) -> JointPolicy:
        """Returns a `JointPolicy` that follows the latest plan, also after later updates."""

    def reset(self, x: ArrayLike, path: ArrayLike | Callable[[float], ArrayLike], t: float = 0.0) -> None:
        """Begins anew in a state, whose joints are the posture from which the arm deviates as little as the path allows.

        x: the state (q, v); path: the pose of the frame as a function of time, or a pose (4, 4); t: the time (s).

        Raises `ControllerError` for a number that is not finite.
        """

    def update(self, t: float, x: ArrayLike, path: ArrayLike | Callable[[float], ArrayLike]) -> JointPolicy:
        """Renews the plan for a measured state, and returns a new `JointPolicy` that follows the latest plan. The first
        call is a `reset`. A state that is not finite leaves the plan as it is: see `report`.

        t: the time of the measurement (s); x: the state (q, v); path: the pose of the frame as a function of time, or a
        pose (4, 4).

        Raises `ControllerError` if t is before the last call.
        """

@final
class Foot:
    """A foot of a walking robot: `Foot.point` or `Foot.sole`.

    >>> condyle.mpc.Foot.point("LF_foot", friction=0.6, radius=0.02).frame
    'LF_foot'
    """

    @property
    def frame(self) -> str:
        """The name of the frame."""

    @staticmethod
    def point(frame: str, friction: float, radius: float) -> Foot:
        """Returns a foot that is a ball around the origin of a frame.

        frame: the name of the frame; friction: the coefficient of friction that the controller may use; radius: the
        radius of the ball (m).

        Raises `ControllerError` for a number outside its range.
        """

    @staticmethod
    def sole(frame: str, friction: float, size: _Size) -> Foot:
        """Returns a foot that is a rectangle in the plane z = 0 of a frame.

        frame: the name of the frame, whose origin is in the middle of the sole; friction: the coefficient of friction
        that the controller may use; size: the side lengths along the axes x and y of the frame (m).

        Raises `ControllerError` for a number outside its range.
        """

@final
class Gait:
    """A gait of a walking robot: which feet are in the air, and when. The swings repeat after a period.

    The positions of the feet in the stand tell which feet are in front and which are on the left.

    >>> condyle.mpc.Gait.trot(swing=0.24, double=0.04)
    Gait.trot(swing=0.24, double=0.04)
    """

    @staticmethod
    def bound(swing: float = 0.2, double: float = 0.06) -> Gait:
        """Returns the gait in which the front and the rear pair of four feet swing in turn; for the arguments see `trot`."""

    @staticmethod
    def pace(swing: float = 0.2, double: float = 0.06) -> Gait:
        """Returns the gait in which the left and the right pair of four feet swing in turn; for the arguments see `trot`."""

    @staticmethod
    def stand() -> Gait:
        """Returns the gait in which all feet stay on the ground."""

    @staticmethod
    def step(swing: float = 0.36, double: float = 0.08) -> Gait:
        """Returns the gait in which the feet swing one by one from left to right, as a biped steps; for the arguments see
        `trot`.
        """

    @staticmethod
    def table(period: float, swings: Sequence[tuple[str, float, float]]) -> Gait:
        """Returns a gait from a table.

        period: the time after which the swings repeat (s); swings: tuples (frame, begin, end) with the name of a foot's
        frame, and the times at which the foot leaves the ground and lands (s), both within the period.
        """

    @staticmethod
    def trot(swing: float = 0.24, double: float = 0.04) -> Gait:
        """Returns the gait in which diagonal pairs of four feet swing in turn.

        swing: the duration of a swing (s); double: the time between two swings, with all feet on the ground (s).
        """

    @staticmethod
    def walk(swing: float = 0.24, double: float = 0.04) -> Gait:
        """Returns the gait in which four feet swing one by one: rear left, front left, rear right, front right; for
        the arguments see `trot`.
        """

@final
class JointPolicy:
    """The efforts of a robot's joints as a function of time and state: the feedback of the latest plan, within the limits
    of the robot.

    `policy(t, x)` returns the efforts of all joints but the free-flyer's, at the time t (s) and the state x = (q, v).
    Another thread can call it while a plan is computed; a call never waits. All efforts are finite and within the
    limits. After the end of the plan, after `stop()` or without a plan, the policy damps the joints. If x has a number
    that is not finite, the policy returns the efforts of the plan without feedback. `source` tells which of these the
    last call returned.
    """

    @property
    def end(self) -> float | None:
        """The time of the end of the plan (s); None before the first plan."""

    @property
    def source(self) -> Literal["plan", "open_loop", "damping"]:
        """The source of the efforts of the last call: 'plan', 'open_loop' (the plan without feedback) or 'damping'."""

    def __call__(self, t: float, x: ArrayLike) -> _Array: ...
    def release(self) -> None:
        """Makes the policy follow the plan again after `stop`."""

    def stop(self) -> None:
        """Makes the policy damp the joints from now on, as an emergency stop, until `release`."""

@final
class WholeBodyMpc:
    """A model predictive controller of a walking robot. Each tick renews a plan of the whole body's motion and of the
    contact forces, under the limits of the robot and of friction. A `JointPolicy` follows the plan at a higher rate.

    The plan is an optimal control problem with a knot for each time step, and the schedule of the gait gives the
    contacts of each knot. Knots begin at times that do not depend on the rate of the ticks. Each tick makes one
    linearisation and at most `sweeps` sweeps of the interior point.

    model: a robot with a free-flyer at its root.
    feet: a list of `Foot`.
    gait: a `Gait`.
    horizon, knot: the durations of the horizon and of a knot (s).
    weights: `Weights`; None for the defaults.
    limits: 'model' for all limits of the model, `PlanLimits` for some of them, or None for none of them.
    sweeps: the number of sweeps for the quadratic program of each linearisation.
    iterations: the least and the largest number of linearisations in a tick. Further ones after the least number are
        made only if the budget has time left for one more.
    budget: the time budget of a tick (s); None without a budget. One sweep is always made.
    latency: the time between the measurement of a state and the use of the plan that is computed from it (s).
    threads: the number of threads of a tick.
    max_acceleration: the largest accelerations of the command: forwards, to the left (m/s²), and turning (rad/s²).
    swing_height: the height of a swing (m).

    Raises `ControllerError` for a robot without a free-flyer, a foot or a gait that does not fit the robot, or a number
    outside its range.

    >>> from condyle.mpc import Foot, Gait, WholeBodyMpc
    >>> robot = condyle.robots.quadruped()
    >>> feet = [Foot.point(f"{leg}_foot", 0.6, 0.0) for leg in ("LF", "RF", "LH", "RH")]
    >>> mpc = WholeBodyMpc(robot, feet, Gait.trot(), threads=1)
    >>> mpc.report.status
    'no_plan'
    """

    def __new__(
        cls,
        model: Model,
        feet: Sequence[Foot],
        gait: Gait,
        *,
        horizon: float = 0.5,
        knot: float = 0.02,
        weights: Weights | None | None = None,
        limits: Literal["model"] | PlanLimits | None = "model",
        sweeps: int = 2,
        iterations: tuple[int, int] = (1, 1),
        budget: float | None | None = None,
        latency: float = 0.0,
        threads: int = 1,
        max_acceleration: tuple[float, float, float] = (1.0, 1.0, 2.0),
        swing_height: float = 0.06,
    ) -> WholeBodyMpc: ...
    @property
    def model(self) -> Model:
        """The robot."""

    @property
    def report(self) -> Report:
        """The `Report` of the last tick."""

    def command(self, vx: float = 0.0, vy: float = 0.0, wz: float = 0.0, height: float | None | None = None) -> None:
        """Sets the commanded velocity of the trunk, along its heading.

        vx, vy: velocities forwards and to the left (m/s); wz: rate of turning to the left (rad/s); height: height of
        the trunk relative to the stand (m), None to keep it.

        Raises `ControllerError` for a number that is not finite.
        """

    def forces(self) -> _Array:
        """Returns the planned forces of the ground on the feet, along the world's axes: (knots, feet, 3) (N). The force of
        a foot in the air is 0.

        Raises `ControllerError` without a plan.
        """

    def plan(self, fade: float = 0.0) -> Plan:
        """Returns the plan of the last tick for `condyle.wholebody`: a `Plan` with the states, efforts and gains of the
        horizon, and the feet that touch. A `WholeBodyController` with a contact for each foot, in the same order,
        tracks it: `controller.track(mpc.plan(), t, references)`.

        fade: the time (s) during which a contact is loaded and unloaded.

        Raises `ControllerError` without a plan.
        """

    def policy(self) -> JointPolicy:
        """Returns a `JointPolicy` that follows the latest plan, also after later updates."""

    def prepare(self, t: float | None | None = None) -> None:
        """Makes the part of the next `update` that does not depend on the measured state, before the state arrives.

        t: the time of the next measurement (s); with None, it follows after the last period. An update at another time
            makes the whole tick again.

        Raises `ControllerError` before the first plan, and if t is before the last call.
        """

    def reset(self, x: ArrayLike, t: float = 0.0) -> None:
        """Begins anew with a robot that stands: its joints are the posture to which the robot returns, and its feet are
        on the ground. Solves the first problem.

        x: the state (q, v); t: the time (s).

        Raises `ControllerError` for a number that is not finite, or if the gait does not fit the feet.
        """

    def set_gait(self, gait: Gait, at: Literal["next"] | float = "next") -> None:
        """Changes the gait as soon as all feet that are in the air have landed. No other foot leaves the ground before.

        gait: the new `Gait`.
        at: 'next' for now, or the time before which the present gait goes on (s), at most 60 s ahead.

        Raises `ControllerError` for a gait that does not fit the feet, and for a time that is too late.
        """

    def terrain(self, normal: ArrayLike | None = None, height: float = 0.0) -> None:
        """Sets the plane of the ground. Without arguments, it is the plane through the last footholds.

        normal: the normal of the plane, which points upwards; height: the height of the plane at the origin of the
        world (m).
        """

    def touch(self, feet: Sequence[str] | ArrayLike) -> None:
        """Reports which feet touch the ground, as measured at the time of the next `update`. Later updates need reports of
        their own. Without reports, feet land when the schedule says so.

        - A foot that touches after half of its swing has landed: it stands from then on, where it is.
        - A foot that does not touch at the end of its swing swings on, and its foothold is lowered at 0.8 m/s, by at
          most 0.06 m. The foot counts as standing at once if fewer than two other feet
          stand, or if these are no stance of the gait.

        Other swings stay as the schedule has them.

        feet: the names of the frames of the feet that touch, one name, or a bool for each foot.

        Raises `ControllerError` for a name that is not a foot, or another number of bools.
        """

    def update(self, t: float, x: ArrayLike) -> JointPolicy:
        """Renews the plan for a measured state, and returns a new `JointPolicy` that follows the latest plan. The first
        call is a `reset`. A state that is not finite leaves the plan as it is: see `report`.

        t: the time of the measurement (s); x: the state (q, v).

        Raises `ControllerError` if t is before the last call.
        """

@final
class Action:
    """An action written in Python.

    nx, nu: the sizes of a state and of a control, at most 4096; nu is 0 at a terminal knot.
    calc: a function of (t, x, u) that returns the next state x⁺ and the cost ℓ; the next state may be None only at the
        terminal knot.
    calc_diff: a function of (t, x, u) that returns a dict of the nonzero matrices among A = ∂x⁺/∂x, B = ∂x⁺/∂u, q =
        ∂ℓ/∂x, r = ∂ℓ/∂u, Q = ∂²ℓ/∂x², S = ∂²ℓ/∂x∂u, R = ∂²ℓ/∂u². Without calc_diff, calc is called with arrays of
        numbers that carry their exact derivatives. So calc must make new arrays for its results (`np.array([...])`,
        `np.concatenate`), and not write into arrays of floats. One call serves all knots if calc does not use t and has
        no branches that differ between knots. If this method fails, calc is differentiated by hyper-dual numbers, and
        if they also fail, by differences.
    lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
    space: the space of states: None for vectors; a model, for its states (q, v); or a tuple (ndx, integrate,
        difference). In this tuple, integrate(x, dx) returns x ⊕ dx, difference(x0, x1) returns the dx with x0 ⊕ dx =
        x1, and dx has ndx numbers. Derivatives are taken with respect to dx.
    batch: whether calc and calc_diff take all knots at once: t of shape (N,), x (N, nx), u (N, nu), and results with N
        rows.

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
        """Returns the quadratic barrier ½ Σ (excess of rᵢ over its bounds)²; an infinite bound is ignored."""

    @staticmethod
    def quadratic() -> Activation:
        """Returns the quadratic cost ½ Σ rᵢ²."""

    @staticmethod
    def relaxed_barrier(lower: ArrayLike, upper: ArrayLike, mu: float, delta: float) -> Activation:
        """Returns the relaxed logarithmic barrier Σ β(d) of the distances d = rᵢ − lowerᵢ and d = upperᵢ − rᵢ to all
        finite bounds. β(d) = −μ log(d/δ) for d ≥ δ, and ½ μ (((d − 2δ)/δ)² − 1) for d < δ, where a bound is near or
        violated.

        β is convex and twice continuously differentiable. It has curvature inside the bounds too, so a step towards a
        bound that is not yet reached becomes more expensive; `barrier` has none there. β(δ) = 0, so the value does not
        depend on the unit of r. Source: Feller and Ebenbauer, 2017.

        lower, upper: the bounds, infinite for no bound; `cone.bounds()` for a cone.
        mu: μ > 0, in the unit of the cost; at the distance d ≥ δ the slope is μ/d.
        delta: δ > 0, in the unit of r.
        """

    @staticmethod
    def smooth1(epsilon: float = 1.0) -> Activation:
        """Returns the smooth cost Σ √(ε + rᵢ²), approximately Σ |rᵢ|."""

    @staticmethod
    def smooth2(epsilon: float = 1.0) -> Activation:
        """Returns the smooth cost √(ε + ‖r‖²), approximately ‖r‖. With the cost a, the Hessian is approximated by ε/a³
        times the identity; ε/a³ is the least eigenvalue of the exact Hessian.
        """

    @staticmethod
    def sum() -> Activation:
        """Returns the sum Σ rᵢ, for residuals that are costs themselves: see `Residual.own_cost`."""

    @staticmethod
    def weighted(w: ArrayLike) -> Activation:
        """Returns the weighted quadratic cost ½ Σ wᵢ rᵢ²."""

    @staticmethod
    def weighted_barrier(lower: ArrayLike, upper: ArrayLike, w: ArrayLike) -> Activation:
        """Returns the weighted quadratic barrier ½ Σ wᵢ (excess of rᵢ over its bounds)². Crocoddyl has wᵢ² instead of wᵢ
        in the value of this activation.
        """

@final
class AugmentedLagrangian:
    """The augmented Lagrangian method around `Fddp`, as in ProxDDP: for robots with `Limit`s and for `ConstrainedAction`s.

    The method repeats two steps. First FDDP minimises Σ ℓ + (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖² with z = g + μ y, where
    ℓ is the cost of a knot, g its limits, y their multipliers, and Π the projection onto the bounds. If FDDP found no
    minimum, it continues. If the limits hold well enough, or the penalty 1/μ is at its maximum, y ← (z − Π z) / μ.
    Otherwise μ is reduced. The method ends when the violation of limits and the gradient of ℓ + yᵀg are below the
    tolerances.

    The penalty of a row lower < r < upper is divided by the square of its smaller finite bound other than 0, if that
    bound exceeds 1 in absolute value. Tolerances, violations and multipliers are in the units of the row.

    `solve` begins with zero multipliers. `resume` begins with the multipliers and the penalty of the last solve. If the
    last solve failed, they are from the solve before it. They start again after two failed solves in succession, or
    after "not_finite". `shift` also shifts the multipliers. Between `solve` and `resume`, `settings` and `inner` may be
    assigned.

    A solution is "converged" when the residuals of `outcome` are below the tolerances. The status is
    "constraints_violated" if limits do not hold at minima of the largest penalty, and updates of the multipliers do not
    help. This does not prove that no solution exists: another warm start may find one. The status is
    "regularisation_limit" if an inner solve found no acceptable step, and did not end at a minimum. The status is
    "infeasible" if the initial state itself violates a limit of knot 0 that no control can change. `outcome.worst`
    contains the knot, the limit and the amount of the largest violation. The cost of the solution includes the
    penalties of the limits; the cost of `outcome` does not. The solution's trace and gains are from the last inner
    solve, its timings from the whole solve. Controls of a warm start are moved into their bounds.

    problem: the problem to solve. All memory is allocated once, for the size of this problem.
    inner: a dict of settings of `Fddp` for the inner solves. The tolerances of inner solves are chosen automatically;
        `time_budget` applies to the whole solve.
    settings: any of the following settings, by name. `tolerance`: the largest accepted distance of a limit from its
        bounds. `tolerance_dual`: the largest accepted entry of the gradient of the Lagrangian. `max_solves`: the
        maximum number of inner solves. `penalty_start`, `penalty_max`, `penalty_factor`: 1/μ of the first inner solve,
        its maximum, and the factor by which it increases; an equal `penalty_start` and `penalty_max` fix the penalty.
        `restart`: whether to repeat a failed `solve` of a problem
        with limits or bounds once (default: yes). The second solve starts from the initial state, held still at all
        knots. A solve fails if it is not finite, violates limits at the largest penalty, or finds no acceptable step
        while limits are violated. The better result is returned.

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
    def inner(self) -> Mapping[str, Any]:
        """All settings of the inner solves by name, as a read-only mapping. An assignment changes the settings that it
        names, as for `settings`.
        """

    @inner.setter
    def inner(self, inner: Mapping[str, Any]) -> None: ...
    @property
    def outcome(self) -> Outcome:
        """The violation of limits and other results of the last solve, as an `Outcome`."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """All settings by name, as a read-only mapping.

        An assignment of a mapping changes the settings that it names; the others stay. The next `solve` or
        `resume` uses them: `solver.settings = {"tolerance": 1e-4}`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    @settings.setter
    def settings(self, settings: Mapping[str, Any]) -> None: ...
    @property
    def solution(self) -> Solution | None:
        """The `Solution` of the last solve, even if a signal or an error of an `Action` ended the solve
        ("interrupted"); None before the first solve.
        """

    @staticmethod
    def _make(problem: Problem, inner: dict[str, Any] | None, settings: dict[str, Any]) -> AugmentedLagrangian: ...
    def configure(self, **settings: float) -> None:
        """Changes settings by name, for the next `solve` or other call: `solver.configure(tolerance=1e-4)`.

        settings: settings of this solver; the others stay. This is the same as an assignment to `settings`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    def predict(self, x: ArrayLike, now: float, then: float) -> _Array:
        """Predicts the state at the time `then` from the state x at the time `now`: nx numbers. The last solution
        is executed meanwhile: the dynamics of the knots are integrated, with the controls of the policy,
        u = ū + K (x ⊖ x̄). The steps take at most 2 ms.

        A controller predicts the state at which its next plan begins, before it calls `retime` or `shift`.

        x: the measured state, nx numbers.
        now, then: times (s) after the beginning of knot 0 of the last solution. After the horizon, the last
            knot continues.

        Raises `ProblemError` for a number that is not finite, and for knots without duration, of an `Action`.
        """

    def publish(self, policy: Policy, start: float = 0.0) -> None:
        """Publishes the last solution for the threads that call a policy.

        policy: a `Policy` of the same problem.
        start: the time (s) at which knot 0 begins, on the clock of the policy's callers. Knots follow with
            their present durations; an impact takes no time.

        Raises `ProblemError` for knots without duration, of an `Action`, and if the problem was shifted and
        the solution was not.
        """

    def reset(self, x0: ArrayLike) -> None:
        """Forgets the last solution, and starts anew from a state: the recovery after the status "not_finite".

        The new trajectory has the state at all knots, the controls that hold it still, and no gains or
        multipliers; `resume` starts from it.

        x0: the state, nx numbers; it becomes the initial state of the problem.

        Raises `ProblemError` as `Problem.set_x0` does.
        """

    def resume(
        self, callback: Callable[[Iteration], object] | None = None, verbose: bool = False, progress: bool = False
    ) -> Solution:
        """Solves the problem from the last solution, with a new initial state or a shifted horizon. Returns a
        `Solution`.

        With a `time_budget`, one or two delayed solves do not make later solves shorter; each solve makes
        at least one iteration.

        callback, verbose, progress: as for `solve`.

        Raises `ProblemError` as `solve` does, and if there is no solution yet.
        """

    def retime(self, elapsed: float, knot_models: Sequence[int], durations: ArrayLike) -> int:
        """Moves the horizon by any time, gives its knots new models and durations, and turns the last solution
        into a warm start for it. A controller calls this method in each period, with knots from a `Schedule`.
        So the period is independent of the spacing of the knots, and contacts may begin and end at any time.

        Each new knot takes its numbers from the last solution at the same time. States are interpolated;
        a new knot has the controls, gains and multipliers of the old knot at its middle. If this knot has
        other contacts, the controls hold the state still, the gains are zero, and only limits with the same
        name keep their multipliers. After the end of the last solution, states and controls follow as in
        `shift`.

        Returns the number of knots that have passed. The costs and limits of single knots move by this number.
        A knot whose model changes has the costs and limits that its new model has for all knots, until
        `set_references` is called.

        elapsed: the time (s) from the beginning of knot 0 of the last solution to the beginning of the new
            horizon, at least 0.
        knot_models: the index of the model of each knot, N indices.
        durations: the duration (s) of each knot, N numbers, 0 for an impact.

        Raises `ProblemError` for invalid arguments, and before the first solve. Then nothing changes.
        """

    def set_multipliers(self, name: str, values: ArrayLike) -> None:
        """Sets the multipliers of the limit `name`. The next `solve` or `resume` starts from them.

        Other limits keep the multipliers of the last solve; without a solve, they start at 0. The penalty and `outcome`
        do not change. A positive number belongs to the upper bound, a negative one to the lower bound.

        name: the name of a limit of the problem.
        values: the multipliers, (N + 1, rows), as `outcome.multipliers_of(name)` returns them. Numbers at knots without
            this limit are ignored.

        Raises `ProblemError` if no limit has this name, or a number is not finite; then all multipliers are kept.
        """

    def shift(self, last: int) -> None:
        """Shifts the horizon of the problem and the last solution by a knot, as an MPC does after each step.

        `resume` then starts from the shifted solution. Knot t becomes knot t − 1, and keeps the costs and
        limits of this single knot. The new last knot has the model `last`, with the costs and limits that this
        model has for all knots. The last control is repeated, if the contacts are the same as at the knot
        before. If a robot's contacts change there, the last control holds the last state but one still, as
        `quasi_static` does. The last state follows from the last control. At a second shift without a solver
        step in between, the last state is repeated, because a rollout with repeated controls would diverge.

        last: the index of the new last knot's model.

        Raises `ProblemError` if the model does not exist.
        """

    def solve(
        self,
        xs: ArrayLike,
        us: _Controls,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
    ) -> Solution:
        """Solves the problem from a warm start. Returns a `Solution`; its status shows how the solve ended.

        Other threads can run meanwhile. Signals are checked about forty times a second, between the three
        phases of an iteration (derivatives, backward sweep, rollout). An exception of a signal handler, such as
        KeyboardInterrupt, ends the solve and is raised. Then `solution` is the best iterate, from which
        `resume` continues.

        xs: states, (N + 1, nx), which need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays if knots differ in nu.
        callback: a function that is called with the `Iteration` after each iteration. If the function returns
            False, the solve ends ("interrupted"). Exceptions of the callback end the solve and are raised.
        verbose: whether to print a line for each iteration.
        progress: whether to show the progress, with tqdm if it is installed, else as lines of text.

        Raises `ProblemError` for invalid numbers or settings, and exceptions raised by an `Action`.
        """

@final
class ConstrainedAction:
    """An action of any kind with a constraint lower ≤ g(x, u) ≤ upper, which `InteriorPoint` and `AugmentedLagrangian`
    enforce.

    `Fddp` without `AugmentedLagrangian` treats the constraint as a cost of values outside the bounds. For residuals of
    a robot, `Limit` is faster.

    action: the action.
    size: the number of entries of g, at most 4096.
    calc: a function of (t, x, u) that returns g; at a terminal knot u is empty.
    calc_diff: a function of (t, x, u) that returns (∂g/∂x, ∂g/∂u) of shapes (size, ndx) and (size, nu), in the tangent
        space of the state. Without calc_diff, central differences of calc are used.
    lower, upper: bounds of g, infinite for no bound. If both are None, the constraint is g = 0.

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
    """A knot of a robot in contact: M q̈ + h = S u + Jᵀλ and J q̈ + γ = 0, with the contact forces λ, the Jacobian J of
    the contacts, and γ as for `constrained_dynamics`. Integrator and cost are as for `FreeDynamics`.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name, which may be empty. Residuals refer to a contact by this name.
    dt: Δt in seconds.
    costs: a list of `Cost`.
    damping: μ in J M⁻¹ Jᵀ + μ 1 (1/kg), which makes this matrix invertible for redundant contacts.
    costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as for `FreeDynamics`.

    Raises `ProblemError` for a contact, cost, limit or actuation that does not fit the robot, and for two contacts on
    one body without damping.

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
        """Returns the controls that hold the robot still at the state x, nu numbers. Among all solutions, controls and
        contact forces together have the smallest norm.
        """

@final
class ContactInverseDynamics:
    """A knot of a robot in contact, whose controls are the nv accelerations of the robot and the forces of its contacts: u
    = (q̈, λ), and τ = M q̈ + h − Jᵀλ. Integrator and cost are as for `FreeDynamics`.

    By default the knot has two kinds of `Limit`, which keep a residual at zero. The limit named `undriven efforts`
    keeps Nᵀτ = 0. The columns of N are the directions without actuators, Nᵀ S = 0 with the actuation S. For a floating
    base, Nᵀτ are the first 6 efforts. A limit named `contact` and the contact's name keeps J q̈ + γ = 0, as in
    `constrained_dynamics`. `InteriorPoint` and `AugmentedLagrangian` enforce both limits; `Fddp` without
    `AugmentedLagrangian` treats them as costs. No matrix is inverted, so contacts may be redundant. The equations are
    the same as in Crocoddyl's `DifferentialActionModelContactInvDynamics`, and without contacts as in
    `DifferentialActionModelFreeInvDynamics`.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name, which also defines the order of λ. The dict may be empty.
    dt: Δt in seconds.
    costs: a list of `Cost`. In these costs, `Residual.joint_effort` depends on τ, and `Residual.contact_force` on λ.
    costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as for `FreeDynamics`. The actuation
    defines which efforts have actuators. Bounds apply to all controls: nv accelerations and the rows of λ.

    Raises `ProblemError` for a contact, cost, limit or actuation that does not fit the robot.

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
        """Returns the controls that hold the robot still at the state x: nv zeros, the accelerations, and the contact
        forces λ. Among all solutions, efforts and forces together have the smallest norm.
        """

@final
class ControlRate:
    """An action of any kind, with a cost of the change of the controls from knot to knot, ½ Σ wᵢ (uᵢ − pᵢ)², where p are
    the controls of the knot before.

    The state becomes (x, p), so nx and ndx grow by the number of controls; the next p is u. All models of a problem,
    and its terminal model, need the same number of weights. The initial state contains the controls before the first
    knot, such as those that the motors execute now. The derivatives are exact. An iteration takes longer than without
    `ControlRate`, about 1.8 times as long for a quadruped.

    action: the action. If it has controls, it has one for each weight. An action without controls, such as the terminal
        model, keeps p.
    weights: the weights w, at least 0. A weight w/Δt is the weight w of the squared rate of the controls.
    lower, upper: bounds of u − p, infinite for no bound, which `InteriorPoint` and `AugmentedLagrangian` enforce.
        Without controls, they are ignored.

    >>> from condyle.optimal import ControlRate, Fddp, Lqr, Problem
    >>> one = np.ones((1, 1))
    >>> knot = ControlRate(Lqr(one, one, Q=one, R=0.0 * one), [3.0])
    >>> end = ControlRate(Lqr(one, np.zeros((1, 0)), Q=one), [3.0])
    >>> problem = Problem([1.0, 0.0], [knot], [0] * 30, end)  # x = 1, and the control before is 0
    >>> plan = Fddp(problem).solve(np.zeros((31, 2)), np.zeros((30, 1)))
    >>> bool(-0.5 < plan.us[0, 0] < -0.2) and bool(plan.xs[1, 1] == plan.us[0, 0])
    True
    """

    def __new__(
        cls, action: _Action, weights: ArrayLike, lower: ArrayLike | None = None, upper: ArrayLike | None = None
    ) -> ControlRate: ...

@final
class Cost:
    """A term of a cost: weight times an activation of a residual.

    name: the name of the term for `Problem.set_weight` and in error messages.
    weight: finite and at least 0; a term whose weight is 0 is not computed.
    residual: a `Residual`.
    activation: an `Activation`. None chooses the barrier with the residual's bounds for a cone, a centre of pressure or
        distances, the sum for `Residual.own_cost`, and the quadratic cost for other residuals.

    >>> from condyle.optimal import Cost, Residual
    >>> Cost("effort", 1e-3, Residual.control([0.0] * 7))
    <condyle.optimal.Cost 'effort', weight 0.001>
    """

    def __new__(cls, name: str, weight: float, residual: Residual, activation: Activation | None = None) -> Cost: ...

@final
class DifferentialAction:
    """An action whose accelerations and cost per second are written in Python. An integrator advances the state by a time
    step.

    The state is x = (q, v). With semi-implicit Euler, v⁺ = v + q̈ Δt and q⁺ = q ⊕ (v Δt + q̈ Δt²). The cost is Δt ℓ,
    where ℓ is the cost per second.

    nv, nu: the sizes of a velocity and of a control, at most 4096; nu is 0 at a terminal knot.
    calc: a function of (t, x, u) that returns the accelerations, nv numbers, and the cost ℓ; at the terminal knot the
        accelerations may be None.
    dt: Δt in seconds, or None for a terminal knot, whose cost is ℓ.
    calc_diff: a function of (t, x, u) that returns a dict of the nonzero matrices among da_dq, da_dv, da_du, the
        derivatives of the accelerations, and q, r, Q, S, R, the derivatives of ℓ as for `Action`. Without calc_diff,
        calc is differentiated as for `Action`. The second derivatives of the accelerations, which a solver's
        `second_order` needs, are always computed from calc. They are zero if calc cannot be called with numbers that
        carry derivatives. Second derivatives of ⊕ are taken as zero.
    integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
    lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
    model: the robot that defines the positions q and the operation ⊕; None if q is a vector of nv numbers.
    controls: 'constant', 'linear' or 'quadratic', as for `FreeDynamics`.

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
    """The solver FDDP or DDP: differential dynamic programming, feasibility-driven or plain, with the equations and
    constants of Crocoddyl.

    If controls are bounded, the solver uses the equations of Crocoddyl's box solvers.

    problem: the problem to solve. All memory is allocated once, for the size of this problem.
    settings: any of the following settings, by name. `method`: "fddp" (default), whose trial steps keep a fraction of
        the gaps, or "ddp", whose trial steps are rollouts without gaps. `second_order`: whether to use the curvature of
        the dynamics if the models provide it (full DDP). `inverse_dynamics_form`: whether the sweep uses the equations
        of inverse dynamics at knots of robots, if possible (default: yes). The steps are the same and take less time.
        `project_warm_start`: whether `solve` and `resume` move controls of a warm start into their bounds (default:
        yes). Crocoddyl does not move them; for the iterates of Crocoddyl, use False. `time_budget` (s): a solve that
        has used up the budget returns its current result, with the status "time_limit". The first iteration always
        runs, unless the budget is 0. In later iterations, each phase (derivatives, backward sweep, rollout) runs only
        if the median of its last five durations fits into the budget. If a solve takes longer than the budget,
        `timings.overrun` is the excess. `segments`: the number of segments of the horizon on which a sweep works at the
        same time, at most 1024, default 1. The sweep uses as many threads as are available. The number of segments
        changes the results by rounding errors; the number of threads does not change them. `threads`: the number of
        threads that share an iteration on a robot (derivatives and gains, in parallel with the sweep), at most 1024,
        default 1. The results are bit-identical for any number of these threads. `max_iterations`, `tolerance`,
        `tolerance_bounded` (if controls are bounded), `step_lengths`, `accept`, `accept_ascent`, `flat`,
        `regularisation_start`, `regularisation_min`, `regularisation_max`, `regularisation_factor`,
        `regularisation_decrease_above`, `regularisation_increase_below`: the thresholds of the method.
    """

    def __new__(cls, problem: Problem, **settings: float | str | None) -> Fddp: ...
    @property
    def settings(self) -> Mapping[str, Any]:
        """All settings by name, as a read-only mapping.

        An assignment of a mapping changes the settings that it names; the others stay. The next `solve` or
        `resume` uses them: `solver.settings = {"tolerance": 1e-4}`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    @settings.setter
    def settings(self, settings: Mapping[str, Any]) -> None: ...
    @property
    def solution(self) -> Solution | None:
        """The `Solution` of the last solve, even if a signal or an error of an `Action` ended the solve
        ("interrupted"); None before the first solve.
        """

    @staticmethod
    def _make(problem: Problem, inner: dict[str, Any] | None, settings: dict[str, Any]) -> Fddp: ...
    def configure(self, **settings: float | str | None) -> None:
        """Changes settings by name, for the next `solve` or other call: `solver.configure(tolerance=1e-4)`.

        settings: settings of this solver; the others stay. This is the same as an assignment to `settings`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    def feedback(self, x0: ArrayLike, most: int = 1) -> Solution:
        """Sets the initial state to the measured state, and completes the prepared iteration with its gap and rollouts.
        Returns a `Solution`.

        For each state, the result is the result of `problem.set_x0(x0)` and `resume(stop="full_step", most=most)`, to
        the bit, because the sweep does not contain the initial state. `time_budget` applies to this call alone;
        `timings` contain both. Other threads can run meanwhile.

        x0: the measured state, nx numbers.
        most: the maximum number of iterations, at least 1. If the step is shorter than 1, whole iterations follow the
            prepared one, until a step of length 1.

        Raises `ProblemError` if nothing is prepared, and as `Problem.set_x0` does; then the preparation is kept. Raises
        exceptions raised by an `Action`.
        """

    def predict(self, x: ArrayLike, now: float, then: float) -> _Array:
        """Predicts the state at the time `then` from the state x at the time `now`: nx numbers. The last solution
        is executed meanwhile: the dynamics of the knots are integrated, with the controls of the policy,
        u = ū + K (x ⊖ x̄). The steps take at most 2 ms.

        A controller predicts the state at which its next plan begins, before it calls `retime` or `shift`.

        x: the measured state, nx numbers.
        now, then: times (s) after the beginning of knot 0 of the last solution. After the horizon, the last
            knot continues.

        Raises `ProblemError` for a number that is not finite, and for knots without duration, of an `Action`.
        """

    def prepare(self) -> None:
        """Makes the first half of an iteration before the state arrives: derivatives and sweep along the trajectory of the
        last solution. `feedback` makes the second half.

        In each period, call `shift`, set references, call `prepare`, and then wait for the state. The prediction is the
        first state of the shifted solution; it becomes `problem.x0`. Do not change the problem until `feedback`. A
        direction that is not found is reported by `feedback`. Other threads can run meanwhile.

        Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
        """

    def publish(self, policy: Policy, start: float = 0.0) -> None:
        """Publishes the last solution for the threads that call a policy.

        policy: a `Policy` of the same problem.
        start: the time (s) at which knot 0 begins, on the clock of the policy's callers. Knots follow with
            their present durations; an impact takes no time.

        Raises `ProblemError` for knots without duration, of an `Action`, and if the problem was shifted and
        the solution was not.
        """

    def reset(self, x0: ArrayLike) -> None:
        """Forgets the last solution, and starts anew from a state: the recovery after the status "not_finite".

        The new trajectory has the state at all knots, the controls that hold it still, and no gains or
        multipliers; `resume` starts from it.

        x0: the state, nx numbers; it becomes the initial state of the problem.

        Raises `ProblemError` as `Problem.set_x0` does.
        """

    def resume(
        self,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
        *,
        stop: Literal["full_step"] | None = None,
        most: int | None = None,
    ) -> Solution:
        """Solves the problem from the last solution, with a new initial state or a shifted horizon. Returns a
        `Solution`.

        With a `time_budget`, one or two delayed solves do not make later solves shorter; each solve makes at least one
        iteration. If the last solve ran out of time or iterations after a rejected step, the regularisation starts at
        its last value, otherwise at `regularisation_start`.

        stop: "full_step" ends the solve when a step of length 1 is accepted, with the status "full_step". This is the
            mode for model predictive control. After the state has moved, the warm start has a gap at x₀. Shorter steps
            of length α keep the fraction 1 − α of each gap, and gaps may grow from period to period. A step of length 1
            closes all gaps. None (default) iterates until the solve has converged.
        most: the maximum number of iterations, at least 1; None (default) takes `max_iterations` of the settings. Only
            with `stop`.
        callback, verbose, progress: as for `solve`.

        Raises `ProblemError` as `solve` does, and if there is no solution yet.
        """

    def retime(self, elapsed: float, knot_models: Sequence[int], durations: ArrayLike) -> int:
        """Moves the horizon by any time, gives its knots new models and durations, and turns the last solution
        into a warm start for it. A controller calls this method in each period, with knots from a `Schedule`.
        So the period is independent of the spacing of the knots, and contacts may begin and end at any time.

        Each new knot takes its numbers from the last solution at the same time. States are interpolated;
        a new knot has the controls, gains and multipliers of the old knot at its middle. If this knot has
        other contacts, the controls hold the state still, the gains are zero, and only limits with the same
        name keep their multipliers. After the end of the last solution, states and controls follow as in
        `shift`.

        Returns the number of knots that have passed. The costs and limits of single knots move by this number.
        A knot whose model changes has the costs and limits that its new model has for all knots, until
        `set_references` is called.

        elapsed: the time (s) from the beginning of knot 0 of the last solution to the beginning of the new
            horizon, at least 0.
        knot_models: the index of the model of each knot, N indices.
        durations: the duration (s) of each knot, N numbers, 0 for an impact.

        Raises `ProblemError` for invalid arguments, and before the first solve. Then nothing changes.
        """

    def shift(self, last: int) -> None:
        """Shifts the horizon of the problem and the last solution by a knot, as an MPC does after each step.

        `resume` then starts from the shifted solution. Knot t becomes knot t − 1, and keeps the costs and
        limits of this single knot. The new last knot has the model `last`, with the costs and limits that this
        model has for all knots. The last control is repeated, if the contacts are the same as at the knot
        before. If a robot's contacts change there, the last control holds the last state but one still, as
        `quasi_static` does. The last state follows from the last control. At a second shift without a solver
        step in between, the last state is repeated, because a rollout with repeated controls would diverge.

        last: the index of the new last knot's model.

        Raises `ProblemError` if the model does not exist.
        """

    def solve(
        self,
        xs: ArrayLike,
        us: _Controls,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
    ) -> Solution:
        """Solves the problem from a warm start. Returns a `Solution`; its status shows how the solve ended.

        Other threads can run meanwhile. Signals are checked about forty times a second, between the three
        phases of an iteration (derivatives, backward sweep, rollout). An exception of a signal handler, such as
        KeyboardInterrupt, ends the solve and is raised. Then `solution` is the best iterate, from which
        `resume` continues.

        xs: states, (N + 1, nx), which need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays if knots differ in nu.
        callback: a function that is called with the `Iteration` after each iteration. If the function returns
            False, the solve ends ("interrupted"). Exceptions of the callback end the solve and are raised.
        verbose: whether to print a line for each iteration.
        progress: whether to show the progress, with tqdm if it is installed, else as lines of text.

        Raises `ProblemError` for invalid numbers or settings, and exceptions raised by an `Action`.
        """

@final
class FreeDynamics:
    """A knot of a robot that moves freely under its joints' efforts.

    q̈ = aba(q, v, S u). With semi-implicit Euler, v⁺ = v + q̈ Δt and q⁺ = q ⊕ (v Δt + q̈ Δt²). The cost is Δt Σ w a(r)
    over all `Cost`s, with weight w, activation a and residual r. The state is x = (q, v).

    model: the robot.
    dt: Δt in seconds, or None for a terminal knot, which has no controls and the cost Σ w a(r).
    costs: a list of `Cost`.
    costs_at: lists of `Cost` by index of the knot. At these knots they replace `costs`, so one action can serve all
        knots of a contact phase.
    actuation: S, (nv, nu); by default each joint has a control, except a free-flyer at the root.
    integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
    lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
    limits: a list of `Limit`, or None; `InteriorPoint` and `AugmentedLagrangian` enforce them.
    limits_at: lists of `Limit` by index of the knot. At these knots they replace `limits`.
    controls: the polynomial that the controls follow within a knot: 'constant', 'linear' or 'quadratic'. The knot then
        has nu, 2 nu or 3 nu controls: one value of u; values at the times 0 and Δt/2; or values at 0, Δt/2 and Δt
        ('runge_kutta_3': 0, Δt/3 and 2 Δt/3). Bounds apply to each of these values.

    Raises `ProblemError` for a cost, a limit or an actuation that does not fit the robot.
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
        """Returns the efforts that hold the robot still at the state x, nu numbers."""

@final
class FreeInverseDynamics:
    """A knot of a robot whose nv controls are the robot's accelerations: q̈ = u, τ = rnea(q, v, u). Integrator and cost
    are as for `FreeDynamics`.

    model: the robot.
    dt: Δt in seconds.
    costs: a list of `Cost`. In these costs, `Residual.joint_effort` depends on τ, and `Residual.undriven_effort` on the
        efforts without actuators.
    integrator, lower, upper, limits, controls: as for `FreeDynamics`.

    Raises `ProblemError` for a cost or a limit that does not fit the robot.
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
    ) -> FreeInverseDynamics: ...
    @staticmethod
    def _from_parts(model: Model, text: str, written: list[tuple[int, Residual]]) -> FreeInverseDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """Returns the accelerations that hold the robot still: nv zeros."""

@final
class FrictionCone:
    """Coulomb's friction cone ‖f_t‖ ≤ μ f_n of a force f with tangential part f_t and normal component f_n, as a pyramid.
    The pyramid and the bounds on the normal force are the rows lower ≤ A f ≤ upper.

    mu: μ; facets: the number of the pyramid's sides, even, 4 to 1000; inner: whether the pyramid lies inside the cone;
    rotation: the surface's axes in the contact's axes, (3, 3), with the surface's normal as z axis; least, greatest:
    bounds on the normal force (N), by default 0 and infinite.

    Raises `ProblemError` if μ is negative or not finite, facets is odd or not from 4 to 1000, or rotation is not a
    rotation matrix.

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
        """Returns the lower and upper bounds of A f."""

    def rows(self) -> _Array:
        """Returns the matrix A, (facets + 1, 3)."""

@final
class ImpulseDynamics:
    """A knot at which contacts begin with an impact: q⁺ = q, v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v, with the
    inertia matrix M and the Jacobian J of the contacts. The cost is Σ w a(r), as for `FreeDynamics` without Δt.

    An impact has no controls.

    model: the robot.
    contacts: a dict of `ContactConstraint`s by name.
    costs: a list of `Cost`, which are evaluated at the state before the impact.
    restitution: ε, 0 to 1.
    damping: μ (1/kg).
    limits: a list of `Limit`, or None; limits are also evaluated at the state before the impact.

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
        """Returns an empty array, since an impact has no controls."""

@final
class InteriorPoint:
    """The primal–dual interior point method with multiple shooting: for robots with `Limit`s, bounds on controls, and
    `ConstrainedAction`s.

    A slack variable s replaces each limited number. The method replaces each bound by a barrier term −μ log(s − lower)
    or −μ log(upper − s). It makes Newton steps for states, controls, slack variables and multipliers, while μ falls to
    zero. Each step is a single sweep over the horizon, which costs little more than a sweep without limits. A filter
    accepts a step if either the violation or the cost with barrier terms decreases enough. If no step is accepted,
    or the violation stalls, the method starts anew with careful steps. Later, a restoration reduces the violation
    alone.

    Use `InteriorPoint` for problems with limits, and `tick` for model predictive control with limits. It takes fewer
    iterations than `AugmentedLagrangian`, but its trajectory has gaps until it converges. Use `AugmentedLagrangian`
    if `InteriorPoint` does not converge, or if the result of each iteration must satisfy the dynamics. Use `Fddp` if
    there are no limits.

    `solve` computes the first slack variables and multipliers from the warm start. `resume` and `tick` begin with the
    slack variables and multipliers of the last solve, and `shift` also shifts them. `settings` may be assigned before
    each of these calls. The status is "converged" if the gradient of the Lagrangian, the complementarity and the gaps
    are below the tolerance, and the violation is below a tenth of it. A violated limit is never reported as
    "converged". The status is "infeasible" if the restoration ended where no small step reduces the violation, or if
    the initial state itself violates a limit of knot 0 that no control can change. The first case does not prove that
    no solution exists: another warm start may find one. The status is "constraints_violated" if the restoration reached
    its maximum number of iterations. `outcome.worst` contains the knot, the limit and the amount of the largest
    violation. "regularisation_limit", "max_iterations", "time_limit", "interrupted" and "not_finite" have the same
    meanings as for `Fddp`; the solution is then the best iterate. The status is also "regularisation_limit" if the
    residuals no longer decrease near a solution. The costs of the solution and of `outcome` are equal and do not
    include terms of the limits. A soft `Limit` gives way where it costs less than to hold it. Its cost is
    `outcome.soft_cost`, and `outcome.gave_way` lists the rows that gave way.

    The gains K contain the limits. Near a bound, the feedback is stiff in the direction of this bound. With μ near
    zero, active rows are equations: K does not move a control that is at its bound, and keeps other active limits at
    their bounds for small deviations of the state. Rows that are not active do not change K.

    problem: the problem to solve. All memory is allocated once, for the size of this problem.
    settings: any of the following settings, by name. `tolerance`: see above, default 1e-6; the gradient and the
        complementarity are scaled as in IPOPT. `max_iterations`: default 300. `barrier_start`: μ of the first
        iteration; None (default) chooses the cost of the warm start divided by the number of bounds. `tick_barrier`:
        the largest μ of a `tick`, in the unit of the cost, default 0.1. `second_order`:
        whether to use the curvature of the dynamics near the solution, if the models provide it. This saves iterations
        if this curvature is large compared with the costs. With soft limits, the curvature is used from the start, or,
        without this setting, once the residuals have not decreased for eight iterations. `inverse_dynamics_form`,
        `time_budget` (s), `threads`: as for `Fddp`; the results are bit-identical for any number of threads.
        `regularisation_min`, `regularisation_max`: the smallest and the largest regularisation; a solve that reaches
        the largest one stops.

    >>> from condyle.optimal import Cost, FreeDynamics, InteriorPoint, Limit, Problem, Residual
    >>> arm = condyle.robots.arm7()
    >>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    >>> costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    >>> weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
    >>> knot = FreeDynamics(arm, 0.05, costs, limits=[weak])
    >>> reach = Limit("reach", Residual.frame_translation(arm, "tool", [0.5, 0.1, 0.6]))  # exactly
    >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [], limits=[reach]))
    >>> solver = InteriorPoint(problem)
    >>> solution = solver.solve(np.tile(x0, (11, 1)), np.tile(knot.quasi_static(x0), (10, 1)))
    >>> solution.status, bool(np.abs(solution.us).max() < 30.0 + 1e-6), solver.outcome.primal < 1e-6
    ('converged', True, True)
    >>> solver.shift(0)
    >>> problem.set_x0(solution.xs[1])
    >>> solver.tick(2).us.shape
    (10, 7)
    """

    def __new__(cls, problem: Problem, **settings: float | None) -> InteriorPoint: ...
    @property
    def outcome(self) -> Outcome:
        """The violation of limits and other results of the last solve or tick, as an `Outcome`."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """All settings by name, as a read-only mapping.

        An assignment of a mapping changes the settings that it names; the others stay. The next `solve` or
        `resume` uses them: `solver.settings = {"tolerance": 1e-4}`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    @property
    def solution(self) -> Solution | None:
        """The `Solution` of the last solve, even if a signal or an error of an `Action` ended the solve
        ("interrupted"); None before the first solve.
        """

    @staticmethod
    def _make(problem: Problem, inner: dict[str, Any] | None, settings: dict[str, Any]) -> InteriorPoint: ...
    def configure(self, **settings: float | None) -> None:
        """Changes settings by name, for the next `solve` or other call: `solver.configure(tolerance=1e-4)`.

        settings: settings of this solver; the others stay. This is the same as an assignment to `settings`.

        Raises `ProblemError` for an invalid number; then no setting changes.
        """

    def feedback(self, x0: ArrayLike) -> Solution:
        """Sets the initial state to the measured state, and completes the prepared tick. Returns a `Solution`.

        If the state equals the prediction, the result is the result of `problem.set_x0(x0)` and `tick`, to the bit.
        Elsewhere, the linearisation remains the one along the prediction, and the difference enters the last step. If
        the difference is so large that other limits may become active, one new sweep replaces the prepared ones.
        `time_budget` applies to this call alone; `timings` contain both. Other threads can run meanwhile.

        x0: the measured state, nx numbers.

        Raises `ProblemError` if nothing is prepared, and as `Problem.set_x0` does; then the preparation is kept. Raises
        exceptions raised by an `Action`.
        """

    def predict(self, x: ArrayLike, now: float, then: float) -> _Array:
        """Predicts the state at the time `then` from the state x at the time `now`: nx numbers. The last solution
        is executed meanwhile: the dynamics of the knots are integrated, with the controls of the policy,
        u = ū + K (x ⊖ x̄). The steps take at most 2 ms.

        A controller predicts the state at which its next plan begins, before it calls `retime` or `shift`.

        x: the measured state, nx numbers.
        now, then: times (s) after the beginning of knot 0 of the last solution. After the horizon, the last
            knot continues.

        Raises `ProblemError` for a number that is not finite, and for knots without duration, of an `Action`.
        """

    def prepare(self, sweeps: int = 2) -> None:
        """Makes the part of a tick that does not depend on the measured state, before the state arrives: the
        linearisation along the last trajectory, all steps but the last one, and the last sweep. `feedback` makes the
        rest.

        In each period, call `shift`, set references, call `prepare`, and then wait for the state. The prediction is the
        first state of the shifted solution; it becomes `problem.x0`. Do not change the problem until `feedback`, which
        also reports a failed sweep. Other threads can run meanwhile. `time_budget` does not apply.

        sweeps: the maximum number of steps, at least 1, as for `tick`.

        Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
        """

    def publish(self, policy: Policy, start: float = 0.0) -> None:
        """Publishes the last solution for the threads that call a policy.

        policy: a `Policy` of the same problem.
        start: the time (s) at which knot 0 begins, on the clock of the policy's callers. Knots follow with
            their present durations; an impact takes no time.

        Raises `ProblemError` for knots without duration, of an `Action`, and if the problem was shifted and
        the solution was not.
        """

    def reset(self, x0: ArrayLike) -> None:
        """Forgets the last solution, and starts anew from a state: the recovery after the status "not_finite".

        The new trajectory has the state at all knots, the controls that hold it still, and no gains or
        multipliers; `resume` starts from it.

        x0: the state, nx numbers; it becomes the initial state of the problem.

        Raises `ProblemError` as `Problem.set_x0` does.
        """

    def resume(
        self, callback: Callable[[Iteration], object] | None = None, verbose: bool = False, progress: bool = False
    ) -> Solution:
        """Solves the problem from the last solution, with a new initial state or a shifted horizon. Returns a
        `Solution`.

        With a `time_budget`, one or two delayed solves do not make later solves shorter; each solve makes
        at least one iteration.

        callback, verbose, progress: as for `solve`.

        Raises `ProblemError` as `solve` does, and if there is no solution yet.
        """

    def retime(self, elapsed: float, knot_models: Sequence[int], durations: ArrayLike) -> int:
        """Moves the horizon by any time, gives its knots new models and durations, and turns the last solution
        into a warm start for it. A controller calls this method in each period, with knots from a `Schedule`.
        So the period is independent of the spacing of the knots, and contacts may begin and end at any time.

        Each new knot takes its numbers from the last solution at the same time. States are interpolated;
        a new knot has the controls, gains and multipliers of the old knot at its middle. If this knot has
        other contacts, the controls hold the state still, the gains are zero, and only limits with the same
        name keep their multipliers. After the end of the last solution, states and controls follow as in
        `shift`.

        Returns the number of knots that have passed. The costs and limits of single knots move by this number.
        A knot whose model changes has the costs and limits that its new model has for all knots, until
        `set_references` is called.

        elapsed: the time (s) from the beginning of knot 0 of the last solution to the beginning of the new
            horizon, at least 0.
        knot_models: the index of the model of each knot, N indices.
        durations: the duration (s) of each knot, N numbers, 0 for an impact.

        Raises `ProblemError` for invalid arguments, and before the first solve. Then nothing changes.
        """

    def set_multipliers(self, name: str, values: ArrayLike) -> None:
        """Sets the multipliers of the limit `name`. The next `solve`, `resume` or `tick` starts from them.

        Other limits keep the multipliers of the last solve; without a solve, they start as usual. `outcome` does not
        change. A positive number belongs to the upper bound, a negative one to the lower bound. Numbers without such a
        bound have no effect, and numbers far from the central path are moved towards it.

        name: the name of a limit of the problem.
        values: the multipliers, (N + 1, rows), as `outcome.multipliers_of(name)` returns them. Numbers at knots without
            this limit are ignored.

        Raises `ProblemError` if no limit has this name, or a number is not finite; then all multipliers are kept.
        """

    def shift(self, last: int) -> None:
        """Shifts the horizon of the problem and the last solution by a knot, as an MPC does after each step.

        `resume` then starts from the shifted solution. Knot t becomes knot t − 1, and keeps the costs and
        limits of this single knot. The new last knot has the model `last`, with the costs and limits that this
        model has for all knots. The last control is repeated, if the contacts are the same as at the knot
        before. If a robot's contacts change there, the last control holds the last state but one still, as
        `quasi_static` does. The last state follows from the last control. At a second shift without a solver
        step in between, the last state is repeated, because a rollout with repeated controls would diverge.

        last: the index of the new last knot's model.

        Raises `ProblemError` if the model does not exist.
        """

    def solve(
        self,
        xs: ArrayLike,
        us: _Controls,
        callback: Callable[[Iteration], object] | None = None,
        verbose: bool = False,
        progress: bool = False,
    ) -> Solution:
        """Solves the problem from a warm start. Returns a `Solution`; its status shows how the solve ended.

        Other threads can run meanwhile. Signals are checked about forty times a second, between the three
        phases of an iteration (derivatives, backward sweep, rollout). An exception of a signal handler, such as
        KeyboardInterrupt, ends the solve and is raised. Then `solution` is the best iterate, from which
        `resume` continues.

        xs: states, (N + 1, nx), which need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays if knots differ in nu.
        callback: a function that is called with the `Iteration` after each iteration. If the function returns
            False, the solve ends ("interrupted"). Exceptions of the callback end the solve and are raised.
        verbose: whether to print a line for each iteration.
        progress: whether to show the progress, with tqdm if it is installed, else as lines of text.

        Raises `ProblemError` for invalid numbers or settings, and exceptions raised by an `Action`.
        """

    def tick(self, sweeps: int = 2) -> Solution:
        """Makes one linearisation at the last trajectory and up to `sweeps` Newton steps for its quadratic program, as a
        controller does in each period. Returns a `Solution`.

        No step length is searched, so the time is known in advance. The result is close to the optimum only if the last
        trajectory is: begin with a `solve`, then `shift`, `set_x0` and `tick` in each period. Other threads can run
        meanwhile. The status is "converged" if the quadratic program is solved, "max_iterations" after all steps,
        and "time_limit" if the `time_budget` ended the steps. The first step is always made. The cost, the gap and
        `outcome` belong to the trajectory before the tick, from the present initial state. `outcome.dual` is infinite,
        because a tick does not measure it. The gains belong to the last step.

        sweeps: the maximum number of steps, at least 1. Two steps follow changes of the active limits better than one.

        Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
        """

@final
class Limit:
    """Bounds on a residual r of a robot, lower ≤ r ≤ upper, which `InteriorPoint` and `AugmentedLagrangian` enforce.

    Limits apply at the beginning of a knot. `Fddp` without `AugmentedLagrangian` treats limits as costs of values
    outside the bounds.

    name: the name of the limit in error messages.
    residual: a `Residual`.
    lower, upper: as many numbers as r has, infinite for no bound; None is no bound. If both are None, a cone, a centre
        of pressure and distances have their own bounds, and every other r must be 0. An entry with equal lower and
        upper bounds is an equality.
    soft: two weights, linear and quadratic, with which the limit gives way: a number that is outside its bounds by e
        costs linear · e + ½ quadratic · e². The weights must be at least 0, and one of them must be above 0. None is a
        hard limit. A soft limit never makes a problem infeasible. `outcome.gave_way` lists the rows that gave way.

    >>> from condyle.optimal import Limit, Residual
    >>> Limit("effort", Residual.control([0.0] * 7), lower=[-30.0] * 7, upper=[30.0] * 7)
    <condyle.optimal.Limit 'effort'>
    >>> Limit("effort", Residual.control([0.0] * 7), upper=[30.0] * 7, soft=(1.0, 0.0))
    <condyle.optimal.Limit 'effort', soft (1.0, 0.0)>
    """

    def __new__(
        cls,
        name: str,
        residual: Residual,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        soft: tuple[float, float] | None = None,
    ) -> Limit: ...

@final
class Lqr:
    """An action with linear dynamics x⁺ = A x + B u + f, the quadratic cost ½ xᵀQx + xᵀSu + ½ uᵀRu + qᵀx + rᵀu, and bounds
    lower ≤ u ≤ upper.

    A, Q: (nx, nx); B, S: (nx, nu); R: (nu, nu); f, q: nx numbers; r, lower, upper: nu numbers. None means zero, or no
    bounds. Without R and B the action has no controls, as at a terminal knot. nx and nu are at most 4096.

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
class Policy:
    """The feedback u = ū + K (x ⊖ x̄) of the last published solution, as a function of time and state.

    Another thread can call the policy at its own rate while a solve runs, without waiting for the solve: the solver
    publishes a solution into memory that is not being read. `solver.publish(policy, start)` publishes the last solution
    of a solver.

    `policy(t, x)` returns the controls at the time t (s), on the clock of `start`, and at the state x: nu numbers,
    moved into the bounds of the knot. x̄ is the plan's state at the time t, interpolated between two knots; ū and K are
    the controls and gains of the knot. If x has a number that is not finite, u is ū without feedback. Before the first
    knot, x̄ is the first state; after the horizon, x̄ is the last state. A call raises `ProblemError` if no solution was
    published yet.

    problem: the problem that the solver solves, of a robot.

    Raises `ProblemError` if the terminal model does not belong to a robot.

    >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Policy, Problem, Residual
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> knot = FreeDynamics(arm, 0.02, [Cost("effort", 1.0, Residual.control(np.zeros(7)))])
    >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [Cost("rest", 1.0, Residual.state(x0))]))
    >>> solver, policy = Fddp(problem), Policy(problem)
    >>> solution = solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7)))
    >>> solver.publish(policy, start=3.0)
    >>> policy(3.01, x0 + 1e-3).shape
    (7,)
    """

    def __new__(cls, problem: Problem) -> Policy: ...
    @property
    def end(self) -> float | None:
        """The time of the end of the published plan (s); None before the first plan. A plan is too old after this time."""

    def __call__(self, t: float, x: ArrayLike) -> _Array: ...

@final
class Problem:
    """An optimal control problem: a sequence of knots that begins at the state x0, and a terminal knot. Each knot has one
    of the models.

    x0: the initial state, nx numbers.
    models: a list of `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`, `FreeInverseDynamics`,
        `ContactInverseDynamics`, `Action`, `DifferentialAction`, `ConstrainedAction`, `ControlRate`, `Lqr`,
        `Unicycle`.
    knot_models: for each knot, the index of the knot's model; None if knot t has model t. Consecutive knots are
        computed as a group in two cases: they have the same model, or their models belong to one robot and differ only
        in costs and limits.
    terminal: the model of the terminal knot, without controls.

    Raises `ProblemError` if the models do not fit together, or if x0 is not finite or contains a rotation whose length
    is not 1 (up to 1e-3). Also raises `ProblemError` for more than 2²⁰ knots, and for more than 4096 numbers in a state
    or in the controls of a knot. The matrices [A B], the derivatives of the next states, may have at most 2²⁸ numbers
    in all knots together.
    """

    def __new__(
        cls, x0: ArrayLike, models: Sequence[_Action], knot_models: Sequence[int] | None, terminal: _Action
    ) -> Problem: ...
    @property
    def horizon(self) -> int:
        """The number N of knots before the terminal knot."""

    @property
    def ndx(self) -> int:
        """The number of entries of a change of a state."""

    @property
    def nx(self) -> int:
        """The number of entries of a state."""

    @property
    def x0(self) -> _Array:
        """The initial state, nx numbers; `set_x0` sets it."""

    def _between(self, x0: ArrayLike, x1: ArrayLike, s: float) -> _Array:
        """Computes the state at a fraction of the way from x0 to x1. Locks nothing, so it can run during a solve."""

    def _evaluate(self, xs: ArrayLike, us: _Controls, moved: int) -> Evaluation:
        """Computes the evaluation of a solution; an error if the horizon was shifted after the solve."""

    @staticmethod
    def _from_parts(x0: ArrayLike, parts: Sequence[Any], knot_models: Sequence[int] | None) -> Problem: ...
    def derivatives(self, xs: ArrayLike, us: _Controls) -> list[LqKnot]:
        """Computes the linear-quadratic approximation of the problem around states and controls: a list of N + 1
        `LqKnot`s, which a `Sweep` solves.

        xs, us: as for `evaluate`.
        """

    def evaluate(self, xs: ArrayLike, us: _Controls) -> Evaluation:
        """Computes the cost of given states and controls, and the results of the dynamics for these states and controls,
        as an `Evaluation`.

        xs: states, (N + 1, nx), which need not satisfy the dynamics.
        us: controls, (N, nu), or a list of N arrays if knots differ in nu.
        """

    @staticmethod
    def from_json(text: str) -> Problem:
        """Reads a robot's problem from the text that `to_json` returned.

        Raises `ProblemError` if the text is not a problem, if models, states or costs do not fit together, or if a size
        is beyond the limits of `Problem`.
        """

    def parameter(self, parameter: str) -> _Array:
        """Returns the value of a parameter, a vector. A matrix is stored row by row: 9 numbers for a rotation, and 16 for
        a placement.

        parameter: the name of the parameter, see `parameters`.

        Raises `ProblemError` if the parameter does not exist, or if its value differs from knot to knot.
        """

    def parameter_values(self, parameters: Sequence[str] | None = None) -> dict[str, _Array]:
        """Returns the values of parameters: a dict of vectors by name, which `set_parameters` sets.

        parameters: the names; None for all parameters whose value is the same at all knots.

        Raises `ProblemError` as `parameter` does, if names are given.
        """

    def parameters(self) -> dict[str, int]:
        """Returns the names of all parameters, with the numbers of entries of their values: a dict.

        "x0" is the initial state and "duration" the duration of all knots. A cost NAME has the parameters
        "target/NAME", "weight/NAME" and "entry_weights/NAME". "contact/NAME" is the placement of a contact.
        "bounds/lower" and "bounds/upper" are the bounds on controls. "friction/NAME" is the coefficient of friction of
        the cones that are a limit or a cost NAME. The robot has the parameters "inertia/LINK", the ten
        `inertial_parameters` of a link, "gravity" and "armature".
        """

    def quasi_static(self, xs: ArrayLike) -> _Array | list[_Array]:
        """Computes the quasi-static controls of all knots, which hold the state of each knot still as well as possible:
        (N, nu), or a list of N arrays if knots differ in nu. The controls of robots are computed by statics, the
        controls of other actions by Newton's method.

        xs: states, (N + 1, nx).
        """

    def references(self, name: str) -> _Array:
        """Returns the targets of the cost with this name at all knots: a copy of shape (N + 1, n) for a target of n
        numbers, (N + 1, 3, 3) for rotations, and (N + 1, 4, 4) for placements. Rows of knots without this cost are NaN.

        Raises `KeyError` if no knot has this cost, or if its residual has no target.
        """

    def rollout(self, us: _Controls) -> _Array:
        """Computes the states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).

        us: controls, (N, nu), or a list of N arrays if knots differ in nu.

        Other threads can run meanwhile. An exception of a signal handler, such as KeyboardInterrupt, stops the rollout
        between knots.
        """

    def set_contact(
        self,
        contact: str,
        placement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        acceleration: ArrayLike | None = None,
        kp: ArrayLike | None = None,
        kd: float | None = None,
    ) -> None:
        """Changes targets and gains of the contact with this name at all knots that have it, without making new models.
        Call this method between solves.

        contact: the name of the contact.
        placement, velocity, acceleration, kp, kd: as in `ContactConstraint`; None keeps the old value.

        Contacts belong to the dynamics, which the knots of a stance share. Knots with another target, such as the next
        foothold, need a model of their own.

        Raises `KeyError` if no knot has this contact, and `ProblemError` for invalid numbers.
        """

    def set_costs(self, knot: int, costs: Sequence[Cost]) -> None:
        """Replaces the costs of a single knot, for example by costs with new targets of an MPC. In a `shift`, these costs
        move with the knot. Call this method between solves.

        knot: the index of the knot, 0 to N; N is the terminal knot.
        costs: a list of `Cost`.

        Raises `ProblemError` if a term does not fit the robot, or if the knot's action does not belong to a robot.
        """

    def set_duration(self, knot: int, dt: float) -> None:
        """Sets the duration of a single knot; the knot's model keeps its duration at all other knots. Call this method
        between solves. The solver's next iterations do not allocate.

        knot: the index of the knot, 0 to N − 1.
        dt: the duration (s).

        Raises `ProblemError` if dt is not above 0, or if the knot's action does not belong to a robot or is an impact.
        """

    def set_entry_weights(self, name: str, weights: ArrayLike) -> None:
        """Writes new weights of the entries of the residual, for a cost with `Activation.weighted` or
        `weighted_barrier`, at all knots. Call this method between solves.

        name: the name of the cost.
        weights: the weights, (N + 1, n); otherwise as for `set_references`.

        Raises `KeyError` if no knot has this cost, and `ProblemError` if its activation has no weights, or a weight is
        negative or not finite.
        """

    def set_knot(self, knot: int, model: _Action) -> None:
        """Replaces the model of a knot, as an MPC does when a contact is made earlier than planned. Call this method
        between solves. The solver's next iterations do not allocate.

        knot: the index of the knot, 0 to N − 1.
        model: the new model, whose state and controls have the same sizes as in the old model. Costs that the model has
            for single knots belong to the knots of this problem with the same index.

        Raises `ProblemError` if the model does not fit.
        """

    def set_knots(self, knot_models: Sequence[int], durations: ArrayLike) -> None:
        """Sets the models and durations of all knots, before the first solve. Later, `retime` of a solver also moves its
        solution.

        knot_models: the index of the model of each knot, N indices.
        durations: the duration (s) of each knot, N numbers, 0 for an impact.

        A knot whose model changes has the costs and limits that its new model has for all knots.

        Raises `ProblemError` for an unknown model, for a duration that is not above 0 or not 0 at an impact, and for a
        new duration of an action that does not belong to a robot. Then nothing changes.
        """

    def set_parameter(self, parameter: str, values: ArrayLike) -> None:
        """Sets a parameter at all knots that have it, without building the problem again. Solvers continue with it.

        parameter: the name of the parameter, see `parameters`.
        values: the vector, as `parameter` returns it.

        Numbers of a robot replace the robot of this problem alone. They take longer to set than other parameters,
        because workspaces are allocated again.

        Raises `ProblemError` if the parameter does not exist, for a wrong size or invalid numbers, for an inertia that
        no body has, and if the inertia matrix becomes singular.
        """

    def set_parameters(self, values: Mapping[str, ArrayLike]) -> None:
        """Sets several parameters, as `set_parameter` does, in the order of the dict.

        values: a dict of vectors by name.

        Raises `ProblemError` as `set_parameter` does. Parameters before the one in the message have their new values.
        """

    def set_placements(self, name: str, placements: ArrayLike) -> None:
        """Sets the placements of a geometry in `Residual.distances`, in costs and limits, at all knots: for example of an
        obstacle that moves while the plan is executed. Call this method between solves.

        name: the name of the `Geometry`.
        placements: the poses (N + 1, 4, 4) in the world, or in the frame of the geometry, at the knots 0 … N.

        Knots with this geometry get separate costs and limits, which move with the knot in `shift`.

        Raises `KeyError` if no pair has this geometry, and `ProblemError` for a placement that is no pose.
        """

    def set_references(self, name: str, values: ArrayLike) -> None:
        """Writes new targets of the cost with this name at all knots, without making new costs. An MPC calls this in
        each period, between solves.

        name: the name of the cost.
        values: the targets, in the shape that `references` returns. Row t belongs to knot t, and row N to the terminal
            knot. Rows of knots without this cost are ignored.

        A knot that shares its costs with other knots first gets separate costs with the same terms. They move with the
        knot in a `shift`. Later calls write in place and allocate nothing; 25 knots of a quadruped take a few
        microseconds.

        Raises `KeyError` as `references` does, and `ProblemError` if a target is not finite or not a rotation. Then the
        knots before the one in the message have their new targets.
        """

    def set_weight(self, name: str, weight: float | ArrayLike) -> None:
        """Changes the weight of all cost terms with this name, in all knots including the terminal knot. Call this method
        between solves.

        weight: the weight of all knots, or N + 1 weights, one for each knot. Weights of knots without the term are
            ignored. With one weight for each knot, each knot gets separate costs, as in `set_references`.

        Raises `KeyError` if no term has this name, and `ProblemError` if the weight is negative or not finite.
        """

    def set_x0(self, x0: ArrayLike) -> None:
        """Sets the initial state, nx numbers, as an MPC does before each solve.

        Raises `ProblemError` for a number that is not finite, and for a rotation whose length is not 1 (up to 1e-3).
        """

    def to_json(self) -> str:
        """Returns the problem and its robot as JSON, with the current initial state, weights and models of its knots. An
        infinite bound is written as null.

        Raises `ProblemError` if an action is an `Lqr`, an `Action`, a `ConstrainedAction` or a `ControlRate` around one
        of these, or if knots belong to different robots.
        """

@final
class Record:
    """A record of a controller: all calls that change its problem or its solver, from the first `solve` on, and the result
    of each tick. A replay makes the same calls on a new problem and gives the same results, bit for bit.

    A record begins when it is made, before the first `solve`, and ends with `stop`. It contains the problem and the
    settings at the beginning. Each call that solves (`solve`, `resume` or `tick`) ends a tick. `record[k]` returns tick
    k as a `RecordedTick`: its calls with their arguments, states, controls and status. Recording copies the arguments
    and results, about 20 kB in each tick of a quadruped with 25 knots.

    Results have the same bits only on processors with the same vector extensions. A solve that its `time_budget`, a
    callback or a signal ends early depends on the time, so its replay may differ.

    solver: a solver of a robot's problem, which has not solved yet. Only calls of this solver are recorded.

    Raises `ProblemError` if the problem cannot be written as JSON (see `Problem.to_json`).

    >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Record, Residual
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> knot = FreeDynamics(arm, 0.02, [Cost("effort", 1.0, Residual.control(np.zeros(7)))])
    >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [Cost("rest", 1.0, Residual.state(x0))]))
    >>> solver = Fddp(problem, max_iterations=2)
    >>> record = Record(solver)
    >>> solution = solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7)))
    >>> solver.shift(0)
    >>> problem.set_x0(x0 + 0.01)
    >>> solution = solver.resume()
    >>> record.stop()
    >>> [name for name, arguments in record[1].calls], record.replay()
    (['shift', 'set_x0', 'resume'], None)
    """

    def __new__(cls, solver: AugmentedLagrangian | Fddp | InteriorPoint) -> Record: ...
    def __getitem__(self, key: int, /) -> RecordedTick: ...
    def __len__(self, /) -> int: ...
    @staticmethod
    def load(path: _Path) -> Record:
        """Reads a record from a file that `save` has written.

        Raises `OSError` if the file cannot be read, and `ProblemError` if it contains no record, or a record of another
        version.
        """

    def replay(self) -> Difference | None:
        """Makes all calls on a new problem, and compares the results with the record. Returns the first `Difference`, or
        None if all bits are the same. Other threads can run meanwhile.

        Raises `ProblemError` if a call that solves fails, for example because the record began after the first solve.
        """

    def save(self, path: _Path) -> None:
        """Writes the record to a file, as JSON. Arrays are written as base64 of their bytes, so that no bit is lost.

        Raises `OSError` if the file cannot be written, and `ProblemError` if a model has a residual that is written in
        Python.
        """

    def start(self) -> tuple[Problem, Fddp | InteriorPoint | AugmentedLagrangian]:
        """Returns a new problem and a new solver, as they were at the beginning of the record."""

    def stop(self) -> None:
        """Ends the record. Later calls are not recorded."""

@final
class Residual:
    """A residual: a vector r(x, u) of a robot, which a `Cost` minimises or a `Limit` bounds.

    A frame is given by its name or index in a model. A contact is given by its name in `ContactDynamics`,
    `ContactInverseDynamics` or `ImpulseDynamics`. A residual stores the name of its frame. In a problem of another
    robot, the residual uses the frame with the same name. A robot without such a frame is an error. A target that is
    not given is zero; a target rotation is the identity.

    >>> from condyle.optimal import Residual
    >>> Residual.center_of_mass([0.4, 0.2, 0.5])
    <condyle.optimal.Residual {"center_of_mass":{"target":{"x":0.4,"y":0.2,"z":0.5}}}>
    """

    @staticmethod
    def _from_json(text: str) -> Residual: ...
    @staticmethod
    def center_of_mass(target: ArrayLike) -> Residual:
        """Returns the deviation of the centre of mass from a target, r = c − target, 3 numbers in the world (m)."""

    @staticmethod
    def center_of_pressure(contact: str, size: _Size, rotation: ArrayLike | None = None) -> Residual:
        """Returns the position of a rigid contact's centre of pressure relative to a rectangle: four numbers, all at most
        0 while the centre of pressure is inside.

        size: the rectangle's sides along the surface's x and y (m); rotation: the surface's axes in the contact's axes,
        (3, 3).
        """

    @staticmethod
    def centroidal_momentum(target: ArrayLike | None = None) -> Residual:
        """Returns the deviation of the momentum about the centre of mass from a target, r = h − target, 6 numbers along
        the world's axes, linear first.
        """

    @staticmethod
    def contact_acceleration(contact: str) -> Residual:
        """Returns the acceleration of a contact, r = J q̈ + γ as in `constrained_dynamics`: 1, 2, 3 or 6 numbers along the
        axes of the contact's rows. Only actions whose controls include the accelerations have this residual. The
        acceleration is 0 while the contact holds.
        """

    @staticmethod
    def contact_force(contact: str, target: ArrayLike | None = None) -> Residual:
        """Returns the deviation of a contact's force or impulse from a target, r = λ − target, along the axes of the
        contact's rows: 1, 2, 3 or 6 numbers; target always has 6.
        """

    @staticmethod
    def control(reference: ArrayLike) -> Residual:
        """Returns the deviation of the controls from a reference, r = u − reference, nu numbers."""

    @staticmethod
    def control_gravity() -> Residual:
        """Returns r = τ − g(q) + Jᵀλ, nv numbers, with joint efforts τ, gravity efforts g, contact forces λ and their
        Jacobian J. r is zero if efforts and contact forces hold the robot still.
        """

    @staticmethod
    def distances(
        model: Model, pairs: Sequence[tuple[Sphere | Geometry, Sphere | Geometry]], within: float | None = None
    ) -> Residual:
        """Returns the signed distances between pairs of geometries, r = n·(p₁ − p₂) with the nearest points p₁ and p₂ and
        the unit normal n, one number for each pair (m). A distance is negative while the geometries overlap.

        pairs: a list of pairs of `Sphere`s or `condyle.distances.Geometry`s. At least one geometry of a pair is fixed
            to a frame of the robot; the other one is fixed to the world, or to a frame of the same robot.

        within: a range r (m), above 0, or None for none: an entry is min(d, r). Pairs that are farther away cost
            little, and have no derivatives. Give a range well above the bounds and the margin of an activation.

        A `Limit` or a `Cost` of this residual keeps the geometries apart: if no bounds or activation are given, all
        distances have the lower bound 0. For a margin, give `lower`. Limits apply only at knots. If the centres of a
        pair coincide, the direction from p₂ to p₁ is undefined, and the derivatives use the world's z axis instead.

        >>> from condyle.optimal import Limit, Residual, Sphere
        >>> tool, ball = Sphere([0.0, 0.0, 0.0], 0.05, "tool"), Sphere([0.4, 0.2, 0.5], 0.1)
        >>> clear = Limit("clear", Residual.distances(condyle.robots.arm7(), [(tool, ball)]), lower=[0.01])
        """

    @staticmethod
    def frame_placement(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """Returns the deviation of a frame's pose from a target, r = log(target⁻¹ oMf) with the pose oMf of the frame in
        the world, 6 numbers, linear first; target is a homogeneous 4 × 4 matrix.
        """

    @staticmethod
    def frame_rotation(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """Returns the deviation of a frame's rotation R from a target, r = log(targetᵀ R), 3 numbers; target is a 3 × 3
        matrix.
        """

    @staticmethod
    def frame_translation(model: Model, frame: str | int, target: ArrayLike) -> Residual:
        """Returns the deviation of a frame's origin from a target, r = p − target, 3 numbers in the world (m)."""

    @staticmethod
    def frame_velocity(
        model: Model, frame: str | int, target: ArrayLike | None = None, reference: ArrayLike = "local"
    ) -> Residual:
        """Returns the deviation of a frame's velocity from a target, r = v − target, 6 numbers, linear first; reference:
        'local', 'world' or 'local_world_aligned'.
        """

    @staticmethod
    def friction_cone(contact: str, cone: FrictionCone) -> Residual:
        """Returns the rows r = A f of a friction cone, for a contact's force f."""

    @staticmethod
    def heading_velocity(model: Model, frame: str | int, target: ArrayLike | None = None) -> Residual:
        """Returns the deviation of a frame's velocity from a target in the frame's heading frame, r = Rz(ψ)ᵀ v − target, 6
        numbers: forwards, to the left and up, then the rates about these axes. ψ is the heading of the frame's x axis,
        and the z axis of the heading frame is vertical.

        With `tilt`, and `frame_translation` with the weights (0, 0, w) for the height, this describes a walk that does
        not depend on the place and the heading of the robot.
        """

    @staticmethod
    def impulse_center_of_mass() -> Residual:
        """Returns the jump of the centre of mass's velocity at an impact: r = J_c (v⁺ − v), 3 numbers (m/s), with the
        Jacobian J_c of the centre of mass and the velocity v⁺ after the impact.
        """

    @staticmethod
    def joint_acceleration(reference: ArrayLike) -> Residual:
        """Returns the deviation of the joint accelerations from a reference, r = q̈ − reference, nv numbers."""

    @staticmethod
    def joint_effort(reference: ArrayLike) -> Residual:
        """Returns the deviation of the efforts of all joints from a reference, r = τ − reference, nv numbers."""

    @staticmethod
    def own(
        size: int,
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], Any],
        calc_diff: Callable[[int, _Array, _Array], tuple[ArrayLike, ArrayLike]] | None = None,
    ) -> Residual:
        """Returns a residual r(t, x, u) that is written in Python; t is the index of the knot.

        size: the number of entries, at most 4096.
        calc: a function of (t, x, u) that returns r; x = (q, v); u is empty at the terminal knot.
        calc_diff: a function of (t, x, u) that returns (∂r/∂x, ∂r/∂u) of shapes (size, 2 nv) and (size, nu), in the
            tangent space of the state. Without calc_diff, calc is differentiated as for `Action`.

        >>> from condyle.optimal import Residual
        >>> power = Residual.own(7, lambda t, x, u: x[7:] * u)
        """

    @staticmethod
    def own_cost(
        calc: Callable[[Any, NDArray[Any], NDArray[Any]], Any],
        calc_diff: Callable[[Any, _Array, _Array], dict[str, ArrayLike]] | None = None,
    ) -> Residual:
        """Returns a cost that is written in Python, as a residual of one entry: a number ℓ(t, x, u) with its own Hessian,
        where t is the index of the knot. The default activation of a `Cost` with this residual is `Activation.sum()`,
        so the term is weight · ℓ.

        calc: a function of (t, x, u) that returns ℓ; x = (q, v); u is empty at the terminal knot.
        calc_diff: a function of (t, x, u) that returns a dict of the nonzero arrays among q, r, Q, S, R: gradient and
            Hessian of ℓ with respect to x, in the tangent space of the state, and to u. Without calc_diff, calc is
            differentiated as for `Action`.

        For knots with such a cost, the sweep of `Fddp` does not use the inverse-dynamics form.

        >>> from condyle.optimal import Cost, Residual
        >>> swing = Cost("swing", 2.0, Residual.own_cost(lambda t, x, u: 1.0 - np.cos(x[0])))
        """

    @staticmethod
    def state(reference: ArrayLike) -> Residual:
        """Returns the deviation of the state from a reference, r = x ⊖ reference, 2 nv numbers; reference = (q, v)."""

    @staticmethod
    def tilt(model: Model, frame: str | int, up: ArrayLike | None = None) -> Residual:
        """Returns the tilt of a frame, r = Rᵀ e_z − up, 3 numbers: the vertical of the world along the frame's axes, minus
        its desired value, a unit vector. None is (0, 0, 1), an upright frame. r does not depend on the heading.
        """

    @staticmethod
    def undriven_effort() -> Residual:
        """Returns the efforts of inverse dynamics in the directions without actuators: r = Nᵀτ, where Nᵀ S = 0 with the
        actuation matrix S. For a floating base, these are 6 numbers, the force on the base. The efforts are 0 in a
        feasible motion.
        """

    @staticmethod
    def wrench_cone(contact: str, cone: WrenchCone) -> Residual:
        """Returns the rows r = A w of a wrench cone, for a rigid contact's wrench w."""

@final
class Schedule:
    """The models of a horizon in time: from each switching time on, knots have another model. A trot for example switches
    between models that differ in their contacts.

    `knots(t, count)` returns the models and durations of a horizon that begins at any time t, for `retime` of a solver.
    Knots begin at times that do not depend on t, and no knot contains a switching time. The time between two switches
    is divided into equal knots, whose duration is as near to the spacing as possible. Only the first knot of a horizon
    differs: it begins at t. It takes the rest of the present knot, together with the next knot if the rest is at most
    half the spacing and no switch follows. So later knots remain the same when the horizon moves. The number of knots
    is constant, and the end of the horizon moves.

    spacing: the duration of a knot (s).
    model: the index of the model before the first switch.

    Raises `ProblemError` if the spacing is not above 0.

    >>> from condyle.optimal import Schedule
    >>> schedule = Schedule(0.02, 0)
    >>> schedule.switch(0.05, 1)
    >>> schedule.switch(0.10, 0)
    >>> models, durations = schedule.knots(0.015, 5)
    >>> models, durations.round(6).tolist()
    ([0, 0, 1, 1, 0], [0.015, 0.02, 0.025, 0.025, 0.02])
    """

    def __new__(cls, spacing: float, model: int = 0) -> Schedule: ...
    @property
    def spacing(self) -> float:
        """The duration of a knot (s)."""

    @property
    def switches(self) -> list[tuple[float, int]]:
        """The switches that are not forgotten: times (s), each with the model from this time on."""

    @staticmethod
    def _from_text(text: str) -> Schedule: ...
    def forget(self, t: float) -> None:
        """Forgets the switches before the present phase, so that the schedule does not grow.

        t: a time (s) in the present phase.
        """

    def knots(self, t: float, count: int) -> tuple[list[int], _Array]:
        """Returns the models and durations of the knots of a horizon: a list of indices and an array (s).

        t: the time (s) at which the horizon begins.
        count: the number of knots.

        Raises `ProblemError` if t is not finite.
        """

    def model(self, t: float) -> int:
        """Returns the index of the model at the time t (s)."""

    def switch(self, t: float, model: int) -> None:
        """Adds a switch. Switches at or after t are removed: a contact that occurs earlier than planned is a switch now,
        followed by the new switches.

        t: the time (s) from which on knots have the model.
        model: the index of the model.

        Raises `ProblemError` if t is not finite.
        """

@final
class Sensitivities:
    """The derivatives of many solutions. Their adjoints are computed several at a time in the lanes of SIMD registers.

    The B problems have the same numbers of knots, states and controls. The results equal the results of each
    `Sensitivity` up to rounding. Different controls may be at their bounds. The adjoint of a solution with active
    limits is computed alone.

    The derivatives with respect to parameters belong to the solved problems, one `Sensitivity` each. If the solutions
    are of one `Problem` whose parameters were set in between, call `Sensitivity.prepare` for the parameters before the
    problem changes.

    sensitivities: the `Sensitivity` of each solution.

    Raises `ProblemError` for an empty list, or if a problem has other dimensions than the first one.

    >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivities, Sensitivity
    >>> arm = condyle.robots.arm7()
    >>> rest = Cost("rest", 1.0, Residual.state(np.zeros(14)))
    >>> effort = Cost("effort", 0.1, Residual.control(np.zeros(7)))
    >>> knot, end = FreeDynamics(arm, 0.05, [rest, effort]), FreeDynamics(arm, None, [rest])
    >>> problem, each = Problem(np.zeros(14), [knot], [0] * 10, end), []
    >>> solver = Fddp(problem)
    >>> for x in (0.1, 0.2, 0.3):
    ...     problem.set_x0(np.full(14, x))
    ...     solution = solver.solve(np.full((11, 14), x), np.zeros((10, 7)))
    ...     each.append(Sensitivity(solver).prepare(["x0", "target/rest"]))
    >>> many = Sensitivities(each)
    >>> by_x0, by_target = many.gradients(["x0", "target/rest"], by_us=np.ones((3, 10, 7)))
    >>> by_target.shape
    (3, 14)
    """

    def __new__(cls, sensitivities: Sequence[Sensitivity]) -> Sensitivities: ...
    @property
    def in_lanes(self) -> int:
        """The number of solutions whose adjoints are computed in lanes. The others have active limits."""

    def __len__(self, /) -> int: ...
    def gradients(
        self,
        parameters: Sequence[str],
        by_xs: ArrayLike | None = None,
        by_us: _Controls | None = None,
        by_knot: Sequence[str] = ...,
    ) -> list[_Array]:
        """Computes the gradients of losses L(x, u), one for each solution, with respect to several parameters. The
        adjoints are computed once. Returns a list with an array (B, n) for each parameter.

        parameters: the names of the parameters.
        by_xs: the gradients of the losses with respect to the states, (B, N + 1, ndx), in the tangent space; None for
            zeros.
        by_us: the gradients of the losses with respect to the controls, (B, N, nu), or a list of N arrays (B, nu) if
            knots differ in nu; None for zeros.
        by_knot: the names of parameters for which the part of each knot is returned, (B, N + 1, n), as by
            `Sensitivity.gradient`.

        Raises `ProblemError` as `Sensitivity.gradient` does, and if a parameter has another size than in the first
        problem.
        """

@final
class Sensitivity:
    """The derivatives of a solver's last solution with respect to the parameters of its problem.

    The optimality conditions are linearised at the solution and factorised once. After that, the gradient of a loss
    with respect to a parameter is one pass over the knots, whatever the number of the parameter's entries.

    A parameter has a name, such as "x0", "target/NAME" or "inertia/LINK"; `Problem.parameters` returns all names. A
    parameter that several knots share changes at all of them. Changes are in the tangent space: 2 nv numbers for a
    state, 3 for a rotation R exp(δ), 6 for a placement M exp(δ), linear first. Other parameters change by numbers that
    are added to their values. `define` adds parameters of your own.

    Bounds that are active are held active. If `report.strict_complementarity` is False, a bound is active with a
    multiplier near zero; the solution has a kink there, and the derivative on the other side differs.

    solver: an `Fddp`, `InteriorPoint` or `AugmentedLagrangian` whose last solution has converged. The error of a
        derivative is proportional to the error of the solution, so choose tight tolerances.
    curvature: "exact" (default) takes second derivatives by differences of the first derivatives, for problems of all
        kinds. "dynamics" adds the second derivatives of the dynamics, if the models provide them, to the Hessians of
        the costs that the solver uses; it is exact if costs are quadratic in x and u. "gauss_newton" takes the
        solver's Hessians of costs alone, and is an approximation.
    tolerance: the largest residual of the optimality conditions that counts as converged, relative to their terms.
    strictness: the smallest `report.margin` with strict complementarity.

    Raises `ProblemError` if the solution has not converged, the problem has changed since the solve, a limit is soft,
    or the solution is no strict minimum, so that derivatives do not exist.

    >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivity
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> rest, effort = Cost("rest", 1.0, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    >>> reach = Cost("reach", 10.0, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))
    >>> knot, end = FreeDynamics(arm, 0.05, [rest, effort, reach]), FreeDynamics(arm, None, [rest])
    >>> problem = Problem(x0, [knot], [0] * 10, end)
    >>> solver = Fddp(problem)
    >>> solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7))).status
    'converged'
    >>> sensitivity = Sensitivity(solver)
    >>> by_us = np.zeros((10, 7))
    >>> by_us[0, 1] = 1.0  # the loss is the first effort of the second joint
    >>> sensitivity.gradient("target/reach", by_us=by_us).shape
    (3,)
    """

    def __new__(
        cls,
        solver: AugmentedLagrangian | Fddp | InteriorPoint,
        *,
        curvature: Literal["exact", "dynamics", "gauss_newton"] = "exact",
        tolerance: float = 0.001,
        strictness: float = 0.0001,
    ) -> Sensitivity: ...
    @property
    def report(self) -> SensitivityReport:
        """The `SensitivityReport` on the solution: active bounds, residuals and strict complementarity."""

    @staticmethod
    def _at(
        problem: Problem,
        xs: ArrayLike,
        us: _Controls,
        K: ArrayLike,
        curvature: Literal["exact", "dynamics", "gauss_newton"],
    ) -> Sensitivity:
        """Computes the derivatives at a solution of `Fddp` with the given states, controls and gains, which may come from
        `solve_many`. The problem must be the solved problem.
        """

    def bounds(self, by_xs: ArrayLike | None = None, by_us: _Controls | None = None) -> BoundGradients:
        """Computes the gradients of a loss with respect to the initial state and to all active bounds, as
        `BoundGradients`. They need no parameter.

        by_xs, by_us: as for `gradient`.
        """

    def define(self, name: str, size: int, build: Callable[[_Array], Problem], step: float = 1e-05) -> None:
        """Defines a parameter of your own, whose derivatives are central differences: the inertia of a body, a coefficient
        of friction, or any other number of which problems are built.

        name: the name, for `gradient` and `jacobian`. An earlier definition of this name is replaced.
        size: the number of entries.
        build: a function that returns the `Problem` for a change of the entries from the solved problem. It is called
            with zeros first, and then twice for each entry.
        step: the size of these changes.

        Raises `ProblemError` if the problem for zeros is another one than the solved problem, or if a problem has other
        dimensions; `ValueError` for the name of a parameter that exists already; and exceptions of `build`.
        """

    def first_control_by_x0(self) -> _Array:
        """Computes the derivative of the first control with respect to the initial state, (nu, ndx): the gradient of the
        policy that a controller executes. Without active limits, it is a gain of the factorisation.
        """

    def gradient(
        self, parameter: str, by_xs: ArrayLike | None = None, by_us: _Controls | None = None, by_knot: bool = False
    ) -> _Array:
        """Computes the gradient dL/dp of a loss L(x, u) with respect to a parameter, by the adjoint method.

        The derivatives of the optimality conditions with respect to the parameter are computed at the first call for
        this parameter, and stored.

        parameter: the name of the parameter.
        by_xs: the gradients of the loss with respect to the states, (N + 1, ndx), in the tangent space; None for zeros.
        by_us: the gradients of the loss with respect to the controls, (N, nu), or a list of N arrays if knots differ in
            nu; None for zeros.
        by_knot: whether to return the part of each knot, (N + 1, n): the derivatives with respect to values of the
            parameter that only this knot uses, such as the rows of `Problem.references`.

        Raises `ProblemError` if the parameter does not exist, or if the problem has changed since this object was
        created.
        """

    def gradients(
        self,
        parameters: Sequence[str],
        by_xs: ArrayLike | None = None,
        by_us: _Controls | None = None,
        by_knot: Sequence[str] = ...,
    ) -> list[_Array]:
        """Computes the gradients of a loss with respect to several parameters, by one solution of the adjoint problem.
        Returns a list with an array for each parameter.

        parameters: the names of the parameters.
        by_xs, by_us: as for `gradient`.
        by_knot: the names of parameters for which the part of each knot is returned, as by `gradient`.

        Raises `ProblemError` as `gradient` does.
        """

    def jacobian(self, parameter: str) -> tuple[_Array, _Array | list[_Array]]:
        """Computes the derivatives of all states and controls with respect to a parameter of n entries: an array
        (N + 1, ndx, n), and an array (N, nu, n), or a list of N arrays if knots differ in nu. One pass over the knots
        for each entry.

        parameter: the name of the parameter.

        Raises `ProblemError` as `gradient` does.
        """

    def prepare(self, parameters: Sequence[str]) -> Sensitivity:
        """Computes and stores the derivatives of the optimality conditions with respect to parameters, for later gradients
        by `Sensitivities`. Returns this object.

        parameters: the names of the parameters.

        Raises `ProblemError` if a parameter does not exist, or if the problem has changed since this object was
        created.
        """

@final
class Sweep:
    """The backward Riccati sweep over a horizon of linear-quadratic knots: an iteration of `Fddp` without derivatives and
    line search.

    knots: a list of `LqKnot`s, as `Problem.derivatives` returns them; the last knot is the terminal knot, without
    controls.

    Raises `ProblemError` if the shapes of the knots do not fit together. `run` raises `ProblemError` for a knot with
    constraint rows, because the sweep does not support them.

    >>> from condyle.optimal import Lqr, Problem, Sweep
    >>> knot, end = Lqr([[1.0]], B=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[2.0]])
    >>> problem = Problem([1.0], [knot], [0], end)
    >>> result = Sweep(problem.derivatives([[1.0], [1.0]], [[0.0]])).run()
    >>> bool(abs(result.K[0][0, 0] + 2 / 3) < 1e-15)  # δu = −⅔ δx
    True
    """

    def __new__(cls, knots: Sequence[LqKnot]) -> Sweep: ...
    def run(self, regularisation: float = 0.0) -> SweepResult:
        """Computes the feedback and the value functions, as a `SweepResult`.

        regularisation: the number added to the diagonals of Quu and Vxx, at least 0. Quu is the Hessian of the
        cost-to-go with respect to the controls, and Vxx the Hessian of the value function.

        Raises `ProblemError` if Quu of a knot is not positive definite.
        """

@final
class Unicycle:
    """The action of a unicycle: x = (x, y, θ), u = (v, ω), x⁺ = x + Δt (v cos θ, v sin θ, ω).

    The cost is ½ (w₁² ‖x‖² + w₂² ‖u‖²), as in Crocoddyl's `ActionModelUnicycle`.

    dt: Δt (s), above 0.
    weights: w₁ and w₂.
    terminal: whether the action is for the terminal knot, without controls.

    >>> from condyle.optimal import Fddp, Problem, Unicycle
    >>> problem = Problem([-1.0, -1.0, 1.0], [Unicycle()], [0] * 20, Unicycle(terminal=True))
    >>> Fddp(problem).solve(np.zeros((21, 3)), np.zeros((20, 2))).status
    'converged'
    """

    def __new__(cls, dt: float = 0.1, weights: tuple[float, float] = ..., terminal: bool = False) -> Unicycle: ...

@final
class WrenchCone:
    """The wrench cone of a rectangular sole, lower ≤ A w ≤ upper for a wrench w. The rows bound friction, the centre of
    pressure (within the rectangle) and the yaw moment.

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
        """Returns the lower and upper bounds of A w."""

    def rows(self) -> _Array:
        """Returns the matrix A, (facets + 13, 6)."""

def rollout_many(
    problem: Problem,
    us: ArrayLike,
    x0: ArrayLike | None = None,
    *,
    states: bool = True,
    gradients: bool = False,
    threads: int = 1,
) -> ManyRollouts:
    """Simulates many control sequences on the dynamics of a problem, with the costs of the problem.

    Several sequences are computed together in SIMD lanes. The result of a sequence does not depend on the other ones.

    problem: the problem. Its initial state is used where x0 is None.
    us: the controls of B sequences, (B, N, nu); or (B, Σ nu), where the controls of all knots follow one another, as
        for knots that differ in nu. Controls are not moved into their bounds.
    x0: the initial state of all sequences, nx numbers; or of each sequence, (B, nx); None is the problem's.
    states: whether to return the states.
    gradients: whether to return the gradients of the costs.
    threads: the number of threads.

    Returns `ManyRollouts`. A sequence that diverges has an infinite cost and does not affect the others: its numbers
    are not finite or exceed 1e30.

    Other Python threads can run meanwhile. An exception of a signal handler, such as KeyboardInterrupt, ends the call.

    Raises `ProblemError` if x0 is not finite or contains a rotation whose length is not 1, and for an `Action` or
    another action written in Python, which cannot be copied.

    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual, rollout_many
    >>> arm, x0 = condyle.robots.arm7(), np.zeros(14)
    >>> effort = Cost("effort", 1e-4, Residual.control(np.zeros(7)))
    >>> problem = Problem(x0, [FreeDynamics(arm, 0.02, [effort])], [0] * 25, FreeDynamics(arm, None, []))
    >>> us = np.random.default_rng(0).normal(size=(1000, 25, 7))
    >>> found = rollout_many(problem, us, gradients=True)
    >>> found.costs.shape, found.xs.shape, found.du.shape
    ((1000,), (1000, 26, 14), (1000, 25, 7))
    """

def _solve_many(
    solver: AugmentedLagrangian | Fddp | InteriorPoint,
    count: int,
    data: dict[str, Any],
    start: tuple[Any, Any] | None,
    vary: tuple[Callable[..., object], list[Any]] | None,
    keep: list[str],
    threads: int,
    report: Callable[[int], object] | None,
    whole: bool = False,
) -> tuple[dict[str, Any], list[tuple[int, BaseException]]]:
    """Solves variations of a problem: see `condyle.optimal.solve_many` and `condyle.sweep`.

    solver: an `Fddp`, `InteriorPoint` or `AugmentedLagrangian` of the nominal problem, with the settings of all solves.
    count: the number V of variations.
    data: arrays with a row for each variation: "x0" (V, nx), and lists of pairs (name, numbers): "references" and
        "weights" of costs, with the numbers of all knots in a row; "contacts", placements (V, 3) or (V, 16). Also
        "xs" and "us", the states and controls of a start for each variation, in a row.
    start: the states and controls from which all variations start; None if `data` has a start for each variation.
    vary: None, or a function of the problem and an item that changes the problem or returns another one.
    items: the arguments of `vary`.
    keep: the arrays of each solution to keep.
    report: None, or a function that is called with the number of variations that have ended.
    whole: whether the time budget of the solver applies to the whole call. If not, it applies to each solve.

    Returns the columns of `Variations`, without `error`; the status of a variation that did not start is empty. Also
    returns the exceptions of the variations that failed, as pairs (index, exception).
    """

def _rnea_pull(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, lambda_: ArrayLike, count: int
) -> list[_Array]:
    """Computes Jᵀ λ of `rnea` for many states, with respect to q, v and a, in parts that stay in the cache.

    q: positions, (N, nq); v, a, lambda_: velocities, accelerations and λ, (N, nv); count: the number of results, 3 or
    2, without a. Returns arrays (N, nv); the first one belongs to the tangent space.
    """

def joint_torque_regressor(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """Computes the joint torque regressor Y(q, v, a), (nv, 10 (nbodies − 1)), with τ = Y π: `rnea` as a linear function of
    `Model.inertial_parameters`; O(n depth).

    q: position, nq numbers; v, a: velocity and acceleration, nv numbers each. Each body except the world has ten
    columns. With rotors, τ = Y π + armature · a. For the linear coordinates of a free joint, armature · (a + ω × v)
    replaces armature · a.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
    >>> Y = condyle.joint_torque_regressor(arm, data, q, v, a)
    >>> np.allclose(Y @ arm.inertial_parameters, condyle.rnea(arm, data, q, v, a))
    True
    """

def kinetic_energy_regressor(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the kinetic energy regressor y(q, v), 10 (nbodies − 1) numbers; O(n). T = y · π is `kinetic_energy` without
    the rotors, as a linear function of π, the `Model.inertial_parameters`.

    q: position, nq numbers; v: velocity, nv numbers.
    """

def passive_torque(model: Model, q: ArrayLike, v: ArrayLike, smoothing: float, out: _Array | None = None) -> _Array:
    """Computes the passive torque τ = −d v − f tanh(v/ε) + springs + gravity compensation, nv numbers (N m, N); O(n). The
    damping coefficient is d = d₀ + d₁ |v| + d₂ v²; f is the friction, smoothed by ε.

    q: position, nq numbers; v: velocity, nv numbers; smoothing: ε > 0, a speed (rad/s, m/s); at the speed ε, friction
    is tanh 1 = 76 % of f. A spring with the coefficients k₀, k₁ and k₂ has the effort −(k₀ + k₁ Δ + k₂ Δ²) Δ, where Δ
    is the displacement from its rest position. For joints with several degrees of freedom, the brackets contain |Δ|
    instead of Δ. The equations are the same as for MuJoCo's `qfrc_passive`, with two exceptions. MuJoCo treats friction
    as a constraint. For joints with `actuatorgravcomp`, MuJoCo counts gravity compensation among the efforts of
    actuators. No other function of a model includes passive torques: add passive torques to τ where needed.

    >>> arm = condyle.robots.arm7()
    >>> q, v = np.zeros(7), np.ones(7)
    >>> np.allclose(condyle.passive_torque(arm, q, v, 1e-3), -arm.damping - arm.friction)
    True
    """

def passive_torque_derivatives(
    model: Model, q: ArrayLike, v: ArrayLike, smoothing: float, out: tuple[_Array, _Array] | list[_Array] | None = None
) -> PassiveDerivatives:
    """Computes the exact derivatives of `passive_torque`, as `PassiveDerivatives(dtau_dq, dtau_dv)`, each (nv, nv).

    q: position, nq numbers; v: velocity, nv numbers; smoothing: ε > 0 (rad/s, m/s). ∂τ/∂v is diagonal, except for free
    joints with friction or polynomial damping. ∂τ/∂q has a block for each spring, and couples joints if gravity is
    compensated.

    >>> arm = condyle.robots.arm7()
    >>> d = condyle.passive_torque_derivatives(arm, np.zeros(7), np.ones(7), 1e-3)
    >>> np.allclose(d.dtau_dv, -np.diag(arm.damping)), not d.dtau_dq.any()  # it has no springs
    (True, True)
    """

def potential_energy_regressor(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Computes the potential energy regressor y(q), 10 (nbodies − 1) numbers; O(n). V = y · π is `potential_energy` as a
    linear function of π, the `Model.inertial_parameters`.

    q: position, nq numbers.
    """

def arm7() -> Model:
    """Returns a seven-axis arm with a fixed base, nq = nv = 7; its last frame is `tool`.

    >>> condyle.robots.arm7()
    <condyle.Model 'arm7': 7 bodies, nq = 7, nv = 7>
    """

def humanoid() -> Model:
    """Returns a humanoid with thirty-two joints on a free-flyer, nq = 39, nv = 38, with soles `left_sole`, `right_sole`.

    >>> condyle.robots.humanoid()
    <condyle.Model 'humanoid': 33 bodies, nq = 39, nv = 38>
    """

def quadruped() -> Model:
    """Returns a quadruped with twelve joints on a free-flyer, nq = 19, nv = 18, with point feet `LF_foot`, `LH_foot`,
    `RF_foot`, `RH_foot`.

    >>> condyle.robots.quadruped()
    <condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>
    """

@final
class Simulation:
    """A simulation of a robot: its state, and the scratch memory to advance it.

    A motion is q(t) = q₀ ⊕ ξ(t), with a tangent vector ξ(t). The equations of motion are q̇ = v, with the velocity v in
    the body's frame, and v̇ = aba(q, v, τ). τ and the external forces are constant during a step.

    model: the robot, which starts at rest at `neutral`, at time 0.
    integrator: 'semi_implicit_euler', order 1, suitable for damped robots and short horizons; 'runge_kutta_4', order 4,
        whose energy drifts by O(h⁴) per second; 'variational', order 2, symplectic: the energy does not drift, and
        momentum is conserved up to rounding.
    dt: h, the length of a step (s), above 0.
    passive: the smoothing ε (rad/s, m/s) of `passive_torque`, which is then added to τ: damping, friction, springs and
        gravity compensation. None leaves the passive torque out.
    tolerance: for 'variational', Newton's method ends when the imbalance of the momenta is at most this fraction of the
        sum of the momenta.
    max_iterations: the maximum number of iterations of Newton's method.
    ground: a `Ground` on which the robot stands, slides and lands; None for no ground. Requires 'semi_implicit_euler'.

    A simulation can be copied and pickled; the copy continues with bit-identical results.

    Raises `ModelError` if M is singular or the ground is invalid, and `ValueError` if dt is not positive and finite, or
    the tolerance is negative.

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
        """The contacts between the ground and the points of the robot in the last step, as `GroundContacts`."""

    @property
    def ground(self) -> Ground | None:
        """The ground on which the robot stands, as a `Ground` of single points; None without ground."""

    @property
    def q(self) -> _Array:
        """The position of the robot, nq numbers."""

    @property
    def time(self) -> float:
        """The time since the state was set: the sum of the steps (s)."""

    @property
    def v(self) -> _Array:
        """The velocity of the robot, nv numbers."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the class, the constructor's arguments, and the state, from which `pickle` makes an equal simulation."""

    def __setstate__(self, state: tuple[float, list[float], list[float], list[float]]) -> None:
        """Restores the state that a pickle contains."""

    def run(self, steps: int, control: Callable[[Control], None] | None = None) -> _Status:
        """Makes a number of steps, and calls a control law before each step. If a step fails, ends early and returns the
        status of this step. Otherwise returns 'contacts_not_converged' if a step had this status, else 'done'.

        control: a function that takes a `Control` and sets the numbers of `tau` and `f_ext` of this `Control` in place.
            None means zero efforts. Other Python threads can run during the steps if control is None.

        An exception of a signal handler, such as KeyboardInterrupt, ends the run after a step; the state after this
        step is kept.
        """

    def set_state(self, q: ArrayLike, v: ArrayLike) -> None:
        """Sets the position q (nq numbers) and the velocity v (nv numbers), and the time to 0.

        Raises `ModelError` if q is not finite or contains a rotation whose length is not 1 (up to 1e-3), `ValueError`
        if v is not finite.
        """

    def step(self, tau: ArrayLike, f_ext: ArrayLike | None = None) -> _Status:
        """Makes a step with constant efforts and forces, and returns its status: 'done'; 'not_converged' if Newton's
        method did not reach the tolerance (a shorter step helps); 'contacts_not_converged' if the ground's impulses
        violate the laws of contact by more than the ground's tolerance; or 'not_finite'. The state advances only for
        'done' and 'contacts_not_converged'.

        tau: nv numbers (N m, N); f_ext: as for `rnea`.
        """

@disjoint_base
class _SpelledData:
    """A `condyle.Data` with Pinocchio's interface, and the stored state for functions of a joint or a frame."""

    def __new__(cls, model: _SpelledModel) -> _SpelledData: ...
    @property
    def _frame_poses(self) -> _Array:
        """The poses of the bodies from which frames are computed, from the last `updateFramePlacements`, (njoints, 4, 4)."""

    @property
    def _given(self) -> int:
        """The number of the vectors q, v and a that were passed to the last call of `forwardKinematics`."""

    @property
    def _ours(self) -> Data:
        """The wrapped `condyle.Data`."""

    @property
    def _poses(self) -> _Array:
        """The poses of the bodies at the last `forwardKinematics`, (njoints, 4, 4)."""

    @property
    def _state(self) -> tuple[_Array, _Array, _Array]:
        """q, v and a of the last `forwardKinematics`. Vectors that were not given are zeros."""

    @property
    def com(self) -> list[_Array]:
        """The stored centre of mass, as a list with one array."""

    @property
    def hg(self) -> Force:
        """The stored centroidal momentum."""

    def _leave(self, com: _Array, hg: Force) -> None:
        """Stores a centre of mass and a centroidal momentum."""

@disjoint_base
class _SpelledModel:
    """A `condyle.Model` with Pinocchio's interface."""

    def __new__(cls, model: Model) -> _SpelledModel: ...
    @property
    def ours(self) -> Model:
        """The wrapped `condyle.Model`."""

def centerOfMass(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> _Array:
    """Computes the centre of mass, also stored as data.com[0]. With v, also computes data.vcom[0]; with v and a, also
    data.acom[0].
    """

def computeCentroidalMomentum(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> Force:
    """Computes the centroidal momentum, also stored as data.hg."""

def computeCoriolisMatrix(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> _Array:
    """Computes the Coriolis matrix C, also stored as data.C. C v + g = h, with gravity efforts g and nonlinear effects
    h; Ṁ − 2 C is skew-symmetric, with the inertia matrix M.
    """

def computeFrameJacobian(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, frame_id: int, frame: ReferenceFrame | None = None
) -> _Array:
    """Computes the Jacobian of a frame, (6, nv)."""

def computeGeneralizedGravity(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """Computes the gravity efforts g, also stored as data.g."""

def computeMinverse(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """Computes the inverse M⁻¹ of the inertia matrix, also stored as data.Minv."""

def _spelled_crba(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """Computes the inertia matrix M with both triangles, also stored as data.M."""

def _spelled_difference(model: _SpelledModel, q0: ArrayLike, q1: ArrayLike) -> _Array:
    """Computes the tangent vector q₁ ⊖ q₀."""

def forwardKinematics(
    model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> None:
    """Computes the poses data.oMi; with v and a also the velocities data.v and the accelerations data.a, in the bodies'
    frames.
    """

def framesForwardKinematics(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> None:
    """Computes the bodies' poses data.oMi and the frames' poses data.oMf."""

def getAcceleration(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns the spatial acceleration of a joint's body at the last forwardKinematics."""

def getClassicalAcceleration(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns r̈ and ω̇ of a joint's body at the last forwardKinematics."""

def getFrameAcceleration(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns the spatial acceleration of a frame at the last forwardKinematics."""

def getFrameClassicalAcceleration(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns r̈ and ω̇ of a frame at the last forwardKinematics."""

def getFrameJacobian(model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame) -> _Array:
    """Returns the Jacobian of a frame at the last computeJointJacobians, (6, nv)."""

def getFrameVelocity(
    model: _SpelledModel, data: _SpelledData, frame_id: int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns the velocity of a frame at the last forwardKinematics."""

def getJointJacobian(model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame) -> _Array:
    """Returns the Jacobian of a joint's body at the last computeJointJacobians, (6, nv)."""

def getVelocity(
    model: _SpelledModel, data: _SpelledData, joint: str | int, frame: ReferenceFrame | None = None
) -> Motion:
    """Returns the velocity of a joint's body at the last forwardKinematics."""

def _spelled_integrate(model: _SpelledModel, q: ArrayLike, v: ArrayLike) -> _Array:
    """Computes the position q ⊕ v."""

def jacobianCenterOfMass(model: _SpelledModel, data: _SpelledData, q: ArrayLike) -> _Array:
    """Computes the Jacobian of the centre of mass, (3, nv), also stored as data.Jcom."""

def nonLinearEffects(model: _SpelledModel, data: _SpelledData, q: ArrayLike, v: ArrayLike) -> _Array:
    """Computes the nonlinear effects C v + g, also stored as data.nle."""

def updateFramePlacements(model: _SpelledModel, data: _SpelledData) -> None:
    """Computes the frames' poses data.oMf from the bodies' poses of the last forwardKinematics."""

@final
class FrictionContact:
    """A contact with friction: the frame that touches the environment is held, and each contact force lies in the cone
    ‖f_t‖ ≤ μ f_n, with the tangential part f_t and the normal component f_n of the force.

    `ContactTarget.activation` defines at each tick whether the contact touches, and which fraction of the full load the
    contact carries. The constructor of `WholeBodyController` checks the numbers.

    Common arguments: frame: the name of a frame of the robot. friction: μ, the Coulomb coefficient, above 0. min_force,
    max_force: bounds on the normal force of the whole contact (N).

    >>> from condyle.wholebody import FrictionContact
    >>> FrictionContact.sole("left_sole", 0.7, [0.2, 0.1]).corners.shape
    (4, 3)
    """

    @property
    def axes(self) -> Literal["world", "frame"]:
        """The axes along which the normal is given: 'world' or 'frame'."""

    @property
    def corners(self) -> _Array | None:
        """The corners of a surface in the frame (m), (n, 3); None for a point."""

    @property
    def forces(self) -> Literal["wrench", "corners"] | None:
        """The representation of the force on a surface: 'wrench' or 'corners'; None for a point."""

    @property
    def frame(self) -> str:
        """The name of the contact's frame."""

    @property
    def friction(self) -> float:
        """The friction coefficient μ."""

    @property
    def max_force(self) -> float:
        """The maximum normal force (N)."""

    @property
    def min_force(self) -> float:
        """The minimum normal force (N)."""

    @property
    def normal(self) -> _Array:
        """The direction in which the environment pushes, 3 numbers."""

    @property
    def yaw_friction(self) -> float | None:
        """The bound γ of the yaw moment (m); None for the default."""

    @staticmethod
    def point(
        frame: str,
        friction: float,
        normal: ArrayLike | None = None,
        axes: Literal["world", "frame"] = "world",
        min_force: float = 0.0,
        max_force: float = ...,
    ) -> FrictionContact:
        """Returns a point contact: the frame's origin is held, and the frame may turn about its origin.

        normal: the direction in which the environment pushes, 3 numbers of any nonzero length; None is the z axis, for
        level ground. axes: the axes of the normal: 'world' for a constant normal, or 'frame' for a normal that turns
        with the frame.
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
        """Returns a contact of a rectangular sole about the frame's origin, whose normal is the frame's z axis.

        size: the sides of the sole along the frame's x and y (m); forces, yaw_friction: as for `surface`.
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
        """Returns an edge contact (two corners: the frame may turn about the edge) or a convex polygon (three or more
        corners: the frame is held).

        corners: positions in the frame (m), (n, 3), in order around the polygon, in one plane perpendicular to the
            normal.
        forces: 'wrench', one force with one friction cone, a centre of pressure within the polygon and a bounded moment
            about the normal; or 'corners', a force with a friction cone at each corner.
        normal: the direction in which the environment pushes, in the frame's axes, 3 numbers of any nonzero length;
            None is the z axis.
        yaw_friction: γ (m): the moment of a wrench about the normal is at most γ f_n, with the normal force f_n. For a
            polygon, None means ⅔ μ r, where r is the radius of the largest circle in the polygon about the mean of the
            corners. For an edge of length 2 l, None means ½ μ l.
        """

@final
class Plan:
    """A planned motion with N + 1 knots: states at given times, efforts and gains between these times, and the contacts
    that touch in each interval.

    `WholeBodyController.track` converts a plan to references. Between knots, q is interpolated with constant velocity
    (as by `interpolate`), v linearly, and a = Δv / Δt. Two knots may have the same time: then the velocity jumps at
    this time (an impact).

    model: the robot.
    times: N + 1 times in ascending order (s); two consecutive times may be equal.
    states: (q, v) of the knots, (N + 1, nq + nv).
    touches: for each interval between two knots, which of the controller's contacts touch, (N, contacts).
    controls: for each interval between two knots, the efforts of the actuated coordinates (all coordinates except a
        free-flyer's), (N, nu); None for no controls.
    gains: K of u = ū + K (x ⊖ x̄), (N, nu, 2 nv); None for no gains.
    fade: the time (s) during which a contact is loaded after it begins to touch, and unloaded before it stops touching.

    Raises `ControllerError` for numbers that are not finite, for times that decrease, and for states whose quaternions
    or pairs (cos, sin) do not have length 1.

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
        """The times of the first and the last knot (s)."""

    def activation(self, contact: int, t: float) -> float:
        """Returns the activation of a contact at a time: 0 while the contact does not touch, a ramp after the contact
        begins and before it ends, else 1. contact: the index of the contact.
        """

    def feedback(self, t: float, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
        """Computes the efforts τ = ū + K (x ⊖ x̄) of the plan's controls and gains at a state, nv numbers. The efforts of
        a free-flyer are 0.

        t: the time (s); q: position, nq numbers; v: velocity, nv numbers.

        Raises `ValueError` if the plan has no controls, and `ModelError` for a state that is not finite or whose
        quaternions or pairs (cos, sin) do not have length 1.
        """

@final
class Task:
    """A quantity to be controlled: ½ w ‖mask ∘ (J q̈ + J̇ v − a*)‖² with a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v), where
    J is the Jacobian of the quantity x.

    The `References` contain the target of the task. Tasks of priority 0 come first. Tasks of priority 1 only use the
    freedom that tasks of priority 0 leave, and so on. Within a priority, only the ratios of the weights matter. The
    constructor of `WholeBodyController` checks the numbers.

    Common arguments: weight: w, at least 0; None is the default of the task. gains: `Gains`, k (1/s²) and d (1/s); None
    is `Gains.critical(100.0)`. mask: for each number of the task, whether the number is controlled; None controls all
    numbers. axes: the axes of these numbers: 'world'; 'local', the axes of the task's frame (for tasks without a frame,
    of the world); or ('frame', name), the axes of another frame.
    priority: 0 is the first priority; at most 2.

    >>> from condyle.wholebody import Task
    >>> Task.orientation("trunk", mask=[True, True, False])  # level, whatever its heading
    <condyle.wholebody.Task orientation 'trunk', weight 10>
    """

    @property
    def axes(self) -> _Axes:
        """The axes of the task's numbers: 'world', 'local' or ('frame', name)."""

    @property
    def frame(self) -> str | None:
        """The name of the task's frame; None for a task without a frame."""

    @property
    def gains(self) -> Gains:
        """The gains k and d of the task, as `Gains`."""

    @property
    def joints(self) -> _Array:
        """Factors of the weight for the coordinates of a posture task, nv numbers; empty if all factors are 1."""

    @property
    def kind(self) -> str:
        """The controlled quantity, as the name of the constructor that made the task."""

    @property
    def mask(self) -> list[bool]:
        """The mask: for each number of the task, whether the number is controlled."""

    @property
    def priority(self) -> int:
        """The priority of the task; 0 is the first."""

    @property
    def weight(self) -> float:
        """The weight w of the task."""

    @staticmethod
    def angular_momentum(
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """Returns a task for the rate of the angular momentum about the centre of mass: 3 numbers; weight 0.1. Only the gain d
        is used.
        """

    @staticmethod
    def com(
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """Returns a task for the centre of mass, c̈: 3 numbers; weight 10."""

    @staticmethod
    def contact_force(
        frame: str, weight: float | None = None, mask: Sequence[bool] | None = None, priority: int = 0
    ) -> Task:
        """Returns a task for the force of this frame's contact; weight 1e-3. The task has 6 numbers: force and moment at
        the contact's centre, along the contact's axes (t₁, t₂, n); for a point contact, only the 3 numbers of the
        force. The task has no gains, and does not act while the contact is off.
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
        """Returns a task for a frame's rotation, ω̇: 3 numbers; weight 10."""

    @staticmethod
    def pose(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """Returns a task for a frame's origin and rotation, (p̈, ω̇): 6 numbers, linear first; weight 10."""

    @staticmethod
    def position(
        frame: str,
        weight: float | None = None,
        gains: Gains | None = None,
        mask: Sequence[bool] | None = None,
        axes: _Axes | None | None = None,
        priority: int = 0,
    ) -> Task:
        """Returns a task for a frame's origin, p̈: 3 numbers; weight 10."""

    @staticmethod
    def posture(
        weight: float | None = None, gains: Gains | None = None, joints: ArrayLike | None = None, priority: int = 0
    ) -> Task:
        """Returns a task for the actuated joints, q̈; weight 0.1.

        joints: factors of the weight, one for each coordinate, nv numbers; None is 1 for all.
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
        """Returns a task for the velocity of a frame's origin and rotation: 6 numbers, linear first; weight 10. The pose has
        no effect: only the gain d is used.
        """

@final
class WholeBodyController:
    """A whole-body controller. At each tick the controller solves a cone program for the accelerations, contact forces and
    joint efforts that fulfil the tasks best.

        x = (q̈, f)
        minimise     ½ Σ w ‖J q̈ + J̇ v − a*‖²  +  ½ w_a ‖q̈‖²  +  ½ w_f ‖f − f_ref‖²
        subject to   Sᵤ (M q̈ + h − Jᵀ f) = 0            no motor acts on a free-flyer
                     J_c q̈ + J̇_c v = k (X_ref ⊖ X) − d v   contacts are held (k = d = 0 unless set)
                     ‖(f₁, f₂)‖ ≤ μ f_n                  friction, a second-order cone for each force
                     f_n p ∈ f_n · polygon, |τ_n| ≤ γ f_n   centre of pressure and yaw moment of a sole's wrench
                     f_min ≤ Σ f_n ≤ f_max               for each contact, ramped while it fades in or out
                     −τ̄ ≤ τ ≤ τ̄  with  τ = S (M q̈ + h − Jᵀ f)
                     bounds on q̈                         from limits of position and velocity: `JointLimits`
                     ∂d/∂q q̈ ≥ …                         for the distance d of each pair: `DistanceLimits`

    J and J_c are the Jacobians of tasks and contacts; in Jᵀ f, J belongs to the contact forces. a* is the desired
    acceleration of a task, and w are weights. f are the contact forces: f_n is the normal component of a force, f₁ and
    f₂ the tangential components. p is the centre of pressure, τ_n the moment about the normal, and X the pose of a
    contact. Sᵤ selects the coordinates without motors, S the coordinates with motors. Positions, velocities and
    accelerations of tasks and contacts are in the world's axes; accelerations are classical. All memory is allocated in
    the constructor.

    model: the robot.
    contacts: a list of `FrictionContact`, each of a different frame; empty for a robot in free fall.
    tasks: a list of `Task`.
    settings: `Settings`; None for the defaults.

    Raises `ModelError` for an unknown frame. Raises `ControllerError` for a frame with two contacts, for a force task
    without its contact, for a number outside its range, and for an effort limit of 0 in the model or the settings.

    A controller can be copied and pickled; the copy continues with bit-identical results. With the back end 'clarabel',
    the copy builds its solvers again, so results are equal only up to the tolerance.

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
        """The last `Command`; zeros before the first step."""

    @property
    def settings(self) -> Settings:
        """All settings of the controller: `Settings`."""

    def hold(self, q: ArrayLike) -> References:
        """Returns the `References` that keep the robot at rest at a position: all tasks keep their current values, all
        contacts touch and are held, and the contacts share the weight equally.

        q: position, nq numbers.

        Raises `ModelError` for numbers that are not finite, and for quaternions and pairs (cos, sin) whose length is
        not 1.
        """

    def kkt_residuals(self, q: ArrayLike, v: ArrayLike, references: References) -> KktResiduals:
        """Returns the distance of the last step from the optimum of its first-priority program, as `KktResiduals`: the
        errors of the Karush–Kuhn–Tucker conditions, below 1e-5 at the default tolerance. Pass the state and references
        of the last step again. Use this method only in tests, because the method assembles the program anew.

        q: position, nq numbers; v: velocity, nv numbers.
        references: `References` of this controller.
        """

    def place(self, name: str, placement: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Sets the placement of the geometry with a name in the pairs of `DistanceLimits`, for example of an obstacle
        that moves.

        name: the name of the `Geometry`.
        placement: the pose (4, 4) in the world, or in the frame of the geometry.
        velocity: the velocity of an obstacle in the world, [linear, angular], six numbers along the world's axes: the
            velocity of the origin of its placement (m/s), and its angular velocity (rad/s); None for an obstacle at
            rest.

        Raises `ValueError` if no geometry has this name, or if a number is not finite.
        """

    def step(self, q: ArrayLike, v: ArrayLike, references: References) -> Command:
        """Computes the `Command` at a state. The method always returns a command. If no solution is found, this is a safe
        command whose status shows the cause. The status is 'not_finite' for a number that is not finite. The status is
        'invalid_state' for an invalid quaternion, pair (cos, sin) or rotation of a reference; then `reason` names the
        joint or the frame. Other Python threads can run meanwhile.

        q: position, nq numbers; v: velocity, nv numbers.
        references: `References` of this controller.
        """

    def track(self, plan: Plan, t: float, references: References) -> None:
        """Sets references to the state of a plan at a time: the joints, and the resulting centre of mass, momentum and
        frames. Contacts get the plan's activation, and are held at the poses of the plan. The contacts share the force
        that the plan's acceleration c̈ of the centre of mass requires.

        plan: a `Plan` of the same robot with the same number of contacts.
        t: the time (s); before the first knot, the plan rests at the first knot; after the last knot, at the last knot.
        references: `References` of this controller, which are changed.
        """

def _check_pose(name: str, pose: ArrayLike) -> None:
    """Raises `ValueError` if the rotation in a pose, which is a (4, 4) matrix, is not valid."""

def _check_rotations(name: str, q: ArrayLike, rotations: Sequence[tuple[str, int, int]]) -> None:
    """Raises `ValueError` if a quaternion or a pair (cos, sin) in a position does not have length 1. The caller gives the
    joint of each quaternion or pair, and its range in q.
    """

def _controller_from_numbers(
    model: Model, contacts: Sequence[FrictionContact], tasks: Sequence[Task], settings: Settings, numbers: ArrayLike
) -> WholeBodyController:
    """Creates the controller of a pickle. The pickle contains the model, whose own pickle checks the version."""
