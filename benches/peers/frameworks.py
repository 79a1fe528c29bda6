#!/usr/bin/env python3
"""Measures derivatives of forward dynamics in PyTorch and JAX, against the library's own calls for many states.

    python benches/peers/frameworks.py              # batches of 1024 states of panda and TALOS
    python benches/peers/frameworks.py --calls      # only the time of a call of the library from JAX
    python benches/peers/frameworks.py --check      # few states: shows that the script runs

Needs `torch`, `jax` and `example-robot-data`; a missing framework is left out. All calls use one thread. `Batch`
is the time of `aba` and `aba_derivatives`, with arrays that are allocated once. The frameworks compute `aba`, and then
the gradient of a weighted sum of accelerations with respect to q, v and τ, which contains `aba_derivatives`. Each time
is the smallest of several runs, in µs per state; the number in brackets is the ratio to `Batch`.

`--calls` compares three compiled programs that add three arrays: by XLA, by a callback as `condyle.jax` uses it, and by
`jax.pure_callback`. Times are in µs per call.
"""

import argparse
import importlib.util
import os
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import numpy as np

import condyle

REPEATS = 30
"""Number of runs of which the fastest counts."""


def robots() -> dict[str, condyle.Model]:
    return {"panda": condyle.load("panda"), "talos": condyle.load("talos")}


def fastest(call: Callable[[], Any], repeats: int) -> float:
    """Returns the smallest time of a call, in seconds."""
    times = []
    for _ in range(repeats + 2):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times[2:])


def batch(model: condyle.Model, q: Any, v: Any, tau: Any) -> tuple[Callable[[], Any], Any]:
    """Returns the call of the library, and the gradients that the frameworks must find, without position."""
    data, weights = condyle.Data(model), np.sin(np.arange(q.shape[0] * model.nv)).reshape(v.shape)
    value = np.empty_like(v)
    found = condyle.aba_derivatives(model, data, q, v, tau)

    def call() -> None:
        condyle.aba(model, data, q, v, tau, out=value)
        condyle.aba_derivatives(model, data, q, v, tau, out=found)

    expected = [np.einsum("nij,ni->nj", J, weights) for J in (found.da_dv, found.da_dtau)]
    return call, (weights, expected)


def in_torch(model: condyle.Model, x: list[Any], weights: Any) -> Callable[[], list[Any]]:
    import torch

    import condyle.torch

    torch.set_num_threads(1)
    robot, w = condyle.torch.Dynamics(model), torch.tensor(weights)
    tensors = [torch.tensor(a, requires_grad=True) for a in x]

    def call() -> list[Any]:
        return [g.numpy() for g in torch.autograd.grad(robot.aba(*tensors), tensors, w)]

    return call


def in_jax(model: condyle.Model, x: list[Any], weights: Any) -> Callable[[], list[Any]]:
    import jax
    import jax.numpy as jnp

    import condyle.jax

    jax.config.update("jax_enable_x64", True)
    robot, arrays = condyle.jax.Dynamics(model), [jnp.asarray(a) for a in (*x, weights)]

    @jax.jit
    def gradients(q: Any, v: Any, tau: Any, w: Any) -> Any:
        a, pull = jax.vjp(robot.aba, q, v, tau)
        return a, pull(w)

    def call() -> list[Any]:
        return [np.asarray(g) for g in jax.block_until_ready(gradients(*arrays))[1]]

    return call


def calls(repeats: int) -> None:
    """Prints the times of calls of Python from compiled programs of JAX, for batches of several sizes."""
    import jax
    import jax.numpy as jnp
    from jax.extend.core import Primitive
    from jax.interpreters import mlir

    jax.config.update("jax_enable_x64", True)
    added = Primitive("added")
    added.def_abstract_eval(lambda a, b, c: jax.core.ShapedArray(a.shape, a.dtype))

    def host(a: Any, b: Any, c: Any) -> Any:
        return np.asarray(a) + np.asarray(b) + np.asarray(c)

    def lowered(context: Any, *arrays: Any) -> Any:
        shapes = context.avals_in, context.avals_out
        return mlir.emit_python_callback(context, lambda *x: (host(*x),), None, arrays, *shapes, has_side_effect=False)[
            0
        ]

    mlir.register_lowering(added, lowered)
    programs = {
        "XLA": lambda a, b, c: a + b + c,
        "callback": lambda a, b, c: added.bind(a, b, c),
        "pure_callback": lambda a, b, c: jax.pure_callback(host, jax.ShapeDtypeStruct(a.shape, a.dtype), a, b, c),
    }
    print(f"| µs per call | {' | '.join(programs)} |")
    print("| --- " * (1 + len(programs)) + "|")
    for shape in ((1, 7), (64, 7), (1024, 7), (1024, 32)):
        x = [jnp.asarray(np.random.default_rng(k).standard_normal(shape)) for k in range(3)]
        row = []
        for program in programs.values():
            run = jax.jit(program)
            assert np.allclose(run(*x), sum(map(np.asarray, x)))
            row.append(f"{1e6 * fastest(lambda run=run, x=x: jax.block_until_ready(run(*x)), 10 * repeats):.1f}")
        print(f"| 3 arrays {shape} | {' | '.join(row)} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--states", type=int, default=1024)
    parser.add_argument("--calls", action="store_true", help="only the time of a call from JAX")
    parser.add_argument("--check", action="store_true", help="few states and runs")
    arguments = parser.parse_args()
    states, repeats = (16, 1) if arguments.check else (arguments.states, REPEATS)
    if arguments.calls:
        calls(repeats)
        return
    frameworks = {"PyTorch": ("torch", in_torch), "JAX": ("jax", in_jax)}
    present = {name: make for name, (package, make) in frameworks.items() if importlib.util.find_spec(package)}
    print(f"| {states} states, ∂aba, µs per state | Batch | {' | '.join(present)} |")
    print("| --- " * (2 + len(present)) + "|")
    for name, model in robots().items():
        rng = np.random.default_rng(0)
        q = np.stack([condyle.random_configuration(model, seed=k) for k in range(states)])
        x = [q, *rng.standard_normal((2, states, model.nv))]
        call, (weights, expected) = batch(model, *x)
        alone = fastest(call, repeats)
        row = [f"{1e6 * alone / states:.2f}"]
        for make in present.values():
            gradient = make(model, x, weights)
            for found, correct in zip(gradient()[1:], expected, strict=True):
                assert np.allclose(found, correct, rtol=1e-7, atol=1e-7 * np.abs(correct).max())
            taken = fastest(gradient, repeats)
            row.append(f"{1e6 * taken / states:.2f} ({taken / alone:.2f})")
        print(f"| {name} | {' | '.join(row)} |")


if __name__ == "__main__":
    main()
