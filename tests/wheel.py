#!/usr/bin/env python3
"""Checks a wheel of the Python package: size, tag, licences, linked libraries, and a computation with the installed
wheel.

    python3 tests/wheel.py WHEEL [--install]

The check fails if the wheel is larger than 9.4 MB, if it is not for the stable interface of Python 3.10, or if licences
or types are missing. On Linux it also fails if the library needs other libraries than the manylinux tag allows, or
newer symbols of the C library than the tag promises. --install installs the wheel into an empty virtual environment,
and runs a computation there.
"""

import argparse
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

LARGEST = 9_400_000
"""Maximum size of a wheel, in bytes."""
TAG = re.compile(r"condyle-[^-]+-cp310-abi3-(.+)\.whl")
ALLOWED = {
    "libc.so.6",
    "libdl.so.2",
    "libgcc_s.so.1",
    "libm.so.6",
    "libpthread.so.0",
    "librt.so.1",
    "ld-linux-x86-64.so.2",
    "ld-linux-aarch64.so.1",
}
"""Libraries that the system provides according to the manylinux policies; only libraries that Rust programs use are
listed."""
PROGRAM = """
import condyle, numpy as np
arm = condyle.robots.arm7()
data, q, v, a = condyle.Data(arm), np.full(7, 0.3), np.full(7, 0.1), np.full(7, 0.2)
tau = condyle.rnea(arm, data, q, v, a)
assert np.abs(condyle.aba(arm, data, q, v, tau) - a).max() < 1e-9
assert np.abs(condyle.crba(arm, data, q) @ condyle.minv(arm, data, q) - np.eye(7)).max() < 1e-9
"""


def linked(library: Path, platform: str) -> list[str]:
    """Returns faults: libraries and symbols that a library for Linux needs, but that the manylinux tag does not
    allow."""
    if shutil.which("objdump") is None:
        print("NOT RUN: there is no objdump to look at the libraries with")
        return []
    told = subprocess.run(["objdump", "-p", library], check=True, capture_output=True, text=True).stdout
    needed = set(re.findall(r"NEEDED\s+(\S+)", told))
    if not needed:
        return ["objdump names no library that is needed"]
    found = [f"it needs {name}, which no manylinux tag allows" for name in sorted(needed - ALLOWED)]
    newest = max((int(a), int(b)) for a, b in re.findall(r"GLIBC_(\d+)\.(\d+)", told))
    promised = re.search(r"manylinux_(\d+)_(\d+)", platform)
    if promised and newest > (int(promised[1]), int(promised[2])):
        found.append(f"it needs glibc {newest[0]}.{newest[1]}, its tag promises {promised[0]}")
    print(f"needs {', '.join(sorted(needed))}; glibc {newest[0]}.{newest[1]}")
    return found


def faults(wheel: Path) -> list[str]:
    found = []
    size = wheel.stat().st_size
    print(f"{wheel.name}: {size / 1e6:.1f} MB")
    if size > LARGEST:
        found.append(f"it has {size} bytes, at most {LARGEST} are allowed")
    tag = TAG.fullmatch(wheel.name)
    if tag is None:
        return [*found, "it is not for Python 3.10 and later (cp310-abi3)"]
    with zipfile.ZipFile(wheel) as archive, TemporaryDirectory() as folder:
        names = archive.namelist()
        for end in ("LICENSE-MIT", "LICENSE-APACHE", "condyle/py.typed", "condyle/_condyle.pyi"):
            if not any(name.endswith(end) for name in names):
                found.append(f"{end} is missing")
        libraries = [name for name in names if name.endswith((".so", ".pyd"))]
        if len(libraries) != 1:
            found.append(f"expected one library, found {libraries}")
        elif "linux" in tag[1]:
            found += linked(Path(archive.extract(libraries[0], folder)), tag[1])
    return found


def install(wheel: Path) -> None:
    with TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        python = Path(folder) / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel.resolve()]
        subprocess.run(pip, check=True)
        subprocess.run([python, "-c", PROGRAM], check=True, cwd=folder)
    print("it computes in an environment of its own")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path)
    parser.add_argument("--install", action="store_true", help="install it, with numpy, and compute")
    arguments = parser.parse_args()
    found = faults(arguments.wheel)
    if found:
        sys.exit("\n".join(found))
    if arguments.install:
        install(arguments.wheel)


if __name__ == "__main__":
    main()
