"""Fixtures of the tests: robots, and a simulated GPU."""

import gc
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from foreign_arrays import Gpu, build
from sample import Robot, make

import condyle
from condyle import _cuda_driver


@pytest.fixture(params=["arm7", "quadruped", "humanoid"])
def robot(request: pytest.FixtureRequest) -> Robot:
    """Provides each built-in robot."""
    return make(getattr(condyle.robots, request.param)())


@pytest.fixture
def quadruped() -> Robot:
    """Provides the quadruped."""
    return make(condyle.robots.quadruped())


@pytest.fixture(scope="module")
def cuda_libraries(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    """Builds replacements of NVIDIA's driver and compiler that work without a GPU."""
    if sys.platform != "linux" or not (shutil.which("cc") and shutil.which("g++")):
        pytest.skip("there are no compilers of C and C++ for the driver without a GPU")
    driver, compiler = build(tmp_path_factory.mktemp("driver"))
    patch = pytest.MonkeyPatch()
    patch.setenv("CONDYLE_CUDA_LIBRARY", str(driver))
    patch.setenv("CONDYLE_NVRTC_LIBRARY", str(compiler))
    patch.setenv("CONDYLE_CACHE", str(tmp_path_factory.mktemp("cache")))
    _cuda_driver._MADE.clear()
    yield driver, compiler
    _cuda_driver._MADE.clear()
    patch.undo()


@pytest.fixture(scope="module")
def shared_gpu(cuda_libraries: tuple[Path, Path]) -> Gpu:
    return Gpu(cuda_libraries[0])


@pytest.fixture
def gpu(shared_gpu: Gpu) -> Iterator[Gpu]:
    """Provides the simulated GPU as another library uses it. After a test, checks that all memory is freed and that the
    driver reports no errors.
    """
    yield shared_gpu
    gc.collect()
    held = _cuda_driver.device(0)
    with held.current() as driver:
        driver.call("cuCtxSynchronize")
    held.hold(_cuda_driver.Event(held, 1), [])
    gc.collect()
    assert shared_gpu.library.fake_complaint() == b""
    assert shared_gpu.live() == {"memory": 0, "streams": 2, "events": 0, "modules": 0}
