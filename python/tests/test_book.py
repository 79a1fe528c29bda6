"""Tests of the book in `docs`: its Python blocks run and print the output on the pages, and its links are valid."""

import contextlib
import importlib.util
import io
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


def load(path: Path) -> ModuleType:
    """Loads a Python file that does not belong to a package as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BOOK = load(ROOT / "docs" / "run.py")


@pytest.mark.parametrize(
    "chapter", [name for name in BOOK.chapters() if BOOK.blocks((ROOT / "docs" / name).read_text())]
)
def test_chapter(chapter: str) -> None:
    if any("import jax" in block.code for block in BOOK.blocks((ROOT / "docs" / chapter).read_text())):
        pytest.importorskip("jax")
    BOOK.run(chapter)


def test_readme() -> None:
    BOOK.run("../README.md")


@pytest.mark.parametrize("part", ["Using Condyle", "The course"])
def test_parts_are_programs(part: str) -> None:
    """Checks that each page of the book's first two parts is a program whose results are checked, by assertions or by
    output.
    """
    pages = BOOK.chapters(part)
    assert len(pages) >= 7
    for name in pages:
        blocks = BOOK.blocks((ROOT / "docs" / name).read_text())
        assert any("assert " in block.code or block.expected for block in blocks), name


def test_structure() -> None:
    assert BOOK.faults() == []


def test_figures() -> None:
    """Checks that each sentence with measured figures is on its page. If the file of measurements exists, the figures
    must equal the numbers in this file.
    """
    figures = load(ROOT / "benches" / "figures.py")
    for page, sentence, _ in figures.QUOTES:
        assert figures.quote(sentence).search((ROOT / page).read_text()), f"{page}: no sentence `{sentence}`"
    if figures.RESULTS.is_file():
        results = figures.Figures(json.loads(figures.RESULTS.read_text()))
        for page in figures.pages():
            text = page.read_text()
            assert figures.filled(page, text, results) == text, f"{page.name}: `python3 benches/figures.py write`"


def test_a_wrong_page_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks that a wrong output of a block on a page is found, and that a missing output is reported."""
    monkeypatch.setattr(BOOK, "BOOK", tmp_path / "docs")
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("# a\n")
    (tmp_path / "DESIGN.md").write_text("[nowhere](README.md#b)\n")
    (tmp_path / "docs" / "SUMMARY.md").write_text("- [a](a.md)\n- [b](b.md)\n")
    (tmp_path / "docs" / "a.md").write_text("```python\nprint(1 + 1)\n```\n```text\n3\n```\n[gone](c.md)\n")
    with pytest.raises(AssertionError, match=r"a.md:2: prints\n2\nwhere the page has\n3"):
        BOOK.run("a.md")
    faults = ["b.md: file is missing", "a.md: no c.md", "DESIGN.md: no heading for README.md#b"]
    assert sorted(BOOK.faults()) == sorted(faults)
    BOOK.run("a.md", write=True)
    BOOK.run("a.md")


def test_formulas() -> None:
    """Checks that each formula can be converted from LaTeX to MathML, and that code with dollar signs does not
    change.
    """
    mathml = load(ROOT / "docs" / "mathml.py")
    assert "<math" in mathml.with_mathml("an $x_i$ b") and mathml.with_mathml("`$x$`") == "`$x$`"
    for chapter in BOOK.chapters():
        page = mathml.with_mathml((ROOT / "docs" / chapter).read_text(encoding="utf-8"))
        formulas = re.findall(r"<math.*?</math>", page, re.DOTALL)
        wrong = [formula for formula in formulas if re.search(r"\\|>&<", formula)]  # LaTeX that was not converted
        assert not wrong, (chapter, wrong)


def test_mdbook(tmp_path: Path) -> None:
    """Checks that mdBook builds the book, if mdBook is installed."""
    program = shutil.which("mdbook")
    if program is None:
        pytest.skip("mdbook is not installed")
    python = Path(sys.executable).parent  # this folder contains the program that converts formulas to MathML
    environment = {**os.environ, "PATH": f"{python}{os.pathsep}{os.environ['PATH']}"}
    command = [program, "build", "--dest-dir", tmp_path / "book", ROOT / "docs"]
    subprocess.run(command, check=True, env=environment)
    assert "<math" in (tmp_path / "book" / "rnea.html").read_text(encoding="utf-8")


