"""States and efforts of a robot in MuJoCo's model, which has its own order of joints and actuators."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Model

_Array = NDArray[np.float64]

_KINDS = {"free_flyer": 0, "spherical": 1, "prismatic": 2, "revolute": 3, "continuous": 3}
"""MuJoCo's type of a joint (`mjtJoint`) for each kind of joint."""
_SIZES = (7, 4, 1, 1)
"""Numbers of positions of MuJoCo's types of joints."""
_NAMES = ("free joint", "ball joint", "slide joint", "hinge joint")
"""Names of MuJoCo's types of joints."""
_AT_JOINT = (0, 1)
"""Types of transmission (`mjtTrn`) with which an actuator acts on a joint: on its axis, or along the parent's axes."""


class MujocoRobot:
    """States and efforts of a robot that MuJoCo simulates. MuJoCo numbers joints and actuators in its own order, so
    both are found by their names.

    mj_model: the compiled model, a `mujoco.MjModel`. It may contain other bodies, joints and actuators.
    model: the same robot, for example from a URDF or from the same MJCF file. MuJoCo's names of its joints are the
        names in `mj_model`; a free-flyer is the free joint to whose body the robot's first joint belongs.

    Each joint but the free-flyer needs a motor, unless `mj_model` has no actuators at all. A motor is an actuator whose
    force is proportional to its control: its joint gets the effort gear · gain · ctrl.

    Raises a ValueError that names the joint or the actuator: if a joint is missing in `mj_model` or has another type
    there, if an actuator of a joint is no motor, and if a joint has no actuator or
    several.

    >>> import mujoco  # doctest: +SKIP
    >>> mj_model = mujoco.MjModel.from_xml_path("scene.xml")  # doctest: +SKIP
    >>> data, model = mujoco.MjData(mj_model), condyle.Model.from_mjcf("robot.xml")  # doctest: +SKIP
    >>> robot = condyle.conventions.MujocoRobot(mj_model, model)  # doctest: +SKIP
    >>> robot.apply(data, policy(data.time, robot.state(data)))  # doctest: +SKIP
    """

    def __init__(self, mj_model: Any, model: Model) -> None:
        from .conventions import Coordinates

        self.model = model
        self._coordinates = Coordinates(model, "mujoco")
        known = {mj_model.joint(k).name: k for k in range(mj_model.njnt)}
        joints = list(zip(model.names, model.joint_types, model.nvs, strict=True))[1:]
        found = {name: _find(mj_model, known, name, kind) for name, kind, _ in joints if kind != "free_flyer"}
        at_q: list[int] = []
        at_v: list[int] = []
        for name, kind, nv in joints:
            place = found[name] if name in found else _free(mj_model, known, name, list(found.values()))
            first_q, first_v = int(mj_model.jnt_qposadr[place]), int(mj_model.jnt_dofadr[place])
            at_q += range(first_q, first_q + _SIZES[_KINDS[kind]])
            at_v += range(first_v, first_v + nv)
        self._at_q, self._at_v = np.array(at_q, int), np.array(at_v, int)
        self._nu, self._size = int(mj_model.nu), sum(nv for name, _, nv in joints if name in found)
        self._actuators, self._gains = np.zeros(0, int), np.zeros(0)
        if self._nu > 0:
            motors = [_motor(mj_model, name, found[name]) for name, *_ in joints if name in found]
            self._actuators, self._gains = np.array([k for k, _ in motors], int), np.array([gain for _, gain in motors])

    def state(self, data: Any) -> _Array:
        """Returns the state x = (q, v) of the robot, (nq + nv).

        data: a `mujoco.MjData` of the model.
        """
        qpos, qvel = np.asarray(data.qpos)[self._at_q], np.asarray(data.qvel)[self._at_v]
        return np.concatenate([self._coordinates.position_from(qpos), self._coordinates.velocity_from(qpos, qvel)])

    def set_state(self, data: Any, x: ArrayLike) -> None:
        """Writes the state x = (q, v) to `data.qpos` and `data.qvel`. Call `mujoco.mj_forward` afterwards.

        Raises a ValueError if x has another length.
        """
        x, nq = np.asarray(x, float), self.model.nq
        if x.shape != (nq + self.model.nv,):
            raise ValueError(f"x: expected shape ({nq + self.model.nv},), found {x.shape}")
        data.qpos[self._at_q] = self._coordinates.position(x[:nq])
        data.qvel[self._at_v] = self._coordinates.velocity(x[:nq], x[nq:])

    def control(self, tau: ArrayLike) -> _Array:
        """Returns MuJoCo's controls, (nu), from the efforts of all joints but the free-flyer's, as a policy returns
        them. Controls of other actuators are 0.

        Raises a ValueError if tau has another length, or if the model has no actuators.
        """
        out = np.zeros(self._nu)
        out[self._actuators] = self._controls(tau)
        return out

    def apply(self, data: Any, tau: ArrayLike) -> None:
        """Writes the controls of the efforts tau to `data.ctrl`, as in `control`. Controls of other actuators stay as
        they are.
        """
        data.ctrl[self._actuators] = self._controls(tau)

    def _controls(self, tau: ArrayLike) -> _Array:
        tau = np.asarray(tau, float)
        if self._nu == 0:
            raise ValueError("MuJoCo's model has no actuators: write efforts to `qfrc_applied`")
        if tau.shape != (self._size,):
            raise ValueError(f"tau: expected shape ({self._size},), found {tau.shape}")
        return tau / self._gains


