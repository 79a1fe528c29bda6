"""Generates MJCFs of random robots, with hinges, slides, balls, a free body, several joints on a body, and bodies
without joints.

The robots contain no features that Pinocchio reads differently from MuJoCo. These features are: the world contains
several bodies (Pinocchio reads only the first body), the first body has no joint (Pinocchio ignores its pose), the
initial position of a free body (in Pinocchio it is relative to the pose in the file), and damping and friction of ball
joints (Pinocchio ignores them).
"""

import numpy as np

KINDS = ("hinge", "hinge", "slide", "ball", "two", "none")


class RandomMjcf:
    """Random robot with several bodies. The first body may have a free joint."""

    def __init__(self, seed: int, bodies: int = 10) -> None:
        self.rng = np.random.default_rng(seed)
        parents = [int(self.rng.integers(min(i, 1), i + 1)) for i in range(bodies)]
        self.children: list[list[int]] = [[] for _ in range(bodies + 1)]
        for i, parent in enumerate(parents, start=1):
            self.children[parent].append(i)
        inside = self._body(1, root=True)
        angle = '<compiler angle="radian" autolimits="true"/>'
        self.text = f'<mujoco model="random{seed}">{angle}<worldbody>{inside}</worldbody></mujoco>'

    def _numbers(self, count: int, scale: float) -> str:
        return " ".join(repr(float(x)) for x in self.rng.uniform(-scale, scale, count))

    def _pose(self) -> str:
        return f'pos="{self._numbers(3, 0.5)}" quat="{self._numbers(4, 1.0)}"'

    def _body(self, i: int, root: bool = False) -> str:
        kind = str(self.rng.choice(("free", *KINDS[:-1]) if root else KINDS))
        kinds = {"two": ("hinge", "slide"), "none": ()}.get(kind, (kind,))
        joints = "".join(self._joint(f"j{i}_{k}", kind) for k, kind in enumerate(kinds))
        mass, (a, b, c) = self.rng.uniform(0.5, 2.0), self.rng.uniform(0.1, 0.3, 3) ** 2
        moments = f"{mass * (b + c)} {mass * (a + c)} {mass * (a + b)}"
        inertial = f'<inertial {self._pose()} mass="{mass}" diaginertia="{moments}"/>'
        inside = joints + inertial + "".join(self._body(child) for child in self.children[i])
        pose = "" if kind == "free" else self._pose()
        return f'<body name="b{i}" {pose}>{inside}</body>'

    def _joint(self, name: str, kind: str) -> str:
        if kind == "free":
            return f'<freejoint name="{name}"/>'
        armature, damping, friction = self.rng.uniform(0, 1, 3)
        if kind == "ball":
            return f'<joint name="{name}" type="ball" armature="{armature}"/>'
        lower, upper = self.rng.uniform((-3, 0), (0, 3))
        axis = f'axis="{self._numbers(3, 1.0)}" range="{lower} {upper}"'
        losses = f'armature="{armature}" damping="{damping}" frictionloss="{friction}"'
        return f'<joint name="{name}" type="{kind}" {axis} {losses}/>'
