"""Tests of `condyle.jax`: values, first and second derivatives, `jit`, `vmap`, `scan`, types, and errors."""

import doctest
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from frameworks import CASES, MODELS, TIPS, Case, numbers

import condyle

os.environ.setdefault("JAX_PLATFORMS", "cpu")
jax = pytest.importorskip("jax")

import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

import condyle.jax  # noqa: E402

ROUNDING = 1e-9
"""Tolerance for numbers up to some hundreds that two methods compute."""
STEP = 1e-5
DIFFERENCES = {"eps": STEP, "atol": 1e-5, "rtol": 1e-5}
"""Step and tolerance of central differences: rounding gives 1e-10, and third derivatives up to 1e3 give 1e-7."""
ROBOTS = {name: condyle.jax.Dynamics(model) for name, model in MODELS.items()}
TWICE = [(name, robot) for name, case in CASES.items() for robot in MODELS if case.twice]


@pytest.fixture(autouse=True)
def double() -> Iterator[None]:
    """Computes with float64."""
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", False)


def arrays(robot: str, case: Case, states: int = 2, unit: bool = False) -> list[Any]:
    return [jnp.asarray(x) for x in numbers(MODELS[robot], case.arguments, states, unit)]


def scaled(case: Case, robot: str, x: list[Any]) -> Any:
    """Returns a function of x whose values and derivatives are of size 1: the sine of a multiple of all results."""

    def total(*x: Any) -> Any:
        found = jax.tree.leaves(case.call(ROBOTS[robot], TIPS[robot], *x))
        return sum((jnp.cos(jnp.arange(y.size)).reshape(y.shape) * y).sum() for y in found)

    slopes = jax.grad(total, tuple(range(len(x))))(*x)
    size = 1.0 + max(float(jnp.abs(slope).max()) for slope in slopes)
    return lambda *x: jnp.sin(total(*x) / size)


