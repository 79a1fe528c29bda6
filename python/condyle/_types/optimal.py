"""Results of optimal control: solutions, their iterations and timings, linear-quadratic knots, and sensitivities."""

from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from typing_extensions import disjoint_base
else:

    def disjoint_base(cls: type) -> type:
        """Marks a class for type checkers as a disjoint base, so that no class can derive from this class and another
        disjoint base.
        """
        return cls


_Array: TypeAlias = NDArray[np.float64]


class Iteration(NamedTuple):
    """A record of one iteration of a solver."""

    iteration: int
    """Index of the iteration, which begins at 0."""
    cost: float
    """Cost of the iterate after the step."""
    gap: float
    """Largest gap of the iterate before the step."""
    stop: float
    """The expected decrease of the cost for the full step. The solver compares this decrease with the tolerance."""
    step: float
    """The last step length tried, which is the accepted step length if a step was accepted."""
    regularisation: float
    """Regularisation of the sweep after the iteration."""
    d1: float
    """Slope of the expected decrease: for a step length α, the cost should decrease by α (d1 + ½ α d2)."""
    d2: float
    """Curvature of the expected decrease; see `d1`."""
    feasible: bool
    """Whether the iterate after the step satisfies the dynamics."""
    accepted: bool
    """Whether a step was accepted; if not, the iterate is unchanged."""


class Timings(NamedTuple):
    """The durations of the phases of a solve (s)."""

    calc: float
    """Time for dynamics and cost of the warm start."""
    calc_diff: float
    """Time for the derivatives of dynamics and costs."""
    sweep: float
    """Time for backward sweeps, including repeated sweeps."""
    rollout: float
    """Time for the trial rollouts of the line searches, accepted or not."""
    total: float
    """Time for the whole solve."""
    overrun: float = 0.0
    """The time in excess of `time_budget`. The overrun is above zero if the budget is shorter than an iteration, or if
    the solve was delayed. With a budget of 0 no iteration is made, and the overrun is 0.
    """


class Evaluation(NamedTuple):
    """The cost of states and controls, and the results of the dynamics at each knot."""

    cost: float
    """The sum of the costs of all knots."""
    costs: _Array
    """The cost of each knot, N + 1 numbers, the terminal knot last."""
    next_states: _Array
    """The next states φ(x, u), (N, nx)."""
    gaps: _Array
    """The gaps: first x̂₀ ⊖ x₀ with the problem's initial state x̂₀, then φ(xₜ, uₜ) ⊖ xₜ₊₁ with the next state φ(xₜ,
    uₜ) for each knot t, (N + 1, ndx).
    """
    accelerations: list[_Array]
    """The accelerations of each knot of a robot, nv numbers; empty for other knots and for impacts."""
    efforts: list[_Array]
    """The efforts of all joints at each knot of a robot, nv numbers; empty for other knots and for impacts."""
    forces: list[dict[str, _Array]]
    """For each knot, the contact forces by the contact's name, 1 to 6 numbers along the axes of the contact's rows; for
    impacts, the impulses.
    """


class _Solution(NamedTuple):
    xs: _Array
    """The states of the trajectory, (N + 1, nx)."""
    us: _Array | list[_Array]
    """The controls of the trajectory, (N, nu)."""
    K: _Array | list[_Array]
    """Feedback gains of the last sweep, (N, nu, ndx): u + K (x ⊖ x̄) is the control near the trajectory."""
    k: _Array | list[_Array]
    """The feed-forward terms of the last sweep, (N, nu)."""
    cost: float
    """Cost of the trajectory."""
    gap: float
    """Largest gap of the trajectory."""
    feasible: bool
    """Whether the trajectory satisfies the dynamics."""
    status: Literal[
        "converged",
        "full_step",
        "max_iterations",
        "time_limit",
        "interrupted",
        "regularisation_limit",
        "constraints_violated",
        "infeasible",
        "not_finite",
    ]
    """The reason why the solve ended.

    A controller may execute the solution, with u = ū + K (x ⊖ x̄), after "converged" and "full_step": the trajectory
    then begins at x̂₀ and has no gaps. After "max_iterations", "time_limit", "interrupted" and "regularisation_limit",
    all numbers are finite, but the trajectory may have gaps, and x̄₀ may differ from x̂₀. If `trace` is empty, the gains
    are from the previous solve. After "not_finite", continue with the previous solution. After
    "constraints_violated" and "infeasible", the violation in `outcome.worst` decides.

    "full_step": `resume(stop="full_step")` accepted a step of length 1. "regularisation_limit": no acceptable step was
    found, away from a minimum. "constraints_violated": the penalty reached its maximum, and limits do not hold at a
    minimum; this does not prove that no solution exists. "infeasible": the initial state violates a limit of knot 0
    that no control can change. This proves that no solution exists. `InteriorPoint` also ends with "infeasible" where
    no small change of the trajectory reduces the violation, and with "constraints_violated" if its restoration did not
    reduce the violation enough. Another warm start may then find a solution. `outcome.worst` contains the limit.
    """
    trace: list[Iteration]
    """The records of the iterations, one for each iteration."""
    timings: Timings
    """The durations of the phases of the solve."""
    fallback: Literal["rolled_out", "held_still"] | None = None
    """The trajectory that replaced the trajectory of the last solution; None if that was continued.

    "rolled_out": a rollout of the last plan from x̂₀ with its gains. It replaces a plan with gaps above 10 (rad, m,
    rad/s, m/s), and it is the plan after a tick whose sweep failed. "held_still": x̂₀ at all knots, and the controls
    that hold it still. They replace a plan that is not finite, or that costs far more than the last solution.
    """


