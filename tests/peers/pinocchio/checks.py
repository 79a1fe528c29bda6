"""Checks that Pinocchio's model and Condyle's model of a robot give the same results."""

import numpy as np
import pinocchio as pin
import pytest
from comparison import Pair, State, ours_of, theirs_of

import condyle
from condyle.simulation import Simulation

METHODS = (None, "aba", "dense", "sparse")
GRAINS = (1, 4)
"""Tested numbers of bodies that divide and conquer does not divide further. 1 gives the largest number of cuts."""
CUTS = 10.0
"""Factor by which the tolerance of divide and conquer is larger, because the parts into which the algorithm divides a
robot have larger condition numbers than the whole robot."""
FRAMES = {
    "local": pin.ReferenceFrame.LOCAL,
    "world": pin.ReferenceFrame.WORLD,
    "local_world_aligned": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
}
STEP = 1e-5
"""Step of central differences."""
DIFFERENCES = 1e-7
"""Tenth of the tolerance of central differences. Their error consists of rounding errors of 1e-16/step, and of step²
times a third derivative."""
KINDS = {
    pin.FrameType.BODY: "link",
    pin.FrameType.JOINT: "joint",
    pin.FrameType.FIXED_JOINT: "joint",
    pin.FrameType.OP_FRAME: "user",
}


def check_model(pair: Pair) -> None:
    """Compares sizes, names, order, placements, inertias, damping, friction, limits and frames of the models."""
    check_bodies(pair)
    check_losses(pair)
    check_limits(pair)
    check_frames(pair)


def check_bodies(pair: Pair) -> None:
    """Compares sizes, names, order, placements, inertias and armature of the models' bodies and joints."""
    ours, theirs = pair.ours, pair.theirs
    assert ours.name == theirs.name
    assert (ours.nq, ours.nv, ours.nbodies) == (theirs.nq, theirs.nv, theirs.njoints)
    assert ours.names == list(theirs.names)
    assert ours.parents == list(theirs.parents)
    moving = slice(1, None)
    assert ours.nqs == list(theirs.nqs)
    assert ours.nvs == list(theirs.nvs)
    assert ours.idx_qs[moving] == list(theirs.idx_qs)[moving]
    assert ours.idx_vs[moving] == list(theirs.idx_vs)[moving]
    pair.expect("joint placements", ours.joint_placements[moving], poses(theirs.jointPlacements)[moving])
    pair.expect("masses", [i.mass for i in ours.inertias], [i.mass for i in theirs.inertias])
    first_moments = np.array([i.mass * i.lever for i in theirs.inertias])
    pair.expect("centres of mass", [i.mass * i.com for i in ours.inertias], first_moments)
    pair.expect("rotational inertias", [i.about_com for i in ours.inertias], [i.inertia for i in theirs.inertias])
    pair.expect("total mass", ours.total_mass, pin.computeTotalMass(theirs) + theirs.inertias[0].mass)
    parameters = [i.toDynamicParameters() for i in theirs.inertias[1:]]
    pair.expect("inertial parameters", ours.inertial_parameters, np.concatenate(parameters))
    pair.expect("armature", ours.armature, theirs.armature)


def check_losses(pair: Pair) -> None:
    """Compares the damping and the friction of joints."""
    pair.expect("damping", pair.ours.damping, pair.theirs.damping)
    pair.expect("friction", pair.ours.friction, pair.theirs.upperDryFrictionLimit)


def check_limits(pair: Pair) -> None:
    """Compares limits. If Pinocchio has no limit, Condyle's limit must be infinite (or ±1.01 for the numbers of a
    rotation)."""
    ours, theirs = pair.ours.limits, pair.theirs
    finite = np.zeros(theirs.nq, bool)
    for joint in theirs.joints[1:]:
        if joint.nq == joint.nv == 1:
            finite[joint.idx_q] = True
    for our, their in ((ours.lower, theirs.lowerPositionLimit), (ours.upper, theirs.upperPositionLimit)):
        finite_here = finite & np.isfinite(their)
        assert np.array_equal(our[finite_here], their[finite_here])
        assert np.isinf(our[~finite_here]).all()
    for our, their in ((ours.velocity, theirs.upperVelocityLimit), (ours.effort, theirs.upperEffortLimit)):
        assert np.array_equal(our, np.where(their == np.finfo(float).max, np.inf, their))


