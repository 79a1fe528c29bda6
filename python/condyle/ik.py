"""Inverse kinematics: joint velocities and postures for targets of frames.

`DifferentialIk` computes the velocity of one step towards targets, under limits:

>>> import condyle, numpy as np
>>> from condyle.ik import DifferentialIk, GlobalIk, Task
>>> arm = condyle.robots.arm7()
>>> ik = DifferentialIk(arm, [Task.pose("tool"), Task.posture()], dt=0.01)
>>> q = np.full(7, 0.3)
>>> targets = ik.hold(q)
>>> targets.frames[0, 2, 3] -= 0.05  # 5 cm down
>>> step = ik.step(q, targets)
>>> q = condyle.integrate(arm, q, 0.01 * step.v)

`GlobalIk` searches postures for target poses from many starts, for one target or for thousands:

>>> search = GlobalIk(arm, "tool")
>>> pose = condyle.frame_placement(arm, condyle.Data(arm), [0.5, 0.4, -0.3, 1.0, 0.2, 0.7, 0.1], "tool")
>>> answer = search.solve(pose)
>>> answer.reached
True

Pairs of geometries of `condyle.distances` keep a robot away from itself and from obstacles.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Model, _DifferentialIk, _GlobalIk
from .distances import DistanceLimits, GeometryPair, _geometry

__all__ = [
    "DifferentialIk",
    "DistanceLimits",
    "GlobalIk",
    "JointLimits",
    "Posture",
    "Postures",
    "Step",
    "Targets",
    "Task",
]

_Array: TypeAlias = NDArray[np.float64]
_Held: TypeAlias = tuple[tuple[str, int], ...]


class Task(NamedTuple):
    """A quantity to be controlled, with the error e and its Jacobian J. One step asks for J Δq = α e:

        ½ Σ w f (J Δq − α e)²  +  ½ μ Σ w f (α e)² ‖Δq‖²

    Use a constructor: `pose`, `position`, `orientation`, `relative_pose`, `com`, `posture`, `rest`, `manipulability`
    or `coupling`. Tasks of priority 0 come first. Tasks of priority 1 only use the freedom that tasks of priority 0
    leave, and so on. Within a priority, only the ratios of the weights matter. `DifferentialIk` checks the numbers.

    >>> from condyle.ik import Task
    >>> Task.pose("tool", factors=[1, 1, 1, 0, 0, 0.1]).kind
    'pose'
    """

    kind: str
    """The name of the constructor that made the task; 'pose' also for a relative pose."""
    frame: str | None = None
    """The frame that the task moves; None for a task without a frame."""
    weight: float = 1.0
    """The weight w, at least 0."""
    factors: ArrayLike | None = None
    """The factors f of the weight, one for each number of the task; None for all 1. A factor 0 turns a number off."""
    gain: float = 1.0
    """The gain α, from 0 to 1: the fraction of the error that one step removes."""
    damping: float = 0.0
    """The Levenberg–Marquardt damping μ, at least 0. It makes steps smaller as long as the error is large."""
    root: str | None = None
    """The frame relative to which pose, position or rotation are measured; None for the world."""
    priority: int = 0
    """The priority; 0 is the first, at most 2."""
    joints: tuple[tuple[str, float], ...] = ()
    """The coupled joints with their ratios, for `coupling`."""
    offset: float = 0.0
    """The right side of a `coupling` (rad, m)."""

    @classmethod
    def pose(cls, frame: str, **options: Any) -> "Task":
        """Returns a task for a frame's pose, weight 1: 6 numbers, the logarithm of the target in the frame, linear part
        first.

        options: members of the task, by name, such as `weight=2.0`.
        """
        return cls("pose", frame, **options)

    @classmethod
    def position(cls, frame: str, **options: Any) -> "Task":
        """Returns a task for a frame's origin, weight 1: 3 numbers along the axes of the world or of the root."""
        return cls("position", frame, **options)

    @classmethod
    def orientation(cls, frame: str, **options: Any) -> "Task":
        """Returns a task for a frame's rotation, weight 1: 3 numbers along the axes of the frame."""
        return cls("orientation", frame, **options)

    @classmethod
    def relative_pose(cls, frame: str, root: str, **options: Any) -> "Task":
        """Returns a task for the pose of a frame relative to another frame, `root`, weight 1."""
        return cls("pose", frame, root=root, **options)

    @classmethod
    def com(cls, **options: Any) -> "Task":
        """Returns a task for the centre of mass, weight 1: 3 numbers along the axes of the world."""
        return cls("com", **options)

    @classmethod
    def posture(cls, **options: Any) -> "Task":
        """Returns a task for all joints except free-flyers, weight 1e-6: nv numbers."""
        return cls("posture", **{"weight": 1e-6, **options})

    @classmethod
    def rest(cls, **options: Any) -> "Task":
        """Returns a task that makes the velocities of all joints except free-flyers small, weight 1e-6."""
        return cls("rest", **{"weight": 1e-6, **options})

    @classmethod
    def manipulability(cls, frame: str, **options: Any) -> "Task":
        """Returns a task that raises the manipulability √det(J Jᵀ) of a frame, weight 1e-6 and gain 0.1."""
        return cls("manipulability", frame, **{"weight": 1e-6, "gain": 0.1, **options})

    @classmethod
    def coupling(cls, joints: Iterable[tuple[str, float]], offset: float = 0.0, **options: Any) -> "Task":
        """Returns a task that couples joints with one coordinate, Σ ratio · q = offset, weight 1.

        joints: names of joints, with their ratios.
        """
        return cls("coupling", joints=tuple((name, float(ratio)) for name, ratio in joints), offset=offset, **options)


