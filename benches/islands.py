#!/usr/bin/env python3
"""Counts the instructions per robot for several standing quadrupeds in one model, at SIMD level AVX2.

    python3 benches/islands.py

The program runs benches/islands.rs under callgrind (of valgrind), and prints a table in thousands of instructions.
"""

import os
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from instructions import build, run

ROBOTS = (1, 2, 4, 8, 16)
LINE = re.compile(r"^\s*([\d,]+) .*\bislands::measured::(\w+)")


def counts(program: Path, robots: int) -> dict[str, int]:
    """Counts the instructions of one call of each algorithm."""
    with TemporaryDirectory() as folder:
        profile = Path(folder) / "profile"
        command = ("valgrind", "--quiet", "--tool=callgrind", f"--callgrind-out-file={profile}", program, str(robots))
        run(*command, env={**os.environ, "CONDYLE_LEVEL": "avx2"})
        table = run("callgrind_annotate", "--inclusive=yes", "--threshold=100", "--auto=no", profile)
    found: dict[str, int] = {}
    for match in filter(None, map(LINE.match, table.splitlines())):
        found[match[2]] = max(int(match[1].replace(",", "")), found.get(match[2], 0))
    return found


def main() -> None:
    if shutil.which("valgrind") is None:
        sys.exit("there is no valgrind to count instructions with")
    program = build("islands")
    for robots in ROBOTS:
        found = counts(program, robots)
        if robots == ROBOTS[0]:
            print(f"| thousands of instructions for each robot | {' | '.join(sorted(found))} |")
            print(f"| --- |{' --- |' * len(found)}")
        print(f"| {robots} | {' | '.join(f'{found[name] / robots / 1e3:.1f}' for name in sorted(found))} |")


if __name__ == "__main__":
    main()
