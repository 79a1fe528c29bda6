"""Tests of `condyle.jax.ProblemLayer`: gradients, transformations, warm starts, types and errors."""

import copy
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import Activation, Cost, FreeDynamics, Problem, ProblemError, Residual, Sensitivity

jax = pytest.importorskip("jax")

import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

from condyle.jax import ProblemLayer  # noqa: E402

KNOTS = 8
ARM = condyle.robots.arm7()
X0 = np.r_[0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2, np.zeros(7)]
GOAL = np.array([0.3, 0.3, 0.5])
ALONG = [np.random.default_rng(0).standard_normal(shape) for shape in ((KNOTS + 1, 14), (KNOTS, 7))]


@pytest.fixture(autouse=True)
def float64() -> Iterator[None]:
    with jax.enable_x64(True):
        yield


def arm_problem(bound: float = 26.0) -> Problem:
    rest = Cost("rest", 0.2, Residual.state(X0), Activation.weighted(np.r_[np.ones(7), 0.3 * np.ones(7)]))
    effort = Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    reach = Cost("reach", 20.0, Residual.frame_translation(ARM, "tool", GOAL))
    bounds = {"lower": np.full(7, -bound), "upper": np.full(7, bound)}
    knot = FreeDynamics(ARM, 0.05, [rest, effort, reach], **bounds)
    return Problem(X0, [knot], [0] * KNOTS, FreeDynamics(ARM, None, [rest, reach]))


def loss(solution: Any) -> Any:
    """Returns a number, about 1, that depends nonlinearly on all states and controls."""
    xs, us = solution
    return 1e-2 * (jnp.sin(xs) * ALONG[0]).sum() + 1e-3 * (us * ALONG[1]).sum()


def test_gradients_equal_differences_with_active_bounds() -> None:
    layer = ProblemLayer(arm_problem(), ["x0", "target/reach", "weight/reach"])
    function = jax.jit(lambda x0, goal, weight: loss(layer(x0, goal, 20.0 * weight)))
    assert (np.abs(layer(X0, GOAL, 20.0)[1]) == 26.0).any()
    values = (jnp.array(X0), jnp.array(GOAL), jnp.array(1.0))
    check_grads(function, values, order=1, modes=["rev"], eps=5e-5, atol=1e-5, rtol=1e-5)


def test_numbers_of_the_robot() -> None:
    problem = arm_problem(1e3)
    inertia, gravity = (jnp.array(problem.parameter(name)) for name in ("inertia/link4", "gravity"))
    layer = ProblemLayer(problem, ["inertia/link4", "gravity"])
    values = (jnp.ones(10), jnp.ones(3))
    check_grads(
        lambda a, b: loss(layer(a * inertia, b * gravity)), values, 1, modes=["rev"], eps=5e-5, atol=1e-5, rtol=1e-5
    )


def test_transformations() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["target/reach", "weight/reach"])
    goals = jnp.array([GOAL, GOAL + 0.05])
    by_xs, by_us = jax.jacrev(layer)(goals[1], 20.0)
    expected = Sensitivity(layer._solves.solver).jacobian("target/reach")
    assert np.allclose(by_xs, expected[0], atol=1e-6) and np.allclose(by_us, expected[1], atol=1e-4)
    single = jax.grad(lambda goal, weight: loss(layer(goal, weight)), (0, 1))
    by_goals, by_weight = jax.jit(jax.vmap(single, (0, None)))(goals, 20.0)
    assert by_goals.shape == (2, 3) and by_weight.shape == (2,)
    for i in range(2):
        slopes = single(goals[i], 20.0)
        assert np.allclose(slopes[0], by_goals[i], rtol=1e-5, atol=1e-7)
        assert np.allclose(slopes[1], by_weight[i], rtol=1e-5, atol=1e-7)
    both = jax.grad(lambda weight: loss(layer(goals, weight)))(20.0)
    assert np.allclose(both, by_weight.sum(), rtol=1e-5)


