#!/usr/bin/env python3
"""Sorts the instructions of the algorithms by purpose, at SIMD level AVX2: arithmetic, moves of vectors, or integers.

    python3 benches/mix.py [--lines] [ROBOT ...] [--of NAME ...]

The program runs the benchmark of instructions.py under callgrind (of valgrind), once for each algorithm. It sorts the
executed instructions by their names, which objdump prints, into these groups:

- arithmetic: sums, products, quotients and roots;
- load, store: moves of vectors from or to memory; stack: moves from or to the stack, if there are too few registers;
- move: shuffles, masks, copies between registers;
- integer: indices, bounds, branches, calls;
- C library: sines, cosines, and copies, if they are function calls.

--lines also shows the lines of source code with the most instructions. For this, the program is built again, with line
tables.
"""

import argparse
import collections
import os
import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from instructions import ITERATIONS, KNOTS, PHASES, ROBOTS, STATES, build, run

KINDS = ["arithmetic", "load, store", "stack", "move", "integer", "C library"]
ALGORITHMS = [
    *("rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives", "batch_aba", "batch_aba_derivatives"),
    *PHASES.values(),
]
CODE = re.compile(r"^\s*([0-9a-f]+):\s+(\S+)\s*(.*)$", re.M)
OBJECT = re.compile(r"^(c?)ob=(\(\d+\))(?: (.+))?$")
COST = re.compile(r"^0x([0-9a-f]+) \S+ (\d+)$")
LINE = re.compile(r"crates/(?!core_arch)(\w+/src/\S+?:\d+)")
SHOWN = 25
"""Number of source lines that are shown."""


def kind(operation: str, operands: str) -> str:
    if re.match(r"v(fn?m(add|sub)|add|sub|mul|div|sqrt|hadd)", operation):
        return "arithmetic"
    if not operation.startswith("v"):
        return "integer"
    if "(" in operands and re.match(r"v(mov|broadcast)", operation):
        return "stack" if re.search(r"r[sb]p", operands) else "load, store"
    return "move"


def executed(program: Path, robot: str, function: str) -> collections.Counter[int]:
    """Counts the executions of each instruction while a function runs, by the instruction's address. All instructions
    of shared libraries are counted at address 0."""
    cost: collections.Counter[int] = collections.Counter()
    with TemporaryDirectory() as folder:
        profile = Path(folder) / "profile"
        options = ("--dump-instr=yes", "--compress-pos=no", "--collect-atstart=no", f"--toggle-collect=*{function}")
        command = ("valgrind", "--quiet", "--tool=callgrind", *options, f"--callgrind-out-file={profile}")
        run(*command, program, robot, env={**os.environ, "CONDYLE_LEVEL": "avx2"})
        names: dict[str, str] = {}
        ours = inclusive = False  # the line after `calls` has the cost of the called function
        for line in profile.read_text(encoding="utf-8").splitlines():
            if found := OBJECT.match(line):
                called, number, name = found.groups()
                name = names.setdefault(number, name)
                ours = ours if called else Path(name).name == program.name
            elif (found := COST.match(line)) and not inclusive:
                cost[int(found[1], 16) if ours else 0] += int(found[2])
            inclusive = line.startswith("calls=")
    return cost


def lines(program: Path, cost: collections.Counter[int]) -> None:
    """Prints the source lines with the most executed instructions. An instruction counts for its innermost line outside
    of the crate `spatial`, because functions of `spatial` are inlined everywhere."""
    addresses = "\n".join(map(hex, cost))
    table = run("addr2line", "-a", "-i", "-e", program, input=addresses)
    found: collections.Counter[str] = collections.Counter()
    for entry in re.split(r"^0x", table, flags=re.M)[1:]:
        address, *places = entry.splitlines()
        ours = LINE.findall("\n".join(places))
        own = [place for place in ours if not place.startswith("spatial/")] or ours or ["outside of our crates"]
        found[own[0]] += cost[int(address, 16)]
    for place, n in found.most_common(SHOWN):
        print(f"    {n / cost.total():6.1%}  {place.replace('/src/', '/')}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--lines", action="store_true", help="show the lines that execute most")
    parser.add_argument("--of", action="append", choices=ALGORITHMS, help="this algorithm alone; may be repeated")
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help=", ".join(ROBOTS))
    options = parser.parse_args()
    if unknown := set(options.robots) - set(ROBOTS):
        parser.error(f"no robot of these is called {unknown.pop()}: {', '.join(ROBOTS)}")
    if missing := [tool for tool in ("valgrind", "objdump", "addr2line") if shutil.which(tool) is None]:
        print(f"NOT RUN: there is no {missing[0]}")
        return
    program = build(profile="bench" if options.lines else "release")
    code = {
        int(at, 16): kind(name, operands)
        for at, name, operands in CODE.findall(run("objdump", "-d", "--no-show-raw-insn", program))
    }
    functions = {name: f"instructions::measured::{name}" for name in ALGORITHMS}
    functions |= {name: function for function, name in PHASES.items()}
    print(f"{'':30} {'in all':>8} " + " ".join(f"{name:>11}" for name in KINDS))
    for robot in options.robots or ROBOTS:
        for algorithm in options.of or ALGORITHMS:
            cost = executed(program, robot, functions[algorithm])
            mix: collections.Counter[str] = collections.Counter()
            for address, n in cost.items():
                mix[code.get(address, "C library")] += n
            per = KNOTS * ITERATIONS if algorithm in PHASES.values() else STATES
            shares = " ".join(f"{mix[name] / cost.total():11.0%}" for name in KINDS)
            print(f"{robot:10} {algorithm:19} {cost.total() // per:8} {shares}", flush=True)
            if options.lines:
                lines(program, cost)


if __name__ == "__main__":
    main()
