"""One-feature robots, from MuJoCo's own schema: nothing that has an effect is dropped in silence."""

import collections
import itertools

import features
import pytest

CASES = {path: list(cases) for path, cases in itertools.groupby(features.cases(), lambda case: case[0].split(" ")[0])}


@pytest.mark.parametrize("path", CASES)
def test_features(path: str) -> None:
    """Each attribute of an element is held as MuJoCo has it, is without effect, or is warned of, or refused."""
    verdicts: dict[str, list[str]] = collections.defaultdict(list)
    for name, base, text in CASES[path]:
        kind, what = features.verdict(base, text)
        verdicts[kind].append(f"{name}: {what}")
    wrong = [line for kind in ("silent", "wrong", "broken") for line in verdicts[kind]]
    assert not wrong, "\n".join(wrong)
    assert verdicts.keys() - {"invalid"}, f"{path}: MuJoCo refuses all of it"
