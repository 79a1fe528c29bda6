"""Arguments and results of a whole-body controller: named tuples, and `References`, whose members are views of one
array.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import ControllerError, _check_pose, _check_rotations

if TYPE_CHECKING:
    from .distances import DistanceLimits

_Array: TypeAlias = NDArray[np.float64]
_Rotations: TypeAlias = tuple[tuple[str, int, int], ...]  # for each rotation: joint, and range in q


class Gains(NamedTuple):
    """The gains of a task: the desired acceleration is a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v)."""

    stiffness: float
    """The stiffness k (1/s²)."""
    damping: float
    """The damping d (1/s)."""

    @classmethod
    def critical(cls, stiffness: float) -> "Gains":
        """Returns the gains of a critically damped error with this stiffness (1/s²): d = 2 √k.

        >>> condyle.wholebody.Gains.critical(100.0)
        Gains(stiffness=100.0, damping=20.0)
        """
        return cls(float(stiffness), 2.0 * float(stiffness) ** 0.5)


class Pyramid(NamedTuple):
    """A pyramid that approximates the friction cone, for comparisons with other controllers."""

    sides: int = 4
    """The number of faces of the pyramid, at least 3."""
    inscribed: bool = True
    """Whether the pyramid lies inside the cone, so that the pyramid's edges touch the cone. Otherwise the pyramid lies
    outside, and its faces touch the cone.
    """


class JointLimits(NamedTuple):
    """Parameters of the bounds on q̈ that keep joints within their limits over a look-ahead time T.

        (v_min − v) / T ≤ q̈ ≤ (v_max − v) / T                        velocity
        (q_min − q) / T² − 2 v / T ≤ q̈ ≤ (q_max − q) / T² − 2 v / T    position

    A lower bound is at most a_max, and an upper bound at least −a_max. So a joint that is beyond its limit, or moves
    too fast towards it, returns with at most a_max. If the bounds for velocity and position exclude each other, the
    bound for position is used. If dynamics, contacts and torques leave no solution within the bounds, the bounds become
    tasks of large weight at this tick.
    """

    look_ahead: float = 0.05
    """The look-ahead time T (s), which should be at least some ticks."""
    max_acceleration: float = 200.0
    """The maximum acceleration a_max (rad/s², m/s²)."""
    lower: ArrayLike | None = None
    """Minimum position (rad, m), nq numbers; None for the model's limits."""
    upper: ArrayLike | None = None
    """Maximum position (rad, m), nq numbers; None for the model's limits."""
    velocity: ArrayLike | None = None
    """Maximum speed (rad/s, m/s), nv numbers; None for the model's limits."""


class Settings(NamedTuple):
    """The settings of a `WholeBodyController`.

    >>> from condyle.wholebody import Gains, Settings
    >>> settings = Settings(contact_gains=Gains.critical(400.0), effort=np.full(18, 40.0))  # motors of 40 N m
    """

    acceleration_weight: float = 1e-6
    """The weight of ½ ‖q̈‖², above 0. This term determines the accelerations that the tasks leave free."""
    force_weight: float = 1e-7
    """The weight of ½ Σ ‖f − f_ref‖² (1/N²), above 0. This term makes the distribution of forces unique. The moment of
    a sole's wrench counts as equivalent forces at the corners, so that the pressure stays away from the edges.
    """
    contact_gains: Gains = Gains(0.0, 0.0)
    """Gains of the Baumgarte stabilisation: a contact with the pose X and the velocity v has the acceleration k (X_ref
    ⊖ X) − d v instead of 0."""
    max_correction: float = 50.0
    """The maximum acceleration of the stabilisation by `contact_gains` (m/s², rad/s²): a foot that lands fast is
    stopped over some ticks.
    """
    friction: Literal["cone"] | Pyramid = "cone"
    """The form of the friction constraint: the exact cone ‖f_t‖ ≤ μ f_n, or a `Pyramid`."""
    effort: ArrayLike | None = None
    """Maximum effort of each coordinate (N m, N), nv numbers, infinite for no limit; None for the model's limits. The
    maximum must be above 0 for each actuated coordinate.
    """
    joint_limits: JointLimits | None = JointLimits()
    """The limits of the joints' position and velocity; None to ignore them."""
    hold_ticks: int = 5
    """The number of ticks after the last solution during which the safe command repeats the torques of this solution.
    """
    damping: float = 0.02
    """The damping of the safe command after `hold_ticks`. Its damping torque −D v at 1 rad/s is this fraction of the
    maximum effort (s/rad).
    """
    backend: Literal["interior_point", "clarabel"] = "interior_point"
    """The solver: Condyle's dense interior point method, warm-started from the last tick, or the library Clarabel."""
    formulation: Literal["condensed", "full"] = "condensed"
    """The unknowns of the program: 'condensed', the unknowns that remain after elimination of base and contacts; or,
    for comparison, 'full', all of (q̈, f).
    """
    warm_start: bool = True
    """Whether the solver starts from the last tick's solution if possible."""
    tolerance: float = 1e-9
    """The tolerance of the solver, absolute and relative, on feasibility and duality gap."""
    max_iterations: int = 50
    """The number of iterations after which a step fails."""
    time_limit: float = float("inf")
    """The time after which a step fails (s). If a step reaches this limit, its result depends on the load of the
    machine.
    """
    distances: "DistanceLimits | None" = None
    """The limits of distances between bodies and obstacles; None for no limits."""


