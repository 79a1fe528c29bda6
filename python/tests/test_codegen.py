"""Tests of generated code: the code, compiled by the system's C compiler, must give the results of the library's
functions. The tests are skipped if the system has no C compiler.
"""

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sample import Robot

import condyle
import condyle.codegen

ROUNDING = 1e-11
"""Tolerance relative to the largest number; M⁻¹ may amplify rounding errors."""

needs_compiler = pytest.mark.skipif(
    shutil.which(os.environ.get("CC", "cc").split()[0]) is None, reason="there is no C compiler"
)


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("cache")
    before = os.environ.get("CONDYLE_CACHE")
    os.environ["CONDYLE_CACHE"] = str(folder)
    flags = condyle.codegen.FLAGS
    condyle.codegen.FLAGS = tuple(
        "-O0" if flag == "-O2" else flag for flag in flags
    )  # less optimisation, because compilation takes most of the time
    yield folder
    condyle.codegen.FLAGS = flags
    if before is None:
        del os.environ["CONDYLE_CACHE"]
    else:
        os.environ["CONDYLE_CACHE"] = before


def near(found: Any, expected: Any) -> None:
    scale = 1.0 + np.abs(expected).max()
    assert np.abs(found - expected).max() <= ROUNDING * scale


@needs_compiler
@pytest.mark.parametrize("name", ["rnea", "aba", "rnea_derivatives"])
def test_dynamics(robot: Robot, name: str) -> None:
    model, data, q, v, a, tau, f_ext = robot
    x = tau if name == "aba" else a
    compiled = condyle.codegen.compile(model, name, external_forces=True)
    expected = getattr(condyle, name)(model, data, q, v, x, f_ext)
    found = compiled(q, v, x, f_ext[1:])
    if isinstance(expected, tuple):
        assert found._fields == expected._fields
        for one, other in zip(found, expected, strict=True):
            near(one, other)
    else:
        near(found, expected)


@needs_compiler
def test_many_states_and_the_cache(quadruped: Robot, cache: Path) -> None:
    model, data, _, v, _, tau, _ = quadruped
    compiled = condyle.codegen.compile(model, "aba_derivatives")
    assert compiled.inputs == {"q": 19, "v": 18, "tau": 18}
    assert compiled.outputs["da_dq"] == (18, 18)
    assert compiled.library.parent == cache
    written = compiled.library.stat().st_mtime_ns
    again = condyle.codegen.compile(model, "aba_derivatives")
    assert again.library == compiled.library
    assert again.library.stat().st_mtime_ns == written
    heavier = model.with_armature(model.armature + 0.1)
    assert condyle.codegen.compile(heavier, "minv").library != condyle.codegen.compile(model, "minv").library
    qs = np.array([condyle.random_configuration(model, seed=k) for k in range(4)])
    expected = condyle.aba_derivatives(model, data, qs, np.tile(v, (4, 1)), np.tile(tau, (4, 1)))
    for found, other in zip(compiled(qs, v, tau), expected, strict=True):
        assert found.shape == other.shape
        near(found, other)


@needs_compiler
def test_parameters_are_inputs(quadruped: Robot) -> None:
    model, _, q, v, a, _, _ = quadruped
    rnea = condyle.codegen.compile(model, "rnea", inputs=["inertia", "armature", "gravity"])
    rng = np.random.default_rng(3)
    armature = rng.random(model.nv)
    armature[:3] = 0.3  # the three linear coordinates of a free joint must have the same armature
    inertias = [
        condyle.Inertia.from_com(i.mass + 1.0, rng.uniform(-0.1, 0.1, 3), 0.1 * np.eye(3)) for i in model.inertias
    ]
    other = model.with_inertias(inertias).with_armature(armature).with_gravity([1.0, 2.0, -3.0])
    pi = np.array([condyle.inertial_parameters.from_inertia(inertia) for inertia in inertias[1:]])
    found = rnea(q, pi, armature, [1.0, 2.0, -3.0], v, a)
    near(found, condyle.rnea(other, condyle.Data(other), q, v, a))