def test_warm_starts_are_kept() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["target/reach"])
    goals = jnp.array([GOAL, GOAL - 0.1])
    jax.block_until_ready(layer(goals, rows=["a", "b"]))
    first = layer.iterations
    jax.block_until_ready(layer(goals[::-1] + 1e-3, rows=["b", "a"]))
    assert all(a < b for a, b in zip(layer.iterations, reversed(first), strict=True))
    jax.block_until_ready(layer(goals, rows=jnp.array([5, 7])))
    jax.block_until_ready(layer(goals + 1e-3, rows=[5, 7]))
    assert all(a < b for a, b in zip(layer.iterations, first, strict=True))


def test_durations_and_parameters_of_ones_own() -> None:
    def make(rotors: Any) -> Problem:
        model = ARM.with_armature(np.full(7, rotors))
        rest, effort = Cost("rest", 0.2, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
        reach = Cost("reach", 20.0, Residual.frame_translation(model, "tool", GOAL))
        knot = FreeDynamics(model, 0.05, [rest, effort, reach])
        return Problem(X0, [knot], [0] * KNOTS, FreeDynamics(model, None, [rest, reach]))

    layer = ProblemLayer(make, ["rotors", "duration"], own={"rotors": 0.2}, threads=2)
    function = jax.jit(lambda scale, rotors: loss(layer(rotors, 0.05 * scale)))
    check_grads(function, (1.0, jnp.array([0.2, 0.3])), order=1, modes=["rev"], eps=5e-5, atol=1e-5, rtol=1e-5)


def test_copies() -> None:
    layer = pickle.loads(pickle.dumps(ProblemLayer(arm_problem(1e3), ["target/reach"])))
    first = jax.jit(layer)(jnp.array(GOAL))[0]
    assert np.allclose(first, copy.deepcopy(layer)(GOAL)[0], atol=1e-8)


def test_types() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["target/reach"])
    exact = jax.grad(lambda goal: loss(layer(goal)))(jnp.array(GOAL))
    with jax.enable_x64(False):
        goal = jnp.array(GOAL)
        xs, us = layer(goal)
        assert xs.dtype == us.dtype == jnp.float32
        slope = jax.grad(lambda goal: loss(layer(goal)))(goal)
        assert slope.dtype == jnp.float32
    assert np.allclose(slope, exact, rtol=1e-4, atol=1e-5)


def test_rows_that_fail() -> None:
    problem = arm_problem()
    goals = jnp.array([GOAL, GOAL, GOAL]).at[1, 0].set(jnp.nan)
    for run in (lambda layer: layer(goals), lambda layer: jax.grad(lambda goals: layer(goals)[1].sum())(goals)):
        with pytest.raises(ProblemError, match="row 1: "):
            run(ProblemLayer(problem, ["target/reach"]))
    with pytest.raises(jax.errors.JaxRuntimeError, match="ProblemError: row 1: "):
        jax.block_until_ready(jax.jit(ProblemLayer(problem, ["target/reach"]))(goals))
    layer = ProblemLayer(problem, ["target/reach"], on_failure="nan")
    xs, _ = layer(goals)
    assert np.isnan(xs[1]).all() and np.isfinite(xs[0]).all()
    assert layer.statuses == ["converged", "error", "converged"]
    slope = jax.grad(lambda goals: layer(goals)[1][::2].sum())(goals)
    assert np.isfinite(slope).all() and not slope[1].any() and slope[0].any()


def test_errors() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach", "x0"])
    with pytest.raises(ValueError, match=r"target/reach: expected shape \(..., 3\), found \(2,\)"):
        layer(GOAL[:2], X0)
    with pytest.raises(TypeError, match="target/reach: expected float32 or float64, found int"):
        layer(jnp.array([1, 2, 3]), X0)
    for value, found in ((None, "NoneType"), ("goal", "str")):
        with pytest.raises(TypeError, match=f"target/reach: expected an array or numbers, found {found}"):
            layer(value, X0)
    with pytest.raises(ValueError, match=r"target/reach: expected shape \(..., 3\), found \(2,\)"):
        jax.jit(layer)(GOAL[:2], X0)  # when the function is traced
    with pytest.raises(NotImplementedError, match="ProblemLayer: second derivatives of a solution do not exist"):
        jax.grad(lambda goal: jax.grad(lambda goal: loss(layer(goal, X0)))(goal).sum())(jnp.array(GOAL))
    with pytest.raises(TypeError, match="forward-mode"):
        jax.jvp(lambda goal: layer(goal, X0), (jnp.array(GOAL),), (jnp.ones(3),))