class PlanPoint(NamedTuple):
    """A plan at one time, as `Solution.at` returns it."""

    knot: int
    """The index of the knot."""
    x: _Array
    """The state x̄, interpolated between the states of this knot and of the next one, nx numbers."""
    u: _Array
    """The controls ū of the knot, nu numbers."""
    K: _Array
    """The feedback gains of the knot, (nu, ndx)."""


class RecordedTick(NamedTuple):
    """A tick of a `Record`: the calls since the tick before it, and the result of the last call."""

    calls: list[tuple[str, dict[str, Any]]]
    """The calls in their sequence: the name of the method of `Problem` or of the solver, and its arguments by name.
    The last call is `solve`, `resume` or `tick`. "settings" contains settings that were assigned. The costs of
    `set_costs` and the model of `set_knot` are JSON.
    """
    status: str
    """The status of the solution."""
    xs: _Array
    """The states of the solution, (N + 1, nx)."""
    us: _Array
    """The controls of the solution, (N, nu), or the numbers of all knots in one array if models differ in nu."""


class Difference(NamedTuple):
    """The first difference between a `Record` and its replay."""

    tick: int
    """The index of the tick."""
    array: str
    """The array that differs: "status", "xs", "us" or "K"."""
    largest: float
    """The largest difference of two numbers; NaN for the status and for K, of which a record has only a checksum."""


