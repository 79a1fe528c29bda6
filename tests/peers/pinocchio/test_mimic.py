"""Tests mimic joints that share a coordinate. The tests compare rnea, crba and nle with Pinocchio's functions, and all
other functions with projections of Pinocchio's results.

A robot with mimic joints moves like the same robot with free joints along q_free = G q + offset, where G contains the
ratios of the mimic joints. So the efforts of the robot with mimic joints are Gᵀ τ_free, its inertia is Gᵀ M_free G, and
its derivatives are Gᵀ (∂τ_free/∂·) G. Pinocchio computes τ_free, M_free and ∂τ_free for the free robot. The tests check
results of forward dynamics by inserting them into the equations of motion.
"""

from pathlib import Path

import checks
import numpy as np
import pinocchio as pin
import pytest
import test_robots
from comparison import ROOT_JOINTS, Pair, State, from_urdf
from random_urdf import RandomUrdf

import condyle

STATES = 3
RANDOM = 20
ROBOTS = [n for n in test_robots.ROBOTS if n not in test_robots.NO_URDF and "<mimic" in test_robots.text(n)]
BROKEN = {"alex_psyonic_hands"}
"""Names of robots in which a joint mimics a missing joint. Neither library reads these robots with mimic=True."""
REFUSED = {"romeo", "talos_full", "talos_full_box"}
"""Names of robots in which a joint mimics a joint with a higher index. Pinocchio does not read these robots with
mimic=True."""

LARGEST = np.finfo(float).max
"""Number that Pinocchio stores as the limit of a joint without a limit."""
RANGE = 1e-9
"""Smallest range of positions that counts as nonzero."""
UNREADABLE = ("not in the kinematic tree", "Mimicking and mimicked configuration spaces have different sizes")
"""Error messages of Pinocchio for random robots. In these robots a joint mimics a joint with a higher index, or one of
the two joints is continuous and the other is not."""


