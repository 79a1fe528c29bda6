"""Types of `condyle.pinocchio`: models, data, frames, and algebra with Pinocchio's names."""

from collections.abc import Callable, Sequence
from enum import Enum
from types import SimpleNamespace
from typing import Any, NamedTuple, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle as ours
from . import algebra

_Array = NDArray[np.float64]
_T = TypeVar("_T")


class ReferenceFrame(Enum):
    """The axes and the origin of a velocity or a Jacobian."""

    WORLD = "world"
    LOCAL = "local"
    LOCAL_WORLD_ALIGNED = "local_world_aligned"


class Motion(algebra.Motion):
    """A `condyle.algebra.Motion` with Pinocchio's names. The constructor also accepts six numbers."""

    __slots__ = ()

    def __init__(self, linear: ArrayLike, angular: ArrayLike | None = None) -> None:
        x = np.asarray(linear, float)
        super().__init__(*((x[..., :3], x[..., 3:]) if angular is None else (x, angular)))

    @classmethod
    def Zero(cls) -> "Motion":
        """Returns the zero motion."""
        return cls(np.zeros(6))


class Force(algebra.Force):
    """A `condyle.algebra.Force` with Pinocchio's names. The constructor also accepts six numbers."""

    __slots__ = ()

    def __init__(self, linear: ArrayLike, angular: ArrayLike | None = None) -> None:
        x = np.asarray(linear, float)
        super().__init__(*((x[..., :3], x[..., 3:]) if angular is None else (x, angular)))

    @classmethod
    def Zero(cls) -> "Force":
        """Returns the zero force."""
        return cls(np.zeros(6))


class SE3(algebra.SE3):
    """A `condyle.algebra.SE3` with Pinocchio's names. The constructor also accepts a matrix (4, 4)."""

    __slots__ = ()

    def __init__(self, rotation: ArrayLike, translation: ArrayLike | None = None) -> None:
        X = np.asarray(rotation, float)
        super().__init__(*((X[..., :3, :3], X[..., :3, 3]) if translation is None else (X, translation)))

    @classmethod
    def Identity(cls) -> "SE3":
        """Returns the identity pose."""
        return cls(np.eye(4))

    def actInv(self, x: Any) -> Any:
        """Converts coordinates in frame a to coordinates in frame b, where this object is the pose aXb."""
        return self.act_inv(x)

    @property
    def dualAction(self) -> _Array:
        """The action aXb* on forces, (6, 6)."""
        return self.dual_action


class Frame(NamedTuple):
    """A frame: its name, the joint that moves it, and its pose in the body that this joint carries."""

    name: str
    parentJoint: int  # noqa: N815
    placement: SE3


class Lazy(Sequence[_T]):
    """A list whose elements are created on access."""

    __slots__ = ("_count", "_make")

    def __init__(self, count: int, make: Callable[[int], _T]) -> None:
        self._count, self._make = count, make

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> _T: ...
    @overload
    def __getitem__(self, index: slice) -> list[_T]: ...
    def __getitem__(self, index: int | slice) -> _T | list[_T]:
        if isinstance(index, slice):
            return [self._make(k) for k in range(*index.indices(self._count))]
        k = index + self._count if index < 0 else index
        if not 0 <= k < self._count:
            raise IndexError(f"expected a number below {self._count}, found {index}")
        return self._make(k)

    def __repr__(self) -> str:
        return repr(list(self))


class JointModelFreeFlyer:
    """The root joint of a robot with a floating base."""


