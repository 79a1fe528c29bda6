"""Compares robots in Condyle and MuJoCo. Each robot has one feature: one element or attribute of MuJoCo's schema of
MJCF.

    python tests/peers/mujoco/features.py [PATTERN]

prints a line for each feature. If a feature changes MuJoCo's compiled model (inertias, poses, limits, losses, actuators
and so on), it must change Condyle's model in the same way. Otherwise Condyle must give a warning or an error that names
the feature. `test_features.py` asserts this.
"""

import fnmatch
import functools
import json
import re
import sys
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np

import condyle
from condyle import conventions

SAME = 1e-9
"""Tolerance of inertia matrices, efforts and poses, relative to the largest number."""

INERTIAL = '<inertial pos="0.1 0.02 0.03" mass="2" diaginertia="0.02 0.03 0.04"/>'
MESH = '<mesh name="mesh" vertex="0 0 0  0.2 0 0  0 0.3 0  0 0 0.1"/>'
ROBOT = """<mujoco model="m">
<compiler/>
<option/>
<size/>
<default><default class="other"><joint armature="0.7"/><geom density="300"/></default></default>
<asset>{asset}</asset>
<worldbody>
  <body name="b" pos="0 0 1">{in_b}<joint name="j" axis="0 1 0"/>{inertial}<site name="s" pos="0.1 0 0"/>
    <body name="c" pos="0.3 0 0" euler="10 20 30"><joint name="k" type="slide" axis="1 0 0"/>
      <joint name="l" axis="0 0 1" pos="0 0.1 0"/>
      <geom name="g" type="box" size="0.1 0.2 0.3" pos="0 0 0.2" mass="1"/><site name="t" pos="0 0.1 0"/>{in_c}</body>
  </body>
  {in_world}
</worldbody>
{after}
</mujoco>"""
HOLES = {"asset": MESH, "in_b": "", "in_c": "", "in_world": "", "after": "", "inertial": INERTIAL}

ORIENTED = ["pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"]
ACTUATOR_TARGET = ["joint", "jointinparent", "tendon", "site", "refsite", "slidersite", "cranksite", "body"]

# Values that the test tries for each attribute, until MuJoCo accepts a value that has an effect.
# For attributes that are not listed here, the test tries the values in GENERIC.
VALUES = {
    "quat": ["0.8 0.2 0.4 0.4"],
    "axisangle": ["1 2 3 40"],
    "euler": ["10 20 30"],
    "xyaxes": ["0 1 0 -1 0 0.5"],
    "zaxis": ["1 2 3"],
    "pos": ["0.1 0.2 0.3"],
    "fromto": ["0 0 0 0.2 0.1 0.3"],
    "angle": ["radian"],
    "eulerseq": ["zyx"],
    "inertiafromgeom": ["true", "false"],
    "inertiagrouprange": ["1 2"],
    "coordinate": ["global"],
    "axis": ["1 0 0"],
    "range": ["-0.5 0.7", "0 60"],
    "actuatorfrcrange": ["-2 5"],
    "ctrlrange": ["-1 2"],
    "forcerange": ["-3 4"],
    "actrange": ["-1 1"],
    "springdamper": ["0.5 1"],
    "stiffness": ["5", "5 2", "5 2 1"],
    "damping": ["0.5", "0.5 0.1", "0.5 0.1 0.2"],
    "type": ["slide", "ball", "free", "capsule", "cylinder", "ellipsoid", "box", "mesh"],
    "mesh": ["mesh"],
    "class": ["other"],
    "childclass": ["other"],
    "fullinertia": ["0.02 0.03 0.04 0.001 0.002 0.003"],
    "diaginertia": ["0.05 0.06 0.07"],
    "size": ["0.2 0.3 0.4"],
    "fluidshape": ["ellipsoid"],
    "integrator": ["implicit"],
    "inertia": ["shell", "convex", "exact", "legacy"],
    "refpos": ["0.1 0.2 0.3"],
    "refquat": ["0.8 0.2 0.4 0.4"],
    "scale": ["1 2 3"],
    "gear": ["20", "1 2 3 4 5 6"],
    "gaintype": ["affine"],
    "biastype": ["affine"],
    "dyntype": ["integrator", "filter"],
    "gainprm": ["5 1 1"],
    "biasprm": ["1 2 3"],
    "polycoef": ["0.1 0.5 0 0 0", "0.1 0.5 0.2 0 0"],
    "anchor": ["0.1 0.2 0.3"],
    "relpose": ["0.1 0.2 0.3 0.8 0.2 0.4 0.4"],
    "springlength": ["0.1", "0.1 0.3"],
    "gravity": ["1 2 3"],
    "wind": ["1 2 3"],
    "magnetic": ["1 2 3"],
    "align": ["true"],
    "alignfree": ["true"],
    "limited": ["true"],
    "joint": ["j"],
    "joint1": ["j"],
    "joint2": ["l"],
    "jointinparent": ["j"],
    "tendon": ["tendon"],
    "site": ["s"],
    "site1": ["s"],
    "site2": ["t"],
    "refsite": ["t"],
    "body1": ["b"],
    "body2": ["c"],
    "body": ["b"],
    "qpos": ["0.1 0.2 0.3"],
    "qvel": ["0.1 0.2 0.3"],
    "ctrl": [""],
    "mocap": ["true"],
}
GENERIC = ["0.3", "true", "disable", "enable", "false", "1", "0.1 0.2", "0.1 0.2 0.3"]
VISUAL = {
    "visual",
    "size",
    "sensor",
    "statistic",
    "contact",
    "custom",
    "texture",
    "material",
    "skin",
    "light",
    "hfield",
    "layer",
    "bone",
}
"""Elements without effect on kinematics, dynamics and limits."""


