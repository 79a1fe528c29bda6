//! Activations: functions that convert a residual into a cost.

use crate::problem::leave_a_value;

/// Activation a(r): a function that converts a residual r into a cost.
///
/// ```
/// use condyle_optimal::robot::Activation;
/// let barrier = Activation::Barrier { lower: vec![-1.0, -1.0], upper: vec![1.0, f64::INFINITY] };
/// assert_eq!(barrier.value(&[3.0, 3.0]), 2.0); // ½ (3 − 1)², and nothing for the second
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case", deny_unknown_fields))]
#[non_exhaustive]
pub enum Activation {
    /// Sum of squares, ½ Σ rᵢ².
    Quadratic,
    /// Weighted sum of squares, ½ Σ wᵢ rᵢ².
    Weighted(
        /// Weights w, one for each entry of the residual, at least 0.
        Vec<f64>,
    ),
    /// Sum of squares outside bounds, ½ Σ (excess of rᵢ over its bounds)²; zero inside the bounds.
    Barrier {
        /// Lower bounds; −∞ for an entry without a lower bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
        lower: Vec<f64>,
        /// Upper bounds; ∞ for an entry without an upper bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
        upper: Vec<f64>,
    },
    /// Weighted sum of squares outside bounds, ½ Σ wᵢ (excess of rᵢ over its bounds)². (In Crocoddyl the value contains
    /// wᵢ² instead of wᵢ.)
    WeightedBarrier {
        /// Lower bounds; −∞ for an entry without a lower bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
        lower: Vec<f64>,
        /// Upper bounds; ∞ for an entry without an upper bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
        upper: Vec<f64>,
        /// Weights w, one for each entry of the residual, at least 0.
        weights: Vec<f64>,
    },
    /// Relaxed logarithmic barrier, Σ β(rᵢ − lowerᵢ) + Σ β(upperᵢ − rᵢ), of the distances d to all finite bounds.
    ///
    /// ```text
    /// β(d) = −μ log(d/δ)  for d ≥ δ,      β(d) = ½ μ (((d − 2δ)/δ)² − 1)  for d < δ
    /// ```
    ///
    /// β is convex and twice continuously differentiable, also at d = δ, and finite where a bound is violated. Unlike
    /// [`Barrier`](Self::Barrier), it has curvature inside the bounds too: a step towards a bound that is not yet
    /// reached becomes more expensive. β(δ) = 0, so the value does not depend on the unit of r; it is negative far
    /// inside. Without this normalisation, which changes no derivative, β of the source is larger by −μ log δ. As δ and
    /// μ tend to 0, the minimum tends to the minimum with the bounds as constraints. Source: Feller and Ebenbauer,
    /// Relaxed logarithmic barrier function based model predictive control of linear systems, 2017.
    RelaxedBarrier {
        /// Lower bounds; −∞ for an entry without a lower bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
        lower: Vec<f64>,
        /// Upper bounds; ∞ for an entry without an upper bound.
        #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
        upper: Vec<f64>,
        /// Barrier parameter μ, above 0, in the unit of the cost. At the distance d ≥ δ, a bound pushes the residual
        /// away with the slope μ/d.
        mu: f64,
        /// Distance δ to a bound, above 0, in the unit of the residual. The logarithm ends at this distance, and the
        /// quadratic function with curvature μ/δ² begins.
        delta: f64,
    },
    /// Sum Σ rᵢ, for a residual that is itself a cost. The Gauss–Newton Hessian of this activation is zero. Only the
    /// residual contributes second derivatives
    /// ([`ResidualFunction::calc_hessian`](crate::robot::ResidualFunction::calc_hessian)).
    Sum,
    /// Smooth absolute value, Σ √(ε + rᵢ²), which is close to Σ |rᵢ|.
    Smooth1 {
        /// Smoothing parameter ε, above 0; Crocoddyl's default is 1.
        epsilon: f64,
    },
    /// Smooth norm, √(ε + ‖r‖²), which is close to ‖r‖. Its Hessian is approximated by ε/a³ times the identity, with
    /// the value a of the activation. The factor ε/a³ is the smallest eigenvalue of the exact Hessian (for ε = 1 as in
    /// Crocoddyl).
    Smooth2 {
        /// Smoothing parameter ε, above 0; Crocoddyl's default is 1.
        epsilon: f64,
    },
}

