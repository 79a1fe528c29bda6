"""Tests of hyper-dual numbers: every function of a model and a state accepts these numbers. Also tests derivatives of
user functions.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sample import Robot

import condyle
from condyle import HyperDual

STEP = 3e-4
BY_DIFFERENCES = 2e-7
"""Tolerance for four-point differences. Their error is the fifth derivative times STEP⁴/30, plus rounding errors
divided by STEP; M⁻¹ of light bodies amplifies rounding errors.
"""
BY_HAND = 1e-11
VALUE = 1e-12
"""Tolerance for values. Floats are computed by other code than hyper-dual numbers, with limbs in parallel lanes, so the
rounding errors differ. M⁻¹ amplifies the difference.
"""

Case = Callable[[Robot, Any, Any], Any]
"""A function of a robot, a position and a velocity. The velocity is also used as accelerations and efforts."""
CASES: dict[str, Case] = {
    "aba": lambda r, q, v: condyle.aba(r.model, r.data, q, v, 2.0 * v, r.f_ext),
    "aba_derivatives": lambda r, q, v: condyle.aba_derivatives(r.model, r.data, q, v, 2.0 * v),
    "aba_hessian": lambda r, q, v: condyle.aba_hessian(r.model, r.data, q, v, r.tau, r.a),
    "aba_input_derivative": lambda r, q, v: condyle.aba_input_derivative(r.model, r.data, q, v, v, "gravity"),
    "body_acceleration": lambda r, q, v: condyle.body_acceleration(r.model, r.data, q, v, v, 3),
    "body_acceleration_derivatives": lambda r, q, v: condyle.body_acceleration_derivatives(r.model, r.data, q, v, v, 3),
    "body_classical_acceleration": lambda r, q, v: condyle.body_classical_acceleration(r.model, r.data, q, v, v, 3),
    "body_jacobian": lambda r, q, v: condyle.body_jacobian(r.model, r.data, q, 3),
    "body_jacobian_rate": lambda r, q, v: condyle.body_jacobian_rate(r.model, r.data, q, v, 3),
    "body_point_jacobian": lambda r, q, v: condyle.body_point_jacobian(r.model, r.data, q, 3, [0.1, 0.2, 0.3]),
    "body_point_velocity": lambda r, q, v: condyle.body_point_velocity(r.model, r.data, q, v, 3, [0.1, 0.2, 0.3]),
    "frame_point_jacobian": lambda r, q, v: condyle.frame_point_jacobian(r.model, r.data, q, 3, [0.1, 0.2, 0.3]),
    "frame_point_velocity": lambda r, q, v: condyle.frame_point_velocity(r.model, r.data, q, v, 3, [0.1, 0.2, 0.3]),
    "body_velocity": lambda r, q, v: condyle.body_velocity(r.model, r.data, q, v, 3),
    "body_velocity_derivative": lambda r, q, v: condyle.body_velocity_derivative(r.model, r.data, q, v, 3),
    "centroidal_derivatives": lambda r, q, v: condyle.centroidal_derivatives(r.model, r.data, q, v, v),
    "centroidal_map": lambda r, q, v: condyle.centroidal_map(r.model, r.data, q),
    "centroidal_map_rate": lambda r, q, v: condyle.centroidal_map_rate(r.model, r.data, q, v),
    "centroidal_momentum": lambda r, q, v: condyle.centroidal_momentum(r.model, r.data, q, v),
    "centroidal_momentum_rate": lambda r, q, v: condyle.centroidal_momentum_rate(r.model, r.data, q, v, v),
    "com": lambda r, q, v: condyle.com(r.model, r.data, q),
    "com_acceleration": lambda r, q, v: condyle.com_acceleration(r.model, r.data, q, v, v),
    "com_jacobian": lambda r, q, v: condyle.com_jacobian(r.model, r.data, q),
    "com_velocity": lambda r, q, v: condyle.com_velocity(r.model, r.data, q, v),
    "compute_all_terms": lambda r, q, v: condyle.compute_all_terms(r.model, r.data, q, v)[:2],
    "constrained_dynamics": lambda r, q, v: condyle.constrained_dynamics(r.model, r.data, held(r), q, v, v)[:2],
    "constrained_dynamics_derivatives": lambda r, q, v: condyle.constrained_dynamics_derivatives(
        r.model, r.data, held(r), q, v, v
    )[4:10],
    "constrained_dynamics_equations": lambda r, q, v: condyle.constrained_dynamics_equations(
        r.model, r.data, held(r), q, v, v
    )[4:],
    "coriolis_derivatives": lambda r, q, v: condyle.coriolis_derivatives(r.model, r.data, q, v),
    "coriolis_matrix": lambda r, q, v: condyle.coriolis_matrix(r.model, r.data, q, v),
    "crba": lambda r, q, v: condyle.crba(r.model, r.data, q),
    "difference": lambda r, q, v: condyle.difference(r.model, r.q, condyle.integrate(r.model, q, 0.1 * v)),
    "difference_jacobian": lambda r, q, v: condyle.difference_jacobian(r.model, 0.1 * v, "to"),
    "distance": lambda r, q, v: condyle.distance(r.model, r.q, condyle.integrate(r.model, q, 0.1 * v)),
    "energy_derivatives": lambda r, q, v: condyle.energy_derivatives(r.model, r.data, q, v),
    "forward_dynamics": lambda r, q, v: condyle.forward_dynamics(r.model, r.data, q, v, v, method="sparse"),
    "forward_kinematics": lambda r, q, v: condyle.forward_kinematics(r.model, r.data, q),
    "frame_acceleration": lambda r, q, v: condyle.frame_acceleration(r.model, r.data, q, v, v, 4),
    "frame_acceleration_derivatives": lambda r, q, v: condyle.frame_acceleration_derivatives(
        r.model, r.data, q, v, v, 4
    ),
    "frame_classical_acceleration": lambda r, q, v: condyle.frame_classical_acceleration(r.model, r.data, q, v, v, 4),
    "frame_classical_acceleration_derivatives": lambda r, q, v: condyle.frame_classical_acceleration_derivatives(
        r.model, r.data, q, v, v, 4
    ),
    "frame_jacobian": lambda r, q, v: condyle.frame_jacobian(r.model, r.data, q, 4, "world"),
    "frame_jacobian_rate": lambda r, q, v: condyle.frame_jacobian_rate(r.model, r.data, q, v, 4),
    "frame_placement": lambda r, q, v: condyle.frame_placement(r.model, r.data, q, 4),
    "frame_velocity": lambda r, q, v: condyle.frame_velocity(r.model, r.data, q, v, 4, "local_world_aligned"),
    "frame_velocity_derivative": lambda r, q, v: condyle.frame_velocity_derivative(r.model, r.data, q, v, 4),
    "gravity": lambda r, q, v: condyle.gravity(r.model, r.data, q),
    "impulse_dynamics": lambda r, q, v: condyle.impulse_dynamics(r.model, r.data, held(r), q, v, 0.5)[:2],
    "impulse_dynamics_derivatives": lambda r, q, v: condyle.impulse_dynamics_derivatives(
        r.model, r.data, held(r), q, v
    )[4:8],
    "integrate": lambda r, q, v: condyle.integrate(r.model, q, v),
    "integrate_jacobian": lambda r, q, v: condyle.integrate_jacobian(r.model, v, "velocity"),
    "interpolate": lambda r, q, v: condyle.interpolate(r.model, q, condyle.integrate(r.model, q, 0.1 * v), v[0]),
    "joint_torque_regressor": lambda r, q, v: condyle.joint_torque_regressor(r.model, r.data, q, v, v),
    "kinetic_energy": lambda r, q, v: condyle.kinetic_energy(r.model, r.data, q, v),
    "kinetic_energy_regressor": lambda r, q, v: condyle.kinetic_energy_regressor(r.model, r.data, q, v),
    "mechanical_energy": lambda r, q, v: condyle.mechanical_energy(r.model, r.data, q, v),
    "minv": lambda r, q, v: condyle.minv(r.model, r.data, q),
    "nonlinear_effects": lambda r, q, v: condyle.nonlinear_effects(r.model, r.data, q, v),
    "normalize": lambda r, q, v: condyle.normalize(r.model, condyle.integrate(r.model, q, v)),
    "passive_torque": lambda r, q, v: condyle.passive_torque(r.model, q, v, 2.0),
    "passive_torque_derivatives": lambda r, q, v: condyle.passive_torque_derivatives(r.model, q, v, 2.0),
    "potential_energy": lambda r, q, v: condyle.potential_energy(r.model, r.data, q),
    "potential_energy_regressor": lambda r, q, v: condyle.potential_energy_regressor(r.model, r.data, q),
    "rnea": lambda r, q, v: condyle.rnea(r.model, r.data, q, v, 2.0 * v, v[0] * r.f_ext),
    "rnea_derivatives": lambda r, q, v: condyle.rnea_derivatives(r.model, r.data, q, v, 2.0 * v),
    "rnea_hessian": lambda r, q, v: condyle.rnea_hessian(r.model, r.data, q, v, r.a, r.tau),
    "rnea_input_derivative": lambda r, q, v: condyle.rnea_input_derivative(
        r.model, r.data, q, v, v, ("inertia", r.model.nbodies - 1)
    ),
    "rnea_second_derivatives": lambda r, q, v: condyle.rnea_second_derivatives(r.model, r.data, q, v, v)[0][:2],
    "static_torque": lambda r, q, v: condyle.static_torque(r.model, r.data, q, r.f_ext),
    "static_torque_derivative": lambda r, q, v: condyle.static_torque_derivative(r.model, r.data, q, r.f_ext),
    "transport": lambda r, q, v: condyle.transport(r.model, v, np.outer(v, [1.0, 2.0])),
}
NOT_OF_A_STATE = {"gradient", "hessian", "jacobian", "load", "neutral", "random_configuration", "sweep"}
NOT_OF_A_STATE |= {"exp3", "exp6", "log3", "log6", "sweep_chunks"}


def held(r: Robot) -> condyle.ConstraintSet:
    frame = len(r.model.frames) - 1
    constraint = condyle.ContactConstraint(frame, "point", kp=3.0, kd=2.0, placement=np.eye(4))
    return condyle.ConstraintSet(r.model, [constraint], mu=1e-8, iterations=3)


def flat(value: Any) -> NDArray[Any]:
    """Returns all numbers of a result: an array, a number, or a tuple of these."""
    if isinstance(value, tuple):
        return np.concatenate([flat(member) for member in value])
    return np.atleast_1d(np.asarray(value)).ravel()


def split(r: Robot, x: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    return x[: r.model.nq], x[r.model.nq :]


def test_every_function_of_a_state_is_a_case() -> None:
    functions = {name for name in condyle.__all__ if callable(getattr(condyle, name)) and name.islower()}
    assert functions - set(CASES) == NOT_OF_A_STATE


@pytest.mark.parametrize("name", CASES)
def test_along_a_direction(robot: Robot, name: str) -> None:
    """Compares the first derivatives in two directions and the mixed second derivative with differences of the value
    and of a first derivative.
    """
    model, f = robot.model, CASES[name]
    rng = np.random.default_rng(2)
    along = rng.standard_normal((2, 2 * model.nv))

    def at(x: NDArray[Any]) -> NDArray[Any]:
        """Returns the function's value at the state (q, v) moved by x."""
        return flat(f(robot, condyle.integrate(model, robot.q, x[: model.nv]), robot.v + x[model.nv :]))

    def moved(first: float) -> NDArray[Any]:
        """Returns the function's value at the state moved along the first direction, with derivatives in the second
        direction.
        """
        return at(np.array([HyperDual(first * a, eps1=b) for a, b in zip(*along, strict=True)], dtype=object))

    def slope(f: Callable[[float], NDArray[Any]]) -> NDArray[Any]:
        """Returns the derivative df/ds at s = 0, by four-point differences."""
        near, far = f(STEP) - f(-STEP), f(2.0 * STEP) - f(-2.0 * STEP)
        return (8.0 * near - far) / (12.0 * STEP)

    both = at(np.array([HyperDual(0.0, eps1=a, eps2=b) for a, b in zip(*along, strict=True)], dtype=object))
    parts = {part: np.array([getattr(x, part) for x in both]) for part in ("re", "eps1", "eps2", "eps1eps2")}
    scale = max(1.0, *(float(np.abs(x).max()) for x in parts.values()))
    np.testing.assert_allclose(parts["re"], at(np.zeros(2 * model.nv)), rtol=0.0, atol=VALUE * scale)
    for part, direction in zip(("eps1", "eps2"), along, strict=True):
        difference = slope(lambda s, d=direction: at(s * d))  # type: ignore[misc]
        np.testing.assert_allclose(parts[part], difference, rtol=0.0, atol=BY_DIFFERENCES * scale)
    change = slope(lambda s: np.array([x.eps1 for x in moved(s)]))
    np.testing.assert_allclose(parts["eps1eps2"], change, rtol=0.0, atol=BY_DIFFERENCES * scale)


