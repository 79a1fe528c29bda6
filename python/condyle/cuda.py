"""Robots as kernels on an NVIDIA GPU: compiled at run time, and called with arrays of CuPy, PyTorch or JAX.

    import condyle.cuda, torch

    arm = condyle.robots.arm7()
    aba = condyle.cuda.compile(arm, "aba_derivatives", dtype="float32")
    q, v, tau = torch.zeros(3, 7, 100_000, device="cuda")
    d = aba(q, v, tau)           # a named tuple of tensors; d.da_dq has the shape (7, 7, 100_000)
    aba(q, v, tau, out=d)        # into the same memory

A thread computes one state. If the results need too many registers and the number of states is small, several threads
share a state. Each of these threads computes some of the results. An argument of k numbers for n states is an array of
shape (k, n) in row order: for each of the k numbers, the values of all states are contiguous. The transpose of such an
array, with shape (n, k) and strides (1, n), is accepted, too. If the first argument is such a transpose, the results
also have the states along the first axis. No array is copied: other layouts and dtypes are errors. Results are arrays
of the library of the first argument.

CUDA itself need not be installed. Two libraries are needed at run time: the driver, which is installed with the GPU,
and NVIDIA's run-time compiler (`pip install 'condyle[cuda]'`, or a compiler of the system). The environment variables
`CONDYLE_CUDA_LIBRARY` and `CONDYLE_NVRTC_LIBRARY` can name other files. All work uses the primary context of the
device, which other libraries also use.
"""

import os
from collections import namedtuple
from collections.abc import Sequence
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from . import _condyle, _cuda_driver
from ._condyle import Model
from ._cuda_driver import Device, Event, Function
from ._device_array import LEGACY, DeviceArray, View, current_stream, importer, new, stream_number, view
from ._types import ContactConstraint

__all__ = ["DeviceArray", "Kernel", "array", "compile", "devices", "ptx"]

_LANGUAGES = {"float64": "cuda", "float32": "cuda-float"}
_PLACES = 2**31 - 1
"""Maximum number of elements of an array. The limit exists because kernels use indices of 32 bits."""


def devices() -> list[str]:
    """Returns the names of the CUDA devices.

    Raises `RuntimeError` if the driver is missing, or finds no device.
    """
    return _cuda_driver.names()


def array(numbers: ArrayLike, dtype: Literal["float64", "float32"] | None = None, *, device: int = 0) -> DeviceArray:
    """Copies a NumPy array, or an object that NumPy can convert to an array, to the memory of a device, in row order.

    Raises `RuntimeError` if the driver is missing, or memory is insufficient.
    """
    host: np.ndarray[Any, Any] = np.ascontiguousarray(numbers, dtype=dtype)
    if host.dtype.name not in _LANGUAGES:
        host = host.astype(np.float64)
    made = new(_cuda_driver.device(device), host.dtype, np.shape(numbers))
    if host.nbytes > 0:
        with made._memory.device.current() as driver:
            driver.call("cuMemcpyHtoDAsync_v2", made._memory.address, host.ctypes.data, host.nbytes, LEGACY)
            driver.call("cuStreamSynchronize", LEGACY)
    return made


