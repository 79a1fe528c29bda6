//! Whole-body control with the solver clarabel alone. A hundred lines of code write the same cone program as
//! `condyle::wholebody`.
//!
//! A quadruped stands on four point feet and is pushed. Each millisecond, clarabel solves the program
//!
//! ```text
//! min  ½ w ‖J q̈ + J̇ v − a*‖² + ½ w_p ‖q̈_joints − a*_joints‖² + ½ ε_a ‖q̈‖² + ½ ε_f ‖f − f_ref‖²     over q̈ and f
//! M q̈ + h − J_cᵀ f = (0, τ),  |τ| ≤ τ_max        the trunk has no motor
//! J_c q̈ + J̇_c v = 0                              the feet stay
//! ‖f_t‖ ≤ μ f_n                                  each foot in its cone
//! ```
//!
//! The example compares clarabel's solution with the solution of `WholeBodyController` for the same state.
//!
//! ```text
//! cargo run --release --features clarabel --example wholebody_clarabel
//! ```
#![allow(non_snake_case)]

#[path = "support/ground.rs"]
mod ground;

use condyle::ReferenceFrame::LocalWorldAligned;
use condyle::dynamics::{Quaternion, forward_accelerations, lie};
use condyle::nalgebra::{DMatrix, DVector};
use condyle::wholebody::clarabel::algebra::CscMatrix;
use condyle::wholebody::clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use condyle::wholebody::clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus};
use condyle::wholebody::{FrictionContact, Gains, Settings, Task, WholeBodyController};
use condyle::{ContactConstraint, Data, Force, Model, Se3, Vec3};
use condyle::{crba, difference, frame_jacobian, nonlinear_effects, robots};
use ground::Ground;
use std::error::Error;

const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
const FRICTION: f64 = 0.4;
const EFFORT: f64 = 60.0; // N m
const GAINS: Gains = Gains { stiffness: 60.0, damping: 15.5 }; // 1/s², 1/s
const TRUNK: f64 = 10.0; // w
const POSTURE: f64 = 0.1; // w_p
const SMALL_A: f64 = 1e-6; // ε_a
const SMALL_F: f64 = 1e-4; // ε_f
// Tolerance of both solvers. If the force of a foot is on the boundary of its friction cone, the error of the torques
// depends on the square root of the tolerance.
const TOLERANCE: f64 = 1e-11;
const DT: f64 = 1e-3; // s
const PUSH: f64 = 60.0; // N, to the left, from 0.1 s to 0.3 s

/// Returns the non-zero entries of a matrix.
fn sparse(A: &DMatrix<f64>, upper_triangle: bool) -> CscMatrix<f64> {
    let entries = (0..A.ncols()).flat_map(|j| (0..A.nrows()).map(move |i| (i, j)));
    let kept = entries.filter(|&(i, j)| A[(i, j)] != 0.0 && (i <= j || !upper_triangle));
    let (I, J): (Vec<_>, Vec<_>) = kept.unzip();
    let values = I.iter().zip(&J).map(|(&i, &j)| A[(i, j)]).collect();
    CscMatrix::new_from_triplets(A.nrows(), A.ncols(), I, J, values)
}

/// Data of the cone program: the posture and the pose of the trunk that the controller holds.
struct Standing<'a> {
    model: &'a Model,
    q: &'a [f64],
    trunk: Se3<f64>,
}

