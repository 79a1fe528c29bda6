"""Tests `condyle.pinocchio`: the same scripts run with this module and with Pinocchio, and give the same numbers."""

import copy
import doctest
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio
import pytest

import condyle
import condyle.pinocchio

SAME = 1e-10
ROBOTS = {"arm7": condyle.robots.ARM7, "quadruped": condyle.robots.QUADRUPED, "humanoid": condyle.robots.HUMANOID}
FRAME = {"arm7": "tool", "quadruped": "LF_foot", "humanoid": "left_sole"}

Script = Callable[[ModuleType, Any, Any, Any, int], Any]


class State:
    """State of a robot, and external forces on all bodies."""

    def __init__(self, model: condyle.Model) -> None:
        rng = np.random.default_rng(3)
        self.q = condyle.random_configuration(model, seed=3)
        self.v, self.a, self.tau = rng.standard_normal((3, model.nv))
        self.f = rng.standard_normal((model.nbodies, 6))

    def forces(self, pin: ModuleType) -> Any:
        forces = [pin.Force(f) for f in self.f]
        if pin is condyle.pinocchio:
            return forces
        out = pin.StdVec_Force()
        out.extend(forces)
        return out


def kinematics(pin: ModuleType, m: Any, d: Any, s: State, frame: int) -> Any:
    pin.forwardKinematics(m, d, s.q, s.v, s.a)
    pin.updateFramePlacements(m, d)
    out = [d.oMf[frame].homogeneous, d.oMi[m.njoints - 1].rotation, d.v[2].vector, d.a[2].vector]
    for axes in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
        out += [pin.getFrameVelocity(m, d, frame, axes).vector, pin.getFrameAcceleration(m, d, frame, axes).vector]
        out += [pin.getFrameClassicalAcceleration(m, d, frame, axes).vector, pin.getVelocity(m, d, 3, axes).vector]
        out += [pin.getAcceleration(m, d, 3, axes).vector, pin.getClassicalAcceleration(m, d, 3, axes).vector]
        out += [pin.computeFrameJacobian(m, d, s.q, frame, axes)]
    pin.computeJointJacobians(m, d, s.q)
    pin.framesForwardKinematics(m, d, s.q)
    out += [pin.getFrameJacobian(m, d, frame, pin.ReferenceFrame.LOCAL), pin.getJointJacobian(m, d, 3, pin.WORLD)]
    return [*out, pin.computeJointJacobian(m, d, s.q, 3), d.oMf[frame].translation]


