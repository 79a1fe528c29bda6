"""A humanoid stands on two soles, shifts its weight to one sole, lifts the other foot, and sets this foot down.

The contact of the lifted foot fades: its force limit decreases before lift-off, and increases after touch-down.

    python python/examples/wholebody_humanoid.py
"""

import numpy as np
from ground import Ground

import condyle
from condyle.wholebody import FrictionContact, Gains, Settings, Task, WholeBodyController

SOLES = ["left_sole", "right_sole"]
DT = 1e-3  # time step (s)
LIFT = 0.1  # height to which the foot is lifted (m)


def ramp(t: float, begin: float, end: float) -> np.ndarray:
    """Returns the value and the first two derivatives of a smooth function of time that is 0 until `begin` and 1 after
    `end`.
    """
    s, w = np.clip((t - begin) / (end - begin), 0.0, 1.0), 1.0 / (end - begin)
    value = s**3 * (10.0 + s * (6.0 * s - 15.0))
    return np.array([value, 30.0 * w * (s * (1.0 - s)) ** 2, 60.0 * w**2 * s * (1.0 - s) * (1.0 - 2.0 * s)])


def main() -> None:
    model = condyle.robots.humanoid()
    q = condyle.neutral(model)
    for name, i in zip(model.names, model.idx_qs, strict=True):
        if name.endswith(("hip_pitch", "knee", "ankle_pitch")):
            q[i] = 0.8 if name.endswith("knee") else -0.4  # joint angles with bent knees

    contacts = [FrictionContact.sole(sole, 0.7, [0.2, 0.1]) for sole in SOLES]
    tasks = [
        Task.com(gains=Gains.critical(30.0)),
        Task.orientation(model.body_names[1]),
        Task.pose("right_sole", weight=100.0, gains=Gains.critical(400.0)),
        Task.posture(),
    ]
    controller = WholeBodyController(model, contacts, tasks, Settings(contact_gains=Gains(0.0, 40.0)))
    q[2] -= controller.hold(q).contacts[0].pose[2, 3]  # the soles are at height 0
    start = controller.hold(q)
    aside = start.contacts[0].pose[1, 3] - start.com.position[1]
    ahead = start.contacts[0].pose[0, 3] - start.com.position[0]

    world, references = Ground(model, q, SOLES, "rigid"), start.copy()
    print("  t, s   centre of mass, mm    left f_z, N   right f_z, N   right sole, mm")
    error = 0.0
    for tick in range(5001):
        t = tick * DT
        # The weight goes to the left foot from 0.2 s to 1.2 s, and back from 3.8 s to 4.8 s.
        shift = ramp(t, 0.2, 1.2) - ramp(t, 3.8, 4.8)
        references.com.position[:2] = start.com.position[:2] + shift[0] * np.array([ahead, aside])
        references.com.velocity[1], references.com.acceleration[1] = aside * shift[1:]
        # The right foot is unloaded from 1.4 s to 1.6 s, is lifted and comes down, and is loaded again after 3.3 s.
        up = np.pi * np.clip((t - 1.6) / 1.6, 0.0, 1.0)
        references.frames[1].pose[2, 3] = start.frames[1].pose[2, 3] + LIFT * np.sin(up) ** 2
        references.frames[1].velocity[2] = LIFT * np.pi / 1.6 * np.sin(2.0 * up)
        references.contacts[1].activation = 1.0 - ramp(t, 1.4, 1.6)[0] + ramp(t, 3.3, 3.5)[0]

        command = controller.step(world.q, world.v, references).solved()
        error = max(error, *controller.kkt_residuals(world.q, world.v, references))
        forces = world.step(command.tau, DT)
        if tick % 250 == 0:
            now = controller.hold(world.q)
            c, sole = 1e3 * (now.com.position - start.com.position), 1e3 * now.frames[1].pose[2, 3]
            left, right = forces[:, 2]
            print(f"  {t:5.2f}   {c[0]:6.1f} {c[1]:6.1f} {c[2]:6.1f} {left:12.1f} {right:14.1f} {sole:14.1f}")
            assert abs(c[2]) < 50.0, "it falls"
    print(f"each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}")
    assert error < 1e-5


if __name__ == "__main__":
    main()
