"""The comparisons, for any pair of models."""

import numpy as np
import pinocchio as pin
import pytest
from comparison import Pair, State, ours_of, theirs_of

import condyle

FRAMES = {
    "local": pin.ReferenceFrame.LOCAL,
    "world": pin.ReferenceFrame.WORLD,
    "local_world_aligned": pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
}
KINDS = {
    pin.FrameType.BODY: "link",
    pin.FrameType.JOINT: "joint",
    pin.FrameType.FIXED_JOINT: "joint",
}


def check_model(pair: Pair) -> None:
    """Sizes, names, order, placements, inertias, limits, frames."""
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
    pair.expect("damping", ours.damping, theirs.damping)
    pair.expect("friction", ours.friction, theirs.upperDryFrictionLimit)
    check_limits(pair)
    check_frames(pair)


def check_limits(pair: Pair) -> None:
    """Limits are equal, and infinite where Pinocchio has none (or ±1.01 for the numbers of a rotation)."""
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
    """The same frames but for Pinocchio's `universe`, with the same body and placement."""
    ours = {(f.name, f.kind): f for f in pair.ours.frames}
    theirs = {(f.name, KINDS[f.type]): f for f in list(pair.theirs.frames)[1:]}
    assert len(theirs) == pair.theirs.nframes - 1
    assert ours.keys() == theirs.keys()
    for key, frame in theirs.items():
        assert ours[key].body == frame.parentJoint, key
        pair.expect("frames in their bodies", ours[key].placement, frame.placement.homogeneous)


def check_kinematics(state: State) -> None:
    """Placements of bodies and frames, and the Jacobians of all frames in all three frames of reference."""
    pair, ours, q = state.pair, ours_of(state), state.q
    model, data = pair.theirs, pair.their_data
    pin.framesForwardKinematics(model, data, q)
    pair.expect("forward_kinematics", ours(condyle.forward_kinematics, q), poses(data.oMi))
    pin.computeJointJacobians(model, data, q)
    kinds = {frame.type for frame in model.frames}
    assert kinds <= KINDS.keys()
    ids = {(f.name, KINDS[f.type]): i for i, f in enumerate(model.frames) if i > 0}
    for i, frame in enumerate(pair.ours.frames):
        j = ids[frame.name, frame.kind]
        pair.expect("frame_placement", ours(condyle.frame_placement, q, i), data.oMf[j].homogeneous)
        for name, reference in FRAMES.items():
            J = ours(condyle.frame_jacobian, q, i, name)
            pair.expect(f"frame_jacobian, {name}", J, pin.getFrameJacobian(model, data, j, reference))


def check_motion(state: State) -> None:
    """Velocities, accelerations and rates of the Jacobians of all frames in all three frames of reference.

    In LOCAL_WORLD_ALIGNED Pinocchio's rate of the Jacobian belongs to the classical acceleration, as ours does.
    """
    pair, ours, q, v, a = state.pair, ours_of(state), state.q, state.v, state.a
    model, data = pair.theirs, pair.their_data
    pin.computeJointJacobiansTimeVariation(model, data, q, v)
    pin.forwardKinematics(model, data, q, v, a)
    pin.updateFramePlacements(model, data)
    ids = {(f.name, KINDS[f.type]): i for i, f in enumerate(model.frames) if i > 0}
    for i, frame in enumerate(pair.ours.frames):
        for name, reference in FRAMES.items():
            theirs = (model, data, ids[frame.name, frame.kind], reference)
            velocity = ours(condyle.frame_velocity, q, v, i, name)
            pair.expect(f"frame_velocity, {name}", velocity, pin.getFrameVelocity(*theirs).vector)
            acceleration = ours(condyle.frame_acceleration, q, v, a, i, name)
            pair.expect(f"frame_acceleration, {name}", acceleration, pin.getFrameAcceleration(*theirs).vector)
            acceleration = ours(condyle.frame_classical_acceleration, q, v, a, i, name)
            expected = pin.getFrameClassicalAcceleration(*theirs).vector
            pair.expect(f"frame_classical_acceleration, {name}", acceleration, expected)
            dJ = ours(condyle.frame_jacobian_rate, q, v, i, name)
            pair.expect(f"frame_jacobian_rate, {name}", dJ, pin.getFrameJacobianTimeVariation(*theirs))


