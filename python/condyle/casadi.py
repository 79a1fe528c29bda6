"""Functions of a robot as `casadi.Function`s, with exact derivatives and without Python in the loop.

>>> import condyle, condyle.casadi, casadi
>>> arm = condyle.robots.arm7()
>>> rnea = condyle.casadi.rnea(arm)
>>> rnea
Function(condyle_0:(q[7],v[7],a[7])->(tau[7]) External)
>>> q, v = casadi.MX.sym("q", 7), casadi.MX.sym("v", 7)
>>> damping = casadi.jacobian(rnea(q, v, 0), v)  # ∂τ/∂v, in closed form

Each function computes with Condyle's compiled code: values f, Jacobians J with the zeros of the robot's tree, products
Jᵀλ with multipliers λ, and the Hessian of λᵀf. The Hessian is computed by closed formulas for `rnea` and `aba`, and by
hyper-dual numbers for the other functions. Functions may be called from several threads at a time (`Function.map` with
"thread").

With `states=N` a function takes N states, one in each column, like `f.map(N)`. But values, Jacobian and Hessian of all
states are computed in one call, and `rnea` and `aba` compute several states in SIMD lanes. Use `states` for direct
collocation, where the number of points is known: the calls then take two to four times less time.

>>> many = condyle.casadi.rnea(arm, states=50)
>>> many.size_in("q"), many.size_out("tau")
((7, 50), (7, 50))

A position q has nq numbers. The quaternions in q, and the pairs (cos, sin) of continuous joints, are first divided by
their lengths. So exact derivatives with respect to all nq numbers exist; a length of 0 gives NaN. An optimisation must
keep these lengths at 1 by a constraint, or must integrate in the tangent space.

A function exists only in the process that made it. If a function is saved or pickled, alone or inside another function,
and then loaded, calls of the loaded function raise an error and print a line to the standard error. Create the function
again instead. If the original function is in the same process, calls of the original then raise the same error. The
reason is that CasADi gives both functions one name, so they cannot be distinguished. At most 64 functions exist at a
time; any number of expressions may use each function. Functions of the same name and the same robot count once.

CasADi is an optional dependency: `pip install condyle[casadi]`.
"""

import threading
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle
from ._condyle import (
    Action,
    ConstrainedAction,
    ContactDynamics,
    ContactInverseDynamics,
    FreeDynamics,
    FreeInverseDynamics,
    ImpulseDynamics,
    Lqr,
    Model,
    Problem,
    Unicycle,
)
from ._types import ContactConstraint

try:
    import casadi as _casadi
except ImportError:
    raise ImportError("condyle.casadi needs CasADi: pip install condyle[casadi]") from None

__all__ = [
    "aba",
    "action",
    "centroidal_momentum",
    "com",
    "constrained_dynamics",
    "crba",
    "forward_kinematics",
    "frame_velocity",
    "knot",
    "rnea",
]


def _function(model: Model, function: str, states: int, **options: Any) -> "_casadi.Function":
    return _external(_condyle._casadi_hold(model, function, states=states, **options))


def _external(name: str) -> "_casadi.Function":
    """Returns the CasADi function of a slot, and releases the hold of the slot. The argument is the name of the
    slot.
    """
    try:
        return _casadi.external(name, _condyle.__file__)
    finally:
        _condyle._casadi_release(name)  # CasADi's function now holds the slot


def rnea(model: Model, states: int = 1) -> "_casadi.Function":
    """Returns the function of inverse dynamics, τ = M(q) a + h(q, v): (q, v, a) -> tau.

    >>> tau = condyle.casadi.rnea(condyle.robots.arm7())(0.3, 0, 0)
    >>> bool(abs(tau[0]) < 1e-9)  # gravity does not turn a vertical axis
    True
    """
    return _function(model, "rnea", states)


def aba(model: Model, states: int = 1) -> "_casadi.Function":
    """Returns the function of forward dynamics, the accelerations a under efforts τ: (q, v, tau) -> a.

    Raises `ModelError` if the inertia matrix is singular.
    """
    return _function(model, "aba", states)


def crba(model: Model, states: int = 1) -> "_casadi.Function":
    """Returns the function of the inertia matrix: q -> M, (nv, nv), with the zeros of the robot's tree."""
    return _function(model, "crba", states)


