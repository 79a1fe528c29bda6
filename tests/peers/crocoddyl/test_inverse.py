"""Compares actions of inverse dynamics with Crocoddyl, with and without contacts: next states, costs, equations,
derivatives and optima."""

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest

import condyle.crocoddyl
from condyle.optimal import (
    Activation,
    AugmentedLagrangian,
    ContactDynamics,
    ContactInverseDynamics,
    Cost,
    FreeDynamics,
    FreeInverseDynamics,
    ImpulseDynamics,
    Problem,
    Residual,
)

# Tolerance of sums of several hundred products that are added in another order, relative to the largest number.
ROUNDING = 1e-11
# Tolerance of the optima of two solvers with different stopping tolerances.
OPTIMUM = 1e-5
DT = 0.02

WORDS = {pin.LOCAL: "local", pin.LOCAL_WORLD_ALIGNED: "local_world_aligned"}
TEXTS = {"arm7": condyle.robots.ARM7, "quadruped": condyle.robots.QUADRUPED, "humanoid": condyle.robots.HUMANOID}
# Number of rows of each contact, by name. Crocoddyl orders contacts alphabetically.
# Crocoddyl's inverse dynamics does not support contacts in a plane.
CONTACTS = {
    "arm7": {},
    "quadruped": {"LF_foot": 3, "RF_foot": 1, "RH_foot": 3},
    "humanoid": {"left_foot": 6, "right_foot": 6},
}
CASES = [("arm7", pin.LOCAL)] + [(name, axes) for name in ("quadruped", "humanoid") for axes in WORDS]
KP, KD = 5.0, 10.0


class Robot:
    """Robot in Condyle and in Crocoddyl, with actuation of some joints, contacts, and a state."""

    def __init__(self, name, axes=pin.LOCAL, kinds=None, seed=1):
        floating, text = name != "arm7", TEXTS[name]
        self.ours = condyle.Model.from_urdf_str(text, root_joint="free_flyer" if floating else None)
        self.theirs = pin.buildModelFromXML(text, *([pin.JointModelFreeFlyer()] if floating else []))
        self.state = crocoddyl.StateMultibody(self.theirs)
        drives = crocoddyl.ActuationModelFloatingBase if floating else crocoddyl.ActuationModelFull
        self.drives, self.axes = drives(self.state), axes
        self.kinds = CONTACTS[name] if kinds is None else kinds
        self.nv, self.driven, self.rows = self.theirs.nv, self.drives.nu, sum(self.kinds.values())
        rng = np.random.default_rng(seed)
        q = pin.integrate(self.theirs, pin.neutral(self.theirs), 0.4 * rng.uniform(-1.0, 1.0, self.nv))
        self.x = np.r_[q, 0.3 * rng.uniform(-1.0, 1.0, self.nv)]
        self.u = rng.uniform(-3.0, 3.0, self.nv + self.rows)

    def contacts(self, nu):
        """Returns the contacts for Condyle and for Crocoddyl."""
        ours, theirs = {}, crocoddyl.ContactModelMultiple(self.state, nu)
        for name, rows in self.kinds.items():
            frame, axes, gains = self.theirs.getFrameId(name), self.axes, np.array([KP, KD])
            if rows == 6:
                made = crocoddyl.ContactModel6D(self.state, frame, pin.SE3.Identity(), axes, nu, gains)
            elif rows == 3:
                made = crocoddyl.ContactModel3D(self.state, frame, np.zeros(3), axes, nu, gains)
            else:
                made = crocoddyl.ContactModel1D(self.state, frame, 0.0, axes, np.eye(3), nu, gains)
            theirs.addContact(name, made)
            kind = {1: "line", 3: "point", 6: "rigid"}[rows]
            ours[name] = condyle.ContactConstraint(name, kind, None, WORDS[axes], *gains)
        return ours, theirs

    def costs(self, nu):
        """Returns costs of the state, of accelerations, of efforts and of forces, for Condyle and for Crocoddyl."""
        state, nv, ours, theirs = self.state, self.nv, [], crocoddyl.CostModelSum(self.state, nu)

        def add(name, weight, residual, other, activation=None):
            ours.append(Cost(name, weight, residual, activation))
            theirs.addCost(name, crocoddyl.CostModelResidual(state, other), weight)

        rest, tau = np.r_[pin.neutral(self.theirs), np.zeros(nv)], np.linspace(-1.0, 1.0, self.driven)
        add("rest", 0.3, Residual.state(rest), crocoddyl.ResidualModelState(state, rest, nu))
        a = np.linspace(-1.0, 1.0, nv)
        add("smooth", 0.2, Residual.joint_acceleration(a), crocoddyl.ResidualModelJointAcceleration(state, a, nu))
        passive = nv - self.driven
        driven = Activation.weighted(np.repeat([0.0, 1.0], [passive, self.driven]))
        effort = crocoddyl.ResidualModelJointEffort(state, self.drives, tau, nu)
        add("effort", 1e-3, Residual.joint_effort(np.r_[np.zeros(passive), tau]), effort, driven)
        for name, rows in self.kinds.items():
            if rows < 3:
                continue  # Crocoddyl's residual lacks some components of the force
            force, frame = np.linspace(0.0, 5.0, 6), self.theirs.getFrameId(name)
            other = crocoddyl.ResidualModelContactForce(state, frame, pin.Force(force), rows, nu, False)
            add(f"{name} force", 1e-2, Residual.contact_force(name, force), other)
        return ours, theirs

    def dynamics(self):
        """Returns Crocoddyl's action of inverse dynamics, and a function that creates Condyle's action with additional
        costs."""
        nu = self.nv + self.rows
        (costs, total), (contacts, held) = self.costs(nu), self.contacts(nu)
        if self.kinds:
            theirs = crocoddyl.DifferentialActionModelContactInvDynamics(self.state, self.drives, held, total)
        else:
            theirs = crocoddyl.DifferentialActionModelFreeInvDynamics(self.state, self.drives, total)
        return theirs, lambda costs=costs: ContactInverseDynamics(self.ours, contacts, DT, costs)

    def node(self, action):
        """Returns the derivatives at a knot with the given action, and the evaluation of the problem."""
        problem = Problem(self.x, [action], [0], FreeDynamics(self.ours, None, []))
        xs, us = np.array([self.x, self.x]), self.u[None]
        return problem.derivatives(xs, us)[0], problem.evaluate(xs, us)