SCRIPTS: dict[str, Script] = {
    "rnea": lambda pin, m, d, s, f: (
        pin.rnea(m, d, s.q, s.v, s.a).copy(),
        d.tau.copy(),
        pin.rnea(m, d, s.q, s.v, s.a, s.forces(pin)).copy(),
    ),
    "aba": lambda pin, m, d, s, f: (
        pin.aba(m, d, s.q, s.v, s.tau).copy(),
        d.ddq.copy(),
        pin.aba(m, d, s.q, s.v, s.tau, s.forces(pin)).copy(),
    ),
    "inertia": lambda pin, m, d, s, f: (pin.crba(m, d, s.q).copy(), pin.computeMinverse(m, d, s.q).copy(), d.Minv),
    "efforts": lambda pin, m, d, s, f: (
        pin.nonLinearEffects(m, d, s.q, s.v).copy(),
        pin.computeGeneralizedGravity(m, d, s.q).copy(),
        pin.computeCoriolisMatrix(m, d, s.q, s.v) @ s.v,
    ),
    "rnea derivatives": lambda pin, m, d, s, f: (
        *pin.computeRNEADerivatives(m, d, s.q, s.v, s.a)[:2],
        d.dtau_dq,
        d.dtau_dv,
    ),
    "aba derivatives": lambda pin, m, d, s, f: (
        *pin.computeABADerivatives(m, d, s.q, s.v, s.tau, s.forces(pin)),
        d.ddq_dq,
        d.ddq_dv,
    ),
    "kinematics": kinematics,
    "centre of mass": lambda pin, m, d, s, f: (
        pin.centerOfMass(m, d, s.q, s.v, s.a),
        d.com[0],
        d.vcom[0],
        d.acom[0],
        pin.jacobianCenterOfMass(m, d, s.q),
        pin.ccrba(m, d, s.q, s.v),
        d.hg.vector,
        pin.computeCentroidalMomentum(m, d, s.q, s.v).angular,
        pin.computeTotalMass(m),
    ),
    "energies": lambda pin, m, d, s, f: (
        pin.computeKineticEnergy(m, d, s.q, s.v),
        pin.computePotentialEnergy(m, d, s.q),
    ),
    "group": lambda pin, m, d, s, f: (
        pin.neutral(m),
        pin.integrate(m, s.q, s.v),
        pin.difference(m, s.q, pin.integrate(m, s.q, 0.1 * s.v)),
        pin.interpolate(m, s.q, pin.neutral(m), 0.3),
        *pin.dIntegrate(m, s.q, s.v),
        *pin.dDifference(m, s.q, pin.integrate(m, s.q, 0.1 * s.v)),
    ),
    "algebra": lambda pin, m, d, s, f: (
        pin.exp6(s.f[1]).homogeneous,
        pin.log6(pin.exp6(s.f[1])).vector,
        pin.Jexp6(s.f[1]),
        pin.Jlog3(pin.exp3(s.f[1][3:])),
        pin.exp6(s.f[1]).actInv(pin.Force(s.f[2])).vector,
        (pin.exp6(s.f[1]) * pin.SE3.Identity()).act(pin.Motion(s.f[2])).vector,
        pin.exp6(s.f[1]).dualAction,
        pin.skew(s.f[1][:3]),
    ),
    "model": lambda pin, m, d, s, f: (
        [m.nq, m.nv, m.njoints, m.getJointId(m.names[2]), m.existFrame("nothing")],
        m.idx_vs[1:],
        m.nvs[1:],
        m.frames[f].placement.homogeneous,
        m.frames[f].parentJoint,
    ),
}


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("script", SCRIPTS)
def test_same_lines_same_numbers(robot: str, script: str) -> None:
    found: list[list[Any]] = []
    state = State(condyle.Model.from_urdf_str(ROBOTS[robot], root_joint=None if robot == "arm7" else "free_flyer"))
    for pin in (condyle.pinocchio, pinocchio):
        root = () if robot == "arm7" else (pin.JointModelFreeFlyer(),)
        model = pin.buildModelFromXML(ROBOTS[robot], *root)
        frame = model.getFrameId(FRAME[robot])
        found.append([np.array(x, float) for x in SCRIPTS[script](pin, model, model.createData(), state, frame)])
    assert len(found[0]) == len(found[1]) > 0
    for ours, theirs in zip(*found, strict=True):
        assert ours.shape == theirs.shape
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=SAME * (1.0 + np.abs(theirs).max()))


def test_its_example() -> None:
    assert doctest.testmod(condyle.pinocchio).failed == 0
    assert doctest.testmod(condyle.algebra).failed == 0


def test_what_is_not_there_says_so() -> None:
    with pytest.raises(AttributeError, match="condyle.pinocchio has no `buildGeomFromUrdf`"):
        condyle.pinocchio.buildGeomFromUrdf  # noqa: B018
    model = condyle.pinocchio.buildModelFromXML(condyle.robots.ARM7)
    with pytest.raises(AttributeError, match="data.oMf: no function has made it yet"):
        model.createData().oMf  # noqa: B018
    with pytest.raises(ValueError, match="frame_id: expected 1 to"):
        condyle.pinocchio.computeFrameJacobian(model, model.createData(), np.zeros(7), model.nframes)


def test_locked_joints() -> None:
    q = np.full(7, 0.3)
    locked = []
    for pin in (condyle.pinocchio, pinocchio):
        model = pin.buildReducedModel(pin.buildModelFromXML(condyle.robots.ARM7), [6, 7], q)
        locked.append(pin.rnea(model, model.createData(), q[:5], q[:5], q[:5]))
    np.testing.assert_allclose(*locked, atol=1e-11)


