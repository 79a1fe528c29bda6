"""Replays the ticks of a record with Condyle, and measures the time of each part of a tick."""

import gc
import os
import threading
import time
from typing import NamedTuple

import numpy as np

from condyle.optimal import Policy

SOLVES = ("solve", "resume", "tick")
PERIOD = 0.02
"""Period of the ticks, and duration of their knots (s)."""
STEP = 1e-3
"""Period of the feedback (s)."""


class Times(NamedTuple):
    """Durations of the parts of a tick (s)."""

    shift: float
    """`solver.shift`."""
    references: float
    """`problem.set_references` of all costs."""
    before: float
    """`solver.prepare`, which runs before the state arrives."""
    after: float
    """From the state to the plan: `problem.set_x0` and the solve, or `feedback`."""
    publish: float
    """`solver.publish`."""

    @property
    def total(self):
        """Duration of the whole tick."""
        return sum(self)


class Ours:
    """Replay of a record."""

    def __init__(self, record, clock=time.perf_counter):
        self.record, self.clock = record, clock
        self.ticks = [record[k].calls for k in range(len(record))]

    def begin(self, policy=None):
        """Starts anew: makes a problem, a solver and, unless it is given, a policy, and solves the first tick."""
        self.problem, self.solver = self.record.start()
        self.policy = policy or Policy(self.problem)
        self.bound = [[(name, self.method(name), arguments) for name, arguments in calls] for calls in self.ticks]
        for _, method, arguments in self.bound[0]:
            method(**arguments)

    def method(self, name):
        """Returns the method of the solver or of the problem that a recorded call names."""
        if name == "settings":
            return self.configure
        owner = self.solver if name in (*SOLVES, "shift", "set_multipliers") else self.problem
        return getattr(owner, name)

    def configure(self, settings):
        self.solver.settings = settings

    def give(self, k):
        """Makes the calls of tick k that come before the solve, and returns the solve: a method and its arguments."""
        *before, (_, solve, arguments) = self.bound[k]
        for _, method, given in before:
            method(**given)
        return solve, arguments

    def tick(self, k):
        """Makes tick k. Returns the times of its parts."""
        *before, (name, solve, arguments) = self.bound[k]
        # not every solver can divide a tick
        divided = name == "tick" and hasattr(self.solver, "prepare")
        parts = {name: [(method, given) for own, method, given in before if own == name] for name, _, _ in before}
        clock = self.clock
        begin = clock()
        for method, given in parts["shift"]:
            method(**given)
        shifted = clock()
        for method, given in parts["set_references"]:
            method(**given)
        referred = clock()
        if divided:
            self.solver.prepare(**arguments)
        prepared = clock()
        [(set_x0, given)] = parts["set_x0"]
        if divided:
            self.solver.feedback(given["x0"])
        else:
            set_x0(**given)
            solve(**arguments)
        solved = clock()
        self.solver.publish(self.policy, PERIOD * k)
        return Times(shifted - begin, referred - shifted, prepared - referred, solved - prepared, clock() - solved)

    def run(self):
        """Makes all ticks but the first. Returns their times."""
        self.begin()
        gc.collect()
        gc.disable()
        try:
            return [self.tick(k) for k in range(1, len(self.ticks))]
        finally:
            gc.enable()

    def call_policy(self, seconds, cpu=None):
        """Makes ticks without a pause, while another thread calls the policy at 1 kHz. Returns the durations of the
        calls (s). The other thread runs on the core `cpu`."""
        durations, over = [], threading.Event()

        def feedback():
            if cpu is not None:
                os.sched_setaffinity(threading.get_native_id(), {cpu})
            x, due = self.record[0].xs[0], time.perf_counter()
            while not over.is_set():
                begin = time.perf_counter()
                u = policy(begin - start, x)
                durations.append(time.perf_counter() - begin)
                assert np.isfinite(u).all()
                due += STEP
                time.sleep(max(0.0, due - time.perf_counter()))

        self.begin()
        policy, thread, start = self.policy, threading.Thread(target=feedback), time.perf_counter()
        self.solver.publish(policy, 0.0)
        thread.start()
        while time.perf_counter() - start < seconds:
            for k in range(1, len(self.ticks)):
                self.tick(k)
            self.begin(policy)
        over.set()
        thread.join()
        return durations
