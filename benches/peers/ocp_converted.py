"""Optimal control problems that Crocoddyl builds from JSON and `condyle.crocoddyl` converts."""

from ocp_ours import Ours
from ocp_theirs import Theirs

import condyle.crocoddyl


class Converted(Ours):
    """Solver of Condyle for a problem that Crocoddyl built and `condyle.crocoddyl` converted."""

    strict = True

    def made(self, robot, solver):
        self.theirs = Theirs(self.spec, robot, solver)
        bounded = solver.startswith("box")
        return condyle.crocoddyl.problem(self.theirs.problem, bounded=bounded, strict=self.strict)
