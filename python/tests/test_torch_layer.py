"""Tests of `condyle.torch.ProblemLayer`: gradients, warm starts, types and errors."""

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Activation,
    ContactDynamics,
    Cost,
    FreeDynamics,
    ImpulseDynamics,
    InteriorPoint,
    Limit,
    Problem,
    ProblemError,
    Residual,
    Sensitivity,
)

torch = pytest.importorskip("torch")

import condyle.torch  # noqa: E402
from condyle.torch import ProblemLayer  # noqa: E402

KNOTS = 8
ARM = condyle.robots.arm7()
X0 = np.r_[0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2, np.zeros(7)]
GOAL = np.array([0.3, 0.3, 0.5])
X = torch.tensor(X0)
KINDS = (torch.float64, torch.float32)


def arm_problem(bound: float = 26.0) -> Problem:
    rest = Cost("rest", 0.2, Residual.state(X0), Activation.weighted(np.r_[np.ones(7), 0.3 * np.ones(7)]))
    effort = Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    reach = Cost("reach", 20.0, Residual.frame_translation(ARM, "tool", GOAL))
    bounds = {"lower": np.full(7, -bound), "upper": np.full(7, bound)}
    knot = FreeDynamics(ARM, 0.05, [rest, effort, reach], **bounds)
    return Problem(X0, [knot], [0] * KNOTS, FreeDynamics(ARM, None, [rest, reach]))


ALONG = [torch.tensor(np.random.default_rng(0).standard_normal((3, 20, n))) for n in (20, 8)]


def loss(xs: Any, us: Any) -> Any:
    """Returns three numbers, about 1, that depend nonlinearly on all states and controls."""
    a, b = (along[:, : y.shape[-2], : y.shape[-1]] for along, y in zip(ALONG, (xs, us), strict=True))
    return torch.stack(
        [1e-2 * (xs.sin() * i).sum((-1, -2)) + 1e-3 * (us * j).sum((-1, -2)) for i, j in zip(a, b, strict=True)]
    )


def check(function: Any, *values: Any, step: float = 5e-5, tolerance: float = 1e-5) -> None:
    assert torch.autograd.gradcheck(function, values, eps=step, atol=tolerance, rtol=tolerance)


def parameter(values: Any) -> Any:
    return torch.tensor(values, dtype=torch.float64, requires_grad=True)


def test_gradients_equal_differences_with_active_bounds() -> None:
    layer = ProblemLayer(arm_problem(), ["x0", "target/reach", "weight/reach", "entry_weights/rest"])
    weights = np.r_[np.ones(7), 0.3 * np.ones(7)]
    values = [parameter(v) for v in (X0, GOAL, 20.0, weights)]
    xs, us = layer(*values)
    assert (us.abs() == 26.0).any()
    xs.sum().backward()
    assert layer.reports[0].strict_complementarity and layer.reports[0].active_controls > 0
    scales = [1.0, 1.0, 20.0, 1.0]  # so that one step suits all
    for k, scale in enumerate(scales):
        fixed = [v.detach() for v in values]

        def function(p: Any, k: int = k, scale: float = scale, fixed: Any = fixed) -> Any:
            return loss(*layer(*fixed[:k], scale * p, *fixed[k + 1 :]))

        check(function, (fixed[k] / scale).requires_grad_())


def test_parameters_by_knot() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach", "weight/rest"], by_knot=["target/reach", "weight/rest"])
    goals = torch.tensor(GOAL) + 0.02 * torch.arange(KNOTS + 1).double()[:, None]
    weights = torch.linspace(0.1, 0.3, KNOTS + 1).double()
    check(lambda p: loss(*layer(p, weights)), goals.clone().requires_grad_())
    check(lambda p: loss(*layer(goals, p)), weights.clone().requires_grad_())
    shared = ProblemLayer(arm_problem(), ["target/reach"])
    goal, rows = parameter(GOAL), torch.tensor(GOAL).repeat(KNOTS + 1, 1).requires_grad_()
    loss(*shared(goal))[0].backward()
    loss(*layer(rows, torch.full((KNOTS + 1,), 0.2).double()))[0].backward()
    assert torch.allclose(rows.grad.sum(0), goal.grad, rtol=1e-5, atol=1e-6)


