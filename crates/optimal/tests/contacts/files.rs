//! Problems that are written to files and read again.

use super::{DT, contact_costs, feet, random, random_state, rotation};
use condyle_dynamics::{ConstraintKind, ReferenceFrame, Vec3, robots};
use condyle_optimal::robot::{
    Activation, ControlBounds, ControlPolynomial, Cost, Dynamics, FrameName, FrictionCone, Integrator, Knot, Limit,
    Residual, RobotProblem,
};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng, rngs::StdRng};

/// Creates a problem as data, with every kind of knot, residual and activation.
fn problem_as_data(rng: &mut StdRng) -> RobotProblem {
    let model = robots::humanoid();
    let nv = model.nv();
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let costs = contact_costs(&model, &contacts, nv - 6, rng);
    let foot = || FrameName::from(&*contacts[0].name);
    let stand = Residual::FramePlacement { frame: foot(), target: condyle_dynamics::Se3::identity() };
    let point = Residual::FrameTranslation { frame: foot(), target: Vec3::new(0.1, -0.2, 0.3) };
    let rest = Residual::State { reference: random_state(&model, rng) };
    let still =
        |nu| vec![Cost::new("still", 0.1, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic)];
    let landing = Cost::new("landing", 0.3, Residual::ImpulseCenterOfMass, Activation::Quadratic);
    let (bounds, damping) = (|lower, upper| Some(ControlBounds { lower, upper }), 1e-8);
    let knot = |dynamics, costs, bounds| Knot { bounds, ..Knot::new(dynamics, costs) };
    let infinite = f64::INFINITY;
    let above = |residual: &Residual| Limit::new("above", residual.clone(), vec![0.1; 3], vec![infinite; 3]);
    let actuation = Some(DMatrix::from_fn(nv, 3, |_, _| rng.random()));
    let free = Dynamics::Free { actuation, integrator: Integrator::RungeKutta4, dt: DT };
    let inverse = Dynamics::Inverse { integrator: Integrator::SemiImplicitEuler, dt: 0.1 };
    let mut touch = contacts.clone();
    (touch[0].constraint.kind, touch[0].constraint.axes) = (ConstraintKind::Line, rotation(rng));
    let impulse = Dynamics::Impulse { contacts: touch, restitution: 0.2, damping };
    let integrator = Integrator::RungeKutta2;
    let backwards = Dynamics::ContactInverse { contacts: contacts.clone(), actuation: None, integrator, dt: DT };
    let stance_foot = contacts[1].name.clone();
    let contact = Dynamics::Contact { contacts, damping, actuation: None, integrator, dt: DT };
    let mut stance = knot(contact, costs, bounds(vec![f64::NEG_INFINITY; nv - 6], vec![9.0; nv - 6]));
    stance.costs_at.insert(2, still(nv - 6));
    stance.limits.push(above(&point));
    let cone = FrictionCone::new(0.7);
    let (lower, upper) = cone.bounds();
    let grip = Residual::FrictionCone { contact: stance_foot, cone };
    stance.limits_at.insert(1, vec![Limit::new("grip", grip, lower, upper).softened(2.0, 0.5)]);
    let mut end = Knot::new(
        Dynamics::Terminal,
        vec![
            Cost::new("stand", 1.0, stand, Activation::Quadratic),
            Cost::new("point", 1.0, point.clone(), Activation::Quadratic),
            Cost::new("rest", 1.0, rest, Activation::Quadratic),
        ],
    );
    end.limits.push(above(&point));
    RobotProblem {
        x0: random_state(&model, rng),
        knots: vec![
            knot(free, still(3), bounds(vec![-1.0; 3], vec![f64::INFINITY; 3])),
            stance,
            knot(impulse, vec![landing], None),
            Knot { controls: ControlPolynomial::Quadratic, ..knot(inverse, still(nv), None) },
            knot(backwards, still(nv + 12), None),
        ],
        knot_models: vec![0, 1, 1, 2, 3, 4, 0],
        terminal: end,
        model,
    }
}

