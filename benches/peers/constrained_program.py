"""Optimal control problems with limits as nonlinear programs of CasADi. Their functions come from condyle.casadi."""

import json
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import casadi
import numpy as np
from numpy.typing import NDArray

import condyle
import condyle.casadi
from condyle.optimal import FrictionCone, Problem, WrenchCone

_Array = NDArray[np.float64]


class Rows(NamedTuple):
    """Rows lower ≤ g ≤ upper of a program."""

    g: casadi.MX
    lower: _Array
    upper: _Array
    at: list[tuple[int, int]]
    """The knot of each row and its place among the knot's multipliers; empty for rows of the dynamics."""


class Program:
    """Multiple shooting for the JSON of a problem. The variables are x₀, u₀, x₁, … in this order, and x₀ is fixed.

    The rows of knot t begin with xₜ₊₁ − next(xₜ, uₜ) = 0, the form in which FATROP finds the knots. The limits follow.
    Limits on entries of x and u are bounds on variables, or rows if `as_rows` is true. Limits on x₀ are left out.

    The Hessian of a frame's pose in the costs is exact. Contact forces have the Hessian 0. `condyle.casadi` gives the
    other Hessians.
    """

    def __init__(self, text: str, as_rows: bool = False) -> None:
        self.problem, self.as_rows = Problem.from_json(text), as_rows
        self.spec = json.loads(self.problem.to_json())
        self.model = condyle.Model.from_json(json.dumps(self.spec["model"]))
        self.shift = self.problem.nx - self.problem.ndx  # a quaternion has one entry more than its tangent
        self.functions: dict[str, casadi.Function] = {}  # equal functions are made once: at most 64 may exist
        self.forces: dict[int, casadi.MX] = {}
        self.rows: list[Rows] = []
        models = [self.spec["knots"][k] for k in self.spec["knot_models"]] + [self.spec["terminal"]]
        N, nx, f, variables, boxes = len(models) - 1, self.problem.nx, 0.0, [], []
        x = start = casadi.MX.sym("x0", nx)
        for t, knot in enumerate(models):
            step = self.function(json.dumps(knot), lambda t=t: condyle.casadi.knot(self.problem, t))
            u = casadi.MX.sym(f"u{t}", step.size1_in(1) if t < N else 0)
            variables += [x, u]
            boxes.append([np.full((2, n), [[-np.inf], [np.inf]]) for n in (nx, u.numel())])
            after, cost = step(x, u) if t < N else (None, step(x))
            f += self.exact(knot, x, u) if posed(knot) else cost
            following = casadi.MX.sym(f"x{t + 1}", nx)
            if t < N:
                self.rows.append(Rows(following - after, np.zeros(nx), np.zeros(nx), []))
            if t == 0:
                self.rows.append(Rows(start - self.problem.x0, np.zeros(nx), np.zeros(nx), []))
            place = 0
            for limit in knot["limits"]:
                place = self.limit(limit, t, place, knot["dynamics"], x, u, boxes[t])
            x = following
        self.nlp = {"x": casadi.vertcat(*variables), "f": f, "g": casadi.vertcat(*[row.g for row in self.rows])}
        self.values = casadi.Function("values", [self.nlp["x"]], [self.nlp["f"], self.nlp["g"]])
        self.lbg, self.ubg = (np.concatenate([row[side] for row in self.rows]) for side in (1, 2))
        self.lbx, self.ubx = np.hstack([side for box in boxes for side in box])

    def function(self, key: str, make: Callable[[], casadi.Function]) -> casadi.Function:
        if key not in self.functions:
            self.functions[key] = make()
        return self.functions[key]

    def exact(self, knot: dict[str, Any], x: casadi.MX, u: casadi.MX) -> casadi.MX:
        """Returns a knot's cost, written as an expression."""
        total = casadi.MX(0.0)
        for cost in knot["costs"]:
            [(kind, numbers)] = cost["residual"].items()
            if kind == "frame_placement":
                r = self.pose(numbers, x)
            else:
                assert kind in ("state", "control") and not self.shift, kind
                r = (x if kind == "state" else u) - np.array(numbers["reference"])
            weights = np.ones(r.numel()) if cost["activation"] == "quadratic" else cost["activation"]["weighted"]
            total += 0.5 * cost["weight"] * casadi.dot(casadi.DM(weights) * r, r)
        return total if u.numel() == 0 else knot["dynamics"]["free"]["dt"] * total

    def pose(self, numbers: Any, x: casadi.MX) -> casadi.MX:
        """Returns the logarithm of a frame's pose, seen from the target."""
        frame, target = numbers["frame"]["name"], numbers["target"]
        made = self.function(f"pose {frame}", lambda: condyle.casadi.forward_kinematics(self.model, frame))
        p, R = made(x[: self.model.nq])
        R0 = matrix(target["rotation"])
        return self.function("logarithm", logarithm)(R0.T @ R, R0.T @ (p - casadi.DM(vector(target["translation"]))))

    def limit(
        self, limit: dict[str, Any], t: int, place: int, dynamics: Any, x: casadi.MX, u: casadi.MX, box: list[_Array]
    ) -> int:
        """Adds a limit's rows, without infinite ones, or bounds on variables in `box`. `place` is the place of the
        limit's first multiplier. Returns the place of the next limit's."""
        [(kind, numbers)] = limit["residual"].items()
        lower, upper = bounds(limit["lower"], -np.inf), bounds(limit["upper"], np.inf)
        if not len(lower):  # an equation
            size = {"state": self.problem.ndx, "frame_translation": 3, "frame_velocity": 6}[kind]
            lower = upper = np.zeros(size)
        finite = np.flatnonzero(np.isfinite(lower) | np.isfinite(upper))
        of_u, following = kind in ("control", "friction_cone", "wrench_cone"), place + len(lower)
        low, high = lower[finite], upper[finite]
        if not len(finite) or (t == 0 and not of_u):
            return following
        if kind in ("control", "state"):
            assert of_u or not self.shift or finite[0] >= 6, "limits on the pose of a base"
            entries = finite if of_u else finite + self.shift
            reference = np.array(numbers["reference"])[entries]
            low, high, value = low + reference, high + reference, (u if of_u else x)[entries.tolist()]
            if not self.as_rows and (low < high).all():
                b = box[of_u]
                b[0, entries], b[1, entries] = np.maximum(b[0, entries], low), np.minimum(b[1, entries], high)
                return following
        else:
            value = self.residual(kind, numbers, t, dynamics, x, u)[finite.tolist()]
        self.rows.append(Rows(value, low, high, [(t, place + int(k)) for k in finite]))
        return following

    def residual(self, kind: str, numbers: Any, t: int, dynamics: Any, x: casadi.MX, u: casadi.MX) -> casadi.MX:
        q, v, functions = x[: self.model.nq], x[self.model.nq :], condyle.casadi
        if kind in ("friction_cone", "wrench_cone"):
            contacts = dynamics["contact"]["contacts"]
            if t not in self.forces:  # all cones of a knot share a call
                made = self.function(json.dumps(contacts), lambda: linear_forces(self.model, contacts))
                self.forces[t] = made(q, v, casadi.vertcat(casadi.MX.zeros(self.model.nv - u.numel()), u))
            k = [c["name"] for c in contacts].index(numbers["contact"])
            A = cone(kind, numbers["cone"]).rows()
            n = A.shape[1]
            return casadi.DM(A) @ self.forces[t][n * k : n * (k + 1)]
        frame, target = numbers["frame"]["name"], numbers["target"]
        if kind == "frame_translation":
            made = self.function(f"pose {frame}", lambda: functions.forward_kinematics(self.model, frame))
            return made(q)[0] - casadi.DM(vector(target))
        assert kind == "frame_velocity", kind
        axes = numbers["reference"]
        made = self.function(f"rate {frame} {axes}", lambda: functions.frame_velocity(self.model, frame, axes))
        return made(q, v) - casadi.DM(vector(target["linear"]) + vector(target["angular"]))

    def pack(self, xs: Any, us: Any) -> _Array:
        """Returns states and controls as one vector of variables."""
        return np.concatenate([np.ravel(part) for pair in zip(xs, [*us, []], strict=True) for part in pair])

    def measure(self, z: _Array) -> tuple[float, float]:
        """Returns the cost, and the largest violation of a limit or of the dynamics."""
        f, g = (np.array(value).ravel() for value in self.values(z))
        outside = [self.lbg - g, g - self.ubg, self.lbx - z, z - self.ubx]
        return float(f[0]), max(float(np.max(part)) for part in outside)

    def multipliers(self, y: Sequence[_Array]) -> _Array:
        """Returns the multipliers of knots in the order of this program's rows; NaN for rows of the dynamics."""
        return np.concatenate(
            [[y[t][k] for t, k in row.at] if row.at else np.full(row.g.numel(), np.nan) for row in self.rows]
        )

    def solver(self, plugin: str, options: dict[str, Any]) -> casadi.Function:
        """Returns IPOPT ('ipopt') or FATROP ('fatrop') for this program."""
        if plugin == "fatrop":
            options = {"structure_detection": "auto", "equality": (self.lbg == self.ubg).tolist()} | options
        return casadi.nlpsol("solver", plugin, self.nlp, {"print_time": False, "error_on_fail": False} | options)

    def solve(self, solver: casadi.Function, z: _Array) -> dict[str, casadi.DM]:
        return solver(x0=z, lbx=self.lbx, ubx=self.ubx, lbg=self.lbg, ubg=self.ubg)


