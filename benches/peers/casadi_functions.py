#!/usr/bin/env python3
"""Times functions of a robot in CasADi: ours, and the same recursions written as CasADi expressions.

    .venv/pinocchio/bin/python benches/peers/casadi_functions.py [URDF …] [--free-flyer] [--json]

Without robots: the embedded arm and humanoid. Prints, for RNEA and ABA, the time of the function, of its Jacobian by
all arguments and of the Hessian of λᵀf, in microseconds, medians of alternating rounds on one core, and how many times
faster ours are. The expressions run in CasADi's own virtual machine, as those of pinocchio.casadi do.
"""

import argparse
import json
import os
import time
from collections.abc import Callable

import casadi
import numpy as np

import condyle
import condyle.casadi

ROUNDS = 21
SECONDS = 0.02  # of each round


class Expressions:
    """RNEA and ABA in body frames (Featherstone 2008) for revolute, prismatic and free-flyer joints."""

    def __init__(self, model: condyle.Model) -> None:
        self.model = model
        q, v = casadi.SX.sym("q", model.nq), casadi.SX.sym("v", model.nv)
        self.q, self.v = q, v
        self.X: list[casadi.SX] = [None]  # iXλ on motions, linear part first
        self.S: list[casadi.SX] = [None]
        self.I: list[casadi.SX] = [None]
        for i in range(1, model.nbodies):
            placement, joint = model.joint_placements[i], model.joint_types[i]
            R, p = casadi.SX(placement[:3, :3]), casadi.SX(placement[:3, 3])
            k = model.idx_qs[i]
            axis = model.joints[i].axis
            if joint == "revolute":
                K = casadi.skew(axis)
                R = R @ (casadi.SX.eye(3) + casadi.sin(q[k]) * K + (1 - casadi.cos(q[k])) * K @ K)
                S = casadi.vertcat(casadi.DM.zeros(3), axis)
            elif joint == "prismatic":
                p = p + R @ axis * q[k]
                S = casadi.vertcat(axis, casadi.DM.zeros(3))
            elif joint == "free_flyer":
                p = p + R @ q[k : k + 3]
                u, w = q[k + 3 : k + 6], q[k + 6]
                R = R @ (casadi.SX.eye(3) + 2 * w * casadi.skew(u) + 2 * casadi.skew(u) @ casadi.skew(u))
                S = casadi.DM.eye(6)
            else:
                raise SystemExit(f"joint {model.names[i]}: expressions for {joint} joints are not written")
            self.X.append(casadi.blockcat([[R.T, -R.T @ casadi.skew(p)], [casadi.SX(3, 3), R.T]]))
            self.S.append(casadi.SX(S))
            body = model.inertias[i]
            m, c = body.mass, casadi.DM(casadi.skew(body.com))
            self.I.append(casadi.SX(casadi.blockcat([[m * casadi.DM.eye(3), -m * c], [m * c, body.rotational]])))

    @staticmethod
    def cross(v: casadi.SX) -> casadi.SX:
        """v × on motions."""
        linear, angular = casadi.skew(v[:3]), casadi.skew(v[3:])
        return casadi.blockcat([[angular, linear], [casadi.SX(3, 3), angular]])

    def gravity_acceleration(self) -> casadi.SX:
        return casadi.SX(np.concatenate([-self.model.gravity, np.zeros(3)]))

    def joint_velocity(self, x: casadi.SX, i: int) -> casadi.SX:
        k, n = self.model.idx_vs[i], self.S[i].size2()
        return x[k : k + n]

    def rnea(self) -> casadi.Function:
        model, a = self.model, casadi.SX.sym("a", self.model.nv)
        vs, accelerations, forces = [casadi.SX.zeros(6)], [self.gravity_acceleration()], [None]
        for i in range(1, model.nbodies):
            p, X, S, inertia = model.parents[i], self.X[i], self.S[i], self.I[i]
            vJ = S @ self.joint_velocity(self.v, i)
            vs.append(X @ vs[p] + vJ)
            accelerations.append(X @ accelerations[p] + S @ self.joint_velocity(a, i) + self.cross(vs[i]) @ vJ)
            forces.append(inertia @ accelerations[i] - self.cross(vs[i]).T @ (inertia @ vs[i]))
        tau = casadi.SX(model.nv, 1)
        for i in reversed(range(1, model.nbodies)):
            k, n = model.idx_vs[i], self.S[i].size2()
            tau[k : k + n] = self.S[i].T @ forces[i]
            if model.parents[i]:
                forces[model.parents[i]] += self.X[i].T @ forces[i]
        tau += casadi.DM(model.armature) * a
        return casadi.Function("rnea", [self.q, self.v, a], [tau])

    def aba(self) -> casadi.Function:
        model, tau = self.model, casadi.SX.sym("tau", self.model.nv)
        vs, c, inertias, forces = [casadi.SX.zeros(6)], [None], list(self.I), [None]
        for i in range(1, model.nbodies):
            vJ = self.S[i] @ self.joint_velocity(self.v, i)
            vs.append(self.X[i] @ vs[model.parents[i]] + vJ)
            c.append(self.cross(vs[i]) @ vJ)
            forces.append(-self.cross(vs[i]).T @ (self.I[i] @ vs[i]))
        U, D, u = [None] * model.nbodies, [None] * model.nbodies, [None] * model.nbodies
        for i in reversed(range(1, model.nbodies)):
            k, n = model.idx_vs[i], self.S[i].size2()
            U[i] = inertias[i] @ self.S[i]
            D[i] = casadi.solve(self.S[i].T @ U[i] + casadi.diag(model.armature[k : k + n]), casadi.SX.eye(n))
            u[i] = self.joint_velocity(tau, i) - self.S[i].T @ forces[i]
            if p := model.parents[i]:
                Ia = inertias[i] - U[i] @ D[i] @ U[i].T
                inertias[p] = inertias[p] + self.X[i].T @ Ia @ self.X[i]
                forces[p] = forces[p] + self.X[i].T @ (forces[i] + Ia @ c[i] + U[i] @ D[i] @ u[i])
        accelerations, a = [self.gravity_acceleration()], casadi.SX(model.nv, 1)
        for i in range(1, model.nbodies):
            k, n = model.idx_vs[i], self.S[i].size2()
            moved = self.X[i] @ accelerations[model.parents[i]] + c[i]
            a[k : k + n] = D[i] @ (u[i] - U[i].T @ moved)
            accelerations.append(moved + self.S[i] @ a[k : k + n])
        return casadi.Function("aba", [self.q, self.v, tau], [a])


