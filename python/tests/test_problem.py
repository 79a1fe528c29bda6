"""Tests of problems and solvers: an action for each knot, evaluation, callbacks, progress output, pickles of
results.
"""

import pickle
import sys
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    Activation,
    AugmentedLagrangian,
    ConstrainedAction,
    ConstraintRows,
    ContactDynamics,
    ContactInverseDynamics,
    Cost,
    DifferentialAction,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    FrictionCone,
    ImpulseDynamics,
    InteriorPoint,
    Iteration,
    Limit,
    LqKnot,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    Sweep,
    Unicycle,
)

ARM = condyle.robots.arm7()
QUADRUPED = condyle.robots.quadruped()
X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
STANDING = np.r_[condyle.neutral(QUADRUPED), np.zeros(18)]
STANDING[8:19] = np.tile([0.7, -1.4, 0.0], 4)[:11]
FEET = ("LF_foot", "RF_foot", "LH_foot", "RH_foot")
KNOTS = 11
# Tolerance for equal sums that are computed in another order.
ROUNDING = 1e-9


def costs(t: int) -> list[Cost]:
    terms = [
        Cost("state", 1e-1, Residual.state(STANDING)),
        Cost("effort", 1e-3 * (1.0 + t), Residual.control(np.zeros(12))),
        Cost("com", 1e1, Residual.center_of_mass([0.01 * t, 0.0, 0.35])),
    ]
    if t % 3 == 0:
        terms.append(Cost("foot", 1e2, Residual.frame_translation(QUADRUPED, "RF_foot", [0.2 + 0.01 * t, -0.1, 0.1])))
    return terms


def contacts(feet: tuple[str, ...] = FEET) -> dict[str, condyle.ContactConstraint]:
    return {foot: condyle.ContactConstraint(foot, "point", kd=20.0) for foot in feet}


def end() -> FreeDynamics:
    return FreeDynamics(QUADRUPED, None, [Cost("state", 1.0, Residual.state(STANDING))])


def gait() -> Problem:
    return Problem(
        STANDING, [ContactDynamics(QUADRUPED, contacts(), 0.02, costs(t)) for t in range(KNOTS)], None, end()
    )


def start(problem: Problem) -> Any:
    xs = np.tile(STANDING, (problem.horizon + 1, 1))
    return xs, problem.quasi_static(xs)


def reach() -> Any:
    rest = Cost("rest", 1e-1, Residual.state(X0))
    running = FreeDynamics(ARM, 0.05, [rest, Cost("effort", 1e-4, Residual.control(np.zeros(7)))])
    goal = Cost("reach", 1e3, Residual.frame_translation(ARM, "tool", [0.4, 0.2, 0.5]))
    problem = Problem(X0, [running], [0] * KNOTS, FreeDynamics(ARM, None, [rest, goal]))
    return problem, np.tile(X0, (KNOTS + 1, 1)), np.tile(running.quasi_static(X0), (KNOTS, 1))


def test_an_action_for_each_knot_gives_the_bits_of_one_for_all() -> None:
    apart = gait()
    knot = ContactDynamics(QUADRUPED, contacts(), 0.02, costs(0), costs_at={t: costs(t) for t in range(KNOTS)})
    shared = Problem(STANDING, [knot], [0] * KNOTS, end())
    xs, us = start(apart)
    np.testing.assert_array_equal(us, shared.quasi_static(xs))
    np.testing.assert_allclose(us[0], knot.quasi_static(STANDING), rtol=0, atol=1e-9)
    one, other = (Fddp(problem, max_iterations=6).solve(xs, us) for problem in (apart, shared))
    assert one.trace[0].accepted and [i.cost for i in one.trace] == [i.cost for i in other.trace]
    np.testing.assert_array_equal(one.xs, other.xs)
    # costs that are set later by `set_costs` affect only one knot
    for problem in (apart, shared):
        problem.set_costs(4, costs(7))
        problem.set_weight("com", 5.0)
    one, other = (Fddp(problem, max_iterations=6).solve(xs, us) for problem in (apart, shared))
    np.testing.assert_array_equal(one.xs, other.xs)
    again = Problem.from_json(apart.to_json())
    np.testing.assert_array_equal(Fddp(again, max_iterations=6).solve(xs, us).xs, one.xs)


