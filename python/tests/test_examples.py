"""Tests that the examples of `python/examples` run without changes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

SHARED = {"gait", "ground", "mujoco_film", "mujoco_world"}  # modules that several examples share
FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(path for path in FOLDER.glob("*.py") if path.stem not in SHARED)


def test_there_are_examples() -> None:
    least = {"dynamics", "derivatives", "mpc", "casadi_swing_up", "wholebody_trot", "mujoco_go2"}
    assert least <= {path.stem for path in EXAMPLES}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example(path: Path, tmp_path: Path) -> None:
    if path.stem.startswith("casadi"):
        pytest.importorskip("casadi")
    if path.stem.startswith("mujoco"):
        pytest.importorskip("mujoco")
        pytest.importorskip("example_robot_data")
    if path.stem == "identify":
        pytest.importorskip("example_robot_data")
    if path.stem == "learn_residual":
        pytest.importorskip("jax")
    if path.stem == "learn_weights":
        pytest.importorskip("torch")
    if path.stem == "wholebody_clarabel":
        pytest.importorskip("clarabel")
    if path.stem in ("pictures", "drag_target"):
        pytest.importorskip("viser")
    if path.stem == "coming_from_crocoddyl":
        pytest.importorskip("crocoddyl")  # the example is skipped if Crocoddyl is not installed
    environment = {**os.environ, "PYTHONWARNINGS": "error"}
    run = subprocess.run(
        [sys.executable, path], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout
