"""Optimal control over a horizon: a robot's motion that costs least, by FDDP.

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

What must hold exactly is a `Limit`, for `AugmentedLagrangian`: see there.

The feedback is u = ū + α k + K (x ⊖ x̄); Crocoddyl has the opposite sign of k and K. The iterates are Crocoddyl's.
"""

from ._condyle import (
    Action,
    Activation,
    AugmentedLagrangian,
    ConstrainedAction,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    ImpulseDynamics,
    InverseDynamics,
    Limit,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    WrenchCone,
)
from ._types import Iteration, Outcome, Solution, Timings

__all__ = [
    "Action",
    "Activation",
    "AugmentedLagrangian",
    "ConstrainedAction",
    "ContactDynamics",
    "Cost",
    "Fddp",
    "FreeDynamics",
    "FrictionCone",
    "ImpulseDynamics",
    "InverseDynamics",
    "Iteration",
    "Limit",
    "Lqr",
    "Outcome",
    "Problem",
    "ProblemError",
    "Residual",
    "Solution",
    "Timings",
    "WrenchCone",
]
