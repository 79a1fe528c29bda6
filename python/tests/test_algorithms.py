"""Tests relations between functions that hold for every robot. The tests in tests/peers compare the numbers with other
libraries.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sample import Robot

import condyle

CLOSE = {"rtol": 1e-10, "atol": 1e-10}
"""Tolerance for rounding errors of double precision."""
SOLVED = {"rtol": 1e-8, "atol": 1e-8}
"""Tolerance for rounding errors after a solve with M, whose condition number is up to 1e4."""
STEP = 1e-5
DIFFERENCES = {"rtol": 1e-5, "atol": 1e-5}
"""Tolerance for errors of central differences with the step `STEP`, for accelerations up to 1e4."""


def central(f: Callable[[NDArray[np.float64]], NDArray[np.float64]], n: int) -> NDArray[np.float64]:
    """Returns ∂f/∂x at x = 0, n columns, by central differences."""
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
    """Checks τ(f) = τ(0) − Σ Jᵢᵀ fᵢ for external forces fᵢ, where Jᵢ is the Jacobian of body i in the body's own
    frame."""
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
    """Compares the derivatives of `aba` with derivatives of the equation M q̈ + h = τ."""
    model, data, q, v, _, tau, f_ext = robot
    d = condyle.aba_derivatives(model, data, q, v, tau, f_ext)
    np.testing.assert_allclose(d.a, condyle.aba(model, data, q, v, tau, f_ext), **SOLVED)
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


@pytest.mark.parametrize("reference", ["local", "world", "local_world_aligned"])
def test_motion_of_frames(robot: Robot, reference: Any) -> None:
    """Checks a frame's velocity V = J v and acceleration A = J a + dJ v, with the frame's Jacobian J and its rate dJ.
    Compares dJ with differences of J along the motion.
    """
    model, data, q, v, a, *_ = robot
    for frame in range(0, len(model.frames), 5):

        def jacobian(t: NDArray[np.float64], frame: int = frame) -> NDArray[np.float64]:
            return condyle.frame_jacobian(model, data, condyle.integrate(model, q, t[0] * v), frame, reference).ravel()

        J = condyle.frame_jacobian(model, data, q, frame, reference)
        dJ = condyle.frame_jacobian_rate(model, data, q, v, frame, reference)
        np.testing.assert_allclose(dJ.ravel(), central(jacobian, 1)[:, 0], **DIFFERENCES)
        velocity = condyle.frame_velocity(model, data, q, v, frame, reference)
        np.testing.assert_allclose(velocity, J @ v, **CLOSE)
        spatial = condyle.frame_acceleration(model, data, q, v, a, frame, reference)
        classical = condyle.frame_classical_acceleration(model, data, q, v, a, frame, reference)
        acceleration = classical if reference == "local_world_aligned" else spatial
        np.testing.assert_allclose(acceleration, J @ a + dJ @ v, **CLOSE)
        np.testing.assert_allclose(classical[:3], spatial[:3] + np.cross(velocity[3:], velocity[:3]), **CLOSE)
        assert np.array_equal(classical[3:], spatial[3:])


def test_points(robot: Robot) -> None:
    """Checks that a point moves like a frame at this point, and that results for many states equal results for single
    states.
    """
    model, data, q, v, *_ = robot
    point, at = np.array([0.1, -0.2, 0.3]), np.eye(4)
    at[:3, 3] = point
    for frame in range(0, len(model.frames), 5):
        other = model.with_frame("point", frame, at)
        J = condyle.frame_jacobian(other, condyle.Data(other), q, "point", "local_world_aligned")[:3]
        np.testing.assert_allclose(condyle.frame_point_jacobian(model, data, q, frame, point), J, **CLOSE)
        np.testing.assert_allclose(condyle.frame_point_velocity(model, data, q, v, frame, point), J @ v, **CLOSE)
        two = condyle.frame_point_velocity(model, data, np.stack([q, q]), np.stack([v, -v]), frame, point)
        np.testing.assert_allclose(two, [J @ v, -J @ v], **CLOSE)
    name, body = model.body_names[-1], model.nbodies - 1
    J = condyle.frame_point_jacobian(model, data, q, name, point)
    np.testing.assert_allclose(condyle.body_point_jacobian(model, data, q, body, point), J, **CLOSE)
    np.testing.assert_allclose(condyle.body_point_velocity(model, data, q, v, model.names[-1], point), J @ v, **CLOSE)
    with pytest.raises(ValueError, match=r"^point: expected shape \(3,\), found \(2,\)$"):
        condyle.frame_point_jacobian(model, data, q, 0, [0.0, 1.0])


def test_frames_are_added() -> None:
    arm = condyle.robots.arm7()
    assert arm.with_frame("here", None).frames[-1].body == 0
    tip = arm.with_frame("tip", "tool")
    assert tip.frames[-1].kind == "user"
    assert (tip.frames[-1].body, len(tip.frames)) == (7, len(arm.frames) + 1)
    with pytest.raises(condyle.ModelError, match="^two frames are named `tip`$"):
        tip.with_frame("tip", "tool")
    with pytest.raises(condyle.ModelError, match="^unknown frame `tol`; nearest is `tool`$"):
        arm.with_frame("tip", "tol")
    with pytest.raises(condyle.ModelError, match="^frame `tip`: placement is no rotation and translation$"):
        arm.with_frame("tip", "tool", np.diag([2.0, 2.0, 2.0, 1.0]))
    with pytest.raises(IndexError, match="^frame: expected a name or 0 to .*, found 99$"):
        arm.with_frame("tip", 99)


@pytest.mark.parametrize("reference", ["local", "world", "local_world_aligned"])
def test_motion_of_bodies(robot: Robot, reference: Any) -> None:
    """Checks that bodies move like the frames of their joints, and that the world is at rest."""
    model, data, q, v, a, *_ = robot
    for body in range(1, model.nbodies):
        name = model.names[body]
        frame = next(i for i, f in enumerate(model.frames) if f.body == body and f.name == name)
        for of_body, of_frame, arguments in (
            (condyle.body_jacobian, condyle.frame_jacobian, (q,)),
            (condyle.body_velocity, condyle.frame_velocity, (q, v)),
            (condyle.body_acceleration, condyle.frame_acceleration, (q, v, a)),
            (condyle.body_classical_acceleration, condyle.frame_classical_acceleration, (q, v, a)),
            (condyle.body_jacobian_rate, condyle.frame_jacobian_rate, (q, v)),
        ):
            expected = of_frame(model, data, *arguments, frame, reference)  # type: ignore[operator]
            np.testing.assert_allclose(of_body(model, data, *arguments, body, reference), expected, **CLOSE)  # type: ignore[operator]
            by_name = of_body(model, data, *arguments, name, reference)  # type: ignore[operator]
            assert np.array_equal(by_name, of_body(model, data, *arguments, body, reference))  # type: ignore[operator]
    assert not condyle.body_velocity(model, data, q, v, 0, reference).any()


def test_centre_of_mass_and_momentum(robot: Robot) -> None:
    model, data, q, v, a, *_ = robot
    rate, still = condyle.centroidal_map_rate(model, data, q, v), condyle.centroidal_map(model, data, q)
    for field in still._fields:
        np.testing.assert_allclose(getattr(rate, field), getattr(still, field), **CLOSE)
    assert np.array_equal(condyle.com_jacobian(model, data, q), still.Jcom)
    np.testing.assert_allclose(condyle.com(model, data, q), still.com, **CLOSE)
    along = central(lambda e: condyle.com(model, data, condyle.integrate(model, q, e)), model.nv)
    np.testing.assert_allclose(still.Jcom, along, **DIFFERENCES)
    np.testing.assert_allclose(condyle.com_velocity(model, data, q, v), still.Jcom @ v, **CLOSE)
    np.testing.assert_allclose(rate.com_velocity, still.Jcom @ v, **CLOSE)
    hg, dhg = condyle.centroidal_momentum(model, data, q, v), condyle.centroidal_momentum_rate(model, data, q, v, a)
    np.testing.assert_allclose(hg, still.Ag @ v, **CLOSE)
    np.testing.assert_allclose(rate.hg, hg, **CLOSE)
    np.testing.assert_allclose(dhg, still.Ag @ a + rate.dAg @ v, **CLOSE)
    mass = sum(inertia.mass for inertia in model.inertias[1:])
    np.testing.assert_allclose(condyle.com_acceleration(model, data, q, v, a), dhg[:3] / mass, **CLOSE)
    np.testing.assert_allclose(still.Ig[:3], mass * np.eye(3, 6), **CLOSE)
    assert np.array_equal(still.Ig, still.Ig.T)
    # if the robot turns as one rigid body, hg is Ig times the velocity at the centre of mass
    if model.joint_types[1] == "free_flyer":
        turn = np.r_[0.0, 0, 0, 1, 2, 3, np.zeros(model.nv - 6)]
        omega = condyle.frame_velocity(model, data, q, turn, "root_joint", "local_world_aligned")[3:]
        np.testing.assert_allclose((still.Ag @ turn)[3:], still.Ig[3:, 3:] @ omega, **CLOSE)


def test_energies(robot: Robot) -> None:
    model, data, q, v, *_ = robot
    T, V = condyle.kinetic_energy(model, data, q, v), condyle.potential_energy(model, data, q)
    assert np.isclose(T, 0.5 * v @ condyle.crba(model, data, q) @ v, **CLOSE)
    assert np.isclose(condyle.mechanical_energy(model, data, q, v), T + V, **CLOSE)
    slope = central(
        lambda e: np.array([condyle.potential_energy(model, data, condyle.integrate(model, q, e))]), model.nv
    )
    np.testing.assert_allclose(condyle.gravity(model, data, q), slope[0], **DIFFERENCES)


def test_equations_of_motion(robot: Robot) -> None:
    model, data, q, v, a, _, f_ext = robot
    M, h = condyle.crba(model, data, q), condyle.nonlinear_effects(model, data, q, v)
    C = condyle.coriolis_matrix(model, data, q, v)
    np.testing.assert_allclose(C @ v, h - condyle.gravity(model, data, q), **CLOSE)
    np.testing.assert_allclose(
        condyle.static_torque(model, data, q, f_ext), condyle.rnea(model, data, q, 0 * v, 0 * a, f_ext), **CLOSE
    )
    terms = condyle.compute_all_terms(model, data, q, v)
    np.testing.assert_allclose(terms.M, M, **CLOSE)
    np.testing.assert_allclose(terms.h, h, **CLOSE)
    for ours, alone in zip(terms.centroidal, condyle.centroidal_map_rate(model, data, q, v), strict=True):
        np.testing.assert_allclose(ours, alone, **CLOSE)
    assert np.isclose(terms.kinetic_energy, condyle.kinetic_energy(model, data, q, v), **CLOSE)
    assert np.isclose(terms.potential_energy, condyle.potential_energy(model, data, q), **CLOSE)


def test_regressors(robot: Robot) -> None:
    model, data, q, v, a, *_ = robot
    model = model.with_armature(np.full(model.nv, 0.1))
    pi = model.inertial_parameters
    Y = condyle.joint_torque_regressor(model, data, q, v, a)
    rotors = 0.1 * a
    if model.joint_types[1] == "free_flyer":
        rotors[:3] += 0.1 * np.cross(v[3:6], v[:3])  # this armature acts like a mass, in the axes of the world
    np.testing.assert_allclose(Y @ pi + rotors, condyle.rnea(model, data, q, v, a), **CLOSE)
    T = condyle.kinetic_energy_regressor(model, data, q, v) @ pi + 0.05 * v @ v
    assert np.isclose(T, condyle.kinetic_energy(model, data, q, v), **CLOSE)
    V = condyle.potential_energy_regressor(model, data, q) @ pi
    assert np.isclose(V, condyle.potential_energy(model, data, q), **CLOSE)


def test_passive_torque() -> None:
    joint = '<dynamics damping="0.5" friction="2"/>'
    text = condyle.robots.ARM7.replace("<dynamics", "<ignored").replace("</joint>", joint + "</joint>")
    model = condyle.Model.from_urdf_str(text)
    assert np.array_equal(model.friction, np.full(7, 2.0))
    q, v = np.full(7, 0.3), np.linspace(-0.1, 0.2, 7)
    tau = condyle.passive_torque(model, q=q, v=v, smoothing=0.1)
    np.testing.assert_allclose(tau, -0.5 * v - 2 * np.tanh(v / 0.1), **CLOSE)
    slope = central(lambda e: condyle.passive_torque(model, q, v + e, 0.1), 7)
    derivatives = condyle.passive_torque_derivatives(model, q, v, 0.1)
    np.testing.assert_allclose(derivatives.dtau_dv, slope, **DIFFERENCES)
    assert not derivatives.dtau_dq.any()  # the robot has no springs
    many = condyle.passive_torque_derivatives(model, np.stack([q, -q]), np.stack([v, -v]), 0.1)
    np.testing.assert_allclose(many.dtau_dv[0], derivatives.dtau_dv, **CLOSE)
    both = condyle.passive_torque(model, np.stack([q, -q]), np.stack([v, -v]), 0.1)
    np.testing.assert_allclose(both, [tau, -tau], **CLOSE)


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


def test_between_positions(robot: Robot) -> None:
    model, _, q, v, *_ = robot
    v = 0.3 * v
    q1 = condyle.integrate(model, q, v)
    np.testing.assert_allclose(condyle.interpolate(model, q, q1, 0.25), condyle.integrate(model, q, v / 4), **CLOSE)
    assert np.isclose(condyle.distance(model, q, q1), np.linalg.norm(v), **CLOSE)
    stretched = q.copy()
    stretched[3:7] *= 2.0 if model.joint_types[1] == "free_flyer" else 1.0
    np.testing.assert_allclose(condyle.normalize(model, stretched), q, **CLOSE)
    X = np.random.default_rng(2).standard_normal((model.nv, 3))
    J = condyle.integrate_jacobian(model, v, "position")
    np.testing.assert_allclose(J @ condyle.transport(model, v, X), X, **CLOSE)


def test_random_configuration(robot: Robot) -> None:
    model = robot.model
    assert np.array_equal(condyle.random_configuration(model, 5), condyle.random_configuration(model, 5))
    assert not np.array_equal(condyle.random_configuration(model, 5), condyle.random_configuration(model, 6))
    assert not np.array_equal(condyle.random_configuration(model), condyle.random_configuration(model))
    for seed in range(20):
        q = condyle.random_configuration(model, seed)
        assert (q >= model.limits.lower).all()
        assert (q <= model.limits.upper).all()
