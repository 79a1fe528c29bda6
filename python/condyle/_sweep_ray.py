"""Workers of a sweep on a Ray cluster."""

from collections import Counter, deque
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from ._condyle import LEVEL
from ._sweep import Job, Worker

_LOSSES = 3
"""Maximum number of lost workers per chunk. If more workers are lost, the chunk is taken as the cause, and the sweep
ends with an error.
"""


def on_cluster(
    job: Job, missing: list[tuple[int, int, Any]], address: str | None, workers: int | None
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yields the index and the rows of each finished chunk."""
    try:
        ray: Any = import_module("ray")
    except ImportError:
        raise ImportError("cluster: Ray is not installed (pip install condyle[ray])") from None
    ours = not ray.is_initialized()
    if ours:
        alone = {"include_dashboard": False} if address is None else {}
        ray.init(address=address, log_to_driver=False, **alone)
    try:
        count = workers or int(ray.cluster_resources().get("CPU", 1))
        yield from _shared(ray, job, missing, min(count, len(missing)))
    finally:
        if ours:
            ray.shutdown()


def _shared(
    ray: Any, job: Job, missing: list[tuple[int, int, Any]], count: int
) -> Iterator[tuple[int, dict[str, Any]]]:
    """Gives each worker one chunk at a time; if a worker is lost, a new worker gets the lost worker's chunk."""
    environment = {"env_vars": {"CONDYLE_LEVEL": LEVEL}}  # so that results are bit-identical to results of this process
    remote = ray.remote(num_cpus=1, max_restarts=0, runtime_env=environment)(Worker)
    shared = ray.put(job)
    chunks = {number: (first, items) for number, first, items in missing}
    waiting, losses = deque(chunks), Counter[int]()
    free = [remote.remote(shared) for _ in range(count)]
    busy: dict[Any, tuple[Any, int]] = {}
    while waiting or busy:
        while waiting and free:
            worker, number = free.pop(), waiting.popleft()
            busy[worker.solve.remote(*chunks[number])] = worker, number
        ready, _ = ray.wait(list(busy), timeout=0.1)  # a short timeout, so that signals are checked often
        for reference in ready:
            worker, number = busy.pop(reference)
            try:
                rows = ray.get(reference)
            except ray.exceptions.RayActorError as lost:
                if lost.actor_init_failed:
                    raise RuntimeError(f"cluster: a worker cannot begin: {lost}") from lost
                losses[number] += 1
                if losses[number] > _LOSSES:
                    raise RuntimeError(f"cluster: chunk {number} was lost with {_LOSSES + 1} workers: {lost}") from lost
                waiting.appendleft(number)
                worker = remote.remote(shared)
            else:
                yield number, rows
            free.append(worker)
