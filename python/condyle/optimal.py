"""Optimal control over a horizon: finds the motion of a robot with the lowest cost by FDDP (feasibility-driven DDP).

>>> import condyle, numpy as np
>>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual
>>> arm = condyle.robots.arm7()
>>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
>>> rest = Cost("rest", 1e-1, Residual.state(x0))
>>> running = FreeDynamics(arm, 0.05, [rest, Cost("effort", 1e-4, Residual.control(np.zeros(7)))])
>>> reach = Cost("reach", 1e3, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))
>>> terminal = FreeDynamics(arm, None, [rest, reach])
>>> problem = Problem(x0, [running], [0] * 20, terminal)
>>> solution = Fddp(problem).solve(np.tile(x0, (21, 1)), np.tile(running.quasi_static(x0), (20, 1)))
>>> solution.status, solution.xs.shape
('converged', (21, 14))

Hard constraints are `Limit`s, which `InteriorPoint` and `AugmentedLagrangian` enforce. A separate action for each knot
is as fast as one action for all knots: `Problem(x0, [action_0, action_1, ...], None, terminal)` groups the actions that
differ only in costs.

You can define your own actions by the next state and the cost (`Action`), by accelerations (`DifferentialAction`), by ẋ
(`ode_action`), or by CasADi expressions (`condyle.casadi.action`). You can also define residuals of a robot
(`Residual.own`) and constraints (`ConstrainedAction`). Derivatives that you do not provide are still exact if your
functions accept numbers that carry their derivatives. `ControlRate` adds a cost of the change of the controls from knot
to knot to an action of any kind.

`Sensitivity` differentiates a solution with respect to initial state, targets, weights, bounds and other parameters,
and `Sensitivities` many solutions.
`condyle.torch.ProblemLayer` and `condyle.jax.ProblemLayer` do so inside PyTorch and JAX.

The feedback is u = ū + α k + K (x ⊖ x̄); in Crocoddyl, k and K have the opposite sign. The iterates are the same as in
Crocoddyl.
"""

from ._actions import ode_action, thrusters
from ._condyle import (
    Action,
    Activation,
    AugmentedLagrangian,
    ConstrainedAction,
    ContactDynamics,
    ContactInverseDynamics,
    ControlRate,
    Cost,
    DifferentialAction,
    Fddp,
    FreeDynamics,
    FreeInverseDynamics,
    FrictionCone,
    ImpulseDynamics,
    InteriorPoint,
    Limit,
    Lqr,
    Policy,
    Problem,
    ProblemError,
    Record,
    Residual,
    Schedule,
    Sensitivities,
    Sensitivity,
    Sweep,
    Unicycle,
    WrenchCone,
    rollout_many,
)
from ._many import solve_many
from ._types import (
    BoundGradients,
    ConstraintRows,
    Difference,
    Evaluation,
    Iteration,
    LqKnot,
    ManyRollouts,
    Outcome,
    PlanPoint,
    RecordedTick,
    SensitivityReport,
    Solution,
    Sphere,
    SweepResult,
    Timings,
    Violation,
)

__all__ = [
    "Action",
    "Activation",
    "AugmentedLagrangian",
    "BoundGradients",
    "ConstrainedAction",
    "ConstraintRows",
    "ContactDynamics",
    "ContactInverseDynamics",
    "ControlRate",
    "Cost",
    "Difference",
    "DifferentialAction",
    "Evaluation",
    "Fddp",
    "FreeDynamics",
    "FreeInverseDynamics",
    "FrictionCone",
    "ImpulseDynamics",
    "InteriorPoint",
    "Iteration",
    "Limit",
    "LqKnot",
    "Lqr",
    "ManyRollouts",
    "Outcome",
    "PlanPoint",
    "Policy",
    "Problem",
    "ProblemError",
    "Record",
    "RecordedTick",
    "Residual",
    "Schedule",
    "Sensitivities",
    "Sensitivity",
    "SensitivityReport",
    "Solution",
    "Sphere",
    "Sweep",
    "SweepResult",
    "Timings",
    "Unicycle",
    "Violation",
    "WrenchCone",
    "ode_action",
    "rollout_many",
    "solve_many",
    "thrusters",
]
