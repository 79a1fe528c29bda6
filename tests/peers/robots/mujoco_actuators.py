"""Computes the limits of joint efforts from the actuators of MuJoCo's compiled model.

An actuator gives the force f = gain · a + bias with the activation a. If gain and bias are constant, the range of the
activation bounds f. `forcerange` always bounds f. The effort of a joint is the sum of moment · f over its actuators,
clipped to the joint's `actuatorfrcrange`.
"""

import mujoco
import numpy as np

BIAS_AFFINE = int(mujoco.mjtBias.mjBIAS_AFFINE)
BIAS_NONE = int(mujoco.mjtBias.mjBIAS_NONE)
DSBL_ACTUATION = int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
DSBL_CLAMPCTRL = int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
DYN_FILTER = int(mujoco.mjtDyn.mjDYN_FILTER)
DYN_FILTEREXACT = int(mujoco.mjtDyn.mjDYN_FILTEREXACT)
DYN_MUSCLE = int(mujoco.mjtDyn.mjDYN_MUSCLE)
DYN_NONE = int(mujoco.mjtDyn.mjDYN_NONE)
GAIN_FIXED = int(mujoco.mjtGain.mjGAIN_FIXED)
JNT_BALL = int(mujoco.mjtJoint.mjJNT_BALL)
JNT_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
JNT_SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
TRN_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
TRN_JOINTINPARENT = int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
TRN_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)
WRAP_JOINT = int(mujoco.mjtWrap.mjWRAP_JOINT)

Range = np.ndarray
ALL = np.array([-np.inf, np.inf])
SCALAR = (JNT_HINGE, JNT_SLIDE)
FILTERS = (DYN_FILTER, DYN_FILTEREXACT)


def efforts(mj: mujoco.MjModel) -> np.ndarray:
    """Returns the least and the greatest effort of each coordinate, (nv, 2); NaN if this program cannot compute the
    effort."""
    sums: dict[int, Range] = {}
    alone = [int(mj.actuator_trnid[i, 0]) for i in range(mj.nactuator) if mj.actuator_trntype[i] == TRN_TENDON]
    for i in range(mj.nactuator):
        if not acts(mj, i):
            continue
        force = clip(constant(mj, i), ALL)
        tendon = int(mj.actuator_trnid[i, 0])
        if mj.actuator_trntype[i] == TRN_TENDON and alone.count(tendon) == 1:
            force = clip(force, mj.tendon_actfrcrange[tendon] if mj.tendon_actfrclimited[tendon] else ALL)
        force = clip(force, mj.actuator_forcerange[i] if mj.actuator_forcelimited[i] else ALL)
        if mj.actuator_outnum[i] != 1:  # the actuator controls the orientation of a ball joint
            first = int(mj.jnt_dofadr[mj.actuator_trnid[i, 0]])
            sums |= {first + k: np.full(2, np.nan) for k in range(3)}
            continue
        for column, moment in moments(mj, i):
            sums[column] = sums.get(column, np.zeros(2)) + times(moment, force)
    found = np.tile(ALL, (mj.nv, 1))
    for j in range(mj.njnt):
        first = mj.jnt_dofadr[j]
        for column in range(first, first + (1 if mj.jnt_type[j] in SCALAR else 3 + 3 * (mj.jnt_type[j] == 0))):
            found[column] = sums.get(column, ALL)
            if mj.jnt_type[j] in SCALAR and mj.jnt_actfrclimited[j]:
                found[column] = clip(found[column], mj.jnt_actfrcrange[j])
    return found


def acts(mj: mujoco.MjModel, i: int) -> bool:
    """Returns whether an actuator is enabled."""
    group = int(mj.actuator_group[i])
    off = mj.opt.disableflags & DSBL_ACTUATION
    return not off and not (0 <= group < 31 and mj.opt.disableactuator & (1 << group))


def clip(force: Range, limits: Range) -> Range:
    """Returns a range of force, clipped to limits."""
    return np.clip(force, limits[0], limits[1])


def times(moment: float, force: Range) -> Range:
    """Returns the range of moment · force for a range of force."""
    return np.zeros(2) if moment == 0.0 else np.sort(moment * force)


def constant(mj: mujoco.MjModel, i: int) -> Range:
    """Returns the range of an actuator's force if gain and bias are constant, otherwise an unlimited range.

    A plugin computes its own force, so gain and bias have no effect.
    """
    if mj.nplugin and mj.actuator_plugin[i] >= 0:
        return ALL
    bias = mj.actuator_biasprm[i] if mj.actuator_biastype[i] == BIAS_AFFINE else np.zeros(3)
    kinds = (BIAS_AFFINE, BIAS_NONE)
    if mj.actuator_gaintype[i] != GAIN_FIXED or mj.actuator_biastype[i] not in kinds or bias[1:3].any():
        return ALL
    return times(mj.actuator_gainprm[i, 0], activation(mj, i)) + bias[0]


def activation(mj: mujoco.MjModel, i: int) -> Range:
    """Returns the range of the activation. This is the range of the control or, for an actuator that integrates its
    control, the range of the integral."""
    k = int(mj.actuator_ctrladr[i])
    control = mj.actuator_ctrlrange[k] if mj.actuator_ctrllimited[k] else ALL
    limit = mj.actuator_actrange[i] if mj.actuator_actlimited[i] else ALL
    if mj.opt.disableflags & DSBL_CLAMPCTRL:
        control = ALL
    if mj.actuator_dyntype[i] == DYN_NONE:
        return control
    if mj.actuator_dyntype[i] in FILTERS:
        return clip(np.array([min(control[0], 0.0), max(control[1], 0.0)]), limit)
    return np.array([0.0, 1.0]) if mj.actuator_dyntype[i] == DYN_MUSCLE else limit


def moments(mj: mujoco.MjModel, i: int) -> list[tuple[int, float]]:
    """Returns the coordinates on which an actuator acts with a constant moment, and the moment of each coordinate."""
    gear, target = mj.actuator_gear[mj.actuator_outadr[i]], int(mj.actuator_trnid[i, 0])
    kind = mj.actuator_trntype[i]
    if kind in (TRN_JOINT, TRN_JOINTINPARENT):
        column, joint = int(mj.jnt_dofadr[target]), mj.jnt_type[target]
        if joint in SCALAR:
            return [(column, gear[0])]
        if kind == TRN_JOINTINPARENT:
            return []
        # For a free joint, the force is along the world's axes and the moment is along the body's axes.
        axes = range(3) if joint == JNT_BALL else range(3, 6)
        return [(column + k, gear[k]) for k in axes if gear[k]]
    if kind == TRN_TENDON:
        first, n = int(mj.tendon_adr[target]), int(mj.tendon_num[target])
        wraps = range(first, first + n)
        if all(mj.wrap_type[w] == WRAP_JOINT for w in wraps):
            return [(int(mj.jnt_dofadr[mj.wrap_objid[w]]), mj.wrap_prm[w] * gear[0]) for w in wraps]
    return []
