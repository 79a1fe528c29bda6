"""Comparison of robots with Drake: SDF, URDF, and MJCF that MuJoCo does not read."""

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
    """Drake's warnings about the last file."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps a warning."""
        self.texts.append(record.getMessage())


warnings = Warnings()
logger = logging.getLogger("drake")
logger.addHandler(warnings)
logger.propagate = False
REPLACED = ("While parsing inertia matrix", "While re-expressing as central inertia")
"""Warnings after which Drake takes another inertia than the file's."""
TOLERANCE = 1e-10
CONVERTED = 1e-8
"""Tolerance of SDFs before 1.7, which Drake converts to later ones with rounded numbers."""
UNLIMITED = 1e16
"""SDF's default of limits of position, and a common one of URDFs: no limit."""
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
"""Numbers of positions and velocities of the kinds of joints whose coordinates are known here."""


IRRELEVANT = {
    *("sensor", "plugin", "visual", "collision", "light", "gui", "scene", "physics", "audio", "wind", "state", "road"),
    *("population", "atmosphere", "magnetic_field", "projector", "battery", "particle_emitter", "material", "contact"),
    *("velocity_decay", "kinematic", "audio_sink", "audio_source", "actor", "spherical_coordinates"),
}
"""Elements of SDF without effect on what is compared. Drake refuses files for some of them."""


class Copies:
    """Copies of the SDFs below a folder without irrelevant elements, and the packages that Drake finds among them."""

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
        """Returns the path of a copy, with a suffix that Drake knows."""
        copy = self.place / path.relative_to(self.folder)
        return copy.with_name(copy.name + ".sdf") if copy.suffix == ".world" else copy

    def plain(self, path: Path) -> str:
        """Returns the text of an SDF without irrelevant elements; as it is if its inertias depend on shapes."""
        text = text_of(path)
        if re.search(r"\bauto\s*=\s*[\"'](?:true|1)", text):
            return text
        try:
            tree = ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError):
            return text
        for prefix, uri in re.findall(r"xmlns:(\w+)\s*=\s*[\"']([^\"']+)[\"']", text):
            ElementTree.register_namespace(prefix, uri)  # Drake knows its own elements by the prefix
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
    """Returns the copies of a folder's SDFs."""
    return Copies(folder)


def read(path: Path, folder: Path) -> MultibodyPlant:
    """Returns Drake's plant of a file; the models of a file move freely, unless they are fixed to the world."""
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
    except (RuntimeError, ValueError, MemoryError, SystemExit) as error:  # an assertion of Drake's is a SystemExit
        raise RefusedError(str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__) from None
    if plant.num_bodies() < 2:
        raise RefusedError("no bodies")
    return plant


def compare(plant: MultibodyPlant, model: condyle.Model, tolerance: float = TOLERANCE) -> Quantities:
    """Compares everything that both have; gravity's efforts apart from the others."""
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
    falling = model.with_gravity(plant.gravity_field().gravity_vector())  # Drake leaves the file's out
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
    """Things of a plant by their names, with the names of the models around them."""

    def __init__(self) -> None:
        self.all: dict[str, list[Any]] = {}

    def add(self, plant: MultibodyPlant, thing: Any, name: str) -> None:
        """Adds a thing with a name inside of its model."""
        instance = thing.model_instance()
        around = "" if instance == world_model_instance() else f"{plant.GetModelInstanceName(instance)}::"
        self.all.setdefault(around + name, []).append(thing)

    def find(self, name: str) -> list[Any]:
        """Returns the things of a name of ours, of which the outermost models may be left out, or several of them."""
        ends = [full for full in self.all if f"::{full}".endswith(f"::{name}")]
        if not ends:  # a joint between nested models is in another model there
            ends = [full for full in self.all if full.split("::")[-1] == name.split("::")[-1]]
            ends = ends if len(ends) == 1 else []
        return self.all[min(ends, key=len)] if ends else []


def matched(found: Quantities, plant: MultibodyPlant) -> list[Joint] | None:
    """Returns the joints that move, ours with theirs by names; floating joints by the body that they carry."""
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
    """Compares limits of one coordinate; effort only where Drake has an actuator: it makes none for 0 N m."""
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
    """Compares springs of joints, at rest."""
    nv = plant.num_velocities()
    plant.SetVelocities(context, np.zeros(nv))
    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    weightless = found.model.with_gravity([0.0, 0.0, 0.0])  # Drake lets all links feel it
    ours = condyle.passive_torque(weightless, q=q, v=np.zeros(found.model.nv), smoothing=1.0)
    found.expect("springs", ours, T.T @ forces.generalized_forces(), found.coordinate)


def unlimited(numbers: object) -> np.ndarray:
    """Returns limits with infinity for the numbers by which SDF means none."""
    limits = np.asarray(numbers, float)
    return np.where(np.abs(limits) >= UNLIMITED, np.sign(limits) * np.inf, limits)


def frames(found: Quantities, plant: MultibodyPlant, context: object, q: np.ndarray) -> None:
    """Compares frames that both have by their names."""
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
