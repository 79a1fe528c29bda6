"""CasADi: an arm reaches for a point as fast as its motors, joints and speeds allow.

    python python/examples/casadi_reach.py        needs CasADi: pip install 'condyle[casadi]'

The duration is also a variable of the optimisation. Accelerations are the controls, and inverse dynamics computes the
efforts. Inverse dynamics is cheaper than forward dynamics and needs no M⁻¹. Limits of efforts become constraints on the
result of `rnea`.
"""

import casadi
import numpy as np

import condyle
import condyle.casadi

KNOTS = 25


def transcribe(
    model: condyle.Model,
    inverse_dynamics: casadi.Function,
    placement: casadi.Function,
    start: np.ndarray,
    target: np.ndarray,
) -> tuple[casadi.Opti, dict[str, casadi.MX]]:
    """Builds the optimisation of a motion that starts at rest at `start` and ends at rest with a frame at `target`.

    inverse_dynamics: a function (q, v, a) -> τ of all knots. placement: a function of q whose first result is the
    position of the frame.
    """
    n, limits, opti = model.nv, model.limits, casadi.Opti()
    q, v, a = opti.variable(n, KNOTS), opti.variable(n, KNOTS), opti.variable(n, KNOTS)
    duration = opti.variable()
    h = duration / (KNOTS - 1)
    for x, rate in ((q, v), (v, a)):  # the trapezoidal rule for positions and velocities
        opti.subject_to(x[:, 1:] == x[:, :-1] + h / 2 * (rate[:, 1:] + rate[:, :-1]))
    tau = inverse_dynamics(q, v, a)
    for x, lower, upper in (
        (q, limits.lower, limits.upper),
        (v, -limits.velocity, limits.velocity),
        (tau, -limits.effort, limits.effort),
    ):
        for k in range(n):
            if np.isfinite(lower[k]) and np.isfinite(upper[k]):
                opti.subject_to(opti.bounded(lower[k], x[k, :], upper[k]))
    opti.subject_to(q[:, 0] == start)
    opti.subject_to(casadi.horzcat(v[:, 0], v[:, -1]) == 0)
    opti.subject_to(placement(q[:, -1])[0] == target)
    opti.subject_to(opti.bounded(0.1, duration, 5.0))
    # minimise the duration; the small second term prefers smooth motions
    opti.minimize(duration + 1e-4 * h * casadi.sumsqr(a))
    opti.set_initial(q, np.tile(start[:, None], KNOTS))
    opti.set_initial(duration, 1.0)
    return opti, {"q": q, "v": v, "a": a, "tau": tau, "duration": duration}


def main() -> None:
    arm, target = condyle.robots.arm7(), np.array([0.45, -0.3, 0.35])
    start = np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0])
    inverse_dynamics = condyle.casadi.rnea(arm, states=KNOTS)
    tool = condyle.casadi.forward_kinematics(arm, "tool")
    opti, motion = transcribe(arm, inverse_dynamics, tool, start, target)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    solution = opti.solve()

    found = {name: solution.value(x) for name, x in motion.items()}
    reached = condyle.frame_placement(arm, condyle.Data(arm), found["q"][:, -1], "tool")[:3, 3]
    print(f"{solution.stats()['iter_count']} iterations; {found['duration']:.3f} s to {reached.round(6)}")
    for name, limit in (("v", arm.limits.velocity), ("tau", arm.limits.effort)):
        used = (np.abs(found[name]) / limit[:, None]).max(axis=1)
        print(f"{name}: {', '.join(f'{100 * part:.0f} %' for part in used)} of the limits")
    assert np.abs(reached - target).max() < 1e-6


if __name__ == "__main__":
    main()
