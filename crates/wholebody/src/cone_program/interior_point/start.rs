//! Start of the iteration, from the data or from the last solution.

use super::cone::{margin, split, split_number};
use super::scaled::Source;
use super::solution::Solution;
use super::workspace::Workspace;
use condyle_linalg::{View, add_product_vector, max_abs};

/// Weight ω, relative to the cost, of the squared slack variables s in a cold start. The ratio of the multipliers z to
/// s is then also ω.
const WEIGHT: f64 = 0.1;
/// Distance to the boundary of a cone after a cold start has moved s into the cone.
const INSIDE: f64 = 1.0;
/// Square root of μ in a warm start, relative to the error of the last solution in the new program. μ is the product of
/// a slack variable and its multiplier. √μ is limited to the interval `CENTRE`.
const SHARE: f64 = 0.02;
const CENTRE: [f64; 2] = [1e-10, 1e-2];

impl Workspace {
    /// Computes x as the minimiser of the cost plus ω / 2 sᵀ s, with the slack variables s = h + F x. Then moves s and
    /// the multipliers z = −ω s along the axis of the cone into the cone.
    ///
    /// Source: Vandenberghe (2010), section 5.3, where ω = 1.
    pub(super) fn cold_start(&mut self) -> bool {
        let Self { data, system, sides, cones, x, y, Kx, target, .. } = self;
        let (n, m, me, columns) = (data.n, data.rows(), data.equalities(), data.columns());
        for i in 0..columns {
            let weight = if i < m { WEIGHT * (data.has_lower[i] + data.has_upper[i]) } else { WEIGHT };
            let (at, root) = (i * data.ld, weight.sqrt());
            for j in data.range(i) {
                system.B.rows[at + j] = root * data.K[at + j];
            }
            target[i] = WEIGHT * if i < m { data.lower[i] + data.upper[i] } else { -data.h[i - m] };
        }
        if !system.factorize(data) {
            return false;
        }
        for j in 0..n {
            x[j] = -data.c[j];
        }
        data.add_transposed(&target[..columns], x);
        y[..me].copy_from_slice(&data.e);
        system.solve(data, [x, y], &mut Kx[..columns], 0, |_| {});

        let (mut low_s, mut low_z) = (f64::INFINITY, f64::INFINITY);
        for (side, bound, has) in [(0, &data.lower, &data.has_lower), (1, &data.upper, &data.has_upper)] {
            let side = &mut sides[side];
            for i in 0..m {
                let s = side.sign * (Kx[i] - bound[i]);
                side.s[i] = s;
                if has[i] > 0.0 {
                    (low_s, low_z) = (low_s.min(s), low_z.min(-s));
                }
            }
        }
        for cone in &data.cones {
            let at = cone.at..cone.at + cone.dim;
            for i in at.clone() {
                let s = data.h[i] + Kx[m + i];
                (cones.s[i], cones.z[i]) = (s, -s);
            }
            low_s = low_s.min(margin(&cones.s[at.clone()]));
            low_z = low_z.min(margin(&cones.z[at]));
        }
        let shift = |low: f64| if low > 0.0 { 0.0 } else { INSIDE - low };
        let (shift_s, shift_z) = (shift(low_s), shift(low_z));
        for (side, has) in sides.iter_mut().zip([&data.has_lower, &data.has_upper]) {
            for i in 0..m {
                let s = side.s[i];
                (side.s[i], side.z[i]) = if has[i] > 0.0 { (s + shift_s, WEIGHT * (shift_z - s)) } else { (1.0, 1.0) };
            }
        }
        for cone in &data.cones {
            cones.s[cone.at] += shift_s;
            cones.z[cone.at] += shift_z;
            for z in &mut cones.z[cone.at..cone.at + cone.dim] {
                *z *= WEIGHT;
            }
        }
        true
    }

    /// Takes x and y from the last solution, whose multipliers are z*. Computes the slack variables s and the
    /// multipliers z from s − z = (h + F x) − z* and s ∘ z = μ e.
    ///
    /// Each pair (s, z) is exactly central. If s or z is large, the pair differs from the last pair by about μ / s
    /// only. The sizes of s and z are comparable, since all numbers are in units of size one. √μ is proportional to the
    /// error of the last solution in the new program, because changes of this size can activate or release a bound.
    ///
    /// Source: Chen and Harker (1993), smoothing of complementarity. Here the smoothing gives a starting point, in the
    /// algebra of the cones.
    pub(super) fn warm_start(&mut self, last: &Solution) {
        let Self { data, sides, cones, x, y, Kx, multipliers, Px, forces, rd, .. } = self;
        let (n, m, me, columns) = (data.n, data.rows(), data.equalities(), data.columns());
        for j in 0..n {
            x[j] = last.x[j] / data.units[j];
        }
        x[n..].fill(0.0);
        data.multiply(x, &mut Kx[..columns]);
        for (k, (&source, scale)) in data.equality_sources.iter().zip(&data.equality_scales).enumerate() {
            y[k] = (last.of(source, 0) - last.of(source, 1)) * data.cost / scale;
        }
        multipliers[..m].fill(0.0);
        for (k, (bound, has)) in
            [(&data.lower, &data.has_lower), (&data.upper, &data.has_upper)].into_iter().enumerate()
        {
            let side = &mut sides[k];
            for i in 0..m {
                side.s[i] = has[i] * side.sign * (Kx[i] - bound[i]);
                side.z[i] = has[i] * last.of(data.sources[i], k) * data.cost / data.scales[i];
                multipliers[i] += side.sign * side.z[i];
            }
        }
        for cone in &data.cones {
            for i in 0..cone.dim {
                let at = cone.at + i;
                cones.s[at] = data.h[at] + Kx[m + at];
                cones.z[at] = last.of(Source::Cone(cone.source + i), 0) * data.cost / cone.scale;
                multipliers[m + at] = cones.z[at];
            }
        }
        // Error of the last solution in the new program: the norms of P x + c − Kᵀ z − Eᵀ y and of min(s, z).
        Px[..n].fill(0.0);
        forces[..n].fill(0.0);
        add_product_vector(Px, n, View::new(&data.P, data.ld), &x[..n]);
        data.add_transposed(&multipliers[..columns], forces);
        add_product_vector(forces, n, View::new(&data.E, data.ld), &y[..me]);
        for j in 0..n {
            rd[j] = Px[j] + data.c[j] - forces[j];
        }
        let mut distance = 0.0_f64;
        for side in sides.iter() {
            for i in 0..m {
                distance = distance.max(side.s[i].min(side.z[i]).abs());
            }
        }
        for cone in &data.cones {
            distance = distance.max(-margin(&cones.s[cone.at..][..cone.dim]));
        }
        let root = SHARE * distance.max(max_abs(&rd[..n]));
        let mu = (root * root).clamp(CENTRE[0], CENTRE[1]);

        for (side, has) in sides.iter_mut().zip([&data.has_lower, &data.has_upper]) {
            for i in 0..m {
                let [s, z] = split_number(side.s[i] - side.z[i], mu);
                (side.s[i], side.z[i]) = if has[i] > 0.0 { (s, z) } else { (1.0, 1.0) };
            }
        }
        for cone in &data.cones {
            let at = cone.at..cone.at + cone.dim;
            let v = &mut cones.ds[at.clone()];
            for i in 0..cone.dim {
                v[i] = cones.s[cone.at + i] - cones.z[cone.at + i];
            }
            split(v, mu, &mut cones.s[at.clone()], &mut cones.z[at]);
        }
    }
}