class Projection:
    """Robot with mimic joints in Condyle, and the projection to its coordinates from the same robot with free joints in
    Pinocchio."""

    def __init__(self, name: str, path: str, root_joint: str | None) -> None:
        self.free = from_urdf(name, path, root_joint)
        self.ours = condyle.Model.from_urdf(path, root_joint, mimic=True)
        self.data = condyle.Data(self.ours)
        free, ours = self.free.ours, self.ours
        assert ours.names == free.names
        self.G = np.zeros((free.nv, ours.nv))
        for i, mimic in enumerate(ours.mimics):
            for k in range(free.nvs[i]):
                self.G[free.idx_vs[i] + k, ours.idx_vs[i] + k] = mimic.ratio if mimic else 1.0

    def position(self, q: np.ndarray) -> np.ndarray:
        """Converts the position q of the robot with mimic joints to a position of the robot with free joints."""
        free, ours, q_free = self.free.ours, self.ours, np.empty(self.free.ours.nq)
        for i, mimic in enumerate(ours.mimics):
            own = q[ours.idx_qs[i] :][: free.nqs[i]]
            if mimic:
                leader = next(j for j in range(1, ours.nbodies) if ours.idx_vs[j] == ours.idx_vs[i] and ours.nvs[j])
                first, turns = q[ours.idx_qs[i] :][:2], ours.joint_types[leader] == "continuous"
                x = mimic.ratio * (np.arctan2(first[1], first[0]) if turns else first[0]) + mimic.offset
                own = [np.cos(x), np.sin(x)] if ours.joint_types[i] == "continuous" else [x]
            q_free[free.idx_qs[i] :][: free.nqs[i]] = own
        return q_free

    def check_model(self, pair: Pair) -> None:
        """Compares the models. In Condyle, limits, damping and friction of a mimic joint act on the joint that it
        mimics; Pinocchio ignores them."""
        checks.check_bodies(pair)
        checks.check_frames(pair)
        ours, free, G = pair.ours, self.free.ours, np.abs(self.G)
        pair.expect("mimic: damping", ours.damping, (G**2).T @ self.free.theirs.damping)
        pair.expect("mimic: friction", ours.friction, G.T @ self.free.theirs.upperDryFrictionLimit)
        limits = [np.copy(x) for x in (pair.theirs.lowerPositionLimit, pair.theirs.upperPositionLimit)]
        velocity = np.where(pair.theirs.upperVelocityLimit == LARGEST, np.inf, pair.theirs.upperVelocityLimit)
        for i, mimic in enumerate(ours.mimics):
            if not mimic or mimic.ratio == 0.0:
                continue
            q, v = ours.idx_qs[i], ours.idx_vs[i]
            own = free.limits.velocity[free.idx_vs[i]] / abs(mimic.ratio)
            velocity[v] = min(velocity[v], own or np.inf)
            leader = next(j for j in range(1, ours.nbodies) if ours.idx_vs[j] == v and ours.nvs[j])
            if ours.nqs[leader] == free.nqs[i] == 1:
                of = (free.limits.lower[free.idx_qs[i]], free.limits.upper[free.idx_qs[i]])
                lower, upper = sorted((x - mimic.offset) / mimic.ratio for x in of)
                both = max(limits[0][q], lower), min(limits[1][q], upper)
                if both[1] - both[0] > RANGE * (1.0 + abs(both[1])):
                    limits[0][q], limits[1][q] = both
        np.testing.assert_allclose(ours.limits.velocity, velocity, rtol=1e-14)
        for our, expected in zip((ours.limits.lower, ours.limits.upper), limits, strict=True):
            finite = np.isfinite(our)
            np.testing.assert_allclose(our[finite], expected[finite], rtol=1e-14)

    def check(self, seed: int) -> None:
        """Compares all functions in one random state."""
        rng, pair, G, ours = np.random.default_rng(seed), self.free, self.G, (self.ours, self.data)
        q = condyle.random_configuration(self.ours, seed)
        v, a, tau = rng.standard_normal((3, self.ours.nv))
        state = State(pair, seed)
        q_free, v_free, theirs = self.position(q), G @ v, (pair.theirs, pair.their_data)

        def rnea(a: np.ndarray) -> np.ndarray:
            return G.T @ pin.rnea(*theirs, q_free, v_free, G @ a, state.their_forces)

        def derivatives(a: np.ndarray) -> list[np.ndarray]:
            d = pin.computeRNEADerivatives(*theirs, q_free, v_free, G @ a, state.their_forces)
            return [G.T @ x @ G for x in d]

        pin.forwardKinematics(*theirs, q_free)
        placements = checks.poses(pair.their_data.oMi)
        pair.expect("mimic: forward_kinematics", condyle.forward_kinematics(*ours, q), placements)
        f_ext = state.f_ext
        pair.expect("mimic: rnea, f_ext", condyle.rnea(*ours, q, v, a, f_ext), rnea(a))
        M = G.T @ pin.crba(*theirs, q_free) @ G
        pair.expect("mimic: crba", condyle.crba(*ours, q), M)
        ours_derivatives = condyle.rnea_derivatives(*ours, q, v, a, f_ext)
        for field, our, their in zip(ours_derivatives._fields, ours_derivatives, derivatives(a), strict=True):
            pair.expect(f"mimic: rnea_derivatives: {field}", our, their)
        self.check_terms(q, v, a, state)
        if np.linalg.matrix_rank(M) < self.ours.nv:
            return
        d = condyle.aba_derivatives(*ours, q, v, tau, f_ext)
        pair.expect("mimic: aba of aba_derivatives", d.a, condyle.aba(*ours, q, v, tau, f_ext))
        assert np.array_equal(d.da_dtau, condyle.minv(*ours, q))
        # Check M q̈ + h = τ, and the equations M ∂q̈/∂· = −∂τ/∂· and M M⁻¹ = 1.
        dtau_dq, dtau_dv, _ = derivatives(d.a)
        pair.expect("mimic: rnea of aba", rnea(d.a), tau)
        for grain in checks.GRAINS:
            divided = condyle.DivideConquer(self.ours, grain).aba(self.ours, q, v, tau, f_ext)
            solved = np.linalg.solve(M, tau - rnea(np.zeros(self.ours.nv)))
            pair.expect(f"mimic: DivideConquer.aba, grain {grain}", divided, solved)
        pair.expect("mimic: M times da_dq", M @ d.da_dq, -dtau_dq)
        pair.expect("mimic: M times da_dv", M @ d.da_dv, -dtau_dv)
        pair.expect("mimic: M times minv", M @ d.da_dtau, np.eye(self.ours.nv))

    def check_terms(self, q: np.ndarray, v: np.ndarray, a: np.ndarray, state: State) -> None:
        """Compares the Coriolis matrix, the regressor, the centre of mass, the momentum and the energies."""
        pair, G, ours, theirs = self.free, self.G, (self.ours, self.data), (self.free.theirs, self.free.their_data)
        q_free, v_free, a_free = self.position(q), G @ v, G @ a
        C = pin.computeCoriolisMatrix(*theirs, q_free, v_free)
        pair.expect("mimic: coriolis_matrix", condyle.coriolis_matrix(*ours, q, v), G.T @ C @ G)
        Y = pin.computeJointTorqueRegressor(*theirs, q_free, v_free, a_free)
        pair.expect("mimic: joint_torque_regressor", condyle.joint_torque_regressor(*ours, q, v, a), G.T @ Y)
        tau = pin.computeStaticTorque(*theirs, q_free, state.their_forces)
        pair.expect("mimic: static_torque, f_ext", condyle.static_torque(*ours, q, state.f_ext), G.T @ tau)
        T = pin.computeKineticEnergy(*theirs, q_free, v_free)
        pair.expect("mimic: kinetic_energy", condyle.kinetic_energy(*ours, q, v), T)
        pin.centerOfMass(*theirs, q_free, v_free, a_free)
        acceleration = condyle.com_acceleration(*ours, q, v, a)
        pair.expect("mimic: com_acceleration", acceleration, pair.their_data.acom[0])
        pin.dccrba(*theirs, q_free, v_free)
        terms, data = condyle.compute_all_terms(*ours, q, v), pair.their_data
        pair.expect("mimic: compute_all_terms: centroidal: Ag", terms.centroidal.Ag, data.Ag @ G)
        pair.expect("mimic: compute_all_terms: centroidal: dAg", terms.centroidal.dAg, data.dAg @ G)
        pair.expect("mimic: compute_all_terms: centroidal: hg", terms.centroidal.hg, data.hg.vector)
        pair.expect("mimic: compute_all_terms: h", terms.h, G.T @ pin.nonLinearEffects(*theirs, q_free, v_free))