def test_jacobian(robot: Robot) -> None:
    model, data, q, v, a, f_ext = robot.model, robot.data, robot.q, robot.v, robot.a, robot.f_ext
    tau, J = condyle.jacobian(
        model,
        np.concatenate([q, v, a]),
        lambda x: condyle.rnea(model, data, x[: model.nq], *np.split(x[model.nq :], 2), f_ext),
    )
    expected = np.hstack(condyle.rnea_derivatives(model, data, q, v, a, f_ext))
    np.testing.assert_allclose(tau, condyle.rnea(model, data, q, v, a, f_ext), rtol=BY_HAND, atol=BY_HAND)
    np.testing.assert_allclose(J, expected, rtol=0.0, atol=BY_HAND * np.abs(expected).max())


def test_gradient_and_hessian(robot: Robot) -> None:
    model, data, q, v, a = robot.model, robot.data, robot.q, robot.v, robot.a
    weights = np.random.default_rng(3).standard_normal(model.nv)

    def weighted(x: NDArray[Any]) -> Any:
        return weights @ condyle.rnea(model, data, *split(robot, x), a)

    x = np.concatenate([q, v])
    value, slope, H = condyle.hessian(model, x, weighted)
    same, gradient = condyle.gradient(model, x, weighted)
    assert value == same
    np.testing.assert_array_equal(slope, gradient)
    np.testing.assert_allclose(value, weights @ condyle.rnea(model, data, q, v, a), rtol=BY_HAND)
    blocks = condyle.rnea_hessian(model, data, q, v, a, weights)
    expected = np.block([[blocks.dqdq, blocks.dvdq.T], [blocks.dvdq, blocks.dvdv]])
    np.testing.assert_allclose(H, expected, rtol=0.0, atol=BY_HAND * np.abs(expected).max())


