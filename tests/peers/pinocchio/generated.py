"""Compiles the generated code of one robot in one language into a shared library, and calls its functions with
arrays."""

import ctypes
import hashlib
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import condyle
import condyle.codegen

compiler = os.environ.get("CC", "cc").split()[0]

WARNINGS = ["-Wall", "-Wextra", "-Werror"]
C = [*WARNINGS, "-O0", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC"]
"""Compiler options for a short compilation instead of fast code. The code uses the vector instructions of the
processor."""
RUST = ["--edition=2021", "--crate-type=cdylib", "-Copt-level=0", "-Cdebuginfo=0", "-Ccodegen-units=1"]


def missing(language: str) -> str | None:
    """Returns the name of the compiler that a language needs, if this compiler is not installed; otherwise None."""
    name = "rustc" if language.startswith("rust") else compiler
    return None if shutil.which(name) else name


def lanes(language: str) -> int:
    """Returns the number of states that one call of a generated function in a language computes."""
    return int(language[-1]) if language[-1] in "48" else 1


class Library:
    """Functions of a robot in one language, compiled into one shared library.

    A call computes `lanes` states. Their numbers have the type `real`. A source text is compiled only once per folder.
    """

    def __init__(
        self,
        model: condyle.Model,
        names: Sequence[str],
        language: str,
        folder: Path,
        frames: Sequence[str] = (),
        constraints: Sequence[condyle.ContactConstraint] = (),
    ) -> None:
        options = {"frames": list(frames), "constraints": list(constraints), "external_forces": False, "inputs": []}
        self.stem, files, described = condyle._condyle._generate(model, list(names), language, **options)
        self.functions = {name: (inputs, outputs) for name, inputs, outputs, *_ in described}
        self.lanes = lanes(language)
        self.real = np.dtype(np.float32 if "float" in language else np.float64)
        key = hashlib.sha256(repr((compiler, language, files)).encode()).hexdigest()[:32]
        self.path = folder / f"{key}.so"
        if not self.path.is_file():
            self._compile(language, dict(files), folder / f"{key}-{os.getpid()}")
        self._library = ctypes.CDLL(str(self.path))

    def _compile(self, language: str, files: dict[str, str], folder: Path) -> None:
        folder.mkdir()
        if language.startswith("rust"):
            files = files | {"lib.rs": self._exports()}
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        standard = ["-std=c99", "-pedantic"] if self.lanes == 1 else ["-std=gnu99"]
        sources = [file for file in files if file.endswith(".c")]
        call = (
            ["rustc", *RUST, "lib.rs", "-o", "made.so"]
            if language.startswith("rust")
            else [compiler, *standard, *C, *sources, "-o", "made.so", "-lm"]
        )
        run = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
        assert run.returncode == 0 and not run.stderr, f"{' '.join(call)}\n{run.stderr[:2000]}"
        os.replace(folder / "made.so", self.path)
        shutil.rmtree(folder)

    def _exports(self) -> str:
        """Returns Rust source code that exports the functions of a Rust module under the names of the C functions."""
        real = {4: "f32", 8: "f64"}[self.real.itemsize]
        text = f'#![deny(warnings)]\n#![allow(non_snake_case)]\n#[path = "{self.stem}.rs"]\nmod robot;\n'
        for name, (inputs, outputs) in self.functions.items():
            arrays = [f"{array}: &[{real}; {rows * columns}]" for array, rows, columns in inputs]
            arrays += [f"{array}: &mut [{real}; {rows * columns}]" for array, rows, columns in outputs]
            given = ", ".join(array for array, _, _ in (*inputs, *outputs))
            head = f'#[no_mangle]\npub extern "C" fn {self.stem}_{name}({", ".join(arrays)})'
            text += f"{head} {{\n    robot::{name}({given})\n}}\n"
        return text

    def __call__(self, name: str, states: Sequence[Sequence[np.ndarray]]) -> list[list[np.ndarray]]:
        """Calls a function and returns its results. The number of states in the arguments must be `lanes`."""
        inputs, outputs = self.functions[name]
        assert len(states) == self.lanes and all(len(state) == len(inputs) for state in states)
        # Number k of state i is at index lanes * k + i.
        given = [np.ascontiguousarray(np.stack(of, axis=-1), self.real) for of in zip(*states, strict=True)]
        assert [array.size for array in given] == [self.lanes * rows * columns for _, rows, columns in inputs]
        found = [np.full((rows * columns, self.lanes), np.nan, self.real) for _, rows, columns in outputs]
        function = getattr(self._library, f"{self.stem}_{name}")
        function.restype = None
        function(*(ctypes.c_void_p(array.ctypes.data) for array in (*given, *found)))
        shapes = [(rows,) if columns == 1 else (rows, columns) for _, rows, columns in outputs]
        together = list(zip(found, shapes, strict=True))
        return [
            [array[:, i].astype(float).reshape(shape, order="F") for array, shape in together]
            for i in range(self.lanes)
        ]
