"""Functions of a robot, and solutions of problems, as differentiable operations of JAX, on batches.

>>> import condyle, condyle.jax, jax, jax.numpy as jnp
>>> arm = condyle.jax.Dynamics(condyle.robots.arm7())
>>> q, v, tau = jnp.full((100, 7), 0.3), jnp.zeros(7), jnp.ones(7)  # 100 states
>>> effort = jax.jit(jax.grad(lambda q: (arm.aba(q, v, tau) ** 2).sum()))
>>> effort(q).shape
(100, 7)

Values are computed by the library's functions for many states, in SIMD lanes and on `threads` threads; derivatives by
the library's exact derivatives. Second derivatives are exact where they exist: the docstring of a method tells where.
Elsewhere a second differentiation raises `NotImplementedError`. `jax.jit`, `grad`, `vmap`, `jacrev`, `jacfwd`,
`hessian` and `lax.scan` work. Compiled programs call the library by a handler of XLA's foreign function interface, and
`ProblemLayer` by `jax.pure_callback`; `vmap` adds an axis to the batch of one call.

Arrays have float32 or float64 numbers, and results have the arguments' type. So with JAX's default setting, without
`jax_enable_x64`, results are float32. All computations use float64 inside. NaN in one state gives NaN in the results of
this state only.

Derivatives with respect to a position have nq numbers. They are derivatives of f(normalize(q)), as in
`condyle.casadi`: the gradient has no component along a quaternion. The derivative of `f(integrate(q, d))` with respect
to d, at d = 0, is the derivative in the tangent space, with nv numbers.

`ProblemLayer` is the solution of an optimal control problem as an operation.

JAX is an optional dependency: `pip install condyle[jax]`. The tests use version 0.10.2.
"""

import importlib
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any

import numpy as np

from . import _dynamics, _kinds, _layer
from ._condyle import Model
from ._operations import Operation, Shape, Slot

try:
    jax: Any = importlib.import_module("jax")
except ImportError:
    raise ImportError("condyle.jax needs JAX: pip install condyle[jax]") from None

jnp: Any = importlib.import_module("jax.numpy")
_ad: Any = importlib.import_module("jax.interpreters.ad")
_batching: Any = importlib.import_module("jax.interpreters.batching")
_mlir: Any = importlib.import_module("jax.interpreters.mlir")
_Primitive: Any = importlib.import_module("jax.extend.core").Primitive

__all__ = ["Dynamics", "ProblemLayer"]


def _floats(names: Sequence[str], values: Sequence[Any]) -> list[Any]:
    """Returns the arguments as arrays with one type of floating-point numbers."""
    arrays = []
    for name, value in zip(names, values, strict=True):
        try:
            array = jnp.asarray(value)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{name}: expected an array or numbers, found {type(value).__name__}: {error}") from None
        if array.dtype not in (jnp.float32, jnp.float64):
            raise TypeError(f"{name}: expected float32 or float64, found {array.dtype}")
        arrays.append(array)
    kind = jnp.result_type(*arrays)
    return [array.astype(kind) for array in arrays]


def _primitive(name: str, compute: _kinds.Function, slots: Callable[[Operation], Sequence[Slot]]) -> Any:
    """Makes a primitive with arguments (*arrays, operation, needed): x, then cotangents λ, then tangents ẋ.

    compute: (operation, needed, *NumPy arrays) -> results; slots: the results' names and shapes.
    """
    primitive = _Primitive(f"condyle_{name}")
    primitive.multiple_results = True

    def call(operation: Operation, needed: Any, *arrays: Any) -> list[Any]:
        numbers = [np.asarray(array) for array in arrays]
        results = compute(operation, needed, *numbers)
        with np.errstate(over="ignore"):  # too large for float32: infinity
            return [y.astype(numbers[0].dtype, copy=False) for y in results]

    def lowered(context: Any, *arrays: Any, operation: Operation, needed: Any) -> Any:
        def host(*arrays: Any) -> list[Any]:
            return call(operation, needed, *arrays)

        return _mlir.emit_python_callback(
            context, host, None, arrays, context.avals_in, context.avals_out, has_side_effect=False
        )[0]

    def at_once(*arrays: Any, operation: Operation, needed: Any) -> list[Any]:
        return [jnp.asarray(y) for y in call(operation, needed, *arrays)]

    def abstract(*arrays: Any, operation: Operation, needed: Any) -> list[Any]:
        cut = len(arrays[0].shape) - len(operation.inputs[0].shape)
        batch, kind = tuple(arrays[0].shape[:cut]), arrays[0].dtype
        return [jax.core.ShapedArray((*batch, *slot.shape), kind) for slot in slots(operation)]

    def batched(arrays: Sequence[Any], axes: Sequence[Any], operation: Operation, needed: Any) -> Any:
        (size,) = {a.shape[at] for a, at in zip(arrays, axes, strict=True) if at is not None}
        moved = [
            jnp.broadcast_to(a, (size, *a.shape)) if at is None else jnp.moveaxis(a, at, 0)
            for a, at in zip(arrays, axes, strict=True)
        ]
        results = primitive.bind(*moved, operation=operation, needed=needed)
        return results, [0] * len(results)

    primitive.def_impl(at_once)
    primitive.def_abstract_eval(abstract)
    _mlir.register_lowering(primitive, lowered)
    _batching.primitive_batchers[primitive] = batched
    return primitive


