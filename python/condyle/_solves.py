"""Solutions of one problem for many values of its parameters, and adjoints at them, for `ProblemLayer`.

A row is one problem of a batch, with the parameters p and the solution w(p) = (x, u). Let l be the gradient of a loss L
with respect to w. Then dL/dp = lᵀ dw/dp comes from the adjoint method of `Sensitivity`. This method solves M a = l with
the factors of M, which all parameters share.
"""

import threading
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Fddp, Problem, ProblemError, Sensitivity, _solve_many
from ._parameters import Parameter, States

_Array = NDArray[np.float64]

TIGHT: Mapping[str, Any] = {"max_iterations": 300, "tolerance": 1e-20, "flat": 1e-6}
"""Default settings of a solver: the error of a derivative is proportional to the error of the solution."""
BOUNDED: Mapping[str, Any] = {"tolerance_bounded": 1e-20, "second_order": True, "regularisation_start": 1e-3}
"""Further settings, of `Fddp` only. The regularisation saves a fifth of the iterations from a warm start with active
bounds, and changes the number of iterations without bounds by 2 % (arms with 8 and 50 knots).
"""
FIRST: Mapping[str, Any] = {"tolerance": 1e-9, "tolerance_bounded": 5e-5, "second_order": False}
"""Settings of the first phase far from a solution, where the curvature of the dynamics can make a step fail."""
STEP = 1e-5
"""Step of the differences with respect to a parameter of one's own, relative to its largest entry, or absolute if this
entry is below 1.
"""


class Known(NamedTuple):
    """A solution: states, controls (a list if knots differ in nu), and the gains of all knots in a row."""

    xs: _Array
    us: Any
    K: _Array


class Source(NamedTuple):
    """The problem of a layer, or the function that makes it."""

    problem: Problem
    build: Callable[..., Problem] | None
    own: Mapping[str, _Array]


