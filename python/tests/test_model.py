"""Tests of models: attributes, text, reading, copies and pickles."""

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest
from sample import Robot

import condyle

PENDULUM = """<robot name="pendulum">
  <link name="base"><inertial><mass value="3"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0 0 -1"/><mass value="2"/>
    <inertia ixx="0.3" ixy="0.01" ixz="0" iyy="0.2" iyz="0" izz="0.1"/></inertial></link>
  <link name="ball"><inertial><mass value="1"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
  <link name="finger"/>
  <joint name="pivot" type="revolute"><origin xyz="0 0 5"/><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" velocity="3" effort="4"/><dynamics damping="0.5" friction="0.25"/></joint>
  <joint name="tip" type="fixed"><origin xyz="0 0 -2"/><parent link="rod"/><child link="ball"/></joint>
  <joint name="slide" type="prismatic"><parent link="ball"/><child link="finger"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" velocity="1" effort="1"/><mimic joint="pivot" multiplier="0.5" offset="0.1"/></joint>
</robot>"""


def test_members() -> None:
    model = condyle.Model.from_urdf_str(PENDULUM)
    assert (model.name, model.nq, model.nv, model.nbodies) == ("pendulum", 2, 2, 3)
    assert model.names == ["universe", "pivot", "slide"]
    assert model.body_names == ["universe", "rod", "finger"]
    assert model.joint_types == ["universe", "revolute", "prismatic"]
    assert (model.parents, model.nqs, model.nvs) == ([0, 0, 1], [0, 1, 1], [0, 1, 1])
    assert (model.idx_qs, model.idx_vs) == ([0, 0, 1], [0, 0, 1])
    assert model.mimics == [None, None, None]
    assert np.array_equal(model.limits.lower, [-1, 0])
    assert np.array_equal(model.limits.upper, [2, 1])
    assert np.array_equal(model.limits.velocity, [3, 1])
    assert np.array_equal(model.limits.effort, [4, 1])
    assert np.array_equal(model.damping, [0.5, 0])
    assert np.array_equal(model.friction, [0.25, 0])
    assert np.array_equal(model.armature, [0, 0])
    assert np.array_equal(model.gravity, [0, 0, -9.81])
    assert model.total_mass == 6.0
    assert np.array_equal(model.joint_placements[:, :3, 3], [[0, 0, 0], [0, 0, 5], [0, 0, -2]])
    assert [(f.name, f.kind, f.body) for f in model.frames] == [
        ("base", "link", 0),
        ("pivot", "joint", 1),
        ("rod", "link", 1),
        ("tip", "joint", 1),
        ("ball", "link", 1),
        ("slide", "joint", 2),
        ("finger", "link", 2),
    ]
    assert np.array_equal(model.frames[4].placement[:3, 3], [0, 0, -2])
    assert (model.frame("ball"), model.joint("slide")) == (4, 2)
    with pytest.raises(condyle.ModelError, match="^unknown joint `slid`; nearest is `slide`$"):
        model.joint("slid")


def test_inertias() -> None:
    world, rod, finger = condyle.Model.from_urdf_str(PENDULUM).inertias
    assert (world.mass, rod.mass, finger.mass) == (3.0, 3.0, 0.0)
    np.testing.assert_allclose(rod.com, [0, 0, -4 / 3], atol=1e-15)
    # two masses, 2 kg at −1 and 1 kg at −2, give 6 kg m² about the axis and 2/3 kg m² about their common centre
    np.testing.assert_allclose(rod.rotational, [[6.3, 0.01, 0], [0.01, 6.2, 0], [0, 0, 0.1]], atol=1e-14)
    np.testing.assert_allclose(rod.about_com, [[0.3 + 2 / 3, 0.01, 0], [0.01, 0.2 + 2 / 3, 0], [0, 0, 0.1]], atol=1e-14)
    assert np.array_equal(finger.com, [0, 0, 0])


def test_mimic() -> None:
    model = condyle.Model.from_urdf_str(PENDULUM, mimic=True)
    assert (model.nq, model.nv) == (1, 1)
    assert model.mimics == [None, None, condyle.Mimic(ratio=0.5, offset=0.1)]
    assert (model.nqs, model.idx_qs, model.idx_vs) == ([0, 1, 0], [0, 0, 0], [0, 0, 0])
    finger = condyle.frame_placement(model, condyle.Data(model), [0.0], "finger")
    np.testing.assert_allclose(finger[:3, 3], [0.1, 0, 3])


