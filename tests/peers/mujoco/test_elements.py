"""Compares Condyle's table of MJCF elements with MuJoCo's schema. The table must contain all of MuJoCo's elements, and
must state how each attribute that may change a robot is treated."""

from pathlib import Path

import pytest
from features import schema

import condyle

TABLE = Path(__file__).parents[3] / "crates/model/src/io/mjcf/elements.txt"

# Treatment of each attribute of elements that define the tree of bodies, in three groups.
# HELD: a model contains the attribute's effect, or the reader rejects its value with an error.
# LEFT_OUT: a warning states that the attribute is left out.
# NO_EFFECT: the attribute has no effect on kinematics, dynamics and limits.
# `features.py` tests attributes of springs, actuators, tendons, constraints and keyframes one by one.
HELD = {
    "compiler": "alignfree angle assetdir autolimits balanceinertia boundinertia boundmass coordinate eulerseq "
    "fitaabb inertiafromgeom inertiagrouprange meshdir settotalmass strippath",
    "option": "gravity",
    "flag": "actuation clampctrl constraint damper equality frictionloss gravity limit spring",
    "mesh": "builtin class content_type face file inertia name params refpos refquat scale vertex",
    "hfield": "name size",
    "model": "content_type file name",
    "body": "axisangle childclass euler gravcomp name pos quat xyaxes zaxis",
    "inertial": "axisangle diaginertia euler fullinertia mass pos quat xyaxes zaxis",
    "joint": "actuatorfrclimited actuatorfrcrange armature axis class damping frictionloss limited name pos range "
    "ref springdamper springref stiffness type",
    "freejoint": "align name",
    "geom": "axisangle class density euler fitscale fromto group hfield mass mesh name pos quat shellinertia size "
    "type xyaxes zaxis",
    "attach": "body frame model prefix",
    "site": "axisangle class euler fromto name pos quat type xyaxes zaxis",
    "camera": "axisangle class euler mode name pos quat xyaxes zaxis",
}
LEFT_OUT = {
    "option": "actuatorgroupdisable density viscosity",
    "mesh": "maxhullvert",
    "body": "mocap",
    "joint": "actuatorgravcomp springyield",
}
NO_EFFECT = {
    "compiler": "conflict discardvisual fusestatic passthrough savecanonical savecompiled saveinertial texturedir "
    "usethread",
    "option": "ccd_iterations ccd_tolerance cone impratio integrator iterations jacobian ls_iterations ls_tolerance "
    "magnetic noslip_iterations noslip_tolerance o_friction o_margin o_solimp o_solref sdf_initpoints "
    "sdf_iterations sleep_tolerance solver timestep tolerance wind",  # wind only affects fluids, which are left out
    "flag": "autoreset contact diagexact energy eulerdamp filterparent fwdinv invdiscrete ipc island midphase "
    "multiccd nativeccd override refsafe sensor sleep speculative warmstart",
    "mesh": "material normal smoothnormal texcoord",
    "hfield": "content_type elevation file ncol nrow",
    "body": "fuse simple sleep user",
    "joint": "group margin solimpfriction solimplimit solreffriction solreflimit user",
    "freejoint": "group",
    "geom": "adhesion castshadow conaffinity condim contype fluidcoef fluidshape friction gap margin material "
    "priority rgba solimp solmix solref surfacevel user",  # fluidshape only affects fluids, which are left out
    "site": "group material mesh rgba size user",
    "camera": "focal focalpixel fovy ipd output principal principalpixel projection resolution sensorsize target user",
}


def table() -> dict[str, tuple[set[str], dict[str, str]]]:
    """Returns attributes and children of each type of element. The type of a child is empty if its contents are
    ignored. The line that begins with `*` lists misplaced elements and is ignored."""
    types = {}
    for line in TABLE.read_text().splitlines():
        name, rest = line.split(":", 1)
        if name == "*":
            continue
        attributes, _, children = rest.partition(";")
        inside = {}
        for child in children.split():
            tag, _, kind = child.partition("=")
            inside[tag.removesuffix("*")] = "" if tag.endswith("*") else kind or tag
        assert len(set(attributes.split())) == len(attributes.split()), f"{name} lists an attribute twice"
        assert name not in types, f"{name} has two lines"
        types[name] = (set(attributes.split()), inside)
    return types


