"""Tests generated code for robots of example-robot-data. The tests compare the code with Pinocchio and with the
library, and call it by CasADi's `external`."""

import itertools
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import casadi
import numpy as np
import pinocchio
import pytest
from comparison import Pair
from generated import Library, compiler, lanes, missing
from test_robots import NO_URDF, ROBOTS, SINGULAR, load

import condyle
import condyle.codegen

BOUND = 1e-10
"""Tolerance of differences from Pinocchio, relative to 1 + the largest number, the same as in comparison.py. Pinocchio
computes the results in another order of operations."""
ROUNDING = 1e-12
"""Tolerance of differences from the library, relative to 1 + the largest number. The library computes the results in
another order of operations."""
WORST = 1e10
"""Maximum condition number for which results are compared. Condition numbers are larger if a contact acts in a
direction in which the robot cannot move."""
MILD = 1e3
"""Maximum condition number of M for which the tolerance is ROUNDING. For larger condition numbers, the tolerance grows
in proportion."""
APART = 2.0
"""Factor by which the tolerance is larger for all states except the first. The errors of generated code and library may
have opposite signs and add up.

An example is aba_hessian of solo12 in the seventh state. Compared with extended precision, both errors are 4.4e-12, and
the two results differ by 8.7e-12. Without this factor, the tolerance would be 8.2e-12.
"""
SINGLE = float(np.finfo(np.float32).eps / np.finfo(np.float64).eps)
"""Ratio of the rounding errors of the types float and double. For code with floats, the tolerance is ROUNDING times
this ratio."""
WORST_SINGLE = 1e5
"""Maximum condition number for which results of floats are compared. For larger numbers, fewer than two digits would be
correct."""

ALL = "CONDYLE_FULL" in os.environ
"""Whether the tests compile code for all robots, which takes a quarter of an hour on two cores."""
SOME = ["panda", *(["solo12", "anymal"] if ALL else [])]
FEW = ["double_pendulum_continuous", "ur5", "borinot"]
"""Robots whose code is compiled in all languages: a robot with a continuous joint (cos, sin), an arm, and a flying base
with a limb."""
LANGUAGES = ["c-casadi", "c-float", "c-4", "c-8", "rust"]
CASES = [
    (name, language)
    for name in ([name for name in ROBOTS if name not in NO_URDF] if ALL else FEW)
    for language in LANGUAGES
    if ALL or not (name == "borinot" and language == "c-float")
    if ALL or language != "c-8" or name == FEW[0] or condyle.LEVEL == "avx512"
]
"""Pairs of a robot and a language.

On processors with vectors of four numbers, compiling code for eight lanes takes a minute, so only one robot's code is
compiled there. Code in the three languages with floats is compiled for the two smaller robots.
"""
BESIDES = {"c-float": ["c-float-4", "c-float-8"], "rust": ["rust-float"]}
"""Languages that are compiled together with the language in the key, for robots with up to `SMALL` coordinates."""

pytestmark = pytest.mark.skipif(shutil.which(compiler) is None, reason="there is no C compiler")


@pytest.fixture(scope="module", autouse=True)
def fast() -> object:
    """Sets options for fast compilation instead of fast code."""
    before = condyle.codegen.FLAGS
    condyle.codegen.FLAGS = tuple("-O0" if flag == "-O2" else flag for flag in before)
    yield
    condyle.codegen.FLAGS = before


@pytest.mark.parametrize("name", ["panda", "ur5", "anymal", *(["talos"] if ALL else [])])
def test_beside_pinocchio(name: str, tmp_path: Path) -> None:
    pair = load(name)
    ours, theirs = pair.ours, pair.theirs
    data = theirs.createData()
    state = pair.states(1)[0]
    q, v, x = state.q, state.v, state.a
    pinocchio.computeRNEADerivatives(theirs, data, q, v, x)
    tau_q, tau_v = data.dtau_dq.copy(), data.dtau_dv.copy()
    expected = {
        "rnea": [pinocchio.rnea(theirs, data, q, v, x).copy()],
        "aba": [pinocchio.aba(theirs, data, q, v, x).copy()],
        "gravity": [pinocchio.computeGeneralizedGravity(theirs, data, q).copy()],
        "nonlinear_effects": [pinocchio.nonLinearEffects(theirs, data, q, v).copy()],
        "rnea_derivatives": [tau_q, tau_v],
    }
    M = np.triu(pinocchio.crba(theirs, data, q).copy())
    expected["crba"] = [M + np.triu(M, 1).T]
    for function, arrays in expected.items():
        compiled = condyle.codegen.compile(ours, function, cache=tmp_path)
        arguments = (q, v, x)[: len(compiled.inputs)]
        result = compiled(*arguments)
        found = list(result) if isinstance(result, tuple) else [result]
        for a, b in zip(found, arrays, strict=False):
            assert np.abs(a - b).max() <= BOUND * (1.0 + np.abs(b).max()), (name, function)