def schema() -> Iterator[tuple[tuple[str, ...], list[str]]]:
    """Yields the path of each element and the names of its attributes."""
    path: list[str] = []
    attributes: list[str] = []
    for line in mujoco.mj_printSchema(False, False).splitlines():
        found = re.match(r"( *)(\S+) +\((.)\) +(.*)", line)
        if found is None:
            attributes.extend(line.split())
            continue
        if path:
            yield tuple(path), attributes
        level = len(found[1]) // 3
        path, attributes = [*path[:level], found[2].replace("(world)body", "body")], found[4].split()
    yield tuple(path), attributes


def homes(path: tuple[str, ...]) -> Iterator[tuple[str, str, str]]:
    """Yields test cases for an attribute of an element. A case consists of a name, a robot without the attribute, and
    the same robot with `@` in place of the attribute."""

    def robot(**holes: str) -> str:
        return ROBOT.format(**HOLES | holes)

    tag = path[-1]
    inside = {
        "joint": [f"<joint name='x' {kind}/>" for kind in ("", "type='slide'", "type='ball'")],
        "geom": [
            f"<geom name='x' {shape}/>"
            for shape in ("size='0.1 0.2 0.3'", "type='box' size='0.1 0.2 0.3'", "type='mesh' mesh='mesh'")
        ],
        "site": ["<site name='x' type='box' size='0.1 0.2 0.3'/>"],
        "camera": ["<camera name='x'/>"],
    }
    match path[1:]:
        case ("compiler" | "option" | "size",):
            base = robot(in_c=inside["geom"][1])
            yield tag, base, base.replace(f"<{tag}/>", f"<{tag} @/>")
        case ("option", "flag"):
            joint = "<joint name='x' axis='1 0 0' damping='1' stiffness='2' frictionloss='1' range='-10 10'/>"
            held = "<equality><joint name='e' joint1='j'/></equality>"
            driven = "<actuator><motor name='u' joint='j' forcerange='-1 2'/></actuator>"
            passive = robot(in_b=joint, after=held + driven)
            yield "option/flag", passive, passive.replace("<option/>", "<option><flag @/></option>")
        case ("body",):
            yield (
                "body",
                robot(in_c="<body name='x'><geom size='0.1'/></body>"),
                robot(in_c="<body name='x' @><geom size='0.1'/></body>"),
            )
        case ("body", "inertial"):
            yield "inertial", robot(), robot().replace("<inertial", "<inertial @")
        case ("body", "freejoint"):
            for free in ("<freejoint name='x'/>", "<joint name='x' type='free'/>"):
                base = robot(in_world=f"<body name='f'>{free}<geom size='0.1' pos='0.1 0 0'/></body>")
                yield "freejoint", base, base.replace(free, free.replace("/>", " @/>"))
        case ("body", "joint"):
            for joint in inside["joint"]:
                holes = {"in_c": f"<body name='y'>{joint}<geom size='0.1' pos='0.1 0 0'/></body>"}
                yield joint, robot(**holes), robot(**holes).replace(joint, joint.replace("/>", " @/>"))
            free = "<joint name='x' type='free'/>"
            base = robot(in_world=f"<body name='f'>{free}<geom size='0.1' pos='0.1 0 0'/></body>")
            yield free, base, base.replace(free, free.replace("/>", " @/>"))
        case ("body", ("geom" | "site" | "camera") as kind):
            for element in inside[kind]:
                yield element, robot(in_c=element), robot(in_c=element.replace("/>", " @/>"))
        case ("default", ("joint" | "geom" | "site" | "camera" | "mesh") as kind):
            element = inside.get(kind, ["<geom type='mesh' mesh='mesh'/>"])[0]
            holes = {"in_c": f"<body name='y'>{element}<geom size='0.1' pos='0.1 0 0'/></body>"}
            yield f"default/{kind}", robot(**holes), robot(**holes).replace("<default><", f"<default><{kind} @/><")
        case ("asset", "mesh"):
            holes = {"in_c": "<geom type='mesh' mesh='mesh'/>"}
            yield "asset/mesh", robot(**holes), robot(**holes).replace("<mesh name", "<mesh @ name")
        case ("tendon", "fixed"):
            for joints in ("<joint joint='j' coef='2'/>", "<joint joint='j' coef='2'/><joint joint='l' coef='3'/>"):
                base = f"<tendon><fixed name='tendon'>{joints}</fixed></tendon>"
                yield f"fixed {joints}", robot(after=base), robot(after=base.replace("'tendon'>", "'tendon' @>"))
        case ("tendon", "spatial"):
            base = "<tendon><spatial name='tendon'><site site='s'/><site site='t'/></spatial></tendon>"
            yield "spatial", robot(after=base), robot(after=base.replace("'tendon'>", "'tendon' @>"))
        case ("equality", ("connect" | "weld" | "joint") as kind):
            ends = "joint1='j' joint2='l'" if kind == "joint" else "body1='b' body2='f' anchor='0.1 0 0'"
            holes = {"in_world": "<body name='f'><joint name='z' axis='1 0 0'/><geom size='0.1' pos='0.1 0 0'/></body>"}
            base = f"<equality><{kind} name='x' {ends}/></equality>"
            yield kind, robot(**holes), robot(**holes, after=base)  # this feature is a whole element
            yield kind, robot(**holes, after=base), robot(**holes, after=base.replace("/>", " @/>"))
        case ("actuator", kind):
            ends = {
                "adhesion": ["body='b'"],
                "orientation": ["joint='z'", "site='s' refsite='t'"],
                "muscle": ["joint='j' lengthrange='0 1'"],
                "plugin": [],
                "motor": ["joint='j'", "joint='k'", "joint='z'", "jointinparent='j'", "tendon='tendon'", "site='s'"],
            }.get(kind, ["joint='j'", "tendon='tendon'"])
            more = {
                "cylinder": " timeconst='1' area='2'",
                "adhesion": " ctrlrange='0 1'",
                "damper": " ctrlrange='0 1'",
                "dcmotor": " motorconst='1' resistance='2'",
            }.get(kind, "")
            for end in ends:
                holes = {
                    "in_world": "<body name='f'><joint name='z' type='ball'/><geom size='0.1' pos='0.1 0 0'/></body>"
                }
                tendon = "<tendon><fixed name='tendon'><joint joint='j' coef='2'/></fixed></tendon>"
                base = f"{tendon}<actuator><{kind} name='x' {end}{more}/></actuator>"
                yield f"{kind} {end}", robot(**holes, after=tendon), robot(**holes, after=base)
                yield (
                    f"{kind} {end}",
                    robot(**holes, after=base),
                    robot(**holes, after=base.replace("/></act", " @/></act")),
                )
        case ("keyframe", "key"):
            base = "<keyframe><key name='x'/></keyframe>"
            yield "key", robot(), robot(after=base)
            yield "key", robot(after=base), robot(after=base.replace("/>", " @/>"))


