#!/usr/bin/env python3
"""Runs the Python blocks of the book, and checks the book's table of contents and links.

    python docs/run.py                   # all pages
    python docs/run.py rnea.md           # one page, with its predecessors
    python docs/run.py --write aba.md    # one page; writes its output

The Python blocks of a chapter are one program. A line `<!-- goes on from: trees.md -->` at the top of a chapter states
that the program continues another chapter's program. A
block ```text directly after a block ```python holds the output of that block. Rust blocks are doctests of the crate
`condyle`.
"""

import argparse
import contextlib
import io
import re
import sys
from pathlib import Path
from typing import Any, NamedTuple

BOOK = Path(__file__).parent
FENCE = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"(?<!\\)\[[^\]\n]*\]\(([^)\s]+)\)")
MATHS = re.compile(r"\$[^$\n]*\$|`[^`\n]*`")


class Block(NamedTuple):
    """Python block of a page, with its expected output."""

    line: int
    """Line number of the block's first line in the page."""
    code: str
    expected: str | None
    """Expected output; None if the page contains no output of the block."""
    where: tuple[int, int]
    """Start and end offset of the expected output in the text of the page."""


def blocks(text: str) -> list[Block]:
    """Returns the Python blocks of a page."""
    found, fences = [], list(FENCE.finditer(text))
    for k, fence in enumerate(fences):
        if fence[1] != "python":
            continue
        after = fences[k + 1] if k + 1 < len(fences) else None
        prints = after is not None and after[1] == "text" and not text[fence.end() : after.start()].strip()
        line = text.count("\n", 0, fence.start(2)) + 1
        found.append(
            Block(line, fence[2], after[2] if after and prints else None, after.span(2) if after and prints else (0, 0))
        )
    return found


def before(text: str) -> list[str]:
    """Returns the chapters whose programs a chapter continues."""
    said = re.search(r"<!-- goes on from: (.*?) -->", text)
    return said[1].split(", ") if said else []


def run(chapter: str, write: bool = False, namespace: dict[str, Any] | None = None) -> dict[str, Any]:
    """Runs the blocks of a chapter and returns the names that they define. Raises AssertionError if the output of a
    block differs from the output in the page."""
    path = BOOK / chapter
    text = path.read_text(encoding="utf-8")
    names: dict[str, Any] = {"__name__": chapter} if namespace is None else namespace
    done: set[str] = names.setdefault("_chapters", set())
    for earlier in before(text):
        if earlier not in done:
            run(earlier, False, names)
    done.add(chapter)
    replaced: list[tuple[tuple[int, int], str]] = []
    for block in blocks(text):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile("\n" * (block.line - 1) + block.code, str(path), "exec"), names)
        if block.expected is None:
            if printed.getvalue():
                raise AssertionError(f"{path}:{block.line}: prints text, but the page shows no output")
        elif write:
            replaced.append((block.where, printed.getvalue()))
        elif printed.getvalue() != block.expected:
            raise AssertionError(
                f"{path}:{block.line}: prints\n{printed.getvalue()}where the page has\n{block.expected}"
            )
    for (start, end), new in reversed(replaced):
        text = text[:start] + new + text[end:]
    if write:
        path.write_text(text, encoding="utf-8")
    return names


def chapters(part: str | None = None) -> list[str]:
    """Returns the pages of the book or of one part of the book, in the order of the table of contents."""
    contents = (BOOK / "SUMMARY.md").read_text(encoding="utf-8")
    if part is not None:
        contents = contents.partition(f"\n# {part}\n")[2].partition("\n# ")[0]
    return re.findall(r"\]\(([\w.]+\.md)\)", contents)


def anchors(path: Path) -> set[str]:
    """Returns the anchors of the headings of a page."""
    text = FENCE.sub("", path.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-") for title in titles}


def faults() -> list[str]:
    """Returns messages for pages that SUMMARY.md does not list, broken links, and blocks without a language."""
    listed = chapters()
    wrong = [
        f"{page.name}: not in SUMMARY.md" for page in BOOK.glob("*.md") if page.name not in [*listed, "SUMMARY.md"]
    ]
    wrong += [f"SUMMARY.md: {name} twice" for name in {n for n in listed if listed.count(n) > 1}]
    for page in [*(BOOK / name for name in listed), BOOK.parent / "README.md", BOOK.parent / "DESIGN.md"]:
        if not page.is_file():
            wrong.append(f"{page.name}: file is missing")
            continue
        text = page.read_text(encoding="utf-8")
        wrong += [f"{page.name}: a block without a language" for fence in FENCE.finditer(text) if not fence[1]]
        for target in LINK.findall(MATHS.sub("", FENCE.sub("", text))):
            if re.match(r"\w+:", target):
                continue
            file, _, anchor = target.partition("#")
            to = (page.parent / file).resolve() if file else page
            if not to.exists():
                wrong.append(f"{page.name}: no {target}")
            elif anchor and to.suffix == ".md" and anchor not in anchors(to):
                wrong.append(f"{page.name}: no heading for {target}")
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("chapters", nargs="*")
    parser.add_argument("--write", action="store_true", help="write the printed output into the pages")
    arguments = parser.parse_args()
    for chapter in arguments.chapters or chapters():
        run(chapter, arguments.write)
        print(chapter)
    if not arguments.chapters and (wrong := faults()):
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