def forward_kinematics(model: Model, frame: str | int, states: int = 1) -> "_casadi.Function":
    """Returns the function of a frame's pose in the world's frame: q -> (position, rotation), 3 numbers (m) and (3, 3).

    >>> tool = condyle.casadi.forward_kinematics(condyle.robots.arm7(), "tool")
    >>> position, rotation = tool(0)
    >>> bool(position[2] > 0.5)  # stretched upwards
    True
    """
    return _function(model, "forward_kinematics", states, frame=frame)


def frame_velocity(
    model: Model,
    frame: str | int,
    reference: Literal["local", "world", "local_world_aligned"] = "local",
    states: int = 1,
) -> "_casadi.Function":
    """Returns the function of a frame's velocity, linear first: (q, v) -> velocity, 6 numbers (m/s, rad/s)."""
    return _function(model, "frame_velocity", states, frame=frame, reference=reference)


def com(model: Model, states: int = 1) -> "_casadi.Function":
    """Returns the function of the moving bodies' centre of mass in the world's frame: q -> com, 3 numbers (m)."""
    return _function(model, "com", states)


def centroidal_momentum(model: Model, states: int = 1) -> "_casadi.Function":
    """Returns the function of the momentum about the centre of mass, linear first: (q, v) -> momentum, 6 numbers (kg
    m/s, kg m²/s).
    """
    return _function(model, "centroidal_momentum", states)


def constrained_dynamics(model: Model, constraints: Sequence[ContactConstraint], states: int = 1) -> "_casadi.Function":
    """Returns the function of the accelerations under constraints and the constraint forces: (q, v, tau) -> (a,
    forces).

    The constraints keep their given targets. Raises `ModelError` as `ConstraintSet` does.

    >>> quadruped = condyle.robots.quadruped()
    >>> stance = [condyle.ContactConstraint(foot, "point") for foot in ("LF_foot", "RH_foot")]
    >>> condyle.casadi.constrained_dynamics(quadruped, stance).size_out(1)
    (6, 1)
    """
    return _function(model, "constrained_dynamics", states, constraints=list(constraints))


_Knot = (
    ConstrainedAction
    | ContactDynamics
    | ContactInverseDynamics
    | FreeDynamics
    | ImpulseDynamics
    | FreeInverseDynamics
    | Lqr
    | Problem
    | Unicycle
)


def knot(of: _Knot, t: int | None = 0) -> "_casadi.Function":
    """Returns the function of the next state and the cost at a knot of an optimal control problem: (x, u) -> (next,
    cost).

    of: an action of a robot, an `Lqr`, a `Unicycle`, or a `Problem`. Raises `ProblemError` if the action or problem
        contains Python functions: write these functions as CasADi expressions instead.
    t: the index of the knot, from 0 to N for a problem; for an action, t selects the `costs_at`. With None, t is an
        argument of the function, (x, u, t) -> (next, cost), so that one function serves all knots of an action:
        `f.map(N)(xs, us, range(N))`.

    For a knot without controls, such as an impact, the function is x -> (next, cost); for the terminal knot the
    function is x -> cost. Bounds on controls, limits and the constraints of a `ConstrainedAction` are not included:
    pass them to the optimiser. Quaternions and pairs (cos, sin) in x are divided by their lengths, as in the other
    functions; quaternions and pairs in `next` have length 1. So multiple shooting, x⁺ = next(x, u), keeps the lengths
    at 1.

    First derivatives are exact. Hessians are the same as for `Fddp(second_order=True)`. For a robot, the Hessian of the
    cost is the Gauss–Newton approximation w (∂r)ᵀ a″ ∂r, with residual r and activation a; for an `Lqr` and a
    `Unicycle` this Hessian is exact. The Hessian of the next state is exact for `Lqr` and `Unicycle`, and for
    `FreeDynamics` and `FreeInverseDynamics` with 'semi_implicit_euler'. Contacts, impacts and Runge–Kutta steps are
    treated as linear in the tangent space of the state. An approximate Hessian does not change the optimum, but an
    optimiser may need more iterations.

    >>> import condyle, condyle.casadi
    >>> from condyle.optimal import Cost, FreeDynamics, Residual
    >>> effort = Cost("effort", 2.0, Residual.control(np.zeros(7)))
    >>> step = condyle.casadi.knot(FreeDynamics(condyle.robots.arm7(), 0.05, [effort]))
    >>> step.size_in("x"), step.size_in("u"), step.size_out("next")
    ((14, 1), (7, 1), (14, 1))
    >>> step(0, 1)[1]  # Δt w ½ uᵀu
    DM(0.35)
    """
    return _external(_condyle._casadi_hold_knot(of, t))


