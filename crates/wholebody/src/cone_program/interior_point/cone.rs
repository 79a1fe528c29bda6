//! Algebra of a second-order cone Q = {s : ‖s₁‖ ≤ s₀}, and Nesterov and Todd's scaling of a pair (s, z) in the interior
//! of Q.
//!
//! W = η (2 v vᵀ − J) with J = diag(1, −1, …, −1) is the matrix for which W z = W⁻¹ s = λ. Let s̄ = s / √(sᵀ J s), z̄ =
//! z / √(zᵀ J z), γ = √((1 + s̄ᵀ z̄) / 2) and η⁴ = sᵀ J s / zᵀ J z. With w = (s̄ + J z̄) / (2 γ):
//!
//! ```text
//! W = η [w₀  w₁ᵀ                       W⁻¹ = 1/η [ w₀  −w₁ᵀ
//!        w₁  I + w₁ w₁ᵀ / (1 + w₀)]               −w₁  I + w₁ w₁ᵀ / (1 + w₀)]
//! ```
//!
//! Sources: Nesterov and Todd (1997); Vandenberghe, *The CVXOPT linear and quadratic cone program solvers* (2010),
//! sections 4 and 5; Domahidi, Chu and Boyd (2013), section III.

/// Returns x₀ − ‖x₁‖, which is at least 0 if x is in the cone.
#[inline(always)]
pub(super) fn margin(x: &[f64]) -> f64 {
    x[0] - tail(x, x).sqrt()
}

/// Returns xᵀ J x = x₀² − ‖x₁‖², without cancellation.
#[inline(always)]
pub(super) fn determinant(x: &[f64]) -> f64 {
    let radius = tail(x, x).sqrt();
    (x[0] - radius) * (x[0] + radius)
}

/// Returns x₁ᵀ y₁.
#[inline(always)]
pub(super) fn tail(x: &[f64], y: &[f64]) -> f64 {
    let mut sum = 0.0;
    for i in 1..x.len() {
        sum += x[i] * y[i];
    }
    sum
}

/// Computes the scaling of a pair (s, z): returns η, and writes w and the scaled variable λ. Returns `None` if s or z
/// is not in the interior of the cone.
#[inline(always)]
pub(super) fn scaling(s: &[f64], z: &[f64], w: &mut [f64], lambda: &mut [f64]) -> Option<f64> {
    let (ds, dz) = (determinant(s), determinant(z));
    if !(ds > 0.0 && dz > 0.0 && s[0] > 0.0 && z[0] > 0.0) {
        return None;
    }
    let (rs, rz) = (ds.sqrt().recip(), dz.sqrt().recip());
    let product = (s[0] * z[0] + tail(s, z)) * rs * rz;
    let half = 0.5 / (0.5 * (1.0 + product)).sqrt(); // 1 / 2γ
    w[0] = half * (s[0] * rs + z[0] * rz);
    for i in 1..s.len() {
        w[i] = half * (s[i] * rs - z[i] * rz);
    }
    // w has the determinant 1. To satisfy this to the last digit, compute the first entry of w from the other entries.
    w[0] = (1.0 + tail(w, w)).sqrt();
    let eta = (ds / dz).sqrt().sqrt();
    apply(eta, w, z, lambda);
    Some(eta)
}

/// Computes y = W x, with the scaling W of the cone.
#[inline(always)]
pub(super) fn apply(eta: f64, w: &[f64], x: &[f64], y: &mut [f64]) {
    let inner = tail(w, x);
    let a = x[0] + inner / (1.0 + w[0]);
    y[0] = eta * (w[0] * x[0] + inner);
    for i in 1..x.len() {
        y[i] = eta * (x[i] + a * w[i]);
    }
}

/// Computes y = W⁻¹ x, with the scaling W of the cone.
#[inline(always)]
pub(super) fn apply_inverse(eta: f64, w: &[f64], x: &[f64], y: &mut [f64]) {
    let (inner, r) = (tail(w, x), eta.recip());
    let a = inner / (1.0 + w[0]) - x[0];
    y[0] = r * (w[0] * x[0] - inner);
    for i in 1..x.len() {
        y[i] = r * (x[i] + a * w[i]);
    }
}

/// Computes x ∘ y = (xᵀ y, x₀ y₁ + y₀ x₁).
#[inline(always)]
pub(super) fn product(x: &[f64], y: &[f64], out: &mut [f64]) {
    out[0] = x[0] * y[0] + tail(x, y);
    for i in 1..x.len() {
        out[i] = x[0] * y[i] + y[0] * x[i];
    }
}

/// Computes the vector y for which λ ∘ y = x.
#[inline(always)]
pub(super) fn divide(lambda: &[f64], x: &[f64], y: &mut [f64]) {
    y[0] = (lambda[0] * x[0] - tail(lambda, x)) / determinant(lambda);
    let r = lambda[0].recip();
    for i in 1..x.len() {
        y[i] = r * (x[i] - y[0] * lambda[i]);
    }
}

/// Returns 1 / α for the greatest α with λ + α d ∈ Q. If α is unbounded, the result is zero or negative.
///
/// The result is (‖ρ₁‖ − ρ₀) / √(λᵀ J λ), where λ̄ = λ / √(λᵀ J λ), ρ₀ = λ̄ᵀ J d and ρ₁ = d₁ − (ρ₀ + d₀) / (1 + λ̄₀)
/// λ̄₁.
#[inline(always)]
pub(super) fn inverse_step(lambda: &[f64], d: &[f64]) -> f64 {
    let r = determinant(lambda).sqrt().recip();
    let rho = r * (lambda[0] * d[0] - tail(lambda, d));
    let a = r * (rho + d[0]) / (1.0 + r * lambda[0]);
    let mut sum = 0.0;
    for i in 1..d.len() {
        let x = d[i] - a * lambda[i];
        sum += x * x;
    }
    r * (sum.sqrt() - rho)
}

/// Computes s and z with s ∘ z = μ e and s − z = v. In the cone's algebra, s = (v + √(v² + 4 μ e)) / 2 and z = s − v.
///
/// The square root is computed from the eigenvalues of v, v₀ ± ‖v₁‖. Source: Fukushima, Luo and Tseng (2002), smoothing
/// of complementarity.
#[inline(always)]
pub(super) fn split(v: &[f64], mu: f64, s: &mut [f64], z: &mut [f64]) {
    let radius = tail(v, v).sqrt();
    let ([sp, zp], [sm, zm]) = (split_number(v[0] + radius, mu), split_number(v[0] - radius, mu));
    let r = if radius > 0.0 { 0.5 / radius } else { 0.0 };
    s[0] = 0.5 * (sp + sm);
    z[0] = 0.5 * (zp + zm);
    for i in 1..v.len() {
        s[i] = r * (sp - sm) * v[i];
        z[i] = r * (zp - zm) * v[i];
    }
}

/// Returns s and z with s z = μ and s − z = v.
#[inline(always)]
pub(super) fn split_number(v: f64, mu: f64) -> [f64; 2] {
    let greater = 0.5 * (v.abs() + (v * v + 4.0 * mu).sqrt());
    if v > 0.0 { [greater, mu / greater] } else { [mu / greater, greater] }
}