class JointLimits(NamedTuple):
    """Limits of joints, as bounds on the displacement Δq of one step of duration T.

        −T v_max ≤ Δq ≤ T v_max                                     velocity
        g (q_min − q) ≤ Δq ≤ g (q_max − q)                          position
        |Δq − T v₀| ≤ T² a_max,  Δq + Δq² / (2 a_max T²) ≤ q_max − q    acceleration

    If these bounds exclude each other, velocity comes first, then position, then acceleration. So a joint beyond its
    limit returns with at most its maximum velocity.
    """

    gain: float = 0.5
    """The fraction g of the distance to a position limit that one step may use; above 0, at most 1."""
    lower: ArrayLike | None = None
    """The minimum position, nq numbers; None for the limits of the model."""
    upper: ArrayLike | None = None
    """The maximum position, nq numbers; None for the limits of the model."""
    velocity: ArrayLike | None = None
    """The maximum velocity v_max, nv numbers; None for the limits of the model."""
    acceleration: ArrayLike | None = None
    """The maximum acceleration a_max, nv numbers; None for no limits."""


class Targets:
    """The targets of the tasks in one step. `DifferentialIk.hold` makes targets that keep the present values.

    The arrays can be changed in place.
    """

    __slots__ = ("com", "frames", "posture")
    frames: _Array
    """The poses (n, 4, 4) of the frames, in the world or in the task's root. There is one for each task for a pose, a
    position or an orientation, in the order of the tasks."""
    com: _Array
    """The position of the centre of mass (m)."""
    posture: _Array
    """The posture, nq numbers."""

    def __init__(self, frames: ArrayLike, com: ArrayLike, posture: ArrayLike) -> None:
        self.frames = np.array(frames, dtype=float)
        self.com = np.array(com, dtype=float)
        self.posture = np.array(posture, dtype=float)

    def copy(self) -> "Targets":
        """Returns independent targets with the same numbers."""
        return Targets(self.frames, self.com, self.posture)

    def __reduce__(self) -> tuple[Any, ...]:
        return Targets, (self.frames, self.com, self.posture)

    def __repr__(self) -> str:
        return f"<condyle.ik.Targets of {len(self.frames)} frames>"


