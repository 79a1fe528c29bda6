//! Faults that sensitivities report, and derivatives that do not exist.

use super::{arm, first_solution, quadruped, solve_tightly};
use condyle_optimal::{
    ActionModel, Curvature, Error, Fddp, LqKnot, Parameter, Problem, Sensitivity, SensitivitySettings, Settings,
};

/// Returns the text of the error of a sensitivity.
fn text(result: Result<Sensitivity, Error>) -> String {
    result.map(|_| ()).unwrap_err().to_string()
}

/// Checks the errors for a solution that has not converged, for a problem that has changed, and for wrong arguments.
#[test]
fn faults_are_named() {
    let mut problem = arm(&[0.0; 20]);
    let near = first_solution(&mut problem);
    let solution = solve_tightly(&mut problem, &near.xs, &near.us, true);
    let settings = SensitivitySettings::default;
    let unsolved = text(Sensitivity::new(&mut problem, Fddp::new(&arm(&[0.0; 20])).solution(), None, settings()));
    assert_eq!(unsolved, "sensitivity: the solver has not solved the problem yet");
    let mut short = Fddp::new(&problem);
    short.settings = Settings { max_iterations: 1, ..Settings::default() };
    let unfinished = short.solve(&mut problem, &near.xs, &vec![0.0; near.us.len()]).unwrap().clone();
    let found = text(Sensitivity::new(&mut problem, &unfinished, None, settings()));
    assert_eq!(found, "sensitivity: the solution reached the limit of iterations, expected one that converged");

    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, settings()).unwrap();
    let unknown = sensitivity.jacobian(&mut problem, &Parameter::Target("grasp".into())).unwrap_err().to_string();
    assert_eq!(unknown, "sensitivity: the problem does not have the parameter `target/grasp`");
    let none = sensitivity.jacobian(&mut problem, &"entry_weights/effort".parse().unwrap()).unwrap_err().to_string();
    assert_eq!(none, "cost `effort`: it has no weights of entries");
    let name = "goal".parse::<Parameter>().unwrap_err().to_string();
    assert!(
        name.starts_with("sensitivity: `goal` is no parameter; expected `x0`, `duration`, `target/NAME`"),
        "{name}"
    );
    let length = sensitivity.adjoint(&[0.0; 3], &[0.0; 105]).unwrap_err().to_string();
    assert_eq!(length, "`by_states`: expected length 224, found 3");

    let change = |entry: usize, by: f64| {
        let mut p = [0.0; 20];
        p[entry] = by;
        sensitivity.jacobian_of(&problem, 1, 1e-5, |_| Ok(arm(&p))).unwrap_err().to_string()
    };
    let start = "sensitivity: the problem that is built without a change is another one than the solved problem: ";
    let [cost, state] = [change(17, 0.1), change(0, 0.1)];
    assert!(cost.starts_with(&format!("{start}the cost of knot 0 is ")), "{cost}");
    assert_eq!(state, format!("{start}the initial state differs by 1.000e-1"));

    sensitivity.check_problem(&mut problem).unwrap();
    problem.parameter(&Parameter::Duration).unwrap(); // a reader changes nothing
    sensitivity.check_problem(&mut problem).unwrap();
    let x0 = problem.x0().to_vec();
    problem.set_x0(&[0.2; 14]).unwrap();
    let moved = sensitivity.check_problem(&mut problem).unwrap_err().to_string();
    assert!(moved.ends_with(": the problem has changed since the sensitivity was created"), "{moved}");
    problem.set_x0(&x0).unwrap();
    problem.cost_mut(0, "reach").unwrap().set_weight(40.0).unwrap();
    let late = sensitivity.jacobian(&mut problem, &"target/reach".parse().unwrap()).unwrap_err().to_string();
    assert_eq!(late, "sensitivity: knot 0 of the problem has changed since the sensitivity was created");
    let changed = text(Sensitivity::new(&mut problem, &solution, None, settings()));
    assert!(changed.contains("the solution is inexact, or the problem has changed since the solve"), "{changed}");
}

