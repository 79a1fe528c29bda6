"""Random robots, which are built by calls of Pinocchio and of Condyle. Together the robots have every kind of joint of
both libraries.

Universal, spherical ZYX and composite joints of Pinocchio are built in two forms: as one joint, or as several joints
with massless bodies between them, as in Condyle. In both forms, q and v have the same layout.
"""

import numpy as np
import pinocchio as pin
from comparison import Pair

import condyle
from condyle import BodyId, Inertia, Joint, ModelBuilder

BRANCH = 0.4
"""Probability that the parent of a new body is an ancestor of the previous body, instead of the previous body
itself."""
ONE = ("revolute", "continuous", "prismatic", "helical")
"""Kinds of joints with an axis, which may be x, y, z or any other axis."""
OTHERS = ("spherical", "planar", "translation", "free_flyer")
COMPOSITES = ("universal", "spherical_zyx", "composite")
PARTS = ("revolute", "helical", "prismatic", "continuous")
"""Kinds of joints that a composite joint may combine."""
ALIGNED = {
    "revolute": (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
    "continuous": (pin.JointModelRUBX, pin.JointModelRUBY, pin.JointModelRUBZ),
    "prismatic": (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
    "helical": (pin.JointModelHX, pin.JointModelHY, pin.JointModelHZ),
}
UNALIGNED = {
    "revolute": pin.JointModelRevoluteUnaligned,
    "prismatic": pin.JointModelPrismaticUnaligned,
    "helical": pin.JointModelHelicalUnaligned,
}
"""Kind of continuous joints about any axis. In Pinocchio, only the URDF parser creates such joints."""
FREE = {
    "spherical": (pin.JointModelSpherical, Joint.spherical),
    "planar": (pin.JointModelPlanar, Joint.planar),
    "translation": (pin.JointModelTranslation, Joint.translation),
    "free_flyer": (pin.JointModelFreeFlyer, Joint.free_flyer),
}

Part = tuple[pin.JointModel, Joint, pin.SE3]
"""Joint in Pinocchio and in Condyle, with its placement."""


class RandomRobot:
    """Random robot with joints of the given kinds, in any order. Bodies are added depth first, in the order in which
    both libraries number bodies."""

    def __init__(self, name: str, seed: int, kinds: tuple[str, ...], composites: bool) -> None:
        self.rng, self.composites = np.random.default_rng(seed), composites
        pin.seed(seed)
        self.theirs, self.builder = pin.Model(), ModelBuilder(name)
        self.theirs.name = name
        chains: list[list[int]] = [[0]]
        path: list[tuple[int, BodyId]] = [(0, condyle.WORLD)]
        for i, kind in enumerate(self.rng.permutation(kinds)):
            while len(path) > 1 and self.rng.random() < BRANCH:
                path.pop()
            parts = self.parts(kind)
            path.append(self.add(f"{i} {kind}", parts, *path[-1]))
            first = chains[-1][-1] + 1
            bodies = list(range(first, first + len(parts)))
            chains += [bodies] if composites else [[body] for body in bodies]
        armature = self.rng.uniform(0, 1, self.theirs.nv)
        self.pair = Pair(name, self.theirs, self.builder.build(), chains=chains)
        self.geared = self.pair.with_armature(armature)

    def axis(self) -> np.ndarray:
        axis = self.rng.standard_normal(3)
        return axis / np.linalg.norm(axis)

    def part(self, kind: str) -> Part:
        """Creates a simple joint, which has one axis or no axis."""
        X = pin.SE3.Random()
        if kind in FREE:
            theirs, ours = FREE[kind]
            return theirs(), ours(), X
        k, pitch = int(self.rng.integers(4)), (float(self.rng.uniform(-0.5, 0.5)),) * (kind == "helical")
        if k < 3 or kind not in UNALIGNED:
            return ALIGNED[kind][k % 3](*pitch), getattr(Joint, kind)(np.eye(3)[k % 3], *pitch), X
        axis = self.axis()
        return UNALIGNED[kind](axis, *pitch), getattr(Joint, kind)(axis, *pitch), X

    def revolute(self, axis: np.ndarray, X: pin.SE3) -> Part:
        return pin.JointModelRevoluteUnaligned(axis), Joint.revolute(axis), X

    def parts(self, kind: str) -> list[Part]:
        """Returns the simple joints of which a joint of the given kind consists."""
        X, here = pin.SE3.Random(), pin.SE3.Identity()
        if kind == "universal":
            a, b = self.axis(), self.axis()
            b = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
            return [self.revolute(a, X), self.revolute(b, here)]
        if kind == "spherical_zyx":
            z, y, x = np.eye(3)[::-1]
            return [self.revolute(z, X), self.revolute(y, here), self.revolute(x, here)]
        if kind == "composite":
            return [self.part(part) for part in PARTS]
        return [self.part(kind)]

    def add(self, name: str, parts: list[Part], parent: int, on: BodyId) -> tuple[int, BodyId]:
        """Adds a body with its joint, and a frame on the body, to Pinocchio's and to Condyle's robot."""
        inertia, kind = pin.Inertia.Random(), name.split()[1]
        ours = Inertia.from_com(inertia.mass, inertia.lever, inertia.inertia)
        if kind == "spherical_zyx":
            body = self.builder.spherical_zyx(name, on, parts[0][2].homogeneous, ours)
        elif len(parts) > 1:
            body = self.builder.chain(name, on, [(our, X.homogeneous) for _, our, X in parts], ours)
        else:
            return self.add_one(name, parts[0], inertia, parent, on)
        if self.composites:
            joint = self.theirs.addJoint(parent, composite(kind, parts), parts[0][2], name)
            self.theirs.addJointFrame(joint)
        else:
            joint = parent
            for i, (their, _, X) in enumerate(parts, start=1):
                joint = self.theirs.addJoint(joint, their, X, name if i == len(parts) else f"{name}#{i}")
                self.theirs.addJointFrame(joint)
        self.theirs.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        self.add_frame(name, joint, body)
        return joint, body

    def add_one(self, name: str, part: Part, inertia: pin.Inertia, parent: int, on: BodyId) -> tuple[int, BodyId]:
        """Adds a joint that is a single joint in Pinocchio and in Condyle, with limits, damping and friction."""
        their, our, X = part
        effort, velocity, friction, damping = self.rng.uniform(0, 1, 4)
        lower, upper = self.rng.uniform(-3, 0), self.rng.uniform(0, 3)
        each, none = np.ones(our.nv), np.full(our.nq, np.inf)
        position = (np.array([lower]), np.array([upper])) if our.nq == 1 else (-none, none)
        limits = (-effort * each, effort * each, -velocity * each, velocity * each, *position)
        losses = (-friction * each, friction * each, damping * each)
        joint = self.theirs.addJoint(parent, their, X, name, *limits, *losses)
        self.theirs.addJointFrame(joint)
        self.theirs.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        body = self.builder.body(
            name,
            on,
            our,
            X.homogeneous,
            Inertia.from_com(inertia.mass, inertia.lever, inertia.inertia),
            position=(lower, upper) if our.nq == 1 else None,
            velocity=velocity,
            effort=effort,
            damping=damping,
            friction=friction,
        )
        self.add_frame(name, joint, body)
        return joint, body

    def add_frame(self, name: str, joint: int, body: BodyId) -> None:
        X = pin.SE3.Random()
        self.theirs.addFrame(pin.Frame(f"on {name}", joint, X, pin.FrameType.OP_FRAME))
        self.builder.frame(f"on {name}", body, X.homogeneous)


def composite(kind: str, parts: list[Part]) -> pin.JointModel:
    """Combines several joints into one composite joint of Pinocchio with the placement of the first joint."""
    if kind == "universal":
        return pin.JointModelUniversal(*(ours.axis for _, ours, _ in parts))
    if kind == "spherical_zyx":
        return pin.JointModelSphericalZYX()
    joint = pin.JointModelComposite()
    for i, (theirs, _, X) in enumerate(parts):
        joint.addJoint(theirs, X if i else pin.SE3.Identity())
    return joint
