"""Tests of pickles of all public classes: a pickle gives an equal copy, or raises an error for a computation in
progress.
"""

import inspect
import pickle
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import condyle
from condyle import ContactConstraint, Data, Joint, optimal, simulation, wholebody
from condyle.optimal import Cost, FreeDynamics, Problem, Residual

ARM = condyle.robots.arm7()
Q, ZERO = np.full(7, 0.3), np.zeros(7)
STEP = FreeDynamics(ARM, 0.05, [Cost("rest", 1.0, Residual.state(np.zeros(14)))])
PROBLEM = Problem(np.zeros(14), [STEP], [0] * 3, FreeDynamics(ARM, None, []))

# Classes of computations in progress, such as factors and builders.
UNDER_WAY = {
    "BodyId", "Cholesky", "DivideConquer", "Ltdl", "ModelBuilder", "Policy", "Record", "Sensitivities",
    "Sensitivity", "Sweep",
}  # fmt: skip


def classes() -> Iterator[tuple[str, type]]:
    for module in (condyle, optimal, simulation, wholebody):
        yield from ((name, item) for name in module.__all__ if inspect.isclass(item := getattr(module, name)))


def cone() -> optimal.FrictionCone:
    return optimal.FrictionCone(0.6, facets=8, inner=True, least=1.0, rotation=[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


# An object of each class whose pickle is tested only in this file.
OBJECTS: dict[str, Any] = {
    "Simulation": simulation.Simulation(ARM, "runge_kutta_4", dt=0.002, passive=0.1),
    "Ground": simulation.Ground(["tool"], friction=0.3),
    "GroundContacts": simulation.Simulation(ARM, ground=simulation.Ground(["tool"])).contacts,
    "Joint": Joint.helical([0.0, 0.6, 0.8], pitch=0.1),
    "ConstraintSet": condyle.ConstraintSet(ARM, [ContactConstraint("tool", "point", kp=3.0)], mu=1e-6, iterations=2),
    "Data": Data(ARM, threads=2),
    "HyperDual": condyle.HyperDual(1.5, 2.0, -3.0, 0.1),
    "FrictionCone": cone(),
    "WrenchCone": optimal.WrenchCone(cone(), [0.2, 0.1]),
    **{
        kind.__name__: kind("hand", np.arange(float(kind.SIZE)))
        for kind in (wholebody.ComTarget, wholebody.ContactTarget, wholebody.FrameTarget, wholebody.MomentumTarget)
    },
    "PostureTarget": wholebody.PostureTarget("arm", np.arange(21.0), 7, 7),
    "Model": ARM,
    "Problem": PROBLEM,
    "Fddp": optimal.Fddp(PROBLEM, tolerance=1e-6),
    "FreeDynamics": STEP,
    "Inertia": condyle.Inertia.from_com(2.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3)),
    "RneaDerivatives": condyle.rnea_derivatives(ARM, Data(ARM), Q, ZERO, ZERO),
}


def shown(thing: Any) -> list[str]:
    """Returns the visible contents of an object: its text, its properties, and the results of its methods without
    arguments.
    """
    members = [name for name in dir(type(thing)) if not name.startswith("_")]
    values = [getattr(thing, name) for name in members]
    called = [name in ("rows", "bounds") and callable(value) for name, value in zip(members, values, strict=True)]
    texts = [
        repr(value() if call else value)
        for value, call in zip(values, called, strict=True)
        if call or not callable(value)
    ]
    return [*texts, "" if "object at 0x" in repr(thing) else repr(thing)]


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize("protocol", [0, pickle.HIGHEST_PROTOCOL])
def test_a_copy_shows_the_same(name: str, protocol: int) -> None:
    thing = OBJECTS[name]
    again = pickle.loads(pickle.dumps(thing, protocol))
    assert type(again) is type(thing)
    assert shown(again) == shown(thing)


@pytest.mark.parametrize(("name", "item"), [pair for pair in classes() if pair[0] not in OBJECTS])
def test_all_others_pickle_or_are_under_way(name: str, item: type) -> None:
    """Checks every other class: it defines its own pickle, is a tuple or an exception, or raises an error that names
    the class.
    """
    own = any({"__reduce__", "__reduce_ex__", "__getstate__"} & vars(base).keys() for base in item.__mro__[:-1])
    assert own or issubclass(item, tuple | Exception) or item.__init__ is not object.__init__ or name in UNDER_WAY


def power(t: int, x: np.ndarray, u: np.ndarray) -> np.ndarray:
    return x[7:] * u if len(u) else 0.0 * x[7:]


def swing(t: int, x: np.ndarray, u: np.ndarray) -> float:
    return 1.0 - np.cos(x[3])


def test_residuals_of_ones_own_go_with_their_knots() -> None:
    """Checks that a copied problem with user-defined residuals gives bit-identical solutions. The residuals are in
    costs, in costs of single knots, and in limits.
    """
    ends, rest = np.full(7, np.inf), Cost("rest", 0.1, Residual.state(np.zeros(14)))
    costs = [Cost("power", 1e-2, Residual.own(7, power)), rest, Cost("swing", 1.0, Residual.own_cost(swing))]
    limits = [optimal.Limit("strong", Residual.own(7, power), -ends, ends)]
    step = FreeDynamics(ARM, 0.05, costs, {1: [rest, costs[0]]}, limits=limits)
    again = pickle.loads(pickle.dumps(step))
    assert repr(again) == repr(step)
    end, xs, us = FreeDynamics(ARM, None, [rest]), np.tile(np.r_[Q, ZERO], (4, 1)), np.full((3, 7), 0.5)
    problems = [Problem(xs[0], [one], [0] * 3, end) for one in (step, again)]
    problems += [pickle.loads(pickle.dumps(problems[1]))]
    expected, *others = [optimal.Fddp(problem, max_iterations=5).solve(xs, us) for problem in problems]
    assert expected.cost > 0
    for found in others:
        assert np.array_equal(found.xs, expected.xs)
        assert found.cost == expected.cost
    with pytest.raises(optimal.ProblemError, match="written in Python, which JSON cannot contain"):
        problems[0].to_json()


@pytest.mark.parametrize("thing", [condyle.Ltdl(ARM), condyle.Cholesky(3), condyle.ModelBuilder("x")])
def test_what_is_under_way_is_refused(thing: Any) -> None:
    assert type(thing).__name__ in UNDER_WAY
    with pytest.raises(TypeError, match="cannot pickle"):
        pickle.dumps(thing)


@pytest.mark.parametrize(
    "joint",
    [
        Joint.revolute([1.0, 2.0, 2.0]), Joint.continuous([0.0, 0, 1]), Joint.prismatic([0.0, 1, 0]), Joint.spherical(),
        Joint.helical([0.0, 0.6, 0.8], pitch=0.25), Joint.planar(), Joint.translation(), Joint.free_flyer(),
    ],
)  # fmt: skip
def test_joints_of_each_kind(joint: Joint) -> None:
    again = pickle.loads(pickle.dumps(joint))
    assert repr(again) == repr(joint)
    assert (again.nq, again.nv) == (joint.nq, joint.nv)


def test_constraints_keep_their_targets_and_how_they_solve() -> None:
    held = ContactConstraint("tool", "rigid", kp=3.0, kd=1.0)
    constraints = condyle.ConstraintSet(ARM, [held], mu=1e-3, iterations=3)
    place = np.eye(4)
    place[:3, 3] = [0.2, 0.1, 0.5]
    constraints.set_target(0, placement=place, velocity=np.arange(6.0))
    model, data, again = pickle.loads(pickle.dumps((ARM, Data(ARM), constraints)))
    before = condyle.constrained_dynamics(ARM, Data(ARM), constraints, Q, Q, ZERO)
    after = condyle.constrained_dynamics(model, data, again, Q, Q, ZERO)
    for one, other in zip(before, after, strict=True):
        assert np.array_equal(one, other)
