"""Tests functions of the book for robots of example-robot-data: the identities in `factorisation.md`, and the sizes of
subtrees."""

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from test_robots import NO_URDF, ROBOTS, SINGULAR, root_joint, urdf_path

import condyle

EXACT = 1e-11
"""Tolerance relative to the largest entry, which allows several thousand rounding errors."""
INVERSE = 1e-9
"""Tolerance of results that contain a division by pivots. The ratio of the largest to the smallest pivot is at most
1e7, except for icub."""
SEMIDEFINITE = 1e-11
"""Largest eigenvalue that counts as zero, relative to the largest entry."""
NOT_PHYSICAL = {"icub", "icub_reduced"}
"""Names of robots with physically impossible inertias, whose pivots lose 11 digits."""


def chapter(name: str) -> dict[str, Any]:
    """Returns the functions that a chapter of the book defines."""
    path = Path(__file__).parents[3] / "docs" / "run.py"
    spec = importlib.util.spec_from_file_location("run", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    names: dict[str, Any] = module.run(name)
    return names


@pytest.fixture(scope="module")
def book() -> dict[str, Any]:
    return chapter("factorisation.md")


@pytest.mark.parametrize("name", [name for name in ROBOTS if name not in NO_URDF and name not in SINGULAR])
def test_one_factorisation(book: dict[str, Any], name: str) -> None:
    model = condyle.Model.from_urdf(urdf_path(name), root_joint=root_joint(name))
    rng = np.random.default_rng(0)
    armature = rng.uniform(0.1, 1.0, model.nv) * (rng.random(model.nv) < 0.5)
    for kind, first in zip(model.joint_types, model.idx_vs, strict=True):
        if kind == "free_flyer":
            armature[first : first + 3] = armature[first]  # linear armature must be the same in all directions
    found = book["identities"](model.with_armature(armature), condyle.random_configuration(model, seed=0))
    assert len(found) == 6
    for identity, value in found.items():
        if "⪯" in identity:
            assert value > -SEMIDEFINITE, identity
        elif "Ψ" in identity or "pivots" in identity:
            assert value < (1e-4 if name in NOT_PHYSICAL else INVERSE), identity
        else:
            assert value < EXACT, identity


def test_sizes_of_subtrees() -> None:
    nv_subtree = chapter("conversions.md")["nv_subtree"]
    for build in (pinocchio.buildSampleModelHumanoid, pinocchio.buildSampleModelManipulator):
        theirs = build()
        model = condyle.Model.from_pinocchio(theirs)
        assert model.parents[1:] == list(theirs.parents)[1:]
        assert nv_subtree(model)[1:] == list(theirs.createData().nvSubtree)[1:]