RESTITUTION = 0.3
SMALL = 9
"""Maximum number of coordinates of robots that are compiled in all languages."""
LARGEST = 25
"""Maximum number of coordinates for which the longest functions are compiled: second derivatives, and functions that
need M⁻¹."""
COMPLETE = {("talos", "c-casadi")}
"""Pairs of a larger robot and a language for which all functions are compiled."""

Numbers = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Position q, velocity v, and numbers that are used as accelerations or efforts."""


def beside(pair: Pair, function: str, frame: str, numbers: Numbers) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Returns the arguments of a generated function for a state, and the library's results."""
    model, data = pair.ours, pair.data
    q, v, x = numbers
    told: object
    if function == "frames":
        axes = "local_world_aligned"
        pose = condyle.frame_placement(model, data, q, frame)
        velocity = condyle.frame_velocity(model, data, q, v, frame, axes)
        J = condyle.frame_jacobian(model, data, q, frame, axes)
        dJ = condyle.frame_jacobian_rate(model, data, q, v, frame, axes)
        return [q, v], [pose[:3, :3], pose[:3, 3], velocity, J, dJ]
    if function == "centroidal":
        terms = condyle.centroidal_map_rate(model, data, q, v)
        return [q, v], [terms.com, terms.com_velocity, terms.hg, terms.Jcom, terms.Ag, terms.dAg]
    if function.startswith(("constrained", "impulse")):
        impulse = function.startswith("impulse")
        held = condyle.ConstraintSet(model, [condyle.ContactConstraint(frame, "point")])
        last = np.array([RESTITUTION]) if impulse else x
        d = getattr(condyle, function)(model, data, held, q, v, RESTITUTION if impulse else x)
        fields = [name for name in d._fields if name not in ("residual", "redundant", "inertia")]
        return [q, v, last], [getattr(d, name) for name in fields]
    arguments = [q] if function in ("crba", "minv", "gravity") else [q, v]
    if function not in ("crba", "minv", "gravity", "nonlinear_effects"):
        arguments.append(x)
    if function.endswith("hessian"):
        arguments.append(v[::-1].copy())
        told = getattr(condyle, function)(model, data, q, v, x, lambda_=arguments[3])[:4]
    else:
        told = getattr(condyle, function)(model, data, *arguments)
    return arguments, list(told) if isinstance(told, tuple) else [told]


def condition(pair: Pair, function: str, frame: str, q: np.ndarray) -> float:
    """Returns the factor by which the inverses in a function may amplify rounding errors; infinite if an inverse does
    not exist."""
    if not function.startswith(("aba", "minv", "constrained", "impulse")):
        return 1.0
    if pair.name in SINGULAR:
        return np.inf
    M = condyle.crba(pair.ours, pair.data, q)
    if function.startswith(("aba", "minv")):
        return float(np.linalg.cond(M))
    J = condyle.frame_jacobian(pair.ours, pair.data, q, frame)[:3]
    return float(np.linalg.cond(M) * np.linalg.cond(J @ np.linalg.solve(M, J.T)))


def chosen(pair: Pair, language: str) -> list[str]:
    """Returns the functions that are compiled for a robot in a language."""
    # The derivatives of impacts are compiled only in plain C.
    # In other languages, their compilation would take as long as the compilation of all other functions.
    plain = language in ("c", "c-casadi")
    long = {"aba_derivatives", "constrained_dynamics_derivatives", "rnea_hessian", "aba_hessian"}
    long |= set() if plain else {"impulse_dynamics_derivatives"}
    every = pair.ours.nv <= LARGEST or (pair.name, language) in COMPLETE
    return [function for function in condyle.codegen.functions if every or function not in long]


