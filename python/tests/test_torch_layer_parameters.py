"""Tests of `condyle.torch.ProblemLayer`: parameters of all kinds, batches, copies, threads, and arguments."""

import copy
import pickle
import threading
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.optimal import (
    Action,
    Activation,
    ContactDynamics,
    Cost,
    Fddp,
    FreeDynamics,
    ImpulseDynamics,
    InteriorPoint,
    Problem,
    Residual,
)

torch = pytest.importorskip("torch")

from test_torch_layer import ARM, GOAL, KNOTS, X0, arm_problem, check, flying_problem, loss, parameter  # noqa: E402

from condyle.torch import ProblemLayer  # noqa: E402

REACH = torch.tensor(GOAL)
FEET = ("LF_foot", "RF_foot", "LH_foot", "RH_foot")


def made(rotors: Any, goal: Any) -> Problem:
    """Returns a problem of an arm with rotors: a number for all joints, and a second one for the last joint."""
    model = ARM.with_armature(np.full(7, 0.1 + 0.1 * rotors[0]) + np.eye(7)[6] * rotors[1])
    rest, effort = Cost("rest", 0.2, Residual.state(X0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    reach = Cost("reach", 20.0, Residual.frame_translation(model, "tool", goal))
    knot = FreeDynamics(model, 0.05, [rest, effort, reach], lower=np.full(7, -26.0), upper=np.full(7, 26.0))
    return Problem(X0, [knot], [0] * KNOTS, FreeDynamics(model, None, [rest, reach]))


NOMINAL = {"rotors": [0.5, 0.2], "goal": GOAL}


def own_layer(**settings: Any) -> ProblemLayer:
    return ProblemLayer(made, ["rotors", "weight/effort", "goal"], own=NOMINAL, **settings)


def test_durations() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["duration", "target/reach"])
    check(lambda dt: loss(*layer(0.05 * dt, REACH)), parameter(1.0))
    by_knot = ProblemLayer(arm_problem(1e3), ["duration"], by_knot=["duration"])
    dt = 1.0 + 0.02 * torch.arange(KNOTS + 1).double()
    check(lambda dt: loss(*by_knot(0.05 * dt)), dt.requires_grad_())
    (slope,) = torch.autograd.grad(loss(*by_knot(0.05 * dt))[0], dt)
    assert slope[:-1].all() and slope[-1] == 0.0  # the terminal knot takes no time


def test_contacts_and_durations_of_a_quadruped() -> None:
    """Differentiates with respect to a foothold, and to the durations of all knots except an impact."""
    robot = condyle.robots.quadruped()
    q = condyle.neutral(robot)
    q[7:] = np.tile([0.0, 0.7, -1.4], 4)
    x0 = np.r_[q, np.zeros(robot.nv)]
    x0[2] = 0.4
    placements = {foot: condyle.frame_placement(robot, condyle.Data(robot), x0[: robot.nq], foot) for foot in FEET}
    feet = {
        foot: condyle.ContactConstraint(foot, "point", placement=at, kp=50.0, kd=20.0)
        for foot, at in placements.items()
    }
    rest = Cost("rest", 1.0, Residual.state(x0), Activation.weighted(np.r_[np.full(18, 5.0), np.full(18, 0.1)]))

    def effort(n: int) -> Cost:
        return Cost("effort", 1e-2, Residual.control(np.zeros(n)))

    models = [
        FreeDynamics(robot, 0.02, [rest, effort(12)]),
        ImpulseDynamics(robot, feet, [rest]),
        ContactDynamics(robot, feet, 0.02, [rest, effort(12)]),
    ]
    problem = Problem(x0, models, [0, 1, 2, 2, 2], FreeDynamics(robot, None, [rest]))
    layer = ProblemLayer(problem, ["contact/LF_foot", "duration"], robot=robot)
    at, dt = torch.tensor(placements["LF_foot"]), torch.tensor(0.02).double()
    xs, us = layer(at, dt)
    a, b = (torch.tensor(np.random.default_rng(1).standard_normal(y.shape)) for y in (xs, us))

    def value(xs: Any, us: Any) -> Any:
        return 1e-2 * (xs.sin() * a).sum() + 1e-3 * (us * b).sum()

    def moved(p: Any) -> Any:
        top = torch.cat([at[:3, :3], p[:, None]], 1)
        return torch.cat([top, at[3:]])

    check(lambda p: value(*layer(moved(p), dt)), at[:3, 3].clone().requires_grad_())
    check(lambda s: value(*layer(at, 0.02 * s)), parameter(1.0))
    (slope,) = torch.autograd.grad(value(*layer(moved(p := at[:3, 3].clone().requires_grad_()), dt)), p)
    assert slope.abs().max() > 1e-4


def test_numbers_of_the_robot_and_bounds() -> None:
    problem = arm_problem()
    names = ["inertia/link4", "gravity", "armature", "bounds/upper"]
    at = [problem.parameter(name) for name in names]
    at[2] = np.full(7, 0.1)
    layer = ProblemLayer(problem, names)

    def function(*scales: Any) -> Any:
        return loss(*layer(*(torch.tensor(value) * scale for value, scale in zip(at, scales, strict=True))))

    assert (layer(*at)[1] == 26.0).any()
    check(function, *(torch.ones(len(value)).double().requires_grad_() for value in at))


def test_parameters_of_ones_own() -> None:
    layer, rotors, weight = own_layer(), torch.tensor([0.5, 0.3]).double(), torch.tensor(1.0).double()
    check(lambda p: loss(*layer(p, 1e-3 * weight, REACH)), rotors.clone().requires_grad_())
    check(lambda p: loss(*layer(rotors, 1e-3 * p, REACH)), weight.clone().requires_grad_())
    check(lambda p: loss(*layer(rotors, 1e-3 * weight, p)), REACH.clone().requires_grad_())


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("kind", ["problem", "function"])
def test_batches_in_lanes_equal_single_problems(kind: str, threads: int) -> None:
    def new(threads: int) -> ProblemLayer:
        if kind == "function":
            return own_layer(threads=threads)
        return ProblemLayer(arm_problem(), ["weight/effort", "entry_weights/rest", "target/reach"], threads=threads)

    layer, rng = new(threads), torch.Generator().manual_seed(2)
    first = torch.tensor([0.5, 0.3]) if kind == "function" else torch.tensor(1e-3)
    second = torch.tensor(1e-3) if kind == "function" else torch.full((14,), 0.5)
    goals = (REACH + 0.03 * torch.randn(5, 3, generator=rng).double()).requires_grad_()
    values = [first.double().requires_grad_(), second.double().requires_grad_(), goals]
    for step in (0.0, 1e-3):  # a cold start, then warm starts
        moved = [*values[:2], goals + step]
        xs, us = layer(*moved)
        assert layer.statuses == ["converged"] * 5
        found = torch.autograd.grad(loss(xs, us)[0].sum(), values)
        total = [torch.zeros_like(v) for v in values[:2]]
        for i in range(5):
            goal = moved[2][i].detach().requires_grad_()
            one = new(1)(*values[:2], goal)
            assert torch.allclose(one[0], xs[i], atol=1e-7)
            slopes = torch.autograd.grad(loss(*one)[0], [*values[:2], goal])
            assert torch.allclose(slopes[2], found[2][i], rtol=1e-5, atol=1e-6)
            total = [a + b for a, b in zip(total, slopes, strict=False)]
        for a, b in zip(total, found, strict=False):
            assert torch.allclose(a, b, rtol=1e-5, atol=1e-6 * a.abs().max().item())


def test_problems_that_cannot_be_copied_are_solved_one_by_one() -> None:
    """Solves x⁺ = x + u with the cost ½ (x² + u²), in Python, whose gain is known."""
    knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * (x @ x + u @ u)))
    problem = Problem([1.0], [knot], [0] * 30, Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x)))
    layer = ProblemLayer(problem, ["x0"], start=(np.zeros((31, 1)), np.zeros((30, 1))), second_order=False)
    x0 = torch.tensor([[1.0], [2.0], [-0.5]], dtype=torch.float64, requires_grad=True)
    _, us = layer(x0)
    assert layer.statuses == ["converged"] * 3
    (slope,) = torch.autograd.grad(us[:, 0].sum(), x0)
    assert torch.allclose(slope, torch.full_like(slope, (1.0 - 5.0**0.5) / 2.0), atol=1e-7)
    assert torch.allclose(us[:, 0], slope * x0, atol=1e-7)


