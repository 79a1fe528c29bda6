"""Compares every residual, activation and integrator with Crocoddyl, by iterates on a short horizon."""

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest

import condyle.crocoddyl
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    ImpulseDynamics,
    Problem,
    Residual,
    WrenchCone,
)

# Tolerance of iterates after three iterations on a few knots.
# The condition number of the problem, about 1e4, amplifies rounding errors.
SAME = 1e-9

DT, KNOTS = 0.02, 4
RNG = np.random.default_rng(5)


class Robot:
    """Robot in Condyle and in Crocoddyl, with a bent posture, and with feet or a tool."""

    def __init__(self, name):
        if name == "arm7":
            self.ours = condyle.robots.arm7()
            self.theirs = pin.buildModelFromXML(condyle.robots.ARM7)
        else:
            text = {"quadruped": condyle.robots.QUADRUPED, "humanoid": condyle.robots.HUMANOID}[name]
            self.ours = condyle.Model.from_urdf_str(text, root_joint="free_flyer")
            self.theirs = pin.buildModelFromXML(text, pin.JointModelFreeFlyer())
        self.state = crocoddyl.StateMultibody(self.theirs)
        drives = crocoddyl.ActuationModelFull if name == "arm7" else crocoddyl.ActuationModelFloatingBase
        self.drives = drives(self.state)
        feet = {"quadruped": ["LF_foot", "RH_foot"], "humanoid": ["left_foot", "right_foot"], "arm7": ["tool"]}
        self.feet, self.rows, self.nu = feet[name], {"humanoid": 6}.get(name, 3), self.drives.nu
        q = pin.integrate(self.theirs, pin.neutral(self.theirs), 0.3 * RNG.uniform(-1.0, 1.0, self.theirs.nv))
        self.x0 = np.r_[q, 0.3 * RNG.uniform(-1.0, 1.0, self.theirs.nv)]
        self.goal = np.r_[pin.neutral(self.theirs), np.zeros(self.theirs.nv)]

    def frame(self, foot):
        return self.theirs.getFrameId(foot)

    def contacts(self, axes=pin.LOCAL_WORLD_ALIGNED):
        contacts, gains = crocoddyl.ContactModelMultiple(self.state, self.nu), np.array([5.0, 10.0])
        word = "local" if axes == pin.LOCAL else "local_world_aligned"
        ours = {}
        for foot in self.feet:
            if self.rows == 3:
                made = crocoddyl.ContactModel3D(self.state, self.frame(foot), np.zeros(3), axes, self.nu, gains)
            else:
                made = crocoddyl.ContactModel6D(self.state, self.frame(foot), pin.SE3.Identity(), axes, self.nu, gains)
            contacts.addContact(foot, made)
            kind = {3: "point", 6: "rigid"}[self.rows]
            ours[foot] = condyle.ContactConstraint(foot, kind, reference=word, kp=5.0, kd=10.0)
        return ours, contacts

    def impulses(self):
        impulses, kind = crocoddyl.ImpulseModelMultiple(self.state), {3: "point", 6: "rigid"}[self.rows]
        for foot in self.feet:
            made = {3: crocoddyl.ImpulseModel3D, 6: crocoddyl.ImpulseModel6D}[self.rows]
            impulses.addImpulse(foot, made(self.state, self.frame(foot), pin.LOCAL_WORLD_ALIGNED))
        return {f: condyle.ContactConstraint(f, kind, reference="local_world_aligned") for f in self.feet}, impulses


ROBOTS = {name: Robot(name) for name in ("quadruped", "humanoid")}
ARM = Robot("arm7")


def barrier(n, lower=-0.1, upper=0.2):
    bounds = crocoddyl.ActivationBounds(np.full(n, lower), np.full(n, upper))
    return crocoddyl.ActivationModelQuadraticBarrier(bounds), Activation.barrier(np.full(n, lower), np.full(n, upper))


def above(bounds):
    return crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(bounds.lb, bounds.ub))


def placement(axes=None, p=(0.1, 0.2, 0.3)):
    return pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5] if axes is None else axes)), np.array(p))


def state(r, nu):
    return crocoddyl.ResidualModelState(r.state, r.goal, nu), 1.0, Residual.state(r.goal), 2 * r.ours.nv