def _find(mj_model: Any, known: dict[str, int], name: str, kind: str) -> int:
    """Returns the index of a joint in MuJoCo's model."""
    place = known.get(name)
    if place is None:
        raise ValueError(f"joint `{name}`: MuJoCo's model has no joint of this name; it has {_list(known)}")
    found = int(mj_model.jnt_type[place])
    if found != _KINDS[kind]:
        raise ValueError(f"joint `{name}`: expected a {_NAMES[_KINDS[kind]]}, found a {_NAMES[found]}")
    return place


def _free(mj_model: Any, known: dict[str, int], name: str, places: list[int]) -> int:
    """Returns the index of the free joint of a robot whose other joints have the indices `places`."""
    free = [k for k in range(mj_model.njnt) if mj_model.jnt_type[k] == 0]
    roots = {int(mj_model.body_rootid[mj_model.jnt_bodyid[place]]) for place in places}
    of_robot = [k for k in free if int(mj_model.jnt_bodyid[k]) in roots]
    if len(of_robot) == 1:
        return of_robot[0]
    return _find(mj_model, known, name, "free_flyer")


def _motor(mj_model: Any, name: str, place: int) -> tuple[int, float]:
    """Returns the actuator of a joint, and the joint's effort for one unit of the control."""
    acts = np.isin(mj_model.actuator_trntype, _AT_JOINT) & (np.asarray(mj_model.actuator_trnid)[:, 0] == place)
    own = [int(k) for k in np.flatnonzero(acts)]
    if len(own) != 1:
        names = _list([mj_model.actuator(k).name for k in own])
        raise ValueError(f"joint `{name}` has {len(own)} actuators in MuJoCo's model ({names}): expected one motor")
    k = own[0]
    gain = float(mj_model.actuator_gear[k, 0] * mj_model.actuator_gainprm[k, 0])
    what = None
    if mj_model.jnt_type[place] == 1:
        what = "a ball joint needs three"
    elif mj_model.actuator_biastype[k] != 0:
        what = "its force depends on position or velocity, as a servo's"
    elif mj_model.actuator_dyntype[k] != 0:
        what = "its force follows the control with a delay"
    elif mj_model.actuator_gaintype[k] != 0 or gain == 0.0:
        what = "its force is not proportional to the control"
    if what is not None:
        raise ValueError(f"actuator `{mj_model.actuator(k).name or k}` of joint `{name}` is no motor: {what}")
    return k, gain


def _list(names: Any) -> str:
    return ", ".join(f"`{name}`" for name in names) or "none"