def test_each_type_is_reached_and_has_a_line() -> None:
    types = table()
    reached, waiting = set(), ["mujoco"]
    while waiting:
        name = waiting.pop()
        if name not in reached:
            reached.add(name)
            waiting += [kind for kind in types.get(name, (set(), {}))[1].values() if kind]
    assert reached >= types.keys()
    assert reached - types.keys() <= {"distance"}  # obsolete constraint of MJCF, whose attributes are not in this table


def test_what_mujoco_knows_is_known() -> None:
    types, checked = table(), 0
    for path, attributes in schema():
        kinds = {"mujoco"}
        for tag in path[1:]:
            found = {types[kind][1][tag] for kind in kinds if kind and tag in types[kind][1]}
            found |= {"body", "worldbody"} if tag == "body" else set()  # one row of the schema describes both elements
            assert found or "" in kinds, f"<{tag}> is unknown in {path}"
            kinds = found | ({""} & kinds)
        for kind in kinds - {"", "worldbody"}:
            missing = set(attributes) - types[kind][0]
            assert not missing, f"attributes of {'/'.join(path)} are unknown: {missing}"
            checked += len(attributes)
    assert checked > 500


@pytest.mark.parametrize("name", sorted(HELD))
def test_each_attribute_has_a_decision(name: str) -> None:
    decided = [set(d.get(name, "").split()) for d in (HELD, LEFT_OUT, NO_EFFECT)]
    assert sum(map(len, decided)) == len(set().union(*decided)), "an attribute has two decisions"
    for path, attributes in schema():
        if (
            path[-1] == name
            and path[1:2] != ("default",)
            and path[1:2] not in (("contact",), ("equality",), ("tendon",), ("sensor",))
        ):
            undecided = set(attributes) - set().union(*decided)
            assert not undecided, f"{'/'.join(path)}: {undecided}"


INERTIAL = '<inertial pos="0.1 0 0" mass="2" diaginertia="0.02 0.03 0.04"/>'
BODY = '<body name="b"{}><joint name="j" axis="0 1 0"{}/>' + INERTIAL + "</body>"
MESH = (
    '<asset><mesh name="m" maxhullvert="4" vertex="0 0 0 1 0 0 0 1 0 0 0 1 1 1 1"/></asset><worldbody><body><joint/>'
    '<geom type="mesh" mesh="m"/></body></worldbody>'
)


@pytest.mark.parametrize(
    ("attribute", "inside"),
    [
        ("density", '<option density="3"/><worldbody>' + BODY.format("", "") + "</worldbody>"),
        ("viscosity", '<option viscosity="3"/><worldbody>' + BODY.format("", "") + "</worldbody>"),
        ("mocap", '<worldbody><body name="t" mocap="true"/>' + BODY.format("", "") + "</worldbody>"),
        ("maxhullvert", MESH),
        ("range", "<worldbody>" + BODY.format("", ' type="ball" range="0 60"') + "</worldbody>"),
        ("springyield", "<worldbody>" + BODY.format("", ' stiffness="3" springyield="0.1"') + "</worldbody>"),
        (
            "actuatorgravcomp",
            "<worldbody>"
            + BODY.format(' gravcomp="1"', ' actuatorgravcomp="true" actuatorfrcrange="-1 1"')
            + "</worldbody>",
        ),
    ],
)
def test_what_is_left_out_is_said(attribute: str, inside: str) -> None:
    model = condyle.Model.from_mjcf_str(f"<mujoco>{inside}</mujoco>")
    assert any(attribute in str(warning) for warning in model.warnings)
    with pytest.raises(condyle.Error, match=attribute):
        condyle.Model.from_mjcf_str(f"<mujoco>{inside}</mujoco>", strict=True)