def check_frames(pair: Pair) -> None:
    """Checks that all frames, except Pinocchio's `universe`, have the same body and placement."""
    ours = {(f.name, f.kind): f for f in pair.ours.frames}
    theirs = {(f.name, KINDS[f.type]): f for f in list(pair.theirs.frames)[1:]}
    assert len(theirs) == pair.theirs.nframes - 1
    assert ours.keys() == theirs.keys()
    for key, frame in theirs.items():
        assert ours[key].body == frame.parentJoint, key
        pair.expect("frames in their bodies", ours[key].placement, frame.placement.homogeneous)


def common_frames(pair: Pair) -> list[tuple[int, int]]:
    """Returns pairs of indices of the frames that exist in both models. For a URDF, these are all frames except
    Pinocchio's `universe` (see check_frames)."""
    theirs = {(f.name, KINDS[f.type]): i for i, f in enumerate(pair.theirs.frames) if i > 0}
    ours = [(f.name, f.kind) for f in pair.ours.frames]
    found = [(i, theirs[key]) for i, key in enumerate(ours) if key in theirs]
    assert found
    return found


def check_kinematics(state: State) -> None:
    """Compares placements of bodies and frames, and Jacobians of all frames in all three frames of reference."""
    pair, ours, q = state.pair, ours_of(state), state.q
    model, data = pair.theirs, pair.their_data
    pin.framesForwardKinematics(model, data, q)
    pair.expect("forward_kinematics", ours(condyle.forward_kinematics, q)[pair.bodies], poses(data.oMi))
    pin.computeJointJacobians(model, data, q)
    for i, body in enumerate(pair.bodies):
        for name, reference in FRAMES.items():
            J = ours(condyle.body_jacobian, q, body, name)
            pair.expect(f"body_jacobian, {name}", J, pin.getJointJacobian(model, data, i, reference))
    for i, j in common_frames(pair):
        pair.expect("frame_placement", ours(condyle.frame_placement, q, i), data.oMf[j].homogeneous)
        for name, reference in FRAMES.items():
            J = ours(condyle.frame_jacobian, q, i, name)
            pair.expect(f"frame_jacobian, {name}", J, pin.getFrameJacobian(model, data, j, reference))


def check_motion(state: State) -> None:
    """Compares velocities, accelerations and rates of Jacobians, of all frames in all three frames of reference.

    In LOCAL_WORLD_ALIGNED, the rate of the Jacobian belongs to the classical acceleration, in both libraries.
    """
    pair, ours, q, v, a = state.pair, ours_of(state), state.q, state.v, state.a
    model, data = pair.theirs, pair.their_data
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    for i, body in enumerate(pair.bodies):
        for name, reference in FRAMES.items():
            theirs = (model, data, i, reference)
            velocity = ours(condyle.body_velocity, q, v, body, name)
            pair.expect(f"body_velocity, {name}", velocity, pin.getVelocity(*theirs).vector)
            acceleration = ours(condyle.body_acceleration, q, v, a, body, name)
            pair.expect(f"body_acceleration, {name}", acceleration, pin.getAcceleration(*theirs).vector)
            acceleration = ours(condyle.body_classical_acceleration, q, v, a, body, name)
            expected = pin.getClassicalAcceleration(*theirs).vector
            pair.expect(f"body_classical_acceleration, {name}", acceleration, expected)
            if pair.rates:
                dJ = ours(condyle.body_jacobian_rate, q, v, body, name)
                pair.expect(f"body_jacobian_rate, {name}", dJ, pin.getJointJacobianTimeVariation(*theirs))
    for i, j in common_frames(pair):
        for name, reference in FRAMES.items():
            theirs = (model, data, j, reference)
            velocity = ours(condyle.frame_velocity, q, v, i, name)
            pair.expect(f"frame_velocity, {name}", velocity, pin.getFrameVelocity(*theirs).vector)
            acceleration = ours(condyle.frame_acceleration, q, v, a, i, name)
            pair.expect(f"frame_acceleration, {name}", acceleration, pin.getFrameAcceleration(*theirs).vector)
            acceleration = ours(condyle.frame_classical_acceleration, q, v, a, i, name)
            expected = pin.getFrameClassicalAcceleration(*theirs).vector
            pair.expect(f"frame_classical_acceleration, {name}", acceleration, expected)
            if pair.rates:
                dJ = ours(condyle.frame_jacobian_rate, q, v, i, name)
                pair.expect(f"frame_jacobian_rate, {name}", dJ, pin.getFrameJacobianTimeVariation(*theirs))


