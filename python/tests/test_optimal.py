"""Tests of optimal control: user-defined actions, costs by name and by knot, errors."""

import pickle
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    FrictionCone,
    ImpulseDynamics,
    Limit,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    WrenchCone,
)

ARM = condyle.robots.arm7()
QUADRUPED = condyle.robots.quadruped()
X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
STANDING = np.r_[condyle.neutral(QUADRUPED), np.zeros(18)]
# Tolerance between two optima of the same problem, each found with a tolerance of 1e-9 of the cost.
OPTIMUM = 1e-8


def end() -> FreeDynamics:
    return FreeDynamics(ARM, None, [Cost("end", 1.0, Residual.state(X0))])


def test_written_derivatives_and_differences_find_one_optimum() -> None:
    def calc(t: int, x: Any, u: Any) -> Any:
        cost = 1.0 - np.cos(x[0]) + 0.5 * x[1] ** 2 + 0.5 * u @ u
        return (np.r_[x[0] + 0.1 * x[1], x[1] + 0.1 * (u[0] - np.sin(x[0]))] if len(u) else None), cost

    def calc_diff(t: int, x: Any, u: Any) -> Any:
        d = {"q": np.r_[np.sin(x[0]), x[1]], "Q": np.diag([np.cos(x[0]), 1.0])}
        if len(u):
            d |= {"A": np.array([[1.0, 0.1], [-0.1 * np.cos(x[0]), 1.0]]), "B": [[0.0], [0.1]], "R": [[1.0]], "r": u}
        return d

    costs = []
    for derivatives in (calc_diff, None):
        knot, last = Action(2, 1, calc, derivatives), Action(2, 0, calc, derivatives)
        problem = Problem([1.0, 0.0], [knot], [0] * 20, last)
        solution = Fddp(problem).solve(np.zeros((21, 2)), np.zeros((20, 1)))
        assert solution.status == "converged"
        costs.append(solution.cost)
    np.testing.assert_allclose(costs[0], costs[1], rtol=OPTIMUM)


@pytest.mark.parametrize(
    ("calc", "error"),
    [
        (lambda t, x, u: 1 / 0, ZeroDivisionError),
        (lambda t, x, u: (np.zeros(3), 0.0), ValueError),
        (lambda t, x, u: None, TypeError),
    ],
)
def test_what_an_action_raises_is_raised(calc: Any, error: type[Exception]) -> None:
    problem = Problem([1.0], [Action(1, 1, calc)], [0] * 3, Lqr([[1.0]], Q=[[1.0]]))
    with pytest.raises(error):
        Fddp(problem).solve(np.zeros((4, 1)), np.zeros((3, 1)))