def com(r, nu):
    target = np.array([0.1, -0.1, 0.5])
    return crocoddyl.ResidualModelCoMPosition(r.state, target, nu), 1.0, Residual.center_of_mass(target), 3


def momentum(r, nu):
    target = np.linspace(-1.0, 1.0, 6)
    made = crocoddyl.ResidualModelCentroidalMomentum(r.state, target, nu)
    return made, 1.0, Residual.centroidal_momentum(target), 6


def rotation(r, nu):
    R, foot = placement().rotation, r.feet[0]
    made = crocoddyl.ResidualModelFrameRotation(r.state, r.frame(foot), R, nu)
    return made, 1.0, Residual.frame_rotation(r.ours, foot, R), 3


def pose(r, nu):
    foot = r.feet[0]
    made = crocoddyl.ResidualModelFramePlacement(r.state, r.frame(foot), placement(), nu)
    return made, 1.0, Residual.frame_placement(r.ours, foot, placement().homogeneous), 6


def translation(r, nu):
    foot, target = r.feet[0], np.array([0.1, 0.2, 0.3])
    made = crocoddyl.ResidualModelFrameTranslation(r.state, r.frame(foot), target, nu)
    return made, 1.0, Residual.frame_translation(r.ours, foot, target), 3


def velocity(axes, word):
    def make(r, nu):
        foot, target = r.feet[0], np.linspace(0.2, 0.4, 6)
        made = crocoddyl.ResidualModelFrameVelocity(r.state, r.frame(foot), pin.Motion(target), axes, nu)
        return made, 1.0, Residual.frame_velocity(r.ours, foot, target, word), 6

    return make


def control(r, nu):
    return crocoddyl.ResidualModelControl(r.state, np.ones(nu)), 1.0, Residual.control(np.ones(nu)), nu


def acceleration(r, nu):
    target = np.ones(r.ours.nv)
    made = crocoddyl.ResidualModelJointAcceleration(r.state, target, nu)
    return made, 1e-3, Residual.joint_acceleration(target), r.ours.nv


def gravity(r, nu):
    return crocoddyl.ResidualModelControlGrav(r.state, nu), 1.0, Residual.control_gravity(), r.ours.nv


def force(r, nu):
    foot, target = r.feet[1], np.linspace(1.0, 2.0, 6)
    target[r.rows :] = 0.0
    made = crocoddyl.ResidualModelContactForce(r.state, r.frame(foot), pin.Force(target), r.rows, nu, True)
    return made, 1e-3, Residual.contact_force(foot, target), r.rows


def friction(r, nu):
    foot, R = r.feet[1], placement([0.1, 0.2, 0.1]).rotation
    cone = crocoddyl.FrictionCone(R, 0.5, 6, True)
    made = crocoddyl.ResidualModelContactFrictionCone(r.state, r.frame(foot), cone, nu, True)
    ours = FrictionCone(0.5, 6, True, R)
    return made, 1e-3, Residual.friction_cone(foot, ours), 7


def wrench(r, nu):
    foot, R = r.feet[1], placement([0.1, 0.2, 0.1]).rotation
    cone = crocoddyl.WrenchCone(R, 0.5, np.array([0.2, 0.1]), 4, False)
    made = crocoddyl.ResidualModelContactWrenchCone(r.state, r.frame(foot), cone, nu, True)
    ours = WrenchCone(FrictionCone(0.5, rotation=R), [0.2, 0.1])
    return made, 1e-3, Residual.wrench_cone(foot, ours), 17


def pressure(r, nu):
    foot, R = r.feet[1], placement([0.1, 0.2, 0.1]).rotation
    made = crocoddyl.ResidualModelContactCoPPosition(
        r.state, r.frame(foot), crocoddyl.CoPSupport(R, np.array([0.2, 0.1])), nu, True
    )
    return made, 1e-3, Residual.center_of_pressure(foot, [0.2, 0.1], R), 4


def jump(r, nu):
    return crocoddyl.ResidualModelImpulseCoM(r.state), 1.0, Residual.impulse_center_of_mass(), 3