class KktResiduals(NamedTuple):
    """The errors of the Karush–Kuhn–Tucker conditions at a step."""

    stationarity: float
    """The gradient of the Lagrangian, relative to the largest of its terms."""
    primal: float
    """The largest violation of an equality, bound or cone, relative to the magnitudes of its row and of the unknowns.
    """
    dual: float
    """The distance of the multipliers from their cones, relative to the size of the multipliers."""
    complementarity: float
    """The sum of the products of slack variables and multipliers, relative to 1 and the terms of the objective."""


class Command(NamedTuple):
    """The command for the robot at this tick. The command is finite and within the torque limits for every status.

    In a safe command, all members from `a` to `violation` are from the last solution.
    """

    status: Literal[
        "solved", "infeasible", "iteration_limit", "time_limit", "numerical_error", "not_finite", "invalid_state"
    ]
    """The reason why the step ended."""
    reason: str
    """The reason why the step ended, as a sentence. The sentence contains the index of a number that is not finite, or
    the joint or the frame whose rotation is invalid.
    """
    source: Literal["solution", "last_solution", "gravity_compensation"]
    """The method by which the command was computed. 'solution' also includes an iterate of an unfinished solve that
    satisfies all constraints. 'last_solution' and 'gravity_compensation' are safe commands: the torques of the last
    solution for some ticks, then gravity compensation with damping.
    """
    tau: _Array
    """The efforts τ of the motors (N m, N), nv numbers, 0 at a free-flyer."""
    a: _Array
    """The acceleration q̈ that follows from the command if the contacts hold (rad/s², m/s²), nv numbers."""
    forces: _Array
    """The force of the environment on the robot at each contact, (contacts, 6), linear first, about the origin of the
    contact's frame in the world's axes (N, N m).
    """
    com_acceleration: _Array
    """The acceleration c̈ = J q̈ + J̇ v of the centre of mass, in the world's frame (m/s²), 3 numbers."""
    violation: float
    """The largest violation of a constraint (N, N m, m/s²)."""
    iterations: int
    """The number of iterations of the solver."""
    reduced_accuracy: bool
    """Whether the solver met only its reduced tolerance, not the tolerance of the settings."""
    limits_relaxed: bool
    """Whether joint limits were relaxed because dynamics, contacts and torque limits left no solution within them."""

    def solved(self) -> "Command":
        """Returns the command itself if its status is 'solved'.

        Raises `ControllerError` with the reason if the command has another status.
        """
        if self.status != "solved":
            raise ControllerError(self.reason)
        return self


class Numbers:
    """A member of a `Target`: a view of a range of the target's numbers. The member can be set from any array with the
    shape of the view.
    """

    def __init__(self, first: int, *shape: int) -> None:
        self.first, self.shape = first, shape

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    @overload
    def __get__(self, target: None, owner: type) -> "Numbers": ...
    @overload
    def __get__(self, target: "Target", owner: type) -> _Array: ...
    def __get__(self, target: "Target | None", owner: type) -> "Numbers | _Array":
        return self if target is None else target._views[self.name]

    def __set__(self, target: "Target", value: ArrayLike) -> None:
        view, given = target._views[self.name], np.asarray(value, np.float64)
        if given.shape != view.shape:
            raise ValueError(f"{target._name}.{self.name}: expected shape {view.shape}, found {given.shape}")
        self.check(target, given)
        view[...] = given

    def check(self, target: "Target", given: _Array) -> None:
        """Raises `ValueError` for values that are invalid for this member."""


