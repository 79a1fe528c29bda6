"""Cases for the tests of `condyle.torch` and `condyle.jax`: a robot with many joints, and a call of each method."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import condyle
from condyle import WORLD, Inertia, Joint, ModelBuilder


def every_joint() -> condyle.Model:
    """Returns a robot that is a chain with one joint of each kind."""
    builder, body = ModelBuilder("every joint"), WORLD
    axis = [0.0, 0.6, 0.8]
    joints = {
        "base": Joint.free_flyer(),
        "wheel": Joint.continuous(axis),
        "slide": Joint.prismatic(axis),
        "table": Joint.planar(),
        "ball": Joint.spherical(),
        "gantry": Joint.translation(),
        "hinge": Joint.revolute(axis),
    }
    at = np.eye(4)
    at[:3, 3] = [0.1, -0.2, 0.3]
    for name, joint in joints.items():
        inertia = Inertia.from_com(1.5, [0.1, 0.2, -0.1], np.diag([0.2, 0.3, 0.4]))
        body = builder.body(name, body, joint, at, inertia)
    builder.frame("tip", body, at)
    model = builder.build()
    return model.with_damping(np.linspace(0.1, 0.5, model.nv)).with_friction(np.linspace(0.3, 0.1, model.nv))


MODELS = {"arm": condyle.robots.arm7(), "every joint": every_joint()}
TIPS = {"arm": "tool", "every joint": "tip"}


class Case(NamedTuple):
    """A call of one method: (dynamics, tip, *arguments) -> result or results."""

    arguments: str
    """The arguments, separated by blanks: q, v, a, d (a small tangent vector), f (external forces)."""
    call: Callable[..., Any]
    expected: Callable[..., Any]
    """The same call of the library: (model, data, tip, *arguments)."""
    twice: bool | None = False
    """Whether exact second derivatives exist; None if they exist for robots without quaternions and pairs only."""


def touching(model: condyle.Model, tip: str) -> condyle.ConstraintSet:
    """Returns the constraint that holds the tip's position; the same set for the same robot."""
    key = (id(model), tip)
    if key not in _SETS:
        _SETS[key] = condyle.ConstraintSet(model, [condyle.ContactConstraint(tip, "point", kp=2.0, kd=3.0)])
    return _SETS[key]


_SETS: dict[tuple[int, str], condyle.ConstraintSet] = {}


def _same(name: str, arguments: str, twice: bool | None = False, *last: Any) -> Case:
    """Returns the case of a method whose arguments equal the arguments of the library's function."""
    return Case(
        arguments,
        lambda robot, tip, *x: getattr(robot, name)(*x, *last),
        lambda model, data, tip, *x: getattr(condyle, name)(model, data, *x, *last),
        twice,
    )


def _of_tip(name: str, arguments: str, *last: Any) -> Case:
    return Case(
        arguments,
        lambda robot, tip, *x: getattr(robot, name)(*x, tip, *last),
        lambda model, data, tip, *x: getattr(condyle, name)(model, data, *x, tip, *last),
    )


CASES = {
    "rnea": _same("rnea", "q v a", True),
    "rnea with forces": _same("rnea", "q v a f", True),
    "aba": _same("aba", "q v a", True),
    "aba with forces": _same("aba", "q v a f", True),
    "nonlinear_effects": _same("nonlinear_effects", "q v", True),
    "gravity": _same("gravity", "q", True),
    "crba": _same("crba", "q"),
    "minv": _same("minv", "q"),
    "com": _same("com", "q"),
    "com_velocity": _same("com_velocity", "q v"),
    "com_acceleration": _same("com_acceleration", "q v a"),
    "centroidal_momentum": _same("centroidal_momentum", "q v"),
    "centroidal_momentum_rate": _same("centroidal_momentum_rate", "q v a"),
    "kinetic_energy": _same("kinetic_energy", "q v", True),
    "potential_energy": _same("potential_energy", "q", True),
    "mechanical_energy": _same("mechanical_energy", "q v", True),
    "forward_kinematics": _same("forward_kinematics", "q"),
    "frame_placement": _of_tip("frame_placement", "q"),
    "frame_velocity": _of_tip("frame_velocity", "q v", "local_world_aligned"),
    "frame_acceleration": _of_tip("frame_acceleration", "q v a"),
    "frame_classical_acceleration": _of_tip("frame_classical_acceleration", "q v a", "world"),
    "constrained_dynamics": Case(
        "q v a",
        lambda robot, tip, *x: robot.constrained_dynamics(touching(robot.model, tip), *x),
        lambda model, data, tip, *x: condyle.constrained_dynamics(model, data, touching(model, tip), *x)[:2],
    ),
    "impulse_dynamics": Case(
        "q v",
        lambda robot, tip, *x: robot.impulse_dynamics(touching(robot.model, tip), *x, 0.5),
        lambda model, data, tip, *x: condyle.impulse_dynamics(model, data, touching(model, tip), *x, 0.5)[:2],
    ),
    "passive_torque": Case(
        "q v",
        lambda robot, tip, *x: robot.passive_torque(*x, 0.1),
        lambda model, data, tip, *x: condyle.passive_torque(model, *x, 0.1),
    ),
    "integrate": Case(
        "q d",
        lambda robot, tip, *x: robot.integrate(*x),
        lambda model, data, tip, *x: condyle.integrate(model, *x),
        None,
    ),
    "difference": Case(
        "q p",
        lambda robot, tip, *x: robot.difference(*x),
        lambda model, data, tip, *x: condyle.difference(model, *x),
        None,
    ),
}


def numbers(model: condyle.Model, arguments: str, states: int, unit: bool = True) -> list[np.ndarray]:
    """Returns random arguments of some states; unless `unit`, quaternions and pairs do not have the length 1."""
    rng = np.random.default_rng(3)
    q = np.stack([condyle.random_configuration(model, seed=k) for k in range(states)])
    near = condyle.integrate(model, q, rng.uniform(-0.5, 0.5, (states, model.nv)))
    scale = np.ones(model.nq)
    if not unit:
        for kind, at, count in zip(model.joint_types, model.idx_qs, model.nqs, strict=True):
            lengths = {"free_flyer": 3, "planar": 2}.get(kind, 0)
            if kind in ("free_flyer", "planar", "spherical", "continuous"):
                scale[at + lengths : at + count] = rng.uniform(0.7, 1.4)
    shapes = {"f": (states, model.nbodies, 6)}
    drawn = {name: rng.standard_normal(shapes.get(name, (states, model.nv))) for name in "vafd"}
    drawn |= {"q": q * scale, "p": near * scale, "d": 0.5 * drawn["d"]}
    return [drawn[name] for name in arguments.split()]