@pytest.mark.parametrize("name", ["buildSampleModelManipulator", "buildSampleModelHumanoid"])
def test_robots_that_are_built_in(name: str) -> None:
    model, theirs = getattr(condyle.pinocchio, name)(), getattr(pinocchio, name)()
    assert model.names == list(theirs.names) and model.parents == list(theirs.parents)
    assert {(f.name, f.parentJoint) for f in model.frames} == {(f.name, f.parentJoint) for f in theirs.frames}
    assert np.array_equal(model.lowerPositionLimit[7:], theirs.lowerPositionLimit[7:])
    assert np.array_equal(model.effortLimit[6:], theirs.effortLimit[6:])
    rng = np.random.default_rng(1)
    q, (v, a) = pinocchio.neutral(theirs), rng.standard_normal((2, theirs.nv))
    q = pinocchio.integrate(theirs, q, rng.standard_normal(theirs.nv))
    data, their_data = model.createData(), theirs.createData()
    efforts = pinocchio.rnea(theirs, their_data, q, v, a)
    np.testing.assert_allclose(condyle.pinocchio.rnea(model, data, q, v, a), efforts, atol=1e-10)
    np.testing.assert_allclose(
        condyle.pinocchio.crba(model, data, q), pinocchio.crba(theirs, their_data, q), atol=1e-10
    )


def test_humanoid_of_random_numbers() -> None:
    """Tests that the sample humanoid has the same structure as Pinocchio's, and the same derivatives, computed as in
    Pinocchio's examples."""
    np.random.seed(1)
    model = condyle.pinocchio.buildSampleModelHumanoidRandom()
    form = pinocchio.buildSampleModelHumanoidRandom()
    assert model.names == list(form.names) and model.parents == list(form.parents) and model.nv == form.nv
    assert [(f.name, f.parentJoint) for f in model.frames[1:]] == [
        (f.name, f.parentJoint) for f in list(form.frames)[1:]
    ]
    assert list(model.ours.joint_types[1:]) == ["free_flyer"] + ["revolute"] * 26
    model.lowerPositionLimit[:7], model.upperPositionLimit[:7] = -np.ones(7), np.ones(7)
    q, (v, a) = condyle.pinocchio.randomConfiguration(model), np.random.rand(2, model.nv)
    found = []
    for pin, m in ((condyle.pinocchio, model), (pinocchio, model.ours.to_pinocchio())):
        data, out = m.createData(), []
        pin.computeRNEADerivatives(m, data, q, v, a)
        out += [data.dtau_dq.copy(), data.dtau_dv.copy(), data.M.copy()]
        pin.computeABADerivatives(m, data, q, v, a)
        out += [data.ddq_dq.copy(), data.ddq_dv.copy(), data.Minv.copy()]
        pin.computeForwardKinematicsDerivatives(m, data, q, v, a)
        joint = m.getJointId("rleg6_joint")
        for axes in (pin.ReferenceFrame.WORLD, pin.ReferenceFrame.LOCAL):
            out += [x.copy() for x in pin.getJointVelocityDerivatives(m, data, joint, axes)]
            out += [x.copy() for x in pin.getJointAccelerationDerivatives(m, data, joint, axes)]
        found.append(out)
    for k, (ours, theirs) in enumerate(zip(*found, strict=True)):
        if k in (2, 5):  # Pinocchio fills only the upper triangle of M and M⁻¹
            ours, theirs = np.triu(ours), np.triu(theirs)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=SAME * (1.0 + np.abs(theirs).max()))
    np.random.seed(1)
    again = condyle.pinocchio.buildSampleModelHumanoidRandom()
    assert np.array_equal(again.upperPositionLimit[7:], model.upperPositionLimit[7:])


def test_derivatives_of_kinematics() -> None:
    found = []
    for pin in (condyle.pinocchio, pinocchio):
        model = pin.buildSampleModelHumanoid()
        rng = np.random.default_rng(1)
        q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
        data, (v, a) = model.createData(), rng.standard_normal((2, model.nv))
        pin.computeForwardKinematicsDerivatives(model, data, q, v, a)
        joint = model.getJointId("rleg_wrist2_joint")
        out = []
        for axes in (pin.LOCAL, pin.WORLD, pin.LOCAL_WORLD_ALIGNED):
            out += [x.copy() for x in pin.getJointVelocityDerivatives(model, data, joint, axes)]
            out += [x.copy() for x in pin.getJointAccelerationDerivatives(model, data, joint, axes)]
        found.append(out)
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=SAME * (1.0 + np.abs(theirs).max()))


