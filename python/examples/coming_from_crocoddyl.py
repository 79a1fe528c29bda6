"""Coming from Crocoddyl: solves an existing problem of Crocoddyl with Condyle, and then writes the same problem in
Condyle.

    python python/examples/coming_from_crocoddyl.py

The example needs `pip install crocoddyl==3.2.1 pin==4.0.0`. Names of Crocoddyl, and names of Condyle (in
`condyle.optimal` unless another module is given):

    StateMultibody(model)                           the model: a state is x = (q, v), in the same order
    ActuationModelFull, FloatingBase                actuation=None: τ = S u, all joints except a free base
    ActuationModelFloatingBaseThrusters             actuation=thrusters(model, placements, torques)
    CostModelSum, addCost(name, cost, weight)       a list of Cost(name, weight, residual, activation)
    ResidualModelState, …Control, …CoMPosition      Residual.state, control, center_of_mass
    ResidualModelFramePlacement, …Translation       Residual.frame_placement, frame_translation
    ResidualModelContactForce, …FrictionCone        Residual.contact_force, friction_cone: by the contact's name
    ActivationModelWeightedQuad, QuadraticBarrier   Activation.weighted, barrier
    DifferentialActionModelFreeFwdDynamics          FreeDynamics(model, dt, costs)
    DifferentialActionModelContactFwdDynamics       ContactDynamics(model, contacts, dt, costs, damping)
    DifferentialActionModelFreeInvDynamics          FreeInverseDynamics(model, dt, costs), driven everywhere
    DifferentialActionModelContactInvDynamics       ContactInverseDynamics(model, contacts, dt, costs)
    ActionModelImpulseFwdDynamics                   ImpulseDynamics(model, contacts, costs, restitution, damping)
    IntegratedActionModelEuler(…, dt)               a knot has its dt; integrator="semi_implicit_euler"
    IntegratedActionModelRK(…, RKType.four, dt)     integrator="runge_kutta_4"
    ControlParametrizationModelPolyOne, PolyTwoRK   controls="linear", "quadratic"
    IntegratedActionModelEuler(…, 0.0) at the end   FreeDynamics(model, None, costs): without dt
    ContactModel6D, 3D, 2D, 1D                      condyle.ContactConstraint(frame, "rigid", "point", "plane", "line")
    gains [kp, kd]                                  kp=, kd=
    ConstraintModelResidual                         Limit(name, residual, lower, upper)
    DifferentialActionModelAbstract (your own)      DifferentialAction; ActionModelAbstract: Action
    ShootingProblem(x0, running, terminal)          Problem(x0, running, None, terminal)
    problem.quasiStatic(xs)                         problem.quasi_static(xs), of all N + 1 states
    SolverFDDP, SolverDDP, with Box or without      Fddp(problem, method="fddp" or "ddp"); bounds are the knots'
    SolverIntro                                     AugmentedLagrangian(problem)
    th_stop, maxiter, regInit                       tolerance=, max_iterations=, regularisation_start=
    setCallbacks([CallbackVerbose()])               solve(xs, us, verbose=True), solve(xs, us, callback=f)

Signs and axes: in Condyle, the feedback is u = ū + α k + K (x ⊖ x̄); in Crocoddyl, k and K have the opposite sign. In
both libraries, forces act on the robot, along the axes of the contact. Contacts in Crocoddyl's frame WORLD are
"local_world_aligned" in Condyle. Fddp enforces the bounds of a knot; SolverFDDP ignores bounds. Fddp moves a warm start
into the bounds unless project_warm_start=False; SolverBoxFDDP does not move the warm start. In the terminal knot, costs
of controls are zero in Crocoddyl and an error in Condyle. All other numbers have the same sign, order and unit.
"""

import time
from collections.abc import Callable

import crocoddyl
import numpy as np
import pinocchio

import condyle
import condyle.crocoddyl
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual

DT, HORIZON = 0.05, 40
GOAL, REST = np.array([0.35, 0.2, 0.6]), np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])
x0 = np.r_[REST, np.zeros(7)]