def test_weights_change_between_solves() -> None:
    knot = FreeDynamics(
        ARM, 0.05, [Cost("rest", 1.0, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    )
    problem = Problem(X0, [knot], [0] * 5, end())
    start = np.tile(X0, (6, 1)), np.tile(knot.quasi_static(X0), (5, 1))
    before = Fddp(problem).solve(*start).cost
    problem.set_weight("effort", 1e-1)
    assert Fddp(problem).solve(*start).cost > before
    with pytest.raises(KeyError, match="no knot has a cost 'thrust'"):
        problem.set_weight("thrust", 1.0)


def test_knots_may_have_costs_of_their_own() -> None:
    def effort(weight: float) -> list[Cost]:
        return [Cost("effort", weight, Residual.control(np.zeros(7)))]

    def solve(models: list[Any], knot_models: list[int]) -> float:
        problem = Problem(X0, models, knot_models, end())
        return Fddp(problem).solve(np.tile(X0, (4, 1)), np.ones((3, 7))).cost

    one = FreeDynamics(ARM, 0.05, effort(1.0), {1: effort(5.0)})
    two = [FreeDynamics(ARM, 0.05, effort(w)) for w in (1.0, 5.0)]
    np.testing.assert_allclose(solve([one], [0, 0, 0]), solve(two, [0, 1, 0]), rtol=OPTIMUM)


def test_controls_of_unlike_knots_are_lists() -> None:
    feet = {foot: condyle.ContactConstraint(foot, "point") for foot in ("LF_foot", "RH_foot")}
    rest = Cost("rest", 1.0, Residual.state(STANDING))
    stance = ContactDynamics(QUADRUPED, feet, 0.01, [rest, Cost("effort", 1e-2, Residual.control(np.zeros(12)))])
    impact = ImpulseDynamics(QUADRUPED, feet, [rest], damping=1e-9)
    problem = Problem(STANDING, [stance, impact], [0, 1, 0], FreeDynamics(QUADRUPED, None, [rest]))
    hold = stance.quasi_static(STANDING)
    solution = Fddp(problem, max_iterations=2).solve(np.tile(STANDING, (4, 1)), [hold, np.zeros(0), hold])
    assert [len(u) for u in solution.us] == [12, 0, 12]
    assert [K.shape for K in solution.K] == [(12, 36), (0, 36), (12, 36)]
    assert min(solution.timings) >= 0.0
    with pytest.raises(ValueError, match=r"us\[1\]"):
        Fddp(problem).solve(np.tile(STANDING, (4, 1)), [hold, hold, hold])


def test_accelerations_may_be_the_controls() -> None:
    knot = FreeInverseDynamics(ARM, 0.1, [Cost("effort", 1e-2, Residual.joint_effort(np.zeros(7)))])
    problem = Problem(X0, [knot], [0], end())
    np.testing.assert_allclose(problem.rollout(np.ones((1, 7)))[1, 7:], 0.1)


def test_residuals_are_values() -> None:
    reach = Residual.frame_translation(ARM, "tool", [0.4, 0.2, 0.5])
    assert reach == Residual.frame_translation(ARM, ARM.frame("tool"), np.array([0.4, 0.2, 0.5]))
    assert reach != Residual.frame_translation(ARM, "tool", [0.4, 0.2, 0.6])
    assert reach != Residual.center_of_mass([0.4, 0.2, 0.5])
    assert repr(Residual.control([1.0])) == '<condyle.optimal.Residual {"control":{"reference":[1.0]}}>'
    # one residual may be used in several terms of the same knot or of different knots
    terms = [Cost("far", 1.0, reach), Cost("near", 10.0, reach, Activation.smooth2(1e-2))]
    problem = Problem(X0, [FreeDynamics(ARM, 0.1, terms)], [0], FreeDynamics(ARM, None, [terms[0]]))
    assert problem.to_json().count('"frame_translation"') == 3


def test_cones_have_bounds_of_their_own() -> None:
    feet = {"foot": condyle.ContactConstraint("LF_foot", "rigid")}
    cone, box = FrictionCone(0.7, greatest=200.0), [0.2, 0.1]
    for residual, (lower, upper) in (
        (Residual.friction_cone("foot", cone), cone.bounds()),
        (Residual.wrench_cone("foot", WrenchCone(cone, box)), WrenchCone(cone, box).bounds()),
        (Residual.center_of_pressure("foot", box), (np.full(4, -np.inf), np.zeros(4))),
    ):

        def text(cost: Cost, limit: Limit) -> str:
            stance = ContactDynamics(QUADRUPED, feet, 0.01, [cost], limits=[limit])
            return Problem(STANDING, [stance], [0], FreeDynamics(QUADRUPED, None, [])).to_json()

        told = text(Cost("c", 1.0, residual, Activation.barrier(lower, upper)), Limit("l", residual, lower, upper))
        assert text(Cost("c", 1.0, residual), Limit("l", residual)) == told
        assert text(Cost("c", 1.0, residual, Activation.quadratic()), Limit("l", residual)) != told


def test_what_does_not_fit_is_refused_by_name() -> None:
    feet = {"foot": condyle.ContactConstraint("LF_foot", "point")}
    twice = {"one": condyle.ContactConstraint("LF_foot", "point"), "two": condyle.ContactConstraint("LF_foot", "rigid")}
    cone = Cost("grip", 1.0, Residual.friction_cone("hand", FrictionCone(0.7)))
    with pytest.raises(ProblemError, match="cost `grip`: there is no contact `hand` at this knot; there is `foot`"):
        ContactDynamics(QUADRUPED, feet, 0.01, [cone])
    with pytest.raises(ProblemError, match="together they are singular without damping"):
        ContactDynamics(QUADRUPED, twice, 0.01, [])
    with pytest.raises(ProblemError, match="cost `effort`: its reference has 6 numbers, expected 7"):
        FreeDynamics(ARM, 0.01, [Cost("effort", 1.0, Residual.control(np.zeros(6)))])
    with pytest.raises(ProblemError, match="its ε is 0"):
        FreeDynamics(ARM, 0.01, [Cost("effort", 1.0, Residual.control(np.zeros(7)), Activation.smooth1(0.0))])
    with pytest.raises(condyle.ModelError, match="unknown frame `hand`"):
        Cost("reach", 1.0, Residual.frame_translation(ARM, "hand", np.zeros(3)))
    with pytest.raises(ValueError, match="integrator: expected"):
        FreeDynamics(ARM, 0.01, [], integrator="explicit_euler")  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match=r"`x0\[0\]` is NaN"):
        Problem(np.full(14, np.nan), [FreeDynamics(ARM, 0.01, [])], [0], end())
    with pytest.raises(ProblemError, match="the horizon is empty"):
        Problem(X0, [], [], end())
    with pytest.raises(TypeError, match="models: expected an action, found 'int'"):
        Problem(X0, [3], [0], end())  # type: ignore[list-item]


def every_kind_of_knot(landing: bool = False) -> Problem:
    feet = {foot: condyle.ContactConstraint(foot, "point", kd=20.0) for foot in ("LF_foot", "RH_foot")}
    cone = Cost("cone", 1e-2, Residual.friction_cone("LF_foot", FrictionCone(0.7, greatest=200.0)))
    rest, still = Cost("rest", 1.0, Residual.state(STANDING)), Cost("still", 1e-2, Residual.control(np.zeros(12)))
    lower = np.full(12, -30.0)
    models = [
        ContactDynamics(QUADRUPED, feet, 0.02, [rest, still, cone], costs_at={1: [rest, still]}, lower=lower),
        ImpulseDynamics(QUADRUPED, feet, [Cost("landing", 1e-3, Residual.impulse_center_of_mass())], restitution=0.1),
        FreeDynamics(QUADRUPED, 0.02, [still], actuation=np.eye(18)[:, 6:], integrator="runge_kutta_2"),
    ]
    end = ImpulseDynamics(QUADRUPED, feet, [rest]) if landing else FreeDynamics(QUADRUPED, None, [rest])
    return Problem(STANDING, models, [0, 0, 2, 1, 0], end)


@pytest.mark.parametrize("landing", [False, True])
@pytest.mark.parametrize("again", [lambda p: Problem.from_json(p.to_json()), lambda p: pickle.loads(pickle.dumps(p))])
def test_a_problem_in_a_file(again: Any, landing: bool) -> None:
    problem = every_kind_of_knot(landing)
    problem.set_weight("rest", 3.0)
    problem.set_x0(STANDING + np.r_[0.0, 0.0, 0.1, np.zeros(34)])
    us = [np.zeros(12)] * 3 + [np.zeros(0)] + [np.zeros(12)]
    one, other = (Fddp(p).solve(np.tile(STANDING, (6, 1)), us) for p in (problem, again(problem)))
    np.testing.assert_array_equal(one.xs, other.xs)
    assert [i.cost for i in one.trace] == [i.cost for i in other.trace]
    assert len(one.trace) > 1


def test_what_no_file_can_hold() -> None:
    rest = Cost("rest", 1.0, Residual.state(X0))
    knot, last = FreeDynamics(ARM, 0.1, [rest]), FreeDynamics(ARM, None, [rest])
    own = Action(14, 0, lambda t, x, u: (x, 0.0))
    with pytest.raises(ProblemError, match=r"models\[1\]: expected an action of a robot"):
        Problem(X0, [knot, own], [0, 1], last).to_json()
    with pytest.raises(ProblemError, match="terminal: expected the robot of the first model"):
        Problem(X0, [knot], [0], FreeDynamics(ARM.with_gravity([0.0, 0.0, -1.6]), None, [rest])).to_json()
    with pytest.raises(ProblemError, match=r"knot 1: models\[1\] has no next state"):
        Problem(X0, [knot, last], [0, 1], last)
    text = Problem(X0, [knot], [0], last).to_json()
    with pytest.raises(ProblemError, match="no problem: missing field `knot_models`"):
        Problem.from_json(text.replace('"knot_models":[0],', ""))
    with pytest.raises(ProblemError, match="there is no action model 3"):
        Problem.from_json(text.replace('"knot_models":[0]', '"knot_models":[3]'))


def test_costs_of_a_knot_move_with_it() -> None:
    """Checks that a horizon that was shifted and got new targets at its end equals a horizon that has these targets
    from the start.
    """
    horizon = 12

    def follow(time: int) -> list[Cost]:
        point = [0.4, 0.01 * time, 0.5]
        reach = Cost("reach", 10.0 + time, Residual.frame_translation(ARM, "tool", point))
        return [Cost("rest", 1e-1, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7))), reach]

    def end_costs(time: int) -> list[Cost]:
        rest, _, reach = follow(time)
        return [rest, reach]

    def problem(start: int, x0: np.ndarray) -> Problem:
        costs_at = {t: follow(start + t) for t in range(horizon)}
        end = FreeDynamics(ARM, None, end_costs(start + horizon))
        return Problem(x0, [FreeDynamics(ARM, 0.05, [], costs_at)], [0] * horizon, end)

    moving = problem(0, X0)
    solver = Fddp(moving)
    last = solver.solve(np.tile(X0, (horizon + 1, 1)), np.zeros((horizon, 7)))
    for start in range(1, 4):
        x0 = last.xs[1] + 1e-3
        moving.set_x0(x0)
        solver.shift(0)
        moving.set_costs(horizon - 1, follow(start + horizon - 1))
        moving.set_costs(horizon, end_costs(start + horizon))
        last = solver.resume()
        for fresh in (Problem.from_json(moving.to_json()), problem(start, x0)):
            expected = Fddp(fresh).solve(np.array(last.xs), np.array(last.us))
            assert expected.status == "converged"
            np.testing.assert_allclose(np.array(expected.us), np.array(last.us), atol=1e-4)
            assert expected.cost == pytest.approx(last.cost, rel=1e-9)
    with pytest.raises(ProblemError, match="knot 13: expected 0 to 12"):
        moving.set_costs(13, [])
    with pytest.raises(ProblemError, match="cost `cone`"):
        moving.set_costs(3, [Cost("cone", 1.0, Residual.friction_cone("hand", FrictionCone(0.7)))])
    own = Problem([0.0], [Action(1, 1, lambda t, x, u: (x + u, 0.0))], [0], Action(1, 0, lambda t, x, u: (None, 0.0)))
    with pytest.raises(ProblemError, match="knot 0: expected an action of a robot"):
        own.set_costs(0, [])
