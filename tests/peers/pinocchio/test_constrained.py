"""Compares contacts and loops with Pinocchio 4.1, for random robots and for legged robots."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from checks import FRAMES, common_frames
from comparison import ROOT_JOINTS, Pair, State, from_urdf, ours_of
from example_robot_data.robots_loader import ROBOTS
from random_urdf import RandomUrdf
from test_robots import load

import condyle

RANDOM = 30
STATES = 2
LEGGED = ("anymal", "anymal_kinova", "hyq", "solo12", "go1", "bolt", "talos", "talos_legs", "icub_reduced")
WORST_CONDITION = 1e4
"""Maximum condition number of J M⁻¹ Jᵀ for tested constraints. Results for larger condition numbers have too large
rounding errors for a comparison."""
ROUNDINGS = WORST_CONDITION * np.finfo(float).eps
"""Accuracy of ∂q̈/∂τ relative to M⁻¹, in both libraries. ∂q̈/∂τ is M⁻¹ minus a term of the constraints; digits cancel
if M⁻¹ is larger than the difference."""
RESTITUTION = 0.3
STEP = 1e-6
DIFFERENCES = 1e-5
"""Tolerance of central differences with the step STEP, relative to 1 + the largest number of Pinocchio's result."""


@dataclass
class Case:
    """Constraints of a robot in a state, in Condyle and in Pinocchio."""

    state: State
    constraints: list[condyle.ContactConstraint]
    models: "pin.StdVec_RigidConstraintModel"
    datas: "pin.StdVec_RigidConstraintData"

    def set(self) -> condyle.ConstraintSet:
        return condyle.ConstraintSet(self.state.pair.ours, self.constraints)

    def conditions(self) -> float:
        """Returns the condition number of the Delassus matrix J M⁻¹ Jᵀ."""
        s = self.state
        d = ours_of(s)(condyle.constrained_dynamics_derivatives, self.set(), s.q, s.v, s.tau)
        return float(np.inf if d.redundant else np.linalg.cond(d.inertia))


def case(state: State, constraints: list[condyle.ContactConstraint]) -> Case:
    """Creates the constraints for Condyle and for Pinocchio. In Pinocchio, the second placement contains the target."""
    pair = state.pair
    theirs = dict(common_frames(pair))
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for c in constraints:
        first = pair.theirs.frames[theirs[c.frame]]
        target = pin.SE3(np.array(c.placement))
        joint, placement = 0, target
        if c.other is not None:
            second = pair.theirs.frames[theirs[c.other]]
            joint, placement = second.parentJoint, second.placement * target
        kind = pin.ContactType.CONTACT_3D if c.kind == "point" else pin.ContactType.CONTACT_6D
        model = pin.RigidConstraintModel(
            kind, pair.theirs, first.parentJoint, first.placement, joint, placement, FRAMES[c.reference]
        )
        model.m_baumgarte_parameters.Kp, model.m_baumgarte_parameters.Kd = c.kp, c.kd
        data = model.createData()
        data.contact_acceleration_desired = pin.Motion(np.array(c.acceleration))
        models.append(model)
        datas.append(data)
    return Case(state, constraints, models, datas)


def random_case(state: State, seed: int, loops: bool) -> Case:
    """Creates a dozen random constraints, and selects constraints that the robot can satisfy together with unique
    forces."""
    rng, pair = np.random.default_rng(seed), state.pair
    frames = [i for i, _ in common_frames(pair)]
    chosen: list[condyle.ContactConstraint] = []
    for _ in range(12):
        frame, other = (int(f) for f in rng.choice(frames, 2))
        gains = rng.random(2) * 5.0 * rng.integers(2)
        kind = ("point", "rigid")[rng.integers(2)]
        acceleration = rng.standard_normal(6)
        if kind == "point":
            acceleration[3:] = 0.0
        constraint = condyle.ContactConstraint(
            frame,
            kind,
            other if loops and rng.integers(2) else None,
            ("local", "local_world_aligned")[rng.integers(2)],
            *(float(gain) for gain in gains),
            placement=(pin.SE3(pin.exp6(rng.standard_normal(6) * 0.5))).homogeneous,
            acceleration=acceleration,
        )
        try:
            new = case(state, [*chosen, constraint])
            if new.conditions() < WORST_CONDITION:
                chosen.append(constraint)
        except condyle.ModelError:  # neither frame moves, or the constraint occurs twice
            continue
    return case(state, chosen)


def whole(c: condyle.ContactConstraint) -> bool:
    """Returns whether Pinocchio's derivatives by q agree with finite differences of Pinocchio's own q̈ and λ.

    They do not agree for loops of points, and for rigid constraints along the world's axes.
    """
    return c.reference == "local" if c.kind == "rigid" else c.other is None


