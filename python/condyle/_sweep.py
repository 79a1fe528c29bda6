"""Solves many variations of a problem: in SIMD lanes, in this process or on the machines of a Ray cluster."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import LEVEL, AugmentedLagrangian, Error, Fddp, InteriorPoint, Problem, __version__, _solve_many
from ._report import counter
from ._types import Solution

if TYPE_CHECKING:
    from os import PathLike

_Array = NDArray[np.float64]
_Rows = dict[str, NDArray[Any]]


class Variations(NamedTuple):
    """The results of `sweep` or `solve_many`: row i belongs to variation i.

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
        """Returns the results that a `sweep` has written to a folder. If the sweep has not ended, these are the results
        of the finished chunks.

        Raises ValueError if the folder does not contain a sweep, or no chunk is finished.
        """
        from ._sweep_folder import Folder

        rows = Folder.open(folder).done()
        if not rows:
            raise ValueError(f"folder: no chunk of the sweep in {folder} is done")
        return _table([rows[chunk] for chunk in sorted(rows)])


class Job(NamedTuple):
    """The data that all variations share. The data are sent once to each worker."""

    problem: Problem
    start: tuple[Any, Any]
    vary: Callable[[Problem, Any], Problem | None] | None
    solver: type[Fddp] | type[AugmentedLagrangian] | type[InteriorPoint]
    settings: dict[str, Any]
    keep: tuple[str, ...]


def sweep(
    problem: Problem,
    variations: ArrayLike | Sequence[Any],
    *,
    vary: Callable[[Problem, Any], Problem | None] | None = None,
    start: Solution | tuple[Any, Any] | None = None,
    solver: type[Fddp] | type[AugmentedLagrangian] | type[InteriorPoint] = Fddp,
    settings: dict[str, Any] | None = None,
    keep: Sequence[Literal["xs", "us", "K", "k"]] = ("xs", "us"),
    folder: "str | PathLike[str] | None" = None,
    chunk: int = 64,
    cluster: bool | str | None = None,
    workers: int | None = None,
    progress: bool | Callable[[int, int], object] = False,
) -> Variations:
    """Solves variations of a problem, for example for a library of motions, a sweep of parameters, or Monte Carlo
    trials of a plan.

    With `Fddp`, variations that differ only in initial states, targets, weights, bounds and durations are solved
    together in SIMD lanes, as in `solve_many`. All other variations are solved one by one.

    problem: the nominal problem.
    variations: V initial states, (V, nx); or, with `vary`, a sequence of V objects of any type.
    vary: a function of the problem and a variation. The function may return the problem to solve, such as a problem
        with a heavier robot. Or the function changes the given problem and returns None. Then the function must set the
        same values for each variation, since the next variation gets the same problem. Without `vary`, the variation is
        the initial state.
    start: states and controls from which all solves start, or a `Solution`. None solves the nominal problem from rest,
        and starts from the solution of this problem. The first state is replaced by the variation's initial state.
    solver: `Fddp`, `AugmentedLagrangian` or `InteriorPoint`, which is made for each problem with the `settings`.
    keep: the arrays of each solution to keep: "xs", "us", "K", "k".
    folder: the folder to which results are written, chunk by chunk, as NPZ files. An interrupted sweep continues with
        the unfinished chunks when it is called again with the same arguments; `Variations.load` reads the folder. None
        writes nothing.
    chunk: the number of variations that are sent and written together.
    cluster: None solves in this process; True uses the processors of this machine, or of the cluster to which `ray` is
        connected; else the address of a Ray cluster (`pip install condyle[ray]`). Problem and start are sent once to
        each worker. Workers compute at this process's SIMD level (`condyle.LEVEL`), so results are bit-identical. If a
        worker is lost, another worker repeats the chunk.
    workers: the number of workers on the cluster; None is one for each processor.
    progress: whether to show the progress (with tqdm if it is installed); or a function that is called with the number
        of finished variations and the total number.

    Returns `Variations`. The error of a variation is stored in its row, and does not end the sweep.

    Raises ValueError for invalid arguments, and for a folder with the results of another sweep; ImportError if Ray is
    not installed; RuntimeError if workers are lost repeatedly.

    >>> arm, rest = condyle.robots.arm7(), np.zeros(14)
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual
    >>> costs = [Cost("rest", 1.0, Residual.state(rest)), Cost("effort", 1e-3, Residual.control_gravity())]
    >>> problem = Problem(rest, [FreeDynamics(arm, 0.02, costs)], [0] * 20, FreeDynamics(arm, None, costs[:1]))
    >>> found = condyle.sweep(problem, np.random.default_rng(1).normal(rest, 0.05, (100, 14)))
    >>> set(found.status.tolist()), found.xs.shape
    ({'converged'}, (100, 21, 14))
    """
    if chunk < 1:
        raise ValueError(f"chunk: expected at least 1, found {chunk}")
    if not set(keep) <= {"xs", "us", "K", "k"}:
        raise ValueError(f"keep: expected some of 'xs', 'us', 'K' and 'k', found {list(keep)!r}")
    items: Any = variations if vary is not None else _states(problem, variations)
    if len(items) == 0:
        raise ValueError("variations: there are none")
    options = settings or {}
    job = Job(problem, _start(problem, start, solver, options), vary, solver, options, tuple(keep))

    chunks = [(first, items[first : first + chunk]) for first in range(0, len(items), chunk)]
    results: dict[int, _Rows] = {}
    record = None
    if folder is not None:
        from ._sweep_folder import Folder

        record = Folder.create(folder, job, items, chunk, {"level": LEVEL, "version": __version__})
        results = record.done()
    report = counter(progress, len(items), sum(len(rows["cost"]) for rows in results.values()))
    missing = [(number, *chunks[number]) for number in range(len(chunks)) if number not in results]
    try:
        for number, rows in _solved(job, missing, cluster, workers):
            if record is not None:
                record.write(number, rows)
            results[number] = rows
            report(len(rows["cost"]))
    finally:
        report(None)
    return _table([results[number] for number in range(len(chunks))])


