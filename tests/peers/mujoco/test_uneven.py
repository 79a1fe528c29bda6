"""Tests walks over ground of unknown height in MuJoCo."""

import os

import pytest
from uneven import CASES, Landing, Pattern, walk


@pytest.mark.parametrize(
    ("name", "landing", "height"), [("go2", "level", 0.03), ("g1", "level", -0.015), ("g1", "touch", 0.015)]
)
def test_a_step_is_survived(name: str, landing: Landing, height: float) -> None:
    assert not walk(name, landing, "step", height, seed=0).fallen


@pytest.mark.skipif("CONDYLE_FULL" not in os.environ, reason="takes minutes: ./test full")
@pytest.mark.parametrize(("name", "pattern", "height"), [(name, *case) for name in CASES for case in CASES[name][:3]])
def test_uneven_ground_is_survived(name: str, pattern: Pattern, height: float) -> None:
    assert sum(not walk(name, "level", pattern, height, seed).fallen for seed in range(4)) >= 3
