"""Tests that the garbage collector finds reference cycles through functions of the user."""

import gc
import weakref
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    AugmentedLagrangian,
    ConstrainedAction,
    Fddp,
    InteriorPoint,
    Problem,
    Sensitivities,
    Sensitivity,
)


class Marker:
    """An object that user functions of a reference cycle hold, to observe whether the cycle is collected."""


def action(calc: Any, calc_diff: Any = None) -> Action:
    return Action(1, 1, calc, calc_diff)


def constrained(calc: Any, calc_diff: Any = None) -> ConstrainedAction:
    return ConstrainedAction(Action(1, 1, step), 1, calc, calc_diff)


def problem(knot: Any) -> Problem:
    return Problem([1.0], [knot], [0] * 3, Action(1, 0, lambda t, x, u: (None, float(0.5 * x @ x))))


def step(_t: int, x: Any, u: Any) -> tuple[Any, float]:
    return x + u, 0.5 * float(x @ x + u @ u)


def solved(solver: type, knot: Any) -> Any:
    made = solver(problem(knot))
    made.solve(np.ones((4, 1)), np.zeros((3, 1)))
    return made


MAKERS: dict[str, Any] = {
    "Action, calc": lambda f, g: action(f),
    "Action, calc_diff": lambda f, g: action(step, f),
    "ConstrainedAction, calc": lambda f, g: constrained(g),
    "ConstrainedAction, calc_diff": lambda f, g: constrained(step, g),
    "ConstrainedAction, action": lambda f, g: ConstrainedAction(action(f), 1, lambda t, x, u: x),
    "Problem": lambda f, g: problem(action(f)),
    "Problem, constrained": lambda f, g: problem(ConstrainedAction(action(f), 1, g)),
    "Fddp": lambda f, g: solved(Fddp, action(f)),
    "Sensitivities": lambda f, g: Sensitivities([Sensitivity(solved(Fddp, action(f)), curvature="gauss_newton")]),
    "Sensitivity": lambda f, g: Sensitivity(solved(Fddp, action(f)), curvature="gauss_newton"),
    "AugmentedLagrangian": lambda f, g: solved(AugmentedLagrangian, ConstrainedAction(action(f), 1, g)),
    "InteriorPoint": lambda f, g: solved(InteriorPoint, ConstrainedAction(action(f), 1, g)),
}


@pytest.mark.parametrize("name", MAKERS)
def test_cycles_are_collected(name: str) -> None:
    def make() -> "weakref.ref[Marker]":
        marker = Marker()
        held: list[Any] = []

        def calc(t: int, x: Any, u: Any) -> tuple[Any, float]:
            assert marker is not None and held is not None
            return step(t, x, u)

        def constraint(_t: int, x: Any, _u: Any) -> Any:
            assert marker is not None and held is not None
            return x - 1e3 if x[0] > 1e3 else 0.0 * x

        held.append(MAKERS[name](calc, constraint))
        return weakref.ref(marker)

    gc.collect()
    marker = make()
    gc.collect()
    assert marker() is None


def test_what_is_in_use_is_not_collected() -> None:
    """Checks that a problem keeps the functions of its actions alive, and that a solver keeps its problem alive."""

    def make() -> tuple[Fddp, "weakref.ref[Marker]"]:
        marker = Marker()

        def calc(t: int, x: Any, u: Any) -> tuple[Any, float]:
            assert marker
            return step(t, x, u)

        return Fddp(problem(ConstrainedAction(action(calc), 1, lambda t, x, u: 0.0 * x))), weakref.ref(marker)

    solver, marker = make()
    gc.collect()
    assert marker() is not None
    assert solver.solve(np.ones((4, 1)), np.zeros((3, 1))).status == "converged"
    del solver
    gc.collect()
    assert marker() is None


def test_all_classes_that_hold_objects_are_seen() -> None:
    """Checks that all classes that hold Python objects take part in garbage collection."""
    simulation = condyle.simulation.Simulation(condyle.robots.arm7())
    knot = action(step)
    for holder in (knot, constrained(step), problem(knot), Fddp(problem(knot)), simulation):
        assert gc.is_tracked(holder), type(holder)
        assert gc.get_referents(holder), type(holder)
