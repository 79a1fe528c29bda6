"""Exact derivatives of the dynamics, in closed form, and derivatives of functions that use the dynamics.

    python python/examples/derivatives.py

A derivative with respect to q is taken in the tangent space, along velocities. Such a derivative has nv columns, even
if q has more numbers than v.
"""

import numpy as np

import condyle

robot = condyle.robots.quadruped()
data = condyle.Data(robot)
rng = np.random.default_rng(1)
q = condyle.random_configuration(robot, seed=1)
v, tau = rng.standard_normal((2, robot.nv))

# Forward dynamics q̈ = aba(q, v, τ) with its derivatives. ∂q̈/∂τ is M⁻¹.
d = condyle.aba_derivatives(robot, data, q, v, tau)
print("∂q̈/∂q, ∂q̈/∂v, ∂q̈/∂τ:", d.da_dq.shape, d.da_dv.shape, d.da_dtau.shape)

# The derivatives are exact: finite differences agree within the errors of differences. `integrate` moves q.
step, direction = 1e-6, rng.standard_normal(robot.nv)
ahead = condyle.aba(robot, data, condyle.integrate(robot, q, step * direction), v, tau)
behind = condyle.aba(robot, data, condyle.integrate(robot, q, -step * direction), v, tau)
print("differences are off by", abs((ahead - behind) / (2 * step) - d.da_dq @ direction).max())

# Second derivatives of the number λᵀ q̈, in four blocks. Solvers for optimal control need these derivatives.
hessian = condyle.aba_hessian(robot, data, q, v, tau, np.ones(robot.nv))
assert np.allclose(hessian.dqdq, hessian.dqdq.T)

# Derivatives of a function that you write: Condyle calls it with hyper-dual numbers.
arm = condyle.robots.arm7()
arm_data, at = condyle.Data(arm), np.full(7, 0.3)


def reach_and_effort(q: np.ndarray) -> np.ndarray:
    """Returns the squared distance of the tool from a point, plus a cost of gravity's torques."""
    tool = condyle.frame_placement(arm, arm_data, q, "tool")[:3, 3]
    return 100.0 * ((tool - [0.4, 0.2, 0.5]) ** 2).sum() + 0.01 * (condyle.gravity(arm, arm_data, q) ** 2).sum()


# With the exact Hessian, Newton's method needs few steps. With the Gauss-Newton matrix, the method would need more
# steps.
steps = 0
while True:
    value, gradient = condyle.gradient(arm, at, reach_and_effort)
    if np.abs(gradient).max() < 1e-9:
        break
    curvature, vectors = np.linalg.eigh(condyle.hessian(arm, at, reach_and_effort)[2])
    step = vectors @ (
        (vectors.T @ gradient) / np.maximum(np.abs(curvature), 1e-3)
    )  # a descent direction, even if the function is not convex
    length = 1.0
    while reach_and_effort(at - length * step) > value:
        length *= 0.5
    at, steps = at - length * step, steps + 1
print(f"the best compromise: {value:.4f}, after {steps} steps of Newton's method")