impl Activation {
    /// Returns the value a(r).
    ///
    /// # Panics
    /// If a weight or bound for an entry of r is missing.
    #[track_caller]
    pub fn value(&self, r: &[f64]) -> f64 {
        let mut sum = 0.0;
        self.assert_fits(r.len());
        match self {
            Self::Smooth2 { epsilon } => sum = (epsilon + square(r)).sqrt(),
            _ => self.each(r, |_, [value, ..]| sum += value),
        }
        sum
    }

    /// Panics if a weight or bound is missing for one of n entries.
    #[track_caller]
    fn assert_fits(&self, n: usize) {
        let found = match self {
            Self::Weighted(weights) => weights.len(),
            Self::Barrier { lower, upper } | Self::RelaxedBarrier { lower, upper, .. } => lower.len().min(upper.len()),
            Self::WeightedBarrier { lower, upper, weights } => lower.len().min(upper.len()).min(weights.len()),
            Self::Quadratic | Self::Sum | Self::Smooth1 { .. } | Self::Smooth2 { .. } => n,
        };
        assert!(
            n <= found,
            "`r` has length {n}, expected at most {found}: the activation has weights or bounds for these"
        );
    }

    /// Computes the gradient a′ᵢ into `d` and the diagonal a″ᵢ of the Hessian into `dd`.
    pub(super) fn derivatives(&self, r: &[f64], d: &mut [f64], dd: &mut [f64]) {
        let (d, dd) = (&mut d[..r.len()], &mut dd[..r.len()]);
        match self {
            Self::Smooth2 { epsilon } => {
                let a = (epsilon + square(r)).sqrt();
                (0..r.len()).for_each(|i| d[i] = r[i] / a);
                dd.fill(epsilon / (a * a * a));
            }
            _ => self.each(r, |i, [_, first, second]| (d[i], dd[i]) = (first, second)),
        }
    }

    /// Calls `visit` for each entry rᵢ, with the term of rᵢ in the activation and the first and second derivatives of
    /// this term. Supports only activations that are sums over entries.
    #[inline(always)]
    fn each(&self, r: &[f64], mut visit: impl FnMut(usize, [f64; 3])) {
        let beyond = |i: usize, lower: &[f64], upper: &[f64]| {
            let e = (r[i] - lower[i]).min(0.0) + (r[i] - upper[i]).max(0.0); // negative below the lower bound
            [0.5 * e * e, e, f64::from(u8::from(e != 0.0))]
        };
        let entries = 0..r.len();
        match self {
            Self::Quadratic => entries.for_each(|i| visit(i, [0.5 * r[i] * r[i], r[i], 1.0])),
            Self::Weighted(w) => entries.for_each(|i| visit(i, [0.5 * w[i] * r[i] * r[i], w[i] * r[i], w[i]])),
            Self::Barrier { lower, upper } => entries.for_each(|i| visit(i, beyond(i, lower, upper))),
            Self::WeightedBarrier { lower, upper, weights: w } => {
                entries.for_each(|i| visit(i, beyond(i, lower, upper).map(|x| w[i] * x)));
            }
            Self::RelaxedBarrier { lower, upper, mu, delta } => entries.for_each(|i| {
                let below = relaxed_log(r[i] - lower[i], *mu, *delta);
                let above = relaxed_log(upper[i] - r[i], *mu, *delta);
                visit(i, [below[0] + above[0], below[1] - above[1], below[2] + above[2]]); // ∂d/∂r is 1 and −1
            }),
            Self::Sum => entries.for_each(|i| visit(i, [r[i], 1.0, 0.0])),
            Self::Smooth1 { epsilon } => entries.for_each(|i| {
                let a = (epsilon + r[i] * r[i]).sqrt();
                visit(i, [a, r[i] / a, epsilon / (a * a * a)]);
            }),
            Self::Smooth2 { .. } => {} // `Smooth2` is not a sum over entries
        }
    }

