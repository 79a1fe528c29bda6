"""Models in Pinocchio's spelling: from files, from each other, and those that are built in."""

import os
from collections.abc import Sequence

from numpy.typing import ArrayLike

from . import _condyle as ours
from . import _pinocchio_samples as samples
from . import algebra
from ._spelling import JointModelFreeFlyer, Model


def buildModelFromUrdf(path: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """A robot from a URDF."""
    return Model(ours.Model.from_urdf(path, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromXML(text: str, root_joint: JointModelFreeFlyer | None = None, mimic: bool = False) -> Model:
    """A robot from a URDF's text."""
    return Model(ours.Model.from_urdf_str(text, root_joint="free_flyer" if root_joint else None, mimic=mimic))


def buildModelFromMJCF(path: str) -> Model:
    """A robot from an MJCF."""
    return Model(ours.Model.from_mjcf(path))


def buildSampleModelManipulator() -> Model:
    """Pinocchio's arm of six joints."""
    return Model(samples.manipulator())


def buildSampleModelHumanoid() -> Model:
    """Pinocchio's humanoid of 28 joints on a free-flyer."""
    return Model(samples.humanoid())


def buildSampleModelHumanoidRandom() -> Model:
    """A humanoid of the same form as Pinocchio's, on a free-flyer; its numbers are others, drawn by NumPy."""
    return Model(samples.random_humanoid())


def buildReducedModel(model: Model, joints: Sequence[int], q: ArrayLike) -> Model:
    """The robot with joints held where q has them."""
    return Model(model.ours.lock([model.names[joint] for joint in joints], q))


def appendModel(modelA: Model, modelB: Model, frameInModelA: int, aMb: algebra.SE3) -> Model:
    """Both robots, the second one's world at aMb in a frame of the first."""
    frame = frameInModelA - 1 if frameInModelA else None
    return Model(modelA.ours.append(frame, modelB.ours, aMb.homogeneous))


def transformJointIntoMimic(
    model: Model, index_mimicked: int, index_mimicking: int, scaling: float, offset: float
) -> Model:
    """The robot with a joint that follows another one."""
    return Model(model.ours.with_mimic(index_mimicking, index_mimicked, scaling, offset))


def loadReferenceConfigurations(model: Model, filename: str | os.PathLike[str], verbose: bool = False) -> None:
    """Puts the named positions of an SRDF into model.referenceConfigurations."""
    model.referenceConfigurations |= model.ours.reference_configurations(filename)


def loadReferenceConfigurationsFromXML(model: Model, xmlStream: str, verbose: bool = False) -> None:
    """Puts the named positions of an SRDF's text into model.referenceConfigurations."""
    model.referenceConfigurations |= model.ours.reference_configurations_str(xmlStream)
