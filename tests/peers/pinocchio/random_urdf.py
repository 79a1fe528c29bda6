"""Generates URDFs of random robots with every kind of joint, unusual axes and names, links without inertia, and fixed
joints between moving joints."""

import numpy as np

AXES = ("1 0 0", "0 1 0", "0 0 1", "0 0 -1", "-1 0 0", "0 0 2", "1e-9 0 1", "0 3 4")
"""Axes of joints: along x, y or z, negative, not normalised, and almost along x, y or z. The robots also have random
axes, and joints without an axis."""
NAMES = ("J3", "_0", "j1", "j10", "j2", "J", "hip.left", "hip-left", "Über", "a b")
"""Names of joints. If the names are sorted by bytes, the order is neither alphabetical nor numerical."""
KINDS = ("revolute", "continuous", "prismatic", "planar", "floating", "fixed")

ONE = ("revolute", "continuous", "prismatic")
"""Kinds of joints with one degree of freedom; such a joint may mimic another joint."""


class RandomUrdf:
    """Random robot with several links. With `mimics`, some joints mimic other joints."""

    def __init__(self, seed: int, links: int = 12, mimics: bool = False) -> None:
        self.rng = np.random.default_rng(seed)
        parents = [int(self.rng.integers(0, i)) for i in range(1, links)]
        suffixes = self.rng.permutation(links)
        names = [f"{self.rng.choice(NAMES)}{suffixes[i]}" for i in range(1, links)]
        kinds = [str(self.rng.choice(KINDS)) for _ in names]
        lines = [f'<robot name="random{seed}">']
        # A moving body has mass; without mass, M might have no inverse.
        lines += [self._link(i, moves=i == 0 or kinds[i - 1] != "fixed") for i in range(links)]
        self.kinds = dict(zip(names, kinds, strict=True))
        leaders: list[str] = []
        for i, (name, kind, parent) in enumerate(zip(names, kinds, parents, strict=True), start=1):
            follows = self._leader(kind, leaders) if mimics else None
            lines.append(self._joint(name, kind, parent, i, follows))
            if kind in ONE and not follows:
                leaders.append(name)
        order = self.rng.permutation(len(lines) - 1) + 1
        self.text = "\n".join([lines[0], *(lines[i] for i in order), "</robot>\n"])

    def _leader(self, kind: str, leaders: list[str]) -> str | None:
        """Returns the name of the joint that a joint mimics, or None if it mimics no joint. Only a rotating joint may
        mimic a continuous joint."""
        turns = kind in ("revolute", "continuous")
        leaders = [name for name in leaders if turns or self.kinds[name] != "continuous"]
        return str(self.rng.choice(leaders)) if kind in ONE and leaders and self.rng.random() < 0.4 else None

    def _numbers(self, count: int, scale: float) -> str:
        return " ".join(repr(float(x)) for x in self.rng.uniform(-scale, scale, count))

    def _origin(self) -> str:
        return f'<origin xyz="{self._numbers(3, 0.5)}" rpy="{self._numbers(3, np.pi)}"/>'

    def _link(self, i: int, moves: bool) -> str:
        if not moves and self.rng.random() < 0.3:
            return f'<link name="link{i}"/>'
        mass, (a, b, c) = self.rng.uniform(0.5, 2.0), self.rng.uniform(0.1, 0.3, 3) ** 2
        ixx, iyy, izz = mass * (b + c), mass * (a + c), mass * (a + b)
        inertia = f'<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{iyy}" iyz="0" izz="{izz}"/>'
        return f'<link name="link{i}"><inertial>{self._origin()}<mass value="{mass}"/>{inertia}</inertial></link>'

    def _joint(self, name: str, kind: str, parent: int, child: int, follows: str | None) -> str:
        axes = (f'<axis xyz="{self._numbers(3, 1.0)}"/>', "", *(f'<axis xyz="{axis}"/>' for axis in AXES))
        axis = axes[self.rng.integers(len(axes))] if kind in ("revolute", "continuous", "prismatic") else ""
        if kind == "planar":
            axis = '<axis xyz="0 0 1"/>'  # Pinocchio's planar joint moves only in the xy plane
        lower, upper, velocity, effort = self.rng.uniform((-3, 0, 0, 0), (0, 3, 10, 100))
        limited = kind in ("revolute", "prismatic") or (kind == "continuous" and self.rng.random() < 0.5)
        limit = f'<limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="{effort}"/>' if limited else ""
        damping, friction = self.rng.uniform(0, 1, 2)
        dynamics = f'<dynamics damping="{damping}" friction="{friction}"/>' if self.rng.random() < 0.5 else ""
        ratio, offset = self.rng.uniform(-2, 2, 2)
        ratio = round(ratio) if follows and self.kinds[follows] == "continuous" else ratio
        mimic = f'<mimic joint="{follows}" multiplier="{ratio}" offset="{offset}"/>' if follows else ""
        ends = f'<parent link="link{parent}"/><child link="link{child}"/>'
        content = self._origin() + ends + axis + limit + dynamics + mimic
        return f'<joint name="{name}" type="{kind}">{content}</joint>'
