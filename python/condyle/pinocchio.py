"""Pinocchio's spelling: a thin layer, so that a script that uses it runs with another import.

>>> import condyle, numpy as np
>>> import condyle.pinocchio as pin
>>> model = pin.buildModelFromXML(condyle.robots.QUADRUPED, pin.JointModelFreeFlyer())
>>> data = model.createData()
>>> q, v, tau = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
>>> pin.computeABADerivatives(model, data, q, v, tau)[0].shape, data.ddq[2].round(2).item()
((18, 18), -9.81)

Functions return what Pinocchio's do in Python, and leave it in `data` under the same name, as arrays that no later call
changes. `model.ours` is the `condyle.Model`, whose functions cost less than this layer and take batches. What differs:
both triangles of M are filled, as in Pinocchio's Python; armature counts in the kinetic energy of all joints; `frames`
are `universe` and then ours, so frames go by `getFrameId`, not by numbers from elsewhere. Geometry, collisions,
visualisers, and what else is not here, raise an AttributeError that says so. For code that is written anew use
`condyle` itself: its page has a table of both spellings.
"""

from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle as ours
from . import algebra

_Array = NDArray[np.float64]


class ReferenceFrame(Enum):
    """The axes and the origin of a velocity or a Jacobian."""

    WORLD = "world"
    LOCAL = "local"
    LOCAL_WORLD_ALIGNED = "local_world_aligned"


WORLD, LOCAL = ReferenceFrame.WORLD, ReferenceFrame.LOCAL
LOCAL_WORLD_ALIGNED = ReferenceFrame.LOCAL_WORLD_ALIGNED


class Motion(algebra.Motion):
    """`condyle.algebra.Motion`, also of six numbers, with Pinocchio's names."""

    __slots__ = ()

    def __init__(self, linear: ArrayLike, angular: ArrayLike | None = None) -> None:
        x = np.asarray(linear, float)
        super().__init__(*((x[..., :3], x[..., 3:]) if angular is None else (x, angular)))

    @classmethod
    def Zero(cls) -> "Motion":
        """Six zeros."""
        return cls(np.zeros(6))


class Force(algebra.Force):
    """`condyle.algebra.Force`, also of six numbers, with Pinocchio's names."""

    __slots__ = ()

    def __init__(self, linear: ArrayLike, angular: ArrayLike | None = None) -> None:
        x = np.asarray(linear, float)
        super().__init__(*((x[..., :3], x[..., 3:]) if angular is None else (x, angular)))

    @classmethod
    def Zero(cls) -> "Force":
        """Six zeros."""
        return cls(np.zeros(6))


class SE3(algebra.SE3):
    """`condyle.algebra.SE3`, also of a matrix (4, 4), with Pinocchio's names."""

    __slots__ = ()

    def __init__(self, rotation: ArrayLike, translation: ArrayLike | None = None) -> None:
        X = np.asarray(rotation, float)
        super().__init__(*((X[..., :3, :3], X[..., :3, 3]) if translation is None else (X, translation)))

    @classmethod
    def Identity(cls) -> "SE3":
        """The pose of a frame in itself."""
        return cls(np.eye(4))

    def actInv(self, x: Any) -> Any:
        """What is written in a, in b."""
        return self.act_inv(x)

    @property
    def dualAction(self) -> _Array:
        """aXb* of forces, (6, 6)."""
        return self.dual_action


class Frame(NamedTuple):
    """A frame: its name, the joint that moves it, and its pose in that joint's body."""

    name: str
    parentJoint: int  # noqa: N815
    placement: SE3


class JointModelFreeFlyer:
    """The root joint of a robot that moves freely."""


class Model:
    """A `condyle.Model` with Pinocchio's names."""

    def __init__(self, model: ours.Model) -> None:
        limits = model.limits
        self.ours = model
        self.name, self.nq, self.nv, self.njoints = model.name, model.nq, model.nv, model.nbodies
        self.names, self.parents = list(model.names), list(model.parents)
        self.idx_qs, self.idx_vs = list(model.idx_qs), list(model.idx_vs)
        self.nqs, self.nvs = list(model.nqs), list(model.nvs)
        self.armature = model.armature
        self.lowerPositionLimit, self.upperPositionLimit = limits.lower, limits.upper
        self.velocityLimit, self.effortLimit = limits.velocity, limits.effort
        self.frames = [Frame("universe", 0, SE3.Identity())]
        self.frames += [Frame(f.name, f.body, SE3(f.placement)) for f in model.frames]
        self.nframes = len(self.frames)

    def createData(self) -> "Data":
        """Scratch, and the place where results are left."""
        return Data(self)

    def getFrameId(self, name: str) -> int:
        """The frame's number, or the number of frames if there is none."""
        return next((k for k, frame in enumerate(self.frames) if frame.name == name), self.nframes)

    def existFrame(self, name: str) -> bool:
        """Whether there is a frame of this name."""
        return self.getFrameId(name) < self.nframes

    def getJointId(self, name: str) -> int:
        """The joint's number, or the number of joints if there is none."""
        return self.names.index(name) if name in self.names else self.njoints

    def existJointName(self, name: str) -> bool:
        """Whether there is a joint of this name."""
        return name in self.names


