//! Iterate of the interior-point method, its residuals, and the directions of the steps.

use super::bounds::{Direction, Residuals, Side, Target};
use super::certificate::Candidate;
use super::cones::Cones;
use super::scaled::Scaled;
use super::system::System;
use crate::cone_program::{Size, Status};
use condyle_dynamics::level::level;
use condyle_linalg::{
    SLACK, Vector, Vectorized, View, add_product_vector, at_level, copy_scaled, dot, max_abs, transposed_product_vector,
};

/// Minimum of the constant in the relative duality gap, which is the gap divided by this constant plus |objective|. The
/// constant is at most 1, in the units of the method.
const SMALL_COST: f64 = 1e-6;

/// All memory of the method, except the results.
#[derive(Clone, Debug)]
pub(super) struct Workspace {
    pub data: Scaled,
    pub system: System,
    pub sides: [Side; 2],
    pub cones: Cones,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Products G x and F x.
    pub Kx: Vec<f64>,
    pub dx: Vec<f64>,
    pub dy: Vec<f64>,
    pub Kdx: Vec<f64>,
    /// Multipliers of the rows (lower − upper) and of the cones. The field `target` is the sum of the targets of these
    /// constraints, with the same signs.
    pub multipliers: Vec<f64>,
    pub target: Vec<f64>,
    /// Sum of z / s over both sides of each row.
    pub D: Vec<f64>,
    /// P x, Kᵀ z + Eᵀ y, P x + c − Kᵀ z − Eᵀ y, and E x − e, with K = [G; F]: the fields `Px`, `forces`, `rd` and `re`.
    pub Px: Vec<f64>,
    pub forces: Vec<f64>,
    pub rd: Vec<f64>,
    pub re: Vec<f64>,
}

/// Computes the weights D, and B with the rows √D G and W⁻¹ F.
struct Scale<'a> {
    data: &'a Scaled,
    sides: &'a [Side; 2],
    cones: &'a Cones,
    D: &'a mut [f64],
    B: &'a mut [f64],
}

impl Vectorized for Scale<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { data, sides: [lower, upper], cones, D, B } = self;
        let (m, ld) = (data.rows(), data.ld);
        for i in 0..m {
            D[i] = lower.d[i] + upper.d[i];
            let (at, rows) = (i * ld, data.range(i));
            copy_scaled::<V>(&mut B[at + rows.start..], &data.K[at + rows.start..at + rows.end], D[i].sqrt());
        }
        cones.scale_rows(data, &mut B[m * ld..]);
    }
}

/// Measures of the distance between an iterate and a solution.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    /// Mean complementarity: sᵀ z divided by the number of bounds and cones. The field `scale` is the size of the
    /// objective, divided by the same number.
    pub mu: f64,
    pub scale: f64,
    /// Dual residual ‖P x + c − Kᵀ z − Eᵀ y‖∞, with K = [G; F].
    pub dual: f64,
    /// Greatest of the relative residuals and the relative gap. Each is relative to the terms from which it is
    /// computed. The result is NaN if a residual or the gap is not finite.
    pub error: f64,
    /// Status that the iterate proves, or `None` without a proof.
    pub certificate: Option<Status>,
    /// Distance of the iterate from a proof that no solution exists.
    pub exclusion: f64,
}

impl Workspace {
    pub(super) fn new(capacity: Size) -> Self {
        level(); // Choose the level now, because reading CONDYLE_LEVEL allocates.
        let Size { unknowns: n, equalities, rows, cone_rows } = capacity;
        let (m, me, columns) = (rows + cone_rows, equalities + rows, rows + cone_rows);
        let vector = |length: usize| vec![0.0; length];
        let padded = |length: usize| vec![0.0; length + SLACK];
        Self {
            data: Scaled::new(capacity),
            system: System::new(n, me, columns),
            sides: [Side::new(m, 1.0), Side::new(m, -1.0)],
            cones: Cones::new(cone_rows),
            x: padded(n),
            y: padded(me),
            Kx: vector(columns),
            dx: padded(n),
            dy: padded(me),
            Kdx: vector(columns),
            multipliers: vector(columns),
            target: vector(columns),
            D: vector(m),
            Px: padded(n),
            forces: padded(n),
            rd: padded(n),
            re: padded(me),
        }
    }

    /// Returns whether all numbers of the iterate are finite.
    pub(super) fn is_finite(&self) -> bool {
        let (n, me) = (self.data.n, self.data.equalities());
        let finite = |x: &[f64]| max_abs(x).is_finite();
        let (m, rows) = (self.data.rows(), self.data.h.len());
        finite(&self.x[..n])
            && finite(&self.y[..me])
            && self.sides.iter().all(|side| finite(&side.z[..m]))
            && finite(&self.cones.z[..rows])
    }

