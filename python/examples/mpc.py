"""Model predictive control: an arm follows a moving point while something pushes it.

    python python/examples/mpc.py

Every 10 ms the controller applies the first control of its plan, moves the horizon by one knot, and improves the last
plan by one iteration of FDDP. Between plans the controller corrects the controls with the solver's gains: u = ū + K (x
⊖ x̄).
"""

import numpy as np

import condyle
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual

DT, HORIZON, STEPS = 0.01, 30, 300

arm = condyle.robots.arm7()
data = condyle.Data(arm)
rest = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]  # a state: q, then v


def target(step: int) -> np.ndarray:
    """Returns the target of the tool, which moves once around a circle in 2.5 s."""
    angle = 2.0 * np.pi * step * DT / 2.5
    return np.array([0.45, 0.15 * np.cos(angle), 0.45 + 0.15 * np.sin(angle)])


def costs(step: int, controls: int) -> list[Cost]:
    """Returns the costs of the knot that is `step` steps after the beginning."""
    return [
        Cost("follow", 1e3, Residual.frame_translation(arm, "tool", target(step))),
        Cost("rest", 1e-1, Residual.state(rest)),
        Cost("effort", 1e-3, Residual.control(np.zeros(controls))),
    ]


# One action serves all knots. Each knot has its own costs; when the horizon is shifted, the costs move with the knot.
knot = FreeDynamics(arm, DT, [], costs_at={t: costs(t, 7) for t in range(HORIZON)})
end = FreeDynamics(arm, None, costs(HORIZON, 0))
problem = Problem(rest, [knot], [0] * HORIZON, end)

# The first plan is solved completely; then each step makes one iteration.
plan = Fddp(problem).solve(np.tile(rest, (HORIZON + 1, 1)), np.tile(knot.quasi_static(rest), (HORIZON, 1)))
print(f"the first plan: {plan.status} after {len(plan.trace)} iterations")
solver = Fddp(problem, max_iterations=1, tolerance=0.0)
plan = solver.solve(plan.xs, plan.us)

x, errors, milliseconds = rest.copy(), [], []
for step in range(STEPS):
    # the controller applies the plan's feed-forward and feedback
    off_plan = np.r_[condyle.difference(arm, plan.xs[0, :7], x[:7]), x[7:] - plan.xs[0, 7:]]
    u = plan.us[0] + plan.K[0] @ off_plan

    # the simulated arm moves; in one step, something hits its elbow
    v = x[7:] + DT * condyle.aba(arm, data, x[:7], x[7:], u)
    if step == STEPS // 2:
        v[3] += 1.0
    x = np.r_[condyle.integrate(arm, x[:7], DT * v), v]

    # the horizon moves by one knot, the last and the terminal knot get new targets, and one iteration improves the plan
    solver.shift(0)
    problem.set_costs(HORIZON - 1, costs(step + HORIZON, 7))
    problem.set_costs(HORIZON, costs(step + 1 + HORIZON, 0))
    problem.set_x0(x)
    plan = solver.resume()

    milliseconds.append(1e3 * plan.timings.total)
    tool = condyle.frame_placement(arm, data, x[:7], "tool")[:3, 3]
    errors.append(np.linalg.norm(tool - target(step + 1)))

before, after = 1e3 * max(errors[50 : STEPS // 2]), 1e3 * errors[-1]
print(f"an iteration took {np.median(milliseconds):.2f} ms, {np.max(milliseconds):.2f} ms at worst")
print(f"the tool was {before:.1f} mm off before the push at worst, {after:.1f} mm at the end")
assert errors[-1] < 0.02, "the tool has lost its target"
