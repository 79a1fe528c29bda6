"""Tests that a `Data` belongs to one robot, and to one call at a time."""

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from sample import Robot

import condyle


def test_data_of_another_robot(quadruped: Robot) -> None:
    arm = condyle.robots.arm7()
    message = r"^data: made for another model \('quadruped'\), not for this 'arm7'$"
    with pytest.raises(ValueError, match=message):
        condyle.gravity(arm, quadruped.data, np.zeros(7))
    fixed = condyle.Model.from_urdf_str(condyle.robots.QUADRUPED)
    with pytest.raises(ValueError, match="^data: made for another model"):
        condyle.gravity(fixed, quadruped.data, np.zeros(fixed.nq))
    with pytest.raises(TypeError):
        condyle.gravity(quadruped.model, None, quadruped.q)  # type: ignore[arg-type]


def test_order_of_calls_does_not_matter(robot: Robot) -> None:
    """Checks that no function reads results that an earlier call left in the scratch memory."""
    model, data, q, v, a, tau, f_ext = robot
    other = condyle.random_configuration(model, seed=9)
    functions = [
        lambda d, q: condyle.rnea(model, d, q, v, a, f_ext),
        lambda d, q: condyle.rnea(model, d, q, v, a),
        lambda d, q: condyle.aba(model, d, q, v, tau),
        lambda d, q: condyle.forward_dynamics(model, d, q, v, tau, None, "dense"),
        lambda d, q: condyle.forward_dynamics(model, d, q, v, tau, None, "sparse"),
        lambda d, q: condyle.crba(model, d, q),
        lambda d, q: condyle.minv(model, d, q),
        lambda d, q: condyle.frame_jacobian(model, d, q, 1),
        lambda d, q: condyle.frame_jacobian_rate(model, d, q, v, 1),
        lambda d, q: condyle.com_acceleration(model, d, q, v, a),
        lambda d, q: condyle.coriolis_matrix(model, d, q, v),
        lambda d, q: condyle.static_torque(model, d, q, f_ext),
        lambda d, q: condyle.centroidal_map(model, d, q).Ag,
        lambda d, q: condyle.centroidal_map_rate(model, d, q, v).dAg,
        lambda d, q: condyle.compute_all_terms(model, d, q, v).h,
        lambda d, q: condyle.joint_torque_regressor(model, d, q, v, a),
        lambda d, q: condyle.rnea_derivatives(model, d, q, v, a).dtau_dq,
        lambda d, q: condyle.aba_derivatives(model, d, q, v, tau).da_dq,
    ]
    for before in functions:
        for function in functions:
            before(data, other)
            assert np.array_equal(function(data, q), function(condyle.Data(model), q))


class Interrupting:
    """An argument that runs a function when a call reads the argument. At this time the call has already begun."""

    def __init__(self, array: NDArray[np.float64], action: Any) -> None:
        self.array, self.action = array, action

    def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[np.float64]:
        self.action()
        return self.array


def test_two_threads_at_once(quadruped: Robot) -> None:
    """Checks that a second thread gets an error if it uses the `Data` of a running call. The result of the running call
    must be correct.
    """
    model, data, q, *_ = quadruped
    expected = condyle.gravity(model, data, q)
    errors: list[str] = []

    def second() -> None:
        try:
            condyle.gravity(model, data, q)
        except RuntimeError as error:
            errors.append(str(error))

    def in_a_thread() -> None:
        thread = threading.Thread(target=second)
        thread.start()
        thread.join()

    assert np.array_equal(condyle.gravity(model, data, Interrupting(q, in_a_thread)), expected)  # type: ignore[arg-type]
    assert errors == ["data: in use by another call; give each thread a Data of its own"]
    # nested calls in one thread are also an error; afterwards the scratch memory is free again
    with pytest.raises(RuntimeError, match="^data: in use by another call"):
        condyle.gravity(model, data, Interrupting(q, lambda: condyle.gravity(model, data, q)))  # type: ignore[arg-type]
    assert np.array_equal(condyle.gravity(model, data, q), expected)


def test_many_threads_share_a_model(robot: Robot) -> None:
    model, _, _, v, _, tau, f_ext = robot
    qs = [condyle.random_configuration(model, seed) for seed in range(8)]

    def work(q: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        data = condyle.Data(model)
        return [condyle.aba_derivatives(model, data, q, v, tau, f_ext).da_dq for _ in range(20)]

    alone = [work(q) for q in qs]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(work, qs))
    for a, b in zip(alone, together, strict=True):
        assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