def solve_many(
    problem: Problem,
    x0: ArrayLike | None = None,
    *,
    references: dict[str, ArrayLike] | None = None,
    weights: dict[str, ArrayLike] | None = None,
    start: Solution | tuple[Any, Any] | None = None,
    settings: dict[str, Any] | None = None,
    keep: Sequence[Literal["xs", "us", "K", "k"]] = ("xs", "us"),
    threads: int = 1,
    progress: bool | Callable[[int, int], object] = False,
) -> Variations:
    """Solves many problems of one shape by `Fddp`, several at a time in SIMD lanes.

    Bounds on controls hold. As in `Fddp`, limits of knots only add costs, which do not enforce them: for problems with
    limits, use `condyle.sweep` with `InteriorPoint` or `AugmentedLagrangian`.

    Each problem has its own step lengths, regularisation and convergence. The result of a problem does not depend on
    the other problems, to the bit. It may differ by rounding from the result of `Fddp` alone.

    problem: the nominal problem. It is copied, and not changed.
    x0: the initial states, (V, nx); or one initial state for all problems, nx numbers; None takes the problem's.
    references: for names of costs, the targets of each problem, (V, N + 1, n), with rows as in
        `Problem.set_references`; or (V, n), one target for all knots of a problem.
    weights: for names of costs, the weights of each problem, (V, N + 1), or (V,), one weight for all knots.
    start: states and controls from which all solves start, or a `Solution`. None solves the nominal problem from rest,
        and starts from its solution. The first state is replaced by the initial state of each problem.
    settings: the settings of `Fddp`. Its `time_budget` limits the whole call: problems that are being solved then end
        with the status "time_limit", and the others with "not_started".
    keep: the arrays of each solution to keep.
    threads: the number of threads, each of which solves its own problems.
    progress: as in `sweep`.

    Returns `Variations`. The error of a problem is stored in its row, and does not affect the others. For more problems
    than fit into memory, and for variations that change the model or the contacts, use `condyle.sweep`.

    Raises ValueError for invalid arguments, KeyError for a cost that no knot has, and `ProblemError` for an `Action` in
    Python, which cannot be copied.

    >>> arm, rest = condyle.robots.arm7(), np.zeros(14)
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual, solve_many
    >>> costs = [Cost("rest", 1.0, Residual.state(rest)), Cost("effort", 1e-3, Residual.control_gravity())]
    >>> problem = Problem(rest, [FreeDynamics(arm, 0.02, costs)], [0] * 20, FreeDynamics(arm, None, costs[:1]))
    >>> goals = np.random.default_rng(1).normal(rest, 0.05, (100, 14))
    >>> found = solve_many(problem, references={"rest": goals}, keep=["us", "K"])
    >>> set(found.status.tolist()), found.us.shape, found.K.shape
    ({'converged'}, (100, 20, 7), (100, 20, 7, 14))
    """
    if not set(keep) <= {"xs", "us", "K", "k"}:
        raise ValueError(f"keep: expected some of 'xs', 'us', 'K' and 'k', found {list(keep)!r}")
    if threads < 1:
        raise ValueError(f"threads: expected at least 1, found {threads}")
    rows = problem.horizon + 1
    targets = [
        (name, _by_knot("references", name, values, rows, problem.references(name)[0].shape))
        for name, values in (references or {}).items()
    ]
    scales = [(name, _by_knot("weights", name, values, rows, ())) for name, values in (weights or {}).items()]
    states = None if x0 is None else _real("x0", x0)
    counts = {name: len(values) for name, values in targets + scales}
    if states is not None and states.ndim != 1:
        counts["x0"] = len(_states(problem, states, "x0"))
    if not counts:
        raise ValueError("x0: expected the states of several problems, (V, nx), if there are no references and weights")
    count = next(iter(counts.values()))
    if set(counts.values()) != {count}:
        raise ValueError(f"expected one number of problems, found {', '.join(f'{k}: {v}' for k, v in counts.items())}")
    data: dict[str, Any] = {"references": targets, "weights": scales}
    if states is not None:
        data["x0"] = np.ascontiguousarray(np.broadcast_to(states, (count, problem.nx)))
    options = settings or {}
    nominal = {name: value for name, value in options.items() if name != "time_budget"}
    job = Job(problem, _start(problem, start, Fddp, nominal), None, Fddp, options, tuple(keep))
    report = counter(progress, count, 0)
    told = [0]

    def tell(ended: int) -> None:
        report(ended - told[0])
        told[0] = ended

    try:
        solver = Fddp(problem, **options)
        watcher = tell if progress else None
        found, wrong = _solve_many(solver, count, data, job.start, None, list(keep), threads, watcher)
        if progress:
            tell(count)
        if len(wrong) == count and all(isinstance(error, KeyError) for _, error in wrong):
            raise wrong[0][1]
    finally:
        report(None)
    table = _table([_columns(job, found, wrong)])
    return table._replace(status=np.where(table.status == "", "not_started", table.status))