def test_a_replaced_knot_is_that_of_a_new_problem() -> None:
    def problem(dt: float, target: int) -> Problem:
        times = [dt if t == 2 else 0.02 for t in range(KNOTS)]
        targets = [target if t == 4 else t for t in range(KNOTS)]
        knots = [ContactDynamics(QUADRUPED, contacts(), time, costs(t)) for time, t in zip(times, targets, strict=True)]
        return Problem(STANDING, knots, None, end())

    changed = problem(0.02, 4)
    solver = Fddp(changed, max_iterations=4)
    xs, us = start(changed)
    solver.solve(xs, us)
    changed.set_duration(2, 0.03)
    changed.set_knot(4, ContactDynamics(QUADRUPED, contacts(), 0.02, costs(7)))
    expected = Fddp(problem(0.03, 7), max_iterations=4).solve(xs, us)
    for same in (changed, Problem.from_json(changed.to_json()), pickle.loads(pickle.dumps(changed))):
        np.testing.assert_array_equal(Fddp(same, max_iterations=4).solve(xs, us).xs, expected.xs)
    np.testing.assert_array_equal(solver.solve(xs, us).xs, expected.xs)
    for dt in (0.0, np.inf):
        with pytest.raises(ProblemError, match="its duration must be above 0"):
            changed.set_duration(2, dt)
    with pytest.raises(ProblemError, match=f"knot {KNOTS}: expected"):
        changed.set_knot(KNOTS, ContactDynamics(QUADRUPED, contacts(), 0.02, []))
    with pytest.raises(ProblemError, match="knot 1: expected nx = 37, found 14"):
        changed.set_knot(1, FreeDynamics(ARM, 0.1, []))


def test_an_action_of_each_knot_moves_on_with_it() -> None:
    moving = gait()
    solver = Fddp(moving, max_iterations=3)
    solver.solve(*start(moving))
    solver.shift(7)
    knots = [*range(1, KNOTS), 7]
    fresh = Problem(STANDING, [ContactDynamics(QUADRUPED, contacts(), 0.02, costs(t)) for t in knots], None, end())
    xs, us = start(fresh)
    one, other = (Fddp(problem, max_iterations=3).solve(xs, us) for problem in (moving, fresh))
    np.testing.assert_array_equal(one.xs, other.xs)


def test_an_evaluation_is_what_the_solver_sees() -> None:
    problem, xs, us = reach()
    solution = Fddp(problem).solve(xs, us)
    found = problem.evaluate(solution.xs, solution.us)
    assert found.cost == pytest.approx(solution.cost, rel=ROUNDING)
    assert found.costs.shape == (KNOTS + 1,) and abs(found.gaps).max() < 1e-9
    np.testing.assert_allclose(found.next_states, solution.xs[1:], rtol=0, atol=1e-9)
    xs = np.array(solution.xs)
    xs[3, 2] += 0.1
    found = problem.evaluate(xs, solution.us)
    np.testing.assert_allclose(found.gaps[3], -0.1 * np.eye(14)[2], rtol=0, atol=1e-9)
    with pytest.raises(ValueError, match=r"xs: expected shape \(12, 14\)"):
        problem.evaluate(xs[1:], solution.us)


def test_accelerations_efforts_and_forces_of_a_solution() -> None:
    problem = gait()
    xs, us = start(problem)
    solver = Fddp(problem, max_iterations=4)
    solution = solver.solve(xs, us)
    data = condyle.Data(QUADRUPED)
    held = condyle.ConstraintSet(QUADRUPED, list(contacts().values()))
    for t in (0, 5):
        q, v = solution.xs[t, :19], solution.xs[t, 19:]
        tau = np.r_[np.zeros(6), solution.us[t]]
        expected = condyle.constrained_dynamics(QUADRUPED, data, held, q, v, tau)
        np.testing.assert_array_equal(solution.efforts[t], tau)
        np.testing.assert_allclose(solution.accelerations[t], expected.a, rtol=0, atol=1e-8)
        forces = np.concatenate([solution.forces[t][foot] for foot in FEET])
        np.testing.assert_allclose(forces, expected.lambda_, rtol=0, atol=1e-7)
    copy = pickle.loads(pickle.dumps(solution))
    np.testing.assert_array_equal(copy.xs, solution.xs)
    with pytest.raises(AttributeError, match="call Problem.evaluate"):
        _ = copy.forces
    late = solver.resume()
    solver.shift(0)
    with pytest.raises(ProblemError, match="the horizon has moved on since this solution"):
        _ = late.forces
    assert solution.forces[0].keys() == set(FEET)  # the forces are computed before the shift
    jump = ImpulseDynamics(QUADRUPED, contacts(("LF_foot",)), [])
    falling = np.array(STANDING)
    falling[21] = -1.0
    found = Problem(falling, [jump], [0], end()).evaluate(np.tile(falling, (2, 1)), [np.zeros(0)])
    assert found.forces[0]["LF_foot"].shape == (3,) and found.accelerations[0].shape == (0,)
    own = Problem([1.0], [Action(1, 1, lambda t, x, u: (x + u, 0.5))], [0], Lqr([[1.0]]))
    assert own.evaluate([[1.0], [1.0]], [[0.5]]).forces == [{}]


