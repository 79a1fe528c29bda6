"""What a whole-body controller is told and what it answers: named tuples, and references, views of one array."""

from collections.abc import Iterator
from typing import Any, Literal, NamedTuple, TypeAlias, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import ControllerError, _check_pose, _check_rotations

_Array: TypeAlias = NDArray[np.float64]
_Rotations: TypeAlias = tuple[tuple[str, int, int], ...]  # the joint, and the range in q of what has length 1


class Gains(NamedTuple):
    """The gains of a task: the desired acceleration is a* = a_ref + k (x_ref ⊖ x) + d (v_ref − v)."""

    stiffness: float
    """k (1/s²)."""
    damping: float
    """d (1/s)."""

    @classmethod
    def critical(cls, stiffness: float) -> "Gains":
        """The gains of a critically damped error of this stiffness (1/s²): d = 2 √k.

        >>> condyle.wholebody.Gains.critical(100.0)
        Gains(stiffness=100.0, damping=20.0)
        """
        return cls(float(stiffness), 2.0 * float(stiffness) ** 0.5)


class Pyramid(NamedTuple):
    """A friction cone described by a pyramid, for comparison with other controllers."""

    sides: int = 4
    """The number of its faces, at least 3."""
    inscribed: bool = True
    """Whether it lies within the cone and touches it with its edges, or around it and touches it with its faces."""


class JointLimits(NamedTuple):
    """How joints are kept within their limits: by bounds on q̈, for a time T to look ahead.

        (v_min − v) / T ≤ q̈ ≤ (v_max − v) / T                        velocity
        (q_min − q) / T² − 2 v / T ≤ q̈ ≤ (q_max − q) / T² − 2 v / T    position

    Each bound is no further than a_max from 0 on the other's side: a joint that is beyond its limit, or too fast
    towards it, is led back with at most a_max. Where they exclude each other, the position's bound holds; where
    dynamics, contacts and torques leave nothing within them, they become tasks of great weight at that tick.
    """

    look_ahead: float = 0.05
    """T (s); some ticks at least."""
    max_acceleration: float = 200.0
    """a_max (rad/s², m/s²)."""
    lower: ArrayLike | None = None
    """Least position (rad, m), nq numbers; None for the model's."""
    upper: ArrayLike | None = None
    """Greatest position (rad, m), nq numbers; None for the model's."""
    velocity: ArrayLike | None = None
    """Greatest speed (rad/s, m/s), nv numbers; None for the model's."""


class Settings(NamedTuple):
    """The settings of a `WholeBodyController`.

    >>> from condyle.wholebody import Gains, Settings
    >>> settings = Settings(contact_gains=Gains.critical(400.0), effort=np.full(18, 40.0))  # motors of 40 N m
    """

    acceleration_weight: float = 1e-6
    """The weight of ½ ‖q̈‖², which decides what the tasks leave open; above 0."""
    force_weight: float = 1e-7
    """The weight of ½ Σ ‖f − f_ref‖² (1/N²), which spreads the forces; above 0. A moment of a sole's wrench counts as
    the forces at the corners that make it, so that pressure stays away from the edges."""
    contact_gains: Gains = Gains(0.0, 0.0)
    """Baumgarte's: a contact's acceleration is k (X_ref ⊖ X) − d v instead of 0."""
    max_correction: float = 50.0
    """The greatest such acceleration (m/s², rad/s²): a foot that lands fast is stopped over some ticks."""
    friction: Literal["cone"] | Pyramid = "cone"
    """The description of friction: ‖f_t‖ ≤ μ f_n itself, or a `Pyramid`."""
    effort: ArrayLike | None = None
    """Greatest effort of each coordinate (N m, N), nv numbers, infinite where there is none. None: the model's. It is
    above 0 for each actuated coordinate."""
    joint_limits: JointLimits | None = JointLimits()
    """The limits of the joints' position and velocity; None for no such limits."""
    hold_ticks: int = 5
    """The number of ticks after the last solution during which its torques serve as the safe command."""
    damping: float = 0.02
    """The damping of the safe command that follows: −D v, D in this part of the greatest effort for 1 rad/s (s/rad)."""
    backend: Literal["interior_point", "clarabel"] = "interior_point"
    """The solver: our own dense interior point method, warm-started from the last tick, or clarabel."""
    form: Literal["condensed", "full"] = "condensed"
    """The unknowns: what the elimination of base and contacts leaves, or, for comparison, all of (q̈, f)."""
    warm_start: bool = True
    """Whether the solver begins at the last tick's solution, if it can."""
    tolerance: float = 1e-9
    """The tolerance of the solver, absolute and relative, on feasibility and duality gap."""
    max_iterations: int = 50
    """The number of iterations after which a step fails."""
    time_limit: float = float("inf")
    """The time after which a step fails (s). What depends on it depends on the machine's load."""


