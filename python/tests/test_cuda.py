"""Tests of kernels: their results are compared with the library's functions. A replacement of the driver runs the
kernels without a GPU. The tests are skipped if the system has no C and C++ compilers.
"""

import gc
import sys
import threading
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from foreign_arrays import Array, Gpu, Imported, Interface
from sample import Robot

import condyle
import condyle.codegen
import condyle.cuda

ROUNDING = 1e-11
"""Tolerance relative to the largest number; M⁻¹ may amplify rounding errors."""
SINGLE = 1e-5
"""Tolerance of an arm's RNEA in single precision: about a hundred rounding errors of 6e-8."""

ARM = condyle.robots.arm7()


def states(model: condyle.Model, n: int) -> tuple[Any, Any, Any]:
    """Returns q, v and random accelerations or efforts for n states. The states are along the last axis."""
    rng = np.random.default_rng(n)
    q = np.array([condyle.random_configuration(model, seed=k) for k in range(n)]).reshape(n, model.nq)
    v, x = rng.standard_normal((2, n, model.nv))
    return q.T.copy(), v.T.copy(), x.T.copy()


def expected(model: condyle.Model, name: str, *given: Any) -> list[Any]:
    """Returns the results of the library's function; the states are along the last axis."""
    found = getattr(condyle, name)(model, condyle.Data(model), *(np.ascontiguousarray(x.T) for x in given))
    return [np.moveaxis(x, 0, -1) for x in (found if isinstance(found, tuple) else (found,))]


def near(found: Any, wanted: Any, bound: float = ROUNDING) -> None:
    assert found.shape == wanted.shape
    assert np.abs(found - wanted).max() <= bound * (1.0 + np.abs(wanted).max())


@pytest.mark.parametrize("name", ["rnea", "aba", "aba_derivatives"])
def test_kernels_compute_what_the_library_computes(gpu: Gpu, robot: Robot, name: str) -> None:
    if name == "aba_derivatives" and robot.model.nv > 20:
        pytest.skip("what the system's compiler takes for it is not worth it")
    kernel = condyle.cuda.compile(robot.model, name)
    for n in (1, 33, 300):
        given = states(robot.model, n)
        found = kernel(*(condyle.cuda.array(x) for x in given))
        wanted = expected(robot.model, name, *given)
        assert all(isinstance(x, condyle.cuda.DeviceArray) for x in (found if len(wanted) > 1 else [found]))
        for one, other in zip(found if len(wanted) > 1 else [found], wanted, strict=True):
            near(one.numpy(), other)
    assert list(kernel.inputs) == ["q", "v", "a" if name == "rnea" else "tau"]
    assert (kernel.registers, kernel.local_bytes, kernel.device) == (96, 64, 0)


def test_single_precision(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "rnea", dtype="float32")
    given = [x.astype(np.float32) for x in states(ARM, 100)]
    found = kernel(*(condyle.cuda.array(x) for x in given)).numpy()
    assert found.dtype == np.float32
    near(found, expected(ARM, "rnea", *(x.astype(np.float64) for x in given))[0], SINGLE)


def test_limbs_are_shared_out_while_states_are_few(gpu: Gpu, quadruped: Robot) -> None:
    """Checks that several threads share a state if all threads fit on the device at the same time: eight blocks of 256
    threads.
    """
    kernel = condyle.cuda.compile(quadruped.model, "rnea_derivatives")
    assert kernel.partitions > 2
    assert condyle.cuda.compile(ARM, "rnea_derivatives").partitions == 1
    asked = condyle.cuda.compile(quadruped.model, "rnea_derivatives", partitions=2)
    ptx = condyle.cuda.ptx(quadruped.model, "rnea_derivatives", partitions=1, capability=(7, 0))
    alone = condyle.cuda.compile(quadruped.model, "rnea_derivatives", partitions=1, ptx=ptx)
    assert (asked.partitions, alone.partitions) == (2, 1)
    most = 2048 // kernel.partitions
    for n in (1, most, most + 1, 1500):
        given = states(quadruped.model, n)
        wanted = expected(quadruped.model, "rnea_derivatives", *given)
        for each, rows in ((kernel, kernel.partitions if n <= most else 1), (asked, 2), (alone, 1)):
            found = each(*(condyle.cuda.array(x) for x in given))
            assert gpu.rows() == rows
            for one, other in zip(found, wanted, strict=True):
                near(one.numpy(), other)


