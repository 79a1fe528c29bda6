"""Walking on points as an optimal control problem: phases of stance and steps, one after the other."""

import numpy as np

import condyle
from condyle import ContactConstraint
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    ImpulseDynamics,
    Problem,
    Residual,
)

FRICTION = 0.7
HOLD = 40.0  # decay rate of a foot's slip (1/s)


class Gait:
    """A gait that is built phase by phase: the knots added so far, and the positions of feet and centre of mass after
    the last knot.
    """

    def __init__(self, model, q, feet, dt):
        data = condyle.Data(model)
        self.model, self.feet, self.dt = model, list(feet), dt
        self.places = np.array([condyle.frame_placement(model, data, q, foot)[:3, 3] for foot in feet])
        ground = self.places[0, 2]
        self.com, self.x0 = condyle.com(model, data, q), np.r_[q, np.zeros(model.nv)]
        for height in self.places[:, 2], self.com[2:], self.x0[2:3]:
            height -= ground  # the feet are at height 0
        self.models, self.knot_models, self.us, self.times, self.touches = [], [], [], [0.0], []

    def _contacts(self, feet, kd):
        names = [self.feet[k] for k in feet]
        return {name: ContactConstraint(name, "point", None, "local_world_aligned", kd=kd) for name in names}

    def _rest(self, *weights):
        """Returns a cost of deviations from the posture, with weights for the trunk's position, the trunk's rotation,
        and the joints.
        """
        w = np.repeat(weights, [3, 3, self.model.nv - 6] * 2)
        return Cost("rest", 1e1, Residual.state(self.x0), Activation.weighted(w))

    def _place(self, k, target, weight):
        return Cost(f"{self.feet[k]} moves", weight, Residual.frame_translation(self.model, self.feet[k], target))

    def _costs(self, support, moving, com):
        cone = FrictionCone(FRICTION)
        costs = [Cost(f"{self.feet[k]} grips", 1e1, Residual.friction_cone(self.feet[k], cone)) for k in support]
        costs += [self._place(k, target, 1e6) for k, target in moving]
        costs += [Cost("com", 1e5, Residual.center_of_mass(com)), self._rest(0.0, 1e3, 1e-1, 1e1, 1e1, 1e0)]
        return [*costs, Cost("effort", 1e-1, Residual.control(np.zeros(self.model.nv - 6)))]

    def _phase(self, support, knots, costs):
        first = len(self.knot_models)
        costs_at = {first + k: costs(k) for k in range(knots)}
        action = ContactDynamics(self.model, self._contacts(support, HOLD), self.dt, costs(0), costs_at=costs_at)
        self.us += [action.quasi_static(self.x0)] * knots
        self.knot_models += [len(self.models)] * knots
        self.models.append(action)
        self.touches += [[k in support for k in range(len(self.feet))]] * knots
        self.times += [self.times[-1] + (k + 1) * self.dt for k in range(knots)]

    def stand(self, knots):
        """Adds knots with all feet on the ground."""
        feet = range(len(self.feet))
        self._phase(feet, knots, lambda k: self._costs(feet, [], self.com))

    def step(self, swinging, length, height, knots):
        """Moves the given feet ahead by `length` in an arc of the given height, and sets them down.

        The feet are nearly at rest when they leave the ground and when they touch the ground again. So a robot can
        follow the motion.
        """
        support = [k for k in range(len(self.feet)) if k not in swinging]
        com, places, ahead = self.com.copy(), self.places.copy(), np.array([length, 0.0, 0.0])
        share = len(swinging) / len(self.feet)

        def costs(k):
            s = (k + 1) / knots
            lift = np.array([0.0, 0.0, height * np.sin(np.pi * s) ** 2])
            forward = s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi)
            moving = [(foot, places[foot] + forward * ahead + lift) for foot in swinging]
            return self._costs(support, moving, com + share * s * ahead)

        self._phase(support, knots, costs)
        self.com = self.com + share * ahead
        self.places[swinging] += ahead
        landing = [self._rest(1e0, 1e1, 1e0, 1e1, 1e1, 1e1)]
        landing += [self._place(k, self.places[k], 1e7) for k in swinging]
        self.knot_models.append(len(self.models))
        self.models.append(ImpulseDynamics(self.model, self._contacts(swinging, 0.0), landing, damping=1e-12))
        self.us.append(np.zeros(0))
        self.touches.append([True] * len(self.feet))
        self.times.append(self.times[-1])  # an impact takes no time

    def solve(self):
        """Solves the problem and returns the solution."""
        end = FreeDynamics(self.model, None, [self._rest(0.0, 1e3, 1e-1, 1e2, 1e2, 1e2)])
        problem = Problem(self.x0, self.models, self.knot_models, end)
        return Fddp(problem, tolerance=1e-4).solve(np.tile(self.x0, (len(self.knot_models) + 1, 1)), self.us)
