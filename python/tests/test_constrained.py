"""Tests of constraints: results of functions that take constraints, and errors."""

import numpy as np
import pytest
from sample import Robot, make

import condyle
from condyle import ConstraintSet, ContactConstraint

CLOSE = {"rtol": 1e-8, "atol": 1e-8}
"""Tolerance for rounding errors after a product with M or M⁻¹; the condition number of M is up to 1e4."""


def stance(robot: Robot) -> ConstraintSet:
    """Returns constraints that hold two feet, one foot with each kind of reference axes."""
    feet = [
        ContactConstraint("LF_foot", "point"),
        ContactConstraint("RH_foot", "point", reference="local_world_aligned", kd=5.0),
    ]
    return ConstraintSet(robot.model, feet)


def test_equations(quadruped: Robot) -> None:
    model, data, q, v, _, tau, f_ext = quadruped
    feet = stance(quadruped)
    d = condyle.constrained_dynamics(model, data, feet, q, v, tau, f_ext)
    J = feet.jacobian()
    assert (d.redundant, J.shape) == (0.0, (6, 18))
    assert d.residual < CLOSE["atol"]
    np.testing.assert_allclose(condyle.rnea(model, data, q, v, d.a, f_ext) - J.T @ d.lambda_, tau, **CLOSE)
    frame = condyle.frame_jacobian(model, data, q, "LF_foot", "local")
    np.testing.assert_allclose(J[feet.range(0)], frame[:3], **CLOSE)


def test_derivatives_are_of_the_function(quadruped: Robot) -> None:
    model, data, q, v, _, tau, f_ext = quadruped
    feet = stance(quadruped)
    value = condyle.constrained_dynamics(model, data, feet, q, v, tau, f_ext)
    d = condyle.constrained_dynamics_derivatives(model, data, feet, q, v, tau, f_ext)
    # not bit-identical, because only the function without derivatives computes the limbs in parallel lanes
    np.testing.assert_allclose(d.a, value.a, **CLOSE)
    np.testing.assert_allclose(d.lambda_, value.lambda_, **CLOSE)
    equations = condyle.constrained_dynamics_equations(model, data, feet, q, v, tau, f_ext)
    assert np.array_equal(d.a, equations.a)
    assert np.array_equal(d.lambda_, equations.lambda_)
    step = 1e-6 * np.random.default_rng(0).standard_normal((3, 18))

    def ahead(h: float) -> condyle.Constrained:
        at = condyle.integrate(model, q, h * step[0])
        return condyle.constrained_dynamics(model, data, feet, at, v + h * step[1], tau + h * step[2], f_ext)

    da = d.da_dq @ step[0] + d.da_dv @ step[1] + d.da_dtau @ step[2]
    dlambda = d.dlambda_dq @ step[0] + d.dlambda_dv @ step[1] + d.dlambda_dtau @ step[2]
    np.testing.assert_allclose((ahead(1.0).a - ahead(-1.0).a) / 2, da, rtol=1e-5, atol=1e-8)
    np.testing.assert_allclose((ahead(1.0).lambda_ - ahead(-1.0).lambda_) / 2, dlambda, rtol=1e-5, atol=1e-8)
    again = condyle.constrained_dynamics_derivatives(model, data, feet, q, v, tau, f_ext, out=d)
    assert all(a is b for a, b in zip(again, d, strict=True) if isinstance(a, np.ndarray))


def test_equations_hold_for_the_derivatives(quadruped: Robot) -> None:
    model, data, q, v, _, tau, f_ext = quadruped
    feet = stance(quadruped)
    d = condyle.constrained_dynamics_derivatives(model, data, feet, q, v, tau, f_ext)
    e = condyle.constrained_dynamics_equations(model, data, feet, q, v, tau, f_ext)
    J = feet.jacobian()
    np.testing.assert_allclose(e.M @ d.da_dq - J.T @ d.dlambda_dq + e.dtau_dq, 0.0, **CLOSE)
    np.testing.assert_allclose(e.M @ d.da_dv - J.T @ d.dlambda_dv + e.dtau_dv, 0.0, **CLOSE)
    np.testing.assert_allclose(e.M @ d.da_dtau - J.T @ d.dlambda_dtau, np.eye(18), **CLOSE)
    np.testing.assert_allclose(J @ d.da_dq + e.dgamma_dq, 0.0, **CLOSE)
    np.testing.assert_allclose(J @ d.da_dv + e.dgamma_dv, 0.0, **CLOSE)


def test_impacts(quadruped: Robot) -> None:
    model, data, q, v, *_ = quadruped
    feet = stance(quadruped)
    value = condyle.impulse_dynamics(model, data, feet, q, v, 0.3)
    J, M = feet.jacobian(), condyle.crba(model, data, q)
    np.testing.assert_allclose(J @ value.v, -0.3 * J @ v, **CLOSE)
    np.testing.assert_allclose(M @ (value.v - v), J.T @ value.lambda_, **CLOSE)
    d = condyle.impulse_dynamics_derivatives(model, data, feet, q, v, restitution=0.3)
    assert np.array_equal(d.v, value.v)
    np.testing.assert_allclose(d.dlambda_dv @ v, value.lambda_, **CLOSE)  # Λ is linear in v
    np.testing.assert_allclose(d.inertia @ J @ np.linalg.solve(M, J.T), np.eye(6), **CLOSE)
    assert d.dv_dq.shape == (18, 18)
    assert d.dlambda_dq.shape == (6, 18)


