"""Tests of pictures: the pattern of zeros of the tree, plots, shapes, and the contents of the page that shows a
motion.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle import viz
from condyle._shapes import capsule, capsules, mesh_path, visuals
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual

URDF = """<robot name="shapes"><material name="red"><color rgba="1 0 0 1"/></material>
<link name="base"/><link name="upper"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0"
 iyz="0"/></inertial>
<visual><origin xyz="0 0 0.1" rpy="0 1.5707963267948966 0"/><geometry><box size="0.2 0.4 0.6"/></geometry>
<material name="red"/></visual>
<visual><geometry><cylinder radius="0.1" length="0.5"/></geometry></visual>
<visual><geometry><sphere radius="0.1"/></geometry></visual>
<visual><geometry><mesh filename="package://nowhere/at_all.stl"/></geometry></visual></link>
<link name="lower"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="package://shapes/mesh.stl" scale="2 2 2"/></geometry></visual></link>
<joint name="one" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="two" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Returns the volume inside triangles that are anticlockwise when seen from outside: Σ a·(b × c)/6."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize("name", ["arm7", "quadruped", "humanoid"])
def test_the_pattern_is_that_of_the_inertia_matrix(name: str) -> None:
    model = getattr(condyle.robots, name)()
    data = condyle.Data(model)
    M = sum(np.abs(condyle.crba(model, data, condyle.random_configuration(model, seed=k))) for k in range(5))
    predicted = viz.pattern(model)
    assert not M[~predicted].any()
    assert (predicted == predicted.T).all()
    # entries that may be nonzero are nonzero, except a few that are zero by symmetries of the robot
    assert (M[predicted] > 0.0).mean() > 0.9


def test_the_pattern_of_joints_that_follow() -> None:
    model = condyle.robots.quadruped().with_mimic("RF_KFE", "LF_KFE", -1.0)
    data = condyle.Data(model)
    M = sum(np.abs(condyle.crba(model, data, condyle.random_configuration(model, seed=k))) for k in range(5))
    assert not M[~viz.pattern(model)].any()
    left, right = (model.idx_vs[model.joint(name)] for name in ("LF_KFE", "RF_HFE"))
    assert viz.pattern(model)[left, right]  # a mimic joint: the knee of one leg also moves the other leg


@pytest.fixture(scope="module")
def solved() -> tuple[condyle.Model, Any]:
    arm = condyle.robots.arm7()
    x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    reach = Cost("reach", 1e2, Residual.frame_translation(arm, "tool", [0.35, 0.2, 0.6]))
    costs = [Cost("effort", 1e-3, Residual.control(np.zeros(7))), Cost("rest", 1e-2, Residual.state(x0))]
    problem = Problem(x0, [FreeDynamics(arm, 0.05, costs)], [0] * 20, FreeDynamics(arm, None, [reach]))
    return arm, Fddp(problem).solve(np.tile(x0, (21, 1)), np.zeros((20, 7)))


@pytest.fixture
def plots() -> Iterator[Any]:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    yield matplotlib
    matplotlib.pyplot.close("all")


def test_plot(plots: Any, solved: tuple[condyle.Model, Any], tmp_path: Path) -> None:
    arm, solution = solved
    figure = viz.plot(solution, arm, 0.05)
    q, v, u, trace = figure.axes
    assert np.array_equal(q.lines[3].get_ydata(), solution.xs[:, 3])
    assert np.array_equal(v.lines[2].get_ydata(), solution.xs[:, 9])
    assert np.array_equal(u.lines[6].get_ydata(), solution.us[:, 6])
    assert q.lines[0].get_xdata()[-1] == pytest.approx(1.0)
    assert q.lines[4].get_label() == u.lines[4].get_label() == "joint5"
    assert np.array_equal(trace.lines[0].get_ydata(), [one.cost for one in solution.trace])
    figure.savefig(tmp_path / "plot.png")
    assert viz.plot(solution, arm).axes[2].get_xlabel() == "knot"
    with pytest.raises(ValueError, match="expected states of 37 numbers"):
        viz.plot(solution, condyle.robots.quadruped())


def test_spy(plots: Any) -> None:
    model = condyle.robots.quadruped()
    data, q = condyle.Data(model), condyle.random_configuration(condyle.robots.quadruped(), seed=1)
    M = condyle.crba(model, data, q)
    there, tree = viz.spy(M, model).axes
    assert np.array_equal(there.images[0].get_array(), np.abs(M) > 1e-12 * np.abs(M).max())
    assert np.array_equal(tree.images[0].get_array(), viz.pattern(model))
    assert len(there.lines[0].get_xdata()) == 0
    inverse = viz.spy(condyle.minv(model, data, q), model).axes[0]
    assert len(inverse.lines[0].get_xdata()) > 0  # legs influence each other through the trunk
    with pytest.raises(ValueError, match=r"M: expected shape \(18, 18\), found \(7, 7\)"):
        viz.spy(np.eye(7), model)