def flying_problem() -> tuple[condyle.Model, Problem, Any]:
    """Returns a robot that flies, with a continuous joint, its problem, and the initial state."""
    builder = condyle.ModelBuilder("flyer")
    inertia = condyle.Inertia.from_com(1.2, [0.01, 0.02, -0.01], np.diag([0.02, 0.03, 0.04]))
    body = builder.body("body", condyle.WORLD, condyle.Joint.free_flyer(), np.eye(4), inertia)
    at = np.eye(4)
    at[:3, 3] = [0.0, 0.0, 0.1]
    end = builder.body("wheel", body, condyle.Joint.continuous([0, 0.6, 0.8]), at, inertia)
    builder.frame("tip", end, at)
    builder.frame("middle", body, at)
    robot = builder.build()
    x0 = np.r_[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, np.zeros(7)]
    rest = Cost("rest", 0.5, Residual.state(x0))
    pose = Cost("pose", 5.0, Residual.frame_placement(robot, "tip", np.eye(4)))
    turn = Cost("turn", 3.0, Residual.frame_rotation(robot, "middle", np.eye(3)))
    effort = Cost("effort", 1e-2, Residual.control(np.zeros(7)))
    knot = FreeDynamics(robot, 0.05, [rest, pose, turn, effort], actuation=np.eye(7))
    return robot, Problem(x0, [knot], [0] * 6, FreeDynamics(robot, None, [rest, pose])), x0


