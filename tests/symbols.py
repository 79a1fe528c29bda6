"""Checks that no vector instruction of a built library is a separate function.

    python3 tests/symbols.py LIBRARY

If the compiler does not inline a closure or helper into the code of a SIMD level, each vector instruction in it becomes
a call. The results are then correct, but they take several times as long, and nothing else would show this mistake.
Instructions that only fill memory once are allowed.
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
"""Instructions that fill a new `Data` with zeros."""
FOREIGN = re.compile(r"^_mm256_movemask_epi8$")
"""Instruction of a crate that searches in texts. Condyle does not use integers of eight bits."""


def outlined(library: Path) -> list[str]:
    """Returns the names of vector instructions that are separate functions."""
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
