"""Functions and classes with Pinocchio's names. A script for Pinocchio runs with this module if only the script's
import is changed.

>>> import condyle, numpy as np
>>> import condyle.pinocchio as pin
>>> model = pin.buildModelFromXML(condyle.robots.QUADRUPED, pin.JointModelFreeFlyer())
>>> data = model.createData()
>>> q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
>>> pin.computeABADerivatives(model, data, q, v, tau)[0].shape, data.ddq[2].round(2).item()
((18, 18), -9.81)

Functions return the same results as Pinocchio's functions in Python. They store the results in `data` under the same
names, as arrays that no later call changes. `model.ours` is the `condyle.Model`, whose functions also take batches.
Three details should be known: both triangles of M are filled, as in Pinocchio's Python; the kinetic energy contains the
armature of all joints; and `frames` are `universe`, followed by the frames of the `condyle.Model`. So find frames with
`getFrameId`, and do not use frame indices from Pinocchio. Geometry, collisions, visualisers and other missing features
raise an AttributeError with an explanation. For new code use `condyle` itself: the README of the package has a table of
both sets of names.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle as ours
from . import algebra
from ._condyle import centerOfMass as centerOfMass
from ._condyle import computeCentroidalMomentum as computeCentroidalMomentum
from ._condyle import computeCoriolisMatrix as computeCoriolisMatrix
from ._condyle import computeFrameJacobian as computeFrameJacobian
from ._condyle import computeGeneralizedGravity as computeGeneralizedGravity
from ._condyle import computeMinverse as computeMinverse
from ._condyle import forwardKinematics as forwardKinematics
from ._condyle import framesForwardKinematics as framesForwardKinematics
from ._condyle import getAcceleration as getAcceleration
from ._condyle import getClassicalAcceleration as getClassicalAcceleration
from ._condyle import getFrameAcceleration as getFrameAcceleration
from ._condyle import getFrameClassicalAcceleration as getFrameClassicalAcceleration
from ._condyle import getFrameJacobian as getFrameJacobian
from ._condyle import getFrameVelocity as getFrameVelocity
from ._condyle import getJointJacobian as getJointJacobian
from ._condyle import getVelocity as getVelocity
from ._condyle import jacobianCenterOfMass as jacobianCenterOfMass
from ._condyle import nonLinearEffects as nonLinearEffects
from ._condyle import updateFramePlacements as updateFramePlacements
from ._pinocchio_batches import ModelPool as ModelPool
from ._pinocchio_batches import abaInParallel as abaInParallel
from ._pinocchio_batches import omp_get_max_threads as omp_get_max_threads
from ._pinocchio_batches import rneaInParallel as rneaInParallel
from ._pinocchio_build import appendModel as appendModel
from ._pinocchio_build import buildModelFromMJCF as buildModelFromMJCF
from ._pinocchio_build import buildModelFromUrdf as buildModelFromUrdf
from ._pinocchio_build import buildModelFromXML as buildModelFromXML
from ._pinocchio_build import buildReducedModel as buildReducedModel
from ._pinocchio_build import buildSampleModelHumanoid as buildSampleModelHumanoid
from ._pinocchio_build import buildSampleModelHumanoidRandom as buildSampleModelHumanoidRandom
from ._pinocchio_build import buildSampleModelManipulator as buildSampleModelManipulator
from ._pinocchio_build import loadReferenceConfigurations as loadReferenceConfigurations
from ._pinocchio_build import loadReferenceConfigurationsFromXML as loadReferenceConfigurationsFromXML
from ._pinocchio_build import transformJointIntoMimic as transformJointIntoMimic
from ._spelling import SE3 as SE3
from ._spelling import Data as Data
from ._spelling import Force as Force
from ._spelling import Frame as Frame
from ._spelling import Jexp3 as Jexp3
from ._spelling import Jexp6 as Jexp6
from ._spelling import Jlog3 as Jlog3
from ._spelling import Jlog6 as Jlog6
from ._spelling import JointModelFreeFlyer as JointModelFreeFlyer
from ._spelling import Model as Model
from ._spelling import Motion as Motion
from ._spelling import ReferenceFrame as ReferenceFrame
from ._spelling import exp3 as exp3
from ._spelling import exp6 as exp6
from ._spelling import log as log
from ._spelling import log3 as log3
from ._spelling import log6 as log6
from ._spelling import skew as skew
from ._spelling import utils as utils

_Array = NDArray[np.float64]
crba, integrate, difference = ours._spelled_crba, ours._spelled_integrate, ours._spelled_difference
WORLD, LOCAL = ReferenceFrame.WORLD, ReferenceFrame.LOCAL
LOCAL_WORLD_ALIGNED = ReferenceFrame.LOCAL_WORLD_ALIGNED


def neutral(model: Model) -> _Array:
    """Returns the position in which all joints are at zero or the identity."""
    return ours.neutral(model.ours)


def randomConfiguration(model: Model, lower: ArrayLike | None = None, upper: ArrayLike | None = None) -> _Array:
    """Returns a random position within the limits of the model, or within the given limits; coordinates without limits
    are within ±3.
    """
    q = ours.random_configuration(model.ours)
    low = np.ravel(model.lowerPositionLimit if lower is None else lower)
    high = np.ravel(model.upperPositionLimit if upper is None else upper)
    given = model._lengths & np.isfinite(low) & np.isfinite(high)
    q[given] = low[given] + np.random.random(int(given.sum())) * (high - low)[given]
    return q


def interpolate(model: Model, q0: ArrayLike, q1: ArrayLike, t: float) -> _Array:
    """Returns the position q₀ ⊕ t (q₁ ⊖ q₀)."""
    return ours.interpolate(model.ours, q0, q1, t)


def normalize(model: Model, q: ArrayLike) -> _Array:
    """Returns q with quaternions and pairs (cos, sin) scaled to length 1."""
    return ours.normalize(model.ours, q)


def _forces(fext: Sequence[algebra.Force]) -> _Array:
    return np.array([f.vector for f in fext])


def _flat(*states: ArrayLike) -> tuple[_Array, _Array, _Array]:
    """Returns states as vectors, if some of the states are given as columns. If no state is a column, raises the
    current exception again.
    """
    q, v, x = (np.asarray(state, float) for state in states)
    if not any(array.ndim == 2 and array.shape[1] == 1 for array in (q, v, x)):
        raise
    return q.ravel(), v.ravel(), x.ravel()


def rnea(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> _Array:
    """Computes inverse dynamics τ, also stored as data.tau."""
    try:
        data.tau = out = ours.rnea(model.ours, data._ours, q, v, a, None if fext is None else _forces(fext))
    except ValueError:
        return rnea(model, data, *_flat(q, v, a), fext)
    return out


def aba(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, tau: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> _Array:
    """Computes forward dynamics q̈, also stored as data.ddq."""
    try:
        data.ddq = out = ours.aba(model.ours, data._ours, q, v, tau, None if fext is None else _forces(fext))
    except ValueError:
        return aba(model, data, *_flat(q, v, tau), fext)
    return out


def computeRNEADerivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> tuple[_Array, _Array, _Array]:
    """Computes ∂τ/∂q, ∂τ/∂v and M, also stored as data.dtau_dq, data.dtau_dv and data.M."""
    given = None if fext is None else _forces(fext)
    try:
        data.dtau_dq, data.dtau_dv, data.M = d = ours.rnea_derivatives(model.ours, data._ours, q, v, a, given)
    except ValueError:
        return computeRNEADerivatives(model, data, *_flat(q, v, a), fext)
    return d[:]


def computeABADerivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, tau: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> tuple[_Array, _Array, _Array]:
    """Computes ∂q̈/∂q, ∂q̈/∂v and M⁻¹, also stored as data.ddq_dq, data.ddq_dv and data.Minv; q̈ is stored as data.ddq."""
    given = None if fext is None else _forces(fext)
    try:
        d = ours.aba_derivatives(model.ours, data._ours, q, v, tau, given)
    except ValueError:
        return computeABADerivatives(model, data, *_flat(q, v, tau), fext)
    data.ddq, data.ddq_dq, data.ddq_dv, data.Minv = d
    return d[1:]


def computeForwardKinematicsDerivatives(model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> None:
    """Prepares the data for getJointVelocityDerivatives and similar functions."""
    forwardKinematics(model, data, q, v, a)


def getJointVelocityDerivatives(model: Model, data: Data, joint: int, frame: ReferenceFrame) -> tuple[_Array, _Array]:
    """Computes the derivatives ∂v/∂q and ∂v/∂q̇ of the velocity v of a joint's body, (6, nv). For LOCAL_WORLD_ALIGNED,
    v is the velocity at a fixed point.
    """
    q, v, _ = data._state
    dv_dq = ours.body_velocity_derivative(model.ours, data._ours, q, v, joint, frame._value_)
    J = getJointJacobian(model, data, joint, frame)
    return _at_rest(dv_dq, getVelocity(model, data, joint, frame), J, frame), J


def _at_rest(by_q: _Array, motion: Motion, J: _Array, frame: ReferenceFrame) -> _Array:
    """Converts the derivative ∂/∂q of a motion to the derivative at a fixed point: removes ω × J, which is due to the
    motion of the frame's origin.
    """
    if frame is LOCAL_WORLD_ALIGNED:
        by_q[:3] -= np.cross(motion.angular, J[:3], axisb=0).T
    return by_q


def getJointAccelerationDerivatives(
    model: Model, data: Data, joint: int, frame: ReferenceFrame
) -> tuple[_Array, _Array, _Array, _Array]:
    """Computes the derivatives ∂v/∂q, ∂a/∂q, ∂a/∂q̇ and ∂a/∂q̈ of the velocity v and the acceleration a of a joint's
    body, each (6, nv).
    """
    dv_dq, da_da = getJointVelocityDerivatives(model, data, joint, frame)
    da_dq, da_dv = ours.body_acceleration_derivatives(model.ours, data._ours, *data._state, joint, frame._value_)
    return dv_dq, _at_rest(da_dq, getAcceleration(model, data, joint, frame), da_da, frame), da_dv, da_da


def computeJointJacobians(model: Model, data: Data, q: ArrayLike) -> None:
    """Prepares the data for getJointJacobian and getFrameJacobian."""
    forwardKinematics(model, data, q)


def computeJointJacobian(model: Model, data: Data, q: ArrayLike, joint: int) -> _Array:
    """Computes the Jacobian of a joint's body in the frame of this body, (6, nv)."""
    return ours.body_jacobian(model.ours, data._ours, q, joint, "local")