def check_centroidal(state: State) -> None:
    """Compares the centre of mass, the momentum, and their Jacobians and rates. Neither library counts bodies that are
    fixed to the world."""
    pair, ours, theirs, q, v, a = state.pair, ours_of(state), theirs_of(state), state.q, state.v, state.a
    data = pair.their_data
    theirs(pin.centerOfMass, q, v, a)
    pair.expect("com", ours(condyle.com, q), data.com[0])
    pair.expect("com_velocity", ours(condyle.com_velocity, q, v), data.vcom[0])
    pair.expect("com_acceleration", ours(condyle.com_acceleration, q, v, a), data.acom[0])
    Jcom = theirs(pin.jacobianCenterOfMass, q).copy()
    pair.expect("com_jacobian", ours(condyle.com_jacobian, q), Jcom)
    theirs(pin.ccrba, q, v)
    expected = {"Ag": data.Ag, "Ig": data.Ig.matrix(), "com": data.com[0], "Jcom": Jcom}
    expect_fields(pair, "centroidal_map", ours(condyle.centroidal_map, q), expected)
    theirs(pin.dccrba, q, v)
    expected |= {"hg": data.hg.vector, "com_velocity": data.vcom[0]} | ({"dAg": data.dAg} if pair.rates else {})
    expect_fields(pair, "centroidal_map_rate", ours(condyle.centroidal_map_rate, q, v), expected)
    expect_fields(pair, "compute_all_terms: centroidal", ours(condyle.compute_all_terms, q, v).centroidal, expected)
    hg = theirs(pin.computeCentroidalMomentum, q, v).vector
    pair.expect("centroidal_momentum", ours(condyle.centroidal_momentum, q, v), hg)
    dhg = theirs(pin.computeCentroidalMomentumTimeVariation, q, v, a).vector
    pair.expect("centroidal_momentum_rate", ours(condyle.centroidal_momentum_rate, q, v, a), dhg)


def expect_fields(pair: Pair, what: str, ours: "tuple[np.ndarray, ...]", theirs: dict[str, np.ndarray]) -> None:
    """Compares the fields of a named tuple with expected values, by name."""
    for name, value in theirs.items():
        pair.expect(f"{what}: {name}", getattr(ours, name), value)


def check_energy(state: State) -> None:
    """Compares energies and their regressors, for robots without armature. Pinocchio's kinetic energy omits the
    armature of a revolute joint whose axis is not x, y or z."""
    pair, ours, theirs, q, v = state.pair, ours_of(state), theirs_of(state), state.q, state.v
    assert not pair.theirs.armature.any()
    pair.expect("kinetic_energy", ours(condyle.kinetic_energy, q, v), theirs(pin.computeKineticEnergy, q, v))
    pair.expect("potential_energy", ours(condyle.potential_energy, q), theirs(pin.computePotentialEnergy, q))
    pair.expect("mechanical_energy", ours(condyle.mechanical_energy, q, v), theirs(pin.computeMechanicalEnergy, q, v))
    y = theirs(pin.computeKineticEnergyRegressor, q, v)
    columns = pair.columns
    pair.expect("kinetic_energy_regressor", ours(condyle.kinetic_energy_regressor, q, v)[columns], y)
    y = theirs(pin.computePotentialEnergyRegressor, q)
    pair.expect("potential_energy_regressor", ours(condyle.potential_energy_regressor, q)[columns], y)
    terms = ours(condyle.compute_all_terms, q, v)
    theirs(pin.computeAllTerms, q, v)
    pair.expect("compute_all_terms: kinetic_energy", terms.kinetic_energy, pair.their_data.kinetic_energy)
    pair.expect("compute_all_terms: potential_energy", terms.potential_energy, pair.their_data.potential_energy)


