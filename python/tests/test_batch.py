"""Tests calls for many states: every function that takes a state is compared with one call for each state."""

import inspect
import threading
from typing import Any

import numpy as np
import pytest
from sample import Robot, make

import condyle

N = 11
"""Number of states: larger than the number of SIMD lanes, and not a multiple of this number."""
CLOSE = {"rtol": 1e-9, "atol": 1e-9}
"""Tolerance for rounding errors: a call for a single state may compute a robot's limbs in parallel lanes, with sums in
another order. The condition number of M amplifies the difference.
"""


def argument(name: str, robot: Robot, states: int) -> Any:
    """Returns values of the argument `name` for many states, or for a single state if `states` is 0."""
    model, rng = robot.model, np.random.default_rng(len(name))
    shape = (states,) if states else ()
    match name:
        case "q" | "q0" | "q1":
            draws = [
                condyle.random_configuration(model, seed=31 * k + len(name) + ord(name[-1]))
                for k in range(max(states, 1))
            ]
            return np.stack(draws) if states else draws[0]
        case "v" | "a" | "tau" | "lambda_" | "dq" | "w":
            return rng.standard_normal((*shape, model.nv))
        case "f_ext":
            return rng.standard_normal((*shape, model.nbodies, 6))
        case "frame" | "body":
            return 1 if model.nq else 0
        case "constraints":
            if model.nq == 0:
                return condyle.ConstraintSet(model, [])
            return condyle.ConstraintSet(model, [condyle.ContactConstraint(len(model.frames) - 1, "point")])
        case "by" | "argument" | "of":
            return None
    return inspect.Parameter.empty


def functions() -> list[str]:
    """Returns the names of functions of a model, a `Data` and a state."""
    names = []
    for name in condyle.__all__:
        function = getattr(condyle, name)
        if inspect.isbuiltin(function) and {"model", "q"} <= inspect.signature(function).parameters.keys():
            names.append(name)
    return names


def members(result: Any) -> list[Any]:
    if isinstance(result, tuple):
        return [member for part in result for member in members(part)]
    return [result]


FIXED = """<robot name="fixed">
  <link name="base"/>
  <link name="arm"><inertial>
    <mass value="2"/><origin xyz="0 0 1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
  </inertial></link>
  <joint name="bolt" type="fixed"><origin xyz="1 0 0"/><parent link="base"/><child link="arm"/></joint>
</robot>"""


@pytest.mark.parametrize("name", functions())
def test_without_coordinates(name: str) -> None:
    """Checks that no function fails for a robot with only fixed joints, for one state or for many."""
    test_as_one_by_one(name, make(condyle.Model.from_urdf_str(FIXED)))


@pytest.mark.parametrize("name", functions())
def test_as_one_by_one(name: str, robot: Robot) -> None:
    function, model = getattr(condyle, name), robot.model
    varying, given = {}, {}
    for parameter in inspect.signature(function).parameters.values():
        if parameter.name in ("model", "data", "out"):
            continue
        value = argument(parameter.name, robot, N)
        if isinstance(value, np.ndarray):
            varying[parameter.name] = value
        elif value is not inspect.Parameter.empty and value is not None:
            given[parameter.name] = value
        elif parameter.default is inspect.Parameter.empty:
            pytest.skip(f"{parameter.name} is no part of a state")
    data = {"data": robot.data} if "data" in inspect.signature(function).parameters else {}
    together = members(function(model, **data, **varying, **given))
    for k in range(N):
        one = members(function(model, **data, **{n: x[k] for n, x in varying.items()}, **given))
        for all_states, alone in zip(together, one, strict=True):
            assert len(all_states) == N
            np.testing.assert_allclose(all_states[k], alone, **CLOSE)


def test_most_functions_are_compared() -> None:
    assert len(functions()) > 40
    assert "constrained_dynamics" in functions()


def test_arguments_are_shared(robot: Robot) -> None:
    model, data = robot.model, robot.data
    q = argument("q", robot, N)
    shared = condyle.rnea(model, data, q, robot.v, robot.a, robot.f_ext)
    repeated = [np.stack([x] * N) for x in (robot.v, robot.a, robot.f_ext)]
    np.testing.assert_array_equal(shared, condyle.rnea(model, data, q, *repeated))
    np.testing.assert_array_equal(
        condyle.rnea(model, data, q.tolist(), robot.v.tolist(), robot.a), condyle.rnea(model, data, q, robot.v, robot.a)
    )


def test_out(robot: Robot) -> None:
    model, data, q = robot.model, robot.data, argument("q", robot, N)
    out = np.empty((N, model.nv, model.nv))
    assert condyle.crba(model, data, q, out=out) is out
    np.testing.assert_array_equal(out, condyle.crba(model, data, q))
    v, a = (argument(name, robot, N) for name in "va")
    outs = tuple(np.empty_like(out) for _ in range(3))
    d = condyle.rnea_derivatives(model, data, q, v, a, out=outs)
    assert d.dtau_dq is outs[0]
    np.testing.assert_array_equal(outs[2], condyle.rnea_derivatives(model, data, q, v, a).dtau_da)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_same_bits_on_any_number_of_threads(robot: Robot, threads: int) -> None:
    model = robot.model
    q, v, tau = (argument(name, robot, 100) for name in ("q", "v", "tau"))
    expected = condyle.aba_derivatives(model, robot.data, q, v, tau)
    found = condyle.aba_derivatives(model, condyle.Data(model, threads=threads), q, v, tau)
    for x, y in zip(expected, found, strict=True):
        np.testing.assert_array_equal(x, y)


