"""Simulations of robots: (q, v) from one instant to the next, on the joints' own groups.

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
"""

from ._condyle import Simulation
from ._types import Control

__all__ = ["Control", "Simulation"]
