"""Tests `condyle.crocoddyl`: Condyle solves Crocoddyl's problems, and Crocoddyl's solvers use Condyle's dynamics.
Iterates must be equal.

The problems are the same as in `test_problems.py`. `test_residuals.py` tests the conversion of all residuals,
activations and integrators.
"""

import subprocess
import sys
import warnings
from pathlib import Path

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest
from test_problems import CASES, FILES, FOLDER, PROBLEMS, ocp

import condyle.crocoddyl
from condyle.optimal import AugmentedLagrangian, Cost, Fddp, FreeDynamics, Limit, Problem, ProblemError, Residual

# isort: split
from ocp_converted import Converted
from ocp_robots import NotRunError
from ocp_theirs import Theirs

# Tolerance of sums whose terms are added in another order, relative to the largest number.
ROUNDING = 1e-11


class Loose(Converted):
    """Problem from test_problems.py in which some actions are Python classes derived from Crocoddyl's."""

    strict = False


@pytest.mark.parametrize(("name", "solver"), CASES)
def test_same_trace(name, solver):
    result = ocp.compare(*PROBLEMS[name](), solver, Converted)[0]
    assert result["good"], result


# First solver for each problem file.
# A file is skipped if a tiny perturbation changes all iterations of Crocoddyl.
FIRST = {name: (name, solver) for name, solver in reversed(FILES) if ocp.CHAOTIC.get((name, solver)) != 0}


@pytest.mark.filterwarnings("ignore:.* has no counterpart here")
@pytest.mark.parametrize(("name", "solver"), FIRST.values())
def test_same_trace_of_a_file(name, solver):
    try:
        result = ocp.compare(*ocp.load(FOLDER, name), solver, Loose)[0]
    except NotRunError as missing:
        pytest.skip(str(missing))
    assert result["good"], result


class OnOurs(Theirs):
    """Problem of Crocoddyl in which Crocoddyl's Euler steps call Condyle's dynamics."""

    def stage(self, stage):
        step = super().stage(stage)
        if not isinstance(step, crocoddyl.IntegratedActionModelEuler):
            return step
        dynamics = condyle.crocoddyl.differential_action(step.differential)
        self.kept.append(dynamics)
        made = crocoddyl.IntegratedActionModelEuler(dynamics, step.dt)
        if step.has_control_limits:
            made.u_lb, made.u_ub = step.u_lb, step.u_ub
        return made


@pytest.mark.parametrize(("name", "solver"), CASES)
def test_our_dynamics_in_their_solver(name, solver):
    spec, robot = PROBLEMS[name]()
    theirs, ours = Theirs(spec, robot, solver), OnOurs(spec, robot, solver)
    start = theirs.warm_start()
    for found, expected in zip(ours.warm_start()[1], start[1], strict=True):  # quasiStatic computes the controls
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * max(1.0, np.abs(expected).max(initial=0.0)))
    a, b = ours.solve(*start), theirs.solve(*start)
    assert ocp.agreeing(a.rows, b.rows) == len(a.rows) == len(b.rows)
    # The actions with Condyle's dynamics are converted back, which must give the original problem.
    again = condyle.crocoddyl.problem(ours.problem, strict=True)
    us = start[1] if len({len(u) for u in start[1]}) > 1 else np.array(start[1])
    first = condyle.crocoddyl.problem(theirs.problem, strict=True)
    xs = np.array(start[0])
    assert again.evaluate(xs, us).cost == first.evaluate(xs, us).cost


def arm():
    """Creates an arm in Crocoddyl. Returns its model, its state, its actuation model, and a function that creates a sum
    of costs."""
    model = pin.buildModelFromXML(condyle.robots.ARM7)
    state = crocoddyl.StateMultibody(model)

    def costs(**residuals):
        total = crocoddyl.CostModelSum(state, 7)
        for name, residual in residuals.items():
            total.addCost(name, crocoddyl.CostModelResidual(state, residual), 1.0)
        return total

    return model, state, crocoddyl.ActuationModelFull(state), costs


X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]


def shooting(state, drives, running, end, knots=5, constraints=None):
    more = [] if constraints is None else [constraints]
    dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, drives, running, *more)
    last = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, drives, end)
    step = crocoddyl.IntegratedActionModelEuler(dynamics, 0.05)
    return crocoddyl.ShootingProblem(X0, [step] * knots, crocoddyl.IntegratedActionModelEuler(last, 0.0))


