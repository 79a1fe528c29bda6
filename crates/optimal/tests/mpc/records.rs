//! Records: the calls of a controller are made again, and the results have the same bits.

use condyle_dynamics::{ContactConstraint, ReferenceFrame, neutral, robots};
use condyle_optimal::record::{Call, ContactChange, Difference, Numbers, Record, RecordedSolver, SolverSettings};
use condyle_optimal::robot::{
    Activation, Contact, Cost, Dynamics, FrictionCone, Integrator, Knot, Limit, Residual, RobotProblem,
};
use condyle_optimal::{Error, InteriorPointSettings, Problem, Settings};
use serde_json::{Value, json};

const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
const KNOTS: usize = 6;

/// Returns a problem of a quadruped that stands, first on four feet and then on two.
fn standing(limited: bool) -> RobotProblem {
    let model = robots::quadruped();
    let mut x0 = [neutral(&model), vec![0.0; 18]].concat();
    x0[2] = 0.5354;
    for (k, q) in x0[7..19].iter_mut().enumerate() {
        *q = [0.0, 0.7, -1.4, 0.0, -0.7, 1.4][k % 6];
    }
    let weights = [vec![1.0; 18], vec![0.1; 18]].concat();
    let state =
        || Cost::new("state", 1.0, Residual::State { reference: x0.clone() }, Activation::Weighted(weights.clone()));
    let knot = |feet: &[&str]| {
        let point = |foot: &&str| {
            let frame = model.frame(foot).unwrap();
            let at = ContactConstraint {
                reference: ReferenceFrame::LocalWorldAligned,
                kd: 50.0,
                ..ContactConstraint::point(frame)
            };
            Contact::new(foot, at)
        };
        let contacts = feet.iter().map(point).collect();
        let step = Integrator::SemiImplicitEuler;
        let dynamics = Dynamics::Contact { contacts, damping: 0.0, actuation: None, integrator: step, dt: 0.02 };
        let effort = Residual::Control { reference: vec![0.0; 12] };
        let mut knot = Knot::new(dynamics, vec![state(), Cost::new("effort", 1e-3, effort, Activation::Quadratic)]);
        for foot in feet {
            let cone = FrictionCone::new(0.5);
            let (lower, upper) = cone.bounds();
            let grip = Residual::FrictionCone { contact: (*foot).into(), cone };
            match limited {
                true => knot.limits.push(Limit::new(foot, grip, lower, upper)),
                false => knot.costs.push(Cost::new(foot, 0.1, grip, Activation::Barrier { lower, upper })),
            }
        }
        knot
    };
    let knots = vec![knot(&FEET), knot(&[FEET[0], FEET[3]])];
    let terminal = Knot::new(Dynamics::Terminal, vec![state()]);
    RobotProblem { x0: x0.clone(), knots, knot_models: vec![0; KNOTS], terminal, model }
}

