"""A replacement of NVIDIA's driver that works without a GPU, and two array libraries that behave like CuPy, PyTorch,
JAX and Numba.

The structures of DLPack are defined again here, and capsules are made and read by Python's C interface.
"""

import ctypes
import os
import subprocess
from collections.abc import Sequence
from ctypes import byref, c_int, c_int32, c_int64, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

SOURCES = Path(__file__).parents[2] / "tests" / "cuda_driver"


class Tensor(ctypes.Structure):
    _fields_ = (
        ("data", c_void_p),
        ("device_type", c_int32),
        ("device_id", c_int32),
        ("ndim", c_int32),
        ("code", c_uint8),
        ("bits", c_uint8),
        ("lanes", c_uint16),
        ("shape", ctypes.POINTER(c_int64)),
        ("strides", ctypes.POINTER(c_int64)),
        ("byte_offset", c_uint64),
    )


class Managed(ctypes.Structure):
    _fields_ = (("tensor", Tensor), ("context", c_void_p), ("deleter", c_void_p))


class Versioned(ctypes.Structure):
    _fields_ = (
        ("major", c_uint32),
        ("minor", c_uint32),
        ("context", c_void_p),
        ("deleter", c_void_p),
        ("flags", c_uint64),
        ("tensor", Tensor),
    )


python = ctypes.pythonapi
python.PyCapsule_New.restype, python.PyCapsule_New.argtypes = ctypes.py_object, [c_void_p, ctypes.c_char_p, c_void_p]
python.PyCapsule_GetPointer.restype = c_void_p
python.PyCapsule_GetPointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
python.PyCapsule_GetName.restype, python.PyCapsule_GetName.argtypes = ctypes.c_char_p, [ctypes.py_object]
python.PyCapsule_SetName.argtypes = [ctypes.py_object, ctypes.c_char_p]
USED = {b"dltensor": b"used_dltensor", b"dltensor_versioned": b"used_dltensor_versioned"}

LENT: dict[int, "Speaker"] = {}
"""The owners of lent arrays, which capsules keep alive."""
DESCRIPTIONS: list[Any] = []
"""Objects to which capsules point, and the deleters of these capsules; these objects are kept until the process
ends.
"""


def build(folder: Path) -> tuple[Path, Path]:
    """Compiles the replacements of NVIDIA's driver and of NVIDIA's compiler."""
    made = []
    for source, name in (("driver.c", "libcuda.so.1"), ("nvrtc.c", "libnvrtc.so.12")):
        made.append(folder / name)
        flags = ["-shared", "-fPIC", "-pthread", "-ldl"]
        subprocess.run([os.environ.get("CC", "cc"), SOURCES / source, *flags, "-o", made[-1]], check=True)
    return made[0], made[1]


class Gpu:
    """The replaced driver as another library uses it, on device 0. The library's two streams do not wait for other
    streams.
    """

    def __init__(self, library: Path) -> None:
        self.library = ctypes.CDLL(str(library))
        self.library.fake_complaint.restype = ctypes.c_char_p
        self.library.fake_live.restype = ctypes.c_long
        self.library.fake_launches.restype = ctypes.c_long
        context, streams = c_void_p(), [c_void_p(), c_void_p()]
        self.call("cuInit", 0)
        self.call("cuDevicePrimaryCtxRetain", byref(context), 0)
        self.call("cuCtxPushCurrent_v2", context)
        for stream in streams:
            self.call("cuStreamCreate", byref(stream), 1)
        self.stream, self.other_stream = (stream.value or 0 for stream in streams)
        self.call("cuCtxPopCurrent_v2", None)
        self.context = context

    def rows(self) -> int:
        """Returns the number of block rows of the last launch."""
        last = (ctypes.c_uint * 3)()
        self.library.fake_launches(last)
        return last[2]

    def call(self, name: str, *arguments: Any) -> None:
        status = getattr(self.library, name)(*arguments)
        assert status == 0, (name, status)

    def __enter__(self) -> None:
        self.call("cuCtxPushCurrent_v2", self.context)

    def __exit__(self, *_: object) -> None:
        self.call("cuCtxPopCurrent_v2", None)

    def order(self, first: int, then: int) -> None:
        """Makes the stream `then` wait for the stream `first`."""
        event = c_void_p()
        with self:
            self.call("cuEventCreate", byref(event), 2)
            self.call("cuEventRecord", event, c_void_p(first))
            self.call("cuStreamWaitEvent", c_void_p(then), event, 0)
            self.call("cuEventDestroy_v2", event)

    def live(self) -> dict[str, int]:
        return {name: self.library.fake_live(k) for k, name in enumerate(("memory", "streams", "events", "modules"))}

    def fail(self, name: str, status: int) -> None:
        self.library.fake_fail(name.encode(), status)


