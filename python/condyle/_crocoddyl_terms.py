"""Conversion of Crocoddyl's costs, constraints, contacts and actuation models.

Objects of Crocoddyl are identified by the names of their classes, so Crocoddyl is needed only for a conversion.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._condyle import Activation, Cost, FrictionCone, Limit, Residual, WrenchCone
from ._crocoddyl_robot import NoCounterpartError, Robot
from ._types import ContactConstraint

_Array = NDArray[np.float64]

NO_BOUND = 1e300
"""Magnitude from which a bound counts as infinite."""
REFERENCES = {"LOCAL": "local", "WORLD": "world", "LOCAL_WORLD_ALIGNED": "local_world_aligned"}
HELD = {"LOCAL": "local", "WORLD": "local_world_aligned", "LOCAL_WORLD_ALIGNED": "local_world_aligned"}
"""Condyle's word for the axes of a contact, by Crocoddyl's word. In Crocoddyl's contacts, WORLD means the world's axes
at the frame's origin.
"""
AT_THE_END = {
    "ResidualModelControl",
    "ResidualModelJointAcceleration",
    "ResidualModelJointEffort",
    "ResidualModelContactForce",
    "ResidualModelContactFrictionCone",
    "ResidualModelContactWrenchCone",
    "ResidualModelContactCoPPosition",
}
"""Residuals that are constant in Crocoddyl's terminal models: ResidualModelJointEffort is minus its reference, the
other residuals are zero.
"""


def kind(theirs: Any) -> str:
    """Returns the name of an object's class, with its module if the class is not Crocoddyl's own."""
    made = type(theirs)
    own = made.__module__.split(".")[0] == "crocoddyl"
    return made.__name__ if own else f"{made.__module__}.{made.__name__}"


def bounds(numbers: Any) -> _Array:
    """Converts bounds; a bound whose magnitude is at least `NO_BOUND` becomes infinite."""
    x = np.asarray(numbers, float)
    out: _Array = np.where(np.abs(x) < NO_BOUND, x, np.copysign(np.inf, x))
    return out


class Drives:
    """An actuation model τ = S u with constant S."""

    def __init__(self, theirs: Any, state: Any) -> None:
        nv, nu = state.nv, theirs.nu
        elsewhere, ones = state.integrate(state.zero(), np.full(state.ndx, 0.3)), np.ones(nu)
        tau0, S, by_x = self._at(theirs, state.zero(), np.zeros(nu))
        tau1, again, _ = self._at(theirs, elsewhere, ones)
        if tau0.any() or by_x.any() or not (np.allclose(S, again) and np.allclose(tau1, S @ ones)):
            raise NoCounterpartError(f"{kind(theirs)} (drives other than τ = S u with a constant S)")
        self.matrix = S
        driven = np.eye(nv)[:, nv - nu :]
        floating = state.pinocchio.joints[1].shortname() == "JointModelFreeFlyer"
        self.usual = nu == nv - 6 * floating and np.array_equal(S, driven)

    @staticmethod
    def _at(theirs: Any, x: _Array, u: _Array) -> tuple[_Array, _Array, _Array]:
        """Returns the efforts τ of an actuation model, and the derivatives ∂τ/∂u and ∂τ/∂x."""
        data = theirs.createData()
        theirs.calc(data, x, u)
        theirs.calcDiff(data, x, u)
        shape = (len(data.tau), len(u))
        return np.array(data.tau), np.array(data.dtau_du, float).reshape(shape), np.array(data.dtau_dx, float)

    def given(self) -> _Array | None:
        """Returns the argument `actuation` for Condyle's actions: the actuation matrix S, or None if each joint except
        a free-flyer at the root has a control.
        """
        return None if self.usual else self.matrix


class Terms:
    """Converts the costs and constraints of an action.

    names: the name of each contact, by the index of the contact's frame; drives: the actuation model, if accelerations
    are controls.
    """

    def __init__(self, robot: Robot, names: dict[int, str], drives: Drives | None = None, end: bool = False) -> None:
        self.robot, self.names, self.drives, self.end = robot, names, drives, end

    def costs(self, theirs: Any) -> list[Cost]:
        """Returns the active costs of a `CostModelSum`, by name."""
        items = [item.data() for item in theirs if item.data().active]
        return [self._cost(item) for item in items if not self._vanishes(item.cost)]

    def limits(self, theirs: Any) -> list[Limit]:
        """Returns the active constraints of a `ConstraintModelManager`, by name."""
        items = [item.data() for item in theirs if item.data().active]
        counts = [item for item in items if not self.end or item.constraint.T_constraint]
        return [self._limit(item) for item in counts if not self._vanishes(item.constraint)]

    def _vanishes(self, term: Any) -> bool:
        """Returns whether a term is zero in a terminal model because the term's residual is zero in terminal models. A
        constant term that is not zero is an error.
        """
        residual: Any = getattr(term, "residual", None)
        if not self.end or kind(residual) not in AT_THE_END:
            return False
        r = np.zeros(residual.nr) - (residual.reference if kind(residual) == "ResidualModelJointEffort" else 0.0)
        if hasattr(term, "activation"):  # only costs have an activation; constraints do not
            data = term.activation.createData()
            term.activation.calc(data, r)
            if data.a_value:
                raise NoCounterpartError(f"{kind(residual)} (a constant cost at the end)")
        return True

    def _cost(self, item: Any) -> Cost:
        if kind(item.cost) not in ("CostModelResidual", "CostModelAbstract") or not hasattr(item.cost, "residual"):
            raise NoCounterpartError(f"{kind(item.cost)} of cost `{item.name}`")
        try:
            residual, all_of_them = self._residual(item.cost.residual)
            return Cost(item.name, item.weight, residual, activation(item.cost.activation, all_of_them))
        except NoCounterpartError as missing:
            raise NoCounterpartError(f"{missing} of cost `{item.name}`") from None

    def _limit(self, item: Any) -> Limit:
        theirs = item.constraint
        try:
            residual, (which, n) = self._residual(theirs.residual)
        except NoCounterpartError as missing:
            raise NoCounterpartError(f"{missing} of constraint `{item.name}`") from None
        if theirs.nh and theirs.ng:
            raise NoCounterpartError(f"constraint `{item.name}` (equations and inequalities at once)")
        lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
        lower[which], upper[which] = (0.0, 0.0) if theirs.nh else (bounds(theirs.lb), bounds(theirs.ub))
        return Limit(item.name, residual, lower, upper)

    def _contact(self, theirs: Any) -> str:
        if theirs.id not in self.names:
            name = self.robot.theirs.frames[theirs.id].name
            raise NoCounterpartError(f"{kind(theirs)} of frame `{name}` (which touches nothing)")
        return self.names[theirs.id]

    def _residual(self, theirs: Any) -> tuple[Residual, tuple[_Array, int]]:
        """Converts a residual. Also returns the indices of the entries that Crocoddyl's residual has, and the number of
        all entries.
        """
        make = _RESIDUALS.get(kind(theirs))
        if kind(theirs) == "ResidualModelJointEffort":
            return self._efforts(theirs)
        if make is None or not self._means_the_same(kind(theirs)):
            raise NoCounterpartError(kind(theirs))
        return make(self, theirs), (np.arange(theirs.nr), theirs.nr)

    def _means_the_same(self, name: str) -> bool:
        """Returns whether a residual has the same value in Condyle. Two residuals differ: the gravity residual in
        contact, and the velocity jump at the terminal knot.
        """
        if name == "ResidualModelControlGrav":
            return self.drives is None and not self.end and not self.names
        return not (self.end and name == "ResidualModelImpulseCoM")

    def _efforts(self, theirs: Any) -> tuple[Residual, tuple[_Array, int]]:
        """Converts a residual of joint efforts to a residual of the controls, or to a residual of the efforts of
        inverse dynamics.
        """
        if self.drives is None:
            return Residual.control(theirs.reference), (np.arange(theirs.nr), theirs.nr)
        if not self.drives.usual:
            raise NoCounterpartError("ResidualModelJointEffort (of other drives than joints)")
        nv = self.robot.model.nv
        which, reference = np.arange(nv - theirs.nr, nv), np.zeros(nv)
        reference[which] = theirs.reference
        return Residual.joint_effort(reference), (which, nv)


def _cone(theirs: Any) -> FrictionCone:
    greatest = np.inf if theirs.max_nforce > NO_BOUND else theirs.max_nforce
    return FrictionCone(theirs.mu, theirs.nf, theirs.inner_appr, theirs.R, theirs.min_nforce, greatest)


def _framed(make: Callable[..., Residual]) -> Callable[["Terms", Any], Residual]:
    """Returns a function that converts residuals with a frame and a target; `make` creates the residual."""

    def made(terms: "Terms", theirs: Any) -> Residual:
        target = getattr(theirs.reference, "homogeneous", theirs.reference)
        return make(terms.robot.model, terms.robot.frame(theirs.id), target)

    return made


_RESIDUALS: dict[str, Callable[[Terms, Any], Residual]] = {
    "ResidualModelState": lambda terms, theirs: Residual.state(theirs.reference),
    "ResidualModelControl": lambda terms, theirs: Residual.control(theirs.reference),
    "ResidualModelControlGrav": lambda terms, theirs: Residual.control_gravity(),
    "ResidualModelJointAcceleration": lambda terms, theirs: Residual.joint_acceleration(theirs.reference),
    "ResidualModelCoMPosition": lambda terms, theirs: Residual.center_of_mass(theirs.reference),
    "ResidualModelCentroidalMomentum": lambda terms, theirs: Residual.centroidal_momentum(theirs.reference),
    "ResidualModelFramePlacement": _framed(Residual.frame_placement),
    "ResidualModelFrameTranslation": _framed(Residual.frame_translation),
    "ResidualModelFrameRotation": _framed(Residual.frame_rotation),
    "ResidualModelFrameVelocity": lambda terms, theirs: Residual.frame_velocity(
        terms.robot.model, terms.robot.frame(theirs.id), theirs.reference.vector, REFERENCES[str(theirs.type)]
    ),
    "ResidualModelContactForce": lambda terms, theirs: Residual.contact_force(
        terms._contact(theirs), theirs.reference.vector
    ),
    "ResidualModelContactFrictionCone": lambda terms, theirs: Residual.friction_cone(
        terms._contact(theirs), _cone(theirs.reference)
    ),
    "ResidualModelContactWrenchCone": lambda terms, theirs: Residual.wrench_cone(
        terms._contact(theirs), WrenchCone(_cone(theirs.reference), theirs.reference.box)
    ),
    "ResidualModelContactCoPPosition": lambda terms, theirs: Residual.center_of_pressure(
        terms._contact(theirs), theirs.reference.box, theirs.reference.R
    ),
    "ResidualModelImpulseCoM": lambda terms, theirs: Residual.impulse_center_of_mass(),
}


def activation(theirs: Any, entries: tuple[_Array, int]) -> Activation:
    """Converts the activation of a residual. entries: the indices of the residual's active entries, and the number of
    its entries.
    """
    which, n = entries
    name, all_of_them = kind(theirs), len(which) == n
    if name == "ActivationModelQuad" and all_of_them:
        return Activation.quadratic()
    if name in ("ActivationModelQuad", "ActivationModelWeightedQuad"):
        w = np.zeros(n)
        w[which] = 1.0 if name == "ActivationModelQuad" else theirs.weights
        return Activation.weighted(w)
    if name == "ActivationModelQuadraticBarrier":
        lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
        lower[which], upper[which] = bounds(theirs.bounds.lb), bounds(theirs.bounds.ub)
        return Activation.barrier(lower, upper)
    if name in ("ActivationModelSmooth1Norm", "ActivationModelSmooth2Norm") and all_of_them:
        data = theirs.createData()
        theirs.calc(data, np.zeros(n))  # at r = 0 the value is n √ε for Smooth1Norm, and √ε for Smooth2Norm
        if name == "ActivationModelSmooth1Norm":
            return Activation.smooth1((data.a_value / n) ** 2)
        return Activation.smooth2(data.a_value**2)
    raise NoCounterpartError(name)


def contact(robot: Robot, theirs: Any) -> ContactConstraint:
    """Converts a contact of a `ContactModelMultiple`, or an impulse of an `ImpulseModelMultiple`."""
    name, place, turned, axes = kind(theirs), np.eye(4), None, HELD[str(theirs.type)]
    if name in ("ContactModel6D", "ContactModel3D", "ContactModel2D", "ContactModel1D"):
        kp, kd = theirs.gains
        form = {"6D": "rigid", "3D": "point", "2D": "plane", "1D": "line"}[name[-2:]]
        if form == "rigid":
            place = theirs.reference.homogeneous
        elif form == "point":
            place[:3, 3] = theirs.reference
        elif form == "plane":
            axes, place[[0, 2], 3] = "local", theirs.reference
            if kp:
                raise NoCounterpartError("ContactModel2D (with a gain of position, which mixes the axes of two frames)")
        else:
            turned, place[:3, 3] = theirs.Raxis.T, theirs.Raxis @ [0.0, 0.0, theirs.reference]
    elif name in ("ImpulseModel6D", "ImpulseModel3D"):
        kp, kd, form = 0.0, 0.0, {"6D": "rigid", "3D": "point"}[name[-2:]]
    else:
        raise NoCounterpartError(name)
    frame: Any = robot.frame(theirs.id)
    made: Any = ContactConstraint
    held: ContactConstraint = made(frame, form, None, axes, kp, kd, place, axes=turned)
    return held