def test_costs_of_controls_vanish_at_the_end():
    """Tests that residuals of controls, efforts or forces are zero at the terminal knot, as in Crocoddyl."""
    model = pin.buildModelFromXML(condyle.robots.HUMANOID, pin.JointModelFreeFlyer())
    state = crocoddyl.StateMultibody(model)
    drives, foot = crocoddyl.ActuationModelFloatingBase(state), model.getFrameId("left_sole")
    nu, contacts = drives.nu, crocoddyl.ContactModelMultiple(state, drives.nu)
    sole = crocoddyl.ContactModel6D(state, foot, pin.SE3.Identity(), pin.LOCAL, nu, np.zeros(2))
    contacts.addContact("sole", sole)
    cone = crocoddyl.FrictionCone(np.eye(3), 0.5, 4, False)
    wrench = crocoddyl.WrenchCone(np.eye(3), 0.5, np.array([0.2, 0.1]), 4, False)
    force = pin.Force(np.ones(6))
    residuals = [
        crocoddyl.ResidualModelControl(state, np.ones(nu)),
        crocoddyl.ResidualModelJointAcceleration(state, np.ones(state.nv), nu),
        crocoddyl.ResidualModelJointEffort(state, drives, np.zeros(nu), nu),
        crocoddyl.ResidualModelContactForce(state, foot, force, 6, nu, True),
        crocoddyl.ResidualModelContactFrictionCone(state, foot, cone, nu, True),
        crocoddyl.ResidualModelContactWrenchCone(state, foot, wrench, nu, True),
        crocoddyl.ResidualModelContactCoPPosition(
            state, foot, crocoddyl.CoPSupport(np.eye(3), np.array([0.2, 0.1])), nu, True
        ),
    ]
    u = np.linspace(-1.0, 2.0, nu)
    for residual in residuals:
        total = crocoddyl.CostModelSum(state, nu)
        total.addCost("term", crocoddyl.CostModelResidual(state, residual), 1.0)
        dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, drives, contacts, total, 0.0, True)
        end = crocoddyl.IntegratedActionModelEuler(dynamics, 0.0)
        data, x = end.createData(), state.integrate(state.zero(), np.full(state.ndx, 0.3))
        end.calc(data, x)
        problem = crocoddyl.ShootingProblem(x, [crocoddyl.IntegratedActionModelEuler(dynamics, 0.1)], end)
        ours = condyle.crocoddyl.problem(problem, strict=True).evaluate(np.array([x, x]), u[None])
        assert ours.costs[1] == data.cost == 0.0, residual
        problem.calc([x, x], [u])
        assert ours.costs[0] == pytest.approx(problem.runningDatas[0].cost, rel=1e-9) and ours.costs[0] > 0.0, residual
    # A terminal residual with a constant cost is not converted: Crocoddyl evaluates the action, with a warning.
    total = crocoddyl.CostModelSum(state, nu)
    effort = crocoddyl.ResidualModelJointEffort(state, drives, np.ones(nu), nu)
    total.addCost("term", crocoddyl.CostModelResidual(state, effort), 1.0)
    dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, drives, contacts, total, 0.0, True)
    step, end = (crocoddyl.IntegratedActionModelEuler(dynamics, dt) for dt in (0.1, 0.0))
    with pytest.warns(
        UserWarning, match=r"^ResidualModelJointEffort \(a constant cost at the end\) has no counterpart"
    ):
        problem = condyle.crocoddyl.problem(crocoddyl.ShootingProblem(x, [step], end))
    assert problem.evaluate(np.array([x, x]), u[None]).costs[1] == 0.5 * nu


def test_a_residual_that_means_something_else_stays_theirs():
    """Tests that Crocoddyl's residual of gravity in contact is not converted: Crocoddyl evaluates the action, with a
    warning. This residual omits the contact forces, although its documentation includes them."""
    model = pin.buildModelFromXML(condyle.robots.HUMANOID, pin.JointModelFreeFlyer())
    state = crocoddyl.StateMultibody(model)
    drives = crocoddyl.ActuationModelFloatingBase(state)
    contacts, total = crocoddyl.ContactModelMultiple(state, drives.nu), crocoddyl.CostModelSum(state, drives.nu)
    sole = crocoddyl.ContactModel3D(
        state, model.getFrameId("left_sole"), np.zeros(3), pin.LOCAL, drives.nu, np.zeros(2)
    )
    contacts.addContact("sole", sole)
    gravity = crocoddyl.ResidualModelContactControlGrav(state, drives.nu)
    total.addCost("gravity", crocoddyl.CostModelResidual(state, gravity), 1.0)
    dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(state, drives, contacts, total, 0.0, True)
    step = crocoddyl.IntegratedActionModelEuler(dynamics, 0.1)
    x, us = state.integrate(state.zero(), np.full(state.ndx, 0.3)), np.ones((1, drives.nu))
    theirs = crocoddyl.ShootingProblem(x, [step], step)
    with pytest.warns(UserWarning, match="^ResidualModelContactControlGrav of cost `gravity` has no counterpart here"):
        problem = condyle.crocoddyl.problem(theirs)
    assert problem.evaluate(np.array([x, x]), us).cost == pytest.approx(theirs.calc([x, x], list(us)), rel=1e-12)