@functools.cache
def compiled(text: str) -> tuple[Any, dict[str, Any]] | str:
    """Compiles a text by MuJoCo. Returns MuJoCo's model and its fields that affect kinematics, dynamics or limits, or
    MuJoCo's error."""
    try:
        m = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        return str(error)
    d = mujoco.MjData(m)
    effect: dict[str, Any] = {"tree": [m.nq, m.nv, *m.jnt_type, *m.jnt_bodyid]}
    rng = np.random.default_rng(0)
    mujoco.mj_integratePos(m, d.qpos, rng.standard_normal(m.nv), 1.0)
    d.qvel[:] = rng.standard_normal(m.nv)
    mujoco.mj_forward(m, d)
    M = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, M, d.qM) if hasattr(d, "qM") else mujoco.mj_fullM(m, d, M)
    effect |= {"M": M, "bias": d.qfrc_bias.copy(), "passive": d.qfrc_passive.copy(), "gravity": m.opt.gravity.copy()}
    names = {
        "body": (m.nbody, d.xpos, d.xmat),
        "site": (m.nsite, d.site_xpos, d.site_xmat),
        "camera": (m.ncam, d.cam_xpos, d.cam_xmat),
    }
    for kind, (count, at, turned) in names.items():
        named = [(mujoco.mj_id2name(m, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), i), i) for i in range(count)]
        for name, i in named:
            if name:
                effect[f"{kind} {name}"] = np.hstack([at[i], turned[i]])
    limited, forced = m.jnt_limited.astype(bool), m.jnt_actfrclimited.astype(bool)
    bits = mujoco.mjtDisableBit
    constrained = not m.opt.disableflags & bits.mjDSBL_CONSTRAINT
    limited = limited & (constrained and not m.opt.disableflags & bits.mjDSBL_LIMIT)
    effect["range"] = np.where(limited[:, None], m.jnt_range, [-np.inf, np.inf])
    effect["friction"] = m.dof_frictionloss * (constrained and not m.opt.disableflags & bits.mjDSBL_FRICTIONLOSS)
    effect["actfrcrange"] = np.where(forced[:, None], m.jnt_actfrcrange, [-np.inf, np.inf])
    for field in [
        "dof_damping",
        "dof_dampingpoly",
        "jnt_stiffness",
        "jnt_stiffnesspoly",
        "body_gravcomp",
        "body_mocapid",
        "tendon_type",
        "tendon_stiffness",
        "tendon_damping",
        "tendon_armature",
        "tendon_frictionloss",
        "eq_type",
        "eq_obj1id",
        "eq_obj2id",
        "eq_data",
        "eq_active0",
        "key_qpos",
        "key_qvel",
        "actuator_trntype",
        "actuator_trnid",
        "actuator_gear",
        "actuator_gaintype",
        "actuator_gainprm",
        "actuator_biastype",
        "actuator_biasprm",
        "actuator_dyntype",
        "actuator_dynprm",
        "actuator_forcelimited",
        "actuator_ctrllimited",
    ]:
        effect[field] = getattr(m, field).copy()
    effect["eq_data"][:, 10] = 0.0  # the comparison ignores the torque scale, which only affects compliant welds
    effect["actuator_biasprm"][m.actuator_biastype == 0] = 0.0
    effect["actuator_dynprm"][m.actuator_dyntype == 0] = 0.0
    for name in ("tendon_range", "actuator_forcerange", "actuator_ctrlrange"):
        on = getattr(m, {"tendon_range": "tendon_limited"}.get(name, name.replace("range", "limited"))).astype(bool)
        effect[name] = np.where(on[:, None], getattr(m, name), [-np.inf, np.inf])
    felt = bits.mjDSBL_GRAVITY | bits.mjDSBL_SPRING | bits.mjDSBL_DAMPER | bits.mjDSBL_FRICTIONLOSS
    felt |= bits.mjDSBL_LIMIT | bits.mjDSBL_EQUALITY | bits.mjDSBL_ACTUATION
    effect["disabled"] = [int(m.opt.disableflags) & int(felt)]
    effect["fluid"] = [m.opt.density, m.opt.viscosity, *(m.opt.wind if m.opt.density or m.opt.viscosity else ())]
    return (m, d), effect


