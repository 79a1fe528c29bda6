"""Rigid-body dynamics with exact derivatives: the compiled part of `condyle`."""

import os
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._types import AbaDerivatives, Frame, Inertia, Limits, Mimic, RneaDerivatives, Solution

__all__ = [
    "ARM7",
    "HUMANOID",
    "QUADRUPED",
    "Activation",
    "Cost",
    "Data",
    "Error",
    "Fddp",
    "FreeDynamics",
    "Model",
    "ModelError",
    "ParseError",
    "Problem",
    "ProblemError",
    "__version__",
    "_model_from_bytes",
    "aba",
    "aba_derivatives",
    "arm7",
    "crba",
    "difference",
    "difference_jacobian",
    "forward_kinematics",
    "frame_jacobian",
    "frame_placement",
    "gravity",
    "humanoid",
    "integrate",
    "integrate_jacobian",
    "minv",
    "neutral",
    "nonlinear_effects",
    "quadruped",
    "random_configuration",
    "rnea",
    "rnea_derivatives",
]

_Array: TypeAlias = NDArray[np.float64]
_RootJoint: TypeAlias = Literal["free_flyer", "planar", "spherical", "translation"]
_RneaOut: TypeAlias = RneaDerivatives | tuple[_Array, _Array, _Array]
_AbaOut: TypeAlias = AbaDerivatives | tuple[_Array, _Array, _Array, _Array]

__version__: str
ARM7: str
QUADRUPED: str
HUMANOID: str

class Error(Exception):
    """What is wrong with a robot's description or with a name in it."""

class ParseError(Error):
    """A file cannot be read, is no XML, or is no URDF of a robot."""

class ProblemError(Error):
    """An optimal control problem, a warm start or a setting makes no sense."""

class ModelError(Error):
    """A model cannot be built, or has no frame or joint of that name."""

