#!/usr/bin/env python3
"""Writes ipopt.json next to this file: the optima of constrained problems, by CasADi 3.7.2 with IPOPT.

pip install casadi==3.7.2 && python make_ipopt.py

The actions have the same dynamics and costs as in ../common.
"""

import json
import pathlib
import xml.etree.ElementTree

import casadi

ARM = pathlib.Path(__file__).parents[3] / "model/models/arm7.urdf"


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
    """Solves a problem by multiple shooting.

    The functions constraints(x, u) and end_constraints(x) return lists of tuples (lower, g, upper)."""
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


def rotation(axis, angle):
    """Returns the rotation matrix by Rodrigues' formula."""
    K, E = casadi.skew(axis), casadi.DM.eye(3)
    return E + casadi.sin(angle) * K + (1 - casadi.cos(angle)) * K @ K


class Arm:
    """Chain of revolute joints from a URDF; Newton–Euler equations with classical accelerations in the world's axes."""

    def __init__(self, path, tip):
        root = xml.etree.ElementTree.parse(path).getroot()
        links = {link.get("name"): link.find("inertial") for link in root.iter("link")}
        above = {joint.find("child").get("link"): joint for joint in root.iter("joint")}
        self.joints = []
        while tip in above:
            self.joints.insert(0, (above[tip], links[tip]))
            tip = above[tip].find("parent").get("link")

    def numbers(self, element, name, default="0 0 0"):
        text = default if element is None else element.get(name, default)
        return casadi.DM([float(x) for x in text.split()])

    def efforts(self, q, v, a):
        """Returns the efforts of the joints and the position of the tip."""
        R, p = casadi.DM.eye(3), casadi.DM.zeros(3)
        w, dw, dv = casadi.DM.zeros(3), casadi.DM.zeros(3), casadi.DM([0, 0, 9.81])
        bodies, k = [], 0
        for joint, inertial in self.joints:
            origin = joint.find("origin")
            step = R @ self.numbers(origin, "xyz")
            p, dv = p + step, dv + casadi.cross(dw, step) + casadi.cross(w, casadi.cross(w, step))
            roll, pitch, yaw = casadi.vertsplit(self.numbers(origin, "rpy"))
            for axis, angle in (([0, 0, 1], yaw), ([0, 1, 0], pitch), ([1, 0, 0], roll)):
                R = R @ rotation(casadi.DM(axis), angle)
            axis = None
            if joint.get("type") == "revolute":
                axis = R @ self.numbers(joint.find("axis"), "xyz")
                R = R @ rotation(self.numbers(joint.find("axis"), "xyz"), q[k])
                dw = dw + axis * a[k] + casadi.cross(w, axis * v[k])
                w = w + axis * v[k]
                k += 1
            if inertial is not None:
                m = float(inertial.find("mass").get("value"))
                c = R @ self.numbers(inertial.find("origin"), "xyz")
                i = {name: float(x) for name, x in inertial.find("inertia").attrib.items()}
                rows = [("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz")]
                inertia = R @ casadi.DM([[i[name] for name in row] for row in rows]) @ R.T
                f = m * (dv + casadi.cross(dw, c) + casadi.cross(w, casadi.cross(w, c)))
                n = inertia @ dw + casadi.cross(w, inertia @ w) + casadi.cross(p + c, f)  # moment about the origin
            else:
                f, n = casadi.DM.zeros(3), casadi.DM.zeros(3)
            bodies.append((axis, p, f, n))
        F, N, efforts = casadi.DM.zeros(3), casadi.DM.zeros(3), []
        for axis, place, f, n in reversed(bodies):
            F, N = F + f, N + n
            if axis is not None:
                efforts.insert(0, casadi.dot(axis, N - casadi.cross(place, F)))
        return casadi.vertcat(*efforts), p


def reach(q0, horizon, dt, target, effort, speed):
    """Solves the problem of an arm that comes to rest with its tool at a point, with bounds on efforts and speeds.
    Inverse dynamics relates efforts and accelerations."""
    arm, opti = Arm(ARM, "tool"), casadi.Opti()
    qs, vs, us = (opti.variable(7, n) for n in (horizon + 1, horizon + 1, horizon))
    opti.subject_to(qs[:, 0] == q0)
    opti.subject_to(vs[:, 0] == 0)
    total = 0
    for t in range(horizon):
        q, v, u = qs[:, t], vs[:, t], us[:, t]
        opti.subject_to(arm.efforts(q, v, (vs[:, t + 1] - v) / dt)[0] == u)
        opti.subject_to(qs[:, t + 1] == q + dt * vs[:, t + 1])
        opti.subject_to(opti.bounded(-effort, u, effort))
        opti.subject_to(opti.bounded(-speed, v, speed))
        rest = casadi.sumsqr(q - q0) + casadi.sumsqr(v)
        total += 0.5 * dt * (0.1 * rest + 1e-3 * casadi.sumsqr(u))
    opti.subject_to(arm.efforts(qs[:, horizon], vs[:, horizon], casadi.DM.zeros(7))[1] == casadi.DM(target))
    opti.subject_to(vs[:, horizon] == 0)
    opti.minimize(total)
    opti.set_initial(qs, casadi.repmat(casadi.DM(q0), 1, horizon + 1))
    options = {"tol": 1e-11, "constr_viol_tol": 1e-11, "bound_relax_factor": 0, "print_level": 0}
    opti.solver("ipopt", {"print_time": False}, options)
    found = opti.solve()
    states = casadi.vertcat(found.value(qs), found.value(vs)).T.full().tolist()
    return {
        "x0": [*q0, *[0.0] * 7],
        "horizon": horizon,
        "dt": dt,
        "target": target,
        "effort": effort.full().ravel().tolist(),
        "speed": speed,
        "cost": found.value(total),
        "xs": states,
        "us": found.value(us).T.tolist(),
    }


def main():
    def line(a, b, n):
        return [[p + (q - p) * t / n for p, q in zip(a, b, strict=True)] for t in range(n + 1)]

    # a unicycle moves around a disc, with bounded speed and turning rate, and comes to rest at the origin
    start, n = [-1.0, -1.0, 1.0], 40
    disc = [-0.55, -0.6, 0.2]

    def around(side):
        """Returns a warm start of states that passes the disc on one side."""
        way = line(start, [0.0, 0.0, 0.0], n)
        return [[x - side * 4 * x * (1 + x) * 0.4, y + side * 4 * y * (1 + y) * 0.4, a] for x, y, a in way]

    ways = [park_on(start, n, disc, guess) for guess in (line(start, [0.0, 0.0, 0.0], n), around(1), around(-1))]
    park = min(ways, key=lambda found: found["cost"])

    # a leaning pole on a cart ends upright and at rest; the position of the cart and the force are bounded
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
    effort = casadi.DM([60.0, 38.0, 30.0, 15.5, 5.0, 3.0, 1.0])
    arm = reach([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], 20, 0.04, [0.45, 0.25, 0.45], effort, 1.0)
    out = {"casadi": casadi.__version__, "park": {**park, "disc": disc}, "catch": catch, "reach": arm}
    pathlib.Path(__file__).with_name("ipopt.json").write_text(json.dumps(out) + "\n")
    print([found["cost"] for found in ways])
    print(
        arm["cost"],
        [max(abs(u[i]) for u in arm["us"]) for i in range(7)],
        max(abs(v) for x in arm["xs"] for v in x[7:]),
    )
    print(park["cost"], catch["cost"], max(u[0] for u in park["us"]), max(x[0] for x in catch["xs"]), catch["us"][:3])


if __name__ == "__main__":
    main()
