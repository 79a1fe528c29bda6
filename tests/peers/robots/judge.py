"""Computes the verdict on one robot file: compares Condyle with every peer library that reads the file."""

import re
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import beside_mujoco
import beside_pinocchio
from comparison import Difference, Quantities, RefusedError, UnlikeError
from files import Robot, text_of

import condyle

try:
    import beside_drake
except ImportError:  # `./test` does not install Drake
    beside_drake = None  # type: ignore[assignment]


@cache
def packages(folder: Path) -> list[Path]:
    """Returns the subfolders of a folder that contain packages or models."""
    marks = (mark for name in ("package.xml", "model.config") for mark in folder.rglob(name))
    return sorted({mark.parent.parent for mark in marks})


def prepare(folder: Path) -> None:
    """Prepares data that the comparisons of all files share. It is called once, before processes are forked."""
    packages(folder)
    if beside_drake is not None:
        beside_drake.copies(folder)


class Verdict(NamedTuple):
    """Result of the comparison for one file."""

    verdict: str
    """Verdict: `equal`, `different`, `refused`, `only ours`, `nobody`, `fragment` or `crash`."""
    warnings: list[str]
    error: str
    """Error that Condyle reported; empty if Condyle read the file."""
    peers: dict[str, str]
    """Map from the name of a peer library to `equal`, `different`, or the reason why no comparison was made."""
    differences: dict[str, list[Difference]]
    """Map from the name of a peer library to the differences."""
    compared: list[str]
    left_out: dict[str, list[str]]
    """Map from the name of a peer library to the reasons why quantities were not compared."""


FREE = "free_flyer"


def nv(plant: Any) -> int:
    """Returns the number of degrees of freedom of Drake's plant."""
    return int(plant.num_velocities())


class Trial:
    """Comparison of one file by Condyle and the peer libraries."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self.robot, self.folder = robot, folder
        self.peers: dict[str, str] = {}
        self.differences: dict[str, list[Difference]] = {}
        self.compared: set[str] = set()
        self.left_out: dict[str, list[str]] = {}
        self.errors: list[str] = []
        self.warnings: list[str] = []
        self.read = False

    def ours(self, root_joint: str | None) -> condyle.Model | str:
        """Returns Condyle's model, or the error if Condyle rejects the file."""
        path = self.robot.path
        try:
            if self.robot.format == "mjcf":
                model = condyle.Model.from_mjcf(path)
            elif self.robot.format == "urdf":
                model = condyle.Model.from_urdf(path, root_joint=root_joint, packages=packages(self.folder))
            else:
                model = condyle.Model.from_sdf(path, root_joint=root_joint, packages=packages(self.folder))
        except condyle.Error as error:
            return str(error).replace(f"{path}:", "").strip()
        return model

    def chosen(self, roots: tuple[str | None, ...], nv: int | None) -> condyle.Model | None:
        """Returns Condyle's model with nv degrees of freedom: tries one root joint after another. If no root joint
        gives nv degrees of freedom, returns the model with any root joint."""
        tried = [self.ours(root) for root in roots]
        models = [model for model in tried if not isinstance(model, str)]
        if not models:
            self.errors.append(str(tried[0]))
            return None
        fits = [model for model in models if model.nv == nv]
        if not fits and isinstance(tried[0], str):
            self.errors.append(tried[0])
            return None
        model = (fits or models)[0]
        self.read = True
        self.warnings = [str(w).replace(f"{self.robot.path}:", "") for w in model.warnings]
        return model

    def beside(
        self,
        peer: str,
        read: Callable[[], Any],
        compare: Callable[[Any, condyle.Model], Quantities],
        roots: tuple[str | None, ...] = (None,),
        nv: Callable[[Any], int] | None = None,
    ) -> None:
        """Compares with one peer library. If several root joints are given, uses the first root joint that gives the
        same nv as in the peer library."""
        try:
            theirs = read()
        except RefusedError as error:
            self.peers[peer] = f"refuses: {error}"
            return
        model = self.chosen(roots, nv(theirs) if nv else None)
        if model is None:
            self.peers[peer] = "reads"
            return
        try:
            found = compare(theirs, model)
        except UnlikeError as error:
            self.peers[peer] = f"unlike: {error}"
            return
        self.compared |= found.compared
        if found.left_out:
            self.left_out[peer] = sorted(set(found.left_out.values()))
        self.peers[peer] = "different" if found.differences else "equal"
        if found.differences:
            self.differences[peer] = sorted(found.differences.values(), key=lambda d: -d.size)

    def verdict(self) -> Verdict:
        """Runs all comparisons and returns the verdict."""
        if self.robot.fragment:
            return Verdict("fragment", [], self.robot.fragment, {}, {}, [], {})
        {"mjcf": self.mjcf, "urdf": self.urdf, "sdf": self.sdf}[self.robot.format]()
        states = set(self.peers.values())
        reads = states & {"equal", "different", "reads"}
        if not self.errors and not self.read:
            self.chosen((FREE, None) if self.robot.format != "mjcf" else (None,), None)
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
        compared = sorted(self.compared)
        return Verdict(verdict, self.warnings, error, self.peers, self.differences, compared, self.left_out)

    def mjcf(self) -> None:
        """Compares an MJCF with MuJoCo, which defined the format."""
        path = self.robot.path
        self.beside("MuJoCo", lambda: beside_mujoco.read(path), beside_mujoco.compare_mjcf)

    def urdf(self) -> None:
        """Compares a URDF with Pinocchio and Drake (the root link moves freely), and with MuJoCo (the root link is
        fixed)."""
        path, folder = self.robot.path, self.folder
        self.beside("Pinocchio", lambda: beside_pinocchio.read(path, FREE), beside_pinocchio.compare, (FREE,))
        if beside_drake is not None:
            self.beside("Drake", lambda: beside_drake.read(path, folder), beside_drake.compare, (FREE, None), nv)
        self.beside("MuJoCo", lambda: beside_mujoco.read_urdf(path), partial(beside_mujoco.compare_urdf, path))

    def sdf(self) -> None:
        """Compares the robot of an SDF in Condyle and in Drake."""
        path, folder = self.robot.path, self.folder
        if beside_drake is not None:
            old = re.search(r"<(?:sdf|gazebo)[^>]*version\s*=\s*[\"']1\.[0-6]\b", text_of(path))
            tolerance = beside_drake.CONVERTED if old else beside_drake.TOLERANCE
            compare = partial(beside_drake.compare, tolerance=tolerance)
            self.beside("Drake", lambda: beside_drake.read(path, folder), compare, (FREE, None), nv)