def test_copies_keep_warm_starts() -> None:
    layer = ProblemLayer(arm_problem(1e3), ["target/reach"])
    goals = REACH + torch.tensor([[0.0, 0.0, 0.0], [0.0, -0.1, 0.0]])
    layer(goals)
    cold = layer.iterations
    for other in (pickle.loads(pickle.dumps(layer)), copy.deepcopy(layer), copy.copy(layer)):
        xs, _ = other(goals + 1e-3)
        assert all(a < b for a, b in zip(other.iterations, cold, strict=True))
        assert torch.allclose(xs, layer(goals + 1e-3)[0], atol=1e-7)
        assert other._solves.problem is not layer._solves.problem
    again = pickle.loads(pickle.dumps(own_layer(on_failure="nan")))
    assert again.parameters == ["rotors", "weight/effort", "goal"]


def test_threads_share_a_layer() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach"])
    goals = (REACH + 0.03 * torch.eye(3)).requires_grad_()
    expected = torch.autograd.grad(layer(goals)[1].sum(), goals)[0]
    failed: list[Any] = []

    def work() -> None:
        try:
            for _ in range(4):
                (slope,) = torch.autograd.grad(layer(goals)[1].sum(), goals)
                if not torch.allclose(slope, expected, rtol=1e-5, atol=1e-4):
                    failed.append(slope)
        except Exception as error:
            failed.append(error)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed


def nobody(rotors: Any) -> Any:
    return None


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        (
            (None, ["x0"]),
            TypeError,
            "problem: expected a Problem, or a function of the parameters in own, found NoneType",
        ),
        ((None, None), TypeError, "problem: expected a Problem, or a function"),
        (("problem", None), TypeError, "parameters: expected a list of names, found None"),
        (("problem", [3]), TypeError, "parameters: expected a list of names, found [3]"),
        (
            ("problem", ["entry_weights/effort"]),
            ValueError,
            "parameters: 'entry_weights/effort' needs a cost with weights",
        ),
        (("problem", ["entry_weights/grasp"]), KeyError, "no knot has a cost 'grasp'"),
        (("problem", ["weight/grasp"]), KeyError, "no knot has a cost 'grasp'"),
        (("problem", ["contact/hand"]), KeyError, "no knot has a contact 'hand'"),
        (
            ("problem", ["x0"], {"robot": "arm7"}),
            TypeError,
            "robot: expected the Model of the problem's robot, found str",
        ),
        (
            ("problem", ["x0"], {"solver": "fddp"}),
            TypeError,
            "solver: expected Fddp, InteriorPoint or AugmentedLagrangian",
        ),
        (("problem", ["x0"], {"solver": "made"}), TypeError, "; give its class Fddp"),
        (("problem", ["x0"], {"threads": 0}), ValueError, "threads: expected a number of at least 1, found 0"),
        (("problem", ["x0"], {"start": 3}), TypeError, "start: expected a pair of states and controls, found int"),
        (
            ("problem", ["x0"], {"start": (np.zeros((3, 14)), np.zeros((8, 7)))}),
            ValueError,
            "start: expected states (9, 14), found the shape (3, 14)",
        ),
        (
            ("problem", ["x0"], {"start": (np.zeros((9, 14)), np.zeros((8, 6)))}),
            ValueError,
            "start: expected controls (8, 7), found the shapes",
        ),
        (("problem", ["x0"], {"own": {"x": 1.0}}), TypeError, "problem: expected a function of the parameters in own"),
        ((made, ["x0"]), TypeError, "own: expected the nominal values of the parameters of the function `problem`"),
        ((made, ["goal"], {"own": NOMINAL}), ValueError, "own: expected names in parameters, found ['rotors']"),
        (
            (nobody, ["rotors"], {"own": {"rotors": np.nan}}),
            ValueError,
            "own: expected finite numbers for 'rotors'",
        ),
        (
            (nobody, ["rotors"], {"own": {"rotors": 1.0}}),
            TypeError,
            "problem: expected a function that returns a Problem, found NoneType",
        ),
    ],
)
def test_errors_of_construction(arguments: Any, error: type[Exception], message: str) -> None:
    problem, names, options = (*arguments, {})[:3]
    if options.get("solver") == "made":
        options = {"solver": Fddp(arm_problem())}
    with pytest.raises(error) as found:
        ProblemLayer(arm_problem() if isinstance(problem, str) else problem, names, **options)
    assert message in str(found.value)