def _real(argument: str, values: ArrayLike) -> _Array:
    """Returns the numbers as an array of floats."""
    if np.iscomplexobj(values):
        raise TypeError(f"{argument}: expected real numbers, found complex ones")
    return np.asarray(values, float)


def _by_knot(argument: str, name: str, values: ArrayLike, rows: int, shape: tuple[int, ...]) -> _Array:
    """Returns the numbers of all knots of each problem in a row, from numbers for each knot or for all knots."""
    found = _real(argument, values)
    if found.shape[1:] == shape and found.ndim > 0:
        found = np.repeat(found[:, None], rows, axis=1)
    if found.ndim != 2 + len(shape) or found.shape[1:] != (rows, *shape):
        of_all, of_each = str(("V", *shape)), str(("V", rows, *shape))
        wanted = f"{of_all} or {of_each}".replace("'", "")
        raise ValueError(f"{argument}: expected {wanted} numbers of '{name}', found the shape {found.shape}")
    return found.reshape(len(found), rows * int(np.prod(shape)))


def _solved(
    job: Job, missing: list[tuple[int, int, Any]], cluster: bool | str | None, workers: int | None
) -> Iterator[tuple[int, _Rows]]:
    """Yields the index and the rows of each finished chunk."""
    if cluster:
        from ._sweep_ray import on_cluster

        yield from on_cluster(job, missing, cluster if isinstance(cluster, str) else None, workers)
        return
    worker = Worker(job)
    for number, first, items in missing:
        yield number, worker.solve(first, items)


