"""Tests that IPOPT stays at the solutions of the interior point, and that a benchmark of both solvers runs."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from condyle.optimal import InteriorPoint

sys.path.insert(0, str(Path(__file__).parents[3] / "benches" / "peers"))
from constrained_problems import PROBLEMS, Start
from constrained_program import Program

PEERS = Path(__file__).parents[3] / "benches" / "peers"
SAME = 1e-6
"""Maximum relative difference between the costs."""
NEAR = 1e-5
"""Maximum distance of IPOPT's solution from the start, relative to 1 + the largest entry."""
ACTIVE = 1e-3
"""Multipliers above this number must agree in sign and, to a thousandth, in size."""
OPTIONS = {
    "print_level": 0,
    "sb": "yes",
    "tol": 1e-8,
    "max_iter": 50,
    "warm_start_init_point": "yes",
    "mu_init": 1e-9,
    **{f"warm_start_{kind}": 1e-9 for kind in ("bound_push", "bound_frac", "slack_bound_push", "slack_bound_frac")},
}


@pytest.mark.parametrize("make", PROBLEMS.values(), ids=list(PROBLEMS))
def test_ipopt_stays_at_a_solution(make: Callable[[], Start]) -> None:
    text, xs, us = make()
    program = Program(text, as_rows=True)
    ours = InteriorPoint(program.problem, tolerance=1e-7)
    solution = ours.solve(xs, us)
    assert solution.status == "converged"
    z = program.pack(solution.xs, solution.us)
    cost, violation = program.measure(z)
    assert cost == pytest.approx(solution.cost, rel=1e-12) and violation < SAME
    # IPOPT starts without multipliers of its own, so the signs that it finds are independent of ours
    solver = program.solver("ipopt", {"ipopt": OPTIONS})
    found = program.solve(solver, z)
    assert solver.stats()["success"], solver.stats()["return_status"]
    after = np.array(found["x"]).ravel()
    assert float(found["f"]) == pytest.approx(cost, rel=SAME)
    assert np.abs(after - z).max() < NEAR * (1.0 + np.abs(z).max())
    theirs, y = np.array(found["lam_g"]).ravel(), program.multipliers(ours.outcome.multipliers)
    held = np.isfinite(y) & ((np.abs(y) > ACTIVE) | (np.abs(theirs) > ACTIVE))
    assert held.sum() > 4 and (np.sign(y[held]) == np.sign(theirs[held])).all()
    assert np.abs(y[held] - theirs[held]).max() < 1e-3 * (1.0 + np.abs(y[held]).max())


def test_solvers_find_the_same_cost() -> None:
    command = [sys.executable, PEERS / "constrained.py", "--rounds", "1", "--json"]
    lines = subprocess.run(command, check=True, cwd=PEERS, capture_output=True, text=True).stdout.splitlines()
    assert [json.loads(line)["problem"] for line in lines] == list(PROBLEMS)
    for line in lines:
        rows = {row["solver"]: row for row in json.loads(line)["solvers"]}
        best = rows["interior_point"]["cost"]
        for name in ("interior_point", "second_order", "augmented_lagrangian", "ipopt", "fatrop"):
            row = rows[name]
            assert row["converged"], row
            assert row["cost"] == pytest.approx(best, rel=2e-5) and row["violation"] < 2e-6, row
            assert row["ms"] > 0.0
