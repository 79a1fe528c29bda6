"""Tests of robots that are read from files and written to files: attributes of warnings, JSON, and copies of a file
with other numbers.
"""

import json
import pickle
from pathlib import Path

import numpy as np
import pytest

import condyle
from condyle import WORLD, Inertia, Joint, Model, ModelBuilder

ODD = """<robot name="odd">
  <link name="base"/><link name="arm"/>
  <joint name="pivot" type="continuous"><parent link="base"/><child link="arm"/></joint>
</robot>"""


def sprung() -> Model:
    """Returns a robot with springs, actuators and all other contents that a model can have besides its tree."""
    rod = Inertia.from_cylinder(2.0, 0.05, 0.5)
    builder = ModelBuilder("sprung")
    upper = builder.body(
        "upper", WORLD, Joint.revolute([0, 1, 0]), inertia=rod, effort=(-2.0, 5.0), damping_polynomial=(0.25, 0.5)
    )
    lower = builder.body("lower", upper, Joint.prismatic([0, 0, 1]), inertia=rod)
    builder.spring(upper, [1.0, 2.0, 3.0], rest=[0.1])
    builder.spring(lower, 4.0, rest=-0.5)
    builder.compensate_gravity(upper, 0.5)
    builder.actuator("motor", upper, gear=50.0, force=(-3.0, 3.0))
    builder.actuator("servo", [(upper, 1.0), (lower, -2.0)], tendon="cord", kp=100.0, kv=10.0, control=(-1.0, 1.0))
    return builder.build()


