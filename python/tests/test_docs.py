"""Tests that the examples in docstrings run, and that the stubs match the extension module."""

import doctest
import inspect
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
import condyle.pinocchio
from condyle import _condyle

README = Path(__file__).parents[1] / "README.md"
GLOBALS = {"condyle": condyle, "np": np}


def members() -> Iterator[tuple[str, Any]]:
    """Yields the package, its modules, and the functions, classes and members of classes of the extension module."""
    yield "condyle", condyle
    yield from (
        (name, item) for name, item in vars(condyle).items() if name in condyle.__all__ and inspect.ismodule(item)
    )
    for name in _condyle.__all__:
        item = getattr(_condyle, name)
        if callable(item):
            yield name, item
        if inspect.isclass(item):
            yield from ((f"{name}.{k}", getattr(item, k)) for k in sorted(vars(item)) if not k.startswith("_"))


@pytest.mark.parametrize(("name", "item"), list(members()))
def test_examples(name: str, item: Any) -> None:
    test = doctest.DocTestParser().get_doctest(inspect.getdoc(item) or "", dict(GLOBALS), name, None, None)
    runner = doctest.DocTestRunner()
    runner.run(test)
    assert runner.failures == 0


@pytest.mark.parametrize(("name", "item"), list(members()))
def test_everything_is_documented(name: str, item: Any) -> None:
    assert inspect.getdoc(item), name


def test_readme() -> None:
    results = doctest.testfile(str(README), module_relative=False, globs=dict(GLOBALS), encoding="utf-8")
    assert results.attempted > 10
    assert results.failed == 0


def test_stubs_are_up_to_date() -> None:
    script = Path(__file__).parents[1] / "stubs.py"
    run = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr


def test_version_and_names() -> None:
    assert condyle.__version__ == _condyle.__version__
    modules = [getattr(condyle, name) for name in condyle.__all__ if inspect.ismodule(getattr(condyle, name))]
    public = {name for module in (condyle, *modules) for name in module.__all__} | vars(condyle.pinocchio).keys()
    assert {name for name in _condyle.__all__ if not name.startswith("_")} <= public
