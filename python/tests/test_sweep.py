"""Tests of sweeps: the rows of a sweep equal the results of single solves, for any chunks, folders and processes."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle._variations import joined
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    Cost,
    Fddp,
    FreeDynamics,
    InteriorPoint,
    Limit,
    Lqr,
    Problem,
    Residual,
    solve_many,
)

ARM = condyle.robots.arm7()
REST = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
HORIZON = 12


def reach(arm: condyle.Model = ARM, limits: list[Limit] | None = None) -> Problem:
    rest, effort = Cost("rest", 0.1, Residual.state(REST)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))
    point = Cost("reach", 100.0, Residual.frame_translation(arm, "tool", [0.35, 0.2, 0.6]))
    knot = FreeDynamics(arm, 0.02, [rest, effort], limits=limits)
    return Problem(REST, [knot], [0] * HORIZON, FreeDynamics(arm, None, [rest, point]))


def states(count: int) -> np.ndarray:
    return np.random.default_rng(7).normal(REST, 0.02, (count, 14))


def assert_same(a: condyle.Variations, b: condyle.Variations) -> None:
    for name in a._fields:
        if name != "seconds":
            x, y = getattr(a, name), getattr(b, name)
            assert (x is None) == (y is None)
            assert x is None or np.array_equal(x, y, equal_nan=x.dtype.kind == "f"), name


def heavier(problem: Problem, times: int) -> Problem:
    return reach(ARM.with_inertias([sum([inertia] * (times - 1), inertia) for inertia in ARM.inertias]))


def aimed(problem: Problem, weight: float) -> None:
    problem.set_weight("reach", weight)


def test_rows_are_single_solves() -> None:
    nominal = Fddp(reach())
    xs = np.tile(REST, (HORIZON + 1, 1))
    start = nominal.solve(xs, reach().quasi_static(xs))
    x0s = states(5)
    found = condyle.sweep(reach(), x0s, keep=["xs", "us", "K", "k"])
    for i, x0 in enumerate(x0s):
        problem = reach()
        problem.set_x0(x0)
        begin = start.xs.copy()
        begin[0] = x0
        alone = Fddp(problem).solve(begin, start.us)
        assert found.status[i] == alone.status == "converged"
        assert found.iterations[i] == len(alone.trace)
        assert np.array_equal(found.xs[i, 0], x0)
        for name in ("cost", "xs", "us", "K", "k"):  # up to rounding: together, sweeps have another order of sums
            expected = np.array(getattr(alone, name))
            assert np.abs(getattr(found, name)[i] - expected).max() <= 1e-11 * (1.0 + np.abs(expected).max()), name
    assert not found.error.any()


@pytest.mark.parametrize("chunk", [1, 3, 100])
def test_chunks_do_not_matter(chunk: int) -> None:
    assert_same(condyle.sweep(reach(), states(7)), condyle.sweep(reach(), states(7), chunk=chunk))


def test_parameters_of_the_model_and_weights() -> None:
    found = condyle.sweep(reach(), [1, 2, 3], vary=heavier)
    assert (found.status == "converged").all()
    assert np.all(np.diff(found.cost) > 0.0)  # a heavier robot costs more to move
    for solver in (InteriorPoint, AugmentedLagrangian):
        start = Fddp(reach()).solve(np.tile(REST, (13, 1)), reach().quasi_static(np.tile(REST, (13, 1))))
        found = condyle.sweep(reach(), [1, 2, 3], vary=heavier, start=start, solver=solver)
        alone = solver(heavier(reach(), 3)).solve(start.xs, start.us)
        assert found.xs is not None and np.array_equal(found.xs[2], alone.xs)
    found = condyle.sweep(reach(), [1.0, 10.0, 100.0], vary=aimed, start=(np.tile(REST, (13, 1)), np.zeros((12, 7))))
    assert np.all(np.diff(found.cost) > 0.0)


def test_limits_and_settings() -> None:
    limit = Limit("effort", Residual.control(np.zeros(7)), [-30.0] * 7, [30.0] * 7)
    problem = reach(limits=[limit])
    for solver in (AugmentedLagrangian, InteriorPoint):
        found = condyle.sweep(problem, states(3), solver=solver)
        assert found.us is not None
        assert abs(found.us).max() < 30.0 + 1e-3
    short = condyle.sweep(reach(), states(3), settings={"max_iterations": 1, "tolerance": 0.0})
    assert (short.iterations == 1).all()
    assert (short.status == "max_iterations").all()


def test_an_error_is_a_row() -> None:
    x0s = states(4)
    x0s[2, 3] = np.nan
    found = condyle.sweep(reach(), x0s, chunk=2)
    assert found.status.tolist() == ["converged", "converged", "error", "converged"]
    assert found.error[2].startswith("variation 2: ProblemError: ")
    assert np.isnan(found.cost[2]) and np.isnan(found.xs[2]).all()
    assert not found.error[[0, 1, 3]].any()


def data(count: int) -> Iterator[dict[str, Any]]:
    """Yields variations of the initial state, a target, a weight, or several of them."""
    for i, (x0, goal) in enumerate(
        zip(states(count), np.linspace([0.3, 0.2, 0.6], [0.4, 0.1, 0.6], count), strict=True)
    ):
        every = {"x0": x0, "references": {"reach": goal}, "weights": {"rest": 0.1 + 0.01 * i}}
        yield {key: every[key] for key in (list(every), ["references"], ["x0", "weights"])[i % 3]}


@pytest.mark.parametrize("solver", [Fddp, InteriorPoint])
def test_variations_of_data_are_solutions_of_many_problems(solver: Any) -> None:
    start = np.tile(REST, (HORIZON + 1, 1)), reach().quasi_static(np.tile(REST, (HORIZON + 1, 1)))
    found = condyle.sweep(reach(), data(8), start=start, solver=solver, chunk=5)
    assert_same(found, condyle.sweep(reach(), list(data(8)), start=start, solver=solver, threads=2))
    for i, item in enumerate(data(8)):
        named = {
            key: {name: np.array([value]) for name, value in item.get(key, {}).items()}
            for key in ("references", "weights")
        }
        x0 = item.get("x0", REST)[None]
        alone = solve_many(reach(), x0, start=start, solver=solver, **named)
        assert np.array_equal(found.xs[i], alone.xs[0])  # type: ignore[index]


def test_wrong_data_fail_alone() -> None:
    items: list[Any] = [
        {"x0": REST},
        {"x0": REST[:3]},
        {"x1": REST},
        {"references": {"reach": [1.0, 2.0]}},
        {"references": {"goal": [1.0, 2.0, 3.0]}},
        {"weights": {"rest": -1.0}},
        {"weights": [1.0]},
        None,
        REST,
    ]
    found = condyle.sweep(reach(), items)
    assert found.status.tolist() == ["converged", *["error"] * 7, "converged"]
    for i, text in enumerate(
        (
            r"ValueError: x0: expected 14 numbers, found the shape (3,)",
            "ValueError: expected data called x0, references, weights, contacts, found 'x1'",
            "ValueError: references['reach']: expected (3,) or (13, 3) numbers, found the shape (2,)",
            "KeyError: \"no knot has a cost 'goal'\"",
            "ProblemError",
            "TypeError: weights: expected a dict, found a list",
            "TypeError: x0: expected 14 numbers, found None",
        ),
        1,
    ):
        assert found.error[i].startswith(f"variation {i}: {text}"), found.error[i]


def test_iterators_are_read_chunk_by_chunk() -> None:
    read = []

    def generate() -> Iterator[np.ndarray]:
        for x0 in states(7):
            read.append(x0)
            yield x0

    told: list[tuple[int, Any]] = []
    parts = condyle.sweep_chunks(reach(), generate(), chunk=3, progress=lambda done, total: told.append((done, total)))
    assert read == []
    assert len(next(parts).cost) == 3
    assert len(read) == 3
    rest = list(parts)
    assert [len(part.cost) for part in rest] == [3, 1]
    assert told == [(3, None), (6, None), (7, None)]
    assert_same(condyle.sweep(reach(), generate()), condyle.sweep(reach(), states(7)))
    assert_same(rest[1], condyle.sweep(reach(), states(7)[6:]))
    weights = [1.0, 10.0, 100.0]
    assert_same(condyle.sweep(reach(), iter(weights), vary=aimed), condyle.sweep(reach(), weights, vary=aimed))
    with pytest.raises(ValueError, match="variations: there are none"):
        condyle.sweep(reach(), iter(()))
    assert list(condyle.sweep_chunks(reach(), iter(()))) == []


def test_an_iterator_goes_on_in_its_folder(tmp_path: Path) -> None:
    parts = condyle.sweep_chunks(reach(), iter(states(7)), folder=tmp_path, chunk=2)
    first = [next(parts), next(parts)]
    del parts
    assert sorted(path.name for path in tmp_path.glob("chunk*")) == ["chunk-000000.npz", "chunk-000001.npz"]
    before = (tmp_path / "chunk-000000.npz").stat().st_mtime_ns
    again = list(condyle.sweep_chunks(reach(), iter(states(7)), folder=tmp_path, chunk=2))
    assert (tmp_path / "chunk-000000.npz").stat().st_mtime_ns == before
    for one, other in zip(first, again, strict=False):
        assert_same(one, other)
    assert_same(condyle.Variations.load(tmp_path), condyle.sweep(reach(), states(7)))
    assert [len(part.cost) for part in condyle.Variations.load_chunks(tmp_path)] == [2, 2, 2, 1]
    with pytest.raises(ValueError, match="holds other variations in chunk 0"):
        condyle.sweep(reach(), iter(states(7) + 0.1), folder=tmp_path, chunk=2)
    with pytest.raises(ValueError, match="differs in items"):
        condyle.sweep(reach(), states(7), folder=tmp_path, chunk=2)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the memory of a process on Linux")
def test_memory_does_not_grow() -> None:
    A, one = np.eye(2), np.ones((2, 1))
    knot = Lqr(A, one, Q=A, R=np.eye(1))
    problem = Problem(np.ones(2), [knot], [0] * 3, Lqr(A, Q=A))

    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    x0s = (np.array([0.001 * i, 1.0]) for i in range(20_000))
    solved, memory = 0, []
    for part in condyle.sweep_chunks(problem, x0s, keep=["xs", "us", "K"], chunk=200):
        solved += len(part.cost)
        assert (part.status == "converged").all()
        memory.append(resident())
    assert solved == 20_000
    # the results of all problems would take 20000 · 16 · 8 bytes = 2.5 MB and more
    assert memory[-1] - memory[20] < 2_000_000


def test_actions_in_python_are_solved_one_by_one() -> None:
    def integrate(_: int, x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, float]:
        return x + u.sum(), 0.5 * float(x @ x + u @ u)

    problem = Problem([1.0], [Action(1, 1, integrate)], [0] * 3, Action(1, 0, integrate))
    start = np.ones((4, 1)), np.zeros((3, 1))
    found = condyle.sweep(problem, [[1.0], [2.0]], start=start)
    assert found.status.tolist() == ["converged"] * 2
    assert found.cost[1] == pytest.approx(4.0 * found.cost[0])
    found = condyle.sweep(problem, iter([{"x0": [2.0]}, {"weights": {"rest": 1.0}}]), start=start)
    assert found.status.tolist() == ["converged", "error"]
    assert "actions that can be copied" in found.error[1]


@pytest.mark.parametrize(
    ("kind", "match", "arguments"),
    [
        (
            ValueError,
            r"variations: expected states, \(V, 14\), found the shape \(3, 7\)",
            {"variations": np.zeros((3, 7))},
        ),
        (ValueError, "variations: there are none", {"variations": np.zeros((0, 14))}),
        (ValueError, "variations: there are none", {"variations": []}),
        (
            TypeError,
            r"variations: expected states \(V, 14\), dicts of data, or an iterator .*, found None",
            {"variations": None},
        ),
        (TypeError, "variations: expected .*, found 3", {"variations": 3}),
        (TypeError, "variations: expected .*, found a dict", {"variations": {"x0": REST}}),
        (TypeError, "vary: expected a function .*, found 3", {"vary": 3}),
        (ValueError, "chunk: expected at least 1, found 0", {"chunk": 0}),
        (TypeError, "chunk: expected an integer, found '8'", {"chunk": "8"}),
        (ValueError, "workers: expected at least 1, found -1", {"workers": -1}),
        (TypeError, "cluster: expected a bool or the address .*, found 3", {"cluster": 3}),
        (TypeError, "folder: expected a path, found 3", {"folder": 3}),
        (TypeError, "threads: expected an integer, found None", {"threads": None}),
        (TypeError, "problem: expected a Problem, found None", {"problem": None}),
        (ValueError, "keep: expected some of", {"keep": ["x"]}),
        (TypeError, "start: expected a Solution, .*, found a Variations: solve_many takes", {"start": "variations"}),
    ],
)
def test_wrong_arguments_are_named(kind: type[Exception], match: str, arguments: dict[str, Any]) -> None:
    if arguments.get("start") == "variations":
        arguments = {"start": condyle.sweep(reach(), states(1))}
    with pytest.raises(kind, match=match):
        condyle.sweep(**{"problem": reach(), "variations": states(2), **arguments})


def test_progress() -> None:
    told: list[tuple[int, int]] = []
    condyle.sweep(reach(), states(5), chunk=2, progress=lambda done, total: told.append((done, total)))
    assert told == [(2, 5), (4, 5), (5, 5)]


def test_a_sweep_that_was_cut_off_goes_on(tmp_path: Path) -> None:
    folder = tmp_path / "sweep"

    def stop(done: int, total: int) -> None:
        if done >= 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        condyle.sweep(reach(), states(7), folder=folder, chunk=2, progress=stop)
    files = sorted(path.name for path in folder.iterdir())
    assert files == ["chunk-000000.npz", "chunk-000001.npz", "sweep.json"]
    assert len(condyle.Variations.load(folder).cost) == 4
    (folder / "chunk-000002.part").write_bytes(b"cut off while it was written")
    before = (folder / "chunk-000000.npz").stat().st_mtime_ns
    told: list[int] = []
    found = condyle.sweep(reach(), states(7), folder=folder, chunk=2, progress=lambda done, total: told.append(done))
    assert told == [6, 7]
    assert (folder / "chunk-000000.npz").stat().st_mtime_ns == before
    assert_same(found, condyle.sweep(reach(), states(7)))
    assert_same(found, condyle.Variations.load(folder))


def test_a_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    condyle.sweep(reach(), states(2), folder=tmp_path)
    with pytest.raises(ValueError, match=r"another sweep, which differs in items \(SHA-256\)"):
        condyle.sweep(reach(), states(2) + 0.1, folder=tmp_path)
    with pytest.raises(ValueError, match="differs in keep"):
        condyle.sweep(reach(), states(2), folder=tmp_path, keep=["xs"])
    with pytest.raises(ValueError, match="holds no sweep"):
        condyle.Variations.load(tmp_path / "elsewhere")


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"pip install condyle\[ray\]"):
        condyle.sweep(reach(), states(2), cluster=True)


@pytest.fixture(scope="module")
def ray() -> Iterator[Any]:
    """Starts a cluster with two workers on this machine."""
    ray = pytest.importorskip("ray")
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import this module
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    yield ray
    ray.shutdown()


def slow(problem: Problem, weight: float) -> None:
    time.sleep(0.05)
    problem.set_weight("reach", weight)


def once_fatal(problem: Problem, item: tuple[float, str]) -> None:
    """Ends the worker's process once, when a variation that requests this is computed for the first time."""
    weight, mark = item
    if mark and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    problem.set_weight("reach", weight)


