#!/usr/bin/env python3
"""Counts the instructions of the algorithms at SIMD level AVX2. Fails if a count has grown by more than 3 %.

    python3 benches/instructions.py [--write | --misses]

The program runs benches/instructions.rs under callgrind (of valgrind), and compares the counts with
benches/instructions.json, which --write replaces. Counts depend on the compiler. If the file was written with another
compiler, the program prints the counts without a comparison. The option --misses prints how often an instruction was
not in the first cache, instead of the numbers of instructions: callgrind simulates a cache of 32 KB. A miss reads 64
bytes of code, and takes some ten cycles.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
BASELINE = Path(__file__).with_suffix(".json")
ROBOTS = ("cart_pole", "quadrotor", "arm7", "quadruped", "humanoid")
STATES, KNOTS, ITERATIONS = 16, 32, 5
"""Numbers of states, knots and iterations, equal to the numbers in instructions.rs."""
PHASES = {
    "SolverLoop::calc_diff": "fddp_derivatives",
    "SolverLoop::sweep": "fddp_sweep",
    "LineSearch::run": "fddp_rollout",
}
"""Names of the parts of an FDDP iteration, for each function of the solver."""
GROWTH = 1.03
MISSES = ("--cache-sim=yes", "--I1=32768,8,64", "--D1=49152,12,64")
"""Options of callgrind that simulate the first caches of a processor."""
LINE = re.compile(r"^\s*([\d,]+) .*\b(?:instructions::measured::(\w+)|((?:SolverLoop|LineSearch)::\w+))")


def run(*command: str | Path, **options: object) -> str:
    return subprocess.run([str(c) for c in command], check=True, stdout=subprocess.PIPE, text=True, **options).stdout


def build(bench: str = "instructions", profile: str = "release") -> Path:
    command = ["cargo", "build", "--profile", profile, "--package", "condyle-benches", "--bench", bench]
    command += ["--message-format=json", "--locked"]
    for line in run(*command, cwd=ROOT).splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == bench and message.get("executable"):
            return Path(message["executable"])
    raise SystemExit("cargo built no program")


def counts(program: Path, robot: str, are_misses: bool = False) -> dict[str, int]:
    """Counts the instructions of each algorithm for one state, and of each part of an FDDP iteration for one knot.
    Counts the misses of instructions instead if `are_misses` is set."""
    options, event = (MISSES, "I1mr") if are_misses else ((), "Ir")
    with TemporaryDirectory() as folder:
        profile = Path(folder) / "profile"
        command = ("valgrind", "--quiet", "--tool=callgrind", f"--callgrind-out-file={profile}", *options)
        run(*command, program, robot, env={**os.environ, "CONDYLE_LEVEL": "avx2"})
        shown = (f"--show={event}", f"--sort={event}")
        table = run("callgrind_annotate", "--inclusive=yes", "--threshold=100", "--auto=no", *shown, profile)
    found: dict[str, int] = {}
    for match in filter(None, map(LINE.match, table.splitlines())):  # a function has one line per source file
        name, n = match[2] or match[3], int(match[1].replace(",", ""))
        if match[3] and name not in PHASES:
            continue
        n //= KNOTS * ITERATIONS if name in PHASES else STATES
        name = PHASES.get(name, name)
        found[name] = max(n, found.get(name, 0))
    if not found:
        raise SystemExit("callgrind names no function of instructions::measured")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--write", action="store_true", help=f"write {BASELINE.name}")
    parser.add_argument("--misses", action="store_true", help="print misses of the first instruction cache")
    options = parser.parse_args()
    if shutil.which("valgrind") is None:
        print("NOT RUN: there is no valgrind to count instructions with")
        return
    if "avx2" not in Path("/proc/cpuinfo").read_text(encoding="utf-8"):
        print("NOT RUN: this processor has no AVX2")
        return
    program, compiler = build(), run("rustc", "--version").strip()
    if options.misses:
        for robot in ROBOTS:
            for name, n in counts(program, robot, are_misses=True).items():
                print(f"{robot:10} {name:24} {n:9}")
        return
    found = {robot: counts(program, robot) for robot in ROBOTS}
    if options.write:
        BASELINE.write_text(
            json.dumps({"compiler": compiler, "instructions": found}, indent=1) + "\n", encoding="utf-8"
        )
    baseline = json.loads(BASELINE.read_text(encoding="utf-8"))
    comparable, grown = baseline["compiler"] == compiler, []
    for robot, algorithms in found.items():
        for name, n in algorithms.items():
            before = baseline["instructions"].get(robot, {}).get(name)
            print(f"{robot:10} {name:24} {n:9}" + (f"  {n / before - 1:+.1%}" if before and comparable else ""))
            if comparable and before and n > GROWTH * before:
                grown.append(f"{robot} {name}: {before} -> {n}")
    if not comparable:
        print(f"NOT COMPARED: the baseline is from {baseline['compiler']}, this is {compiler}")
    if grown:
        sys.exit("more instructions than 3 % above the baseline:\n" + "\n".join(grown))


if __name__ == "__main__":
    main()
