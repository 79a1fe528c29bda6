"""The class `ProblemLayer` that `condyle.torch` and `condyle.jax` have in common."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import AugmentedLagrangian, Fddp, InteriorPoint, Model, Problem, ProblemError
from ._parameters import Parameter, States
from ._solves import BOUNDED, TIGHT, Solves, Source, checked, control_sizes

_Array = NDArray[np.float64]
_SOLVERS = (Fddp, InteriorPoint, AugmentedLagrangian)


class ProblemLayer(ABC):
    """A problem's solution as a differentiable function of its parameters."""

    def __init__(
        self,
        problem: Problem | Callable[..., Problem],
        parameters: Sequence[str],
        *,
        own: Mapping[str, ArrayLike] | None = None,
        by_knot: Sequence[str] = (),
        robot: Model | None = None,
        solver: Any = None,
        start: tuple[Any, Any] | None = None,
        curvature: Literal["exact", "dynamics", "gauss_newton"] = "exact",
        on_failure: Literal["raise", "nan"] = "raise",
        threads: int = 1,
        **settings: Any,
    ) -> None:
        self._given: dict[str, Any] = {
            **{"problem": problem, "parameters": parameters, "own": own, "by_knot": by_knot, "robot": robot},
            **{"solver": solver, "start": start, "curvature": curvature, "on_failure": on_failure},
            **{"threads": threads, **settings},
        }
        if not (isinstance(problem, Problem) or callable(problem)):
            raise TypeError(
                f"problem: expected a Problem, or a function of the parameters in own, found {type(problem).__name__}"
            )
        names, knots = _names("parameters", parameters), _names("by_knot", by_knot)
        if len(set(names)) < len(names) or not names:
            raise ValueError(f"parameters: expected different names, at least one, found {names}")
        if unknown := set(knots) - set(names):
            raise ValueError(f"by_knot: expected names in parameters, found {sorted(unknown)}")
        if on_failure not in ("raise", "nan"):
            raise ValueError(f"on_failure: expected 'raise' or 'nan', found {on_failure!r}")
        if curvature not in ("exact", "dynamics", "gauss_newton"):
            raise ValueError(f"curvature: expected 'exact', 'dynamics' or 'gauss_newton', found {curvature!r}")
        if not isinstance(threads, int) or threads < 1:
            raise ValueError(f"threads: expected a number of at least 1, found {threads!r}")
        kind = Fddp if solver is None else solver
        if kind not in _SOLVERS:
            hint = f"; give its class {type(kind).__name__}" if isinstance(kind, _SOLVERS) else ""
            raise TypeError(f"solver: expected {_either(k.__name__ for k in _SOLVERS)}, found {kind!r}{hint}")
        source = _source(problem, names, own)
        states = States(source.problem, robot)
        table = [Parameter(source.problem, name, name in knots, states, source.own) for name in names]
        tight = {**TIGHT, **BOUNDED} if kind is Fddp else {"max_iterations": TIGHT["max_iterations"]}
        make = _Make(kind, {**tight, **settings})
        first = None if start is None else _start(source.problem, start)
        self._solves = Solves(source, table, states, make, curvature, first, threads)
        self._failing = on_failure

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies the layer with its warm starts, for pickles and `copy.deepcopy`."""
        return _restored, (type(self), self._given), {"warm": dict(self._solves.warm)}

    def __copy__(self) -> "ProblemLayer":
        """Copies the problem too, because two layers cannot share it."""
        return copy.deepcopy(self)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._solves.warm.update(state["warm"])

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
            if cut < 0 or found[cut:] != parameter.shape:
                expected = ", ".join(map(str, ("...", *parameter.shape)))
                raise ValueError(f"{parameter.name}: expected shape ({expected}), found {found}")
            batches.append(found[:cut])
            ends.append(found[cut:])
        try:
            batch = np.broadcast_shapes(*batches)
        except ValueError:
            found_all = ", ".join(f"{p.name} {shape}" for p, shape in zip(table, batches, strict=True))
            raise ValueError(f"expected batches that broadcast, found {found_all}") from None
        keys = None if rows is None else _keys(rows, int(np.prod(batch)))
        arrays = [self._expand(array, (*batch, *end)) for array, end in zip(arrays, ends, strict=True)]
        return self._apply(keys, arrays)

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
                    raise ProblemError(f"row {row}: {failure}" if row else failure)

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


class _Make:
    """The function that makes a solver for a problem."""

    def __init__(self, kind: Any, settings: dict[str, Any]) -> None:
        self._kind, self._settings = kind, settings

    def __call__(self, problem: Problem) -> Any:
        return self._kind(problem, **self._settings)


def _restored(kind: type[ProblemLayer], given: dict[str, Any]) -> ProblemLayer:
    return kind(**given)


def _either(names: Any) -> str:
    *first, last = names
    return f"{', '.join(first)} or {last}"


def _names(argument: str, names: Any) -> list[str]:
    """Returns names from a sequence of names or a single one."""
    found = [names] if isinstance(names, str) else names
    if not isinstance(found, Sequence | set) or not all(isinstance(name, str) for name in found):
        raise TypeError(f"{argument}: expected a list of names, found {names!r}")
    return list(found)


def _source(problem: Any, names: Sequence[str], own: Mapping[str, ArrayLike] | None) -> Source:
    """Checks `problem` and `own`, and makes the nominal problem if `problem` is a function."""
    if isinstance(problem, Problem):
        if own:
            raise TypeError("problem: expected a function of the parameters in own, found a Problem")
        return Source(problem, None, {})
    if not isinstance(own, Mapping) or not own:
        raise TypeError("own: expected the nominal values of the parameters of the function `problem`, by name")
    if unknown := set(own) - set(names):
        raise ValueError(f"own: expected names in parameters, found {sorted(unknown)}")
    if taken := [name for name in own if "/" in name or name in ("x0", "duration", "gravity", "armature")]:
        raise ValueError(f"own: expected names that no other parameter has, without '/', found {taken}")
    values = {}
    for name, value in own.items():
        values[name] = np.array(value, float)
        if not np.isfinite(values[name]).all():
            raise ValueError(f"own: expected finite numbers for {name!r}, found {value!r}")
    made = problem(**{name: value.copy() for name, value in values.items()})
    return Source(checked(made, "problem: expected a function that returns a Problem"), problem, values)


def _start(problem: Problem, start: Any) -> tuple[_Array, Any]:
    """Returns the states and controls of `start` in float64, after a check of their shapes."""
    if not isinstance(start, tuple | list) or len(start) != 2:
        raise TypeError(f"start: expected a pair of states and controls, found {type(start).__name__}")
    xs, us = np.array(start[0], float), [np.array(u, float) for u in start[1]]
    if xs.shape != (problem.horizon + 1, problem.nx):
        raise ValueError(f"start: expected states ({problem.horizon + 1}, {problem.nx}), found the shape {xs.shape}")
    try:
        sizes = control_sizes(problem)
    except ProblemError:  # an action of one's own has no controls at rest
        sizes = [u.size for u in us]
    if [u.shape for u in us] != [(n,) for n in sizes] or len(sizes) != problem.horizon:
        expected = f"arrays of {sizes} numbers" if len(set(sizes)) > 1 else f"({problem.horizon}, {sizes[0]})"
        raise ValueError(f"start: expected controls {expected}, found the shapes {[u.shape for u in us]}")
    return xs, np.stack(us) if len(set(sizes)) == 1 else us


def _keys(rows: Any, count: int) -> tuple[Hashable, ...]:
    """Returns names of rows, with numbers instead of arrays of one number."""
    try:
        keys = tuple(row.item() if hasattr(row, "item") else row for row in rows)
        hash(keys)
    except TypeError:
        raise TypeError(f"rows: expected a sequence of numbers, strings or tuples, found {rows!r}") from None
    if len(keys) != count:
        raise ValueError(f"rows: expected {count} names, one for each problem, found {len(keys)}")
    return keys