class Pose(Numbers):
    """A pose of a `Target`: a homogeneous (4, 4) matrix. The rotation is checked when the pose is set."""

    def __init__(self, first: int) -> None:
        super().__init__(first, 4, 4)

    def check(self, target: "Target", given: _Array) -> None:
        _check_pose(f"{target._name}.{self.name}", given)


class Position(Numbers):
    """A position of a `PostureTarget`. Quaternions and pairs (cos, sin) are checked when the position is set."""

    def check(self, target: "Target", given: _Array) -> None:
        if isinstance(target, PostureTarget):
            _check_rotations(f"{target._name}.{self.name}", given, target._rotations)


class Target:
    """A target: a range of the numbers of `References`, with named members."""

    __slots__ = ("_name", "_numbers", "_views")
    SIZE: int

    def __init__(self, name: str, numbers: _Array) -> None:
        self._name, self._numbers = name, numbers
        self._views = {
            member.name: numbers[member.first : member.first + int(np.prod(member.shape))].reshape(member.shape)
            for member in vars(type(self)).values()
            if isinstance(member, Numbers)
        }

    def __repr__(self) -> str:
        members = ", ".join(f"{name}={np.array2string(view, precision=4)}" for name, view in self._views.items())
        return f"{type(self).__name__}({members})"

    def __reduce__(self) -> "tuple[type[Target], tuple[Any, ...]]":
        return type(self), (self._name, self._numbers.copy())


class ComTarget(Target):
    """The target of the centre of mass, in the world's frame."""

    __slots__ = ()
    SIZE = 9
    position = Numbers(0, 3)
    """The reference position c_ref (m), 3 numbers."""
    velocity = Numbers(3, 3)
    """The reference velocity ċ_ref (m/s), 3 numbers."""
    acceleration = Numbers(6, 3)
    """The reference acceleration c̈_ref (m/s²), 3 numbers."""


class MomentumTarget(Target):
    """The target of the angular momentum about the centre of mass, in the world's axes."""

    __slots__ = ()
    SIZE = 6
    momentum = Numbers(0, 3)
    """The reference angular momentum k_ref (kg m²/s), 3 numbers."""
    rate = Numbers(3, 3)
    """The rate of k_ref (N m), 3 numbers."""


class FrameTarget(Target):
    """The target of a frame. Velocity and acceleration belong to the frame's origin and rotation, along the world's
    axes, linear first. Their linear parts are the first and second time derivatives of the origin's position (so the
    acceleration is classical).
    """

    __slots__ = ()
    SIZE = 28
    pose = Pose(0)
    """The reference pose oXf of the frame, a homogeneous (4, 4) matrix."""
    velocity = Numbers(16, 6)
    """The reference velocity (ṗ, ω) of the frame (m/s, rad/s), 6 numbers."""
    acceleration = Numbers(22, 6)
    """The reference acceleration (p̈, ω̇) of the frame (m/s², rad/s²), 6 numbers."""


class ContactTarget(Target):
    """The target of a contact: whether the contact touches, the pose at which the frame is held, and the reference of
    the contact's force, in the world's frame.
    """

    __slots__ = ()
    SIZE = 23
    pose = Pose(1)
    """The pose at which the frame is held, a homogeneous (4, 4) matrix. The pose has an effect only if the stiffness of
    `Settings.contact_gains` is above 0. For a point contact, only the translation is used.
    """
    force = Numbers(17, 6)
    """The reference force of the environment on the robot, linear first, about the frame's origin (N, N m): a planned
    force, or a share of the weight.
    """

    @property
    def activation(self) -> float:
        """The activation α, from 0 (the contact does not touch: no force, and the frame may move) to 1 (the contact
        touches).

        Between 0 and 1 the frame is held. The normal force is at most α times the contact's `max_force`, or α times the
        robot's weight if `max_force` is infinite. So a ramp over some ticks loads or unloads the contact without a jump
        in the torques. Numbers outside 0 to 1 are clamped.
        """
        return float(self._numbers[0])

    @activation.setter
    def activation(self, value: float) -> None:
        self._numbers[0] = value