# 1. Problem in Crocoddyl: an arm reaches for a point.
robot = pinocchio.buildModelFromXML(condyle.robots.ARM7)
state = crocoddyl.StateMultibody(robot)
drives = crocoddyl.ActuationModelFull(state)
point = crocoddyl.ResidualModelFrameTranslation(state, robot.getFrameId("tool"), GOAL)
rest = crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelState(state, x0))
running, terminal = crocoddyl.CostModelSum(state), crocoddyl.CostModelSum(state)
running.addCost("rest", rest, 1e-2)
running.addCost("effort", crocoddyl.CostModelResidual(state, crocoddyl.ResidualModelControl(state)), 1e-4)
terminal.addCost("rest", rest, 1e-2)
terminal.addCost("reach", crocoddyl.CostModelResidual(state, point), 1e3)
knot, end = (
    crocoddyl.IntegratedActionModelEuler(crocoddyl.DifferentialActionModelFreeFwdDynamics(state, drives, costs), dt)
    for costs, dt in ((running, DT), (terminal, 0.0))
)
shooting_problem = crocoddyl.ShootingProblem(x0, [knot] * HORIZON, end)
shooting_problem.nthreads = 1
xs, us = [x0] * (HORIZON + 1), list(shooting_problem.quasiStatic([x0] * HORIZON))


def quickest(solve: Callable[[], object]) -> float:
    """Returns the shortest duration of several solves (ms)."""
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        solve()
        times.append(1e3 * (time.perf_counter() - begin))
    return min(times)


theirs = crocoddyl.SolverFDDP(shooting_problem)
took = quickest(lambda: theirs.solve(xs, us))
print(f"Crocoddyl: cost {theirs.cost:.9f} after {theirs.iter + 1} iterations, {took:.2f} ms")

# 2. The same problem is solved by Condyle in two lines. `bounded=False` ignores the effort limits, as SolverFDDP does.
problem = condyle.crocoddyl.problem(shooting_problem, bounded=False)
ours = Fddp(problem, tolerance=theirs.th_stop, project_warm_start=False).solve(np.array(xs), np.array(us))

solver = Fddp(problem, tolerance=theirs.th_stop, project_warm_start=False)
took = quickest(lambda: solver.solve(np.array(xs), np.array(us)))
print(f"Condyle:   cost {ours.cost:.9f} after {len(ours.trace)} iterations, {took:.2f} ms")
assert len(ours.trace) == theirs.iter + 1 and np.isclose(ours.cost, theirs.cost, rtol=1e-9)

# The gains have the opposite sign.
there = np.array([np.array(K) for K in theirs.K])
print(f"largest difference of states {np.abs(ours.xs - np.array(theirs.xs)).max():.0e},", end=" ")
print(f"of K and −K {np.abs(ours.K + there).max() / np.abs(there).max():.0e} of the largest gain")

# 3. The same problem, written in Condyle.
arm = condyle.robots.arm7()
settle = Cost("rest", 1e-2, Residual.state(x0))
running_knot = FreeDynamics(arm, DT, [settle, Cost("effort", 1e-4, Residual.control(np.zeros(7)))])
last = FreeDynamics(arm, None, [settle, Cost("reach", 1e3, Residual.frame_translation(arm, "tool", GOAL))])
written = Problem(x0, [running_knot], [0] * HORIZON, last)
again = Fddp(written, tolerance=theirs.th_stop).solve(np.array(xs), np.array(us))
print(f"written here: cost {again.cost:.9f} after {len(again.trace)} iterations")
assert np.allclose(again.xs, ours.xs, rtol=0.0, atol=1e-9)

# 4. Condyle's dynamics in Crocoddyl's solver, for scripts that keep Crocoddyl's solver or integrators.
dynamics = condyle.crocoddyl.differential_action(knot.differential)
mixed = crocoddyl.ShootingProblem(x0, [crocoddyl.IntegratedActionModelEuler(dynamics, DT)] * HORIZON, end)
on_ours = crocoddyl.SolverFDDP(mixed)
on_ours.solve(xs, us)
print(f"Crocoddyl's solver on our dynamics: cost {on_ours.cost:.9f} after {on_ours.iter + 1} iterations")
assert on_ours.iter == theirs.iter and np.isclose(on_ours.cost, theirs.cost, rtol=1e-9)
