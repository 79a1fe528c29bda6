"""Verdict on one file: Condyle beside every peer that reads it."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import beside_mujoco
import beside_pinocchio
from comparison import Difference, Quantities, Refused, Unlike
from files import Robot

import condyle

try:
    import beside_drake
except ImportError:  # Drake is left out by `./test`
    beside_drake = None  # type: ignore[assignment]


@cache
def packages(folder: Path) -> list[Path]:
    """Returns the folders below a folder that hold packages or models."""
    marks = (mark for name in ("package.xml", "model.config") for mark in folder.rglob(name))
    return sorted({mark.parent.parent for mark in marks})


def prepare(folder: Path) -> None:
    """Does once what every file needs, before processes are forked."""
    packages(folder)
    if beside_drake is not None:
        beside_drake.packages(folder)


class Verdict(NamedTuple):
    """Result of one file."""

    verdict: str
    """`equal`, `different`, `refused`, `only ours`, `nobody`, `fragment`, `crash`."""
    warnings: list[str]
    error: str
    """Our error; empty if the file was read."""
    peers: dict[str, str]
    """`equal`, `different`, or the reason why there is no comparison, by peer."""
    differences: dict[str, list[Difference]]
    """By peer."""
    compared: list[str]
    left_out: dict[str, list[str]]
    """Reasons why quantities were not compared, by peer."""


class Trial:
    """Condyle and the peers on one file."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self.robot, self.folder = robot, folder
        self.peers: dict[str, str] = {}
        self.differences: dict[str, list[Difference]] = {}
        self.compared: set[str] = set()
        self.left_out: dict[str, list[str]] = {}
        self.errors: list[str] = []
        self.warnings: list[str] = []
        self.read = False

    def ours(self, root_joint: str | None) -> condyle.Model | None:
        """Returns our model; None if we refuse the file."""
        path = self.robot.path
        try:
            if self.robot.format == "mjcf":
                model = condyle.Model.from_mjcf(path)
            elif self.robot.format == "urdf":
                model = condyle.Model.from_urdf(path, root_joint=root_joint, packages=packages(self.folder))
            elif "packages" in (condyle.Model.from_sdf.__doc__ or ""):
                model = condyle.Model.from_sdf(path, root_joint=root_joint, packages=packages(self.folder))
            else:
                model = condyle.Model.from_sdf(path, root_joint=root_joint)
        except condyle.Error as error:
            self.errors.append(str(error).replace(f"{path}:", "").strip())
            return None
        self.read = True
        self.warnings = [str(w).replace(f"{path}:", "") for w in model.warnings]
        return model

    def beside(
        self,
        peer: str,
        read: Callable[[], Any],
        compare: Callable[[Any, condyle.Model], Quantities],
        root_joint: Callable[[Any], str | None] = lambda _: None,
    ) -> None:
        """Compares with one peer."""
        try:
            theirs = read()
        except Refused as error:
            self.peers[peer] = f"refuses: {error}"
            return
        model = self.ours(root_joint(theirs))
        if model is None:
            self.peers[peer] = "reads"
            return
        try:
            found = compare(theirs, model)
        except Unlike as error:
            self.peers[peer] = f"unlike: {error}"
            return
        self.compared |= found.compared
        if found.left_out:
            self.left_out[peer] = sorted(set(found.left_out.values()))
        self.peers[peer] = "different" if found.differences else "equal"
        if found.differences:
            self.differences[peer] = sorted(found.differences.values(), key=lambda d: -d.size)

    def verdict(self) -> Verdict:
        """Returns what the comparisons say together."""
        if self.robot.fragment:
            return Verdict("fragment", [], self.robot.fragment, {}, {}, [], {})
        {"mjcf": self.mjcf, "urdf": self.urdf, "sdf": self.sdf}[self.robot.format]()
        states = set(self.peers.values())
        reads = states & {"equal", "different", "reads"}
        if not self.errors and not self.read:
            self.ours("free_flyer" if self.robot.format != "mjcf" else None)
        unread = all(state.startswith("refuses") for state in states)
        if self.robot.included and unread and not any("opening file" in state for state in states):
            return Verdict("fragment", [], "included by other files, and read alone by no peer", self.peers, {}, [], {})
        if self.errors:
            verdict = "nobody" if unread else "refused"
        elif "different" in reads:
            verdict = "different"
        else:
            verdict = "equal" if "equal" in reads else "only ours"
        error = self.errors[0] if self.errors else ""
        return Verdict(verdict, self.warnings, error, self.peers, self.differences, sorted(self.compared), self.left_out)

    def mjcf(self) -> None:
        """MuJoCo, whose format it is; Drake only where MuJoCo refuses."""
        path = self.robot.path
        self.beside("MuJoCo", lambda: beside_mujoco.read(path), beside_mujoco.compare_mjcf)

    def urdf(self) -> None:
        """Pinocchio and Drake with a free root, MuJoCo with a fixed one."""
        path, folder = self.robot.path, self.folder
        free = "free_flyer"
        self.beside("Pinocchio", lambda: beside_pinocchio.read(path, free), beside_pinocchio.compare, lambda _: free)
        if beside_drake is not None:
            self.beside("Drake", lambda: beside_drake.read(path, folder), beside_drake.compare, self.root)
        self.beside("MuJoCo", lambda: beside_mujoco.read_urdf(path), partial(beside_mujoco.compare_urdf, path))

    def sdf(self) -> None:
        """Drake."""
        path, folder = self.robot.path, self.folder
        if beside_drake is not None:
            self.beside("Drake", lambda: beside_drake.read(path, folder), beside_drake.compare, self.root)

    @staticmethod
    def root(plant: Any) -> str | None:
        """Returns the root joint with which our model moves as Drake's plant."""
        return "free_flyer" if beside_drake.floats(plant) else None
