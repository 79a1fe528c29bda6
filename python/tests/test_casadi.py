"""Tests of `condyle.casadi`: values, first and second derivatives, sparsity, threads, and lifetimes of functions."""

import doctest
import gc
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import condyle
from condyle import WORLD, Inertia, Joint, ModelBuilder

casadi = pytest.importorskip("casadi")

import condyle.casadi  # noqa: E402

# Tolerance for numbers up to some hundreds that two methods compute.
ROUNDING = 1e-9
# Central differences with the step h = 1e-5 have errors of about 1e-8: h² times a third derivative, and 1e-13 / h.
# The tolerance is larger, since second derivatives of accelerations are up to some thousands.
STEP = 1e-5
DIFFERENCES = 1e-6


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
        "screw": Joint.helical(axis, pitch=0.1),
        "gantry": Joint.translation(),
        "hinge": Joint.revolute(axis),
    }
    at = np.eye(4)
    at[:3, 3] = [0.1, -0.2, 0.3]
    for name, joint in joints.items():
        inertia = Inertia.from_com(1.5, [0.1, 0.2, -0.1], np.diag([0.2, 0.3, 0.4]))
        body = builder.body(name, body, joint, at, inertia)
    builder.frame("tip", body, at)
    return builder.build()


MODELS = {
    "arm": condyle.robots.arm7(),
    "quadruped": condyle.robots.quadruped(),
    "humanoid": condyle.robots.humanoid(),
    "every joint": every_joint(),
}
TIPS = {"arm": ["tool"], "quadruped": ["LF_foot", "RH_foot"], "humanoid": ["left_foot"], "every joint": ["tip"]}
FUNCTIONS = [
    "rnea",
    "aba",
    "crba",
    "forward_kinematics",
    "frame_velocity",
    "com",
    "centroidal_momentum",
    "constrained_dynamics",
]
Arrays = list[np.ndarray]


def contacts(robot: str) -> list[condyle.ContactConstraint]:
    return [condyle.ContactConstraint(tip, "point") for tip in TIPS[robot]]


def function(name: str, robot: str, states: int = 1) -> "casadi.Function":
    """Returns the function of `condyle.casadi` with this name, for a robot and a number of states."""
    model, make = MODELS[robot], getattr(condyle.casadi, name)
    if name in ("forward_kinematics", "frame_velocity"):
        return make(model, TIPS[robot][0], states=states)
    if name == "constrained_dynamics":
        return make(model, contacts(robot), states=states)
    return make(model, states=states)


def direct(name: str, robot: str, x: Arrays) -> Arrays:
    """Computes the results of a function with the functions of `condyle` itself."""
    model, frame = MODELS[robot], TIPS[robot][0]
    data = condyle.Data(model)
    match name:
        case "forward_kinematics":
            placement = condyle.frame_placement(model, data, *x, frame)
            return [placement[:3, 3], placement[:3, :3]]
        case "frame_velocity":
            return [condyle.frame_velocity(model, data, *x, frame, reference="local")]
        case "constrained_dynamics":
            result = condyle.constrained_dynamics(model, data, condyle.ConstraintSet(model, contacts(robot)), *x)
            return [result.a, result.lambda_]
        case _:
            return [getattr(condyle, name)(model, data, *x)]


def state(name: str, robot: str, seed: int = 0) -> Arrays:
    """Returns random arguments of a function, with quaternions of length 1."""
    model, rng = MODELS[robot], np.random.default_rng(3 + seed)
    arguments = function(name, robot).n_in()
    return [condyle.random_configuration(model, seed=2 + seed), *rng.standard_normal((2, model.nv))][:arguments]


def stretched(name: str, robot: str) -> Arrays:
    """Returns the arguments that `state` returns, but with quaternions whose length is not 1, as in the iterates of an
    optimisation.
    """
    q, *others = state(name, robot)
    return [q * 1.1, *others]


def stacked(f: "casadi.Function") -> "casadi.Function":
    """Returns a vector of all arguments, a vector of multipliers, and a vector of all results as an expression of the
    arguments.
    """
    sizes = [f.numel_in(k) for k in range(f.n_in())]
    x = casadi.MX.sym("x", sum(sizes))
    parts = casadi.vertsplit(x, np.cumsum([0, *sizes]).tolist())
    results = f.call(parts)
    y = casadi.vertcat(*[casadi.densify(casadi.vec(result)) for result in results])
    multipliers = casadi.MX.sym("l", y.numel())
    return x, multipliers, y