@pytest.mark.parametrize("robot", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_values(name: str, robot: str) -> None:
    """Compares values with the library's, at once and in a compiled program."""
    case, model = CASES[name], MODELS[robot]
    x = numbers(model, case.arguments, 5)
    expected = jax.tree.leaves(case.expected(model, condyle.Data(model), TIPS[robot], *x))

    def function(*x: Any) -> Any:
        return case.call(ROBOTS[robot], TIPS[robot], *x)

    for run in (function, jax.jit(function)):
        for y, z in zip(jax.tree.leaves(run(*x)), expected, strict=True):
            assert y.dtype == jnp.float64 and y.shape == np.shape(z)
            assert np.allclose(y, z, rtol=ROUNDING, atol=ROUNDING)
        for y, z in zip(jax.tree.leaves(run(*(a[3] for a in x))), expected, strict=True):
            assert y.shape == np.shape(z)[1:] and np.allclose(y, z[3], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("robot", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_gradients(name: str, robot: str) -> None:
    """Compares derivatives with differences, for positions whose quaternions and pairs do not have the length 1."""
    x = arrays(robot, CASES[name])
    function = scaled(CASES[name], robot, x)
    check_grads(jax.jit(lambda q, *x: function(ROBOTS[robot].normalize(q), *x)), x, 1, **DIFFERENCES)
    check_grads(function, x, 1, **DIFFERENCES)


@pytest.mark.parametrize(("name", "robot"), TWICE)
def test_second_derivatives(name: str, robot: str) -> None:
    """Compares second derivatives with differences of first derivatives: reverse over reverse, forward over reverse."""
    x = arrays(robot, CASES[name], 1)
    function = scaled(CASES[name], robot, x)
    slope = jax.jit(jax.grad(function, tuple(range(len(x)))))
    rng = np.random.default_rng(0)
    along, other = ([jnp.asarray(rng.standard_normal(a.shape)) for a in x] for _ in "12")
    moved = [slope(*[a + s * STEP * d for a, d in zip(x, along, strict=True)]) for s in (1, -1)]
    expected = [(a - b) / (2 * STEP) for a, b in zip(*moved, strict=True)]
    _, forward = jax.jvp(slope, tuple(x), tuple(along))
    for y, z in zip(forward, expected, strict=True):
        assert np.allclose(y, z, rtol=DIFFERENCES["rtol"], atol=DIFFERENCES["atol"] * max(1.0, float(jnp.abs(z).max())))

    def product(*x: Any) -> Any:
        return sum((g * d).sum() for g, d in zip(slope(*x), other, strict=True))

    reverse = jax.grad(product, tuple(range(len(x))))(*x)
    pairs = sum(float((g * d).sum()) for g, d in zip(reverse, along, strict=True))
    same = sum(float((g * d).sum()) for g, d in zip(forward, other, strict=True))
    assert np.isclose(pairs, same, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("robot", MODELS)
def test_transformations(robot: str) -> None:
    """Compares `jacrev`, `jacfwd`, `hessian` and `vmap` with the library's Jacobians and with a loop."""
    dynamics, model = ROBOTS[robot], MODELS[robot]
    q, v, tau = (jnp.asarray(x) for x in numbers(model, "q v a", 3))
    (by_tau,) = (condyle.aba_derivatives(model, condyle.Data(model), *map(np.asarray, (q, v, tau))).da_dtau,)
    for jacobian in (jax.jacrev, jax.jacfwd):
        mapped = jax.jit(jax.vmap(jacobian(dynamics.aba, (0, 2))))(q, v, tau)
        assert mapped[0].shape == (3, model.nv, model.nq)
        assert np.allclose(mapped[1], by_tau, rtol=ROUNDING, atol=ROUNDING)
        one = jacobian(dynamics.aba, (0, 2))(q[1], v[1], tau[1])
        assert all(np.allclose(y[1], z, rtol=1e-8, atol=1e-8) for y, z in zip(mapped, one, strict=True))
    shared = jax.vmap(dynamics.aba, (1, None, 1))(q.T, v[0], tau.T)
    assert np.allclose(shared, dynamics.aba(q, v[0], tau), rtol=1e-8, atol=1e-8)

    def norm(q: Any) -> Any:
        return jnp.sin(dynamics.aba(q, v[0], tau[0])).sum()

    curvature = jax.hessian(norm)(q[0])
    for first in (jax.jacrev, jax.jacfwd):
        for second in (jax.jacrev, jax.jacfwd):
            assert np.allclose(curvature, jax.jit(first(second(norm)))(q[0]), rtol=1e-8, atol=1e-8)


def test_scan() -> None:
    """Compares the gradient of a simulation's last state with differences."""
    robot, model = ROBOTS["every joint"], MODELS["every joint"]
    q, v, _ = (jnp.asarray(x[0]) for x in numbers(model, "q v a", 1))

    def last(efforts: Any) -> Any:
        def step(state: Any, tau: Any) -> Any:
            q, v = state
            v = v + 0.01 * robot.aba(q, v, tau)
            return (robot.integrate(q, 0.01 * v), v), None

        state, _ = jax.lax.scan(step, (q, 0.1 * v), efforts)
        return jnp.concatenate(state).sum()

    check_grads(jax.jit(last), [jnp.ones((8, model.nv))], 1, modes=["rev"], **DIFFERENCES)


def test_types() -> None:
    robot = ROBOTS["arm"]
    q = jnp.full((4, 3, 7), 0.3, jnp.float32)
    v, tau = 0.1 * jnp.ones(7, jnp.float32), jnp.ones((3, 7), jnp.float32)
    a, exact = robot.aba(q, v, tau), robot.aba(q.astype(jnp.float64), v, tau)
    assert a.dtype == jnp.float32 and exact.dtype == jnp.float64 and a.shape == (4, 3, 7)
    assert np.allclose(a, exact, rtol=1e-6, atol=1e-5)
    assert jax.grad(lambda q: robot.aba(q, v, tau).sum())(q).dtype == jnp.float32
    assert robot.aba(jnp.zeros((0, 7)), v, v).shape == (0, 7)
    jax.config.update("jax_enable_x64", False)
    for run in (robot.aba, jax.jit(robot.aba)):
        assert run(np.full(7, 0.3), np.zeros(7), np.ones(7)).dtype == jnp.float32


def test_nan_stays_in_its_state() -> None:
    robot = ROBOTS["every joint"]
    q, v, tau = numbers(MODELS["every joint"], "q v a", 4)
    v[2, 3] = np.nan
    q[3, 3:7] = 0.0  # a quaternion of length 0
    a, slopes = jax.value_and_grad(lambda *x: robot.aba(*x).sum(), (0, 1))(q, v, tau)
    assert np.isnan(a)
    for found in (robot.aba(q, v, tau), *slopes):
        assert np.isnan(found).any(1).tolist() == [False, False, True, True]


def test_threads_share_an_object() -> None:
    robot = condyle.jax.Dynamics(MODELS["every joint"], threads=2)
    x = arrays("every joint", CASES["aba"], 64)
    slope = jax.jit(jax.grad(lambda q, v, tau: robot.aba(q, v, tau).sum()))
    expected, failed = slope(*x), []

    def work() -> None:
        for _ in range(20):
            if not np.array_equal(slope(*x), expected):
                failed.append(1)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda q: q[:6], ValueError, "q: expected shape (..., 7), found (6,)"),
        (lambda q: q.astype(int), TypeError, "q: expected float32 or float64, found int64"),
        (lambda q: q.astype(jnp.bfloat16), TypeError, "q: expected float32 or float64, found bfloat16"),
        (
            lambda q: jnp.broadcast_to(q, (3, 7)),
            ValueError,
            "aba: expected batches that broadcast, found q (3,), v (2,), tau ()",
        ),
    ],
)
def test_errors(change: Any, error: type[Exception], message: str) -> None:
    q = jnp.zeros(7)
    for run in (ROBOTS["arm"].aba, jax.jit(ROBOTS["arm"].aba)):
        with pytest.raises(error) as found:
            run(change(q), jnp.broadcast_to(q, (2, 7)), q)
        assert str(found.value) == message


def test_errors_of_derivatives() -> None:
    robot, q = ROBOTS["arm"], jnp.full(7, 0.3)
    with pytest.raises(NotImplementedError, match="^com: differentiated twice, but the library has exact second"):
        jax.hessian(lambda q: robot.com(q).sum())(q)
    pair = [jnp.asarray(x[0]) for x in numbers(MODELS["every joint"], "q d", 1)]
    with pytest.raises(NotImplementedError, match="^integrate: differentiated twice"):
        jax.hessian(lambda q: ROBOTS["every joint"].integrate(q, pair[1]).sum())(pair[0])
    with pytest.raises(NotImplementedError, match="^rnea: differentiated three times"):
        jax.grad(lambda q: jax.hessian(lambda q: robot.gravity(q).sum())(q).sum())(q)


def test_docstrings() -> None:
    jax.config.update("jax_enable_x64", False)
    results = doctest.testmod(condyle.jax)
    assert results.attempted >= 8
    assert results.failed == 0


def test_missing_package() -> None:
    code = "import sys; sys.modules['jax'] = None; import condyle.jax"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ImportError: condyle.jax needs JAX: pip install condyle[jax]" in run.stderr