# For each worked example: the block that defines the algorithm (in the chapter or in rnea.md), and the example's block.
# Further, mistakes in the definition, each as a pair (right text, wrong text).
RNEA = [
    (" + cross(vel[i]) @ vJ", ""),
    (" + cross_dual(vel[i]) @ I[i] @ vel[i]", ""),
    ("f[i] = I[i] @ acc[i] + ", "f[i] = "),
    ("up[i] @ acc[tree.parent[i]] + ", ""),
    ("        f[tree.parent[i]] += up[i].T @ f[i]  # λX*_i = (iXλ)ᵀ\n", ""),
    ("acc[0] = -tree.gravity", "acc[0] = tree.gravity"),
]
MISTAKES = {
    "rnea.md": (
        "def rnea(",
        "tau, vel, acc, alone, f = rnea(Tree(arm, q), v, a)\nper_link(vel",
        RNEA,
    ),
    "rnea.md#three-links": ("def rnea(", "rnea(tree3, np.array([1.0, 2.0, -1.0]), rest)", RNEA),
    "crba.md": (
        "def composite(",
        "arm = planar_arm([1.0, 1.0], [3.0, 2.0])",
        [
            ("        I[tree.parent[i]] += tree.up[i].T @ I[i] @ tree.up[i]\n", "        pass\n"),
            ("F, j = tree.up[j].T @ F, tree.parent[j]", "F, j = F, tree.parent[j]"),
        ],
    ),
    "aba.md": (
        "def articulated(",
        "q = np.array([0.3, 0.9])",
        [
            ("p[i] + Ia @ c[i] + ", "p[i] + "),
            ("p[i] + Ia @ c[i]", "Ia @ c[i]"),
            ("p[i] + Ia @ c[i]", "p[i] + IA[i] @ c[i]"),
            ("p[i] = cross_dual(vel[i]) @ tree.I[i] @ vel[i]", "p[i] = 0.0"),
            (" + U[i] @ np.linalg.solve(D[i], u[i])", ""),
            ("IA[i] - U[i] @ np.linalg.solve(D[i], U[i].T)", "IA[i]"),
            ("        p[parent] += up.T @ pa\n", ""),
            ("        IA[parent] += up.T @ Ia @ up\n", ""),
            ("tree.up[i] @ acc[tree.parent[i]] + c[i]", "tree.up[i] @ acc[tree.parent[i]]"),
            ("u[i] - U[i].T @ before", "u[i]"),
        ],
    ),
    "exercises.md": ("def rnea(", "arm = planar_arm([0.5, 0.3], [2.0, 1.0])", RNEA),
    "exercises.md#seven-joints": (
        "def rnea_with_forces(",
        'condyle.ModelBuilder("seven joints")',
        [
            (" - f_ext[i]", ""),
            (" - f_ext[i]", " + f_ext[i]"),
            (" + cross(vel[i]) @ vJ", ""),
            (" + cross_dual(vel[i]) @ tree.I[i] @ vel[i]", ""),
            ("        f[tree.parent[i]] += tree.up[i].T @ f[i]\n", ""),
        ],
    ),
    "exercises.md#three-ways": (
        "def by_energy(",
        "slopes = [by_energy(",
        [
            ("m[k] * J.T @ J + ", ""),
            (" + m[k] * L[k] ** 2 / 12 * np.outer(turned, turned)", ""),
            ("        V += m[k] * g * sum(l * np.sin(t) for l, t in zip(lengths, angles))\n", ""),
            ("[*L[:k], L[k] / 2]", "[*L[:k], L[k]]"),
        ],
    ),
    "exercises.md#own-rnea": (
        "def own_rnea(",
        "(q, v, a, _), bodies = random_state(arm7)",
        [
            (" + np.cross(w[p], np.cross(w[p], r))", ""),
            (" + np.cross(R[i].T @ w[p], e * v[i - 1])", ""),
            (" + np.cross(w[i], inertia[i] @ w[i])", ""),
            (" + np.cross(w[i], np.cross(w[i], com[i]))", ""),
            (" + np.cross(place[i][:3, 3], up)", ""),
        ],
    ),
    "complexity.md": (
        "def uicker_kahn(",
        "tau, count = uicker_kahn(",
        [
            (" * v[k - 1] * v[l - 1]", " * v[k - 1]"),
            ("min(k, l), max(k, l)", "max(k, l), min(k, l)"),
            ("np.trace(about) / 2 * np.eye(3) - about", "about"),
            ("body.mass * g @ along", "0 * g @ along"),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("example", MISTAKES)
def test_examples_detect_mistakes(example: str) -> None:
    """Checks that the assertions of a worked example fail if a term of the example's algorithm is wrong or left out."""
    chapter = example.partition("#")[0]
    definition, begins, mistakes = MISTAKES[example]
    text = (ROOT / "docs" / chapter).read_text()
    pages = [text, *((ROOT / "docs" / page).read_text() for page in ("rnea.md",) if definition not in text)]
    [defining] = [block.code for page in pages for block in BOOK.blocks(page) if definition in block.code]
    [shown] = [block for block in BOOK.blocks(text) if begins in block.code]
    helpers = BOOK.run(chapter)

    def fails(code: str) -> bool:
        names, printed = dict(helpers), io.StringIO()
        try:
            exec(code, names)
            with contextlib.redirect_stdout(printed), np.errstate(all="ignore"):
                exec(shown.code if shown.code != defining else "", names)
        except (AssertionError, np.linalg.LinAlgError):
            return True
        return printed.getvalue() != (shown.expected or "")

    if example == "rnea.md#three-links":
        helpers |= {"q": np.array([0.0, np.pi / 4, -np.pi / 4])}
    if chapter == "aba.md":
        helpers |= {"v": np.array([1.0, 2.0]), "tau": np.array([5.0, 3.0])}
        helpers["arm"] = helpers["planar_arm"]([1.0, 0.8], [2.0, 1.0])
    assert not fails(defining)
    for right, wrong in mistakes:
        assert right in defining, right
        assert fails(defining.replace(right, wrong)), f"{chapter}: {right!r} as {wrong!r} passes"


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("p[i] + Ia @ c[i]", "p[i] + IA[i] @ c[i]"),
        ("p[i] = cross_dual(vel[i]) @ tree.I[i] @ vel[i]", "p[i] = 0.0"),
    ],
)
def test_mistakes_of_aba_have_the_size_that_the_page_says(right: str, wrong: str) -> None:
    text = (ROOT / "docs" / "aba.md").read_text()
    [defining] = [block.code for block in BOOK.blocks(text) if "def articulated(" in block.code]
    names = BOOK.run("aba.md")
    exec(defining.replace(right, wrong), names)
    arm = names["planar_arm"]([1.0, 0.8], [2.0, 1.0])
    found = names["aba"](names["Tree"](arm, np.array([0.3, 0.9])), np.array([1.0, 2.0]), np.array([5.0, 3.0]))
    assert f"({found[0]:.4f}, {found[1]:.4f})" in " ".join(text.split())
