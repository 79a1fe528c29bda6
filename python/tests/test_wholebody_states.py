"""Tests of whole-body control with invalid states and references: the result is a safe command or an error, with the
name of the joint or the frame. Also tests copies and pickles of controllers.
"""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.wholebody import (
    ControllerError,
    FrictionContact,
    Plan,
    References,
    Settings,
    Task,
    WholeBodyController,
)

QUADRUPED = condyle.robots.quadruped()
FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
STANDING = np.r_[0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2]
TASKS = [Task.com(), Task.orientation("trunk"), Task.posture()]
REST = np.zeros(18)
LENGTH = r"joint `root_joint`: its rotation, {}\[3\.\.7\], has the length {}, expected 1"


def new(settings: Settings | None = None, tasks: list[Task] = TASKS) -> WholeBodyController:
    return WholeBodyController(QUADRUPED, [FrictionContact.point(foot, 0.7) for foot in FEET], tasks, settings)


def scaled(factor: float) -> np.ndarray:
    q = STANDING.copy()
    q[3:7] *= factor
    return q


@pytest.mark.parametrize("factor", [0.0, 1.1, 2.0])
def test_a_quaternion_has_length_1(factor: float) -> None:
    controller, bad = new(Settings(hold_ticks=1)), scaled(factor)
    references = controller.hold(STANDING)
    with pytest.raises(condyle.ModelError, match=LENGTH.format("q", factor).replace(".0,", ",")):
        controller.hold(bad)
    good = controller.step(STANDING, REST, references).solved()
    for source in ("last_solution", "gravity_compensation"):
        command = controller.step(bad, REST, references)
        assert (command.status, command.source) == ("invalid_state", source)
        assert command.reason == controller.command.reason
        assert command.reason.startswith("joint `root_joint`: its rotation, q[3..7], has the length ")
        assert np.isfinite(command.tau).all()
        np.testing.assert_allclose(command.tau, good.tau, atol=2.0)  # the robot still stands
    with pytest.raises(ControllerError, match="joint `root_joint`"):
        command.solved()
    assert controller.step(STANDING, REST, references).status == "solved"