@pytest.mark.parametrize(
    ("root_joint", "nq", "nv"),
    [(None, 2, 2), ("free_flyer", 9, 8), ("planar", 6, 5), ("spherical", 6, 5), ("translation", 5, 5)],
)
def test_root_joints(root_joint: str | None, nq: int, nv: int) -> None:
    model = condyle.Model.from_urdf_str(PENDULUM, root_joint)  # type: ignore[arg-type]
    assert (model.nq, model.nv) == (nq, nv)
    assert model.joint_types[1] == (root_joint or "revolute")


def test_files(tmp_path: Path) -> None:
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM, encoding="utf-8")
    assert condyle.Model.from_urdf(path).names == condyle.Model.from_urdf(str(path)).names
    with pytest.raises(condyle.ParseError, match=r"missing\.urdf: "):
        condyle.Model.from_urdf(tmp_path / "missing.urdf")


def test_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)
    folder = tmp_path / "pendulum_description" / "urdf"
    folder.mkdir(parents=True)
    (folder / "pendulum.urdf").write_text(PENDULUM, encoding="utf-8")
    (folder.parent / "package.xml").write_text("<package/>", encoding="utf-8")
    address = "package://pendulum_description/urdf/pendulum.urdf"
    assert condyle.Model.from_urdf(address, packages=[tmp_path]).name == "pendulum"
    assert condyle.Model.from_urdf(address, packages=[str(folder.parent)]).name == "pendulum"
    with pytest.raises(condyle.ParseError, match="pendulum_description"):
        condyle.Model.from_urdf(address)


MJCF = """<mujoco model="pendulum"><worldbody><body name="rod">
  <joint name="pivot" axis="0 1 0" damping="0.1"/><geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/>
</body></worldbody>{}</mujoco>"""


def test_mjcf(tmp_path: Path) -> None:
    text = MJCF.format("")
    model = condyle.Model.from_mjcf_str(text)
    assert (model.name, model.names, model.total_mass) == ("pendulum", ["universe", "pivot"], 2.0)
    assert model.damping == [0.1]
    path = tmp_path / "pendulum.xml"
    path.write_text(text, encoding="utf-8")
    assert condyle.Model.from_mjcf(path).names == condyle.Model.from_mjcf(str(path)).names == model.names
    with pytest.raises(condyle.ParseError, match="^<string>:2: joint `pivot`: axis: `y` is no finite number$"):
        condyle.Model.from_mjcf_str(text.replace("0 1 0", "0 y 0"))
    odd = MJCF.format('<option density="1000"/>')
    assert len(condyle.Model.from_mjcf_str(odd).warnings) == 1
    with pytest.raises(condyle.ParseError):
        condyle.Model.from_mjcf_str(odd, strict=True)


def test_mjcf_meshes() -> None:
    shapes = '<geom type="mesh" mesh="m"/><geom size="0.1" mass="1"/>'
    asset = '<asset><mesh name="m" file="m.obj"/></asset>'
    text = f'<mujoco>{asset}<worldbody><body name="a"><joint/>{shapes}</body></worldbody></mujoco>'
    with pytest.raises(condyle.ParseError):
        condyle.Model.from_mjcf_str(text)
    model = condyle.Model.from_mjcf_str(text, weightless_meshes=True)
    assert (model.total_mass, len(model.warnings)) == (1.0, 1)


def test_mjcf_mimic() -> None:
    body = '<body name="{0}"><joint name="{0}"/><geom size="0.1" mass="1"/></body>'
    equality = '<equality><joint joint1="b" joint2="a" polycoef="0.5 2 0 0 0"/></equality>'
    bodies = body.format("a") + body.format("b")
    text = f"<mujoco><worldbody>{bodies}</worldbody>{equality}</mujoco>"
    assert condyle.Model.from_mjcf_str(text).nv == 2
    model = condyle.Model.from_mjcf_str(text, mimic=True)
    assert (model.nv, model.mimics[2]) == (1, condyle.Mimic(2.0, 0.5))


