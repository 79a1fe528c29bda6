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
from condyle.optimal import AugmentedLagrangian, Cost, Fddp, FreeDynamics, InteriorPoint, Limit, Problem, Residual

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
        assert (found.cost[i], found.iterations[i]) == (alone.cost, len(alone.trace))
        assert np.array_equal(found.xs[i, 0], x0)
        for name in ("xs", "us", "K", "k"):
            assert np.array_equal(getattr(found, name)[i], getattr(alone, name)), name
    assert not found.error.any()


@pytest.mark.parametrize("chunk", [1, 3, 100])
def test_chunks_do_not_matter(chunk: int) -> None:
    assert_same(condyle.sweep(reach(), states(7)), condyle.sweep(reach(), states(7), chunk=chunk))


def test_parameters_of_the_model_and_weights() -> None:
    found = condyle.sweep(reach(), [1, 2, 3], vary=heavier)
    assert (found.status == "converged").all()
    assert np.all(np.diff(found.cost) > 0.0)  # a heavier robot costs more to move
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


def test_wrong_arguments_are_named() -> None:
    for match, arguments in (
        (r"variations: expected states, \(V, 14\), found the shape \(3, 7\)", {"variations": np.zeros((3, 7))}),
        ("variations: there are none", {"variations": np.zeros((0, 14))}),
        ("chunk: expected at least 1, found 0", {"chunk": 0}),
        ("keep: expected some of", {"keep": ["x"]}),
    ):
        with pytest.raises(ValueError, match=match):
            condyle.sweep(reach(), **{"variations": states(2), **arguments})


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
