"""Tests `Model.from_mujoco`. Models that MuJoCo compiled are compared with Condyle's reader of the same files, and with
MuJoCo's numbers."""

import re
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import condyle
from condyle import _mujoco_models

sys.path.append(str(Path(__file__).parents[1] / "pinocchio"))
from random_mjcf import RandomMjcf

PACKAGES = ("dm_control", "gymnasium", "robosuite")
SAME = 1e-11
MESHES = 1e-8
"""Tolerances of masses, poses and M, relative to the largest entry. Quaternions from files are rounded twice.

`MESHES` is the tolerance for models with meshes: MuJoCo rotates meshes into their principal axes with an error of about
1e-7 rad.
"""

LOADED = """<mujoco model="loaded">
  <compiler angle="degree" settotalmass="7"/>
  <option gravity="0 1 -9"/>
  <asset><mesh name="wedge" vertex="0 0 0  0.3 0 0  0 0.2 0  0 0 0.4"/></asset>
  <worldbody>
    <body name="base" pos="0 0 1" euler="10 20 30">
      <joint name="x" type="slide" axis="1 0 0" ref="0.25"/><joint name="turn" pos="0.1 0 0" ref="30" range="-40 80"/>
      <geom type="mesh" mesh="wedge"/><site name="mark" pos="0.1 0.2 0.3" euler="0 90 0"/>
      <body pos="0 0.1 0.2"><geom type="box" size="0.1 0.2 0.3"/>
        <replicate count="3" offset="0.2 0 0" euler="0 0 20">
          <body name="leg" pos="0 0 0.3"><joint axis="0 1 0" damping="0.5" frictionloss="0.25" armature="0.125"/>
            <geom type="capsule" size="0.05 0.2" pos="0.1 0 0"/><camera name="eye" pos="0 0 0.1"/></body>
        </replicate>
      </body>
    </body>
    <body name="ball" pos="1 0 0"><freejoint/><geom size="0.1"/></body>
  </worldbody>
</mujoco>"""


def close(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found, expected, atol=SAME * (1.0 + np.abs(expected).max(initial=0.0)))


def same_robot(ours: condyle.Model, other: condyle.Model, inertia: float = 0.0) -> None:
    """Checks that two models of Condyle are equal, up to rounding. `inertia` is an additional tolerance of inertias."""
    for what in ("name", "names", "body_names", "joint_types", "parents", "idx_qs", "idx_vs"):
        assert getattr(ours, what) == getattr(other, what), what
    apart = np.abs(ours.inertial_parameters - other.inertial_parameters)
    assert (apart <= (SAME + inertia) * (1.0 + np.abs(other.inertial_parameters).max(initial=0.0))).all()
    for what in ("joint_placements", "damping", "damping_polynomial", "friction", "armature"):
        close(getattr(ours, what), getattr(other, what))
    for found, expected in zip(ours.limits, other.limits, strict=True):
        finite = np.isfinite(expected)
        assert np.array_equal(np.isfinite(found), finite)
        close(found[finite], expected[finite])
    frames, others = ({(f.name, f.kind): f for f in model.frames} for model in (ours, other))
    assert frames.keys() == others.keys()
    for key, frame in frames.items():
        assert frame.body == others[key].body
        close(frame.placement, others[key].placement)
    close(ours.gravity, other.gravity)
    for found, expected in zip(ours.springs, other.springs, strict=True):
        assert found.joint == expected.joint
        close(np.append(found.stiffness, found.rest), np.append(expected.stiffness, expected.rest))
    for found, expected in zip(ours.gravity_compensation, other.gravity_compensation, strict=True):
        assert found.body == expected.body
        close(np.append(found.mass_com, found.mass), np.append(expected.mass_com, expected.mass))
    for found, expected in zip(ours.actuators, other.actuators, strict=True):
        assert found[:5] == expected[:5]
        finite = np.isfinite([*expected.control, *expected.force])
        assert np.array_equal(np.isfinite([*found.control, *found.force]), finite)
        close(*(np.array([*a.control, *a.force])[finite] for a in (found, expected)))
        close(*(np.array([*a.gear, a.gain, a.bias, a.kp, a.kv]) for a in (found, expected)))
    assert ours.keyframes.keys() == other.keyframes.keys()
    for name, q in ours.keyframes.items():
        close(q, other.keyframes[name])
        close(ours.keyframe_velocities[name], other.keyframe_velocities[name])
        close(ours.keyframe_controls[name], other.keyframe_controls[name])
    assert ours.constraints() == other.constraints()


