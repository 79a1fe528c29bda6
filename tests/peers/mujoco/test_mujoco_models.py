"""`Model.from_mujoco`: models that MuJoCo has compiled, beside our reader of the same files and beside MuJoCo's numbers."""

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

SAME = 1e-11
"""Masses, poses and M of both, to this part of the largest one; quaternions of files are rounded twice."""

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


def same_robot(ours: condyle.Model, other: condyle.Model) -> None:
    """Two of our models are one robot, up to rounding."""
    for what in ("name", "names", "body_names", "joint_types", "parents", "idx_qs", "idx_vs"):
        assert getattr(ours, what) == getattr(other, what), what
    for what in ("joint_placements", "inertial_parameters", "damping", "damping_polynomial", "friction", "armature"):
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


def agrees(ours: condyle.Model, theirs: mujoco.MjModel, seed: int) -> None:
    """M, bias and the places of bodies are MuJoCo's at a random state."""
    rng, there = np.random.default_rng(seed), condyle.conventions.Coordinates(ours, "mujoco")
    q, v = condyle.random_configuration(ours, seed=seed), rng.standard_normal(ours.nv)
    data, scratch = mujoco.MjData(theirs), condyle.Data(ours)
    data.qpos[:], data.qvel[:], data.qacc[:] = there.position(q), there.velocity(q, v), 0.0
    theirs.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    theirs.dof_damping[:] = theirs.dof_frictionloss[:] = theirs.jnt_stiffness[:] = theirs.body_gravcomp[:] = 0.0
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
    """What is written for our reader is MuJoCo's own model once more, so nothing is lost on the way."""
    inside = """<body name="b" pos="0 0 1" gravcomp="0.5">
      <joint name="j" axis="0 1 0" ref="10" springref="20" stiffness="1 2 3" damping="0.5 0.1 0.2" range="-10 20"/>
      <joint name="k" type="ball" stiffness="2" actuatorgravcomp="true" range="0 60"/>
      <geom size="0.1"/><site name="s"/><body name="c" pos="0 0 1">
      <joint name="l" type="slide" springdamper="0.5 1" actuatorfrcrange="-2 5"/><geom size="0.2"/><site name="t"/></body>
    </body><body mocap="true" name="target"/>"""
    beside = """<tendon><fixed name="f" armature="0.5" stiffness="3" damping="0.1" frictionloss="0.2" range="-1 1">
      <joint joint="j" coef="2"/><joint joint="l" coef="-1"/></fixed>
      <spatial name="cord"><site site="s"/><site site="t"/></spatial></tendon>
    <equality><connect name="c" body1="b" body2="c" anchor="0 0 1"/><weld site1="s" site2="t" active="false"/>
      <joint joint1="j" joint2="l" polycoef="1 2 3 0 0"/><tendon tendon1="f"/></equality>
    <actuator><motor joint="j" gear="50" ctrlrange="-1 1"/><position name="p" joint="l" kp="100" kv="10" forcerange="-3 3"/>
      <general tendon="f" gear="3" gainprm="2" biastype="affine" biasprm="1 -3 -0.5" armature="0.01" damping="0.1"/>
      <general site="s" refsite="t" gear="1 2 3 4 5 6"/><intvelocity joint="j" kp="2" actrange="-1 1"/></actuator>
    <keyframe><key name="home" qpos="1 0 1 0 0 0.3"/><key qvel="1 2 3 4 5"/></keyframe>"""
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
        # bounding volumes of geoms, and the mark of a relative pose that the compiler chose
        if not isinstance(expected, np.ndarray) or "bvh" in field or "geom" in field:
            continue
        if field == "eq_data":
            found, expected = found[:, :10], expected[:, :10]
        if field in ("body_margin", "body_contype", "body_conaffinity", "site_size", "site_rgba", "actuator_ctrlspec"):
            continue  # shapes, colours, and the meaning of a control
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13, err_msg=field)
        compared += 1
    assert compared > 80


def test_words_for_what_has_none() -> None:
    """Names that files do not give are those that our reader gives."""
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
