//! Errors in the Karush–Kuhn–Tucker conditions of a step's program, before any elimination or scaling.

use crate::controller::WholeBodyController;
use crate::inspection::{Optimum, Program};
use crate::references::References;
use nalgebra::{DVector, DVectorView};

/// Errors in the Karush–Kuhn–Tucker conditions, for the program of a step's first priority. At the default
/// [`tolerance`](crate::Settings::tolerance) the first three errors are below 1e-7, and the last is below 1e-5. The
/// solver applies its tolerance to numbers scaled to size one. These errors are not scaled: forces of 1000 N are
/// compared with accelerations of 1 m/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KktResiduals {
    /// Gradient of the Lagrangian, P x + c − Aᵀ y − Gᵀ z − Fᵀ w, relative to the largest of its terms.
    pub stationarity: f64,
    /// Largest violation of an equality, bound or cone. Each violation is relative to the norm of the constraint's row
    /// times 1 plus the norm of x.
    pub primal: f64,
    /// Distance of the cones' multipliers from their cones, relative to these multipliers.
    pub dual: f64,
    /// Sum of the products of slack variables and multipliers, relative to 1 + the terms of the objective.
    pub complementarity: f64,
}

impl KktResiduals {
    /// Returns the largest of the errors.
    pub fn worst(&self) -> f64 {
        let Self { stationarity, primal, dual, complementarity } = *self;
        [stationarity, primal, dual, complementarity].into_iter().fold(0.0, f64::max)
    }
}

impl WholeBodyController {
    /// Computes the errors in the optimality conditions at the last step, whose arguments must be given again. This
    /// function is for tests and demonstrations: it assembles the program again, and allocates. The errors have no
    /// meaning after a safe command, which is not an optimum, or for a clone before its first step.
    ///
    /// # Panics
    /// If `q`, `v` or a list of the references has the wrong length.
    ///
    /// ```
    /// # use condyle_dynamics::robots;
    /// # use condyle_wholebody::{FrictionContact, Settings, Task, WholeBodyController};
    /// # let robot = robots::quadruped();
    /// # let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|foot| FrictionContact::point(foot, 0.7));
    /// # let mut q = vec![0.0, 0.0, 0.535, 0.0, 0.0, 0.0, 1.0];
    /// # q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);
    /// let tasks = [Task::com(), Task::posture()];
    /// let mut controller = WholeBodyController::new(&robot, &feet, &tasks, Settings::default())?;
    /// let references = controller.hold(&q)?;
    /// controller.step(&q, &[0.0; 18], &references).solved().unwrap();
    /// assert!(controller.kkt_residuals(&q, &[0.0; 18], &references).worst() < 1e-6);
    /// # Ok::<(), condyle_wholebody::Error>(())
    /// ```
    #[track_caller]
    pub fn kkt_residuals(&mut self, q: &[f64], v: &[f64], references: &References) -> KktResiduals {
        let optimum = self.optimum();
        errors(&self.program(q, v, references), &optimum)
    }
}

fn errors(program: &Program, optimum: &Optimum) -> KktResiduals {
    let Optimum { x, rows: z, cones: w, .. } = optimum;
    let Program { P, c, A, b, G, lower, upper, F, h, cones } = program;
    // At the optimum, P x + c = Aᵀ y + Gᵀ z + Fᵀ w for some y.
    let terms = [P * x, c.clone(), -G.transpose() * z, -F.transpose() * w];
    let gradient = terms.iter().sum::<DVector<f64>>();
    let size = 1.0 + terms.iter().map(DVector::amax).fold(0.0, f64::max);
    let Q = A.transpose().qr().q(); // Q: basis of the gradients that Aᵀ y can cancel
    let stationarity = (&gradient - &Q * Q.tr_mul(&gradient)).amax() / size;

    let norm = |M: &nalgebra::DMatrix<f64>, i: usize| M.row(i).norm() * (1.0 + x.norm());
    let (equalities, g, s) = (A * x - b, G * x, F * x + h);
    let (mut primal, mut dual, mut gap) = (0.0_f64, 0.0_f64, 0.0_f64);
    for i in 0..b.len() {
        primal = primal.max(equalities[i].abs() / norm(A, i));
    }
    for i in 0..g.len() {
        let (below, above) = (g[i] - lower[i], upper[i] - g[i]);
        primal = primal.max(f64::max(-below, -above) / norm(G, i));
        // If the bounds exist, the multiplier of the lower bound is max(z, 0), and the multiplier of the upper bound is
        // max(−z, 0).
        for (z, slack) in [(z[i].max(0.0), below), ((-z[i]).max(0.0), above)] {
            if z > 0.0 {
                gap += z * slack;
            }
        }
    }
    let mut first = 0;
    for &dim in cones {
        let (s, w) = (s.rows(first, dim), w.rows(first, dim));
        let margin = |x: &DVectorView<'_, f64>| x.rows(1, dim - 1).norm() - x[0];
        primal = primal.max(margin(&s) / norm(F, first));
        dual = dual.max(margin(&w) / (1.0 + w[0].abs()));
        gap += s.dot(&w);
        first += dim;
    }
    let objective = 0.5 * x.dot(&(P * x)) + c.dot(x).abs();
    KktResiduals { stationarity, primal, dual, complementarity: gap.abs() / (1.0 + objective) }
}
