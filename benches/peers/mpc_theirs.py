"""Replays the ticks of a record with Crocoddyl, on a problem that is made of the JSON of Condyle's problem."""

import time

import crocoddyl
import numpy as np
import pinocchio as pin

AXES = {
    "local": pin.LOCAL,
    "world": pin.WORLD,
    "local_world_aligned": pin.LOCAL_WORLD_ALIGNED,
}
START = 1e-9
"""Regularisation of the first iteration of a solve."""


def vector(named):
    """Returns a vector from its JSON."""
    return np.array([named["x"], named["y"], named["z"]])


def placement(named):
    """Returns a pose from its JSON."""
    rotation = np.column_stack([vector(named["rotation"][axis]) for axis in "xyz"])
    return pin.SE3(rotation, vector(named["translation"]))


def bounds(numbers, infinite):
    return np.array([infinite if x is None else x for x in numbers], dtype=float)


def only(named):
    """Returns the key and the value of a dict with one entry. A text is a key without a value."""
    return (named, None) if isinstance(named, str) else next(iter(named.items()))


class Theirs:
    """Problem and solver of Crocoddyl. Each knot has its own model, so that each has its own references."""

    def __init__(self, spec, urdf, clock=time.perf_counter):
        self.spec, self.clock = spec, clock
        self.model = pin.buildModelFromXML(urdf, pin.JointModelFreeFlyer())
        self.state = crocoddyl.StateMultibody(self.model)
        self.drives = crocoddyl.ActuationModelFloatingBase(self.state)
        self.free = [[] for _ in spec["knots"]]
        """Models that no knot uses, with their data."""
        self.knots = [(k, *self.take(k)) for k in spec["knot_models"]]
        self.end = self.knot(spec["terminal"])
        running = [model for _, model, _ in self.knots]
        self.problem = crocoddyl.ShootingProblem(np.array(spec["x0"]), running, self.end)
        self.problem.nthreads = 1
        self.solver = crocoddyl.SolverFDDP(self.problem)

    def take(self, k):
        """Returns a model of kind k that no knot uses, and its data."""
        if self.free[k]:
            return self.free[k].pop()
        model = self.knot(self.spec["knots"][k])
        return model, model.createData()

    def frame(self, name):
        """Returns the index of a link's frame. A joint may have the same name."""
        return self.model.getFrameId(name, pin.FrameType.BODY)

    def residual(self, named, nu):
        kind, numbers = only(named)
        frame = self.frame(numbers["frame"]["name"]) if "frame" in numbers else None
        if kind == "state":
            return crocoddyl.ResidualModelState(self.state, np.array(numbers["reference"]), nu)
        if kind == "control":
            return crocoddyl.ResidualModelControl(self.state, np.array(numbers["reference"]))
        if kind == "frame_translation":
            return crocoddyl.ResidualModelFrameTranslation(self.state, frame, vector(numbers["target"]), nu)
        if kind == "frame_rotation":
            target = np.column_stack([vector(numbers["target"][axis]) for axis in "xyz"])
            return crocoddyl.ResidualModelFrameRotation(self.state, frame, target, nu)
        cone, contact = numbers["cone"], self.frame(numbers["contact"])
        friction = cone.get("friction", cone)
        least, most = friction["least"], friction["greatest"] or np.inf
        pyramid = (friction["facets"], friction["inner"], least, most)
        if kind == "friction_cone":
            rows = crocoddyl.FrictionCone(np.eye(3), friction["mu"], *pyramid)
            return crocoddyl.ResidualModelContactFrictionCone(self.state, contact, rows, nu, True)
        assert kind == "wrench_cone", kind
        rows = crocoddyl.WrenchCone(np.eye(3), friction["mu"], np.array(cone["size"]), *pyramid)
        return crocoddyl.ResidualModelContactWrenchCone(self.state, contact, rows, nu, True)

    def cost(self, cost, nu):
        made, (kind, numbers) = self.residual(cost["residual"], nu), only(cost["activation"])
        if kind == "quadratic":
            return crocoddyl.CostModelResidual(self.state, made)
        if kind == "weighted":
            return crocoddyl.CostModelResidual(
                self.state, crocoddyl.ActivationModelWeightedQuad(np.array(numbers)), made
            )
        assert kind == "barrier", kind
        inside = crocoddyl.ActivationBounds(bounds(numbers["lower"], -np.inf), bounds(numbers["upper"], np.inf))
        return crocoddyl.CostModelResidual(self.state, crocoddyl.ActivationModelQuadraticBarrier(inside), made)

    def knot(self, knot):
        kind, numbers = only(knot["dynamics"])
        nu = self.drives.nu
        costs = crocoddyl.CostModelSum(self.state, nu)
        for cost in knot["costs"]:
            costs.addCost(cost["name"], self.cost(cost, nu), cost["weight"])
        if kind == "terminal":
            free = crocoddyl.DifferentialActionModelFreeFwdDynamics(self.state, self.drives, costs)
            return crocoddyl.IntegratedActionModelEuler(free, 0.0)
        assert kind == "contact", kind
        contacts = crocoddyl.ContactModelMultiple(self.state, nu)
        for contact in numbers["contacts"]:
            name, given = contact["name"], contact["constraint"]
            frame, gains = self.frame(name), np.array([given["kp"], given["kd"]])
            target, axes = placement(given["target"]["placement"]), AXES[given["reference"]]
            if given["kind"] == "point":
                made = crocoddyl.ContactModel3D(self.state, frame, target.translation, axes, nu, gains)
            else:
                made = crocoddyl.ContactModel6D(self.state, frame, target, axes, nu, gains)
            contacts.addContact(name, made)
        moved = crocoddyl.DifferentialActionModelContactFwdDynamics(
            self.state, self.drives, contacts, costs, numbers["damping"], True
        )
        return crocoddyl.IntegratedActionModelEuler(moved, numbers["dt"])

    def shift(self, last):
        """Moves the horizon by one knot. The new last knot has the model `last`."""
        k, model, data = self.knots.pop(0)
        self.free[k].append((model, data))
        model, data = self.take(last)
        self.knots.append((last, model, data))
        self.problem.circularAppend(model, data)

    def set_references(self, name, values):
        """Sets the references of the cost with this name at all knots."""
        models = [*(model for _, model, _ in self.knots), self.end]
        for model, value in zip(models, values, strict=True):
            costs = model.differential.costs.costs
            if name in costs:
                costs[name].cost.residual.reference = value

    def set_x0(self, x0):
        """Sets the initial state."""
        self.problem.x0 = x0

    def iterate(self, xs, us, regularisation=START):
        """Makes one iteration from a warm start. Returns its duration (s)."""
        begin = self.clock()
        self.solver.solve(xs, us, 1, False, regularisation)
        return self.clock() - begin