def test_a_callback_sees_iterations_and_ends_a_solve() -> None:
    problem, xs, us = reach()
    seen: list[Iteration] = []
    solution = Fddp(problem).solve(xs, us, callback=seen.append)
    assert seen == solution.trace and solution.status == "converged"
    solver = Fddp(problem)
    solution = solver.solve(xs, us, lambda now: now.iteration < 1)
    assert solution.status == "interrupted" and len(solution.trace) == 2
    assert solver.resume(callback=lambda now: None).status == "converged"

    def fail(now: Iteration) -> None:
        raise RuntimeError("seen enough")

    with pytest.raises(RuntimeError, match="seen enough"):
        solver.solve(xs, us, callback=fail)
    last = solver.solution
    assert last is not None and last.status == "interrupted"
    limited = AugmentedLagrangian(problem)
    assert limited.solve(xs, us, callback=lambda now: False).status == "interrupted"


def test_what_is_shown(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    problem, xs, us = reach()
    seen: list[Iteration] = []
    solution = Fddp(problem).solve(xs, us, seen.append, verbose=True)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["iter", "cost", "gap", "stop", "step", "regularisation"]
    assert len(lines) == 1 + len(solution.trace) and len(seen) == len(solution.trace)
    assert float(lines[-1].split()[1]) == pytest.approx(solution.cost, rel=1e-5)
    monkeypatch.setitem(sys.modules, "tqdm", None)
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    Fddp(problem).solve(xs, us, progress=True)
    assert capsys.readouterr().out.splitlines() == lines

    class Bar:
        updates, closed, shown = 0, False, ""

        def __init__(self, **_: Any) -> None:
            type(self).updates, type(self).closed = 0, False

        def set_postfix(self, **numbers: Any) -> None:
            type(self).shown = numbers["cost"]

        def update(self) -> None:
            type(self).updates += 1

        def close(self) -> None:
            type(self).closed = True

    fake: Any = type(sys)("tqdm.auto")
    fake.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm", type(sys)("tqdm"))
    monkeypatch.setitem(sys.modules, "tqdm.auto", fake)
    Fddp(problem).solve(xs, us, progress=True)
    assert (Bar.updates, Bar.closed, capsys.readouterr().out) == (len(solution.trace), True, "")
    assert float(Bar.shown) == pytest.approx(solution.cost, rel=1e-5)


def test_nothing_to_resume() -> None:
    problem, xs, us = reach()
    for solver in (Fddp(problem), AugmentedLagrangian(problem), InteriorPoint(problem)):
        with pytest.raises(ProblemError, match="resume: there is no solution to go on from; call solve first"):
            solver.resume()
        assert solver.solution is None
        solver.solve(xs, us)
        assert solver.resume().status == "converged"


def test_actions_in_the_wrong_place() -> None:
    last = FreeDynamics(ARM, None, [])
    knot = FreeDynamics(ARM, 0.1, [])
    with pytest.raises(ProblemError, match=r"knot 1: models\[1\] has no next state, as an action of the end"):
        Problem(X0, [knot, last], None, last)
    with pytest.raises(ProblemError, match="terminal: expected an action without controls"):
        Problem(X0, [knot], [0], knot)
    wrapped = ConstrainedAction(last, 1, lambda t, x, u: x[:1])
    with pytest.raises(ProblemError, match=r"knot 0: models\[0\] has no next state"):
        Problem(X0, [wrapped], [0], last)


@pytest.mark.parametrize("residual", [
    lambda: Residual.frame_rotation(ARM, "tool", 2.0 * np.eye(3)),
    lambda: Residual.frame_placement(ARM, "tool", np.diag([1.0, 1.0, -1.0, 1.0])),
])  # fmt: skip
def test_targets_that_are_no_rotations(residual: Any) -> None:
    with pytest.raises((ProblemError, ValueError), match="rotation"):
        FreeDynamics(ARM, 0.1, [Cost("turn", 1.0, residual())])
    with pytest.raises((ProblemError, ValueError), match="rotation"):
        reach()[0].set_costs(3, [Cost("turn", 1.0, residual())])


def test_a_sweep_is_the_solvers() -> None:
    problem, xs, us = reach()
    knots = problem.derivatives(xs, us)
    assert len(knots) == KNOTS + 1 and isinstance(knots[0], LqKnot)
    assert np.shape(knots[0].B) == (14, 7) and np.shape(knots[-1].B) == (14, 0)
    found = Sweep(knots).run(1e-9)
    solution = Fddp(problem, max_iterations=1, inverse_dynamics_form=False).solve(xs, us)
    for t in range(KNOTS):
        np.testing.assert_allclose(found.K[t], solution.K[t], rtol=0, atol=1e-6 * abs(solution.K[t]).max())
    # for a linear-quadratic problem, the first step u + k + K dx gives the optimum, which is computed by hand here
    dx, cost = np.zeros(14) + np.array(knots[0].f) * 0.0, 0.0
    for knot, K, k in zip(knots, found.K, found.k, strict=False):
        A, B, f, Q, S, R, q, r = (np.array(part) for part in knot[:8])
        du = k + K @ dx
        cost += 0.5 * dx @ Q @ dx + dx @ S @ du + 0.5 * du @ R @ du + q @ dx + r @ du
        dx = A @ dx + B @ du + f
    cost += 0.5 * dx @ np.array(knots[-1].Q) @ dx + np.array(knots[-1].q) @ dx
    assert cost < 0.0 and found.Vxx.shape == (KNOTS + 1, 14, 14) and found.Vx.shape == (KNOTS + 1, 14)
    with pytest.raises(ProblemError, match=r"knots\[0\]: expected no controls at the end, found 7"):
        Sweep(knots[:1])
    with pytest.raises(ProblemError, match="knots: expected at least one"):
        Sweep([])
    with pytest.raises(ProblemError, match=r"knots\[0\]: expected ndx = 1, found 14"):
        Sweep(
            [knots[0], LqKnot([[1.0]], np.zeros((1, 0)), [0.0], [[1.0]], np.zeros((1, 0)), np.zeros((0, 0)), [0], [])]
        )


def test_a_sweep_refuses_constraint_rows() -> None:
    problem, xs, us = reach()
    knots = problem.derivatives(xs, us)
    assert all(knot.rows is None for knot in knots)
    rows = ConstraintRows(np.eye(2, 14), np.ones((2, 7)), [0.5, 0.0], [-np.inf, 0.0], [1.0, 0.0])
    with pytest.raises(ProblemError, match="knot 2: the sweep does not treat constraint rows"):
        Sweep([*knots[:2], knots[2]._replace(rows=rows), *knots[3:]]).run()
    with pytest.raises(ValueError, match=r"rows\.D"):
        Sweep([knots[0]._replace(rows=rows._replace(D=np.ones((2, 6)))), *knots[1:]])


def power(t: Any, x: Any, u: Any) -> Any:
    return x[25:37] * u if len(u) else 0.1 * x[25:37]


def power_diff(t: Any, x: Any, u: Any) -> Any:
    by_x = np.zeros((12, 36))
    by_x[:, 24:] = np.diag(u) if len(u) else 0.1 * np.eye(12)
    return by_x, np.diag(x[25:37]) if len(u) else np.zeros((12, 0))


def plain(t: Any, x: Any, u: Any) -> Any:
    return np.asarray(power(t, x, u), dtype=float)


@pytest.mark.parametrize("calc", [power, plain])
def test_residuals_of_ones_own(calc: Any) -> None:
    def problem(residual: Residual) -> Problem:
        knots = [
            ContactDynamics(QUADRUPED, contacts(), 0.02, [*costs(t), Cost("power", 3.0 + t, residual)])
            for t in range(KNOTS)
        ]
        last = FreeDynamics(QUADRUPED, None, [Cost("power", 1.0, residual)])
        return Problem(STANDING, knots, None, last)

    ours, expected = problem(Residual.own(12, calc)), problem(Residual.own(12, calc, power_diff))
    xs, us = start(ours)
    assert ours.evaluate(xs + 0.1, us).cost > gait().evaluate(xs + 0.1, us).cost
    for form in (True, False):
        one, other = (Fddp(p, max_iterations=5, inverse_dynamics_form=form).solve(xs, us) for p in (ours, expected))
        assert one.trace[1].accepted
        np.testing.assert_allclose([i.cost for i in one.trace], [i.cost for i in other.trace], rtol=1e-6)
    threaded = Fddp(expected, max_iterations=5, inverse_dynamics_form=False, threads=3).solve(xs, us)
    np.testing.assert_array_equal(threaded.xs, other.xs)
    with pytest.raises(ProblemError, match="written in Python, which JSON cannot contain"):
        ours.to_json()


def bent(t: Any, x: Any, u: Any) -> Any:
    swing = 1.0 - np.cos(x[0]) + 0.5 * x[7:] @ x[7:]
    return swing + 0.5 * u @ u + 0.1 * u[0] * x[8] if len(u) else swing


def bent_diff(t: Any, x: Any, u: Any) -> Any:
    Q, S = np.diag(np.r_[np.cos(x[0]), np.zeros(6), np.ones(7)]), np.zeros((14, len(u)))
    q = np.r_[np.sin(x[0]), np.zeros(6), x[7:]]
    if not len(u):
        return {"q": q, "Q": Q}
    S[8, 0] = 0.1
    q[8] += 0.1 * u[0]
    return {"q": q, "Q": Q, "r": u + np.r_[0.1 * x[8], np.zeros(6)], "R": np.eye(7), "S": S}


def as_float(t: Any, x: Any, u: Any) -> float:
    return float(bent(t, x, u))


@pytest.mark.parametrize(("calc", "tolerance"), [(bent, 1e-12), (as_float, 1e-6)])
def test_costs_of_ones_own_have_a_hessian(calc: Any, tolerance: float) -> None:
    def problem(*functions: Any) -> Problem:
        cost = Cost("bent", 2.0, Residual.own_cost(*functions))
        return Problem(X0, [FreeDynamics(ARM, 0.1, [cost])], [0] * 3, FreeDynamics(ARM, None, [cost]))

    ours, expected = problem(calc), problem(bent, bent_diff)
    rng = np.random.default_rng(3)
    xs, us = rng.normal(size=(4, 14)), rng.normal(size=(3, 7))
    values = [2.0 * (0.1 * bent(t, xs[t], us[t]) if t < 3 else bent(t, xs[t], [])) for t in range(4)]
    np.testing.assert_allclose(ours.evaluate(xs, us).costs, values, rtol=1e-14)
    for t, (one, other) in enumerate(zip(ours.derivatives(xs, us), expected.derivatives(xs, us), strict=True)):
        scale, u = (0.2, us[t]) if t < 3 else (2.0, np.zeros(0))
        exact = bent_diff(t, xs[t], u)
        for name in exact:
            np.testing.assert_allclose(getattr(other, name), scale * np.asarray(exact[name]), atol=1e-14)
        for name in "qrQSR":
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=tolerance)