@pytest.mark.parametrize("name", [n for n in ROBOTS if n not in BROKEN])
def test_projection(name: str) -> None:
    projection = Projection(name, test_robots.urdf_path(name), test_robots.root_joint(name))
    for seed in range(STATES):
        projection.check(seed)


@pytest.mark.parametrize("name", [n for n in ROBOTS if n not in BROKEN | REFUSED])
def test_directly(name: str) -> None:
    pair = test_robots.load(name, mimic=True)
    Projection(name, test_robots.urdf_path(name), test_robots.root_joint(name)).check_model(pair)
    for state in pair.states(STATES):
        checks.check_inverse_dynamics(state)
        checks.check_crba(state)


@pytest.mark.parametrize("name", sorted(BROKEN))
def test_broken(name: str) -> None:
    path = test_robots.urdf_path(name)
    with pytest.raises(ValueError, match="not in the kinematic tree"):
        pin.buildModelFromUrdf(path, mimic=True)
    with pytest.raises(condyle.ParseError, match="no joint is named"):
        condyle.Model.from_urdf(path, mimic=True)


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_refused(name: str) -> None:
    """Tests that Pinocchio rejects the robots in REFUSED. If a later version of Pinocchio reads them, they can be
    compared directly."""
    with pytest.raises(ValueError, match="not in the kinematic tree"):
        pin.buildModelFromUrdf(test_robots.urdf_path(name), mimic=True)


@pytest.mark.parametrize("seed", range(RANDOM))
def test_random_robot(seed: int, tmp_path: Path) -> None:
    """Compares random robots by projection. M is compared only with the projection, not with Pinocchio's crba.

    Pinocchio's crba contradicts its own rnea if a joint with several degrees of freedom is a descendant of a mimic
    joint. Condyle agrees with Pinocchio's rnea.
    """
    path = tmp_path / "robot.urdf"
    path.write_text(RandomUrdf(1000 + seed, mimics=True).text, encoding="utf-8")
    arguments = f"mimic robot {seed}", str(path), (None, *ROOT_JOINTS)[seed % (1 + len(ROOT_JOINTS))]
    projection = Projection(*arguments)
    for i in range(STATES):
        projection.check(seed + i)
    try:
        pair = from_urdf(*arguments, mimic=True)
    except ValueError as error:
        if not any(reason in str(error) for reason in UNREADABLE):
            raise
        return
    projection.check_model(pair)
    for state in pair.states(STATES, seed):
        checks.check_inverse_dynamics(state)
