"""Tests of distances between shapes: arrays, gradients, moving obstacles, files, errors."""

from pathlib import Path

import numpy as np
import pytest

import condyle
from condyle.distances import Collisions, DistancePairs, Geometry, Shape, distances
from condyle.optimal import Activation, Cost, FreeDynamics, Problem, ProblemError, Residual

ARM = condyle.robots.arm7()
# Tolerance of sums of a few products, and of central differences with a step of 1e-6.
ROUNDING, DIFFERENCES = 1e-12, 1e-7

SHAPES = [
    Shape.sphere([0.0, 0.1, 0.0], 0.1),
    Shape.capsule([0.0, 0.0, -0.1], [0.1, 0.0, 0.2], 0.05),
    Shape.box([0.1, 0.2, 0.05]),
    Shape.cylinder(0.1, 0.2),
    Shape.ellipsoid([0.1, 0.2, 0.05]),
    Shape.half_space([0.0, 0.6, 0.8], -0.5),
]


def pose(x: float, y: float, z: float) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]]
    X[:3, 3] = x, y, z
    return X


def test_gradients_are_differences() -> None:
    rng, data = np.random.default_rng(1), condyle.Data(ARM)
    moving = [Geometry(shape, "tool", pose(0.0, 0.1, 0.2)) for shape in SHAPES[:5]]
    fixed = [Geometry(shape, None, pose(0.5, -0.2, 0.3)) for shape in SHAPES]
    pairs = DistancePairs(ARM, [(a, b) for a in moving for b in fixed])
    q, step = rng.uniform(-1.0, 1.0, 7), 1e-6
    found = distances(pairs, ARM, data, q)
    assert found.distance.shape == (30,) and found.points.shape == (30, 2, 3) and found.normal.shape == (30, 3)
    away = found.points[:, 0] - found.points[:, 1]
    assert np.allclose(away, found.distance[:, None] * found.normal, atol=ROUNDING)
    states = np.concatenate([q + step * np.eye(7), q - step * np.eye(7)])
    both = distances(pairs, ARM, data, states, gradient=False)
    assert both.gradient is None and both.distance.shape == (14, 30)
    difference = (both.distance[:7] - both.distance[7:]).T / (2 * step)
    assert found.gradient is not None and np.abs(found.gradient - difference).max() < DIFFERENCES
    assert {kind for _, _, kind in pairs.replacements} == {"cylinder", "ellipsoid"}


def test_obstacles_move_and_far_pairs_are_bounds() -> None:
    data, q = condyle.Data(ARM), np.zeros(7)
    tool = condyle.frame_placement(ARM, data, q, "tool")
    ball = Geometry(Shape.sphere([0.0, 0.0, 0.0], 0.1), name="ball")
    pairs = DistancePairs(ARM, [(Geometry(Shape.box([0.1, 0.1, 0.1]), "tool"), ball)])
    away = np.eye(4)
    away[:3, 3] = tool[:3, 3] + [0.0, 0.5, 0.0]
    pairs.place("ball", away)
    near = distances(pairs, ARM, data, q)
    assert abs(near.distance[0] - 0.3) < ROUNDING
    pairs.cutoff = 0.1
    far = distances(pairs, ARM, data, q)
    assert 0.1 < far.distance[0] < 0.3 and far.gradient is not None and not far.gradient.any()
    with pytest.raises(ValueError, match="no geometry is named 'bal'"):
        pairs.place("bal", away)
    with pytest.raises(ValueError, match="expected a rotation"):
        pairs.place("ball", away @ np.diag([2.0, 2.0, 2.0, 1.0]))


def test_residuals_take_geometries() -> None:
    q = np.array([0.1, 0.7, 0.2, 1.1, -0.3, 0.4, 0.2])
    pair = (Geometry(SHAPES[1], "tool"), Geometry(SHAPES[2], None, pose(0.3, 0.2, 0.5)))
    found = distances(DistancePairs(ARM, [pair]), ARM, condyle.Data(ARM), q)
    x = np.r_[q, np.zeros(7)]
    cost = Cost("sum", 1.0, Residual.distances(ARM, [pair]), Activation.sum())
    problem = Problem(x, [FreeDynamics(ARM, 0.1, [])], [0], FreeDynamics(ARM, None, [cost]))
    xs, us = np.tile(x, (2, 1)), np.zeros((1, 7))
    assert abs(problem.evaluate(xs, us).cost - found.distance[0]) < ROUNDING
    assert found.gradient is not None
    assert np.abs(problem.derivatives(xs, us)[1].q[:7] - found.gradient[0]).max() < ROUNDING


MJCF = """<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="a" pos="0 0 1"><joint/>
  <geom name="arm" type="capsule" size="0.1" fromto="0 0 0 1 0 0"/><geom type="mesh" mesh="m" name="hull"/>
  <body name="b" pos="1 0 0"><joint/><geom name="hand" size="0.2"/></body></body></worldbody>
  <asset><mesh name="m" file="hull.stl"/></asset></mujoco>"""