def turned(angles: Any) -> Any:
    """Returns the rotation exp([a]ₓ)."""
    x, y, z = angles.unbind(-1)
    zero = torch.zeros_like(x)
    rows = [torch.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return torch.linalg.matrix_exp(torch.stack(rows, -2))


def test_gradients_of_quaternions_rotations_and_placements() -> None:
    """Differentiates with respect to all numbers of a state, of any length, and with respect to poses."""
    robot, problem, x0 = flying_problem()
    names = ["x0", "target/pose", "target/turn", "target/rest"]
    layer = ProblemLayer(problem, names, robot=robot)
    start = torch.tensor(x0)
    start[3:9] = torch.tensor([0.3, -0.4, 0.2, 1.7, 1.4, 0.5])  # not of length 1
    start[9:] = 0.1
    at, R, rest = torch.tensor([0.2, 0.1, 0.9]).double(), torch.eye(3).double(), torch.tensor(x0)

    def pose(angles: Any) -> Any:
        top = torch.cat([turned(angles), at[:, None] + turned(angles)[:, :1]], -1)
        return torch.cat([top, torch.tensor([[0.0, 0.0, 0.0, 1.0]]).double()])

    angles = torch.tensor([0.2, -0.3, 0.1]).double()
    check(lambda x: loss(*layer(x, pose(angles), R, rest)), start.clone().requires_grad_())
    check(lambda a: loss(*layer(start, pose(a), R, rest)), angles.clone().requires_grad_())
    check(lambda a: loss(*layer(start, pose(angles), turned(a), rest)), angles.clone().requires_grad_())
    check(lambda x: loss(*layer(start, pose(angles), R, x)), (1.3 * rest).requires_grad_())
    with pytest.raises(ValueError, match="robot: a state has 16 numbers and 14 in the tangent space, expected"):
        ProblemLayer(problem, names)
    with pytest.raises(ValueError, match="robot: expected the robot of the problem, .* found 'arm7'"):
        ProblemLayer(problem, names, robot=ARM)


def test_a_quadruped_in_contact_with_an_impact() -> None:
    """Differentiates through contacts, and through a knot without controls, with respect to all numbers of a state."""
    robot = condyle.robots.quadruped()
    q = condyle.neutral(robot)
    q[7:] = np.tile([0.0, 0.7, -1.4], 4)
    x0 = np.r_[q, np.zeros(robot.nv)]
    x0[2] = 0.4
    feet = {
        name: condyle.ContactConstraint(name, "point", kd=20.0) for name in ("LF_foot", "RF_foot", "LH_foot", "RH_foot")
    }
    rest = Cost("rest", 1.0, Residual.state(x0), Activation.weighted(np.r_[np.full(18, 5.0), np.full(18, 0.1)]))
    com = Cost("com", 20.0, Residual.center_of_mass([0.02, 0.0, 0.4]))

    def effort(n: int) -> Cost:
        return Cost("effort", 1e-2, Residual.control(np.zeros(n)))

    models = [
        FreeDynamics(robot, 0.02, [rest, effort(12)]),
        ImpulseDynamics(robot, feet, [rest]),
        ContactDynamics(robot, feet, 0.02, [rest, com, effort(12)]),
    ]
    problem = Problem(x0, models, [0, 0, 1, 2, 2, 2], FreeDynamics(robot, None, [rest]))
    layer = ProblemLayer(problem, ["x0", "target/com", "target/rest"], robot=robot)
    start = torch.tensor(x0)
    start[3:7] = torch.tensor([0.05, -0.08, 0.02, 1.1])
    goal, rest_at = torch.tensor([0.02, 0.0, 0.4]).double(), torch.tensor(x0)
    xs, us = layer(start, goal, rest_at)
    assert us.shape == (6, 12) and not us[2].any() and us[1].any()  # the impact has no controls
    a, b = (torch.tensor(np.random.default_rng(1).standard_normal(y.shape)) for y in (xs, us))

    def value(xs: Any, us: Any) -> Any:
        return 1e-2 * (xs.sin() * a).sum() + 1e-3 * (us * b).sum()

    check(lambda x: value(*layer(x, goal, rest_at)), start.clone().requires_grad_())
    check(lambda x: value(*layer(start, x, rest_at)), goal.clone().requires_grad_())
    check(lambda x: value(*layer(start, goal, x)), rest_at.clone().requires_grad_())


def test_batches_equal_single_problems() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach", "weight/reach"])
    goals = torch.tensor(GOAL) + 0.05 * torch.randn(2, 2, 3, generator=torch.Generator().manual_seed(1)).double()
    weight = parameter(20.0)
    goals.requires_grad_()
    xs, us = layer(goals, weight)
    assert xs.shape == (2, 2, KNOTS + 1, 14) and us.shape == (2, 2, KNOTS, 7)
    by_goals, by_weight = torch.autograd.grad(loss(xs, us)[0].sum(), [goals, weight])
    single, total = ProblemLayer(arm_problem(), ["target/reach", "weight/reach"]), 0.0
    for i in np.ndindex(2, 2):
        goal = goals[i].detach().requires_grad_()
        found = single(goal, weight)
        slopes = torch.autograd.grad(loss(*found)[0], [goal, weight])
        assert torch.allclose(found[0], xs[i], atol=1e-7)
        assert torch.allclose(slopes[0], by_goals[i], rtol=1e-6, atol=1e-6)
        total += slopes[1]
    assert torch.allclose(total, by_weight, rtol=1e-6, atol=1e-7)
    assert layer(torch.zeros(0, 3), torch.tensor(20.0))[0].shape == (0, KNOTS + 1, 14)


def test_transformations_equal_the_forward_method() -> None:
    problem = arm_problem()
    layer = ProblemLayer(problem, ["target/reach"])
    goals = torch.tensor(np.stack([GOAL, GOAL + 0.05]))
    by_xs, by_us = torch.func.jacrev(layer)(goals[1])
    expected = Sensitivity(layer._solves.solver).jacobian("target/reach")
    assert np.allclose(by_xs, expected[0], atol=1e-7) and np.allclose(by_us, expected[1], atol=1e-5)
    mapped = torch.func.vmap(torch.func.grad(lambda goal: loss(*layer(goal))[0]))(goals)
    goals.requires_grad_()
    loss(*layer(goals))[0].sum().backward()
    assert torch.allclose(mapped, goals.grad, rtol=1e-6, atol=1e-6)


def test_warm_starts_are_kept() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["target/reach"])
    goals = torch.tensor(np.stack([GOAL, GOAL - 0.1]))
    layer(goals, rows=["a", "b"])
    first = layer.iterations
    assert layer.statuses == ["converged", "converged"]
    layer(goals, rows=torch.tensor([5, 7]))  # numbers are equal names in tensors and lists
    layer(goals + 1e-3, rows=[5, 7])
    assert all(a < b for a, b in zip(layer.iterations, first, strict=True))
    layer(goals.flip(0) + 1e-3, rows=["b", "a"])  # the rows keep their solutions in any order
    second = layer.iterations
    assert all(a < b for a, b in zip(second, reversed(first), strict=True))
    layer.forget()
    layer(goals, rows=["a", "b"])
    assert layer.iterations == first
    near = ProblemLayer(arm_problem(1e3), ["target/reach"], start=[a[0].numpy() for a in layer(goals)])
    near(goals[0])
    assert near.iterations[0] < first[0]


