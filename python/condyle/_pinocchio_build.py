"""Functions that make models with Pinocchio's interface: from files, from other models, and sample models."""

import os
from collections.abc import Sequence

from numpy.typing import ArrayLike

from . import _condyle as ours
from . import _pinocchio_samples as samples
from . import algebra
from ._spelling import JointModelFreeFlyer, Model


def buildModelFromUrdf(path: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """Reads a robot from a URDF file."""
    return Model(ours.Model.from_urdf(path, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromXML(text: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """Reads a robot from a URDF's text."""
    return Model(ours.Model.from_urdf_str(text, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromMJCF(path: str) -> Model:
    """Reads a robot from an MJCF file."""
    return Model(ours.Model.from_mjcf(path))


def buildSampleModelManipulator() -> Model:
    """Returns Pinocchio's arm with six joints."""
    return Model(samples.manipulator())


def buildSampleModelHumanoid() -> Model:
    """Returns Pinocchio's humanoid with 28 joints on a free-flyer."""
    return Model(samples.humanoid())


def buildSampleModelHumanoidRandom() -> Model:
    """Returns a humanoid like Pinocchio's random humanoid, on a free-flyer. The numbers differ from Pinocchio's
    numbers, since NumPy draws them.
    """
    return Model(samples.random_humanoid())


def buildReducedModel(model: Model, joints: Sequence[int], q: ArrayLike) -> Model:
    """Returns the robot with some joints locked at their positions in q."""
    return Model(model.ours.lock([model.names[joint] for joint in joints], q))


def appendModel(modelA: Model, modelB: Model, frameInModelA: int, aMb: algebra.SE3) -> Model:
    """Returns both robots as one. The pose of the second robot's world in a frame of the first robot is aMb."""
    frame = frameInModelA - 1 if frameInModelA else None
    return Model(modelA.ours.append(frame, modelB.ours, aMb.homogeneous))


def transformJointIntoMimic(
    model: Model, index_mimicked: int, index_mimicking: int, scaling: float, offset: float
) -> Model:
    """Returns the robot with one more mimic joint, which follows another joint."""
    return Model(model.ours.with_mimic(index_mimicking, index_mimicked, scaling, offset))


def loadReferenceConfigurations(model: Model, filename: str | os.PathLike[str], verbose: bool = False) -> None:
    """Adds the named positions of an SRDF file to model.referenceConfigurations."""
    model.referenceConfigurations |= model.ours.reference_configurations(filename)


def loadReferenceConfigurationsFromXML(model: Model, xmlStream: str, verbose: bool = False) -> None:
    """Adds the named positions in the text of an SRDF to model.referenceConfigurations."""
    model.referenceConfigurations |= model.ours.reference_configurations_str(xmlStream)
