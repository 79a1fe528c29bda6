"""Checks that no vector instruction of a built library is a separate function.

    python3 tests/symbols.py LIBRARY

If the compiler does not inline a closure or helper function into the code of a SIMD level, each vector instruction of
the function becomes a call. The results are then correct, but they take several times as long, and no other test
detects this mistake. Instructions that only initialise memory are allowed to be calls.
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
"""Pattern of instructions that fill a new `Data` with constants, such as zeros."""
FOREIGN = re.compile(r"^_mm256_movemask_epi8$")
"""Vector instruction with integers of eight bits, which a dependency uses to search in text. Condyle does not use such
integers."""


def outlined(library: Path) -> list[str]:
    """Returns the names of vector instructions that the library contains as separate functions."""
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