def test_inverse_kinematics() -> None:
    """Tests inverse kinematics to a target pose, as in Pinocchio's examples. The steps and the final position must be
    the same as in Pinocchio."""
    found = []
    for pin in (condyle.pinocchio, pinocchio):
        model = pin.buildSampleModelManipulator()
        data, goal = model.createData(), pin.SE3(np.eye(3), np.array([1.0, 0.0, 1.0]))
        q, errors = pin.utils.zero(model.nq), []
        for _ in range(60):
            pin.forwardKinematics(model, data, q)
            there = data.oMi[6].actInv(goal)
            errors.append(pin.log(there).vector)
            J = -pin.Jlog6(there.inverse()) @ pin.computeJointJacobian(model, data, q, 6)
            q = pin.integrate(model, q, -0.1 * J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), errors[-1]))
        found.append(np.array([*errors, q]))
    np.testing.assert_allclose(*found, atol=1e-9)
    assert np.abs(found[0][59]).max() < 0.1 * np.abs(found[0][0]).max()


def test_batches_by_columns() -> None:
    found = []
    for pin in (condyle.pinocchio, pinocchio):
        model = pin.buildSampleModelHumanoid()
        pool, rng = pin.ModelPool(model, 2), np.random.default_rng(1)
        v, a = rng.standard_normal((2, model.nv, 9))
        q = np.stack([pin.integrate(model, pin.neutral(model), column) for column in v.T], 1)
        into = np.empty((model.nv, 9))
        assert pin.abaInParallel(2, pool, q, v, a, into) is None
        found.append([pin.rneaInParallel(1, pool, q, v, a), pin.abaInParallel(2, pool, q, v, a), into])
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=SAME * (1.0 + np.abs(theirs).max()))


def test_columns_and_limits_as_scripts_have_them() -> None:
    pin = condyle.pinocchio
    model = pin.buildSampleModelHumanoid()
    data = model.createData()
    model.lowerPositionLimit, model.upperPositionLimit = -np.ones((model.nq, 1)), np.full((model.nq, 1), 0.5)
    drawn = np.array([pin.randomConfiguration(model) for _ in range(50)])
    lengths = np.r_[:3, 7 : model.nq]
    assert drawn[:, lengths].min() >= -1.0 and drawn[:, lengths].max() <= 0.5
    assert np.ptp(drawn[:, lengths], axis=0).min() > 1.0
    np.testing.assert_allclose(np.linalg.norm(drawn[:, 3:7], axis=1), 1.0)
    q, v = drawn[0], np.random.default_rng(1).standard_normal((model.nv, 1))
    for function in (pin.rnea, pin.aba, pin.computeRNEADerivatives, pin.computeABADerivatives):
        for column, flat in zip(
            function(model, data, q, v, v), function(model, data, q, v[:, 0], v[:, 0]), strict=True
        ):
            np.testing.assert_array_equal(column, flat)
        with pytest.raises(ValueError, match="v: expected shape"):
            function(model, data, q, v[1:, 0], v[:, 0])
        with pytest.raises(ValueError, match="v: expected shape"):
            function(model, data, q, v[1:], v)
    assert "universe" in [frame.name for frame in model.frames] and pin.omp_get_max_threads() > 0