@needs_compiler
def test_constrained_dynamics(quadruped: Robot) -> None:
    model, data, q, v, _, tau, _ = quadruped
    feet = [condyle.ContactConstraint(foot, "point", kp=10.0, kd=3.0) for foot in ("LF_foot", "RH_foot")]
    compiled = condyle.codegen.compile(model, "constrained_dynamics", constraints=feet)
    expected = condyle.constrained_dynamics(model, data, condyle.ConstraintSet(model, feet), q, v, tau)
    found = compiled(q, v, tau)
    near(found.a, expected.a)
    near(found.lambda_, expected.lambda_)


@needs_compiler
def test_impulse_dynamics_derivatives(quadruped: Robot) -> None:
    model, data, q, v, *_ = quadruped
    feet = [condyle.ContactConstraint(foot, "point") for foot in ("LF_foot", "RH_foot")]
    compiled = condyle.codegen.compile(model, "impulse_dynamics_derivatives", constraints=feet)
    assert compiled.inputs == {"q": 19, "v": 18, "restitution": 1}
    assert compiled.outputs["dlambda_dq"] == (6, 18)
    expected = condyle.impulse_dynamics_derivatives(model, data, condyle.ConstraintSet(model, feet), q, v, 0.3)
    found = compiled(q, v, [0.3])
    near(found.v_after, expected.v)
    near(found.lambda_, expected.lambda_)
    for name in ("dv_dq", "dv_dv", "dlambda_dq", "dlambda_dv"):
        near(getattr(found, name), getattr(expected, name))


def test_what_is_wrong_is_said(quadruped: Robot, tmp_path: Path) -> None:
    model = quadruped.model
    with pytest.raises(RuntimeError, match="`no-such-compiler` cannot be run"):
        condyle.codegen.compile(model, "rnea", compiler="no-such-compiler", cache=tmp_path)
    with pytest.raises(RuntimeError, match="failed"):
        condyle.codegen.compile(model, "rnea", compiler="false", cache=tmp_path)
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match="functions: expected 'rnea', .*, found 'abba'"):
        condyle.codegen.source(model, "abba")
    with pytest.raises(ValueError, match="language: expected 'c', .*, found 'fortran'"):
        condyle.codegen.source(model, "aba", "fortran")
    with pytest.raises(ValueError, match="partitions: expected None for 'c', found 2"):
        condyle.codegen.source(model, "aba", partitions=2)
    with pytest.raises(ValueError, match="inputs: expected 'inertia', 'armature' or 'gravity', found 'mass'"):
        condyle.codegen.source(model, "aba", inputs=["mass"])
    with pytest.raises(ValueError, match="constrained_dynamics: needs constraints"):
        condyle.codegen.source(model, "constrained_dynamics")
    with pytest.raises(condyle.ModelError, match="unknown frame"):
        condyle.codegen.source(model, "frames", frames=["LF_fot"])


@needs_compiler
def test_wrong_arguments(quadruped: Robot) -> None:
    gravity = condyle.codegen.compile(quadruped.model, "gravity")
    with pytest.raises(ValueError, match=r"q: expected \(19,\) or \(n, 19\), found \(18,\)"):
        gravity(np.zeros(18))
    with pytest.raises(TypeError, match="expected 1 arguments, found 2"):
        gravity(quadruped.q, quadruped.v)


def test_every_function_is_there(robot: Robot) -> None:
    frame = robot.model.frames[-1].name
    for name in condyle.codegen.functions:
        options: dict[str, Any] = {}
        if name == "frames":
            options["frames"] = [frame]
        elif "constrained" in name or "impulse" in name:
            if robot.model.nv > 20:
                continue
            options["constraints"] = [condyle.ContactConstraint(frame, "point")]
        files = condyle.codegen.source(robot.model, name, **options)
        assert any(f"_{name}(" in text for text in files.values())
