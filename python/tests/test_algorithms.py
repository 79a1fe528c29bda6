"""What must hold between the functions, whatever the robot; that the numbers are right is for tests/peers to say."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from sample import Robot

import condyle

CLOSE = {"rtol": 1e-10, "atol": 1e-10}
"""Roundings of double precision."""
SOLVED = {"rtol": 1e-8, "atol": 1e-8}
"""The same after a solve with M, whose condition is up to 1e4."""
STEP = 1e-5
DIFFERENCES = {"rtol": 1e-5, "atol": 1e-5}
"""What central differences with that step leave, of accelerations up to 1e4."""


def central(f: Callable[[NDArray[np.float64]], NDArray[np.float64]], n: int) -> NDArray[np.float64]:
    """∂f/∂x at x = 0, n columns."""
    return np.stack([(f(e) - f(-e)) / (2 * STEP) for e in np.eye(n) * STEP], axis=1)


def test_forward_and_inverse_dynamics(robot: Robot) -> None:
    model, data, q, v, a, tau, f_ext = robot
    M, h = condyle.crba(model, data, q), condyle.nonlinear_effects(model, data, q, v)
    assert np.array_equal(M, M.T)
    np.testing.assert_allclose(condyle.rnea(model, data, q, v, a), M @ a + h, **CLOSE)
    np.testing.assert_allclose(condyle.gravity(model, data, q), condyle.rnea(model, data, q, 0 * v, 0 * a), **CLOSE)
    forward = condyle.aba(model, data, q, v, tau, f_ext)
    np.testing.assert_allclose(condyle.rnea(model, data, q, v, forward, f_ext), tau, **SOLVED)
    np.testing.assert_allclose(M @ condyle.minv(model, data, q), np.eye(model.nv), **SOLVED)


def test_external_forces_act_on_their_body(robot: Robot) -> None:
    """τ(f) = τ(0) − Σ Jᵢᵀ fᵢ, with the Jacobian of each body's own frame."""
    model, data, q, v, a, _, f_ext = robot
    tau = condyle.rnea(model, data, q, v, a)
    for body in range(1, model.nbodies):
        frame = next(i for i, f in enumerate(model.frames) if f.body == body and f.name == model.names[body])
        tau -= condyle.frame_jacobian(model, data, q, frame).T @ f_ext[body]
    np.testing.assert_allclose(condyle.rnea(model, data, q, v, a, f_ext), tau, **CLOSE)


def test_rnea_derivatives(robot: Robot) -> None:
    model, data, q, v, a, _, f_ext = robot
    d = condyle.rnea_derivatives(model, data, q, v, a, f_ext)
    dq = central(lambda e: condyle.rnea(model, data, condyle.integrate(model, q, e), v, a, f_ext), model.nv)
    dv = central(lambda e: condyle.rnea(model, data, q, v + e, a, f_ext), model.nv)
    np.testing.assert_allclose(d.dtau_dq, dq, **DIFFERENCES)
    np.testing.assert_allclose(d.dtau_dv, dv, **DIFFERENCES)
    np.testing.assert_allclose(d.dtau_da, condyle.crba(model, data, q), **CLOSE)


def test_aba_derivatives(robot: Robot) -> None:
    """By what follows from M q̈ + h = τ."""
    model, data, q, v, _, tau, f_ext = robot
    d = condyle.aba_derivatives(model, data, q, v, tau, f_ext)
    assert np.array_equal(d.a, condyle.aba(model, data, q, v, tau, f_ext))
    assert np.array_equal(d.da_dtau, condyle.minv(model, data, q))
    inverse = condyle.rnea_derivatives(model, data, q, v, d.a, f_ext)
    np.testing.assert_allclose(inverse.dtau_da @ d.da_dq, -inverse.dtau_dq, **SOLVED)
    np.testing.assert_allclose(inverse.dtau_da @ d.da_dv, -inverse.dtau_dv, **SOLVED)


def test_kinematics(robot: Robot) -> None:
    model, data, q, *_ = robot
    poses = condyle.forward_kinematics(model, data, q)
    assert np.array_equal(poses[0], np.eye(4))
    for i, frame in enumerate(model.frames):
        oXf = condyle.frame_placement(model, data, q, i)
        np.testing.assert_allclose(poses[frame.body] @ frame.placement, oXf, **CLOSE)
        J = condyle.frame_jacobian(model, data, q, i, "local_world_aligned")
        local = condyle.frame_jacobian(model, data, q, i)
        rotation, translation = oXf[:3, :3], oXf[:3, 3]
        np.testing.assert_allclose(rotation @ local[:3], J[:3], **CLOSE)
        np.testing.assert_allclose(rotation @ local[3:], J[3:], **CLOSE)
        world = condyle.frame_jacobian(model, data, q, i, "world")
        np.testing.assert_allclose(world[:3] + np.cross(J[3:].T, translation).T, J[:3], **CLOSE)


def test_frames_by_name_and_number(quadruped: Robot) -> None:
    model, data, q, *_ = quadruped
    by_name = condyle.frame_placement(model, data, q, "LF_foot")
    assert np.array_equal(by_name, condyle.frame_placement(model, data, q, model.frame("LF_foot")))
    assert np.array_equal(by_name, condyle.frame_placement(model, data, q, np.int64(model.frame("LF_foot"))))


def test_positions(robot: Robot) -> None:
    model, _, q, v, *_ = robot
    q1 = condyle.integrate(model, q, 0.3 * v)
    np.testing.assert_allclose(condyle.difference(model, q, q1), 0.3 * v, **CLOSE)
    position = central(
        lambda e: condyle.difference(model, q1, condyle.integrate(model, condyle.integrate(model, q, e), 0.3 * v)),
        model.nv,
    )
    np.testing.assert_allclose(condyle.integrate_jacobian(model, 0.3 * v, "position"), position, **DIFFERENCES)
    velocity = central(lambda e: condyle.difference(model, q1, condyle.integrate(model, q, 0.3 * v + e)), model.nv)
    np.testing.assert_allclose(condyle.integrate_jacobian(model, 0.3 * v, "velocity"), velocity, **DIFFERENCES)
    to = central(lambda e: condyle.difference(model, q, condyle.integrate(model, q1, e)), model.nv)
    np.testing.assert_allclose(condyle.difference_jacobian(model, 0.3 * v, "to"), to, **DIFFERENCES)
    origin = central(lambda e: condyle.difference(model, condyle.integrate(model, q, e), q1), model.nv)
    np.testing.assert_allclose(condyle.difference_jacobian(model, 0.3 * v, "from"), origin, **DIFFERENCES)


def test_random_configuration(robot: Robot) -> None:
    model = robot.model
    assert np.array_equal(condyle.random_configuration(model, 5), condyle.random_configuration(model, 5))
    assert not np.array_equal(condyle.random_configuration(model, 5), condyle.random_configuration(model, 6))
    assert not np.array_equal(condyle.random_configuration(model), condyle.random_configuration(model))
    for seed in range(20):
        q = condyle.random_configuration(model, seed)
        assert (q >= model.limits.lower).all()
        assert (q <= model.limits.upper).all()
