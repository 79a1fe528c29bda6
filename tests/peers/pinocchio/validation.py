"""Writes the tables of VALIDATION.md: all differences from Pinocchio that one test run recorded."""

import platform
import re
import subprocess

import checks
import comparison
import numpy as np
import pinocchio as pin
import test_mimic
import test_robots

import condyle

COMMAND = ".venv/pinocchio/bin/pytest tests/peers/pinocchio --validation VALIDATION.md"

HEAD = """# How far from Pinocchio

Every function that both libraries have, called with the same numbers. This file is written by

```
{command}
```

with condyle {ours}, Pinocchio {theirs}, NumPy {numpy} and Python {python}; `./test` makes the environment, installs
condyle into it and runs the same comparisons. Another program writes the last section, on public robots. Nothing here
is edited by hand.

The relative difference is max |ours − theirs| / (1 + max |theirs|), over all entries of a result. It must stay below
the bound, {tolerance:.0e}; what contains M⁻¹ may instead be {factor:.0f} times as far from Pinocchio as Pinocchio's
own forward dynamics in the world's frame is from that in the bodies' frames, where that is more. The states are
random: positions within their limits, the rest standard normal. The robots are those of example-robot-data, and
random ones: of URDFs (`robot 0`, …, `mimic robot 0`, …: every kind of joint and of root joint, odd axes, names and
orders), of MJCFs (`mjcf robot 0`, …), and made with both libraries' own calls (`built robot 0`, …: all kinds of joints,
helical, universal, spherical ZYX and composite ones too).

Where the libraries mean different things, the comparison says so in `tests/peers/pinocchio/checks.py`. In short:
Pinocchio's kinetic energy leaves armature out for revolute joints about axes that are not aligned, so energies are
compared without armature; its `dIntegrateTransport` multiplies with ∂(q ⊕ v)/∂q, our `transport` with the inverse, so
ours is compared as what undoes it; its `dJ` in LOCAL_WORLD_ALIGNED belongs, like ours, to the classical acceleration.
Its derivatives with respect to q of loops of points, and of rigid constraints along the world's axes, are not always
those of its own results, so ours are held against differences of these there (`test_constrained.py`);
those of impacts are of v⁺ − v. Along the world's axes its ∂a/∂q of bodies contradicts differences of its own
accelerations in the columns of joints with several degrees of freedom that sit on a moving body: these columns are left
out; in LOCAL_WORLD_ALIGNED its derivatives are of the motion, ours of the six numbers, whose origin moves. Its
`buildReducedModel` refuses robots in which a joint to be locked has the name of a link, so fewer robots are locked.
Rows that begin with `mimic` are of robots whose joints follow others: Pinocchio computes the same robot with free
joints, and the result is projected (`test_mimic.py`), as few of its functions know such joints.

Its universal, spherical ZYX and composite joints are one joint each, ours are chains of joints with bodies without mass
between them; q and v are laid out alike. Pinocchio takes the axes of these joints for
fixed in the body, so its rates and derivatives differ from its own rnea (`test_joints.py` compares both with
differences). Such robots are compared twice: in all quantities with chains of joints in Pinocchio, too, and in all
quantities except rates and derivatives with Pinocchio's own joints.

`DivideConquer` cuts a robot into pieces that may be worse conditioned than the whole, and has {cuts:.0f} times the room
where Pinocchio's distance from itself counts.

## Differences

For each quantity, the table shows the state that comes nearest to the bound.

| Quantity | Bound | Relative difference | Robot | Robots |
| --- | ---: | ---: | --- | ---: |
"""


DERIVATIVES = """## Derivatives by hand

All derivatives are exact: by hand, generic over the scalar, and once more by dual numbers, which run through the
algorithms themselves. The two, and central differences, over the embedded robots and random trees of every kind of
joint, with mimic joints, armature and external forces (`crates/dynamics/tests/suite`); the error is relative to
1 + the largest entry.

| Derivative | Against | Allowed | Largest error |
| --- | --- | ---: | ---: |"""


