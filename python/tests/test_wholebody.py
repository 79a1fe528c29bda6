"""Tests of whole-body control: forces carry the weight, efforts agree with `rnea`, every kind of task and contact
works, errors contain names, and threads get the same results.
"""

import copy
import pickle
import threading
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.distances import Geometry, Shape
from condyle.optimal import ContactDynamics, Cost, Fddp, FreeDynamics, ImpulseDynamics, Problem, Residual
from condyle.wholebody import (
    ControllerError,
    DistanceLimits,
    FrictionContact,
    Gains,
    JointLimits,
    Plan,
    Pyramid,
    References,
    Settings,
    Task,
    WholeBodyController,
    plan_of,
)

QUADRUPED = condyle.robots.quadruped()
HUMANOID = condyle.robots.humanoid()
FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
SOLES = ["left_sole", "right_sole"]
CHEST = "chest"
STANDING = np.r_[0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0, [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2]
TASKS = [Task.com(), Task.orientation("trunk"), Task.posture()]
# Tolerance: constraints are violated by at most 1e-6, relative to 1 and to the weight. Efforts and sums of forces have
# errors of a few times this violation.
SOLVED = 1e-3


def points(friction: float = 0.7) -> list[FrictionContact]:
    return [FrictionContact.point(foot, friction) for foot in FEET]


def upright() -> np.ndarray:
    """Returns a position of the humanoid with bent knees."""
    q = condyle.neutral(HUMANOID)
    for name, i in zip(HUMANOID.names, HUMANOID.idx_qs, strict=True):
        for end, angle in ("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4):
            if name.endswith(end):
                q[i] = angle
    return q


def moving(model: condyle.Model, q: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Returns a position near q, and a slow velocity."""
    rng = np.random.default_rng(seed)
    return condyle.integrate(model, q, 0.02 * rng.standard_normal(model.nv)), 0.05 * rng.standard_normal(model.nv)


def effort(model: condyle.Model, q: np.ndarray, v: np.ndarray, contacts: list[FrictionContact], command: Any) -> Any:
    """Returns the efforts that the command requires, rnea(q, v, q̈) − Σ Jᵀ f."""
    data = condyle.Data(model)
    tau = condyle.rnea(model, data, q, v, command.a)
    for contact, force in zip(contacts, command.forces, strict=True):
        tau -= condyle.frame_jacobian(model, data, q, contact.frame, "local_world_aligned").T @ force
    return tau


@pytest.mark.parametrize(
    "settings", [None, Settings(backend="clarabel"), Settings(formulation="full"), Settings(friction=Pyramid())]
)
def test_the_feet_carry_the_weight(settings: Settings | None) -> None:
    controller = WholeBodyController(QUADRUPED, points(), TASKS, settings)
    command = controller.step(STANDING, np.zeros(18), controller.hold(STANDING)).solved()
    weight = 9.81 * QUADRUPED.total_mass
    np.testing.assert_allclose(command.forces[:, :3].sum(0), [0.0, 0.0, weight], atol=SOLVED * weight)
    assert np.all(np.hypot(*command.forces[:, :2].T) <= 0.7 * command.forces[:, 2] + 1e-6)
    np.testing.assert_allclose(command.com_acceleration, 0.0, atol=SOLVED)
    np.testing.assert_allclose(command.tau, effort(QUADRUPED, STANDING, np.zeros(18), points(), command), atol=SOLVED)
    assert command.source == "solution" and command.status == "solved" and not command.limits_relaxed
    assert command.violation < SOLVED and command.iterations > 0
    np.testing.assert_array_equal(controller.command.tau, command.tau)


CONTACTS: dict[str, list[FrictionContact]] = {
    "soles": [FrictionContact.sole(sole, 0.7, [0.2, 0.1]) for sole in SOLES],
    "soles by corners": [FrictionContact.sole(sole, 0.7, [0.2, 0.1], "corners") for sole in SOLES],
    "triangles": [
        FrictionContact.surface(sole, 0.7, [[0.1, 0.0, 0.0], [-0.1, 0.06, 0.0], [-0.1, -0.06, 0.0]], yaw_friction=0.02)
        for sole in SOLES
    ],
    "an edge and a sole": [
        FrictionContact.surface("left_sole", 0.7, [[0.0, 0.05, 0.0], [0.0, -0.05, 0.0]]),
        FrictionContact.sole("right_sole", 0.7, (0.2, 0.1), max_force=1e4),
    ],
    "points": [
        FrictionContact.point("left_sole", 0.7, axes="frame"),
        FrictionContact.point("right_sole", 0.7, [0, 0, 2]),
    ],
    "none": [],
}


@pytest.mark.parametrize("kind", CONTACTS)
def test_contacts_of_every_kind(kind: str) -> None:
    """Checks that M q̈ + h = τ + Σ Jᵀ f and m (c̈ − g) = Σ f for the contact forces f and the centre of mass c, and
    that contacts are held."""
    contacts = CONTACTS[kind]
    controller = WholeBodyController(HUMANOID, contacts, [Task.com(), Task.posture()])
    q, v = moving(HUMANOID, upright())
    command = controller.step(q, v, controller.hold(upright())).solved()
    data = condyle.Data(HUMANOID)
    np.testing.assert_allclose(command.tau, effort(HUMANOID, q, v, contacts, command), atol=SOLVED)
    c = condyle.com_acceleration(HUMANOID, data, q, v, command.a)
    np.testing.assert_allclose(command.com_acceleration, c, atol=1e-9)
    np.testing.assert_allclose(
        HUMANOID.total_mass * (c - [0.0, 0.0, -9.81]), command.forces[:, :3].sum(0), atol=SOLVED * 1e2
    )
    for contact in contacts:
        held = 3 if contact.corners is None or len(contact.corners) == 2 else 6
        a = condyle.frame_classical_acceleration(HUMANOID, data, q, v, command.a, contact.frame, "local_world_aligned")
        if contact.corners is not None:  # the acceleration at the mean of the corners: a + ω̇ × r + ω × (ω × r)
            w = condyle.frame_velocity(HUMANOID, data, q, v, contact.frame, "local_world_aligned")[3:]
            r = condyle.frame_placement(HUMANOID, data, q, contact.frame)[:3, :3] @ contact.corners.mean(0)
            a[:3] += np.cross(a[3:], r) + np.cross(w, np.cross(w, r))
        np.testing.assert_allclose(a[:held], 0.0, atol=SOLVED)


def test_a_contact_comes_and_goes() -> None:
    controller = WholeBodyController(QUADRUPED, points(), TASKS)
    references = controller.hold(STANDING)
    loads = []
    for activation in (1.0, 0.1, 0.0):
        references.contacts[0].activation = activation
        loads.append(controller.step(STANDING, np.zeros(18), references).solved().forces[0, 2])
    assert loads[0] > 50.0 and 0.0 <= loads[1] <= 0.1 * 9.81 * QUADRUPED.total_mass + 1e-4 and loads[2] == 0.0


# Desired acceleration of the task, so small that the robot can reach it.
WANTED = 0.2


@pytest.mark.parametrize("axes", ["world", "local", ("frame", "right_sole")])
@pytest.mark.parametrize("kind", ["com", "pose", "position", "orientation", "velocity", "angular_momentum"])
def test_tasks_of_every_kind(kind: str, axes: Any) -> None:
    """Checks that a task of the first priority is fulfilled exactly: J q̈ + J̇ v = a*, along the axes of the task."""
    q, v = moving(HUMANOID, upright(), 1)
    data = condyle.Data(HUMANOID)
    on_frame = kind not in ("com", "angular_momentum")
    size = 6 if kind in ("pose", "velocity") else 3
    mask = [True, False, True, True, False, True][:size]
    make = getattr(Task, kind)
    gains = Gains(0.0, 0.0)
    task = make(*[CHEST] * on_frame, weight=1e3, gains=gains, mask=mask, axes=axes)
    assert (task.kind, task.weight, task.gains, task.mask, task.axes) == (kind, 1e3, gains, mask, axes)
    assert task.frame == (CHEST if on_frame else None)
    contacts = CONTACTS["soles"]
    controller = WholeBodyController(HUMANOID, contacts, [task, Task.posture(priority=1)])
    references = controller.hold(q)
    wanted = WANTED * np.array([1.0, -2.0, 0.5, 0.5, 1.0, -1.0])
    if kind == "com":
        references.com.acceleration = wanted[:3]
    elif kind == "angular_momentum":
        references.momentum.rate = wanted[:3]
    else:
        rows = {"position": [0, 1, 2], "orientation": [3, 4, 5]}.get(kind, range(6))
        references.frames[0].acceleration[list(rows)] = wanted[:size]
    command = controller.step(q, v, references).solved()
    if kind == "com":
        found = command.com_acceleration
    elif kind == "angular_momentum":
        found = condyle.centroidal_momentum_rate(HUMANOID, data, q, v, command.a)[3:]
    else:
        a = condyle.frame_classical_acceleration(HUMANOID, data, q, v, command.a, CHEST, "local_world_aligned")
        found = a[list(rows)]
    R = np.eye(3)
    if axes != "world" and (on_frame or axes != "local"):
        R = condyle.frame_placement(HUMANOID, data, q, CHEST if axes == "local" else axes[1])[:3, :3]
    error = (found - wanted[:size]).reshape(-1, 3) @ R  # Rᵀ e: the error along the axes of the task
    np.testing.assert_allclose(error.ravel()[mask], 0.0, atol=SOLVED)


def test_a_task_of_force_and_one_of_posture() -> None:
    force = Task.contact_force("LF_foot", weight=1e3, mask=[False, False, True, False, False, False])
    joints = np.r_[np.zeros(6), np.ones(12)]
    assert force.kind == "contact_force" and force.frame == "LF_foot"
    controller = WholeBodyController(QUADRUPED, points(), [*TASKS[:2], Task.posture(joints=joints), force])
    references = controller.hold(STANDING)
    references.contacts[0].force = [0.0, 0.0, 30.0, 0.0, 0.0, 0.0]
    assert controller.step(STANDING, np.zeros(18), references).solved().forces[0, 2] == pytest.approx(30.0, abs=0.1)


def test_settings_are_the_library_s() -> None:
    """Checks that the default settings in Python equal the library's defaults, and that the controller returns given
    settings.
    """
    assert WholeBodyController(QUADRUPED, [], []).settings == Settings()
    limits = JointLimits(0.1, 50.0, velocity=np.full(18, 3.0))
    given = Settings(1e-4, 1e-3, Gains(1.0, 2.0), 9.0, Pyramid(6, False), np.full(18, 40.0), limits, 3, 0.1, "clarabel")
    given = given._replace(formulation="full", warm_start=False, tolerance=1e-7, max_iterations=99, time_limit=1.0)
    found = WholeBodyController(QUADRUPED, [], [], given).settings
    for name, one, other in zip(Settings._fields, given, found, strict=True):
        if name == "joint_limits":
            np.testing.assert_array_equal(one.velocity, other.velocity)
            one, other = one._replace(velocity=None), other._replace(velocity=None)
        np.testing.assert_array_equal(one, other) if name == "effort" else pytest.approx(one) == other
        assert name == "effort" or one == other
    assert WholeBodyController(QUADRUPED, [], [], Settings(joint_limits=None)).settings.joint_limits is None


def test_a_distance_is_held() -> None:
    """Checks that an arm moves around a ball, and that copies of the controller have the same limits."""
    arm, q, v = condyle.robots.arm7(), np.array([0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0]), np.zeros(7)
    data = condyle.Data(arm)
    begin = condyle.frame_placement(arm, data, q, "tool")[:3, 3]
    ball = begin + np.array([0.0, 0.15, 0.03])
    pair = (Geometry(Shape.sphere([0.0] * 3, 0.03), "tool", name="hand"), Geometry(Shape.sphere(ball, 0.08)))
    settings = Settings(distances=DistanceLimits([pair], minimum=0.02))
    tasks = [Task.position("tool"), Task.posture(weight=1e-3)]
    controller = pickle.loads(pickle.dumps(WholeBodyController(arm, [], tasks, settings)))
    given = controller.settings.distances
    assert given is not None and given.minimum == 0.02 and given.pairs[0][0].name == "hand"
    references, nearest = controller.hold(q), np.inf
    references.frames[0].pose[1, 3] += 0.3
    for _ in range(1500):
        command = controller.step(q, v, references).solved()
        q = condyle.integrate(arm, q, 1e-3 * v + 0.5e-6 * command.a)
        v = v + 1e-3 * command.a
        tool = condyle.frame_placement(arm, data, q, "tool")[:3, 3]
        nearest = min(nearest, np.linalg.norm(tool - ball) - 0.11)
    assert nearest > 0.0199 and np.linalg.norm(tool - begin - [0.0, 0.3, 0.0]) < 5e-3
    with pytest.raises(ControllerError, match="`distances.range` is 0"):
        WholeBodyController(arm, [], tasks, Settings(distances=DistanceLimits([pair], range=0.0)))


def test_limits_of_effort() -> None:
    """Checks that commands are within the torque limits if motors are too weak to carry the robot."""
    weak = np.full(18, 5.0)
    controller = WholeBodyController(QUADRUPED, points(), TASKS, Settings(effort=weak))
    command = controller.step(STANDING, np.zeros(18), controller.hold(STANDING))
    assert np.all(np.abs(command.tau) <= weak)
    strong = WholeBodyController(QUADRUPED, points(), TASKS).step(STANDING, np.zeros(18), controller.hold(STANDING))
    assert np.abs(strong.tau).max() > 5.0


def test_references_are_views() -> None:
    controller = WholeBodyController(HUMANOID, CONTACTS["soles"], [Task.pose(CHEST), Task.com()])
    references = controller.hold(upright())
    other = copy.deepcopy(references)
    assert references == other == pickle.loads(pickle.dumps(references))
    references.frames[0].pose[2, 3] += 0.01
    references.posture.q[7:] += 0.1
    references.com.position = references.com.position + np.array([0.0, 0.01, 0.0])
    references.contacts[1].activation = 0.5
    assert references != other and other.contacts[1].activation == 1.0
    v = np.zeros(HUMANOID.nv)
    one, again = controller.step(upright(), v, references), controller.step(upright(), v, references)
    assert np.abs(one.a - again.a).max() < 1e-4 * np.abs(one.a).max()
    assert np.abs(one.a - controller.step(upright(), v, other).a).max() > 0.1
    with pytest.raises(ValueError, match=r"^com.position: expected shape \(3,\), found \(2,\)$"):
        references.com.position = [0.0, 1.0]
    with pytest.raises(ValueError, match=r"^frames\[0\].pose: expected shape \(4, 4\), found \(3, 4\)$"):
        references.frames[0].pose = np.zeros((3, 4))


def test_numbers_that_are_not_finite() -> None:
    controller = WholeBodyController(QUADRUPED, points(), TASKS, Settings(hold_ticks=1))
    references, v = controller.hold(STANDING), np.zeros(18)
    good = controller.step(STANDING, v, references).solved()
    broken = STANDING.copy()
    broken[3] = np.nan
    last = controller.step(broken, v, references)
    assert (last.status, last.source, last.reason) == (
        "not_finite",
        "last_solution",
        "`q[3]` is NaN, which is not finite",
    )
    np.testing.assert_array_equal(last.tau, good.tau)
    safe = controller.step(broken, v, references)
    assert safe.source == "gravity_compensation" and np.isfinite(safe.tau).all()
    with pytest.raises(ControllerError, match=r"`q\[3\]` is NaN"):
        safe.solved()
    references.com.velocity[1] = np.inf
    assert controller.step(STANDING, v, references).reason == "`com[4]` is inf, which is not finite"


def test_what_is_refused_by_name() -> None:
    feet, new = points(), WholeBodyController
    with pytest.raises(condyle.ModelError, match="unknown frame `LF_fot`; nearest is `LF_foot`"):
        new(QUADRUPED, [FrictionContact.point("LF_fot", 0.7)], [])
    with pytest.raises(condyle.ModelError, match="unknown frame `trnk`"):
        new(QUADRUPED, feet, [Task.orientation("trnk")])
    with pytest.raises(ControllerError, match="contact `LF_foot` is listed twice"):
        new(QUADRUPED, [feet[0], feet[0]], [])
    with pytest.raises(ControllerError, match="task `trunk`: there is no contact of this frame"):
        new(QUADRUPED, feet, [Task.contact_force("trunk")])
    with pytest.raises(ControllerError, match="task `com`: weight is -1, but it must be at least 0"):
        new(QUADRUPED, feet, [Task.com(weight=-1.0)])
    with pytest.raises(ControllerError, match="task `com`: priority is 3, but it must be 0, 1 or 2"):
        new(QUADRUPED, feet, [Task.com(priority=3)])
    with pytest.raises(ControllerError, match="contact `LF_foot`: friction is 0, but it must be above 0"):
        new(QUADRUPED, [FrictionContact.point("LF_foot", 0.0)], [])
    with pytest.raises(ControllerError, match="setting `tolerance` is 2"):
        new(QUADRUPED, feet, [], Settings(tolerance=2.0))
    with pytest.raises(ControllerError, match="`effort`: expected 18 numbers, found 3"):
        new(QUADRUPED, feet, [], Settings(effort=[1.0, 2.0, 3.0]))
    with pytest.raises(ValueError, match="backend: expected 'interior_point' or 'clarabel', found 'osqp'"):
        new(QUADRUPED, feet, [], Settings(backend="osqp"))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="friction: expected 'cone' or Pyramid"):
        new(QUADRUPED, feet, [], Settings(friction="round"))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="mask: expected 3 entries, found 2"):
        Task.com(mask=[True, False])
    with pytest.raises(ValueError, match=r"axes: expected 'world', 'local' or \('frame', name\), found 'trunk'"):
        Task.com(axes="trunk")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"gains: expected Gains\(stiffness, damping\)"):
        Task.com(gains=3.0)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"corners: expected shape \(4, 3\), found \(4, 2\)"):
        FrictionContact.surface("LF_foot", 0.7, np.zeros((4, 2)))
    with pytest.raises(ValueError, match="forces: expected 'wrench' or 'corners', found 'both'"):
        FrictionContact.sole("LF_foot", 0.7, [0.2, 0.1], "both")  # type: ignore[arg-type]


def test_wrong_arguments_of_a_step() -> None:
    controller, v = WholeBodyController(QUADRUPED, points(), TASKS), np.zeros(18)
    references = controller.hold(STANDING)
    with pytest.raises(ValueError, match=r"q: expected shape \(19,\), found \(18,\)"):
        controller.step(STANDING[1:], v, references)
    with pytest.raises(ValueError, match=r"v: expected shape \(18,\), found \(17,\)"):
        controller.step(STANDING, v[1:], references)
    with pytest.raises(TypeError, match="references: expected References, found 'int'"):
        controller.step(STANDING, v, 3)  # type: ignore[arg-type]
    other = WholeBodyController(QUADRUPED, points()[:2], TASKS)
    with pytest.raises(ValueError, match="references: expected those of .* 4 contacts, found those of .* 2 contacts"):
        controller.step(STANDING, v, other.hold(STANDING))
    plan = Plan(QUADRUPED, [0.0, 1.0], [np.r_[STANDING, v]] * 2, np.ones((1, 2)))
    with pytest.raises(ValueError, match="plan: expected 4 contacts, found 2"):
        controller.track(plan, 0.0, references)
    arm = condyle.robots.arm7()
    with pytest.raises(ValueError, match="plan: made for another model"):
        controller.track(Plan(arm, [0.0, 1.0], np.zeros((2, 14)), np.zeros((1, 4))), 0.0, references)


def test_plans_from_arrays() -> None:
    x0, v = np.r_[STANDING, np.zeros(18)], np.zeros(18)
    x1 = x0.copy()
    x1[2] -= 0.04
    x0[21] = x1[21] = -0.4  # velocity along the trunk's z axis (m/s)
    touches = np.array([[True] * 4, [False, True, True, True]])
    controls = np.arange(24.0).reshape(2, 12)
    gains = np.zeros((2, 12, 36))
    gains[0, 3, 2] = 100.0
    plan = Plan(QUADRUPED, [0.0, 0.1, 0.2], [x0, x1, x1], touches, controls, gains, fade=0.05)
    again = pickle.loads(pickle.dumps(plan))
    assert repr(plan) == repr(again) == "<condyle.wholebody.Plan of 3 knots and 4 contacts, 0 s to 0.2 s>"
    assert plan.span == again.span == (0.0, 0.2)
    assert [plan.activation(0, t) for t in (0.0, 0.075, 0.15)] == pytest.approx([1.0, 0.5, 0.0])
    lower = STANDING + np.r_[0.0, 0.0, -0.02, np.zeros(16)]
    for one in (plan, again):
        tau = one.feedback(0.0, lower, x0[19:])
        np.testing.assert_allclose(tau, np.r_[np.zeros(6), controls[0] - 2.0 * (np.arange(12) == 3)], atol=1e-9)
    controller = WholeBodyController(QUADRUPED, points(), [*TASKS, Task.position("LF_foot")])
    references = controller.hold(STANDING)
    controller.track(plan, 0.05, references)
    np.testing.assert_allclose(references.posture.q[2], 0.515, atol=1e-12)
    np.testing.assert_allclose(references.com.velocity, [0.0, 0.0, -0.4], atol=1e-12)
    np.testing.assert_allclose(references.frames[0].velocity[:3], [0.0, 0.0, -0.4], atol=1e-12)
    assert references.contacts[0].activation == 1.0
    with pytest.raises(IndexError, match="contact: expected less than 4, found 4"):
        plan.activation(4, 0.0)
    with pytest.raises(ControllerError, match="setting `times` is 0, but it must be finite, and times in their order"):
        Plan(QUADRUPED, [1.0, 0.0], [x0, x1], touches[:1])
    with pytest.raises(ValueError, match=r"states: expected shape \(2, 37\), found \(2, 18\)"):
        Plan(QUADRUPED, [0.0, 1.0], np.zeros((2, 18)), touches[:1])
    with pytest.raises(ValueError, match=r"touches: expected shape \(1, contacts\)"):
        Plan(QUADRUPED, [0.0, 1.0], [x0, x1], touches)
    with pytest.raises(ValueError, match="controls: the plan has none"):
        Plan(QUADRUPED, [0.0, 1.0], [x0, x1], touches[:1]).feedback(0.0, STANDING, v)


def test_plans_of_solutions() -> None:
    """Checks the plan of a solution with an impact: the impact's knot has no controls, and the two knots of the impact
    have the same time.
    """
    feet = {foot: condyle.ContactConstraint(foot, "point", kd=20.0) for foot in FEET}
    x0 = np.r_[STANDING, np.zeros(18)]
    rest = Cost("rest", 1.0, Residual.state(x0))
    stance = ContactDynamics(QUADRUPED, feet, 0.02, [rest, Cost("effort", 1e-2, Residual.control(np.zeros(12)))])
    impact = ImpulseDynamics(QUADRUPED, feet, [rest], damping=1e-9)
    problem = Problem(x0, [stance, impact], [0, 0, 1, 0], FreeDynamics(QUADRUPED, None, [rest]))
    hold = stance.quasi_static(x0)
    solution = Fddp(problem).solve(np.tile(x0, (5, 1)), [hold, hold, np.zeros(0), hold])
    plan = plan_of(QUADRUPED, solution, [0.0, 0.02, 0.04, 0.04, 0.06], np.ones((4, 4)), 0.01)
    for k in (0, 1, 3):
        t = [0.0, 0.02, 0.04, 0.04][k]
        tau = plan.feedback(t, solution.xs[k][:19], solution.xs[k][19:])
        np.testing.assert_allclose(tau[6:], solution.us[k], atol=1e-9)


def test_values() -> None:
    limited = FrictionContact.point("LF_foot", 0.5, [0.0, 0.1, 1.0], "frame", 1.0, 99.0)
    edge = FrictionContact.surface("LF_foot", 0.5, [[0, 0.1, 0], [0, -0.1, 0]], "corners", yaw_friction=0.1)
    tasks = [
        Task.com(5.0),
        Task.pose("trunk", None, Gains.critical(9.0), [True] * 3 + [False] * 3, ("frame", "LF_foot"), 1),
        Task.posture(joints=np.arange(18)),
        Task.contact_force("LF_foot", 2.0, [True] * 6, 2),
    ]
    for value in (
        limited,
        edge,
        *points(),
        *tasks,
        Settings(),
        Gains(1.0, 2.0),
        JointLimits(),
        DistanceLimits([]),
        Pyramid(),
    ):
        again = pickle.loads(pickle.dumps(value))
        assert again == value and repr(again) == repr(value)
    assert limited != points()[0] and tasks[0] != Task.com()
    assert (limited.axes, limited.min_force, limited.max_force, limited.yaw_friction) == ("frame", 1.0, 99.0, None)
    assert limited.corners is None and limited.forces is None and limited.normal[1] == 0.1
    assert edge.forces == "corners" and edge.corners is not None and edge.corners.shape == (2, 3)
    assert (tasks[1].weight, tasks[1].priority, tasks[2].joints[3]) == (10.0, 1, 3.0)
    assert repr(limited) == "<condyle.wholebody.FrictionContact 'LF_foot', point, friction 0.5>"
    assert repr(tasks[1]) == "<condyle.wholebody.Task pose 'trunk', weight 10>"
    controller = WholeBodyController(QUADRUPED, points(), tasks)
    assert repr(controller) == f"<condyle.wholebody.WholeBodyController of '{QUADRUPED.name}', 4 contacts>"
    assert repr(controller.hold(STANDING)) == "<condyle.wholebody.References of 1 frames and 4 contacts>"


def test_two_controllers_in_two_threads() -> None:
    """Checks that two controllers in two threads give the same results as each controller alone."""

    def run(seed: int, out: list[np.ndarray]) -> None:
        controller = WholeBodyController(QUADRUPED, points(), TASKS)
        references: References = controller.hold(STANDING)
        for k in range(200):
            q, v = moving(QUADRUPED, STANDING, 1000 * seed + k)
            out.append(controller.step(q, v, references).solved().tau)

    alone: list[list[np.ndarray]] = [[], []]
    together: list[list[np.ndarray]] = [[], []]
    for seed in (0, 1):
        run(seed, alone[seed])
    threads = [threading.Thread(target=run, args=(seed, together[seed])) for seed in (0, 1)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    np.testing.assert_array_equal(together, alone)


def test_one_controller_in_two_threads() -> None:
    """Checks that only one thread at a time can use a controller: the other thread gets an error, and no command mixes
    the data of two threads.
    """
    controller = WholeBodyController(
        HUMANOID, CONTACTS["soles"], [Task.com(), Task.posture()], Settings(warm_start=False)
    )
    references, v = controller.hold(upright()), np.zeros(HUMANOID.nv)
    expected = controller.step(upright(), v, references).solved().tau
    outcomes: list[Any] = []
    refused: set[str] = set()

    def run() -> None:
        for _ in range(200):
            try:
                outcomes.append(controller.step(upright(), v, references).tau)
            except RuntimeError as error:
                refused.add(str(error))

    threads = [threading.Thread(target=run) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(outcomes) > 1 and refused <= {"controller: in use by another call"}
    for tau in outcomes:
        np.testing.assert_array_equal(tau, expected)
