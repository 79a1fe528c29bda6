"""Robots by their names, from the packages that have their files."""

from importlib import import_module
from types import ModuleType
from typing import Any

from ._condyle import Model

PACKAGES = ("example_robot_data", "robot_descriptions")
"""The packages that are asked, the first one first."""


def load(name: str, package: str | None = None, root_joint: str | None = None) -> Model:
    """The robot of this name, from example_robot_data or robot_descriptions, whichever is installed and has it.

    name: as the package has it: 'talos', 'panda', 'anymal_c_mj', ….
    package: 'example_robot_data' or 'robot_descriptions'; None is the first that has the robot.
    root_joint: as for `Model.from_urdf`, for the URDFs of robot_descriptions; example_robot_data knows it.

    Robots of example_robot_data are those that its own `load` returns, with their root joint and armature; they come
    through Pinocchio, on which it depends. robot_descriptions gets the files from the net when it is first asked for a
    robot.

    Raises ImportError if neither package is installed, ValueError if none has the robot.
    """
    if package is not None and package not in PACKAGES:
        raise ValueError(f"package: expected None, {' or '.join(map(repr, PACKAGES))}, found {package!r}")
    installed = [one for one in PACKAGES if package in (None, one) and find_spec(one)]
    if not installed:
        expected = package or " or ".join(PACKAGES)
        raise ImportError(f"load: the robots' files are those of {expected}, which is not installed (pip install)")
    for one in installed:
        model = _example(name, root_joint) if one == "example_robot_data" else _described(name, root_joint)
        if model is not None:
            return model
    raise ValueError(f"name: no robot {name!r} in {' or '.join(installed)}")


def _example(name: str, root_joint: str | None) -> Model | None:
    """A robot of example_robot_data."""
    robots = import_module("example_robot_data.robots_loader").ROBOTS
    if name not in robots:
        return None
    if root_joint is not None:
        raise ValueError("root_joint: robots of example_robot_data have theirs already")
    return Model.from_pinocchio(robots[name]().robot.model)


def _described(name: str, root_joint: str | None) -> Model | None:
    """A robot of robot_descriptions, whose modules know where its files are."""
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
    """Whether a module is installed."""
    return import_module("importlib.util").find_spec(module) is not None