def test_targets(quadruped: Robot) -> None:
    model, data, q, v, _, tau, _ = quadruped
    still = ConstraintSet(model, [ContactConstraint("LF_foot", "rigid", acceleration=[0.0, 0.0, 0.7, 0.0, 0.0, 0.0])])
    a = condyle.constrained_dynamics(model, data, still, q, v, tau).a
    np.testing.assert_allclose(condyle.frame_acceleration(model, data, q, v, a, "LF_foot", "local")[2], 0.7, **CLOSE)
    still.set_target(0, acceleration=np.zeros(6))
    a = condyle.constrained_dynamics(model, data, still, q, v, tau).a
    np.testing.assert_allclose(condyle.frame_acceleration(model, data, q, v, a, "LF_foot", "local"), 0.0, **CLOSE)
    here = condyle.frame_placement(model, data, q, "LF_foot")
    held = ConstraintSet(model, [ContactConstraint("LF_foot", "rigid", kp=100.0, placement=here)])
    same = condyle.constrained_dynamics(model, data, held, q, v, tau).a
    np.testing.assert_allclose(same, a, **CLOSE)


def test_redundant_constraints(quadruped: Robot) -> None:
    model, data, q, _, _, tau, _ = quadruped
    v = np.zeros(18)  # at rest, the classical acceleration of a point equals the spatial acceleration of the frame
    twice = [ContactConstraint("LF_foot", "point"), ContactConstraint("LF_foot", "rigid")]
    without, shared = ConstraintSet(model, twice), ConstraintSet(model, twice, mu=1e-8, iterations=4)
    one = condyle.constrained_dynamics(model, data, without, q, v, tau)
    other = condyle.constrained_dynamics(model, data, shared, q, v, tau)
    assert (one.redundant, other.redundant) == (3.0, 0.0)
    assert max(one.residual, other.residual) < 1e-6
    np.testing.assert_allclose(one.a, other.a, rtol=1e-6, atol=1e-6)
    assert np.linalg.norm(other.lambda_) < np.linalg.norm(one.lambda_)


def test_what_is_refused(quadruped: Robot) -> None:
    model, data, q, v, _, tau, _ = quadruped
    point = ContactConstraint("LF_foot", "point")
    with pytest.raises(condyle.ModelError, match="^unknown frame `LF_fot`; nearest is `LF_foot`$"):
        ConstraintSet(model, [ContactConstraint("LF_fot", "point")])
    with pytest.raises(
        condyle.ModelError, match="^constraint 1: it holds frame `LF_foot` as constraint 0 does already$"
    ):
        ConstraintSet(model, [point, point])
    with pytest.raises(ValueError, match="^kind: expected 'point', 'line', 'plane' or 'rigid', found 'edge'$"):
        ConstraintSet(model, [point._replace(kind="edge")])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^mu: expected a number of at least 0, found -1$"):
        ConstraintSet(model, [point], mu=-1.0)
    with pytest.raises(ValueError, match=r"^velocity: expected shape \(6,\), found \(3,\)$"):
        ConstraintSet(model, [point._replace(velocity=[0.0] * 3)])
    feet = ConstraintSet(model, [point])
    for call in (feet.range, feet.set_target):
        with pytest.raises(IndexError, match="^k: expected less than 1, found 1$"):
            call(1)
    arm = make(condyle.robots.arm7())
    with pytest.raises(ValueError, match=r"^constraints: made for another model \('quadruped'\), not for this 'arm7'$"):
        condyle.constrained_dynamics(arm.model, arm.data, feet, arm.q, arm.v, arm.tau)
    with pytest.raises(ValueError, match=r"^tau: expected shape \(18,\), found \(17,\)$"):
        condyle.constrained_dynamics(model, data, feet, q, v, tau[1:])


LOOPS = """
<mujoco>
  <worldbody>
    <body name="crank"><joint name="one" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 1" size="0.05"/>
      <body name="coupler" pos="0 0 1"><joint axis="0 1 0"/><geom type="sphere" size="0.05"/></body>
    </body>
    <body name="rocker" pos="1 0 0"><joint name="two" axis="0 1 0"/><geom type="sphere" size="0.05"/></body>
  </worldbody>
  <equality>
    <connect name="pin" body1="coupler" body2="rocker" anchor="1 0 0"/>
    <weld name="glue" body1="coupler" body2="rocker"/>
    <joint name="gear" joint1="one" joint2="two" polycoef="0.1 -2 0.5 0 0"/>
  </equality>
</mujoco>"""


def test_constraints_of_a_model() -> None:
    model = condyle.Model.from_mjcf_str(LOOPS)
    constraints = model.constraints()
    pin, glue, gear = (constraints[name] for name in ("pin", "glue", "gear"))
    assert isinstance(pin, condyle.ContactConstraint)
    assert (pin.kind, pin.frame, pin.other, pin.kp) == ("point", "pin#1", "pin#2", 0.0)
    assert isinstance(glue, condyle.ContactConstraint)
    assert (glue.kind, glue.frame, glue.other) == ("rigid", "glue#1", "glue#2")
    assert gear == condyle.Coupling("one", "two", (0.1, -2.0, 0.5, 0.0, 0.0))
    loops = condyle.ConstraintSet(model, [pin._replace(kp=9.0)], mu=1e-8, iterations=5)
    # this position and this velocity satisfy the constraint `pin`
    data, q, v = condyle.Data(model), np.zeros(3), np.array([0.3, -0.3, 0.3])
    found = condyle.constrained_dynamics(model, data, loops, q, v, np.ones(3))
    assert loops.rows == 3
    assert found.residual < 1e-6
    assert condyle.robots.quadruped().constraints() == {}
