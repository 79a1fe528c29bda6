"""Makes two tables of verdicts: one for the terminal, and one for the file VALIDATION.md."""

import platform
import re
from collections import Counter, defaultdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from files import Robot
from judge import Verdict

Results = list[tuple[Robot, Verdict]]
MEANING = {
    "equal": "equal to every peer that reads it",
    "different": "differs from a peer",
    "refused": "refused here, read by a peer",
    "crash": "crash or time limit",
    "only ours": "read here, by no peer",
    "nobody": "refused by all",
    "fragment": "no robot on its own",
}
NAMES = {"mjcf": "MJCF", "sdf": "SDF", "urdf": "URDF"}
BEGIN, END = "<!-- public robots -->", "<!-- end of public robots -->"
"""Marks around the section of VALIDATION.md that `--table` writes. The program that writes the rest of the file keeps
this section."""

HEAD = """## Public robots

Every robot file of these repositories, read here and by MuJoCo (MJCF, URDF), Pinocchio (URDF) and Drake (URDF, SDF).
This section is written by `{command}`, with condyle {condyle}, MuJoCo {mujoco}, Pinocchio {pin},
Drake {drake} and Python {python}. Robots are not committed. Meshes of 4 MB and more were not at hand: a
tetrahedron replaces each of them, for both libraries.

The numbers of coordinates, M, the bias, placements of frames, total mass, limits of position, velocity and effort,
damping, friction and armature are compared at two random states. To these come, with MuJoCo, springs and damping of
`passive_torque`, actuators, keyframes and sites; with Drake, springs. A result may differ by {tolerances} of
1 + the largest number of it. Exceptions are listed below, with their reasons; `tests/peers/robots/` applies them.

*Parts* are files that are no robot alone: parts of others, templates, worlds without a model. *Warned* counts the equal
robots with a warning. *Refused* are read by a peer. *Alone* are read here and by no peer. *Nobody* reads the rest.
"""


class Kinds(NamedTuple):
    """Messages of one sort (such as warnings), counted by kind."""

    name: str
    counts: Counter[str]
    examples: dict[str, Path]


def kind(text: str) -> str:
    """Returns the kind of a message: the message without names and numbers."""
    text = text.splitlines()[0] if text else ""
    text = text.split("; looked for ")[0]
    text = re.sub(r"\b(https?|model|package|file)://.*?(?=: |$)", "`…`", text)
    text = re.sub(r"(/[\w.+-]+)+/[\w.+-]+(:\d+)?:?\s*", "", text)
    text = re.sub(r"^\d+:\s*", "", text)
    text = re.sub(r"`[^`]*`", "`…`", text)
    text = re.sub(r"'[^']*'", "'…'", text)
    text = re.sub(r"(?<![\w.])-?\d[\d.]*(e[+-]?\d+)?", "N", text)
    return re.sub(r"(\w+) `…`: ", r"<\1>: ", text).strip()


def kinds(results: Results, format_: str) -> list[Kinds]:
    """Returns the differences, refusals, crashes, exceptions and warnings for a format, by kind. Each kind has an
    example."""
    pairs: dict[str, list[tuple[Path, str]]] = defaultdict(list)
    for robot, verdict in results:
        if robot.format != format_:
            continue
        path = robot.path
        for peer, differences in verdict.differences.items():
            pairs["different"] += [(path, f"{peer}: {difference.quantity}") for difference in differences]
        if verdict.verdict in ("refused", "nobody"):
            name = "refused, read by a peer" if verdict.verdict == "refused" else "refused by all"
            pairs[name].append((path, kind(verdict.error)))
        if verdict.verdict == "crash":
            pairs["crash"].append((path, verdict.error))
        for reasons in verdict.left_out.values():
            pairs["exceptions"] += [(path, reason) for reason in reasons]
        for state in verdict.peers.values():
            if state.startswith("unlike"):
                pairs["exceptions"].append((path, state.removeprefix("unlike: ")))
        pairs["warned"] += [(path, text) for text in {kind(warning) for warning in verdict.warnings}]
    found = []
    for name in ("different", "crash", "refused, read by a peer", "refused by all", "exceptions", "warned"):
        examples: dict[str, Path] = {}
        for path, text in pairs[name]:
            examples.setdefault(text, path)
        found.append(Kinds(name, Counter(text for _, text in pairs[name]), examples))
    return found


