//! The relaxed logarithmic barrier: its formula, its derivatives, the optimum that it leads to, and its checks.

use condyle_dynamics::robots;
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle_optimal::{ActionModel, Fddp, LqKnot, Problem};
use num_dual::{Dual2_64, DualNum, second_derivative};
use std::sync::Arc;

const MU: f64 = 0.3;
const DELTA: f64 = 0.7;
const DT: f64 = 0.05;
/// Tolerance of two sums of about ten terms of order one that are rounded differently.
const ROUNDING: f64 = 1e-13;

fn relaxed(lower: f64, upper: f64, mu: f64, delta: f64) -> Activation {
    Activation::RelaxedBarrier { lower: vec![lower; 7], upper: vec![upper; 7], mu, delta }
}

/// Returns the barrier of a distance d with the formula of the source, minus its value at d = δ.
fn source(d: Dual2_64) -> Dual2_64 {
    let (mu, delta) = (MU, DELTA);
    if d.re >= delta {
        return (d.ln() - delta.ln()) * -mu;
    }
    let s = (d - 2.0 * delta) / delta;
    ((s * s - 1.0) * 0.5 - delta.ln()) * mu + mu * delta.ln()
}

/// Returns an arm's knot with one cost, of the controls.
fn knot(activation: Activation) -> FreeDynamics {
    let effort = Residual::Control { reference: vec![0.0; 7] };
    FreeDynamics::running(Arc::new(robots::arm7()), DT, vec![Cost::new("effort", 1.0, effort, activation)]).unwrap()
}

#[test]
fn the_barrier_and_its_derivatives_are_those_of_the_source() {
    let (lower, upper) = (-1.0, 2.0);
    for (lower, upper) in [(lower, upper), (lower, f64::INFINITY), (f64::NEG_INFINITY, upper)] {
        let formula = |r: Dual2_64| {
            let below = lower.is_finite().then(|| source(r - lower));
            let above = upper.is_finite().then(|| source(-r + upper));
            below.into_iter().chain(above).fold(Dual2_64::from(0.0), |sum, term| sum + term)
        };
        let mut action = knot(relaxed(lower, upper, MU, DELTA));
        let mut lq = LqKnot::zeros(14, 7);
        // far outside, near the bounds and the ends of the logarithm, and inside
        let us = [-30.0, -1.0, lower + 0.99 * DELTA, 0.4, upper - 1.01 * DELTA, 2.1, 9.0];
        let us = us.map(|u: f64| if u.is_finite() { u } else { 0.1 });
        action.calc_diff(0, &[0.1; 14], &us, &mut lq);
        let mut sum = 0.0;
        for (i, u) in us.into_iter().enumerate() {
            let (value, slope, curvature) = second_derivative(formula, u);
            let close = |a: f64, b: f64| assert!((a - b).abs() <= ROUNDING * (1.0 + b.abs()), "{u}: {a}, expected {b}");
            close(lq.r[i], DT * slope);
            close(lq.R[(i, i)], DT * curvature);
            close(relaxed(lower, upper, MU, DELTA).value(&[u]), value);
            sum += value;
        }
        let cost = action.calc(0, &[0.1; 14], &us, &mut [0.0; 14]);
        assert!((cost - DT * sum).abs() <= ROUNDING * (1.0 + sum.abs()), "{cost}, expected {}", DT * sum);
    }
}

#[test]
fn the_barrier_is_smooth_where_the_logarithm_ends() {
    let mut lq = LqKnot::zeros(14, 7);
    let mut at = |d: f64| {
        let mut action = knot(relaxed(0.0, f64::INFINITY, MU, DELTA));
        action.calc_diff(0, &[0.1; 14], &[d; 7], &mut lq);
        [relaxed(0.0, f64::INFINITY, MU, DELTA).value(&[d]), lq.r[0] / DT, lq.R[(0, 0)] / DT]
    };
    let step = 1e-9;
    let (inside, outside) = (at(DELTA * (1.0 + step)), at(DELTA * (1.0 - step)));
    let closed = [0.0, -MU / DELTA, MU / (DELTA * DELTA)];
    for k in 0..3 {
        // derivatives of order k + 1 at the joint are at most 2 μ/δ³, about 2
        for (side, found) in [("inside", inside[k]), ("outside", outside[k])] {
            assert!((found - closed[k]).abs() < 10.0 * step, "{side}, derivative {k}: {found}, expected {}", closed[k]);
        }
    }
    let no_bound = relaxed(f64::NEG_INFINITY, f64::INFINITY, MU, DELTA);
    assert_eq!(no_bound.value(&[1e300, -1e300, 0.0]), 0.0);
    assert!(relaxed(0.0, 1.0, MU, DELTA).value(&[f64::NAN]).is_nan());
}

