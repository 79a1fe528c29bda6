"""Parameters of a problem: vectors with names that are set without building the problem again."""

import copy
import json
import pickle

import numpy as np
import pytest

import condyle
from condyle import inertial_parameters
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    Limit,
    Problem,
    ProblemError,
    Residual,
    Sensitivity,
)

REST = np.r_[0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2, np.zeros(7)]


def arm_problem(arm: condyle.Model, lower: float = -40.0) -> Problem:
    reach = Cost("reach", 20.0, Residual.frame_translation(arm, "tool", [0.3, 0.3, 0.5]))
    rest = Cost("rest", 0.2, Residual.state(REST), Activation.weighted(np.ones(14)))
    effort = Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    bounds = {"lower": np.full(7, lower), "upper": np.full(7, 40.0)}
    knot = FreeDynamics(arm, 0.05, [rest, effort, reach], **bounds)
    return Problem(REST, [knot], [0] * 10, FreeDynamics(arm, None, [rest, reach]))


def evaluated(problem: Problem) -> np.ndarray:
    found = problem.evaluate(np.tile(problem.x0, (problem.horizon + 1, 1)), np.full((problem.horizon, 7), 0.5))
    return np.r_[found.costs, found.next_states.ravel()]


def test_names_and_sizes() -> None:
    arm = condyle.robots.arm7()
    problem = arm_problem(arm)
    sizes = problem.parameters()
    link = arm.body_names[4]
    expected = {
        "x0": 14, "duration": 1, "target/reach": 3, "weight/effort": 1, "entry_weights/rest": 14, "bounds/lower": 7,
        "bounds/upper": 7, f"inertia/{link}": 10, "gravity": 3, "armature": 7,
    }  # fmt: skip
    assert expected.items() <= sizes.items()
    values = problem.parameter_values()
    assert {name: len(value) for name, value in values.items()} == sizes
    assert np.array_equal(values[f"inertia/{link}"], inertial_parameters.from_inertia(arm.inertias[4]))
    assert np.array_equal(values["bounds/lower"], np.full(7, -40.0))


def test_a_changed_problem_equals_one_that_is_built() -> None:
    arm = condyle.robots.arm7()
    link, heavier = arm.body_names[4], inertial_parameters.from_inertia(arm.inertias[4]) * 1.2
    inertias = [
        inertial_parameters.to_inertia(heavier) if k == 4 else inertia for k, inertia in enumerate(arm.inertias)
    ]
    moon = arm.with_inertias(inertias).with_gravity([0.0, 0.0, -1.6]).with_armature(np.full(7, 0.2))
    built, problem = arm_problem(moon, lower=-30.0), arm_problem(arm)
    assert np.abs(evaluated(built) - evaluated(problem)).max() > 1e-3
    problem.set_parameters(
        {
            f"inertia/{link}": heavier,
            "gravity": [0.0, 0.0, -1.6],
            "armature": np.full(7, 0.2),
            "bounds/lower": np.full(7, -30.0),
        }
    )
    assert np.allclose(evaluated(problem), evaluated(built), rtol=1e-12, atol=1e-13)
    # the file and the solutions have the changes too
    again = Problem.from_json(problem.to_json())
    assert np.allclose(evaluated(again), evaluated(built), rtol=1e-12, atol=1e-13)
    assert np.array_equal(again.parameter("bounds/lower"), np.full(7, -30.0))
    us = built.quasi_static(np.tile(REST, (11, 1)))
    found = [Fddp(one).solve(np.tile(REST, (11, 1)), us) for one in (built, problem)]
    assert np.allclose(found[0].us, found[1].us, rtol=1e-9, atol=1e-9)
    # a dict of vectors is stored as JSON
    text = json.dumps({name: value.tolist() for name, value in problem.parameter_values(["gravity"]).items()})
    other = arm_problem(arm)
    other.set_parameters(json.loads(text))
    assert np.array_equal(other.parameter("gravity"), [0.0, 0.0, -1.6])
    assert np.array_equal(arm.gravity, [0.0, 0.0, -9.81])  # the model of the caller is unchanged


