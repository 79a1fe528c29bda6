"""The class `ProblemLayer` that `condyle.torch` and `condyle.jax` have in common: solutions and adjoints, row by row.

A row is one problem of a batch, with the parameters p and the solution w(p) = (x, u). Let l be the gradient of a loss L
with respect to w. Then dL/dp = lᵀ dw/dp comes from the adjoint method of `Sensitivity`. This method solves M a = l with
the factors of M, which all parameters share.
"""

import threading
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Fddp, Model, Problem, ProblemError, Sensitivity
from ._coordinates import Coordinates

_Array = NDArray[np.float64]
_Shape = tuple[int | None, ...]

TIGHT: Mapping[str, Any] = {"max_iterations": 300, "tolerance": 1e-20, "flat": 1e-6}
"""Default settings of a solver: the error of a derivative is proportional to the error of the solution."""
BOUNDED: Mapping[str, Any] = {"tolerance_bounded": 1e-20, "second_order": True, "regularisation_start": 1e-3}
"""Further settings, of `Fddp` only. The regularisation saves a fifth of the iterations from a warm start with active
bounds, and changes the number of iterations without bounds by 2 % (arms with 8 and 50 knots).
"""
FIRST: Mapping[str, Any] = {"tolerance": 1e-9, "tolerance_bounded": 5e-5, "second_order": False}
"""Settings of the first phase far from a solution, where the curvature of the dynamics can make a step fail."""
KEPT: Mapping[str, Any] = {
    "tolerance": 1.0,
    "tolerance_bounded": 1.0,
    "regularisation_start": 1e8,
    "regularisation_max": 1e30,
}
"""Settings with which `Fddp` keeps a solution from which it starts: two iterations move it by 1e-10.

The first iteration of a solve ignores bounds. Without the high regularisation, its step is rejected several times.
"""


class States:
    """The maps between gradients of nx numbers and gradients in the tangent space, for states and targets.

    robot: the robot whose position is the first part of a state; None if states are vectors.
    """

    def __init__(self, problem: Problem, robot: Model | None) -> None:
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