def central(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> np.ndarray:
    columns = [(f(x + step) - f(x - step)) / (2 * STEP) for step in STEP * np.eye(len(x))]
    return np.stack(columns, axis=1)


def close(found: np.ndarray, expected: np.ndarray, tolerance: float) -> bool:
    return bool(np.abs(found - expected).max() <= tolerance * (1 + np.abs(expected).max()))


each = pytest.mark.parametrize("name", FUNCTIONS)
of_each = pytest.mark.parametrize("robot", MODELS)


@each
@of_each
def test_values(name: str, robot: str) -> None:
    x = state(name, robot)
    found = function(name, robot).call([casadi.DM(part) for part in x])
    for value, expected in zip(found, direct(name, robot, x), strict=True):
        assert close(np.array(value).reshape(expected.shape), expected, ROUNDING)


@each
@of_each
def test_first_derivatives(name: str, robot: str) -> None:
    x, _, y = stacked(function(name, robot))
    value = casadi.Function("value", [x], [y])
    jacobian = casadi.Function("jacobian", [x], [casadi.jacobian(y, x)])
    for at in (state, stretched):
        point = np.concatenate(at(name, robot))
        numbers = central(lambda x: np.array(value(x)).ravel(), point)
        assert close(np.array(casadi.densify(jacobian(point))), numbers, DIFFERENCES)


@each
@of_each
def test_second_derivatives(name: str, robot: str) -> None:
    x, multipliers, y = stacked(function(name, robot))
    hessian, gradient = casadi.hessian(casadi.dot(multipliers, y), x)
    hessian = casadi.Function("hessian", [x, multipliers], [hessian])
    gradient = casadi.Function("gradient", [x, multipliers], [gradient])
    weights = np.random.default_rng(4).standard_normal(y.numel())
    for at in (state, stretched):
        point = np.concatenate(at(name, robot))
        numbers = central(lambda x: np.array(gradient(x, weights)).ravel(), point)
        found = np.array(casadi.densify(hessian(point, weights)))
        assert close(found, numbers, DIFFERENCES)
        assert close(found, found.T, ROUNDING)


def test_products_with_vectors() -> None:
    f = function("aba", "every joint")
    x, _, y = stacked(f)
    point = np.concatenate(state("aba", "every joint"))
    direction = casadi.MX.sym("d", x.numel())
    forward = casadi.Function("forward", [x, direction], [casadi.jtimes(y, x, direction)])
    jacobian = casadi.Function("jacobian", [x], [casadi.jacobian(y, x)])
    given = np.random.default_rng(5).standard_normal(len(point))
    assert close(np.array(forward(point, given)).ravel(), np.array(jacobian(point)) @ given, ROUNDING)


def test_zeros_of_the_tree() -> None:
    related = MODELS["quadruped"]
    M = condyle.crba(related, condyle.Data(related), condyle.random_configuration(related, seed=1))
    f = function("crba", "quadruped")
    assert f.nnz_out(0) == np.count_nonzero(M)
    by_a = function("rnea", "quadruped").jacobian().sparsity_out(2)
    assert by_a.nnz() == np.count_nonzero(M)


@each
def test_many_states_are_a_map(name: str) -> None:
    """Checks that results, derivatives and sparsity are the same as with `Function.map`. The number of states is larger
    than the number that is computed at the same time.
    """
    robot, states = "every joint", 37
    one, many = function(name, robot), function(name, robot, states)
    columns = [state(name, robot, k) for k in range(states)]
    given = [np.stack(parts, axis=1) for parts in zip(*columns, strict=True)]
    expected, found = derived(one.map(states)), derived(many)
    for x, y in zip(expected(*given), found(*given), strict=True):
        assert x.sparsity() == y.sparsity()
        assert close(np.array(y.nonzeros()), np.array(x.nonzeros()), ROUNDING)


def derived(f: casadi.Function) -> casadi.Function:
    """Returns a function that computes the results, their Jacobians, a product with the Jacobians, and the Hessian of a
    weighted sum of the results.
    """
    x = [casadi.MX.sym(f.name_in(k), f.size1_in(k), f.size2_in(k)) for k in range(f.n_in())]
    y = f.call(x)
    stacked = casadi.veccat(*y)
    weighed = casadi.dot(np.cos(np.arange(stacked.numel())), stacked)
    jacobians = [casadi.jacobian(stacked, part) for part in x]
    hessian = casadi.jacobian(casadi.veccat(*(casadi.gradient(weighed, part) for part in x)), x[0])
    return casadi.Function("derived", x, [*y, *jacobians, hessian])


def test_where_a_tree_stands_moves_with_nothing_but_gravity() -> None:
    """Checks that ∂²/∂q₀∂v and ∂²/∂q₀∂τ are zero and not in the sparsity, if coordinate q₀ moves a whole tree. A graph
    of expressions has the same sparsity.
    """
    arm = MODELS["arm"]
    for name in ("rnea", "aba"):
        hessian = function(name, "arm").reverse(1).jacobian()
        blocks = {hessian.name_out(k): hessian.sparsity_out(k) for k in range(hessian.n_out())}
        third = "a" if name == "rnea" else "tau"
        for block in (blocks["jac_adj_q_v"], blocks[f"jac_adj_q_{third}"]):
            assert block.row().count(0) == 0
            assert block.nnz() == (arm.nv - 1) * arm.nv
        assert blocks["jac_adj_q_q"].is_dense()
    assert function("crba", "arm").jacobian().sparsity_out(0).colind()[1] == 0


def test_numbers_of_states_are_checked() -> None:
    for wrong in (0, -1, 1.5, "two", 1 << 40):
        with pytest.raises(ValueError, match="states: expected a number from 1 to 65536, found "):
            condyle.casadi.rnea(MODELS["arm"], states=wrong)  # type: ignore[arg-type]


def test_many_threads() -> None:
    f, states = function("aba", "humanoid"), 64
    rng, model = np.random.default_rng(6), MODELS["humanoid"]
    q = np.stack([condyle.random_configuration(model, seed=k) for k in range(states)], axis=1)
    v, tau = rng.standard_normal((2, model.nv, states))
    serial, parallel = f.map(states)(q, v, tau), f.map(states, "thread", 4)(q, v, tau)
    assert np.array_equal(np.array(serial), np.array(parallel))


def test_one_function_is_one_slot() -> None:
    assert function("rnea", "arm").name() == function("rnea", "arm").name()
    first, second = function("rnea", "arm"), function("aba", "arm")
    assert first.name() != second.name()


def test_slots_are_given_back() -> None:
    arm = MODELS["arm"]
    for k in range(200):
        heavier = arm.with_gravity([0.0, 0.0, -k])
        tau = condyle.casadi.rnea(heavier)(casadi.DM([0.3] * 7), 0, 0)
        assert close(np.array(tau).ravel(), condyle.gravity(heavier, condyle.Data(heavier), [0.3] * 7), ROUNDING)
        del tau
        gc.collect()
    lighter = [arm.with_gravity([0.0, float(k), 0.0]) for k in range(65)]
    held = [condyle.casadi.rnea(model) for model in lighter[:64]]
    with pytest.raises(ValueError, match="all 64 functions for CasADi are in use"):
        condyle.casadi.rnea(lighter[64])
    del held[:]
    gc.collect()
    condyle.casadi.rnea(arm.with_gravity([0.0, 0.0, 1.0]))


def test_loaded_functions_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "rnea.casadi"
    function("rnea", "arm").save(str(path))
    load = f"f = casadi.Function.load({str(path)!r}); f(0, 0, 0)"
    another = "import condyle.casadi; held = condyle.casadi.rnea(condyle.robots.arm7().with_gravity([0.0, 0.0, 1.0]))"
    for before in ("", another):  # the slot is empty, or contains a function of another robot
        code = f"import casadi, condyle; {before}\n{load}"
        loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
        assert loaded.returncode != 0
        assert "cannot be loaded or unpickled: make it anew" in loaded.stderr


def test_a_copy_within_the_process_is_refused_until_it_is_dropped() -> None:
    """Checks that calls of a function and of its copy are errors, since CasADi cannot distinguish the two. A newly
    created function works again.
    """
    robot = MODELS["arm"].with_gravity([0.0, 1.0, 0.0])
    f = condyle.casadi.rnea(robot)
    expected = np.array(f(0.3, 0, 0))
    copy = casadi.Function.deserialize(f.serialize())
    for one in (copy, f):
        with pytest.raises(RuntimeError):
            one(0.3, 0, 0)
    del copy, f, one
    gc.collect()
    assert np.array_equal(np.array(condyle.casadi.rnea(robot)(0.3, 0, 0)), expected)


def test_what_cannot_be() -> None:
    arm = MODELS["arm"]
    with pytest.raises(condyle.ModelError, match="nearest is `tool`"):
        condyle.casadi.forward_kinematics(arm, "tol")
    with pytest.raises(ValueError, match="reference"):
        condyle.casadi.frame_velocity(arm, "tool", "sideways")


def test_examples() -> None:
    results = doctest.testmod(condyle.casadi, extraglobs={"condyle": condyle})
    assert results.attempted > 5
    assert results.failed == 0


def test_swing_up_by_ipopt() -> None:
    """Checks that a pendulum on a cart swings up, by direct transcription with exact Hessians, and that the resulting
    motion satisfies the dynamics.
    """
    builder = ModelBuilder("cart")
    cart = builder.body(
        "cart", WORLD, Joint.prismatic([1.0, 0.0, 0.0]), None, Inertia.from_com(1.0, np.zeros(3), np.eye(3))
    )
    rod = Inertia.from_com(0.3, [0.0, 0.0, -0.5], 0.01 * np.eye(3))
    builder.body("rod", cart, Joint.revolute([0.0, 1.0, 0.0]), None, rod)
    model = builder.build()
    f, knots, dt = condyle.casadi.aba(model), 40, 0.05
    opti = casadi.Opti()
    q, v, u = opti.variable(2, knots + 1), opti.variable(2, knots + 1), opti.variable(knots)
    a = f.map(knots)(q[:, :-1], v[:, 1:], casadi.vertcat(u.T, casadi.MX.zeros(1, knots)))
    opti.subject_to(v[:, 1:] == v[:, :-1] + dt * a)
    opti.subject_to(q[:, 1:] == q[:, :-1] + dt * v[:, 1:])
    opti.subject_to(casadi.vertcat(q[:, 0], v[:, 0]) == 0)
    opti.subject_to(casadi.vertcat(q[:, -1], v[:, -1]) == casadi.vertcat(0, np.pi, 0, 0))
    opti.subject_to(opti.bounded(-20, u, 20))
    opti.minimize(casadi.sumsqr(u))
    opti.set_initial(q[1, :], np.linspace(0, np.pi, knots + 1))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "max_iter": 200})
    solution = opti.solve()
    assert solution.stats()["return_status"] == "Solve_Succeeded"
    data, (q, v, u) = condyle.Data(model), (solution.value(x) for x in (q, v, u))
    for k in range(knots):
        acceleration = condyle.aba(model, data, q[:, k], v[:, k + 1], np.array([u[k], 0.0]))
        assert close(v[:, k] + dt * acceleration, v[:, k + 1], 1e-6)  # IPOPT's tolerance for scaled equations is 1e-8


