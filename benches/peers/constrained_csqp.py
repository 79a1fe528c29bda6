"""Problems of robots with a fixed base, from JSON, for CSQP: the solver of mim_solvers for Crocoddyl's problems."""

from typing import Any

import crocoddyl
import mim_solvers
import numpy as np
import pinocchio as pin
from constrained_program import Program, bounds, matrix, vector
from numpy.typing import NDArray

import condyle

_Array = NDArray[np.float64]


class Drives(crocoddyl.ActuationModelAbstract):
    """Actuation τ = S u. Its calls run in Python, which costs time at each knot."""

    def __init__(self, state: crocoddyl.StateMultibody, S: _Array) -> None:
        crocoddyl.ActuationModelAbstract.__init__(self, state, S.shape[1])
        self.S = S

    def calc(self, data: Any, x: _Array, u: _Array) -> None:
        data.tau[:] = self.S @ u

    def calcDiff(self, data: Any, x: _Array, u: _Array) -> None:
        pass

    def createData(self) -> Any:
        data = crocoddyl.ActuationDataAbstract(self)
        data.dtau_du[:] = self.S if self.S.shape[1] > 1 else self.S[:, 0]
        return data


def robot(model: condyle.Model) -> pin.Model:
    """Returns Pinocchio's model of a robot with revolute and prismatic joints."""
    made = pin.Model()
    made.gravity.linear = model.gravity
    for i in range(1, model.nbodies):
        kinds = {"revolute": pin.JointModelRevoluteUnaligned, "prismatic": pin.JointModelPrismaticUnaligned}
        joint, body = kinds[model.joint_types[i]](np.array(model.joints[i].axis)), model.inertias[i]
        k = made.addJoint(model.parents[i], joint, pin.SE3(np.array(model.joint_placements[i])), f"joint {i}")
        c = np.array(body.com)
        about = np.array(body.rotational) - body.mass * (c @ c * np.eye(3) - np.outer(c, c))
        made.appendBodyToJoint(k, pin.Inertia(body.mass, c, about), pin.SE3.Identity())
    for frame in model.frames:
        if not made.existFrame(frame.name):
            place = pin.SE3(np.array(frame.placement))
            made.addFrame(pin.Frame(frame.name, frame.body, 0, place, pin.FrameType.OP_FRAME))
    made.armature = np.array(model.armature)
    return made


class Csqp:
    """The problem of a program in Crocoddyl."""

    def __init__(self, program: Program) -> None:
        spec, model = program.spec, robot(program.model)
        self.state = crocoddyl.StateMultibody(model)
        free = spec["knots"][0]["dynamics"]["free"]
        entries, *shape = free.get("actuation") or [np.eye(model.nv).ravel(), model.nv, model.nv]
        full = "actuation" not in free
        drives = Drives(self.state, np.reshape(entries, shape, order="F"))
        self.drives = crocoddyl.ActuationModelFull(self.state) if full else drives
        knots = [self.knot(knot, free["dt"]) for knot in spec["knots"]]
        end, running = self.knot(spec["terminal"], 0.0), [knots[k] for k in spec["knot_models"]]
        self.problem = crocoddyl.ShootingProblem(np.array(spec["x0"]), running, end)
        self.problem.nthreads = 1

    def knot(self, knot: dict[str, Any], dt: float) -> crocoddyl.IntegratedActionModelEuler:
        costs = crocoddyl.CostModelSum(self.state, self.drives.nu)
        for cost in knot["costs"]:
            residual, activation = self.residual(cost["residual"]), crocoddyl.ActivationModelQuad
            arguments: list[Any] = [residual.nr]
            if cost["activation"] != "quadratic":
                activation = crocoddyl.ActivationModelWeightedQuad
                arguments = [np.array(cost["activation"]["weighted"])]
            term = crocoddyl.CostModelResidual(self.state, activation(*arguments), residual)
            costs.addCost(cost["name"], term, cost["weight"])
        limits = crocoddyl.ConstraintModelManager(self.state, self.drives.nu)
        for limit in knot["limits"]:
            residual = self.residual(limit["residual"])
            lower, upper = bounds(limit["lower"], -np.inf), bounds(limit["upper"], np.inf)
            if not len(lower):  # an equation
                lower = upper = np.zeros(residual.nr)
            term = crocoddyl.ConstraintModelResidual(self.state, residual, lower, upper)
            limits.addConstraint(limit["name"], term)
        model = crocoddyl.DifferentialActionModelFreeFwdDynamics(self.state, self.drives, costs, limits)
        return crocoddyl.IntegratedActionModelEuler(model, dt)

    def residual(self, residual: dict[str, Any]) -> crocoddyl.ResidualModelAbstract:
        [(kind, numbers)], nu = residual.items(), self.drives.nu
        if kind == "state":
            return crocoddyl.ResidualModelState(self.state, np.array(numbers["reference"]), nu)
        if kind == "control":
            return crocoddyl.ResidualModelControl(self.state, np.array(numbers["reference"]))
        frame, target = self.state.pinocchio.getFrameId(numbers["frame"]["name"]), numbers["target"]
        if kind == "frame_translation":
            return crocoddyl.ResidualModelFrameTranslation(self.state, frame, np.array(vector(target)), nu)
        assert kind == "frame_placement", kind
        place = pin.SE3(matrix(target["rotation"]), np.array(vector(target["translation"])))
        return crocoddyl.ResidualModelFramePlacement(self.state, frame, place, nu)

    def solve(self, xs: _Array, us: _Array, tolerance: float, iterations: int) -> tuple[Any, Any, int, str]:
        """Returns the states, the controls, the number of iterations and a status."""
        solver = mim_solvers.SolverCSQP(self.problem)
        solver.termination_tolerance, solver.use_filter_line_search = tolerance, True
        solver.setCallbacks([])
        done = solver.solve(list(xs), list(us), iterations, False)
        return list(solver.xs), list(solver.us), solver.iter, "converged" if done else "not converged"