def test_what_is_no_cost_of_ones_own_is_said() -> None:
    for functions, error, message in (
        ([lambda t, x, u: x], TypeError, "the cost: expected a number"),
        ([bent, lambda t, x, u: {"A": x}], ValueError, "expected q, r, Q, S or R, found 'A'"),
        ([bent, lambda t, x, u: x], TypeError, "expected a dict of q, r, Q, S, R"),
    ):
        knot = FreeDynamics(ARM, 0.1, [Cost("own", 1.0, Residual.own_cost(*functions))])
        problem = Problem(X0, [knot], [0] * 3, FreeDynamics(ARM, None, []))
        with pytest.raises(error, match=message):
            Fddp(problem).solve(np.tile(X0, (4, 1)), np.zeros((3, 7)))


def test_errors_of_residuals_of_ones_own_are_raised() -> None:
    def fail(t: Any, x: Any, u: Any) -> Any:
        raise ZeroDivisionError("here")

    for calc, error in ((fail, ZeroDivisionError), (lambda t, x, u: x[:2], ValueError)):
        knot = FreeDynamics(ARM, 0.1, [Cost("own", 1.0, Residual.own(3, calc))])
        problem = Problem(X0, [knot], [0] * 3, FreeDynamics(ARM, None, []))
        for _ in range(2):
            with pytest.raises(error):
                Fddp(problem).solve(np.tile(X0, (4, 1)), np.zeros((3, 7)))
    good = FreeDynamics(ARM, 0.1, [])
    problem = Problem(X0, [good], [0] * 3, FreeDynamics(ARM, None, []))
    problem.set_costs(1, [Cost("own", 1.0, Residual.own(3, fail))])
    with pytest.raises(ZeroDivisionError):
        Fddp(problem).solve(np.tile(X0, (4, 1)), np.zeros((3, 7)))


