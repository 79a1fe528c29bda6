"""Tests of `condyle.torch`: values, first and second derivatives, `torch.func`, types, threads, and errors."""

import doctest
import pickle
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frameworks import CASES, MODELS, TIPS, Case, numbers

import condyle

torch = pytest.importorskip("torch")

import condyle.torch  # noqa: E402

ROUNDING = 1e-9
"""Tolerance for numbers up to some hundreds that two methods compute."""
DIFFERENCES = {"eps": 1e-6, "atol": 2e-5, "rtol": 2e-5}
"""Step and tolerance of central differences: values up to 1e3 have errors of 1e-7, and third derivatives add 1e-9."""
ROBOTS = {name: condyle.torch.Dynamics(model) for name, model in MODELS.items()}
TWICE = [(name, robot) for name, case in CASES.items() for robot in MODELS if case.twice or case.twice is None]


def tensors(robot: str, case: Case, states: int = 2, unit: bool = False) -> list[Any]:
    return [torch.tensor(x, requires_grad=True) for x in numbers(MODELS[robot], case.arguments, states, unit)]


def outputs(found: Any) -> list[Any]:
    return list(found) if isinstance(found, tuple) else [found]


def slopes_of(case: Case, robot: str, x: list[Any]) -> list[float]:
    """Returns the size of each result's derivatives, at least 1."""
    found = []
    for y in outputs(case.call(ROBOTS[robot], TIPS[robot], *x)):
        slopes = torch.autograd.grad((1e-9 + y.square().sum()).sqrt(), x, retain_graph=True, allow_unused=True)
        found.append(1.0 + max(slope.abs().max().item() for slope in slopes if slope is not None))
    return found


def scaled(found: Any, sizes: list[float]) -> Any:
    """Returns the results divided by these sizes, so that one absolute tolerance suits all."""
    results = tuple(y / size for y, size in zip(outputs(found), sizes, strict=True))
    return results if len(results) > 1 else results[0]