@pytest.mark.parametrize("is_versioned", [False, True])
@pytest.mark.parametrize("transposed", [False, True])
def test_arrays_of_another_library(gpu: Gpu, transposed: bool, is_versioned: bool) -> None:
    """Checks that a kernel uses another library's arrays without a copy, after the library's pending work. The library
    must then read the correct results.
    """
    kernel = condyle.cuda.compile(ARM, "rnea_derivatives")
    given = states(ARM, 50)
    options = {"transposed": transposed, "is_versioned": is_versioned}
    arrays = [Array(gpu, x.T if transposed else x, **options) for x in given]
    ours = [condyle.cuda.array(np.zeros((7, 7, 50))).swapaxes(0, 1) for _ in range(3)]
    kernel(*arrays, out=ours, stream=gpu.other_stream)
    assert {x.asked for x in arrays} == {gpu.other_stream}
    for one, other in zip(ours, expected(ARM, "rnea_derivatives", *given), strict=True):
        near(one.numpy(), other)
    before = gpu.live()["memory"]
    found = kernel(*arrays, stream=gpu.other_stream)
    assert gpu.live()["memory"] == before + 3, "of three results, and of nothing else"
    assert found._fields == ("dtau_dq", "dtau_dv", "dtau_da")
    for one, other in zip(found, expected(ARM, "rnea_derivatives", *given), strict=True):
        assert isinstance(one, Imported)
        near(one.numpy(), np.moveaxis(other, -1, 0) if transposed else other)


def test_a_consumer_that_does_not_wait_sees_nothing(gpu: Gpu) -> None:
    """Checks that a consumer that does not wait reads no results. This shows that the other tests would detect a
    missing wait.
    """
    kernel = condyle.cuda.compile(ARM, "gravity")
    q = condyle.cuda.array(states(ARM, 3)[0])  # kept alive, because freeing memory would wait for the work on it
    found = kernel(q)
    assert np.isnan(Imported(gpu, found, stream=-1).numpy()).all()
    near(Imported(gpu, found).numpy(), expected(ARM, "gravity", states(ARM, 3)[0])[0])


def test_results_go_where_out_says(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "aba_derivatives")
    given = states(ARM, 20)
    arrays = [Array(gpu, x) for x in given]
    vector, matrix = np.zeros((7, 20)), np.zeros((49, 20))
    first = condyle.cuda.array(vector)
    # matrices are stored by columns: `out` may be a transposed (7, 7, n) array of another library, or a flat array
    turned = Array(gpu, np.zeros((7, 7, 20)))
    turned.strides = (20, 140, 1)
    out = [first, turned, Array(gpu, matrix), condyle.cuda.array(np.zeros((7, 7, 20))).swapaxes(0, 1)]
    before = gpu.live()["memory"]
    assert kernel(*arrays, out=out, stream=gpu.stream) is out
    assert gpu.live()["memory"] == before
    a, da_dq, da_dv, da_dtau = expected(ARM, "aba_derivatives", *given)
    near(out[0].numpy(), a)
    near(out[1].numpy(), da_dq)
    near(out[2].numpy().reshape(7, 7, 20).swapaxes(0, 1), da_dv)
    near(out[3].numpy(), da_dtau)
    result = kernel(*arrays)
    assert kernel(*arrays, out=result._replace(a=first), stream=gpu.stream).da_dq is result.da_dq
    gravity = condyle.cuda.compile(ARM, "gravity")
    assert gravity(first, out=condyle.cuda.array(vector)).shape == (7, 20)

    def refused(message: str, *out: Any) -> None:
        with pytest.raises(ValueError, match=message):
            kernel(*arrays, out=out)

    refused("a: out shares memory with q", arrays[0], *out[1:])
    refused("da_dv: out shares memory with da_dq", first, out[2], out[2], out[3])
    refused(r"da_dq: expected \(49, 20\) in row order, or its transpose, or \(7, 7, 20\) column by column",
            first, condyle.cuda.array(np.zeros((7, 7, 20))), *out[2:])  # fmt: skip
    locked = Array(gpu, vector, is_versioned=True)
    locked.flags = 1
    refused("a: out may not be written to", locked, *out[1:])
    immutable = type("ArrayImpl", (Array,), {"__module__": "jaxlib._jax"})(gpu, vector)
    refused("a: out may not be written to", immutable, *out[1:])
    with pytest.raises(TypeError, match="out: expected 4 arrays, found 1"):
        kernel(*arrays, out=[first])


