"""Learns the torques that a robot's model lacks, by a small network inside the dynamics, with JAX on a CPU.

The simulated real arm has friction, elastic cables and a payload that its model does not contain. A network adds
torques n(q, v) to the model, and both are integrated together:

    vₜ₊₁ = vₜ + Δt aba(qₜ, vₜ, τₜ + n(qₜ, vₜ)),    qₜ₊₁ = qₜ ⊕ Δt vₜ₊₁

The loss is the error of predicted states along short measured motions. Its gradient goes through all steps, by the
exact derivatives of `aba` and `integrate` in `condyle.jax`. Accelerations are not measured. After training, the network
is tested in two ways: it predicts longer motions, and a computed-torque controller uses it to track a motion of the
real arm. The plot `learn_residual.png` shows the loss, the predictions and the tracking errors.

The same program works for any model, also with quaternions: the network's inputs are q and v.
"""

import itertools
import os
import time
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp

import condyle
import condyle.jax
from condyle import Inertia, Model

Array = NDArray[np.float64]
DT, STEPS, HIDDEN = 0.02, 8, 64
"""Time step (s), number of steps of a prediction in training, and number of units in each layer."""


def robots() -> tuple[Model, Model]:
    """Returns the model, and the model of the real arm with its payload."""
    arm = condyle.robots.arm7()
    nominal = arm.with_armature(np.full(arm.nv, 0.15))  # rotors behind gears
    payload = Inertia.from_com(0.7, [0.02, 0.01, 0.08], 2e-3 * np.eye(3))
    return nominal, nominal.with_inertias([*nominal.inertias[:-1], nominal.inertias[-1] + payload])


def hidden_torque(q: Array, v: Array) -> Array:
    """Returns the torques of friction and elastic cables, which no model of this program contains."""
    joints = np.arange(q.shape[-1])
    friction = 0.5 * np.tanh(v / 0.2) + 0.4 * v
    return -friction - (1.5 + 0.2 * joints) * np.sin(q + 0.3 * joints)


