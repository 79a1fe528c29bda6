"""Tests that results of functions and properties have the types in the stubs."""

import ast
import pkgutil
import types
import typing
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

import condyle
from condyle import _condyle, _inertia, _spelling, _types
from condyle.optimal import (
    AugmentedLagrangian,
    Fddp,
    FreeDynamics,
    FrictionCone,
    InteriorPoint,
    Outcome,
    Problem,
    Residual,
    Solution,
)
from condyle.simulation import Ground, Simulation

STUB = ast.parse(pkgutil.get_data("condyle", "_condyle.pyi") or b"")
ARM = condyle.robots.arm7()
Q, V = np.full(7, 0.3), np.full(7, 0.1)
INERTIA = condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))

# A value for each argument name of the functions, except for arguments with a default.
ARGUMENTS = {
    "model": ARM,
    "data": condyle.Data(ARM),
    "constraints": condyle.ConstraintSet(ARM, [condyle.ContactConstraint("tool", "point")]),
    **dict.fromkeys(["q", "q0", "q1"], Q),
    **dict.fromkeys(["v", "a", "tau", "lambda_", "d"], V),
    "X": np.eye(7),
    "t": 0.5,
    "frame": "tool",
    "point": np.zeros(3),
    "body": "joint3",
    "wrt": "gravity",
    "smoothing": 1e-3,
    "inertia": INERTIA,
    "pi": condyle.inertial_parameters.from_inertia(INERTIA),
    "theta": np.zeros(10),
}
# A value for each type of argument of the functions in `condyle.pinocchio`.
SPELLED = {"_SpelledModel": _spelling.Model(ARM), "_SpelledData": _spelling.Model(ARM).createData()}
SPELLED |= {"ReferenceFrame": _spelling.ReferenceFrame.WORLD, "str | int": "joint3", "int": 1}
_condyle.framesForwardKinematics(SPELLED["_SpelledModel"], SPELLED["_SpelledData"], Q)
_condyle.computeCentroidalMomentum(SPELLED["_SpelledModel"], SPELLED["_SpelledData"], Q, V)
_condyle.centerOfMass(SPELLED["_SpelledModel"], SPELLED["_SpelledData"], Q)
WORDS = {"integrate_jacobian": "position", "difference_jacobian": "from"}


def factor() -> condyle.Ltdl:
    made = condyle.Ltdl(ARM)
    made.factorize(np.eye(7))
    return made


# An object of each class that has properties.
PROBLEM = Problem(np.r_[Q, V], [FreeDynamics(ARM, 0.1, [])], [0], FreeDynamics(ARM, None, []))
ARGUMENTS |= {"problem": PROBLEM, "us": np.zeros((2, 1, 7))}
OBJECTS = {
    "Model": ARM,
    "ConstraintSet": ARGUMENTS["constraints"],
    "Ltdl": factor(),
    "DivideConquer": condyle.DivideConquer(ARM, 1),
    "Joint": condyle.Joint.prismatic([0.0, 0.0, 1.0]),
    "HyperDual": condyle.HyperDual(1.0),
    "Simulation": Simulation(ARM, ground=Ground(["tool"])),
    "Problem": PROBLEM,
    "_SpelledModel": SPELLED["_SpelledModel"],
    "_SpelledData": SPELLED["_SpelledData"],
}


def namespace() -> dict[str, Any]:
    """Returns the names that occur in the types of the stubs."""
    names: dict[str, Any] = {"np": np, "typing": typing} | vars(_types) | vars(_inertia) | vars(_condyle)
    names |= {name: getattr(_spelling, name) for name in ("Motion", "Force", "ReferenceFrame")}
    for node in STUB.body:
        if isinstance(node, ast.ImportFrom) and node.module in ("typing", "collections.abc", "numpy.typing"):
            exec(ast.unparse(node), names)
        if isinstance(node, ast.Import):
            exec(ast.unparse(node), names)
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value:
            names[node.target.id] = eval(ast.unparse(node.value), names)
    return names


NAMES = namespace()


def conforms(value: Any, kind: Any) -> bool:
    """Returns whether a value has a type."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any or kind is None:
        return kind is Any or value is None
    if kind == ArrayLike:
        return isinstance(value, np.ndarray)
    if origin in (typing.Union, types.UnionType):
        return any(conforms(value, part) for part in parts)
    if origin is Sequence:
        return isinstance(value, list) and all(conforms(item, parts[0]) for item in value)
    if origin is typing.Literal:
        return value in parts
    if origin is dict:
        return isinstance(value, dict) and all(
            conforms(k, parts[0]) and conforms(v, parts[1]) for k, v in value.items()
        )
    if origin is np.ndarray:
        return isinstance(value, np.ndarray) and value.dtype == typing.get_args(parts[1])[0]
    if origin is list:
        return isinstance(value, list) and all(conforms(item, parts[0]) for item in value)
    if origin is tuple and parts[-1] is Ellipsis:
        return isinstance(value, tuple) and all(conforms(item, parts[0]) for item in value)
    if origin is tuple:
        return len(value) == len(parts) and all(conforms(*pair) for pair in zip(value, parts, strict=True))
    if hasattr(kind, "_fields"):
        hints = typing.get_type_hints(kind, NAMES)
        members = [hints[name] for name in kind._fields]
        return type(value) is kind and all(conforms(*pair) for pair in zip(value, members, strict=True))
    return isinstance(value, kind)


def results() -> Iterator[Any]:
    """Yields each function of a model, and each property, with its result and its expected type."""
    for node in STUB.body:
        if isinstance(node, ast.FunctionDef) and node.returns and not node.name.startswith("_"):
            wanted = node.args.args[: len(node.args.args) - len(node.args.defaults)]
            kinds = SPELLED if "_SpelledModel" in ast.unparse(node.args) else {}
            given = [
                WORDS[node.name] if a.arg == "argument" else kinds.get(ast.unparse(a.annotation), ARGUMENTS.get(a.arg))
                for a in wanted
            ]
            yield pytest.param(getattr(_condyle, node.name)(*given), node.returns, id=node.name)
        if not isinstance(node, ast.ClassDef) or node.name not in OBJECTS:
            continue
        for item in node.body:
            if isinstance(item, ast.FunctionDef) and "property" in map(ast.unparse, item.decorator_list):
                value = getattr(OBJECTS[node.name], item.name)
                yield pytest.param(value, item.returns, id=f"{node.name}.{item.name}")


@pytest.mark.parametrize(("value", "kind"), list(results()))
def test_a_result_is_what_the_stubs_say(value: Any, kind: ast.expr) -> None:
    assert conforms(value, eval(ast.unparse(kind), NAMES))


def test_what_is_made_is_what_the_stubs_say() -> None:
    assert conforms(FrictionCone(0.5).bounds(), eval("tuple[_Array, _Array]", NAMES))
    warm_start = np.tile(np.r_[Q, V], (2, 1)), np.zeros((1, 7))
    solution = Fddp(PROBLEM).solve(*warm_start)
    assert conforms(solution, Solution)
    for solver in (AugmentedLagrangian(PROBLEM), InteriorPoint(PROBLEM)):
        solver.solve(*warm_start)
        assert conforms(solver.outcome, Outcome)
    assert conforms(solver.tick(), Solution)
    assert not conforms(solution, Outcome) and not conforms([1], eval("list[str]", NAMES))
    assert not conforms(Residual.control_gravity(), eval("_Array | None", NAMES))
