"""Computes the verdicts on files, each in a forked process with a time limit and a memory limit."""

import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
from multiprocessing.connection import Connection, wait
from pathlib import Path

from files import Robot
from judge import Trial, Verdict, prepare

MEMORY = 8 << 30
"""Maximum address space of a process, in bytes. A process that exceeds this limit is ended."""


def child(robot: Robot, folder: Path, pipe: Connection) -> None:
    """Computes the verdict on one file without any output on the terminal."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    os.chdir(tempfile.gettempdir())  # MuJoCo writes a log file into the current folder
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    try:
        verdict = Trial(robot, folder).verdict()
    except BaseException as error:
        text = f"{type(error).__name__}: {error}".splitlines()[0]
        verdict = Verdict("crash", [], text, {}, {}, [], {})
    pipe.send(verdict)
    pipe.close()


def run(robots: list[Robot], folder: Path, jobs: int, seconds: float) -> list[tuple[Robot, Verdict]]:
    """Returns a verdict for each file, in the order of the files."""
    prepare(folder)
    context = multiprocessing.get_context("fork")
    results: dict[int, Verdict] = {}
    running: dict[int, tuple[multiprocessing.Process, Connection, float]] = {}
    waiting = list(range(len(robots)))[::-1]
    while waiting or running:
        while waiting and len(running) < jobs:
            i = waiting.pop()
            mine, its = context.Pipe(duplex=False)
            process = context.Process(target=child, args=(robots[i], folder, its))
            process.start()
            its.close()
            running[i] = (process, mine, time.monotonic() + seconds)
        wait([pipe for _, pipe, _ in running.values()], timeout=1.0)
        for i, (process, pipe, until) in list(running.items()):
            if pipe.poll():
                try:
                    results[i] = pipe.recv()
                except EOFError:
                    process.join()
                    results[i] = Verdict("crash", [], ended(process.exitcode), {}, {}, [], {})
            elif time.monotonic() > until:
                process.kill()
                results[i] = Verdict("crash", [], f"no result within {seconds:g} s", {}, {}, [], {})
            else:
                continue
            process.join()
            pipe.close()
            del running[i]
        progress(len(results), len(robots))
    return [(robot, results[i]) for i, robot in enumerate(robots)]


def ended(code: int | None) -> str:
    """Returns a text that states how a process ended."""
    return f"ended by {signal.Signals(-code).name}" if code and code < 0 else f"ended with exit status {code}"


def progress(done: int, of: int) -> None:
    """Shows the progress of the run on a terminal."""
    if sys.stderr.isatty():
        print(f"\r{done} of {of}", end="" if done < of else "\n", file=sys.stderr, flush=True)
