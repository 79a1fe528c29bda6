#!/usr/bin/env python3
"""Times Condyle and Pinocchio 4.1 in turn, for the same robots and states, and prints the ratios.

    python3 benches/peers/dynamics.py [--json] [--rounds N] [--cpu K] [ROBOT ...]

Pinocchio is compiled for this processor (clang++ -O3 -march=native, or g++), which takes about ten minutes the first
time. Condyle is a default build. Both programs run on one core, in turn, round after round. In each round, a program
prints the median of its times. The script prints the median of these medians over all rounds. A ratio is the median
over the rounds of the quotient of two times. The script needs Linux, Rust, Python 3 with venv and a C++ compiler;
everything else is installed under target/peers.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PEERS = ROOT / "target" / "peers"
PARTS = range(4)
STATES = 64
ROBOTS = {
    "panda": ("panda", ["panda_finger_joint1", "panda_finger_joint2"]),
    "anymal": ("anymal", []),
    "talos": ("talos", []),
    "chain10": (10, []),
    "chain20": (20, []),
    "chain50": (50, []),
    "chain100": (100, []),
}
"""Robots. Each has a name in example-robot-data or the number of links of a chain, and a list of locked joints."""
BESIDE = {
    "rnea_hessian": "rnea_derivatives",
    "aba_hessian": "aba_derivatives",
    "dtau_dq_by_duals": "rnea_derivatives",
    "dtau_dq_by_differences": "rnea_derivatives",
}
"""Algorithms that only Condyle's program times. For each, the name of the algorithm with whose time the script compares
it."""

MODES = {"": "one call", "batch": "per state of a batch", "horizon": "a horizon"}
"""Prefixes in the names of algorithms, each with a description of what is timed."""
KNOT = ("aba", "aba_derivatives", "rnea")
"""Names of the algorithms that a solver calls at each knot of a horizon."""


def run(*command: "str | Path", **options: object) -> str:
    """Runs a command and returns its output."""
    result = subprocess.run([str(c) for c in command], check=True, stdout=subprocess.PIPE, text=True, **options)
    return result.stdout


def environment(name: str, *packages: str) -> Path:
    """Creates a virtual environment with these packages; returns the path of its interpreter."""
    python = PEERS / name / "bin" / "python"
    if not python.exists():
        run(sys.executable, "-m", "venv", PEERS / name)
        run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages)
    return python


def build_pinocchio(python: Path, name: str = "pinocchio", level: str = "-O3", *packages: str) -> Path:
    """Compiles pinocchio.cpp, or a similar program in several parts with headers of additional packages. Returns the
    path of the program."""
    purelib = "import sysconfig; print(sysconfig.get_paths()['purelib'])"
    prefix = Path(run(python, "-c", purelib).strip()) / "cmeel.prefix"
    folders = [prefix / "include", prefix / "include/urdfdom"]
    headers = [environment("headers", "cmeel-eigen==3.4.1", "cmeel-urdfdom-headers==3.0.0")]
    headers += [environment(f"headers-{name}", *packages)] if packages else []
    for one in headers:
        include = Path(run(one, "-c", purelib).strip()) / "cmeel.prefix" / "include"
        folders += [include, include / "urdfdom_headers", include / "eigen3"]
    # This version of CppAD has headers that clang rejects.
    compilers = ("g++",) if packages else ("clang++-19", "clang++", "g++")
    compiler = next(c for c in compilers if shutil.which(c))
    flags = ["-std=c++17", "-march=native", "-DNDEBUG", "-w", "-DBOOST_MPL_LIMIT_LIST_SIZE=30"]
    flags += ["-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_MPL_LIMIT_VECTOR_SIZE=30"]
    flags += ["-DBOOST_FUSION_INVOKE_MAX_ARITY=12"]
    for folder in folders:
        flags += ["-isystem", str(folder)]
    source, program = Path(__file__).with_name(f"{name}.cpp"), PEERS / name
    objects = [PEERS / f"{name}{part}.o" for part in PARTS]
    for part, target in zip(PARTS, objects, strict=True):
        if not target.exists() or target.stat().st_mtime < source.stat().st_mtime:
            print(f"compiling {source.name}, part {part} of {PARTS[-1]}, with {compiler} …", file=sys.stderr)
            optimised = level if part else "-O1"  # part 0 contains only the code that reads the model
            run(compiler, *flags, optimised, f"-DPART={part}", "-c", source, "-o", target)
    libraries = [f"-L{prefix}/lib", f"-Wl,-rpath,{prefix}/lib", "-lboost_serialization", "-ldl"]
    run(compiler, *objects, "-o", program, *libraries)
    return program


def build_ours() -> Path:
    """Builds benches/peers/ours.rs as `cargo bench` does; returns the path of the program."""
    command = ["cargo", "build", "--release", "--package", "condyle-benches", "--bench", "peers"]
    command += ["--message-format=json", "--locked"]
    for line in run(*command, cwd=ROOT).splitlines():
        message = json.loads(line)
        if message.get("target", {}).get("name") == "peers" and message.get("executable"):
            return Path(message["executable"])
    raise SystemExit("cargo built no program")


EXPORT = """
import sys, numpy as np, pinocchio as pin
source, free, locked, states, model_file, urdf_file, state_file = sys.argv[1:]
if source.isdigit():
    links = "".join(
        f'<link name="l{i}"><inertial><origin xyz="0.02 0.01 0.1"/><mass value="1"/>'
        f'<inertia ixx="0.01" iyy="0.012" izz="0.008" ixy="0" ixz="0.001" iyz="0"/></inertial></link>'
        for i in range(int(source) + 1))
    joints = "".join(
        f'<joint name="j{i:03}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/><origin xyz="0.05 0 0.2"/>'
        f'<axis xyz="{int(i % 3 == 0)} {int(i % 3 == 1)} {int(i % 3 == 2)}"/>'
        f'<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>' for i in range(int(source)))
    open(urdf_file, "w").write(f'<robot name="chain">{links}{joints}</robot>')
    path = urdf_file
