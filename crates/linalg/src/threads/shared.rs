//! Threads that share work: those of rayon, also in a process that was forked from one that had them.
//!
//! A fork copies the memory of a process, but of its threads only the one that forks. A pool of threads that was started
//! before is there in the child, and has nobody in it: who waits for it waits for ever. So each process shares work in a
//! pool that it has started itself.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::error::Error;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// The process that works in rayon's global pool: the first one that asks for threads. 0 until then.
static FIRST: AtomicU32 = AtomicU32::new(0);

/// The number of threads of the global pool; 1 if it could not be started.
static GLOBAL: OnceLock<usize> = OnceLock::new();

/// The pool of the first process that was forked from `FIRST` and asked for threads.
static FORKED: OnceLock<Forked> = OnceLock::new();

/// The pool of a forked process. It is never dropped, and read without a lock, which a thread might hold at a fork.
struct Forked {
    process: u32,
    /// None if no thread could be started.
    pool: Option<ThreadPool>,
    /// The pool of a process that was forked from this one.
    next: OnceLock<Box<Forked>>,
}

/// Where work is shared.
enum Pool {
    /// The pool that the calling thread belongs to.
    Current,
    /// The global pool.
    Global,
    /// The pool of a forked process.
    Forked(&'static ThreadPool),
    /// Nowhere: no thread could be started.
    Missing,
}

/// The pool in which the calling thread shares work.
fn pool() -> Pool {
    if rayon::current_thread_index().is_some() {
        return Pool::Current;
    }
    let process = std::process::id();
    let first = FIRST.compare_exchange(0, process, Ordering::Relaxed, Ordering::Relaxed).unwrap_or_else(|first| first);
    if first == 0 || first == process {
        return if *GLOBAL.get_or_init(start_global) > 1 { Pool::Global } else { Pool::Missing };
    }
    let mut forked = FORKED.get_or_init(|| Forked::start(process));
    while forked.process != process {
        forked = forked.next.get_or_init(|| Box::new(Forked::start(process)));
    }
    forked.pool.as_ref().map_or(Pool::Missing, Pool::Forked)
}

/// Starts the global pool, unless somebody has; returns the number of its threads.
fn start_global() -> usize {
    match ThreadPoolBuilder::new().build_global() {
        Err(error) if error.source().is_some() => 1, // the system refuses threads
        _ => rayon::current_num_threads(),
    }
}

impl Forked {
    /// A pool for this process, of as many threads as the one that is lost.
    fn start(process: u32) -> Self {
        let threads = GLOBAL.get().copied().unwrap_or(0); // 0: as many as there are processors
        Self { process, pool: ThreadPoolBuilder::new().num_threads(threads).build().ok(), next: OnceLock::new() }
    }
}

/// The number of threads that share work: those of the pool of rayon in which it is called, else of the global one, or in a
/// forked process of one that takes its place.
pub fn threads() -> usize {
    match pool() {
        Pool::Current | Pool::Global => rayon::current_num_threads(),
        Pool::Forked(pool) => pool.current_num_threads(),
        Pool::Missing => 1,
    }
}

/// Does two pieces of work, at the same time if one of the [`threads`] is free.
pub fn join(one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    let (mut one, mut other) = (Some(one), Some(other));
    join_dyn(&mut || one.take().into_iter().for_each(|one| one()), &mut || {
        other.take().into_iter().for_each(|other| other());
    });
}

/// [`join`], compiled once for all kinds of work: what rayon makes of each is some kilobytes. A thread that is not of the pool
/// does its piece itself: to be woken takes a thread some 50 µs, and what a core has in its cache stays there.
fn join_dyn(one: &mut (dyn FnMut() + Send), other: &mut (dyn FnMut() + Send)) {
    match pool() {
        Pool::Current => {
            rayon::join(one, other);
        }
        Pool::Global => rayon::in_place_scope(|scope| {
            scope.spawn(|_| other());
            one();
        }),
        Pool::Forked(pool) => pool.in_place_scope(|scope| {
            scope.spawn(|_| other());
            one();
        }),
        Pool::Missing => {
            one();
            other();
        }
    }
}

/// Waits a little for another thread, and lets it have the processor if both need the same one.
pub fn pause() {
    for _ in 0..32 {
        std::hint::spin_loop();
    }
    std::thread::yield_now();
}
