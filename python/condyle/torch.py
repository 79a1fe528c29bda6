"""Functions of a robot as differentiable operations of PyTorch, on batches of states.

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

PyTorch is an optional dependency: `pip install condyle[torch]`. The tests use version 2.15.
"""

import importlib
import inspect
from collections.abc import Sequence
from typing import Any

from . import _dynamics
from ._condyle import Model
from ._operations import Operation, Shape

try:
    torch: Any = importlib.import_module("torch")
except ImportError:
    raise ImportError("condyle.torch needs PyTorch: pip install condyle[torch]") from None

__all__ = ["Dynamics"]


def _numpy(tensors: Sequence[Any]) -> list[Any]:
    return [tensor.detach().numpy() for tensor in tensors]


def _tensors(arrays: Sequence[Any], like: Any) -> tuple[Any, ...]:
    return tuple(
        torch.from_numpy(array.copy() if not array.flags.writeable else array).to(like.dtype) for array in arrays
    )


def _zeros(tensors: Sequence[Any], like: Sequence[Any]) -> list[Any]:
    """Returns the tensors, with zeros instead of None."""
    return [torch.zeros_like(x) if t is None else t for t, x in zip(tensors, like, strict=True)]


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
        moved = [
            tensor.unsqueeze(0).expand(info.batch_size, *tensor.shape) if at is None else tensor.movedim(at, 0)
            for tensor, at in zip(tensors, in_dims[2:], strict=True)
        ]
        results = cls.apply(operation, needed, *moved)
        return results, tuple(0 for _ in results)


class _Value(_Function):
    """The function (x) -> f(x)."""

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: Any) -> None:
        _Function.setup_context(ctx, inputs, output)
        ctx.save_for_backward(*inputs[2:], *output)

    @staticmethod
    def forward(operation: Operation, needed: Any, *x: Any) -> Any:
        return _tensors(operation.value(*_numpy(x)), x[0])

    @staticmethod
    def backward(ctx: Any, *cotangents: Any) -> Any:
        operation, needed = ctx.operation, ctx.needs_input_grad[2:]
        x, y = ctx.saved_tensors[: len(needed)], ctx.saved_tensors[len(needed) :]
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
        x = ctx.saved_tensors[: len(needed)]
        return _Push.apply(ctx.operation, needed, *x, *_zeros(tangents[2:], x))

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Value._mapped(info, in_dims, *arguments)


class _Pull(_Function):
    """The function (x, λ) -> Jᵀ λ."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        arrays, n = _numpy(tensors), len(operation.inputs)
        return _tensors(operation.pull(arrays[:n], arrays[n:], needed), tensors[0])

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> Any:
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, cotangents = ctx.saved_tensors[:n], ctx.saved_tensors[n:]
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
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, cotangents = ctx.saved_tensors[:n], ctx.saved_tensors[n:]
        moved, changed = tangents[2 : 2 + n], tangents[2 + n :]
        total = [torch.zeros_like(a) for a in x]
        if any(t is not None for t in changed):
            total = _Pull.apply(operation, ctx.needed, *x, *_zeros(changed, cotangents))
        if any(t is not None for t in moved):
            if not operation.twice:
                raise operation.only_once()
            bent = _Bend.apply(operation, ctx.needed, *x, *cotangents, *_zeros(moved, x))
            total = [a + b for a, b in zip(total, bent, strict=True)]
        return tuple(total)

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Pull._mapped(info, in_dims, *arguments)


class _Push(_Function):
    """The function (x, ẋ) -> J ẋ."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        arrays, n = _numpy(tensors), len(operation.inputs)
        return _tensors(operation.push(arrays[:n], arrays[n:], needed), tensors[0])

    @staticmethod
    def backward(ctx: Any, *incoming: Any) -> Any:
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, tangents = ctx.saved_tensors[:n], ctx.saved_tensors[n:]
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
        operation, n = ctx.operation, len(ctx.operation.inputs)
        x, along = ctx.saved_tensors[:n], ctx.saved_tensors[n:]
        moved, changed = tangents[2 : 2 + n], tangents[2 + n :]
        total = _Push.apply(operation, ctx.needed, *x, *_zeros(changed, along))
        if any(t is not None for t in moved):
            if not operation.twice:
                raise operation.only_once()
            curved = _Curve.apply(operation, None, *x, *along, *_zeros(moved, x))
            total = tuple(a + b for a, b in zip(total, curved, strict=True))
        return total

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Push._mapped(info, in_dims, *arguments)


class _Bend(_Function):
    """The function (x, λ, ẋ) -> H ẋ with the Hessian H of λᵀf."""

    @staticmethod
    def forward(operation: Operation, needed: Any, *tensors: Any) -> Any:
        arrays, n, m = _numpy(tensors), len(operation.inputs), len(operation.outputs)
        found = operation.bend(arrays[:n], arrays[n : n + m], arrays[n + m :], needed)
        return _tensors(found, tensors[0])

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
        arrays, n = _numpy(tensors), len(operation.inputs)
        return _tensors(operation.curve(arrays[:n], arrays[n : 2 * n], arrays[2 * n :]), tensors[0])

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise ctx.operation.too_often()

    jvp = backward

    @staticmethod
    def vmap(info: Any, in_dims: Any, *arguments: Any) -> Any:
        return _Curve._mapped(info, in_dims, *arguments)


_kind: Any
for _kind in (_Value, _Pull, _Push, _Bend, _Curve):
    _kind.forward.__signature__ = inspect.signature(_kind.forward)  # PyTorch computes it for each call, in 60 µs


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
        tensors = []
        for name, value in zip(names, values, strict=True):
            tensor = torch.as_tensor(value)
            if tensor.dtype not in (torch.float32, torch.float64):
                raise TypeError(
                    f"{name}: expected float32 or float64, found {str(tensor.dtype).removeprefix('torch.')}"
                )
            if tensor.device.type != "cpu":
                raise ValueError(
                    f"{name}: expected a tensor on the CPU, where Condyle computes, found device {tensor.device}; "
                    f"use {name}.cpu()"
                )
            tensors.append(tensor)
        widest = torch.float64 if any(t.dtype == torch.float64 for t in tensors) else torch.float32
        return [tensor if tensor.dtype == widest else tensor.to(widest) for tensor in tensors]

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
