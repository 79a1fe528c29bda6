#!/usr/bin/env python3
"""Times generated C. Compares it with Pinocchio compiled for the same processor, and with Condyle's library for the
type f64.

    python benches/generated.py [--json] [--rounds N] [--cpu K] [ROBOT ...]

Generated code is compiled by CC, else by clang, else by gcc, and called with 64 states in turn. Pinocchio is called in
the same way; benches/peers/dynamics.py builds it (about ten minutes the first time). CppADCodeGen generates code from
Pinocchio's recursions (benches/peers/cppadcg.cpp, about ten minutes more). This code is compiled by the same compiler
with the same options. One program calls Condyle's and Pinocchio's generated code in turn. The ratio is the median over
the rounds. A time is the shortest of all rounds, because other work on the machine only adds time. `cargo bench -p
condyle-codegen --bench generated` times Condyle's library in three variants: limbs one after the other, limbs in
parallel lanes, and batches. Batches are compared with generated code for vectors of eight states. --json prints one
record per line instead of tables, without the times of the library. The program needs Linux, Rust, compilers of C and
C++, and the package condyle.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import condyle

sys.path.insert(0, str(Path(__file__).with_name("peers")))
import dynamics

FUNCTIONS = ["rnea", "aba", "crba", "minv", "rnea_derivatives", "aba_derivatives"]
FLAGS = ["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno"]
ROUND_NS = 2e7
"""Duration of a round (ns)."""
RUNS = 3
"""Number of times that Pinocchio is timed."""
TIMER = """
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return 1e9 * t.tv_sec + t.tv_nsec; }
static double in[STATES][SIZE], out[OUT];
CODE
/* CppADCodeGen's: q, v and a or tau behind each other, all results behind each other */
struct atomics { void *model, *forward, *reverse; };
typedef void recorded(const double *const *in, double *const *out, struct atomics);
static double packed[STATES][SIZE], results[OUT];
static recorded *theirs;
static void call_theirs(const double *x) {
    double *y = results;
    theirs(&x, &y, (struct atomics){0, 0, 0});
}
static double round_of(void (*f)(const double *), double x[][SIZE], long calls) {
    double t = now();
    for (long k = 0; k < calls; k++) f(x[k % STATES]);
    return (now() - t) / calls;
}
int main(int count, char **arguments) {
    FILE *file = fopen(arguments[1], "rb");
    if (fread(in, sizeof in, 1, file) != 1) return 1;
    int rounds = atoi(arguments[2]);
    for (int k = 0; k < STATES; k++) {
        memcpy(packed[k], in[k], THIRD * sizeof(double));
        memcpy(packed[k] + NQ + NV, in[k] + THIRD, NV * sizeof(double));
    }
    if (count > 4) {
        void *library = dlopen(arguments[3], RTLD_NOW);
        theirs = library ? (recorded *)dlsym(library, arguments[4]) : 0;
        if (!theirs) return 2;
    }
    long calls = STATES;
    while (round_of(call, in, calls) * calls < TIME) calls *= 2;
    for (int r = 0; r < rounds; r++) {
        double ours = round_of(call, in, calls);
        printf("%f %f\\n", ours, theirs ? round_of(call_theirs, packed, calls) : 0);
    }
    return 0;
}
"""


def compiler() -> str:
    return os.environ.get("CC") or next(c for c in ("clang", "gcc", "cc") if shutil.which(c))


def measured(
    model: condyle.Model, function: str, states: Path, rounds: int, cpu: int, theirs: Path
) -> "dict[str, float | None]":
    """Measures a function as generated C: time of a call (ns), operations, size of the program (KB), and time of the
    compiler (s). Also measures CppADCodeGen's time (ns) and the ratio, if CppADCodeGen has this function.
    """
    stem, files, [(_, inputs, outputs, operations, _)] = condyle._condyle._generate(model, [function], "c")
    width = model.nq + 3 * model.nv
    starts = {"q": 0, "v": model.nq, "a": model.nq + model.nv, "tau": model.nq + 2 * model.nv}
    arguments, size = [f"x + {starts[name]}" for name, _, _ in inputs], 0
    for _, rows, columns in outputs:
        arguments.append(f"out + {size}")
        size += rows * columns
    call = f"{stem}_{function}({', '.join(arguments)});"
    text = TIMER.replace("CODE", f'#include "{stem}.c"\nstatic void call(const double *x) {{ {call} }}')
    third = starts["tau" if any(name == "tau" for name, _, _ in inputs) else "a"]
    sizes = {"STATES": dynamics.STATES, "SIZE": width, "OUT": 4 * model.nv**2, "NQ": model.nq, "NV": model.nv}
    for word, value in {**sizes, "THIRD": third, "TIME": ROUND_NS}.items():
        text = text.replace(word, str(value))
    with TemporaryDirectory() as folder:
        for file, code in [*files, ("timer.c", text)]:
            (Path(folder) / file).write_text(code, encoding="utf-8")
        start = time.perf_counter()
        subprocess.run([compiler(), *FLAGS, "timer.c", "-o", "timer", "-lm", "-ldl"], cwd=folder, check=True)
        took = time.perf_counter() - start
        call_timer = ["taskset", "-c", str(cpu), "./timer", str(states), str(rounds)]
        library = theirs / f"{function}.so"
        if library.exists():
            call_timer += [str(library), f"{function}_forward_zero"]
        told = subprocess.run(call_timer, cwd=folder, check=True, capture_output=True, text=True).stdout
        kb = (Path(folder) / "timer").stat().st_size / 1024
    times = [[float(x) for x in line.split()] for line in told.splitlines()]
    numbers = {"ns": min(ours for ours, _ in times), "operations": operations, "kb": kb, "compile_s": took}
    if not library.exists():
        return numbers | {"theirs": None, "ratio": None}
    ratio = statistics.median(ours / other for ours, other in times)
    return numbers | {"theirs": min(other for _, other in times), "ratio": ratio}


def record_theirs(program: Path, model: Path, states: Path) -> Path:
    """Returns the folder with Pinocchio's generated code for a model. The folder contains a library for each
    function."""
    folder = dynamics.PEERS / f"cppadcg-{model.stem}-{Path(compiler()).name}"
    if not (folder / "aba_derivatives.so").exists():
        folder.mkdir(exist_ok=True)
        dynamics.run(program, model, states, folder, shutil.which(compiler()), *FLAGS, "-fPIC")
    return folder


def beside(ours: "dict[str, float | None]") -> str:
    return "– | –" if ours["theirs"] is None else f"{ours['theirs']:.0f} | {ours['ratio']:.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("robots", nargs="*", default=["panda", "anymal", "talos"], metavar="ROBOT")
    parser.add_argument("--json", action="store_true", help="print a record a line")
    parser.add_argument("--rounds", type=int, default=11)
    parser.add_argument("--cpu", type=int, default=0)
    options = parser.parse_args()
    dynamics.PEERS.mkdir(parents=True, exist_ok=True)
    python = dynamics.environment("venv", "pin==4.1.0", "example-robot-data-loaders==5.0.0")
    theirs = dynamics.build_pinocchio(python)
    cppadcg = dynamics.build_pinocchio(python, "cppadcg", "-O1", "cmeel-cppad==20250000.2", "cmeel-cppadcodegen==2.4.3")
    if not options.json:
        print(f"{compiler()} {' '.join(FLAGS)}, {options.rounds} rounds\n")
        columns = "robot,function,operations,ours ns,Pinocchio ns,ratio,CppADCodeGen ns,ratio,KB,compiled s"
        print(f"| {columns.replace(',', ' | ')} |")
        print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    files = []
    for robot in options.robots:
        source, locked = dynamics.ROBOTS[robot]
        paths = [dynamics.PEERS / f"{robot}.{suffix}" for suffix in ("bin", "urdf", "states")]
        exported = [python, "-c", dynamics.EXPORT, str(source), "0", ",".join(locked), str(dynamics.STATES), *paths]
        path, root = dynamics.run(*exported).splitlines()
        model = condyle.Model.from_urdf(path, root_joint=None if root == "fixed" else root)
        if locked:
            model = model.lock(locked, condyle.neutral(model))
        runs = [dynamics.run("taskset", "-c", str(options.cpu), theirs, paths[0], paths[2]) for _ in range(RUNS)]
        runs = [dynamics.times(told) for told in runs]
        peer = {function: min(times[function] for times in runs) for function in FUNCTIONS}
        recorded = record_theirs(cppadcg, paths[0], paths[2])
        for function in FUNCTIONS:
            ours = measured(model, function, paths[2], options.rounds, options.cpu, recorded)
            if options.json:
                row = {"robot": robot, "function": function, **ours, "pinocchio_ns": peer[function]}
                print(json.dumps(row), flush=True)
                continue
            print(
                f"| {robot} | {function} | {ours['operations']} | {ours['ns']:.0f} | {peer[function]:.0f} | "
                f"{ours['ns'] / peer[function]:.2f} | {beside(ours)} | "
                f"{ours['kb']:.0f} | {ours['compile_s']:.1f} |",
                flush=True,
            )
        files.append(path + ("" if root == "fixed" else ":free"))
    if options.json:
        return
    environment = os.environ | {"CC": compiler(), "CFLAGS": " ".join(FLAGS)}
    command = ["cargo", "bench", "--locked", "-p", "condyle-codegen", "--bench", "generated", "--", *files]
    subprocess.run(command, cwd=dynamics.ROOT, check=True, env=environment)


if __name__ == "__main__":
    main()