    /// Computes the residuals, D, and the measures of the iterate.
    pub(super) fn measure(&mut self) -> Measure {
        let Self { data, sides, cones, x, y, Kx, multipliers, Px, forces, rd, re, .. } = self;
        let (n, m, me, columns, ld) = (data.n, data.rows(), data.equalities(), data.columns(), data.ld);
        let mut sums = [0.0; 3];
        multipliers[..m].fill(0.0);
        let [lower, upper] = sides;
        for (side, has, bound) in [(lower, &data.has_lower, &data.lower), (upper, &data.has_upper, &data.upper)] {
            at_level(Residuals { side, has, bound, Gx: &Kx[..m], multipliers: &mut multipliers[..m], sums: &mut sums });
        }
        cones.residuals(&data.h, &Kx[m..columns], &mut multipliers[m..columns], &mut sums);
        let [mut primal, gap, mut support] = sums;
        Px[..n].fill(0.0);
        forces[..n].fill(0.0);
        add_product_vector(Px, n, View::new(&data.P, ld), &x[..n]);
        data.add_transposed(&multipliers[..columns], forces);
        if me > 0 {
            let E = View::new(&data.E, ld);
            add_product_vector(forces, n, E, &y[..me]);
            transposed_product_vector(&mut re[..me], n, E, x);
            for i in 0..me {
                re[i] -= data.e[i];
                primal = primal.max(re[i].abs());
            }
            support += dot(&data.e, &y[..me]);
        }
        for i in 0..n {
            rd[i] = Px[i] + data.c[i] - forces[i];
        }
        let (dual, force) = (max_abs(&rd[..n]), max_abs(&forces[..n]));
        let (quadratic, linear) = (dot(&x[..n], &Px[..n]), dot(&x[..n], &data.c[..n]));
        let objective = 0.5 * quadratic + linear;
        let degree = data.degree.max(1.0);
        let mu = gap / degree;
        let (scale_p, scale_d) = (1.0 + max_abs(&Kx[..columns]), 1.0 + force.max(max_abs(&Px[..n])));
        let scale = data.cost.clamp(SMALL_COST, 1.0) + objective.abs();
        let error = (primal / scale_p).max(dual / scale_d).max(gap / scale);
        let error = if (primal + dual + gap).is_finite() { error } else { f64::NAN };
        let candidate = Candidate { data, x, Kx, Px, linear, force, support };
        Measure {
            mu,
            scale: scale / degree,
            dual,
            error,
            certificate: candidate.verdict(),
            exclusion: candidate.exclusion(),
        }
    }

    /// Computes the weights D of the rows, the scalings W of the cones, and the scaled rows B. Returns false if a pair
    /// (s, z) of slack variable and multiplier is not in the interior of its cone.
    pub(super) fn scale(&mut self) -> bool {
        let Self { data, sides, cones, D, system, .. } = self;
        if !cones.scale(&data.cones) {
            return false;
        }
        at_level(Scale { data, sides, cones, D, B: &mut system.B.rows });
        true
    }

    /// Computes the direction of a step towards s ∘ z = `centre` e, with slack variables s, multipliers z and the unit
    /// e of the product ∘. If `second_order` is true, corrects it by the second-order term of the last direction.
    /// Returns the inverse of the greatest step length.
    pub(super) fn direction(&mut self, centre: f64, second_order: bool, refinements: usize) -> f64 {
        let Self { data, system, sides, cones, dx, dy, Kdx, target, D, rd, re, .. } = self;
        let (n, m, me, columns) = (data.n, data.rows(), data.equalities(), data.columns());
        target[..columns].fill(0.0);
        for (side, has) in [(0, &data.has_lower), (1, &data.has_upper)] {
            at_level(Target { side: &sides[side], has, centre, second_order, target: &mut target[..m] });
        }
        cones.target(&data.cones, centre, second_order, &mut target[m..columns]);
        for i in 0..n {
            dx[i] = -rd[i];
        }
        for i in 0..me {
            dy[i] = -re[i];
        }
        data.add_transposed(&target[..columns], dx);
        system.solve(data, [dx, dy], &mut Kdx[..columns], refinements, |x| {
            for i in 0..m {
                x[i] *= D[i];
            }
            cones.weigh(&data.cones, &mut x[m..]);
        });
        let mut inverse_step = 0.0;
        for (side, has) in [(0, &data.has_lower), (1, &data.has_upper)] {
            let (side, Gdx) = (&mut sides[side], &Kdx[..m]);
            at_level(Direction { side, has, centre, second_order, Gdx, inverse_step: &mut inverse_step });
        }
        cones.direction(&data.cones, &Kdx[m..columns], &mut inverse_step);
        inverse_step
    }

    pub(super) fn advance(&mut self, step: f64) {
        let Self { data, sides, cones, x, y, Kx, dx, dy, Kdx, .. } = self;
        let (n, m, me, columns) = (data.n, data.rows(), data.equalities(), data.columns());
        let add = |x: &mut [f64], dx: &[f64]| x.iter_mut().zip(dx).for_each(|(x, dx)| *x += step * dx);
        add(&mut x[..n], &dx[..n]);
        add(&mut y[..me], &dy[..me]);
        add(&mut Kx[..columns], &Kdx[..columns]);
        for side in sides {
            add(&mut side.s[..m], &side.ds[..m]);
            add(&mut side.z[..m], &side.dz[..m]);
        }
        cones.advance(data.h.len(), step);
    }
}