_value = _primitive("value", _kinds.value, _kinds.outputs)  # x -> f(x)
_pull = _primitive("pull", _kinds.pull, _kinds.inputs)  # (x, λ, f(x)) -> Jᵀ λ
_push = _primitive("push", _kinds.push, _kinds.outputs)  # (x, ẋ, f(x)) -> J ẋ
_bend = _primitive("bend", _kinds.bend, _kinds.inputs)  # (x, λ, ẋ) -> H ẋ
_curve = _primitive("curve", _kinds.curve, _kinds.outputs)  # (x, ẋ, ẏ) -> the second derivative along ẋ and ẏ


def _bound(primitive: Any) -> _kinds.Function:
    return lambda operation, needed, *arrays: primitive.bind(*arrays, operation=operation, needed=needed)


def _bend_needed(operation: Operation, needed: Sequence[bool], *arrays: Any) -> list[Any]:
    """Computes H ẋ with zeros for arguments that are not needed, so that the transpose is the same function."""
    bent = _bend.bind(*arrays, operation=operation, needed=(True,) * len(needed))
    return [b if flag else jnp.zeros_like(b) for b, flag in zip(bent, needed, strict=True)]


_FUNCTIONS = _kinds.Functions(_bound(_pull), _bound(_push), _bend_needed, _bound(_curve))


def _moving(tangents: Sequence[Any]) -> tuple[bool, ...]:
    return tuple(type(t) is not _ad.Zero for t in tangents)


def _full(values: Sequence[Any]) -> list[Any]:
    """Returns tangents or cotangents, with zeros instead of symbols of zeros."""
    return [_ad.instantiate_zeros(value) for value in values]


def _given(tangents: Sequence[Any]) -> list[Any] | None:
    """Returns the tangents without symbols; None if all are zero."""
    return _full(tangents) if any(_moving(tangents)) else None


def _value_jvp(x: Sequence[Any], tangents: Sequence[Any], operation: Operation, needed: Any) -> Any:
    y = _value.bind(*x, operation=operation, needed=needed)
    known = y if operation.reuses else []
    return y, _push.bind(*x, *_full(tangents), *known, operation=operation, needed=_moving(tangents))


def _push_jvp(arrays: Sequence[Any], tangents: Sequence[Any], operation: Operation, needed: Any) -> Any:
    y = _push.bind(*arrays, operation=operation, needed=needed)
    moved, changed, _ = _kinds.cut_push(operation, tangents)
    total = _kinds.push_along(_FUNCTIONS, operation, needed, arrays, _given(moved), _given(changed))
    return y, [jnp.zeros_like(d) for d in y] if total is None else total


def _push_transpose(cotangents: Sequence[Any], *arrays: Any, operation: Operation, needed: Any) -> list[Any]:
    x, along, known = _kinds.cut_push(operation, arrays)  # along: symbols where J ẋ is linear, or constants
    linear = tuple(_ad.is_undefined_primal(d) for d in along)
    slopes = _pull.bind(*x, *_full(cotangents), *known, operation=operation, needed=linear)
    return [
        *[None] * len(x),
        *[g if flag else None for g, flag in zip(slopes, linear, strict=True)],
        *[None] * len(known),
    ]


def _pull_jvp(arrays: Sequence[Any], tangents: Sequence[Any], operation: Operation, needed: Any) -> Any:
    y = _pull.bind(*arrays, operation=operation, needed=needed)
    moved, changed, _ = _kinds.cut_pull(operation, tangents)
    total = _kinds.pull_along(_FUNCTIONS, operation, needed, arrays, _given(moved), _given(changed))
    return y, [jnp.zeros_like(g) for g in y] if total is None else total


