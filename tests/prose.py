#!/usr/bin/env python3
"""Finds comments and paragraphs that are hard to read, by searching for patterns that good sentences seldom contain.

    python3 tests/prose.py [PATH…]       check the files below these paths (all files of the repository, if none)
    python3 tests/prose.py --sample      print 100 comments and 50 paragraphs, chosen at random with a fixed seed
    python3 tests/prose.py --count       print the number of findings per folder

The program reads the comments of Rust and C++, the docstrings and comments of Python, and the paragraphs of Markdown.
Files below TO_DO are not checked unless they are named. The exit status is 1 if there are findings.
"""

import argparse
import ast
import inspect
import io
import random
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
TO_DO: tuple[str, ...] = ()
"""Paths of texts that are not yet rewritten."""
EXCLUDED = ("crates/cli/page/vendor", "python/condyle/_condyle.pyi", "VALIDATION.md", "crates/model/robots")
"""Paths of texts that are copied from elsewhere or generated."""
LONGEST = 30
"""Maximum number of words in a sentence. The rule is 25, but the program cannot distinguish a formula from a word."""
SEED = 20261127

IRREGULAR = "been|had|done|got|run|set|read|put|found|met|made|kept|built|sent|left|held|lost|led|cut|come|gone"
PARTICIPLE = rf"(?:\w+ed|\w+en|{IRREGULAR})"
PATTERNS = [
    (r"\b\w*manieth\b", "write `index` or `ordinal`"),
    (r"\bso (?:many|often)\b(?! that)", "name the quantity: `number of …`"),
    (rf"\b(?:has|have|had) not\b(?! (?:yet |to )?{PARTICIPLE}\b)", "write `does not have` or `lacks`"),
    (r"\b(?:that|which) there (?:is|are)\b", "write `existing` or leave it out"),
    (r"\b(?:is|are|was|were) none\b(?! of)", "write `does not exist` or `is missing`"),
    (r"\b[Bb]y this much\b", "write `Maximum …` or `Margin of …`"),
    (r"\b(?:that|those) of\b", "repeat the noun"),
    (r"\bnobody\b", "name the caller or the thread"),
    (r"\b(?:[Bb]ut for|[Bb]eside)\b", "write `except`, `besides` or `next to`"),
    (r"\bare had\b|\bis had\b", "write `are available` or `are computed`"),
    (r"\bit is no\b|\bthere is no one\b", "write `does not …`"),
    (r"[.:] (?:Of|What|Who)\b(?![^.]*\?)", "begin with the noun or the verb"),
]
"""Patterns of unclear sentences, each with advice on what to write instead."""
DOC_START = re.compile(r"(?:What|Of|Who|Whose|How)\b")
"""Words with which a doc comment may not begin, because it must begin with a noun or a verb."""


class Passage(NamedTuple):
    path: str
    line: int
    kind: str
    """Kind: `doc` (documentation of an item), `comment` or `paragraph`."""
    text: str


def rust(path: str, text: str) -> Iterator[Passage]:
    """Yields the blocks of comments in a file of Rust or C++, without code blocks inside the comments."""
    block: list[str] = []
    start, marker, code = 0, "", False
    for number, line in enumerate([*text.splitlines(), ""], 1):
        match = re.match(r"\s*(//[/!]?)(?!/)(.*)", line)
        if match and (not block or match[1] == marker):
            if not block:
                start, marker, code = number, match[1], False
            if match[2].strip().startswith("```"):
                code = not code
                block.append("")
            elif code:
                block.append("")
            else:
                block.append(re.sub(r"^ # .*", "", match[2]))
            continue
        if block:
            block = without_literals([line.removeprefix(" ") for line in block])
            kind = "comment" if marker == "//" else "doc"
            yield from (Passage(path, start + at, kind, part) for at, part in paragraphs(block))
            block = []
        if match:
            start, marker, block, code = number, match[1], [match[2]], False