def test_capsules_join_the_joints() -> None:
    assert volume(*capsule(0.1, 1.0, 64, 32)) == pytest.approx(np.pi * 0.01 * (1.0 + 0.4 / 3.0), rel=5e-3)
    model = condyle.robots.humanoid()
    shapes = capsules(model)
    thick = -shapes[0].vertices[:, 2].min()
    long = {body for body in range(1, model.nbodies) if any(np.linalg.norm(end) > thick for end in _ends(model, body))}
    assert len(long) > 15
    assert {shape.body for shape in shapes} == long
    for shape in shapes:  # the far end of each shape is at the origin of a joint or a link frame of the body
        radius = -shape.vertices[:, 2].min()
        end = shape.placement[:3, 2] * (shape.vertices[:, 2].max() - radius)
        assert min(np.linalg.norm(end - other) for other in _ends(model, shape.body)) < 1e-12


def _ends(model: condyle.Model, body: int) -> list[np.ndarray]:
    joints = [model.joint_placements[k][:3, 3] for k in range(1, model.nbodies) if model.parents[k] == body]
    return joints + [frame.placement[:3, 3] for frame in model.frames if frame.body == body]


def test_shapes_of_a_urdf(tmp_path: Path) -> None:
    path = tmp_path / "shapes.urdf"
    path.write_text(URDF, encoding="utf-8")
    model = condyle.Model.from_urdf(path)
    shapes = visuals(model, path, [])
    box, cylinder, ball, *others = shapes
    assert box.body == 1 and box.color == (255, 0, 0) and box.placement[2, 3] == 0.1
    np.testing.assert_allclose(box.placement[:3, 0], [0.0, 0.0, -1.0], atol=1e-15)
    np.testing.assert_allclose(np.ptp(box.vertices, axis=0), [0.2, 0.4, 0.6])
    assert volume(box.vertices, box.faces) == pytest.approx(0.048)
    assert volume(cylinder.vertices, cylinder.faces) == pytest.approx(np.pi * 0.005, rel=0.01)
    assert volume(ball.vertices, ball.faces) == pytest.approx(4e-3 * np.pi / 3.0, rel=0.03)
    assert {shape.body for shape in others} <= {2}  # the mesh file is missing
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box([0.1, 0.1, 0.1]).export(tmp_path / "mesh.stl")
    assert mesh_path("mesh.stl", path, []) == tmp_path / "mesh.stl"
    assert mesh_path("package://shapes/mesh.stl", path, [tmp_path]) is None
    folder = tmp_path / "packages" / "shapes"
    folder.mkdir(parents=True)
    (tmp_path / "mesh.stl").rename(folder / "mesh.stl")
    *_, mesh = visuals(model, path, [tmp_path / "packages"])
    assert mesh.body == 2
    np.testing.assert_allclose(mesh.mesh.extents, [0.2, 0.2, 0.2])


def test_playback() -> None:
    pytest.importorskip("viser")
    model = condyle.robots.quadruped()
    q = np.tile(condyle.neutral(model), (11, 1))
    q[:, 2], q[:, 8] = np.linspace(0.4, 0.6, 11), np.linspace(0.0, 1.0, 11)
    forces = [{"LF_foot": [0.0, 0.0, 100.0], "RH_foot": [10.0, 0.0, 50.0, 1.0, 1.0, 1.0]}] * 5 + [{}] * 6
    player = viz.play(model, q, 0.01, forces, newtons_per_metre=200.0, port=18_080)
    try:
        poses = condyle.forward_kinematics(model, condyle.Data(model), q)
        for knot in (0, 3, 99):
            player.show(knot)
            shown = min(knot, 10)
            assert player.knot == shown
            for body, pose in zip(player.bodies, poses[shown], strict=True):
                np.testing.assert_allclose(body.position, pose[:3, 3])
                w, x, y, z = body.wxyz
                np.testing.assert_allclose(1.0 - 2.0 * (y * y + z * z), pose[0, 0], atol=1e-12)
                np.testing.assert_allclose(2.0 * (x * z - w * y), pose[2, 0], atol=1e-12)
            if knot == 3:
                assert player.arrows.visible
                foot = condyle.frame_placement(model, condyle.Data(model), q[3], "LF_foot")[:3, 3]
                np.testing.assert_allclose(player.arrows.points[0], [foot, foot + np.array([0.0, 0.0, 0.5])], atol=1e-6)
        assert not player.arrows.visible  # no foot is on the ground
        player.slider.value = 0.05
        player.show(round(player.slider.value / 0.01))
        assert player.knot == 5
        assert player.url in player._repr_html_()
        player.play()
        assert player.button.label == "pause"
        player.pause()
        assert player.button.label == "play"
    finally:
        player.close()
    with pytest.raises(ValueError, match=r"q: expected shape \(N, 19\) with N ≥ 1, found \(3, 7\)"):
        viz.play(model, np.zeros((3, 7)), 0.01)
    with pytest.raises(ValueError, match="dt: expected a positive time, found 0"):
        viz.play(model, q, 0)
    with pytest.raises(ValueError, match="expected three numbers or more for `LF_foot`"):
        viz.play(model, q, 0.01, [{"LF_foot": [1.0]}])


def test_what_is_not_installed_is_named() -> None:
    code = """
import sys
sys.modules['viser'] = sys.modules['matplotlib.pyplot'] = None
import condyle, numpy
from condyle import viz
arm = condyle.robots.arm7()
for draw in (lambda: viz.spy(numpy.eye(7), arm), lambda: viz.play(arm, numpy.zeros((2, 7)), 0.1)):
    try:
        draw()
    except ImportError as error:
        print(error)
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    expected = ["plots need matplotlib", "playback needs viser"]
    assert run.stdout.splitlines() == [f"{one}: pip install condyle[viz]" for one in expected]