class _Array:
    """An argument or a result: its name, and its shape for one state."""

    def __init__(self, name: str, rows: int, columns: int) -> None:
        self.name, self.rows, self.columns = name, rows, columns
        self.size = rows * columns
        self.shape: tuple[int, ...] = (rows,) if columns == 1 else (rows, columns)

    def in_memory(self, n: int) -> tuple[int, ...]:
        """Returns the shape of the array as it is stored, in row order: matrices are stored by columns, so the axes of
        a matrix are reversed.
        """
        return (*reversed(self.shape), n)

    def turned(self, made: Any, states_first: bool) -> Any:
        """Returns a view in which the rows of a matrix are before its columns, and states have the same axis as in the
        arguments.
        """
        if self.columns == 1:
            return made.swapaxes(0, 1) if states_first else made
        return made.swapaxes(0, 2) if states_first else made.swapaxes(0, 1)

    def states(self, given: View, dtype: str, n: int | None) -> tuple[int, bool]:
        """Returns the number of states of an array, and whether the states are along its first axis."""
        if given.dtype != dtype:
            raise ValueError(f"{self.name}: expected {dtype}, found {given.dtype}")
        for shape in dict.fromkeys(((self.size,), self.shape)):
            for states_first in (False, True):
                found = given.shape[1:] if states_first else given.shape[:-1]
                if len(given.shape) != len(shape) + 1 or found != shape:
                    continue
                many = given.shape[0 if states_first else -1]
                if n is not None and many != n:
                    continue
                steps = tuple(many * prod(shape[:k]) for k in range(len(shape)))
                wanted = (1, *steps) if states_first else (*steps, 1)
                pairs = zip(given.shape, wanted, given.strides, strict=True)
                if 0 in given.shape or all(a == b for size, a, b in pairs if size != 1):
                    return many, states_first
        states = "n" if n is None else str(n)
        matrix = f", or {(*self.shape, states)} column by column".replace("'", "") if self.columns > 1 else ""
        raise ValueError(
            f"{self.name}: expected ({self.size}, {states}) in row order, or its transpose{matrix}: number k of state "
            f"i at [k * n + i], found {given.shape} with strides {given.strides}; copy it into that order"
        )


