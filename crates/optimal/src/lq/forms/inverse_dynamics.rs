//! Knots as equations of inverse dynamics: accelerations and forces replace the controls.
//!
//! The matrices of inverse dynamics are sparse, whereas the matrices of forward dynamics are full. Inverse dynamics is
//! also cheaper to compute. The unknowns δu are therefore replaced by unknowns w of the same length: changes of
//! accelerations and contact forces. All other changes follow from w and δx by the equations that contain no control:
//! contact points do not accelerate, and the base has no motor. Let y be the change of the velocity after the step, v⁺
//! = v + Δt a:
//! ```text
//! δu = U (w, δv, δq)
//! y_c = δv_c + w_k                for a coordinate c that is an unknown
//! y_d = δv_d + D_d (w, δv, δq)    for a coordinate d that is not
//! δq⁺ = T δq + Δt E y,    δv⁺ = y:        ½ δx⁺ᵀ P δx⁺ = ½ yᵀ Π y + yᵀ N δq + ½ δqᵀ Tᵀ P₁₁ T δq
//! ```
//!
//! where Π and N are the matrices of Euler steps ([`Sweep`](crate::Sweep)). The quadratic form H of the knot then
//! consists of copies of Π and N, and of a few outer products. These contain U with the cost R of controls, and D with
//! Z = (Π y + N δq)_d − ½ Π_dd D:
//! ```text
//! H = [Π and N on w, δv, δq] + Uᵀ (R + ϱ 1) U + DᵀZ + ZᵀD + Gᵀ a″ G
//! ```
//!
//! The rows of G are the gradients of residuals that depend on more than δq. All rows have zeros that follow from the
//! robot's kinematic tree; these zeros are skipped in blocks. Then w is eliminated. The results P, p, K = U_x + U_w K_w
//! and k = U_w k_w are the same as with the controls as unknowns, because for any δx the map from w to δu is
//! invertible.
#![allow(non_snake_case)] // names follow the literature; also N, Π, D, U, Z

use super::super::feedback::{Gains, KnotFeedback};
use super::super::knot::LqKnot;
use super::super::structure::InverseDynamicsForm;
use super::super::workspace::Workspace;
use super::euler::Steps;
use super::{Curvature, KnotForm};
use condyle_linalg::{
    OuterProducts, SLACK, Vector, Vectorized, View, add_product, at_narrow_level, copy_block, copy_matrix, copy_scaled,
    eliminate, mask, padded,
};

/// Form of a knot as equations of inverse dynamics, with its scratch.
#[derive(Debug, Clone)]
pub(super) struct InverseDynamics {
    steps: Steps,
    /// Outer products that are added to H. Their rows have columns for (w, δv, δq).
    products: OuterProducts,
    /// Half of the block Π_dd of the dependent coordinates. Shape: dependent × dependent, with padding rows.
    half: Vec<f64>,
    /// Scratch: columns of Ψ for dependent coordinates. Shape: n × dependent, with padding rows.
    below: Vec<f64>,
    gains: Gains,
}

impl InverseDynamics {
    /// Returns the largest sizes of scratch that the knots need: number of entries in rows, of products, and of
    /// dependent coordinates.
    pub(super) fn room(knots: &[LqKnot]) -> [usize; 3] {
        let rooms = knots.iter().map(|LqKnot { inverse_dynamics: form, .. }| {
            let [efforts, steps, costs] = [&form.efforts, &form.steps, &form.costs].map(|rows| rows.masks.capacity());
            [2 * (efforts + steps + costs) * form.stride, efforts + 2 * steps + costs, steps]
        });
        rooms.fold([0; 3], |a, b| [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])])
    }

    /// Allocates the scratch for n states and at most m controls, with the sizes returned by [`room`](Self::room).
    pub(super) fn new([numbers, products, dependent]: [usize; 3], n: usize, m: usize) -> Self {
        Self {
            steps: Steps::new(n),
            products: OuterProducts::with_capacity(numbers, products),
            half: Vec::with_capacity((dependent + SLACK) * dependent),
            gains: Gains::new(n, m),
            below: Vec::with_capacity(padded(n) * dependent),
        }
    }
}

impl KnotForm for InverseDynamics {
    fn turn(&self, n: usize) -> usize {
        n / 2
    }