else:
    import os
    from example_robot_data.robots_loader import ROBOTS, getModelPath
    loader = ROBOTS[source]
    path = os.path.join(loader.path, loader.urdf_subpath, loader.urdf_filename)
    path = os.path.join(getModelPath(path), path)
    free = str(int(loader.free_flyer))
model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer()) if free == "1" else pin.buildModelFromUrdf(path)
if locked:
    ids = [model.getJointId(name) for name in locked.split(",")]
    model = pin.buildReducedModel(model, ids, pin.neutral(model))
model.saveToBinary(model_file)
rng = np.random.default_rng(0)
lower = np.maximum(model.lowerPositionLimit, -3.0)
upper = np.minimum(model.upperPositionLimit, 3.0)
with open(state_file, "wb") as file:
    for _ in range(int(states)):
        q = pin.randomConfiguration(model, lower, upper)
        file.write(np.concatenate([q, *rng.standard_normal((3, model.nv))]).astype("<f8").tobytes())
print(path)
print("free_flyer" if free == "1" else "fixed")
"""


def times(output: str) -> dict[str, float]:
    return {name: float(ns) for name, ns in (line.split() for line in output.splitlines())}


def peer_time(kind: str, name: str, mine: dict[str, float], theirs: dict[str, float]) -> float:
    """Returns the reference time of an algorithm, with which the script compares Condyle's time."""
    if kind == "horizon":
        return int(name) * sum(theirs[algorithm] for algorithm in KNOT)
    return theirs.get(name) or mine[BESIDE[name]]


def compare(robot: str, python: Path, theirs: Path, ours: Path, rounds: int, cpu: int) -> list[dict]:
    """Runs both programs in turn for one robot."""
    source, locked = ROBOTS[robot]
    model, urdf, states = (PEERS / f"{robot}.{suffix}" for suffix in ("bin", "urdf", "states"))
    export = run(python, "-c", EXPORT, str(source), "0", ",".join(locked), str(STATES), model, urdf, states)
    path, root = export.splitlines()
    pin = {"preexec_fn": lambda: os.sched_setaffinity(0, {cpu})}
    runs = [
        (times(run(ours, path, root, ",".join(locked), states, **pin)), times(run(theirs, model, states, **pin)))
        for _ in range(rounds)
    ]
    rows = []
    for key in runs[0][0]:
        kind, _, name = key.rpartition(":")
        mode = MODES[kind]
        if name in BESIDE:
            mode += f", beside our {BESIDE[name]}"
        peer = [peer_time(kind, name, mine, peer) for mine, peer in runs]
        rows.append(
            {
                "robot": robot,
                "algorithm": name if kind != "horizon" else f"{name} knots of {', '.join(KNOT)}",
                "mode": mode,
                "ours_ns": statistics.median(mine[key] for mine, _ in runs),
                "peer_ns": statistics.median(peer),
                "ratio": statistics.median(mine[key] / other for (mine, _), other in zip(runs, peer, strict=True)),
            }
        )
    return rows


def table(rows: list[dict]) -> str:
    """Returns the ratios as text: a table for each mode, with a column for each robot."""
    robots = list(dict.fromkeys(row["robot"] for row in rows))
    tables = []
    for mode in MODES.values():
        lines = [f"| {mode}: ratio (ours in µs) | " + " | ".join(robots) + " |", "| --- |" + " --- |" * len(robots)]
        mine = [row for row in rows if row["mode"].split(",")[0] == mode]
        for name in dict.fromkeys(row["algorithm"] for row in mine):
            cells = {
                row["robot"]: f"{row['ratio']:.2f} ({row['ours_ns'] / 1e3:.2f})"
                for row in mine
                if row["algorithm"] == name
            }
            beside = f" / {BESIDE[name]}" if name in BESIDE else ""
            lines.append(f"| {name}{beside} | " + " | ".join(cells[robot] for robot in robots) + " |")
        tables.append("\n".join(lines))
    return "\n\n".join(tables)


def processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return "unknown"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("robots", nargs="*", default=list(ROBOTS), metavar="ROBOT", help=", ".join(ROBOTS))
    parser.add_argument("--json", action="store_true", help="print a list of records in place of the table")
    parser.add_argument("--rounds", type=int, default=5, help="how often each program runs")
    parser.add_argument("--cpu", type=int, default=0, help="the core on which both run")
    options = parser.parse_args()
    if unknown := set(options.robots) - ROBOTS.keys():
        parser.error(f"no robot {', '.join(sorted(unknown))}; there are {', '.join(ROBOTS)}")
    PEERS.mkdir(parents=True, exist_ok=True)
    python = environment("venv", "pin==4.1.0", "example-robot-data-loaders==5.0.0")
    theirs, ours = build_pinocchio(python), build_ours()
    rows = []
    for robot in options.robots:
        rows += compare(robot, python, theirs, ours, options.rounds, options.cpu)
    if options.json:
        print(json.dumps(rows, indent=1))
        return
    flags = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    names = {"avx512f": "AVX-512", "avx2": "AVX2", "asimd": "NEON"}
    vectors = next((name for flag, name in names.items() if flag in flags), "no vectors")
    print(f"{processor()} ({vectors}), one core, {options.rounds} rounds\n")
    print(table(rows))


if __name__ == "__main__":
    main()