def close(found, expected, beside=0.0):
    """Checks equality up to rounding errors, relative to the largest number of the arrays and of `beside`. `beside`
    contains numbers that were subtracted in the computation."""
    largest = max(np.abs(expected).max(initial=1.0), np.abs(beside).max())
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * largest)


def gradient(node):
    return np.r_[node.q, node.r]


def hessian(node):
    return np.block([[node.Q, node.S], [node.S.T, node.R]])


@pytest.mark.parametrize(("name", "axes"), CASES)
def test_step_and_costs(name, axes):
    """Compares the next state, costs of all kinds, and their derivatives. Another test compares the equations."""
    robot = Robot(name, axes)
    dynamics, ours = robot.dynamics()
    step = crocoddyl.IntegratedActionModelEuler(dynamics, DT)
    data = step.createData()
    step.calc(data, robot.x, robot.u)
    step.calcDiff(data, robot.x, robot.u)
    (node, value), (bare, nothing) = robot.node(ours()), robot.node(ours([]))
    close(value.next_states[0], data.xnext)
    close(value.costs[0] - nothing.costs[0], data.cost, nothing.costs[0])
    close(node.A, data.Fx)
    close(node.B, data.Fu)
    close(gradient(node) - gradient(bare), np.r_[data.Lx, data.Lu], gradient(bare))
    theirs = np.block([[data.Lxx, data.Lxu], [data.Lxu.T, data.Luu]])
    close(hessian(node) - hessian(bare), theirs, hessian(bare))


