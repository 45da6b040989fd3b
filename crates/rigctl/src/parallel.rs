//! Independent pieces of work on all cores.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Called after each finished piece of work with how many are finished and how many there are.
pub type Progress<'a> = dyn Fn(usize, usize) + Sync + 'a;

/// How many cores the machine has; 1 if it does not say.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, |n| n.get())
}

/// `f` of 0 to `count`, in order, on as many threads as the machine has cores.
pub fn parallel<T: Send>(progress: &Progress<'_>, count: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
    parallel_on(cores(), progress, count, f)
}

/// The same on the given number of threads.
pub fn parallel_on<T: Send>(
    threads: usize,
    progress: &Progress<'_>,
    count: usize,
    f: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let workers = threads.clamp(1, count.max(1));
    let (next, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let mut results: Vec<(usize, T)> = std::thread::scope(|scope| {
        let work = || {
            let take = || next.fetch_add(1, Ordering::Relaxed);
            let one = |k| {
                let result = (k, f(k));
                progress(1 + finished.fetch_add(1, Ordering::Relaxed), count);
                result
            };
            std::iter::repeat_with(take).take_while(|k| *k < count).map(one).collect::<Vec<_>>()
        };
        let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        // A panic in `f` goes on in the caller.
        threads.into_iter().flat_map(|t| t.join().unwrap_or_else(|p| std::panic::resume_unwind(p))).collect()
    });
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, value)| value).collect()
}