def test_constraints_become_limits():
    _, state, drives, costs = arm()
    effort, rest = crocoddyl.ResidualModelControl(state, 7), crocoddyl.ResidualModelState(state, X0, 7)
    point = crocoddyl.ResidualModelFrameTranslation(
        state, state.pinocchio.getFrameId("tool"), np.array([0.4, 0.2, 0.5]), 7
    )
    held = crocoddyl.ConstraintModelManager(state, 7)
    weak = np.full(7, 0.5)
    held.addConstraint("weak", crocoddyl.ConstraintModelResidual(state, effort, -weak, weak))
    theirs = shooting(state, drives, costs(effort=effort, rest=rest), costs(point=point), constraints=held)
    with pytest.raises(
        ProblemError, match=r"^DifferentialActionModelFreeFwdDynamics \(with constraints\) has no counterp"
    ):
        condyle.crocoddyl.differential_action(theirs.runningModels[0].differential)
    converted = condyle.crocoddyl.problem(theirs, strict=True)
    robot, zero = condyle.robots.arm7(), np.zeros(7)
    terms = [Cost("effort", 1.0, Residual.control(zero)), Cost("rest", 1.0, Residual.state(X0))]
    knot = FreeDynamics(robot, 0.05, terms, limits=[Limit("weak", Residual.control(zero), -weak, weak)])
    end = FreeDynamics(robot, None, [Cost("point", 1.0, Residual.frame_translation(robot, "tool", [0.4, 0.2, 0.5]))])
    xs, us = np.tile(X0, (6, 1)), np.tile(knot.quasi_static(X0), (5, 1))
    a, b = (AugmentedLagrangian(p) for p in (converted, Problem(X0, [knot], [0] * 5, end)))
    found, expected = a.solve(xs, us), b.solve(xs, us)
    assert found.status == expected.status == "converged"
    np.testing.assert_allclose(found.us, expected.us, rtol=0, atol=1e-6)
    assert np.abs(found.us).max() == pytest.approx(0.5, abs=1e-3)


def test_lqr():
    model = crocoddyl.ActionModelLQR.Random(4, 2)
    theirs = crocoddyl.ShootingProblem(np.ones(4), [model] * 10, model)
    solver = crocoddyl.SolverFDDP(theirs)
    solver.solve([np.ones(4)] * 11, [np.zeros(2)] * 10, 10, False)
    converted = condyle.crocoddyl.problem(theirs, strict=True)
    found = Fddp(converted, project_warm_start=False).solve(np.ones((11, 4)), np.zeros((10, 2)))
    assert found.cost == pytest.approx(solver.cost, rel=1e-9)
    # Crocoddyl defines feedback gains with the opposite sign.
    np.testing.assert_allclose(found.K, -np.array([np.array(K) for K in solver.K]), atol=1e-8)


class ActivationModelQuad(crocoddyl.ActivationModelQuad):
    """User-defined activation Σ r². Its class has the same name as a class of Crocoddyl. The converter must not treat
    it as Crocoddyl's class."""

    def calc(self, data, r):
        data.a_value = float(r @ r)

    def calcDiff(self, data, r):
        data.Ar[:], data.Arr[:, :] = 2.0 * r, 2.0 * np.eye(len(r))


class Odd(crocoddyl.ActivationModelAbstract):
    """User-defined activation: Σ r⁴ / 4."""

    def __init__(self, n):
        crocoddyl.ActivationModelAbstract.__init__(self, n)

    def calc(self, data, r):
        data.a_value = float(np.sum(r**4)) / 4.0

    def calcDiff(self, data, r):
        data.Ar[:], data.Arr[:, :] = r**3, np.diag(3.0 * r**2)


