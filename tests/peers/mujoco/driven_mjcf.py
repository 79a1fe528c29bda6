"""Generates random robots in MJCF, with actuators, springs, tendons, loops, gravity compensation and default
classes."""

import random
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


class DrivenMjcf:
    """Text of a random robot. MuJoCo may reject the text, because a range may be empty or a class may not fit its
    element."""

    def __init__(self, seed: int) -> None:
        """Generates the text of the robot for a seed."""
        self.random = random.Random(seed)
        self.joints: list[tuple[str, str]] = []
        self.bodies: list[str] = []
        roots = "".join(self.body(0, self.chance(0.3)) for _ in range(self.pick([1, 1, 2])))
        self.scalars = [name for name, kind in self.joints if kind in ("hinge", "slide")]
        self.tendons: list[str] = []
        tendons = "".join(self.tendon(k) for k in range(self.pick([0, 1, 2])) if self.scalars)
        kinds = sorted(self.laws())
        classes = "".join(self.default(kind) for kind in self.random.sample(kinds, self.pick([0, 0, 1, 2])))
        inner = "".join(self.default(kind) for kind in self.random.sample(kinds, self.pick([0, 1])))
        actuators = "".join(self.actuator(k) for k in range(self.pick([0, 1, 2, 4])))
        equality = "".join(self.constraint() for _ in range(self.pick([0, 1, 2])))
        self.text = (
            f'<mujoco><default>{classes}<default class="x">{inner}</default></default><worldbody>{roots}</worldbody>'
            f"<tendon>{tendons}</tendon><actuator>{actuators}</actuator><equality>{equality}</equality></mujoco>"
        )

    def number(self, lower: float = -1.0, upper: float = 1.0) -> float:
        """Returns the text of a random number with three digits."""
        return round(self.random.uniform(lower, upper), 3)

    def numbers(self, count: int) -> str:
        """Returns random numbers between -1 and 1."""
        return " ".join(str(self.number()) for _ in range(count))

    def range(self, size: float) -> str:
        """Returns two random numbers in ascending order."""
        lower, upper = sorted((self.number(-size, size), self.number(-size, size)))
        return f"{lower} {upper + 0.01:.3f}"

    def chance(self, share: float) -> bool:
        """Returns true with the given probability."""
        return self.random.random() < share

    def maybe(self, share: float, text: str) -> str:
        """Returns the text with the given probability, and otherwise an empty text."""
        return text if self.chance(share) else ""

    def pick(self, values: list[T]) -> T:
        """Returns one of the given values at random."""
        return self.random.choice(values)

    def polynomial(self, greatest: float) -> str:
        """Returns either one coefficient or three coefficients."""
        return f"{self.number(0, greatest)}" + self.maybe(0.5, f" {self.number(0, 1)} {self.number(0, 1)}")

    def joint(self, name: str, kind: str) -> str:
        """Returns a joint with springs, damping and friction."""
        self.joints.append((name, kind))
        text = f'<joint name="{name}" type="{kind}" '
        if kind in ("hinge", "slide"):
            degrees = 20.0 if kind == "hinge" else 1.0
            text += f'axis="{self.numbers(3)}" '
            text += self.maybe(0.4, f'ref="{self.number(-degrees, degrees)}" ')
            text += self.maybe(0.4, f'springref="{self.number(-degrees, degrees)}" ')
            text += self.maybe(0.5, f'range="{self.range(90)}" ')
            text += self.maybe(0.3, f'actuatorfrcrange="{self.number(-20, 0)} {self.number(0.1, 20)}" ')
        if kind != "free":
            text += f'pos="{self.numbers(3)}" ' + self.maybe(0.4, f'armature="{self.number(0, 1)}" ')
        text += self.maybe(0.5, f'stiffness="{self.polynomial(5)}" ')
        text += self.maybe(0.5, f'damping="{self.polynomial(5)}" ')
        text += self.maybe(0.3, f'frictionloss="{self.number(0, 1)}" ')
        return text + self.maybe(0.25, f'springdamper="{self.number(0.1, 1)} {self.number(0.2, 2)}" ') + "/>"

    def body(self, depth: int, floats: bool = False) -> str:
        """Returns a body, with its child bodies."""
        k = len(self.bodies)
        self.bodies.append(f"b{k}")
        kinds = [self.pick(["hinge", "hinge", "slide", "ball"]) for _ in range(self.pick([0, 1, 1, 1, 2]))]
        joints = "".join(self.joint(f"j{k}_{i}", kind) for i, kind in enumerate(["free"] if floats else kinds))
        inertial = f'<inertial pos="{self.numbers(3)}" mass="{self.number(0.5, 3)}" diaginertia=".1 .12 .15"/>'
        site = f'<site name="s{k}" pos="{self.numbers(3)}" quat="{self.numbers(4)}"/>'
        children = "".join(self.body(depth + 1) for _ in range(self.pick([0, 1, 1, 2]) if depth < 3 else 0))
        place = f'pos="{self.numbers(3)}" quat="{self.numbers(4)}" ' + self.maybe(
            0.3, f'gravcomp="{self.number(0, 2)}"'
        )
        return f'<body name="b{k}" {place}>{joints}{inertial}{site}{children}</body>'

    def tendon(self, k: int) -> str:
        """Returns a fixed tendon over one or two joints."""
        self.tendons.append(f"t{k}")
        attributes = [
            f'armature="{self.number(0, 1)}"',
            f'stiffness="{self.polynomial(5)}"',
            f'springlength="{self.number()}"',
            f'damping="{self.polynomial(5)}"',
            f'frictionloss="{self.number(0, 1)}"',
            f'range="{self.range(3)}"',
            f'actuatorfrcrange="{self.number(-5, -0.1)} {self.number(0.1, 5)}"',
        ]
        chosen = " ".join(attribute for attribute in attributes if self.chance(0.4))
        over = self.random.sample(self.scalars, min(len(self.scalars), self.pick([1, 1, 2])))
        joints = "".join(f'<joint joint="{joint}" coef="{self.number(0.2, 2)}"/>' for joint in over)
        return f'<fixed name="t{k}" {chosen}>{joints}</fixed>'

    def laws(self) -> dict[str, Callable[[], str]]:
        """Returns the attributes that are specific to each kind of actuator."""
        gain = self.number
        return {
            "motor": lambda: "",
            "position": lambda: (
                self.maybe(0.7, f'kp="{gain(1, 50)}" ')
                + self.pick(["", f'kv="{gain(0, 5)}" ', f'dampratio="{gain(0, 2)}" '])
                + self.maybe(0.1, 'timeconst="0.1" ')
            ),
            "velocity": lambda: self.maybe(0.7, f'kv="{gain(0, 5)}" '),
            "intvelocity": lambda: self.maybe(0.7, f'kp="{gain(1, 50)}" ') + self.maybe(0.5, f'kv="{gain(0, 5)}" '),
            "damper": lambda: f'kv="{gain(0, 4)}" ctrlrange="0 {gain(0.1, 1)}" ',
            "cylinder": lambda: self.maybe(0.5, f'area="{gain(0.1, 3)}" ') + self.maybe(0.5, f'bias="{gain()} 0 0" '),
            "general": lambda: (
                self.maybe(0.5, f'gainprm="{gain(-5, 5)}" ')
                + self.maybe(0.5, f'biastype="affine" biasprm="{gain()} {gain(-5, 0)} {gain(-5, 0)}" ')
            ),
            "pid": lambda: self.maybe(0.5, f'kp="{gain(1, 5)}" ') + self.maybe(0.5, f'kv="{gain(0, 5)}" '),
            "dcmotor": lambda: (
                f'motorconst="{gain(0.1, 1)}" resistance="{gain(0.1, 3)}" '
                + self.maybe(0.5, f'saturation="{gain(1, 5)}" ')
            ),
        }

    def mechanics(self, kind: str) -> str:
        """Returns the attributes that all kinds of actuators have."""
        text = self.maybe(0.6, f'gear="{self.number(-4, 4)}' + self.maybe(0.5, f" {self.numbers(5)}") + '" ')
        text += self.maybe(0.3, f'armature="{self.number(0, 1)}" ') + self.maybe(
            0.3, f'damping="{self.polynomial(1)}" '
        )
        if kind != "damper":
            text += self.maybe(0.5, f'{"posrange" if kind == "pid" else "ctrlrange"}="{self.range(3)}" ')
        if kind != "dcmotor":
            text += self.maybe(0.5, f'forcerange="{self.number(-9, 0)} {self.number(0.1, 9)}" ')
        return text

    def default(self, kind: str) -> str:
        """Returns the default of a class for one kind of element."""
        return f"<{kind} {self.laws()[kind]()} {self.mechanics(kind)}/>"

    def actuator(self, k: int) -> str:
        """Returns an actuator that drives a joint, a tendon or a site."""
        kind = self.pick(sorted(self.laws()))
        targets = [f'site="s{self.random.randrange(len(self.bodies))}"']
        targets += [f'tendon="{name}"' for name in self.tendons]
        targets += [f'{self.pick(["joint", "joint", "jointinparent"])}="{name}"' for name, _ in self.joints]
        attributes = self.laws()[kind]() + self.mechanics(kind) + self.maybe(0.4, 'class="x" ')
        return f'<{kind} name="a{k}" {self.pick(targets)} {attributes}/>'

    def constraint(self) -> str:
        """Returns a constraint: a loop or a coupling of joints."""
        first, second = (self.random.randrange(len(self.bodies)) for _ in range(2))
        bodies = f'body1="b{first}" ' + self.maybe(0.8, f'body2="b{second}" ')
        relative = self.maybe(0.5, f'anchor="{self.numbers(3)}" ') + self.maybe(0.4, f'relpose="{self.numbers(7)}" ')
        options = [
            f'<connect {bodies} anchor="{self.numbers(3)}"/>',
            f"<weld {bodies} {relative}/>",
            f'<weld site1="s{first}" site2="s{second}"/>',
        ]
        if len(self.scalars) > 1:
            one, two = self.random.sample(self.scalars, 2)
            options.append(f'<joint joint1="{one}" joint2="{two}" polycoef="{self.numbers(self.pick([2, 5]))}"/>')
        return self.pick(options)
