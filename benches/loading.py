"""Times how long two versions of condyle take to load the robots (URDFs) of example-robot-data.

    python benches/loading.py [OPTION ...]

The options are `--rounds N` and `--beside FOLDER`. FOLDER contains another `condyle` package, for example an earlier
version. Both versions load each file in turn, in separate processes. Each time is the median over the rounds. The
program prints a line for each robot, and the ratio of the sums of all times.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

LOAD = """
import json, sys, time
import condyle

for line in sys.stdin:
    path = line.rstrip("\\n")
    start = time.perf_counter()
    try:
        condyle.Model.from_urdf(path)
    except condyle.Error as error:
        print(json.dumps(None), flush=True)
        continue
    print(json.dumps(time.perf_counter() - start), flush=True)
"""


def robots() -> list[Path]:
    """Returns the paths of the URDFs in the installed package example-robot-data."""
    import example_robot_data

    folders = (base / "share" / "example-robot-data" / "robots" for base in Path(example_robot_data.__file__).parents)
    root = next(folder for folder in folders if folder.is_dir())
    return sorted(root.glob("**/*.urdf"))


def loader(folder: str | None) -> subprocess.Popen[str]:
    """Starts a process that receives paths, loads each of these files, and prints the time of each load."""
    environment = os.environ | ({"PYTHONPATH": folder} if folder else {})
    pipe = subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", LOAD], stdin=pipe, stdout=pipe, text=True, env=environment)


def ask(process: subprocess.Popen[str], path: Path) -> float | None:
    assert process.stdin is not None and process.stdout is not None
    print(path, file=process.stdin, flush=True)
    return json.loads(process.stdout.readline())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--beside", help="the folder that has another `condyle`")
    parser.add_argument("--rounds", type=int, default=15)
    wanted = parser.parse_args()
    processes = [loader(folder) for folder in (None, *([wanted.beside] if wanted.beside else []))]
    sums = [0.0] * len(processes)
    for path in robots():
        times = [[ask(process, path) for process in processes] for _ in range(wanted.rounds)]
        if any(time is None for time in times[0]):
            print(f"{path.stem:36} refused")
            continue
        medians = [statistics.median(each) * 1e6 for each in zip(*times, strict=True)]
        sums = [total + median for total, median in zip(sums, medians, strict=True)]
        print(f"{path.stem:36}" + "".join(f"{median:10.0f} µs" for median in medians))
    print("all" + "".join(f"{total:10.0f} µs" for total in sums))
    if len(sums) == 2:
        print(f"ratio: {sums[0] / sums[1]:.3f}")
