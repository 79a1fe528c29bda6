"""Compares actuators, springs, tendons, loops and keyframes of random MJCFs with the models that MuJoCo compiles."""

import json
from typing import Any

import mujoco
import numpy as np
import pytest
from driven_mjcf import DrivenMjcf

import condyle

Array = np.ndarray
SAME = 1e-8
"""Tolerance relative to each compared number. Some numbers are computed with M⁻¹ and have larger rounding errors."""
BOTH = (-1.0, 1.0)
SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
"""Smallest code of MuJoCo's joint types with one degree of freedom."""
HUGE = 1e8
"""Control that exceeds all ranges. An effort larger than a hundredth of this control counts as unlimited."""


class Robot:
    """Robot in two forms: compiled by MuJoCo, and read by Condyle."""

    def __init__(self, text: str, theirs: mujoco.MjModel) -> None:
        """Reads the robot's text by both libraries."""
        model = condyle.Model.from_mjcf_str(text)
        self.ours: dict[str, Any] = json.loads(model.to_json())
        self.said = [str(warning) for warning in model.warnings]
        self.theirs, self.data, self.text = theirs, mujoco.MjData(theirs), text

    def says(self, what: str) -> bool:
        """Returns whether a warning of Condyle contains the given words."""
        return any(what in warning for warning in self.said)

    def position(self) -> Array:
        """Converts a position of MuJoCo to Condyle's order, with quaternions as x, y, z, w."""
        q, m = self.data.qpos.copy(), self.theirs
        for at, kind in zip(m.jnt_qposadr, m.jnt_type, strict=True):
            if mujoco.mjtJoint(kind) in (mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtJoint.mjJNT_BALL):
                at += 3 if kind == mujoco.mjtJoint.mjJNT_FREE else 0
                q[at : at + 4] = np.roll(q[at : at + 4], -1)
        return q

    def inertia(self, m: mujoco.MjModel) -> Array:
        """Returns M of a model of MuJoCo, at the model's initial position."""
        data, matrix = mujoco.MjData(m), np.zeros((m.nv, m.nv))
        mujoco.mj_forward(m, data)
        mujoco.mj_fullM(m, data, matrix)
        return matrix


def robots() -> list[Robot]:
    """Generates random robots and returns those that MuJoCo accepts."""
    found: list[Robot] = []
    seed = 0
    while len(found) < 150:
        text = DrivenMjcf(seed).text
        seed += 1
        try:
            theirs = mujoco.MjModel.from_xml_string(text)
        except ValueError:
            continue
        if theirs.nv > 0:
            found.append(Robot(text, theirs))
    return found


@pytest.fixture(scope="module")
def read() -> list[Robot]:
    return robots()


def close(found: Any, expected: Any) -> None:
    np.testing.assert_allclose(np.asarray(found, float), np.asarray(expected, float), rtol=SAME, atol=SAME)


def ends(limits: list[float | None]) -> list[float]:
    """Converts a range from JSON to numbers; null becomes infinity."""
    lower, upper = limits
    return [-np.inf if lower is None else lower, np.inf if upper is None else upper]


def pose(X: dict[str, Any]) -> Array:
    """Converts a pose from JSON to a matrix."""
    matrix = np.eye(4)
    columns = [[column[k] for k in "xyz"] for column in (X["rotation"][c] for c in "xyz")]
    matrix[:3, :3], matrix[:3, 3] = np.array(columns).T, [X["translation"][k] for k in "xyz"]
    return matrix


def test_armature_and_friction(read: list[Robot]) -> None:
    held = 0
    for robot in read:
        m, plain = robot.theirs, mujoco.MjModel.from_xml_string(robot.text)
        plain.dof_armature[:] = plain.tendon_armature[:] = plain.actuator_armature[:] = 0.0
        added = robot.inertia(m) - robot.inertia(plain)
        is_diagonal = np.abs(added - np.diag(np.diag(added))).max() < SAME
        assert robot.says("armature: it is missing in M") != is_diagonal
        if is_diagonal:
            held += 1
            close(robot.ours["armature"], np.diag(added))
        friction = m.dof_frictionloss.copy()
        for first in m.tendon_adr[m.tendon_num == 1]:
            tendon = list(m.tendon_adr).index(first)
            joint = m.wrap_objid[first]
            friction[m.jnt_dofadr[joint]] += abs(m.wrap_prm[first]) * m.tendon_frictionloss[tendon]
        close(robot.ours["friction"], friction)
    assert held > 100