class Optimality(NamedTuple):
    """The errors of the conditions of Karush, Kuhn and Tucker at a step."""

    stationarity: float
    """The gradient of the Lagrangian, relative to the largest of its terms."""
    primal: float
    """The violation of the worst equality, bound or cone, relative to its row and the unknowns."""
    dual: float
    """How far the multipliers are outside of their cones, relative to themselves."""
    complementarity: float
    """The sum of the products of slacks and multipliers, relative to 1 and the terms of the objective."""


class Command(NamedTuple):
    """What the robot should do now: finite, and within the limits of the torques, whatever the status says.

    Of a safe command, all members from `a` to `violation` are the last solution's.
    """

    status: Literal[
        "solved", "infeasible", "iteration_limit", "time_limit", "numerical_error", "not_finite", "invalid_state"
    ]
    """The end of the step in a word."""
    reason: str
    """End of the step in a sentence. It names the index of a number that is not finite, or the joint or the frame whose
    rotation is invalid."""
    source: Literal["solution", "last_solution", "gravity_compensation"]
    """The origin of the command. A solver that has not finished may still give an iterate that holds all constraints:
    a 'solution'. Others are safe commands: the last solution's torques for some ticks, then gravity compensation with
    damping."""
    tau: _Array
    """τ, the efforts of the motors (N m, N), nv numbers, 0 at a free-flyer."""
    a: _Array
    """q̈, the acceleration that follows if the contacts hold (rad/s², m/s²), nv numbers."""
    forces: _Array
    """The force of the environment on the robot at each contact, (contacts, 6), linear first, about the origin of the
    contact's frame along the world's axes (N, N m)."""
    com_acceleration: _Array
    """c̈ = J q̈ + J̇ v of the centre of mass, in the world's frame (m/s²), 3 numbers."""
    violation: float
    """The violation of the worst constraint (N, N m, m/s²)."""
    iterations: int
    """The number of iterations of the solver."""
    reduced_accuracy: bool
    """Whether the solver fell short of the tolerance and met only its reduced one."""
    limits_relaxed: bool
    """Whether the limits of joints had to give way to dynamics, contacts and torques."""

    def solved(self) -> "Command":
        """The command itself if its status is 'solved'.

        Raises `ControllerError` with the reason otherwise.
        """
        if self.status != "solved":
            raise ControllerError(self.reason)
        return self


class Numbers:
    """A member of a `Target`: some of its numbers, read as a view of them and set from whatever has their shape."""

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
        """Raises `ValueError` for numbers that these cannot be."""


class Pose(Numbers):
    """A pose of a `Target`: a homogeneous (4, 4) matrix, whose rotation is checked when it is set."""

    def __init__(self, first: int) -> None:
        super().__init__(first, 4, 4)

    def check(self, target: "Target", given: _Array) -> None:
        _check_pose(f"{target._name}.{self.name}", given)


class Position(Numbers):
    """A position of a `PostureTarget`, whose quaternions and pairs (cos, sin) are checked when it is set."""

    def check(self, target: "Target", given: _Array) -> None:
        if isinstance(target, PostureTarget):
            _check_rotations(f"{target._name}.{self.name}", given, target._rotations)


class Target:
    """Some numbers of `References`, by name."""

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
    """Where the centre of mass should be, in the world's frame."""

    __slots__ = ()
    SIZE = 9
    position = Numbers(0, 3)
    """c_ref (m), 3 numbers."""
    velocity = Numbers(3, 3)
    """ċ_ref (m/s), 3 numbers."""
    acceleration = Numbers(6, 3)
    """c̈_ref (m/s²), 3 numbers."""


