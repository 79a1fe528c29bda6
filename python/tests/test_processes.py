"""Tests with threads, forks, signals and environment variables. Each test runs its own program, with a time limit."""

import os
import signal
import subprocess
import sys
import textwrap
import time

import pytest

TIMEOUT = 120.0
"""Time (s) after which a program counts as hanging: many times the duration of a program, even without optimisation."""

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


def run(source: str, **environment: str) -> tuple[int, str, str]:
    """Runs a program, and returns its exit code, its output and its errors."""
    program = PRELUDE + textwrap.dedent(source)
    command = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", program]
    env = {**os.environ, **environment}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    return done.returncode, done.stdout, done.stderr


def check(source: str, **environment: str) -> str:
    """Runs a program that must succeed, and returns its output."""
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
    "interior point": """
        weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
        problem, xs, us = reach(limits=[weak])
        solver = InteriorPoint(problem, threads=2, max_iterations=3)
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
def test_fork_after_threads(calls: str) -> None:
    """Checks forks of a process that has computed with threads: its child, and a child of this child, compute the same
    results.
    """
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
def test_random_after_a_fork() -> None:
    """Checks that forked processes draw different random positions."""
    check(
        """
        arm = condyle.robots.arm7()
        def draw(_):
            return condyle.random_configuration(arm).tobytes()
        draw(0)
        draws = []
        for _ in range(2):
            with multiprocessing.get_context("fork").Pool(1) as pool:
                draws.append(pool.apply(draw, (0,)))
        assert len({draw(0), *draws}) == 3
        """
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork")
@pytest.mark.parametrize("name", ["batch", "fddp"])
def test_multiprocessing_by_fork(name: str) -> None:
    """Checks that a pool of forked processes computes the same results as the parent process, and ends normally."""
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


LONG = {
    "solve": """
        problem, xs, us = reach(100)
        solver = Fddp(problem, max_iterations=10**9, tolerance=0.0)
        def call():
            solver.solve(xs, us)
        def check():
            kept = solver.solution
            assert kept.status == "interrupted", kept.status
            assert np.isfinite(kept.cost) and kept.cost in [now.cost for now in kept.trace]  # the best, not the last
            assert not kept.trace[-1].cost < kept.cost
    """,
    "resume": """
        problem, xs, us = reach(100)
        solver = Fddp(problem, max_iterations=1)
        assert solver.solution is None
        first = solver.solve(xs, us)
        np.testing.assert_array_equal(solver.solution.xs, first.xs)
        solver = Fddp(problem, max_iterations=10**9, tolerance=0.0, threads=2)
        solver.solve(xs, us, callback=lambda now: False)
        def call():
            solver.resume()
        def check():
            assert solver.solution.status == "interrupted"
    """,
    "augmented lagrangian": """
        weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
        problem, xs, us = reach(100, limits=[weak])
        inner = {"max_iterations": 10**9}
        solver = AugmentedLagrangian(problem, inner, tolerance=1e-300, tolerance_dual=1e-300, max_solves=10**9,
                                     penalty_max=1e300, penalty_factor=1.0001)
        def call():
            solver.solve(xs, us)
        def check():
            assert solver.solution.status == "interrupted", solver.solution.status
            assert np.isfinite(solver.outcome.cost)
    """,
    "an action": """
        def calc(t, x, u):
            time.sleep(1e-3)
            return x + 0.1 * u, 0.5 * (x @ x + u @ u)
        knot, end = Action(1, 1, calc), Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
        solver = Fddp(Problem([1.0], [knot], [0] * 1000, end), max_iterations=10**9, tolerance=0.0)
        def call():
            solver.solve(np.ones((1001, 1)), np.zeros((1000, 1)))
        def check():
            assert solver.solution is not None
    """,
    "interior point": """
        def calc(t, x, u):
            time.sleep(1e-3)
            return x + 0.1 * u, 0.5 * (x @ x + u @ u)
        knot = ConstrainedAction(Action(1, 1, calc), 1, lambda t, x, u: u, lower=[-0.5], upper=[0.5])
        end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
        solver = InteriorPoint(Problem([1.0], [knot], [0] * 1000, end), max_iterations=10**9, tolerance=0.0)
        def call():
            solver.solve(np.ones((1001, 1)), np.zeros((1000, 1)))
        def check():
            assert solver.solution is not None
    """,
    "simulation": """
        simulation = condyle.simulation.Simulation(condyle.robots.arm7(), integrator="runge_kutta_4", dt=1e-6)
        def call():
            simulation.run(2**63)
        def check():
            assert simulation.time > 0.0
            assert simulation.run(3) == "done"
    """,
    "batch": """
        humanoid = condyle.robots.humanoid()
        data, states = condyle.Data(humanoid), 300_000
        q, v = np.tile(condyle.neutral(humanoid), (states, 1)), np.zeros((states, humanoid.nv))
        out = np.full((states, humanoid.nv), np.nan)
        def call():
            condyle.aba(humanoid, data, q, v, v, out=out)
        def check():
            assert np.isfinite(out[0]).all() and np.isnan(out[-1]).all()  # written as far as it came
    """,
}

INTERRUPTED = """
        def interrupted(error):
            begin = time.monotonic()
            try:
                call()
            except error:
                took = time.monotonic() - begin
                assert took < 20.0, took
                check()
                return
            raise AssertionError("the call has ended by itself")
