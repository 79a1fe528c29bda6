"""Tests of messages to the user: each error names the argument, the expected value and the found value. Also tests the
contents of `help`.
"""

import pickle
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle import WORLD, ConstraintSet, ContactConstraint, Data, Joint, Model, ModelBuilder
from condyle.optimal import AugmentedLagrangian, Fddp, FreeDynamics, InteriorPoint, Problem

ARM = condyle.robots.arm7()
DATA = Data(ARM)
Q, ZERO = np.full(7, 0.3), np.zeros(7)


def told(call: Callable[[], object], error: type[Exception]) -> str:
    """Returns the message of the error that a call raises."""
    with pytest.raises(error) as raised:
        call()
    return str(raised.value)


def test_columns_and_batches_in_another_layout() -> None:
    expected = "expected shape (7,), or (N, 7) for N states, found"
    column = told(lambda: condyle.rnea(ARM, DATA, Q[:, None], ZERO, ZERO), ValueError)
    assert column == f"q: {expected} (7, 1), a column: give x.ravel()"
    assert told(lambda: condyle.integrate(ARM, Q, ZERO[:, None]), ValueError).startswith(
        f"v: {expected} (7, 1), a column"
    )
    sideways = np.zeros((7, 100))
    assert told(lambda: condyle.rnea(ARM, DATA, sideways, sideways, sideways), ValueError) == f"q: {expected} (7, 100)"


@pytest.mark.parametrize("shape", [(5, 6, 8), (5, 48, 1), (5, 8, 7)])
def test_matrices_of_many_states_in_another_layout(shape: tuple[int, ...]) -> None:
    """Checks that matrices with a wrong shape are errors, even if they have the right count of numbers. Otherwise the
    numbers would be read in the wrong order.
    """
    states = np.tile(Q, (5, 1))
    message = told(lambda: condyle.rnea(ARM, DATA, states, ZERO, ZERO, np.zeros(shape)), ValueError)
    assert message == f"f_ext: expected shape (8, 6), or (N, 8, 6) for N states, found {shape}"
    message = told(lambda: condyle.rnea(ARM, DATA, states, ZERO, ZERO, np.zeros((6, 8))), ValueError)
    assert message == "f_ext: expected shape (8, 6), found (6, 8)"


def test_none_is_no_array_and_no_frame() -> None:
    assert told(lambda: condyle.crba(ARM, DATA, None), TypeError) == (
        "q: expected real numbers of shape (7,), found None"
    )
    for frame, found in [(None, "None"), (1.5, "a float"), (b"tool", "a bytes")]:
        message = told(lambda frame=frame: condyle.frame_jacobian(ARM, DATA, Q, frame), TypeError)
        assert message == f"frame: expected a name or 0 to 16, found {found}"
    message = told(lambda: condyle.body_jacobian(ARM, DATA, Q, None), TypeError)
    assert message == "body: expected a joint's name or 0 to 7, found None"


def test_one_name_where_a_list_is_expected() -> None:
    message = told(lambda: ARM.lock("joint1", Q), TypeError)
    assert message == "joints: expected a list of names or numbers of bodies, found 'joint1'; write ['joint1']"
    assert told(lambda: ARM.lock(1, Q), TypeError).endswith("found an int")
    assert told(lambda: ARM.lock([1.5], Q), TypeError) == "joints: expected names or 1 to 7, found a float"
    assert ARM.lock(("joint1", 2), Q).nv == ARM.lock(iter(["joint1", 2]), Q).nv == 5
    touch = ContactConstraint("tool", "point")
    message = told(lambda: ConstraintSet(ARM, touch), TypeError)
    assert message.startswith(
        "constraints: expected a list of `ContactConstraint`s, found ContactConstraint(frame='tool'"
    )
    message = told(lambda: ConstraintSet(ARM, ["tool"]), TypeError)
    assert message == "constraints: expected `ContactConstraint`s, found a str"