@pytest.mark.parametrize("states_first", [False, True])
def test_matrices_that_are_not_square(gpu: Gpu, states_first: bool) -> None:
    kernel = condyle.cuda.compile(ARM, "frames", frames=["tool"])
    q, v, _ = states(ARM, 20)
    arrays = [condyle.cuda.array(x) for x in (q, v)]
    found = kernel(*(x.swapaxes(0, 1) for x in arrays) if states_first else arrays)
    wanted = condyle.codegen.compile(ARM, "frames", frames=["tool"])(q.T, v.T)
    out = [condyle.cuda.array(np.zeros((*reversed(shape), 20))) for shape in kernel.outputs.values()]
    out = [x.swapaxes(0, 2 if states_first else 1) if x.ndim == 3 else x for x in out]
    kernel(*arrays, out=out)
    for one, again, other in zip(found, out, wanted, strict=True):
        near(one.numpy() if states_first else np.moveaxis(one.numpy(), -1, 0), other)
        near(again.numpy() if states_first and again.ndim == 3 else np.moveaxis(again.numpy(), -1, 0), other)
    assert found.tool_J.shape == ((20, 6, 7) if states_first else (6, 7, 20))


def test_what_is_lent_is_kept_until_it_was_read(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "gravity")
    q = Array(gpu, states(ARM, 5)[0])
    found = kernel(q)
    assert q.given_back == 0, "the kernel has not run yet, and the library might use the memory for something else"
    found.numpy()
    kernel(condyle.cuda.array(states(ARM, 1)[0]))
    assert q.given_back == 1
    kernel(q, stream=gpu.stream).numpy()
    # if a library reports its stream, the kernel uses this stream, so no other synchronisation is necessary
    torch: Any = ModuleType("torch")
    torch.cuda = SimpleNamespace(current_stream=lambda device: SimpleNamespace(cuda_stream=gpu.stream))
    torch.from_dlpack = lambda x: Imported(gpu, x)
    tensor = type("Tensor", (Array,), {"__module__": "torch", "__array_namespace__": None})(gpu, states(ARM, 5)[0])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "torch", torch)
        found = kernel(tensor)
        assert tensor.given_back == 1
        assert isinstance(found, Imported)
        near(found.numpy(), expected(ARM, "gravity", states(ARM, 5)[0])[0])


def test_streams_may_be_objects(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "gravity")
    q = condyle.cuda.array(states(ARM, 2)[0])
    wanted = expected(ARM, "gravity", states(ARM, 2)[0])[0]
    for stream in (
        0,
        2,
        SimpleNamespace(cuda_stream=gpu.stream),
        SimpleNamespace(ptr=gpu.stream),
        SimpleNamespace(__cuda_stream__=lambda: (0, gpu.stream)),
    ):
        near(kernel(q, stream=stream).numpy(), wanted)
    with pytest.raises(TypeError, match="stream: expected a stream of CUDA or its address, found 'main'"):
        kernel(q, stream="main")


