"""Optimal control problems from their JSON, built by Crocoddyl and converted by `condyle.crocoddyl`."""

from ocp_ours import Ours
from ocp_theirs import Theirs

import condyle.crocoddyl


class Converted(Ours):
    """Our solver on a problem that Crocoddyl has built."""

    strict = True

    def made(self, robot, solver):
        self.theirs = Theirs(self.spec, robot, solver)
        bounded = solver.startswith("box")
        return condyle.crocoddyl.problem(self.theirs.problem, bounded=bounded, strict=self.strict)
