"""Builds and solves optimal control problems from JSON with Condyle."""

import json
import time

import numpy as np
from ocp_actions import Cartpole, DoublePendulum, unicycle
from ocp_robots import FRAMES, Solve, actuation_matrix, bounds, homogeneous, our_robot

import condyle
from condyle import optimal


def our_activation(activation, residual):
    kind = activation["type"]
    if kind == "quad":
        return None
    if kind == "weighted_quad":
        return optimal.Activation.weighted(activation["w"])
    if kind == "quadratic_barrier":
        return optimal.Activation.barrier(bounds(activation["lb"], -np.inf), bounds(activation["ub"], np.inf))
    assert kind == "cone_barrier", kind
    return None  # None selects the default of the residual of a cone


def our_cost(cost, model, terminal, contacts):
    """Returns a `Cost`, or None for a cost that does not exist at a terminal knot."""
    residual, name, weight = cost["residual"], cost["name"], cost["weight"]
    kind, activation = residual["type"], our_activation(cost["activation"], residual)
    if terminal and kind in ("control", "friction_cone", "wrench_cone"):
        return None
    return optimal.Cost(name, weight, our_residual(residual, model, contacts), activation)


def our_residual(residual, model, contacts):
    kind = residual["type"]
    if kind == "state":
        return optimal.Residual.state(residual["ref"])
    if kind == "control":
        return optimal.Residual.control(residual["ref"])
    if kind == "frame_placement":
        return optimal.Residual.frame_placement(model, residual["frame"], homogeneous(residual))
    if kind == "frame_translation":
        return optimal.Residual.frame_translation(model, residual["frame"], residual["p"])
    if kind == "com":
        return optimal.Residual.center_of_mass(residual["p"])
    cone = optimal.FrictionCone(residual["mu"], residual["nf"], residual["inner"])
    contact = contacts[residual["frame"]]
    if kind == "friction_cone":
        return optimal.Residual.friction_cone(contact, cone)
    assert kind == "wrench_cone", kind
    return optimal.Residual.wrench_cone(contact, optimal.WrenchCone(cone, residual["box"]))


def our_contact(contact, gains):
    """Returns the `ContactConstraint` for the JSON of a contact or of an impulse."""
    placement = np.eye(4)
    if "ref" in contact:
        placement[:3, 3] = contact["ref"]["p"]
        placement[:3, :3] = contact["ref"].get("R", np.eye(3))
    kind, axes = {3: "point", 6: "rigid"}[contact["dim"]], FRAMES[contact["frame_type"]][1]
    return condyle.ContactConstraint(
        contact["frame"], kind, reference=axes, kp=gains[0], kd=gains[1], placement=placement
    )


def our_action(stage, model, spec, bounded, terminal=False, others=()):
    """Returns an action. `others` lists further knots, each with its stage (the entry of the JSON). These knots use the
    same action with their own costs."""
    kind = stage["kind"]
    if kind == "unicycle":
        return unicycle(stage)[terminal]
    if kind == "cartpole":
        return Cartpole(stage).actions()[terminal]
    if any(cost["residual"]["type"] == "double_pendulum" for cost in stage["costs"]):
        return DoublePendulum(model, stage).actions()[terminal]
    listed = stage["impulses"] if kind == "impulse" else stage["dynamics"].get("contacts", [])
    names = {contact["frame"]: contact.get("name", contact["frame"]) for contact in listed}

    def costs_of(stage):
        costs = [our_cost(cost, model, terminal, names) for cost in stage["costs"]]
        return [cost for cost in costs if cost is not None]

    costs, costs_at = costs_of(stage), {t: costs_of(other) for t, other in others}
    contacts = {
        names[contact["frame"]]: our_contact(contact, (contact.get("kp", 0.0), contact.get("kd", 0.0)))
        for contact in listed
    }
    if kind == "impulse":
        return optimal.ImpulseDynamics(model, contacts, costs, stage["restitution"], stage["damping"])
    if terminal:
        return optimal.FreeDynamics(model, None, costs)
    actuation = actuation_matrix(spec, model.nv)
    limits = {}
    if bounded and "u_lb" in stage:
        limits = {"lower": bounds(stage["u_lb"], -np.inf), "upper": bounds(stage["u_ub"], np.inf)}
    if stage["dynamics"]["type"] == "free_fwd":
        return optimal.FreeDynamics(model, stage["dt"], costs, costs_at, actuation, **limits)
    damping = stage["dynamics"]["damping"]
    return optimal.ContactDynamics(model, contacts, stage["dt"], costs, damping, costs_at, actuation, **limits)


class Ours:
    """Problem built from JSON by Condyle. The solver has the settings of Crocoddyl's solver with the same name."""

    def __init__(self, spec, robot, solver):
        self.spec = spec
        self.solver = optimal.Fddp(self.made(robot, solver), **self.settings(solver))

    def made(self, robot, solver):
        """Returns Condyle's `Problem`."""
        spec, bounded = self.spec, solver.startswith("box")
        model = our_robot(robot) if robot else None
        models, knot_models = self.phases(model, bounded)
        terminal = our_action(spec["stage_models"][spec["terminal"]], model, spec, bounded, terminal=True)
        return optimal.Problem(spec["x0"], models, knot_models, terminal)

    def settings(self, solver):
        """Returns settings with which Condyle's solver computes the same iterations as Crocoddyl's solver of this
        name."""
        spec = self.spec
        settings = {"max_iterations": spec["maxiter"], "method": solver.removeprefix("box")}
        settings["project_warm_start"] = False  # Crocoddyl keeps an initial guess outside of the bounds
        if spec["init_reg"] is not None:
            settings["regularisation_start"] = spec["init_reg"]
        if spec["th_stop"] is not None:
            settings["tolerance"] = settings["tolerance_bounded"] = spec["th_stop"]
        return settings

    def phases(self, model, bounded):
        """Returns the list of actions, and the index of each knot's action. Knots with the same dynamics share an
        action, even if their costs differ."""
        first, serves = {}, []
        for t, k in enumerate(self.spec["stages"]):
            stage = self.spec["stage_models"][k]
            same = stage if "dynamics" not in stage else {name: stage[name] for name in stage if name != "costs"}
            key = json.dumps(same, sort_keys=True)
            first.setdefault(key, (stage, []))[1].append((t, stage))
            serves.append(list(first).index(key))

        def action(stage, knots):
            return our_action(stage, model, self.spec, bounded, others=[(t, s) for t, s in knots if s is not stage])

        return [action(*phase) for phase in first.values()], serves

    def solve(self, xs, us):
        if len({len(u) for u in us}) == 1:
            us = np.array(us)
        begin = time.perf_counter()
        s = self.solver.solve(np.array(xs), us)
        total = time.perf_counter() - begin
        rows = np.array([(i.cost, i.step, i.regularisation, i.stop) for i in s.trace])
        t = s.timings
        phases = {"total": total, "derivatives": t.calc_diff, "sweep": t.sweep, "rollout": t.rollout}
        return Solve(rows, s.cost, s.xs, phases)
