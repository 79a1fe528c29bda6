"""Tests of simulations: steps, control laws, and errors."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from sample import Robot
from test_model import PENDULUM

import condyle
from condyle.simulation import Control, Ground, Simulation

CLOSE = {"rtol": 1e-12, "atol": 1e-12}
INTEGRATORS: tuple[Any, ...] = ("semi_implicit_euler", "runge_kutta_4", "variational")
ORDERS = {"semi_implicit_euler": 1, "runge_kutta_4": 4, "variational": 2}


def test_a_step_of_euler(robot: Robot) -> None:
    model, data, q, v, _, tau, f_ext = robot
    simulation = Simulation(model, dt=0.01)
    simulation.set_state(q, v)
    assert simulation.step(tau, f_ext) == "done"
    v = v + 0.01 * condyle.aba(model, data, q, v, tau, f_ext)
    np.testing.assert_allclose(simulation.v, v, **CLOSE)
    np.testing.assert_allclose(simulation.q, condyle.integrate(model, q, 0.01 * v), **CLOSE)
    assert simulation.time == 0.01
    simulation.set_state(q, v)
    assert simulation.time == 0.0
    assert np.array_equal(simulation.q, q)
    assert np.array_equal(simulation.v, v)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_orders(integrator: Any) -> None:
    """Checks that half the step length reduces the error by a factor 2ⁿ, where n is the order of the integrator."""
    arm = condyle.robots.arm7()
    q, v = [0.3] * 7, [0.1] * 7

    def end(dt: float, integrator: Any = integrator) -> Any:
        simulation = Simulation(arm, integrator, dt)
        simulation.set_state(q, v)
        assert simulation.run(round(0.1 / dt)) == "done"
        assert np.isclose(simulation.time, 0.1)
        return np.r_[simulation.q, simulation.v]

    truth = end(1e-4, "runge_kutta_4")
    coarse, fine = (np.abs(end(dt) - truth).max() for dt in (4e-3, 2e-3))
    assert np.isclose(np.log2(coarse / fine), ORDERS[integrator], atol=0.2)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_control_laws(quadruped: Robot, integrator: Any) -> None:
    """Checks that efforts and forces that a control law sets have the same effect as arguments of single steps."""
    model, _, q, v, *_ = quadruped
    tau, f_ext = np.zeros(18), np.zeros((14, 6))
    by_law, by_hand = Simulation(model, integrator), Simulation(model, integrator)
    seen: list[Control] = []

    def law(now: Control) -> None:
        seen.append(now)
        assert not now.tau.any()
        assert not now.f_ext.any()
        now.tau[7] = -2.0 * now.v[7]
        now.f_ext[1, 2] = 10.0

    by_law.set_state(q, 0.1 * v)
    by_hand.set_state(q, 0.1 * v)
    assert by_law.run(5, law) == "done"
    for now in seen:
        assert np.array_equal(now.q, by_hand.q)
        assert np.array_equal(now.v, by_hand.v)
        assert now.time == by_hand.time
        tau[7], f_ext[1, 2] = -2.0 * by_hand.v[7], 10.0
        assert by_hand.step(tau, f_ext) == "done"
    assert np.array_equal(by_law.q, by_hand.q)
    assert np.array_equal(by_law.v, by_hand.v)


def test_a_law_that_fails(quadruped: Robot) -> None:
    simulation = Simulation(quadruped.model)

    def broken(now: Control) -> None:
        raise LookupError("lost")

    with pytest.raises(LookupError, match="^lost$"):
        simulation.run(3, broken)
    with pytest.raises(TypeError, match="^control: expected a function that sets "):
        simulation.run(3, lambda now: now.tau)  # type: ignore[arg-type,return-value]
    assert simulation.run(0, broken) == "done"
    # a control law may read the simulation that calls it
    times: list[float] = []
    assert simulation.run(2, lambda now: times.append(simulation.time)) == "done"
    assert times == [0.0, 0.001]


def test_passive_torques_act_where_asked_for() -> None:
    joint = '<dynamics damping="0.5" friction="0.2"/>'
    text = condyle.robots.ARM7.replace("<dynamics", "<ignored").replace("</joint>", joint + "</joint>")
    model = condyle.Model.from_urdf_str(text)
    data, q, v, tau = condyle.Data(model), np.full(7, 0.3), np.full(7, 0.2), np.ones(7)
    for passive in (None, 0.05):
        simulation = Simulation(model, passive=passive)
        simulation.set_state(q, v)
        assert simulation.step(tau) == "done"
        acting = tau if passive is None else tau + condyle.passive_torque(model, q, v, passive)
        expected = v + 1e-3 * condyle.aba(model, data, q, v, acting)
        np.testing.assert_allclose(simulation.v, expected, **CLOSE)


def test_steps_that_fail(quadruped: Robot) -> None:
    model, _, q, v, *_ = quadruped
    simulation = Simulation(model)
    simulation.set_state(q, v)
    assert simulation.step(np.full(18, np.inf)) == "not_finite"
    assert np.array_equal(simulation.q, q)
    assert simulation.time == 0.0
    simulation = Simulation(model, "variational", dt=0.5, max_iterations=2)
    simulation.set_state(q, 10 * v)
    assert simulation.run(3) == "not_converged"
    assert np.array_equal(simulation.v, 10 * v)


def test_what_is_refused(quadruped: Robot) -> None:
    model = quadruped.model
    with pytest.raises(ValueError, match="^integrator: expected 'semi_implicit_euler', .*, found 'euler'$"):
        Simulation(model, "euler")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^passive: expected a positive speed, found 0$"):
        Simulation(model, passive=0.0)
    with pytest.raises(condyle.ModelError, match="singular$"):
        Simulation(condyle.Model.from_urdf_str(PENDULUM))
    simulation = Simulation(model)
    with pytest.raises(ValueError, match=r"^q: expected shape \(19,\), found \(18,\)$"):
        simulation.set_state(np.zeros(18), np.zeros(18))
    with pytest.raises(ValueError, match=r"^f_ext: expected shape \(14, 6\), found \(13, 6\)$"):
        simulation.step(np.zeros(18), np.zeros((13, 6)))


FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
BOX = """<mujoco><worldbody><body name="box"><freejoint name="free"/>
  <geom type="box" size="0.2 0.15 0.05" mass="3"/></body></worldbody></mujoco>"""
CORNERS = [[x, y, -0.05] for x in (-0.2, 0.2) for y in (-0.15, 0.15)]


def stiff(now: Control) -> None:
    """Holds the legs straight."""
    now.tau[6:] = -80.0 * now.q[7:] - 2.0 * now.v[6:]


def test_a_robot_lands_and_stands(quadruped: Robot) -> None:
    model = quadruped.model
    simulation = Simulation(model, ground=Ground(FEET, friction=0.8))
    q = condyle.neutral(model)
    q[2] = 0.72
    simulation.set_state(q, np.zeros(18))
    assert simulation.run(1, stiff) == "done"
    assert not simulation.contacts.touches.any()
    assert simulation.run(2000, stiff) == "done"
    contacts = simulation.contacts
    assert contacts.touches.all()
    assert contacts.touches.dtype == np.bool_
    assert contacts.position.shape == contacts.force.shape == (4, 3)
    assert abs(contacts.position[:, 2]).max() < 1e-6
    np.testing.assert_allclose(contacts.force[:, 2].sum(), 9.81 * model.total_mass, rtol=1e-3)
    tangential = np.linalg.norm(contacts.force[:, :2], axis=1)
    assert (tangential <= 0.8 * contacts.force[:, 2] * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_a_box_slides_to_a_stop(mu: float) -> None:
    """Checks that a box with the initial speed v slides by v²/(2 μ g), minus half the distance of one step."""
    model = condyle.Model.from_mjcf_str(BOX).with_frame("centre", "box")
    simulation = Simulation(model, ground=Ground([("centre", CORNERS)], friction=mu))
    q, v = condyle.neutral(model), np.array([0.6, 0.8, 0.0, 0.0, 0.0, 0.0])
    q[2] = 0.05
    simulation.set_state(q, v)
    assert simulation.run(1000) == "done"
    assert abs(simulation.v).max() < 1e-8
    expected = 1.0 / (2.0 * mu * 9.81) - 0.5e-3
    np.testing.assert_allclose(np.linalg.norm(simulation.q[:2]), expected, atol=1e-5)


def test_copies_go_on_with_the_same_bits(quadruped: Robot) -> None:
    model = quadruped.model
    soles: list[Any] = [("LF_foot", [[0.0, 0.01, 0.0], [0.0, -0.01, 0.0]]), *FEET[1:]]
    ground = Ground(soles, normal=(0.0, 0.1, 1.0), height=-0.01, friction=0.5, restitution=0.1)
    simulation = Simulation(model, dt=5e-4, ground=ground)
    q = condyle.neutral(model)
    q[2] = 0.71
    simulation.set_state(q, np.full(18, 0.1))
    assert simulation.run(300, stiff) == "done"
    time = simulation.time
    copies = [copy.copy(simulation), copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]
    assert simulation.run(300, stiff) == "done"
    for other in copies:
        assert other.time == time
        assert other.run(300, stiff) == "done"
        assert np.array_equal(other.q, simulation.q)
        assert np.array_equal(other.v, simulation.v)
        assert np.array_equal(other.contacts.force, simulation.contacts.force)
        assert other.ground is not None
        assert (other.ground.friction, other.ground.restitution, len(other.ground.points)) == (0.5, 0.1, 5)
    plain = Simulation(condyle.robots.arm7(), "variational", dt=0.002, passive=0.1)
    assert plain.run(10) == "done"
    again = pickle.loads(pickle.dumps(plain))
    assert plain.run(10) == again.run(10) == "done"
    assert np.array_equal(plain.q, again.q)
    assert again.ground is None


def test_grounds_that_are_refused(quadruped: Robot) -> None:
    model = quadruped.model
    with pytest.raises(condyle.ModelError, match=r"^ground: it acts with the integrator SemiImplicitEuler only"):
        Simulation(model, "variational", ground=Ground(FEET))
    with pytest.raises(TypeError, match=r"^ground: expected a `Ground`, found a list"):
        Simulation(model, ground=FEET)  # type: ignore[arg-type]
    with pytest.raises(condyle.ModelError, match=r"^unknown frame `LF_fot`; nearest is `LF_foot`$"):
        Simulation(model, ground=Ground(["LF_fot"]))
    with pytest.raises(condyle.ModelError, match=r"^ground: friction is -1, expected a finite number of at least 0$"):
        Simulation(model, ground=Ground(FEET, friction=-1.0))
    with pytest.raises(ValueError, match=r"^ground.points: corners: expected shape \(1, 3\), found \(1, 2\)$"):
        Simulation(model, ground=Ground([("LF_foot", [[0.0, 1.0]])]))
    with pytest.raises(TypeError, match=r"^ground.points: expected a list of frames"):
        Simulation(model, ground=Ground("LF_foot"))
    simulation = Simulation(model, ground=Ground(FEET, max_iterations=0))
    q = condyle.neutral(model)
    q[2] = 0.6
    simulation.set_state(q, np.zeros(18))
    assert simulation.run(3) == "contacts_not_converged"