    /// Writes H with its rows and columns in the order (w, δv, δq).
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, _: &mut Curvature<'_>) {
        let (n, m, count) = (knot.ndx(), knot.nu(), knot.inverse_dynamics.dependent.len());
        let (ld, all, size) = (work.stride(m), m + n, knot.inverse_dynamics.stride);
        self.steps.write(work, knot);
        self.half.resize((count + SLACK) * count, 0.0);
        let Self { steps, products, half, .. } = self;
        at_narrow_level(WriteRows { steps, products, half, knot, regularisation, H: &mut work.H, ld });

        // the last rows of `products` are D, then (Π y + N δq)_d, which is overwritten by Z
        let Z = products.count() - count;
        let D = Z - count;
        if count > 0 {
            let (D, Z) = products.rows[D * size..].split_at_mut(count * size);
            add_product(Z, size, [all, count, count], View::new(D, size), View::new(half, count + SLACK));
        }
        // adds the products DᵀZ + ZᵀD
        let masks = &knot.inverse_dynamics.steps.masks;
        for (k, &mask) in masks.iter().enumerate() {
            products.multiply([Z + k, D + k], [u64::MAX, mask]);
        }
        for (k, &mask) in masks.iter().enumerate() {
            products.multiply([D + k, Z + k], [mask, u64::MAX]);
        }
        products.add_to(&mut work.H, ld);
        steps.add_positions(work, knot);
    }

    /// Writes Ψ y + Θ_q T δq to the rows below H, with Ψ = Δt Θ_q E + Θ_v.
    fn write_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]) {
        let (n, m, InverseDynamicsForm { own, dependent, steps: D, stride, .. }) =
            (knot.ndx(), knot.nu(), &knot.inverse_dynamics);
        let (nv, ld, ldt, at) = (n / 2, work.stride(m), padded(n), m + n + 1);
        self.steps.write_velocities_below(work, knot, Theta);
        let (Self { steps, below, .. }, Workspace { W: Psi, H, .. }) = (self, &mut *work);
        for k in (0..m).chain(m + nv..m + n) {
            H[k * ld + at..][..n].fill(0.0);
        }
        for &[c, k, length] in own {
            copy_matrix(&mut H[k * ld + at..], ld, View::new(&Psi[c * ldt..], ldt), [n, length]);
        }
        copy_matrix(&mut H[m * ld + at..], ld, View::new(Psi, ldt), [n, nv]);
        let count = dependent.len();
        if count > 0 {
            below.resize(count * ldt, 0.0);
            for (to, &d) in below.chunks_exact_mut(ldt).zip(dependent) {
                to[..n].copy_from_slice(&Psi[d * ldt..][..n]);
            }
            let (below, D) = (View::new(below, ldt), View::new(&D.numbers, *stride));
            add_product(&mut H[at..], ld, [n, m + n, count], below, D);
        }
        steps.add_positions_below(work, knot, Theta);
    }

    fn eliminate(&mut self, work: &mut Workspace, knot: &LqKnot, _: &mut KnotFeedback) -> Result<usize, (usize, f64)> {
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        eliminate(&mut work.H, ld, [m + n + 1, m + n, m])?;
        Ok(m)
    }

    fn write_gains(&mut self, work: &mut Workspace, knot: &LqKnot, feedback: &mut KnotFeedback, defers: bool) {
        let left = View::new(&work.H, work.stride(knot.nu()));
        if defers && knot.nu() > 0 {
            Gains::defer(left, knot, feedback);
        } else {
            self.gains.write(left, knot, feedback);
        }
    }
}

/// Computation of the blocks of H that consist of Π and N, and of the rows of the outer products. The rows of Uᵀ (R + ϱ
/// 1) U + Gᵀ a″ G come first, then the rows of D and of (Π y + N δq)_d.
struct WriteRows<'a> {
    steps: &'a Steps,
    products: &'a mut OuterProducts,
    half: &'a mut [f64],
    knot: &'a LqKnot,
    regularisation: f64,
    H: &'a mut [f64],
    ld: usize,
}