def test_the_tutorial_runs(tmp_path):
    example = Path(__file__).parents[3] / "python" / "examples" / "coming_from_crocoddyl.py"
    run = subprocess.run([sys.executable, example], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert run.stdout.count("cost") == 4


def test_what_has_no_counterpart_is_named():
    _, state, drives, costs = arm()
    rest = crocoddyl.ResidualModelState(state, X0 + 0.1, 7)
    running, odd = costs(effort=crocoddyl.ResidualModelControl(state, 7)), Odd(14)
    running.addCost("odd", crocoddyl.CostModelResidual(state, odd, rest), 1.0)
    theirs = shooting(state, drives, running, costs(rest=rest))
    with pytest.raises(ProblemError, match=r"^test_converted\.Odd of cost `odd` has no counterpart here$"):
        condyle.crocoddyl.problem(theirs, strict=True)
    with pytest.raises(ProblemError, match=r"^test_converted\.Odd of cost `odd` has no counterpart here$"):
        condyle.crocoddyl.differential_action(theirs.runningModels[0].differential)
    with pytest.warns(
        UserWarning, match=r"^test_converted\.Odd of cost `odd` has no counterpart here: Crocoddyl"
    ) as seen:
        problem = condyle.crocoddyl.problem(theirs)
    assert len(seen) == 1 and seen[0].filename == __file__
    solver = crocoddyl.SolverFDDP(theirs)
    solver.setCallbacks([log := crocoddyl.CallbackLogger()])
    us = list(theirs.quasiStatic([X0] * 5))
    solver.solve([X0] * 6, us, 5, False)
    found = Fddp(problem, max_iterations=5, project_warm_start=False).solve(np.tile(X0, (6, 1)), np.array(us))
    n = min(len(found.trace), len(log.costs))
    np.testing.assert_allclose([i.cost for i in found.trace][:n], log.costs[:n], rtol=1e-9)
    with pytest.raises(ProblemError, match=r"^model: expected one of .*FreeFwdDynamics.*, found ActionModelUnicycle$"):
        condyle.crocoddyl.differential_action(crocoddyl.ActionModelUnicycle())


def test_a_robot_with_a_joint_that_is_not_here():
    model = pin.Model()
    model.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(1, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.4])))
    state = crocoddyl.StateMultibody(model)
    costs, x0 = crocoddyl.CostModelSum(state, 3), np.r_[0.2, 0.1, -0.3, np.zeros(3)]
    rest = crocoddyl.ResidualModelState(state, np.zeros(6), 3)
    costs.addCost("rest", crocoddyl.CostModelResidual(state, rest), 1.0)
    drives = crocoddyl.ActuationModelFull(state)
    step = crocoddyl.IntegratedActionModelEuler(
        crocoddyl.DifferentialActionModelFreeFwdDynamics(state, drives, costs), 0.05
    )
    theirs = crocoddyl.ShootingProblem(x0, [step] * 3, step)
    with pytest.raises(ProblemError, match="^JointModelSphericalZYX of joint `ball` has no counterpart here$"):
        condyle.crocoddyl.problem(theirs, strict=True)
    with pytest.warns(UserWarning, match="^JointModelSphericalZYX of joint `ball` has no counterpart here"):
        problem = condyle.crocoddyl.problem(theirs, bounded=False)
    us = np.ones((3, 3))
    np.testing.assert_allclose(problem.rollout(us), np.array(theirs.rollout(list(us))), rtol=0, atol=ROUNDING)


class Circle(crocoddyl.StateAbstract):
    """State space of a point on a circle: position (cos, sin) and angular rate."""

    def __init__(self):
        crocoddyl.StateAbstract.__init__(self, 3, 2)

    def zero(self):
        return np.array([1.0, 0.0, 0.0])

    def diff(self, x0, x1):
        return np.array([np.arctan2(x0[0] * x1[1] - x0[1] * x1[0], x0[:2] @ x1[:2]), x1[2] - x0[2]])

    def integrate(self, x, dx):
        c, s = np.cos(dx[0]), np.sin(dx[0])
        return np.array([x[0] * c - x[1] * s, x[0] * s + x[1] * c, x[2] + dx[1]])

    def Jdiff(self, x0, x1, which=crocoddyl.Jcomponent.both):
        return {"first": -np.eye(2), "second": np.eye(2)}.get(str(which), [-np.eye(2), np.eye(2)])

    def Jintegrate(self, x, dx, which=crocoddyl.Jcomponent.both):
        return np.eye(2) if str(which) in ("first", "second") else [np.eye(2), np.eye(2)]


