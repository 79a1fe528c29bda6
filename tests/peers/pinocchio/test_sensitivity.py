"""Tests that gradients through solutions equal CasADi's parametric sensitivities, which IPOPT's solution gives."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("casadi")
sys.path.insert(0, str(Path(__file__).parents[3] / "benches" / "peers"))

import sensitivity


@pytest.mark.parametrize("case", [sensitivity.cartpole, sensitivity.chain])
def test_gradients_by_initial_state_and_goal(case) -> None:
    assert sensitivity.compare(case(), 1)["error"] < 1e-8
