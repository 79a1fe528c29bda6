"""Tests that the benchmark against CasADi runs, and that its three methods of planning find the same motion."""

import json
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[3] / "benches" / "peers" / "casadi_comparison.py"


def test_comparison(tmp_path: Path) -> None:
    file = tmp_path / "casadi.json"
    subprocess.run([sys.executable, SCRIPT, file, "--quick"], check=True, cwd=SCRIPT.parent)
    report = json.loads(file.read_text())
    assert {row["kind"] for row in report["functions"]} == {"value", "Jacobian", "Hessian"}
    assert all(row["casadi_expressions_us"] > 0 for row in report["functions"])
    reach = report["reach"]
    costs = [reach[way]["cost"] for way in ("fddp", "ipopt_with_ours", "ipopt_expressions")]
    assert max(costs) - min(costs) < 1e-6 * max(costs)
