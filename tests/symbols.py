"""Fails if a vector instruction of a built library stands in a function of its own.

    python3 tests/symbols.py LIBRARY

A closure or helper that the compiler does not inline into the code of a level turns each vector instruction in it into
a call: still right, but several times slower, and nothing else would tell. What fills memory once is let pass.
"""

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

OUTLINED = re.compile(r"core_arch::(?:x86::(?:avx|fma)\w*|(?:aarch64|arm_shared)::neon)::(?:\w+::)*(\w+)")
FILLING = re.compile(r"_set1_|^vdupq_n_")
"""Of a new `Data`, with zeros."""
FOREIGN = re.compile(r"^_mm256_movemask_epi8$")
"""Of a crate that searches text; no numbers here are integers of eight bits."""


def outlined(library: Path) -> list[str]:
    """The vector instructions that are functions."""
    symbols = subprocess.run(["nm", "-C", library], check=True, capture_output=True, text=True).stdout
    if "condyle" not in symbols:
        sys.exit(f"{library}: expected symbols of condyle, found none")
    found = {match[1] for match in OUTLINED.finditer(symbols)}
    return sorted(name for name in found if not FILLING.search(name) and not FOREIGN.search(name))


def main() -> None:
    (path,) = map(Path, sys.argv[1:])
    if shutil.which("nm") is None:
        print("NOT RUN: there is no nm to look at the symbols with")
        return
    with TemporaryDirectory() as folder:
        if path.suffix == ".whl":
            with zipfile.ZipFile(path) as wheel:
                member = next(name for name in wheel.namelist() if name.endswith((".so", ".pyd", ".dylib")))
                path = Path(wheel.extract(member, folder))
        found = outlined(path)
    if found:
        sys.exit(f"not inlined: {', '.join(found)}")
    print("all vector instructions are inlined")


if __name__ == "__main__":
    main()
