"""Arrays in a GPU's memory: arrays of `condyle.cuda`, and arrays that other libraries lend by DLPack or
`__cuda_array_interface__`.
"""

import sys
from collections.abc import Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import _condyle
from ._cuda_driver import Device, Event, Memory

LEGACY = 1
"""The number of the legacy default stream, in DLPack and in the driver."""
_FLOAT, _READ_ONLY = 2, 1
_CUDA, _CUDA_MANAGED = 2, 13
_VERSION = (1, 0)


class DeviceArray:
    """An array in a GPU's memory, as `condyle.cuda` creates it.

    Other libraries take the array without a copy, after pending work: with `torch.from_dlpack(x)`,
    `cupy.from_dlpack(x)`, `jax.numpy.from_dlpack(x)`, or by `__cuda_array_interface__`, as in Numba. `x.numpy()` copies
    the array to the host.
    """

    def __init__(
        self,
        memory: Memory,
        dtype: "np.dtype[Any]",
        shape: tuple[int, ...],
        strides: tuple[int, ...],
        written: "list[tuple[int, Event]]",
    ) -> None:
        self._memory = memory
        self.dtype: np.dtype[Any] = dtype
        self.shape: tuple[int, ...] = shape
        self.strides: tuple[int, ...] = strides
        """The distance between numbers along each axis, counted in numbers."""
        self._written = written
        """The stream that wrote last, and the event after this write, in a list that all views share."""

    @property
    def device(self) -> int:
        """The index of the device that stores the array."""
        return self._memory.device.ordinal

    @property
    def ndim(self) -> int:
        """The number of axes of the array."""
        return len(self.shape)

    def __len__(self) -> int:
        return self.shape[0]

    def __repr__(self) -> str:
        return f"DeviceArray({self.shape}, {self.dtype}, device={self.device})"

    def swapaxes(self, a: int, b: int) -> "DeviceArray":
        """Returns a view with two axes exchanged."""
        order = list(range(self.ndim))
        order[a], order[b] = order[b], order[a]
        shape, strides = (tuple(x[k] for k in order) for x in (self.shape, self.strides))
        return DeviceArray(self._memory, self.dtype, shape, strides, self._written)

    def numpy(self) -> NDArray[Any]:
        """Returns a copy in the host's memory, after pending work."""
        host = np.empty(self.shape, self.dtype)
        order = sorted(range(self.ndim), key=lambda k: (-self.strides[k], k))
        dense = np.empty(tuple(self.shape[k] for k in order), self.dtype)  # its axes are in the order of the memory
        if dense.nbytes > 0:
            self._before(LEGACY)
            with self._memory.device.current() as driver:
                driver.call("cuMemcpyDtoHAsync_v2", dense.ctypes.data, self._memory.address, dense.nbytes, LEGACY)
                driver.call("cuStreamSynchronize", LEGACY)
        host[...] = dense.transpose(np.argsort(order))
        return host

    def _before(self, stream: int) -> None:
        """Makes a stream wait until the numbers of this array are written."""
        for writer, event in self._written:
            if writer != stream:
                event.before(stream)

    def __dlpack_device__(self) -> tuple[int, int]:
        return (_CUDA, self.device)

    def __dlpack__(
        self,
        *,
        stream: int | None = None,
        max_version: tuple[int, int] | None = None,
        dl_device: tuple[int, int] | None = None,
        copy: bool | None = None,
    ) -> Any:
        """Returns a capsule for another library. The other library passes the stream on which it will use the
        numbers.
        """
        if dl_device is not None and tuple(dl_device) != self.__dlpack_device__():
            raise BufferError(f"dl_device: expected {self.__dlpack_device__()}, found {tuple(dl_device)}")
        if copy:
            raise BufferError("copy: a DeviceArray lends its own memory; let your library copy it")
        if stream == 0 or (stream is not None and stream < -1):
            raise ValueError(f"stream: expected −1, or 1, 2 or the address of a stream, found {stream}")
        if stream != -1:
            self._before(LEGACY if stream is None else stream)
        is_versioned = max_version is not None and tuple(max_version) >= _VERSION
        bits = 8 * self.dtype.itemsize
        return _condyle._lend(
            self, self._memory.address, bits, list(self.shape), list(self.strides), self.device, is_versioned
        )

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        """The description of the array that Numba and other libraries read. The description contains a stream; the
        array's numbers are valid after the work of this stream.
        """
        size = self.dtype.itemsize
        return {
            "shape": self.shape,
            "typestr": self.dtype.str,
            "data": (self._memory.address, False),
            "strides": tuple(size * stride for stride in self.strides),
            "stream": self._written[0][0] if self._written else None,
            "version": 3,
        }


def new(device: Device, dtype: "np.dtype[Any]", shape: tuple[int, ...]) -> DeviceArray:
    """Returns an array in row order whose numbers are not yet written."""
    return DeviceArray(Memory(device, prod(shape) * dtype.itemsize), dtype, shape, row_order(shape), [])


