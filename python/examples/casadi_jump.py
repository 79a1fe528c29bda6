"""CasADi: a quadruped jumps. The phases of contact are given: four feet on the ground, no feet, and four feet again.

    python python/examples/casadi_jump.py        needs CasADi: pip install 'condyle[casadi]'

On the ground, `constrained_dynamics` computes the accelerations and the forces of the feet; in the air, `aba` computes
the accelerations. The forces must push and stay in their friction cones. At the landing, the feet must be on the ground
and at rest. IPOPT receives exact second derivatives of all functions.
"""

import casadi
import numpy as np

import condyle
import condyle.casadi

FEET = ("LF_foot", "RF_foot", "LH_foot", "RH_foot")
PUSH, FLIGHT, LAND, DT = 12, 12, 8, 0.02  # numbers of knots of the three phases; time step (s)
HEIGHT, FORWARD, FRICTION = 0.1, 0.2, 0.6  # height (m) and length (m) of the jump; friction coefficient


def contacts() -> list[condyle.ContactConstraint]:
    """Returns contacts that hold the feet, along the world's axes; velocities caused by rounding errors decay."""
    return [condyle.ContactConstraint(foot, "point", reference="local_world_aligned", kd=20.0) for foot in FEET]


def integrate(q: casadi.MX, v: casadi.MX) -> casadi.MX:
    """Returns q ⊕ v for a small v, where q is the base's position and quaternion x, y, z, w, then the joints."""
    u, w, turn = q[3:6], q[6], v[3:6] / 2
    forward = v[:3] + 2 * casadi.cross(u, casadi.cross(u, v[:3]) + w * v[:3])  # the base's velocity in the world
    quaternion = q[3:7] + casadi.vertcat(w * turn + casadi.cross(u, turn), -casadi.dot(u, turn))
    return casadi.vertcat(q[:3] + forward, quaternion / casadi.norm_2(quaternion), q[7:] + v[6:])


def hold(model: condyle.Model, standing: np.ndarray) -> np.ndarray:
    """Returns the efforts of the joints that hold the robot still on its four feet."""
    data, tau = condyle.Data(model), np.zeros(model.nv)
    tau += condyle.gravity(model, data, standing)
    for foot in FEET:
        J = condyle.frame_jacobian(model, data, standing, foot, "local_world_aligned")
        tau -= J[2] * model.total_mass * 9.81 / len(FEET)
    return tau[6:]


