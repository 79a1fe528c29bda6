#!/usr/bin/env python3
"""Converts the formulas of the book, LaTeX between dollar signs, to MathML, which browsers show without scripts.

This program is a preprocessor of mdBook: mdBook passes the text of the book on standard input (`[preprocessor.mathml]`
in book.toml). Needs the package latex2mathml (`pip install latex2mathml`).
"""

import json
import re
import sys
from typing import Any

from latex2mathml.converter import convert

SPECIAL = str.maketrans({"*": "&#42;", "_": "&#95;", "|": "&#124;"})
"""Map from characters with a meaning in Markdown to their HTML escapes."""
PARTS = re.compile(r"(?P<code>^```.*?^```$|`[^`\n]*`)|\$\$(?P<display>[^$]+)\$\$|\$(?P<inline>[^$\n]+)\$", re.M | re.S)


def with_mathml(text: str) -> str:
    """Converts the formulas of a page to MathML. Code in the page does not change."""

    def replace(part: re.Match[str]) -> str:
        if part["code"] is not None:
            return part[0]
        if part["display"] is not None:
            formula = part["display"].strip().replace("{aligned}", "{split}")  # the converter supports only `split`
            return convert(formula, display="block").translate(SPECIAL)
        return convert(part["inline"]).translate(SPECIAL)

    return PARTS.sub(replace, text)


def visit(items: list[Any]) -> None:
    for item in items:
        if isinstance(item, dict) and "Chapter" in item:
            chapter = item["Chapter"]
            chapter["content"] = with_mathml(chapter["content"])
            visit(chapter["sub_items"])


def main() -> None:
    if sys.argv[1:2] == ["supports"]:
        sys.exit(sys.argv[2] != "html")
    _, book = json.load(sys.stdin)
    visit(book["items"] if "items" in book else book["sections"])
    json.dump(book, sys.stdout)


if __name__ == "__main__":
    main()