class Model(ours._SpelledModel):
    """A model with Pinocchio's names; the `condyle.Model` is available as `ours`."""

    def __init__(self, model: ours.Model) -> None:
        limits = model.limits
        self.name, self.nq, self.nv, self.njoints = model.name, model.nq, model.nv, model.nbodies
        self.names, self.parents = list(model.names), list(model.parents)
        self.idx_qs, self.idx_vs = list(model.idx_qs), list(model.idx_vs)
        self.nqs, self.nvs = list(model.nqs), list(model.nvs)
        self.armature = model.armature
        self.lowerPositionLimit, self.upperPositionLimit = limits.lower.copy(), limits.upper.copy()
        self.velocityLimit, self.effortLimit = limits.velocity, limits.effort
        self.frames = [Frame("universe", 0, SE3.Identity())]
        self.frames += [Frame(f.name, f.body, SE3(f.placement)) for f in model.frames]
        self.nframes = len(self.frames)
        self.referenceConfigurations: dict[str, _Array] = {}
        self._frame_ids = {frame.name: k for k, frame in reversed(list(enumerate(self.frames)))}
        self._moving_mass = sum(inertia.mass for inertia in model.inertias[1:])
        self._lengths = np.zeros(self.nq, bool)  # whether each coordinate of q does not belong to a rotation
        turns = {"free_flyer": 4, "spherical": 4, "continuous": 2, "planar": 2}
        for kind, at, n in zip(model.joint_types, model.idx_qs, model.nqs, strict=True):
            self._lengths[at : at + n - turns.get(kind, 0)] = n > 0

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.ours,), self.__dict__

    def createData(self) -> "Data":
        """Creates a `Data`: scratch memory, which also stores results."""
        return Data(self)

    def getFrameId(self, name: str) -> int:
        """Returns the index of a frame, or the number of frames if the frame does not exist."""
        return self._frame_ids.get(name, self.nframes)

    def existFrame(self, name: str) -> bool:
        """Returns whether a frame with this name exists."""
        return self.getFrameId(name) < self.nframes

    def getJointId(self, name: str) -> int:
        """Returns the index of a joint, or the number of joints if the joint does not exist."""
        return self.names.index(name) if name in self.names else self.njoints

    def existJointName(self, name: str) -> bool:
        """Returns whether a joint with this name exists."""
        return name in self.names


class Data(ours._SpelledData):
    """Scratch memory, which also stores the results of functions, such as oMi, oMf, v, a, tau, ddq, M, com and hg. A
    result exists after a function has computed it.
    """

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
        self._model = model

    @property
    def oMi(self) -> Sequence[SE3]:
        """The poses of the joints' bodies at the last forwardKinematics."""
        poses = self._poses
        return Lazy(len(poses), lambda joint: SE3._of(poses[joint]))

    @property
    def oMf(self) -> Sequence[SE3]:
        """The poses of the frames at the last updateFramePlacements."""
        poses, frames = self._frame_poses, self._model.frames

        def pose(k: int) -> SE3:
            _, body, placement = frames[k]
            return SE3._of(poses[body] @ placement.homogeneous)

        return Lazy(len(frames), pose)

    @property
    def v(self) -> Sequence[Motion]:
        """The velocities of the joints' bodies, each in the frame of the body, at the last forwardKinematics with v."""
        if self._given < 2:
            raise AttributeError
        (q, v, _), model, data = self._state, self._model.ours, self._ours
        return Lazy(model.nbodies, lambda joint: Motion._of(ours.body_velocity(model, data, q, v, joint)))

    @property
    def a(self) -> Sequence[Motion]:
        """The spatial accelerations of the joints' bodies, each in the frame of the body, at the last forwardKinematics
        with a.
        """
        if self._given < 3:
            raise AttributeError
        state, model, data = self._state, self._model.ours, self._ours
        return Lazy(model.nbodies, lambda joint: Motion._of(ours.body_acceleration(model, data, *state, joint)))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._model,), self.__dict__

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"data.{name}: no function has made it yet, or it is not part of this layer")


def exp6(m: ArrayLike | algebra.Motion) -> SE3:
    """Returns the exponential of a motion."""
    return SE3._of(algebra.exp6(m).homogeneous)


def log6(X: algebra.SE3 | ArrayLike) -> Motion:
    """Returns the motion whose exponential is X."""
    return Motion._of(algebra.log6(X).vector)


def Jlog3(R: ArrayLike) -> _Array:
    """Computes the Jacobian ∂ log3(R exp δ)/∂δ at δ = 0, (3, 3)."""
    return algebra.Jlog3(log3(R))


utils = SimpleNamespace(zero=np.zeros, eye=np.eye, rand=np.random.random)
"""The functions `zero`, `eye` and `rand` of `pinocchio.utils`."""

log = log6
exp3, log3, skew = algebra.exp3, algebra.log3, algebra.skew
Jexp3, Jexp6, Jlog6 = algebra.Jexp3, algebra.Jexp6, algebra.Jlog6
