"""Functions of a robot, and solutions of problems, as differentiable operations of PyTorch, on batches.

>>> import condyle, condyle.torch, torch
>>> arm = condyle.torch.Dynamics(condyle.robots.arm7())
>>> q = torch.zeros(100, 7, dtype=torch.float64, requires_grad=True)  # 100 states
>>> v, tau = torch.zeros(7).double(), torch.ones(7).double()
>>> a = arm.aba(q, v, tau)
>>> a.square().sum().backward()
>>> a.shape, q.grad.shape
(torch.Size([100, 7]), torch.Size([100, 7]))

Values are computed by the library's functions for many states, in SIMD lanes and on `threads` threads; derivatives by
the library's exact derivatives. Second derivatives are exact where they exist: the docstring of a method tells where.
Elsewhere a second differentiation raises `NotImplementedError`. `torch.func.grad`, `vmap`, `jacrev`, `jacfwd` and
`hessian` work; `torch.compile` calls the operations without compiling them.

Tensors have float32 or float64 numbers, and are on the CPU. All computations use float64 inside, and results have the
arguments' type. NaN in one state gives NaN in the results of this state only.

Derivatives with respect to a position have nq numbers. They are derivatives of f(normalize(q)), as in
`condyle.casadi`: the gradient has no component along a quaternion. Products with a change of position of nv numbers
need `integrate`: the derivative of `f(integrate(q, d))` with respect to d, at d = 0, is the derivative in the tangent
space.

`ProblemLayer` is the solution of an optimal control problem as an operation.

PyTorch is an optional dependency: `pip install condyle[torch]`. The tests use version 2.15.
"""

import importlib
import inspect
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

from . import _dynamics, _kinds, _layer
from ._condyle import Model
from ._operations import Operation, Shape

try:
    torch: Any = importlib.import_module("torch")
except ImportError:
    raise ImportError("condyle.torch needs PyTorch: pip install condyle[torch]") from None

__all__ = ["Dynamics", "ProblemLayer"]


def _numpy(tensors: Sequence[Any]) -> list[Any]:
    return [tensor.detach().numpy() for tensor in tensors]


def _tensors(arrays: Sequence[Any], like: Any) -> tuple[Any, ...]:
    return tuple(
        torch.from_numpy(array.copy() if not array.flags.writeable else array).to(like.dtype) for array in arrays
    )


def _floats(names: Sequence[str], values: Sequence[Any]) -> list[Any]:
    """Returns the arguments as tensors on the CPU, with one type of floating-point numbers."""
    tensors, widest = [], torch.float32
    for name, value in zip(names, values, strict=True):
        tensor = value if isinstance(value, torch.Tensor) else _tensor(name, value)
        kind = tensor.dtype
        if kind is torch.float64:
            widest = kind
        elif kind is not torch.float32:
            raise TypeError(f"{name}: expected float32 or float64, found {str(kind).removeprefix('torch.')}")
        if tensor.device.type != "cpu":
            raise ValueError(
                f"{name}: expected a tensor on the CPU, where Condyle computes, found device {tensor.device}; "
                "copy it by .cpu()"
            )
        if tensor.layout is not torch.strided:
            raise ValueError(f"{name}: expected a dense tensor, found {tensor.layout}; convert it by .to_dense()")
        tensors.append(tensor)
    return [tensor if tensor.dtype is widest else tensor.to(widest) for tensor in tensors]


def _tensor(name: str, value: Any) -> Any:
    """Returns a number, a sequence or an array as a tensor."""
    try:
        return torch.as_tensor(value)
    except (TypeError, ValueError, RuntimeError) as error:
        raise TypeError(f"{name}: expected a tensor or numbers, found {type(value).__name__}: {error}") from None


def _zeros(tensors: Sequence[Any], like: Sequence[Any]) -> list[Any]:
    """Returns the tensors, with zeros instead of None."""
    return [torch.zeros_like(x) if t is None else t for t, x in zip(tensors, like, strict=True)]