def check_centroidal(state: State) -> None:
    """The centre of mass, momentum, and their maps and rates. What is fixed to the world counts for neither library."""
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
    expected |= {"dAg": data.dAg, "hg": data.hg.vector, "com_velocity": data.vcom[0]}
    expect_fields(pair, "centroidal_map_rate", ours(condyle.centroidal_map_rate, q, v), expected)
    expect_fields(pair, "compute_all_terms: centroidal", ours(condyle.compute_all_terms, q, v).centroidal, expected)
    hg = theirs(pin.computeCentroidalMomentum, q, v).vector
    pair.expect("centroidal_momentum", ours(condyle.centroidal_momentum, q, v), hg)
    dhg = theirs(pin.computeCentroidalMomentumTimeVariation, q, v, a).vector
    pair.expect("centroidal_momentum_rate", ours(condyle.centroidal_momentum_rate, q, v, a), dhg)


def expect_fields(pair: Pair, what: str, ours: "tuple[np.ndarray, ...]", theirs: dict[str, np.ndarray]) -> None:
    """Each member of a named tuple by its name."""
    for name, value in zip(ours._fields, ours, strict=True):
        pair.expect(f"{what}: {name}", value, theirs[name])


def check_energy(state: State) -> None:
    """Energies, and their regressors. Only without armature: of a revolute joint about an axis that is not aligned
    Pinocchio's kinetic energy leaves it out.
    """
    pair, ours, theirs, q, v = state.pair, ours_of(state), theirs_of(state), state.q, state.v
    assert not pair.theirs.armature.any()
    pair.expect("kinetic_energy", ours(condyle.kinetic_energy, q, v), theirs(pin.computeKineticEnergy, q, v))
    pair.expect("potential_energy", ours(condyle.potential_energy, q), theirs(pin.computePotentialEnergy, q))
    pair.expect("mechanical_energy", ours(condyle.mechanical_energy, q, v), theirs(pin.computeMechanicalEnergy, q, v))
    y = theirs(pin.computeKineticEnergyRegressor, q, v)
    pair.expect("kinetic_energy_regressor", ours(condyle.kinetic_energy_regressor, q, v), y)
    y = theirs(pin.computePotentialEnergyRegressor, q)
    pair.expect("potential_energy_regressor", ours(condyle.potential_energy_regressor, q), y)
    terms = ours(condyle.compute_all_terms, q, v)
    theirs(pin.computeAllTerms, q, v)
    pair.expect("compute_all_terms: kinetic_energy", terms.kinetic_energy, pair.their_data.kinetic_energy)
    pair.expect("compute_all_terms: potential_energy", terms.potential_energy, pair.their_data.potential_energy)


def check_equations_of_motion(state: State) -> None:
    """What stands in the equations of motion: Coriolis matrix, M and h in one call, static efforts, regressor."""
    pair, ours, theirs, q, v, a = state.pair, ours_of(state), theirs_of(state), state.q, state.v, state.a
    pair.expect("coriolis_matrix", ours(condyle.coriolis_matrix, q, v), theirs(pin.computeCoriolisMatrix, q, v))
    tau = theirs(pin.computeStaticTorque, q, state.their_forces)
    pair.expect("static_torque, f_ext", ours(condyle.static_torque, q, state.f_ext), tau)
    tau = theirs(pin.computeGeneralizedGravity, q)
    pair.expect("static_torque", ours(condyle.static_torque, q), tau)
    Y = theirs(pin.computeJointTorqueRegressor, q, v, a)
    pair.expect("joint_torque_regressor", ours(condyle.joint_torque_regressor, q, v, a), Y)
    terms = ours(condyle.compute_all_terms, q, v)
    theirs(pin.computeAllTerms, q, v)
    M = np.triu(pair.their_data.M)
    pair.expect("compute_all_terms: M", terms.M, M + np.triu(M, 1).T)
    pair.expect("compute_all_terms: h", terms.h, pair.their_data.nle)


def check_lock(state: State) -> None:
    """Every third joint locked, unless Pinocchio refuses: it finds no frame where a joint and a link have one name."""
    pair, rng = state.pair, np.random.default_rng(0)
    locked = list(range(1, pair.ours.nbodies, 3))
    ours = pair.ours.lock(locked, state.q)
    try:
        theirs = pin.buildReducedModel(pair.theirs, locked, state.q)
    except ValueError as error:
        if "Several frames match the filter" not in str(error):
            raise
        return
    assert ours.names == list(theirs.names)
    assert (ours.nq, ours.nv) == (theirs.nq, theirs.nv)
    if not ours.nv:
        return
    q = condyle.random_configuration(ours, 0)
    v, a = rng.standard_normal((2, ours.nv))
    pair.expect(
        "lock: rnea", condyle.rnea(ours, condyle.Data(ours), q, v, a), pin.rnea(theirs, theirs.createData(), q, v, a)
    )


