"""Counts the allocations of the compiled module during ticks of model predictive control.

A C library that is loaded first replaces `malloc`. It counts calls from the code of the module, separately for threads
that hold the interpreter's lock and for threads that do not. A solver runs without the lock.
"""

import ctypes
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

COUNTER = Path(__file__).with_name("counting.c")
TICKS = 8
GLIBC = sys.platform == "linux" and platform.libc_ver()[0] == "glibc"


@pytest.mark.skipif(not GLIBC or shutil.which("cc") is None, reason="needs glibc and a C compiler")
@pytest.mark.parametrize("rule", ["tick", "resume", "full_step"])
def test_a_tick_allocates_nothing(rule: str, tmp_path: Path) -> None:
    library = tmp_path / "counting.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(COUNTER)], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "COUNTER": str(library)}
    command = [sys.executable, __file__, rule]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


def main(rule: str) -> None:
    """Makes ticks, and checks the numbers of allocations. Runs in a process of its own."""
    import numpy as np
    from test_mpc import KNOTS, STAND, guess, standing

    from condyle import _condyle
    from condyle.optimal import Fddp, InteriorPoint, Policy

    counter, parts = ctypes.CDLL(os.environ["COUNTER"]), []
    counter.counting_count.restype = ctypes.c_ulong
    for line in Path("/proc/self/maps").read_text().splitlines():
        if line.endswith(str(_condyle.__file__)):
            parts += [int(address, 16) for address in line.split()[0].split("-")]
    holds_lock = ctypes.cast(ctypes.pythonapi.PyGILState_Check, ctypes.c_void_p)
    counter.counting_watch(ctypes.c_void_p(min(parts)), ctypes.c_void_p(max(parts)), holds_lock)

    def counted(call: Any, *arguments: Any, **named: Any) -> list[int]:
        """Returns the numbers of allocations without and with the lock."""
        before = [counter.counting_count(lock) for lock in (0, 1)]
        call(*arguments, **named)
        return [counter.counting_count(lock) - count for lock, count in zip((0, 1), before, strict=True)]

    problem = standing()
    solver: Any = InteriorPoint(problem, tolerance=1e-4) if rule == "tick" else Fddp(problem, max_iterations=3)
    policy = Policy(problem)
    first = counted(solver.solve, *guess(problem))
    assert first[0] > 0 and first[1] > 0, first  # the counter works
    references, states = np.tile(STAND, (KNOTS + 1, 1)), np.tile(STAND, (TICKS, 1))
    states[:, 19:25] += 0.1 * np.random.default_rng(0).standard_normal((TICKS, 6))
    solve = {
        "tick": lambda: solver.tick(2),
        "resume": lambda: solver.resume(),
        "full_step": lambda: solver.resume(stop="full_step", most=3),
    }[rule]
    for k in range(TICKS):
        counts = {
            "shift": counted(solver.shift, 0),
            "references": counted(problem.set_references, "state", references),
            "x0": counted(problem.set_x0, states[k]),
            "solve": counted(solve)[:1],  # the result is copied to new arrays, with the lock
            "publish": counted(solver.publish, policy, 0.02 * k),
        }
        print(k, counts)
        if k >= 2:  # the first ticks give separate costs to knots
            assert not any(any(numbers) for numbers in counts.values()), (k, counts)


if __name__ == "__main__":
    main(sys.argv[1])
