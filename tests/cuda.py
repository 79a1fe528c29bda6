#!/usr/bin/env python3
"""Compiles generated CUDA for robots of several sizes, without a GPU, and prints the resources that each kernel uses.

    python tests/cuda.py [--install] [--partitions [ROBOT ...]]

The program needs the installed package `condyle`, and NVIDIA's wheels with the run-time compiler and the assembler. The
option --install installs these wheels into the Python that runs the program. Without the wheels the program prints NOT
RUN. It fails if a kernel does not compile, or if an expected kernel is missing.

With --partitions the program prints the table of docs/generated.md instead, for robots of example-robot-data. For
kernels whose work is divided among several threads, the table lists the instructions per state. It also lists the bytes
that a thread moves between registers and its local memory. The program counts both in the output of NVIDIA's
disassembler. The machine code has branches only for large angles and for quotients of tiny numbers; the instructions of
these branches are counted once.
"""

import argparse
import importlib.util
import re
import subprocess
import sys
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory

import condyle
import condyle.cuda

WHEELS = ["nvidia-cuda-nvrtc-cu12==12.9.86", "nvidia-cuda-nvcc-cu12==12.9.86", "nvidia-cuda-nvdisasm==13.5.37"]
CAPABILITY = (9, 0)
"""Compute capability of the Hopper architecture."""
FUNCTIONS = {
    "arm7": ["rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives", "frames", "centroidal"],
    "quadruped": ["rnea", "aba", "rnea_derivatives", "aba_derivatives", "constrained_dynamics"],
    "humanoid": ["rnea", "aba", "aba_derivatives"],
}
FRAMES = {"arm7": ["tool"], "quadruped": ["LF_foot", "RH_foot"], "humanoid": ["left_sole"]}
SPLIT = ["rnea", "aba", "minv", "rnea_derivatives", "aba_derivatives"]
SPILLS = re.compile(r"(\d+) bytes spill stores, (\d+) bytes spill loads")
USED = re.compile(
    r"Compiling entry function '(\w+)'.*?Used (\d+) registers(?:[^\n]*?(\d+) bytes cumulative stack)?", re.DOTALL
)
LABEL = re.compile(r"^(?:\.text\.)?\$?([\w$]+):", re.MULTILINE)
INSTRUCTION = re.compile(r"^\s+/\*[0-9a-f]{4,}\*/\s+(?:@!?\w+\s+)?([A-Z][A-Z0-9_.]*)")
"""Pattern of a line of machine code: the address, the condition (optional), and the operation."""


def wheel(pattern: str) -> Path | None:
    """Returns the path of a file in NVIDIA's wheels; None if no wheel contains the file."""
    found = importlib.util.find_spec("nvidia")
    for folder in (found.submodule_search_locations or []) if found else []:
        for path in sorted(Path(folder).glob(pattern)):
            return path
    return None


