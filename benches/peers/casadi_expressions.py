"""Functions of a robot written as CasADi expressions, in the same way as pinocchio.casadi writes them."""

import casadi
import numpy as np

import condyle


class Expressions:
    """Dynamics of a robot by recursions in the bodies' frames (Featherstone 2008), for revolute, prismatic and
    free-flyer joints."""

    def __init__(self, model: condyle.Model) -> None:
        self.model = model
        q, v = casadi.SX.sym("q", model.nq), casadi.SX.sym("v", model.nv)
        self.q, self.v = q, v
        self.X: list[casadi.SX] = [None]  # iXλ on motions, linear part first
        self.world = [(casadi.SX.eye(3), casadi.SX.zeros(3))]  # rotation and position of each body
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
            R0, p0 = self.world[model.parents[i]]
            self.world.append((R0 @ R, p0 + R0 @ p))
            self.X.append(casadi.blockcat([[R.T, -R.T @ casadi.skew(p)], [casadi.SX(3, 3), R.T]]))
            self.S.append(casadi.SX(S))
            body = model.inertias[i]
            m, c = body.mass, casadi.DM(casadi.skew(body.com))
            self.I.append(casadi.SX(casadi.blockcat([[m * casadi.DM.eye(3), -m * c], [m * c, body.rotational]])))

    @staticmethod
    def cross(v: casadi.SX) -> casadi.SX:
        """Returns the matrix of the cross product v × on motions."""
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

    def forward_kinematics(self, frame: str) -> casadi.Function:
        """Returns a CasADi function that computes the position and rotation of a frame from q."""
        R, p = self.frame(frame)
        return casadi.Function("forward_kinematics", [self.q], [p, R])

    def frame(self, name: str) -> tuple[casadi.SX, casadi.SX]:
        frame = self.model.frames[self.model.frame(name)]
        R, p = self.world[frame.body]
        placement = np.array(frame.placement)
        return R @ placement[:3, :3], p + R @ placement[:3, 3]

    def velocities(self) -> list[casadi.SX]:
        """Returns the velocity of each body, along the body's own axes."""
        vs = [casadi.SX.zeros(6)]
        for i in range(1, self.model.nbodies):
            vs.append(self.X[i] @ vs[self.model.parents[i]] + self.S[i] @ self.joint_velocity(self.v, i))
        return vs

    def frame_velocity(self, name: str) -> casadi.Function:
        """Returns a CasADi function that computes the velocity of a frame, along the frame's own axes."""
        frame = self.model.frames[self.model.frame(name)]
        placement = np.array(frame.placement)
        R, p = casadi.DM(placement[:3, :3]), casadi.DM(placement[:3, 3])
        v = self.velocities()[frame.body]
        linear = R.T @ (v[:3] + casadi.cross(v[3:], p))
        return casadi.Function("frame_velocity", [self.q, self.v], [casadi.vertcat(linear, R.T @ v[3:])])

    def constrained_dynamics(self, points: list[str], kd: float) -> casadi.Function:
        """Returns the function for the dynamics of a robot whose contact points cannot move. This function computes the
        accelerations, and the contact forces along the world's axes."""
        model, vs, biases = self.model, self.velocities(), [casadi.SX.zeros(6)]
        for i in range(1, model.nbodies):
            vJ = self.S[i] @ self.joint_velocity(self.v, i)
            biases.append(self.X[i] @ biases[model.parents[i]] + self.cross(vs[i]) @ vJ)
        velocity, gamma = [], []
        for point in points:
            frame = model.frames[model.frame(point)]
            p, (R, _) = casadi.DM(np.array(frame.placement)[:3, 3]), self.world[frame.body]
            v, c = vs[frame.body], biases[frame.body]
            linear = v[:3] + casadi.cross(v[3:], p)
            velocity.append(R @ linear)
            gamma.append(R @ (c[:3] + casadi.cross(c[3:], p) + casadi.cross(v[3:], linear)))
        velocity = casadi.vertcat(*velocity)
        gamma, J = casadi.vertcat(*gamma) + kd * velocity, casadi.jacobian(velocity, self.v)
        a, tau = casadi.SX.sym("a", model.nv), casadi.SX.sym("tau", model.nv)
        effort = self.rnea()(self.q, self.v, a)
        M, h = casadi.jacobian(effort, a), casadi.substitute(effort, a, casadi.SX.zeros(model.nv))
        rows = J.size1()
        K = casadi.blockcat([[M, J.T], [J, casadi.SX(rows, rows)]])
        D, LT, order = casadi.ldl(K, False)  # rows keep their order: M must be eliminated first
        x = casadi.ldl_solve(casadi.vertcat(tau - h, -gamma), D, LT, order)
        return casadi.Function("constrained_dynamics", [self.q, self.v, tau], [x[: model.nv], -x[model.nv :]])
