"""Compares robots with Drake: from SDF, from URDF, and from MJCF if MuJoCo does not read the file."""

import atexit
import logging
import re
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from comparison import STATES, Joint, Quantities, RefusedError, UnlikeError, state_of, there
from files import text_of
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, FrameIndex, JointIndex, MultibodyForces, world_model_instance

import condyle


class Warnings(logging.Handler):
    """Log handler that stores the warnings of Drake about the last file."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Stores the text of a warning."""
        self.texts.append(record.getMessage())


warnings = Warnings()
logger = logging.getLogger("drake")
logger.addHandler(warnings)
logger.propagate = False
REPLACED = ("While parsing inertia matrix", "While re-expressing as central inertia")
"""Beginnings of Drake's warnings that it replaces an inertia of the file by another inertia."""
TOLERANCE = 1e-10
CONVERTED = 1e-8
"""Tolerance for SDFs before version 1.7. Drake converts them to a later version with rounded numbers."""
UNLIMITED = 1e16
"""Limit of position that means "no limit": the default of SDF, which is also common in URDFs."""
LENGTHS = {
    "revolute": (1, 1),
    "prismatic": (1, 1),
    "screw": (1, 1),
    "universal": (2, 2),
    "planar": (3, 3),
    "ball_rpy": (3, 3),
    "quaternion_floating": (7, 6),
    "weld": (0, 0),
}
"""Numbers of positions and of velocities of Drake's joints, for each joint type that this program can convert."""


IRRELEVANT = {
    *("sensor", "plugin", "visual", "collision", "light", "gui", "scene", "physics", "audio", "wind", "state", "road"),
    *("population", "atmosphere", "magnetic_field", "projector", "battery", "particle_emitter", "material", "contact"),
    *("velocity_decay", "kinematic", "audio_sink", "audio_source", "actor", "spherical_coordinates"),
}
"""Elements of SDF that have no effect on the compared quantities. Drake rejects some files because of these
elements."""


class Copies:
    """Copies of all SDFs below a folder, without the elements in `IRRELEVANT`, and Drake's map of the copied packages.
    SDFs whose inertias depend on shapes are copied unchanged."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.place = folder, Path(tempfile.mkdtemp(prefix="robots-"))
        atexit.register(shutil.rmtree, self.place, ignore_errors=True)
        self.packages = PackageMap.MakeEmpty()
        for mark in ("package.xml", "model.config"):
            for path in sorted(folder.rglob(mark)):
                if not self.packages.Contains(path.parent.name):
                    home = self.of(path).parent
                    home.mkdir(parents=True, exist_ok=True)
                    shutil.copy(path, home)
                    self.packages.Add(path.parent.name, str(home))
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".sdf", ".world") and path.is_file():
                copy = self.of(path)
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_text(self.plain(path), encoding="utf-8")

    def of(self, path: Path) -> Path:
        """Returns the path of a file's copy. The copy has a suffix that Drake recognises."""
        copy = self.place / path.relative_to(self.folder)
        return copy.with_name(copy.name + ".sdf") if copy.suffix == ".world" else copy

    def plain(self, path: Path) -> str:
        """Returns the text of an SDF without the elements in `IRRELEVANT`. If inertias depend on shapes, returns the
        text unchanged."""
        text = text_of(path)
        if re.search(r"\bauto\s*=\s*[\"'](?:true|1)", text):
            return text
        try:
            tree = ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError):
            return text
        for prefix, uri in re.findall(r"xmlns:(\w+)\s*=\s*[\"']([^\"']+)[\"']", text):
            ElementTree.register_namespace(prefix, uri)  # keep the prefixes of Drake's own elements
        for parent in list(tree.iter()):
            for child in list(parent):
                if child.tag in IRRELEVANT:
                    parent.remove(child)
        for uri in tree.iterfind(".//include/uri"):
            name = (uri.text or "").strip()
            if "://" not in name and not (path.parent / name).exists() and self.packages.Contains(name.split("/")[0]):
                uri.text = f"model://{name}"
        return ElementTree.tostring(tree, encoding="unicode")


@cache
def copies(folder: Path) -> Copies:
    """Copies all SDFs below a folder to a temporary folder, and returns the copies."""
    return Copies(folder)


