#!/usr/bin/env python3
"""Prints tables of whole-body control of robots in MuJoCo: motions under disturbances, and the largest pushes that a
robot survives.

    .venv/pinocchio/bin/python tests/peers/mujoco/closed_loop.py [disturbances] [pushes] [--write]

Without the name of a table the program computes both tables, which takes several minutes on all cores with a release
build. With --write it replaces the tables in docs/wholebody.md.
"""

import re
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scenes import FEET, PUSH_TIME, Disturbance, Humanoid, Quadruped, Record, anymal, urdf

from condyle.wholebody import Pyramid

DOCUMENT = Path(__file__).parents[3] / "docs" / "wholebody.md"

DISTURBANCES = {
    "as the model": Disturbance(),
    "1 % noise on v": Disturbance(noise=0.01),
    "one tick late": Disturbance(delay=1),
    "μ taken for 20 % more": Disturbance(friction=1.2),
    "μ taken for 20 % less": Disturbance(friction=0.8),
    "these three: 1 %, late, more": Disturbance(0.01, 1, 1.2),
    "10 %, five ticks late, more": Disturbance(0.1, 5, 1.2),
}
DIRECTIONS = range(0, 360, 30)
"""Directions in which TALOS is pushed (degrees): 0 is ahead, 90 is to the left."""
STIFFNESS = 20.0
"""Stiffness of the PD control that holds the posture, as a multiple of a joint's maximum effort, per rad."""
PUSH = 20.0
"""Size of the push in the table of disturbances (N s)."""
LAWS = {"cones": {}, "pyramids of 4 sides": {"cone": Pyramid(4, True)}, "PD hold": {"stiffness": STIFFNESS}}
"""Names and settings of the compared controllers."""
FIRST, STRIDE, STEP = 40.0, 8.0, 2.0
"""Parameters of the search for the largest push (N s): the first push, the first increment, and the accuracy of the
result."""


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Returns a table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def deviation(record: Record) -> float:
    """Returns the largest horizontal distance of the centre of mass from its reference (mm)."""
    return 1e3 * float(np.linalg.norm((record.com - record.wanted)[:, :2], axis=1).max())


def cell(record: Record, unsolved: int) -> str:
    """Returns the text of a table cell for a run: the deviation, or when the robot falls."""
    if not record.stands:
        return f"falls after {record.t[-1]:.1f} s"
    failed = f", {unsolved} ticks unsolved" if unsolved else ""
    return f"{deviation(record):.1f} mm{failed}"


def humanoid_cases() -> dict[str, Callable[[Humanoid], Record]]:
    """Returns the motions of TALOS by name; each motion is a function that simulates it."""
    return {
        "stands, 5 s": lambda h: h.run(h.control(), 5.0),
        "shifts its weight by ± 6 cm, 8 s": lambda h: h.run(h.control(h.shift), 8.0),
        "lifts a foot by 10 cm, 7 s": lambda h: h.run(h.control(h.lift), 7.0),
        f"is pushed forwards, {PUSH:.0f} N s": lambda h: h.run(h.control(), 4.0, (PUSH, 0.0, 0.0)),
    }


def disturbances() -> str:
    """Returns the table of motions under disturbances."""
    rows = []
    for name, case in humanoid_cases().items():
        cells = []
        for disturbance in DISTURBANCES.values():
            humanoid = Humanoid(disturbance)
            cells.append(cell(case(humanoid), humanoid.unsolved))
        rows.append([f"TALOS {name}", *cells])
    cells = []
    for disturbance in DISTURBANCES.values():
        quadruped = Quadruped(urdf("anymal"), FEET, anymal(), disturbance)
        cells.append(cell(quadruped.run(20.0), quadruped.unsolved))
    rows.append(["ANYmal trots, 20 s", *cells])
    return table(["", *DISTURBANCES], rows)


def largest(survives: Callable[[float], bool]) -> float:
    """Searches for the largest push (N s) that the robot survives. All weaker pushes that were tested are survived,
    too."""
    low = high = FIRST
    if survives(FIRST):
        while survives(high := low + STRIDE):
            low = high
    else:
        while not survives(low := high - STRIDE):
            high = low
    while high - low > STEP:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if survives(middle) else (low, middle)
    return low


def pushed(direction: float, law: str) -> float:
    """Returns the largest push in a direction (degrees) after which TALOS still stands 3.5 s later."""
    angle, settings = np.radians(direction), LAWS[law]
    unit = np.array([np.cos(angle), np.sin(angle), 0.0])

    def survives(push: float) -> bool:
        if push <= 0.0:
            return True
        humanoid = Humanoid(cone=settings.get("cone", "cone"))
        stiffness = settings.get("stiffness")
        control = humanoid.control() if stiffness is None else humanoid.hold(stiffness)
        return humanoid.run(control, 4.0, push * unit).stands

    return largest(survives)


def pushes() -> str:
    """Returns the table of the largest pushes in all directions."""
    cases = list(product(DIRECTIONS, LAWS))
    with ProcessPoolExecutor() as pool:
        found = dict(zip(cases, pool.map(pushed, *zip(*cases, strict=True)), strict=True))
    rows = [[f"{direction}°", *(f"{found[direction, law]:.0f}" for law in LAWS)] for direction in DIRECTIONS]
    return table([f"N s in {PUSH_TIME} s", *LAWS], rows)


def main() -> None:
    """Prints the requested tables, and writes them into the page if requested."""
    text = DOCUMENT.read_text(encoding="utf-8") if DOCUMENT.exists() else ""
    tables = {"disturbances": disturbances, "pushes": pushes}
    chosen = [name for name in sys.argv[1:] if name in tables] or list(tables)
    for name in chosen:
        made = tables[name]()
        print(made, flush=True)
        pattern = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        text = re.sub(pattern, lambda m, made=made: f"{m[1]}{made}\n{m[2]}", text, flags=re.S)
    if "--write" in sys.argv:
        DOCUMENT.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