def test_words_of_constraints_are_those_of_python() -> None:
    message = told(
        lambda: ConstraintSet(ARM, [ContactConstraint("tool", "point", reference="world")]), condyle.ModelError
    )
    assert message == "constraint 0: its reference must be `local` or `local_world_aligned`, found `world`"


def test_names_that_are_not_there() -> None:
    empty = ModelBuilder("nothing").build()
    assert told(lambda: empty.frame("x"), condyle.ModelError) == "unknown frame `x`; no frame has a similar name"
    assert told(lambda: empty.joint("x"), condyle.ModelError) == "unknown joint `x`; no joint has a similar name"
    assert told(lambda: ARM.frame("gripper"), condyle.ModelError) == (
        "unknown frame `gripper`; no frame has a similar name"
    )
    assert told(lambda: ARM.frame("toll"), condyle.ModelError) == "unknown frame `toll`; nearest is `tool`"
    with_a_frame = ModelBuilder("one frame")
    with_a_frame.frame("f", WORLD)
    message = told(lambda: condyle.frame_placement(empty, Data(empty), [], 0), IndexError)
    assert message == "frame: expected a name, found 0: the model has none"


def test_two_bodies() -> None:
    builder = ModelBuilder("twins")
    for _ in range(2):
        builder.body("twin", WORLD, Joint.revolute([0.0, 0.0, 1.0]))
    assert told(builder.build, condyle.ModelError) == "two bodies are named `twin`"


def test_texts_paths_and_macros(tmp_path: Path) -> None:
    for read in (Model.from_urdf, Model.from_mjcf, Model.from_sdf):
        message = told(lambda read=read: read(condyle.robots.QUADRUPED), condyle.ParseError)
        assert message.startswith("`<?xml")
        assert "is the text of a file, where its path is expected" in message
        assert len(message) < 200
    for read in (Model.from_urdf_str, Model.from_mjcf_str, Model.from_sdf_str):
        assert "this is a path" in told(lambda read=read: read("robots/arm.urdf"), condyle.ParseError)
    path = tmp_path / "robot.urdf"
    path.write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n<xacro:property name="a" value="1"/>\n'
        '<link name="base"/>\n</robot>'
    )
    message = told(lambda: Model.from_urdf(path), condyle.ParseError)
    assert message.startswith(f"{path}:2: xacro:property `a`: belongs to xacro: expand the file first (`xacro ")


def test_settings_that_are_not_there_are_told_those_that_are() -> None:
    problem = Problem(np.zeros(14), [FreeDynamics(ARM, 0.1, [])], [0], FreeDynamics(ARM, None, []))
    for solver in (Fddp, AugmentedLagrangian, InteriorPoint):
        message = told(lambda solver=solver: solver(problem, tolerence=1e-6), ValueError)
        assert message.startswith("settings: there is no setting 'tolerence'; there are ")
        names = message.split("there are ", 1)[1].split(", ")
        assert "tolerance" in names
        words = {"method": "fddp", "time_budget": 1.0, "second_order": True, "inverse_dynamics_form": True}
        words |= {"project_warm_start": False, "restart": False}
        numbers = {"regularisation_min": 1e-9, "regularisation_factor": 10.0}
        for name in names:  # each name is a valid setting
            solver(problem, **{name: (words | numbers).get(name, 1)})


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("tolerance", "x", "expected a number, found 'x'"),
        ("max_iterations", -1, "expected a whole number, 0 or above, found -1"),
        ("second_order", 2, "expected True or False, found 2"),
    ],
)
def test_a_setting_of_another_type_is_named(name: str, value: object, text: str) -> None:
    problem = Problem(np.zeros(14), [FreeDynamics(ARM, 0.1, [])], [0], FreeDynamics(ARM, None, []))
    assert told(lambda: Fddp(problem, **{name: value}), ValueError) == f"settings: {name}: {text}"


