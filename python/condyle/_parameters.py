"""Parameters of a problem in `ProblemLayer`: how each is set, and the gradient with respect to it."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ._condyle import Model, Problem, ProblemError, difference, integrate, random_configuration
from ._coordinates import Coordinates

_Array = NDArray[np.float64]
_Shape = tuple[int, ...]


class States:
    """The maps between gradients of nx numbers and gradients in the tangent space, for states and targets.

    robot: the robot whose position is the first part of a state; None if states are vectors.
    """

    def __init__(self, problem: Problem, robot: Model | None) -> None:
        if robot is not None and not isinstance(robot, Model):
            raise TypeError(f"robot: expected the Model of the problem's robot, found {type(robot).__name__}")
        self._coordinates = None if robot is None else Coordinates(robot)
        nx, ndx = problem.nx, problem.ndx
        if robot is None:
            if nx != ndx:
                raise ValueError(
                    f"robot: a state has {nx} numbers and {ndx} in the tangent space, expected the robot's Model"
                )
        elif nx - ndx != robot.nq - robot.nv or nx < robot.nq + robot.nv:
            raise ValueError(
                f"robot: expected the robot of the problem, whose states have {nx} numbers and {ndx} in the tangent "
                f"space, found {robot.name!r} with nq {robot.nq} and nv {robot.nv}"
            )
        elif not _same_space(problem, robot):
            raise ValueError(
                f"robot: expected the robot of the problem, found {robot.name!r}, whose positions have other joints"
            )

    def _split(self, x: _Array, g: _Array, given: int) -> tuple[_Array, _Array, tuple[int, ...]]:
        """Returns x and g with one row a state, and the shape of g without its last axis."""
        rows = int(np.prod(x.shape[:-1]))
        return x.reshape(rows, x.shape[-1]), g.reshape(rows, given), g.shape[:-1]

    def normalized(self, x: _Array) -> _Array:
        """Returns the states with quaternions and pairs (cos, sin) of length 1."""
        if (c := self._coordinates) is None or c.flat or x.shape[-1] < c.nq:
            return x
        result = x.copy()
        result[..., : c.nq] = c.normalized(x[..., : c.nq].reshape(-1, c.nq)).reshape(x[..., : c.nq].shape)
        return result

    def pull(self, x: _Array, g: _Array) -> _Array:
        """Returns Pᵀ g, gradients with the shape of x, for gradients g in the tangent space at x."""
        if (c := self._coordinates) is None or x.shape[-1] == g.shape[-1]:
            return g
        states, slopes, shape = self._split(x, g, g.shape[-1])
        first = c.pull(states[:, : c.nq], slopes[:, : c.nv])
        return np.hstack([first, slopes[:, c.nv :]]).reshape(*shape, x.shape[-1])

    def drop(self, x: _Array, g: _Array) -> _Array:
        """Returns Tᵀ g, gradients in the tangent space at x, for gradients g with the shape of x."""
        if (c := self._coordinates) is None or c.flat:
            return g
        states, slopes, shape = self._split(x, g, g.shape[-1])
        first = c.drop(states[:, : c.nq], slopes[:, : c.nq])
        return np.hstack([first, slopes[:, c.nq :]]).reshape(*shape, -1)


def _same_space(problem: Problem, robot: Model) -> bool:
    """Returns whether the problem interpolates states as positions and velocities of this robot, in a random example.

    Problems whose states are no robot's do not interpolate, and are accepted.
    """
    q0, q1 = (random_configuration(robot, seed=seed) for seed in (1, 2))
    rest = np.zeros(problem.nx - robot.nq)
    try:
        found = problem._between(np.r_[q0, rest], np.r_[q1, rest], 0.3)
    except ProblemError:
        return True
    expected = integrate(robot, q0, 0.3 * difference(robot, q0, q1))
    return bool(np.allclose(found[: robot.nq], expected, rtol=1e-9, atol=1e-9))


def _rotated(R: _Array, g: _Array) -> _Array:
    """Returns ½ R [g]ₓ: the matrix G with ⟨G, R [δ]ₓ⟩ = gᵀδ, for rotations (*batch, 3, 3) and g (*batch, 3)."""
    cross = np.zeros((*g.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., k, j], cross[..., j, k] = g[..., i], -g[..., i]
    product: _Array = 0.5 * R @ cross
    return product


NUMBERS = ("bounds", "friction", "inertia", "gravity", "armature")
"""Kinds of parameters that are numbers of all knots or of the robot, set by `Problem.set_parameter`."""


class Parameter:
    """One parameter of a problem: how it is set, and the gradient with respect to it.

    name: a name in `Problem.parameters()` or in `own`;
    by_knot: whether each knot has its own value; own: the nominal values of parameters of one's own.
    """

    def __init__(
        self, problem: Problem, name: str, by_knot: bool, states: States, own: Mapping[str, _Array] | None = None
    ) -> None:
        self.name, self.by_knot, self._states = name, by_knot, states
        self._knots = problem.horizon + 1
        kind, _, self._of = name.partition("/")
        self._kind = kind
        self.own = own is not None and name in own
        self._timed: list[int] = []
        shape: _Shape
        if own is not None and name in own:
            if by_knot:
                raise ValueError(f"by_knot: expected no name in own, found {name!r}")
            shape = own[name].shape
        elif kind in ("x0", "duration") and not self._of and not (kind == "x0" and by_knot):
            shape = (problem.nx,) if kind == "x0" else ()
            self._timed = _timed(problem) if kind == "duration" else []
        elif kind == "target" and self._of:
            shape = problem.references(self._of).shape[1:]
        elif kind == "weight" and self._of:
            problem.set_weight(self._of, 1.0)  # an error if the cost does not exist; each call sets the weight
            shape = ()
        elif kind == "entry_weights" and self._of:
            shape = (_entries(problem, self._of),)  # each call sets the weights
        elif kind == "contact" and self._of and not by_knot:
            problem.set_contact(self._of)  # an error if the contact does not exist
            shape = (4, 4)
        elif kind in NUMBERS and not by_knot and name in (sizes := problem.parameters()):
            shape = () if kind == "friction" else (sizes[name],)
        else:
            if by_knot:
                raise ValueError(
                    "by_knot: expected 'target/NAME', 'weight/NAME' or 'entry_weights/NAME' of a cost, or 'duration', "
                    f"found {name!r}"
                )
            known = ", ".join(map(repr, problem.parameters()))
            raise ValueError(f"parameters: expected {known}, or a name in own, found {name!r}")
        self.shape: _Shape = (self._knots, *shape) if by_knot else shape
        """The shape of one value."""

    def set(self, problem: Problem, value: _Array) -> None:
        """Sets the parameter of the problem. Parameters of one's own are set by the function that makes problems."""
        if self._kind == "x0":
            problem.set_x0(self._states.normalized(value))
        elif self._kind == "weight":
            problem.set_weight(self._of, value if self.by_knot else float(value))
        elif self._kind == "contact":
            problem.set_contact(self._of, placement=value)
        elif self._kind in NUMBERS:
            problem.set_parameter(self.name, np.atleast_1d(value))
        elif self._kind == "duration":
            for t in self._timed:
                problem.set_duration(t, float(value[t] if self.by_knot else value))
        else:
            rows = value if self.by_knot else np.tile(value, (self._knots, *(1,) * value.ndim))
            if self._kind == "entry_weights":
                problem.set_entry_weights(self._of, rows)
            else:
                problem.set_references(self._of, rows if rows.ndim == 3 else self._states.normalized(rows))

    def slope(self, g: _Array, value: _Array) -> _Array:
        """Returns the gradient of the loss with the shape of the value, for its gradient g in the tangent space."""
        if self.own or self._kind in ("weight", "duration", *NUMBERS):
            return np.asarray(g).reshape(value.shape)
        matrix = value.shape[-2:] if value.ndim - self.by_knot == 2 else ()
        if matrix == (3, 3):
            return _rotated(value, g)
        if matrix == (4, 4):  # M exp(δ) = (R exp(ω), p + R v + …), linear part first
            R, result = value[..., :3, :3], np.zeros(value.shape)
            result[..., :3, 3] = (R @ g[..., :3, None])[..., 0]
            result[..., :3, :3] = _rotated(R, g[..., 3:])
            return result
        pulled = self._states.pull(value, g)
        if pulled.shape != value.shape:
            raise ValueError(
                f"{self.name}: its gradient has {g.shape[-1]} numbers, expected the robot's Model as robot"
            )
        return pulled


def _timed(problem: Problem) -> list[int]:
    """Returns the knots that have a duration. Changes their durations; each call of the layer sets them."""
    timed = []
    for t in range(problem.horizon):
        try:
            problem.set_duration(t, 1.0)
        except ProblemError:  # an impact, or an action without duration
            continue
        timed.append(t)
    if not timed:
        raise ValueError("parameters: 'duration' needs knots of a robot that have a duration")
    return timed


def _entries(problem: Problem, cost: str) -> int:
    """Returns the number of entry weights of a cost. Raises KeyError if the cost does not exist, and ValueError if its
    activation has no weights.
    """
    sizes = problem.parameters()
    if (size := sizes.get(f"entry_weights/{cost}")) is None:
        if f"weight/{cost}" not in sizes:
            problem.set_weight(cost, 1.0)  # KeyError: the cost does not exist
        raise ValueError(f"parameters: 'entry_weights/{cost}' needs a cost with weights of entries")
    return size
