//! Tests of slices that are split into parts, on which several threads work.

use condyle_linalg::threads::Parts;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Checks four threads that compete for every phase of every part. Each phase of a part is executed once and in order,
/// and each thread sees the data that the previous thread wrote.
#[test]
fn each_stage_of_each_part_is_done_once() {
    let (cuts, phases) = ([0, 3, 3, 4, 9, 16, 40], 5);
    let (mut first, mut second, mut states) = (vec![0_usize; 40], vec![String::new(); 40], Vec::new());
    for _ in 0..50 {
        first.fill(0);
        second.iter_mut().for_each(String::clear);
        let done = AtomicUsize::new(0);
        let parts = Parts::new(&mut first, &mut second, &cuts, &mut states);
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    while (0..parts.count()).any(|part| parts.awaits(part, phases - 1)) {
                        for (part, phase) in (0..parts.count()).flat_map(|part| (0..phases).map(move |s| (part, s))) {
                            let worked = parts.work(part, phase, |start, first, second| {
                                for (i, (x, text)) in first.iter_mut().zip(second).enumerate() {
                                    assert_eq!(*x, usize::from(phase) * (start + i));
                                    *x += start + i;
                                    text.push(char::from(b'0' + phase));
                                }
                            });
                            done.fetch_add(usize::from(worked), Ordering::Relaxed);
                        }
                        thread::yield_now();
                    }
                });
            }
        });
        assert!(!parts.is_abandoned());
        assert_eq!(done.into_inner(), parts.count() * usize::from(phases));
        assert!(first.iter().enumerate().all(|(i, x)| *x == 5 * i));
        assert!(second.iter().all(|text| text == "01234"));
    }
}

#[test]
fn a_panic_is_reported_and_its_part_does_not_advance() {
    let (mut first, mut second, mut states) = ([1, 2], [3, 4], Vec::new());
    let parts = Parts::new(&mut first, &mut second, &[0, 1, 2], &mut states);
    let panics = catch_unwind(AssertUnwindSafe(|| parts.work(1, 0, |start, first, _| assert_eq!(start, first.len()))));
    assert!(panics.is_ok(), "part 1 begins with item 1 and has one");
    let panics = catch_unwind(AssertUnwindSafe(|| parts.work(1, 1, |_, _, _| panic!("on purpose"))));
    assert!(panics.is_err() && parts.is_abandoned());
    assert!(!parts.work(1, 1, |_, _, _| ()) && !parts.work(1, 2, |_, _, _| ()));
    assert!(parts.work(0, 0, |_, first, second| first[0] += second[0]));
    assert_eq!(first, [4, 2]);
}

#[test]
#[should_panic(expected = "cuts do not ascend from 0 to the length of both slices")]
fn cuts_must_cover_the_slices() {
    let (mut first, mut second, mut states) = ([0; 3], [0; 3], Vec::new());
    Parts::new(&mut first, &mut second, &[0, 2], &mut states);
}
