"""Converts compiled MuJoCo models to plain MJCF, which has no elements that need MuJoCo's compiler or other files.

`Model.from_mujoco` reads this text like the text of any MJCF, so the rules for limits, springs, actuators and warnings
are the same. Numbers are written with all digits.
"""

import sys
from collections.abc import Iterable, Iterator
from os import PathLike
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from ._condyle import ModelError

FREE, BALL, SLIDE, HINGE = range(4)
JOINTS = ("free", "ball", "slide", "hinge")
CAMERAS = ("fixed", "track", "trackcom", "targetbody", "targetbodycom")
JOINT_WRAP, SITE_WRAP = 1, 3
SITE_OBJECT = 6
"""The value for sites in MuJoCo's enumeration of object types."""
FLAGS = {
    "constraint": 1 << 0, "equality": 1 << 1, "frictionloss": 1 << 2, "limit": 1 << 3, "spring": 1 << 5,
    "damper": 1 << 6, "gravity": 1 << 7, "clampctrl": 1 << 8, "actuation": 1 << 11,
}  # fmt: skip
"""Features that a model can disable, with their bits in MuJoCo 4. In other versions, the bits are read from MuJoCo."""

_Attributes = dict[str, Any]


def mjcf(model: Any) -> str:
    """Returns the text of an MJCF that describes a compiled model."""
    if not (hasattr(model, "nbody") and hasattr(model, "opt")):
        found, hint = type(model).__name__, ""
        if hasattr(model, "compile"):
            hint = "; call spec.compile()"
        elif hasattr(model, "model"):
            hint = "; give data.model"
        elif isinstance(model, (str, PathLike)):
            hint = "; `from_mjcf` reads a file"
        raise TypeError(f"model: expected an MjModel, found {found}{hint}")
    return _Text(model).text()