@final
class Model:
    """A robot: bodies, joints, frames, inertias, limits. Frozen, and free to be shared between threads.

    Body 0 is the world. The others stand parents first, depth first, siblings in the order of their joints' names, as
    Pinocchio numbers them. A model is made by `from_urdf`, `from_urdf_string` or one of `condyle.robots`; it can be
    pickled.

    >>> arm = condyle.robots.arm7()
    >>> arm.nq, arm.nv, arm.names[:3]
    (7, 7, ['universe', 'joint1', 'joint2'])
    """

    @staticmethod
    def from_urdf(
        path: str | os.PathLike[str],
        root_joint: _RootJoint | None = None,
        mimic: bool = False,
        strict: bool = False,
    ) -> Model:
        """Reads a URDF file.

        Fixed joints are merged into the body that they sit on and stay as frames. Meshes are never looked at.

        path: a path, as text or `os.PathLike`.
        root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
            'spherical' or 'translation'; None fixes the root link to the world.
        mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow, instead of having
            their own.

        strict: whether what is only odd (`warnings`) is an error.

        Raises `ParseError`, with file, line and element, or `ModelError`.
        """
    @staticmethod
    def from_urdf_string(
        text: str, root_joint: _RootJoint | None = None, mimic: bool = False, strict: bool = False
    ) -> Model:
        """Reads a URDF from a string; see `from_urdf`.

        >>> text = condyle.robots.QUADRUPED
        >>> condyle.Model.from_urdf_string(text, root_joint="free_flyer").nv
        18
        """
    @property
    def warnings(self) -> list[str]:
        """What is odd about the robot, though it could be loaded.

        Inertias that no body has, joints along which the inertia matrix is singular.
        """

    @property
    def singular_joints(self) -> list[int]:
        """The bodies whose joints make M singular: `aba`, `minv` and `aba_derivatives` raise `ModelError`."""

    @property
    def name(self) -> str:
        """The robot's name."""
    @property
    def nq(self) -> int:
        """How many numbers a position q has."""
    @property
    def nv(self) -> int:
        """How many degrees of freedom there are: the numbers of v, a, τ and of a tangent vector."""
    @property
    def nbodies(self) -> int:
        """How many bodies there are, the world included: the rows of f_ext and of what `forward_kinematics` returns."""
    @property
    def names(self) -> list[str]:
        """The names of the joints, one for each body; 'universe' for the world."""
    @property
    def body_names(self) -> list[str]:
        """The names of the links that the joints carry; 'universe' for the world."""
    @property
    def joint_types(self) -> list[str]:
        """The kind of each joint: 'revolute', 'continuous', 'prismatic', 'spherical', 'planar', 'translation' or
        'free_flyer'; 'universe' for the world.
        """
    @property
    def parents(self) -> list[int]:
        """The body on which each joint sits; 0 is the world."""
    @property
    def idx_qs(self) -> list[int]:
        """Where each joint's position begins in q; that of a joint that mimics another is the other's."""
    @property
    def idx_vs(self) -> list[int]:
        """Where each joint's velocity begins in v; that of a joint that mimics another is the other's."""
    @property
    def nqs(self) -> list[int]:
        """How many numbers of q each joint has of its own: none if it mimics another; 0 for the world."""
    @property
    def nvs(self) -> list[int]:
        """How many degrees of freedom each joint has of its own: none if it mimics another; 0 for the world."""
    @property
    def mimics(self) -> list[Mimic | None]:
        """How each joint follows another one, as `Mimic(ratio, offset)`, or None if it does not."""
    @property
    def joint_placements(self) -> _Array:
        """The pose of each joint's frame, at position zero, in its parent body: (nbodies, 4, 4)."""
    @property
    def inertias(self) -> list[Inertia]:
        """The inertia of each body, with all that fixed joints merge into it, as `Inertia`, in the body's frame."""
    @property
    def limits(self) -> Limits:
        """The limits of position, velocity and effort, as `Limits`; infinite where there are none."""
    @property
    def damping(self) -> _Array:
        """Viscous damping of each degree of freedom (N m s/rad, N s/m), nv numbers: used by no algorithm unasked."""
    @property
    def friction(self) -> _Array:
        """Coulomb friction of each degree of freedom (N m, N), nv numbers: used by no algorithm unasked."""
    @property
    def armature(self) -> _Array:
        """Inertia of the rotor as seen at each joint (kg m², kg), nv numbers, part of M in every algorithm."""
    @property
    def gravity(self) -> _Array:
        """The acceleration of free fall, in the world's frame (m/s²), 3 numbers."""
    @property
    def total_mass(self) -> float:
        """Mass of all bodies, of what is fixed to the world too (kg)."""
    @property
    def frames(self) -> list[Frame]:
        """All frames, as `Frame(name, kind, body, placement)`: two for each joint of the URDF, fixed ones too, the
        joint's and the link's.
        """
    def frame(self, name: str) -> int:
        """The number of the frame with this name: a link's, else the user's, else a joint's.

        Raises `ModelError`, with the nearest name.
        """
    def joint(self, name: str) -> int:
        """The number of the body that the joint with this name carries.

        Raises `ModelError`, with the nearest name.
        """
    def with_gravity(self, gravity: ArrayLike) -> Model:
        """The same robot under another gravity (m/s², 3 numbers, in the world's frame)."""
    def with_armature(self, armature: ArrayLike) -> Model:
        """The same robot with another armature, nv numbers (kg m², kg)."""
    def __copy__(self) -> Model:
        """The model itself: it never changes."""
    def __deepcopy__(self, memo: object) -> Model:
        """The model itself: it never changes."""
    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle."""

@final
class Data:
    """Scratch and results of every algorithm, for one model: made once, used by one thread at a time.

    It serves all models of the same bodies and joints, whatever their gravity, armature or inertias. No algorithm reads
    what another left behind, so calls may come in any order. To use one from two threads at once is a `RuntimeError`;
    with another robot's model, a `ValueError`.

    >>> arm = condyle.robots.arm7()
    >>> condyle.Data(arm)
    <condyle.Data of 'arm7'>
    """

    def __new__(cls, model: Model) -> Data: ...

def _model_from_bytes(data: bytes) -> Model:
    """The model that a pickle holds."""

def arm7() -> Model:
    """A seven-axis arm with a fixed base, nq = nv = 7; its last frame is `tool`.

    >>> condyle.robots.arm7()
    <condyle.Model 'arm7': 7 bodies, nq = 7, nv = 7>
    """

def quadruped() -> Model:
    """A quadruped of twelve joints on a free-flyer, nq = 19, nv = 18, with point feet `LF_foot`, `LH_foot`, `RF_foot`,
    `RH_foot`.

    >>> condyle.robots.quadruped()
    <condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>
    """

def humanoid() -> Model:
    """A humanoid of thirty-two joints on a free-flyer, nq = 39, nv = 38, with soles `left_sole`, `right_sole`.

    >>> condyle.robots.humanoid()
    <condyle.Model 'humanoid': 33 bodies, nq = 39, nv = 38>
    """

def forward_kinematics(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Where all bodies are: (nbodies, 4, 4), the pose of each body in the world as a homogeneous matrix; O(n).

    q: nq numbers. Body i is the one that joint i carries, in the frame that the URDF gives it; body 0 is the world.
    A frame's pose is that of its body times its placement: `poses[f.body] @ f.placement`; or see `frame_placement`.

    >>> quadruped = condyle.robots.quadruped()
    >>> data = condyle.Data(quadruped)
    >>> condyle.forward_kinematics(quadruped, data, condyle.neutral(quadruped)).shape
    (14, 4, 4)
    """

