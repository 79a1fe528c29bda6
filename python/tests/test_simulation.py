"""Simulations: what a step is, control laws, and what is refused."""

from typing import Any

import numpy as np
import pytest
from sample import Robot
from test_model import PENDULUM

import condyle
from condyle.simulation import Control, Simulation

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
    """A halved step makes the error smaller by 2 to the order."""
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
    """What a law sets, each step anew, is what steps by hand are given."""
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
    # a law may look at the simulation that calls it
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
        acting = tau if passive is None else tau + condyle.passive_torque(model, v, passive)
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