def test_functions_are_functions() -> None:
    """Checks that an argument of an action, a residual or a space that should be a function, but is not, is an error at
    construction.
    """
    optimal, f = condyle.optimal, len
    for make, name in (
        (lambda: optimal.Action(2, 1, 3), "calc"),
        (lambda: optimal.Action(2, 1, f, 3), "calc_diff"),
        (lambda: optimal.Action(2, 1, f, space=(1, f, 3)), "space: difference"),
        (lambda: optimal.DifferentialAction(1, 1, 3, 0.1), "calc"),
        (lambda: optimal.Residual.own(2, 3), "calc"),
        (lambda: optimal.Residual.own_cost(f, 3), "calc_diff"),
    ):
        assert told(make, TypeError) == f"{name}: expected a function, found 3"


def test_attributes_of_a_model_are_not_set() -> None:
    def set_to(name: str) -> Callable[[], None]:
        return lambda: setattr(ARM, name, getattr(ARM, name, None))

    for name in ("limits", "gravity", "armature"):
        message = told(set_to(name), AttributeError)
        assert message == f"{name}: read-only: a model never changes; model.with_{name}(...) makes another one"
        assert callable(getattr(ARM, f"with_{name}"))
    assert "a ModelBuilder makes another one" in told(set_to("joint_placements"), AttributeError)
    assert told(set_to("colour"), AttributeError) == "'condyle.Model' object has no attribute 'colour'"


def test_an_output_that_cannot_be_written() -> None:
    out = np.zeros((7, 7))
    out.setflags(write=False)
    message = told(lambda: condyle.crba(ARM, DATA, Q, out=out), ValueError)
    assert message == "out: expected a writable array, found a read-only one"


def test_a_running_action_is_no_end() -> None:
    step, end = FreeDynamics(ARM, 0.1, []), FreeDynamics(ARM, None, [])
    message = told(lambda: Problem(np.zeros(14), [step], [0], step), condyle.optimal.ProblemError)
    assert message.startswith("terminal: expected an action without controls")
    message = told(lambda: Problem(np.zeros(14), [end], [0], end), condyle.optimal.ProblemError)
    assert message.startswith("knot 0")


ATTRIBUTES = {
    "limits.lower": "with_limits",
    "limits.effort": "with_limits",
    "armature": "with_armature",
    "gravity": "with_gravity",
    "inertial_parameters": "with_inertias",
    "inertias[1].com": "with_inertias",
    "inertias[1].rotational": "with_inertias",
    "damping": "with_damping",
    "friction": "with_friction",
    "joint_placements": "",
    "frames[3].placement": "",
}


@pytest.mark.parametrize("attribute", ATTRIBUTES)
def test_what_a_model_shows_cannot_be_written(attribute: str) -> None:
    numbers, instead = eval(f"ARM.{attribute}"), ATTRIBUTES[attribute]
    before = np.array(numbers)

    def add(array: Any) -> None:
        array += 1.0

    for write in (lambda: numbers.__setitem__(..., 1.0), lambda: add(numbers), lambda: add(numbers[:1])):
        message = told(write, ValueError)
        assert message.startswith("read-only: a model never changes")
        assert f"model.{instead}(...)" in message if instead else "ModelBuilder" in message
        if instead:
            assert callable(getattr(ARM, instead))
    with pytest.raises(ValueError, match="read-only|not writeable"):
        numbers.fill(1.0)
    assert np.array_equal(eval(f"ARM.{attribute}"), before)
    own = numbers.copy()
    own += 1.0
    for plain in (own, numbers + 1.0, np.minimum(numbers, 0.0), pickle.loads(pickle.dumps(numbers))):
        assert type(plain) is np.ndarray
        assert plain.flags.writeable
    assert repr(numbers) == repr(before)


def test_what_a_model_shows_is_made_once() -> None:
    assert ARM.limits is ARM.limits
    assert ARM.frames[3] is ARM.frames[3]
    own = ARM.frames
    own.clear()  # the caller may change this list, because it is a copy
    ARM.names.clear()
    assert len(ARM.frames) == 17
    assert len(ARM.names) == 8