SDF = """<sdf version="1.7"><model name="pendulum">
  <link name="rod"><inertial><pose>0 0 -1 0 0 0</pose><mass>2</mass>
    <inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial></link>
  <link name="bob"><inertial><mass>1</mass></inertial></link>
  <joint name="pivot" type="revolute"><parent>rod</parent><child>bob</child><axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>"""


def test_sdf(tmp_path: Path) -> None:
    model = condyle.Model.from_sdf_str(SDF, root_joint="free_flyer")
    assert (model.name, model.names) == ("pendulum", ["universe", "root_joint", "pivot"])
    assert (model.nq, model.nv, model.total_mass) == (8, 7, 3.0)
    path = tmp_path / "pendulum.sdf"
    path.write_text(SDF, encoding="utf-8")
    assert condyle.Model.from_sdf(path).names == condyle.Model.from_sdf(str(path)).names == ["universe", "pivot"]
    with pytest.raises(condyle.ParseError, match="^<string>:5: joint `pivot`: no link, joint or frame is named `bar`"):
        condyle.Model.from_sdf_str(SDF.replace(">bob<", ">bar<"))
    odd = SDF.replace("<inertial><mass>1</mass></inertial>", "")
    assert len(condyle.Model.from_sdf_str(odd).warnings) == 1
    with pytest.raises(condyle.ParseError, match="bob"):
        condyle.Model.from_sdf_str(odd, strict=True)
    with pytest.raises(ValueError, match="^root_joint: expected None, "):
        condyle.Model.from_sdf_str(SDF, root_joint="free")  # type: ignore[arg-type]


def test_sdf_mimic() -> None:
    mimic = '<mimic joint="a"><multiplier>2</multiplier><offset>0.5</offset><reference>0</reference></mimic>'
    joint = """<link name="{0}"><inertial><mass>1</mass></inertial></link><joint name="{0}j" type="revolute">
      <parent>world</parent><child>{0}</child><axis><xyz>0 0 1</xyz>{1}</axis></joint>"""
    parts = joint.format("a", "") + joint.format("b", mimic.replace('"a"', '"aj"'))
    text = f'<sdf version="1.11"><model name="two">{parts}</model></sdf>'
    assert condyle.Model.from_sdf_str(text).nv == 2
    model = condyle.Model.from_sdf_str(text, mimic=True)
    assert (model.nv, model.mimics[2]) == (1, condyle.Mimic(2.0, 0.5))


def test_errors() -> None:
    read = condyle.Model.from_urdf_str
    assert issubclass(condyle.ParseError, condyle.Error)
    assert issubclass(condyle.ModelError, condyle.Error)
    with pytest.raises(condyle.ParseError, match="^<string>:1: not well-formed XML"):
        read("<robot")
    with pytest.raises(condyle.ParseError, match="^<string>:12: joint `slide`: no link is named `bal`; nearest"):
        read(PENDULUM.replace('<parent link="ball"/>', '<parent link="bal"/>'))
    with pytest.raises(condyle.ParseError, match="^<string>:9: joint `pivot`: axis .* is no direction"):
        read(PENDULUM.replace('xyz="0 1 0"', 'xyz="0 0 0"'))
    with pytest.raises(condyle.Error):
        read(PENDULUM.replace('joint="pivot"', 'joint="slide"'), mimic=True)
    with pytest.raises(ValueError, match="^root_joint: expected None, 'free_flyer', .*, found 'free'"):
        read(PENDULUM, "free")  # type: ignore[arg-type]


def test_continuous_joints_have_limits_of_speed_and_effort_only() -> None:
    limits = condyle.Model.from_urdf_str(PENDULUM.replace('"revolute"', '"continuous"')).limits
    assert np.array_equal(limits.upper, [np.inf, np.inf, 1])
    assert np.array_equal(limits.velocity, [3, 1])
    assert np.array_equal(limits.effort, [4, 1])


ODD = PENDULUM.replace('ixx="0.3"', 'ixx="0.25"')
"""A robot whose tip has no mass; all other inertias are physical."""


