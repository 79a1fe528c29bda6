"""Tests that arrays of any shape, dtype and layout give the result of a plain array, or an error with the expected
shape.
"""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import condyle

ARM = condyle.robots.arm7()
DATA = condyle.Data(ARM)
BODIES = ARM.nbodies
# no deadline: a call takes microseconds, but the machine may pause during the call
quiet = settings(deadline=None, max_examples=200, derandomize=True)

DTYPES = st.sampled_from(
    [np.float64, np.float32, np.float16, np.int64, np.int8, np.uint16, np.bool_, ">f8", np.longdouble]
)


@st.composite
def layouts(draw: st.DrawFn, shape: tuple[int, ...]) -> np.ndarray:
    """Draws an array of this shape. The array may be a view: transposed, reversed, unaligned, read-only, or with
    gaps.
    """
    dtype = np.dtype(draw(DTYPES))
    plain = draw(hnp.arrays(dtype, shape, elements=st.just(0) | st.just(1)))
    match draw(
        st.sampled_from(["plain", "fortran", "reversed", "gaps", "transposed", "unaligned", "read-only", "subclass"])
    ):
        case "fortran":
            return np.asfortranarray(plain)
        case "reversed":
            return plain[::-1]
        case "gaps":
            room = np.zeros((*shape[:-1], 3 * shape[-1]), dtype)
            room[..., ::3] = plain
            return room[..., ::3]
        case "transposed":
            return np.ascontiguousarray(plain.T).T
        case "unaligned":
            room = np.zeros(plain.nbytes + 1, np.uint8)
            view = room[1:].view(dtype).reshape(shape)
            view[...] = plain
            return view
        case "read-only":
            plain.flags.writeable = False
            return plain
        case "subclass":
            return plain.view(np.recarray) if dtype.kind == "V" else plain.view(type("Own", (np.ndarray,), {}))
    return plain


def plain(x: Any) -> np.ndarray:
    return np.array(x, dtype=np.float64, order="C")


@quiet
@given(layouts((7,)), layouts((7,)), layouts((7,)), layouts((BODIES, 6)))
def test_any_layout_of_one_state(q: np.ndarray, v: np.ndarray, a: np.ndarray, f_ext: np.ndarray) -> None:
    before = [x.copy() for x in (q, v, a, f_ext)]
    found = condyle.rnea(ARM, DATA, q, v, a, f_ext)
    assert np.array_equal(found, condyle.rnea(ARM, DATA, plain(q), plain(v), plain(a), plain(f_ext)))
    assert all(np.array_equal(x, y) for x, y in zip((q, v, a, f_ext), before, strict=True))
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    assert found.flags.owndata


@quiet
@given(st.integers(1, 20).flatmap(lambda n: st.tuples(layouts((n, 7)), layouts((n, 7)), layouts((n, BODIES, 6)))))
def test_any_layout_of_many_states(states: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    q, tau, f_ext = states
    v = np.full(7, 0.5)  # one velocity for all states
    found = condyle.aba_derivatives(ARM, DATA, q, v, tau, f_ext)
    again = condyle.aba_derivatives(ARM, DATA, plain(q), v, plain(tau), plain(f_ext))
    one = condyle.aba_derivatives(ARM, DATA, plain(q[-1]), v, plain(tau[-1]), plain(f_ext[-1]))
    for x, y, z in zip(found, again, one, strict=True):
        assert np.array_equal(x, y)
        assert np.array_equal(x[-1], z)


SHAPES = hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=9)


@quiet
@given(SHAPES, st.sampled_from([np.float64, np.int32, np.complex128, "U3", "M8[s]", object]))
def test_any_shape_is_read_or_refused(shape: tuple[int, ...], dtype: Any) -> None:
    """Checks that the array is read as one or many states, or that an error names the argument, the expected shape and
    the found shape.
    """
    q, zero = np.zeros(shape, dtype), np.zeros(7)
    if shape == (7,) or (len(shape) == 2 and shape[1] == 7 and shape[0] > 0):
        wanted: tuple[type[Exception], ...] = () if np.dtype(dtype).kind in "fi" else (TypeError,)
    else:
        wanted = (ValueError, TypeError)
    try:
        found = condyle.rnea(ARM, DATA, q, zero, zero)
    except wanted as error:
        said = str(error)
        assert said.startswith("q: expected ")
        assert "real numbers, found dtype" in said or str(shape) in said or "at least one state" in said
        return
    assert found.shape == shape
    assert not wanted


@quiet
@given(SHAPES, st.sampled_from([np.float64, np.float32, ">f8"]), st.sampled_from(["C", "F", "reversed", "read-only"]))
def test_any_out_is_filled_or_refused(shape: tuple[int, ...], dtype: Any, layout: Any) -> None:
    out = np.full(shape, 7.0, dtype, order="F" if layout == "F" else "C")
    out = out[::-1] if layout == "reversed" and shape else out
    out.flags.writeable = layout != "read-only"
    q = np.full(7, 0.3)
    fits = shape == (7, 7) and np.dtype(dtype) == np.float64 and layout == "C"
    if not fits:
        with pytest.raises(ValueError, match="^out: "):
            condyle.crba(ARM, DATA, q, out=out)
        assert (out == 7.0).all()
        return
    assert condyle.crba(ARM, DATA, q, out=out) is out
    assert np.array_equal(out, condyle.crba(ARM, DATA, q))


@quiet
@given(st.integers(1, 12), st.integers(1, 12))
def test_matrices_of_any_size_are_turned(rows: int, columns: int) -> None:
    """Checks that matrices of all sizes are returned correctly. Rust stores matrices by columns, and transposes them
    tile by tile.
    """
    builder, body = condyle.ModelBuilder("chain"), condyle.WORLD
    inertia = condyle.Inertia.from_com(1.0, [0.1, 0.2, 0.3], np.eye(3))
    for k in range(rows):
        body = builder.body(f"b{k}", body, condyle.Joint.revolute([0.0, 0.6, 0.8]), None, inertia)
    chain = builder.build()
    X = np.arange(float(rows * columns)).reshape(rows, columns)
    assert np.array_equal(condyle.transport(chain, np.zeros(rows), X), X)
