#!/usr/bin/env python3
"""Records the ticks of a walking robot in MuJoCo, for `mpc.py`.

    .venv/pinocchio/bin/python benches/peers/mpc_record.py ROBOT RULE FILE [--ticks N]

Robot and controller come from `tests/peers/mujoco/pushes.py`; no push acts. With the rule `tick2`, each
tick is `tick(2)` of `InteriorPoint`. With the rule `fddp1`, it is one iteration of `Fddp`. Then efforts and cones are
costs of the parts beyond their bounds, and all residuals exist in Crocoddyl. The URDF of the robot is written next to
the record.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests" / "peers" / "mujoco"))
from predictive import DT, Predictive
from pushes import run, text_of

from condyle.optimal import Activation, ContactDynamics, Cost, Record, Residual

EXCESS = 0.05
"""Weight of efforts beyond their limits."""


class Hinged(Predictive):
    """Controller whose limits are all costs, with the residuals of Crocoddyl."""

    def _swing(self, k):
        costs, foot = super()._swing(k), self.feet[k]
        level = Residual.frame_rotation(self.model, foot, np.eye(3))
        upright = Activation.weighted([1.0, 1.0, 0.0])  # Crocoddyl has no residual for the tilt alone
        return [costs[0], *(Cost(f"{foot} tilts", 1e3, level, upright) for _ in costs[1:])]

    def _bounded(self, contacts, costs):
        inside = Activation.barrier(-self._effort, self._effort)
        excess = Cost("excess", EXCESS, Residual.control(0.0 * self._effort), inside)
        return ContactDynamics(self.model, contacts, DT, [*costs, excess])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robot")
    parser.add_argument("rule", choices=["tick2", "fddp1"])
    parser.add_argument("file", type=Path)
    parser.add_argument("--ticks", type=int, default=200)
    options = parser.parse_args()
    records = []

    def make(model, robot, rule, rate):
        control = (Hinged if rule == "fddp1" else Predictive)(model, robot, rule, rate)
        control.before_solve = lambda solver: records.append(Record(solver))
        return control

    if run(options.robot, options.rule, (options.ticks + 0.5) * DT, make=make).fallen:
        sys.exit(f"{options.robot} falls with {options.rule}")
    records[-1].save(options.file)
    options.file.with_suffix(".urdf").write_text(text_of(options.robot), encoding="utf-8")


if __name__ == "__main__":
    main()
