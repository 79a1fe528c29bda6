"""Compares FDDP's iterates with Crocoddyl's, iteration by iteration, for a panda that reaches for a point."""

import json
from pathlib import Path

import crocoddyl
import numpy as np
import pinocchio as pin
import pytest
from example_robot_data.robots_loader import ROBOTS

import condyle
from condyle.optimal import Activation, Cost, Fddp, FreeDynamics, Problem, Residual

# Tolerance of costs: a perturbation of 1e-12 changes Crocoddyl's own costs by up to 1e-6.
COST = 1e-6

SPEC = json.loads((Path(__file__).parent / "arm_panda.json").read_text())
URDF = ROBOTS[SPEC["robot"]]().df_path
TARGET = np.array(SPEC["target"])
X0 = np.r_[SPEC["q0"], np.zeros(len(SPEC["q0"]))]
NV = len(SPEC["q0"])
ONLY_VELOCITY = np.r_[np.zeros(NV), np.ones(NV)]


SOLVERS = {
    "fddp": crocoddyl.SolverFDDP,
    "ddp": crocoddyl.SolverDDP,
    "box fddp": crocoddyl.SolverBoxFDDP,
    "box ddp": crocoddyl.SolverBoxDDP,
}
# Bounds on efforts. The unbounded solution exceeds the lower and the upper bound.
# Efforts within the bounds can hold the arm at rest.
LOWER = np.array([-1.5, -22.0, -8.0, -5.0, -5.0, -5.0, -0.5, -0.5, -0.5])
UPPER = np.array([9.0, 7.5, 21.0, 22.0, 4.0, 2.5, 0.5, 0.5, 0.5])


def solve_theirs(xs, us, solver="fddp", **settings):
    """Returns Crocoddyl's solution and trace. The trace has the cost, step length, regularisation and feasibility of
    each iteration."""
    state = crocoddyl.StateMultibody(pin.buildModelFromUrdf(URDF))
    actuation = crocoddyl.ActuationModelFull(state)
    frame = state.pinocchio.getFrameId(SPEC["frame"])
    pose = crocoddyl.ResidualModelFramePlacement(state, frame, pin.SE3(TARGET))

    def model(dt, terms):
        costs = crocoddyl.CostModelSum(state)
        for name, weight, residual, activation in terms:
            activations = () if activation is None else (activation,)
            costs.addCost(name, crocoddyl.CostModelResidual(state, *activations, residual), weight)
        dynamics = crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)
        action = crocoddyl.IntegratedActionModelEuler(dynamics, dt)
        if solver.startswith("box"):
            action.u_lb, action.u_ub = LOWER, UPPER
        return action

    run, end = SPEC["running"], SPEC["terminal"]
    rest = crocoddyl.ResidualModelState(state, X0)
    effort = crocoddyl.ResidualModelControl(state)
    running = model(
        SPEC["dt"],
        [("pose", run["pose"], pose, None), ("state", run["state"], rest, None), ("u", run["control"], effort, None)],
    )
    weighted = crocoddyl.ActivationModelWeightedQuad(ONLY_VELOCITY)
    terminal = model(0.0, [("pose", end["pose"], pose, None), ("velocity", end["velocity"], rest, weighted)])
    solver = SOLVERS[solver](crocoddyl.ShootingProblem(X0, [running] * SPEC["knots"], terminal))
    solver.setCallbacks([log := crocoddyl.CallbackLogger()])
    maxiter = settings.get("max_iterations", 100)
    solver.solve(list(xs), list(us), maxiter, False, settings.get("regularisation_start", np.nan))
    return solver, log


def our_problem(bounded=False):
    model = condyle.Model.from_urdf(URDF)
    run, end = SPEC["running"], SPEC["terminal"]

    def pose(weight):
        return Cost("pose", weight, Residual.frame_placement(model, SPEC["frame"], TARGET))

    running = FreeDynamics(
        model,
        SPEC["dt"],
        [
            pose(run["pose"]),
            Cost("state", run["state"], Residual.state(X0)),
            Cost("u", run["control"], Residual.control(np.zeros(NV))),
        ],
        **({"lower": LOWER, "upper": UPPER} if bounded else {}),
    )
    velocity = Cost("velocity", end["velocity"], Residual.state(X0), Activation.weighted(ONLY_VELOCITY))
    terminal = FreeDynamics(model, None, [pose(end["pose"]), velocity])
    return running, Problem(X0, [running], [0] * SPEC["knots"], terminal)


def warm_start(kind):
    running, _ = our_problem()
    hold = running.quasi_static(X0)
    xs, us = np.tile(X0, (SPEC["knots"] + 1, 1)), np.tile(hold, (SPEC["knots"], 1))
    if kind == "gaps":  # no controls can produce these states
        xs[1:, 1] += np.linspace(0.0, 0.3, SPEC["knots"])
    if kind == "gap at the start":  # the guess of the first state differs from x0
        xs[:, 3] += 0.1
    return xs, us


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("kind", ["standing", "gaps", "gap at the start"])
def test_whole_trace(kind, solver):
    xs, us = warm_start(kind)
    _, problem = our_problem(solver.startswith("box"))
    ours = Fddp(problem, method=solver.split()[-1], project_warm_start=False).solve(xs, us)
    theirs, log = solve_theirs(xs, us, solver)
    if solver.startswith("box"):
        assert np.any(ours.us == UPPER) and np.any(ours.us == LOWER)
        assert np.all((ours.us >= LOWER) & (ours.us <= UPPER))
    assert ours.status == "converged" and len(ours.trace) == theirs.iter + 1
    np.testing.assert_allclose([i.cost for i in ours.trace], np.array(log.costs), rtol=COST)
    np.testing.assert_array_equal([i.step for i in ours.trace], np.array(log.steps))
    np.testing.assert_allclose([i.regularisation for i in ours.trace], np.array(log.pregs), rtol=1e-12)


def test_same_optimum_and_gains():
    xs, us = warm_start("standing")
    _, problem = our_problem()
    ours = Fddp(problem).solve(xs, us)
    theirs, _ = solve_theirs(xs, us)
    np.testing.assert_allclose(ours.cost, theirs.cost, rtol=1e-10)
    np.testing.assert_allclose(ours.xs, np.array(theirs.xs), atol=1e-6)
    np.testing.assert_allclose(ours.us, np.array(theirs.us), atol=1e-5)
    np.testing.assert_allclose(-ours.K[0], np.array(theirs.K[0]), rtol=1e-6, atol=1e-6)  # the signs differ


def test_one_iteration_is_the_same_to_rounding():
    xs, us = warm_start("standing")
    _, problem = our_problem()
    ours = Fddp(problem, max_iterations=1).solve(xs, us)
    theirs, _ = solve_theirs(xs, us, max_iterations=1)
    np.testing.assert_allclose(ours.cost, theirs.cost, rtol=1e-10)
    np.testing.assert_allclose(ours.xs, np.array(theirs.xs), atol=1e-9)
