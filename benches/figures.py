#!/usr/bin/env python3
"""Measures the timing figures of the README and of the book, and writes these figures into the pages.

    python3 benches/figures.py measure [PART ...]   # into benches/figures.json; all parts take about an hour
    python3 benches/figures.py write                # from the JSON into the pages
    python3 benches/figures.py check                # fails if a page and the JSON differ

A table is written between `<!-- figures: NAME -->` and `<!-- end -->`. QUOTES lists each sentence that contains
figures: the words of the sentence stay as they are, and the figures are replaced. Measuring needs an idle machine with
two cores.
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
COMMANDS = {
    "dynamics": "python3 benches/peers/dynamics.py --rounds 5 --cpu 1 panda anymal talos",
    "dynamics_avx2": "CONDYLE_LEVEL=avx2 python3 benches/peers/dynamics.py --rounds 5 --cpu 1 panda anymal talos",
    "fddp": ".venv/crocoddyl/bin/python benches/peers/ocp.py --cpu 1 --solver fddp reach trot walk humanoid",
    "mpc": ".venv/crocoddyl/bin/python benches/peers/mpc.py --cpu 1 --records target/records",
    "mpc_rust": "cargo bench --profile release -p condyle-benches --bench mpc -- "
    "../target/records/go2_tick2.json ../target/records/g1_tick2.json",
    "threads": ".venv/crocoddyl/bin/python benches/peers/ocp_threads.py",
    "casadi": ".venv/pinocchio/bin/python benches/peers/casadi_comparison.py",
    "generated": "CC=clang-19 .venv/pinocchio/bin/python benches/generated.py --cpu 1",
    "slopes": ".venv/pinocchio/bin/python docs/pictures/slopes.py",
    "factorisation": "cargo bench --profile release -p condyle-benches --bench factorisation",
    "divide_conquer": "cargo bench --profile release -p condyle-benches --bench divide_conquer",
}
"""Command for each part of the measurement. `mpc_rust` reads the records that `mpc` leaves in `target/records`."""
WITHOUT_OPTION = ("casadi", "slopes")
"""Parts of the measurement whose command prints one JSON object and has no option --json."""


def measure(part: str) -> Any:
    """Runs the command of a part. Returns the records that the command prints, or criterion's medians (ns) by group and
    function."""
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
            group, function = about["group_id"], "/".join(filter(None, (about["function_id"], about["value_str"])))
            medians.setdefault(group, {})[function] = round(estimates["median"]["point_estimate"], 1)
        return medians
    option = [] if part in WITHOUT_OPTION else ["--json"]
    done = subprocess.run([*words, *option], check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=environment)
    text = done.stdout.strip()
    return json.loads(text) if option == [] or text.startswith("[") else [json.loads(row) for row in text.splitlines()]


def machine() -> dict[str, str]:
    """Returns the name of the processor, its vector extension and the date."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    [name, *_] = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    [flags, *_] = [line for line in lines if line.startswith("flags")]
    vectors = next((v for flag, v in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), "no vectors")
    return {"processor": name, "vectors": vectors, "date": datetime.date.today().isoformat()}


class Figures:
    """Figures in the JSON, with one method for each figure or table of the pages."""

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
    """Returns a table of Condyle's times divided by Pinocchio's times. Brackets contain Condyle's time (µs)."""
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
    """Returns the table of forward dynamics by three methods. The table also has the times to factorise the inertia
    matrix M and to compute M⁻¹."""
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


def generated_table(figures: Figures) -> str:
    """Returns the table of generated C: the time of a call (ns), its ratios to the times of Condyle's and Pinocchio's
    calls, and the number of operations."""
    rows = {(row["robot"], row["function"]): row for row in figures.rows("generated")}
    lines = ["| ns (ratios) | panda | anymal | talos | operations |", "| --- | --- | --- | --- | --- |"]
    for name in ALGORITHMS:
        found = [rows[robot, name] for robot in ROBOTS]
        cells = [
            f"{ns:.0f} ({ns / 1e3 / figures.us(name, row['robot']):.2f}; {ns / row['pinocchio_ns']:.2f})"
            for row, ns in ((row, row["ns"]) for row in found)
        ]
        lines.append(f"| {name} | " + " | ".join([*cells, ", ".join(str(row["operations"]) for row in found)]) + " |")
    return "\n".join(lines)


