#!/usr/bin/env python3
"""Times a tick of whole-body control by each of our back ends, and other solvers on the same programs.

    python3 benches/peers/wholebody.py [--json] [--ticks N] [--window N] [--replays N] [--cpu K] [ROBOT ...]

Robots that stand, walk and trot while they are pushed are recorded (benches/peers/wholebody.rs), and the recordings
are replayed: each tick counts by the least of its replays, so that other work on the machine does not; the p99 of all
stands beside it. Ours: a whole tick, from state to torques, on cones and on pyramids, and its assembly (kinematics,
rows and condensing) alone. ProxQP, quadprog, DAQP, eiquadprog (TSID's) and ours: a solve alone, on pyramids, of the
window's consecutive programs, in both forms, warm-started where they offer it. All run on one core. Talos and ANYmal
come from example-robot-data. Needs Linux, Rust, Python 3 with venv and a C++ compiler; everything else is installed
under target/peers.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dynamics import PEERS, ROOT, environment, processor, run

HERE = Path(__file__).parent
URDF = {"talos": "talos_data/robots/talos_reduced.urdf", "anymal": "anymal_b_simple_description/robots/anymal.urdf"}
ROBOTS = ["talos", "anymal", "humanoid", "quadruped"]


def build_ours() -> Path:
    """Builds benches/peers/wholebody.rs as `cargo bench` does; its path."""
    command = ("cargo", "build", "--release", "--bench", "wholebody_peers", "--message-format=json", "--locked")
    for line in run(*command, cwd=ROOT).splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == "wholebody_peers" and message.get("executable"):
            return Path(message["executable"])
    raise SystemExit("cargo built no program")


def build_eiquadprog(prefix: Path) -> Path:
    """Compiles eiquadprog.cpp against the wheel; its path."""
    library, source = PEERS / "eiquadprog.so", HERE / "eiquadprog.cpp"
    compiler = next(c for c in ("clang++-19", "clang++", "g++") if shutil.which(c))
    flags = ["-std=c++17", "-O3", "-march=native", "-DNDEBUG", "-w", "-shared", "-fPIC"]
    flags += [f"-I{prefix}/include", f"-I{prefix}/include/eigen3", f"-L{prefix}/lib", f"-Wl,-rpath,{prefix}/lib"]
    run(compiler, *flags, source, "-o", library, "-leiquadprog")
    return library


def table(records: list[dict]) -> str:
    """A row for each way to solve, a column for each recording."""
    columns = list(dict.fromkeys((r["robot"], r["workload"]) for r in records))
    lines = ["| ms: p50, p99 (max) | " + " | ".join(f"{robot}, {what}" for robot, what in columns) + " |"]
    lines.append("| --- |" + " --- |" * len(columns))
    ways: dict[tuple, dict] = {}
    for r in records:
        name = f"{'ours, ' if r['ours'] else ''}{r['backend']}" if r["part"] != "assembly" else "ours"
        way = (name, r["part"], r["friction"], r["form"])
        cell = f"{r['p50_ms']:.3f}, {r['p99_ms']:.3f} ({r['max_ms']:.3f})"
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
    parser.add_argument("--json", action="store_true", help="print a record a line in place of the table")
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
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )
            assert program.stdout is not None
            for line in program.stdout:
                records.append(json.loads(line))
                if options.json:
                    print(line, end="", flush=True)
                else:
                    print(line, end="", file=sys.stderr, flush=True)
            if program.wait() != 0:
                raise SystemExit(f"{command[0]} failed")
    if not options.json:
        print(f"\n{processor()}, one core; each tick the least of {options.replays} replays\n")
        print(table(records))


if __name__ == "__main__":
    main()
