"""Compares the conversions of `condyle.conventions` with poses, forces and motions that Pinocchio computes."""

import numpy as np
import pinocchio as pin
import pytest

import condyle
from condyle import conventions

SAME = 1e-12
"""Tolerance, which allows several rounding errors."""


@pytest.fixture(params=[condyle.robots.ARM7, condyle.robots.QUADRUPED, condyle.robots.HUMANOID])
def pair(request: pytest.FixtureRequest) -> tuple[condyle.Model, pin.Model]:
    """Returns one robot in Condyle and in Pinocchio."""
    text, moves = request.param, request.param is not condyle.robots.ARM7
    model = condyle.Model.from_urdf_str(text, root_joint="free_flyer" if moves else None)
    theirs = pin.buildModelFromXML(text, pin.JointModelFreeFlyer()) if moves else pin.buildModelFromXML(text)
    return model, theirs


def test_the_same_coordinates(pair: tuple[condyle.Model, pin.Model]) -> None:
    """Tests that positions and velocities have the same numbers in Pinocchio and Condyle, without a conversion."""
    model, theirs = pair
    there = conventions.Coordinates(model, "pinocchio")
    q, v = condyle.random_configuration(model, seed=1), np.arange(float(model.nv))
    np.testing.assert_array_equal(there.position(q), q)
    np.testing.assert_array_equal(there.velocity(q, v), v)
    tau = pin.rnea(theirs, theirs.createData(), there.position(q), there.velocity(q, v), v)
    ours = condyle.rnea(model, condyle.Data(model), q, v, v)
    np.testing.assert_allclose(there.effort(q, ours), tau, atol=1e-10 * (1.0 + np.abs(tau).max()))


def test_forces_and_motions(pair: tuple[condyle.Model, pin.Model]) -> None:
    model, theirs = pair
    data, rng = theirs.createData(), np.random.default_rng(2)
    q, (v, a) = condyle.random_configuration(model, seed=2), rng.standard_normal((2, model.nv))
    pin.forwardKinematics(theirs, data, q, v, a)
    for i in range(1, theirs.njoints):
        X, oXb = data.oMi[i], data.oMi[i].homogeneous
        wrench, twist = rng.standard_normal((2, 6))
        force, motion = pin.Force(wrench), pin.Motion(twist)
        pairs = [
            (conventions.wrench_to_body(oXb, wrench), X.actInv(force)),
            (conventions.wrench_to_world(oXb, wrench), X.act(force)),
            (conventions.twist_to_body(oXb, twist, np.zeros(3)), X.actInv(motion)),
            (conventions.twist_to_world(oXb, twist, np.zeros(3)), X.act(motion)),
        ]
        for found, expected in pairs:
            np.testing.assert_allclose(found, expected.vector, atol=SAME)
        for frame, point in ((pin.WORLD, np.zeros(3)), (pin.LOCAL_WORLD_ALIGNED, None)):
            world = pin.getVelocity(theirs, data, i, frame).vector
            np.testing.assert_allclose(conventions.twist_to_body(oXb, world, point), data.v[i].vector, atol=1e-11)
        classical = pin.getClassicalAcceleration(theirs, data, i, pin.LOCAL).vector
        np.testing.assert_allclose(
            conventions.classical_acceleration(data.a[i].vector, data.v[i].vector), classical, atol=1e-11
        )
        coefficients = pin.Quaternion(X.rotation).coeffs()
        np.testing.assert_allclose(conventions.rotation(coefficients), X.rotation, atol=SAME)
        inertia = theirs.inertias[i].matrix()
        momentum = conventions.swap_blocks(inertia) @ conventions.swap_halves(twist)
        np.testing.assert_allclose(momentum, conventions.swap_halves(inertia @ twist), atol=SAME)


def test_a_force_in_the_world(pair: tuple[condyle.Model, pin.Model]) -> None:
    """Tests that a force in world coordinates gives the same motion in Condyle and in Pinocchio, if each library
    converts the force by its own functions."""
    model, theirs = pair
    q, rest = condyle.random_configuration(model, seed=3), np.zeros(model.nv)
    wrench = np.random.default_rng(3).standard_normal((model.nbodies, 6))
    data = theirs.createData()
    pin.forwardKinematics(theirs, data, q)
    forces = pin.StdVec_Force()
    for X, w in zip(data.oMi, wrench, strict=True):
        forces.append(X.actInv(pin.Force(w)))
    tau = pin.rnea(theirs, data, q, rest, rest, forces)
    scratch = condyle.Data(model)
    f_ext = conventions.wrench_to_body(condyle.forward_kinematics(model, scratch, q), wrench)
    found = condyle.rnea(model, scratch, q, rest, rest, f_ext)
    np.testing.assert_allclose(found, tau, atol=1e-10 * (1.0 + np.abs(tau).max()))
