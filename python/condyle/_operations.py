"""Differentiable functions of a robot on NumPy arrays, from which `condyle.torch` and `condyle.jax` make operations.

An operation f has arguments x and results y. Four functions compute all that reverse and forward mode need, for many
states at once. J is the Jacobian of f, and H the Hessian of λᵀf for a fixed λ:

    value(x) = f(x),    pull(x, λ) = Jᵀ λ,    push(x, ẋ) = J ẋ,    bend(x, λ, ẋ) = H ẋ

The derivative of pull(x, λ) along (ẋ, λ̇) is bend(x, λ, ẋ) + pull(x, λ̇). H is symmetric, and so the same functions are
the transposes of this derivative. J and H are the library's exact derivatives in tangent spaces; `Coordinates` converts
them to derivatives with respect to the nq numbers of a position.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ._condyle import Data, Model
from ._coordinates import Coordinates

_Array = NDArray[np.float64]
Shape = tuple[int, ...]

CHUNK = 2**23
"""Size of a chunk's Jacobians in bytes; chosen because smaller chunks take up to 15 % more time (panda, TALOS)."""


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

    def take(self) -> Scratch:
        """Lends scratch memory to one call, which gives it back."""
        try:
            return self._free.pop()
        except IndexError:  # other threads use all of it
            return Scratch(self.model, self.threads)

    def give_back(self, scratch: Scratch) -> None:
        """Takes scratch memory back."""
        self._free.append(scratch)


