"""Reads the programs that benches/peers/wholebody.rs exports, for other solvers."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

INFINITY = 1e20
"""Bound that the solvers treat as infinite."""


@dataclass
class Program:
    """Quadratic program min ½ xᵀ P x + cᵀ x with A x = b and lower ≤ G x ≤ upper, in all layouts that the solvers
    need."""

    P: np.ndarray
    c: np.ndarray
    A: np.ndarray
    b: np.ndarray
    G: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def __post_init__(self) -> None:
        has_lower, has_upper = np.isfinite(self.lower), np.isfinite(self.upper)
        below, above = self.G[has_lower], self.G[has_upper]
        self.C = np.asfortranarray(np.vstack([below, -above]))  # C x + d ≥ 0
        self.d = np.concatenate([-self.lower[has_lower], self.upper[has_upper]])
        self.all_rows = np.ascontiguousarray(np.vstack([self.A, self.G]))
        self.all_lower = np.concatenate([self.b, np.maximum(self.lower, -INFINITY)])
        self.all_upper = np.concatenate([self.b, np.minimum(self.upper, INFINITY)])
        self.sense = np.array([5] * len(self.b) + [0] * len(self.lower), dtype=np.int32)
        self.normals = np.ascontiguousarray(np.vstack([self.A, self.C]).T)
        self.offsets = np.concatenate([self.b, -self.d])  # constraints normalsᵀ x ≥ offsets
        self.minus_b = -self.b

    def objective(self, x: np.ndarray) -> float:
        return float(0.5 * x @ self.P @ x + self.c @ x)

    def shape(self) -> tuple[int, int, int]:
        return len(self.c), len(self.b), len(self.lower)


def read(path: Path) -> list[tuple[dict[str, Program], dict[str, np.ndarray]]]:
    """Returns the programs of a recording in both forms, and Condyle's solutions of these programs."""
    numbers, at, ticks = np.fromfile(path.with_suffix(".numbers")), 0, []

    def take(*shape: int) -> np.ndarray:
        nonlocal at
        count = int(np.prod(shape))
        part = numbers[at : at + count].reshape(shape, order="F")
        at += count
        return part

    for line in path.with_suffix(".sizes").read_text(encoding="utf-8").splitlines():
        sizes = dict(zip(("full", "condensed"), json.loads(line), strict=True))
        forms = {}
        for form, (n, e, m) in sizes.items():
            forms[form] = Program(take(n, n), take(n), take(e, n), take(e), take(m, n), take(m), take(m))
        ticks.append((forms, {form: take(size[0]) for form, size in sizes.items()}))
    return ticks
