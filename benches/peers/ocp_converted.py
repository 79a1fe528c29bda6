"""Optimal control problems, from their JSON, as `condyle.crocoddyl` makes them of Crocoddyl's."""

from ocp_ours import Ours
from ocp_theirs import Theirs

import condyle.crocoddyl


class Converted(Ours):
    """Our solver on what Crocoddyl has built."""

    strict = True

    def made(self, robot, solver):
        self.theirs = Theirs(self.spec, robot, solver)
        bounded = solver.startswith("box")
        return condyle.crocoddyl.problem(self.theirs.problem, bounded=bounded, strict=self.strict)
