"""Builds and solves optimal control problems from JSON with Crocoddyl."""

import math
import time

import crocoddyl
import numpy as np
import pinocchio as pin
from ocp_actions import Cartpole, DoublePendulum
from ocp_robots import FRAMES, Solve, actuation_matrix, bounds, homogeneous, their_robot

THEIRS = {
    "fddp": crocoddyl.SolverFDDP,
    "ddp": crocoddyl.SolverDDP,
    "boxfddp": crocoddyl.SolverBoxFDDP,
    "boxddp": crocoddyl.SolverBoxDDP,
}


class TheirCartpole(crocoddyl.DifferentialActionModelAbstract):
    """Action `Cartpole`, derived from a class of Crocoddyl."""

    def __init__(self, stage):
        crocoddyl.DifferentialActionModelAbstract.__init__(self, crocoddyl.StateVector(4), 1, 5)
        self.cart = Cartpole(stage)

    def calc(self, data, x, u=None):
        if u is not None:
            data.xout[:] = self.cart.acceleration(x, u[0])[0]
        data.cost = self.cart.rate(x, [] if u is None else u)

    def calcDiff(self, data, x, u=None):
        w = self.cart.weights
        data.Lx[:], data.Lxx[:, :] = w[:4] * x, np.diag(w[:4])
        if u is not None:
            _, by_angle, by_rate, by_force = self.cart.acceleration(x, u[0])
            data.Fx[:, 1], data.Fx[:, 3], data.Fu[:] = by_angle, by_rate, by_force
            data.Lu[:], data.Luu[:] = w[4:] * u, w[4:]


class TheirGoal(crocoddyl.CostModelAbstract):
    """Goal of `DoublePendulum`, derived from a class of Crocoddyl."""

    def __init__(self, state, weights, nu):
        activation = crocoddyl.ActivationModelWeightedQuad(weights)
        crocoddyl.CostModelAbstract.__init__(self, state, activation, nu=nu)
        self.weights = weights

    def calc(self, data, x, u=None):
        data.cost = DoublePendulum.goal(self, x, self.weights)[0]

    def calcDiff(self, data, x, u=None):
        _, data.Lx[:], data.Lxx[:, :] = DoublePendulum.goal(self, x, self.weights)


class TheirDrives(crocoddyl.ActuationModelAbstract):
    """Actuation τ = S u, derived from a class of Crocoddyl."""

    def __init__(self, state, S):
        crocoddyl.ActuationModelAbstract.__init__(self, state, S.shape[1])
        self.S = S

    def calc(self, data, x, u):
        data.tau[:] = self.S @ u

    def calcDiff(self, data, x, u):
        pass

    def createData(self):
        data = crocoddyl.ActuationDataAbstract(self)
        data.dtau_du[:] = self.S if self.S.shape[1] > 1 else self.S[:, 0]
        return data


