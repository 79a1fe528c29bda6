"""Workers of a sweep on a Ray cluster."""

from collections import Counter, deque
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from ._condyle import LEVEL
from ._sweep import Worker
from ._variations import Job

_AHEAD = 4
"""Maximum number of chunks for each worker between the oldest unfinished chunk and the newest one."""

_LOSSES = 3
"""Maximum number of lost workers per chunk. If more workers are lost, the chunk is taken as the cause, and the sweep
ends with an error.
"""


def on_cluster(
    job: Job, missing: Iterator[tuple[int, int, Any]], address: bool | str, workers: int | None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yields the index and the rows of each finished chunk."""
    try:
        ray: Any = import_module("ray")
    except ImportError:
        raise ImportError("cluster: Ray is not installed (pip install condyle[ray])") from None
    ours = not ray.is_initialized()
    if ours:
        here = address is True
        alone = {"include_dashboard": False} if here else {}
        ray.init(address=None if here else address, log_to_driver=False, **alone)
    try:
        count = workers or int(ray.cluster_resources().get("CPU", 1))
        yield from _shared(ray, job, missing, count)
    finally:
        if ours:
            ray.shutdown()


def _shared(
    ray: Any, job: Job, missing: Iterator[tuple[int, int, Any]], count: int
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Gives each worker one chunk at a time; if a worker is lost, a new worker gets the lost worker's chunk."""
    environment = {"env_vars": {"CONDYLE_LEVEL": LEVEL}}  # so that results are bit-identical to results of this process
    remote = ray.remote(num_cpus=1, max_restarts=0, runtime_env=environment)(Worker)
    shared = ray.put(job)
    waiting: deque[tuple[int, int, Any]] = deque()  # chunks of lost workers
    free: list[Any] = []
    busy: dict[Any, tuple[Any, tuple[int, int, Any]]] = {}
    losses = Counter[int]()
    newest, ended = -1, False
    while True:
        while len(busy) < count:
            oldest = min((chunk[0] for _, chunk in busy.values()), default=newest)
            if not waiting and not ended and newest - oldest < _AHEAD * count:
                following = next(missing, None)
                ended = following is None
                if following is not None:
                    waiting.append(following)
                    newest = following[0]
            if not waiting:
                break
            worker = free.pop() if free else remote.remote(shared)
            chunk = waiting.popleft()
            busy[worker.solve.remote(*chunk[1:])] = worker, chunk
        if not busy:
            return
        ready, _ = ray.wait(list(busy), timeout=0.1)  # a short timeout, so that signals are checked often
        for reference in ready:
            worker, chunk = busy.pop(reference)
            number = chunk[0]
            try:
                rows = ray.get(reference)
            except ray.exceptions.RayActorError as lost:
                if lost.actor_init_failed:
                    raise RuntimeError(f"cluster: a worker cannot begin: {lost}") from lost
                losses[number] += 1
                if losses[number] > _LOSSES:
                    raise RuntimeError(f"cluster: chunk {number} was lost with {_LOSSES + 1} workers: {lost}") from lost
                waiting.appendleft(chunk)
            else:
                free.append(worker)
                yield number, rows
