"""What a thread, a fork, a signal and the environment may do. Each test runs a program of its own, with a time-out."""

import os
import subprocess
import sys
import textwrap

import pytest

TIMEOUT = 120.0
"""Seconds after which a program counts as hanging: many times what it takes, even unoptimised."""

PRELUDE = """
import gc, multiprocessing, os, signal, sys, threading, time
import numpy as np
import condyle
from condyle.optimal import *

def reach(knots=20, threads=1, limits=None):
    arm = condyle.robots.arm7()
    x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
    costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
    knot = FreeDynamics(arm, 0.05, costs, limits=limits)
    goal = Cost("goal", 1e3, Residual.frame_translation(arm, "tool", [0.5, 0.1, 0.6]))
    problem = Problem(x0, [knot], [0] * knots, FreeDynamics(arm, None, [goal]))
    return problem, np.tile(x0, (knots + 1, 1)), np.tile(knot.quasi_static(x0), (knots, 1))
"""


def run(source, **environment):
    """Runs a program, and returns its exit code, its output and its errors."""
    program = PRELUDE + textwrap.dedent(source)
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program]
    env = {**os.environ, **environment}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    return done.returncode, done.stdout, done.stderr


def check(source, **environment):
    """Runs a program that ends well, and returns its output."""
    code, output, errors = run(source, **environment)
    assert code == 0, errors
    return output


CALLS = {
    "batch": """
        arm = condyle.robots.arm7()
        data = condyle.Data(arm, threads=2)
        q = np.random.default_rng(0).normal(size=(100, 7))
        def call():
            return condyle.rnea(arm, data, q, q, q).sum(), condyle.rnea_derivatives(arm, data, q, q, q).dtau_dq.sum()
    """,
    "divide and conquer": """
        humanoid = condyle.robots.humanoid()
        divided = condyle.DivideConquer(humanoid, grain=2)
        q, v = condyle.neutral(humanoid), np.ones(humanoid.nv)
        def call():
            return divided.aba(humanoid, q, v, v).sum()
    """,
    "fddp": """
        problem, xs, us = reach()
        solver = Fddp(problem, threads=2, segments=2, max_iterations=3)
        def call():
            return solver.solve(xs, us).cost
    """,
    "augmented lagrangian": """
        weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
        problem, xs, us = reach(limits=[weak])
        solver = AugmentedLagrangian(problem, {"threads": 2, "segments": 2, "max_iterations": 3}, max_solves=2)
        def call():
            return solver.solve(xs, us).cost
    """,
    "simulation": """
        simulation = condyle.simulation.Simulation(condyle.robots.quadruped())
        def call():
            simulation.set_state(condyle.neutral(condyle.robots.quadruped()), np.zeros(18))
            simulation.run(10)
            return simulation.q.sum()
    """,
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
@pytest.mark.parametrize("calls", CALLS.values(), ids=CALLS)
def test_fork_after_threads(calls):
    """The child of a process that has computed on threads computes the same, and so does its own child."""
    check(
        calls
        + """
        first = call()

        def child():  # in the child: the same call, what was made here, and what is made anew; then everything goes
            assert call() == first

        def fork(depth):
            child()
            if depth == 0:
                return
            pid = os.fork()
            if pid == 0:
                code = 1
                try:
                    fork(depth - 1)
                    code = 0
                finally:
                    os._exit(code)
            assert os.waitpid(pid, 0)[1] == 0
            child()

        fork(2)
        """,
        RAYON_NUM_THREADS="3",
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
@pytest.mark.parametrize("name", ["batch", "fddp"])
def test_multiprocessing_by_fork(name):
    """A pool of forked processes computes what their parent has computed, and ends as it should."""
    check(
        CALLS[name]
        + """
        first = call()
        def work(_):
            return call()
        with multiprocessing.get_context("fork").Pool(2) as pool:
            assert pool.map(work, range(4), chunksize=1) == [first] * 4
        with multiprocessing.get_context("fork").Pool(1) as pool:
            assert pool.apply(work, (0,)) == first
            pool.close()
            pool.join()  # the interpreter of the child ends by itself, and drops what it has inherited
        """,
        RAYON_NUM_THREADS="3",
    )


@pytest.mark.parametrize("value", ["", "avx3", "AVX2", "neon" if os.uname().machine == "x86_64" else "avx2"])
def test_refused_level(value):
    """A level that cannot be used is an error of the import, which names those that can."""
    code, _, errors = run("", CONDYLE_LEVEL=value)
    assert code == 1
    last = errors.strip().splitlines()[-1]
    assert last.startswith("ImportError: CONDYLE_LEVEL: ")
    assert "baseline" in last


def test_chosen_level():
    check("condyle.rnea(condyle.robots.arm7(), condyle.Data(condyle.robots.arm7()), *np.zeros((3, 7)))", CONDYLE_LEVEL="baseline")
