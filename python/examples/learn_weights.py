"""Learns the weights of a controller's cost from an expert's motions, by the adjoint of the solutions, with PyTorch.

An expert moves a two-link arm by a controller with unknown weights. The learner has the same kind of cost and
other weights w. It solves its problem for each recorded motion and compares positions and torques with the expert's:

    L(w) = Σ ‖q(w) − q*‖² / σ_q² + Σ ‖u(w) − u*‖² / σ_u²,    (x(w), u(w)) = argmin of the problem with weights w

`condyle.torch.ProblemLayer` differentiates the solution exactly, so an optimiser of PyTorch learns the logarithms of
the weights. Each evaluation solves all motions from their last solutions. The recordings have noise. Afterwards the
learner predicts motions to new goals. The plot `learn_weights.png` shows the loss, the weights and these motions.

A common factor of all weights does not change a solution, so the weight "reach" is fixed. The final velocity's weight
hardly changes the motions, so the noise hides its exact value.
"""

import time
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

import condyle
from condyle import Inertia, Joint, Model, ModelBuilder
from condyle.optimal import Cost, FreeDynamics, Problem, Residual
from condyle.torch import ProblemLayer

Array = NDArray[np.float64]
DT, KNOTS = 0.05, 20
"""Duration of a knot (s), and number of knots."""
NAMES = ["posture", "velocity", "effort", "final_velocity"]
"""The costs whose weights are learned."""
EXPERT = {"posture": 0.3, "velocity": 0.5, "effort": 0.02, "final_velocity": 3.0}
FIRST = {"posture": 0.03, "velocity": 0.05, "effort": 0.2, "final_velocity": 0.3}
REACH = 10.0
NOISE_Q, NOISE_U = 0.005, 0.05
"""Standard deviations of the recorded positions (rad) and torques (N m)."""


def arm() -> Model:
    """Returns an arm with two links of 0.5 m in a vertical plane."""
    builder, body, at = ModelBuilder("two links"), condyle.WORLD, np.eye(4)
    for name in ("upper", "lower"):
        link = Inertia.from_com(1.0, [0.0, 0.0, -0.25], np.diag([0.02, 0.02, 0.001]))
        body = builder.body(name, body, Joint.revolute([0, 1, 0]), at, link)
        at = np.eye(4)
        at[2, 3] = -0.5
    builder.frame("hand", body, at)
    return builder.build()


def problem(robot: Model, weights: dict[str, float]) -> Problem:
    """Returns the problem of a motion, with the goal and the initial state of no motion in particular."""
    still = np.zeros(4)
    parts = np.eye(4)

    def pick(rows: slice) -> condyle.optimal.Activation:
        return condyle.optimal.Activation.weighted(parts[rows].sum(0))

    reach = Cost("reach", REACH, Residual.frame_translation(robot, "hand", [0.5, 0.0, -0.5]))
    costs = [
        reach,
        Cost("posture", weights["posture"], Residual.state(still), pick(slice(0, 2))),
        Cost("velocity", weights["velocity"], Residual.state(still), pick(slice(2, 4))),
        Cost("effort", weights["effort"], Residual.control(np.zeros(2))),
    ]
    last = [reach, Cost("final_velocity", weights["final_velocity"], Residual.state(still), pick(slice(2, 4)))]
    bounds = {"lower": np.full(2, -9.0), "upper": np.full(2, 9.0)}
    knot = FreeDynamics(robot, DT, costs, **bounds)
    return Problem(still, [knot], [0] * KNOTS, FreeDynamics(robot, None, last))


class Motions(NamedTuple):
    """Initial states (n, 4), goals (n, 3), and the positions and torques of the expert."""

    x0: Any
    goal: Any
    q: Any
    u: Any


def record(count: int, seed: int, noise: float = 1.0) -> Motions:
    """Records motions of the expert between random configurations."""
    robot, rng = arm(), np.random.default_rng(seed)
    low, high = [-1.0, -1.8], [1.0, -0.4]
    starts, ends = rng.uniform(low, high, (count, 2)), rng.uniform(low, high, (count, 2))
    poses = condyle.frame_placement(robot, condyle.Data(robot), ends, "hand")
    x0 = torch.tensor(np.hstack([starts, np.zeros((count, 2))]))
    goal = torch.tensor(np.ascontiguousarray(poses[:, :3, 3]))
    xs, us = ProblemLayer(problem(robot, EXPERT), ["x0", "target/reach"])(x0, goal)
    q = xs[..., :2] + noise * NOISE_Q * torch.tensor(rng.standard_normal((count, KNOTS + 1, 2)))
    return Motions(x0, goal, q, us + noise * NOISE_U * torch.tensor(rng.standard_normal(us.shape)))


