"""Tests that whole-body control with friction pyramids finds the same optimum as the solver quadprog, for the same
quadratic programs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import quadprog

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "benches" / "peers"))

from wholebody_programs import Program, read  # noqa: E402

AGREEMENT = 1e-6
"""Tolerance, relative to 1 + the magnitude of the compared numbers. quadprog is exact up to rounding, and Condyle's
solver has a tolerance of 1e-9."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs whole-body control of robots that stand, walk and trot while they are pushed. Writes the quadratic program
    and Condyle's solution of each control step to a folder, and returns the folder."""
    folder = tmp_path_factory.mktemp("programs")
    # `--workspace` selects the features with which all dependencies are already compiled.
    command = ["cargo", "bench", "--quiet", "--locked", "--workspace", "--profile", "dev", "--bench", "wholebody_peers"]
    command += ["--", "--ticks", "1600", "--window", "320", "--replays", "0", "--export", str(folder)]
    subprocess.run([*command, "humanoid", "quadruped"], cwd=ROOT, check=True)
    return folder


def solve(p: Program) -> np.ndarray:
    return quadprog.solve_qp(p.P, -p.c, p.normals, p.offsets, len(p.b))[0]


@pytest.mark.parametrize(
    ("recording", "binds"),
    [("humanoid-stand", True), ("humanoid-walk", True), ("quadruped-stand", False), ("quadruped-trot", True)],
)
def test_optimum_is_that_of_quadprog(folder: Path, recording: str, binds: bool) -> None:
    ticks = read(folder / recording)
    assert len(ticks) == 320
    active = 0
    for programs, ours in ticks:
        for form, p in programs.items():
            x, theirs = ours[form], solve(p)
            best = p.objective(theirs)
            assert abs(p.objective(x) - best) <= AGREEMENT * (1 + abs(best)), form
            violation = max(np.max(p.lower - p.G @ x), np.max(p.G @ x - p.upper))
            assert violation <= AGREEMENT * (1 + np.max(np.abs(x)))
            active += int(np.sum(np.minimum(p.G @ theirs - p.lower, p.upper - p.G @ theirs) < 1e-9))
    assert (active > 0) == binds, "a quadruped that stands on four feet keeps within its cones; others do not"