def check_inverse_dynamics(state: State) -> None:
    """rnea and nonlinear_effects, which both libraries offer for mimic joints too."""
    pair, ours, theirs = state.pair, ours_of(state), theirs_of(state)
    q, v, a = state.q, state.v, state.a
    pair.expect("rnea", ours(condyle.rnea, q, v, a), theirs(pin.rnea, q, v, a))
    tau = theirs(pin.rnea, q, v, a, state.their_forces)
    pair.expect("rnea, f_ext", ours(condyle.rnea, q, v, a, state.f_ext), tau)
    pair.expect("nonlinear_effects", ours(condyle.nonlinear_effects, q, v), theirs(pin.nonLinearEffects, q, v))


def check_crba(state: State) -> None:
    """M, both triangles."""
    state.pair.expect("crba", ours_of(state)(condyle.crba, state.q), theirs_of(state)(pin.crba, state.q))


def check_gravity(state: State) -> None:
    """The efforts of gravity."""
    ours, theirs = ours_of(state), theirs_of(state)
    state.pair.expect("gravity", ours(condyle.gravity, state.q), theirs(pin.computeGeneralizedGravity, state.q))


def check_rnea_derivatives(state: State) -> None:
    """∂τ/∂q, ∂τ/∂v, ∂τ/∂a, with and without external forces."""
    for label, ours_extra, theirs_extra in (("", (), ()), (", f_ext", (state.f_ext,), (state.their_forces,))):
        ours = ours_of(state)(condyle.rnea_derivatives, state.q, state.v, state.a, *ours_extra)
        theirs = theirs_of(state)(pin.computeRNEADerivatives, state.q, state.v, state.a, *theirs_extra)
        for field, our, their in zip(ours._fields, ours, theirs, strict=True):
            state.pair.expect(f"rnea_derivatives{label}: {field}", our, their)


def check_forward_dynamics(state: State) -> bool:
    """q̈, M⁻¹ and the derivatives of q̈, with and without external forces; false if M has no inverse.

    A body without mass at the end of a limb makes M singular. Pinocchio's q̈ is then not finite; ours is refused, with
    the joint's name.
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
        d = ours(condyle.aba_derivatives, q, v, tau, *ours_extra)
        pair.expect(f"aba_derivatives{label}: a", d.a, a, distance)
        da_dq, da_dv, da_dtau = theirs(pin.computeABADerivatives, q, v, tau, *theirs_extra)
        pair.expect(f"aba_derivatives{label}: da_dq", d.da_dq, da_dq, distance)
        pair.expect(f"aba_derivatives{label}: da_dv", d.da_dv, da_dv, distance)
        pair.expect(f"aba_derivatives{label}: da_dtau", d.da_dtau, da_dtau, distance)
    pair.expect("minv", ours(condyle.minv, q), theirs(pin.computeMinverse, q), distance)
    return True


def check_configuration(state: State) -> None:
    """Neutral, integrate, difference, and their Jacobians, interpolate, distance, normalize, transport.

    Pinocchio's dIntegrateTransport multiplies with ∂(q ⊕ v)/∂q: from q to q ⊕ v. Ours goes the other way, and
    undoes it.
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
    """Of the two quaternions of a rotation the one nearer to q's: ours is, and Pinocchio's of a free-flyer that is
    integrated, but not Pinocchio's of a spherical joint that turns by more than half a turn, nor what it interpolates.
    """
    first = {"JointModelSpherical": 0, "JointModelFreeFlyer": 3}
    for joint in model.joints:
        if joint.shortname() in first:
            part = slice(joint.idx_q + first[joint.shortname()], joint.idx_q + joint.nq)
            moved[part] *= np.copysign(1.0, q[part] @ moved[part])
    return moved


def poses(placements: "pin.StdVec_SE3") -> np.ndarray:
    """Poses as homogeneous matrices."""
    return np.array([X.homogeneous for X in placements])
