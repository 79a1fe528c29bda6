"""Results of many solves, and the data that the solves share."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._arguments import described, instance, integer, named, reals, words
from ._condyle import AugmentedLagrangian, Error, Fddp, InteriorPoint, Problem
from ._types import Solution

if TYPE_CHECKING:
    from os import PathLike

_Array = NDArray[np.float64]
Rows = dict[str, NDArray[Any]]
"""Columns of results, with the names of `Variations`."""
Solver = type[Fddp] | type[AugmentedLagrangian] | type[InteriorPoint]

EXPECTED = (Error, ArithmeticError, LookupError, TypeError, ValueError)
"""Exceptions that are the fault of one variation, and do not end a call."""

ARRAYS = ("xs", "us", "K", "k")
"""Names of the arrays of a solution."""


class Variations(NamedTuple):
    """The results of `sweep` or `solve_many`: row i belongs to variation i. `solve_many` takes them as a start.

    If a variation fails with an error, its numbers are NaN and its status is "error".
    """

    status: NDArray[np.str_]
    """The final status of each solve, as in `Solution.status`; "error" if the variation failed with an `error`;
    "not_started" if the time budget of `solve_many` was over.
    """
    cost: _Array
    """The cost of each trajectory."""
    gap: _Array
    """The largest gap between the states of each trajectory and the dynamics."""
    iterations: NDArray[np.int64]
    """The number of iterations of each solve."""
    seconds: _Array
    """The duration of each solve (s), from its start to its end. Variations that share SIMD lanes are solved at the
    same time, so the sum of these durations exceeds the duration of the call.
    """
    error: NDArray[np.str_]
    """The error message if a variation could not be made or solved; else empty."""
    xs: _Array | None
    """The states of each trajectory, (V, N + 1, nx), for V variations and N knots."""
    us: _Array | None
    """The controls of each trajectory, (V, N, nu). If knots differ in nu, the controls of all knots follow one another,
    (V, Σ nu).
    """
    K: _Array | None
    """Feedback gains, (V, N, nu, ndx), or (V, Σ nu · ndx) if knots differ in nu; None unless `keep` contains "K"."""
    k: _Array | None
    """Feed-forward, with the shape of `us`; None unless `keep` contains "k"."""

    @staticmethod
    def load(folder: "str | PathLike[str]") -> "Variations":
        """Returns the results that a sweep has written to a folder. If the sweep has not ended, these are the results
        of the finished chunks.

        Raises ValueError if the folder does not contain a sweep, or no chunk is finished.
        """
        parts = [*Variations.load_chunks(folder)]
        if not parts:
            raise ValueError(f"folder: no chunk of the sweep in {folder} is done")
        return joined(parts)

    @staticmethod
    def load_chunks(folder: "str | PathLike[str]") -> "Iterator[Variations]":
        """Yields the results of each finished chunk of a sweep in a folder, in the order of the variations. One chunk
        is in memory at a time.

        Raises ValueError if the folder does not contain a sweep.
        """
        from ._sweep_folder import Folder

        record = Folder.open(folder)
        return (table(record.read(number)) for number in sorted(record.done()))


class Job(NamedTuple):
    """The data that all variations share. The data are sent once to each worker."""

    problem: Problem
    start: tuple[Any, Any]
    vary: Callable[[Problem, Any], Problem | None] | None
    solver: Solver
    settings: dict[str, Any]
    keep: tuple[str, ...]
    threads: int = 1


def checked(
    problem: Any, solver: Any, settings: Any, keep: Any, threads: Any, progress: Any
) -> tuple[dict[str, Any], tuple[str, ...], int]:
    """Checks arguments that `sweep` and `solve_many` have in common. Returns the settings, the names of arrays to keep,
    and the number of threads.
    """
    instance("problem", problem, Problem)
    if not any(solver is known for known in (Fddp, InteriorPoint, AugmentedLagrangian)):
        raise TypeError(
            f"solver: expected the class Fddp, InteriorPoint or AugmentedLagrangian, found {described(solver)}"
        )
    if not (isinstance(progress, bool) or callable(progress)):
        raise TypeError(f"progress: expected a bool or a function, found {described(progress)}")
    return named("settings", settings, "values"), words("keep", keep, ARRAYS), integer("threads", threads, 1)


def start_of(problem: Problem, start: Any, solver: Solver, settings: dict[str, Any]) -> tuple[Any, Any]:
    """Returns the states and controls from which all solves start."""
    if isinstance(start, Solution):
        return start.xs, start.us
    if start is not None:
        if isinstance(start, Variations) or not (isinstance(start, (tuple, list)) and len(start) == 2):
            hint = ": solve_many takes a start for each problem" if isinstance(start, Variations) else ""
            raise TypeError(
                f"start: expected a Solution, or states and controls (xs, us), found {described(start)}{hint}"
            )
        xs, us = start
        states = reals("start: xs", xs)
        wanted = (problem.horizon + 1, problem.nx)
        if states.shape != wanted:
            raise ValueError(f"start: expected states of the shape {wanted}, found {described(states)}")
        return states, us if isinstance(us, list) else reals("start: us", us)
    xs = np.tile(problem.x0, (problem.horizon + 1, 1))
    try:
        us = problem.quasi_static(xs)
    except Error as none:
        raise ValueError(
            f"start: the nominal problem has no controls at rest ({none}): give states and controls"
        ) from none
    nominal = solver(problem, **settings).solve(xs, us)
    return nominal.xs, nominal.us


def states_of(problem: Problem, values: Any, argument: str) -> _Array:
    """Returns the initial states of V variations, (V, nx)."""
    states = reals(argument, values, f"states, (V, {problem.nx})")
    if states.ndim != 2 or states.shape[1] != problem.nx:
        raise ValueError(f"{argument}: expected states, (V, {problem.nx}), found the shape {states.shape}")
    return states


def by_knot(argument: str, values: Any, rows: int, shape: tuple[int, ...], lead: tuple[str, ...] = ("V",)) -> _Array:
    """Returns the numbers of all knots of each variation in a row, from numbers for each knot or for all knots. `lead`
    is the axis of variations, or empty for the numbers of one variation.
    """
    of_all, of_each = str((*lead, *shape)), str((*lead, rows, *shape))
    wanted = f"{of_all} or {of_each} numbers".replace("'", "")
    found = reals(argument, values, wanted)
    if not lead:
        found = found[None]
    given = found.shape
    if found.ndim > 0 and given[1:] == shape:
        found = np.repeat(found[:, None], rows, axis=1)
    if found.ndim != 2 + len(shape) or found.shape[1:] != (rows, *shape):
        raise ValueError(f"{argument}: expected {wanted}, found the shape {given[1 - len(lead) :]}")
    return found.reshape(len(found), rows * int(np.prod(shape)))


def placements_of(argument: str, values: Any, lead: tuple[str, ...] = ("V",)) -> _Array:
    """Returns positions (V, 3), or homogeneous matrices (V, 16), from positions (V, 3) or matrices (V, 4, 4)."""
    wanted = f"{(*lead, 3)} positions or {(*lead, 4, 4)} placements".replace("'", "")
    given = reals(argument, values, wanted)
    found = given if lead else given[None]
    if found.ndim == 0 or found.shape[1:] not in ((3,), (4, 4)):
        raise ValueError(f"{argument}: expected {wanted}, found the shape {given.shape}")
    return np.ascontiguousarray(found.reshape(len(found), -1))


def flat(x: Any) -> _Array:
    """Returns the numbers of all knots as one array; if knots differ in size, their numbers are joined knot by knot."""
    return np.concatenate([np.ravel(part) for part in x]) if isinstance(x, list) else np.asarray(x, float)


def shapes(problem: Problem, controls: Any) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of the arrays of a solution, computed from the problem and the controls of a start."""
    us = flat(controls)
    n, ndx = problem.horizon, problem.ndx
    K = (*us.shape, ndx) if us.ndim == 2 else (us.size * ndx,)
    return {"xs": (n + 1, problem.nx), "us": us.shape, "k": us.shape, "K": K}