@pytest.mark.parametrize(("name", "axes"), CASES)
def test_equations(name, axes):
    """Compares the equality constraints h = 0 and their derivatives Hx and Hu by state and controls, row by row. A cost
    ½ h² of one row has the gradient h ∂h and the Hessian ∂hᵀ ∂h."""
    robot = Robot(name, axes)
    dynamics, ours = robot.dynamics()
    data = dynamics.createData()
    dynamics.calc(data, robot.x, robot.u)
    dynamics.calcDiff(data, robot.x, robot.u)
    # Crocoddyl orders rows by the names of its constraints. Rows that set forces to zero belong to inactive contacts.
    first, residuals = 0, []
    names = [item.key() for item in dynamics.constraints.constraints]
    for key in (key for key in names if dynamics.constraints.getConstraintStatus(key)):
        if key == "tau":
            residuals += [(Residual.undriven_effort(), k, first + k) for k in range(robot.nv - robot.driven)]
        else:
            contact = key.removesuffix("_acc")
            rows = range(robot.kinds[contact])
            residuals += [(Residual.contact_acceleration(contact), k, first + k) for k in rows]
        first = residuals[-1][2] + 1 if residuals else 0
    assert len(residuals) == dynamics.nh == robot.rows + robot.nv - robot.driven
    bare, nothing = robot.node(ours([]))
    for residual, k, row in residuals:
        n = 1 + max(other for same, other, _ in residuals if same == residual)
        only = Activation.weighted(np.eye(n)[k])
        node, value = robot.node(ours([Cost("row", 1.0 / DT, residual, only)]))
        h, H = data.h[row], np.r_[data.Hx[row], data.Hu[row]]
        assert np.abs(h) > 1e-3  # if h were smaller, the gradient would be too small for a comparison
        close(value.costs[0] - nothing.costs[0], 0.5 * h * h, nothing.costs[0])
        close(gradient(node) - gradient(bare), h * H, gradient(bare))
        close(hessian(node) - hessian(bare), np.outer(H, H), hessian(bare))


@pytest.mark.parametrize("name", ["arm7", "quadruped", "humanoid"])
def test_quasi_static(name):
    """Compares the controls that hold a robot at rest, for all actions that can compute such controls."""
    kinds = {name: rows for name, rows in CONTACTS[name].items() if rows > 2}
    robot = Robot(name, kinds=kinds)
    x, state, drives = np.r_[robot.x[: robot.ours.nq], np.zeros(robot.nv)], robot.state, robot.drives
    free, nothing = crocoddyl.CostModelSum(state, robot.driven), crocoddyl.CostModelSum(state, robot.nv)

    def same(ours, theirs):
        found, expected = ours.quasi_static(x), theirs.quasiStatic(theirs.createData(), x)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max(initial=0.0)))

    same(FreeDynamics(robot.ours, DT, []), crocoddyl.DifferentialActionModelFreeFwdDynamics(state, drives, free))
    backwards = crocoddyl.DifferentialActionModelFreeInvDynamics(state, drives, nothing)
    same(FreeInverseDynamics(robot.ours, DT, []), backwards)
    same(ContactInverseDynamics(robot.ours, {}, DT, []), backwards)
    if not kinds:
        return
    contacts, held = robot.contacts(robot.driven)
    forwards = crocoddyl.DifferentialActionModelContactFwdDynamics(state, drives, held, free, 0.0, True)
    same(ContactDynamics(robot.ours, contacts, DT, []), forwards)
    dynamics, ours = robot.dynamics()
    same(ours([]), dynamics)
    same(ours([]), crocoddyl.IntegratedActionModelEuler(dynamics, DT))
    impulses, kind = crocoddyl.ImpulseModelMultiple(state), {3: "point", 6: "rigid"}
    for foot, rows in kinds.items():
        made = {3: crocoddyl.ImpulseModel3D, 6: crocoddyl.ImpulseModel6D}[rows]
        impulses.addImpulse(foot, made(state, robot.theirs.getFrameId(foot), pin.LOCAL))
    landing = crocoddyl.ActionModelImpulseFwdDynamics(state, impulses, crocoddyl.CostModelSum(state, 0))
    touch = {foot: condyle.ContactConstraint(foot, kind[rows]) for foot, rows in kinds.items()}
    assert not ImpulseDynamics(robot.ours, touch, []).quasi_static(x).size
    assert not landing.quasiStatic(landing.createData(), x).size