/// The minimum of ½ (u − c)² − μ log(U − u) is a root of a quadratic equation: (u − c)(U − u) + μ = 0.
#[test]
fn the_optimum_with_a_barrier_is_the_root_of_its_equation() {
    let (wanted, most, delta) = (3.0, 2.0, 1e-3);
    let arm = Arc::new(robots::arm7());
    for mu in [1.0, 1e-1, 1e-2] {
        let reference = vec![wanted; 7];
        let barrier = relaxed(f64::NEG_INFINITY, most, mu, delta);
        let costs = vec![
            Cost::new("wanted", 1.0, Residual::Control { reference }, Activation::Quadratic),
            Cost::new("most", 1.0, Residual::Control { reference: vec![0.0; 7] }, barrier),
        ];
        let action = FreeDynamics::running(arm.clone(), DT, costs).unwrap();
        let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
        let x0 = vec![0.1; 14];
        let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 3], Box::new(end)).unwrap();
        let mut solver = Fddp::new(&problem);
        solver.settings.tolerance = 1e-22;
        let solution = solver.solve(&mut problem, &x0.repeat(4), &[0.0; 21]).unwrap();
        let (b, c): (f64, f64) = (wanted + most, wanted * most - mu);
        let root = 0.5 * (b - (b * b - 4.0 * c).sqrt()); // u² − (c + U) u + c U − μ = 0
        for u in &solution.us {
            assert!((u - root).abs() < 1e-9, "μ {mu}: {u}, expected {root}");
        }
    }
}

#[test]
fn wrong_barriers_are_refused_by_name() {
    let refused = |activation| {
        let cost = Cost::new("c", 1.0, Residual::Control { reference: vec![0.0; 7] }, activation);
        FreeDynamics::running(Arc::new(robots::arm7()), DT, vec![cost]).map(|_| ()).unwrap_err().to_string()
    };
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    for (lower, upper, mu, delta, message) in [
        (1.0, 0.0, MU, DELTA, "its bounds of entry 0 exclude each other: 1 and 0"),
        (infinite, infinite, MU, DELTA, "its bounds of entry 0 exclude each other: inf and inf"),
        (nan, 0.0, MU, DELTA, "its lower bound holds a NaN"),
        (0.0, nan, MU, DELTA, "its upper bound holds a NaN"),
        (0.0, 1.0, 0.0, DELTA, "its μ is 0, but it must be above 0"),
        (0.0, 1.0, nan, DELTA, "its μ is NaN, but it must be above 0"),
        (0.0, 1.0, infinite, DELTA, "its μ is inf, but it must be above 0"),
        (0.0, 1.0, MU, -1.0, "its δ is -1, but it must be above 0"),
        (0.0, 1.0, MU, nan, "its δ is NaN, but it must be above 0"),
    ] {
        assert_eq!(refused(relaxed(lower, upper, mu, delta)), format!("cost `c`: {message}"));
    }
    let short = Activation::RelaxedBarrier { lower: vec![0.0; 7], upper: vec![1.0; 6], mu: MU, delta: DELTA };
    assert_eq!(refused(short), "cost `c`: its upper bound has 6 numbers, expected 7");
}

#[test]
fn a_barrier_is_read_from_json() {
    let barrier = Activation::RelaxedBarrier {
        lower: vec![f64::NEG_INFINITY, -1.0],
        upper: vec![2.0, f64::INFINITY],
        mu: MU,
        delta: DELTA,
    };
    let text = serde_json::to_string(&barrier).unwrap();
    assert_eq!(text, r#"{"relaxed_barrier":{"lower":[null,-1.0],"upper":[2.0,null],"mu":0.3,"delta":0.7}}"#);
    assert_eq!(serde_json::from_str::<Activation>(&text).unwrap(), barrier);
}
