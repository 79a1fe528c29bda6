"""Compares `condyle.algebra` with Pinocchio's SE3, Motion, Force, exponentials and logarithms."""

import numpy as np
import pinocchio as pin
import pytest

from condyle.algebra import SE3, Force, Inertia, Jexp3, Jexp6, Jlog3, Jlog6, Motion, exp3, exp6, log3, log6

EXACT = 1e-12
"""Tolerance for numbers near 1, which allows several thousand rounding errors."""
ANGLES = [0.0, 1e-12, 1e-7, 1e-4, 0.05, 0.0999, 0.1001, 0.999, 1.001, 2.0, 3.0, np.pi - 1e-4]
"""Test angles (rad), on both sides of each angle at which the algebra uses another formula. Nearer to π, Pinocchio's
logarithm loses digits."""


def motions(angle: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    m = rng.standard_normal((20, 6))
    m[:, 3:] *= angle / np.linalg.norm(m[:, 3:], axis=1)[:, None]
    return m


def close(found: np.ndarray, expected: np.ndarray, bound: float = EXACT) -> None:
    np.testing.assert_allclose(found, expected, atol=bound * (1.0 + np.abs(expected).max()), rtol=0)


@pytest.mark.parametrize("angle", ANGLES)
def test_exponentials(angle: float) -> None:
    """Compares exponentials, logarithms and their Jacobians. Pinocchio computes the Jacobians for small angles from
    series of few terms, so Jacobians agree only to 1e-9."""
    many = motions(angle)
    for k, m in enumerate(many):
        X = pin.exp6(m)
        close(exp3(m[3:]), pin.exp3(m[3:]))
        close(exp6(m).homogeneous, X.homogeneous, 1e-11)
        close(Jexp3(m[3:]), pin.Jexp3(m[3:]), 1e-9)
        close(Jexp6(m), pin.Jexp6(m), 1e-9)
        close(log3(X.rotation), m[3:], 1e-10)
        close(log6(X.homogeneous).vector, m, 1e-9)
        close(Jlog3(m[3:]), pin.Jlog3(X.rotation), 1e-8)
        close(Jlog6(SE3(X.rotation, X.translation)), pin.Jlog6(X), 1e-8)
        close(exp6(many).homogeneous[k], exp6(m).homogeneous)
        close(Jexp6(many)[k], Jexp6(m))


@pytest.mark.parametrize("angle", [*ANGLES, np.pi - 1e-9, np.pi])
def test_inverses(angle: float) -> None:
    """Checks identities up to rounding, without Pinocchio: exp(log X) is X, and Jexp is the derivative of exp."""
    for m in motions(angle):
        X = exp6(m)
        close(exp6(log6(X)).homogeneous, X.homogeneous)
        close(Jlog3(m[3:]) @ Jexp3(m[3:]), np.eye(3), 1e-12)
        h = 1e-6
        step = np.array(
            [log6(X.inverse() * exp6(m + h * e)).vector - log6(X.inverse() * exp6(m - h * e)).vector for e in np.eye(6)]
        )
        close(step.T / (2 * h), Jexp6(m), 1e-8)


def test_actions() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        A, B = pin.SE3.Random(), pin.SE3.Random()
        a, b = SE3(A.rotation, A.translation), SE3.from_homogeneous(B.homogeneous)
        m, n, f, p = *rng.standard_normal((3, 6)), rng.standard_normal(3)
        theirs, ours = pin.Motion(m), Motion.from_vector(m)
        close((a * b).homogeneous, (A * B).homogeneous)
        close(a.inverse().homogeneous, A.inverse().homogeneous)
        close((a * ours).vector, A.act(theirs).vector)
        close(a.act_inv(ours).vector, A.actInv(theirs).vector)
        close((a * Force.from_vector(f)).vector, A.act(pin.Force(f)).vector)
        close(a.act_inv(Force.from_vector(f)).vector, A.actInv(pin.Force(f)).vector)
        close(a * p, A.act(p))
        close(a.action, A.action)
        close(a.dual_action, A.dualAction)
        close(ours.action, theirs.action)
        close(ours.dual_action, theirs.dualAction)
        close(ours.cross(Motion.from_vector(n)).vector, theirs.cross(pin.Motion(n)).vector)
        close(ours.cross(Force.from_vector(f)).vector, theirs.cross(pin.Force(f)).vector)
        close(ours.dot(Force.from_vector(f)), np.array(theirs.dot(pin.Force(f))))


def test_batches_and_what_is_refused() -> None:
    X = exp6(motions(1.0))
    v, f = Motion.from_vector(motions(0.3)), Force.from_vector(motions(0.7))
    close((X * v).dot(X * f), v.dot(f))
    close((X * v).vector[7], (SE3(X.rotation[7], X.translation[7]) * Motion.from_vector(v.vector[7])).vector)
    assert (X * X.inverse()) == SE3.identity()
    assert v - v == 0.0 * v and 2.0 * v == v + v and -v != v
    assert Motion.zero() != Force.zero()
    with pytest.raises(TypeError):
        v + f
    with pytest.raises(TypeError):
        v.dot(v)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"rotation: expected shape \(…, 3, 3\), found \(3,\)"):
        SE3([1, 2, 3], [1, 2, 3])
    with pytest.raises(ValueError, match=r"m: expected shape \(…, 6\), found \(3,\)"):
        exp6([1, 2, 3])


