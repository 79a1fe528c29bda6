"""Differentiable functions of a robot on NumPy arrays, from which `condyle.torch` and `condyle.jax` make operations.

An operation f has arguments x and results y. Four functions compute all that reverse and forward mode need, for many
states at once. J is the Jacobian of f, and H the Hessian of λᵀf for a fixed λ:

    value(x) = f(x),    pull(x, λ) = Jᵀ λ,    push(x, ẋ) = J ẋ,    bend(x, λ, ẋ) = H ẋ

The derivative of pull(x, λ) along (ẋ, λ̇) is bend(x, λ, ẋ) + pull(x, λ̇). H is symmetric, and so the same functions are
the transposes of this derivative. J and H are the library's exact derivatives in tangent spaces; `Coordinates` converts
them to derivatives with respect to the nq numbers of a position.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Data, Model
from ._coordinates import Coordinates

_Array = NDArray[np.float64]
Shape = tuple[int, ...]

CHUNK = 2**21
"""Size of a chunk's Jacobians in bytes; chosen because Jacobians then remain in the second-level cache."""


class Slot(NamedTuple):
    """An argument or a result of an operation."""

    name: str
    shape: Shape
    position: bool = False
    """Whether the numbers are a position, whose derivatives are converted between nq and nv numbers."""


class Scratch:
    """Memory for one call at a time: a `Data`, and arrays that the library's functions fill."""

    def __init__(self, model: Model, threads: int) -> None:
        self.data = Data(model, threads=threads)
        self._arrays: dict[str, list[_Array]] = {}

    def out(self, name: str, n: int, *shapes: Shape) -> tuple[_Array, ...]:
        """Returns arrays (n, *shape) with undefined contents. Later calls with the same name return the same memory."""
        arrays = self._arrays.get(name)
        if arrays is None or len(arrays[0]) < n:
            arrays = self._arrays[name] = [np.empty((n, *shape)) for shape in shapes]
        return tuple(array[:n] for array in arrays)


class Pool:
    """Scratch memory of one robot for calls from any number of threads."""

    def __init__(self, model: Model, threads: int) -> None:
        self.model, self.threads = model, threads
        self.coordinates = Coordinates(model)
        self._free: list[Scratch] = [Scratch(model, threads)]

    @contextmanager
    def scratch(self) -> Iterator[Scratch]:
        """Lends scratch memory to one call."""
        try:
            lent = self._free.pop()
        except IndexError:  # other threads use all of it
            lent = Scratch(self.model, self.threads)
        try:
            yield lent
        finally:
            self._free.append(lent)


Value = Callable[..., tuple[_Array, ...]]
"""(scratch, *x) -> y. Each array has one row for each state; positions are normalised."""
Jacobians = Callable[..., list[list[_Array | None]]]
"""(scratch, needed, *x) -> for each result and each argument ∂y/∂x, (N, m, n), in tangent spaces. A zero Jacobian is
None. None may also replace the Jacobian for an argument that is not in `needed`."""
Hessian = Callable[..., dict[tuple[int, int], _Array]]
"""(scratch, x, λ) -> the nonzero blocks ∂²(λᵀf)/∂xᵢ∂xⱼ, (N, nᵢ, nⱼ), each pair of arguments once."""