def _pull_transpose(directions: Sequence[Any], *arrays: Any, operation: Operation, needed: Any) -> list[Any]:
    x, _, known = _kinds.cut_pull(operation, arrays)
    along = tuple(a and b for a, b in zip(_moving(directions), needed, strict=True))
    pushed = _push.bind(*x, *_full(directions), *known, operation=operation, needed=along)
    return [*[None] * len(x), *pushed, *[None] * len(known)]


def _bend_jvp(arrays: Sequence[Any], tangents: Sequence[Any], operation: Operation, needed: Any) -> Any:
    n, m = len(operation.inputs), len(operation.outputs)
    if any(_moving(tangents[: n + m])):
        raise operation.too_often()
    y = _bend.bind(*arrays, operation=operation, needed=needed)
    changed = [*arrays[: n + m], *_full(tangents[n + m :])]
    return y, _bend.bind(*changed, operation=operation, needed=needed)


def _bend_transpose(directions: Sequence[Any], *arrays: Any, operation: Operation, needed: Any) -> list[Any]:
    n, m = len(operation.inputs), len(operation.outputs)  # H is symmetric
    bent = _bend.bind(*arrays[: n + m], *_full(directions), operation=operation, needed=(True,) * n)
    return [None] * (n + m) + list(bent)


def _curve_jvp(arrays: Sequence[Any], tangents: Sequence[Any], operation: Operation, needed: Any) -> Any:
    x, a, b = _kinds.cut_push(operation, arrays)
    moved, along_a, along_b = _kinds.cut_push(operation, tangents)
    if any(_moving(moved)):
        raise operation.too_often()
    y = _curve.bind(*arrays, operation=operation, needed=needed)
    first = _curve.bind(*x, *_full(along_a), *b, operation=operation, needed=needed)
    second = _curve.bind(*x, *a, *_full(along_b), operation=operation, needed=needed)
    return y, [i + j for i, j in zip(first, second, strict=True)]


def _curve_transpose(cotangents: Sequence[Any], *arrays: Any, operation: Operation, needed: Any) -> list[Any]:
    x, a, b = _kinds.cut_push(operation, arrays)  # linear in one of the two
    first = any(_ad.is_undefined_primal(d) for d in a)
    bent = _bend.bind(*x, *_full(cotangents), *(b if first else a), operation=operation, needed=(True,) * len(x))
    none = [None] * len(x)
    return [*none, *bent, *none] if first else [*none, *none, *bent]


_ad.primitive_jvps |= {
    _value: _value_jvp,
    _push: _push_jvp,
    _pull: _pull_jvp,
    _bend: _bend_jvp,
    _curve: _curve_jvp,
}
_ad.primitive_transposes |= {
    _push: _push_transpose,
    _pull: _pull_transpose,
    _bend: _bend_transpose,
    _curve: _curve_transpose,
}