def agrees(ours: condyle.Model, theirs: mujoco.MjModel, seed: int) -> None:
    """Checks that M, the bias and the positions of bodies equal MuJoCo's in a random state."""
    rng, there = np.random.default_rng(seed), condyle.conventions.Coordinates(ours, "mujoco")
    q, v = condyle.random_configuration(ours, seed=seed), rng.standard_normal(ours.nv)
    data, scratch = mujoco.MjData(theirs), condyle.Data(ours)
    data.qpos[:], data.qvel[:], data.qacc[:] = there.position(q), there.velocity(q, v), 0.0
    theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for force in (
        theirs.dof_damping, theirs.dof_dampingpoly, theirs.dof_frictionloss, theirs.jnt_stiffness, theirs.body_gravcomp,
        theirs.jnt_stiffnesspoly, theirs.tendon_damping, theirs.tendon_stiffness, theirs.actuator_damping,
    ):  # fmt: skip
        force[:] = 0.0
    theirs.opt.density = theirs.opt.viscosity = 0.0
    mujoco.mj_inverse(theirs, data)
    a = there.acceleration_from(data.qpos, data.qvel, data.qacc)
    close(there.effort(q, condyle.rnea(ours, scratch, q, v, a)), data.qfrc_inverse)
    for body in range(1, theirs.nbody):
        pose = condyle.frame_placement(ours, scratch, q, theirs.body(body).name or f"body{body}")
        close(pose[:3, 3], data.xpos[body])
        close(pose[:3, :3].ravel(), data.xmat[body])


@pytest.mark.parametrize("seed", range(30))
def test_random_robots_are_read_alike(seed: int) -> None:
    text = RandomMjcf(seed).text
    theirs = mujoco.MjModel.from_xml_string(text)
    ours = condyle.Model.from_mujoco(theirs)
    assert ours.warnings == []
    same_robot(ours, condyle.Model.from_mjcf_str(text))
    agrees(ours, theirs, seed)


def test_what_only_a_compiler_knows() -> None:
    theirs = mujoco.MjModel.from_xml_string(LOADED)
    ours = condyle.Model.from_mujoco(theirs)
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    assert abs(ours.total_mass - 7.0) < 1e-12
    assert ours.frame("mark") >= 0
    agrees(ours, theirs, 1)


def test_numbers_that_were_changed_after_compiling() -> None:
    theirs = mujoco.MjModel.from_xml_string(RandomMjcf(3).text)
    theirs.body_mass[2] *= 3.0
    theirs.jnt_axis[1] = [0.6, 0.0, 0.8]
    theirs.dof_armature[theirs.jnt_dofadr[1] :] = 0.375
    agrees(condyle.Model.from_mujoco(theirs), theirs, 5)


