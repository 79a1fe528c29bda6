"""The book in `docs`: its Python blocks run and print what the pages say, its links lead somewhere."""

import importlib.util
import shutil
import subprocess
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def load() -> ModuleType:
    """`docs/run.py`, which is no package."""
    spec = importlib.util.spec_from_file_location("run", ROOT / "docs" / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BOOK = load()


@pytest.mark.parametrize(
    "chapter", [name for name in BOOK.chapters() if BOOK.blocks((ROOT / "docs" / name).read_text())]
)
def test_chapter(chapter: str) -> None:
    BOOK.run(chapter)


def test_readme() -> None:
    BOOK.run("../README.md")


def test_course_has_code() -> None:
    """Each chapter of the course but the introduction is a program."""
    course = BOOK.chapters()[1:14]
    assert all(BOOK.blocks((ROOT / "docs" / name).read_text()) for name in course), course


def test_structure() -> None:
    assert BOOK.faults() == []


def test_a_wrong_page_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a block prints is compared, and what is missing is said."""
    monkeypatch.setattr(BOOK, "BOOK", tmp_path / "docs")
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("# a\n")
    (tmp_path / "DESIGN.md").write_text("[nowhere](README.md#b)\n")
    (tmp_path / "docs" / "SUMMARY.md").write_text("- [a](a.md)\n- [b](b.md)\n")
    (tmp_path / "docs" / "a.md").write_text("```python\nprint(1 + 1)\n```\n```text\n3\n```\n[gone](c.md)\n")
    with pytest.raises(AssertionError, match=r"a.md:2: prints\n2\nwhere the page has\n3"):
        BOOK.run("a.md")
    faults = ["b.md: is not there", "a.md: no c.md", "DESIGN.md: no heading for README.md#b"]
    assert sorted(BOOK.faults()) == sorted(faults)
    BOOK.run("a.md", write=True)
    BOOK.run("a.md")


def test_mdbook(tmp_path: Path) -> None:
    """mdBook builds the book, where it is installed."""
    program = shutil.which("mdbook")
    if program is None:
        pytest.skip("mdbook is not installed")
    subprocess.run([program, "build", "--dest-dir", tmp_path / "book", ROOT / "docs"], check=True)
    assert (tmp_path / "book" / "rnea.html").is_file()
