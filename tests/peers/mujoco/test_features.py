"""Tests robots with one feature each, from MuJoCo's own schema. No feature with an effect may be ignored without a
warning."""

import collections
import itertools

import features
import pytest

CASES = {path: list(cases) for path, cases in itertools.groupby(features.cases(), lambda case: case[0].split(" ")[0])}


@pytest.mark.parametrize("path", CASES)
def test_features(path: str) -> None:
    """Tests that each attribute of an element has the same effect as in MuJoCo, has no effect, gives a warning, or is
    rejected."""
    verdicts: dict[str, list[str]] = collections.defaultdict(list)
    for name, base, text in CASES[path]:
        kind, what = features.verdict(base, text)
        verdicts[kind].append(f"{name}: {what}")
    wrong = [line for kind in ("silent", "wrong", "broken") for line in verdicts[kind]]
    assert not wrong, "\n".join(wrong)
    assert verdicts.keys() - {"invalid"}, f"{path}: MuJoCo refuses all of it"
