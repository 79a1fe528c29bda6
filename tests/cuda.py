#!/usr/bin/env python3
"""Compiles generated CUDA for robots of several sizes, without a GPU, and prints what each kernel uses.

    python tests/cuda.py [--install]

It needs the installed package `condyle`, and NVIDIA's wheels with the run-time compiler and the assembler; --install
puts them where this Python finds them. Without them it says NOT RUN. It fails if a kernel does not compile, or if an
expected one is not in the result.
"""

import argparse
import ctypes
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import condyle
import condyle.codegen

WHEELS = ["nvidia-cuda-nvrtc-cu12==12.9.86", "nvidia-cuda-nvcc-cu12==12.9.86"]
ARCHITECTURE = "90"
"""Hopper, by its compute capability."""
FUNCTIONS = {
    "arm7": ["rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives", "frames", "centroidal"],
    "quadruped": ["rnea", "aba", "rnea_derivatives", "aba_derivatives", "constrained_dynamics"],
    "humanoid": ["rnea", "aba", "aba_derivatives"],
}
FRAMES = {"arm7": ["tool"], "quadruped": ["LF_foot", "RH_foot"], "humanoid": ["left_sole"]}
USAGE = re.compile(
    r"Function properties for (\w+)\s+(\d+) bytes stack frame, (\d+) bytes spill stores, (\d+) bytes spill loads"
)
REGISTERS = re.compile(r"Compiling entry function '(\w+)'.*?Used (\d+) registers", re.DOTALL)


def wheel(pattern: str) -> Path | None:
    """A file of NVIDIA's wheels."""
    found = importlib.util.find_spec("nvidia")
    for folder in (found.submodule_search_locations or []) if found else []:
        for path in sorted(Path(folder).glob(pattern)):
            return path
    return None


def ptx(nvrtc: ctypes.CDLL, text: str, name: str) -> bytes:
    """The text in NVIDIA's intermediate language."""
    program = ctypes.c_void_p()
    check(nvrtc, nvrtc.nvrtcCreateProgram(ctypes.byref(program), text.encode(), name.encode(), 0, None, None))
    options = [f"--gpu-architecture=compute_{ARCHITECTURE}".encode()]
    status = nvrtc.nvrtcCompileProgram(program, len(options), (ctypes.c_char_p * len(options))(*options))
    if status != 0:
        size = ctypes.c_size_t()
        nvrtc.nvrtcGetProgramLogSize(program, ctypes.byref(size))
        log = ctypes.create_string_buffer(size.value)
        nvrtc.nvrtcGetProgramLog(program, log)
        sys.exit(f"{name}: {log.value.decode()}")
    size = ctypes.c_size_t()
    check(nvrtc, nvrtc.nvrtcGetPTXSize(program, ctypes.byref(size)))
    made = ctypes.create_string_buffer(size.value)
    check(nvrtc, nvrtc.nvrtcGetPTX(program, made))
    nvrtc.nvrtcDestroyProgram(ctypes.byref(program))
    return made.value


def check(nvrtc: ctypes.CDLL, status: int) -> None:
    if status != 0:
        nvrtc.nvrtcGetErrorString.restype = ctypes.c_char_p
        sys.exit(f"nvrtc: {nvrtc.nvrtcGetErrorString(status).decode()}")


def resources(ptxas: Path, made: bytes) -> str:
    """What the assembler says that kernels use."""
    with TemporaryDirectory() as folder:
        source = Path(folder) / "kernel.ptx"
        source.write_bytes(made)
        call = [
            ptxas,
            "--verbose",
            f"--gpu-name=sm_{ARCHITECTURE}",
            source,
            "--output-file",
            Path(folder) / "kernel.cubin",
        ]
        run = subprocess.run(call, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"ptxas: {run.stderr}")
    return run.stdout + run.stderr


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--install", action="store_true", help="install NVIDIA's wheels first")
    if parser.parse_args().install:
        call = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *WHEELS]
        if subprocess.run(call, check=False).returncode != 0:
            print("NOT RUN: NVIDIA's compilers cannot be installed here")
            return
    library, ptxas = wheel("cuda_nvrtc/lib/libnvrtc.so.*"), wheel("cuda_nvcc/bin/ptxas")
    if library is None or ptxas is None:
        print(f"NOT RUN: NVIDIA's compilers are not installed (pip install {' '.join(WHEELS)})")
        return
    nvrtc = ctypes.CDLL(str(library))
    print("robot, kernel, type: registers, bytes of stack, of spills (stores, loads)")
    for robot, names in FUNCTIONS.items():
        model = getattr(condyle.robots, robot)()
        frames = FRAMES[robot]
        contacts = [condyle.ContactConstraint(frame, "point") for frame in frames]
        for language, real in (("cuda", "f64"), ("cuda-float", "f32")):
            for name in names:
                files = condyle.codegen.source(model, name, language, frames=frames, constraints=contacts)
                [(file, text)] = files.items()
                said = resources(ptxas, ptx(nvrtc, text, file))
                kernel = f"{robot}_{name}"
                registers = {entry: int(count) for entry, count in REGISTERS.findall(said)}
                used = {entry: numbers for entry, *numbers in USAGE.findall(said)}
                if kernel not in registers or kernel not in used:
                    sys.exit(f"{kernel}: it is not in what was compiled:\n{said}")
                stack, stores, loads = used[kernel]
                print(f"{robot}, {name}, {real}: {registers[kernel]}, {stack}, {stores} {loads}")


if __name__ == "__main__":
    main()
