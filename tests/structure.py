#!/usr/bin/env python3
"""Prints cycles of modules that use each other. With --sizes, also prints the program's size and build time.

    python3 tests/structure.py [--sizes]

The check fails if a cycle has more than three modules, if a line of Rust is wider than 120 characters, or if
PROMISES.md names a file or test that does not exist. With --sizes, it also fails if the program has more than 6.5 MB of
code, or if one of its functions has more than 64 KB. A module and its child module count as one module if the child
uses no other module than its parent. --sizes compiles the program and all its dependencies in a new folder (several
minutes), and needs `nm` and `size`.
"""

import argparse
import re
import subprocess
import sys
import time
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from prose import TO_DO

ROOT = Path(__file__).resolve().parents[1]
LARGEST_CIRCLE = 3
LARGEST_FUNCTION = 64 * 1024
LARGEST_PROGRAM = 6_500_000
WIDEST = 120
LITERALS = re.compile(r"//[^\n]*|\br(#*)\".*?\"\1|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^\\'])'", re.DOTALL)
"""Pattern of comments, string literals and character literals in Rust."""

Module = tuple[str, ...]


def without_comments(text: str) -> str:
    text = re.sub(r"//[^\n]*", "", text)
    return re.sub(r"#\[cfg\(test\)\]\s*(?:pub(?:\(crate\))? )?mod \w+ \{.*", "", text, flags=re.DOTALL)


def paths(tree: str, prefix: Module = ()) -> list[Module]:
    """Returns the module paths that a `use` declaration of Rust names."""
    parts, depth, start = [], 0, 0
    for i, c in enumerate(tree):
        depth += (c == "{") - (c == "}")
        if c == "," and depth == 0:
            parts.append(tree[start:i])
            start = i + 1
    found = []
    for part in [*parts, tree[start:]]:
        head, brace, rest = part.strip().partition("{")
        names = prefix + tuple(name for name in head.split(" as ")[0].strip().split("::") if name)
        found += paths(rest.rsplit("}", 1)[0], names) if brace else [names] if names else []
    return found


def modules(source: Path) -> dict[Module, Path]:
    found = {}
    for path in sorted(source.rglob("*.rs")):
        parts = path.relative_to(source).with_suffix("").parts
        found[parts[:-1] if parts[-1] in ("mod", "lib", "main") else parts] = path
    return found


def arrows(source: Path) -> dict[Module, set[Module]]:
    """Returns a map from each module of a crate to the modules that it uses."""
    files = modules(source)
    texts = {module: without_comments(path.read_text(encoding="utf-8")) for module, path in files.items()}
    shown = {}  # map from the names that the crate's root re-exports to their modules
    for tree in re.findall(r"\bpub(?:\(crate\))? use ([^;]+);", texts.get((), "")):
        shown.update({path[-1]: path for path in paths(tree)})
    uses: dict[Module, set[Module]] = {}
    for module, text in texts.items():
        named = [path for tree in re.findall(r"\buse ([^;]+);", text) for path in paths(tree)]
        named += [tuple(path.split("::")) for path in re.findall(r"\b(?:crate|super|self)(?:::\w+)+", text)]
        uses[module] = set()
        for path in named:
            here, rest = module, list(path)
            if rest[0] not in ("crate", "super", "self") and (*module, rest[0]) not in files:
                continue
            while rest and rest[0] in ("crate", "super", "self"):
                first = rest.pop(0)
                here = () if first == "crate" else here[:-1] if first == "super" else here
            full = (*here, *rest)
            if here == () and rest and (rest[0],) not in files and rest[0] in shown:
                full = shown[rest[0]]
            target = next((full[:n] for n in range(len(full), 0, -1) if full[:n] in files), None)
            upwards = target is not None and module[: len(target)] == target
            if target is not None and target != module and not upwards:
                uses[module].add(target)
    return uses


def circles(uses: dict[Module, set[Module]]) -> list[list[Module]]:
    """Returns the cycles: sets of modules in which each module uses all others, directly or through other modules
    (Tarjan's algorithm)."""
    order: dict[Module, int] = {}
    low: dict[Module, int] = {}
    stack: list[Module] = []
    found = []

    def visit(module: Module) -> None:
        order[module] = low[module] = len(order)
        stack.append(module)
        for other in uses[module]:
            if other not in order:
                visit(other)
                low[module] = min(low[module], low[other])
            elif other in stack:
                low[module] = min(low[module], order[other])
        if low[module] == order[module]:
            component = stack[stack.index(module) :]
            del stack[-len(component) :]
            if len(component) > 1:
                found.append(sorted(component))

    for module in uses:
        if module not in order:
            visit(module)
    return found