class Kernel:
    """A function of a robot on a GPU. `inputs` and `outputs` are the names of the arguments and results, and the shapes
    for one state.

    The kernel may be called from several threads at a time.
    """

    def __init__(
        self, name: str, dtype: Literal["float64", "float32"], function: Function, inputs: list[Any], outputs: list[Any]
    ) -> None:
        self.name: str = name
        self.dtype: np.dtype[Any] = np.dtype(dtype)
        self._real: str = dtype
        self._inputs = [_Array(*about) for about in inputs]
        self._outputs = [_Array(*about) for about in outputs]
        self.inputs: dict[str, int] = {a.name: a.size for a in self._inputs}
        self.outputs: dict[str, tuple[int, ...]] = {a.name: a.shape for a in self._outputs}
        self._function = function
        self._most = _PLACES // max(a.size for a in (*self._inputs, *self._outputs))
        fields = [f"{output}_" if output == "lambda" else output for output in self.outputs]
        self._result: Any = namedtuple(name, fields) if len(outputs) > 1 else None

    @property
    def device(self) -> int:
        """The index of the device for which the kernel is compiled."""
        return self._function.device.ordinal

    @property
    def partitions(self) -> int:
        """The number of threads that can share a state. Each thread computes some of the results."""
        return self._function.partitions

    @property
    def registers(self) -> int:
        """The number of registers that a thread of the kernel uses."""
        return self._function.registers

    @property
    def local_bytes(self) -> int:
        """The local memory of a thread, in bytes, for values that do not fit into registers."""
        return self._function.local_bytes

    def __repr__(self) -> str:
        return f"{self.name}({', '.join(self.inputs)}) -> {', '.join(self.outputs)}"

    def __call__(self, *arguments: Any, out: Any = None, stream: Any = None) -> Any:
        """Computes the results for n states. Returns before the computation has ended; functions that use the results
        wait if necessary.

        arguments: arrays on the device, of any library that supports DLPack or `__cuda_array_interface__`. The result
            is an array, or a named tuple if there are several results. The shape of a result is (k, n) or, for
            matrices, (rows, columns, n). If the states are along the first axis of the first argument, the results also
            have the states along the first axis. New arrays are allocated, which takes time. In a loop, pass `out`
            instead: one array of the same shape, or a sequence of arrays for several results. The arrays of `out` are
            filled and returned. A matrix in `out` may also have the shape (rows × columns, n), column by column.

        stream: the stream for the work: a stream of PyTorch or CuPy, or its address. If the first argument is an array
            of PyTorch or CuPy, the default is the current stream of this library, else the legacy default stream. Read
            `out` on the same stream, or on a stream that waits for this stream.
        """
        if len(arguments) != len(self._inputs):
            raise TypeError(f"{self!r}: expected {len(self._inputs)} arguments, found {len(arguments)}")
        device = self._function.device
        number = stream_number(stream) if stream is not None else current_stream(arguments[0], device) or LEGACY
        n: int | None = None
        states_first, views = False, []
        for about, given in zip(self._inputs, arguments, strict=True):
            views.append(view(about.name, given, device, number))
            n, is_first = about.states(views[-1], self._real, n)
            states_first = is_first if len(views) == 1 else states_first
        if n is None or n > self._most:
            raise ValueError(f"{self.name}: expected at most {self._most} states, found {n}")
        if out is None:
            made: list[Any] = [new(device, self.dtype, about.in_memory(n)) for about in self._outputs]
            views += [view("out", x, device, number) for x in made]
        else:
            made = [out] if self._result is None else list(out)
            views += self._room(made, n, number, views)
        if n > 0:
            self._function.launch(number, n, [v.address for v in views])
            self._after(number, [*arguments, *made], views)
        if out is not None:
            return out
        take = importer(arguments[0]) or (lambda x: x)
        results = [about.turned(take(x), states_first) for about, x in zip(self._outputs, made, strict=True)]
        return results[0] if self._result is None else self._result(*results)

    def _room(self, out: list[Any], n: int, stream: int, inputs: list[View]) -> list[View]:
        """Checks the arrays for the results. These arrays must be writable, and must not share memory with each other
        or with arguments.
        """
        if len(out) != len(self._outputs):
            raise TypeError(f"{self!r}: out: expected {len(self._outputs)} arrays, found {len(out)}")
        size = self.dtype.itemsize * n
        taken = [(a.name, v.address, size * a.size) for a, v in zip(self._inputs, inputs, strict=True)]
        views = []
        for about, given in zip(self._outputs, out, strict=True):
            found = view(about.name, given, self._function.device, stream)
            about.states(found, self._real, n)
            if found.is_read_only or type(given).__module__.partition(".")[0] in ("jax", "jaxlib"):
                raise ValueError(f"{about.name}: out may not be written to")
            start, end = found.address, found.address + size * about.size
            for name, address, length in taken:
                if start < address + length and address < end:
                    raise ValueError(f"{about.name}: out shares memory with {name}")
            taken.append((about.name, start, size * about.size))
            views.append(found)
        return views

    def _after(self, stream: int, arrays: Sequence[Any], views: list[View]) -> None:
        """Records an event after which the results are ready. Keeps arrays of other libraries alive until this event,
        so that these libraries do not reuse the memory.
        """
        device = self._function.device
        event = Event(device, stream)
        for result in arrays[len(self._inputs) :]:
            if isinstance(result, DeviceArray):
                result._written[:] = [(stream, event)]
        lent = [
            v.owner
            for v, x in zip(views, arrays, strict=True)
            if not isinstance(x, DeviceArray) and current_stream(x, device) != stream
        ]
        device.hold(event, lent)


def _generated(
    model: Model, name: str, dtype: Literal["float64", "float32"], options: dict[str, Any]
) -> tuple[str, str, Any]:
    """Generates a kernel. Returns its symbol, its text, and its arguments and results."""
    if dtype not in _LANGUAGES:
        raise ValueError(f"dtype: expected 'float64' or 'float32', found {dtype!r}")
    code, files, described = _condyle._generate(model, [name], _LANGUAGES[dtype], **options)
    return f"{code}_{name}", files[0][1], described[0]


