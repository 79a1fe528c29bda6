//! clarabel's patterns grow with the numbers.

use super::random::{Draw, Kind};
use crate::cone_program::{Clarabel, ConeProgram, Settings, Solver, Start};

/// Of x, of size one; both solves have the tolerance 1e-9.
const AGREEMENT: f64 = 1e-6;

fn assert_same(kept: &mut Clarabel, program: &ConeProgram) {
    let mut new = Clarabel::new(program.capacity(), Settings::default());
    let (a, b) = (kept.solve(program, Start::Cold), new.solve(program, Start::Cold));
    assert!(a.stopped.is_none() && b.stopped.is_none());
    for (a, b) in kept.x().iter().zip(new.x()) {
        assert!((a - b).abs() < AGREEMENT, "{a} {b}");
    }
}

/// Zeros of P, A, G and F become numbers, and zeros again.
#[test]
fn numbers_come_where_there_were_zeros() {
    for seed in 0..10 {
        let mut draw = Draw::new(seed);
        let full = draw.program(Kind::Plain, 6, [2, 5, 2]);
        let mut sparse = full.clone();
        (0..6).for_each(|j| (j + 1..6).for_each(|i| sparse.P[(i, j)] = 0.0));
        for matrix in [&mut sparse.At, &mut sparse.Gt, &mut sparse.Ft] {
            matrix.iter_mut().step_by(4).for_each(|x| *x = 0.0);
        }
        let mut kept = Clarabel::new(full.capacity(), Settings::default());
        kept.solve(&sparse, Start::Cold);
        assert_same(&mut kept, &full);
        assert_same(&mut kept, &full);
        assert_eq!(kept.solve(&sparse, Start::Cold).stopped, {
            Clarabel::new(full.capacity(), Settings::default()).solve(&sparse, Start::Cold).stopped
        });
    }
}