def test_a_solver_continues_with_changed_numbers() -> None:
    arm = condyle.robots.arm7()
    problem = arm_problem(arm)
    solver = Fddp(problem, max_iterations=300)
    us = problem.quasi_static(np.tile(REST, (11, 1)))
    assert solver.solve(np.tile(REST, (11, 1)), us).status == "converged"
    problem.set_parameter("gravity", [0.0, 0.0, -9.0])
    light = arm_problem(arm.with_gravity([0.0, 0.0, -9.0]))
    solutions = [one.solve(np.tile(REST, (11, 1)), us) for one in (solver, Fddp(light, max_iterations=300))]
    assert np.allclose(solutions[0].us, solutions[1].us, rtol=1e-6, atol=1e-6)


def test_gradients_with_respect_to_numbers_of_the_robot() -> None:
    arm = condyle.robots.arm7().with_armature(np.full(7, 0.1))
    problem = arm_problem(arm)
    solver = Fddp(problem, max_iterations=500)
    assert solver.solve(np.tile(REST, (11, 1)), problem.quasi_static(np.tile(REST, (11, 1)))).status == "converged"
    sensitivity = Sensitivity(solver, curvature="gauss_newton")
    by_us = np.ones((10, 7))
    gradient = sensitivity.gradient("gravity", by_us=by_us)

    def build(change: np.ndarray) -> Problem:
        return arm_problem(arm.with_gravity(np.array([0.0, 0.0, -9.81]) + change))

    sensitivity.define("own gravity", 3, build)
    assert np.allclose(gradient, sensitivity.gradient("own gravity", by_us=by_us), rtol=1e-6, atol=1e-8)
    assert np.array_equal(problem.parameter("gravity"), [0.0, 0.0, -9.81])


def gradient_of_controls(problem: Problem, name: str) -> np.ndarray:
    """Returns the gradient of the sum of all controls with respect to a parameter, with exact curvature."""
    start = np.tile(problem.x0, (problem.horizon + 1, 1))
    solver = Fddp(problem, max_iterations=500, tolerance=1e-14)
    assert solver.solve(start, problem.quasi_static(start)).status == "converged"
    nu = problem.parameters()["bounds/lower"]
    return Sensitivity(solver, tolerance=1e-3).gradient(name, by_us=np.ones((problem.horizon, nu)))


@pytest.mark.parametrize("inertia", [np.zeros(10), np.r_[0.1, np.zeros(9)], np.r_[np.zeros(4), 1e-3 * np.eye(6)[0]]])
def test_links_without_mass_or_extent_have_gradients(inertia: np.ndarray) -> None:
    arm = condyle.robots.arm7().with_armature(np.full(7, 0.1))
    name = f"inertia/{arm.body_names[7]}"
    found = []
    for added in (np.zeros(10), np.r_[1e-4, 0.0, 0.0, 0.0, 1e-6 * np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0])]):
        problem = arm_problem(arm, -200.0)
        problem.set_parameter("bounds/upper", np.full(7, 200.0))
        if inertia[4] > 0.0:
            inertia = np.r_[inertia[:4], 1e-3, 0.0, 1e-3, 0.0, 0.0, 1e-3]
        problem.set_parameter(name, inertia + added)
        found.append(gradient_of_controls(problem, name))
    assert np.abs(found[1]).min() > 0.0
    assert np.allclose(found[0], found[1], rtol=0.02, atol=1e-3 * np.abs(found[1]).max())


def test_gradients_by_armature_without_armature() -> None:
    arm = condyle.robots.arm7()
    assert not arm.armature.any()
    found = [gradient_of_controls(arm_problem(arm.with_armature(np.full(7, x))), "armature") for x in (0.0, 1e-6)]
    assert np.allclose(found[0], found[1], rtol=1e-3, atol=1e-4 * np.abs(found[1]).max())