def fatal(problem: Problem, item: float) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_workers_find_the_same_bits(ray: Any, tmp_path: Path) -> None:
    assert_same(condyle.sweep(reach(), states(9)), condyle.sweep(reach(), states(9), cluster=True, chunk=2))
    found = condyle.sweep(reach(), states(9), cluster=True, chunk=2, folder=tmp_path)
    assert_same(found, condyle.Variations.load(tmp_path))


def test_all_workers_work(ray: Any) -> None:
    told: list[int] = []
    weights = list(np.linspace(1.0, 2.0, 8))
    found = condyle.sweep(
        reach(), weights, vary=slow, cluster=True, chunk=1, workers=2, progress=lambda done, _: told.append(done)
    )
    assert told == list(range(1, 9))
    assert_same(found, condyle.sweep(reach(), weights, vary=aimed))


def test_a_lost_workers_share_is_done_again(ray: Any, tmp_path: Path) -> None:
    items = [(float(k + 1), str(tmp_path / "lost") if k == 3 else "") for k in range(6)]
    found = condyle.sweep(reach(), items, vary=once_fatal, cluster=True, chunk=2)
    assert (tmp_path / "lost").exists()  # a process has ended
    assert_same(found, condyle.sweep(reach(), [weight for weight, _ in items], vary=aimed))