def message(variation: int, wrong: BaseException) -> str:
    """Returns the error message of a variation."""
    return f"variation {variation}: {type(wrong).__name__}: {wrong}"


def empty_rows(job: Job, count: int) -> Rows:
    """Returns the columns of `count` variations that have failed."""
    sizes = shapes(job.problem, job.start[1])
    rows: Rows = {name: np.full(count, np.nan) for name in ("cost", "gap", "seconds")}
    rows["status"] = np.full(count, "error", "<U24")
    rows["iterations"] = np.zeros(count, np.int64)
    rows["error"] = np.full(count, "", object)
    return rows | {name: np.full((count, *sizes[name]), np.nan) for name in job.keep}


def columns(job: Job, found: dict[str, Any]) -> Rows:
    """Converts the columns of `_solve_many` to columns of `Variations`, without `error`."""
    rows = {name: np.asarray(found[name]) for name in ("cost", "gap", "seconds")}
    rows["status"] = np.array(found["status"], "<U24")
    rows["iterations"] = np.array(found["iterations"], np.int64)
    sizes = shapes(job.problem, job.start[1])
    return rows | {name: found[name].reshape(-1, *sizes[name]) for name in ARRAYS if name in found}


def table(rows: Rows) -> Variations:
    """Returns columns as `Variations`."""
    given: dict[str, Any] = {name: rows.get(name) for name in Variations._fields}
    return Variations(**given | {"error": np.asarray(rows["error"], str)})


def joined(parts: list[Variations]) -> Variations:
    """Returns the rows of several results one after the other."""
    if len(parts) == 1:
        return parts[0]
    both: Any = (None if column[0] is None else np.concatenate(column) for column in zip(*parts, strict=True))
    return Variations(*both)