def ptx(
    model: Model,
    name: str,
    *,
    dtype: Literal["float64", "float32"] = "float64",
    capability: tuple[int, int] = (7, 5),
    frames: Sequence[str] = (),
    constraints: Sequence[ContactConstraint] = (),
    external_forces: bool = False,
    inputs: Sequence[str] = (),
    partitions: int | None = None,
) -> bytes:
    """Compiles a kernel to PTX, NVIDIA's intermediate language, for `compile` on a machine without NVIDIA's run-time
    compiler.

    capability: the compute capability of the oldest device to support. The other arguments are as for `compile`. No GPU
        is needed.

    Raises `RuntimeError` if the compiler is missing or fails.
    """
    options = _options(frames, constraints, external_forces, inputs, partitions)
    symbol, text, _ = _generated(model, name, dtype, options)
    return _cuda_driver.compiler().compile(symbol, text, f"compute_{capability[0]}{capability[1]}")


def _options(
    frames: Sequence[str],
    constraints: Sequence[ContactConstraint],
    external_forces: bool,
    inputs: Sequence[str],
    partitions: int | None,
) -> dict[str, Any]:
    return {
        "frames": list(frames),
        "constraints": list(constraints),
        "external_forces": external_forces,
        "inputs": list(inputs),
        "partitions": partitions,
    }


def compile(  # noqa: A001
    model: Model,
    name: str,
    *,
    dtype: Literal["float64", "float32"] = "float64",
    device: int = 0,
    frames: Sequence[str] = (),
    constraints: Sequence[ContactConstraint] = (),
    external_forces: bool = False,
    inputs: Sequence[str] = (),
    partitions: int | None = None,
    ptx: bytes | None = None,
    cache: "str | os.PathLike[str] | None" = None,
) -> Kernel:
    """Compiles a function of a robot to a kernel with NVIDIA's run-time compiler, or reads it from the cache.

    name: one of `condyle.codegen.functions`; frames, constraints, external_forces, inputs: as for
        `condyle.codegen.source`. dtype: the kind of numbers in the computation. partitions: the number of threads per
        state, each of which computes some of the results; at most one thread for each limb and one for the trunk. The
        default is one thread. The exception is a kernel for which one thread has too few registers. If several threads
        for each state then fit on the device at the same time, the default is the fastest number. ptx: the result of
        the function `ptx` for the same model, name, dtype and options; then the compiler is not needed. cache: a
        folder; by default the environment variable CONDYLE_CACHE, else `~/.cache/condyle`.

    Raises `RuntimeError` if the driver, a device or the compiler is missing, or if the compiler fails; `ValueError` if
    the device does not exist; and the exceptions of `condyle.codegen.source`.
    """
    options = _options(frames, constraints, external_forces, inputs, partitions)
    symbol, text, (_, given, made, _, rows) = _generated(model, name, dtype, options)
    on = _cuda_driver.device(device)
    image = ptx if ptx is not None else _image(symbol, text, on, cache)
    return Kernel(name, dtype, Function(on, symbol, image, rows, always=partitions is not None), given, made)


def _image(symbol: str, text: str, device: Device, cache: "str | os.PathLike[str] | None") -> bytes:
    """Compiles a text, or reads the result from the cache, where the key consists of the text, the compiler's version
    and the kind of device.
    """
    import hashlib
    import tempfile

    compiler = _cuda_driver.compiler()
    architecture = compiler.architecture(device.capability)
    key = hashlib.sha256(repr((text, compiler.version, architecture)).encode()).hexdigest()[:32]
    root = Path(cache or os.environ.get("CONDYLE_CACHE") or Path.home() / ".cache" / "condyle")
    kept = root / f"{key}.{'cubin' if architecture.startswith('sm_') else 'ptx'}"
    if kept.is_file():
        return kept.read_bytes()
    image = compiler.compile(symbol, text, architecture)
    root.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=root) as folder:
        (Path(folder) / "made").write_bytes(image)
        os.replace(Path(folder) / "made", kept)
    return image
