"""Tests of `condyle.optimal.rollout_many`."""

import numpy as np
import pytest

import condyle
from condyle import ContactConstraint
from condyle.optimal import (
    Action,
    ContactDynamics,
    Cost,
    FreeDynamics,
    ImpulseDynamics,
    Problem,
    ProblemError,
    Residual,
    rollout_many,
)

FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]


def arm() -> Problem:
    robot, x0 = condyle.robots.arm7(), np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    costs = [Cost("reach", 10.0, Residual.frame_translation(robot, "tool", [0.4, 0.2, 0.5]))]
    effort = Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    return Problem(x0, [FreeDynamics(robot, 0.02, [*costs, effort])], [0] * 10, FreeDynamics(robot, None, costs))


def quadruped() -> Problem:
    """Returns a problem with an impact, which has no controls."""
    robot = condyle.robots.quadruped()
    x0 = np.r_[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
    feet = {foot: ContactConstraint(foot, "point", None, "local_world_aligned") for foot in FEET}
    costs = [Cost("rest", 1.0, Residual.state(x0))]
    impact = ImpulseDynamics(robot, feet, costs)
    return Problem(
        x0,
        [ContactDynamics(robot, feet, 0.01, costs), impact],
        [0] * 6 + [1] + [0] * 4,
        FreeDynamics(robot, None, costs),
    )


def still(problem: Problem) -> list[np.ndarray]:
    """Returns controls that hold the robot still, knot by knot."""
    return list(problem.quasi_static(np.tile(problem.x0, (problem.horizon + 1, 1))))


@pytest.mark.parametrize("make", [arm, quadruped])
def test_costs_states_and_gradients(make) -> None:
    problem, random = make(), np.random.default_rng(0)
    flat = np.concatenate(still(problem))
    us = flat + random.normal(size=(11, len(flat)))
    cuts = np.cumsum([len(u) for u in still(problem)])[:-1]
    found = rollout_many(problem, us, gradients=True)
    assert found.du.shape == us.shape and found.dx0.shape == (11, problem.ndx)
    step = 1e-6
    for i in (0, 10):
        controls = np.split(us[i], cuts)
        xs = problem.rollout(controls)
        np.testing.assert_allclose(found.xs[i], xs, atol=1e-10)
        assert problem.evaluate(xs, controls).cost == pytest.approx(found.costs[i], rel=1e-12)
        for k in (0, len(flat) - 1):
            moved = us[i] + step * np.eye(len(flat))[k] * np.array([[1.0], [-1.0]])
            up, down = rollout_many(problem, moved, states=False).costs
            assert (up - down) / (2.0 * step) == pytest.approx(found.du[i, k], rel=1e-5, abs=1e-6)


def test_controls_by_knots_and_initial_states() -> None:
    problem = arm()
    us = np.tile(still(problem), (3, 1, 1))
    x0s = np.tile(problem.x0, (3, 1))
    x0s[1, 0] = 0.3
    found = rollout_many(problem, us, x0s, gradients=True, threads=2)
    assert found.xs.shape == (3, 11, 14) and found.du.shape == us.shape
    assert found.costs[0] == found.costs[2] != found.costs[1]
    assert (rollout_many(problem, us, x0s[1]).costs == found.costs[1]).all()
    assert rollout_many(problem, us, states=False).xs is None
    assert rollout_many(problem, us[:0]).costs.shape == (0,)


def test_a_sequence_that_diverges_fails_alone() -> None:
    problem = arm()
    us = np.tile(still(problem), (9, 1, 1))
    us[4, 3, 0] = np.nan
    found = rollout_many(problem, us, gradients=True)
    assert found.costs[4] == np.inf and np.isnan(found.du[4]).all()
    assert np.isfinite(found.xs[4, :4]).all() and np.isnan(found.xs[4, 4:]).all()
    others = [0, 1, 2, 3, 5, 6, 7, 8]
    assert np.isfinite(found.costs[others]).all() and (found.costs[others] == found.costs[0]).all()


def test_bad_arguments_are_named() -> None:
    problem = arm()
    us = np.tile(still(problem), (3, 1, 1))
    with pytest.raises(ValueError, match="us"):
        rollout_many(problem, us[:, 1:])
    with pytest.raises(ValueError, match="x0"):
        rollout_many(problem, us, np.zeros(13))
    with pytest.raises(ValueError, match="threads: expected at least 1"):
        rollout_many(problem, us, threads=0)
    with pytest.raises(ProblemError, match="x0"):
        rollout_many(problem, us, np.full(14, np.nan))


def test_actions_in_python_are_refused() -> None:
    end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
    problem = Problem([1.0], [Action(1, 1, lambda t, x, u: (x + u, 0.5 * u @ u))], [0] * 2, end)
    with pytest.raises(ProblemError, match="cannot be copied"):
        rollout_many(problem, np.zeros((2, 2, 1)))
