"""Rigid-body dynamics with exact derivatives, for MPC and DDP.

A `Model` is a robot, frozen; a `Data` is one thread's scratch; an algorithm is a function of both:

>>> import condyle
>>> quadruped = condyle.robots.quadruped()
>>> data = condyle.Data(quadruped)
>>> q = condyle.neutral(quadruped)
>>> a = condyle.aba(quadruped, data, q, v=[0.0] * 18, tau=[0.0] * 18)
>>> round(float(a[2]), 6)  # it falls
-9.81

Numbers and layout are Pinocchio's: linear parts before angular ones, quaternions x, y, z, w, joints in the same order.
Functions return new arrays, or fill those given as `out`. Arguments may be anything that NumPy understands as an array
of real numbers; float64 C-contiguous arrays are read where they lie. A wrong shape is a `ValueError`.
"""

from . import optimal, robots
from ._condyle import (
    Data,
    Error,
    Model,
    ModelError,
    ParseError,
    __version__,
    aba,
    aba_derivatives,
    crba,
    difference,
    difference_jacobian,
    forward_kinematics,
    frame_jacobian,
    frame_placement,
    gravity,
    integrate,
    integrate_jacobian,
    minv,
    neutral,
    nonlinear_effects,
    random_configuration,
    rnea,
    rnea_derivatives,
)
from ._types import AbaDerivatives, Frame, Inertia, Limits, Mimic, RneaDerivatives

__all__ = [
    "AbaDerivatives",
    "Data",
    "Error",
    "Frame",
    "Inertia",
    "Limits",
    "Mimic",
    "Model",
    "ModelError",
    "ParseError",
    "RneaDerivatives",
    "__version__",
    "aba",
    "aba_derivatives",
    "crba",
    "difference",
    "difference_jacobian",
    "forward_kinematics",
    "frame_jacobian",
    "frame_placement",
    "gravity",
    "integrate",
    "integrate_jacobian",
    "minv",
    "neutral",
    "nonlinear_effects",
    "optimal",
    "random_configuration",
    "rnea",
    "rnea_derivatives",
    "robots",
]