def cppadcodegen_table(figures: Figures) -> str:
    rows = {(row["robot"], row["function"]): row for row in figures.rows("generated")}
    lines = ["| ratio to CppADCodeGen's | panda | anymal | talos |", "| --- | --- | --- | --- |"]
    for name in ALGORITHMS:
        ratios = [rows[robot, name]["ratio"] for robot in ROBOTS]
        if None not in ratios:
            lines.append(f"| {name} | " + " | ".join(f"{ratio:.2f}" for ratio in ratios) + " |")
    return "\n".join(lines)


def threads_table(figures: Figures) -> str:
    """Returns the table of times of an FDDP iteration on two threads. A time is a fraction of the time on one
    thread."""
    rows = {(row["name"], row["way"]): row for row in figures.rows("threads")}
    lines = ["| time on two threads / on one | " + " | ".join(FDDP) + " |", "| --- |" + " --- |" * len(FDDP)]
    kinds = [("whole", "2 threads", "total"), ("derivatives that the sweep waits for", "2 threads", "derivatives")]
    kinds += [(phase, "2 threads", phase) for phase in ("sweep", "rollout")]
    kinds += [("whole, sweep in two segments", "2 segments", "total")]
    for title, way, phase in kinds:
        cells = (f"{rows[name, way][phase]['ratio']:.2f}" for name in FDDP)
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def casadi_functions(figures: Figures) -> str:
    lines = ["| µs | our call | ours in CasADi | CasADi expressions |", "| --- | --- | --- | --- |"]
    for row in figures.results["casadi"]["records"]["functions"]:
        own = f"{row['ours_us']:.2f}" if "ours_us" in row else "–"
        cells = f"{own} | {row['casadi_with_ours_us']:.2f} | {row['casadi_expressions_us']:.2f}"
        lines.append(f"| {row['robot']}, {row['function']}, {row['kind']} | {cells} |")
    return "\n".join(lines)


MPC = {"go2": "Go2, 25 knots", "g1": "G1, 40 knots"}


