"""Robots for all tests."""

import pytest
from sample import Robot, make

import condyle


@pytest.fixture(params=["arm7", "quadruped", "humanoid"])
def robot(request: pytest.FixtureRequest) -> Robot:
    """Each of our own robots."""
    return make(getattr(condyle.robots, request.param)())


@pytest.fixture
def quadruped() -> Robot:
    """The quadruped alone."""
    return make(condyle.robots.quadruped())
