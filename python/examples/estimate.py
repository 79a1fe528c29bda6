"""Estimates the pose and velocity of a quadruped's base from an IMU and the legs, by moving-horizon estimation on FDDP.

The estimator finds the most probable last N + 1 states x = (pose, velocity) of the base. Its cost is a sum of squares:

    ½ |x₀ ⊖ x̄₀|²_P + Σ ½ |wₜ|²_Q + Σ ½ |yₜ − h(xₜ)|²_R    with    xₜ₊₁ = f(xₜ) ⊕ wₜ

x̄₀ is the prior at the beginning of the horizon. As an optimal control problem, the disturbances wₜ are the controls,
and one more knot begins at x̄₀ and has the control x₀ ⊖ x̄₀. FDDP solves the problem in time proportional to N, on the
manifold of poses. `condyle.jacobian` differentiates the functions below exactly.

The process f integrates the pose, and the velocity with the measured acceleration. The measurements are the gyroscope,
the velocity zero of feet on the ground, and the height zero of these feet. The last solution, moved by one step, is the
next warm start; an extended Kalman filter moves the prior. The plot `estimate.png` compares the estimate with the truth
and with an integration of the IMU alone.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle.optimal import Action, Fddp, Problem

Array = NDArray[np.float64]

DT, HORIZON = 0.02, 15
"""Time step (s), and number of steps N of the horizon."""
FEET = ("LF_foot", "RF_foot", "LH_foot", "RH_foot")
GRAVITY = np.array([0.0, 0.0, -9.81])

SIGMA_PRIOR = np.repeat([0.02, 0.03, 0.1, 0.05], 3)
"""Deviations of the first prior: position (m), orientation (rad), linear (m/s) and angular velocity (rad/s)."""
SIGMA_PROCESS = np.repeat([1e-4, 1e-4, 0.2 * DT, 10.0 * DT], 3)
"""Deviations of the disturbances of a step. The accelerometer has noise of 0.2 m/s²."""
SIGMA_GYRO, SIGMA_SLIP, SIGMA_HEIGHT = 0.02, 0.05, 0.005
"""Deviations of measurements: gyroscope (rad/s), velocity of a foot on the ground (m/s), height of a foot (m)."""


def base() -> condyle.Model:
    """Returns a free body: the space of the states of the base."""
    builder = condyle.ModelBuilder("base")
    body = condyle.Inertia.from_com(1.0, np.zeros(3), np.eye(3))
    builder.body("base", condyle.WORLD, condyle.Joint.free_flyer(), np.eye(4), body)
    return builder.build()


BASE = base()
NX, NDX, NQ = BASE.nq + BASE.nv, 2 * BASE.nv, BASE.nq


class Log(NamedTuple):
    """Measurements, and the truth for comparison; one row for each time."""

    acceleration: Array
    """Measured acceleration of the base without gravity, in the base's frame, (T, 3)."""
    gyro: Array
    feet: Array
    """Positions of the feet in the base's frame, from the joints' angles, (T, 4, 3)."""
    feet_velocity: Array
    """Velocities of the feet in the base's frame, from the joints' velocities, (T, 4, 3)."""
    contact: Array
    """Whether a foot is on the ground, (T, 4)."""
    truth: Array
    """States, (T, 13)."""