impl Vectorized for WriteRows<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { steps, products, half, knot, regularisation, H, ld } = self;
        let ((N, Pi), py) = (steps.N_and_Pi(), steps.py.as_slice());
        let (n, m, imp) = (knot.ndx(), knot.nu(), &knot.inverse_dynamics);
        let (nv, all, size) = (n / 2, m + n, imp.stride);
        let ldn = padded(nv);

        // copies Π and N for the unknowns and δv; unknowns with index `forces` or above are forces
        let forces = imp.own.last().map_or(0, |own| own[1] + own[2]);
        for &[c, k, length] in &imp.own {
            for &[cc, kk, rows] in imp.own.iter().filter(|own| own[1] >= k) {
                copy_block::<V>(&mut H[k * ld + kk..], ld, View::new(&Pi[c * ldn + cc..], ldn), [rows, length]);
            }
            let (Pi, N) = (View::new(&Pi[c * ldn..], ldn), View::new(&N[c * ldn..], ldn));
            copy_block::<V>(&mut H[k * ld + m..], ld, Pi, [nv, length]);
            copy_block::<V>(&mut H[k * ld + m + nv..], ld, N, [nv, length]);
            for (j, p) in py[c..c + length].iter().enumerate() {
                let column = &mut H[(k + j) * ld..][..=all];
                if forces < m {
                    column[forces..m].fill(0.0);
                }
                column[all] = *p;
            }
        }
        for k in forces..m {
            H[k * ld + k..][..=all - k].fill(0.0);
        }
        let Q = View::new(knot.Q.as_slice(), n);
        copy_block::<V>(&mut H[m * ld + m..], ld, View::new(Pi, ldn), [nv, nv]);
        copy_block::<V>(&mut H[m * ld + m + nv..], ld, View::new(N, ldn), [nv, nv]);
        copy_block::<V>(&mut H[(m + nv) * (ld + 1)..], ld, Q, [nv, nv]);
        let (q, diagonal) = (knot.q.as_slice(), &imp.diagonal[..nv]);
        for j in 0..nv {
            let column = &mut H[(m + j) * ld..][..=all];
            column[m + j] += diagonal[j];
            column[all] = py[j] + q[nv + j];
            H[(m + nv + j) * ld + all] = q[j];
        }

        // appends the rows of Uᵀ (R + ϱ 1) U and Gᵀ a″ G
        products.clear(all, size);
        for (k, row) in imp.efforts.numbers.chunks_exact(size).enumerate() {
            let mask = if imp.has_masks { imp.efforts.masks[k] } else { mask(row) };
            products.square::<V>(row, mask, [knot.r[k], imp.diagonal[nv + k] + regularisation]);
        }
        for ((row, &mask), &slopes) in imp.costs.numbers.chunks_exact(size).zip(&imp.costs.masks).zip(&imp.slopes) {
            products.square::<V>(row, mask, slopes);
        }
        // appends the rows of D and of (Π y + N δq)_d
        let count = imp.dependent.len();
        let first = products.add_rows(count) * size;
        copy_block::<V>(&mut products.rows[first..], size, View::new(&imp.steps.numbers, size), [size, count]);
        let first = products.add_rows(count);
        let (mut j, zero) = (0, V::splat(0.0));
        while j < count {
            // copies the rows of consecutive coordinates in one call
            let (d, together) = (imp.dependent[j], run(&imp.dependent[j..]));
            let rows = &mut products.rows[(first + j) * size..];
            let (own, others) = (View::new(&Pi[d * ldn..], ldn), View::new(&N[d * ldn..], ldn));
            for &[c, k, length] in &imp.own {
                copy_block::<V>(&mut rows[k..], size, own.at(c, 0), [length, together]);
            }
            for i in 0..together {
                let row = &mut rows[i * size..][..size];
                for zeros in row[forces..].chunks_exact_mut(V::N).take((m - forces).div_ceil(V::N)) {
                    zero.store(zeros); // may also clear elements after the forces, which are written next
                }
                row[all] = py[d + i];
                let mut at = 0;
                while at < count {
                    let (by, length) = (imp.dependent[at], run(&imp.dependent[at..]));
                    let half = &mut half[(j + i) * (count + SLACK) + at..];
                    copy_scaled::<V>(half, &Pi[(d + i) * ldn + by..][..length], 0.5); // uses the symmetry of Π
                    at += length;
                }
            }
            copy_block::<V>(&mut rows[m..], size, own, [nv, together]);
            copy_block::<V>(&mut rows[m + nv..], size, others, [nv, together]);
            j += together;
        }
    }
}

/// Returns the length of the run of consecutive indices at the beginning of `numbers`; at least 1.
#[inline(always)]
fn run(numbers: &[usize]) -> usize {
    let mut length = 1;
    while length < numbers.len() && numbers[length] == numbers[0] + length {
        length += 1;
    }
    length
}
