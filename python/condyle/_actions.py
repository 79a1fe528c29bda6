"""Functions that make an actuation matrix for thrusters, and an action for a differential equation."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._condyle import Action, Model, ProblemError

_Array = NDArray[np.float64]
_SCHEMES = {
    # scheme: (times of the stages within a step, weights); each stage uses the result of the previous stage
    "euler": ([0.0], [1.0]),
    "runge_kutta_2": ([0.0, 0.5], [0.0, 1.0]),
    "runge_kutta_3": ([0.0, 1 / 3, 2 / 3], [0.25, 0.0, 0.75]),
    "runge_kutta_4": ([0.0, 0.5, 0.5, 1.0], [1 / 6, 1 / 3, 1 / 3, 1 / 6]),
}


def thrusters(
    model: Model, placements: Sequence[ArrayLike], torques: Sequence[float] | float = 0.0, joints: bool = True
) -> _Array:
    """Returns the `actuation` of a free-flying base with thrusters: S of shape (nv, nu). The control of a thruster is
    its force.

    A thruster at position p pushes along the z axis of its placement, with the force f. The moment on the base is p × f
    + c f, where c is the ratio of torque to thrust of the thruster's rotor. In Crocoddyl's
    `ActuationModelFloatingBaseThrusters`, c is `ctorque`, positive for `CW` and negative for `CCW`.

    model: a robot whose root joint is a free-flyer.
    placements: the thrusters' placements in the base's frame, homogeneous matrices (4, 4).
    torques: c of each thruster (m), or one number for all thrusters.
    joints: whether each other joint has a control, too; these controls follow the thrusters' controls.

    Raises `ProblemError` for a robot without a free-flyer at the root, or an invalid placement.

    >>> place = np.eye(4)
    >>> place[:3, 3] = [0.2, 0.0, 0.1]
    >>> S = condyle.optimal.thrusters(condyle.robots.quadruped(), [place], joints=False)
    >>> S[:6, 0].tolist()  # a force up, which pitches the nose up
    [0.0, 0.0, 1.0, 0.0, -0.2, 0.0]
    """
    if model.nbodies < 2 or model.joint_types[1] != "free_flyer":
        raise ProblemError("thrusters: expected a robot whose root joint is a free-flyer")
    each = np.broadcast_to(np.asarray(torques, dtype=float), len(placements))
    driven = model.nv - 6 if joints else 0
    S = np.zeros((model.nv, len(placements) + driven))
    for k, (given, c) in enumerate(zip(placements, each, strict=True)):
        place = np.asarray(given, dtype=float)
        R = place[:3, :3] if place.shape == (4, 4) else np.zeros((3, 3))
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-6):
            raise ProblemError(f"placements[{k}]: expected a homogeneous matrix (4, 4) with a rotation")
        force = R[:, 2]
        S[:3, k], S[3:6, k] = force, np.cross(place[:3, 3], force) + c * force
    S[6:, len(placements) :] = np.eye(model.nv - 6, driven)
    return S


def ode_action(
    nx: int,
    nu: int,
    calc: Callable[[Any, NDArray[Any], NDArray[Any]], tuple[Any, Any]],
    dt: float,
    integrator: Literal["euler", "runge_kutta_2", "runge_kutta_3", "runge_kutta_4"] = "runge_kutta_4",
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
) -> Action:
    """Returns an `Action` that integrates a differential equation ẋ = f(x, u) and a cost per second over a time step
    Δt. Controls are constant during the step.

    For accelerations see `DifferentialAction`. Derivatives are exact derivatives of calc, as for `Action`.

    nx, nu, lower, upper: as for `Action`.
    calc: a function of (t, x, u) that returns ẋ, nx numbers, and the cost per second.
    dt: Δt in seconds.
    integrator: 'euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.

    Raises `ProblemError` if dt is not above 0.

    >>> from condyle.optimal import ode_action
    >>> decay = ode_action(1, 1, lambda t, x, u: (u - x, 0.5 * (x @ x)), 0.1)
    """
    if not (dt > 0.0 and np.isfinite(dt)):
        raise ProblemError(f"dt: expected more than 0 seconds, found {dt}")
    if integrator not in _SCHEMES:
        allowed = ", ".join(f"'{name}'" for name in _SCHEMES)
        raise ValueError(f"integrator: expected one of {allowed}, found '{integrator}'")
    times, weights = _SCHEMES[integrator]

    def step(t: Any, x: NDArray[Any], u: NDArray[Any]) -> tuple[Any, Any]:
        rate: Any = np.zeros(nx)
        change: Any = np.zeros(nx)
        cost: Any = 0.0
        for time, weight in zip(times, weights, strict=True):
            rate, running = calc(t, x + time * dt * np.asarray(rate), u)
            rate = np.asarray(rate)
            if rate.shape != (nx,):
                raise ValueError(f"calc of knot {t}: the rate: expected shape ({nx},), found {rate.shape}")
            if weight:
                change, cost = change + weight * rate, cost + weight * running
        return x + dt * change, dt * cost

    return Action(nx, nu, step, None, lower, upper)