def rotation(q: Any) -> Any:
    """Returns the rotation matrix of a pose (position, quaternion)."""
    x, y, z, w = q[3], q[4], q[5], q[6]
    return np.array([
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
        [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
        [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
    ])  # fmt: skip


def cross(a: Any, b: Any) -> Any:
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def process(log: Log, t: int, x: Any) -> Any:
    """Returns the next state without disturbance, f(x): v̇ = a_measured − ω × v + Rᵀ g for the linear velocity v."""
    q, v = x[:NQ], x[NQ:]
    rate = log.acceleration[t] - cross(v[3:], v[:3]) + rotation(q).T @ GRAVITY
    return np.concatenate([condyle.integrate(BASE, q, DT * v), v[:3] + DT * rate, v[3:]])


def residual(log: Log, t: int, x: Any) -> Any:
    """Returns the errors of the measurements at time t, divided by their deviations."""
    q, v = x[:NQ], x[NQ:]
    R, parts = rotation(q), [(v[3:] - log.gyro[t]) / SIGMA_GYRO]
    for foot, speed, on_ground in zip(log.feet[t], log.feet_velocity[t], log.contact[t], strict=True):
        if on_ground:
            parts.append((v[:3] + cross(v[3:], foot) + speed) / SIGMA_SLIP)
            parts.append(np.array([(q[2] + R[2] @ foot) / SIGMA_HEIGHT]))
    return np.concatenate(parts)


def plus(x: Any, d: Any) -> Any:
    return np.concatenate([condyle.integrate(BASE, x[:NQ], d[: BASE.nv]), x[NQ:] + d[BASE.nv :]])


def minus(y: Any, x: Any) -> Any:
    return np.concatenate([condyle.difference(BASE, x[:NQ], y[:NQ]), y[NQ:] - x[NQ:]])


def plus_jacobians(d: Array) -> tuple[Array, Array]:
    """Returns the derivatives of x ⊕ d with respect to x and d."""
    result = []
    for argument in ("position", "velocity"):
        J = np.eye(NDX)
        J[: BASE.nv, : BASE.nv] = condyle.integrate_jacobian(BASE, d[: BASE.nv], argument)
        result.append(J)
    return result[0], result[1]


class Estimator:
    """Moving-horizon estimation. `update` adds one time to the horizon, and returns the estimate at this time."""

    def __init__(self, log: Log, x0: Array) -> None:
        self.log, self.start = log, 0
        self.prior, self.covariance = x0, np.diag(SIGMA_PRIOR**2)
        self.xs = x0[None]  # the estimates of the last solution
        self.us = np.zeros((0, NDX))
        self.time = -1

    def update(self) -> Array:
        self.time += 1
        if self.time - self.start > HORIZON:
            self._move()
        if len(self.xs) < self.time - self.start + 1:
            self.xs = np.vstack([self.xs, process(self.log, self.time - 1, self.xs[-1])])
            self.us = np.vstack([self.us, np.zeros(NDX)])
        root = np.linalg.inv(np.linalg.cholesky(self.covariance))
        problem = self._problem(root)
        arrival = minus(self.xs[0], self.prior)
        solver = Fddp(problem, tolerance=1e-18, max_iterations=30)
        found = solver.solve(np.vstack([self.prior, self.xs]), [arrival, *self.us])
        self.xs, self.us = np.array(found.xs[1:]), np.array(found.us[1:]).reshape(-1, NDX)
        return self.xs[-1]

    def _problem(self, root: Array) -> Problem:
        log, start = self.log, self.start

        def arrive(t: int, x: Any, u: Any) -> Any:
            error = root @ u
            return plus(x, u), 0.5 * (error @ error)

        def arrive_diff(t: int, x: Any, u: Any) -> dict[str, Array]:
            A, B = plus_jacobians(u)
            weight = root.T @ root
            return {"A": A, "B": B, "r": weight @ u, "R": weight}

        def step(t: int, x: Any, u: Any) -> Any:
            noise, error = u / SIGMA_PROCESS, residual(log, start + t - 1, x)
            return plus(process(log, start + t - 1, x), u), 0.5 * (noise @ noise + error @ error)

        def step_diff(t: int, x: Any, u: Any) -> dict[str, Array]:
            after = process(log, start + t - 1, x)
            _, F = derivative(lambda y: minus(process(log, start + t - 1, y), after), x)
            A, B = plus_jacobians(u)
            noise = {"r": u / SIGMA_PROCESS**2, "R": np.diag(SIGMA_PROCESS**-2.0)}
            return {"A": A @ F, "B": B, **noise, **last_diff(t, x, u)}

        def last(t: int, x: Any, u: Any) -> Any:
            error = residual(log, start + t - 1, x)
            return None, 0.5 * (error @ error)

        def last_diff(t: int, x: Any, u: Any) -> dict[str, Array]:
            error, H = derivative(lambda x: residual(log, start + t - 1, x), x)
            return {"q": H.T @ error, "Q": H.T @ H}  # Gauss and Newton's Hessian

        count = len(self.us)
        models = [Action(NX, NDX, arrive, arrive_diff, space=BASE), Action(NX, NDX, step, step_diff, space=BASE)]
        return Problem(self.prior, models, [0] + [1] * count, Action(NX, 0, last, last_diff, space=BASE))

    def _move(self) -> None:
        """Moves the prior by one time: an update of a Kalman filter with the measurements at the old beginning."""
        t, x = self.start, self.xs[0]
        r, H = derivative(lambda x: residual(self.log, t, x), x)
        information = np.linalg.inv(self.covariance) + H.T @ H
        shift = minus(self.prior, x)  # the prior as a measurement of x
        gradient = np.linalg.solve(self.covariance, shift) - H.T @ r
        mean = plus(x, np.linalg.solve(information, gradient))
        _, A = derivative(lambda y: minus(process(self.log, t, y), process(self.log, t, mean)), mean)
        self.covariance = A @ np.linalg.inv(information) @ A.T + np.diag(SIGMA_PROCESS**2)
        self.prior = process(self.log, t, mean)
        self.xs, self.us = self.xs[1:], self.us[1:]
        self.start += 1


def derivative(f: Any, x: Array) -> tuple[Array, Array]:
    """Returns f(x) and the exact Jacobian of f(x ⊕ d) with respect to d."""
    return condyle.jacobian(BASE, x, f)


def dense(estimator: Estimator) -> Array:
    """Returns the states of the same horizon by Gauss and Newton's method with one dense matrix, for comparison."""
    log, start, xs = estimator.log, estimator.start, estimator.xs.copy()
    root = np.linalg.inv(np.linalg.cholesky(estimator.covariance))
    n = len(xs)
    xs = np.stack([plus(x, 1e-3 * np.sin(np.arange(NDX) + k)) for k, x in enumerate(xs)])  # begin elsewhere
    for _ in range(50):
        r, J = derivative(lambda x: minus(x, estimator.prior), xs[0])
        terms = [(root @ r, {0: root @ J})]  # residuals, and their Jacobians with respect to some states
        for t, x in enumerate(xs):
            r, H = derivative(lambda x, t=t: residual(log, start + t, x), x)
            terms.append((r, {t: H}))
            if t + 1 < n:
                after = xs[t + 1]
                w, A = derivative(lambda x, t=t, y=after: minus(y, process(log, start + t, x)), x)
                _, B = derivative(lambda y, t=t, x=x: minus(y, process(log, start + t, x)), after)
                scale = 1.0 / SIGMA_PROCESS
                terms.append((scale * w, {t: scale[:, None] * A, t + 1: scale[:, None] * B}))
        matrix = np.zeros((sum(len(r) for r, _ in terms), n * NDX))
        row = 0
        for r, blocks in terms:
            for t, block in blocks.items():
                matrix[row : row + len(r), t * NDX : (t + 1) * NDX] = block
            row += len(r)
        step = np.linalg.lstsq(matrix, -np.concatenate([r for r, _ in terms]), rcond=None)[0].reshape(n, NDX)
        xs = np.stack([plus(x, d) for x, d in zip(xs, step, strict=True)])
        if np.abs(step).max() < 1e-12:
            break
    return xs


def simulate(duration: float = 1.2, seed: int = 0) -> Log:
    """Simulates a trot: a base that moves on a smooth path, feet that stand at fixed places, and noisy sensors."""
    robot, rng = condyle.robots.quadruped(), np.random.default_rng(seed)
    data, times = condyle.Data(robot), np.arange(0.0, duration, DT)
    nominal = condyle.neutral(robot)
    nominal[7:] = np.tile([0.0, 0.6, -1.2], 4)
    hips = np.stack([condyle.frame_placement(robot, data, nominal, foot)[:2, 3] for foot in FEET])
    height = -np.mean([condyle.frame_placement(robot, data, nominal, foot)[2, 3] for foot in FEET])
    advance, sway = 0.4 * times, 0.02 * np.sin(2.0 * np.pi * times)
    turn = 0.2 * times
    attitude = np.stack([0.05 * np.sin(9.0 * times), 0.04 * np.sin(7.0 * times), turn], 1)
    poses = np.zeros((len(times), NQ))
    for pose, x, y, w, t in zip(poses, advance, sway, attitude, times, strict=True):
        pose[:3] = x, y, height + 0.01 * np.sin(11.0 * t)
        pose[3:] = condyle.algebra.quaternion(condyle.exp3([0.0, 0.0, w[2]]) @ condyle.exp3([w[0], w[1], 0.0]))
    velocity = condyle.difference(BASE, poses[:-1], poses[1:]) / DT
    rate = np.diff(velocity, axis=0) / DT
    T = len(rate)
    rotations = np.stack([rotation(q) for q in poses])
    free = rate[:, :3] + np.cross(velocity[:T, 3:], velocity[:T, :3]) - np.einsum("tji,j->ti", rotations[:T], GRAVITY)

    phase = (times[:T, None] / 0.5 + np.array([0.0, 0.5, 0.5, 0.0])) % 1.0
    contact = phase < 0.55
    world = np.zeros((T, 4, 3))
    for foot in range(4):
        for t in range(T):
            if t and contact[t, foot] and contact[t - 1, foot]:
                world[t, foot] = world[t - 1, foot]
            else:
                world[t, foot, :2] = poses[t, :2] + (rotations[t][:2, :2] @ hips[foot])
                world[t, foot, 2] = 0.0 if contact[t, foot] else 0.08 * np.sin(np.pi * (phase[t, foot] - 0.55) / 0.45)
    joints = np.tile(
        nominal, (T, 1)
    )  # the legs' angles by Newton's method for all times at once, with the base at rest
    local = np.einsum("tji,tfj->tfi", rotations[:T], world - poses[:T, None, :3])
    jacobians = np.zeros((T, 12, 12))
    for _ in range(30):
        miss = np.zeros((T, 12))
        for k, foot in enumerate(FEET):
            miss[:, 3 * k : 3 * k + 3] = local[:, k] - condyle.frame_placement(robot, data, joints, foot)[:, :3, 3]
            J = condyle.frame_jacobian(robot, data, joints, foot, "local_world_aligned")[:, :3, 6:]
            jacobians[:, 3 * k : 3 * k + 3] = J
        joints[:, 7:] += np.clip(np.linalg.solve(jacobians, miss[:, :, None])[:, :, 0], -0.3, 0.3)
    still = -(velocity[:T, None, :3] + np.cross(velocity[:T, None, 3:], local))  # the feet on the ground do not move
    joint_rates = np.linalg.solve(jacobians, still.reshape(T, 12, 1))[:, :, 0]

    joints[:, 7:] += 5e-4 * rng.standard_normal((T, 12))  # the encoders' noise
    rates = np.hstack([np.zeros((T, 6)), joint_rates + 0.02 * rng.standard_normal((T, 12))])
    feet = np.stack([condyle.frame_placement(robot, data, joints, foot)[:, :3, 3] for foot in FEET], 1)
    speeds = [condyle.frame_velocity(robot, data, joints, rates, foot, "local_world_aligned")[:, :3] for foot in FEET]
    return Log(
        free + 0.2 * rng.standard_normal((T, 3)),
        velocity[:T, 3:] + SIGMA_GYRO * rng.standard_normal((T, 3)),
        feet,
        np.stack(speeds, 1),
        contact,
        np.hstack([poses[:T], velocity[:T]]),
    )


class Report(NamedTuple):
    """States of truth, estimate and integration of the IMU alone, (T, 13) each, and their errors."""

    truth: Array
    estimate: Array
    integrated: Array
    largest_difference: float
    """The largest difference between states of FDDP and of dense least squares."""


def run(duration: float = 1.2, comparisons: int = 3) -> Report:
    log, rng = simulate(duration), np.random.default_rng(1)
    start = plus(log.truth[0], SIGMA_PRIOR * rng.standard_normal(NDX))
    estimator, estimates, integrated = Estimator(log, start), [], [start]
    T, difference = len(log.truth), 0.0
    compared = set(np.linspace(HORIZON // 2, T - 1, comparisons).astype(int))
    for t in range(T):
        estimates.append(estimator.update())
        if t in compared:
            both = zip(estimator.xs, dense(estimator), strict=True)
            difference = max(difference, *(float(np.abs(minus(x, y)).max()) for x, y in both))
        if t + 1 < T:
            x = process(log, t, integrated[-1])
            integrated.append(np.concatenate([x[: NQ + 3], log.gyro[t + 1]]))
    return Report(log.truth, np.stack(estimates), np.stack(integrated), difference)


def errors(report: Report, states: Array) -> tuple[float, float, float]:
    """Returns the root mean squares of the errors of height (m), of tilt (rad) and of linear velocity (m/s)."""
    d = np.stack([minus(x, y) for x, y in zip(states, report.truth, strict=True)])[HORIZON:]
    height = states[HORIZON:, 2] - report.truth[HORIZON:, 2]
    return tuple(float(np.sqrt(np.mean(part**2))) for part in (height, d[:, 3:5], d[:, 6:9]))  # type: ignore[return-value]


def draw(report: Report) -> None:
    """Writes `estimate.png`, if Matplotlib is installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        print("no plot: pip install matplotlib")
        return
    t = DT * np.arange(len(report.truth))
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.6), layout="constrained")
    titles = {2: "height (m)", NQ: "forward velocity (m/s)", NQ + 1: "lateral velocity (m/s)"}
    for axis, (k, title) in zip(axes, titles.items(), strict=True):
        axis.plot(t, report.truth[:, k], "k", lw=3, alpha=0.3, label="truth")
        axis.plot(t, report.integrated[:, k], "C1--", lw=1, label="IMU alone")
        axis.plot(t, report.estimate[:, k], "C0", lw=1, label="moving horizon")
        axis.set(xlabel="time (s)", title=title)
    axes[0].legend()
    figure.savefig("estimate.png", dpi=110)
    pyplot.close(figure)


def main() -> None:
    report = run()
    for name, states in {"IMU alone": report.integrated, "moving horizon": report.estimate}.items():
        height, tilt, velocity = errors(report, states)
        print(f"{name}: errors of height {height:.4f} m, tilt {tilt:.4f} rad, velocity {velocity:.3f} m/s")
    print(f"largest difference from dense least squares: {report.largest_difference:.1e}")
    draw(report)


if __name__ == "__main__":
    main()