def check_equations_of_motion(state: State) -> None:
    """Compares terms of the equations of motion: Coriolis matrix, M and h from one call, static efforts, and
    regressor."""
    pair, ours, theirs, q, v, a = state.pair, ours_of(state), theirs_of(state), state.q, state.v, state.a
    if pair.rates:
        C = theirs(pin.computeCoriolisMatrix, q, v)
        pair.expect("coriolis_matrix", ours(condyle.coriolis_matrix, q, v), C)
    tau = theirs(pin.computeStaticTorque, q, state.their_forces)
    pair.expect("static_torque, f_ext", ours(condyle.static_torque, q, state.f_ext), tau)
    tau = theirs(pin.computeGeneralizedGravity, q)
    pair.expect("static_torque", ours(condyle.static_torque, q), tau)
    Y = theirs(pin.computeJointTorqueRegressor, q, v, a)
    pair.expect("joint_torque_regressor", ours(condyle.joint_torque_regressor, q, v, a)[:, pair.columns], Y)
    terms = ours(condyle.compute_all_terms, q, v)
    theirs(pin.computeAllTerms, q, v)
    M = np.triu(pair.their_data.M)
    pair.expect("compute_all_terms: M", terms.M, M + np.triu(M, 1).T)
    pair.expect("compute_all_terms: h", terms.h, pair.their_data.nle)


def check_lock(state: State) -> None:
    """Locks every third joint and compares the robots. Pinocchio rejects robots in which a joint and a link have the
    same name."""
    pair, rng = state.pair, np.random.default_rng(0)
    locked = list(range(1, pair.theirs.njoints, 3))
    ours = pair.ours.lock([body for i in locked for body in pair.chains[i]], state.q)
    try:
        theirs = pin.buildReducedModel(pair.theirs, locked, state.q)
    except ValueError as error:
        if "Several frames match the filter" not in str(error):
            raise
        return
    assert [name for name in ours.names if "#" not in name] == list(theirs.names)
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    if not ours.nv:
        return
    q = condyle.random_configuration(ours, 0)
    v, a = rng.standard_normal((2, ours.nv))
    data, their_data = condyle.Data(ours), theirs.createData()
    pair.expect("lock: rnea", condyle.rnea(ours, data, q, v, a), pin.rnea(theirs, their_data, q, v, a))
    pair.expect("lock: crba", condyle.crba(ours, data, q), pin.crba(theirs, their_data, q))
    placements = poses(theirs.jointPlacements)[1:]
    if len(placements) == ours.nbodies - 1:
        pair.expect("lock: joint placements", ours.joint_placements[1:], placements)


