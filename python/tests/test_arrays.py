"""Tests of arrays as arguments and results: shapes, dtypes, strides, `out`, and errors."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sample import Robot

import condyle

Call = Callable[..., Any]


def calls(robot: Robot) -> dict[str, Call]:
    """Returns calls of every function that returns one array. Each call is a function of `out`."""
    model, data, q, v, a, tau, f_ext = robot
    tip = [0.1, 0.2, 0.3]
    return {
        "rnea": lambda **k: condyle.rnea(model, data, q, v, a, f_ext, **k),
        "aba": lambda **k: condyle.aba(model, data, q, v, tau, f_ext, **k),
        "forward_dynamics": lambda **k: condyle.forward_dynamics(model, data, q, v, tau, f_ext, "sparse", **k),
        "crba": lambda **k: condyle.crba(model, data, q, **k),
        "minv": lambda **k: condyle.minv(model, data, q, **k),
        "nonlinear_effects": lambda **k: condyle.nonlinear_effects(model, data, q, v, **k),
        "gravity": lambda **k: condyle.gravity(model, data, q, **k),
        "forward_kinematics": lambda **k: condyle.forward_kinematics(model, data, q, **k),
        "frame_placement": lambda **k: condyle.frame_placement(model, data, q, 1, **k),
        "frame_jacobian": lambda **k: condyle.frame_jacobian(model, data, q, 1, **k),
        "static_torque": lambda **k: condyle.static_torque(model, data, q, f_ext, **k),
        "coriolis_matrix": lambda **k: condyle.coriolis_matrix(model, data, q, v, **k),
        "frame_velocity": lambda **k: condyle.frame_velocity(model, data, q, v, 1, **k),
        "frame_acceleration": lambda **k: condyle.frame_acceleration(model, data, q, v, a, 1, **k),
        "frame_classical_acceleration": lambda **k: condyle.frame_classical_acceleration(model, data, q, v, a, 1, **k),
        "frame_jacobian_rate": lambda **k: condyle.frame_jacobian_rate(model, data, q, v, 1, **k),
        "body_jacobian": lambda **k: condyle.body_jacobian(model, data, q, 1, **k),
        "body_velocity": lambda **k: condyle.body_velocity(model, data, q, v, 1, **k),
        "body_acceleration": lambda **k: condyle.body_acceleration(model, data, q, v, a, 1, **k),
        "body_classical_acceleration": lambda **k: condyle.body_classical_acceleration(model, data, q, v, a, 1, **k),
        "body_jacobian_rate": lambda **k: condyle.body_jacobian_rate(model, data, q, v, 1, **k),
        "frame_point_jacobian": lambda **k: condyle.frame_point_jacobian(model, data, q, 0, tip, **k),
        "frame_point_velocity": lambda **k: condyle.frame_point_velocity(model, data, q, v, 0, tip, **k),
        "body_point_jacobian": lambda **k: condyle.body_point_jacobian(model, data, q, 1, tip, **k),
        "body_point_velocity": lambda **k: condyle.body_point_velocity(model, data, q, v, 1, tip, **k),
        "com": lambda **k: condyle.com(model, data, q, **k),
        "com_velocity": lambda **k: condyle.com_velocity(model, data, q, v, **k),
        "com_acceleration": lambda **k: condyle.com_acceleration(model, data, q, v, a, **k),
        "com_jacobian": lambda **k: condyle.com_jacobian(model, data, q, **k),
        "centroidal_momentum": lambda **k: condyle.centroidal_momentum(model, data, q, v, **k),
        "centroidal_momentum_rate": lambda **k: condyle.centroidal_momentum_rate(model, data, q, v, a, **k),
        "joint_torque_regressor": lambda **k: condyle.joint_torque_regressor(model, data, q, v, a, **k),
        "kinetic_energy_regressor": lambda **k: condyle.kinetic_energy_regressor(model, data, q, v, **k),
        "potential_energy_regressor": lambda **k: condyle.potential_energy_regressor(model, data, q, **k),
        "passive_torque": lambda **k: condyle.passive_torque(model, q, v, 0.01, **k),
        "interpolate": lambda **k: condyle.interpolate(model, q, q, 0.5, **k),
        "normalize": lambda **k: condyle.normalize(model, q, **k),
        "transport": lambda **k: condyle.transport(model, v, np.outer(v, [1.0, 2.0]), **k),
        "integrate": lambda **k: condyle.integrate(model, q, v, **k),
        "difference": lambda **k: condyle.difference(model, q, q, **k),
        "integrate_jacobian": lambda **k: condyle.integrate_jacobian(model, v, "velocity", **k),
        "difference_jacobian": lambda **k: condyle.difference_jacobian(model, v, "to", **k),
    }


def several(robot: Robot) -> dict[str, Call]:
    """Returns calls of the functions that return several arrays. Each call is a function of `out`."""
    model, data, q, v, a, tau, f_ext = robot
    return {
        "rnea_derivatives": lambda **k: condyle.rnea_derivatives(model, data, q, v, a, f_ext, **k),
        "aba_derivatives": lambda **k: condyle.aba_derivatives(model, data, q, v, tau, f_ext, **k),
        "passive_torque_derivatives": lambda **k: condyle.passive_torque_derivatives(model, q, v, 0.01, **k),
        "centroidal_map": lambda **k: condyle.centroidal_map(model, data, q, **k),
        "centroidal_map_rate": lambda **k: condyle.centroidal_map_rate(model, data, q, v, **k),
    }


def test_shapes(robot: Robot) -> None:
    nq, nv, nb = robot.model.nq, robot.model.nv, robot.model.nbodies
    shapes = {
        "rnea": (nv,),
        "aba": (nv,),
        "forward_dynamics": (nv,),
        "crba": (nv, nv),
        "minv": (nv, nv),
        "nonlinear_effects": (nv,),
        "gravity": (nv,),
        "forward_kinematics": (nb, 4, 4),
        "frame_placement": (4, 4),
        "frame_jacobian": (6, nv),
        "static_torque": (nv,),
        "coriolis_matrix": (nv, nv),
        "frame_velocity": (6,),
        "frame_acceleration": (6,),
        "frame_classical_acceleration": (6,),
        "frame_jacobian_rate": (6, nv),
        "body_jacobian": (6, nv),
        "body_velocity": (6,),
        "body_acceleration": (6,),
        "body_classical_acceleration": (6,),
        "body_jacobian_rate": (6, nv),
        "frame_point_jacobian": (3, nv),
        "frame_point_velocity": (3,),
        "body_point_jacobian": (3, nv),
        "body_point_velocity": (3,),
        "com": (3,),
        "com_velocity": (3,),
        "com_acceleration": (3,),
        "com_jacobian": (3, nv),
        "centroidal_momentum": (6,),
        "centroidal_momentum_rate": (6,),
        "joint_torque_regressor": (nv, 10 * (nb - 1)),
        "kinetic_energy_regressor": (10 * (nb - 1),),
        "potential_energy_regressor": (10 * (nb - 1),),
        "passive_torque": (nv,),
        "interpolate": (nq,),
        "normalize": (nq,),
        "transport": (nv, 2),
        "integrate": (nq,),
        "difference": (nv,),
        "integrate_jacobian": (nv, nv),
        "difference_jacobian": (nv, nv),
    }
    functions = calls(robot)
    assert functions.keys() == shapes.keys()
    for name, call in functions.items():
        array = call()
        assert (array.shape, array.dtype) == (shapes[name], np.float64), name
        assert array.flags.c_contiguous, name
        assert array.flags.writeable, name
    assert [x.shape for x in several(robot)["rnea_derivatives"]()] == [(nv, nv)] * 3
    assert [x.shape for x in several(robot)["aba_derivatives"]()] == [(nv,)] + [(nv, nv)] * 3
    map_shapes = {"Ag": (6, nv), "dAg": (6, nv), "hg": (6,), "Ig": (6, 6), "com": (3,), "Jcom": (3, nv)}
    for name in ("centroidal_map", "centroidal_map_rate"):
        for field, x in several(robot)[name]()._asdict().items():
            assert x.shape == map_shapes.get(field, (3,)), field


def test_results_belong_to_the_caller(robot: Robot) -> None:
    for name, call in calls(robot).items():
        first = call()
        kept = first.copy()
        second = call()
        assert not np.shares_memory(first, second), name
        second[...] = np.nan
        assert np.array_equal(first, kept), name
        assert np.array_equal(call(), kept), name


def test_out(robot: Robot) -> None:
    for name, call in calls(robot).items():
        expected = call()
        out = np.full_like(expected, np.nan)
        assert call(out=out) is out, name
        assert np.array_equal(out, expected), name
    for call in several(robot).values():
        expected = call()
        out = type(expected)(*(np.full_like(x, np.nan) for x in expected))
        result = call(out=out)
        assert all(a is b for a, b in zip(result, out, strict=True))
        assert all(np.array_equal(a, b) for a, b in zip(out, expected, strict=True))
        assert all(a is b for a, b in zip(call(out=list(out)), out, strict=True))


def test_out_may_be_an_argument(quadruped: Robot) -> None:
    model, data, q, v, a, *_ = quadruped
    expected = condyle.rnea(model, data, q, v, a)
    assert condyle.rnea(model, data, q, v, a, out=a) is a
    assert np.array_equal(a, expected)


def test_wrong_out(quadruped: Robot) -> None:
    call = calls(quadruped)["rnea"]
    with pytest.raises(ValueError, match=r"^out: expected shape \(18,\), found \(17,\)$"):
        call(out=np.empty(17))
    with pytest.raises(ValueError, match=r"^out: expected a writable C-contiguous float64 array .* dtype float32"):
        call(out=np.empty(18, np.float32))
    with pytest.raises(ValueError, match=r"^out: expected a writable C-contiguous float64 array .* strides \[16\]"):
        call(out=np.empty(36)[::2])
    with pytest.raises(TypeError, match=r"^out: expected a writable .* found list"):
        call(out=[0.0] * 18)
    frozen = np.empty(18)
    frozen.flags.writeable = False
    with pytest.raises(ValueError, match="^out: "):
        call(out=frozen)
    with pytest.raises(ValueError, match="^out: expected a writable C-contiguous"):
        calls(quadruped)["crba"](out=np.empty((18, 18), order="F"))
    with pytest.raises(ValueError, match=r"^out: expected 3 arrays \(dtau_dq, dtau_dv, dtau_da\), found 2$"):
        several(quadruped)["rnea_derivatives"](out=(np.empty((18, 18)), np.empty((18, 18))))


def test_inputs_of_other_dtypes_and_strides(quadruped: Robot) -> None:
    model, data, q, v, a, _, f_ext = quadruped
    expected = condyle.rnea(model, data, q, v, a, f_ext)

    def check(*arguments: Any) -> None:
        assert np.array_equal(condyle.rnea(model, data, *arguments), expected)

    check(list(q), tuple(v), a.tolist(), f_ext.tolist())
    check(np.repeat(q, 2)[::2], v[::-1].copy()[::-1], np.stack([a, a], axis=1)[:, 0], np.asfortranarray(f_ext))
    check(q.astype(">f8"), v.astype(np.longdouble), a, f_ext)
    unaligned = np.frombuffer(b"\0" + q.tobytes(), np.uint8)[1:].view(np.float64)
    assert not unaligned.flags.aligned
    check(unaligned, v, a, f_ext)
    for array in (q, v, a, f_ext):
        array.flags.writeable = False
    check(q, v, a, f_ext)

    single = [x.astype(np.float32) for x in (q, v, a, f_ext)]
    double = [x.astype(np.float64) for x in single]
    assert np.array_equal(condyle.rnea(model, data, *single), condyle.rnea(model, data, *double))
    ones = np.ones(model.nv)
    expected = condyle.rnea(model, data, q, ones, a)
    for dtype in (np.int64, np.uint8, np.bool_, np.float16):
        assert np.array_equal(condyle.rnea(model, data, q, ones.astype(dtype), a), expected)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q": np.zeros(18)}, r"^q: expected shape \(19,\), found \(18,\)$"),
        ({"q": np.zeros((1, 1, 19))}, r"^q: expected shape \(19,\), found \(1, 1, 19\)$"),
        ({"q": np.zeros((1, 18))}, r"^q: expected shape \(19,\), or \(N, 19\) for N states, found \(1, 18\)$"),
        ({"v": 0.0}, r"^v: expected shape \(18,\), found \(\)$"),
        ({"a": []}, r"^a: expected shape \(18,\), found \(0,\)$"),
        ({"a": np.zeros(19, np.float32)}, r"^a: expected shape \(18,\), found \(19,\)$"),
        ({"f_ext": np.zeros((13, 6))}, r"^f_ext: expected shape \(14, 6\), found \(13, 6\)$"),
        ({"f_ext": np.zeros((6, 14))}, r"^f_ext: expected shape \(14, 6\), found \(6, 14\)$"),
        ({"v": [[1.0], [2.0, 3.0]]}, r"^v: "),
    ],
)
def test_wrong_shapes(quadruped: Robot, change: dict[str, Any], message: str) -> None:
    arguments = {"q": quadruped.q, "v": quadruped.v, "a": quadruped.a, "f_ext": quadruped.f_ext}
    with pytest.raises(ValueError, match=message):
        condyle.rnea(quadruped.model, quadruped.data, **arguments | change)


@pytest.mark.parametrize(
    "wrong", [np.zeros(19, complex), ["x"] * 19, [None] * 19, np.zeros(19, object), np.zeros(19, "M8[s]")]
)
def test_wrong_dtypes(quadruped: Robot, wrong: Any) -> None:
    with pytest.raises(TypeError, match="^q: expected real numbers, found dtype "):
        condyle.gravity(quadruped.model, quadruped.data, wrong)


def test_wrong_words(quadruped: Robot) -> None:
    model, data, q, v, *_ = quadruped
    with pytest.raises(condyle.ModelError, match="^unknown frame `LF_fot`; nearest is `LF_foot`$"):
        condyle.frame_placement(model, data, q, "LF_fot")
    for index in (-1, len(model.frames)):
        with pytest.raises(IndexError, match=rf"^frame: expected a name or 0 to \d+, found {index}$"):
            condyle.frame_placement(model, data, q, index)
    with pytest.raises(condyle.ModelError, match="^unknown joint `LF_kne`; nearest is `"):
        condyle.body_jacobian(model, data, q, "LF_kne")
    for index in (-1, model.nbodies):
        with pytest.raises(IndexError, match=rf"^body: expected a joint's name or 0 to 13, found {index}$"):
            condyle.body_jacobian(model, data, q, index)
    with pytest.raises(TypeError):
        condyle.frame_placement(model, data, q, 1.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^reference: expected 'local', 'world' .*, found 'body'"):
        condyle.frame_jacobian(model, data, q, 1, "body")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^argument: expected 'position' or 'velocity', found 'q'"):
        condyle.integrate_jacobian(model, v, "q")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^argument: expected 'from' or 'to', found 'q'"):
        condyle.difference_jacobian(model, v, "q")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="^smoothing: expected a positive speed, found 0$"):
        condyle.passive_torque(model, q, v, 0.0)
    with pytest.raises(ValueError, match=r"^X: expected shape \(18, 2\), found \(17, 2\)$"):
        condyle.transport(model, v, np.zeros((17, 2)))
    with pytest.raises(ValueError, match=r"^X: expected shape \(18, 1\), found \(18,\)$"):
        condyle.transport(model, v, v)
    with pytest.raises(ValueError, match="^X: "):
        condyle.transport(model, v, [[1.0], [1.0, 2.0]])


def test_an_array_that_fails_to_convert_tells_so(quadruped: Robot) -> None:
    class Broken:
        def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
            raise LookupError("no numbers here")

    with pytest.raises(LookupError, match="no numbers here"):
        condyle.gravity(quadruped.model, quadruped.data, Broken())  # type: ignore[arg-type]