def linear_forces(model: condyle.Model, contacts: list[dict[str, Any]]) -> casadi.Function:
    """Returns the function of the contact forces, with an exact Jacobian and the Hessian 0.

    With the exact Hessian, an iteration of IPOPT takes four times the time, and IPOPT needs more iterations. Condyle's
    solvers do without this Hessian, too.
    """
    names, sizes = ("q", "v", "tau"), (model.nq, model.nv, model.nv)
    x = [casadi.MX.sym(name, n) for name, n in zip(names, sizes, strict=True)]
    forces = condyle.casadi.constrained_dynamics(model, [contact(c) for c in contacts])(*x)[1]
    arguments, results = [*x, casadi.MX.sym("at", forces.numel())], [casadi.jacobian(forces, part) for part in x]
    spelled = [*names, "out_forces"], [f"jac_forces_{name}" for name in names]
    jacobian = casadi.Function("jac_forces", arguments, results, *spelled, {"is_diff_in": [False] * 4})
    options = {"custom_jacobian": jacobian, "enable_forward": False, "enable_reverse": False, "never_inline": True}
    return casadi.Function("forces", x, [forces], names, ["forces"], options | {"jac_penalty": 0})


def posed(knot: dict[str, Any]) -> bool:
    """Returns whether the costs of a knot contain a frame's pose."""
    return any("frame_placement" in cost["residual"] for cost in knot["costs"])


