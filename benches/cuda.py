#!/usr/bin/env python3
"""Measures generated kernels on a GPU (states per second, many batch sizes). Compares them with MJX and MuJoCo Warp.

    python benches/cuda.py [--robots panda anymal talos] [--functions rnea aba ...] [--batches 10 12 14 16 18 20]
                           [--partitions 1 0]

Batch sizes are powers of two. "Resident" means that all arrays are on the device. "Copied" means that arguments are
copied to the device, and results are copied back. `--partitions` gives numbers of threads that compute one state
together. With 0, the kernel selects this number for each batch size. Before the measurement, each kernel's results are
compared with the CPU's results. MJX and MuJoCo Warp compute `forward`, which is forward dynamics and kinematics, in
single precision, for the same robot without shapes. MJX and MuJoCo Warp are skipped if they are not installed. The
program needs a GPU, NVIDIA's run-time compiler, the packages condyle and example-robot-data-loaders, and mujoco for the
peers. Without a device, the program prints NOT RUN.
"""

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import condyle
import condyle.cuda

sys.path.insert(0, str(Path(__file__).parents[1] / "tests/peers/mujoco"))

SECONDS = 0.3
"""Minimum duration of a measurement (s)."""
ROUNDING = 1e-11
"""Tolerance for rounding errors of double precision, relative to the largest number. M⁻¹ amplifies these errors."""
CHECKED = 64
"""Number of states compared with the CPU."""


def rate(n: int, call: Callable[[], object], wait: Callable[[], object]) -> float:
    """Returns the rate of a call in millions of states per second. The rate is the best of five runs, each with many
    calls."""
    call(), wait()
    count, best = 1, 0.0
    while True:
        start = time.perf_counter()
        for _ in range(count):
            call()
        wait()
        took = time.perf_counter() - start
        if took > SECONDS / 5:
            break
        count *= 2
    for _ in range(5):
        start = time.perf_counter()
        for _ in range(count):
            call()
        wait()
        best = max(best, count * n / (time.perf_counter() - start))
    return best / 1e6


def states(model: condyle.Model, names: "list[str]", n: int, dtype: str) -> list[Any]:
    """Returns the arguments of n states, with one state per index of the last axis. States repeat after 1024."""
    rng = np.random.default_rng(0)
    q = np.array([condyle.random_configuration(model, seed=k) for k in range(min(n, 1024))])
    given = {"q": q, **{name: rng.standard_normal((len(q), model.nv)) for name in names if name != "q"}}
    return [np.ascontiguousarray(np.resize(given[name], (n, given[name].shape[1])).T.astype(dtype)) for name in names]


def error(model: condyle.Model, kernel: condyle.cuda.Kernel) -> float:
    """Returns the difference between the results of the kernel and of the CPU, relative to the largest number."""
    given = states(model, list(kernel.inputs), CHECKED, kernel.dtype.name)
    found = kernel(*map(condyle.cuda.array, given))
    wanted = getattr(condyle, kernel.name)(model, condyle.Data(model), *(x.T.astype(float).copy() for x in given))
    pairs = zip(found, wanted, strict=True) if isinstance(wanted, tuple) else [(found, wanted)]
    return max(np.abs(np.moveaxis(x.numpy(), -1, 0) - y).max() / (1.0 + np.abs(y).max()) for x, y in pairs)


def ours(model: condyle.Model, kernel: condyle.cuda.Kernel, n: int) -> tuple[float, float]:
    """Returns two rates: with resident arrays (on the device), and with arrays that are copied to the device and
    back."""
    from condyle import _cuda_driver

    def wait() -> None:
        with _cuda_driver.device(0).current() as driver:
            driver.call("cuCtxSynchronize")

    host = states(model, list(kernel.inputs), n, kernel.dtype.name)
    given = [condyle.cuda.array(x) for x in host]
    out = kernel(*given)

    def copied() -> None:
        made = kernel(*map(condyle.cuda.array, host), out=out)
        for result in made if isinstance(made, tuple) else (made,):
            result.numpy()

    return rate(n, lambda: kernel(*given, out=out), wait), rate(n, copied, wait)