class Data:
    """Where results are left: oMi, oMf, v, a, tau, ddq, M, com, hg, …, each from when a function has made it."""

    oMi: list[SE3]  # noqa: N815
    oMf: list[SE3]  # noqa: N815
    v: list[Motion]
    a: list[Motion]
    hg: Force
    com: list[_Array]
    vcom: list[_Array]
    acom: list[_Array]
    tau: _Array
    ddq: _Array
    M: _Array
    Minv: _Array
    C: _Array
    nle: _Array
    g: _Array
    Ag: _Array
    Jcom: _Array
    dtau_dq: _Array
    dtau_dv: _Array
    ddq_dq: _Array
    ddq_dv: _Array
    kinetic_energy: float
    potential_energy: float

    def __init__(self, model: Model) -> None:
        self._ours = ours.Data(model.ours)
        self._q = self._v = self._a = np.zeros(0)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"data.{name}: no function has made it yet, or it is not part of this layer")


def buildModelFromUrdf(path: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """A robot from a URDF."""
    return Model(ours.Model.from_urdf(path, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromXML(text: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """A robot from a URDF's text."""
    return Model(ours.Model.from_urdf_str(text, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromMJCF(path: str) -> Model:
    """A robot from an MJCF."""
    return Model(ours.Model.from_mjcf(path))


def buildReducedModel(model: Model, joints: Sequence[int], q: ArrayLike) -> Model:
    """The robot with joints held where q has them."""
    return Model(model.ours.lock([model.names[joint] for joint in joints], q))


def neutral(model: Model) -> _Array:
    """The position in which no joint is moved."""
    return ours.neutral(model.ours)


def randomConfiguration(model: Model) -> _Array:
    """A random position within the limits."""
    return ours.random_configuration(model.ours)


def integrate(model: Model, q: ArrayLike, v: ArrayLike) -> _Array:
    """q ⊕ v."""
    return ours.integrate(model.ours, q, v)


def difference(model: Model, q0: ArrayLike, q1: ArrayLike) -> _Array:
    """q₁ ⊖ q₀."""
    return ours.difference(model.ours, q0, q1)


def interpolate(model: Model, q0: ArrayLike, q1: ArrayLike, t: float) -> _Array:
    """q₀ ⊕ t (q₁ ⊖ q₀)."""
    return ours.interpolate(model.ours, q0, q1, t)


def normalize(model: Model, q: ArrayLike) -> _Array:
    """q with quaternions, cosines and sines of length 1."""
    return ours.normalize(model.ours, q)


def _forces(fext: Sequence[algebra.Force] | None) -> _Array | None:
    return None if fext is None else np.array([f.vector for f in fext])


def rnea(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> _Array:
    """τ, also data.tau."""
    data.tau = ours.rnea(model.ours, data._ours, q, v, a, _forces(fext))
    return data.tau


def aba(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, tau: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> _Array:
    """q̈, also data.ddq."""
    data.ddq = ours.aba(model.ours, data._ours, q, v, tau, _forces(fext))
    return data.ddq


def crba(model: Model, data: Data, q: ArrayLike) -> _Array:
    """M, both triangles, also data.M."""
    data.M = ours.crba(model.ours, data._ours, q)
    return data.M


def computeMinverse(model: Model, data: Data, q: ArrayLike) -> _Array:
    """M⁻¹, also data.Minv."""
    data.Minv = ours.minv(model.ours, data._ours, q)
    return data.Minv


def nonLinearEffects(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> _Array:
    """C v + g, also data.nle."""
    data.nle = ours.nonlinear_effects(model.ours, data._ours, q, v)
    return data.nle


def computeGeneralizedGravity(model: Model, data: Data, q: ArrayLike) -> _Array:
    """g, also data.g."""
    data.g = ours.gravity(model.ours, data._ours, q)
    return data.g


def computeCoriolisMatrix(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> _Array:
    """C with C v + g = h and Ṁ − 2 C skew-symmetric, also data.C."""
    data.C = ours.coriolis_matrix(model.ours, data._ours, q, v)
    return data.C


def computeRNEADerivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, a: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> tuple[_Array, _Array, _Array]:
    """∂τ/∂q, ∂τ/∂v, M; also data.dtau_dq, dtau_dv, M."""
    data.dtau_dq, data.dtau_dv, data.M = ours.rnea_derivatives(model.ours, data._ours, q, v, a, _forces(fext))
    return data.dtau_dq, data.dtau_dv, data.M


def computeABADerivatives(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike, tau: ArrayLike, fext: Sequence[algebra.Force] | None = None
) -> tuple[_Array, _Array, _Array]:
    """∂q̈/∂q, ∂q̈/∂v, M⁻¹; also data.ddq_dq, ddq_dv, Minv, ddq."""
    data.ddq, data.ddq_dq, data.ddq_dv, data.Minv = ours.aba_derivatives(
        model.ours, data._ours, q, v, tau, _forces(fext)
    )
    return data.ddq_dq, data.ddq_dv, data.Minv


def forwardKinematics(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> None:
    """data.oMi; with v and a also data.v and data.a, in the bodies' frames."""
    still = np.zeros(model.nv)
    data._q, data._v, data._a = (np.array(x, float) for x in (q, still if v is None else v, still if a is None else a))
    data.oMi = [SE3(X) for X in ours.forward_kinematics(model.ours, data._ours, q)]
    if v is not None:
        data.v = [getVelocity(model, data, i) for i in range(model.njoints)]
    if a is not None:
        data.a = [getAcceleration(model, data, i) for i in range(model.njoints)]


def updateFramePlacements(model: Model, data: Data) -> None:
    """data.oMf of the last forwardKinematics."""
    data.oMf = [SE3((data.oMi[f.parentJoint] * f.placement).homogeneous) for f in model.frames]


def framesForwardKinematics(model: Model, data: Data, q: ArrayLike) -> None:
    """data.oMi and data.oMf."""
    forwardKinematics(model, data, q)
    updateFramePlacements(model, data)


def getVelocity(model: Model, data: Data, joint: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """The velocity of a joint's body at the last forwardKinematics."""
    return Motion(ours.body_velocity(model.ours, data._ours, data._q, data._v, joint, frame.value))


def getAcceleration(model: Model, data: Data, joint: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """The spatial acceleration of a joint's body at the last forwardKinematics."""
    return Motion(ours.body_acceleration(model.ours, data._ours, data._q, data._v, data._a, joint, frame.value))


def getClassicalAcceleration(model: Model, data: Data, joint: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """r̈ and ω̇ of a joint's body at the last forwardKinematics."""
    return Motion(
        ours.body_classical_acceleration(model.ours, data._ours, data._q, data._v, data._a, joint, frame.value)
    )


def getFrameVelocity(model: Model, data: Data, frame_id: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """The velocity of a frame at the last forwardKinematics."""
    at = _frame(model, frame_id)
    return Motion(ours.frame_velocity(model.ours, data._ours, data._q, data._v, at, frame.value))


def getFrameAcceleration(model: Model, data: Data, frame_id: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """The spatial acceleration of a frame at the last forwardKinematics."""
    at = _frame(model, frame_id)
    return Motion(ours.frame_acceleration(model.ours, data._ours, data._q, data._v, data._a, at, frame.value))


def getFrameClassicalAcceleration(model: Model, data: Data, frame_id: int, frame: ReferenceFrame = LOCAL) -> Motion:
    """r̈ and ω̇ of a frame at the last forwardKinematics."""
    at = _frame(model, frame_id)
    return Motion(ours.frame_classical_acceleration(model.ours, data._ours, data._q, data._v, data._a, at, frame.value))


def computeJointJacobians(model: Model, data: Data, q: ArrayLike) -> None:
    """What getJointJacobian and getFrameJacobian then read."""
    forwardKinematics(model, data, q)


def getJointJacobian(model: Model, data: Data, joint: int, frame: ReferenceFrame) -> _Array:
    """The Jacobian of a joint's body at the last computeJointJacobians, (6, nv)."""
    return ours.body_jacobian(model.ours, data._ours, data._q, joint, frame.value)


def getFrameJacobian(model: Model, data: Data, frame_id: int, frame: ReferenceFrame) -> _Array:
    """The Jacobian of a frame at the last computeJointJacobians, (6, nv)."""
    return ours.frame_jacobian(model.ours, data._ours, data._q, _frame(model, frame_id), frame.value)


def computeJointJacobian(model: Model, data: Data, q: ArrayLike, joint: int) -> _Array:
    """The Jacobian of a joint's body in its own frame, (6, nv)."""
    return ours.body_jacobian(model.ours, data._ours, q, joint, "local")


def computeFrameJacobian(
    model: Model, data: Data, q: ArrayLike, frame_id: int, frame: ReferenceFrame = LOCAL
) -> _Array:
    """The Jacobian of a frame, (6, nv)."""
    return ours.frame_jacobian(model.ours, data._ours, q, _frame(model, frame_id), frame.value)


def centerOfMass(
    model: Model, data: Data, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None
) -> _Array:
    """c, also data.com[0]; with v and a also data.vcom[0] and data.acom[0]."""
    data.com = [ours.com(model.ours, data._ours, q)]
    if v is not None:
        data.vcom = [ours.com_velocity(model.ours, data._ours, q, v)]
        if a is not None:
            data.acom = [ours.com_acceleration(model.ours, data._ours, q, v, a)]
    return data.com[0]


def jacobianCenterOfMass(model: Model, data: Data, q: ArrayLike) -> _Array:
    """∂c/∂q, (3, nv), also data.Jcom."""
    data.Jcom = ours.com_jacobian(model.ours, data._ours, q)
    return data.Jcom


def ccrba(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> _Array:
    """Ag, (6, nv), also data.Ag; data.hg and data.com."""
    data.Ag, _, com, data.Jcom = ours.centroidal_map(model.ours, data._ours, q)
    data.hg, data.com = Force(data.Ag @ np.asarray(v, float)), [com]
    return data.Ag


def computeCentroidalMomentum(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> Force:
    """hg, also data.hg."""
    data.hg = Force(ours.centroidal_momentum(model.ours, data._ours, q, v))
    return data.hg


def computeKineticEnergy(model: Model, data: Data, q: ArrayLike, v: ArrayLike) -> float:
    """½ vᵀ M v, also data.kinetic_energy."""
    data.kinetic_energy = ours.kinetic_energy(model.ours, data._ours, q, v)
    return data.kinetic_energy


def computePotentialEnergy(model: Model, data: Data, q: ArrayLike) -> float:
    """−Σ m g·c, also data.potential_energy."""
    data.potential_energy = ours.potential_energy(model.ours, data._ours, q)
    return data.potential_energy


def computeTotalMass(model: Model) -> float:
    """The mass of all bodies that move (kg)."""
    return sum(inertia.mass for inertia in model.ours.inertias[1:])


def dIntegrate(model: Model, q: ArrayLike, v: ArrayLike) -> tuple[_Array, _Array]:
    """The derivatives of q ⊕ v by q and by v."""
    return ours.integrate_jacobian(model.ours, v, "position"), ours.integrate_jacobian(model.ours, v, "velocity")


def dDifference(model: Model, q0: ArrayLike, q1: ArrayLike) -> tuple[_Array, _Array]:
    """The derivatives of q₁ ⊖ q₀ by q₀ and by q₁."""
    d = ours.difference(model.ours, q0, q1)
    return ours.difference_jacobian(model.ours, d, "from"), ours.difference_jacobian(model.ours, d, "to")


def exp6(m: ArrayLike | algebra.Motion) -> SE3:
    """exp of a motion."""
    return SE3(algebra.exp6(m).homogeneous)


def log6(X: algebra.SE3 | ArrayLike) -> Motion:
    """The motion whose exponential X is."""
    return Motion(algebra.log6(X).vector)


def Jlog3(R: ArrayLike) -> _Array:
    """∂ log3(R exp δ)/∂δ."""
    return algebra.jlog3(log3(R))


exp3, log3, skew = algebra.exp3, algebra.log3, algebra.skew
Jexp3, Jexp6, Jlog6 = algebra.jexp3, algebra.jexp6, algebra.jlog6


def _frame(model: Model, frame_id: int) -> int:
    if not 0 < frame_id < model.nframes:
        raise ValueError(f"frame_id: expected 1 to {model.nframes - 1}, found {frame_id}; universe does not move")
    return frame_id - 1


def __getattr__(name: str) -> Any:
    raise AttributeError(f"condyle.pinocchio has no `{name}`: it is not part of this layer (see help(condyle))")