def test_the_text_compiles_to_the_same_numbers() -> None:
    """Tests the MJCF text that Condyle makes from a compiled model: MuJoCo must compile it to the same model."""
    inside = """<body name="b" pos="0 0 1" gravcomp="0.5">
      <joint name="j" axis="0 1 0" ref="10" springref="20" stiffness="1 2 3" damping="0.5 0.1 0.2" range="-10 20"/>
      <joint name="k" type="ball" stiffness="2" actuatorgravcomp="true" range="0 60"/>
      <geom size="0.1"/><site name="s"/><body name="c" pos="0 0 1">
      <joint name="l" type="slide" springdamper="0.5 1" actuatorfrcrange="-2 5"/>
      <geom size="0.2"/><site name="t"/></body>
    </body><body mocap="true" name="target"/>"""
    beside = """<tendon><fixed name="f" armature="0.5" stiffness="3" damping="0.1" frictionloss="0.2" range="-1 1">
      <joint joint="j" coef="2"/><joint joint="l" coef="-1"/></fixed>
      <spatial name="cord"><site site="s"/><site site="t"/></spatial></tendon>
    <equality><connect name="c" body1="b" body2="c" anchor="0 0 1"/><weld site1="s" site2="t" active="false"/>
      <joint joint1="j" joint2="l" polycoef="1 2 3 0 0"/><tendon tendon1="f"/></equality>
    <actuator><motor joint="j" gear="50" ctrlrange="-1 1"/>
      <position name="p" joint="l" kp="100" kv="10" forcerange="-3 3"/>
      <general tendon="f" gear="3" gainprm="2" biastype="affine" biasprm="1 -3 -0.5" armature="0.01" damping="0.1"/>
      <general site="s" refsite="t" gear="1 2 3 4 5 6"/><intvelocity joint="j" kp="2" actrange="-1 1"/></actuator>
    <keyframe><key name="home" qpos="1 0 1 0 0 0.3" ctrl="1 2 3 4 5" act="0.5"/><key qvel="1 2 3 4 5"/></keyframe>"""
    flags = '<option density="1.2" wind="1 0 0"><flag damper="disable" gravity="disable"/></option>'
    text = f'<mujoco model="all &amp; more">{flags}<worldbody>{inside}</worldbody>{beside}</mujoco>'
    first = mujoco.MjModel.from_xml_string(text)
    second = mujoco.MjModel.from_xml_string(_mujoco_models.mjcf(first))
    assert (first.opt.disableflags, first.opt.density) == (second.opt.disableflags, second.opt.density)
    compared = 0
    for field in dir(first):
        part = field.split("_")[0]
        if part not in ("jnt", "dof", "tendon", "key", "wrap", "qpos", "qpos0", "body", "actuator", "site", "eq"):
            continue
        found, expected = getattr(second, field), getattr(first, field)
        # Fields of bounding volumes and of geoms are not compared.
        if not isinstance(expected, np.ndarray) or "bvh" in field or "geom" in field:
            continue
        if field == "eq_data":
            found, expected = found[:, :10], expected[:, :10]
        if field in ("body_margin", "body_contype", "body_conaffinity", "site_size", "site_rgba", "actuator_ctrlspec"):
            continue  # fields of shapes, of colours, and of the meaning of a control are not compared
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13, err_msg=field)
        compared += 1
    assert compared > 80


def test_controls_of_keyframes() -> None:
    """Tests that a keyframe has one number for each actuator of Condyle's model, even if the actuator has several
    inputs or states in MuJoCo."""
    text = """<mujoco><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>
    <actuator><pid name="a" joint="j" kp="2"/><pid name="b" joint="j" kp="2" input="pos" ki="1" slewmax="1"/>
    <muscle joint="j" lengthrange="0 1"/><intvelocity name="c" joint="j" kp="2" actrange="-1 1"/>
    <motor name="d" joint="j"/></actuator>
    <keyframe><key name="k" ctrl="1 2 3 4 5 6" act="0.1 0.2 0.3 0.4"/></keyframe></mujoco>"""
    theirs = mujoco.MjModel.from_xml_string(text)
    assert (theirs.actuator_ctrladr.tolist(), theirs.actuator_actadr.tolist()) == ([0, 2, 3, 4, 5], [-1, 0, 2, 3, -1])
    for model in (condyle.Model.from_mjcf_str(text), condyle.Model.from_mujoco(theirs)):
        assert [actuator.name for actuator in model.actuators] == ["a", "b", "c", "d"]
        close(model.keyframe_controls["k"], np.array([1.0, 3.0, 0.4, 6.0]))


def robots_of_packages() -> list[Path]:
    """Returns the MJCF files of the installed packages that the comparison of robots reads."""
    folder = Path(__file__).parents[3] / ".venv" / "robots"
    files = sorted(file for package in PACKAGES for file in (folder / package).rglob("*.xml"))
    return [file for file in files if "<mujoco" in file.read_text(encoding="utf-8", errors="ignore")]


@pytest.mark.skipif(not robots_of_packages(), reason="no packages of robots in .venv/robots")
def test_robots_of_packages() -> None:
    """Tests that each converted model equals MuJoCo's model. If Condyle's reader accepts the file, the converted model
    must also equal the model that the reader returns."""
    compared = read = 0
    for file in robots_of_packages():
        try:
            theirs = mujoco.MjModel.from_xml_path(str(file))
        except ValueError:  # MuJoCo rejects the file: it is a part of a model, or refers to a missing file
            continue
        ours = condyle.Model.from_mujoco(theirs)
        try:
            other = condyle.Model.from_mjcf(file)
        except condyle.Error:  # Condyle rejects the file: a mesh has an unsupported format
            other = None
        if other is not None:
            same_robot(ours, other, MESHES)
            read += 1
        agrees(ours, theirs, 1)
        compared += 1
    assert compared > 100
    assert read > 90