def table(
    model: condyle.Model, robot: str, functions: "list[str]", all_partitions: "list[int]", batches: "list[int]"
) -> None:
    for name, dtype in ((name, dtype) for name in functions for dtype in ("float32", "float64")):
        made = {k: condyle.cuda.compile(model, name, dtype=dtype, partitions=k or None) for k in all_partitions}
        for k, kernel in made.items():
            if kernel.partitions == 1 and k != next(iter(made)):
                continue  # without partitions, the kernel is the same as the first one
            apart = error(model, kernel)
            if dtype == "float64" and not apart <= ROUNDING:
                sys.exit(f"{robot}, {name}: {apart:.1e} from the CPU, {ROUNDING} are allowed")
            about = f"{robot} | {name} | {dtype} | {k} | {kernel.registers} | {kernel.local_bytes} | {apart:.0e}"
            for n in batches:
                try:
                    resident, copied = (f"{x:.3g}" for x in ours(model, kernel, n))
                except (RuntimeError, ValueError) as refused:  # too little memory, or too many states
                    resident, copied = str(refused).split(",")[0], "–"
                print(f"| {about} | {n} | {resident} | {copied} |", flush=True)


def mujoco_model(path: Path, is_free: bool) -> Any:
    """Returns the robot as a model of MuJoCo, without shapes and contacts."""
    import mujoco
    from world import bare

    model = mujoco.MjModel.from_xml_string(bare(path.read_text(encoding="utf-8"), free=is_free))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return model


def by_mjx(model: Any, n: int) -> float:
    import jax
    from mujoco import mjx

    on_device = mjx.put_model(model)
    data = jax.vmap(lambda v: mjx.make_data(model).replace(qvel=v))(jax.numpy.ones((n, model.nv)))
    forward = jax.jit(jax.vmap(mjx.forward, in_axes=(None, 0)))
    last: list[Any] = []

    def call() -> None:
        last[:] = [forward(on_device, data).qacc]

    return rate(n, call, lambda: last[0].block_until_ready())


def by_warp(model: Any, n: int) -> float:
    import mujoco_warp
    import warp

    on_device, data = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=n)
    mujoco_warp.forward(on_device, data)
    if not warp.get_device().is_cuda:
        return rate(n, lambda: mujoco_warp.forward(on_device, data), warp.synchronize)
    with warp.ScopedCapture() as capture:
        mujoco_warp.forward(on_device, data)
    return rate(n, lambda: warp.capture_launch(capture.graph), warp.synchronize)


def peers(robot: str, path: Path, is_free: bool, batches: "list[int]") -> None:
    for name, measured in (("MJX", by_mjx), ("MuJoCo Warp", by_warp)):
        for n in batches:
            try:
                found = measured(mujoco_model(path, is_free), n)
                print(f"| {robot} | {name} forward | float32 | | | | | {n} | {found:.3g} | |", flush=True)
            except Exception as failed:
                print(f"NOT RUN: {name}, {robot}, {n} states: {type(failed).__name__}: {failed}")
                break


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--robots", nargs="+", default=["panda", "anymal", "talos"], metavar="ROBOT")
    parser.add_argument("--functions", nargs="+", default=["rnea", "aba", "aba_derivatives"], metavar="FUNCTION")
    parser.add_argument("--partitions", nargs="+", type=int, default=[1, 0], metavar="N")
    parser.add_argument("--batches", nargs="+", type=int, default=[10, 12, 14, 16, 18, 20], metavar="POWER")
    options = parser.parse_args()
    try:
        found = condyle.cuda.devices()
    except RuntimeError as none:
        print(f"NOT RUN: {none}")
        return
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    print(f"{found[0]}; millions of states a second\n")
    columns = [
        "robot",
        "function",
        "type",
        "partitions",
        "registers",
        "bytes of stack",
        "error",
        "states",
        "resident",
        "copied",
    ]
    print(f"| {' | '.join(columns)} |\n|{' --- |' * len(columns)}")
    for robot in options.robots:
        loader = ROBOTS[robot]
        file = f"{loader.path}/{loader.urdf_subpath}/{loader.urdf_filename}"
        path = Path(getModelPath(file)) / file
        model = condyle.Model.from_urdf(path, root_joint="free_flyer" if loader.free_flyer else None)
        batches = [1 << power for power in options.batches]
        table(model, robot, options.functions, options.partitions, batches)
        peers(robot, path, loader.free_flyer, batches)


if __name__ == "__main__":
    main()