class Dynamics(_dynamics.Dynamics):
    """Differentiable functions of one robot, on JAX's arrays.

    An argument has the shape (*batch, n) with any batch; batches broadcast. Arrays have float32 or float64 numbers. An
    array of integers is a `TypeError`; a wrong shape is a `ValueError`. Several threads may call the methods at the
    same time. JAX's arrays on other devices than the CPU are copied to the CPU and back.

    model: the robot; threads: the number of threads of one call.

    >>> import condyle, condyle.jax, jax, jax.numpy as jnp
    >>> quadruped = condyle.jax.Dynamics(condyle.robots.quadruped())
    >>> q = jnp.asarray(condyle.neutral(quadruped.model))
    >>> height = jax.grad(lambda q: quadruped.com(q)[2])(q)
    >>> bool(abs(height[2] - 1.0) < 1e-6)  # the centre of mass rises with the trunk
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
        return jnp.broadcast_to(array, shape)

    def _apply(self, operation: Operation, arrays: Sequence[Any]) -> tuple[Any, ...]:
        return tuple(_value.bind(*arrays, operation=operation, needed=None))

    def _normalized(self, q: Any) -> Any:
        parts = []
        for span, unit in self._spans:
            part = q[..., span]
            parts.append(part / jnp.linalg.norm(part, axis=-1, keepdims=True) if unit else part)
        return jnp.concatenate(parts, -1)


def _on_host(host: Callable[..., Any], shapes: Sequence[Any], arrays: Sequence[Any]) -> tuple[Any, ...]:
    """Calls a function of NumPy arrays: at once if all arrays are known, so that its exceptions reach the caller."""
    if any(isinstance(array, jax.core.Tracer) for array in arrays):
        return tuple(jax.pure_callback(host, shapes, *arrays, vmap_method="broadcast_all"))
    return tuple(jnp.asarray(y) for y in host(*arrays))


def _solution(layer: "ProblemLayer", keys: Any, *p: Any) -> Any:
    """Returns the solution (x(p), u(p)) of a layer."""
    cut = p[0].ndim - len(layer._solves.parameters[0].shape)
    shapes = [jax.ShapeDtypeStruct((*p[0].shape[:cut], *end), p[0].dtype) for end in layer._solves.ends]

    def host(*p: Any) -> Any:
        return layer._solution(keys, [np.asarray(a) for a in p])

    return _on_host(host, shapes, p)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _adjoint(layer: "ProblemLayer", *tensors: Any) -> Any:
    """Returns dL/dp for the parameters p, x(p), u(p), ∂L/∂x and ∂L/∂u."""
    p = tensors[:-4]

    def host(*tensors: Any) -> Any:
        arrays = [np.asarray(a) for a in tensors]
        return layer._slopes(arrays[:-4], arrays[-4:], (True,) * len(p))

    return _on_host(host, [jax.ShapeDtypeStruct(a.shape, a.dtype) for a in p], tensors)


def _adjoint_forward(layer: "ProblemLayer", *_: Any) -> Any:
    raise layer._only_once()


_adjoint.defvjp(_adjoint_forward, _adjoint_forward)
_solve = jax.custom_vjp(_solution, nondiff_argnums=(0, 1))


def _solve_forward(layer: "ProblemLayer", keys: Any, *p: Any) -> Any:
    solution = _solve(layer, keys, *p)
    return solution, (*p, *solution)


def _solve_backward(layer: "ProblemLayer", keys: Any, kept: Any, slopes: Any) -> Any:
    return _adjoint(layer, *kept, *slopes)


_solve.defvjp(_solve_forward, _solve_backward)


class ProblemLayer(_layer.ProblemLayer):
    """The solution of an optimal control problem as a differentiable function of its parameters.

    A call `xs, us = layer(*values)` solves a problem for each row of the batch, and returns states (*batch, N + 1, nx)
    and controls (*batch, N, nu). If knots differ in nu, controls end with zeros. A problem starts from its last
    solution, or else from `start`. The backward pass multiplies by the derivative of the solution by
    `condyle.optimal.Sensitivity`: one factorisation for each row, then one adjoint pass for each parameter.
    `jax.jit`, `grad`, `vmap` and `jacrev` work; compiled programs call the solver by `jax.pure_callback`.

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

    Arrays have float32 or float64 numbers, and all computations use float64. Second derivatives raise
    `NotImplementedError`, and forward mode (`jvp`) is a `TypeError`. Wrong shapes are a `ValueError`; integers are a
    `TypeError`. If a solve has not converged, or derivatives do not exist, `ProblemError` contains the row. In programs
    that JAX compiles or maps, JAX raises its `JaxRuntimeError` instead, whose text contains the `ProblemError`.

    >>> import condyle, condyle.jax, jax, jax.numpy as jnp, numpy as np
    >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual
    >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
    >>> rest, effort = Cost("rest", 0.1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
    >>> reach = Cost("reach", 10.0, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))
    >>> knot, last = FreeDynamics(arm, 0.05, [rest, effort, reach]), FreeDynamics(arm, None, [rest, reach])
    >>> problem = Problem(x0, [knot], [0] * 10, last)
    >>> layer = condyle.jax.ProblemLayer(problem, ["target/reach", "weight/effort"])
    >>> goals = jnp.array([[0.4, 0.2, 0.5], [0.3, 0.3, 0.5]])
    >>> slope = jax.jit(jax.grad(lambda weight: (layer(goals, weight)[1] ** 2).sum()))
    >>> bool(slope(1e-3) < 0.0)  # a higher weight lowers the efforts
    True
    """

    def _arrays(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        return _floats(names, values)

    def _expand(self, array: Any, shape: tuple[int, ...]) -> Any:
        return jnp.broadcast_to(array, shape)

    def _apply(self, keys: tuple[Hashable, ...] | None, arrays: Sequence[Any]) -> tuple[Any, Any]:
        return _solve(self, keys, *arrays)  # type: ignore[no-any-return]