def test_actions_of_expressions_are_those_that_are_written() -> None:
    """Compares two actions of a pendulum, one from expressions and one from a Python function: iterates, derivatives,
    bounds.
    """
    from condyle.optimal import Action, Fddp, Problem

    def step(x, u, sin, cos):
        v = x[1] + 0.1 * (u[0] - sin(x[0]))
        return [x[0] + 0.1 * v, v], 1.0 - cos(x[0]) + 0.5 * x[1] ** 2 + 0.5 * u[0] ** 2 + 0.1 * x[0] * u[0]

    def calc(t, x, u):
        state, cost = step(x, u, np.sin, np.cos)
        return np.array(state), cost

    end = Action(2, 0, lambda t, x, u: (None, 5.0 * (x @ x)))
    solutions, nodes = [], []
    for kind in (casadi.SX, casadi.MX):
        x, u = kind.sym("x", 2), kind.sym("u", 1)
        state, cost = step(x, u, casadi.sin, casadi.cos)
        knot = condyle.casadi.action(x, u, casadi.vertcat(*state), cost, lower=[-0.5], upper=[0.4])
        last = condyle.casadi.action(x, None, None, 5.0 * casadi.sumsqr(x))
        written = Action(2, 1, calc, lower=[-0.5], upper=[0.4])
        start = np.zeros((21, 2)), np.zeros((20, 1))
        for models in ((knot, last), (written, end)):
            problem = Problem([1.0, 0.5], [models[0]], [0] * 20, models[1])
            solutions.append(Fddp(problem).solve(*start))
            nodes.append(problem.derivatives(np.full((21, 2), 0.3), np.full((20, 1), 0.2)))
    for solution in solutions:
        assert solution.status == "converged" and abs(solution.us).max() <= 0.5
        np.testing.assert_allclose(solution.xs, solutions[0].xs, rtol=0, atol=ROUNDING)
    for one in nodes:
        for node, expected in zip(one, nodes[0], strict=True):
            assert node.rows is None and expected.rows is None
            for a, b in zip(node[:8], expected[:8], strict=True):
                np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


def test_expressions_of_the_librarys_functions_make_an_action() -> None:
    from condyle.optimal import FreeDynamics, Problem

    arm = condyle.robots.arm7()
    x, u = casadi.MX.sym("x", 14), casadi.MX.sym("u", 7)
    v = x[7:] + 0.05 * condyle.casadi.aba(arm)(x[:7], x[7:], u)
    knot = condyle.casadi.action(x, u, casadi.vertcat(x[:7] + 0.05 * v, v), casadi.sumsqr(u))
    rng = np.random.default_rng(4)
    xs, us = rng.normal(size=(3, 14)), rng.normal(size=(2, 7))
    end = FreeDynamics(arm, None, [])
    ours, expected = (Problem(xs[0], [k], [0, 0], end).derivatives(xs, us) for k in (knot, FreeDynamics(arm, 0.05, [])))
    for a, b in zip(ours[:2], expected[:2], strict=True):
        for name in ("A", "B", "f"):
            np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=ROUNDING)