"""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs signals")
@pytest.mark.parametrize("call", LONG.values(), ids=LONG)
def test_signals(call: str) -> None:
    """Checks that a signal handler runs during a call, and that its exception ends the call. Results computed so far
    are kept.
    """
    check(
        call
        + INTERRUPTED
        + """
        class Enough(Exception):
            pass

        def handler(number, frame):
            raise Enough
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        interrupted(Enough)
        """
    )


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("name", ["solve", "augmented lagrangian", "simulation"])
def test_control_c(name: str) -> None:
    """Checks that Ctrl-C raises KeyboardInterrupt within a call, and that this exception ends the program."""
    program = PRELUDE + textwrap.dedent(LONG[name] + INTERRUPTED) + "print('begin', flush=True)\n"
    program += "interrupted(KeyboardInterrupt)\nprint('again', flush=True)\ncall()\n"
    # restore the handler: a shell that runs the tests in the background may make the tests ignore Ctrl-C
    program = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n" + program
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in ("begin\n", "again\n"):
            assert process.stdout.readline() == line
            time.sleep(0.2)
            process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == -signal.SIGINT
    assert errors.rstrip().endswith("KeyboardInterrupt")


def test_signals_on_another_thread() -> None:
    """Checks that only the main thread receives signals: a solve on another thread continues, and does not block the
    interpreter.
    """
    check(
        LONG["simulation"].replace("2**63", "200_000")
        + """
        signal.signal(signal.SIGALRM, lambda *_: seen.append(time.monotonic()))
        seen = []
        signal.setitimer(signal.ITIMER_REAL, 0.01)
        worker = threading.Thread(target=call)
        worker.start()
        worker.join()
        assert seen
        assert simulation.time > 0.19
        """
    )


MEANWHILE = {
    "batch": """
        humanoid = condyle.robots.humanoid()
        data, states = condyle.Data(humanoid), 300_000
        q, v = np.tile(condyle.neutral(humanoid), (states, 1)), np.zeros((states, humanoid.nv))
        out = np.zeros((states, humanoid.nv))
        def call():
            condyle.aba(humanoid, data, q, v, v, out=out)
    """,
    "states one by one": """
        humanoid = condyle.robots.humanoid()
        data, states = condyle.Data(humanoid), 2 * 10**6
        q = np.broadcast_to(condyle.neutral(humanoid), (states, humanoid.nq))
        def call():
            condyle.potential_energy(humanoid, data, q)
    """,
    "rollout": """
        arm, knots = condyle.robots.arm7(), 250_000
        problem = Problem(np.zeros(14), [FreeDynamics(arm, 1e-6, [])], [0] * knots, FreeDynamics(arm, None, []))
        us = np.zeros((knots, 7))
        def call():
            return problem.rollout(us)
    """,
    "factorize": """
        factor, M = condyle.Cholesky(1536), np.diag(np.full(1536, 2.0))
        def call():
            factor.factorize(M)
    """,
    "inverse": """
        factor = condyle.Cholesky(800)
        factor.factorize(np.diag(np.full(800, 2.0)))
        def call():
            factor.inverse()
    """,
    "solve": """
        factor = condyle.Cholesky(800)
        factor.factorize(np.diag(np.full(800, 2.0)))
        def call():
            factor.solve_matrix(np.ones((800, 800)))
    """,
    "a factor with the zeros of a tree": """
        chain, body = condyle.ModelBuilder("chain"), condyle.WORLD
        ball = condyle.Inertia.from_com(1.0, np.zeros(3), np.eye(3))
        for k in range(1500):
            body = chain.body(f"b{k}", body, condyle.Joint.revolute([0, 0, 1]), inertia=ball)
        chain = chain.build()
        factor = condyle.Ltdl(chain)
        factor.factorize(np.diag(np.full(1500, 2.0)))
        def call():
            factor.inverse()
    """,
}


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs signals")
@pytest.mark.parametrize("call", MEANWHILE.values(), ids=MEANWHILE)
def test_handlers_run_meanwhile(call: str) -> None:
    """Checks that signal handlers run repeatedly during a long call, not once at its end, and that a handler's
    exception ends the call.
    """
    check(
        call
        + """
        seen, ends = [], False
        def handler(number, frame):
            seen.append(number)
            if ends:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
                raise TimeoutError
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, 0.005, 0.005)
        call()
        assert len(seen) > 3, len(seen)
        ends = True
        try:
            call()
        except TimeoutError:
            pass
        else:
            raise AssertionError("the call has ended by itself")
        call()
        """
    )


@pytest.mark.parametrize("value", ["", "avx3", "AVX2", "neon" if os.uname().machine == "x86_64" else "avx2"])
def test_refused_level(value: str) -> None:
    """Checks that the import raises an error that names the available SIMD levels, if the chosen level cannot be
    used.
    """
    code, _, errors = run("", CONDYLE_LEVEL=value)
    assert code == 1
    last = errors.strip().splitlines()[-1]
    assert last.startswith("ImportError: CONDYLE_LEVEL: ")
    assert "baseline" in last


def test_chosen_level() -> None:
    """Checks that the import accepts a SIMD level that every processor has."""
    check(
        "arm = condyle.robots.arm7()\ncondyle.rnea(arm, condyle.Data(arm), *np.zeros((3, 7)))", CONDYLE_LEVEL="baseline"
    )
