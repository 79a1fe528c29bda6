"""Parts and properties of robot models."""

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, NoReturn, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from typing_extensions import Self

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