class Step(NamedTuple):
    """The velocity of one step, with the errors of the tasks before the step."""

    v: _Array
    """The velocity v, nv numbers (rad/s, m/s). The position q ⊕ T v is within the limits if q is."""
    status: Literal["solved", "relaxed", "stopped"]
    """Result of the step.

    - 'solved': the velocity is the solution for all priorities;
    - 'relaxed': pairs that are too near move apart slower than their limit asks;
    - 'stopped': a priority was not solved for numerical reasons, and the velocity solves the priorities before it.
    """
    errors: _Array
    """The errors of the tasks before the step (tasks, 2): linear and angular part (m, rad). Errors of postures and
    couplings are in the second part."""
    held: _Held
    """The limits that hold the step back: ('lower', coordinate), ('upper', coordinate) or ('pair', index).
    `DifferentialIk.describe` names them."""


class Posture(NamedTuple):
    """The answer of a search for one target."""

    q: _Array
    """The position, nq numbers. Limits of the joints always hold."""
    reached: bool
    """Whether the target is reached within the tolerance, with all pairs far enough apart."""
    error: _Array
    """The largest position error (m) and the largest rotation error (rad) of the frames."""
    starts: int
    """The number of starts that were needed."""
    held: tuple[str, ...]
    """The limits of joints and the pairs that hold back a posture that does not reach its target, in words."""


class Postures(NamedTuple):
    """The answers of a search for n targets."""

    q: _Array
    """The positions (n, nq)."""
    reached: NDArray[np.bool_]
    """Whether each target is reached (n,)."""
    error: _Array
    """The errors (n, 2): position (m) and rotation (rad)."""
    starts: NDArray[np.int64]
    """The number of starts of each target (n,)."""
    held: list[tuple[str, ...]]
    """The limits and pairs that hold back each posture that does not reach its target, in words."""


def _encoded(model: Model, pairs: Iterable[GeometryPair]) -> str:
    """Returns pairs in JSON."""
    import json

    return json.dumps([{"first": _geometry(model, a), "second": _geometry(model, b)} for a, b in pairs])


def _placed(done: bool, name: str) -> None:
    if not done:
        raise ValueError(f"name: no geometry is named {name!r}")


