"""Generates straight-line code for a robot's functions: as text, or compiled by the system's C compiler and called with
arrays.

>>> import condyle, condyle.codegen
>>> arm = condyle.robots.arm7()
>>> aba = condyle.codegen.compile(arm, "aba")
>>> a = aba([0.3] * 7, [0.1] * 7, [1.0] * 7)
>>> bool(np.abs(a - condyle.aba(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7, [1.0] * 7)).max() < 1e-9)
True

The library's algorithms run once on symbolic numbers, which record the operations that compute them. Constants of the
robot are folded, zeros are dropped, and each value is computed once. The generated code has no loops and no branches.
The code is valid for a single robot; a changed copy of the model needs new code.

`functions` lists the available names. Arguments and results are the same as for the functions of `condyle` with these
names. There are two additional functions. 'frames' takes q and v and returns for each frame the rotation, the
translation, the velocity of the origin along the axes of the world, the Jacobian J and its rate dJ. 'centroidal'
returns com, com_velocity, hg, Jcom, Ag and dAg. External forces, if requested, have the shape (nbodies − 1, 6), without
a row for the world.
"""

from collections import namedtuple
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _condyle
from ._condyle import Model
from ._types import ContactConstraint

if TYPE_CHECKING:
    import os

__all__ = ["Compiled", "compile", "functions", "source"]

functions: tuple[str, ...] = (
    "rnea",
    "aba",
    "crba",
    "minv",
    "gravity",
    "nonlinear_effects",
    "rnea_derivatives",
    "aba_derivatives",
    "rnea_hessian",
    "aba_hessian",
    "frames",
    "centroidal",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
)
"""The names of the functions that can be generated."""