def test_other_limits() -> None:
    weak = ARM.with_limits(effort=0.5 * ARM.limits.effort, lower=ARM.limits.lower + 0.1)
    assert np.array_equal(weak.limits.effort, 0.5 * ARM.limits.effort)
    assert np.array_equal(weak.limits.lower, ARM.limits.lower + 0.1)
    assert np.array_equal(weak.limits.upper, ARM.limits.upper)
    assert np.array_equal(condyle.rnea(weak, DATA, Q, ZERO, ZERO), condyle.rnea(ARM, DATA, Q, ZERO, ZERO))
    message = told(lambda: ARM.with_limits(lower=np.full(7, 9.0)), condyle.ModelError)
    assert message == "joint `joint1`: lower limit 9 is above upper limit 2.9"
    assert "effort" in told(lambda: ARM.with_limits(effort=np.full(7, -1.0)), condyle.ModelError)
    assert told(lambda: ARM.with_limits(velocity=[1.0]), ValueError) == "velocity: expected shape (7,), found (1,)"


def test_short_reprs_and_whole_trees() -> None:
    humanoid = condyle.robots.humanoid()
    data = Data(humanoid)
    touch = ConstraintSet(ARM, [ContactConstraint("tool", "point")])
    zero = np.zeros(humanoid.nv)
    derivatives = condyle.rnea_derivatives(humanoid, data, condyle.neutral(humanoid), zero, zero)
    shown = [humanoid, data, touch, humanoid.frames[3], humanoid.limits, humanoid.inertias[1], derivatives]
    shown += [ModelBuilder("x"), condyle.Ltdl(ARM), condyle.Cholesky(3), condyle.DivideConquer(ARM, 2)]
    shown += [condyle.simulation.Simulation(ARM)]
    for thing in shown:
        assert "\n" not in repr(thing)
        assert len(repr(thing)) < 250, repr(thing)
        assert "object at 0x" not in repr(thing)
    assert repr(touch) == "<condyle.ConstraintSet of 'arm7': 1 constraints, 3 rows>"
    assert f"dtau_dq=<array ({humanoid.nv}, {humanoid.nv})>" in repr(derivatives)
    tree = humanoid.tree()
    assert len(tree.splitlines()) == humanoid.nbodies
    assert all(f" {joint}: " in tree for joint in humanoid.names[1:])
    frames = ARM.tree(frames=True)
    assert re.search(r"\n *· .*\btool\b", frames)


def test_tree_shows_who_stands_on_whom() -> None:
    builder, axis = ModelBuilder("branches"), Joint.revolute([0.0, 0.0, 1.0])
    trunk = builder.body("trunk", WORLD, Joint.free_flyer())
    left = builder.body("left", trunk, axis)
    builder.body("hand", left, axis)
    right = builder.body("right", trunk, axis)
    builder.mimic(right, left, 2.0, 0.5)
    assert builder.build().tree() == "\n".join(
        [
            "universe",
            "└─ trunk: free_flyer, q[0:7], v[0:6] → trunk, 0.000 kg",
            "   ├─ left: revolute, q[7], v[6] → left, 0.000 kg",
            "   │  └─ hand: revolute, q[8], v[7] → hand, 0.000 kg",
            "   └─ right: revolute, 2 q[7] + 0.5 → right, 0.000 kg",
        ]
    )


def test_help_has_an_index_of_everything() -> None:
    text = condyle.__doc__ or ""
    index = text[text.index("The names by topic") :]
    named = set(re.findall(r"`(\w+)`", index))
    modules = {module.name for module in pkgutil.iter_modules(condyle.__path__) if not module.name.startswith("_")}
    missing = ({name for name in condyle.__all__ if not name.startswith("_")} | modules) - named
    assert not missing
    assert {name for name in named if not hasattr(condyle, name)} <= modules