def test_errors(robot: Robot) -> None:
    model, data, q = robot.model, robot.data, argument("q", robot, N)
    with pytest.raises(ValueError, match=f"^v: expected {N} states, as many as q has, found 3$"):
        condyle.nonlinear_effects(model, data, q, np.zeros((3, model.nv)))
    with pytest.raises(
        ValueError,
        match=rf"^q: expected shape \({model.nq},\), or \(N, {model.nq}\) for N states, found \({N}, {model.nq + 1}\)$",
    ):
        condyle.gravity(model, data, np.zeros((N, model.nq + 1)))
    with pytest.raises(ValueError, match="^q: expected at least one state, found none$"):
        condyle.gravity(model, data, np.zeros((0, model.nq)))
    with pytest.raises(ValueError, match="^threads: expected at least 1, found 0$"):
        condyle.Data(model, threads=0)


def test_a_batch_keeps_its_data(quadruped: Robot) -> None:
    """Checks that another thread gets an error if it uses the same `Data` during a call for many states. Such a call
    releases the interpreter's lock.
    """
    model, data = quadruped.model, condyle.Data(quadruped.model)
    q, v, tau = (argument(name, quadruped, 4000) for name in ("q", "v", "tau"))
    condyle.aba_derivatives(model, data, q[:1], v[:1], tau[:1])
    errors: list[BaseException] = []

    def use() -> None:
        while worker.is_alive():
            try:
                condyle.gravity(model, data, q[0])
            except RuntimeError as error:
                errors.append(error)
                return

    worker = threading.Thread(target=lambda: condyle.aba_derivatives(model, data, q, v, tau))
    worker.start()
    use()
    worker.join()
    assert errors and "data: in use by another call" in str(errors[0])


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("shift", [0, 1, 40])
def test_out_over_an_input(shift: int, threads: int) -> None:
    """Checks that all states are computed from the original numbers, if `out` is an input or shares memory with an
    input.
    """
    arm = condyle.robots.arm7()
    states = 30_000  # the call is computed in several parts
    data, memory = condyle.Data(arm, threads=threads), np.random.default_rng(0).standard_normal((states + 40, 7))
    q, out = memory[40 - shift : states + 40 - shift], memory[40 : states + 40]
    expected = condyle.rnea(arm, data, q, q, q)
    assert condyle.rnea(arm, data, q, q, q, out=out) is out
    np.testing.assert_array_equal(out, expected)
    # the same check for functions that compute state by state
    q, out = memory[40 - shift : 140 - shift], memory[40:140]
    expected = condyle.integrate(arm, q, q)
    condyle.integrate(arm, q, q, out=out)
    np.testing.assert_array_equal(out, expected)


def test_out_over_forces() -> None:
    arm = condyle.robots.arm7()
    data, forces = condyle.Data(arm), np.random.default_rng(0).standard_normal((50, arm.nbodies, 6))
    q = np.zeros(7)
    expected = condyle.rnea(arm, data, q, q, q, forces)
    out = forces.reshape(-1)[: 50 * 7].reshape(50, 7)
    np.testing.assert_array_equal(condyle.rnea(arm, data, q, q, q, forces, out=out), expected)


@pytest.mark.parametrize("states", [(), (20,)])
def test_one_array_twice(quadruped: Robot, states: tuple[int, ...]) -> None:
    """Checks that two results in one array are an error, before any result is written. Two inputs may be the same
    array.
    """
    model, data = quadruped.model, quadruped.data
    q = np.broadcast_to(quadruped.q, (*states, 19)).copy()
    v = np.zeros((*states, 18))
    memory = np.zeros((4, *states, 18, 18))
    with pytest.raises(ValueError, match="^out: the arrays for dtau_dq and dtau_da share memory$"):
        condyle.rnea_derivatives(model, data, q, v, v, out=(memory[0], memory[1], memory[0]))
    overlapping = memory.reshape(-1)[18 : 18 + memory[0].size].reshape(memory[0].shape)
    with pytest.raises(ValueError, match="^out: the arrays for dtau_dv and dtau_da share memory$"):
        condyle.rnea_derivatives(model, data, q, v, v, out=(memory[2], overlapping, memory[0]))
    with pytest.raises(ValueError, match="share memory$"):  # also for functions that compute state by state
        condyle.coriolis_derivatives(model, data, q, v, out=(memory[0], memory[0]))
    assert not memory.any()
    condyle.rnea_derivatives(model, data, q, v, v, out=tuple(memory[:3]))
    assert memory.any()