class _Text:
    """A writer of the MJCF's text. It gives names to unnamed items."""

    def __init__(self, model: Any) -> None:
        self.m = model
        self.bodies = self._names("body", model.nbody)
        self.joints = self._names("jnt", model.njnt)
        self._name_the_unnamed()
        self.sites = self._names("site", model.nsite)
        self.tendons = self._names("tendon", model.ntendon)

    def text(self) -> str:
        """Returns the whole document, with one line for each element."""
        m = self.m
        compiler = {"angle": "radian", "autolimits": False, "inertiafromgeom": False, "balanceinertia": False}
        option = {"gravity": m.opt.gravity, "density": m.opt.density, "viscosity": m.opt.viscosity, "wind": m.opt.wind}
        disabled = int(getattr(m.opt, "disableactuator", 0))
        groups = {"actuatorgroupdisable": [group for group in range(31) if disabled >> group & 1]} if disabled else {}
        lines = [
            f"<mujoco model={quoteattr(self._name(0))}>",
            _element("compiler", compiler),
            _element(
                "option", {k: v for k, v in option.items() if k == "gravity" or np.any(v)} | groups, self._flags()
            ),
            "<worldbody>",
            *self._inside(0),
        ]
        open_bodies = [0]  # bodies are numbered depth first
        for body in range(1, m.nbody):
            while open_bodies[-1] != m.body_parentid[body]:
                lines.append("</body>")
                open_bodies.pop()
            attributes = {"name": self.bodies[body], "pos": m.body_pos[body], "quat": m.body_quat[body]}
            if m.body_gravcomp[body]:
                attributes["gravcomp"] = m.body_gravcomp[body]
            if m.body_mocapid[body] >= 0:
                attributes["mocap"] = True
            lines += [_element("body", attributes).removesuffix("/>") + ">", *self._inside(body)]
            open_bodies.append(body)
        lines += ["</body>"] * (len(open_bodies) - 1) + ["</worldbody>"]
        flexes = [_element("flex", {"name": name}) for name in self._names("flex", getattr(m, "nflex", 0))]
        for section, elements in (
            ("deformable", flexes),
            ("tendon", self._tendons()),
            ("equality", self._equalities()),
            ("actuator", self._actuators()),
            ("keyframe", self._keyframes()),
        ):
            inside = list(elements)
            lines += [f"<{section}>", *inside, f"</{section}>"] if inside else []
        return "\n".join([*lines, "</mujoco>"])

    def _name(self, address: int) -> str:
        names: bytes = self.m.names
        return names[address : names.index(b"\0", address)].decode()

    def _names(self, kind: str, count: int) -> list[str]:
        return [self._name(int(address)) for address in getattr(self.m, f"name_{kind}adr")[:count]] if count else []

    def _name_the_unnamed(self) -> None:
        """Gives unnamed bodies and joints the names that Condyle's MJCF reader gives them, so that other elements can
        refer to them.
        """
        taken = {*self.bodies}, {*self.joints}
        for body in range(1, self.m.nbody):
            name = self.bodies[body] = self.bodies[body] or _free(f"body{body}", taken[0])
            first, count = int(self.m.body_jntadr[body]), int(self.m.body_jntnum[body])
            for k, joint in enumerate(range(first, first + count), start=1):
                number = "" if count == 1 else str(k)
                self.joints[joint] = self.joints[joint] or _free(f"{name}_joint{number}", taken[1])

    def _word(self, enumeration: str, prefix: str, number: int, otherwise: tuple[str, ...]) -> str:
        """Returns the word for a value of an enumeration, in the MuJoCo version of the model."""
        package = sys.modules.get(type(self.m).__module__.partition(".")[0])
        members = getattr(getattr(package, enumeration, None), "__members__", {})
        words = {int(value): name.removeprefix(prefix).lower() for name, value in members.items()}
        words = words or dict(enumerate(otherwise))
        return str(words.get(int(number), number))

    def _flags(self) -> list[str]:
        package = sys.modules.get(type(self.m).__module__.partition(".")[0])
        members = getattr(getattr(package, "mjtDisableBit", None), "__members__", {})
        bits = {flag: int(members.get(f"mjDSBL_{flag.upper()}", 0 if members else bit)) for flag, bit in FLAGS.items()}
        disabled = {flag: "disable" for flag, bit in bits.items() if self.m.opt.disableflags & bit}
        return [_element("flag", disabled)] if disabled else []

    def _inside(self, body: int) -> Iterator[str]:
        """Yields inertia, joints, sites, cameras and plugins of a body."""
        m = self.m
        if body and (m.body_mass[body] or np.any(m.body_inertia[body])):
            pose = {"pos": m.body_ipos[body], "quat": m.body_iquat[body]}
            yield _element("inertial", {**pose, "mass": m.body_mass[body], "diaginertia": m.body_inertia[body]})
        for joint in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
            yield self._joint(joint)
        for site in np.flatnonzero(m.site_bodyid == body):
            if self.sites[site]:
                pose = {"pos": m.site_pos[site], "quat": m.site_quat[site]}
                yield _element("site", {"name": self.sites[site], **pose})
        for camera in np.flatnonzero(m.cam_bodyid == body):
            if name := self._name(int(m.name_camadr[camera])):
                pose = {"pos": m.cam_pos[camera], "quat": m.cam_quat[camera]}
                mode: _Attributes = {"mode": CAMERAS[m.cam_mode[camera]]} if m.cam_mode[camera] else {}
                if m.cam_targetbodyid[camera] >= 0:
                    mode["target"] = self.bodies[m.cam_targetbodyid[camera]]
                yield _element("camera", {"name": name, **mode, **pose})
        if m.nplugin and m.body_plugin[body] >= 0:
            yield self._plugin(int(m.body_plugin[body]), {})

    def _plugin(self, number: int, attributes: _Attributes) -> str:
        instance = self._name(int(self.m.name_pluginadr[number])) or str(number)
        return _element("plugin", {**attributes, "instance": instance})

    def _joint(self, joint: int) -> str:
        m = self.m
        kind, q, v = int(m.jnt_type[joint]), int(m.jnt_qposadr[joint]), int(m.jnt_dofadr[joint])
        name = self.joints[joint]
        attributes: _Attributes = {"name": name, "type": JOINTS[kind]}
        if kind != FREE:
            attributes |= {"pos": m.jnt_pos[joint], "axis": m.jnt_axis[joint]}
            attributes |= _range("range", "limited", m.jnt_limited[joint], m.jnt_range[joint])
            limited, forces = m.jnt_actfrclimited[joint], m.jnt_actfrcrange[joint]
            attributes |= _range("actuatorfrcrange", "actuatorfrclimited", limited, forces)
        if kind in (SLIDE, HINGE):
            attributes |= {"ref": m.qpos0[q], "springref": m.qpos_spring[q]}
        elif m.jnt_stiffness[joint]:
            places = slice(q, q + (7 if kind == FREE else 4))
            if not np.array_equal(m.qpos_spring[places], m.qpos0[places]):
                raise ModelError(
                    f"joint `{name}`: its spring rests at {m.qpos_spring[places]}, not where it is at first"
                )
        stiffness = _polynomial(m.jnt_stiffness[joint], _row(m, "jnt_stiffnesspoly", joint))
        freedoms = range(v, v + (6, 3, 1, 1)[kind])
        damping = [_polynomial(m.dof_damping[k], _row(m, "dof_dampingpoly", k)) for k in freedoms]
        losses = {"damping": damping}
        losses |= {
            what: [[float(getattr(m, f"dof_{what}")[k])] for k in freedoms] for what in ("frictionloss", "armature")
        }
        for what, found in losses.items():
            if any(numbers != found[0] for numbers in found):
                raise ModelError(f"joint `{name}`: expected one {what} for all its degrees of freedom, found {found}")
        own = {"stiffness": stiffness} | {what: numbers[0] for what, numbers in losses.items()}
        attributes |= {what: numbers for what, numbers in own.items() if any(numbers)}
        if m.jnt_actgravcomp[joint]:
            attributes["actuatorgravcomp"] = True
        if _row(m, "jnt_springyield", joint) > 0:
            attributes["springyield"] = m.jnt_springyield[joint]
        return _element("joint", attributes)

    def _tendons(self) -> Iterator[str]:
        m = self.m
        for t, name in enumerate(self.tendons):
            wraps = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
            attributes: _Attributes = {"name": name or f"tendon{t}"}
            attributes |= _range("range", "limited", m.tendon_limited[t], m.tendon_range[t])
            if hasattr(m, "tendon_actfrclimited"):
                limited, forces = m.tendon_actfrclimited[t], m.tendon_actfrcrange[t]
                attributes |= _range("actuatorfrcrange", "actuatorfrclimited", limited, forces)
            stiffness = _polynomial(m.tendon_stiffness[t], _row(m, "tendon_stiffnesspoly", t))
            damping = _polynomial(m.tendon_damping[t], _row(m, "tendon_dampingpoly", t))
            found = {"stiffness": stiffness, "damping": damping, "frictionloss": [float(m.tendon_frictionloss[t])]}
            found["armature"] = [float(_row(m, "tendon_armature", t))]
            attributes |= {what: numbers for what, numbers in found.items() if any(numbers)}
            if any(stiffness):
                attributes["springlength"] = m.tendon_lengthspring[t]
            joints = [k for k in wraps if m.wrap_type[k] == JOINT_WRAP]
            if len(joints) == len(wraps):
                inside = [
                    _element("joint", {"joint": self.joints[m.wrap_objid[k]], "coef": m.wrap_prm[k]}) for k in joints
                ]
                yield _element("fixed", attributes, inside)
            else:
                sites = [self.sites[m.wrap_objid[k]] for k in wraps if m.wrap_type[k] == SITE_WRAP]
                yield _element("spatial", attributes, [_element("site", {"site": site}) for site in sites])

    def _equalities(self) -> Iterator[str]:
        m = self.m
        for e, name in enumerate(self._names("eq", m.neq)):
            kind = self._word("mjtEq", "mjEQ_", m.eq_type[e], ("connect", "weld", "joint", "tendon", "flex"))
            attributes: _Attributes = {"name": name} if name else {}
            if not m.eq_active0[e]:
                attributes["active"] = False
            data, pair = m.eq_data[e], [int(m.eq_obj1id[e]), int(m.eq_obj2id[e])]
            if kind in ("connect", "weld"):
                is_site = m.eq_objtype[e] == SITE_OBJECT
                names, what = (self.sites, "site") if is_site else (["world", *self.bodies[1:]], "body")
                attributes |= {f"{what}{k}": names[i] for k, i in enumerate(pair, start=1)}
                if kind == "connect" and not is_site:
                    attributes["anchor"] = data[:3]
                elif kind == "weld" and not is_site:
                    attributes |= {"anchor": data[:3], "relpose": data[3:10]}
            elif kind in ("joint", "tendon"):
                names = self.joints if kind == "joint" else self.tendons
                attributes |= {f"{kind}{k}": names[i] for k, i in enumerate(pair, start=1) if i >= 0}
                attributes["polycoef"] = data[:5]
            yield _element(kind, attributes)

    def _actuators(self) -> Iterator[str]:
        m = self.m
        for a, name in enumerate(self._names("actuator", len(m.actuator_trntype))):
            control, output = (int(getattr(m, f"actuator_{of}adr", range(m.nu))[a]) for of in ("ctrl", "out"))
            driven = self._word("mjtTrn", "mjTRN_", m.actuator_trntype[a], tuple(TRANSMISSIONS))
            attributes: _Attributes = {"name": name} if name else {}
            target = int(m.actuator_trnid[a][0])
            attributes |= {
                attribute: getattr(self, names)[target] for attribute, names in TRANSMISSIONS.get(driven, ())
            }
            if driven == "site" and m.actuator_trnid[a][1] >= 0:
                attributes["refsite"] = self.sites[m.actuator_trnid[a][1]]
            attributes["gear"] = m.actuator_gear[output]
            attributes |= _range(
                "ctrlrange", "ctrllimited", m.actuator_ctrllimited[control], m.actuator_ctrlrange[control]
            )
            attributes |= _range("forcerange", "forcelimited", m.actuator_forcelimited[a], m.actuator_forcerange[a])
            is_plugin, dimension = m.nplugin and m.actuator_plugin[a] >= 0, int(_row(m, "actuator_actnum", a))
            if is_plugin or dimension > 1:
                attributes["actdim"] = dimension
            if is_plugin:
                yield self._plugin(int(m.actuator_plugin[a]), attributes)
                continue
            attributes |= _range("actrange", "actlimited", m.actuator_actlimited[a], m.actuator_actrange[a])
            kinds = ("fixed", "affine", "muscle"), ("none", "affine", "muscle")
            attributes["gaintype"] = self._word("mjtGain", "mjGAIN_", m.actuator_gaintype[a], kinds[0])
            attributes["biastype"] = self._word("mjtBias", "mjBIAS_", m.actuator_biastype[a], kinds[1])
            states = ("none", "integrator", "filter", "filterexact", "muscle")
            attributes["dyntype"] = self._word("mjtDyn", "mjDYN_", m.actuator_dyntype[a], states)
            for what in ("gainprm", "biasprm", "dynprm"):
                numbers = getattr(m, f"actuator_{what}")[a]
                attributes[what] = numbers[: max(1, int(np.max(np.flatnonzero(numbers), initial=0)) + 1)]
            found = {"damping": _polynomial(_row(m, "actuator_damping", a), _row(m, "actuator_dampingpoly", a))}
            found["armature"] = [float(_row(m, "actuator_armature", a))]
            found["group"] = [float(_row(m, "actuator_group", a))]
            yield _element("general", attributes | {what: numbers for what, numbers in found.items() if any(numbers)})

    def _keyframes(self) -> Iterator[str]:
        names = self._names("key", self.m.nkey)
        for k, name in enumerate(names):
            q, v = self.m.key_qpos[k], self.m.key_qvel[k]
            numbers = {"qvel": v, "ctrl": self._controls(self.m.key_ctrl[k]), "act": self.m.key_act[k]}
            # an unnamed keyframe with the default state is left out: it is unused space that the file has reserved
            if name or any(map(np.any, numbers.values())) or not np.array_equal(q, self.m.qpos0):
                given = {what: x for what, x in numbers.items() if len(x)}
                yield _element("key", {"name": name or _free(f"key{k}", {*names}), "qpos": q} | given)

    def _controls(self, numbers: Any) -> list[float]:
        """Returns the control of each actuator, in the order of an MJCF whose controls have no names."""
        m, found = self.m, []
        for a in range(len(m.actuator_trntype)):
            first, count = (
                int(getattr(m, f"actuator_ctrl{of}", otherwise)[a])
                for of, otherwise in (("adr", range(m.nu)), ("num", [1] * m.nu))
            )
            gain = self._word("mjtGain", "mjGAIN_", m.actuator_gaintype[a], ("fixed", "affine", "muscle"))
            counted = {"pid": 2, "so3": 3}.get(gain, 1)
            own = [float(x) for x in numbers[first : first + min(count, counted)]]
            found += own + [0.0] * (counted - len(own))
        return found