def test_many_states(robot: Robot) -> None:
    model, n = robot.model, 3
    v = np.array([[HyperDual(x, eps1=1.0) for x in row] for row in np.random.default_rng(4).random((n, model.nv))])
    together = condyle.rnea(model, robot.data, robot.q, v, robot.a)
    assert together.shape == (n, model.nv)
    for k in range(n):
        alone = condyle.rnea(model, robot.data, robot.q, v[k], robot.a)
        assert [x.eps1 for x in alone] == [x.eps1 for x in together[k]]


def test_targets_of_constraints_that_were_changed(quadruped: Robot) -> None:
    r = quadruped
    v = np.array([HyperDual(x) for x in r.v])
    constraints = held(r)
    condyle.constrained_dynamics(r.model, r.data, constraints, r.q, v, r.tau)
    constraints.set_target(0, placement=np.eye(4) + 0.1 * np.eye(4, k=3))
    dual = condyle.constrained_dynamics(r.model, r.data, constraints, r.q, v, r.tau)
    double = condyle.constrained_dynamics(r.model, r.data, constraints, r.q, r.v, r.tau)
    np.testing.assert_allclose([x.re for x in dual.a], double.a, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "x"),
    [
        *((name, 0.3) for name in ("arcsin", "arccos", "arctan", "arcsinh", "arctanh", "cbrt", "cos", "cosh", "exp")),
        *((name, 0.3) for name in ("exp2", "expm1", "fabs", "log", "log10", "log1p", "log2", "sin", "sinh", "sqrt")),
        *((name, 1.3) for name in ("arccosh", "tan", "tanh")),
    ],
)
def test_elementary_functions(name: str, x: float) -> None:
    f, h = getattr(np, name), 1e-4
    [y] = f(np.array([HyperDual(x, 1.0, 1.0)], dtype=object))
    assert math.isclose(y.re, f(x), rel_tol=1e-14)
    assert math.isclose(y.eps1, (f(x + h) - f(x - h)) / (2.0 * h), rel_tol=1e-6)
    assert y.eps1 == y.eps2
    assert math.isclose(y.eps1eps2, (f(x + h) - 2.0 * f(x) + f(x - h)) / h**2, rel_tol=1e-6, abs_tol=1e-7)


