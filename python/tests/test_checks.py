"""Tests that invalid input raises an error in the call that gets the input, with the argument's name and numbers.
Invalid input never leads to a NaN or a wrong result.
"""

import json
import pickle

import numpy as np
import pytest

import condyle
import condyle.simulation
from condyle import ModelError
from condyle.optimal import (
    Action,
    Activation,
    AugmentedLagrangian,
    ConstrainedAction,
    Cost,
    Fddp,
    FreeDynamics,
    FrictionCone,
    Limit,
    Lqr,
    Problem,
    ProblemError,
    Residual,
    WrenchCone,
)

ARM = condyle.robots.arm7()
X0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
TARGET = [0.4, 0.2, 0.5]


def reach(knots: int = 5) -> tuple[Problem, np.ndarray, np.ndarray]:
    rest = Cost("rest", 0.1, Residual.state(X0))
    point = Cost("reach", 1e3, Residual.frame_translation(ARM, "tool", TARGET))
    knot = FreeDynamics(ARM, 0.05, [rest, Cost("effort", 1e-4, Residual.control(np.zeros(7)))])
    problem = Problem(X0, [knot], [0] * knots, FreeDynamics(ARM, None, [rest, point]))
    return problem, np.tile(X0, (knots + 1, 1)), np.zeros((knots, 7))


def tip(inertia: condyle.Inertia | None = None) -> condyle.Model:
    robot = condyle.ModelBuilder("tip")
    rod = condyle.Inertia.from_com(1.0, [0.0, 0.0, -0.5], 0.1 * np.eye(3))
    hinge = condyle.Joint.revolute([0.0, 1.0, 0.0])
    arm = robot.body("arm", condyle.WORLD, hinge, inertia=rod)
    robot.body("tip", arm, hinge, inertia=inertia)
    return robot.build()


def test_other_inertias_are_judged_as_a_build_judges_them() -> None:
    sick = tip()
    ball = condyle.Inertia.from_com(0.3, np.zeros(3), 0.01 * np.eye(3))
    cured = sick.with_inertias([*sick.inertias[:2], ball])
    assert sick.singular_joints == [2] and cured.singular_joints == [] and cured.warnings == []
    zero = np.zeros(2)
    assert np.isfinite(condyle.aba(cured, condyle.Data(cured), zero, zero, zero)).all()
    again = cured.with_inertias(sick.inertias)
    for model in (again, pickle.loads(pickle.dumps(again))):
        assert model.warnings == sick.warnings and model.singular_joints == [2]
        with pytest.raises(ModelError, match="joint `tip` moves nothing"):
            condyle.aba(model, condyle.Data(model), zero, zero, zero)
    inertias = ARM.inertias
    for bad in (-1.0, np.nan, np.inf):
        changed = [*inertias[:3], inertias[3]._replace(mass=bad), *inertias[4:]]
        with pytest.raises(ModelError, match=rf"^body `link3`: mass is {str(bad).replace('nan', 'NaN').rstrip('.0')}"):
            ARM.with_inertias(changed)


