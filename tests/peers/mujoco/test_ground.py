"""The ground of a simulation compared with MuJoCo's contacts: a standing robot, and a box that slides to a stop."""

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
"""Gains of the joints (N m/rad, N m s/rad)."""
SOFT = 1e-3
"""Tolerance of a posture (m, rad): MuJoCo's contacts yield by some hundredths of a millimetre, and creep sideways by
some tenths in three seconds."""
LOADS = 5e-3
"""Tolerance of a foot's load, relative to the weight: a foot that yields carries less, the others more."""
PROMILLE = 3e-3
"""Relative tolerance of a stopping distance: both methods are of order h, and MuJoCo's friction builds up gradually."""


def standing(model: condyle.Model) -> Array:
    """Returns the quadruped's position with bent knees, its feet at height 0."""
    q = condyle.neutral(model)
    for leg, sign in (("LF", 1.0), ("RF", 1.0), ("LH", -1.0), ("RH", -1.0)):
        q[model.idx_qs[model.joint(f"{leg}_HFE")]] = 0.6 * sign
        q[model.idx_qs[model.joint(f"{leg}_KFE")]] = -1.2 * sign
    q[2] -= condyle.frame_placement(model, condyle.Data(model), q, "LF_foot")[2, 3]
    return q


@pytest.mark.parametrize("lean", [0.0, 0.05])
def test_a_quadruped_stands(lean: float) -> None:
    """With PD control of the joints on both sides, posture, height and the load of each foot are the same."""
    world = World(condyle.robots.QUADRUPED, FEET, BALL, FRICTION)
    world.mj.dof_damping[:] = world.mj.dof_frictionloss[:] = 0.0  # in Condyle they act only if requested
    world.mj.opt.impratio, world.mj.geom_solref[:] = 100.0, (0.002, 1.0)  # nearly rigid: friction creeps less
    model, data = world.model, condyle.Data(world.model)
    q0 = standing(model)
    aim = q0.copy()
    aim[model.idx_qs[model.joint("LF_HFE")]] += lean  # one leg is bent more, so loads differ

    def law(q: Array, v: Array) -> Array:
        tau = np.zeros(model.nv)
        tau[6:] = -STIFF * (q[7:] - aim[7:]) - DAMPED * v[6:]
        return tau

    # the contact points are the lowest points of the balls around the feet
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
    """The stopping distance is the same, and equals v²/(2 μ g)."""
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
    for _ in range(400):  # the box settles on its compliant contacts
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
