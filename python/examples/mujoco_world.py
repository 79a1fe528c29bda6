"""Robot in MuJoCo and in Condyle, both made from one URDF, with conversions between the states of the two libraries.

MuJoCo stores the quaternion of a free joint with w first. The joint's linear velocity is along the world's axes, and
its angular velocity is along the body's axes. Condyle (like Pinocchio) stores w last, and both velocities are along the
body's axes.

The joints of the two libraries come in different orders, so they are found by name.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import mujoco
import numpy as np
from example_robot_data.robots_loader import getModelPath
from numpy.typing import NDArray

import condyle
from condyle.mpc import WholeBodyMpc

Array = NDArray[np.float64]

STIFFNESS = (0.005, 1.0)
"""Time constant (s) and damping ratio of MuJoCo's contacts. Under a humanoid, the contacts yield by several tenths of a
millimetre."""
THICKNESS = 0.02
"""Thickness of the box that represents a sole (m)."""
FLOOR = "floor"
"""Name of the floor's texture and material."""
ROBOT = (0.55, 0.6, 0.68, 1.0)
"""Colour of a robot: red, green, blue and opacity."""
FRAME = 0.04
"""Time between two pictures of a film (s)."""


def readable(shape: ET.Element) -> bool:
    """Returns whether MuJoCo can read a shape of a URDF."""
    mesh = shape.find("geometry/mesh")
    return mesh is None or Path(mesh.attrib["filename"]).suffix.lower() in (".stl", ".obj")


def bare(urdf: str, packages: Path | None = None, free: bool = True) -> str:
    """Returns a URDF with the links and joints of the given URDF. If the folder of packages is given, links also have
    the shapes that MuJoCo can show; they touch nothing. free: whether the root link moves freely."""
    robot = ET.fromstring(urdf)
    for link in robot.iter("link"):
        visuals, collisions = link.findall("visual"), link.findall("collision")
        for shape in visuals + collisions:
            link.remove(shape)
        if packages is None:
            continue
        for shape in filter(readable, visuals if all(map(readable, visuals)) else collisions):
            shape.tag = "visual"
            for mesh in shape.iter("mesh"):
                mesh.attrib["filename"] = str(packages / mesh.attrib["filename"].removeprefix("package://"))
            link.append(shape)
    for other in [child for child in robot if child.tag not in ("link", "joint")]:
        robot.remove(other)
    for inertia in robot.iter("inertia"):
        if float(inertia.attrib["ixx"]) <= abs(float(inertia.attrib["ixy"])):  # ANYmal's base is physically impossible
            inertia.attrib.update(dict.fromkeys(["ixy", "ixz", "iyz"], "0"))
    if free:
        moved = {joint.find("child").attrib["link"] for joint in robot.iter("joint")}
        root = next(link.attrib["name"] for link in robot.iter("link") if link.attrib["name"] not in moved)
        ET.SubElement(robot, "link", name="world")
        joint = ET.SubElement(robot, "joint", name="root_joint", type="floating")
        ET.SubElement(joint, "parent", link="world")
        ET.SubElement(joint, "child", link=root)
    options = {"fusestatic": "true", "strippath": "false", "discardvisual": "false"}
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", options)
    return ET.tostring(robot).decode()