def test_warnings() -> None:
    assert condyle.Model.from_urdf_str(PENDULUM).warnings[0].startswith("body `rod`: principal moments 0.96")
    model = condyle.Model.from_urdf_str(ODD)
    assert model.warnings == [
        "body `finger` moves and has no mass",
        "joint `slide` moves nothing that has inertia along it: the inertia matrix is singular",
        "<string>:12: joint `slide`: has a <mimic> of joint `pivot`: it is left free unless `mimic` is asked for",
    ]
    assert model.singular_joints == [model.joint("slide")]
    sound = condyle.Model.from_urdf_str(ODD.replace("prismatic", "fixed"), strict=True)
    assert (sound.warnings, sound.singular_joints) == ([], [])


def test_strict(tmp_path: Path) -> None:
    with pytest.raises(condyle.ParseError, match="^<string>: body `finger` moves and has no mass$"):
        condyle.Model.from_urdf_str(ODD, strict=True)
    path = tmp_path / "pendulum.urdf"
    path.write_text(ODD, encoding="utf-8")
    with pytest.raises(condyle.ParseError, match=r"pendulum\.urdf: body `finger` moves and has no mass$"):
        condyle.Model.from_urdf(path, strict=True)


def test_singular() -> None:
    """Checks that functions that need M⁻¹ raise an error if M is singular, and that all other functions work. A rotor
    makes M regular.
    """
    model = condyle.Model.from_urdf_str(PENDULUM)
    data, zero = condyle.Data(model), np.zeros(2)
    message = "^joint `slide` moves nothing that has inertia along it: the inertia matrix is singular$"
    for function in (condyle.aba, condyle.aba_derivatives):
        with pytest.raises(condyle.ModelError, match=message):
            function(model, data, zero, zero, zero)
    with pytest.raises(condyle.ModelError, match=message):
        condyle.minv(model, data, zero)
    assert condyle.crba(model, data, zero)[1, 1] == 0.0
    geared = model.with_armature([0.0, 0.1])
    assert geared.singular_joints == []
    assert np.isfinite(condyle.aba(geared, data, zero, zero, zero)).all()


def test_lock(robot: Robot) -> None:
    model, data, q, v, a, *_ = robot
    last = model.nbodies - 1
    stiff = model.lock([model.names[last - 1], last], q)
    assert stiff.names == model.names[: last - 1]
    assert np.isclose(stiff.total_mass, model.total_mass)
    n = stiff.nv
    v[n:] = a[n:] = 0.0
    expected = condyle.rnea(model, data, q, v, a)[:n]
    own = condyle.Data(stiff)
    np.testing.assert_allclose(condyle.rnea(stiff, own, q[: stiff.nq], v[:n], a[:n]), expected, atol=1e-9)
    tip = model.frames[-1].name
    np.testing.assert_allclose(
        condyle.frame_placement(stiff, own, q[: stiff.nq], tip),
        condyle.frame_placement(model, data, q, tip),
        atol=1e-12,
    )
    with pytest.raises(ValueError, match="^data: made for another model"):
        condyle.rnea(stiff, data, q[: stiff.nq], v[:n], a[:n])
    for wrong in (0, -1, model.nbodies):
        with pytest.raises(IndexError, match=rf"^joints: expected names or 1 to {last}, found {wrong}$"):
            model.lock([wrong], q)
    with pytest.raises(condyle.ModelError, match="^unknown joint `nothing`; no joint has a similar name$"):
        model.lock(["nothing"], q)
    with pytest.raises(ValueError, match="^q: expected shape "):
        model.lock([1], [])


def test_inertial_parameters() -> None:
    rod, finger = condyle.Model.from_urdf_str(PENDULUM).inertial_parameters.reshape(2, 10)
    np.testing.assert_allclose(rod, [3, 0, 0, -4, 6.3, 0.01, 6.2, 0, 0, 0.1], atol=1e-14)
    assert np.array_equal(finger, np.zeros(10))


