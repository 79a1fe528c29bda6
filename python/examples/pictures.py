"""Pictures of a motion: plots of a solution, the zeros of a matrix, and playback in the browser.

    python python/examples/pictures.py [--stay]

The example needs `pip install condyle[viz]`. The example writes plot.png and spy.png to the current folder. With
--stay, the page stays open until Enter is pressed.
"""

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")  # pictures are written to files; without this line, `matplotlib.pyplot.show()` shows them on the screen

import numpy as np
from gait import Gait

import condyle
from condyle import viz

FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
DT = 0.01  # time step (s)

robot = condyle.robots.quadruped()
q = condyle.neutral(robot)
q[7:] = [0.0, 0.7, -1.4] * 4  # joint angles with bent knees

gait = Gait(robot, q, FEET, DT)
gait.stand(10)
gait.step([1, 2], 0.08, 0.06, 20)  # moves the right front and the left hind foot
gait.step([0, 3], 0.08, 0.06, 20)
gait.stand(20)
solution = gait.solve()
print(f"FDDP: {solution.status} after {len(solution.trace)} iterations, {len(gait.knot_models)} knots")

# Plots of positions, velocities and controls, and of the solver's iterations.
viz.plot(solution, robot, DT).savefig("plot.png", dpi=110)

# The inertia matrix has zeros between different legs. Its inverse does not have zeros, because the trunk moves.
M, Minv = (f(robot, condyle.Data(robot), q) for f in (condyle.crba, condyle.minv))
viz.spy(M, robot).savefig("spy.png", dpi=110)
print(f"zeros: {(M == 0.0).sum()} of M, {(abs(Minv) < 1e-12).sum()} of its inverse, {M.size} entries each")

# The page shows the shapes of the robot's URDF, an arrow for each contact force, and a slider.
Path("quadruped.urdf").write_text(condyle.robots.QUADRUPED)
player = viz.play(robot, solution.xs[:, : robot.nq], DT, solution.forces, "quadruped.urdf")
print(player)
for knot in (0, 20, 40):
    player.show(knot)
    held = [name for name, force in solution.forces[knot].items() if np.linalg.norm(force) > 1.0]
    print(f"at {knot * DT:.2f} s the robot stands on {', '.join(held)}")
player.play()
if "--stay" in sys.argv:
    input(f"Open {player.url}; Enter ends it. ")
player.close()