def test_additions_of_a_builder() -> None:
    model = sprung()
    assert np.array_equal(model.damping_polynomial, [[0.25, 0.5], [0.0, 0.0]])
    (limits,) = (model.limits,)
    assert (limits.effort_lower[0], limits.effort_upper[0], limits.effort[0]) == (-2.0, 5.0, 5.0)
    first, second = model.springs
    assert (first.joint, first.stiffness.tolist(), first.rest.tolist()) == ("upper", [1.0, 2.0, 3.0], [0.1])
    assert (second.joint, second.stiffness.tolist(), second.rest.tolist()) == ("lower", [4.0, 0.0, 0.0], [-0.5])
    (carried,) = model.gravity_compensation
    assert (carried.body, carried.mass, carried.ratio) == ("upper", 1.0, 0.5)
    twice = [i._replace(mass=2.0 * i.mass) for i in model.inertias]
    assert model.with_inertias(twice).gravity_compensation[0].mass == 2.0
    motor, servo = model.actuators
    assert (motor.joint, motor.tendon, motor.gear.tolist()) == ("upper", None, [50.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert (motor.force, motor.control, motor.gain, motor.bias) == ((-3.0, 3.0), (-np.inf, np.inf), 1.0, 0.0)
    assert (servo.joint, servo.tendon, servo.coefficients) == (None, "cord", {"upper": 1.0, "lower": -2.0})
    assert (servo.gain, servo.kp, servo.kv, servo.control) == (100.0, 100.0, 10.0, (-1.0, 1.0))
    assert model.keyframes == {}
    with pytest.raises(ValueError, match="read-only"):
        first.rest[0] = 1.0


def test_wrong_additions() -> None:
    builder, other = ModelBuilder("one"), ModelBuilder("other")
    body = builder.body("body", WORLD, Joint.spherical())
    with pytest.raises(TypeError, match="joint: expected a BodyId"):
        builder.actuator("motor", "body")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="joint: a body of another builder"):
        other.actuator("motor", body)
    with pytest.raises(ValueError, match="gear: expected at most 6 numbers, found 7"):
        builder.actuator("motor", body, gear=[1.0] * 7)
    builder.spring(body, 1.0, rest=[0.0])
    with pytest.raises(condyle.ModelError, match="its spring rests at 1 numbers, expected 4"):
        builder.build()


def test_limits_of_both_sides() -> None:
    arm = condyle.robots.arm7()
    other = arm.with_limits(effort_lower=-0.25 * arm.limits.effort)
    assert np.array_equal(other.limits.effort_lower, -0.25 * arm.limits.effort)
    assert np.array_equal(other.limits.effort_upper, arm.limits.effort)
    with pytest.raises(TypeError, match="effort: sets both sides"):
        arm.with_limits(effort=arm.limits.effort, effort_upper=arm.limits.effort)


def test_warnings_have_parts() -> None:
    first, second = Model.from_urdf_str(ODD).warnings[:2]
    assert isinstance(first, str) and str(first) == "body `arm` moves and has no mass"
    assert (first.kind, first.subject, first.file, first.line) == ("massless", "arm", None, None)
    assert (second.kind, second.subject) == ("singular", "pivot")
    link = '<sdf version="1.7"><model name="m">\n<link name="a"/></model></sdf>'
    (assumed,) = Model.from_sdf_str(link).warnings
    assert (assumed.kind, assumed.file, assumed.line) == ("assumed", "<string>", 2)
    assert str(assumed).startswith("<string>:2: link `a`: ")
    again = pickle.loads(pickle.dumps(assumed))
    assert (again, again.kind, again.line) == (assumed, "assumed", 2)


def test_strict_allows_kinds() -> None:
    with pytest.raises(condyle.ParseError, match="moves and has no mass"):
        Model.from_urdf_str(ODD, strict=True)
    with pytest.raises(condyle.ParseError, match="inertia matrix is singular"):
        Model.from_urdf_str(ODD, strict=True, allow=["massless"])
    assert Model.from_urdf_str(ODD, strict=True, allow=["massless", "singular"]).nv == 1
    with pytest.raises(ValueError, match="allow: `masless` is no kind of warning; nearest is `massless`"):
        Model.from_urdf_str(ODD, allow=["masless"])
    with pytest.raises(TypeError, match="allow: expected a list of kinds of warnings"):
        Model.from_urdf_str(ODD, allow="massless")  # type: ignore[arg-type]
    # the kind of a warning can be passed to `allow`
    kinds = [warning.kind for warning in Model.from_urdf_str(ODD).warnings]
    assert Model.from_urdf_str(ODD, strict=True, allow=kinds).nv == 1  # type: ignore[arg-type]


@pytest.mark.parametrize("model", [condyle.robots.humanoid(), sprung()], ids=lambda model: model.name)
def test_json_keeps_all_digits(model: Model) -> None:
    text = model.to_json()
    again = Model.from_json(text)
    assert again.to_json() == text == pickle.loads(pickle.dumps(model)).to_json()
    assert np.array_equal(again.limits.effort_lower, model.limits.effort_lower)
    assert json.loads(text)["name"] == model.name
    assert [a.control for a in again.actuators] == [a.control for a in model.actuators]


def test_wrong_json() -> None:
    text = condyle.robots.arm7().to_json()
    with pytest.raises(condyle.ParseError, match="line 1"):
        Model.from_json(text[:-2])
    with pytest.raises(condyle.ParseError, match="no model in JSON"):
        Model.from_json(text.replace('"damping":[', '"damping":[1.0,'))


def test_write_urdf(tmp_path: Path) -> None:
    original, new = tmp_path / "arm7.urdf", tmp_path / "identified.urdf"
    original.write_text(condyle.robots.ARM7, encoding="utf-8")
    arm = Model.from_urdf(original)
    arm.write_urdf(new, original)
    assert new.read_bytes() == original.read_bytes()
    heavier = [inertia._replace(mass=1.5 * inertia.mass) for inertia in arm.inertias]
    other = arm.with_inertias(heavier).with_limits(velocity=0.5 * arm.limits.velocity)
    other.write_urdf(new, original)
    again = Model.from_urdf(new)
    np.testing.assert_allclose(again.inertial_parameters, other.inertial_parameters, rtol=1e-12, atol=1e-14)
    assert np.array_equal(again.limits.velocity, other.limits.velocity)
    arm.with_armature(np.full(7, 0.125)).write_urdf(new, original)
    assert np.array_equal(Model.from_urdf(new).armature, np.full(7, 0.125))
    with pytest.raises(condyle.ParseError, match="joint `joint1`: effort from -1 to 87: a URDF has one limit"):
        arm.with_limits(effort_lower=-np.ones(7)).write_urdf(new, original)
    with pytest.raises(condyle.ParseError, match=r"arm7\.urdf: .*joint"):
        condyle.robots.quadruped().write_urdf(new, original)


def test_write_mjcf(tmp_path: Path) -> None:
    original, new = tmp_path / "arm.xml", tmp_path / "identified.xml"
    text = """<mujoco><default><joint armature="0.5"/></default><worldbody>
      <body name="arm"><joint name="elbow" axis="0 1 0" range="-90 90"/><!-- kept --><geom size="0.1"/></body>
    </worldbody></mujoco>"""
    original.write_text(text, encoding="utf-8")
    model = Model.from_mjcf(original)
    model.with_armature([0.75]).with_limits(upper=[0.25 * np.pi]).write_mjcf(new, original)
    expected = text.replace('range="-90 90"', 'range="-90 45" limited="true" armature="0.75"')
    assert new.read_text(encoding="utf-8") == expected


def test_other_damping_and_friction() -> None:
    model = sprung().with_damping([0.5, 0.25]).with_friction([0.0, 0.125])
    assert (model.damping.tolist(), model.friction.tolist()) == ([0.5, 0.25], [0.0, 0.125])
    assert np.array_equal(model.damping_polynomial, [[0.25, 0.5], [0.0, 0.0]])
    assert np.array_equal(model.with_damping([0.5, 0.25], [[0, 0], [1, 2]]).damping_polynomial, [[0, 0], [1, 2]])
    # damping torques at the speeds 2 and 1: −(0.5 + 0.25 · 2 + 0.5 · 4) 2 and −0.25; the second joint also has friction
    weightless = model.with_gravity([0, 0, 0]).with_damping([0.5, 0.25])
    found = condyle.passive_torque(weightless, [0.1, -0.5], [2.0, 1.0], 1e-3)
    np.testing.assert_allclose(found, [-6.0, -0.375], atol=1e-12)
    with pytest.raises(condyle.ModelError, match="damping is -1, expected a finite number of at least 0"):
        model.with_damping([-1.0, 0.0])
    with pytest.raises(ValueError, match=r"^polynomial: expected shape \(2, 2\)"):
        model.with_damping([0.0, 0.0], [0.0])
    with pytest.raises(ValueError, match="with_friction"):
        model.friction[0] = 1.0


def test_couplings_that_nothing_holds() -> None:
    body = '<body><joint name="{}" axis="0 1 0"/><geom size="0.1"/>{}</body>'
    tree = body.format("a", body.format("b", ""))
    coupled = '<equality><joint name="e" joint1="b" joint2="a" polycoef="0.1 2"/></equality>'
    model = Model.from_mjcf_str(f"<mujoco><worldbody>{tree}</worldbody>{coupled}</mujoco>")
    coupling = model.constraints()["e"]
    expected = "found a Coupling: no constraint holds it; if it is linear, read the file with mimic=True"
    with pytest.raises(TypeError, match=expected):
        condyle.ConstraintSet(model, [coupling])  # type: ignore[list-item]
    (warning,) = model.warnings
    assert warning.endswith("nothing enforces the coupling `e`")
    locked = model.lock(["b"], [0.0, 0.5])
    assert locked.constraints()["e"] == condyle.Coupling("a", None, (0.2, 0.0, 0.0, 0.0, 0.0))
    assert locked.warnings == model.warnings
