"""Simulation of robots: advances the state (q, v) in time. Rotations in q stay valid in every step.

>>> import condyle, numpy as np
>>> from condyle.simulation import Simulation
>>> arm = condyle.robots.arm7()
>>> simulation = Simulation(arm, integrator="variational", dt=0.005)
>>> simulation.set_state([0.3] * 7, np.zeros(7))
>>> before = condyle.mechanical_energy(arm, condyle.Data(arm), simulation.q, simulation.v)
>>> simulation.run(200)
'done'
>>> after = condyle.mechanical_energy(arm, condyle.Data(arm), simulation.q, simulation.v)
>>> bool(abs(after - before) < 0.05)
True

With a `Ground` a robot can stand, slide, land and lift off:

>>> quadruped = condyle.robots.quadruped()
>>> from condyle.simulation import Ground
>>> ground = Ground(["LF_foot", "RF_foot", "LH_foot", "RH_foot"], friction=0.8)
>>> simulation = Simulation(quadruped, ground=ground)
>>> q = condyle.neutral(quadruped)
>>> q[2] = 0.71  # its feet are 1 cm above the ground
>>> simulation.set_state(q, np.zeros(18))
>>> def stiff(now):
...     now.tau[6:] = -80.0 * now.q[7:] - 2.0 * now.v[6:]
>>> simulation.run(1500, stiff)
'done'
>>> weight = 9.81 * quadruped.total_mass
>>> bool(abs(simulation.contacts.force[:, 2].sum() / weight - 1.0) < 1e-2)
True
"""

from ._condyle import Simulation
from ._types import Control, Ground, GroundContacts

__all__ = ["Control", "Ground", "GroundContacts", "Simulation"]