def test_inertias_of_shapes() -> None:
    """Compares inertias with Pinocchio's. The inertias of a capsule and a cylinder are also compared with sums over
    many points."""
    for ours, theirs in (
        (Inertia.from_sphere(2.0, 0.3), pin.Inertia.FromSphere(2.0, 0.3)),
        (Inertia.from_ellipsoid(2.0, [0.3, 0.2, 0.1]), pin.Inertia.FromEllipsoid(2.0, 0.3, 0.2, 0.1)),
        (Inertia.from_box(2.0, [0.3, 0.2, 0.1]), pin.Inertia.FromBox(2.0, 0.3, 0.2, 0.1)),
        (Inertia.from_cylinder(2.0, 0.3, 0.7), pin.Inertia.FromCylinder(2.0, 0.3, 0.7)),
        (Inertia.from_capsule(2.0, 0.3, 0.7), pin.Inertia.FromCapsule(2.0, 0.3, 0.7)),
    ):
        close(ours.matrix, theirs.matrix())
        assert ours.mass == theirs.mass and not ours.com.any()
    close(Inertia.from_capsule(2.0, 0.3, 0.0).matrix, Inertia.from_sphere(2.0, 0.3).matrix)
    with pytest.raises(ValueError, match="mass: expected at least 0 kg, found -1"):
        Inertia.from_sphere(-1.0, 0.1)
    with pytest.raises(ValueError, match="radius: expected at least 0 m, found -0.1"):
        Inertia.from_capsule(1.0, -0.1, 0.1)
    with pytest.raises(ValueError, match=r"size: expected shape \(3,\), found 0.1"):
        Inertia.from_box(1.0, 0.1)


def test_actions_on_inertias() -> None:
    rng = np.random.default_rng(2)
    pin.seed(2)
    for _ in range(20):
        X, Y, Z = pin.SE3.Random(), pin.Inertia.Random(), pin.Inertia.Random()
        pose = SE3(X.rotation, X.translation)
        ours, other = (Inertia.from_com(J.mass, J.lever, J.inertia) for J in (Y, Z))
        m = rng.standard_normal(6)
        close(ours.matrix, Y.matrix())
        close((pose * ours).matrix, (X.act(Y)).matrix())
        close(pose.act_inv(ours).matrix, X.actInv(Y).matrix())
        close((ours * Motion.from_vector(m)).vector, (Y * pin.Motion(m)).vector)
        close((ours + other).matrix, (Y + Z).matrix())
        close((ours + other).about_com, (Y + Z).inertia)
    many = exp6(motions(1.0))
    moved, v = many * ours, Motion.from_vector(motions(0.3))
    close(moved.rotational[7], (SE3(many.rotation[7], many.translation[7]) * ours).rotational)
    close((moved * v).vector, (many * (ours * (many.inverse() * v))).vector)