@pytest.mark.parametrize("robot", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_values(name: str, robot: str) -> None:
    case, model, data = CASES[name], MODELS[robot], condyle.Data(MODELS[robot])
    x = numbers(model, case.arguments, 5)
    found = case.call(ROBOTS[robot], TIPS[robot], *map(torch.tensor, x))
    expected = case.expected(model, data, TIPS[robot], *x)
    for y, z in zip(outputs(found), outputs(expected), strict=True):
        assert y.dtype == torch.float64 and y.shape == np.shape(z)
        assert np.allclose(y.numpy(), z, rtol=ROUNDING, atol=ROUNDING)
    alone = case.call(ROBOTS[robot], TIPS[robot], *(torch.tensor(a[3]) for a in x))
    for y, z in zip(outputs(alone), outputs(found), strict=True):
        assert y.shape == z.shape[1:] and torch.allclose(y, z[3], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("robot", MODELS)
@pytest.mark.parametrize("name", CASES)
def test_gradients(name: str, robot: str) -> None:
    """Compares derivatives with differences, for positions whose quaternions and pairs do not have the length 1."""
    case = CASES[name]

    def function(q: Any, *x: Any) -> Any:
        found = case.call(ROBOTS[robot], TIPS[robot], ROBOTS[robot].normalize(q), *x)
        return scaled(found, sizes)

    x = tensors(robot, case)
    sizes = slopes_of(case, robot, x)
    assert torch.autograd.gradcheck(function, x, **DIFFERENCES, check_forward_ad=True)


@pytest.mark.parametrize("name", ["aba", "com", "frame_placement", "integrate"])
def test_gradients_normalise_positions(name: str) -> None:
    """Compares the gradient of f(normalize(q)) with the gradient of f(q), which is the same extension of f."""
    case, robot = CASES[name], ROBOTS["every joint"]
    found = []
    for prepare in (robot.normalize, lambda q: q):
        x = tensors("every joint", case)
        y = case.call(robot, "tip", prepare(x[0]), *x[1:])
        y.square().sum().backward()
        found.append(x[0].grad)
    assert np.allclose(found[0], found[1], rtol=ROUNDING, atol=ROUNDING * found[0].abs().max().item())


@pytest.mark.parametrize(("name", "robot"), TWICE)
def test_second_derivatives(name: str, robot: str) -> None:
    case = CASES[name]
    if case.twice is None and robot != "arm":
        x = tensors(robot, case)
        (slope,) = torch.autograd.grad(case.call(ROBOTS[robot], "", *x).sum(), x[:1], create_graph=True)
        with pytest.raises(NotImplementedError, match=f"^{name}: differentiated twice, but the library has exact"):
            slope.square().sum().backward()
        return

    def function(*x: Any) -> Any:
        return scaled(case.call(ROBOTS[robot], TIPS[robot], *x), sizes)

    x = tensors(robot, case, 1)
    sizes = [s**1.5 for s in slopes_of(case, robot, x)]
    assert torch.autograd.gradgradcheck(function, x, **DIFFERENCES)


@pytest.mark.parametrize("robot", MODELS)
def test_torch_func(robot: str) -> None:
    """Compares `jacrev`, `jacfwd` and `vmap` with a loop, and `hessian` with `jacrev` of `jacrev`."""
    dynamics, case = ROBOTS[robot], CASES["aba"]
    q, v, tau = (x.detach() for x in tensors(robot, case, 3))
    close = {"rtol": 1e-8, "atol": 1e-8}

    def norm(q: Any, v: Any, tau: Any) -> Any:
        return dynamics.aba(q, v, tau).sin().sum()

    for jacobian in (torch.func.jacrev, torch.func.jacfwd):
        mapped = torch.func.vmap(jacobian(dynamics.aba, (0, 1, 2)))(q, v, tau)
        for k in range(3):
            x = (q[k], v[k], tau[k])
            assert all(
                torch.allclose(y[k], z, **close)
                for y, z in zip(mapped, torch.autograd.functional.jacobian(dynamics.aba, x), strict=True)
            )
    shared = torch.func.vmap(dynamics.aba, (0, None, 0))(q, v[0], tau)
    assert torch.allclose(shared, dynamics.aba(q, v[0], tau), **close)
    curvature = torch.func.vmap(torch.func.hessian(norm))(q, v, tau)
    for k in range(3):
        again = torch.func.jacrev(torch.func.jacrev(norm))(q[k], v[k], tau[k])
        assert torch.allclose(curvature[k], again, **close)
    for first, second in (("jacrev", "jacfwd"), ("jacfwd", "jacfwd")):
        other = getattr(torch.func, first)(getattr(torch.func, second)(norm))(q[0], v[0], tau[0])
        assert torch.allclose(curvature[0], other, **close)
    gradient = torch.func.vmap(torch.func.grad(norm))(q, v, tau)
    assert gradient.shape == q.shape


def test_jacobian_is_the_librarys() -> None:
    model, robot = MODELS["arm"], ROBOTS["arm"]
    q, v, tau = (x.detach() for x in tensors("arm", CASES["aba"], 1))
    expected = condyle.aba_derivatives(model, condyle.Data(model), *(x[0].numpy() for x in (q, v, tau)))
    found = torch.func.jacrev(robot.aba, (0, 1, 2))(q[0], v[0], tau[0])
    for y, z in zip(found, expected[1:], strict=True):
        assert np.allclose(y.numpy(), z, rtol=ROUNDING, atol=ROUNDING)


def test_forward_over_reverse() -> None:
    """Compares the tangent of a gradient without `create_graph` with the tangent of a gradient with it."""
    robot, ad = ROBOTS["every joint"], torch.autograd.forward_ad
    x = [a.detach() for a in tensors("every joint", CASES["aba"])]
    direction, found = torch.sin(torch.arange(x[0].numel(), dtype=torch.float64)).reshape(x[0].shape), []
    for create in (False, True):
        with ad.dual_level():
            q = ad.make_dual(x[0].clone().requires_grad_(), direction)
            (slope,) = torch.autograd.grad(robot.aba(q, *x[1:]).sum(), q, create_graph=create)
            found.append(ad.unpack_dual(slope).tangent)
    assert torch.allclose(found[0], found[1], rtol=ROUNDING, atol=ROUNDING * found[1].abs().max().item())


def test_tangent_space() -> None:
    """Checks that the derivative along `integrate` is the library's derivative in the tangent space."""
    model, robot = MODELS["every joint"], ROBOTS["every joint"]
    q, v, tau = (torch.tensor(x[0]) for x in numbers(model, "q v a", 1))
    zero = torch.zeros(model.nv, dtype=torch.float64)
    found = torch.func.jacrev(lambda d: robot.aba(robot.integrate(q, d), v, tau))(zero)
    expected = condyle.aba_derivatives(model, condyle.Data(model), q.numpy(), v.numpy(), tau.numpy()).da_dq
    assert np.allclose(found.numpy(), expected, rtol=ROUNDING, atol=ROUNDING * np.abs(expected).max())


def test_types_and_batches() -> None:
    robot = ROBOTS["arm"]
    q = torch.full((4, 3, 7), 0.3, dtype=torch.float32, requires_grad=True)
    tau = torch.ones(3, 7)
    a = robot.aba(q, 0.1 * torch.ones(7), tau)
    a.sum().backward()
    assert a.dtype == q.grad.dtype == torch.float32 and a.shape == q.grad.shape == (4, 3, 7)
    exact = robot.aba(q.detach().double(), 0.1 * torch.ones(7), tau)
    assert exact.dtype == torch.float64
    assert torch.allclose(a.double(), exact, rtol=1e-6, atol=1e-5)
    one = robot.aba(q[0, 0].detach(), np.full(7, 0.1, np.float32), tau[0])
    assert torch.equal(one, a[0, 0].detach())
    none = torch.zeros(0, 7, requires_grad=True)
    robot.aba(none, none, none).sum().backward()
    assert none.grad.shape == (0, 7)


def test_chunks() -> None:
    """Compares a batch of several chunks with its parts."""
    robot, model = ROBOTS["every joint"], MODELS["every joint"]
    x = [torch.tensor(a, requires_grad=True) for a in numbers(model, "q v a", 700)]
    robot.aba(*x).square().sum().backward()
    part = [a.detach()[650:].requires_grad_() for a in x]
    robot.aba(*part).square().sum().backward()
    for whole, some in zip(x, part, strict=True):
        scale = some.grad.abs().max().item()
        assert torch.allclose(whole.grad[650:], some.grad, rtol=1e-8, atol=1e-8 * scale)


def test_nan_stays_in_its_state() -> None:
    robot, model = ROBOTS["every joint"], MODELS["every joint"]
    x = [torch.tensor(a, requires_grad=True) for a in numbers(model, "q v a", 4)]
    with torch.no_grad():
        x[1][2, 3] = torch.nan
        x[0][3, 3:7] = 0.0  # a quaternion of length 0
    a = robot.aba(*x)
    a.sum().backward()
    for found in (a.detach(), x[0].grad, x[1].grad):
        assert found.isnan().any(1).tolist() == [False, False, True, True]


def test_threads_share_an_object() -> None:
    robot = condyle.torch.Dynamics(MODELS["every joint"], threads=2)
    x = [torch.tensor(a, requires_grad=True) for a in numbers(MODELS["every joint"], "q v a", 64)]
    expected = torch.autograd.grad(robot.aba(*x).sum(), x)
    failed = []

    def work() -> None:
        for _ in range(20):
            found = torch.autograd.grad(robot.aba(*x).sum(), x)
            if not all(map(torch.equal, found, expected)):
                failed.append(found)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failed
    again = pickle.loads(pickle.dumps(robot))
    assert torch.equal(again.aba(*x), robot.aba(*x))


def test_some_arguments_need_no_gradient() -> None:
    robot = ROBOTS["arm"]
    q, v, tau = (x.detach() for x in tensors("arm", CASES["aba"]))
    v.requires_grad_()
    robot.aba(q, v, tau).sum().backward()
    assert v.grad is not None and q.grad is None
    model = MODELS["arm"]
    expected = condyle.aba_derivatives(model, condyle.Data(model), q.numpy(), v.detach().numpy(), tau.numpy()).da_dv
    assert np.allclose(v.grad.numpy(), expected.sum(1), rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda q: q[:6], ValueError, "q: expected shape (..., 7), found (6,)"),
        (lambda q: q.sum(), ValueError, "q: expected shape (..., 7), found ()"),
        (lambda q: q.int(), TypeError, "q: expected float32 or float64, found int32"),
        (lambda q: q.half(), TypeError, "q: expected float32 or float64, found float16"),
        (
            lambda q: q.to("meta"),
            ValueError,
            "q: expected a tensor on the CPU, where Condyle computes, found device meta; copy it by .cpu()",
        ),
        (
            lambda q: q.expand(3, 7),
            ValueError,
            "aba: expected batches that broadcast, found q (3,), v (2,), tau ()",
        ),
    ],
)
def test_errors(change: Any, error: type[Exception], message: str) -> None:
    q = torch.zeros(7, dtype=torch.float64)
    with pytest.raises(error) as found:
        ROBOTS["arm"].aba(change(q), q.expand(2, 7), q)
    assert str(found.value) == message


def test_errors_of_derivatives() -> None:
    robot = ROBOTS["arm"]
    q = torch.full((7,), 0.3, dtype=torch.float64, requires_grad=True)
    with pytest.raises(NotImplementedError, match="^com: differentiated twice, but the library has exact second"):
        torch.func.hessian(lambda q: robot.com(q).sum())(q)
    with pytest.raises(NotImplementedError, match="^rnea: differentiated three times"):
        torch.func.grad(lambda q: torch.func.hessian(lambda q: robot.gravity(q).sum())(q).sum())(q)


def test_docstrings() -> None:
    results = doctest.testmod(condyle.torch)
    assert results.attempted >= 8
    assert results.failed == 0


def test_chapter() -> None:
    """Runs PyTorch's blocks of the book's chapter, as one program."""
    page = Path(__file__).parents[2] / "docs" / "frameworks.md"
    blocks = re.findall(r"^```py\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    exec("".join(blocks), {})


def test_missing_package() -> None:
    code = "import sys; sys.modules['torch'] = None; import condyle.torch"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "ImportError: condyle.torch needs PyTorch: pip install condyle[torch]" in run.stderr
