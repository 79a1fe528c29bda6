#!/usr/bin/env python3
"""Compiles generated CUDA for robots of several sizes, without a GPU, and prints what each kernel uses.

    python tests/cuda.py [--install]

It needs the installed package `condyle`, and NVIDIA's wheels with the run-time compiler and the assembler; --install
puts them where this Python finds them. Without them it says NOT RUN. It fails if a kernel does not compile, or if an
expected one is not in the result.
"""

import argparse
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import condyle
import condyle.cuda

WHEELS = ["nvidia-cuda-nvrtc-cu12==12.9.86", "nvidia-cuda-nvcc-cu12==12.9.86"]
CAPABILITY = (9, 0)
"""Hopper."""
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


def resources(ptxas: Path, made: bytes) -> str:
    """What the assembler says that kernels use."""
    with TemporaryDirectory() as folder:
        source = Path(folder) / "kernel.ptx"
        source.write_bytes(made.rstrip(b"\0"))
        call = [
            ptxas,
            "--verbose",
            f"--gpu-name=sm_{CAPABILITY[0]}{CAPABILITY[1]}",
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
    ptxas = wheel("cuda_nvcc/bin/ptxas")
    if ptxas is None or wheel("cuda_nvrtc/lib/libnvrtc.so.*") is None:
        print(f"NOT RUN: NVIDIA's compilers are not installed (pip install {' '.join(WHEELS)})")
        return
    print("robot, kernel, type: registers, bytes of stack, of spills (stores, loads)")
    for robot, names in FUNCTIONS.items():
        model = getattr(condyle.robots, robot)()
        frames = FRAMES[robot]
        contacts = [condyle.ContactConstraint(frame, "point") for frame in frames]
        for dtype, real in (("float64", "f64"), ("float32", "f32")):
            for name in names:
                options = {"capability": CAPABILITY, "frames": frames, "constraints": contacts}
                said = resources(ptxas, condyle.cuda.ptx(model, name, dtype=dtype, **options))
                kernel = f"{robot}_{name}"
                registers = {entry: int(count) for entry, count in REGISTERS.findall(said)}
                used = {entry: numbers for entry, *numbers in USAGE.findall(said)}
                if kernel not in registers or kernel not in used:
                    sys.exit(f"{kernel}: it is not in what was compiled:\n{said}")
                stack, stores, loads = used[kernel]
                print(f"{robot}, {name}, {real}: {registers[kernel]}, {stack}, {stores} {loads}")


if __name__ == "__main__":
    main()