TRANSMISSIONS = {
    "joint": (("joint", "joints"),),
    "jointinparent": (("jointinparent", "joints"),),
    "slidercrank": (("cranksite", "sites"),),
    "tendon": (("tendon", "tendons"),),
    "site": (("site", "sites"),),
    "body": (("body", "bodies"),),
    "so3": (("joint", "joints"),),
}
"""For each type of transmission, the attribute that names the driven item, and the name of the list of these items'
names.
"""


def _free(name: str, taken: set[str]) -> str:
    """Returns the given name, or a similar name if the given name is taken. Marks the result as taken."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _row(model: Any, field: str, number: int) -> Any:
    """Returns a row of a field of the model, or 0 if this version of MuJoCo does not have the field."""
    numbers = getattr(model, field, None)
    return 0.0 if numbers is None else numbers[number]


def _polynomial(first: Any, others: Any) -> list[float]:
    """Returns the first coefficient of a polynomial, followed by the higher coefficients if one of these is not 0."""
    higher = [float(x) for x in np.ravel(others)]
    return [float(first), *higher] if any(higher) else [float(first)]


def _range(name: str, limited: str, limits: Any, numbers: Any) -> _Attributes:
    return {limited: True, name: numbers} if limits else {limited: False}


def _element(tag: str, attributes: _Attributes, inside: Iterable[str] = ()) -> str:
    """Returns the text of an element, with all digits of its numbers."""
    words = [f" {name}={quoteattr(_value(value))}" for name, value in attributes.items()]
    content = "".join(inside)
    return f"<{tag}{''.join(words)}" + (f">{content}</{tag}>" if content else "/>")


def _value(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    return " ".join(repr(float(x)) for x in np.ravel(value))
