"""The five functions of an `Operation` with flat arguments, and the rules that differentiate `pull` and `push`.

PyTorch and JAX make a function of their own for each kind, whose arguments are one sequence of arrays. The rules call
these functions by `Functions`, and so are the same for both frameworks.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

from ._operations import Operation, Slot

Arrays = Sequence[Any]
Function = Callable[..., Arrays]
"""(operation, needed, *arrays) -> results."""


class Functions(NamedTuple):
    """One framework's functions for each kind except `value`."""

    pull: Function
    push: Function
    bend: Function
    curve: Function


def cut(operation: Operation, arrays: Arrays) -> tuple[Arrays, Arrays]:
    """Returns the arguments x of the operation, and the arrays after them."""
    n = len(operation.inputs)
    return arrays[:n], arrays[n:]


def cut_pull(operation: Operation, arrays: Arrays) -> tuple[Arrays, Arrays, Arrays]:
    """Returns x, the cotangents λ, and the results f(x) or nothing, from the arguments of `pull`."""
    x, more = cut(operation, arrays)
    m = len(operation.outputs)
    return x, more[:m], more[m:]


def cut_push(operation: Operation, arrays: Arrays) -> tuple[Arrays, Arrays, Arrays]:
    """Returns x, the tangents ẋ, and the results f(x) or nothing, from the arguments of `push`."""
    x, more = cut(operation, arrays)
    return x, *cut(operation, more)


def value(operation: Operation, needed: Any, *x: Any) -> Arrays:
    """Computes x -> f(x)."""
    return operation.value(*x)


def pull(operation: Operation, needed: Any, *arrays: Any) -> Arrays:
    """Computes (x, λ) -> Jᵀ λ, or (x, λ, f(x)) -> Jᵀ λ, which may take less time."""
    x, cotangents, known = cut_pull(operation, arrays)
    return operation.pull(x, cotangents, needed, known)


def push(operation: Operation, needed: Any, *arrays: Any) -> Arrays:
    """Computes (x, ẋ) -> J ẋ, or (x, ẋ, f(x)) -> J ẋ, which may take less time."""
    x, tangents, known = cut_push(operation, arrays)
    return operation.push(x, tangents, needed, known)


def bend(operation: Operation, needed: Any, *arrays: Any) -> Arrays:
    """Computes (x, λ, ẋ) -> H ẋ with the Hessian H of λᵀf."""
    x, cotangents, tangents = cut_pull(operation, arrays)
    return operation.bend(x, cotangents, tangents, needed)


def curve(operation: Operation, needed: Any, *arrays: Any) -> Arrays:
    """Computes (x, ẋ, ẏ) -> the second derivative of f along ẋ and ẏ."""
    x, a, b = cut_push(operation, arrays)
    return operation.curve(x, a, b)


def inputs(operation: Operation) -> Sequence[Slot]:
    """Returns the names and shapes of the results of `pull` and `bend`."""
    return operation.inputs


def outputs(operation: Operation) -> Sequence[Slot]:
    """Returns the names and shapes of the results of `value`, `push` and `curve`."""
    return operation.outputs


def pull_along(
    functions: Functions, operation: Operation, needed: Sequence[bool], arrays: Arrays, moved: Any, changed: Any
) -> Arrays | None:
    """Returns the derivative of pull(x, λ) along (ẋ, λ̇), which is bend(x, λ, ẋ) + pull(x, λ̇); None if it is zero.

    arrays: the arguments of `pull`; moved, changed: the tangents ẋ and λ̇ without symbols, or None for zeros.
    """
    first, second = partial(functions.pull, operation, needed), partial(functions.bend, operation, needed)
    return _along(first, second, operation, cut_pull(operation, arrays), moved, changed)


def push_along(
    functions: Functions, operation: Operation, needed: Sequence[bool], arrays: Arrays, moved: Any, changed: Any
) -> Arrays | None:
    """Returns the derivative of push(x, ẋ) along (ẏ, ẍ), which is curve(x, ẋ, ẏ) + push(x, ẍ); None if it is zero.

    arrays: the arguments of `push`; moved, changed: the tangents ẏ and ẍ without symbols, or None for zeros.
    """
    first, second = partial(functions.push, operation, needed), partial(functions.curve, operation, None)
    return _along(first, second, operation, cut_push(operation, arrays), moved, changed)


def _along(
    first: Any, second: Any, operation: Operation, parts: tuple[Arrays, Arrays, Arrays], moved: Any, changed: Any
) -> Arrays | None:
    """Returns second(x, λ, ẋ) + first(x, λ̇) for a function first(x, λ) that is linear in λ; None if it is zero."""
    x, factors, known = parts
    total = None if changed is None else first(*x, *changed, *known)
    if moved is None:
        return total
    if not operation.twice:
        raise operation.only_once()
    bent: Arrays = second(*x, *factors, *moved)
    return bent if total is None else _sum(total, bent)


def _sum(a: Arrays, b: Arrays) -> tuple[Any, ...]:
    return tuple(x + y for x, y in zip(a, b, strict=True))