def mpc_table(figures: Figures) -> str:
    """Returns the table of times of ticks: medians and 99th percentiles (ms), and the ratio to Crocoddyl's time."""
    lines = [
        "| ms | a tick | references | after the state | Crocoddyl | ratio |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in figures.rows("mpc"):
        times = [row["ms"][part] for part in ("total", "references", "after")]
        cells = [f"{median:.3f} ({p99:.3f})" for median, p99 in times]
        cells += [f"{row['theirs_ms'][0]:.2f}", f"{row['ratio']:.2f}"] if "ratio" in row else ["–", "–"]
        lines.append(f"| {MPC[row['robot']]}, `{row['rule']}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


SOLVERS = {
    "fddp": "FDDP",
    "ipopt_with_ours": "IPOPT, our functions",
    "ipopt_expressions": "IPOPT, CasADi expressions",
}


def casadi_motion(figures: Figures) -> str:
    reach = figures.results["casadi"]["records"]["reach"]
    lines = ["| | ms | iterations | cost |", "| --- | --- | --- | --- |"]
    for name, title in SOLVERS.items():
        way = reach[name]
        lines.append(f"| {title} | {way['ms']:.2f} | {way['iterations']} | {way['cost']:.6f} |")
    return "\n".join(lines)


def slopes_table(figures: Figures) -> str:
    found = figures.results["slopes"]["records"]
    lines = ["| µs a state, n joints | " + " | ".join(map(str, found["sizes"])) + " | slope |"]
    lines.append("| --- |" + " --- |" * (len(found["sizes"]) + 1))
    for name, row in found["growth"].items():
        lines.append(f"| {name} | " + " | ".join(f"{t:.2f}" for t in row["us"]) + f" | {row['slope']:.2f} |")
    return "\n".join(lines)


def spread_table(figures: Figures) -> str:
    lines = ["| µs a call, from Python | mean | σ | median | 95 % |", "| --- | --- | --- | --- | --- |"]
    for robot, methods in figures.results["slopes"]["records"]["forward_dynamics"].items():
        for method, row in methods.items():
            cells = " | ".join(f"{row[key]:.2f}" for key in ("mean", "sigma", "median", "p95"))
            lines.append(f"| {robot}, {method} | {cells} |")
    return "\n".join(lines)


DIVIDED = ("chain of 100", "chain of 300", "chain of 1000", "star of 100", "star of 300", "star of 1000")


def divided_table(figures: Figures) -> str:
    """Returns the table of divide and conquer, where the tree is cut into two halves. Each half is computed by
    recursion."""
    groups = figures.medians("divide_conquer")
    lines = ["| µs | `aba` | one thread | two threads |", "| --- | --- | --- | --- |"]
    for name in DIVIDED:
        found, half = groups[f"divide and conquer/{name}"], int(name.split()[-1]) // 2
        times = (us(found[key]) for key in ("aba", f"grain {half}/1 threads", f"grain {half}/2 threads"))
        lines.append(f"| {name} | " + " | ".join(times) + " |")
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
    "generated": generated_table,
    "cppadcodegen": cppadcodegen_table,
    "mpc": mpc_table,
    "threads": threads_table,
    "casadi functions": casadi_functions,
    "casadi motion": casadi_motion,
    "slopes": slopes_table,
    "spread": spread_table,
    "divide and conquer": divided_table,
}


def spread(f: Figures, algorithm: str, mode: str) -> tuple[str, str]:
    """Returns the least and the greatest ratio of Condyle's time to Pinocchio's time among the robots."""
    ratios = [f.ratio(algorithm, robot, mode) for robot in ROBOTS]
    return f"{min(ratios):.2f}", f"{max(ratios):.2f}"


def share_of_sum(f: Figures, group: str) -> tuple[str, str]:
    """Returns the least and the greatest ratio of two times: forward dynamics with the faster factorisation of the
    inertia matrix, and ABA."""
    ratios = [
        min(ways["Dense"], ways["Sparse"]) / ways["ArticulatedBody"]
        for name, ways in f.medians("factorisation").items()
        if name.startswith(group)
    ]
    return f"{min(ratios):.1f}", f"{max(ratios):.1f}"


def times_of(f: Figures, name: str, slow: str, fast: str, group: str = "forward dynamics") -> str:
    ways = f.medians("factorisation")[f"{group}/{name}"]
    return f"{ways[slow] / ways[fast]:.1f}"


def columns_to_crba(f: Figures, robot: str, n: int) -> str:
    """Returns the time of n calls of RNEA as a multiple of the time of one call of CRBA."""
    return f"{n * f.us('rnea', robot) / f.us('crba', robot):.0f}"


def differences(f: Figures, calls: int) -> str:
    """Returns the time of `calls` calls of RNEA as a multiple of the time of the derivatives of RNEA, for TALOS."""
    return f"{calls * f.us('rnea', 'talos') / f.us('rnea_derivatives', 'talos'):.0f}"


def generated_gain(f: Figures, names: tuple[str, ...]) -> list[str]:
    """Returns the least and the greatest ratio of two times: the library's call, and generated code."""
    gains = [
        f.us(row["function"], row["robot"]) * 1e3 / row["ns"] for row in f.rows("generated") if row["function"] in names
    ]
    return [f"{min(gains):.1f}", f"{max(gains):.1f}"]


def policy_calls(f: Figures, part: str) -> list[str]:
    """Returns the median and the 99th percentile of the calls of a Go2's policy (µs)."""
    calls = next(row["policy_us"] for row in f.rows(part) if "policy_us" in row)
    return [f"{microseconds:.1f}" for microseconds in calls]


def fddp_spread(f: Figures) -> list[str]:
    ratios = [row["time"]["total"]["ratio"] for row in f.rows("fddp") if "time" in row]
    return [f"{min(ratios):.2f}", f"{max(ratios):.2f}"]


def all_ratios(f: Figures, mode: str) -> list[str]:
    """Returns the least and the greatest ratio of Condyle's time to Pinocchio's time among all algorithms and
    robots."""
    ratios = [f.ratio(name, robot, mode) for name in ALGORITHMS for robot in ROBOTS]
    return [f"{min(ratios):.2f}", f"{max(ratios):.2f}"]


QUOTES: list[tuple[str, str, Callable[[Figures], list[str]]]] = [
    (
        "README.md",
        "One call takes {} to {} of Pinocchio's time, a state in a batch {} to {}.",
        lambda f: [*all_ratios(f, "one call"), *all_ratios(f, "per state of a batch")],
    ),
    ("README.md", "An iteration of FDDP takes {} to {} of Crocoddyl's.", fddp_spread),
    (
        "DESIGN.md",
        "On trees of 6 joints and more, the faster factor takes {} to {} times the time of ABA",
        lambda f: [*share_of_sum(f, "forward dynamics/")],
    ),
    (
        "docs/choosing.md",
        "the faster factor takes {} times ABA's time on an arm of 7, {} times on a humanoid",
        lambda f: [
            times_of(f, "arm7", "Dense", "ArticulatedBody"),
            times_of(f, "humanoid", "Sparse", "ArticulatedBody"),
        ],
    ),
    (
        "docs/choosing.md",
        "{} times on an arm of 7, {} times on a humanoid of 38",
        lambda f: [columns_to_crba(f, "panda", 7), columns_to_crba(f, "talos", 38)],
    ),
    (
        "docs/choosing.md",
        "$n$ calls of `rnea` take {} times the time on an arm of 7, {} times on a humanoid of 38",
        lambda f: [columns_to_crba(f, "panda", 7), columns_to_crba(f, "talos", 38)],
    ),
    (
        "docs/choosing.md",
        "{} µs for a single call, {} µs in a batch",
        lambda f: [f"{f.us('rnea', 'talos'):.2f}", f"{f.us('rnea', 'talos', 'per state of a batch'):.2f}"],
    ),
    (
        "docs/choosing.md",
        "{} times (one-sided) or {} times (central) on a humanoid of 38",
        lambda f: [differences(f, 76), differences(f, 152)],
    ),
    (
        "docs/choosing.md",
        "{} to {} times for RNEA, {} to {} times for derivatives, against the library's single call",
        lambda f: [*generated_gain(f, ("rnea",)), *generated_gain(f, ("rnea_derivatives", "aba_derivatives"))],
    ),
    (
        "docs/choosing.md",
        "the sparse factor takes {} times the dense one's time on an arm of 7, {} on a humanoid",
        lambda f: [
            times_of(f, "arm7", "Sparse", "Dense", "factorise"),
            times_of(f, "humanoid", "Sparse", "Dense", "factorise"),
        ],
    ),
    (
        "docs/mpc.md",
        "From Python, a call takes {} µs (99 % within {} µs)",
        lambda f: policy_calls(f, "mpc"),
    ),
    (
        "docs/sparsity.md",
        "forward dynamics by the faster factor takes {} to {} times as long as ABA",
        lambda f: [*share_of_sum(f, "forward dynamics/")],
    ),
    (
        "docs/sparsity.md",
        "the sparse factor takes {} times as long as a dense Cholesky on an arm of 7, and {} on a humanoid of 38",
        lambda f: [
            times_of(f, "arm7", "Sparse", "Dense", "factorise"),
            times_of(f, "humanoid", "Sparse", "Dense", "factorise"),
        ],
    ),
    (
        "docs/sparsity.md",
        "On a star of 200 joints the dense method takes {} times as long as the sparse one",
        lambda f: [times_of(f, "star of 200", "Dense", "Sparse")],
    ),
    (
        "docs/exercises.md",
        "On trees of 6 joints and more, the faster factor takes {} to {} times as long as ABA",
        lambda f: [*share_of_sum(f, "forward dynamics/")],
    ),
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
            columns_to_crba(f, "panda", 7),
        ],
    ),
    (
        "docs/lanes.md",
        "costs {} to {} of Pinocchio's single call for RNEA, and our own single call costs {} to {}.",
        lambda f: [*spread(f, "rnea", "per state of a batch"), *spread(f, "rnea", "one call")],
    ),
]
"""Sentences in pages: the page, the sentence with {} in place of each figure, and the function that returns the
figures."""