def _given(tensors: Sequence[Any], like: Sequence[Any]) -> list[Any] | None:
    """Returns the tensors, with zeros instead of None; None if all are None."""
    return None if all(t is None for t in tensors) else _zeros(tensors, like)


def _plain() -> bool:
    """Returns whether derivatives of the current computation are not needed: a function's `forward` then suffices."""
    inside = getattr(torch._C, "_are_functorch_transforms_active", lambda: True)()
    level = getattr(torch.autograd.forward_ad, "_current_level", 0)
    return not torch.is_grad_enabled() and not inside and level < 0


def _full(operation: Operation, cotangents: Sequence[Any], x: Sequence[Any]) -> list[Any]:
    """Returns the cotangents of an operation's results, with zeros instead of None."""
    batch = x[0].shape[: x[0].ndim - len(operation.inputs[0].shape)]
    return [
        x[0].new_zeros((*batch, *slot.shape)) if c is None else c
        for c, slot in zip(cotangents, operation.outputs, strict=True)
    ]


def _in_front(info: Any, in_dims: Sequence[int | None], tensors: Sequence[Any]) -> list[Any]:
    """Returns the tensors of a batch of calls, with the batch as the first axis."""
    return [
        tensor.unsqueeze(0).expand(info.batch_size, *tensor.shape) if at is None else tensor.movedim(at, 0)
        for tensor, at in zip(tensors, in_dims, strict=True)
    ]


class _Function(torch.autograd.Function):  # type: ignore[misc]
    """An operation with arguments (operation, needed, *tensors): the common part of four functions.

    The tensors are the arguments x, then cotangents λ, then tangents ẋ, as in `_operations`.
    """

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        ctx.operation, ctx.needed, *tensors = inputs
        ctx.save_for_backward(*tensors)
        ctx.save_for_forward(*tensors)
        ctx.set_materialize_grads(False)

    @classmethod
    def _mapped(cls, info: Any, in_dims: tuple[Any, ...], operation: Any, needed: Any, *tensors: Any) -> Any:
        """Returns the results of a batch of calls, with the batch as the first axis."""
        results = cls.apply(operation, needed, *_in_front(info, in_dims[2:], tensors))
        return results, tuple(0 for _ in results)


class _Value(_Function):
    """The function (x) -> f(x)."""

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        _Function.setup_context(ctx, inputs, output)
        ctx.save_for_backward(*inputs[2:], *output)

    @staticmethod
    def forward(operation: Operation, needed: Any, *x: Any) -> Any:
        return _tensors(_kinds.value(operation, needed, *_numpy(x)), x[0])

    @staticmethod
    def backward(ctx: Any, *cotangents: Any) -> Any:
        operation, needed = ctx.operation, ctx.needs_input_grad[2:]
        x, y = _kinds.cut(operation, ctx.saved_tensors)
        if all(cotangent is None for cotangent in cotangents):
            return (None,) * (2 + len(x))
        full = _full(operation, cotangents, x)
        if _plain():
            slopes = _tensors(operation.pull(_numpy(x), _numpy(full), needed, _numpy(y)), x[0])
        else:
            slopes = _Pull.apply(operation, needed, *x, *full)
        return None, None, *(g if n else None for g, n in zip(slopes, needed, strict=True))

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        needed = tuple(t is not None for t in tangents[2:])
        x, _ = _kinds.cut(ctx.operation, ctx.saved_tensors)
        return _Push.apply(ctx.operation, needed, *x, *_zeros(tangents[2:], x))

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Value._mapped(info, in_dims, *arguments)


