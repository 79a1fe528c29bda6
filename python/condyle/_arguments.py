"""Checks of arguments. Each error names the argument, what was expected and what was found."""

import operator
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

_LONGEST = 60
"""Maximum number of characters of a value in an error message."""


def described(value: Any) -> str:
    """Returns a short description of a value, for error messages."""
    if value is None or isinstance(value, (bool, int, float, complex)):
        return repr(value)
    if isinstance(value, str):
        return repr(value if len(value) <= _LONGEST else value[:_LONGEST] + "…")
    if isinstance(value, type):
        return f"the class {value.__name__}"
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple):
        return f"an array of the shape {tuple(shape)}"
    name = type(value).__name__
    article = "an" if name[0].lower() in "aeio" else "a"
    return f"{article} {name}"


def reals(argument: str, values: Any, expected: str = "real numbers") -> NDArray[np.float64]:
    """Returns real numbers as an array of floats, without a copy if possible. NaN and infinity are allowed."""
    if values is None or isinstance(values, (str, bytes, Mapping, Iterator, set, type)):
        raise TypeError(f"{argument}: expected {expected}, found {described(values)}")
    try:
        found = np.asarray(values)
    except ValueError:
        raise ValueError(f"{argument}: expected {expected}, found rows of different shapes") from None
    if found.dtype.kind == "c":
        raise TypeError(f"{argument}: expected real numbers, found complex ones")
    if found.dtype.kind not in "biufO":
        raise TypeError(f"{argument}: expected {expected}, found entries of the type {found.dtype}")
    try:
        return np.asarray(found, float)
    except (TypeError, ValueError):
        raise TypeError(f"{argument}: expected {expected}, found {described(values)} of other objects") from None


def integer(argument: str, value: Any, least: int) -> int:
    """Returns an integer that is at least `least`."""
    try:
        found = operator.index(value)
    except TypeError:
        raise TypeError(f"{argument}: expected an integer, found {described(value)}") from None
    if found < least:
        raise ValueError(f"{argument}: expected at least {least}, found {found}")
    return found


def words(argument: str, values: Any, allowed: tuple[str, ...]) -> tuple[str, ...]:
    """Returns a sequence of words, each of which is allowed."""
    options = f"{', '.join(map(repr, allowed[:-1]))} and {allowed[-1]!r}"
    if isinstance(values, str) or not isinstance(values, (list, tuple, set, frozenset)):
        raise TypeError(f"{argument}: expected a list of some of {options}, found {described(values)}")
    if not all(isinstance(value, str) and value in allowed for value in values):
        raise ValueError(f"{argument}: expected some of {options}, found {list(values)!r}")
    return tuple(values)


def named(argument: str, values: Any, contents: str) -> dict[str, Any]:
    """Returns a mapping from names to `contents` as a dict; None is an empty dict."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        raise TypeError(f"{argument}: expected a dict from names to {contents}, found {described(values)}")
    for name in values:
        if not isinstance(name, str):
            raise TypeError(f"{argument}: expected names as keys, found {described(name)}")
    return dict(values)


def instance(argument: str, value: Any, kind: type) -> None:
    """Raises an error unless a value is an instance of a class."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIO" else "a"
        raise TypeError(f"{argument}: expected {article} {kind.__name__}, found {described(value)}")