def check_dynamics(case: Case) -> None:
    """Compares accelerations q̈, constraint forces λ and their derivatives. If Pinocchio's derivatives by q are wrong,
    compares with finite differences of Pinocchio's q̈ and λ."""
    state, pair = case.state, case.state.pair
    model, data, far = pair.theirs, pair.their_data, pair.self_distance
    settings = pin.ProximalSettings(1e-14, 1e-14, 0.0, 1)
    pin.initConstraintDynamics(model, data, case.models, case.datas)

    def theirs(q: np.ndarray) -> np.ndarray:
        a = pin.constraintDynamics(model, data, q, state.v, state.tau, case.models, case.datas, settings)
        return np.concatenate([a, data.lambda_c])

    steps = STEP * np.eye(model.nv)
    ahead = [theirs(pin.integrate(model, state.q, h)) - theirs(pin.integrate(model, state.q, -h)) for h in steps]
    value = theirs(state.q)
    ours = ours_of(state)(condyle.constrained_dynamics, case.set(), state.q, state.v, state.tau)
    pair.expect("constrained_dynamics: a", ours.a, value[: model.nv], far)
    pair.expect("constrained_dynamics: lambda_", ours.lambda_, value[model.nv :], far)
    d = ours_of(state)(condyle.constrained_dynamics_derivatives, case.set(), state.q, state.v, state.tau)
    expected = np.array(ahead).T / (2.0 * STEP)
    difference = np.abs(np.vstack([d.da_dq, d.dlambda_dq]) - expected).max() / (1.0 + np.abs(expected).max())
    assert difference <= DIFFERENCES, f"{pair.name}: {case.constraints}"
    Minv = np.abs(ours_of(state)(condyle.minv, state.q)).max()
    names = ("da_dq", "da_dv", "da_dtau", "dlambda_dq", "dlambda_dv", "dlambda_dtau")
    derivatives = pin.computeConstraintDynamicsDerivatives(model, data, case.models, case.datas, settings)
    for name, their in zip(names, derivatives, strict=True):
        if all(whole(c) for c in case.constraints) or not name.endswith("dq"):
            lost = ROUNDINGS * Minv / (1.0 + np.abs(their).max()) if name == "da_dtau" else 0.0
            pair.expect(f"constrained_dynamics_derivatives: {name}", getattr(d, name), their, max(far, lost))


def check_impacts(case: Case) -> None:
    """Compares the velocities v⁺ after an impact, the impulses Λ, and their derivatives. Pinocchio returns the
    derivatives of v⁺ − v."""
    state, pair = case.state, case.state.pair
    model, data, far = pair.theirs, pair.their_data, pair.self_distance
    args = (model, data, state.q, state.v, case.models, case.datas, RESTITUTION)
    settings = pin.ProximalSettings(1e-14, 1e-14, 0.0, 1)
    pin.initConstraintDynamics(model, data, case.models, case.datas)
    v = pin.impulseDynamics(*args, settings).copy()
    impulses = data.impulse_c.copy()
    d = ours_of(state)(condyle.impulse_dynamics_derivatives, case.set(), state.q, state.v, RESTITUTION)
    pair.expect("impulse_dynamics: v", d.v, v, far)
    pair.expect("impulse_dynamics: lambda_", d.lambda_, impulses, far)
    pin.computeImpulseDynamicsDerivatives(model, data, case.models, case.datas, RESTITUTION, settings)
    pair.expect("impulse_dynamics_derivatives: dv_dq", d.dv_dq, data.ddq_dq, far)
    pair.expect("impulse_dynamics_derivatives: dv_dv", d.dv_dv, data.ddq_dv + np.eye(model.nv), far)
    pair.expect("impulse_dynamics_derivatives: dlambda_dq", d.dlambda_dq, data.dlambda_dq, far)
    pair.expect("impulse_dynamics_derivatives: dlambda_dv", d.dlambda_dv, data.dlambda_dv, far)


def check(pair: Pair, seed: int) -> None:
    for k, state in enumerate(pair.states(STATES, seed)):
        loops, contacts = random_case(state, seed + k, True), random_case(state, seed + k, False)
        check_dynamics(loops)
        check_dynamics(contacts)
        check_dynamics(case(state, [c for c in contacts.constraints if whole(c)]))
        check_impacts(contacts)


@pytest.mark.parametrize("seed", range(RANDOM))
def test_random_robots(seed: int, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(RandomUrdf(seed).text, encoding="utf-8")
    root_joint = (None, *ROOT_JOINTS)[seed % (1 + len(ROOT_JOINTS))]
    check(from_urdf(f"robot {seed}", str(path), root_joint), seed)


@pytest.mark.parametrize("name", [name for name in LEGGED if name in ROBOTS])
def test_legged_robots(name: str) -> None:
    check(load(name), 0)


@pytest.mark.parametrize("name", [name for name in LEGGED if name in ROBOTS])
def test_batches(name: str) -> None:
    """Tests constrained dynamics, impacts and their derivatives in batches, whose states are in SIMD lanes."""
    (state,) = load(name).states(1, seed=50)
    contacts = random_case(state, 50, False)
    state.in_batch = True
    check_dynamics(contacts)
    check_impacts(contacts)