# The residual of velocity along the world's axes is not tested.
# Crocoddyl's Jacobian of this residual differs by 0.3 from finite differences of the velocity.
ANY = {
    "state": state,
    "com": com,
    "momentum": momentum,
    "rotation": rotation,
    "pose": pose,
    "translation": translation,
    "velocity": velocity(pin.LOCAL, "local"),
    "velocity in the world": velocity(pin.WORLD, "world"),
}
DRIVEN = ANY | {"control": control, "acceleration": acceleration}
FORCED = {"force": force, "friction": friction, "wrench": wrench, "pressure": pressure}
ACTIVATIONS = {
    "quadratic": lambda n: (crocoddyl.ActivationModelQuad(n), Activation.quadratic()),
    "weighted": lambda n: (
        crocoddyl.ActivationModelWeightedQuad(np.linspace(0.5, 2.0, n)),
        Activation.weighted(np.linspace(0.5, 2.0, n)),
    ),
    "barrier": barrier,
    "smooth1": lambda n: (crocoddyl.ActivationModelSmooth1Norm(n), Activation.smooth1()),
    "smooth2": lambda n: (crocoddyl.ActivationModelSmooth2Norm(n), Activation.smooth2()),
}


def costs(r, nu, make, activation):
    """Returns the same sum of costs for Condyle and for Crocoddyl: the given term, and small terms that keep the
    problem convex."""
    residual, weight, ours, n = make(r, nu)
    theirs_activation, ours_activation = ACTIVATIONS[activation](n)
    total = crocoddyl.CostModelSum(r.state, nu)
    total.addCost("term", crocoddyl.CostModelResidual(r.state, theirs_activation, residual), weight)
    rest = crocoddyl.CostModelResidual(r.state, crocoddyl.ResidualModelState(r.state, r.goal, nu))
    total.addCost("rest", rest, 1e-1)
    mine = [Cost("term", weight, ours, ours_activation), Cost("rest", 1e-1, Residual.state(r.goal))]
    if nu:
        effort = crocoddyl.CostModelResidual(r.state, crocoddyl.ResidualModelControl(r.state, nu))
        total.addCost("effort", effort, 1e-2)
        mine.append(Cost("effort", 1e-2, Residual.control(np.zeros(nu))))
    return mine, total


def same_iterates(r, ours, theirs):
    """Solves a horizon of one knot with Condyle and with Crocoddyl, and compares the first three iterations."""
    end = crocoddyl.CostModelSum(r.state, r.nu)
    end.addCost("rest", crocoddyl.CostModelResidual(r.state, crocoddyl.ResidualModelState(r.state, r.goal, r.nu)), 1.0)
    last = crocoddyl.IntegratedActionModelEuler(
        crocoddyl.DifferentialActionModelFreeFwdDynamics(r.state, r.drives, end), DT
    )
    shooting = crocoddyl.ShootingProblem(r.x0, [theirs] * KNOTS, last)
    xs, us = [r.x0] * (KNOTS + 1), [np.full(theirs.nu, 0.1)] * KNOTS
    solver = crocoddyl.SolverFDDP(shooting)
    solver.setCallbacks([log := crocoddyl.CallbackLogger()])
    solver.solve(xs, us, 3, False, 1e-9)
    terminal = FreeDynamics(r.ours, None, [Cost("rest", 1.0, Residual.state(r.goal))])
    problem = Problem(r.x0, [ours], [0] * KNOTS, terminal)
    solution = Fddp(problem, max_iterations=3).solve(np.array(xs), np.array(us))
    np.testing.assert_allclose([i.cost for i in solution.trace], np.array(log.costs), rtol=SAME)
    np.testing.assert_array_equal([i.step for i in solution.trace], np.array(log.steps))
    np.testing.assert_allclose(solution.xs, np.array(solver.xs), atol=1e-7)
    converted = condyle.crocoddyl.problem(shooting, bounded=False, strict=True)
    again = Fddp(converted, max_iterations=3).solve(np.array(xs), np.array(us))
    np.testing.assert_allclose([i.cost for i in again.trace], [i.cost for i in solution.trace], rtol=SAME)
    np.testing.assert_allclose(again.xs, solution.xs, atol=1e-7)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", DRIVEN | FORCED)