class Worker:
    """A worker, which solves chunks of variations. The worker uses a single solver as long as the problem is the
    same.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self._same = None if job.vary else job.solver(job.problem, **job.settings)
        self._together = job.solver is Fddp and not {"time_budget", "segments"} & job.settings.keys()

    def solve(self, first: int, items: Any) -> _Rows:
        """Returns the rows of the results for the variations `items`; `first` is the index of the first variation."""
        if self._together:
            try:
                return self._in_lanes(first, items)
            except (Error, ArithmeticError, LookupError, TypeError, ValueError):
                self._together = False  # for example an action in Python, which cannot be copied
        found: list[Solution | str] = []
        for number, item in enumerate(items, first):
            try:
                found.append(self._one(item))
            except (Error, ArithmeticError, LookupError, TypeError, ValueError) as wrong:
                found.append(f"variation {number}: {type(wrong).__name__}: {wrong}")
        return _rows(found, self._job)

    def _in_lanes(self, first: int, items: Any) -> _Rows:
        job = self._job
        solver = Fddp(job.problem, **job.settings)
        vary = (job.vary, list(items)) if job.vary else None
        data: dict[str, Any] = {} if job.vary else {"x0": np.ascontiguousarray(items, float)}
        found, wrong = _solve_many(solver, len(items), data, job.start, vary, list(job.keep), 1, None)
        return _columns(job, found, wrong, first)

    def _one(self, item: Any) -> Solution:
        job = self._job
        xs, us = job.start
        xs = np.array(xs, float)
        if self._same is not None:
            job.problem.set_x0(item)
            xs[0] = item
            return self._same.solve(xs, us)
        assert job.vary is not None
        problem = job.vary(job.problem, item) or job.problem
        xs[0] = problem.x0
        return job.solver(problem, **job.settings).solve(xs, us)


def _states(problem: Problem, variations: ArrayLike, argument: str = "variations") -> _Array:
    states = np.array(variations, float)
    if states.ndim != 2 or states.shape[1] != problem.nx:
        raise ValueError(f"{argument}: expected states, (V, {problem.nx}), found the shape {states.shape}")
    return states


def _start(
    problem: Problem, start: Solution | tuple[Any, Any] | None, solver: Any, settings: dict[str, Any]
) -> tuple[Any, Any]:
    """Returns the states and controls from which all solves start."""
    if isinstance(start, Solution):
        return start.xs, start.us
    if start is not None:
        return start
    xs = np.tile(problem.x0, (problem.horizon + 1, 1))
    try:
        us = problem.quasi_static(xs)
    except Error as none:
        raise ValueError(
            f"start: the nominal problem has no controls at rest ({none}): give states and controls"
        ) from none
    nominal = solver(problem, **settings).solve(xs, us)
    return nominal.xs, nominal.us


def _flat(x: Any) -> _Array:
    """Returns the numbers of all knots as one array; if knots differ in size, their numbers are joined knot by knot."""
    return np.concatenate([np.ravel(part) for part in x]) if isinstance(x, list) else np.asarray(x, float)


def _shapes(problem: Problem, controls: Any) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of the arrays of a solution, computed from the problem and the controls of a start."""
    us = _flat(controls)
    n, ndx = problem.horizon, problem.ndx
    K = (*us.shape, ndx) if us.ndim == 2 else (us.size * ndx,)
    return {"xs": (n + 1, problem.nx), "us": us.shape, "k": us.shape, "K": K}


def _rows(found: list[Solution | str], job: Job) -> _Rows:
    """Converts the solutions, or error messages, of variations to the columns of `Variations`."""
    shapes = _shapes(job.problem, job.start[1])
    solved = [None if isinstance(one, str) else one for one in found]
    rows: _Rows = {
        "status": np.array(["error" if one is None else one.status for one in solved]),
        "cost": np.array([np.nan if one is None else one.cost for one in solved]),
        "gap": np.array([np.nan if one is None else one.gap for one in solved]),
        "iterations": np.array([0 if one is None else len(one.trace) for one in solved]),
        "seconds": np.array([np.nan if one is None else one.timings.total for one in solved]),
        "error": np.array([one if isinstance(one, str) else "" for one in found]),
    }
    for name in job.keep:
        rows[name] = np.full((len(found), *shapes[name]), np.nan)
        for row, one in zip(rows[name], solved, strict=True):
            if one is not None:
                row[...] = _flat(getattr(one, name)).reshape(row.shape)
    return rows


def _columns(job: Job, found: _Rows, wrong: list[tuple[int, BaseException]], first: int = 0) -> _Rows:
    """Converts the results of `_solve_many` to the columns of `Variations`; `first` is the index of the first row."""
    messages = dict(wrong)
    rows = {name: np.asarray(found[name]) for name in ("status", "cost", "gap", "iterations", "seconds")}
    rows["error"] = np.array(
        [
            f"variation {first + i}: {type(messages[i]).__name__}: {messages[i]}" if i in messages else ""
            for i in range(len(rows["cost"]))
        ]
    )
    shapes = _shapes(job.problem, job.start[1])
    return rows | {name: found[name].reshape(-1, *shapes[name]) for name in shapes if name in found}


def _table(parts: list[_Rows]) -> Variations:
    names = Variations._fields
    return Variations(**{n: np.concatenate([p[n] for p in parts]) if n in parts[0] else None for n in names})  # type: ignore[arg-type]