def test_a_limit_of_ones_own_holds() -> None:
    slow = Limit("slow", Residual.own(1, lambda t, x, u: np.array([x[7:] @ x[7:]])), upper=[0.3])
    rest = Cost("rest", 1e-1, Residual.state(X0))
    knot = FreeDynamics(ARM, 0.05, [rest, Cost("effort", 1e-4, Residual.control(np.zeros(7)))], limits=[slow])
    goal = Cost("reach", 1e2, Residual.frame_translation(ARM, "tool", [0.4, 0.2, 0.5]))
    problem = Problem(X0, [knot], [0] * KNOTS, FreeDynamics(ARM, None, [rest, goal]))
    solver = AugmentedLagrangian(problem)
    solution = solver.solve(np.tile(X0, (KNOTS + 1, 1)), np.tile(knot.quasi_static(X0), (KNOTS, 1)))
    speeds = (solution.xs[:KNOTS, 7:] ** 2).sum(axis=1)
    assert solver.outcome.primal < 1e-4 and speeds.max() == pytest.approx(0.3, abs=1e-3)


def test_quasi_static_of_every_kind() -> None:
    assert FreeInverseDynamics(ARM, 0.1, []).quasi_static(X0).tolist() == [0.0] * 7
    assert ImpulseDynamics(QUADRUPED, contacts(), []).quasi_static(STANDING).shape == (0,)
    stance = ContactInverseDynamics(QUADRUPED, contacts(), 0.02, [])
    u = stance.quasi_static(STANDING)
    still = Problem(STANDING, [stance], [0], end()).evaluate(np.tile(STANDING, (2, 1)), [u])
    assert not u[:18].any() and u[18:].any() and still.costs[0] < 1e-15
    np.testing.assert_allclose(still.efforts[0][:6], 0.0, atol=1e-9)
    robot = FreeDynamics(ARM, 0.1, [])
    data = condyle.Data(ARM)

    def calc(t: Any, x: Any, u: Any) -> Any:
        return condyle.aba(ARM, data, x[:7], x[7:], u), 0.0

    own = DifferentialAction(7, 7, calc, 0.1, model=ARM)
    problem = Problem(X0, [own, robot], None, FreeDynamics(ARM, None, []))
    us = problem.quasi_static(np.tile(X0, (3, 1)))
    np.testing.assert_allclose(us[0], us[1], rtol=0, atol=1e-8)
    np.testing.assert_array_equal(us[1], robot.quasi_static(X0))
    linear = Problem([2.0], [Lqr([[0.5]], B=[[2.0]], R=[[1.0]])], [0], Lqr([[1.0]]))
    np.testing.assert_allclose(linear.quasi_static([[2.0], [2.0]]), [[0.5]])