def derived(f: casadi.Function) -> dict[str, casadi.Function]:
    """The function, its Jacobian, and the blocks of the Hessian of λᵀf, as an optimisation gets them."""
    return {"value": f, "Jacobian": f.jacobian(), "Hessian": f.reverse(1).jacobian()}


def call(f: casadi.Function, x: list[np.ndarray]) -> Callable[[], None]:
    """A call of a function through its buffers, without Python's conversions; inputs beyond x are ones."""
    buffer, trigger = f.buffer()
    given = [*x, *(np.ones(f.nnz_in(k)) for k in range(len(x), f.n_in()))]
    results = [np.zeros(f.nnz_out(k)) for k in range(f.n_out())]
    for k, part in enumerate(given):
        if f.nnz_in(k):
            buffer.set_arg(k, memoryview(part))
    for k, result in enumerate(results):
        if f.nnz_out(k):
            buffer.set_res(k, memoryview(result))
    return lambda keep=(buffer, given, results): trigger()


def microseconds(calls: list[Callable[[], None]]) -> list[float]:
    """The median time of each call, over rounds in which they take turns."""
    repeats = []
    for one in calls:
        begin, n = time.perf_counter(), 0
        while time.perf_counter() - begin < SECONDS:
            one()
            n += 1
        repeats.append(n)
    times: list[list[float]] = [[] for _ in calls]
    for _ in range(ROUNDS):
        for k, (one, n) in enumerate(zip(calls, repeats, strict=True)):
            begin = time.perf_counter()
            for _ in range(n):
                one()
            times[k].append((time.perf_counter() - begin) / n * 1e6)
    return [float(np.median(t)) for t in times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("robots", nargs="*", metavar="URDF")
    parser.add_argument("--free-flyer", action="store_true", help="the robots' roots move freely")
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    root = "free_flyer" if wanted.free_flyer else None
    models = [condyle.Model.from_urdf(path, root_joint=root) for path in wanted.robots]
    for model in models or [condyle.robots.arm7(), condyle.robots.humanoid()]:
        rng, expressions = np.random.default_rng(1), Expressions(model)
        x = [condyle.random_configuration(model, seed=1), *rng.standard_normal((2, model.nv))]
        for name in ("rnea", "aba"):
            ours, theirs = getattr(condyle.casadi, name)(model), getattr(expressions, name)()
            difference = float(casadi.norm_inf(ours(*x) - theirs(*x)))
            assert difference < 1e-8 * (1 + float(casadi.norm_inf(ours(*x)))), f"{name} differs by {difference}"
            for kind in ("value", "Jacobian", "Hessian"):
                pair = [derived(f)[kind] for f in (ours, theirs)]
                mine, other = microseconds([call(f, x) for f in pair])
                row = {"robot": model.name, "function": name, "kind": kind, "ours_us": mine, "expressions_us": other}
                if wanted.json:
                    print(json.dumps(row), flush=True)
                else:
                    print(
                        f"{model.name:20} {name:5} {kind:9} {mine:9.2f} {other:9.2f} {other / mine:6.1f} ×", flush=True
                    )


if __name__ == "__main__":
    main()