    /// Copies another activation. Allocates nothing if both are equal or have weights of the same length.
    pub(super) fn assign(&mut self, from: &Self) {
        match (&mut *self, from) {
            (Self::Weighted(own), Self::Weighted(others)) if own.len() == others.len() => own.copy_from_slice(others),
            (own, others) if own == others => {}
            (own, others) => own.clone_from(others),
        }
    }

    /// Returns the weights of the entries of the residual, which may be changed in place; `None` for an activation
    /// without weights.
    pub(super) fn weights_mut(&mut self) -> Option<&mut [f64]> {
        match self {
            Self::Weighted(weights) | Self::WeightedBarrier { weights, .. } => Some(weights),
            _ => None,
        }
    }

    /// Returns the weights of the entries of the residual; `None` for an activation without weights.
    pub(super) fn weights(&self) -> Option<&[f64]> {
        match self {
            Self::Weighted(weights) | Self::WeightedBarrier { weights, .. } => Some(weights),
            _ => None,
        }
    }

    /// Returns an error message if this activation is invalid or does not fit a residual with n entries.
    pub(super) fn wrong(&self, n: usize) -> Option<String> {
        let length = |name: &str, numbers: &[f64]| match numbers.len() == n {
            true if numbers.iter().any(|x| x.is_nan()) => Some(format!("its {name} holds a NaN")),
            true => None,
            false => Some(format!("its {name} has {} numbers, expected {n}", numbers.len())),
        };
        let weighting = |w: &[f64]| wrong_weights(w, n);
        let ordered = |lower: &[f64], upper: &[f64]| {
            let i = lower.iter().zip(upper).position(|(&lower, &upper)| !leave_a_value(lower, upper))?;
            Some(format!("its bounds of entry {i} exclude each other: {} and {}", lower[i], upper[i]))
        };
        let bounds = |lower: &[f64], upper: &[f64]| {
            let lengths = length("lower bound", lower).or_else(|| length("upper bound", upper));
            lengths.or_else(|| ordered(lower, upper))
        };
        let positive = |name: &str, x: f64| {
            let wrong = !(x > 0.0 && x.is_finite());
            wrong.then(|| format!("its {name} is {x}, but it must be above 0"))
        };
        match self {
            Self::Quadratic | Self::Sum => None,
            Self::Weighted(w) => weighting(w),
            Self::Barrier { lower, upper } => bounds(lower, upper),
            Self::WeightedBarrier { lower, upper, weights } => bounds(lower, upper).or_else(|| weighting(weights)),
            Self::RelaxedBarrier { lower, upper, mu, delta } => {
                bounds(lower, upper).or_else(|| positive("μ", *mu)).or_else(|| positive("δ", *delta))
            }
            Self::Smooth1 { epsilon } | Self::Smooth2 { epsilon } => positive("ε", *epsilon),
        }
    }
}

/// Returns an error message if the weights of a residual with n entries are invalid.
pub(super) fn wrong_weights(w: &[f64], n: usize) -> Option<String> {
    if w.len() != n {
        return Some(format!("its weighting has {} numbers, expected {n}", w.len()));
    }
    let bad = |i: usize| format!("its weight {i} is {}, expected a finite number of at least 0", w[i]);
    w.iter().position(|x| !(*x >= 0.0 && x.is_finite())).map(bad)
}

/// Returns the relaxed logarithmic barrier β(d) of the distance d to a bound, and its first and second derivatives. All
/// are 0 for an infinite bound.
#[inline(always)]
fn relaxed_log(d: f64, mu: f64, delta: f64) -> [f64; 3] {
    if d == f64::INFINITY {
        return [0.0; 3];
    }
    if d >= delta {
        let slope = -mu / d;
        return [-mu * (d / delta).ln(), slope, -slope / d];
    }
    let s = (d - 2.0 * delta) / delta; // β = ½ μ (s² − 1), ∂s/∂d = 1/δ
    [0.5 * mu * (s * s - 1.0), mu * s / delta, mu / (delta * delta)]
}

fn square(r: &[f64]) -> f64 {
    r.iter().map(|r| r * r).sum()
}