def tracked(*patterns: str) -> list[str]:
    """Returns the paths of tracked files that have not been deleted."""
    listed = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return [path for path in listed.splitlines() if (ROOT / path).is_file()]


def wide_lines() -> Iterator[str]:
    """Yields the lines of Rust code that are too wide. String literals do not count, because rustfmt does not break
    them. (ruff checks the width of Python code.)"""
    for path in tracked("*.rs"):
        if path.startswith(TO_DO):
            continue
        text = (ROOT / path).read_text(encoding="utf-8")
        text = LITERALS.sub(lambda found: found[0] if found[0][0] in "/'" else "\n" * found[0].count("\n"), text)
        for number, line in enumerate(text.splitlines(), 1):
            width = sum(not unicodedata.combining(character) for character in line)
            if width > WIDEST:
                yield f"{path}:{number}: {width} characters"


def broken_promises() -> Iterator[str]:
    """Yields the names of files and tests in PROMISES.md that do not exist."""
    files = tracked()
    sources = "".join((ROOT / path).read_text(encoding="utf-8") for path in files if path.endswith((".rs", ".py")))
    names = set(re.findall(r"\b(?:fn|def|mod) (\w+)", sources))
    for row in (ROOT / "PROMISES.md").read_text(encoding="utf-8").splitlines():
        for word in re.findall(r"`([^`]+)`", "|".join(row.split("|")[2:])):
            if re.fullmatch(r"[\w/.]+(?:/|\.\w+)", word):
                found = any(f"/{word}" in f"/{path}" for path in files)
            elif re.fullmatch(r"[a-z]+(?:_[a-z0-9]+)+_?…?", word):
                found = word in names or (word[-1] == "…" and any(name.startswith(word[:-1]) for name in names))
            else:
                continue
            if not found:
                yield f"PROMISES.md: `{word}` does not exist"


def sizes() -> bool:
    """Prints build time, code size and the largest functions of the program. Returns whether all sizes are within their
    limits."""
    with TemporaryDirectory() as target:
        begin = time.monotonic()
        subprocess.run(
            ["cargo", "build", "--release", "--locked", "--quiet", "--target-dir", target], cwd=ROOT, check=True
        )
        seconds = time.monotonic() - begin
        program = Path(target) / "release" / "condyle"
        lines = subprocess.run(["nm", "-CS", "--size-sort", program], check=True, capture_output=True, text=True).stdout
        sections = subprocess.run(["size", "-A", program], check=True, capture_output=True, text=True).stdout
    functions = [line.split(None, 3) for line in lines.splitlines()]
    functions = [(int(size, 16), name) for _, size, kind, name in functions if kind in "tT"]
    own = [(size, name) for size, name in functions if "condyle" in name]
    print(f"cold build of the program: {seconds:.0f} s")
    code = int(re.search(r"^\.text +(\d+)", sections, re.MULTILINE)[1])
    print(f"its code (section .text): {code / 1e6:.2f} MB")
    for size, name in own[:-6:-1]:
        print(f"  {size / 1024:6.1f} KB  {name[:100]}")
    return code <= LARGEST_PROGRAM and own[-1][0] <= LARGEST_FUNCTION


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--sizes", action="store_true", help="build the program, and print its sizes")
    wanted = parser.parse_args()
    failed = False
    for source in [*sorted(ROOT.glob("crates/*/src")), ROOT / "python" / "src"]:
        found = circles(arrows(source))
        largest = max(map(len, found), default=0)
        failed |= largest > LARGEST_CIRCLE
        lines = sum(
            1
            for path in source.rglob("*.rs")
            for line in path.read_text(encoding="utf-8").splitlines()
            if line.strip() and not line.lstrip().startswith("//")
        )
        name = source.relative_to(ROOT).parts[-2]
        print(f"{name:10} {lines:6} lines of code, {len(found)} circles, the largest of {largest} modules")
        for circle in found:
            print("    " + ", ".join("::".join(module) or "lib" for module in circle))
    faults = [*wide_lines(), *broken_promises()]
    print(*faults, sep="\n", end="\n" if faults else "")
    failed |= bool(faults)
    if wanted.sizes:
        failed |= not sizes()
    sys.exit(failed)


if __name__ == "__main__":
    main()
