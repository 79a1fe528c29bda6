"""Compares robots with MuJoCo. For MJCFs, Condyle and MuJoCo order coordinates equally; for URDFs, joints are matched
by name."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from comparison import STATES, Joint, Quantities, RefusedError, UnlikeError, state_of, there, without_rotors
from mujoco_actuators import acts, efforts

import condyle

TOLERANCE = 1e-8
"""Tolerance of most results: MuJoCo stores inertias as principal moments and a quaternion."""
MESHES = 1e-6
"""Tolerance for robots with meshes: MuJoCo stores vertices in single precision."""
KINDS = {
    int(mujoco.mjtJoint.mjJNT_FREE): {"free_flyer"},
    int(mujoco.mjtJoint.mjJNT_BALL): {"spherical"},
    int(mujoco.mjtJoint.mjJNT_SLIDE): {"prismatic"},
    int(mujoco.mjtJoint.mjJNT_HINGE): {"revolute", "continuous"},
}
EASE = 1e12
"""Speed over which `passive_torque` smooths Coulomb friction. The speed is so large that friction is almost zero,
because MuJoCo's passive forces contain no friction."""


WARNED = (
    ("spatial", "a spatial tendon is left out, as a warning says", ("passive efforts", "M", "bias")),
    (
        "the tendon runs over several joints",
        "a tendon over several joints has no spring and no damping, as a warning says",
        ("passive efforts",),
    ),
    ("armature: it is missing in M", "armature of a tendon is left out, as a warning says", ("M", "bias")),
    (
        "meshes of plugins are not supported",
        "mass of a mesh of a plugin is left out, as a warning says",
        ("total mass", "M", "bias", "passive efforts"),
    ),
    ("the keyframes of the model", "keyframes of an attached model are left out, as a warning says", ("keyframes",)),
)
"""Map from words of a warning to the quantities that differ because of the warned feature."""


def read(path: Path) -> mujoco.MjModel:
    """Returns MuJoCo's model for a file."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, RuntimeError, MemoryError) as error:
        raise RefusedError(str(error).strip().splitlines()[0]) from None


def read_urdf(path: Path) -> mujoco.MjModel:
    """Returns MuJoCo's model of a URDF without geometry, because geometry needs mesh files and has no effect on the
    compared quantities."""
    try:
        tree = ElementTree.fromstring(path.read_bytes())
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise RefusedError(str(error)) from None
    if any(element.tag.endswith("}joint") for element in tree):
        raise RefusedError("joints of Drake's own are left out, so that links have no parent")
    for link in tree.iter("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for part in tree.findall("mujoco"):
        tree.remove(part)
    try:
        return mujoco.MjModel.from_xml_string(ElementTree.tostring(tree, encoding="unicode"))
    except (ValueError, RuntimeError, MemoryError) as error:
        raise RefusedError(str(error).strip().splitlines()[0]) from None


def compare_mjcf(mj: mujoco.MjModel, model: condyle.Model) -> Quantities:
    """Compares a robot from an MJCF. Condyle's model and MuJoCo's model have the same coordinates in the same order."""
    found = Quantities(model, MESHES if mj.nmesh else TOLERANCE)
    if (mj.nq, mj.nv) != (model.nq, model.nv):
        found.add("nq, nv", np.inf, f"{model.nq}, {model.nv}, theirs {mj.nq}, {mj.nv}")
        return found
    joints, carried = [], {}
    bodies = [i for i in range(1, model.nbodies) if model.nvs[i]]
    for i, j in zip(bodies, range(mj.njnt), strict=True):
        name = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_JOINT, j)
        if model.joint_types[i] not in KINDS[int(mj.jnt_type[j])]:
            found.add("kind of joint", np.inf, f"joint `{name}`: {model.joint_types[i]}")
            return found
        joints.append(Joint(i, int(mj.jnt_qposadr[j]), int(mj.jnt_dofadr[j])))
        carried[i] = int(mj.jnt_bodyid[j])
    found.expect("gravity", model.gravity, gravity(mj))
    friction = np.zeros(mj.nv) if disabled(mj, "FRICTIONLOSS") else mj.dof_frictionloss
    compare(found, mj, joints, carried)
    found.expect("armature", model.armature, mj.dof_armature, found.coordinate)
    found.expect("friction", model.friction, friction, found.coordinate)
    ours, theirs = np.stack([model.limits.effort_lower, model.limits.effort_upper], 1), efforts(mj)
    ours[np.isnan(theirs)] = np.nan
    found.expect("limits: effort", ours, theirs, found.coordinate)
    actuators(found, mj)
    passive(found, mj, joints)
    keyframes(found, mj, joints)
    return found


def weightless_moments(path: Path) -> bool:
    """Returns whether a link of a URDF has moments of inertia, but the mass 0."""
    for inertial in ElementTree.fromstring(path.read_bytes()).iter("inertial"):
        mass, inertia = inertial.find("mass"), inertial.find("inertia")
        weightless = mass is not None and inertia is not None and float(mass.get("value", "0")) == 0.0
        if weightless and any(float(number) for number in inertia.attrib.values()):
            return True
    return False


def compare_urdf(path: Path, mj: mujoco.MjModel, model: condyle.Model) -> Quantities:
    """Compares a robot from a URDF. MuJoCo fixes the root link to the world. Joints of the two models are matched by
    name."""
    model = without_rotors(model)
    found = Quantities(model, TOLERANCE)
    joints, bodies = [], {}
    for i in range(1, model.nbodies):
        j = mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_JOINT, model.names[i])
        if model.joint_types[i] in ("planar", "free_flyer"):
            raise UnlikeError(f"{model.joint_types[i]} joints are other joints in MuJoCo's reading of URDF")
        if j < 0:
            found.add("joints", np.inf, f"joint `{model.names[i]}` is none of MuJoCo's")
            return found
        joints.append(Joint(i, int(mj.jnt_qposadr[j]), int(mj.jnt_dofadr[j])))
        bodies[i] = int(mj.jnt_bodyid[j])
    if mj.nv != model.nv:
        found.add("nq, nv", np.inf, f"{model.nq}, {model.nv}, theirs {mj.nq}, {mj.nv}")
        return found
    found.leave_out("MuJoCo leaves the mass of links on the world out", "total mass")
    if weightless_moments(path):
        found.leave_out("MuJoCo leaves moments of links of mass 0 out", "M", "bias")
    compare(found, mj, joints, bodies)
    return found


def gravity(mj: mujoco.MjModel) -> np.ndarray:
    """Returns MuJoCo's acceleration of gravity; zero if a flag disables gravity."""
    off = mj.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if off else mj.opt.gravity.copy()