Value = Callable[..., tuple[_Array, ...]]
"""(scratch, *x) -> y. Each array has one row for each state; positions are normalised."""
Jacobians = Callable[..., list[list["_Array | float | None"]]]
"""(scratch, needed, *x) -> for each result and each argument ∂y/∂x, (N, m, n), in tangent spaces. A number is this
multiple of the unit matrix, and a zero Jacobian is None. None may also replace the Jacobian for an argument that is not
in `needed`."""
Slopes = Callable[..., list["_Array | None"]]
"""(scratch, x, r) -> Jᵀ r for each argument, in tangent spaces, without Jacobians in memory; None for zeros. r is one
vector for each state, (N, m)."""
Solve = Callable[..., _Array]
"""(scratch, x, r) -> S r, (N, nv), with a symmetric matrix S for each state."""
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
        solve: Solve | None = None,
        slopes: Slopes | None = None,
    ) -> None:
        """Makes an operation. With `solve`, the Jacobians of the only result are S J instead of J, and `jacobians` and
        `slopes` take the result as the argument `y` if it is known. `slopes` may be given for a single result.
        """
        self.name, self.inputs, self.outputs = name, tuple(inputs), tuple(outputs)
        self._pool, self._value, self._jacobians = pool, value, jacobians
        self._hessian, self._solve, self._transposed = hessian, solve, slopes
        rows = sum(math.prod(slot.shape) for slot in outputs)
        columns = sum(math.prod(slot.shape) for slot in inputs)
        self._chunk = max(16 * pool.threads, CHUNK // (8 * max(rows * columns, 1)))

    def __repr__(self) -> str:
        return f"<{self.name} of {self._pool.model.name!r}>"

    @property
    def twice(self) -> bool:
        """Whether exact second derivatives exist."""
        return self._hessian is not None

    @property
    def reuses(self) -> bool:
        """Whether `pull` and `push` take less time if they get the results f(x)."""
        return self._solve is not None

    def _known(self, y: Sequence[NDArray[Any]]) -> Sequence[NDArray[Any]]:
        return y if self.reuses else ()

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

        def rows(scratch: Scratch, x: list[_Array], unit: list[_Array], _: list[_Array]) -> list[_Array]:
            return self._in_chunks(lambda x: self._value(scratch, *x), unit)

        return self._rows(x, (), rows, self.outputs)

    def pull(
        self,
        x: Sequence[NDArray[Any]],
        cotangents: Sequence[NDArray[Any]],
        needed: Sequence[bool],
        y: Sequence[NDArray[Any]] = (),
    ) -> list[_Array]:
        """Returns Jᵀ λ for each argument; zeros for arguments that are not needed. y may be the results f(x): some
        operations then take less time.
        """

        def rows(scratch: Scratch, x: list[_Array], unit: list[_Array], both: list[_Array]) -> list[_Array]:
            cotangents, known = both[:count], both[count:]
            slopes = self._slopes(scratch, unit, self._dropped(scratch, unit, cotangents), needed, known)
            return self._lowered(x, slopes)

        count, known = len(cotangents), self._known(y)
        return self._rows(x, [*cotangents, *known], rows, self.inputs)

    def push(
        self,
        x: Sequence[NDArray[Any]],
        tangents: Sequence[NDArray[Any]],
        needed: Sequence[bool],
        y: Sequence[NDArray[Any]] = (),
    ) -> list[_Array]:
        """Returns J ẋ for each result; tangents of arguments that are not needed count as zero. y: as for `pull`."""

        def rows(scratch: Scratch, x: list[_Array], unit: list[_Array], both: list[_Array]) -> list[_Array]:
            def products(x: list[_Array], along: list[_Array], known: list[_Array]) -> list[_Array]:
                options = {"y": known[0]} if known else {}
                sums = [np.zeros((len(x[0]), self._size(slot))) for slot in self.outputs]
                for total, row in zip(sums, self._jacobians(scratch, needed, *x, **options), strict=True):
                    for J, d, flag in zip(row, along, needed, strict=True):
                        if J is not None and flag:
                            total += _product(J, d)
                return sums if self._solve is None else [self._solve(scratch, x, sums[0])]

            tangents, known = both[:count], both[count:]
            found = self._in_chunks(products, unit, self._tangents(x, tangents), known)
            if self._flat_results:
                return found
            values, lift = self._value(scratch, *unit), self._pool.coordinates.lift
            return [lift(y, d) if slot.position else d for slot, y, d in zip(self.outputs, values, found, strict=True)]

        count, known = len(tangents), self._known(y)
        return self._rows(x, [*tangents, *known], rows, self.outputs)

    def bend(
        self,
        x: Sequence[NDArray[Any]],
        cotangents: Sequence[NDArray[Any]],
        tangents: Sequence[NDArray[Any]],
        needed: Sequence[bool],
    ) -> list[_Array]:
        """Returns H ẋ for each argument, with the Hessian H of λᵀf. Arguments that are not needed may have zeros."""
        if self._hessian is None:
            raise self.only_once()
        hessian, count, coordinates = self._hessian, len(cotangents), self._pool.coordinates

        def rows(scratch: Scratch, x: list[_Array], unit: list[_Array], both: list[_Array]) -> list[_Array]:
            def products(x: list[_Array], cotangents: list[_Array], along: list[_Array]) -> list[_Array]:
                sums = [np.zeros_like(d) for d in along]
                for (i, j), block in hessian(scratch, x, cotangents).items():
                    sums[i] += _product(block, along[j])
                    if i != j:
                        sums[j] += _transposed_product(block, along[i])
                return sums

            cotangents, tangents = self._dropped(scratch, unit, both[:count]), both[count:]
            found = self._in_chunks(products, unit, cotangents, self._tangents(x, tangents))
            results = self._lowered(x, found)
            curved = [slot.position and not coordinates.flat and n for slot, n in zip(self.inputs, needed, strict=True)]
            if any(curved):  # q̂ depends on q nonlinearly
                slopes = self._slopes(scratch, unit, cotangents, curved)
                for k in np.flatnonzero(curved):
                    results[k] = results[k] + coordinates.bend(x[k], slopes[k], tangents[k])
            return results

        return self._rows(x, [*cotangents, *tangents], rows, self.inputs)

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

    def _rows(
        self,
        x: Sequence[NDArray[Any]],
        more: Sequence[NDArray[Any]],
        compute: Callable[[Scratch, list[_Array], list[_Array], list[_Array]], Sequence[_Array]],
        slots: Sequence[Slot],
    ) -> list[_Array]:
        """Calls `compute(scratch, x, x with normalised positions, more)` with arrays of one row for each state. Returns
        the results with the batch's shape.
        """
        batch = x[0].shape[: x[0].ndim - len(self.inputs[0].shape)]
        n = math.prod(batch)
        if n == 0:
            return [np.zeros((*batch, *slot.shape)) for slot in slots]
        matrices = [np.ascontiguousarray(a, np.float64).reshape(n, -1) for a in (*x, *more)]
        rows, normalized = matrices[: len(x)], self._pool.coordinates.normalized
        unit = [
            normalized(a) if slot.position else a.reshape(n, *slot.shape)
            for slot, a in zip(self.inputs, rows, strict=True)
        ]
        scratch = self._pool.take()
        try:
            results = compute(scratch, rows, unit, matrices[len(x) :])
        finally:
            self._pool.give_back(scratch)
        return [result.reshape((*batch, *slot.shape)) for result, slot in zip(results, slots, strict=True)]

    def _in_chunks(self, compute: Callable[..., Sequence[_Array]], *groups: list[_Array]) -> list[_Array]:
        """Calls `compute(*groups)` for chunks of the states, and returns the results of all states."""
        n, chunk = len(groups[0][0]), self._chunk
        if n <= chunk:
            return [*compute(*groups)]
        starts = range(0, n, chunk)
        parts = [compute(*[[a[at : at + chunk] for a in group] for group in groups]) for at in starts]
        return [np.concatenate(part) for part in zip(*parts, strict=True)]

    def _size(self, slot: Slot) -> int:
        """Returns the number of derivatives for a slot: a position has nv."""
        return self._pool.coordinates.nv if slot.position else math.prod(slot.shape)

    @property
    def _flat_results(self) -> bool:
        return self._pool.coordinates.flat or not any(slot.position for slot in self.outputs)

    def _tangents(self, x: Sequence[_Array], tangents: Sequence[_Array]) -> list[_Array]:
        push = self._pool.coordinates.push
        return [push(a, d) if slot.position else d for slot, a, d in zip(self.inputs, x, tangents, strict=True)]

    def _lowered(self, x: Sequence[_Array], slopes: Sequence[_Array]) -> list[_Array]:
        pull = self._pool.coordinates.pull
        return [pull(a, g) if slot.position else g for slot, a, g in zip(self.inputs, x, slopes, strict=True)]

    def _dropped(self, scratch: Scratch, unit: list[_Array], cotangents: list[_Array]) -> list[_Array]:
        """Returns the cotangents in the tangent spaces of results that are positions."""
        if self._flat_results:
            return cotangents
        values, drop = self._value(scratch, *unit), self._pool.coordinates.drop
        return [drop(y, g) if slot.position else g for slot, y, g in zip(self.outputs, values, cotangents, strict=True)]

    def _slopes(
        self,
        scratch: Scratch,
        unit: list[_Array],
        cotangents: list[_Array],
        needed: Sequence[bool],
        known: Sequence[_Array] = (),
    ) -> list[_Array]:
        """Returns Jᵀ λ in tangent spaces; `known` is the result of an operation with `solve`, or empty."""

        def filled(slopes: Sequence[_Array | None], n: int) -> list[_Array]:
            return [
                np.zeros((n, self._size(slot))) if g is None else g for g, slot in zip(slopes, self.inputs, strict=True)
            ]

        def products(x: list[_Array], cotangents: list[_Array], known: list[_Array]) -> list[_Array]:
            options = {"y": known[0]} if known else {}
            sums: list[_Array | None] = [None] * len(self.inputs)
            if self._solve is not None:
                cotangents = [self._solve(scratch, x, cotangents[0])]
            for row, cotangent in zip(self._jacobians(scratch, needed, *x, **options), cotangents, strict=True):
                for k, J in enumerate(row):
                    if J is not None and needed[k]:
                        g, before = _transposed_product(J, cotangent), sums[k]
                        sums[k] = g if before is None else before + g
            return filled(sums, len(x[0]))

        if self._transposed is not None:
            options = {"y": known[0]} if known else {}
            r = cotangents[0] if self._solve is None else self._solve(scratch, unit, cotangents[0])
            return filled(self._transposed(scratch, unit, r, **options), len(unit[0]))
        return self._in_chunks(products, unit, cotangents, list(known))


def _product(J: _Array | float, d: _Array) -> _Array:
    """Returns J d for each state."""
    if isinstance(J, float):
        return J * d
    product: _Array = np.matmul(J, d[:, :, None])[:, :, 0]
    return product


def _transposed_product(J: _Array | float, g: _Array) -> _Array:
    """Returns Jᵀ g for each state."""
    if isinstance(J, float):
        return J * g
    product: _Array = np.matmul(g[:, None, :], J)[:, 0]
    return product
