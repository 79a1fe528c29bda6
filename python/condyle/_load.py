"""Robots by name, from the packages that contain their files."""

from importlib import import_module
from types import ModuleType
from typing import Any

from ._condyle import Model

PACKAGES = ("example_robot_data", "robot_descriptions")
"""Names of the packages that are searched for a robot, in this order."""


def load(name: str, package: str | None = None, root_joint: str | None = None) -> Model:
    """Returns the robot with this name, from example_robot_data or robot_descriptions: from the first of these packages
    that is installed and has the robot.

    name: the name of the robot in the package, such as 'talos', 'panda' or 'anymal_c_mj'.
    package: 'example_robot_data' or 'robot_descriptions'; None is the first package that has the robot.
    root_joint: as for `Model.from_urdf`, for the URDFs of robot_descriptions; example_robot_data defines the root joint
    itself.

    A robot of example_robot_data is the robot that the package's own `load` returns, including its root joint and
    armature. The robot is converted from a `pinocchio.Model`, because the package depends on Pinocchio.
    robot_descriptions downloads the files of a robot on first use.

    Raises ImportError if neither package is installed, and ValueError if no package has the robot.
    """
    if package is not None and package not in PACKAGES:
        raise ValueError(f"package: expected None, {' or '.join(map(repr, PACKAGES))}, found {package!r}")
    installed = [one for one in PACKAGES if package in (None, one) and find_spec(one)]
    if not installed:
        expected = " or ".join([package] if package else PACKAGES)
        raise ImportError(f"load: the files of robots are in the package {expected}, which is not installed")
    for one in installed:
        model = _example(name, root_joint) if one == "example_robot_data" else _described(name, root_joint)
        if model is not None:
            return model
    raise ValueError(f"name: no robot {name!r} in {' or '.join(installed)}")


def _example(name: str, root_joint: str | None) -> Model | None:
    """Returns a robot of example_robot_data."""
    robots = import_module("example_robot_data.robots_loader").ROBOTS
    if name not in robots:
        return None
    if root_joint is not None:
        raise ValueError("root_joint: robots of example_robot_data have theirs already")
    return Model.from_pinocchio(robots[name]().robot.model)


def _described(name: str, root_joint: str | None) -> Model | None:
    """Returns a robot of robot_descriptions. Each module of this package contains the paths of one robot's files."""
    module = _description(name)
    if module is None:
        return None
    if hasattr(module, "URDF_PATH"):
        options: Any = {"root_joint": root_joint, "packages": [module.REPOSITORY_PATH]}
        return Model.from_urdf(module.URDF_PATH, **options)
    if root_joint is not None:
        raise ValueError("root_joint: is for URDFs; the MJCF has the robot's own")
    return Model.from_mjcf(module.MJCF_PATH)


def _description(name: str) -> ModuleType | None:
    stem = name.removesuffix("_description")
    module = f"robot_descriptions.{stem}_description"
    return import_module(module) if find_spec(module) else None


def find_spec(module: str) -> bool:
    """Returns whether a module is installed."""
    return import_module("importlib.util").find_spec(module) is not None
