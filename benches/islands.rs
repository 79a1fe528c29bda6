//! Times several standing quadrupeds in one model, compared with a model of one quadruped: `cargo bench -p
//! condyle-benches --bench islands`, in µs per robot. A second table has the times for the same robots as separate
//! models, on one thread or on several threads. This table shows how much time one model could save at most if the
//! robots in it were computed in parallel. `islands.py` runs this program under callgrind and prints the instructions
//! of each function. callgrind identifies functions by name.

use condyle::{
    ConstraintSet, ContactConstraint, Data, Model, ModelBuilder, Se3, WORLD, constrained_dynamics,
    constrained_dynamics_derivatives,
    constraints::{impulse_dynamics, impulse_dynamics_derivatives},
    random_configuration, robots,
};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;
use std::hint::black_box;
use std::time::{Duration, Instant};

const ROBOTS: [usize; 6] = [1, 2, 4, 8, 16, 32];

/// Duration of the measurement of each function.
const TIME: Duration = Duration::from_millis(500);

/// Model of several quadrupeds, with the contacts between their feet and the ground, one robot after the other.
struct Herd {
    model: Model,
    data: Data<f64>,
    set: ConstraintSet<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    tau: Vec<f64>,
}

impl Herd {
    fn new(robots: usize) -> Self {
        let (one, mut builder) = (robots::quadruped(), ModelBuilder::new("herd"));
        for k in 0..robots {
            builder.append(WORLD, Se3::identity(), &one, &format!("{k}_"));
        }
        let model = builder.build().expect("robots side by side are one");
        let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
        let touch = |k: usize, foot: &str| {
            ContactConstraint::point(model.frame(&format!("{k}_{foot}")).expect("each quadruped has this foot"))
        };
        let contacts: Vec<_> = (0..robots).flat_map(|k| feet.map(|foot| touch(k, foot))).collect();
        let (data, set) = (Data::new(&model), ConstraintSet::new(&model, &contacts).expect("they stand"));
        let mut rng = StdRng::seed_from_u64(1);
        let q = random_configuration(&model, &mut rng);
        let [v, tau] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
        Self { model, data, set, q, v, tau }
    }
}

/// Defines one function for each algorithm. callgrind identifies each function by its name.
macro_rules! measured {
    ($($name:ident($h:ident) $call:expr;)*) => {
        mod measured {
            use super::*;
            $(
                #[inline(never)]
                pub(super) fn $name($h: &mut Herd) {
                    _ = black_box($call);
                }
            )*
        }
        const ALGORITHMS: [(&str, fn(&mut Herd)); 4] = [$((stringify!($name), measured::$name)),*];
    };
}
measured! {
    constrained(h) constrained_dynamics(&h.model, &mut h.data, &mut h.set, &h.q, &h.v, &h.tau, &[]);
    constrained_derivatives(h)
        constrained_dynamics_derivatives(&h.model, &mut h.data, &mut h.set, &h.q, &h.v, &h.tau, &[]);
    impulse(h) impulse_dynamics(&h.model, &mut h.data, &mut h.set, &h.q, &h.v, 0.0);
    impulse_derivatives(h) impulse_dynamics_derivatives(&h.model, &mut h.data, &mut h.set, &h.q, &h.v, 0.0);
}

/// Returns the time of a call in µs: the shortest of many measurements.
fn time(mut call: impl FnMut()) -> f64 {
    let (start, mut least) = (Instant::now(), f64::INFINITY);
    while start.elapsed() < TIME {
        let before = Instant::now();
        call();
        least = least.min(before.elapsed().as_secs_f64());
    }
    1e6 * least
}

fn main() {
    if let Some(robots) = std::env::args().nth(1).and_then(|robots| robots.parse().ok()) {
        let herd = &mut Herd::new(robots);
        ALGORITHMS.iter().for_each(|(_, algorithm)| algorithm(herd));
        return;
    }
    println!("| µs for each robot | {} |", ALGORITHMS.map(|(name, _)| name).join(" | "));
    println!("| --- |{}", " --- |".repeat(ALGORITHMS.len()));
    for robots in ROBOTS {
        let herd = &mut Herd::new(robots);
        let each = ALGORITHMS.map(|(_, algorithm)| format!("{:.2}", time(|| algorithm(herd)) / robots as f64));
        println!("| {robots} | {} |", each.join(" | "));
    }
    for (name, algorithm) in &ALGORITHMS[..2] {
        let threads = rayon::current_num_threads();
        println!("\n| µs for each robot, {name} | one model | apart | apart, {threads} threads |");
        println!("| --- | --- | --- | --- |");
        for robots in ROBOTS {
            let (herd, mut apart) = (&mut Herd::new(robots), (0..robots).map(|_| Herd::new(1)).collect::<Vec<_>>());
            let together = time(|| algorithm(herd));
            let alone = time(|| apart.iter_mut().for_each(algorithm));
            let shared = time(|| apart.par_iter_mut().for_each(algorithm));
            let [a, b, c] = [together, alone, shared].map(|t| t / robots as f64);
            println!("| {robots} | {a:.2} | {b:.2} | {c:.2} |");
        }
    }
}