PUBLIC = re.compile(r"<!-- public robots -->.*<!-- end of public robots -->\n", re.DOTALL)
"""Pattern of the section of VALIDATION.md that `tests/peers/robots.py --table` writes."""


def kept(text: str) -> str:
    """Returns the section on public robots from the existing file, with an empty line before it. Another program writes
    this section."""
    section = PUBLIC.search(text)
    return "\n" + section.group() if section else ""


def report() -> str:
    """Returns the text of VALIDATION.md without the section on public robots."""
    head = HEAD.format(
        command=COMMAND,
        ours=condyle.__version__,
        theirs=pin.__version__,
        numpy=np.__version__,
        python=platform.python_version(),
        tolerance=comparison.TOLERANCE,
        factor=comparison.SELF_DISTANCE,
        cuts=checks.CUTS,
    )
    rows = [
        f"| {what} | {r.bound:.1e} | {r.difference:.1e} | {r.where} | {len(r.robots)} |"
        for what, r in sorted(comparison.records.items())
    ]
    return head + "\n".join([*rows, "", *derivatives(), "", *robots(), ""])


def derivatives() -> list[str]:
    """Runs the Rust tests of hand-written derivatives and returns their errors as rows of a table."""
    modules = ("derivatives", "second_order", "inputs", "motion_derivatives", "constrained_derivatives")
    command = ("cargo", "test", "--locked", "--package", "condyle-dynamics", "--test", "suite", "--", "--nocapture")
    output = subprocess.run((*command, *modules), check=True, stdout=subprocess.PIPE, text=True).stdout
    rows = set()
    # If tests run on one thread, the test's name and its first line of output are in the same line.
    line = re.compile(r"^(?:test \S+ \.\.\. )?(.*[∂∇].*): (\S+) \(allowed (\S+)\)$", re.MULTILINE)
    for name, error, allowed in line.findall(output):
        way = "central differences" if float(allowed) >= 1e-6 else "the contraction" if "Σ" in name else "dual numbers"
        rows.add(f"| {name} | {way} | {allowed} | {error} |")
    return [DERIVATIVES, *sorted(rows)]


def robots() -> list[str]:
    """Returns the table of all robots of example-robot-data, with remarks."""
    lines = [
        "## Robots",
        "",
        "| Robot | Root joint | Moving bodies | nq | nv | |",
        "| --- | --- | ---: | ---: | ---: | --- |",
    ]
    for name in test_robots.ROBOTS:
        if name in comparison.sizes:
            root, bodies, nq, nv = comparison.sizes[name]
            lines.append(f"| {name} | {root} | {bodies} | {nq} | {nv} | {'; '.join(remarks(name))} |")
    random = [name for name in comparison.sizes if name not in test_robots.ROBOTS]
    read = len(comparison.sizes) - len(random)
    return [*lines, "", f"To these {read} come {len(random)} random ones, of {degrees(random)} degrees of freedom."]


def degrees(names: list[str]) -> str:
    """Returns the smallest and the largest number of degrees of freedom of the given robots."""
    nvs = [comparison.sizes[name][3] for name in names] or [0]
    return f"{min(nvs)} to {max(nvs)}"


def remarks(name: str) -> list[str]:
    """Returns remarks on the special properties of a robot."""
    found = []
    if name in test_robots.NO_URDF:
        found.append("an SDF with closed loops: its spanning tree, put together in Pinocchio")
    if name in test_robots.SINGULAR:
        found.append("M has no inverse (bodies without mass): forward dynamics only with armature")
    if name in test_mimic.BROKEN:
        found.append("with mimic joints refused by both: one follows a joint that is not there")
    elif name in test_mimic.REFUSED:
        found.append("with mimic joints refused by Pinocchio, so compared by projection")
    elif name in test_mimic.ROBOTS:
        found.append("with mimic joints too")
    return found