def test_residual_in_contact(robot, name):
    r = ROBOTS[robot]
    if r.rows == 3 and name in ("wrench", "pressure"):
        pytest.skip("needs soles")
    for axes in (pin.LOCAL, pin.LOCAL_WORLD_ALIGNED):
        mine, total = costs(r, r.nu, (DRIVEN | FORCED)[name], "quadratic")
        contacts, theirs = r.contacts(axes)
        dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(r.state, r.drives, theirs, total, 0.0, True)
        knot = crocoddyl.IntegratedActionModelEuler(dynamics, DT)
        same_iterates(r, ContactDynamics(r.ours, contacts, DT, mine), knot)


@pytest.mark.parametrize("activation", ACTIVATIONS)
@pytest.mark.parametrize("name", ["state", "translation", "velocity", "control"])
def test_activation(name, activation):
    r = ROBOTS["quadruped"]
    mine, total = costs(r, r.nu, DRIVEN[name], activation)
    dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(r.state, r.drives, total)
    same_iterates(r, FreeDynamics(r.ours, DT, mine), crocoddyl.IntegratedActionModelEuler(dynamics, DT))


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", ANY | {"jump": jump})
def test_residual_at_an_impact(robot, name):
    r = ROBOTS[robot]
    mine, total = costs(r, 0, (ANY | {"jump": jump})[name], "quadratic")
    contacts, theirs = r.impulses()
    knot = crocoddyl.ActionModelImpulseFwdDynamics(r.state, theirs, total, 0.3, 1e-9, True)
    same_iterates(r, ImpulseDynamics(r.ours, contacts, mine, restitution=0.3, damping=1e-9), knot)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_runge_kutta(order):
    kind = {2: crocoddyl.RKType.two, 3: crocoddyl.RKType.three, 4: crocoddyl.RKType.four}[order]
    for r in (ARM, ROBOTS["quadruped"]):
        mine, total = costs(r, r.nu, translation, "quadratic")
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(r.state, r.drives, total)
        ours = FreeDynamics(r.ours, DT, mine, integrator=f"runge_kutta_{order}")
        theirs = crocoddyl.IntegratedActionModelRK(dynamics, kind, DT)
        data, u = theirs.createData(), np.full(r.nu, 0.1)
        theirs.calc(data, r.x0, u)
        problem = Problem(r.x0, [ours], [0], FreeDynamics(r.ours, None, []))
        np.testing.assert_allclose(problem.rollout(u[None])[1], data.xnext, atol=1e-13)
        if r is ARM and order != 3:  # otherwise Crocoddyl's derivatives differ from finite differences by up to 6e-6
            same_iterates(r, ours, theirs)


def test_control_gravity():
    r = ROBOTS["quadruped"]
    mine, total = costs(r, r.nu, gravity, "quadratic")
    dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(r.state, r.drives, total)
    same_iterates(r, FreeDynamics(r.ours, DT, mine), crocoddyl.IntegratedActionModelEuler(dynamics, DT))


def partial_contacts(r, kind, axes):
    """Returns contacts of both feet that act along a line or in a plane, for Condyle and for Crocoddyl."""
    contacts, ours = crocoddyl.ContactModelMultiple(r.state, r.nu), {}
    word, R, x = "local" if axes == pin.LOCAL else "local_world_aligned", placement().rotation, 0.1
    for foot in r.feet:
        if kind == "line":
            gains, at = np.array([5.0, 10.0]), pin.SE3(np.eye(3), R @ [0.0, 0.0, x]).homogeneous
            made = crocoddyl.ContactModel1D(r.state, r.frame(foot), x, axes, R, r.nu, gains)
            constraint = condyle.ContactConstraint(foot, kind, None, word, *gains, at, axes=R.T)
        else:
            # kp is 0, because Crocoddyl always computes the position error along the world's axes.
            gains = np.array([0.0, 10.0])
            made = crocoddyl.ContactModel2D(r.state, r.frame(foot), np.zeros(2), r.nu, gains)
            constraint = condyle.ContactConstraint(foot, kind, kd=10.0)
        contacts.addContact(foot, made)
        ours[foot] = constraint
    return ours, contacts