def test_cuda_array_interface(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "gravity")
    array = Array(gpu, states(ARM, 9)[0].T, transposed=True)
    found = kernel(Interface(array))
    wanted = expected(ARM, "gravity", states(ARM, 9)[0])[0].T
    assert isinstance(found, condyle.cuda.DeviceArray)
    said = found.__cuda_array_interface__
    assert (said["shape"], said["strides"], said["typestr"], said["stream"]) == ((9, 7), (8, 72), "<f8", 1)
    near(found.numpy(), wanted)
    near(kernel(Interface(array, strides=None, shape=(7, 9))).numpy(), wanted.T)
    with pytest.raises(ValueError, match="q: expected an array on device 0, found an address elsewhere"):
        kernel(Interface(array, data=(array.host.ctypes.data, False)))
    with pytest.raises(ValueError, match="q: expected strides of whole numbers, found .* bytes"):
        kernel(Interface(array, strides=(4, 60)))


def test_capsules_as_the_header_says(gpu: Gpu) -> None:
    array = condyle.cuda.array(np.arange(12.0, dtype=np.float32).reshape(3, 4))
    for max_version in (None, (0, 8), (1, 0), (2, 1)):
        imported = Imported(gpu, array.swapaxes(0, 1), max_version=max_version)
        is_versioned = max_version is not None and max_version >= (1, 0)
        assert hasattr(imported.managed, "major") == is_versioned
        if is_versioned:
            assert (imported.managed.major, imported.managed.minor, imported.managed.flags) == (1, 0, 0)
        assert (imported.shape, imported.strides, imported.dtype.name) == ((4, 3), (1, 4), "float32")
        assert np.array_equal(imported.numpy(), np.arange(12.0).reshape(3, 4).T)
    array.__dlpack__()  # no library takes over this capsule
    del array
    gc.collect()
    assert gpu.live()["memory"] == 1, "what was imported last is still there"
    assert np.array_equal(imported.numpy(), np.arange(12.0).reshape(3, 4).T)
    del imported
    one = condyle.cuda.array([[1.0]])
    assert repr(one) == "DeviceArray((1, 1), float64, device=0)"
    with pytest.raises((BufferError, RuntimeError, ValueError)):
        np.from_dlpack(one)
    for wrong in ({"copy": True}, {"dl_device": (1, 0)}):
        with pytest.raises(BufferError):
            one.__dlpack__(**wrong)
    with pytest.raises(ValueError, match="stream: expected −1, or 1, 2 or the address of a stream, found 0"):
        one.__dlpack__(stream=0)


def test_ptx_the_cache_and_a_newer_device(gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert condyle.cuda.devices() == ["No GPU 0", "No GPU 1"]
    ptx = condyle.cuda.ptx(ARM, "gravity", capability=(7, 0))
    q = states(ARM, 4)[0]
    condyle.cuda.compile(ARM, "gravity", device=1, cache=tmp_path)
    assert [path.suffix for path in tmp_path.iterdir()] == [".ptx"], "the compiler does not know that device"
    first = condyle.cuda.compile(ARM, "gravity", cache=tmp_path)
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".cubin", ".ptx"]
    monkeypatch.setenv("CXX", "false")  # no C++ compiler: files in the cache must not be compiled again
    for kernel in (
        first,
        condyle.cuda.compile(ARM, "gravity", cache=tmp_path),
        condyle.cuda.compile(ARM, "gravity", ptx=ptx),
    ):
        near(kernel(condyle.cuda.array(q)).numpy(), expected(ARM, "gravity", q)[0])


def test_several_threads_may_call_at_a_time(gpu: Gpu) -> None:
    kernel, failures = condyle.cuda.compile(ARM, "rnea"), []

    def run(n: int) -> None:
        try:
            given = states(ARM, n)
            for _ in range(5):
                near(kernel(*(Array(gpu, x) for x in given)).numpy(), expected(ARM, "rnea", *given)[0])
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=run, args=(n,)) for n in (3, 40, 77)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
