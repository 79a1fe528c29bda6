"""A quadruped stands on four point feet. A push makes the robot sway, and the robot returns to its posture.

Each millisecond one cone program gives the torques: whole-body control with exact friction cones. The controller
measures only the state, not the push. The ground holds each touching foot as long as the ground pushes the foot. The
ground's friction is unlimited, so the example checks each force, and reports the largest fraction of the friction limit
that was used.

    python python/examples/wholebody_stand.py
"""

import time

import numpy as np
from ground import Ground

import condyle
from condyle.wholebody import FrictionContact, Gains, Task, WholeBodyController

FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
FRICTION = 0.6
DT = 1e-3  # time step (s)
PUSH = 50.0  # force to the left (N), from 0.2 s to 0.6 s


def main() -> None:
    model = condyle.robots.quadruped()
    knees = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2  # knees bent inwards; the feet are on the ground
    q = np.r_[0.0, 0.0, 0.7 * np.cos(0.7), 0.0, 0.0, 0.0, 1.0, knees]

    gains = Gains.critical(60.0)
    tasks = [Task.com(gains=gains), Task.orientation("trunk", gains=gains), Task.posture()]
    controller = WholeBodyController(model, [FrictionContact.point(foot, FRICTION) for foot in FEET], tasks)
    references = controller.hold(q)

    print(f"{model.name} of {model.total_mass:.1f} kg, friction {FRICTION}, is pushed to the left by {PUSH} N")
    print("         moved, mm        f_z of each foot, N")
    print("  t, s     y     z     LF    LH    RF    RH    ‖f_t‖ / μ f_n")
    world, f_ext = Ground(model, q, FEET), np.zeros((model.nbodies, 6))
    worst, error, times = 0.0, 0.0, []
    for tick in range(2001):
        clock = time.perf_counter()
        command = controller.step(world.q, world.v, references).solved()
        times.append(1e6 * (time.perf_counter() - clock))
        error = max(error, *controller.kkt_residuals(world.q, world.v, references))

        f_ext[1, 1] = PUSH if 200 <= tick < 600 else 0.0  # along the trunk's axes; the trunk turns only a little
        forces = world.step(command.tau, DT, f_ext)
        used = np.max(np.hypot(forces[:, 0], forces[:, 1]) / (FRICTION * forces[:, 2]))
        assert used < 1.0 and forces[:, 2].min() > 0.0, f"a foot slips or lifts at tick {tick}"
        worst = max(worst, used)
        if tick % 100 == 0:
            (y, z), loads = 1e3 * (world.q - q)[1:3], " ".join(f"{f:5.1f}" for f in forces[:, 2])
            print(f"  {tick * DT:4.1f} {y:5.1f} {z:5.1f}  {loads} {used:16.2f}")
    print(f"\nNo foot left its cone: at worst {100 * worst:.0f} % of the friction was used.")
    print(f"Each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}.")
    assert error < 1e-5
    print("A tick takes {:.0f} µs in the median, {:.0f} µs in 99 of 100.".format(*np.quantile(times, [0.5, 0.99])))


if __name__ == "__main__":
    main()
