#!/usr/bin/env python3
"""Writes crocoddyl.json next to this file: the iterations of Crocoddyl's solvers on small problems.

pip install crocoddyl==3.2.1 pin==4.0.0 && python make_crocoddyl.py

K and k have Crocoddyl's sign: u = ubar - alpha k - K dx.
"""
import json, math, pathlib
import numpy as np
import crocoddyl


class Cartpole(crocoddyl.DifferentialActionModelAbstract):
    """Cart-pole with x = (y, theta, y', theta'), upright at theta = 0; cost 1/2 |w (theta, y, y', theta', f)|^2."""

    m1, m2, l, g = 1.0, 0.1, 0.5, 9.81

    def __init__(self, weights):
        crocoddyl.DifferentialActionModelAbstract.__init__(self, crocoddyl.StateVector(4), 1, 5)
        self.w2 = np.array(weights) ** 2

    def parts(self, x, u):
        f, s, c = (0.0 if u is None else u[0]), math.sin(x[1]), math.cos(x[1])
        n1 = f + self.m2 * c * s * self.g - self.m2 * self.l * s * x[3] ** 2
        n2 = c * f / self.l + (self.m1 + self.m2) * self.g * s / self.l - self.m2 * c * s * x[3] ** 2
        return f, s, c, self.m1 + self.m2 * s * s, n1, n2

    def calc(self, data, x, u=None):
        f, _, _, mu, n1, n2 = self.parts(x, u)
        if u is not None:
            data.xout[:] = [n1 / mu, n2 / mu]
        data.cost = 0.5 * float(self.w2 @ np.array([x[1], x[0], x[2], x[3], f]) ** 2)

    def calcDiff(self, data, x, u=None):
        f, s, c, mu, n1, n2 = self.parts(x, u)
        m1, m2, l, g, w = self.m1, self.m2, self.l, self.g, x[3]
        dmu, c2 = 2 * m2 * s * c, c * c - s * s
        data.Fx[0, 1] = (m2 * g * c2 - m2 * l * c * w**2) / mu - n1 * dmu / mu**2
        data.Fx[1, 1] = (-s * f / l + (m1 + m2) * g * c / l - m2 * c2 * w**2) / mu - n2 * dmu / mu**2
        data.Fx[:, 3] = [-2 * m2 * l * s * w / mu, -2 * m2 * c * s * w / mu]
        data.Fu[:] = np.array([1 / mu, c / (l * mu)])
        w2 = self.w2[[1, 0, 2, 3]]
        data.Lx[:], data.Lxx[:] = w2 * x, np.diag(w2)
        data.Lu[:], data.Luu[:] = [self.w2[4] * f], [self.w2[4]]


class Trace(crocoddyl.CallbackAbstract):
    COLUMNS = ["cost", "gap", "step", "regularisation", "stop", "d1", "d2", "feasible"]

    def __init__(self):
        crocoddyl.CallbackAbstract.__init__(self)
        self.rows = []

    def __call__(self, s):
        d = np.asarray(s.d).flatten()
        row = [s.cost, s.ffeas, s.stepLength, s.preg, s.stop, d[0], d[1], s.isFeasible]
        self.rows.append([float(v) for v in row])


SOLVERS = {
    "fddp": crocoddyl.SolverFDDP,
    "ddp": crocoddyl.SolverDDP,
    "box fddp": crocoddyl.SolverBoxFDDP,
    "box ddp": crocoddyl.SolverBoxDDP,
}


def unicycle(bounds=None):
    m = crocoddyl.ActionModelUnicycle()
    m.dt, m.costWeights = 0.1, np.array([10.0, 1.0])
    if bounds is not None:
        m.u_lb, m.u_ub = (np.array(b) for b in bounds)
    return m


