"""NVIDIA's driver and NVIDIA's run-time compiler for `condyle.cuda`. Both libraries are loaded on first use."""

import ctypes
import os
import sys
import threading
from collections import deque
from collections.abc import Sequence
from ctypes import POINTER, byref, c_char_p, c_int, c_size_t, c_uint, c_uint64, c_void_p
from pathlib import Path
from typing import Any

_HANDLE = c_void_p
_DRIVER: dict[str, list[Any]] = {
    "cuInit": [c_uint],
    "cuGetErrorName": [c_int, POINTER(c_char_p)],
    "cuGetErrorString": [c_int, POINTER(c_char_p)],
    "cuDeviceGetCount": [POINTER(c_int)],
    "cuDeviceGet": [POINTER(c_int), c_int],
    "cuDeviceGetName": [c_char_p, c_int, c_int],
    "cuDeviceGetAttribute": [POINTER(c_int), c_int, c_int],
    "cuDevicePrimaryCtxRetain": [POINTER(_HANDLE), c_int],
    "cuCtxPushCurrent_v2": [_HANDLE],
    "cuCtxPopCurrent_v2": [POINTER(_HANDLE)],
    "cuCtxSynchronize": [],
    "cuMemAlloc_v2": [POINTER(c_uint64), c_size_t],
    "cuMemFree_v2": [c_uint64],
    "cuMemcpyHtoDAsync_v2": [c_uint64, c_void_p, c_size_t, _HANDLE],
    "cuMemcpyDtoHAsync_v2": [c_void_p, c_uint64, c_size_t, _HANDLE],
    "cuPointerGetAttribute": [c_void_p, c_int, c_uint64],
    "cuStreamSynchronize": [_HANDLE],
    "cuStreamWaitEvent": [_HANDLE, _HANDLE, c_uint],
    "cuEventCreate": [POINTER(_HANDLE), c_uint],
    "cuEventRecord": [_HANDLE, _HANDLE],
    "cuEventQuery": [_HANDLE],
    "cuEventDestroy_v2": [_HANDLE],
    "cuModuleLoadDataEx": [POINTER(_HANDLE), c_char_p, c_uint, POINTER(c_int), POINTER(c_void_p)],
    "cuModuleUnload": [_HANDLE],
    "cuModuleGetFunction": [POINTER(_HANDLE), _HANDLE, c_char_p],
    "cuFuncGetAttribute": [POINTER(c_int), c_int, _HANDLE],
    "cuOccupancyMaxPotentialBlockSize": [POINTER(c_int), POINTER(c_int), _HANDLE, c_void_p, c_size_t, c_int],
    "cuLaunchKernel": [_HANDLE, *[c_uint] * 7, _HANDLE, POINTER(c_void_p), POINTER(c_void_p)],
}
_COMPILER: dict[str, list[Any]] = {
    "nvrtcVersion": [POINTER(c_int), POINTER(c_int)],
    "nvrtcGetNumSupportedArchs": [POINTER(c_int)],
    "nvrtcGetSupportedArchs": [POINTER(c_int)],
    "nvrtcCreateProgram": [POINTER(_HANDLE), c_char_p, c_char_p, c_int, c_void_p, c_void_p],
    "nvrtcCompileProgram": [_HANDLE, c_int, POINTER(c_char_p)],
    "nvrtcGetProgramLogSize": [_HANDLE, POINTER(c_size_t)],
    "nvrtcGetProgramLog": [_HANDLE, c_char_p],
    "nvrtcGetCUBINSize": [_HANDLE, POINTER(c_size_t)],
    "nvrtcGetCUBIN": [_HANDLE, c_char_p],
    "nvrtcGetPTXSize": [_HANDLE, POINTER(c_size_t)],
    "nvrtcGetPTX": [_HANDLE, c_char_p],
    "nvrtcDestroyProgram": [POINTER(_HANDLE)],
}

# Attributes, flags, options and statuses, with their values in CUDA's headers.
_MULTIPROCESSORS, _CAPABILITY = 16, (75, 76)
_LOCAL_BYTES, _REGISTERS = 3, 4
_POINTER_DEVICE = 9
_DISABLE_TIMING = 2
_ERROR_LOG, _ERROR_LOG_BYTES = 5, 6
_NOT_READY = 600
_LOG = 16384