def action(
    x: "_casadi.SX | _casadi.MX",
    u: "_casadi.SX | _casadi.MX | None",
    next_state: "_casadi.SX | _casadi.MX | None",
    cost: "_casadi.SX | _casadi.MX",
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
) -> Action:
    """Converts CasADi expressions to an `Action` of `condyle.optimal`, with exact derivatives, computed for all knots
    at once.

    x, u: the symbols of the state and of the control; u is None at the terminal knot.
    next_state: the next state as an expression of x and u; None at the terminal knot.
    cost: the cost.
    lower, upper: bounds on the controls, as for `Action`.

    >>> import casadi, condyle, condyle.casadi, numpy as np
    >>> x, u = casadi.SX.sym("x"), casadi.SX.sym("u")
    >>> knot = condyle.casadi.action(x, u, x + u, 0.5 * (x**2 + u**2))
    >>> end = condyle.casadi.action(x, None, None, 0.5 * x**2)
    >>> problem = condyle.optimal.Problem([1.0], [knot], [0] * 30, end)
    >>> round(condyle.optimal.Fddp(problem).solve(np.zeros((31, 1)), np.zeros((30, 1))).cost, 6)
    0.809017
    """
    kind: Any = type(x)
    symbols: list[Any] = [x, kind.sym("u", 0) if u is None else u]
    nx, nu = (symbol.numel() for symbol in symbols)
    value: Any = cost
    state: Any = next_state
    end = state is None
    values = _Mapped(kind, symbols, [value] if end else [value, state])
    z = _casadi.vertcat(*symbols)
    slopes, curvature = _casadi.gradient(value, z), _casadi.hessian(value, z)[0]
    parts = {
        "q": slopes[:nx],
        "r": slopes[nx:],
        "Q": curvature[:nx, :nx],
        "S": curvature[:nx, nx:],
        "R": curvature[nx:, nx:],
    }
    if not end:
        jacobian = _casadi.jacobian(state, z)
        parts |= {"A": jacobian[:, :nx], "B": jacobian[:, nx:]}
    parts = {name: part for name, part in parts.items() if part.numel()}
    derivatives = _Mapped(kind, symbols, list(parts.values()))

    def calc(t: Any, x: NDArray[Any], u: NDArray[Any]) -> tuple[Any, Any]:
        found = values(x, u)
        return (None if end else found[1][:, :, 0]), found[0][:, 0, 0]

    def calc_diff(t: Any, x: NDArray[np.float64], u: NDArray[np.float64]) -> dict[str, ArrayLike]:
        found = dict(zip(parts, derivatives(x, u), strict=True))
        return {name: part[:, :, 0] if name in "qr" else part for name, part in found.items()}

    return Action(nx, nu, calc, calc_diff, lower, upper, batch=True)


class _Mapped:
    """A CasADi function whose arguments are arrays with one row for each knot. For each result of shape (m, n), the
    function returns an array (rows, m, n).
    """

    def __init__(self, kind: Any, arguments: list[Any], results: list[Any]) -> None:
        results = [_casadi.densify(kind(result)) for result in results]
        self._function = _casadi.Function("knot", arguments, results)
        self._shapes = [result.shape for result in results]
        self._buffers: dict[int, Any] = {}
        self._lock = threading.Lock()  # only one call at a time may use a buffer

    def __call__(self, *arguments: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        rows = len(arguments[0])
        # the shape has n before m, because CasADi stores matrices by columns
        results = [np.empty((rows, n, m)) for m, n in self._shapes]
        with self._lock:
            if rows not in self._buffers:
                self._buffers[rows] = self._function.map(rows).buffer()
            buffer, call = self._buffers[rows]
            inputs = [np.ascontiguousarray(argument) for argument in arguments]  # arrays in use until the call ends
            for k, argument in enumerate(inputs):
                buffer.set_arg(k, argument.data)
            for k, result in enumerate(results):
                buffer.set_res(k, result.data)
            call()
        return [result.transpose(0, 2, 1) for result in results]
