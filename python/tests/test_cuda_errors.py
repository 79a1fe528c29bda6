"""Tests of the errors of `condyle.cuda` for wrong arguments, and for a missing driver, device or compiler."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from foreign_arrays import Array, Gpu

import condyle
import condyle.cuda
from condyle import _cuda_driver

ARM = condyle.robots.arm7()


def test_wrong_arguments(gpu: Gpu) -> None:
    kernel = condyle.cuda.compile(ARM, "rnea")
    q, v, a = (condyle.cuda.array(np.zeros((7, 10))) for _ in range(3))

    def refused(kind: type[Exception], message: str, *given: Any) -> None:
        with pytest.raises(kind, match=message):
            kernel(*given)

    refused(TypeError, r"rnea\(q, v, a\) -> tau: expected 3 arguments, found 2", q, v)
    refused(
        TypeError, "q: expected an array on device 0, found one that is not on a CUDA device", np.zeros((7, 1)), v, a
    )
    refused(TypeError, "v: expected an array on device 0, as of CuPy, PyTorch or JAX, found list", q, [1.0], a)
    refused(ValueError, r"v: expected \(7, 10\) in row order, .*, found \(7, 9\) with strides \(9, 1\)",
            q, condyle.cuda.array(np.zeros((7, 9))), a)  # fmt: skip
    refused(ValueError, r"q: expected \(7, n\) in row order, .*, found \(10, 7\) with strides \(7, 1\); copy it",
            condyle.cuda.array(np.zeros((10, 7))), v, a)  # fmt: skip
    refused(ValueError, "v: expected float64, found float32", q, condyle.cuda.array(np.zeros((7, 10)), "float32"), a)
    elsewhere = Array(gpu, np.zeros((7, 10)))
    elsewhere.device = (2, 1)
    refused(ValueError, "a: expected an array on device 0, found one on device 1", q, v, elsewhere)
    refused(ValueError, "v: expected float64, found type 0 of 1 x 64 bits", q, Array(gpu, np.zeros((7, 10), int)), a)
    gpu.fail("cuLaunchKernel", 2)
    refused(RuntimeError, r"cuLaunchKernel: CUDA_ERROR_OUT_OF_MEMORY, out of memory \(status 2\)", q, v, a)
    assert kernel(*(condyle.cuda.array(np.zeros((7, 0))) for _ in range(3))).numpy().shape == (7, 0)


def test_what_cannot_be_made_is_said(gpu: Gpu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="device: expected a number from 0 to 1, found 2"):
        condyle.cuda.compile(ARM, "rnea", device=2)
    with pytest.raises(ValueError, match="dtype: expected 'float64' or 'float32', found 'float16'"):
        condyle.cuda.compile(ARM, "rnea", dtype="float16")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="functions: expected 'rnea', .*, found 'abba'"):
        condyle.cuda.compile(ARM, "abba")
    with pytest.raises(ValueError, match="partitions: expected None or at least 1 for 'cuda', found 0"):
        condyle.cuda.compile(ARM, "rnea", partitions=0)
    with pytest.raises(RuntimeError, match="arm7_rnea: not loaded: CUDA_ERROR_INVALID_PTX, .*: ptxas: this is no code"):
        condyle.cuda.compile(ARM, "rnea", ptx=b"no code")
    monkeypatch.setenv("CXX", "sh -c 'echo no such option; exit 1'")
    with pytest.raises(RuntimeError, match="arm7_crba: not compiled for sm_90: status 6: no such option"):
        condyle.cuda.compile(ARM, "crba", cache=tmp_path)
    assert not list(tmp_path.iterdir())
    gpu.fail("cuMemAlloc_v2", 2)
    with pytest.raises(RuntimeError, match="cuMemAlloc_v2: CUDA_ERROR_OUT_OF_MEMORY"):
        condyle.cuda.array([1.0])


PROGRAM = """
import condyle, condyle.cuda, numpy as np
kernel = condyle.cuda.compile(condyle.robots.arm7(), "gravity")
found = kernel(condyle.cuda.array(np.zeros((7, 3))))
capsule = found.__dlpack__()
"""


def run(program: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Runs a program with its own cache, because files of the replacement compiler are valid only within one
    process.
    """
    with TemporaryDirectory() as cache:
        changed = os.environ | {"CONDYLE_CACHE": cache} | environment
        return subprocess.run([sys.executable, "-c", program], env=changed, capture_output=True, text=True, check=False)


def test_arrays_that_are_there_at_the_end(gpu: Gpu) -> None:
    ended = run(PROGRAM)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_without_a_driver_or_a_device(cuda_libraries: tuple[Path, Path]) -> None:
    said = run(PROGRAM, CONDYLE_CUDA_LIBRARY="no-such-file.so")
    assert said.returncode == 1
    assert "RuntimeError: CUDA's driver: cannot be loaded: no-such-file.so: cannot open" in said.stderr
    assert "; the environment variable CONDYLE_CUDA_LIBRARY may name its file" in said.stderr
    said = run(PROGRAM, CONDYLE_CUDA_LIBRARY=str(cuda_libraries[1]))
    assert "undefined symbol: cuInit" in said.stderr
    said = run(PROGRAM, CONDYLE_NVRTC_LIBRARY="no-such-file.so")
    assert "RuntimeError: NVIDIA's run-time compiler: cannot be loaded: no-such-file.so" in said.stderr
    count = "import ctypes, os; ctypes.CDLL(os.environ['CONDYLE_CUDA_LIBRARY']).fake_devices(0)\n"
    said = run(count + PROGRAM)
    assert "RuntimeError: cuInit: CUDA_ERROR_NO_DEVICE, no CUDA-capable device is detected (status 100)" in said.stderr


def test_nvidias_compiler_takes_the_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compiles a kernel with NVIDIA's compiler, which needs no GPU; skipped if this compiler is not installed."""
    monkeypatch.delenv("CONDYLE_NVRTC_LIBRARY", raising=False)
    try:
        compiler = _cuda_driver.Compiler()
    except RuntimeError as error:
        pytest.skip(f"NOT RUN: {error}")
    monkeypatch.setattr(_cuda_driver, "compiler", lambda: compiler)
    ptx = condyle.cuda.ptx(ARM, "aba", dtype="float32", capability=(7, 5))
    assert b".visible .entry arm7_float_aba(" in ptx
    assert compiler.architecture((9, 0)) == "sm_90"
    assert compiler.compile("arm7_aba", "__global__ void f() {}", "sm_90").startswith(b"\x7fELF")
    with pytest.raises(RuntimeError, match="arm7_aba: not compiled for compute_10: .*gpu-architecture"):
        condyle.cuda.ptx(ARM, "aba", capability=(1, 0))
