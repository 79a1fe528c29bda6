"""Tests of distances between spheres: values and derivatives, limits, files, errors."""

import pickle

import numpy as np
import pytest

import condyle
from condyle.distances import Geometry, Shape
from condyle.optimal import (
    Activation,
    AugmentedLagrangian,
    Cost,
    FreeDynamics,
    InteriorPoint,
    Limit,
    Problem,
    ProblemError,
    Residual,
    Sphere,
)

ARM = condyle.robots.arm7()
X0 = np.r_[-0.6, 0.9, 0.0, 1.2, 0.0, 0.4, 0.0, np.zeros(7)]
# Tolerance of sums of a few products, and of central differences with a step of 1e-6.
ROUNDING, DIFFERENCES = 1e-12, 1e-8


def at(x: np.ndarray, cost: Cost) -> tuple[float, np.ndarray]:
    """Returns the value and the gradient of a cost at the state x of a terminal knot."""
    problem = Problem(x, [FreeDynamics(ARM, 0.1, [])], [0], FreeDynamics(ARM, None, [cost]))
    xs, us = np.tile(x, (2, 1)), np.zeros((1, 7))
    return problem.evaluate(xs, us).cost, problem.derivatives(xs, us)[1].q


def pose(x: np.ndarray, frame: str | int) -> np.ndarray:
    return condyle.frame_placement(ARM, condyle.Data(ARM), x[:7], frame)


@pytest.mark.parametrize("seed", range(5))
def test_a_distance_is_that_of_the_centres_less_the_radii(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, (a, b, c) = np.r_[rng.uniform(-1.0, 1.0, 7), np.zeros(7)], rng.uniform(-0.3, 0.3, (3, 3))
    tool = Sphere(a, 0.1, "tool")
    residual = Residual.distances(ARM, [(tool, Sphere(b, 0.2)), (Sphere(c, frame=3), tool)])

    def expected(x: np.ndarray) -> float:
        p, q = (X[:3, :3] @ center + X[:3, 3] for X, center in ((pose(x, "tool"), a), (pose(x, 3), c)))
        return float(np.linalg.norm(p - b) - 0.3 + np.linalg.norm(q - p) - 0.1)

    value, gradient = at(x, Cost("sum", 1.0, residual, Activation.sum()))
    assert abs(value - expected(x)) < ROUNDING
    numeric = [(expected(x + h) - expected(x - h)) / 2e-6 for h in 1e-6 * np.eye(14)]
    assert np.abs(gradient - numeric).max() < DIFFERENCES


def test_an_arm_keeps_its_tool_out_of_a_ball() -> None:
    goal, between = np.r_[0.6, X0[1:]], np.r_[0.0, X0[1:]]
    ball = Sphere(pose(between, "tool")[:3, 3], 0.1)
    clear = Limit("clear", Residual.distances(ARM, [(Sphere(np.zeros(3), 0.05, "tool"), ball)]), lower=[0.01])
    costs = [Cost("rest", 0.1, Residual.state(goal)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))]
    knot = FreeDynamics(ARM, 0.05, costs, limits=[clear])
    problem = Problem(X0, [knot], [0] * 20, FreeDynamics(ARM, None, [Cost("goal", 1e2, Residual.state(goal))]))
    xs, us = np.tile(X0, (21, 1)), np.tile(knot.quasi_static(X0), (20, 1))
    solution = AugmentedLagrangian(problem).solve(xs, us)
    assert solution.status == "converged"
    nearest = min(np.linalg.norm(pose(x, "tool")[:3, 3] - ball.center) - 0.15 for x in solution.xs)
    assert abs(nearest - 0.01) < 1e-5
    again = Problem.from_json(problem.to_json())
    assert np.array_equal(AugmentedLagrangian(again).solve(xs, us).xs, solution.xs)


def test_no_bounds_mean_no_overlap() -> None:
    far, near = Sphere([5.0, 0.0, 0.0], 0.1), Sphere(pose(X0, "tool")[:3, 3], 0.1)
    residual = Residual.distances(ARM, [(Sphere([0.0, 0.0, 0.1], 0.1, "tool"), other) for other in (far, near)])
    # the spheres of the second pair overlap by 0.1 m, the spheres of the first pair do not
    assert abs(at(X0, Cost("apart", 2.0, residual))[0] - 0.1**2) < ROUNDING
    _, (*_, lower, upper, _) = Limit("apart", residual).__reduce__()
    assert (lower, upper) == ([0.0, 0.0], [np.inf, np.inf])