def row_order(shape: Sequence[int]) -> tuple[int, ...]:
    """Returns the strides of an array in row order, in numbers."""
    return tuple(prod(shape[k + 1 :]) for k in range(len(shape)))


class View(NamedTuple):
    """The address and the layout of an array's numbers. The address is valid as long as `owner` exists."""

    owner: Any
    address: int
    dtype: str
    shape: tuple[int, ...]
    strides: tuple[int, ...]
    is_read_only: bool


def view(name: str, array: Any, device: Device, stream: int) -> View:
    """Returns a view of any library's array on this device; the stream waits for pending work of that library."""
    if isinstance(array, DeviceArray):
        _on_device(name, device, *array.__dlpack_device__())
        array._before(stream)
        return View(array, array._memory.address, f"float{8 * array.dtype.itemsize}", array.shape, array.strides, False)
    if hasattr(array, "__dlpack_device__"):
        kind, ordinal = array.__dlpack_device__()
        _on_device(name, device, int(kind), int(ordinal))
        try:
            capsule = array.__dlpack__(stream=stream, max_version=_VERSION)
        except TypeError:  # the array's library does not support versioned DLPack
            capsule = array.__dlpack__(stream=stream)
        address, (code, bits, lanes), shape, strides, _, flags = _condyle._borrowed(capsule)
        dtype = f"float{bits}" if (code, lanes) == (_FLOAT, 1) else f"type {code} of {lanes} x {bits} bits"
        is_read_only = bool(flags & _READ_ONLY)
        return View(
            capsule, address, dtype, tuple(shape), row_order(shape) if strides is None else tuple(strides), is_read_only
        )
    if hasattr(array, "__cuda_array_interface__"):
        return _interface(name, array, device, stream)
    raise TypeError(
        f"{name}: expected an array on device {device.ordinal}, as of CuPy, PyTorch or JAX, found "
        f"{type(array).__name__}; condyle.cuda.array copies one to the device"
    )


def _on_device(name: str, device: Device, kind: int, ordinal: int) -> None:
    if kind not in (_CUDA, _CUDA_MANAGED):
        raise TypeError(
            f"{name}: expected an array on device {device.ordinal}, found one that is not on a CUDA device (DLPack's "
            f"device type {kind}); condyle.cuda.array copies one to the device"
        )
    if kind == _CUDA and ordinal != device.ordinal:
        raise ValueError(f"{name}: expected an array on device {device.ordinal}, found one on device {ordinal}")


def _interface(name: str, array: Any, device: Device, stream: int) -> View:
    """Returns a view of an array by its `__cuda_array_interface__`. This interface does not name the device, so the
    function checks that the address belongs to `device`.
    """
    said = array.__cuda_array_interface__
    address, is_read_only = said["data"]
    shape, dtype, their = tuple(said["shape"]), np.dtype(said["typestr"]), said.get("stream")
    size = dtype.itemsize
    strides = said.get("strides")
    steps = row_order(shape) if strides is None else tuple(stride // size for stride in strides)
    if strides is not None and any(stride % size for stride in strides):
        raise ValueError(f"{name}: expected strides of whole numbers, found {strides} bytes")
    if 0 not in shape and not device.owns(address):
        raise ValueError(f"{name}: expected an array on device {device.ordinal}, found an address elsewhere")
    if their is not None and their != stream:
        Event(device, their).before(stream)
    return View(array, address or 0, dtype.name, shape, steps, is_read_only)


def current_stream(array: Any, device: Device) -> int | None:
    """Returns the stream that the library of an array currently uses, if the library reports this stream, as PyTorch
    and CuPy do.
    """
    library = type(array).__module__.partition(".")[0]
    module: Any = sys.modules.get(library)
    if library == "torch":
        return int(module.cuda.current_stream(device.ordinal).cuda_stream) or LEGACY
    if library == "cupy":
        with module.cuda.Device(device.ordinal):
            return int(module.cuda.get_current_stream().ptr) or LEGACY
    return None


def stream_number(stream: Any) -> int:
    """Returns the number of a stream, given as an address, or as an object of PyTorch, CuPy or another library."""
    if hasattr(stream, "__cuda_stream__"):
        _, number = stream.__cuda_stream__()
    else:
        number = getattr(stream, "cuda_stream", getattr(stream, "ptr", stream))
    if not isinstance(number, int) or number < 0:
        raise TypeError(f"stream: expected a stream of CUDA or its address, found {stream!r}")
    return number or LEGACY


def importer(array: Any) -> Any:
    """Returns the function `from_dlpack` of an array's library, or None if the library has no such function."""
    if isinstance(array, DeviceArray):
        return None
    namespace = getattr(array, "__array_namespace__", None)
    library = namespace() if callable(namespace) else sys.modules.get(type(array).__module__.partition(".")[0])
    return getattr(library, "from_dlpack", None)