def spring(robot: Robot, q: Array) -> Array:
    """Returns the efforts of all springs of Condyle's robot at the position q."""
    tau = np.zeros(robot.theirs.nv)
    for s in robot.ours["springs"]:
        body, k, rest = robot.ours["bodies"][s["body"]], s["stiffness"], np.array(s["rest"])
        at, own = body["idx_v"], q[body["idx_q"] :][: len(rest)]
        if len(rest) == 1:
            x = own[0] - rest[0]
            tau[at] -= (k[0] + k[1] * x + k[2] * x * x) * x
            continue
        parts = []
        if len(rest) == 7:
            parts.append(own[:3] - rest[:3])
            own, rest = own[3:], rest[3:]
        turned = np.zeros(3)
        mujoco.mju_subQuat(turned, np.roll(own, 1), np.roll(rest, 1))
        for x in [*parts, turned]:
            r = np.linalg.norm(x)
            tau[at : at + 3] -= (k[0] + k[1] * r + k[2] * r * r) * x
            at += 3
    return tau


def test_springs_and_damping(read: list[Robot]) -> None:
    """Compares springs and damping with `qfrc_spring` and `qfrc_damper`, for robots without tendons over several
    joints."""
    rng, compared = np.random.default_rng(0), 0
    for robot in read:
        m, d = robot.theirs, robot.data
        if (m.tendon_num > 1).any():
            continue
        compared += 1
        for _ in range(3):
            d.qpos[:] = m.qpos0
            mujoco.mj_integratePos(m, d.qpos, rng.standard_normal(m.nv), 1.0)
            d.qvel[:] = v = rng.standard_normal(m.nv)
            mujoco.mj_forward(m, d)
            close(spring(robot, robot.position()), d.qfrc_spring)
            d1, d2 = np.array(robot.ours["damping_polynomial"]).T
            close(-(robot.ours["damping"] + d1 * abs(v) + d2 * v * v) * v, d.qfrc_damper)
    assert compared > 100


def test_actuators(read: list[Robot]) -> None:
    """Compares the force laws, gears and ranges of Condyle's actuators with MuJoCo's. A warning must name each actuator
    that is left out."""
    compared = 0
    for robot in read:
        m = robot.theirs
        table = {a["name"]: a for a in robot.ours["actuators"]}
        for i in range(m.nactuator):
            name = m.actuator(i).name
            if name not in table:
                assert robot.says(f"`{name}`: it is left out of the table")
                continue
            compared += 1
            ours, g, b = table[name], m.actuator_gainprm[i], m.actuator_biasprm[i]
            law = {
                mujoco.mjtGain.mjGAIN_FIXED: [g[0], b[0], -b[1], -b[2]],
                mujoco.mjtGain.mjGAIN_PID: [-b[1], b[0], -b[1], -b[2]],
                mujoco.mjtGain.mjGAIN_DCMOTOR: [g[1] / (g[0] or 1.0), 0.0, 0.0, g[1] ** 2 / (g[0] or 1.0)],
            }[mujoco.mjtGain(m.actuator_gaintype[i])]
            if m.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE:
                law[1:] = [0.0] * 3
            close([ours[k] for k in ("gain", "bias", "kp", "kv")], law)
            close(ours["gear"], m.actuator_gear[i])
            force = m.actuator_forcerange[i] if m.actuator_forcelimited[i] else [-np.inf, np.inf]
            tendon = m.actuator_trnid[i, 0]
            on_tendon = m.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON
            alone = on_tendon[i] and np.sum(on_tendon & (m.actuator_trnid[:, 0] == tendon)) == 1
            if alone and m.tendon_actfrclimited[tendon]:
                force = np.clip(m.tendon_actfrcrange[tendon], *force)
            close(ends(ours["force"]), force)
            u = m.actuator_ctrladr[i]
            if mujoco.mjtDyn(m.actuator_dyntype[i]) in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_DCMOTOR):
                control = m.actuator_ctrlrange[u] if m.actuator_ctrllimited[u] else [-np.inf, np.inf]
                close(ends(ours["control"]), control)
    assert compared > 100


def pushed(robot: Robot, k: int, sign: float) -> tuple[float, bool]:
    """Returns the maximum effort on a degree of freedom in one direction, and whether an actuator acts on it."""
    m, d, driven = mujoco.MjModel.from_xml_string(robot.text), robot.data, False
    mujoco.mj_resetData(m, d)
    mujoco.mj_forward(m, d)
    moments = np.zeros((m.nout, m.nv))
    mujoco.mju_sparse2dense(moments, d.actuator_moment, d.moment_rownnz, d.moment_rowadr, d.moment_colind)
    fixed = (mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtGain.mjGAIN_PID)
    for i in range(m.nactuator):
        controls = slice(m.actuator_ctrladr[i], m.actuator_ctrladr[i] + m.actuator_ctrlnum[i])
        moment = moments[m.actuator_outadr[i], k]
        if m.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_SITE:
            m.actuator_gear[i] = 0.0  # an actuator on a site does not limit the effort of a joint, so it is disabled
            continue
        driven |= moment != 0.0
        if mujoco.mjtGain(m.actuator_gaintype[i]) not in fixed or m.actuator_biasprm[i, 1:3].any():
            # If an actuator's force depends on length or velocity, only the range of the force limits its effort.
            # The test replaces an actuator of this kind by a motor with the same range of force.
            m.actuator_gaintype[i], m.actuator_biastype[i] = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_NONE
            m.actuator_gainprm[i, 0], m.actuator_ctrllimited[controls] = 1.0, 0
        d.ctrl[controls] = sign * np.sign(moment * m.actuator_gainprm[i, 0]) * HUGE
    mujoco.mj_forward(m, d)
    return d.qfrc_actuator[k], driven