def decorate(spec: mujoco.MjSpec) -> None:
    """Adds a light, a sky and the material of a chequered floor, and colours the robot."""
    for geom in spec.geoms:
        geom.rgba = ROBOT
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.4] * 3
    light = {"type": mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, "castshadow": False}
    spec.worldbody.add_light(dir=[0.3, 0.5, -1.0], diffuse=[0.5] * 3, **light)
    gradient, checker = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT, mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    sky = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": gradient, "width": 64, "height": 384}
    spec.add_texture(name="sky", rgb1=[0.95, 0.97, 1.0], rgb2=[0.75, 0.82, 0.9], **sky)
    tiles = {"type": mujoco.mjtTexture.mjTEXTURE_2D, "builtin": checker, "width": 256, "height": 256}
    spec.add_texture(name=FLOOR, rgb1=[0.82, 0.85, 0.88], rgb2=[0.68, 0.72, 0.76], **tiles)
    material = spec.add_material(name=FLOOR, texrepeat=[2.0, 2.0], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = FLOOR


class World:
    """Robot in MuJoCo, on ground that is level until `set_ground` changes it. Soles are boxes below the frames of the
    feet; point feet are balls around their frames."""

    def __init__(
        self,
        urdf: str,
        feet: Sequence[str],
        size: tuple[float, float] | float,
        friction: float = 0.7,
        dt: float = 1e-3,
        rise: Sequence[float] = (0.0, 0.0),
        packages: Path | None = None,
        frames: Mapping[str, tuple[str, Sequence[float]]] = MappingProxyType({}),
    ) -> None:
        """urdf: text of the URDF. size: side lengths of the soles along x and y (m), or radius of the balls (m).
        friction: coefficient of Coulomb friction in MuJoCo. rise: slopes of the ground along x and y. packages: folder
        of the packages that contain the meshes; None for a world without pictures. frames: frames that the URDF lacks,
        each with its parent and its position in the parent (m)."""
        self.model = condyle.Model.from_urdf_str(urdf, root_joint="free_flyer")
        for frame, (parent, position) in frames.items():
            placement = np.eye(4)
            placement[:3, 3] = position
            self.model = self.model.with_frame(frame, parent, placement)
        self.feet, self.ground = list(feet), 0.0
        spec = mujoco.MjSpec.from_string(bare(urdf, packages))
        spec.option.timestep = dt
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.impratio = 10.0
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        contact = {"friction": [friction, 0.005, 1e-4], "solref": STIFFNESS, "condim": 3}
        for k, foot in enumerate(feet):
            frame = self.model.frames[self.model.frame(foot)]
            shape = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [size, 0.0, 0.0], "pos": frame.placement[:3, 3]}
            if not isinstance(size, float):
                half, quat = [0.5 * size[0], 0.5 * size[1], 0.5 * THICKNESS], np.zeros(4)
                mujoco.mju_mat2Quat(quat, frame.placement[:3, :3].ravel())
                middle = frame.placement @ [0.0, 0.0, 0.5 * THICKNESS, 1.0]
                shape = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": half, "pos": middle[:3], "quat": quat}
            body = spec.body(self.model.body_names[frame.body])
            body.add_geom(name=foot, contype=1 << k, conaffinity=0, mass=0.0, **shape, **contact)
        if isinstance(size, float):
            self.ground = -size  # the plan assumes that the centres of the balls are at height 0
        quat = np.zeros(4)
        mujoco.mju_quatZ2Vec(quat, np.array([-rise[0], -rise[1], 1.0]))
        plane = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0], "quat": quat}
        if packages is not None:
            decorate(spec)
        for k, foot in enumerate(feet):  # each foot has its own ground, which can move; the first one is shown
            look = {"group": 3} if k > 0 else {"material": FLOOR} if packages is not None else {}
            ground = spec.worldbody.add_body(name=f"ground of {foot}", mocap=True, pos=[0.0, 0.0, self.ground])
            ground.add_geom(name=f"ground of {foot}", contype=0, conaffinity=1 << k, **plane, **contact, **look)
        self.spec, self.mj = spec, spec.compile()
        self.data = mujoco.MjData(self.mj)
        named = zip(self.model.names[1:], self.model.idx_qs[1:], self.model.idx_vs[1:], self.model.nqs[1:], strict=True)
        joints = [(self.mj.joint(name), q, v, nq) for name, q, v, nq in named]
        if [nq for *_, nq in joints] != [7] + [1] * (len(joints) - 1):
            raise ValueError("expected a free-flyer, and joints with one number each")
        self._ours = np.array([[q, v] for _, q, v, _ in joints[1:]]).T
        self._theirs = np.array([[joint.qposadr[0], joint.dofadr[0]] for joint, *_ in joints[1:]]).T
        self.trunk = int(self.mj.jnt_bodyid[0])
        self.poses: list[Array] = []

    @classmethod
    def of(cls, name: str, feet: Sequence[str], size: tuple[float, float] | float, **others: Any) -> "World":
        """Returns a world with pictures, for a robot in example-robot-data. name: path of the URDF in this package."""
        robots = Path(getModelPath(name))
        return cls((robots / name).read_text(), feet, size, packages=robots.parents[1], **others)

    @property
    def dt(self) -> float:
        """Time step (s)."""
        return float(self.mj.opt.timestep)

    @property
    def time(self) -> float:
        """Time since the state was set (s)."""
        return float(self.data.time)

    def is_due(self, period: float) -> bool:
        """Returns whether a period begins with the next time step."""
        return round(self.time / self.dt) % round(period / self.dt) == 0

    def stand(self, angles: Mapping[str, float]) -> Array:
        """Returns the position in which the robot stands, with the soles or the centres of the balls at height 0.
        angles: angles of joints, by a part of their name; the first part that fits counts (rad)."""
        q, data = condyle.neutral(self.model), condyle.Data(self.model)
        for name, index in zip(self.model.names[2:], self.model.idx_qs[2:], strict=True):
            q[index] = next((angle for part, angle in angles.items() if part in name), 0.0)
        q[2] -= min(condyle.frame_placement(self.model, data, q, foot)[2, 3] for foot in self.feet)
        return q

    def state(self) -> tuple[Array, Array]:
        """Returns (q, v), in Condyle's convention."""
        qpos, qvel, R = self.data.qpos, self.data.qvel, np.zeros(9)
        mujoco.mju_quat2Mat(R, qpos[3:7])
        q, v = np.zeros(self.model.nq), np.zeros(self.model.nv)
        q[:3], q[3:6], q[6] = qpos[:3], qpos[4:7], qpos[3]
        v[:3], v[3:6] = R.reshape(3, 3).T @ qvel[:3], qvel[3:6]
        q[self._ours[0]], v[self._ours[1]] = qpos[self._theirs[0]], qvel[self._theirs[1]]
        return q, v

    def set_state(self, q: Array, v: Array) -> None:
        """Sets a state given in Condyle's convention, and the time 0."""
        mujoco.mj_resetData(self.mj, self.data)
        self.poses.clear()
        qpos, qvel, R = self.data.qpos, self.data.qvel, np.zeros(9)
        qpos[:3], qpos[4:7], qpos[3] = q[:3], q[3:6], q[6]
        mujoco.mju_quat2Mat(R, qpos[3:7])
        qvel[:3], qvel[3:6] = R.reshape(3, 3) @ v[:3], v[3:6]
        qpos[self._theirs[0]], qvel[self._theirs[1]] = q[self._ours[0]], v[self._ours[1]]
        mujoco.mj_forward(self.mj, self.data)

    def set_ground(self, foot: str, height: float) -> None:
        """Sets the height of the ground below one foot (m), while the foot is in the air. At 0 the ground is level. The
        other feet keep their ground, so that no foot meets an edge."""
        self.data.mocap_pos[self.mj.body(f"ground of {foot}").mocapid[0], 2] = self.ground + height

    def generalized(self, tau: Array) -> Array:
        """Returns the efforts of Condyle's joints in MuJoCo's order."""
        out = np.zeros(self.mj.nv)
        out[self._theirs[1]] = tau[self._ours[1]]
        return out

    def step(self, tau: Array, push: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
        """Simulates one time step with given efforts of the joints and a given force on the trunk (N). The force acts
        at the trunk's centre of mass, along the world's axes."""
        self.data.qfrc_applied[:] = self.generalized(tau)
        self.data.xfrc_applied[self.trunk, :3] = push
        if self.is_due(FRAME):
            self.poses.append(self.data.qpos.copy())
        mujoco.mj_step(self.mj, self.data)

    def loads(self) -> Array:
        """Returns the force of the ground on each foot in the last step, in world coordinates, with the shape (feet,
        3)."""
        out, force = np.zeros((len(self.feet), 3)), np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            mujoco.mj_contactForce(self.mj, self.data, k, force)
            names = [self.mj.geom(geom).name for geom in contact.geom]
            sign = -1.0 if names[0] in self.feet else 1.0  # the contact force acts on the contact's second geom
            foot = next(k for k, foot in enumerate(self.feet) if foot in names)
            out[foot] += sign * contact.frame.reshape(3, 3).T @ force[:3]
        return out


def walk(world: World, mpc: WholeBodyMpc, commands: Sequence[Mapping[str, float]], seconds: float = 2.0) -> None:
    """Lets the robot walk with each command for some seconds, and prints its velocity after each second. The plan is
    renewed at 50 Hz, and the policy follows it at each time step."""
    mpc.reset(np.concatenate(world.state()))
    policy = mpc.policy()
    while world.time < seconds * len(commands) - 1e-9:
        t, x = world.time, np.concatenate(world.state())
        if world.is_due(0.02) and t > 0.0:
            mpc.command(**commands[min(int(t / seconds), len(commands) - 1)])
            mpc.update(t, x)
        world.step(np.r_[np.zeros(6), policy(t, x)])
        if world.is_due(1.0):
            print(f"{world.time:.0f} s: velocity {world.state()[1][[0, 1, 5]].round(2)} m/s and rad/s")