def test_quasi_static_of_steps_and_other_actions():
    """Tests Runge-Kutta steps with controls that are polynomials in time, the unicycle, and linear dynamics."""
    robot, kinds = Robot("arm7"), crocoddyl.RKType.four
    x = np.r_[robot.x[:7], np.zeros(7)]
    dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(
        robot.state, robot.drives, crocoddyl.CostModelSum(robot.state, 7)
    )
    for controls, made in (
        ("constant", crocoddyl.ControlParametrizationModelPolyZero(7)),
        ("linear", crocoddyl.ControlParametrizationModelPolyOne(7)),
        ("quadratic", crocoddyl.ControlParametrizationModelPolyTwoRK(7, kinds)),
    ):
        theirs = crocoddyl.IntegratedActionModelRK(dynamics, made, kinds, DT)
        ours = FreeDynamics(robot.ours, DT, [], integrator="runge_kutta_4", controls=controls)
        close(ours.quasi_static(x), theirs.quasiStatic(theirs.createData(), x))
    for model in (crocoddyl.ActionModelUnicycle(), crocoddyl.ActionModelLQR.Random(4, 2)):
        x = np.linspace(0.3, 0.6, model.state.nx)
        expected = model.quasiStatic(model.createData(), x)
        problem = condyle.crocoddyl.problem(crocoddyl.ShootingProblem(x, [model], model), strict=True)
        np.testing.assert_allclose(problem.quasi_static([x, x])[0], expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("name", "knots"), [("quadruped", 10), ("arm7", 10)])
def test_optimum(name, knots):
    """Compares a motion of a robot on standing feet, and a motion of an arm. Crocoddyl uses its solver with equality
    constraints, and Condyle uses its augmented Lagrangian."""
    stands = dict.fromkeys(CONTACTS[name], 3)
    robot = Robot(name, pin.LOCAL_WORLD_ALIGNED, stands)
    dynamics, ours = robot.dynamics()
    x0 = np.r_[pin.integrate(robot.theirs, robot.x[: robot.ours.nq], np.zeros(robot.nv)), np.zeros(robot.nv)]
    end, goal = crocoddyl.CostModelSum(robot.state, robot.nv), np.r_[pin.neutral(robot.theirs), np.zeros(robot.nv)]
    there = crocoddyl.ResidualModelState(robot.state, goal, robot.nv)
    end.addCost("there", crocoddyl.CostModelResidual(robot.state, there), 10.0)
    last = crocoddyl.DifferentialActionModelFreeInvDynamics(robot.state, robot.drives, end)
    running = crocoddyl.IntegratedActionModelEuler(dynamics, DT)
    shooting = crocoddyl.ShootingProblem(x0, [running] * knots, crocoddyl.IntegratedActionModelEuler(last, 0.0))
    theirs = crocoddyl.SolverIntro(shooting)
    theirs.th_stop = 1e-12
    us = list(shooting.quasiStatic([x0] * knots))
    assert theirs.solve([x0] * (knots + 1), us, 200, False)
    last = FreeDynamics(robot.ours, None, [Cost("there", 10.0, Residual.state(goal))])
    problem = Problem(x0, [ours()], [0] * knots, last)
    solver = AugmentedLagrangian(problem, tolerance=1e-8, tolerance_dual=1e-6)
    found = solver.solve(np.tile(x0, (knots + 1, 1)), problem.quasi_static(np.tile(x0, (knots + 1, 1))))
    assert found.status == "converged"
    np.testing.assert_allclose(solver.outcome.cost, theirs.cost, rtol=OPTIMUM)
    converted = condyle.crocoddyl.problem(shooting, strict=True)
    for one, other in zip(
        converted.derivatives(found.xs, found.us), problem.derivatives(found.xs, found.us), strict=True
    ):
        for a, b in zip(one[:8], other[:8], strict=True):
            close(a, b)
    np.testing.assert_allclose(found.xs, np.array(theirs.xs), rtol=0, atol=1e-3)
