"""A library of motions: an arm reaches for a point from thousands of perturbed starts. The solves run in one process or
on the workers of Ray.

    python python/examples/motion_library.py [COUNT]

Each start has its own plan with feedback; the nominal plan is the first guess of each solve. With Ray (`pip install
condyle[ray]`) the processors of this machine share the work, or the processors of a cluster whose address is the
argument `cluster` of `sweep`. The problem is sent to each worker once. If a worker is lost, another worker computes the
lost worker's variations. The results are bit-identical in one process, on one machine and on a cluster.
"""

import importlib.util
import os
import sys
import tempfile
import time

import numpy as np

import condyle
from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual

COUNT = int(sys.argv[1]) if len(sys.argv) > 1 else 100
HORIZON = 40

arm = condyle.robots.arm7()
rest = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]  # a state: q, then v
reach = Cost("reach", 100.0, Residual.frame_translation(arm, "tool", [0.35, 0.2, 0.6]))
stay, effort = Cost("rest", 0.1, Residual.state(rest)), Cost("effort", 1e-4, Residual.control(np.zeros(7)))
problem = Problem(
    rest, [FreeDynamics(arm, 0.02, [stay, effort])] * HORIZON, None, FreeDynamics(arm, None, [stay, reach])
)

# Random starts around the nominal start, with standard deviations of 0.1 rad and 0.1 rad/s.
starts = np.random.default_rng(1).normal(rest, 0.1, (COUNT, 14))

# For comparison, a loop solves all variations with one solver.
xs = np.tile(rest, (HORIZON + 1, 1))
nominal = Fddp(problem).solve(xs, problem.quasi_static(xs))
solver, by_hand = Fddp(problem), []
begin = time.perf_counter()
for x0 in starts:
    problem.set_x0(x0)
    by_hand.append(solver.solve(np.vstack([x0, nominal.xs[1:]]), nominal.us).cost)
loop = COUNT / (time.perf_counter() - begin)
print(f"a plain loop: {loop:.0f} plans a second")

# A sweep solves the same variations, and writes each finished chunk to disk.
problem.set_x0(rest)
with tempfile.TemporaryDirectory() as folder:
    begin = time.perf_counter()
    library = condyle.sweep(problem, starts, start=nominal, folder=folder)
    rate = COUNT / (time.perf_counter() - begin)
    print(f"a sweep in this process: {rate:.0f} plans a second, {rate / loop:.2f} of the loop's")
    assert np.array_equal(condyle.Variations.load(folder).us, library.us)
print(f"{(library.status == 'converged').sum()} of {COUNT} converged, after {library.iterations.mean():.1f} iterations")
assert np.allclose(library.cost, by_hand, rtol=1e-12)

# From a state near one of the starts, the robot uses the plan of that start.
near = int(np.argmin(np.linalg.norm(starts - rest, axis=1)))
print(f"start {near} is nearest to rest; its plan costs {library.cost[near]:.3f}, that from rest {nominal.cost:.3f}")

# The same sweep on all processors, if there are enough variations to justify the start of the workers.
if importlib.util.find_spec("ray") and COUNT >= 1000:
    import ray

    ray.init(include_dashboard=False, log_to_driver=False)
    workers = os.cpu_count() or 1
    rates = []
    for count in (1, workers):
        begin = time.perf_counter()
        shared = condyle.sweep(problem, starts, start=nominal, cluster=True, workers=count)
        rates.append(COUNT / (time.perf_counter() - begin))
        assert np.array_equal(shared.us, library.us)
    faster = rates[1] / rates[0]
    print(f"Ray: {rates[0]:.0f} plans a second by one worker, {rates[1]:.0f} by {workers}, {faster:.2f} times that")
    ray.shutdown()
