"""Model predictive path integral control: a cart-pole swings up, and an arm moves around an obstacle.

Each tick samples controls around the last plan, simulates them, and averages them with the weights exp(−J / λ), where J
is the cost and λ the temperature (Williams, Aldrich and Theodorou 2017).
"""

import numpy as np

import condyle
from condyle.optimal import Activation, Cost, FreeDynamics, FreeInverseDynamics, Problem, Residual, Sphere, rollout_many


def control(problem, us, spread, temperature, ticks, samples=512):
    """Returns the states of a closed loop. us: the first plan; spread: standard deviations of the samples."""
    random, xs = np.random.default_rng(0), [problem.x0]
    for _ in range(ticks):
        noise = spread * np.repeat(random.normal(size=(samples, len(us) // 5, us.shape[1])), 5, axis=1)
        noise[0] = 0.0  # the plan itself
        costs = rollout_many(problem, us + noise, xs[-1], states=False, threads=2).costs
        weights = np.exp((costs.min() - costs) / temperature)
        us = us + np.tensordot(weights / weights.sum(), noise, 1)
        xs.append(rollout_many(problem, us[None], xs[-1]).xs[0, 1])  # the robot moves as its model does
        us = np.concatenate([us[1:], us[-1:]])
    return np.array(xs)


def swing_up():
    """Returns the states of a cart with a pole that hangs at the angle 0 and stands at ±π."""
    builder, rod = condyle.ModelBuilder("cart-pole"), 1e-3 * np.eye(3)
    inertias = [condyle.Inertia.from_com(1.0, np.zeros(3), rod), condyle.Inertia.from_com(0.2, [0.0, 0.0, -0.5], rod)]
    cart = builder.body("cart", condyle.WORLD, condyle.Joint.prismatic([1.0, 0.0, 0.0]), None, inertias[0])
    builder.body("pole", cart, condyle.Joint.revolute([0.0, 1.0, 0.0]), None, inertias[1])
    tip = np.eye(4)
    tip[2, 3] = -0.5
    model = builder.build().with_frame("tip", "pole", tip)
    up = Cost("up", 20.0, Residual.frame_translation(model, "tip", [0.0, 0.0, 0.5]))
    slow = Cost("slow", 1.0, Residual.state(np.zeros(4)), Activation.weighted([0.0, 0.0, 0.1, 0.2]))
    knot = FreeDynamics(model, 0.02, [up, slow], actuation=np.eye(2, 1), lower=[-15.0], upper=[15.0])
    problem = Problem(np.zeros(4), [knot], [0] * 50, FreeDynamics(model, None, [up, slow]))
    return control(problem, np.zeros((50, 1)), 6.0, 0.5, 250)


def avoid(goal=(0.4, -0.4, 0.25), ball=(0.55, 0.0, 0.25)):
    """Returns the distances of an arm's tool from a goal, and from a ball on the way, at all knots (m)."""
    arm, x0 = condyle.robots.arm7(), np.r_[0.8, 0.2, 0.0, 1.7, 0.0, 1.24, 0.0, np.zeros(7)]
    apart = Residual.distances(arm, [(Sphere([0.0, 0.0, 0.0], 0.05, "tool"), Sphere(ball, 0.1))])
    clear = Cost("clear", 1e5, apart, Activation.barrier([0.02], [np.inf]))
    reach = Cost("reach", 50.0, Residual.frame_translation(arm, "tool", goal))
    slow = Cost("slow", 0.5, Residual.state(x0), Activation.weighted(np.r_[np.zeros(7), np.ones(7)]))
    knot, end = FreeInverseDynamics(arm, 0.02, [clear, reach, slow]), FreeDynamics(arm, None, [clear, reach, slow])
    problem = Problem(x0, [knot], [0] * 25, end)  # controls are accelerations
    xs = control(problem, np.zeros((25, 7)), 5.0, 0.1, 150)
    places = condyle.frame_placement(arm, condyle.Data(arm), xs[:, :7], "tool")[:, :3, 3]
    return np.linalg.norm(places - goal, axis=1), np.linalg.norm(places - ball, axis=1) - 0.15


if __name__ == "__main__":
    print(f"pole: {np.abs(swing_up()[-1, 1]):.2f} rad after 5 s")
    to_goal, to_ball = avoid()
    print(f"arm: {to_goal[-1]:.3f} m from the goal after 3 s, and never nearer to the ball than {to_ball.min():.3f} m")