class MomentumTarget(Target):
    """What the angular momentum about the centre of mass should be, along the world's axes."""

    __slots__ = ()
    SIZE = 6
    momentum = Numbers(0, 3)
    """k_ref (kg m²/s), 3 numbers."""
    rate = Numbers(3, 3)
    """Its rate (N m), 3 numbers."""


class FrameTarget(Target):
    """Where a frame should be. Velocity and acceleration are those of its origin and of its rotation, along the world's
    axes: linear first, the first and second time derivative of the position (a classical acceleration)."""

    __slots__ = ()
    SIZE = 28
    pose = Pose(0)
    """oXf, a homogeneous (4, 4) matrix."""
    velocity = Numbers(16, 6)
    """(ṗ, ω) (m/s, rad/s), 6 numbers."""
    acceleration = Numbers(22, 6)
    """(p̈, ω̇) (m/s², rad/s²), 6 numbers."""


class ContactTarget(Target):
    """Whether a contact touches, where it is held, and about which force its force is regularised; in the world."""

    __slots__ = ()
    SIZE = 23
    pose = Pose(1)
    """Where the frame is held, a homogeneous (4, 4) matrix; acts only if `Settings.contact_gains` have a stiffness. Of
    a point, the translation alone."""
    force = Numbers(17, 6)
    """What the environment should do to the robot, linear first, about the frame's origin (N, N m): a planned force, or
    a share of the weight."""

    @property
    def activation(self) -> float:
        """α, from 0 (it does not touch: no force, and the frame may move) to 1 (it touches).

        Between them the frame is held and the normal force is at most α times the contact's `max_force`, or the robot's
        weight if that is infinite: a ramp over some ticks loads or unloads the contact without a jump in the torques.
        Numbers outside of 0 to 1 are clamped.
        """
        return float(self._numbers[0])

    @activation.setter
    def activation(self, value: float) -> None:
        self._numbers[0] = value


class PostureTarget(Target):
    """Where the joints should be: a state of the robot. Entries of a free-flyer do not act."""

    __slots__ = ("_rotations",)

    def __init__(self, name: str, numbers: _Array, nq: int, nv: int, rotations: _Rotations = ()) -> None:
        self._name, self._numbers, self._rotations = name, numbers, rotations
        self._views = {"q": numbers[:nq], "v": numbers[nq : nq + nv], "a": numbers[nq + nv :]}

    def __reduce__(self) -> "tuple[type[Target], tuple[Any, ...]]":
        sizes = len(self._views["q"]), len(self._views["v"])
        return type(self), (self._name, self._numbers.copy(), *sizes, self._rotations)

    q = Position(0)
    """q_ref, nq numbers."""
    v = Numbers(0)
    """v_ref, nv numbers."""
    a = Numbers(0)
    """a_ref, nv numbers."""


class References:
    """What all tasks aim at during one tick. `WholeBodyController.hold` makes one to start from.

    Its members are views of one array: they are changed in place, or set. A copy has numbers of its own. What is set is
    checked at once: rotations are rotations, quaternions and pairs (cos, sin) have length 1. A step checks all of it.

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
    """The centre of mass."""
    momentum: MomentumTarget
    """The angular momentum."""
    posture: PostureTarget
    """The joints."""
    frames: tuple[FrameTarget, ...]
    """One for each task that names a frame to be moved, in the same order."""
    contacts: tuple[ContactTarget, ...]
    """One for each `FrictionContact`, in the same order."""

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
        """The numbers of each target."""
        nq, nv, frames, contacts = self._sizes
        sizes = [ComTarget.SIZE, MomentumTarget.SIZE, nq + 2 * nv]
        sizes += [FrameTarget.SIZE] * frames + [ContactTarget.SIZE] * contacts
        yield from np.split(self._numbers, np.cumsum(sizes)[:-1])

    def copy(self) -> "References":
        """References with the same numbers, which do not change with these."""
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


# where users find them, and pickle too
for _class in [_item for _item in globals().values() if isinstance(_item, type) and _item.__module__ == __name__]:
    _class.__module__ = "condyle.wholebody"