FLAGS = ("-O2", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")


def source(
    model: Model,
    names: str | Sequence[str],
    language: str = "c",
    *,
    frames: Sequence[str] = (),
    constraints: Sequence[ContactConstraint] = (),
    external_forces: bool = False,
    inputs: Sequence[str] = (),
    partitions: int | None = None,
) -> dict[str, str]:
    """Generates the code of functions of a robot: a dictionary from file names to texts.

    language: 'c' or 'c-float'; 'c-4', 'c-8', 'c-float-4' or 'c-float-8' for vectors of 4 or 8 states; 'c-casadi' for
        CasADi's `external`; 'rust' or 'rust-float'; 'cuda' or 'cuda-float'. frames: the frames of the function
        'frames';
        constraints: the constraints of 'constrained_dynamics' and 'impulse_dynamics', and of their derivatives;
        external_forces: whether dynamics takes external forces; inputs: which of 'inertia', 'armature' and 'gravity'
        are arguments instead of constants. partitions: the number of threads per state in CUDA, as for
        `condyle.cuda.compile`. Names of C and CUDA functions begin with the name of their files: the robot's name, then
        '_float', '_x4' or '_x8' if the name of the language contains 'float', '4' or '8'.

    >>> arm = condyle.robots.arm7()
    >>> list(condyle.codegen.source(arm, "rnea")), list(condyle.codegen.source(arm, "rnea", "rust"))
    (['arm7.h', 'arm7.c'], ['arm7.rs'])
    >>> list(condyle.codegen.source(arm, "rnea", "c-float-8"))
    ['arm7_float_x8.h', 'arm7_float_x8.c']
    """
    given = [names] if isinstance(names, str) else list(names)
    _, files, _ = _condyle._generate(
        model,
        given,
        language,
        frames=list(frames),
        constraints=list(constraints),
        external_forces=external_forces,
        inputs=list(inputs),
        partitions=partitions,
    )
    return dict(files)


class Compiled:
    """A compiled function of a robot. `inputs` and `outputs` are the names and shapes of the arguments and results.

    The function may be called from several threads at a time.
    """

    def __init__(self, name: str, function: Any, inputs: list[Any], outputs: list[Any], library: Path) -> None:
        self.name: str = name
        self.inputs: dict[str, int] = {name: rows * columns for name, rows, columns in inputs}
        self.outputs: dict[str, tuple[int, ...]] = {
            name: (rows,) if columns == 1 else (rows, columns) for name, rows, columns in outputs
        }
        self.library: Path = library
        """The path of the compiled shared library."""
        self._function = function
        fields = [f"{output}_" if output == "lambda" else output for output in self.outputs]
        self._result: Any = namedtuple(name, fields) if len(outputs) > 1 else None

    def __repr__(self) -> str:
        return f"{self.name}({', '.join(self.inputs)}) -> {', '.join(self.outputs)}"

    def __call__(self, *arguments: ArrayLike) -> Any:
        """Computes the results for one state, or for many states if the arguments have an additional first axis.

        Returns an array, or a named tuple if there are several results.
        """
        if len(arguments) != len(self.inputs):
            raise TypeError(f"{self!r}: expected {len(self.inputs)} arguments, found {len(arguments)}")
        arrays: list[NDArray[np.float64]] = []
        many: int | None = None
        for (name, size), given in zip(self.inputs.items(), arguments, strict=True):
            array = np.ascontiguousarray(given, dtype=np.float64)
            if name in ("f_ext", "inertia") and array.ndim >= 2 and array.shape[-1] in (6, 10):
                array = array.reshape(*array.shape[:-2], -1)
            if array.ndim not in (1, 2) or array.shape[-1] != size:
                raise ValueError(f"{name}: expected ({size},) or (n, {size}), found {array.shape}")
            if array.ndim == 2:
                if many not in (None, len(array)):
                    raise ValueError(f"{name}: expected {many} states, found {len(array)}")
                many = len(array)
            arrays.append(array)
        count = 1 if many is None else many
        arrays = [a if a.ndim == 2 or many is None else np.tile(a, (count, 1)) for a in arrays]
        results = [np.empty((count, *reversed(shape))) for shape in self.outputs.values()]
        self._function(count, *(a.ctypes.data for a in (*arrays, *results)))
        turned = [r.swapaxes(1, 2) if r.ndim == 3 else r for r in results]
        given_back = turned if many is not None else [r[0] for r in turned]
        return given_back[0] if self._result is None else self._result(*given_back)


def compile(  # noqa: A001
    model: Model,
    name: str,
    *,
    frames: Sequence[str] = (),
    constraints: Sequence[ContactConstraint] = (),
    external_forces: bool = False,
    inputs: Sequence[str] = (),
    compiler: str | None = None,
    cache: "str | os.PathLike[str] | None" = None,
) -> Compiled:
    """Compiles a function of a robot with the system's C compiler, or loads the compiled function from the cache if it
    was compiled before.

    name: one of `functions`; frames, constraints, external_forces, inputs: as for `source`. compiler: a command that
        understands the options of GCC and Clang; by default the environment variable CC, else `cc`. cache: a folder; by
        default the environment variable CONDYLE_CACHE, else `~/.cache/condyle`. A cached function is used only for the
        same robot, options, version of condyle, compiler and processor.

    Raises `RuntimeError` if the compiler is missing or fails, and `ModelError` if a frame does not exist or the
    function needs the inverse of a singular inertia matrix.

    >>> quadruped = condyle.robots.quadruped()
    >>> feet = condyle.codegen.compile(quadruped, "frames", frames=["LF_foot"])
    >>> feet(np.zeros((5, 19)) + condyle.neutral(quadruped), np.zeros((5, 18))).LF_foot_J.shape
    (5, 6, 18)
    """
    import ctypes
    import hashlib
    import os

    command = compiler or os.environ.get("CC") or "cc"
    options = (list(frames), [repr(c) for c in constraints], external_forces, sorted(inputs))
    robot = model.__reduce__()[1]
    key = hashlib.sha256(
        repr((_condyle.__version__, robot, name, options, command, FLAGS, _processor())).encode()
    ).hexdigest()[:32]
    root = Path(cache or os.environ.get("CONDYLE_CACHE") or Path.home() / ".cache" / "condyle")
    library, about = root / f"{key}.so", root / f"{key}.json"
    if not (library.is_file() and about.is_file()):
        code, files, described = _condyle._generate(
            model,
            [name],
            "c",
            frames=list(frames),
            constraints=list(constraints),
            external_forces=external_forces,
            inputs=list(inputs),
        )
        _build(command, code, files, described[0], library, about)
    import json

    told = json.loads(about.read_text(encoding="utf-8"))
    function = ctypes.CDLL(str(library)).condyle_many
    function.restype = None
    function.argtypes = [ctypes.c_long] + [ctypes.c_void_p] * (len(told["inputs"]) + len(told["outputs"]))
    return Compiled(name, function, told["inputs"], told["outputs"], library)


def _processor() -> str:
    """Returns a text that identifies the processor, as far as the compiler's instructions depend on it."""
    import platform

    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            lines = [line for line in file if line.startswith(("flags", "Features"))]
    except OSError:
        lines = []
    return platform.machine() + platform.processor() + "".join(lines[:1])


def _build(
    command: str,
    code: str,
    files: list[tuple[str, str]],
    described: tuple[str, list[tuple[str, int, int]], list[tuple[str, int, int]], int, int],
    library: Path,
    about: Path,
) -> None:
    """Compiles the files, and a function that loops over many states, and writes the library to the cache."""
    import json
    import os
    import shlex
    import subprocess
    import tempfile

    name, inputs, outputs, *_ = described
    parameters = [f"const double *{array}" for array, _, _ in inputs] + [f"double *{array}" for array, _, _ in outputs]
    each = [f"{array} + i * {rows * columns}" for array, rows, columns in (*inputs, *outputs)]
    loop = f"for (long i = 0; i < n; i++) {code}_{name}({', '.join(each)});"
    many = f'#include "{code}.c"\nvoid condyle_many(long n, {", ".join(parameters)}) {{\n    {loop}\n}}\n'
    library.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        for file, text in (*files, ("many.c", many)):
            (Path(folder) / file).write_text(text, encoding="utf-8")
        made = Path(folder) / "made.so"
        call = [*shlex.split(command), *FLAGS, "many.c", "-o", str(made), "-lm"]
        try:
            run = subprocess.run(call, cwd=folder, capture_output=True, text=True, check=False)
        except OSError as error:
            raise RuntimeError(
                f"compiler: `{command}` cannot be run ({error.strerror}): install a C compiler, or name one by CC"
            ) from None
        if run.returncode != 0:
            raise RuntimeError(f"compiler: `{' '.join(call)}` failed:\n{run.stderr}")
        told = Path(folder) / "about.json"
        told.write_text(json.dumps({"inputs": inputs, "outputs": outputs}), encoding="utf-8")
        os.replace(told, about)
        os.replace(made, library)  # the library is moved last: if the library exists, the other file exists, too