def _load(what: str, variable: str, files: Sequence[str], functions: dict[str, list[Any]]) -> ctypes.CDLL:
    """Loads a library and sets the types of its functions. If no file can be loaded, the error lists the files that
    were tried.
    """
    given = os.environ.get(variable)
    reasons = []
    for file in [given] if given else files:
        try:
            library = ctypes.CDLL(file)
            for name, types in functions.items():
                function = getattr(library, name)
                function.argtypes, function.restype = types, c_int
        except (OSError, AttributeError) as error:
            reasons.append(str(error))
        else:
            return library
    raise RuntimeError(
        f"{what}: cannot be loaded: {'; '.join(reasons)}; the environment variable {variable} may name its file"
    )


class Driver:
    """The library of NVIDIA's driver."""

    def __init__(self) -> None:
        files = ["nvcuda.dll"] if sys.platform == "win32" else ["libcuda.so.1", "libcuda.so"]
        self._library = _load("CUDA's driver", "CONDYLE_CUDA_LIBRARY", files, _DRIVER)
        self.call("cuInit", 0)

    def status(self, function: str, *arguments: Any) -> int:
        """Calls a function of the driver and returns its status."""
        return int(getattr(self._library, function)(*arguments))

    def call(self, function: str, *arguments: Any) -> None:
        """Calls a function of the driver. If the call fails, raises an error with the function's name and CUDA's
        message.
        """
        status = self.status(function, *arguments)
        if status != 0:
            raise RuntimeError(f"{function}: {self.text(status)} (status {status})")

    def text(self, status: int) -> str:
        """Converts a status to text: the name of the status and CUDA's message."""
        said = []
        for function in ("cuGetErrorName", "cuGetErrorString"):
            text = c_char_p()
            found = self.status(function, status, byref(text)) == 0 and text.value is not None
            said.append((text.value or b"").decode() if found else "unknown")
        return ", ".join(said)


_MADE: dict[object, Any] = {}
"""Loaded objects: "driver", "compiler", and devices by index."""


def driver() -> Driver:
    """Returns the driver, loaded on first use."""
    if "driver" not in _MADE:
        _MADE["driver"] = Driver()
    made: Driver = _MADE["driver"]
    return made


def names() -> list[str]:
    """Returns the names of all CUDA devices."""
    count, device, name = c_int(), c_int(), ctypes.create_string_buffer(256)
    driver().call("cuDeviceGetCount", byref(count))
    found = []
    for ordinal in range(count.value):
        driver().call("cuDeviceGet", byref(device), ordinal)
        driver().call("cuDeviceGetName", name, 255, device)
        found.append(name.value.decode())
    return found


class Current:
    """A `with` block during which a context is the current context of the thread."""

    def __init__(self, driver: Driver, context: c_void_p) -> None:
        self._driver, self._context = driver, context

    def __enter__(self) -> Driver:
        self._driver.call("cuCtxPushCurrent_v2", self._context)
        return self._driver

    def __exit__(self, *_: object) -> None:
        self._driver.call("cuCtxPopCurrent_v2", None)


class Device:
    """A device with its primary context, which other libraries of the process also use. The context is held until the
    process ends.
    """

    def __init__(self, ordinal: int) -> None:
        self.driver = driver()
        self.ordinal = ordinal
        device, self._context = c_int(), c_void_p()
        count = len(names())
        if not 0 <= ordinal < count:
            raise ValueError(f"device: expected a number from 0 to {count - 1}, found {ordinal}")
        self.driver.call("cuDeviceGet", byref(device), ordinal)
        self.driver.call("cuDevicePrimaryCtxRetain", byref(self._context), device)
        self.multiprocessors = max(1, self._attribute(device, _MULTIPROCESSORS))
        major, minor = (self._attribute(device, attribute) for attribute in _CAPABILITY)
        self.capability = (major, minor)
        self._held: deque[tuple[Event, list[Any]]] = deque()
        self._lock = threading.Lock()

    def _attribute(self, device: c_int, attribute: int) -> int:
        value = c_int()
        self.driver.call("cuDeviceGetAttribute", byref(value), attribute, device)
        return value.value

    def current(self) -> "Current":
        """Returns a `with` block during which this device's context is the current context of the thread."""
        return Current(self.driver, self._context)

    def owns(self, address: int) -> bool:
        """Returns whether an address is in the device's memory."""
        found = c_int()
        with self.current() as driver:
            status = driver.status("cuPointerGetAttribute", byref(found), _POINTER_DEVICE, address)
        return status == 0 and found.value == self.ordinal

    def hold(self, until: "Event", things: list[Any]) -> None:
        """Keeps objects alive until an event has happened, and drops the oldest objects if their event has happened."""
        dropped = []
        with self._lock:
            while self._held and self._held[0][0].has_happened():
                dropped.append(self._held.popleft())
            if things:
                self._held.append((until, things))
        dropped.clear()  # objects are dropped after the lock is released, since destructors may run any code


