"""Optimality conditions of constrained problems, computed with NumPy and without a solver.

The Lagrangian of a problem with the costs ℓ, the dynamics φ and the constraints g is

    L = Σ ℓₜ(xₜ, uₜ) + yₜᵀ gₜ(xₜ, uₜ) + λₜ₊₁ᵀ (φₜ(xₜ, uₜ) ⊖ xₜ₊₁)

All derivatives are central differences of numbers that `Problem.evaluate` returns.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle.optimal import Evaluation, Outcome, Problem

_Array = NDArray[np.float64]

# Step of the differences. Richardson's extrapolation leaves an error of the fourth order, about 1e-12.
STEP = 1e-4
# `evaluate` adds ½ · 10 · e² for an entry that violates a limit by e.
PENALTY = 10.0


class Case(NamedTuple):
    """A problem with constraints, and the same constraints in NumPy."""

    problem: Problem
    xs: _Array
    us: Any
    free: Problem
    """The problem without its limits: with limits, `evaluate` adds costs of violated limits."""
    model: condyle.Model | None
    """The robot whose states are differentiated on their manifold; None for states in a vector space."""
    rows: Callable[[int, _Array, _Array, Evaluation], _Array]
    """The constraints of a knot t for x, u and an evaluation of all knots, in the order of the multipliers. The bounds
    on controls follow the limits.
    """
    bounds: Callable[[int], tuple[_Array, _Array]]
    """The lower and upper bounds of these rows."""
    kept: int = 0
    """The number of first rows of a knot that `free` has, too: equations of inverse dynamics are always limits."""


class Conditions(NamedTuple):
    """The residuals of the conditions of optimality: the largest absolute value of each kind."""

    gradient: float
    complementarity: float
    """Largest product of a multiplier and the distance from its bound."""
    violation: float
    gap: float
    scale: float
    """Factor by which large multipliers raise the tolerances of IPOPT (Wächter and Biegler 2006, equation 6)."""


def plus(model: condyle.Model | None, x: _Array, dx: _Array) -> _Array:
    """Returns x ⊕ δx."""
    if model is None:
        return x + dx
    nq, nv = model.nq, model.nv
    return np.r_[condyle.integrate(model, x[:nq], dx[:nv]), x[nq:] + dx[nv:]]


def minus(model: condyle.Model | None, x: _Array, base: _Array) -> _Array:
    """Returns x ⊖ base."""
    if model is None:
        return x - base
    nq = model.nq
    return np.r_[condyle.difference(model, base[:nq], x[:nq]), x[nq:] - base[nq:]]


def constraints(case: Case, xs: _Array, us: list[_Array], at: Evaluation | None = None) -> list[_Array]:
    """Returns the values of all rows of all knots."""
    at = at or case.free.evaluate(xs, us)
    none = np.zeros(0)
    return [case.rows(t, x, us[t] if t < len(us) else none, at) for t, x in enumerate(xs)]


def violation(case: Case, xs: _Array, us: Any) -> float:
    """Returns the largest distance of a row from its bounds. Rows of knot 0 that depend on the state alone count."""
    largest = 0.0
    for t, g in enumerate(constraints(case, np.array(xs), [np.array(u) for u in us])):
        lower, upper = case.bounds(t)
        largest = max(largest, float(np.max(np.maximum(lower - g, g - upper), initial=0.0)))
    return largest


def conditions(case: Case, solution: Any, outcome: Outcome) -> Conditions:
    """Returns the residuals of the conditions of optimality of a solution, with the multipliers of an outcome."""
    xs, us = np.array(solution.xs), [np.array(u) for u in solution.us]
    knots, ndx = len(us), case.problem.ndx

    def parts(xs: _Array, us: list[_Array]) -> tuple[_Array, _Array, list[_Array]]:
        at = case.free.evaluate(xs, us)
        g = constraints(case, xs, us, at)
        violated = np.array([0.5 * PENALTY * (row[: case.kept] ** 2).sum() for row in g[:-1]] + [0.0])
        return at.costs - violated, at.next_states, g

    here = parts(xs, us)
    y = outcome.multipliers
    assert [len(n) for n in y] == [len(g) for g in here[2]]

    def differences(move: Callable[[float], tuple[_Array, list[_Array]]]) -> tuple[_Array, list[_Array], _Array]:
        """Returns the derivatives of ℓ, φ and yᵀg of all knots along a direction."""
        both = []
        for step in (STEP, 2 * STEP):
            (c1, n1, g1), (c0, n0, g0) = parts(*move(step)), parts(*move(-step))
            slope = [minus(case.model, n1[t], here[1][t]) - minus(case.model, n0[t], here[1][t]) for t in range(knots)]
            held = [y[t] @ (g1[t] - g0[t]) for t in range(knots + 1)]
            both.append([np.array(part) / (2 * step) for part in (c1 - c0, slope, held)])
        return tuple((4 * a - b) / 3 for a, b in zip(*both, strict=True))

    def moved_states(j: int) -> Callable[[float], tuple[_Array, list[_Array]]]:
        def move(step: float) -> tuple[_Array, list[_Array]]:
            dx = np.zeros(ndx)
            dx[j] = step
            return np.array([plus(case.model, x, dx) for x in xs]), us

        return move

    def moved_controls(j: int) -> Callable[[float], tuple[_Array, list[_Array]]]:
        return lambda step: (xs, [u + step * (np.arange(len(u)) == j) for u in us])

    of_x = [differences(moved_states(j)) for j in range(ndx)]
    of_u = [differences(moved_controls(j)) for j in range(max(map(len, us)))]
    # λ_N = ∂ℓ + ∂(yᵀg), λₜ = ∂ℓ + ∂(yᵀg) + Aᵀ λₜ₊₁
    costate = np.array([cost[knots] + held[knots] for cost, _, held in of_x])
    gradient, total, count = 0.0, np.abs(costate).sum(), len(costate)
    for t in reversed(range(knots)):
        slopes = [cost[t] + held[t] + following[t] @ costate for cost, following, held in of_u[: len(us[t])]]
        gradient = max(gradient, np.max(np.abs(slopes), initial=0.0))
        costate = np.array([cost[t] + held[t] + following[t] @ costate for cost, following, held in of_x])
        total, count = total + np.abs(costate).sum(), count + len(costate)
    complementarity = 0.0
    for t, (g, n) in enumerate(zip(here[2], y, strict=True)):
        lower, upper = case.bounds(t)
        assert np.isfinite(upper[n > 0]).all() and np.isfinite(lower[n < 0]).all()
        unequal = lower != upper
        distance = np.where(n > 0, upper - g, g - lower)[unequal & (n != 0)]
        complementarity = max(complementarity, np.max(np.abs(n[unequal & (n != 0)] * distance), initial=0.0))
        total, count = total + np.abs(n).sum(), count + np.count_nonzero(n)
    gaps = case.problem.evaluate(xs, us).gaps
    return Conditions(
        gradient, complementarity, violation(case, xs, us), float(np.abs(gaps).max()), max(1.0, total / count / 100.0)
    )