def test_gradients_after_other_calls() -> None:
    """Differentiates two calls at the end, when the layer has already solved other problems."""
    layer = ProblemLayer(arm_problem(1e3), ["target/reach"])
    goals = [(torch.tensor(GOAL, dtype=kind) + 0.03 * k).requires_grad_() for k in range(2) for kind in KINDS]
    values = [loss(*layer(goal))[0] for goal in goals]
    for goal, value in zip(goals, values, strict=True):
        (slope,) = torch.autograd.grad(value, goal)
        tolerance = 1e-5 if goal.dtype == torch.float32 else 1e-7
        again = goal.detach().double().requires_grad_()
        loss(*ProblemLayer(arm_problem(1e3), ["target/reach"])(again))[0].backward()
        assert torch.allclose(slope.double(), again.grad, rtol=1e-5, atol=tolerance)


def test_types() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach", "weight/reach"])
    goal, weight = torch.tensor(GOAL).float().requires_grad_(), torch.tensor(20.0, requires_grad=True)
    xs, us = layer(goal, weight)
    assert xs.dtype == us.dtype == torch.float32
    us.sum().backward()
    assert goal.grad.dtype == weight.grad.dtype == torch.float32
    assert layer(goal.double(), weight)[0].dtype == torch.float64


def cart(end: float) -> Problem:
    builder = condyle.ModelBuilder("cart")
    inertia = condyle.Inertia.from_com(2.0, np.zeros(3), 0.1 * np.eye(3))
    builder.body("cart", condyle.WORLD, condyle.Joint.prismatic([1, 0, 0]), np.eye(4), inertia)
    model = builder.build()
    costs = [Cost("effort", 1.0, Residual.control([0.0])), Cost("place", 1.0, Residual.state([0.1, 0.0]))]
    last = FreeDynamics(model, None, [], limits=[Limit("end", Residual.state([end, 0.0]))])
    return Problem(np.zeros(2), [FreeDynamics(model, 0.1, costs)], [0] * 10, last)


def test_limits() -> None:
    layer = ProblemLayer(cart(0.5), ["x0", "weight/place"], solver=InteriorPoint, tolerance=1e-10)
    x0, weight = parameter([[0.1, 0.2], [0.0, 0.0]]), parameter([1.0, 2.0])
    xs, _ = layer(x0, weight)
    assert torch.allclose(xs[:, -1], torch.tensor([0.5, 0.0]).double(), atol=1e-7)
    check(lambda x0, weight: loss(*layer(x0, weight))[0], x0, weight)