@disjoint_base
class Solution(_Solution):
    """The result of a solve: the best iterate, for every status.

    If knots differ in nu, `us`, `K` and `k` are lists of N arrays.
    """

    _source: Any = None
    _evaluation: Evaluation | None = None
    _times: _Array | None = None

    @property
    def executable(self) -> bool:
        """Whether a controller may execute the plan: the status is not "not_finite", and all states, controls and gains
        are finite. The plan may still have gaps (`gap`), or violate limits (`outcome.worst`).

        If the plan is not executable, continue with the last one that was, and `reset` the solver.
        """
        arrays = [self.xs, *self.us, *self.K]
        return self.status != "not_finite" and all(bool(np.isfinite(numbers).all()) for numbers in arrays)

    def at(self, t: float) -> PlanPoint:
        """Returns the plan at the time t (s) after the beginning of knot 0, as a `PlanPoint`.

        The state is x̄ = xₖ ⊕ s (xₖ₊₁ ⊖ xₖ) at the fraction s of knot k. The controls and gains belong to knot k,
        because they are constant during a knot. Times outside the horizon give its first or its last state. An impact
        takes no time. Another thread can call this method while a solve runs.

        Raises `ValueError` if a knot has no duration: a knot of an `Action`.
        """
        if self._source is None:
            raise AttributeError("this solution was copied from its problem, which interpolates states")
        if (times := self._times) is None:
            raise ValueError("a knot has no duration: only knots of robots have durations")
        last = len(times) - 2
        knot = int(np.searchsorted(times[1 : last + 1], t, side="right"))
        span = times[knot + 1] - times[knot]
        s = min(max((t - times[knot]) / span, 0.0), 1.0) if span > 0.0 else 0.0
        while len(self.us[knot]) == 0 and knot > 0:
            knot, s = knot - 1, 1.0
        x = self._source[0]._between(self.xs[knot], self.xs[knot + 1], s)
        return PlanPoint(knot, x, self.us[knot], self.K[knot])

    def _evaluated(self) -> Evaluation:
        if self._evaluation is None:
            if self._source is None:
                raise AttributeError("this solution was copied from its problem: call Problem.evaluate(xs, us)")
            problem, moved = self._source
            self._evaluation = problem._evaluate(self.xs, self.us, moved)
        return self._evaluation

    @property
    def accelerations(self) -> list[_Array]:
        """The accelerations of each knot, as in an `Evaluation`; computed on first access."""
        return self._evaluated().accelerations

    @property
    def efforts(self) -> list[_Array]:
        """The efforts of all joints at each knot, as in an `Evaluation`; computed on first access."""
        return self._evaluated().efforts

    @property
    def forces(self) -> list[dict[str, _Array]]:
        """The forces of each knot's contacts by name, as in an `Evaluation`; computed on first access."""
        return self._evaluated().forces

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns the function and the arguments from which `pickle` makes a solution with the same numbers, but
        without the problem.
        """
        return type(self), tuple(self)


class ConstraintRows(NamedTuple):
    """Constraints of an `LqKnot`: lower ≤ C δx + D δu + c ≤ upper, row by row."""

    C: ArrayLike
    """The derivative ∂g/∂x of the constraints g, (rows, ndx)."""
    D: ArrayLike
    """The derivative ∂g/∂u of the constraints g, (rows, nu)."""
    c: ArrayLike
    """The values of the constraints at δx = 0, δu = 0, one for each row."""
    lower: ArrayLike
    """The lower bounds, one for each row; −∞ for no bound."""
    upper: ArrayLike
    """The upper bounds, one for each row; ∞ for no bound."""


class LqKnot(NamedTuple):
    """The linear-quadratic problem of a knot: dynamics δx⁺ = A δx + B δu + f, and cost ½ δxᵀQδx + δxᵀSδu + ½ δuᵀRδu +
    qᵀδx + rᵀδu.
    """

    A: ArrayLike
    """The derivative ∂x⁺/∂x of the next state, (ndx, ndx)."""
    B: ArrayLike
    """The derivative ∂x⁺/∂u of the next state, (ndx, nu)."""
    f: ArrayLike
    """The gap φ(x, u) ⊖ x⁺, ndx numbers."""
    Q: ArrayLike
    """The second derivative ∂²ℓ/∂x² of the cost, (ndx, ndx)."""
    S: ArrayLike
    """The second derivative ∂²ℓ/∂x∂u of the cost, (ndx, nu)."""
    R: ArrayLike
    """The second derivative ∂²ℓ/∂u² of the cost, (nu, nu)."""
    q: ArrayLike
    """The derivative ∂ℓ/∂x of the cost, ndx numbers."""
    r: ArrayLike
    """The derivative ∂ℓ/∂u of the cost, nu numbers."""
    rows: ConstraintRows | None = None
    """The constraints of the knot; None without constraints."""


class ManyRollouts(NamedTuple):
    """The results of `rollout_many` for B control sequences.

    If a sequence diverges, its cost is infinite, its gradients are NaN, and its states are NaN from there on.
    """

    costs: _Array
    """The cost of each sequence, B numbers."""
    xs: _Array | None
    """The states of each sequence, (B, N + 1, nx); None if they were not asked for."""
    du: _Array | None
    """The gradients of the costs with respect to the controls, with the shape of `us`; None if not asked for."""
    dx0: _Array | None
    """The gradients of the costs with respect to the initial states, in the tangent space, (B, ndx)."""


class SweepResult(NamedTuple):
    """The feedback and the value functions of a `Sweep`: V(δx) = ½ δxᵀ Vxx δx + Vxᵀ δx + a constant."""

    K: list[_Array]
    """The gains of each knot, (nu, ndx)."""
    k: list[_Array]
    """The feed-forward of each knot, nu numbers."""
    Vx: _Array
    """The gradients of the value functions, (N + 1, ndx)."""
    Vxx: _Array
    """The Hessians of the value functions, (N + 1, ndx, ndx)."""


class Violation(NamedTuple):
    """A row of a limit, or of the dynamics, that is violated at the end of a solve."""

    kind: Literal["constraint", "control_bound", "gap"]
    """'constraint' for a limit or constraint of a knot, 'control_bound' for a bound on a control, 'gap' for a gap of
    the dynamics.
    """
    knot: int
    """The index of the knot, 0 … N."""
    row: int
    """The index of the row in `multipliers[knot]`; for a bound, the index of the control; for a gap, the index in the
    tangent vector.
    """
    name: str | None
    """The name of the limit; None for a constraint of a `ConstrainedAction` and for a gap."""
    entry: int
    """The index of the row in the limit `name`; without a name, the same number as `row`."""
    amount: float
    """The distance from the bound, or the magnitude of the gap; infinite if this number is NaN."""
    what: str | None = None
    """The two geometries of a limit of distances; None for other rows."""


class SensitivityReport(NamedTuple):
    """The report of a `Sensitivity` on the solution at which it was computed."""

    curvature: Literal["exact", "dynamics", "gauss_newton"]
    """The second derivatives that were used."""
    stationarity: float
    """The largest gradient of the Lagrangian with respect to a free control, relative to its terms."""
    primal: float
    """The largest gap of the dynamics, or distance of an active constraint from its bound."""
    active_controls: int
    """The number of controls at a bound, over all knots."""
    active_rows: int
    """The number of active rows of limits, over all knots. Equalities are always active."""
    strict_complementarity: bool
    """Whether each inequality is clearly active or clearly inactive: `margin` is at least `strictness`. If not, the
    solution has a kink nearby, and the derivative on the other side of the kink differs.
    """
    margin: float
    """The smallest value, over all inequalities, of the larger one of multiplier and distance from the bound."""
    weakest: tuple[Literal["control_bound", "constraint"], int, int] | None
    """The inequality with that value: its kind, its knot, and its control or row; None without inequalities."""


class BoundGradients(NamedTuple):
    """The gradients of a loss with respect to the initial state and to active bounds, from `Sensitivity.bounds`."""

    x0: _Array
    """The gradient with respect to the initial state, ndx numbers in its tangent space."""
    control_bounds: _Array | list[_Array]
    """The gradients with respect to the bounds on controls, (N, nu), or a list of N arrays if knots differ in nu; zero
    for controls that are not at a bound.
    """
    row_bounds: list[_Array]
    """The gradients with respect to the bounds of limits, for the rows of each knot in the order of
    `Outcome.multipliers`; zero for rows that are not active. Both bounds of an equality move.
    """


class Outcome(NamedTuple):
    """The violation of limits and other results of a solve of `AugmentedLagrangian` or `InteriorPoint`, in addition to
    its `Solution`.
    """

    cost: float
    """The cost without the penalties of the limits."""
    primal: float
    """The largest distance of a limited number from its bounds, or the largest gap of the dynamics. Soft limits have no
    part in it.
    """
    dual: float
    """The largest entry of the Lagrangian's gradient. For `AugmentedLagrangian` the gradient is with respect to
    controls and states, projected onto the bounds of the controls. For `InteriorPoint` it is with respect to the
    controls, and infinite after `tick`, which does not measure it.
    """
    multipliers: list[_Array]
    """The multipliers of each knot, limit by limit: positive at an upper bound, negative at a lower bound. For
    `InteriorPoint`, the multipliers of the bounds on controls follow.
    """
    penalty: float
    """The penalty 1/μ at the end of the solve of `AugmentedLagrangian`; 0 for `InteriorPoint`."""
    solves: int
    """The number of inner solves."""
    iterations: int
    """The total number of iterations of the inner solves."""
    worst: Violation | None = None
    """The largest violation; None if all limits hold exactly."""
    barrier: float = 0.0
    """The barrier parameter μ at the end of the solve of `InteriorPoint`; 0 for `AugmentedLagrangian`."""
    soft_cost: float = 0.0
    """The cost of all numbers outside the bounds of soft limits. `cost` does not contain it; the sum is minimal."""
    gave_way: tuple[Violation, ...] = ()
    """The rows of soft limits outside their bounds by more than 100 times the tolerance, knot by knot."""
    limits: dict[str, list[slice]] = {}  # noqa: RUF012 - a named tuple has no mutable attributes of its own
    """The rows of each named limit: for each knot a slice of `multipliers[knot]`, empty at a knot without the limit."""

    def multipliers_of(self, name: str) -> _Array:
        """Returns the multipliers of the limit `name`, (N + 1, rows): positive at an upper bound, negative at a lower
        bound. They are 0 at a knot without this limit. `solver.set_multipliers` accepts the result.

        Raises `ProblemError` if no limit has this name.
        """
        from .._condyle import ProblemError

        if name not in self.limits:
            names = f"; the limits are {', '.join(f'`{known}`' for known in self.limits)}" if self.limits else ""
            raise ProblemError(f"multipliers of `{name}`: no limit has this name{names}")
        found = [y[rows] for y, rows in zip(self.multipliers, self.limits[name], strict=True)]
        result = np.zeros((len(found), max(map(len, found))))
        for row, y in zip(result, found, strict=True):
            row[: len(y)] = y
        return result


class Sphere(NamedTuple):
    """A sphere that is fixed to a frame of a robot, or to the world; see `Residual.distances`."""

    center: ArrayLike
    """The centre in the coordinates of the frame (m), three numbers."""
    radius: float = 0.0
    """The radius (m), at least 0; a sphere with the radius 0 is a point."""
    frame: str | int | None = None
    """The frame, by name or by index in the model; None for the world."""