def counted(results: Results) -> str:
    """Returns the number of files for each verdict, by format."""
    formats = sorted({robot.format for robot, _ in results})
    lines = ["| | " + " | ".join(NAMES[f] for f in formats) + " |", "| --- |" + " ---: |" * len(formats)]
    for verdict, meaning in MEANING.items():
        numbers = [sum(r.format == f and v.verdict == verdict for r, v in results) for f in formats]
        if any(numbers):
            lines.append(f"| {meaning} | " + " | ".join(map(str, numbers)) + " |")
    return "\n".join(lines)


def summary(results: Results) -> str:
    """Returns the table of verdicts for the terminal."""
    parts = [counted(results)]
    for format_ in sorted({robot.format for robot, _ in results}):
        for name, counts, examples in kinds(results, format_):
            if counts:
                parts.append(f"\n{NAMES[format_]}, {name}:")
                parts += [f"{n:6} {text}   ({examples[text]})" for text, n in counts.most_common()]
    return "\n".join(parts)


def listing(results: Results) -> str:
    """Returns a list of all files, each with its verdict and details."""
    lines = []
    for robot, verdict in results:
        lines.append(f"{verdict.verdict:10} {robot.path}")
        lines += [f"           {peer}: {state}" for peer, state in verdict.peers.items()]
        if verdict.error:
            lines.append(f"           error: {verdict.error}")
        for peer, differences in verdict.differences.items():
            lines += [f"           {peer}: {d.quantity}: {d.size:.1e}: {d.detail}" for d in differences]
        lines += [f"           warning: {warning}" for warning in verdict.warnings]
    return "\n".join(lines)


def table(results: Results, commits: dict[str, str], command: str, tolerances: str) -> str:
    """Returns the section of VALIDATION.md on public robots, as Markdown."""
    names = ("condyle", "mujoco", "pin", "drake")
    versions = {name: installed(name) for name in names}
    lines = [HEAD.format(command=command, python=platform.python_version(), tolerances=tolerances, **versions)]
    columns = "Files | Parts | Equal | Warned | Different | Refused | Alone | Nobody"
    lines += [f"| Repository | Commit | Format | {columns} |", "| --- | --- | --- |" + " ---: |" * 8]
    groups: dict[tuple[str, str], Results] = defaultdict(list)
    for robot, verdict in results:
        groups[robot.collection, robot.format].append((robot, verdict))
    for (collection, format_), rows in sorted(groups.items(), key=lambda item: (item[0][1], item[0][0].lower())):
        lines.append(row(collection, commits.get(collection, "")[:10], NAMES[format_], rows))
    for format_ in sorted({robot.format for robot, _ in results}):
        lines.append(row("**all**", "", NAMES[format_], [(r, v) for r, v in results if r.format == format_]))
    for format_ in sorted({robot.format for robot, _ in results}):
        for name, counts, examples in kinds(results, format_):
            if counts:
                lines += ["", f"### {NAMES[format_]}: {name}", "", "| Files | | Such as |", "| ---: | --- | --- |"]
                ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
                lines += [f"| {n} | {escaped(text)} | {short(examples[text])} |" for text, n in ordered]
    return "\n".join([BEGIN, *lines, END, ""])


def row(collection: str, commit: str, format_: str, rows: Results) -> str:
    """Returns the table row of one collection: the number of files for each verdict."""
    verdicts = Counter(verdict.verdict for _, verdict in rows)
    warned = sum(bool(verdict.warnings) for _, verdict in rows if verdict.verdict == "equal")
    different = verdicts["different"] + verdicts["crash"]
    numbers = (len(rows), verdicts["fragment"], verdicts["equal"], warned, different)
    numbers += (verdicts["refused"], verdicts["only ours"], verdicts["nobody"])
    return f"| {collection} | {commit} | {format_} | " + " | ".join(map(str, numbers)) + " |"


def short(path: Path) -> str:
    """Returns the last components of a path, from the repository's name on."""
    parts = path.parts
    start = next((i for i, part in enumerate(parts) if "+" in part), max(0, len(parts) - 3))
    return f"`{parts[start].replace('+', '/', 1)}` `{'/'.join(parts[start + 1 :])}`"


def escaped(text: str) -> str:
    """Returns a text for a cell of a table. Outside of `code`, characters of HTML and Markdown are escaped."""
    return text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*").replace("[", "\\[").replace("_", "\\_")


def installed(name: str) -> str:
    """Returns the version of a package."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "(not installed)"


def put(path: Path, section: str) -> None:
    """Writes the section into a file: it replaces an existing section, or is appended."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END + "\n")
    gap = "" if not before or before.endswith("\n\n") else "\n"
    path.write_text(before + gap + section + after, encoding="utf-8")
