"""Robot in Pinocchio and in Condyle, the states in which the libraries are compared, and the tolerances."""

import inspect
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
import pinocchio as pin

import condyle

TOLERANCE = 1e-10
"""Tolerance relative to 1 + the largest number of Pinocchio's result. The tolerance allows several thousand rounding
errors of double precision, and more for ill-conditioned positions."""
SELF_DISTANCE = 10.0
"""Tolerance of results that contain M⁻¹, as a multiple of the difference between two methods of Pinocchio for the same
result."""
UNLIMITED = 3.0
"""Bound of random coordinates without limits: they are between −3 and 3 (rad, m)."""

ROOT_JOINTS = {
    "free_flyer": pin.JointModelFreeFlyer,
    "planar": pin.JointModelPlanar,
    "spherical": pin.JointModelSpherical,
    "translation": pin.JointModelTranslation,
}

BATCH, HERE = 11, 9
"""Number of states in a batch, and index of the state that is compared. The number of states is larger than the number
of lanes of a SIMD vector, and not a multiple of the number of lanes."""

SELF_STATES = 20
"""Number of states in which two methods of Pinocchio for the same result are compared."""


@dataclass
class Record:
    """Largest difference of one quantity from Pinocchio, over all robots and states."""

    share: float = 0.0
    """Largest difference, as a fraction of its tolerance."""
    difference: float = 0.0
    """Largest difference, relative to 1 + the largest number of Pinocchio's result."""
    bound: float = TOLERANCE
    """Tolerance of the comparison with the largest difference."""
    where: str = ""
    """Name of the robot with the largest difference."""
    robots: set[str] = field(default_factory=set)
    """Names of all robots for which the quantity was compared."""

    def add(self, difference: float, bound: float, robot: str) -> None:
        self.robots.add(robot)
        if not self.where or not difference / bound <= self.share:
            self.share, self.difference, self.bound, self.where = difference / bound, difference, bound, robot


records: dict[str, Record] = defaultdict(Record)
"""Map from the name of a quantity to its record, for the summary."""
sizes: dict[str, tuple[str, int, int, int]] = {}
"""Map from the name of a robot to its root joint, number of moving bodies, nq and nv, for the summary."""


class Pair:
    """Models of one robot in Pinocchio and in Condyle."""

    def __init__(
        self,
        name: str,
        theirs: pin.Model,
        ours: condyle.Model,
        root_joint: str | None = None,
        chains: list[list[int]] | None = None,
    ) -> None:
        self.name, self.theirs, self.ours, self.root_joint = name, theirs, ours, root_joint
        self.their_data, self.data = theirs.createData(), condyle.Data(ours)
        self.chains = chains or [[i] for i in range(ours.nbodies)]
        """Indices of Condyle's bodies for each joint of Pinocchio. A composite joint has several bodies."""
        self.bodies = [chain[-1] for chain in self.chains]
        """Index of Condyle's body that each joint of Pinocchio moves directly."""
        self.rates = all(len(chain) == 1 for chain in self.chains)
        """Whether Pinocchio's rates and derivatives are correct. They are wrong for composite joints, whose axes
        Pinocchio treats as fixed in the body."""

    @cached_property
    def columns(self) -> np.ndarray:
        """Returns the columns of Condyle's regressors for the bodies that Pinocchio's joints carry. Pinocchio's
        regressors have only these columns."""
        return np.concatenate([np.arange(10 * body - 10, 10 * body) for body in self.bodies[1:]])

    def record_size(self) -> None:
        """Adds the size of the robot to the summary."""
        ours = self.ours
        sizes[self.name] = (self.root_joint or "none", ours.nbodies - 1, ours.nq, ours.nv)

    def with_armature(self, armature: np.ndarray) -> "Pair":
        """Returns the same robot with armature in both libraries. The linear coordinates of a free joint get no
        armature, because its meaning differs between the libraries."""
        armature = armature.copy()
        for kind, first in zip(self.ours.joint_types, self.ours.idx_vs, strict=True):
            if kind == "free_flyer":
                armature[first : first + 3] = 0.0
        theirs = self.theirs.copy()
        theirs.armature = armature
        return Pair(self.name, theirs, self.ours.with_armature(armature), self.root_joint, self.chains)

    def states(self, count: int, seed: int = 0) -> "list[State]":
        """Returns random states: q is within the limits, and all other numbers are standard normal."""
        return [State(self, seed + i) for i in range(count)]

    @cached_property
    def self_distance(self) -> float:
        """Returns the largest relative difference between two methods of Pinocchio for forward dynamics; NaN if M has
        no inverse."""
        return float(np.max([state.self_distance() for state in self.states(SELF_STATES, seed=100)]))

    def expect(self, what: str, ours: np.ndarray, theirs: np.ndarray, self_distance: float = 0.0) -> None:
        """Checks that Condyle's result equals Pinocchio's. `self_distance` is the relative difference between two
        methods of Pinocchio for the same result."""
        ours, theirs = np.asarray(ours), np.asarray(theirs)
        assert ours.shape == theirs.shape, f"{what} of {self.name}: shape {ours.shape}, expected {theirs.shape}"
        if not theirs.size:
            return
        assert np.isfinite(theirs).all(), f"{what} of {self.name}: Pinocchio's is not finite"
        difference = np.abs(ours - theirs).max() / (1.0 + np.abs(theirs).max())
        bound = max(TOLERANCE, SELF_DISTANCE * self_distance)
        records[what].add(float(difference), bound, self.name)
        assert difference <= bound, f"{what} of {self.name}: differs by {difference:.1e}, allowed are {bound:.1e}"


