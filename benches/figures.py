#!/usr/bin/env python3
"""Measures every timing figure of README and book, and writes it where it stands.

    python3 benches/figures.py measure [PART ...] [--cpu K]   # into benches/figures.json; all parts take about an hour
    python3 benches/figures.py write                          # from there into the pages
    python3 benches/figures.py check                          # fails if a page and the JSON differ

A table of a page stands between `<!-- figures: NAME -->` and `<!-- end -->`, and is written whole. A figure in a sentence is
given by the sentence, in QUOTES: the words stay, the figures are written.
"""

import argparse
import datetime
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = Path(__file__).with_suffix(".json")
ROBOTS = ("panda", "anymal", "talos")
CRITERION = ("factorisation", "divide_conquer")
PARTS = ("dynamics", "dynamics_avx2", "fddp", "casadi", *CRITERION)
COMMANDS = {
    "dynamics": "python3 benches/peers/dynamics.py --rounds 5 --cpu 1 panda anymal talos",
    "dynamics_avx2": "CONDYLE_LEVEL=avx2 python3 benches/peers/dynamics.py --rounds 5 --cpu 1 panda anymal talos",
    "fddp": ".venv/crocoddyl/bin/python benches/peers/ocp.py --cpu 1 --solver fddp reach trot walk humanoid",
    "casadi": ".venv/pinocchio/bin/python benches/peers/casadi_functions.py",
    "factorisation": "cargo bench --bench factorisation",
    "divide_conquer": "cargo bench --bench divide_conquer",
}
"""The command that measures each part."""


def measure(part: str) -> Any:
    """Runs the command of a part; returns its records, or the medians of criterion (ns) by group and function."""
    command = COMMANDS[part]
    words = [word for word in command.split() if "=" not in word]
    environment = os.environ | dict(word.split("=") for word in command.split() if "=" in word)
    if part in CRITERION:
        subprocess.run(words, check=True, cwd=ROOT, stdout=sys.stderr)
        medians: dict[str, dict[str, float]] = {}
        target = Path(environment.get("CARGO_TARGET_DIR", ROOT / "target"))
        for found in sorted(target.glob("criterion/**/new/benchmark.json")):
            about = json.loads(found.read_text())
            estimates = json.loads(found.with_name("estimates.json").read_text())
            group, function = about["group_id"], about["function_id"] or about["value_str"]
            medians.setdefault(group, {})[function] = round(estimates["median"]["point_estimate"], 1)
        return medians
    output = subprocess.run(
        [*words, "--json"], check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=environment
    )
    text = output.stdout.strip()
    return json.loads(text) if text.startswith("[") else [json.loads(line) for line in text.splitlines()]