/// Records a loop with every call that a record contains.
fn recorded(solver: SolverSettings) -> Record {
    let limited = !matches!(solver, SolverSettings::Fddp { .. });
    let data = standing(limited);
    let mut record = Record::new(data.clone(), solver);
    let (mut problem, mut solver) = record.start().unwrap();
    let xs = data.x0.repeat(KNOTS + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let mut make = |call| record.make(&mut problem, &mut solver, call).unwrap();
    make(Call::Solve { xs: xs.clone().into(), us: us.into() });
    for k in 0..8 {
        let mut x0 = data.x0.clone();
        x0[19 + k % 6] += 0.05;
        let mut targets = xs.clone();
        targets[2] += 0.01 * k as f64;
        make(Call::Shift { last: usize::from(k % 3 == 2) });
        make(Call::SetReferences { name: "state".into(), values: targets.into() });
        make(Call::SetX0 { x0: x0.into() });
        match k {
            1 => make(Call::SetWeight { name: "effort".into(), weight: 2e-3 }),
            0 => make(Call::SetParameter { name: "gravity".into(), values: vec![0.0, 0.0, -9.8].into() }),
            2 => make(Call::SetWeights { name: "state".into(), weights: vec![2.0; KNOTS + 1].into() }),
            3 => make(Call::SetEntryWeights { name: "state".into(), weights: vec![0.5; 36 * (KNOTS + 1)].into() }),
            4 => {
                let change = ContactChange { kp: Some((20.0, None)), kd: Some(40.0), ..ContactChange::default() };
                make(Call::SetContact { contact: "LF_foot".into(), change: Box::new(change) });
            }
            5 => make(Call::SetKnot { knot: 0, model: Box::new(data.knots[0].clone()) }),
            6 => make(Call::SetDuration { knot: 1, dt: 0.03 }),
            7 => make(Call::SetCosts { knot: KNOTS, costs: vec![data.terminal.costs[0].clone()] }),
            _ => {}
        }
        if k == 4 && limited {
            let values = (0..=KNOTS).map(|t| vec![0.1; if t < KNOTS { 5 } else { 0 }].into()).collect();
            make(Call::SetMultipliers { name: "LF_foot".into(), values });
        }
        match k % 3 {
            0 => make(Call::ResumeToFullStep { most: 3 }),
            1 => make(Call::Tick { sweeps: 2 }),
            _ => make(Call::Resume),
        }
    }
    let durations: Numbers = [vec![0.01], vec![0.02; KNOTS - 1]].concat().into();
    make(Call::Retime { elapsed: 0.01, knot_models: vec![0; KNOTS], durations });
    make(Call::Prepare { sweeps: 2 });
    make(Call::Feedback { x0: data.x0.clone().into(), most: 1 });
    make(Call::Reset { x0: data.x0.clone().into() });
    make(Call::SetKnots { knot_models: vec![0; KNOTS], durations: vec![0.02; KNOTS].into() });
    make(Call::Resume);
    record
}

fn settings() -> [SolverSettings; 2] {
    let interior_point = InteriorPointSettings { tolerance: 1e-4, ..InteriorPointSettings::default() };
    let fddp = Settings { max_iterations: 5, ..Settings::default() };
    [SolverSettings::InteriorPoint { settings: interior_point }, SolverSettings::Fddp { settings: fddp }]
}

#[test]
fn a_replay_has_the_same_bits() {
    for settings in settings() {
        let record = recorded(settings);
        assert_eq!((record.ticks().len(), record.replay().unwrap()), (11, None));
        let text = serde_json::to_string(&record).unwrap();
        let read: Record = serde_json::from_str(&text).unwrap();
        assert_eq!(read.ticks(), record.ticks());
        assert_eq!(read.replay().unwrap(), None);
    }
}

/// Checks that the first tick and the first array with another bit are named.
#[test]
fn a_replay_names_the_first_difference() {
    let [_, settings] = settings();
    let record = recorded(settings);
    let changed = |change: &dyn Fn(&mut Value)| -> Difference {
        let mut text = serde_json::to_value(&record).unwrap();
        change(&mut text["ticks"]);
        serde_json::from_value::<Record>(text).unwrap().replay().unwrap().unwrap()
    };
    let found = changed(&|ticks| ticks[5]["gains"] = json!(ticks[5]["gains"].as_u64().unwrap() ^ 1));
    assert_eq!((found.tick, found.array), (5, "K"));
    assert_eq!(found.to_string(), "tick 5: K differs");
    let found = changed(&|ticks| ticks[4]["us"] = ticks[3]["us"].clone());
    assert!((found.tick, found.array) == (4, "us") && found.largest > 0.0, "{found}");
    // the third call of a tick is its initial state, which changes the result of the tick
    let found = changed(&|ticks| ticks[2]["calls"][2] = ticks[1]["calls"][2].clone());
    assert!((found.tick, found.array) == (2, "xs") && found.largest > 0.0, "{found}");
    assert!(found.to_string().starts_with("tick 2: xs differs by up to "), "{found}");
}

#[test]
fn changed_settings_are_recorded() {
    let [_, settings] = settings();
    let mut record = Record::new(standing(false), settings);
    let (mut problem, mut solver) = record.start().unwrap();
    let xs = problem.x0().repeat(KNOTS + 1);
    let us = problem.quasi_static(&xs).unwrap();
    let solve = Call::Solve { xs: xs.into(), us: us.into() };
    record.make(&mut problem, &mut solver, solve.clone()).unwrap();
    let RecordedSolver::Fddp(fddp) = &mut solver else { unreachable!() };
    fddp.settings.max_iterations = 1;
    record.make(&mut problem, &mut solver, solve.clone()).unwrap();
    record.make(&mut problem, &mut solver, solve).unwrap();
    let kinds: Vec<_> = record.ticks().iter().map(|tick| tick.calls.len()).collect();
    assert_eq!((kinds, record.replay().unwrap()), (vec![1, 2, 1], None));
}

/// Checks calls that fail: they are made again, and fail again.
#[test]
fn refused_calls_are_replayed() {
    let [settings, _] = settings();
    let mut record = Record::new(standing(true), settings.clone());
    let (mut problem, mut solver) = record.start().unwrap();
    let early = record.make(&mut problem, &mut solver, Call::Tick { sweeps: 1 });
    assert_eq!(early, Err(Error::NothingToResume));
    let broken = Call::SetX0 { x0: vec![f64::NAN; 37].into() };
    assert!(record.make(&mut problem, &mut solver, broken).is_err());
    let xs = problem.x0().repeat(KNOTS + 1);
    let us = problem.quasi_static(&xs).unwrap();
    record.make(&mut problem, &mut solver, Call::Solve { xs: xs.into(), us: us.into() }).unwrap();
    let text = serde_json::to_string(&record).unwrap();
    assert_eq!(serde_json::from_str::<Record>(&text).unwrap().replay().unwrap(), None);
    // a record that begins after the first solve cannot be replayed
    let mut late = Record::new(standing(true), settings);
    late.make(&mut problem, &mut solver, Call::Tick { sweeps: 2 }).unwrap();
    assert_eq!(late.replay(), Err(Error::NothingToResume));
}

#[test]
fn a_damaged_record_is_refused() {
    let [settings, _] = settings();
    let record = Record::new(standing(true), settings);
    let text = serde_json::to_value(&record).unwrap();
    let wrong = |key: &str, value: Value| {
        let mut text = text.clone();
        text[key] = value;
        serde_json::from_value::<Record>(text).unwrap_err().to_string()
    };
    assert!(wrong("version", json!(2)).contains("version: expected 1, found 2"));
    let tick = |xs: &str| json!([{ "calls": [], "status": "converged", "xs": xs, "us": "", "gains": 0 }]);
    assert!(wrong("ticks", tick("AAAA")).contains("an array has 3 bytes"));
    assert!(wrong("ticks", tick("A*AA")).contains("not base64"));
    let knot = Call::SetDuration { knot: KNOTS, dt: 0.1 };
    let (mut problem, mut solver): (Problem, _) = record.start().unwrap();
    assert!(matches!(knot.make(&mut problem, &mut solver), Err(Error::Size { name: "knot", .. })));
}