def real_step(real: Model, data: condyle.Data, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
    """Returns the next state of the real arm, which integrates with steps of DT / 10."""
    for _ in range(10):
        v = v + 0.1 * DT * condyle.aba(real, data, q, v, tau + hidden_torque(q, v))
        q = condyle.integrate(real, q, 0.1 * DT * v)
    return q, v


class Recorded(NamedTuple):
    """Motions of the real arm: states at STEPS + 1 times and torques of STEPS steps, motion after motion."""

    q: Array
    v: Array
    tau: Array


def record(motions: int, steps: int, seed: int) -> Recorded:
    """Records motions of the real arm, which follows random sines by a weak controller, with noise of encoders."""
    nominal, real = robots()
    rng, nv = np.random.default_rng(seed), nominal.nv
    data, model_data = condyle.Data(real), condyle.Data(nominal)
    size, rate = rng.uniform(0.2, 1.0, (motions, nv)), rng.uniform(0.5, 4.0, (motions, nv))
    q = rng.uniform(-1.5, 1.5, (motions, nv))
    center, v, qs, vs, taus = q.copy(), np.zeros((motions, nv)), [], [], []
    for k in range(steps + 1):
        qs.append(q + 1e-4 * rng.standard_normal(q.shape))
        vs.append(v + 1e-3 * rng.standard_normal(v.shape))
        phase = rate * k * DT
        target, speed = center + size * np.sin(phase), size * rate * np.cos(phase)
        tau = condyle.rnea(nominal, model_data, q, v, 20.0 * (target - q) + 6.0 * (speed - v))
        taus.append(tau)
        q, v = real_step(real, data, q, v, tau)
    return Recorded(*(np.stack(part, 1) for part in (qs, vs, taus)))


def windows(motions: Recorded) -> Recorded:
    """Returns parts of STEPS steps of the motions."""
    starts = range(0, motions.q.shape[1] - STEPS, STEPS)
    return Recorded(
        np.concatenate([motions.q[:, s : s + STEPS + 1] for s in starts]),
        np.concatenate([motions.v[:, s : s + STEPS + 1] for s in starts]),
        np.concatenate([motions.tau[:, s : s + STEPS] for s in starts]),
    )


def network(weights: Any, q: Any, v: Any) -> Any:
    """Returns the torques n(q, v) of a network with two hidden layers."""
    h = jnp.concatenate([jnp.sin(q), jnp.cos(q), v, jnp.tanh(10.0 * v)], -1)
    for W, b in weights[:-1]:
        h = jnp.tanh(h @ W + b)
    W, b = weights[-1]
    return h @ W + b


def initial_weights(nq: int, nv: int, seed: int = 0) -> Any:
    """Returns weights with which the network returns zeros."""
    rng, sizes = np.random.default_rng(seed), (2 * nq + 2 * nv, HIDDEN, HIDDEN, nv)
    pairs = list(itertools.pairwise(sizes))
    scales = [1.0 / np.sqrt(a) for a, _ in pairs[:-1]] + [0.0]
    return [
        (jnp.asarray(s * rng.standard_normal(pair), jnp.float32), jnp.zeros(pair[1], jnp.float32))
        for pair, s in zip(pairs, scales, strict=True)
    ]


def predict(robot: condyle.jax.Dynamics, weights: Any, q: Any, v: Any, tau: Any) -> tuple[Any, Any]:
    """Returns the predicted states after each step, (steps, batch, n), for torques (batch, steps, nv)."""

    def step(state: Any, tau: Any) -> Any:
        q, v = state
        v = v + DT * robot.aba(q, v, tau + network(weights, q, v))
        q = robot.integrate(q, DT * v)
        return (q, v), (q, v)

    return jax.lax.scan(step, (q, v), jnp.swapaxes(tau, 0, 1))[1]  # type: ignore[no-any-return]


def loss(robot: condyle.jax.Dynamics, weights: Any, q: Any, v: Any, tau: Any) -> Any:
    """Returns the mean square error of predictions: positions in units of 0.01 rad, velocities of 0.1 rad/s."""
    found = predict(robot, weights, q[:, 0], v[:, 0], tau)
    errors = [(robot.difference(jnp.swapaxes(q[:, 1:], 0, 1), found[0])) / 0.01]
    errors.append((found[1] - jnp.swapaxes(v[:, 1:], 0, 1)) / 0.1)
    return sum((e**2).mean() for e in errors)


def train(robot: condyle.jax.Dynamics, data: Recorded, iterations: int, batch: int = 128) -> tuple[Any, list[float]]:
    """Returns the trained weights and the losses, by Adam with a decreasing rate."""
    arrays = [jnp.asarray(a, jnp.float32) for a in data]
    weights = initial_weights(robot.model.nq, robot.model.nv)
    moments = [jax.tree.map(jnp.zeros_like, weights) for _ in range(2)]
    slope, rng, losses = jax.value_and_grad(partial(loss, robot)), np.random.default_rng(0), []

    @jax.jit
    def update(weights: Any, moments: Any, k: Any, *sample: Any) -> Any:
        value, g = slope(weights, *sample)
        first = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, moments[0], g)
        second = jax.tree.map(lambda m, g: 0.99 * m + 0.01 * g**2, moments[1], g)
        rate = 6e-3 * 0.5 * (1.0 + jnp.cos(jnp.pi * k / iterations))

        def change(w: Any, m: Any, s: Any) -> Any:
            return w - rate * (m / (1.0 - 0.9 ** (k + 1))) / (jnp.sqrt(s / (1.0 - 0.99 ** (k + 1))) + 1e-8)

        return jax.tree.map(change, weights, first, second), [first, second], value

    for k in range(iterations):
        chosen = rng.choice(len(arrays[0]), batch, replace=False)
        weights, moments, value = update(weights, moments, float(k), *(a[chosen] for a in arrays))
        losses.append(float(value))
    return weights, losses