def test_rows_that_fail() -> None:
    goals = torch.tensor(np.stack([GOAL, GOAL, GOAL]))
    goals[1, 0] = torch.nan
    problem = arm_problem()
    with pytest.raises(ProblemError, match=r"row 1: .*nan|row 1: .*not finite|row 1: .*NaN"):
        ProblemLayer(problem, ["target/reach"])(goals)
    short = ProblemLayer(problem, ["target/reach"], max_iterations=1)
    with pytest.raises(ProblemError, match="row 0, 0: the solve ended with 'max_iterations', expected 'converged'"):
        short(torch.tensor(GOAL).expand(2, 1, 3))

    layer = ProblemLayer(problem, ["target/reach"], on_failure="nan")
    goals.requires_grad_()
    xs, us = layer(goals)
    assert xs[1].isnan().all() and us[1].isnan().all() and xs[[0, 2]].isfinite().all()
    assert layer.statuses == ["converged", "error", "converged"]
    (slope,) = torch.autograd.grad(us[[0, 2]].sum(), goals, retain_graph=True)
    assert slope.isfinite().all() and not slope[1].any() and slope[0].any()
    (slope,) = torch.autograd.grad(us.sum(), goals)
    assert slope[1].isnan().all() and slope[[0, 2]].isfinite().all()


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda layer, goal: layer(goal), TypeError, "expected 2 arguments (target/reach, x0), found 1"),
        (lambda layer, goal: layer(goal[:2], X), ValueError, "target/reach: expected shape (..., 3), found (2,)"),
        (lambda layer, goal: layer(goal.int(), X), TypeError, "target/reach: expected float32 or float64, found int32"),
        (
            lambda layer, goal: layer(goal.to("meta"), X),
            ValueError,
            "target/reach: expected a tensor on the CPU, where Condyle computes, found device meta; copy it by .cpu()",
        ),
        (
            lambda layer, goal: layer(goal.expand(2, 3), X.expand(3, 14)),
            ValueError,
            "expected batches that broadcast, found target/reach (2,), x0 (3,)",
        ),
        (
            lambda layer, goal: layer(goal, X, rows=[0, 1]),
            ValueError,
            "rows: expected 1 names, one for each problem, found 2",
        ),
    ],
)
def test_errors_of_a_call(call: Any, error: type[Exception], message: str) -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach", "x0"])
    with pytest.raises(error) as found:
        call(layer, torch.tensor(GOAL))
    assert str(found.value) == message


def test_errors_of_construction() -> None:
    problem = arm_problem()
    with pytest.raises(ValueError, match="parameters: expected 'x0', .*, or a name in own, found 'mass'"):
        ProblemLayer(problem, ["mass"])
    with pytest.raises(KeyError, match="no knot has a cost 'grasp'"):
        ProblemLayer(problem, ["target/grasp"])
    with pytest.raises(ValueError, match="parameters: expected different names, at least one, found"):
        ProblemLayer(problem, ["x0", "x0"])
    with pytest.raises(ValueError, match=r"by_knot: expected names in parameters, found \['target/rest'\]"):
        ProblemLayer(problem, ["x0"], by_knot=["target/rest"])
    with pytest.raises(ValueError, match="on_failure: expected 'raise' or 'nan', found 'skip'"):
        ProblemLayer(problem, ["x0"], on_failure="skip")
    with pytest.raises(ValueError, match="curvature: expected 'exact', 'dynamics' or 'gauss_newton', found 'full'"):
        ProblemLayer(problem, ["x0"], curvature="full")


def test_a_second_differentiation_is_an_error() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach"])
    goal = parameter(GOAL)
    (slope,) = torch.autograd.grad(layer(goal)[1].sum(), goal, create_graph=True)
    with pytest.raises(NotImplementedError, match="ProblemLayer: second derivatives of a solution do not exist"):
        slope.sum().backward()


def test_learning_of_weights(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / "examples"))
    example = importlib.import_module("learn_weights")
    report = example.run(motions=8)
    expert = [example.EXPERT[name] for name in example.NAMES[:3]]  # noise hides the fourth weight
    assert np.allclose(report.weights[-1, :3], expert, rtol=0.1)
    assert report.losses[-1] < 2.2 and report.losses[0] > 1e3  # noise alone has the loss 2
    before, after = report.errors
    assert after < 0.01 * before
