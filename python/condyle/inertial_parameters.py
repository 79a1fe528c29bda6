"""The ten inertial parameters of a body: a check that the parameters are physical, and a parametrisation in which all
values are physical.

π = (m, m c_x, m c_y, m c_z, I_xx, I_xy, I_yy, I_xz, I_yz, I_zz), in the body's frame, about the origin of this frame.
Pinocchio and `Model.inertial_parameters` have the same order.

>>> import condyle, numpy as np
>>> from condyle import inertial_parameters
>>> theta = inertial_parameters.log_cholesky(condyle.robots.arm7().inertias[3])
>>> theta += 0.1 * np.random.default_rng(0).standard_normal(10)  # whatever is added, it stays a body
>>> inertial_parameters.check(inertial_parameters.from_log_cholesky(theta))
"""

from ._condyle import (
    NotPhysicalError,
    check,
    from_inertia,
    from_log_cholesky,
    log_cholesky,
    log_cholesky_jacobian,
    pseudo_inertia,
    to_inertia,
)

__all__ = [
    "NotPhysicalError",
    "check",
    "from_inertia",
    "from_log_cholesky",
    "log_cholesky",
    "log_cholesky_jacobian",
    "pseudo_inertia",
    "to_inertia",
]