def rounded(x: Any) -> Any:
    """Rounds the numbers of a JSON value to 12 digits."""
    if isinstance(x, float):
        return float(f"{x:.12g}")
    if isinstance(x, list):
        return [rounded(y) for y in x]
    return {name: rounded(y) for name, y in x.items()} if isinstance(x, dict) else x


@functools.cache
def ours(text: str) -> tuple[condyle.Model, dict[str, Any]] | str:
    """Returns Condyle's model of a text and all its contents, or Condyle's error."""
    try:
        model = condyle.Model.from_mjcf_str(text)
    except condyle.Error as error:
        return str(error)
    described = json.loads(model.to_json())
    return model, {name: json.dumps(rounded(value)) for name, value in described.items() if name != "warnings"}


def changed(a: dict[str, Any], b: dict[str, Any]) -> list[str]:
    """Returns the names of the fields in which two models differ."""

    def same(x: Any, y: Any) -> bool:
        if isinstance(x, str) or isinstance(y, str) or not np.shape(x) or not np.shape(y) or len(x) != len(y):
            return (
                bool(np.shape(x) == np.shape(y) and x == y)
                if isinstance(x, str)
                else bool(np.size(x) == np.size(y) == 0)
            )
        try:
            x, y = np.asarray(x, float), np.asarray(y, float)
        except (ValueError, TypeError):
            return x == y
        return x.shape == y.shape and np.allclose(x, y, rtol=1e-12, atol=1e-14)

    return sorted(name for name in a.keys() | b.keys() if name not in a or name not in b or not same(a[name], b[name]))