def test_words_for_what_has_none() -> None:
    """Tests that elements without a name get the same names as from Condyle's reader."""
    text = """<mujoco><worldbody><body><joint/><joint axis="1 0 0"/><geom size="1"/>
      <body name="body3"><joint/><geom size="1"/><body><joint name="body3_joint"/><geom size="1"/></body></body>
    </body></worldbody></mujoco>"""
    ours = condyle.Model.from_mujoco(mujoco.MjModel.from_xml_string(text))
    assert ours.body_names == ["universe", "body1#1", "body1", "body3", "body3_"]
    assert ours.names == ["universe", "body1_joint1", "body1_joint2", "body3_joint_", "body3_joint"]


def test_losses_that_differ_within_a_joint() -> None:
    theirs = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body name="b"><joint name="j" type="ball"/><geom size="1"/></body></worldbody></mujoco>'
    )
    theirs.dof_armature[1] = 0.5
    expected = "joint `j`: expected one armature for all its degrees of freedom, found [[0.0], [0.5], [0.0]]"
    with pytest.raises(condyle.ModelError, match=re.escape(expected)):
        condyle.Model.from_mujoco(theirs)


PLAIN = re.sub("</?replicate[^>]*>| settotalmass=.7.", "", LOADED)
"""Robot of LOADED without `replicate` and `settotalmass`: changed inertias cannot be written into a file with these
features."""


@pytest.mark.parametrize("text", [PLAIN, *(RandomMjcf(k).text for k in range(8))])
def test_written_numbers(text: str, tmp_path: Path) -> None:
    """Tests that Condyle writes changed inertias, limits and armature into a copy of a file. MuJoCo must read the
    changed robot from this copy."""
    original, new = tmp_path / "original.xml", tmp_path / "new.xml"
    original.write_text(text, encoding="utf-8")
    model, rng = condyle.Model.from_mjcf(original), np.random.default_rng(1)
    model.write_mjcf(new, original)
    assert new.read_text(encoding="utf-8") == text
    inertias = list(model.inertias)
    for i, inertia in enumerate(inertias):
        if inertia.mass > 0.0 and i > 0:
            spread = 0.1 * rng.standard_normal((3, 3))
            moments = spread @ spread.T + 1e-3 * np.eye(3)
            inertias[i] = condyle.Inertia.from_com(
                rng.uniform(0.5, 3.0), rng.uniform(-0.1, 0.1, 3), np.trace(moments) * np.eye(3) - moments
            )
    armature, lower = model.armature.copy(), model.limits.lower.copy()
    for i, kind in enumerate(model.joint_types):
        if kind in ("revolute", "prismatic"):
            armature[model.idx_vs[i]] += 0.25
            lower[model.idx_qs[i]] *= 0.5
    changed = model.with_inertias(inertias).with_armature(armature).with_limits(lower=lower)
    changed.write_mjcf(new, original)
    theirs = mujoco.MjModel.from_xml_path(str(new))
    same_robot(condyle.Model.from_mujoco(theirs), condyle.Model.from_mjcf(new))
    close(condyle.Model.from_mjcf(new).inertial_parameters, changed.inertial_parameters)
    agrees(changed, theirs, 2)


DRIVEN = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/>
  <body name="b" pos="0.5 0 0" gravcomp="0.5"><joint name="k" axis="0 1 0"/>
    <geom size="0.1" pos="0.2 0 0"/></body></body>
</worldbody>
<tendon><fixed name="t" actuatorfrcrange="-1 1"><joint joint="j" coef="2"/><joint joint="k" coef="-1"/></fixed></tendon>
<actuator><motor name="off" joint="j" group="1" ctrlrange="-1 1"/>
  <motor name="pull" tendon="t" forcerange="-3 3"/></actuator>
