"""Solves many variations of a problem, chunk by chunk: in this process or on the machines of a Ray cluster."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from ._arguments import described, integer, reals
from ._condyle import LEVEL, Fddp, Problem, __version__, _solve_many
from ._report import counter
from ._types import Solution
from ._variations import (
    EXPECTED,
    Job,
    Rows,
    Solver,
    Variations,
    by_knot,
    checked,
    columns,
    empty_rows,
    flat,
    joined,
    message,
    placements_of,
    start_of,
    states_of,
    table,
)

if TYPE_CHECKING:
    from os import PathLike

_KEYS = ("x0", "references", "weights", "contacts")
"""Keys of a variation that is a dict of data."""


def sweep(
    problem: Problem,
    variations: ArrayLike | Iterable[Any],
    *,
    vary: Callable[[Problem, Any], Problem | None] | None = None,
    start: Solution | tuple[Any, Any] | None = None,
    solver: Solver = Fddp,
    settings: dict[str, Any] | None = None,
    keep: Sequence[Literal["xs", "us", "K", "k"]] = ("xs", "us"),
    folder: "str | PathLike[str] | None" = None,
    chunk: int = 64,
    cluster: bool | str | None = None,
    workers: int | None = None,
    threads: int = 1,
    progress: bool | Callable[[int, Any], object] = False,
) -> Variations:
    """Solves variations of a problem, for example for a library of motions, a sweep of parameters, or Monte Carlo
    trials of a plan.

    With `Fddp`, variations that differ only in data are solved together in SIMD lanes, as in `solve_many`: in initial
    states, targets, weights, bounds, durations and targets of contacts. Variations with another model or other contacts
    are solved one by one. So are all variations with other solvers, or with the settings `segments` or `time_budget`,
    which applies to each solve.

    problem: the nominal problem.
    variations: V initial states, (V, nx). Or V dicts of data with some of the keys "x0", "references", "weights" and
        "contacts", as in `solve_many` for one problem: `{"x0": x, "references": {"reach": point}}`. Or, with `vary`, V
        objects of any type. An iterator, such as a generator, is read chunk by chunk.
    vary: a function of the problem and a variation. The function may return the problem to solve, such as a problem
        with a heavier robot. Or the function changes the given problem and returns None. Then the function must set the
        same values for each variation, since the next variation gets the same problem.
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
    threads: the number of threads of each worker, or of this process.
    progress: whether to show the progress (with tqdm if it is installed); or a function that is called with the number
        of finished variations and the total number, which is None for an iterator.

    Returns `Variations`. The error of a variation is stored in its row, and does not end the sweep. `sweep_chunks`
    returns the rows as they come, for more variations than fit into memory.

    Raises TypeError or ValueError for invalid arguments, and ValueError for a folder with the results of another sweep;
    ImportError if Ray is not installed; RuntimeError if workers are lost repeatedly.

    >>> arm, rest = condyle.robots.arm7(), np.zeros(14)
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual
    >>> costs = [Cost("rest", 1.0, Residual.state(rest)), Cost("effort", 1e-3, Residual.control_gravity())]
    >>> problem = Problem(rest, [FreeDynamics(arm, 0.02, costs)], [0] * 20, FreeDynamics(arm, None, costs[:1]))
    >>> found = condyle.sweep(problem, np.random.default_rng(1).normal(rest, 0.05, (100, 14)))
    >>> set(found.status.tolist()), found.xs.shape
    ({'converged'}, (100, 21, 14))
    """
    parts = [
        *sweep_chunks(
            problem,
            variations,
            vary=vary,
            start=start,
            solver=solver,
            settings=settings,
            keep=keep,
            folder=folder,
            chunk=chunk,
            cluster=cluster,
            workers=workers,
            threads=threads,
            progress=progress,
        )
    ]
    if not parts:
        raise ValueError("variations: there are none")
    return joined(parts)


def sweep_chunks(
    problem: Problem,
    variations: ArrayLike | Iterable[Any],
    *,
    vary: Callable[[Problem, Any], Problem | None] | None = None,
    start: Solution | tuple[Any, Any] | None = None,
    solver: Solver = Fddp,
    settings: dict[str, Any] | None = None,
    keep: Sequence[Literal["xs", "us", "K", "k"]] = ("xs", "us"),
    folder: "str | PathLike[str] | None" = None,
    chunk: int = 64,
    cluster: bool | str | None = None,
    workers: int | None = None,
    threads: int = 1,
    progress: bool | Callable[[int, Any], object] = False,
) -> Iterator[Variations]:
    """Solves variations of a problem as `sweep` does, and yields the results of each chunk, in the order of the
    variations. Only a few chunks are in memory at a time, so millions of variations of an iterator can be solved.

    The arguments are the arguments of `sweep`. A chunk is solved when the caller asks for its results, with the problem
    and the variations as they are then. On a cluster,
    workers solve the next chunks meanwhile. With `folder`, each chunk is also written to a file, and finished chunks
    are read from the folder. An iterator must then yield the same variations in each call.

    Raises the exceptions of `sweep`, and exceptions of the iterator.

    >>> arm, rest = condyle.robots.arm7(), np.zeros(14)
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual
    >>> costs = [Cost("rest", 1.0, Residual.state(rest)), Cost("effort", 1e-3, Residual.control_gravity())]
    >>> problem = Problem(rest, [FreeDynamics(arm, 0.02, costs)], [0] * 20, FreeDynamics(arm, None, costs[:1]))
    >>> goals = (np.full(14, 0.001 * i) for i in range(100))  # a generator
    >>> chunks = condyle.sweep_chunks(problem, ({"references": {"rest": goal}} for goal in goals))
    >>> [len(found.cost) for found in chunks]
    [64, 36]
    """
    options, arrays, threads = checked(problem, solver, settings, keep, threads, progress)
    chunk = integer("chunk", chunk, 1)
    if vary is not None and not callable(vary):
        raise TypeError(f"vary: expected a function of a problem and a variation, found {described(vary)}")
    if not (cluster is None or isinstance(cluster, (bool, str))):
        raise TypeError(f"cluster: expected a bool or the address of a Ray cluster, found {described(cluster)}")
    if workers is not None:
        workers = integer("workers", workers, 1)
    items, count = _items(problem, variations, vary is not None)
    if count == 0:
        raise ValueError("variations: there are none")
    solver(problem, **options)  # raises the errors of the settings
    job = Job(problem, start_of(problem, start, solver, options), vary, solver, options, arrays, threads)
    record = None
    if folder is not None:
        from ._sweep_folder import Folder

        whole = None if count is None else items
        record = Folder.create(folder, job, whole, chunk, {"level": LEVEL, "version": __version__})
    return _chunks(job, items, count, chunk, record, cluster, workers, progress)


def _items(problem: Problem, variations: Any, varied: bool) -> tuple[Any, int | None]:
    """Returns a sequence of variations and their number, or an iterator and None."""
    expected = "variations" if varied else f"states (V, {problem.nx}), dicts of data, or an iterator over such"
    if variations is None or isinstance(variations, (Variations, Mapping, str, bytes, set, type)):
        raise TypeError(f"variations: expected {expected}, found {described(variations)}")
    is_sequence = hasattr(variations, "__len__") and hasattr(variations, "__getitem__")
    if not is_sequence:
        if not isinstance(variations, Iterable):
            raise TypeError(f"variations: expected {expected}, found {described(variations)}")
        return iter(variations), None
    if not varied and not (isinstance(variations, Sequence) and any(isinstance(item, Mapping) for item in variations)):
        variations = states_of(problem, variations, "variations") if len(variations) else variations
    return variations, len(variations)


def _chunks(
    job: Job, items: Any, count: int | None, chunk: int, record: Any, cluster: Any, workers: int | None, progress: Any
) -> Iterator[Variations]:
    """Yields the results of each chunk, in the order of the variations."""
    done: set[int] = record.done() if record is not None else set()
    before = 0 if count is None else sum(min(chunk, count - number * chunk) for number in done)
    report = counter(progress, count, before)
    finished: dict[int, Rows | None] = {}  # None stands for a chunk of the folder

    def missing() -> Iterator[tuple[int, int, Any]]:
        for number, part in enumerate(_parts(items, count, chunk)):
            if record is not None and count is None:
                record.compare(number, part)
            if number in done:
                finished[number] = None
                if count is None:
                    report(len(part))
            else:
                yield number, number * chunk, part

    next_number = 0

    def ready() -> Iterator[Variations]:
        nonlocal next_number
        while next_number in finished:
            rows = finished.pop(next_number)
            yield table(record.read(next_number) if rows is None else rows)
            next_number += 1

    try:
        for number, rows in _solved(job, missing(), cluster, workers):
            if record is not None:
                record.write(number, rows)
            finished[number] = rows
            report(len(rows["cost"]))
            yield from ready()
        yield from ready()
    finally:
        report(None)


def _parts(items: Any, count: int | None, chunk: int) -> Iterator[Any]:
    """Yields the variations of each chunk."""
    if count is not None:
        yield from (items[first : first + chunk] for first in range(0, count, chunk))
        return
    while part := list(islice(items, chunk)):
        yield part


def _solved(
    job: Job, missing: Iterator[tuple[int, int, Any]], cluster: bool | str | None, workers: int | None
) -> Iterator[tuple[int, Rows]]:
    """Yields the index and the rows of each finished chunk."""
    if not cluster:
        worker = Worker(job)
        for number, first, items in missing:
            yield number, worker.solve(first, items)
        return
    first_missing = next(missing, None)
    if first_missing is not None:
        from ._sweep_ray import on_cluster

        yield from on_cluster(job, chain([first_missing], missing), cluster, workers)


class Worker:
    """A worker, which solves chunks of variations. The worker uses a single solver as long as the problem is the
    same.
    """

    def __init__(self, job: Job) -> None:
        self._job = job
        self._same = None if job.vary else job.solver(job.problem, **job.settings)
        self._copies = True
        self._shapes: dict[str, tuple[int, ...]] = {}

    def solve(self, first: int, items: Any) -> Rows:
        """Returns the rows of the results for the variations `items`; `first` is the index of the first variation."""
        if self._copies:
            try:
                return self._together(first, items)
            except EXPECTED:
                self._copies = False  # for example an action in Python, which cannot be copied
        rows = empty_rows(self._job, len(items))
        for i, item in enumerate(items):
            try:
                _write(rows, i, self._one(item))
            except EXPECTED as wrong:
                rows["error"][i] = message(first + i, wrong)
        return rows

    def _together(self, first: int, items: Any) -> Rows:
        """Solves the variations that have data of the same kind in one call."""
        job = self._job
        if job.vary or isinstance(items, np.ndarray):
            states: dict[str, Any] = {} if job.vary else {"x0": np.ascontiguousarray(items)}
            rows, wrong = self._call(len(items), states, (job.vary, list(items)) if job.vary else None)
            rows["error"] = np.full(len(items), "", object)
            for i, raised in wrong:
                rows["error"][i] = message(first + i, raised)
            return rows
        rows = empty_rows(job, len(items))
        groups: dict[tuple[Any, ...], list[tuple[int, dict[tuple[str, str], Any]]]] = {}
        for i, item in enumerate(items):
            try:
                data = self._data(item)
                groups.setdefault(tuple(sorted(data)), []).append((i, data))
            except EXPECTED as error:
                rows["error"][i] = message(first + i, error)
        for keys, group in groups.items():
            stacked: dict[str, Any] = {argument: [] for argument in _KEYS[1:]}
            for argument, name in keys:
                numbers = np.concatenate([data[argument, name] for _, data in group])
                if argument == "x0":
                    stacked["x0"] = numbers
                else:
                    stacked[argument].append((name, numbers))
            found, wrong = self._call(len(group), stacked, None)
            indices = [i for i, _ in group]
            for name, column in found.items():
                rows[name][indices] = column
            for k, raised in wrong:
                rows["error"][indices[k]] = message(first + indices[k], raised)
        return rows

    def _call(self, count: int, data: dict[str, Any], vary: Any) -> tuple[Rows, list[tuple[int, BaseException]]]:
        job = self._job
        solver = self._same or job.solver(job.problem, **job.settings)
        found, wrong = _solve_many(solver, count, data, job.start, vary, list(job.keep), job.threads, None)
        return columns(job, found), wrong

    def _data(self, item: Any) -> dict[tuple[str, str], Any]:
        """Returns the data of a variation, which is a state or a dict, with an axis of length 1 in front."""
        problem = self._job.problem
        if not isinstance(item, Mapping):
            item = {"x0": item}
        unknown = [key for key in item if key not in _KEYS]
        if unknown:
            raise ValueError(f"expected data called {', '.join(_KEYS)}, found {unknown[0]!r}")
        data: dict[tuple[str, str], Any] = {}
        if "x0" in item:
            x0 = reals("x0", item["x0"], f"{problem.nx} numbers")
            if x0.shape != (problem.nx,):
                raise ValueError(f"x0: expected {problem.nx} numbers, found the shape {x0.shape}")
            data["x0", ""] = x0[None]
        rows = problem.horizon + 1
        for argument in _KEYS[1:]:
            given = item.get(argument) or {}
            if not isinstance(given, Mapping):
                raise TypeError(f"{argument}: expected a dict, found {described(given)}")
            for name, values in given.items():
                label = f"{argument}['{name}']"
                if argument == "contacts":
                    data[argument, name] = placements_of(label, values, ())
                    continue
                shape: tuple[int, ...] = ()
                if argument == "references":
                    if name not in self._shapes:
                        self._shapes[name] = problem.references(name)[0].shape
                    shape = self._shapes[name]
                data[argument, name] = by_knot(label, values, rows, shape, ())
        return data

    def _one(self, item: Any) -> Solution:
        job = self._job
        xs, us = job.start
        xs = np.array(xs, float)
        if self._same is not None:
            data = self._data(item)
            if data.keys() - {("x0", "")}:
                raise ValueError("expected actions that can be copied, for variations of references, weights, contacts")
            if data:
                job.problem.set_x0(data["x0", ""][0])
            xs[0] = job.problem.x0
            return self._same.solve(xs, us)
        assert job.vary is not None
        problem = job.vary(job.problem, item) or job.problem
        xs[0] = problem.x0
        return job.solver(problem, **job.settings).solve(xs, us)


def _write(rows: Rows, i: int, solution: Solution) -> None:
    """Writes a solution to row i."""
    rows["status"][i], rows["iterations"][i] = solution.status, len(solution.trace)
    rows["cost"][i], rows["gap"][i], rows["seconds"][i] = solution.cost, solution.gap, solution.timings.total
    for name in rows.keys() & {"xs", "us", "K", "k"}:
        rows[name][i] = flat(getattr(solution, name)).reshape(rows[name].shape[1:])