def test_distances_are_copied_with_their_frames() -> None:
    residual = Residual.distances(ARM, [(Sphere([0.0, 0.0, 0.1], 0.1, "tool"), Sphere([0.5, 0.0, 0.5]))])
    assert pickle.loads(pickle.dumps(residual)) == residual
    assert repr(residual).startswith('<condyle.optimal.Residual {"distances":{"pairs":[{"first":{"frame":')
    sphere = Sphere([1.0, 2.0, 3.0], 0.5)
    assert pickle.loads(pickle.dumps(sphere)) == sphere
    assert repr(sphere) == "Sphere(center=[1.0, 2.0, 3.0], radius=0.5, frame=None)"


def test_an_obstacle_moves_in_all_knots() -> None:
    ball = Geometry(Shape.sphere([0.0, 0.0, 0.0], 0.1), name="ball")
    tool = Geometry(Shape.capsule([0.0, 0.0, -0.1], [0.0, 0.0, 0.0], 0.05), "tool", name="hand")
    placements = np.tile(np.eye(4), (6, 1, 1))
    placements[:, :3, 3] = pose(X0, "tool")[:3, 3] + np.linspace([0.0, 0.4, 0.0], [0.0, 0.25, 0.0], 6)

    def problem(balls: list[Geometry]) -> Problem:
        costs = [Cost("rest", 0.1, Residual.state(X0)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))]
        each = [Limit("clear", Residual.distances(ARM, [(tool, one)]), lower=[0.05]) for one in balls]
        knots = [FreeDynamics(ARM, 0.05, costs, limits=[limit]) for limit in each[:-1]]
        return Problem(X0, knots, list(range(5)), FreeDynamics(ARM, None, costs[:1], limits=each[-1:]))

    each = problem([ball._replace(placement=placement) for placement in placements])
    moved = problem([ball] * 6)
    moved.set_placements("ball", placements)
    xs, us = np.tile(X0, (6, 1)), np.zeros((5, 7))
    all_problems = (each, moved, pickle.loads(pickle.dumps(moved)))
    plans = [InteriorPoint(p, max_iterations=10).solve(xs, us) for p in all_problems]
    assert all(np.array_equal(plan.xs, plans[0].xs) for plan in plans)
    with pytest.raises(KeyError, match="no pair of distances has a geometry 'bal'"):
        moved.set_placements("bal", placements)
    placements[2, 3, 3] = 2.0
    with pytest.raises(ValueError, match=r"placements\[2\]: expected the last row \(0, 0, 0, 1\)"):
        moved.set_placements("ball", placements)


def test_a_violated_distance_is_named() -> None:
    hand, floor = Geometry(Shape.sphere([0.0] * 3, 0.05), "tool", name="hand"), Geometry(Shape.half_space([0, 0, 1], 5))
    clear = Limit("clear", Residual.distances(ARM, [(hand, floor)]), lower=[0.0])
    knot = FreeDynamics(ARM, 0.05, [Cost("effort", 1e-4, Residual.control(np.zeros(7)))], limits=[clear])
    solver = InteriorPoint(Problem(X0, [knot], [0] * 3, FreeDynamics(ARM, None, [])))
    solver.solve(np.tile(X0, (4, 1)), np.zeros((3, 7)))
    worst = solver.outcome.worst
    assert worst is not None and worst.what == "`hand` and half-space in the world"


def test_what_is_wrong_is_named() -> None:
    good = Sphere([0.0, 0.0, 0.1], 0.1, "tool")

    def refused(kind: type[Exception], text: str, pairs: object) -> None:
        with pytest.raises(kind, match=text):
            FreeDynamics(ARM, None, [Cost("apart", 1.0, Residual.distances(ARM, pairs))])  # type: ignore[arg-type]

    refused(TypeError, r"pairs: expected a list of pairs of spheres, found an int", 3)
    refused(TypeError, r"pairs\[0\]: expected two geometries, found a tuple of 3", [good])
    refused(TypeError, r"pairs\[0\]: expected a pair of geometries, found a float", [1.0])
    refused(TypeError, r"pairs\[1\]\[1\]: expected a `Sphere`, found a float", [(good, good), (good, 1.0)])
    refused(ValueError, r"pairs\[0\]\[1\].center", [(good, Sphere([0.0, 1.0]))])
    refused(TypeError, r"pairs\[0\]\[0\].radius: expected a number", [(Sphere([0.0] * 3, "r", "tool"), good)])  # type: ignore[arg-type]
    refused(condyle.ModelError, "`tol`", [(good, Sphere([0.0] * 3, 0.1, "tol"))])
    refused(
        ProblemError,
        r"its pairs\[0\].second \(sphere in the world\): radius is -0.1",
        [(good, Sphere([0.0] * 3, -0.1))],
    )
    refused(
        ProblemError,
        r"its pairs\[0\].first \(sphere on `tool`\): center holds a NaN",
        [(Sphere([np.nan] * 3, 0.1, "tool"), good)],
    )
    refused(ProblemError, r"its pairs\[0\] \(.* and .*\): has no frame", [(Sphere([0.0] * 3), Sphere([1.0] * 3))])
