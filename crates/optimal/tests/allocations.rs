//! A solve allocates nothing, once the solver and its trace exist.
#![allow(unsafe_code)] // a counting allocator cannot be written without

mod common;

use common::{HANGING, cartpole, limited_cartpole, random, random_node, straight};
use condyle_dynamics::{Se3, Vec3, neutral, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle_optimal::{Fddp, Method, Problem, Sweep};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every request goes to the system's allocator unchanged; counting touches a thread-local without a destructor
// and allocates nothing itself.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller's promise about `layout` is the one that is asked for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: `pointer` came from `System.alloc` with this `layout`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(f: impl FnOnce()) -> usize {
    let before = COUNT.get();
    f();
    COUNT.get() - before
}

#[test]
fn the_counter_counts() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(7)))), 1);
}

#[test]
fn a_sweep_allocates_nothing() {
    let mut random = random();
    let nodes: Vec<_> = [7, 0, 3, 0].map(|nu| random_node(&mut random, 11, nu)).into();
    let mut sweep = Sweep::new(&nodes);
    assert_eq!(allocations(|| sweep.run(&nodes, 1e-9).unwrap()), 0);
}

#[test]
fn a_solve_allocates_nothing() {
    for lanes in [1, 4] {
        let mut problem = cartpole(&HANGING, 50, lanes);
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        let mut iterations = 0;
        // The first solve reserves the trace and the step lengths: two allocations.
        let first = allocations(|| {
            solver.solve_with(&mut problem, &xs, &[0.0; 50], |_| iterations += 1).unwrap();
        });
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        });
        assert_eq!((iterations, first, second), (34, 2, 0));
    }
}

#[test]
fn a_bounded_solve_allocates_nothing() {
    for method in [Method::Ddp, Method::Fddp] {
        let mut problem = limited_cartpole(&HANGING, 50, 4, Some([vec![-8.0], vec![6.0]]));
        let xs = straight(problem.x0(), problem.x0(), 50);
        let mut solver = Fddp::new(&problem);
        solver.settings.method = method;
        solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
        });
        assert_eq!(second, 0, "{method:?}");
    }
}

#[test]
fn a_step_of_a_closed_loop_allocates_nothing() {
    let mut problem = cartpole(&HANGING, 50, 1);
    let xs = straight(problem.x0(), problem.x0(), 50);
    let mut solver = Fddp::new(&problem);
    solver.settings.max_iterations = 3;
    solver.settings.time_budget = Some(std::time::Duration::from_secs(10));
    solver.solve(&mut problem, &xs, &[0.0; 50]).unwrap();
    let count = allocations(|| {
        problem.shift(0).unwrap();
        solver.shift(&mut problem).unwrap();
        problem.set_x0(&[0.1, 3.1, 0.0, 0.0]).unwrap();
        solver.resume(&mut problem).unwrap();
    });
    assert_eq!(count, 0);
}

#[test]
fn a_robots_solve_allocates_nothing() {
    for model in [robots::arm7(), robots::quadruped()].map(std::sync::Arc::new) {
        let x0 = [neutral(&model), vec![0.0; model.nv()]].concat();
        let nu = model.nv() - if model.nq() == model.nv() { 0 } else { 6 };
        let frame = model.frames().len() - 1;
        let goal = Vec3::new(0.3, 0.2, 0.1);
        let costs = || {
            vec![
                Cost::new("state", 1e-2, Residual::State { reference: x0.clone() }, Activation::Quadratic),
                Cost::new("place", 1.0, Residual::FrameTranslation { frame, target: goal }, Activation::Quadratic),
                Cost::new(
                    "pose",
                    1.0,
                    Residual::FramePlacement { frame, target: Se3::identity() },
                    Activation::Quadratic,
                ),
            ]
        };
        let effort = Residual::Control { reference: vec![0.0; nu] };
        let bounds = Activation::Barrier { lower: vec![-1.0; nu], upper: vec![1.0; nu] };
        let running = [costs(), vec![Cost::new("effort", 1e-3, effort, bounds)]].concat();
        let mut action = FreeDynamics::running(model.clone(), 0.01, running).unwrap();
        let us = action.quasi_static(&x0).repeat(10);
        let end = FreeDynamics::terminal(model.clone(), costs()).unwrap();
        let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 10], Box::new(end)).unwrap();
        let xs = x0.repeat(11);
        let mut solver = Fddp::new(&problem);
        solver.settings.max_iterations = 5;
        solver.solve(&mut problem, &xs, &us).unwrap();
        let second = allocations(|| {
            solver.solve(&mut problem, &xs, &us).unwrap();
        });
        assert_eq!(second, 0, "{}", model.name());
    }
}