def test_limits_of_effort(read: list[Robot]) -> None:
    compared = 0
    for robot in read:
        m = robot.theirs
        if m.na > 0 or robot.says("several actuators share the tendon"):
            continue
        limits = robot.ours["limits"]
        for j in np.flatnonzero(m.jnt_type >= SLIDE):
            k = m.jnt_dofadr[j]
            found = ends([limits["effort_lower"][k], limits["effort_upper"][k]])
            own = m.jnt_actfrcrange[j] if m.jnt_actfrclimited[j] else [-np.inf, np.inf]
            for side, sign in enumerate(BOTH):
                effort, driven = pushed(robot, k, sign)
                expected = effort if driven else own[side]
                compared += driven
                close(found[side], expected if abs(expected) < HUGE / 100.0 else sign * np.inf)
    assert compared > 100


def test_limits_of_position(read: list[Robot]) -> None:
    """Tests that the range of a tendon over one joint limits this joint. If the tendon's range and the joint's own
    range do not overlap, a warning must say so."""
    for robot in read:
        m, at = robot.theirs, 0
        for j in range(m.njnt):
            if m.jnt_type[j] >= SLIDE:
                limits = np.array(m.jnt_range[j] if m.jnt_limited[j] else [-np.inf, np.inf])
                for t in np.flatnonzero((m.tendon_num == 1) & (m.tendon_limited == 1)):
                    if m.wrap_objid[m.tendon_adr[t]] == j:
                        own = np.sort(m.tendon_range[t] / m.wrap_prm[m.tendon_adr[t]])
                        both = np.array([max(limits[0], own[0]), min(limits[1], own[1])])
                        limits = both if both[0] <= both[1] else limits
                        assert both[0] <= both[1] or robot.says("range: its length has no limits")
                close(ends([robot.ours["limits"]["lower"][at], robot.ours["limits"]["upper"][at]]), limits)
            at += [7, 4, 1, 1][m.jnt_type[j]]


def test_constraints(read: list[Robot]) -> None:
    """Compares closed loops and couplings of joints with MuJoCo's `eq_data`: the frames of a loop must be at its
    anchors, and a coupling must have the same polynomial."""
    compared = 0
    for robot in read:
        m, counts = robot.theirs, {"connect": 0, "weld": 0, "joint": 0}
        named = {c["name"]: c["kind"] for c in robot.ours["constraints"]}
        frames = {(f["kind"], f["name"]): f for f in robot.ours["frames"]}
        for i in range(m.neq):
            kind, numbers = list(counts)[m.eq_type[i]], m.eq_data[i]
            counts[kind] += 1
            name, objects = f"{kind}{counts[kind]}", (m.eq_obj1id[i], m.eq_obj2id[i])
            if name not in named:
                assert robot.says("both ends are fixed to one body")
                continue
            compared += 1
            if kind == "joint":
                coefficients = named[name]["Coupling"]["coefficients"]
                y0, x0 = (m.qpos0[m.jnt_qposadr[j]] for j in objects)
                for x in (0.3, -0.7):
                    expected = y0 + np.polynomial.polynomial.polyval(x - x0, numbers[:5])
                    close(np.polynomial.polynomial.polyval(x, coefficients), expected)
                continue
            is_site = m.eq_objtype[i] == mujoco.mjtObj.mjOBJ_SITE
            found = []
            for side, index in enumerate(objects):
                frame = frames["Constraint", f"{name}#{side + 1}"]
                of = frames[("User", m.site(index).name) if is_site else ("Link", m.body(index).name)]
                assert frame["body"] == of["body"]
                found.append(np.linalg.inv(pose(of["placement"])) @ pose(frame["placement"]))
            if kind == "connect":
                close([X[:3, 3] for X in found], numbers[:6].reshape(2, 3))
                continue
            expected = np.tile(np.eye(4), (2, 1, 1))
            if not is_site:
                turned = np.zeros(9)
                mujoco.mju_quat2Mat(turned, numbers[6:10])
                expected[0, :3, :3], expected[0, :3, 3] = turned.reshape(3, 3), numbers[3:6]
                expected[1, :3, 3] = numbers[:3]
            close(found, expected)
    assert compared > 50


def test_carried_weights(read: list[Robot]) -> None:
    for robot in read:
        m = robot.theirs
        moves = m.body_weldid != 0
        masses = [body["inertia"]["mass"] for body in robot.ours["bodies"]]
        carried = sum(c["ratio"] * masses[c["body"]] + c["added_mass"] for c in robot.ours["gravity_compensation"])
        close(carried, (m.body_mass * m.body_gravcomp)[moves].sum())