def frame_of(pair: Pair) -> str:
    """Returns the name of the frame that the largest number of joints moves. The tests compute the kinematics of this
    frame and hold it by a contact."""
    model, q = pair.ours, pair.states(1)[0].q
    moved = [condyle.frame_jacobian(model, pair.data, q, k).any(axis=0).sum() for k in range(len(model.frames))]
    return str(model.frames[int(np.argmax(moved))].name)


Call = Callable[[str, Sequence[Sequence[np.ndarray]]], list[list[np.ndarray]]]
"""Function that takes the name of a generated function and states, and returns the results of the generated
function."""


def compare(pair: Pair, language: str, compiled: Callable[[list[str], dict[str, Any]], Call]) -> Call:
    """Checks that generated code and the library give the same results. The tolerance grows with the condition number
    of the inverted matrices.

    compiled: function that compiles the named functions with options, and returns a function that calls them.
    """
    single = "float" in language
    rounding, worst = (ROUNDING * SINGLE, WORST_SINGLE) if single else (ROUNDING, WORST)
    frame = frame_of(pair)
    states: list[Numbers] = []
    for state in pair.states(lanes(language)):
        q, v, x = (np.float32(a).astype(float) if single else a for a in (state.q, state.v, state.a))
        states.append((q, v, x))
    conditions = {name: [condition(pair, name, frame, q) for q, _, _ in states] for name in chosen(pair, language)}
    names = [name for name, of in conditions.items() if min(of) <= worst]
    assert {"rnea", "crba", "gravity", "nonlinear_effects", "rnea_derivatives", "frames", "centroidal"} <= set(names)
    call = compiled(names, {"frames": [frame], "constraints": [condyle.ContactConstraint(frame, "point")]})
    for name in names:
        arguments, expected = zip(*(beside(pair, name, frame, numbers) for numbers in states), strict=True)
        found = call(name, arguments)
        for k, (results, wanted, amplified) in enumerate(zip(found, expected, conditions[name], strict=True)):
            if amplified > worst:
                continue
            bound = rounding * max(1.0, (APART if k > 0 else 1.0) * amplified / MILD)
            for a, b in zip(results, wanted, strict=True):
                assert a.size == b.size, name
                assert np.abs(a.reshape(b.shape) - b).max() <= bound * (1.0 + np.abs(b).max()), name
    return call


@pytest.mark.parametrize("name", SOME)
def test_functions_one_by_one(name: str, tmp_path: Path) -> None:
    """Tests functions that `condyle.codegen.compile` compiles one by one: their results must equal the library's
    results."""
    pair = load(name)

    def call(names: list[str], options: dict[str, Any]) -> Call:
        made = {name: condyle.codegen.compile(pair.ours, name, cache=tmp_path, **options) for name in names}

        def one(function: str, states: Sequence[Sequence[np.ndarray]]) -> list[list[np.ndarray]]:
            result = made[function](*states[0])
            return [list(result) if isinstance(result, tuple) else [result]]

        return one

    compare(pair, "c", call)


@pytest.fixture(scope="module")
def folder() -> Iterator[Path]:
    """Creates a temporary folder for compiled libraries. The libraries for all robots need a gigabyte."""
    with TemporaryDirectory() as folder:
        yield Path(folder)


@pytest.mark.parametrize(("name", "language"), CASES)
def test_languages(name: str, language: str, folder: Path) -> None:
    """Tests that the generated code in each language gives the library's results, and that calls through CasADi give
    the same results."""
    if (lacks := missing(language)) is not None:
        pytest.skip(f"there is no {lacks}")
    pair = load(name)
    for also in [language, *(BESIDES.get(language, []) if pair.ours.nv <= SMALL else [])]:

        def call(names: list[str], options: dict[str, Any], language: str = also) -> Library:
            return Library(pair.ours, names, language, folder, **options)

        code = compare(pair, also, call)
        if language == "c-casadi":
            external(pair, code)


