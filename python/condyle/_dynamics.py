"""The class `Dynamics` that `condyle.torch` and `condyle.jax` have in common: one method for each operation."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Literal

import numpy as np

from . import _operation_table as table
from ._condyle import ConstraintSet, Model
from ._operations import Operation, Pool, Shape


class Dynamics(ABC):
    """Differentiable functions of one robot.

    An argument has the shape (*batch, n) with any batch, also an empty one. Batches broadcast, as in NumPy.
    """

    def __init__(self, model: Model, threads: int = 1) -> None:
        self._model = model
        self._pool = Pool(model, threads)
        self._made: dict[Hashable, Operation] = {}

    def __repr__(self) -> str:
        return f"<{type(self).__module__}.Dynamics of {self._model.name!r}>"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self._model, self._pool.threads)

    @property
    def model(self) -> Model:
        """The robot."""
        return self._model

    @abstractmethod
    def _arrays(self, names: Sequence[str], values: Sequence[Any]) -> list[Any]:
        """Returns the arguments as arrays of the framework, with one type of floating-point numbers."""

    @abstractmethod
    def _expand(self, array: Any, shape: Shape) -> Any:
        """Returns an array of the framework, broadcast to a shape."""

    @abstractmethod
    def _apply(self, operation: Operation, arrays: Sequence[Any]) -> tuple[Any, ...]:
        """Returns the results of an operation; the batches of all arrays are equal."""

    @abstractmethod
    def _normalized(self, q: Any) -> Any:
        """Returns q with its quaternions and pairs divided by their lengths."""

    def _call(self, key: Hashable, make: Callable[[], Operation], *values: Any) -> Any:
        operation = self._made.get(key)
        if operation is None:
            operation = self._made.setdefault(key, make())
        slots = operation.inputs
        arrays = self._arrays([slot.name for slot in slots], values)
        batches = []
        for slot, array in zip(slots, arrays, strict=True):
            shape, cut = tuple(array.shape), len(array.shape) - len(slot.shape)
            if cut < 0 or shape[cut:] != slot.shape:
                expected = ", ".join(map(str, slot.shape))
                raise ValueError(f"{slot.name}: expected shape (..., {expected}), found {shape}")
            batches.append(shape[:cut])
        try:
            batch = batches[0] if all(b == batches[0] for b in batches) else np.broadcast_shapes(*batches)
        except ValueError:
            found = ", ".join(f"{slot.name} {shape}" for slot, shape in zip(slots, batches, strict=True))
            raise ValueError(f"{operation.name}: expected batches that broadcast, found {found}") from None
        arrays = [
            array if found == batch else self._expand(array, (*batch, *slot.shape))
            for slot, array, found in zip(slots, arrays, batches, strict=True)
        ]
        results = self._apply(operation, arrays)
        return results[0] if len(results) == 1 else results

    def rnea(self, q: Any, v: Any, a: Any, f_ext: Any = None) -> Any:
        """Returns the efforts τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i, nv numbers (N m, N). Exact second derivatives
        exist.

        q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: the external force on each
        body in the body's frame, (nbodies, 6), linear part first (N, N m).
        """
        return self._forced(table.rnea, q, v, a, f_ext)

    def aba(self, q: Any, v: Any, tau: Any, f_ext: Any = None) -> Any:
        """Returns the acceleration q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i), nv numbers (rad/s², m/s²). Exact second
        derivatives exist.

        q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`.
        """
        return self._forced(table.aba, q, v, tau, f_ext)

    def _forced(self, make: Callable[[Pool, bool], Operation], q: Any, v: Any, u: Any, f_ext: Any) -> Any:
        forces = f_ext is not None
        arguments = (q, v, u, f_ext) if forces else (q, v, u)
        return self._call((make, forces), lambda: make(self._pool, forces), *arguments)

    def nonlinear_effects(self, q: Any, v: Any) -> Any:
        """Returns h(q, v): `rnea` without acceleration, nv numbers (N m, N). Exact second derivatives exist.

        q: position, nq numbers; v: velocity, nv numbers.
        """
        return self.rnea(q, v, np.zeros(self._model.nv, np.float32))

    def gravity(self, q: Any) -> Any:
        """Returns the efforts g(q) that hold the robot at rest, nv numbers (N m, N). Exact second derivatives exist.

        q: position, nq numbers.
        """
        rest = np.zeros(self._model.nv, np.float32)
        return self.rnea(q, rest, rest)

    def crba(self, q: Any) -> Any:
        """Returns the inertia matrix M(q), (nv, nv), symmetric.

        q: position, nq numbers. The derivative takes O(nv² depth) and nv³ numbers per state.
        """
        return self._call("crba", lambda: table.inertia(self._pool, "crba"), q)

    def minv(self, q: Any) -> Any:
        """Returns the inverse M(q)⁻¹ of the inertia matrix, (nv, nv), symmetric.

        q: position, nq numbers. The derivative is −M⁻¹ ∂M M⁻¹, with nv³ numbers per state.
        """
        return self._call("minv", lambda: table.inertia(self._pool, "minv"), q)

    def com(self, q: Any) -> Any:
        """Returns the centre of mass of the moving bodies in the world's frame, 3 numbers (m).

        q: position, nq numbers.
        """
        return self._centroidal("com", q)

    def com_velocity(self, q: Any, v: Any) -> Any:
        """Returns the velocity of the centre of mass in the world's frame, 3 numbers (m/s).

        q: position, nq numbers; v: velocity, nv numbers.
        """
        return self._centroidal("com_velocity", q, v)

    def com_acceleration(self, q: Any, v: Any, a: Any) -> Any:
        """Returns the acceleration of the centre of mass in the world's frame, 3 numbers (m/s²).

        q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
        """
        return self._centroidal("com_acceleration", q, v, a)

    def centroidal_momentum(self, q: Any, v: Any) -> Any:
        """Returns the momentum about the centre of mass along the world's axes, 6 numbers, linear first (kg m/s, kg
        m²/s).

        q: position, nq numbers; v: velocity, nv numbers.
        """
        return self._centroidal("centroidal_momentum", q, v)

    def centroidal_momentum_rate(self, q: Any, v: Any, a: Any) -> Any:
        """Returns the rate of `centroidal_momentum`, 6 numbers, linear first (N, N m).

        q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
        """
        return self._centroidal("centroidal_momentum_rate", q, v, a)

    def _centroidal(self, name: str, *arguments: Any) -> Any:
        return self._call(name, lambda: table.centroidal(self._pool, name), *arguments)

    def kinetic_energy(self, q: Any, v: Any) -> Any:
        """Returns the kinetic energy T = ½ vᵀ M(q) v, a number (J). Exact second derivatives exist.

        q: position, nq numbers; v: velocity, nv numbers.
        """
        return self._call("kinetic_energy", lambda: table.energy(self._pool, "kinetic_energy"), q, v)

    def potential_energy(self, q: Any) -> Any:
        """Returns the potential energy V = −m gᵀ c(q), a number (J). Exact second derivatives exist.

        q: position, nq numbers.
        """
        return self._call("potential_energy", lambda: table.energy(self._pool, "potential_energy"), q)

    def mechanical_energy(self, q: Any, v: Any) -> Any:
        """Returns the mechanical energy T + V, a number (J). Exact second derivatives exist.

        q: position, nq numbers; v: velocity, nv numbers.
        """
        return self.kinetic_energy(q, v) + self.potential_energy(q)

    def forward_kinematics(self, q: Any) -> Any:
        """Returns the pose of each body in the world as a homogeneous matrix, (nbodies, 4, 4).

        q: position, nq numbers.
        """
        return self._call("forward_kinematics", lambda: table.poses(self._pool, None), q)

    def frame_placement(self, q: Any, frame: str | int) -> Any:
        """Returns the pose of a frame in the world as a homogeneous matrix, (4, 4).

        q: position, nq numbers; frame: the frame's name or index.
        """
        index = self._frame(frame)
        return self._call(("pose", index), lambda: table.poses(self._pool, index), q)

    def frame_velocity(
        self, q: Any, v: Any, frame: str | int, reference: Literal["local", "world", "local_world_aligned"] = "local"
    ) -> Any:
        """Returns the velocity of a frame, 6 numbers, linear first (m/s, rad/s).

        q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: 'local', 'world'
        or 'local_world_aligned', as for `condyle.frame_jacobian`.
        """
        return self._frame_motion("frame_velocity", frame, reference, q, v)

    def frame_acceleration(
        self,
        q: Any,
        v: Any,
        a: Any,
        frame: str | int,
        reference: Literal["local", "world", "local_world_aligned"] = "local",
    ) -> Any:
        """Returns the spatial acceleration of a frame, 6 numbers, linear first (m/s², rad/s²).

        q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame, reference: as for
        `frame_velocity`.
        """
        return self._frame_motion("frame_acceleration", frame, reference, q, v, a)

    def frame_classical_acceleration(
        self,
        q: Any,
        v: Any,
        a: Any,
        frame: str | int,
        reference: Literal["local", "world", "local_world_aligned"] = "local",
    ) -> Any:
        """Returns the classical acceleration of a frame, 6 numbers, linear first (m/s², rad/s²).

        q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame, reference: as for
        `frame_velocity`.
        """
        return self._frame_motion("frame_classical_acceleration", frame, reference, q, v, a)

    def _frame_motion(
        self, name: str, frame: str | int, reference: Literal["local", "world", "local_world_aligned"], *arguments: Any
    ) -> Any:
        index = self._frame(frame)
        key = (name, index, reference)
        return self._call(key, lambda: table.frame_motion(self._pool, name, index, reference), *arguments)

    def _frame(self, frame: str | int) -> int:
        return self._model.frame(frame) if isinstance(frame, str) else int(frame)

    def constrained_dynamics(self, constraints: ConstraintSet, q: Any, v: Any, tau: Any) -> tuple[Any, Any]:
        """Returns the acceleration and the constraint forces (q̈, λ): nv numbers (rad/s², m/s²), and `constraints.rows`
        numbers (N, N m).

        constraints: contacts and loops of this robot; q: position, nq numbers; v, tau: velocity and efforts, nv numbers
        each. The targets of the constraints are constants. Do not change them between a value and its derivative.
        """
        make = lambda: table.constrained(self._pool, constraints, False, 0.0)  # noqa: E731
        return self._call(("constrained", constraints), make, q, v, tau)  # type: ignore[no-any-return]

    def impulse_dynamics(self, constraints: ConstraintSet, q: Any, v: Any, restitution: float = 0.0) -> tuple[Any, Any]:
        """Returns the velocity after an impact and the impulses (v⁺, Λ): nv numbers (rad/s, m/s), and
        `constraints.rows` numbers (N s, N m s).

        constraints: contacts of this robot; q: position, nq numbers; v: velocity before the impact, nv numbers;
        restitution: 0 for frames that stick, 1 for an impact that loses no energy.
        """
        make = lambda: table.constrained(self._pool, constraints, True, restitution)  # noqa: E731
        return self._call(("impulse", constraints, restitution), make, q, v)  # type: ignore[no-any-return]

    def passive_torque(self, q: Any, v: Any, smoothing: float) -> Any:
        """Returns the passive torque of damping, friction, springs and gravity compensation, nv numbers (N m, N).

        q: position, nq numbers; v: velocity, nv numbers; smoothing: the speed over which the sign of friction changes
        (rad/s, m/s), above 0.
        """
        return self._call(("passive", smoothing), lambda: table.passive(self._pool, smoothing), q, v)

    def integrate(self, q: Any, v: Any) -> Any:
        """Returns the position q ⊕ v, nq numbers, with quaternions and pairs (cos, sin) of length 1.

        q: position, nq numbers; v: tangent vector, nv numbers, such as a velocity times a time step.
        """
        return self._call("integrate", lambda: table.group(self._pool, "integrate"), q, v)

    def difference(self, q0: Any, q1: Any) -> Any:
        """Returns the tangent vector q₁ ⊖ q₀, nv numbers, with q₀ ⊕ (q₁ ⊖ q₀) = q₁.

        q0, q1: positions, nq numbers each. The derivative does not exist for a rotation of π.
        """
        return self._call("difference", lambda: table.group(self._pool, "difference"), q0, q1)

    def normalize(self, q: Any) -> Any:
        """Returns q with its quaternions and pairs (cos, sin) divided by their lengths, nq numbers. All derivatives
        exist.

        q: position, nq numbers. A quaternion or a pair of length 0 becomes NaN.
        """
        (array,) = self._arrays(["q"], [q])
        shape = tuple(array.shape)
        if not shape or shape[-1] != self._model.nq:
            raise ValueError(f"q: expected shape (..., {self._model.nq}), found {shape}")
        return self._normalized(array)
