"""Solves Crocoddyl's problems with Condyle's solvers, and provides Condyle's dynamics to Crocoddyl.

An existing `crocoddyl.ShootingProblem` is solved by Condyle's solvers in two lines::

    problem = condyle.crocoddyl.problem(shooting_problem)
    solution = condyle.optimal.Fddp(problem, project_warm_start=False).solve(xs, us)

where xs and us are arrays of Crocoddyl's states and controls. The numbers of states and controls, their order, and the
iterates are the same as in Crocoddyl. Gains have the opposite sign: u = ū + α k + K (x ⊖ x̄).
`project_warm_start=False` has an effect only if controls are bounded: a warm start outside the bounds is not moved into
the bounds, as in Crocoddyl. In the other direction, `differential_action(model)` returns a
`crocoddyl.DifferentialActionModelAbstract` for Crocoddyl's solvers, which computes with Condyle's dynamics.

The tutorial `python/examples/coming_from_crocoddyl.py` has a table of names. Condyle does not install Crocoddyl: PyPI
has version 3.2.1, for Pinocchio 4.0.
"""

import warnings
from importlib import import_module
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._condyle import (
    Action,
    ContactDynamics,
    ContactInverseDynamics,
    FreeDynamics,
    ImpulseDynamics,
    Lqr,
    Problem,
    ProblemError,
    Unicycle,
)
from ._crocoddyl_robot import NoCounterpartError, Robot
from ._crocoddyl_terms import Drives, Terms, bounds, contact, kind

__all__ = ["differential_action", "problem"]

_Array = NDArray[np.float64]
_Made = FreeDynamics | ContactDynamics | ContactInverseDynamics | ImpulseDynamics | Lqr | Unicycle | Action

_POLYNOMIALS: dict[str, Literal["constant", "linear", "quadratic"]] = {
    "ControlParametrizationModelPolyZero": "constant",
    "ControlParametrizationModelPolyOne": "linear",
    "ControlParametrizationModelPolyTwoRK": "quadratic",
}
_SCHEMES: dict[int, Literal["runge_kutta_2", "runge_kutta_3", "runge_kutta_4"]] = {
    2: "runge_kutta_2",
    3: "runge_kutta_3",
    4: "runge_kutta_4",
}
_FORWARD = ("DifferentialActionModelFreeFwdDynamics", "DifferentialActionModelContactFwdDynamics")
_INVERSE = ("DifferentialActionModelFreeInvDynamics", "DifferentialActionModelContactInvDynamics")


def problem(shooting_problem: Any, bounded: bool = True, strict: bool = False) -> Problem:
    """Converts a `crocoddyl.ShootingProblem` to a `Problem`.

    The following knots are converted: Euler and Runge–Kutta steps of forward or inverse dynamics, with or without
    contacts; impulses; LQR; the unicycle. The controls of a step may be polynomials in time. These knots may contain:
    actuation models τ = S u with constant S; contacts of 1, 2, 3 and 6 dimensions; all residuals except
    ResidualModelContactControlGrav (which ignores the forces in version 3.2.1); quadratic, weighted and smooth
    activations and barriers; and constraints of residuals. A knot with other contents, such as an action or a cost that
    is written in Python, is computed by Crocoddyl: Condyle's solver calls Crocoddyl for this knot, and a warning names
    these contents.

    Constraints and the equations of inverse dynamics become limits, which `InteriorPoint` and `AugmentedLagrangian`
    enforce.

    shooting_problem: the problem of Crocoddyl. Its data are copied. The problem itself is kept only for knots that
    Crocoddyl computes.
    bounded: whether to use the bounds of controls (default: yes). Models of robots bound controls by the effort limits
        of the joints. `Fddp` then makes the iterations of Crocoddyl's SolverBoxFDDP, not of SolverFDDP. SolverFDDP and
        SolverDDP ignore bounds; for their iterates, use False.
    strict: whether contents without a counterpart in Condyle are an error.

    Raises `ProblemError` for contents without a counterpart in Condyle, if `strict` is set.
    """
    reader = _Reader(bounded, strict)
    running: list[_Made] = []
    for model in shooting_problem.runningModels:
        running.append(reader.action(model, False))
    return Problem(shooting_problem.x0, running, None, reader.action(shooting_problem.terminalModel, True))


