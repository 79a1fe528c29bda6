#!/usr/bin/env python3
"""Checks the rendered documentation of the crate `condyle`, after `cargo doc --workspace --no-deps`.

    python3 tests/documentation.py

The program fails if the first page lists more than 70 names, or if a page shows internal names, which only Condyle's
own crates use.
"""

import html
import os
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LARGEST = 70
"""Maximum number of names on the first page of the crate `condyle`: modules, types, traits, functions and constants
together."""
INTERNAL = re.compile(r"\b(SameLayout|FusedF64|LaneDual|Lanes|Rename|NotALane|SimdToken)\b")
CRATES = [
    "condyle",
    "condyle_dynamics",
    "condyle_model",
    "condyle_ik",
    "condyle_mpc",
    "condyle_optimal",
    "condyle_spatial",
    "condyle_wholebody",
]
REEXPORTED = {"nalgebra", "num_dual", "rand"}
"""Names of other projects' crates that Condyle re-exports as modules."""


def text(page: str) -> str:
    """Returns the text of an HTML page without the tags."""
    return html.unescape(re.sub(r"<[^>]*>", " ", page))


def main() -> None:
    docs = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "doc"
    first = (docs / "condyle" / "index.html").read_text(encoding="utf-8")
    names = re.findall(
        r'<dt[^>]*>.*?<a class="(?:mod|struct|enum|trait|fn|constant|type|union|macro)" [^>]*>(.*?)</a>', first
    )
    reexports = re.findall(r"<dt[^>]*><code>pub use ", first)
    print(f"condyle/index.html: {len(names)} names, {len(reexports)} re-exports")
    faults = []
    if not 20 <= len(names) <= LARGEST:
        faults.append(f"condyle/index.html: {len(names)} names, expected at most {LARGEST}")
    pages = [page for crate in CRATES for page in sorted((docs / crate).rglob("*.html"))]
    pages = [page for page in pages if not REEXPORTED & set(page.relative_to(docs).parts)]
    print(f"{len(pages)} pages")
    for page in pages:
        found = {match.group() for match in INTERNAL.finditer(text(page.read_text(encoding="utf-8")))}
        if found:
            faults.append(f"{page.relative_to(docs)}: shows {', '.join(sorted(found))}")
    print(*faults, sep="\n", end="\n" if faults else "")
    sys.exit(bool(faults) or not pages)


if __name__ == "__main__":
    main()
