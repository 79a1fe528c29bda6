"""Compares solves of whole problems with Crocoddyl, iteration by iteration.

The problems are from `benches/peers/ocp_problems.py`. If the environment variable CONDYLE_PROBLEMS names a folder, its
files are tested, too.
"""

import json
import os
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "benches" / "peers"))

import ocp  # noqa: E402
from ocp_problems import PROBLEMS  # noqa: E402
from ocp_robots import NotRunError  # noqa: E402

FOLDER = Path(os.environ.get("CONDYLE_PROBLEMS", ROOT.parent / "shared" / "peers" / "crocoddyl" / "problems"))


CASES = [(name, solver) for name in PROBLEMS for solver in PROBLEMS[name]()[0]["solvers"]]
FILES = [(p.stem, solver) for p in sorted(FOLDER.glob("*.json")) for solver in json.loads(p.read_text())["solvers"]]


@pytest.mark.parametrize(("name", "solver"), CASES)
def test_same_trace(name, solver):
    result = ocp.compare(*PROBLEMS[name](), solver)[0]
    assert result["good"], result


@pytest.mark.parametrize(("name", "solver"), FILES)
def test_same_trace_of_a_file(name, solver):
    try:
        result = ocp.compare(*ocp.load(FOLDER, name), solver)[0]
    except NotRunError as missing:
        pytest.skip(str(missing))
    assert result["good"], result
