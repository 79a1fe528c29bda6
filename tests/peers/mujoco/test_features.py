"""Robots with one feature each, from MuJoCo's own schema: no feature with an effect is ignored silently."""

import collections
import itertools

import features
import pytest

CASES = {path: list(cases) for path, cases in itertools.groupby(features.cases(), lambda case: case[0].split(" ")[0])}


@pytest.mark.parametrize("path", CASES)
def test_features(path: str) -> None:
    """Each attribute of an element is held as in MuJoCo, has no effect, gives a warning, or is rejected."""
    verdicts: dict[str, list[str]] = collections.defaultdict(list)
    for name, base, text in CASES[path]:
        kind, what = features.verdict(base, text)
        verdicts[kind].append(f"{name}: {what}")
    wrong = [line for kind in ("silent", "wrong", "broken") for line in verdicts[kind]]
    assert not wrong, "\n".join(wrong)
    assert verdicts.keys() - {"invalid"}, f"{path}: MuJoCo refuses all of it"
