#!/usr/bin/env python3
"""Makes docs/pictures/playback.png: a picture from a browser of a trotting quadruped, which `condyle.viz.play` shows.

.venv/pinocchio/bin/python docs/pictures/playback.py

The program needs Node.js and the browser that tests/page/run.sh installs. Without a GPU the program takes a few
minutes.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import condyle
from condyle import viz

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "python" / "examples"))

FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
SECONDS = 60
"""Time that the page gets to draw before the picture is taken (s)."""


def main() -> None:
    from gait import Gait

    robot = condyle.robots.quadruped()
    q = condyle.neutral(robot)
    q[7:] = [0.0, 0.7, -1.4] * 4
    gait = Gait(robot, q, FEET, 0.01)
    gait.stand(10)
    gait.step([1, 2], 0.08, 0.06, 20)
    gait.stand(5)
    gait.step([0, 3], 0.16, 0.06, 20)
    gait.stand(20)
    solution = gait.solve()
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as urdf:
        urdf.write(condyle.robots.QUADRUPED)
        urdf.flush()
        player = viz.play(robot, solution.xs[:, : robot.nq], 0.01, solution.forces, urdf.name)
    player.show(22)  # the picture shows the middle of the first step
    browser = ["node", HERE / "browser.mjs", player.url, HERE / "playback.png", str(SECONDS)]
    subprocess.run(browser, check=True, cwd=HERE)
    player.close()


if __name__ == "__main__":
    main()