</mujoco>"""


def test_actuators_that_are_disabled() -> None:
    theirs = mujoco.MjModel.from_xml_string(DRIVEN)
    theirs.opt.disableactuator = 1 << 1
    ours = condyle.Model.from_mujoco(theirs)
    assert [actuator.name for actuator in ours.actuators] == ["pull"]
    (warning,) = ours.warnings
    assert warning == "general `off`: it is disabled by <option>: it is no actuator, and no limit of effort"
    assert (warning.kind, warning.file, warning.line) == ("left_out", None, None)
    theirs.opt.disableactuator = 1  # disables only actuators of group 0
    assert [actuator.name for actuator in condyle.Model.from_mujoco(theirs).actuators] == ["off"]


def test_constraints_that_are_disabled() -> None:
    """Tests that a flag of a compiled model disables limits, friction and equalities, as the same flag in a file
    does."""
    joint = '<joint name="j" axis="0 1 0" range="-10 10" frictionloss="1"/>'
    tree = f'<worldbody><body name="b">{joint}<geom size="0.1"/></body></worldbody>'
    loop = '<equality><connect body1="b" anchor="1 0 0"/></equality>'
    theirs = mujoco.MjModel.from_xml_string(f"<mujoco>{tree}{loop}</mujoco>")
    theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    ours = condyle.Model.from_mujoco(theirs)
    assert (ours.limits.upper[0], ours.friction[0], ours.constraints()) == (np.inf, 0.0, {})


def test_range_of_a_tendon() -> None:
    """Tests that the force limits of Condyle's actuator and the coefficients of its tendon give the same efforts as in
    MuJoCo."""
    theirs = mujoco.MjModel.from_xml_string(DRIVEN)
    data = mujoco.MjData(theirs)
    data.ctrl[:] = 0.0, 5.0
    mujoco.mj_forward(theirs, data)
    pull = condyle.Model.from_mjcf_str(DRIVEN).actuators[1]
    force = np.clip(pull.gain * 5.0, *pull.force)
    close(np.array([coefficient * force for coefficient in pull.coefficients.values()]), data.qfrc_actuator)


def test_compensation_after_a_change_of_masses(tmp_path: Path) -> None:
    """Tests that gravity compensation is a fraction of a body's weight: if masses are doubled, the compensating efforts
    double, as in MuJoCo."""
    original = tmp_path / "driven.xml"
    original.write_text(DRIVEN, encoding="utf-8")
    theirs, ours = mujoco.MjModel.from_xml_string(DRIVEN), condyle.Model.from_mjcf(original)
    theirs.body_mass[1:] *= 2.0
    heavier = ours.with_inertias([i._replace(mass=2.0 * i.mass, rotational=2.0 * i.rotational) for i in ours.inertias])
    heavier.write_mjcf(tmp_path / "heavier.xml", original)
    data, q = mujoco.MjData(theirs), [0.3, -0.2]
    data.qpos[:] = q
    mujoco.mj_forward(theirs, data)
    for model in heavier, condyle.Model.from_mjcf(tmp_path / "heavier.xml"):
        close(condyle.passive_torque(model, q, [0.0, 0.0], 0.1), data.qfrc_passive)


def test_a_compiled_model_is_written_to_its_source(tmp_path: Path) -> None:
    """Tests that an unchanged model leaves its file unchanged, although MuJoCo's compiler has rounded the numbers of
    the model."""
    original, new = tmp_path / "original.xml", tmp_path / "new.xml"
    text = RandomMjcf(3).text
    original.write_text(text, encoding="utf-8")
    ours = condyle.Model.from_mujoco(mujoco.MjModel.from_xml_path(str(original)))
    ours.write_mjcf(new, original)
    assert new.read_text(encoding="utf-8") == text


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (mujoco.MjSpec.from_string(DRIVEN), "expected an MjModel, found MjSpec; call spec.compile()"),
        (mujoco.MjData(mujoco.MjModel.from_xml_string(DRIVEN)), "expected an MjModel, found MjData; give data.model"),
        ("robot.xml", "expected an MjModel, found str; `from_mjcf` reads a file"),
        (None, "expected an MjModel, found NoneType"),
    ],
)
def test_anything_but_a_compiled_model(given: object, expected: str) -> None:
    with pytest.raises(TypeError, match=re.escape(expected)):
        condyle.Model.from_mujoco(given)