def test_shapes_of_files(tmp_path: Path) -> None:
    (tmp_path / "robot.xml").write_text(MJCF)
    collisions = Collisions.from_file(tmp_path / "robot.xml")
    assert [(g.name, g.frame, g.shape.kind) for g in collisions.geometries] == [
        ("floor", "world", "half_space"),
        ("arm", "a", "capsule"),
        ("hand", "b", "sphere"),
    ]
    assert collisions.meshes == [("hull", "a", "hull.stl")] and "`hull.stl`" in collisions.warnings[0]
    assert collisions.fit_meshes() == 0 and "hull.stl" in collisions.warnings[0]
    model = condyle.Model.from_mjcf_str(MJCF, weightless_meshes=True)
    pairs = collisions.pairs(model)
    assert [(a.name, b.name) for a, b in pairs] == [("floor", "arm"), ("floor", "hand")]
    found = distances(DistancePairs(model, pairs), model, condyle.Data(model), condyle.neutral(model))
    assert np.allclose(found.distance, [0.9, 0.8], atol=ROUNDING)
    collisions.disable("world", "b")
    assert len(collisions.pairs(model)) == 1


def test_wrong_shapes_are_errors() -> None:
    ball = Geometry(Shape.sphere([0.0, 0.0, 0.0], 0.1))
    with pytest.raises(condyle.ModelError, match=r"pairs\[0\] \(sphere in the world and .*\): has no frame"):
        DistancePairs(ARM, [(ball, ball)])
    with pytest.raises(condyle.ModelError, match=r"pairs\[0\].first \(`tip`\): radius is -1"):
        DistancePairs(ARM, [(Geometry(Shape.sphere([0.0, 0.0, 0.0], -1.0), "tool", name="tip"), ball)])
    with pytest.raises(ValueError, match=r"center: expected shape \(3,\), found \(2,\)"):
        Shape.sphere([0.0, 0.0], 0.1)
    pairs = DistancePairs(ARM, [(Geometry(SHAPES[0], "tool"), ball)])
    with pytest.raises(ValueError, match=r"q: expected shape \(7,\) or \(N, 7\), found \(6,\)"):
        distances(pairs, ARM, condyle.Data(ARM), np.zeros(6))
    slanted = np.eye(4)
    slanted[3, 0] = 0.5
    last_row = r"placement: expected the last row \(0, 0, 0, 1\), found \[0.5, 0.0, 0.0, 1.0\]"
    with pytest.raises(ValueError, match=last_row):
        DistancePairs(ARM, [(Geometry(SHAPES[0], "tool", slanted), ball)])
    named = DistancePairs(ARM, [(Geometry(SHAPES[0], "tool"), ball._replace(name="ball"))])
    with pytest.raises(ValueError, match=last_row):
        named.place("ball", slanted)
    with pytest.raises(condyle.ModelError, match="link `nope`: has no collision shapes"):
        Collisions.from_text(MJCF).disable("a", "nope")
    other = condyle.robots.quadruped()
    with pytest.raises(ValueError, match="made for another model"):
        distances(pairs, other, condyle.Data(other), condyle.neutral(other))


def test_ambiguous_pairs_are_errors() -> None:
    tip = Geometry(SHAPES[0], "tool", name="tip")
    crate = Geometry(SHAPES[2], None, pose(0.3, 0.2, 0.5), "crate")
    elbow = Geometry(SHAPES[1], "link4", name="elbow")

    def refused(pairs: list[tuple[Geometry, Geometry]], message: str) -> None:
        with pytest.raises(condyle.ModelError, match=message):
            DistancePairs(ARM, pairs)
        with pytest.raises(ProblemError, match=message):
            FreeDynamics(ARM, None, [Cost("apart", 1.0, Residual.distances(ARM, pairs))])

    text = r"pairs\[1\].second \(`crate`\): has the name of pairs\[0\].second, but another "
    refused([(tip, crate), (elbow, crate._replace(shape=SHAPES[0]))], text + "shape")
    refused([(tip, crate), (elbow, crate._replace(placement=None))], text + "placement")
    refused([(tip, tip)], r"pairs\[0\] \(`tip` and `tip`\): is a geometry with itself")
    refused([(tip, crate), (crate, tip)], r"pairs\[1\] \(`crate` and `tip`\): is the same pair as pairs\[0\]")
    palm = Geometry(SHAPES[1], "tool", name="palm")
    refused([(tip, palm)], r"pairs\[0\] \(`tip` and `palm`\): has two geometries of the body")
    flat = Geometry(SHAPES[5], "tool")
    refused([(flat, Geometry(SHAPES[5]))], "has two half-spaces")
    with pytest.raises(ValueError, match="half_sizes of a box: expected finite numbers, found nan"):
        DistancePairs(ARM, [(tip, Geometry(Shape.box([0.1, np.nan, 0.1])))])
    for index in (-1, 99):
        with pytest.raises(IndexError, match=f"frame: expected an index below {len(ARM.frames)}, found {index}"):
            DistancePairs(ARM, [(Geometry(SHAPES[0], index), crate)])


def test_an_obstacle_that_a_capsule_replaces_moves_in_all_pairs() -> None:
    data, q = condyle.Data(ARM), np.full(7, 0.3)
    can = Geometry(Shape.cylinder(0.1, 0.2), name="can")
    parts = [Shape.sphere([0.0, 0.0, 0.0], 0.05), Shape.box([0.03, 0.03, 0.03])]
    pairs = DistancePairs(ARM, [(Geometry(part, "tool"), can) for part in parts])
    assert pairs.replacements == [(1, 1, "cylinder")]
    above = np.eye(4)
    above[:3, 3] = condyle.frame_placement(ARM, data, q, "tool")[:3, 3] + [0.0, 0.0, 3.0]
    pairs.place("can", above)
    found = distances(pairs, ARM, data, q).distance
    assert abs(found[0] - 2.75) < ROUNDING and 2.6 < found[1] < 2.7
