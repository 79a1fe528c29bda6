"""Whole-body control with the solver Clarabel: the cone program of `condyle.wholebody`, written in a hundred lines.

A quadruped stands on four point feet and is pushed. Each millisecond the program

    min  ½ w ‖J q̈ + J̇ v − a*‖² + ½ w_p ‖q̈_joints − a*_joints‖² + ½ ε_a ‖q̈‖² + ½ ε_f ‖f − f_ref‖²     over q̈ and f
    M q̈ + h − J_cᵀ f = (0, τ),  |τ| ≤ τ_max        the trunk has no motor
    J_c q̈ + J̇_c v = 0                              the feet stay
    ‖f_t‖ ≤ μ f_n                                  each foot in its cone

is written in Clarabel's form and solved by Clarabel. J is the Jacobian of the trunk's task, and J_c the Jacobian of the
feet. a* are desired accelerations, and f are the forces on the feet, with tangential parts f_t and normal parts f_n.
For comparison, `WholeBodyController` computes a command for the same state.

    pip install clarabel
    python python/examples/wholebody_clarabel.py
"""

import clarabel
import numpy as np
from ground import Ground
from scipy.sparse import csc_matrix, triu
from scipy.spatial.transform import Rotation

import condyle
from condyle.wholebody import FrictionContact, Gains, Settings, Task, WholeBodyController

FEET = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"]
FRICTION = 0.4
EFFORT = 60.0  # maximum effort τ_max (N m)
STIFFNESS, DAMPING = 60.0, 15.5  # gains of the tasks (1/s², 1/s)
TRUNK, POSTURE, SMALL_A, SMALL_F = 10.0, 0.1, 1e-6, 1e-4  # weights w, w_p, ε_a, ε_f
# Tolerance of both solvers. If the force on a foot just reaches its friction cone, torques have errors up to the square
# root of this tolerance.
TOLERANCE = 1e-11
DT = 1e-3  # time step (s)
PUSH = 60.0  # force to the left (N), from 0.1 s to 0.3 s
ALIGNED = "local_world_aligned"


class Standing:
    """A posture to hold, and the cone program that holds this posture at a given state."""

    def __init__(self, model, q_ref, trunk):
        self.model, self.data, self.q_ref, self.trunk = model, condyle.Data(model), q_ref, trunk
        self.settings = clarabel.DefaultSettings()
        self.settings.verbose = False
        self.settings.tol_gap_abs = self.settings.tol_gap_rel = self.settings.tol_feas = TOLERANCE

    def solve(self, q, v):
        """Returns q̈, f and τ at a state."""
        model, data, nv, nf = self.model, self.data, self.model.nv, 3 * len(FEET)
        M, h, rest = condyle.crba(model, data, q), condyle.nonlinear_effects(model, data, q, v), np.zeros(model.nv)
        J = condyle.frame_jacobian(model, data, q, "trunk", ALIGNED)
        J_c = np.vstack([condyle.frame_jacobian(model, data, q, foot, ALIGNED)[:3] for foot in FEET])
        drift, *held = (  # J̇ v: the accelerations of the frames for q̈ = 0
            condyle.frame_classical_acceleration(model, data, q, v, rest, frame, ALIGNED) for frame in ("trunk", *FEET)
        )
        held = np.concatenate([a[:3] for a in held])
        pose = condyle.frame_placement(model, data, q, "trunk")
        turn = Rotation.from_matrix(self.trunk[:3, :3] @ pose[:3, :3].T).as_rotvec()
        error = np.r_[self.trunk[:3, 3] - pose[:3, 3], turn]
        wanted = STIFFNESS * error - DAMPING * J @ v - drift  # the difference a* − J̇ v
        joints = STIFFNESS * condyle.difference(model, q, self.q_ref) - DAMPING * v
        weights = np.where(np.arange(nv) < 6, 0.0, POSTURE)
        share = np.tile([0.0, 0.0, -model.gravity[2] * model.total_mass / len(FEET)], len(FEET))  # forces f_ref

        # cost ½ xᵀ P x + cᵀ x with x = (q̈, f)
        P = np.zeros((nv + nf, nv + nf))
        P[:nv, :nv] = TRUNK * J.T @ J + np.diag(weights + SMALL_A)
        P[nv:, nv:] = SMALL_F * np.eye(nf)
        c = -np.r_[TRUNK * J.T @ wanted + weights * joints, SMALL_F * share]
        # constraints A x + s = b, with s = 0, s ≥ 0, and s in second-order cones
        E = np.hstack([M, -J_c.T])  # efforts τ = E x + h
        cone = np.zeros((3, 3))  # slack s = (μ f_n, f_t)
        cone[0, 2], cone[1, 0], cone[2, 1] = -FRICTION, -1.0, -1.0
        cones = np.hstack([np.zeros((nf, nv)), np.kron(np.eye(len(FEET)), cone)])
        A = np.vstack([E[:6], np.hstack([J_c, np.zeros((nf, nf))]), E[6:], -E[6:], cones])
        b = np.r_[-h[:6], -held, EFFORT - h[6:], EFFORT + h[6:], np.zeros(nf)]
        kinds = [clarabel.ZeroConeT(6 + nf), clarabel.NonnegativeConeT(2 * (nv - 6))]
        kinds += [clarabel.SecondOrderConeT(3) for _ in FEET]
        solver = clarabel.DefaultSolver(csc_matrix(triu(P)), c, csc_matrix(A), b, kinds, self.settings)
        solution = solver.solve()
        assert str(solution.status) == "Solved", solution.status
        x = np.array(solution.x)
        return x[:nv], x[nv:], E @ x + h