class DifferentialIk:
    """Differential inverse kinematics: the velocity of one step towards targets, under limits.

        minimise     ½ Σ w f (J Δq − α e)²  +  ½ μ Σ w f (α e)² ‖Δq‖²  +  ½ ε ‖Δq‖²
        subject to   limits of positions, velocities and accelerations: `JointLimits`
                     limits of distances: ∂d/∂q Δq + T ∂d/∂t ≥ −min(T / T_look, 1) (d − d_min)

    model: the robot; tasks: a list of `Task`.
    dt: the duration T of a step (s).
    damping: the weight ε, above 0; it determines the motion that the tasks leave open.
    limits: `JointLimits`, or None for no limits.
    distances: `DistanceLimits`, or None for no limits.

    Raises `ModelError` for an unknown frame or joint, and `ValueError` for a number outside its range.

    >>> from condyle.ik import DifferentialIk, Task
    >>> arm = condyle.robots.arm7()
    >>> ik = DifferentialIk(arm, [Task.position("tool"), Task.posture()])
    >>> targets = ik.hold(np.full(7, 0.3))
    >>> targets.frames[0, :3, 3] += [0.0, 0.1, 0.05]
    >>> q, steps, errors = ik.converge(np.full(7, 0.3), targets)
    >>> bool(errors[0, 0] < 1e-4)
    True
    """

    def __init__(
        self,
        model: Model,
        tasks: Sequence[Task],
        *,
        dt: float = 0.01,
        damping: float = 1e-8,
        limits: JointLimits | None = JointLimits(),  # noqa: B008 - a named tuple never changes
        distances: DistanceLimits | None = None,
    ) -> None:
        self.model = model
        """The robot."""
        self.tasks = tuple(tasks)
        """The tasks."""
        given = None
        if distances is not None:
            pairs, minimum, look_ahead, largest, reach = distances
            given = (_encoded(model, pairs), float(minimum), float(look_ahead), float(largest), float(reach))
        self._inner = _DifferentialIk(model, list(self.tasks), dt, damping, limits, given)

    def hold(self, q: ArrayLike) -> Targets:
        """Returns `Targets` that keep the present values of all tasks at a position.

        q: position, nq numbers.
        """
        return Targets(*self._inner._hold(q))

    def step(self, q: ArrayLike, targets: Targets, v0: ArrayLike | None = None) -> Step:
        """Computes the velocity of one step, as a `Step`.

        q: position, nq numbers.
        v0: the velocity of the step before, nv numbers, which only limits of acceleration read; None for 0.

        Raises `ValueError` and `ModelError` for numbers that are not finite and for rotations that are not valid; the
        message names them.
        """
        v, status, errors, held = self._inner._step(q, v0, targets.frames, targets.com, targets.posture)
        return Step(v, status, errors, tuple(held))

    def converge(
        self,
        q: ArrayLike,
        targets: Targets,
        tolerance: tuple[float, float] = (1e-4, 1e-3),
        steps: int = 1000,
    ) -> tuple[_Array, int, _Array]:
        """Makes steps until the errors of all tasks of priority 0, except postures, are within a tolerance.

        q: position, nq numbers; tolerance: largest linear and angular error (m, rad); steps: the largest number of
        steps.

        Returns the last position, the number of steps, and the errors (tasks, 2) there.
        """
        given = (targets.frames, targets.com, targets.posture)
        return self._inner._converge(q, *given, [float(x) for x in tolerance], steps)

    def describe(self, held: tuple[str, int]) -> str:
        """Returns a limit of `Step.held` in words."""
        return self._inner._describe(*held)

    @property
    def nearest(self) -> tuple[int, float] | None:
        """The index of the nearest pair before the last step and its distance (m); None without pairs. Beyond the range
        of the limits, the distance is a lower bound."""
        return self._inner._nearest()

    def place(self, name: str, placement: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Sets the placement of the geometry with a name, for example of a moving obstacle.

        placement: the pose (4, 4) in the world, or in the frame of the geometry.
        velocity: the velocity of an obstacle in the world, [linear, angular], six numbers along the world's axes: the
            velocity of the origin of its placement (m/s), and its angular velocity (rad/s); None for an obstacle at
            rest. Limits of distances take into account how the obstacle moves in the next step.

        Raises `ValueError` if no geometry has this name, or if a number is not finite.
        """
        _placed(self._inner._place(name, placement, velocity), name)


class GlobalIk:
    """Global inverse kinematics: postures for target poses of one or several frames, from many starts.

    Each start is a Levenberg–Marquardt descent with the limits of the joints. A start that reaches its target with a
    pair that is too near goes on, and pushes the pairs apart. The first two starts of a target do so only with the rank
    'nearest', because the next start is cheaper in most cases. Several starts run at once in SIMD lanes.
    The starts of a target are: the given posture; the entries of a table of random configurations that are nearest to
    the target; random configurations. The answers depend neither on the number of threads nor on other targets.

    model: the robot; frames: the name of the frame, or a list of names.
    tolerance: the largest position error (m) and rotation error (rad) of a posture that reaches its target.
    orientation_weight: the weight of squared rotation errors (rad²), relative to squared position errors (m²). With 0,
        only the positions of the targets count.
    starts, iterations: the largest number of starts of a target, and of iterations of a start.
    solutions: the number of postures from which `rank` chooses; a search ends when this number of starts succeeded.
    rank: 'first', 'nearest' (to the given posture) or 'manipulability' (of the first frame).
    table: the number of configurations in the table; seed: the seed of the random configurations.
    threads: the number of threads that share many targets.
    lower, upper: limits of positions, nq numbers; None for the limits of the model.
    pairs: pairs of geometries of `condyle.distances` that must be apart; minimum_distance: by how much (m).

    Raises `ModelError` for an unknown frame, and `ValueError` for a number outside its range.

    >>> from condyle.ik import GlobalIk
    >>> arm = condyle.robots.arm7()
    >>> q = np.array([condyle.random_configuration(arm, seed) for seed in range(100)])
    >>> poses = np.array([condyle.frame_placement(arm, condyle.Data(arm), x, "tool") for x in q])
    >>> answers = GlobalIk(arm, "tool").solve_many(poses)
    >>> int(answers.reached.sum())
    100
    """

    def __init__(
        self,
        model: Model,
        frames: str | Sequence[str],
        *,
        tolerance: tuple[float, float] = (1e-4, 1e-3),
        orientation_weight: float = 0.1,
        starts: int = 100,
        iterations: int = 40,
        solutions: int = 1,
        rank: Literal["first", "nearest", "manipulability"] = "first",
        table: int = 512,
        seed: int = 0,
        threads: int = 1,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        pairs: Sequence[GeometryPair] = (),
        minimum_distance: float = 0.0,
    ) -> None:
        self.model = model
        """The robot."""
        self.frames = (frames,) if isinstance(frames, str) else tuple(frames)
        """The names of the frames."""
        self._inner = _GlobalIk(
            model,
            list(self.frames),
            [float(x) for x in tolerance],
            orientation_weight,
            [starts, iterations, solutions, table, threads],
            rank,
            seed,
            (lower, upper),
            _encoded(model, pairs),
            minimum_distance,
        )

    def solve(self, target: ArrayLike, posture: ArrayLike | None = None) -> Posture:
        """Searches a posture for one target.

        target: the pose (4, 4) of the frame, or the poses (frames, 4, 4) of all frames, in the world.
        posture: the first start, and the posture of the rank 'nearest', nq numbers; None for the neutral position.
        """
        poses = np.asarray(target, dtype=float).reshape(-1, 4, 4)
        if len(poses) != len(self.frames):
            raise ValueError(f"target: expected {len(self.frames)} poses, found {len(poses)}")
        answers = self.solve_many(poses[None], posture)
        reached, starts = bool(answers.reached[0]), int(answers.starts[0])
        return Posture(answers.q[0], reached, answers.error[0], starts, answers.held[0])

    def solve_many(self, targets: ArrayLike, posture: ArrayLike | None = None) -> Postures:
        """Searches a posture for each target. Other Python threads can run meanwhile.

        targets: the poses (n, 4, 4) of the frame, or (n, frames, 4, 4) of all frames, in the world.
        posture: the first start of each target, and the posture of the rank 'nearest', nq numbers; None for the neutral
        position.
        """
        poses = np.asarray(targets, dtype=float)
        count = len(poses)
        shape = (count, len(self.frames), 4, 4)
        if poses.shape != shape and not (len(self.frames) == 1 and poses.shape == (count, 4, 4)):
            raise ValueError(f"targets: expected shape (n, {len(self.frames)}, 4, 4), found {poses.shape}")
        start = _neutral(self.model) if posture is None else posture
        found = self._inner._solve(np.ascontiguousarray(poses.reshape(-1, 4, 4)), count, start)
        q, reached, error, starts, held = found
        words = [tuple(self._inner._describe(*limit) for limit in limits) for limits in held]
        return Postures(q, np.array(reached, dtype=bool), error, np.array(starts, dtype=np.int64), words)

    def place(self, name: str, placement: ArrayLike) -> None:
        """Sets the placement (4, 4) of the geometry with a name, for example of a moving obstacle.

        Raises `ValueError` if no geometry has this name.
        """
        _placed(self._inner._place(name, placement), name)


def _neutral(model: Model) -> _Array:
    from . import neutral

    return neutral(model)