def check_motion_derivatives(state: State) -> None:
    """Compares derivatives of the motion of bodies and frames, of the momentum, and of the centre of mass."""
    pair, ours, theirs, q, v, a = state.pair, ours_of(state), theirs_of(state), state.q, state.v, state.a
    if not pair.rates:
        return
    model, data = pair.theirs, pair.their_data
    pin.computeForwardKinematicsDerivatives(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    for i, body in enumerate(pair.bodies):
        for name, reference in FRAMES.items() if i else ():
            of_joint = (model, data, i, reference)
            v_q, a_q, a_v, J = pin.getJointAccelerationDerivatives(*of_joint)
            if name == "local_world_aligned":
                v_q, a_q = (
                    of_numbers(v_q, pin.getVelocity(*of_joint), J),
                    of_numbers(a_q, pin.getAcceleration(*of_joint), J),
                )
            pair.expect(
                f"body_velocity_derivative, {name}", ours(condyle.body_velocity_derivative, q, v, body, name), v_q
            )
            da_dq, da_dv = ours(condyle.body_acceleration_derivatives, q, v, a, body, name)
            right = trusted_columns(model, name)
            pair.expect(f"body_acceleration_derivatives, {name}: da_dq", da_dq[:, right], a_q[:, right])
            pair.expect(f"body_acceleration_derivatives, {name}: da_dv", da_dv, a_v)
    for i, j in common_frames(pair):
        for name, reference in FRAMES.items():
            of_frame = (model, data, j, reference)
            v_q, a_q, a_v, J = pin.getFrameAccelerationDerivatives(*of_frame)
            if name == "local_world_aligned":
                v_q = of_numbers(v_q, pin.getFrameVelocity(*of_frame), J)
                a_q = of_numbers(a_q, pin.getFrameAcceleration(*of_frame), J)
            dv_dq = ours(condyle.frame_velocity_derivative, q, v, i, name)
            pair.expect(f"frame_velocity_derivative, {name}", dv_dq, v_q)
            da_dq, da_dv = ours(condyle.frame_acceleration_derivatives, q, v, a, i, name)
            right = trusted_columns(model, name)
            pair.expect(f"frame_acceleration_derivatives, {name}: da_dq", da_dq[:, right], a_q[:, right])
            pair.expect(f"frame_acceleration_derivatives, {name}: da_dv", da_dv, a_v)
    d = ours(condyle.centroidal_derivatives, q, v, a)
    for field, their in zip(
        ("dh_dq", "drate_dq", "drate_dv", "drate_da"),
        theirs(pin.computeCentroidalDynamicsDerivatives, q, v, a),
        strict=True,
    ):
        pair.expect(f"centroidal_derivatives: {field}", getattr(d, field), their)
    theirs(pin.jacobianCenterOfMass, q)
    pair.expect("centroidal_derivatives: dcom_dq", d.dcom_dq, data.Jcom)
    theirs(pin.computeForwardKinematicsDerivatives, q, v, a)
    theirs(pin.centerOfMass, q, v, a)
    dvcom_dq = pin.getCenterOfMassVelocityDerivatives(model, data)
    if np.isfinite(dvcom_dq).all():  # Pinocchio divides by the mass beyond each joint, so the mass must not be zero
        pair.expect("centroidal_derivatives: dvcom_dq", d.dvcom_dq, dvcom_dq)


def trusted_columns(model: pin.Model, reference: str) -> np.ndarray:
    """Returns the indices of the columns of ∂a/∂q that are correct in Pinocchio.

    Along the world's axes, Pinocchio's ∂a/∂q contradicts finite differences of Pinocchio's own accelerations. Condyle's
    ∂a/∂q agrees with these differences. The wrong columns belong to joints with several degrees of freedom on a moving
    body.
    """
    right = np.ones(model.nv, bool)
    for joint, parent in zip(model.joints, model.parents, strict=True):
        if reference != "local" and joint.nv > 1 and parent > 0:
            right[joint.idx_v : joint.idx_v + joint.nv] = False
    return right


def of_numbers(by_q: np.ndarray, motion: pin.Motion, J: np.ndarray) -> np.ndarray:
    """Converts ∂/∂q of a motion to the derivative of the motion's six numbers in LOCAL_WORLD_ALIGNED.

    A motion's linear part belongs to the frame's origin, which moves with q (by the linear part of J). Pinocchio's
    derivative is at a fixed point, the current origin.
    """
    moved = by_q.copy()
    moved[:3] += np.cross(motion.angular, J[:3], axisb=0).T
    return moved


def check_effort_derivatives(state: State) -> None:
    """Compares derivatives of static efforts, derivatives with respect to inertial parameters and forces, and the
    Hessian of inverse dynamics."""
    pair, ours, theirs, q, v, a = state.pair, ours_of(state), theirs_of(state), state.q, state.v, state.a
    if not pair.rates:
        return
    dtau_dq = theirs(pin.computeStaticTorqueDerivatives, q, state.their_forces)
    pair.expect("static_torque_derivative, f_ext", ours(condyle.static_torque_derivative, q, state.f_ext), dtau_dq)
    dtau_dq = theirs(pin.computeGeneralizedGravityDerivatives, q)
    pair.expect("static_torque_derivative", ours(condyle.static_torque_derivative, q), dtau_dq)
    pair.expect(
        "energy_derivatives: dV_dq",
        ours(condyle.energy_derivatives, q, v).dV_dq,
        theirs(pin.computeGeneralizedGravity, q),
    )
    Y = theirs(pin.computeJointTorqueRegressor, q, v, a)
    pin.computeJointJacobians(pair.theirs, pair.their_data, q)
    for i in range(1, pair.theirs.njoints):
        body = pair.bodies[i]
        by_inertia = ours(condyle.rnea_input_derivative, q, v, a, ("inertia", body))
        pair.expect("rnea_input_derivative: inertia", by_inertia, Y[:, 10 * (i - 1) : 10 * i])
        J = pin.getJointJacobian(pair.theirs, pair.their_data, i, pin.LOCAL)
        by_force = ours(condyle.rnea_input_derivative, q, v, a, ("force", body))
        pair.expect("rnea_input_derivative: force", by_force, -J.T)
    by_gravity = ours(condyle.rnea_input_derivative, q, v, a, "gravity")
    pair.expect(
        "rnea_input_derivative: gravity",
        by_gravity @ pair.theirs.gravity.linear,
        theirs(pin.computeGeneralizedGravity, q),
    )
    check_hessian(state)


def check_hessian(state: State) -> None:
    """Compares the Hessian of λᵀ τ along a direction with differences of Pinocchio's first derivatives.

    Pinocchio has no second derivatives in Python. The test uses one direction d. For this direction, it does not matter
    that derivatives at q ± h d belong to different tangent spaces.
    """
    pair, q, v, a, tau = state.pair, state.q, state.v, state.a, state.tau
    d = np.random.default_rng(0).standard_normal(pair.theirs.nv)
    d, weights = d / np.linalg.norm(d), tau / np.linalg.norm(tau)

    def slopes(h: float, dv: float = 0.0) -> tuple[float, np.ndarray, np.ndarray]:
        there = pin.integrate(pair.theirs, q, h * d)
        by_q, by_v, by_a = theirs_of(state)(pin.computeRNEADerivatives, there, v + dv * d, a)
        return weights @ by_q @ d, weights @ by_v, weights @ by_a

    hessian = ours_of(state)(condyle.rnea_hessian, q, v, a, weights)
    along_q = [(plus - minus) / (2 * STEP) for plus, minus in zip(slopes(STEP), slopes(-STEP), strict=True)]
    along_v = [(plus - minus) / (2 * STEP) for plus, minus in zip(slopes(0.0, STEP), slopes(0.0, -STEP), strict=True)]
    pair.expect("rnea_hessian: dqdq (differences)", d @ hessian.dqdq @ d, along_q[0], DIFFERENCES)
    pair.expect("rnea_hessian: dvdq (differences)", hessian.dvdq @ d, along_q[1], DIFFERENCES)
    pair.expect("rnea_hessian: dadq (differences)", hessian.dadq @ d, along_q[2], DIFFERENCES)
    pair.expect("rnea_hessian: dvdv (differences)", hessian.dvdv @ d, along_v[1], DIFFERENCES)


def check_inverse_dynamics(state: State) -> None:
    """Compares rnea and nonlinear_effects. Pinocchio supports these functions also for mimic joints."""
    pair, ours, theirs = state.pair, ours_of(state), theirs_of(state)
    q, v, a = state.q, state.v, state.a
    pair.expect("rnea", ours(condyle.rnea, q, v, a), theirs(pin.rnea, q, v, a))
    tau = theirs(pin.rnea, q, v, a, state.their_forces)
    pair.expect("rnea, f_ext", ours(condyle.rnea, q, v, a, state.f_ext), tau)
    pair.expect("nonlinear_effects", ours(condyle.nonlinear_effects, q, v), theirs(pin.nonLinearEffects, q, v))


def check_crba(state: State) -> None:
    """Compares all entries of the inertia matrix M, in both triangles."""
    state.pair.expect("crba", ours_of(state)(condyle.crba, state.q), theirs_of(state)(pin.crba, state.q))


def check_gravity(state: State) -> None:
    """Compares the joint efforts that gravity causes."""
    ours, theirs = ours_of(state), theirs_of(state)
    state.pair.expect("gravity", ours(condyle.gravity, state.q), theirs(pin.computeGeneralizedGravity, state.q))


def check_rnea_derivatives(state: State) -> None:
    """Compares ∂τ/∂q, ∂τ/∂v and ∂τ/∂a, with and without external forces."""
    if not state.pair.rates:
        return
    for label, ours_extra, theirs_extra in (("", (), ()), (", f_ext", (state.f_ext,), (state.their_forces,))):
        ours = ours_of(state)(condyle.rnea_derivatives, state.q, state.v, state.a, *ours_extra)
        theirs = theirs_of(state)(pin.computeRNEADerivatives, state.q, state.v, state.a, *theirs_extra)
        for field, our, their in zip(ours._fields, ours, theirs, strict=True):
            state.pair.expect(f"rnea_derivatives{label}: {field}", our, their)


def check_forward_dynamics(state: State) -> bool:
    """Compares q̈, M⁻¹ and the derivatives of q̈, with and without external forces. Returns false if M has no inverse.

    A body without mass at the end of a limb makes M singular. Then Pinocchio's q̈ is not finite, and Condyle's
    functions raise an error that names the joint.
    """
    pair, q, v, tau = state.pair, state.q, state.v, state.tau
    ours, theirs, distance = ours_of(state), theirs_of(state), pair.self_distance
    if not np.isfinite(distance):
        assert np.linalg.matrix_rank(theirs(pin.crba, q)) < pair.theirs.nv
        singular = pair.ours.names[pair.ours.singular_joints[0]]
        for function, arguments in ((condyle.aba, (q, v, tau)), (condyle.minv, (q,))):
            with pytest.raises(condyle.ModelError, match=singular):
                ours(function, *arguments)
        return False
    for label, ours_extra, theirs_extra in (("", (), ()), (", f_ext", (state.f_ext,), (state.their_forces,))):
        a = theirs(pin.aba, q, v, tau, *theirs_extra, pin.Convention.WORLD).copy()
        pair.expect(f"aba{label}", ours(condyle.aba, q, v, tau, *ours_extra), a, distance)
        for method in METHODS:
            a_here = ours(condyle.forward_dynamics, q, v, tau, *(ours_extra or (None,)), method)
            pair.expect(f"forward_dynamics, {method}{label}", a_here, a, distance)
        geared = bool(pair.ours.armature.any())
        for grain in GRAINS:
            divided = condyle.DivideConquer(pair.ours, grain)
            a_here = divided.aba(pair.ours, q, v, tau, *ours_extra)
            what = f"DivideConquer.aba, grain {grain}{', armature' * geared}{label}"
            pair.expect(what, a_here, a, CUTS * distance)
        if not pair.rates:
            continue
        d = ours(condyle.aba_derivatives, q, v, tau, *ours_extra)
        pair.expect(f"aba_derivatives{label}: a", d.a, a, distance)
        da_dq, da_dv, da_dtau = theirs(pin.computeABADerivatives, q, v, tau, *theirs_extra)
        pair.expect(f"aba_derivatives{label}: da_dq", d.da_dq, da_dq, distance)
        pair.expect(f"aba_derivatives{label}: da_dv", d.da_dv, da_dv, distance)
        pair.expect(f"aba_derivatives{label}: da_dtau", d.da_dtau, da_dtau, distance)
    pair.expect("minv", ours(condyle.minv, q), theirs(pin.computeMinverse, q), distance)
    check_factors(state)
    check_euler(state)
    return True


def check_factors(state: State) -> None:
    """Compares solutions by Condyle's factors of M with solutions by Pinocchio's factor."""
    pair, q, tau, distance = state.pair, state.q, state.tau, state.pair.self_distance
    M = ours_of(state)(condyle.crba, q)
    theirs_of(state)(pin.crba, q)
    theirs = (pair.theirs, pair.their_data)
    pin.cholesky.decompose(*theirs)
    x, Minv = pin.cholesky.solve(*theirs, tau), pin.cholesky.computeMinv(*theirs)
    for factor in (condyle.Ltdl(pair.ours), condyle.Cholesky(pair.ours.nv)):
        factor.factorize(M)
        name = type(factor).__name__
        pair.expect(f"{name}.solve", factor.solve(tau), x, distance)
        pair.expect(f"{name}.solve_matrix", factor.solve_matrix(tau[:, None]), x[:, None], distance)
        pair.expect(f"{name}.inverse", factor.inverse(), Minv, distance)


def check_euler(state: State) -> None:
    """Compares a step of the semi-implicit Euler method with the same step by Pinocchio's aba and integrate."""
    pair, q, v, tau, h = state.pair, state.q, state.v, state.tau, 1e-3
    simulation = Simulation(pair.ours, "semi_implicit_euler", h)
    simulation.set_state(q, v)
    assert simulation.step(tau, state.f_ext) == "done"
    v = v + h * theirs_of(state)(pin.aba, q, v, tau, state.their_forces)
    moved = with_nearer_quaternions(pair.theirs, q, pin.integrate(pair.theirs, q, h * v))
    pair.expect("Simulation.step, semi_implicit_euler: v", simulation.v, v, pair.self_distance)
    pair.expect("Simulation.step, semi_implicit_euler: q", simulation.q, moved, pair.self_distance)


def check_configuration(state: State) -> None:
    """Compares neutral, integrate and difference with their Jacobians, and interpolate, distance, normalize and
    transport.

    Pinocchio's dIntegrateTransport multiplies by ∂(q ⊕ v)/∂q, from q to q ⊕ v. Condyle's function multiplies by the
    inverse matrix.
    """
    pair, q, q1, v = state.pair, state.q, state.q1, state.v
    ours, theirs = pair.ours, pair.theirs
    pair.expect("neutral", condyle.neutral(ours), pin.neutral(theirs))
    moved = pin.integrate(theirs, q, v)
    pair.expect("integrate", condyle.integrate(ours, q, v), with_nearer_quaternions(theirs, q, moved))
    d = condyle.difference(ours, q, q1)
    pair.expect("difference", d, pin.difference(theirs, q, q1))
    for argument, J in zip(("position", "velocity"), pin.dIntegrate(theirs, q, v), strict=True):
        pair.expect(f"integrate_jacobian, {argument}", condyle.integrate_jacobian(ours, v, argument), J)
    for argument, J in zip(("from", "to"), pin.dDifference(theirs, q, q1), strict=True):
        pair.expect(f"difference_jacobian, {argument}", condyle.difference_jacobian(ours, d, argument), J)
    for t in (-0.5, 0.0, 0.3, 1.0):
        between = with_nearer_quaternions(theirs, q, pin.interpolate(theirs, q, q1, t))
        pair.expect("interpolate", condyle.interpolate(ours, q, q1, t), between)
    pair.expect("distance", condyle.distance(ours, q, q1), pin.distance(theirs, q, q1))
    pair.expect("normalize", condyle.normalize(ours, 1.5 * q), pin.normalize(theirs, 1.5 * q))
    X = np.random.default_rng(0).standard_normal((theirs.nv, 3))
    there = pin.dIntegrateTransport(theirs, q, v, X, pin.ArgumentPosition.ARG0)
    pair.expect("transport", condyle.transport(ours, v, there), X)
    pair.expect("transport", condyle.transport(ours, -v, X), there)


def with_nearer_quaternions(model: pin.Model, q: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Returns the position `moved`, in which each quaternion has the sign that makes it nearer to the quaternion in q.

    A quaternion and its negative are the same rotation. Condyle always returns the quaternion nearer to the quaternion
    in q; so does Pinocchio for an integrated free-flyer. Pinocchio may return its negative for a spherical joint that
    rotates by more than half a turn, and for interpolated positions.
    """
    first = {"JointModelSpherical": 0, "JointModelFreeFlyer": 3}
    for joint in model.joints:
        if joint.shortname() in first:
            part = slice(joint.idx_q + first[joint.shortname()], joint.idx_q + joint.nq)
            moved[part] *= np.copysign(1.0, q[part] @ moved[part])
    return moved


def poses(placements: "pin.StdVec_SE3") -> np.ndarray:
    """Converts Pinocchio's poses to homogeneous 4 × 4 matrices."""
    return np.array([X.homogeneous for X in placements])