def external(pair: Pair, code: Library) -> None:
    """Checks that calls through CasADi give the same results as direct calls of the generated code, and that CasADi's
    Jacobians equal the generated derivatives."""
    state = pair.states(1)[0]
    numbers = {"q": state.q, "v": state.v, "restitution": np.array([RESTITUTION]), "lambda": state.v[::-1].copy()}
    for function, (inputs, outputs) in code.functions.items():
        arguments = [numbers.get(name, state.a) for name, _, _ in inputs]
        of = casadi.external(f"{code.stem}_{function}_casadi", str(code.path))
        assert (of.name_in(), of.name_out()) == tuple([name for name, _, _ in arrays] for arrays in (inputs, outputs))
        results = of.call(arguments)
        for a, b in zip(results, code(function, [arguments])[0], strict=True):
            assert (np.array(a).reshape(b.shape) == b).all(), function
        derivatives = f"{function}_derivatives"
        if derivatives not in code.functions or pair.ours.nq != pair.ours.nv:
            continue
        names = [name for name, _, _ in code.functions[derivatives][1]]
        by_name = dict(zip(names, code(derivatives, [arguments])[0], strict=True))
        jacobian = of.jacobian()
        blocks = dict(zip(jacobian.name_out(), jacobian.call([*arguments, *results]), strict=True))
        for (y, _, _), (x, _, _) in itertools.product(outputs, inputs):
            block = np.array(blocks.pop(f"jac_{y}_{x}"))
            if x != "restitution":
                assert (block == by_name[f"d{y.removesuffix('_after')}_d{x}"].reshape(block.shape)).all(), (y, x)
        assert not blocks


def library(folder: Path) -> str:
    """Compiles all C files of a folder to robot.so. Returns the name of the robot, with which the function names
    begin."""
    sources = sorted(path.name for path in folder.glob("*.c"))
    flags = ["-O1", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, *sources, "-o", "robot.so", "-lm"], cwd=folder, check=True)
    return next(file for file in sources if not file.endswith("_casadi.c")).removesuffix(".c")


def test_external(tmp_path: Path) -> None:
    """Tests that CasADi finds each generated function with the names and shapes of its arrays, and uses zeros for
    omitted arguments."""
    pair = load("panda")
    model, theirs, state = pair.ours, pair.theirs, pair.states(1)[0]
    for file, text in condyle.codegen.source(model, ["rnea", "crba"], "c-casadi").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    stem = library(tmp_path)
    rnea = casadi.external(f"{stem}_rnea_casadi", str(tmp_path / "robot.so"))
    assert rnea.name_in() == ["q", "v", "a"]
    assert rnea.name_out() == ["tau"]
    data = theirs.createData()
    tau = pinocchio.rnea(theirs, data, state.q, state.v, state.a)
    assert np.abs(np.array(rnea(state.q, state.v, state.a)).ravel() - tau).max() <= BOUND * (1.0 + np.abs(tau).max())
    still = pinocchio.computeGeneralizedGravity(theirs, data, state.q)
    assert np.abs(np.array(rnea(q=state.q)["tau"]).ravel() - still).max() <= BOUND * (1.0 + np.abs(still).max())
    crba = casadi.external(f"{stem}_crba_casadi", str(tmp_path / "robot.so"))
    M = np.triu(pinocchio.crba(theirs, data, state.q))
    M += np.triu(M, 1).T
    assert crba.size_out(0) == M.shape
    assert np.abs(np.array(crba(state.q)) - M).max() <= BOUND * (1.0 + np.abs(M).max())
    # The function is also called inside an expression.
    q = casadi.MX.sym("q", model.nq)
    trace = casadi.Function("trace", [q], [casadi.trace(crba(q))])
    assert abs(float(trace(state.q)) - np.trace(M)) <= BOUND * (1.0 + np.trace(M))