def main():
    model = condyle.robots.quadruped()
    knees = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4] * 2  # knees bent inwards; the feet are on the ground
    q = np.r_[0.0, 0.0, 0.7 * np.cos(0.7), 0.0, 0.0, 0.0, 1.0, knees]

    gains = Gains(STIFFNESS, DAMPING)
    tasks = [Task.pose("trunk", gains=gains), Task.posture(gains=gains)]
    contacts = [FrictionContact.point(foot, FRICTION) for foot in FEET]
    settings = Settings(
        effort=np.full(model.nv, EFFORT),
        joint_limits=None,
        acceleration_weight=SMALL_A,
        force_weight=SMALL_F,
        tolerance=TOLERANCE,
    )
    controller = WholeBodyController(model, contacts, tasks, settings)
    references = controller.hold(q)
    standing = Standing(model, q, condyle.frame_placement(model, condyle.Data(model), q, "trunk"))

    world, f_ext, moved, apart = Ground(model, q, FEET), np.zeros((model.nbodies, 6)), 0.0, 0.0
    on_the_cone = 0
    print("  t, s    y, mm   used of the friction   |τ − controller's|, N m")
    for tick in range(501):
        a, _, tau = standing.solve(world.q, world.v)
        command = controller.step(world.q, world.v, references).solved()
        torques = np.abs(tau - command.tau)[6:].max()
        apart = max(apart, torques, np.abs(a - command.a).max())
        f_ext[1, 1] = PUSH if 100 <= tick < 300 else 0.0
        forces = world.step(tau, DT, f_ext)
        used = np.max(np.hypot(forces[:, 0], forces[:, 1]) / (FRICTION * forces[:, 2]))
        assert used < 1.0 + 1e-5 and forces[:, 2].min() > 0.0, f"a foot slips or lifts at tick {tick}"
        on_the_cone += used > 0.99
        moved = max(moved, abs(world.q[1]))
        if tick % 100 == 0:
            print(f"  {tick * DT:4.1f} {1e3 * world.q[1]:8.2f} {used:22.2f} {torques:24.1e}")
    print(f"moved by {1e3 * moved:.1f} mm; at most {apart:.0e} from the controller (N m, rad/s², m/s²)")
    print(f"a foot used all of its friction in {on_the_cone} ticks")
    assert on_the_cone > 20, "the cones do not matter"
    assert moved > 1e-3 and abs(world.q[1]) < moved, "it comes back"
    assert apart < 1e-3, "the two solutions differ"


if __name__ == "__main__":
    main()