def device(ordinal: int) -> Device:
    """Returns the device with this index."""
    if ordinal not in _MADE:
        _MADE[ordinal] = Device(ordinal)
    made: Device = _MADE[ordinal]
    return made


class Memory:
    """Memory of a device. The memory is freed with this object, after all streams have finished their work on the
    memory.
    """

    def __init__(self, device: Device, size: int) -> None:
        self.device = device
        address = c_uint64(0)
        if size > 0:
            with device.current() as driver:
                driver.call("cuMemAlloc_v2", byref(address), size)
        self.address = address.value

    def __del__(self) -> None:
        if getattr(self, "address", 0):
            with self.device.current() as driver:
                driver.status("cuMemFree_v2", self.address)


class Event:
    """An event in a CUDA stream. The event happens when the stream has done all work that was in the stream before the
    event.
    """

    def __init__(self, device: Device, stream: int) -> None:
        self.device = device
        self._handle = c_void_p()
        with device.current() as driver:
            driver.call("cuEventCreate", byref(self._handle), _DISABLE_TIMING)
            driver.call("cuEventRecord", self._handle, stream)

    def has_happened(self) -> bool:
        """Returns whether the event has happened; if a kernel failed, the event counts as happened."""
        with self.device.current() as driver:
            return driver.status("cuEventQuery", self._handle) != _NOT_READY

    def before(self, stream: int) -> None:
        """Makes all later work in a stream wait for this event."""
        with self.device.current() as driver:
            driver.call("cuStreamWaitEvent", stream, self._handle, 0)

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            with self.device.current() as driver:
                driver.status("cuEventDestroy_v2", self._handle)