def test_armature_of_a_free_joint() -> None:
    robot = condyle.robots.quadruped()
    x0 = np.r_[condyle.neutral(robot), np.zeros(robot.nv)]
    costs = [Cost("rest", 1.0, Residual.state(x0)), Cost("effort", 0.1, Residual.control(np.ones(12)))]
    knot = FreeDynamics(robot, 0.02, costs, lower=np.full(12, -90.0), upper=np.full(12, 90.0))
    gradient = gradient_of_controls(Problem(x0, [knot] * 3, None, FreeDynamics(robot, None, costs[:1])), "armature")
    assert gradient.shape == (18,) and np.isfinite(gradient).all() and gradient[6:].all()
    assert gradient[0] == gradient[1] == gradient[2]


def test_impossible_inertias() -> None:
    arm = condyle.robots.arm7()
    problem, name = arm_problem(arm), f"inertia/{arm.body_names[7]}"
    before = problem.parameter(name)
    for inertia, match in (
        ([1, 0, 0, 0, -1, 0, 0.1, 0, 0, 0.1], "a principal moment of inertia is -1"),
        ([1, 0, 0, 0, 1, 0, 10, 0, 0, 1], "break the triangle inequality"),
        ([0, 1, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1], "has no mass and a first moment of mass"),
        (np.zeros(10), "the inertia matrix is singular"),
    ):
        with pytest.raises(ProblemError, match=f"parameter `{name}`: .*{match}"):
            problem.set_parameter(name, inertia)
        assert np.array_equal(problem.parameter(name), before)
    with pytest.raises(ProblemError, match="parameter `gravity`: `numbers\\[0\\]` is NaN"):
        problem.set_parameter("gravity", [np.nan] * 3)


def test_variations_do_not_change_the_problem() -> None:
    problem = arm_problem(condyle.robots.arm7())

    def vary(problem: Problem, gravity: float) -> None:
        problem.set_parameter("gravity", [0.0, 0.0, gravity])
        problem.set_parameter("bounds/upper", np.full(7, 35.0))

    condyle.sweep(problem, [-3.0, -2.0], vary=vary)
    for same in (problem, copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))):
        assert np.array_equal(same.parameter("gravity"), [0.0, 0.0, -9.81])
        assert np.array_equal(same.parameter("bounds/upper"), np.full(7, 40.0))


def test_friction() -> None:
    robot = condyle.robots.quadruped()
    foot = condyle.ContactConstraint("LF_foot", "point")
    cone = FrictionCone(0.5)
    grip = Limit("grip", Residual.friction_cone("LF_foot", cone), *cone.bounds())
    knot = ContactDynamics(robot, {"LF_foot": foot}, 0.02, [], limits=[grip])
    x0 = np.r_[condyle.neutral(robot), np.zeros(robot.nv)]
    problem = Problem(x0, [knot], [0] * 3, FreeDynamics(robot, None, []))
    assert np.array_equal(problem.parameter("friction/grip"), [0.5])
    problem.set_parameter("friction/grip", [0.3])
    assert np.array_equal(Problem.from_json(problem.to_json()).parameter("friction/grip"), [0.3])
    with pytest.raises(ProblemError, match="parameter `friction/grip`: expected a finite coefficient of at least 0"):
        problem.set_parameter("friction/grip", [-0.3])


def test_errors() -> None:
    arm = condyle.robots.arm7()
    problem, link = arm_problem(arm), arm.body_names[4]
    with pytest.raises(ProblemError, match="`speed` is no parameter; expected `x0`, `duration`, `target/NAME`"):
        problem.parameter("speed")
    with pytest.raises(ProblemError, match="does not have the parameter `inertia/nobody`"):
        problem.set_parameter("inertia/nobody", np.ones(10))
    with pytest.raises(ProblemError, match="expected length 10, found 3"):
        problem.set_parameter(f"inertia/{link}", np.ones(3))
    with pytest.raises(ProblemError, match=f"parameter `inertia/{link}`: "):
        problem.set_parameter(f"inertia/{link}", np.r_[-1.0, np.zeros(9)])
    with pytest.raises(ProblemError, match="expected numbers with each lower bound at most the upper one"):
        problem.set_parameter("bounds/upper", np.full(7, -50.0))
    problem.set_duration(2, 0.1)
    with pytest.raises(ProblemError, match="the value of `duration` differs from knot to knot"):
        problem.parameter("duration")
    assert "duration" not in problem.parameter_values()