def read(path: Path, folder: Path) -> MultibodyPlant:
    """Returns Drake's plant for a file. The models in the file move freely, unless they are fixed to the world."""
    warnings.texts.clear()
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    here = copies(folder)
    parser.package_map().AddMap(here.packages)
    copy = here.of(path)
    try:
        parser.AddModels(str(copy if copy.exists() else path))
        plant.Finalize()
    except (RuntimeError, ValueError, MemoryError, SystemExit) as error:  # a failed assertion is a SystemExit
        raise RefusedError(str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__) from None
    if plant.num_bodies() < 2:
        raise RefusedError("no bodies")
    return plant


def compare(plant: MultibodyPlant, model: condyle.Model, tolerance: float = TOLERANCE) -> Quantities:
    """Compares all quantities that exist in Condyle and in Drake. The efforts of gravity are compared separately from
    other efforts."""
    found = Quantities(model, tolerance)
    if plant.num_velocities() != model.nv:
        if any("::" in frame.name for frame in model.frames) and model.nv < plant.num_velocities():
            raise UnlikeError("Drake lets models inside of a static model move")
        found.add("nv", np.inf, f"{model.nv}, theirs {plant.num_velocities()}")
        return found
    if any(mark in text for text in warnings.texts for mark in REPLACED):
        why = "Drake replaces inertias that no body has"
        found.leave_out(why, "M", "bias", "gravity's efforts", "total mass")
    if any(frame.name == "world" for frame in model.frames):
        found.leave_out("Drake leaves the inertia of a link `world` out", "total mass")
    joints = matched(found, plant)
    if joints is None:
        return found
    context, data = plant.CreateDefaultContext(), found.data
    found.expect("total mass", model.total_mass, plant.CalcTotalMass(context))
    nq, nv = plant.num_positions(), plant.num_velocities()
    still = model.with_gravity([0.0, 0.0, 0.0])
    falling = model.with_gravity(plant.gravity_field().gravity_vector())  # Drake ignores the gravity of the file
    for seed in range(STATES):
        q, v = state_of(model, seed)
        state = there("drake", model, joints, q, v, nq, nv)
        plant.SetPositions(context, state.q)
        plant.SetVelocities(context, state.v)
        if nv:
            M, T = plant.CalcMassMatrix(context), state.T
            found.expect("M", condyle.crba(model, data, q), T.T @ M @ T, found.coordinate)
            bias = T.T @ (plant.CalcBiasTerm(context) + M @ state.drift)
            found.expect("bias", condyle.nonlinear_effects(still, data, q, v), bias, found.coordinate)
            weight = -T.T @ plant.CalcGravityGeneralizedForces(context)
            found.expect("gravity's efforts", condyle.gravity(falling, data, q), weight, found.coordinate)
            springs(found, plant, context, q, T)
        frames(found, plant, context, q)
    return found


class Names:
    """Joints, bodies or frames of Drake's plant, by name. A full name begins with the names of the models that contain
    the object."""

    def __init__(self) -> None:
        self.all: dict[str, list[Any]] = {}

    def add(self, plant: MultibodyPlant, thing: Any, name: str) -> None:
        """Adds an object under its name and the name of its model."""
        instance = thing.model_instance()
        around = "" if instance == world_model_instance() else f"{plant.GetModelInstanceName(instance)}::"
        self.all.setdefault(around + name, []).append(thing)

    def find(self, name: str) -> list[Any]:
        """Returns the objects for a name in Condyle's model, which may lack the names of the outermost models."""
        ends = [full for full in self.all if f"::{full}".endswith(f"::{name}")]
        if not ends:  # Drake assigns a joint between nested models to another model
            ends = [full for full in self.all if full.split("::")[-1] == name.split("::")[-1]]
            ends = ends if len(ends) == 1 else []
        return self.all[min(ends, key=len)] if ends else []