class _Pull(_Function):
    """The function (x, λ) -> Jᵀ λ."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        return _tensors(_kinds.pull(operation, needed, *_numpy(tensors)), tensors[0])

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> Any:
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, cotangents = _kinds.cut(operation, ctx.saved_tensors)
        along = tuple(d is not None and needed for d, needed in zip(incoming, ctx.needed, strict=True))
        if not any(along):
            return (None,) * (2 + len(ctx.saved_tensors))
        by_x, by_cotangents = ctx.needs_input_grad[2 : 2 + n], ctx.needs_input_grad[2 + n :]
        bent: Any = (None,) * n
        pushed: Any = (None,) * len(cotangents)
        directions = _zeros([d if flag else None for d, flag in zip(incoming, along, strict=True)], x)
        if any(by_x):
            if not operation.twice:
                raise operation.only_once()
            bent = _Bend.apply(operation, by_x, *x, *cotangents, *directions)
        if any(by_cotangents):
            pushed = _Push.apply(operation, along, *x, *directions)
        return None, None, *bent, *pushed

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        x, cotangents = _kinds.cut(ctx.operation, ctx.saved_tensors)
        moved, changed = _kinds.cut(ctx.operation, tangents[2:])
        along = _given(moved, x), _given(changed, cotangents)
        total = _kinds.pull_along(_FUNCTIONS, ctx.operation, ctx.needed, ctx.saved_tensors, *along)
        return tuple(map(torch.zeros_like, x)) if total is None else tuple(total)

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Pull._mapped(info, in_dims, *arguments)


class _Push(_Function):
    """The function (x, ẋ) -> J ẋ."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        return _tensors(_kinds.push(operation, needed, *_numpy(tensors)), tensors[0])

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> Any:
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, tangents = _kinds.cut(operation, ctx.saved_tensors)
        if all(cotangent is None for cotangent in incoming):
            return (None,) * (2 + len(ctx.saved_tensors))
        cotangents = _full(operation, incoming, x)
        by_x, by_tangents = ctx.needs_input_grad[2 : 2 + n], ctx.needs_input_grad[2 + n :]
        bent: Any = (None,) * n
        pulled: Any = (None,) * n
        if any(by_x):
            if not operation.twice:
                raise operation.only_once()
            bent = _Bend.apply(operation, by_x, *x, *cotangents, *tangents)
        if any(by_tangents):
            pulled = _Pull.apply(operation, by_tangents, *x, *cotangents)
        return None, None, *bent, *pulled

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> Any:
        x, along = _kinds.cut(ctx.operation, ctx.saved_tensors)
        moved, changed = _kinds.cut(ctx.operation, tangents[2:])
        directions = _given(moved, x), _zeros(changed, along)
        return _kinds.push_along(_FUNCTIONS, ctx.operation, ctx.needed, ctx.saved_tensors, *directions)

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Push._mapped(info, in_dims, *arguments)


class _Bend(_Function):
    """The function (x, λ, ẋ) -> H ẋ with the Hessian H of λᵀf."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        return _tensors(_kinds.bend(operation, needed, *_numpy(tensors)), tensors[0])

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise ctx.operation.too_often()

    jvp = backward

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Bend._mapped(info, in_dims, *arguments)


class _Curve(_Function):
    """The function (x, ẋ, ẏ) -> the second derivative of f along ẋ and ẏ."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        return _tensors(_kinds.curve(operation, needed, *_numpy(tensors)), tensors[0])

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise ctx.operation.too_often()

    jvp = backward

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Curve._mapped(info, in_dims, *arguments)


_FUNCTIONS = _kinds.Functions(_Pull.apply, _Push.apply, _Bend.apply, _Curve.apply)


class _Bound(NamedTuple):
    """Arguments as they were given; no argument of a `forward` has a default."""

    args: tuple[Any, ...]
    kwargs: dict[str, Any]

    def apply_defaults(self) -> None:
        """Changes nothing."""


class _Signature(inspect.Signature):
    """A signature that accepts all arguments. PyTorch binds each call's arguments to it, which would take 7 µs."""

    def bind(self, *args: Any, **kwargs: Any) -> Any:
        return _Bound(args, kwargs)


