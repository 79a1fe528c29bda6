#!/usr/bin/env python3
"""Times a step of whole-body control with Condyle's back ends, and other solvers for the same programs.

    python3 benches/peers/wholebody.py [--json] [--write] [--ticks N] [--window N] [--replays N] [--cpu K] [ROBOT ...]

Robots that stand, walk and trot under pushes are recorded (benches/peers/wholebody.rs), and the recordings are
replayed. A step is called a tick. The time of a tick is the least time in all replays, which excludes other work on the
machine. The table also has the 99th percentile of the times in all replays. For Condyle's back ends, the program times
a whole tick, from state to torques, with cones and with pyramids. It also times the assembly (kinematics, rows and
condensing) alone. For ProxQP, quadprog, DAQP, eiquadprog (TSID's solver) and Condyle's solvers, it times the solve
alone, with pyramids. These solvers get the programs of consecutive ticks, in full and in condensed form, with warm
starts if available. All solvers run on one core, for some minutes after the build. With --write, the table is written
to crates/wholebody/README.md. Talos and ANYmal come from example-robot-data. The script needs Linux, Rust, Python 3
with venv and a C++ compiler; everything else is installed under target/peers.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dynamics import PEERS, ROOT, environment, processor, run

HERE = Path(__file__).parent
URDF = {"talos": "talos_data/robots/talos_reduced.urdf", "anymal": "anymal_b_simple_description/robots/anymal.urdf"}
ROBOTS = ["talos", "anymal", "humanoid", "quadruped"]
DOCUMENT = ROOT / "crates" / "wholebody" / "README.md"


def build_ours() -> Path:
    """Builds benches/peers/wholebody.rs as `cargo bench` does; returns the path of the program."""
    command = ["cargo", "build", "--release", "--package", "condyle-benches", "--bench", "wholebody_peers"]
    command += ["--message-format=json", "--locked"]
    for line in run(*command, cwd=ROOT).splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == "wholebody_peers" and message.get("executable"):
            return Path(message["executable"])
    raise SystemExit("cargo built no program")


def build_eiquadprog(prefix: Path) -> Path:
    """Compiles eiquadprog.cpp with the headers of the installed wheel; returns the path of the library."""
    library, source = PEERS / "eiquadprog.so", HERE / "eiquadprog.cpp"
    compiler = next(c for c in ("clang++-19", "clang++", "g++") if shutil.which(c))
    flags = ["-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-w", "-shared", "-fPIC"]
    flags += [f"-I{prefix}/include", f"-I{prefix}/include/eigen3", f"-L{prefix}/lib", f"-Wl,-rpath,{prefix}/lib"]
    run(compiler, *flags, source, "-o", library, "-leiquadprog")
    return library


def table(records: list[dict]) -> str:
    """Returns the table with a row for each solver and form, and with a column for each recording."""
    columns = list(dict.fromkeys((r["robot"], r["workload"]) for r in records))
    lines = [
        "| ms: p50, p99 (max; p99 of all replays) | " + " | ".join(f"{robot}, {what}" for robot, what in columns) + " |"
    ]
    lines.append("| --- |" + " --- |" * len(columns))
    ways: dict[tuple, dict] = {}
    for r in records:
        name = f"{'ours, ' if r['ours'] else ''}{r['backend']}" if r["part"] != "assembly" else "ours"
        way = (name, r["part"], r["friction"], r["form"])
        cell = f"{r['p50_ms']:.3f}, {r['p99_ms']:.3f} ({r['max_ms']:.3f}; {r['raw_p99_ms']:.3f})"
        if r.get("unsolved"):
            cell += f", {r['unsolved']} of {r['ticks']} unsolved"
        ways.setdefault(way, {})[(r["robot"], r["workload"])] = cell
    for (name, part, friction, form), cells in ways.items():
        row = [cells.get(column, "") for column in columns]
        lines.append(f"| {name}: {part}, {friction}, {form} | " + " | ".join(row) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("robots", nargs="*", metavar="ROBOT", help=", ".join(ROBOTS))
    parser.add_argument("--json", action="store_true", help="print a record a line; the table goes to stderr")
    parser.add_argument("--write", action="store_true", help="put the table into crates/wholebody/README.md")
    parser.add_argument("--ticks", type=int, default=10_000, help="the length of a recording")
    parser.add_argument("--window", type=int, default=1000, help="how many of them the other solvers see")
    parser.add_argument("--replays", type=int, default=5, help="how often each recording is replayed")
    parser.add_argument("--cpu", type=int, default=0, help="the core on which all runs")
    options = parser.parse_args()
    if unknown := set(options.robots) - set(ROBOTS):
        parser.error(f"no robot {', '.join(sorted(unknown))}; there are {', '.join(ROBOTS)}")
    PEERS.mkdir(parents=True, exist_ok=True)
    python = environment("wholebody", "-r", str(HERE / "requirements-wholebody.txt"))
    purelib = run(python, "-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])").strip()
    prefix = Path(purelib) / "cmeel.prefix"
    ours, eiquadprog = build_ours(), build_eiquadprog(prefix)
    robots = prefix / "share" / "example-robot-data" / "robots"
    names = [f"{name}={robots / URDF[name]}" if name in URDF else name for name in options.robots or ROBOTS[:2]]

    def pin() -> None:
        os.sched_setaffinity(0, {options.cpu})

    records = []
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["--ticks", options.ticks, "--window", options.window, "--replays", options.replays]
        commands = [
            [ours, *arguments, "--export", folder, *names],
            [python, HERE / "wholebody_theirs.py", folder, options.replays, eiquadprog],
        ]
        for command in commands:
            program = subprocess.Popen(
                [str(c) for c in command],
                stdout=subprocess.PIPE,
                text=True,
                preexec_fn=pin,
                env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )
            assert program.stdout is not None
            for line in program.stdout:
                records.append(json.loads(line))
                print(line, end="", file=sys.stdout if options.json else sys.stderr, flush=True)
            if program.wait() != 0:
                raise SystemExit(f"{command[0]} failed")
    window = min(options.window, options.ticks)
    made = (
        f"{processor()}, one core; recordings of {options.ticks} ticks, solves of {window} of them; each the least of "
    )
    made += f"{options.replays} replays\n\n{table(records)}\n"
    print(f"\n{made}", file=sys.stderr if options.json else sys.stdout)
    if options.write:
        text = DOCUMENT.read_text(encoding="utf-8")
        pattern = r"(<!-- times -->\n).*?(<!-- end -->)"
        DOCUMENT.write_text(re.sub(pattern, lambda m: m[1] + made + m[2], text, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()
