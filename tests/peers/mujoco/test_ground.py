"""Compares the ground of a simulation with MuJoCo's contacts, for a standing robot and a box that slides to a stop."""

import mujoco
import numpy as np
import pytest
from world import Array, World

import condyle
from condyle.simulation import Control, Ground, Simulation

FEET = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"]
FRICTION = 0.7
BALL = 0.03
"""Radius of the feet (m)."""
STIFF, DAMPED = 600.0, 8.0
"""Stiffness and damping of the joints (N m/rad, N m s/rad)."""
SOFT = 1e-3
"""Tolerance of a posture (m, rad). In three seconds, feet in MuJoCo sink by several hundredths of a millimetre, and
slide sideways by several tenths of a millimetre."""
LOADS = 5e-3
"""Tolerance of the load on a foot, relative to the robot's weight. In MuJoCo, a foot that sinks carries less load, and
the other feet carry more."""
PROMILLE = 3e-3
"""Relative tolerance of a stopping distance. The errors of both libraries are proportional to the time step, and
MuJoCo's friction force increases gradually."""


def standing(model: condyle.Model) -> Array:
    """Returns a position of the quadruped with bent knees, and with the feet at height 0."""
    q = condyle.neutral(model)
    for leg, sign in (("LF", 1.0), ("RF", 1.0), ("LH", -1.0), ("RH", -1.0)):
        q[model.idx_qs[model.joint(f"{leg}_HFE")]] = 0.6 * sign
        q[model.idx_qs[model.joint(f"{leg}_KFE")]] = -1.2 * sign
    q[2] -= condyle.frame_placement(model, condyle.Data(model), q, "LF_foot")[2, 3]
    return q


@pytest.mark.parametrize("lean", [0.0, 0.05])
def test_a_quadruped_stands(lean: float) -> None:
    """Tests that a robot with the same PD control of its joints has the same posture, height and foot loads in both
    libraries."""
    world = World(condyle.robots.QUADRUPED, FEET, BALL, FRICTION)
    # a simulation in Condyle includes damping and friction only if requested
    world.mj.dof_damping[:] = world.mj.dof_frictionloss[:] = 0.0
    world.mj.opt.impratio, world.mj.geom_solref[:] = 100.0, (0.002, 1.0)  # nearly rigid contacts, so feet slide less
    model, data = world.model, condyle.Data(world.model)
    q0 = standing(model)
    aim = q0.copy()
    aim[model.idx_qs[model.joint("LF_HFE")]] += lean  # one leg is bent more, so the loads of the feet differ

    def law(q: Array, v: Array) -> Array:
        tau = np.zeros(model.nv)
        tau[6:] = -STIFF * (q[7:] - aim[7:]) - DAMPED * v[6:]
        return tau

    # The contact points are the lowest points of the balls around the feet.
    below = [condyle.frame_placement(model, data, q0, foot)[:3, :3].T @ [0.0, 0.0, -BALL] for foot in FEET]
    points = [(foot, [point]) for foot, point in zip(FEET, below, strict=True)]
    simulation = Simulation(model, ground=Ground(points, height=-BALL, friction=FRICTION))

    def control(now: Control) -> None:
        now.tau[:] = law(now.q, now.v)

    simulation.set_state(q0, np.zeros(model.nv))
    world.set_state(q0, np.zeros(model.nv))
    assert simulation.run(3000, control) == "done"
    for _ in range(3000):
        world.step(law(*world.state()))
    q, v = world.state()
    assert np.abs(v).max() < SOFT and np.abs(simulation.v).max() < SOFT
    np.testing.assert_allclose(simulation.q, q, atol=SOFT)
    weight = 9.81 * model.total_mass
    np.testing.assert_allclose(simulation.contacts.force, world.loads(), atol=LOADS * weight)
    assert np.isclose(simulation.contacts.force[:, 2].sum(), weight, rtol=1e-4)
    assert simulation.contacts.touches.all()


@pytest.mark.parametrize(("mu", "speed"), [(0.2, 1.0), (0.5, 2.0)])
def test_a_box_slides_to_a_stop(mu: float, speed: float) -> None:
    """Tests that a box with the initial speed v stops after the distance v²/(2 μ g) in both libraries."""
    x, y, z, dt = 0.2, 0.15, 0.05, 5e-4
    text = f"""<mujoco>
      <option timestep="{dt}" cone="elliptic" impratio="100" integrator="implicitfast"/>
      <worldbody>
        <geom name="ground" type="plane" size="0 0 1" friction="{mu}" condim="3" solref="0.005 1"/>
        <body name="box" pos="0 0 {z}"><freejoint name="free"/>
          <geom type="box" size="{x} {y} {z}" mass="3" friction="{mu}" condim="3" solref="0.005 1"/>
        </body>
      </worldbody></mujoco>"""
    mj = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(mj)
    for _ in range(400):  # the box first settles on MuJoCo's compliant contacts
        mujoco.mj_step(mj, data)
    begin = data.qpos[0]
    data.qvel[0] = speed
    for _ in range(round(1.2 * speed / (mu * 9.81 * dt))):
        mujoco.mj_step(mj, data)
    theirs = data.qpos[0] - begin

    model = condyle.Model.from_mjcf_str(text).with_frame("centre", "box")
    corners = [[a * x, b * y, -z] for a in (-1, 1) for b in (-1, 1)]
    simulation = Simulation(model, dt=dt, ground=Ground([("centre", corners)], friction=mu))
    q, v = condyle.neutral(model), np.zeros(6)
    q[2], v[0] = z, speed
    simulation.set_state(q, v)
    assert simulation.run(round(1.2 * speed / (mu * 9.81 * dt))) == "done"
    ours = simulation.q[0]
    expected = speed**2 / (2.0 * mu * 9.81)
    assert abs(simulation.v).max() < 1e-6
    np.testing.assert_allclose([ours, theirs], expected, rtol=PROMILLE)