def test_jacobians_of_externals(tmp_path: Path) -> None:
    """Tests that CasADi uses the generated derivatives of a function for its Jacobian, also if the function is called
    inside an expression."""
    pair = load("panda")
    model, theirs, state = pair.ours, pair.theirs, pair.states(1)[0]
    names = ["rnea", "aba", "rnea_derivatives", "aba_derivatives"]
    for file, text in condyle.codegen.source(model, names, "c-casadi").items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    stem = library(tmp_path)
    rnea, aba = (casadi.external(f"{stem}_{name}_casadi", str(tmp_path / "robot.so")) for name in ("rnea", "aba"))
    assert rnea.jacobian().name_out() == ["jac_tau_q", "jac_tau_v", "jac_tau_a"]
    q, v, x = (casadi.MX.sym(name, model.nv) for name in "qvx")
    state = [np.asarray(x, float) for x in (state.q, state.v, state.a)]
    for f, derivatives in [(rnea, pinocchio.computeRNEADerivatives), (aba, pinocchio.computeABADerivatives)]:
        data = theirs.createData()
        by_q, by_v, M = derivatives(theirs, data, *state)
        expected = [by_q, by_v, np.triu(M) + np.triu(M, 1).T]
        twice = casadi.sin(2.0 * f(q, v, x))
        jacobian = casadi.Function("jacobian", [q, v, x], [casadi.jacobian(twice, casadi.vertcat(q, v, x))])
        value = np.array(f(*state)).ravel()
        chained = 2.0 * np.cos(2.0 * value)[:, None] * np.hstack(expected)
        assert np.abs(np.array(jacobian(*state)) - chained).max() <= BOUND * (1.0 + np.abs(chained).max())


def test_jacobians_under_constraints(tmp_path: Path) -> None:
    """Tests Jacobians of accelerations, forces, velocities after an impact and impulses, also with respect to the
    restitution."""
    pair = load("panda")
    model, frame, state = pair.ours, frame_of(pair), pair.states(1)[0]
    names = [f"{name}{end}" for name in ("constrained_dynamics", "impulse_dynamics") for end in ("", "_derivatives")]
    contact = [condyle.ContactConstraint(frame, "point")]
    code = Library(model, names, "c-casadi", tmp_path, constraints=contact)
    bound = ROUNDING * max(1.0, condition(pair, "impulse", frame, state.q) / MILD)
    for function in ("constrained_dynamics", "impulse_dynamics"):
        of = casadi.external(f"{code.stem}_{function}_casadi", str(code.path))
        arguments, (y, lambda_) = beside(pair, function, frame, (state.q, state.v, state.a))
        _, d = beside(pair, f"{function}_derivatives", frame, (state.q, state.v, state.a))
        rows = [d[2:5], d[5:8]] if function == "constrained_dynamics" else [d[2:4], d[4:6]]
        expected = np.vstack([np.hstack(blocks) for blocks in rows])
        # The function is also called inside an expression.
        x = [casadi.MX.sym(name, size) for name, size in zip(of.name_in(), map(len, arguments), strict=True)]
        sines = casadi.sin(casadi.vertcat(*of.call(x)))
        jacobian = casadi.Function("jacobian", x, [casadi.jacobian(sines, casadi.vertcat(*x))])
        found = np.array(jacobian.call(arguments)[0])
        chain = np.cos(np.concatenate([y, lambda_]))
        chained = chain[:, None] * expected
        assert np.abs(found[:, : chained.shape[1]] - chained).max() <= bound * (1.0 + np.abs(chained).max()), function
        # Compare with central differences of the library's function, also for arguments without generated derivatives.
        step = 1e-6
        for k, by in enumerate(np.cumsum([0, *map(len, arguments[:-1])])):
            for j in range(len(arguments[k])):
                sides = []
                for sign in (1.0, -1.0):
                    moved = [a.copy() for a in arguments]
                    moved[k][j] += sign * step
                    last = moved[2] if function == "constrained_dynamics" else float(moved[2][0])
                    held = condyle.ConstraintSet(model, contact)
                    there = getattr(condyle, function)(model, pair.data, held, moved[0], moved[1], last)
                    sides.append(np.concatenate([there[0], there.lambda_]))
                difference = chain * (sides[0] - sides[1]) / (2.0 * step)
                assert np.abs(found[:, by + j] - difference).max() <= 1e-6 * (1.0 + np.abs(found).max()), (
                    function,
                    k,
                    j,
                )


def test_positions_with_quaternions_have_no_jacobian() -> None:
    """Tests that no Jacobian is generated for robots with quaternions: the generated derivatives are along the tangent
    space, and not with respect to the numbers of q."""
    for robot, expected in [("panda", True), ("anymal", False)]:
        text = "".join(condyle.codegen.source(load(robot).ours, ["rnea", "rnea_derivatives"], "c-casadi").values())
        assert ("jac_" in text) == expected, robot
    text = "".join(condyle.codegen.source(load("panda").ours, ["rnea"], "c-casadi").values())
    assert "jac_" not in text