def from_urdf(name: str, path: str, root_joint: str | None, mimic: bool = False) -> Pair:
    """Reads a robot from the same URDF with Pinocchio and with Condyle. With `mimic`, the size of the robot is not
    recorded."""
    root = (ROOT_JOINTS[root_joint](),) if root_joint else ()
    theirs = pin.buildModelFromUrdf(path, *root, mimic=mimic)
    pair = Pair(name, theirs, condyle.Model.from_urdf(path, root_joint=root_joint, mimic=mimic), root_joint)
    if not mimic:
        pair.record_size()
    return pair


class State:
    """State for a comparison: position, velocity, acceleration, efforts and external forces."""

    def __init__(self, pair: Pair, seed: int) -> None:
        model, rng = pair.theirs, np.random.default_rng(seed)
        lower, upper = model.lowerPositionLimit.copy(), model.upperPositionLimit.copy()
        lower[~(np.abs(lower) < 1e6)] = -UNLIMITED
        upper[~(np.abs(upper) < 1e6)] = UNLIMITED
        pin.seed(seed)
        self.q = pin.randomConfiguration(model, lower, upper)
        self.q1 = pin.randomConfiguration(model, lower, upper)
        self.v, self.a, self.tau = rng.standard_normal((3, model.nv))
        self.f_ext = np.zeros((pair.ours.nbodies, 6))
        self.f_ext[pair.bodies] = rng.standard_normal((model.njoints, 6))
        self.pair = pair
        self.in_batch = False
        """Whether Condyle's functions are called with a batch of states that contains this state."""

    @cached_property
    def their_forces(self) -> "pin.StdVec_Force":
        forces = pin.StdVec_Force()
        for row in self.f_ext[self.pair.bodies]:
            forces.append(pin.Force(row))
        return forces

    def self_distance(self) -> float:
        """Returns the relative difference between two results of Pinocchio for forward dynamics: one computed in the
        world's frame, one in the bodies' frames."""
        args = (self.pair.theirs, self.pair.their_data, self.q, self.v, self.tau)
        local, world = pin.aba(*args, pin.Convention.LOCAL).copy(), pin.aba(*args, pin.Convention.WORLD).copy()
        return float(np.abs(local - world).max() / (1.0 + np.abs(world).max()))


def ours_of(state: State) -> Callable[..., np.ndarray]:
    """Returns an object with Condyle's functions, which passes model and data to each function."""
    model, data = state.pair.ours, state.pair.data
    if not state.in_batch:
        return lambda function, *args: function(model, data, *args)

    others = {"q": np.stack([condyle.random_configuration(model, seed=k) for k in range(BATCH)])}

    def together(name: str, arg: np.ndarray) -> np.ndarray:
        if name not in others:
            others[name] = np.random.default_rng(len(others)).standard_normal((BATCH, *arg.shape))
        others[name][HERE] = arg
        return others[name]

    def call(function: Callable[..., Any], *args: Any) -> Any:
        names = arguments_of(function)
        many = (together(n, x) if isinstance(x, np.ndarray) else x for n, x in zip(names, args, strict=False))
        return of_state(function(model, data, *many))

    return call


@cache
def arguments_of(function: Callable[..., Any]) -> list[str]:
    """Returns the names of a function's parameters, without model and data. The names are cached, because reading a
    signature takes longer than most calls."""
    return list(inspect.signature(function).parameters)[2:]


def of_state(results: Any) -> Any:
    """Returns the results for the compared state, selected from the results of a batch."""
    if not isinstance(results, tuple):
        return results[HERE]
    members = map(of_state, results)
    return results._make(members) if hasattr(results, "_make") else tuple(members)


def theirs_of(state: State) -> Callable[..., np.ndarray]:
    """Returns an object with Pinocchio's functions, which passes model and data to each function."""
    return lambda function, *args: function(state.pair.theirs, state.pair.their_data, *args)