class Function:
    """A loaded kernel; the module of the kernel is unloaded with this object."""

    def __init__(self, device: Device, symbol: str, image: bytes, partitions: int, *, always: bool) -> None:
        self.device, self.partitions = device, partitions
        self._module, self._handle = c_void_p(), c_void_p()
        log = ctypes.create_string_buffer(_LOG)
        options = (c_int * 2)(_ERROR_LOG, _ERROR_LOG_BYTES)
        values = (c_void_p * 2)(ctypes.addressof(log), _LOG)
        with device.current() as driver:
            status = driver.status("cuModuleLoadDataEx", byref(self._module), image, 2, options, values)
            if status != 0:
                raise RuntimeError(f"{symbol}: not loaded: {driver.text(status)}: {log.value.decode(errors='replace')}")
            driver.call("cuModuleGetFunction", byref(self._handle), self._module, symbol.encode())
            blocks, threads = c_int(), c_int()
            driver.call("cuOccupancyMaxPotentialBlockSize", byref(blocks), byref(threads), self._handle, None, 0, 0)
            self.threads = max(32, threads.value)
            at_a_time = blocks.value * self.threads
            self._most_partitioned = sys.maxsize if always else at_a_time // partitions
            self.registers, self.local_bytes = (self._attribute(a) for a in (_REGISTERS, _LOCAL_BYTES))

    def _attribute(self, attribute: int) -> int:
        value = c_int()
        self.device.driver.call("cuFuncGetAttribute", byref(value), attribute, self._handle)
        return value.value

    def launch(self, stream: int, n: int, addresses: Sequence[int]) -> None:
        """Launches the kernel. If one thread for each partition of each state fits on the device at the same time,
        launches these threads. Otherwise launches one thread per state.

        For few states, blocks are smaller than the size that is optimal for many states, so that all multiprocessors
        have work.
        """
        rows = self.partitions if n <= self._most_partitioned else 1
        portion = -(-rows * n // self.device.multiprocessors)
        threads = min(self.threads, -(-portion // 32) * 32)
        states, values = c_int(n), (c_uint64 * len(addresses))(*addresses)
        first, size = ctypes.addressof(values), ctypes.sizeof(c_uint64)
        each = [ctypes.addressof(states), *(first + k * size for k in range(len(addresses)))]
        parameters = (c_void_p * len(each))(*each)
        with self.device.current() as driver:
            driver.call(
                "cuLaunchKernel", self._handle, -(-n // threads), rows, 1, threads, 1, 1, 0, stream, parameters, None
            )

    def __del__(self) -> None:
        if getattr(self, "_module", None):
            with self.device.current() as driver:
                driver.status("cuCtxSynchronize")  # wait for the device, since the kernel may be running
                driver.status("cuModuleUnload", self._module)


def _compilers() -> list[str]:
    """Returns the paths where NVIDIA's run-time compiler may be, in the wheels of this Python and in the system."""
    import importlib.util

    files = []
    patterns = ["cuda_nvrtc/lib/libnvrtc.so.*", "cu1*/lib/libnvrtc.so.*", "cuda_nvrtc/bin/nvrtc64_*0.dll"]
    wheels = importlib.util.find_spec("nvidia")
    for folder in (wheels.submodule_search_locations or []) if wheels else []:
        files += [str(path) for pattern in patterns for path in sorted(Path(folder).glob(pattern), reverse=True)]
    if sys.platform == "win32":
        return [*files, "nvrtc64_130_0.dll", "nvrtc64_120_0.dll"]
    names = ["libnvrtc.so", "libnvrtc.so.13", "libnvrtc.so.12", "/usr/local/cuda/lib64/libnvrtc.so"]
    return [*files, *names]


class Compiler:
    """NVIDIA's run-time compiler (NVRTC), which needs neither a GPU nor a driver."""

    def __init__(self) -> None:
        self._library = _load("NVIDIA's run-time compiler", "CONDYLE_NVRTC_LIBRARY", _compilers(), _COMPILER)
        major, minor, count = c_int(), c_int(), c_int()
        self._library.nvrtcVersion(byref(major), byref(minor))
        self.version = (major.value, minor.value)
        self._library.nvrtcGetNumSupportedArchs(byref(count))
        known = (c_int * count.value)()
        self._library.nvrtcGetSupportedArchs(known)
        self._known = list(known)

    def architecture(self, capability: tuple[int, int]) -> str:
        """Returns the architecture for which to compile: this capability, or the newest lower capability that the
        compiler knows.
        """
        wanted = 10 * capability[0] + capability[1]
        best = max((known for known in self._known if known <= wanted), default=wanted)
        return f"sm_{wanted}" if best == wanted else f"compute_{best}"

    def compile(self, name: str, text: str, architecture: str) -> bytes:
        """Compiles the text of a kernel. For an architecture such as "sm_90" the result is machine code; for an
        architecture such as "compute_90" the result is PTX, which also works on newer devices.
        """
        program = c_void_p()
        library = self._library
        if library.nvrtcCreateProgram(byref(program), text.encode(), f"{name}.cu".encode(), 0, None, None) != 0:
            raise RuntimeError(f"{name}: nvrtcCreateProgram failed")
        try:
            options = (c_char_p * 1)(f"--gpu-architecture={architecture}".encode())
            status = library.nvrtcCompileProgram(program, 1, options)
            if status != 0:
                log = self._bytes(program, "ProgramLog").rstrip(b"\0").decode(errors="replace")
                raise RuntimeError(f"{name}: not compiled for {architecture}: status {status}: {log.strip()}")
            return self._bytes(program, "CUBIN" if architecture.startswith("sm_") else "PTX")
        finally:
            library.nvrtcDestroyProgram(byref(program))

    def _bytes(self, program: c_void_p, what: str) -> bytes:
        size = c_size_t()
        getattr(self._library, f"nvrtcGet{what}Size")(program, byref(size))
        buffer = ctypes.create_string_buffer(size.value)
        getattr(self._library, f"nvrtcGet{what}")(program, buffer)
        return buffer.raw


def compiler() -> Compiler:
    """Returns the compiler, loaded on first use."""
    if "compiler" not in _MADE:
        _MADE["compiler"] = Compiler()
    made: Compiler = _MADE["compiler"]
    return made