impl Standing<'_> {
    /// Computes (q̈, f) and τ at a state.
    fn solve(
        &self,
        data: &mut Data<f64>,
        q: &[f64],
        v: &[f64],
    ) -> Result<(DVector<f64>, DVector<f64>), Box<dyn Error>> {
        let (model, nv) = (self.model, self.model.nv());
        let (n, motors) = (nv + 3 * FEET.len(), nv - 6);
        let M = crba(model, data, q).clone();
        let h = DVector::from_column_slice(nonlinear_effects(model, data, q, v));
        // Jacobians of the trunk and of the feet, and the accelerations J̇ v of these frames at q̈ = 0.
        let trunk = model.frame("trunk")?;
        let feet: Vec<usize> = FEET.iter().map(|foot| model.frame(foot)).collect::<Result<_, _>>()?;
        let (mut J, mut J_foot) = (DMatrix::zeros(6, nv), DMatrix::zeros(6, nv));
        let (mut J_c, mut held) = (DMatrix::zeros(3 * feet.len(), nv), DVector::zeros(3 * feet.len()));
        frame_jacobian(model, q, trunk, LocalWorldAligned, &mut J);
        for (k, &foot) in feet.iter().enumerate() {
            frame_jacobian(model, q, foot, LocalWorldAligned, &mut J_foot);
            J_c.rows_mut(3 * k, 3).copy_from(&J_foot.rows(0, 3));
        }
        let motion = forward_accelerations(model, data, q, v, &vec![0.0; nv]);
        for (k, &foot) in feet.iter().enumerate() {
            let drift = motion.frame_classical_acceleration(foot, LocalWorldAligned).linear;
            held.rows_mut(3 * k, 3).copy_from_slice(&(-drift).to_array());
        }
        let (pose, velocity) = (motion.frame(trunk), motion.frame_velocity(trunk, LocalWorldAligned));
        let drift = motion.frame_classical_acceleration(trunk, LocalWorldAligned);
        let turn = lie::log3(Quaternion::from_rotation(self.trunk.rotation * pose.rotation.transpose()));
        let error = condyle::Motion::new(self.trunk.translation - pose.translation, turn);
        let wanted = error.scale(GAINS.stiffness) - velocity.scale(GAINS.damping) - drift; // a* − J̇ v
        let wanted = DVector::from_column_slice(&wanted.to_array());
        // Write the objective ½ xᵀ P x + cᵀ x.
        let (mut P, mut c) = (DMatrix::zeros(n, n), DVector::zeros(n));
        P.view_mut((0, 0), (nv, nv)).copy_from(&(J.transpose() * &J * TRUNK));
        c.rows_mut(0, nv).copy_from(&(J.transpose() * wanted * -TRUNK));
        let mut away = vec![0.0; nv];
        difference(model, q, self.q, &mut away); // q_ref ⊖ q
        for i in 0..nv {
            let weight = if i < 6 { 0.0 } else { POSTURE };
            P[(i, i)] += weight + SMALL_A;
            c[i] -= weight * (GAINS.stiffness * away[i] - GAINS.damping * v[i]);
        }
        let share = -model.gravity().z * model.total_mass() / feet.len() as f64; // f_ref: an equal share of the weight
        for k in nv..n {
            P[(k, k)] += SMALL_F;
            c[k] -= if (k - nv) % 3 == 2 { SMALL_F * share } else { 0.0 };
        }
        // Write the constraints A x + s = b, with s = 0, s ≥ 0, or s in cones.
        let mut E = DMatrix::zeros(nv, n); // τ = E x + h with E = [M, −J_cᵀ]
        E.columns_mut(0, nv).copy_from(&M);
        E.columns_mut(nv, n - nv).copy_from(&-J_c.transpose());
        let (zeros, bounds) = (6 + held.len(), 2 * motors);
        let (mut A, mut b) =
            (DMatrix::zeros(zeros + bounds + held.len(), n), DVector::zeros(zeros + bounds + held.len()));
        A.rows_mut(0, 6).copy_from(&E.rows(0, 6));
        b.rows_mut(0, 6).copy_from(&-h.rows(0, 6)); // the trunk's rows of E x + h are 0
        A.view_mut((6, 0), (held.len(), nv)).copy_from(&J_c);
        b.rows_mut(6, held.len()).copy_from(&held);
        for (side, row) in [(1.0, zeros), (-1.0, zeros + motors)] {
            A.rows_mut(row, motors).copy_from(&(E.rows(6, motors) * side)); // ±(E x + h) ≤ τ_max
            b.rows_mut(row, motors).copy_from(&(h.rows(6, motors) * -side).add_scalar(EFFORT));
        }
        for k in 0..feet.len() {
            let (row, f) = (zeros + bounds + 3 * k, nv + 3 * k);
            A[(row, f + 2)] = -FRICTION; // s = (μ f_n, f_t) in the second-order cone
            (A[(row + 1, f)], A[(row + 2, f + 1)]) = (-1.0, -1.0);
        }
        let mut cones = vec![ZeroConeT(zeros), NonnegativeConeT(bounds)];
        cones.extend(feet.iter().map(|_| SecondOrderConeT(3)));
        let settings = DefaultSettings {
            verbose: false,
            tol_feas: TOLERANCE,
            tol_gap_abs: TOLERANCE,
            tol_gap_rel: TOLERANCE,
            ..DefaultSettings::default()
        };
        let (P, A) = (sparse(&P, true), sparse(&A, false));
        let mut solver = DefaultSolver::new(&P, c.as_slice(), &A, b.as_slice(), &cones, settings)?;
        solver.solve();
        assert_eq!(solver.solution.status, SolverStatus::Solved, "clarabel stopped");
        let x = DVector::from_column_slice(&solver.solution.x);
        let tau = E * &x + h;
        Ok((x, tau))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = robots::quadruped();
    let mut q = vec![0.0, 0.0, 0.7 * 0.7f64.cos(), 0.0, 0.0, 0.0, 1.0]; // knees inwards, feet on the ground
    q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);

    let contacts = FEET.map(|foot| FrictionContact::point(foot, FRICTION));
    let tasks = [Task { gains: GAINS, ..Task::pose("trunk") }, Task { gains: GAINS, ..Task::posture() }];
    let settings = Settings {
        effort: Some(vec![EFFORT; model.nv()]),
        joint_limits: None,
        acceleration_weight: SMALL_A,
        force_weight: SMALL_F,
        tolerance: TOLERANCE,
        ..Settings::default()
    };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks, settings)?;
    let references = controller.hold(&q)?;
    let standing = Standing { model: &model, q: &q, trunk: references.frames[0].pose };

    let feet = FEET.map(|foot| ContactConstraint::point(model.frame(foot).expect("a foot of this robot")));
    let (mut world, mut data) = (Ground::new(&model, &q, feet.to_vec()), Data::new(&model));
    let mut f_ext = vec![Force::zero(); model.bodies().len()];
    let ([mut moved, mut apart], mut on_the_cone) = ([0.0f64; 2], 0);
    println!("  t, s    y, mm   used of the friction   |τ − controller's|, N m");
    for tick in 0..=1000 {
        let (x, tau) = standing.solve(&mut data, &world.q, &world.v)?;
        let command = controller.step(&world.q, &world.v, &references).solved()?;
        let torques = (6..model.nv()).map(|i| (tau[i] - command.tau[i]).abs()).fold(0.0, f64::max);
        let accelerations = x.iter().zip(&command.a).map(|(x, a)| (x - a).abs()).fold(0.0, f64::max);
        apart = apart.max(torques).max(accelerations);
        f_ext[1].linear.y = if (100..300).contains(&tick) { PUSH } else { 0.0 };
        let forces = world.step(tau.as_slice(), &f_ext, DT);
        let used = forces.iter().map(|f| f.x.hypot(f.y) / (FRICTION * f.z)).fold(0.0, f64::max);
        on_the_cone += usize::from(used > 0.99);
        assert!(
            used < 1.0 + 1e-5 && forces.iter().all(|f: &Vec3<f64>| f.z > 0.0),
            "a foot slips or lifts at tick {tick}"
        );
        moved = moved.max((world.q[1] - q[1]).abs());
        if tick % 100 == 0 {
            println!("  {:4.1} {:8.2} {used:22.2} {torques:24.1e}", DT * f64::from(tick), 1e3 * world.q[1]);
        }
    }
    println!("moved by {:.1} mm; at most {apart:.0e} from the controller (N m, rad/s², m/s²)", 1e3 * moved);
    println!("a foot used all of its friction in {on_the_cone} ticks");
    assert!(on_the_cone > 20, "the cones do not matter");
    assert!(moved > 1e-3 && (world.q[1] - q[1]).abs() < 0.3 * moved, "it comes back");
    assert!(apart < 1e-3, "the two solutions differ");
    Ok(())
}