KINDS: dict[str, Any] = {
    "FreeDynamics": lambda: FreeDynamics(ARM, 0.1, [Cost("rest", 1.0, Residual.state(X0))]),
    "end": lambda: FreeDynamics(ARM, None, []),
    "FreeInverseDynamics": lambda: FreeInverseDynamics(ARM, 0.1, [], lower=np.full(7, -3.0), controls="linear"),
    "ContactDynamics": lambda: ContactDynamics(QUADRUPED, contacts(), 0.02, costs(3)),
    "ContactInverseDynamics": lambda: ContactInverseDynamics(QUADRUPED, contacts(), 0.02, [], lower=np.full(30, -9.0)),
    "ImpulseDynamics": lambda: ImpulseDynamics(QUADRUPED, contacts(("LF_foot",)), []),
    "Lqr": lambda: Lqr([[1.0]], B=[[2.0]], R=[[1.0]], lower=[-1.0]),
    "Lqr, end": lambda: Lqr([[1.0]]),
    "ConstrainedAction": lambda: ConstrainedAction(Lqr([[1.0]]), 12, power),
    "DifferentialAction": lambda: DifferentialAction(1, 1, power, 0.1, integrator="runge_kutta_3", upper=[1.0]),
    "DifferentialAction of a robot": lambda: DifferentialAction(7, 7, power, 0.1, model=ARM),
    "Unicycle": lambda: Unicycle(0.2, (3.0, 1.0)),
    "Unicycle, end": lambda: Unicycle(terminal=True),
    "Cost": lambda: Cost("a", 2.0, Residual.frame_velocity(ARM, "tool"), Activation.smooth2(0.5)),
    "Cost of one's own": lambda: Cost("a", 2.0, Residual.own(12, power, power_diff)),
    "Cost with a Hessian of one's own": lambda: Cost("a", 2.0, Residual.own_cost(power, power_diff)),
    "Residual of inverse dynamics": Residual.undriven_effort,
    "Residual of a contact that may move": lambda: Residual.contact_acceleration("foot"),
    "Cost of a cone": lambda: Cost("a", 2.0, Residual.friction_cone("foot", FrictionCone(0.7))),
    "Limit": lambda: Limit("a", Residual.control([0.0]), lower=[-1.0]),
    "Limit, equality": lambda: Limit("a", Residual.control([0.0])),
    "Activation": lambda: Activation.relaxed_barrier([-np.inf], [1.0], 0.1, 5.0),
    "Residual": lambda: Residual.frame_translation(ARM, "tool", [1.0, 2.0, 3.0]),
    "Problem": gait,
    "Problem of all kinds": lambda: reach()[0],
    "Fddp": lambda: Fddp(reach()[0], max_iterations=7, method="ddp"),
    "AugmentedLagrangian": lambda: AugmentedLagrangian(reach()[0], inner={"threads": 2}, tolerance=1e-5),
    "InteriorPoint": lambda: InteriorPoint(reach()[0], barrier_start=1e-2, second_order=True),
}