def frame_placement(model: Model, data: Data, q: ArrayLike, frame: str | int, out: _Array | None = None) -> _Array:
    """oXf, the pose of a frame in the world: (4, 4), a homogeneous matrix that takes coordinates in the frame to
    coordinates in the world; O(n).

    q: nq numbers; frame: its name or number.

    >>> arm = condyle.robots.arm7()
    >>> tool = condyle.frame_placement(arm, condyle.Data(arm), [0.0] * 7, "tool")
    >>> bool(tool[2, 3] > 0.5)  # stretched upwards
    True
    """

def frame_jacobian(
    model: Model,
    data: Data,
    q: ArrayLike,
    frame: str | int,
    reference: Literal["local", "world", "local_world_aligned"] = "local",
    out: _Array | None = None,
) -> _Array:
    """The Jacobian J of a frame, (6, nv), linear rows first: the frame's velocity is J v.

    q: nq numbers; frame: its name or number. reference: 'local', the velocity in the frame itself; 'world', that of
    the body's point at the world's origin, along the world's axes; or 'local_world_aligned', that of the frame's
    origin, along the world's axes.

    >>> arm = condyle.robots.arm7()
    >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.0] * 7, "tool", "local_world_aligned").shape
    (6, 7)
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
    """τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i: the joint efforts that make the robot accelerate with a, in O(n); nv
    numbers (N m, N).

    q: nq numbers; v, a: nv; f_ext: (nbodies, 6), a force on each body (N, then N m), acting at the body's origin and
    expressed in its frame, row 0 being the world's.

    >>> arm = condyle.robots.arm7()
    >>> tau = condyle.rnea(arm, condyle.Data(arm), [0.3] * 7, [0.0] * 7, [0.0] * 7)
    >>> bool(abs(tau[0]) < 1e-9)  # gravity does not turn a vertical axis
    True
    """

def aba(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: _Array | None = None,
) -> _Array:
    """q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i): how the robot accelerates, nv numbers (rad/s², m/s²); O(n).

    q: nq numbers; v, tau: nv; f_ext: as for `rnea`.

    >>> quadruped = condyle.robots.quadruped()
    >>> q, zero = condyle.neutral(quadruped), [0.0] * 18
    >>> a = condyle.aba(quadruped, condyle.Data(quadruped), q, zero, zero)
    >>> bool(abs(a[2] + 9.81) < 1e-12)  # it falls
    True
    """

def crba(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """M(q), the joint-space inertia matrix: (nv, nv), symmetric, both triangles filled, armature included; O(n depth).

    q: nq numbers. τ = M a + h; the kinetic energy is ½ vᵀ M v.

    >>> arm = condyle.robots.arm7()
    >>> M = condyle.crba(arm, condyle.Data(arm), [0.3] * 7)
    >>> bool(np.linalg.eigvalsh(M).min() > 0.0)
    True
    """

def minv(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """M(q)⁻¹: (nv, nv), symmetric, both triangles filled; without forming M.

    q: nq numbers.

    >>> arm = condyle.robots.arm7()
    >>> data, q = condyle.Data(arm), [0.3] * 7
    >>> np.allclose(condyle.minv(arm, data, q) @ condyle.crba(arm, data, q), np.eye(7))
    True
    """

def nonlinear_effects(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """h(q, v) = C(q, v) v + g(q): the efforts that keep the velocity as it is, nv numbers; `rnea` with a = 0.

    q: nq numbers; v: nv.
    """

def gravity(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """g(q): the efforts that hold the robot still, nv numbers; `rnea` with v = a = 0.

    q: nq numbers.

    >>> quadruped = condyle.robots.quadruped()
    >>> g = condyle.gravity(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(g[2] - 9.81 * quadruped.total_mass) < 1e-9)  # the base carries the weight
    True
    """

def rnea_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    a: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: _RneaOut | None = None,
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

def aba_derivatives(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    f_ext: ArrayLike | None = None,
    out: _AbaOut | None = None,
) -> AbaDerivatives:
    """`aba` and its derivatives with respect to q, v and τ, exact, as `AbaDerivatives(a, da_dq, da_dv, da_dtau)`: nv
    numbers and three matrices (nv, nv).

    q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving with the bodies. ∂/∂q is taken in the tangent space: the
    change of q̈ when q moves to `integrate(q, δ)`, per δ. out: four arrays, such as an earlier result.

    >>> arm = condyle.robots.arm7()
    >>> data = condyle.Data(arm)
    >>> d = condyle.aba_derivatives(arm, data, [0.3] * 7, [0.1] * 7, [1.0] * 7)
    >>> np.array_equal(d.da_dtau, condyle.minv(arm, data, [0.3] * 7))
    True
    """

def neutral(model: Model) -> _Array:
    """The position in which every body is at its joint's frame, nq numbers: zeros, and rotations by nothing.

    >>> condyle.neutral(condyle.robots.quadruped())[:7]
    array([0., 0., 0., 0., 0., 0., 1.])
    """

def random_configuration(model: Model, seed: int | None = None) -> _Array:
    """A position drawn uniformly, nq numbers: between its limits, within ±3 (rad, m) where a coordinate has none, over
    the whole group for rotations.

    seed: a number below 2⁶⁴; the same one gives the same position. None draws afresh.
    """

def integrate(model: Model, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """q ⊕ v: the position after moving with the velocity v for one unit of time, nq numbers.

    q: nq numbers; v: nv.

    >>> quadruped = condyle.robots.quadruped()
    >>> q0 = condyle.neutral(quadruped)
    >>> q1 = condyle.integrate(quadruped, q0, np.full(18, 0.1))
    >>> np.allclose(condyle.difference(quadruped, q0, q1), 0.1)
    True
    """

def difference(model: Model, q0: ArrayLike, q1: ArrayLike, out: _Array | None = None) -> _Array:
    """q₁ ⊖ q₀: the tangent vector v with q₀ ⊕ v = q₁, of rotations the shortest one; nv numbers.

    q0, q1: nq numbers.
    """

def integrate_jacobian(
    model: Model, v: ArrayLike, argument: Literal["position", "velocity"], out: _Array | None = None
) -> _Array:
    """∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v: (nv, nv), block-diagonal, between tangent spaces; it does not depend on q.

    v: nv numbers; argument: 'position' for q or 'velocity' for v.
    """

def difference_jacobian(
    model: Model, d: ArrayLike, argument: Literal["from", "to"], out: _Array | None = None
) -> _Array:
    """∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁: (nv, nv), block-diagonal, between tangent spaces; of the positions it needs
    their difference only.

    d: q₁ ⊖ q₀, nv numbers; argument: 'from' for q₀ or 'to' for q₁.
    """

@final
class Activation:
    """How much a residual r costs.

    >>> condyle.optimal.Activation.weighted([1.0, 0.0])
    Weighted([1.0, 0.0])
    """

    @staticmethod
    def quadratic() -> Activation:
        """½ Σ rᵢ²."""

    @staticmethod
    def weighted(w: ArrayLike) -> Activation:
        """½ Σ wᵢ rᵢ²."""

    @staticmethod
    def barrier(lower: ArrayLike, upper: ArrayLike) -> Activation:
        """½ Σ (excess of rᵢ over its bounds)²; infinite bounds are none."""

@final
class Cost:
    """A term of a cost: weight times an activation of a residual. The activation is quadratic unless given.

    >>> condyle.optimal.Cost.control("effort", 1e-3, [0.0] * 7)
    <condyle.optimal.Cost 'effort', weight 0.001>
    """

    @staticmethod
    def state(name: str, weight: float, reference: ArrayLike, activation: Activation | None = None) -> Cost:
        """r = x ⊖ reference, 2 nv numbers; reference = (q, v)."""

    @staticmethod
    def control(name: str, weight: float, reference: ArrayLike, activation: Activation | None = None) -> Cost:
        """r = u − reference, nu numbers."""

    @staticmethod
    def frame_placement(
        name: str,
        weight: float,
        model: Model,
        frame: str | int,
        target: ArrayLike,
        activation: Activation | None = None,
    ) -> Cost:
        """r = log(target⁻¹ oMf), 6 numbers, of a frame of the model; target is a homogeneous 4 × 4 matrix."""

    @staticmethod
    def frame_translation(
        name: str,
        weight: float,
        model: Model,
        frame: str | int,
        target: ArrayLike,
        activation: Activation | None = None,
    ) -> Cost:
        """r = p − target, 3 numbers in the world, of the origin of a frame of the model."""

@final
class FreeDynamics:
    """A knot of a robot that moves freely under its joints' efforts, by semi-implicit Euler.

    q̈ = aba(q, v, τ), v⁺ = v + q̈ Δt, q⁺ = q ⊕ (v Δt + q̈ Δt²), cost Δt Σ w a(r); the state is x = (q, v), the
    controls are the efforts of all joints but a free-flyer at the root.

    model: the robot.
    dt: Δt in seconds, or None for a terminal knot: no controls, cost Σ w a(r).
    costs: a list of `Cost`.

    Raises `ProblemError` for a cost that does not fit.
    """

    def __new__(cls, model: Model, dt: float | None, costs: Sequence[Cost]) -> FreeDynamics: ...
    def quasi_static(self, x: ArrayLike) -> _Array:
        """The efforts that hold the robot still at the state x, nu numbers."""

@final
class Problem:
    """An optimal control problem: knots from x0, each served by one of some models, and a terminal one.

    x0: the initial state, nx numbers.
    models: a list of `FreeDynamics`.
    stages: for each knot the index of its model; consecutive knots of one model are computed as a group.
    terminal: the `FreeDynamics` of the end.

    Raises `ProblemError` if they do not fit together.
    """

    def __new__(
        cls, x0: ArrayLike, models: Sequence[FreeDynamics], stages: Sequence[int], terminal: FreeDynamics
    ) -> Problem: ...
    @property
    def horizon(self) -> int:
        """The number of knots before the terminal one, N."""

    def rollout(self, us: ArrayLike) -> _Array:
        """The states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx)."""

@final
class Fddp:
    """Feasibility-driven differential dynamic programming, with Crocoddyl's rules and constants.

    problem: what is solved; the solver allocates for its shape once.
    settings: any of `max_iterations`, `tolerance`, `step_lengths`, `accept`, `accept_ascent`, `flat`,
        `regularisation_start`, `regularisation_min`, `regularisation_max`, `regularisation_factor`,
        `regularisation_decrease_above`, `regularisation_increase_below`.
    """

    def __new__(cls, problem: Problem, **settings: float) -> Fddp: ...
    def solve(self, xs: ArrayLike, us: ArrayLike) -> Solution:
        """Solves the problem from a warm start, and returns a `Solution`. Other threads run meanwhile.

        xs: states, (N + 1, nx); they need not satisfy the dynamics.
        us: controls, (N, nu).

        Raises `ProblemError` for numbers or settings that make no sense. How the solve ended is the solution's status.
        """