def normal_force(r, nu):
    foot, target = r.feet[0], np.linspace(0.5, 1.0, 6)
    made = crocoddyl.ResidualModelContactForce(r.state, r.frame(foot), pin.Force(target), 1, nu, True)
    return made, 1e-3, Residual.contact_force(foot, target), 1


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(
    ("kind", "axes", "term"),
    [
        ("line", pin.LOCAL, normal_force),
        ("line", pin.LOCAL_WORLD_ALIGNED, normal_force),
        ("line", pin.LOCAL_WORLD_ALIGNED, acceleration),
        # friction, not normal_force: Crocoddyl's `ResidualModelContactForce` does not support contacts of kind "plane"
        ("plane", pin.LOCAL, friction),
        ("plane", pin.LOCAL, acceleration),
    ],
)
def test_contacts_along_axes(robot, kind, axes, term):
    r = ROBOTS[robot]
    mine, total = costs(r, r.nu, term, "quadratic")
    ours, theirs = partial_contacts(r, kind, axes)
    dynamics = crocoddyl.DifferentialActionModelContactFwdDynamics(r.state, r.drives, theirs, total, 0.0, True)
    knot = ContactDynamics(r.ours, ours, DT, mine)
    same_iterates(r, knot, crocoddyl.IntegratedActionModelEuler(dynamics, DT))
    # The controls u hold the robot at rest.
    x = np.r_[r.x0[: r.ours.nq], np.zeros(r.ours.nv)]
    np.testing.assert_allclose(knot.quasi_static(x), dynamics.quasiStatic(dynamics.createData(), x), atol=1e-7)


POLYNOMIALS = {
    "constant": lambda nu, kind: crocoddyl.ControlParametrizationModelPolyZero(nu),
    "linear": lambda nu, kind: crocoddyl.ControlParametrizationModelPolyOne(nu),
    "quadratic": crocoddyl.ControlParametrizationModelPolyTwoRK,
}
STAGES = {
    "semi_implicit_euler": None,
    "runge_kutta_2": crocoddyl.RKType.two,
    "runge_kutta_3": crocoddyl.RKType.three,
    "runge_kutta_4": crocoddyl.RKType.four,
}


@pytest.mark.parametrize("controls", POLYNOMIALS)
@pytest.mark.parametrize("integrator", STAGES)
@pytest.mark.parametrize("robot", ["arm7", "quadruped"])
def test_control_polynomial(robot, integrator, controls):
    r, kind = ARM if robot == "arm7" else ROBOTS[robot], STAGES[integrator]
    mine, total = costs(r, r.nu, translation, "quadratic")
    free = robot == "arm7"
    contacts, held = ({}, None) if free else r.contacts()
    dynamics = (
        crocoddyl.DifferentialActionModelFreeFwdDynamics(r.state, r.drives, total)
        if free
        else crocoddyl.DifferentialActionModelContactFwdDynamics(r.state, r.drives, held, total, 0.0, True)
    )
    # In Crocoddyl, controls that are quadratic in time need a Runge-Kutta integrator of three or four stages.
    # For other integrators, the test defines the quadratic polynomial at the time points of an integrator of four
    # stages.
    of = kind if kind == crocoddyl.RKType.three else crocoddyl.RKType.four
    polynomial = POLYNOMIALS[controls](r.nu, of)
    if kind is None:
        theirs = crocoddyl.IntegratedActionModelEuler(dynamics, polynomial, DT)
    else:
        theirs = crocoddyl.IntegratedActionModelRK(dynamics, polynomial, kind, DT)
    made = {"integrator": integrator, "controls": controls}
    ours = FreeDynamics(r.ours, DT, mine, **made) if free else ContactDynamics(r.ours, contacts, DT, mine, **made)
    data, w = theirs.createData(), RNG.uniform(-1.0, 1.0, theirs.nu)
    theirs.calc(data, r.x0, w)
    problem = Problem(r.x0, [ours], [0], FreeDynamics(r.ours, None, []))
    at = problem.evaluate(np.array([r.x0, data.xnext]), w[None])
    np.testing.assert_allclose(at.next_states[0], data.xnext, atol=1e-11)
    np.testing.assert_allclose(at.costs[0], data.cost, rtol=1e-11)
    x = np.r_[r.x0[: r.ours.nq], np.zeros(r.ours.nv)]
    np.testing.assert_allclose(ours.quasi_static(x), theirs.quasiStatic(theirs.createData(), x), atol=1e-7)
    if free and integrator != "runge_kutta_3":  # otherwise Crocoddyl's derivatives are inaccurate
        same_iterates(r, ours, theirs)