@pytest.mark.parametrize("kind", KINDS)
def test_all_have_a_repr_and_pickle(kind: str) -> None:
    made = KINDS[kind]()
    again = pickle.loads(pickle.dumps(made))
    assert type(again) is type(made)
    assert repr(again) == repr(made)
    assert " at 0x" not in repr(made) and len(repr(made)) < 250
    if isinstance(made, Residual):
        assert again == made


def test_solvers_that_were_pickled_go_their_way() -> None:
    problem, xs, us = reach()
    solver = Fddp(problem, max_iterations=2)
    assert repr(solver) == f"<condyle.optimal.Fddp of {problem!r}, max_iterations 2>"
    one, other = solver.solve(xs, us), pickle.loads(pickle.dumps(solver)).solve(xs, us)
    assert len(other.trace) == 2
    np.testing.assert_array_equal(one.xs, other.xs)


def test_a_problem_of_actions_of_ones_own_pickles() -> None:
    robot = FreeDynamics(ARM, 0.1, [Cost("rest", 1.0, Residual.state(X0))])
    mixed = Problem(X0, [robot, DifferentialAction(7, 7, falling, 0.1, model=ARM)], [0, 1, 0], Lqr(np.eye(14)))
    mixed.set_weight("rest", 5.0)
    again = pickle.loads(pickle.dumps(mixed))
    xs, us = np.tile(X0, (4, 1)), np.zeros((3, 7))
    assert mixed.evaluate(xs + 0.1, us).cost == again.evaluate(xs + 0.1, us).cost > 0.0


def falling(t: Any, x: Any, u: Any) -> Any:
    return u - x[7:], 0.5 * (u @ u)


