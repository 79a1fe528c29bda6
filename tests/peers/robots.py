"""Compares every robot file below some folders: Condyle's model with the models of other libraries that read the file.
Prints a table of equal and different models.

    python tests/peers/robots.py FOLDER… [--only PATTERN] [--list] [--table FILE] [--jobs N]

URDFs are compared with Pinocchio, Drake and MuJoCo, MJCFs with MuJoCo, and SDFs with Drake. Any of these libraries may
be missing. Each file is read in its own process with a time limit, so a crash of a library is reported as a row of the
table.

In a path, a folder `owner+repository` names the GitHub repository of a file. `SOURCES.tsv` in FOLDER, or next to
FOLDER, contains the commits of the repositories: a line has `owner/repository`, a tab and the commit.
`--table VALIDATION.md` replaces the section on public robots in that file.
`pytest tests/peers/pinocchio --validation VALIDATION.md` writes the rest of the file and keeps the section.

The exit status is 1 if a robot differs or a process crashes.
"""

import argparse
import json
import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "robots"))
os.environ.setdefault("OMP_NUM_THREADS", "1")

import files
import report
from processes import run

COMMAND = "python tests/peers/robots.py FOLDER --table VALIDATION.md"


def main() -> int:
    """Compares the robots that the command line names, and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="+", help="folder with robots")
    parser.add_argument("--only", metavar="PATTERN", help="only paths below a folder that match, such as '*anymal*'")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once (2)")
    parser.add_argument("--seconds", type=float, default=120.0, help="time limit of a file (120)")
    parser.add_argument("--list", action="store_true", help="print each file with its verdict")
    parser.add_argument("--table", type=Path, metavar="FILE", help="put the table into a Markdown file")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all results")
    arguments = parser.parse_args()
    results: report.Results = []
    commits: dict[str, str] = {}
    for folder in arguments.folder:
        if not folder.is_dir():
            parser.error(f"{folder} is no folder")
        robots = files.find(folder.resolve(), arguments.only)
        results += run(robots, folder.resolve(), arguments.jobs, arguments.seconds)
        for sources in (folder.resolve().parent / "SOURCES.tsv", folder / "SOURCES.tsv"):
            lines = sources.read_text(encoding="utf-8").splitlines() if sources.exists() else []
            commits |= {line.split("\t")[0]: line.split("\t")[1] for line in lines if "\t" in line}
    if not results:
        parser.error("no robot files are below these folders")
    if arguments.json:
        rows = [{**r._asdict(), "path": str(r.path), **v._asdict()} for r, v in results]
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    if arguments.list:
        print(report.listing(results))
    print(report.summary(results))
    if arguments.table:
        report.put(
            arguments.table,
            report.table(results, commits, COMMAND, "1e-10 (MuJoCo: 1e-8, with meshes 1e-6; SDF before 1.7: 1e-8)"),
        )
    return int(any(verdict.verdict in ("different", "crash") for _, verdict in results))


if __name__ == "__main__":
    sys.exit(main())