def assembled(ptxas: Path, made: bytes) -> tuple[str, bytes]:
    """Returns the assembler's report on the resources of kernels, and the machine code."""
    with TemporaryDirectory() as folder:
        source, cubin = Path(folder) / "kernel.ptx", Path(folder) / "kernel.cubin"
        source.write_bytes(made.rstrip(b"\0"))
        architecture = f"--gpu-name=sm_{CAPABILITY[0]}{CAPABILITY[1]}"
        call = [ptxas, "--verbose", architecture, source, "--output-file", cubin]
        run = subprocess.run(call, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            sys.exit(f"ptxas: {run.stderr}")
        return run.stdout + run.stderr, cubin.read_bytes()


def used(said: str, kernel: str) -> tuple[int, int, int]:
    """Returns, for a thread of a kernel, the number of registers and the bytes of the thread's stack. Also returns the
    bytes that the thread moves between registers and memory because it has too few registers."""
    found = {entry: (int(registers), int(stack or 0)) for entry, registers, stack in USED.findall(said)}
    if kernel not in found:
        sys.exit(f"{kernel}: it is not in what was compiled:\n{said}")
    return *found[kernel], sum(int(x) for each in SPILLS.findall(said) for x in each)


def counted(nvdisasm: Path, cubin: bytes) -> tuple[list[int], list[int]]:
    """Returns, for each partition of a kernel, the number of instructions, and the bytes that the partition moves
    between registers and the thread's local memory."""
    with NamedTemporaryFile(suffix=".cubin") as file:
        file.write(cubin)
        file.flush()
        call = [nvdisasm, "--print-code", file.name]
        text = subprocess.run(call, capture_output=True, text=True, check=True).stdout
    counts: dict[str, list[int]] = {}
    partition = ""
    for line in text.splitlines():
        if (label := LABEL.match(line)) is not None:
            partition = (re.findall(r"_partition(\d+)", label[1]) or [""])[-1]
        if (found := INSTRUCTION.match(line)) is not None:
            operation = found[1]
            width = 16 if ".128" in operation else 8 if ".64" in operation else 4
            sums = counts.setdefault(partition, [0, 0])
            sums[0] += 1
            sums[1] += width if operation.startswith(("LDL", "STL")) else 0
    if len(counts) > 1:
        counts.pop("", None)  # the kernel code that calls the partitions is not counted
    instructions, moved = zip(*counts.values(), strict=True)
    return list(instructions), list(moved)


def table(robots: list[str], ptxas: Path, nvdisasm: Path) -> None:
    """Prints the resources of kernels for each number of partitions. The default number is in brackets."""
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    print("| robot, function, type | partitions | registers | stack | instructions | bytes moved |")
    print("| --- | --- | --- | --- | --- | --- |")
    for robot in robots:
        loader = ROBOTS[robot]
        file = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
        root = "free_flyer" if loader.free_flyer else None
        model = condyle.Model.from_urdf(Path(getModelPath(file)) / file, root_joint=root)
        for name in SPLIT:
            for dtype, language in (("float32", "cuda-float"), ("float64", "cuda")):
                code, _, [(*_, best)] = condyle._condyle._generate(model, [name], language)
                for partitions in sorted({1, 2, best}):
                    made = condyle.cuda.ptx(model, name, dtype=dtype, capability=CAPABILITY, partitions=partitions)
                    said, cubin = assembled(ptxas, made)
                    registers, stack, _ = used(said, f"{code}_{name}")
                    each = [f"{max(x)}" if len(x) == 1 else f"{max(x)} of {sum(x)}" for x in counted(nvdisasm, cubin)]
                    number = f"**{partitions}**" if partitions == best else f"{partitions}"
                    print(
                        f"| {robot}, {name}, {dtype} | {number} | {registers} | {stack} | {each[0]} | {each[1]} |",
                        flush=True,
                    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--install", action="store_true", help="install NVIDIA's wheels first")
    parser.add_argument("--partitions", nargs="*", metavar="ROBOT", help="print the table of partitions")
    options = parser.parse_args()
    if options.install:
        call = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *WHEELS]
        if subprocess.run(call, check=False).returncode != 0:
            print("NOT RUN: NVIDIA's compilers cannot be installed here")
            return
    ptxas, nvdisasm = wheel("cuda_nvcc/bin/ptxas"), wheel("cu1*/bin/nvdisasm")
    if ptxas is None or nvdisasm is None or wheel("cuda_nvrtc/lib/libnvrtc.so.*") is None:
        print(f"NOT RUN: NVIDIA's compilers are not installed (pip install {' '.join(WHEELS)})")
        return
    if options.partitions is not None:
        table(options.partitions or ["panda", "anymal", "talos"], ptxas, nvdisasm)
        return
    print("robot, kernel, type: registers, bytes of stack, of spills")
    for robot, names in FUNCTIONS.items():
        model = getattr(condyle.robots, robot)()
        frames = FRAMES[robot]
        contacts = [condyle.ContactConstraint(frame, "point") for frame in frames]
        for dtype, real, suffix in (("float64", "f64", ""), ("float32", "f32", "_float")):
            for name in names:
                given = {"capability": CAPABILITY, "frames": frames, "constraints": contacts}
                said, _ = assembled(ptxas, condyle.cuda.ptx(model, name, dtype=dtype, **given))
                registers, stack, spills = used(said, f"{robot}{suffix}_{name}")
                print(f"{robot}, {name}, {real}: {registers}, {stack}, {spills}")


if __name__ == "__main__":
    main()
