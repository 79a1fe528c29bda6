"""Tests that the import of Condyle loads NumPy, but no other module that is slow to import."""

import subprocess
import sys

# Optional dependencies, and modules that are slow to import.
LATER = {
    "casadi",
    "jax",
    "torch",
    "tqdm",
    "scipy",
    "matplotlib",
    "viser",
    "pandas",
    "ray",
    "pinocchio",
    "crocoddyl",
    "mujoco",
    "example_robot_data",
}


def test_nothing_is_imported_but_numpy() -> None:
    code = "import sys, numpy.typing; before = set(sys.modules); import condyle; print(*set(sys.modules) - before)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    imported = run.stdout.split()
    assert "condyle" in imported
    assert not {name.split(".")[0] for name in imported} & LATER
    others = {name for name in imported if name.split(".")[0] not in ("condyle", "numpy")}
    assert not others, "a module of the standard library is imported where a function needs it"