class PostureTarget(Target):
    """The target of the joints: a state of the robot. Entries of a free-flyer are ignored."""

    __slots__ = ("_rotations",)

    def __init__(self, name: str, numbers: _Array, nq: int, nv: int, rotations: _Rotations = ()) -> None:
        self._name, self._numbers, self._rotations = name, numbers, rotations
        self._views = {"q": numbers[:nq], "v": numbers[nq : nq + nv], "a": numbers[nq + nv :]}

    def __reduce__(self) -> "tuple[type[Target], tuple[Any, ...]]":
        sizes = len(self._views["q"]), len(self._views["v"])
        return type(self), (self._name, self._numbers.copy(), *sizes, self._rotations)

    q = Position(0)
    """The reference position q_ref, nq numbers."""
    v = Numbers(0)
    """The reference velocity v_ref, nv numbers."""
    a = Numbers(0)
    """The reference acceleration a_ref, nv numbers."""


class References:
    """The targets of all tasks during one tick. `WholeBodyController.hold` creates `References` for a position.

    The members are views of one array. Members can be set, or changed in place. A copy has its own numbers. Values are
    checked when they are set: rotations must be valid, and quaternions and pairs (cos, sin) must have length 1. Each
    step of the controller checks all values.

    >>> from condyle.wholebody import FrictionContact, Task, WholeBodyController
    >>> robot = condyle.robots.quadruped()
    >>> feet = [FrictionContact.point(foot, 0.7) for foot in ("LF_foot", "RH_foot")]
    >>> references = WholeBodyController(robot, feet, [Task.com()]).hold(condyle.neutral(robot))
    >>> references.com.acceleration[0] = 0.5  # lean forward
    >>> references.com.velocity = [0.1, 0.0, 0.0]
    >>> references.contacts[0].activation = 0.0  # without this foot
    >>> references
    <condyle.wholebody.References of 0 frames and 2 contacts>
    """

    __slots__ = ("_numbers", "_rotations", "_sizes", "com", "contacts", "frames", "momentum", "posture")
    com: ComTarget
    """The target of the centre of mass."""
    momentum: MomentumTarget
    """The target of the angular momentum."""
    posture: PostureTarget
    """The target of the joints."""
    frames: tuple[FrameTarget, ...]
    """A target for each task that moves a frame, in the order of the tasks."""
    contacts: tuple[ContactTarget, ...]
    """A target for each `FrictionContact`, in the order of the contacts."""

    def __init__(self, sizes: tuple[int, int, int, int], numbers: _Array, rotations: _Rotations = ()) -> None:
        nq, nv, frames, contacts = self._sizes = sizes
        self._numbers, self._rotations = numbers, rotations
        parts = self._parts()
        self.com = ComTarget("com", next(parts))
        self.momentum = MomentumTarget("momentum", next(parts))
        self.posture = PostureTarget("posture", next(parts), nq, nv, rotations)
        self.frames = tuple(FrameTarget(f"frames[{k}]", next(parts)) for k in range(frames))
        self.contacts = tuple(ContactTarget(f"contacts[{k}]", next(parts)) for k in range(contacts))

    def _parts(self) -> Iterator[_Array]:
        """Yields the numbers of each target."""
        nq, nv, frames, contacts = self._sizes
        sizes = [ComTarget.SIZE, MomentumTarget.SIZE, nq + 2 * nv]
        sizes += [FrameTarget.SIZE] * frames + [ContactTarget.SIZE] * contacts
        yield from np.split(self._numbers, np.cumsum(sizes)[:-1])

    def copy(self) -> "References":
        """Returns independent references with the same numbers."""
        return References(self._sizes, self._numbers.copy(), self._rotations)

    def __copy__(self) -> "References":
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> "References":
        return self.copy()

    def __reduce__(self) -> tuple[Any, ...]:
        return References, (self._sizes, self._numbers, self._rotations)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, References):
            return NotImplemented
        return self._sizes == other._sizes and np.array_equal(self._numbers, other._numbers)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<condyle.wholebody.References of {len(self.frames)} frames and {len(self.contacts)} contacts>"


# public module of these classes, for users and for pickle
for _class in [_item for _item in globals().values() if isinstance(_item, type) and _item.__module__ == __name__]:
    _class.__module__ = "condyle.wholebody"