def prediction_errors(robot: condyle.jax.Dynamics, weights: Any, motions: Recorded) -> Array:
    """Returns the root mean square errors of predicted positions (rad) after each step."""
    arrays = [jnp.asarray(a, jnp.float32) for a in motions]
    found = predict(robot, weights, arrays[0][:, 0], arrays[1][:, 0], arrays[2][:, :-1])[0]
    d = robot.difference(arrays[0][:, 1:], jnp.swapaxes(found, 0, 1))
    return np.asarray(jnp.sqrt((d**2).mean((0, 2))))


def tracking_errors(weights: Any, seconds: float = 4.0) -> Array:
    """Returns the errors (rad) of computed-torque control on the real arm, the mean over the joints at each step."""
    nominal, real = robots()
    data, model_data, nv = condyle.Data(real), condyle.Data(nominal), nominal.nv
    joints, errors = np.arange(nv), []
    correction = jax.jit(network)
    q, v = 0.3 * np.ones(nv), np.zeros(nv)
    for k in range(int(seconds / DT)):
        phase = 1.5 * k * DT + 0.4 * joints
        target, speed = 0.3 + 0.6 * (1.0 - np.cos(phase)), 0.9 * np.sin(phase)
        wish = 1.35 * np.cos(phase) + 25.0 * (target - q) + 10.0 * (speed - v)
        tau = condyle.rnea(nominal, model_data, q, v, wish)
        tau -= np.float64(correction(weights, jnp.asarray(q, jnp.float32), jnp.asarray(v, jnp.float32)))
        errors.append(np.sqrt(((target - q) ** 2).mean()))
        q, v = real_step(real, data, q, v, tau)
    return np.array(errors)


class Report(NamedTuple):
    """Losses of the training; errors without and with the network."""

    losses: list[float]
    prediction: tuple[Array, Array]
    tracking: tuple[Array, Array]
    seconds: float
    """Duration of the training (s)."""


def run(iterations: int = 600) -> Report:
    nominal, _ = robots()
    robot = condyle.jax.Dynamics(nominal)
    data, other = windows(record(200, 10 * STEPS, seed=1)), record(40, 20, seed=2)
    start = time.perf_counter()
    weights, losses = train(robot, data, iterations)
    seconds = time.perf_counter() - start
    zero = initial_weights(nominal.nq, nominal.nv)
    prediction = prediction_errors(robot, zero, other), prediction_errors(robot, weights, other)
    return Report(losses, prediction, (tracking_errors(zero), tracking_errors(weights)), seconds)


def draw(report: Report) -> None:
    """Writes `learn_residual.png`, if Matplotlib is installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        print("no plot: pip install matplotlib")
        return
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.6), layout="constrained")
    axes[0].semilogy(report.losses)
    axes[0].set(xlabel="iteration", title="loss")
    parts = (report.prediction, "predicted positions, error (rad)"), (report.tracking, "tracking, error (rad)")
    for axis, ((before, after), title) in zip(axes[1:], parts, strict=True):
        axis.semilogy(DT * np.arange(len(before)), before, "C1--", label="model")
        axis.semilogy(DT * np.arange(len(after)), after, "C0", label="model and network")
        axis.set(xlabel="time (s)", title=title)
        axis.legend()
    figure.savefig("learn_residual.png", dpi=110)
    pyplot.close(figure)


def main() -> None:
    report = run()
    print(f"{len(report.losses)} iterations in {report.seconds:.0f} s: loss {report.losses[0]:.3g}", end="")
    print(f" -> {np.mean(report.losses[-20:]):.3g}")
    before, after = (e[-1] for e in report.prediction)
    print(f"error of predicted positions after 0.4 s: {before:.4f} rad without the network, {after:.4f} rad with")
    before, after = (np.sqrt(np.mean(e[len(e) // 2 :] ** 2)) for e in report.tracking)
    print(f"error of tracking: {before:.4f} rad without the network, {after:.4f} rad with")
    draw(report)


if __name__ == "__main__":
    main()
