//! Work that rayon's threads share, also in a process that fork() created from a process with such threads.
//!
//! fork() copies the memory of a process, but only one of its threads: the calling thread. The child process has a copy
//! of the parent's thread pool without the threads, and waiting for this pool never ends. So each process starts its
//! own pool.

use rayon::{ThreadPool, ThreadPoolBuilder};
use std::error::Error;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Id of the process that uses rayon's global pool: the first process that shared work. The value is 0 before any work
/// is shared.
static FIRST: AtomicU32 = AtomicU32::new(0);

/// Number of threads of the global pool; 1 if the pool could not be started.
static GLOBAL: OnceLock<usize> = OnceLock::new();

/// Pool of the first process that was forked from the process `FIRST` and shared work.
static FORKED: OnceLock<Forked> = OnceLock::new();

/// Pool of a forked process. The pool is never dropped. It is read without a lock: if another thread held the lock
/// during a fork, the child process would wait forever.
struct Forked {
    process: u32,
    /// Thread pool; `None` if no thread could be started.
    pool: Option<ThreadPool>,
    /// Pool of a process that was forked from this process.
    next: OnceLock<Box<Forked>>,
}

/// Thread pool on which a thread shares work.
enum Pool {
    /// Pool to which the calling thread belongs.
    Current,
    /// Global pool.
    Global,
    /// Pool of a forked process.
    Forked(&'static ThreadPool),
    /// No pool: no thread could be started.
    Missing,
}

/// Returns the pool in which the calling thread shares work.
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

/// Starts the global pool unless it exists, and returns the number of threads in the pool.
fn start_global() -> usize {
    match ThreadPoolBuilder::new().build_global() {
        Err(error) if error.source().is_some() => 1, // the operating system cannot start a thread
        _ => rayon::current_num_threads(),
    }
}

impl Forked {
    /// Starts a pool for this process, with as many threads as the parent's pool.
    fn start(process: u32) -> Self {
        let threads = GLOBAL.get().copied().unwrap_or(0); // 0: one thread per processor
        Self { process, pool: ThreadPoolBuilder::new().num_threads(threads).build().ok(), next: OnceLock::new() }
    }
}

/// Returns the number of threads that share work. Inside a rayon pool, these are the threads of that pool. Outside a
/// pool, they are the threads of the global pool. In a forked process, another pool replaces the global pool.
pub fn threads() -> usize {
    match pool() {
        Pool::Current | Pool::Global => rayon::current_num_threads(),
        Pool::Forked(pool) => pool.current_num_threads(),
        Pool::Missing => 1,
    }
}

/// Executes two closures, at the same time if one of the [`threads`] is free.
pub fn join(one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    let (mut one, mut other) = (Some(one), Some(other));
    join_dyn(&mut || one.take().into_iter().for_each(|one| one()), &mut || {
        other.take().into_iter().for_each(|other| other());
    });
}

/// Executes [`join`] for all types of closures. This function is compiled only once, because rayon's code takes some
/// kilobytes for each type of closure. A calling thread outside the pool runs the first closure itself, because waking
/// another thread takes about 50 µs, and because the data is still in the cache of the caller's core.
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

/// Waits briefly for another thread, and yields the processor in case both threads need the same processor.
pub fn pause() {
    for _ in 0..32 {
        std::hint::spin_loop();
    }
    std::thread::yield_now();
}