def quote(sentence: str) -> re.Pattern[str]:
    """Returns the pattern of a sentence with a group for each figure. In the page, the sentence may be broken into
    lines."""
    parts = (re.sub(r"(?:\\ )+", r"\\s+", re.escape(part)) for part in sentence.split("{}"))
    return re.compile(r"(\d+(?:\.\d+)?)".join(parts))


def filled(path: Path, text: str, figures: Figures) -> str:
    """Returns the text of a page with the figures from the JSON."""
    for name, table in TABLES.items():
        begin, end = f"<!-- figures: {name} -->", "<!-- end -->"
        pattern = re.compile(re.escape(begin) + r"\n.*?" + re.escape(end), re.DOTALL)
        if pattern.search(text):
            new = f"{begin}\n{table(figures)}\n{end}"
            text = pattern.sub(lambda _, new=new: new, text)
    for page, sentence, values in QUOTES:
        if path == ROOT / page:
            found = quote(sentence).search(text)
            if found is None:
                raise SystemExit(f"{page}: no sentence `{sentence}`")
            new, start = list(text), len(text)
            for k, value in reversed(list(enumerate(values(figures), 1))):
                start, stop = found.span(k)
                new[start:stop] = value
            text = "".join(new)
    return text


def pages() -> list[Path]:
    guide = ROOT / "crates" / "condyle" / "src" / "guide.md"
    return [ROOT / "README.md", ROOT / "DESIGN.md", guide, *sorted((ROOT / "docs").glob("*.md"))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("action", choices=("measure", "write", "check"))
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(COMMANDS))
    wanted = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    if wanted.action == "measure":
        for part in wanted.parts or COMMANDS:
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