@pytest.mark.parametrize(
    ("f", "slopes"),
    [
        (lambda x, y: x + y, (1.0, 1.0, 0.0)),
        (lambda x, y: x - y, (1.0, -1.0, 0.0)),
        (lambda x, y: x * y, (2.0, 0.5, 1.0)),
        (lambda x, y: x / y, (0.5, -0.125, -0.25)),
        (lambda x, y: x**3 * y, (1.5, 0.125, 0.75)),
        (lambda x, y: x**y, (1.0, 0.25 * math.log(0.5), 0.5 + math.log(0.5))),
        (lambda x, y: 3.0 - x * (2.0 / y), (-1.0, 0.25, 0.5)),
        (lambda x, y: 2.0**x - abs(-y), (math.log(2.0) * math.sqrt(2.0), -1.0, 0.0)),
        (lambda x, y: np.arctan2(x, y) * 4.25**2, (8.5, -2.125, 0.25 - 4.0)),
        (lambda x, y: np.hypot(x, y) * math.sqrt(4.25), (0.5, 2.0, -1.0 / 4.25)),
    ],
)
def test_arithmetic(f: Callable[[Any, Any], Any], slopes: tuple[float, float, float]) -> None:
    """Compares derivatives with values of ∂f/∂x, ∂f/∂y and ∂²f/∂x∂y at (0.5, 2) that were derived by hand."""
    z = f(HyperDual(0.5, eps1=1.0), HyperDual(2.0, eps2=1.0))
    np.testing.assert_allclose([z.eps1, z.eps2, z.eps1eps2], slopes, rtol=1e-13, atol=1e-15)


