"""Compares built-in actions and actuation models with Crocoddyl, and problems with a separate action for each knot, as
in Crocoddyl's example scripts."""

import crocoddyl
import numpy as np
import pinocchio
import pytest

import condyle
from condyle import optimal

# Tolerance of sums whose terms are added in another order.
ROUNDING = 1e-12
# Tolerance of the costs of iterates, the same as in benches/peers/ocp.py.
COST = 1e-6


@pytest.mark.parametrize(("dt", "weights"), [(0.1, (10.0, 1.0)), (0.05, (3.0, 0.5))])
def test_unicycle(dt, weights):
    model = crocoddyl.ActionModelUnicycle()
    model.dt, model.costWeights = dt, np.array(weights)
    knots, x0 = 20, np.array([-1.0, -1.0, 1.0])
    theirs = crocoddyl.SolverFDDP(crocoddyl.ShootingProblem(x0, [model] * knots, model))
    log = crocoddyl.CallbackLogger()
    theirs.setCallbacks([log])
    theirs.th_stop = 1e-9
    theirs.solve([x0] * (knots + 1), [np.zeros(2)] * knots, 100, False)
    ours, end = optimal.Unicycle(dt, weights), optimal.Unicycle(dt, weights, terminal=True)
    problem = optimal.Problem(x0, [ours] * knots, None, end)
    found = optimal.Fddp(problem, tolerance=1e-9).solve(np.tile(x0, (knots + 1, 1)), np.zeros((knots, 2)))
    assert found.status == "converged" and len(found.trace) == theirs.iter + 1
    np.testing.assert_allclose([i.cost for i in found.trace], log.costs[-len(found.trace) :], rtol=COST)
    np.testing.assert_allclose(found.xs, np.array(theirs.xs), rtol=0, atol=1e-6)


def test_thrusters():
    robot = pinocchio.buildSampleModelHumanoidRandom(True)
    state = crocoddyl.StateMultibody(robot)
    rng = np.random.default_rng(1)
    kinds = [crocoddyl.ThrusterType.CW, crocoddyl.ThrusterType.CCW, crocoddyl.ThrusterType.CW]
    placements = [pinocchio.SE3.Random() for _ in kinds]
    torques = rng.uniform(0.01, 0.1, len(kinds))
    each = [crocoddyl.Thruster(*given) for given in zip(placements, torques, kinds, strict=True)]
    actuation = crocoddyl.ActuationModelFloatingBaseThrusters(state, each)
    data = actuation.createData()
    actuation.calc(data, state.zero(), np.zeros(actuation.nu))
    actuation.calcDiff(data, state.zero(), np.zeros(actuation.nu))
    signs = [1.0 if kind == crocoddyl.ThrusterType.CW else -1.0 for kind in kinds]
    quadruped = condyle.robots.quadruped()
    S = optimal.thrusters(quadruped, [place.homogeneous for place in placements], signs * torques)
    np.testing.assert_allclose(S[:6, :3], data.dtau_du[:6, :3], rtol=0, atol=ROUNDING)
    np.testing.assert_array_equal(S[6:, 3:], np.eye(12))
    assert not S[6:, :3].any() and not S[:6, 3:].any()