def _rotated(R: _Array, g: _Array) -> _Array:
    """Returns ½ R [g]ₓ: the matrix G with ⟨G, R [δ]ₓ⟩ = gᵀδ, for rotations (*batch, 3, 3) and g (*batch, 3)."""
    cross = np.zeros((*g.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        cross[..., k, j], cross[..., j, k] = g[..., i], -g[..., i]
    product: _Array = 0.5 * R @ cross
    return product


class Parameter:
    """One parameter of a problem: how it is set, and the gradient with respect to it.

    name: "x0", "target/NAME", "weight/NAME" or "entry_weights/NAME"; by_knot: whether each knot has its own value.
    """

    def __init__(self, problem: Problem, name: str, by_knot: bool, states: States) -> None:
        self.name, self.by_knot, self._states = name, by_knot, states
        self._knots = problem.horizon + 1
        kind, _, self._cost = name.partition("/")
        self._kind = kind
        shape: _Shape
        if name == "x0" and not by_knot:
            shape = (problem.nx,)
        elif kind == "target" and self._cost:
            shape = problem.references(self._cost).shape[1:]
        elif kind == "weight" and self._cost:
            shape = ()
        elif kind == "entry_weights" and self._cost:
            shape = (None,)
        else:
            raise ValueError(
                "parameters: expected 'x0' (not by knot), 'target/NAME', 'weight/NAME' or 'entry_weights/NAME' of the "
                f"cost NAME, found {name!r}{' by knot' if by_knot else ''}"
            )
        self.shape: _Shape = (self._knots, *shape) if by_knot else shape
        """The shape of one value; None for a size that the cost alone knows."""

    def set(self, problem: Problem, value: _Array) -> None:
        """Sets the parameter of the problem."""
        if self._kind == "x0":
            problem.set_x0(self._states.normalized(value))
        elif self._kind == "weight":
            problem.set_weight(self._cost, value if self.by_knot else float(value))
        else:
            rows = value if self.by_knot else np.tile(value, (self._knots, *(1,) * value.ndim))
            if self._kind == "entry_weights":
                problem.set_entry_weights(self._cost, rows)
            else:
                problem.set_references(self._cost, rows if rows.ndim == 3 else self._states.normalized(rows))

    def slope(self, sensitivity: Any, value: _Array, by_xs: _Array, by_us: Any) -> _Array:
        """Returns the gradient of the loss with the shape of the value."""
        g = sensitivity.gradient(self.name, by_xs, by_us, by_knot=self.by_knot)
        if self._kind == "weight":
            return np.asarray(g).reshape(value.shape)
        matrix = value.shape[-2:] if self._kind == "target" and value.ndim - self.by_knot == 2 else ()
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


class _Failure(NamedTuple):
    """The reason why a row has no solution or no derivatives."""

    reason: str


class Solves:
    """Solutions of one problem for many values of its parameters, and adjoints at them, in float64. Rows are flat."""

    def __init__(
        self, problem: Problem, parameters: Sequence[Parameter], states: States, solver: Any, curvature: Any, start: Any
    ) -> None:
        self.problem, self.parameters, self.states, self.solver = problem, parameters, states, solver
        self.curvature, self._start = curvature, start
        self._kept = KEPT if isinstance(solver, Fddp) else {}
        self._settings = {k: v for k, v in solver.settings.items() if k in {**FIRST, **self._kept} and self._kept}
        us = problem.quasi_static(np.tile(problem.x0, (problem.horizon + 1, 1))) if start is None else start[1]
        self._sizes = [len(u) for u in us]
        self.nu = max(self._sizes, default=0)
        self._lock = threading.Lock()
        self._warm: dict[Hashable, tuple[_Array, Any]] = {}
        self._solved: dict[bytes, tuple[_Array, Any]] = {}
        self._at: bytes | None = None  # the row whose solution the solver has
        self._sensitivity: Any = None
        self.statuses: list[str] = []
        self.iterations: list[int] = []
        self.reports: list[Any] = []

    def forget(self) -> None:
        with self._lock:
            self._warm.clear()

    def _padded(self, us: Any) -> _Array:
        result = np.zeros((len(self._sizes), self.nu))
        for row, u in zip(result, us, strict=True):
            row[: len(u)] = u
        return result

    def _cut(self, us: _Array) -> Any:
        if all(n == self.nu for n in self._sizes):
            return us
        return [u[:n].copy() for u, n in zip(us, self._sizes, strict=True)]

    def _set(self, values: Sequence[_Array]) -> None:
        self._at = self._sensitivity = None
        for parameter, value in zip(self.parameters, values, strict=True):
            parameter.set(self.problem, value)

    @contextmanager
    def _with(self, settings: Mapping[str, Any]) -> Iterator[None]:
        """Changes settings during the block."""
        self.solver.configure(**settings)
        try:
            yield
        finally:
            self.solver.configure(**self._settings)

    def _from_cold(self) -> tuple[Any, int]:
        if self._start is None:
            xs = np.tile(self.problem.x0, (self.problem.horizon + 1, 1))
            us = self.problem.quasi_static(xs)
        else:
            xs, us = self._start
        first = 0
        if self._settings.get("second_order"):
            with self._with(FIRST):
                near = self.solver.solve(xs, us)
            xs, us, first = near.xs, near.us, len(near.trace)
        solution = self.solver.solve(xs, us)
        return solution, first + len(solution.trace)

    def _solve(self, values: Sequence[_Array], key: Hashable) -> tuple[Any, int]:
        """Returns the solution of a row and the number of iterations, with the status of the last attempt."""
        self._set(values)
        spent = 0
        if key in self._warm:
            solution = self.solver.solve(*self._warm[key])
            spent = len(solution.trace)
            if solution.status == "converged":
                return solution, spent
        solution, more = self._from_cold()
        return solution, spent + more

    @staticmethod
    def _name(values: Sequence[_Array], xs: Any, us: Any, kind: Any) -> bytes:
        parts = [*values, np.asarray(xs, kind), np.asarray(us, kind)]
        return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)

    def solve(self, arrays: Sequence[_Array], keys: Sequence[Hashable], kind: Any) -> tuple[_Array, _Array, list[Any]]:
        """Returns states (rows, N + 1, nx), controls (rows, N, nu) and failures by row, None if the row converged.

        arrays: values of the parameters, one row each; keys: names of the rows' warm starts; kind: the type of numbers
        to which the caller rounds results.
        """
        n, p = len(keys), self.problem
        xs, us = np.full((n, p.horizon + 1, p.nx), np.nan), np.full((n, p.horizon, self.nu), np.nan)
        failures: list[Any] = [None] * n
        with self._lock:
            self.statuses, self.iterations, self._solved = [], [], {}
            for i, key in enumerate(keys):
                values = [array[i] for array in arrays]
                try:
                    solution, iterations = self._solve(values, key)
                except ProblemError as error:
                    failures[i] = _Failure(str(error))
                    self.statuses.append("error")
                    self.iterations.append(0)
                    continue
                self.statuses.append(solution.status)
                self.iterations.append(iterations)
                if solution.status != "converged":
                    failures[i] = _Failure(f"the solve ended with {solution.status!r}, expected 'converged'")
                    continue
                xs[i], us[i] = solution.xs, self._padded(solution.us)
                self._warm[key] = (solution.xs, solution.us)
                self._at = self._name(values, xs[i], us[i], kind)
                self._solved[self._at] = self._warm[key]
        return xs, us, failures

    def _linearise(self, name: bytes, values: Sequence[_Array], xs: _Array, us: _Array) -> Any:
        """Returns the `Sensitivity` at the solution of a row."""
        if self._at != name:
            self._set(values)
            known = self._solved.get(name)
            if known is not None:
                with self._with(self._kept):
                    solution = self.solver.solve(*known)
            if known is None or solution.status != "converged":  # a rounded solution of an earlier call
                solution = self.solver.solve(*(known or (xs, self._cut(us))))
            if solution.status != "converged":
                raise ProblemError(f"the solve ended with {solution.status!r}, expected 'converged'")
            self._at = name
        if self._sensitivity is None:
            self._sensitivity = Sensitivity(self.solver, curvature=self.curvature)
        return self._sensitivity

    def pull(
        self,
        arrays: Sequence[_Array],
        solution: tuple[Any, Any],
        slopes: tuple[Any, Any],
        needed: Sequence[bool],
    ) -> tuple[list[_Array], list[Any]]:
        """Returns the gradients with respect to the parameters, one row each, and failures by row.

        arrays: as for `solve`; solution: states and controls as the caller has rounded them; slopes: the gradients of
        the loss with respect to both; needed: whether a parameter's gradient is needed.
        """
        kind = solution[0].dtype
        xs, us, by_xs, by_us = (np.asarray(a, np.float64) for a in (*solution, *slopes))
        results = [np.zeros(a.shape) for a in arrays]
        failures: list[Any] = [None] * len(xs)
        rows: dict[bytes, list[int]] = {}
        with self._lock:
            self.reports = [None] * len(xs)
            for i in range(len(xs)):
                if by_xs[i].any() or by_us[i].any():  # NaN counts as a number other than 0
                    name = self._name([a[i] for a in arrays], xs[i], us[i], kind)
                    rows.setdefault(name, []).append(i)
            for name in sorted(rows, key=lambda name: name != self._at):
                values = [a[rows[name][0]] for a in arrays]
                first = rows[name][0]
                for i in rows[name]:
                    try:
                        if not all(np.isfinite(a).all() for a in (xs[i], us[i], by_xs[i], by_us[i])):
                            raise ProblemError("its solution, or the gradient of the loss, is not finite")
                        sensitivity = self._linearise(name, values, xs[first], us[first])
                        self.reports[i] = sensitivity.report
                        along = self.states.drop(xs[i], by_xs[i]), self._cut(by_us[i])
                        for k, parameter in enumerate(self.parameters):
                            if needed[k]:
                                results[k][i] = parameter.slope(sensitivity, values[k], *along)
                    except ProblemError as error:
                        failures[i] = _Failure(str(error))
                        for result in results:
                            result[i] = np.nan
        return results, failures


class ProblemLayer(ABC):
    """A problem's solution as a differentiable function of its parameters."""

    def __init__(
        self,
        problem: Problem,
        parameters: Sequence[str],
        *,
        by_knot: Sequence[str] = (),
        robot: Model | None = None,
        solver: Any = None,
        start: tuple[Any, Any] | None = None,
        curvature: Literal["exact", "dynamics", "gauss_newton"] = "exact",
        on_failure: Literal["raise", "nan"] = "raise",
        **settings: Any,
    ) -> None:
        names = [parameters] if isinstance(parameters, str) else list(parameters)
        if len(set(names)) < len(names) or not names:
            raise ValueError(f"parameters: expected different names, at least one, found {names}")
        if unknown := set(by_knot) - set(names):
            raise ValueError(f"by_knot: expected names in parameters, found {sorted(unknown)}")
        if on_failure not in ("raise", "nan"):
            raise ValueError(f"on_failure: expected 'raise' or 'nan', found {on_failure!r}")
        if curvature not in ("exact", "dynamics", "gauss_newton"):
            raise ValueError(f"curvature: expected 'exact', 'dynamics' or 'gauss_newton', found {curvature!r}")
        states = States(problem, robot)
        kind = Fddp if solver is None else solver
        tight = {**TIGHT, **BOUNDED} if kind is Fddp else {"max_iterations": TIGHT["max_iterations"]}
        made = kind(problem, **{**tight, **settings})
        table = [Parameter(problem, name, name in by_knot, states) for name in names]
        self._solves = Solves(problem, table, states, made, curvature, start)
        self._failing = on_failure

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.ProblemLayer of {', '.join(self.parameters)}>"

    @property
    def parameters(self) -> list[str]:
        """The names of the parameters, in the order of a call's arguments."""
        return [parameter.name for parameter in self._solves.parameters]

    @property
    def statuses(self) -> list[str]:
        """The status of each row's solve in the last call; "error" for invalid numbers."""
        return list(self._solves.statuses)

    @property
    def iterations(self) -> list[int]:
        """The number of iterations of each row's solve in the last call."""
        return list(self._solves.iterations)

    @property
    def reports(self) -> list[Any]:
        """The `SensitivityReport` of each row in the last backward pass; None for rows without a gradient.

        `strict_complementarity` is False where the solution has a kink.
        """
        return list(self._solves.reports)

    def forget(self) -> None:
        """Forgets all warm starts, so that the next call solves from `start`."""
        self._solves.forget()

    @abstractmethod
    def _arrays(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        """Returns the arguments as arrays of the framework, with one type of floating-point numbers."""

    @abstractmethod
    def _expand(self, array: Any, shape: tuple[int, ...]) -> Any:
        """Returns an array of the framework, broadcast to a shape."""

    @abstractmethod
    def _apply(self, keys: tuple[Hashable, ...] | None, arrays: Sequence[Any]) -> tuple[Any, Any]:
        """Returns states and controls; the batches of all arrays are equal."""

    def __call__(self, *values: Any, rows: Sequence[Hashable] | None = None) -> tuple[Any, Any]:
        """Solves the problem, and returns states (*batch, N + 1, nx) and controls (*batch, N, nu).

        values: the parameters in the order of `parameters`, each (*batch, *shape) with any batch; batches broadcast.
        rows: names of the batch's problems, one each, such as indices of a data set; None for 0, 1, 2 and so on. A
            problem starts from the last solution with its name.
        """
        table = self._solves.parameters
        if len(values) != len(table):
            raise TypeError(f"expected {len(table)} arguments ({', '.join(self.parameters)}), found {len(values)}")
        arrays = self._arrays(self.parameters, values)
        batches, ends = [], []
        for parameter, array in zip(table, arrays, strict=True):
            found, cut = tuple(array.shape), len(array.shape) - len(parameter.shape)
            if cut < 0 or any(a not in (None, b) for a, b in zip(parameter.shape, found[cut:], strict=True)):
                expected = ", ".join("n" if size is None else str(size) for size in ("...", *parameter.shape))
                raise ValueError(f"{parameter.name}: expected shape ({expected}), found {found}")
            batches.append(found[:cut])
            ends.append(found[cut:])
        try:
            batch = np.broadcast_shapes(*batches)
        except ValueError:
            found_all = ", ".join(f"{p.name} {shape}" for p, shape in zip(table, batches, strict=True))
            raise ValueError(f"expected batches that broadcast, found {found_all}") from None
        if rows is not None and len(rows) != int(np.prod(batch)):
            raise ValueError(f"rows: expected {int(np.prod(batch))} names, one for each problem, found {len(rows)}")
        arrays = [self._expand(array, (*batch, *end)) for array, end in zip(arrays, ends, strict=True)]
        if rows is None:
            return self._apply(None, arrays)
        return self._apply(tuple(row.item() if hasattr(row, "item") else row for row in rows), arrays)

    def _flat(self, arrays: Sequence[Any]) -> tuple[tuple[int, ...], list[_Array]]:
        """Returns the batch, and NumPy arrays in float64 with one row for each problem."""
        parameter = self._solves.parameters[0]
        batch = arrays[0].shape[: arrays[0].ndim - len(parameter.shape)]
        count = int(np.prod(batch))
        return batch, [np.asarray(a, np.float64).reshape(count, *a.shape[len(batch) :]) for a in arrays]

    def _checked(self, batch: tuple[int, ...], failures: Sequence[Any]) -> None:
        if self._failing == "raise":
            for i, failure in enumerate(failures):
                if failure is not None:
                    row = ", ".join(str(int(k)) for k in np.unravel_index(i, batch)) if batch else ""
                    raise ProblemError(f"row {row}: {failure.reason}" if row else failure.reason)

    def _solution(self, keys: tuple[Hashable, ...] | None, arrays: Sequence[Any]) -> tuple[Any, Any]:
        """Returns states and controls for NumPy arrays, in their type of numbers."""
        kind = arrays[0].dtype
        batch, flat = self._flat(arrays)
        count = int(np.prod(batch))
        names = tuple(range(count)) if keys is None or len(keys) != count else keys
        xs, us, failures = self._solves.solve(flat, names, kind)
        self._checked(batch, failures)
        return xs.reshape(*batch, *xs.shape[1:]).astype(kind), us.reshape(*batch, *us.shape[1:]).astype(kind)

    def _slopes(self, arrays: Sequence[Any], given: Sequence[Any], needed: Sequence[bool]) -> list[Any]:
        """Returns gradients for NumPy arrays; given: states, controls, and gradients with respect to both."""
        kind = arrays[0].dtype
        batch, flat = self._flat(arrays)
        xs, us, by_xs, by_us = (np.asarray(a).reshape(len(flat[0]), *a.shape[len(batch) :]) for a in given)
        slopes, failures = self._solves.pull(flat, (xs, us), (by_xs, by_us), needed)
        self._checked(batch, failures)
        return [g.reshape(a.shape).astype(kind) for g, a in zip(slopes, arrays, strict=True)]

    @staticmethod
    def _only_once() -> NotImplementedError:
        return NotImplementedError("ProblemLayer: second derivatives of a solution do not exist; differentiate once")
