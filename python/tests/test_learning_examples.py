"""Tests of the numbers that the examples of identification, estimation and learning report."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from condyle import inertial_parameters

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def example(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Imports the example with the name that the test gives."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    yield importlib.import_module(request.param)
    sys.modules.pop(request.param)


@pytest.mark.parametrize("example", ["identify"], indirect=True)
def test_identification(example: ModuleType) -> None:
    pytest.importorskip("example_robot_data")
    report = example.run(plot=False)
    assert len(report.errors) >= 40
    assert np.sqrt(np.mean(report.errors**2)) < 1.5  # 1 if the deviations are right
    assert report.torque["identified"] < 0.01 < 0.05 < report.torque["CAD model"]
    assert report.mass_error < 0.02 and report.com_error < 0.02
    inertial_parameters.check(report.payload)


@pytest.mark.parametrize("example", ["identify"], indirect=True)
def test_identified_inertias_are_physical(example: ModuleType) -> None:
    """Checks inertias from torques that are so noisy that least squares alone finds negative masses."""
    pytest.importorskip("example_robot_data")
    real, _, cad, _ = example.robots()
    motion = example.exciting(cad, seed=1, candidates=1)
    tau = example.torques(real, motion)
    tau += 3.0 * np.random.default_rng(0).standard_normal(tau.shape)
    found = example.identify(cad, motion, tau, np.full(tau.shape[1], 3.0))
    for body in found.inertias:
        inertial_parameters.check(body)


@pytest.mark.parametrize("example", ["estimate"], indirect=True)
def test_estimation(example: ModuleType) -> None:
    """Compares the estimates with dense least squares, which shares only the residuals, and with the truth."""
    report = example.run(0.7, comparisons=2)
    assert report.largest_difference < 1e-8
    height, tilt, velocity = example.errors(report, report.estimate)
    assert height < 0.003 and tilt < 0.01 and velocity < 0.05
    alone = example.errors(report, report.integrated)
    assert alone[1] > 2.0 * tilt and alone[2] > 3.0 * velocity


@pytest.mark.parametrize("example", ["learn_residual"], indirect=True)
def test_learning(example: ModuleType) -> None:
    pytest.importorskip("jax")
    report = example.run(150)
    assert np.mean(report.losses[-20:]) < 0.2 * report.losses[0]
    assert report.prediction[1][-1] < 0.5 * report.prediction[0][-1]
    before, after = (np.sqrt(np.mean(e[len(e) // 2 :] ** 2)) for e in report.tracking)
    assert after < 0.6 * before
