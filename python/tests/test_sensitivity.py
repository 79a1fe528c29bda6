"""Derivatives of solutions, compared with differences of solutions."""

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Activation,
    AugmentedLagrangian,
    BoundGradients,
    Cost,
    Fddp,
    FreeDynamics,
    InteriorPoint,
    Limit,
    Problem,
    ProblemError,
    Residual,
    Sensitivities,
    Sensitivity,
    SensitivityReport,
)

KNOTS = 12
STEP = 1e-4
X0 = np.r_[0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2, np.zeros(7)]
GOAL = np.array([0.3, 0.3, 0.5])
SIDE = np.array([0.02, -0.01, 0.0])
BOUND = 27.0


@pytest.fixture(scope="module")
def arm() -> condyle.Model:
    return condyle.robots.arm7()


def problem_of(arm, x0=X0, goal=GOAL, weight=20.0, bound=BOUND):
    posture = Cost("posture", 0.2, Residual.state(X0), Activation.weighted(np.r_[np.ones(7), 0.3 * np.ones(7)]))
    reach = Cost("reach", weight, Residual.frame_translation(arm, "tool", goal))
    effort = Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    bounds = {} if bound is None else {"lower": np.full(7, -bound), "upper": np.full(7, bound)}
    running = FreeDynamics(arm, 0.05, [posture, effort, reach], **bounds)
    return Problem(x0, [running], [0] * KNOTS, FreeDynamics(arm, None, [posture, reach]))


def solved(problem, xs=None, us=None):
    solver = Fddp(
        problem,
        max_iterations=2000,
        tolerance=1e-20,
        tolerance_bounded=1e-20,
        second_order=True,
        flat=1e-6,
        regularisation_start=1e-9,
    )
    if xs is None:
        xs = np.tile(X0, (KNOTS + 1, 1))
        first = Fddp(problem, max_iterations=500)
        us = problem.quasi_static(xs)
        near = first.solve(xs, us)
        xs, us = near.xs, near.us
    assert solver.solve(xs, us).status == "converged"
    return solver


@pytest.fixture(scope="module")
def solver(arm):
    return solved(problem_of(arm))


@pytest.fixture(scope="module")
def loss():
    generator = np.random.default_rng(2)
    return generator.standard_normal((KNOTS + 1, 14)), generator.standard_normal((KNOTS, 7))


def difference(build, near, loss, size):
    """Returns the gradient of the loss with respect to `size` numbers, by differences of the fourth order."""

    def value(change):
        found = solved(build(change), near.xs, near.us).solution
        return np.sum(found.xs * loss[0]) + np.sum(found.us * loss[1])

    def slope(j, h):
        change = np.zeros(size)
        change[j] = h
        return (value(change) - value(-change)) / (2 * h)

    return np.array([(4 * slope(j, STEP) - slope(j, 2 * STEP)) / 3 for j in range(size)])


@pytest.mark.parametrize(
    ("name", "size", "build"),
    [
        ("target/reach", 3, lambda arm, p: problem_of(arm, goal=GOAL + p)),
        ("weight/reach", 1, lambda arm, p: problem_of(arm, weight=20.0 + 20.0 * p[0])),
        ("x0", 14, lambda arm, p: problem_of(arm, x0=X0 + p)),
    ],
)
def test_gradients_equal_differences_of_solutions(arm, solver, loss, name, size, build):
    sensitivity = Sensitivity(solver)
    gradient = sensitivity.gradient(name, *loss)
    numeric = difference(lambda p: build(arm, p), solver.solution, loss, size)
    if name.startswith("weight"):
        numeric /= 20.0
    assert gradient.shape == (size,)
    assert np.abs(gradient - numeric).max() < 1e-6 * np.abs(numeric).max()
    by_knot = sensitivity.gradient(name, *loss, by_knot=True)
    assert by_knot.shape == (KNOTS + 1, size)
    assert np.allclose(by_knot.sum(axis=0), gradient, rtol=1e-10, atol=1e-12)
    xs, us = sensitivity.jacobian(name)
    assert (xs.shape, us.shape) == ((KNOTS + 1, 14, size), (KNOTS, 7, size))
    forward = np.einsum("tin,ti->n", xs, loss[0]) + np.einsum("tin,ti->n", us, loss[1])
    assert np.abs(forward - gradient).max() < 1e-7 * np.abs(gradient).max()