def transcribe(
    model: condyle.Model,
    standing: np.ndarray,
    stance: casadi.Function,
    flight: casadi.Function,
    feet: list[tuple[casadi.Function, casadi.Function]],
) -> tuple[casadi.Opti, dict[str, casadi.MX]]:
    """Builds the optimisation of the jump: semi-implicit Euler on knots of 20 ms.

    stance: a function (q, v, τ) -> (a, forces of the feet), with accelerations a. flight: a function (q, v, τ) -> a.
    feet: for each foot, a function of q whose first result is the position, and a function (q, v) -> velocity, linear
    numbers first.
    """
    knots, nq, nv = PUSH + FLIGHT + LAND, model.nq, model.nv
    opti = casadi.Opti()
    q, v, u = opti.variable(nq, knots + 1), opti.variable(nv, knots + 1), opti.variable(nv - 6, knots)
    tau = casadi.vertcat(casadi.MX.zeros(6, knots), u)
    push, fly, land = slice(0, PUSH), slice(PUSH, PUSH + FLIGHT), slice(PUSH + FLIGHT, knots)
    a, forces = [], []
    for phase, count in ((push, PUSH), (fly, FLIGHT), (land, LAND)):
        x = (q[:, phase], v[:, phase], tau[:, phase])
        if phase is fly:
            a.append(flight.map(count)(*x))
            continue
        acceleration, force = stance.map(count)(*x)
        a.append(acceleration)
        forces.append(force)
    opti.subject_to(v[:, 1:] == v[:, :-1] + DT * casadi.horzcat(*a))
    step = casadi.Function("step", [x := casadi.MX.sym("q", nq), y := casadi.MX.sym("v", nv)], [integrate(x, y)])
    opti.subject_to(q[:, 1:] == step.map(knots)(q[:, :-1], DT * v[:, 1:]))
    for force in map(casadi.vec, forces):
        along, across, normal = force[0::3], force[1::3], force[2::3]
        opti.subject_to(normal >= 5)
        for tangent in (along, across):
            opti.subject_to(opti.bounded(-np.inf, tangent - FRICTION / np.sqrt(2) * normal, 0))
            opti.subject_to(opti.bounded(-np.inf, -tangent - FRICTION / np.sqrt(2) * normal, 0))
    opti.subject_to(q[:, 0] == standing)
    opti.subject_to(v[:, 0] == 0)
    opti.subject_to(v[:6, -1] == 0)  # the base is at rest; since the feet do not move, the joints do not move either
    touchdown = PUSH + FLIGHT
    for place, velocity in feet:
        there = np.array(place(standing)[0]).ravel() + np.array([FORWARD, 0.0, 0.0])
        opti.subject_to(place(q[:, touchdown])[0] == there)
        opti.subject_to(velocity(q[:, touchdown], v[:, touchdown])[:3] == 0)
        above = place.map(FLIGHT - 1)(q[:, PUSH + 1 : touchdown])[0]
        opti.subject_to(above[2, :] >= there[2])
    opti.subject_to(q[2, PUSH + FLIGHT // 2] >= standing[2] + HEIGHT)
    opti.subject_to(opti.bounded(-150, casadi.vec(u), 150))
    opti.minimize(DT * (1e-3 * casadi.sumsqr(u) + casadi.sumsqr(v)))
    # initial guess: the base moves ahead, and rises in the air; each foot on the ground carries a quarter of the weight
    path = np.tile(standing[:, None], knots + 1)
    path[0] += np.linspace(0, FORWARD, knots + 1)
    path[2, PUSH : PUSH + FLIGHT + 1] += HEIGHT * np.sin(np.linspace(0, np.pi, FLIGHT + 1))
    opti.set_initial(q, path)
    opti.set_initial(v[:3, 1:], np.diff(path[:3]) / DT)
    opti.set_initial(u, np.tile(hold(model, standing)[:, None], knots))
    return opti, {"q": q, "v": v, "u": u, "push": forces[0]}


def standing_on_the_ground(model: condyle.Model) -> np.ndarray:
    """Returns a position with bent knees and the feet at height 0."""
    q = condyle.neutral(model)
    q[7:] = np.tile([0.0, 0.7, -1.4], 4)
    q[2] -= condyle.frame_placement(model, condyle.Data(model), q, FEET[0])[2, 3]
    return q


def main() -> None:
    robot = condyle.robots.quadruped()
    standing, functions = standing_on_the_ground(robot), condyle.casadi
    stance, flight = functions.constrained_dynamics(robot, contacts()), functions.aba(robot)
    feet = [(functions.forward_kinematics(robot, foot), functions.frame_velocity(robot, foot)) for foot in FEET]
    opti, motion = transcribe(robot, standing, stance, flight, feet)
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 500})
    solution = opti.solve()
    q, push = solution.value(motion["q"]), solution.value(motion["push"])
    print(f"{solution.stats()['iter_count']} iterations")
    print(f"the base rises by {q[2].max() - standing[2]:.2f} m and lands {q[0, -1] - standing[0]:.2f} m ahead")
    weight = robot.total_mass * 9.81
    print(f"the ground pushes with up to {push[2::3].sum(axis=0).max() / weight:.1f} times the robot's weight")
    assert abs(q[0, -1] - standing[0] - FORWARD) < 0.1


if __name__ == "__main__":
    main()
