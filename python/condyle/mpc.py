"""Controllers at a rate: a plan that each tick renews from the measured state, and a policy that follows it.

`WholeBodyMpc` walks robots with legs:

>>> import condyle, numpy as np
>>> from condyle.mpc import Foot, Gait, WholeBodyMpc
>>> robot = condyle.robots.quadruped()
>>> feet = [Foot.point(f"{leg}_foot", friction=0.6, radius=0.0) for leg in ("LF", "RF", "LH", "RH")]
>>> mpc = WholeBodyMpc(robot, feet, Gait.trot(swing=0.24, double=0.04))
>>> x = np.r_[0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2, np.zeros(18)]
>>> mpc.reset(x)
>>> mpc.command(vx=0.3)
>>> policy = mpc.update(0.02, x)
>>> policy(0.021, x).shape, mpc.report.status
((12,), 'planned')

`ArmMpc` moves a frame of an arm along poses in time.
"""

from ._condyle import ArmMpc, Foot, Gait, JointPolicy, WholeBodyMpc
from ._mpc import ArmWeights, PlanLimits, Report, Weights

__all__ = [
    "ArmMpc",
    "ArmWeights",
    "Foot",
    "Gait",
    "JointPolicy",
    "PlanLimits",
    "Report",
    "Weights",
    "WholeBodyMpc",
]