class Turns(crocoddyl.ActionModelAbstract):
    """User-defined action on a manifold: a wheel rotates to the angle 2 rad."""

    def __init__(self):
        crocoddyl.ActionModelAbstract.__init__(self, Circle(), 1, 2)
        self.goal = np.array([np.cos(2.0), np.sin(2.0), 0.0])

    def calc(self, data, x, u=None):
        r = self.state.diff(self.goal, x)
        data.cost = 0.5 * float(r @ r)
        if u is not None:
            data.xnext[:] = self.state.integrate(x, np.array([0.1 * x[2], 0.1 * u[0]]))
            data.cost += 0.5e-2 * float(u @ u)

    def calcDiff(self, data, x, u=None):
        data.Lx[:], data.Lxx[:, :] = self.state.diff(self.goal, x), np.eye(2)
        if u is not None:
            data.Fx[:, :], data.Fu[:] = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([0.0, 0.1])
            data.Lu[:], data.Luu[:] = 1e-2 * u, 1e-2


def test_an_action_of_ones_own_on_a_manifold():
    model = Turns()
    x0, us = model.state.zero(), np.ones((20, 1))
    theirs = crocoddyl.ShootingProblem(x0, [model] * 20, model)
    solver = crocoddyl.SolverFDDP(theirs)
    solver.setCallbacks([log := crocoddyl.CallbackLogger()])
    solver.solve([x0] * 21, list(us), 20, False)
    with pytest.warns(UserWarning, match=r"^test_converted\.Turns has no counterpart here"):
        problem = condyle.crocoddyl.problem(theirs)
    settings = {"max_iterations": 20, "tolerance": solver.th_stop, "project_warm_start": False}
    found = Fddp(problem, **settings).solve(np.tile(x0, (21, 1)), us)
    np.testing.assert_allclose([i.cost for i in found.trace], log.costs[-len(found.trace) :], rtol=1e-9)
    np.testing.assert_allclose(found.xs, np.array(solver.xs), rtol=0, atol=1e-7)


def test_a_class_of_ones_own_is_not_taken_for_another():
    _, state, drives, costs = arm()
    running, rest = costs(), crocoddyl.ResidualModelState(state, X0, 7)
    twice = ActivationModelQuad(14)
    running.addCost("rest", crocoddyl.CostModelResidual(state, twice, rest), 1.0)
    theirs = shooting(state, drives, running, costs(rest=rest))
    with pytest.raises(
        ProblemError, match=r"^test_converted\.ActivationModelQuad of cost `rest` has no counterpart here$"
    ):
        condyle.crocoddyl.problem(theirs, strict=True)


def test_drives_of_any_kind():
    """Tests the conversion of actuation τ = S u with any constant S. Actuation that depends on the state is not
    converted."""
    _, state, _, costs = arm()

    class Springs(crocoddyl.ActuationModelAbstract):
        def __init__(self, stiffness):
            crocoddyl.ActuationModelAbstract.__init__(self, state, 7)
            self.stiffness = stiffness

        def calc(self, data, x, u):
            data.tau[:] = 2.0 * u - self.stiffness * x[:7]

        def calcDiff(self, data, x, u):
            data.dtau_du[:, :], data.dtau_dx[:, :7] = 2.0 * np.eye(7), -self.stiffness * np.eye(7)

    effort, rest = crocoddyl.ResidualModelControl(state, 7), crocoddyl.ResidualModelState(state, X0, 7)
    for stiffness in (0.0, 3.0):
        drives = Springs(stiffness)
        theirs = shooting(state, drives, costs(effort=effort, rest=rest), costs(rest=rest))
        with warnings.catch_warnings(record=True) as seen:
            warnings.simplefilter("always")
            problem = condyle.crocoddyl.problem(theirs)
        assert len(seen) == (stiffness > 0.0)
        if seen:
            assert "Springs (drives other than τ = S u with a constant S) has no counterpart" in str(seen[0].message)
        us = np.linspace(-1.0, 1.0, 35).reshape(5, 7)
        xs = np.tile(X0, (6, 1))
        value, cost = problem.evaluate(xs, us), theirs.calc(list(xs), list(us))
        expected = np.array([data.xnext for data in theirs.runningDatas])
        np.testing.assert_allclose(value.next_states, expected, rtol=0, atol=ROUNDING * np.abs(expected).max())
        np.testing.assert_allclose(value.cost, cost, rtol=ROUNDING)