def ccrba(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> _Array:
    """Computes the centroidal momentum matrix Ag, (6, nv), also stored as data.Ag. Also computes data.hg and
    data.com.
    """
    Ag, _, com, data.Jcom = ours.centroidal_map(model.ours, data._ours, q)
    data.Ag = Ag
    data._leave(com, Force._of(Ag @ np.asarray(v, float)))
    return Ag


def computeKineticEnergy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """Computes the kinetic energy ½ vᵀ M v, also stored as data.kinetic_energy."""
    data.kinetic_energy = energy = ours.kinetic_energy(model.ours, data._ours, q, v)
    return energy


def computePotentialEnergy(model: Model, data: Data, q: ArrayLike) -> float:
    """Computes the potential energy −Σ m g·c, also stored as data.potential_energy."""
    data.potential_energy = energy = ours.potential_energy(model.ours, data._ours, q)
    return energy


def computeTotalMass(model: Model) -> float:
    """Returns the mass of all moving bodies (kg)."""
    return model._moving_mass


def dIntegrate(model: Model, q: ArrayLike, v: ArrayLike) -> tuple[_Array, _Array]:
    """Computes the derivatives of q ⊕ v with respect to q and to v."""
    return ours.integrate_jacobian(model.ours, v, "position"), ours.integrate_jacobian(model.ours, v, "velocity")


def dDifference(model: Model, q0: ArrayLike, q1: ArrayLike) -> tuple[_Array, _Array]:
    """Computes the derivatives of q₁ ⊖ q₀ with respect to q₀ and to q₁."""
    d = ours.difference(model.ours, q0, q1)
    return ours.difference_jacobian(model.ours, d, "from"), ours.difference_jacobian(model.ours, d, "to")


nle = nonLinearEffects


def __getattr__(name: str) -> Any:
    raise AttributeError(f"condyle.pinocchio has no `{name}`: it is not part of this layer (see help(condyle))")
