"""Generated code on robots of example-robot-data, against Pinocchio and the library, and as CasADi's `external`."""

import os
import shutil
import subprocess
from pathlib import Path

import casadi
import numpy as np
import pinocchio
import pytest
from test_robots import NO_URDF, ROBOTS, SINGULAR, load

import condyle
import condyle.codegen

BOUND = 1e-10
"""Of what the peer computes in another order, relative to 1 + the largest number; as in comparison.py."""
ROUNDING = 1e-12
"""Of what the library computes in another order, relative to 1 + the largest number."""
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


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in NO_URDF] if ALL else SOME)
def test_beside_the_library(name: str, tmp_path: Path) -> None:
    """Equal but for roundings, which the condition of M amplifies where its inverse is needed."""
    pair = load(name)
    model, data, state = pair.ours, pair.data, pair.states(1)[0]
    q, v, x = state.q, state.v, state.a
    names = ["rnea", "crba", "gravity", "nonlinear_effects", "rnea_derivatives", "centroidal"]
    if name not in SINGULAR:
        names += ["aba", "minv"]
        names += ["aba_derivatives"] if model.nv < 25 else []
    for function in names:
        compiled = condyle.codegen.compile(model, function, cache=tmp_path)
        result = compiled(*(q, v, x)[: len(compiled.inputs)])
        if function == "centroidal":
            terms = condyle.centroidal_map_rate(model, data, q, v)
            expected = [terms.com, terms.com_velocity, terms.hg, terms.Jcom, terms.Ag, terms.dAg]
        else:
            told = getattr(condyle, function)(model, data, *(q, v, x)[: len(compiled.inputs)])
            expected = list(told) if isinstance(told, tuple) else [told]
        inverse = function in ("aba", "minv", "aba_derivatives")
        condition = np.linalg.cond(condyle.crba(model, data, q)) if inverse else 1.0
        bound = ROUNDING * max(1.0, condition / MILD)
        for a, b in zip(list(result) if isinstance(result, tuple) else [result], expected, strict=True):
            assert np.abs(a - b).max() <= bound * (1.0 + np.abs(b).max()), (name, function)


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
