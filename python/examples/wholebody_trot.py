"""A quadruped trots: FDDP finds the plan, and whole-body control tracks it at 1 kHz on ground that can push but not
pull.

python python/examples/wholebody_trot.py
"""

import numpy as np
from gait import Gait
from ground import Ground

import condyle
from condyle.wholebody import FrictionContact, Gains, Settings, Task, WholeBodyController, plan_of

FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
FRICTION = 0.7
DT = 1e-3  # time step (s)


def main() -> None:
    robot = condyle.robots.quadruped()
    q = condyle.neutral(robot)
    q[7:] = [0.0, 0.7, -1.4] * 4  # joint angles with bent knees

    gait = Gait(robot, q, FEET, 0.01)
    gait.stand(10)
    gait.step([1, 2], 0.08, 0.06, 20)  # moves the right front and the left hind foot
    gait.stand(5)
    gait.step([0, 3], 0.16, 0.06, 20)
    gait.stand(5)
    gait.step([1, 2], 0.08, 0.06, 20)
    gait.stand(20)
    solution = gait.solve()
    print(f"FDDP: {solution.status} after {len(solution.trace)} iterations, {len(gait.knot_models)} knots")
    plan = plan_of(robot, solution, gait.times, gait.touches, fade=0.02)

    contacts = [FrictionContact.point(foot, FRICTION) for foot in FEET]
    swing = [Task.position(foot, weight=100.0, gains=Gains.critical(900.0)) for foot in FEET]
    tasks = [Task.com(), Task.orientation("trunk"), Task.posture(), *swing]
    controller = WholeBodyController(robot, contacts, tasks, Settings(contact_gains=Gains(0.0, 40.0)))
    x0 = solution.xs[0][: robot.nq]
    references, world = controller.hold(x0), Ground(robot, x0, FEET)

    # Friction is unlimited in this example, so the forces are checked.
    unsolved = loaded = slips = 0
    error = 0.0
    for tick in range(round((plan.span[1] + 0.3) / DT)):
        t = tick * DT
        controller.track(plan, t, references)
        command = controller.step(world.q, world.v, references)
        unsolved += command.status != "solved"
        error = max(error, *controller.kkt_residuals(world.q, world.v, references))
        forces = world.step(command.tau, DT)
        for f, contact in zip(forces, references.contacts, strict=True):
            if contact.activation == 1.0 and f[2] > 0.0:
                loaded, slips = loaded + 1, slips + (np.hypot(f[0], f[1]) > FRICTION * f[2])
        if tick % 100 == 0:
            away = 1e3 * np.linalg.norm(world.q[:3] - references.posture.q[:3])
            loads = " ".join(f"{f:4.0f}" for f in forces[:, 2])
            print(f"{t:4.1f} s   trunk at {world.q[0]:6.3f} m, {away:4.1f} mm from the plan   feet carry {loads} N")
    ahead, planned = world.q[0] - x0[0], solution.xs[-1][0] - x0[0]
    print(f"the trunk went {ahead:.3f} m ahead, as planned {planned:.3f} m; {unsolved} ticks without a solution")
    print(f"each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}")
    print(f"{100 * slips / loaded:.1f} % of the forces on loaded feet leave the cone: there a foot would slip")
    assert abs(ahead - planned) < 0.03 and unsolved == 0 and error < 1e-5, "the plan was not tracked"


if __name__ == "__main__":
    main()