def test_other_inertias(robot: Robot) -> None:
    """Checks that M is linear in the inertias."""
    model, data, q, *_ = robot
    inertias = [condyle.Inertia.from_com(2 * i.mass, i.com, 2 * i.about_com) for i in model.inertias]
    heavier = model.with_inertias(inertias)
    np.testing.assert_allclose(heavier.inertial_parameters, 2 * model.inertial_parameters, atol=1e-12)
    np.testing.assert_allclose(condyle.crba(heavier, data, q), 2 * condyle.crba(model, data, q), atol=1e-10)
    same = model.with_inertias(model.inertias)
    np.testing.assert_allclose(condyle.crba(same, data, q), condyle.crba(model, data, q), atol=1e-12)
    with pytest.raises(ValueError, match=rf"^inertias: expected {model.nbodies}, found {model.nbodies - 1}$"):
        model.with_inertias(inertias[1:])


def test_gravity_and_armature(robot: Robot) -> None:
    model, data, q, v, a, *_ = robot
    weightless = model.with_gravity([0, 0, 0])
    assert np.array_equal(condyle.gravity(weightless, data, q), np.zeros(model.nv))
    assert np.array_equal(model.gravity, [0, 0, -9.81])  # the model itself does not change
    armature, acceleration = np.arange(model.nv) / 10, a.copy()
    if model.joint_types[1] == "free_flyer":
        with pytest.raises(condyle.ModelError, match="armature is 0, 0.1 and 0.2 along its linear coordinates"):
            model.with_armature(armature)
        armature[:3] = 0.7
        acceleration[:3] += np.cross(v[3:6], v[:3])  # the rate of the velocity along the axes of the world
    geared = model.with_armature(armature)
    assert np.array_equal(geared.armature, armature)
    difference = condyle.rnea(geared, data, q, v, a) - condyle.rnea(model, data, q, v, a)
    np.testing.assert_allclose(difference, armature * acceleration, atol=1e-12)
    with pytest.raises(ValueError, match=r"^gravity: expected shape \(3,\)"):
        model.with_gravity([0, 0])
    with pytest.raises(ValueError, match="^armature: expected shape "):
        model.with_armature([0.0])


def test_words(quadruped: Robot) -> None:
    assert repr(quadruped.model) == "<condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>"
    assert repr(quadruped.data) == "<condyle.Data of 'quadruped'>"
    lines = str(quadruped.model).split("\n")
    assert lines[0].startswith("quadruped: 13 bodies, nq = 19, nv = 18, ")
    assert len(lines) == quadruped.model.nbodies
    assert "free-flyer" in lines[1]


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_pickle(robot: Robot, protocol: int) -> None:
    """Checks that all numbers of a pickled copy are bit-identical, also infinite limits. The copy can use the scratch
    memory of the original.
    """
    model, data, q, v, a, *_ = robot
    model = model.with_gravity([0.1, 0.2, 0.3]).with_armature(np.full(model.nv, 1 / 3))
    again = pickle.loads(pickle.dumps(model, protocol))
    assert str(again) == str(model)
    assert np.array_equal(again.limits.lower, model.limits.lower)
    assert np.array_equal(condyle.rnea(again, data, q, v, a), condyle.rnea(model, data, q, v, a))


def test_pickle_of_results(quadruped: Robot) -> None:
    model, data, q, v, a, *_ = quadruped
    d = condyle.rnea_derivatives(model, data, q, v, a)
    again = pickle.loads(pickle.dumps(d))
    assert type(again) is condyle.RneaDerivatives
    assert np.array_equal(again.dtau_dq, d.dtau_dq)


def test_damaged_pickles(quadruped: Robot) -> None:
    make, (state,) = quadruped.model.__reduce__()
    with pytest.raises(condyle.ModelError, match="^pickle was not written by condyle "):
        make(b"x" + state)
    with pytest.raises(condyle.ModelError, match="^the pickle is damaged: "):
        make(state[:100])


def test_copies_are_the_model_itself(quadruped: Robot) -> None:
    assert copy.copy(quadruped.model) is quadruped.model
    assert copy.deepcopy(quadruped.model) is quadruped.model
    assert copy.deepcopy([quadruped.model])[0] is quadruped.model


def test_models_and_data_take_no_attributes(quadruped: Robot) -> None:
    with pytest.raises(AttributeError):
        quadruped.model.name = "dog"  # type: ignore[misc]
    with pytest.raises(AttributeError):
        quadruped.data.q = quadruped.q  # type: ignore[attr-defined]