def _fast(kind: Any) -> None:
    """Stores a signature, because PyTorch would compute it for each call, in 60 µs."""
    kind.forward.__signature__ = _Signature([*inspect.signature(kind.forward).parameters.values()])


for _kind in (_Value, _Pull, _Push, _Bend, _Curve):
    _fast(_kind)


class Dynamics(_dynamics.Dynamics):
    """Differentiable functions of one robot, on tensors.

    An argument has the shape (*batch, n) with any batch; batches broadcast. Tensors have float32 or float64 numbers. A
    tensor of integers is a `TypeError`; a wrong shape, or a tensor that is not on the CPU, is a `ValueError`. Several
    threads may call the methods at the same time.

    model: the robot; threads: the number of threads of one call.

    >>> import condyle, condyle.torch, torch
    >>> quadruped = condyle.torch.Dynamics(condyle.robots.quadruped())
    >>> q = torch.as_tensor(condyle.neutral(quadruped.model))
    >>> height = torch.func.grad(lambda q: quadruped.com(q)[2])(q)
    >>> bool(abs(height[2] - 1.0) < 1e-12)  # the centre of mass rises with the trunk
    True
    """

    def __init__(self, model: Model, threads: int = 1) -> None:
        super().__init__(model, threads)
        spans, at = [], 0
        for rotation in self._pool.coordinates.rotations:
            spans += [(slice(at, rotation.numbers.start), False), (rotation.numbers, True)]
            at = rotation.numbers.stop
        self._spans = [*spans, (slice(at, model.nq), False)]

    def _arrays(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        return _floats(names, values)

    def _expand(self, array: Any, shape: Shape) -> Any:
        return array.expand(shape)

    def _apply(self, operation: Operation, arrays: Sequence[Any]) -> tuple[Any, ...]:
        return _Value.apply(operation, None, *arrays)  # type: ignore[no-any-return]

    def _normalized(self, q: Any) -> Any:
        parts = []
        for span, unit in self._spans:
            part = q[..., span]
            parts.append(part / torch.linalg.vector_norm(part, dim=-1, keepdim=True) if unit else part)
        return torch.cat(parts, -1)


class _Solve(torch.autograd.Function):  # type: ignore[misc]
    """The function p -> (x(p), u(p)) of a layer, with arguments (layer, keys, *p)."""

    @staticmethod
    def forward(layer: Any, keys: Any, *p: Any) -> Any:
        return _tensors(layer._solution(keys, _numpy(p)), p[0])

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        ctx.layer = inputs[0]
        ctx.save_for_backward(*inputs[2:], *output)

    @staticmethod
    def backward(ctx: Any, by_xs: Any, by_us: Any) -> Any:
        needed = ctx.needs_input_grad[2:]
        slopes = _Adjoint.apply(ctx.layer, needed, *ctx.saved_tensors, by_xs, by_us)
        return None, None, *(g if n else None for g, n in zip(slopes, needed, strict=True))

    @staticmethod
    def vmap(info: Any, in_dims: Any, layer: Any, keys: Any, *tensors: Any) -> Any:
        results = _Solve.apply(layer, keys, *_in_front(info, in_dims[2:], tensors))
        return results, tuple(0 for _ in results)


class _Adjoint(torch.autograd.Function):  # type: ignore[misc]
    """The function (p, x, u, ∂L/∂x, ∂L/∂u) -> dL/dp of a layer, with arguments (layer, needed, ...)."""

    @staticmethod
    def forward(layer: Any, needed: Any, *tensors: Any) -> Any:
        arrays = _numpy(tensors)
        return _tensors(layer._slopes(arrays[:-4], arrays[-4:], needed), tensors[0])

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        pass

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise _layer.ProblemLayer._only_once()

    @staticmethod
    def vmap(info: Any, in_dims: Any, layer: Any, needed: Any, *tensors: Any) -> Any:
        results = _Adjoint.apply(layer, needed, *_in_front(info, in_dims[2:], tensors))
        return results, tuple(0 for _ in results)


for _kind in (_Solve, _Adjoint):
    _fast(_kind)


class ProblemLayer(_layer.ProblemLayer):
    """The solution of an optimal control problem as a differentiable function of its parameters.

    A call `xs, us = layer(*values)` solves a problem for each row of the batch, and returns states (*batch, N + 1, nx)
    and controls (*batch, N, nu). If knots differ in nu, controls end with zeros. A problem starts from its last
    solution, or else from `start`. The backward pass multiplies by the derivative of the solution by
    `condyle.optimal.Sensitivity`: one factorisation for each row, then one adjoint pass for each parameter.

    problem: the problem, which the layer changes; do not use it elsewhere. Or a function that makes the problem from
        the parameters in `own`, given by name as arrays of floats.
    parameters: names of the parameters, in the order of a call's arguments. "x0" is the initial state, (nx); also
        "target/NAME", in the shape of the cost's target, "weight/NAME" without axes, and "entry_weights/NAME", (n);
        "duration", the duration of all knots without axes (s), "contact/NAME", the placement of a contact, (4, 4),
        "friction/NAME" without axes, and names in `own`. Any other name of `Problem.parameters` is one axis of numbers.
    own: nominal values of parameters of one's own, by name. Derivatives with respect to them are central differences.
    by_knot: the names of parameters with a value for each knot, whose shapes begin with N + 1.
    robot: the robot, if its positions contain quaternions or pairs (cos, sin). Gradients are then as in `Dynamics`.
    solver: `Fddp` (default), `InteriorPoint` or `AugmentedLagrangian`.
    start: states and controls from which a row's first solve starts; None for x0 at rest at all knots.
    curvature: as for `Sensitivity`.
    on_failure: "raise", or "nan" for NaN in the solution of a row that has not converged. The row's gradients are NaN,
        or zero if the loss does not depend on the row.
    threads: the number of threads, each of which solves its own problems of a batch. Only `Fddp` uses them.
    settings: settings of the solver, by name. The default tolerances are tight, because the error of a gradient is
        proportional to the error of the solution.

    A layer can be pickled and copied, with its warm starts. Calls from several threads take turns.

    Tensors have float32 or float64 numbers, and all computations use float64. Second derivatives raise
    `NotImplementedError`. Wrong shapes, and tensors that are not on the CPU, are a `ValueError`; integers are a
    `TypeError`. Raises `ProblemError` with the row and the status if a solve has not converged, or with the row if its
    derivatives do not exist.

    >>> import condyle, condyle.torch, numpy as np, torch
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> rest, effort = Cost("rest", 0.1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    >>> reach = Cost("reach", 10.0, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))
    >>> knot, last = FreeDynamics(arm, 0.05, [rest, effort, reach]), FreeDynamics(arm, None, [rest, reach])
    >>> problem = Problem(x0, [knot], [0] * 10, last)
    >>> layer = condyle.torch.ProblemLayer(problem, ["target/reach", "weight/effort"])
    >>> goals = torch.tensor([[0.4, 0.2, 0.5], [0.3, 0.3, 0.5]])
    >>> weight = torch.tensor(1e-3, requires_grad=True)  # the same for both goals
    >>> xs, us = layer(goals, weight)
    >>> us.square().sum().backward()
    >>> xs.shape, us.shape, bool(weight.grad < 0.0)  # a higher weight lowers the efforts
    (torch.Size([2, 11, 14]), torch.Size([2, 10, 7]), True)
    """

    def _arrays(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        return _floats(names, values)

    def _expand(self, array: Any, shape: tuple[int, ...]) -> Any:
        return array.expand(shape)

    def _apply(self, keys: tuple[Hashable, ...] | None, arrays: Sequence[Any]) -> tuple[Any, Any]:
        return _Solve.apply(self, keys, *arrays)  # type: ignore[no-any-return]