def test_bounds_need_no_parameter(arm, solver, loss):
    sensitivity = Sensitivity(solver)
    bounds = sensitivity.bounds(*loss)
    assert isinstance(bounds, BoundGradients)
    assert np.array_equal(bounds.x0, sensitivity.gradient("x0", *loss))
    assert bounds.control_bounds.shape == (KNOTS, 7)
    report = sensitivity.report
    assert isinstance(report, SensitivityReport)
    assert report.curvature == "exact"
    assert report.active_controls == np.count_nonzero(bounds.control_bounds) > 0
    assert report.strict_complementarity
    numeric = difference(lambda p: problem_of(arm, bound=BOUND + 10.0 * p[0]), solver.solution, loss, 1) / 10.0
    ours = np.sum(bounds.control_bounds * np.sign(solver.solution.us))
    assert abs(ours - numeric[0]) < 1e-6 * np.abs(bounds.x0).max()


def test_own_parameters(arm, solver, loss):
    sensitivity = Sensitivity(solver)
    sensitivity.define("goal", 3, lambda change: problem_of(arm, goal=GOAL + change))
    assert np.allclose(sensitivity.gradient("goal", *loss), sensitivity.gradient("target/reach", *loss), rtol=1e-7)

    def broken(change):
        raise ZeroDivisionError("no robot")

    with pytest.raises(ZeroDivisionError, match="no robot"):
        sensitivity.define("broken", 1, broken)
    with pytest.raises(TypeError, match="build: expected to return a Problem, found int"):
        sensitivity.define("broken", 1, lambda change: 3)
    with pytest.raises(ProblemError, match="is no parameter"):
        sensitivity.gradient("broken", *loss)
    another = r"is another one than the solved problem: the cost of knot 0 is"
    with pytest.raises(ProblemError, match=another):
        sensitivity.define("goal", 3, lambda change: problem_of(arm, goal=GOAL + change + 0.1))
    with pytest.raises(ValueError, match='name: "target/reach" is a parameter that needs no definition'):
        sensitivity.define("target/reach", 3, lambda change: problem_of(arm, goal=GOAL + change))
    assert sensitivity.gradient("goal", *loss).shape == (3,)  # the first definition remains


def test_several_parameters_at_once(solver, loss):
    sensitivity = Sensitivity(solver)
    names = ["x0", "target/reach", "weight/reach"]
    found = sensitivity.gradients(names, *loss, by_knot=["target/reach"])
    assert [gradient.shape for gradient in found] == [(14,), (KNOTS + 1, 3), (1,)]
    for name, gradient in zip(names, found, strict=True):
        assert np.array_equal(gradient, sensitivity.gradient(name, *loss, by_knot=name == "target/reach"))
    assert sensitivity.gradients([], *loss) == []
    with pytest.raises(ValueError, match='by_knot: expected names of parameters, found "weight/rest"'):
        sensitivity.gradients(names, *loss, by_knot=["weight/rest"])


def test_many_solutions(arm):
    problem = problem_of(arm)
    names, each = ["x0", "target/reach"], []
    for k in range(10):
        problem.set_references("reach", np.tile(GOAL + k * SIDE, (KNOTS + 1, 1)))
        each.append(Sensitivity(solved(problem), curvature="gauss_newton").prepare(names))
    assert len({one.report.active_controls for one in each}) > 1
    generator = np.random.default_rng(3)
    by_xs, by_us = generator.standard_normal((10, KNOTS + 1, 14)), generator.standard_normal((10, KNOTS, 7))
    many = Sensitivities(each)
    assert (len(many), many.in_lanes) == (10, 10)
    found = many.gradients(names, by_xs, by_us, by_knot=["target/reach"])
    assert [gradient.shape for gradient in found] == [(10, 14), (10, KNOTS + 1, 3)]
    problem.set_x0(X0)  # this changes nothing
    last = each[-1].gradients(names, by_xs[-1], by_us[-1], by_knot=["target/reach"])
    for ours, alone in zip(found, last, strict=True):
        assert np.abs(ours[-1] - alone).max() < 1e-12 * np.abs(alone).max()
    with pytest.raises(ProblemError, match="has changed since the sensitivity was created"):
        each[0].gradient("x0", by_xs[0], by_us[0])  # the problem has the last target
    problem.set_references("reach", np.tile(GOAL, (KNOTS + 1, 1)))
    first = each[0].gradients(names, by_xs[0], by_us[0])
    assert np.abs(found[0][0] - first[0]).max() < 1e-12 * np.abs(first[0]).max()
    with pytest.raises(ValueError, match="by_xs"):
        many.gradients(names, by_xs[:3], by_us)
    with pytest.raises(ProblemError, match="the batch is empty"):
        Sensitivities([])