class Speaker:
    """An array that supports DLPack, versioned or not. Its library works on a stream of its own."""

    gpu: Gpu
    address: int
    dtype: "np.dtype[Any]"
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    is_versioned = False
    flags = 0
    device = (2, 0)
    given_back = 0
    asked = 0

    def __array_namespace__(self) -> Any:
        return SimpleNamespace(from_dlpack=lambda x: Imported(self.gpu, x))

    def __dlpack_device__(self) -> tuple[int, int]:
        return self.device

    def __dlpack__(self, *, stream: int | None = None, **options: Any) -> Any:
        if options and not self.is_versioned:
            raise TypeError(f"unexpected arguments {options}")
        assert isinstance(stream, int)
        assert stream > 0
        self.asked = stream
        self.gpu.order(self.gpu.stream, stream)
        sizes, steps = ((c_int64 * len(x))(*x) for x in (self.shape, self.strides))
        bits = 8 * self.dtype.itemsize
        code = {"f": 2, "i": 0}[self.dtype.kind]
        # address and offset as if the array were a part of a larger array
        tensor = Tensor(self.address - 8, *self.device, len(sizes), code, bits, 1, sizes, steps, 8)

        deleter = ctypes.CFUNCTYPE(None, c_void_p)(lambda _: None)  # these capsules have no consumer
        managed: Any = Managed(tensor, None, ctypes.cast(deleter, c_void_p))
        if self.is_versioned:
            managed = Versioned(1, 0, None, ctypes.cast(deleter, c_void_p), self.flags, tensor)
        place = ctypes.addressof(managed)

        @ctypes.CFUNCTYPE(None, c_void_p)
        def end(_: int) -> None:
            LENT.pop(place).given_back += 1

        LENT[place] = self
        DESCRIPTIONS.append((managed, sizes, steps, deleter, end))
        name = b"dltensor_versioned" if self.is_versioned else b"dltensor"
        return python.PyCapsule_New(place, name, ctypes.cast(end, c_void_p))

    def numpy(self) -> Any:
        return download(self.gpu, self.address, self.dtype, self.shape, self.strides)


class Array(Speaker):
    """An array of another library, which the library writes on its own stream."""

    def __init__(self, gpu: Gpu, numbers: Any, *, transposed: bool = False, is_versioned: bool = False) -> None:
        self.gpu, self.is_versioned = gpu, is_versioned
        host = np.array(numbers.T if transposed else numbers, order="C")
        self.dtype, self.host, address = host.dtype, host, c_uint64()
        with gpu:
            gpu.call("cuMemAlloc_v2", byref(address), ctypes.c_size_t(max(host.nbytes, 1)))
            if host.nbytes:
                size = ctypes.c_size_t(host.nbytes)
                gpu.call("cuMemcpyHtoDAsync_v2", address, c_void_p(host.ctypes.data), size, c_void_p(gpu.stream))
        self.address, self.shape = address.value, host.shape
        self.strides = tuple(s // host.itemsize for s in host.strides)
        if transposed:
            self.shape, self.strides = self.shape[::-1], self.strides[::-1]

    def __del__(self) -> None:
        with self.gpu:
            self.gpu.call("cuMemFree_v2", c_uint64(self.address))


class Imported(Speaker):
    """An array that another library imports from a capsule. The library takes ownership, and returns the array when
    this object is deleted.
    """

    def __init__(self, gpu: Gpu, array: Any, *, stream: int | None = None, max_version: Any = (1, 0)) -> None:
        self.gpu = gpu
        assert array.__dlpack_device__() == (2, 0)
        where = gpu.stream if stream is None else stream
        capsule = array.__dlpack__(stream=where, max_version=max_version, dl_device=None, copy=None)
        name = python.PyCapsule_GetName(capsule)
        place = python.PyCapsule_GetPointer(capsule, name)
        python.PyCapsule_SetName(capsule, USED[name])
        self.managed: Any = (Versioned if b"versioned" in name else Managed).from_address(place)
        self.place, tensor = place, self.managed.tensor
        assert (tensor.device_type, tensor.device_id, tensor.code, tensor.lanes) == (2, 0, 2, 1)
        self.dtype, self.address = np.dtype(f"f{tensor.bits // 8}"), (tensor.data or 0) + tensor.byte_offset
        self.shape, self.strides = (tuple(x[: tensor.ndim]) for x in (tensor.shape, tensor.strides))

    def __del__(self) -> None:
        ctypes.CFUNCTYPE(None, c_void_p)(self.managed.deleter)(self.place)

    def swapaxes(self, a: int, b: int) -> "Imported":
        order = list(range(len(self.shape)))
        order[a], order[b] = order[b], order[a]
        self.shape, self.strides = (tuple(x[k] for k in order) for x in (self.shape, self.strides))
        return self


class Interface:
    """An array that has only `__cuda_array_interface__`, as earlier versions of Numba had."""

    def __init__(self, array: Array, **changes: Any) -> None:
        size = array.dtype.itemsize
        self.array = array
        self.__cuda_array_interface__ = {
            "shape": array.shape,
            "typestr": array.dtype.str,
            "data": (array.address, False),
            "strides": tuple(size * stride for stride in array.strides),
            "stream": array.gpu.stream,
            "version": 3,
        } | changes


def download(gpu: Gpu, address: int, dtype: Any, shape: Sequence[int], strides: Sequence[int]) -> Any:
    """Returns the numbers of an array that are in memory when the library's own stream reads them."""
    memory = np.full(int(np.prod(shape)), np.nan, dtype)
    if memory.size:
        with gpu:
            size, stream = ctypes.c_size_t(memory.nbytes), c_void_p(gpu.stream)
            gpu.call("cuMemcpyDtoHAsync_v2", c_void_p(memory.ctypes.data), c_uint64(address), size, stream)
            gpu.call("cuStreamSynchronize", stream)
    steps = [memory.itemsize * stride for stride in strides]
    return np.lib.stride_tricks.as_strided(memory, shape, steps).copy()


assert c_int is c_int32
