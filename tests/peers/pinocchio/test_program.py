"""The program on all robots of example-robot-data: what `inspect` says against Pinocchio, `check`, `budget`.

It is looked for where cargo builds it (`cargo test` does), or where CONDYLE_PROGRAM says.
"""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from example_robot_data.robots_loader import ROBOTS
from test_cassie import path as cassie_path
from test_robots import NO_URDF, root_joint, urdf_path

ROOT = Path(__file__).resolve().parents[3]
ROUNDING = 1e-10


def find_program() -> str | None:
    if given := os.environ.get("CONDYLE_PROGRAM"):
        return given
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    built = [target / kind / "condyle" for kind in ("release", "debug") if (target / kind / "condyle").is_file()]
    return str(max(built, key=lambda path: path.stat().st_mtime)) if built else None


PROGRAM = find_program()
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="the program is not built: cargo build -p condyle-cli")


def run(command: str, name: str, *flags: str) -> dict:
    path = cassie_path() if name in NO_URDF else urdf_path(name)
    root = ["--root", "free"] if root_joint(name) else []
    line = [str(PROGRAM), command, path, *root, "--json", *flags]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (name, done.stderr)
    return json.loads(done.stdout)


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in NO_URDF])
def test_inspect(name: str) -> None:
    root = [pin.JointModelFreeFlyer()] if root_joint(name) else []
    model = pin.buildModelFromUrdf(urdf_path(name), *root)
    report = run("inspect", name)
    assert (report["nq"], report["nv"]) == (model.nq, model.nv)
    assert [body["joint"] for body in report["bodies"]] == list(model.names)[1:]
    masses = np.array([body["mass"] for body in report["bodies"]])
    theirs = np.array([inertia.mass for inertia in list(model.inertias)[1:]])
    assert np.abs(masses - theirs).max() < ROUNDING
    assert abs(report["mass"] - theirs.sum()) < ROUNDING * (1 + theirs.sum())
    for body, inertia in zip(report["bodies"], list(model.inertias)[1:], strict=True):
        if inertia.mass > 0:
            assert np.abs(np.array(body["com"]) - inertia.lever).max() < ROUNDING
            moments = np.sort(np.linalg.eigvalsh(inertia.inertia))
            assert np.abs(np.array(body["moments"]) - moments).max() < ROUNDING
    com = pin.centerOfMass(model, model.createData(), pin.neutral(model))
    assert np.abs(np.array(report["com"]) - com).max() < ROUNDING


@pytest.mark.parametrize("name", list(ROBOTS))
def test_check(name: str) -> None:
    report = run("check", name, "--states", "20")
    assert report["pass"]
    assert len(report["rows"]) >= 32


@pytest.mark.parametrize("name", list(ROBOTS))
def test_budget(name: str) -> None:
    report = run("budget", name, "--knots", "4", "--repetitions", "1", "--cores", "2")
    assert len(report["algorithms"]) == 6
    assert all(row["finite"] for row in report["iterations"])