#[test]
fn a_problem_in_a_file_is_the_same_problem() {
    let mut rng = StdRng::seed_from_u64(23);
    let data = problem_as_data(&mut rng);
    let text = serde_json::to_string(&data).unwrap();
    let read: RobotProblem = serde_json::from_str(&text).unwrap();
    assert_eq!(read, data);
    assert!(text.contains(r#""upper":[null,null,null]"#) && text.contains("limits_at"));
    assert_eq!(serde_json::to_string(&read).unwrap(), text);
    let mut problems = [data, read].map(|data| data.build().unwrap());
    let xs = (0..=problems[0].horizon()).flat_map(|_| problems[0].x0().to_vec()).collect::<Vec<_>>();
    let us = random(problems[0].control_range(problems[0].horizon()).end, 1.0, &mut rng);
    let [one, other] = problems.each_mut().map(|problem| {
        let (mut next, mut costs) = (vec![0.0; problem.horizon() * problem.nx()], vec![0.0; problem.horizon() + 1]);
        problem.calc(&xs, &us, &mut next, &mut costs);
        let mut lq_knots = problem.lq_knots();
        problem.calc_diff(&xs, &us, &mut lq_knots);
        (next, costs, lq_knots)
    });
    assert_eq!(one.1, other.1);
    assert_eq!((one.0, one.2), (other.0, other.2));
}

#[test]
fn what_is_wrong_in_a_file_is_said() {
    let data = problem_as_data(&mut StdRng::seed_from_u64(24));
    let text = serde_json::to_string(&data).unwrap();
    let read = |text: &str| serde_json::from_str::<RobotProblem>(text).map(|_| ()).unwrap_err().to_string();
    assert!(read(&text.replace("damping\":1e-8", "dumping\":1e-8")).contains("unknown field `dumping`"));
    assert!(read(&text.replace("runge_kutta_2", "runge_kutta_5")).contains("unknown variant `runge_kutta_5`"));
    let built = |change: &dyn Fn(&mut RobotProblem)| {
        let mut data = data.clone();
        change(&mut data);
        data.build().map(|_| ()).unwrap_err().to_string()
    };
    assert_eq!(
        built(&|data| data.knots[0].bounds.as_mut().unwrap().upper.truncate(2)),
        "`upper`: expected length 3, found 2"
    );
    assert_eq!(
        built(&|data| data.knots[2].bounds = Some(ControlBounds { lower: vec![0.0], upper: vec![1.0] })),
        "`lower`: expected length 0, found 1"
    );
    assert_eq!(
        built(&|data| data.knots[2].controls = ControlPolynomial::Linear),
        "actuation: controls: a knot without duration has none to be a polynomial"
    );
    let bent = |data: &mut RobotProblem| {
        let Dynamics::Impulse { contacts, .. } = &mut data.knots[2].dynamics else { unreachable!("it is an impact") };
        contacts[0].constraint.axes.x.x = 2.0;
    };
    assert!(built(&bent).contains("its axes are no unit vectors at right angles"));
    assert!(built(&|data| data.knot_models[1] = 7).contains("there is no action model 7"));
    assert_eq!(
        built(&|data| data.knots[0] = Knot::new(Dynamics::Terminal, vec![])),
        "knot 0: models[0] has no next state, as an action of the end; a running one has a duration or an impact"
    );
    assert_eq!(
        built(&|data| data.terminal = data.knots[0].clone()),
        "terminal: expected an action without controls (a robot's has no duration), found one of nu = 3"
    );
    let landing = |data: &mut RobotProblem| data.terminal = data.knots[2].clone();
    let mut landed = data.clone();
    landing(&mut landed);
    assert_eq!(landed.build().map(|problem| problem.horizon()).unwrap(), 7); // an impact may be the last knot
    assert!(built(&|data| data.x0[0] = f64::NAN).contains("`x0[0]` is NaN"));
    assert_eq!(
        built(&|data| data.knots[1].limits_at.get_mut(&1).unwrap()[0].lower.truncate(4)),
        "limit `grip` of knot 1: its lower bound has 4 numbers, expected 5"
    );
    assert!(
        built(&|data| data.knots[0].limits = data.knots[1].limits_at[&1].clone())
            .starts_with("limit `grip`: there is no contact")
    );
    assert!(
        built(&|data| data.knots[1].costs_at.get_mut(&2).unwrap()[0].weight = f64::NAN).contains("its weight is NaN")
    );
}