def disabled(mj: mujoco.MjModel, constraint: str) -> bool:
    """Returns whether a flag of the file disables this kind of constraint, or all constraints."""
    bits = (int(getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}")) for name in (constraint, "CONSTRAINT"))
    return any(mj.opt.disableflags & bit for bit in bits)


def compare(found: Quantities, mj: mujoco.MjModel, joints: list[Joint], bodies: dict[int, int]) -> None:
    """Compares mass, limits of position, M, bias, poses of bodies, and frames of bodies and sites."""
    model, data = found.model, mujoco.MjData(mj)
    positions(found, mj, joints)
    warnings = " ".join(map(str, model.warnings))
    for words, why, quantities in WARNED:
        if words in warnings:
            found.leave_out(why, *quantities)
    found.expect("total mass", model.total_mass, mj.body_mass.sum())
    if mj.neq and not disabled(mj, "EQUALITY"):
        found.spoken(
            "equality", "follow", "mimic", "connect", "weld", "it is not held", held=bool(found.model.constraints())
        )
    mj.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    for seed in range(STATES):
        q, v = state_of(model, seed)
        state = there("mujoco", model, joints, q, v, mj.nq, mj.nv)
        data.qpos[:], data.qvel[:] = state.q, state.v
        mujoco.mj_forward(mj, data)
        M = np.zeros((mj.nv, mj.nv))
        if mj.nv:
            mujoco.mj_fullM(mj, data, M)
            found.inertia(q, v, state, M, data.qfrc_bias)
        frames(found, mj, data, q, bodies)


def pose(found: Quantities, what: str, name: str, ours: np.ndarray, p: np.ndarray, R: np.ndarray) -> None:
    """Compares a pose of Condyle with MuJoCo's position p and rotation R."""
    theirs = np.concatenate([R.reshape(3, 3), p[:, None]], 1)
    found.expect(what, ours[:3], theirs, lambda _: name)


def frames(found: Quantities, mj: mujoco.MjModel, data: mujoco.MjData, q: np.ndarray, bodies: dict[int, int]) -> None:
    """Compares the frames of all bodies with a joint, and of all other bodies and sites with a name."""
    own = {(frame.name, frame.body): i for i, frame in enumerate(found.model.frames) if frame.kind == "link"}
    for i, body in bodies.items():
        name = found.model.body_names[i]
        if (name, i) in own:
            placed = condyle.frame_placement(found.model, found.data, q, own[name, i])
            pose(found, "frames of bodies", f"body `{name}`", placed, data.xpos[body], data.xmat[body])
    kinds = (
        ("frames of bodies", mujoco.mjtObj.mjOBJ_BODY, data.xpos, data.xmat, ("link",)),
        ("sites", mujoco.mjtObj.mjOBJ_SITE, data.site_xpos, data.site_xmat, ("user",)),
    )
    for i, frame in enumerate(found.model.frames):
        for what, kind, p, R, ours in kinds:
            there = mujoco.mj_name2id(mj, kind, frame.name) if frame.kind in ours and frame.name else -1
            if there >= 0:
                placed = condyle.frame_placement(found.model, found.data, q, i)
                pose(found, what, f"frame `{frame.name}`", placed, p[there], R[there])
    names = {frame.name for frame in found.model.frames}
    for i in range(mj.nsite):
        name = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_SITE, i)
        if name and name not in names:
            found.add("sites", np.inf, f"site `{name}` is no frame")


