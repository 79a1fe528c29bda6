//! Runs each algorithm, so that `instructions.py` can count its instructions: the script runs this program under
//! callgrind, which finds the functions by name. Instruction counts are exact to 0.1 %, while times differ by 10 % from
//! run to run.

use condyle::optimal::Fddp;
use condyle::{Batch, Data, Model, random_configuration, robots};
use condyle_benches::motions::motion;
use condyle_benches::{cart_pole, quadrotor};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::sync::Arc;

/// Number of states that are used one after the other.
const STATES: usize = 16;

struct States {
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
}

impl States {
    fn random(model: &Model) -> Self {
        let mut rng = StdRng::seed_from_u64(1);
        let q = (0..STATES).flat_map(|_| random_configuration(model, &mut rng)).collect();
        let [v, x] = [(); 2].map(|()| (0..STATES * model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
        Self { q, v, x }
    }

    fn each(&self, model: &Model, mut call: impl FnMut(&[f64], &[f64], &[f64])) {
        let (nq, nv) = (model.nq(), model.nv());
        for k in 0..STATES {
            call(&self.q[k * nq..][..nq], &self.v[k * nv..][..nv], &self.x[k * nv..][..nv]);
        }
    }
}

/// Defines one function for each algorithm. callgrind identifies each function by its name.
macro_rules! measured {
    ($($name:ident($m:ident, $d:ident, $q:ident, $v:ident, $x:ident) $call:expr;)*) => {
        mod measured {
            use super::*;
            $(
                #[inline(never)]
                pub(super) fn $name($m: &Model, $d: &mut Data<f64>, s: &States) {
                    s.each($m, |$q, $v, $x| _ = black_box($call));
                }
            )*
            #[inline(never)]
            pub(super) fn batch_aba_derivatives(m: &Model, b: &mut Batch, s: &States) {
                black_box(b.aba_derivatives(m, &s.q, &s.v, &s.x, &[]));
            }
            #[inline(never)]
            pub(super) fn batch_aba(m: &Model, b: &mut Batch, s: &States) {
                black_box(b.aba(m, &s.q, &s.v, &s.x, &[]));
            }
        }
        fn all(m: &Model, d: &mut Data<f64>, s: &States) {
            $(measured::$name(m, d, s);)*
        }
    };
}
measured! {
    rnea(m, d, q, v, x) condyle::rnea(m, d, q, v, x, &[]);
    aba(m, d, q, v, x) condyle::aba(m, d, q, v, x, &[]);
    crba(m, d, q, _v, _x) condyle::crba(m, d, q);
    minv(m, d, q, _v, _x) condyle::minv(m, d, q);
    rnea_derivatives(m, d, q, v, x) condyle::rnea_derivatives(m, d, q, v, x, &[]);
    aba_derivatives(m, d, q, v, x) condyle::aba_derivatives(m, d, q, v, x, &[]);
}

/// Number of FDDP iterations. (The next constant is the number of knots.)
const ITERATIONS: usize = 5;
const KNOTS: usize = 32;

fn main() {
    let robots = [
        ("cart_pole", cart_pole()),
        ("quadrotor", quadrotor()),
        ("arm7", robots::arm7()),
        ("quadruped", robots::quadruped()),
        ("humanoid", robots::humanoid()),
    ];
    let Some((_, m)) = std::env::args().nth(1).and_then(|name| robots.into_iter().find(|(robot, _)| *robot == name))
    else {
        println!("python3 benches/instructions.py runs this");
        return;
    };
    let (mut problem, xs, us) = motion(&Arc::new(m.clone()), KNOTS);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = ITERATIONS;
    black_box(solver.solve(&mut problem, &xs, &us).expect("a warm start that fits"));

    let (d, b, s) = (&mut Data::new(&m), &mut Batch::new(&m, STATES, 1), &States::random(&m));
    all(&m, d, s);
    // A first call allocates the matrices that it returns, so this call is not counted.
    black_box(b.aba_derivatives(&m, &s.q, &s.v, &s.x, &[]));
    measured::batch_aba(&m, b, s);
    measured::batch_aba_derivatives(&m, b, s);
}