def test_numbers_of_joints_and_gravity_are_checked() -> None:
    with pytest.raises(ModelError, match=r"^gravity: \(0, NaN, 0\) m/s² is not finite$"):
        ARM.with_gravity([0.0, np.nan, 0.0])
    with pytest.raises(
        ModelError, match=r"^joint `joint3`: armature is -0\.1, expected a finite number of at least 0$"
    ):
        ARM.with_armature([0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.0])
    for name in ("damping", "friction", "armature"):
        robot = condyle.ModelBuilder("r")
        robot.body("b", condyle.WORLD, condyle.Joint.revolute([0, 0, 1]), **{name: -1.0})
        with pytest.raises(ModelError, match=f"^joint `b`: {name} is -1, expected a finite number of at least 0$"):
            robot.build()
    said = {"velocity": "limit of velocity is -1", "effort": "lower limit of effort 1 is above upper limit -1"}
    for name, what in said.items():
        robot = condyle.ModelBuilder("r")
        robot.body("b", condyle.WORLD, condyle.Joint.revolute([0, 0, 1]), **{name: -1.0})
        with pytest.raises(ModelError, match=f"^joint `b`: {what}"):
            robot.build()
    with pytest.raises(ModelError, match=r"^joint `joint2`: q\[1\] is NaN"):
        ARM.lock(["joint2"], [0.0, np.nan, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(IndexError, match="^joints: expected names, found 1: the model has none$"):
        condyle.ModelBuilder("nothing").build().lock([1], [])
    with pytest.raises(IndexError, match="found 0: the model has none"):
        Residual.frame_translation(condyle.ModelBuilder("nothing").build(), 0, TARGET)


def test_frames_travel_by_name() -> None:
    point = Cost("point", 1.0, Residual.frame_translation(ARM, "tool", TARGET))
    # in a robot with more frames, in another order, the frame with the same name has another index
    two = condyle.ModelBuilder("two arms")
    two.append(condyle.WORLD, None, ARM, "left_")
    two.append(condyle.WORLD, None, ARM)
    two = two.build()
    assert two.frame("tool") != ARM.frame("tool")
    x0, there = np.zeros(28), condyle.frame_placement(two, condyle.Data(two), np.zeros(14), "tool")
    reached = Cost("point", 1.0, Residual.frame_translation(ARM, "tool", there[:3, 3]))
    problem = Problem(x0, [FreeDynamics(two, 0.1, [reached])], [0], FreeDynamics(two, None, []))
    assert Fddp(problem, max_iterations=0).solve(np.zeros((2, 28)), np.zeros((1, 14))).cost == 0.0
    data = json.loads(problem.to_json())
    frame = data["knots"][0]["costs"][0]["residual"]["frame_translation"]["frame"]
    assert frame == {"name": "tool", "kind": "Link"}
    # for a robot without this frame, the problem is an error
    quadruped = condyle.robots.quadruped()
    message = r"^cost `point`: unknown frame `tool`; no frame has a similar name$"
    with pytest.raises(ProblemError, match=message):
        FreeDynamics(quadruped, 0.1, [point])
    with pytest.raises(ProblemError, match=message.replace("name$", r"name \(knot 2\)$")):
        FreeDynamics(quadruped, 0.1, [], costs_at={2: [point]})
    limit = Limit("point", point_residual := Residual.frame_translation(ARM, ARM.frame("tool"), TARGET))
    assert point_residual == Residual.frame_translation(ARM, "tool", TARGET)
    with pytest.raises(ProblemError, match=message.replace("cost", "limit")):
        FreeDynamics(quadruped, None, [], limits=[limit])
    x = np.r_[condyle.neutral(quadruped), np.zeros(18)]
    standing = Problem(x, [FreeDynamics(quadruped, 0.1, [])], [0], FreeDynamics(quadruped, None, []))
    with pytest.raises(ProblemError, match=message.replace("name$", r"name \(knot 0\)$")):
        standing.set_costs(0, [point])


def test_plans_know_the_robot_that_they_were_made_for() -> None:
    def robot(length: float) -> condyle.Model:
        builder, body = condyle.ModelBuilder("arm"), condyle.WORLD
        for k in range(3):
            there = np.eye(4)
            there[2, 3] = length
            rod = condyle.Inertia.from_com(1.0, [0.0, 0.0, 0.5], 0.1 * np.eye(3))
            body = builder.body(f"b{k}", body, condyle.Joint.revolute([0, 1, 0]), there, rod)
        builder.frame("end", body)
        return builder.build()

    one, other, zero = robot(1.0), robot(2.0), np.full(3, 0.1)
    contacts = condyle.ConstraintSet(one, [condyle.ContactConstraint("end", "point")])
    divided = condyle.DivideConquer(one, 1)
    message = r"made for another model \('arm'\), not for this 'arm', whose joints or frames are elsewhere$"
    with pytest.raises(ValueError, match=f"^constraints: {message}"):
        condyle.constrained_dynamics(other, condyle.Data(other), contacts, zero, zero, zero)
    with pytest.raises(ValueError, match=f"^DivideConquer: {message}"):
        divided.aba(other, zero, zero, zero)
    for same in (one.with_gravity([0, 0, -1.6]), one.with_armature([0.1] * 3), pickle.loads(pickle.dumps(one))):
        condyle.constrained_dynamics(same, condyle.Data(same), contacts, zero, zero, zero)
        divided.aba(same, zero, zero, zero)


def test_targets_that_are_none_are_refused() -> None:
    quadruped = condyle.robots.quadruped()
    stance = condyle.ConstraintSet(quadruped, [condyle.ContactConstraint("LF_foot", "rigid")])
    for name in ("velocity", "acceleration"):
        with pytest.raises(ModelError, match=r"^constraint 0: its target is not finite$"):
            stance.set_target(0, **{name: [0.0, np.nan, 0.0, 0.0, 0.0, 0.0]})
    nowhere = np.eye(4)
    nowhere[:3, 3] = np.nan
    for bad in (nowhere, np.diag([2.0, 1.0, 1.0, 1.0])):
        with pytest.raises(ModelError, match="^constraint 0: its target"):
            stance.set_target(0, placement=bad)
        with pytest.raises(ModelError, match="^constraint 0: its target"):
            condyle.ConstraintSet(quadruped, [condyle.ContactConstraint("LF_foot", "rigid", placement=bad)])
    q, zero = condyle.neutral(quadruped), np.zeros(18)
    solved = condyle.constrained_dynamics(quadruped, condyle.Data(quadruped), stance, q, zero, zero)
    assert np.isfinite(solved.lambda_).all()
    for iterations in (0, 10**9):
        with pytest.raises(ValueError, match=f"^iterations: expected at (least 1|most 10000), found {iterations}$"):
            condyle.ConstraintSet(quadruped, [condyle.ContactConstraint("LF_foot", "point")], iterations=iterations)
    none = "is no rotation: expected three unit vectors at right angles$"
    pose = Cost("pose", 1.0, Residual.frame_placement(ARM, "tool", np.diag([2.0, 1.0, 1.0, 1.0])))
    axes = Cost("axes", 1.0, Residual.frame_rotation(ARM, "tool", -np.eye(3)))
    for cost in (pose, axes):
        with pytest.raises(ProblemError, match=none):
            FreeDynamics(ARM, 0.1, [cost])
    mirrored = np.r_[q, zero]
    mirrored[6] = 3.0
    with pytest.raises(
        ProblemError, match="^cost `rest`: its reference: joint `root_joint`: its rotation, q.3..7., has the"
    ):
        FreeDynamics(quadruped, 0.1, [Cost("rest", 1.0, Residual.state(mirrored))])


def test_weights_cones_and_settings_are_checked() -> None:
    problem, xs, us = reach()
    before = problem.to_json()
    for bad in (-1.0, np.nan, np.inf, -np.inf):
        message = "^cost `reach`: its weight is .*, expected a finite number of at least 0$"
        with pytest.raises(ProblemError, match=message):
            problem.set_weight("reach", bad)
        with pytest.raises(ProblemError, match=message):
            FreeDynamics(ARM, 0.05, [Cost("reach", bad, Residual.state(X0))])
    assert problem.to_json() == before
    with pytest.raises(ProblemError, match="^cost `reach`: its weight is -1000, expected"):
        Problem.from_json(before.replace('"weight":1000.0', '"weight":-1000.0'))
    with pytest.raises(KeyError):
        problem.set_weight("rest of it", 1.0)
    for weights in ([-1.0] * 7, [np.nan] * 7):
        cost = Cost("effort", 1.0, Residual.control(np.zeros(7)), Activation.weighted(weights))
        message = r"^cost `effort`: its weight 0 is .*, expected a finite number of at least 0 \(knot 0\)$"
        with pytest.raises(ProblemError, match=message):
            problem.set_costs(0, [cost])
    for mu in (-0.1, np.nan):
        with pytest.raises(ProblemError, match="^cone: its friction is .*, but it must be at least 0$"):
            FrictionCone(mu)
    for facets in (0, 3):
        with pytest.raises(ProblemError, match=f"^cone: its cone has {facets} sides, but they must be even"):
            FrictionCone(0.5, facets=facets)
    with pytest.raises(ProblemError, match="rotation is none"):
        FrictionCone(0.5, rotation=np.zeros((3, 3)))
    with pytest.raises(ProblemError, match="^cone: its sides are 0.1 and NaN m"):
        WrenchCone(FrictionCone(0.5), [0.1, np.nan])
    for name, bad in [("tolerance", -1.0), ("tolerance", np.nan), ("regularisation_max", 0.0)]:
        with pytest.raises(ProblemError, match=f"^setting `{name}` is "):
            Fddp(problem, **{name: bad}).solve(xs, us)
    with pytest.raises(ProblemError, match="^setting `max_solves` is 0, but it must be at least 1$"):
        AugmentedLagrangian(problem, max_solves=0).solve(xs, us)
    for dt in (0.0, -0.1, np.nan, np.inf):
        with pytest.raises(ProblemError, match="its duration must be above 0"):
            FreeDynamics(ARM, dt, [])


def test_steps_of_a_simulation_are_numbers() -> None:
    for dt in (0.0, -1e-3, np.nan, np.inf):
        with pytest.raises(ValueError, match="^dt: expected a finite number above 0, found"):
            condyle.simulation.Simulation(ARM, dt=dt)
    with pytest.raises(ValueError, match="^tolerance: expected a finite number of at least 0, found NaN$"):
        condyle.simulation.Simulation(ARM, tolerance=np.nan)
    quadruped = condyle.robots.quadruped()
    simulation = condyle.simulation.Simulation(quadruped)
    q, v = condyle.neutral(quadruped), np.zeros(18)
    for bad, said in [(0.0, "its rotation, q.3..7., has the length 0"), (np.nan, "q.6. is NaN")]:
        with pytest.raises(ModelError, match=f"^joint `root_joint`: {said}"):
            simulation.set_state(np.where(np.arange(19) == 6, bad, q), v)
    with pytest.raises(ValueError, match="^v: expected finite numbers, found NaN at 2$"):
        simulation.set_state(q, np.where(np.arange(18) == 2, np.nan, v))
    assert simulation.step(v) == "done"


def test_states_are_states() -> None:
    quadruped = condyle.robots.quadruped()
    x0 = np.r_[condyle.neutral(quadruped), np.zeros(18)]
    bad = x0.copy()
    bad[3:7] = 0.0
    knot, end = FreeDynamics(quadruped, 0.01, []), FreeDynamics(quadruped, None, [])
    message = r"^`{}`, knot {}: joint `root_joint`: its rotation, q\[3..7\], has the length 0, expected 1$"
    with pytest.raises(ProblemError, match=message.format("x0", 0)):
        Problem(bad, [knot], [0], end)
    problem = Problem(x0, [knot], [0], end)
    with pytest.raises(ProblemError, match=message.format("x0", 0)):
        problem.set_x0(bad)
    with pytest.raises(ProblemError, match=message.format("xs", 1)):
        Fddp(problem).solve([x0, bad], np.zeros((1, 12)))


def test_only_the_end_has_no_next_state() -> None:
    end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
    lost = Action(1, 1, lambda t, x, u: (None, 0.5 * u @ u))
    for knot in (lost, ConstrainedAction(lost, 1, lambda t, x, u: x)):
        problem = Problem([1.0], [knot], [0] * 3, end)
        with pytest.raises(ValueError, match="^calc of knot 0: the next state: expected 1 numbers, found None$"):
            problem.rollout(np.zeros((3, 1)))
        with pytest.raises(ValueError, match="^calc of knot 0: the next state: expected 1 numbers, found None$"):
            Fddp(problem).solve(np.zeros((4, 1)), np.zeros((3, 1)))


def test_sizes_beyond_memory_are_refused() -> None:
    with pytest.raises(ValueError, match="^nx: expected at most 4096, found 1000000000$"):
        Action(10**9, 1, lambda t, x, u: (x, 0.0))
    with pytest.raises(ValueError, match="^nu: expected at most 4096, found 1000000000$"):
        Action(1, 10**9, lambda t, x, u: (x, 0.0))
    with pytest.raises(ValueError, match="^size: expected at most 4096, found 1000000000$"):
        ConstrainedAction(Action(1, 1, lambda t, x, u: (x, 0.0)), 10**9, lambda t, x, u: x)
    with pytest.raises(ValueError, match="^A, rows: expected at most 4096, found 1000000$"):
        Lqr(np.empty((10**6, 0)))
    with pytest.raises(ValueError, match="^R, rows, or B, columns: expected at most 4096, found 100000$"):
        Lqr([[1.0]], R=np.empty((10**5, 0)))
    with pytest.raises(ProblemError, match="^knot: 1000000000 is more than the limit of 1048576$"):
        FreeDynamics(ARM, 0.1, [], costs_at={10**9: []})
    with pytest.raises(ProblemError, match="^knot: 1000000000 is more than the limit of 1048576$"):
        FreeDynamics(ARM, 0.1, [], limits_at={10**9: []})
    text = reach()[0].to_json()
    far = text.replace('"costs":', '"costs_at":{"1000000000":[]},"costs":', 1)
    with pytest.raises(ProblemError, match="^knot: 1000000000 is more than the limit of 1048576$"):
        Problem.from_json(far)
    for rows, columns in ((7, 2**63), (8, 2**61), (2**64 - 1, 2**64 - 1), (7, 3)):
        data = json.loads(text)
        data["knots"][0]["dynamics"]["free"]["actuation"] = [[], rows, columns]
        with pytest.raises(ProblemError, match=f"a matrix of {rows} × {columns} with 0 numbers"):
            Problem.from_json(json.dumps(data))


@pytest.mark.parametrize("solver", [Fddp, AugmentedLagrangian])
def test_a_solve_that_blows_up_returns_its_best_iterate(solver: type) -> None:
    effort = Cost("effort", 1e-6, Residual.control(np.zeros(7)))
    point = Cost("point", 1e2, Residual.frame_translation(ARM, "tool", TARGET))
    knot, end = FreeDynamics(ARM, 0.02, [effort]), FreeDynamics(ARM, None, [point])
    solver = solver(Problem(X0, [knot], [0] * 50, end))
    solution = solver.solve(np.tile(X0, (51, 1)), np.zeros((50, 7)))
    assert solution.status == "not_finite" and solution.trace[-1].cost > 1e10
    assert solution.cost == solution.trace[-2].cost < 10.0 and solution.gap == solution.trace[-1].gap
    assert np.isfinite(solution.K).all() and np.isfinite(solution.k).all()
    again = solver.resume()
    assert again.gap <= solution.gap and np.isfinite(again.cost)
    if isinstance(solver, AugmentedLagrangian):
        assert np.isfinite([solver.outcome.primal, solver.outcome.dual, solver.outcome.cost]).all()
