"""Identifies a robot's inertial parameters and friction from its motion, and then the payload that it carries.

The robot is a simulated Panda. The program knows a CAD model whose bodies are wrong by about 20 %. It proceeds as on a
real robot:

1. It searches for an exciting motion: a Fourier series for which the regressor is well conditioned.
2. It smooths the measured positions with the same series, which also gives velocities and accelerations.
3. It finds the base parameters by linear least squares. Base parameters are the combinations of parameters on which the
   torques depend.
4. It finds inertias that a real body can have: the log-Cholesky parameters θ of each body, near the CAD model.
   Source: Rucker and Wensing, Smooth parameterization of rigid-body inertia (2022).
5. It repeats the motion with a payload, and finds the ten parameters of the payload in the same way.

The plot `identify.png` shows torques of another motion and the base parameters.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import condyle
from condyle import Inertia, Model, inertial_parameters

Array = NDArray[np.float64]

PERIOD, HARMONICS, SAMPLES = 10.0, 5, 500
"""Duration of the motion (s), number of harmonics of its Fourier series, and number of samples."""
NOISE_Q, NOISE_TAU = 1e-4, 0.05
"""Standard deviations of measured positions (rad) and of measured torques (as a fraction of a joint's mean torque)."""
SMOOTHING = 0.02
"""The speed over which the sign of friction changes (rad/s)."""


class Motion(NamedTuple):
    """Positions, velocities and accelerations, (SAMPLES, nv) each."""

    q: Array
    v: Array
    a: Array


class Identified(NamedTuple):
    """The result of `identify`."""

    inertias: list[Inertia]
    """The inertia of each moving body, physically consistent."""
    damping: Array
    friction: Array
    base: Array
    """The base parameters of least squares, in the coordinates of `base_map`."""
    deviation: Array
    """The standard deviations of the base parameters."""


def series() -> tuple[Array, Array, Array]:
    """Returns the functions of a Fourier series, 1 and sines and cosines, at all samples, and two time derivatives."""
    t = np.linspace(0.0, PERIOD, SAMPLES, endpoint=False)[:, None]
    w = 2.0 * np.pi / PERIOD * np.arange(1, HARMONICS + 1)
    sin, cos, one = np.sin(w * t), np.cos(w * t), np.ones_like(t)
    return (
        np.hstack([one, sin, cos]),
        np.hstack([0.0 * one, w * cos, -w * sin]),
        np.hstack([0.0 * one, -(w**2) * sin, -(w**2) * cos]),
    )


def motion(coefficients: Array) -> Motion:
    return Motion(*(part @ coefficients for part in series()))


def exciting(model: Model, seed: int, candidates: int = 20) -> Motion:
    """Returns the motion with the best conditioned base regressor among random series within the robot's limits."""
    rng, limits = np.random.default_rng(seed), model.limits
    low, high = np.maximum(limits.lower, -2.5), np.minimum(limits.upper, 2.5)
    best, found = np.inf, None
    for _ in range(candidates):
        shape = rng.standard_normal((1 + 2 * HARMONICS, model.nv))
        shape[0] = 0.0
        q, v, _ = motion(shape)
        reach, speed = np.abs(q).max(0), np.abs(v).max(0)
        size = np.minimum(0.45 * (high - low) / reach, 0.9 * limits.velocity / speed)
        shape *= size
        shape[0] = 0.5 * (low + high)
        tried = motion(shape)
        regressor = torque_regressor(model, tried)[:, :: 1 + SAMPLES // 100]
        columns = regressor.reshape(-1, regressor.shape[2])
        singular = np.linalg.svd(columns, compute_uv=False)
        condition = singular[0] / singular[singular > 1e-9 * singular[0]][-1]
        if condition < best:
            best, found = condition, tried
    assert found is not None
    return found


def torque_regressor(model: Model, motion: Motion) -> Array:
    """Returns the regressor Y of all samples, (nv, SAMPLES, 10 (nbodies − 1)): τ = Y π without friction."""
    return condyle.joint_torque_regressor(model, condyle.Data(model), *motion).swapaxes(0, 1)


def friction_regressor(motion: Motion) -> Array:
    """Returns the regressor of damping and friction, (nv, SAMPLES, 2 nv): τ = d v + f tanh(v/ε)."""
    nv = motion.v.shape[1]
    result = np.zeros((nv, len(motion.v), 2 * nv))
    for k in range(nv):
        result[k, :, k], result[k, :, nv + k] = motion.v[:, k], np.tanh(motion.v[:, k] / SMOOTHING)
    return result


def torques(model: Model, motion: Motion) -> Array:
    """Returns the motors' torques, (SAMPLES, nv): inverse dynamics minus damping and friction, which brake."""
    return condyle.rnea(model, condyle.Data(model), *motion) - condyle.passive_torque(model, *motion[:2], SMOOTHING)


def measure(model: Model, motion: Motion, seed: int) -> tuple[Motion, Array, Array]:
    """Simulates a measurement: (smoothed motion, torques, standard deviations of the joints' torques)."""
    rng, exact = np.random.default_rng(seed), torques(model, motion)
    deviation = NOISE_TAU * np.abs(exact).mean(0)
    tau = exact + deviation * rng.standard_normal(exact.shape)
    q = motion.q + NOISE_Q * rng.standard_normal(motion.q.shape)
    functions = series()
    coefficients = np.linalg.lstsq(functions[0], q, rcond=None)[0]
    return Motion(*(part @ coefficients for part in functions)), tau, deviation


def base_map(model: Model, motion: Motion) -> Array:
    """Returns the matrix B with orthonormal rows that maps parameters π to base parameters B π: the row space of Y."""
    regressor = torque_regressor(model, motion)
    _, singular, rows = np.linalg.svd(regressor.reshape(-1, regressor.shape[2]), full_matrices=False)
    return rows[singular > 1e-9 * singular[0]]


def parameters(theta: Array) -> tuple[Array, Array]:
    """Returns the parameters π(θ) of all bodies and ∂π/∂θ, block-diagonal, for log-Cholesky parameters (bodies, 10)."""
    blocks = [inertial_parameters.log_cholesky_jacobian(part) for part in theta]
    pi = [inertial_parameters.from_inertia(inertial_parameters.from_log_cholesky(part)) for part in theta]
    slope = np.zeros((theta.size, theta.size))
    for k, block in enumerate(blocks):
        slope[10 * k : 10 * k + 10, 10 * k : 10 * k + 10] = block
    return np.concatenate(pi), slope


def consistent(Y: Array, extra: Array, tau: Array, prior: Array, confidence: float) -> tuple[Array, Array]:
    """Minimises |Y π(θ) + extra c − τ|² + confidence² |θ − prior|² by Levenberg and Marquardt: (θ, c).

    All rows are divided by their standard deviations. prior: log-Cholesky parameters (bodies, 10).
    """
    theta, c, damping = prior.copy(), np.zeros(extra.shape[1]), 1e-3

    def residual(theta: Array, c: Array) -> tuple[Array, Array]:
        pi, slope = parameters(theta)
        r = np.concatenate([Y @ pi + extra @ c - tau, confidence * (theta - prior).ravel()])
        J = np.vstack([
            np.hstack([Y @ slope, extra]),
            np.hstack([confidence * np.eye(theta.size), np.zeros((theta.size, c.size))]),
        ])  # fmt: skip
        return r, J

    r, J = residual(theta, c)
    for _ in range(200):
        H, g = J.T @ J, J.T @ r
        step = -np.linalg.solve(H + damping * np.diag(np.diag(H)), g)
        trial = theta + step[: theta.size].reshape(theta.shape), c + step[theta.size :]
        other, slope = residual(*trial)
        if other @ other < r @ r:
            done = r @ r - other @ other < 1e-12 * (r @ r)
            (theta, c), r, J, damping = trial, other, slope, max(damping / 5.0, 1e-12)
            if done:
                break
        else:
            damping *= 5.0
    return theta, c


def rows(motion: Motion, Y: Array, tau: Array, deviation: Array) -> tuple[Array, Array, Array]:
    """Returns (Y, friction regressor, τ) with one row for each sample of each joint, divided by its deviation."""
    scale = np.repeat(1.0 / deviation, len(tau))
    F = friction_regressor(motion)
    return (
        scale[:, None] * Y.reshape(len(scale), -1),
        scale[:, None] * F.reshape(len(scale), -1),
        scale * tau.T.ravel(),
    )


def identify(cad: Model, motion: Motion, tau: Array, deviation: Array) -> Identified:
    """Identifies inertias, damping and friction from measured torques, with the CAD model as prior."""
    Y, F, y = rows(motion, torque_regressor(cad, motion), tau, deviation)
    B = base_map(cad, motion)
    regressor = np.hstack([Y @ B.T, F])
    base = np.linalg.lstsq(regressor, y, rcond=None)[0][: len(B)]
    covariance = np.linalg.inv(regressor.T @ regressor)
    prior = np.stack([inertial_parameters.log_cholesky(body) for body in cad.inertias[1:]])
    theta, c = consistent(Y, F, y, prior, confidence=1.0)
    bodies = [inertial_parameters.from_log_cholesky(part) for part in theta]
    return Identified(bodies, c[: cad.nv], c[cad.nv :], base, np.sqrt(np.diag(covariance))[: len(B)])


def identify_payload(robot: Model, motion: Motion, tau: Array, deviation: Array) -> Inertia:
    """Identifies the inertia of a payload on the last body, in the frame of this body, from torques with payload."""
    unloaded = torques(robot, motion)
    Y = torque_regressor(robot, motion)[:, :, -10:]
    scaled, _, y = rows(motion, Y, tau - unloaded, deviation)
    guess = Inertia.from_com(0.5, [0.0, 0.0, 0.1], 1e-3 * np.eye(3))
    prior = inertial_parameters.log_cholesky(guess)[None]
    theta, _ = consistent(scaled, np.zeros((len(y), 0)), y, prior, confidence=0.1)
    return inertial_parameters.from_log_cholesky(theta[0])


def with_bodies(model: Model, bodies: list[Inertia]) -> Model:
    return model.with_inertias([model.inertias[0], *bodies])


def robots() -> tuple[Model, Model, Model, Inertia]:
    """Returns (the real robot, the real robot with payload, the CAD model, the payload)."""
    panda = condyle.load("panda")
    fingers = [name for name in panda.names if "finger" in name]
    real = panda.lock(fingers, condyle.neutral(panda)) if fingers else panda
    nv, rng = real.nv, np.random.default_rng(5)
    real = real.with_damping(rng.uniform(0.3, 1.0, nv)).with_friction(rng.uniform(0.3, 0.9, nv))
    payload = Inertia.from_com(1.8, [0.02, -0.03, 0.16], np.diag([8e-3, 7e-3, 5e-3]))
    loaded = with_bodies(real, [*real.inertias[1:-1], real.inertias[-1] + payload])
    wrong = []
    for body in real.inertias[1:]:
        theta = inertial_parameters.log_cholesky(body) + np.r_[0.1 * rng.standard_normal(4), np.zeros(6)]
        theta[4:] *= 1.0 + 0.2 * rng.standard_normal(6)
        wrong.append(inertial_parameters.from_log_cholesky(theta))
    return real, loaded, with_bodies(real, wrong), payload


class Report(NamedTuple):
    """Figures of the whole program."""

    errors: Array
    """Errors of the base parameters, divided by their standard deviations."""
    torque: dict[str, float]
    """Errors of torques on another motion, as a fraction of the torques: CAD model, and identified model."""
    payload: Inertia
    mass_error: float
    """The relative error of the payload's mass."""
    com_error: float
    """The error of the payload's centre of mass, relative to its distance."""


def run(plot: bool = True) -> Report:
    real, loaded, cad, payload = robots()
    excitation = exciting(cad, seed=1)
    smooth, tau, deviation = measure(real, excitation, seed=2)
    found = identify(cad, smooth, tau, deviation)
    model = with_bodies(cad, found.inertias).with_damping(found.damping).with_friction(found.friction)

    B = base_map(cad, smooth)
    errors = (found.base - B @ real.inertial_parameters) / found.deviation
    other = exciting(cad, seed=7, candidates=3)
    exact = torques(real, other)
    predicted = {"CAD model": torques(cad, other), "identified": torques(model, other)}
    torque = {name: float(np.linalg.norm(t - exact) / np.linalg.norm(exact)) for name, t in predicted.items()}

    carried, tau_loaded, deviation = measure(loaded, excitation, seed=3)
    body = identify_payload(model, carried, tau_loaded, deviation)
    mass_error = float(abs(body.mass / payload.mass - 1.0))
    com_error = float(np.linalg.norm(body.com - payload.com) / np.linalg.norm(payload.com))
    if plot:
        draw(other, exact, predicted, errors)
    return Report(errors, torque, body, mass_error, com_error)


def draw(motion: Motion, exact: Array, predicted: dict[str, Array], errors: Array) -> None:
    """Writes `identify.png`, if Matplotlib is installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        print("no plot: pip install matplotlib")
        return
    t = np.linspace(0.0, PERIOD, SAMPLES, endpoint=False)
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.6), layout="constrained")
    for axis, joint in zip(axes, (1, 3), strict=False):
        axis.plot(t, exact[:, joint], "k", lw=3, alpha=0.3, label="real robot")
        for (name, tau), style in zip(predicted.items(), ("C1--", "C0"), strict=True):
            axis.plot(t, tau[:, joint], style, lw=1, label=name)
        axis.set(xlabel="time (s)", ylabel="torque (N m)", title=f"joint {joint + 1}, another motion")
    axes[0].legend()
    axes[2].bar(np.arange(len(errors)), errors)
    axes[2].set(xlabel="base parameter", ylabel="error / standard deviation", title="base parameters")
    figure.savefig("identify.png", dpi=110)
    pyplot.close(figure)


def main() -> None:
    report = run()
    print(f"{len(report.errors)} base parameters, {np.mean(np.abs(report.errors) < 2.0):.0%} within two deviations")
    for name, error in report.torque.items():
        print(f"torques of another motion, {name}: error {error:.1%}")
    body = report.payload
    print(
        f"payload: {body.mass:.3f} kg (error {report.mass_error:.2%}), centre of mass {np.round(body.com, 4)} m", end=""
    )
    print(f" (error {report.com_error:.2%})")


if __name__ == "__main__":
    main()