class Operation:
    """One differentiable function of one robot. Two operations are equal only if they are the same object."""

    def __init__(
        self,
        name: str,
        pool: Pool,
        inputs: Sequence[Slot],
        outputs: Sequence[Slot],
        value: Value,
        jacobians: Jacobians,
        hessian: Hessian | None = None,
    ) -> None:
        self.name, self.inputs, self.outputs = name, tuple(inputs), tuple(outputs)
        self._pool, self._value, self._jacobians, self._hessian = pool, value, jacobians, hessian
        rows = sum(math.prod(slot.shape) for slot in outputs)
        columns = sum(math.prod(slot.shape) for slot in inputs)
        self._chunk = max(16 * pool.threads, CHUNK // (8 * max(rows * columns, 1)))

    def __repr__(self) -> str:
        return f"<{self.name} of {self._pool.model.name!r}>"

    @property
    def twice(self) -> bool:
        """Whether exact second derivatives exist."""
        return self._hessian is not None

    def too_often(self) -> NotImplementedError:
        """Returns the error of a third differentiation."""
        return NotImplementedError(f"{self.name}: differentiated three times, but exact derivatives end at two")

    def only_once(self) -> NotImplementedError:
        """Returns the error of a second differentiation without exact second derivatives."""
        return NotImplementedError(
            f"{self.name}: differentiated twice, but the library has exact second derivatives only for rnea, aba, "
            "nonlinear_effects, gravity and energies, and for integrate and difference of a robot without quaternions "
            "and pairs (cos, sin)"
        )

    def value(self, *x: NDArray[Any]) -> list[_Array]:
        """Returns y = f(x). Each argument has the shape (*batch, *shape) with the same batch."""
        return self._chunks(x, (), lambda scratch, x, _: self._value(scratch, *self._unit(x)), self.outputs)

    def pull(
        self, x: Sequence[NDArray[Any]], cotangents: Sequence[NDArray[Any]], needed: Sequence[bool]
    ) -> list[_Array]:
        """Returns Jᵀ λ for each argument; zeros for arguments that are not needed."""

        def rows(scratch: Scratch, x: list[_Array], cotangents: list[_Array]) -> list[_Array]:
            unit = self._unit(x)
            slopes = self._slopes(scratch, unit, self._dropped(scratch, unit, cotangents), needed)
            return [self._lowered(slot, x, g) for slot, x, g in zip(self.inputs, x, slopes, strict=True)]

        return self._chunks(x, cotangents, rows, self.inputs)

    def push(self, x: Sequence[NDArray[Any]], tangents: Sequence[NDArray[Any]], needed: Sequence[bool]) -> list[_Array]:
        """Returns J ẋ for each result; tangents of arguments that are not needed count as zero."""

        def rows(scratch: Scratch, x: list[_Array], tangents: list[_Array]) -> list[_Array]:
            unit, along = self._unit(x), self._tangents(x, tangents)
            jacobians = self._jacobians(scratch, needed, *unit)
            values = (
                self._value(scratch, *unit) if any(slot.position for slot in self.outputs) else [None] * len(jacobians)
            )
            results = []
            for slot, y, row in zip(self.outputs, values, jacobians, strict=True):
                total = sum(_product(J, d) for J, d in zip(row, along, strict=True) if J is not None)
                if isinstance(total, int):
                    total = np.zeros((len(x[0]), math.prod(slot.shape)))
                results.append(self._pool.coordinates.lift(y, total) if slot.position and y is not None else total)
            return results

        return self._chunks(x, tangents, rows, self.outputs)

    def bend(
        self,
        x: Sequence[NDArray[Any]],
        cotangents: Sequence[NDArray[Any]],
        tangents: Sequence[NDArray[Any]],
        needed: Sequence[bool],
    ) -> list[_Array]:
        """Returns H ẋ for each argument, with the Hessian H of λᵀf; zeros for arguments that are not needed."""
        if self._hessian is None:
            raise self.only_once()
        hessian, count = self._hessian, len(cotangents)

        def rows(scratch: Scratch, x: list[_Array], both: list[_Array]) -> list[_Array]:
            unit, tangents = self._unit(x), both[count:]
            cotangents = self._dropped(scratch, unit, both[:count])
            along = self._tangents(x, tangents)
            sums: list[_Array] = [np.zeros_like(d) for d in along]
            for (i, j), block in hessian(scratch, unit, cotangents).items():
                sums[i] += _product(block, along[j])
                if i != j:
                    sums[j] += _transposed_product(block, along[i])
            results = [self._lowered(slot, x, s) for slot, x, s in zip(self.inputs, x, sums, strict=True)]
            curved = [slot.position and not self._pool.coordinates.flat for slot in self.inputs]
            if any(curved):  # q̂ depends on q nonlinearly
                slopes = self._slopes(scratch, unit, cotangents, curved)
                for k in np.flatnonzero(curved):
                    results[k] = results[k] + self._pool.coordinates.bend(x[k], slopes[k], tangents[k])
            return results

        zeros = np.zeros(())
        found = self._chunks(x, [*cotangents, *tangents], rows, self.inputs)
        return [f if n else np.broadcast_to(zeros, f.shape) for f, n in zip(found, needed, strict=True)]

    def curve(self, x: Sequence[NDArray[Any]], a: Sequence[NDArray[Any]], b: Sequence[NDArray[Any]]) -> list[_Array]:
        """Returns the second derivative of each result along a and b, with one call of `bend` for each number of f."""
        if self._hessian is None:
            raise self.only_once()
        batch = x[0].shape[: x[0].ndim - len(self.inputs[0].shape)]
        results = [np.zeros((*batch, *slot.shape)) for slot in self.outputs]
        for k, slot in enumerate(self.outputs):
            for index in np.ndindex(*slot.shape):
                weights = [np.zeros_like(y) for y in results]
                weights[k][(..., *index)] = 1.0
                bent = self.bend(x, weights, a, (True,) * len(x))
                products = [(h * d).reshape(*batch, -1).sum(-1) for h, d in zip(bent, b, strict=True)]
                results[k][(..., *index)] = sum(products)
        return results

    def _chunks(
        self,
        x: Sequence[NDArray[Any]],
        more: Sequence[NDArray[Any]],
        rows: Callable[[Scratch, list[_Array], list[_Array]], Sequence[_Array]],
        slots: Sequence[Slot],
    ) -> list[_Array]:
        """Calls `rows` for chunks of the states, with arrays (N, n), and returns its results with the batch's shape."""
        batch = x[0].shape[: x[0].ndim - len(self.inputs[0].shape)]
        n = math.prod(batch)
        matrices = [
            np.ascontiguousarray(a, np.float64).reshape(n, -1 if n else math.prod(a.shape[len(batch) :]))
            for a in (*x, *more)
        ]
        results = [np.empty((n, math.prod(slot.shape))) for slot in slots]
        with self._pool.scratch() as scratch:
            for at in range(0, n, self._chunk):
                part = [matrix[at : at + self._chunk] for matrix in matrices]
                for result, found in zip(results, rows(scratch, part[: len(x)], part[len(x) :]), strict=True):
                    result[at : at + self._chunk] = found.reshape(len(part[0]), -1)
        return [result.reshape(*batch, *slot.shape) for result, slot in zip(results, slots, strict=True)]

    def _unit(self, x: Sequence[_Array]) -> list[_Array]:
        """Returns the arguments in their shapes, with normalised positions."""
        pool = self._pool
        return [
            pool.coordinates.normalized(a) if slot.position else a.reshape(len(a), *slot.shape)
            for slot, a in zip(self.inputs, x, strict=True)
        ]

    def _tangents(self, x: Sequence[_Array], tangents: Sequence[_Array]) -> list[_Array]:
        push = self._pool.coordinates.push
        return [push(a, d) if slot.position else d for slot, a, d in zip(self.inputs, x, tangents, strict=True)]

    def _lowered(self, slot: Slot, x: _Array, g: _Array) -> _Array:
        return self._pool.coordinates.pull(x, g) if slot.position else g

    def _dropped(self, scratch: Scratch, unit: list[_Array], cotangents: list[_Array]) -> list[_Array]:
        """Returns the cotangents in the tangent spaces of results that are positions."""
        if self._pool.coordinates.flat or not any(slot.position for slot in self.outputs):
            return cotangents
        values, drop = self._value(scratch, *unit), self._pool.coordinates.drop
        return [drop(y, g) if slot.position else g for slot, y, g in zip(self.outputs, values, cotangents, strict=True)]

    def _slopes(
        self, scratch: Scratch, unit: list[_Array], cotangents: list[_Array], needed: Sequence[bool]
    ) -> list[_Array]:
        """Returns Jᵀ λ in tangent spaces."""
        coordinates, n = self._pool.coordinates, len(unit[0])
        sums: list[Any] = [None] * len(self.inputs)
        for row, cotangent in zip(self._jacobians(scratch, needed, *unit), cotangents, strict=True):
            for k, J in enumerate(row):
                if J is not None and needed[k]:
                    g = _transposed_product(J, cotangent)
                    sums[k] = g if sums[k] is None else sums[k] + g
        sizes = [coordinates.nv if slot.position else math.prod(slot.shape) for slot in self.inputs]
        return [np.zeros((n, size)) if g is None else g for g, size in zip(sums, sizes, strict=True)]


def _product(J: _Array, d: _Array) -> _Array:
    """Returns J d for each state."""
    product: _Array = np.matmul(J, d[:, :, None])[:, :, 0]
    return product


def _transposed_product(J: _Array, g: _Array) -> _Array:
    """Returns Jᵀ g for each state."""
    product: _Array = np.matmul(g[:, None, :], J)[:, 0]
    return product