def differences(theirs: tuple[Any, dict[str, Any]], mine: tuple[condyle.Model, dict[str, Any]]) -> list[str]:
    """Returns the names of the quantities in which Condyle's robot differs from MuJoCo's."""
    (m, d), effect = theirs
    model, _ = mine
    if (model.nq, model.nv) != (m.nq, m.nv):
        return [f"nq, nv = {model.nq}, {model.nv}, expected {m.nq}, {m.nv}"]
    there = conventions.Coordinates(model, "mujoco")
    q = there.position_from(d.qpos)
    v = there.velocity_from(d.qpos, d.qvel)
    data = condyle.Data(model)
    turn = np.array([there.velocity(q, e) for e in np.eye(model.nv)]).T  # MuJoCo's velocity = turn · Condyle's velocity
    wrong = []

    def expect(name: str, found: Any, expected: Any) -> None:
        if not np.allclose(found, expected, rtol=0, atol=SAME * (1 + np.abs(expected).max(initial=0.0))):
            wrong.append(name)

    expect("M", condyle.crba(model, data, q), turn.T @ effect["M"] @ turn)
    a = there.acceleration_from(d.qpos, d.qvel, np.zeros(m.nv))
    tau = condyle.rnea(model, data, q, v, a)
    expect("bias", there.effort(q, tau), effect["bias"])
    passive = there.effort(q, condyle.passive_torque(model, q, v, 1e-3))
    passive = passive + model.friction * np.tanh(d.qvel / 1e-3)  # without friction, a constraint in MuJoCo
    expect("passive", passive, effect["passive"])
    expect("gravity", model.gravity, effect["gravity"] if not effect["disabled"][0] & 128 else 0 * effect["gravity"])
    frames = {f.name for f in model.frames}
    for name, pose in effect.items():
        kind, _, own = name.partition(" ")
        if kind in ("body", "site", "camera") and own in frames:
            X = condyle.frame_placement(model, data, q, own)
            expect(name, np.hstack([X[:3, 3], np.ravel(X[:3, :3])]), pose)
        elif kind in ("body", "site", "camera") and own:
            wrong.append(f"no frame {own}")
    ranges = np.array(
        [
            r
            for r, kind in zip(effect["range"], m.jnt_type, strict=True)
            for _ in range(1 if kind > 1 else 7 if kind == 0 else 4)
        ]
    )
    single = np.array([kind > 1 for kind in m.jnt_type for _ in range(1 if kind > 1 else 7 if kind == 0 else 4)])
    # Condyle stores a tendon over one joint as a property of the joint.
    if not ((m.tendon_num == 1) & ((m.tendon_frictionloss > 0) | (m.tendon_limited > 0))).any():
        found = np.vstack([model.limits.lower, model.limits.upper]).T[single]
        if single.any() and not np.allclose(found, ranges[single]):
            wrong.append("range")
        expect("friction", model.friction, effect["friction"])
    return wrong


