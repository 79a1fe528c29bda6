"""Batches with Pinocchio's interface: one column for each state."""

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle as ours
from ._spelling import Model

_Array = NDArray[np.float64]


def omp_get_max_threads() -> int:
    """Returns the number of threads that this machine can run at once."""
    return os.cpu_count() or 1


class ModelPool:
    """A model with scratch memory for several threads."""

    def __init__(self, model: Model, size: int | None = None) -> None:
        self._model = model
        self._data: dict[int, ours.Data] = {}

    def model(self) -> Model:
        """Returns the model of the pool."""
        return self._model

    def _of(self, threads: int) -> ours.Data:
        """Returns scratch memory for this number of threads, and keeps the memory for the next call."""
        if threads not in self._data:
            self._data[threads] = ours.Data(self._model.ours, threads=threads)
        return self._data[threads]


def rneaInParallel(
    num_thread: int, pool: ModelPool, q: ArrayLike, v: ArrayLike, a: ArrayLike, tau: _Array | None = None
) -> _Array | None:
    """Computes inverse dynamics τ for the state in each column, (nv, N). If `tau` is given, writes the result to
    `tau`.
    """
    return _columns(ours.rnea, num_thread, pool, (q, v, a), tau)


def abaInParallel(
    num_thread: int, pool: ModelPool, q: ArrayLike, v: ArrayLike, tau: ArrayLike, a: _Array | None = None
) -> _Array | None:
    """Computes forward dynamics q̈ for the state in each column, (nv, N). If `a` is given, writes the result to `a`."""
    return _columns(ours.aba, num_thread, pool, (q, v, tau), a)


def _columns(f: Any, threads: int, pool: ModelPool, states: Any, out: _Array | None) -> _Array | None:
    rows = (np.ascontiguousarray(np.asarray(x, float).T) for x in states)
    result: _Array = f(pool._model.ours, pool._of(threads), *rows).T
    if out is None:
        return result
    out[...] = result
    return None