def logarithm() -> casadi.Function:
    """Returns the function that maps the rotation and translation of a pose near the identity to log₆, linear first."""
    R, p = casadi.SX.sym("R", 3, 3), casadi.SX.sym("p", 3)
    w, c = casadi.inv_skew(R - R.T) / 2, (casadi.trace(R) - 1) / 2  # n sin θ, cos θ
    s2 = casadi.dot(w, w)
    small = s2 < 1e-6  # below, series; both branches have finite derivatives
    s = casadi.sqrt(casadi.if_else(small, 1.0, s2))
    ratio = casadi.if_else(small, 1 + s2 / 6 + 3 * s2**2 / 40 + 5 * s2**3 / 112, casadi.atan2(s, c) / s)  # θ / sin θ
    omega = ratio * w
    t2 = casadi.dot(omega, omega)
    t = casadi.sqrt(casadi.if_else(small, 1.0, t2))
    series = 1 / 12 + t2 / 720 + t2**2 / 30240
    beta = casadi.if_else(small, series, 1 / t**2 - (1 + casadi.cos(t)) / (2 * t * casadi.sin(t)))
    turned = casadi.cross(omega, p)
    linear = p - turned / 2 + beta * casadi.cross(omega, turned)
    return casadi.Function("logarithm", [R, p], [casadi.vertcat(linear, omega)])


def bounds(numbers: list[float | None], infinite: float) -> _Array:
    """Returns the numbers as an array, with `infinite` in place of None."""
    return np.array([infinite if x is None else x for x in numbers], dtype=float)


def vector(numbers: dict[str, float]) -> list[float]:
    return [numbers[axis] for axis in "xyz"]


def matrix(numbers: dict[str, dict[str, float]]) -> _Array:
    """Returns a rotation matrix. The JSON has its columns."""
    return np.array([vector(numbers[axis]) for axis in "xyz"]).T


def contact(numbers: dict[str, Any]) -> condyle.ContactConstraint:
    """Returns the contact of a knot. Its axes must be equal to the axes of its frame."""
    c = numbers["constraint"]
    assert c["other"] is None and np.array_equal(matrix(c["axes"]), np.eye(3)), "contacts with own axes"
    placement, at = np.eye(4), c["target"]["placement"]
    placement[:3, :3], placement[:3, 3] = matrix(at["rotation"]), vector(at["translation"])
    return condyle.ContactConstraint(
        c["frame"], c["kind"], reference=c["reference"], kp=c["kp"], kd=c["kd"], placement=placement
    )


def cone(kind: str, numbers: dict[str, Any]) -> FrictionCone | WrenchCone:
    friction = numbers if kind == "friction_cone" else numbers["friction"]
    made = FrictionCone(friction["mu"], friction["facets"], friction["inner"], matrix(friction["rotation"]))
    return made if kind == "friction_cone" else WrenchCone(made, numbers["size"])
