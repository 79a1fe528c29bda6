"""Derivatives of a function of the state, by hyper-dual numbers. The Rust file `differentiate.rs` contains the same
methods.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import HyperDual, Model, integrate

Function = Callable[[NDArray[Any]], Any]


def _state(model: Model, x: ArrayLike) -> tuple[NDArray[np.float64], int]:
    """Returns the numbers of a state, and the number of directions in which the state can change."""
    numbers = np.asarray(x, dtype=np.float64)
    if numbers.ndim != 1 or len(numbers) < model.nq:
        raise ValueError(f"x: expected a vector of at least {model.nq} numbers, found shape {numbers.shape}")
    return numbers, len(numbers) - model.nq + model.nv


def _moved(model: Model, x: NDArray[np.float64], delta: NDArray[Any]) -> NDArray[Any]:
    """Returns x ⊕ δ as hyper-dual numbers with derivatives in the directions of δ."""
    q, others = x[: model.nq], x[model.nq :]
    return np.concatenate([integrate(model, q, delta[: model.nv]), others + delta[model.nv :]])


def _directions(n: int, first: int | None, second: int | None) -> NDArray[Any]:
    """Returns the change δ = 0 of n entries as hyper-dual numbers. Entry `first` has the infinitesimal part ε₁, entry
    `second` has ε₂.
    """
    return np.array([HyperDual(0.0, eps1=float(k == first), eps2=float(k == second)) for k in range(n)], dtype=object)


def _number(value: Any) -> HyperDual:
    return value if isinstance(value, HyperDual) else HyperDual(float(value))


def jacobian(model: Model, x: ArrayLike, f: Function) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Computes the value f(x), a vector of m numbers, and the exact Jacobian J = ∂f(x ⊕ δ)/∂δ, as `(value, J)`. J has m
    rows and nv + k columns, where k is the number of entries of x after the position.

    x: a position of nq numbers, then any other numbers; ⊕ is `integrate` for the position, and addition for the other
    numbers.
    f: a function that takes an array like x, of `HyperDual`s, and returns a vector. f is called once for every two
        directions.

    >>> arm = condyle.robots.arm7()
    >>> data = condyle.Data(arm)
    >>> p, J = condyle.jacobian(arm, [0.3] * 7, lambda q: condyle.frame_placement(arm, data, q, "tool")[:3, 3])
    >>> np.allclose(J, condyle.frame_jacobian(arm, data, [0.3] * 7, "tool", "local_world_aligned")[:3])
    True
    """
    numbers, n = _state(model, x)
    value, columns = np.empty(0), []
    for k in range(0, max(n, 1), 2):
        found = np.asarray(f(_moved(model, numbers, _directions(n, k, k + 1))), dtype=object)
        if found.ndim != 1:
            raise ValueError(f"f: expected a vector as its result, found shape {found.shape}")
        along = [_number(y) for y in found]
        value = np.array([y.re for y in along])
        columns += [[y.eps1 for y in along], [y.eps2 for y in along]]
    return value, np.array(columns[:n]).reshape(n, len(value)).T.copy()


def gradient(model: Model, x: ArrayLike, f: Function) -> tuple[float, NDArray[np.float64]]:
    """Computes the value f(x), a number, and the exact gradient ∂f(x ⊕ δ)/∂δ, as `(value, gradient)`. The gradient has
    nv + k numbers, where k is the number of entries of x after the position.

    x: as for `jacobian`. f returns a number, and is called once for every two directions.

    >>> arm = condyle.robots.arm7()
    >>> data = condyle.Data(arm)
    >>> height, slope = condyle.gradient(arm, [0.3] * 7, lambda q: condyle.potential_energy(arm, data, q))
    >>> np.allclose(slope, condyle.gravity(arm, data, [0.3] * 7))
    True
    """
    value, J = jacobian(model, x, lambda x: [f(x)])
    return float(value[0]), J[0]


def hessian(model: Model, x: ArrayLike, f: Function) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Computes the value f(x), and exact gradient and Hessian ∂²f(x ⊕ δ)/∂δ∂δ, as `(value, gradient, H)`.

    x: as for `jacobian`. f returns a number. f is called once for every pair of the n directions of δ, n (n + 1)/2
    times.

    >>> arm = condyle.robots.arm7()
    >>> data, q = condyle.Data(arm), [0.3] * 7
    >>> _, _, stiffness = condyle.hessian(arm, q, lambda q: condyle.potential_energy(arm, data, q))
    >>> np.allclose(stiffness, condyle.static_torque_derivative(arm, data, q))
    True
    """
    numbers, n = _state(model, x)
    value = _number(f(_moved(model, numbers, _directions(n, None, None)))).re
    slope, H = np.zeros(n), np.zeros((n, n))
    for j in range(n):
        for k in range(j + 1):
            along = _number(f(_moved(model, numbers, _directions(n, j, k))))
            slope[j], H[j, k], H[k, j] = along.eps1, along.eps1eps2, along.eps1eps2
    return value, slope, H
