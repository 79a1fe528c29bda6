"""Tests that memory does not grow and results do not change over very many calls, and that eight threads get the same
results.

If the environment variable `CONDYLE_FULL` is set, as by `./test full`, memory is observed over 10⁷ calls, else over
10⁵.
"""

import gc
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import condyle

CALLS = 10**7 if "CONDYLE_FULL" in os.environ else 10**5
# BYTES: maximum growth of memory, because allocators may keep some memory. A leak of one pointer per call would be
# twice as large. BLOCKS: maximum growth of the number of Python objects. A leak of one object in every fourth call of a
# kind would be larger.
BYTES = 400_000
BLOCKS = 2000


def resident() -> int:
    """Returns the resident memory of this process, in bytes."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def calls() -> dict[str, Callable[[], object]]:
    """Returns calls of every kind: with results that are arrays, tuples or numbers, and with arguments that are used
    without a copy, converted, or refused.
    """
    robot = condyle.robots.quadruped()
    data, q = condyle.Data(robot), condyle.random_configuration(robot, seed=1)
    v, a = np.random.default_rng(1).standard_normal((2, robot.nv))
    f_ext, out = np.ones((robot.nbodies, 6)), np.zeros((robot.nv, robot.nv))
    many, feet = np.tile(q, (3, 1)), [condyle.ContactConstraint("LF_foot", "point")]
    stance = condyle.ConstraintSet(robot, feet)

    def refused() -> None:
        try:
            condyle.rnea(robot, data, q, v, a[1:])
        except ValueError:
            return
        raise AssertionError("was not refused")

    return {
        "array": lambda: condyle.rnea(robot, data, q, v, a, f_ext),
        "converted": lambda: condyle.aba(robot, data, q[::-1][::-1].astype(np.float32), v.tolist(), a[::1]),
        "out": lambda: condyle.crba(robot, data, q, out=out),
        "tuple": lambda: condyle.rnea_derivatives(robot, data, q, v, a),
        "frame": lambda: condyle.frame_jacobian(robot, data, q, "RH_foot", "world"),
        "number": lambda: condyle.kinetic_energy(robot, data, q, v),
        "states": lambda: condyle.aba_derivatives(robot, data, many, v, a),
        "stacked": lambda: condyle.integrate(robot, many, v),
        "constraints": lambda: condyle.constrained_dynamics(robot, data, stance, q, v, a),
        "attributes": lambda: (robot.frames, robot.names, robot.limits, robot.inertias, robot.gravity + 1.0),
        "refused": refused,
        "data": lambda: condyle.Data(robot),
    }


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_is_flat() -> None:
    kinds = list(calls().values())

    def after(n: int) -> tuple[int, int]:
        for k in range(n):
            kinds[k % len(kinds)]()
        gc.collect()
        return sys.getallocatedblocks(), resident()

    blocks, memory = after(max(20_000, CALLS // 50))
    blocks_after, memory_after = after(CALLS)
    assert blocks_after - blocks < BLOCKS
    assert memory_after - memory < BYTES


def test_eight_threads_on_one_model() -> None:
    """Checks that eight threads get the same results. Each thread has its own `Data`. The threads access the model's
    attributes for the first time.
    """
    robot, states, rounds = condyle.robots.humanoid(), 40, 25
    rng = np.random.default_rng(2)
    q = np.stack([condyle.random_configuration(robot, seed=k) for k in range(states)])
    v, tau = rng.standard_normal((2, states, robot.nv))
    foot, reference = len(robot.frames) - 1, condyle.Data(robot)
    expected = condyle.aba_derivatives(robot, reference, q, v, tau)
    torques = np.stack([condyle.rnea(robot, reference, *one) for one in zip(q, v, tau, strict=True)])
    placements = condyle.frame_placement(robot, reference, q, foot)
    fresh = robot.with_gravity(robot.gravity)  # a new model, whose attributes were not accessed yet
    failures: list[BaseException] = []
    start = threading.Barrier(8)

    def work(thread: int) -> None:
        try:
            data = condyle.Data(fresh, threads=1 + thread % 2)
            start.wait()
            for k in range(rounds):
                assert len(fresh.frames) > foot
                assert fresh.limits is fresh.limits
                found = condyle.aba_derivatives(fresh, data, q, v, tau)
                assert all(np.array_equal(x, y) for x, y in zip(found, expected, strict=True))
                one = (thread + 8 * k) % states
                assert np.array_equal(condyle.rnea(fresh, data, q[one], v[one], tau[one]), torques[one])
                assert np.array_equal(condyle.frame_placement(fresh, data, q, foot), placements)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
