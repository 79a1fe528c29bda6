"""Tests costs and limits of the change of the controls, and messages about contacts that do not fit together."""

import pickle

import numpy as np
import pytest

import condyle
from condyle import ContactConstraint
from condyle.optimal import (
    ContactDynamics,
    ControlRate,
    Cost,
    Fddp,
    FreeDynamics,
    InteriorPoint,
    Lqr,
    Policy,
    Problem,
    ProblemError,
    Residual,
)

QUADRUPED = condyle.robots.quadruped()
STANDING = np.r_[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
ONE = np.ones((1, 1))


def stand(count: int, weight: float | None) -> tuple[Problem, np.ndarray]:
    """Returns the problem of a standing quadruped, and its efforts at rest. None leaves the robot without
    `ControlRate`."""
    contacts = {foot: ContactConstraint(foot, "point", None, "local_world_aligned", kd=50.0) for foot in FEET}
    state = Cost("state", 1.0, Residual.state(STANDING))
    knot = ContactDynamics(QUADRUPED, contacts, 0.02, [state, Cost("effort", 1e-3, Residual.control(np.zeros(12)))])
    end, still = FreeDynamics(QUADRUPED, None, [state]), knot.quasi_static(STANDING)
    if weight is None:
        return Problem(STANDING, [knot], [0] * count, end), still
    wide = [ControlRate(action, np.full(12, weight)) for action in (knot, end)]
    return Problem(np.r_[STANDING, still], [wide[0]], [0] * count, wide[1]), still


def test_a_linear_problem_has_the_solution_of_its_dense_form() -> None:
    """Solves x⁺ = x + u, ½ Σ x² + ½ w Σ (u − p)² as a dense problem in the controls too."""
    count, w, x0, p0 = 8, 3.0, 1.0, 0.2
    knot, end = Lqr(ONE, ONE, Q=ONE, R=0.0 * ONE), Lqr(ONE, np.zeros((1, 0)), Q=ONE)
    problem = Problem([x0, p0], [ControlRate(knot, [w])], [0] * count, ControlRate(end, [w]))
    plan = Fddp(problem, tolerance=1e-12).solve(np.zeros((count + 1, 2)), np.zeros((count, 1)))
    sums, changes = np.tri(count), np.eye(count) - np.eye(count, k=-1)
    hessian = sums.T @ sums + w * changes.T @ changes
    gradient = sums.T @ np.full(count, x0) - w * p0 * changes[0]
    np.testing.assert_allclose(plan.us[:, 0], np.linalg.solve(hessian, -gradient), atol=1e-10)
    np.testing.assert_array_equal(plan.xs[1:, 1], plan.us[:, 0])


def test_efforts_of_a_robot_change_less() -> None:
    count, changes = 12, []
    for weight in (0.0, 1e-2):
        problem, still = stand(count, weight)
        x0 = problem.x0.copy()
        x0[20] = 0.4  # m/s to the left
        problem.set_x0(x0)
        solver, policy = Fddp(problem), Policy(problem)
        plan = solver.solve(np.tile(x0, (count + 1, 1)), np.tile(still, (count, 1)))
        assert plan.status == "converged"
        changes.append((np.diff(np.vstack([still, plan.us]), axis=0) ** 2).sum())
        solver.publish(policy, 0.0)
        np.testing.assert_allclose(policy(0.0, x0), plan.us[0], atol=1e-9)
        problem.set_references("effort", np.tile(still, (count + 1, 1)))
        solver.shift(0)
        assert np.isfinite(solver.resume().us).all()
    assert changes[1] < 0.5 * changes[0]


def test_a_limit_of_the_change_is_kept() -> None:
    knot, end = Lqr(ONE, ONE, R=1e-6 * ONE), Lqr(ONE, np.zeros((1, 0)), Q=ONE, q=[-100.0])
    wide = ControlRate(knot, [0.0], lower=[-0.25], upper=[0.25])
    problem = Problem([0.0, 0.5], [wide], [0] * 5, ControlRate(end, [0.0]))
    plan = InteriorPoint(problem).solve(np.zeros((6, 2)), np.zeros((5, 1)))
    np.testing.assert_allclose(plan.us[:, 0], 0.5 + 0.25 * np.arange(1, 6), atol=1e-4)


def test_what_does_not_fit_is_refused() -> None:
    knot, end = Lqr(ONE, ONE), Lqr(ONE, np.zeros((1, 0)))
    with pytest.raises(ProblemError, match="`weights`: expected length 1, found 2"):
        Problem([0.0] * 3, [ControlRate(knot, [1.0, 1.0])], [0], ControlRate(end, [1.0, 1.0]))
    with pytest.raises(ProblemError, match="setting `weights` is -1, but it must be at least 0"):
        Problem([0.0] * 2, [ControlRate(knot, [-1.0])], [0], ControlRate(end, [1.0]))
    with pytest.raises(ValueError, match=r"upper: expected shape \(1,\), found \(2,\)"):
        ControlRate(knot, [1.0], upper=[1.0, 1.0])
    with pytest.raises(ProblemError):
        Problem([0.0] * 2, [ControlRate(knot, [1.0])], [0], end)
    with pytest.raises(ProblemError, match=r"models\[0\]: expected an action of a robot, which alone can be JSON"):
        Problem([0.0] * 2, [ControlRate(knot, [1.0])], [0], ControlRate(end, [1.0])).to_json()
    again = pickle.loads(pickle.dumps(ControlRate(knot, [1.0], upper=[2.0])))
    assert repr(again) == repr(ControlRate(knot, [1.0]))


def test_a_problem_in_json_or_a_pickle_is_the_same_problem() -> None:
    problem, still = stand(8, 1e-2)
    x0 = problem.x0.copy()
    x0[20] = 0.4  # m/s to the left
    problem.set_x0(x0)
    problem.set_weight("effort", 2e-3)  # changes the action inside
    guess = np.tile(x0, (9, 1)), np.tile(still, (8, 1))
    plan = Fddp(problem).solve(*guess)
    read = Problem.from_json(problem.to_json())
    assert read.to_json() == problem.to_json()
    for again in (read, pickle.loads(pickle.dumps(problem))):
        assert again.nx == 37 + 12
        other = Fddp(again).solve(*guess)
        np.testing.assert_array_equal(other.xs, plan.xs)
        np.testing.assert_array_equal(other.us, plan.us)
    heavy, _ = stand(8, 1e-1)
    assert heavy.to_json() != problem.to_json()


def contact(kind: str, frame: str = "LF_foot", **more: object) -> ContactConstraint:
    return ContactConstraint(frame, kind, None, "local_world_aligned", **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("contacts", "said"),
    [
        (("line", "plane"), "contact `b`: it is on body `LF_shank`, as contact `a`: together they are singular"),
        (("plane", "line"), "contact `b`: it is on body `LF_shank`, as contact `a`: together they are singular"),
        (("point", "line"), "contact `b`: it is on body `LF_shank`, as contact `a`: together they are singular"),
        (("plane", "rigid"), "contact `b`: it is on body `LF_shank`, as contact `a`: together they are singular"),
        (("line", "line"), "contact `b`: it holds frame `LF_foot` as contact `a` does already"),
    ],
)
def test_contacts_that_do_not_fit_together_are_named(contacts: tuple[str, str], said: str) -> None:
    a, b = (contact(kind) for kind in contacts)
    with pytest.raises(ProblemError, match=said):
        ContactDynamics(QUADRUPED, {"a": a, "b": b}, 0.02, [])
    if contacts != ("line", "line"):  # with damping, they share the force
        ContactDynamics(QUADRUPED, {"a": a, "b": b}, 0.02, [], damping=1e-6)


def test_axes_that_are_no_rotation_are_described() -> None:
    cases = {
        "its axes are left-handed: expected e₁ × e₂ = e₃, found −e₃": np.diag([1.0, 1.0, -1.0]),
        "its axes are not finite": np.full((3, 3), np.nan),
        "its axes are no unit vectors at right angles: the largest deviation is 3.0": 2.0 * np.eye(3),
    }
    for said, axes in cases.items():
        with pytest.raises(ProblemError, match=said):
            ContactDynamics(QUADRUPED, {"foot": contact("line", axes=axes)}, 0.02, [])
        with pytest.raises(condyle.ModelError, match=said):
            condyle.ConstraintSet(QUADRUPED, [contact("line", axes=axes)])
    with pytest.raises(ProblemError, match="setting `damping` is -1, but it must be at least 0"):
        ContactDynamics(QUADRUPED, {"foot": contact("point")}, 0.02, [], damping=-1.0)