def python(path: str, text: str) -> Iterator[Passage]:
    """Yields the docstrings and comments of a file in Python."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            lines = without_literals(inspect.cleandoc(node.value.value).splitlines())
            yield from (Passage(path, node.lineno + at, "doc", part) for at, part in paragraphs(lines))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not token.string.startswith("#!"):
            yield Passage(path, token.start[0], "comment", token.string.lstrip("# "))


def without_literals(lines: list[str]) -> list[str]:
    """Replaces the lines of literal blocks, such as commands and formulas, by empty lines. A literal block is indented
    and follows an empty line."""
    found: list[str] = []
    literal = False
    for line in lines:
        literal = line.startswith("    ") and (literal or not found or not found[-1])
        found.append("" if literal else line.strip())
    return found


def markdown(path: str, text: str) -> Iterator[Passage]:
    """Yields the paragraphs of a page without code, formulas, tables and headings."""
    lines, code, formula = [], False, False
    for line in text.splitlines():
        if line.lstrip().startswith("```"):
            code = not code
            lines.append("")
        else:
            skipped = code or formula or re.match(r"\s*(?:\||#|<|!\[|\$\$)", line)
            formula ^= not code and line.count("$$") == 1
            lines.append("" if skipped else re.sub(r"^\s*(?:[-*>]|\d+\.)\s+", "\0", line).strip())
    yield from (Passage(path, 1 + at, "paragraph", part) for at, part in paragraphs(lines))


def paragraphs(lines: list[str]) -> Iterator[tuple[int, str]]:
    """Joins lines into paragraphs and yields each paragraph with the index of its first line. A line that begins with
    `\\0` or a list marker begins a new paragraph."""
    start, held = 0, ""
    for at, line in enumerate([*lines, ""]):
        begins = line.startswith(("\0", "- ", "* ", "# ")) or line == ""
        if begins and held:
            yield start, held
            held = ""
        if line:
            if not held:
                start = at
            held = f"{held} {line.lstrip(chr(0))}".strip()


def passages(path: str) -> list[Passage]:
    file = ROOT / path
    if not file.is_file():  # the file was deleted, but the deletion is not yet committed
        return []
    text = file.read_text(encoding="utf-8")
    reader = {".rs": rust, ".cpp": rust, ".h": rust, ".py": python, ".md": markdown}[file.suffix]
    found = (passage for passage in reader(path, text) if not passage.text.startswith(">>>"))
    return [passage for passage in found if re.search(r"[a-z]{3}", passage.text)]


def sentences(text: str) -> list[str]:
    """Splits a passage at the end of each sentence or clause. Code and formulas count as one word each."""
    text = re.sub(r"`[^`]*`|\$[^$]*\$|\[[^\]]*\]\([^)]*\)|\([^()]*\)", "x", text)
    return re.split(r"(?<=[.;:!?])\s+", text)


def findings(passage: Passage) -> Iterator[str]:
    prose = re.sub(r"`[^`]*`|\$[^$]*\$", "x", passage.text)
    for pattern, advice in PATTERNS:
        if match := re.search(pattern, prose):
            yield f"`{match[0]}`: {advice}"
    if passage.kind == "doc" and (match := DOC_START.match(passage.text)):
        yield f"begins with `{match[0]}`: begin with the noun or verb it describes"
    longest = max(len(re.findall(r"[^\W\d_]{2,}", sentence)) for sentence in sentences(passage.text))
    if longest > LONGEST:
        yield f"a sentence of {longest} words: split it"


def below(path: str, roots: tuple[str, ...]) -> bool:
    return any(path == root or path.startswith(root.rstrip("/") + "/") for root in roots)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", nargs="*", help="files and folders, relative to the repository")
    parser.add_argument("--sample", action="store_true", help="print a random sample, for a reader")
    parser.add_argument("--count", action="store_true", help="print the number of findings per folder")
    arguments = parser.parse_args()
    roots = tuple(arguments.paths)
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split()
    files = [
        path for path in tracked if path.endswith((".rs", ".cpp", ".h", ".py", ".md")) and not below(path, EXCLUDED)
    ]
    files = [path for path in files if (below(path, roots) if roots else not below(path, TO_DO))]
    found = [passage for path in files for passage in passages(path)]
    if arguments.sample:
        chance = random.Random(SEED)
        comments = [passage for passage in found if passage.kind != "paragraph" and len(passage.text.split()) > 4]
        pages = [passage for passage in found if passage.kind == "paragraph" and len(passage.text.split()) > 4]
        for part in (chance.sample(comments, min(100, len(comments))), chance.sample(pages, min(50, len(pages)))):
            for number, passage in enumerate(part, 1):
                print(f"{number}. {passage.path}:{passage.line} ({passage.kind})\n   {passage.text}")
        return 0
    total: Counter[str] = Counter()
    for passage in found:
        for finding in findings(passage):
            total["/".join(passage.path.split("/")[:3])] += 1
            if not arguments.count:
                print(f"{passage.path}:{passage.line}: {finding}\n    {passage.text[:160]}")
    if arguments.count:
        for folder, number in total.most_common():
            print(f"{number:5} {folder}")
    print(f"prose: {total.total()} findings in {len(found)} passages of {len(files)} files")
    return total.total() > 0


if __name__ == "__main__":
    sys.exit(main())