class _Reader:
    """A converter of actions, which converts each robot and each action once."""

    def __init__(self, bounded: bool, strict: bool) -> None:
        self.bounded, self.strict = bounded, strict
        self.robots: list[Robot] = []
        self.actions: dict[tuple[int, bool], tuple[Any, _Made]] = {}
        self.named: set[str] = set()

    def action(self, theirs: Any, end: bool) -> _Made:
        """Converts an action. Keeps a reference to the action, since a deleted action's id could be reused by another
        object.
        """
        key = (id(theirs), end)
        if key not in self.actions:
            try:
                self.actions[key] = (theirs, self._counterpart(theirs, end))
            except NoCounterpartError as missing:
                self._without(str(missing))
                self.actions[key] = (theirs, self._called(theirs, end))
        return self.actions[key][1]

    def _without(self, what: str) -> None:
        text = f"{what} has no counterpart here"
        if self.strict:
            raise ProblemError(text)
        if text not in self.named:
            self.named.add(text)
            warnings.warn(f"{text}: Crocoddyl computes the knots with it", stacklevel=4)

    def _robot(self, theirs: Any, armature: Any = 0.0) -> Robot:
        own = np.zeros(theirs.nv) + armature
        found = next((robot for robot in self.robots if robot.is_of(theirs, own)), None)
        if found is None:
            found = Robot(theirs, own)
            self.robots.append(found)
        return found

    def _counterpart(self, theirs: Any, end: bool) -> _Made:
        name = kind(theirs)
        if name in ("IntegratedActionModelEuler", "IntegratedActionModelRK"):
            return self._step(theirs, end)
        if name == "ActionModelImpulseFwdDynamics":
            return self._impulse(theirs, end)
        if name == "ActionModelUnicycle":
            x, u = theirs.costWeights
            return Unicycle(theirs.dt, (x, u), end)
        if name == "ActionModelLQR" and not (theirs.ng or theirs.nh):
            if end:
                return Lqr(np.eye(theirs.state.nx), Q=theirs.Q, q=theirs.q)
            return Lqr(
                theirs.A, theirs.B, theirs.f, theirs.Q, theirs.N, theirs.R, theirs.q, theirs.r, *self._bounds(theirs)
            )
        raise NoCounterpartError(name)

    def _bounds(self, theirs: Any) -> tuple[_Array | None, _Array | None]:
        if not (self.bounded and theirs.has_control_limits):
            return None, None
        return bounds(theirs.u_lb), bounds(theirs.u_ub)

    def _step(self, theirs: Any, end: bool) -> _Made:
        differential = getattr(theirs.differential, "_condyle_of", theirs.differential)
        lower, upper = (self._at_each_node(b, differential.nu) for b in self._bounds(theirs))
        scheme = "semi_implicit_euler" if kind(theirs).endswith("Euler") else _SCHEMES[theirs.ni]
        controls = _POLYNOMIALS.get(kind(theirs.control))
        if controls is None:
            raise NoCounterpartError(kind(theirs.control))
        rest = {"integrator": scheme, "lower": lower, "upper": upper, "controls": controls}
        return self.of_a_robot(differential, None if end else theirs.dt, rest)

    @staticmethod
    def _at_each_node(bound: _Array | None, nu: int) -> _Array | None:
        """Returns the bounds of the nu controls at one time. All times of a control polynomial must have the same
        bounds.
        """
        if bound is None or len(bound) == nu:
            return bound
        first: _Array = bound[:nu]
        if not np.array_equal(bound, np.tile(first, len(bound) // nu)):
            raise NoCounterpartError("IntegratedActionModelRK (with bounds that differ within a knot)")
        return first

    def of_a_robot(self, theirs: Any, dt: float | None, rest: dict[str, Any]) -> _Made:
        """Converts a differential model of a robot to a knot, or to a terminal knot if dt is None. `rest` are further
        arguments of the knot.
        """
        name = kind(theirs)
        if name not in _FORWARD + _INVERSE:
            raise NoCounterpartError(name)
        state, inverse = theirs.state, name in _INVERSE
        robot = self._robot(state.pinocchio, 0.0 if inverse else theirs.armature)
        held = [item.data() for item in theirs.contacts.contacts] if hasattr(theirs, "contacts") else []
        items = [item for item in held if item.active]
        contacts = {item.name: contact(robot, item.contact) for item in items}
        drives = Drives(theirs.actuation, state)
        names = {item.contact.id: item.name for item in reversed(items)}
        terms = Terms(robot, names, drives if inverse else None, dt is None)
        costs, limits = terms.costs(theirs.costs.costs), self._limits(terms, theirs, held if inverse else [])
        if dt is None:
            return FreeDynamics(robot.model, None, costs, limits=limits)
        if inverse and len(items) < len(held):
            raise NoCounterpartError("DifferentialActionModelContactInvDynamics (with contacts that do not hold)")
        rest = {**rest, "actuation": drives.given(), "limits": limits}
        if inverse:
            return ContactInverseDynamics(robot.model, contacts, dt, costs, **rest)
        if name.endswith("FreeFwdDynamics"):
            return FreeDynamics(robot.model, dt, costs, **rest)
        return ContactDynamics(robot.model, contacts, dt, costs, theirs.JMinvJt_damping, **rest)

    def _limits(self, terms: Terms, theirs: Any, held: list[Any]) -> Any:
        """Converts the constraints of a model, except its built-in constraints on efforts, contacts and contact
        forces.
        """
        own = {"tau"} | {f"{item.name}_{what}" for item in held for what in ("acc", "force")}
        manager = theirs.constraints
        if manager is None:
            return []
        given = [item for item in manager.constraints if kind(theirs) not in _INVERSE or item.key() not in own]
        return terms.limits(given)

    def _impulse(self, theirs: Any, end: bool) -> _Made:
        robot = self._robot(theirs.state.pinocchio, theirs.armature)
        items = [item.data() for item in theirs.impulses.impulses if item.data().active]
        contacts = {item.name: contact(robot, item.impulse) for item in items}
        names = {item.impulse.id: item.name for item in reversed(items)}
        terms = Terms(robot, names, end=end)
        costs, limits = terms.costs(theirs.costs.costs), self._limits(terms, theirs, [])
        if end:
            return FreeDynamics(robot.model, None, costs, limits=limits)
        return ImpulseDynamics(robot.model, contacts, costs, theirs.r_coeff, theirs.JMinvJt_damping, limits)

    def _called(self, theirs: Any, end: bool) -> Action:
        """Returns an `Action` whose Python functions call the action of Crocoddyl."""
        data, state = theirs.createData(), theirs.state
        nu = 0 if end else theirs.nu

        def calc(t: int, x: _Array, u: _Array) -> tuple[Any, float]:
            if end:
                theirs.calc(data, x)
                return None, data.cost
            theirs.calc(data, x, u)
            return np.array(data.xnext), data.cost

        def calc_diff(t: int, x: _Array, u: _Array) -> dict[str, Any]:
            calc(t, x, u)
            if end:
                theirs.calcDiff(data, x)
                return {"q": np.array(data.Lx), "Q": np.array(data.Lxx)}
            theirs.calcDiff(data, x, u)
            names = {"A": "Fx", "B": "Fu", "q": "Lx", "r": "Lu", "Q": "Lxx", "S": "Lxu", "R": "Luu"}
            shapes = {"B": (state.ndx, nu), "S": (state.ndx, nu), "R": (nu, nu), "r": (nu,)}
            parts = {name: np.array(getattr(data, other), float) for name, other in names.items()}
            return {name: part.reshape(shapes.get(name, part.shape)) for name, part in parts.items()}

        lower, upper = (None, None) if end else self._bounds(theirs)
        return Action(state.nx, nu, calc, calc_diff, lower, upper, self._space(state))

    def _space(self, state: Any) -> Any:
        """Returns the space of states for actions whose functions call Crocoddyl."""
        if kind(state) == "StateVector":
            return None
        try:
            return self._robot(state.pinocchio).model
        except (AttributeError, NoCounterpartError):
            return state.ndx, state.integrate, state.diff


def differential_action(model: Any) -> Any:
    """Returns a `crocoddyl.DifferentialActionModelAbstract` equivalent to `model`, with Condyle's dynamics and costs.

    Use the result with the solvers and the integrators of Crocoddyl:
    `IntegratedActionModelEuler(differential_action(model), dt)`. Later changes of `model` do not affect the result. Use
    one thread, because Crocoddyl calls the result through Python.

    model: a `DifferentialActionModelFreeFwdDynamics` or `DifferentialActionModelContactFwdDynamics`.

    Raises `ProblemError` with the names of contents without a counterpart in Condyle.
    """
    if kind(model) not in _FORWARD:
        raise ProblemError(f"model: expected one of {' and '.join(_FORWARD)}, found {kind(model)}")
    if model.nh or model.ng:
        raise ProblemError(f"{kind(model)} (with constraints) has no counterpart here")
    reader = _Reader(bounded=False, strict=True)
    try:
        # in a step of one second, the change of v is q̈, and the cost of the step is the cost per second
        running, end = (reader.of_a_robot(model, dt, {}) for dt in (1.0, None))
    except NoCounterpartError as missing:
        raise ProblemError(f"{missing} has no counterpart here") from None
    return _differential_class()(model, running, Problem(model.state.zero(), [running], [0], end))


class _OnOurs:
    """Mixin that implements Crocoddyl's abstract differential action with Condyle's dynamics."""

    _base: Any
    state: Any
    nu: int
    u_lb: _Array
    u_ub: _Array

    def __init__(self, theirs: Any, running: Any, ours: Problem) -> None:
        self._base.__init__(self, theirs.state, theirs.nu, theirs.costs.nr)
        self._condyle_of, self._running, self._ours = theirs, running, ours
        if theirs.has_control_limits:
            self.u_lb, self.u_ub = theirs.u_lb, theirs.u_ub

    def calc(self, data: Any, x: _Array, u: _Array | None = None) -> None:
        """Computes q̈ and the cost; for a terminal model (u is None), only the cost."""
        value = self._ours.evaluate(np.array([x, x]), [np.zeros(self.nu) if u is None else u])
        if u is not None:
            data.xout[:] = value.accelerations[0]
        data.cost = value.costs[0 if u is not None else 1]

    def calcDiff(self, data: Any, x: _Array, u: _Array | None = None) -> None:
        """Computes the derivatives of q̈ and of the cost."""
        nodes = self._ours.derivatives(np.array([x, x]), [np.zeros(self.nu) if u is None else u])
        node: Any = nodes[0 if u is not None else 1]
        data.Lx[:], data.Lxx[:, :] = node.q, node.Q
        if u is None:
            return
        nv = self.state.nv
        data.Fx[:, :] = node.A[nv:]  # the derivative of v⁺ = v + q̈, minus the derivative of v
        data.Fx[:, nv:] -= np.eye(nv)
        one = self.nu == 1  # Crocoddyl represents a matrix with one column as a vector
        data.Fu[:] = node.B[nv:, 0] if one else node.B[nv:]
        data.Lxu[:] = node.S[:, 0] if one else node.S
        data.Lu[:], data.Luu[:] = node.r, (node.R[0] if one else node.R)

    def quasiStatic(self, data: Any, x: _Array, maxiter: int = 100, tol: float = 1e-9) -> _Array:
        """Returns the quasi-static controls of the model at the state x."""
        held: _Array = self._running.quasi_static(x)
        return held


_classes: list[Any] = []


def _differential_class() -> Any:
    """Returns the class for `differential_action`; the class is created on first use, because it requires Crocoddyl."""
    if not _classes:
        base: Any = import_module("crocoddyl").DifferentialActionModelAbstract
        _classes.append(type("DifferentialActionModel", (_OnOurs, base), {"_base": base}))
    return _classes[0]
