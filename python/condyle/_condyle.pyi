"""Rigid-body dynamics with exact derivatives: the compiled part of `condyle`."""

import os
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._types import (
    AbaDerivatives,
    AllTerms,
    CentroidalMap,
    CentroidalMapRate,
    Frame,
    Inertia,
    Limits,
    Mimic,
    RneaDerivatives,
    Solution,
)

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
    "centroidal_map",
    "centroidal_map_rate",
    "centroidal_momentum",
    "centroidal_momentum_rate",
    "com",
    "com_acceleration",
    "com_jacobian",
    "com_velocity",
    "compute_all_terms",
    "coriolis_matrix",
    "crba",
    "difference",
    "difference_jacobian",
    "distance",
    "forward_kinematics",
    "frame_acceleration",
    "frame_classical_acceleration",
    "frame_jacobian",
    "frame_jacobian_rate",
    "frame_placement",
    "frame_velocity",
    "gravity",
    "humanoid",
    "integrate",
    "integrate_jacobian",
    "interpolate",
    "joint_torque_regressor",
    "kinetic_energy",
    "kinetic_energy_regressor",
    "mechanical_energy",
    "minv",
    "neutral",
    "nonlinear_effects",
    "normalize",
    "passive_torque",
    "passive_torque_derivative",
    "potential_energy",
    "potential_energy_regressor",
    "quadruped",
    "random_configuration",
    "rnea",
    "rnea_derivatives",
    "static_torque",
    "transport",
]

_Array: TypeAlias = NDArray[np.float64]
_RootJoint: TypeAlias = Literal["free_flyer", "planar", "spherical", "translation"]
_Reference: TypeAlias = Literal["local", "world", "local_world_aligned"]
_RneaOut: TypeAlias = RneaDerivatives | tuple[_Array, _Array, _Array]
_AbaOut: TypeAlias = AbaDerivatives | tuple[_Array, _Array, _Array, _Array]
_MapOut: TypeAlias = CentroidalMap | tuple[_Array, _Array, _Array, _Array]
_MapRateOut: TypeAlias = CentroidalMapRate | tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array]

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
    def inertial_parameters(self) -> _Array:
        """π, ten numbers for each body but the world, 10 (nbodies − 1) in all: mass, mass times centre of mass, and xx,
        xy, yy, xz, yz, zz of the rotational inertia about the origin of the body's frame; what regressors are
        multiplied with.
        """
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
    def lock(self, joints: Sequence[str | int], q: ArrayLike) -> Model:
        """The same robot with some joints locked where they are at q.

        Their bodies are merged into those that carry them and stay as frames. A joint that follows a locked one is
        locked with it.

        joints: a list of names or numbers of bodies.
        q: nq numbers.

        >>> condyle.robots.arm7().lock(["joint4", 6], [0.0] * 7).names
        ['universe', 'joint1', 'joint2', 'joint3', 'joint5', 'joint7']

        Raises `ModelError`.
        """
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
    reference: _Reference = "local",
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

def frame_velocity(
    model: Model,
    data: Data,
    q: ArrayLike,
    v: ArrayLike,
    frame: str | int,
    reference: _Reference = "local",
    out: _Array | None = None,
) -> _Array:
    """The velocity of a frame, 6 numbers: of its body's point at the origin of the reference (m/s), then of its
    rotation (rad/s); O(n).

    q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.5] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "tool")
    >>> np.allclose(condyle.frame_velocity(arm, data, q, v, "tool"), J @ v)
    True
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
    velocity, seen from the world, expressed in the reference; O(n).

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
    """The classical acceleration of a frame, 6 numbers: v̇ + ω × v of its body's point at the origin of the reference
    (m/s²), then of its rotation (rad/s²); in 'local_world_aligned' p̈ of the frame's origin; O(n).

    q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.2] * 7
    >>> J = condyle.frame_jacobian(arm, data, q, "tool", "local_world_aligned")
    >>> dJ = condyle.frame_jacobian_rate(arm, data, q, v, "tool", "local_world_aligned")
    >>> acceleration = condyle.frame_classical_acceleration(arm, data, q, v, a, "tool", "local_world_aligned")
    >>> np.allclose(acceleration, J @ a + dJ @ v)
    True
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
    """dJ/dt, the rate of a frame's Jacobian along v, (6, nv), linear rows first.

    q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`. dJ v + J a is the spatial
    acceleration in 'local' and 'world', and the classical one in 'local_world_aligned', whose origin moves with the
    frame.
    """