def test_references_are_positions_and_poses() -> None:
    """Checks that references that are set are checked at once, and that references changed in place are checked in the
    next step.
    """
    controller = new()
    good = controller.hold(STANDING)
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])
    for pose in (np.zeros((4, 4)), np.diag([2.0, 2.0, 2.0, 1.0]), np.diag([1.1, 1.1, 1.1, 1.0]), mirror):
        for references in (good.copy(), pickle.loads(pickle.dumps(good)), copy.deepcopy(good)):
            with pytest.raises(ValueError, match=r"^frames\[0\]\.pose: no rotation: off by "):
                references.frames[0].pose = pose
            with pytest.raises(ValueError, match=r"^contacts\[2\]\.pose: no rotation: off by "):
                references.contacts[2].pose = pose
            with pytest.raises(ValueError, match="^posture.q: " + LENGTH.format("q", 2)):
                references.posture.q = scaled(2.0)
            assert references == good
        changes: list[tuple[str, Callable[[References], Any]]] = [
            ("frame `trunk`: frames[0].pose", lambda r, M=pose: r.frames[0].pose.__setitem__(..., M)),
            ("frame `RF_foot`: contacts[2].pose", lambda r, M=pose: r.contacts[2].pose.__setitem__(..., M)),
            ("joint `root_joint`: its rotation, posture.q[3..7]", lambda r: r.posture.q.__setitem__(6, 1.1)),
        ]
        for place, change in changes:
            references = good.copy()
            change(references)
            command = controller.step(STANDING, REST, references)
            assert command.status == "invalid_state"
            assert command.reason.startswith(place)
            assert np.isfinite(command.tau).all()
    turned = np.eye(4)
    turned[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    good.frames[0].pose = turned
    good.posture.q = scaled(-1.0)  # a negative quaternion describes the same rotation
    assert controller.step(STANDING, REST, good).status == "solved"


def test_plans_have_states() -> None:
    knot = np.r_[STANDING, REST]
    for factor in (0.0, 1.1, 2.0):
        states = np.tile(knot, (3, 1))
        states[1, 3:7] *= factor
        with pytest.raises(ControllerError, match="^states: knot 1: joint `root_joint`: its rotation"):
            Plan(QUADRUPED, [0.0, 0.1, 0.2], states, np.ones((2, 4)))
    plan = Plan(QUADRUPED, [0.0, 0.1], [knot, knot], np.ones((1, 4)), np.zeros((1, 12)))
    out = np.full(18, 7.0)
    with pytest.raises(condyle.ModelError, match="joint `root_joint`: its rotation"):
        plan.feedback(0.0, scaled(1.1), REST, out)
    assert (out == 7.0).all()


def test_efforts_are_above_0() -> None:
    limits = QUADRUPED.limits
    powerless = limits.effort.copy()
    powerless[7] = 0.0
    model = QUADRUPED.with_limits(effort=powerless)
    with pytest.raises(ControllerError, match="joint `LF_HFE`: the model's limit of effort .* is 0"):
        WholeBodyController(model, [], TASKS)
    WholeBodyController(model, [], TASKS, Settings(effort=limits.effort))
    for wrong in (0.0, -3.0, np.nan):
        efforts = np.full(18, 80.0)
        efforts[7] = wrong
        with pytest.raises(ControllerError, match="joint `LF_HFE`: setting `effort` is "):
            new(Settings(effort=efforts))


def test_normalize_needs_a_length() -> None:
    builder = condyle.ModelBuilder("wheel")
    builder.body(
        "wheel",
        condyle.WORLD,
        condyle.Joint.continuous([0.0, 0, 1]),
        inertia=condyle.Inertia.from_com(1.0, [0.0, 0, 0], np.eye(3)),
    )
    wheel = builder.build()
    for length, factor in (("0", 0.0), ("NaN", np.nan), ("inf", np.inf), ("inf", 1e200)):
        q = np.r_[STANDING[:3], np.full(4, 0.5) * factor, STANDING[7:]]
        with pytest.raises(condyle.ModelError, match=rf"joint `root_joint`: .* has the length {length} and cannot"):
            condyle.normalize(QUADRUPED, q)
        with pytest.raises(condyle.ModelError, match=rf"joint `root_joint`: .* has the length {length} and cannot"):
            condyle.normalize(QUADRUPED, np.stack([STANDING, q]))  # only one of the states is invalid
        with pytest.raises(condyle.ModelError, match="joint `wheel`: its rotation, q"):
            condyle.normalize(wheel, [0.6 * factor, 0.8 * factor])
    np.testing.assert_allclose(condyle.normalize(QUADRUPED, scaled(3.0)), STANDING)
    np.testing.assert_allclose(condyle.normalize(QUADRUPED, np.stack([scaled(3.0)] * 2)), [STANDING] * 2)
    np.testing.assert_allclose(condyle.normalize(wheel, [3e-100, 4e-100]), [0.6, 0.8])


def ticks(controller: WholeBodyController, first: int, count: int) -> list[str]:
    """Returns the commands of successive ticks, as text, at states near the stance while contacts begin and end. One of
    the states is invalid.
    """
    commands = []
    for k in range(first, first + count):
        rng = np.random.default_rng(k)
        q = condyle.integrate(QUADRUPED, STANDING, 0.02 * rng.standard_normal(18))
        references = controller.hold(STANDING)
        references.contacts[k % 4].activation = [1.0, 0.5, 0.0][k % 3]
        commands.append(repr(controller.step(2.0 * q if k % 7 == 5 else q, 0.1 * rng.standard_normal(18), references)))
    return commands


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda c: pickle.loads(pickle.dumps(c))])
def test_a_copy_continues_with_the_same_bits(copied: Callable[[WholeBodyController], WholeBodyController]) -> None:
    with np.printoptions(floatmode="unique"):
        controller = new(Settings(hold_ticks=2), [*TASKS, Task.position("LF_foot", priority=1)])
        for first in (0, 6, 12):
            other = copied(controller)
            assert repr(other) == repr(controller)
            assert repr(other.command) == repr(controller.command)
            assert repr(other.settings) == repr(controller.settings)
            assert ticks(other, first, 6) == ticks(controller, first, 6)


def test_a_broken_pickle_is_refused() -> None:
    controller = new()
    make, (model, contacts, tasks, settings, numbers) = controller.__reduce__()
    for broken in (numbers[1:], np.r_[numbers, 0.0], np.r_[np.nan, numbers[1:]], []):
        with pytest.raises(ControllerError, match="the pickle is damaged"):
            make(model, contacts, tasks, settings, broken)
    with pytest.raises(ControllerError, match="the pickle is damaged"):
        make(model, contacts[:2], tasks, settings, numbers)
