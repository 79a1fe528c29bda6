"""Whole-body control: finds the joint efforts with which a robot in contact fulfils given tasks.

At each tick one cone program finds accelerations, contact forces and efforts that best follow weighted tasks under the
full dynamics, with exact friction cones: see `WholeBodyController`.

>>> import condyle, numpy as np
>>> from condyle.wholebody import FrictionContact, Gains, Settings, Task, WholeBodyController
>>> robot = condyle.robots.humanoid()
>>> soles = [FrictionContact.sole(sole, 0.7, [0.2, 0.1]) for sole in ("left_sole", "right_sole")]
>>> tasks = [Task.com(gains=Gains.critical(30.0)), Task.orientation("pelvis"), Task.posture()]
>>> controller = WholeBodyController(robot, soles, tasks, Settings(contact_gains=Gains(0.0, 40.0)))
>>> q, v = condyle.neutral(robot), np.zeros(robot.nv)
>>> references = controller.hold(q)
>>> references.com.velocity[1] = 0.1  # m/s, to the left
>>> command = controller.step(q, v, references)
>>> command.status, command.tau.shape, command.forces.shape
('solved', (38,), (2, 6))

`plan_of` converts a solution of `condyle.optimal` to a `Plan`, which `WholeBodyController.track` follows.
"""

import numpy as np
from numpy.typing import ArrayLike

from ._condyle import ControllerError, FrictionContact, Model, Plan, Task, WholeBodyController
from ._types import Solution
from ._wholebody import (
    Command,
    ComTarget,
    ContactTarget,
    FrameTarget,
    Gains,
    JointLimits,
    KktResiduals,
    MomentumTarget,
    PostureTarget,
    Pyramid,
    References,
    Settings,
)
from .distances import DistanceLimits

__all__ = [
    "ComTarget",
    "Command",
    "ContactTarget",
    "ControllerError",
    "DistanceLimits",
    "FrameTarget",
    "FrictionContact",
    "Gains",
    "JointLimits",
    "KktResiduals",
    "MomentumTarget",
    "Plan",
    "PostureTarget",
    "Pyramid",
    "References",
    "Settings",
    "Task",
    "WholeBodyController",
    "plan_of",
]


def plan_of(model: Model, solution: Solution, times: ArrayLike, touches: ArrayLike, fade: float = 0.0) -> Plan:
    """Converts a solution of `condyle.optimal` to a plan.

    model: the robot.
    times: the times of the N + 1 knots (s). The two knots of an impact have the same time.
    touches: for each interval between two knots, which of the controller's contacts touch, (N, contacts).
    fade: the time (s) during which contacts are loaded and unloaded.

    Controls and gains are taken from knots that have one control for each actuated coordinate. Impacts have no
    controls.

    >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual
    >>> from condyle.wholebody import plan_of
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> rest = Cost("rest", 1.0, Residual.state(np.zeros(14)))
    >>> step = FreeDynamics(arm, 0.05, [rest])
    >>> problem = Problem(x0, [step], [0] * 10, FreeDynamics(arm, None, [rest]))
    >>> solution = Fddp(problem).solve(np.tile(x0, (11, 1)), np.tile(step.quasi_static(x0), (10, 1)))
    >>> plan = plan_of(arm, solution, 0.05 * np.arange(11), np.ones((10, 0)))  # an arm without contacts
    >>> np.array_equal(plan.feedback(0.0, x0[:7], x0[7:]), solution.us[0])  # on the plan, the plan's control
    True
    """
    nu = max((len(u) for u in solution.us), default=0)
    controls = [u if len(u) == nu else np.zeros(nu) for u in solution.us]
    gains = [K if len(K) == nu else np.zeros((nu, 2 * model.nv)) for K in solution.K]
    return Plan(model, times, solution.xs, touches, np.array(controls), np.array(gains), fade)