def com(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """c, the centre of mass of the moving bodies, 3 numbers, in the world's frame (m); O(n).

    q: nq numbers. What is fixed to the world does not count; not a number if nothing that moves has a mass.

    >>> quadruped = condyle.robots.quadruped()
    >>> com = condyle.com(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(com[1]) < 1e-12)  # left and right weigh the same
    True
    """

def com_velocity(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """ċ, the velocity of the centre of mass of the moving bodies, 3 numbers, in the world's frame (m/s); O(n).

    q: nq numbers; v: nv.
    """

def com_acceleration(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """c̈, the acceleration of the centre of mass of the moving bodies, 3 numbers, in the world's frame (m/s²), without
    gravity; O(n).

    q: nq numbers; v, a: nv.
    """

def com_jacobian(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """Jcom(q), the Jacobian of the centre of mass: (3, nv), ċ = Jcom v; O(n).

    q: nq numbers. It is a part of `centroidal_map`.
    """

def centroidal_map(model: Model, data: Data, q: ArrayLike, out: _MapOut | None = None) -> CentroidalMap:
    """The centroidal momentum matrix Ag(q), hg = Ag v, and what it needs, in O(n), as `CentroidalMap(Ag, Ig, com,
    Jcom)`.

    q: nq numbers. What is fixed to the world does not count; not a number if nothing that moves has a mass. out: four
    arrays, such as an earlier result.

    >>> quadruped = condyle.robots.quadruped()
    >>> map = condyle.centroidal_map(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
    >>> bool(abs(map.Ag[0, 0] - quadruped.total_mass) < 1e-9)  # pushed forwards, all goes forwards
    True
    """

def centroidal_map_rate(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _MapRateOut | None = None
) -> CentroidalMapRate:
    """Ag(q), its rate along v, and the centroidal momentum hg = Ag v, in O(n), as
    `CentroidalMapRate(Ag, dAg, hg, Ig, com, com_velocity, Jcom)`; the rate of hg is Ag a + dAg v.

    q: nq numbers; v: nv. What is fixed to the world does not count; not a number if nothing that moves has a mass. out:
    seven arrays, such as an earlier result.
    """

def centroidal_momentum(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """hg, the momentum of the moving bodies about their centre of mass, along the world's axes: 6 numbers (kg m/s, then
    kg m²/s); O(n).

    q: nq numbers; v: nv.
    """

def centroidal_momentum_rate(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """The rate of hg, along the world's axes: 6 numbers (N, then N m), the weight and the external forces about the
    centre of mass; O(n).

    q: nq numbers; v, a: nv.
    """

def kinetic_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """T = ½ vᵀ M(q) v, the kinetic energy of the moving bodies and the rotors (J); O(n).

    q: nq numbers; v: nv.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, np.full(7, 0.5)
    >>> np.isclose(condyle.kinetic_energy(arm, data, q, v), 0.5 * v @ condyle.crba(arm, data, q) @ v).item()
    True
    """

def potential_energy(model: Model, data: Data, q: ArrayLike) -> float:
    """V = −m gᵀ c(q), the potential energy of the moving bodies under gravity (J), 0 at the world's origin; O(n).

    q: nq numbers.
    """

def mechanical_energy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """E = T + V, the mechanical energy (J); O(n).

    q: nq numbers; v: nv. Its rate is the power of the efforts and the external forces.
    """

def compute_all_terms(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> AllTerms:
    """What the equations of motion are made of, from one pass to the tips and one back, in O(n depth), as
    `AllTerms(M, h, centroidal, kinetic_energy, potential_energy)`.

    q: nq numbers; v: nv. The numbers are those of `crba`, `nonlinear_effects`, `centroidal_map_rate`,
    `kinetic_energy` and `potential_energy`, up to rounding.

    >>> arm = condyle.robots.arm7()
    >>> terms = condyle.compute_all_terms(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7)
    >>> terms.M.shape, terms.h.shape, terms.centroidal.Ag.shape
    ((7, 7), (7,), (6, 7))
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

def static_torque(
    model: Model, data: Data, q: ArrayLike, f_ext: ArrayLike | None = None, out: _Array | None = None
) -> _Array:
    """τ = g(q) − Σ Jᵢᵀ f_ext,i: the efforts that hold the robot still under external forces, nv numbers (N m, N); O(n).

    q: nq numbers; f_ext: as for `rnea`. It is `rnea` with v = a = 0.
    """

def coriolis_matrix(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """C(q, v), the Coriolis matrix by Christoffel symbols: (nv, nv), C v = h − g, Ṁ = C + Cᵀ; O(n depth).

    q: nq numbers; v: nv.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
    >>> h, g = condyle.nonlinear_effects(arm, data, q, v), condyle.gravity(arm, data, q)
    >>> np.allclose(condyle.coriolis_matrix(arm, data, q, v) @ v, h - g)
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

def joint_torque_regressor(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, out: _Array | None = None
) -> _Array:
    """Y(q, v, a) with τ = Y π: (nv, 10 (nbodies − 1)), `rnea` as a linear function of `Model.inertial_parameters`; O(n
    depth).

    q: nq numbers; v, a: nv. Ten columns for each body but the world. With the rotors τ = Y π + armature a.

    >>> arm = condyle.robots.arm7()
    >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
    >>> Y = condyle.joint_torque_regressor(arm, data, q, v, a)
    >>> np.allclose(Y @ arm.inertial_parameters, condyle.rnea(arm, data, q, v, a))
    True
    """

def kinetic_energy_regressor(model: Model, data: Data, q: ArrayLike, v: ArrayLike, out: _Array | None = None) -> _Array:
    """y(q, v) with T = y · π: 10 (nbodies − 1) numbers, `kinetic_energy` as a linear function of
    `Model.inertial_parameters`, without the rotors; O(n).

    q: nq numbers; v: nv.
    """

def potential_energy_regressor(model: Model, data: Data, q: ArrayLike, out: _Array | None = None) -> _Array:
    """y(q) with V = y · π: 10 (nbodies − 1) numbers, `potential_energy` as a linear function of
    `Model.inertial_parameters`; O(n).

    q: nq numbers.
    """

def passive_torque(model: Model, v: ArrayLike, smoothing: float, out: _Array | None = None) -> _Array:
    """τ = −d v − f tanh(v/ε): the efforts of the joints' own damping d and smoothed friction f, nv numbers (N m, N);
    O(n).

    v: nv numbers; smoothing: ε > 0, the speed (rad/s, m/s) at which friction is 76 % of f. No other function knows of
    them: whoever wants them adds them to τ.

    >>> arm = condyle.robots.arm7()
    >>> v = np.ones(7)
    >>> np.allclose(condyle.passive_torque(arm, v, 1e-3), -arm.damping - arm.friction)
    True
    """

def passive_torque_derivative(model: Model, v: ArrayLike, smoothing: float, out: _Array | None = None) -> _Array:
    """∂τ/∂v = −d − f/ε (1 − tanh²(v/ε)) of `passive_torque`: nv numbers, the diagonal of a matrix without other
    entries; O(n).

    v: nv numbers; smoothing: ε > 0 (rad/s, m/s).
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

def interpolate(model: Model, q0: ArrayLike, q1: ArrayLike, t: float, out: _Array | None = None) -> _Array:
    """q₀ ⊕ t (q₁ ⊖ q₀): from q₀ at t = 0 to q₁ at t = 1 at a constant velocity, nq numbers.

    q0, q1: nq numbers; t: a number, beyond 0 and 1 too.

    >>> condyle.interpolate(condyle.robots.arm7(), [0.0] * 7, [1.0] * 7, 0.25)
    array([0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25])
    """

def distance(model: Model, q0: ArrayLike, q1: ArrayLike) -> float:
    """‖q₁ ⊖ q₀‖, with lengths (m) and angles (rad) counted alike.

    q0, q1: nq numbers.
    """

def normalize(model: Model, q: ArrayLike, out: _Array | None = None) -> _Array:
    """q with its quaternions and pairs (cos, sin) brought back to length 1, nq numbers; q itself stays unless it is
    `out`.

    q: nq numbers.

    >>> quadruped = condyle.robots.quadruped()
    >>> q = condyle.neutral(quadruped)
    >>> q[6] = 2.0
    >>> np.array_equal(condyle.normalize(quadruped, q), condyle.neutral(quadruped))
    True
    """

def transport(model: Model, v: ArrayLike, X: ArrayLike, out: _Array | None = None) -> _Array:
    """The columns of X, tangent vectors at q ⊕ v, taken to the tangent space at q: (∂(q ⊕ v)/∂q)⁻¹ X.

    v: nv numbers; X: a matrix of nv rows. Pinocchio's `dIntegrateTransport` multiplies with ∂(q ⊕ v)/∂q itself: it is
    `transport` with −v.

    >>> quadruped = condyle.robots.quadruped()
    >>> v = np.full(18, 0.1)
    >>> J = condyle.integrate_jacobian(quadruped, v, "position")
    >>> np.allclose(condyle.transport(quadruped, v, J), np.eye(18))
    True
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
