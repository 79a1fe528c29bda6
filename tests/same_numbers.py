#!/usr/bin/env python3
"""Compares the outputs of two programs. Words in the outputs must be equal, and numbers must be equal up to rounding.

    python3 tests/same_numbers.py ONE OTHER [--rounding 1e-12] [--only WORD]

A number may differ by the value of --rounding times the largest number in the same line. With --rounding 0, numbers
must be equal. With --only WORD, the program compares only lines that begin with this word.
"""

import argparse
import re
import sys
from pathlib import Path

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?|NaN|-?inf")


def lines(path: Path, word: str) -> list[str]:
    return [line for line in path.read_text().splitlines() if line.startswith(word)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("one", type=Path)
    parser.add_argument("other", type=Path)
    parser.add_argument("--rounding", type=float, default=1e-12)
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    one, other = (lines(path, given.only) for path in (given.one, given.other))
    if len(one) != len(other) or not one:
        sys.exit(f"{given.one} has {len(one)} lines to compare, {given.other} {len(other)}")
    worst, count = 0.0, 0
    for a, b in zip(one, other, strict=True):
        found, expected = (list(map(float, NUMBER.findall(line))) for line in (a, b))
        if NUMBER.sub("", a) != NUMBER.sub("", b) or len(found) != len(expected):
            sys.exit(f"different words:\n{a}\n{b}")
        scale = max(map(abs, [*found, *expected]), default=0.0) or 1.0
        for x, y in zip(found, expected, strict=True):
            off = 0.0 if x == y else abs(x - y) / scale
            if not off <= given.rounding:
                sys.exit(f"{x} and {y} differ by {off:.1e} of the line's largest number:\n{a}\n{b}")
            worst, count = max(worst, off), count + 1
    print(f"{count} numbers in {len(one)} lines are the same to {worst:.1e}")


if __name__ == "__main__":
    main()