class Report(NamedTuple):
    """Losses and weights of all evaluations; motions to new goals before and after learning."""

    losses: list[float]
    weights: Array
    """The weights in the order of `NAMES`, one row for each evaluation."""
    new: Motions
    before: Array
    """Predicted positions with the first weights, (n, N + 1, 2)."""
    after: Array
    seconds: float
    """Duration of the training (s)."""

    @property
    def errors(self) -> tuple[float, float]:
        """The root mean square errors (rad) of predicted positions, before and after."""
        expert = self.new.q.numpy()
        before, after = (float(np.sqrt(np.mean((q - expert) ** 2))) for q in (self.before, self.after))
        return before, after


def run(motions: int = 12, iterations: int = 80) -> Report:
    layer = ProblemLayer(problem(arm(), FIRST), ["x0", "target/reach", *(f"weight/{name}" for name in NAMES)])
    data, new = record(motions, seed=1), record(6, seed=2, noise=0.0)
    logs = torch.tensor([FIRST[name] for name in NAMES], dtype=torch.float64).log().requires_grad_()
    optimiser = torch.optim.LBFGS([logs], lr=0.3, max_iter=iterations, line_search_fn="strong_wolfe")
    losses, weights, start = [], [], time.perf_counter()

    def evaluate() -> Any:
        xs, us = layer(data.x0, data.goal, *logs.exp())
        error = ((xs[..., :2] - data.q) / NOISE_Q).square().mean() + ((us - data.u) / NOISE_U).square().mean()
        losses.append(error.item())
        weights.append(logs.exp().tolist())
        optimiser.zero_grad()
        objective = error.log()  # the same minimum, with steps that suit losses of all sizes
        objective.backward()
        return objective

    optimiser.step(evaluate)
    seconds = time.perf_counter() - start
    with torch.no_grad():
        layer.forget()
        found = logs.exp()
        weights.append(found.tolist())
        first = torch.tensor([FIRST[name] for name in NAMES])
        before, after = (layer(new.x0, new.goal, *w)[0][..., :2].numpy() for w in (first, found))
    return Report(losses, np.array(weights), new, before, after, seconds)


def draw(report: Report) -> None:
    """Writes `learn_weights.png`, if Matplotlib is installed."""
    try:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
    except ImportError:
        print("no plot: pip install matplotlib")
        return
    figure, axes = pyplot.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    axes[0].semilogy(report.losses)
    axes[0].axhline(2.0, color="gray", linestyle=":", label="noise alone")
    axes[0].set(xlabel="evaluation", title="loss")
    axes[0].legend()
    for k, name in enumerate(NAMES):
        axes[1].semilogy(report.weights[:, k], f"C{k}", label=name)
        axes[1].axhline(EXPERT[name], color=f"C{k}", linestyle=":")
    axes[1].set(xlabel="evaluation", title="weights (dotted: the expert's)")
    axes[1].legend(fontsize=8)
    times = DT * np.arange(KNOTS + 1)
    for i in range(3):
        for values, style in ((report.new.q[i], "k:"), (report.before[i], "C1--"), (report.after[i], "C0-")):
            axes[2].plot(times, values[:, 0], style, linewidth=2 if style == "k:" else 1)
    for style, label in (("k:", "expert"), ("C1--", "first weights"), ("C0-", "learned weights")):
        axes[2].plot([], [], style, label=label)
    axes[2].set(xlabel="time (s)", title="new motions: first joint (rad)")
    axes[2].legend(fontsize=8)
    figure.savefig("learn_weights.png", dpi=110)
    pyplot.close(figure)


def main() -> None:
    report = run()
    print(f"{len(report.losses)} evaluations in {report.seconds:.0f} s: loss {report.losses[0]:.3g}", end="")
    print(f" -> {report.losses[-1]:.3g}")
    for name, found in zip(NAMES, report.weights[-1], strict=True):
        print(f"weight {name}: {FIRST[name]:.3g} -> {found:.3g}, the expert has {EXPERT[name]:.3g}")
    before, after = report.errors
    print(f"error of new motions: {before:.4f} rad with the first weights, {after:.4f} rad with the learned ones")
    draw(report)


if __name__ == "__main__":
    main()