def test_a_robot_with_other_joints_is_an_error() -> None:
    """Gives a robot with the same numbers nq and nv, whose joints are in another order."""
    robot, problem, _ = flying_problem()
    builder, inertia = condyle.ModelBuilder("turned"), condyle.Inertia.from_com(1.0, np.zeros(3), 0.1 * np.eye(3))
    wheel = builder.body("wheel", condyle.WORLD, condyle.Joint.continuous([0, 0, 1]), np.eye(4), inertia)
    builder.body("body", wheel, condyle.Joint.free_flyer(), np.eye(4), inertia)
    ProblemLayer(problem, ["x0"], robot=robot)
    with pytest.raises(ValueError, match="robot: expected the robot of the problem, found 'turned', whose positions"):
        ProblemLayer(problem, ["x0"], robot=builder.build())


@pytest.mark.parametrize(
    ("value", "options", "error", "message"),
    [
        (None, {}, TypeError, "target/reach: expected a tensor or numbers, found NoneType"),
        (REACH.to_sparse(), {}, ValueError, "target/reach: expected a dense tensor, found torch.sparse_coo"),
        (REACH.to(torch.complex128), {}, TypeError, "target/reach: expected float32 or float64, found complex128"),
        (REACH, {"rows": 4}, TypeError, "rows: expected a sequence of numbers, strings or tuples, found 4"),
        (REACH, {"rows": [[1]]}, TypeError, "rows: expected a sequence of numbers, strings or tuples, found [[1]]"),
    ],
)
def test_errors_of_a_call(value: Any, options: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error) as found:
        ProblemLayer(arm_problem(), ["target/reach"])(value, **options)
    assert message in str(found.value)


def test_functions_whose_problems_differ() -> None:
    def build(knots: Any) -> Problem:
        problem = made(np.array([0.5, 0.2]), GOAL)
        costs = [Cost("rest", 0.2, Residual.state(X0))]
        short = Problem(X0, [FreeDynamics(ARM, 0.05, costs)], [0] * 3, FreeDynamics(ARM, None, costs))
        return problem if knots > 0.0 else short

    layer = ProblemLayer(build, ["knots"], own={"knots": 1.0})
    with pytest.raises(ValueError, match="problem: expected a function whose problems all have horizon 8, found 3"):
        layer(torch.tensor(-1.0))


def test_the_interior_point_solves_batches() -> None:
    layer = ProblemLayer(arm_problem(), ["target/reach"], solver=InteriorPoint, tolerance=1e-10)
    goals = (REACH + 0.03 * torch.eye(3)[:2]).requires_grad_()
    xs, us = layer(goals)
    reference = ProblemLayer(arm_problem(), ["target/reach"])(goals)
    assert torch.allclose(us, reference[1], atol=1e-4)
    found, expected = (torch.autograd.grad(x[..., 1].sum(), goals)[0] for x in (xs, reference[0]))
    assert torch.allclose(found, expected, rtol=1e-3, atol=1e-4)