def test_references_are_written_into_all_knots_at_once() -> None:
    arm = condyle.robots.arm7()
    x0 = np.r_[np.full(7, 0.1), np.zeros(7)]
    rest = Cost("rest", 0.1, Residual.state(x0), Activation.weighted(np.ones(14)))
    pose = Cost("pose", 1.0, Residual.frame_placement(arm, "tool", np.eye(4)))
    turn = Cost("turn", 1.0, Residual.frame_rotation(arm, "tool", np.eye(3)))

    def problem(*at):
        knots = [FreeDynamics(arm, 0.05, list(costs)) for costs in at[:-1]]
        return Problem(x0, knots, None, FreeDynamics(arm, None, list(at[-1])))

    changed = problem([rest, pose, turn], [rest, pose, turn], [rest])
    rests = np.linspace(0.0, 1.0, 3 * 14).reshape(3, 14)
    poses = np.stack([np.eye(4)] * 3)
    poses[:, :3, 3] = [[0.1, 0.2, 0.3], [0.2, 0.3, 0.4], [np.nan] * 3]  # the terminal knot has no pose
    poses[1, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    changed.set_references("rest", rests)
    changed.set_references("pose", poses)
    changed.set_references("turn", poses[:, :3, :3])
    changed.set_weight("rest", [1.0, 2.0, 3.0])
    weights = np.linspace(1.0, 2.0, 3 * 14).reshape(3, 14)
    changed.set_entry_weights("rest", weights)
    np.testing.assert_array_equal(changed.references("rest"), rests)
    np.testing.assert_array_equal(changed.references("pose")[:2], poses[:2])
    assert changed.references("turn").shape == (3, 3, 3) and np.isnan(changed.references("pose")[2]).all()
    expected = problem(
        *(
            [
                Cost("rest", 1.0 + t, Residual.state(rests[t]), Activation.weighted(weights[t])),
                *(
                    (
                        Cost("pose", 1.0, Residual.frame_placement(arm, "tool", poses[t])),
                        Cost("turn", 1.0, Residual.frame_rotation(arm, "tool", poses[t, :3, :3])),
                    )
                    if t < 2
                    else ()
                ),
            ]
            for t in range(3)
        )
    )
    xs, us = np.full((3, 14), 0.2), np.full((2, 7), 0.3)
    same = expected.evaluate(xs, us).costs
    np.testing.assert_array_equal(changed.evaluate(xs, us).costs, same)
    for copy in (Problem.from_json(changed.to_json()), pickle.loads(pickle.dumps(changed))):
        np.testing.assert_array_equal(copy.evaluate(xs, us).costs, same)
        np.testing.assert_array_equal(copy.references("rest"), rests)
    changed.set_references("rest", rests + 1.0)  # another change after the text was written
    again = Problem.from_json(changed.to_json())
    np.testing.assert_array_equal(again.references("rest"), rests + 1.0)
    with pytest.raises(KeyError, match="no knot has a cost 'reach'"):
        changed.set_references("reach", rests)
    with pytest.raises(ValueError, match=r"values: expected shape \(3, 14\), found \(2, 14\)"):
        changed.set_references("rest", rests[:2])
    rests[1, 2] = np.inf
    with pytest.raises(ProblemError, match=r"cost `rest`: its reference holds an infinite number \(knot 1\)"):
        changed.set_references("rest", rests)
    with pytest.raises(ProblemError, match=r"cost `pose`: its activation has no weights \(knot 0\)"):
        changed.set_entry_weights("pose", np.ones((3, 6)))
    other = problem([Cost("own", 1.0, Residual.own(1, lambda t, x, u: x[:1]))], [])
    with pytest.raises(KeyError, match="the residual of the cost 'own' has no target"):
        other.references("own")


def test_contacts_are_changed_in_place() -> None:
    model = condyle.robots.quadruped()
    x = np.r_[condyle.neutral(model), np.zeros(18)]
    place = np.eye(4)
    place[:3, 3] = [0.3, 0.2, 0.1]

    def problem(**changes):
        foot = condyle.ContactConstraint("LF_foot", "point", None, "local_world_aligned", **({"kd": 20.0} | changes))
        other = condyle.ContactConstraint("RH_foot", "point")
        effort = Cost("effort", 1.0, Residual.control(np.zeros(12)))
        knots = [ContactDynamics(model, {"foot": foot, "other": other}, 0.02, [effort]), FreeDynamics(model, 0.02, [])]
        return Problem(x, knots, [0, 1, 0], FreeDynamics(model, None, []))

    us = np.full((3, 12), 0.3)
    changed = problem()
    before = changed.rollout(us)
    changed.set_contact("foot", placement=place, kp=[0.0, 0.0, 50.0])
    expected = problem(placement=place, kp=[0.0, 0.0, 50.0])
    after = changed.rollout(us)
    np.testing.assert_array_equal(after, expected.rollout(us))
    assert (after != before).any()
    text = changed.to_json()
    assert '"kp":[0.0,0.0,50.0,0.0,0.0,0.0],"kd":20.0' in text and text == expected.to_json()
    np.testing.assert_array_equal(Problem.from_json(text).rollout(us), after)
    np.testing.assert_array_equal(Problem.from_json(text.replace("50.0,0.0,0.0,0.0]", "50.0]")).rollout(us), after)
    changed.set_contact("foot", kp=3.0, kd=1.0)  # the placement stays
    np.testing.assert_array_equal(changed.rollout(us), problem(placement=place, kp=3.0, kd=1.0).rollout(us))
    with pytest.raises(KeyError, match="no knot has a contact 'hand'"):
        changed.set_contact("hand", kd=1.0)
    with pytest.raises(ProblemError, match="contact `foot`: kd must be a number of at least 0, found -1"):
        changed.set_contact("foot", kd=-1.0)
    with pytest.raises(ValueError, match="kp: expected a number, or 3 or 6 numbers, found 2"):
        changed.set_contact("foot", kp=[1.0, 2.0])


def test_velocity_and_tilt_do_not_depend_on_the_heading() -> None:
    def costs(yaw):
        x = STANDING.copy()
        x[3:7] = [0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)]
        x[19:25] = [0.5, 0.1, 0.0, 0.0, 0.0, 0.2]  # along the axes of the body
        terms = [
            Cost("moves", 1.0, Residual.heading_velocity(QUADRUPED, "root_joint", [0.4, 0.1, 0.0, 0.0, 0.0, 0.0])),
            Cost("leans", 1.0, Residual.tilt(QUADRUPED, "root_joint")),
        ]
        problem = Problem(x, [FreeDynamics(QUADRUPED, 0.02, [])], [0], FreeDynamics(QUADRUPED, None, terms))
        return problem.evaluate(np.tile(x, (2, 1)), np.zeros((1, 12))).cost

    assert costs(0.0) == pytest.approx(0.5 * (0.1**2 + 0.2**2))
    assert costs(2.0) == pytest.approx(costs(0.0))
    with pytest.raises(ProblemError, match="its desired vertical has the length 2, expected 1"):
        FreeDynamics(QUADRUPED, None, [Cost("leans", 1.0, Residual.tilt(QUADRUPED, "root_joint", [0.0, 0.0, 2.0]))])