def test_comparisons_look_at_the_value() -> None:
    x, y = HyperDual(1.0, eps1=2.0), HyperDual(1.0, eps2=3.0)
    assert x == y
    assert x == 1.0
    assert x < 2.0 < y + 2.0
    assert not HyperDual(math.nan) == x  # noqa: SIM201
    assert HyperDual(math.nan) != x
    assert np.maximum(x, 0.5) is x
    assert repr(x) == "HyperDual(1, eps1=2, eps2=0, eps1eps2=0)"


def test_a_number_and_an_array() -> None:
    product = HyperDual(2.0, eps1=1.0) * np.array([1.0, 3.0])
    assert product.shape == (2,)
    assert product[1].eps1 == 3.0
    with pytest.raises(TypeError):
        float(HyperDual(1.0))  # type: ignore[arg-type]


def test_wrong_arguments(quadruped: Robot) -> None:
    r = quadruped
    v = np.array([HyperDual(x) for x in r.v])
    with pytest.raises(ValueError, match="out: expected none"):
        condyle.rnea(r.model, r.data, r.q, v, r.a, out=np.zeros(18))
    with pytest.raises(ValueError, match=r"v: expected shape \(18,\), found \(17,\)"):
        condyle.rnea(r.model, r.data, r.q, v[:17], r.a)
    with pytest.raises(TypeError, match="a: expected real or hyper-dual numbers, found <class 'str'>"):
        condyle.rnea(r.model, r.data, r.q, v, ["x"] * 18)
    with pytest.raises(ValueError, match="x: expected a vector of at least 19 numbers"):
        condyle.jacobian(r.model, r.v, lambda q: q)
    with pytest.raises(ValueError, match="f: expected a vector"):
        condyle.jacobian(r.model, r.q, lambda q: condyle.crba(r.model, r.data, q))
    with pytest.raises(ZeroDivisionError):  # an exception of the user's function is passed on
        condyle.gradient(r.model, r.q, lambda q: 1 / 0)