def matched(found: Quantities, plant: MultibodyPlant) -> list[Joint] | None:
    """Returns the moving joints of Condyle with their coordinates in Drake. Joints are matched by name; floating joints
    by the body that they carry."""
    model, theirs, carriers = found.model, Names(), Names()
    for i in range(plant.num_joints()):
        joint = plant.get_joint(JointIndex(i))
        kind = joint.type_name()
        if LENGTHS.get(kind) != (joint.num_positions(), joint.num_velocities()):
            raise UnlikeError(f"{kind} joints have other coordinates there")
        if joint.is_ephemeral() and joint.num_velocities():
            carriers.add(plant, joint.child_body(), joint.child_body().name())
            carriers.all[f"joint {joint.child_body().index()}"] = [joint]
        elif joint.num_velocities():
            theirs.add(plant, joint, joint.name())
    joints, i = [], 1
    while i < model.nbodies:
        options = theirs.find(model.names[i].split("#")[0])
        if not options:
            carried = carriers.find(model.body_names[i])
            options = carriers.all.get(f"joint {carried[0].index()}", []) if carried else []
        if not options or LENGTHS[options[0].type_name()][1] not in (model.nvs[i], 2):
            found.add("joints", np.inf, f"joint `{model.names[i]}` is none of theirs")
            return None
        joint = options.pop(0)
        at_q, at_v = joint.position_start(), joint.velocity_start()
        joints.append(Joint(i, at_q, at_v))
        if joint.type_name() == "universal":
            joints.append(Joint(i + 1, at_q + 1, at_v + 1))
            i += 1
        elif joint.num_positions() == 1:
            limits(found, joint, plant, i)
        i += 1
    return joints


def limits(found: Quantities, joint: object, plant: MultibodyPlant, body: int) -> None:
    """Compares the limits of one coordinate. The effort limit is compared only if Drake has an actuator: Drake creates
    no actuator for 0 N m."""
    model, limits = found.model, found.model.limits
    at, column = model.idx_qs[body], model.idx_vs[body]
    name = f"joint `{model.names[body]}`"

    def expect(what: str, ours: object, theirs: object) -> None:
        found.expect(what, ours, theirs, lambda _: name)

    if model.nqs[body] == 1:
        theirs = unlimited((joint.position_lower_limits()[0], joint.position_upper_limits()[0]))
        if limits.lower[at] == limits.upper[at] == 0.0 and np.isinf(theirs).all():
            found.left_out["limits: position"] = "Drake takes missing limits of a URDF for none"
        expect("limits: position", unlimited((limits.lower[at], limits.upper[at])), theirs)
    expect("limits: velocity", limits.velocity[column], joint.velocity_upper_limits()[0])
    expect("damping", model.damping[column], joint.default_damping_vector()[0])
    for i in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(i)
        if actuator.joint().index() == joint.index():
            expect("limits: effort", limits.effort[column], actuator.effort_limit())


def springs(found: Quantities, plant: MultibodyPlant, context: object, q: np.ndarray, T: np.ndarray) -> None:
    """Compares springs of joints, for a robot at rest."""
    nv = plant.num_velocities()
    plant.SetVelocities(context, np.zeros(nv))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    weightless = found.model.with_gravity([0.0, 0.0, 0.0])  # Drake applies gravity to all links
    ours = condyle.passive_torque(weightless, q=q, v=np.zeros(found.model.nv), smoothing=1.0)
    found.expect("springs", ours, T.T @ forces.generalized_forces(), found.coordinate)


def unlimited(numbers: object) -> np.ndarray:
    """Returns limits, in which infinity replaces the numbers that mean "no limit" in SDF."""
    limits = np.asarray(numbers, float)
    return np.where(np.abs(limits) >= UNLIMITED, np.sign(limits) * np.inf, limits)


def frames(found: Quantities, plant: MultibodyPlant, context: object, q: np.ndarray) -> None:
    """Compares the frames whose names exist in Condyle and in Drake."""
    bodies, others = Names(), Names()
    for body in (plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())):
        bodies.add(plant, body, body.name())
    for frame in (plant.get_frame(FrameIndex(i)) for i in range(plant.num_frames())):
        if not frame.is_body_frame():
            others.add(plant, frame, frame.name())
    for i, frame in enumerate(found.model.frames):
        if frame.kind == "link":
            options = [body.body_frame() for body in bodies.find(frame.name)]
        else:
            options = others.find(frame.name) if frame.kind == "user" else []
        if len(options) == 1:
            ours = condyle.frame_placement(found.model, found.data, q, i)
            pose = options[0].CalcPoseInWorld(context).GetAsMatrix4()
            found.expect("frames", ours, pose, lambda _, name=frame.name: f"frame `{name}`")