class Theirs:
    """Problem built from JSON by Crocoddyl, for Crocoddyl's solver of the given name."""

    def __init__(self, spec, robot, solver):
        self.spec, self.name, self.kept = spec, solver, []
        if robot:
            self.model = their_robot(robot)
            overrides = spec["robot_overrides"]
            if "effort_limit" in overrides:
                self.model.effortLimit = bounds(overrides["effort_limit"], np.finfo(float).max)
            if "velocity_limit" in overrides:
                self.model.velocityLimit = bounds(overrides["velocity_limit"], np.finfo(float).max)
            self.state = crocoddyl.StateMultibody(self.model)
            self.drives = self.actuation()
        stages = [self.stage(stage) for stage in spec["stage_models"]]
        running = [stages[k] for k in spec["stages"]]
        self.problem = crocoddyl.ShootingProblem(np.array(spec["x0"], float), running, stages[spec["terminal"]])
        self.problem.nthreads = 1  # OMP_NUM_THREADS sets the number of threads for Eigen's products

    def actuation(self):
        kind = self.spec["actuation"]["type"]
        if kind == "full":
            return crocoddyl.ActuationModelFull(self.state)
        if kind == "floating_base":
            return crocoddyl.ActuationModelFloatingBase(self.state)
        if kind == "thrusters":
            rotors = [
                crocoddyl.Thruster(
                    pin.SE3(homogeneous(rotor)),
                    rotor["torque_per_thrust"],
                    getattr(crocoddyl.ThrusterType, rotor["spin"]),
                )
                for rotor in self.spec["actuation"]["thrusters"]
            ]
            return crocoddyl.ActuationModelFloatingBaseThrusters(self.state, rotors)
        return TheirDrives(self.state, actuation_matrix(self.spec, self.model.nv))

    def cost(self, cost, nu):
        residual, activation, state = cost["residual"], cost["activation"], self.state
        kind, limits = residual["type"], None
        if kind == "double_pendulum":
            goal = TheirGoal(state, np.array(activation["w"]), nu)
            self.kept.append(goal)
            return goal
        frame = self.model.getFrameId(residual["frame"]) if "frame" in residual else None
        if kind == "state":
            made = crocoddyl.ResidualModelState(state, np.array(residual["ref"]), nu)
        elif kind == "control":
            made = crocoddyl.ResidualModelControl(state, np.array(residual["ref"]) if nu else nu)
        elif kind == "frame_placement":
            made = crocoddyl.ResidualModelFramePlacement(state, frame, pin.SE3(homogeneous(residual)), nu)
        elif kind == "frame_translation":
            made = crocoddyl.ResidualModelFrameTranslation(state, frame, np.array(residual["p"]), nu)
        elif kind == "com":
            made = crocoddyl.ResidualModelCoMPosition(state, np.array(residual["p"]), nu)
        elif kind == "friction_cone":
            limits = crocoddyl.FrictionCone(np.eye(3), residual["mu"], residual["nf"], residual["inner"])
            made = crocoddyl.ResidualModelContactFrictionCone(state, frame, limits, nu, True)
        else:
            box = np.array(residual["box"])
            limits = crocoddyl.WrenchCone(np.eye(3), residual["mu"], box, residual["nf"], residual["inner"])
            made = crocoddyl.ResidualModelContactWrenchCone(state, frame, limits, nu, True)
        if activation["type"] == "quad":
            return crocoddyl.CostModelResidual(state, made)
        if activation["type"] == "weighted_quad":
            weighted = crocoddyl.ActivationModelWeightedQuad(np.array(activation["w"], float))
            return crocoddyl.CostModelResidual(state, weighted, made)
        if activation["type"] == "quadratic_barrier":
            lower, upper = bounds(activation["lb"], -np.inf), bounds(activation["ub"], np.inf)
        else:
            lower, upper = limits.lb, limits.ub
        barrier = crocoddyl.ActivationModelQuadraticBarrier(crocoddyl.ActivationBounds(lower, upper))
        return crocoddyl.CostModelResidual(state, barrier, made)

    def costs(self, costs, nu):
        total = crocoddyl.CostModelSum(self.state, nu)
        for cost in costs:
            total.addCost(cost["name"], self.cost(cost, nu), cost["weight"])
        return total

    def stage(self, stage):
        kind = stage["kind"]
        if kind == "unicycle":
            model = crocoddyl.ActionModelUnicycle()
            model.costWeights, model.dt = np.array([stage["w_x"], stage["w_u"]]), stage["dt"]
            return model
        if kind == "cartpole":
            model = TheirCartpole(stage)
            self.kept.append(model)
            return crocoddyl.IntegratedActionModelEuler(model, stage["dt"])
        if kind == "impulse":
            impulses = crocoddyl.ImpulseModelMultiple(self.state)
            for contact in stage["impulses"]:
                frame, axes = self.model.getFrameId(contact["frame"]), FRAMES[contact["frame_type"]][0]
                made = {3: crocoddyl.ImpulseModel3D, 6: crocoddyl.ImpulseModel6D}[contact["dim"]]
                impulses.addImpulse(contact["frame"], made(self.state, frame, axes))
            costs = self.costs(stage["costs"], 0)
            model = crocoddyl.ActionModelImpulseFwdDynamics(self.state, impulses, costs)
            model.JMinvJt_damping, model.r_coeff = stage["damping"], stage["restitution"]
            return model
        dynamics, nu = stage["dynamics"], self.drives.nu
        costs = self.costs(stage["costs"], nu)
        if dynamics["type"] == "free_fwd":
            model = crocoddyl.DifferentialActionModelFreeFwdDynamics(self.state, self.drives, costs)
        else:
            contacts = crocoddyl.ContactModelMultiple(self.state, nu)
            for contact in dynamics["contacts"]:
                frame, axes = self.model.getFrameId(contact["frame"]), FRAMES[contact["frame_type"]][0]
                gains, target = np.array([contact["kp"], contact["kd"]]), contact["ref"]
                if contact["dim"] == 3:
                    made = crocoddyl.ContactModel3D(self.state, frame, np.array(target["p"]), axes, nu, gains)
                else:
                    made = crocoddyl.ContactModel6D(self.state, frame, pin.SE3(homogeneous(target)), axes, nu, gains)
                contacts.addContact(contact["name"], made)
            model = crocoddyl.DifferentialActionModelContactFwdDynamics(
                self.state, self.drives, contacts, costs, dynamics["damping"], dynamics["enable_force"]
            )
        model = crocoddyl.IntegratedActionModelEuler(model, stage["dt"])
        if "u_lb" in stage:
            model.u_lb, model.u_ub = bounds(stage["u_lb"], -np.inf), bounds(stage["u_ub"], np.inf)
        return model

    def warm_start(self):
        """Returns the initial guess, states and controls, which the solvers of both libraries use."""
        x0, kind, problem = np.array(self.spec["x0"], float), self.spec["warm_start"], self.problem
        if kind == "zero":
            xs = [m.state.zero() for m in problem.runningModels] + [problem.terminalModel.state.zero()]
        else:
            xs = [x0.copy() for _ in range(problem.T + 1)]
        if kind.endswith("quasistatic"):
            return xs, list(problem.quasiStatic([x0] * problem.T))
        return xs, [np.zeros(m.nu) for m in problem.runningModels]

    def solver(self):
        solver = THEIRS[self.name](self.problem)
        if self.spec["th_stop"] is not None:
            solver.th_stop = self.spec["th_stop"]
        return solver

    def run(self, solver, xs, us):
        start = np.nan if self.spec["init_reg"] is None else self.spec["init_reg"]
        solver.solve(xs, us, self.spec["maxiter"], False, start)

    def solve(self, xs, us):
        solver, rows = self.solver(), []

        class Log(crocoddyl.CallbackAbstract):
            def __call__(self, s):
                rows.append((float(s.cost), float(s.stepLength), float(s.preg), float(s.stop)))

        solver.setCallbacks([Log()])
        self.run(solver, xs, us)
        return Solve(np.array(rows), float(solver.cost), np.array(list(solver.xs)), {})

    def time(self, xs, us, iterations, trials):
        """Returns the seconds of a solve and of its phases: derivatives, backward sweep and rollout. A phase is timed
        at the optimum, after a first call, and multiplied by the number of its calls in a solve."""
        solver = self.solver()
        self.run(solver, xs, us)
        begin = time.perf_counter()
        self.run(solver, xs, us)
        phases = {"total": time.perf_counter() - begin}
        xs, us, problem = solver.xs, solver.us, self.problem

        def call(f, *arguments):
            f(*arguments)
            begin = time.perf_counter()
            f(*arguments)
            return time.perf_counter() - begin

        problem.calc(xs, us)
        phases["derivatives"] = iterations * call(problem.calcDiff, xs, us)
        solver.computeDirection(True)
        phases["sweep"] = iterations * call(solver.backwardPass)
        try:
            phases["rollout"] = trials * call(solver.forwardPass, 1.0)
        except RuntimeError:  # with this step, all controls are outside of their bounds
            phases["rollout"] = math.nan
        return phases
