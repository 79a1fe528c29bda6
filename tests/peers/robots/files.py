"""Finds robot files below a folder. The root element of a file determines its format. Files that are only a part of a
robot are marked."""

import re
from collections.abc import Iterator
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

SUFFIXES = {".xml", ".urdf", ".sdf", ".world", ".mjcf"}
ROOTS = {"robot": "urdf", "sdf": "sdf", "gazebo": "sdf", "mujoco": "mjcf", "mujocoinclude": "mjcf"}
"""Map from the name of a root element to the format. `gazebo` is the root element of SDF 1.0 to 1.2."""
XACRO = re.compile(r"<xacro:|\$\((?:find|arg|optenv|env|dirname|eval) |\$\{")
COMMENTS = re.compile(r"<!--.*?-->", re.DOTALL)
ROOT = re.compile(r"<(?![?!])\s*([\w:.-]+)")
INCLUDED = re.compile(r"<include\b[^>]*\bfile\s*=\s*[\"']([^\"']+)[\"']")


class Robot(NamedTuple):
    """File that may describe a robot."""

    path: Path
    format: str
    """Format: `urdf`, `mjcf` or `sdf`."""
    collection: str
    """Name of the collection: `owner/repository`, or the first part of the path below the root folder."""
    fragment: str
    """Reason why the file alone does not describe a robot; empty if it does."""
    included: bool
    """Whether another file includes this file."""


def text_of(path: Path) -> str:
    """Returns the text of a file in UTF-8 or UTF-16. Bytes that are not valid UTF-8 (as in Latin-1) are replaced."""
    data = path.read_bytes()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16", "replace")
    return data.decode("utf-8", "replace")


def format_of(text: str) -> str | None:
    """Returns the format of a file, from its root element; None if the file has no known root element."""
    root = ROOT.search(COMMENTS.sub("", text))
    return ROOTS.get(root.group(1)) if root else None


def fragment(text: str, kind: str) -> str:
    """Returns the reason why a file alone does not describe a robot; empty if it may describe a robot."""
    bare = COMMENTS.sub("", text)
    if kind == "mjcf":
        if "<mujocoinclude" in bare:
            return "root <mujocoinclude>: a part of other files"
        if not re.search(r"<(worldbody|include|body|replicate)\b", bare):
            return "no <worldbody> and no <include>: a part of other files"
    if kind == "urdf":
        if XACRO.search(bare):
            return "xacro: has to be expanded first"
        if not re.search(r"<link\b", bare):
            return "no <link>: a part of other files"
    if kind == "sdf":
        if re.search(r"<xacro:|<%|\{%|@\(", bare):
            return "template: has to be expanded first"
        if not re.search(r"<(model|include)\b", bare):
            return "no <model>: a light, an actor or an empty world"
    return ""


def collection(folder: Path, path: Path) -> str:
    """Returns the name of the repository if a folder of the path is `owner+repository`, otherwise the first folders
    below the root."""
    parts = path.relative_to(folder).parts
    for part in (*folder.parts[-2:], *parts):
        if "+" in part and not part.endswith(tuple(SUFFIXES)):
            return part.replace("+", "/", 1)
    return parts[0] if len(parts) > 1 else folder.name


def find(folder: Path, only: str | None = None) -> list[Robot]:
    """Returns all robot files below a folder, ordered by path. `only` is a pattern for paths relative to the folder."""
    found: list[tuple[Path, str, str]] = []
    included: set[Path] = set()
    for path in walk(folder):
        text = text_of(path)
        kind = format_of(text)
        if kind is None:
            continue
        if kind == "mjcf":
            bare = COMMENTS.sub("", text)
            included |= {(path.parent / name).resolve() for name in INCLUDED.findall(bare)}
        found.append((path, kind, fragment(text, kind)))
    robots = [Robot(p, k, collection(folder, p), why, p.resolve() in included) for p, k, why in found]
    if only is None:
        return robots
    return [robot for robot in robots if fnmatch(str(robot.path.relative_to(folder)), only)]


def walk(folder: Path) -> Iterator[Path]:
    """Yields the files with a suffix of robot files, ordered by path."""
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            yield path
