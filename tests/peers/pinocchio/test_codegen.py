"""Generated code on robots of example-robot-data, against Pinocchio and the library, and as CasADi's `external`."""

import os
import shutil
import subprocess
from pathlib import Path

import casadi
import numpy as np
import pinocchio
import pytest
from comparison import Pair
from test_robots import NO_URDF, ROBOTS, SINGULAR, load

import condyle
import condyle.codegen

BOUND = 1e-10
"""Of what the peer computes in another order, relative to 1 + the largest number; as in comparison.py."""
ROUNDING = 1e-12
"""Of what the library computes in another order, relative to 1 + the largest number."""
WORST = 1e10
"""The condition from which on nothing is compared: a contact that a robot cannot give way to."""
MILD = 1e3
"""The condition of M up to which its inverse amplifies roundings within ROUNDING; beyond, as much as the condition."""

ALL = "CONDYLE_ALL_CODE" in os.environ
"""Whether to compile for all robots, which takes minutes."""
SOME = ["panda", "anymal", "solo12"]

compiler = os.environ.get("CC", "cc").split()[0]
pytestmark = pytest.mark.skipif(shutil.which(compiler) is None, reason="there is no C compiler")


@pytest.fixture(scope="module", autouse=True)
def fast() -> object:
    """Code is compiled for the time that compilers take, not for its own."""
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
LARGEST = 25
"""The coordinates up to which the longest functions are compiled: second derivatives and those that need M⁻¹."""


def beside(pair: Pair, function: str, frame: str) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The arguments of a function at a state, and what the library computes of them."""
    model, data, state = pair.ours, pair.data, pair.states(1)[0]
    q, v, x = state.q, state.v, state.a
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


def condition(pair: Pair, function: str, frame: str) -> float:
    """How much the inverses that a function needs may amplify roundings; infinite where there is none."""
    q = pair.states(1)[0].q
    if not function.startswith(("aba", "minv", "constrained", "impulse")):
        return 1.0
    if pair.name in SINGULAR:
        return np.inf
    M = condyle.crba(pair.ours, pair.data, q)
    if function.startswith(("aba", "minv")):
        return float(np.linalg.cond(M))
    J = condyle.frame_jacobian(pair.ours, pair.data, q, frame)[:3]
    return float(np.linalg.cond(M) * np.linalg.cond(J @ np.linalg.solve(M, J.T)))


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in NO_URDF] if ALL else SOME)
def test_beside_the_library(name: str, tmp_path: Path) -> None:
    """Equal but for roundings, which inverses amplify by their condition; of a frame that a contact holds."""
    pair = load(name)
    model = pair.ours
    q = pair.states(1)[0].q
    moved = [condyle.frame_jacobian(model, pair.data, q, k).any(axis=0).sum() for k in range(len(model.frames))]
    frame = model.frames[int(np.argmax(moved))].name
    contact = [condyle.ContactConstraint(frame, "point")]
    compiled = set()
    for function in condyle.codegen.functions:
        long = "hessian" in function or function in ("aba_derivatives", "constrained_dynamics_derivatives")
        amplified = condition(pair, function, frame)
        if amplified > WORST or (long and model.nv > LARGEST):
            continue
        of = condyle.codegen.compile(model, function, frames=[frame], constraints=contact, cache=tmp_path)
        arguments, expected = beside(pair, function, frame)
        result = of(*arguments)
        bound = ROUNDING * max(1.0, amplified / MILD)
        for a, b in zip(list(result) if isinstance(result, tuple) else [result], expected, strict=True):
            assert np.abs(a - b).max() <= bound * (1.0 + np.abs(b).max()), (name, function)
        compiled.add(function)
    assert {"rnea", "crba", "gravity", "nonlinear_effects", "rnea_derivatives", "frames", "centroidal"} <= compiled


def library(folder: Path) -> str:
    """Compiles all C of a folder to robot.so; the name of the robot in it."""
    sources = sorted(path.name for path in folder.glob("*.c"))
    flags = ["-O1", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, *sources, "-o", "robot.so", "-lm"], cwd=folder, check=True)
    return next(file for file in sources if not file.endswith("_casadi.c")).removesuffix(".c")


def test_external(tmp_path: Path) -> None:
    """CasADi finds each function, its arrays by name and shape, and takes what it leaves out for zeros."""
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
    # inside of an expression
    q = casadi.MX.sym("q", model.nq)
    trace = casadi.Function("trace", [q], [casadi.trace(crba(q))])
    assert abs(float(trace(state.q)) - np.trace(M)) <= BOUND * (1.0 + np.trace(M))


def test_jacobians_of_externals(tmp_path: Path) -> None:
    """CasADi differentiates a function by the derivatives that stand beside it, also inside of an expression."""
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


def test_positions_with_quaternions_have_no_jacobian() -> None:
    """Derivatives along the tangent are none by the numbers of q."""
    for robot, expected in [("panda", True), ("anymal", False)]:
        text = "".join(condyle.codegen.source(load(robot).ours, ["rnea", "rnea_derivatives"], "c-casadi").values())
        assert ("jac_" in text) == expected, robot
    text = "".join(condyle.codegen.source(load("panda").ours, ["rnea"], "c-casadi").values())
    assert "jac_" not in text
