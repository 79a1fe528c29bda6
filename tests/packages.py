#!/usr/bin/env python3
"""Packs every published crate, each after the crates that it depends on, and checks the packages.

    python3 tests/packages.py [--verify]

A package must have its licences, its README, the metadata that the registry shows, and all files that its sources
include. Each dependency must have a version and be published earlier. The size of the package must be within the
registry's limit. Otherwise the program fails. --verify also compiles each package from the files in the package, as
`cargo publish --dry-run` does.
"""

import argparse
import json
import posixpath
import re
import subprocess
import sys
import tarfile
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
ORDER = ["spatial", "linalg", "meshes", "model", "dynamics", "optimal", "wholebody", "ik", "mpc", "", "codegen", "cli"]
"""Folders of the published crates below `crates/`. Each crate comes after its dependencies. The empty name means the
crate `condyle`."""
LARGEST = 10 * 1024 * 1024
"""Maximum size of a package on crates.io, in bytes."""
REQUIRED = {"Cargo.toml", "Cargo.lock", "LICENSE-MIT", "LICENSE-APACHE", "README.md"}
INCLUDED = re.compile(r"include_(?:str|bytes)!\(\s*\"([^\"]+)\"")
FIELDS = ["description", "license", "readme", "keywords", "categories", "rust_version"]


def crate_name(name: str) -> str:
    return f"condyle-{name}" if name else "condyle"


def manifests() -> dict[str, dict[str, Any]]:
    """Returns cargo's metadata of the workspace's crates, by name."""
    command = ["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"]
    told = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return {manifest["name"]: manifest for manifest in json.loads(told)["packages"]}


def faults(package: Path, manifest: dict[str, Any], before: set[str]) -> list[str]:
    """Returns the faults of one package. `before` contains the names of the crates that are published earlier."""
    found = []
    if package.stat().st_size > LARGEST:
        found.append(f"{package.stat().st_size} bytes, at most {LARGEST} are allowed")
    with tarfile.open(package) as archive:
        files = {}
        for member in archive.getmembers():
            content = archive.extractfile(member)
            if content is not None:
                files[member.name.partition("/")[2]] = content.read()
    found += [f"{path} is missing or empty" for path in sorted(REQUIRED) if not files.get(path)]
    for path, content in files.items():
        if path.endswith(".rs"):
            for included in INCLUDED.findall(content.decode()):
                if posixpath.normpath(posixpath.join(posixpath.dirname(path), included)) not in files:
                    found.append(f"{path} includes {included}, which is not in the package")
    found += [f"`{field}` is missing" for field in FIELDS if not manifest[field]]
    for needed in manifest["dependencies"]:
        name, development = needed["name"], needed["kind"] == "dev"
        # A crate may depend on itself without a version, to enable features for its tests.
        if needed["req"] == "*" and name != manifest["name"]:
            found.append(f"the dependency {name} has no version")
        if name.startswith("condyle") and not development and name not in before:
            found.append(f"{name} is published after it")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--verify", action="store_true", help="compile each package from what is in it")
    verify = parser.parse_args().verify
    with TemporaryDirectory() as folder:
        command = ["cargo", "package", "--quiet", "--locked", "--workspace", "--allow-dirty", "--target-dir", folder]
        command += ["--exclude", "condyle-python", "--exclude", "condyle-benches"]
        command += [] if verify else ["--no-verify", "--offline"]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            sys.exit(done.stderr)
        told, failed = manifests(), False
        before: set[str] = set()
        for name in ORDER:
            crate = crate_name(name)
            (package,) = (Path(folder) / "package").glob(f"{crate}-[0-9]*.crate")
            wrong = faults(package, told[crate], before)
            print(f"{crate}: {package.stat().st_size / 1024:.0f} KB", *wrong, sep="\n    ")
            failed |= bool(wrong)
            before.add(crate)
        left_out = {path.name for path in (Path(folder) / "package").glob("*.crate")}
        if len(left_out) != len(ORDER):
            sys.exit(f"expected {len(ORDER)} packages, found {sorted(left_out)}")
    sys.exit(failed)


if __name__ == "__main__":
    main()