def cases() -> Iterator[tuple[str, str, str]]:
    """Yields the test cases of all features. A case consists of a name, a robot without the feature, and the same robot
    with the feature."""
    for path, attributes in schema():
        if VISUAL & set(path):
            continue
        for home, base, text in homes(path):
            if "@" not in text:
                yield f"{'/'.join(path)} in {home}", base, text
                continue
            for attribute in attributes:
                if (
                    attribute in ("name", "user", "group", "rgba", "material")
                    or f" {attribute}=" in re.findall(r"<[^<>]*@[^<>]*>", text)[0]
                ):
                    continue
                for value in VALUES.get(attribute, GENERIC):
                    yield (
                        f"{'/'.join(path)} {attribute}='{value}' in {home}",
                        base,
                        text.replace("@", f"{attribute}='{value}'"),
                    )


def verdict(base: str, text: str) -> tuple[str, str]:
    """Compares Condyle's treatment of a feature with MuJoCo's. The verdict is `held`, `warned`, `refused`, `no effect`,
    `wrong`, `silent` (ignored without a warning), or `invalid` if MuJoCo rejects the robot."""
    theirs, before = compiled(text), compiled(base)
    if isinstance(theirs, str):
        return "invalid", theirs.splitlines()[0]
    mine, plain = ours(text), ours(base)
    if isinstance(before, str) or isinstance(plain, str):
        return "broken", f"{before if isinstance(before, str) else plain}"
    effect = changed(before[1], theirs[1])
    if isinstance(mine, str):
        return "refused", mine
    warnings = [str(w) for w in mine[0].warnings]
    known = [str(w) for w in plain[0].warnings]
    # If an element is left out, its warning exists with and without the attribute, so warnings about `x` count, too.
    said = [w for w in warnings if w not in known or "`x`" in w]
    if not said and (wrong := differences(theirs, mine)):
        return "wrong", f"{wrong}; MuJoCo's changes: {effect}"
    if not effect:
        return "no effect", " ".join(said)
    if said:
        return "warned", " ".join(said)
    own = changed(plain[1], mine[1])
    return ("held", f"{own}") if own else ("silent", f"{effect}")


if __name__ == "__main__":
    pattern = sys.argv[1] if len(sys.argv) > 1 else "*"
    counts: dict[str, int] = {}
    for name, base, text in cases():
        if fnmatch.fnmatch(name, pattern):
            try:
                kind, what = verdict(base, text)
            except Exception as error:  # a failure of the comparison itself is reported as a crash
                kind, what = "crash", repr(error)
            counts[kind] = counts.get(kind, 0) + 1
            print(f"{kind:10} {name}: {what}")
    print(counts)
    sys.exit(bool(counts.keys() & {"silent", "wrong", "crash", "broken"}))