def solve(x0, running, terminal, n, guess, max_iterations, regularisation=1e-9, solver="fddp"):
    bounds = [running.u_lb.tolist(), running.u_ub.tolist()] if solver.startswith("box") else None
    name = solver
    x0 = np.array(x0)
    problem = crocoddyl.ShootingProblem(x0, [running] * n, terminal)
    end = x0 if guess is None else np.array(guess)
    xs = [x0 + (end - x0) * (t / n) for t in range(n + 1)]
    us = [np.zeros(running.nu)] * n
    solver, trace = SOLVERS[solver](problem), Trace()
    solver.setCallbacks([trace])
    converged = solver.solve(xs, us, max_iterations, False, regularisation)
    return {
        "x0": x0.tolist(), "horizon": n, "last_guess": end.tolist(), "max_iterations": max_iterations, "regularisation": regularisation,
        "method": name.split()[-1], "bounds": bounds,
        "converged": bool(converged), "K0": np.asarray(solver.K[0]).tolist(), "u0": np.asarray(solver.us[0]).tolist(),
        "x_last": np.asarray(solver.xs[n]).tolist(), "trace": trace.rows,
    }  # fmt: skip


def main():
    u = unicycle()
    keep = Cartpole([1.0, 0.1, 0.1, 0.1, 0.3]), Cartpole([100.0, 10.0, 10.0, 10.0, 0.0])
    running, terminal = (crocoddyl.IntegratedActionModelEuler(m, 0.03) for m in keep)
    hanging = [0.0, 3.14, 0.0, 0.0]
    slow = unicycle(([-0.5, -1.0], [3.0, 1.5]))
    weak = crocoddyl.IntegratedActionModelEuler(keep[0], 0.03)
    weak.u_lb, weak.u_ub = np.array([-8.0]), np.array([6.0])
    problems = {
        "unicycle_20": solve([-1.0, -1.0, 1.0], u, u, 20, None, 100),
        "unicycle_200": solve([-1.0, -1.0, 1.0], u, u, 200, None, 100),
        "unicycle_gaps": solve([-1.0, -1.0, 1.0], u, u, 50, [3.0, 2.0, -2.0], 100),
        "cartpole_swingup": solve(hanging, running, terminal, 50, None, 300),
        "cartpole_gaps": solve(hanging, running, terminal, 50, [1.0, 0.0, 2.0, 0.0], 300),
        "cartpole_spinning": solve(hanging, running, terminal, 50, [-5.0, 9.0, 0.0, 30.0], 8),
        "cartpole_regularised": solve(hanging, running, terminal, 50, None, 300, 10.0),
        "unicycle_ddp": solve([-1.0, -1.0, 1.0], u, u, 50, [3.0, 2.0, -2.0], 100, solver="ddp"),
        "cartpole_ddp": solve([0.0, 0.3, 0.0, 0.0], running, terminal, 50, None, 100, solver="ddp"),
        "cartpole_ddp_falling": solve(hanging, running, terminal, 50, None, 12, solver="ddp"),
        "unicycle_box_fddp": solve([-1.0, -1.0, 1.0], slow, slow, 50, None, 100, solver="box fddp"),
        "unicycle_box_gaps": solve([-1.0, -1.0, 1.0], slow, slow, 50, [3.0, 2.0, -2.0], 100, solver="box fddp"),
        "unicycle_box_ddp": solve([-1.0, -1.0, 1.0], slow, slow, 50, [3.0, 2.0, -2.0], 100, solver="box ddp"),
        "cartpole_box_fddp": solve(hanging, weak, terminal, 50, None, 300, solver="box fddp"),
        "cartpole_box_ddp": solve(hanging, weak, terminal, 50, None, 300, solver="box ddp"),
    }
    out = {"crocoddyl": crocoddyl.__version__, "columns": Trace.COLUMNS, "problems": problems}
    pathlib.Path(__file__).with_name("crocoddyl.json").write_text(json.dumps(out, indent=None) + "\n")
    for name, p in problems.items():
        print(name, p["converged"], len(p["trace"]), p["trace"][-1])


if __name__ == "__main__":
    main()