def test_the_gradient_of_the_first_control(solver):
    sensitivity = Sensitivity(solver)
    gain = sensitivity.first_control_by_x0()
    by_us = np.zeros((KNOTS, 7))
    for k in range(7):
        by_us[0] = np.eye(7)[k]
        assert np.allclose(sensitivity.bounds(by_us=by_us).x0, gain[k], rtol=1e-9, atol=1e-12)


def test_the_approximations_differ_from_the_exact_gradient(solver, loss):
    exact = Sensitivity(solver).gradient("target/reach", *loss)
    for curvature in ("dynamics", "gauss_newton"):
        other = Sensitivity(solver, curvature=curvature)
        assert other.report.curvature == curvature
        error = np.abs(other.gradient("target/reach", *loss) - exact).max() / np.abs(exact).max()
        assert 1e-4 < error < 1.0


@pytest.mark.parametrize("kind", [InteriorPoint, AugmentedLagrangian])
def test_limits(kind):
    """A cart that must end at a point: the final position depends only on this point."""
    cart = condyle.ModelBuilder("cart")
    inertia = condyle.Inertia.from_com(2.0, np.zeros(3), 0.1 * np.eye(3))
    cart.body("cart", condyle.WORLD, condyle.Joint.prismatic([1, 0, 0]), np.eye(4), inertia)
    cart = cart.build()
    effort = Cost("effort", 1.0, Residual.control([0.0]))
    end = FreeDynamics(cart, None, [], limits=[Limit("end", Residual.state([0.5, 0.0]))])
    problem = Problem(np.zeros(2), [FreeDynamics(cart, 0.1, [effort])], [0] * 10, end)
    solver = kind(problem)
    assert solver.solve(np.zeros((11, 2)), np.zeros((10, 1))).status == "converged"
    sensitivity = Sensitivity(solver)
    assert sensitivity.report.active_rows == 2
    # the final position moves with the bound of its equality, and not with the initial state
    by_xs = np.zeros((11, 2))
    by_xs[10, 0] = 1.0
    bounds = sensitivity.bounds(by_xs)
    assert np.allclose(bounds.row_bounds[10], [1.0, 0.0], atol=1e-8)
    assert np.allclose(bounds.x0, 0.0, atol=1e-8)


def test_errors(arm, loss):
    problem = problem_of(arm, bound=None)
    with pytest.raises(ProblemError, match="the solver has not solved the problem yet"):
        Sensitivity(Fddp(problem))
    short = Fddp(problem, max_iterations=1)
    short.solve(np.tile(X0, (KNOTS + 1, 1)), np.zeros((KNOTS, 7)))
    with pytest.raises(ProblemError, match="reached the limit of iterations, expected one that converged"):
        Sensitivity(short)
    solver = solved(problem)
    sensitivity = Sensitivity(solver)
    with pytest.raises(ProblemError, match="does not have the parameter `target/grasp`"):
        sensitivity.gradient("target/grasp", *loss)
    with pytest.raises(ProblemError, match="cost `effort`: it has no weights of entries"):
        sensitivity.gradient("entry_weights/effort", *loss)
    with pytest.raises(ValueError, match="by_xs"):
        sensitivity.gradient("x0", np.zeros((3, 14)))
    by_us = np.zeros((KNOTS, 7))
    by_us[0, 3] = np.nan
    with pytest.raises(ProblemError, match=r"`by_us\[3\]` is NaN, which is not finite"):
        sensitivity.gradient("x0", by_us=by_us)
    with pytest.raises(ValueError, match="by_us"):
        sensitivity.gradient("x0", by_us=np.zeros((KNOTS, 3)))
    with pytest.raises(ValueError, match="curvature: expected 'exact', 'dynamics' or 'gauss_newton', found 'hessian'"):
        Sensitivity(solver, curvature="hessian")
    with pytest.raises(TypeError, match="or AugmentedLagrangian, found Problem"):
        Sensitivity(problem)
    problem.set_weight("reach", 40.0)
    with pytest.raises(ProblemError, match="has changed since the sensitivity was created"):
        sensitivity.gradient("target/reach", *loss)
    with pytest.raises(ProblemError, match="the solution is inexact, or the problem has changed since the solve"):
        Sensitivity(solver)
