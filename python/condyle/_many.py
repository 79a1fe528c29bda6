"""Solves many problems of one shape that differ in data: in SIMD lanes, or one by one on each thread."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._arguments import described, named, reals
from ._condyle import Fddp, Problem, _solve_many
from ._report import counter
from ._sweep import sweep
from ._types import Solution
from ._variations import (
    Job,
    Solver,
    Variations,
    by_knot,
    checked,
    columns,
    message,
    placements_of,
    start_of,
    states_of,
    table,
)

_Array = NDArray[np.float64]


def solve_many(
    problem: Problem,
    x0: ArrayLike | Iterator[Any] | None = None,
    *,
    references: dict[str, ArrayLike] | None = None,
    weights: dict[str, ArrayLike] | None = None,
    contacts: dict[str, ArrayLike] | None = None,
    start: Solution | Variations | tuple[Any, Any] | None = None,
    solver: Solver = Fddp,
    settings: dict[str, Any] | None = None,
    keep: Sequence[Literal["xs", "us", "K", "k"]] = ("xs", "us"),
    threads: int = 1,
    progress: bool | Callable[[int, Any], object] = False,
) -> Variations:
    """Solves many problems of one shape. With `Fddp`, several problems are solved at a time in SIMD lanes.

    Each problem has its own step lengths, regularisation and convergence. The result of a problem does not depend on
    the other problems, to the bit. It may differ by rounding from the result of `Fddp` alone.

    As in `Fddp`, bounds on controls hold, but limits of knots only add costs, which do not enforce them. For problems
    with limits, use the solver `InteriorPoint` or `AugmentedLagrangian`. Each thread then solves one problem after the
    other, with the result of a single solve, to the bit; lanes compute several knots of one problem.

    problem: the nominal problem. It is copied, and not changed.
    x0: the initial states, (V, nx); or one initial state for all problems, nx numbers; None takes the problem's. Or an
        iterator over states or dicts of data, as `variations` in `sweep`, which is read chunk by chunk. References,
        weights, contacts, starts of each problem, and a time budget are then not possible.
    references: for names of costs, the targets of each problem, (V, N + 1, n), with rows as in
        `Problem.set_references`; or (V, n), one target for all knots of a problem.
    weights: for names of costs, the weights of each problem, (V, N + 1), or (V,), one weight for all knots.
    contacts: for names of contacts, where the contact holds its frame in each problem: positions (V, 3) or placements
        (V, 4, 4), as `placement` of `Problem.set_contact`. They have an effect only where the gain kp is not 0.
    start: states and controls from which all solves start, or a `Solution`; or a start for each problem: states
        (V, N + 1, nx) and controls (V, N, nu), or the `Variations` of an earlier call. None solves the nominal problem
        from rest, and starts from its solution. The first state is replaced by the initial state of each problem.
    solver: `Fddp`, `InteriorPoint` or `AugmentedLagrangian`.
    settings: the settings of the solver. Its `time_budget` limits the whole call: problems that are being solved then
        end with the status "time_limit", and the others with "not_started".
    keep: the arrays of each solution to keep.
    threads: the number of threads, each of which solves its own problems.
    progress: as in `sweep`.

    Returns `Variations`. The error of a problem is stored in its row, and does not affect the others. For more results
    than fit into memory, use `condyle.sweep_chunks`; for variations that change the model, use `condyle.sweep`.

    Raises TypeError or ValueError for invalid arguments, KeyError for a cost or contact that no knot has, and
    `ProblemError` for an `Action` in Python, which cannot be copied.

    >>> arm, rest = condyle.robots.arm7(), np.zeros(14)
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual, solve_many
    >>> costs = [Cost("rest", 1.0, Residual.state(rest)), Cost("effort", 1e-3, Residual.control_gravity())]
    >>> problem = Problem(rest, [FreeDynamics(arm, 0.02, costs)], [0] * 20, FreeDynamics(arm, None, costs[:1]))
    >>> goals = np.random.default_rng(1).normal(rest, 0.05, (100, 14))
    >>> found = solve_many(problem, references={"rest": goals}, keep=["us", "K"])
    >>> set(found.status.tolist()), found.us.shape, found.K.shape
    ({'converged'}, (100, 20, 7), (100, 20, 7, 14))
    """
    options, arrays, threads = checked(problem, solver, settings, keep, threads, progress)
    if isinstance(x0, Iterator):
        others = {"references": references, "weights": weights, "contacts": contacts}
        others["settings['time_budget']"] = options.get("time_budget")
        given = [name for name, value in others.items() if value is not None]
        if isinstance(start, Variations):
            raise ValueError("start: expected one start for all problems of an iterator x0, found Variations")
        if given:
            raise ValueError(f"{given[0]}: expected None with an iterator x0, whose items may be dicts of data")
        return sweep(
            problem, x0, start=start, solver=solver, settings=options, keep=keep, threads=threads, progress=progress
        )
    data, counts = _data(problem, x0, references, weights, contacts)
    each, starts = _starts(problem, start)
    if each is not None:
        counts["start"] = len(each[0])
        data["xs"], data["us"] = each
    if not counts:
        raise ValueError("x0: expected the states of several problems, (V, nx), if nothing else differs")
    count = next(iter(counts.values()))
    if set(counts.values()) != {count}:
        raise ValueError(f"expected one number of problems, found {', '.join(f'{k}: {v}' for k, v in counts.items())}")
    if "x0" in data:
        data["x0"] = np.ascontiguousarray(np.broadcast_to(data["x0"], (count, problem.nx)))
    nominal = {name: value for name, value in options.items() if name != "time_budget"}
    begin = starts if each is not None else start_of(problem, starts, solver, nominal)
    job = Job(problem, begin, None, solver, options, arrays, threads)
    report = counter(progress, count, 0)
    told = [0]

    def tell(ended: int) -> None:
        report(ended - told[0])
        told[0] = ended

    try:
        made = solver(problem, **options)
        found, wrong = _solve_many(
            made,
            count,
            data,
            None if each is not None else job.start,
            None,
            list(arrays),
            threads,
            tell if progress else None,
            True,
        )
        if progress:
            tell(count)
        if count and len(wrong) == count and all(isinstance(error, KeyError) for _, error in wrong):
            raise wrong[0][1]
    finally:
        report(None)
    rows = columns(job, found)
    rows["error"] = np.full(count, "", object)
    for i, error in wrong:
        rows["error"][i] = message(i, error)
    rows["status"][rows["status"] == ""] = "not_started"
    return table(rows)


def _data(
    problem: Problem, x0: Any, references: Any, weights: Any, contacts: Any
) -> tuple[dict[str, Any], dict[str, int]]:
    """Returns the numbers in which problems differ, and the number of problems by each argument."""
    rows = problem.horizon + 1
    targets = [
        (name, by_knot(f"references['{name}']", values, rows, problem.references(name)[0].shape))
        for name, values in named("references", references, "targets").items()
    ]
    scales = [
        (name, by_knot(f"weights['{name}']", values, rows, ()))
        for name, values in named("weights", weights, "weights").items()
    ]
    places = [
        (name, placements_of(f"contacts['{name}']", values))
        for name, values in named("contacts", contacts, "placements").items()
    ]
    data: dict[str, Any] = {"references": targets, "weights": scales, "contacts": places}
    counts = {
        f"{argument}['{name}']": len(values)
        for argument in ("references", "weights", "contacts")
        for name, values in data[argument]
    }
    if x0 is not None:
        data["x0"] = reals("x0", x0, f"states, (V, {problem.nx}) or {problem.nx} numbers")
        if data["x0"].shape != (problem.nx,):
            counts["x0"] = len(states_of(problem, x0, "x0"))
    return data, counts


def _starts(problem: Problem, start: Any) -> tuple[tuple[_Array, _Array] | None, Any]:
    """Returns the starts of each problem, and the nominal start. The starts of each problem are None if all problems
    have the nominal one.
    """
    if isinstance(start, Variations):
        if start.xs is None or start.us is None:
            raise ValueError("start: expected Variations with xs and us, found Variations without (see `keep`)")
        start = (start.xs, start.us)
    elif isinstance(start, Solution) or not (isinstance(start, (tuple, list)) and len(start) == 2):
        return None, start
    xs, us = start
    if np.ndim(xs) != 3:
        return None, start
    wanted = (problem.horizon + 1, problem.nx)
    states, controls = reals("start: xs", xs), reals("start: us", us)
    if states.shape[1:] != wanted:
        raise ValueError(f"start: expected states of the shape {('V', *wanted)}, found {described(states)}")
    if controls.ndim < 2 or len(controls) != len(states):
        raise ValueError(
            f"start: expected controls of {len(states)} problems, as of the states, found {described(controls)}"
        )
    flat = controls.reshape(len(controls), -1)
    still = (np.tile(problem.x0, (wanted[0], 1)), np.zeros(controls.shape[1:]))
    return (np.ascontiguousarray(states.reshape(len(states), -1)), np.ascontiguousarray(flat)), still
