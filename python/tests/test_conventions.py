"""Tests of conversions between conventions: the two directions of a conversion are inverse, and powers do not
change.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sample import Robot

import condyle
from condyle import conventions
from condyle.conventions import LIBRARIES, Coordinates, FreeJoint

CLOSE = 1e-13
"""Tolerance for a few rounding errors of numbers near 1."""


def every_joint() -> condyle.Model:
    """Returns a chain with one joint of each kind that all libraries except Drake have."""
    builder = condyle.ModelBuilder("all joints")
    joints = [
        condyle.Joint.free_flyer(),
        condyle.Joint.spherical(),
        condyle.Joint.continuous([0, 1, 0]),
        condyle.Joint.revolute([1, 0, 0]),
        condyle.Joint.free_flyer(),
        condyle.Joint.translation(),
        condyle.Joint.helical([0, 0, 1], 0.1),
    ]
    body = condyle.WORLD
    for k, joint in enumerate(joints):
        inertia = condyle.Inertia.from_com(1.0, [0.1, 0.0, 0.2], np.eye(3))
        body = builder.body(f"joint {k}", body, joint, inertia=inertia)
    return builder.build()


def batch(model: condyle.Model, count: int = 5) -> tuple[NDArray[np.float64], ...]:
    """Returns arrays of positions, and three arrays of vectors with nv numbers."""
    q = np.array([condyle.random_configuration(model, seed=k) for k in range(count)])
    return (q, *np.random.default_rng(0).standard_normal((3, count, model.nv)))


@pytest.mark.parametrize("library", sorted(set(LIBRARIES) - {"drake"}))
def test_there_and_back(library: str) -> None:
    model = every_joint()
    q, v, a, tau = batch(model)
    there = Coordinates(model, library)
    theirs = there.position(q)
    assert theirs.shape == (5, there.nq)
    np.testing.assert_allclose(there.position_from(theirs), q, atol=CLOSE)
    velocity = there.velocity(q, v)
    np.testing.assert_allclose(there.velocity_from(theirs, velocity), v, atol=CLOSE)
    acceleration = there.acceleration(q, v, a)
    np.testing.assert_allclose(there.acceleration_from(theirs, velocity, acceleration), a, atol=10 * CLOSE)
    effort = there.effort(q, tau)
    np.testing.assert_allclose(there.effort_from(theirs, effort), tau, atol=CLOSE)
    np.testing.assert_allclose((effort * velocity).sum(-1), (tau * v).sum(-1), atol=10 * CLOSE)
    alone = there.position(q[2]), there.velocity(q[2], v[2]), there.acceleration(q[2], v[2], a[2])
    for one, many in zip(alone, (theirs, velocity, acceleration), strict=True):
        np.testing.assert_array_equal(one, many[2])


@pytest.mark.parametrize("library", sorted(LIBRARIES))
def test_acceleration_is_the_rate_of_velocity(robot: Robot, library: str) -> None:
    """Compares converted accelerations with central differences of converted velocities, along a motion with constant
    v̇.
    """
    there, h = Coordinates(robot.model, library), 1e-5
    sides = []
    for step in (-h, h):
        q = condyle.integrate(robot.model, robot.q, step * robot.v)
        sides.append(there.velocity(q, robot.v + step * robot.a))
    difference = (sides[1] - sides[0]) / (2 * h)
    np.testing.assert_allclose(there.acceleration(robot.q, robot.v, robot.a), difference, atol=1e-8)


def test_drake_and_julia_by_hand() -> None:
    """Checks numbers for a body that is turned by 90° about z, so that the body's x axis is the world's y axis."""
    builder = condyle.ModelBuilder("body")
    ball = condyle.Inertia.from_com(1.0, [0, 0, 0], np.eye(3))
    builder.body("root", condyle.WORLD, condyle.Joint.free_flyer(), inertia=ball)
    model = builder.build()
    half = np.sqrt(0.5)
    q, v = np.array([1.0, 2.0, 3.0, 0.0, 0.0, half, half]), np.array([4.0, 0.0, 0.0, 5.0, 0.0, 0.0])
    drake, julia = Coordinates(model, "drake"), Coordinates(model, "RigidBodyDynamics.jl")
    np.testing.assert_allclose(drake.position(q), [half, 0, 0, half, 1, 2, 3])
    np.testing.assert_allclose(drake.velocity(q, v), [0, 5, 0, 0, 4, 0], atol=CLOSE)
    np.testing.assert_allclose(julia.position(q), [half, 0, 0, half, 1, 2, 3])
    np.testing.assert_allclose(julia.velocity(q, v), [5, 0, 0, 4, 0, 0], atol=CLOSE)


def test_a_library_of_ones_own(quadruped: Robot) -> None:
    mixed = Coordinates(quadruped.model, FreeJoint(True, True, True, "world", "world", True))
    v = mixed.velocity(quadruped.q, quadruped.v)
    data = condyle.Data(quadruped.model)
    expected = condyle.frame_velocity(quadruped.model, data, quadruped.q, quadruped.v, "trunk", "local_world_aligned")
    np.testing.assert_allclose(v[:6], expected, atol=CLOSE)


def test_frames_of_twists(robot: Robot) -> None:
    model, data, q, v = robot.model, robot.data, robot.q, robot.v
    oXb = condyle.forward_kinematics(model, data, q)[-1]
    body, world, aligned = (
        condyle.body_velocity(model, data, q, v, model.nbodies - 1, frame)
        for frame in ("local", "world", "local_world_aligned")
    )
    np.testing.assert_allclose(conventions.twist_to_body(oXb, world, np.zeros(3)), body, atol=10 * CLOSE)
    np.testing.assert_allclose(conventions.twist_to_body(oXb, aligned), body, atol=10 * CLOSE)
    np.testing.assert_allclose(conventions.twist_to_world(oXb, body, np.zeros(3)), world, atol=10 * CLOSE)
    np.testing.assert_allclose(conventions.twist_to_world(oXb, body), aligned, atol=10 * CLOSE)


def test_forces_by_their_power(robot: Robot) -> None:
    """Checks that power is the same in the axes of the body and of the world, and that the two conversions of forces
    are inverse.
    """
    rng = np.random.default_rng(0)
    oXb = condyle.forward_kinematics(robot.model, robot.data, robot.q)
    f, v = rng.standard_normal((2, robot.model.nbodies, 6))
    point = rng.standard_normal(3)
    f_world, v_world = conventions.wrench_to_world(oXb, f, point), conventions.twist_to_world(oXb, v, point)
    np.testing.assert_allclose((f_world * v_world).sum(-1), (f * v).sum(-1), atol=100 * CLOSE)
    np.testing.assert_allclose(conventions.wrench_to_body(oXb, f_world, point), f, atol=100 * CLOSE)
    np.testing.assert_allclose(conventions.twist_to_body(oXb, v_world, point), v, atol=100 * CLOSE)


def test_weight_as_an_external_force(robot: Robot) -> None:
    """Checks that external forces equal to the weights, at the centres of mass, have the same effect as gravity."""
    model, data, q = robot.model, robot.data, robot.q
    oXb = condyle.forward_kinematics(model, data, q)
    com = np.array([X[:3, :3] @ inertia.com + X[:3, 3] for X, inertia in zip(oXb, model.inertias, strict=True)])
    weight = np.array([[0.0, 0.0, -9.81 * inertia.mass, 0.0, 0.0, 0.0] for inertia in model.inertias])
    f_ext = conventions.wrench_to_body(oXb, weight, com)
    rest = np.zeros(model.nv)
    lifted = condyle.rnea(model.with_gravity([0, 0, 0]), condyle.Data(model), q, rest, rest, f_ext)
    np.testing.assert_allclose(lifted, condyle.gravity(model, data, q), atol=1e-10)


def test_accelerations(robot: Robot) -> None:
    model, data, q, v, a = robot.model, robot.data, robot.q, robot.v, robot.a
    last = model.nbodies - 1
    spatial = condyle.body_acceleration(model, data, q, v, a, last)
    classical = condyle.body_classical_acceleration(model, data, q, v, a, last)
    velocity = condyle.body_velocity(model, data, q, v, last)
    np.testing.assert_allclose(conventions.classical_acceleration(spatial, velocity), classical, atol=1e-11)
    np.testing.assert_allclose(conventions.spatial_acceleration(classical, velocity), spatial, atol=1e-11)


def test_halves_and_quaternions() -> None:
    x = np.arange(12.0).reshape(2, 6)
    np.testing.assert_array_equal(conventions.swap_halves(x)[1], [9, 10, 11, 6, 7, 8])
    np.testing.assert_array_equal(conventions.swap_halves(x.T, 0), conventions.swap_halves(x).T)
    X = np.arange(36.0).reshape(6, 6)
    np.testing.assert_array_equal(conventions.swap_blocks(X)[:3, 3:], X[3:, :3])
    np.testing.assert_array_equal(conventions.xyzw(conventions.wxyz(x[:, :4])), x[:, :4])


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: conventions.swap_halves(np.zeros(5)), r"x: expected 6 along axis -1, found shape \(5,\)"),
        (lambda: conventions.wxyz(np.zeros(3)), r"quaternion: expected shape \(…, 4\)"),
        (lambda: conventions.wrench_to_body(np.eye(3), np.zeros(6)), r"oXb: expected shape \(…, 4, 4\)"),
        (lambda: conventions.twist_to_body(np.eye(4), np.zeros(3)), r"twist: expected shape \(…, 6\)"),
        (lambda: Coordinates(condyle.robots.arm7(), "drak"), "unknown library `drak`; there are drake, mujoco"),
        (lambda: Coordinates(condyle.robots.arm7(), "drake").position(np.zeros(6)), r"q: expected shape \(…, 7\)"),
        (lambda: Coordinates(every_joint(), "drake"), "joint `joint 1`: a spherical joint has other coordinates"),
    ],
)
def test_what_is_refused(call: Any, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        call()
