"""Simulation of a robot on level ground by constrained dynamics.

A foot that touches the ground is held as long as the ground pushes; a foot that comes down is stopped by an impact.
Friction is unlimited, so programs that use this module should check the forces.
"""

import numpy as np

import condyle
from condyle import ConstraintSet, ContactConstraint

HOLD = 50.0  # decay rate of a held foot's drift (1/s)


class Ground:
    """The state of the robot, and the set of standing feet. At first all feet stand at their initial positions."""

    def __init__(self, model, q, feet, kind="point"):
        self.model, self.data, self.kind = model, condyle.Data(model), kind
        self.q, self.v, self.feet = np.array(q), np.zeros(model.nv), list(feet)
        self.standing = [True] * len(self.feet)
        self.sets = {}

    def step(self, tau, dt, f_ext=None):
        """Makes a step of length dt with efforts τ and external forces on bodies. Returns the force on each foot along
        the world's axes (N).
        """
        forces = np.zeros((len(self.feet), 3))
        while True:
            held, contacts = self._contacts()
            found = condyle.constrained_dynamics(self.model, self.data, contacts, self.q, self.v, tau, f_ext)
            here = [found.lambda_[contacts.range(i)][:3] for i in range(len(held))]
            pulled = min(range(len(held)), key=lambda i: here[i][2], default=None)
            if pulled is None or here[pulled][2] >= 0.0:
                break
            self.standing[held[pulled]] = False  # release feet that the ground would have to pull
        for k, force in zip(held, here, strict=True):
            forces[k] = force
        self.v = self.v + dt * found.a  # semi-implicit Euler: v⁺ = v + Δt q̈, then q⁺ = q ⊕ Δt v⁺
        self.q = condyle.integrate(self.model, self.q, dt * self.v)
        self._land()
        return forces

    def _contacts(self):
        held = tuple(k for k, standing in enumerate(self.standing) if standing)
        if held not in self.sets:
            contacts = [ContactConstraint(self.feet[k], self.kind, None, "local_world_aligned", kd=HOLD) for k in held]
            self.sets[held] = ConstraintSet(self.model, contacts)
        return held, self.sets[held]

    def _land(self):
        """Stops the feet that have come down. An impact changes v to v⁺ with J v⁺ = 0, where J is the Jacobian of these
        feet."""
        height = [condyle.frame_placement(self.model, self.data, self.q, foot)[2, 3] for foot in self.feet]
        landed = [not standing and z < 0.0 for standing, z in zip(self.standing, height, strict=True)]
        if any(landed):
            self.standing = [a or b for a, b in zip(self.standing, landed, strict=True)]
            contacts = self._contacts()[1]
            self.v = condyle.impulse_dynamics(self.model, self.data, contacts, self.q, self.v).v