def positions(found: Quantities, mj: mujoco.MjModel, joints: list[Joint]) -> None:
    """Compares limits of position for hinges and slides."""
    model, limits = found.model, found.model.limits
    by_address = {int(mj.jnt_qposadr[j]): j for j in range(mj.njnt)}
    for joint in joints:
        j, at = by_address[joint.q], model.idx_qs[joint.body]
        same = limits.lower[at] == limits.upper[at]
        if same and not mj.jnt_limited[j]:
            found.left_out["limits: position"] = "MuJoCo takes equal limits for none"
        elif model.nqs[joint.body] == 1:
            limited = mj.jnt_limited[j] and not disabled(mj, "LIMIT")
            lower, upper = mj.jnt_range[j] if limited else (-np.inf, np.inf)
            ours, name = (limits.lower[at], limits.upper[at]), f"joint `{model.names[joint.body]}`"
            found.expect("limits: position", ours, (lower, upper), lambda _, name=name: name)


def actuators(found: Quantities, mj: mujoco.MjModel) -> None:
    """Compares gains and gears of all actuators with a name. A warning must name each actuator that Condyle's model
    lacks."""
    ours = {actuator.name: actuator for actuator in found.model.actuators}
    warnings = " ".join(map(str, found.model.warnings))
    for i in range(mj.nactuator):
        name = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_ACTUATOR, i)
        if not name or not acts(mj, i) or mj.actuator_outnum[i] != 1:
            continue
        if name not in ours:
            # MuJoCo names a replica by the original name and a number
            if f"`{name}`" not in warnings and f"`{name.rstrip('0123456789')}`" not in warnings:
                found.add("actuators", np.inf, f"actuator `{name}` is missing, without a warning")
            continue
        where = f"actuator `{name}`"
        if mj.actuator_gaintype[i] == int(mujoco.mjtGain.mjGAIN_FIXED):
            affine = mj.actuator_biastype[i] == int(mujoco.mjtBias.mjBIAS_AFFINE)
            bias = mj.actuator_biasprm[i, 1:3] if affine else np.zeros(2)
            found.expect("actuators", (ours[name].kp, ours[name].kv), -bias, lambda _, where=where: where)
        gear = mj.actuator_gear[mj.actuator_outadr[i]]
        found.expect("actuators", ours[name].gear, gear, lambda _, where=where: where)


def passive(found: Quantities, mj: mujoco.MjModel, joints: list[Joint]) -> None:
    """Compares springs, damping and gravity compensation. Friction (a constraint in MuJoCo) and forces of fluids are
    not compared."""
    model, data = found.model, mujoco.MjData(mj)
    if not mj.nv:
        return
    for seed in range(STATES):
        q, v = state_of(model, 100 + seed)
        state = there("mujoco", model, joints, q, v, mj.nq, mj.nv)
        data.qpos[:], data.qvel[:] = state.q, state.v
        mujoco.mj_forward(mj, data)
        theirs = state.T.T @ (data.qfrc_spring + data.qfrc_damper + data.qfrc_gravcomp)
        if data.qfrc_fluid.any():
            found.spoken("fluid", "density", "viscosity")
        ours = condyle.passive_torque(model, q=q, v=v, smoothing=EASE)
        found.expect("passive efforts", ours, theirs, found.coordinate)


def keyframes(found: Quantities, mj: mujoco.MjModel, joints: list[Joint]) -> None:
    """Compares keyframes with the same name."""
    model = found.model
    for i in range(mj.nkey):
        name = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_KEY, i)
        if not name:
            continue
        if name not in model.keyframes:
            found.add("keyframes", np.inf, f"keyframe `{name}` is missing")
            continue
        q = np.asarray(model.keyframes[name], float)
        state = there("mujoco", model, joints, q, np.zeros(model.nv), mj.nq, mj.nv)
        found.expect("keyframes", state.q, mj.key_qpos[i], lambda _, name=name: f"keyframe `{name}`")
        controls = dict(zip([a.name for a in model.actuators], model.keyframe_controls[name], strict=True))
        for a in range(mj.nactuator):
            own = mujoco.mj_id2name(mj, mujoco.mjtObj.mjOBJ_ACTUATOR, a)
            if not own or own not in controls:
                continue
            states, inputs = mj.key_act[i, mj.actuator_actadr[a] :], mj.key_ctrl[i, mj.actuator_ctrladr[a] :]
            integrates = mj.actuator_dyntype[a] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
            where = f"actuator `{own}` of keyframe `{name}`"
            theirs = (states if integrates else inputs)[0]
            found.expect("controls of keyframes", controls[own], theirs, lambda _, where=where: where)