def machine() -> dict[str, str]:
    """The processor and the day."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    [name, *_] = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    [flags, *_] = [line for line in lines if line.startswith("flags")]
    vectors = next((v for flag, v in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "no vectors")
    return {"processor": name, "vectors": vectors, "date": datetime.date.today().isoformat()}


class Figures:
    """The figures of the JSON, as pages ask for them."""

    def __init__(self, results: dict[str, Any]) -> None:
        self.results = results

    def rows(self, part: str) -> list[dict[str, Any]]:
        return self.results[part]["records"]

    def dynamics(self, algorithm: str, robot: str, mode: str = "one call", part: str = "dynamics") -> dict[str, Any]:
        return next(
            row
            for row in self.rows(part)
            if (row["algorithm"], row["robot"]) == (algorithm, robot) and row["mode"].split(",")[0] == mode
        )

    def us(self, algorithm: str, robot: str, mode: str = "one call") -> float:
        return self.dynamics(algorithm, robot, mode)["ours_ns"] / 1e3

    def ratio(self, algorithm: str, robot: str, mode: str = "one call") -> float:
        return self.dynamics(algorithm, robot, mode)["ratio"]

    def medians(self, part: str) -> dict[str, dict[str, float]]:
        return self.results[part]["records"]


ALGORITHMS = ("rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives")


def dynamics_table(figures: Figures, mode: str) -> str:
    """A table of ratios to Pinocchio, ours in brackets (µs)."""
    lines = [f"| {mode}: ratio (ours in µs) | " + " | ".join(ROBOTS) + " |", "| --- |" + " --- |" * len(ROBOTS)]
    names = list(dict.fromkeys(r["algorithm"] for r in figures.rows("dynamics") if r["mode"] == mode))
    for name in [name for name in names if mode == "a horizon" or name in ALGORITHMS]:
        cells = (f"{figures.ratio(name, r, mode):.2f} ({figures.us(name, r, mode):.2f})" for r in ROBOTS)
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def avx2_table(figures: Figures) -> str:
    lines = [
        "| ratio at AVX2: one call, per state of a batch | " + " | ".join(ROBOTS) + " |",
        "| --- |" + " --- |" * len(ROBOTS),
    ]
    for name in ALGORITHMS:
        modes = ("one call", "per state of a batch")
        cells = (
            ", ".join(f"{figures.dynamics(name, r, m, 'dynamics_avx2')['ratio']:.2f}" for m in modes) for r in ROBOTS
        )
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


FDDP = {
    "reach": "an arm reaches",
    "trot": "a quadruped trots",
    "walk": "legs of a humanoid walk",
    "humanoid": "a humanoid walks",
}


def fddp_table(figures: Figures) -> str:
    lines = ["| ratio (ours in ms) | all | derivatives | sweep | rollout |", "| --- | --- | --- | --- | --- |"]
    found = {row["name"]: row["time"] for row in figures.rows("fddp") if "time" in row}
    for name, title in FDDP.items():
        cells = (
            f"{t['ratio']:.2f} ({t['ours']:.2f})"
            for t in map(found[name].get, ("total", "derivatives", "sweep", "rollout"))
        )
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def us(ns: float) -> str:
    return f"{ns / 1e3:.2f}"


def ways_table(figures: Figures) -> str:
    """Forward dynamics in three ways, and the factor alone."""
    groups = figures.medians("factorisation")
    names = [group.partition("/")[2] for group in groups if group.startswith("forward dynamics/")]
    order = ["arm7", "quadruped", "humanoid"]
    names = order + sorted(
        (n for n in names if n not in order), key=lambda n: (n.rpartition(" ")[0], int(n.split()[-1]))
    )
    lines = [
        "| µs | ABA | dense | sparse | factor alone: dense, sparse | inverse: recursion or as `minv`, dense, sparse |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name in names:
        ways, factor = groups[f"forward dynamics/{name}"], groups[f"factorise/{name}"]
        inverse = groups[f"inverse of M/{name}"]
        cells = [us(ways[way]) for way in ("ArticulatedBody", "Dense", "Sparse")]
        cells += [", ".join(us(factor[way]) for way in ("Dense", "Sparse"))]
        cells += [", ".join(us(inverse[way]) for way in ("minv", "Dense", "Sparse"))]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def machine_line(figures: Figures) -> str:
    at = figures.results["dynamics"]["machine"]
    return f"{at['processor']} ({at['vectors']}), one core, {at['date']}"


TABLES: dict[str, Callable[[Figures], str]] = {
    "machine": machine_line,
    "one call": lambda f: dynamics_table(f, "one call"),
    "batch": lambda f: dynamics_table(f, "per state of a batch"),
    "horizon": lambda f: dynamics_table(f, "a horizon"),
    "avx2": avx2_table,
    "fddp": fddp_table,
    "three ways": ways_table,
}


def spread(f: Figures, algorithm: str, mode: str) -> tuple[str, str]:
    """The least and the greatest ratio to Pinocchio among the robots."""
    ratios = [f.ratio(algorithm, robot, mode) for robot in ROBOTS]
    return f"{min(ratios):.2f}", f"{max(ratios):.2f}"


def sum_to_aba(f: Figures, robot: str, mode: str = "one call") -> float:
    """(RNEA + CRBA) / ABA."""
    return (f.us("rnea", robot, mode) + f.us("crba", robot, mode)) / f.us("aba", robot, mode)


# Sentences of pages: the page, the sentence with {} for each figure, and the figures.
QUOTES: list[tuple[str, str, Callable[[Figures], list[str]]]] = [
    (
        "docs/derivatives.md",
        "RNEA takes {} µs, its derivatives by hand {} µs. That is {} times RNEA",
        lambda f: [
            f"{f.us('rnea', 'talos'):.2f}",
            f"{f.us('rnea_derivatives', 'talos'):.2f}",
            f"{f.us('rnea_derivatives', 'talos') / f.us('rnea', 'talos'):.1f}",
        ],
    ),
    (
        "docs/exercises.md",
        "RNEA takes {} µs a call, so 38 calls take {} µs",
        lambda f: [f"{f.us('rnea', 'talos'):.2f}", f"{38 * f.us('rnea', 'talos'):.0f}"],
    ),
    (
        "docs/exercises.md",
        "In a batch RNEA takes {} µs, so 38 states take {} µs",
        lambda f: [
            f"{f.us('rnea', 'talos', 'per state of a batch'):.2f}",
            f"{38 * f.us('rnea', 'talos', 'per state of a batch'):.0f}",
        ],
    ),
    ("docs/exercises.md", "CRBA takes {} µs", lambda f: [f"{f.us('crba', 'talos'):.2f}"]),
    (
        "docs/exercises.md",
        "7 calls of {} µs against {} µs, a factor of {}",
        lambda f: [
            f"{f.us('rnea', 'panda'):.2f}",
            f"{f.us('crba', 'panda'):.2f}",
            f"{7 * f.us('rnea', 'panda') / f.us('crba', 'panda'):.0f}",
        ],
    ),
    (
        "docs/lanes.md",
        "costs {} to {} of Pinocchio's single call for RNEA, and our own single call costs {} to {}.",
        lambda f: [*spread(f, "rnea", "per state of a batch"), *spread(f, "rnea", "one call")],
    ),
]


def filled(path: Path, text: str, figures: Figures) -> str:
    """A page with the figures of the JSON."""
    for name, table in TABLES.items():
        begin, end = f"<!-- figures: {name} -->", "<!-- end -->"
        pattern = re.compile(re.escape(begin) + r"\n.*?" + re.escape(end), re.DOTALL)
        if pattern.search(text):
            new = f"{begin}\n{table(figures)}\n{end}"
            text = pattern.sub(lambda _, new=new: new, text)
    for page, sentence, values in QUOTES:
        if path == ROOT / page:
            # words may stand on two lines; figures are numbers
            parts = [re.sub(r"(?:\\ )+", r"\\s+", re.escape(part)) for part in sentence.split("{}")]
            pattern = re.compile(r"([\d.]+)".join(parts).replace(r"([\d.]+)", r"([\d]+(?:\.\d+)?)"))
            found = pattern.search(text)
            if found is None:
                raise SystemExit(f"{page}: no sentence `{sentence}`")
            new, start = list(text), len(text)
            for k, value in reversed(list(enumerate(values(figures), 1))):
                start, stop = found.span(k)
                new[start:stop] = value
            text = "".join(new)
    return text


def pages() -> list[Path]:
    return [ROOT / "README.md", ROOT / "DESIGN.md", ROOT / "crates" / "guide.md", *sorted((ROOT / "docs").glob("*.md"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("action", choices=("measure", "write", "check"))
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    wanted = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    if wanted.action == "measure":
        for part in wanted.parts or PARTS:
            results[part] = {"command": COMMANDS[part], "machine": machine(), "records": measure(part)}
            RESULTS.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n")
        return
    figures, stale = Figures(results), []
    for path in pages():
        text = path.read_text(encoding="utf-8")
        new = filled(path, text, figures)
        if new != text:
            stale.append(str(path.relative_to(ROOT)))
            if wanted.action == "write":
                path.write_text(new, encoding="utf-8")
    if wanted.action == "check" and stale:
        raise SystemExit(f"not the figures of {RESULTS.relative_to(ROOT)}: {', '.join(stale)}")


if __name__ == "__main__":
    main()
