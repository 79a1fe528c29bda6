"""`condyle.pinocchio`: the same lines run on it and on Pinocchio, and give the same numbers."""

import doctest
from collections.abc import Callable
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
    """A state, and forces on all bodies."""

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
