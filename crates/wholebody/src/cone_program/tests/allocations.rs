//! Tests that a solve does not allocate memory, whatever sizes are in use.

#[path = "../../../../../tests/common/counting.rs"]
mod counting;

use super::random::{Draw, Kind};
use super::walk::Walk;
use crate::cone_program::{InteriorPoint, Settings, Solver, Start};
use counting::allocated;

#[test]
fn a_solve_allocates_nothing() {
    let walk = Walk::humanoid(2);
    let mut program = walk.program();
    let mut solver = InteriorPoint::new(program.capacity(), Settings::default());
    for tick in 0..10 {
        walk.write(tick, &mut program);
        // In each tick, contacts appear and disappear, rows become equalities, and bounds become infinite.
        program.cones.truncate(8 - tick % 3);
        program.size.cone_rows = 3 * program.cones.len();
        program.size.rows = 96 - tick;
        program.lower[5] = program.upper[5];
        program.upper[7] = f64::INFINITY;
        let before = allocated();
        let outcome = solver.solve(&program, if tick % 4 == 0 { Start::Cold } else { Start::Warm });
        assert_eq!(allocated() - before, 0);
        assert_eq!(outcome.stopped, None);
    }
    for kind in Kind::ALL {
        let program = Draw::new(1).program(kind, 18, [3, 40, 6]);
        let mut solver = InteriorPoint::new(program.capacity(), Settings::default());
        let before = allocated();
        solver.solve(&program, Start::Cold);
        assert_eq!(allocated() - before, 0);
    }
}