/// Checks that parameters are vectors that can be read and set by their names.
#[test]
fn parameters_are_vectors() {
    let mut problem = quadruped(&[0.0; 9]);
    let names = ["x0", "target/centre", "weight/effort", "entry_weights/rest", "contact/LF_foot", "duration"];
    for (name, size) in names.into_iter().zip([37, 3, 1, 36, 16, 1]) {
        let parameter: Parameter = name.parse().unwrap();
        let mut value = problem.parameter(&parameter).unwrap();
        assert_eq!(value.len(), size, "{name}");
        let last = if size == 16 { 3 } else { size - 1 }; // of a placement: the x coordinate
        value[last] += 0.25;
        problem.set_parameter(&parameter, &value).unwrap();
        assert_eq!(problem.parameter(&parameter).unwrap(), value, "{name}");
        assert!(problem.set_parameter(&parameter, &[0.5; 40]).is_err());
        assert_eq!(problem.parameter(&parameter).unwrap(), value, "{name}");
    }
    assert_eq!(problem.duration(3), Some(0.02 + 0.25));
    problem.set_duration(3, 0.1).unwrap();
    let differs = problem.parameter(&Parameter::Duration).unwrap_err().to_string();
    assert_eq!(differs, "sensitivity: the value of `duration` differs from knot to knot");
}

/// Action x⁺ = x + u with the cost ½ (x − 1)² + c u⁴/4 − ½ b u², and a bound u ≤ 0.5.
struct Scalar {
    nu: usize,
    weight: f64,
    bounds: [Vec<f64>; 2],
}

impl Scalar {
    fn problem(x0: f64, weight: f64, upper: f64) -> Problem {
        let action = |nu: usize| {
            let bounds = [vec![f64::NEG_INFINITY; nu], vec![upper; nu]];
            Box::new(Self { nu, weight, bounds }) as Box<dyn ActionModel>
        };
        Problem::new(vec![x0], vec![action(1)], vec![0], action(0)).unwrap()
    }
}

impl ActionModel for Scalar {
    fn nx(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        (self.nu > 0).then_some((&self.bounds[0], &self.bounds[1]))
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let Some(u) = u.first() else { return 0.5 * x[0] * x[0] };
        next[0] = x[0] + u;
        0.5 * self.weight * u * u
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        knot.S.fill(0.0);
        knot.B.fill(1.0);
        knot.A[0] = 1.0;
        match u.first() {
            None => (knot.q[0], knot.Q[0]) = (x[0], 1.0),
            Some(u) => (knot.q[0], knot.Q[0], knot.r[0], knot.R[0]) = (0.0, 0.0, self.weight * u, self.weight),
        }
    }
}

/// Checks the flag of strict complementarity. With u* = −x₀ / (1 + w), the bound is active for large −x₀, and the
/// solution has a kink where u* equals the bound.
#[test]
fn kinks_are_flagged() {
    for (x0, strict, active, slope) in [(-2.0, true, 1, 0.0), (-0.5, true, 0, -0.5), (-1.0, false, 1, 0.0)] {
        let mut problem = Scalar::problem(x0, 1.0, 0.5);
        let solution = Fddp::new(&problem).solve(&mut problem, &[x0; 2], &[0.0]).unwrap().clone();
        let settings = SensitivitySettings { curvature: Curvature::GaussNewton, ..SensitivitySettings::default() };
        let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, settings).unwrap();
        let report = sensitivity.report();
        println!("{report:?}");
        assert_eq!((report.strict_complementarity, report.active_controls), (strict, active));
        assert_eq!(report.weakest.map(|weakest| (weakest.knot, weakest.row)), Some((0, 0)));
        let by_x0 = sensitivity.adjoint(&[0.0; 2], &[1.0]).unwrap();
        assert!((by_x0.x0[0] - slope).abs() < 1e-8, "{}", by_x0.x0[0]);
    }
}
