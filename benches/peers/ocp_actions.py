"""User-defined actions for the optimal control problems: a unicycle, a pole on a cart, a double pendulum."""

import math

import numpy as np

import condyle
from condyle import optimal


def unicycle(stage):
    """Returns the running and the terminal action of a unicycle with x = (x, y, θ) and u = (v, ω): position, heading,
    speed and turn rate."""
    dt, wx, wu = stage["dt"], stage["w_x"], stage["w_u"]

    def calc(t, x, u):
        cost = 0.5 * wx**2 * (x @ x)
        if not len(u):
            return None, cost
        step = dt * np.array([u[0] * math.cos(x[2]), u[0] * math.sin(x[2]), u[1]])
        return x + step, cost + 0.5 * wu**2 * (u @ u)

    def calc_diff(t, x, u):
        out = {"Q": wx**2 * np.eye(3), "q": wx**2 * x}
        if len(u):
            c, s = math.cos(x[2]), math.sin(x[2])
            out["A"] = np.array([[1, 0, -dt * u[0] * s], [0, 1, dt * u[0] * c], [0, 0, 1]], dtype=float)
            out["B"] = dt * np.array([[c, 0], [s, 0], [0, 1]], dtype=float)
            out["R"], out["r"] = wu**2 * np.eye(2), wu**2 * u
        return out

    return optimal.Action(3, 2, calc, calc_diff), optimal.Action(3, 0, calc, calc_diff)


class Cartpole:
    """Action of a pole on a cart, with x = (y, θ, ẏ, θ̇) and u = (f): position y of the cart, angle θ of the pole, and
    force f on the cart. The pole is upright at θ = 0."""

    def __init__(self, stage):
        self.m1, self.m2, self.l, self.g = (stage[k] for k in ("m_cart", "m_pole", "length", "g"))
        angle, position, speed, rate, force = np.array(stage["w"], dtype=float) ** 2
        self.weights = np.array([position, angle, speed, rate, force])
        self.dt = stage["dt"]

    def acceleration(self, x, f):
        """Returns (ÿ, θ̈), and the derivatives of ÿ and θ̈ with respect to θ, θ̇ and f."""
        m1, m2, length, g = self.m1, self.m2, self.l, self.g
        s, c, rate = math.sin(x[1]), math.cos(x[1]), x[3]
        mu, dmu = m1 + m2 * s * s, 2.0 * m2 * s * c
        up = np.array(
            [
                f + m2 * c * s * g - m2 * length * s * rate**2,
                c * f / length + (m1 + m2) * g * s / length - m2 * c * s * rate**2,
            ]
        )
        turn = c * c - s * s
        dup = np.array(
            [
                m2 * g * turn - m2 * length * c * rate**2,
                -s * f / length + (m1 + m2) * g * c / length - m2 * turn * rate**2,
            ]
        )
        a = up / mu
        by_rate = np.array([-2.0 * m2 * length * s * rate, -2.0 * m2 * c * s * rate]) / mu
        return a, (dup - a * dmu) / mu, by_rate, np.array([1.0, c / length]) / mu

    def rate(self, x, u):
        """Returns the running cost per second."""
        return 0.5 * float(self.weights[: 4 + len(u)] @ np.r_[x, u] ** 2)

    def calc(self, t, x, u):
        if not len(u):
            return None, self.rate(x, u)
        a, dt = self.acceleration(x, u[0])[0], self.dt
        return np.r_[x[:2] + dt * x[2:] + dt * dt * a, x[2:] + dt * a], dt * self.rate(x, u)

    def calc_diff(self, t, x, u):
        scale = self.dt if len(u) else 1.0
        w = scale * self.weights
        out = {"Q": np.diag(w[:4]), "q": w[:4] * x}
        if len(u):
            _, by_angle, by_rate, by_force = self.acceleration(x, u[0])
            slopes = np.zeros((2, 4))
            slopes[:, 1], slopes[:, 3] = by_angle, by_rate
            step = np.vstack([self.dt**2 * slopes, self.dt * slopes])
            step[:2, 2:] += self.dt * np.eye(2)
            out["A"] = np.eye(4) + step
            out["B"] = np.r_[self.dt**2 * by_force, self.dt * by_force][:, None]
            out["R"], out["r"] = w[4:, None], w[4:] * u
        return out

    def actions(self):
        return tuple(optimal.Action(4, nu, self.calc, self.calc_diff) for nu in (1, 0))


class DoublePendulum:
    """Action of a double pendulum with one motor. The goal's residual contains sines and cosines, and the goal computes
    its own Hessian."""

    def __init__(self, model, stage):
        self.model, self.data = model, condyle.Data(model)
        self.dt, self.costs = stage["dt"], stage["costs"]

    def goal(self, x, w):
        """Returns value, gradient and Hessian of ½ Σ w r² with the weights w and the residual r = (sin q, 1 − cos q,
        v)."""
        s, c = np.sin(x[:2]), np.cos(x[:2])
        r = np.r_[s, 1.0 - c, x[2:]]
        slope = np.r_[c * (w * r)[:2] + s * (w * r)[2:4], (w * r)[4:]]
        curve = np.r_[(c**2 - s**2) * w[:2] + (s**2 + (1.0 - c) * c) * w[2:4], w[4:]]
        return 0.5 * float(w @ r**2), slope, np.diag(curve)

    def rate(self, x, u):
        value, out = 0.0, {"Q": np.zeros((4, 4)), "q": np.zeros(4), "R": np.zeros((len(u),) * 2), "r": np.zeros(len(u))}
        for cost in self.costs:
            weight = cost["weight"]
            if cost["residual"]["type"] == "control" and len(u):
                value += 0.5 * weight * float(u @ u)
                out["R"], out["r"] = out["R"] + weight * np.eye(1), out["r"] + weight * u
            elif cost["residual"]["type"] == "double_pendulum":
                a, slope, curve = self.goal(x, np.array(cost["activation"]["w"]))
                value, out["q"], out["Q"] = value + weight * a, out["q"] + weight * slope, out["Q"] + weight * curve
        return value, out

    def calc(self, t, x, u):
        value, _ = self.rate(x, u)
        if not len(u):
            return None, value
        a = condyle.aba(self.model, self.data, x[:2], x[2:], np.r_[u, 0.0])
        return np.r_[x[:2] + self.dt * x[2:] + self.dt**2 * a, x[2:] + self.dt * a], self.dt * value

    def calc_diff(self, t, x, u):
        _, out = self.rate(x, u)
        if not len(u):
            return out
        out = {name: self.dt * block for name, block in out.items()}
        d = condyle.aba_derivatives(self.model, self.data, x[:2], x[2:], np.r_[u, 0.0])
        slopes = np.hstack([d.da_dq, d.da_dv])
        step = np.vstack([self.dt**2 * slopes, self.dt * slopes])
        step[:2, 2:] += self.dt * np.eye(2)
        out["A"] = np.eye(4) + step
        out["B"] = np.r_[self.dt**2 * d.da_dtau[:, :1], self.dt * d.da_dtau[:, :1]]
        return out

    def actions(self):
        return tuple(optimal.Action(4, nu, self.calc, self.calc_diff) for nu in (1, 0))