def test_a_chunk_that_ends_every_worker_ends_the_sweep(ray: Any) -> None:
    with pytest.raises(RuntimeError, match="cluster: chunk 0 was lost with 4 workers"):
        condyle.sweep(reach(), [1.0], vary=fatal, start=(np.tile(REST, (13, 1)), np.zeros((12, 7))), cluster=True)


def test_a_cluster_reads_iterators(ray: Any) -> None:
    read = []

    def generate() -> Iterator[np.ndarray]:
        for x0 in states(40):
            read.append(len(read))
            yield x0

    parts = condyle.sweep_chunks(reach(), generate(), cluster=True, chunk=1, workers=2)
    first = next(parts)
    assert len(read) <= 1 + 2 + 4 * 2  # few chunks are ahead of the results
    assert_same(joined([first, *parts]), condyle.sweep(reach(), states(40)))


class Plans:
    """A function for datasets of Ray, which solves a batch of rows."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def __call__(self, rows: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        found = solve_many(self.problem, references={"reach": rows["goal"]}, keep=["us"])
        return {"goal": rows["goal"], "status": found.status, "cost": found.cost, "us": found.us}  # type: ignore[dict-item]


def test_datasets_of_ray_are_written_as_parquet(ray: Any, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    datasets = pytest.importorskip("ray.data")
    goals = np.random.default_rng(0).normal([0.35, 0.2, 0.6], 0.05, (20, 3))
    rows = datasets.from_items([{"goal": goal} for goal in goals])
    plans = rows.map_batches(Plans, fn_constructor_args=(reach(),), batch_size=8, concurrency=1)
    plans.write_parquet(str(tmp_path))
    read = datasets.read_parquet(str(tmp_path)).take_all()
    found = solve_many(reach(), references={"reach": goals}, keep=["us"])
    assert len(read) == 20
    for row in read:
        i = int(np.argmin(np.linalg.norm(goals - row["goal"], axis=1)))
        assert (row["status"], row["cost"]) == (found.status[i], found.cost[i])
        assert np.array_equal(row["us"], found.us[i])  # type: ignore[index]
