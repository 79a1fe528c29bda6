#!/usr/bin/env python3
"""Writes ipopt.json beside this file: the optima of constrained problems, by CasADi 3.7.2 with IPOPT.

    pip install casadi==3.7.2 && python make_ipopt.py

The actions are those of ../common: the same dynamics and costs.
"""

import json
import pathlib

import casadi


def unicycle(x, u, dt=0.1):
    return x + dt * casadi.vertcat(u[0] * casadi.cos(x[2]), u[0] * casadi.sin(x[2]), u[1])


def cartpole(x, u, dt=0.03):
    m1, m2, length, g = 1.0, 0.1, 0.5, 9.81
    f, s, c, rate = u[0], casadi.sin(x[1]), casadi.cos(x[1]), x[3]
    mu = m1 + m2 * s * s
    cart = (f + m2 * c * s * g - m2 * length * s * rate**2) / mu
    pole = (c * f / length + (m1 + m2) * g * s / length - m2 * c * s * rate**2) / mu
    v = x[2:4] + dt * casadi.vertcat(cart, pole)
    return casadi.vertcat(x[0:2] + dt * v, v)


def solve(step, nu, x0, horizon, cost, end, constraints, end_constraints, guess):
    """Multiple shooting; constraints(x, u) and end_constraints(x) give lists of (lower, g, upper)."""
    opti = casadi.Opti()
    xs, us = opti.variable(len(x0), horizon + 1), opti.variable(nu, horizon)
    total = end(xs[:, horizon])
    opti.subject_to(xs[:, 0] == x0)
    rows = []
    for t in range(horizon):
        opti.subject_to(xs[:, t + 1] == step(xs[:, t], us[:, t]))
        total += cost(xs[:, t], us[:, t])
        rows += constraints(xs[:, t], us[:, t])
    rows += end_constraints(xs[:, horizon])
    for lower, g, upper in rows:
        opti.subject_to(g == lower if lower == upper else opti.bounded(lower, g, upper))
    opti.minimize(total)
    opti.set_initial(xs, casadi.DM(guess).T)
    options = {
        "tol": 1e-12,
        "constr_viol_tol": 1e-12,
        "acceptable_tol": 1e-11,
        "bound_relax_factor": 0,
        "print_level": 0,
    }
    opti.solver("ipopt", {"print_time": False}, options)
    found = opti.solve()
    states, controls = found.value(xs).T.tolist(), found.value(us).reshape(nu, horizon).T.tolist()
    return {"x0": x0, "horizon": horizon, "cost": found.value(total), "xs": states, "us": controls}


def park_on(start, n, disc, guess):
    square = casadi.sumsqr
    return solve(
        unicycle,
        2,
        start,
        n,
        lambda x, u: 0.5 * (100 * square(x) + square(u)),
        lambda x: 50 * square(x),
        lambda x, u: [
            (disc[2] ** 2, (x[0] - disc[0]) ** 2 + (x[1] - disc[1]) ** 2, casadi.inf),
            (-2, u[0], 2),
            (-1.5, u[1], 1.5),
        ],
        lambda x: [(0, x[0], 0), (0, x[1], 0), (0, x[2], 0)],
        guess,
    )  # fmt: skip


def main():
    def line(a, b, n):
        return [[p + (q - p) * t / n for p, q in zip(a, b, strict=True)] for t in range(n + 1)]

    # around a disc, with bounded speed and turning rate, to rest at the origin
    start, n = [-1.0, -1.0, 1.0], 40
    disc = [-0.55, -0.6, 0.2]

    def around(side):
        """A way that passes the disc on one side."""
        way = line(start, [0.0, 0.0, 0.0], n)
        return [[x - side * 4 * x * (1 + x) * 0.4, y + side * 4 * y * (1 + y) * 0.4, a] for x, y, a in way]

    ways = [park_on(start, n, disc, guess) for guess in (line(start, [0.0, 0.0, 0.0], n), around(1), around(-1))]
    park = min(ways, key=lambda found: found["cost"])

    # a lean is caught on a short track: bounds on the cart and its force, upright at rest at the end
    start, n = [0.0, 0.3, 0.0, 0.0], 60
    w, h = [0.01, 1.0, 0.01, 0.01, 0.09], 0.03
    catch = solve(
        cartpole,
        1,
        start,
        n,
        lambda x, u: 0.5 * h * (sum(w[i] * x[i] ** 2 for i in range(4)) + w[4] * u[0] ** 2),
        lambda x: 0.5 * (100 * x[0] ** 2 + 1e4 * x[1] ** 2 + 100 * x[2] ** 2 + 100 * x[3] ** 2),
        lambda x, u: [(-0.42, x[0], 0.3), (-11, u[0], 8)],
        lambda x: [(0, x[i], 0) for i in range(4)],
        line(start, [0.0] * 4, n),
    )
    out = {"casadi": casadi.__version__, "park": {**park, "disc": disc}, "catch": catch}
    pathlib.Path(__file__).with_name("ipopt.json").write_text(json.dumps(out) + "\n")
    print([found["cost"] for found in ways])
    print(park["cost"], catch["cost"], max(u[0] for u in park["us"]), max(x[0] for x in catch["xs"]), catch["us"][:3])


if __name__ == "__main__":
    main()