class Solves:
    """Solutions and adjoints in float64. Rows are flat. One call at a time computes; others wait."""

    def __init__(
        self,
        source: Source,
        parameters: Sequence[Parameter],
        states: States,
        make: Callable[[Problem], Any],
        curvature: Any,
        start: tuple[_Array, Any] | None,
        threads: int,
    ) -> None:
        self.problem, self._build, self._own = source
        self._dimensions = {size: getattr(self.problem, size) for size in ("horizon", "nx", "ndx")}
        self.parameters, self.states, self._make = parameters, states, make
        self.curvature, self._start, self._threads = curvature, start, threads
        self.solver = make(self.problem)
        self._in_lanes = isinstance(self.solver, Fddp) and not {"time_budget", "segments"} & {*self._set_by_user()}
        self._settings = {k: self.solver.settings[k] for k in FIRST if k in self.solver.settings}
        self.sizes = control_sizes(self.problem) if start is None else [len(u) for u in start[1]]
        self.nu = max(self.sizes, default=0)
        horizon, nx = self._dimensions["horizon"], self._dimensions["nx"]
        self.ends = [(horizon + 1, nx), (horizon, self.nu)]
        """The shapes of the states and controls of one problem."""
        self._lock = threading.Lock()
        self.warm: dict[Hashable, tuple[_Array, Any]] = {}
        self._solved: dict[bytes, Known] = {}
        self._made: list[bytes] | None = None  # values of own parameters for which the problem was made
        self._at: bytes | None = None  # the row whose solution the solver has
        self._sensitivity: tuple[bytes, Any] | None = None
        self._defined: set[int] = set()  # parameters of one's own whose derivatives the sensitivity has
        self.statuses: list[str] = []
        self.iterations: list[int] = []
        self.reports: list[Any] = []

    def _set_by_user(self) -> list[str]:
        return [name for name in ("time_budget", "segments") if self.solver.settings.get(name) not in (None, 0, 1)]

    def forget(self) -> None:
        with self._lock:
            self.warm.clear()

    def _padded(self, us: Any) -> _Array:
        result = np.zeros((len(self.sizes), self.nu))
        for row, u in zip(result, us, strict=True):
            row[: len(u)] = u
        return result

    def _cut(self, us: _Array) -> Any:
        if all(n == self.nu for n in self.sizes):
            return us
        return [u[:n].copy() for u, n in zip(us, self.sizes, strict=True)]

    def _split(self, us: _Array) -> Any:
        """Returns the controls of all knots, from one array with all their numbers."""
        if all(n == self.nu for n in self.sizes):
            return us.reshape(len(self.sizes), self.nu)
        return np.split(us, np.cumsum(self.sizes)[:-1])

    def _made_for(self, values: Sequence[_Array], change: tuple[int, _Array] | None = None) -> Problem:
        """Returns a problem that the user's function makes, with these values of all parameters. change: an index of a
        parameter of one's own, and what is added to its value.
        """
        if self._build is None:
            raise AssertionError("the problem has no parameters of one's own")
        own = dict(self._own)
        for k, (parameter, value) in enumerate(zip(self.parameters, values, strict=True)):
            if parameter.own:
                added = value if change is None or change[0] != k else value + change[1].reshape(value.shape)
                own[parameter.name] = added.copy()
        problem = checked(self._build(**own), "problem: expected a function that returns a Problem")
        if problem is self.problem:
            raise ValueError("problem: expected a function that returns a new Problem at each call")
        for size, expected in self._dimensions.items():
            if (found := getattr(problem, size)) != expected:
                raise ValueError(
                    f"problem: expected a function whose problems all have {size} {expected}, found {found}"
                )
        for parameter, value in zip(self.parameters, values, strict=True):
            if not parameter.own:
                parameter.set(problem, value)
        return problem

    def _set(self, values: Sequence[_Array]) -> None:
        """Sets the parameters of the problem, or makes another problem if parameters of one's own differ."""
        self._at = self._sensitivity = None
        if self._build is not None:
            own = [v.tobytes() for p, v in zip(self.parameters, values, strict=True) if p.own]
            if own != self._made:
                self._made = None
                self.problem = self._made_for(values)
                self.solver = self._make(self.problem)
                self._made = own
                return
        for parameter, value in zip(self.parameters, values, strict=True):
            if not parameter.own:
                parameter.set(self.problem, value)

    @contextmanager
    def _with(self, settings: Mapping[str, Any]) -> Iterator[None]:
        """Changes settings of the solver during the block."""
        solver = self.solver
        solver.configure(**settings)
        try:
            yield
        finally:
            solver.configure(**self._settings)

    def _cold(self) -> tuple[Any, Any]:
        """Returns states and controls from which the present problem starts without a warm start."""
        if self._start is not None:
            return self._start
        xs = np.tile(self.problem.x0, (self.problem.horizon + 1, 1))
        return xs, self.problem.quasi_static(xs)

    @property
    def _twice(self) -> bool:
        """Whether a cold start needs a first phase without the curvature of the dynamics."""
        return bool(self._settings.get("second_order"))

    def _solve(self, values: Sequence[_Array], key: Hashable) -> tuple[Any, int]:
        """Returns the solution of a row and the number of iterations, with the status of the last attempt."""
        self._set(values)
        spent = 0
        if key in self.warm:
            solution = self.solver.solve(*self.warm[key])
            spent = len(solution.trace)
            if solution.status == "converged":
                return solution, spent
        xs, us = self._cold()
        if self._twice:
            with self._with(FIRST):
                near = self.solver.solve(xs, us)
            xs, us = near.xs, near.us
            spent += len(near.trace)
        solution = self.solver.solve(xs, us)
        return solution, spent + len(solution.trace)

    @staticmethod
    def _name(values: Sequence[_Array], xs: Any, us: Any, kind: Any) -> bytes:
        parts = [*values, np.asarray(xs, kind), np.asarray(us, kind)]
        return b"".join(np.ascontiguousarray(part).tobytes() for part in parts)

    def solve(self, arrays: Sequence[_Array], keys: Sequence[Hashable], kind: Any) -> tuple[_Array, _Array, list[Any]]:
        """Returns states (rows, N + 1, nx), controls (rows, N, nu) and failures by row, None if the row converged.

        arrays: values of the parameters, one row each; keys: names of the rows' warm starts; kind: the type of numbers
        to which the caller rounds results.
        """
        n = len(keys)
        xs, us = (np.full((n, *end), np.nan) for end in self.ends)
        rows = [[array[i] for array in arrays] for i in range(n)]
        with self._lock:
            self.statuses, self.iterations, self._solved = ["error"] * n, [0] * n, {}
            failures: list[Any] = [None] * n
            for i, found in self._solutions(rows, keys, failures):
                xs[i], us[i] = found.xs, self._padded(found.us)
                self.warm[keys[i]] = (found.xs, found.us)
                self._solved[self._name(rows[i], xs[i], us[i], kind)] = found
            if n == 1 and failures[0] is None:
                self._at = self._name(rows[0], xs[0], us[0], kind)
        return xs, us, failures

    def _solutions(
        self, rows: list[list[_Array]], keys: Sequence[Hashable], failures: list[Any]
    ) -> list[tuple[int, Known]]:
        """Returns index and solution of each row that converges, and writes reasons of failure of the others."""
        if len(rows) > 1 and self._in_lanes:
            try:
                return self._together(rows, keys, failures)
            except _NoCopyError:
                self._in_lanes = False  # for example an action in Python
        found = []
        for i, (values, key) in enumerate(zip(rows, keys, strict=True)):
            try:
                solution, self.iterations[i] = self._solve(values, key)
            except ProblemError as error:
                failures[i] = str(error)
                continue
            self.statuses[i] = solution.status
            if solution.status == "converged":
                found.append((i, Known(solution.xs, solution.us, flat(solution.K))))
            else:
                failures[i] = _unexpected(solution.status)
        return found

    def _together(
        self, rows: list[list[_Array]], keys: Sequence[Hashable], failures: list[Any]
    ) -> list[tuple[int, Known]]:
        """Computes `_solutions` in SIMD lanes: warm starts, then the others in one or two phases."""
        self._at = self._sensitivity = None
        found: dict[int, Known] = {}
        starts: dict[int, tuple[Any, Any]] = {i: self.warm[key] for i, key in enumerate(keys) if key in self.warm}
        found |= self._run(rows, starts, failures)
        cold = {}
        for i in range(len(rows)):
            if i not in found and self.statuses[i] != "time_limit":
                try:
                    self._set(rows[i])
                    cold[i] = self._cold()
                except ProblemError as error:
                    failures[i] = str(error)
        if self._twice:
            with self._with(FIRST):
                near = self._run(rows, cold, failures, any_status=True)
            cold = {i: (known.xs, known.us) for i, known in near.items()}
        found |= self._run(rows, cold, failures)
        return sorted(found.items())

    def _run(
        self,
        rows: list[list[_Array]],
        starts: Mapping[int, tuple[Any, Any]],
        failures: list[Any],
        any_status: bool = False,
    ) -> dict[int, Known]:
        """Solves some rows from their starts, and returns their solutions if they converge, or all of them."""
        indices = list(starts)
        if not indices:
            return {}

        def vary(problem: Problem, i: int) -> Problem | None:
            if self._build is not None:
                return self._made_for(rows[i])
            for parameter, value in zip(self.parameters, rows[i], strict=True):
                parameter.set(problem, value)
            return None

        n = len(indices)
        data = {
            "xs": np.stack([np.ravel(starts[i][0]) for i in indices]),
            "us": np.stack([flat(starts[i][1]) for i in indices]),
        }
        given = (self.solver, n, data, None, (vary, indices), ["xs", "us", "K"], self._threads, None)
        try:
            columns, wrong = _solve_many(*given)
        except ProblemError as error:
            raise _NoCopyError from error
        for k, fault in wrong:
            if not isinstance(fault, ProblemError):
                raise fault
            failures[indices[k]] = str(fault)
            self.statuses[indices[k]] = "error"
        excluded, found = {k for k, _ in wrong}, {}
        for k, i in enumerate(indices):
            if k in excluded:
                continue
            self.statuses[i] = columns["status"][k] or "not_started"
            self.iterations[i] += int(columns["iterations"][k])
            converged = self.statuses[i] == "converged"
            failures[i] = None if converged else _unexpected(self.statuses[i])
            if converged or any_status:
                xs = columns["xs"][k].reshape(self.ends[0])
                found[i] = Known(xs.copy(), self._split(columns["us"][k].copy()), columns["K"][k].copy())
        return found

    def _linearise(self, name: bytes, values: Sequence[_Array], xs: _Array, us: _Array) -> Any:
        """Returns the `Sensitivity` at the solution of a row."""
        if self._sensitivity is not None and self._sensitivity[0] == name:
            return self._sensitivity[1]
        known = self._solved.get(name)
        if self._at == name:
            found = Sensitivity(self.solver, curvature=self.curvature)
        else:
            self._set(values)
            if known is not None and isinstance(self.solver, Fddp):
                found = Sensitivity._at(self.problem, *known, self.curvature)
            else:  # a rounded solution of an earlier call, or a solver with multipliers
                solution = self.solver.solve(*((known.xs, known.us) if known else (xs, self._cut(us))))
                if solution.status != "converged":
                    raise ProblemError(_unexpected(solution.status))
                self._at = name
                found = Sensitivity(self.solver, curvature=self.curvature)
        self._sensitivity, self._defined = (name, found), set()
        return found

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
                first = rows[name][0]
                values = [a[first] for a in arrays]
                for i in rows[name]:
                    try:
                        if not all(np.isfinite(a).all() for a in (xs[i], us[i], by_xs[i], by_us[i])):
                            raise ProblemError("its solution, or the gradient of the loss, is not finite")
                        sensitivity = self._linearise(name, values, xs[first], us[first])
                        self.reports[i] = sensitivity.report
                        along = self.states.drop(xs[i], by_xs[i]), self._cut(by_us[i])
                        for k, g in self._gradients(sensitivity, values, needed, *along):
                            results[k][i] = self.parameters[k].slope(g, values[k])
                    except ProblemError as error:
                        failures[i] = str(error)
                        for result in results:
                            result[i] = np.nan
        return results, failures

    def _gradients(
        self, sensitivity: Any, values: Sequence[_Array], needed: Sequence[bool], by_xs: _Array, by_us: Any
    ) -> Iterator[tuple[int, _Array]]:
        """Yields the indices of the needed parameters and their gradients in tangent spaces, from one adjoint."""
        indices = [k for k, flag in enumerate(needed) if flag]
        for k in indices:
            if self.parameters[k].own and k not in self._defined:
                step = STEP * max(1.0, float(np.abs(values[k]).max(initial=0.0)))
                sensitivity.define(self.parameters[k].name, values[k].size, _Changed(self, values, k), step)
                self._defined.add(k)
        names = [self.parameters[k].name for k in indices]
        by_knot = [self.parameters[k].name for k in indices if self.parameters[k].by_knot]
        yield from zip(indices, sensitivity.gradients(names, by_xs, by_us, by_knot=by_knot), strict=True)


class _NoCopyError(Exception):
    """A problem that cannot be copied, and so cannot be solved in lanes."""


class _Changed:
    """The function that makes a row's problem for a change of one parameter, for `Sensitivity.define`."""

    def __init__(self, solves: Solves, values: Sequence[_Array], k: int) -> None:
        self._solves, self._values, self._k = solves, values, k

    def __call__(self, change: _Array) -> Problem:
        return self._solves._made_for(self._values, (self._k, change))


def flat(x: Any) -> _Array:
    """Returns the numbers of all knots in one row."""
    return np.concatenate([np.ravel(part) for part in x]) if isinstance(x, list) else np.ravel(x)


def control_sizes(problem: Problem) -> list[int]:
    """Returns the number of controls of each knot."""
    return [len(u) for u in problem.quasi_static(np.tile(problem.x0, (problem.horizon + 1, 1)))]


def checked(problem: Any, expected: str) -> Problem:
    """Returns the problem, or raises TypeError if it is something else."""
    if not isinstance(problem, Problem):
        raise TypeError(f"{expected}, found {type(problem).__name__}")
    return problem


def _unexpected(status: str) -> str:
    return f"the solve ended with {status!r}, expected 'converged'"
