"""CasADi: an arm with weak motors swings up. IPOPT solves this problem of direct collocation with exact second
derivatives.

    python python/examples/casadi_swing_up.py        needs CasADi: pip install 'condyle[casadi]'

The shoulder cannot lift the arm, so the arm has to swing. Between two knots the motion is a cubic polynomial that
satisfies the equation of motion at both ends and in the middle (Hermite and Simpson). Variables are the position,
velocity and effort at the ends and in the middle. The equations of the polynomial are constraints.
"""

import casadi
import numpy as np

import condyle
import condyle.casadi

INTERVALS, DURATION = 40, 3.0
POINTS = 2 * INTERVALS + 1
EFFORT = np.array([8.0, 4.0])  # effort limits (N m); holding the arm level needs 15 and 5 N m


def two_links() -> condyle.Model:
    """Returns an arm of two links that hangs down at q = 0 and stands upright at q = (π, 0)."""
    link = condyle.Inertia.from_com(1.0, [0.0, 0.0, -0.5], 0.08 * np.diag([1.0, 1.0, 0.01]))
    elbow, hinge = np.eye(4), condyle.Joint.revolute([0.0, 1.0, 0.0])
    elbow[2, 3] = -1.0
    builder = condyle.ModelBuilder("two links")
    upper = builder.body("upper", condyle.WORLD, hinge, None, link)
    builder.body("lower", upper, hinge, elbow, link)
    return builder.build()


def transcribe(dynamics: casadi.Function) -> tuple[casadi.Opti, dict[str, casadi.MX]]:
    """Builds the optimisation of the motion. dynamics: a function (q, v, τ) -> a. Variables have a column for each
    point.
    """
    opti, h = casadi.Opti(), DURATION / INTERVALS
    q, v, tau = (opti.variable(2, POINTS) for _ in range(3))
    a = dynamics(q, v, tau)
    begin, middle, end = slice(0, -1, 2), slice(1, None, 2), slice(2, None, 2)
    for x, rate in ((q, v), (v, a)):
        opti.subject_to(x[:, end] - x[:, begin] == h / 6 * (rate[:, begin] + 4 * rate[:, middle] + rate[:, end]))
        mean = (x[:, begin] + x[:, end]) / 2
        opti.subject_to(x[:, middle] == mean + h / 8 * (rate[:, begin] - rate[:, end]))
    opti.subject_to(q[:, 0] == 0)
    opti.subject_to(v[:, 0] == 0)
    opti.subject_to(q[:, -1] == [np.pi, 0])
    opti.subject_to(v[:, -1] == 0)
    for k, limit in enumerate(EFFORT):
        opti.subject_to(opti.bounded(-limit, tau[k, :], limit))
    weights = np.ones(POINTS)  # Simpson's rule: 1, 4, 2, 4, …, 4, 1
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    opti.minimize(h / 6 * casadi.dot(casadi.repmat(casadi.DM(weights).T, 2, 1), tau**2))
    opti.set_initial(q[0, :], np.linspace(0, np.pi, POINTS))
    return opti, {"q": q, "v": v, "tau": tau}


def main() -> None:
    arm = two_links()
    opti, motion = transcribe(condyle.casadi.aba(arm, states=POINTS))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    solution = opti.solve()
    q, v, tau = (solution.value(motion[name]) for name in ("q", "v", "tau"))

    # Condyle's functions confirm the result: inverse dynamics of the accelerations gives the efforts of the solution
    data = condyle.Data(arm)
    lift = np.abs(condyle.gravity(arm, data, [np.pi / 2, 0.0]))
    print(f"the shoulder has {EFFORT[0]:.0f} N m, and {lift[0]:.1f} N m would hold the arm level")
    print(f"{solution.stats()['iter_count']} iterations; the elbow turns by {np.abs(q[1]).max():.1f} rad on the way")
    energy = condyle.mechanical_energy(arm, data, q.T, v.T)
    turns = int((np.diff(np.sign(v[0])) != 0).sum())
    print(f"it swings {turns} times to and fro, and its energy rises from {energy[0]:.1f} to {energy[-1]:.1f} J")
    assert np.all(np.abs(tau) <= EFFORT[:, None] + 1e-6)


if __name__ == "__main__":
    main()