def test_what_was_left_stays() -> None:
    pin = condyle.pinocchio
    model = pin.buildSampleModelManipulator()
    data, q, (v, a) = (
        model.createData(),
        np.full(model.nq, 0.3),
        np.random.default_rng(1).standard_normal((2, model.nv)),
    )
    with pytest.raises(AttributeError, match=r"data\.oMi: no function has made it yet"):
        data.oMi  # noqa: B018
    pin.forwardKinematics(model, data, q)
    with pytest.raises(AttributeError, match=r"data\.v: no function has made it yet"):
        data.v  # noqa: B018
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    hg, com = pin.computeCentroidalMomentum(model, data, q, v), pin.centerOfMass(model, data, q)
    made = [data.oMi[3], data.oMf[2], *(lazy for lazy in (data.v, data.a))]
    numbers = [made[0].homogeneous, made[1].homogeneous, made[2][3].vector, made[3][3].vector, hg.vector, com.copy()]
    pin.framesForwardKinematics(model, data, q + 1.0)
    pin.computeCentroidalMomentum(model, data, q + 1.0, a)
    pin.centerOfMass(model, data, q + 1.0)
    again = [made[0].homogeneous, made[1].homogeneous, made[2][3].vector, made[3][3].vector, hg.vector, com]
    assert all(np.array_equal(x, y) for x, y in zip(numbers, again, strict=True))
    assert not np.array_equal(data.hg.vector, hg.vector) and not np.array_equal(data.com[0], com)
    with pytest.raises(AttributeError, match=r"data\.v: no function has made it yet"):
        data.v  # noqa: B018  # the last call was without v


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies(copied: Callable[[Any], Any]) -> None:
    model = condyle.pinocchio.buildSampleModelManipulator()
    model.referenceConfigurations["half"] = np.full(model.nq, 0.5)
    data, q = model.createData(), np.full(model.nq, 0.3)
    M = condyle.pinocchio.crba(model, data, q)
    others, left = copied(model), copied(data)
    assert (
        np.array_equal(others.referenceConfigurations["half"], np.full(model.nq, 0.5)) and others.names == model.names
    )
    assert np.array_equal(left.M, M) and np.array_equal(condyle.pinocchio.crba(others, left, q), M)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda pin, m, d: pin.getFrameVelocity(m, d, 0),
            r"frame_id: expected 1 to \d+, found 0; universe does not move",
        ),
        (
            lambda pin, m, d: pin.getFrameVelocity(m, d, 1, "world"),
            r"frame: expected LOCAL, WORLD or LOCAL_WORLD_ALIGNED",
        ),
        (
            lambda pin, m, d: pin.getFrameVelocity(m, m.createData(), 1),
            r"data: expected a state, found none: call forwardKinematics before",
        ),
        (lambda pin, m, d: pin.getVelocity(m, d, 99), r"joint: expected a joint's name or 0 to \d+, found 99"),
        (lambda pin, m, d: pin.forwardKinematics(m, d, [0.0]), r"q: expected shape"),
        (lambda pin, m, d: pin.forwardKinematics(m, d, np.zeros(m.nq), [0.0]), r"v: expected shape"),
        (
            lambda pin, m, d: pin.getJointJacobian(pin.buildSampleModelHumanoid(), d, 1, pin.LOCAL),
            r"data: made for another model",
        ),
    ],
)
def test_messages(call: Callable[[ModuleType, Any, Any], Any], said: str) -> None:
    model = condyle.pinocchio.buildSampleModelManipulator()
    data = model.createData()
    condyle.pinocchio.forwardKinematics(model, data, np.full(model.nq, 0.3))
    with pytest.raises((ValueError, IndexError), match=said):
        call(condyle.pinocchio, model, data)


def test_a_call_that_fails_leaves_no_state() -> None:
    pin = condyle.pinocchio
    model = pin.buildSampleModelManipulator()
    data, q = model.createData(), np.full(model.nq, 0.3)
    pin.forwardKinematics(model, data, q)
    with pytest.raises(ValueError, match="v: expected shape"):
        pin.forwardKinematics(model, data, 2.0 * q, [0.0])
    with pytest.raises(ValueError, match="data: expected a state"):
        pin.getVelocity(model, data, 1)
    with pytest.raises(AttributeError, match=r"data\.oMi"):
        data.oMi  # noqa: B018


def test_tutorial() -> None:
    """Tests that the tutorial runs with `condyle.pinocchio` and with Pinocchio."""
    example = Path(__file__).parents[3] / "python" / "examples" / "coming_from_pinocchio.py"
    run = subprocess.run([sys.executable, example], capture_output=True, text=True, check=False, timeout=300)
    assert run.returncode == 0, run.stderr
    assert "Pinocchio takes" in run.stdout
