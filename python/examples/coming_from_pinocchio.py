"""Coming from Pinocchio: runs a script for Pinocchio with another import, and then writes the same script with Condyle.

    python python/examples/coming_from_pinocchio.py

The example needs only Condyle. If Pinocchio is installed, the example compares the numbers of both libraries. Names of
Pinocchio, and names of Condyle:

    buildModelFromUrdf(path, JointModelFreeFlyer())     Model.from_urdf(path, root_joint="free_flyer")
    buildModelFromMJCF(path)                            Model.from_mjcf(path)
    buildReducedModel(model, joints, q)                 model.lock(joints, q)
    appendModel(A, B, frame, aMb)                       A.append(frame, B, aMb)
    transformJointIntoMimic(model, i, j, ratio, offset) model.with_mimic(j, i, ratio, offset)
    loadReferenceConfigurations(model, path)            model.reference_configurations(path), a dictionary
    an existing pinocchio.Model                         Model.from_pinocchio(model), and model.to_pinocchio()
    example_robot_data.load("talos").model              load("talos")
    model.createData()                                  Data(model); Data(model, threads=4) for batches
    rnea(model, data, q, v, a, fext)                    rnea(model, data, q, v, a, f_ext), an array (nbodies, 6)
    aba, crba                                           aba, crba
    computeMinverse, nonLinearEffects                   minv, nonlinear_effects
    computeGeneralizedGravity, computeCoriolisMatrix    gravity, coriolis_matrix
    computeRNEADerivatives -> three matrices            rnea_derivatives: .dtau_dq, .dtau_dv, .dtau_da
    computeABADerivatives -> three matrices             aba_derivatives: .a, .da_dq, .da_dv, .da_dtau
    framesForwardKinematics, data.oMi, data.oMf         forward_kinematics, (nbodies, 4, 4); frame_placement
    forwardKinematics(…, v, a), getFrameVelocity        frame_velocity(model, data, q, v, frame, "local")
    getFrameAcceleration, getFrameClassicalAcceleration frame_acceleration, frame_classical_acceleration
    computeFrameJacobian, computeJointJacobian          frame_jacobian, body_jacobian
    ReferenceFrame.LOCAL, WORLD, LOCAL_WORLD_ALIGNED    "local", "world", "local_world_aligned"
    getJointAccelerationDerivatives                     body_acceleration_derivatives, body_jacobian
    centerOfMass, jacobianCenterOfMass                  com, com_velocity, com_acceleration; com_jacobian
    ccrba, computeCentroidalMomentum                    centroidal_map, centroidal_momentum
    computeKineticEnergy, computePotentialEnergy        kinetic_energy, potential_energy
    integrate, difference, interpolate, neutral         the same
    randomConfiguration(model)                          random_configuration(model, seed)
    dIntegrate, dDifference                             integrate_jacobian, difference_jacobian
    SE3, Motion, Force, exp6, log6, Jlog6               condyle: SE3, Motion, Force, exp6, log6, Jlog6
    Inertia.FromBox, FromSphere, …                      Inertia.from_box, from_sphere, …
    rneaInParallel(n, pool, q, v, a), columns           rnea with q (N, nq), v and a (N, nv), rows
    MeshcatVisualizer                                   condyle.viz.play(model, q, dt, urdf=path)

Both libraries have the same units, signs, order of q, v and spatial vectors (linear first), quaternions (x, y, z, w),
and numbering of joints. There are differences: results are returned as arrays that no later call changes. Frames are
given by name, and the list of frames does not begin with `universe`. Both triangles of M are filled. `with_gravity` and
`with_limits` return new models.
"""

from importlib.util import find_spec
from typing import Any

import numpy as np

import condyle
import condyle.pinocchio

GOAL, PRECISION, STEP, DAMPING = np.array([0.35, 0.2, 0.6]), 1e-10, 0.5, 1e-9


def reach(pin: Any) -> tuple[np.ndarray, int]:
    """Solves inverse kinematics by Newton's method with damping. This function is written for Pinocchio, the module
    `pin`.
    """
    model = pin.buildModelFromXML(condyle.robots.ARM7)
    data = model.createData()
    tool = model.getFrameId("tool")
    q = np.full(model.nq, 0.4)
    for step in range(200):
        pin.framesForwardKinematics(model, data, q)
        error = data.oMf[tool].translation - GOAL
        if np.linalg.norm(error) < PRECISION:
            return q, step
        J = pin.computeFrameJacobian(model, data, q, tool, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3]
        q = pin.integrate(model, q, -STEP * J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(3), error))
    raise RuntimeError("the arm cannot reach the point")


# 1. The script runs after a change of its import to `import condyle.pinocchio as pin`.
q, steps = reach(condyle.pinocchio)
print(f"reached after {steps} steps at q = {q.round(3)}")

# 2. The same script, written with Condyle.
arm = condyle.robots.arm7()
data = condyle.Data(arm)
q_here = np.full(arm.nq, 0.4)
for _ in range(steps):
    error = condyle.frame_placement(arm, data, q_here, "tool")[:3, 3] - GOAL
    J = condyle.frame_jacobian(arm, data, q_here, "tool", "local_world_aligned")[:3]
    q_here = condyle.integrate(arm, q_here, -STEP * J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(3), error))
print(f"written here: the largest difference is {np.abs(q - q_here).max():.0e}")
assert np.allclose(q, q_here, rtol=0.0, atol=1e-12)

# 3. Dynamics: a function returns all its results; it does not store results in `data`.
v, tau = np.linspace(-1.0, 1.0, 7), np.ones(7)
d = condyle.aba_derivatives(arm, data, q, v, tau)
print(f"the first joint accelerates by {d.a[0]:.4f} rad/s², and by {d.da_dtau[0, 0]:.4f} more for each N m")

# 4. Many states in one call, one in each row: no loop and no management of threads is necessary.
many = np.tile(q, (1000, 1))
many[:, 0] += np.linspace(-1.0, 1.0, 1000)
efforts = condyle.gravity(arm, condyle.Data(arm, threads=2), many)
assert efforts.shape == (1000, 7)
print(f"holding the arm still takes at most {np.abs(efforts).max():.2f} N m, all around")

# 5. If Pinocchio is installed, its numbers are compared with Condyle's. One call converts a model of Pinocchio.
if find_spec("pinocchio"):
    import pinocchio

    q_there, steps_there = reach(pinocchio)
    assert steps_there == steps and np.allclose(q, q_there, rtol=0.0, atol=1e-10)
    theirs = pinocchio.buildSampleModelHumanoid()
    ours = condyle.Model.from_pinocchio(theirs)
    q = condyle.random_configuration(ours, seed=1)
    M = pinocchio.crba(theirs, theirs.createData(), q)
    difference = np.abs(condyle.crba(ours, condyle.Data(ours), q) - M).max() / np.abs(M).max()
    print(
        f"Pinocchio takes {steps_there} steps too; of its humanoid, M differs by {difference:.0e} of its largest entry"
    )
    assert difference < 1e-12
