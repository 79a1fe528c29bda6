"""Two problems with limits: an arm's reach, and a cart on a short rail that swings its pole up."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle.optimal import Activation, Cost, FreeDynamics, Limit, Problem, Residual

_Array = NDArray[np.float64]


class Start(NamedTuple):
    """A problem as JSON, with states and controls from which solvers start."""

    text: str
    xs: _Array
    us: _Array


def reach() -> Start:
    """Returns an arm that goes to a point, with limits on efforts, positions and speeds, and stops there exactly."""
    arm, knots, n = condyle.robots.arm7(), 50, 7
    x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(n)]
    costs = [
        Cost("speed", 1e-1, Residual.state(x0), Activation.weighted(np.r_[np.zeros(n), np.ones(n)])),
        Cost("effort", 1e-3, Residual.control(np.zeros(n))),
    ]
    strong, near = np.r_[np.full(4, 30.0), np.full(3, 8.0)], np.r_[np.full(n, 0.8), np.full(n, 1.2)]
    limits = [
        Limit("effort", Residual.control(np.zeros(n)), -strong, strong),
        Limit("state", Residual.state(x0), -near, near),
    ]
    rest = np.r_[np.full(n, np.inf), np.zeros(n)]
    ends = [Limit("rest", Residual.state(x0), -rest, rest)]
    point = Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5])
    knot = FreeDynamics(arm, 0.02, costs, limits=limits)
    problem = Problem(x0, [knot], [0] * knots, FreeDynamics(arm, None, [Cost("point", 1e3, point)], limits=ends))
    hold = FreeDynamics(arm, 0.02, []).quasi_static(x0)
    return Start(problem.to_json(), np.tile(x0, (knots + 1, 1)), np.tile(hold, (knots, 1)))


def cartpole() -> Start:
    """Returns a cartpole with limits on its force and its rail. It stands upright and at rest at the end."""
    builder, knots = condyle.ModelBuilder("cartpole"), 50
    cart = condyle.Inertia.from_com(1.0, np.zeros(3), 0.01 * np.eye(3))
    rod = condyle.Inertia.from_com(0.2, [0.0, 0.0, -0.4], 0.01 * np.eye(3))
    body = builder.body("cart", condyle.WORLD, condyle.Joint.prismatic([1.0, 0.0, 0.0]), inertia=cart)
    builder.body("pole", body, condyle.Joint.revolute([0.0, 1.0, 0.0]), inertia=rod)
    upright, rail = np.array([0.0, np.pi, 0.0, 0.0]), np.r_[1.0, np.full(3, np.inf)]
    limits = [
        Limit("force", Residual.control([0.0]), [-10.0], [10.0]),
        Limit("rail", Residual.state(np.zeros(4)), -rail, rail),
    ]
    effort, model = Cost("effort", 1e-1, Residual.control([0.0])), builder.build()
    knot = FreeDynamics(model, 0.04, [effort], actuation=np.array([[1.0], [0.0]]), limits=limits)
    end = FreeDynamics(model, None, [], limits=[Limit("upright", Residual.state(upright))])
    problem = Problem(np.zeros(4), [knot], [0] * knots, end)
    guess = np.linspace(np.zeros(4), upright, knots + 1)  # breaks the dynamics
    return Start(problem.to_json(), guess, np.zeros((knots, 1)))


PROBLEMS: dict[str, Callable[[], Start]] = {"reach": reach, "cartpole": cartpole}
